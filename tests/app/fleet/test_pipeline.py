"""From a mission file to a judged mission, for every kind of vehicle, frame and end."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import yaml

from gcsplan.app.fleet.may_fly import require_passing
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of, summary_of
from gcsplan.app.plan import vehicle as planning
from gcsplan.app.plan.model import Plan
from gcsplan.check.verdict import Verdict
from gcsplan.errors import CheckFailed, InputError, NoMission
from gcsplan.mavlink.files.formats import read_plan, read_waypoints
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mission_file import load_mission
from gcsplan.notes.note import Finding, Note
from gcsplan.vehicle import Autopilot
from tests.support.noted import codes, one, saying
from tests.support.paths import DATA

CROSSING: dict[str, Any] = yaml.safe_load((DATA / "crossing.yaml").read_text())


def planned(vehicle: dict[str, Any] | None = None, limits: dict[str, Any] | None = None, **more: Any) -> Plan:
    """The crossing with changes to its vehicle, its limits, and the file."""
    asked = CROSSING | more
    asked["vehicles"] = [CROSSING["vehicles"][0] | (vehicle or {})]
    asked["limits"] = CROSSING["limits"] | (limits or {})
    return plan(load_mission(DATA / "crossing.yaml", text=yaml.safe_dump(asked)))


def commands(of: Plan) -> list[int]:
    return [item.command for item in of.vehicles[0].mission.items]


@pytest.mark.slow
def test_the_example_of_the_contract_plans_as_printed() -> None:
    done = plan(load_mission(DATA / "interface_example.yaml"))
    assert [v.name for v in done.vehicles] == ["uav1", "uav2"]
    for v in done.vehicles:
        assert v.verdict.safe is True
        assert v.verdict.length_m > 17_000
    summary = summary_of(done)
    assert summary["fleet"]["order"] == ["uav1", "uav2"]
    first, second = (v["arrive_s"] for v in summary["vehicles"])
    assert second - first == pytest.approx(9.0, abs=1e-3)
    assert summary["fleet"]["min_separation_m"] >= 30
    assert summary["fleet"]["closest"]["vehicles"] == ["uav1", "uav2"]


OVER_A_ZONE: dict[str, Any] = {
    "version": 1, "name": "over", "frame": {"origin": [36.6, -84.3], "amsl_m": 0}, "terrain": {"flat_m": 0},
    "no_fly": [{"name": "Z", "center": [36.6, -84.29], "radius_m": 150, "ceiling_amsl_m": 80}],
    "vehicles": [
        {"name": "a", "sysid": 1, "start": [36.6, -84.3], "goal": [36.6, -84.28], "speed_m_s": [3, 10],
         "climb_m_s": 2.5, "descent_m_s": 1.5, "accel_m_s2": 1.5, "corner_accel_m_s2": 2.5, "leg_jerk_m_s3": 1.0},
    ],
}  # fmt: skip


@pytest.mark.parametrize("autopilot", ["arducopter", "px4", "arduplane"])
@pytest.mark.parametrize("track_error_m", [0, 3])
def test_corners_are_cut_above_what_the_path_passes_over_though_no_error_is_allowed(
    autopilot: str, track_error_m: float
) -> None:
    errors = {"track_error_m": track_error_m, "altitude_error_m": 0, "horizontal_clearance_m": 0}
    craft = OVER_A_ZONE["vehicles"][0] | {"autopilot": autopilot}
    asked = OVER_A_ZONE | {"limits": {"min_agl_m": 40, "max_climb_deg": 30} | errors, "vehicles": [craft]}
    (v,) = plan(load_mission(DATA / "over.yaml", text=yaml.safe_dump(asked))).vehicles
    assert v.verdict.safe is True
    assert 80.0 < v.solution.path.points[:, 2].max() < 84.0  # over it, and no higher than cut corners need
    assert v.gap_percent is not None
    assert v.gap_percent < 0.5


def test_a_return_through_a_zone_is_refused_with_what_helps() -> None:
    craft = OVER_A_ZONE["vehicles"][0] | {"autopilot": "arducopter", "end": "rtl", "rtl_rel_home_m": 60}
    asked = OVER_A_ZONE | {"limits": {"min_agl_m": 40, "max_climb_deg": 30}, "vehicles": [craft]}
    with pytest.raises(NoMission, match=r"(?s)\(rtl\): inside no-fly zone.*end: land and end: loiter end the mission"):
        plan(load_mission(DATA / "over.yaml", text=yaml.safe_dump(asked)))
    for cure in ({"end": "land"}, {"rtl_rel_home_m": 90}):
        again = asked | {"vehicles": [craft | cure]}
        assert plan(load_mission(DATA / "over.yaml", text=yaml.safe_dump(again))).vehicles[0].verdict.safe is True


def test_corners_are_cut_above_hills_though_no_error_is_allowed() -> None:
    (v,) = planned(limits={"track_error_m": 0, "altitude_error_m": 0}).vehicles
    assert v.verdict.safe is True


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_every_autopilot_gets_a_safe_mission_whose_files_read_back_the_same(autopilot: Autopilot) -> None:
    done = planned({"autopilot": str(autopilot)})
    (v,) = done.vehicles
    assert v.verdict.safe is True
    files = outputs_of(done)
    for read in (
        read_plan(files["uav1.plan"], autopilot=None, where="uav1.plan"),
        read_waypoints(files["uav1.waypoints"], autopilot=autopilot, where="uav1.waypoints"),
    ):
        assert [i.wire for i in read.items] == [i.wire for i in v.mission.items]
        assert read.home == v.mission.home


@pytest.mark.parametrize("frame", ["relative", "amsl", "terrain"])
def test_every_altitude_frame_is_planned_with_its_own_errors(frame: str) -> None:
    done = planned({"max_climb_deg": 35}, altitude_frame=frame)
    (v,) = done.vehicles
    assert v.verdict.safe is True
    wanted = {"relative": m.RELATIVE, "amsl": m.GLOBAL, "terrain": m.TERRAIN}[frame]
    assert {i.frame for i in v.mission.items if i.command == cmd.WAYPOINT} == {wanted}
    assert v.verdict.lowest is not None
    assert v.verdict.lowest.min_agl_m >= (95 if frame == "terrain" else 65)


@pytest.mark.parametrize("end", ["land", "loiter", "none"])
def test_every_end_is_planned(end: str) -> None:
    done = planned({"end": end})
    assert done.vehicles[0].verdict.safe is True
    assert commands(done)[-1] == {"land": cmd.LAND, "loiter": cmd.LOITER_UNLIM, "none": cmd.WAYPOINT}[end]


@pytest.mark.slow
def test_a_return_that_meets_the_hills_is_no_mission_and_a_higher_one_is() -> None:
    with pytest.raises(NoMission, match="rtl"):
        planned({"end": "rtl", "rtl_rel_home_m": 70}, no_fly=[])
    done = planned({"end": "rtl", "rtl_rel_home_m": 400}, no_fly=[])
    assert done.vehicles[0].verdict.safe is True
    assert done.vehicles[0].verdict.energy_j > 1.5 * done.vehicles[0].verdict.path_energy_j


def test_via_points_are_passed() -> None:
    done = planned({"via": [[36.602, -84.368], [36.600, -84.360, 150]]})
    (v,) = done.vehicles
    points = v.solution.path.points
    world = done.world
    for lat, lon in ((36.602, -84.368), (36.600, -84.360)):
        east, north = world.frame.to_plane(lat, lon)
        assert np.hypot(points[:, 0] - east, points[:, 1] - north).min() < 0.01
    assert v.verdict.safe is True


def test_a_battery_that_is_too_small_is_named() -> None:
    with pytest.raises(NoMission, match="battery") as refused:
        planned({"energy": {"battery_j": 200_000, "reserve": 0.2}})
    assert refused.value.reason == "battery"


def test_a_take_off_below_the_limits_is_bad_input_and_one_at_them_is_raised() -> None:
    with pytest.raises(InputError, match="takeoff_agl_m"):
        planned({"takeoff_agl_m": 50})
    done = planned({"takeoff_agl_m": 65})
    raised = one("takeoff_raised", done.vehicles[0].notes)
    assert raised.data["asked_m"] == 65.0
    assert raised.data["raised_m"] > 65.0  # type: ignore[operator]


@pytest.mark.slow
def test_the_energy_objective_spends_no_more_than_the_shortest_way() -> None:
    sharp = yaml.safe_dump(CROSSING | {"planner": {"gap_percent": 0.1}})
    length, energy = (
        plan(load_mission(DATA / "crossing.yaml", text=sharp), objective=objective)
        for objective in ("length", "energy")
    )
    assert energy.vehicles[0].verdict.path_energy_j <= length.vehicles[0].verdict.path_energy_j * 1.001
    assert summary_of(energy)["vehicles"][0]["lower_bound_m"] is None


@pytest.mark.slow
def test_a_world_in_local_metres_is_planned_like_any_other() -> None:
    text = """
