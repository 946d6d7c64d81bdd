"""Detours past zones that a path cannot pass over or under, or cannot climb over in time: with laps, or around."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gcsplan.bench.terrain.problems import problems
from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.plane.corridor import SideChoice
from gcsplan.planners.optimal.plane.detour_search import DetourSearch
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.searches.cap_search import PAST
from gcsplan.planners.optimal.searches.detours import PAST_FINE
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.climb_laps import extend
from gcsplan.planners.profile.exact import sampled_track
from gcsplan.planners.profile.taut_string import Blocked, taut_string
from gcsplan.planners.profile.track import Closed, Flown, Lacking, fly, lacking, sections_of
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.effort import draws
from tests.support.planner_worlds import Floats, faults, ground
from tests.support.searches import improve, looked, plane_of

TENTH = Limits(10.0, max_climb_deg=math.degrees(math.atan(0.1)), max_descent_deg=math.degrees(math.atan(0.1)))
"""Limits with a slope of one in ten, up and down."""


def box(west: float, south: float, east: float, north: float, low: float | None, high: float | None) -> Zone:
    levels = [None if v is None else Level(v, "amsl") for v in (low, high)]
    return Zone("box", Polygon(np.array([[west, south], [east, south], [east, north], [west, north]])), *levels)


def crossing(*zones: Zone, **changes: object) -> Problem:
    """A mission from west to east over level ground, with both ends 10 m high."""
    p = Problem(Airspace(ground(0.0), zones), TENTH, (200.0, 1000.0, 10.0), (1800.0, 1000.0, 10.0), budget_s=600.0)
    return replace(p, **changes)  # type: ignore[arg-type]


def straight(p: Problem) -> tuple[Floats, NDArray[np.bool_], Floats]:
    return np.array([p.start[:2], p.goal[:2]]), np.ones(2, bool), np.full(2, np.nan)


def met(p: Problem, points: Floats) -> list[int]:
    """Indices of the boxes that a path enters, by samples along it."""
    a, b = points[:-1], points[1:]
    at = (a[:, None] + np.linspace(0.0, 1.0, 400)[:, None] * (b - a)[:, None]).reshape(-1, 3)
    out = []
    for k, zone in enumerate(p.airspace.zones):
        west, south, east, north = zone.bounds
        low = -math.inf if zone.floor is None else zone.floor.value_m
        high = math.inf if zone.ceiling is None else zone.ceiling.value_m
        inside = (at > np.array([west, south, low]) + 1e-3) & (at < np.array([east, north, high]) - 1e-3)
        if inside.all(axis=1).any():
            out.append(k)
    return out


def past(work: Workspace) -> None:
    """Run the detour searches, coarse and fine, without bounds and without the lattice for slopes."""
    plane = work.plane
    plane.reach_longest()
    plane.try_below(plane.top_m, fine=True)
    plane.past(PAST, fine=False)
    plane.past(PAST_FINE, fine=True)


def found_in(p: Problem, closer: Callable[[Workspace], None] = past) -> Incumbent:
    """The incumbent after the searches below the ceiling alone, checked after each."""
    work = looked(p)
    below = work.incumbent
    for again in (False, True):
        if again:
            closer(work)
        assert below.best is not None
        assert faults(replace(p, airspace=Airspace(p.airspace.surface)), Path(below.best)) == []
        assert met(p, below.best) == []
    assert below.bound <= below.cost
    return below


def climbing_m(run_m: float, rise_m: float) -> float:
    """Length of a path that rises by ``rise_m`` at a slope of at most 0.1, over a track of at least ``run_m``."""
    return math.hypot(max(run_m, 10.0 * rise_m), rise_m)


def test_a_track_lacks_what_the_climb_takes_beyond_the_way_there() -> None:
    p = crossing(box(500.0, 0.0, 800.0, 2000.0, None, 70.0))
    lack = lacking(p, sampled_track(p, *straight(p)))
    assert isinstance(lack, Lacking)
    # A climb of 60 m has 300 m, but needs 600 m; the descent has enough.
    assert lack.laps_m == pytest.approx(300.0, abs=1.0)
    assert [(why.kind, round(why.s0_m), round(why.s1_m)) for why in lack.steep] == [("climb", 0, 300)]
    assert lack.steep[0].by == pytest.approx(30.0, abs=0.1)
    assert lack.zones == (0,)
    assert lack.cost == pytest.approx(climbing_m(300.0, 60.0) + 300.0 + climbing_m(1000.0, 60.0), rel=1e-3)


def test_a_track_that_can_be_flown_lacks_nothing() -> None:
    p = crossing(box(900.0, 0.0, 1000.0, 2000.0, None, 20.0))
    track = sampled_track(p, *straight(p))
    lack, flown = lacking(p, track), fly(p, track)
    assert isinstance(lack, Lacking)
    assert isinstance(flown, Flown)
    assert (lack.laps_m, lack.steep, lack.zones) == (0.0, (), ())
    assert lack.cost == pytest.approx(flown.cost, rel=1e-9)


def test_the_zone_that_makes_a_way_dear_is_named() -> None:
    p = crossing(box(600.0, 0.0, 700.0, 2000.0, None, 15.0), box(900.0, 0.0, 1000.0, 2000.0, None, 70.0))
    lack = lacking(p, sampled_track(p, *straight(p)))
    assert isinstance(lack, Lacking)
    assert (lack.laps_m, lack.zones) == (0.0, (1,))


def test_zones_that_leave_no_room_between_them_are_named() -> None:
    p = crossing(
        box(300.0, 0.0, 400.0, 2000.0, None, 20.0),
        box(900.0, 0.0, 1000.0, 2000.0, None, 60.0),
        box(950.0, 0.0, 1200.0, 2000.0, 40.0, None),
    )
    shut = lacking(p, sampled_track(p, *straight(p)))
    assert isinstance(shut, Closed)
    assert sorted(shut.zones) == [1, 2]
    assert shut.by == pytest.approx(20.0, abs=0.1)


@settings(max_examples=draws(25))
@given(st.integers(0, 10**6))
def test_no_choice_of_sides_costs_less_than_what_is_lacking_tells(seed: int) -> None:
    rng = np.random.default_rng(seed)
    zones = []
    for _ in range(3):
        west, low = rng.uniform(250.0, 1500.0), rng.uniform(15.0, 120.0)
        levels = (None, low) if rng.random() < 0.5 else (low, low + rng.uniform(10.0, 100.0))
        zones.append(box(west, 500.0, west + rng.uniform(50.0, 200.0), 1500.0, *levels))
    p = crossing(*zones, limits=replace(TENTH, max_amsl_m=150.0))
    track = sampled_track(p, *straight(p))
    costs = []
    room = sections_of(p, track, ())
    for sides in product((True, False), repeat=len(track.tube.bands)):
        low_m, high_m = room.between(sides)
        string = taut_string(room.s_m, low_m, high_m, 10.0, 10.0)
        if not isinstance(string, Blocked):
            rise = np.diff(string.amsl_m)
            costs.append(np.hypot(np.maximum(np.diff(string.s_m), 10.0 * np.abs(rise)), rise).sum())
    found = lacking(p, track)
    assert isinstance(found, Lacking) == bool(costs)
    if isinstance(found, Lacking):
        assert found.cost == pytest.approx(min(costs), rel=1e-6)


def test_a_little_way_is_won_by_a_bend_and_not_by_laps() -> None:
    p = crossing(box(700.0, 0.0, 800.0, 2000.0, None, 61.0))
    found = extend(p, *straight(p))
    assert found is not None
    track, flown = found
    assert len(track.points) == 4
    # A climb of 51 m has 500 m: 10 m are missing.
    assert 1610.0 <= track.s_m[-1] <= 1612.0
    assert flown.cost < 1620.0


@pytest.mark.slow
def test_laps_lead_over_a_zone_that_cannot_be_passed_otherwise() -> None:
    # The box reaches from border to border, and is too close to be climbed over on a straight track.
    p = crossing(box(400.0, 0.0, 600.0, 2000.0, None, 90.0))
    below = found_in(p)
    best = climbing_m(200.0, 80.0) + 200.0 + climbing_m(1200.0, 80.0)
    assert best - 1.0 <= below.cost <= 1.005 * best


@pytest.mark.slow
def test_with_laps_the_bound_rises_and_stays_below_the_best_path() -> None:
    below = found_in(crossing(box(400.0, 0.0, 600.0, 2000.0, None, 90.0)), improve)
    best = climbing_m(200.0, 80.0) + 200.0 + climbing_m(1200.0, 80.0)
    assert best - 1.0 <= below.cost <= 1.005 * best
    assert 1700.0 < below.bound <= best


@pytest.mark.slow
@pytest.mark.parametrize(("half_m", "around"), [(150.0, True), (850.0, False)])
def test_a_zone_entered_below_that_must_be_left_above_is_passed_by_the_shorter_way(half_m: float, around: bool) -> None:
    """A path fits below the zone's western half, but its eastern half stands on a hill, which must be overflown."""

    def hill(east: Floats, north: Floats) -> Floats:
        return np.where((east > 500.0) & (east < 700.0) & (np.abs(north - 1000.0) <= half_m), 60.0, 0.0)

    zone = box(300.0, 1000.0 - half_m, 700.0, 1000.0 + half_m, 40.0, 100.0)
    p = replace(crossing(), airspace=Airspace(ground(hill, step_m=10.0), [zone]))
    below = found_in(p)
    assert below.best is not None
    aside = float(np.abs(below.best[:, 1] - 1000.0).max())
    over = climbing_m(100.0, 90.0) + 400.0 + climbing_m(1100.0, 90.0)
    if around:
        corners = [(200.0, 1000.0), (500.0, 1000.0 + half_m), (700.0, 1000.0 + half_m), (1800.0, 1000.0)]
        plane_m = sum(math.dist(a, b) for a, b in pairwise(corners))
        assert plane_m < over
        assert plane_m <= below.cost <= 1.02 * plane_m
        assert aside >= half_m - 1.0
    else:
        assert below.cost <= 1.005 * over
        assert np.interp(500.0, below.best[:, 0], below.best[:, 2]) > 90.0


