"""The parameters that decide a return: the one that holds its altitude, and those that choose its route.

The name and unit of the altitude differ between versions. ArduCopter 4.7 renamed RTL_ALT (cm) to RTL_ALT_M (m);
ArduPlane 4.5 renamed ALT_HOLD_RTL (cm) to RTL_ALTITUDE (m). A vehicle answers to one of the names, which tells its
version; without a vehicle both are named.

A vehicle returns straight home or along its mission:

- ArduCopter's failsafes each choose: 6 is Auto RTL, which joins a return path or a landing sequence of the mission (and
  returns straight home if there is none); 1 or 2 is RTL, which does not. A breach of the fence never chooses Auto RTL.
- ArduPlane has RTL_AUTOLAND for every RTL: 0 straight home (with such items in its mission it then does not arm), 1
  straight home and then to the landing sequence, 2 to the landing sequence, 3 straight home, 4 to the return path.
- PX4 has RTL_TYPE; only 0, straight home, is judged (`returns_otherwise`).
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from dataclasses import dataclass
from typing import Literal

from gcsplan.mavlink.mission.commands import DO_LAND_START, DO_RETURN_PATH_START
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mavlink.mission.parameter_names import unanswered
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot


@dataclass(frozen=True, slots=True)
class ReturnParameter:
    """One name of the return altitude above home. ``per_m``: its units in a metre; ``versions``: who has it."""

    name: str
    unit: str
    per_m: float
    versions: str = ""

    def metres(self, value: float) -> float:
        """The altitude above home, m, of a value on board."""
        return value / self.per_m

    def value(self, rel_home_m: float) -> float:
        """The value for an altitude above home, rounded up to a centimetre: the older names hold whole ones."""
        return math.ceil(round(100.0 * rel_home_m, 6)) / (100.0 / self.per_m)

    def setting(self, rel_home_m: float) -> str:
        """``RTL_ALT 35300 (cm)``."""
        return f"{self.name} {self.value(rel_home_m):.10g} ({self.unit})"


RETURN_PARAMETERS: dict[Autopilot, tuple[ReturnParameter, ...]] = {
    Autopilot.ARDUCOPTER: (
        ReturnParameter("RTL_ALT", "cm", 100.0, "before ArduPilot 4.7"),
        ReturnParameter("RTL_ALT_M", "m", 1.0, "since ArduPilot 4.7"),
    ),
    Autopilot.ARDUPLANE: (
        ReturnParameter("RTL_ALTITUDE", "m", 1.0, "since ArduPilot 4.5"),
        ReturnParameter("ALT_HOLD_RTL", "cm", 100.0, "before ArduPilot 4.5"),
    ),
    Autopilot.PX4: (ReturnParameter("RTL_RETURN_ALT", "m", 1.0),),
}
"""The altitude parameters of a return, in the order in which messages name them and gcsplan requests them."""

PX4_CONE_DEG = 45.0
"""RTL_CONE_ANG, default: the half-angle of the cone around home in which PX4 returns lower."""


def on_board(names: Container[str]) -> ReturnParameter | None:
    """The parameter that a vehicle has, by the names that it answered to; None if it answered to none."""
    return next((p for known in RETURN_PARAMETERS.values() for p in known if p.name in names), None)


def return_on_board_m(values: Mapping[str, float]) -> float | None:
    """The return altitude above home, m, of parameters that were read; None if it was not read, or is no altitude.

    ArduPlane's -1 keeps the altitude at which the return begins.
    """
    parameter = on_board(values)
    height_m = math.nan if parameter is None else parameter.metres(values[parameter.name])
    return height_m if math.isfinite(height_m) and height_m >= 0.0 else None


def returns_otherwise(values: Mapping[str, float]) -> Note | None:
    """Why a vehicle with these parameters returns otherwise than straight home; None if it does not.

    Only PX4 has such parameters: RTL_TYPE above 0 returns along the mission, to its landing or to rally points alone,
    and RTL_CONE_ANG above 45° returns lower near home than is judged.
    """
    kind, cone_deg = values.get("RTL_TYPE", 0.0), values.get("RTL_CONE_ANG", 0.0)
    if kind != 0.0:
        return Note("return_type_not_judged", value=kind)
    if cone_deg > PX4_CONE_DEG:
        return Note("return_cone_not_judged", value=cone_deg, judged_deg=PX4_CONE_DEG)
    return None


def setting(autopilot: Autopilot, rel_home_m: float) -> str:
    """The setting for a return at ``rel_home_m`` on a vehicle of unknown version: every name, its value and unit."""
    first, *others = RETURN_PARAMETERS[autopilot]
    return first.setting(rel_home_m) + "".join(f" or, {p.versions}, {p.setting(rel_home_m)}" for p in others)


def settings(autopilot: Autopilot, rel_home_m: float) -> list[dict[str, str | float]]:
    """The settings as plain values."""
    return [
        {"parameter": p.name, "value": p.value(rel_home_m), "unit": p.unit, "versions": p.versions or "all"}
        for p in RETURN_PARAMETERS[autopilot]
    ]


ReturnRoute = Literal["straight", "mission"]

AUTO_RTL = 6.0
COPTER_RETURNS: dict[str, tuple[float, ...]] = {
    "FS_THR_ENABLE": (1.0, 2.0, 4.0, 5.0), "FS_GCS_ENABLE": (1.0, 2.0, 3.0, 4.0), "BATT_FS_LOW_ACT": (2.0, 3.0, 4.0),
    "BATT_FS_CRT_ACT": (2.0, 3.0, 4.0),
}  # fmt: skip
"""ArduCopter's failsafes, and the values with which each returns by another way: RTL or SmartRTL."""

