"""Hostile inputs for `tests.campaigns.files`: clean files, and random corruptions of them.

Every kind writes its files into the current folder and returns the arguments of ``gcsplan check``; the same random
numbers give the same files. `write_clean` writes the clean files once.
"""

from __future__ import annotations

import copy
import functools
import json
import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import yaml
from rasterio.transform import Affine

from gcsplan.mavlink.files.formats import read_mission_file, write_plan
from gcsplan.vehicle import Autopilot
from tests.cli.test_hostile import MISSION, ROWS
from tests.support import corpus
from tests.support.spoil import ODD, places, spoilt_bytes, spoilt_tree

RICH = """
version: 1
name: "rich"
terrain: {dem: [clean/west.asc, clean/east.tif], vertical_datum: EGM96, crs: "EPSG:4326", obstacle_height_m: 2}
limits: {min_agl_m: 30, max_agl_m: 400, max_amsl_m: 1200, horizontal_clearance_m: 10, track_error_m: 2,
  altitude_error_m: 2, max_climb_deg: 20, max_descent_deg: 25}
no_fly:
  - {name: mast, center: [36.598, -84.367], radius_m: 150, ceiling_agl_m: 200}
  - {name: field, polygon: [[36.61, -84.37], [36.62, -84.37], [36.62, -84.36]], floor_amsl_m: 450}
  - {file: clean/zones.geojson}
  - {file: clean/zones.kml}
vehicles:
  - {name: uav1, sysid: 1, autopilot: arducopter, start: [36.6, -84.38], goal: [36.6, -84.37], via: [[36.604, -84.375],
      [36.605, -84.374, 60]], takeoff_agl_m: 40, approach_agl_m: 40, end: rtl, rtl_rel_home_m: 90, speed_m_s: [3, 15],
      climb_m_s: 2.5, descent_m_s: 1.5, energy: {vertical_j_per_m: 120, horizontal_j_per_m: 100, hover_w: 400,
      battery_j: 5.0e6, reserve: 0.2}, link: "udpout:127.0.0.1:14560"}
  - {name: uav2, sysid: 2, autopilot: arduplane, start: [36.601, -84.381], goal: [36.602, -84.372], turn_radius_m: 60,
      takeoff_heading_deg: 90, speed_m_s: [14, 22], limits: {min_agl_m: 40}}
arrival: {mode: sequence, order: [uav1, uav2], interval_s: 9, separation_m: 30, hold: ground}
planner: {name: optimal, objective: length, seed: 1, gap_percent: 0.1, budget_s: 10}
altitude_frame: relative
"""
LOCAL = """
version: 1
frame: {origin: [36.6, -84.38], amsl_m: 0}
terrain: {peaks: [{center: [500, 50], height_m: 70, decay_m: [20, 20]},
    {center: [300, -80], height_m: 40, decay_m: [9, 30]}]}
limits: {min_agl_m: 5}
no_fly:
  - {name: a, center: {east_m: 200, north_m: 10}, radius_m: 20, floor_agl_m: 10}
vehicles:
  - {name: uav1, sysid: 1, autopilot: px4, start: {east_m: 0, north_m: 0, up_m: 10}, goal: {east_m: 890, north_m: 0,
      up_m: 20}, end: none}
"""
KML = (
    "<kml><Document><Placemark><name>a</name><ExtendedData><Data name='radius_m'><value>90</value></Data>"
    "</ExtendedData><Point><coordinates>-84.37,36.62</coordinates></Point></Placemark><Placemark><name>b</name>"
    "<ExtendedData><SchemaData><SimpleData name='ceiling_agl_m'>90</SimpleData></SchemaData></ExtendedData>"
    "<MultiGeometry><Polygon><outerBoundaryIs><LinearRing><coordinates>-84.37,36.62,0 -84.36,36.62,0 -84.36,36.63,0 "
    "-84.37,36.62,0</coordinates></LinearRing></outerBoundaryIs></Polygon></MultiGeometry></Placemark></Document></kml>"
)
YAML_WORDS = (
    b"&a ", b"*a", b"<<: ", b"!!python/object:os.system ", b"!!binary ", b"!<x> ", b": ", b"- ", b"{", b"}", b"[",
    b"? ", b".nan", b"-.inf", b"1e999", b"0x", b"0o9", b"1_000", b"12:30", b"\t", b"\xff", b"\xef\xbb\xbf", b"\x85",
    b"|\n", b">-\n", b"---\n", b"...\n", b"%YAML 9.9\n", b"#", b"'", b'"', b"\\x", b"\xe2\x80\xa8", b"no", b"~", b"",
)  # fmt: skip
NUMBERS = (
    b"nan", b"-inf", b"1e39", b"-1e308", b"1e-400", b"0", b"-0", b"-1", b"177", b"82", b"22", b"20", b"16", b"201",
    b"65535", b"65536", b"2147483648", b"9" * 400, b"0x10", b"1,5", b"\t", b"\n", b"\r", b" ", b"", b"\x00", b"#",
    b"90", b"181", b"36.6", b"-84.37", b"QGC WPL 110\n",
)  # fmt: skip
XML_WORDS = (
    b"<!DOCTYPE a [<!ENTITY x 'y'>]>", b"&x;", b"&#0;", b"&#xD800;", b"<Polygon>", b"</Polygon>", b"<Placemark>",
    b"nan", b"1e400", b"91,181", b",", b"<![CDATA[", b"]]>", b"\x00", b"<?xml version='1.0' encoding='utf-7'?>",
    b"<!--", b"-->", b"<a xmlns='b'>", b"<NetworkLink/>", b"<innerBoundaryIs>", b" ", b"\xff\xfe", b"<LinearRing>",
    b"36.62,-84.37",
)  # fmt: skip
ASC_WORDS = (
    b"ncols 2147483647", b"nrows 99999999", b"nrows 2147483647", b"ncols 0", b"nrows -1", b"-1", b"nan", b"inf",
    b"1e400", b"cellsize 0", b"cellsize 1e-300", b"cellsize -1", b"dx 1", b"xllcenter 7", b"NODATA_value nan",
    b"\x00", b"\n", b" ", b"1e39", b"-32768", b"9" * 300,
)  # fmt: skip
SYSTEMS = (
    "EPSG:4269", "EPSG:4979", "EPSG:32616", "EPSG:32656", "EPSG:3857", "EPSG:3413", "EPSG:3031", "EPSG:5070",
    "EPSG:27700", "EPSG:2193", "EPSG:4326+5773", "+proj=gnom +lat_0=-36 +lon_0=95", "+proj=longlat +pm=paris",
    "+proj=ortho +lat_0=36 +lon_0=-84", "+proj=tmerc +lat_0=0 +lon_0=5.62",
)  # fmt: skip
"""Coordinate systems that are wrong for the grids; some do not cover this place."""
HEADER = b"ncols 60\nnrows 60\nxllcorner -84.41\nyllcorner 36.57\ncellsize 0.001\nNODATA_value -9999\n"


