"""Failsafe, return, fence and corner parameters: which are read, and what they mean for a mission; none is written.

PX4's speeds are held against what a mission was planned with. It flies no faster than its parameters allow, and a
mission can command the cruise speed alone. A vehicle that is slower than planned keeps the legs, but not the times.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.mavlink.link.session.preflight import distance_m
from gcsplan.mavlink.link.watch import finite, whole
from gcsplan.mavlink.mission.autopilots import PX4, profile_of
from gcsplan.mavlink.mission.commands import RTL, TAKEOFF
from gcsplan.mavlink.mission.fences import CIRCLE, FENCE_DECIDES, FLOOR, POLYGON, SAFETY, TOP, fences_in_force
from gcsplan.mavlink.mission.mission import GLOBAL, RELATIVE, Mission
from gcsplan.mavlink.mission.parameter_list import Setting, off
from gcsplan.mavlink.mission.parameter_names import PARAMETERS, ParameterValues
from gcsplan.mavlink.mission.return_parameters import ReturnRoute, on_board, returns_otherwise, takes_another_route
from gcsplan.notes.note import Note
from gcsplan.vehicle import (
    COPTER_RETURN_WAITS_S,
    DEFAULT_LEAN_DEG,
    OVER_TAKEOFF_M,
    Autopilot,
    Vehicle,
    fastest_at_m_s,
    lean_for_deg,
)

PARAMETER_GROUPS: dict[Autopilot, tuple[tuple[str, ...], ...]] = {
    autopilot: (
        *(parameter.group() for parameter in (*PARAMETERS[autopilot].values(), *SAFETY[autopilot].values())),
        *(group for group in FENCE_DECIDES[autopilot] if group not in {p.group() for p in SAFETY[autopilot].values()}),
        *((("RTL_AUTOLAND",),) if autopilot is Autopilot.ARDUPLANE else ()),
    )
    for autopilot in Autopilot
}
"""Parameters that are read before a mission is sent. Names in one group are one parameter in different versions."""

FENCE_GROUPS: dict[Autopilot, tuple[tuple[str, ...], ...]] = {
    autopilot: (*FENCE_DECIDES[autopilot], ("FENCE_RADIUS",), ("FENCE_ALT_MAX",), ("FENCE_ALT_MIN",))
    for autopilot in (Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE)
} | {Autopilot.PX4: FENCE_DECIDES[Autopilot.PX4]}
"""Parameters that are read before a fence is sent."""

_LEAN_ANGLE = {"ANGLE_MAX": 0.01, "ATC_ANGLE_MAX": 1.0, "MPC_TILTMAX_AIR": 1.0}
_RETURN_ENDS = {"RTL_ALT_FINAL": 100.0, "RTL_ALT_FINAL_M": 1.0}
_SAME_DEG = 0.05
_FLOWN_PITCH_DEG = 15.0  # TECS_PITCH_MAX, default
_FAILSAFE_NAMES = {
    "FS_THR_ENABLE": "loss of radio control", "THR_FAILSAFE": "loss of radio control",
    "NAV_RCL_ACT": "loss of radio control", "FS_GCS_ENABLE": "loss of the ground station",
    "FS_GCS_ENABL": "loss of the ground station", "NAV_DLL_ACT": "loss of the ground station",
    "BATT_FS_LOW_ACT": "a low battery", "COM_LOW_BAT_ACT": "a low battery",
}  # fmt: skip
_SAME_M, _SAME_S = 0.5, 0.5
_ENABLED = {1.0: "the take-off", 2.0: "the take-off", 3.0: "arming"}  # FENCE_AUTOENABLE
_IN_OTHER_NOTES = {"return_altitude", "return_waits", "return_end", "return_type", "pitch", "radius", "radius_height"}


def decode_value(message: Any, mav_autopilot: int) -> float:
    """Return the number in a PARAM_VALUE: ArduPilot casts to float, PX4 stores an integer's bytes in the float field.

    NaN if it is not a number: NaN, infinity, or a float beyond float32.
    """
    integer = message.param_type <= dialect.MAV_PARAM_TYPE_INT32
    try:
        if mav_autopilot == PX4 and integer:
            return float(struct.unpack("<i", struct.pack("<f", message.param_value))[0])
    except (struct.error, OverflowError):
        return math.nan
    value = finite(message.param_value)
    return math.nan if value is None else value


def parameter_name(message: Any) -> str:
    """Return the name in a PARAM_VALUE."""
    name = message.param_id
    return name if isinstance(name, str) else bytes(name).split(b"\0")[0].decode(errors="replace")


def lean_on_board_deg(values: ParameterValues) -> float | None:
    """Return the largest lean angle of parameters that were read, degrees; None if it was not read."""
    name = next((n for n in _LEAN_ANGLE if math.isfinite(values.get(n, math.nan))), None)
    return None if name is None else values[name] * _LEAN_ANGLE[name]


def lean_shortage(values: ParameterValues, speed_m_s: float) -> Note | None:
    """Return that the lean angle on board is too small for a speed; None if it is not, or was not read."""
    name = next((n for n in _LEAN_ANGLE if math.isfinite(values.get(n, math.nan))), None)
    needs_deg = lean_for_deg(speed_m_s)
    if name is None or values[name] * _LEAN_ANGLE[name] >= needs_deg - _SAME_DEG:
        return None
    leans_deg = values[name] * _LEAN_ANGLE[name]
    return Note(
        "lean_angle_too_small", name=name, value=values[name], lean_deg=leans_deg,
        most_m_s=float(fastest_at_m_s(leans_deg)), speed_m_s=speed_m_s,
        wanted=math.ceil(needs_deg - _SAME_DEG) / _LEAN_ANGLE[name],
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Extent:
    top_rel_home_m: float
    reach_m: float


def judge_parameters(
    values: ParameterValues,
    mission: Mission,
    *,
    rtl_rel_home_m: float | None = None,
    advised_rel_home_m: float | None = None,
    expected: ParameterValues | None = None,
    route: ReturnRoute | None = None,
    settings: Sequence[Setting] = (),
) -> list[Note]:
    """Return which ``values`` do not fit ``mission``; nothing is changed on board.

    ``rtl_rel_home_m``: the return altitude that the mission was checked with, m above home; ``advised_rel_home_m``: the
    one to set, if that check found it better. ``expected``: the values that the user expects, by name. ``route``: the
    one that the return was judged by. ``settings``: the list that it was judged with, whose fences `settings_words`
    tells.
    """
    label = profile_of(mission.autopilot).label
    if not values:
        return [Note("no_parameter_read", autopilot=label)]
    values, odd = _numbers(values)
    found = odd + [
        Note("parameter_not_expected", name=name, value=values[name], wanted=want)
        for name, want in (expected or {}).items()
        if name in values and not math.isclose(values[name], want, rel_tol=1e-6, abs_tol=1e-6)
    ]
    found += [Note("expected_parameter_unread", name=name, wanted=want) for name, want in (expected or {}).items()
              if name not in values]  # fmt: skip
    if route != "mission":
        found += _return_altitude(values, rtl_rel_home_m, advised_rel_home_m)
    found += [note] if (note := takes_another_route(values, mission, route)) else []
    found += [note] if (note := returns_otherwise(values)) else []
    found += _over_home(values, mission, route)
    if not settings:
        found += _fences(values, mission.autopilot, _extent(mission))
    found += _lean(values, mission)
    found += _climb_out(values, mission)
    off = tuple(f"{_FAILSAFE_NAMES[name]} ({name})" for name in _FAILSAFE_NAMES if values.get(name) == 0)
    return [*found, Note("no_failsafe", failsafes=off)] if off else found


def judge_fence_parameters(values: ParameterValues) -> list[Note]:
    """Return why a fence may not be enforced on board; nothing is changed on board."""
    if not values:
        return [Note("no_fence_parameter_read")]
    values, found = _numbers(values)
    if values.get("FENCE_ENABLE") == 0:
        others = tuple(_other_fences(values))
        itself = values.get("FENCE_AUTOENABLE", 0.0)
        fence = Note("fence_not_enforced")
        if itself in _ENABLED:
            fence = Note("fence_enforced_by_itself", value=itself, moment=_ENABLED[itself])
        found.append(Note("fence_enables_others", fence=fence, others=others) if others else fence)
    kinds = values.get("FENCE_TYPE")
    if kinds is not None and not _bits(kinds) & POLYGON:
        found.append(Note("fence_type_without_polygons", kinds=kinds))
    if values.get("FENCE_ACTION") == 0 or values.get("GF_ACTION") == 0:
        found.append(Note("fence_breach_only_reported"))
    return found


def _other_fences(values: ParameterValues) -> list[Note]:
    """The fences that FENCE_ENABLE also enables: the kinds of FENCE_TYPE beside polygons and circles."""
    kinds = values.get("FENCE_TYPE")
    if kinds is None:
        return [Note("fence_type_unread")]
    found = []
    if _bits(kinds) & CIRCLE:
        found.append(Note("circle_around_home", at=_at(values, "FENCE_RADIUS"), kinds=kinds))
    if _bits(kinds) & TOP:
        found.append(Note("ceiling_above_home", at=_at(values, "FENCE_ALT_MAX"), kinds=kinds))
    if _bits(kinds) & FLOOR:
        found.append(Note("floor_above_home", at=_at(values, "FENCE_ALT_MIN"), kinds=kinds))
    return found


def _at(values: ParameterValues, name: str) -> Note:
    """A height or radius on board."""
    return Note("metres_on_board", at_m=values[name]) if name in values else Note("metres_on_board_unread")


def settings_words(settings: Sequence[Setting], values: ParameterValues, autopilot: Autopilot) -> list[Note]:
    """Notes on the parameters on board that are outside of what the mission was judged with, but for
    `_IN_OTHER_NOTES`."""
    return [o.note() for o in off(settings, values, autopilot) if o.setting.parameter.key not in _IN_OTHER_NOTES]


def _numbers(values: ParameterValues) -> tuple[ParameterValues, list[Note]]:
    """Return the finite ones of ``values``, and a line of text for each other one."""
    good = {name: value for name, value in values.items() if math.isfinite(value)}
    return good, [Note("parameter_is_no_number", name=name) for name in values if name not in good]


def _bits(value: float) -> int:
    """Return a bit set that was received as a float; 0 if it is not a whole number."""
    return whole(value, 0, 2**31 - 1) or 0


def _return_altitude(values: ParameterValues, checked_m: float | None, advised_m: float | None) -> list[Note]:
    parameter = on_board(values)
    if parameter is None:
        return [] if checked_m is None else [Note("return_altitude_unread")]
    name, height_m = parameter.name, parameter.metres(values[parameter.name])
    if checked_m is None:
        return [Note("return_not_checked", rel_home_m=height_m, name=name)]
    set_m = checked_m if advised_m is None else advised_m
    if abs(height_m - checked_m) > _SAME_M:
        return [
            Note(
                "return_at_another_altitude", rel_home_m=height_m, name=name, checked_m=checked_m,
                setting=parameter.setting(set_m),
            )
        ]  # fmt: skip
    if abs(height_m - set_m) > _SAME_M:
        return [Note("return_altitude_advised", rel_home_m=height_m, name=name, setting=parameter.setting(set_m))]
    return []


def _over_home(values: ParameterValues, mission: Mission, route: ReturnRoute | None) -> list[Note]:
    """That a return waits over home for another time than is counted, or does not land; one by the mission does."""
    if route == "mission" and not any(item.command == RTL for item in mission.items):
        return []
    found = []
    waits_s = values.get("RTL_LOIT_TIME", 1000.0 * COPTER_RETURN_WAITS_S) / 1000.0
    if abs(waits_s - COPTER_RETURN_WAITS_S) >= _SAME_S:
        found.append(
            Note("return_waits_otherwise", value=1000.0 * waits_s, waits_s=waits_s, counted_s=COPTER_RETURN_WAITS_S)
        )
    if values.get("RTL_LAND_DELAY", 0.0) < 0.0:
        found.append(Note("hovers_at_descend_altitude", value=values["RTL_LAND_DELAY"]))
    for name, metre in _RETURN_ENDS.items():
        if values.get(name, 0.0) > 0.0:
            found.append(Note("hovers_over_home", name=name, value=values[name], rel_home_m=values[name] / metre))
    return found


def _climb_out(values: ParameterValues, mission: Mission) -> list[Note]:
    """That a plane may climb out more steeply than those that were flown to judge how far it rises too high."""
    pitch_deg = values.get("TECS_PITCH_MAX", _FLOWN_PITCH_DEG)
    takes_off = any(item.command == TAKEOFF for item in mission.items)
    if mission.autopilot is not Autopilot.ARDUPLANE or not takes_off or 0.0 < pitch_deg <= _FLOWN_PITCH_DEG + _SAME_DEG:
        return []
    return [Note("pitch_not_flown", value=pitch_deg, flown_deg=_FLOWN_PITCH_DEG, judged_m=OVER_TAKEOFF_M)]


def _lean(values: ParameterValues, mission: Mission) -> list[Note]:
    speed_m_s = mission.commanded_m_s
    if mission.autopilot is not Autopilot.ARDUCOPTER or lean_for_deg(speed_m_s) <= DEFAULT_LEAN_DEG + _SAME_DEG:
        return []
    if not any(name in values for name in _LEAN_ANGLE):
        needs_deg = math.ceil(lean_for_deg(speed_m_s) - _SAME_DEG)
        return [Note("lean_angle_unread", speed_m_s=speed_m_s, needs_deg=needs_deg)]
    short = lean_shortage(values, speed_m_s)
    return [short] if short else []


def _fences(values: ParameterValues, autopilot: Autopilot, extent: _Extent) -> list[Note]:
    """Notes on the fences in force that the items leave, for a mission that was not judged in its world."""
    known, on = SAFETY[autopilot], fences_in_force(values, autopilot)
    limits = [("fence_top", extent.top_rel_home_m), ("fence_radius", extent.reach_m)]
    return [
        Note(
            "mission_above_fence" if key == "fence_top" else "mission_beyond_fence",
            reach_m=reach,
            end_m=ends,
            name=name,
        )
        for key, reach in limits
        if key in on
        for name in known[key].group()
        if (ends := values.get(name)) is not None and reach > ends
    ]


def _extent(mission: Mission) -> _Extent:
    home = mission.home
    top = reach = 0.0
    for item in mission.items:
        if item.x or item.y:
            reach = max(reach, distance_m(home.lat_e7 / 1e7, home.lon_e7 / 1e7, item.lat_deg, item.lon_deg))
            if item.frame in (RELATIVE, 6):
                top = max(top, item.z)
            elif item.frame in (GLOBAL, 5):
                top = max(top, item.z - home.amsl_m)
    return _Extent(top, reach)


_SAME = 0.01
"""Part by which a parameter may fall short of what was planned with."""


def speed_shortage(values: ParameterValues, vehicle: Vehicle, commanded_m_s: float) -> Note | None:
    """Why a vehicle with these parameters cannot fly the commanded speed, and the cure; None if it can.

    None, too, if MPC_XY_VEL_MAX was not read, or bounds nothing in the plan.
    """
    most = values.get("MPC_XY_VEL_MAX", math.nan)
    if vehicle.vel_max_m_s is None or not most < commanded_m_s * (1.0 - _SAME):
        return None
    return Note("velocity_too_small", value=most, speed_m_s=commanded_m_s, wanted=math.ceil(commanded_m_s))


def slower_words(values: ParameterValues, vehicle: Vehicle) -> list[Note]:
    """Which parameters on board make a vehicle slower than it was planned; empty for another autopilot."""
    if vehicle.autopilot is not Autopilot.PX4 or not vehicle.smooths:
        return []
    corner = values.get("MPC_XY_TRAJ_P", math.nan) * values.get("MPC_ACC_HOR", math.nan)
    planned = [
        ("MPC_ACC_HOR", values.get("MPC_ACC_HOR", math.nan), vehicle.accel_m_s2, "accel_m_s2"),
        ("MPC_JERK_AUTO", values.get("MPC_JERK_AUTO", math.nan), vehicle.leg_jerk_m_s3, "leg_jerk_m_s3"),
        ("MPC_XY_TRAJ_P times MPC_ACC_HOR", corner, vehicle.corner_accel_m_s2, "corner_accel_m_s2"),
        ("MPC_Z_V_AUTO_UP", values.get("MPC_Z_V_AUTO_UP", math.nan), vehicle.climb_m_s, "climb_m_s"),
        ("MPC_Z_V_AUTO_DN", values.get("MPC_Z_V_AUTO_DN", math.nan), vehicle.descent_m_s, "descent_m_s"),
    ]
    found = [
        Note("slower_than_planned", name=name, value=value, wanted=expected, planned_key=key)
        for name, value, expected, key in planned
        if value < expected * (1.0 - _SAME)
    ]
    returns = values.get("MPC_XY_CRUISE", math.nan)
    if vehicle.return_speed_m_s is not None and returns < vehicle.return_speed_m_s * (1.0 - _SAME):
        found.append(Note("returns_slower_than_planned", value=returns, speed_m_s=vehicle.return_speed_m_s))
    return [Note("arrives_later", reasons=tuple(found))] if found else []
