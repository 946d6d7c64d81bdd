"""What a loopback vehicle says and answers outside the mission protocol."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mav

from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.messages import Address, Count
from gcsplan.sim.vehicle.hub import Hub
from gcsplan.sim.vehicle.telemetry import Telemetry
from gcsplan.vehicle import Autopilot
from tests.support.hub import COPTER, GCS, PLANE, PX4, a_vehicle, ask, command, messages


def unasked(hub: Hub, now: float) -> dict[str, Any]:
    ask(hub, mav.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3), now)
    return {m.get_type(): m for m in messages(data for _, data in hub.on_timer(now))}


@pytest.mark.parametrize(
    ("autopilot", "kind", "number"), [(COPTER, 2, 3), (PLANE, 1, 3), (PX4, 2, 12)]
)  # MAV_TYPE, MAV_AUTOPILOT
def test_a_heartbeat_tells_what_the_vehicle_is(autopilot: Autopilot, kind: int, number: int) -> None:
    heartbeat = unasked(Hub([a_vehicle(5, autopilot)]), 0.0)["HEARTBEAT"]
    assert (heartbeat.type, heartbeat.autopilot, heartbeat.system_status) == (kind, number, 3)
    assert (heartbeat.get_srcSystem(), heartbeat.get_srcComponent()) == (5, 1)
    assert not heartbeat.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED


def test_position_and_home_are_where_it_stands() -> None:
    said = unasked(Hub([a_vehicle()]), 0.0)
    here = said["GLOBAL_POSITION_INT"]
    assert (here.lat, here.lon, here.alt, here.relative_alt) == (366_000_000, -843_800_000, 371_250, 0)
    home = said["HOME_POSITION"]
    assert (home.latitude, home.longitude, home.altitude) == (366_000_000, -843_800_000, 371_250)
    assert said["GPS_RAW_INT"].fix_type == 3
    assert {"SYS_STATUS", "ATTITUDE", "MISSION_CURRENT"} <= set(said)


def test_it_speaks_once_a_second() -> None:
    hub = Hub([a_vehicle()], always="console")
    beats = 0
    now = 100.0
    while now < 110.0:
        beats += sum(m.get_type() == "HEARTBEAT" for m in messages(data for _, data in hub.on_timer(now)))
        assert hub.deadline is not None
        now = max(hub.deadline, now + 1e-3)
    assert beats == 10


def test_while_booting_it_only_beats_and_is_not_yet_in_standby() -> None:
    hub = Hub([a_vehicle(boot_s=3.0)])
    said = unasked(hub, 10.0)
    assert list(said) == ["HEARTBEAT"]
    assert said["HEARTBEAT"].system_status == 1
    assert unasked(hub, 13.0)["HEARTBEAT"].system_status == 3


def test_armed_shows_in_the_heartbeat() -> None:
    hub = Hub([a_vehicle(trouble="armed")])
    heartbeat = unasked(hub, 0.0)["HEARTBEAT"]
    assert heartbeat.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED
    assert heartbeat.system_status == 4


def test_a_dead_link_carries_no_heartbeats() -> None:
    hub = Hub([a_vehicle(trouble="silent_after=1")], always="a")
    assert hub.on_timer(0.0)
    ask(hub, wire.encode(Count(3), Address(1, 1)), 0.5)
    assert hub.on_timer(1.5) == []
    assert ask(hub, command(520), 2.0) == []


def test_the_autopilot_version_is_told_in_both_ways_of_asking() -> None:
    for autopilot, terrain in ((COPTER, True), (PX4, False)):
        hub = Hub([a_vehicle(1, autopilot)])
        for number, param in ((512, 148), (520, 1)):
            ack, version = ask(hub, command(number, param))
            assert (ack.command, ack.result) == (number, 0)
            assert version.capabilities & 4  # MISSION_INT
            assert version.capabilities & 16384  # fence
            assert version.capabilities & 32768  # rally
            assert bool(version.capabilities & 512) is terrain


def test_messages_can_be_requested_and_unknown_ones_are_unsupported() -> None:
    hub = Hub([a_vehicle()])
    for number, name in ((242, "HOME_POSITION"), (33, "GLOBAL_POSITION_INT"), (42, "MISSION_CURRENT")):
        ack, message = ask(hub, command(512, number))
        assert (ack.result, message.get_type()) == (0, name)
    for params in ((9999.0,), (float("nan"),), (-5.0,), (float("inf"),)):
        assert [m.result for m in ask(hub, command(512, *params))] == [3]
    assert [m.result for m in ask(hub, command(31010))] == [3]
    assert [m.result for m in ask(hub, command(511, 33, 100_000))] == [0]


def test_arming_and_auto_make_it_fly_its_mission() -> None:
    vehicle = a_vehicle()
    hub = Hub([vehicle])
    assert ask(hub, command(300))[0].result == 2  # there is no mission to start
    vehicle.load([MissionItem(16, 0), MissionItem(16, 3)])
    assert ask(hub, command(400, 1))[0].result == 0
    assert vehicle.armed
    assert not vehicle.flying_mission
    assert ask(hub, command(176, 1, 3))[0].result == 0
    assert vehicle.flying_mission
    assert unasked(hub, 1.0)["MISSION_CURRENT"].mission_state == 3
    assert ask(hub, command(400, 0))[0].result == 0
    assert not vehicle.flying_mission
    assert ask(hub, command(400, 0.5))[0].result == 2


def test_it_does_not_arm_while_booting() -> None:
    hub = Hub([a_vehicle(boot_s=5.0)])
    assert ask(hub, command(400, 1), 0.0)[0].result == 1
    assert ask(hub, command(400, 1), 5.0)[0].result == 0


def test_clocks_are_compared() -> None:
    hub = Hub([a_vehicle()])
    (answer,) = ask(hub, mav.MAVLink_timesync_message(0, 12345), 2.0)
    assert (answer.tc1, answer.ts1) == (2_000_000_000, 12345)
    assert ask(hub, mav.MAVLink_timesync_message(1, 12345), 2.0) == []
    (pong,) = ask(hub, mav.MAVLink_ping_message(5, 6, 0, 0), 2.0)
    assert (pong.time_usec, pong.seq, pong.target_system) == (5, 6, GCS.sysid)


def test_what_is_meant_for_others_is_not_answered() -> None:
    hub = Hub([a_vehicle(1)])
    assert ask(hub, command(520, sysid=2)) == []
    assert ask(hub, mav.MAVLink_param_request_list_message(2, 1)) == []


def test_a_vehicle_tells_its_terrain_once_that_was_asked_for() -> None:
    telemetry = Telemetry(a_vehicle())
    kinds = {m.get_type() for m in telemetry.each_second(0.0)}
    assert {"HEARTBEAT", "HOME_POSITION", "EXTENDED_SYS_STATE"} <= kinds
    assert not kinds & {"TERRAIN_REPORT", "TERRAIN_REQUEST"}
    message = command(511, 133, 100_000)  # the interval of TERRAIN_REQUEST
    message.pack(mav.MAVLink(None, srcSystem=255, srcComponent=190))
    (ack,) = telemetry.answer(message, 0.5)
    assert ack.result == 0
    assert {"TERRAIN_REPORT", "TERRAIN_REQUEST"} <= {m.get_type() for m in telemetry.each_second(1.0)}
    assert telemetry.terrain is not None
    assert telemetry.terrain.grid.spacing_m == 100
    assert Telemetry(a_vehicle(2, PX4)).terrain is None
