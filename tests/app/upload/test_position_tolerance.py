"""Positions that lie beside those of a file: what counts as one, how far it is, and who writes it so."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcsplan.app.upload.position_tolerance import CUTTING, Shift, require_tolerance, shift_of, within
from gcsplan.errors import CheckFailed, ReadBackDiffers, UsageError
from gcsplan.mavlink.link.session.results import UploadResult
from gcsplan.mavlink.mission.autopilots import altitude_of_cm, stored
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot

PX4, COPTER = Autopilot.PX4, Autopilot.ARDUCOPTER


def mission(autopilot: Autopilot = COPTER) -> Mission:
    z = altitude_of_cm(6000, autopilot)
    items = (
        MissionItem(22, 3, (0.0, 0.0, 0.0, 0.0), 366_000_000, -843_800_000, z),
        MissionItem(178, 2, (1.0, 4.37, -1.0, 0.0)),
        MissionItem(16, 3, (2.0, 0.0, 0.0, 0.0), 366_849_290, -843_905_636, z),
        MissionItem(203, 2, (0.0, 0.0, 0.0, 0.0), 5, 7, 0.0),  # plain numbers
        MissionItem(21, 3, (0.0, 0.0, 0.0, 0.0), 366_030_000, -842_549_998, 0.0),
    )
    return Mission(autopilot, Home.at(36.6, -84.38, 371.0), items, "uav1", 1)


def on_board(sent: Mission) -> list[MissionItem]:
    return [stored(item, sent.autopilot) for item in sent.wire_items()]


def changed(sent: Mission, index: int, **fields: object) -> list[MissionItem]:
    """What is on board where somebody changed item ``index`` (home not counted)."""
    read = on_board(sent)
    at = index + sent.first_seq
    read[at] = replace(read[at], **fields)  # type: ignore[arg-type]
    return read


TOO_LOW = Note("no_parameter_read", autopilot="px4")


def shift(sent: Mission, read: list[MissionItem]) -> Shift | None:
    return shift_of(sent, read, faults(compare(sent.wire_items(), read, sent.autopilot)))


def result(sent: Mission, read: list[MissionItem], failed: Note | None = None) -> UploadResult:
    differences = tuple(compare(sent.wire_items(), read, sent.autopilot))
    verified = not faults(differences) and failed is None
    return UploadResult(
        "uav1", 1, "udpout:x", "accepted", verified, len(read), 0.1, differences=differences, failed_check=failed,
        read_back=tuple(read),
    )  # fmt: skip


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_degrees_that_mavproxy_cuts_are_named(autopilot: Autopilot) -> None:
    """The oracle is MAVProxy's own line: ``int(wp.x*1.0e7)`` of the degrees in the file."""
    sent = mission(autopilot)
    read = [
        replace(i, x=int(float(f"{i.x / 1e7:.7f}") * 1.0e7), y=int(float(f"{i.y / 1e7:.7f}") * 1.0e7))
        if i.command in (16, 21, 22) else i
        for i in on_board(sent)
    ]  # fmt: skip
    found = shift(sent, read)
    assert found is not None
    assert found.items == 2
    assert 0.008 < found.most_m < 0.016
    assert found.sender == CUTTING
    assert "2 items differ by up to 1." in str(found)
    assert "as MAVProxy and Mission Planner write positions" in str(found)


def test_another_centimetre_is_nobodys() -> None:
    found = shift(mission(), changed(mission(), 2, x=366_849_291))
    assert found is not None
    assert found.sender == ""
    assert str(found) == "1 item differs by 1.1 cm"


@pytest.mark.parametrize(
    ("index", "fields"),
    [
        (2, {"params": (3.0, 0.0, 0.0, 0.0)}),
        (2, {"frame": 0}),
        (2, {"command": 82}),
        (2, {"autocontinue": False}),
        (2, {"x": 0, "y": 0}),
        (2, {"x": 2**31 - 1}),
        (2, {"z": math.nan}),
        (2, {"z": math.inf}),
        (3, {"x": 6}),
    ],
)
def test_what_is_no_position_has_no_tolerance(index: int, fields: dict[str, object]) -> None:
    sent = mission(PX4)
    read = changed(sent, index, **fields)
    assert shift(sent, read) is None
    kept, note, more = within(result(sent, read), sent, 10.0)
    assert not kept.verified
    assert isinstance(kept.error(), ReadBackDiffers)
    assert note is None
    assert "for positions alone" in more


