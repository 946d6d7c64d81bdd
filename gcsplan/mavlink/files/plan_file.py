"""`.plan` files (QGroundControl's JSON), written so that QGroundControl, MAVSDK and Mission Planner can load them.

This is the format to use for PX4: it keeps home apart from the items and expresses NaN as null. Survey and corridor
items are read as the simple items that QGroundControl stored inside them, landing patterns as the items that
QGroundControl generates; other complex items are refused. ``doJumpId`` counts from 1 for every autopilot, and the
target of a DO_JUMP is a ``doJumpId``.

The items of a landing pattern are those that QGroundControl sends (LandingComplexItem.cc, `appendMissionItems`):
DO_LAND_START; where requested a speed change and the end of photos and video; the final approach (LOITER_TO_ALT or a
way point); and the landing.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any, NoReturn

from gcsplan.errors import InputError, Mistake
from gcsplan.mavlink.files.file_items import (
    HAS_PLACE,
    MAX_FILE_BYTES,
    MAX_ITEMS,
    MissionFileRead,
    RawItem,
    check_writable,
    degrees_e7_of,
    in_degrees,
    jumps_from_file,
    jumps_to_file,
    read_item,
    vtol_taken,
    whole,
)
from gcsplan.mavlink.files.plan_fence import (
    FENCE_KEYS,
    FENCE_VERSION,
    RALLY_KEYS,
    RALLY_VERSION,
    RESAVE,
    fence_items,
    fence_json,
    json_float,
    json_number,
    rally_items,
    rally_json,
    unread_keys,
)
from gcsplan.mavlink.mission.autopilots import ARDUPILOTMEGA, COPTERS, PLANES, PX4, profile_of, type_name
from gcsplan.mavlink.mission.commands import (
    DO_CHANGE_SPEED,
    DO_JUMP,
    DO_LAND_START,
    DO_SET_CAM_TRIGG_DIST,
    IMAGE_STOP_CAPTURE,
    LAND,
    LOITER_TO_ALT,
    VIDEO_STOP_CAPTURE,
    VTOL_LAND,
    WAYPOINT,
)
from gcsplan.mavlink.mission.mission import (
    FRAME_SYNONYMS,
    GLOBAL,
    NO_POSITION,
    RELATIVE,
    TERRAIN,
    Home,
    Mission,
    MissionItem,
)
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle

FIXED_WING, QUADROTOR = 1, 2  # MAV_TYPE
CALCULATED_ABOVE_TERRAIN = 3  # QGroundControl's AltMode: sent above sea level
ALTITUDE_MODE = {RELATIVE: 1, GLOBAL: 2, TERRAIN: 4}  # QGroundControl's AltMode; 0 is "mixed"
MAX_PROBLEMS = 20
STORED_WITH_ITEMS = ("survey", "CorridorScan", "fwLandingPattern", "vtolLandingPattern")
"""Complex items that QGroundControl saves with what they stand for."""

ITEMS_IN_NO_FILE = (
    "no file holds its way points; send it to a vehicle with QGroundControl (`gcsplan sim` is one), and read it back "
    "with `gcsplan download`, or make it of way points"
)
KEYS = frozenset({"fileType", "geoFence", "groundStation", "mission", "rallyPoints", "version"})
MISSION_KEYS = frozenset({
    "cruiseSpeed", "firmwareType", "globalPlanAltitudeMode", "hoverSpeed", "items", "plannedHomePosition",
    "vehicleType", "version",
})  # fmt: skip


def write_plan(
    mission: Mission,
    *,
    vehicle: Vehicle | None = None,
    fence: Sequence[MissionItem] = (),
    rally: Sequence[MissionItem] = (),
) -> str:
    """Return the text of a `.plan` file, from which `read_plan` returns the same mission.

    ``vehicle`` supplies the speed that QGroundControl shall assume if the mission sets none. ``fence`` and ``rally``
    are the wire items of the other two lists (5001 … 5004, 5100). Raises InputError for what the format cannot hold.
    """
    check_writable(mission, nan=True)
    items = jumps_to_file(mission)
    modes = {ALTITUDE_MODE[_frame(i)] for i in items if i.command in HAS_PLACE and _frame(i) in ALTITUDE_MODE}
    speed_m_s = _speed_m_s(mission, vehicle)
    winged = mission.autopilot is Autopilot.ARDUPLANE or (vehicle is not None and vehicle.turn_radius_m > 0)
    home = mission.home
    plan = {
        "fileType": "Plan",
        "geoFence": fence_json(fence),
        "groundStation": "gcsplan",
        "mission": {
            "cruiseSpeed": json_number(speed_m_s) if speed_m_s else 15,
            "firmwareType": ARDUPILOTMEGA if mission.autopilot.is_ardupilot else PX4,
            "globalPlanAltitudeMode": modes.pop() if len(modes) == 1 else 0,
            "hoverSpeed": json_number(speed_m_s) if speed_m_s else 5,
            "items": [_item(item, number) for number, item in enumerate(items, start=1)],
            "plannedHomePosition": [home.lat_e7 / 1e7, home.lon_e7 / 1e7, float(home.amsl_m)],
            "vehicleType": FIXED_WING if winged else QUADROTOR,
            "version": 2,
        },
        "rallyPoints": rally_json(rally),
        "version": 1,
    }
    return json.dumps(plan, indent=2, allow_nan=False) + "\n"


def _frame(item: MissionItem) -> int:
    return FRAME_SYNONYMS.get(item.frame, item.frame)


def _speed_m_s(mission: Mission, vehicle: Vehicle | None) -> float | None:
    for item in mission.items:
        if item.command == DO_CHANGE_SPEED and item.params[0] in (0.0, 1.0) and item.params[1] > 0:
            return item.params[1]
    return vehicle.speed_max_m_s if vehicle is not None else None


def _item(item: MissionItem, number: int) -> dict[str, Any]:
    placed = in_degrees(item.command, item.frame)
    x, y = (item.lat_deg, item.lon_deg) if placed else (int(item.x), int(item.y))
    out: dict[str, Any] = {}
    if item.command in HAS_PLACE and placed:
        out["AMSLAltAboveTerrain"] = None
        out["Altitude"] = json_number(item.z)
        out["AltitudeMode"] = ALTITUDE_MODE[_frame(item)]
    out["autoContinue"] = bool(item.autocontinue)
    out["command"] = item.command
    out["doJumpId"] = number
    out["frame"] = _frame(item)
    out["params"] = [*map(json_number, item.params), x, y, json_number(item.z)]
    out["type"] = "SimpleItem"
    return out


def read_plan(text: str, *, autopilot: Autopilot | None, where: str, home_hint: Home | None = None) -> Mission:
    """Return the mission in ``text``; see `parse_plan`."""
    return parse_plan(text, autopilot=autopilot, where=where, home_hint=home_hint).mission


def parse_plan(text: str, *, autopilot: Autopilot | None, where: str, home_hint: Home | None = None) -> MissionFileRead:
    """Return the mission in ``text`` with notes for the user.

    ``autopilot`` None means the one that the file names; another one than the file's raises InputError. ``home_hint``
    is the home for a file without one. Raises InputError with the first twenty mistakes, each with its key.
    """
    if len(text) > MAX_FILE_BYTES:
        raise InputError(f"a mission file of more than {MAX_FILE_BYTES // 10**6} MB is not read", where=where)
    plan = _json(text.removeprefix("\ufeff"), where)
    kind = plan.get("fileType") if isinstance(plan, dict) else None
    if not isinstance(plan, dict) or kind not in ("Plan", None):
        given = "" if kind is None else f" but one of {str(kind)[:40]!r}: give the file of the mission"
        raise InputError(f"a .plan file is a JSON object with fileType 'Plan', and this is none{given}", where=where)
    # Mission Planner writes its .mission files in this form with mission version 0 and no item types.
    theirs = plan.get("groundStation") == "MissionPlanner"
    mission = plan.get("mission")
    if mission is None and isinstance(plan.get("items"), list):
        raise InputError(f"a .mission file of an old QGroundControl is not read: {RESAVE}, as a .plan", where=where)
    if not isinstance(mission, dict) or not isinstance(mission.get("items"), list):
        raise InputError("there must be a mission with a list of items", where=f"{where}: mission.items")
    for key, found, want in (("version", plan.get("version"), 1), ("mission.version", mission.get("version"), 2)):
        if found != want and not (theirs and found in (0, None)):
            raise InputError(
                f"must be {want}, given {str(found)[:40]}; {RESAVE}",
                where=f"{where}: {key}",
            )
    notes: list[Note] = []
    pilot = _autopilot(mission, autopilot, where, notes)
    home = _home(mission.get("plannedHomePosition"), home_hint, f"{where}: mission.plannedHomePosition", notes)
    found = _Items(pilot, where, notes, typeless=theirs)
    for index, entry in enumerate(mission["items"]):
        found.add(entry, f"mission.items[{index}]")
    items = found.finish()
    fence = fence_items(plan.get("geoFence"), f"{where}: geoFence", notes)
    rally = rally_items(plan.get("rallyPoints"), f"{where}: rallyPoints")
    unread_fence = unread_keys(plan.get("geoFence"), FENCE_KEYS, FENCE_VERSION, "geoFence")
    unread_rally = unread_keys(plan.get("rallyPoints"), RALLY_KEYS, RALLY_VERSION, "rallyPoints")
    if unread_rally:
        notes.append(Note("plan_rally_points_unread", keys=unread_rally, cure=RESAVE))
    others = [*(k for k in plan if k not in KEYS), *(f"mission.{k}" for k in mission if k not in MISSION_KEYS)]
    if others and not theirs:
        notes.append(Note("plan_keys_unread", keys=tuple(k[:40] for k in others[:8])))
    unread = Note("plan_fence_unread", keys=unread_fence, cure=RESAVE) if unread_fence else None
    found_in, other = Mission(pilot, home, items), _other_kind(mission, pilot)
    if autopilot is None and mission.get("vehicleType") in (None, 0):
        other = vtol_taken(found_in)
    return MissionFileRead(found_in, tuple(notes), fence, rally, unread, other)


def _json(text: str, where: str) -> Any:
    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        made = dict(pairs)
        if len(made) != len(pairs):
            raise InputError("a key stands twice in one object, so it is not clear which one counts", where=where)
        return made

    def refuse(word: str) -> NoReturn:
        raise InputError(f"{word} is no JSON; a value that is not given is null", where=where)

    try:
        return json.loads(text, object_pairs_hook=unique, parse_constant=refuse)
    except json.JSONDecodeError as error:
        raise InputError(f"not JSON: {error.msg} (column {error.colno})", where=f"{where}:{error.lineno}") from None
    except RecursionError:
        raise InputError("nested too deep to be a mission", where=where) from None
    except InputError:
        raise
    except ValueError:  # an integer of thousands of digits
        raise InputError("not JSON that a mission can have: a number is too long", where=where) from None


def _autopilot(mission: dict[str, Any], requested: Autopilot | None, where: str, notes: list[Note]) -> Autopilot:
    firmware, kind = mission.get("firmwareType"), mission.get("vehicleType")
    if firmware == PX4:
        stated: Autopilot | None = Autopilot.PX4
    elif firmware == ARDUPILOTMEGA and isinstance(kind, int) and kind in PLANES:
        stated = Autopilot.ARDUPLANE
    elif firmware == ARDUPILOTMEGA and (kind in (None, 0) or (isinstance(kind, int) and kind in COPTERS)):
        stated = Autopilot.ARDUCOPTER
        if kind in (None, 0) and requested is Autopilot.ARDUPLANE:
            stated = requested
    elif firmware in (None, 0):
        stated = None
    else:
        raise InputError(
            f"firmwareType {str(firmware)[:40]} with vehicleType {str(kind)[:40]} is not one that gcsplan knows "
            f"(3 ArduPilot with a copter or plane, 12 PX4)",
            where=f"{where}: mission.firmwareType",
        )
    if stated is None and requested is None:
        raise InputError("the file does not say for which autopilot it is", where=f"{where}: mission.firmwareType")
    if stated is None:
        notes.append(Note("plan_without_autopilot", autopilot=str(requested)))
    elif requested is not None and requested is not stated:
        raise InputError(
            f"the file is for {stated}, not for {requested}; use the file made for it, or change the vehicle",
            where=f"{where}: mission.firmwareType",
        )
    return requested or stated  # type: ignore[return-value]  # one of them is there


def _other_kind(mission: dict[str, Any], pilot: Autopilot) -> Note | None:
    """A note on the file's kind of vehicle, if missions for this autopilot are judged as others fly them."""
    kind, profile = mission.get("vehicleType"), profile_of(pilot)
    if kind in (None, 0, *profile.judged_types):
        return None
    named = type_name(kind) if isinstance(kind, int) else str(kind)[:40]
    return Note("plan_for_other_kind", kind=named, autopilot=profile.label)


