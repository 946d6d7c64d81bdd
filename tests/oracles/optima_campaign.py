"""Compare the default planner with independent optima on many small random missions.

As a module: ``python -m tests.oracles.optima_campaign --seeds 0 500 --families passes climbs --effort patient``. It
prints every mission on which something is wrong, and at the end a table of figures by family. It runs every family on
one seed before the next seed, so a campaign ended by ``--minutes`` or Ctrl-C has covered all families equally.
``--time``: with the objective time in place of each mission's own, at speeds drawn for it (`in_time`); ``--airspeed``:
at an airspeed (`at_airspeed`).
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from gcsplan.errors import NoMission
from gcsplan.planners.airspeed import Airspeed
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem, Progress, Solution
from gcsplan.world.airspace import Legs
from gcsplan.world.geometry.path import Path
from tests.oracles.optima import shortest_past_discs
from tests.oracles.optima_polish import PATIENT, QUICK, Effort, cost_of, polish
from tests.oracles.optima_search import best_path
from tests.oracles.optima_witnesses import known
from tests.oracles.optima_worlds import FAMILIES, HOLED, Case, make

SURE_M = 2e-3
"""Brute-force breaches (m) beyond this count: the fitted map of a raster in degrees may be off by that much."""
TOUCH_M = 1e-5
"""Metres by which a path may be shorter than a bound: the exact check allows a micrometre at every point of a path."""

ILLEGAL = ("exact check", "brute force", "ends elsewhere", "misses via")
"""First words of faults of the path itself; all other faults concern its bound, its optimality or a refusal."""
COLUMNS = (
    ("worlds", 7), ("solved", 7), ("missed", 7), ("unsound", 8), ("illegal", 8), ("path over best known %", 24),
    ("best known over bound %", 24), ("planning ms", 18), ("judging s", 10),
)  # fmt: skip
"""Headings and widths of the table's columns."""


@dataclass(eq=False)
class Verdict:
    """The result of one mission. ``wrong``: faults; ``missed``: a path is known and the planner found none, without
    proving that there is none. A cost that does not exist is NaN."""

    family: str
    seed: int
    wrong: list[str] = field(default_factory=list)
    missed: bool = False
    cost: float = math.nan
    bound: float = math.nan
    best: float = math.nan
    exact: float = math.nan
    refusal: str = ""
    planning_s: float = 0.0
    judging_s: float = 0.0

    @property
    def is_illegal(self) -> bool:
        """Whether the path breaks a limit or misses a terminal."""
        return any(text.startswith(ILLEGAL) for text in self.wrong)

    @property
    def is_unsound(self) -> bool:
        """Whether there is any other fault: a bound above a path, a path shorter than the optimum, a false refusal."""
        return any(not text.startswith(ILLEGAL) for text in self.wrong)

    @property
    def short(self) -> float:
        """Best known cost / bound − 1."""
        return self.best / self.bound - 1.0

    @property
    def gap(self) -> float:
        """The planner's own cost / bound − 1."""
        return self.cost / self.bound - 1.0

    @property
    def excess(self) -> float:
        """The planner's cost / best known cost − 1."""
        return self.cost / self.best - 1.0

    def __str__(self) -> str:
        words = "; ".join(self.wrong) or ("missed" if self.missed else "holds")
        return (
            f"{self.family} {self.seed}: {words} (planner {self.cost:.4f}, bound {self.bound:.4f}, best known "
            f"{self.best:.4f}, exact {self.exact:.4f}{', ' + self.refusal if self.refusal else ''})"
        )


def judge(
    family: str, seed: int, effort: Effort = QUICK, planner: Callable[[Problem], Solution] = plan, **changes: object
) -> Verdict:
    """Plan one mission and compare the result with the exact check, brute force, and the best known path.

    If a legal path is stored for the mission, only a patient ``effort`` searches for another one as well.
    """
    case = make(family, seed)
    reports: list[Progress] = []
    problem = replace(case.problem, progress=reports.append, **changes)  # type: ignore[arg-type]
    verdict = Verdict(family, seed)
    witness = known(family, seed, case)
    found = best_path(problem, seed, effort) if witness is None or effort is PATIENT else None
    costs = [cost_of(problem, way) for way in (witness, found) if way is not None]
    if case.discs is not None:
        verdict.exact = exact_past_discs(replace(case, problem=problem))
        costs += [verdict.exact] if math.isfinite(verdict.exact) else []
    begun = time.perf_counter()
    try:
        solution = planner(problem)
    except NoMission as refusal:
        verdict.planning_s = time.perf_counter() - begun
        verdict.refusal = f"{refusal.reason}: {refusal}"
        verdict.best = min(costs, default=math.nan)
        if costs and refusal.reason == "infeasible":
            verdict.wrong.append("called infeasible, but here is a path")
        verdict.missed = bool(costs)
        return verdict
    except (ArithmeticError, AssertionError, LookupError, RuntimeError, TypeError, ValueError, RuntimeWarning) as e:
        verdict.wrong.append(f"crashed: {e!r}")
        return verdict
    verdict.planning_s = time.perf_counter() - begun
    points = solution.path.points
    verdict.cost = problem.cost(solution.path)
    verdict.wrong += faults(case, solution.path)
    better = polish(problem, np.array(points), np.random.default_rng(seed), effort, widest=0.004)
    verdict.best = min([*costs, verdict.cost, cost_of(problem, better)])
    touch = TOUCH_M * dearest_metre(problem) + 1e-9 * verdict.best
    if solution.lower_bound is None or not math.isfinite(solution.lower_bound):
        verdict.wrong.append(f"no lower bound: {solution.lower_bound}")
        return verdict
    # Bounds reported as progress are promises too.
    verdict.bound = max([solution.lower_bound, *(x.lower_bound for x in reports if x.lower_bound is not None)])
    if verdict.bound > verdict.cost + touch:
        verdict.wrong.append("the bound lies over the planner's own path")
    elif verdict.bound > verdict.best + touch:
        over = 100.0 * (verdict.bound / verdict.best - 1.0)
        verdict.wrong.append(f"the bound lies {over:.5f} % over a path that is known")
    if verdict.cost < verdict.exact - touch:
        verdict.wrong.append("the path is shorter than the optimum")
    return verdict


