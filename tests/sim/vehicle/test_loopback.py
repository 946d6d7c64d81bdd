"""The loopback vehicle: where ArduPilot and PX4 answer alike and where they differ, in simulated time."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, Home, Mission, MissionItem
from gcsplan.mavlink.protocol.messages import (
    Ack,
    Address,
    ClearAll,
    Count,
    Item,
    LegacyItem,
    Packet,
    Request,
    RequestList,
)
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.vehicle import Autopilot
from tests.support.effort import draws
from tests.support.loopback import BOTH, COPTER, GCS, PX4, a_mission, a_vehicle, download, say, upload, waypoint


@BOTH
def test_an_upload_ends_accepted_and_reads_back(autopilot: Autopilot) -> None:
    vehicle = a_vehicle(autopilot)
    sent = a_mission(20)
    answer = upload(vehicle, sent)
    assert isinstance(answer, Ack)
    assert (answer.code, bool(answer.opaque_id)) == (0, autopilot is PX4)
    back = download(vehicle)
    assert [(i.x, i.y, i.command) for i in back[1:]] == [(i.x, i.y, i.command) for i in sent[1:]]
    assert tuple(back) == vehicle.items()


def test_count_cuts_the_old_list_at_once_on_ardupilot_and_not_on_px4() -> None:
    for autopilot, left in ((COPTER, 5), (PX4, 12)):
        vehicle = a_vehicle(autopilot)
        upload(vehicle, a_mission(12))
        say(vehicle, Count(5))
        assert len(vehicle.items()) == left


def test_a_refused_item_leaves_half_a_new_mission_on_ardupilot_the_old_one_on_px4() -> None:
    new = [waypoint(100 + i) for i in range(6)]
    new[4] = MissionItem(9999, 2)
    for autopilot, expected in ((COPTER, [101, 102, 103, 4, 5]), (PX4, [0, 1, 2, 3, 4, 5, 6, 7])):
        vehicle = a_vehicle(autopilot)
        upload(vehicle, a_mission(8))
        assert upload(vehicle, new) == Ack(3)
        kept = vehicle.items()[1:] if autopilot is COPTER else vehicle.items()
        assert [i.x - 366_000_000 for i in kept] == expected


def test_wrong_items_draw_invalid_sequence_on_ardupilot_and_nothing_on_px4() -> None:
    for autopilot, answer in ((COPTER, [Ack(13)]), (PX4, [])):
        vehicle = a_vehicle(autopilot)
        say(vehicle, Count(5))
        say(vehicle, Item(0, waypoint(0)))
        assert say(vehicle, Item(0, waypoint(0))) == answer  # twice
        assert say(vehicle, Item(3, waypoint(3))) == answer  # too early
        assert isinstance(say(vehicle, Item(1, waypoint(1)))[0], Request)  # and the upload goes on


def test_the_last_item_again_draws_error_on_ardupilot_and_its_ack_on_px4() -> None:
    for autopilot, code in ((COPTER, 1), (PX4, 0)):
        vehicle = a_vehicle(autopilot)
        final = upload(vehicle, a_mission(3))
        (again,) = say(vehicle, Item(2, waypoint(2)))
        assert isinstance(again, Ack)
        assert again.code == code
        assert (again == final) is (autopilot is PX4)


def test_px4_stops_an_upload_when_told_and_ardupilot_does_not() -> None:
    for autopilot, asks in ((COPTER, True), (PX4, False)):
        vehicle = a_vehicle(autopilot)
        say(vehicle, Count(3))
        assert say(vehicle, Ack(15)) == []
        assert (vehicle.deadline is not None) is asks


def test_no_space_while_booting_and_for_what_does_not_fit() -> None:
    vehicle = a_vehicle(COPTER, boot_s=2.0)
    assert say(vehicle, Count(3), 5.0) == [Ack(4)]
    assert say(vehicle, Count(3), 6.9) == [Ack(4)]
    assert say(vehicle, Count(3), 7.0) == [Request(0, legacy=True)]
    assert say(a_vehicle(COPTER), Count(651)) == [Ack(4)]
    assert say(a_vehicle(COPTER), Count(650)) == [Request(0, legacy=True)]
    assert say(a_vehicle(PX4), Count(2001)) == [Ack(4)]
    assert say(a_vehicle(PX4, boot_s=2.0), Count(3)) == []


def test_messages_to_other_vehicles_are_not_answered() -> None:
    for autopilot in (COPTER, PX4):
        assert a_vehicle(autopilot).receive(Packet(GCS, Address(2, 1), Count(3)), 0.0) == []


def test_px4_ignores_components_that_it_is_not() -> None:
    assert a_vehicle(PX4).receive(Packet(GCS, Address(1, 100), Count(3)), 0.0) == []
    assert len(a_vehicle(COPTER).receive(Packet(GCS, Address(1, 100), Count(3)), 0.0)) == 1


def test_a_duplicate_upload_of_another_type_goes_beside_the_first_on_ardupilot_alone() -> None:
    vehicle = a_vehicle()
    say(vehicle, Count(2))
    assert say(vehicle, Count(1, FENCE)) == [Request(0, FENCE, legacy=True)]
    assert say(vehicle, Item(0, waypoint(0))) == [Request(1, legacy=True)]
    vehicle = a_vehicle(PX4)
    say(vehicle, Count(2))
    say(vehicle, Item(0, waypoint(0)))
    assert say(vehicle, Count(1, FENCE)) == [Ack(1)]
    assert say(vehicle, Item(1, waypoint(1), FENCE)) == [Ack(1)]


def test_a_legacy_request_is_answered_in_the_old_form_with_float_degrees() -> None:
    for autopilot in (COPTER, PX4):
        vehicle = a_vehicle(autopilot)
        upload(vehicle, [waypoint(0), waypoint(1_234_567, z=9.0)])
        say(vehicle, RequestList())
        say(vehicle, Request(0, legacy=True))
        (answer,) = say(vehicle, Request(1, legacy=True))
        assert type(answer) is LegacyItem
        assert answer.item.x != 367_234_567
        assert answer.item.x == pytest.approx(367_234_567, abs=40)
        assert answer.item.frame == 3


@BOTH
def test_clear_all_empties_one_list_and_count_0_does_too(autopilot: Autopilot) -> None:
    for emptying in (ClearAll(), Count(0)):
        vehicle = a_vehicle(autopilot)
        upload(vehicle, a_mission(3))
        upload(vehicle, [MissionItem(5004, 3, (50.0, 0, 0, 0), 366_000_000, -843_000_000)], FENCE)
        assert say(vehicle, emptying) == [Ack(0)]
        assert vehicle.items() == ()
        assert len(vehicle.items(FENCE)) == 1


@settings(max_examples=draws(150))
@given(
    autopilot=st.sampled_from(list(Autopilot)),
    command=st.integers(0, 65535) | st.sampled_from([16, 17, 18, 19, 20, 21, 22, 31, 84, 85, 93, 177, 178, 5004]),
    frame=st.integers(0, 255) | st.sampled_from([0, 2, 3, 10]),
    params=st.tuples(*[st.floats(width=32)] * 4),
    x=st.integers(-(2**31), 2**31 - 1),
    y=st.integers(-(2**31), 2**31 - 1),
    z=st.floats(width=32),
    mission_type=st.sampled_from([MISSION, FENCE, RALLY]),
)
def test_any_item_is_kept_or_refused_and_keeping_again_changes_nothing(
    autopilot: Autopilot,
    command: int,
    frame: int,
    params: tuple[float, float, float, float],
    x: int,
    y: int,
    z: float,
    mission_type: int,
) -> None:
    vehicle = a_vehicle(autopilot)
    first = MissionItem(16, 3)
    items = [first] if mission_type == MISSION else []
    answer = upload(vehicle, [*items, MissionItem(command, frame, params, x, y, z)], mission_type)
    assert isinstance(answer, Ack)
    if answer.code:
        return
    once = vehicle.items(mission_type)
    assert len(once) == len(items) + 1
    if command not in (18, 19):  # their packed params do not all survive a second packing
        again = upload(vehicle, list(once), mission_type)
        assert isinstance(again, Ack)
        assert again.code == 0
        twice = vehicle.items(mission_type)
        assert [(i.command, i.frame, i.x, i.y) for i in twice] == [(i.command, i.frame, i.x, i.y) for i in once]


def test_a_vehicle_for_a_mission_stands_at_its_home_under_its_name() -> None:
    mission = Mission(PX4, Home.at(36.6, -84.38, 371.0), (waypoint(0),), "uav7", 7)
    vehicle = LoopbackVehicle.for_mission(mission, {"NAV_ACC_RAD": 5.0})
    assert (vehicle.sysid, vehicle.autopilot, vehicle.name) == (7, PX4, "uav7")
    assert vehicle.home == mission.home
    assert vehicle.parameters == {"NAV_ACC_RAD": 5.0}
    assert vehicle.items() == ()
