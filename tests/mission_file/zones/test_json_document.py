"""What a JSON document says of itself: a part of the features, or another coordinate system, is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.mission_file.test_nothing_vanishes import POLYGON, SQUARE, ZONE, told
from tests.support import zone_files


def test_a_part_of_a_servers_features_is_refused(tmp_path: Path) -> None:
    whole = {"type": "FeatureCollection", "features": [ZONE]}
    assert "a part of the features alone" in told(tmp_path / "z.geojson", whole | {"exceededTransferLimit": True})
    said = told(tmp_path / "z.geojson", whole | {"numberMatched": 20, "numberReturned": 1})
    assert "the server sent 1 of 20 features" in said
    assert told(tmp_path / "z.geojson", whole | {"numberMatched": 1, "numberReturned": 1}) == ""


@pytest.mark.parametrize("make", [zone_files.geojson, zone_files.ed318, zone_files.openaip])
def test_a_servers_answer_is_looked_at_whatever_zones_it_has(tmp_path: Path, make: Callable[[Path, Any], Path]) -> None:
    file = make(tmp_path, [[SQUARE]])
    whole = json.loads(file.read_text(encoding="utf-8"))
    assert told(file, whole) == ""
    assert "a part of the features alone" in told(file, whole | {"exceededTransferLimit": True})
    other = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::4267"}}
    assert "this file says" in told(file, whole | {"crs": other})


@pytest.mark.parametrize(
    "name", ["urn:ogc:def:crs:EPSG::4267", "EPSG:43260", "EPSG:14326", "http://x/4326/epsg/4267/", "CRS84-like"]
)
@pytest.mark.parametrize("at", ["collection", "feature", "geometry", "geometries"])
def test_another_coordinate_system_is_refused_wherever_it_stands(tmp_path: Path, at: str, name: str) -> None:
    """On NAD27 a place lies up to 200 m away from where WGS 84 has the same numbers."""

    def document(crs: str) -> dict[str, Any]:
        own = {"crs": {"type": "name", "properties": {"name": crs}}}
        shape = POLYGON | (own if at == "geometry" else {})
        if at == "geometries":
            shape = {"type": "GeometryCollection", "geometries": [POLYGON | own]}
        one = ZONE | {"geometry": shape} | (own if at == "feature" else {})
        return {"type": "FeatureCollection", "features": [one]} | (own if at == "collection" else {})

    assert "GeoJSON is in WGS84 degrees (RFC 7946), this file says" in told(tmp_path / "z.geojson", document(name))
    for right in ("urn:ogc:def:crs:OGC:1.3:CRS84", "EPSG:4326", "http://www.opengis.net/def/crs/OGC/0/CRS84"):
        assert "WGS84 degrees" not in told(tmp_path / "z.geojson", document(right))


def test_a_refusal_names_the_format_that_the_document_has(tmp_path: Path) -> None:
    crs = {"crs": {"type": "name", "properties": {"name": "EPSG:4267"}}}
    volume = {"horizontalProjection": {"type": "Circle", "center": [8.0, 47.0], "radius": 100}}
    limits = {"lowerLimit": {"value": 0, "unit": 1, "referenceDatum": 0},
              "upperLimit": {"value": 900, "unit": 1, "referenceDatum": 1}}  # fmt: skip
    airspace = {"type": 1, "icaoClass": 8, "name": "a", "geometry": POLYGON} | limits
    documents = {
        "ED-269 is in": {"features": [{"identifier": "a", "geometry": [volume]}]},
        "openAIP's export is in": {"items": [airspace]},
        "GeoJSON is in": {"type": "FeatureCollection", "features": [ZONE | {"geometry": POLYGON}]},
    }
    for words, document in documents.items():
        assert words in told(tmp_path / "z.json", document | crs)
    assert "this is not JSON" in told(tmp_path / "z.json", "{")
