"""Every term of every cost, compared with plain Python written from the papers' equations, sample by sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely

from gcsplan.errors import InputError
from gcsplan.planners.problem import Problem
from gcsplan.research.swarm import cost_kernels as k
from gcsplan.research.swarm import objectives as o
from gcsplan.research.swarm import scene_kernels as sk
from gcsplan.research.swarm.encodings import Code
from gcsplan.research.swarm.objectives import OBJECTIVES, Cost, Earlier, get_objective
from gcsplan.research.swarm.scene import FAR, KEEP_SLOPE, SAMPLED_KEEP_M, Scene
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.planner_worlds import ground

LIMITS = Limits(
    min_agl_m=20.0, max_agl_m=150.0, max_amsl_m=320.0, horizontal_clearance_m=10.0, track_error_m=2.0,
    altitude_error_m=3.0, max_climb_deg=20.0, max_descent_deg=15.0,
)  # fmt: skip
ZONES = (
    Zone("tower", Circle(800.0, 700.0, 150.0)),
    Zone("mast", Circle(1200.0, 900.0, 120.0), None, Level(90.0, "agl")),
    Zone("airway", Circle(1000.0, 1200.0, 200.0), Level(180.0, "amsl"), Level(260.0, "amsl")),
    Zone("park", Polygon(np.array([[400.0, 900.0], [700.0, 850.0], [560.0, 960.0], [690.0, 1150.0], [420.0, 1100.0]]))),
)


def hills(east: np.ndarray, north: np.ndarray) -> np.ndarray:
    return 100.0 + 60.0 * np.sin(east / 260.0) * np.cos(north / 310.0)


def problem(objective: str = "length", zones: tuple[Zone, ...] = ZONES, limits: Limits = LIMITS) -> Problem:
    air = Airspace(ground(hills), zones, scale=1.0)
    return Problem(
        air, limits, (300.0, 400.0, 160.0), (1700.0, 1300.0, 170.0),
        objective="energy" if objective == "energy" else "length",
    )  # fmt: skip


def inside(point: list[float], scene: Scene) -> bool:
    return all(low <= q <= high for low, q, high in zip(scene.low, point, scene.high, strict=True))


class Oracle:
    """Terms of one path from its samples, in scalar Python."""

    def __init__(self, p: Problem, cost: Cost, samples: np.ndarray) -> None:
        self.p, self.points, self.stride = p, samples.tolist(), cost.stride
        self.scene = cost.code.scene
        self.ground = [float(g) for g in p.airspace.surface.top_at(samples[:, 0], samples[:, 1])]
        self.legs = [math.dist(a, b) for a, b in pairwise(self.points)]
        self.runs = [math.dist(a[:2], b[:2]) for a, b in pairwise(self.points)]
        self.points_and_more = list(self.divided())

    def divided(self) -> Iterator[tuple[list[float], float, bool]]:
        """Points at most a step apart, each with the length that it stands for and whether it may be moved."""
        length = math.fsum(self.legs)
        step_m = max(1.5 * self.scene.straight_m / 200.0, k.UNEVEN * length / len(self.legs))
        before = 0.0
        for (a, b), leg in zip(pairwise(self.points), self.legs, strict=True):
            parts = 1 if leg <= step_m else math.floor(leg / step_m) + 1
            for j in range(parts):
                place = [u + j / parts * (v - u) for u, v in zip(a, b, strict=True)]
                yield place, 0.5 * (before + leg / parts), j > 0 or a is not self.points[0]
                before = leg / parts
        yield self.points[-1], 0.5 * before, False

    def gap(self, zone: Zone, x: float, y: float) -> float:
        if isinstance(zone.shape, Circle):
            return math.hypot(x - zone.shape.east_m, y - zone.shape.north_m) - zone.shape.radius_m
        ring = shapely.Polygon(zone.shape.vertices)
        point = shapely.Point(x, y)
        return -ring.exterior.distance(point) if ring.contains(point) else ring.exterior.distance(point)

    def radius(self, zone: Zone) -> tuple[float, float, float]:
        if isinstance(zone.shape, Circle):
            return zone.shape.east_m, zone.shape.north_m, zone.shape.radius_m
        v = zone.shape.vertices
        centre = 0.5 * (v.min(axis=0) + v.max(axis=0))
        return float(centre[0]), float(centre[1]), max(math.dist(centre, q) for q in v)

    def floor(self, x: float, y: float) -> float:
        """The lowest legal altitude, bilinear between the raster's nodes, which are 20 m apart."""
        e, n = 20.0 * math.floor(x / 20.0), 20.0 * math.floor(y / 20.0)
        corner = self.p.airspace.floor_amsl([e, e + 20.0, e, e + 20.0], [n, n, n + 20.0, n + 20.0], self.p.limits)
        a, b = (x - e) / 20.0, (y - n) / 20.0
        south, north = (float(corner[i] + a * (corner[i + 1] - corner[i])) for i in (0, 2))
        return south + b * (north - south)

    def levels(self, zone: Zone, g: float) -> tuple[float, float]:
        error = self.p.limits.altitude_error_m
        low = -FAR if zone.floor is None else zone.floor.value_m - error + (g if zone.floor.datum == "agl" else 0.0)
        high = FAR if zone.ceiling is None else zone.ceiling.value_m + error + (
            g if zone.ceiling.datum == "agl" else 0.0
        )  # fmt: skip
        return low, high

    def terms(self) -> dict[int, float]:
        t = dict.fromkeys(range(k.TERMS), 0.0)
        limits, pts = self.p.limits, self.points
        t[k.LENGTH], t[k.FLAT] = math.fsum(self.legs), math.fsum(self.runs)
        t[k.RISE] = math.fsum(abs(b[2] - a[2]) for a, b in pairwise(pts))
        for (a, b), run in zip(pairwise(pts), self.runs, strict=True):
            rise = b[2] - a[2]
            t[k.STEEP] += max(0.0, rise - KEEP_SLOPE * math.tan(math.radians(20.0)) * run)
            t[k.STEEP] += max(0.0, -rise - KEEP_SLOPE * math.tan(math.radians(15.0)) * run)
        t[k.OUTSIDE] = float(sum(not (inside(q, self.scene)) for q in pts))
        error = limits.altitude_error_m + SAMPLED_KEEP_M
        for (x, y, z), w, between in self.points_and_more:
            g = float(self.p.airspace.surface.top_at(x, y))
            low, high = self.floor(x, y) + SAMPLED_KEEP_M, min(g + limits.max_agl_m, limits.max_amsl_m) - error
            if between and z < low:
                t[k.BELOW] += w
                t[k.SUNK] += w * (low - z)
            if between and z > high:
                t[k.ABOVE] += w
                t[k.PROUD] += w * (z - high)
            for n, zone in enumerate(self.p.airspace.zones):
                gap, (bottom, top) = self.gap(zone, x, y), self.levels(zone, g)
                reach = self.scene.zones[n, sk.REACH]
                if gap < reach and bottom < z < top:
                    t[k.INSIDE] += w
                    t[k.DEEP] += w * min(reach - gap, z - bottom, top - z)
        for i, ((x, y, z), g) in enumerate(zip(pts, self.ground, strict=True)):
            t[k.UNDER] += 0 < i < len(pts) - 1 and z < self.floor(x, y) + SAMPLED_KEEP_M
            t[k.HIGH] += max(0.0, z - g - limits.min_agl_m) / len(pts)
            t[k.BURIED] += max(0.0, g - z)
            apart = z - g
            for zone in self.p.airspace.zones:
                gap, (e, nn, r) = self.gap(zone, x, y), self.radius(zone)
                if i < len(self.legs):
                    t[k.THREAT] += self.legs[i] * max(0.0, -gap) / r  # eq. 24: 1 - d/R is -gap/R of a circle
                middle = 0.0
                if zone.ceiling is not None:
                    middle = 0.5 * (zone.ceiling.value_m + (zone.floor.value_m if zone.floor else 0.0))
                    middle += g if zone.ceiling.datum == "agl" else 0.0
                t[k.SPHERE] += max(0.0, r - math.dist((x, y, z), (e, nn, middle)))
                apart = min(apart, gap)
            if i > 0:
                highest = self.scene.numbers[sk.H_MAX]
                t[k.EXPOSED] += self.runs[i - 1] * ((z - g - 20.0) if apart >= 20.0 else 3.0 * (highest + 20.0))
        self.node_terms(t)
        return t

    def node_terms(self, t: dict[int, float]) -> None:
        nodes, grounds = self.points[:: self.stride], self.ground[:: self.stride]
        chords = [tuple(b[i] - a[i] for i in range(3)) for a, b in pairwise(nodes)]
        headings = [math.atan2(c[1], c[0]) for c in chords]
        for a, c in zip(nodes, chords, strict=False):
            pitch = abs(math.atan2(c[2], math.hypot(c[0], c[1])))
            if pitch > math.radians(45.0):
                t[k.PITCH] += math.exp(pitch - math.radians(45.0))
            slope = c[2] / math.hypot(c[0], c[1])
            alpha = -1.5377e-10 * a[2] ** 2 - 2.6997e-5 * a[2] + 0.4211
            beta = 2.5063e-9 * a[2] ** 2 - 6.3014e-6 * a[2] - 0.3257
            t[k.SLOPES] += not beta <= slope <= alpha
        for (h0, h1), (c0, c1) in zip(pairwise(headings), pairwise(chords), strict=True):
            turn = abs(math.remainder(h1 - h0, 2.0 * math.pi))
            t[k.YAW] += math.exp(turn) - 1.0
            t[k.TURNS] += turn > math.radians(45.0)
            dot = sum(p * q for p, q in zip(c0, c1, strict=True))
            t[k.BEND] += math.acos(max(-1.0, min(1.0, dot / (math.hypot(*c0) * math.hypot(*c1)))))
        for (x, y, z), g in zip(nodes[1:-1], grounds[1:-1], strict=True):
            for zone in self.p.airspace.zones:
                bottom, top = self.levels(zone, g)
                beside = max(0.0, self.gap(zone, x, y) - 1.0)
                over = max(0.0, z - top - 1.0, bottom - z - 1.0)
                d = math.hypot(beside, over)
                if d < 10.0:
                    t[k.NEAR] += 1.0 / max(d, 0.1)


