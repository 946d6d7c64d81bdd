"""The forms of the page, made from the JSON Schema of the mission file, and the keys that the page may change.

The short form has the limits and settings that most missions change, under names for people. The form of a section has
every key of it; the few that only the text of the mission can change are shown with the reason.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, Literal

from gcsplan.dem.sources import SOURCES
from gcsplan.errors import InputError, LimitValues, Mistake
from gcsplan.mission_file.json_schema import mission_schema
from gcsplan.mission_file.source import is_sample
from gcsplan.mission_file.values.document import flow
from gcsplan.mission_file.values.units import UNIT_SYMBOLS, Written, other_names, unit_end
from gcsplan.mission_file.values.yaml import lines_of, read_yaml
from gcsplan.page.fleet.crew_changes import is_crew_key
from gcsplan.page.history import EditedDocument
from gcsplan.page.refused import PageError
from gcsplan.units import Kind

FormGroup = Literal["limits", "vehicle", "planner"]

MOST_CHANGES = 100
"""Most keys of one message."""

MOST_ENTRIES = 200
"""Most entries of a list that have a row each."""

MOST_FIELD_TEXT = 100_000
"""Most characters of a value that is typed as YAML."""

A_VEHICLE = "vehicles[]"
SHORT_FORM: tuple[tuple[FormGroup, str, str, str], ...] = (
    ("limits", "limits", "min_agl_m", "Lowest height above ground"),
    ("limits", "limits", "max_agl_m", "Legal ceiling above ground"),
    ("limits", "limits", "max_amsl_m", "Greatest altitude above sea level"),
    ("limits", "limits", "horizontal_clearance_m", "Horizontal clearance"),
    ("limits", "limits", "vertical_clearance_m", "Vertical clearance of zones"),
    ("limits", "limits", "track_error_m", "Track error"),
    ("limits", "limits", "altitude_error_m", "Altitude error"),
    ("limits", "limits", "max_climb_deg", "Steepest climb"),
    ("limits", "terrain", "obstacle_height_m", "Trees and buildings"),
    ("vehicle", A_VEHICLE, "name", "Name"),
    ("vehicle", A_VEHICLE, "autopilot", "Autopilot"),
    ("vehicle", A_VEHICLE, "end", "At the goal"),
    ("vehicle", A_VEHICLE, "rtl_rel_home_m", "Return altitude above home"),
    ("vehicle", A_VEHICLE, "takeoff_agl_m", "Top of the take-off"),
    ("vehicle", A_VEHICLE, "approach_agl_m", "Height above the goal"),
    ("vehicle", A_VEHICLE, "climb_m_s", "Fastest climb rate"),
    ("vehicle", A_VEHICLE, "descent_m_s", "Fastest descent rate"),
    ("vehicle", A_VEHICLE, "turn_radius_m", "Turn radius of a fixed wing"),
    ("planner", "planner", "objective", "Shortest, least energy or fastest"),
    ("planner", "planner", "gap_percent", "Gap at which planning stops"),
    ("planner", "planner", "budget_s", "Longest search"),
)
"""Group, section, key and name for people, in the order shown."""

SECTIONS: Mapping[str, str] = {
    "": "", "terrain": "TerrainKeys", "limits": "LimitKeys", "vehicles[]": "VehicleKeys",
    "vehicles[].limits": "LimitKeys", "vehicles[].energy": "EnergyKeys", "wind": "WindKeys",
    "arrival": "ArrivalKeys", "planner": "PlannerKeys", "frame": "FrameKeys", "no_fly[]": "ZoneKeys",
    "keep_in[]": "ZoneKeys",
}  # fmt: skip
"""The sections that have a form, each with its part of the schema."""

MAY_GO = ("limits", "vehicles[].limits", "vehicles[].energy", "wind", "arrival", "planner", "frame")
"""Sections that a mission does without."""

FILE_NAMED = "it names a file: drop the file on the page, or write its name in the YAML"
YAML_ONLY: Mapping[tuple[str, str], str] = {
    ("", "version"): "there is one version of the format",
    ("TerrainKeys", "dem"): FILE_NAMED, ("TerrainKeys", "canopy"): FILE_NAMED,
    ("TerrainKeys", "geoid_grid"): FILE_NAMED, ("ZoneKeys", "file"): FILE_NAMED, ("WindKeys", "forecast"): FILE_NAMED,
    ("VehicleKeys", "link"): "an upload goes there: write it in the YAML",
}  # fmt: skip
"""Keys that no form changes, by part of the schema and name, each with the reason."""

HEIGHT_WORDS = ("agl", "amsl", "height", "rel_home", "altitude", "vertical")
CLIMB_WORDS = ("climb", "descent", "land")

_NUMBERS = re.compile(r"\[\d{1,6}\]")
_ZONE = re.compile(r"(?:no_fly|keep_in)\[\d{1,6}\]")


# -- fields -----------------------------------------------------------------------------------------------------------


@cache
def _schema() -> Mapping[str, Any]:
    return mission_schema()


@cache
def keys_of(part: str) -> Mapping[str, Mapping[str, Any]]:
    """The keys of a part of the schema (empty: the whole) under their own names, with what the schema says of each."""
    whole = _schema()
    own: dict[str, Any] = whole["properties"] if not part else whole["$defs"][part]["properties"]
    others = other_names(own)
    return {key: entry for key, entry in own.items() if key not in others and not _is_section(part, key)}


def _is_section(part: str, key: str) -> bool:
    """Whether a key has a form of its own, or several."""
    inside = [place.rpartition(".") for place, one in SECTIONS.items() if place]
    return any(name.removesuffix("[]") == key and SECTIONS[outer] == part for outer, _, name in inside)


def part_of(section: str) -> str | None:
    """The part of the schema of a section such as ``vehicles[2].energy``; None if it has no form."""
    return SECTIONS.get(_NUMBERS.sub("[]", section))


def section_form(section: object, document: EditedDocument, problems: Sequence[Mistake]) -> dict[str, Any]:
    """The fields of a section, and whether it is there and may go. Raises PageError."""
    part = part_of(section) if isinstance(section, str) else None
    if part is None or not isinstance(section, str):
        raise PageError("this is no section with a form", code="bad_message", where="section")
    found = _section(document, section)
    fields = [_field(section, key, document, problems) for key in keys_of(part)]
    may_go = _NUMBERS.sub("[]", section) in MAY_GO
    return {"section": section, "fields": fields, "there": bool(found), "may_go": may_go and bool(found)}


def short_form(document: EditedDocument, problems: Sequence[Mistake], vehicle: int = 0) -> list[dict[str, Any]]:
    """The fields of the short form, with one ``vehicle``'s; the mistakes of a key stand at its field."""
    own = f"vehicles[{vehicle}]"
    return [
        _field(own if section == A_VEHICLE else section, key, document, problems) | {"group": group, "label": label}
        for group, section, key, label in SHORT_FORM
    ]