version: 1
name: A cube with a mound
frame: {origin: [36.6, -84.3], amsl_m: 0}
terrain: {peaks: [{center: [50, 50], height_m: 70, decay_m: [20, 20]}]}
limits: {min_agl_m: 3, horizontal_clearance_m: 0.2, track_error_m: 0, altitude_error_m: 0}
vehicles:
  - name: uav1
    sysid: 1
    autopilot: arducopter
    start: {east_m: 0, north_m: 0, up_m: 0}
    goal: {east_m: 100, north_m: 100, up_m: 60}
    end: loiter
planner: {gap_percent: 5}
"""
    done = plan(load_mission("mound.yaml", text=text))
    (v,) = done.vehicles
    assert v.verdict.safe is True
    assert 152.48 < v.verdict.length_m < 175
    assert v.solution.path.points[-1] == pytest.approx([100, 100, 60], abs=0.2)


def test_a_verdict_that_is_not_safe_is_not_let_through() -> None:
    done = planned()
    bad = done.vehicles[0].verdict
    unjudged = type(bad)(bad.mission, bad.legs, (), (saying("the wind"),))
    require_passing({"uav1": bad})
    with pytest.raises(CheckFailed, match="the wind"):
        require_passing({"uav1": unjudged})
    require_passing({"uav1": unjudged}, allow_unjudged=True)


def test_a_plan_with_larger_margins_has_a_bound_under_the_limits_of_the_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of its own ends, which the larger margins may raise; margins are the path's, not the bound's."""
    (once,) = planned().vehicles
    real, built = planning.built, list[float]()

    def low_at_first(*args: Any) -> tuple[m.Mission, Verdict]:
        mission, verdict = real(*args)
        built.append(verdict.length_m)
        seq = mission.first_seq + next(k for k, i in enumerate(mission.items) if i.command == cmd.WAYPOINT)
        low = Finding(
            seq, "min_agl", Note("over_unknown_ground", seq), 0.0, 0.0, 0.0, value=25.0, limit=30.0, by=5.0, unit="m"
        )
        return mission, replace(verdict, findings=(low,)) if len(built) <= 2 else verdict

    monkeypatch.setattr(planning, "built", low_at_first)
    (again,) = planned().vehicles
    assert len(built) >= 3
    assert again.problem.limits.altitude_error_m > once.problem.limits.altitude_error_m + 5.0
    assert again.problem.bound_limits == once.problem.bound_limits
    assert again.problem.start[2] > once.problem.start[2]
    assert again.solution.lower_bound == pytest.approx(once.solution.lower_bound, rel=1e-4)  # both ends are 5 m higher
    assert len(again.solution.search) > len(once.solution.search)
    assert again.problem.budget_s == 0.5 * once.problem.budget_s
    assert again.gap_percent == pytest.approx(100.0 * (again.cost / again.solution.lower_bound - 1.0))
    assert Note("planned_again", times=2) in again.solution.notes
    assert once.solution.notes == ()


