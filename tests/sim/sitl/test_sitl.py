"""SITL from the outside: its parameters, the terrain and the wind that it gets, and why a flight did not arrive."""

from __future__ import annotations

import math
import socket
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gcsplan.check.judge import judge
from gcsplan.dem.dat_file import read_dat
from gcsplan.errors import InputError, LinkError, UsageError
from gcsplan.mavlink.link.link import Link, run
from gcsplan.mavlink.link.session import discover
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.sim.flight.wind import Weather
from gcsplan.sim.part import RehearsalPart
from gcsplan.sim.sitl import instances, terrain_files
from gcsplan.sim.sitl.flight_watch import FlightWatch
from gcsplan.sim.sitl.flights import arrival_s, is_column, is_over, reach_m
from gcsplan.sim.sitl.instances import heading_of, parameters_of
from gcsplan.sim.sitl.terrain_files import write_ground
from gcsplan.sim.sitl.wind_parameters import WIND_PARAMETERS, change_steps, wind_parameters
from gcsplan.sim.vehicle import telemetry
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.parameters import REAL32, Parameters, StoredParameter
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.cell import Cell
from gcsplan.world.limits import Limits
from gcsplan.world.terrain_grid import Block
from tests.oracles import terrain_grid as oracle
from tests.support.worlds import world

COPTER, PLANE = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE
LAT, LON = 36.6, -84.3


def ramp(slope: float = 0.1) -> Any:
    """A world that falls to the east."""
    return world(lambda e, n: 500.0 - slope * e, half_m=3000.0)


def a_part(where: Any, autopilot: Autopilot = COPTER, frame: int = m.RELATIVE, **craft: Any) -> RehearsalPart:
    vehicle = Vehicle(
        "uav1", 1, autopilot, Limits(10.0, track_error_m=3.0, altitude_error_m=5.0), speed_max_m_s=8.0, **craft
    )  # fmt: skip

    def at(command: int, east: float, z: float) -> MissionItem:
        lat, lon = where.frame.to_degrees(east, 0.0)
        return MissionItem(command, frame, (0, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), z)

    items = (at(cmd.TAKEOFF, 0.0, 60.0), at(cmd.WAYPOINT, 1500.0, 60.0), at(cmd.LAND, 1500.0, 0.0))
    mission = Mission(autopilot, m.Home.at(LAT, LON, where.ground_amsl(LAT, LON)), items, "uav1")
    return RehearsalPart(vehicle, mission, judge(mission, vehicle, where))


# -- parameters --------------------------------------------------------------------------------------------------------


def test_a_copter_gets_each_speed_by_its_name_before_and_since_4_7() -> None:
    part = replace(a_part(ramp(), climb_m_s=3.0, descent_m_s=2.0), rtl_rel_home_m=80.0)
    given = parameters_of(part)
    assert (given["WPNAV_SPEED"], given["WP_SPD"]) == (800.0, 8.0)
    assert (given["WPNAV_SPEED_UP"], given["WP_SPD_UP"]) == (300.0, 3.0)
    assert (given["WPNAV_SPEED_DN"], given["WP_SPD_DN"]) == (200.0, 2.0)
    assert (given["RTL_ALT"], given["RTL_ALT_M"]) == (8000.0, 80.0)
    assert (given["ARMING_CHECK"], given["ARMING_SKIPCHK"]) == (0, -1)
    assert "ANGLE_MAX" not in given
    fast = parameters_of(replace(part, vehicle=replace(part.vehicle, speed_max_m_s=15.0)))
    assert "ANGLE_MAX" not in fast  # nobody is told to set what the plan does not count with
    leans = parameters_of(replace(part, vehicle=replace(part.vehicle, lean_angle_deg=45.0)))
    assert (leans["ANGLE_MAX"], leans["ATC_ANGLE_MAX"]) == (4500.0, 45.0)


def test_a_plane_gets_its_circle_its_speeds_and_the_direction_of_its_take_off() -> None:
    part = replace(a_part(ramp(), PLANE, turn_radius_m=90.0, climb_m_s=4.0), rtl_rel_home_m=120.0)
    given = parameters_of(part)
    assert (given["WP_LOITER_RAD"], given["RTL_ALTITUDE"], given["TECS_CLMB_MAX"]) == (90.0, 120.0, 4.0)
    assert given["AIRSPEED_CRUISE"] == 8.0
    assert given["AIRSPEED_MIN"] <= 8.0 <= given["AIRSPEED_MAX"]
    assert heading_of(part) == pytest.approx(90.0, abs=0.1)
    assert heading_of(a_part(ramp())) == 0.0


def test_a_taken_port_is_passed_over_without_a_call() -> None:
    """An SITL that waits for its ground station ends when a caller leaves."""
    free = instances.free_instance(60)
    with socket.create_server(("127.0.0.1", instances.port_of(free))) as taken:
        assert instances.free_instance(free) > free
        taken.settimeout(0.05)
        with pytest.raises(TimeoutError):
            taken.accept()


