"""`mission.geojson` (RFC 7946): tracks, way points, no-fly zones and keep-in areas, with the mission file's names.

The zones can be read back as ``no_fly: [{file: mission.geojson}]``: they are the features with ``kind: no_fly``, and
those with ``kind: keep_in`` are read as areas to stay in. Shapes that cross the antimeridian are cut there (section
3.1.9).
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.export.rows import HEIGHT_DECIMALS, FlownTrack, WayPoint, areas_deg, outlines_deg
from gcsplan.figures import floored
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import KeepIn, Level, Zone, keep_in_of, no_fly_of

Position = list[float]

GENERATOR = "gcsplan"
"""The mark of the collection, by which its tracks and way points are known where it is read for its zones."""

HEIGHT_DATUM = "the third coordinate is metres above mean sea level (AMSL), not above the ellipsoid"
THIRD = {"third_coordinate": "amsl_m"}


def write_geojson(name: str, tracks: Sequence[FlownTrack], zones: Sequence[Zone], frame: Frame) -> str:
    """The GeoJSON text of a mission called ``name``: a FeatureCollection; the same input gives the same bytes.

    Positions are longitude, latitude, and for tracks and way points AMSL metres, although RFC 7946 has heights above
    the ellipsoid: `HEIGHT_DATUM` and each feature's ``third_coordinate`` say so. A way point has its item's ``number``
    and ``command``, ``amsl_m``, ``agl_m``, and ``ellipsoidal_m`` if a geoid grid is known. A zone's floor and ceiling
    are the mission file's ``floor_agl_m``, ``floor_amsl_m``, ``ceiling_agl_m``, ``ceiling_amsl_m``.
    """
    features: list[dict[str, Any]] = []
    for track in tracks:
        features.append(_feature(_line(track), {"kind": "track", "vehicle": track.vehicle, **THIRD}))
    for track in tracks:
        for index, point in enumerate(track.waypoints):
            if point is not None:
                place = _position(track.lon_deg[index], track.lat_deg[index], track.amsl_m[index])
                about = {"kind": "waypoint", "vehicle": track.vehicle, **_figures(point, float(track.amsl_m[index]))}
                features.append(_feature({"type": "Point", "coordinates": place}, about))
    no_fly = no_fly_of(zones)
    for zone, ring in zip(no_fly, outlines_deg(no_fly, frame), strict=True):
        about = {"kind": "no_fly", "name": zone.name, **_levels(zone)}
        features.append(_feature(area_geometry([ring]), about))
    for area, rings in areas_deg(keep_in_of(zones), frame):
        about = {"kind": "keep_in", "name": area.name, **_levels(area)}
        features.append(_feature(area_geometry(rings) if len(rings) == 1 else _with_holes(rings), about))
    document = {
        "type": "FeatureCollection",
        "name": name,
        "generator": GENERATOR,
        "heights": HEIGHT_DATUM,
        "features": features,
    }
    return json.dumps(document, ensure_ascii=False) + "\n"


def _figures(point: WayPoint, amsl_m: float) -> dict[str, Any]:
    """The properties of a way point; unknown ones are left out."""
    about = {
        "name": point.name,
        "number": point.number,
        "command": point.command,
        "amsl_m": round(amsl_m, HEIGHT_DECIMALS),
        "agl_m": floored(point.agl_m, HEIGHT_DECIMALS) if math.isfinite(point.agl_m) else None,
        "ellipsoidal_m": None if point.geoid_m is None else round(amsl_m + point.geoid_m, HEIGHT_DECIMALS),
        **THIRD,
    }
    return {key: value for key, value in about.items() if value is not None}


def _feature(geometry: dict[str, Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def _with_holes(rings: Sequence[Floats]) -> dict[str, Any]:
    """A polygon with holes; one that crosses the antimeridian goes past it."""
    turned = [np.stack([_unwrapped(np.append(rings[0][:1, 1], ring[:, 1]))[1:], ring[:, 0]], axis=-1) for ring in rings]
    closed = [np.vstack([ring, ring[:1]]) for ring in turned]
    return {"type": "Polygon", "coordinates": [[_position(lon, lat) for lon, lat in ring.tolist()] for ring in closed]}


def _levels(zone: Zone | KeepIn) -> dict[str, float]:
    def entry(side: str, level: Level | None) -> dict[str, float]:
        return {} if level is None else {f"{side}_{level.datum}_m": float(level.value_m)}

    return {**entry("floor", zone.floor), **entry("ceiling", zone.ceiling)}


def _position(lon_deg: float, lat_deg: float, amsl_m: float | None = None) -> Position:
    place = [round(float(lon_deg), 7), round(float(lat_deg), 7)]
    return place if amsl_m is None else [*place, round(float(amsl_m), HEIGHT_DECIMALS)]


def _unwrapped(lon_deg: Floats) -> Floats:
    """Longitudes without the jump at ±180°: each is within half a turn of the one before."""
    steps = (np.diff(lon_deg) + 180.0) % 360.0 - 180.0
    return np.concatenate([lon_deg[:1], lon_deg[0] + np.cumsum(steps)])


def _line(track: FlownTrack) -> dict[str, Any]:
    points = np.stack([track.lon_deg, track.lat_deg, track.amsl_m], axis=-1)
    points[:, 0] = _unwrapped(points[:, 0])
    parts: list[list[Position]] = [[]]
    turn = _turn(points[0, 0], points[1, 0])
    for a, b in pairwise(points):
        parts[-1].append(_position(a[0] - 360.0 * turn, a[1], a[2]))
        beyond = _turn(b[0], a[0])
        if beyond != turn:
            seam = 180.0 + 360.0 * min(turn, beyond)
            at = a + (b - a) * ((seam - a[0]) / (b[0] - a[0]))
            parts[-1].append(_position(seam - 360.0 * turn, at[1], at[2]))
            parts.append([_position(seam - 360.0 * beyond, at[1], at[2])])
            turn = beyond
    parts[-1].append(_position(points[-1, 0] - 360.0 * turn, points[-1, 1], points[-1, 2]))
    if len(parts) == 1:
        return {"type": "LineString", "coordinates": parts[0]}
    return {"type": "MultiLineString", "coordinates": parts}


def _turn(lon_deg: float, towards_deg: float) -> int:
    """The turn around the Earth that an unwrapped longitude is in; on the seam, that on the side of ``towards_deg``."""
    turn = int(np.floor((lon_deg + 180.0) / 360.0))
    on_seam = (lon_deg + 180.0) % 360.0 == 0.0
    return turn - 1 if on_seam and towards_deg < lon_deg else turn


def area_geometry(rings: Sequence[Floats]) -> dict[str, Any]:
    """The areas in rings, (N, 2) each, latitude and longitude; one that crosses the antimeridian is cut there."""
    polygons = []
    for ring in rings:
        points = np.stack([_unwrapped(np.append(ring[:, 1], ring[0, 1]))[:-1], ring[:, 0]], axis=-1)
        low, high = points[:, 0].min(), points[:, 0].max()
        for turn in range(_turn(low, high), _turn(high, low) + 1):
            west, east = 360.0 * turn - 180.0, 360.0 * turn + 180.0
            part = _clip(_clip(points, west, keep_east=True), east, keep_east=False)
            corners = [[round(lon, 7), round(lat, 7)] for lon, lat in (part - (360.0 * turn, 0.0)).tolist()]
            if len({lon for lon, _ in corners}) >= 2:  # leave out parts without width at the seam
                polygons.append([[*corners, corners[0]]])
    if len(polygons) == 1:
        return {"type": "Polygon", "coordinates": polygons[0]}
    return {"type": "MultiPolygon", "coordinates": polygons}


def _clip(points: Floats, lon_deg: float, *, keep_east: bool) -> Floats:
    """The part of a ring on one side of a meridian (Sutherland and Hodgman 1974)."""
    side = (points[:, 0] - lon_deg) * (1.0 if keep_east else -1.0)
    if (side >= 0).all():
        return points
    kept = []
    for i in range(len(points)):
        j = (i + 1) % len(points)
        if side[i] >= 0:
            kept.append(points[i])
        if side[i] * side[j] < 0:
            at = points[i] + (points[j] - points[i]) * (side[i] / (side[i] - side[j]))
            kept.append(np.array([lon_deg, at[1]]))
    return np.array(kept).reshape(-1, 2)