def write_clean() -> None:
    """Write the clean files that all inputs start from into ``clean/``, and move the corpus to this place."""
    corpus.LAT, corpus.LON = 36.6, -84.38
    clean = Path("clean")
    clean.mkdir(exist_ok=True)
    rows = "\n".join(" ".join(str(400 + (i * j) % 7) for j in range(60)) for i in range(60))
    (clean / "west.asc").write_bytes(HEADER + rows.encode())
    heights = np.full((60, 60), 401.0, np.float32)
    with rasterio.open(
        clean / "east.tif", "w", driver="GTiff", width=60, height=60, count=1, dtype="float32", crs="EPSG:4326",
        transform=Affine(0.001, 0, -84.351, 0, -0.001, 36.63), compress="deflate",
    ) as raster:  # fmt: skip
        raster.write(heights, 1)
    (clean / "zones.geojson").write_text(json.dumps(geojson()))
    (clean / "zones.kml").write_text(KML)
    (clean / "uav1.waypoints").write_text("\n".join(ROWS) + "\n")
    (clean / "m.yaml").write_text(MISSION)
    (clean / "rich.yaml").write_text(RICH)


def geojson() -> dict[str, Any]:
    """A GeoJSON document with zones of each kind."""
    ring = [[-84.37, 36.62], [-84.36, 36.62], [-84.36, 36.63], [-84.37, 36.62]]
    zone = {"type": "Feature", "properties": {"name": "a", "ceiling_agl_m": 90}}
    point = {
        "type": "Feature", "properties": {"radius_m": 90, "floor_amsl_m": 10.5},
        "geometry": {"type": "Point", "coordinates": [-84.37, 36.6, 400.0]},
    }  # fmt: skip
    several = {"type": "MultiPolygon", "coordinates": [[ring], [ring, ring]]}
    shapes = [zone | {"geometry": {"type": "Polygon", "coordinates": [ring]}}, zone | {"geometry": several}, point]
    return {"type": "FeatureCollection", "features": shapes}


