"""The small parts behind zone files: text, JSON and archives, what another file is, and lists of complaints."""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.source import FIRST_BYTES, SUFFIXES_BY_KIND, what_else
from gcsplan.mission_file.values.errors import few, key_path, unknown_keys
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.contents import decoded, load_json, unpack
from gcsplan.mission_file.zones.csv import read_csv
from gcsplan.mission_file.zones.geojson import read_geojson
from gcsplan.mission_file.zones.kml import read_kml
from tests.mission_file.test_nothing_vanishes import POLYGON, SQUARE, ZONE, told
from tests.support import zone_files

HERE = Path("z.geojson")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_text_is_read_without_the_mark_of_its_encoding(encoding: str) -> None:
    assert decoded("Zürich".encode(encoding)) == "Zürich"


def test_text_in_another_encoding_is_no_text() -> None:
    with pytest.raises(UnicodeDecodeError):
        decoded("Zürich".encode("latin-1"))


def test_json_is_the_librarys_value_where_it_is_sound() -> None:
    value = {"a": [1, 2.5, None, True, "x"], "b": {"c": -1e-3}}
    assert load_json(HERE, json.dumps(value).encode()) == value
    assert load_json(HERE, b"1" * 301) == math.inf


@pytest.mark.parametrize(
    ("data", "words"),
    [(b'{"a": 1, "a": 2}', "'a' stands twice"), (b"NaN", "NaN is no number"),
     (b"[-Infinity]", "-Infinity is no number"), (b"[" * 100_000, "nested too deeply"),
     (b"<kml/>", "looks like KML"), (b"\xff", "not JSON")],
)  # fmt: skip
def test_json_that_two_readers_would_read_in_two_ways_is_refused(data: bytes, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_json(HERE, data)


def archive(**members: bytes) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(name.replace("__", "/").replace("_", "."), content)
    return data.getvalue()


def encrypted(data: bytes) -> bytes:
    """An archive whose first member says that it has a password."""
    flags = data.index(b"PK\x01\x02") + 8
    return data[:flags] + bytes([data[flags] | 1]) + data[flags + 1 :]


def test_of_an_archive_the_one_file_of_its_kind_and_those_beside_it_are_unpacked() -> None:
    data = archive(in__a_shp=b"1", in__a_dbf=b"2", in__b_dbf=b"3", readme_txt=b"4")
    assert unpack(Path("z.zip"), data, (".shp",), 100, (".dbf", ".prj")) == {".shp": b"1", ".dbf": b"2"}


@pytest.mark.parametrize(
    ("data", "words"),
    [(archive(a_kml=b"1", b_kml=b"2"), "must hold one .kml file, given a.kml, b.kml; unpack it"),
     (archive(a_txt=b"1"), "given a.txt"), (archive(), "given nothing"),
     (archive(a_kml=bytes(1000)), "unpacks to more than 100 bytes"), (archive(a_kml=b"1")[:-9], "not a sound zip"),
     (b"PK\x03\x04 and no more", "not a sound zip"),
     (encrypted(archive(a_kml=b"1")), "z.kmz: a.kml: is encrypted; unpack it with its password")],
    ids=["two", "another kind", "empty", "large", "cut off", "a beginning", "with a password"],
)  # fmt: skip
def test_an_archive_that_is_not_one_file_of_its_size_is_refused(data: bytes, words: str) -> None:
    with pytest.raises(InputError, match=words):
        unpack(Path("z.kmz"), data, (".kml",), 100)


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("z.csv", b"name,lat,lon,height_m,radius_m\nmast,36.6,-84.3,95,50\n"),
        ("z.geojson", b'{"type": "Feature", "properties": {"name": "mast", "radius_m": 50, "ceiling_agl_m": 95}, '
         b'"geometry": {"type": "Point", "coordinates": [-84.3, 36.6]}}'),
        ("z.kml", b"<kml><Placemark><name>mast</name><ExtendedData><Data name='radius_m'><value>50</value></Data>"
         b"<Data name='ceiling_agl_m'><value>95</value></Data></ExtendedData><Point><coordinates>-84.3,36.6"
         b"</coordinates></Point></Placemark></kml>"),
    ],
)  # fmt: skip
def test_a_mast_is_the_same_zone_in_each_format_and_alone_or_by_its_name(
    tmp_path: Path, name: str, data: bytes
) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    alone = {".csv": lambda: read_csv(path, data), ".kml": lambda: read_kml(path, data),
             ".geojson": lambda: read_geojson(path, load_json(path, data))}[path.suffix]()  # fmt: skip
    (zone,), (by_name,) = alone.zones, read_zones(path, where="m").zones
    for found in (zone, by_name):
        assert (found.name, str(found.floor or ""), str(found.ceiling)) == ("mast", "", "95 m AGL")
        assert (found.radius_m, found.points) == (50.0, ((36.6, -84.3),))
    assert alone.problems == []


# -- another file where a mission belongs


@pytest.mark.parametrize("kind", list(SUFFIXES_BY_KIND))
def test_a_file_of_another_kind_is_known_by_its_name_or_its_first_bytes(tmp_path: Path, kind: str) -> None:
    command = {
        "vehicles": "gcsplan check",
        "zones": "--list-zones",
        "terrain": "gcsplan new --dem",
        "log": "fit-energy",
    }
    for suffix in SUFFIXES_BY_KIND[kind]:
        (tmp_path / f"a b{suffix}").write_bytes(b"anything")
        told = what_else(tmp_path / f"a b{suffix}")
        assert command[kind] in told
        assert f"'{tmp_path / f'a b{suffix}'}'" in told  # as a shell takes it
    for begins in (begins for begins, of in FIRST_BYTES.items() if of == kind):
        for before in (b"", b"\xef\xbb\xbf")[: 2 if begins.isascii() and len(begins) < 8 else 1]:  # texts have a mark
            (tmp_path / "x.yaml").write_bytes(before + begins + b"...")
            assert command[kind] in what_else(tmp_path / "x.yaml")


def test_a_mission_file_and_one_that_is_not_there_are_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text("version: 1\n")
    assert what_else(tmp_path / "m.yaml") == what_else(tmp_path / "none.kml") == ""
    assert "--list-zones" in what_else(tmp_path / "m.yaml", {"type": "FeatureCollection", "features": []})
    assert what_else(tmp_path / "m.kml", {"version": 1}) == ""  # its content counts before its name


# -- complaints


def test_of_many_complaints_the_first_are_listed_and_the_rest_counted() -> None:
    problems = [Mistake(f"a[{k}]", "is wrong") for k in range(5)]
    assert few(problems, "a", 5) == problems
    assert few(problems, "a", 3) == [*problems[:3], Mistake("a", "has 2 more mistakes, which are not listed")]
    assert few(problems, "a", 5, count=100)[-1].message == "has 95 more mistakes, which are not listed"


def test_a_key_is_told_with_its_whole_path() -> None:
    assert key_path("m.yaml: vehicles[1]", ("speed_m_s", 0)) == "m.yaml: vehicles[1].speed_m_s[0]"
    assert key_path("m.yaml: ", ("limits", "x" * 100)) == f"m.yaml: limits.{'x' * 80}"


def test_an_unknown_key_is_told_with_the_nearest_known_one() -> None:
    (problem,) = unknown_keys(["min_agl_m", "min_alg"], ["min_agl_m", "max_agl_m"], "m: limits")
    assert problem.where == "m: limits.min_alg"
    assert "min_agl_m" in problem.message


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
