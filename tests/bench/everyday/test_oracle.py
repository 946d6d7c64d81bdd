"""The visibility graph, against lengths by arithmetic."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from gcsplan.bench.everyday.oracle import EnclosedPlace, VisibilityGraph
from gcsplan.world.geometry.zones import Circle, Polygon, Zone


def disc(east: float, north: float, radius: float) -> Zone:
    return Zone("disc", Circle(east, north, radius))


def box(west: float, south: float, east: float, north: float) -> Zone:
    return Zone("box", Polygon(np.array([[west, south], [east, south], [east, north], [west, north]])))


def around_disc(distance: float, radius: float) -> float:
    """Two tangents and the arc between, the disc in the middle of the way."""
    half = 0.5 * distance
    tangent = math.sqrt(half**2 - radius**2)
    return 2.0 * (tangent + radius * (math.asin(radius / half)))


@pytest.mark.parametrize("radius", [10.0, 100.0, 400.0])
def test_oracle_goes_round_a_disc_by_tangents_and_arc(radius: float) -> None:
    found = VisibilityGraph.of([disc(0.0, 0.0, radius)], 0.0).shortest([(-500.0, 0.0), (500.0, 0.0)])
    assert found == pytest.approx(around_disc(1000.0, radius), rel=2e-4)
    assert found <= around_disc(1000.0, radius) + 1e-3


def test_oracle_goes_round_a_wall_at_its_nearer_end_and_its_reach() -> None:
    wall = box(-5.0, -300.0, 5.0, 100.0)
    bare = VisibilityGraph.of([wall], 0.0).shortest([(-500.0, 0.0), (500.0, 0.0)])
    assert bare == pytest.approx(2.0 * math.hypot(495.0, 100.0) + 10.0, abs=1e-3)
    assert VisibilityGraph.of([wall], 33.0).shortest([(-500.0, 0.0), (500.0, 0.0)]) > bare + 5.0


def test_oracle_leaves_a_c_shaped_zone_by_its_mouth() -> None:
    c = np.array([[-50, -50], [50, -50], [50, 50], [-50, 50], [-50, 40], [40, 40], [40, -40], [-50, -40]], float)
    zone = Zone("c", Polygon(c))
    found = VisibilityGraph.of([zone], 0.0).shortest([(0.0, 0.0), (200.0, 0.0)])
    corners = [(0, 0), (-50, 40), (-50, 50), (50, 50), (200, 0)]
    assert found == pytest.approx(sum(math.dist(a, b) for a, b in itertools.pairwise(corners)), abs=1e-2)


def test_oracle_says_that_a_place_is_enclosed() -> None:
    walls = [box(-50, -50, 50, -40), box(-50, 40, 50, 50), box(-50, -50, -40, 50), box(40, -50, 50, 50)]
    with pytest.raises(EnclosedPlace):
        VisibilityGraph.of(walls, 0.0).shortest([(0.0, 0.0), (200.0, 0.0)])
