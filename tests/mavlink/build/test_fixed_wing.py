"""A fixed wing's items: corners in two parts, against plane geometry, acceptance radii and pitch."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.mavlink.build.fixed_wing import (
    FARTHEST_ACCEPTED_M,
    LEAST_ACCEPTED_M,
    accepted_m,
    parted,
    pitch_deg,
)
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.fly_by import flown_m, tangents_m, turns_of
from gcsplan.world.geometry.limits import Limits
from tests.world.geometry.test_fly_by import corner


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


def test_a_small_corner_is_not_parted() -> None:
    points = corner(45.0)
    assert parted(points, 80.0) is points


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
