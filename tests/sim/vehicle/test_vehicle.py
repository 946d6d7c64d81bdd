"""The loopback vehicle: what it answers and keeps, in simulated time, beside what the autopilots' sources say."""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import UsageError
from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, MissionItem, float32
from gcsplan.mavlink.protocol.messages import (
    Ack,
    Address,
    ClearAll,
    Count,
    Item,
    LegacyItem,
    MissionMessage,
    Packet,
    Request,
    RequestList,
)
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour, spoilt
from gcsplan.vehicle import Autopilot
from tests.support.effort import draws

GCS = Address(255, 190)
OTHER_GCS = Address(254, 190)
COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
BOTH = pytest.mark.parametrize("autopilot", [COPTER, PX4])


def a_vehicle(autopilot: Autopilot = COPTER, trouble: str = "", **more: float) -> LoopbackVehicle:
    order = Misbehaviour.parse(trouble)
    return LoopbackVehicle(1, autopilot, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.236, misbehave=order, **more)


def waypoint(n: int, **changes: float) -> MissionItem:
    z = changes.get("z", 60.005 + n)
    params = (changes.get("hold", 0.0), 0.0, 0.0, 0.0)
    return MissionItem(16, int(changes.get("frame", 3)), params, 366_000_000 + n, -843_800_000 - n, z)


def of_cm(cm: int) -> float:
    """How ArduPilot tells whole centimetres: times 0.01 in float32."""
    return float32(float32(0.01) * cm)


def a_mission(n: int) -> list[MissionItem]:
    return [waypoint(i) for i in range(n)]


def say(
    vehicle: LoopbackVehicle, message: MissionMessage, now: float = 0.0, *, source: Address = GCS, sysid: int = 1
) -> list[MissionMessage]:
    answers = vehicle.receive(Packet(source, Address(sysid, 1), message), now)
    assert all(p.source == vehicle.address and p.target == source for p in answers)
    return [p.message for p in answers]


def upload(
    vehicle: LoopbackVehicle, items: list[MissionItem], mission_type: int = MISSION, *, source: Address = GCS
) -> MissionMessage:
    """Send a list the way every ground station does; the last answer."""
    (answer,) = say(vehicle, Count(len(items), mission_type), source=source)
    while isinstance(answer, Request):
        (answer,) = say(vehicle, Item(answer.seq, items[answer.seq], mission_type), source=source)
    return answer


def download(vehicle: LoopbackVehicle, mission_type: int = MISSION) -> list[MissionItem]:
    (count,) = say(vehicle, RequestList(mission_type))
    assert isinstance(count, Count)
    items = []
    for seq in range(count.count):
        (answer,) = say(vehicle, Request(seq, mission_type))
        assert isinstance(answer, Item)
        assert (answer.seq, answer.mission_type) == (seq, mission_type)
        items.append(answer.item)
    assert say(vehicle, Ack(0, mission_type)) == []
    return items


# ── uploads ───────────────────────────────────────────────────────────────────────────────────────────────────────


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


def test_ardupilot_asks_in_the_old_form_and_px4_in_the_new() -> None:
    assert say(a_vehicle(COPTER), Count(3)) == [Request(0, legacy=True)]
    assert say(a_vehicle(PX4), Count(3)) == [Request(0, legacy=False)]


def test_ardupilot_reads_back_its_own_home_at_0() -> None:
    vehicle = a_vehicle()
    assert upload(vehicle, [MissionItem(16, 0, x=1, y=2, z=3.0), waypoint(1)]) == Ack(0)
    assert download(vehicle)[0] == MissionItem(16, 0, x=366_000_000, y=-843_800_000, z=of_cm(37123))


def test_px4_has_no_home_item_and_keeps_floats() -> None:
    vehicle = a_vehicle(PX4)
    upload(vehicle, [waypoint(0, z=17.1234567)])
    assert download(vehicle) == [MissionItem(16, 6, x=366_000_000, y=-843_800_000, z=17.1234567)]


def test_an_empty_ardupilot_still_tells_its_home() -> None:
    vehicle = a_vehicle()
    assert say(vehicle, RequestList()) == [Count(0)]
    (answer,) = say(vehicle, Request(0))
    assert isinstance(answer, Item)
    assert answer.item.x == 366_000_000


