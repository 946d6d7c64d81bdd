"""The papers' scenarios as mission files: they match the papers and our decisions, and each can be flown."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import world_of
from gcsplan.app.plan.problem import make_problem
from gcsplan.errors import InputError, NoMission
from gcsplan.mission_file import MissionFile, load_mission
from gcsplan.mission_file.values.schema import EncodingName, SwarmCost
from gcsplan.planners.problem import Problem
from gcsplan.planners.registry import get
from gcsplan.research.swarm import PAPER
from gcsplan.research.swarm.encodings import ENCODINGS
from gcsplan.research.swarm.objectives import OBJECTIVES
from gcsplan.research.swarm.repair import violations
from gcsplan.world.geometry.zones import Circle
from tests.support.paths import MISSIONS

FOLDER = MISSIONS / "papers"
FILES = sorted(FOLDER.glob("*.yaml"))
NAMES = {
    "krill-mound", "krill-forest", "krill-hills", "ssgwo-table3", "ssgwo-table5", "ssgwo-table7",
    "ssgwo-table3-tall", "ssgwo-table5-tall", "ssgwo-table7-tall", "msfoa-1", "msfoa-2", "msfoa-3", "abo",
    "ib-abc-together", "ib-abc-sequence",
}  # fmt: skip

pytestmark = pytest.mark.xdist_group("paper missions")  # each file is loaded once

_loaded: dict[str, MissionFile] = {}


def mission(name: str) -> MissionFile:
    if name not in _loaded:
        _loaded[name] = load_mission(FOLDER / f"{name}.yaml")
    return _loaded[name]


def problems(name: str) -> list[Problem]:
    source = mission(name)
    world = world_of(source)
    return [
        replace(make_problem(source, r, world, "length", 1)[0], options=source.planner.extras, budget_s=1.0)
        for r in source.vehicles
    ]


def straight(p: Problem) -> float:
    return math.dist(p.start, p.goal)


def test_every_scenario_has_its_file() -> None:
    assert {f.stem for f in FILES} == NAMES


@pytest.mark.first_quick
@pytest.mark.parametrize(
    ("name", "lengths"),
    [
        # From (0, 0, 3), our decision: 152.48 m; the paper's start on the ground would give 153.62 m.
        ("krill-mound", [math.dist((0, 0, 3), (100, 100, 60))]),
        ("krill-hills", [math.dist((0, 0, 3), (100, 100, 60))]),
        ("krill-forest", [math.dist((0, 0, 3), (120, 120, 80))]),
        ("ssgwo-table3", [1131.47]),
        ("ssgwo-table5-tall", [1131.47]),
        ("ssgwo-table7", [1131.47]),
        ("abo", [121.73]),
        ("ib-abc-sequence", [257.58, 340.73, 375.53, 291.55]),
    ],
)
def test_straight_lines_are_the_papers(name: str, lengths: list[float]) -> None:
    # Ends may be a few centimetres higher, because of the margins for rounding on the wire.
    assert [straight(p) for p in problems(name)] == pytest.approx(lengths, abs=0.06)


@pytest.mark.first_quick
@pytest.mark.parametrize(
    ("name", "place", "height"),
    [
        ("krill-mound", (50, 50), 70.0),
        ("krill-forest", (60, 90), 90.0),
        ("krill-hills", (30, 10), None),
        ("msfoa-1", (480, 620), None),
        ("abo", (44.2, 23), None),
        ("ib-abc-together", (75, 135), None),
    ],
)  # fmt: skip
def test_the_ground_is_the_sum_of_the_peaks(name: str, place: tuple[float, float], height: float | None) -> None:
    import yaml

    text = yaml.safe_load((FOLDER / f"{name}.yaml").read_text(encoding="utf-8"))
    total = sum(
        p["height_m"]
        * math.exp(
            -(((place[0] - p["center"][0]) / p["decay_m"][0]) ** 2)
            - ((place[1] - p["center"][1]) / p["decay_m"][1]) ** 2
        )
        for p in text["terrain"]["peaks"]
    )
    assert float(mission(name).surface.ground_at(*place)) == pytest.approx(total, abs=0.03)
    if height is not None:
        assert total == pytest.approx(height, abs=0.1)


def test_cylinders_are_the_tables() -> None:
    low, tall = mission("ssgwo-table5").zones, mission("ssgwo-table5-tall").zones
    assert len(low) == len(tall) == 12
    assert len(mission("ssgwo-table3").zones) == len(mission("ssgwo-table7").zones) == 8
    shapes = [(z.shape.east_m, z.shape.north_m, z.shape.radius_m) for z in low if isinstance(z.shape, Circle)]
    assert (480.0, 400.0, 60.0) in shapes
    assert (620.0, 650.0, 25.0) in shapes
    assert [z.ceiling for z in tall] == [None] * 12
    tops = [z.ceiling.value_m for z in mission("ssgwo-table7").zones if z.ceiling is not None]
    assert tops == [13.5, 11.5, 15.5, 15.0, 14.25, 15.0, 13.5, 15.0]
    # Two cylinders of Table 5 overlap, by 6.1 m.
    overlaps = [
        a.radius_m + b.radius_m - math.dist((a.east_m, a.north_m), (b.east_m, b.north_m))
        for i, z in enumerate(low)
        for y in low[:i]
        if isinstance(a := z.shape, Circle) and isinstance(b := y.shape, Circle)
    ]
    assert sorted(o for o in overlaps if o > 0) == pytest.approx([6.1], abs=0.05)


@pytest.mark.slow
def test_fleets_have_their_order() -> None:
    for n in (1, 2, 3):
        assert [v.vehicle.name for v in mission(f"msfoa-{n}").vehicles] == ["uav1", "uav2", "uav3"]
    asked = mission("ib-abc-sequence").arrival
    assert asked is not None
    assert (asked.mode, asked.interval_s) == ("sequence", 9.0)
    goals = [v.goal[:2] for v in mission("ib-abc-together").vehicles]
    assert {(e - 250, n - 250) for e, n in goals} == {(-20, -20), (-20, 20), (20, -20), (20, 20)}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(NAMES))
def test_every_scenario_is_planned_by_its_own_system_or_refused(name: str) -> None:
    """A short run: any path that is returned passes the exact check."""
    source = mission(name)
    for p in problems(name)[:2]:
        short = replace(p, options={**p.options, "iterations": 20})
        try:
            solution = get(source.planner.name).plan(short)
        except NoMission:
            continue  # a refusal is allowed
        assert violations(p, solution.path.points) == ()
        assert solution.path.length_m >= straight(p) - 1e-6


@pytest.mark.first_quick
@pytest.mark.parametrize("name", ["ssgwo-table3", "ib-abc-sequence"])
def test_the_default_planner_flies_them(name: str) -> None:
    for p in problems(name)[:1]:
        path = get("optimal").plan(p).path
        assert violations(p, path.points) == ()
        assert np.allclose(path.points[[0, -1]], [p.start, p.goal])


def test_a_mission_file_hands_swarm_keys_on_and_refuses_unknown_ones() -> None:
    file = FOLDER / "ssgwo-table3.yaml"
    text = file.read_text(encoding="utf-8").replace(
        "  cost: ssgwo\n  encoding: paper\n", "  cost: abo\n  encoding: bspline\n"
    )
    asked = load_mission(file, text=text).planner
    assert (asked.name, asked.extras["cost"], asked.extras["encoding"]) == ("ssgwo", "abo", "bspline")
    assert asked.extras["parameters"]["east_m"] == 800
    with pytest.raises(InputError, match=r"planner\.cost: must be one of krill, ssgwo, msfoa, abo, ib-abc"):
        load_mission(file, text=text.replace("cost: abo", "cost: beauty"))


def test_the_schema_knows_every_encoding_and_cost() -> None:
    assert get_args(EncodingName) == (PAPER, *ENCODINGS)
    assert get_args(SwarmCost) == tuple(OBJECTIVES)
