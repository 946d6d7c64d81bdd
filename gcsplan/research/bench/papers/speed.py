"""Speed of the swarms: whole runs, compared with mealpy's GWO and with one path per call, and path costs per second.

Everything is timed in one process, one after the other, best of a few; the ratios are what matters.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.bench.check import LIMITS, scene
from gcsplan.errors import InputError
from gcsplan.planners.problem import Problem
from gcsplan.research.bench.papers.scenarios import SCENARIOS, mission_text, prepare, settings_of
from gcsplan.research.optimisers.driver import minimise
from gcsplan.research.swarm import cost_kernels as k
from gcsplan.research.swarm.encodings import Code
from gcsplan.research.swarm.objectives import Cost, get_objective, sampled
from gcsplan.research.swarm.scene import Scene
from gcsplan.research.swarm.scene_kernels import SPACING

CASE = "ssgwo-table5"
"""The scenario that is timed: twelve cylinders, population 30, 500 iterations, 30 nodes."""
KRILL = ("krill-mound", "krill-forest", "krill-hills")
BATCH = 2048
COSTS = (("krill", "bspline"), ("ssgwo", "bspline"), ("msfoa", "bspline"), ("ib-abc", "sections"))
TERM_GROUPS = {
    "turns and slopes between nodes": k.ANGLES, "turns in space": k.ANGLES | k.BENDS, "exponentials of angles": k.YAWS,
    "nodes near zones": k.NODES_NEAR, "samples near zones": k.SAMPLES_NEAR, "heights above ground": k.HEIGHTS,
    "concealment": k.HIDING, "counts of samples": k.COUNTS,
}  # fmt: skip
"""The optional groups of terms, in words; the terms of turns in space contain the other turns."""
BARE_PART, DIVIDED_PART, ZONES_PART = "curve, lengths, floor", "denser samples on long legs", "zones"
AIMS = {"run_s": 0.25, "mealpy_ratio": 10.0, "single_ratio": 3.0, "costs_per_s": 300_000.0, "krill_s": 0.5}
"""The aims: most seconds, least ratios and rates."""


def run(repeats: int = 3, *, missions: Path | None = None, mealpy: bool = True) -> dict[str, Any]:
    """Time everything, best of ``repeats``; ``mealpy``: its GWO too. Raises InputError if that is not installed."""
    if repeats < 1:
        raise InputError(f"repeats must be 1 or more, given {repeats}")
    cost, size, rounds = cost_of(CASE, missions)

    def single(u: Floats) -> Floats:
        return np.array([cost(x[None])[0] for x in u])

    def swarm(objective: Callable[[Floats], Floats]) -> Callable[[], object]:
        return lambda: minimise("gwo", objective, cost.dim, population=size, iterations=rounds, seed=1)

    works: dict[str, Callable[[], object]] = {"run_s": swarm(cost), "single_s": swarm(single)}
    if mealpy:
        works["mealpy_s"] = _mealpy(cost, size, rounds)
    took = _best_s(works, repeats)
    krill = _best_s({name: _whole(name, missions) for name in KRILL}, repeats)
    batches = {f"{objective} cost, {encoding}": _batch(objective, encoding) for objective, encoding in COSTS}
    rates = {name: BATCH / seconds for name, seconds in _best_s(batches, repeats).items()}
    parts = {name: 1e6 * seconds / BATCH for name, seconds in _best_s(parts_of_cost(), repeats).items()}
    return {
        "repeats": repeats, "population": size, "iterations": rounds, **took, "krill_s": krill, "costs_per_s": rates,
        "parts_us": differences(parts),
        "single_ratio": took["single_s"] / took["run_s"],
        "mealpy_ratio": took["mealpy_s"] / took["run_s"] if mealpy else None,
    }  # fmt: skip


def report(result: dict[str, Any]) -> str:
    """The figures of `run` beside the aims."""

    def line(what: str, value: str, aim: str, reached: bool) -> str:
        return f"  {what:<44} {value:>14}   {aim:<18} {'reached' if reached else 'missed'}"

    r = result
    rows = [
        line("GWO, 12 cylinders, one run", f"{r['run_s']:.3f} s", f"≤ {AIMS['run_s']:g} s", r["run_s"] <= AIMS["run_s"])
    ]
    for name, words in (("mealpy_ratio", "mealpy's GWO, same objective"), ("single_ratio", "one path at a time")):
        if r[name] is not None:
            rows.append(line(f"  {words}", f"{r[name]:.1f} times", f"≥ {AIMS[name]:g} times", r[name] >= AIMS[name]))
    for name, seconds in r["krill_s"].items():
        rows.append(
            line(f"{name}, 100 iterations", f"{seconds:.3f} s", f"≤ {AIMS['krill_s']:g} s", seconds <= AIMS["krill_s"])
        )
    for name, rate in r["costs_per_s"].items():
        least = AIMS["costs_per_s"]
        rows.append(line(f"{name}: paths a second", f"{rate:,.0f}", f"≥ {least:,.0f}", rate >= least))
    if r["parts_us"]:
        rows += ["", "Where a path's time goes, µs:"]
        rows += [f"  {name:<44} {took:>14.2f}" for name, took in r["parts_us"].items()]
    return "\n".join(
        [
            f"Population {r['population']}, {r['iterations']} iterations, 30 nodes; paths of about 200 samples over "
            f"the sample DEM with 12 zones; one core, best of {r['repeats']}.",
            *rows,
        ]
    ) + "\n"  # fmt: skip


def _best_s(works: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Least thread seconds of each function, called in turn, after one round that does not count."""
    took: dict[str, list[float]] = {name: [] for name in works}
    for turn in range(repeats + 1):
        for name, work in works.items():
            began = time.thread_time()
            work()
            if turn:
                took[name].append(time.thread_time() - began)
    return {name: min(seconds) for name, seconds in took.items()}