def test_count_cuts_the_old_list_at_once_on_ardupilot_and_not_on_px4() -> None:
    for autopilot, left in ((COPTER, 5), (PX4, 12)):
        vehicle = a_vehicle(autopilot)
        upload(vehicle, a_mission(12))
        say(vehicle, Count(5))
        assert len(vehicle.items()) == left


def test_a_refused_item_leaves_a_half_replaced_mission_on_ardupilot_and_the_old_one_on_px4() -> None:
    new = [waypoint(100 + i) for i in range(6)]
    new[4] = MissionItem(9999, 2)
    for autopilot, expected in ((COPTER, [101, 102, 103, 4, 5]), (PX4, [0, 1, 2, 3, 4, 5, 6, 7])):
        vehicle = a_vehicle(autopilot)
        upload(vehicle, a_mission(8))
        assert upload(vehicle, new) == Ack(3)
        kept = vehicle.items()[1:] if autopilot is COPTER else vehicle.items()
        assert [i.x - 366_000_000 for i in kept] == expected


def test_ardupilot_asks_again_each_second_and_gives_up_after_eight() -> None:
    vehicle = a_vehicle()
    say(vehicle, Count(3), 10.0)
    said = []
    while (at := vehicle.deadline) is not None:
        assert vehicle.on_timer(at - 1e-6) == []
        said += [(at - 10.0, p.message) for p in vehicle.on_timer(at)]
    assert said == [*((float(t), Request(0, legacy=True)) for t in range(1, 8)), (8.0, Ack(15))]


def test_px4_asks_again_each_quarter_second_and_gives_up_silently_after_five() -> None:
    vehicle = a_vehicle(PX4)
    say(vehicle, Count(3), 10.0)
    said = []
    while (at := vehicle.deadline) is not None:
        said += [(at - 10.0, p.message) for p in vehicle.on_timer(at)]
    assert said == [(t / 4, Request(0)) for t in range(1, 20)]
    assert say(vehicle, Item(1, waypoint(1)), 20.0) == [Ack(1)]


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


def test_px4_answers_a_second_uploader_with_error_and_ignores_its_items() -> None:
    vehicle = a_vehicle(PX4)
    say(vehicle, Count(3))
    assert say(vehicle, Count(2), source=OTHER_GCS) == [Ack(1)]
    assert say(vehicle, Item(0, waypoint(0)), source=OTHER_GCS) == []
    assert say(vehicle, Count(3)) == [Request(0)]
    say(vehicle, Item(0, waypoint(0)))
    assert say(vehicle, Count(3)) == [Ack(1)]  # busy, and the upload goes on
    assert say(vehicle, Item(1, waypoint(1))) == [Request(2)]


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


# ── downloads and clearing ────────────────────────────────────────────────────────────────────────────────────────


def test_ardupilot_answers_any_request_in_any_order() -> None:
    vehicle = a_vehicle()
    upload(vehicle, a_mission(5))
    for seq in (4, 1, 1, 3):
        (answer,) = say(vehicle, Request(seq))
        assert isinstance(answer, Item)
        assert answer.item.x == 366_000_000 + seq
    assert say(vehicle, Request(5)) == [Count(5), Ack(1)]


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


def test_ardupilot_denies_reading_during_an_upload_only_to_those_who_ask_in_the_new_form() -> None:
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


@BOTH
def test_clear_all_empties_one_list_and_count_0_does_too(autopilot: Autopilot) -> None:
    for emptying in (ClearAll(), Count(0)):
        vehicle = a_vehicle(autopilot)
        upload(vehicle, a_mission(3))
        upload(vehicle, [MissionItem(5004, 3, (50.0, 0, 0, 0), 366_000_000, -843_000_000)], FENCE)
        assert say(vehicle, emptying) == [Ack(0)]
        assert vehicle.items() == ()
        assert len(vehicle.items(FENCE)) == 1


def test_clear_of_all_types_is_px4s_alone() -> None:
    vehicle = a_vehicle(PX4)
    upload(vehicle, a_mission(3))
    assert say(vehicle, ClearAll(255)) == [Ack(0, 255)]
    assert vehicle.items() == ()
    assert say(a_vehicle(), ClearAll(255)) == [Ack(3, 255)]
    assert say(a_vehicle(), RequestList(7)) == [Ack(3, 7)]
    assert say(a_vehicle(), Request(0, 7)) == []


