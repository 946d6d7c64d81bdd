"""Conversion between degrees and metres, against geodesics and against the projection's own scale factors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pyproj import CRS, Geod, Proj, Transformer

from gcsplan.errors import InputError
from gcsplan.world.geodesy.datum import plane_to_raster
from gcsplan.world.geodesy.frame import FARTHEST_M, Frame, centre_of
from tests.support.effort import draws
from tests.support.planes import crs_of

WGS84 = Geod(ellps="WGS84")
HOME = Frame(36.6, -84.3)

latitudes = st.floats(-80.0, 80.0)
longitudes = st.floats(-180.0, 180.0)
azimuths = st.floats(0.0, 360.0)


def away(lat: float, lon: float, azimuth: float, distance_m: float) -> tuple[float, float]:
    """Latitude and longitude of the place at a distance (m) along a geodesic."""
    lon2, lat2, _ = WGS84.fwd(lon, lat, azimuth, distance_m)
    return float(lat2), float(lon2)


def test_the_origin_is_zero_and_north_and_east_are_positive() -> None:
    assert np.abs(HOME.to_plane(36.6, -84.3)).max() < 1e-9
    east, north = HOME.to_plane(36.6, -84.2)
    assert 8_900 < east < 9_000
    assert abs(north) < 10
    east, north = HOME.to_plane(36.7, -84.3)
    assert abs(east) < 1e-6
    assert 11_050 < north < 11_150
    lat, lon = HOME.to_degrees(-1000.0, -1000.0)
    assert lat < 36.6
    assert lon < -84.3


def test_at_sixty_degrees_a_degree_of_longitude_is_half_as_long() -> None:
    frame = Frame(60.0, 10.0)
    east, north = frame.to_plane(60.0, 10.5), frame.to_plane(60.5, 10.0)
    assert east[0] / north[1] == pytest.approx(0.5, rel=0.01)
    assert east[0] == pytest.approx(27_900.0, rel=0.001)


@settings(max_examples=draws(50))
@given(latitudes, longitudes, azimuths, st.floats(0.0, FARTHEST_M))
def test_both_round_trips_close_within_a_micrometre(lat: float, lon: float, azimuth: float, far_m: float) -> None:
    frame = Frame(lat, lon)
    place = away(lat, lon, azimuth, far_m)
    plane = frame.to_plane(*place)
    back = frame.to_degrees(*plane)
    assert WGS84.inv(place[1], place[0], back[1], back[0])[2] < 1e-6
    assert np.abs(frame.to_plane(*back) - plane).max() < 1e-6
    assert abs(back[1]) <= 180.0


@settings(max_examples=draws(50))
@given(latitudes, longitudes, azimuths, st.floats(1.0, FARTHEST_M))
def test_a_distance_in_the_plane_is_the_real_one_times_at_most_the_scale(
    lat: float, lon: float, azimuth: float, far_m: float
) -> None:
    frame = Frame(lat, lon)
    planar = float(np.linalg.norm(frame.to_plane(*away(lat, lon, azimuth, far_m))))
    # The straight line in the plane is no longer than the geodesic's image, and the scale is at least 1 everywhere.
    assert far_m * (1 - 1e-9) - 1e-7 <= planar <= far_m * frame.scale_at(far_m) + 1e-7


@settings(max_examples=draws(50))
@given(st.floats(-85.0, 85.0), longitudes, st.floats(100.0, FARTHEST_M))
def test_scale_at_is_the_largest_scale_of_the_projection_and_hardly_more(lat: float, lon: float, far_m: float) -> None:
    frame = Frame(lat, lon)
    factors = Proj(crs_of(frame)).get_factors(lon, lat)
    assert factors.meridional_scale == pytest.approx(1.0, abs=1e-9)
    scales = []
    for azimuth in range(0, 360, 30):
        at = frame.to_degrees(far_m * math.sin(math.radians(azimuth)), far_m * math.cos(math.radians(azimuth)))
        factors = Proj(crs_of(frame)).get_factors(float(at[1]), float(at[0]))
        scales += [factors.meridional_scale, factors.parallel_scale]
    assert max(scales) <= frame.scale_at(far_m) + 1e-10
    assert frame.scale_at(far_m) - 1.0 <= 1.03 * (max(scales) - 1.0) + 1e-9
    assert min(scales) >= 1.0 - 1e-9


def test_across_the_antimeridian_east_is_still_east() -> None:
    frame = Frame(52.0, 179.99)
    east, north = frame.to_plane(52.0, -179.99)
    assert east == pytest.approx(WGS84.inv(179.99, 52.0, -179.99, 52.0)[2], rel=1e-6)
    assert abs(north) < 1.0
    lat, lon = frame.to_degrees(east, north)
    assert (lat, lon) == (pytest.approx(52.0), pytest.approx(-179.99))


def test_arrays_keep_their_shape() -> None:
    lat = np.full((3, 4), 36.61)
    assert HOME.to_plane(lat, lat - 121).shape == (3, 4, 2)
    assert HOME.to_degrees(lat, lat).shape == (3, 4, 2)
    assert HOME.to_plane(36.6, -84.3).shape == (2,)


def test_what_is_no_place_or_too_far_is_never_a_place_nearby() -> None:
    for lat, lon in ((math.nan, 0.0), (0.0, math.inf), (-36.6, 95.7), (0.0, 5.7), (90.0, 0.0)):
        plane = HOME.to_plane(lat, lon)
        assert not (np.abs(plane) < 1e6).all()


@pytest.mark.parametrize(("lat", "lon"), [(85.1, 0.0), (-90.0, 0.0), (0.0, 180.1), (math.nan, 0.0), (0.0, math.nan)])
def test_an_origin_near_a_pole_or_none_at_all_is_refused(lat: float, lon: float) -> None:
    with pytest.raises(InputError, match="between 85° south and 85° north"):
        Frame(lat, lon)


# -- the bow ------------------------------------------------------------------------------------------------------


def sampled_bow(frame: Frame, a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """The greatest distance (m) of the two lines over 401 points: at equal fractions, and sideways."""
    t = np.linspace(0.0, 1.0, 401)
    span = (b[1] - a[1] + 180.0) % 360.0 - 180.0
    curved = frame.to_plane(a[0] + t * (b[0] - a[0]), a[1] + t * span)
    start, end = frame.to_plane(*a), frame.to_plane(*b)
    apart = curved - (start + t[:, None] * (end - start))
    along = (end - start) / np.linalg.norm(end - start)
    sideways = np.abs(apart[:, 0] * along[1] - apart[:, 1] * along[0])
    return float(np.linalg.norm(apart, axis=1).max()), float(sideways.max())


@settings(max_examples=draws(120))
@given(latitudes, longitudes, azimuths, st.floats(0.0, FARTHEST_M), azimuths, st.floats(10.0, 200_000.0))
@example(0.0, 0.0, 270.0, 100_000.0, 90.0, 200_000.0)  # 0 m in the middle, 1.7 m at the quarters
@example(0.0, 0.0, 0.0, 0.0, 0.0, 50_000.0)
def test_the_bow_bounds_the_distance_between_both_straight_lines_and_hardly_more(
    lat: float, lon: float, azimuth: float, far_m: float, course: float, length_m: float
) -> None:
    frame = Frame(lat, lon)
    a = away(lat, lon, azimuth, far_m)
    b = away(*a, course, length_m)
    if max(abs(a[0]), abs(b[0])) > 81.5:
        return
    apart, sideways = sampled_bow(frame, a, b)
    (bow,) = frame.bow_m([a], [b])
    assert sideways <= apart + 1e-12
    assert apart <= bow + 1e-7
    assert bow <= 1.021 * apart + 1e-7


def test_the_bow_is_that_of_every_leg_and_knows_the_antimeridian() -> None:
    frame = Frame(60.0, 180.0)
    start = [[60.0, 179.98], [60.0, -179.98], [60.0, 179.9], [60.0, 180.0]]
    end = [[60.0, -179.98], [60.0, 179.98], [60.0, 179.9], [60.1, -180.0]]
    bows = frame.bow_m(start, end)
    assert bows.shape == (4,)
    assert bows[0] == pytest.approx(bows[1])
    assert bows[0] == pytest.approx(1.02 * sampled_bow(frame, (60.0, 179.98), (60.0, -179.98))[0], rel=1e-3)
    assert bows[2] == 0.0
    assert bows[3] < 0.03  # along a meridian both lines are the same, but fractions differ a little


# -- the middle of a mission --------------------------------------------------------------------------------------


def test_the_centre_lies_in_the_middle_rounded_to_a_ten_thousandth() -> None:
    assert centre_of([36.6, 36.55, 36.57], [-84.38, -84.2, -84.38]) == (36.575, -84.29)
    assert centre_of([36.60004], [-84.30006]) == (36.6, -84.3001)


@pytest.mark.slow
@settings(max_examples=draws(200))
@given(latitudes, longitudes, st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), min_size=1, max_size=6))
def test_the_centre_is_near_all_points_even_across_the_antimeridian(
    lat: float, lon: float, offsets: list[tuple[float, float]]
) -> None:
    lats = [lat + dlat for dlat, _ in offsets]
    lons = [(lon + dlon + 180.0) % 360.0 - 180.0 for _, dlon in offsets]
    middle_lat, middle_lon = centre_of(lats, lons)
    assert abs(middle_lon) <= 180.0
    half_lat, half_lon = 0.5 * (max(lats) - min(lats)), 0.5 * (max(o for _, o in offsets) - min(o for _, o in offsets))
    for a, b in zip(lats, lons, strict=True):
        assert abs(a - middle_lat) <= half_lat + 1e-4
        assert abs((b - middle_lon + 180.0) % 360.0 - 180.0) <= half_lon + 1e-4
    assert abs(middle_lat) <= 85.0


@pytest.mark.parametrize(
    "origin", [(36.6, -84.3), (0.0, 0.0), (-84.9999, 179.9999), (12.345678901, -0.1), (70.0, -180.0)]
)
def test_the_plane_is_what_proj_makes_of_both_coordinate_systems_to_the_last_bit(origin: tuple[float, float]) -> None:
    frame, rng = Frame(*origin), np.random.default_rng(3)
    degrees = CRS.from_epsg(4326)
    forward = Transformer.from_crs(degrees, crs_of(frame), always_xy=True)
    back = Transformer.from_crs(crs_of(frame), degrees, always_xy=True)
    east, north = np.concatenate([rng.uniform(-2e5, 2e5, (200, 2)), [[0.0, 0.0], [1e9, 0.0], [math.nan, 0.0]]]).T
    lon, lat = back.transform(east, north)
    np.testing.assert_array_equal(frame.to_degrees(east, north), np.stack([lat, lon], axis=-1))
    lat, lon = np.append(lat, [95.0, 10.0, -90.0]), np.append(lon, [0.0, 720.0, 0.0])
    there = np.stack(forward.transform(lon, lat), axis=-1)
    np.testing.assert_array_equal(frame.to_plane(lat, lon), there)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("epsg", "origin"),
    [(4326, (36.6, -84.3)), (4269, (36.6, -84.3)), (4326, (10.0, 180.0)), (32616, (36.6, -84.3)), (27700, (52.0, -1.0)),
     (2056, (46.8, 8.2)), (2263, (40.7, -73.9))],
)  # fmt: skip
def test_a_rasters_coordinates_are_what_proj_makes_of_the_plane_itself(epsg: int, origin: tuple[float, float]) -> None:
    frame, horizontal = Frame(*origin), CRS.from_epsg(epsg)
    places = np.random.default_rng(3).uniform(-3e4, 3e4, (2, 200))
    way = plane_to_raster(frame, horizontal, (-3e4, -3e4, 3e4, 3e4), where="terrain.dem")
    several = Transformer.from_crs(crs_of(frame), horizontal, always_xy=True, allow_ballpark=False)
    several.transform(0.0, 0.0)
    one = several.get_last_used_operation()
    there = one.transform(*places)
    atol = 0.0 if horizontal.is_geographic else 2e-8  # metres, or feet, of 4e6
    np.testing.assert_allclose(way.to_raster(*places), there, rtol=0.0, atol=atol)
    back = np.stack(one.transform(*there, direction="INVERSE"), axis=-1)
    np.testing.assert_allclose(way.to_plane(*there), back, rtol=0.0, atol=2e-8)
    assert way.accuracy_m == one.accuracy
