"""The fence and the rally points of a `.plan` file: JSON to wire items, and back.

A circle is one item (5003 inclusion, 5004 exclusion; param1 is the radius), a polygon has one item per corner (5001
inclusion, 5002 exclusion; param1 is the number of corners), a rally point is one item (5100). ``inclusion: false``
marks an area to stay out of. Fence points are in frame 0: no autopilot accepts frame 2 for them or stores an altitude.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

from gcsplan.errors import InputError, Mistake
from gcsplan.mavlink.files.file_items import MAX_ITEMS, degrees_e7_of, float32_text, whole
from gcsplan.mavlink.mission.commands import CIRCLE_IN, CIRCLE_OUT, POLYGON_IN, POLYGON_OUT, RALLY_POINT
from gcsplan.mavlink.mission.mission import GLOBAL, RELATIVE, MissionItem
from gcsplan.notes.note import Note

MAX_PROBLEMS = 20

FENCE_VERSION = RALLY_VERSION = 2
FENCE_KEYS = frozenset({"circles", "polygons", "breachReturn"})
RALLY_KEYS = frozenset({"points"})
SHAPE_KEYS = {"circles": frozenset({"circle", "inclusion", "version"}),
              "polygons": frozenset({"polygon", "inclusion", "version"})}  # fmt: skip
CIRCLE_KEYS = frozenset({"center", "radius"})
SHAPE_VERSION = 1
RESAVE = "open the file in QGroundControl and save it again"


def json_number(value: float) -> float | int | None:
    """Return a float32 as a JSON number: null for NaN, whole numbers without a point."""
    if math.isnan(value):
        return None
    text = float32_text(value)
    return int(text) if text.lstrip("-").isdigit() and text != "-0" else float(text)


def json_float(value: object) -> float | None:
    """Return a JSON number as float, NaN for null, None for anything else."""
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf


def fence_json(fence: Sequence[MissionItem]) -> dict[str, Any]:
    """Return the ``geoFence`` object for wire items. Raises InputError for an incomplete polygon or another command."""
    circles, polygons = [], []
    rest = list(fence)
    while rest:
        first = rest[0]
        if first.command in (CIRCLE_IN, CIRCLE_OUT):
            shape = {"center": [first.lat_deg, first.lon_deg], "radius": json_number(first.params[0])}
            circles.append({"circle": shape, "inclusion": first.command == CIRCLE_IN, "version": 1})
            rest = rest[1:]
            continue
        count = whole(first.params[0], 3, len(rest))
        if first.command not in (POLYGON_IN, POLYGON_OUT) or count is None:
            raise InputError(f"a fence is made of whole polygons and circles, given command {first.command}")
        corners = [[v.lat_deg, v.lon_deg] for v in rest[:count]]
        polygons.append({"inclusion": first.command == POLYGON_IN, "polygon": corners, "version": 1})
        rest = rest[count:]
    return {"circles": circles, "polygons": polygons, "version": 2}


def rally_json(rally: Sequence[MissionItem]) -> dict[str, Any]:
    """Return the ``rallyPoints`` object for wire items."""
    return {"points": [[r.lat_deg, r.lon_deg, json_number(r.z)] for r in rally], "version": 2}


def fence_items(fence: object, where: str, notes: list[Note]) -> tuple[MissionItem, ...]:
    """Return the wire items of a ``geoFence``, none if it is missing. Raises InputError with every mistake found.

    At most `MAX_PROBLEMS` mistakes are collected.
    """
    if not isinstance(fence, dict) or fence.get("version", FENCE_VERSION) != FENCE_VERSION:
        return ()
    problems: list[Mistake] = []
    items: list[MissionItem] = []
    for kind in ("circles", "polygons"):
        for index, entry in enumerate(_list(fence.get(kind), f"{where}.{kind}", problems)):
            at = f"{where}.{kind}[{index}]"
            inside = entry.get("inclusion") if isinstance(entry, dict) else None
            if not isinstance(entry, dict) or not isinstance(inside, bool):
                problems.append(Mistake(at, "must be an object with inclusion true or false"))
            elif kind == "circles":
                items += _circle(entry.get("circle"), inside, at, problems)
            else:
                items += _polygon(entry.get("polygon"), inside, at, problems)
            if len(problems) >= MAX_PROBLEMS:
                raise InputError.of(problems)
    if problems:
        raise InputError.of(problems)
    if fence.get("breachReturn") is not None:
        notes.append(Note("plan_breach_return_unread"))
    return tuple(items)


def unread_keys(section: object, known: Collection[str], version: int, where: str) -> str:
    """The keys of a section of a plan that are not read: the unknown ones, or all, if its version is another.

    Empty if there are none; keys without a value count as nothing.
    """
    if section is None:
        return ""
    if not isinstance(section, dict):
        return f"{where} is no object" if section else ""
    keys = [key for key, value in section.items() if key != "version" and value not in (None, [], {}, "")]
    given = section.get("version", version)
    if given != version:
        return f"{where} of version {str(given)[:20]} ({', '.join(k[:40] for k in keys[:8])})" if keys else ""
    others = [f"{where}.{key[:40]}" for key in keys if key not in known]
    for kind, own in SHAPE_KEYS.items():
        entries = section.get(kind)
        for i, entry in enumerate(entries if kind in known and isinstance(entries, list) else []):
            inner = entry if isinstance(entry, dict) else {}
            others += [f"{where}.{kind}[{i}].{key[:40]}" for key in inner if key not in own]
            circle = inner.get("circle")
            within = circle if isinstance(circle, dict) else {}
            others += [f"{where}.{kind}[{i}].circle.{key[:40]}" for key in within if key not in CIRCLE_KEYS]
            if inner.get("version", SHAPE_VERSION) != SHAPE_VERSION:
                others.append(f"{where}.{kind}[{i}] of version {str(inner['version'])[:20]}")
    return ", ".join(others[:8])


def rally_items(rally: object, where: str) -> tuple[MissionItem, ...]:
    """Return the wire items of ``rallyPoints``, [latitude, longitude, metres above home] each. Raises InputError."""
    problems: list[Mistake] = []
    items: list[MissionItem] = []
    is_known = isinstance(rally, dict) and rally.get("version", RALLY_VERSION) == RALLY_VERSION
    points = _list(rally.get("points"), f"{where}.points", problems) if isinstance(rally, dict) and is_known else []
    for index, point in enumerate(points):
        at = f"{where}.points[{index}]"
        place = _place(point[:2] if isinstance(point, list) and len(point) == 3 else None, at, problems)
        height = json_float(point[2]) if isinstance(point, list) and len(point) == 3 else None
        if place is not None and (height is None or not math.isfinite(height)):
            problems.append(Mistake(at, "a rally point is [latitude, longitude, altitude above home]"))
        elif place is not None and height is not None:
            items.append(MissionItem(RALLY_POINT, RELATIVE, (0.0, 0.0, 0.0, 0.0), *place, height))
        if len(problems) >= MAX_PROBLEMS:
            break
    if problems:
        raise InputError.of(problems)
    return tuple(items)


def _list(value: object, where: str, problems: list[Mistake]) -> list[Any]:
    if value is None:
        return []
    if not isinstance(value, list) or len(value) > MAX_ITEMS:
        problems.append(Mistake(where, f"must be a list of {MAX_ITEMS} entries at most"))
        return []
    return value


def _place(value: object, where: str, problems: list[Mistake]) -> tuple[int, int] | None:
    numbers = [json_float(v) for v in value] if isinstance(value, list) and len(value) == 2 else []
    good = [n for n in numbers if n is not None and math.isfinite(n)]
    if len(good) != 2 or abs(good[0]) > 90.0 or abs(good[1]) > 180.0:
        problems.append(Mistake(where, f"must be [latitude, longitude] within ±90°, ±180°, given {str(value)[:60]}"))
        return None
    return degrees_e7_of(good[0]), degrees_e7_of(good[1])


def _circle(value: object, inside: bool, where: str, problems: list[Mistake]) -> list[MissionItem]:
    circle = value if isinstance(value, dict) else {}
    place = _place(circle.get("center"), f"{where}.circle.center", problems)
    radius_m = json_float(circle.get("radius"))
    if radius_m is None or not 0.0 < radius_m <= 1e7:
        text = str(circle.get("radius"))[:40]
        problems.append(Mistake(f"{where}.circle.radius", f"must be metres above 0, given {text}"))
        return []
    command = CIRCLE_IN if inside else CIRCLE_OUT
    return [MissionItem(command, GLOBAL, (radius_m, 0.0, 0.0, 0.0), *place)] if place is not None else []


def _polygon(value: object, inside: bool, where: str, problems: list[Mistake]) -> list[MissionItem]:
    corners = _list(value, f"{where}.polygon", problems)
    if len(corners) < 3:
        problems.append(Mistake(f"{where}.polygon", f"must have at least 3 corners, given {len(corners)}"))
        return []
    places = [_place(c, f"{where}.polygon[{i}]", problems) for i, c in enumerate(corners)]
    command, count = POLYGON_IN if inside else POLYGON_OUT, float(len(corners))
    return [MissionItem(command, GLOBAL, (count, 0.0, 0.0, 0.0), *p) for p in places if p is not None]
