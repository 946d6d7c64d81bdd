"""The default planner: grid search for the way, exact taut strings for the rest.

Routes through different gaps and at different heights are found on a lattice (`routes`), pulled tight under the
exact test (`pulling`), and the cheapest becomes a path (`finish`) that the exact check passes, or nothing does.
Its lower bound is the straight line from stop to stop: true for every path, and far from tight among mountains.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.diagnose import Refusal, check_ends, explain
from gcsplan.planners.finish import thin, way_points
from gcsplan.planners.lattice import terminals
from gcsplan.planners.problem import Problem, Progress, Solution
from gcsplan.planners.pulling import Allowance, Pulled
from gcsplan.planners.routes import LEVELS, Router
from gcsplan.planners.track import Flown, Track, distances, fly, make_track
from gcsplan.world.airspace import Legs, Violation
from gcsplan.world.path import Path

Floats = NDArray[np.float64]

CAPS = 4
"""Altitude caps tried below the first route."""
TRIALS = 600
"""Most exact trials that one round of pulling may spend on one route."""
COARSE, MEDIUM, FINE = 3e-4, 5e-5, 1e-5
"""Least gain worth a change, as a part of the straight way, in the three rounds of pulling."""
WORTH = 1e-4
"""What fewer vertices may cost, as a part of the straight way."""

CORRECTIONS, CORRECTED_M = 12, 0.01
"""How often a profile is corrected by what the exact check finds near its ends, and by how much beyond it."""

BOUND_NOTE = "the lower bound is the straight line from stop to stop: true, but not tight"


def plan(problem: Problem) -> Solution:
    """A path from start to goal that `Airspace.examine` passes, as short (or thrifty) as this planner finds.

    Deterministic: stops on counted work; ``budget_s``, for improving the first path, is a backstop. Raises Refusal
    (a NoMission) that names the binding constraint where no path is found.
    """
    begun = time.perf_counter()
    check_ends(problem)
    bound = straight_bound(problem)

    def tell(phase: str, cost: float | None) -> None:
        if problem.progress is not None:
            problem.progress(Progress(time.perf_counter() - begun, cost, bound, phase))

    tell("search", None)
    found, router = _routes(problem, bound)
    if not found:
        raise explain(problem, router)
    first_s = time.perf_counter() - begun
    best = min(x.cost for _, x in found)
    tell("pull", best)
    if router is not None:
        router.lattice.seems_open(np.array(problem.start[:2]), np.array(problem.goal[:2]))
    # Every kernel has run by now, so that compiling them never eats the budget and changes the answer.
    allowance = Allowance(0, time.perf_counter() + problem.budget_s)
    pulled = _pull(problem, found, router, allowance, tell)
    # A route as it was found is a last resort, should every pulled one fail the check.
    ways = [*((p.track, p.flown) for p in pulled), *found]
    solution = next((x for x in (_finish(problem, *way) for way in ways) if x is not None), None)
    if solution is None:
        raise Refusal(
            "a track was found, but its way points do not pass the exact check: please report this mission",
            reason="not_found",
        )
    path = Path(solution)
    cost = problem.cost(path)
    tell("done", cost)
    near = cost - bound <= problem.gap_percent / 100.0 * max(bound, 1e-9)
    return Solution(
        path=path,
        lower_bound=bound,
        stopped_by="gap" if near else "time" if allowance.timed_out else "exhausted",
        planning_s=time.perf_counter() - begun,
        first_path_s=first_s,
        notes=() if near else (BOUND_NOTE,),
    )


def straight_bound(problem: Problem) -> float:
    """No path costs less: straight from stop to stop, heights free where they are."""
    known: list[tuple[float, float]] = [(0.0, problem.start[2])]  # (metres along the track, altitude)
    way, last = 0.0, problem.start[:2]
    for v in problem.via:
        way += math.dist(last, (v.east_m, v.north_m))
        last = (v.east_m, v.north_m)
        if v.amsl_m is not None:
            known.append((way, v.amsl_m))
    way += math.dist(last, problem.goal[:2])
    known.append((way, problem.goal[2]))
    if problem.objective == "energy":
        rise = sum(abs(b[1] - a[1]) for a, b in pairwise(known))
        return problem.vertical_j_per_m * rise + problem.horizontal_j_per_m * way
    return sum(math.dist(a, b) for a, b in pairwise(known))


def _straight(problem: Problem) -> tuple[Track, Flown] | None:
    stops = terminals(problem)
    pin_m = [math.nan, *(math.nan if v.amsl_m is None else v.amsl_m for v in problem.via), math.nan]
    track = make_track(problem, np.array(stops), np.ones(len(stops), bool), np.array(pin_m))
    flown = fly(problem, track)
    return (track, flown) if isinstance(flown, Flown) else None


def _routes(problem: Problem, bound: float) -> tuple[list[tuple[Track, Flown]], Router | None]:
    """Routes that hold, from the first lattice that has any; the last lattice where none has."""
    found = []
    straight = _straight(problem)
    if straight is not None:
        found.append(straight)
        if straight[1].cost <= bound * (1.0 + 1e-9):
            return found, None
    router: Router | None = None
    way = sum(math.dist(a, b) for a, b in _pairs(problem))
    for level in LEVELS:
        router = Router.at(problem, level)
        first = router.route()
        if first is not None:
            found.append(first)
        # A way longer than the detours that this lattice holds may have a shorter rival outside it.
        if any(track.s_m[-1] <= level.detour * way for track, _ in found):
            if first is not None:
                found.extend(_variants(problem, router, first[1]))
            break
    return found, router


def _variants(problem: Problem, router: Router, first: Flown) -> list[tuple[Track, Flown]]:
    """Routes at lower altitude caps and with a price on climbing, where height matters to the cost."""
    out: list[tuple[Track, Flown]] = []
    flat = float(first.profile.s_m[-1])
    energy = problem.objective == "energy"
    if not energy and first.profile.length_m - flat < 2e-4 * flat:
        return out
    prices = [problem.vertical_j_per_m / max(problem.horizontal_j_per_m, 1e-9)] if energy else [0.1, 0.4]
    for price in prices:
        route = router.route(weight=price)
        if route is not None:
            out.append(route)
    high = float(first.profile.amsl_m.max())
    low = max(problem.start[2], problem.goal[2], *(v.amsl_m for v in problem.via if v.amsl_m is not None), -math.inf)
    for _ in range(CAPS):
        if high - low < 1.0:
            break
        cap = 0.5 * (low + high)
        route = router.route(cap_m=cap)
        if route is None:
            low = cap
        else:
            out.append(route)
            high = cap
    return out


def _pull(
    problem: Problem,
    found: list[tuple[Track, Flown]],
    router: Router | None,
    allowance: Allowance,
    tell: Callable[[str, float | None], None],
) -> list[Pulled]:
    """Routes pulled tight, cheapest first: all of them coarsely, the best three finer, the best two polished."""
    way = sum(math.dist(a, b) for a, b in _pairs(problem))
    guide = None if router is None else router.lattice
    runners: list[Pulled] = []
    for track, flown in found:
        allowance.grant(TRIALS)
        p = Pulled(problem, track, flown, allowance, guide)
        p.straighten()
        p.tighten(COARSE * way, 3)
        runners.append(p)
    runners = _best(runners, 3)
    for p in runners:
        allowance.grant(TRIALS)
        tell("pull", min(q.flown.cost for q in runners))
        p.tighten(MEDIUM * way, 4)
        for part in (0.02, 0.007):
            p.bend(part * way, MEDIUM * way)
            p.shift(part * way, MEDIUM * way)
        p.tighten(MEDIUM * way, 4)
    runners = _best(runners, 2)
    for p in runners:
        allowance.grant(TRIALS)
        tell("polish", min(q.flown.cost for q in runners))
        p.tighten(FINE * way)
        for part in (0.007, 0.0025, 0.0008):
            p.bend(part * way, FINE * way)
            p.shift(part * way, FINE * way)
        p.tighten(FINE * way)
        p.settle()
        allowance.grant(TRIALS // 4)
        p.simplify(WORTH * way)
    return _best(runners, 2)


def _best(runners: list[Pulled], count: int) -> list[Pulled]:
    """The cheapest few; of those that cost the same within a hair, one."""
    out: list[Pulled] = []
    for p in sorted(runners, key=lambda p: p.flown.cost):
        if len(out) < count and all(abs(p.flown.cost - q.flown.cost) > 1e-6 * q.flown.cost for q in out):
            out.append(p)
    return out


def _pairs(problem: Problem) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    return list(pairwise(terminals(problem)))


def _finish(problem: Problem, track: Track, flown: Flown) -> Floats | None:
    """Way points that the exact check passes: thinned, or else every vertex; None where none do.

    Close to start and goal a track is held to its floor a little less strictly than elsewhere (`track`). What the
    check finds there becomes a door of its own, and the profile is drawn anew.
    """
    known: list[tuple[float, float, float]] = []
    for _ in range(CORRECTIONS):
        points, pinned = way_points(problem, track, flown)
        violations = _violations(problem, points)
        if not violations:
            few = thin(problem, points, pinned, 1e-5 * flown.cost)
            return points if _violations(problem, few) else few
        s = distances(points[:, :2])
        for v in violations:
            at = float(s[v.leg] + v.fraction * (s[v.leg + 1] - s[v.leg]))
            room = v.by + CORRECTED_M
            if v.kind in ("min_agl", "terrain_clearance"):
                known.append((at, v.amsl_m + room, math.inf))
            elif v.kind == "max_agl":
                known.append((at, -math.inf, v.amsl_m - room))
            else:
                return None
        again = fly(problem, track, known=known)
        if not isinstance(again, Flown):
            return None
        flown = again
    return None


def _violations(problem: Problem, points: Floats) -> tuple[Violation, ...]:
    return problem.airspace.examine(Legs.of_path(points, problem.limits), problem.limits).violations
