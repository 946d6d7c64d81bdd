"""Shapes in other programs' coordinate systems: against pyproj point by point, and what cannot be converted."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import Transformer

from gcsplan.errors import InputError
from gcsplan.world.geodesy.reprojection import ToDegrees

UTM = "EPSG:32617"
MIDDLE = (300_000.0, 4_000_000.0)


def converted(crs: str = UTM, middle: tuple[float, float] = MIDDLE) -> ToDegrees:
    return ToDegrees(crs, middle, where="zones.shp")


def test_degrees_on_wgs_84_stay_as_they_are_without_a_note() -> None:
    same = converted("EPSG:4326", (10.0, 50.0))
    xy = np.array([[10.0, 50.0], [11.0, 51.0]])
    assert same.note is None
    assert same.name == "WGS 84"
    assert same.points(xy).tolist() == [[50.0, 10.0], [51.0, 11.0]]
    assert same.line(xy, 100).tolist() == [[50.0, 10.0], [51.0, 11.0]]


def test_points_are_where_pyproj_puts_them_and_a_note_says_so() -> None:
    there = converted()
    xy = np.array(MIDDLE) + np.random.default_rng(1).uniform(-5e4, 5e4, (20, 2))
    lon, lat = Transformer.from_crs(UTM, "EPSG:4326", always_xy=True).transform(*xy.T)
    np.testing.assert_allclose(there.points(xy), np.stack([lat, lon], axis=-1), atol=1e-9)
    assert there.note is not None
    assert there.note.code.startswith("converted_to_wgs84")


def test_long_edges_are_cut_until_they_are_straight_in_degrees() -> None:
    there = converted()
    xy = np.array([[200_000.0, 4_000_000.0], [400_000.0, 4_100_000.0]])
    line = there.line(xy, 10_000)
    assert len(line) > 3
    back = Transformer.from_crs("EPSG:4326", UTM, always_xy=True)
    middle = 0.5 * (line[1:] + line[:-1])
    x, y = back.transform(middle[:, 1], middle[:, 0])
    step = (xy[1] - xy[0]) / np.hypot(*(xy[1] - xy[0]))
    off = (x - xy[0, 0]) * -step[1] + (y - xy[0, 1]) * step[0]
    assert np.abs(off).max() < 0.1


def test_edges_that_need_too_many_points_are_refused() -> None:
    xy = np.array([[200_000.0, 4_000_000.0], [400_000.0, 4_100_000.0]])
    with pytest.raises(InputError, match="too long to be straight in degrees"):
        converted().line(xy, 0)


def test_an_edge_of_half_a_turn_is_refused_unless_any_width_will_do() -> None:
    mercator = converted("EPSG:3857", (0.0, 0.0))
    xy = np.array([[-1.01e7, 0.0], [1.0e7, 0.0]])
    with pytest.raises(InputError, match="either side of the globe"):
        mercator.line(xy, 10**6)
    line = mercator.line(xy, 10**6, any_width=True)
    assert abs(line[-1, 1] - line[0, 1]) > 178.0


@pytest.mark.parametrize(
    ("crs", "said"),
    [
        ('LOCAL_CS["unknown",UNIT["metre",1]]', "whose place on Earth is not known"),
        ("no such system", "no known way"),
    ],
)
def test_a_system_without_a_known_place_is_refused(crs: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        converted(crs)


def test_places_where_the_system_is_not_defined_are_refused() -> None:
    with pytest.raises(InputError, match="is not defined"):
        converted().points(np.array([[1e30, 0.0]]))
