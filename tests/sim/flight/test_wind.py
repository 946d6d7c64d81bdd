"""Wind, gusts and noise: their size, what they cost, and each run's own."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.sim.flight.mission_flight import fly
from gcsplan.sim.flight.wind import Weather
from tests.support.short_flights import CLIMB_S, COPTER, TAKEOFF, at, track


@pytest.mark.slow
def test_wind_within_the_airspeed_costs_no_time_and_beyond_it_costs_what_is_missing() -> None:
    way = track(TAKEOFF, at(cmd.WAYPOINT, 0, 1000, 50))
    calm = fly([way], [0.0]).arrive_s[0]
    assert fly([way], [0.0], weather=Weather(2.0, 0.0)).arrive_s[0] == pytest.approx(calm, abs=1e-6)  # 12 - 2 = 10
    ahead = fly([way], [0.0], weather=Weather(6.0, 0.0)).arrive_s[0]  # 12 - 6 = 6 m/s over ground
    assert ahead == pytest.approx(CLIMB_S + 1000 / 6 + 6 / 1.5, abs=0.1)
    behind = fly([way], [0.0], weather=Weather(6.0, 180.0)).arrive_s[0]
    assert behind == pytest.approx(calm, abs=1e-6)  # no faster than commanded
    across = fly([way], [0.0], weather=Weather(8.0, 90.0)).arrive_s[0]
    v = math.sqrt(12**2 - 8**2)
    assert across == pytest.approx(CLIMB_S + 1000 / v + v / 1.5, abs=0.1)


@pytest.mark.slow
def test_wind_adds_to_what_keeps_its_airspeed() -> None:
    """A real ArduPlane in 5 m/s (SITL) took 632.1 s over 15 legs of the jacksboro wing where this took 631.3."""
    ideal = replace(COPTER, accel_m_s2=math.inf, corner_accel_m_s2=math.inf)
    way = replace(track(TAKEOFF, at(cmd.WAYPOINT, 0, 1000, 50), vehicle=ideal), keeps_airspeed=True)
    for wind, from_deg, over_ground in ((0.0, 0.0, 10.0), (5.0, 0.0, 5.0), (5.0, 180.0, 15.0), (8.0, 90.0, 6.0)):
        arrives = fly([way], [0.0], weather=Weather(wind, from_deg)).arrive_s[0]
        assert arrives == pytest.approx(CLIMB_S + 1000 / over_ground, abs=0.1)


@pytest.mark.slow
def test_a_run_is_the_same_whether_it_is_flown_alone_or_among_others() -> None:
    ways = [track(TAKEOFF, at(cmd.WAYPOINT, 0, 600, 50)), track(TAKEOFF, at(cmd.WAYPOINT, 600, 0, 50))]
    weather = Weather(5.0, None, 2.0, 1.0)
    together = fly(ways, [0.0, 5.0], weather=weather, runs=4, seed=7)
    alone = fly(ways, [0.0, 5.0], weather=weather, runs=1, seed=7, first_run=2)
    assert alone.arrive_s.tolist() == together.arrive_s[4:6].tolist()
    other = fly(ways, [0.0, 5.0], weather=weather, runs=1, seed=8, first_run=2)
    assert other.arrive_s.tolist() != alone.arrive_s.tolist()


@pytest.mark.slow
def test_noise_and_gusts_have_the_size_that_was_asked_for() -> None:
    way = track(TAKEOFF, at(cmd.WAYPOINT, 0, 1500, 50))
    noisy = fly([way], [0.0], weather=Weather(noise_m=2.0), runs=40, seed=3)
    assert noisy.offset_m is not None
    assert noisy.offset_m.std(axis=(0, 1)) == pytest.approx([2.0, 2.0, 2.0], rel=0.15)
    gusty = fly([way], [0.0], weather=Weather(gusts_m_s=3.0), runs=40, seed=3)
    assert gusty.offset_m is not None
    assert 0.1 < gusty.offset_m[..., :2].std() < 0.4
    assert gusty.offset_m[..., 2].std() == 0.0


@pytest.mark.slow
def test_one_that_cannot_make_way_never_arrives_and_the_flight_still_ends() -> None:
    way = track(TAKEOFF, at(cmd.WAYPOINT, 0, 600, 50))
    flown = fly([way], [0.0], weather=Weather(30.0, 0.0))
    assert math.isnan(flown.arrive_s[0])