@functools.cache
def _tree(text: str) -> Any:
    return yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))


# -- corruptions ------------------------------------------------------------------------------------------------------


def bombed(data: bytes, rng: random.Random) -> bytes:
    """The data; in 7 % of draws cut short, nested very deep, very long, in another encoding, or pure noise instead."""
    kind = rng.random()
    if kind < 0.93:
        return data
    return rng.choice(
        (
            lambda: data[: rng.randrange(len(data) + 1)],
            lambda: data.decode("latin-1").encode("utf-16"),
            lambda: rng.randbytes(rng.choice((1, 40, 4000))),
            lambda: rng.choice((b"[", b"{", b"<a>", b"- ", b"{a: ", b'{"a":', b"\n", b" ", b"\x00", b"9")) * 30_000,
            lambda: data * 50,
            lambda: data + b" " * 200_000,
        )
    )()


def written(name: str, data: bytes) -> None:
    Path(name).write_bytes(data)


PLAUSIBLE: tuple[Any, ...] = (
    0, 1, -1, 2, 3, 5, 10, 16, 17, 18, 19, 20, 21, 22, 30, 31, 82, 84, 85, 93, 112, 114, 177, 178, 189, 195, 206, 0.5,
    40, 60, 90, 5.62, 95.62, 120, 180, 360, 500, 1000, 36.6, -84.38, 36.605, -84.37, 36.61, 1e-3, 1e-7, 1e4, 1e5,
)  # fmt: skip
"""Numbers that are plausible in some field: commands, frames, heights, places, counts."""


def nudged(tree: Any, rng: random.Random) -> Any:
    """A copy of the tree with one to four numbers replaced by plausible ones: it stays valid enough to be judged."""
    tree = copy.deepcopy(tree)
    spots = [p for p in places(tree) if p and type(functools.reduce(lambda t, k: t[k], p, tree)) in (int, float)]
    for _ in range(rng.choice((1, 1, 2, 4))):
        *way, last = rng.choice(spots)
        parent = functools.reduce(lambda t, k: t[k], way, tree)
        value = parent[last]
        parent[last] = rng.choice(
            (rng.choice(PLAUSIBLE), value * rng.choice((0.5, 0.9, 1.1, 2, -1)), value + rng.gauss(0.0, 0.01))
        )
    return tree


def spoilt_json(tree: Any, rng: random.Random) -> bytes:
    """The JSON of a tree that is nudged, or corrupted as a tree, as text, or both."""
    if rng.random() < 0.4:
        return json.dumps(nudged(tree, rng)).encode()
    if rng.random() < 0.75:
        tree = spoilt_tree(tree, rng)
    text = json.dumps(tree).encode()
    return (
        spoilt_bytes(text, rng, (*NUMBERS, b"null", b"{", b"}", b"[", b"]", b'"', b":", b","))
        if rng.random() < 0.4
        else text
    )


