"""Zones from GeoJSON and KML: what is read, what is refused, and that nothing is skipped in silence."""

from __future__ import annotations

import copy
import json
import math
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError, Mistake
from gcsplan.mavlink.files.formats import read_mission_file
from gcsplan.mission_file import zone_reader
from gcsplan.mission_file.json_schema import mission_schema
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones import file as zone_file
from gcsplan.mission_file.zones.draft import (
    Bounds,
    ZoneDraft,
    circle,
    looks_swapped,
    place_zones,
    polygon,
    zones_sha256,
)
from gcsplan.mission_file.zones.file import ZoneFile
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.terrain.input_files import ZONE_FILES, ZONES_BY_NAME
from tests.support.attacks import draw_attacks, require_placed_words
from tests.support.effort import draws

FRAME = Frame(36.6, -84.3)
SQUARE = [[-84.31, 36.59], [-84.29, 36.59], [-84.29, 36.61], [-84.31, 36.61], [-84.31, 36.59]]
HOLE = [[-84.301, 36.599], [-84.299, 36.599], [-84.299, 36.601], [-84.301, 36.599]]


def feature(geometry: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def square(**properties: Any) -> dict[str, Any]:
    return feature({"type": "Polygon", "coordinates": [SQUARE]}, **properties)


def point(lon: float, lat: float, **properties: Any) -> dict[str, Any]:
    return feature({"type": "Point", "coordinates": [lon, lat]}, **properties)


def collection(*features: Any, **more: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features), **more}


def read(folder: Path, content: Any, name: str = "zones.geojson") -> ZoneFile:
    path = folder / name
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        path.write_text(content if isinstance(content, str) else json.dumps(content))
    return read_zones(path, where="m: no_fly[0].file")


def messages(folder: Path, content: Any, name: str = "zones.geojson") -> str:
    """Everything that is wrong with a file, whether it is refused whole or in parts."""
    try:
        return "\n".join(str(p) for p in read(folder, content, name).problems)
    except InputError as error:
        return str(error)


def placed(found: ZoneFile, frame: Frame = FRAME) -> list[Zone]:
    assert found.problems == []
    return [zone for _, zone in place_zones(found.zones, frame)[0]]


def area_m2(shape: Circle | Polygon) -> float:
    assert isinstance(shape, Polygon)
    return float(shapely.Polygon(shape.vertices).area)


# -- GeoJSON ------------------------------------------------------------------------------------------------------


def test_a_polygon_becomes_a_counter_clockwise_prism(tmp_path: Path) -> None:
    backwards = feature(
        {"type": "Polygon", "coordinates": [SQUARE[::-1]]}, name="b", floor_amsl_m=100, ceiling_agl_m=50
    )
    zones = placed(read(tmp_path, collection(square(name="a", floor_agl_m=0, ceiling_amsl_m=900.5), backwards)))
    assert [z.name for z in zones] == ["a", "b"]
    assert zones[0].floor is None
    assert zones[0].ceiling == Level(900.5, "amsl")
    assert (zones[1].floor, zones[1].ceiling) == (Level(100.0, "amsl"), Level(50.0, "agl"))
    lat_m, lon_m = 110_956.0, 89_518.0  # a degree at 36.6°, WGS84
    for zone in zones:
        assert isinstance(zone.shape, Polygon)
        assert shapely.is_ccw(shapely.LinearRing(zone.shape.vertices))
        assert area_m2(zone.shape) == pytest.approx(0.02 * lat_m * 0.02 * lon_m, rel=1e-3)


def test_a_point_with_a_radius_becomes_a_cylinder(tmp_path: Path) -> None:
    (zone,) = placed(read(tmp_path, collection(point(-84.29, 36.61, name="mast", radius_m=60, ceiling_agl_m=100))))
    east, north = FRAME.to_plane(36.61, -84.29)
    assert zone.shape == Circle(float(east), float(north), 60.0)


def test_a_multipolygon_becomes_several_zones_with_numbered_names(tmp_path: Path) -> None:
    shifted = [[x + 0.1, y] for x, y in SQUARE]
    two = feature({"type": "MultiPolygon", "coordinates": [[SQUARE], [shifted]]}, title="lakes")
    assert [z.name for z in placed(read(tmp_path, collection(two)))] == ["lakes/1", "lakes/2"]


