"""The tube: profiles inside it pass the check, and it is hardly narrower than necessary."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.arrays import Floats
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.tube import Tube
from tests.oracles.legs import deepest
from tests.support.effort import draws
from tests.support.random_worlds import (
    in_degrees,
    in_plane,
    jacksboro,
    oracle_of,
    random_limits,
    random_zones,
    surface_of,
    turned,
)


def flat(zones: tuple[Zone, ...] = ()) -> Airspace:
    """An airspace over ground at 100 m from (-1000, -1000) to (3000, 3000)."""
    z = np.full((41, 41), 100.0)
    return Airspace(Surface(z, z, GridMap.affine(-1000.0, 3000.0, 100.0, 100.0)), zones)


def at(s_m: Floats, values: Floats, s: float) -> Floats:
    """Values of a piecewise linear function at ``s``, one for every piece that contains it (two at a breakpoint)."""
    low, high = s_m[:-1], s_m[1:]
    k = np.nonzero((low <= s) & (s <= high))[0]
    w = (s - low[k]) / np.maximum(high[k] - low[k], 1e-12)
    with np.errstate(invalid="ignore"):
        inner = values[k, 0] + w * (values[k, 1] - values[k, 0])
    # If one end of a piece is infinite, all values inside it are.
    return np.where(np.isfinite(values[k]).all(axis=1), inner, values[k].sum(axis=1))


def keeps(s_m: Floats, values: Floats, profile_s: Floats, profile: Floats, sign: float) -> bool:
    """Whether ``sign·profile >= sign·values`` everywhere, both piecewise linear."""
    ends = np.stack([s_m[:-1], s_m[1:]], axis=-1)
    fine = bool((sign * np.interp(ends, profile_s, profile) >= sign * values - 1e-9).all())
    inner = [(s, z) for s, z in zip(profile_s, profile, strict=True) if s_m[0] <= s <= s_m[-1]]
    return fine and all((sign * z >= sign * at(s_m, values, s) - 1e-9).all() for s, z in inner)


def hug(tube: Tube, stations: Floats, sign: float, past_zones: bool) -> Floats | None:
    """A profile over ``stations``, as near to the floor (sign 1) or the ceiling (-1) as straight legs allow.

    None if it cannot pass a zone on that side.
    """
    walls = [(tube.s_m, sign * (tube.floor_m if sign > 0 else tube.ceiling_m))]
    if past_zones:
        walls += [(b.s_m, sign * (b.top_m if sign > 0 else b.bottom_m)) for b in tube.bands]
    if any((values == math.inf).any() for _, values in walls):
        return None
    walls = [(w, np.maximum(values, -1e6)) for w, values in walls]
    s = np.concatenate([np.stack([w[:-1], w[1:]], axis=-1).ravel() for w, _ in walls])
    v = np.concatenate([values.ravel() for _, values in walls])
    z = np.array([max(at(w, values, x).max(initial=-1e6) for w, values in walls) for x in stations])
    for k in range(len(stations) - 1):
        a, b = stations[k], stations[k + 1]
        on = (s >= a) & (s <= b)
        short = (v[on] - np.interp(s[on], [a, b], z[k : k + 2])).max(initial=0.0)
        z[k : k + 2] += max(short, 0.0)
    return sign * z


@pytest.mark.nightly
@settings(max_examples=draws(80))
@given(seed=st.integers(0, 2**32 - 1), kind=st.integers(0, 3))
def test_a_profile_inside_the_tube_and_outside_the_bands_passes_the_check(seed: int, kind: int) -> None:
    rng = np.random.default_rng(seed)
    ground = (in_plane, turned, in_degrees, lambda _: jacksboro())[kind](rng)
    surface, zones = surface_of(rng, ground), random_zones(rng, ground)
    drawn = random_limits(rng, ground)
    limits = Limits(
        drawn.min_agl_m, None if drawn.max_agl_m is None else 2.0 * drawn.max_agl_m, drawn.max_amsl_m,
        drawn.horizontal_clearance_m, drawn.track_error_m, drawn.altitude_error_m,
    )  # fmt: skip
    airspace = Airspace(surface, zones, scale=1.0 if rng.random() < 0.5 else 1.0001)
    west, south, east, north = ground.box
    steps = rng.normal(0.0, 5.0 * ground.cell_m, (int(rng.integers(2, 5)), 2)).cumsum(axis=0)
    track = (np.array([rng.uniform(west, east), rng.uniform(south, north)]) + steps - steps[0]).clip(
        (west, south), (east, north)
    )
    tube = airspace.tube(track, limits)
    length = np.concatenate([[0.0], np.hypot(*np.diff(track, axis=0).T).cumsum()])
    assert tube.s_m[0] == 0.0
    assert tube.s_m[-1] == pytest.approx(length[-1])
    assert (np.diff(tube.s_m) >= 0.0).all()
    assert not np.isnan(tube.floor_m).any()
    assert not np.isnan(tube.ceiling_m).any()
    if not np.isfinite(tube.floor_m).all():
        return
    stations = np.unique(np.concatenate([length, rng.uniform(0.0, length[-1], int(rng.integers(0, 30)))]))
    for sign in (1.0, -1.0):
        for past_zones in (False, True):
            profile = hug(tube, stations, sign, past_zones)
            if profile is None or profile.min() < -1e5 or profile.max() > 1e5:
                continue
            inside = keeps(tube.s_m, tube.floor_m, stations, profile, 1.0)
            inside &= keeps(tube.s_m, tube.ceiling_m, stations, profile, -1.0)
            for band in tube.bands:
                over = keeps(band.s_m, band.top_m, stations, profile, 1.0)
                inside &= over or keeps(band.s_m, band.bottom_m, stations, profile, -1.0)
            if inside:
                plane = [np.interp(stations, length, track[:, k]) for k in range(2)]
                report = airspace.examine(Legs.of_path(np.stack([*plane, profile], axis=-1), limits), limits)
                assert not report.violations, (sign, past_zones, report.violations[0])


def test_over_level_ground_the_tube_is_as_wide_as_the_limits_say() -> None:
    tube = flat().tube([[0, 0], [2000, 0], [2000, 1000]], Limits(60.0, 120.0, 215.0))
    assert tube.s_m[-1] == 3000.0
    assert np.unique(tube.floor_m).tolist() == [160.0]
    assert np.unique(tube.ceiling_m).tolist() == [215.0]
    assert tube.bands == ()
    # With errors: both limits move by 5 m, and by the 1 cm of the check's resolution.
    wide = Limits(60.0, 120.0, None, 30.0, 3.0, 5.0)
    tube = flat().tube([[0, 0], [2000, 0]], wide)
    assert tube.floor_m.min() == pytest.approx(165.0, abs=0.011)
    assert tube.ceiling_m.max() == pytest.approx(215.0, abs=0.011)
    assert flat().tube([[0, 0], [2000, 0]], Limits(60.0)).ceiling_m.min() == math.inf


@pytest.mark.nightly
def test_the_floor_over_mountains_is_within_decimetres_of_what_the_check_demands() -> None:
    """10 km of the sample, track error 3 m, clearance 30 m; measured difference 0.1 m (median) and 1.2 m (most)."""
    rng = np.random.default_rng(2)
    ground = jacksboro()
    surface = Surface(ground.heights, ground.heights, ground.grid)
    airspace, oracle = Airspace(surface), oracle_of(surface, ground, [], 1.0)
    limits = Limits(60.0, 120.0, None, 30.0, 3.0, 5.0)
    track = np.array([[-6000.0, -2000.0], [0.0, 3000.0]])
    tube = airspace.tube(track, limits)
    slack = []
    for k in range(0, len(tube.s_m) - 1, 7):
        t0, t1 = tube.s_m[k : k + 2] / tube.s_m[-1]
        a, b = (np.array([*(track[0] + t * (track[1] - track[0])), 0.0]) for t in (t0, t1))
        a[2], b[2] = tube.floor_m[k]
        up = deepest(oracle, surface.top_m, 1.0, a, b, 65.0, 3.0, 0.5, rng)
        a[2], b[2] = tube.ceiling_m[k]
        down = deepest(oracle, surface.ground_m, -1.0, a, b, -115.0, 3.0, 0.5, rng)
        assert up < -0.005
        assert down < -0.005
        slack += [-up, -down]
    assert np.median(slack) < 0.15
    assert max(slack) < 1.5


def test_over_unknown_ground_there_is_no_floor() -> None:
    heights = np.full((41, 41), 100.0)
    heights[20, 20] = np.nan  # unknown from 900 to 1100 m in both axes
    airspace = Airspace(Surface(heights, heights, GridMap.affine(-1000.0, 3000.0, 100.0, 100.0)))
    limits = Limits(60.0, 120.0, track_error_m=20.0)
    tube = airspace.tube([[0, 1000], [2000, 1000]], limits)
    lost = np.isinf(tube.floor_m).all(axis=1)
    first, last = tube.s_m[:-1][lost].min(), tube.s_m[1:][lost].max()
    assert 865.0 <= first <= 880.0
    assert 1120.0 <= last <= 1135.0
    assert (tube.ceiling_m[lost] == -math.inf).all()
    beside = airspace.tube([[0, 1121], [2000, 1121]], limits)
    assert np.isfinite(beside.floor_m).all()
    outside = airspace.tube([[2500, 0], [3500, 0]], limits)
    assert outside.s_m[-1] == 1000.0
    assert np.isinf(outside.floor_m[outside.s_m[:-1] >= 500.0]).all()
    assert np.isfinite(outside.floor_m[outside.s_m[1:] < 470.0]).all()


def test_a_band_stands_where_the_track_is_within_reach_of_a_zone() -> None:
    zone = Zone("z", Circle(1000, 0, 300), Level(150, "amsl"), Level(250, "amsl"))
    (band,) = flat((zone,)).tube([[0, 0], [900, 0], [2000, 0]], Limits(60.0, None, None, 30.0, 3.0, 5.0)).bands
    assert (band.zone, band.s0_m, band.s1_m) == (0, pytest.approx(667.0), pytest.approx(1333.0))
    assert np.unique(band.bottom_m).tolist() == [145.0]
    assert np.unique(band.top_m).tolist() == [255.0]
    assert not flat((zone,)).tube([[0, 400], [2000, 400]], Limits(60.0, horizontal_clearance_m=99.9)).bands
    high = Zone("z", Circle(1000, 0, 300))
    (band,) = flat((high,)).tube([[0, 0], [2000, 0]], Limits(60.0)).bands
    assert (band.bottom_m.max(), band.top_m.min()) == (-math.inf, math.inf)


def test_a_band_over_ground_follows_it() -> None:
    """The ground rises 0.1 m per metre, and a ceiling of 50 m AGL with it; 3 m of reach add 0.3 m."""
    heights = np.tile(np.arange(-100.0, 301.0, 10.0), (41, 1))
    zone = Zone("z", Circle(1000, 0, 300), None, Level(50, "agl"))
    airspace = Airspace(Surface(heights, heights, GridMap.affine(-1000.0, 3000.0, 100.0, 100.0)), [zone])
    (band,) = airspace.tube([[0, 0], [2000, 0]], Limits(0.0, track_error_m=3.0)).bands
    assert band.s0_m == pytest.approx(697.0, abs=0.1)
    assert band.s_m[0] == band.s0_m
    assert band.s_m[-1] == pytest.approx(band.s1_m)
    middle = np.stack([band.s_m[:-1], band.s_m[1:]], axis=-1)
    inside = (middle > 710.0) & (middle < 1290.0)
    assert band.top_m[inside] == pytest.approx(0.1 * middle[inside] + 50.3, abs=0.03)
    # Beyond the shape only ground inside it counts, up to the highest cell.
    assert band.top_m.max() <= 50.0 + 140.0


def test_the_arms_of_a_polygon_make_two_spans_and_its_inside_one() -> None:
    notch = np.array(
        [[500, -500], [1500, -500], [1500, 500], [1100, 500], [1100, -100], [900, -100], [900, 500], [500, 500]], float
    )
    airspace = flat((Zone("u", Polygon(notch)),))
    limits = Limits(60.0, horizontal_clearance_m=20.0)
    spans = [(b.s0_m, b.s1_m) for b in airspace.tube([[0, 200], [2000, 200]], limits).bands]
    assert np.array(spans) == pytest.approx(np.array([[480, 920], [1080, 1520]]))
    through = [(b.s0_m, b.s1_m) for b in airspace.tube([[0, -300], [700, -300], [2000, -300]], limits).bands]
    assert np.array(through) == pytest.approx(np.array([[480, 1520]]))
    within = [(b.s0_m, b.s1_m) for b in airspace.tube([[600, -300], [700, -300]], Limits(60.0)).bands]
    assert np.array(within) == pytest.approx(np.array([[0, 100]]))
    # Diagonally past the corner (500, 500), 20 m from it: on the line x + y = 1000 − 20·√2.
    shift = 20.0 * math.sqrt(2.0)
    graze = airspace.tube([[400 - shift, 600], [600 - shift, 400]], Limits(60.0, horizontal_clearance_m=19.9)).bands
    assert [b.zone for b in graze] == [0]
    assert graze[0].s0_m > 100.0


@pytest.mark.slow
@settings(max_examples=draws(60))
@given(seed=st.integers(0, 2**32 - 1), kind=st.integers(0, 2))
def test_a_hover_between_floor_and_ceiling_of_its_point_passes_the_check(seed: int, kind: int) -> None:
    rng = np.random.default_rng(seed)
    ground = (in_plane, turned, lambda _: jacksboro())[kind](rng)
    surface, limits = surface_of(rng, ground), random_limits(rng, ground)
    airspace = Airspace(surface, scale=1.0001)
    west, south, east, north = ground.box
    e, n = rng.uniform(west, east, 50), rng.uniform(south, north, 50)
    floor, ceiling = airspace.floor_amsl(e, n, limits), airspace.ceiling_amsl(e, n, limits)
    assert (floor[np.isnan(surface.top_at(e, n))] == math.inf).all()
    assert (ceiling[np.isnan(surface.ground_at(e, n))] == -math.inf).all()
    some = np.isfinite(floor) & (floor <= ceiling)
    for height in (floor[some], np.where(np.isfinite(ceiling), ceiling, floor)[some]):
        points = np.stack([e[some], n[some], height], axis=-1)
        errors = np.full(len(points), limits.track_error_m), np.full(len(points), limits.altitude_error_m)
        legs = Legs(points, points, np.zeros(len(points), np.bool_), *errors)
        assert not airspace.examine(legs, limits).violations


def test_floor_and_ceiling_of_points_keep_their_shape() -> None:
    e, n = np.meshgrid(np.arange(0.0, 500.0, 100.0), np.arange(0.0, 300.0, 100.0))
    limits = Limits(60.0, 120.0, 210.0)
    assert flat().floor_amsl(e, n, limits).tolist() == np.full((3, 5), 160.0).tolist()
    assert flat().ceiling_amsl(e, n, limits).tolist() == np.full((3, 5), 210.0).tolist()
    assert float(flat().floor_amsl(5000.0, 0.0, limits)) == math.inf
    assert float(flat().ceiling_amsl(5000.0, 0.0, limits)) == -math.inf


@pytest.mark.parametrize("track", [[[0.0, 0.0]], [[0.0, 0.0, 1.0], [1.0, 1.0, 1.0]], [[0.0, 0.0], [math.nan, 1.0]]])
def test_a_track_that_makes_no_sense_is_refused(track: list[list[float]]) -> None:
    with pytest.raises(ValueError, match="a track is"):
        flat().tube(track, Limits(60.0))
