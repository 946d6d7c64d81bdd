"""The parameters of loopback vehicles: as each autopilot lists, packs and takes them."""

from __future__ import annotations

import struct

from pymavlink.dialects.v20 import ardupilotmega as mav

from gcsplan.sim.vehicle.hub import Hub
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
