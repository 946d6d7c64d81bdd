"""Zones from ED-318 JSON (EUROCAE, 2023): GeoJSON whose geometries have a ``layer`` of limits, and Points an extent.

States publish its members in other layouts, which `standard_properties` brings to the standard's own. ENAIRE (Spain)
publishes two: ``UASZone`` and ``verticalLayer`` beside each other, and one flat table. In both, an empty
text means that there is no value.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gcsplan.errors import Mistake
from gcsplan.mission_file.published.ed269 import published
from gcsplan.mission_file.published.members import (
    MOST_GEOMETRIES,
    MemberError,
    add_polygons,
    limit_of,
    position,
    read_features,
    unread,
)
from gcsplan.mission_file.published.policy import Policy, Published
from gcsplan.mission_file.published.volumes import AirspaceFile, Given, VolumeLimits
from gcsplan.mission_file.zones.attributes import is_number, shown
from gcsplan.mission_file.zones.file import ZoneFile

ZONE_TYPES = ("USPACE", "PROHIBITED", "REQ_AUTHORIZATION", "CONDITIONAL", "NO_RESTRICTION")
REQUIRED = frozenset({"identifier", "country", "type", "variant"})
GEOMETRY_MEMBERS = frozenset({"type", "coordinates", "layer", "bbox"})
LAYER_MEMBERS = frozenset({"lower", "lowerReference", "upper", "upperReference", "uom"})


def is_ed318(whole: Any) -> bool:
    """Whether the value is an ED-318 collection, or one feature: with the members that the standard requires."""
    return any(_required(f) for f in _features(whole))


def _features(whole: Any) -> list[Any]:
    if not isinstance(whole, dict):
        return []
    features = [whole] if whole.get("type") == "Feature" else whole.get("features")
    return features if isinstance(features, list) and whole.get("type") in ("Feature", "FeatureCollection") else []


def _required(feature: Any) -> bool:
    properties = feature.get("properties") if isinstance(feature, dict) else None
    if not isinstance(properties, dict):
        return False
    zone = properties.get(ZONE)
    return (zone if isinstance(zone, dict) else properties).keys() >= REQUIRED


def read_ed318(path: Path, whole: Any, policy: Policy) -> ZoneFile:
    """The zones of an ED-318 collection; mistakes are in their problems and faults."""
    return read_features(AirspaceFile(path, policy, ZONE_TYPES), _features(whole), "features", _feature)


def _feature(file: AirspaceFile, feature: Any, where: str, fallback: str) -> None:
    properties = feature.get("properties") if isinstance(feature, dict) else None
    if not isinstance(properties, dict):
        raise MemberError(f"must be a Feature with properties, given {shown(feature)}")
    properties, own = standard_properties(properties)
    times = properties.get("limitedApplicability")
    zone = published(properties, properties.get("type"), "type", times, fallback)
    geometry = feature.get("geometry")
    whole: Any = [geometry]
    if isinstance(geometry, dict) and geometry.get("type") == "GeometryCollection":
        whole = geometry.get("geometries")
        if not isinstance(whole, list) or not 0 < len(whole) <= MOST_GEOMETRIES:
            words = f"zone {zone.name[:60]!r}: a GeometryCollection has geometries, given {shown(whole)}"
            file.fault(where, words, zone)
            return
    for i, one in enumerate(whole):
        part = zone.name if len(whole) == 1 else f"{zone.name}/{i + 1}"
        at = f"{where}.geometry" if one is geometry else f"{where}.geometry.geometries[{i}]"
        # A geometry without a layer has the layer of its collection, or else of the feature.
        layer = geometry.get("layer", own) if isinstance(geometry, dict) else None
        try:
            _geometry(file, zone, part, one, layer, at)
        except MemberError as why:
            file.fault(at, f"zone {zone.name[:60]!r}: {why}", zone)


def _geometry(file: AirspaceFile, zone: Published, part: str, geometry: Any, shared: Any, where: str) -> None:
    if not isinstance(geometry, dict):
        raise MemberError(f"the zone has no geometry, given {shown(geometry)}")
    limits = _limits(geometry.get("layer", shared), where, file.policy)
    kind = geometry.get("type")
    limits.remarks += unread(geometry, GEOMETRY_MEMBERS | ({"extent"} if kind == "Point" else set()), all_of_them=True)
    if kind == "Point":
        extent = geometry.get("extent")
        radius: Any = None
        if isinstance(extent, dict) and extent.get("subType") == "Circle":
            radius = extent.get("radius")
        if not is_number(radius):
            raise MemberError(f"a Point has an extent with subType Circle and radius, given {shown(extent)}")
        file.add_circle(zone, part, where, position(geometry.get("coordinates")), float(radius), limits)
    elif kind in ("Polygon", "MultiPolygon"):
        add_polygons(file, zone, part, where, geometry, limits)
    else:
        raise MemberError(f"the geometry must be a Polygon, a MultiPolygon or a Point with extent, given {shown(kind)}")


def _limits(layer: Any, where: str, policy: Policy) -> VolumeLimits:
    """The limits of a layer; without one there are none, and without a unit they are metres, as the standard says."""
    if layer is None:
        return VolumeLimits()
    if not isinstance(layer, dict):
        return VolumeLimits(faults=[Mistake(where, f"layer must be an object, given {shown(layer)}")])
    unit = layer.get("uom") or "m"
    remarks = unread(layer, LAYER_MEMBERS, all_of_them=True)
    given: list[Given | None] = []
    for side in ("lower", "upper"):
        words = (str(unit)[:40], str(layer.get(f"{side}Reference") or "")[:40])
        given.append(limit_of(layer.get(side), words, side))
    found = VolumeLimits.read(given[0], given[1], where, policy=policy)
    found.remarks += remarks
    return found


ZONE, LAYER = "UASZone", "verticalLayer"
_LIMITS = ("lower", "lowerReference", "upper", "upperReference", "uom", "UOM")
_PERIOD = ("startDateTime", "endDateTime")
_DAILY = ("day", "startTime", "startEvent", "endTime", "endEvent")
_AUTHORITY = ("purpose", "intervalBefore", "service", "contactName", "siteURL", "email", "phone")


def standard_properties(given: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """The properties of a feature as ED-318 has them, and its layer of limits if that stands among them."""
    zone = given.get(ZONE)
    whole = {k: v for k, v in given.items() if k != ZONE} | zone if isinstance(zone, dict) else dict(given)
    layer = whole.pop(LAYER) if isinstance(whole.get(LAYER), dict) else _group(whole, _LIMITS)
    if layer is not None:
        layer = {k.lower() if k == "UOM" else k: v for k, v in layer.items() if not _empty(v)}
    if "limitedApplicability" not in whole and (daily := _group(whole, _DAILY)) is not None:
        whole["limitedApplicability"] = [(_group(whole, _PERIOD) or {}) | {"schedule": [daily]}]
    if "zoneAuthority" not in whole and (authority := _group(whole, _AUTHORITY)) is not None:
        whole["zoneAuthority"] = [authority | {"name": whole.get("name_authority")}]
    return whole, layer


def _group(whole: dict[str, Any], keys: tuple[str, ...]) -> dict[str, Any] | None:
    found = {k: whole[k] for k in keys if k in whole}
    return found or None


def _empty(given: Any) -> bool:
    return isinstance(given, str) and not given.strip()
