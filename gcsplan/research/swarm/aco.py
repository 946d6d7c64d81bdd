"""Ants on a grid of sections across the track: the krill paper's baseline (eq. 1, 2), on straight edges.

All of this is our decision (D): K section planes of 21 × 21 nodes, between the sides of the flight volume and between
floor and ceiling; α 1, β 5, ρ 0.5, τ0 1, Δτ = L_straight/L_ant on the edges of the ants that arrive, τ in [0.01, 50],
η = 1/d. Nodes and edges that are not allowed are left out; an ant in a dead end is dropped. The nodes of an ant are the
control points of its curve, and the best curve by the objective is kept.
"""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.errors import InputError, unknown_name
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution
from gcsplan.research.optimisers.driver import History, OptimiserResult
from gcsplan.research.swarm import SwarmEntry
from gcsplan.research.swarm import scene_kernels as k
from gcsplan.research.swarm.encodings import LATERAL
from gcsplan.research.swarm.objectives import Cost
from gcsplan.research.swarm.planner import Found, cost_of, drawn, until_found
from gcsplan.research.swarm.scene import Scene
from gcsplan.research.swarm.settings import Settings

ACROSS = ALTITUDES = 21
EDGE_POINTS = 16
"""Points on an edge that runs straight from one section to the next."""


@dataclass(frozen=True, slots=True)
class Rule:
    """Parameters of eq. 1 and 2: α, β, ρ, τ0 and the least and most of τ."""

    alpha: float = 1.0
    beta: float = 5.0
    evaporation: float = 0.5
    first: float = 1.0
    least: float = 0.01
    most: float = 50.0


def plan(problem: Problem, row: SwarmEntry) -> Solution:
    """A path that `Airspace.examine` passes: few way points along the best ant's curve, or a repair of that curve.

    Raises Refusal (NoMission, ``not_found``) if within the budget no ant arrives or no curve can be repaired.
    """
    if problem.options.get("warm_start") is not None:
        raise InputError("aco takes no warm_start: ants begin without trails; leave it away, or take another planner")
    return until_found(problem, row, search)


def search(problem: Problem, settings: Settings, scene: Scene | None = None) -> Found:
    """Run the ants once; ``scene`` as in `cost_of`. Raises InputError for unknown options, Refusal if none arrives."""
    parameters = settings.split()[1]
    for name in parameters:
        if name not in Rule.__dataclass_fields__:
            raise unknown_name(f"aco has no parameter {name!r}", name, Rule.__dataclass_fields__)
    rule = Rule(**{key: float(value) for key, value in parameters.items()})
    cost = cost_of(problem, replace(settings, encoding="sections"), scene)
    code, scene = cost.code, cost.code.scene
    layers = make_layers(scene, code.points)
    result, nodes = march(problem, cost, layers, open_between(scene, layers), rule, settings)
    problem.budget.spend("drawn", result.evaluations)
    if nodes is None:
        raise Refusal(
            f"no mission: no ant of {result.evaluations} came through the {sum(code.points)} sections on allowed "
            f"edges: try more points, or another planner",
            reason="not_found",
        )
    return drawn(problem, cost, result, nodes)


def make_layers(scene: Scene, points: tuple[int, ...]) -> list[Floats]:
    """Nodes (n, 3) of each layer: a terminal is a layer of one node, a section one of at most 21 × 21."""
    layers = [scene.terminals[:1]]
    for i, count in enumerate(points):
        a, b = scene.terminals[i], scene.terminals[i + 1]
        ahead = b[:2] - a[:2]
        long = max(float(np.hypot(*ahead)), 1e-9)
        left = np.array([-ahead[1], ahead[0]]) / long if ahead.any() else np.array([0.0, 1.0])
        for j in range(count):
            layers.append(_section(scene, a[:2] + (j + 1) / (count + 1) * ahead, left, LATERAL * long))
        layers.append(scene.terminals[i + 1 : i + 2])
    return layers


def _section(scene: Scene, middle: Floats, left: Floats, reach_m: float) -> Floats:
    """Nodes (n, 3) of one plane across the track, only where the floor is not above the ceiling."""
    # Distance to either side at which the plane leaves the volume.
    with np.errstate(divide="ignore"):
        sides = np.stack([(scene.low[:2] - middle) / left, (scene.high[:2] - middle) / left])
    finite = np.where(np.isfinite(sides), sides, np.copysign(np.inf, sides))
    first, last = max(-reach_m, float(finite.min(axis=0).max())), min(reach_m, float(finite.max(axis=0).min()))
    flat = middle + np.linspace(first, max(first, last), ACROSS)[:, None] * left
    low, high = scene.room(flat)
    roomy = high >= np.nan_to_num(scene.floor(flat), nan=np.inf)
    z = low[:, None] + np.linspace(0.0, 1.0, ALTITUDES) * (high - low)[:, None]
    nodes = np.concatenate([np.repeat(flat[:, None], ALTITUDES, axis=1), z[..., None]], axis=-1)
    return np.ascontiguousarray(nodes[roomy].reshape(-1, 3))


