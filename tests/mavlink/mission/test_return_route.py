"""Which route the parameters on board choose, against the route that was judged."""

from __future__ import annotations

import pytest

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import NO_POSITION, Home, Mission, MissionItem
from gcsplan.mavlink.mission.return_parameters import COPTER_RETURNS, ReturnRoute, route_setting, takes_another_route
from gcsplan.vehicle import Autopilot

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
AUTO = dict.fromkeys(COPTER_RETURNS, 6.0)


def holding(autopilot: Autopilot, *commands: int) -> Mission:
    return Mission(autopilot, Home.at(36.6, -84.3, 300.0), tuple(MissionItem(c, NO_POSITION) for c in commands))


PATH, LANDING = cmd.DO_RETURN_PATH_START, cmd.DO_LAND_START


@pytest.mark.parametrize(
    ("values", "route", "words"),
    [
        (AUTO, "mission", ""),
        (AUTO | {"BATT_FS_LOW_ACT": 1.0, "FS_THR_ENABLE": 0.0}, "mission", ""),  # lands, and does nothing: no return
        (AUTO | {"FS_GCS_ENABLE": 1.0}, "mission", "FS_GCS_ENABLE 1 on board: such a return does not join"),
        (AUTO | {"BATT_FS_CRT_ACT": 2.0}, "mission", "set 6 (Auto RTL)"),
        ({}, "mission", "could be read"),
        (dict.fromkeys(AUTO, 1.0), None, ""),
        ({"FS_GCS_ENABLE": 1.0}, None, "BATT_FS_CRT_ACT could not be read"),  # silence is no default
        ({}, "straight", ""),
        (dict.fromkeys(AUTO, 1.0) | {"FS_GCS_ENABLE": 6.0}, None, "was judged straight home"),
    ],
)
def test_arducopters_failsafes_choose_one_by_one(
    values: dict[str, float], route: ReturnRoute | None, words: str
) -> None:
    found = takes_another_route(values, holding(COPTER, PATH), route)
    assert words in str(found or "")
    assert bool(found) == bool(words)
    assert takes_another_route(values, holding(COPTER, cmd.LAND), route) is None  # there is nothing to join


@pytest.mark.parametrize(
    ("value", "start", "route", "words"),
    [
        (4.0, PATH, "mission", ""), (2.0, LANDING, "mission", ""), (3.0, PATH, "straight", ""), (3.0, PATH, None, ""),
        (2.0, PATH, "mission", "set RTL_AUTOLAND 4"), (4.0, LANDING, "mission", "set RTL_AUTOLAND 2"),
        (1.0, LANDING, "mission", "set RTL_AUTOLAND 2"), (0.0, PATH, "mission", "does not arm: set RTL_AUTOLAND 4"),
        (0.0, LANDING, None, "does not arm: set RTL_AUTOLAND 3"), (1.0, LANDING, None, "set RTL_AUTOLAND 3"),
        (2.0, LANDING, "straight", "was judged straight home"), (None, PATH, "mission", "could not be read"),
    ],
)  # fmt: skip
def test_arduplane_has_one_parameter_for_all(
    value: float | None, start: int, route: ReturnRoute | None, words: str
) -> None:
    values = {} if value is None else {"RTL_AUTOLAND": value}
    found = takes_another_route(values, holding(PLANE, start), route)
    assert words in str(found or "")
    assert bool(found) == bool(words)
    assert takes_another_route(values, holding(PLANE, cmd.LAND), route) is None


def test_px4_and_what_to_set() -> None:
    assert takes_another_route({}, holding(PX4, LANDING), None) is None  # RTL_TYPE is compared elsewhere
    assert route_setting(PLANE, path=True) == "RTL_AUTOLAND 4"
    assert route_setting(PLANE, path=False) == "RTL_AUTOLAND 2"
    assert route_setting(COPTER, path=True).endswith("BATT_FS_CRT_ACT 6 (Auto RTL)")
