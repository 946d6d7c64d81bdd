"""Zones from KMZ, GeoPackage, Shapefile, FlatGeobuf and CSV: shapes by a second implementation, and what is refused."""

from __future__ import annotations

import io
import os
import shutil
import sqlite3
import struct
import sys
import zipfile
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from pyproj import CRS, Geod, Transformer

from gcsplan.errors import InputError
from gcsplan.mission_file import zone_reader
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import place_zones, zone_notes
from gcsplan.mission_file.zones.file import ZoneFile
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.effort import draws

FRAME = Frame(46.5, 8.0)
GEOD = Geod(ellps="WGS84")
SQUARE = shapely.Polygon([(7.95, 46.45), (8.05, 46.45), (8.05, 46.55), (7.95, 46.55)])
HOLED = shapely.Polygon(SQUARE.exterior, [[(7.99, 46.49), (8.01, 46.49), (8.0, 46.51)]])
LINE = shapely.LineString([(7.9, 46.4), (8.0, 46.45), (8.1, 46.6)])
KML = (
    "<kml><Placemark><name>a</name><Polygon><outerBoundaryIs><LinearRing><coordinates>"
    "7.95,46.45 8.05,46.45 8.05,46.55</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></kml>"
)


def write(
    file: Path, shapes: list[Any], crs: str | None = "EPSG:4326", *, layer: str | None = None, kind: str = "Unknown",
    append: bool = False, **columns: Any,
) -> Path:  # fmt: skip
    """Write shapes and columns by pyogrio."""
    pyogrio = pytest.importorskip("pyogrio")
    index = columns.pop("SPATIAL_INDEX", "")
    data = [np.array(c, dtype=object if isinstance(c[0], str) else None) for c in columns.values()]
    more = {} if layer is None else {"layer": layer}
    more |= {"SPATIAL_INDEX": index} if index else {}
    pyogrio.raw.write(
        file, shapely.to_wkb(np.array(shapes, dtype=object)), data, list(columns), geometry_type=kind, crs=crs,
        append=append, **more,
    )  # fmt: skip
    return file


def read(file: Path, **sizes: Any) -> ZoneFile:
    return read_zones(file, where="m: no_fly[0].file", **sizes)


def placed(found: ZoneFile, frame: Frame = FRAME) -> list[Zone]:
    assert found.problems == []
    return [zone for _, zone in place_zones(found.zones, frame)[0]]


def message(file: Path, **sizes: Any) -> str:
    """The one thing that is wrong with a file."""
    try:
        (problem,) = read(file, **sizes).problems
        return str(problem)
    except InputError as error:
        (problem,) = error.problems
        return str(problem)


def refused(file: Path) -> str:
    """Why a file is refused as a whole; an empty text if it is not."""
    try:
        read(file)
    except InputError as error:
        return str(error)
    return ""


def area_m2(shape: Circle | Polygon) -> float:
    assert isinstance(shape, Polygon)
    return float(shapely.Polygon(shape.vertices).area)


# -- GeoPackage, Shapefile, FlatGeobuf ---------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".gpkg", ".fgb", ".shp"])
@pytest.mark.parametrize(
    "crs", ["EPSG:32632", *(pytest.param(crs, marks=pytest.mark.slow) for crs in ("EPSG:4326", "EPSG:3035")),
            pytest.param("EPSG:4258", marks=pytest.mark.slow)]
)  # fmt: skip
def test_polygons_of_every_format_and_crs_are_those_of_a_second_implementation(
    tmp_path: Path, suffix: str, crs: str
) -> None:
    there = Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    corners = np.stack(there.transform(*SQUARE.exterior.coords.xy), axis=-1)
    square = shapely.Polygon(corners)
    file = write(
        tmp_path / f"z{suffix}", [square], crs, kind="Polygon", name=["reserve"], upper=["120 M AGL"], lower=["GND"]
    )
    found = read(file)
    (zone,) = placed(found)
    assert (zone.name, zone.floor, zone.ceiling) == ("reserve", None, Level(120.0, "agl"))
    # By shapely and pyproj alone: the outline in its own system, at every 10 m, must lie on the zone's.
    every = square.exterior.interpolate(np.linspace(0.0, 1.0, 4001), normalized=True)
    back = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    lon, lat = back.transform(*shapely.get_coordinates(every).T)
    assert isinstance(zone.shape, Polygon)
    outline = shapely.LinearRing(zone.shape.vertices)
    assert shapely.distance(outline, shapely.points(FRAME.to_plane(lat, lon))).max() < 0.15
    assert area_m2(zone.shape) == pytest.approx(abs(GEOD.polygon_area_perimeter(lon, lat)[0]), rel=1e-5)
    assert [(n.code, n.data["file"], n.data["crs"]) for n in found.notes] == (
        [] if crs == "EPSG:4326" else [("converted_to_wgs84", f"z{suffix}", CRS(crs).name)]
    )


