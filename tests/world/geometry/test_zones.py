"""Zones: their boxes, and whether a level follows the ground."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone

TRIANGLE = Polygon(np.array([[3.0, -1.0], [9.0, 2.0], [4.0, 7.0]]))


def test_a_zone_has_the_box_of_its_shape() -> None:
    assert Zone("disc", Circle(10.0, -20.0, 5.0)).bounds == (5.0, -25.0, 15.0, -15.0)
    assert Zone("triangle", TRIANGLE).bounds == TRIANGLE.bounds == (3.0, -1.0, 9.0, 7.0)


@pytest.mark.parametrize(
    ("floor", "ceiling", "follows"),
    [
        (None, None, False),
        (Level(10.0, "amsl"), Level(90.0, "amsl"), False),
        (Level(10.0, "agl"), None, True),
        (None, Level(90.0, "agl"), True),
    ],
)
def test_a_zone_follows_the_ground_if_a_level_does(floor: Level | None, ceiling: Level | None, follows: bool) -> None:
    assert Zone("zone", TRIANGLE, floor, ceiling).follows_ground is follows


def test_a_level_says_its_datum() -> None:
    assert str(Level(120.0, "agl")) == "120 m AGL"
