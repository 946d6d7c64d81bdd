"""The search over altitude caps, the altitudes that no short track avoids, and the bound of whole problems, compared
with fine lists of caps and with many random paths."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.plane.corridor import End
from gcsplan.planners.optimal.plane.leg import Leg
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.optimal.searches import fine_tracks
from gcsplan.planners.optimal.searches.bound import altitude_ranges, climb_bound, rise_bound
from gcsplan.planners.optimal.searches.cap_pairs import MOST_CAPS, Layer, search_caps
from gcsplan.planners.optimal.table import NAMES
from gcsplan.planners.problem import Objective, Problem, Via
from gcsplan.planners.profile.track import Flown, fly, make_track
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.effort import draws
from tests.support.planner_worlds import faults, ground
from tests.support.searches import improve, looked

HORIZONTAL, VERTICAL = 100.0, 120.0


def energy(track_m: float, vertical_m: float) -> float:
    return VERTICAL * vertical_m + HORIZONTAL * track_m


# --- caps ---------------------------------------------------------------------------------------------------------


class Caps:
    """An artificial problem: the higher the cap, the shorter the track, by steps and evenly."""

    def __init__(self, seed: int, *, blind: float = 0.0) -> None:
        rng = np.random.default_rng(seed)
        self.low, self.top = float(rng.uniform(0.0, 300.0)), float(rng.uniform(310.0, 900.0))
        self.at = np.sort(rng.uniform(self.low, self.top, int(rng.integers(1, 9))))
        self.drop = rng.exponential(300.0, len(self.at))
        self.slope = float(rng.uniform(0.0, 1.5)) * (rng.random() < 0.5)
        self.base = 5_000.0 + self.drop.sum() + self.slope * (self.top - self.low)
        # By which part the first, quick length is too short, and by how much paths are longer than tracks.
        self.blind, self.worse = blind, 1.0 + 0.01 * float(rng.random()) * (rng.random() < 0.5)
        self.best = math.inf
        self.asked: list[tuple[float, int]] = []
        self.tried: list[float] = []

    def track(self, cap: float) -> float:
        return float(self.base - self.drop[self.at <= cap].sum() - self.slope * (min(cap, self.top) - self.low))

    def rise(self, touched: float) -> float:
        return 2.0 * max(touched - self.low, 0.0)

    def cost(self, cap: float) -> float:
        return energy(self.track(cap), self.rise(cap))

    def track_m(self, cap: float, care: int) -> float:
        self.asked.append((cap, care))
        return self.track(cap) * (1.0 if care else 1.0 - self.blind)

    def try_at(self, cap: float) -> None:
        self.tried.append(cap)
        self.best = min(self.best, self.cost(cap) * self.worse)

    def search(self, gap: float, in_time: Callable[[], bool] = lambda: True) -> float:
        self.try_at(self.top)
        layers = [Layer(self.low, self.top, self.track(self.top) * (1.0 - self.blind))]
        return search_caps(
            layers, lambda layer: layer.cost(self.rise, energy), self.track_m, lambda: self.best,
            self.try_at, gap, in_time,
        )  # fmt: skip

    def least(self) -> float:
        """The least cost over a fine list of caps, and over the caps at which tracks get shorter."""
        return min(map(self.cost, [*np.linspace(self.low, self.top, 3000), *self.at, self.low]))


@pytest.mark.nightly
@given(st.integers(0, 2**31), st.sampled_from([0.0, 1e-3, 1e-2]), st.sampled_from([0.0, 0.02, 0.3]))
@settings(max_examples=draws(60))
def test_no_cap_costs_less_than_the_bound(seed: int, gap: float, blind: float) -> None:
    caps = Caps(seed, blind=blind)
    bound = caps.search(gap)
    assert bound <= caps.least() * (1.0 + 1e-12)
    assert bound <= caps.best
    assert len(caps.asked) <= 2 * MOST_CAPS
    assert all(caps.low <= cap <= caps.top for cap in caps.tried)


@pytest.mark.slow
def test_the_bound_meets_the_best_path_where_tracks_and_paths_are_as_long() -> None:
    met = 0
    for seed in range(60):
        caps = Caps(seed, blind=0.05)
        caps.worse = 1.0
        bound = caps.search(1e-3)
        # The remaining gap is the requested one, or the cost of a layer too thin to split.
        met += caps.best - bound <= 1e-3 * caps.best + VERTICAL * 2.0 * 0.25
        assert bound >= caps.least() * 0.98
    assert met >= 54


@pytest.mark.slow
def test_out_of_time_the_bound_holds_and_nothing_more_is_asked() -> None:
    for seed in range(20):
        for some in (0, 5):
            caps, left = Caps(seed), itertools.count()
            bound = caps.search(0.0, lambda some=some, left=left: next(left) < some)  # type: ignore[misc]
            assert bound <= caps.least() * (1.0 + 1e-12)
            assert len(caps.asked) <= some


# --- altitudes that no short track avoids -------------------------------------------------------------------------


def hills(seed: int, limits: Limits, zones: int = 0, **more: object) -> Problem:
    rng = np.random.default_rng(seed)
    bumps = np.column_stack(
        [rng.uniform(300.0, 1700.0, (9, 2)), rng.uniform(100.0, 260.0, 9), rng.uniform(30.0, 220.0, 9)]
    )

    def height(e: Floats, n: Floats) -> Floats:
        out = np.full_like(e, 200.0)
        for x, y, wide, tall in bumps:
            out = out + tall * np.exp(-((e - x) ** 2 + (n - y) ** 2) / (2.0 * wide**2))
        # A ridge from edge to edge, which every track must cross.
        return np.asarray(out + 90.0 * np.exp(-(((e - 1000.0 - 0.2 * (n - 1000.0)) / 130.0) ** 2)))

    found = [
        Zone(
            f"zone {k}",
            Circle(*map(float, rng.uniform(500.0, 1500.0, 2)), float(rng.uniform(60.0, 160.0))),
            None,
            None if k % 2 else Level(float(rng.uniform(350.0, 450.0)), "amsl"),
        )
        for k in range(zones)
    ]
    air = Airspace(ground(height, step_m=20.0), found)
    ends = np.array([[150.0, float(rng.uniform(500.0, 1500.0))], [1850.0, float(rng.uniform(500.0, 1500.0))]])
    z = air.floor_amsl(ends[:, 0], ends[:, 1], limits) + rng.uniform(0.5, 30.0, 2)
    a, b = ((float(e[0]), float(e[1]), float(h)) for e, h in zip(ends, z, strict=True))
    return replace(Problem(air, limits, a, b), **more)  # type: ignore[arg-type]


BARE = Limits(min_agl_m=40.0, track_error_m=2.0, altitude_error_m=3.0)


def tracks(problem: Problem, rng: np.random.Generator, count: int, bend: float) -> list[Floats]:
    """Random bent tracks (N, 2) through all terminals; ``bend``: offset from the straight line as a part of it."""
    stops = np.array([problem.start[:2], *((v.east_m, v.north_m) for v in problem.via), problem.goal[:2]])
    out = []
    for _ in range(count):
        parts = [stops[:1]]
        for a, b in itertools.pairwise(stops):
            t = np.sort(rng.uniform(0.1, 0.9, int(rng.integers(0, 4))))[:, None]
            away = rng.normal(0.0, bend * rng.random() * math.dist(a, b), (len(t), 1))
            parts += [a + t * (b - a) + away * np.array([[-(b - a)[1], (b - a)[0]]]) / math.dist(a, b), b[None]]
        track = np.vstack(parts).clip(30.0, 1970.0)
        out.append(track[np.concatenate([[True], np.hypot(*np.diff(track, axis=0).T) > 1e-3])])
    return out


def flown(problem: Problem, track: Floats) -> Path | None:
    """The shortest legal path over a track; None unless the exact check passes it."""
    heights = {(v.east_m, v.north_m): v.amsl_m for v in problem.via}
    pinned = np.array([k in (0, len(track) - 1) or (p[0], p[1]) in heights for k, p in enumerate(map(tuple, track))])
    pin = np.array([math.nan if (z := heights.get((p[0], p[1]))) is None else z for p in map(tuple, track)])
    made = make_track(problem, track, pinned, pin)
    found = fly(problem, made)
    if not isinstance(found, Flown):
        return None
    s = np.unique(np.concatenate([made.s_m, found.profile.s_m]))
    points = np.column_stack([
        np.interp(s, made.s_m, track[:, 0]), np.interp(s, made.s_m, track[:, 1]), found.profile.at(s),
    ])  # fmt: skip
    if not problem.airspace.clear(Legs.of_path(points, problem.limits), problem.limits).all():
        return None
    return Path(points)


@pytest.mark.first_quick
@pytest.mark.parametrize("seed", range(3))
def test_floors_are_never_above_the_ground_that_a_short_track_sees(seed: int) -> None:
    problem = hills(seed, BARE)
    leg = Leg(problem, End(*problem.start), End(*problem.goal), 700.0)
    leg.flood(0.15)
    rng = np.random.default_rng(seed)
    least = math.dist(problem.start[:2], problem.goal[:2])
    assert leg.length_m == pytest.approx(least, rel=1e-9)
    compared = binding = 0
    for part in (1.001, 1.02, 1.1):
        limit = least * part
        at, low, _ = altitude_ranges(leg, least, limit)
        assert (np.diff(at) > 0.0).all()
        lowest = np.full(len(at), np.inf)
        for track in tracks(problem, rng, 150, 0.1 * math.sqrt(part - 1.0) + 0.02):
            s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track, axis=0).T))])
            if s[-1] > limit:
                continue
            # A longer track is compressed to the shortest length, here evenly.
            on = at * s[-1] / least
            e, n = np.interp(on, s, track[:, 0]), np.interp(on, s, track[:, 1])
            seen = problem.airspace.surface.top_at(e, n) + BARE.min_agl_m + BARE.altitude_error_m
            assert (low <= seen + 1e-9).all()
            lowest = np.minimum(lowest, seen)
            compared += 1
        binding += np.isfinite(low).sum() > 300 and (lowest - low).min() < 15.0
    assert compared > 100
    assert binding >= 1


def intervals(problem: Problem, seed: int, count: int) -> list[Zone]:
    """Zones one after the other on the straight track; each can be passed only above, only below, or both."""
    rng = np.random.default_rng([seed, 7])
    a, b = np.array(problem.start[:2]), np.array(problem.goal[:2])
    out = []
    for k in range(count):
        place = a + (k + 1) / (count + 1) * (b - a)
        ground_m = float(problem.airspace.surface.ground_at(*place[:, None])[0])
        low, high = Level(rng.uniform(40.0, 90.0), "agl"), Level(ground_m + rng.uniform(100.0, 160.0), "amsl")
        sides = [(None, high), (low, None), (low, high)][k % 3]
        out.append(Zone(f"interval {k}", Circle(*place.tolist(), 0.4 * math.dist(a, b) / (count + 1)), *sides))
    return out


@pytest.mark.nightly_but("0-0", "1-0", "2-0", "1-5", "0-2")
@pytest.mark.first_quick
@pytest.mark.parametrize(("seed", "zones"), [(0, 0), (1, 0), (2, 0), (0, 2), (1, 2), (2, 2), (0, 5), (1, 5)])
def test_no_path_over_a_short_track_is_shorter_than_the_bound_of_what_it_climbs(seed: int, zones: int) -> None:
    problem = hills(seed, BARE)
    problem = replace(problem, airspace=Airspace(problem.airspace.surface, intervals(problem, seed, zones)))
    leg = Leg(problem, End(*problem.start), End(*problem.goal), 700.0)
    leg.flood(0.15)
    rng = np.random.default_rng(seed)
    least = math.dist(problem.start[:2], problem.goal[:2])
    paths = [p for t in tracks(problem, rng, 40, 0.05) if (p := flown(problem, t)) is not None]
    assert len(paths) > 20
    climbs = 0
    for part in (1.002, 1.02, 1.12):
        bound, climbed_m = (f([leg], [least], [least * part]) for f in (rise_bound, climb_bound))
        assert bound >= least - 1e-6
        climbs += bound > least * (1.0 + 1e-4)
        for path in paths:
            if path.leg_horizontal_m.sum() <= least * part:
                assert bound <= path.length_m * (1.0 + 1e-9)
                assert climbed_m <= np.abs(np.diff(path.points[:, 2])).sum() + 1e-6
    assert climbs >= 1


# --- whole problems, with vias ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.nightly_but("free-90.0-length", "free-90.0-energy", "fixed-90.0-length", "none-30.0-energy")
@pytest.mark.parametrize("objective", ["length", "energy"])
@pytest.mark.parametrize(("kind", "climb_deg"), [("free", 90.0), ("fixed", 90.0), ("both", 90.0), ("none", 30.0)])
def test_no_path_past_vias_costs_less_than_the_bound(objective: Objective, climb_deg: float, kind: str) -> None:
    compared = near = 0
    for seed in range(2):
        limits = replace(BARE, max_climb_deg=climb_deg, max_descent_deg=climb_deg)
        rng = np.random.default_rng([seed, *kind.encode()])
        problem = hills(seed + 20, limits, zones=seed, objective=objective)
        places = {"none": 0, "free": 1, "fixed": 1, "both": 2}[kind]
        via = []
        for k in range(places):
            e, n = 700.0 + 500.0 * k + float(rng.uniform(0.0, 200.0)), float(rng.uniform(500.0, 1500.0))
            z = float(problem.airspace.floor_amsl(e, n, limits)) + float(rng.uniform(1.0, 60.0))
            inside = any(
                math.dist((e, n), (c.east_m, c.north_m)) < c.radius_m + 20.0
                for c in (zone.shape for zone in problem.airspace.zones)
                if isinstance(c, Circle)
            )
            if not inside:
                via.append(Via(e, n, z if kind == "fixed" or (kind == "both" and k == 0) else None))
        problem = replace(problem, via=tuple(via))
        work = looked(problem)
        below = work.incumbent
        assert not below.proved_infeasible
        if below.best is not None:
            improve(work)
        assert 0.0 < below.bound <= below.cost
        costs = []
        for track in tracks(problem, rng, 25, 0.04):
            path = flown(problem, track)
            if path is not None:
                costs.append(problem.cost(path))
        assert all(below.bound <= cost * (1.0 + 1e-9) for cost in costs)
        compared += len(costs)
        near += bool(costs) and min(costs) < 1.15 * below.bound
    assert compared > 10
    assert near >= 1


@pytest.mark.nightly_but("1-0.04")
@pytest.mark.slow
@pytest.mark.parametrize(("seed", "least_percent"), [(1, 0.04), (13, 0.1), (29, 0.2)])
def test_fine_tracks_with_a_track_error_pass_as_near_to_terrain_as_allowed(
    seed: int, least_percent: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits = Limits(min_agl_m=20.0, track_error_m=5.0, altitude_error_m=2.0, horizontal_clearance_m=10.0)
    problem = hills(seed, limits)
    ceiling_m = float(np.percentile(problem.airspace.surface.ground_m, 70)) + 24.0
    others = tuple(name for name in NAMES if name not in ("straight", "cap_search", "fine_tracks"))
    problem = replace(problem, limits=replace(limits, max_amsl_m=ceiling_m), options={"without": others})
    near = plan(problem).path
    assert faults(problem, near) == []
    monkeypatch.setattr(fine_tracks, "narrow_passage", lambda plane: False)
    assert problem.cost(plan(problem).path) > (1.0 + 0.01 * least_percent) * problem.cost(near)
