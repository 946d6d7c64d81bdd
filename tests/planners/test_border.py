"""The border of the terrain that was read: what it costs to leave it, by reflection at its sides."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.planners.border import border, exit_cost, goes_on, margin_for, within_m
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface

START, GOAL = (500.0, 600.0, 100.0), (1500.0, 600.0, 100.0)
EVERY, NONE = (True, True, True, True), (False, False, False, False)


def problem(sides: tuple[bool, bool, bool, bool] = EVERY, **more: object) -> Problem:
    """Ground of 2 km by 2 km in cells of 20 m that goes on beyond some of its sides: west, north, east, south."""
    z = np.zeros((101, 101))
    z[50, 50] = 1.0  # not level
    surface = Surface(z, z, GridMap.affine(0.0, 2000.0, 20.0, 20.0), goes_on=sides)
    return Problem(Airspace(surface), Limits(0.0), START, GOAL, **more)  # type: ignore[arg-type]


def test_nothing_is_left_where_no_terrain_goes_on() -> None:
    whole = problem(NONE)
    assert not goes_on(whole)
    assert exit_cost(whole) == within_m(whole) == math.inf


@pytest.mark.parametrize(("side", "more_m"), [(0, 1000.0), (2, 1000.0), (3, None), (1, None)])
def test_the_way_out_and_back_is_the_reflection_at_the_side(side: int, more_m: float | None) -> None:
    found = problem(tuple(k == side for k in range(4)))  # type: ignore[arg-type]
    assert goes_on(found)
    lines, bow_m = border(found)
    at = lines.reshape(-1, 2)
    across = {0: at[:, 0], 2: 2000.0 - at[:, 0], 1: 2000.0 - at[:, 1], 3: at[:, 1]}[side]
    inset_m = float(across.max())
    assert inset_m == pytest.approx(across.min())
    assert 20.0 <= inset_m < 60.0  # a cell, and what is kept from unknown ground
    aside_m = {0: 500.0, 2: 500.0, 1: 1400.0, 3: 600.0}[side] - inset_m
    way_m = 1000.0 + 2.0 * aside_m if more_m is not None else 2.0 * math.hypot(500.0, aside_m)
    assert exit_cost(found) == pytest.approx(way_m, abs=5.0 * bow_m + 1e-3)
    assert exit_cost(found) <= way_m
    assert within_m(found) == pytest.approx(aside_m, abs=1e-6)


def test_energy_counts_the_same_way_in_joules() -> None:
    length = problem()
    energy = replace(length, objective="energy", horizontal_j_per_m=7.0, vertical_j_per_m=11.0)
    assert exit_cost(energy) == pytest.approx(7.0 * exit_cost(length))
    up = replace(energy, goal=(1500.0, 600.0, 150.0))
    assert exit_cost(up) == pytest.approx(exit_cost(energy) + 11.0 * 50.0)


def test_the_margin_holds_every_path_of_its_cost() -> None:
    found = problem()
    margin_m = margin_for(found, 1300.0)
    rng = np.random.default_rng(1)
    for bend in rng.uniform(-1000.0, 3000.0, (2000, 2)):
        if math.dist(START[:2], bend) + math.dist(bend, GOAL[:2]) <= 1300.0:
            away = max(500.0 - bend[0], bend[0] - 1500.0, abs(bend[1] - 600.0))
            assert away <= margin_m
    assert margin_for(found, math.inf) == math.inf
    free = replace(found, objective="energy", horizontal_j_per_m=0.0, vertical_j_per_m=11.0)
    assert margin_for(free, 1e6) == math.inf
