"""Large circles of published files against geodesics; arcs are tested with OpenAir, which has them."""

from __future__ import annotations

import numpy as np
import pyproj
import pytest
import shapely

from gcsplan.mission_file.published.arcs import Arc, ArcError

BEARINGS = np.linspace(0.0, 360.0, 7201)
ON_EARTH = pyproj.Geod(ellps="WGS84")


@pytest.mark.parametrize("lat", [0.0, 46.0, -22.5, 75.0])
@pytest.mark.parametrize("radius_m", [926.0, 111_120.0, 463_000.0, 1_000_000.0])
def test_a_circle_contains_what_lies_within_its_radius_and_little_more(lat: float, radius_m: float) -> None:
    ring = np.asarray(Arc.circle((lat, 17.5), radius_m).corners(outward=True))[:, ::-1]
    lon, at, _ = ON_EARTH.fwd(np.full(7201, 17.5), np.full(7201, lat), BEARINGS, np.full(7201, radius_m))
    assert shapely.contains_xy(shapely.Polygon(ring), lon, at).all()
    _, _, away = ON_EARTH.inv(np.full(len(ring), 17.5), np.full(len(ring), lat), *ring.T)
    assert away.max() <= radius_m * (1.001 if radius_m > 1e5 else 1.0) + 10.0


@pytest.mark.parametrize(
    ("lat", "radius_m"), [(80.5, 1_000_000.0), (0.0, 1_000_001.0), (0.0, 0.0), (0.0, float("inf"))]
)
def test_a_circle_without_an_outline_is_refused(lat: float, radius_m: float) -> None:
    with pytest.raises(ArcError):
        Arc.circle((lat, 17.5), radius_m)
