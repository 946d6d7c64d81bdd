"""UTM and MGRS: bands, zones and places against PROJ's own UTM systems."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from pyproj import Transformer

from gcsplan.world.geodesy.grids import BAND_LETTERS, NotAPlace, band_deg, read_mgrs, read_utm, to_degrees, zone_deg


@pytest.mark.parametrize("south", [False, True])
def test_a_place_in_utm_is_where_projs_system_of_the_zone_has_it(south: bool) -> None:
    rng = np.random.default_rng(1)
    for zone in rng.integers(1, 61, 12).tolist():
        easting, northing = float(rng.uniform(2e5, 8e5)), float(rng.uniform(1.2e6, 9e6))
        proj = Transformer.from_crs(f"EPSG:{32700 if south else 32600}"[:-2] + f"{zone:02d}", "EPSG:4326")
        assert to_degrees(zone, easting, northing, south=south)[:2] == pytest.approx(proj.transform(easting, northing))


def test_bands_join_from_80_south_to_84_north() -> None:
    edges = [band_deg(letter) for letter in BAND_LETTERS]
    assert (edges[0][0], edges[-1]) == (-80.0, (72.0, 84.0))
    assert all(low[1] == high[0] for low, high in pairwise(edges))
    for letter in "ABIOYZ":
        with pytest.raises(NotAPlace):
            band_deg(letter)


def test_zones_join_around_the_earth_in_every_band_also_around_norway_and_svalbard() -> None:
    for letter in BAND_LETTERS:
        zones = [zone for zone in range(1, 61) if not (letter == "X" and zone in (32, 34, 36))]
        edges = [zone_deg(zone, letter) for zone in zones]
        assert (edges[0][0], edges[-1][1]) == (-180.0, 180.0)
        assert all(west[1] == east[0] for west, east in pairwise(edges))
    assert zone_deg(32, "V") == (3.0, 12.0)
    with pytest.raises(NotAPlace, match="no zone 32X"):
        zone_deg(32, "X")


def test_the_same_place_is_read_from_utm_and_from_mgrs() -> None:
    utm, mgrs = read_utm("32T 473123 5249321"), read_mgrs("32TMT7312349321")
    assert utm is not None
    assert mgrs is not None
    assert utm[:2] == pytest.approx(mgrs[:2], abs=1e-12)
    assert mgrs.note is None
    coarse = read_mgrs("32TMT7349")
    assert coarse is not None
    assert coarse.note is not None
    assert coarse.note.code == "place_is_a_square"


@pytest.mark.parametrize("text", ["47.4, 8.6", "47°23'N 8°20'E", "somewhere"])
def test_what_is_like_neither_is_left_to_others(text: str) -> None:
    assert read_utm(text.upper()) is None
    assert read_mgrs(text.upper()) is None