def cost_of(name: str, p: Problem, points: int = 6) -> Cost:
    return Cost(p, Code.of("box", Scene.of(p), points), OBJECTIVES[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ssgwo", "msfoa", "ib-abc", "abo"])
def test_terms_are_those_of_the_equations(name: str) -> None:
    p = problem()
    cost = cost_of(name, p)
    controls = cost.code.controls(np.random.default_rng(5).random((7, cost.dim)))
    controls[0, 2:4, 2] += 1500.0  # steeper than allowed, and outside of the volume
    samples = cost.curve.samples(controls)
    measured = cost.terms(controls)
    own = {
        "ssgwo": {k.YAW, k.PITCH, k.NEAR},
        "msfoa": {k.HIGH, k.BURIED, k.THREAT, k.SPHERE, k.TURNS, k.SLOPES},
        "ib-abc": {k.BEND, k.EXPOSED, k.SPHERE, k.THREAT, k.TURNS, k.SLOPES},
        "abo": {k.UNDER, k.OUTSIDE},
    }  # fmt: skip
    unwanted = set().union(*own.values()) - own[name]
    seen = np.zeros(k.TERMS)
    for row, path in zip(measured, samples, strict=True):
        wanted = Oracle(p, cost, path).terms()
        for term in set(range(k.TERMS)) - unwanted - {k.UNKNOWN}:
            # Rasters are in single precision, and beside a node the conservative floor differs slightly.
            assert row[term] == pytest.approx(wanted[term], rel=1e-3, abs=2e-2), (name, term)
        seen += row
    common = {k.STEEP, k.BELOW, k.ABOVE, k.INSIDE, k.DEEP, k.YAW, k.PITCH, k.TURNS, k.SLOPES, k.BEND, k.OUTSIDE}
    assert all(seen[t] > 0 for t in common - unwanted)  # agreement on zeros alone shows nothing


def by_hand(name: str, t: np.ndarray, p: Problem, cost: Cost) -> float:
    """The papers' costs as sums of the terms."""
    straight = cost.code.scene.straight_m
    metres = t[k.BELOW] + t[k.ABOVE] + t[k.UNKNOWN] + t[k.INSIDE] + t[k.STEEP]
    bad = metres + 20.0 * (t[k.SUNK] + t[k.PROUD] + t[k.DEEP]) / straight
    formulas: dict[str, Callable[[], float]] = {
        "krill": lambda: t[k.LENGTH] + 100 * bad,
        "ssgwo": lambda: 0.5 * t[k.LENGTH] + 0.2 * (t[k.YAW] + t[k.PITCH]) + 0.3 * 100 * t[k.NEAR] + 100 * bad,
        "msfoa": lambda: (
            t[k.HIGH] / (cost.code.scene.high[2] - cost.code.scene.low[2]) * t[k.LENGTH]
            + t[k.LENGTH] + t[k.THREAT] + t[k.BURIED] + 100 * (t[k.TURNS] + t[k.SLOPES]) + 100 * bad
        ),
        "abo": lambda: (
            t[k.LENGTH] + 100 * (t[k.UNDER] + t[k.OUTSIDE])
            + 100 * (t[k.ABOVE] + t[k.INSIDE] + t[k.STEEP] + 20.0 * (t[k.PROUD] + t[k.DEEP]) / straight)
        ),
    }  # fmt: skip
    if name != "ib-abc":
        return float(formulas[name]())
    s = cost.unit.straight
    parts = [0.4 * t[k.LENGTH] / s[k.LENGTH], 0.2 * t[k.EXPOSED] / s[k.EXPOSED]]
    parts += [0.2 * t[k.BEND] / (s[k.BEND] if s[k.BEND] > 1e-3 else math.pi)]
    parts += [0.2 * t[k.SPHERE] / (s[k.SPHERE] if s[k.SPHERE] > 1e-9 else 1.0)]
    return float(sum(parts) + 100 * bad / straight)


@pytest.mark.parametrize("name", OBJECTIVES)
def test_a_cost_is_its_papers_sum_of_terms(name: str) -> None:
    p = problem()
    cost = cost_of(name, p)
    u = np.random.default_rng(8).random((9, cost.dim))
    terms = cost.terms(cost.code.controls(u))
    np.testing.assert_allclose(cost(u), [by_hand(name, t, p, cost) for t in terms], rtol=1e-9)


def test_energy_is_r1_on_the_vertical_and_r2_on_the_horizontal() -> None:
    free = problem("energy", (), Limits(0.0))
    cost = cost_of("krill", free)
    controls = cost.code.controls(np.random.default_rng(2).random((4, cost.dim)))
    controls[:, 1:-1, 2] = np.maximum(controls[:, 1:-1, 2], 200.0)
    controls[:, [0, -1], 2] = 200.0
    t = cost.terms(controls)
    assert t[:, k.BELOW].max() == 0.0
    np.testing.assert_allclose(cost.of_controls(controls), 120.0 * t[:, k.RISE] + 100.0 * t[:, k.FLAT])


def test_floors_on_a_raster_of_their_own_or_on_the_grounds_give_the_same_terms() -> None:
    cost = cost_of("msfoa", problem())
    controls = cost.code.controls(np.random.default_rng(6).random((20, cost.dim)))
    controls[0, 1, :2] = (-900.0, 2900.0)  # off the raster
    scene = cost.code.scene
    assert scene.floor_map is scene.quadratic
    together = cost.terms(controls)
    apart = np.vstack([scene.floors, scene.floors[-1:]])  # a row more, which no sample needs: other nodes
    cost.code = replace(cost.code, scene=replace(scene, floors=apart))
    np.testing.assert_allclose(together[1:], cost.terms(controls)[1:], rtol=1e-12, atol=1e-9)
    assert together[0, k.UNKNOWN] > 0.0
    assert together[:, k.BURIED].max() > 0.0
    assert together[:, k.SUNK].max() > 0.0


def test_a_population_costs_what_its_members_cost() -> None:
    cost = cost_of("ssgwo", problem())
    u = np.random.default_rng(1).random((40, cost.dim))
    np.testing.assert_array_equal(cost(u), np.concatenate([cost(row[None]) for row in u]))


def test_unknown_ground_is_charged_and_never_makes_a_cost_unknown() -> None:
    z = np.full((41, 41), 50.0)
    z[:, 20:23] = np.nan
    from gcsplan.world.geometry.surface import GridMap, Surface

    air = Airspace(Surface(z, z, GridMap.affine(0.0, 2000.0, 50.0, 50.0)))
    p = Problem(air, Limits(10.0), (300.0, 1000.0, 80.0), (1700.0, 1000.0, 80.0))
    for name in OBJECTIVES:
        cost = Cost(p, Code.of("box", Scene.of(p), 4), OBJECTIVES[name])
        u = np.full((1, cost.dim), 0.5)
        terms = cost.terms(cost.code.controls(u))
        # The void and one cell on either side; the conservative floor may add one more.
        assert 180.0 < terms[0, k.UNKNOWN] < 330.0
        assert np.isfinite(cost(u)).all()
        assert np.isfinite(terms).all()


def test_zones_away_from_a_path_and_heights_beyond_a_band_cost_nothing() -> None:
    cost = cost_of("krill", problem(zones=ZONES[2:3], limits=Limits(0.0)))
    controls = cost.code.controls(np.full((3, cost.dim), 0.5))
    line = np.linspace((900.0, 1100.0), (1100.0, 1300.0), controls.shape[1])
    controls[:, :, :2] = line
    for row, z in zip(controls, (175.0, 220.0, 265.0), strict=True):
        row[:, 2] = z
    inside = cost.terms(controls)[:, k.INSIDE]
    assert inside[0] == inside[2] == 0.0
    assert inside[1] == pytest.approx(math.dist(line[0], line[-1]), rel=1e-6)


def test_a_vehicle_with_the_right_of_way_is_kept_apart_from_in_time() -> None:
    p = problem(zones=(), limits=Limits(0.0))
    scene = Scene.of(p)
    code = Code.of("box", scene, 3)
    base = Cost(p, code, OBJECTIVES["krill"])
    controls = base.straight_controls()[None]
    path = base.curve.samples(controls)[0]
    alone = base.of_controls(controls)[0]
    same = Earlier.at_speed(path, 15.0)
    late = Earlier(same.points, same.clock_s + 10.0)
    for other, more in ((same, True), (late, False)):
        cost = Cost(p, code, OBJECTIVES["krill"], earlier=(other,), speed_m_s=15.0)
        assert bool(cost.of_controls(controls)[0] > alone) is more
    clock = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]) / 15.0
    wanted = sum(
        (0.5 - abs(t - s)) ** 3
        for q, t in zip(path.tolist(), clock, strict=True)
        for r, s in zip(same.points.tolist(), same.clock_s, strict=True)
        if math.dist(q, r) < 30.0 and abs(t - s) < 0.5
    )
    cost = Cost(p, code, OBJECTIVES["krill"], earlier=(same,), speed_m_s=15.0)
    assert cost.of_controls(controls)[0] - alone == pytest.approx(100.0 * 100.0 * wanted)