def _home(value: object, hint: Home | None, place: str, notes: list[Note]) -> Home:
    numbers = [json_float(v) for v in value] if isinstance(value, list) and len(value) == 3 else None
    good = numbers is not None and all(n is not None and math.isfinite(n) for n in numbers)
    if value is None or (numbers is not None and any(n is not None and math.isnan(n) for n in numbers)):
        if hint is None:
            raise InputError("home must be given as [latitude, longitude, AMSL]", where=place)
        notes.append(Note("plan_home_missing"))
        return hint
    if not good or numbers is None:
        raise InputError(f"home must be [latitude, longitude, AMSL], given {str(value)[:60]}", where=place)
    lat, lon, amsl = (float(n) for n in numbers if n is not None)
    if abs(lat) > 90.0 or abs(lon) > 180.0:
        raise InputError(f"home must lie within ±90°, ±180°, given {lat:g}, {lon:g}", where=place)
    if lat == lon == 0.0 and hint is not None:
        notes.append(Note("plan_home_without_place"))
        return hint
    return Home(degrees_e7_of(lat), degrees_e7_of(lon), amsl)


class _Items:
    """Collects the simple items of a plan and their mistakes."""

    def __init__(self, autopilot: Autopilot, where: str, notes: list[Note], *, typeless: bool) -> None:
        self.autopilot, self.where, self.notes, self.typeless = autopilot, where, notes, typeless
        self.items: list[MissionItem] = []
        self.index_of: dict[int, int] = {}
        self.twice: set[int] = set()
        self.problems: list[Mistake] = []
        self.count = 0

    def finish(self) -> tuple[MissionItem, ...]:
        if self.twice and any(item.command == DO_JUMP for item in self.items):
            bad = f"doJumpId {min(self.twice)} stands twice, so it is not clear where a DO_JUMP leads"
            self.problems.append(Mistake(f"{self.where}: mission.items", bad))
        self._raise()
        first_seq = 1 if self.autopilot.is_ardupilot else 0
        return jumps_from_file(self.items, self.index_of, first_seq, self.where)

    def _raise(self) -> None:
        if self.problems:
            many = len(self.problems) > 1
            raise InputError.of(self.problems, headline=f"{self.where} is damaged" if many else "")

    def _bad(self, key: str, message: str) -> None:
        self.problems.append(Mistake(f"{self.where}: {key}", message))
        if len(self.problems) >= MAX_PROBLEMS:
            self._raise()

    def add(self, entry: object, key: str) -> None:
        kind = entry.get("type") if isinstance(entry, dict) else None
        if not isinstance(entry, dict):
            self._bad(key, "a mission item must be an object")
        elif kind == "SimpleItem" or (kind is None and self.typeless):
            self._simple(entry, key)
        elif kind == "ComplexItem":
            self._complex(entry, key)
        else:
            self._bad(f"{key}.type", f"must be SimpleItem or ComplexItem, given {str(kind)[:40]!r}")

    def _complex(self, entry: dict[str, Any], key: str) -> None:
        style = entry.get("TransectStyleComplexItem")
        inner = style.get("Items") if isinstance(style, dict) else None
        name = str(entry.get("complexItemType"))[:40]
        where = f"{key}.TransectStyleComplexItem.Items"
        if name in LANDING_PATTERNS:
            inner, where = landing_entries(entry), key
        if not isinstance(inner, list) or not inner:
            cure = RESAVE if isinstance(style, dict) or name in STORED_WITH_ITEMS else ITEMS_IN_NO_FILE
            self._bad(key, f"a complex item ({name}) without its single items cannot be read: {cure}")
            return
        self.notes.append(Note("complex_item_read", entry=key, kind=name, count=len(inner), landing=where == key))
        for index, part in enumerate(inner):
            place = f"{where}[{index}]"
            if not isinstance(part, dict) or part.get("type") != "SimpleItem":
                self._bad(place, "must be a SimpleItem")
            else:
                self._simple(part, place)

    def _simple(self, entry: dict[str, Any], key: str) -> None:
        self.count += 1
        if self.count > MAX_ITEMS:
            self._bad(key, f"a mission of more than {MAX_ITEMS} items is not read")
            self._raise()
        values = entry.get("params")
        params = [json_float(p) for p in values] if isinstance(values, list) and len(values) == 7 else []
        command, frame = json_float(entry.get("command")), json_float(entry.get("frame"))
        goes_on = entry.get("autoContinue")
        if not params and isinstance(values, list) and entry.get("coordinate") is not None:
            self._bad(f"{key}.params", f"must be seven numbers, and the place stands in `coordinate`: {RESAVE}")
        elif len(params) != 7 or None in params:
            self._bad(f"{key}.params", "must be seven numbers (null where none is given)")
        elif command is None or frame is None:
            self._bad(key, "command and frame must be numbers")
        elif not isinstance(goes_on, bool):
            self._bad(f"{key}.autoContinue", f"must be true or false, given {str(goes_on)[:40]}")
        else:
            p1, p2, p3, p4, x, y, z = (math.nan if p is None else p for p in params)
            x, y = self._unset(command, frame, x, y, key)
            self._compare_altitude(entry, frame, z, key)
            item = read_item(
                RawItem(command, frame, (p1, p2, p3, p4), x, y, z, goes_on), self.problems, f"{self.where}: {key}"
            )
            if item is not None:
                self._number(entry.get("doJumpId"))
                self.items.append(item)
        if len(self.problems) >= MAX_PROBLEMS:
            self._raise()

    def _compare_altitude(self, entry: dict[str, Any], frame: float, z: float, key: str) -> None:
        """Note an altitude, or its meaning, that QGroundControl shows and that is not what is sent."""
        mode, shown = entry.get("AltitudeMode"), json_float(entry.get("Altitude"))
        if mode == CALCULATED_ABOVE_TERRAIN:
            shown = json_float(entry.get("AMSLAltAboveTerrain"))
        known = mode in (None, *ALTITUDE_MODE.values(), CALCULATED_ABOVE_TERRAIN)
        if known and shown is not None and abs(shown - z) > 0.05:
            self.notes.append(Note("altitude_shown_is_not_sent", place=key, shown_m=shown, sent_m=z))
        sent = ALTITUDE_MODE.get(FRAME_SYNONYMS.get(int(frame), int(frame))) if math.isfinite(frame) else None
        meant = ALTITUDE_MODE[GLOBAL] if mode == CALCULATED_ABOVE_TERRAIN else mode
        if sent is not None and meant in ALTITUDE_MODE.values() and meant != sent:
            self.notes.append(Note("altitude_mode_is_not_sent", place=key, shown=mode, frame=int(frame)))

    def _number(self, jump_id: object) -> None:
        number = whole(json_float(jump_id) or math.nan, 1, 2**31) if jump_id is not None else None
        if number is None:
            return
        if number in self.index_of:
            self.twice.add(number)
        self.index_of.setdefault(number, len(self.items))

    def _unset(self, command: float, frame: float, x: float, y: float, key: str) -> tuple[float, float]:
        if not (math.isnan(x) or math.isnan(y)):
            return x, y
        placed = command in HAS_PLACE and in_degrees(int(command), whole(frame, 0, 255) or GLOBAL)
        if placed and (self.autopilot is Autopilot.PX4 or not (math.isnan(x) and math.isnan(y))):
            self._bad(f"{key}.params", f"command {command:g} needs a latitude and a longitude, and they are null")
            return 0.0, 0.0
        if placed:
            self.notes.append(Note("item_without_place", entry=key))
        return (0.0 if math.isnan(x) else x), (0.0 if math.isnan(y) else y)