def test_ardupilot_does_not_clear_a_mission_that_it_flies() -> None:
    vehicle = a_vehicle(COPTER, "armed")
    upload(vehicle, a_mission(3))
    assert say(vehicle, ClearAll()) == [Ack(0)]
    upload(vehicle, a_mission(3))
    vehicle.flying_mission = True
    assert say(vehicle, ClearAll()) == [Ack(1)]
    assert len(vehicle.items()) == 3


# ── what is kept ──────────────────────────────────────────────────────────────────────────────────────────────────


def kept(autopilot: Autopilot, item: MissionItem) -> MissionItem | int:
    """What becomes of one mission item: as it reads back, or the code of the refusal."""
    vehicle = a_vehicle(autopilot)
    answer = upload(vehicle, [waypoint(0), item])
    assert isinstance(answer, Ack)
    return answer.code if answer.code else vehicle.items()[1]


def at(command: int, *params: float, frame: int = 3, z: float = 0.0) -> MissionItem:
    p = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(command, frame, (p[0], p[1], p[2], p[3]), 366_000_000, -843_800_000, z)


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


def circle(radius_m: float, frame: int = 3) -> MissionItem:
    return at(5004, radius_m, 7.0, frame=frame, z=9.0)


def vertices(n: int, of: int) -> list[MissionItem]:
    return [at(5002, float(of)) for _ in range(n)]


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


def test_px4_keeps_fences_without_their_frame_and_wants_three_vertices() -> None:
    vehicle = a_vehicle(PX4)
    ack = upload(vehicle, [circle(50.5), *vertices(3, 3)], FENCE)
    assert isinstance(ack, Ack)
    assert (ack.code, ack.mission_type) == (0, FENCE)
    place = {"x": 366_000_000, "y": -843_800_000, "z": 9.0}
    assert vehicle.items(FENCE)[0] == MissionItem(5004, 5, (50.5, 0.0, 0.0, 0.0), **place, autocontinue=False)
    assert upload(vehicle, vertices(2, 2), FENCE) == Ack(1, FENCE)


def test_rally_points_are_kept_in_whole_metres_on_ardupilot() -> None:
    vehicle = a_vehicle()
    assert upload(vehicle, [at(5100, 1.0, z=99.9)], RALLY) == Ack(0, RALLY)
    assert download(vehicle, RALLY) == [MissionItem(5100, 3, x=366_000_000, y=-843_800_000, z=99, autocontinue=False)]
    assert say(vehicle, Request(1, RALLY)) == [Ack(13, RALLY)]
    assert upload(vehicle, [at(5100, frame=2)], RALLY) == Ack(2, RALLY)
    assert upload(vehicle, [at(5100, z=40000.0)], RALLY) == Ack(12, RALLY)
    assert upload(vehicle, [at(16)], RALLY) == Ack(3, RALLY)


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


# ── misbehaviour ──────────────────────────────────────────────────────────────────────────────────────────────────


def test_parsing_a_misbehaviour() -> None:
    order = Misbehaviour.parse("drop=0.1, duplicate=0.05,corrupt=7,corrupt_field=x,armed,seed=3")
    assert order == Misbehaviour(drop=0.1, duplicate=0.05, corrupt=7, corrupt_field="x", armed=True, seed=3)
    assert Misbehaviour.parse(str(order)) == order
    assert Misbehaviour.parse("") == Misbehaviour()


def test_every_mistake_in_a_misbehaviour_is_named_with_its_cure() -> None:
    with pytest.raises(UsageError) as error:
        Misbehaviour.parse("dorp=0.1,delay=often,corrupt=1.5,seed=1,seed=2,armed=perhaps")
    assert [p.message for p in error.value.problems] == [
        "unknown misbehaviour 'dorp'; did you mean drop?",
        "delay wants a number, given 'often'",
        "corrupt wants a whole number, given '1.5'",
        "seed is given twice",
        "armed wants nothing, 1 or 0, given 'perhaps'",
    ]
    with pytest.raises(UsageError, match=r"drop: wants a probability 0 … 1, given 1\.5"):
        Misbehaviour.parse("drop=1.5")


