"""PX4's side of the mission protocol, beside what its sources say."""

from __future__ import annotations

from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.mavlink.protocol.messages import (
    Ack,
    ClearAll,
    Count,
    Item,
    Request,
    RequestList,
)
from tests.support.loopback import OTHER_GCS, PX4, a_mission, a_vehicle, download, say, upload, waypoint


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
