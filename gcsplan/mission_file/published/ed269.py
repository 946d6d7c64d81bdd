"""Zones from ED-269 JSON (EUROCAE, 2020): features with a restriction, times, authorities, and a list of volumes.

States also publish its members as the properties of GeoJSON, each zone with one volume: its limits stand among them,
and the feature's geometry is its projection.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gcsplan.mission_file.published.members import (
    MemberError,
    add_polygons,
    authority_of,
    limit_of,
    outer_ring,
    parts_of,
    position,
    read_features,
    text_of,
    unread,
)
from gcsplan.mission_file.published.policy import UNREAD_TIMES, Policy, Published
from gcsplan.mission_file.published.times import read_periods
from gcsplan.mission_file.published.volumes import AirspaceFile, Given, VolumeLimits
from gcsplan.mission_file.zones.attributes import is_number, shown
from gcsplan.mission_file.zones.draft import Remark
from gcsplan.mission_file.zones.file import ZoneFile
from gcsplan.notes.note import Note

RESTRICTIONS = ("PROHIBITED", "REQ_AUTHORISATION", "CONDITIONAL", "NO_RESTRICTION")
FREE_RESTRICTIONS = frozenset({"NO_RESTRICTION"})
ZONE_MEMBERS = frozenset({
    "identifier", "country", "name", "type", "restriction", "restrictionConditions", "region", "reason",
    "otherReasonInfo", "regulationExemption", "uSpaceClass", "message", "applicability", "zoneAuthority", "geometry",
    "extendedProperties", "limitedApplicability", "variant", "uspaceClass", "dataSource",
})  # fmt: skip
"""The members of a zone in ED-269 and ED-318."""

VOLUME = frozenset({
    "uomDimensions", "lowerLimit", "lowerVerticalReference", "upperLimit", "upperVerticalReference",
    "horizontalProjection",
})  # fmt: skip
SURE_MEMBERS = frozenset({
    "applicability", "zoneAuthority", "uSpaceClass", "regulationExemption", "restrictionConditions", "uomDimensions",
    "lowerVerticalReference", "upperVerticalReference",
})  # fmt: skip
"""Members that no other format has beside a restriction."""

SHAPE_MEMBERS = {"Circle": frozenset({"type", "center", "radius"}), "Polygon": frozenset({"type", "coordinates"})}


def is_ed269(whole: Any) -> bool:
    """Whether the value is an ED-269 document: its features' geometry is a list of volumes."""
    features = _list_of(whole)[1]
    return isinstance(features, list) and any(_volumes_of(f) for f in features)


def _list_of(whole: Any) -> tuple[str, Any]:
    """The list of zones and its name: ``features``, or ``UASZoneList`` in the standard's first version."""
    if not isinstance(whole, dict):
        return "features", whole
    key = "features" if "features" in whole else "UASZoneList"
    return key, whole.get(key)


def _volumes_of(feature: Any) -> bool:
    volumes = feature.get("geometry") if isinstance(feature, dict) else None
    return isinstance(volumes, list) and any(isinstance(v, dict) and "horizontalProjection" in v for v in volumes)


def read_ed269(path: Path, whole: Any, policy: Policy) -> ZoneFile:
    """The zones of an ED-269 document; mistakes are in their problems and faults."""
    key, features = _list_of(whole)
    file = AirspaceFile(path, policy, RESTRICTIONS, great_circles=True)
    if isinstance(whole, dict) and key == "features" and whole.get("UASZoneList"):
        file.refuse(f"{path}: UASZoneList", "the file has a list of features, too; write the zones of both into one")
    return read_features(file, features, key, _feature)


def _feature(file: AirspaceFile, feature: Any, where: str, fallback: str) -> None:
    if not isinstance(feature, dict):
        raise MemberError(f"must be an object, given {shown(feature)}")
    zone = published(feature, feature.get("restriction"), "restriction", feature.get("applicability"), fallback)
    volumes = feature.get("geometry")
    if not isinstance(volumes, list) or not volumes:
        words = f"zone {zone.name[:60]!r}: geometry must be a list of volumes, given {shown(volumes)}"
        file.fault(where, words, zone)
        return
    for i, volume in enumerate(volumes):
        part = zone.name if len(volumes) == 1 else f"{zone.name}/{i + 1}"
        at = f"{where}.geometry[{i}]"
        try:
            _volume(file, zone, part, volume, at)
        except MemberError as why:
            file.fault(at, f"zone {zone.name[:60]!r}: {why}", zone)