def dearest_metre(p: Problem) -> float:
    """The most that a metre costs."""
    if p.airspeed is not None:
        against_m_s = p.airspeed.indicated_m_s - p.airspeed.blows_m_s
        return 1.0 / min(against_m_s, p.airspeed.climb_m_s, p.airspeed.descent_m_s)
    if p.objective == "time":
        return 1.0 / min(p.speed_m_s, p.climb_m_s, p.descent_m_s)
    return 1.0 if p.objective == "length" else p.vertical_j_per_m + p.horizontal_j_per_m


def in_time(seed: int) -> dict[str, Any]:
    """The objective time, with speeds for one seed: fast and slow beside the rates of climb and descent."""
    rng = np.random.default_rng([seed, 52])
    rates = rng.choice([0.5, 1.5, 2.5, 5.0, 15.0], 2).tolist()
    return {"objective": "time", "speed_m_s": float(rng.choice([5.0, 10.0, 15.0])), "climb_m_s": rates[0],
            "descent_m_s": rates[1]}  # fmt: skip


def at_airspeed(seed: int) -> dict[str, Any]:
    """The objective time of a fixed wing, with airspeed and wind for one seed, and rates that bind it or do not."""
    rng = np.random.default_rng([seed, 53])
    fast = float(rng.choice([8.0, 15.0, 30.0]))
    rates = rng.choice([math.inf, 0.3, 0.1], 2, p=[0.6, 0.2, 0.2]) * fast
    blows_m_s, angle = fast * float(rng.choice([0.0, 0.3, 0.6, 0.9])), float(rng.uniform(0.0, 2.0 * math.pi))
    wind_m_s = blows_m_s * math.cos(angle), blows_m_s * math.sin(angle)
    airspeed = Airspeed(fast, float(rates[0]), float(rates[1]), wind_m_s)
    return {"objective": "time", "airspeed": airspeed, "speed_m_s": 2.6 * fast}


def reverse(p: Problem) -> Problem:
    """The same mission flown backwards: every path of one, reversed, is a path of the other."""
    limits = replace(p.limits, max_climb_deg=p.limits.max_descent_deg, max_descent_deg=p.limits.max_climb_deg)
    return replace(
        p, start=p.goal, goal=p.start, via=p.via[::-1], limits=limits, climb_m_s=p.descent_m_s, descent_m_s=p.climb_m_s
    )  # fmt: skip


def exact_past_discs(case: Case) -> float:
    """The optimum of a mission past unlimited discs over flat ground."""
    p = case.problem
    assert case.discs is not None
    flat = shortest_past_discs(p.start[:2], p.goal[:2], case.discs)
    rise = abs(p.goal[2] - p.start[2])
    if p.airspeed is not None:
        return math.nan
    if p.objective == "time":
        return max(flat / p.speed_m_s, rise / (p.climb_m_s if p.goal[2] > p.start[2] else p.descent_m_s))
    if p.objective == "energy":
        return p.horizontal_j_per_m * flat + p.vertical_j_per_m * rise
    return math.hypot(flat, rise)