LANDING_PATTERNS = {"fwLandingPattern": LAND, "vtolLandingPattern": VTOL_LAND}


def landing_entries(entry: dict[str, Any]) -> list[dict[str, Any]] | None:
    """Return a landing pattern's simple items in a plan's JSON form; None if its coordinates are missing."""
    land = entry.get("landCoordinate")
    approach = entry.get("landingApproachCoordinate", entry.get("loiterCoordinate"))
    if not (isinstance(land, list) and isinstance(approach, list) and len(land) == len(approach) == 3):
        return None
    both = entry.get("altitudesAreRelative")
    frames = [
        RELATIVE if (both if isinstance(both, bool) else entry.get(key, True)) else GLOBAL
        for key in ("loiterAltitudeRelative", "landingAltitudeRelative")
    ]
    radius = entry.get("loiterRadius", 0)
    turn = radius if entry.get("loiterClockwise", True) or not isinstance(radius, int | float) else -radius
    items = [_entry(DO_LAND_START, NO_POSITION)]
    if entry.get("useDoChangeSpeed"):
        items.append(_entry(DO_CHANGE_SPEED, NO_POSITION, 1, entry.get("finalApproachSpeed", 0), -1))
    if entry.get("stopTakingPhotos"):
        items += [_entry(DO_SET_CAM_TRIGG_DIST, NO_POSITION), _entry(IMAGE_STOP_CAPTURE, NO_POSITION)]
    if entry.get("stopVideoPhotos"):
        items.append(_entry(VIDEO_STOP_CAPTURE, NO_POSITION))
    if entry.get("useLoiterToAlt", True):
        items.append(_entry(LOITER_TO_ALT, frames[0], 1, turn, 0, 1, at=approach))
    else:
        items.append(_entry(WAYPOINT, frames[0], at=approach))
    items.append(_entry(LANDING_PATTERNS[str(entry.get("complexItemType"))], frames[1], at=land))
    return items


def _entry(command: int, frame: int, *params: Any, at: list[Any] | None = None) -> dict[str, Any]:
    numbers = [*params, 0, 0, 0, 0][:4]
    return {
        "type": "SimpleItem", "autoContinue": True, "command": command, "frame": frame,
        "params": [*numbers, *(at or (0, 0, 0))],
    }  # fmt: skip
