"""Altitude intervals over cells, compared with brute force: intervals between zones, reachable altitudes, tracks."""

from __future__ import annotations

import heapq
import math
from itertools import product
from typing import Literal

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.navmesh.clearance import mesh_of
from gcsplan.planners.optimal.navmesh.grid import make_plane
from gcsplan.planners.optimal.navmesh.interval_kernels import spread
from gcsplan.planners.optimal.plane.altitude_intervals import AltitudeIntervals, Reached, Terminal, intervals, ranges
from gcsplan.planners.optimal.plane.corridor import End
from gcsplan.planners.optimal.plane.leg import Leg
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support import effort

Place = tuple[float, float, float]
CELL_M = 10.0
EVERYWHERE = (-math.inf, -math.inf, math.inf, math.inf)


# --- altitudes carried from one interval to the next ----------------------------------------------------------------


def random_intervals(rng: np.random.Generator, rows: int, cols: int) -> AltitudeIntervals:
    """One or two intervals over most cells; start and goal in opposite corners; all altitudes multiples of 10 m."""
    cell, low, high = [], [], []
    goal = rows * cols - 1
    for k in range(rows * cols):
        ends = k in (0, goal)
        if not ends and rng.random() < 0.15:
            continue
        floor = float(rng.choice([0.0, 0.0, 0.0, 20.0, 40.0]))
        intervals = [(floor, 60.0)]
        if rng.random() < 0.5:
            bottom = float(rng.choice([10.0, 20.0, 30.0]))
            intervals = [(a, b) for a, b in [(floor, bottom), (max(bottom + 20.0, floor), 60.0)] if a <= b]
        for a, b in [(0.0, 60.0)] if ends else intervals:
            cell.append(k)
            low.append(a)
            high.append(b)
    at = np.array(cell)
    row, col = at // cols, at % cols
    away = CELL_M * np.hypot(row, col)
    left = CELL_M * np.hypot(rows - 1 - row, cols - 1 - col)
    half = CELL_M * math.sqrt(0.5)
    stops = [Terminal(np.array([k]), float(rng.choice([0.0, 20.0, 50.0]))) for k in (0, goal)]
    return AltitudeIntervals((rows, cols), at, np.array(low), np.array(high), *tracks(away, left, half), *stops)


