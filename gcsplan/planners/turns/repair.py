"""Repair of arc paths: a local search that moves discs until the track is legal under the exact check.

How far a track breaks its limits is one number. It adds up the metres of floor above ceiling along the track (or above
what can be climbed to from the start, or descended from to the goal), the length of track through zones that can be
passed neither over nor under, and the metres by which discs are too close. The discs nearest to the worst place are
moved or removed, or another disc is inserted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.track import Obstruction, Track
from gcsplan.planners.turns.arc_path import ArcPath, Outline, inserted, moved, outline, tight, without
from gcsplan.planners.turns.kernels import pinched, shut
from gcsplan.planners.turns.profile import Risen, rise, track_of

STEPS_M = (1.0, 4.0, 15.0, 50.0, 150.0)
"""Metres by which discs are moved."""

NEAREST = 3
"""Most discs near the worst place that are changed."""

ZONE_M, GAP_M = 30.0, 1e4
"""Weights of a metre through a zone and of a metre by which discs are too close, in metres of floor above ceiling
along one metre."""

SMALL, SLOW, LARGE = 0.999, 0.6, 0.3
"""Parts of the violation that a change leaves: below the first it is an improvement, above the second it is a slow
one, below the third it is accepted at once."""

SPARED = 4
"""One of this many slow rounds also tries other ways out of start and into goal."""

NEAR_END = 6.0
"""Within this many turn radii of start or goal a violation may be a lack of climb: other ways out or in are tried."""

WAYS_OUT, RUNS = 12, (0.0, 0.75, 2.0, 4.0)
"""Headings out of the start (into the goal) that are tried; lengths of the straight leg there, in turn radii."""

KICKS = 60
"""Random changes, of all discs near the worst place at once, if no single change helps."""

GAIN, PROBE = 1e-4, 0.01
"""Polishing: least gain worth a try, as a part of the track's length; first move of a disc, to see whether it can be
moved, in turn radii."""


@dataclass(eq=False, slots=True)
class Patience:
    """The number of tracks that may still be tried."""

    left: int


@dataclass(frozen=True, eq=False, slots=True)
class Tried:
    """An arc path with its chords ``line`` and ``track``, and how far it breaks its limits.

    ``broken``: the measure of the module's docstring, 0 if it is legal; ``worst_m``: the worst place along ``line``;
    ``risen``: the flight along it, if it is legal.
    """

    arc_path: ArcPath
    line: Outline | None
    track: Track | None
    broken: float
    worst_m: float
    risen: Risen | None = None


def mended(problem: Problem, arc_path: ArcPath, patience: Patience) -> Tried | None:
    """A legal flight along ``arc_path``, with its discs changed where needed; None if none is found."""
    rng = np.random.default_rng(problem.seed)
    here = tried(problem, arc_path)
    spared = 0
    while here.risen is None:
        best = here
        for number, group in enumerate((_moves(here), _ways_out(problem, here), _kicks(here, rng))):
            # Slow progress may end nowhere: so other ways out are tried now and then.
            slow = best.broken > SLOW * here.broken and number == 1 and spared % SPARED == 0
            if best is not here and not slow:
                break
            for other in group:
                if patience.left <= 0:
                    return None
                patience.left -= 1
                found = tried(problem, other, here)
                if found.risen is not None:
                    return found
                if found.broken < best.broken * SMALL:
                    best = found
                    if found.broken < LARGE * here.broken:
                        break
        if best is here:
            return None
        spared += best.broken > SLOW * here.broken
        here = best
    return here


def polished(problem: Problem, here: Tried, enough: float, patience: Patience) -> Tried:
    """Remove discs of ``here`` or move them inwards, as long as that makes it cheaper and it costs more than
    ``enough``."""
    improved = True
    while improved:
        improved = False
        for k in range(len(here.arc_path.sense) - 1, -1, -1):
            if here.risen is None or cost_of(problem, here.risen) <= enough:
                return here
            if k >= len(here.arc_path.sense) or here.arc_path.pinned[k]:
                continue
            better = _shortened(problem, here, k, patience)
            improved |= better is not here
            here = better
    return here


def _shortened(problem: Problem, here: Tried, k: int, patience: Patience) -> Tried:
    """``here`` without disc ``k``, or with that disc farther inwards, if that is legal and cheaper; else ``here``."""
    arc_path, radius = here.arc_path, problem.turn_radius_m
    assert here.line is not None
    assert here.risen is not None
    worth = GAIN * float(here.line.s_m[-1])

    def better(other: ArcPath) -> Tried | None:
        if patience.left <= 0:
            return None
        patience.left -= 1
        found = tried(problem, other, here)
        assert here.risen is not None
        cheaper = found.risen is not None and cost_of(problem, found.risen) < cost_of(problem, here.risen) - 1e-3
        return found if cheaper else None

    rest = without(arc_path, k)
    if rest.gap_m == 0.0 and float(here.line.s_m[-1]) - float(outline(rest).s_m[-1]) > worth:
        found = better(rest)
        if found is not None:
            return found
    if 2.0 * radius * math.sin(0.5 * min(arc_path.turn[k], math.pi)) > worth:
        out = _outwards(arc_path, k)
        first = better(moved(arc_path, k, -PROBE * radius * out))
        if first is not None:  # a small move is legal, so larger ones may be
            for part in (1.0, 0.25, 0.06):
                found = better(moved(arc_path, k, -part * radius * out))
                if found is not None:
                    return found
            return first
    return here


def cost_of(problem: Problem, risen: Risen) -> float:
    """The cost of a flight, measured along the arcs, not their chords."""
    d, middle_m = np.diff(risen.flown, axis=0), 0.5 * (risen.flown[1:, 2] + risen.flown[:-1, 2])
    return float(problem.slope_costs(np.diff(risen.true_m), d[:, 2], middle_m, d[:, :2]).sum())


def tried(problem: Problem, arc_path: ArcPath, like: Tried | None = None) -> Tried:
    """Draw ``arc_path`` and find its flight, or measure how far it breaks its limits; faster if ``like`` is similar."""
    if arc_path.gap_m > 0.0:
        return Tried(arc_path, None, None, GAP_M * (1.0 + arc_path.gap_m), math.nan)
    line = outline(arc_path)
    known = None if like is None or like.line is None or like.track is None else (like.line, like.track)
    track = track_of(problem, line, known)
    broken, worst = _broken(problem, track)
    if broken > 0.0:
        return Tried(arc_path, line, track, broken, worst)
    found = rise(problem, track, line)
    if isinstance(found, Obstruction):
        return Tried(arc_path, line, track, 1e-3 * max(found.by, 1e-6), 0.5 * (found.s0_m + found.s1_m))
    return Tried(arc_path, line, track, 0.0, 0.0, found)


def _middle(arc_path: ArcPath, k: int) -> float:
    """Heading in the middle of the turn around disc ``k``."""
    return float(arc_path.heading[k] + 0.5 * arc_path.sense[k] * arc_path.turn[k])


def _outwards(arc_path: ArcPath, k: int) -> Floats:
    """Unit vector away from the centre of disc ``k``, at the middle of its turn."""
    at = _middle(arc_path, k)
    return np.asarray(arc_path.sense[k] * np.array([math.sin(at), -math.cos(at)]))


def _near(here: Tried) -> list[int]:
    """Free discs, nearest to the worst place first, at most `NEAREST` (all if there is no outline)."""
    arc_path, line = here.arc_path, here.line
    if line is None:
        return [k for k in range(len(arc_path.sense)) if not arc_path.pinned[k]]
    order = line.disc[np.argsort(np.abs(line.s_m[line.arcs[:, 1]] - here.worst_m), kind="stable")]
    return [k for k in dict.fromkeys(order.tolist()) if not arc_path.pinned[k]][:NEAREST]


def _moves(here: Tried) -> Iterator[ArcPath]:
    """Yield changes of one disc: moved, removed, or inserted at the worst place."""
    arc_path, line, near = here.arc_path, here.line, _near(here)
    for step in STEPS_M:
        for k in near:
            at = _middle(arc_path, k)
            along = np.array([math.cos(at), math.sin(at)])
            out = _outwards(arc_path, k)
            for by in (out, -out, along, -along):
                yield moved(arc_path, k, step * by)
    for k in near:
        yield without(arc_path, k)
    if line is None:
        return
    leg = int(np.clip(np.searchsorted(line.s_m, here.worst_m) - 1, 0, len(line.s_m) - 2))
    place = np.array([np.interp(here.worst_m, line.s_m, line.points[:, i]) for i in range(2)])
    d = line.points[leg + 1] - line.points[leg]
    heading = math.atan2(d[1], d[0])
    passed = line.disc[line.s_m[line.arcs[:, 1]] < here.worst_m]
    at_disc = int(passed[-1]) + 1 if len(passed) else 0
    for step in STEPS_M:
        for sense in (1.0, -1.0):
            # A disc on the left shifts the track to the right, and the other way round.
            shift = sense * step * np.array([math.sin(heading), -math.cos(heading)])
            yield inserted(arc_path, at_disc, place + shift, heading, sense)


def _ways_out(problem: Problem, here: Tried) -> Iterator[ArcPath]:
    """Yield other first turns if the worst place is near the start, and other last turns if it is near the goal."""
    if here.line is None:
        return
    arc_path, radius = here.arc_path, problem.turn_radius_m
    for at_goal in (False, True):
        away = float(here.line.s_m[-1]) - here.worst_m if at_goal else here.worst_m
        if away > NEAR_END * radius:
            continue
        for gone in range(5):
            rest = arc_path
            for _ in range(gone):
                k = len(rest.sense) - 1 if at_goal else 0
                if len(rest.sense) == 0 or rest.pinned[k]:
                    break
                rest = without(rest, k)
            else:
                for run in RUNS:
                    for way in range(WAYS_OUT):
                        heading = 2.0 * math.pi * way / WAYS_OUT
                        along = run * radius * np.array([math.cos(heading), math.sin(heading)])
                        contact = rest.ends[1] - along if at_goal else rest.ends[0] + along
                        for sense in (1.0, -1.0):
                            yield inserted(rest, len(rest.sense) if at_goal else 0, contact, heading, sense)


def _kicks(here: Tried, rng: np.random.Generator) -> Iterator[ArcPath]:
    """Yield random moves of all discs near the worst place, small and large in turn."""
    near = _near(here)
    for k in range(KICKS if near else 0):
        wide = here.arc_path.radius_m * (0.02, 0.1, 0.4, 1.0)[k % 4]
        centre = here.arc_path.centre.copy()
        centre[near] += rng.normal(0.0, wide, (len(near), 2))
        yield tight(replace(here.arc_path, centre=centre))


def _broken(problem: Problem, track: Track) -> tuple[float, float]:
    tube, limits = track.tube, problem.limits
    out = np.empty(3)
    pinched(
        tube.s_m, tube.floor_m, tube.ceiling_m, problem.start[2], problem.goal[2],
        limits.max_climb_slope, limits.max_descent_slope, out,
    )  # fmt: skip
    total, worst, by = out.tolist()
    for b in tube.bands:
        shut(tube.s_m, tube.floor_m, tube.ceiling_m, b.s_m, b.bottom_m, b.top_m, out)
        length, middle = float(out[0]), float(out[1])
        total += ZONE_M * length
        if length > by:
            worst, by = middle, length
    return total, worst
