"""Zones whose shape is no polygon in degrees: circles and corridors, and polygons in metres of other systems."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyogrio
import shapely
from pyproj import Geod, Transformer

from gcsplan.errors import InputError
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import ZoneDraft, place_zones
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Circle

GEOD = Geod(ellps="WGS84")
PLACES = 16

SYSTEMS = {  # EPSG code: longitudes and latitudes in which it is used
    32601: (-184.0, -172.0, 5.0, 80.0), 32660: (172.0, 184.0, 5.0, 80.0), 32760: (172.0, 184.0, -78.0, -5.0),
    3832: (100.0, 260.0, -60.0, 60.0), 3857: (-170.0, 170.0, -70.0, 70.0), 2193: (167.0, 178.0, -46.0, -35.0),
    3413: (-180.0, 180.0, 62.0, 89.0), 3031: (-180.0, 180.0, -89.0, -62.0), 3995: (-180.0, 180.0, 62.0, 89.0),
    2154: (-4.0, 9.0, 42.0, 50.0), 4807: (-4.0, 9.0, 42.0, 50.0), 3035: (-10.0, 30.0, 36.0, 66.0),
}  # fmt: skip
NEAR_BORDER_M = 8.0
"""Accuracy of datum shifts, and tolerance of edges, m."""


def sized(rng: random.Random, folder: Path) -> tuple[str, Path, Callable[[float, float], bool | None]]:
    """A circle or a corridor in GeoJSON, KML or CSV, and whether a (longitude, latitude) is in it; None at its edge."""
    lon, lat = rng.choice([rng.uniform(-180.0, 180.0), 180.0, -180.0, 179.99]), rng.uniform(-84.0, 84.0)
    size_m = 10.0 ** rng.uniform(1.0, 4.2)
    turn = rng.choice([0.0, 360.0]) if lon < 0.0 else rng.choice([0.0, -360.0])
    form = rng.choice(["geojson", "kml", "csv"])
    if form == "csv" or rng.random() < 0.4:

        def circle(x: float, y: float) -> bool | None:
            away_m = GEOD.inv(lon, lat, x, y)[2]
            return None if abs(away_m - size_m) < 2.0 + 1e-3 * size_m else away_m < size_m

        at = [(lon + turn if form != "csv" else lon, lat)]
        return f"circle, {form}", _write(folder, form, at, "radius_m", size_m), circle
    count = rng.randint(1, 5)
    reach = 10.0 ** rng.uniform(-2.0, 0.7)
    line = [(lon, lat)]
    for _ in range(count):
        x, y = line[-1]
        line.append((x + rng.uniform(-reach, reach), min(max(y + rng.uniform(-reach, reach), -84.9), 84.9)))
    drawn = [_dense(a, b) for a, b in pairwise(line)]
    lines = [np.concatenate(drawn)]
    if form == "kml":
        lines.append(np.concatenate([_geodesic(a, b) for a, b in pairwise(line)]))
    spare_m = 3.0 + max(float(np.max(GEOD.inv(*p[:-1].T, *p[1:].T)[2])) for p in lines) ** 2 / (4.0 * size_m)

    def corridor(x: float, y: float) -> bool | None:
        away_m = min(float(np.min(GEOD.inv(np.full(len(p), x), np.full(len(p), y), *p.T)[2])) for p in lines)
        if away_m < size_m - (2.0 if form == "kml" else 0.0):
            return True
        return False if away_m > 1.05 * size_m + spare_m else None

    return f"corridor, {form}", _write(folder, form, [(x + turn, y) for x, y in line], "buffer_m", size_m), corridor


def _dense(a: tuple[float, float], b: tuple[float, float]) -> np.ndarray:
    part = np.linspace(0.0, 1.0, 2001)[:, None]
    return np.asarray(np.array(a) + part * (np.array(b) - np.array(a)))


def _geodesic(a: tuple[float, float], b: tuple[float, float]) -> np.ndarray:
    return np.array([a, *GEOD.npts(*a, *b, 2000), b])


def _write(folder: Path, form: str, places: Sequence[tuple[float, float]], key: str, size_m: float) -> Path:
    if form == "csv":
        (folder / "z.csv").write_text(f"name,lat,lon,{key}\nz,{places[0][1]!r},{places[0][0]!r},{size_m!r}\n")
        return folder / "z.csv"
    if form == "geojson":
        kind, at = ("Point", list(places[0])) if len(places) == 1 else ("LineString", [list(p) for p in places])
        feature = {"type": "Feature", "properties": {"name": "z", key: size_m},
                   "geometry": {"type": kind, "coordinates": at}}  # fmt: skip
        (folder / "z.geojson").write_text(json.dumps(feature))
        return folder / "z.geojson"
    kind = "Point" if len(places) == 1 else "LineString"
    text = " ".join(f"{x!r},{y!r}" for x, y in places)
    data = f'<ExtendedData><Data name="{key}"><value>{size_m!r}</value></Data></ExtendedData>'
    shape = f"<{kind}><coordinates>{text}</coordinates></{kind}>"
    (folder / "z.kml").write_text(f"<kml><Placemark><name>z</name>{data}{shape}</Placemark></kml>")
    return folder / "z.kml"


def projected(rng: random.Random, folder: Path) -> tuple[str, Path, Callable[[float, float], bool | None]]:
    """A polygon in a system of its own, with edges straight there; at times with a pole or the antimeridian in it."""
    code = rng.choice([*SYSTEMS])
    west, east, south, north = SYSTEMS[code]
    there = Transformer.from_crs("EPSG:4326", f"EPSG:{code}", always_xy=True)
    x, y = there.transform((rng.uniform(west, east) + 180.0) % 360.0 - 180.0, rng.uniform(south, north))
    unit_m = 1.0 if code != 4807 else 100_000.0
    size = 10.0 ** rng.uniform(2.0, 5.7 if code in (3413, 3031, 3995) else 5.0) / unit_m
    turns = sorted(rng.uniform(0.0, 2.0 * math.pi) for _ in range(rng.randint(3, 7)))
    ring = [(x + size * rng.uniform(0.4, 1.0) * math.cos(t), y + size * math.sin(t)) for t in turns]
    shape = shapely.Polygon(ring)
    if not shape.is_valid:
        shape = shape.convex_hull
    file = folder / f"z.{rng.choice(['gpkg', 'shp'])}"
    file.unlink(missing_ok=True)
    pyogrio.raw.write(
        file, shapely.to_wkb(np.array([shape], dtype=object)), [np.array(["z"], dtype=object)], ["name"],
        geometry_type="Polygon", crs=f"EPSG:{code}",
    )  # fmt: skip
    border = shape.exterior

    def inside(lon: float, lat: float) -> bool | None:
        at = shapely.Point(there.transform(lon, lat))
        metres = max(1.0, 1.0 / math.cos(math.radians(lat))) if code in (3857, 3832) else 1.1
        return None if border.distance(at) * unit_m < NEAR_BORDER_M * metres else bool(shape.contains(at))

    return f"projected, {code}", file, inside


def attack(seed: int, folder: Path) -> tuple[str, str, list[str]]:
    """Read the input of that seed; its kind and format, how it ended, and the faults."""
    rng = random.Random(seed)
    named, file, right = rng.choice([sized, projected])(rng, folder)
    try:
        found = read_zones(file, where="zones")
        problems = [p.message for p in found.problems]
    except InputError as why:
        problems = [p.message for p in why.problems]
    if problems:
        return named, f"refused: {problems[0]}", []
    faults = []
    for lon, lat in places(rng, found.zones):
        frame = Frame(min(max(lat + rng.uniform(-0.5, 0.5), -85.0), 85.0),
                      (lon + rng.uniform(-0.9, 0.9) + 180.0) % 360.0 - 180.0)  # fmt: skip
        answer, expected = holds(found.zones, frame, lon, lat), right(lon, lat)
        if expected is not None and answer != expected:
            words = "inside, read as free" if expected else "outside, read as inside"
            faults.append(f"seed {seed} ({named}): {lat:.6f}, {lon:.6f} is {words}")
    return named, "read", faults


def places(rng: random.Random, drafts: Sequence[ZoneDraft]) -> list[tuple[float, float]]:
    """(longitude, latitude) around the corners, centres and edges of zones."""
    corners = [p for draft in drafts for p in draft.points]
    size_m = max([draft.radius_m or draft.buffer_m or 100.0 for draft in drafts])
    found = []
    for _ in range(PLACES):
        (a, b), (c, d) = rng.choice(corners), rng.choice(corners)
        part, near = rng.random(), rng.choice([0.0, size_m / 111_000.0, 3.0 * size_m / 111_000.0, 0.5])
        lat, lon = a + part * (c - a) + rng.gauss(0.0, near), b + part * (d - b)
        lon += rng.gauss(0.0, near) / math.cos(math.radians(min(abs(lat), 89.0)))
        if abs(lat) < 84.9:
            found.append(((lon + 180.0) % 360.0 - 180.0, lat))
    return found


def holds(drafts: Sequence[ZoneDraft], frame: Frame, lon: float, lat: float) -> bool:
    """Whether a place is in a zone as gcsplan places them."""
    east, north = (float(x) for x in frame.to_plane(lat, lon))
    for _, zone in place_zones(drafts, frame)[0]:
        shape = zone.shape
        if isinstance(shape, Circle):
            if math.hypot(east - shape.east_m, north - shape.north_m) < shape.radius_m:
                return True
        elif shapely.Polygon(shape.vertices).contains(shapely.Point(east, north)):
            return True
    return False