def test_points_and_lines_take_the_sizes_of_the_file_or_of_the_mission(tmp_path: Path) -> None:
    shapes = [shapely.Point(8.0, 46.5), shapely.Point(8.02, 46.5), LINE, shapely.MultiPoint([(8.0, 46.6), (8.1, 46.6)])]
    file = write(
        tmp_path / "z.gpkg", shapes, name=["own", "mast", "wire", "two"], radius_m=[30.0, np.nan, np.nan, np.nan]
    )
    zones = placed(read(file, radius_m=60.0, buffer_m=40.0))
    assert [z.name for z in zones] == ["own", "mast", "wire", "two/1", "two/2"]
    assert [z.shape.radius_m for z in zones if isinstance(z.shape, Circle)] == [30.0, 60.0, 60.0, 60.0]
    length_m = GEOD.geometry_length(LINE)
    wanted = length_m * 80.0 + np.pi * 40.0**2
    assert wanted < area_m2(zones[2].shape) < 1.05 * wanted
    found = read(file)
    assert len(found.problems) == 2
    assert "a point needs a radius to be a zone, and so do 2 more: give each a radius_m" in found.problems[0].message
    assert "write buffer_m beside `file` in the mission" in found.problems[1].message


def test_holes_heights_and_collections_are_as_in_geojson(tmp_path: Path) -> None:
    high = shapely.force_3d(SQUARE, 500.0)
    both = shapely.GeometryCollection([HOLED, shapely.GeometryCollection([high])])
    found = read(write(tmp_path / "z.gpkg", [both], name=["a"]))
    zones = placed(found)
    assert [z.name for z in zones] == ["a/1", "a/2"]
    assert area_m2(zones[0].shape) == area_m2(zones[1].shape)
    assert [z.ceiling for z in zones] == [None, None]
    assert found.notes == (Note("holes_are_no_fly", file="z.gpkg", count=1),)
    (note,) = zone_notes([(draft, None) for draft in found.zones])
    assert str(note) == "z.gpkg: the altitudes of corners are not read as limits: a/2 (up to 500 m)"


@pytest.mark.nightly
def test_an_arc_is_drawn_so_finely_that_its_chords_are_the_arc(tmp_path: Path) -> None:
    file = write(tmp_path / "z.gpkg", [SQUARE], "EPSG:32632", SPATIAL_INDEX="NO")
    x, y, r = 500_000.0, 5_200_000.0, 40_000.0
    corners = [(x - r, y), (x, y + r), (x + r, y), (x, y - r), (x - r, y)]
    arcs = struct.pack("<BIIBII", 1, 10, 1, 1, 8, 5) + b"".join(struct.pack("<dd", *c) for c in corners)
    with sqlite3.connect(file) as base:  # a CurvePolygon of one CircularString, which pyogrio cannot write
        for (name,) in base.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            base.execute(f'DROP TRIGGER "{name}"')
        base.execute("UPDATE z SET geom = ?", (b"GP\0\x01" + struct.pack("<i", 32632) + arcs,))
    base.close()
    (zone,) = read(file).zones
    east, north = Transformer.from_crs(4326, 32632).transform(*np.array(zone.points).T)
    ring = shapely.LinearRing(np.stack([east, north], axis=-1))
    assert ring.distance(shapely.Point(x, y)) > r - 0.03


@pytest.mark.nightly
def test_every_layer_of_a_geopackage_is_read_unless_one_is_named(tmp_path: Path) -> None:
    file = write(tmp_path / "z.gpkg", [SQUARE], layer="zones", name=["a"])
    write(file, [shapely.Point(8.0, 46.5)], layer="masts", append=True, name=["b"], radius_m=[9.0])
    with sqlite3.connect(file) as base:  # a table without shapes, such as QGIS's styles
        base.execute("CREATE TABLE layer_styles (id INTEGER PRIMARY KEY, style TEXT)")
        base.execute("INSERT INTO gpkg_contents (table_name, data_type) VALUES ('layer_styles', 'attributes')")
    base.close()
    assert [z.name for z in placed(read(file))] == ["a", "b"]
    assert [z.name for z in placed(read(file, layer="masts"))] == ["b"]
    assert message(file, layer="mast").endswith("has no layer 'mast' with shapes; it has zones, masts")