def mission_file(rng: random.Random) -> list[str]:
    """A mission file with corrupted keys, values or text."""
    base = rng.choices((MISSION, RICH, LOCAL), (6, 6, 1))[0]  # LOCAL is rare: a world of peaks is slow to make
    if rng.random() < 0.7:
        spoilt = nudged if rng.random() < 0.5 else spoilt_tree
        data = yaml.dump(spoilt(_tree(base), rng), Dumper=getattr(yaml, "CSafeDumper", yaml.SafeDumper)).encode()
    else:
        data = spoilt_bytes(base.encode(), rng, YAML_WORDS)
    if rng.random() < 0.02:
        data += b"x: &a [1, 2]\n" + b"y: [" + b"*a, " * rng.choice((10, 300)) + b"]\n"
    written("m.yaml", bombed(data, rng))
    return ["m.yaml", "uav1=clean/uav1.waypoints"]


@functools.cache
def _items() -> list[tuple[corpus.Item, ...]]:
    return [case.items for case in corpus.cases() if len(case.items) < 100]


_WRITERS: tuple[Callable[[tuple[corpus.Item, ...]], str], ...] = (
    corpus.qgroundcontrol, corpus.qgroundcontrol_120, corpus.mission_planner, corpus.mavproxy, corpus.spaces_and_a_mark,
)  # fmt: skip


def waypoints(rng: random.Random) -> list[str]:
    """A .waypoints file with corrupted lines, numbers or bytes."""
    text = "\n".join(ROWS) + "\n" if rng.random() < 0.5 else rng.choice(_WRITERS)(rng.choice(_items()))
    lines, mild = text.split("\n"), rng.random() < 0.6
    for _ in range(rng.choice((0, 1, 1, 2, 6))):
        i = rng.randrange(len(lines))
        cells = lines[i].split("\t")
        kind = rng.random()
        if kind < 0.6:
            words = [str(n).encode() for n in PLAUSIBLE] if mild else NUMBERS
            cells[rng.randrange(len(cells))] = rng.choice(words).decode("latin-1")
            lines[i] = "\t".join(cells)
        elif kind < 0.8:
            lines.insert(rng.randrange(len(lines)), lines[i])
        else:
            del lines[i]
        lines = lines or [""]
    data = "\n".join(lines).encode()
    if not mild and rng.random() < 0.5:
        data = spoilt_bytes(data, rng, NUMBERS)
    written("uav1.waypoints", bombed(data, rng))
    return _among(rng, "uav1.waypoints")


@functools.cache
def _plans() -> list[Any]:
    own = read_mission_file("clean/uav1.waypoints", autopilot=Autopilot.ARDUCOPTER).mission
    plans = [json.loads(write_plan(own))]
    for items in _items():
        for firmware, survey in ((3, False), (12, False), (3, True)):
            if not survey or len(items) >= 8:
                plans.append(json.loads(corpus.plan(items, firmware, survey=survey)))
    around = [[36.5, -84.5], [36.5, -84.3], [36.61, -84.36], [36.7, -84.3], [36.7, -84.5]]
    for number, plan in enumerate(plans[::2]):
        plan["geoFence"] = {
            "version": 2, "breachReturn": [36.6, -84.37, 50],
            "circles": [{"circle": {"center": [36.6, -84.37], "radius": 900}, "inclusion": True, "version": 1}],
            "polygons": [
                {"polygon": [[36.59, -84.39], [36.62, -84.39], [36.62, -84.36]], "inclusion": False, "version": 1},
                *([{"polygon": around, "inclusion": True, "version": 1}] if number % 2 else []),
            ],
        }  # fmt: skip
        plan["rallyPoints"] = {"version": 2, "points": [[36.6, -84.379, 50.0], [36.601, -84.371, 60.0]]}
    landing = {
        "type": "ComplexItem", "complexItemType": "fwLandingPattern", "version": 2, "altitudesAreRelative": True,
        "landCoordinate": [36.6, -84.37, 0], "landingApproachCoordinate": [36.603, -84.375, 60], "loiterRadius": 75,
        "loiterClockwise": True, "stopTakingPhotos": True, "stopVideoPhotos": True, "useLoiterToAlt": True,
        "valueSetIsDistance": False,
    }  # fmt: skip
    for plan in plans[1::3]:
        plan["mission"]["items"].append(landing)
    return plans


