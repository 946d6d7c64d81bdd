"""Whether a vehicle returns straight home or along its mission: the parameters that decide it.

- ArduCopter's failsafes each choose: 6 is Auto RTL, which joins a return path or a landing sequence of the mission (and
  returns straight home if there is none); 1 or 2 is RTL, which does not. A breach of the fence never chooses Auto RTL.
- ArduPlane has RTL_AUTOLAND for every RTL: 0 straight home (with such items in its mission it then does not arm), 1
  straight home and then to the landing sequence, 2 to the landing sequence, 3 straight home, 4 to the return path.
- PX4 has RTL_TYPE; only 0, straight home, is judged (`return_altitude.returns_otherwise`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from gcsplan.mavlink.mission.commands import DO_LAND_START, DO_RETURN_PATH_START
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mavlink.mission.parameter_names import unanswered
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot

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
    """What to set for returns along the mission; ``path``: along a return path, else to a landing sequence."""
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
        wanted = 3.0 if route != "mission" else AUTOLAND_PATH if path else AUTOLAND_LANDING
        return Note("plane_does_not_arm", start=held[0], wanted=wanted)
    wanted_value = AUTOLAND_PATH if path else AUTOLAND_LANDING
    if route == "mission" and value != wanted_value:
        return Note("plane_returns_otherwise", value=value, wanted=wanted_value)
    if route != "mission" and value not in STRAIGHT_AUTOLAND:
        return Note("plane_return_leads_on", value=value, start=held[0])
    return None