@settings(max_examples=draws(200))
@given(st.text(max_size=60) | st.lists(st.sampled_from(["drop", "seed", "=", ",", "1", "nan", "-3", "x"])).map("".join))
def test_any_text_is_a_misbehaviour_or_a_usage_error(text: str) -> None:
    try:
        order = Misbehaviour.parse(text)
    except UsageError:
        return
    assert Misbehaviour.parse(str(order)) == order


@pytest.mark.parametrize("field", ["x", "y", "z", "param1", "param4", "command", "frame", "autocontinue"])
def test_a_spoilt_item_differs_in_one_field(field: str) -> None:
    for item in (waypoint(3), MissionItem(16, 3, x=2**31 - 1, z=math.nan), MissionItem(17, 0, z=3.4e38)):
        assert spoilt(item, field).wire != item.wire


@BOTH
def test_a_corrupt_item_is_acknowledged_and_reads_back_wrong(autopilot: Autopilot) -> None:
    good, bad = a_vehicle(autopilot), a_vehicle(autopilot, "corrupt=3,corrupt_field=x")
    for vehicle in (good, bad):
        answer = upload(vehicle, a_mission(6))
        assert isinstance(answer, Ack)
        assert answer.code == 0
    differing = [i for i, (a, b) in enumerate(zip(good.items(), bad.items(), strict=True)) if a != b]
    assert differing == [3]
    assert bad.items()[3].x == good.items()[3].x + 1


@BOTH
def test_a_second_ground_station_edits_between_ack_and_read_back(autopilot: Autopilot) -> None:
    vehicle = a_vehicle(autopilot, "edit=2")
    upload(vehicle, a_mission(4))
    right = vehicle.items()
    back = download(vehicle)
    assert [i for i in range(4) if back[i] != right[i]] == [2]
    assert tuple(download(vehicle)) == vehicle.items() == tuple(back)  # once


@BOTH
def test_silent_after_some_messages(autopilot: Autopilot) -> None:
    vehicle = a_vehicle(autopilot, "silent_after=3")
    assert say(vehicle, Count(9))
    assert say(vehicle, Item(0, waypoint(0)))
    assert say(vehicle, Item(1, waypoint(1))) == []
    assert vehicle.deadline is None
    assert not vehicle.reachable(0.0)


def test_a_reboot_keeps_a_half_replaced_mission_on_ardupilot_and_the_old_one_on_px4() -> None:
    for autopilot, expected in ((COPTER, [100, 101, 102, 3]), (PX4, [0, 1, 2, 3, 4, 5])):
        vehicle = a_vehicle(autopilot, "reboot_at=9,reboot_s=2")
        upload(vehicle, a_mission(6))
        say(vehicle, Count(4), 1.0)
        for n in range(3):
            said = say(vehicle, Item(n, waypoint(100 + n)), 1.0)
        assert said == []
        assert say(vehicle, RequestList(), 1.5) == []  # dead
        assert vehicle.booting(2.5)
        assert say(vehicle, Count(4), 2.5) == ([Ack(4)] if autopilot is COPTER else [])
        assert not vehicle.booting(3.0)
        offsets = [i.x - 366_000_000 for i in vehicle.items()]
        assert offsets[1:] == expected[1:]


def test_a_reboot_may_lose_the_mission() -> None:
    vehicle = a_vehicle(PX4, "reboot_at=7,reboot_loses")
    upload(vehicle, a_mission(6))
    say(vehicle, Count(4))
    say(vehicle, Item(0, waypoint(9)))
    assert vehicle.items() == ()


@BOTH
def test_refusing_an_item_with_a_code(autopilot: Autopilot) -> None:
    vehicle = a_vehicle(autopilot, "refuse=2,refuse_code=10")
    assert upload(vehicle, a_mission(5)) == Ack(10)
    assert vehicle.deadline is None


@BOTH
def test_no_space_for_ever(autopilot: Autopilot) -> None:
    vehicle = a_vehicle(autopilot, "no_space")
    for now in (0.0, 100.0):
        assert say(vehicle, Count(1), now) == [Ack(4)]
    assert say(vehicle, Count(0)) == [Ack(0)]


def test_a_stray_vehicle_lies_ahead_of_every_answer() -> None:
    vehicle = a_vehicle(COPTER, "stray_sysid=9")
    answers = vehicle.receive(Packet(GCS, Address(1, 1), Count(3)), 0.0)
    assert [(p.source.sysid, p.message) for p in answers] == [
        (9, Ack(0)),
        (9, Request(65535)),
        (1, Request(0, legacy=True)),
    ]


