"""The battery for the mission and for the return from each point: closed forms on flat ground, sampling elsewhere."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.check.battery import BatteryHome, battery_home, flown
from gcsplan.check.judge import judge
from gcsplan.check.motion.stopping import detour_home_m
from gcsplan.check.verdict import LegFigures, Verdict
from gcsplan.mavlink.mission.commands import LAND, LOITER_TIME, RTL, TAKEOFF, WAYPOINT
from gcsplan.mavlink.mission.mission import RELATIVE, Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.world.world import World
from tests.support.effort import draws
from tests.support.worlds import vehicle, world

FLAT = world(300.0)
R1, R2, HOVER = 120.0, 100.0, 400.0


WAITS_J = HOVER * 5.0  # over home (RTL_LOIT_TIME)
MORE_M = 2.0 * (15.0**2 / (2.0 * 2.5) + 1.25)
"""Out and back while a copter brakes from its 15 m/s before it turns home."""


def craft(battery_j: float | None, reserve: float = 0.2) -> Vehicle:
    return replace(vehicle(), energy=Energy(R1, R2, HOVER, battery_j, reserve))


def out(w: World, *places: tuple[float, float, float], hold_s: float = 0.0, last: int = LAND) -> Mission:
    lat, lon = (float(x) for x in w.frame.to_degrees(0.0, 0.0))
    home = Home.at(lat, lon, 300.0)
    items = [MissionItem(TAKEOFF, RELATIVE, x=home.lat_e7, y=home.lon_e7, z=80.0)]
    for east, north, up in places:
        lat, lon = (float(x) for x in w.frame.to_degrees(east, north))
        items.append(MissionItem(WAYPOINT, RELATIVE, x=round(lat * 1e7), y=round(lon * 1e7), z=up))
    if hold_s:
        items.append(MissionItem(LOITER_TIME, RELATIVE, (hold_s, 0, 0, 0), items[-1].x, items[-1].y, items[-1].z))
    items.append(MissionItem(last, RELATIVE, x=items[-1].x, y=items[-1].y) if last == LAND else MissionItem(last, 2))
    return Mission(Autopilot.ARDUCOPTER, home, tuple(items))


def home_of(v: Verdict, craft: Vehicle, level_rel_home_m: float = 15.0) -> BatteryHome:
    h = v.mission.home
    place = (h.lat_e7 / 1e7, h.lon_e7 / 1e7, h.amsl_m)
    found = battery_home(v, craft, place, h.amsl_m + level_rel_home_m)
    assert found is not None
    return found


def test_the_point_of_no_return_on_a_straight_way_out() -> None:
    # Out at 80 m: spent 80·R1 + x·R2, back (x + MORE_M)·R2 + 80·R1, and the seconds over home.
    usable = 0.8 * 600_000.0
    x = (usable - 160.0 * R1 - MORE_M * R2 - WAITS_J) / (2.0 * R2)
    plane = craft(600_000.0)
    found = home_of(judge(out(FLAT, (5000.0, 0.0, 80.0)), plane, FLAT), plane)
    assert found.no_return_m == pytest.approx(x, rel=1e-5)
    assert found.no_return_seq == 2
    assert found.point_of_no_return is not None
    assert float(FLAT.frame.to_plane(*found.point_of_no_return[:2])[0]) == pytest.approx(x, rel=1e-4)
    assert found.short == ((pytest.approx(x, rel=1e-5), pytest.approx(5000.0, rel=1e-5)),)
    # A return needs most at the far end. After the landing there it must climb again to its altitude, by 15 m, but it
    # does not brake.
    assert found.most_j == pytest.approx(160 * R1 + (5000 + 5000 + MORE_M) * R2 + WAITS_J, rel=1e-5)
    assert found.legs[-1].return_j == pytest.approx(5000 * R2 + 2 * 15 * R1 + WAITS_J, rel=1e-5)
    assert found.note.code == "point_of_no_return"
    assert "point of no return at km 2.25" in str(found.note)


def test_a_battery_that_reaches_has_no_point_of_no_return() -> None:
    big = craft(2_000_000.0)
    found = home_of(judge(out(FLAT, (5000.0, 0.0, 80.0)), big, FLAT), big)
    assert found.point_of_no_return is None
    assert found.short == ()
    assert found.most_percent == pytest.approx(100.0 * found.most_j / 2_000_000.0)
    assert found.note.code == "battery_enough"
    assert found.as_dict()["no_return_m"] is None


def test_legs_add_up_to_the_verdict_and_holds_count_at_their_place() -> None:
    v = craft(2_000_000.0)
    verdict = judge(out(FLAT, (1000.0, 0.0, 80.0), (1000.0, 900.0, 120.0), hold_s=60.0), v, FLAT)
    found = home_of(verdict, v)
    assert found.legs[-1].spent_j == pytest.approx(verdict.energy_j)
    assert found.legs[-1].used_percent == pytest.approx(verdict.battery_used_percent)
    hold = next(row for row in found.legs if row.kind == "loiter")
    assert hold.energy_j == pytest.approx(60.0 * HOVER)
    # Usable energy ends just before the hold does: the hold is what exceeds it, at its own place.
    before = next(row for row in found.legs if row.seq == 3)
    need = before.spent_j + before.return_j + 30.0 * HOVER
    tight = craft(need / 0.8)
    short = home_of(judge(verdict.mission, tight, FLAT), tight)
    assert short.no_return_seq == 4
    assert short.no_return_m == pytest.approx(1900.0, abs=1.0)


def test_a_way_that_leads_back_may_be_short_in_the_middle_alone() -> None:
    v = craft(0.9 * (160 * R1 + 2 * 3000 * R2) / 0.8)
    verdict = judge(out(FLAT, (3000.0, 0.0, 80.0), (0.0, 0.0, 80.0)), v, FLAT)
    found = home_of(verdict, v)
    (part,) = found.short
    # On the leg back, energy spent plus energy of the return stays what it was at the turn.
    may = 0.9 * (160 * R1 + 2 * 3000 * R2) - 160 * R1 - MORE_M * R2 - WAITS_J
    assert part[0] == pytest.approx(may / (2 * R2), rel=1e-4)
    assert part[1] == pytest.approx(6000.0, rel=1e-5)


def test_a_return_of_the_mission_itself_is_not_counted_twice() -> None:
    v = craft(2_000_000.0)
    verdict = judge(out(FLAT, (2000.0, 0.0, 80.0), last=RTL), v, FLAT, rtl_rel_home_m=80.0)
    found = home_of(verdict, v, 80.0)
    assert found.most_j == pytest.approx(verdict.energy_j + MORE_M * R2, rel=1e-5)
    assert {row.kind for row in found.legs} == {"takeoff", "cruise"}


def test_without_a_capacity_nothing_is_said() -> None:
    v = craft(None)
    verdict = judge(out(FLAT, (2000.0, 0.0, 80.0)), v, FLAT)
    assert battery_home(verdict, v, (36.6, -84.3, 300.0), 315.0) is None


def test_rounds_are_flown_as_often_as_they_are() -> None:
    verdict = judge(out(FLAT, (1000.0, 0.0, 80.0), (1000.0, 900.0, 80.0), (0.0, 900.0, 80.0)), craft(None), FLAT)
    legs = [replace(leg, times=3) if leg.seq in (3, 4) else leg for leg in verdict.legs]
    assert [(leg.seq, j, m) for leg, j, m in flown(legs)] == [(k, 0, 0) for k in (1, 2, 3, 4, 3, 4, 3, 4, 5)]


def test_a_plane_that_circles_for_a_time_flies_on() -> None:
    plane = replace(vehicle(Autopilot.ARDUPLANE), turn_radius_m=80.0, energy=Energy(R1, R2, 0.0, 1e9))
    mission = replace(out(FLAT, (3000.0, 0.0, 80.0), hold_s=600.0, last=RTL), autopilot=Autopilot.ARDUPLANE)
    (circle,) = [leg for leg in judge(mission, plane, FLAT).legs if leg.kind == "loiter"]
    assert circle.hold_s == 600.0
    assert circle.energy_j == circle.hold_j == pytest.approx(R2 * plane.speed_max_m_s * 600.0)


def test_rounds_that_are_left_out_count_in_full() -> None:
    v = craft(1e12)
    verdict = judge(out(FLAT, (1000.0, 0.0, 80.0), (1000.0, 900.0, 80.0), (0.0, 900.0, 80.0)), v, FLAT)
    many = replace(verdict, legs=tuple(replace(leg, times=2500) if leg.seq in (3, 4) else leg for leg in verdict.legs))
    found = home_of(many, v)
    assert found.legs[-1].spent_j == pytest.approx(math.fsum(leg.energy_j * leg.times for leg in many.legs), rel=1e-9)
    assert found.most_m > 2500 * 900.0


@pytest.mark.slow
@settings(max_examples=draws(40))
@given(
    places=st.lists(
        st.tuples(st.floats(-3000, 3000), st.floats(-3000, 3000), st.floats(5, 200)), min_size=1, max_size=4
    ),
    battery=st.floats(1e5, 3e6), level=st.floats(5, 250), climbs_first=st.booleans(),
)  # fmt: skip
def test_what_is_short_is_what_sampling_finds(
    places: list[tuple[float, float, float]], battery: float, level: float, climbs_first: bool
) -> None:
    v = craft(battery, 0.1)
    verdict = judge(out(FLAT, *places), v, FLAT)
    h = verdict.mission.home
    place = (h.lat_e7 / 1e7, h.lon_e7 / 1e7, h.amsl_m)
    autopilot = Autopilot.ARDUCOPTER if climbs_first else Autopilot.ARDUPLANE  # a plane may return below its altitude
    found = battery_home(verdict, replace(v, autopilot=autopilot), place, 300.0 + level)
    assert found is not None
    spent = along = most = 0.0
    for leg in verdict.legs:
        a, b = np.array(leg.start), np.array(leg.end)
        for f in np.linspace(0.0, 1.0, 23):
            at = a + f * (b - a)
            away = math.hypot(*FLAT.frame.to_plane(at[0], at[1]))
            more = MORE_M * (leg.horizontal_m > 0.0)  # a copter that moves brakes first, a plane turns about
            if not climbs_first:
                more = detour_home_m(replace(v, autopilot=autopilot), v.speed_max_m_s, at[2])
            top = max(300.0 + level, at[2]) if climbs_first else 300.0 + level
            waits_j = WAITS_J if climbs_first else 0.0
            need = spent + f * leg.energy_j + R2 * (away + more) + R1 * (abs(top - at[2]) + top - 300.0) + waits_j
            most = max(most, need)
            s = along + f * leg.horizontal_m
            inside = any(x - 1.0 <= s <= y + 1.0 for x, y in found.short)
            if need > 0.9 * battery * (1 + 1e-4) + 1.0:
                assert inside
            if leg.horizontal_m > 5.0 and need < 0.9 * battery * (1 - 1e-3) - 200.0:
                assert not any(x + 2.0 < s < y - 2.0 for x, y in found.short)
        spent, along = spent + leg.energy_j, along + leg.horizontal_m
    assert found.most_j >= most * (1 - 1e-4)
    assert bool(found.short) == (found.no_return_m is not None)


def test_figures_of_a_leg_are_those_of_the_verdict() -> None:
    leg: LegFigures = judge(out(FLAT, (1000.0, 0.0, 80.0)), craft(None), FLAT).legs[1]
    v = craft(1_000_000.0)
    row = home_of(judge(out(FLAT, (1000.0, 0.0, 80.0)), v, FLAT), v).legs[1]
    assert (row.seq, row.kind, row.energy_j) == (leg.seq, leg.kind, leg.energy_j)
    assert row.with_return_percent == pytest.approx(100.0 * (row.spent_j + row.return_j) / 1_000_000.0)
