"""Climb-outs and approaches over flat ground and beside a hill, and a path that is joined to them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.planners.problem import Problem
from gcsplan.planners.turns.ends import (
    LONGER_M,
    SHARPEST_RAD,
    FlightEnd,
    RequiredEnd,
    around_m,
    circling_ends,
    column_clear,
    cut_off_m,
    joined,
    pairs,
    problem_between,
    straight_ends,
    unfitting_legs,
)
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support.worlds import surface

RADIUS_M, SLOPE = 80.0, math.tan(math.radians(10.0))
LIMITS = Limits(30.0, track_error_m=5.0, altitude_error_m=5.0, max_climb_deg=10.0, max_descent_deg=10.0)
SHARP = np.array([[0.0, 0.0, 150.0], [4000.0, 0.0, 150.0]])
GROUND = np.array([0.0, 0.0, 100.0])


@dataclass(frozen=True)
class Rules:
    """Slants that are clear on one side of north and south, and circles that nothing stands in."""

    eastwards: bool = True
    missing_m: float = 0.0
    reached_m: float = 5.0

    def slant_clear(self, ground: Floats, top: Floats) -> bool:
        return bool(top[0] > ground[0]) == self.eastwards

    def circle_growth(self, amsl_m: float) -> float:
        return 1.1

    def circle_missing_m(self, middle: Floats, reach_m: float) -> float:
        return self.missing_m


def problem(*zones: Zone, high: bool = False) -> Problem:
    def ridge(east: Floats, north: Floats) -> Floats:
        return np.asarray(100.0 + 200.0 * (np.abs(east - 1500.0) < 150.0))

    air = Airspace(surface(ridge if high else 100.0, half_m=6000.0), zones, scale=1.0)
    return Problem(air, LIMITS, (0.0, 0.0, 150.0), (4000.0, 0.0, 150.0), turn_radius_m=RADIUS_M)


def required(agl_m: float | None = None, heading: float | None = None, rules: Rules = Rules()) -> RequiredEnd:
    return RequiredEnd(GROUND, SLOPE, agl_m, heading, rules)


def test_an_end_climbs_towards_the_path_to_where_min_agl_is_met_or_as_high_as_asked() -> None:
    least, asked = (next(straight_ends(problem(), required(agl_m), SHARP)) for agl_m in (None, 80.0))
    assert least.heading == asked.heading == 0.0
    assert least.top[2] == pytest.approx(135.0, abs=0.3)  # with the altitude error
    assert asked.top[2] == pytest.approx(180.0, abs=0.1)
    for end in (least, asked):
        assert (end.top[2] - 100.0) / end.top[0] == pytest.approx(SLOPE, rel=1e-3)
        assert end.chain[:, 2].tolist() == [end.top[2]] * len(end.chain)
        assert end.chain[0, 0] - end.top[0] == pytest.approx(RADIUS_M * math.tan(0.5 * SHARPEST_RAD) + 20.0)
        assert end.leaves is end.top


@pytest.mark.slow
def test_the_nearest_legal_headings_come_first_and_a_wanted_one_is_the_only_one() -> None:
    headings = [round(math.degrees(end.heading)) for end in straight_ends(problem(), required(), SHARP)]
    assert headings[:5] == [0, 15, -15, 30, -30]
    assert all(abs(h) <= 90 for h in headings), "the rules shut all others"
    [only] = straight_ends(problem(), required(heading=0.3), SHARP)
    assert only.heading == 0.3
    assert list(straight_ends(problem(), required(heading=math.pi), SHARP)) == []


def test_an_end_away_from_the_path_turns_back_in_steps_that_have_room() -> None:
    end = next(straight_ends(problem(), required(heading=math.radians(80.0)), SHARP))
    legs = np.diff(np.vstack([end.top, end.chain])[:, :2], axis=0)
    turns = np.diff(np.arctan2(legs[:, 1], legs[:, 0]))
    assert len(turns) == 1
    assert turns[0] == pytest.approx(-SHARPEST_RAD)
    assert not len(unfitting_legs(np.vstack([end.chain, SHARP[-1]]), end, None, RADIUS_M))


def test_an_end_is_lengthened_where_a_zone_is_in_the_way_of_its_first_turn() -> None:
    plain = next(straight_ends(problem(), required(heading=0.0), SHARP))
    zone = Zone("mast", Circle(float(plain.chain[0, 0]), 0.0, 3.0))
    past = next(straight_ends(problem(zone), required(heading=0.0), SHARP))  # the rules let a slant through
    assert past.top[0] > plain.chain[0, 0] + 3.0
    low = next(straight_ends(problem(high=True), required(agl_m=225.0, heading=0.0), SHARP))
    assert low.top[2] >= 335.0, "it goes on until it is as high as the ridge asks"
    assert low.top[0] > plain.top[0] + LONGER_M


def test_circles_climb_beside_the_climb_out_to_where_their_first_leg_is_legal() -> None:
    found = list(islice(circling_ends(problem(), required(agl_m=200.0, heading=0.0), SHARP), 2))
    left, right = found
    assert (left.circle_m, right.circle_m) == (-around_m(problem()), around_m(problem()))
    for end in found:
        assert end.circle is not None
        assert end.leaves is end.circle
        assert math.dist(end.circle[:2], end.top[:2]) == pytest.approx(RADIUS_M)
        assert end.circle[2] == pytest.approx(300.0 + Rules().reached_m, abs=0.02)
    shut = required(agl_m=200.0, heading=0.0, rules=Rules(missing_m=1.0))
    assert list(circling_ends(problem(), shut, SHARP)) == []


def test_neither_end_stays_the_same_while_all_others_are_tried() -> None:
    found = [f"{start}{goal}" for start, goal in pairs(iter(("s0", "s1", "s2")), iter(("g0", "g1")))]
    assert found == ["s0g0", "s0g1", "s1g0", "s1g1", "s2g0", "s2g1"]
    assert list(pairs(iter(()), iter(("g0",)))) == []


def both() -> tuple[FlightEnd, FlightEnd]:
    start = next(straight_ends(problem(), required(), SHARP))
    away = RequiredEnd(np.array([4000.0, 0.0, 100.0]), SLOPE, None, None, Rules(eastwards=False))
    return start, next(straight_ends(problem(), away, SHARP[::-1]))


def test_what_the_planner_finds_between_both_ends_is_joined_to_them() -> None:
    start, goal = both()
    inner = problem_between(problem(), start, goal)
    assert (inner.start, inner.goal) == (tuple(start.chain[-1]), tuple(goal.chain[-1]))
    assert problem_between(problem(), start, None).goal == problem().goal
    middle = np.array([inner.start, (2000.0, 400.0, 140.0), inner.goal])
    points = joined(problem(), middle, start, goal)
    assert points[0].tolist() == pytest.approx(start.chain[0].tolist())
    assert points[-1].tolist() == pytest.approx(goal.top.tolist())
    assert (2000.0, 400.0, 140.0) in [tuple(p) for p in points.tolist()]


def test_a_joint_that_arcs_make_too_steep_is_lowered() -> None:
    start, goal = both()
    inner = problem_between(problem(), start, goal)
    steep = np.array([inner.start, (float(inner.start[0]) + 100.0, 0.0, 170.0), inner.goal])
    points = joined(problem(), steep, start, goal)
    slopes = np.diff(points[:, 2]) / np.hypot(*np.diff(points[:, :2], axis=0).T)
    assert slopes.max() <= LIMITS.max_climb_slope
    assert points[1, 2] < 170.0


def test_legs_too_short_for_their_arcs_are_named_and_cut_corners_bounded() -> None:
    start, _ = both()
    top = start.top
    corner = np.array([[top[0] + 300.0, 0.0, top[2]], [top[0] + 300.0, 60.0, top[2]], [top[0] + 900.0, 60.0, top[2]]])
    assert unfitting_legs(corner, start, None, RADIUS_M).tolist() == [1]
    assert unfitting_legs(corner, start, None, 25.0).tolist() == []
    straight = np.array([[top[0] + 300.0, 0.0, top[2]], [top[0] + 900.0, 0.0, top[2]]])
    assert cut_off_m(straight, start, None, RADIUS_M) == pytest.approx(0.0, abs=1e-9)
    aside = np.array([[top[0], 900.0, top[2]], [top[0], 1800.0, top[2]]])
    tangent = RADIUS_M  # of a right angle
    assert cut_off_m(aside, start, None, RADIUS_M) == pytest.approx(2.0 * (tangent - RADIUS_M * math.pi / 4.0))


def test_a_column_is_clear_beside_a_zone_and_not_within_reach_of_it() -> None:
    zone = Zone("mast", Circle(0.0, 100.0, 50.0))
    air = problem(zone).airspace
    low, high = np.array([0.0, 0.0, 150.0]), np.array([0.0, 0.0, 200.0])
    assert column_clear(low, high, 40.0, LIMITS, air)
    assert not column_clear(low, high, 46.0, LIMITS, air)