def plan(rng: random.Random) -> list[str]:
    """A corrupted .plan file with simple and complex items, fences or rally points."""
    plans = _plans()
    tree = plans[0] if rng.random() < 0.3 else rng.choice(plans)
    written("uav1.plan", bombed(spoilt_json(tree, rng), rng))
    return _among(rng, "uav1.plan")


def _among(rng: random.Random, file: str) -> list[str]:
    """Arguments that check a file against the world of a mission file or of command line options."""
    kind = rng.random()
    if kind < 0.6:
        return ["clean/m.yaml", f"uav1={file}"]
    if kind < 0.7:
        return ["clean/rich.yaml", f"uav1={file}", *(["--way-home"] if rng.random() < 0.2 else [])]
    return [file, *OPTIONS, *(["--home", "36.6,-84.38"] if rng.random() < 0.3 else [])]


OPTIONS = ("--dem", "clean/west.asc", "--vertical-datum", "EGM96", "--crs", "EPSG:4326", "--min-agl", "30")


def zones(rng: random.Random) -> list[str]:
    """A corrupted KML or GeoJSON file of zones."""
    if rng.random() < 0.5:
        name, data = "z.kml", spoilt_bytes(KML.encode(), rng, XML_WORDS)
    else:
        name, data = "z.geojson", spoilt_json(geojson(), rng)
    written(name, bombed(data, rng))
    if rng.random() < 0.3:
        return ["clean/uav1.waypoints", *OPTIONS, "--zones", name]
    written("m.yaml", MISSION.replace("no_fly:", f"no_fly:\n  - {{file: {name}}}").encode())
    return ["m.yaml", "uav1=clean/uav1.waypoints"]


def terrain(rng: random.Random) -> list[str]:
    """A DEM with corrupted header or cells, of a wrong size, or one that claims to be larger than it is."""
    kind = rng.random()
    if kind < 0.45:
        rows = Path("clean/west.asc").read_bytes()[len(HEADER) :]
        head = spoilt_bytes(HEADER, rng, ASC_WORDS)
        name, data = "d.asc", head + (spoilt_bytes(rows, rng, ASC_WORDS) if rng.random() < 0.2 else rows)
    elif kind < 0.85:
        data = bytearray(Path("clean/east.tif").read_bytes())
        for _ in range(rng.choice((1, 1, 2, 4, 16))):
            at = rng.randrange(min(len(data), rng.choice((16, 400, len(data)))))
            data[at] = rng.choice((0, 1, 255, data[at] ^ (1 << rng.randrange(8)), rng.randrange(256)))
        name, data = "d.tif", bytes(data[: rng.choice((len(data), len(data), rng.randrange(len(data))))])
    elif kind < 0.92:
        size = rng.choice((1201 * 1201 * 2, 2884801, 25934402, 0, 100))
        name, data = rng.choice(("N36W085.hgt", "N99W185.hgt", "x.hgt")), bytes(size)
    else:
        name, data = "d.tif", boasting(rng)
    written(name, data if kind >= 0.85 else bombed(bytes(data), rng))
    if rng.random() < 0.3:
        return ["clean/uav1.waypoints", "--dem", name, *OPTIONS[2:]]
    crs = rng.choice(SYSTEMS) if rng.random() < 0.1 else "EPSG:4326"
    dem = f"{{dem: {name}, vertical_datum: EGM96, crs: '{crs}'}}"
    if rng.random() < 0.15:
        dem = f"{{dem: clean/west.asc, vertical_datum: EGM96, crs: 'EPSG:4326', canopy: {name}}}"
    elif rng.random() < 0.15:
        dem = f"{{dem: clean/west.asc, vertical_datum: ellipsoidal, crs: 'EPSG:4326', geoid_grid: {name}}}"
    written("m.yaml", MISSION.replace("{flat_m: 400}", dem).encode())
    return ["m.yaml", "uav1=clean/uav1.waypoints"]


