"""The rules of returns: the pieces that each autopilot flies, by hand; and the sweep agrees with single returns."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from gcsplan.check.motion.circles import circle_growth
from gcsplan.check.motion.return_rules import RETURN_RULES, at_home_m, returned
from gcsplan.check.motion.stopping import about_turn_m, braking_distance_m, run_past_m
from gcsplan.check.motion.stretch import Place, Stretch, flat_m
from gcsplan.check.returns.footprint import Target
from gcsplan.check.returns.obstacles import obstacles_of_returns
from gcsplan.check.returns.trace import MissionTrace
from gcsplan.vehicle import Autopilot
from tests.campaigns.returns import in_twin
from tests.oracles.returning import Begin, plane
from tests.support.worlds import vehicle, world

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
HOME: Place = (36.6, -84.3, 300.0)


def away(metres: float, amsl_m: float) -> Place:
    """The place that many metres north of home on the ellipsoid."""
    degrees = metres / flat_m(HOME, (36.601, -84.3, 0.0)) * 0.001
    place = (36.6 + degrees, -84.3, amsl_m)
    assert flat_m(HOME, place) == pytest.approx(metres, rel=1e-5)
    return place


def flies(start: Place, end: Place, **more: Any) -> Stretch:
    return Stretch(5, "rtl", start, end, 10.0, **more)


def spans(pieces: list[Stretch]) -> list[tuple[float, float]]:
    """Lowest and highest altitude of each piece that leads home."""
    return [
        (p.start[2] - p.band_m, p.start[2] + p.band_m)
        for p in pieces
        if p.start[:2] != p.end[:2] and not p.column and p.reach_m == 0.0
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("autopilot", "metres", "amsl_m", "expected"),
    [
        (COPTER, 1000.0, 310.0, [(360.0, 360.0)]),  # outside of the cone, which reaches 60 m at 20 m from home
        (COPTER, 10.0, 310.0, [(330.0, 360.0), (360.0, 360.0)]),  # 10 m from home the cone is 30 m high
        (COPTER, 10.0, 345.0, [(345.0, 360.0), (360.0, 360.0)]),  # in the cone, above its surface
        (COPTER, 10.0, 400.0, [(400.0, 400.0)]),  # it never descends before it is over home
        (PX4, 1000.0, 310.0, [(360.0, 360.0)]),
        (PX4, 50.0, 310.0, [(310.0, 360.0), (360.0, 360.0)]),  # versions differ: any altitude from its own up
        (PX4, 50.0, 400.0, [(400.0, 400.0)]),
        (PLANE, 1000.0, 310.0, [(310.0, 360.0)]),  # climbs on the way
        (PLANE, 1000.0, 400.0, [(360.0, 400.0)]),  # descends on the way
    ],
)
def test_the_altitudes_of_the_way_home(
    autopilot: Autopilot, metres: float, amsl_m: float, expected: list[tuple[float, float]]
) -> None:
    flown, instead = returned(flies, RETURN_RULES[autopilot], away(metres, amsl_m), HOME, 360.0, about_m=8.0)
    for found, want in zip(spans([*instead, *flown]), expected, strict=True):
        assert found == pytest.approx(want, abs=1e-3)


def test_a_copter_ends_on_the_ground_and_a_plane_on_a_circle() -> None:
    down, _ = returned(flies, RETURN_RULES[COPTER], away(500.0, 320.0), HOME, 360.0, about_m=8.0)
    assert down[-1].end == HOME
    (_, circle), (about, *aside) = returned(
        flies, RETURN_RULES[PLANE], away(500.0, 320.0), HOME, 360.0, about_m=8.0, circle_m=70.0
    )
    assert about.reach_m == 8.0
    assert [(s.reach_m, s.band_m) for s in aside] == [(w, 20.0) for w in (8.0, 6.0, 4.0, 2.0)]
    assert aside[0].start == (*away(500.0, 320.0)[:2], 340.0)
    assert aside[-1].end == (*HOME[:2], 340.0)
    for one, two in pairwise(aside):
        assert one.end == two.start
    assert circle.reach_m == 70.0
    grown_m = RETURN_RULES[PLANE].circle_m(360.0)
    assert grown_m == pytest.approx(60.0 * 1.1 / (1.0 - 2.25577e-5 * 360.0) ** 4.2559)
    assert math.isinf(circle.hold_s)
    assert circle_growth(-50.0) == pytest.approx(1.1)


def test_a_turn_about_takes_twice_the_larger_of_track_error_and_radius_at_least() -> None:
    v = replace(vehicle(PLANE, track_error_m=7.0), turn_radius_m=0.0)
    assert about_turn_m(v, 0.1, 0.0) == 14.0
    assert about_turn_m(replace(v, turn_radius_m=50.0), 0.1, 0.0) == 100.0
    assert at_home_m(v.limits) == 7.0
    assert at_home_m(replace(v.limits, track_error_m=1.0)) == 5.0


@pytest.mark.parametrize("metres", [8.0, 15.0, 40.0, 300.0])
@pytest.mark.parametrize("amsl_m", [305.0, 330.0, 352.0])
def test_the_sweep_has_the_cone_of_a_single_return(metres: float, amsl_m: float) -> None:
    w, v = world(300.0), vehicle(COPTER, track_error_m=0.0, altitude_error_m=0.0)
    u, one, none = np.array([0.0, 0.0]), np.zeros(2), np.zeros(1)
    trace = MissionTrace(
        u, one, one + metres, one + amsl_m, one, none, none, np.zeros(1, np.intp), none, none, none + 10.0, none,
        np.zeros((1, 3, 2)), w, 1,
    )  # fmt: skip
    met = obstacles_of_returns(trace, trace.cut(1.0), Target(0.0, 0.0, 300.0, 300.0), v, whole=True).clear
    (base,), (limit,) = met.base[:1], met.limit[:1]
    lowest = max(base, min(max(345.0, amsl_m), limit))
    flown, instead = returned(flies, RETURN_RULES[COPTER], away(metres, amsl_m), HOME, 345.0, about_m=0.0)
    assert lowest == pytest.approx(min(low for low, _ in spans([*instead, *flown])), abs=0.01)


@pytest.mark.parametrize("speed", [2.0, 5.0, 9.0, 10.0])
def test_a_copter_stops_where_arducopter_says_and_px4_within_what_was_flown(speed: float) -> None:
    v = vehicle(COPTER)
    # get_stopping_point_NE_m: v / p below a / p, else a / 2p² + v² / 2a; a = 2.5, p = 1.
    stops = speed if speed < 2.5 else 1.25 + speed**2 / 5.0
    assert stops <= braking_distance_m(v, speed) <= stops + 0.1
    assert 19.4 <= braking_distance_m(vehicle(PX4), 10.0) <= 21.0
    assert braking_distance_m(replace(v, accel_m_s2=math.inf), speed) == 0.0
    assert braking_distance_m(vehicle(PLANE), speed) == 0.0


def test_past_a_corner_it_runs_as_far_as_the_speed_in_the_corner_leads() -> None:
    v = vehicle(COPTER)
    assert run_past_m(v, 15.0, None) == 1.25  # a stop
    assert run_past_m(v, 15.0, 0.0) == braking_distance_m(v, 15.0)
    past = [run_past_m(v, 15.0, math.radians(turn)) for turn in (0, 30, 60, 90, 120, 150, 180)]
    assert past == sorted(past, reverse=True)
    radius = 2.0 / (math.sqrt(2.0) - 1.0)  # of the arc whose middle is 2 m from a right angle
    assert past[3] == pytest.approx(1.25 + 5.0 * radius / 5.0)


@pytest.mark.first_quick
@pytest.mark.parametrize("speed", [12.0, 16.0, 20.0, 24.0, 30.0])
def test_a_plane_turns_about_within_the_formula_wherever_home_lies(speed: float) -> None:
    v = replace(vehicle(PLANE, track_error_m=5.0), speed_max_m_s=speed)
    true = speed * math.sqrt(circle_growth(0.0) / 1.1)
    home = np.array([0.0, 0.0, 0.0])
    worst = 0.0
    for turn in range(0, 181, 20):
        course = math.radians(180.0 - turn)
        velocity = true * np.array([math.cos(course), math.sin(course), 0.0])
        flown = plane(
            Begin(np.array([3000.0, 0.0, 100.0]), velocity), home, 100.0, radius_m=60.0, climb_m_s=2.0, bank_s=0.7,
            late=False, rounds=0.05,
        )  # fmt: skip
        begin = flown[np.hypot(flown[:, 0] - 3000.0, flown[:, 1]) < 400.0]
        worst = max(worst, float(np.abs(begin[:, 1]).max()), float(begin[:, 0].max()) - 3000.0)
    about = about_turn_m(v, speed, 0.0)
    assert 0.6 * about < worst < about


@pytest.mark.nightly
def test_fifty_random_returns_fly_within_the_judged_places_and_no_lower() -> None:
    found = [in_twin(seed, (COPTER, PLANE)[seed % 2]) for seed in range(50)]
    assert [f for f in found if not f.as_judged] == []
    copters = [f for f in found[::2] if f.flown_agl_m < f.judged_agl_m + 3.0]
    assert len(copters) > 12  # the judged height is no mere bound


@pytest.mark.parametrize("seed", [2, 5])
def test_a_random_return_is_flown_as_judged(seed: int) -> None:
    assert in_twin(seed, (COPTER, PLANE)[seed % 2]).as_judged
