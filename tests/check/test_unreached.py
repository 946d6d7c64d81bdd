"""Items that are never flown, items that are refused on upload, and params that change how a command is flown."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from tests.support.noted import codes
from tests.support.worlds import vehicle, world

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
FLAT = world(half_m=6000.0)
HOME = Home.at(36.6, -84.3, 300.0)
LAND_START, CAMERA = 189, 206


def at(command: int, east: float, north: float = 0.0, up: float = 100.0, *params: float, frame: int = 3) -> MissionItem:
    lat, lon = (float(x) for x in FLAT.frame.to_degrees(east, north))
    p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(command, frame, (p1, p2, p3, p4), m.degrees_e7(lat), m.degrees_e7(lon), up)


def do(command: int, *params: float) -> MissionItem:
    p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(command, m.NO_POSITION, (p1, p2, p3, p4))


def flown(
    autopilot: Autopilot, *items: MissionItem, craft: Vehicle | None = None, rtl_m: float | None = None
) -> Verdict:
    up = at(cmd.VTOL_TAKEOFF if autopilot is PLANE else cmd.TAKEOFF, 0)
    craft = craft or vehicle(autopilot)
    return judge(Mission(autopilot, HOME, (up, *items), "uav1"), craft, FLAT, rtl_rel_home_m=rtl_m)


A, B = at(cmd.WAYPOINT, 1000, 0, 100, 0, 2.0), at(cmd.WAYPOINT, 2000, 0, 100, 0, 2.0)
WAIT, DOWN = at(cmd.LOITER_UNLIM, 1500), at(cmd.LAND, 2000, 0, 0)


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_what_stands_behind_a_hold_without_end_is_a_finding(autopilot: Autopilot) -> None:
    verdict = flown(autopilot, A, WAIT, B, DOWN)
    (finding,) = verdict.findings
    wait = verdict.mission.first_seq + 2
    assert (finding.kind, finding.seq) == ("unreachable", wait + 1)
    assert finding.note == Note("items_unreached", wait + 1, last=wait + 2, by=wait, jumps=False)
    assert max(leg.seq for leg in verdict.legs) == wait  # no item after it counts as flown


def test_a_hold_without_end_that_ends_the_mission_is_none() -> None:
    craft = replace(vehicle(COPTER), energy=Energy(120.0, 100.0, hover_w=400.0, battery_j=1e6, reserve=0.2))
    verdict = flown(COPTER, A, WAIT, craft=craft)
    assert verdict.safe is True, verdict.describe()
    used = 120.0 * 100 + 100.0 * 1500
    assert verdict.until_reserve_s == pytest.approx((0.8e6 - used) / 400.0, rel=1e-3)
    assert Note("battery_until_reserve", 3, loop=False, left_s=verdict.until_reserve_s) in verdict.notes
    short = replace(craft, energy=replace(craft.energy, battery_j=190_000.0))  # too little to reach the end
    assert [f.kind for f in flown(COPTER, A, WAIT, craft=short).findings] == ["battery"]
    unknown = replace(craft, energy=replace(craft.energy, hover_w=0.0))
    assert Note("battery_lasts_unknown", 3) in flown(COPTER, A, WAIT, craft=unknown).notes


def test_a_plane_that_circles_without_end_takes_what_its_way_takes() -> None:
    craft = replace(vehicle(PLANE), energy=Energy(120.0, 20.0, battery_j=1e6, reserve=0.0))
    verdict = flown(PLANE, A, at(cmd.LOITER_UNLIM, 2000, 0, 100, 0, 0, 80.0), craft=craft)
    left_j = 1e6 - verdict.energy_j
    assert verdict.until_reserve_s == pytest.approx(left_j / (20.0 * craft.speed_max_m_s), rel=1e-6)


def test_do_items_behind_a_hold_are_carried_out_by_ardupilot_and_not_by_px4() -> None:
    shot = do(CAMERA, 25.0)
    assert flown(COPTER, A, WAIT, shot).safe is True
    assert [f.kind for f in flown(PX4, A, WAIT, shot).findings] == ["unreachable"]


@pytest.mark.parametrize("before", [[WAIT], [DOWN], [do(cmd.DO_JUMP, 2, -1)], [do(cmd.RTL)], []])
@pytest.mark.parametrize("start", [cmd.DO_LAND_START, cmd.DO_RETURN_PATH_START])
def test_what_only_a_return_leads_to_is_judged_and_counts_in_no_figure(start: int, before: list[MissionItem]) -> None:
    """It is judged whether the items lead there too or not: behind a hold, a landing, a loop, a return."""
    good = flown(COPTER, A, *before, do(start), B, DOWN, rtl_m=100.0)
    assert good.safe is True, good.describe()
    alone = flown(COPTER, A, *before, rtl_m=100.0)
    if before:
        assert good.energy_j == alone.energy_j
        assert good.time_s == alone.time_s
    low = flown(COPTER, A, *before, do(start), replace(B, z=20.0), DOWN, rtl_m=100.0)
    behind = low.mission.first_seq + 3 + len(before)
    assert ("min_agl", behind) in {(f.kind, f.seq) for f in low.findings}


def test_two_landings_that_only_returns_lead_to_are_both_judged() -> None:
    low = at(cmd.WAYPOINT, 500, 0, 20)
    verdict = flown(COPTER, A, WAIT, do(LAND_START), B, DOWN, do(LAND_START), low, DOWN)
    assert ("min_agl", 8) in {(f.kind, f.seq) for f in verdict.findings}
    held = flown(COPTER, A, WAIT, do(LAND_START), B, WAIT, DOWN)
    assert [(f.kind, f.seq) for f in held.findings] == [("unreachable", 7)]
    back = flown(COPTER, A, WAIT, do(LAND_START), B, do(cmd.DO_JUMP, 2, 1), DOWN, do(LAND_START), B, DOWN)
    assert back.safe is None
    assert "jumps_back_into_return" in codes(back.not_judged)


def test_what_stands_behind_an_endless_loop_is_a_finding_and_its_time_is_told() -> None:
    at_once = dict.fromkeys(("accel_m_s2", "corner_accel_m_s2"), math.inf)  # a round takes its length over the speed
    craft = replace(vehicle(COPTER), energy=Energy(120.0, 100.0, battery_j=1e6, reserve=0.0), **at_once)
    back = do(cmd.DO_JUMP, 2, -1)
    verdict = flown(COPTER, A, B, back, DOWN, craft=craft)
    assert [(f.kind, f.seq) for f in verdict.findings] == [("unreachable", 5)]
    alone = flown(COPTER, A, B, back, craft=craft)
    assert alone.safe is True
    used, round_s = alone.energy_j, 2000.0 / 15.0
    assert alone.until_reserve_s == pytest.approx((1e6 - used) / 200_000.0 * round_s, rel=1e-2)


def test_px4_goes_on_with_nothing_behind_an_item_without_autocontinue() -> None:
    stops = replace(A, autocontinue=False)
    assert [f.kind for f in flown(PX4, stops, B, DOWN).findings] == ["unreachable"]
    assert flown(COPTER, stops, B, DOWN).safe is True  # ArduPilot ignores it
    assert flown(PX4, A, B, replace(DOWN, autocontinue=False)).safe is True


@pytest.mark.parametrize("item", [at(cmd.WAYPOINT, 1000, 0, 130, frame=10), at(cmd.WAYPOINT, 1000, 0, 130, frame=11)])
def test_px4_takes_no_terrain_frame(item: MissionItem) -> None:
    verdict = flown(PX4, item, DOWN)
    assert [(f.kind, f.seq) for f in verdict.findings] == [("refused", 1)]
    assert verdict.findings[0].note.code == "refused_on_upload"
    assert "PX4 takes no item in frame" in verdict.findings[0].message
    assert flown(COPTER, item, DOWN, craft=vehicle(COPTER, min_agl_m=20.0)).safe is True


@pytest.mark.parametrize(
    ("autopilot", "item"),
    [
        (PX4, at(cmd.LOITER_TURNS, 1500, 0, 100, 2, 0, 30)), (PX4, at(cmd.DO_CHANGE_SPEED, 0)), (PX4, do(cmd.WAYPOINT)),
        (PLANE, at(cmd.SPLINE_WAYPOINT, 1500)), (COPTER, at(cmd.WAYPOINT, 1500, frame=1)),
        (COPTER, at(cmd.WAYPOINT, 1500, 0, 100, math.inf)),
        (COPTER, at(cmd.LOITER_TIME, 1500, 0, 100, 5, 0, 0, math.nan)),
    ],
)  # fmt: skip
def test_what_the_autopilot_will_not_take_is_a_finding(autopilot: Autopilot, item: MissionItem) -> None:
    end = at(cmd.LOITER_UNLIM, 2000)
    assert "refused" in {f.kind for f in flown(autopilot, A, item, end).findings}


@pytest.mark.parametrize(
    ("autopilot", "item", "code"),
    [
        (PX4, at(cmd.LAND, 2000, 0, 0, 0, 2.0), "precision_landing"),
        (PX4, at(cmd.WAYPOINT, 1500, 0, 100, math.nan), "hold_without_known_end"),
        (PLANE, at(cmd.VTOL_LAND, 2000, 0, 0, 1.0), "lands_as_wing"),
    ],
)
def test_params_that_make_another_flight_of_a_command_are_named(
    autopilot: Autopilot, item: MissionItem, code: str
) -> None:
    verdict = flown(autopilot, A, B, item)
    assert verdict.safe is None
    assert code in codes(verdict.not_judged)


def test_a_planes_return_that_leads_on_to_a_landing_is_not_judged() -> None:
    assert flown(PLANE, A, do(cmd.RTL), rtl_m=120.0).safe is True
    verdict = flown(PLANE, A, do(cmd.RTL), do(LAND_START), rtl_m=120.0)
    assert verdict.safe is None
    assert codes(verdict.not_judged) == ["return_leads_to_landing"]
