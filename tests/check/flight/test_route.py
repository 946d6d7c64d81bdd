"""The order in which items are flown: jumps, compared with an interpreter that follows every single round."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.check.flight.follow import Flight, follow
from gcsplan.check.motion.spline import chords, towards
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits
from tests.support.effort import draws
from tests.support.noted import codes

HOME = Home.at(36.6, -84.3, 300.0)
TAKEOFF = MissionItem(cmd.TAKEOFF, m.RELATIVE, z=65.0)


def way_point(number: int) -> MissionItem:
    return MissionItem(cmd.WAYPOINT, m.RELATIVE, (0, 0, 0, 0), 366_000_000 + 10_000 * number, -843_000_000, 80.0)


def jump(target: int, rounds: int) -> MissionItem:
    return MissionItem(cmd.DO_JUMP, m.NO_POSITION, (target, rounds, 0, 0))


def fly(*items: MissionItem, autopilot: Autopilot = Autopilot.ARDUCOPTER) -> Flight:
    craft = Vehicle("uav1", 1, autopilot, Limits(min_agl_m=60))
    return follow(Mission(autopilot, HOME, (TAKEOFF, *items)), craft, lambda lat, lon: 300.0)


def legs(flight: Flight) -> Counter[tuple[float, float]]:
    """The number of times each leg is flown, by the latitudes of its ends."""
    count: Counter[tuple[float, float]] = Counter()
    for s in flight.stretches:
        if s.kind == "cruise":
            count[s.start[0], s.end[0]] += s.times
    return count


def flown_one_by_one(items: tuple[MissionItem, ...], first: int, most: int = 20_000) -> Counter[tuple[float, float]]:
    done: Counter[int] = Counter()
    count: Counter[tuple[float, float]] = Counter()
    here, index = 36.6, 0
    for _ in range(most):
        if index >= len(items):
            break
        item = items[index]
        if item.command == cmd.DO_JUMP:
            if done[index] < item.params[1]:
                done[index] += 1
                index = int(item.params[0]) - first
            else:
                index += 1
            continue
        if item.command == cmd.WAYPOINT:
            count[here, item.lat_deg] += 1
            here = item.lat_deg
        index += 1
    else:
        raise AssertionError("the oracle did not end")
    return count


@st.composite
def jumpy(draw: st.DrawFn) -> tuple[MissionItem, ...]:
    items: list[MissionItem] = []
    size = draw(st.integers(2, 9))
    for number in range(size):
        if number and draw(st.booleans()):
            items.append(jump(draw(st.integers(2, size + 1)), draw(st.integers(0, 4))))
        else:
            items.append(way_point(number))
    return tuple(items)


@settings(max_examples=draws(120))
@given(jumpy())
def test_every_leg_is_flown_as_often_as_one_by_one(items: tuple[MissionItem, ...]) -> None:
    # Targets of jumps are wire numbers, where the take-off is item 1.
    assert legs(fly(*items)) == flown_one_by_one((TAKEOFF, *items), 1)


def test_many_rounds_are_followed_once_and_counted() -> None:
    flight = fly(way_point(1), way_point(2), jump(2, 30_000), way_point(3))
    assert len(flight.stretches) < 10
    assert flight.not_judged == []
    assert legs(flight)[way_point(2).lat_deg, way_point(1).lat_deg] == 30_000


def test_a_leg_after_a_jump_names_the_jump() -> None:
    flight = fly(way_point(1), way_point(2), jump(2, 1))
    assert [(s.seq, s.jumped_from) for s in flight.stretches] == [(1, None), (2, None), (3, None), (2, 4), (3, None)]


def test_a_jump_without_end_is_flown_once_and_named() -> None:
    flight = fly(way_point(1), way_point(2), jump(2, -1), way_point(3))
    assert (way_point(2).lat_deg, way_point(1).lat_deg) in legs(flight)
    assert all(s.seq != 5 for s in flight.stretches)
    never = Note("items_after_jump", first=5, last=5)
    assert Note("jumps_without_end", 4, target=2, never=never) in flight.notes
    assert flight.not_judged == []


def flown_anew(items: tuple[MissionItem, ...], first: int) -> Counter[tuple[float, float]]:
    """As ArduPilot 4.7 flies: the count of a jump begins anew when it has been skipped (get_next_do_cmd)."""
    done: Counter[int] = Counter()
    count: Counter[tuple[float, float]] = Counter()
    here, index = 36.6, 0
    for _ in range(20_000):
        if index >= len(items):
            return count
        item = items[index]
        if item.command == cmd.DO_JUMP and done[index] < item.params[1]:
            done[index] += 1
            index = int(item.params[0]) - first
            continue
        done[index] = 0
        if item.command == cmd.WAYPOINT:
            count[here, item.lat_deg] += 1
            here = item.lat_deg
        index += 1
    return Counter({(math.nan, math.nan): 1})  # it never ends


@settings(max_examples=draws(120))
@given(jumpy())
def test_what_is_judged_is_flown_so_by_every_version(items: tuple[MissionItem, ...]) -> None:
    """A jump that is reached again after its rounds is judged by none: 4.7 begins its count anew."""
    flight = fly(*items)
    same = legs(flight) == flown_anew((TAKEOFF, *items), 1)
    assert same or "jump_counted_by_version" in codes(flight.not_judged)


def test_a_loop_within_a_loop_is_not_judged_on_ardupilot() -> None:
    items = (way_point(1), way_point(2), jump(2, 2), way_point(3), jump(2, 1))
    assert fly(*items).not_judged == [Note("jump_counted_by_version", 4, rounds=2)]
    assert flown_anew((TAKEOFF, *items), 1) - legs(fly(*items)) != Counter()
    assert fly(*items, autopilot=Autopilot.PX4).not_judged == []
    assert fly(*items[:4]).not_judged == []


def test_px4_counts_from_zero_and_keeps_sixteen_bits() -> None:
    flight = fly(way_point(1), way_point(2), jump(1, 65_535), autopilot=Autopilot.PX4)
    assert legs(flight)[way_point(2).lat_deg, way_point(1).lat_deg] == 65_535


def test_a_jump_to_nowhere_and_a_circle_of_nothing_are_not_judged() -> None:
    assert codes(fly(way_point(1), jump(99, 1)).not_judged) == ["jump_target_missing"]
    assert codes(fly(way_point(1), jump(3, -1)).not_judged) == ["jump_flies_nothing"]


def test_more_jumps_than_ardupilot_counts_are_not_judged() -> None:
    items = [way_point(1), *(jump(2, 1) for _ in range(16))]
    assert Note("too_many_jumps", count=16, most=15) in fly(*items).not_judged


def test_a_jump_by_tag_leads_to_its_tag_on_ardupilot_alone() -> None:
    items = [MissionItem(600, 2, (7, 0, 0, 0)), way_point(1), way_point(2), MissionItem(601, 2, (7, 2, 0, 0))]
    assert legs(fly(*items))[way_point(2).lat_deg, way_point(1).lat_deg] == 2
    assert fly(*items, autopilot=Autopilot.PX4).not_judged != []


@pytest.mark.parametrize("seed", range(5))
def test_a_splines_chords_hold_the_whole_curve(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, end = (36.6, -84.3, 400.0), (36.6 + rng.uniform(-0.01, 0.01), -84.3 + rng.uniform(-0.01, 0.01), 450.0)
    leaves, arrives = rng.uniform(-3000, 3000, (2, 3)) * [1, 1, 0.05]
    places, bulge_m, _ = chords(start, end, leaves, arrives)
    assert places[0] == start
    assert places[-1] == end
    points = np.array([towards(start, p) for p in places])
    # The same curve in Bernstein form.
    way = towards(start, end)
    shrink = min(1.0, 4.0 * np.linalg.norm(way) / (np.linalg.norm(leaves) + np.linalg.norm(arrives)))
    control = np.array([np.zeros(3), leaves * shrink / 3, way - arrives * shrink / 3, way])
    t = np.linspace(0, 1, 4001)[:, None]
    curve = sum(k * t**i * (1 - t) ** (3 - i) * control[i] for i, k in enumerate((1, 3, 3, 1)))
    a, d = points[:-1, None], np.diff(points, axis=0)[:, None]
    along = np.clip(((curve - a) * d).sum(-1) / (d**2).sum(-1), 0, 1)
    off = np.linalg.norm(curve - a - along[..., None] * d, axis=-1).min(axis=0)
    assert off.max() <= bulge_m + 0.5  # curve and oracle both use a flat earth: 0.5 m covers the difference
    assert bulge_m < 0.3
