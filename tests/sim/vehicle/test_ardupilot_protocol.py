"""ArduPilot's side of the mission protocol, beside what its sources say."""

from __future__ import annotations

import pytest

from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, Home, MissionItem
from gcsplan.mavlink.protocol.messages import (
    Ack,
    ClearAll,
    Count,
    Item,
    LegacyItem,
    Request,
    RequestList,
)
from gcsplan.sim.vehicle.ardupilot_protocol import ArduPilotServer
from gcsplan.sim.vehicle.firmware import firmware_of
from gcsplan.sim.vehicle.misbehaviour import Faults, Misbehaviour
from gcsplan.sim.vehicle.stored_lists import Board
from tests.support.loopback import (
    COPTER,
    GCS,
    OTHER_GCS,
    PX4,
    a_mission,
    a_vehicle,
    circle,
    download,
    of_cm,
    say,
    upload,
    waypoint,
)


def test_ardupilot_asks_in_the_old_form_and_px4_in_the_new() -> None:
    assert say(a_vehicle(COPTER), Count(3)) == [Request(0, legacy=True)]
    assert say(a_vehicle(PX4), Count(3)) == [Request(0, legacy=False)]


def test_ardupilot_reads_back_its_own_home_at_0() -> None:
    vehicle = a_vehicle()
    assert upload(vehicle, [MissionItem(16, 0, x=1, y=2, z=3.0), waypoint(1)]) == Ack(0)
    assert download(vehicle)[0] == MissionItem(16, 0, x=366_000_000, y=-843_800_000, z=of_cm(37123))


def test_an_empty_ardupilot_still_tells_its_home() -> None:
    vehicle = a_vehicle()
    assert say(vehicle, RequestList()) == [Count(0)]
    (answer,) = say(vehicle, Request(0))
    assert isinstance(answer, Item)
    assert answer.item.x == 366_000_000


def test_ardupilot_asks_again_each_second_and_gives_up_after_eight() -> None:
    vehicle = a_vehicle()
    say(vehicle, Count(3), 10.0)
    said = []
    while (at := vehicle.deadline) is not None:
        assert vehicle.on_timer(at - 1e-6) == []
        said += [(at - 10.0, p.message) for p in vehicle.on_timer(at)]
    assert said == [*((float(t), Request(0, legacy=True)) for t in range(1, 8)), (8.0, Ack(15))]


def test_a_second_uploader_is_denied_and_the_first_may_start_again() -> None:
    vehicle = a_vehicle()
    say(vehicle, Count(3))
    say(vehicle, Item(0, waypoint(0)))
    assert say(vehicle, Count(2), source=OTHER_GCS) == [Ack(14)]
    assert say(vehicle, Item(1, waypoint(1)), source=OTHER_GCS) == [Ack(14)]
    assert say(vehicle, RequestList(), source=OTHER_GCS) == [Ack(14)]
    assert say(vehicle, ClearAll(), source=OTHER_GCS) == [Ack(14), Ack(1)]
    assert say(vehicle, RequestList()) == [Ack(14)]  # nor may the uploader read meanwhile
    assert say(vehicle, Count(2)) == [Request(0, legacy=True)]


def test_ardupilot_answers_any_request_in_any_order() -> None:
    vehicle = a_vehicle()
    upload(vehicle, a_mission(5))
    for seq in (4, 1, 1, 3):
        (answer,) = say(vehicle, Request(seq))
        assert isinstance(answer, Item)
        assert answer.item.x == 366_000_000 + seq
    assert say(vehicle, Request(5)) == [Count(5), Ack(1)]


def test_during_an_upload_ardupilot_denies_reading_in_the_new_form_alone() -> None:
    vehicle = a_vehicle()
    upload(vehicle, a_mission(3))
    say(vehicle, Count(3))
    assert say(vehicle, Request(1)) == [Ack(14)]
    assert type(say(vehicle, Request(1, legacy=True))[0]) is LegacyItem


def test_ardupilots_fence_and_rally_points_have_float_degrees_in_the_old_form() -> None:
    vehicle = a_vehicle()
    upload(vehicle, [circle(30.0)], FENCE)
    upload(vehicle, [MissionItem(5100, 3, x=366_000_001, y=-843_800_001, z=60.0)], RALLY)
    for kind in (FENCE, RALLY):
        (answer,) = say(vehicle, Request(0, kind, legacy=True))
        assert isinstance(answer, LegacyItem)
        (exact,) = download(vehicle, kind)
        assert (answer.item.x, answer.item.y) == pytest.approx((exact.x, exact.y), abs=50)  # 0.4 m
        assert answer.item.params == exact.params


def test_ardupilot_does_not_clear_a_mission_that_it_flies() -> None:
    vehicle = a_vehicle(COPTER, "armed")
    upload(vehicle, a_mission(3))
    assert say(vehicle, ClearAll()) == [Ack(0)]
    upload(vehicle, a_mission(3))
    vehicle.flying_mission = True
    assert say(vehicle, ClearAll()) == [Ack(1)]
    assert len(vehicle.items()) == 3


def test_each_list_has_its_own_timer_and_a_reset_ends_them_all() -> None:
    board = Board(Home(0, 0, 0.0))
    server = ArduPilotServer(board, Faults(Misbehaviour()), firmware_of(COPTER), plane=False)
    assert server.deadline is None
    assert server.receive(Count(3), GCS, 10.0) == [(GCS, Request(0, legacy=True))]
    assert server.receive(Count(2, FENCE), OTHER_GCS, 10.4) == [(OTHER_GCS, Request(0, FENCE, legacy=True))]
    assert server.deadline == 11.0
    assert server.on_timer(11.0) == [(GCS, Request(0, legacy=True))]
    assert server.deadline == 11.4
    server.reset()
    assert server.deadline is None
    assert server.receive(RequestList(MISSION), GCS, 12.0) == [(GCS, Count(0))]
