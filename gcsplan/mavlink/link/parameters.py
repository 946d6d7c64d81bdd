"""Failsafe, return, fence and corner parameters: which are read, and what they mean for a mission; none is written."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.figures import raised
from gcsplan.mavlink.link.numbers import finite, whole
from gcsplan.mavlink.link.preflight import distance_m
from gcsplan.mavlink.mission.autopilots import PX4, profile_of
from gcsplan.mavlink.mission.commands import RTL, TAKEOFF
from gcsplan.mavlink.mission.fences import CIRCLE, FENCE_DECIDES, FLOOR, POLYGON, SAFETY, TOP, fences_in_force
from gcsplan.mavlink.mission.mission import GLOBAL, RELATIVE, Mission
from gcsplan.mavlink.mission.parameter_list import Setting, off
from gcsplan.mavlink.mission.parameter_names import PARAMETERS
from gcsplan.mavlink.mission.return_altitude import on_board, returns_otherwise
from gcsplan.mavlink.mission.return_route import Route, takes_another_route
from gcsplan.vehicle import COPTER_RETURN_WAITS_S, DEFAULT_LEAN_DEG, Autopilot, fastest_at_m_s, lean_for_deg

Values = Mapping[str, float]

GROUPS: dict[Autopilot, tuple[tuple[str, ...], ...]] = {
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

_LEAN_ANGLE = {"ANGLE_MAX": 0.01, "ATC_ANGLE_MAX": 1.0}
_RETURN_ENDS = {"RTL_ALT_FINAL": 100.0, "RTL_ALT_FINAL_M": 1.0}
_SAME_DEG = 0.05
_FLOWN_PITCH_DEG = 15.0  # TECS_PITCH_MAX, default
_FAILSAFES = {
    "FS_THR_ENABLE": "loss of radio control", "THR_FAILSAFE": "loss of radio control",
    "NAV_RCL_ACT": "loss of radio control", "FS_GCS_ENABLE": "loss of the ground station",
    "FS_GCS_ENABL": "loss of the ground station", "NAV_DLL_ACT": "loss of the ground station",
    "BATT_FS_LOW_ACT": "a low battery", "COM_LOW_BAT_ACT": "a low battery",
}  # fmt: skip
_SAME_M, _SAME_S = 0.5, 0.5
_ENABLED = {1.0: "the take-off", 2.0: "the take-off", 3.0: "arming"}  # FENCE_AUTOENABLE
_TOLD_ELSEWHERE = {"return_altitude", "return_waits", "return_end", "return_type", "pitch", "radius", "radius_height"}


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


def lean_on_board_deg(values: Values) -> float | None:
    """Return the largest lean angle of parameters that were read, degrees; None if it was not read."""
    name = next((n for n in _LEAN_ANGLE if math.isfinite(values.get(n, math.nan))), None)
    return None if name is None else values[name] * _LEAN_ANGLE[name]


def lean_shortage(values: Values, speed_m_s: float) -> str:
    """Return in words by how much the lean angle on board is too small for a speed, and the cure; empty if it is not.

    Empty, too, if it was not read.
    """
    name = next((n for n in _LEAN_ANGLE if math.isfinite(values.get(n, math.nan))), None)
    needs_deg = lean_for_deg(speed_m_s)
    if name is None or values[name] * _LEAN_ANGLE[name] >= needs_deg - _SAME_DEG:
        return ""
    leans_deg = values[name] * _LEAN_ANGLE[name]
    return (
        f"{name} is {values[name]:g} on board: it leans by {leans_deg:g}° at most, which allows about "
        f"{fastest_at_m_s(leans_deg):.3g} m/s, and {speed_m_s:.3g} m/s are commanded: set {name} "
        f"{math.ceil(needs_deg - _SAME_DEG) / _LEAN_ANGLE[name]:g}, or plan with lean_angle_deg: {leans_deg:g}"
    )


@dataclass(frozen=True, slots=True)
class _Extent:
    top_rel_home_m: float
    reach_m: float


def judge_parameters(
    values: Values,
    mission: Mission,
    *,
    rtl_rel_home_m: float | None = None,
    advised_rel_home_m: float | None = None,
    expected: Values | None = None,
    route: Route | None = None,
    settings: Sequence[Setting] = (),
) -> list[str]:
    """Return in words which ``values`` do not fit ``mission``; nothing is changed on board.

    ``rtl_rel_home_m``: the return altitude that the mission was checked with, m above home; ``advised_rel_home_m``: the
    one to set, if that check found it better. ``expected``: the values that the user expects, by name. ``route``: the
    one that the return was judged by. ``settings``: the list that it was judged with, whose fences `settings_words`
    tells.
    """
    label = profile_of(mission.autopilot).label
    if not values:
        return [f"no parameters could be read: failsafe, return and fence settings of {label} were not compared"]
    values, odd = _numbers(values)
    found = odd + [
        f"{name} is {values[name]:g} on board, {want:g} is expected"
        for name, want in (expected or {}).items()
        if name in values and not math.isclose(values[name], want, rel_tol=1e-6, abs_tol=1e-6)
    ]
    found += [f"{name} could not be read, {want:g} is expected" for name, want in (expected or {}).items()
              if name not in values]  # fmt: skip
    if route != "mission":
        found += _return_altitude(values, rtl_rel_home_m, advised_rel_home_m)
    found += [words] if (words := takes_another_route(values, mission, route)) else []
    found += [words] if (words := returns_otherwise(values)) else []
    found += _over_home(values, mission, route)
    if not settings:
        found += _fences(values, mission.autopilot, _extent(mission))
    found += _lean(values, mission)
    found += _climb_out(values, mission)
    off = [f"{_FAILSAFES[name]} ({name})" for name in _FAILSAFES if values.get(name) == 0]
    if off:
        found.append("no failsafe action on board for " + ", ".join(off))
    return found


def judge_fence_parameters(values: Values) -> list[str]:
    """Return in words why a fence may not be enforced on board; nothing is changed on board."""
    if not values:
        return ["no parameters could be read: whether the fence is enforced is not known"]
    values, found = _numbers(values)
    if values.get("FENCE_ENABLE") == 0:
        others = _other_fences(values)
        too = f"; enabling it also puts into force {', and '.join(others)}" if others else ""
        itself = values.get("FENCE_AUTOENABLE", 0.0)
        words = "FENCE_ENABLE is 0 on board: the fence is kept and not enforced until it is enabled"
        if itself in _ENABLED:
            words = f"FENCE_AUTOENABLE is {itself:g} on board: the fence is enforced from {_ENABLED[itself]} on"
        found.append(words + too)
    kinds = values.get("FENCE_TYPE")
    if kinds is not None and not _bits(kinds) & POLYGON:
        found.append(f"FENCE_TYPE is {kinds:g} on board: polygons and circles (4) are not among the fences in force")
    if values.get("FENCE_ACTION") == 0 or values.get("GF_ACTION") == 0:
        found.append("the fence's action on board is none: a breach is only reported")
    return found


def _other_fences(values: Values) -> list[str]:
    """The fences that FENCE_ENABLE also enables, in words: those of FENCE_TYPE that are no polygons and circles."""
    kinds = values.get("FENCE_TYPE")
    if kinds is None:
        return ["what FENCE_TYPE says, which could not be read (a circle around home, a highest altitude)"]
    known = [
        (CIRCLE, "FENCE_RADIUS", "the circle of {} around home"),
        (TOP, "FENCE_ALT_MAX", "the ceiling at {} above home"),
        (FLOOR, "FENCE_ALT_MIN", "the floor at {} above home"),
    ]
    return [
        what.format(f"{values[name]:g} m" if name in values else "a height or radius that could not be read")
        + f" ({name}; FENCE_TYPE {kinds:g})"
        for bit, name, what in known
        if _bits(kinds) & bit
    ]


def settings_words(settings: Sequence[Setting], values: Values, autopilot: Autopilot) -> list[str]:
    """Which parameters on board are outside of what the mission was judged with; others tell of some of them."""
    return [o.describe() for o in off(settings, values, autopilot) if o.setting.parameter.key not in _TOLD_ELSEWHERE]


def _numbers(values: Values) -> tuple[Values, list[str]]:
    """Return the finite ones of ``values``, and a line of text for each other one."""
    good = {name: value for name, value in values.items() if math.isfinite(value)}
    return good, [f"{name} on board is no number: it was not compared" for name in values if name not in good]


def _bits(value: float) -> int:
    """Return a bit set that was received as a float; 0 if it is not a whole number."""
    return whole(value, 0, 2**31 - 1) or 0


def _return_altitude(values: Values, checked_m: float | None, advised_m: float | None) -> list[str]:
    parameter = on_board(values)
    if parameter is None:
        return [] if checked_m is None else ["the return altitude on board could not be read"]
    name, height_m = parameter.name, parameter.metres(values[parameter.name])
    if checked_m is None:
        return [f"after a failsafe the return is at {height_m:g} m above home ({name}); that return was not checked"]
    wanted_m = checked_m if advised_m is None else advised_m
    if abs(height_m - checked_m) > _SAME_M:
        return [
            f"the return is at {height_m:g} m above home ({name}), but was checked at {checked_m:g} m: set "
            f"{parameter.setting(wanted_m)}"
        ]
    if abs(height_m - wanted_m) > _SAME_M:
        return [f"the return is at {height_m:g} m above home ({name}), as judged: set {parameter.setting(wanted_m)}"]
    return []


def _over_home(values: Values, mission: Mission, route: Route | None) -> list[str]:
    """That a return waits over home for another time than is counted, or does not land; one by the mission does."""
    if route == "mission" and not any(item.command == RTL for item in mission.items):
        return []
    found = []
    waits_s = values.get("RTL_LOIT_TIME", 1000.0 * COPTER_RETURN_WAITS_S) / 1000.0
    if abs(waits_s - COPTER_RETURN_WAITS_S) >= _SAME_S:
        found.append(
            f"RTL_LOIT_TIME is {1000.0 * waits_s:g} on board: a return waits {waits_s:g} s over home before it "
            f"descends, and times and battery count {COPTER_RETURN_WAITS_S:g} s"
        )
    if values.get("RTL_LAND_DELAY", 0.0) < 0.0:
        found.append(
            f"RTL_LAND_DELAY is {values['RTL_LAND_DELAY']:g} on board: a return ends in a hover at RTL_DESCEND_ALT, "
            f"until the battery is empty or it is landed by hand; it was judged as a landing, which RTL_LAND_DELAY 0 "
            f"makes"
        )
    for name, metre in _RETURN_ENDS.items():
        if values.get(name, 0.0) > 0.0:
            found.append(
                f"{name} is {values[name]:g} on board: a return ends in a hover {values[name] / metre:g} m above home, "
                f"until the battery is empty or it is landed by hand; it was judged as a landing, which {name} 0 makes"
            )
    return found


def _climb_out(values: Values, mission: Mission) -> list[str]:
    """That a plane may climb out more steeply than those that were flown to judge how far it rises too high."""
    pitch_deg = values.get("TECS_PITCH_MAX", _FLOWN_PITCH_DEG)
    takes_off = any(item.command == TAKEOFF for item in mission.items)
    if mission.autopilot is not Autopilot.ARDUPLANE or not takes_off or 0.0 < pitch_deg <= _FLOWN_PITCH_DEG + _SAME_DEG:
        return []
    return [
        f"TECS_PITCH_MAX is {pitch_deg:g} on board: with more than {_FLOWN_PITCH_DEG:g}° (0: with PTCH_LIM_MAX_DEG) an "
        f"aircraft with power to spare rises further above its take-off's altitude than the 16 m that are judged "
        f"unless climb_out_m_s tells its climb: set {_FLOWN_PITCH_DEG:g}, or give climb_out_m_s"
    ]


def _lean(values: Values, mission: Mission) -> list[str]:
    speed_m_s = mission.commanded_m_s
    if mission.autopilot is not Autopilot.ARDUCOPTER or lean_for_deg(speed_m_s) <= DEFAULT_LEAN_DEG + _SAME_DEG:
        return []
    if not any(name in values for name in _LEAN_ANGLE):
        needs_deg = math.ceil(lean_for_deg(speed_m_s) - _SAME_DEG)
        words = f"the largest lean angle on board could not be read: {speed_m_s:.3g} m/s need about {needs_deg}°"
        return [words]
    short = lean_shortage(values, speed_m_s)
    return [short] if short else []


def _fences(values: Values, autopilot: Autopilot, extent: _Extent) -> list[str]:
    """The fences in force that the items leave: what is told of a mission that was not judged in its world."""
    known, on = SAFETY[autopilot], fences_in_force(values, autopilot)
    limits = [("fence_top", "high", extent.top_rel_home_m), ("fence_radius", "far", extent.reach_m)]
    return [
        f"the mission goes {raised(reach, 0):.0f} m {way} and the fence on board ends at {ends:g} m ({name})"
        for key, way, reach in limits
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
