"""Fences held against the mission: one that the flight would breach is refused, its file's own is judged."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.app.check import fence_breaches
from gcsplan.check.judge import judge
from gcsplan.errors import CheckFailed, InputError
from gcsplan.mavlink.build.fence import areas_of, fence_of
from gcsplan.mavlink.build.multirotor import build_mission
from gcsplan.mavlink.build.order import Order
from gcsplan.mavlink.files.formats import read_mission_file, write_plan
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.vehicle import Autopilot
from gcsplan.world.geometry.path import Path as FlightPath
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.fences import COPTER, FRAME, OVER, corners, mission_in
from tests.support.worlds import vehicle, world


def test_a_fence_that_the_mission_flies_over_is_refused_by_name() -> None:
    mast = Zone("mast", Circle(1500, 10, 60), None, Level(50, "agl"))
    where, craft = world(zones=[mast, Zone("yard", Circle(1500, 300, 100))]), vehicle(horizontal_clearance_m=30)
    mission = mission_in(where, craft)
    fence = fence_breaches.fence_for(mission, craft, where)
    assert [z.name for z in fence.zones] == ["yard"]
    with pytest.raises(CheckFailed, match=r"mast(.|\n)*fence-infinite") as refused:
        fence_breaches.fence_for(mission, craft, where, infinite=True)
    assert refused.value.reason == "fence"
    assert "yard" not in str(refused.value)


@pytest.mark.parametrize(("east", "north"), [(0.0, 90.0), (6000.0, 900.0)])
def test_start_and_goal_keep_their_clearance_from_the_fence_too(east: float, north: float) -> None:
    low = Zone("low", Circle(east, north, 80), None, Level(1, "agl"))
    where, craft = world(zones=[low]), vehicle(horizontal_clearance_m=30)
    with pytest.raises(CheckFailed, match="low"):
        fence_breaches.fence_for(mission_in(where, craft), craft, where, infinite=True)


def test_a_mission_that_touches_its_clearance_passes_the_rounded_fence() -> None:
    zone = Zone("near", Circle(1500, 133.025, 100.0))
    where, craft = world(zones=[zone]), vehicle(horizontal_clearance_m=30)
    assert len(fence_breaches.fence_for(mission_in(where, craft), craft, where).items) == 1


def test_inclusion_areas_must_hold_the_whole_flight() -> None:
    where, craft = world(), vehicle()
    mission = mission_in(where, craft)
    ring = np.array([[-100.0, -100], [6100, -100], [6100, 1100], [-100, 1100]])

    def found(shape: Circle | Polygon) -> list[str]:
        (item_zone,) = fence_of([Zone("z", shape)], FRAME, Autopilot.PX4).zones
        items = [replace(i, command=i.command - 1) for i in fence_of([item_zone], FRAME, Autopilot.PX4).items]
        return [f.message for f in fence_breaches.breaches(areas_of(items, FRAME), mission, craft, where)]

    assert found(Polygon(ring)) == []
    assert found(Circle(3000, 0, 4000)) == []
    assert any("item" in w and "leaves" in w for w in found(Polygon(ring * [0.9, 1])))
    assert found(Circle(3000, 0, 3001)) != []  # three metres of track error
    notch = np.array([[-100.0, -100], [1400, -100], [1500, 50], [1600, -100], [6100, -100], [6100, 1100], [-100, 1100]])
    assert found(Polygon(notch)) != []


def own(items: list[MissionItem], path: list[list[float]] = OVER, half_m: float = 12_000.0) -> Any:
    """The verdict on a safe mission beside a fence of its own."""
    where, craft = world(half_m=half_m), vehicle()
    mission = build_mission(FlightPath(np.array(path)), where, craft, (36.6, -84.3), Order())
    if half_m > 12_000.0:  # a long leg is given as many short ones: here it is flown as one
        mission = replace(mission, items=(*mission.items[:2], *mission.items[-2:]))
    verdict = judge(mission, craft, where)
    assert verdict.safe is True
    return fence_breaches.own_fence(items, verdict, craft, where, None)[0]


def ring_of(command: int, *metres: tuple[float, float]) -> list[MissionItem]:
    return corners(command, *(tuple(p) for p in FRAME.to_degrees(*np.array(metres).T).tolist()))


def test_a_mission_that_begins_outside_its_inclusion_area_leaves_it_at_once() -> None:
    """A take-off is a line without length in the plane."""
    verdict = own(ring_of(5001, (500, -500), (6500, -500), (6500, 1500), (500, 1500)))
    assert [(f.seq, f.kind, round(f.by, -1)) for f in verdict.findings] == [(1, "fence", 500)]


def test_far_inclusion_areas_are_left_and_far_exclusion_areas_never_met() -> None:
    far = [(0.0, 5.7), (1.0, 5.7), (1.0, 6.5)]
    (found,) = own(corners(5001, *far)).findings
    assert found.kind == "fence"
    assert "far away" in found.message
    assert math.isnan(found.by)
    assert own(corners(5002, *far)).safe is True
    # Around the mission, with a corner where the plane has no place: held, or flown through.
    around = [(36.5, -84.5), (37.0, -84.5), (0.0, 5.7)]
    assert own(corners(5001, *around)).safe is True
    assert own(corners(5002, *around)).safe is False


def test_an_inclusion_area_holds_the_bow_of_a_long_leg() -> None:
    """A leg of 40 km to the east, straight in degrees, bows by 23 m against the plane."""
    there = np.linspace(-1000.0, 41_000.0, 10)
    for half_m, safe in ((40.0, True), (15.0, False)):
        south, north = ([(east, side) for east in there] for side in (-half_m, half_m))
        verdict = own(ring_of(5001, *south, *north[::-1]), [[0.0, 0, 420], [40_000, 0, 420]], half_m=45_000.0)
        assert verdict.safe is safe, half_m


def test_an_inclusion_area_holds_corners_as_they_are_cut() -> None:
    """PX4 turns at a way point's own radius: 60 m before this one, and is beside both legs then."""
    where, craft = world(), vehicle(Autopilot.PX4)
    path = FlightPath(np.array([[0.0, 0, 420], [3000, 0, 420], [3000, 3000, 420]]))
    mission = build_mission(path, where, craft, (36.6, -84.3), Order())
    ring = ring_of(5001, (-200, -200), (3200, -200), (3200, 3200), (2980, 3200), (2980, 20), (-200, 20))
    for radius_m, safe in ((1.0, True), (60.0, False)):
        items = [replace(i, params=(0.0, radius_m, 0.0, math.nan)) if i.command == 16 else i for i in mission.items]
        cut = replace(mission, items=tuple(items))
        verdict = judge(cut, craft, where)
        assert verdict.safe is True
        assert fence_breaches.own_fence(ring, verdict, craft, where, None)[0].safe is safe, radius_m