def test_a_zipped_shapefile_is_read_and_a_part_that_is_missing_named(tmp_path: Path) -> None:
    file = write(tmp_path / "z.shp", [SQUARE], kind="Polygon", name=["a"])
    with zipfile.ZipFile(tmp_path / "z.zip", "w") as archive:
        for part in tmp_path.glob("z.*"):
            if part.suffix != ".zip":
                archive.write(part, f"folder/{part.name}")
        archive.writestr("folder/readme.txt", "none of ours")
    assert [z.name for z in placed(read(tmp_path / "z.zip"))] == ["a"]
    (tmp_path / "z.prj").rename(tmp_path / "z.PRJ")
    assert [z.name for z in placed(read(file))] == ["a"]
    (tmp_path / "z.PRJ").unlink()
    (tmp_path / "z.dbf").unlink()
    assert "z.dbf and z.prj must be beside it (.prj is its coordinate system)" in message(file)


@pytest.mark.parametrize("crs", [None, 'LOCAL_CS["Undefined Cartesian SRS"]', "EPSG:5703"])
def test_a_file_whose_place_on_earth_is_not_known_is_refused_with_the_cure(tmp_path: Path, crs: str | None) -> None:
    with pytest.warns() if crs is None else pytest.MonkeyPatch.context():
        file = write(tmp_path / "z.gpkg", [SQUARE], crs)
    assert "set the true one (in QGIS Layer > Set CRS, then export; or ogr2ogr -a_srs" in message(file)


def test_shapes_outside_their_own_crs_are_refused(tmp_path: Path) -> None:
    file = write(tmp_path / "z.gpkg", [shapely.Point(1e12, 1e12)], "EPSG:32632", name=["a"], radius_m=[9.0])
    assert "there is no known way from its coordinate system to WGS 84" in message(file)


def test_what_is_no_zone_is_refused_feature_by_feature(tmp_path: Path) -> None:
    shapes = [None, SQUARE, shapely.Point(400.0, 8.0), shapely.Polygon()]
    file = write(tmp_path / "z.gpkg", shapes, name=["a", "b", "c", "d"], radius_m=[5.0] * 4, top_m_agl=[50.0] * 4)
    found = read(file)
    assert [z.name for z in found.zones] == ["b"]
    assert sorted(p.message.split(";")[0] for p in found.problems) == [
        "longitude must be within ±360°, given 400: write 40", *["the feature has no geometry"] * 2,
    ]  # fmt: skip


def test_content_of_another_kind_never_reaches_gdal(tmp_path: Path) -> None:
    pytest.importorskip("pyogrio")
    other = tmp_path / "z.gpkg"
    other.write_text('<OGRVRTDataSource><OGRVRTLayer name="a"><SrcDataSource>/etc/hosts</SrcDataSource>')
    assert "this is not a .gpkg file; its content is of another kind" in message(other)


@pytest.mark.parametrize("suffix", [".gpkg", ".fgb", ".shp"])
def test_a_damaged_file_is_refused(tmp_path: Path, suffix: str) -> None:
    squares = [shapely.affinity.translate(SQUARE, 0.001 * i) for i in range(200)]
    file = write(tmp_path / f"z{suffix}", squares, kind="Polygon", name=[f"zone {i}" for i in range(200)])
    whole = file.read_bytes()
    for part in (0.3, 0.6, 0.97):
        file.write_bytes(whole[: int(part * len(whole))])
        assert refused(file) or read(file).problems


def test_a_geopackage_that_another_program_writes_is_refused(tmp_path: Path) -> None:
    file = write(tmp_path / "z.gpkg", [SQUARE])
    (tmp_path / "z.gpkg-wal").write_bytes(b"x")
    assert "close the program that has it open" in message(file)


def test_reading_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    file = write(tmp_path / "z.gpkg", [SQUARE])
    before = (sorted(os.listdir(tmp_path)), file.read_bytes())
    read(file)
    assert (sorted(os.listdir(tmp_path)), file.read_bytes()) == before
    assert os.listdir(tmp_path / "temporary") == []


def test_without_the_extra_the_message_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyogrio", None)
    (tmp_path / "z.gpkg").write_bytes(b"SQLite format 3\0")
    assert message(tmp_path / "z.gpkg") == (
        f"{tmp_path / 'z.gpkg'}: .gpkg files are read by pyogrio, which is not there: pip install 'gcsplan[gis]'"
    )


