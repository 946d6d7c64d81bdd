"""The keys that the page may change, and the form of the mission's limits and settings."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from gcsplan.errors import LimitValues, Mistake
from gcsplan.mission_file.json_schema import LATE_DEFAULTS, describe
from gcsplan.mission_file.values.keys import Keys
from gcsplan.mission_file.values.schema import LimitKeys, PlannerKeys, TerrainKeys, VehicleKeys
from gcsplan.mission_file.values.units import UNIT_SYMBOLS, Written, other_names, unit_end
from gcsplan.page.fleet.crew_changes import is_crew_key
from gcsplan.page.history import EditedDocument
from gcsplan.page.refused import PageError
from gcsplan.units import Kind

Group = Literal["limits", "vehicle", "planner"]

MOST_CHANGES = 100
"""Most keys of one message."""


@dataclass(frozen=True, slots=True)
class FormKey:
    """One key of the form: its ``section`` (a key of the mission, or ``vehicles[0]``), its name for people, and the
    quantity by which the page shows it in the user's units."""

    group: Group
    section: str
    kind: type[Keys]
    key: str
    label: str
    quantity: Kind | None = None


FIRST_VEHICLE = "vehicles[0]"
FORM: tuple[FormKey, ...] = (
    FormKey("limits", "limits", LimitKeys, "min_agl_m", "Lowest height above ground", "height"),
    FormKey("limits", "limits", LimitKeys, "max_agl_m", "Legal ceiling above ground", "height"),
    FormKey("limits", "limits", LimitKeys, "max_amsl_m", "Greatest altitude above sea level", "height"),
    FormKey("limits", "limits", LimitKeys, "horizontal_clearance_m", "Horizontal clearance", "distance"),
    FormKey("limits", "limits", LimitKeys, "vertical_clearance_m", "Vertical clearance of zones", "height"),
    FormKey("limits", "limits", LimitKeys, "track_error_m", "Track error", "distance"),
    FormKey("limits", "limits", LimitKeys, "altitude_error_m", "Altitude error", "height"),
    FormKey("limits", "limits", LimitKeys, "max_climb_deg", "Steepest climb"),
    FormKey("limits", "terrain", TerrainKeys, "obstacle_height_m", "Trees and buildings", "height"),
    FormKey("vehicle", FIRST_VEHICLE, VehicleKeys, "name", "Name"),
    FormKey("vehicle", FIRST_VEHICLE, VehicleKeys, "autopilot", "Autopilot"),
    FormKey("vehicle", FIRST_VEHICLE, VehicleKeys, "end", "At the goal"),
    FormKey("vehicle", FIRST_VEHICLE, VehicleKeys, "rtl_rel_home_m", "Return altitude above home", "height"),
    FormKey("vehicle", FIRST_VEHICLE, VehicleKeys, "takeoff_agl_m", "Top of the take-off", "height"),
    FormKey("vehicle", FIRST_VEHICLE, VehicleKeys, "approach_agl_m", "Height above the goal", "height"),
    FormKey("vehicle", FIRST_VEHICLE, VehicleKeys, "climb_m_s", "Fastest climb rate", "climb_rate"),
    FormKey("vehicle", FIRST_VEHICLE, VehicleKeys, "descent_m_s", "Fastest descent rate", "climb_rate"),
    FormKey("vehicle", FIRST_VEHICLE, VehicleKeys, "turn_radius_m", "Turn radius of a fixed wing", "distance"),
    FormKey("planner", "planner", PlannerKeys, "objective", "Shortest, least energy or fastest"),
    FormKey("planner", "planner", PlannerKeys, "gap_percent", "Gap at which planning stops"),
    FormKey("planner", "planner", PlannerKeys, "budget_s", "Longest search"),
)
"""The form, in the order shown. Labels are the page's; what a key means, the reference says (`describe`)."""

ZONE_KEYS = frozenset(
    ("name", "center", "radius_m", "polygon", "line", "buffer_m", "floor_agl_m", "ceiling_agl_m", "floor_amsl_m",
     "ceiling_amsl_m")
)  # fmt: skip
"""Keys of a zone that the page may set: none of them names a file."""

_PLACES = re.compile(r"vehicles\[\d{1,4}\]\.(start|goal|via)")
_ZONE = re.compile(r"(?:no_fly|keep_in)\[\d{1,6}\](?:\.(\w+))?")
_ELEMENT = re.compile(r"\[\d{1,4}\]")


