"""From a mission file to a judged mission, for every kind of vehicle, frame and end."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from gcsplan.app.fleet.may_fly import require_passing
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import Plan
from gcsplan.errors import CheckFailed, NoMission, UsageError
from gcsplan.mission_file import load_mission
from tests.support.noted import saying
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


@pytest.mark.parametrize("seed", [-1, 2**32])
def test_a_seed_that_no_mission_file_may_have_is_refused(seed: int) -> None:
    with pytest.raises(UsageError, match="seed is a whole number from 0 to 4294967295"):
        plan(load_mission(DATA / "crossing.yaml"), seed=seed)


OVER_A_ZONE: dict[str, Any] = {
    "version": 1, "name": "over", "frame": {"origin": [36.6, -84.3], "amsl_m": 0}, "terrain": {"flat_m": 0},
    "no_fly": [{"name": "Z", "center": [36.6, -84.29], "radius_m": 150, "ceiling_amsl_m": 80}],
    "vehicles": [
        {"name": "a", "sysid": 1, "start": [36.6, -84.3], "goal": [36.6, -84.28], "speed_m_s": [3, 10],
         "climb_m_s": 2.5, "descent_m_s": 1.5, "accel_m_s2": 1.5, "corner_accel_m_s2": 2.5, "leg_jerk_m_s3": 1.0},
    ],
}  # fmt: skip


@pytest.mark.first_quick
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


@pytest.mark.slow
def test_a_return_through_a_zone_is_refused_with_what_helps() -> None:
    craft = OVER_A_ZONE["vehicles"][0] | {"autopilot": "arducopter", "end": "rtl", "rtl_rel_home_m": 60}
    asked = OVER_A_ZONE | {"limits": {"min_agl_m": 40, "max_climb_deg": 30}, "vehicles": [craft]}
    with pytest.raises(NoMission, match=r"(?s)\(rtl\): inside no-fly zone.*end: land and end: loiter end the mission"):
        plan(load_mission(DATA / "over.yaml", text=yaml.safe_dump(asked)))
    for cure in ({"end": "land"}, {"rtl_rel_home_m": 90}):
        again = asked | {"vehicles": [craft | cure]}
        assert plan(load_mission(DATA / "over.yaml", text=yaml.safe_dump(again))).vehicles[0].verdict.safe is True


@pytest.mark.slow
def test_corners_are_cut_above_hills_though_no_error_is_allowed() -> None:
    (v,) = planned(limits={"track_error_m": 0, "altitude_error_m": 0}).vehicles
    assert v.verdict.safe is True


@pytest.mark.slow
def test_a_return_that_meets_the_hills_is_no_mission_and_a_higher_one_is() -> None:
    with pytest.raises(NoMission, match="rtl"):
        planned({"end": "rtl", "rtl_rel_home_m": 70}, no_fly=[])
    done = planned({"end": "rtl", "rtl_rel_home_m": 400}, no_fly=[])
    assert done.vehicles[0].verdict.safe is True
    assert done.vehicles[0].verdict.energy_j > 1.5 * done.vehicles[0].verdict.path_energy_j


@pytest.mark.nightly
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


A, MIDDLE, B = [36.6, -84.3], [36.603, -84.29], [36.6, -84.28]
FOUR = [[*A, 100.0], [*MIDDLE, 60.0], [*MIDDLE, 110.0], [*B, 90.0]]
SEVEN = [*FOUR[:1], [*A, 70.0], *FOUR[1:3], [*MIDDLE, 80.0], [*B, 90.0], [*B, 120.0]]
