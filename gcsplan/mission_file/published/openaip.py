"""Zones from openAIP's JSON: the answer of its service (``items``), a list of airspaces, or its GeoJSON export."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

from gcsplan.mission_file.published.members import MemberError, add_polygons, limit_of, read_features, text_of
from gcsplan.mission_file.published.policy import Policy, Published
from gcsplan.mission_file.published.times import ALWAYS, Period, TimeError, read_end, read_instant
from gcsplan.mission_file.published.volumes import AirspaceFile, Given, VolumeLimits
from gcsplan.mission_file.zones.attributes import is_number, shown
from gcsplan.mission_file.zones.draft import Remark
from gcsplan.mission_file.zones.file import ZoneFile
from gcsplan.notes.note import Note

TYPES = (
    "OTHER", "RESTRICTED", "DANGER", "PROHIBITED", "CTR", "TMZ", "RMZ", "TMA", "TRA", "TSA", "FIR", "UIR", "ADIZ",
    "ATZ", "MATZ", "AIRWAY", "MTR", "ALERT", "WARNING", "PROTECTED", "HTZ", "GLIDING_SECTOR", "TRP", "TIZ", "TIA",
    "MTA", "CTA", "ACC_SECTOR", "SPORTING", "OVERFLIGHT_RESTRICTION", "MRT", "TFR", "VFR_SECTOR", "FIS_SECTOR", "LTA",
    "UTA", "MCTR",
)  # fmt: skip
"""The types by openAIP's numbers, from 0."""

CLASSES = {0: "A", 1: "B", 2: "C", 3: "D", 4: "E", 5: "F", 6: "G", 8: "SUA"}
"""The ICAO classes by openAIP's numbers; 8 is an airspace without a class."""

OPENAIP_UNITS = {0: "M", 1: "FT", 6: "FL"}
DATUMS = {0: "GND", 1: "MSL", 2: "STD"}

FREE_TYPES = frozenset({"OTHER", "FIR", "UIR", "ACC_SECTOR", "VFR_SECTOR", "FIS_SECTOR", "TRP"})
FREE_CLASSES = frozenset({"G"})


def is_openaip(whole: Any) -> bool:
    """Whether the value is openAIP's: objects with its numbers for type and class, and limits that are objects."""
    return any(_is_airspace(_members(one)) for one in _airspaces(whole))


def _airspaces(whole: Any) -> list[Any]:
    key = "items" if isinstance(whole, dict) and "items" in whole else "features"
    found = whole.get(key) if isinstance(whole, dict) else whole
    return found if isinstance(found, list) else []


def _members(one: Any) -> dict[str, Any]:
    """The members of an airspace, which the export has below ``properties``."""
    if not isinstance(one, dict):
        return {}
    properties = one.get("properties")
    return properties if one.get("type") == "Feature" and isinstance(properties, dict) else one


def _is_airspace(members: dict[str, Any]) -> bool:
    return "icaoClass" in members and is_number(members.get("type")) and isinstance(members.get("upperLimit"), dict)


def read_openaip(path: Path, whole: Any, policy: Policy) -> ZoneFile:
    """The zones of openAIP's airspaces; mistakes are in their problems and faults."""
    file = AirspaceFile(path, policy, (*TYPES, *CLASSES.values()))
    key = "items" if isinstance(whole, dict) and "items" in whole else "features" if isinstance(whole, dict) else ""
    if isinstance(whole, dict) and is_number(whole.get("totalPages")) and whole["totalPages"] > 1:
        page, pages = whole.get("page"), whole["totalPages"]
        words = f"the file is page {page} of {pages}, and the zones of the others are missing; save all pages and name"
        file.refuse(f"{path}: totalPages", f"{words} each (or ask for a larger `limit`) and write totalPages as 1")
    return read_features(file, _airspaces(whole), key, _airspace)