def every_pair(path: np.ndarray, clock: np.ndarray, points: np.ndarray, clocks: np.ndarray, apart_m: float) -> float:
    """Eq. 28-30 over all pairs of points, without selecting pairs by time."""
    return sum(
        (0.5 - abs(t - s)) ** 3
        for q, t in zip(path.tolist(), clock.tolist(), strict=True)
        for r, s in zip(points.tolist(), clocks.tolist(), strict=True)
        if (q[0] - r[0]) ** 2 + (q[1] - r[1]) ** 2 + (q[2] - r[2]) ** 2 < apart_m * apart_m and 0.5 - abs(t - s) > 0.0
    )


@pytest.mark.parametrize("tick", [None, 0.125, 0.5])
def test_the_window_of_time_leaves_out_no_pair_of_points(tick: float | None) -> None:
    # With ticks, clocks may stand still, be equal, or differ by exactly the window's length.
    rng = np.random.default_rng(12)
    seen = 0.0
    for case in range(60):
        samples, others = int(rng.integers(2, 40)), int(rng.integers(1, 40))
        paths, points = rng.uniform(0.0, 60.0, (3, samples, 3)), rng.uniform(0.0, 60.0, (others, 3))
        clocks = np.sort(rng.uniform(0.0, 6.0, (3, samples)), axis=1)
        other_clocks = np.sort(rng.uniform(0.0, 6.0, others)) + (20.0 if case % 10 == 9 else 0.0)
        if tick is not None:
            clocks, other_clocks = np.round(clocks / tick) * tick, np.round(other_clocks / tick) * tick
        found = np.full(3, np.nan)
        sk.nearness(paths, clocks, points, other_clocks, 30.0, 0.5, found)
        wanted = [every_pair(*own, points, other_clocks, 30.0) for own in zip(paths, clocks, strict=True)]
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-15)
        seen += sum(wanted)
    assert seen > 1.0