def test_a_hole_counts_as_no_fly_and_is_told(tmp_path: Path) -> None:
    found = read(tmp_path, feature({"type": "Polygon", "coordinates": [SQUARE, HOLE]}))
    assert [note.code for note in found.notes] == ["holes_are_no_fly"]
    plain = read(tmp_path, square())
    assert area_m2(placed(found)[0].shape) == area_m2(placed(plain)[0].shape)
    assert plain.notes == ()


def test_a_bare_geometry_and_a_single_feature_are_read_too(tmp_path: Path) -> None:
    for content in (square(), square()["geometry"]):
        assert len(placed(read(tmp_path, content))) == 1


def test_altitudes_in_positions_are_not_bounds(tmp_path: Path) -> None:
    high = feature({"type": "Polygon", "coordinates": [[[x, y, 500.0] for x, y in SQUARE]]})
    (zone,) = placed(read(tmp_path, high))
    assert zone.floor is None
    assert zone.ceiling is None


def test_an_edge_that_is_straight_in_degrees_bows_in_the_plane(tmp_path: Path) -> None:
    ring = [[-85.0, 36.5], [-83.6, 36.5], [-83.6, 36.9], [-85.0, 36.9], [-85.0, 36.5]]
    (zone,) = placed(read(tmp_path, feature({"type": "Polygon", "coordinates": [ring]})))
    shape = zone.shape
    assert isinstance(shape, Polygon)
    outline = shapely.LinearRing(shape.vertices)
    lon = np.linspace(-85.0, -83.6, 5001)
    for lat in (36.5, 36.9):
        edge = FRAME.to_plane(np.full(5001, lat), lon)
        assert shapely.distance(shapely.points(edge), outline).max() < 0.06
    # Two corners alone would be hundreds of metres off.
    chord = shapely.LineString([FRAME.to_plane(36.5, -85.0), FRAME.to_plane(36.5, -83.6)])
    assert shapely.Point(FRAME.to_plane(36.5, -84.3)).distance(chord) > 100.0


def test_a_country_is_cut_to_the_world_of_the_mission(tmp_path: Path) -> None:
    ring = [[-120.0, 20.0], [-60.0, 25.0], [-62.0, 50.0], [-118.0, 48.0], [-120.0, 20.0]]
    found = read(tmp_path, feature({"type": "Polygon", "coordinates": [ring]}, name="land"))
    (zone,) = placed(found)
    assert isinstance(zone.shape, Polygon)
    assert np.isfinite(zone.shape.vertices).all()
    west, south, east, north = zone.bounds
    assert all(200e3 < abs(side) < 400e3 for side in (west, south, east, north))
    assert shapely.Polygon(zone.shape.vertices).contains(shapely.Point(0.0, 0.0))


def test_zones_of_another_continent_are_left_out_and_counted(tmp_path: Path) -> None:
    elsewhere = [[x + 40.0, y] for x, y in SQUARE]
    found = read(
        tmp_path,
        collection(square(), feature({"type": "Polygon", "coordinates": [elsewhere]}), point(10.0, 50.0, radius_m=900)),
    )
    zones, far = place_zones(found.zones, FRAME)
    assert len(zones) == 1
    assert len(far) == 2
    assert not any(looks_swapped(d, FRAME) for d in far)


