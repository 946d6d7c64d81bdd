"""Tracks around the outlines of zones: the bound of one disc is known, and a wall all around proves that none is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.planners.optimal.plane.corridor import SideChoice
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.plane.outline_tracks import OutlineTracks
from gcsplan.planners.optimal.searches.outlines import Outlines
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.planner_worlds import faults, ground
from tests.support.searches import work_of

RADIUS_M, HALF_M = 200.0, 600.0


def crossing(*zones: Zone) -> Problem:
    limits = Limits(10.0, max_amsl_m=120.0)
    return Problem(Airspace(ground(0.0), zones), limits, (400.0, 1000.0, 50.0), (1600.0, 1000.0, 50.0))


def around_disc_m() -> float:
    """The shortest way around a disc in the middle: two tangents and an arc."""
    tangent = math.sqrt(HALF_M**2 - RADIUS_M**2)
    return 2.0 * tangent + RADIUS_M * 2.0 * math.asin(RADIUS_M / HALF_M)


def tracks_of(problem: Problem) -> OutlineTracks:
    return OutlineTracks(Incumbent(problem), 120.0)


def test_the_bound_and_the_path_around_a_disc_are_its_tangents_and_arc() -> None:
    problem = crossing(Zone("disc", Circle(1000.0, 1000.0, RADIUS_M)))
    work = work_of(problem)
    Outlines(work).run()
    incumbent = work.incumbent
    assert incumbent.bound <= around_disc_m() <= incumbent.cost
    assert incumbent.cost == pytest.approx(incumbent.bound, rel=1e-3)
    assert incumbent.best is not None
    assert faults(problem, Path(incumbent.best)) == []


def test_a_zone_that_can_be_flown_over_is_an_obstacle_only_where_a_choice_shuts_it() -> None:
    low = Zone("low", Circle(1000.0, 1000.0, RADIUS_M), None, Level(60.0, "amsl"))
    tracks = tracks_of(crossing(low))
    assert (tracks.over.tolist(), tracks.under.tolist()) == ([True], [False])
    assert not tracks.walls().any()
    yes, no = np.ones(1, np.bool_), np.zeros(1, np.bool_)
    open_track, shut_track = (tracks.terminals(SideChoice(yes, over)) for over in (yes, no))
    assert open_track is not None
    assert shut_track is not None
    assert len(open_track[0]) == 2
    far_m = np.hypot(*(shut_track[0] - 1000.0).T)
    assert far_m.min() == pytest.approx(RADIUS_M, rel=1e-3)
    assert open_track[1].tolist() == [True, True]


def test_a_goal_that_is_walled_in_is_proved_to_be_out_of_reach() -> None:
    sides = [(1400.0, 800.0, 1800.0, 850.0), (1400.0, 1150.0, 1800.0, 1200.0),
             (1400.0, 800.0, 1450.0, 1200.0), (1750.0, 800.0, 1800.0, 1200.0)]  # fmt: skip
    walls = [
        Zone(f"wall {k}", Polygon(np.array([[a, b], [c, b], [c, d], [a, d]]))) for k, (a, b, c, d) in enumerate(sides)
    ]
    tracks = tracks_of(crossing(*walls))
    assert tracks.look() is None