def open_between(scene: Scene, layers: list[Floats]) -> list[Floats]:
    """Lengths (A, B) of the edges from each layer to the next, inf for edges that are not allowed."""
    out = []
    for a, b in itertools.pairwise(layers):
        lengths = np.full((len(a), len(b)), np.inf)
        if lengths.size:
            step_m = max(float(np.hypot(*(b.mean(axis=0) - a.mean(axis=0))[:2])) / EDGE_POINTS, 0.1)
            k.open_edges(
                a, b, step_m, scene.follows_ground, scene.heights, scene.quadratic, scene.floors, scene.floor_map,
                scene.numbers, scene.zones, scene.corners, lengths,
            )  # fmt: skip
        out.append(lengths)
    return out


def march(
    problem: Problem, cost: Cost, layers: list[Floats], lengths: list[Floats], rule: Rule, settings: Settings
) -> tuple[OptimiserResult, Floats | None]:
    """Run the colonies; return the run's result and the best ant's control points (N, 3), None if no ant arrived.

    An evaluation is one ant, whether it arrives or not. ``evaluations`` is used exactly: the last colony is cut to it.
    """
    rng = np.random.default_rng(problem.seed)
    ants, rounds, limit = settings.population or 50, settings.iterations or 100, settings.evaluations
    if limit is not None and settings.iterations is None:
        rounds = limit
    eager = [np.where(np.isfinite(d), np.maximum(d, 1e-9), np.inf) ** -rule.beta for d in lengths]
    scent = [np.full(d.shape, rule.first) for d in lengths]
    best, best_cost, spent = None, np.inf, 0
    trace = [(0, 0, np.inf)]  # before the first colony
    begun = time.perf_counter()
    for turn in range(rounds):
        count = ants if limit is None else min(ants, limit - spent)
        if count <= 0:
            break
        spent += count
        ways = walk(rng, count, eager, scent, rule.alpha)
        long = sum((d[ways[:, i], ways[:, i + 1]] for i, d in enumerate(lengths)), np.zeros(len(ways)))
        for i, s in enumerate(scent):
            s *= 1.0 - rule.evaporation  # eq. 2
            np.add.at(s, (ways[:, i], ways[:, i + 1]), cost.code.scene.straight_m / long)
            np.clip(s, rule.least, rule.most, out=s)
        if len(ways):
            controls = np.stack([layer[ways[:, i]] for i, layer in enumerate(layers)], axis=1)
            costs = cost.of_controls(controls)
            lead = int(costs.argmin())
            if costs[lead] < best_cost:
                best, best_cost = controls[lead], float(costs[lead])
        trace.append((spent, turn + 1, best_cost))
        if problem.progress is not None and turn % 10 == 0:
            problem.progress(Progress(time.perf_counter() - begun, best_cost, None, "search"))
    evaluations, iterations, history = (np.array(column) for column in zip(*trace, strict=True))
    stopped = "evaluations" if spent == limit else "iterations"
    account = History(evaluations, iterations, history)
    return OptimiserResult(np.zeros(0), best_cost, spent, len(trace) - 1, account, stopped, "aco"), best  # type: ignore[arg-type]


def walk(rng: np.random.Generator, ants: int, eager: list[Floats], scent: list[Floats], alpha: float) -> Indices:
    """Nodes (arrived, layers) of the ants that arrive; each step is drawn by eq. 1."""
    ways = np.zeros((ants, 1), np.intp)
    for e, s in zip(eager, scent, strict=True):
        at = ways[:, -1]
        weight = e[at] * (s[at] if alpha == 1.0 else s[at] ** alpha)
        total = np.cumsum(weight, axis=1)
        draw = rng.random(len(at)) * (total[:, -1] if total.shape[1] else 0.0)
        alive = (total[:, -1] > 0.0) if total.shape[1] else np.zeros(len(at), bool)
        step = (total <= draw[:, None]).sum(axis=1)
        ways = np.concatenate([ways, step[:, None]], axis=1)[alive]
    return ways