@pytest.mark.parametrize("lon_deg", [179.999, -179.999])
def test_a_polygon_across_the_antimeridian_is_one_zone(tmp_path: Path, lon_deg: float) -> None:
    ring = [[179.99, 10.0], [-179.99, 10.0], [-179.99, 10.02], [179.99, 10.02], [179.99, 10.0]]
    (zone,) = placed(read(tmp_path, feature({"type": "Polygon", "coordinates": [ring]})), Frame(10.01, lon_deg))
    assert area_m2(zone.shape) == pytest.approx(0.02 * 109_640 * 0.02 * 110_611, rel=1e-2)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (collection(point(-84.3, 36.6)), "features[0]: a point needs a radius to be a zone: give each a radius_m"),
        (collection(point(-84.3, 36.6, radius_m="60")), "features[0].properties.radius_m: must be a number"),
        (collection(point(-84.3, 36.6, radius_m=True)), "must be a number"),
        (collection(point(-84.3, 36.6, radius_m=-1)), "radius_m: must be above 0"),
        (collection(point(36.6, -134.3, radius_m=9)), "look swapped"),
        (collection(square(floor_agl_m=5, floor_amsl_m=5)), "not both"),
        (collection(square(floor_agl_m=50, ceiling_agl_m=50)), "floor must be below the ceiling"),
        (collection(square(ceiling_agl_m=0)), "under ground"),
        (collection(square(floor_agl_m=-3)), "at least 0"),
        (collection(feature(None)), "no geometry"),
        (collection(feature({"type": "LineString", "coordinates": SQUARE})), "a line needs a corridor's half-width"),
        (collection(feature({"type": "LineString", "coordinates": SQUARE[:1]}, buffer_m=5)), "at least 2 different"),
        (collection(feature({"type": "LineString", "coordinates": SQUARE * 5000}, buffer_m=5)),
         "has 25000 points, more than 20000; simplify or split it"),
        (collection(feature({"type": "LineString", "coordinates": 5}, buffer_m=5)), "a line is a list of positions"),
        (collection(feature({"type": "LineString", "coordinates": SQUARE}, buffer_m=0)), "buffer_m: must be above 0"),
        (collection(feature({"type": "MultiPoint", "coordinates": []}, radius_m=5)), "the feature has no geometry"),
        (collection(feature({"type": "Circle"})), "must be a Polygon, a Point with radius_m or a LineString"),
        (collection(feature({"type": "Polygon", "coordinates": []})), "the feature has no geometry"),
        (collection(feature({"type": "Polygon", "coordinates": [SQUARE[:2]]})), "at least 3 different points"),
        (collection(feature({"type": "Polygon", "coordinates": [[[0, 0], [1, 1], [2, 2]]]})), "in order around it"),
        (collection(feature({"type": "Polygon", "coordinates": [[[0, 0], [1, 1], [1, 0], [0, 1]]]})),
         "crosses or touches itself at 0.500000, 0.500000"),
        (collection(feature({"type": "Polygon", "coordinates": [[[0, 0], [1, "x"], [1, 0]]]})), "[0][1]: a position"),
        (collection(feature({"type": "Polygon", "coordinates": [[[0, 0], [400, 1], [1, 0]]]})), "within ±360"),
        (collection(5), "must be a Feature"),
        (collection(), "not empty"),
        ([], "one object"),
        (collection(square(), crs={"properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}), "WGS84 degrees"),
        ('{"type": "Polygon", "type": "Point"}', "stands twice"),
        ('{"type": "Point", "coordinates": [NaN, 1]}', "NaN is no number"),
        ('{"type": "Point", "coordinates": [1e999, 1]}', "a position is"),
        ('{"type": "Point", "coordinates": [' + "9" * 5000 + ", 1]}", "a position is"),
        ("[" * 100_000, "nested too deeply"),
        ("{", "not JSON"),
        (b"\xff\xfe{", "not JSON"),
        ("", "not JSON"),
    ],
)  # fmt: skip
def test_bad_geojson_is_refused_with_its_place(tmp_path: Path, content: Any, words: str) -> None:
    assert words in messages(tmp_path, content)


def test_every_mistake_of_a_file_is_told_at_once(tmp_path: Path) -> None:
    found = read(tmp_path, collection(point(-84.3, 36.6), square(), square(ceiling_agl_m=-1), feature(None)))
    assert len(found.problems) == 3
    assert len(found.zones) == 1


@pytest.mark.parametrize("name", ["zones.dxf", "zones.doc", "zones"])
def test_other_formats_are_refused(tmp_path: Path, name: str) -> None:
    assert ".geojson, .json, .kml, .kmz, .csv" in messages(tmp_path, collection(square()), name)


def test_missing_and_oversized_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for path in (tmp_path / "none.geojson", tmp_path / "a\0b.geojson"):
        with pytest.raises(InputError) as caught:
            read_zones(path, where="m: no_fly[0].file")
        assert caught.value.where == "m: no_fly[0].file"
    monkeypatch.setattr(zone_reader, "MAX_ZONE_BYTES", 50)
    assert "more than 50" in messages(tmp_path, collection(square()))


def test_too_many_zones_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zone_file, "MAX_ZONES", 2)
    assert "more than 2 zones" in messages(tmp_path, collection(*[square()] * 3))


# -- KML ----------------------------------------------------------------------------------------------------------

KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"><Document><Folder>
  <Placemark><name>restricted</name>
    <ExtendedData><Data name="floor_agl_m"><value>0</value></Data>
      <Data name="ceiling_amsl_m"><value> 900 </value></Data></ExtendedData>
    <Polygon><altitudeMode>absolute</altitudeMode>
      <outerBoundaryIs><LinearRing><coordinates>
        -84.31,36.59,10 -84.29,36.59,10 -84.29,36.61,10 -84.31,36.61,10 -84.31,36.59,10
      </coordinates></LinearRing></outerBoundaryIs>
      <innerBoundaryIs><LinearRing><coordinates>
        -84.301,36.599 -84.299,36.599 -84.299,36.601 -84.301,36.599
      </coordinates></LinearRing></innerBoundaryIs>
    </Polygon></Placemark>
  <Placemark><name>mast</name>
    <ExtendedData><SchemaData schemaUrl="#s"><SimpleData name="radius_m">60</SimpleData></SchemaData></ExtendedData>
    <Point><coordinates>-84.29,36.61</coordinates></Point></Placemark>
</Folder></Document></kml>"""
BODY = "<kml><Placemark>{}</Placemark></kml>"
RING = "<outerBoundaryIs><LinearRing><coordinates>{}</coordinates></LinearRing></outerBoundaryIs>"
GOOD = RING.format("-84.31,36.59 -84.29,36.59 -84.29,36.61")


def test_kml_polygons_and_points_become_zones(tmp_path: Path) -> None:
    found = read(tmp_path, KML, "z.kml")
    prism, cylinder = placed(found)
    assert (prism.name, prism.floor, prism.ceiling) == ("restricted", None, Level(900.0, "amsl"))
    assert area_m2(prism.shape) == pytest.approx(0.02 * 110_956 * 0.02 * 89_518, rel=1e-3)
    assert isinstance(cylinder.shape, Circle)
    assert cylinder.shape.radius_m == 60.0
    assert [note.code for note in found.notes] == ["holes_are_no_fly"]


@pytest.mark.parametrize("head", ['<kml xmlns="http://earth.google.com/kml/2.1">', "<kml>", '<kml xmlns="urn:x">'])
def test_kml_namespaces_are_not_insisted_on(tmp_path: Path, head: str) -> None:
    text = head + f"<Placemark><Polygon>{GOOD}</Polygon></Placemark></kml>"
    assert len(placed(read(tmp_path, text, "z.kml"))) == 1


def test_a_multigeometry_becomes_several_zones(tmp_path: Path) -> None:
    both = f"<name>m</name><MultiGeometry><Polygon>{GOOD}</Polygon><Polygon>{GOOD}</Polygon></MultiGeometry>"
    assert [z.name for z in placed(read(tmp_path, BODY.format(both), "z.kml"))] == ["m/1", "m/2"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (BODY.format("<Point><coordinates>-84.3,36.6</coordinates></Point>"), "a point needs a radius"),
        (BODY.format("<name>way</name><LineString/>"), "Placemark 1 (way): has no coordinates"),
        (BODY.format(f"<MultiGeometry><Polygon>{GOOD}</Polygon><LinearRing/></MultiGeometry>"), "given LinearRing"),
        (BODY.format(""), "given none"),
        (BODY.format("<Polygon/>"), "one outerBoundaryIs"),
        (BODY.format(f"<Polygon>{RING.format('')}</Polygon>"), "no coordinates"),
        (BODY.format(f"<Polygon>{RING.format('1,2 3')}</Polygon>"), "lon,lat[,alt]"),
        (BODY.format(f"<Polygon>{RING.format('1,2 3,nan 4,5')}</Polygon>"), "lon,lat[,alt]"),
        (BODY.format(f"<Polygon>{RING.format('36.6,-134.3 36.7,-134.3 36.6,-134.2')}</Polygon>"), "look swapped"),
        (BODY.format(f"<Polygon>{RING.format('0,0 1,1 1,0 0,1')}</Polygon>"), "crosses or touches itself"),
        (BODY.format('<ExtendedData><Data name="radius_m"><value>6x</value></Data></ExtendedData><Point/>'),
         "radius_m: must be a number"),
        ("<kml><NetworkLink/><Placemark><Polygon>" + GOOD + "</Polygon></Placemark></kml>", "gcsplan follows no link"),
        ("<kml/>", "no Placemark"),
        ("<kml>", "not KML"),
        ("", "not KML"),
        (b"\xff\xff", "not KML"),
        ('<?xml version="1.0" encoding="klingon"?><kml/>', "not KML"),
        ('<!DOCTYPE k [<!ENTITY a "b">]><kml>&a;</kml>', "document type"),
        ("<a>" * 3000 + "</a>" * 3000, "levels deep"),
    ],
)  # fmt: skip
def test_bad_kml_is_refused_with_its_place(tmp_path: Path, content: Any, words: str) -> None:
    assert words in messages(tmp_path, content, "z.kml")


def test_an_entity_bomb_is_refused_at_once(tmp_path: Path) -> None:
    bomb = "<!DOCTYPE k [<!ENTITY a0 'xxxxxxxxxx'>" + "".join(
        f"<!ENTITY a{i} '{f'&a{i - 1};' * 10}'>" for i in range(1, 12)
    )
    assert "document type" in messages(tmp_path, bomb + "]><kml>&a11;</kml>", "z.kml")


# -- drafts -------------------------------------------------------------------------------------------------------


def test_touching_bounds_of_different_datums_are_left_to_the_ground() -> None:
    problems: list[Mistake] = []
    assert Bounds(floor_agl_m=100.0, ceiling_amsl_m=50.0).levels("z", problems) == (
        Level(100.0, "agl"),
        Level(50.0, "amsl"),
    )
    assert problems == []


def test_the_hash_follows_what_zones_say_and_not_how_they_are_laid_out(tmp_path: Path) -> None:
    def sha(content: str, name: str = "z.geojson") -> str:
        return zones_sha256(read(tmp_path, content, name).zones)

    whole = collection(square(name="a", ceiling_agl_m=50))
    assert sha(json.dumps(whole)) == sha(json.dumps(whole, indent=3))
    changed = copy.deepcopy(whole)
    changed["features"][0]["properties"]["ceiling_agl_m"] = 51
    assert sha(json.dumps(whole)) != sha(json.dumps(changed))


def test_a_local_polygon_stays_as_it_is() -> None:
    problems: list[Mistake] = []
    draft = polygon("p", "z", [(0.0, 0.0), (10.0, 0.0), (10.0, 5.0)], Bounds(), problems, local=True)
    assert draft is not None
    ((_, zone),), far = place_zones([draft], FRAME)
    assert isinstance(zone.shape, Polygon)
    assert zone.shape.vertices.tolist() == [[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]]
    assert far == []


def test_a_swapped_zone_is_told_from_a_far_one() -> None:
    problems: list[Mistake] = []
    swapped = circle("c", "z", (-84.3, 36.6), 100.0, Bounds(), problems)
    far = circle("c", "z", (50.0, 10.0), 100.0, Bounds(), problems)
    assert swapped is not None
    assert far is not None
    assert looks_swapped(swapped, FRAME)
    assert not looks_swapped(far, FRAME)


@settings(max_examples=draws(60))
@given(
    st.floats(-80, 80), st.floats(-180, 180), st.floats(0.001, 1.5), st.integers(3, 12), st.integers(0, 10**6),
    st.booleans(),
)  # fmt: skip
def test_any_star_of_degrees_is_the_same_star_in_the_plane(
    lat: float, lon: float, size: float, corners: int, seed: int, backwards: bool
) -> None:
    rng = np.random.default_rng(seed)
    turn = np.sort((np.arange(corners) + rng.uniform(0, 0.8, corners)) * 2 * math.pi / corners)
    reach = size * rng.uniform(0.4, 1.0, corners)
    star = [(lat + float(r * math.sin(t)), lon + float(r * math.cos(t))) for t, r in zip(turn, reach, strict=True)]
    wrapped = [(a, (b + 180.0) % 360.0 - 180.0) for a, b in star][:: -1 if backwards else 1]
    problems: list[Mistake] = []
    draft = polygon("s", "z", wrapped, Bounds(), problems)
    assert problems == []
    assert draft is not None
    frame = Frame(round(lat, 3), round((lon + 180.0) % 360.0 - 180.0, 3))
    ((_, zone),), _ = place_zones([draft], frame)
    assert isinstance(zone.shape, Polygon)
    plane = shapely.Polygon(zone.shape.vertices)
    assert shapely.is_ccw(plane.exterior)
    degrees = shapely.Polygon([(b, a) for a, b in star])
    probe = rng.uniform(-1.2 * size, 1.2 * size, (300, 2))
    east_north = frame.to_plane(lat + probe[:, 0], (lon + probe[:, 1] + 180.0) % 360.0 - 180.0)
    clear = shapely.distance(plane.exterior, shapely.points(east_north)) > 0.2
    here = shapely.contains_xy(plane, east_north[:, 0], east_north[:, 1])
    there = shapely.contains_xy(degrees, lon + probe[:, 1], lat + probe[:, 0])
    assert (here == there)[clear].all()


# -- hostile files ------------------------------------------------------------------------------------------------

JUNK = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**20), 10**20) | st.floats() | st.text(max_size=8)
    | st.sampled_from(["Polygon", "Point", "Feature", "FeatureCollection", "MultiPolygon", 36.6, -84.3, 1e308]),
    lambda inner: st.lists(inner, max_size=4)
    | st.dictionaries(
        st.sampled_from(["type", "coordinates", "geometry", "features", "properties", "radius_m", "floor_agl_m"]),
        inner, max_size=4,
    ),
    max_leaves=12,
)  # fmt: skip


def paths_into(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    found = [path] if path else []
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        found += paths_into(inner, (*path, key))
    return found


@pytest.mark.nightly
@pytest.mark.draws
def test_any_geojson_gives_zones_or_clear_problems(tmp_path: Path) -> None:
    assert draw_attacks(200, partial(spoilt_geojson, tmp_path / "z.geojson")) == {"zones", "problems"}


def spoilt_geojson(path: Path, data: st.DataObject) -> str:
    multi = feature({"type": "MultiPolygon", "coordinates": [[SQUARE, HOLE]]})
    whole: Any = copy.deepcopy(collection(square(name="a", ceiling_agl_m=50), point(-84.3, 36.6, radius_m=60), multi))
    for _ in range(data.draw(st.integers(1, 3))):
        if not (paths := paths_into(whole)):
            break
        *parents, last = data.draw(st.sampled_from(paths))
        at = whole
        for key in parents:
            at = at[key]
        if data.draw(st.booleans()):
            at[last] = data.draw(JUNK)
        else:
            del at[last]
    text = json.dumps(whole)
    if data.draw(st.booleans()):
        text = text[: data.draw(st.integers(0, len(text)))]
    return judged(path, text.encode())


@pytest.mark.slow
@pytest.mark.draws
def test_any_kml_gives_zones_or_clear_problems(tmp_path: Path) -> None:
    assert draw_attacks(200, partial(spoilt_kml, tmp_path / "z.kml")) == {"zones", "problems"}


def spoilt_kml(path: Path, data: st.DataObject) -> str:
    broken = bytearray(KML.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(broken) - 1))
        length = data.draw(st.integers(0, 30))
        junk = data.draw(
            st.sampled_from([b"", b"<", b"</Polygon>", b"<Point>", b",", b" ", b"1e999", b"\x00", b"&lt;", b"-"])
        )
        broken[at : at + length] = junk
    return judged(path, bytes(broken))


def judged(path: Path, content: bytes) -> str:
    """``zones`` that can be placed, or ``problems`` that say where: nothing else may come out."""
    path.write_bytes(content)
    try:
        found = read_zones(path, where="m")
    except InputError as error:
        require_placed_words(error)
        return "problems"
    assert all(p.where and p.message for p in found.problems)
    drafts: list[ZoneDraft] = found.zones
    for _, zone in place_zones(drafts, FRAME)[0]:
        assert all(math.isfinite(x) for x in zone.bounds)
        assert isinstance(zone.shape, Circle) or shapely.is_ccw(shapely.LinearRing(zone.shape.vertices))
    return "zones" if drafts else "problems"


@pytest.mark.slow
def test_every_ending_of_a_zone_file_is_read_and_named_wherever_it_is_given(tmp_path: Path) -> None:
    """One table decides; what the reference says and what a file in the wrong place is told follow it."""
    told = json.dumps(mission_schema()["$defs"]["ZoneKeys"]["properties"]["file"])
    for ending in ZONES_BY_NAME:
        assert ending in told
        file = tmp_path / f"zones{ending}"
        file.write_bytes(b"")
        with pytest.raises(InputError) as refused:
            read_zones(file, where="no_fly[0].file")
        assert "zones are read from" not in str(refused.value)
        with pytest.raises(InputError, match="zones are given with --zones"):
            read_mission_file(file, autopilot=None)
    with pytest.raises(InputError, match=", ".join(map(re.escape, ZONE_FILES))):
        read_zones(tmp_path / "zones.dwg", where="no_fly[0].file")
