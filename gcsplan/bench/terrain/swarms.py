"""mealpy's swarms: on a problem, with an encoding and a cost of their own; and on any cost (`minimised`).

On a problem: a B-spline of eight control points, penalties on samples, the exact check at the end.

A control point is a station on the straight line (evenly spaced), a distance to its side and an altitude, which suits
swarms far better than free points in space. Samples are held to slightly tighter limits than the problem's, so that the
path between two samples is likely to pass the exact check, which alone decides.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.bench.measure import passes
from gcsplan.bench.terrain.ompl import RivalAnswer, box_of, rival_module
from gcsplan.planners.problem import Problem
from gcsplan.world.geometry.zones import Circle, Level

SWARMS = {"GWO": "OriginalGWO", "PSO": "OriginalPSO", "DE": "OriginalDE", "ABC": "OriginalABC", "FOA": "OriginalFOA"}
BASELINES = {"DE": SWARMS["DE"], "GWO": SWARMS["GWO"]}
"""The baselines of `gcsplan bench swarms`."""
SWARM_MEMBERS, EPOCHS = 30, 500
CONTROL, SPLINE_SAMPLES = 8, 200
SAMPLE_SPARE_M, SAMPLE_SPARE_SLOPE = 5.0, 0.95
VIOLATION_WEIGHT = 30.0
"""What each metre of violation of each sample costs, in metres or seconds. Any violation at all costs a hundred times
that in addition, so that no illegal path beats a legal one of similar length."""


def plan(problem: Problem, name: str, seed: int) -> RivalAnswer:
    """Run the swarm of `SWARMS` called ``name``: 30 members, 500 epochs. Raises InputError if mealpy is missing."""
    mealpy = rival_module("mealpy")
    decode, cost = encoding(problem)
    calls = [0]

    def counted(x: Floats) -> float:
        calls[0] += 1
        return cost(x)

    model = getattr(getattr(mealpy, name), SWARMS[name])(epoch=EPOCHS, pop_size=SWARM_MEMBERS)
    size = 2 * CONTROL
    began = time.perf_counter()
    best = model.solve(
        {"bounds": mealpy.FloatVar(lb=[0.0] * size, ub=[1.0] * size), "minmax": "min", "obj_func": counted,
         "log_to": None},
        seed=seed,
    )  # fmt: skip
    took = time.perf_counter() - began
    points = decode(np.asarray(best.solution, dtype=np.float64))
    if not passes(problem, points):
        return RivalAnswer(None, None, None, None, took, calls[0], "the best member does not pass the exact check")
    way_cost = problem.cost_through(points)
    return RivalAnswer(points.tolist(), way_cost, way_cost, took, took, calls[0])


def encoding(problem: Problem) -> tuple[Callable[[Floats], Floats], Callable[[Floats], float]]:
    """The functions from the unit box (16,) to a path (200, 3), and to the cost that a swarm minimises."""
    from scipy.interpolate import BSpline

    start, goal = np.array(problem.start), np.array(problem.goal)
    way = float(np.hypot(*(goal - start)[:2]))
    along = (goal - start)[:2] / way
    across = np.array([-along[1], along[0]])
    stations = start[:2] + np.linspace(0.0, 1.0, CONTROL + 2)[1:-1, None] * (goal - start)[:2]
    aside = max(3_000.0, 0.75 * way)
    bottom, top = box_of(problem)[2]
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, CONTROL), np.ones(3)])
    basis = BSpline.design_matrix(np.linspace(0.0, 1.0, SPLINE_SAMPLES), knots, 3).toarray()

    def decode(x: Floats) -> Floats:
        middle = np.column_stack(
            [stations + (2.0 * x[:CONTROL, None] - 1.0) * aside * across, bottom + x[CONTROL:] * (top - bottom)]
        )
        points = np.asarray(basis @ np.vstack([start, middle, goal]))
        points[0], points[-1] = start, goal
        return points

    def cost(x: Floats) -> float:
        points = decode(x)
        depth = _depths(problem, points)
        return (
            problem.cost_through(points) + VIOLATION_WEIGHT * depth + (100.0 * VIOLATION_WEIGHT if depth > 0.0 else 0.0)
        )

    return decode, cost


def _depths(problem: Problem, points: Floats) -> float:
    """The sum of metres by which samples break the limits: too low, too high, inside zones, too steep."""
    surface, limits = problem.airspace.surface, problem.limits
    e, n, z = points.T
    ground = surface.ground_at(e, n)
    known = ~np.isnan(ground)
    total = 1000.0 * float(np.count_nonzero(~known))
    # The ends are at the lowest legal altitude, so spare height is required only away from them.
    spare = np.full(len(points), SAMPLE_SPARE_M)
    spare[:4] = spare[-4:] = 0.0
    low = surface.top_at(e, n) + limits.min_agl_m + limits.altitude_error_m + spare - z
    total += float(np.where(known, np.maximum(low, 0.0), 0.0).sum())
    if limits.max_amsl_m is not None:
        total += float(np.maximum(z + limits.altitude_error_m - limits.max_amsl_m, 0.0).sum())
    if limits.max_agl_m is not None:
        high = z + limits.altitude_error_m + spare - ground - limits.max_agl_m
        total += float(np.where(known, np.maximum(high, 0.0), 0.0).sum())
    run, rise = np.hypot(*np.diff(points[:, :2], axis=0).T), np.diff(z)
    total += float(np.maximum(rise - SAMPLE_SPARE_SLOPE * limits.max_climb_slope * run, 0.0).sum())
    total += float(np.maximum(-rise - SAMPLE_SPARE_SLOPE * limits.max_descent_slope * run, 0.0).sum())
    reach = (limits.horizontal_clearance_m + limits.track_error_m) * problem.airspace.scale + SAMPLE_SPARE_M
    for zone in problem.airspace.zones:
        assert isinstance(zone.shape, Circle)
        c = zone.shape
        inside = c.radius_m + reach - np.hypot(e - c.east_m, n - c.north_m)
        if not (inside > 0.0).any():
            continue
        over = z + limits.altitude_error_m - _amsl(zone.floor, ground, -math.inf)
        under = _amsl(zone.ceiling, ground, math.inf) - (z - limits.altitude_error_m)
        total += float(np.maximum(np.minimum(np.minimum(inside, over), under), 0.0).sum())
    return total


def _amsl(level: Level | None, ground: Floats, without: float) -> Floats:
    if level is None:
        return np.full(ground.shape, without)
    return np.asarray(
        np.nan_to_num(ground) + level.value_m if level.datum == "agl" else np.full(ground.shape, level.value_m)
    )


def minimised(
    cost: Callable[[Floats], Floats], dim: int, name: str, evaluations: int, seed: int
) -> tuple[Floats, Floats]:
    """Run mealpy's swarm ``name`` (of `BASELINES`) on a batch cost over the unit box, for exactly ``evaluations``.

    Returns the best numbers (dim,), and the least cost (n + 1,) after none to n evaluations, at first infinite. Raises
    InputError if mealpy is missing.
    """
    mealpy = rival_module("mealpy")
    best, least = np.full(dim, 0.5), [math.inf]

    class Spent(Exception):
        pass

    def one(x: Floats) -> float:
        nonlocal best
        if len(least) > evaluations:
            raise Spent
        value = float(cost(np.clip(np.asarray(x, dtype=np.float64), 0.0, 1.0)[None])[0])
        if value < least[-1]:
            best = np.clip(x, 0.0, 1.0)
        least.append(min(value, least[-1]))
        return value

    # Its L-SHADE draws from numpy's global generator, and no swarm takes fewer evaluations than members a round.
    np.random.seed(seed)  # noqa: NPY002
    epochs = evaluations // SWARM_MEMBERS + 1
    model = getattr(getattr(mealpy, name), BASELINES[name])(epoch=epochs, pop_size=SWARM_MEMBERS)
    bounds = mealpy.FloatVar(lb=[0.0] * dim, ub=[1.0] * dim)
    with contextlib.suppress(Spent):
        model.solve({"bounds": bounds, "minmax": "min", "obj_func": one, "log_to": None}, seed=seed)
    return best, np.array(least)
