"""The altitude profile of a track with arcs: legal along all of it, and bent only where a way point can be."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.track import Obstruction
from gcsplan.planners.turns.arc_path import Outline, outline, through, tight
from gcsplan.planners.turns.profile import Risen, rise, track_of
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support.planner_worlds import ground

RADIUS_M = 200.0
LIMITS = Limits(min_agl_m=50.0, max_climb_deg=15.0)


def hill(east: np.ndarray, north: np.ndarray) -> np.ndarray:
    """300 m high in the middle of the way, 400 m wide."""
    return 300.0 * np.exp(-(((east - 2500.0) / 400.0) ** 2 + ((north - 3000.0) / 400.0) ** 2))


def problem(*zones: Zone) -> Problem:
    return Problem(
        Airspace(ground(hill, size_m=6000.0, step_m=50.0), zones),
        LIMITS,
        (500.0, 3000.0, 100.0),
        (5500.0, 3000.0, 100.0),
    )


def line_of(*contacts: tuple[float, float], sense: float = 1.0) -> Outline:
    """The outline around discs that touch the contacts, from start to goal."""
    ends = np.array([[500.0, 3000.0], [5500.0, 3000.0]])
    count = len(contacts)
    free = np.full(count, np.nan)
    discs = np.array(contacts).reshape(-1, 2)
    return outline(tight(through(ends, RADIUS_M, discs, np.full(count, sense), np.zeros(count, bool), free)))


def require_legal(asked: Problem, found: Risen) -> None:
    legs = Legs.of_path(found.flown, asked.limits)
    assert not asked.airspace.examine(legs, asked.limits).violations
    assert np.allclose(found.flown[[0, -1]], [asked.start, asked.goal])
    assert (np.diff(found.true_m) > 0.0).all()


def test_a_straight_track_rises_over_the_hill_with_few_way_points() -> None:
    asked, line = problem(), line_of()
    found = rise(asked, track_of(asked, line), line)
    assert isinstance(found, Risen)
    require_legal(asked, found)
    assert found.flown[:, 2].max() >= 349.0
    assert 3 <= len(found.way_points) <= 12
    assert found.true_m[-1] == pytest.approx(5000.0)


def test_a_track_around_the_hill_is_longer_and_lower() -> None:
    asked, line = problem(), line_of((2500.0, 4200.0), sense=-1.0)
    found = rise(asked, track_of(asked, line), line)
    assert isinstance(found, Risen)
    require_legal(asked, found)
    assert found.flown[:, 2].max() < 150.0
    assert found.true_m[-1] > 5300.0


def test_a_wall_without_a_top_is_an_obstruction_with_its_place() -> None:
    asked, line = problem(Zone("wall", Circle(1000.0, 3000.0, 100.0))), line_of()
    found = rise(asked, track_of(asked, line), line)
    assert isinstance(found, Obstruction)
    assert 300.0 < found.s0_m < 700.0


def test_a_track_that_shares_its_beginning_takes_that_part_of_the_tube_over() -> None:
    asked = problem()
    first = line_of((1500.0, 3900.0), (3500.0, 3900.0), sense=-1.0)
    other = line_of((1500.0, 3900.0), (3500.0, 4100.0), sense=-1.0)
    anew, taken = track_of(asked, other), track_of(asked, other, (first, track_of(asked, first)))
    assert np.allclose(anew.s_m, taken.s_m)
    found, again = (rise(asked, track, other) for track in (anew, taken))
    assert isinstance(found, Risen)
    assert isinstance(again, Risen)
    assert np.allclose(found.flown, again.flown, atol=0.02)
