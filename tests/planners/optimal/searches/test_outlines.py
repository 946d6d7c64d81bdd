"""Tracks around the outlines of zones: exact bounds, paths, and the proof that there is none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.planners.optimal.searches.outlines import Outlines
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.searches import over_flat, work_of

DISC = Zone("disc", Circle(1000.0, 1000.0, 100.0))


def around_a_disc(radius_m: float, half_m: float) -> float:
    """Two tangents and the arc between them: the shortest way around a disc in the middle of a straight line."""
    return 2.0 * (math.sqrt(half_m**2 - radius_m**2) + radius_m * math.asin(radius_m / half_m))


def test_around_a_disc_the_bound_is_two_tangents_and_an_arc() -> None:
    search = Outlines(work_of(over_flat(DISC)))
    assert search.applies()
    search.run()
    shortest_m = around_a_disc(100.0, 700.0)
    assert search.incumbent.bound <= shortest_m
    assert search.incumbent.bound == pytest.approx(shortest_m, rel=1e-3)
    assert search.incumbent.cost == pytest.approx(shortest_m, rel=5e-3)
    assert search.incumbent.cost >= shortest_m


def test_a_goal_that_is_shut_in_is_proved_to_have_no_path() -> None:
    ring = [Polygon(np.array(corners)) for corners in (
        [(1500.0, 800.0), (1510.0, 800.0), (1510.0, 1200.0), (1500.0, 1200.0)],
        [(1890.0, 800.0), (1900.0, 800.0), (1900.0, 1200.0), (1890.0, 1200.0)],
        [(1500.0, 800.0), (1900.0, 800.0), (1900.0, 810.0), (1500.0, 810.0)],
        [(1500.0, 1190.0), (1900.0, 1190.0), (1900.0, 1200.0), (1500.0, 1200.0)],
    )]  # fmt: skip
    search = Outlines(work_of(over_flat(*[Zone(f"wall {k}", shape) for k, shape in enumerate(ring)])))
    search.run()
    assert search.incumbent.proved_infeasible
    assert search.incumbent.best is None


def test_a_zone_that_is_passed_over_cheaply_gives_no_longer_bound() -> None:
    low = Zone("shed", Circle(1000.0, 1000.0, 100.0), None, Level(60.0, "amsl"))
    search = Outlines(work_of(over_flat(low)))
    search.run()
    assert search.incumbent.bound <= 1401.0
    assert search.incumbent.cost < around_a_disc(100.0, 700.0)


def test_without_zones_there_is_nothing_to_look_at() -> None:
    assert not Outlines(work_of(over_flat())).applies()
