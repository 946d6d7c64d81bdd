"""Runs in MetaEvoBox's own environment: its UAV problems and its optimisers, for `gcsplan.research.bench.metabox`.

A request is a line of JSON on standard input; the matrix of `cost` and `judge` follows it as rows of doubles. The
answer is a line of JSON on the real standard output, and what MetaEvoBox prints goes to standard error. Imports nothing
of gcsplan, which is not installed there.

MetaEvoBox's cost of one point takes 10 to 20 ms, most of it in loops over threats and legs. The searches run on
`UavInstance.func`, the same formula over whole arrays. Both are compared when an instance is loaded, and every reported
cost is computed once more by MetaEvoBox's own code.
"""

from __future__ import annotations

import json
import os
import pickle
import random
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import version
from types import SimpleNamespace
from typing import Any, BinaryIO

WAY_POINTS = 10  # MetaEvoBox: way points of a path, three numbers each
COLLISION_PENALTY = 1e4  # MetaEvoBox: cost of a collision
LOGS = 50  # MetaEvoBox: records of a run, which its optimisers insist on
PACKAGES = ("metaevobox", "torch", "numpy", "scipy", "deap", "cma", "pypop7")

POINTS_COMPARED, COSTS_NEAR = 64, 1e-9  # points at which both costs are compared, and the largest relative difference

problems: list[Any] = []


def make(file: str, threats: int, seed: int) -> dict[str, Any]:
    """Generate an instance as MetaEvoBox does, and keep it in ``file`` in the format of its published ones."""
    import numpy as np

    rng = np.random.RandomState(seed)
    generate = import_module("metaevobox.environment.problem.SOO.UAV.utils").createmodel
    # Sizes and roughness as in its UAV_Dataset.
    model = generate(map_size=900, r=rng.rand() * 600 - 200, rr=rng.rand() * 800 + 100, num_threats=threats, rng=rng)
    with open(file, "wb") as out:
        pickle.dump([model], out)
    return {}


def load(files: list[str]) -> dict[str, Any]:
    """Load the instances in ``files``, one in each."""
    dataset = import_module("metaevobox.environment.problem.SOO.UAV.uav_dataset").UAV_Dataset
    given = {"num": 1, "dv": WAY_POINTS, "j_pen": COLLISION_PENALTY, "difficulty": "all"}
    problems[:] = [UavInstance(dataset.get_datasets(path=file, **given)[0].data[0]) for file in files]
    return {"dims": [problem.dim for problem in problems], "threats": [problem.threats for problem in problems]}


def cost(instance: int, points: Any) -> dict[str, Any]:
    """Costs of ``points`` (n, dim) of the unit box."""
    problem = problems[instance]
    return {"costs": problem.func(problem.lb + points * problem.span).tolist()}


def judge(instance: int, points: Any) -> dict[str, Any]:
    """Costs of ``points`` of the unit box by MetaEvoBox's own code, and which have no penalty in them.

    Without a penalty no threat is hit and no sample is under ground.
    """
    problem = problems[instance]
    model = problem.theirs.terrain_model
    costs = problem.theirs.func(problem.lb + points * problem.span)
    model["J_pen"] = 0.0
    try:
        without = problem.theirs.func(problem.lb + points * problem.span)
    finally:
        model["J_pen"] = COLLISION_PENALTY
    return {"costs": costs.tolist(), "clear": (costs == without).tolist()}


