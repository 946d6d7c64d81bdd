"""``gcsplan bench everyday``: the default planner on everyday missions, compared with a visibility graph.

Every mission runs in a separate process, so that its memory and seconds are its own, and so that a runaway one can be
killed without affecting the others.
"""

from __future__ import annotations

import contextlib
import json
import math
import multiprocessing as mp
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import yaml

from gcsplan.app.fleet.pipeline import world_of
from gcsplan.app.plan.problem import make_problem
from gcsplan.bench.everyday.missions import EVERYDAY_KINDS, Everyday, draw
from gcsplan.bench.everyday.oracle import EnclosedPlace, VisibilityGraph
from gcsplan.bench.files import write_all
from gcsplan.bench.measure import Memory, passes, percentile, resident_mb
from gcsplan.errors import InputError, NoMission
from gcsplan.export.table import csv_of
from gcsplan.mission_file import load_mission
from gcsplan.planners.optimal.table import require_names
from gcsplan.planners.problem import Problem, Solution
from gcsplan.planners.registry import get as get_planner

MISSIONS_OF_A_SEED = 100
KILL_MB, KILL_S = 6000.0, 120.0
"""Megabytes and seconds above which a process is killed."""
GROUND_ALIKE_M = 1e-6
GAIN_PERCENT = 1e-3
"""Percent that a search must gain to count."""


@dataclass(frozen=True, slots=True)
class MissionOutcome:
    """The result of one mission.

    ``oracle_m`` is the shortest track on flat ground around the zones; ``over_percent`` is how much longer the
    planner's track is. ``status`` is solved, infeasible (proved), not found, unsafe, failed or killed. Seconds are
    wall-clock seconds; ``memory_mb`` is the peak above the process's memory before.
    """

    name: str
    kind: str
    margins: bool
    straight_m: float
    zones: int
    status: str = "failed"
    cost: float | None = None
    bound: float | None = None
    gap_percent: float | None = None
    oracle_m: float | None = None
    over_percent: float | None = None
    first_path_s: float | None = None
    planning_s: float | None = None
    memory_mb: float | None = None
    stopped_by: str = ""
    detail: str = ""
    search: str = "[]"
    """JSON: the steps of the plan, as `gcsplan.planners.problem.Step`."""


def problem_of(one: Everyday) -> Problem:
    """The planner's problem of an everyday mission, with the margins for rounding of ``gcsplan plan``."""
    source = load_mission(Path(f"{one.kind}.yaml"), text=yaml.safe_dump(one.document))
    return make_problem(source, source.vehicles[0], world_of(source), "length", source.planner.seed)[0]


def oracle_m(problem: Problem) -> float | None:
    """The visibility graph's length on flat ground, m; inf if zones enclose a place, None if the ground is not flat."""
    ground, air = problem.airspace.surface.top_m, problem.airspace
    if float(ground.max() - ground.min()) > GROUND_ALIKE_M:
        return None
    places = [problem.start[:2], *((v.east_m, v.north_m) for v in problem.via), problem.goal[:2]]
    try:
        return VisibilityGraph.of(air.zones, air.beside_m(problem.limits), air.scale).shortest(places)
    except EnclosedPlace:
        return math.inf


def run(
    directory: Path | None = None,
    *,
    seeds: Sequence[int] = (1,),
    count: int = MISSIONS_OF_A_SEED,
    kinds: Sequence[str] = EVERYDAY_KINDS,
    without: Sequence[str] = (),
    tell: Callable[[str], None] = lambda words: None,
) -> list[MissionOutcome]:
    """Plan ``count`` missions of each seed, of ``kinds`` only; write ``everyday.csv`` and ``.md`` to ``directory``.

    ``without``: sources of paths and bounds that the planner must not use. Raises InputError for unknown kinds.
    """
    for kind in kinds:
        if kind not in EVERYDAY_KINDS:
            raise InputError(f"the kinds of missions are {', '.join(EVERYDAY_KINDS)}, given {kind!r}")
    require_names(without)
    outcomes = []
    _solve(problem_of(draw(1, EVERYDAY_KINDS.index("discs"))))  # compiles the kernels before anything is timed
    for seed in seeds:
        for number in range(count):
            if EVERYDAY_KINDS[number % len(EVERYDAY_KINDS)] not in kinds:
                continue
            found = measure(draw(seed, number), without)
            outcomes.append(found)
            tell(line(found))
    if directory is not None:
        write_all(directory, {"everyday.csv": as_csv(outcomes), "everyday.md": report(outcomes)})
    return outcomes


def measure(one: Everyday, without: Sequence[str] = ()) -> MissionOutcome:
    """Plan one mission in a separate process."""
    problem = problem_of(one)
    if without:
        problem = replace(problem, options={**problem.options, "without": tuple(without)})
    margins = problem.limits.horizontal_clearance_m > 0.0
    straight = math.dist(problem.start[:2], problem.goal[:2])
    base = MissionOutcome(
        one.name, one.kind, margins, straight, len(problem.airspace.zones), oracle_m=oracle_m(problem)
    )
    receiver, sender = mp.get_context("fork").Pipe(duplex=False)
    child = mp.get_context("fork").Process(target=_child, args=(problem, sender), daemon=True)
    begun = time.perf_counter()
    child.start()
    sender.close()
    found: dict[str, Any] = {"status": "killed"}
    while not receiver.poll(0.05):
        rss_mb = resident_mb(child.pid)
        if time.perf_counter() - begun > KILL_S or rss_mb > KILL_MB:
            child.kill()
            found |= {"memory_mb": rss_mb, "planning_s": time.perf_counter() - begun}
            break
    else:
        with contextlib.suppress(EOFError):
            found = receiver.recv()
    child.join()
    result = replace(base, **found)
    if result.status == "solved" and base.oracle_m is not None and result.cost is not None:
        over = 100.0 * (result.cost / base.oracle_m - 1.0) if base.oracle_m > 0.0 else 0.0
        result = replace(result, over_percent=over)
    return result


