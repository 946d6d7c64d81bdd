"""Zones from ED-269 JSON (EUROCAE, 2020): features with a restriction, times, authorities, and a list of volumes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gcsplan.mission_file.published.members import (
    MemberError,
    authority_of,
    number_or_none,
    outer_ring,
    position,
    read_features,
    text_of,
    unread,
    word,
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
        file.fault(f"{path}: UASZoneList", "the file has a list of features, too; write the zones of both into one")
    return read_features(file, features, key, _feature)


def _feature(file: AirspaceFile, feature: Any, where: str, fallback: str) -> None:
    if not isinstance(feature, dict):
        raise MemberError(f"must be an object, given {shown(feature)}")
    zone = published(feature, feature.get("restriction"), "restriction", feature.get("applicability"), fallback)
    volumes = feature.get("geometry")
    if not isinstance(volumes, list) or not volumes:
        raise MemberError(f"zone {zone.name[:60]!r}: geometry must be a list of volumes, given {shown(volumes)}")
    for i, volume in enumerate(volumes):
        part = zone.name if len(volumes) == 1 else f"{zone.name}/{i + 1}"
        at = f"{where}.geometry[{i}]"
        try:
            _volume(file, zone, part, volume, at)
        except MemberError as why:
            file.fault(at, f"zone {zone.name[:60]!r}: {why}")


def published(feature: dict[str, Any], kind: Any, key: str, times: Any, fallback: str) -> Published:
    """A zone's members that ED-269 and ED-318 share. Raises MemberError."""
    identifier = text_of(feature.get("identifier"))
    name = text_of(feature.get("name")) or identifier or fallback
    restriction = word(kind, f"zone {name[:60]!r}: {key}").upper()
    periods, why = read_periods(times)
    remarks: list[Remark] = [(UNREAD_TIMES, why)] if why else []
    remarks += unread(feature, ZONE_MEMBERS)
    if restriction in ("REQ_AUTHORISATION", "REQ_AUTHORIZATION"):
        remarks.append((Note("zone_needs_authorisation"), authority_of(feature.get("zoneAuthority"))))
    elif restriction == "CONDITIONAL":
        conditions = feature.get("restrictionConditions")
        joined = ", ".join(str(c) for c in conditions) if isinstance(conditions, list) else text_of(conditions)
        remarks.append((Note("zone_conditions_not_judged"), joined[:60]))
    return Published(name, (restriction,), restriction not in FREE_RESTRICTIONS, identifier, periods, tuple(remarks))


def _volume(file: AirspaceFile, zone: Published, part: str, volume: Any, where: str) -> None:
    shape = volume.get("horizontalProjection") if isinstance(volume, dict) else None
    if not isinstance(shape, dict):
        raise MemberError(f"a volume has a horizontalProjection, given {shown(volume)}")
    unit = volume.get("uomDimensions") or ""
    limits = VolumeLimits.read(_limit(volume, "lower", unit), _limit(volume, "upper", unit), where, policy=file.policy)
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


def _limit(volume: dict[str, Any], side: str, unit: Any) -> Given | None:
    """The limit of one side; without a number there is none."""
    value = number_or_none(volume.get(f"{side}Limit"), f"{side}Limit")
    if value is None:
        return None
    reference = volume.get(f"{side}VerticalReference") or ""
    return Given(value, (str(unit)[:40], str(reference)[:40]), (), f"{side}Limit")
