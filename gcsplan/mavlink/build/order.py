"""What the mission around a path is to be, and what a planner keeps for the wire: common to every kind of aircraft."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gcsplan.world.world import World

Point = tuple[float, float, float]
End = Literal["land", "loiter", "rtl", "none"]
AltitudeFrame = Literal["relative", "amsl", "terrain"]

BOW_M = 0.1
LONGEST_LEG_M = 5000.0


@dataclass(frozen=True, slots=True)
class Margins:
    """What a planner keeps for the wire: rounding in height, rounding and bow in the plane, slope for both."""

    altitude_m: float = 0.02
    track_m: float = 0.03
    bow_m: float = BOW_M
    slope: float = 0.002


MARGINS = Margins()


@dataclass(frozen=True, slots=True)
class Wing:
    """The ends of a fixed wing's mission, east_m, north_m and amsl_m.

    ``top``: where the climb-out ends, straight ahead of home. ``touch``: where the glide from the last way point ends,
    on the ground; None without a landing. ``circle_m``: radius of a circle at the goal. ``up``: the circle, around this
    place and to this altitude, in which it climbs behind ``top``, and ``up_m`` its radius (negative: anticlockwise);
    None: it climbs straight.
    """

    top: Point
    touch: Point | None = None
    circle_m: float = 0.0
    up: Point | None = None
    up_m: float = 0.0

    @property
    def leaves(self) -> Point:
        """Where the first leg begins."""
        return self.top if self.up is None else self.up


@dataclass(frozen=True, slots=True)
class Order:
    """What the mission around a path is to be; ``speed_m_s`` None is the fastest cruise.

    ``spaced`` drops way points nearer to their neighbours than two acceptance radii. ``hold_s``: so many seconds the
    vehicle waits in the air above its start (the gate) before it sets out; only multicopters can (`Vehicle.can_hold`).
    ``gate_utc``: instead, it waits until that hour, minute and second of the day, UTC; only ArduCopter can.
    ``wing``: the ends of a fixed wing's mission, None for all that stands in the air.
    """

    end: End = "land"
    altitude_frame: AltitudeFrame = "relative"
    speed_m_s: float | None = None
    spaced: bool = True
    hold_s: int = 0
    gate_utc: tuple[int, int, int] | None = None
    wing: Wing | None = None


def split_legs(points: NDArray[np.float64], world: World) -> NDArray[np.float64]:
    """(N, 3) points with legs cut to `LONGEST_LEG_M` and until each bow is within `BOW_M`."""
    places = world.frame.to_degrees(points[:, 0], points[:, 1])
    bow = world.frame.bow_m(places[:-1], places[1:])
    run = np.hypot(*np.diff(points[:, :2], axis=0).T)
    parts = np.maximum(np.ceil(run / LONGEST_LEG_M), np.ceil(np.sqrt(bow / BOW_M)))  # a bow shrinks with n²
    cut = [points[:1]]
    for a, b, n in zip(points[:-1], points[1:], np.maximum(parts, 1).astype(int), strict=True):
        cut.append(a + (b - a) * (np.arange(1, n + 1) / n)[:, None])
        cut[-1][-1] = b
    return np.concatenate(cut)
