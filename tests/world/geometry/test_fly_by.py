"""Way points that are flown by: turns, tangents and lengths, against plane geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.world.geometry.fly_by import flown_m, tangents_m, thinned, turns_of


def corner(turn_deg: float, run_m: float = 1000.0) -> np.ndarray:
    turn = math.radians(turn_deg)
    return np.array([[-run_m, 0.0, 50.0], [0.0, 0.0, 60.0], [run_m * math.cos(turn), run_m * math.sin(turn), 80.0]])


@pytest.mark.parametrize("turn_deg", [-120.0, -45.0, 1.0, 30.0, 90.0, 150.0])
def test_a_corner_turns_by_its_angle_on_a_tangent_of_r_times_tan_of_half(turn_deg: float) -> None:
    points, half = corner(turn_deg), math.radians(abs(turn_deg)) / 2.0
    assert np.degrees(turns_of(points)) == pytest.approx([turn_deg])
    assert tangents_m(points, 80.0) == pytest.approx([0.0, 80.0 * math.tan(half), 0.0])


@pytest.mark.parametrize("turn_deg", [30.0, -90.0, 120.0])
def test_what_is_flown_is_the_lines_less_their_tangents_and_the_arc(turn_deg: float) -> None:
    radius_m, turn = 80.0, math.radians(abs(turn_deg))
    whole = 2.0 * (1000.0 - radius_m * math.tan(turn / 2.0)) + radius_m * turn
    flown = flown_m(corner(turn_deg), radius_m)
    assert flown == pytest.approx([whole / 2.0, whole / 2.0])


def test_a_leg_straight_up_turns_nothing() -> None:
    points = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [100.0, 0.0, 50.0], [100.0, 100.0, 50.0]])
    assert turns_of(points).tolist() == [0.0, 0.0]


def test_a_slight_corner_beside_another_is_dropped() -> None:
    points = corner(45.0)
    beside = np.array([[0.0, 0.0, 0.0], [500.0, 0.0, 0.0], [501.0, 0.001, 0.0], [800.0, 300.0, 0.0]])
    assert len(thinned(beside, 80.0)) == 3
    assert thinned(points, 80.0) is points