def solve(instance: int, optimiser: str, seed: int, evaluations: int) -> dict[str, Any]:
    """One run of MetaEvoBox's ``optimiser``: the least cost among its first ``evaluations`` points in the box.

    Cost and number of points are counted here, because some of its optimisers report the last population's best, and
    most end after the budget. A point out of the box costs an evaluation and is no solution.
    """
    import numpy as np

    problem, theirs = problems[instance], problems[instance].theirs
    theirs.reset()
    run: dict[str, Any] = {"cost": None, "point": None, "evaluations": 0, "outside": 0, "failed": ""}

    def counted(points: Any) -> Any:
        costs = problem.func(points)
        left = max(0, evaluations - run["evaluations"])
        unit = (np.asarray(points, dtype=float)[:left] - problem.lb) / problem.span
        inside = ((unit >= -1e-9) & (unit <= 1.0 + 1e-9)).all(axis=1)
        run["evaluations"] += len(unit)
        run["outside"] += int(np.sum(~inside))
        for i in np.flatnonzero(inside):
            if run["cost"] is None or costs[i] < run["cost"]:
                run["cost"], run["point"] = float(costs[i]), np.clip(unit[i], 0.0, 1.0).tolist()
        return costs

    config = SimpleNamespace(
        maxFEs=evaluations, n_logpoint=LOGS, log_interval=max(1, evaluations // LOGS), full_meta_data=False,
        device="cpu", dim=problem.dim,
    )  # fmt: skip
    rule = getattr(import_module("metaevobox.baseline.bbo"), optimiser)(config)
    rule.seed(seed)
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 - some of its optimisers draw from there
    import_module("torch").manual_seed(seed)
    theirs.func = counted
    try:
        rule.run_episode(theirs)
    except Exception as error:  # what one optimiser found until it failed counts; the others go on
        run["failed"] = f"{type(error).__name__}: {error}"
    finally:
        del theirs.func
    if run["point"] is None:
        return run | {"clear": False}
    judged = judge(instance, np.array([run["point"]]))
    return run | {"cost": judged["costs"][0], "clear": judged["clear"][0]}


class UavInstance:
    """One instance: ``theirs``, and ``func`` with the same costs. Raises ValueError if they differ."""

    def __init__(self, theirs: Any) -> None:
        import numpy as np

        self.theirs, self.model = theirs, theirs.terrain_model
        self.lb, self.span, self.dim = theirs.lb, theirs.ub - theirs.lb, int(theirs.dim)
        self.threats = len(self.model["threats"])
        points = self.lb + np.random.default_rng(1).random((POINTS_COMPARED, self.dim)) * self.span
        points[: POINTS_COMPARED // 4, ::9] = 0.0  # some legs of no length
        ours, expected = self.func(points), theirs.func(points)
        worst = float(np.max(np.abs(ours - expected) / expected))
        if worst > COSTS_NEAR:
            raise ValueError(f"the cost of MetaEvoBox is not the known one: they differ by {worst:.1e}")

    def func(self, points: Any) -> Any:
        """Costs (n,) of ``points`` (n, dim) in MetaEvoBox's coordinates."""
        import numpy as np

        model, points = self.model, np.asarray(points, dtype=float)
        x, y, z = self.theirs.spherical_to_cart_vec(points)
        ends = [np.broadcast_to(np.ravel(model[end])[:, None, None], (3, len(x), 1)) for end in ("start", "end")]
        path = np.concatenate([ends[0], np.stack([x, y, z]), ends[1]], axis=2)  # (3, n, nodes)
        column, row = (np.round(path[axis]).astype(int) - 1 for axis in (0, 1))
        path[2] += model["H"][row, column]
        legs = np.diff(path, axis=2)
        flat = np.hypot(legs[0], legs[1])
        height = np.abs(z - (model["zmax"] + model["zmin"]) / 2.0).sum(axis=1)
        length = np.sqrt((legs**2).sum(axis=0)).sum(axis=1)
        costs = 5.0 * length + self._threats(path[:2], legs[:2], flat) + 10.0 * height
        costs += self._turns(legs) + np.where(self._above(path), 0.0, model["J_pen"])
        return costs

    def _threats(self, path: Any, legs: Any, flat: Any) -> Any:
        """J2: of legs near threats and through them."""
        import numpy as np

        model = self.model
        at = path[..., None] - model["threats"][:, :2].T[:, None, None, :]  # (2, n, nodes, threats)
        far = np.hypot(at[0], at[1])
        before, after = at[:, :, :-1], at[:, :, 1:]
        along = -(before * legs[..., None]).sum(axis=0), (after * legs[..., None]).sum(axis=0)
        across = np.abs(legs[0][..., None] * before[1] - legs[1][..., None] * before[0])
        with np.errstate(divide="ignore", invalid="ignore"):
            beside = across / flat[..., None]
        near = np.minimum(far[:, :-1], far[:, 1:])
        near = np.where((flat[..., None] != 0.0) & (along[0] >= 0.0) & (along[1] >= 0.0), beside, near)
        hit = model["threats"][:, 3] + model["drone_size"]
        charged = np.where(near < hit, model["J_pen"], np.maximum(hit + model["danger_dist"] - near, 0.0))
        return charged.sum(axis=(1, 2))

    def _turns(self, legs: Any) -> Any:
        """J4: turns, and changes of the climb angle, of more than 45 degrees.

        Without a length of its own, the first of two legs has the direction of one before it, the second of one after.
        """
        import numpy as np

        first, second = legs[:2, :, :-1].copy(), legs[:2, :, 1:].copy()
        count = first.shape[2]
        for plane, order, beside in ((first, range(1, count), -1), (second, range(count - 2, -1, -1), 1)):
            for i in order:
                still = np.flatnonzero((plane[:, :, i] == 0.0).all(axis=0))
                plane[:, still, i] = plane[:, still, i + beside]
        cross = first[0] * second[1] - first[1] * second[0]
        turn = np.degrees(np.arctan2(np.abs(cross), (first * second).sum(axis=0)))
        rise = legs[2, :, 1:], legs[2, :, :-1]
        after, before = (np.degrees(np.arctan2(z, np.hypot(*p))) for z, p in zip(rise, (second, first), strict=True))
        climb = np.abs(after - before)
        return (np.where(turn > 45.0, turn, 0.0) + np.where(climb > 45.0, climb, 0.0)).sum(axis=1)

    def _above(self, path: Any) -> Any:
        """Whether twelve samples of each leg are above the terrain; beyond the last node nothing is."""
        import numpy as np

        h = self.model["H"]
        x, y, z = np.linspace(path[:, :, :-1], path[:, :, 1:], 12, axis=3)
        i, j = (np.clip(v.astype(int), 0, n - 2) for v, n in ((x, h.shape[1]), (y, h.shape[0])))
        a, b = x - i, y - j
        ground = (h[j, i] * (1 - a) + h[j, i + 1] * a) * (1 - b) + (h[j + 1, i] * (1 - a) + h[j + 1, i + 1] * a) * b
        known = (x <= h.shape[1] - 1) & (y <= h.shape[0] - 1)
        return (known & (z > ground)).all(axis=(1, 2))


def _ready() -> dict[str, Any]:
    """Versions of the packages, or why MetaEvoBox cannot be imported."""
    try:
        import_module("metaevobox.baseline.bbo")
        # cma draws its seed from the clock unless its options leave numpy's generator alone.
        bound: Any = import_module("metaevobox.baseline.bbo.cmaes")
        bound.cma = _Cma(import_module("cma").CMAEvolutionStrategy)
    except Exception as error:  # any fault of a strange environment is reported, not raised
        return {"error": f"{type(error).__name__}: {error}"}
    return {"versions": {name: version(name) for name in PACKAGES}}


class _Cma:
    """The module cma as MetaEvoBox uses it, with the seed left alone."""

    def __init__(self, strategy: Any) -> None:
        self._strategy = strategy
        self.evolution_strategy = import_module("cma").evolution_strategy

    def CMAEvolutionStrategy(self, x: Any, sigma: float, options: dict[str, Any]) -> Any:
        """An evolution strategy that draws from numpy's generator as it stands, and prints nothing."""
        return self._strategy(x, sigma, options | {"seed": float("nan"), "verbose": -9})


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer requests until there are no more."""
    import numpy as np

    def answer(reply: dict[str, Any]) -> None:
        answers.write(json.dumps(reply).encode() + b"\n")
        answers.flush()

    known: dict[str, Callable[..., dict[str, Any]]] = {
        "make": make, "load": load, "cost": cost, "judge": judge, "solve": solve,
    }  # fmt: skip
    answer(_ready())
    for line in iter(requests.readline, b""):
        request = json.loads(line)
        what, shape = request.pop("what"), request.pop("shape", None)
        if shape is not None:
            request["points"] = np.frombuffer(requests.read(8 * shape[0] * shape[1])).reshape(shape)
        try:
            answer(known[what](**request))
        except Exception as error:  # the other process decides on a fault
            answer({"error": f"{type(error).__name__}: {error}"})


if __name__ == "__main__":
    real = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    serve(sys.stdin.buffer, real)
