"""Return paths that the planner writes: proposed where no altitude helps, written on request, refused where unknown."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of
from gcsplan.app.plan.model import Plan
from gcsplan.app.plan.way_home import against_on_board, homes_of, warnings
from gcsplan.check.motion.commands import flown_in_order
from gcsplan.errors import InputError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.return_parameters import COPTER_RETURNS
from gcsplan.mission_file import load_mission

WALL = {
    "version": 1,
    "terrain": {"flat_m": 0},
    "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
    "limits": {"min_agl_m": 30, "max_climb_deg": 30, "horizontal_clearance_m": 20, "track_error_m": 2},
    "no_fly": [
        {"name": "wall", "line": [{"east_m": 1000, "north_m": n} for n in (-400, 900)], "buffer_m": 50},
    ],
}
UAV1 = {
    "name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 10], "rtl_rel_home_m": 50,
    "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 2000, "north_m": 0},
}  # fmt: skip


def planned(**vehicle: Any) -> Plan:
    """The way round a wall that has no top."""
    asked = WALL | {"vehicles": [UAV1 | vehicle]}
    return plan(load_mission(Path("wall.yaml"), text=yaml.safe_dump(asked)))


@pytest.mark.slow
def test_where_no_altitude_helps_a_path_back_is_proposed() -> None:
    home = homes_of(planned())["uav1"]
    assert home.safe is False
    assert home.path_back is not None
    assert home.path_back.code == "path_back_makes_safe"
    assert str(home.path_back).startswith("return_route: mission writes a return path back along the track")
    lines = "\n".join(warnings({"uav1": home}))
    assert str(home.path_back) not in lines  # it is the best of the proposals, and said there
    assert [lines.count(str(p.note)) for p in home.proposals] == [1] * len(home.proposals)
    assert lines.count("return_route: mission") == 1
    assert lines.count("RTL_ALT 5000") == sum("RTL_ALT 5000" in str(p.note) for p in home.proposals)
    assert home.as_dict()["path_back"] == str(home.path_back)
    assert ("instead", home.path_back) in [(row.label, row.note) for row in home.rows()]


@pytest.mark.slow
def test_the_path_back_is_written_judged_and_makes_every_return_safe() -> None:
    straight, done = planned(), planned(return_route="mission")
    (v,) = done.vehicles
    items = v.mission.items
    start = [i.command for i in items].index(cmd.DO_RETURN_PATH_START)
    assert flown_in_order(v.mission) == items[:start]
    assert flown_in_order(v.mission) == straight.vehicles[0].mission.items  # what is flown stays the same
    places = [(i.x, i.y, i.z) for i in items if i.command == cmd.WAYPOINT]
    out, back = places[: len(places) // 2], places[len(places) // 2 :]
    assert back[:-1] == out[::-1]
    assert (back[-1][0], back[-1][1]) == (items[-1].x, items[-1].y) == (v.mission.home.lat_e7, v.mission.home.lon_e7)
    assert items[-1].command == cmd.LAND
    assert v.verdict.safe is True, v.verdict.describe()
    assert v.verdict.energy_j == straight.vehicles[0].verdict.energy_j
    home = homes_of(done)["uav1"]
    assert home.safe is True, home.describe()
    written = outputs_of(done)
    assert f"\n{start + 1}\t0\t2\t188\t" in written["uav1.waypoints"]
    assert [i["command"] for i in json.loads(written["uav1.plan"])["mission"]["items"]][start] == 188


@pytest.mark.slow
def test_the_parameters_on_board_must_choose_the_route_that_was_judged() -> None:
    done = planned(return_route="mission")
    home, m = homes_of(done)["uav1"], done.vehicles[0].mission
    right = dict.fromkeys(COPTER_RETURNS, 6.0)
    assert against_on_board(home, right, m) is None
    assert "FS_GCS_ENABLE 1" in str(against_on_board(home, right | {"FS_GCS_ENABLE": 1.0}, m))
    assert "could be read" in str(against_on_board(home, {}, m))


@pytest.mark.parametrize(
    ("vehicle", "words"),
    [
        ({"autopilot": "px4"}, "for ArduCopter alone"),
        ({"autopilot": "arduplane"}, "for ArduCopter alone"),
        ({"end": "none"}, "use end: land, loiter or rtl"),
    ],
)
def test_where_no_path_back_is_written_one_message_says_why(vehicle: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        planned(return_route="mission", **vehicle)


@pytest.mark.nightly
def test_a_path_back_keeps_the_descent_limit_where_the_way_out_climbs() -> None:
    asked = WALL | {
        "terrain": {"flat_m": 0, "peaks": [{"center": [1000, 0], "height_m": 300, "decay_m": [300, 900]}]},
        "no_fly": [],
        "limits": WALL["limits"] | {"max_climb_deg": 25, "max_descent_deg": 12},  # type: ignore[operator]
        "vehicles": [UAV1 | {"return_route": "mission"}],
        "planner": {"budget_s": 1},
    }
    done = plan(load_mission(Path("hill.yaml"), text=yaml.safe_dump(asked)))
    assert done.vehicles[0].verdict.safe is True, done.vehicles[0].verdict.describe()
    assert done.vehicles[0].verdict.max_climb_deg <= 12.0 + 1e-6


@pytest.mark.slow
def test_a_return_into_a_wind_that_is_too_strong_at_its_height_is_not_safe() -> None:
    calm_below = [{"agl_m": 60, "speed_m_s": 3, "from_deg": 90}, {"agl_m": 100, "speed_m_s": 20, "from_deg": 270}]
    vehicle = {
        "name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": 10, "start": [47.0, 8.01],
        "goal": [47.0, 8.02],
    }  # fmt: skip
    for return_m, safe in ((110, None), (50, True)):
        planned = plan(load_mission({
            "version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 30, "max_agl_m": 120},
            "wind": {"levels": calm_below}, "vehicles": [vehicle | {"rtl_rel_home_m": return_m}],
        }))  # fmt: skip
        home = homes_of(planned)["uav1"]
        assert planned.vehicles[0].verdict.safe is True
        assert home.safe is safe
        assert ("return_too_windy" in [note.code for note in home.not_judged]) == (safe is None)
