"""Wind, gusts and noise: their size, what they cost, and each run's own."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.sim.flight.mission_flight import fly
from gcsplan.sim.flight.wind import Air, Weather
from gcsplan.wind.declared import DeclaredWind
from tests.support.short_flights import CLIMB_S, COPTER, TAKEOFF, at, track


@pytest.mark.nightly
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


@pytest.mark.nightly
def test_wind_adds_to_what_keeps_its_airspeed() -> None:
    """A real ArduPlane in 5 m/s (SITL) took 632.1 s over 15 legs of the jacksboro wing where this took 631.3."""
    ideal = replace(COPTER, accel_m_s2=math.inf, corner_accel_m_s2=math.inf)
    way = replace(track(TAKEOFF, at(cmd.WAYPOINT, 0, 1000, 50), vehicle=ideal), keeps_airspeed=True)
    for wind, from_deg, over_ground in ((0.0, 0.0, 10.0), (5.0, 0.0, 5.0), (5.0, 180.0, 15.0), (8.0, 90.0, 6.0)):
        arrives = fly([way], [0.0], weather=Weather(wind, from_deg)).arrive_s[0]
        assert arrives == pytest.approx(CLIMB_S + 1000 / over_ground, abs=0.1)


@pytest.mark.nightly
def test_a_run_is_the_same_whether_it_is_flown_alone_or_among_others() -> None:
    ways = [track(TAKEOFF, at(cmd.WAYPOINT, 0, 600, 50)), track(TAKEOFF, at(cmd.WAYPOINT, 600, 0, 50))]
    weather = Weather(5.0, None, 2.0, 1.0)
    together = fly(ways, [0.0, 5.0], weather=weather, runs=4, seed=7)
    alone = fly(ways, [0.0, 5.0], weather=weather, runs=1, seed=7, first_run=2)
    assert alone.arrive_s.tolist() == together.arrive_s[4:6].tolist()
    other = fly(ways, [0.0, 5.0], weather=weather, runs=1, seed=8, first_run=2)
    assert other.arrive_s.tolist() != alone.arrive_s.tolist()


@pytest.mark.nightly
def test_noise_and_gusts_have_the_size_that_was_asked_for() -> None:
    way = track(TAKEOFF, at(cmd.WAYPOINT, 0, 1500, 50))
    noisy = fly([way], [0.0], weather=Weather(noise_m=2.0), runs=40, seed=3)
    assert noisy.offset_m is not None
    assert noisy.offset_m.std(axis=(0, 1)) == pytest.approx([2.0, 2.0, 2.0], rel=0.15)
    gusty = fly([way], [0.0], weather=Weather(gusts_m_s=3.0), runs=40, seed=3)
    assert gusty.offset_m is not None
    assert 0.1 < gusty.offset_m[..., :2].std() < 0.4
    assert gusty.offset_m[..., 2].std() == 0.0


@pytest.mark.nightly
def test_one_that_cannot_make_way_never_arrives_and_the_flight_still_ends() -> None:
    way = track(TAKEOFF, at(cmd.WAYPOINT, 0, 600, 50))
    flown = fly([way], [0.0], weather=Weather(30.0, 0.0))
    assert math.isnan(flown.arrive_s[0])


def declared(speed_m_s: tuple[float, float], from_deg: tuple[float, float], **rest: object) -> DeclaredWind:
    return DeclaredWind(np.array([[speed_m_s]]), np.array([[from_deg]]), **rest)


def blown(wind: DeclaredWind, runs: int, steps: int, seed: int = 1) -> Floats:
    """(steps, lanes, 2) the air of two vehicles, 25 m over flat ground, every 0.2 s."""
    ways = [track(TAKEOFF, at(cmd.WAYPOINT, 0, north_m, 50)) for north_m in (600, 300)]
    air = Air(Weather(declared=wind), ways, runs, seed)
    found = []
    for k in range(steps):
        air.step(0.2, 0.2 * (k + 1), np.full(2 * runs, 25.0), np.full(2 * runs, 10.0))
        found.append(air.wind)
    return np.array(found)


def test_each_run_has_one_wind_of_the_set_for_all_vehicles_and_all_of_its_time() -> None:
    air = blown(declared((2.0, 6.0), (0.0, 90.0)), 20, 3)
    assert (np.ptp(air, axis=0) < 1e-12).all()
    first, second = air[0, ::2], air[0, 1::2]
    assert (first == second).all()
    speeds = np.hypot(*first.T)
    assert speeds.min() >= 2.0
    assert speeds.max() <= 6.0
    assert np.ptp(speeds) > 2.0
    assert (first < 1e-9).all()  # from north to east: it blows south and west


@pytest.mark.slow
def test_a_wind_that_varies_is_another_one_for_each_vehicle_and_stays_in_its_set() -> None:
    air = blown(declared((2.0, 6.0), (0.0, 90.0), varying=True), 4, 800)
    speeds = np.hypot(air[..., 0], air[..., 1])
    assert speeds.min() >= 2.0 - 1e-9
    assert speeds.max() <= 6.0 + 1e-9
    assert (np.ptp(air, axis=0).max(axis=1) > 0.5).all()
    assert (np.abs(np.diff(air, axis=0)) < 0.1).all()  # smoothly
    assert (air[0, ::2] != air[0, 1::2]).all()


@pytest.mark.slow
def test_gusts_are_as_strong_as_declared_and_no_stronger() -> None:
    air = blown(declared((5.0, 5.0), (270.0, 270.0), gust_m_s=9.0), 50, 600)
    gusts = air - [5.0, 0.0]
    size = np.hypot(gusts[..., 0], gusts[..., 1])
    assert size.max() <= 4.0 + 1e-9
    assert size.max() > 3.5
    # At 25 m the intensity is 0.89 of that at 20 ft, by the formula of MIL-F-8785C.
    rises = (0.177 + 0.000823 * 20.0) / (0.177 + 0.000823 * 25.0 / 0.3048)
    assert gusts.std(axis=(0, 1)) == pytest.approx(4.0 / 3.0 * rises**0.4, rel=0.12)


@pytest.mark.slow
def test_gusts_last_as_long_as_turbulence_of_that_height_takes_to_pass() -> None:
    along = blown(declared((5.0, 5.0), (270.0, 270.0), gust_m_s=9.0), 60, 600)[..., 0] - 5.0
    feet = 25.0 / 0.3048
    passes_s = 25.0 / (0.177 + 0.000823 * feet) ** 1.2 / 10.0
    later = round(passes_s / 0.2)
    kept = (along[:-later] * along[later:]).mean() / (along**2).mean()
    assert kept == pytest.approx(math.exp(-1.0), abs=0.1)


def test_a_profile_blows_as_high_as_the_vehicle_is() -> None:
    heights = np.array([[[0.0, 0.0], [10.0, 10.0]]])
    wind = DeclaredWind(heights, np.full((1, 2, 2), 270.0), np.array([0.0, 50.0]))
    way = track(TAKEOFF, at(cmd.WAYPOINT, 0, 600, 50))
    air = Air(Weather(declared=wind), [way], 1, 1)
    for along_m, speed_m_s in ((0.0, 0.0), (25.0, 5.0), (50.0, 10.0), (300.0, 10.0)):
        air.step(0.2, 0.2, np.array([along_m]), np.array([10.0]))
        assert air.wind[0] == pytest.approx([speed_m_s, 0.0], abs=1e-3)


@pytest.mark.slow
def test_a_drawn_run_is_the_same_alone_and_among_others() -> None:
    wind = declared((2.0, 6.0), (0.0, 360.0), varying=True, gust_m_s=9.0)
    ways = [track(TAKEOFF, at(cmd.WAYPOINT, 0, 200, 50))]
    weather = Weather(declared=wind, noise_m=0.5)
    together = fly(ways, [0.0], weather=weather, runs=3, seed=7)
    alone = fly(ways, [0.0], weather=weather, runs=1, seed=7, first_run=2)
    assert alone.arrive_s[0] == together.arrive_s[2]
    assert alone.air_m[0] == together.air_m[2]


def test_a_wind_beside_a_declared_one_is_refused() -> None:
    with pytest.raises(InputError, match="not both"):
        Weather(3.0, declared=declared((2.0, 6.0), (0.0, 360.0)))


def test_weather_whose_squares_overflow_is_refused() -> None:
    for wind_m_s, gusts_m_s, noise_m in ((1e300, 0.0, 0.0), (0.0, 1e6, 0.0), (0.0, 0.0, 1e300), (0.0, 0.0, np.nan)):
        with pytest.raises(InputError, match="from 0 to 100000"):
            Weather(wind_m_s, None, gusts_m_s, noise_m)


def test_still_air_that_is_declared_is_calm() -> None:
    assert Weather(declared=declared((0.0, 0.0), (0.0, 360.0))).calm
    assert not Weather(declared=declared((0.0, 0.0), (0.0, 360.0), gust_m_s=2.0)).calm


def test_one_steady_wind_of_the_set_stands_for_it_in_a_simulator_that_has_no_other() -> None:
    wind = Weather(declared=declared((2.0, 6.0), (0.0, 90.0), gust_m_s=9.0)).steady(3)
    assert 2.0 <= wind.wind_m_s <= 6.0
    assert wind.from_deg is not None
    assert 0.0 <= wind.from_deg <= 90.0
    assert wind.gusts_m_s == pytest.approx(1.0)
    assert Weather(3.0, 20.0).steady(3) == Weather(3.0, 20.0)
