"""Kernels of swarm costs: the machine code computes what its source says, bit for bit, on every processor."""

from __future__ import annotations

import json
import math
import os
import platform
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import llvmlite.binding as llvm
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.native import cache
from gcsplan.native.__main__ import KERNEL_UNITS, kernel_unit
from gcsplan.native.signature import Held
from gcsplan.planners.problem import Problem
from gcsplan.research.swarm import cost_kernels as k
from gcsplan.research.swarm import curve_kernels as ck
from gcsplan.research.swarm import scene_kernels as sk
from gcsplan.research.swarm.compiled import SWARM_UNIT
from gcsplan.research.swarm.encodings import Code
from gcsplan.research.swarm.objectives import OBJECTIVES, Cost
from gcsplan.research.swarm.scene import Scene
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.effort import draws
from tests.support.planner_worlds import ground

ZONES = (
    Zone("tower", Circle(800.0, 700.0, 150.0)),
    Zone("mast", Circle(1200.0, 900.0, 120.0), None, Level(90.0, "agl")),
    Zone("park", Polygon(np.array([[400.0, 900.0], [700.0, 850.0], [560.0, 960.0], [420.0, 1100.0]]))),
)
LIMITS = Limits(min_agl_m=20.0, max_agl_m=150.0, horizontal_clearance_m=10.0, max_climb_deg=20.0)


def hills(east: np.ndarray, north: np.ndarray) -> np.ndarray:
    return 100.0 + 60.0 * np.sin(east / 260.0) * np.cos(north / 310.0)


def cost_of(objective: str, points: int, encoding: str = "box") -> Cost:
    problem = Problem(Airspace(ground(hills), ZONES), LIMITS, (300.0, 400.0, 160.0), (1700.0, 1300.0, 170.0))
    return Cost(problem, Code.of(encoding, Scene.of(problem), points), OBJECTIVES[objective])


def controls_of(cost: Cost, count: int, seed: int = 3) -> np.ndarray:
    return cost.code.controls(np.random.default_rng(seed).random((count, cost.dim)))


def plain_terms(cost: Cost, controls: np.ndarray) -> np.ndarray:
    """Terms computed by the same functions, run by Python."""
    out = np.empty((len(controls), k.TERMS))
    before: Held = cost.held
    with np.errstate(invalid="ignore"):
        k.measure.__wrapped__(controls, *before.arguments, out)  # type: ignore[attr-defined]
    return out


@pytest.mark.parametrize("name", KERNEL_UNITS)
def test_what_is_shipped_was_made_from_the_source_as_it_stands(name: str) -> None:
    unit = kernel_unit(name)
    made_of = json.loads(unit.shipped.read_bytes().partition(b"\n")[0])["sources"]
    assert made_of == unit.digest(), f"run python -m gcsplan.native {name}"