A, MIDDLE, B = [36.6, -84.3], [36.603, -84.29], [36.6, -84.28]
FOUR = [[*A, 100.0], [*MIDDLE, 60.0], [*MIDDLE, 110.0], [*B, 90.0]]
SEVEN = [*FOUR[:1], [*A, 70.0], *FOUR[1:3], [*MIDDLE, 80.0], [*B, 90.0], [*B, 120.0]]


@pytest.mark.parametrize(("climb_deg", "vias"), [(90.0, FOUR), (30.0, FOUR), (90.0, SEVEN)])
def test_vias_over_one_place_are_climbs_on_the_spot(climb_deg: float, vias: list[list[float]]) -> None:
    """Over the start, at two or three altitudes over a place on the way, and over the goal."""
    craft = OVER_A_ZONE["vehicles"][0] | {"autopilot": "arducopter", "via": vias}
    limits = {"min_agl_m": 40, "max_climb_deg": climb_deg}
    asked = OVER_A_ZONE | {"no_fly": [], "limits": limits, "vehicles": [craft]}
    (v,) = plan(load_mission(DATA / "crossing.yaml", text=yaml.safe_dump(asked))).vehicles
    assert v.verdict.safe is True
    points = v.solution.path.points
    assert np.ptp(points[:, 2]) >= 60.0
    assert codes(v.notes).count("via_moved") == 3
    assert v.gap_percent is not None
    assert v.gap_percent < 1.0
