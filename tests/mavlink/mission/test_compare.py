"""Comparing what was read back with what was sent."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcsplan.mavlink.mission.autopilots import altitude_of_cm, stored
from gcsplan.mavlink.mission.compare import command_name, compare, faults
from gcsplan.mavlink.mission.mission import FENCE, RALLY, Home, MissionItem, float32
from gcsplan.mavlink.mission.stored_ardupilot import read_back_altitudes
from gcsplan.vehicle import Autopilot

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
HOME = Home.at(36.6, -84.38, 371.0)


def mission(autopilot: Autopilot) -> list[MissionItem]:
    z = altitude_of_cm(6000, autopilot)
    items = [
        MissionItem(22, 3, (0.0, 0.0, 0.0, 0.0), 366_000_000, -843_800_000, z),
        MissionItem(178, 2, (1.0, 4.37, -1.0, 0.0)),
        MissionItem(16, 3, (2.0, 0.0, 0.0, 0.0), 366_010_000, -843_790_000, z),
        MissionItem(16, 0, (0.0, 0.0, 0.0, 0.0), 366_020_000, -843_780_000, altitude_of_cm(45_013, autopilot)),
        MissionItem(21, 3, (0.0, 0.0, 0.0, 0.0), 366_030_000, -843_770_000, 0.0),
    ]
    return [HOME.as_item(), *items] if autopilot.is_ardupilot else items


def read_back(sent: list[MissionItem], autopilot: Autopilot) -> list[MissionItem]:
    return [stored(item, autopilot) for item in sent]


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_what_the_autopilot_keeps_is_no_difference(autopilot: Autopilot) -> None:
    sent = mission(autopilot)
    assert compare(sent, read_back(sent, autopilot), autopilot) == []


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_a_peer_that_keeps_everything_as_sent_is_no_difference(autopilot: Autopilot) -> None:
    sent = mission(autopilot)
    assert compare(sent, sent, autopilot) == []


@pytest.mark.parametrize("autopilot", list(Autopilot))
@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("latitude", {"x": 366_010_001}),
        ("longitude", {"y": -843_790_001}),
        ("altitude", {"z": 60.01}),
        ("altitude", {"z": 59.99}),
        ("altitude", {"z": math.nan}),
        ("param1", {"params": (3.0, 0.0, 0.0, 0.0)}),
        ("param4", {"params": (2.0, 0.0, 0.0, 0.5)}),
        ("frame", {"frame": 0}),
        ("frame", {"frame": 10}),
        ("command", {"command": 17}),
        ("autocontinue", {"autocontinue": False}),
    ],
)
def test_one_changed_number_is_found_and_named(autopilot: Autopilot, field: str, change: dict[str, object]) -> None:
    sent = mission(autopilot)
    read = read_back(sent, autopilot)
    seq = 3 if autopilot.is_ardupilot else 2
    read[seq] = replace(read[seq], **change)  # type: ignore[arg-type]
    (difference,) = compare(sent, read, autopilot)
    assert (difference.seq, difference.field, difference.excused) == (seq, field, False)
    words = str(difference)
    assert f"item {seq}" in words
    assert field in words
    assert difference.read in words


def test_the_least_float32_step_in_altitude_is_a_difference_on_px4() -> None:
    sent = mission(PX4)
    read = read_back(sent, PX4)
    read[2] = replace(read[2], z=math.nextafter(read[2].z, math.inf) + 4e-6)
    assert [d.field for d in compare(sent, read, PX4)] == ["altitude"]


def test_either_float32_of_the_same_centimetres_is_taken_from_ardupilot() -> None:
    two = next(pair for pair in map(read_back_altitudes, range(1, 100_000)) if pair[0] != pair[1])
    cm = round(two[0] * 100)
    sent = [HOME.as_item(), MissionItem(16, 3, z=altitude_of_cm(cm, COPTER))]
    for z in two:
        assert compare(sent, [HOME.as_item(), MissionItem(16, 3, z=z)], COPTER) == []
    assert compare(sent, [HOME.as_item(), MissionItem(16, 3, z=two[0] + 0.01)], COPTER)


def test_a_missing_and_a_surplus_item_are_named() -> None:
    sent = mission(COPTER)
    read = read_back(sent, COPTER)
    for other in (read[:-1], [*read, read[-1]], []):
        (difference,) = compare(sent, other, COPTER)
        assert difference.seq == -1
        assert f"sent {len(sent)}, read back {len(other)}" in str(difference)


def test_the_vehicles_own_home_is_reported_and_excused() -> None:
    sent = mission(COPTER)
    read = read_back(sent, COPTER)
    read[0] = Home.at(0.0, 0.0, 0.0).as_item()
    (difference,) = compare(sent, read, COPTER)
    assert difference.excused
    assert faults([difference]) == ()
    assert "vehicle's own" in str(difference)


def test_on_px4_the_first_item_is_not_home() -> None:
    sent = mission(PX4)
    read = read_back(sent, PX4)
    read[0] = replace(read[0], x=0)
    assert [(d.seq, d.excused) for d in faults(compare(sent, read, PX4))] == [(0, False)]


def test_in_a_fence_the_first_item_is_not_home_and_autocontinue_means_nothing() -> None:
    sent = [MissionItem(5004, 3, (50.0 + n, 0.0, 0.0, 0.0), 366_000_000 + n, -843_800_000) for n in range(3)]
    for autopilot in Autopilot:
        assert compare(sent, read_back(sent, autopilot), autopilot, FENCE) == []
        wrong = read_back(sent, autopilot)
        wrong[0] = replace(wrong[0], params=(51.0, 0.0, 0.0, 0.0))
        assert [d.seq for d in faults(compare(sent, wrong, autopilot, FENCE))] == [0]


def test_rally_points_are_compared_in_whole_metres_on_ardupilot() -> None:
    sent = [MissionItem(5100, 3, (0.0, 0.0, 0.0, 0.0), 366_000_000, -843_800_000, 20.7)]
    assert compare(sent, [replace(sent[0], z=20.0, autocontinue=False)], COPTER, RALLY) == []
    assert compare(sent, [replace(sent[0], z=21.0)], COPTER, RALLY)


def test_synonyms_of_frames_are_the_same_frame() -> None:
    sent = mission(PX4)
    read = [replace(i, frame={0: 5, 3: 6}.get(i.frame, i.frame)) for i in read_back(sent, PX4)]
    assert compare(sent, read, PX4) == []


def test_nan_equals_nan_and_nothing_else() -> None:
    sent = [MissionItem(22, 3, (0.0, 0.0, 0.0, math.nan), 366_000_000, -843_800_000, 60.0)]
    assert compare(sent, sent, PX4) == []
    assert compare(sent, [replace(sent[0], params=(0.0, 0.0, 0.0, 0.0))], PX4)


@pytest.mark.parametrize(
    ("sent_yaw", "read_yaw", "same"), [(-90.0, 270.0, True), (10.0, 10.0002, True), (10.0, 10.1, False)]
)
def test_px4s_yaw_is_compared_as_an_angle(sent_yaw: float, read_yaw: float, same: bool) -> None:
    sent = MissionItem(16, 3, (0.0, 0.0, 0.0, sent_yaw), 366_000_000, -843_800_000, 60.0)
    read = replace(sent, params=(0.0, 0.0, 0.0, read_yaw))
    assert (compare([sent], [read], PX4) == []) is same


def test_an_unknown_command_that_comes_back_otherwise_is_a_difference() -> None:
    sent = [HOME.as_item(), MissionItem(31999, 3, (1.5, 2.5, 3.5, 4.5), 1, 2, 3.0)]
    assert compare(sent, sent, COPTER) == []
    assert [d.field for d in compare(sent, [sent[0], replace(sent[1], params=(1.0, 2.5, 3.5, 4.5))], COPTER)] == [
        "param1"
    ]
    assert command_name(31999) == "command 31999"


@given(
    st.integers(0, 5),
    st.sampled_from(["x", "y", "z", "command", "frame", "p0", "p1", "p2", "p3"]),
    st.integers(1, 2**20),
    st.sampled_from(list(Autopilot)),
)
def test_no_change_of_any_number_goes_unseen(seq: int, field: str, by: int, autopilot: Autopilot) -> None:
    sent = mission(autopilot)
    read = read_back(sent, autopilot)
    seq = min(seq, len(sent) - 1)
    if seq == 0 and autopilot.is_ardupilot:
        return
    old = read[seq]
    if field in ("x", "y", "command", "frame"):
        new = (
            replace(old, **{field: (getattr(old, field) + by) % (65536 if field == "command" else 2**30)})
            if field != "frame"
            else replace(old, frame=20 + by % 200)
        )
    elif field == "z":
        new = replace(old, z=old.z + 0.01 * by)
    else:
        params = list(old.params)
        params[int(field[1])] += by / 8
        new = replace(old, params=tuple(params))  # type: ignore[arg-type]
    if new == old or (field == "p3" and autopilot is PX4 and by % (360 * 8) == 0):
        return
    ours = sent[seq]
    if field.startswith("p") and float32(new.params[int(field[1])]) == ours.params[int(field[1])]:
        return  # changed into what was sent
    if field == "z" and new.z == ours.z:
        return
    read[seq] = new
    assert {d.seq for d in faults(compare(sent, read, autopilot))} == {seq}
