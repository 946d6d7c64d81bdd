"""Zones from KML: Placemarks with Polygons, or with Points whose ExtendedData has ``radius_m``.

Heights come from ExtendedData alone (``floor_agl_m`` …), because the altitudes in the coordinates, and altitudeMode,
only describe how Google Earth draws the outline. Namespaces are not required.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import defusedxml.ElementTree
from defusedxml.common import DefusedXmlException

from gcsplan.errors import InputError, Problem
from gcsplan.mission_file.zone_draft import Bounds
from gcsplan.mission_file.zone_file import LARGEST_M, LEVEL_KEYS, ZoneFile

MAX_DEPTH = 60
_SHAPES = ("Polygon", "Point", "LineString", "LinearRing", "Model", "Track", "MultiTrack")


def read_kml(path: Path, data: bytes) -> ZoneFile:
    """The zones of KML text. Raises InputError if it is not KML."""
    found = ZoneFile(path)
    try:
        root = defusedxml.ElementTree.fromstring(data, forbid_dtd=True)
    except DefusedXmlException:
        raise InputError("the KML has a document type or entities; remove them", where=str(path)) from None
    except (ValueError, SyntaxError, LookupError) as why:  # ParseError is a SyntaxError; unknown encodings LookupError
        raise InputError(f"this is not KML: {str(why)[:200]}", where=str(path)) from None
    placemarks = 0
    for element in _walk(root, path):
        kind = _kind(element)
        if kind == "Placemark":
            placemarks += 1
            _placemark(found, element, placemarks)
        elif kind in ("NetworkLink", "GroundOverlay"):
            found.problems.append(Problem(f"{path}: {kind}", f"a {kind} cannot be read as a zone; remove it"))
    if not placemarks:
        raise InputError("the KML holds no Placemark", where=str(path))
    return found


def _walk(root: Any, path: Path, *, leaves: tuple[str, ...] = ()) -> Iterator[Any]:
    """Every element in the order of the file, without recursion; elements below ``leaves`` are left out."""
    stack = [(root, 0)]
    while stack:
        element, depth = stack.pop()
        if depth > MAX_DEPTH:
            raise InputError(f"the KML is nested more than {MAX_DEPTH} levels deep", where=str(path))
        yield element
        if _kind(element) not in leaves:
            stack += [(child, depth + 1) for child in reversed(element)]


def _kind(element: Any) -> str:
    """The tag without its namespace; empty for comments and processing instructions."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def _placemark(found: ZoneFile, placemark: Any, number: int) -> None:
    name = next((t for c in placemark if _kind(c) == "name" and (t := (c.text or "").strip())), "")
    where = f"{found.path}: Placemark {number}" + (f" ({name[:60]})" if name else "")
    name = (name or f"{found.path.stem}[{number}]")[:200]
    data = _extended_data(placemark)
    before = len(found.problems)
    numbers = {k: _number(found, data, k, where) for k in (*LEVEL_KEYS, "radius_m")}
    if len(found.problems) > before:
        return
    bounds = Bounds(**{k: numbers[k] for k in LEVEL_KEYS})
    shapes = [e for e in _walk(placemark, found.path, leaves=("Polygon", "Point")) if _kind(e) in _SHAPES]
    others = [_kind(e) for e in shapes if _kind(e) not in ("Polygon", "Point")]
    if others or not shapes:
        given = others[0] if others else "none"
        found.problems.append(
            Problem(where, f"its geometry must be Polygons, or Points with radius_m in ExtendedData, given {given}")
        )
        return
    for i, shape in enumerate(shapes):
        part = name if len(shapes) == 1 else f"{name}/{i + 1}"
        if _kind(shape) == "Point":
            points = _coordinates(found, shape, where)
            if points is not None and len(points) == 1:
                found.add_circle(part, where, points[0], numbers["radius_m"], bounds)
            elif points is not None:
                found.problems.append(Problem(where, f"a Point has one coordinate, given {len(points)}"))
        else:
            _polygon(found, shape, part, where, bounds)


def _polygon(found: ZoneFile, shape: Any, name: str, where: str, bounds: Bounds) -> None:
    outer = [e for e in _walk(shape, found.path) if _kind(e) == "outerBoundaryIs"]
    found.holes += sum(_kind(e) == "innerBoundaryIs" for e in _walk(shape, found.path))
    if len(outer) != 1:
        found.problems.append(Problem(where, f"a Polygon has one outerBoundaryIs, given {len(outer)}"))
        return
    points = _coordinates(found, outer[0], where)
    if points is not None:
        found.add_ring(name, where, points, bounds, "")


def _coordinates(found: ZoneFile, parent: Any, where: str) -> list[tuple[float, float]] | None:
    """(latitude, longitude) of each ``lon,lat[,alt]`` below ``parent``; None, and a problem, if one is wrong."""
    text = " ".join(e.text or "" for e in _walk(parent, found.path) if _kind(e) == "coordinates")
    points = []
    for word in text.split():
        try:
            lon, lat = (float(x) for x in word.split(",")[:2])
        except ValueError:
            lon = lat = math.nan
        if not (math.isfinite(lon) and math.isfinite(lat)):
            found.problems.append(Problem(where, f"coordinates are lon,lat[,alt] without spaces, given {word[:60]!r}"))
            return None
        if abs(lat) > 90.0 and abs(lon) <= 90.0 and abs(lat) <= 180.0:
            swapped = f"longitude and latitude look swapped: KML is lon,lat, given {word[:60]}"
            found.problems.append(Problem(where, swapped))
            return None
        points.append((lat, lon))
    if not points:
        found.problems.append(Problem(where, "has no coordinates"))
        return None
    return points


def _extended_data(placemark: Any) -> dict[str, str]:
    """Names and texts of ``<Data name><value>`` and ``<SimpleData name>``."""
    data: dict[str, str] = {}
    for child in placemark:
        if _kind(child) != "ExtendedData":
            continue
        for element in child.iter():
            if _kind(element) == "Data":
                data[element.get("name", "")] = next((e.text or "" for e in element if _kind(e) == "value"), "")
            elif _kind(element) == "SimpleData":
                data[element.get("name", "")] = element.text or ""
    return data


def _number(found: ZoneFile, data: dict[str, str], key: str, where: str) -> float | None:
    text = data.get(key, "").strip()
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST_M:
        found.problems.append(Problem(f"{where}.{key}", f"must be a number, given {text[:60]!r}"))
        return None
    return value
