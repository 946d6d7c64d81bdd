"""Fixed wings in declared winds: slopes over ground, climb-outs that are carried aside, turns and circles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.check.fixed_wing.ends import blown_slant, drift_of
from gcsplan.check.flight.follow import follow
from gcsplan.check.judge import judge
from gcsplan.check.motion.circles import circle_growth, circle_off_m, circle_reach_m, tracking_m
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mission_file.vehicles import in_wind
from gcsplan.vehicle import Vehicle
from gcsplan.wind.declared import STILL_AIR, DeclaredWind
from tests.support import wings

NOWHERE = np.zeros(1)


def winds(speed_m_s: tuple[float, float], from_deg: tuple[float, float], gust_m_s: float | None = None) -> DeclaredWind:
    return DeclaredWind(np.array([[speed_m_s]]), np.array([[from_deg]]), gust_m_s=gust_m_s)


def blown(wind: DeclaredWind, speed_m_s: float = 20.0, **limits: float) -> Vehicle:
    found = in_wind(replace(wings.wing(**limits), speed_min_m_s=speed_m_s, speed_max_m_s=speed_m_s), wind)
    assert found is not None
    return found


def drawn(wind: DeclaredWind, rng: np.random.Generator, count: int) -> np.ndarray:
    """(count, 2) winds of a set, with gusts in any direction."""
    mean = wind.vectors_m_s(rng.random((count, 2)), NOWHERE, NOWHERE, NOWHERE)[:, 0]
    turn = rng.uniform(0.0, 2.0 * math.pi, count)
    size = wind.gusts_add_m_s * rng.random(count)
    return np.asarray(mean + np.column_stack([size * np.cos(turn), size * np.sin(turn)]))


SETS = [
    winds((5.0, 5.0), (270.0, 270.0)), winds((0.0, 6.0), (0.0, 360.0)), winds((2.0, 7.0), (350.0, 390.0), 9.0),
    winds((3.0, 4.0), (-20.0, 200.0)),
]  # fmt: skip


@pytest.mark.parametrize("wind", SETS)
def test_no_wind_of_a_set_blows_more_along_a_course_than_told(wind: DeclaredWind) -> None:
    rng = np.random.default_rng(1)
    vehicle, air = blown(wind), drawn(wind, rng, 4000)
    assert np.hypot(*air.T).max() <= vehicle.wind_m_s + 1e-9
    for course in rng.uniform(-7.0, 7.0, 40).tolist():
        along = air @ [math.cos(course), math.sin(course)]
        aside = np.abs(air @ [-math.sin(course), math.cos(course)])
        assert along.max() <= vehicle.tail_m_s(course) + 1e-9
        assert aside.max() <= vehicle.aside_m_s(course) + 1e-9
        exact = wind.along_m_s(np.array([course]))[0]
        assert vehicle.tail_m_s(course) <= max(exact, 0.0) + 0.002 * vehicle.wind_m_s + 0.05
        assert exact <= along.max() + 1.2  # the worst is seldom drawn


def test_limits_hold_over_ground_with_the_strongest_wind_behind() -> None:
    vehicle = blown(winds((0.0, 5.0), (0.0, 360.0)))
    assert vehicle.limits.max_climb_slope == pytest.approx(math.tan(math.radians(8.0)) * 20.0 / 25.0, rel=2e-3)
    assert vehicle.limits.max_climb_slope <= math.tan(math.radians(8.0)) * 20.0 / (20.0 + vehicle.wind_m_s)
    assert vehicle.steepest_in_air_deg == 8.0
    assert in_wind(wings.wing(), STILL_AIR) == wings.wing()


@pytest.mark.parametrize("wind", SETS)
def test_a_climb_out_flown_in_any_wind_is_within_what_is_judged(wind: DeclaredWind) -> None:
    """Flown by its definition: its airspeed along its heading, plus the wind, and its climb through the air."""
    rng = np.random.default_rng(2)
    vehicle, rise_m, pitch = blown(wind, 18.0), 80.0, math.radians(8.0)
    heading = rng.uniform(0.0, 2.0 * math.pi)
    ahead = np.array([math.cos(heading), math.sin(heading)])
    run_m = rise_m / math.tan(pitch) / vehicle.tail_ratio
    aside_m, from_part = drift_of(vehicle, *(run_m * ahead).tolist())
    parts = blown_slant((0.0, 0.0, 0.0), (*(run_m * ahead).tolist(), rise_m), aside_m, from_part)
    climbs_s = rise_m / (18.0 * math.sin(pitch))
    for air in drawn(wind, rng, 300):
        for at_s in np.linspace(0.0, climbs_s, 20)[1:]:
            along = float((18.0 * math.cos(pitch) * ahead + air) @ ahead) * at_s
            off = abs(float(air @ [-ahead[1], ahead[0]])) * at_s
            up = 18.0 * math.sin(pitch) * at_s
            assert up >= along * rise_m / run_m - 0.02 * rise_m  # the slant's speed is 20, not 20 cos 8°
            k = min(max(int(4.0 * along / run_m), 0), 3)
            assert off <= (parts[k][2] if parts else 0.0) + 0.02 * aside_m + 1e-9


def test_a_steeper_climb_than_judged_before_a_circle_is_carried_aside_too() -> None:
    vehicle = blown(winds((5.0, 5.0), (180.0, 180.0)))
    climbs = wings.mission(wings.take_off(40.0), wings.at(cmd.LOITER_TO_ALT, 340.0, 100.0, 160.0, 0.0, 100.0))
    flight = follow(climbs, vehicle, wings.FLAT.ground_amsl, wings.FLAT.read_amsl)
    drift_m = next(n for n in flight.notes if n.code == "climb_out_blown").data["drift_m"]
    [space] = [s for s in flight.instead if s.band_m == 60.0 and s.start[:2] == wings.HOME_DEG]
    assert space.reach_m == drift_m > 50.0


def test_still_air_has_no_drift_and_no_parts() -> None:
    assert drift_of(wings.wing(), 300.0, 400.0) == (0.0, 1.0)
    assert blown_slant((0.0, 0.0, 0.0), (300.0, 0.0, 40.0), 0.0, 1.0) == []


def flown(vehicle: Vehicle) -> Verdict:
    mission = wings.through([(2000.0, 0.0, 80.0), (2800.0, 1200.0, 80.0), (4200.0, 1400.0, 80.0)])
    return judge(mission, vehicle, wings.FLAT)


@pytest.mark.slow
def test_turns_whose_bank_the_wind_makes_too_steep_are_not_judged() -> None:
    calm = flown(replace(wings.wing(), speed_max_m_s=20.0))
    assert "arcs_too_banked" not in [n.code for n in calm.not_judged]
    windy = flown(blown(winds((14.0, 14.0), (270.0, 270.0))))
    assert "arcs_too_banked" in [n.code for n in windy.not_judged]


@pytest.mark.slow
def test_a_climb_out_in_wind_is_longer_over_ground_and_wider() -> None:
    calm, windy = flown(wings.wing()), flown(blown(winds((5.0, 5.0), (180.0, 180.0))))
    notes = {n.code: n for n in windy.notes}
    calm_m = next(n for n in calm.notes if n.code == "climb_out_straight").data["run_m"]
    assert notes["climb_out_straight"].data["run_m"] == pytest.approx(calm_m * 25.0 / 20.0, rel=1e-2)
    assert notes["climb_out_blown"].data["drift_m"] == pytest.approx(calm_m * 5.0 / 20.0, rel=1e-2)
    into = flown(blown(winds((5.0, 5.0), (90.0, 90.0))))  # the climb-out leads to the east
    assert next(n for n in into.notes if n.code == "climb_out_blown").data["drift_m"] < 1.0


@pytest.mark.parametrize(("radius_m", "speed_m_s"), [(100.0, 20.0), (60.0, 15.0), (150.0, 25.0)])
def test_turns_and_circles_are_wider_the_stronger_the_wind(radius_m: float, speed_m_s: float) -> None:
    turns = [tracking_m(radius_m, math.radians(60.0), speed_m_s, wind_m_s=w) for w in (0.0, 3.0, 6.0)]
    assert turns == sorted(turns)
    assert turns[0] == tracking_m(radius_m, math.radians(60.0), speed_m_s)
    circles = [circle_off_m(radius_m, speed_m_s, w) for w in (0.0, 3.0, 6.0)]
    assert circles == sorted(circles)
    assert circles[0] == 0.0
    assert circle_reach_m(radius_m, 300.0, speed_m_s, 6.0) > circle_reach_m(radius_m, 300.0, speed_m_s, 0.0) + 1.0


@pytest.mark.parametrize(
    ("radius_m", "speed_m_s", "wind_m_s"), [(40.9, 17.3, 6.0), (60.5, 23.4, 8.0), (41.0, 12.1, 9.9)]
)
def test_no_circle_is_left_farther_than_its_reach(radius_m: float, speed_m_s: float, wind_m_s: float) -> None:
    growth = circle_growth(0.0)
    flown_m, true_m_s = radius_m * growth, speed_m_s * math.sqrt(growth)
    exact_m = flown_m + circle_off_m(flown_m, true_m_s, wind_m_s)
    assert exact_m <= circle_reach_m(radius_m, 0.0, speed_m_s, wind_m_s) <= exact_m + 12.0


@pytest.mark.slow
def test_a_circle_of_any_radius_is_simulated_in_little_time() -> None:
    assert 1e6 * circle_growth(0.0) < circle_reach_m(1e6, 0.0, 20.0, 5.0) < 1e6 * circle_growth(0.0) + 1.0
