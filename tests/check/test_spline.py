"""The curve of a spline way point: its steepest places, in metres of the ellipsoid."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import Geod

from gcsplan.check.spline import _slopes, chords, towards

WGS84 = Geod(ellps="WGS84")
LOOKS = 200_000


@pytest.mark.parametrize("seed", range(40))
def test_no_place_of_a_curve_is_steeper_than_is_said(seed: int) -> None:
    """Held to a curve looked at in 200,000 places; curves that all but turn back peak within a thousandth of it."""
    rng = np.random.default_rng(seed)
    leaves, square, cube = rng.normal(0.0, [[30.0, 30.0, 10.0]] * 3)
    if seed % 2:  # all but stands still, seen from above, in one place
        t0, v = rng.uniform(0.2, 0.8), rng.normal(0.0, 30.0, 2)
        cube[:2] = v / 3.0
        square[:2] = -v * t0 + rng.normal(0.0, 0.5, 2)
        leaves[:2] = v * t0**2 + rng.normal(0.0, 0.5, 2)
    t = np.linspace(0.0, 1.0, LOOKS + 1)
    speed = leaves + 2.0 * square * t[:, None] + 3.0 * cube * t[:, None] ** 2
    slope = speed[:, 2] / np.hypot(speed[:, 0], speed[:, 1])
    pieces = 8
    for k, (up, down) in enumerate(_slopes(leaves, square, cube, pieces)):
        mine = slope[k * LOOKS // pieces : (k + 1) * LOOKS // pieces + 1]
        assert mine.max() <= up + 1e-9 * max(1.0, abs(up))
        assert mine.min() >= down - 1e-9 * max(1.0, abs(down))
    ups, downs = zip(*_slopes(leaves, square, cube, pieces), strict=True)
    assert max(ups) <= slope.max() + 1e-3 * abs(slope.max()) + 1e-3  # and nothing is made up
    assert min(downs) >= slope.min() - 1e-3 * abs(slope.min()) - 1e-3


@pytest.mark.parametrize("lat", [-60.0, -12.0, 0.0, 36.0, 70.0])
@pytest.mark.parametrize("bearing", [0.0, 50.0, 90.0])
def test_metres_of_a_curve_are_the_ellipsoids(lat: float, bearing: float) -> None:
    lon, north, _ = WGS84.fwd(20.0, lat, bearing, 100.0)
    start, end = (lat, 20.0, 0.0), (north, lon, 50.0)
    assert np.hypot(*towards(start, end)[:2]) == pytest.approx(100.0, rel=1e-6)
    straight = towards(start, end)
    places, bulge_m, slopes = chords(start, end, straight, straight)  # the curve is the straight line
    assert bulge_m == pytest.approx(0.0, abs=1e-9)
    assert all(s == pytest.approx((0.5, 0.5), rel=1e-6) for s in slopes)
    a, b = places[1], places[2]
    _, _, run_m = WGS84.inv(a[1], a[0], b[1], b[0])
    assert (b[2] - a[2]) / run_m == pytest.approx(0.5, rel=1e-5)
