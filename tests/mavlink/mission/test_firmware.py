"""Firmware versions as AUTOPILOT_VERSION tells them, and which missions depend on them."""

from __future__ import annotations

import pytest

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.autopilots import flies_straight, needs_straight, version_words
from gcsplan.mavlink.mission.mission import NO_POSITION, RELATIVE, MissionItem
from gcsplan.vehicle import Autopilot

DEV, ALPHA, BETA, RC, RELEASE = 0, 64, 128, 192, 255


def number(major: int, minor: int, patch: int, kind: int) -> int:
    return int.from_bytes([major, minor, patch, kind], "big")


@pytest.mark.parametrize(
    ("version", "straight", "words"),
    [
        (None, False, "of a version that it does not tell"),
        (0, False, "of a version that it does not tell"),
        (number(1, 14, 3, RELEASE), True, "1.14.3"),
        (number(1, 16, 0, DEV), True, "1.16.0 development"),
        (number(1, 17, 0, RELEASE), True, "1.17.0"),
        (number(1, 17, 2, RC), True, "1.17.2 release candidate"),
        (number(1, 17, 0, BETA), True, "1.17.0 beta"),
        (number(1, 17, 0, ALPHA), False, "1.17.0 alpha"),  # main calls itself so, before the change and after it
        (number(1, 17, 0, DEV), False, "1.17.0 development"),
        (number(1, 18, 0, BETA), False, "1.18.0 beta"),
        (number(1, 18, 0, RELEASE), False, "1.18.0"),
        (number(2, 0, 0, RELEASE), False, "2.0.0"),
    ],
)
def test_a_version_flies_straight_legs_only_if_that_is_known(version: int | None, straight: bool, words: str) -> None:
    assert flies_straight(version) is straight
    assert version_words(version) == words


def item(command: int, z: float, frame: int = RELATIVE) -> MissionItem:
    return MissionItem(command, frame, x=366_000_000, y=-843_800_000, z=z)


def test_a_mission_needs_straight_legs_unless_it_is_at_one_altitude() -> None:
    level = [item(cmd.TAKEOFF, 65), item(cmd.WAYPOINT, 65), item(cmd.WAYPOINT, 65), MissionItem(cmd.RTL, NO_POSITION)]
    assert not needs_straight(level, Autopilot.PX4)
    assert needs_straight([*level[:-1], item(cmd.LAND, 0)], Autopilot.PX4)
    assert needs_straight([*level, item(cmd.WAYPOINT, 65.01)], Autopilot.PX4)
    assert not needs_straight([*level, item(cmd.LAND, 0)], Autopilot.ARDUCOPTER)