@pytest.mark.slow
def test_laps_are_flown_under_one_zone_to_get_over_another() -> None:
    # Below the roof over the start there is space for laps; after it, the wall is too close.
    roof, wall = box(100.0, 0.0, 450.0, 2000.0, 80.0, None), box(500.0, 0.0, 600.0, 2000.0, None, 78.0)
    below = found_in(crossing(roof, wall))
    best = climbing_m(300.0, 68.0) + 100.0 + climbing_m(1200.0, 68.0)
    assert best - 1.0 <= below.cost <= 1.005 * best


@pytest.mark.nightly
def test_what_is_shut_for_one_cap_is_looked_at_again_for_the_best_path() -> None:
    # A path around both is shorter than one over both; a path over one of them, with laps, is the shortest.
    p = crossing(box(300.0, 0.0, 400.0, 1900.0, None, 40.0), box(1500.0, 300.0, 1600.0, 2000.0, None, 70.0))
    below = found_in(p)
    assert below.cost <= 1.005 * (climbing_m(100.0, 30.0) + 1100.0 + climbing_m(200.0, 60.0) + 200.0)


@pytest.mark.slow
def test_a_track_a_hand_too_high_is_looked_at_again_a_hand_lower() -> None:
    # On real ground: the ceiling leaves only a saddle open above a zone.
    (p,) = (named.problem for named in problems("main", 201, count=4) if named.name == "main 201/02, 40 zones")
    below = looked(p).incumbent
    assert below.cost < 1.02 * below.bound


