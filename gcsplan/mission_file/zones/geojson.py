"""Zones from GeoJSON (RFC 7946): Polygons, Points and lines, whose sizes are in their properties or in the mission."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError, Mistake
from gcsplan.export.geojson import GENERATOR
from gcsplan.mission_file.zones.attributes import Attribute, ZoneStatements, is_number, read_attributes, shown
from gcsplan.mission_file.zones.draft import SIZE_KEYS
from gcsplan.mission_file.zones.file import EMPTY_CURE, Drawn, ZoneFile, drawn_unread
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.degree_shapes import beyond_outline

MOST_SHAPES = 1000
"""Most geometries of one feature."""

MOST_MISTAKES = 1000
"""Most mistakes of a file that are looked for."""


def read_geojson(path: Path, whole: Any) -> ZoneFile:
    """The zones of GeoJSON, as `load_json` returns it. Raises InputError if it is not GeoJSON.

    The coordinate system, and whether a server sent all of it, are looked at before (`contents`).
    """
    found = ZoneFile(path)
    if not isinstance(whole, dict):
        raise InputError("a GeoJSON file holds one object, for example a FeatureCollection", where=str(path))
    if str(whole.get("geometryType", "")).startswith("esri") or "rings" in whole:
        raise InputError(
            "this is Esri's JSON, not GeoJSON: ask the server for f=geojson, or convert it (ogr2ogr a.geojson FILE)",
            where=str(path),
        )
    features = whole.get("features") if whole.get("type") == "FeatureCollection" else [whole]
    if not isinstance(features, list) or not features:
        raise InputError("a FeatureCollection needs a list `features` that is not empty", where=str(path))
    flown = [_is_flown(whole, feature) for feature in features]
    for i, feature in enumerate(features):
        if len(found.problems) > MOST_MISTAKES:
            break  # they refuse the file
        where = f"{path}: features[{i}]" if whole.get("type") == "FeatureCollection" else f"{path}: feature"
        if not flown[i]:
            _feature(found, feature, where, f"{path.stem}[{i}]")
    if any(flown):
        found.own_notes.append(Note("tracks_unused", count=sum(flown)))
    return found


def _is_flown(whole: dict[str, Any], feature: Any) -> bool:
    """Whether a feature is a track or way point that gcsplan wrote beside the zones of its own mission.geojson.

    The collection has `GENERATOR`. Before it did, its tracks and way points had the reference of their heights.
    """
    properties = feature.get("properties") if isinstance(feature, dict) else None
    if not isinstance(properties, dict) or any(key.lower() in SIZE_KEYS for key in properties):
        return False
    before = "heights" in whole and properties.get("third_coordinate") == "amsl_m" and "vehicle" in properties
    geometry = feature.get("geometry")
    drawn = {"track": ("LineString", "MultiLineString"), "waypoint": ("Point",)}.get(str(properties.get("kind")), ())
    is_drawn = isinstance(geometry, dict) and geometry.get("type") in drawn
    return is_drawn and (whole.get("generator") == GENERATOR or before)


def _feature(found: ZoneFile, feature: Any, where: str, fallback: str) -> None:
    if not isinstance(feature, dict):
        found.problems.append(Mistake(where, f"must be a Feature or a geometry, given {shown(feature)}"))
        return
    geometry: Any = feature
    properties: Any = {}
    if feature.get("type") == "Feature":
        geometry = feature.get("geometry")
        properties = feature.get("properties") or {}
    if not isinstance(properties, dict) or not isinstance(geometry, dict | None):
        what = "properties must be an object" if not isinstance(properties, dict) else "the feature has no geometry"
        found.problems.append(Mistake(where, what))
        return
    stated = read_attributes(_attributes(properties, geometry or {}, where), where, fallback, found.problems)
    if stated is None:
        return
    shapes = _shapes(geometry, f"{where}.geometry" if geometry is not feature else where)
    if not shapes:
        found.unshaped.append(("empty", stated.name, Mistake(where, f"the feature has no geometry; {EMPTY_CURE}")))
    if len(shapes) > MOST_SHAPES:
        found.problems.append(Mistake(where, f"has more than {MOST_SHAPES} geometries; split it"))
        return
    for i, (shape, at) in enumerate(shapes):
        part = stated if len(shapes) == 1 else replace(stated, name=f"{stated.name}/{i + 1}")
        _geometry(found, shape, part, where, f"{at}.coordinates")


def _shapes(geometry: dict[str, Any] | None, at: str) -> list[tuple[Any, str]]:
    """The geometries in a geometry, a collection's too, each with its place; empty ones, and null, have none."""
    stack: list[tuple[Any, str]] = [(geometry, at)]
    shapes: list[tuple[Any, str]] = []
    while stack and len(shapes) <= MOST_SHAPES:
        one, place = stack.pop()
        inner = one.get("geometries") if isinstance(one, dict) and one.get("type") == "GeometryCollection" else None
        if isinstance(inner, list):
            stack += [(g, f"{place}.geometries[{k}]") for k, g in reversed(list(enumerate(inner)))]
        elif one is not None and not (isinstance(one, dict) and "type" in one and one.get("coordinates") == []):
            shapes.append((one, place))
    return shapes