def test_a_shorter_list_has_no_tolerance() -> None:
    assert shift(mission(), on_board(mission())[:-1]) is None


@given(st.integers(-2000, 2000), st.integers(-2000, 2000), st.integers(-300, 300), st.floats(0.001, 10.0))
def test_a_tolerance_takes_what_lies_within_it_and_nothing_else(
    north: int, east: int, up_cm: int, tolerance_m: float
) -> None:
    sent = mission()
    item = sent.items[2]
    read = changed(sent, 2, x=item.x + north, y=item.y + east, z=item.z + up_cm / 100)
    kept, note, more = within(result(sent, read), sent, tolerance_m)
    # A second way: metres of a degree at 36.7° north on the mean sphere.
    a_degree_m = math.pi / 180.0 * 6_371_008.8
    off_m = math.hypot(
        north * 1e-7 * a_degree_m, east * 1e-7 * a_degree_m * math.cos(math.radians(36.68)), abs(up_cm) / 100
    )
    if off_m > 0.0 and abs(off_m - tolerance_m) > 0.01 + 1e-3 * off_m:
        assert kept.verified == (off_m < tolerance_m)
        assert (note is not None and note.data["safe"] is True) == (off_m < tolerance_m)
        assert ("more than --tolerance-m" in more) == (off_m > tolerance_m)
    failing, note, _ = within(result(sent, read, TOO_LOW), sent, tolerance_m)
    assert not failing.verified
    assert note is None or note.data["safe"] is False


def test_what_is_not_safe_is_no_verified_mission_however_near() -> None:
    sent = mission()
    read = changed(sent, 2, x=366_849_291)
    kept, note, _ = within(result(sent, read, TOO_LOW), sent, 1.0)
    assert isinstance(kept.error(), CheckFailed)
    assert note is not None
    assert (note.code, note.data["items"], note.data["safe"]) == ("positions_shifted", 1, False)
    assert str(note) == "1 item differs by 0.011 m; judged again: not safe"


def test_without_a_tolerance_the_cure_is_told() -> None:
    sent = mission()
    kept, note, more = within(result(sent, changed(sent, 2, x=366_849_291)), sent, None)
    assert isinstance(kept.error(), ReadBackDiffers)
    assert (note, more) == (
        None,
        ". 1 item differs by 1.1 cm: --mission MISSION.yaml --tolerance-m 0.02 judges what is on board, and takes it "
        "if it is safe",
    )  # fmt: skip
    assert within(result(sent, changed(sent, 2, x=366_949_291)), sent, None)[2] == ""


def test_a_tolerance_that_suits_the_cure_is_enough() -> None:
    sent = mission()
    for off in (1, 7, 90, 890):
        read = changed(sent, 2, x=366_849_290 + off)
        cure = within(result(sent, read), sent, None)[2]
        tolerance_m = float(cure.partition("--tolerance-m ")[2].split()[0])
        assert within(result(sent, read), sent, tolerance_m)[0].verified


@pytest.mark.parametrize("tolerance_m", [0.0, -1.0, 10.5, math.nan, math.inf])
def test_a_tolerance_is_a_few_metres_at_most(tolerance_m: float) -> None:
    with pytest.raises(UsageError, match="more than 0 and at most 10 m"):
        require_tolerance(tolerance_m, judged=True)


def test_a_tolerance_needs_a_world_to_judge_in() -> None:
    require_tolerance(None, judged=False)
    require_tolerance(0.02, judged=True)
    with pytest.raises(UsageError, match=r"give --mission MISSION\.yaml"):
        require_tolerance(0.02, judged=False)
