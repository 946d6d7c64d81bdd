"""PX4's side of the mission protocol, and what it keeps of an item and refuses, beside what its sources say."""

from __future__ import annotations

import math

import pytest

from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, Home, MissionItem
from gcsplan.mavlink.protocol.messages import (
    Ack,
    Address,
    ClearAll,
    Count,
    Item,
    Request,
    RequestList,
)
from gcsplan.sim.vehicle.firmware import firmware_of
from gcsplan.sim.vehicle.misbehaviour import Faults, Misbehaviour
from gcsplan.sim.vehicle.px4 import Px4Server, keep_item, most_items
from gcsplan.sim.vehicle.stored_lists import Board, ItemRefused
from tests.support.loopback import (
    OTHER_GCS,
    PX4,
    a_mission,
    a_vehicle,
    at,
    circle,
    download,
    kept,
    say,
    upload,
    vertices,
    waypoint,
)


@pytest.mark.parametrize(
    ("sent", "back"),
    [
        (at(16, 1.9, 5.5, 6.0, math.nan, z=17.13), at(16, 1.9, 5.5, 0.0, math.nan, frame=6, z=17.13)),
        (at(16, frame=0), at(16, frame=5)),
        (at(22, 15.0, 0, 0, math.nan), at(22, 0, 0, 0, math.nan, frame=6)),
        (at(21, 5.0, 2.0, 0, 0), at(21, 0, 2.0, 0, 0, frame=6)),
        (at(16, 0, 0, 0, 0.0), at(16, frame=6)),
        (MissionItem(178, 2, (1.0, 4.37, -1.0, 9.0)), MissionItem(178, 2, (1.0, 4.37, -1.0, 9.0))),
        (MissionItem(93, 2, (2.5, -1.0, -1.0, -1.0)), MissionItem(93, 2, (2.5, -1.0, -1.0, -1.0))),
        (MissionItem(20, 2), MissionItem(20, 2)),
    ],
)
def test_px4_keeps(sent: MissionItem, back: MissionItem) -> None:
    got = kept(PX4, sent)
    assert isinstance(got, MissionItem)
    assert got.wire == back.wire


def test_px4_wraps_headings() -> None:
    for sent, back in ((-90.0, 270.0), (90.0, 90.0), (450.0, 90.0)):
        got = kept(PX4, at(16, 0, 0, 0, sent))
        assert isinstance(got, MissionItem)
        assert got.params[3] == pytest.approx(back, abs=1e-4)


@pytest.mark.parametrize(
    ("sent", "code"),
    [
        (at(16, frame=10), 2),
        (at(16, frame=11), 2),
        (at(16, frame=2), 3),
        (at(178, frame=3), 3),
        (at(93, frame=0), 3),
        (at(20, frame=3), 3),
        (at(5004, 50.0), 1),
        (MissionItem(201, 2, (3.0, 0.0, 0.0, 0.0)), 6),
    ],
)
def test_px4_refuses(sent: MissionItem, code: int) -> None:
    assert kept(PX4, sent) == code


def test_px4_keeps_fences_without_their_frame_and_wants_three_vertices() -> None:
    vehicle = a_vehicle(PX4)
    ack = upload(vehicle, [circle(50.5), *vertices(3, 3)], FENCE)
    assert isinstance(ack, Ack)
    assert (ack.code, ack.mission_type) == (0, FENCE)
    place = {"x": 366_000_000, "y": -843_800_000, "z": 9.0}
    assert vehicle.items(FENCE)[0] == MissionItem(5004, 5, (50.5, 0.0, 0.0, 0.0), **place, autocontinue=False)
    assert upload(vehicle, vertices(2, 2), FENCE) == Ack(1, FENCE)


def test_the_most_items_of_each_list() -> None:
    assert [most_items(kind) for kind in (MISSION, FENCE, RALLY)] == [2000, 64, 32]


def test_a_command_that_a_version_does_not_know_is_refused() -> None:
    arm = MissionItem(400, 2, (1.0, 0.0, 0.0, 0.0))
    assert keep_item(arm, MISSION).params == (1.0, 0.0, 0.0, 0.0)
    with pytest.raises(ItemRefused) as refused:
        keep_item(arm, MISSION, unknown={400})
    assert refused.value.code == 3


def test_a_region_of_interest_reads_back_under_its_newer_name() -> None:
    assert keep_item(MissionItem(80, 2), MISSION).command == 201
    assert keep_item(MissionItem(80, 3, (3.0, 0.0, 0.0, 0.0)), MISSION).params == (0.0, 0.0, 0.0, 0.0)


def test_px4_has_no_home_item_and_keeps_floats() -> None:
    vehicle = a_vehicle(PX4)
    upload(vehicle, [waypoint(0, z=17.1234567)])
    assert download(vehicle) == [MissionItem(16, 6, x=366_000_000, y=-843_800_000, z=17.1234567)]