def boasting(rng: random.Random) -> bytes:
    """A small GeoTIFF that claims to be a large one, in one block or in many."""
    side = rng.choice((2_000, 8_000, 14_000, 40_000, 200_000))
    blocks = rng.choice(
        ({}, {"tiled": True}, {"blockysize": side}, {"tiled": True, "blockxsize": 8192, "blockysize": 8192})
    )
    cell = rng.choice((0.06 / side, 1e-6, 1e-4, 0.5))
    name = f"boast-{os.getpid()}.tif"
    options: dict[str, Any] = {
        "driver": "GTiff", "width": side, "height": side, "count": rng.choice((1, 1, 3)), "crs": "EPSG:4326",
        "dtype": rng.choice(("int16", "float32", "float64", "uint8", "complex64")), "sparse_ok": True,
        "compress": rng.choice(("deflate", "lzw", "none")), "bigtiff": "yes",
        "transform": Affine(cell, 0, -84.41, 0, -cell, 36.63), **blocks,
    }  # fmt: skip
    try:
        with rasterio.open(name, "w", **options):
            pass
        return Path(name).read_bytes()
    except Exception:  # GDAL refuses to write some of them
        return b"II*\0" + rng.randbytes(100)
    finally:
        Path(name).unlink(missing_ok=True)


def names(rng: random.Random) -> list[str]:
    """Names that are no file, or a file of the wrong kind."""
    shutil.copy("clean/m.yaml", "m.yaml")
    strange = rng.choice(
        ("clean", "/dev/null", "nowhere", "", "\x00", "a\nb", "uav1=", "=", "uav1=uav1=x", "x" * 5000, "clean/m.yaml",
         "clean/west.asc", "clean/east.tif", "-", "~", "\udcff", "clean/uav1.waypoints/x", ".",
         "uav9=clean/uav1.waypoints")
    )  # fmt: skip
    if rng.random() < 0.5:
        return ["m.yaml", strange]
    key = rng.choice(("dem", "canopy", "geoid_grid", "zones"))
    if key == "zones":
        text = MISSION.replace("no_fly:", f"no_fly:\n  - {{file: {json.dumps(strange)}}}")
    else:
        terrain_keys = {"dem": "clean/west.asc", "vertical_datum": "EGM96", "crs": "EPSG:4326"} | {key: strange}
        text = MISSION.replace("{flat_m: 400}", json.dumps(terrain_keys))
    written("m.yaml", text.encode("utf-8", "surrogateescape"))
    return ["m.yaml", "uav1=clean/uav1.waypoints"]


def odd_options(rng: random.Random) -> list[str]:
    """Odd values of command line options."""
    option = rng.choice(("--min-agl", "--max-agl", "--max-amsl", "--clearance", "--track-error", "--altitude-error",
                         "--max-climb", "--speed", "--climb-rate", "--rtl-altitude", "--obstacle-height", "--home",
                         "--crs", "--vertical-datum", "--autopilot", "--wind"))  # fmt: skip
    value = rng.choice(
        [str(v) for v in ODD if "\x00" not in str(v)]
        + ["1e-9", "36.6,-84.38", "px4", "EPSG:32616", "EPSG:1", "5,350-20,9", "up-to:8"]
    )
    home = rng.choice(([], ["--way-home"], ["--require-way-home"]))
    return ["clean/uav1.waypoints", *OPTIONS, *home, option, value]


KINDS: dict[str, tuple[float, Callable[[random.Random], list[str]]]] = {
    "yaml": (3.0, mission_file),
    "waypoints": (2.5, waypoints),
    "plan": (2.5, plan),
    "zones": (2.0, zones),
    "terrain": (1.5, terrain),
    "names": (0.3, names),
    "options": (0.4, odd_options),
}
"""Kinds of input by name: relative frequency, and the function that makes one."""