def tracks(away: Floats, left: Floats, half_m: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Least metres of track to cells and from there, and the ranges of both, from distances of the cells' middles."""
    near_start, near_goal = (np.maximum(x - half_m, 0.0) for x in (away, left))
    from_start, to_goal = (np.column_stack([x - half_m, x + half_m]) for x in (away, left))
    return near_start, near_goal, from_start, to_goal


@pytest.mark.first_quick
@pytest.mark.parametrize("seed", range(8))
def test_what_is_carried_on_is_the_least_of_all_ways(seed: int) -> None:
    rng = np.random.default_rng(seed)
    s = random_intervals(rng, 5, 6)
    n = len(s.cell)
    own, most = rng.uniform(0.0, 10.0, n).round(), rng.uniform(5.0, 15.0, n).round()
    sources = np.flatnonzero(s.cell == 0)
    first = np.searchsorted(s.cell, np.arange(31))
    out = np.full(n, np.inf)
    room = np.empty(n + 1), np.empty(n + 1, np.int32), np.empty(n + 1, np.int64)
    spread(first, s.cell, 6, s.low_m, s.high_m, own, most, sources, 3.0, out, *room)
    wanted = np.full(n, np.inf)
    for k in sources:
        wanted[k] = max(3.0, own[k]) if max(3.0, own[k]) <= most[k] else np.inf
    row, col = s.cell // 6, s.cell % 6
    for _ in range(n):
        for a, b in product(range(n), range(n)):
            beside = max(abs(row[a] - row[b]), abs(col[a] - col[b])) == 1
            value = max(wanted[a], own[b])
            if beside and s.low_m[a] <= s.high_m[b] and s.low_m[b] <= s.high_m[a] and value <= most[b]:
                wanted[b] = min(wanted[b], value)
    np.testing.assert_array_equal(out, wanted)


# --- no existing track is excluded as too short -------------------------------------------------------------------


def shortest(
    s: AltitudeIntervals, up: float, down: float, step_m: float = 2.0
) -> tuple[float, list[tuple[int, float]]]:
    """Length of the shortest track over cell centres at altitudes ``step_m`` apart, with its intervals and altitudes.

    A step from one interval to the next crosses the border at the mean of both altitudes.
    """
    levels = np.arange(0.0, 60.0 + step_m, step_m)
    cols = s.shape[1]
    of: dict[int, list[int]] = {}
    for k, c in enumerate(s.cell.tolist()):
        of.setdefault(c, []).append(k)
    begin = [(k, s.start.amsl_m) for k in of[0] if s.start.amsl_m is not None]
    best: dict[tuple[int, float], float] = {(k, z): 0.0 for k, z in begin if s.low_m[k] <= z <= s.high_m[k]}
    came: dict[tuple[int, float], tuple[int, float]] = {}
    heap = [(0.0, *state) for state in best]
    while heap:
        flown, k, z = heapq.heappop(heap)
        if flown > best[k, z]:
            continue
        if s.cell[k] == s.goal.cells[0] and z == s.goal.amsl_m:
            way = [(k, z)]
            while way[-1] in came:
                way.append(came[way[-1]])
            return flown, way[::-1]
        j, i = divmod(int(s.cell[k]), cols)
        for dj, di in product((-1, 0, 1), (-1, 0, 1)):
            length = CELL_M * math.hypot(dj, di)
            if (dj, di) == (0, 0) or not (0 <= i + di < cols):
                continue
            for t in of.get((j + dj) * cols + i + di, ()):
                for to in levels[(levels >= s.low_m[t]) & (levels <= s.high_m[t])].tolist():
                    middle = 0.5 * (z + to)
                    passes = s.low_m[k] <= middle <= s.high_m[k] and s.low_m[t] <= middle <= s.high_m[t]
                    if not passes or not -down * length <= to - z <= up * length:
                        continue
                    if flown + length < best.get((t, to), math.inf):
                        best[t, to] = flown + length
                        came[t, to] = k, z
                        heapq.heappush(heap, (flown + length, t, to))
    return math.inf, []


@pytest.mark.nightly
@pytest.mark.draws
def test_intervals_of_the_shortest_track_of_brute_force_are_never_shut() -> None:
    found = above = 0
    seeds = range(0 if effort.full else 16, 30)
    for seed in seeds:
        rng = np.random.default_rng(seed)
        s = random_intervals(rng, *rng.integers(3, 9, 2).tolist())
        climb, descent = rng.choice([0.2, 0.4, 1.0], 2)
        length, way = shortest(s, climb, descent)
        if math.isinf(length):
            continue
        limits = Limits(
            0.0, max_climb_deg=math.degrees(math.atan(climb)), max_descent_deg=math.degrees(math.atan(descent))
        )
        reached = Reached(s, limits, 1e4)
        for longer in (500.0, 50.0, 10.0, 1e-6):  # results for longer tracks are used for shorter ones
            now = reached.within(length + longer, np.ones(s.shape[0] * s.shape[1], np.bool_))
            for k, z in way:
                here = (now.cell == s.cell[k]) & (now.low_m <= z) & (z <= now.high_m)
                assert here.any(), (seed, longer, k, z)
        found += 1
        straight_m = CELL_M * math.hypot(s.shape[0] - 1, s.shape[1] - 1)
        above += not len(s.reached(limits, straight_m + CELL_M * math.sqrt(2.0)).cell)
    # The test means something only if there are tracks, and altitude limits that lengthen them.
    assert found >= len(seeds) / 2
    assert above >= 3


@pytest.mark.parametrize("free", ["neither", "start", "goal"])
@pytest.mark.parametrize("limited", ["both", "climb"])
def test_climbing_out_from_under_a_ceiling_takes_its_length(free: str, limited: str) -> None:
    """A single row: below 10 m for 40 cells, above 50 m for the next 40, at a slope of 0.1."""
    cols = 80
    at = np.arange(cols)
    low, high = np.where(at < 40, 0.0, 50.0), np.where(at < 40, 10.0, 60.0)
    low[40], high[40] = 0.0, 60.0  # the only cell to climb over
    away: Floats = CELL_M * at.astype(np.float64)
    left: Floats = away[::-1].copy()
    stops = Terminal(at[:1], None if free == "start" else 5.0), Terminal(at[-1:], None if free == "goal" else 55.0)
    s = AltitudeIntervals((1, cols), at, low, high, *tracks(away, left, 0.5 * CELL_M), *stops)
    limits = Limits(
        0.0, max_climb_deg=math.degrees(math.atan(0.1)), max_descent_deg=90.0 if limited == "climb" else 30.0
    )
    lap_m = 400.0  # from 10 m to 50 m
    assert not len(s.reached(limits, left[0] + lap_m - 50.0).cell)
    there = s.reached(limits, left[0] + lap_m)
    assert set(there.cell.tolist()) == set(range(cols))
    assert there.away_m[41] >= 400.0 + lap_m - 50.0


# --- intervals that zones leave free ------------------------------------------------------------------------------


def world(zones: list[Zone], heights: Floats, limits: Limits, start: Place, goal: Place) -> Leg:
    rows = heights.shape[0]
    surface = Surface(heights, heights, GridMap.affine(0.0, (rows - 1) * 50.0, 50.0, 50.0))
    problem = Problem(Airspace(surface, zones), limits, start, goal)
    top_m = limits.max_amsl_m or 1e3
    return Leg(problem, End(*start), End(*goal), top_m)


@pytest.mark.first_quick
@pytest.mark.parametrize("seed", range(5))
def test_every_altitude_that_is_legal_in_a_cell_lies_in_one_of_its_intervals(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heights = 60.0 * rng.random((13, 13))
    zones = []
    for k in range(9):
        datum: Literal["agl", "amsl"] = "agl" if rng.random() < 0.4 else "amsl"
        floor = float(rng.uniform(20.0, 150.0))
        ceiling = Level(floor + float(rng.uniform(5.0, 60.0)), datum) if rng.random() < 0.8 else None
        east, north, radius = rng.uniform(0.0, 600.0), rng.uniform(0.0, 600.0), float(rng.uniform(100.0, 300.0))
        shape = Circle(float(east), float(north), radius)
        zones.append(Zone(f"z{k}", shape, Level(floor, datum) if rng.random() < 0.8 else None, ceiling))
    limits = Limits(5.0, max_amsl_m=250.0)
    leg = world(zones, heights, limits, (30.0, 30.0, 100.0), (570.0, 570.0, 100.0))
    problem = leg.problem
    plane = make_plane(problem, EVERYWHERE)
    mesh = mesh_of(plane, 250.0, True, single=True)
    every = np.arange(len(mesh.piece))
    count, low, high = intervals(mesh, every, *ranges(mesh, 250.0, every), 1e-3)
    x, y = mesh.places()
    many = 0
    for j, i in product(range(12), range(12)):
        cell = j * 12 + i
        n = int(count[cell])
        many += n > 1
        assert (low[cell, :n] <= high[cell, :n]).all()
        order = np.argsort(low[cell, :n])
        assert (high[cell, order[:-1]] < low[cell, order[1:]]).all()
        u, v = rng.random((2, 6))
        east, north = x[j, i] + u * (x[j, i + 1] - x[j, i]), y[j, i] + v * (y[j + 1, i] - y[j, i])
        ground = problem.airspace.surface.ground_at(east, north)
        for e, m, g in zip(east.tolist(), north.tolist(), ground.tolist(), strict=True):
            z = np.arange(g + 5.0, 250.0, 1.0)
            legal = np.ones(len(z), bool)
            for zone in zones:
                assert isinstance(zone.shape, Circle)
                if math.hypot(e - zone.shape.east_m, m - zone.shape.north_m) < zone.shape.radius_m:
                    bottom, top = (
                        off if at is None else at.value_m + (g if at.datum == "agl" else 0.0)
                        for at, off in ((zone.floor, -math.inf), (zone.ceiling, math.inf))
                    )
                    legal &= (z <= bottom) | (z >= top)
            held = ((z[:, None] >= low[cell, :n]) & (z[:, None] <= high[cell, :n])).any(axis=1)
            assert (held | ~legal).all(), (seed, cell)
    assert many >= 5


def ridge_behind_a_low_ceiling() -> tuple[Leg, Problem]:
    """Below 60 m for 1 km, and 100 m behind that a ridge 300 m high across the whole map, at a slope of 0.1."""
    rows, cols = 13, 61
    heights = np.zeros((rows, cols))
    heights[:, 42:45] = 300.0
    box = np.array([[1000.0, -500.0], [2000.0, -500.0], [2000.0, 1200.0], [1000.0, 1200.0]])
    zones = [Zone("low", Polygon(box), Level(60.0, "amsl"), None)]
    limits = Limits(
        10.0, max_amsl_m=400.0, max_climb_deg=math.degrees(math.atan(0.1)), max_descent_deg=math.degrees(math.atan(0.6))
    )
    leg = world(zones, heights, limits, (25.0, 310.0, 30.0), (2975.0, 310.0, 30.0))
    return leg, leg.problem


@pytest.mark.slow
def test_a_ridge_right_behind_a_low_ceiling_is_farther_than_the_plane_tells() -> None:
    leg, problem = ridge_behind_a_low_ceiling()
    for slack in (0.0, 1.3):  # the first flood finds how far the second must reach
        leg.flood(slack)
    # The climb from 60 m to 310 m takes 2500 m, but the ridge is 100 m away: laps along it are a solution.
    laps = [(2002.0, 10.0 + 580.0 * (k % 2), 59.0 + 56.0 * k) for k in range(6)]
    points = np.array(
        [(25.0, 310.0, 30.0), (2002.0, 310.0, 59.0), *laps, (2260.0, 310.0, 339.0), (2975.0, 310.0, 30.0)]
    )
    run = np.hypot(*np.diff(points[:, :2], axis=0).T)
    assert (np.diff(points[:, 2]) <= 0.1 * run + 1e-9).all()
    assert not problem.airspace.examine(Legs.of_path(points, problem.limits), problem.limits).violations
    track_m = float(run.sum())
    assert track_m < leg.reach_m
    plane = leg.bound(leg.top_m, leg.corridor(track_m), track_m, True)
    proved = [m for m in np.arange(2950.0, track_m, 50.0).tolist() if not len(leg.intervals(m).cell)]
    assert max(proved) > plane + 500.0
    assert len(leg.intervals(track_m).cell)
    # The straight track plus the climb's length: from 60 m under the zone's edge to 310 m over the ridge.
    assert max(proved) <= 2950.0 + 2500.0


@pytest.mark.nightly
@pytest.mark.parametrize("around_m", [300.0, 600.0])
def test_the_way_around_a_wall_does_not_make_up_for_a_climb_before_it(around_m: float) -> None:
    """A step across the map that takes 1380 m of track to climb, and behind it a wall with the goal on its far side.

    The goal is 425 m from the step in a straight line, and farther around the tip of the wall.
    """
    heights = np.zeros((31, 31))
    heights[:, 10:12] = 140.0
    top = 500.0 + around_m
    wall = np.array([[780.0, -2000.0], [820.0, -2000.0], [820.0, top], [780.0, top]])
    descent_deg = math.degrees(math.atan(0.9))
    limits = Limits(10.0, max_amsl_m=400.0, max_climb_deg=math.degrees(math.atan(0.1)), max_descent_deg=descent_deg)
    zones = [Zone("wall", Polygon(wall), None, None)]
    leg = world(zones, heights, limits, (225.0, 500.0, 12.0), (1000.0, 500.0, 12.0))
    leg.flood(0.0)
    leg.flood(1.3)
    # 12 m to 150 m at 0.1, then from the step to the tip, past it, and to the goal.
    least_m = 1380.0 + (780.0 - 550.0) + 40.0 + math.dist((820.0, top), (1000.0, 500.0))
    assert not len(leg.intervals(least_m - 100.0).cell)
    assert len(leg.intervals(least_m + 150.0).cell)