@pytest.mark.parametrize(("objective", "points"), [("ssgwo", 9), ("msfoa", 3), ("ib-abc", 1), ("abo", 2)])
def test_machine_code_gives_what_python_gives(objective: str, points: int) -> None:
    cost = cost_of(objective, points)
    controls = controls_of(cost, 3)
    controls[0, 1] = controls[0, 0]  # no movement, then a climb on the spot
    controls[1, 1] = controls[1, 0] + (0.0, 0.0, 90.0)
    np.testing.assert_allclose(cost.terms(controls), plain_terms(cost, controls), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_no_sum_of_what_is_shipped_may_still_be_reordered_or_fused() -> None:
    """Otherwise the result of a swarm would depend on the processor's instructions."""
    bitcode = cache.read_shipped(SWARM_UNIT.shipped, SWARM_UNIT.digest())
    assert bitcode is not None
    text = str(llvm.parse_bitcode(bitcode))
    assert "<4 x double>" in text
    assert re.search(r"\b(reassoc|nsz|nnan|ninf|arcp|contract|afn|fast) ", text) is None
    assert "fmuladd" not in text
    called = set(re.findall(r"^declare .*?@([\w.]+)\(", text, re.MULTILINE))
    assert {name for name in called if not name.startswith("llvm.")} <= {"sqrt"}


@pytest.mark.slow
def test_two_processes_that_compile_for_themselves_get_the_same_bytes(tmp_path: Path) -> None:
    script = (
        "import hashlib, sys\n"
        "from tests.research.swarm.test_kernels import controls_of, cost_of\n"
        "told = hashlib.sha256()\n"
        "for name in sys.argv[1:]:\n"
        "    cost = cost_of(name, 7)\n"
        "    told.update(cost.terms(controls_of(cost, 40)).tobytes())\n"
        "print(told.hexdigest())\n"
    )
    found = []
    for turn in ("first", "second"):
        folder = tmp_path / turn
        folder.mkdir()
        env = dict(os.environ, NUMBA_CACHE_DIR=str(folder), PYTHONPATH=os.pathsep.join(sys.path))
        done = subprocess.run(
            [sys.executable, "-c", script, "krill", "ssgwo", "ib-abc"],
            capture_output=True,
            text=True,
            timeout=120,
            env=env,
            check=True,
        )
        found.append(done.stdout)
        assert list(folder.glob("gcsplan/swarm-*.code"))
    assert found[0] == found[1] != ""


@pytest.mark.slow
@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="names processors of one family")
@pytest.mark.parametrize("processor", ["x86-64", "haswell"])
def test_an_older_processors_instructions_give_the_same_bytes(
    processor: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Processors with vectors of two or four numbers, with or without fused multiplication."""
    if processor == "haswell" and not llvm.get_host_cpu_features().get("avx2", False):
        pytest.skip("this processor cannot run it")
    cost = cost_of("ib-abc", 7)
    controls = controls_of(cost, 40)
    here = [cost.terms(controls), cost_of("ssgwo", 7).terms(controls)]
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(llvm, "get_host_cpu_name", lambda: processor)
    monkeypatch.setattr(llvm, "get_host_cpu_features", llvm.FeatureMap)
    SWARM_UNIT.forget()
    there = [cost.terms(controls), cost_of("ssgwo", 7).terms(controls)]
    assert list(tmp_path.glob("gcsplan/swarm-*.code"))
    assert [a.tobytes() for a in there] == [a.tobytes() for a in here]


def test_a_path_costs_the_same_alone_and_in_any_company() -> None:
    for name in OBJECTIVES:
        cost = cost_of(name, 6)
        controls = controls_of(cost, 37)
        together = cost.terms(controls)
        assert together.tobytes() == np.vstack([cost.terms(row[None]) for row in controls]).tobytes()
        assert together[::-1].tobytes() == cost.terms(np.ascontiguousarray(controls[::-1])).tobytes()


@settings(max_examples=draws(200))
@given(st.floats(0.0, math.pi), st.floats(-12.0, 12.0))
def test_angles_are_those_of_the_library(turn: float, size: float) -> None:
    across, along = abs(math.sin(turn)) * 10.0**size, math.cos(turn) * 10.0**size
    assert ck.angle(across, along) == pytest.approx(math.atan2(across, along), rel=2e-15, abs=1e-300)


def test_angles_at_the_corners() -> None:
    assert [ck.angle(*p) for p in ((0.0, 0.0), (0.0, 1.0), (0.0, -1.0), (1.0, 0.0))] == [0, 0, math.pi, math.pi / 2]


@settings(max_examples=draws(200))
@given(st.floats(0.0, ck.EXP_MOST))
def test_exponentials_are_those_of_the_library(x: float) -> None:
    assert ck.exponential(x) == pytest.approx(math.exp(x), rel=5e-15)


def test_exponentials_reach_as_far_as_angles_do() -> None:
    assert math.pi <= ck.EXP_MOST


@pytest.mark.parametrize("follow", [1.0, 1.9, 2.1, 3.0, 7.4])
def test_points_are_added_on_long_legs_alone_and_stand_for_the_whole_length(follow: float) -> None:
    leg = np.array([1.0, follow, 0.5, follow, 1.0])
    x = np.concatenate([[0.0], np.cumsum(leg), np.zeros(40)])
    y, z, weight = 2.0 * x, x.copy(), np.zeros(46)
    ck.weigh(leg, weight)
    count = ck.divide(leg, 2.0, x, y, z, weight, np.zeros(5))
    parts = [1 if part <= 2.0 else math.floor(part / 2.0) + 1 for part in leg]
    assert count == 1 + sum(parts)
    order = np.argsort(x[:count], kind="stable")
    steps = np.diff(x[order])
    assert steps.max() <= 2.0
    np.testing.assert_allclose(weight[order], 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps)), atol=1e-12)
    np.testing.assert_allclose(y[:count], 2.0 * x[:count])
    np.testing.assert_array_equal(x[:6], np.concatenate([[0.0], np.cumsum(leg)]))


def test_a_leap_through_a_cylinder_between_two_samples_is_charged() -> None:
    """All points but the last are near the start: a few chords cover the rest, with no sample inside the cylinder."""
    wall = Zone("wall", Circle(1500.0, 1000.0, 30.0))
    problem = Problem(
        Airspace(ground(0.0), (wall,)), Limits(0.0), (100.0, 1000.0, 50.0), (1900.0, 1000.0, 50.0)
    )  # fmt: skip
    cost = Cost(problem, Code.of("box", Scene.of(problem), 30), OBJECTIVES["ssgwo"])
    controls = cost.straight_controls()[None].copy()
    controls[0, 1:-1] = controls[0, 0] + np.linspace(0.0, 5.0, 30)[:, None] * (1.0, 0.0, 0.0)
    samples = cost.curve.samples(controls)[0]
    apart = np.hypot(samples[:, 0] - 1500.0, samples[:, 1] - 1000.0)
    assert apart.min() > 30.0
    assert np.diff(samples[:, 0]).max() > 200.0
    terms = cost.terms(controls)[0]
    assert terms[k.INSIDE] == pytest.approx(60.0, abs=2.0 * cost.code.scene.numbers[sk.SPACING])
    assert cost.of_controls(controls)[0] > 3000.0


@pytest.mark.parametrize(
    "encoding", ["box", "sections", "sections-whole", "polar", "polar-signed", "bspline", "offsets"]
)
def test_no_two_places_of_a_path_that_are_looked_at_are_far_apart(encoding: str) -> None:
    cost = cost_of("krill", 12, encoding)
    for path in cost.curve.samples(controls_of(cost, 30)):
        leg = np.linalg.norm(np.diff(path, axis=0), axis=1)
        step_m = max(cost.code.scene.numbers[sk.SPACING], k.UNEVEN * leg.sum() / len(leg))
        room = [np.zeros(2 * len(path)) for _ in range(4)]
        for i in range(3):
            room[i][: len(path)] = path[:, i]
        ck.weigh(leg, room[3])
        count = ck.divide(leg, step_m, *room, np.zeros(len(leg)))  # raises if the arrays are too small
        assert room[3][:count].sum() == pytest.approx(leg.sum())
        assert count - len(path) <= leg.sum() / step_m


def wrongs() -> list[Callable[[Cost], object]]:
    return [lambda c: c.terms(np.zeros((2, 5))), lambda c: c.terms(controls_of(c, 2).astype(np.float32))]


@pytest.mark.parametrize("wrong", wrongs())
def test_only_the_right_form_reaches_machine_code(wrong: Callable[[Cost], object]) -> None:
    with pytest.raises(TypeError, match="contiguous array of f8 in 3 dimensions"):
        wrong(cost_of("krill", 4))