def test_clocks_are_lengths_so_far_over_the_speed() -> None:
    paths = np.random.default_rng(4).uniform(-500.0, 500.0, (5, 30, 3))
    paths[1, 7:10] = paths[1, 6]  # no movement
    found = np.full((5, 30), np.nan)
    sk.clocks_of(paths, 12.5, found)
    lengths = np.cumsum(np.linalg.norm(np.diff(paths, axis=1), axis=2), axis=1)
    np.testing.assert_allclose(found, np.hstack([np.zeros((5, 1)), lengths / 12.5]), rtol=1e-12)
    assert (np.diff(found, axis=1) >= 0.0).all()


def test_float_noise_of_the_straight_line_is_no_turn_to_weigh_bends_by() -> None:
    p = problem(zones=(), limits=Limits(0.0))
    cost = cost_of("ib-abc", p)
    straight = cost.unit.straight
    assert straight[k.BEND] < 1e-9
    controls = cost.straight_controls()[None].copy()
    controls[0, 2, :2] += (40.0, -30.0)
    terms = cost.terms(controls)[0]
    assert terms[k.BEND] > 0.01
    bends = 0.2 * terms[k.BEND] / math.pi
    own = 0.4 * terms[k.LENGTH] / straight[k.LENGTH] + 0.2 * terms[k.EXPOSED] / straight[k.EXPOSED]
    bad = 100.0 * o.forbidden(terms[None], cost.unit.straight_m)[0] / cost.unit.straight_m
    assert cost.of_controls(controls)[0] == pytest.approx(own + bends + bad)


def test_an_unknown_cost_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"no swarm cost 'beauty'\. Known: krill"):
        get_objective("beauty")


def test_the_papers_weights_are_whole() -> None:
    assert math.isclose(sum(o.SSGWO_WEIGHTS), 1.0)
    assert math.isclose(sum(o.IB_ABC_WEIGHTS), 1.0)
