"""The jobs of a session: uploads, downloads and clearing of one vehicle and of a fleet."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

import pytest

from gcsplan.errors import CheckFailed, GcsplanError, InputError, LinkError, ReadBackDiffers, VehicleRefused
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session.session import (
    UploadOrder,
    clear_mission,
    download_items,
    download_mission,
    upload_fleet,
    upload_items,
    upload_mission,
    verify_mission,
)
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.mavlink.mission.mission import ALL, FENCE, RALLY, Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot
from tests.mavlink.link.session.test_session import COPTER, CUT_CORNER, HOME, OPTIONS, PX4, air, mission, vehicle


@pytest.mark.slow
def test_a_fleet_on_one_port_takes_as_long_as_its_slowest_and_each_gets_its_own() -> None:
    boards = [vehicle(COPTER if n % 2 else PX4, n) for n in range(1, 13)]
    sent = [mission(board.autopilot, 10 + board.sysid, board.sysid, 700 + board.sysid) for board in boards]
    with air(*boards) as link:
        results = upload_fleet([UploadOrder(link, each, options=OPTIONS) for each in sent])
    for board, each, result in zip(boards, sent, results, strict=True):
        assert not isinstance(result, GcsplanError)
        assert result.verified
        assert result.sysid == board.sysid
        assert not faults(compare(each.wire_items(), board.items(), board.autopilot))


def test_a_fleet_on_several_links_keeps_the_errors_apart() -> None:
    good, armed = vehicle(sysid=1), vehicle(sysid=2, armed=True)
    with air(good) as first, air(armed) as second, Link("udpin:127.0.0.1:0") as dead:
        began = time.monotonic()
        results = upload_fleet([
            UploadOrder(first, mission(sysid=1), options=OPTIONS),
            UploadOrder(second, mission(sysid=2), options=OPTIONS),
            UploadOrder(dead, mission(sysid=3), options=replace(OPTIONS, discover_s=0.5)),
        ])  # fmt: skip
        assert time.monotonic() - began < 5.0
    assert getattr(results[0], "verified", False)
    assert isinstance(results[1], VehicleRefused)
    assert isinstance(results[2], LinkError)


def test_two_missions_for_one_vehicle_are_refused() -> None:
    with Link("udpin:127.0.0.1:0") as link, pytest.raises(InputError, match="same system id"):
        upload_fleet(
            [UploadOrder(link, mission(), options=OPTIONS), UploadOrder(link, mission(count=3), options=OPTIONS)]
        )


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_what_was_uploaded_is_downloaded_verified_and_cleared(autopilot: Autopilot) -> None:
    board, sent = vehicle(autopilot), mission(autopilot)
    with air(board) as link:
        upload_mission(link, sent, options=OPTIONS).raise_for_outcome()
        read = download_mission(link, 1, autopilot, name="uav1", options=OPTIONS)
        assert not faults(compare(sent.wire_items(), read.wire_items(), autopilot))
        assert (read.home.lat_e7, read.home.lon_e7) == (HOME.lat_e7, HOME.lon_e7)
        assert verify_mission(link, sent, options=OPTIONS).verified
        other = verify_mission(link, mission(autopilot, 7), options=OPTIONS)
        assert not other.verified
        assert isinstance(other.error(), ReadBackDiffers)
        assert clear_mission(link, 1, options=OPTIONS).verified
        assert len(download_items(link, 1, options=OPTIONS)) <= 1
    assert len(board.items()) <= 1


def test_what_is_on_board_is_judged_with_the_vehicles_own_parameters() -> None:
    board, sent, heard = vehicle(PX4), mission(PX4), []

    def judge(read: Mission, values: Mapping[str, float]) -> Note | None:
        heard.append((read, dict(values)))
        return CUT_CORNER if values.get("NAV_ACC_RAD") == 2.0 else None

    with air(board) as link:
        upload_mission(link, sent, options=OPTIONS).raise_for_outcome()
        result = verify_mission(link, sent, options=replace(OPTIONS, read_parameters=True), judge=judge)
        assert not result.verified
        assert isinstance(result.error(), CheckFailed)
        with pytest.raises(VehicleRefused, match="written for ArduCopter, and the vehicle is PX4") as caught:
            verify_mission(link, mission(COPTER), options=OPTIONS, judge=judge)
    ((read, values),) = heard
    assert [i.wire for i in read.wire_items()] == [i.wire for i in board.items()]
    assert values["NAV_MC_ALT_RAD"] == pytest.approx(0.8)
    assert caught.value.reason == "wrong_autopilot"


def test_an_empty_vehicle_gives_an_empty_mission() -> None:
    with air(vehicle()) as link:
        assert download_mission(link, 1, COPTER, options=OPTIONS).items == ()
        result = verify_mission(link, mission(), options=OPTIONS)
        assert not result.verified


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_fence_and_rally_points_go_up_and_are_cleared_with_all(autopilot: Autopilot) -> None:
    board = vehicle(autopilot)
    fence = [MissionItem(5004, 3, (50.5 + n, 0.0, 0.0, 0.0), 366_000_000 + n, -843_800_000) for n in range(5)]
    rally = [MissionItem(5100, 3, (0.0, 0.0, 0.0, 0.0), 366_000_000 + n, -843_800_000, 30.0) for n in range(4)]
    with air(board) as link:
        assert upload_items(link, 1, fence, autopilot, FENCE, options=OPTIONS).verified
        assert upload_items(link, 1, rally, autopilot, RALLY, options=OPTIONS).verified
        assert len(board.items(FENCE)) == 5
        assert len(board.items(RALLY)) == 4
        with pytest.raises(InputError, match="mission type 0"):
            upload_items(link, 1, fence, autopilot, 0, options=OPTIONS)
        assert clear_mission(link, 1, ALL, options=OPTIONS).verified
    assert board.items(FENCE) == board.items(RALLY) == ()


def test_an_armed_vehicle_is_not_cleared() -> None:
    board = vehicle(armed=True)
    board.load([HOME.as_item(), *mission().items])
    with air(board) as link, pytest.raises(VehicleRefused, match="armed"):
        clear_mission(link, 1, options=OPTIONS)
    assert len(board.items()) == 9


def test_a_mission_that_is_flown_is_not_cleared() -> None:
    board = vehicle(armed=True)
    board.load([HOME.as_item(), *mission().items])
    board.flying_mission = True
    with air(board) as link, pytest.raises(VehicleRefused, match="flown"):
        clear_mission(link, 1, options=replace(OPTIONS, allow_armed=True))


def test_a_vehicle_that_falls_silent_cannot_be_downloaded_from() -> None:
    board = vehicle(silent_after=12)
    board.load([HOME.as_item(), *mission(count=40).items])
    with air(board) as link, pytest.raises(LinkError, match="could not be read"):
        download_items(link, 1, options=OPTIONS)
