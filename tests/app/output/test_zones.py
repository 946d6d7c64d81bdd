"""What was understood of each zone, before anything is planned."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gcsplan.app.output.zones import list_zones
from gcsplan.errors import InputError
from tests.support.batches import mission

DISC = {"name": "disc", "center": [47.0, 8.01], "radius_m": 50, "ceiling_agl_m": 100}


def geojson(tmp_path: Path, *features: object) -> Path:
    file = tmp_path / "zones.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": list(features)}))
    return file


def feature(kind: str, coordinates: object, **properties: object) -> dict[str, object]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}


def test_zones_of_missions_and_files_are_listed_with_shape_size_and_levels(tmp_path: Path) -> None:
    own = tmp_path / "m.yaml"
    own.write_text(mission(no_fly=[DISC]))
    ring = [[8.0, 47.0], [8.01, 47.0], [8.01, 47.01], [8.0, 47.0]]
    line = feature("LineString", [[8.0, 47.0], [8.0, 47.01]], name="line", buffer_m=20)
    file = geojson(tmp_path, feature("Polygon", [ring], name="field"), line)
    zones, notes = list_zones([own, file])
    assert [(z.name, z.shape) for z in zones] == [("disc", "circle"), ("field", "polygon"), ("line", "corridor")]
    disc, field, corridor = zones
    assert disc.extent_m == pytest.approx((100.0, 100.0))
    assert disc.as_dict()["radius_m"] == 50.0
    assert field.extent_m == pytest.approx((760.0, 1112.0), rel=0.01)
    assert field.corners == 3
    assert corridor.length_m == pytest.approx(1112.0, rel=0.01)
    assert corridor.extent_m == pytest.approx((40.0, 1152.0), rel=0.01)
    assert notes == []


def test_what_is_wrong_with_a_file_is_told_with_its_place(tmp_path: Path) -> None:
    file = geojson(tmp_path, feature("Point", [8.0, 47.0], name="mast"))
    with pytest.raises(InputError, match=r"features\[0\]: a point needs a radius"):
        list_zones([file])


def test_hours_that_are_none_are_refused_by_their_option(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'sometimes' is no time"):
        list_zones([], at="sometimes")