def require_changes(changes: object) -> Mapping[str, object]:
    """The changes of a message. Raises PageError for a key that the page may not change: none names a file."""
    if not isinstance(changes, dict) or not 0 < len(changes) <= MOST_CHANGES:
        raise PageError(f"changes are a mapping of 1 to {MOST_CHANGES} keys", code="bad_message")
    for place, value in changes.items():
        zone = _ZONE.fullmatch(place)
        inner = set(value) if zone and zone[1] is None and isinstance(value, dict) else {zone[1]} if zone else set()
        named = _PLACES.fullmatch(place) or is_crew_key(place, value) or _is_of_form(place)
        good = inner - {None} <= ZONE_KEYS if zone else named
        if not good:
            raise PageError("this key cannot be changed on the page", code="bad_change", where=place[:80])
    return changes


def _is_of_form(place: str) -> bool:
    section, _, name = place.rpartition(".")
    section = section.removesuffix(".limits") if section.endswith("].limits") else section
    if _ELEMENT.search(section):
        section = FIRST_VEHICLE if _ELEMENT.sub("[0]", section) == FIRST_VEHICLE else ""
        known = [k.key for k in FORM if k.section in (FIRST_VEHICLE, "limits")]
    else:
        known = [k.key for k in FORM if k.section == section]
    return bool(section) and (name in known or name in other_names(known))


def form_of(document: EditedDocument, problems: Sequence[Mistake], vehicle: int = 0) -> list[dict[str, Any]]:
    """The form's fields with their values, with one ``vehicle``'s; the mistakes of a key stand at its field."""
    own = f"vehicles[{vehicle}]"
    return [_field(replace(k, section=own) if k.group == "vehicle" else k, document, problems) for k in FORM]


def _field(form: FormKey, document: EditedDocument, problems: Sequence[Mistake]) -> dict[str, Any]:
    section = _section(document, form.section)
    name, other = _written(section, form.key)
    end = unit_end(form.key)
    unit = other.other.symbol if other else UNIT_SYMBOLS.get(end, "")
    field = form.kind.model_fields[form.key]
    default = LATE_DEFAULTS.get(form.key, field.default)
    choices = _choices(field.annotation)
    place = f"{form.section}.{name}"
    return {
        "key": place, "group": form.group, "label": form.label, "help": describe(form.kind, form.key),
        "kind": "choice" if choices else "text" if form.key == "name" else "number",
        "quantity": None if other else form.quantity, "unit": unit, "value": section.get(name),
        "default": default if isinstance(default, int | float | str) else None, "choices": choices,
        "error": next((p.message for p in problems if _is_at(p.key, place)), None),
    }  # fmt: skip


def _is_at(where: str, place: str) -> bool:
    """Whether a mistake belongs to a field; one of a vehicle's limits is that of the limit of all."""
    section, _, name = place.rpartition(".")
    return where == place or (
        section == "limits" and re.fullmatch(r"vehicles\[\d+\]", where.removesuffix(f".{name}")) is not None
    )


def _section(document: EditedDocument, place: str) -> dict[str, Any]:
    """The section of a place, empty where the document has none."""
    if place.startswith("vehicles["):
        vehicles, number = document.get("vehicles"), int(place[len("vehicles[") : -1])
        found: Any = vehicles[number] if isinstance(vehicles, list) and number < len(vehicles) else None
    else:
        found = document.get(place)
    return found if isinstance(found, dict) else {}


def _written(section: Mapping[str, Any], key: str) -> tuple[str, Written | None]:
    """The name under which a section has a key, and its other unit if it has one."""
    others = other_names([key])
    name = next((n for n in (key, *others) if n in section), key)
    return name, others.get(name)


def _choices(annotation: Any) -> list[str]:
    return [c for c in get_args(annotation) if isinstance(c, str)]


def cure_changes(document: EditedDocument, vehicle: str, cure: LimitValues) -> dict[str, float]:
    """The changes of keys that set the limits of a cure where the document has them."""
    vehicles = document.get("vehicles")
    listed = vehicles if isinstance(vehicles, list) else []
    number, own = next(((i, v) for i, v in enumerate(listed) if isinstance(v, dict) and v.get("name") == vehicle),
                       (0, {}))  # fmt: skip
    own_limits = own.get("limits") if isinstance(own.get("limits"), dict) else {}
    found: dict[str, float] = {}
    for key, value in cure:
        for where, section in ((f"vehicles[{number}]", own), (f"vehicles[{number}].limits", own_limits),
                               ("limits", None)):  # fmt: skip
            name, other = _written(_section(document, "limits") if section is None else section, key)
            if section is None or name in section:
                # Rounded up to a thousandth of the unit: the tried value itself, or a trifle more.
                size = 1.0 if other is None else other.other.size
                found[f"{where}.{name}"] = math.ceil(value / size * 1000.0 - 1e-6) / 1000.0
                break
    return found
