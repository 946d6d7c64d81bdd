"""A VTOL takes off and lands vertically; what it flies in between is judged as on its wing."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from gcsplan.check.fixed_wing.ends import brakes_m
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.zones import Circle, Level, Zone
from gcsplan.world.world import World
from tests.check.flight.test_corners import FLAT, HOME, PLANE, around, at, inside, verdict
from tests.support.noted import coded
from tests.support.worlds import vehicle

CRAFT = replace(vehicle(PLANE, horizontal_clearance_m=0.0), speed_max_m_s=20.0, turn_radius_m=71.0, vtol=True)


def swung_m(accepts_m: float, speed_m_s: float, bank_deg: float, turn_deg: float) -> tuple[float, float]:
    """Where an aircraft that banks at once when it is near its corner (the origin, coming from the west) is farthest
    east: (east, north), m. Steps of a hundredth of a second, as a pilot flies them."""
    x, y, course = -accepts_m, 0.0, 0.0
    rate = 9.80665 * math.tan(math.radians(bank_deg)) / speed_m_s
    while course < math.radians(turn_deg):
        x, y = x + 0.01 * speed_m_s * math.cos(course), y + 0.01 * speed_m_s * math.sin(course)
        course += 0.01 * rate
    return x, y


@pytest.mark.parametrize("accepts_m", [1.0, 3.0, 20.0])
def test_a_vtol_swings_wide_of_a_corner_that_it_begins_late(accepts_m: float) -> None:
    east, north = swung_m(accepts_m, 20.0, 30.0, 90.0)
    assert east > 40.0
    beyond = inside(1000.0 + east, north, 5.0)
    assert verdict(around(PLANE, accepts_m), beyond, CRAFT).safe is False
    assert (
        verdict(around(PLANE, 71.0), beyond, CRAFT).safe is True
    )  # where the arc begins in time, it touches both legs


def test_an_arduplane_without_a_radius_is_not_judged() -> None:
    found = verdict(around(PLANE, 5.0), FLAT, replace(CRAFT, turn_radius_m=0.0))
    assert found.safe is None
    coded(found.not_judged, "arcs_without_radius")


def landing(way_m: float) -> Mission:
    """North to a way point ``way_m`` before its landing place."""
    items = (
        at(cmd.VTOL_TAKEOFF, 0, 0, 100),
        at(cmd.WAYPOINT, 0, 1000, 100, 0, 3.0),
        at(cmd.VTOL_LAND, 0, 1000 + way_m, 0),
    )
    return Mission(PLANE, HOME, items, "uav1")


def test_a_landing_with_a_short_way_to_it_is_overshot() -> None:
    beyond = inside(0.0, 1150.0, 30.0)
    assert verdict(landing(50.0), beyond, CRAFT).safe is False
    found = verdict(landing(115.0), inside(0.0, 1200.0, 30.0), CRAFT)
    assert found.safe is True, found.describe()
    brakes = brakes_m(CRAFT, 400.0)
    assert 20.0**2 / 4.0 < brakes < 1.2 * 20.0**2 / 4.0
    assert coded(verdict(landing(0.0), FLAT, CRAFT).notes, "vtol_overshoots").data["past_m"] == pytest.approx(brakes)


def test_the_nose_must_point_along_the_first_leg() -> None:
    assert coded(verdict(around(PLANE, 71.0), FLAT, CRAFT).notes, "vtol_sets_off").data["heading_deg"] == pytest.approx(
        90, abs=0.1
    )


def test_a_take_off_or_landing_on_the_wing_is_not_judged() -> None:
    up, down = at(cmd.TAKEOFF, 0, 0, 100), MissionItem(cmd.LAND, m.RELATIVE)
    for items, code in ((up, "runway_take_off"), (down, "runway_landing")):
        one = landing(200.0)
        changed = (up, *one.items[1:]) if items is up else (*one.items[:-1], down)
        found = verdict(replace(one, items=changed), FLAT, CRAFT)
        assert found.safe is None
        coded(found.not_judged, code)


def low(up_m: float, north_m: float) -> World:
    """A zone of 40 m up to ``up_m`` above the ground of home, on the way to the landing of `landing`."""
    return World(
        FLAT.frame, Airspace(FLAT.airspace.surface, [Zone("low", Circle(0.0, north_m, 40.0), None, Level(up_m, "agl"))])
    )


def test_the_way_to_a_landing_is_as_low_as_it_is_where_the_item_begins() -> None:
    # A climb of 10 % ends at 200 m, and the landing begins 60 m before: at 194 m, less 5 m of error.
    up, _, land = landing(400.0).items
    climbs = at(cmd.WAYPOINT, 0, 1000, 200, 0, 60.0)
    flown = Mission(PLANE, HOME, (up, climbs, land), "uav1")
    assert verdict(flown, low(190.0, 1250.0), CRAFT).safe is False
    assert verdict(flown, low(188.0, 1250.0), CRAFT).safe is True


@pytest.mark.parametrize(("command", "under_m"), [(cmd.VTOL_LAND, (92.0, 86.0)), (cmd.LAND, (63.0, 51.0))])
def test_a_landing_behind_a_circle_begins_lower(command: int, under_m: tuple[float, float]) -> None:
    # LOITER_TO_ALT counts its altitude as reached within 5 m; a glide corrects that within its first half.
    circle, down = at(cmd.LOITER_TO_ALT, 0, 1000, 100, 0, 80.0), at(command, 0, 3000, 0)
    flown = Mission(PLANE, HOME, (at(cmd.VTOL_TAKEOFF, 0, 0, 75), circle, down), "uav1")
    craft = replace(CRAFT, vtol=command == cmd.VTOL_LAND)
    kinds = [{f.kind for f in verdict(flown, low(up_m, 1500.0), craft).findings} for up_m in under_m]
    assert ["zone" in found for found in kinds] == [True, False]