def _field(section: str, key: str, document: EditedDocument, problems: Sequence[Mistake]) -> dict[str, Any]:
    part = str(part_of(section))
    entry, found = keys_of(part)[key], _section(document, section)
    name, other = _written(found, key)
    kind, choices = field_kind(entry)
    reason = YAML_ONLY.get((part, key), "")
    place = f"{section}.{name}" if section else name
    unit = other.other.symbol if other else UNIT_SYMBOLS.get(unit_end(key), "")
    value, default = found.get(name), entry.get("default")
    if reason or kind == "yaml":
        value, default = (None if v is None else flow(v) for v in (value, default))
    return {
        "key": place, "group": section, "label": _label(key), "help": entry.get("description", ""),
        "kind": "fixed" if reason else kind, "quantity": None if other or kind != "number" else quantity_of(key),
        "unit": unit, "value": value, "default": default if isinstance(default, int | float | str) else None,
        "choices": choices, "reason": reason, "list": None if reason else entries_of(entry, found.get(name)),
        "error": next((p.message for p in problems if _is_at(p.key, place, kind)), None),
    }  # fmt: skip


def field_kind(entry: Mapping[str, Any]) -> tuple[str, list[str]]:
    """How a key is typed: ``number``, ``text``, ``choice`` with its choices, ``boolean``, or any value as ``yaml``."""
    forms = [form for form in entry.get("anyOf", [entry]) if form.get("type") != "null"]
    if len(forms) != 1 or "oneOf" in forms[0] or "$ref" in forms[0]:
        return "yaml", []
    form = forms[0]
    if "enum" in form and form.get("type") == "string":
        return "choice", list(form["enum"])
    kinds = {"number": "number", "integer": "number", "string": "text", "boolean": "boolean"}
    return kinds.get(form.get("type", ""), "yaml"), []


