"""Zones of a given size: corners, arcs, circles, lines and rows, in every kind of file that zones are read from.

Each function writes the files of one input into the current folder and returns the arguments of ``gcsplan``.
"""

from __future__ import annotations

import json
import math
import random
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.campaigns.large_inputs import EAST_M, LAT, LON, degrees, mission, ring_file, smooth, spiky, waypoints


def corners(count: int, rng: random.Random) -> list[str]:
    ring_file(spiky(count, rng))
    return ["plan", *mission([{"file": "zones.geojson"}]), "-o", "out", "--json"]


def coast(count: int, rng: random.Random) -> list[str]:
    ring_file(smooth(count, rng))
    return ["plan", *mission([{"file": "zones.geojson"}]), "-o", "out", "--json"]


def spikes_far_away(count: int, rng: random.Random) -> list[str]:
    """Spikes of 300 m, most of whose edges lie beside each other, in a zone that no mission is near."""
    ring_file(spiky(count, rng, middle=(2000.0, 300_000.0)))
    return ["plan", *mission([{"file": "zones.geojson"}]), "-o", "out", "--json"]


def corners_checked(count: int, rng: random.Random) -> list[str]:
    ring_file(spiky(count, rng))
    waypoints([(300.0 + 10.0 * k, 950.0) for k in range(300)])
    return ["check", *mission([{"file": "zones.geojson"}]), "u.waypoints", "--json"]


def corners_at_home(count: int, rng: random.Random) -> list[str]:
    return [*corners(count, rng), "--way-home"]


def corners_fenced(count: int, rng: random.Random) -> list[str]:
    return [*corners(count, rng), "--fence"]


def corners_drawn(count: int, rng: random.Random) -> list[str]:
    return [*corners(count, rng), "--report"]


def crossing(count: int, rng: random.Random) -> list[str]:
    """An ED-269 ring that crosses itself everywhere."""
    points = degrees([(rng.uniform(-2000.0, 2000.0), rng.uniform(500.0, 4500.0)) for _ in range(count)])
    ring = [[lon, lat] for lat, lon in [*points, points[0]]]
    geometry = {
        "uomDimensions": "M", "lowerLimit": 0, "lowerVerticalReference": "AGL", "upperLimit": 120,
        "upperVerticalReference": "AGL", "horizontalProjection": {"type": "Polygon", "coordinates": [ring]},
    }  # fmt: skip
    zone = {
        "identifier": "Z1", "country": "SVN", "name": "crossing", "type": "COMMON", "restriction": "PROHIBITED",
        "reason": ["OTHER"], "applicability": [{"permanent": "YES"}], "zoneAuthority": [{"name": "a"}],
        "geometry": [geometry],
    }  # fmt: skip
    Path("zones.json").write_text(json.dumps({"title": "t", "description": "d", "features": [zone]}))
    return ["plan", *mission([{"file": "zones.json"}], at="2026-11-24T10:00Z"), "-o", "out", "--json"]


def arcs(count: int, rng: random.Random) -> list[str]:
    """An OpenAir zone of many arcs around one centre, which lies 10 km beyond the goal."""
    centre = f"{_dms(LAT)} N {_dms(LON + 14_000.0 / EAST_M)} E"
    lines = ["AC R", "AN arcs", "AL GND", "AH 1000 ft", f"V X={centre}"]
    lines += [
        f"DA {rng.uniform(3.0, 4.0):.3f},{rng.uniform(0, 360):.1f},{rng.uniform(0, 360):.1f}" for _ in range(count)
    ]
    Path("zones.txt").write_text("\n".join(lines) + "\n")
    return ["plan", *mission([{"file": "zones.txt"}]), "-o", "out", "--json"]


def fan(count: int, rng: random.Random) -> list[str]:
    """An OpenAir zone whose outline is arcs side by side, and crosses itself nowhere."""
    centre = f"{_dms(LAT)} N {_dms(LON + 14_000.0 / EAST_M)} E"
    lines = ["AC R", "AN fan", "AL GND", "AH 1000 ft", f"V X={centre}"]
    turn = 360.0 / count
    lines += [f"DA {rng.uniform(3.0, 4.0):.3f},{turn * k:.5f},{turn * (k + 0.5):.5f}" for k in range(count)]
    Path("zones.txt").write_text("\n".join(lines) + "\n")
    return ["plan", *mission([{"file": "zones.txt"}]), "-o", "out", "--json"]


