"""Commands that are no places: what moves nothing, and what may change the flight and is named."""

from __future__ import annotations

import pytest

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.notes.note import Note
from tests.support.followed import TAKEOFF, at, fly, unknown


@pytest.mark.parametrize(
    "item",
    [
        MissionItem(cmd.DO_SET_HOME, 0, (0, 0, 0, 0), 366000000, -843000000, 10),
        at(31000, 0.02, 0, 80),
    ],
)
def test_a_command_whose_motion_is_unknown_is_named(item: MissionItem) -> None:
    flight = fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 80), item, at(cmd.WAYPOINT, 0.03, 0, 80))
    assert [(n.code, n.item, n.data["command"]) for n in flight.not_judged[:1]] == [("flown_unknown", 3, item.command)]


def test_servo_and_camera_commands_move_nothing() -> None:
    flight = fly(TAKEOFF, MissionItem(206, 2, (25, 0, 1, 0)), MissionItem(183, 2, (9, 1500, 0, 0)))
    assert flight.not_judged == []
    assert len(flight.stretches) == 1


@pytest.mark.parametrize(("command", "first"), [(180, 0), (208, 2), (212, 1), (218, 4), (222, 5), (223, 0)])
def test_commands_that_may_change_the_flight_are_named(command: int, first: float) -> None:
    flight = fly(TAKEOFF, MissionItem(command, 2, (first, 0, 0, 0)))
    assert unknown(flight) == [command]


def test_an_armed_parachute_moves_nothing() -> None:
    assert fly(TAKEOFF, MissionItem(208, 2, (1, 0, 0, 0))).not_judged == []


def test_a_command_that_is_not_judged_is_named_with_the_reason() -> None:
    for command, why in (
        (cmd.PAYLOAD_PLACE, Note("descends_until_ground", name="payload place")),
        (cmd.DO_AUX_FUNCTION, Note("switches_mode", name="auxiliary function")),
    ):
        flight = fly(TAKEOFF, MissionItem(command, 3, (1.0, 0.0, 0.0, 0.0), TAKEOFF.x + 9000, TAKEOFF.y, 80.0))
        assert flight.not_judged == [Note("flown_unknown", 2, autopilot="arducopter", command=command, why=why)]
        said = f"item 2: what arducopter flies for command {command} is not judged: {why}"
        assert str(flight.not_judged[0]) == f"{said}; leave it out to have the rest judged"