def test_a_zone_over_ground_that_a_track_only_touches_is_no_band() -> None:
    zone = Zone("disc", Circle(1000.0, 1000.0, 100.0), None, Level(50.0, "agl"))
    air = Airspace(ground(0.0), [zone])
    for away in np.linspace(100.0, 100.1, 101):
        # A leg that begins at the zone and leads away from it.
        tube = air.tube(np.array([[1000.0, 1000.0 + away], [1000.0, 1800.0]]), TENTH)
        assert all(len(b.top_m) for b in tube.bands)
        assert bool(tube.bands) == (away < 100.0 + 0.05 - 1e-9) or abs(away - 100.05) < 1e-3


def test_a_zones_ceiling_that_is_shut_is_none() -> None:
    lid = box(800.0, 0.0, 1000.0, 1500.0, None, 60.0)
    p, other = crossing(lid), crossing(replace(lid, ceiling=None))
    lengths = []
    for problem, over in ((p, None), (p, np.zeros(1, bool)), (other, None)):
        below = plane_of(problem)
        leg = below.legs[0]
        leg.flood(1.0)
        way = leg.track(
            below.top_m, None, math.inf, SideChoice(np.ones(1, bool), np.ones(1, bool) if over is None else over)
        )
        assert way is not None
        lengths.append(way.length_m)
    assert lengths[0] == pytest.approx(1600.0, abs=0.1)
    assert lengths[1] == lengths[2] > 1800.0


def test_a_choice_without_a_track_costs_nothing_and_the_number_of_tracks_is_kept() -> None:
    incumbent = Incumbent(crossing(box(900.0, 900.0, 1100.0, 1100.0, 40.0, 200.0)))
    asked: list[SideChoice] = []

    def nothing(choice: SideChoice) -> None:
        asked.append(choice)

    roots = [SideChoice(np.ones(1, np.bool_), np.zeros(1, np.bool_)), SideChoice(*np.zeros((2, 1), np.bool_))]
    assert DetourSearch(incumbent, nothing, False).run(roots, 5, first=False, laps=False) is None
    assert incumbent.best is None
    assert asked == roots
    assert DetourSearch(incumbent, nothing, False).run(roots, 1, first=False, laps=False) is None
    assert asked == [*roots, roots[0]]