def test_an_sitl_counts_its_instances_in_a_byte(tmp_path: Path) -> None:
    """Number 256 would listen at the port of number 0."""
    assert instances.LAST_INSTANCE < 256
    with (
        pytest.raises(UsageError, match="at most 236 vehicles at once, and there are 237"),
        instances.sitl_instances(tmp_path, [a_part(ramp())] * 237),
    ):
        pass


def test_a_folder_without_the_vehicles_program_is_named(tmp_path: Path) -> None:
    where = ramp()
    (tmp_path / "arduplane").touch(mode=0o755)
    with (
        pytest.raises(UsageError, match="arducopter: a program that can be run is wanted"),
        instances.sitl_instances(tmp_path, [a_part(where)]),
    ):
        pass


# -- ground ------------------------------------------------------------------------------------------------------------


def test_along_and_beside_the_flight_the_autopilot_reads_the_missions_ground_less_than_a_metre_higher(
    tmp_path: Path,
) -> None:
    where = ramp()
    given = write_ground(a_part(where), where, tmp_path)
    assert given == {"TERRAIN_ENABLE": 1, "TERRAIN_SPACING": 30, "SIM_TERRAIN": 1}
    (file,) = (tmp_path / "terrain").iterdir()
    assert file.name == "N36W085.DAT"
    found = read_dat(file, where="test")

    def post(lat_degrees: int, lon_degrees: int, north: int, east: int) -> float:
        block = Block(Cell(lat_degrees, lon_degrees), north // 24, east // 28)
        return float(found.blocks[block][north % 24, east % 28])

    along = np.linspace(-900.0, 2400.0, 60)
    for beside in (-900.0, 0.0, 900.0):
        places = where.frame.to_degrees(along, np.full(60, beside))
        for (lat, lon), east in zip(places, along, strict=True):
            read_m = oracle.height(round(1e7 * lat), round(1e7 * lon), post, 30)
            assert -0.01 < read_m - (500.0 - 0.1 * east) < 1.01


def test_a_mission_in_terrain_frame_has_the_grid_that_it_is_judged_with(tmp_path: Path) -> None:
    where = ramp()
    given = write_ground(a_part(where, frame=m.TERRAIN), where, tmp_path)
    assert given["TERRAIN_SPACING"] == 100


def test_a_long_flight_gets_posts_farther_apart_and_too_long_a_one_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    where = ramp()
    part = a_part(where)
    monkeypatch.setattr(terrain_files, "MOST_IN_FILES", 8)
    assert 30 < write_ground(part, where, tmp_path)["TERRAIN_SPACING"] < 500
    monkeypatch.setattr(terrain_files, "MOST_IN_FILES", 0)
    with pytest.raises(InputError, match="uav1: its flight is too long"):
        write_ground(part, where, tmp_path / "no")
    assert not (tmp_path / "no").exists()


def test_no_terrain_is_written_where_none_is_known(tmp_path: Path) -> None:
    where = ramp()
    unknown = world(lambda e, n: math.nan * e, half_m=3000.0)
    assert write_ground(a_part(where), unknown, tmp_path) == {"TERRAIN_ENABLE": 0, "SIM_TERRAIN": 0}
    assert list(tmp_path.iterdir()) == []


# -- wind --------------------------------------------------------------------------------------------------------------


def test_a_weather_is_told_in_sitls_parameters() -> None:
    assert wind_parameters(Weather(), 1) == {}
    assert wind_parameters(Weather(noise_m=1.0), 1) == {}
    given = wind_parameters(Weather(6.0, 270.0, 1.0), 1)
    assert given == pytest.approx(dict(zip(WIND_PARAMETERS, (6.0, -90.0, math.sqrt(2.0), 1.0), strict=True)))
    drawn = wind_parameters(Weather(6.0), 7)
    assert drawn == wind_parameters(Weather(6.0), 7)
    assert drawn != wind_parameters(Weather(6.0), 8)
    assert -180.0 <= drawn["SIM_WIND_DIR"] <= 180.0


def test_parameters_are_set_and_told_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    class Windy(Parameters):
        def __init__(self, *of_vehicle: Any) -> None:
            super().__init__(*of_vehicle)
            self._table |= {name: StoredParameter(REAL32, 0.25) for name in WIND_PARAMETERS}

    monkeypatch.setattr(telemetry, "Parameters", Windy)
    vehicle = LoopbackVehicle(1, COPTER, lat_deg=LAT, lon_deg=LON, amsl_m=500.0)
    with SimServer([vehicle], "udpin:127.0.0.1:0") as server, Link(server.url_for_gcs) as link:
        state = discover(link, 1, 5.0, listen_s=0.0)
        wanted = wind_parameters(Weather(6.0, 10.0, 1.0), 1)
        assert run(link.channel(1), change_steps(link.channel(1), state, {})) == {}
        channel = link.channel(1)
        assert run(channel, change_steps(channel, state, wanted)) == dict.fromkeys(WIND_PARAMETERS, 0.25)
        assert run(channel, change_steps(channel, state, dict.fromkeys(WIND_PARAMETERS, 0.25))) == pytest.approx(wanted)


def test_what_takes_no_wind_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gcsplan.sim.sitl.wind_parameters.PARAMETER_TRIES", 2)
    monkeypatch.setattr("gcsplan.sim.sitl.wind_parameters.PARAMETER_ANSWER_S", 0.05)
    vehicle = LoopbackVehicle(1, COPTER, lat_deg=LAT, lon_deg=LON, amsl_m=500.0)
    with SimServer([vehicle], "udpin:127.0.0.1:0") as server, Link(server.url_for_gcs) as link:
        state = discover(link, 1, 5.0, listen_s=0.0)
        channel = link.channel(1)
        with pytest.raises(LinkError, match="does not take SIM_WIND_SPD"):
            run(channel, change_steps(channel, state, wind_parameters(Weather(6.0), 1)))


# -- why it did not arrive ---------------------------------------------------------------------------------------------


def text(words: str, severity: int = 6) -> Any:
    return SimpleNamespace(get_type=lambda: "STATUSTEXT", text=words, severity=severity)


def beat(mode: int) -> Any:
    return SimpleNamespace(get_type=lambda: "HEARTBEAT", custom_mode=mode)


def test_ground_that_is_hit_on_the_way_ends_the_flight_with_its_cause() -> None:
    watch = FlightWatch(a_part(ramp()).mission)
    watch.note(beat(3), 1)
    watch.note(text("SIM Hit ground at 0.9 m/s"), 1)  # at take-off
    assert not watch.crashed
    watch.note(text("SIM Hit ground at 0.01 m/s"), 2)
    assert not watch.crashed
    watch.note(text("SIM Hit ground at 1.502964 m/s"), 2)
    assert watch.crashed
    assert watch.why() == "it hit the ground at 1.5 m/s on its way to item 2"
    assert "that is 90 m above the mission's ground: without terrain an SITL's ground is flat" in watch.why(90.0)


def test_a_landing_touches_the_ground() -> None:
    watch = FlightWatch(a_part(ramp()).mission)
    watch.note(text("SIM Hit ground at 0.6 m/s"), 3)
    assert not watch.crashed
    assert watch.why(90.0) == ""


def test_a_failsafe_is_named_with_what_the_vehicle_said() -> None:
    watch = FlightWatch(a_part(ramp()).mission)
    watch.note(text("Reached command #1"), 1)
    watch.note(text("Battery Failsafe", 4), 2)
    watch.note(beat(3), 2)
    watch.note(beat(6), 2)
    watch.note(beat(9), 2)
    watch.timed_out = True
    assert watch.why() == (
        "it left AUTO for RTL at item 2; it still flew to item 2 when the time was up; it said: Battery Failsafe"
    )


# -- wings -------------------------------------------------------------------------------------------------------------


def test_a_plane_arrives_where_it_is_nearest_and_at_a_circle_when_it_would_be_at_its_centre() -> None:
    part = a_part(ramp(), PLANE, turn_radius_m=100.0)
    times, speed = np.arange(0.0, 60.0), np.full(60, 20.0)
    passes = np.hypot(20.0 * (times - 40.0), 4.0)
    assert arrival_s(part, times, passes, speed) == 40.0
    assert reach_m(part) == 150.0
    circle = MissionItem(cmd.LOITER_UNLIM, 3, (0, 0, 100.0, 0))
    circling = replace(part, mission=replace(part.mission, items=(*part.mission.items[:-1], circle)))
    turns = np.maximum(800.0 - 20.0 * times, 112.0)
    assert arrival_s(circling, times, turns, speed) == pytest.approx(40.0)
    assert math.isnan(arrival_s(part, times, passes + 200.0, speed))


def test_a_planes_climb_out_and_glide_are_columns() -> None:
    where = ramp()
    part = a_part(where, PLANE, turn_radius_m=100.0)
    climb_out_m = part.verdict.legs[0].horizontal_m
    assert part.verdict.legs[0].column
    east = np.linspace(0.0, 1600.0, 161)
    points = np.column_stack([east, np.zeros(161), np.full(161, 560.0)])
    items = np.where(east < 1500.0, 2, 3)
    column = is_column(part, points, items)
    assert column.tolist() == ((east[1:] <= climb_out_m + 1e-6) | (items[:-1] == 3)).tolist()


def test_a_plane_that_circles_is_watched_for_a_while() -> None:
    part = a_part(ramp(), PLANE, turn_radius_m=100.0)
    circle = MissionItem(cmd.LOITER_UNLIM, 3, (0, 0, 100.0, 0))
    circling = replace(part, mission=replace(part.mission, items=(*part.mission.items[:-1], circle)))
    goal, away = (36.61, -84.3, 560.0), (36.62, -84.3, 560.0)
    clock = list(range(0, 80_000, 1000))
    assert is_over(circling, [goal] * 80, clock, goal)
    assert not is_over(circling, [away] * 40 + [goal] * 40, clock, goal)
    assert not is_over(circling, [away] * 80, clock, goal)
    assert not is_over(part, [goal] * 80, clock, goal)  # it lands