def test_px4_asks_again_each_quarter_second_and_gives_up_silently_after_five() -> None:
    vehicle = a_vehicle(PX4)
    say(vehicle, Count(3), 10.0)
    said = []
    while (at := vehicle.deadline) is not None:
        said += [(at - 10.0, p.message) for p in vehicle.on_timer(at)]
    assert said == [(t / 4, Request(0)) for t in range(1, 20)]
    assert say(vehicle, Item(1, waypoint(1)), 20.0) == [Ack(1)]


def test_px4_acks_a_late_item_of_an_upload_that_it_gave_up() -> None:
    # It takes it for the duplicate of a last item: an ACK that means nothing, and a reason to read back.
    vehicle = a_vehicle(PX4)
    say(vehicle, Count(9), 0.0)
    say(vehicle, Item(0, waypoint(0)), 0.0)
    vehicle.on_timer(5.0)
    (answer,) = say(vehicle, Item(0, waypoint(0)), 6.0)
    assert isinstance(answer, Ack)
    assert answer.code == 0
    assert vehicle.items() == ()


def test_px4_answers_a_second_uploader_with_error_and_ignores_its_items() -> None:
    vehicle = a_vehicle(PX4)
    say(vehicle, Count(3))
    assert say(vehicle, Count(2), source=OTHER_GCS) == [Ack(1)]
    assert say(vehicle, Item(0, waypoint(0)), source=OTHER_GCS) == []
    assert say(vehicle, Count(3)) == [Request(0)]
    say(vehicle, Item(0, waypoint(0)))
    assert say(vehicle, Count(3)) == [Ack(1)]  # busy, and the upload goes on
    assert say(vehicle, Item(1, waypoint(1))) == [Request(2)]


def test_px4_wants_requests_in_order_and_ends_the_download_otherwise() -> None:
    vehicle = a_vehicle(PX4)
    upload(vehicle, a_mission(5))
    assert say(vehicle, Request(0)) == []  # no download is going on
    say(vehicle, RequestList())
    for seq in (0, 0, 1):
        assert isinstance(say(vehicle, Request(seq))[0], Item)
    assert say(vehicle, Request(4)) == [Ack(1)]
    assert say(vehicle, Request(2)) == []


def test_px4_is_busy_until_a_download_is_acknowledged_or_forgotten() -> None:
    vehicle = a_vehicle(PX4)
    upload(vehicle, a_mission(2))
    say(vehicle, RequestList(), 1.0)
    assert say(vehicle, Count(2), 1.0) == [Ack(1)]
    assert say(vehicle, ClearAll(), 1.0) == []
    assert say(vehicle, Count(2), 6.1) == [Request(0)]


def test_clear_of_all_types_is_px4s_alone() -> None:
    vehicle = a_vehicle(PX4)
    upload(vehicle, a_mission(3))
    assert say(vehicle, ClearAll(255)) == [Ack(0, 255)]
    assert vehicle.items() == ()
    assert say(a_vehicle(), ClearAll(255)) == [Ack(3, 255)]
    assert say(a_vehicle(), RequestList(7)) == [Ack(3, 7)]
    assert say(a_vehicle(), Request(0, 7)) == []


def test_the_new_list_replaces_the_old_one_at_its_last_item() -> None:
    board = Board(Home(0, 0, 0.0))
    board.lists[MISSION] = [waypoint(7)]
    server, station = Px4Server(board, Faults(Misbehaviour()), firmware_of(PX4)), Address(255, 190)
    assert server.receive(Count(2), station, 0.0) == [(station, Request(0))]
    assert server.receive(Item(0, waypoint(0)), station, 0.1) == [(station, Request(1))]
    assert [i.x for i in board.lists[MISSION]] == [waypoint(7).x]
    ((to, ack),) = server.receive(Item(1, waypoint(1)), station, 0.2)
    assert isinstance(ack, Ack)
    assert (to, ack.code, board.uploads) == (station, 0, 1)
    assert [i.x for i in board.lists[MISSION]] == [waypoint(0).x, waypoint(1).x]
    assert server.deadline is None


def test_a_mission_type_without_a_list_has_no_space() -> None:
    server, station = Px4Server(Board(Home(0, 0, 0.0)), Faults(Misbehaviour()), firmware_of(PX4)), Address(255, 190)
    assert server.receive(Count(1, 7), station, 0.0) == [(station, Ack(4, 7))]
    assert server.receive(Count(0, 7), station, 0.0) == [(station, Ack(0, 7))]
    assert server.receive(RequestList(7), station, 0.0) == [(station, Count(0, 7, 0))]