def test_files_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = write(tmp_path / "z.shp", [SQUARE] * 3, kind="Polygon", name=["a"] * 3)
    with zipfile.ZipFile(tmp_path / "z.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for part in (".shp", ".shx", ".dbf", ".prj"):
            archive.write(file.with_suffix(part), f"z{part}")
    monkeypatch.setattr(zone_reader, "MAX_ZONE_BYTES", file.stat().st_size + 10)
    assert "the files of this Shapefile are too large" in message(file)
    monkeypatch.setattr(zone_reader, "MAX_ZONE_BYTES", (tmp_path / "z.zip").stat().st_size)
    assert "unpacks to more than" in message(tmp_path / "z.zip")
    monkeypatch.setattr("gcsplan.mission_file.zones.vector.MAX_ZONES", 2)
    monkeypatch.setattr(zone_reader, "MAX_ZONE_BYTES", 10**6)
    assert "more than 2 zones" in message(file)


# -- KMZ ---------------------------------------------------------------------------------------------------------------


def kmz(file: Path, **members: str | bytes) -> Path:
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name.replace("__", "/").replace("_", ".").replace(".-", "._"), content)
    return file


def test_a_kmz_is_the_kml_in_it(tmp_path: Path) -> None:
    (tmp_path / "z.kml").write_text(KML)
    file = kmz(tmp_path / "z.kmz", doc_kml=KML, files__icon_png=b"\x89PNG", **{"mac__.-doc_kml": b"junk"})
    (inside,), (plain,) = placed(read(file)), placed(read(tmp_path / "z.kml"))
    assert area_m2(inside.shape) == area_m2(plain.shape)


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zone_reader, "MAX_ZONE_BYTES", 100_000)
    file = kmz(tmp_path / "z.kmz", doc_kml=b" " * 5_000_000)
    assert file.stat().st_size < 100_000
    assert "unpacks to more than 100000 bytes" in message(file)


def test_a_kmz_of_several_or_no_kml_is_refused(tmp_path: Path) -> None:
    assert "must hold one .kml file, given doc.kml, more.kml; unpack it" in message(
        kmz(tmp_path / "a.kmz", doc_kml=KML, more_kml=KML)
    )
    assert "must hold one .kml file, given a.txt" in message(kmz(tmp_path / "b.kmz", a_txt="x"))
    (tmp_path / "c.kmz").write_text(KML)
    assert "not a sound zip archive" in message(tmp_path / "c.kmz")


@pytest.mark.draws
def test_any_damaged_kmz_gives_zones_or_one_message(tmp_path: Path) -> None:
    whole = kmz(tmp_path / "z.kmz", doc_kml=KML * 1).read_bytes()
    rng = np.random.default_rng(3)
    for k in range(draws(300)):
        broken = bytearray(whole)
        broken[int(rng.integers(len(broken)))] ^= int(rng.integers(1, 256))
        (tmp_path / "z.kmz").write_bytes(bytes(broken if k % 2 else broken[: int(rng.integers(len(broken)))]))
        assert "z.kmz" in (refused(tmp_path / "z.kmz") or "z.kmz")


# -- CSV ---------------------------------------------------------------------------------------------------------------


def table(folder: Path, text: str | bytes) -> Path:
    file = folder / "masts.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def test_masts_become_circles_with_their_heights_as_ceilings(tmp_path: Path) -> None:
    file = table(
        tmp_path,
        "Name,Latitude,Longitude,Height (ft),radius [m],operator\r\n"
        'Üetli,46.5,8.0,300,60,"Swiss, com"\r\n'
        "\r\n"
        "b,46.51,8.01,,45.5,\r\n"
        '"c","46°31\'12""N","8°1\'E",12.5,9,x\r\n',
    )
    found = read(file)
    zones = placed(found)
    assert [(z.name, z.ceiling) for z in zones] == [
        ("Üetli", Level(91.44, "agl")), ("b", None), ("c", Level(3.81, "agl")),
    ]  # fmt: skip
    assert [z.shape.radius_m for z in zones if isinstance(z.shape, Circle)] == [60.0, 45.5, 9.0]
    for zone, (lat, lon) in zip(zones, [(46.5, 8.0), (46.51, 8.01), (46.52, 8.0 + 1 / 60)], strict=True):
        east, north = FRAME.to_plane(lat, lon)
        assert isinstance(zone.shape, Circle)
        assert (zone.shape.east_m, zone.shape.north_m) == pytest.approx((float(east), float(north)), abs=1e-6)
    (note,) = zone_notes([(draft, None) for draft in found.zones])
    assert "Üetli (Height (ft) '300': ceiling at 91.44 m AGL)" in str(note)


