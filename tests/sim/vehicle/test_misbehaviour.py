"""Intentional faults: read from text, seen by a ground station, and the same for the same seed."""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import UsageError
from gcsplan.mavlink.mission.mission import FENCE, MissionItem
from gcsplan.mavlink.protocol.messages import (
    Ack,
    Address,
    Count,
    Item,
    MissionMessage,
    Packet,
    Request,
    RequestList,
)
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour, spoilt
from gcsplan.vehicle import Autopilot
from tests.support.effort import draws
from tests.support.loopback import BOTH, COPTER, GCS, PX4, a_mission, a_vehicle, download, say, upload, waypoint


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
    vehicle.on_timer(3600.0)  # now the answers are held back
    assert len(vehicle.on_timer(7200.0)) == 1000
