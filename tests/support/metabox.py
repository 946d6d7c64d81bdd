"""A package that looks like MetaEvoBox to `gcsplan.research.bench.metabox.worker`, with its cost in plain loops.

`interpreter` makes a folder of such packages, and a program in it that runs Python with them.
"""

from __future__ import annotations

import sys
from pathlib import Path

PACKAGES = ("metaevobox", "torch", "numpy", "scipy", "deap", "cma", "pypop7")

UAV = """
import math, pickle
import numpy as np

class Terrain:
    def __init__(self, model):
        self.terrain_model, self.dim = model, 3 * model["n"]
        self.lb = np.tile([0.0, -math.pi / 4, 0.0], model["n"])
        self.ub = np.tile([12.0, math.pi / 4, math.pi / 2], model["n"])
        self.optimum = None

    def reset(self):
        pass

    def eval(self, x):
        x = np.asarray(x)
        return self.func(x[None])[0] if x.ndim == 1 else self.func(x)

    def spherical_to_cart_vec(self, points):
        m = self.terrain_model
        xyz = np.zeros((3, len(points), m["n"]))
        for p, row in enumerate(points):
            x, y, z = np.ravel(m["start"])
            for i, (r, psi, phi) in enumerate(row.reshape(-1, 3)):
                x += r * math.cos(psi) * math.sin(phi)
                y += r * math.cos(psi) * math.cos(phi)
                z += r * math.sin(psi)
                x, y = min(max(x, m["xmin"]), m["xmax"]), min(max(y, m["ymin"]), m["ymax"])
                z = min(max(z, m["zmin"]), m["zmax"])
                xyz[:, p, i] = x, y, z
        return xyz[0], xyz[1], xyz[2]

    def func(self, points):
        return np.array([self.one(*xyz) for xyz in zip(*self.spherical_to_cart_vec(np.asarray(points)))]) + EXTRA

    def one(self, x, y, z):
        m = self.terrain_model
        h, pen = m["H"], m["J_pen"]
        ends = np.ravel(m["start"]), np.ravel(m["end"])
        path = [ends[0], *zip(x, y, z), ends[1]]
        path = [(a, b, c + h[round(b) - 1, round(a) - 1]) for a, b, c in path]
        total = 5.0 * sum(math.dist(a, b) for a, b in zip(path, path[1:]))
        for e, n, _, radius in m["threats"]:
            for a, b in zip(path, path[1:]):
                gap = self.gap((e, n), a[:2], b[:2])
                near = radius + m["drone_size"]
                total += pen if gap < near else max(0.0, near + m["danger_dist"] - gap)
        total += 10.0 * sum(abs(v - (m["zmax"] + m["zmin"]) / 2) for v in z)
        legs = [(b[0] - a[0], b[1] - a[1], b[2] - a[2]) for a, b in zip(path, path[1:])]
        for i in range(len(legs) - 1):
            a = next((leg for leg in legs[i::-1] if leg[:2] != (0.0, 0.0)), (0.0, 0.0, 0.0))
            b = next((leg for leg in legs[i + 1 :] if leg[:2] != (0.0, 0.0)), (0.0, 0.0, 0.0))
            turn = math.degrees(math.atan2(abs(a[0] * b[1] - a[1] * b[0]), a[0] * b[0] + a[1] * b[1]))
            climb = math.atan2(legs[i + 1][2], math.hypot(*b[:2])) - math.atan2(legs[i][2], math.hypot(*a[:2]))
            climb = abs(math.degrees(climb))
            total += (turn if turn > 45 else 0.0) + (climb if climb > 45 else 0.0)
        clear = all(self.above(a, b, k / 11) for a, b in zip(path, path[1:]) for k in range(12))
        return total + (0.0 if clear else pen)

    def gap(self, p, a, b):
        long = math.dist(a, b)
        t = 0.0 if long == 0 else ((p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])) / long**2
        t = min(1.0, max(0.0, t))
        return math.dist(p, (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])))

    def above(self, a, b, t):
        h = self.terrain_model["H"]
        x, y, z = (p + t * (q - p) for p, q in zip(a, b))
        if x > h.shape[1] - 1 or y > h.shape[0] - 1:
            return False
        i, j = min(int(x), h.shape[1] - 2), min(int(y), h.shape[0] - 2)
        u, v = x - i, y - j
        south = h[j, i] + u * (h[j, i + 1] - h[j, i])
        north = h[j + 1, i] + u * (h[j + 1, i + 1] - h[j + 1, i])
        return z > south + v * (north - south)

class Set:
    def __init__(self, data):
        self.data = data

class UAV_Dataset:
    @staticmethod
    def get_datasets(path, num, dv, j_pen, difficulty):
        with open(path, "rb") as kept:
            models = pickle.load(kept)[:num]
        return Set([Terrain(model | {"n": dv, "J_pen": j_pen}) for model in models]), None
"""

UTILS = """
import numpy as np

def createmodel(map_size, r, rr, num_threats, rng):
    assert map_size == 900 and -200 <= r <= 400 and 100 <= rr <= 900
    threats = np.column_stack([rng.uniform(15, 45, (num_threats, 2)), np.zeros(num_threats), np.full(num_threats, 0.5)])
    column = lambda *v: np.array(v, dtype=float)[:, None]
    return dict(
        drone_size=0.2, danger_dist=1.0, threats=threats, start=column(6, 7, 15), end=column(52, 50, 15), xmin=1.0,
        xmax=60.0, ymin=1.0, ymax=60.0, zmin=10.0, zmax=20.0, H=10.0 * rng.rand(60, 60),
    )
"""

BBO = """
import numpy as np

class Random_search:
    def __init__(self, config):
        self.config = config

    def seed(self, seed):
        self.rng = np.random.RandomState(seed)

    def run_episode(self, problem):
        for _ in range(self.config.maxFEs // 20 + 2):  # too many, as some of the real ones do
            problem.eval(self.rng.uniform(problem.lb, problem.ub, (20, problem.dim)))

class DE(Random_search):  # evaluates points one by one, every second out of the box, and fails in the end
    def run_episode(self, problem):
        print("a word that belongs to no answer")
        for k in range(60):
            x = self.rng.uniform(problem.lb, problem.ub)
            problem.eval(x + (k % 2) * problem.ub)
        raise RuntimeError("no more")
"""


def interpreter(folder: Path, extra: float = 0.0) -> Path:
    """The program; ``extra`` is added to all costs of the package itself."""
    files = {
        "metaevobox/environment/problem/SOO/UAV/uav_dataset.py": f"EXTRA = {extra}\n" + UAV,
        "metaevobox/environment/problem/SOO/UAV/utils.py": UTILS,
        "metaevobox/baseline/bbo/__init__.py": BBO,
        "metaevobox/baseline/bbo/cmaes.py": "",
        "cma.py": "CMAEvolutionStrategy = evolution_strategy = None\n",
        "torch.py": "def manual_seed(seed):\n    pass\n",
        **{f"{name}-9.dist-info/METADATA": f"Name: {name}\nVersion: 9\n" for name in PACKAGES},
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    program = folder / "python"
    start = f"import runpy, sys; sys.path.insert(0, {str(folder)!r}); runpy.run_path(sys.argv[-1], run_name='__main__')"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{start}" "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    return program
