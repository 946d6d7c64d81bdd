"""The parameters of loopback vehicles: as each autopilot lists, packs and takes them."""

from __future__ import annotations

import struct
from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mav

from gcsplan.mavlink.mission.mission import NO_POSITION, Home, Mission, MissionItem
from gcsplan.sim.vehicle.firmware import firmware_of
from gcsplan.sim.vehicle.hub import Hub
from gcsplan.sim.vehicle.parameters import Parameters, lean_parameters, set_up
from gcsplan.vehicle import Autopilot
from tests.support import worlds
from tests.support.hub import PX4, a_vehicle, ask


def test_parameters_are_listed_read_and_set() -> None:
    hub = Hub([a_vehicle(7)])
    values = ask(hub, mav.MAVLink_param_request_list_message(7, 1))
    table = {m.param_id: m.param_value for m in values}
    assert [m.param_index for m in values] == list(range(len(values)))
    assert values[0].param_count == len(values)
    assert (table["RTL_ALT"], table["WPNAV_SPEED"], table["SYSID_THISMAV"]) == (1500.0, 1000.0, 7.0)
    by_name = mav.MAVLink_param_request_read_message(7, 1, b"WPNAV_SPEED", -1)
    (speed,) = ask(hub, by_name)
    assert (speed.param_value, speed.param_type) == (1000.0, 9)
    by_index = mav.MAVLink_param_request_read_message(7, 1, b"", speed.param_index)
    assert [m.param_id for m in ask(hub, by_index)] == ["WPNAV_SPEED"]
    assert ask(hub, mav.MAVLink_param_request_read_message(7, 1, b"", 999)) == []
    (now,) = ask(hub, mav.MAVLink_param_set_message(7, 1, b"WPNAV_SPEED", 750.0, 9))
    assert now.param_value == 750.0
    for unfit in (float("nan"), float("inf")):
        assert ask(hub, mav.MAVLink_param_set_message(7, 1, b"WPNAV_SPEED", unfit, 9))[0].param_value == 750.0
    assert ask(hub, mav.MAVLink_param_set_message(7, 1, b"RTL_ALT_FINAL", 1e30, 6))[0].param_value == 0.0
    assert ask(hub, mav.MAVLink_param_set_message(7, 1, b"NO_SUCH_NAME", 1.0, 9)) == []


def test_px4_packs_whole_parameters_as_bytes() -> None:
    hub = Hub([a_vehicle(3, PX4)])
    values = {m.param_id: m for m in ask(hub, mav.MAVLink_param_request_list_message(3, 1))}
    assert values["RTL_RETURN_ALT"].param_value == 30.0
    assert struct.unpack("<i", struct.pack("<f", values["MAV_SYS_ID"].param_value)) == (3,)


def test_a_whole_parameter_takes_what_fits_its_bytes() -> None:
    table = Parameters(Autopilot.ARDUCOPTER, 1, firmware_of(Autopilot.ARDUCOPTER))
    assert table.on_wire("FENCE_ACTION") == (1.0, 2)
    assert table.set_from_wire("FENCE_ACTION", 127.9)
    assert table.value("FENCE_ACTION") == 127.0
    for unfit in (128.0, -129.0, float("inf")):
        assert not table.set_from_wire("FENCE_ACTION", unfit)
    assert table.value("FENCE_ACTION") == 127.0
    assert not table.set_from_wire("NO_SUCH_NAME", 1.0)


@pytest.mark.parametrize(("speed_m_s", "lean_cd"), [(8.0, 3000.0), (15.0, 4500.0), (60.0, 8000.0)])
def test_a_copter_leans_as_far_as_its_missions_speed_needs(speed_m_s: float, lean_cd: float) -> None:
    fast = MissionItem(178, NO_POSITION, (1.0, speed_m_s, -1.0, 0.0))
    mission = Mission(Autopilot.ARDUCOPTER, Home(0, 0, 0.0), (fast, MissionItem(16, 3)))
    assert lean_parameters(mission) == {"ANGLE_MAX": lean_cd}
    assert lean_parameters(replace(mission, autopilot=Autopilot.PX4)) == {}


def test_a_vehicle_is_set_up_as_its_mission_file_says() -> None:
    vehicle = replace(worlds.vehicle(), climb_m_s=3.0, descent_m_s=2.0)
    given = set_up(vehicle, Home.at(36.6, -84.3, 300.0))
    assert (given["WPNAV_SPEED_UP"], given["WPNAV_SPEED_DN"]) == (300.0, 200.0)
    table = Parameters(vehicle.autopilot, 1, firmware_of(vehicle.autopilot), given)
    assert table.value("WPNAV_SPEED_UP") == 300.0