def _child(problem: Problem, sender: Any) -> None:
    memory, begun = Memory(), time.perf_counter()
    with memory.peak():
        found = _solve(problem)
    found |= {"planning_s": time.perf_counter() - begun, "memory_mb": memory.peak_mb}
    sender.send(found)
    sender.close()


def _solve(problem: Problem) -> dict[str, Any]:
    try:
        solution: Solution = get_planner("optimal").plan(problem)
    except NoMission as why:
        return {"status": "infeasible" if why.reason == "infeasible" else "not found", "detail": why.message}
    except Exception as why:
        return {"status": "failed", "detail": f"{type(why).__name__}: {why}"}
    cost, bound = problem.cost(solution.path), solution.lower_bound
    looked_at = solution.problem or problem  # a wider window samples analytic peaks on another raster
    return {
        "status": "solved" if passes(looked_at, solution.path.points) else "unsafe",
        "cost": cost, "bound": bound, "first_path_s": solution.first_path_s, "stopped_by": solution.stopped_by,
        "gap_percent": None if not bound else 100.0 * (cost / bound - 1.0),
        "search": json.dumps([asdict(step) for step in solution.search]),
    }  # fmt: skip


def line(o: MissionOutcome) -> str:
    """One mission in one line."""

    def number(value: float | None, form: str) -> str:
        return "-" if value is None else format(value, form)

    return (
        f"{o.name} {o.kind:7} {'margins' if o.margins else 'none   '} {o.straight_m:7.0f} m {o.zones:4} zones "
        f"{o.status:10} gap {number(o.gap_percent, '7.3f')} % over oracle {number(o.over_percent, '7.3f')} % "
        f"first {number(o.first_path_s, '6.3f')} s all {number(o.planning_s, '6.2f')} s "
        f"{number(o.memory_mb, '5.0f')} MB {o.stopped_by} {o.detail[:90]}"
    )


def as_csv(outcomes: Sequence[MissionOutcome]) -> str:
    """CSV with one row per mission."""
    return csv_of([[f.name for f in fields(MissionOutcome)], *(asdict(o).values() for o in outcomes)], end="\r\n")


def report(outcomes: Sequence[MissionOutcome]) -> str:
    """Solved, gaps, lengths over the oracle's, seconds, megabytes, by kind and in total; Markdown."""
    lines = [
        "| kind | missions | solved | infeasible | not found | other | gap p50, p90, max % | over the graph max % | "
        "first path p50, max s | whole p50, p90, max s | MB max |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    kinds = [k for k in EVERYDAY_KINDS if any(o.kind == k for o in outcomes)]
    for name, group in [*((k, [o for o in outcomes if o.kind == k]) for k in kinds), ("all", list(outcomes))]:
        counts = [sum(o.status == s for o in group) for s in ("solved", "infeasible", "not found")]
        lines.append(
            f"| {name} | {len(group)} | {counts[0]} | {counts[1]} | {counts[2]} | {len(group) - sum(counts)} | "
            f"{_some(group, 'gap_percent', 50, 90, 100)} | {_some(group, 'over_percent', 100)} | "
            f"{_some(group, 'first_path_s', 50, 100)} | {_some(group, 'planning_s', 50, 90, 100)} | "
            f"{_some(group, 'memory_mb', 100)} |"
        )
    return "\n".join([*lines, "", *_searches(outcomes)]) + "\n"


def _searches(outcomes: Sequence[MissionOutcome]) -> list[str]:
    """The runs and results of each search over all missions; Markdown."""
    found: dict[str, list[dict[str, Any]]] = {}
    for outcome in outcomes:
        for step in json.loads(outcome.search):
            found.setdefault(step["name"], []).append(step)
    lines = [
        "| search | runs | better path in | most gained % | higher bound in | most raised % | refused | s in all |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, steps in sorted(found.items(), key=lambda item: -len(item[1])):
        gained, raised = ([step[key] for step in steps] for key in ("gained_percent", "bound_percent"))
        lines.append(
            f"| {name} | {len(steps)} | {sum(g > GAIN_PERCENT for g in gained)} | {max(gained):.3g} | "
            f"{sum(r > GAIN_PERCENT for r in raised)} | {max(raised):.3g} | {sum(step['refused'] for step in steps)} | "
            f"{sum(step['s'] for step in steps):.1f} |"
        )
    return lines


def _some(group: Sequence[MissionOutcome], name: str, *percents: float) -> str:
    values = [v for o in group if (v := getattr(o, name)) is not None]
    found = [percentile(values, p) for p in percents]
    return ", ".join("-" if v is None else f"{v:.3g}" for v in found)
