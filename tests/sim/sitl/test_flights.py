"""When a plane in SITL arrives, and when its flight is over."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.sim.sitl.flights import arrival_s, is_column, is_over, reach_m
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
