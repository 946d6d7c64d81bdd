"""The places of a mission's vehicles, for the map; in whatever form the file has them."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

from pydantic import TypeAdapter, ValidationError

from gcsplan.mission_file.values.places import Degrees, read_place
from gcsplan.mission_file.values.point_keys import LocalPoint, ViaPoint
from gcsplan.page.history import EditedDocument
from gcsplan.page.refused import PageError
from gcsplan.world.geodesy.frame import Frame

SAME_DEG = 5e-8
"""Degrees within which a place that the page sends back is the file's own."""

LatLon = list[float]


def read_text(text: object) -> LatLon:
    """A place that a user typed. Raises PageError."""
    try:
        found = read_place(text if isinstance(text, str) else "")
    except ValueError as why:
        raise PageError(str(why), code="bad_change", where="place") from None
    return [found.lat_deg, found.lon_deg]


def place_of(value: Any, frame: Frame | None) -> LatLon | None:
    """Latitude and longitude of a place of the document; None if it cannot be one."""
    try:
        point = _points().validate_python(value)
    except (ValidationError, ValueError):
        return None
    if isinstance(point, LocalPoint):
        return None if frame is None else [float(x) for x in frame.to_degrees(point.east_m, point.north_m)]
    on_earth = isinstance(point, Degrees) and abs(point.lat_deg) <= 90.0 and abs(point.lon_deg) <= 180.0
    return [point.lat_deg, point.lon_deg] if on_earth else None


def vehicles_of(document: EditedDocument, frame: Frame | None) -> list[dict[str, Any]]:
    """Each vehicle's name, autopilot and places; without a vehicle that is no mapping."""
    found = []
    vehicles = document.get("vehicles")
    for k, one in enumerate(vehicles if isinstance(vehicles, list) else []):
        if not isinstance(one, dict):
            continue
        via = one.get("via")
        places = [place_of(v, frame) for v in via] if isinstance(via, list) else []
        found.append({
            "key": f"vehicles[{k}]", "name": str(one.get("name", "")), "sysid": one.get("sysid"),
            "autopilot": str(one.get("autopilot", "")),
            "start": place_of(one.get("start"), frame), "goal": place_of(one.get("goal"), frame),
            "via": [p for p in places if p is not None], "editable": frame is None and None not in places,
        })  # fmt: skip
    return found


def with_heights(old: Any, new: Any) -> Any:
    """The vias of a message as they stand in the file: one that did not move is the file's own value, and one that
    moved keeps its height."""
    if not isinstance(old, list) or not isinstance(new, list):
        return new
    places = [place_of(value, None) for value in old]
    return [_with_height(old, places, k, value, len(new)) for k, value in enumerate(new)]


def _with_height(old: list[Any], places: list[LatLon | None], k: int, value: Any, count: int) -> Any:
    here = place_of(value, None)
    for own, place in zip(old, places, strict=True):
        if here is not None and place is not None and math.dist(here, place) < SAME_DEG:
            return own
    moved = old[k] if count == len(old) else None
    if here is not None and isinstance(moved, dict) and "agl_m" in moved:
        return {"lat": here[0], "lon": here[1], "agl_m": moved["agl_m"]}
    return value


@cache
def _points() -> TypeAdapter[Any]:
    return TypeAdapter(ViaPoint)