def cost_of(name: str, missions: Path | None) -> tuple[Cost, int, int]:
    """The objective of a scenario's own algorithm, its population and iterations."""
    ready = prepare(name, mission_text(name, missions))
    settings = settings_of(SCENARIOS[name].paper.contenders[0], ready.source)
    volume, _ = settings.split()
    problem = ready.problems[0]
    code = Code.of(settings.encoding, Scene.of(problem, volume), settings.points)
    assert settings.population is not None
    assert settings.iterations is not None
    return Cost(problem, code, get_objective(settings.cost)), settings.population, settings.iterations


def _whole(name: str, missions: Path | None) -> Callable[[], object]:
    """A whole run of a scenario's own algorithm."""
    cost, size, rounds = cost_of(name, missions)
    optimiser = SCENARIOS[name].paper.contenders[0].planner
    return lambda: minimise(optimiser, cost, cost.dim, population=size, iterations=rounds, seed=1)


def _mealpy(cost: Cost, size: int, rounds: int) -> Callable[[], object]:
    try:
        mealpy = import_module("mealpy")
    except ImportError:
        raise InputError("the comparison needs mealpy, which is not installed: pip install 'gcsplan[bench]'") from None
    problem = {
        "bounds": mealpy.FloatVar(lb=[0.0] * cost.dim, ub=[1.0] * cost.dim), "minmax": "min", "log_to": None,
        "obj_func": lambda x: float(cost(np.asarray(x)[None])[0]),
    }  # fmt: skip
    return lambda: mealpy.GWO.OriginalGWO(epoch=rounds, pop_size=size).solve(problem, seed=1)


def _bench_problem() -> Problem:
    """Between opposite corners of the sample DEM, among 12 zones."""
    airspace, _ = scene(2, 1)
    ends = [(e, e, float(airspace.surface.top_at(e, e)) + 2.0 * LIMITS.min_agl_m) for e in (-9000.0, 9000.0)]
    return Problem(airspace, LIMITS, ends[0], ends[1])


def _batch(objective: str, encoding: str) -> Callable[[], object]:
    """The cost of a batch of paths."""
    problem = _bench_problem()
    code = Code.of(encoding, Scene.of(problem), 8)
    cost = Cost(problem, code, get_objective(objective))
    u = np.random.default_rng(1).random((BATCH, cost.dim))
    return lambda: cost(u)


def parts_of_cost() -> dict[str, Callable[[], object]]:
    """The kernel of all costs with more and more of its work, then with each of `TERM_GROUPS` on top."""
    scene_ = Scene.of(_bench_problem())
    code = Code.of("bspline", scene_, 8)
    drawn, stride = sampled(scene_, code.points)
    controls = code.controls(np.random.default_rng(1).random((BATCH, code.dim)))
    room, out = k.room(drawn.basis.shape[1]), np.empty((BATCH, k.TERMS))
    whole = scene_.numbers.copy()
    whole[SPACING] = math.inf

    def work(bits: int, zones: Floats, numbers: Floats) -> Callable[[], object]:
        return lambda: k.measure(
            controls, drawn.bands, drawn.spans, scene_.heights, scene_.quadratic, scene_.floors, scene_.floor_map,
            numbers, zones, scene_.corners, stride, bits, *room, out,
        )  # fmt: skip

    none = scene_.zones[:0]
    return {
        BARE_PART: work(0, none, whole),
        DIVIDED_PART: work(0, none, scene_.numbers),
        ZONES_PART: work(0, scene_.zones, scene_.numbers),
        **{name: work(bits, scene_.zones, scene_.numbers) for name, bits in TERM_GROUPS.items()},
    }


def differences(took: Mapping[str, float]) -> dict[str, float]:
    """The seconds that each part adds to the work before it."""
    whole = took[ZONES_PART]
    first = {
        BARE_PART: took[BARE_PART],
        DIVIDED_PART: took[DIVIDED_PART] - took[BARE_PART],
        ZONES_PART: whole - took[DIVIDED_PART],
    }
    return first | {name: took[name] - whole for name in TERM_GROUPS}
