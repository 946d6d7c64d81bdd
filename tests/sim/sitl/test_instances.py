"""SITL instances: their parameters, headings and ports; their ground is the mission's, as ArduPilot reads it."""

from __future__ import annotations

import math
import socket
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gcsplan.dem.dat_file import read_dat
from gcsplan.errors import InputError, UsageError
from gcsplan.mavlink.mission import mission as m
from gcsplan.sim.sitl import instances
from gcsplan.sim.sitl.instances import heading_of, parameters_of, write_ground
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.grid import Block
from tests.oracles import terrain_grid as oracle
from tests.support.sitl_parts import PLANE, a_part, ramp
from tests.support.worlds import world


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
        pytest.raises(UsageError, match="arducopter: give a program that can be run"),
        instances.sitl_instances(tmp_path, [a_part(where)]),
    ):
        pass


def test_the_autopilot_reads_the_missions_ground_within_a_metre_about_the_flight(
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
    monkeypatch.setattr(instances, "MOST_IN_FILES", 8)
    assert 30 < write_ground(part, where, tmp_path)["TERRAIN_SPACING"] < 500
    monkeypatch.setattr(instances, "MOST_IN_FILES", 0)
    with pytest.raises(InputError, match="uav1: its flight is too long"):
        write_ground(part, where, tmp_path / "no")
    assert not (tmp_path / "no").exists()


def test_no_terrain_is_written_where_none_is_known(tmp_path: Path) -> None:
    where = ramp()
    unknown = world(lambda e, n: math.nan * e, half_m=3000.0)
    assert write_ground(a_part(where), unknown, tmp_path) == {"TERRAIN_ENABLE": 0, "SIM_TERRAIN": 0}
    assert list(tmp_path.iterdir()) == []