AUTOLAND_PATH, AUTOLAND_LANDING = 4.0, 2.0
STRAIGHT_AUTOLAND = (0.0, 3.0)


def starts(mission: Mission) -> tuple[str, ...]:
    """The names of the commands in ``mission`` that a return may join."""
    names = {DO_RETURN_PATH_START: "DO_RETURN_PATH_START", DO_LAND_START: "DO_LAND_START"}
    held = {item.command for item in mission.items}
    return tuple(name for command, name in names.items() if command in held)


def deciding(mission: Mission) -> tuple[tuple[str, ...], ...]:
    """The parameters that decide whether a return joins ``mission``, each a group of one name; none without starts."""
    if not starts(mission) or mission.autopilot is Autopilot.PX4:
        return ()
    names = ("RTL_AUTOLAND",) if mission.autopilot is Autopilot.ARDUPLANE else tuple(COPTER_RETURNS)
    return tuple((name,) for name in names)


def route_setting(autopilot: Autopilot, *, path: bool) -> str:
    """The setting for returns along the mission; ``path``: along a return path, else to a landing sequence."""
    if autopilot is Autopilot.ARDUPLANE:
        return f"RTL_AUTOLAND {AUTOLAND_PATH if path else AUTOLAND_LANDING:g}"
    return f"{', '.join(COPTER_RETURNS)} {AUTO_RTL:g} (Auto RTL)"


def takes_another_route(values: Mapping[str, float], mission: Mission, route: ReturnRoute | None) -> Note | None:
    """Why a vehicle with these parameters returns by another route than ``route``; None if it does not.

    ``values`` are what was read; a parameter that decides and is not among them counts as wrong.
    """
    held = starts(mission)
    if not held or mission.autopilot is Autopilot.PX4:
        return None
    path = "DO_RETURN_PATH_START" in held
    if mission.autopilot is Autopilot.ARDUPLANE:
        return _plane(values.get("RTL_AUTOLAND"), held, path, route)
    silent = [group[0] for group in unanswered(values, deciding(mission))]
    if silent and len(silent) < len(COPTER_RETURNS):
        return Note("return_route_unread", names=tuple(silent))
    if route != "mission":
        on = [name for name in COPTER_RETURNS if values.get(name) == AUTO_RTL]
        if not on:
            return None
        return Note("return_joins_mission", names=tuple(on), value=AUTO_RTL, start=held[0])
    other = [
        Note("key_and_value", name=name, value=values[name])
        for name, wrong in COPTER_RETURNS.items()
        if values.get(name) in wrong
    ]
    if len(silent) == len(COPTER_RETURNS):
        return Note("return_route_all_unread", names=tuple(silent))
    if not other:
        return None
    return Note("return_joins_no_mission", settings=tuple(other), value=AUTO_RTL, start=held[0])


def _plane(value: float | None, held: tuple[str, ...], path: bool, route: ReturnRoute | None) -> Note | None:
    if value is None:
        return Note("return_route_unread", names=("RTL_AUTOLAND",))
    if value == 0.0:
        needed = 3.0 if route != "mission" else AUTOLAND_PATH if path else AUTOLAND_LANDING
        return Note("plane_does_not_arm", start=held[0], wanted=needed)
    needed_value = AUTOLAND_PATH if path else AUTOLAND_LANDING
    if route == "mission" and value != needed_value:
        return Note("plane_returns_otherwise", value=value, wanted=needed_value)
    if route != "mission" and value not in STRAIGHT_AUTOLAND:
        return Note("plane_return_leads_on", value=value, start=held[0])
    return None
