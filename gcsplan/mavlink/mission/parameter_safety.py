"""The rows of fences and failsafes in the list of parameters that a mission was judged with.

Each limit of a fence that is in force must hold the whole flight with its errors. A failsafe either returns, as the way
home is judged, or lets the mission go on; another action ends where nobody judged.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from gcsplan.mavlink.mission.fences import FENCE_DECIDES, FENCE_MARGIN_M, SAFETY, fences_in_force, is_fence
from gcsplan.mavlink.mission.parameter_list import Matters, Setting
from gcsplan.mavlink.mission.parameter_names import unanswered
from gcsplan.mavlink.mission.return_route import AUTO_RTL
from gcsplan.vehicle import Autopilot

__all__ = ["FlightExtent", "needed_groups", "safety_list"]

_RADIO, _GROUND, _LOW = "loss of radio control", "loss of the ground station", "a low battery"
_CRITICAL = "a critical battery"
_FAILSAFE_VALUES: dict[Autopilot, dict[str, tuple[float, tuple[float, ...], str]]] = {
    Autopilot.ARDUCOPTER: {
        "fs_radio": (1.0, (0.0, 2.0), _RADIO), "fs_ground": (1.0, (0.0, 2.0), _GROUND),
        "fs_battery": (2.0, (0.0,), _LOW), "fs_battery_critical": (2.0, (0.0,), _CRITICAL),
    },
    Autopilot.ARDUPLANE: {
        "fs_radio": (1.0, (0.0, 2.0), _RADIO), "fs_ground": (1.0, (0.0, 2.0, 3.0), _GROUND),
        "fs_long": (1.0, (0.0,), "a long failsafe"),
        "fs_battery": (1.0, (0.0,), _LOW), "fs_battery_critical": (1.0, (0.0,), _CRITICAL),
    },
    Autopilot.PX4: {
        "fs_radio": (2.0, (0.0,), _RADIO), "fs_ground": (2.0, (0.0,), _GROUND), "fs_battery": (3.0, (0.0,), _LOW),
    },
}  # fmt: skip
"""By autopilot and key: the value that returns, others that return or let the mission go on, and after what."""

_LANDS = (3.0,)  # FS_EKF_ACTION beside 1


@dataclass(frozen=True, slots=True)
class FlightExtent:
    """How far a flight comes, errors counted, m: above and below home, and away from it."""

    top_rel_home_m: float
    bottom_rel_home_m: float
    reach_m: float


def safety_list(
    autopilot: Autopilot, extent: FlightExtent, *, rtl_rel_home_m: float | None = None, by_mission: bool = False
) -> tuple[Setting, ...]:
    """The rows of the fences and failsafes for a flight of ``extent``.

    ``rtl_rel_home_m``: the altitude above home of a straight return that is part of what was judged. ``by_mission``:
    the judged return follows the mission, so that ArduCopter's failsafes choose Auto RTL.
    """
    known = SAFETY[autopilot]
    rows = [*_fences(autopilot, extent, rtl_rel_home_m)]
    copter = autopilot is Autopilot.ARDUCOPTER
    for key, (value, also, after) in _FAILSAFE_VALUES[autopilot].items():
        if by_mission and copter:
            value, also = AUTO_RTL, (0.0,)
        why = f"{after} makes it return{' along the mission' if by_mission else ''}; 0 does nothing"
        rows.append(Setting(known[key], value, "equal", why, "told", also))
    if copter:
        why = "a lost position makes it land, wherever it is"
        rows.append(Setting(known["fs_position"], 1.0, "equal", why, "told", _LANDS))
    return tuple(rows)


def _fences(autopilot: Autopilot, extent: FlightExtent, returns_m: float | None) -> Iterator[Setting]:
    known, copter = SAFETY[autopilot], autopilot is Autopilot.ARDUCOPTER
    lowered = copter and returns_m is not None
    top_m, why = extent.top_rel_home_m, "the highest place of the flight above home, errors counted"
    if lowered and returns_m is not None and returns_m + FENCE_MARGIN_M > top_m:
        top_m, why = returns_m + FENCE_MARGIN_M, f"a return at {returns_m:g} m keeps FENCE_MARGIN below this"
    matters: Matters = "return" if lowered else "flight"
    yield Setting(known["fence_top"], float(math.ceil(top_m)), "at least", why, matters)
    if lowered:
        yield Setting(
            known["fence_margin"], FENCE_MARGIN_M, "at most", "how far below FENCE_ALT_MAX a return keeps", "return"
        )
    if autopilot is not Autopilot.PX4:
        why = "the lowest place of the flight, from home, errors counted"
        yield Setting(known["fence_floor"], float(math.floor(extent.bottom_rel_home_m)), "at most", why, "flight")
    why = "the farthest place of the flight from home, errors counted"
    yield Setting(known["fence_radius"], float(math.ceil(extent.reach_m)), "at least", why, "flight")
    value, also = (3.0, (0.0, 1.0)) if autopilot is Autopilot.PX4 else (1.0, (0.0, 3.0) if copter else (0.0,))
    yield Setting(known["fence_action"], value, "equal", "a breach of a fence makes it return", "told", also)


def needed_groups(
    settings: Sequence[Setting], autopilot: Autopilot, values: Mapping[str, float] | None = None
) -> tuple[tuple[str, ...], ...]:
    """The names, by parameter, that the proof hangs on, so that silence is no answer.

    With ``values``, as they were read, those of fences that are off are not among them.
    """
    needed = [s for s in settings if s.needed]
    fences = [s for s in needed if is_fence(s.parameter.key)]
    groups = [s.parameter.group() for s in needed if s not in fences]
    if fences and not (values is not None and _off(values)):
        groups += FENCE_DECIDES[autopilot]
        known = values is not None and not unanswered(values, FENCE_DECIDES[autopilot])
        on = fences_in_force(values, autopilot, unread_m=1.0) if known and values is not None else None
        groups += [s.parameter.group() for s in fences if on is None or s.parameter.key in on]
    return tuple(groups)


def _off(values: Mapping[str, float]) -> bool:
    """Whether no fence is in force, whatever else was not read."""
    on = values.get("FENCE_AUTOENABLE", 0.0) != 0.0 or unanswered(values, [("FENCE_AUTOENABLE",)])
    return values.get("GF_ACTION") in (0.0, 1.0) or (values.get("FENCE_ENABLE") == 0.0 and not on)
