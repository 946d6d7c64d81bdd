"""Turns: the tests build the arcs again from the way points alone, and judge them by samples."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import pairwise, product

import numpy as np
import pytest
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.planners.problem import Problem, Refusal, Via
from gcsplan.planners.turns import planner
from gcsplan.planners.turns.arc_path import MOST_DEG, moved
from gcsplan.planners.turns.kernels import CHORD_M
from gcsplan.planners.turns.planner import LEVELS, Rounded, arc_path_of, rounded, with_more_clearance
from gcsplan.planners.turns.repair import tried
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Circle, Polygon, Zone
from tests.support.planner_worlds import faults, ground

LIMITS = Limits(min_agl_m=60.0, max_climb_deg=12.0, max_descent_deg=12.0)


@dataclass(frozen=True, eq=False)
class Curve:
    """Legs and arcs as an autopilot flies the way points: samples (N, 3) and distances along the track (m)."""

    points: Floats
    s_m: Floats


def as_flown(way_points: Floats, radius_m: float, step_m: float = 1.0) -> Curve:
    """The curve with arcs tangent to both legs that begin R·tan(turn / 2) before the corner; fails if they overlap."""
    w = way_points[:, :2]
    legs = np.diff(w, axis=0)
    length = np.hypot(*legs.T)
    unit = legs / length[:, None]
    cross = unit[:-1, 0] * unit[1:, 1] - unit[:-1, 1] * unit[1:, 0]
    turn = np.arctan2(cross, (unit[:-1] * unit[1:]).sum(axis=1))
    assert (np.abs(turn) <= math.radians(MOST_DEG) + 1e-9).all(), "a turn too sharp for one way point"
    tangent = np.concatenate([[0.0], radius_m * np.tan(0.5 * np.abs(turn)), [0.0]])
    assert (tangent[:-1] + tangent[1:] <= length + 1e-4).all(), "arcs overlap"
    flat, s, knots = [w[0]], [0.0], [0.0]

    def go(point: Floats, metres: float) -> None:
        flat.append(point)
        s.append(s[-1] + metres)

    for k in range(len(w) - 1):
        a, b = w[k] + tangent[k] * unit[k], w[k + 1] - tangent[k + 1] * unit[k]
        straight = length[k] - tangent[k] - tangent[k + 1]
        pieces = max(1, math.ceil(straight / step_m))
        for i in range(1, pieces + 1):
            go(a + (b - a) * i / pieces, straight / pieces)
        if k == len(w) - 2:
            break
        side = math.copysign(1.0, turn[k])
        centre = b + side * radius_m * np.array([-unit[k, 1], unit[k, 0]])
        arc = radius_m * abs(turn[k])
        half = max(1, math.ceil(0.5 * arc / step_m))
        begin = math.atan2(b[1] - centre[1], b[0] - centre[0])
        for i in range(1, 2 * half + 1):
            at = begin + turn[k] * i / (2 * half)
            go(centre + radius_m * np.array([math.cos(at), math.sin(at)]), arc / (2 * half))
            if i == half:
                knots.append(s[-1])
    knots.append(s[-1])
    along = np.array(s)
    return Curve(np.column_stack([np.array(flat), np.interp(along, knots, way_points[:, 2])]), along)


def widened(problem: Problem, found: Rounded) -> Legs:
    """The legs of the chords, those of arcs wider by `CHORD_M`: they lie off the lines from way point to way point."""
    legs = Legs.of_path(found.flown, problem.limits)
    middle, w = 0.5 * (found.flown[1:, :2] + found.flown[:-1, :2]), found.way_points[:, :2]
    off = [min(_distance(x, a, b) for a, b in pairwise(w)) for x in middle]
    return replace(legs, track_error_m=legs.track_error_m + np.where(np.array(off) > 1e-6, CHORD_M, 0.0))


def assert_sound(problem: Problem, found: Rounded, step_m: float = 1.0) -> Curve:
    """Assert everything that a `Rounded` promises, by the exact check and by samples; return the curve."""
    air, limits, radius = problem.airspace, problem.limits, problem.turn_radius_m
    assert air.examine(widened(problem, found), limits).violations == ()
    assert tuple(found.way_points[0]) == pytest.approx(problem.start, abs=1e-9)
    assert tuple(found.way_points[-1]) == pytest.approx(problem.goal, abs=1e-9)

    curve = as_flown(found.way_points, radius, step_m)
    apart = np.concatenate([[True], np.hypot(*np.diff(curve.points[:, :2], axis=0).T) > 1e-6])
    assert faults(problem, Path(curve.points[apart]), slack_m=0.002) == []
    if problem.objective == "length":  # that of the curve with arcs
        length = np.hypot(np.diff(curve.s_m), np.diff(curve.points[:, 2])).sum()
        assert found.cost == pytest.approx(length, rel=1e-6)

    # The chords follow this curve.
    chords = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(found.flown[:, :2], axis=0).T))])
    at = chords * curve.s_m[-1] / chords[-1]  # chords are slightly and evenly shorter than arcs
    for k in range(3):
        off = np.abs(np.interp(at, curve.s_m, curve.points[:, k]) - found.flown[:, k])
        assert off.max() < 1.0
    middle = 0.5 * (found.flown[1:] + found.flown[:-1])
    for i in range(0, len(middle), 3):
        away = np.hypot(*(curve.points[:, :2] - middle[i, :2]).T)
        near = int(np.argmin(away))
        assert away[near] < 0.51 * step_m + CHORD_M
        assert abs(curve.points[near, 2] - middle[i, 2]) < 0.3 * step_m

    # No turn is tighter than the radius, by circles through three neighbours.
    p = found.flown[np.concatenate([[True], np.hypot(*np.diff(found.flown[:, :2], axis=0).T) > 0.05]), :2]
    a, b, c = p[:-2], p[1:-1], p[2:]
    twice = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    sides = np.hypot(*(b - a).T) * np.hypot(*(c - b).T) * np.hypot(*(c - a).T)
    assert (sides >= 2.0 * twice * (radius - 0.5)).all()
    return curve


def problem_of(corners: Floats, zones: list[Zone] | None = None, **changes: object) -> Problem:
    """A problem over level ground 5 km wide, from the first corner to the last; the turn radius is 100 m by default."""
    air = Airspace(ground(0.0, size_m=5000.0, step_m=50.0), zones or [])
    start, goal = (tuple(map(float, corners[k])) for k in (0, -1))
    fields: dict[str, object] = {"turn_radius_m": 100.0, **changes}
    return Problem(air, LIMITS, start, goal, **fields)  # type: ignore[arg-type]


def at_100(*places: tuple[float, float]) -> Floats:
    return np.array([(e, n, 100.0) for e, n in places])


def no_pins(points: Floats) -> NDArray[np.bool_]:
    return np.zeros(len(points), bool)


def zigzag(seed: int) -> tuple[Floats, list[Zone]]:
    """Corners that turn by up to 140 degrees, with a zone inside each that touches both of its legs."""
    rng = np.random.default_rng(seed)
    while True:
        at, heading = np.array([rng.uniform(500, 1500), rng.uniform(1500, 3500)]), rng.uniform(-0.5, 0.5)
        places, turns = [at], []
        for _ in range(int(rng.integers(2, 7))):
            at = at + rng.uniform(450, 1300) * np.array([math.cos(heading), math.sin(heading)])
            places.append(at)
            turns.append(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 2.4))
            heading += turns[-1]
        p = np.array(places)
        if p.min() < 700.0 or p.max() > 4300.0:
            continue
        break
    zones = []
    for k, turn in enumerate(turns[:-1], start=1):
        radius = rng.uniform(15.0, 120.0)
        back = (p[k - 1] - p[k]) / math.dist(p[k], p[k - 1]) + (p[k + 1] - p[k]) / math.dist(p[k], p[k + 1])
        size = float(np.hypot(*back))
        centre = p[k] + back / size * radius / math.cos(0.5 * abs(turn)) if size > 1e-3 else p[k]
        legs = [_distance(centre, p[i], p[i + 1]) for i in range(len(p) - 1)]
        if min(legs) >= radius - 1e-9:
            zones.append(Zone(f"inside corner {k}", Circle(float(centre[0]), float(centre[1]), radius)))
    return np.column_stack([p, np.full(len(p), 100.0)]), zones


def _distance(x: Floats, a: Floats, b: Floats) -> float:
    t = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return float(np.hypot(*(x - a - t * (b - a))))


@pytest.mark.nightly
def test_random_paths_that_touch_zones_at_corners_are_rounded_and_legal_as_flown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(planner, "TRIES", 200)
    solved = 0
    for seed in range(10):
        corners, zones = zigzag(seed)
        problem = problem_of(corners, zones, turn_radius_m=(60.0, 100.0, 150.0)[seed % 3])
        found = rounded(problem, corners, no_pins(corners))
        if found is not None:
            solved += 1
            assert_sound(problem, found)
    assert solved >= 9


def hills(seed: int, ceiling_m: float) -> Problem:
    """A mission over rough ground with hills above the ceiling, and space to climb all along between them."""
    rng = np.random.default_rng(seed)
    peaks = [(rng.uniform(500, 4500, 2), rng.uniform(80, 160), rng.uniform(200, 450)) for _ in range(14)]

    def height(e: Floats, n: Floats) -> Floats:
        return np.asarray(sum(h * np.exp(-((e - c[0]) ** 2 + (n - c[1]) ** 2) / w**2) for c, h, w in peaks))

    air = Airspace(ground(height, size_m=5000.0, step_m=50.0))
    limits = replace(LIMITS, max_amsl_m=ceiling_m, track_error_m=3.0, altitude_error_m=2.0, horizontal_clearance_m=15.0)
    ends = [(300.0, 400.0), (4600.0, 4500.0)]
    start, goal = ((e, n, float(air.floor_amsl(e, n, limits)) + 0.01) for e, n in ends)
    return Problem(air, limits, start, goal)


def way_below(problem: Problem, step_m: float = 100.0) -> Floats:
    """A path at the ceiling where the ground leaves it free: shortest on a grid, then corners cut as samples allow."""
    ceiling = (problem.limits.max_amsl_m or math.inf) - problem.limits.altitude_error_m
    n = round(5000.0 / step_m) + 1
    axis = np.linspace(0.0, 5000.0, n)
    east, north = np.meshgrid(axis, axis, indexing="ij")
    free = problem.airspace.floor_amsl(east, north, problem.limits) < ceiling - 1.0
    first, last = ((round(e / step_m), round(u / step_m)) for e, u, _ in (problem.start, problem.goal))
    best: dict[tuple[int, int], float] = {first: 0.0}
    before: dict[tuple[int, int], tuple[int, int]] = {}
    heap = [(0.0, first)]
    while heap:
        cost, (i, j) = heappop(heap)
        for a, b in product((-1, 0, 1), repeat=2):
            node, more = (i + a, j + b), cost + math.hypot(a, b)
            if 0 <= node[0] < n and 0 <= node[1] < n and free[node] and more < best.get(node, math.inf) - 1e-9:
                best[node], before[node] = more, (i, j)
                heappush(heap, (more, node))
    nodes = [last]
    while nodes[-1] != first:
        nodes.append(before[nodes[-1]])
    inner = [(float(axis[i]), float(axis[j])) for i, j in reversed(nodes)]
    way = np.array([problem.start[:2], *inner, problem.goal[:2]])
    out, k = [0], 0
    while k < len(way) - 1:
        for end in range(len(way) - 1, k, -1):
            t = np.linspace(0.0, 1.0, 2 + int(math.dist(way[k], way[end]) / 10.0))
            line = way[k] + t[:, None] * (way[end] - way[k])
            if end == k + 1 or (problem.airspace.floor_amsl(line[:, 0], line[:, 1], problem.limits) < ceiling).all():
                break
        out.append(end)
        k = end
    return np.column_stack([way[out], np.full(len(out), ceiling)])


@pytest.mark.nightly_but("0")
@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2])
def test_paths_between_hills_are_rounded_and_climb_no_steeper_than_allowed(seed: int) -> None:
    problem = hills(seed, 145.0)
    points = way_below(problem)
    assert len(points) > 3
    for radius in (100.0, 200.0):
        winged = replace(problem, turn_radius_m=radius)
        found = rounded(winged, points, no_pins(points))
        assert found is not None
        assert_sound(winged, found, step_m=3.0)
        assert found.cost < 1.05 * Path(points).length_m


@pytest.mark.slow
def test_what_is_known_of_a_belt_is_exactly_what_looking_anew_at_its_like_tells() -> None:
    problem = replace(hills(0, 145.0), turn_radius_m=100.0)
    points = way_below(problem)
    belt = arc_path_of(problem, points, no_pins(points), 0.5)
    here = tried(problem, belt)
    for k in range(len(belt.sense)):
        for step in (-40.0, 3.0, 90.0):
            other = moved(belt, k, np.array([step, 0.5 * step]))
            near, anew = tried(problem, other, here), tried(problem, other)
            assert near.broken == pytest.approx(anew.broken, rel=1e-6, abs=1e-9)
            assert (near.risen is None) == (anew.risen is None)
            if near.risen is not None and anew.risen is not None:
                assert near.risen.way_points == pytest.approx(anew.risen.way_points, abs=1e-5)


@pytest.mark.slow
def test_a_via_is_passed_exactly_at_its_altitude_and_is_a_way_point() -> None:
    corners = at_100((500, 500), (2500, 3000), (4300, 700))
    corners[1, 2] = 130.0
    problem = problem_of(corners, via=(Via(2500.0, 3000.0, 130.0),))
    found = rounded(problem, corners, np.array([False, True, False]))
    assert found is not None
    curve = assert_sound(problem, found)
    away = np.linalg.norm(curve.points - corners[1], axis=1)
    assert away.min() < 0.51
    assert np.linalg.norm(found.way_points - corners[1], axis=1).min() < 1e-6
    assert np.linalg.norm(found.flown - corners[1], axis=1).min() < 1e-6


@pytest.mark.first_quick
@pytest.mark.parametrize("aside_m", [0.0, 1e-7, 1.0, 50.0])
def test_a_via_on_a_nearly_straight_way_is_passed_at_its_altitude(aside_m: float) -> None:
    corners = at_100((500, 500), (1500, 500 + aside_m), (2500, 500))
    corners[1, 2] = 150.0
    problem = problem_of(corners, via=(Via(1500.0, 500.0 + aside_m, 150.0),))
    found = rounded(problem, corners, np.array([False, True, False]))
    assert found is not None
    assert_sound(problem, found)
    assert np.linalg.norm(found.flown - corners[1], axis=1).min() < 1e-6
    assert len(found.way_points) == 3  # none so near to another that rounding on the wire turns the leg between them


@pytest.mark.nightly_but("20.0", "150.0")
@pytest.mark.slow
@pytest.mark.parametrize("apart_m", [20.0, 100.0, 139.0, 150.0, 198.0])
def test_vias_less_than_two_radii_apart_are_both_passed_with_a_detour(apart_m: float) -> None:
    vias = [(3000.0, 1000.0), (3000.0, 1000.0 + apart_m)]
    corners = at_100((1000, 1000), *vias, (1000, 1000 + apart_m))
    problem = problem_of(corners, via=tuple(Via(*v, None) for v in vias))
    found = rounded(problem, corners, np.array([False, True, True, False]))
    assert found is not None
    curve = assert_sound(problem, found)
    near = [np.hypot(*(curve.points[:, :2] - v).T) for v in vias]
    assert [a.min() < 0.51 for a in near] == [True, True]
    assert np.argmin(near[0]) < np.argmin(near[1])


@pytest.mark.slow
def test_a_via_within_a_turn_radius_of_the_start_is_passed_with_a_detour() -> None:
    corners = at_100((1000, 1000), (940, 1000), (3000, 1000))
    problem = problem_of(corners, via=(Via(940.0, 1000.0, None),))
    found = rounded(problem, corners, np.array([False, True, False]))
    assert found is not None
    curve = assert_sound(problem, found)
    assert np.hypot(*(curve.points[:, :2] - corners[1, :2]).T).min() < 0.51


@pytest.mark.nightly_but("goal0")
@pytest.mark.slow
@pytest.mark.parametrize("goal", [(500.0, 900.0), (500.0, 520.0), (900.0, 500.0)])
def test_a_via_is_passed_even_where_the_way_goes_straight_back(goal: tuple[float, float]) -> None:
    corners = at_100((500, 500), (3500, 500), goal)
    problem = problem_of(corners, via=(Via(3500.0, 500.0, None),))
    found = rounded(problem, corners, np.array([False, True, False]))
    assert found is not None
    curve = assert_sound(problem, found)
    assert np.hypot(*(curve.points[:, :2] - corners[1, :2]).T).min() < 0.51
    assert np.hypot(*(found.flown[:, :2] - corners[1, :2]).T).min() < 1e-6


def test_a_straight_path_stays_as_it_is() -> None:
    corners = at_100((500, 500), (1500, 1200), (2500, 1900))
    found = rounded(problem_of(corners), corners, no_pins(corners))
    assert found is not None
    assert found.way_points == pytest.approx(corners[[0, 2]])
    assert found.flown == pytest.approx(corners[[0, 2]])
    assert found.cost == pytest.approx(Path(corners).length_m)


@pytest.mark.slow
def test_the_arc_passes_where_the_corner_was_and_the_way_point_lies_outside_of_it() -> None:
    corners = at_100((500, 500), (2000, 2000), (3500, 500))
    wall = [Zone(f"post {k}", Circle(2000.0, 1970.0 - 50.0 * k, 30.0 - 0.1 * k)) for k in range(40)]
    problem = problem_of(corners, wall)
    found = rounded(problem, corners, no_pins(corners))
    assert found is not None
    curve = assert_sound(problem, found)
    assert float(curve.points[:, 1].max()) == pytest.approx(2000.0, abs=1.0)
    assert float(found.way_points[:, 1].max()) == pytest.approx(2000.0 + 100.0 * (math.sqrt(2.0) - 1.0), abs=5.0)


@pytest.mark.slow
def test_energy_counts_climb_and_horizontal_metres_along_the_arcs() -> None:
    corners = at_100((500, 500), (2000, 2000), (3500, 500))
    corners[-1, 2] = 160.0
    problem = problem_of(corners, objective="energy")
    found = rounded(problem, corners, no_pins(corners))
    assert found is not None
    curve = assert_sound(problem, found)
    assert found.cost == pytest.approx(120.0 * 60.0 + 100.0 * float(curve.s_m[-1]), rel=1e-6)


def walls(gap_m: float) -> list[Zone]:
    """Two long walls, one after the other, each with a gap; the gaps are 300 m apart sideways."""

    def box(name: str, w: float, s: float, e: float, n: float) -> Zone:
        return Zone(name, Polygon(np.array([(w, s), (e, s), (e, n), (w, n)])))

    return [
        box("a", 2000.0, 0.0, 2010.0, 2000.0),
        box("b", 2000.0, 2000.0 + gap_m, 2010.0, 5000.0),
        box("c", 2010.0 + gap_m, 0.0, 2020.0 + gap_m, 2300.0),
        box("d", 2010.0 + gap_m, 2300.0 + gap_m, 2020.0 + gap_m, 5000.0),
    ]


def through_the_walls(gap_m: float) -> Floats:
    x, middle = 2010.0 + 0.5 * gap_m, 0.5 * gap_m
    return at_100((500, 2000 + middle), (x, 2000 + middle), (x, 2300 + middle), (4500, 2300 + middle))


@pytest.mark.slow
def test_a_passage_too_narrow_for_the_radius_is_refused_and_flown_with_a_small_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(planner, "TRIES", 150)
    corners = through_the_walls(60.0)
    problem = problem_of(corners, walls(60.0), turn_radius_m=400.0)
    assert rounded(problem, corners, no_pins(corners)) is None
    small = replace(problem, turn_radius_m=20.0)
    found = rounded(small, corners, no_pins(corners))
    assert found is not None
    assert problem.airspace.examine(widened(small, found), LIMITS).violations == ()


@pytest.mark.slow
def test_where_a_path_cannot_be_rounded_one_with_more_room_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planner, "TRIES", 20)
    corners = through_the_walls(60.0)
    problem = problem_of(corners, walls(60.0)[:2], turn_radius_m=400.0)
    problem = replace(problem, airspace=Airspace(problem.airspace.surface, walls(60.0)))
    asked: list[float] = []

    def none(extra_m: float) -> None:
        asked.append(extra_m)

    assert rounded(problem, corners, no_pins(corners), none) is None
    assert asked == [level * 400.0 for level in LEVELS]

    monkeypatch.setattr(planner, "TRIES", 0)
    free = replace(problem, airspace=Airspace(problem.airspace.surface))
    wide = at_100((500, 2030), (2500, 2500), (4500, 2330))
    calls = 0

    def other(extra_m: float) -> tuple[Floats, NDArray[np.bool_]]:
        nonlocal calls
        calls += 1
        return wide, no_pins(wide)

    tight = at_100((500, 2030), (520, 2030), (520, 2040), (500, 2050), (4500, 2330))
    found = rounded(free, tight, no_pins(tight), other)
    assert found is not None
    assert calls <= 1
    assert_sound(free, found)


def test_more_room_means_a_wider_track_and_ends_that_are_legal_with_it() -> None:
    problem = replace(hills(0, 400.0), turn_radius_m=200.0)
    wider = with_more_clearance(problem, 80.0)
    assert wider.limits.track_error_m == problem.limits.track_error_m + 80.0
    assert wider.turn_radius_m == 0.0
    for end, lifted in ((problem.start, wider.start), (problem.goal, wider.goal)):
        assert lifted[:2] == end[:2]
        assert lifted[2] >= max(end[2], float(problem.airspace.floor_amsl(*end[:2], wider.limits)) - 1e-9)


def test_there_is_no_more_room_beside_unknown_ground() -> None:
    heights = np.zeros((101, 101))
    heights[:, :50] = math.nan
    known = ground(0.0)
    air = Airspace(Surface(heights, heights, known.grid))
    problem = Problem(air, Limits(50.0, track_error_m=5.0), (1020.0, 1000.0, 60.0), (1900.0, 1000.0, 60.0))
    assert with_more_clearance(problem, 10.0).start == problem.start
    with pytest.raises(Refusal):
        with_more_clearance(problem, 40.0)


def test_a_path_that_ends_with_a_climb_on_the_spot_has_finite_arcs() -> None:
    air = Airspace(ground(0.0))
    problem = Problem(air, Limits(10.0), (100.0, 100.0, 60.0), (1900.0, 900.0, 90.0), turn_radius_m=40.0)
    points = np.array([problem.start, (900.0, 900.0, 60.0), (1900.0, 900.0, 60.0), problem.goal])
    arc_path = arc_path_of(problem, points, np.array([True, False, True, True]), 0.5)
    assert np.isfinite(arc_path.centre).all()
    assert len(arc_path.centre) == 1


def test_no_radius_is_no_question() -> None:
    corners = at_100((500, 500), (2500, 3000), (4300, 700))
    with pytest.raises(ValueError, match="turn_radius_m must be greater than 0"):
        rounded(problem_of(corners, turn_radius_m=0.0), corners, no_pins(corners))
