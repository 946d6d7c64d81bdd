"""ArduPilot's side of the mission protocol, and what it keeps of an item and refuses, beside what its sources say."""

from __future__ import annotations

import math

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
from gcsplan.sim.vehicle.ardupilot import (
    ArduPilotServer,
    fence_is_valid,
    fence_storage_bytes,
    in_whole_centimetres,
    keep_mission_item,
    most_items,
)
from gcsplan.sim.vehicle.firmware import firmware_of
from gcsplan.sim.vehicle.misbehaviour import Faults, Misbehaviour
from gcsplan.sim.vehicle.stored_lists import Board, ItemRefused
from tests.support.loopback import (
    COPTER,
    GCS,
    OTHER_GCS,
    PLANE,
    PX4,
    a_mission,
    a_vehicle,
    at,
    circle,
    download,
    kept,
    of_cm,
    say,
    upload,
    vertices,
    waypoint,
)


def test_altitudes_are_cut_to_centimetres_as_the_aircraft_did_it() -> None:
    # Measured on ArduCopter: 17.13 reads back as 17.12, and a centimetre plus half of one as that centimetre.
    vehicle = a_vehicle()
    centimetres = [*range(0, 6000, 10), 829_999, 8_299_998]
    sent = [waypoint(0), at(16, z=17.13), *(at(16, z=(cm + 0.5) / 100) for cm in centimetres)]
    assert upload(vehicle, sent) == Ack(0)
    assert [i.z for i in vehicle.items()[1:]] == [of_cm(1712), *(of_cm(cm) for cm in centimetres)]


@pytest.mark.parametrize(
    ("sent", "back"),
    [
        (at(16, 1.9, 5.0, 6.0, 90.0), at(16, 1.0)),  # hold whole seconds, no radius, no yaw
        (at(16, 70000.0), at(16, 4464.0)),
        (at(16, 0, 0, 0, math.nan), at(16)),
        (at(19, 12.7, 3.0, -40.0, 1.0), at(19, 12.0, 0.0, -1.0, 1.0)),
        (at(17, 1.0, 2.0, -40.7, 4.0), at(17, 0.0, 0.0, -40.0)),
        (at(18, 0.5, 0.0, 1234.0), at(18, 0.5, 0.0, 1230.0)),
        (at(18, 300.0, 0.0, -20.7, 1.0), at(18, 255.0, 0.0, -20.0, 1.0)),
        (at(18, -1.0, 0.0, 17.0), at(18, 255.0, 0.0, 255.0)),  # negative turns spill into the radius
        (at(21, 0.0, 0.0, 0.0, 0.0), at(21, 0.0, 0.0, 0.0, 1.0)),
        (at(22, 15.0, 1.0, 1.0, math.nan), at(22, 15.0)),
        (at(16, frame=2), at(16, frame=0)),
        (at(16, frame=5), at(16, frame=0)),
        (at(16, frame=6), at(16, frame=3)),
        (at(16, frame=11), at(16, frame=10)),
        (at(178, 1.0, 4.37, -1.0, 9.0, frame=2), MissionItem(178, 0, (1.0, 4.37, -1.0, 0.0))),
        (at(93, 2.5, -1.0, 300.0, -1.0, frame=2), MissionItem(93, 0, (2.5, -1.0, 44.0, -1.0))),
        (at(20, frame=2), MissionItem(20, 0)),
    ],
)
def test_arducopter_keeps(sent: MissionItem, back: MissionItem) -> None:
    got = kept(COPTER, sent)
    assert isinstance(got, MissionItem)
    assert got.wire == back.wire


@pytest.mark.parametrize(
    ("sent", "code"),
    [
        (at(16, frame=1), 2),
        (at(16, frame=7), 2),
        (at(19, 0, 0, 0, math.nan), 9),
        (at(82, 0, 0, 0, math.nan), 9),
        (at(16, math.inf), 6),
        (at(16, 0, math.nan), 7),
        (at(16, z=83000.0), 12),
        (at(16, z=math.nan), 12),
        (MissionItem(16, 3, x=900_000_100), 10),
        (MissionItem(16, 3, y=1_800_000_200), 11),
        (MissionItem(4242, 2), 3),
        (MissionItem(1, 2), 5),
        (MissionItem(177, 2, (9.0, 1.0, 0.0, 0.0)), 1),
        (MissionItem(177, 2), 1),
    ],
)
def test_arducopter_refuses(sent: MissionItem, code: int) -> None:
    assert kept(COPTER, sent) == code