def _airspace(file: AirspaceFile, one: Any, where: str, fallback: str) -> None:
    members = _members(one)
    name = text_of(members.get("name")) or fallback
    strange: list[str] = []
    kinds = (_named(members, "type", dict(enumerate(TYPES)), strange), _named(members, "icaoClass", CLASSES, strange))
    restricts = kinds[0] not in FREE_TYPES or kinds[1] not in FREE_CLASSES | {"SUA"}
    if kinds[0] == "OTHER" and kinds[1] == "SUA":
        restricts = True  # nothing says that it is free
    periods, remarks = _times(members)
    identifier, known = text_of(members.get("_id")), tuple(filter(None, kinds))
    zone = Published(name, known, restricts, identifier, periods, remarks, tuple(strange))
    limits = _limits(members, where, file.policy)
    geometry = one.get("geometry") if isinstance(one, dict) else None
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    try:
        if not isinstance(geometry, dict) or kind not in ("Polygon", "MultiPolygon"):
            raise MemberError(f"the geometry must be a Polygon, given {shown(kind)}")
        add_polygons(file, zone, name, where, geometry, limits)
    except MemberError as why:
        file.fault(where, f"zone {name[:60]!r}: {why}", zone)


def _named(members: dict[str, Any], key: str, names: dict[int, str], strange: list[str]) -> str:
    """The name of a number of openAIP's; empty if it has none, which goes to ``strange``."""
    value = members.get(key)
    if is_number(value) and value in names:
        return names[value]
    strange.append(f"{key} must be one of openAIP's numbers, given {shown(value)}")
    return ""


def _limits(members: dict[str, Any], where: str, policy: Policy) -> VolumeLimits:
    given: list[Given | None] = []
    floating: list[Remark] = []
    for side, farther in (("lower", "lowerLimitMin"), ("upper", "upperLimitMax")):
        limit = members.get(f"{side}Limit")
        if members.get(farther) is not None:
            floating.append((Note("zone_limits_move"), farther))
        if limit is None or members.get(farther) is not None:
            given.append(None)
            continue
        if not isinstance(limit, dict):
            given.append(limit_of(shown(limit), (), f"{side}Limit"))
            continue
        words = tuple(_code(limit, key, names) for key, names in (("unit", OPENAIP_UNITS), ("referenceDatum", DATUMS)))
        given.append(limit_of(limit.get("value"), words, f"{side}Limit"))
    found = VolumeLimits.read(given[0], given[1], where, policy=policy)
    found.remarks += floating
    return found


def _code(limit: dict[str, Any], key: str, names: dict[int, str]) -> str:
    value: Any = limit.get(key)
    if is_number(value):
        return names.get(value, f"{key} {value}")
    return str(value or "")[:40]


def _times(members: dict[str, Any]) -> tuple[tuple[Period, ...], tuple[Remark, ...]]:
    """The span of a temporary activation; the hours of a week are local, and are not read."""
    try:
        span = Period(_moment(members.get("activeFrom"), read_instant), _moment(members.get("activeUntil"), read_end))
    except TimeError as why:
        return (), ((Note("zone_activation_not_understood"), str(why)),)
    hours = members.get("hoursOfOperation")
    unread = any(_is_limited(h) for h in _hours(hours))
    remarks: tuple[Remark, ...] = ((Note("zone_hours_of_operation_unread"), None),) if unread else ()
    return (() if span == ALWAYS else (span,)), remarks


def _hours(given: Any) -> list[Any]:
    found = given.get("operatingHours") if isinstance(given, dict) else None
    return found if isinstance(found, list) else []


def _is_limited(line: Any) -> bool:
    return isinstance(line, dict) and (line.get("startTime"), line.get("endTime")) != ("00:00", "00:00")


def _moment(given: Any, read: Callable[[str], datetime]) -> datetime | None:
    if given is None or given == "":
        return None
    if not isinstance(given, str):
        raise TimeError(f"{shown(given)} is no time")
    return read(given)