def test_tables_of_every_spelling_are_the_same(tmp_path: Path) -> None:
    texts = [
        "name,lat,lon,height_m,radius_m\nm,46.5,8.25,30,60\n",
        "\ufeffname;LAT;LON;Height_AGL_m;Radius_m\nm;46,5;8,25;30;60,0\n",
        "name\tlatitude_deg\tlng\tAGL m\tradius (m)\nm\t46.5\t8.25\t30\t60",
        "lon | lat | NAME | mast_height_m | radius_m\n8.25 | 46.5 | m | 30 | 60\n",
        'name,position,height,radius_m\nm,"46.5, 8.25",30 m AGL,60\n',
        "name,lat,lon,upper,radius_m\nm,46.5,8.25,30 m GND,60\n",
    ]
    seen = set()
    for text in texts:
        found = read(table(tmp_path, text))
        (zone,) = found.zones
        assert found.problems == []
        seen.add((zone.name, zone.points, zone.radius_m, None if "position" in text else zone.ceiling))
    assert seen == {
        ("m", ((46.5, 8.25),), 60.0, Level(30.0, "agl")), ("m", ((46.5, 8.25),), 60.0, None),
    }  # fmt: skip


def test_a_height_without_a_unit_limits_nothing_and_is_told(tmp_path: Path) -> None:
    found = read(table(tmp_path, "name,lat,lon,height,amsl\nm,46.5,8.0,30,700\n"), radius_m=50)
    assert [z.ceiling for z in found.zones] == [None]
    (note,) = zone_notes([(draft, None) for draft in found.zones])
    assert note.code == "zone_attributes_unread"
    assert "m (height '30'" in str(note)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name,lat,lon\nm,46.5,8.0\nn,46.5,8.1\n",
         "line 2: a point needs a radius to be a zone, and so do 1 more: give each a radius_m, or write radius_m "
         "beside `file` in the mission, for all of them; columns found: name, lat, lon"),
        ("name,x,y,radius_m\nm,8,46,9\n", "no column is called as a latitude and longitude is; the first line names "
         "the columns, such as name,lat,lon,height_m,radius_m; columns found: name, x, y, radius_m"),
        ("name,lat,radius_m\nm,8,9\n", "called as a longitude is"),
        ("46.5,8.0,60\n46.6,8.0,60\n", "columns found: 46.5, 8.0, 60"),
        ("lat,lon,latitude\n1,2,3\n", "which column is the place, lat, latitude?"),
        ("lat,lon,Lat\n1,2,3\n", "two columns are called 'lat'"),
        ("name,lat,lon,radius_m\nm,46,5,8,0,60\n", "has 6 cells, the first line 4: is there a comma within a number"),
        ("name,lat,lon,radius_m\nm,,8,60\n", "lat is empty; write the place, or remove the row"),
        ("name,lat,lon,radius_m\nm,8.0\n", "lon is empty"),
        ("name,lat,lon,radius_m\nm,146.5,8.0,60\n", "look swapped"),
        ("name,lat,lon,radius_m\nm,north,8.0,60\n", "line 2"),
        ("name,lat,lon,radius_m\nm,46.5,8.0,wide\n", "radius_m: must be a number, given 'wide'"),
        ("name;lat;lon;radius_m\nm;46.5;8.0;1,500\n", "radius_m: must be a number, given '1,500'"),
        ("name,lat,lon,radius_m,height_m\nm,46.5,8.0,60,tall\n", "'tall'"),
        ("name,lat,lon,radius_m\n", "holds no row"),
        ("", "holds no row"),
        (b"name,lat,lon\n\xe9,1,2\n", "save it as `CSV UTF-8`"),
        ("lat,lon,radius_m\n1,2,3\0\n", ""),
        ("lat,lon,radius_m\n1,2," + "9" * 200_000, ""),
    ],
)  # fmt: skip
def test_a_mistake_in_a_table_is_one_message_that_cures(tmp_path: Path, text: str | bytes, words: str) -> None:
    assert words in message(table(tmp_path, text))


