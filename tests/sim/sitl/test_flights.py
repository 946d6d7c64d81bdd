"""When a vehicle in SITL arrives, when its flight is over, and why it did not arrive."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.notes.note import Note
from gcsplan.sim.sitl.flights import FlightWatch, arrival_s, is_column, is_over, reach_m
from tests.support.sitl_parts import PLANE, a_part, ramp


def test_a_plane_arrives_where_it_is_nearest_or_would_be_at_a_circles_centre() -> None:
    part = a_part(ramp(), PLANE, turn_radius_m=100.0)
    times, speed = np.arange(0.0, 60.0), np.full(60, 20.0)
    passes = np.hypot(20.0 * (times - 40.0), 4.0)
    assert arrival_s(part, times, passes, speed) == 40.0
    assert reach_m(part) == 150.0
    circle = MissionItem(cmd.LOITER_UNLIM, 3, (0, 0, 100.0, 0))
    circling = replace(part, mission=replace(part.mission, items=(*part.mission.items[:-1], circle)))
    turns = np.maximum(800.0 - 20.0 * times, 112.0)
    assert arrival_s(circling, times, turns, speed) == pytest.approx(40.0)
    assert math.isnan(arrival_s(part, times, passes + 200.0, speed))


def test_a_planes_climb_out_and_glide_are_columns() -> None:
    where = ramp()
    part = a_part(where, PLANE, turn_radius_m=100.0)
    climb_out_m = part.verdict.legs[0].horizontal_m
    assert part.verdict.legs[0].column
    east = np.linspace(0.0, 1600.0, 161)
    points = np.column_stack([east, np.zeros(161), np.full(161, 560.0)])
    items = np.where(east < 1500.0, 2, 3)
    column = is_column(part, points, items)
    assert column.tolist() == ((east[1:] <= climb_out_m + 1e-6) | (items[:-1] == 3)).tolist()


def test_a_plane_that_circles_is_watched_for_a_while() -> None:
    part = a_part(ramp(), PLANE, turn_radius_m=100.0)
    circle = MissionItem(cmd.LOITER_UNLIM, 3, (0, 0, 100.0, 0))
    circling = replace(part, mission=replace(part.mission, items=(*part.mission.items[:-1], circle)))
    goal, away = (36.61, -84.3, 560.0), (36.62, -84.3, 560.0)
    clock = list(range(0, 80_000, 1000))
    assert is_over(circling, [goal] * 80, clock, goal)
    assert not is_over(circling, [away] * 40 + [goal] * 40, clock, goal)
    assert not is_over(circling, [away] * 80, clock, goal)
    assert not is_over(part, [goal] * 80, clock, goal)  # it lands


def text(words: str, severity: int = 6) -> Any:
    return SimpleNamespace(get_type=lambda: "STATUSTEXT", text=words, severity=severity)


def beat(mode: int) -> Any:
    return SimpleNamespace(get_type=lambda: "HEARTBEAT", custom_mode=mode)


def test_ground_that_is_hit_on_the_way_ends_the_flight_with_its_cause() -> None:
    watch = FlightWatch(a_part(ramp()).mission)
    watch.note(beat(3), 1)
    watch.note(text("SIM Hit ground at 0.9 m/s"), 1)  # at take-off
    assert not watch.crashed
    watch.note(text("SIM Hit ground at 0.01 m/s"), 2)
    assert not watch.crashed
    watch.note(text("SIM Hit ground at 1.502964 m/s"), 2)
    assert watch.crashed
    [hit] = watch.why()
    assert (hit.code, hit.item) == ("hit_ground", 2)
    assert str(hit) == "it hit the ground at 1.5 m/s on its way to item 2"
    assert watch.why(90.0) == (hit, Note("other_ground", height_m=90.0))


def test_a_landing_touches_the_ground() -> None:
    watch = FlightWatch(a_part(ramp()).mission)
    watch.note(text("SIM Hit ground at 0.6 m/s"), 3)
    assert not watch.crashed
    assert watch.why(90.0) == ()


def test_a_failsafe_is_named_with_what_the_vehicle_said() -> None:
    watch = FlightWatch(a_part(ramp()).mission)
    watch.note(text("Reached command #1"), 1)
    watch.note(text("Battery Failsafe", 4), 2)
    watch.note(beat(3), 2)
    watch.note(beat(6), 2)
    watch.note(beat(9), 2)
    watch.timed_out = True
    assert watch.why() == (
        Note("left_auto", 2, mode="RTL"), Note("time_was_up", 2), Note("vehicle_said", texts="Battery Failsafe"),
    )  # fmt: skip
    never = Note("never_arrived_for", name="uav1", why=watch.why())
    assert str(never) == (
        "uav1 never arrived at its goal: it left AUTO for RTL at item 2, it still flew to item 2 when the time was up, "
        "it sent: Battery Failsafe"
    )
