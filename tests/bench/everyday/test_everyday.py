"""The everyday missions and the visibility graph they are held against."""

from __future__ import annotations

import ast
import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from gcsplan.bench.everyday import missions as everyday_missions
from gcsplan.bench.everyday import oracle as everyday_oracle
from gcsplan.bench.everyday import run as everyday
from gcsplan.bench.everyday.missions import EVERYDAY_KINDS, draw
from gcsplan.bench.everyday.oracle import EnclosedPlace, VisibilityGraph
from gcsplan.world.zones import Circle, Polygon, Zone


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


@pytest.mark.parametrize("kind", EVERYDAY_KINDS)
def test_missions_are_the_same_for_the_same_seed_and_can_be_read(kind: str) -> None:
    number = EVERYDAY_KINDS.index(kind) + len(EVERYDAY_KINDS)
    one = draw(7, number)
    assert one.kind == kind
    assert one.document == draw(7, number).document != draw(8, number).document
    problem = everyday.problem_of(one)
    straight = math.dist(problem.start[:2], problem.goal[:2])
    found = everyday.oracle_m(problem)
    assert (found is None) == (kind in ("peaks", "sample"))
    assert found is None or found >= straight - 1e-6


def test_neither_missions_nor_oracle_know_a_planner() -> None:
    for module in (everyday_missions, everyday_oracle):
        tree = ast.parse(Path(module.__file__ or "").read_text(encoding="utf-8"))
        names = [n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
        assert not [n for n in names if "planners" in n]
