"""Outlines with fewer corners hold the polygon, or lie in it, within the tolerance; too much work is known before."""

from __future__ import annotations

import math
import random
import time

import numpy as np
import pytest
import shapely

from gcsplan.arrays import Floats
from gcsplan.world.geodesy.degree_shapes import outline_of, rings_around
from gcsplan.world.geometry.outlines import MOST_CROSSINGS, MOST_EDGE_PAIRS, crossings, fewer_corners, overlapping_pairs
from tests.campaigns.large_inputs import smooth, spiky


def ring_of(kind: str, count: int, seed: int) -> Floats:
    return np.array((smooth if kind == "smooth" else spiky)(count, random.Random(seed)))


@pytest.mark.slow
@pytest.mark.nightly_but("False-0.5-spiky", "True-0.5-spiky", "True-0.5-smooth")
@pytest.mark.first_quick
@pytest.mark.parametrize("kind", ["smooth", "spiky"])
@pytest.mark.parametrize("tolerance_m", [0.5, 20.0])
@pytest.mark.parametrize("outward", [True, False])
def test_an_outline_with_fewer_corners_is_never_on_the_wrong_side(kind: str, tolerance_m: float, outward: bool) -> None:
    for seed in range(4):
        corners = ring_of(kind, 300, seed)
        found = fewer_corners(corners, tolerance_m, outward=outward)
        assert found is not None
        assert len(found) < len(corners)
        given, drawn = shapely.Polygon(corners), shapely.Polygon(found)
        large, small = (drawn, given) if outward else (given, drawn)
        assert small.difference(large).area < 1e-6
        added = large.difference(small)
        # Samples of what was added, or taken: inside as well as on its border.
        (west, south, east, north), rng = added.bounds, np.random.default_rng(seed)
        places = rng.uniform((west, south), (east, north), (200_000, 2))
        places = np.vstack([places[shapely.contains_xy(added, *places.T)], shapely.get_coordinates(added)])
        to = given if outward else given.exterior
        assert shapely.distance(to, shapely.points(places)).max() <= tolerance_m + 1e-6


@pytest.mark.slow
def test_a_long_smooth_outline_becomes_short() -> None:
    found = fewer_corners(ring_of("smooth", 90_000, 1), 0.5)
    assert found is not None
    assert len(found) < 300


def test_a_bay_whose_mouth_would_be_closed_gives_no_outline_that_crosses_itself() -> None:
    bay = np.array([[0, 0], [100, 0], [100, 49], [50, 49], [50, 20], [20, 20], [20, 80], [50, 80], [50, 51], [100, 51],
                    [100, 100], [0, 100]], float)  # fmt: skip
    for tolerance_m in (1.0, 10.0, 30.0, 60.0):
        found = fewer_corners(bay, tolerance_m)
        assert found is None or (
            shapely.Polygon(found).is_valid and shapely.Polygon(found).covers(shapely.Polygon(bay))
        )


@pytest.mark.slow
def test_crossings_are_counted_twice_and_only_so_far() -> None:
    bow_tie = np.array([[0, 0], [10, 10], [10, 0], [0, 10]], float)
    assert crossings(bow_tie) == 2
    assert crossings(ring_of("spiky", 500, 1)) == 0
    assert crossings(np.random.default_rng(1).uniform(0.0, 1.0, (90_000, 2))) > MOST_CROSSINGS


@pytest.mark.nightly
def test_an_outline_that_would_take_minutes_is_refused_at_once() -> None:
    begun = time.process_time()
    ring, why = outline_of([(n / 1e5, e / 1e5) for e, n in ring_of("spiky", 99_000, 1).tolist()])
    assert len(ring) == 99_000
    assert "99000 corners" in why
    assert time.process_time() - begun < 3.0  # 13 s in GEOS, twice
    assert overlapping_pairs(ring_of("smooth", 99_000, 1)) < MOST_EDGE_PAIRS


@pytest.mark.nightly
def test_the_corridor_of_a_tangled_line_holds_it_and_is_found_in_time() -> None:
    line = np.random.default_rng(1).uniform(0.0, 4000.0, (500, 2))
    begun = time.process_time()
    rings = rings_around(line, 50.0)
    assert time.process_time() - begun < 3.5  # 2.3 s on a slow machine that is busy; 4 s on a fast one before
    whole = shapely.union_all([shapely.Polygon(r) for r in rings])
    assert shapely.LineString(line).buffer(49.9).difference(whole).area < 1e-6
    assert all(math.isfinite(float(r.sum())) for r in rings)