@pytest.mark.parametrize("inclusion", [False, True])
def test_a_return_breaches_its_files_own_fence_as_any_leg_does(inclusion: bool) -> None:
    """Out along two sides of a square, and home over its diagonal."""
    where, craft = world(), vehicle()
    path = FlightPath(np.array([[0.0, 0, 420], [3000, 0, 420], [3000, 3000, 420]]))
    mission = build_mission(path, where, craft, (36.6, -84.3), Order(end="rtl"))
    verdict = judge(mission, craft, where, rtl_rel_home_m=120.0)
    assert verdict.safe is True
    if inclusion:
        areas = ring_of(5001, (-200, -200), (3200, -200), (3200, 3200), (2800, 3200), (2800, 200), (-200, 200))
    else:
        areas = ring_of(5002, (1400, 1400), (1600, 1400), (1600, 1600), (1400, 1600))
    judged, _ = fence_breaches.own_fence(areas, verdict, craft, where, 120.0)
    assert [(f.seq, f.kind) for f in judged.findings] == [(len(mission.items), "fence")]


def test_a_fence_that_crosses_itself_is_not_judged() -> None:
    verdict = own(ring_of(5001, (-500, -500), (6500, 1500), (6500, -500), (-500, 1500)))
    assert verdict.safe is None
    assert any("crosses" in str(words) for words in verdict.not_judged)


def test_a_zone_too_thin_for_a_fence_is_refused_with_the_cure() -> None:
    where, craft = world(zones=[Zone("hair", Polygon(np.array([[0, 900], [900, 900], [900, 900.004]])))]), vehicle()
    with pytest.raises(InputError, match="too thin"):
        fence_breaches.fence_for(mission_in(where, craft), craft, where)


def test_a_plan_files_own_fence_is_read_and_judged(tmp_path: Path) -> None:
    where, craft = world(), vehicle()
    mission = mission_in(where, craft)
    for north, safe in ((300.0, True), (50.0, False)):
        fence = fence_of([Zone("z", Circle(1500, north, 100))], FRAME, COPTER)
        file = tmp_path / "uav1.plan"
        file.write_text(write_plan(mission, fence=fence.items))
        read = read_mission_file(file, autopilot=COPTER)
        assert read.fence == fence.items
        verdict, told = fence_breaches.own_fence(read.fence, judge(mission, craft, where), craft, where, None)
        assert "1 area to stay out of" in str(told[0])
        assert verdict.safe is safe