def entries_of(entry: Mapping[str, Any], value: object) -> dict[str, Any] | None:
    """The entries of a list, as the file writes them, and what the schema says of one: its choices, or its keys.

    None for a key that is no list of any length, has another form now, or has more than `MOST_ENTRIES`.
    """
    form = next(
        (f for f in _forms(entry) if f.get("type") == "array" and f.get("minItems") != f.get("maxItems", "")), None
    )
    if form is None or not isinstance(value, list | None) or len(value or ()) > MOST_ENTRIES:
        return None
    items = form["items"]
    part = _schema()["$defs"].get(items.get("$ref", "").rpartition("/")[2], {})
    keys = ", ".join(f"{key}: …" for key in part.get("required", part.get("properties", ())))
    return {
        "entries": [flow(v) for v in value or ()], "most": form.get("maxItems", MOST_ENTRIES),
        "choices": items.get("enum", []), "like": f"{{{keys}}}" if keys else "",
    }  # fmt: skip


def _forms(entry: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The forms that a value may have, by the schema."""
    inner = [form for key in ("anyOf", "oneOf") for form in entry.get(key, ())]
    for form in inner:
        yield from _forms(form)
    if not inner:
        yield entry


def quantity_of(key: str) -> Kind | None:
    """The quantity by which the page shows a key in the user's units; None: in the key's own."""
    match unit_end(key):
        case "_m":
            return "height" if any(word in key for word in HEIGHT_WORDS) else "distance"
        case "_m_s":
            return "climb_rate" if key.startswith(CLIMB_WORDS) and "speed" not in key else "speed"
    return None


def _label(key: str) -> str:
    words = key.removesuffix(unit_end(key)).replace("_", " ")
    return words[:1].upper() + words[1:]


def _is_at(where: str, place: str, kind: str) -> bool:
    """Whether a mistake belongs to a field; one of a vehicle's limits is that of the limit of all."""
    section, _, name = place.rpartition(".")
    inside = kind == "yaml" and where.startswith((f"{place}.", f"{place}["))
    return (
        where == place
        or inside
        or (section == "limits" and re.fullmatch(r"vehicles\[\d+\]", where.removesuffix(f".{name}")) is not None)
    )


def _section(document: EditedDocument, place: str) -> dict[str, Any]:
    """The section of a place, empty where the document has none."""
    here: Any = document
    for name, number in re.findall(r"([^.\[\]]+)|\[(\d+)\]", place):
        if number:
            here = here[int(number)] if isinstance(here, list) and int(number) < len(here) else None
        else:
            here = here.get(name) if isinstance(here, dict) else None
    return here if isinstance(here, dict) else {}


def _written(section: Mapping[str, Any], key: str) -> tuple[str, Written | None]:
    """The name under which a section has a key, and its other unit if it has one."""
    others = other_names([key])
    name = next((n for n in (key, *others) if n in section), key)
    return name, others.get(name)


# -- changes ----------------------------------------------------------------------------------------------------------


def changes_of(message: Mapping[str, Any]) -> object:
    """The changes of a message, with those that are typed as YAML. Raises PageError for a text that is none."""
    typed, changes = message.get("yaml"), message.get("changes", {})
    if not isinstance(typed, dict) or not isinstance(changes, dict) or not typed:
        return message.get("changes")
    found = dict(changes)
    for place, text in list(typed.items())[:MOST_CHANGES]:
        if not isinstance(text, str) or len(text) > MOST_FIELD_TEXT:
            raise PageError("a value as YAML is a text", code="bad_message", where=place[:80])
        try:
            found[place] = read_yaml(text, where="")
        except InputError as why:
            raise PageError(why.message, code="bad_change", where=place[:80]) from None
    return found


def arranged(document: EditedDocument, message: Mapping[str, Any]) -> dict[str, object]:
    """The change that moves an entry of a list of sections (``list``, ``from``, ``to``). Raises PageError."""
    name, begin, end = message.get("list"), message.get("from"), message.get("to")
    lists = [section.removesuffix("[]") for section in SECTIONS if section.endswith("[]")]
    entries = document.get(name) if name in lists else None
    count = len(entries) if isinstance(entries, list) else 0
    if isinstance(entries, list) and type(begin) is type(end) is int and 0 <= begin < count and 0 <= end < count:
        entries.insert(end, entries.pop(begin))
        return {str(name): entries}
    raise PageError(
        f"an entry of {', '.join(lists)} is moved to the place of another one", code="bad_change", where="list"
    )


def require_changes(changes: object) -> Mapping[str, object]:
    """The changes of a message. Raises PageError for a key that the page may not change: none names a file."""
    if not isinstance(changes, dict) or not 0 < len(changes) <= MOST_CHANGES:
        raise PageError(f"changes are a mapping of 1 to {MOST_CHANGES} keys", code="bad_message")
    for place, value in changes.items():
        if not (is_crew_key(place, value) or _may_change(place, value)):
            raise PageError("this key cannot be changed on the page", code="bad_change", where=place[:80])
        try:
            json.dumps(value, ensure_ascii=False, default=str).encode()
        except UnicodeEncodeError as why:
            half = ascii(why.object[why.start])
            words = f"the text has {half}, half of a character, which no file holds: delete it and type the text anew"
            raise PageError(words, code="bad_change", where=place[:80]) from None
    return changes


def without_empty(document: EditedDocument, changes: Mapping[str, object]) -> dict[str, object]:
    """The changes, in which a list of zones whose only entry goes is left out: an empty one is a mistake."""
    alone = {f"{name}[0]": name for name in ("no_fly", "keep_in") if len(document.get(name) or ()) == 1}
    return {alone.get(place, place) if value is None else place: value for place, value in changes.items()}


def _may_change(place: str, value: object) -> bool:
    if _ZONE.fullmatch(place):
        return value is None or (isinstance(value, dict) and all(_is_free("ZoneKeys", str(key)) for key in value))
    if _NUMBERS.sub("[]", place) in MAY_GO:
        return value is None
    section, _, name = place.rpartition(".")
    part = part_of(section)
    return part is not None and _is_free(part, name)


def _is_free(part: str, name: str) -> bool:
    """Whether the page may change a key of a part of the schema, under any of its names."""
    known = keys_of(part)
    written = other_names(known).get(name)
    key = name if written is None else written.key
    return key in known and (part, key) not in YAML_ONLY


def require_own_files(document: EditedDocument, before: EditedDocument, folder: Path, text: str) -> None:
    """Raise InputError for a text that names a file outside of the mission's folder, which it did not name before."""
    known = {name for _, name in _files_named(before)}
    wrong = [
        (place, name) for place, name in _files_named(document)
        if name not in known and name not in SOURCES and not is_sample(name)
        and (Path(name).is_absolute() or not (folder / name).resolve().is_relative_to(folder.resolve()))
    ]  # fmt: skip
    if wrong:
        words = "lies outside of the mission's folder, and the page names no such file: copy it there"
        lines = lines_of(text, [place for place, _ in wrong])
        raise InputError.of(
            [Mistake(p, f"{name} {words}", in_line=n) for (p, name), n in zip(wrong, lines, strict=True)]
        )


def _files_named(document: EditedDocument) -> Iterator[tuple[str, str]]:
    """Each key that names a file, and the name."""
    for section, part in SECTIONS.items():
        keys = [key for (of, key), why in YAML_ONLY.items() if of == part and why is FILE_NAMED]
        places = [section]
        if section.endswith("[]"):
            listed = document.get(section.removesuffix("[]"))
            places = [section.replace("[]", f"[{k}]") for k in range(len(listed) if isinstance(listed, list) else 0)]
        for place, key in product(places, keys):
            value = _section(document, place).get(key)
            for name in value if isinstance(value, list) else [value]:
                if isinstance(name, str):
                    yield f"{place}.{key}", name


def cure_changes(document: EditedDocument, vehicle: str, cure: LimitValues) -> dict[str, float]:
    """The changes of keys that set the limits of a cure where the document has them."""
    vehicles = document.get("vehicles")
    listed = vehicles if isinstance(vehicles, list) else []
    number = next((i for i, v in enumerate(listed) if isinstance(v, dict) and v.get("name") == vehicle), 0)
    own = f"vehicles[{number}]"
    found: dict[str, float] = {}
    for key, value in cure:
        for where in (own, f"{own}.limits", "limits"):
            section = _section(document, where)
            name, other = _written(section, key)
            if where == "limits" or name in section:
                # Rounded up to a thousandth of the unit: the tried value itself, or a trifle more.
                size = 1.0 if other is None else other.other.size
                found[f"{where}.{name}"] = math.ceil(value / size * 1000.0 - 1e-6) / 1000.0
                break
    return found
