"""What is emitted is safe: written files against a second opinion that shares no code with the package (`flown`)."""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gcsplan.app.check.files import check_files
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of
from gcsplan.app.plan.model import Plan
from gcsplan.check.judge import judge
from gcsplan.mavlink.files.formats import write_waypoints
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission
from gcsplan.mission_file import load_mission
from tests.oracles import flown
from tests.support.paths import DATA

pytestmark = pytest.mark.slow

CROSSING: dict[str, Any] = yaml.safe_load((DATA / "crossing.yaml").read_text())
STEP_M = 2.0
ZONES = [
    {"name": "wall", "center": [36.598, -84.367], "radius_m": 150},
    {"name": "mast", "center": [36.6005, -84.3735], "radius_m": 60, "ceiling_agl_m": 100},
    {"name": "roof", "center": [36.5985, -84.361], "radius_m": 200, "floor_agl_m": 110, "ceiling_amsl_m": 900},
    {"name": "field", "polygon": [[36.5995, -84.3655], [36.5995, -84.361], [36.602, -84.363]], "ceiling_amsl_m": 700},
    {"name": "deck", "polygon": [[36.59, -84.372], [36.596, -84.372], [36.596, -84.37]], "floor_amsl_m": 300},
]

MISSIONS: dict[str, dict[str, Any]] = {
    "copter": {"vehicle": {"max_climb_deg": 20}},
    "copter_amsl_under_ceilings": {
        "vehicle": {"end": "none"}, "limits": {"max_agl_m": 120, "max_amsl_m": 790.5}, "altitude_frame": "amsl",
    },
    "copter_over_terrain": {"vehicle": {"end": "loiter", "max_climb_deg": 40}, "altitude_frame": "terrain"},
    "px4_least_energy": {"vehicle": {"autopilot": "px4", "end": "loiter"}, "planner": {"objective": "energy"}},
    "plane": {"vehicle": {"autopilot": "arduplane", "max_climb_deg": 20}, "limits": {"track_error_m": 10}},
    "copter_and_back": {"vehicle": {"end": "rtl", "rtl_rel_home_m": 400}, "zones": []},
}  # fmt: skip


def asked_for(name: str) -> dict[str, Any]:
    case = MISSIONS[name]
    asked = copy.deepcopy(CROSSING)
    asked["vehicles"][0] |= case.get("vehicle", {})
    asked["limits"] |= case.get("limits", {})
    asked["no_fly"] = case.get("zones", ZONES)
    return asked | {k: case[k] for k in ("altitude_frame", "planner") if k in case}


@cache
def planned(name: str) -> Plan:
    return plan(load_mission("oracle.yaml", text=yaml.safe_dump(asked_for(name))))


@cache
def ground() -> flown.Ground:
    return flown.Ground.sample()


def second_opinion(name: str, mission: Mission, **how: Any) -> flown.Opinion:
    home, rows = flown.read_waypoints(write_waypoints(mission), str(mission.autopilot))
    rules = flown.Rules.of(asked_for(name))
    return flown.judge(home, rows, rules, ground(), str(mission.autopilot), step_m=STEP_M, **how)


@pytest.mark.nightly_but("copter_and_back")
@pytest.mark.parametrize("name", MISSIONS)
def test_a_planned_mission_is_safe_in_the_eyes_of_the_second_opinion(name: str) -> None:
    (v,) = planned(name).vehicles
    assert v.verdict.safe is True, v.verdict.describe()
    opinion = second_opinion(name, v.mission)
    assert opinion.breaches() == {}, (opinion.depth, opinion.row)
    assert {"min_agl", "climb", "coverage"} <= opinion.depth.keys()


@pytest.mark.nightly_but("copter", "plane")
@pytest.mark.parametrize("name", ["copter", "px4_least_energy", "plane"])
def test_both_files_hold_the_same_mission_as_stored(name: str) -> None:
    done = planned(name)
    autopilot = str(done.vehicles[0].mission.autopilot)
    files = outputs_of(done)
    home, rows = flown.read_waypoints(files["uav1.waypoints"], autopilot)
    plan_home, plan_rows = flown.read_plan(files["uav1.plan"], autopilot)
    assert home == plan_home
    assert [(r.command, r.frame, r.lat, r.lon, r.z) for r in rows] == [
        (r.command, r.frame, r.lat, r.lon, r.z) for r in plan_rows
    ]


def test_the_lowest_point_is_the_same_for_both() -> None:
    (v,) = planned("copter").vehicles
    assert v.verdict.lowest is not None
    assert second_opinion("copter", v.mission).lowest_m == pytest.approx(v.verdict.lowest.min_agl_m, abs=0.1)


def tampered(mission: Mission, rng: np.random.Generator) -> Mission:
    """One way point lower, higher, aside, or in a zone's middle."""
    items = list(mission.items)
    which = int(rng.choice([i for i, item in enumerate(items) if item.command in (cmd.WAYPOINT, cmd.LOITER_UNLIM)]))
    item = items[which]
    match rng.integers(5):
        case 0:
            item = replace(item, z=item.z - float(rng.uniform(0.05, 2)))
        case 1:
            item = replace(item, z=item.z - float(rng.uniform(5, 60)))
        case 2:
            item = replace(item, z=item.z + float(rng.uniform(5, 200)))
        case 3:
            item = replace(item, x=item.x + int(rng.normal(0, 10_000)), y=item.y + int(rng.normal(0, 10_000)))
        case _:
            item = replace(item, x=m.degrees_e7(36.598), y=m.degrees_e7(-84.367))
    items[which] = item
    return replace(mission, items=tuple(items))


@pytest.mark.nightly_but("px4_least_energy")
@pytest.mark.parametrize("name", MISSIONS)
def test_whatever_the_second_opinion_finds_in_a_tampered_mission_the_judge_finds_too(name: str) -> None:
    done = planned(name)
    (v,) = done.vehicles
    rng = np.random.default_rng(sum(map(ord, name)))
    seen = 0
    for _ in range(8):
        mission = tampered(v.mission, rng)
        breaches = second_opinion(name, mission, lines=("degrees",)).breaches()
        verdict = judge(
            mission, v.request.vehicle, done.world, rtl_rel_home_m=v.request.rtl_rel_home_m,
            terrain_error_m=done.source.terrain_error_m,
        )  # fmt: skip
        assert breaches.keys() <= {f.kind for f in verdict.findings}, (breaches, verdict.describe())
        seen += bool(breaches)
    assert seen >= 3


def test_a_file_with_its_home_row_elsewhere_is_judged_from_where_the_vehicle_is(tmp_path: Path) -> None:
    done = planned("copter")
    mission = done.vehicles[0].mission
    file = tmp_path / "uav1.waypoints"
    # A home row on a ridge would lift every relative altitude; the vehicle arms at its start all the same.
    file.write_text(write_waypoints(replace(mission, home=Home.at(36.596, -84.355, 700.0))))
    (checked,) = check_files(done.source, [str(file)])
    assert checked.mission.home == Home.at(*done.source.vehicles[0].start_deg, done.source.vehicles[0].start[2])
    assert any("elsewhere" in str(note) for note in checked.notes)
    assert checked.verdict.safe is True
