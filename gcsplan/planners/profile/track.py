"""A ground track with the tube of free altitudes over it, and the best altitude profile through that tube.

The tube comes from `Airspace.tube`, so results hold along the whole line, not only at samples.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from typing import Literal

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.planners.problem import ENDS_M, Problem
from gcsplan.planners.profile.taut_kernels import edge
from gcsplan.planners.profile.taut_string import NO_LIMIT, Blocked, Profile, taut_string
from gcsplan.world.airspace import Tube
from gcsplan.world.geometry.path import distances_m

KEEP_M = 1e-4
"""Metres kept from floors and ceilings where they are far enough apart, so that rounding never decides."""

CLOSE_M, CLOSE_STEP_M, CLOSE_SPARE_M = 60.0, 1.0, 0.03
"""Where a tube shuts an end in, the floor is read again: up to this distance from the end, at this spacing, with this
much added, all in metres."""

DEARER = 2e-4
"""Extra cost of passing over or under zones, as a part, from which on a track around the deepest is worth a search."""
BESIDE_M = 1.0
"""A piece of a profile that ends within this many metres of a zone is taken to end there because of the zone."""

BRANCHES = 64
"""Most over/under combinations that are tried for one track."""


BandSides = tuple[bool | None, ...]
"""For each band of a tube: True over it, False under it, None not chosen."""

ObstructionKind = Literal["pinched", "climb", "descent", "zone"]


@dataclass(frozen=True, slots=True)
class Obstruction:
    """Why a track has no legal profile, where along it, and by how many metres; ``zone`` -1: terrain or limits."""

    kind: ObstructionKind
    s0_m: float
    s1_m: float
    by: float
    zone: int = -1
    past: Obstruction | None = None
    """Per zone: the obstacle to the profile past it that lacks least, out of all tried profiles."""


@dataclass(frozen=True, eq=False, slots=True)
class Flown:
    """A legal profile over a track, and its cost."""

    profile: Profile
    cost: float


@dataclass(frozen=True, eq=False, slots=True)
class Track:
    """``points`` (N, 2); ``pinned`` (N,) vertices that must stay; ``pin_m`` (N,) their altitude, NaN where free;
    ``s_m`` (N,) metres along the track, scaled so that it ends where the tube ends."""

    points: Floats
    pinned: Bools
    pin_m: Floats
    s_m: Floats
    tube: Tube

    def place(self, s_m: float) -> Floats:
        """The point (2,) at ``s_m`` metres along the track."""
        return np.array([np.interp(s_m, self.s_m, self.points[:, 0]), np.interp(s_m, self.s_m, self.points[:, 1])])


@dataclass(frozen=True, eq=False, slots=True)
class Lacking:
    """The cheapest profile over a track if laps could be flown wherever it is too steep.

    ``cost``: with laps; ``laps_m``: metres of laps; ``steep``: the pieces that need them, most missing height first;
    ``zones``: the zones that force the climb or descent of the first such piece. Where nothing is too steep, but the
    cost is higher than without zones (`DEARER`), ``zones`` holds the zone that is met deepest.
    """

    profile: Profile
    cost: float
    laps_m: float
    steep: tuple[Obstruction, ...]
    zones: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Closed:
    """Why a track cannot be flown even with laps: the floor is ``by`` metres above the ceiling at its tightest place,
    for the best choice of sides that was tried; ``zones``: the zones passed over or under there, as far as known."""

    by: float
    zones: tuple[int, ...]


def divided(points: Floats, step_m: float) -> tuple[Indices, Indices, Indices]:
    """Divide legs of a track or path (N, 2 or 3) into equal parts, none longer than ``step_m``; for each part (K,) its
    leg, its index within that leg, and the number of parts of that leg."""
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    parts = np.maximum(np.ceil(length / step_m), 1.0).astype(np.intp)
    leg = np.repeat(np.arange(len(parts)), parts)
    return leg, np.arange(len(leg)) - np.repeat(np.cumsum(parts) - parts, parts), parts[leg]


def denser(points: Floats, step_m: float) -> Floats:
    """The same track or path (M, 2 or 3) with a point every ``step_m`` at least."""
    leg, part, parts = divided(points, step_m)
    return np.vstack([points[leg] + (part / parts)[:, None] * (points[leg + 1] - points[leg]), points[-1:]])


def make_track(problem: Problem, points: Floats, pinned: Bools, pin_m: Floats) -> Track:
    """A track with its tube; of points within 1 mm of the one before only one is kept, preferably the pinned one."""
    keep = np.ones(len(points), bool)
    last = 0
    for i in range(1, len(points)):
        if np.hypot(*(points[i] - points[last])) < 1e-3:
            if pinned[i] and not pinned[last]:
                keep[last] = False
                last = i
            else:
                keep[i] = False
        else:
            last = i
    points, pinned, pin_m = points[keep], pinned[keep], pin_m[keep]
    tube = problem.airspace.tube(points, problem.limits)
    problem.budget.spend("piece", len(tube.s_m))
    s = distances_m(points)
    return Track(points, pinned, pin_m, s * (tube.s_m[-1] / s[-1]), tube)


def fly(
    problem: Problem,
    track: Track,
    known: Sequence[tuple[float, float, float]] = (),
) -> Flown | Obstruction:
    """The cheapest legal profile over ``track``, with the cheaper side (over or under) of each band.

    A best-first search over the sides of bands, at most `BRANCHES` of them; only bands that the string runs into are
    branched on. If it finds nothing, it returns what the first string ran into. ``known``: further doors
    (s_m, low_m, high_m) to pass.
    """
    tube, limits = track.tube, problem.limits
    ends = (problem.start[2], problem.goal[2])
    sections = sections_of(problem, track, known)
    horizontal = float(sections.s_m[-1])

    def solve(over: BandSides) -> Profile | Blocked:
        low, high = sections.between(over)
        return taut_string(sections.s_m, low, high, *ends, limits.max_climb_slope, limits.max_descent_slope)

    def cost_of(p: Profile) -> float:
        if problem.objective == "energy":
            return problem.vertical_j_per_m * p.vertical_m + problem.horizontal_j_per_m * horizontal
        return float(problem.slope_costs(np.diff(p.s_m), np.diff(p.amsl_m)).sum())

    none: BandSides = (None,) * len(tube.bands)
    root = solve(none)
    if isinstance(root, Blocked):
        return Obstruction(root.kind, root.s0_m, root.s1_m, root.by)
    first: Obstruction | None = None
    least: Blocked | None = None
    open_set = [(cost_of(root), 0, none, root)]
    count = 0
    while open_set:
        cost, _, over, profile = heappop(open_set)
        hit = sections.deepest(profile, over)
        if hit is None:
            return Flown(profile, cost)
        k, depth_m = hit
        band = tube.bands[k]
        if first is None:
            first = Obstruction("zone", band.s0_m, band.s1_m, depth_m, band.zone)
        if count >= BRANCHES:
            break
        for side in (True, False):
            choice = (*over[:k], side, *over[k + 1 :])
            count += 1
            found = solve(choice)
            if not isinstance(found, Blocked):
                heappush(open_set, (cost_of(found), count, choice, found))
            elif least is None or found.by < least.by:
                least = found
    shut = first or Obstruction("zone", 0.0, horizontal, 0.0)
    past = None if least is None else Obstruction(least.kind, least.s0_m, least.s1_m, least.by, shut.zone)
    return replace(shut, past=past)


def lacking(problem: Problem, track: Track) -> Lacking | Closed:
    """The length that a track lacks to be flyable, and where; `Closed` if more length does not help.

    With laps added to pieces that are too steep, a profile still costs a convex function of its slope, so the taut
    string is the cheapest profile here too. Sides of bands are searched as in `fly`.
    """
    tube, limits = track.tube, problem.limits
    sections = sections_of(problem, track, ())
    up, down = (min(slope, NO_LIMIT) + 1e-9 for slope in (limits.max_climb_slope, limits.max_descent_slope))
    closed = Closed(math.inf, ())
    deepest_zone: tuple[int, ...] = ()

    def solve(over: BandSides) -> tuple[float, Profile, Floats] | None:
        nonlocal closed
        low, high = sections.between(over)
        found = taut_string(sections.s_m, low, high, problem.start[2], problem.goal[2])
        if isinstance(found, Blocked):
            if found.by < closed.by or not closed.zones:
                closed = Closed(found.by, sections.zones(tube, over, found.s0_m, found.s1_m))
            return None
        run, rise = np.diff(found.s_m), np.diff(found.amsl_m)
        needed = np.maximum(run, np.maximum(rise / up, -rise / down))
        if problem.objective == "energy":
            cost = problem.horizontal_j_per_m * float(needed.sum()) + problem.vertical_j_per_m * found.vertical_m
        else:
            cost = float(problem.slope_costs(needed, rise).sum())
        return cost, found, needed - run

    none: BandSides = (None,) * len(tube.bands)
    root = solve(none)
    if root is None:
        return closed
    open_set = [(root[0], 0, none, root)]
    count = 0
    while open_set and count < BRANCHES:
        cost, _, over, (_, profile, more) = heappop(open_set)
        hit = sections.deepest(profile, over)
        if hit is None:
            s, rise = profile.s_m, np.diff(profile.amsl_m)
            missing = more * np.where(rise > 0.0, up, down)
            steep = tuple(
                Obstruction("climb" if rise[k] > 0.0 else "descent", float(s[k]), float(s[k + 1]), float(missing[k]))
                for k in np.argsort(-missing, kind="stable")
                if missing[k] > 0.0
            )
            zones = deepest_zone if cost > root[0] * (1.0 + DEARER) else ()
            if steep:
                zones = sections.zones(tube, over, steep[0].s0_m, steep[0].s1_m)
            return Lacking(profile, cost, float(more[missing > 0.0].sum()), steep, zones)
        k = hit[0]
        deepest_zone = deepest_zone or (tube.bands[k].zone,)
        for side in (True, False):
            choice = (*over[:k], side, *over[k + 1 :])
            count += 1
            found = solve(choice)
            if found is not None:
                heappush(open_set, (found[0], count, choice, found))
    return closed


@dataclass(frozen=True, eq=False, slots=True)
class _Sections:
    """Doors at all breakpoints of a tube and its bands, and at pins; for each band its range of doors and altitudes."""

    s_m: Floats
    low_m: Floats
    high_m: Floats
    spans: list[tuple[int, int]]
    bottoms: list[Floats]
    tops: list[Floats]

    def between(self, over: BandSides) -> tuple[Floats, Floats]:
        """Lowest and highest altitude of each door with bands passed as in ``over``, narrowed by `KEEP_M` on both sides
        (to the middle where a door is smaller than that). The two ends are not narrowed."""
        low, high = self.low_m.copy(), self.high_m.copy()
        for k, side in enumerate(over):
            i, j = self.spans[k]
            if side:
                np.maximum(low[i:j], self.tops[k], out=low[i:j])
            elif side is not None:
                np.minimum(high[i:j], self.bottoms[k], out=high[i:j])
        _narrow(low, high)
        return low, high

    def zones(self, tube: Tube, over: BandSides, s0_m: float, s1_m: float) -> tuple[int, ...]:
        """Zones with a chosen side whose bands come within `BESIDE_M` of the piece from ``s0_m`` to ``s1_m``."""
        chosen = (b for b, side in zip(tube.bands, over, strict=True) if side is not None)
        return tuple({b.zone: None for b in chosen if b.s0_m < s1_m + BESIDE_M and b.s1_m > s0_m - BESIDE_M})

    def deepest(self, profile: Profile, over: BandSides) -> tuple[int, float] | None:
        """The band that ``profile`` runs into deepest, out of the bands without a chosen side, and how many metres
        deep; None if it clears all of them by `KEEP_M`."""
        hits: list[tuple[int, float]] = []
        if any(side is None for side in over):
            z = profile.at(self.s_m)
            for k, side in enumerate(over):
                if side is None:
                    i, j = self.spans[k]
                    up, down = float((self.tops[k] - z[i:j]).max()), float((z[i:j] - self.bottoms[k]).max())
                    if up > -KEEP_M and down > -KEEP_M:
                        hits.append((k, min(up, down)))
        return max(hits, key=lambda hit: hit[1], default=None)


def _narrow(low: Floats, high: Floats) -> None:
    with np.errstate(invalid="ignore"):  # a door between infinities gives NaN or infinity
        sections, middle = high - low, 0.5 * (low + high)
    wide, open_ = sections >= 2.0 * KEEP_M, sections >= 0.0
    ends = low[[0, -1]] - 1e-6, high[[0, -1]] + 1e-6
    low[:] = np.where(wide, low + KEEP_M, np.where(open_, middle, low))
    high[:] = np.where(wide, high - KEEP_M, np.where(open_, middle, high))
    low[[0, -1]], high[[0, -1]] = ends


def sections_of(problem: Problem, track: Track, known: Sequence[tuple[float, float, float]]) -> _Sections:
    tube, z0, z1 = track.tube, problem.start[2], problem.goal[2]
    fixed = track.pinned & np.isfinite(track.pin_m)
    close = _close_to_ends(problem, tube)
    s = tube.s_m
    if tube.bands or known or len(close) or fixed.any():
        here = np.array([k[0] for k in known])
        s = np.sort(np.concatenate([s, *(b.s_m for b in tube.bands), track.s_m[fixed], close, here]))
        s = s[np.concatenate([[True], s[1:] - s[:-1] > 1e-9])]
    low = values_at(s, tube.s_m, tube.floor_m, True)
    high = values_at(s, tube.s_m, tube.ceiling_m, False)
    if len(close):
        near = np.flatnonzero((s <= CLOSE_M) | (s >= s[-1] - CLOSE_M))
        east, north = (np.interp(s[near], track.s_m, track.points[:, i]) for i in range(2))
        low[near] = np.minimum(low[near], problem.airspace.floor_amsl(east, north, problem.limits) + CLOSE_SPARE_M)
    pins = [(at, z, z) for at, z in zip(track.s_m[fixed], track.pin_m[fixed], strict=True)]
    for at, under, over in (*pins, *known):
        k = int(np.argmin(np.abs(s - at)))
        low[k], high[k] = max(low[k], under), min(high[k], over)
    _forgive(low, high, 0, z0)
    _forgive(low, high, -1, z1)
    spans, bottoms, tops = [], [], []
    for b in tube.bands:
        i = int(np.searchsorted(s, b.s_m[0] - 1e-9))
        j = int(np.searchsorted(s, b.s_m[-1] + 1e-9))
        spans.append((i, j))
        bottom = values_at(s[i:j], b.s_m, b.bottom_m, False)
        top = values_at(s[i:j], b.s_m, b.top_m, True)
        if i == 0:
            _forgive(top, bottom, 0, z0)
        if j == len(s):
            _forgive(top, bottom, -1, z1)
        bottoms.append(bottom)
        tops.append(top)
    return _Sections(s, low, high, spans, bottoms, tops)


def _close_to_ends(problem: Problem, tube: Tube) -> Floats:
    """Metres along the track, near an end, at which to read the floor again, if the tube's floor is out of reach there.

    A tube bounds the floor over whole pieces. Start and goal mostly lie on the floor, and a bound that is a metre too
    high a few metres away would shut them in.
    """
    limits, length = problem.limits, float(tube.s_m[-1])
    out = []
    up, down = limits.max_climb_slope, limits.max_descent_slope
    for at_start, z, slope, away, floor in (
        (True, problem.start[2], up, tube.s_m[1:], tube.floor_m[:, 1]),
        (False, problem.goal[2], down, length - tube.s_m[-2::-1], tube.floor_m[::-1, 0]),
    ):
        count = int(np.searchsorted(away, CLOSE_M, "right"))
        if not np.isinf(slope) and (floor[:count] > z + slope * away[:count]).any():
            steps = np.arange(CLOSE_STEP_M, min(CLOSE_M, 0.5 * length), CLOSE_STEP_M)
            out.append(steps if at_start else length - steps)
    return np.concatenate(out) if out else np.zeros(0)


def _forgive(low: Floats, high: Floats, k: int, z: float) -> None:
    """Move door ``k`` to ``z``, in place, if it misses ``z`` by less than `ENDS_M`: a tube is conservative, and whether
    an end is legal is checked elsewhere."""
    if z < low[k] < z + ENDS_M:
        low[k] = z
    if z - ENDS_M < high[k] < z:
        high[k] = z


def values_at(s: Floats, at: Floats, value: Floats, highest: bool) -> Floats:
    """Values at rising ``s`` of a piecewise-linear function with jumps: its pieces between breakpoints ``at`` (K + 1,)
    have the ``value`` (K, 2) at their ends. At a jump it is the higher one, or the lower one (not ``highest``)."""
    out = np.empty(len(s))
    edge(*(np.ascontiguousarray(a, np.float64) for a in (s, at, value)), highest, out)
    return out
