"""Levels of zones along a track, read from the ground: against dense samples, and by the exact check of paths."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.exact import LegJudge, Unsettled, sampled_track, settle
from gcsplan.planners.profile.taut_string import Profile
from gcsplan.planners.profile.track import Flown, fly, make_track
from gcsplan.planners.profile.zone_levels import ZoneLevels, widest_free
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.effort import seeds
from tests.support.planner_worlds import faults

STEP_M, SIZE_M, SLOPE = 30.0, 1200.0, 0.3
LIMITS = Limits(min_agl_m=20.0, horizontal_clearance_m=30.0, track_error_m=3.0, altitude_error_m=5.0, max_amsl_m=600.0)
REACH_M = 33.0


def rough(seed: int) -> Surface:
    """A valley between slopes of `SLOPE`, with bumps."""
    rng = np.random.default_rng(seed)
    n = round(SIZE_M / STEP_M) + 1
    away = np.abs(np.arange(n) * STEP_M - 0.5 * SIZE_M)[:, None]
    z = 100.0 + SLOPE * away + rng.uniform(-2.0, 2.0, (n, n))
    return Surface(z, z, GridMap.affine(0.0, SIZE_M, STEP_M, STEP_M))


def ends(track: Floats) -> Floats:
    return np.isin(np.arange(len(track)), [0, len(track) - 1])


@pytest.mark.nightly_but("0-disc")
@pytest.mark.slow
@pytest.mark.parametrize("shape", ["disc", "polygon"])
@pytest.mark.parametrize("seed", seeds(2, 2, 4))
def test_ground_under_a_zone_is_that_of_dense_samples(shape: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    surface = rough(seed)
    corners = 600.0 + 150.0 * np.array([[-1.0, -1.0], [1.2, -0.8], [0.1, 0.0], [0.9, 1.1]])
    form = Circle(600.0, 600.0, 170.0) if shape == "disc" else Polygon(corners)
    zone = Zone("z", form, Level(80.0, "agl"), None)
    places = rng.uniform(400.0, 800.0, (300, 2))
    low, high = Airspace(surface, [zone]).zone_table.own_ground_m(0, places, REACH_M)
    side = np.arange(-REACH_M, REACH_M + 0.1, 0.75)
    off = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    off = off[np.hypot(*off.T) <= REACH_M]
    from_middle, seen, missed = 0, 0, list[float]()
    for place, least, most in zip(places, low, high, strict=True):
        at = place + off
        within = np.hypot(*(at - 600.0).T) <= 170.0 if shape == "disc" else _inside(corners, at)
        if within.mean() < 0.02:  # the samples are not dense enough for what is left of the zone
            continue
        ground = surface.ground_at(*at[within].T)
        seen += 1
        from_middle += int(within.all())
        # The rings may miss a corner of the zone, and the highest place by the distance from point to point.
        assert most - ground.max() < 0.75
        assert least - ground.min() > -0.75
        missed.append(max(ground.max() - most, least - ground.min()))
        if within.all():
            assert missed[-1] < 1.5
    assert seen > 20
    assert np.median(missed) < 0.3
    assert from_middle > 3


def _inside(corners: Floats, p: Floats) -> Bools:
    after, e, n = np.roll(corners, -1, axis=0), p[:, :1], p[:, 1:]
    spans = (corners[:, 1] > n) != (after[:, 1] > n)
    slope = (after[:, 0] - corners[:, 0]) / (after[:, 1] - corners[:, 1])
    return np.asarray((spans & (corners[:, 0] + (n - corners[:, 1]) * slope > e)).sum(axis=1) % 2 == 1)


def over_a_slope(room_m: float) -> tuple[Problem, Floats]:
    """A zone over a slope whose ceiling, above its highest ground within reach of a level track, is ``room_m`` below
    the highest altitude; and that track."""
    n = round(SIZE_M / STEP_M) + 1
    step = SLOPE * STEP_M * np.arange(n)[::-1, None] * np.ones((1, n))
    # Beside the track the slope is three times as steep, which a bound over a whole piece takes for all of it.
    steep = 2.0 * SLOPE * STEP_M * (np.arange(n)[::-1, None] * STEP_M <= 570.0 - REACH_M - STEP_M)
    z = 100.0 + step - np.cumsum(steep, axis=0) * np.ones((1, n))
    surface = Surface(z, z, GridMap.affine(0.0, SIZE_M, STEP_M, STEP_M))
    track = np.array([[100.0, 570.0], [1100.0, 570.0]])
    highest = float(surface.ground_at(600.0, 570.0 + REACH_M))
    cap = LIMITS.max_amsl_m
    assert cap is not None
    ceiling = cap - 2.0 * LIMITS.altitude_error_m - highest - room_m
    zone = Zone("lid", Circle(600.0, 570.0, 200.0), None, Level(ceiling, "agl"))
    at_m = cap - 40.0
    problem = Problem(Airspace(surface, [zone]), LIMITS, (100.0, 570.0, at_m), (1100.0, 570.0, at_m))
    return problem, track


@pytest.mark.parametrize(("room_m", "found"), [(1.5, True), (-0.5, False)])
def test_a_path_over_a_zone_on_a_slope_is_found_if_the_exact_check_passes_it(room_m: float, found: bool) -> None:
    problem, track = over_a_slope(room_m)
    pins = ends(track), np.full(2, math.nan)
    assert not isinstance(fly(problem, sampled_track(problem, track, *pins)), Flown)  # the tube leaves no way
    way = settle(problem, LegJudge(problem), track, *pins)
    if not found:
        assert isinstance(way, Unsettled)
        return
    assert not isinstance(way, Unsettled)
    assert faults(problem, Path(way[0])) == []
    assert way[0][:, 2].max() > 593.0


def test_corrections_end_at_the_levels_of_the_tube() -> None:
    problem, track = over_a_slope(1.5)
    long = make_track(problem, track, ends(track), np.full(2, math.nan))
    (band,) = long.tube.bands
    levels = ZoneLevels.of(problem, long, band)
    flown = fly(problem, sampled_track(*_without_zones(problem, track)))
    assert isinstance(flown, Flown)
    before = levels.band.top_m.copy()
    assert (before <= levels.most[1]).all()
    assert (before < levels.most[1]).any()
    count = 0
    while levels.correct(flown.profile, band.s0_m, band.s1_m):
        count += 1
        assert count < 40
        assert (levels.band.top_m >= before).all()
    assert (levels.band.top_m == levels.most[1]).any(axis=1).sum() > 5


def test_a_level_read_too_low_is_corrected_under_a_profile_that_keeps_more_from_it() -> None:
    problem, track = over_a_slope(1.5)
    long = make_track(problem, track, ends(track), np.full(2, math.nan))
    (band,) = long.tube.bands
    levels = ZoneLevels.of(problem, long, band)
    top = levels.band.top_m
    top -= 0.8
    before = top.copy()
    highest = np.maximum(np.append(top[:, 0], top[-1, 1]), np.append(top[0, 0], top[:, 1]))
    profile = Profile(levels.band.s_m, highest + 0.1)
    assert levels.correct(profile, band.s0_m, band.s1_m)
    assert (levels.band.top_m > before + 0.1).any()


def _without_zones(problem: Problem, track: Floats) -> tuple[Problem, Floats, Floats, Floats]:
    free = Problem(Airspace(problem.airspace.surface), problem.limits, problem.start, problem.goal)
    return free, track, ends(track), np.full(2, math.nan)


@pytest.mark.parametrize("seed", range(6))
def test_the_widest_free_altitudes_are_those_of_many_tries(seed: int) -> None:
    rng = np.random.default_rng(seed)
    surface = rough(seed)
    zones = []
    for k in range(6):
        floor, ceiling = np.sort(rng.uniform(200.0, 600.0, 2)).tolist()
        at = 600.0, float(rng.uniform(200.0, 1000.0))
        kind = rng.integers(3)
        zones.append(
            Zone(
                f"z{k}", Circle(*at, float(rng.uniform(60.0, 250.0))), None if kind == 0 else Level(floor, "amsl"),
                None if kind == 1 else Level(ceiling, "amsl"),
            )
        )  # fmt: skip
    problem = Problem(Airspace(surface, zones), LIMITS, (600.0, 50.0, 400.0), (600.0, 1150.0, 400.0))
    track = make_track(problem, np.array([[600.0, 50.0], [600.0, 1150.0]]), np.ones(2, bool), np.full(2, math.nan))
    s = np.linspace(0.0, 1100.0, 90)
    floor = problem.floors(np.full(len(s), 600.0), 50.0 + s)
    enough = float(rng.choice([20.0, 1e6]))
    low, high = widest_free(problem, track, s, floor, 595.0, enough)
    z = np.arange(100.0, 595.0, 0.5)
    for k in range(len(s)):
        free = z > floor[k]
        for zone in zones:
            shape = zone.shape
            assert isinstance(shape, Circle)
            if abs(50.0 + s[k] - shape.north_m) < shape.radius_m + REACH_M:
                bottom = -math.inf if zone.floor is None else zone.floor.value_m - 5.0
                top = math.inf if zone.ceiling is None else zone.ceiling.value_m + 5.0
                free &= (z < bottom) | (z > top)
        change = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]]).astype(int)))
        runs = [(z[a], z[b - 1]) for a, b in change.reshape(-1, 2)]
        wide = [b - a for a, b in runs if b - a > 1.0]
        if not wide:
            assert high[k] - low[k] < 3.0
            continue
        if max(wide) < enough:
            assert high[k] - low[k] == pytest.approx(max(wide), abs=1.5)
        else:
            best = max(a for a, b in runs if b - a >= enough + 1.0) if max(wide) > enough + 1.0 else None
            assert best is None or low[k] >= best - 1.0
            assert high[k] - low[k] > enough - 1.0
