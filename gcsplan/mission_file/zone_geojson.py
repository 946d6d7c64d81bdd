"""Zones from GeoJSON (RFC 7946): Polygons are prisms, Points with ``radius_m`` cylinders; a hole counts as no-fly."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError, Problem
from gcsplan.mission_file.zone_draft import Bounds
from gcsplan.mission_file.zone_file import LARGEST_M, LEVEL_KEYS, ZoneFile


def read_geojson(path: Path, data: bytes) -> ZoneFile:
    """The zones of GeoJSON text. Raises InputError if it is not GeoJSON."""
    found = ZoneFile(path)
    try:
        whole = json.loads(
            data.decode("utf-8-sig"), object_pairs_hook=_unique, parse_constant=_no_constant, parse_int=_bounded_int
        )
    except RecursionError:
        raise InputError("the file is nested too deeply to be GeoJSON", where=str(path)) from None
    except ValueError as why:  # bad UTF-8, bad JSON, and the refusals below
        raise InputError(f"this is not GeoJSON: {str(why)[:200]}", where=str(path)) from None
    if not isinstance(whole, dict):
        raise InputError("a GeoJSON file holds one object, for example a FeatureCollection", where=str(path))
    _require_wgs84(whole, path)
    features = whole.get("features") if whole.get("type") == "FeatureCollection" else [whole]
    if not isinstance(features, list) or not features:
        raise InputError("a FeatureCollection needs a list `features` that is not empty", where=str(path))
    for i, feature in enumerate(features):
        where = f"{path}: features[{i}]" if whole.get("type") == "FeatureCollection" else f"{path}: feature"
        _feature(found, feature, where, f"{path.stem}[{i}]")
    return found


def _require_wgs84(whole: dict[str, Any], path: Path) -> None:
    """Refuse other coordinate systems in `crs`: RFC 7946 removed this member of the 2008 draft, but files use it."""
    crs = whole.get("crs")
    if crs is None:
        return
    text = json.dumps(crs)
    if "CRS84" not in text and "4326" not in text:
        raise InputError(
            f"GeoJSON is in WGS84 degrees (RFC 7946), this file says {text[:100]}; convert it with "
            "ogr2ogr -t_srs EPSG:4326",
            where=f"{path}: crs",
        )


def _feature(found: ZoneFile, feature: Any, where: str, fallback: str) -> None:
    if not isinstance(feature, dict):
        found.problems.append(Problem(where, f"must be a Feature or a geometry, given {_shown(feature)}"))
        return
    geometry: Any = feature
    properties: Any = {}
    if feature.get("type") == "Feature":
        geometry = feature.get("geometry")
        properties = feature.get("properties") or {}
    if not isinstance(properties, dict) or not isinstance(geometry, dict):
        what = "properties must be an object" if not isinstance(properties, dict) else "the feature has no geometry"
        found.problems.append(Problem(where, what))
        return
    # gcsplan's own mission.geojson contains tracks and way points beside the zones; they are skipped.
    drawn = {"track": ("LineString", "MultiLineString"), "waypoint": ("Point",)}.get(str(properties.get("kind")), ())
    if geometry.get("type") in drawn and "radius_m" not in properties:
        return
    name = next((str(v) for k in ("name", "Name", "title") if (v := properties.get(k)) not in (None, "")), fallback)
    before = len(found.problems)
    numbers = {k: _property(found, properties, k, where) for k in (*LEVEL_KEYS, "radius_m")}
    if len(found.problems) > before:
        return
    bounds = Bounds(**{k: numbers[k] for k in LEVEL_KEYS})
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    at = f"{where}.geometry.coordinates" if geometry is not feature else f"{where}.coordinates"
    if kind == "Point":
        centre = _position(found, coordinates, at)
        if centre is not None:
            found.add_circle(name[:200], where, centre, numbers["radius_m"], bounds)
    elif kind in ("Polygon", "MultiPolygon"):
        polygons = [coordinates] if kind == "Polygon" else coordinates
        if not isinstance(polygons, list) or not polygons:
            found.problems.append(Problem(at, f"a {kind} needs a list of coordinates, given {_shown(polygons)}"))
            return
        for i, rings in enumerate(polygons):
            part = name if kind == "Polygon" else f"{name}/{i + 1}"
            _rings(found, rings, part[:200], where, at if kind == "Polygon" else f"{at}[{i}]", bounds)
    else:
        found.problems.append(
            Problem(where, f"must be a Polygon, a MultiPolygon or a Point with radius_m, given {_shown(kind)}")
        )


def _rings(found: ZoneFile, rings: Any, name: str, where: str, at: str, bounds: Bounds) -> None:
    if not isinstance(rings, list) or not rings or not isinstance(rings[0], list):
        found.problems.append(Problem(at, f"a polygon is a list of rings, given {_shown(rings)}"))
        return
    found.holes += len(rings) - 1
    outline = []
    for i, position in enumerate(rings[0]):
        point = _position(found, position, f"{at}[0][{i}]")
        if point is None:
            return
        outline.append(point)
    key = at.removeprefix(where).removeprefix(".")
    found.add_ring(name, where, outline, bounds, key)


def _position(found: ZoneFile, position: Any, where: str) -> tuple[float, float] | None:
    """(latitude, longitude) of GeoJSON's [lon, lat]; None, and a problem, if it is not a position."""
    if not isinstance(position, list) or len(position) < 2 or not all(_is_number(x) for x in position[:2]):
        found.problems.append(Problem(where, f"a position is [longitude, latitude], given {_shown(position)}"))
        return None
    lon, lat = float(position[0]), float(position[1])
    if abs(lat) > 90.0 and abs(lon) <= 90.0 and abs(lat) <= 180.0:
        found.problems.append(
            Problem(where, f"longitude and latitude look swapped: GeoJSON is [lon, lat], given [{lon:g}, {lat:g}]")
        )
        return None
    return lat, lon


def _property(found: ZoneFile, properties: dict[str, Any], key: str, where: str) -> float | None:
    value = properties.get(key)
    if value is None:
        return None
    if not _is_number(value) or abs(value) > LARGEST_M:
        found.problems.append(Problem(f"{where}.properties.{key}", f"must be a number, given {_shown(value)}"))
        return None
    return float(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _shown(value: Any) -> str:
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else f"a list of {len(value)}"
    return repr(value)[:60]


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    whole = dict(pairs)
    if len(whole) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise ValueError(f"the key {key[:60]!r} stands twice")
            seen.add(key)
    return whole


def _no_constant(name: str) -> Iterator[None]:
    raise ValueError(f"{name} is no number")


def _bounded_int(digits: str) -> float:
    # int() refuses thousands of digits with a message about its own limits; as inf the number is refused by gcsplan.
    return int(digits) if len(digits) <= 300 else math.inf