def faults(case: Case, path: Path, step_m: float = 1.0) -> list[str]:
    """Faults of a path, by the exact check and by independent brute force at steps of ``step_m``."""
    p = case.problem
    legs = Legs.of_path(path.points, p.limits)
    out = [f"exact check: {v.kind} by {v.by:.6f} on leg {v.leg}" for v in p.airspace.examine(legs, p.limits).violations]
    if np.abs(path.points[[0, -1]] - np.array([p.start, p.goal])).max() > 1e-6:
        out.append("ends elsewhere")
    at = 0
    for k, v in enumerate(p.via):
        near = np.hypot(*(path.points[at:, :2] - [v.east_m, v.north_m]).T) < 1e-6
        if v.amsl_m is not None:
            near &= np.abs(path.points[at:, 2] - v.amsl_m) < 1e-6
        if not near.any():
            out.append(f"misses via {k}")
            break
        at += int(near.argmax())
    oracle = case.oracle(step_m)
    track, altitude = p.limits.track_error_m, p.limits.altitude_error_m
    for leg, (a, b) in enumerate(zip(path.points[:-1], path.points[1:], strict=True)):
        depths = oracle.depths(a, b, False, track, altitude, p.limits)
        out += [f"brute force: {kind} by {depth:.4f} on leg {leg}" for kind, depth in depths.items() if depth > SURE_M]
        for k, zone in enumerate(oracle.zones):
            west, south, east, north = zone.bounds
            reach = 2.0 * (track + p.limits.horizontal_clearance_m) + 0.01 * (east - west)
            if max(a[0], b[0]) < west - reach or min(a[0], b[0]) > east + reach:
                continue
            if max(a[1], b[1]) < south - reach or min(a[1], b[1]) > north + reach:
                continue
            if oracle.zone_breach(k, a, b, track, altitude, p.limits, 8, 2, grow_m=-SURE_M, lift_m=-SURE_M):
                out.append(f"brute force: in zone {k} on leg {leg}")
    return out


def summary(verdicts: list[Verdict]) -> str:
    """One line of figures."""
    solved = [v for v in verdicts if math.isfinite(v.cost)]
    gaps = 100.0 * np.array([v.gap for v in solved if math.isfinite(v.bound)] or [math.nan])
    excess = 100.0 * np.array([v.excess for v in solved] or [math.nan])
    took = 1e3 * np.array([v.planning_s for v in verdicts])
    return (
        f"{len(verdicts)} missions, {len(solved)} solved, {sum(v.missed for v in verdicts)} missed, "
        f"{sum(bool(v.wrong) for v in verdicts)} wrong; gap % p50 {np.median(gaps):.3f} "
        f"p90 {np.quantile(gaps, 0.9):.3f} max {gaps.max():.3f}; "
        f"over the best known % p50 {np.median(excess):.4f} p90 {np.quantile(excess, 0.9):.4f} "
        f"max {excess.max():.3f}; ms p50 {np.median(took):.0f} p90 {np.quantile(took, 0.9):.0f} max {took.max():.0f}"
    )


def table(verdicts: list[Verdict]) -> str:
    """Figures by family and of all together. Three numbers in a cell are p50, p90 and maximum."""
    lines = [f"{'family':18}" + "".join(f"{head:>{width}}" for head, width in COLUMNS)]
    for family in [*dict.fromkeys(v.family for v in verdicts), "all"]:
        of = [v for v in verdicts if family in (v.family, "all")]
        solved = [v for v in of if math.isfinite(v.cost)]
        cells = [
            len(of),
            len(solved),
            sum(v.missed for v in of),
            sum(v.is_unsound for v in of),
            sum(v.is_illegal for v in of),
            _three([100.0 * v.excess for v in solved], 3),
            _three([100.0 * v.short for v in solved if math.isfinite(v.bound)], 3),
            _three([1e3 * v.planning_s for v in of], 0),
            f"{sum(v.judging_s for v in of):.0f}",
        ]
        row = "".join(f"{cell:>{width}}" for cell, (_, width) in zip(cells, COLUMNS, strict=True))
        lines.append(f"{family:18}{row}")
    return "\n".join(lines)


def _three(values: list[float], digits: int) -> str:
    if not values:
        return "-"
    return " ".join(f"{x:.{digits}f}" for x in (*np.quantile(values, (0.5, 0.9)).tolist(), max(values)))


def main() -> None:
    """Run a campaign from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 100), metavar=("FIRST", "LAST"))
    parser.add_argument("--families", nargs="+", default=[*FAMILIES, *HOLED], choices=[*FAMILIES, *HOLED])
    parser.add_argument("--effort", choices=("quick", "patient"), default="quick")
    parser.add_argument("--missed", action="store_true", help="print missed missions too")
    parser.add_argument(
        "--excess", type=float, default=math.inf, help="print missions this many percent over the best known"
    )
    parser.add_argument("--budget", type=float, help="the planner's budget_s, to set on a busy machine")
    parser.add_argument("--time", action="store_true", help="with the objective time")
    parser.add_argument("--airspeed", action="store_true", help="with the objective time of a fixed wing")
    parser.add_argument("--minutes", type=float, default=math.inf, help="start no mission after this many minutes")
    given = parser.parse_args()
    changes = {} if given.budget is None else {"budget_s": given.budget}
    verdicts: list[Verdict] = []
    begun = time.perf_counter()
    try:
        for seed, family in product(range(*given.seeds), given.families):
            before = time.perf_counter()
            if before - begun > 60.0 * given.minutes:
                break
            more = at_airspeed(seed) if given.airspeed else in_time(seed) if given.time else {}
            v = judge(family, seed, PATIENT if given.effort == "patient" else QUICK, **changes, **more)
            v.judging_s = time.perf_counter() - before - v.planning_s
            verdicts.append(v)
            if v.wrong or (v.missed and given.missed) or 100.0 * v.excess > given.excess:
                print(v, flush=True)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
    print(table(verdicts), flush=True)


if __name__ == "__main__":
    main()
