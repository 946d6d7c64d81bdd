"""The altitude profile of a track with arcs: a taut string that bends only where a way point can be.

The altitude of a way point is reached in the middle of its arc; one more way point may be at either end of the arc,
where a straight leg begins. Between these places the profile is straight. So floor and ceiling over each half of an
arc are replaced by straight lines that lose as little altitude as possible. Then the string has no doors within half
arcs, and does not bend there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.taut_string import Profile
from gcsplan.planners.profile.track import Flown, Obstruction, Track, fly
from gcsplan.planners.turns.arc_path import Outline
from gcsplan.planners.turns.kernels import CHORD_M, level, straighten
from gcsplan.world.airspace import Band, Legs, Tube
from gcsplan.world.tube import cut, join

CORRECTIONS, CORRECTED_M = 8, 0.01
"""Most corrections of a profile after violations in the exact check; metres added to the size of each violation."""


@dataclass(frozen=True, eq=False, slots=True)
class Risen:
    """A legal flight over an outline: ``flown`` (K, 3) its chords, divided where the profile bends on a leg.

    ``true_m`` (K,) metres along legs and arcs themselves; ``way_points`` (M, 3).
    """

    flown: Floats
    true_m: Floats
    way_points: Floats


def rise(
    problem: Problem, track: Track, line: Outline, doors: Sequence[tuple[float, float, float]] = ()
) -> Risen | Obstruction:
    """The cheapest legal flight over ``line`` and its ``track``, checked exactly; or the obstruction, if none is.

    ``doors`` (s_m, low_m, high_m) are altitudes to pass besides.
    """
    known = list(doors)
    blocked = Obstruction("pinched", 0.0, 0.0, 0.0)
    for _ in range(CORRECTIONS):
        found = fly(problem, track, known=known)
        if not isinstance(found, Flown):
            return blocked if known else found
        nodes = _representable(line, found.profile)
        s, flown, widen = _dense(line, nodes)
        violations = problem.airspace.examine(_legs(problem, flown, widen), problem.limits).violations
        if not violations:
            nodes = _thinned(problem, line, nodes, [s_m for s_m, _, _ in doors])
            s, flown, _ = _dense(line, nodes)
            flown[0], flown[-1] = problem.start, problem.goal
            return Risen(flown, np.interp(s, line.s_m, line.true_m), _way_points(line, nodes))
        for v in violations:
            at = float(s[v.leg] + v.fraction * (s[v.leg + 1] - s[v.leg]))
            blocked = Obstruction("zone" if v.zone >= 0 else "pinched", at, at, v.by, v.zone)
            if v.kind not in ("min_agl", "terrain_clearance", "max_agl"):
                return blocked
            room = v.by + CORRECTED_M
            for place in _bends(line, at):
                z = float(np.interp(place, nodes[:, 0], nodes[:, 1]))
                known.append((place, -np.inf, z - room) if v.kind == "max_agl" else (place, z + room, np.inf))
    return blocked


def track_of(problem: Problem, line: Outline, like: tuple[Outline, Track] | None = None) -> Track:
    """The outline with its tube, which lets a profile bend only where way points are.

    The tube is `CHORD_M` wider from the first to the last arc than on the first and last leg. ``like``: another outline
    and its track; the parts of the tube that both share at either end are copied from it.
    """
    end = len(line.points) - 1
    i, j, before, after = 0, end, 0.0, 0.0
    if like is not None:
        head, tail = _common(like[0], line)
        if head:
            i = int(line.arcs[head - 1, 2])
            before = float(like[1].s_m[i])
        if tail:
            j = int(line.arcs[-tail, 0])
            after = float(like[1].s_m[j - end - 1])
    first, last = (int(line.arcs[0, 0]), int(line.arcs[-1, 2])) if len(line.arcs) else (end, end)
    wide = replace(problem.limits, track_error_m=problem.limits.track_error_m + CHORD_M)
    spans = ((0, first, problem.limits), (first, last, wide), (last, end, problem.limits))
    parts = [(max(a, i), min(b, j), limits) for a, b, limits in spans]
    tube = join([problem.airspace.tube(line.points[a : b + 1], limits) for a, b, limits in parts if b > a])
    if len(line.arcs):
        halves = _halves(line)
        halves = halves[(halves[:, 0] >= line.s_m[i]) & (halves[:, 1] <= line.s_m[j])] - line.s_m[i]
        tube = _straightened(tube, halves)
    if like is not None:
        old = like[1].tube
        around = (cut(old, 0.0, before) if i else None, tube, cut(old, after, float(old.s_m[-1])) if j < end else None)
        tube = join([t for t in around if t is not None])
    pinned, pin_m = np.zeros(end + 1, bool), np.full(end + 1, np.nan)
    pinned[line.pins], pin_m[line.pins] = True, line.pin_m
    return Track(line.points, pinned, pin_m, line.s_m * (tube.s_m[-1] / line.s_m[-1]), tube)


def _common(a: Outline, b: Outline) -> tuple[int, int]:
    """How many first arcs, and how many last arcs, two outlines share, with the legs before and after; never all."""
    most = min(len(a.arcs), len(b.arcs)) - 1
    size = min(len(a.points), len(b.points))
    head = tail = 0
    if most > 0:
        same = np.append((a.points[:size] == b.points[:size]).all(axis=1), False)
        good = int(np.argmin(same))  # number of equal points
        rows = (a.arcs[:most] == b.arcs[:most]).all(axis=1) & (b.arcs[:most, 2] < good)
        head = int(np.argmin(np.append(rows, False)))
        same = np.append((a.points[: -size - 1 : -1] == b.points[: -size - 1 : -1]).all(axis=1), False)
        good = int(np.argmin(same))
        back = (a.arcs - len(a.points))[::-1][:most], (b.arcs - len(b.points))[::-1][:most]
        rows = (back[0] == back[1]).all(axis=1) & (-back[1][:, 0] <= good)
        tail = min(int(np.argmin(np.append(rows, False))), most - head)
    return head, tail


def _halves(line: Outline) -> Floats:
    """Beginning and end of each half of each arc, metres along the outline: (2A, 2)."""
    return np.asarray(line.s_m[np.stack([line.arcs[:, :2], line.arcs[:, 1:]], axis=1).reshape(-1, 2)])


def _representable(line: Outline, profile: Profile) -> Floats:
    """Bends (N, 2) of a profile, metres along and altitude. A bend inside a half arc, which is possible near start and
    goal, is replaced by bends at both ends of the half arc; the exact check comes later."""
    s = profile.s_m
    inside = np.zeros(len(s), bool)
    also = []
    for a, b in _halves(line).tolist():
        within = (s > a + 1e-3) & (s < b - 1e-3)
        if within.any():
            inside |= within
            also += [a, b]
    at = np.sort(np.concatenate([s[~inside], also]))
    at = at[np.concatenate([[True], np.diff(at) > 1e-3])]
    at[-1] = s[-1]
    return np.stack([at, profile.at(at)], axis=-1)


def _bends(line: Outline, at: float) -> list[float]:
    """Where to move a profile so that it moves at ``at``: there, or at both ends of the half arc around it."""
    for a, b in _halves(line).tolist():
        if a - 1e-6 < at < b + 1e-6:
            return [a, b]
    return [at]


def _dense(line: Outline, nodes: Floats) -> tuple[Floats, Floats, Floats]:
    """All points of the outline and of the profile: metres along (K,), places (K, 3), widening of the legs (K - 1,)."""
    corner = line.s_m
    # A bend within a millimetre of a point of the outline is merged with that point.
    k = np.clip(np.searchsorted(corner, nodes[:, 0]), 1, len(corner) - 1)
    away = np.minimum(np.abs(corner[k] - nodes[:, 0]), np.abs(nodes[:, 0] - corner[k - 1]))
    s = np.sort(np.concatenate([corner, nodes[away > 1e-3, 0]]))
    places = [np.interp(s, corner, line.points[:, i]) for i in range(2)]
    points = np.stack([*places, np.interp(s, nodes[:, 0], nodes[:, 1])], axis=-1)
    chord = np.searchsorted(corner, 0.5 * (s[:-1] + s[1:])) - 1
    return s, points, line.widen_m[chord]


def _legs(problem: Problem, flown: Floats, widen: Floats) -> Legs:
    plain = Legs.of_path(flown, problem.limits)
    return replace(plain, track_error_m=plain.track_error_m + widen)


def _thinned(problem: Problem, line: Outline, nodes: Floats, doors: Sequence[float]) -> Floats:
    """Drop bends of a profile that it does not need to be legal, which never lengthens it; pinned altitudes and those
    at ``doors``, metres along, stay."""
    pins = np.concatenate([line.s_m[line.pins[np.isfinite(line.pin_m)]], np.asarray(doors, dtype=np.float64)])
    for first in (1, 2, 1, 2):
        drop = np.zeros(len(nodes), bool)
        drop[first : len(nodes) - 1 : 2] = True
        for at in pins:
            drop &= np.abs(nodes[:, 0] - at) > 1e-3
        s, flown, widen = _dense(line, nodes[~drop])
        clear = problem.airspace.clear(_legs(problem, flown, widen), problem.limits)
        for k in np.flatnonzero(drop):
            a, b = nodes[k - 1, 0], nodes[k + 1, 0]
            drop[k] = clear[(s[1:] > a + 1e-6) & (s[:-1] < b - 1e-6)].all()
        nodes = nodes[~drop]
    return nodes


def _way_points(line: Outline, nodes: Floats) -> Floats:
    """Way points (M, 3): start, every corner, every pin and bend of the profile elsewhere, goal."""
    s, place = [line.s_m[line.arcs[:, 1]]], [line.corners]
    extra = np.sort(np.concatenate([nodes[1:-1, 0], line.s_m[line.pins]]))
    extra = extra[np.concatenate([[True], np.diff(extra) > 1e-3])] if len(extra) else extra
    if len(s[0]) and len(extra):
        extra = extra[np.abs(extra[:, None] - s[0]).min(axis=1) > 1e-3]
    extra = np.concatenate([[0.0], extra, [line.s_m[-1]]])
    s.append(extra)
    place.append(np.stack([np.interp(extra, line.s_m, line.points[:, i]) for i in range(2)], axis=-1))
    at, flat = np.concatenate(s), np.concatenate(place)
    order = np.argsort(at, kind="stable")
    z = np.interp(at, nodes[:, 0], nodes[:, 1])
    return np.column_stack([flat, z])[order]


def _straightened(tube: Tube, halves: Floats) -> Tube:
    """The tube with one piece for each half arc; ``halves`` (H, 2) in order, their ends among its breakpoints."""
    s, floor, ceiling = np.empty_like(tube.s_m), np.empty_like(tube.floor_m), np.empty_like(tube.ceiling_m)
    n = straighten(tube.s_m, tube.floor_m, tube.ceiling_m, halves, s, floor, ceiling, np.empty(5))
    s, floor, ceiling = s[: n + 1], floor[:n], ceiling[:n]
    bands = []
    for b in tube.bands:
        most = len(b.bottom_m) + 2 * len(halves) + 2
        at, bottom, top = np.empty(most + 1), np.empty((most, 2)), np.empty((most, 2))
        n = level(b.s_m, b.bottom_m, b.top_m, halves, at, bottom, top)
        at, bottom, top = at[: n + 1].copy(), bottom[:n].copy(), top[:n].copy()
        bands.append(Band(b.zone, float(at[0]), float(at[-1]), at, bottom, top))
    return Tube(s, floor, ceiling, tuple(bands))