def test_a_stale_mission_type_lies_ahead_of_every_answer() -> None:
    vehicle = a_vehicle(COPTER, "stale_type=1")
    answers = vehicle.receive(Packet(GCS, Address(1, 1), Count(3)), 0.0)
    assert [p.message for p in answers] == [Ack(0, FENCE), Request(65535, FENCE), Request(0, legacy=True)]
    upload_of_that_type = vehicle.receive(Packet(GCS, Address(1, 1), Count(1, FENCE)), 0.0)
    assert len(upload_of_that_type) == 1


def test_answers_may_carry_a_foreign_system_id() -> None:
    (answer,) = a_vehicle(COPTER, "answer_sysid=7").receive(Packet(GCS, Address(1, 1), Count(3)), 0.0)
    assert answer.source == Address(7, 1)


def test_a_certain_drop_answers_nothing_and_a_certain_duplicate_everything_twice() -> None:
    assert say(a_vehicle(COPTER, "drop=1"), Count(3)) == []
    vehicle = a_vehicle(PX4, "duplicate=1")
    assert say(vehicle, Count(3)) == [Request(0)] * 4  # twice in, each answer twice out


def test_a_delayed_answer_comes_by_the_timer_and_a_reordered_one_after_the_next() -> None:
    vehicle = a_vehicle(PX4, "delay=1,delay_s=0.2,seed=5")
    assert say(vehicle, Count(3)) == []
    out = []
    while not out:
        assert vehicle.deadline is not None
        out = vehicle.on_timer(vehicle.deadline)
    assert out[0].message == Request(0)
    vehicle = a_vehicle(COPTER, "reorder=1")
    upload_started = say(vehicle, RequestList())
    assert upload_started == []
    assert vehicle.deadline == pytest.approx(0.2)


@settings(max_examples=draws(60))
@given(
    seed=st.integers(0, 2**32), autopilot=st.sampled_from([COPTER, PX4]), drop=st.sampled_from([0.0, 0.1, 0.3]),
    trouble=st.sampled_from(["", "duplicate=0.3", "reorder=0.3", "delay=0.3,delay_s=0.6"]),
)  # fmt: skip
def test_what_px4_and_ardupilot_ack_they_hold_over_a_bad_link(
    seed: int, autopilot: Autopilot, drop: float, trouble: str
) -> None:
    """A patient ground station that answers every request: an upload that was accepted in time is on board."""
    vehicle = a_vehicle(autopilot, f"drop={drop},seed={seed},{trouble}")
    items = a_mission(12)
    now, counted, accepted = 0.0, -9.0, False
    todo: list[MissionMessage] = []
    for _ in range(3000):
        if now - counted > 9.0:
            todo.append(Count(12))
            counted = now
        packets = vehicle.receive(Packet(GCS, Address(1, 1), todo.pop(0)), now) if todo else vehicle.on_timer(now)
        for packet in packets:
            if isinstance(packet.message, Request):
                todo.append(Item(packet.message.seq, items[packet.message.seq]))
                counted = now
            elif packet.message == Ack(0) or (isinstance(packet.message, Ack) and packet.message.opaque_id):
                accepted = True
        if accepted and not todo:
            break
        due = min(vehicle.deadline if vehicle.deadline is not None else math.inf, counted + 9.001)
        now = max(now, due) if not todo else now
    assert accepted
    if autopilot is COPTER:
        assert [i.x for i in vehicle.items()[1:]] == [i.x for i in items[1:]]


def test_the_same_seed_gives_the_same_run_and_another_another() -> None:
    def run(seed: int) -> list[int]:
        vehicle = a_vehicle(PX4, f"drop=0.3,duplicate=0.2,seed={seed}")
        rng = random.Random(1)
        return [len(say(vehicle, rng.choice([RequestList(), Request(0), Ack(0)]), t / 10)) for t in range(200)]

    assert run(1) == run(1) != run(2)


def test_a_bad_link_holds_back_a_bounded_number_of_packets() -> None:
    vehicle = a_vehicle(COPTER, "delay=1,delay_s=3600")
    for _ in range(5000):
        vehicle.receive(Packet(GCS, Address(1, 1), RequestList()), 0.0)
    assert len(vehicle.on_timer(3600.0)) <= 1000
