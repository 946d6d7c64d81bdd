"""The requested mission around a path, and the planner's margins for rounding on the wire, for every aircraft type.

`whole_cm`: altitudes in whole centimetres, so that rounding makes no leg steeper than its limit. A leg of some metres
that climbs at the limit is made too steep by a centimetre. So all way points are rounded together:
to the nearest centimetre, unless a leg beside one is too steep then.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Bools, Floats
from gcsplan.mavlink.mission.mission import AltitudeFrame
from gcsplan.vehicle import MissionEnd
from gcsplan.world.geometry.path import distances_m
from gcsplan.world.world import World

PathPoint = tuple[float, float, float]

LEG_BOW_M = 0.1
LONGEST_LEG_M = 5000.0


@dataclass(frozen=True, slots=True)
class Margins:
    """Margins that a planner keeps for the wire: rounding of altitudes, rounding and bow of tracks.

    They make paths longer, never bounds. ``slope``: the part of the climb limits that is kept beyond `slope_margin`,
    because a mission was too steep. ``rounding_m``: how far a mission's place may lie beside the one that was
    meant, in the plane and in altitude; bounds hold for all missions whose ends lie that near to the plan's.
    """

    altitude_m: float = 0.02
    track_m: float = 0.012
    bow_m: float = LEG_BOW_M
    slope: float = 0.0
    rounding_m: tuple[float, float] = (0.011, 0.01)


MARGINS = Margins()

FLOWN_SLOPE = 0.002
"""Part of the climb limits that is kept where legs are judged by arcs or over the posts of a terrain grid."""
LEAST_SLOPE, ROUNDED_RISE_M, CORNER_RISE_M = 1e-4, 0.012, 0.01
"""Part of the climb limits that every other path keeps; the metres of a climb that rounding may cost: a centimetre at a
way point between two legs, and two millimetres for their lengths; and what a leg of centimetres behind a corner costs,
for it does not climb."""


def slope_margin(rise_m: float, *, cut: bool) -> float:
    """Return the part of the climb limits that straight legs keep for rounding in a mission that climbs ``rise_m``;
    ``cut``: its corners may need another way point."""
    rounded_m = ROUNDED_RISE_M + (CORNER_RISE_M if cut else 0.0)
    return min(LEAST_SLOPE + rounded_m / max(rise_m, 1e-3), FLOWN_SLOPE)


@dataclass(frozen=True, slots=True)
class Wing:
    """The ends of a fixed wing's mission; points are (east_m, north_m, amsl_m).

    ``top``: end of the climb-out, straight ahead of home. ``touch``: end of the glide from the last way point, on the
    ground; None without a landing. ``circle_m``: radius of the circle at the goal, m. ``up``: centre and final altitude
    of a climbing circle after ``top``; None: it climbs straight. ``up_m``: the radius of that circle, m (negative:
    anticlockwise).
    """

    top: PathPoint
    touch: PathPoint | None = None
    circle_m: float = 0.0
    up: PathPoint | None = None
    up_m: float = 0.0

    @property
    def leaves(self) -> PathPoint:
        """The point at which the first leg begins."""
        return self.top if self.up is None else self.up


@dataclass(frozen=True, slots=True)
class Gates:
    """The places on its way at which a vehicle waits until a time of day; only ArduCopter can.

    ``at_m`` (K): metres over ground from the begin of its path, rising. ``opens_s`` (K): when each opens, seconds UTC
    since 1970. ``leaves_s``: when it leaves the ground; ``start_s``: the fleet's common start.
    """

    at_m: tuple[float, ...]
    opens_s: tuple[int, ...]
    leaves_s: float
    start_s: float


@dataclass(frozen=True, slots=True)
class Order:
    """The requested mission around a path; ``speed_m_s`` None means the fastest cruise.

    ``spaced``: drop way points nearer to their neighbours than two acceptance radii. ``hold_s``: seconds to wait in the
    air above the start (the gate) before departure; only multicopters can (`Vehicle.can_hold`). ``bow_m``: legs are cut
    until each is that straight in the plane and in degrees at once. ``gate_utc``: wait
    there until this hour, minute and second of the day, UTC, instead; only ArduCopter can. ``wing``: the ends of a
    fixed wing's mission, None for aircraft that can hover. ``return_path``: behind the end, add a return path back
    along the track to a landing at home, to which ArduCopter returns by Auto RTL. ``exact``: places (east_m, north_m)
    whose altitude the mission file gives: it is the nearest centimetre, even where a leg beside it gets too steep.
    ``gates``: places on the way at which it waits until a time of day.
    """

    end: MissionEnd = "land"
    altitude_frame: AltitudeFrame = "relative"
    speed_m_s: float | None = None
    spaced: bool = True
    hold_s: int = 0
    gate_utc: tuple[int, int, int] | None = None
    wing: Wing | None = None
    return_path: bool = False
    bow_m: float = LEG_BOW_M
    exact: tuple[tuple[float, float], ...] = ()
    gates: Gates | None = None


GATE_APART_M = 10.0
"""Metres from a way point below which a gate is at that way point, not at one of its own."""


def with_gates(points: Floats, at_m: tuple[float, ...]) -> tuple[Floats, list[int]]:
    """Points (N, 3) with way points for gates at metres over ground from the first; and which of them are gates.

    A gate within `GATE_APART_M` of an inner way point is at that one.
    """
    for metres in at_m:
        along = distances_m(points)
        if len(points) > 2 and np.abs(along[1:-1] - metres).min() < GATE_APART_M:
            continue
        k = int(np.clip(np.searchsorted(along, metres), 1, len(points) - 1))
        part = (metres - along[k - 1]) / (along[k] - along[k - 1])
        points = np.insert(points, k, points[k - 1] + part * (points[k] - points[k - 1]), axis=0)
    along = distances_m(points)
    return points, [1 + int(np.abs(along[1:-1] - metres).argmin()) for metres in at_m]


def split_legs(points: Floats, world: World, most_bow_m: float = LEG_BOW_M) -> Floats:
    """(N, 3) points with legs cut to at most `LONGEST_LEG_M` and until the bow of each is at most ``most_bow_m``."""
    places = world.frame.to_degrees(points[:, 0], points[:, 1])
    bow = world.frame.bow_m(places[:-1], places[1:])
    run = np.hypot(*np.diff(points[:, :2], axis=0).T)
    parts = np.maximum(np.ceil(run / LONGEST_LEG_M), np.ceil(np.sqrt(bow / most_bow_m)))  # n parts: bow / n²
    cut = [points[:1]]
    for a, b, n in zip(points[:-1], points[1:], np.maximum(parts, 1).astype(int), strict=True):
        cut.append(a + (b - a) * (np.arange(1, n + 1) / n)[:, None])
        cut[-1][-1] = b
    return np.concatenate(cut)


MOVED_CM = (0.5, 1.0, 1.5, 2.5, 4.0, 6.0, 10.0, 15.0, 25.0)
"""How far altitudes may be moved, tried in turn; beyond what the planner keeps for rounding the check decides."""
MOST_CM = 1e9
"""More than any leg climbs."""
SPARE_CM = 0.05
"""Kept from each limit: PX4 stores altitudes as single-precision metres, and the check adds what is below home."""


def most_cm(run_m: Floats, slope: float) -> Floats:
    """(N,) centimetres that legs of ``run_m`` (N,) over the ground may rise at ``slope`` (rise over run, or inf)."""
    if np.isinf(slope):
        return np.full(len(run_m), np.inf)
    return np.asarray(np.maximum(100.0 * slope * run_m - SPARE_CM, 0.0))


def whole_cm(given_cm: Floats, up_cm: Floats, down_cm: Floats, fixed: Bools) -> NDArray[np.int_]:
    """(N,) whole centimetres near ``given_cm`` (N,), of which leg k climbs at most ``up_cm[k]`` and descends at most
    ``down_cm[k]`` (N - 1,), inf for no limit. The first, the last and ``fixed`` (N,) ones are the nearest centimetre.

    No altitude is moved farther than one of them must be, in steps of `MOVED_CM`. Where no such altitudes are found,
    all are the nearest centimetre.
    """
    near = np.rint(given_cm).astype(int)
    rise = np.diff(near)
    if not ((rise > up_cm) | (-rise > down_cm)).any():
        return near
    fixed = fixed.copy()
    fixed[[0, -1]] = True
    up, down = (np.floor(np.minimum(most, MOST_CM)).astype(int) for most in (up_cm, down_cm))
    for moved in MOVED_CM:
        low = np.where(fixed, near, np.minimum(near, np.ceil(given_cm - moved).astype(int)))
        high = np.where(fixed, near, np.maximum(near, np.floor(given_cm + moved).astype(int)))
        found = _between(near, low, high, up, down)
        if found is not None:
            return found
    return near


def none_zero(cm: NDArray[np.int_], given_cm: Floats, up_cm: Floats, down_cm: Floats) -> NDArray[np.int_]:
    """(N,) the altitudes ``cm`` (N,) with 1 or -1 instead of 0, on the side of ``given_cm`` unless a leg beside it is
    too steep there alone. For ArduCopter, which keeps its altitude at an item whose altitude is 0."""
    found = cm.copy()
    for k in np.flatnonzero(cm == 0).tolist():
        near = 1 if given_cm[k] >= 0.0 else -1
        for found[k] in (near, -near, near):
            rise = np.diff(found[max(k - 1, 0) : k + 2])
            beside = slice(max(k - 1, 0), k + 1)
            if (rise <= up_cm[beside]).all() and (-rise <= down_cm[beside]).all():
                break
    return found


def _between(
    near: NDArray[np.int_], low: NDArray[np.int_], high: NDArray[np.int_], up: NDArray[np.int_], down: NDArray[np.int_]
) -> NDArray[np.int_] | None:
    """Altitudes near ``near`` between ``low`` and ``high`` (N,) with legs that climb and descend by no more than ``up``
    and ``down`` (N - 1,); None if there are none."""
    low, high = low.copy(), high.copy()  # narrowed to those that can be reached from the first one
    for i in range(1, len(near)):
        low[i], high[i] = max(low[i], low[i - 1] - down[i - 1]), min(high[i], high[i - 1] + up[i - 1])
        if low[i] > high[i]:
            return None
    found = near.copy()
    for i in range(len(near) - 2, -1, -1):
        found[i] = min(max(found[i], low[i], found[i + 1] - up[i]), high[i], found[i + 1] + down[i])
    return found