def _geometry(found: ZoneFile, geometry: Any, stated: ZoneStatements, where: str, at: str) -> None:
    """Add what one geometry draws, which is no collection."""
    kind, coordinates = (geometry.get("type"), geometry.get("coordinates")) if isinstance(geometry, dict) else ("", "")
    if kind == "Point":
        centre = _position(found, coordinates, at)
        if centre is not None:
            found.add_circle(stated, stated.name, where, centre, _unread([coordinates]).remarks)
    elif kind in ("Polygon", "MultiPolygon"):
        for rings, part, place in _parts(found, coordinates, stated, at, kind):
            _rings(found, rings, stated, part, where, place)
    elif kind in ("LineString", "MultiLineString", "MultiPoint"):
        for one, part, place in _parts(found, coordinates, stated, at, kind):
            if kind == "MultiPoint":
                centre = _position(found, one, place)
                if centre is not None:
                    found.add_circle(stated, part, where, centre, _unread([one]).remarks)
            else:
                _line(found, one, stated, part, where, place)
    else:
        found.problems.append(
            Mistake(
                where, f"must be a Polygon, a Point with radius_m or a LineString with buffer_m, given {shown(kind)}"
            )
        )


def _parts(found: ZoneFile, coordinates: Any, stated: ZoneStatements, at: str, kind: str) -> list[tuple[Any, str, str]]:
    """The parts of a geometry, each with its name and place; one part unless the kind begins with Multi."""
    several = kind.startswith("Multi")
    parts = coordinates if several else [coordinates]
    if not isinstance(parts, list) or not parts:
        found.problems.append(Mistake(at, f"a {kind} needs a list of coordinates, given {shown(parts)}"))
        return []
    return [(part, f"{stated.name}/{i + 1}" if several else stated.name, f"{at}[{i}]" if several else at)
            for i, part in enumerate(parts)]  # fmt: skip


def _attributes(properties: dict[str, Any], geometry: dict[str, Any], where: str) -> list[Attribute]:
    """The attributes of the feature and of its ``layer``, where ED-318 has the limits of a zone."""
    given = [Attribute(key, value, f"{where}.properties.{key[:80]}") for key, value in properties.items()]
    layer = geometry.get("layer")
    if isinstance(layer, dict):
        given += [Attribute(key, value, f"{where}.geometry.layer.{key[:80]}") for key, value in layer.items()]
    return given


def _unread(positions: list[Any]) -> Drawn:
    """A remark on altitudes in positions: GeoJSON does not say whether they are a floor, a ceiling or ground."""
    return drawn_unread([p[2] for p in positions if len(p) > 2 and is_number(p[2]) and p[2] != 0])


def _rings(found: ZoneFile, rings: Any, stated: ZoneStatements, part: str, where: str, at: str) -> None:
    if not isinstance(rings, list) or not rings or not isinstance(rings[0], list):
        found.problems.append(Mistake(at, f"a polygon is a list of rings, given {shown(rings)}"))
        return
    outline = _positions(found, rings[0], f"{at}[0]")
    holes = [_positions(found, ring, f"{at}[{k}]") for k, ring in enumerate(rings[1:], 1) if isinstance(ring, list)]
    if len(holes) < len(rings) - 1:
        found.problems.append(Mistake(at, "a ring of a polygon is a list of positions, given something else"))
    elif outline is not None and (odd := beyond_outline(outline, [hole for hole in holes if hole])):
        found.problems.append(Mistake(at, f"zone {part[:60]!r}: {odd}"))
    elif outline is not None:
        found.add_ring(stated, part, where, outline, at.removeprefix(where).removeprefix("."), _unread(rings[0]),
                       holes=[hole for hole in holes if hole])  # fmt: skip


def _line(found: ZoneFile, positions: Any, stated: ZoneStatements, part: str, where: str, at: str) -> None:
    if not isinstance(positions, list):
        found.problems.append(Mistake(at, f"a line is a list of positions, given {shown(positions)}"))
        return
    line = _positions(found, positions, at)
    if line is not None:
        found.add_line(stated, part, where, line, at.removeprefix(where).removeprefix("."), _unread(positions).remarks)


def _positions(found: ZoneFile, positions: list[Any], at: str) -> list[tuple[float, float]] | None:
    """Every position as (latitude, longitude); None, and a problem, if one is none."""
    points = []
    for i, position in enumerate(positions):
        point = _position(found, position, f"{at}[{i}]")
        if point is None:
            return None
        points.append(point)
    return points


def _position(found: ZoneFile, position: Any, where: str) -> tuple[float, float] | None:
    """(latitude, longitude) of GeoJSON's [lon, lat]; None, and a problem, if it is not a position."""
    if not isinstance(position, list) or len(position) < 2 or not all(is_number(x) for x in position[:2]):
        found.problems.append(Mistake(where, f"a position is [longitude, latitude], given {shown(position)}"))
        return None
    lon, lat = float(position[0]), float(position[1])
    if abs(lat) > 90.0 and abs(lon) <= 90.0 and abs(lat) <= 180.0:
        found.problems.append(
            Mistake(where, f"longitude and latitude look swapped: GeoJSON is [lon, lat], given [{lon:g}, {lat:g}]")
        )
        return None
    return lat, lon
