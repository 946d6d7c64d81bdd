"""Turning a track into way points that pass the exact check."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.track import Flown, Obstruction, ObstructionKind, Track, fly, make_track, values_at
from gcsplan.planners.profile.zone_levels import LEVEL_SAMPLE_M, ZoneLevels
from gcsplan.world.airspace import Band, Legs, Tube, Violation
from gcsplan.world.geometry.path import distances_m

TIGHT_M, TIGHT_SAMPLE_M = 1.0, 1.0
"""Where ceiling minus floor is less than `TIGHT_M` metres, samples are `TIGHT_SAMPLE_M` metres apart."""
PREFERRED_ROOM_M = 0.05
"""Metres kept from floor and ceiling where they are far enough apart: the exact check is fast away from its limits."""
CORRECTIONS, CORRECTED_M = 24, 0.03
"""Most corrections of a profile after violations in the exact check; metres added to the size of each violation."""


@dataclass(frozen=True, slots=True)
class Unsettled:
    """Why no profile over a track passes: the ``place`` (east, north), the ``kind`` of obstruction, and ``by`` how many
    metres it fails.

    ``samples`` (K, 4): east, north, floor, ceiling along the track, past its zones, with all corrections so far.
    ``span_m``: length of the piece that is too steep, along the track; ``zone``: index of the zone that is met, -1 if
    it is none.
    """

    place: Floats
    by: float
    kind: ObstructionKind
    samples: Floats
    span_m: float = 0.0
    zone: int = -1
    past: Unsettled | None = None
    """Per zone: why the profile past it fails that lacks least."""


@dataclass(eq=False, slots=True)
class LegJudge:
    """The exact check of single legs; it remembers the legs that passed."""

    problem: Problem
    passed: set[bytes] = field(default_factory=set)

    def violations(self, points: Floats) -> tuple[tuple[int, Violation], ...]:
        """Violations of a path (N, 3), each with the index of its leg."""
        legs = np.hstack([points[:-1], points[1:]])
        new = np.array([k for k, leg in enumerate(legs) if leg.tobytes() not in self.passed], np.intp)
        if not len(new):
            return ()
        self.problem.budget.spend("check", 3)  # `examine` costs more than a yes or no: it reports violations
        self.problem.budget.spend("leg", len(new))
        found = self.problem.airspace.examine(self._legs(legs[new]), self.problem.limits).violations
        bad = {v.leg for v in found}
        self.passed.update(legs[k].tobytes() for i, k in enumerate(new) if i not in bad)
        return tuple((int(new[v.leg]), v) for v in found)

    def _legs(self, legs: Floats) -> Legs:
        return Legs.between(legs[:, :3], legs[:, 3:], self.problem.limits)


def way_points(problem: Problem, track: Track, flown: Flown) -> tuple[Floats, Bools]:
    """Way points (N, 3) at every vertex of the track and of its profile, and (N,) whether they must stay."""
    profile = flown.profile
    s = np.concatenate([track.s_m, profile.s_m])
    must = np.concatenate([track.pinned, np.zeros(len(profile.s_m), bool)])
    order = np.lexsort((~must, s))
    s, must = s[order], must[order]
    # Vertices within a millimetre of each other become one; a pinned one decides its place.
    group = np.concatenate([[0], np.cumsum(np.diff(s) > 1e-3)])
    first = np.flatnonzero(np.concatenate([[True], np.diff(group) > 0]))
    pins = np.zeros(len(first), bool)
    np.logical_or.at(pins, group, must)
    at = s[first]
    for k in np.flatnonzero(pins):
        at[k] = s[group == k][must[group == k]][0]
    points = np.stack(
        [
            np.interp(at, track.s_m, track.points[:, 0]),
            np.interp(at, track.s_m, track.points[:, 1]),
            np.asarray(profile.at(at)),
        ],
        axis=-1,
    )
    points[0], points[-1] = problem.start, problem.goal
    return points, pins


def settle(
    problem: Problem, judge: LegJudge, points: Floats, pinned: Bools, pin_m: Floats
) -> tuple[Floats, Bools] | Unsettled:
    """Way points (N, 3) over a track that pass the exact check, and (N,) whether they must stay.

    The profile is drawn over floors sampled point by point, which are closer to the true ground than bounds over whole
    pieces of the track, and so are the levels of zones above ground, where these bounds leave no way. Where the exact
    check finds ground (or a maximum AGL, or such a zone) violated between two samples, the floor (ceiling, level) of
    that piece is corrected and the profile drawn again, up to `CORRECTIONS` times. `Unsettled` if none passes.
    """
    track = sampled_track(problem, points, pinned, pin_m)
    tube, levels = track.tube, tuple[ZoneLevels, ...]()
    worst: Violation | None = None

    def samples() -> Floats:
        s = tube.s_m[1:-1]
        east, north = (np.interp(s, track.s_m, track.points[:, k]) for k in range(2))
        floor = np.maximum(tube.floor_m[:-1, 1], tube.floor_m[1:, 0])
        ceiling = np.minimum(tube.ceiling_m[:-1, 1], tube.ceiling_m[1:, 0])
        for band in track.tube.bands:
            _pass(s, floor, ceiling, band)
        return np.stack([east, north, floor, ceiling], axis=-1)

    def shut(by: Obstruction, along: Floats) -> Unsettled:
        middle, span_m = track.place(0.5 * (by.s0_m + by.s1_m)), by.s1_m - by.s0_m
        return Unsettled(middle, by.by, by.kind, along, span_m, by.zone)

    for _ in range(CORRECTIONS):
        flown = fly(problem, track)
        if not isinstance(flown, Flown) and not levels:
            levels = tuple(ZoneLevels.of(problem, track, band) for band in tube.bands)
            if any(of.follows_ground for of in levels):
                track = replace(track, tube=replace(tube, bands=tuple(of.band for of in levels)))
                flown = fly(problem, track)
        if not isinstance(flown, Flown):
            along = samples()
            unsettled = shut(flown, along)
            return unsettled if flown.past is None else replace(unsettled, past=shut(flown.past, along))
        found, pins = way_points(problem, track, flown)
        violations = judge.violations(found)
        if not violations:
            return found, pins
        s = distances_m(found)
        for leg, v in violations:
            at = float(s[leg] + v.fraction * (s[leg + 1] - s[leg]))
            worst = v
            k = min(max(int(np.searchsorted(tube.s_m, at, "right")) - 1, 0), len(tube.s_m) - 2)
            z = flown.profile.at(tube.s_m[k : k + 2])
            apart_m = v.by + CORRECTED_M
            if v.kind in ("min_agl", "terrain_clearance"):
                tube.floor_m[k] = np.maximum(tube.floor_m[k], z + apart_m)
            elif v.kind == "max_agl":
                tube.ceiling_m[k] = np.minimum(tube.ceiling_m[k], z - apart_m)
            else:
                own = [of for of in levels if of.band.zone == v.zone]
                corrected = [of.correct(flown.profile, s[leg], s[leg + 1]) for of in own]
                if not any(corrected):
                    by = math.inf if v.kind == "coverage" else v.by
                    kind: ObstructionKind = "zone" if v.zone >= 0 else "pinched"
                    return Unsettled(np.array([v.east_m, v.north_m]), by, kind, samples(), zone=v.zone)
    assert worst is not None
    return Unsettled(np.array([worst.east_m, worst.north_m]), worst.by, "pinched", samples())


def _pass(s_m: Floats, floor: Floats, ceiling: Floats, band: Band) -> None:
    """Lower the ceiling (N,) at places along a track to below a band, or raise the floor to above it, in place:
    whichever lacks less, and nothing if neither is possible."""
    inside = (s_m >= band.s0_m) & (s_m <= band.s1_m)
    bottom, top = (values_at(s_m[inside], band.s_m, of, k == 1) for k, of in enumerate((band.bottom_m, band.top_m)))
    with np.errstate(invalid="ignore"):  # over unknown ground both are infinite: neither is possible
        under, over = ((a - b).max(initial=-math.inf) for a, b in ((floor[inside], bottom), (top, ceiling[inside])))
    if under <= over and under < math.inf:
        ceiling[inside] = np.minimum(ceiling[inside], bottom)
    elif over < math.inf:
        floor[inside] = np.maximum(floor[inside], top)


def sampled_track(problem: Problem, points: Floats, pinned: Bools, pin_m: Floats) -> Track:
    """A track whose tube is sampled point by point, with the exact tube's bands of zones."""
    exact = make_track(problem, points, pinned, pin_m)
    at = [np.zeros(1)]
    for a, b in zip(exact.s_m[:-1], exact.s_m[1:], strict=True):
        n = max(1, round((b - a) / LEVEL_SAMPLE_M))
        at.append(a + (b - a) * np.arange(1, n + 1) / n)
    s = np.concatenate(at)
    s[-1] = exact.tube.s_m[-1]
    floor, ceiling = _tube_at(problem, exact, s)
    with np.errstate(invalid="ignore"):  # over unknown ground floor and ceiling are infinite
        apart_m = np.abs(ceiling - floor)
    tight = np.minimum(apart_m[:-1], apart_m[1:]) < TIGHT_M
    if tight.any():
        parts = np.where(tight, np.ceil(np.diff(s) / TIGHT_SAMPLE_M), 1.0).astype(np.intp)
        first = np.cumsum(parts) - parts
        part = (np.arange(parts.sum()) - np.repeat(first, parts)) / np.repeat(parts, parts)
        s = np.append(np.repeat(s[:-1], parts) + part * np.repeat(np.diff(s), parts), s[-1])
        floor, ceiling = _tube_at(problem, exact, s)
    with np.errstate(invalid="ignore"):
        spare = np.clip(0.25 * (ceiling - floor), 0.0, PREFERRED_ROOM_M)
    spare[[0, -1]] = 0.0
    spare = np.where(np.isfinite(floor), spare, 0.0)
    floor, ceiling = floor + spare, ceiling - spare
    tube = Tube(
        s, np.stack([floor[:-1], floor[1:]], axis=-1), np.stack([ceiling[:-1], ceiling[1:]], axis=-1), exact.tube.bands
    )
    return Track(exact.points, exact.pinned, exact.pin_m, exact.s_m, tube)


def _tube_at(problem: Problem, track: Track, s_m: Floats) -> tuple[Floats, Floats]:
    """Floor and ceiling at places along a track, without zones."""
    east, north = (np.interp(s_m, track.s_m, track.points[:, k]) for k in range(2))
    air, limits = problem.airspace, problem.limits
    return np.asarray(problem.floors(east, north)), np.asarray(air.ceiling_amsl(east, north, limits))