def test_arduplane_keeps_radii_in_bytes_and_refuses_splines() -> None:
    got = kept(PLANE, at(16, 3.0, 300.7, 12.9, 90.0))
    assert isinstance(got, MissionItem)
    assert got.params == (0.0, 255.0, 12.0, 0.0)
    assert kept(PLANE, at(82)) == 3


def test_ardupilot_takes_a_fence_whole_or_not_at_all() -> None:
    vehicle = a_vehicle()
    assert upload(vehicle, [circle(50.5), *vertices(3, 3)], FENCE) == Ack(0, FENCE)
    before = vehicle.items(FENCE)
    assert before[0] == MissionItem(5004, 0, (50.5, 0, 0, 0), 366_000_000, -843_800_000, 0.0, autocontinue=False)
    for fence, code in (
        ([circle(50.0, frame=2)], 2),
        ([circle(-1.0)], 1),
        ([circle(math.nan)], 1),
        (vertices(2, 3), 1),
        (vertices(2, 2), 1),
        ([*vertices(2, 4), circle(9.0), *vertices(2, 4)], 1),
        (vertices(3, 300), 6),
        ([circle(9.0)] * 43, 1),
        ([circle(9.0)] * 71, 4),
        ([waypoint(0)], 3),
    ):
        assert upload(vehicle, fence, FENCE) == Ack(code, FENCE)
        assert vehicle.items(FENCE) == before
    assert upload(vehicle, [circle(9.0)] * 42, FENCE) == Ack(0, FENCE)
    assert say(vehicle, Request(42, FENCE)) == [Ack(1, FENCE)]
    assert say(vehicle, Request(43, FENCE)) == [Ack(13, FENCE)]


def test_rally_points_are_kept_in_whole_metres_on_ardupilot() -> None:
    vehicle = a_vehicle()
    assert upload(vehicle, [at(5100, 1.0, z=99.9)], RALLY) == Ack(0, RALLY)
    assert download(vehicle, RALLY) == [MissionItem(5100, 3, x=366_000_000, y=-843_800_000, z=99, autocontinue=False)]
    assert say(vehicle, Request(1, RALLY)) == [Ack(13, RALLY)]
    assert upload(vehicle, [at(5100, frame=2)], RALLY) == Ack(2, RALLY)
    assert upload(vehicle, [at(5100, z=40000.0)], RALLY) == Ack(12, RALLY)
    assert upload(vehicle, [at(16)], RALLY) == Ack(3, RALLY)


def test_a_plane_has_more_room_than_a_copter() -> None:
    assert [most_items(kind, plane=False) for kind in (MISSION, FENCE, RALLY)] == [650, 70, 46]
    assert [most_items(kind, plane=True) for kind in (MISSION, FENCE, RALLY)] == [655, 84, 50]
    circles = [circle(9.0)] * 51
    for plane, fits in ((False, 42), (True, 51)):
        room = fence_storage_bytes(plane=plane)
        assert fence_is_valid(circles[:fits], room)
        assert not fence_is_valid([*circles, circle(9.0)][: fits + 1], room)


def test_an_arc_is_kept_by_those_that_know_arcs_and_refused_by_the_others() -> None:
    arc = at(36, 10.0, 0.5, 3.0, 4.0)
    assert keep_mission_item(arc, plane=False, arcs=True).params == (10.0, 0.5, 3.0, 4.0)
    with pytest.raises(ItemRefused) as refused:
        keep_mission_item(arc, plane=False, arcs=False)
    assert refused.value.code == 3


@pytest.mark.parametrize(("sent_m", "centimetres"), [(17.13, 1712), (17.12, 1712), (-0.019, -1), (0.0, 0)])
def test_an_altitude_is_cut_towards_zero_in_whole_centimetres(sent_m: float, centimetres: int) -> None:
    assert in_whole_centimetres(sent_m) == of_cm(centimetres)


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
