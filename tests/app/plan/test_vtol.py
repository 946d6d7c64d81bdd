"""A VTOL's plan: vertical ends, and turns of its radius in between."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import VehiclePlan
from gcsplan.errors import InputError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mission_file import load_mission
from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.sim.flight.mission_flight import fly
from gcsplan.sim.flight.track import make_track
from tests.support.noted import codes

WHOLE = {
    "version": 1, "frame": {"origin": [47.0, 8.0], "amsl_m": 0}, "terrain": {"flat_m": 100}, "no_fly": [],
    "limits": {"min_agl_m": 80, "max_agl_m": 150, "track_error_m": 10, "altitude_error_m": 8},
}  # fmt: skip
CRAFT = {
    "name": "v1", "sysid": 1, "autopilot": "arduplane", "speed_m_s": [14, 20], "start": {"east_m": 0, "north_m": 0},
    "goal": {"east_m": 4000, "north_m": 500},
}  # fmt: skip


def planned(**keys: Any) -> VehiclePlan:
    zones = keys.pop("no_fly", [])
    return plan(load_mission(WHOLE | {"no_fly": zones, "vehicles": [CRAFT | keys]})).vehicles[0]


def disc(east_m: float, north_m: float, radius_m: float) -> dict[str, Any]:
    return {"name": f"z{east_m:g}", "center": {"east_m": east_m, "north_m": north_m}, "radius_m": radius_m}


def test_a_vtol_has_columns_and_turns_as_wide_as_it_banks() -> None:
    v = planned(no_fly=[disc(2000, 200, 400)])
    assert v.verdict.safe is True, v.verdict.describe()
    commands = [i.command for i in v.mission.items]
    assert (commands[0], commands[-2:]) == (cmd.VTOL_TAKEOFF, [cmd.WAYPOINT, cmd.VTOL_LAND])
    assert v.request.vehicle.turn_radius_m == math.ceil(20.0**2 / 9.80665 / math.tan(math.radians(30.0)))
    assert {"flown_as_quadplane"} <= set(codes(v.notes))
    assert {"vtol_sets_off"} <= set(codes(v.verdict.notes))
    assert "vtol_overshoots" not in codes(v.verdict.notes)  # it has room to brake before its landing
    assert v.brief is not None
    places = [leg.end[:2] for leg in v.verdict.legs if leg.on_path]
    track = v.brief.world.frame.to_plane(*np.array(places).T).tolist()
    courses = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(track) if math.dist(a, b) > 0.05]
    turns = [abs((b - a + math.pi) % (2.0 * math.pi) - math.pi) for a, b in pairwise(courses)]
    assert max(turns) < math.radians(10.0)  # chords of arcs, no corners
    assert v.gap_percent is not None
    assert 0.0 <= v.gap_percent < 3.0


@pytest.mark.slow
def test_a_rehearsal_arrives_when_the_plan_says() -> None:
    for end in ("land", "loiter"):
        v = planned(no_fly=[disc(2000, 200, 400)], end=end)
        assert v.brief is not None
        craft = v.request.vehicle
        track = make_track(v.mission, craft, v.brief.world, Kinematics.of(craft))
        assert v.verdict.arrive_s is not None
        assert fly([track], [0.0]).arrive_s[0] == pytest.approx(v.verdict.arrive_s, abs=4.0)


@pytest.mark.parametrize("end", ["loiter", "rtl"])
def test_a_vtol_may_end_as_a_wing_does(end: str) -> None:
    v = planned(end=end, rtl_rel_home_m=120)
    assert v.verdict.safe is True, v.verdict.describe()


def test_its_nose_stands_on_the_heading_that_the_file_gives() -> None:
    v = planned(takeoff_heading_deg=200)
    assert v.verdict.safe is True
    heading = next(n for n in v.verdict.notes if n.code == "vtol_sets_off").data["heading_deg"]
    assert heading == pytest.approx(200.0, abs=0.1)


def test_a_radius_makes_a_wing_unless_it_is_said_to_be_a_vtol() -> None:
    wing, vtol = planned(turn_radius_m=90, end="loiter"), planned(turn_radius_m=90, vtol=True)
    assert (wing.mission.items[0].command, vtol.mission.items[0].command) == (cmd.TAKEOFF, cmd.VTOL_TAKEOFF)
    assert vtol.request.vehicle.turn_radius_m == 90.0


@pytest.mark.parametrize(
    ("keys", "cure"),
    [
        ({"autopilot": "px4", "vtol": True}, "vtol: leave it out, or use autopilot: arduplane"),
        ({"vtol": False}, "vtol: give its turn_radius_m"),
        ({"climb_out": "circles"}, "climb_out: a VTOL takes off vertically"),
        ({"vtol": True, "turn_radius_m": 20}, "turns of 20 m at 20 m/s need a bank of"),
        ({"climb_out_m_s": 3}, "is a fixed wing's"),
    ],
)
def test_what_a_vtol_cannot_be_is_said_with_a_cure(keys: dict[str, Any], cure: str) -> None:
    with pytest.raises(InputError, match=cure):
        planned(**keys)
