"""Polygons and corridors in degrees, cut for the plane: by measured edges, and by places within a buffer."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod

from gcsplan.errors import InputError
from gcsplan.world.geodesy import degree_shapes
from gcsplan.world.geodesy.degree_shapes import near_corridors, near_polygons, plain_polygons
from gcsplan.world.geodesy.frame import Frame
from tests.support.effort import draws

FRAME = Frame(46.5, 8.0)
GEOD = Geod(ellps="WGS84")


@pytest.mark.nightly
@settings(max_examples=draws(400))
@given(st.integers(2, 40), st.floats(0.1, 5000.0), st.floats(1.0, 20_000.0), st.integers(0, 10**6), st.booleans())
def test_a_corridor_in_metres_holds_its_buffer_and_little_more(
    corners: int, buffer_m: float, step_m: float, seed: int, closed: bool
) -> None:
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(0.0, step_m, (corners, 2)), axis=0)
    if closed:
        points = np.concatenate([points, points[:1]])
    polygons = [shapely.Polygon(p.vertices) for p in near_corridors(points.tolist(), buffer_m, FRAME, local=True)]
    assert all(p.is_valid and shapely.is_ccw(p.exterior) for p in polygons)
    line = shapely.LineString(points)
    # Places at the buffer's very edge, and at what may be kept clear at most.
    for part, inside in ((0.999999, True), (1.06, False)):
        turn = rng.uniform(0.0, 2.0 * math.pi, 200)
        reach = part * buffer_m + (0.0 if inside else 0.2)
        along = shapely.get_coordinates(line.interpolate(rng.uniform(0.0, 1.0, 200), normalized=True))
        at = shapely.points(along + reach * np.stack([np.cos(turn), np.sin(turn)], axis=-1))
        held = np.any([shapely.contains(p, at) for p in polygons], axis=0)
        away = shapely.distance(line, at)
        assert held.all() if inside else not held[away >= reach * (1.0 - 1e-9)].any()


def test_a_corridor_in_degrees_holds_what_lies_on_the_ground_within_its_buffer() -> None:
    line = [(46.0, 6.6), (46.9, 8.3), (46.2, 9.4)]
    rng = np.random.default_rng(5)
    (polygon,) = (shapely.Polygon(p.vertices) for p in near_corridors(line, 300.0, FRAME))
    for begin, end in itertools.pairwise(line):
        part = rng.uniform(0.0, 1.0, 2000)[:, None]
        at = np.asarray(begin) + part * (np.asarray(end) - np.asarray(begin))  # straight in degrees
        lon, lat, _ = GEOD.fwd(at[:, 1], at[:, 0], rng.uniform(0, 360, 2000), np.full(2000, 299.999))
        east_north = FRAME.to_plane(lat, lon)
        assert shapely.contains_xy(polygon, east_north[:, 0], east_north[:, 1]).all()
    assert polygon.area < 1.05 * (GEOD.line_length(*zip(*[p[::-1] for p in line], strict=True)) * 600.0 + math.pi * 9e4)


def test_a_line_that_surrounds_a_place_leaves_it_free() -> None:
    turn = np.linspace(0.0, 2.0 * math.pi, 73)
    circle = np.stack([1000.0 * np.cos(turn), 1000.0 * np.sin(turn)], axis=-1)
    polygons = [shapely.Polygon(p.vertices) for p in near_corridors(circle.tolist(), 50.0, FRAME, local=True)]
    assert len(polygons) == 2
    assert not any(p.contains(shapely.Point(0.0, 0.0)) for p in polygons)
    wanted = math.pi * (1050.0**2 - 950.0**2)
    assert wanted < shapely.union_all(polygons).area < 1.06 * wanted


def test_a_line_across_a_country_is_cut_to_the_mission_s_world() -> None:
    line = [(30.0, -20.0), (46.5, 8.0), (60.0, 40.0)]
    (polygon,) = (shapely.Polygon(p.vertices) for p in near_corridors(line, 1000.0, FRAME))
    assert polygon.contains(shapely.Point(0.0, 0.0))
    assert max(abs(x) for x in polygon.bounds) < 400_000.0
    assert near_corridors([(46.5, 100.0), (46.5, 101.0)], 1000.0, FRAME) == []


@pytest.mark.parametrize("lon_deg", [179.99, -179.99])
def test_a_line_across_the_antimeridian_is_one_corridor(lon_deg: float) -> None:
    (corridor,) = near_corridors([(10.0, 179.98), (10.0, -179.98)], 100.0, Frame(10.0, lon_deg))
    area_m2 = shapely.Polygon(corridor.vertices).area
    assert area_m2 == pytest.approx(0.04 * 109_640 * 200 + math.pi * 100**2, rel=0.02)


@pytest.mark.draws
def test_the_cuts_are_those_of_edges_that_are_all_measured() -> None:
    rng = np.random.default_rng(3)
    for lat in (0.0, 47.0, -64.0, 80.0):
        frame = Frame(lat, 8.0)
        for scale in (0.003, 0.03, 0.3):
            ring = np.array([8.0, lat]) + rng.uniform(-2.5, 2.5, 2) + scale * rng.uniform(-1, 1, (40, 2))
            ring[:, 1] = np.clip(ring[:, 1], -84.0, 84.0)
            following = np.roll(ring, -1, axis=0)
            bow = frame.bow_m(ring[:, ::-1], following[:, ::-1])
            pieces = np.maximum(1, np.ceil(np.sqrt(bow / degree_shapes.EDGE_BOW_M))).astype(int)
            whole = [a + (b - a) * (np.arange(n) / n)[:, None] for a, b, n in zip(ring, following, pieces, strict=True)]
            assert np.array_equal(degree_shapes.cut_edges(ring, following, frame), np.concatenate(whole))


@pytest.mark.parametrize("great_circles", [False, True])
def test_polygons_projected_together_are_those_looked_at_one_by_one(great_circles: bool) -> None:
    rng = np.random.default_rng(5)
    rings = []
    for _ in range(300):  # small and large, near and far, either way around, in both conventions of longitudes
        lat, lon, size = rng.uniform(-84, 84), rng.uniform(-180, 180), 10.0 ** rng.uniform(-4, 1)
        lat, lon = (lat, lon) if rng.random() < 0.2 else (46.5 + rng.uniform(-3, 3), 8.0 + rng.uniform(-4, 4))
        turns = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 40)))[:: rng.choice([-1, 1])]
        lats, lons = lat + size * np.sin(turns), lon + size * np.cos(turns) + rng.choice([-360, 0, 360])
        rings.append([(float(a), float(o)) for a, o in zip(lats.clip(-90, 90), lons, strict=True)])
    found = plain_polygons(rings, FRAME, great_circles=great_circles)
    assert 40 < sum(one is not None for one in found) < 260
    for ring, one in zip(rings, found, strict=True):
        if one is not None:
            (alone,) = near_polygons(ring, FRAME, great_circles=great_circles)
            assert np.array_equal(one.vertices, alone.vertices)


def test_a_line_of_many_points_becomes_several_corridors_that_hold_all_of_it() -> None:
    along = np.linspace(0.0, 100_000.0, 5001)
    points = np.stack([along, 300.0 * np.sin(along / 500.0)], axis=-1)
    corridors = [shapely.Polygon(p.vertices) for p in near_corridors(points.tolist(), 50.0, FRAME, local=True)]
    assert 4 < len(corridors) < 12
    assert shapely.union_all(corridors).buffer(1e-6).contains(shapely.LineString(points).buffer(50.0))


def test_great_circles_of_one_zone_are_bounded() -> None:
    zigzag = [(44.0 + 0.01 * i, 0.0 if i % 2 else 120.0) for i in range(60)]
    with pytest.raises(InputError, match="too many long edges for great circles"):
        near_polygons(zigzag, FRAME, great_circles=True)


@pytest.mark.nightly
def test_long_edges_beside_each_other_are_counted_before_great_circles_are_joined() -> None:
    teeth = [(46.5 + 1e-6 * (k // 2 + 1), 8.0 + 0.5 * (-1) ** ((k + 1) // 2)) for k in range(400)]
    comb = [*teeth, (47.0, 8.7), (46.4, 8.7)]  # 0.1 m apart: each great circle crosses hundreds of straight edges
    assert shapely.Polygon(comb).is_valid
    with pytest.raises(InputError, match="its outline of 402 corners has so many long edges beside each other"):
        near_polygons(comb, FRAME, great_circles=True)


def test_edges_on_other_latitudes_need_no_great_circles() -> None:
    """They would be too many, and enclose the same of what is near."""
    zigzag = [(20.0 + 0.01 * i, 0.0 if i % 2 else 40.0) for i in range(60)]
    north = [(60.0, 0.0), (60.0, 41.0), (10.0, 41.0)]
    (near,) = near_polygons([*zigzag, *north], FRAME, great_circles=True)
    (straight,) = near_polygons([*zigzag, *north], FRAME)
    assert np.array_equal(near.vertices, straight.vertices)


@settings(max_examples=draws(300))
@given(*(st.floats(-89.0, 89.0) for _ in range(2)), st.floats(0.0, 179.0), st.floats(0.0, 1.0))
def test_the_latitudes_of_an_edge_are_those_of_the_line_and_the_great_circle(
    lat0: float, lat1: float, span: float, part: float
) -> None:
    low, high = degree_shapes.latitudes_between([(lat0, 170.0)], [(lat1, 170.0 + span)])
    a, b = (
        np.array([math.cos(math.radians(lat)) * math.cos(x), math.cos(math.radians(lat)) * math.sin(x),
                  math.sin(math.radians(lat))])
        for lat, x in ((lat0, 0.0), (lat1, math.radians(span)))
    )  # fmt: skip
    chord = (1.0 - part) * a + part * b  # its direction lies on the great circle
    on_circle = math.degrees(math.atan2(chord[2], math.hypot(chord[0], chord[1])))
    for lat in (lat0, lat1, on_circle, lat0 + part * (lat1 - lat0)):
        assert low[0] - 1e-6 <= lat <= high[0] + 1e-6


def test_edges_over_other_longitudes_need_no_great_circles() -> None:
    zigzag = [(44.0 + 0.01 * i, 60.0 if i % 2 else 120.0) for i in range(60)]  # too many, if they were near
    assert near_polygons([*zigzag, (52.0, 20.0), (49.0, 20.0)], FRAME, great_circles=True) == []
