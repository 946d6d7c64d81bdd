"""The arcs of a fixed wing's track: tangents, lengths, corners in two parts, against plane geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.mavlink.build.fixed_wing import (
    FARTHEST_ACCEPTED_M,
    LEAST_ACCEPTED_M,
    accepted_m,
    flown_m,
    parted,
    pitch_deg,
    tangents_m,
    thinned,
    turns_of,
)
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits


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


@pytest.mark.parametrize("turn_deg", [120.0, 150.0, 170.0])
def test_a_corner_too_large_for_one_byte_is_parted_on_the_same_arc(turn_deg: float) -> None:
    radius_m, points = 200.0, corner(turn_deg, 5000.0)
    new = parted(points, radius_m)
    assert len(new) > 3
    assert tangents_m(new, radius_m).max() <= FARTHEST_ACCEPTED_M
    assert flown_m(new, radius_m).sum() == pytest.approx(flown_m(points, radius_m).sum(), rel=1e-9)
    assert np.degrees(turns_of(new)).sum() == pytest.approx(turn_deg)
    # The middle of each part's arc lies on the old circle, whose centre is off the corner by r / cos(turn / 2).
    away, toward = radius_m / math.cos(math.radians(turn_deg) / 2.0), math.radians(90.0 + turn_deg / 2.0)
    centre = away * np.array([math.cos(toward), math.sin(toward)])
    for k, turn in enumerate(turns_of(new), start=1):
        assert math.dist(new[k, :2], centre) * math.cos(turn / 2.0) == pytest.approx(radius_m, rel=1e-6)


def test_a_small_corner_is_not_parted_and_a_slight_one_beside_another_is_dropped() -> None:
    points = corner(45.0)
    assert parted(points, 80.0) is points
    beside = np.array([[0.0, 0.0, 0.0], [500.0, 0.0, 0.0], [501.0, 0.001, 0.0], [800.0, 300.0, 0.0]])
    assert len(thinned(beside, 80.0)) == 3
    assert thinned(points, 80.0) is points


@pytest.mark.parametrize(
    ("tangent_m", "run_m", "accepted"),
    [(33.1, 500.0, 34), (33.0, 500.0, 33), (33.1, 33.4, 33), (0.0, 500.0, LEAST_ACCEPTED_M),
     (900.0, 5000.0, FARTHEST_ACCEPTED_M)],
)  # fmt: skip
def test_the_acceptance_radius_is_whole_metres_and_never_above_its_leg(
    tangent_m: float, run_m: float, accepted: float
) -> None:
    assert accepted_m(tangent_m, run_m) == accepted


@pytest.mark.parametrize(("climb_deg", "pitch"), [(15.0, 15), (14.99, 14), (8.0, 8)])
def test_the_pitch_of_the_take_off_is_whole_degrees_below_the_limit(climb_deg: float, pitch: int) -> None:
    assert pitch_deg(Vehicle("w", 1, Autopilot.ARDUPLANE, Limits(30.0, max_climb_deg=climb_deg))) == pitch
