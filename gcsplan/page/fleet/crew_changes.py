"""Vehicles that the page adds, renames and removes, and how they arrive: whole changes of the mission's document."""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Mapping
from typing import Any

from gcsplan.errors import InputError, NoMission
from gcsplan.fleet.arrival import NoSchedule
from gcsplan.mission_file.values.document import flow
from gcsplan.mission_file.values.schema import ArrivalKeys
from gcsplan.mission_file.values.units import other_names

CrewDocument = Mapping[str, Any]

ARRIVAL = frozenset(ArrivalKeys.model_fields)
"""Keys of ``arrival`` that the page may set, in their own units."""

NEW_KEYS = frozenset(("start", "goal", "like"))
"""What the page gives of a new vehicle: its ends, and the number of the vehicle whose settings it has."""

NOT_SHARED = ("via", "link", "takeoff_heading_deg")
"""Keys of a vehicle that are its own: a new one like it has none of them."""

MOST_SYSID = 255

_VEHICLE = re.compile(r"vehicles\[(\d{1,4})\](\.name)?")
_REFUSED_WITH = {
    "none": ("arrive_s", "clock", "hold"), "together": ("clock",), "arrive_s": ("clock",), "clock": ("arrive_s",)
}  # fmt: skip
"""Keys of ``arrival`` that a mode, or another key, leaves no meaning."""


def is_crew_key(place: str, value: object) -> bool:
    """Whether the page may make this change: a vehicle more or less, or a key of ``arrival``."""
    vehicle = _VEHICLE.fullmatch(place)
    if vehicle is not None:
        return vehicle[2] is None and (value is None or (isinstance(value, dict) and value.keys() <= NEW_KEYS))
    section, _, key = place.partition(".")
    return section == "arrival" and (key in ARRIVAL if key else value is None)


def with_crew(document: CrewDocument, changes: Mapping[str, object]) -> dict[str, object]:
    """The changes with all that follows from them: a new vehicle's other keys, the order of arrival, and the keys of
    ``arrival`` that no longer go together. Raises InputError."""
    listed = document.get("vehicles")
    vehicles = [v for v in listed if isinstance(v, dict)] if isinstance(listed, list) else []
    names = [str(v.get("name", "")) for v in vehicles]
    made, crew = dict(changes), [place for place in changes if _VEHICLE.fullmatch(place)]
    if len(crew) > 1 and any(not place.endswith(".name") for place in crew):
        raise InputError("one vehicle at a time is added or removed", where=crew[0])
    order = _order_of(document)
    for place in crew:
        found, value = _VEHICLE.fullmatch(place), changes[place]
        number = int(found[1]) if found else 0
        if isinstance(value, dict):
            made[place] = new = _new_vehicle(vehicles, number, value)
            order = None if order is None else [*order, new["name"]]
        elif number < len(names):
            if value is None and len(vehicles) < 2:
                raise InputError("a mission has at least one vehicle", where=place)
            now = [] if value is None else [str(value)]
            order = None if order is None else [n for name in order for n in (now if name == names[number] else [name])]
    if order is not None and order != _order_of(document) and "arrival.order" not in changes:
        made["arrival.order"] = order
    return _together(document, made)


def _order_of(document: CrewDocument) -> list[str] | None:
    """The names in the order of arrival that the document gives; None if it gives none."""
    arrival = document.get("arrival")
    order = arrival.get("order") if isinstance(arrival, dict) else None
    return [str(name) for name in order] if isinstance(order, list) else None


def _new_vehicle(vehicles: list[dict[str, Any]], number: int, given: Mapping[str, Any]) -> dict[str, Any]:
    """A vehicle with the settings of another one, a name and a system id of its own. Raises InputError."""
    like = given.get("like", len(vehicles) - 1)
    whole = isinstance(like, int) and not isinstance(like, bool)
    if number != len(vehicles) or not whole or not 0 <= like < len(vehicles):
        raise InputError("a new vehicle comes behind the last, with the settings of one that is there", where="like")
    if given.get("start") is None or given.get("goal") is None:
        raise InputError("a new vehicle has a start and a goal", where="start")
    names, ids = {v.get("name") for v in vehicles}, {v.get("sysid") for v in vehicles}
    sysid = next((k for k in range(1, MOST_SYSID + 1) if k not in ids), None)
    if sysid is None:
        raise InputError(
            f"all {MOST_SYSID} system ids are taken: add the vehicle to the file, with a link", where="sysid"
        )
    name = next(n for k in range(len(vehicles) + 1, 2 * len(vehicles) + 2) if (n := f"uav{k}") not in names)
    shared = {key: value for key, value in vehicles[like].items() if key not in NOT_SHARED}
    return copy.deepcopy(shared) | {"name": name, "sysid": sysid, "start": given["start"], "goal": given["goal"]}


def _together(document: CrewDocument, changes: dict[str, object]) -> dict[str, object]:
    """The changes, which also remove the keys of ``arrival`` that a new one stands in the place of."""
    found = document.get("arrival")
    arrival = found if isinstance(found, dict) else {}
    gone: dict[str, object] = {}
    for place, value in changes.items():
        key = place.removeprefix("arrival.")
        if key == place or value is None:
            continue
        unused = [*other_names([key]), *_REFUSED_WITH.get(str(value) if key == "mode" else key, ())]
        names = {name for one in unused for name in (one, *other_names([one]))} if key in ARRIVAL else ()
        gone |= {f"arrival.{name}": None for name in names if name in arrival}
    return {**gone, **changes}


def arrival_of(document: CrewDocument) -> dict[str, Any] | None:
    """The keys of ``arrival`` in their own units, for the page; None without any."""
    found = document.get("arrival")
    if not isinstance(found, dict):
        return None
    others = other_names(ARRIVAL)
    own = {key: value for key, value in found.items() if key in ARRIVAL}
    for name, value in found.items():
        if name in others and isinstance(value, int | float):
            own[others[name].key] = value * others[name].other.size
    return own


def attempts(document: CrewDocument, why: NoMission) -> list[dict[str, Any]]:
    """Changes of ``arrival`` that may help, of which nothing was planned yet: times that the schedule found, and to
    leave the vehicle out."""
    arrival = arrival_of(document)
    if arrival is None or len(document.get("vehicles") or ()) < 2:
        return []
    found: list[dict[str, Any]] = []
    if isinstance(why, NoSchedule):
        times = (("interval_s", why.interval_s), ("arrive_s", why.arrive_s))
        found = [{f"arrival.{key}": math.ceil(value * 1e3 - 1e-6) / 1e3} for key, value in times if value]
    if not arrival.get("leave_out"):
        found.append({"arrival.leave_out": True})
    return [{"label": flow(changes).strip("{}"), "changes": changes} for changes in found]