@pytest.mark.draws
def test_any_table_gives_zones_or_problems(tmp_path: Path) -> None:
    rng = np.random.default_rng(9)
    pieces = [
        "lat",
        "lon",
        "radius_m",
        "height_m",
        ",",
        ";",
        "\n",
        '"',
        "46.5",
        "8.0",
        "1e999",
        "nan",
        "\t",
        "\u00e9",
        " ",
    ]
    for _ in range(draws(300)):
        text = "name,lat,lon,radius_m\n" + "".join(rng.choice(pieces, int(rng.integers(1, 40))))
        try:
            found = read(table(tmp_path, text), radius_m=5.0)
        except InputError:
            continue
        place_zones(found.zones, FRAME)
        assert all(p.where and p.message for p in found.problems)


def test_a_whole_mission_with_every_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The keys of the mission reach the readers, and the copy that GDAL reads is not named."""
    from gcsplan.mission_file.load import load_mission

    write(tmp_path / "wires.gpkg", [LINE], layer="wires", name=["wire"])
    kmz(tmp_path / "z.kmz", doc_kml=KML.replace("7.95", "7.8").replace("8.05", "7.82"))
    table(tmp_path, "name,lat,lon\nmast,46.52,8.0\n")
    mission = {
        "version": 1, "terrain": {"flat_m": 500}, "limits": {"min_agl_m": 50},
        "vehicles": [{"name": "a", "sysid": 1, "autopilot": "px4", "start": [46.5, 8.0], "goal": [46.5, 8.05]}],
        "no_fly": [
            {"file": "wires.gpkg", "layer": "wires", "buffer_m": 50}, {"file": "z.kmz"},
            {"file": "masts.csv", "radius_m": 80},
            {"name": "rail", "line": [[46.53, 8.0], "46.54, 8.1"], "buffer_m": 25},
        ],
    }  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert [z.name for z in load_mission(mission).zones] == ["wire", "a", "mast", "rail"]
    mission["no_fly"] = [{"file": "masts.csv", "buffer_m": 80}]
    with pytest.raises(InputError, match="a point needs a radius") as caught:
        load_mission(mission)
    assert len(caught.value.problems) == 1


def test_text_files_have_no_layers(tmp_path: Path) -> None:
    assert "a .csv file has no layers; leave `layer` out" in message(table(tmp_path, "lat,lon\n1,2\n"), layer="x")


def test_names_of_archives_lead_nowhere(tmp_path: Path) -> None:
    """A member whose name climbs out of the archive is read as any other, and writes nothing outside."""
    write(tmp_path / "z.fgb", [SQUARE])
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.write(tmp_path / "z.fgb", "../../evil.fgb")
    shutil.rmtree(tmp_path)
    tmp_path.mkdir()
    (tmp_path / "z.zip").write_bytes(buffer.getvalue())
    assert len(placed(read(tmp_path / "z.zip"))) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["z.zip"]


@pytest.mark.parametrize("name", ["./doc.kml", "a//doc.kml", "a/./doc.kml", "/doc.kml", "a/../doc.kml"])
def test_a_kmz_member_goes_by_its_own_name(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(tmp_path / "z.kmz", "w") as archive:
        archive.writestr(name, KML)
        archive.writestr("folder.kml/", "")
    assert len(placed(read(tmp_path / "z.kmz"))) == 1


def test_a_kmz_of_a_folder_alone_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "z.kmz", "w") as archive:
        archive.writestr("doc.kml/", "")
    assert "must hold one .kml file" in message(tmp_path / "z.kmz")


@pytest.mark.parametrize("corners", [2, 3])
def test_a_ring_that_is_not_closed_is_refused(tmp_path: Path, corners: int) -> None:
    """GDAL gives out such rings of a GeoPackage as they are; GEOS cannot hold them."""
    file = write(tmp_path / "z.gpkg", [shapely.box(8.0, 46.5, 8.1, 46.6)], kind="Polygon", name=["z"])
    places = [(8.0, 46.5), (8.1, 46.5), (8.1, 46.6)][:corners]
    ring = struct.pack("<BIII", 1, 3, 1, corners) + b"".join(struct.pack("<dd", *p) for p in places)
    with closing(sqlite3.connect(file)) as database, database:
        for (trigger,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            database.execute(f'DROP TRIGGER "{trigger}"')  # they call functions that GDAL alone has
        database.execute("UPDATE z SET geom = ?", (b"GP\0\x01" + struct.pack("<i", 4326) + ring,))
    with pytest.raises(InputError, match=r"z\.gpkg: z: a geometry cannot be read \(.*\); repair it"):
        read(file)
