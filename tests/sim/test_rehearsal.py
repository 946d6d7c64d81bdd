"""The rehearsal: what is stored is flown, and what is flown is judged."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.rehearse import parts_of, terms_of
from gcsplan.check.judge import judge
from gcsplan.errors import CheckFailed, InputError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.mission_file import load_mission
from gcsplan.sim.flight.wind import Weather
from gcsplan.sim.outcome import Terms
from gcsplan.sim.rehearsal import on_board, rehearse
from gcsplan.vehicle import Autopilot
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support import worlds
from tests.support.rehearsal_parts import FLAT, GROUND_M, a_part, kinds, reached_s


@pytest.mark.slow
def test_a_fleet_flies_what_its_boards_hold_and_arrives_when_arithmetic_says() -> None:
    parts = [
        a_part(n, (0, 200.0 * n), (1000, 200.0 * n), depart_s=9.0 * n, arrive_s=reached_s(1000) + 9.0 * n)
        for n in (1, 2, 3)
    ]
    names = ("uav1", "uav2", "uav3")
    result = rehearse(parts, FLAT, Terms(names, 30.0))
    assert result.safe
    assert result.error() is None
    assert result.order_flown == names
    assert [v.p95_s for v in result.vehicles] == pytest.approx([0.0] * 3, abs=0.05)
    assert result.closest is not None
    assert result.closest.distance_m == pytest.approx(200.0, abs=0.2)
    assert [v.min_agl_m for v in result.vehicles] == pytest.approx([70.0] * 3, abs=0.1)


def test_what_is_flown_is_what_the_vehicle_stored() -> None:
    part = a_part(1, (0, 0), (500, 0), height_m=70.019)  # ArduPilot keeps centimetres
    (stored,) = on_board([part])
    assert [i.z for i in stored.items][:1] == [m.float32(70.01)]
    assert stored.items != part.mission.items
    assert [i.command for i in stored.items] == [i.command for i in part.mission.items]


@pytest.mark.slow
def test_px4_and_planes_rehearse_too() -> None:
    copter = worlds.vehicle()
    px4 = a_part(1, (0, 0), (800, 0), vehicle=replace(copter, autopilot=Autopilot.PX4))
    result = rehearse([replace(px4, arrive_s=reached_s(800))], FLAT, Terms())
    assert result.safe
    assert result.p95_s == pytest.approx(0.0, abs=0.1)


def test_a_mission_that_breaks_a_limit_is_not_even_sent() -> None:
    part = a_part(1, (0, 0), (500, 0), height_m=40.0)
    with pytest.raises(CheckFailed, match="did not pass the check"):
        rehearse([part], FLAT, Terms())


@pytest.mark.slow
def test_what_is_not_understood_is_named_and_is_no_pass() -> None:
    part = a_part(1, (0, 0), (500, 0))
    unknown = MissionItem(cmd.DELAY, m.NO_POSITION, (-1.0, 12.0, 0.0, 0.0))
    mission = replace(part.mission, items=(*part.mission.items[:2], unknown, *part.mission.items[2:]))
    part = replace(part, mission=mission, verdict=judge(mission, part.vehicle, FLAT))
    result = rehearse([part], FLAT, Terms())
    assert result.safe is None
    error = result.error()
    assert error is not None
    assert (error.exit_code, error.reason) == (4, "not_judged")
    assert result.error(allow_unjudged=True) is None


def test_a_mission_that_goes_nowhere_and_two_of_one_name_are_refused() -> None:
    part = a_part(1, (0, 0), (500, 0))
    with pytest.raises(InputError, match="a name of its own"):
        rehearse([part, replace(part, mission=replace(part.mission, sysid=2))], FLAT, Terms())
    still = replace(part.mission, items=part.mission.items[1:2])
    nowhere = replace(part, mission=still, verdict=judge(still, part.vehicle, FLAT))
    with pytest.raises(InputError, match="nothing to rehearse"):
        rehearse([nowhere], FLAT, Terms())


@pytest.mark.slow
def test_corners_cut_into_a_zone_are_found_by_the_check_and_on_the_flown_track() -> None:
    inside = Zone("mast", Circle(498.6, 498.6, 1.2))
    world = worlds.world(GROUND_M, [inside], half_m=4000.0)
    vehicle = worlds.vehicle(track_error_m=0.0)
    part = a_part(1, (0, 500), (500, 500), (500, 0), world=world, vehicle=vehicle)
    assert {f.kind for f in part.verdict.findings} == {"zone"}  # the legs themselves keep clear, the corner does not
    passing = replace(part.verdict, findings=())
    result = rehearse([replace(part, verdict=passing)], world, Terms())
    assert kinds(result) == ["zone"]
    assert "mast" in str(result.breaches[0].message)


@pytest.mark.nightly
def test_every_run_has_its_own_weather_and_the_same_seed_the_same_figures() -> None:
    parts = [a_part(1, (0, 0), (1000, 0), arrive_s=reached_s(1000)), a_part(2, (0, 300), (1000, 300))]
    weather = Weather(5.0, None, 1.0, 1.0)
    one = rehearse(parts, FLAT, Terms((), 30.0), weather=weather, runs=20, seed=5)
    again = rehearse(parts, FLAT, Terms((), 30.0), weather=weather, runs=20, seed=5)
    assert one.as_dict() == again.as_dict()
    assert len(set(one.vehicles[0].arrive_s)) > 5  # a wind from behind changes nothing
    assert one.separation_kept_runs == 20
    errors = [abs(e) for e in one.vehicles[0].errors_s]
    assert one.vehicles[0].p95_s == sorted(errors)[18]
    other = rehearse(parts, FLAT, Terms((), 30.0), weather=weather, runs=20, seed=6)
    assert other.vehicles[0].arrive_s != one.vehicles[0].arrive_s


@pytest.mark.nightly
def test_noise_beyond_the_margin_is_counted_in_runs() -> None:
    parts = [a_part(1, (0, 0), (1500, 0), height_m=66.005)]
    result = rehearse(parts, FLAT, Terms(), weather=Weather(noise_m=3.0), runs=12, seed=2)
    assert kinds(result) == ["min_agl"]
    breach = result.breaches[0]
    assert 0 < breach.runs <= 12
    assert result.vehicles[0].min_agl_m == pytest.approx(60.0 - breach.by, abs=0.1)


@pytest.mark.nightly
def test_a_wind_that_is_too_strong_leaves_a_vehicle_that_never_arrives() -> None:
    result = rehearse([a_part(1, (0, 0), (0, 1000), arrive_s=90.0)], FLAT, Terms(), weather=Weather(40.0, 0.0))
    assert kinds(result) == ["arrival"]
    assert math.isinf(result.vehicles[0].errors_s[0])
    document = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert document["vehicles"][0]["arrive_s"] is None
    assert result.rows()[0]["arrives"] == "never"


CROSSING = """
version: 1
frame: {origin: [36.6, -84.3], amsl_m: 0}
terrain: {flat_m: 0}
limits: {min_agl_m: 40}
vehicles:
  - {name: uav1, sysid: 1, autopilot: px4, end: loiter, speed_m_s: [3, 12], climb_m_s: 2.5, descent_m_s: 1.5,
     start: {east_m: 90, north_m: 490}, goal: {east_m: -165, north_m: -440}}
  - {name: uav2, sysid: 2, autopilot: px4, end: loiter, speed_m_s: [3, 13], climb_m_s: 2.5, descent_m_s: 1.5,
     start: {east_m: -475, north_m: 157}, goal: {east_m: 540, north_m: -100}}
arrival: {mode: together, separation_m: 20, hold: ground}
"""


@pytest.mark.slow
def test_two_that_keep_their_speed_are_as_far_apart_in_the_air_as_planned() -> None:
    done = plan(load_mission("mission.yaml", text=CROSSING))
    assert done.fleet is not None
    a, b = done.fleet.motions
    t = np.arange(max(a.begin_s, b.begin_s), min(a.end_s, b.end_s), 0.01)
    planned_m = float(np.linalg.norm(a.at(t) - b.at(t), axis=1).min())
    flown = rehearse(parts_of(done), done.world, terms_of(done)).closest
    assert flown is not None
    assert planned_m - 0.05 <= flown.distance_m <= planned_m + 0.05