def is_ed269_geojson(whole: Any) -> bool:
    """Whether the value is GeoJSON whose features have a restriction, and another member that ED-269 alone has."""
    features = whole.get("features") if isinstance(whole, dict) and whole.get("type") == "FeatureCollection" else None
    given = [f.get("properties") for f in features if isinstance(f, dict)] if isinstance(features, list) else []
    return any(isinstance(p, dict) and "restriction" in p and not SURE_MEMBERS.isdisjoint(p) for p in given)


def read_ed269_geojson(path: Path, whole: Any, policy: Policy) -> ZoneFile:
    """The zones of GeoJSON with the properties of ED-269; mistakes are in their problems and faults."""
    return read_features(AirspaceFile(path, policy, RESTRICTIONS), whole["features"], "features", _geojson_feature)


def _geojson_feature(file: AirspaceFile, feature: Any, where: str, fallback: str) -> None:
    properties = feature.get("properties") if isinstance(feature, dict) else None
    if not isinstance(properties, dict):
        raise MemberError(f"must be a Feature with properties, given {shown(feature)}")
    times, known = properties.get("applicability"), ZONE_MEMBERS | VOLUME
    zone = published(properties, properties.get("restriction"), "restriction", times, fallback, known)
    geometry = feature.get("geometry")
    try:
        for part, one in parts_of(geometry, zone.name):
            add_polygons(file, zone, part, where, one, _limits(file, properties, where))
    except MemberError as why:
        file.fault(where, f"zone {zone.name[:60]!r}: {why}", zone)


def published(
    feature: dict[str, Any], kind: Any, key: str, times: Any, fallback: str, known: frozenset[str] = ZONE_MEMBERS
) -> Published:
    """A zone's members that ED-269 and ED-318 share; a remark names those that are not ``known`` and seem to limit."""
    identifier = text_of(feature.get("identifier"))
    name = text_of(feature.get("name")) or identifier or fallback
    restriction, strange = (kind.strip().upper(), ()) if isinstance(kind, str) and kind.strip() else ("", (
        f"{key} must be text, given {shown(kind)}",))  # fmt: skip
    periods, why = read_periods(times)
    remarks: list[Remark] = [(UNREAD_TIMES, why)] if why else []
    remarks += unread(feature, known)
    if restriction in ("REQ_AUTHORISATION", "REQ_AUTHORIZATION"):
        remarks.append((Note("zone_needs_authorisation"), authority_of(feature.get("zoneAuthority"))))
    elif restriction == "CONDITIONAL":
        conditions = feature.get("restrictionConditions")
        joined = ", ".join(str(c) for c in conditions) if isinstance(conditions, list) else text_of(conditions)
        remarks.append((Note("zone_conditions_not_judged"), joined[:60]))
    kinds = (restriction,) if restriction else ()
    return Published(name, kinds, restriction not in FREE_RESTRICTIONS, identifier, periods, tuple(remarks), strange)


def _volume(file: AirspaceFile, zone: Published, part: str, volume: Any, where: str) -> None:
    shape = volume.get("horizontalProjection") if isinstance(volume, dict) else None
    if not isinstance(shape, dict):
        raise MemberError(f"a volume has a horizontalProjection, given {shown(volume)}")
    limits = _limits(file, volume, where)
    kind = shape.get("type")
    limits.remarks += unread(volume, VOLUME, all_of_them=True)
    limits.remarks += unread(shape, SHAPE_MEMBERS.get(str(kind), ()), all_of_them=True)
    if kind == "Circle":
        radius: Any = shape.get("radius")
        if not is_number(radius):
            raise MemberError(f"a Circle has a radius in metres, given {shown(radius)}")
        # Published circles have metres beside limits in feet; a radius in feet would be smaller.
        file.add_circle(zone, part, where, position(shape.get("center")), float(radius), limits)
    elif kind == "Polygon":
        ring, holes = outer_ring(shape.get("coordinates"))
        file.add_ring(zone, part, where, ring, limits, holes)
    else:
        raise MemberError(f"horizontalProjection must be a Polygon or a Circle, given {shown(kind)}")


def _limits(file: AirspaceFile, volume: dict[str, Any], where: str) -> VolumeLimits:
    unit = volume.get("uomDimensions") or ""
    return VolumeLimits.read(_limit(volume, "lower", unit), _limit(volume, "upper", unit), where, policy=file.policy)


def _limit(volume: dict[str, Any], side: str, unit: Any) -> Given | None:
    """The limit of one side; without a number there is none."""
    reference = volume.get(f"{side}VerticalReference") or ""
    return limit_of(volume.get(f"{side}Limit"), (str(unit)[:40], str(reference)[:40]), f"{side}Limit")