def cylinders(count: int, rng: random.Random) -> list[str]:
    features = []
    for k in range(count):
        [[lat, lon]] = degrees([(rng.uniform(-9000.0, 9000.0), rng.uniform(600.0, 9000.0))])
        point = {"type": "Point", "coordinates": [lon, lat]}
        features.append({"type": "Feature", "properties": {"name": f"z{k}", "radius_m": 40}, "geometry": point})
    Path("zones.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return ["plan", *mission([{"file": "zones.geojson"}]), "-o", "out", "--json"]


def wide_cylinders(count: int, rng: random.Random) -> list[str]:
    """Circles of 60 km that all lie over each other."""
    arguments = cylinders(count, rng)
    data = json.loads(Path("zones.geojson").read_text())
    for feature in data["features"]:
        [[lat, lon]] = degrees([(rng.uniform(92_000.0, 108_000.0), rng.uniform(-20_000.0, 20_000.0))])
        feature["geometry"]["coordinates"] = [lon, lat]
        feature["properties"]["radius_m"] = 60_000
    Path("zones.geojson").write_text(json.dumps(data))
    return arguments


def great_circles(count: int, rng: random.Random) -> list[str]:
    """Polygons of KML around the mission with edges of three degrees, each of which is drawn as a great circle too."""
    marks = []
    for k in range(count):
        lat, lon = LAT + 0.5 + rng.uniform(-0.1, 0.1), LON + rng.uniform(-0.2, 0.2)
        turn = [math.pi * n / 4.0 for n in range(9)]
        ring = " ".join(f"{lon + 3.0 * math.cos(t):.6f},{lat + 0.3 * math.sin(t):.6f},0" for t in turn)
        marks.append(
            f"<Placemark><name>z{k}</name><Polygon><outerBoundaryIs><LinearRing><coordinates>{ring}</coordinates>"
            f"</LinearRing></outerBoundaryIs></Polygon></Placemark>"
        )
    Path("zones.kml").write_text(
        f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{"".join(marks)}</Document></kml>'
    )
    return ["plan", *mission([{"file": "zones.kml"}]), "-o", "out", "--json"]


def forest(count: int, rng: random.Random) -> list[str]:
    """Many circles in the way, between start and goal."""
    arguments = cylinders(count, rng)
    data = json.loads(Path("zones.geojson").read_text())
    for feature in data["features"]:
        [[lat, lon]] = degrees([(rng.uniform(300.0, 3700.0), rng.uniform(-3000.0, 3000.0))])
        feature["geometry"]["coordinates"] = [lon, lat]
        feature["properties"]["radius_m"] = 5
    Path("zones.geojson").write_text(json.dumps(data))
    return arguments


def corridor(count: int, rng: random.Random) -> list[str]:
    """A corridor around a line of random points."""
    line = degrees([(rng.uniform(-2000.0, 2000.0), rng.uniform(500.0, 4500.0)) for _ in range(count)])
    return ["plan", *mission([{"name": "c", "line": line, "buffer_m": 50}]), "-o", "out", "--json"]


def river(count: int, rng: random.Random) -> list[str]:
    """A corridor around a winding line, as power lines and rivers are."""
    line = [(8.0 * k - 4.0 * count, 800.0 + 300.0 * math.sin(0.01 * k) + rng.uniform(-3.0, 3.0)) for k in range(count)]
    return ["plan", *mission([{"name": "c", "line": degrees(line), "buffer_m": 50}]), "-o", "out", "--json"]


def _squares(count: int, rng: random.Random) -> Iterator[list[list[float]]]:
    """Outlines [longitude, latitude] of squares of 40 m around the mission, none of them in its way."""
    for _ in range(count):
        e, n = rng.uniform(-9000.0, 9000.0), rng.uniform(600.0, 9000.0)
        ring = degrees([(e, n), (e + 40.0, n), (e + 40.0, n + 40.0), (e, n + 40.0), (e, n)])
        yield [[lon, lat] for lat, lon in ring]


def squares_in_kml(count: int, rng: random.Random) -> list[str]:
    marks = []
    for k, ring in enumerate(_squares(count, rng)):
        text = " ".join(f"{lon:.7f},{lat:.7f},0" for lon, lat in ring)
        marks.append(
            f"<Placemark><name>z{k}</name><Polygon><outerBoundaryIs><LinearRing><coordinates>{text}</coordinates>"
            f"</LinearRing></outerBoundaryIs></Polygon></Placemark>"
        )
    Path("zones.kml").write_text(
        f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{"".join(marks)}</Document></kml>'
    )
    return ["plan", *mission([{"file": "zones.kml"}]), "-o", "out", "--json"]


def squares_in_kmz(count: int, rng: random.Random) -> list[str]:
    """The same, zipped: the archive is small, and its content has the limit of any file."""
    arguments = squares_in_kml(count, rng)
    Path("zones.kml").rename("doc.kml")
    with zipfile.ZipFile("zones.kmz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write("doc.kml")
    mission([{"file": "zones.kmz"}])
    return arguments


def members_of_kmz(count: int, rng: random.Random) -> list[str]:
    """A KMZ of ``count`` files, of which one is the zones and the rest are empty pictures."""
    arguments = squares_in_kmz(10, rng)
    with zipfile.ZipFile("zones.kmz", "a") as archive:
        for k in range(count - 1):
            archive.writestr(f"{k}.png", "")
    return arguments


def bomb_in_kmz(count: int, rng: random.Random) -> list[str]:
    """A KMZ of some kilobytes whose one member has ``count`` megabytes of blanks."""
    with zipfile.ZipFile("zones.kmz", "w", zipfile.ZIP_DEFLATED) as archive, archive.open("doc.kml", "w") as member:
        for _ in range(count):
            member.write(b" " * 1_000_000)
    return ["plan", *mission([{"file": "zones.kmz"}]), "-o", "out", "--json"]


def squares_in_ed318(count: int, rng: random.Random) -> list[str]:
    layer = {"upper": 900, "upperReference": "AGL", "lower": 0, "lowerReference": "AGL", "uom": "m"}
    features = [
        {
            "type": "Feature",
            "properties": {
                "identifier": f"Z{k}", "country": "SVN", "name": [{"text": f"z{k}", "lang": "en"}],
                "type": "PROHIBITED", "variant": "COMMON", "zoneAuthority": [{"purpose": "INFORMATION"}],
            },
            "geometry": {"type": "Polygon", "coordinates": [ring], "layer": layer},
        }
        for k, ring in enumerate(_rounded_squares(count, rng))
    ]  # fmt: skip
    return _in_json({"type": "FeatureCollection", "features": features})


def squares_in_openaip(count: int, rng: random.Random) -> list[str]:
    lower, upper = ({"value": m, "unit": 0, "referenceDatum": 0} for m in (0, 900))
    items = [
        {
            "_id": f"i{k}", "name": f"z{k}", "type": 3, "icaoClass": 8, "lowerLimit": lower, "upperLimit": upper,
            "geometry": {"type": "Polygon", "coordinates": [ring]},
        }
        for k, ring in enumerate(_rounded_squares(count, rng))
    ]  # fmt: skip
    return _in_json({"items": items})


def _rounded_squares(count: int, rng: random.Random) -> Iterator[list[list[float]]]:
    """The squares as authorities write them: with six decimals."""
    for ring in _squares(count, rng):
        yield [[round(lon, 6), round(lat, 6)] for lon, lat in ring]


def _in_json(whole: dict[str, object]) -> list[str]:
    Path("zones.json").write_text(json.dumps(whole, separators=(",", ":")))
    return ["plan", *mission([{"file": "zones.json"}]), "-o", "out", "--json"]


def squares_in_openair(count: int, rng: random.Random) -> list[str]:
    lines = []
    for k, ring in enumerate(_squares(count, rng)):
        lines += ["AC R", f"AN z{k}", "AL GND", "AH 1000 ft"]
        lines += [f"DP {_dms(lat)} N {_dms(lon)} E" for lon, lat in ring[:-1]]
    Path("zones.txt").write_text("\n".join(lines) + "\n")
    return ["plan", *mission([{"file": "zones.txt"}]), "-o", "out", "--json"]


def masts(count: int, rng: random.Random) -> list[str]:
    """A table (CSV) of circles."""
    rows = ["name,lat,lon,height_m,radius_m"]
    for k, ring in enumerate(_squares(count, rng)):
        rows.append(f"z{k},{ring[0][1]:.7f},{ring[0][0]:.7f},90,30")
    Path("zones.csv").write_text("\n".join(rows) + "\n")
    return ["plan", *mission([{"file": "zones.csv"}]), "-o", "out", "--json"]


def geopackage(count: int, rng: random.Random) -> list[str]:
    return _features(count, rng, "zones.gpkg")


def shapefile(count: int, rng: random.Random) -> list[str]:
    return _features(count, rng, "zones.shp")


def flatgeobuf(count: int, rng: random.Random) -> list[str]:
    return _features(count, rng, "zones.fgb")


def _features(count: int, rng: random.Random, name: str) -> list[str]:
    """A file of GDAL's with ``count`` squares that have a name and a ceiling."""
    import pyogrio
    import shapely

    shapes = shapely.to_wkb(shapely.polygons([np.array(ring) for ring in _squares(count, rng)]))
    columns = [np.array([f"z{k}" for k in range(count)], object), np.full(count, "900 m AGL", object)]
    pyogrio.raw.write(name, shapes, columns, ["name", "ceiling"], geometry_type="Polygon", crs="EPSG:4326")
    return ["plan", *mission([{"file": name}]), "-o", "out", "--json"]


def corners_in_geopackage(count: int, rng: random.Random) -> list[str]:
    """One polygon of ``count`` soft corners in a GeoPackage."""
    import pyogrio
    import shapely

    ring = np.array([[lon, lat] for lat, lon in degrees(smooth(count, rng))])
    shapes = shapely.to_wkb(np.array([shapely.Polygon(ring)], object))
    pyogrio.raw.write(
        "zones.gpkg", shapes, [np.array(["z"], object)], ["name"], geometry_type="Polygon", crs="EPSG:4326"
    )
    return ["plan", *mission([{"file": "zones.gpkg"}]), "-o", "out", "--json"]


def _dms(value: float) -> str:
    minutes = 60.0 * (value - int(value))
    return f"{int(value)}:{int(minutes):02d}:{min(60.0 * (minutes - int(minutes)), 59.99):05.2f}"
