"""Firmware versions of the simulated vehicles: each change is seen in the versions that have it, and only there."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mav

from gcsplan.errors import UsageError
from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, MissionItem
from gcsplan.mavlink.protocol.messages import Ack, ClearAll, Count, Item, MissionMessage, Request, RequestList
from gcsplan.sim.vehicle.firmware import (
    FIRMWARE_CHANGES,
    KNOWN_FIRMWARE,
    NAMES_UNITS,
    Firmware,
    FirmwareChange,
    firmware_of,
    firmwares,
)
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.telemetry import Telemetry
from gcsplan.vehicle import Autopilot
from tests.support.loopback import download, say, upload, waypoint

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
KINDS = (MISSION, FENCE, RALLY)


def a_vehicle(autopilot: Autopilot, version: str, **parameters: float) -> LoopbackVehicle:
    return LoopbackVehicle(
        1, autopilot, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.25, firmware=firmware_of(autopilot, version),
        parameters=parameters,
    )  # fmt: skip


def filled(version: str) -> LoopbackVehicle:
    """Two items in each list."""
    vehicle = a_vehicle(COPTER, version)
    upload(vehicle, [waypoint(n) for n in range(2)])
    upload(vehicle, [MissionItem(5004, 3, (30.0, 0, 0, 0), 366_000_000, -843_800_000)] * 2, FENCE)
    upload(vehicle, [MissionItem(5100, 3, x=366_000_000, y=-843_800_000, z=60.0)] * 2, RALLY)
    return vehicle


@pytest.mark.parametrize(
    ("version", "legacy", "answers"),
    [
        ("4.6", False, {MISSION: [Count(2), Ack(1)], FENCE: [Ack(1, FENCE)], RALLY: [Ack(13, RALLY)]}),
        ("4.6", True, {MISSION: [Count(2), Ack(1)], FENCE: [Ack(1, FENCE)], RALLY: [Ack(13, RALLY)]}),
        ("4.7", False, {kind: [Count(2, kind), Ack(13, kind)] for kind in KINDS}),
        ("4.7", True, {kind: [Ack(13, kind)] for kind in KINDS}),
    ],
)
def test_a_request_right_past_the_end(version: str, legacy: bool, answers: dict[int, list[object]]) -> None:
    vehicle = filled(version)
    for kind in KINDS:
        assert say(vehicle, Request(2, kind, legacy=legacy)) == answers[kind]


@pytest.mark.parametrize(
    ("autopilot", "version", "code"), [(COPTER, "4.6", 3), (COPTER, "4.7", 0), (PLANE, "4.6", 3), (PLANE, "4.7", 3)]
)
def test_only_a_copter_since_4_7_takes_arcs(autopilot: Autopilot, version: str, code: int) -> None:
    vehicle = a_vehicle(autopilot, version)
    arc = MissionItem(36, 3, (-120.0, 0, 0, 0), 366_000_000, -843_800_000, 60.0)
    assert upload(vehicle, [waypoint(0), arc]) == Ack(code)
    if code == 0:
        assert download(vehicle)[1] == arc


def test_farther_past_the_end_of_a_fence_is_a_bad_sequence_in_both() -> None:
    assert say(filled("4.6"), Request(3, FENCE)) == [Ack(13, FENCE)]
    assert say(filled("4.7"), Request(3, FENCE)) == [Count(2, FENCE), Ack(13, FENCE)]


@pytest.mark.parametrize(
    ("autopilot", "version", "new", "later"),
    [(COPTER, "4.6", 0, 0), (PLANE, "4.6", 0, 0), (COPTER, "4.7", 1, 0), (PLANE, "4.7", 1, 1)],
)
@pytest.mark.parametrize("emptying", [ClearAll(), Count(0)])
def test_home_in_an_empty_mission(
    autopilot: Autopilot, version: str, new: int, later: int, emptying: MissionMessage
) -> None:
    vehicle = a_vehicle(autopilot, version)
    assert say(vehicle, RequestList()) == [Count(new)]
    assert upload(vehicle, [waypoint(n) for n in range(3)]) == Ack(0)
    assert [i.z for i in download(vehicle)[1:]] == pytest.approx([61.0, 62.0], abs=0.01)
    assert say(vehicle, emptying, 10.0) == [Ack(0)]
    assert say(vehicle, RequestList(), 14.9) == [Count(0)]
    assert vehicle.deadline == (15.0 if later else None)
    assert say(vehicle, RequestList(), 15.0) == [Count(later)]


def test_a_single_item_sent_to_an_empty_mission_is_stored_behind_home_since_4_7() -> None:
    for version, kept in (("4.6", 1), ("4.7", 2)):
        vehicle = a_vehicle(COPTER, version)
        say(vehicle, ClearAll())
        say(vehicle, Count(1))
        assert say(vehicle, Item(0, waypoint(5))) == [Ack(0)]
        assert say(vehicle, RequestList()) == [Count(kept)]
    assert download(vehicle)[1].z == pytest.approx(65.0, abs=0.01)


@pytest.mark.parametrize(("version", "sent_m", "reads_m"), [("4.6", 50.0005, 50.0), ("4.7", 50.0005, 50.0005)])
def test_a_radius_right_above_whole_metres(version: str, sent_m: float, reads_m: float) -> None:
    vehicle = a_vehicle(COPTER, version)
    upload(vehicle, [MissionItem(5004, 3, (sent_m, 0, 0, 0), 366_000_000, -843_800_000)], FENCE)
    assert download(vehicle, FENCE)[0].params[0] == pytest.approx(reads_m, abs=1e-5)


@pytest.mark.parametrize(
    ("autopilot", "gone", "new"),
    [
        (COPTER, ("RTL_ALT", 1500.0), ("RTL_ALT_M", 15.0)),
        (COPTER, ("ANGLE_MAX", 4500.0), ("ATC_ANGLE_MAX", 45.0)),
        (COPTER, ("WPNAV_RADIUS", 200.0), ("WP_RADIUS_M", 2.0)),
        (COPTER, ("SYSID_THISMAV", 1.0), ("MAV_SYSID", 1.0)),
        (PLANE, ("ARMING_CHECK", 1.0), ("ARMING_SKIPCHK", 0.0)),
    ],
)
def test_parameters_have_their_names_and_units(
    autopilot: Autopilot, gone: tuple[str, float], new: tuple[str, float]
) -> None:
    lean = {"ANGLE_MAX": 4500.0} if autopilot is COPTER else {}
    before = Telemetry(a_vehicle(autopilot, "4.6", **lean)).parameters
    after = Telemetry(a_vehicle(autopilot, "4.7", **lean)).parameters
    assert before.value(gone[0]) == gone[1]
    assert after.value(new[0]) == new[1]
    assert gone[0] not in after.names()
    assert new[0] not in before.names()
    assert after.names() == sorted(after.names())


def test_every_renamed_parameter_stands_in_the_table_of_changes() -> None:
    before, after = (
        {n for a in (COPTER, PLANE) for n in Telemetry(a_vehicle(a, v)).parameters.names()} for v in ("4.6", "4.7")
    )
    assert before - after == set(NAMES_UNITS.before.split(":")[0].split(", "))
    assert after - before == set(NAMES_UNITS.after.split(":")[0].split(", "))


@pytest.mark.parametrize(("command", "since"), [(400, "1.17"), (212, "1.18")])
def test_px4_takes_a_command_since_its_version(command: int, since: str) -> None:
    for version in ("1.16", "1.17", "1.18"):
        answer = upload(a_vehicle(PX4, version), [MissionItem(command, 2, (1.0, 0.0, 0.0, 0.0))])
        assert isinstance(answer, Ack)
        assert answer.code == (0 if version >= since else 3), version


@pytest.mark.parametrize(("version", "state"), [("1.16", (0, 0)), ("1.17", (2, 2))])
def test_px4_tells_the_state_of_its_mission_since_1_17(version: str, state: tuple[int, int]) -> None:
    vehicle = a_vehicle(PX4, version)
    upload(vehicle, [waypoint(0)])
    told = next(m for m in Telemetry(vehicle).each_second(0.0) if m.get_type() == "MISSION_CURRENT")
    assert (told.mission_state, told.mission_mode) == state


def test_ardupilot_does_not_count_home_among_the_items_of_its_mission() -> None:
    for version in ("4.6", "4.7"):
        vehicle = a_vehicle(COPTER, version)
        current = [m for m in Telemetry(vehicle).each_second(0.0) if m.get_type() == "MISSION_CURRENT"]
        assert [(m.total, m.mission_state) for m in current] == [(0, 1)]
        upload(vehicle, [waypoint(n) for n in range(3)])
        current = [m for m in Telemetry(vehicle).each_second(0.0) if m.get_type() == "MISSION_CURRENT"]
        assert [(m.total, m.mission_state) for m in current] == [(2, 2)]


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_a_vehicle_names_its_version(autopilot: Autopilot) -> None:
    for firmware in KNOWN_FIRMWARE["ArduPilot" if autopilot.is_ardupilot else "PX4"]:
        telemetry = Telemetry(a_vehicle(autopilot, firmware.name))
        (told,) = telemetry.answer(mav.MAVLink_autopilot_version_request_message(1, 1), 0.0)
        number = told.flight_sw_version
        assert (number >> 24, number >> 16 & 255) == firmware.version


def test_a_version_counts_for_the_vehicles_that_have_it() -> None:
    assert [f.name for f in firmwares([COPTER, PX4], "4.7")] == ["4.7", "1.17"]
    assert [f.name for f in firmwares([PLANE, PX4], None)] == ["4.6", "1.17"]
    with pytest.raises(UsageError, match=r"--firmware 1\.18: give one of 4\.6, 4\.7"):
        firmwares([COPTER], "1.18")


@pytest.mark.parametrize("change", FIRMWARE_CHANGES, ids=lambda change: change.what)
def test_each_change_divides_the_known_versions_of_its_family(change: FirmwareChange) -> None:
    have = {f.has(change) for f in KNOWN_FIRMWARE[change.family]}
    assert have == {True, False}
    assert not Firmware("other", (99, 0)).has(change)
