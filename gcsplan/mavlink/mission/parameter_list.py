"""The parameters that a mission was judged with: one list for each vehicle, made from the plan alone.

Each `Setting` says what the proof assumes of one parameter, what it may be, and why. A vehicle's parameters are held
against it (`off`), and the motion that they make is `vehicle_on_board`. `parameter_file` is the list as ground
stations load it. Nothing here is ever written to a vehicle.

`safety_list` has the rows of fences and failsafes. Each limit of a fence that is in force must hold the whole flight
with its errors. A failsafe either returns, as the way home is judged, or lets the mission go on; another action ends
where nobody judged.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from gcsplan.mavlink.mission.commands import (
    DO_CHANGE_SPEED,
    LAND,
    LOITER_TIME,
    LOITER_TO_ALT,
    LOITER_TURNS,
    LOITER_UNLIM,
    RTL,
    TAKEOFF,
    VTOL_LAND,
    WAYPOINT,
)
from gcsplan.mavlink.mission.fences import FENCE_DECIDES, FENCE_MARGIN_M, SAFETY, acts, fences_in_force, is_fence
from gcsplan.mavlink.mission.mission import FRAME_SYNONYMS, TERRAIN, Mission
from gcsplan.mavlink.mission.parameter_names import PARAMETERS, Name, OnBoard, Parameter, unanswered
from gcsplan.mavlink.mission.return_parameters import AUTO_RTL
from gcsplan.notes.note import Note
from gcsplan.vehicle import BRAKES_M_S2, COPTER_CORNER_ACCEL, COPTER_PEAK_ACCEL, GRAVITY_M_S2, Autopilot, Vehicle
from gcsplan.world.geodesy.atmosphere import true_per_indicated

__all__ = [
    "FlightExtent",
    "Off",
    "Setting",
    "corners_as_it_leans",
    "needed_groups",
    "off",
    "parameter_list",
    "safety_list",
    "vehicle_on_board",
]

SettingRule = Literal["equal", "at least", "at most"]
Matters = Literal["time", "pace", "turns", "return", "flight", "report"]

SAME = 0.01
"""Part by which a value may differ and still count as the same."""

CIRCLE_M = 60.0
"""WP_LOITER_RAD, default: the radius of the circle over home, and of circles without a radius of their own."""

RETURN_ROLL_DEG = 45.0
"""ROLL_LIMIT_DEG, default: the bank with which a plane's turn about is judged."""

ROLL_SPARE = 1.1
"""A plane needs more bank than an even turn takes: on its way into it, and to come back from beside it."""


@dataclass(frozen=True, slots=True)
class Setting:
    """The value that the proof assumes of a parameter. ``value`` is in the parameter's unit.

    ``matters``: what another value changes: the ``time`` (it is judged again, with the separation), the ``pace`` (the
    time, which no other value can be counted for), where the vehicle ``turns`` (judged again with
    `turn_parameters.Tuning`, but for the return from anywhere), the ``return`` or the ``flight`` itself (the proof does
    not hold), or nothing but a ``report``. ``also``: other values that are within the rule, like a 0 that switches it
    off. ``may_lack``: some boards do not have it, and fly as assumed.
    """

    parameter: Parameter
    value: float
    rule: SettingRule
    why: Note
    matters: Matters
    also: tuple[float, ...] = ()
    may_lack: bool = False

    @property
    def needed(self) -> bool:
        """Whether the proof hangs on it, so that silence is no answer."""
        return self.matters != "report" and not self.may_lack

    def allows(self, amount: float) -> bool:
        """Whether an amount on board is within the rule."""
        spare = SAME * abs(self.value) + 1e-6
        if amount in self.also:
            return True
        if self.rule == "equal":
            return abs(amount - self.value) <= spare
        return amount >= self.value - spare if self.rule == "at least" else amount <= self.value + spare

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON: one entry for each name."""
        names = [
            {"parameter": n.name, "value": n.value(self.value), "versions": n.versions or "all"}
            for n in self.parameter.names
        ]
        return {
            "names": names, "value": self.value, "unit": self.parameter.unit, "rule": self.rule, "also": [*self.also],
            "why": str(self.why), "why_data": self.why.as_dict(),
        }  # fmt: skip

    def rule_words(self) -> str:
        """``at least``, with the other values that are within the rule; empty for one value alone."""
        rule = "" if self.rule == "equal" else self.rule
        others = " or ".join(f"{amount:g}" for amount in self.also)
        return f"{rule}, or {others}" if rule and others else f"or {others}" if others else rule


@dataclass(frozen=True, slots=True)
class Off:
    """A parameter on board that is outside of its rule. ``amount`` is in the parameter's unit."""

    setting: Setting
    name: Name
    amount: float
    raw: float

    def note(self) -> Note:
        """The value on board, the assumed value and why it is assumed, and the value to set."""
        expected, rule = self.name.value(self.setting.value), self.setting.rule
        least = "" if rule == "equal" else f"{rule} "
        assumed = f"{least}{expected:.6g}" + "".join(f" or {self.name.value(amount):g}" for amount in self.setting.also)
        return Note(
            "parameter_not_assumed", name=self.name.name, value=self.raw, assumed=assumed, why=self.setting.why,
            wanted=expected,
        )  # fmt: skip


def commands_speed(mission: Mission) -> bool:
    """Whether a mission sets its own cruise speed."""
    return any(item.command == DO_CHANGE_SPEED for item in mission.items)


def parameter_list(
    mission: Mission, vehicle: Vehicle, *, rtl_rel_home_m: float | None = None, returns: bool = False
) -> tuple[Setting, ...]:
    """The settings that ``mission`` was judged with, for the autopilot of ``vehicle``.

    ``rtl_rel_home_m``: the return altitude above home that was judged. ``returns``: a return from anywhere is part of
    what was judged; an RTL item always is. What an ideal vehicle (of the papers' worlds) does not bound is not among
    them.
    """
    ends = any(item.command == RTL for item in mission.items)
    rows = {Autopilot.ARDUCOPTER: _copter, Autopilot.ARDUPLANE: _plane, Autopilot.PX4: _px4}
    return tuple(rows[vehicle.autopilot](mission, vehicle, rtl_rel_home_m, ends, returns or ends))


def _speed_m_s(mission: Mission, vehicle: Vehicle) -> float:
    return mission.commanded_m_s or vehicle.speed_max_m_s


def _copter(
    mission: Mission, vehicle: Vehicle, rtl_rel_home_m: float | None, ends: bool, returns: bool
) -> list[Setting]:
    known = PARAMETERS[Autopilot.ARDUCOPTER]
    own: Matters = "report" if commands_speed(mission) else "time"
    back: Matters = "return" if returns else "report"
    home = vehicle.return_speed_m_s or vehicle.speed_max_m_s
    lands = _pace(mission, vehicle, LAND, RTL)
    rows = [
        Setting(known["speed"], _speed_m_s(mission, vehicle), "equal",
                Note("assumed_speed_or_interrupted"), own),
        Setting(known["return_speed"], home, "equal", Note("assumed_return_speed"), "time" if ends else "report"),
        Setting(known["climb"], vehicle.climb_m_s, "equal", Note("assumed_motion", motion="climb_m_s"), "time"),
        Setting(known["descent"], vehicle.descent_m_s, "equal", Note("assumed_motion", motion="descent_m_s"), "time"),
        Setting(known["land"], vehicle.land_m_s, "equal", Note("assumed_last_ten_metres"), "time"),
        Setting(known["land_high"], 0.0, "equal", Note("assumed_landing_higher_up"), lands,
                (vehicle.descent_m_s,)),
        Setting(known["land_low"], 10.0, "equal", Note("assumed_slow_landing"), lands),
        Setting(known["accel"], COPTER_PEAK_ACCEL * vehicle.accel_m_s2, "equal",
                Note("assumed_acceleration"), "time"),
        Setting(known["vertical_accel"], vehicle.vertical_accel_m_s2, "equal",
                Note("assumed_key", motion="vertical_accel_m_s2"), "time"),
        Setting(known["corner_accel"], COPTER_CORNER_ACCEL * vehicle.corner_accel_m_s2, "equal",
                Note("assumed_in_corners"), "time"),
        Setting(known["jerk"], vehicle.leg_jerk_m_s3, "equal", Note("assumed_motion", motion="leg_jerk_m_s3"), "time"),
        Setting(known["radius"], 2.0, "at most", Note("assumed_corners_begin"), "turns"),
        Setting(known["return_altitude_type"], 0.0, "equal", Note("assumed_return_above_home"), back),
        Setting(known["cone"], 3.0, "at least", Note("assumed_return_cone"), back, also=(0.0,)),
        Setting(known["return_climb"], 0.0, "at most", Note("assumed_return_no_higher"), back),
        Setting(known["return_end"], 0.0, "at most", Note("assumed_return_lands"), "report"),
        Setting(known["return_waits"], vehicle.return_waits_s, "equal", Note("assumed_return_waits"),
                "time" if ends else "report"),
    ]  # fmt: skip
    if any(FRAME_SYNONYMS.get(item.frame, item.frame) == TERRAIN for item in mission.items):
        why = Note("assumed_terrain_margin")
        rows.append(Setting(known["terrain_margin"], 10.0, "equal", why, _pace(mission, vehicle, WAYPOINT)))
    return _finite(rows + _lean(known, mission, vehicle) + _altitude(known, rtl_rel_home_m, returns))


def _lean(known: Mapping[str, Parameter], mission: Mission, vehicle: Vehicle) -> list[Setting]:
    if vehicle.lean_angle_deg is None:
        return []
    why = Note("assumed_lean", speed_m_s=_speed_m_s(mission, vehicle))
    return [Setting(known["lean"], vehicle.lean_angle_deg, "at least", why, "time")]


def _pace(mission: Mission, vehicle: Vehicle, *commands: int) -> Matters:
    """Whether a parameter of these items decides the time; an ideal vehicle has none."""
    flown = any(item.command in commands for item in mission.items) and math.isfinite(vehicle.accel_m_s2)
    return "pace" if flown else "report"


def _altitude(known: Mapping[str, Parameter], rtl_rel_home_m: float | None, returns: bool) -> list[Setting]:
    if rtl_rel_home_m is None:
        return []
    why = Note("assumed_return_altitude", judged=returns)
    return [Setting(known["return_altitude"], rtl_rel_home_m, "equal", why, "report")]


def _plane(
    mission: Mission, vehicle: Vehicle, rtl_rel_home_m: float | None, ends: bool, returns: bool
) -> list[Setting]:
    known = PARAMETERS[Autopilot.ARDUPLANE]
    fastest = max(mission.commanded_m_s, vehicle.speed_max_m_s)
    slowest = _slowest_m_s(mission) or fastest
    back: Matters = "return" if returns else "report"
    circles = [CIRCLE_M, *([vehicle.turn_radius_m] if not returns else [])]
    uses_default = returns or any(_without_radius(item.command, item.params) for item in mission.items)
    rows = [
        Setting(known["speed"], vehicle.speed_max_m_s, "equal",
                Note("assumed_airspeed"), "time"),
        Setting(known["speed_most"], fastest, "at least", Note("assumed_fastest"), "flight"),
        Setting(known["speed_least"], slowest, "at most", Note("assumed_slowest"), "flight"),
        Setting(known["circle"], max(circles), "at most", Note("assumed_circles"),
                "flight" if uses_default else "report"),
        Setting(known["return_circle"], CIRCLE_M, "at most", Note("assumed_circle_over_home"), back),
        Setting(known["radius"], 90.0, "at most", Note("assumed_turns_begin"), "turns"),
        Setting(known["l1_period"], 17.0, "equal", Note("assumed_settling_time"), "turns"),
        Setting(known["l1_damping"], 0.75, "equal", Note("assumed_settling"), "turns"),
        Setting(known["pitch"], 15.0, "at most", Note("assumed_pitch"), "report"),
    ]  # fmt: skip
    roll_deg = RETURN_ROLL_DEG if returns else _roll_deg(mission, vehicle, fastest)
    if roll_deg > 0.0:
        why = Note("assumed_return_turns") if returns else Note("assumed_bank", speed_m_s=fastest)
        rows.append(Setting(known["roll"], roll_deg, "at least", why, "flight"))
    lift = Note("assumed_lift", vtol=vehicle.vtol)
    rows.append(Setting(known["lifts"], float(vehicle.vtol), "equal", lift, "flight", may_lack=not vehicle.vtol))
    if any(item.command == VTOL_LAND for item in mission.items):
        rows.append(Setting(known["brakes"], BRAKES_M_S2, "at least", Note("assumed_brakes"), "flight"))
    if vehicle.turn_radius_m > 0.0:
        rows.append(
            Setting(
                known["climb_most"], vehicle.climb_m_s, "at least", Note("assumed_key", motion="climb_m_s"), "report"
            )
        )
        rows.append(
            Setting(
                known["descent_most"],
                vehicle.descent_m_s,
                "at least",
                Note("assumed_key", motion="descent_m_s"),
                "report",
            )
        )
    return _finite(rows + _altitude(known, rtl_rel_home_m, returns))


def _slowest_m_s(mission: Mission) -> float:
    speeds = [i.params[1] for i in mission.items if i.command == DO_CHANGE_SPEED and i.params[0] == 0.0]
    return min((v for v in speeds if 0.0 < v < math.inf), default=0.0)


def _without_radius(command: int, params: Sequence[float]) -> bool:
    """Whether an item makes a plane circle with WP_LOITER_RAD (check.flight)."""
    if command == LOITER_TIME:
        return True
    number = {LOITER_UNLIM: 2, LOITER_TURNS: 2, LOITER_TO_ALT: 1}.get(command)
    return number is not None and not abs(params[number]) > 1.0


def _roll_deg(mission: Mission, vehicle: Vehicle, fastest_m_s: float) -> float:
    """The bank of the plan's tightest turn at its highest place, with some to spare; 0 without a turn radius.

    Circles are as wide as the turn radius at least.
    """
    if vehicle.turn_radius_m <= 0.0:
        return 0.0
    highest_m = max((item.z for item in mission.items if math.isfinite(item.z)), default=0.0) + mission.home.amsl_m
    true_m_s = fastest_m_s * float(true_per_indicated(min(highest_m, 10_000.0)))
    bank_deg = math.degrees(math.atan(true_m_s**2 / (GRAVITY_M_S2 * vehicle.turn_radius_m)))
    return min(ROLL_SPARE * bank_deg, RETURN_ROLL_DEG)


def _px4(mission: Mission, vehicle: Vehicle, rtl_rel_home_m: float | None, ends: bool, returns: bool) -> list[Setting]:
    known = PARAMETERS[Autopilot.PX4]
    back: Matters = "return" if returns else "report"
    home = vehicle.return_speed_m_s or vehicle.speed_max_m_s
    plain = commands_speed(mission)
    accel, lands = vehicle.accel_m_s2, _pace(mission, vehicle, LAND, RTL)
    rows = [
        Setting(known["speed_most"], _speed_m_s(mission, vehicle), "at least", Note("assumed_mission_speed"), "flight"),
        Setting(known["return_speed"], home, "equal", Note("assumed_return_speed_whatever"),
                "time" if ends or not plain else "report"),
        Setting(known["climb"], vehicle.climb_m_s, "equal", Note("assumed_motion", motion="climb_m_s"), "time"),
        Setting(known["descent"], vehicle.descent_m_s, "equal", Note("assumed_motion", motion="descent_m_s"), "time"),
        Setting(known["land"], vehicle.land_m_s, "equal", Note("assumed_last_metres"), "time"),
        Setting(known["land_high"], 10.0, "equal", Note("assumed_slower_landing"), lands),
        Setting(known["land_low"], 5.0, "equal", Note("assumed_slow_landing"), lands),
        Setting(known["takeoff"], 1.5, "equal", Note("assumed_first_metres"),
                _pace(mission, vehicle, TAKEOFF)),
        Setting(known["accel"], accel, "equal", Note("assumed_acceleration"), "time"),
        Setting(known["jerk"], vehicle.leg_jerk_m_s3, "equal", Note("assumed_motion", motion="leg_jerk_m_s3"), "time"),
        Setting(known["corner"], vehicle.corner_accel_m_s2 / accel if math.isfinite(accel) else math.inf, "equal",
                Note("assumed_over_acceleration"), "time"),
        Setting(known["radius"], 10.0, "at most", Note("assumed_reached"), "turns"),
        Setting(known["radius_height"], 0.8, "at most", Note("assumed_reached_height"), "turns"),
        Setting(known["return_type"], 0.0, "equal", Note("assumed_return_straight"), back),
        Setting(known["cone"], 45.0, "at most", Note("assumed_return_cone"), back),
        Setting(known["return_waits"], vehicle.return_waits_s, "equal", Note("assumed_return_waits"),
                "time" if ends else "report"),
    ]  # fmt: skip
    return _finite(rows + _lean(known, mission, vehicle) + _altitude(known, rtl_rel_home_m, returns))


def _finite(rows: Sequence[Setting]) -> list[Setting]:
    """The rows that say a number: an ideal motion key bounds nothing."""
    return [row for row in rows if math.isfinite(row.value)]


def _amount(parameter: Parameter, values: Mapping[str, float], autopilot: Autopilot) -> float | None:
    """The amount that is flown: zeros that stand for another parameter are read as that one."""
    amount, known = parameter.read(values), PARAMETERS[autopilot]
    if parameter.key == "corner_accel" and corners_as_it_leans(values):
        leans_deg = known["lean"].read(values)
        return None if leans_deg is None else GRAVITY_M_S2 * math.tan(math.radians(min(max(leans_deg, 0.0), 80.0)))
    if amount is None or autopilot is Autopilot.PX4:
        return amount
    if parameter.key == "return_speed" and amount <= 0.0:
        return known["speed"].read(values)
    if parameter.key == "corner_accel" and amount <= 0.0:
        accel = known["accel"].read(values)
        return None if accel is None else 2.0 * accel
    return abs(amount) if parameter.key in ("circle", "return_circle") else amount


def corners_as_it_leans(values: Mapping[str, float]) -> bool:
    """Whether ArduCopter without WPNAV_ACCEL_C, or with 0, takes corners with all that its lean allows.

    Before 4.4 there is no such parameter, in 4.4 this is what its 0 means; since 4.5 it is twice WPNAV_ACCEL.
    """
    if not isinstance(values, OnBoard) or values.version is None or values.version >= (4, 5):
        return False
    return "ANGLE_MAX" in values and not PARAMETERS[Autopilot.ARDUCOPTER]["corner_accel"].read(values)


def off(settings: Sequence[Setting], values: Mapping[str, float], autopilot: Autopilot) -> list[Off]:
    """The parameters among ``values`` that are outside of their rules, in the order of ``settings``.

    A fence counts where it is in force. One that only tells of a breach does not change the flight, but lowers
    ArduCopter's return.
    """
    found = []
    on = fences_in_force(values, autopilot)
    if not acts(values, autopilot):
        on = frozenset(s.parameter.key for s in settings if s.parameter.key in on and s.matters in ("return", "report"))
    for setting in settings:
        if is_fence(setting.parameter.key) and setting.parameter.key not in on:
            continue
        name = setting.parameter.on_board(values)
        amount = _amount(setting.parameter, values, autopilot)
        if name is not None and amount is not None and not setting.allows(amount):
            found.append(Off(setting, name, amount, values[name.name]))
    return found


def vehicle_on_board(vehicle: Vehicle, mission: Mission, values: Mapping[str, float]) -> Vehicle:
    """``vehicle`` as its parameters on board make it fly ``mission``; what was not read, or is the same, stays.

    Where the mission sets no speed, the parameter's is its speed.
    """
    if math.isinf(vehicle.accel_m_s2) and not vehicle.keeps_airspeed:
        return vehicle
    known, autopilot = PARAMETERS[vehicle.autopilot], vehicle.autopilot

    def read(key: str, own: float | None, per: float = 1.0) -> float | None:
        amount = _amount(known[key], values, autopilot) if key in known else None
        if amount is None or own is None or math.isinf(own):
            return own
        amount = per * max(amount, 0.0)
        return own if abs(amount - own) <= SAME * abs(own) else amount

    if autopilot is Autopilot.ARDUPLANE:
        return replace(vehicle, speed_max_m_s=max(read("speed", vehicle.speed_max_m_s) or 0.0, 1.0))
    px4 = autopilot is Autopilot.PX4
    accel = read("accel", vehicle.accel_m_s2, 1.0 if px4 else 1.0 / COPTER_PEAK_ACCEL)
    changed: dict[str, float | None] = {
        "climb_m_s": read("climb", vehicle.climb_m_s),
        "descent_m_s": read("descent", vehicle.descent_m_s),
        "land_m_s": read("land", vehicle.land_m_s),
        "accel_m_s2": accel,
        "vertical_accel_m_s2": read("vertical_accel", vehicle.vertical_accel_m_s2),
        "corner_accel_m_s2": read("corner", vehicle.corner_accel_m_s2, accel or 1.0) if px4 else read(
            "corner_accel", vehicle.corner_accel_m_s2, 1.0 / COPTER_CORNER_ACCEL
        ),
        "leg_jerk_m_s3": read("jerk", vehicle.leg_jerk_m_s3),
        "lean_angle_deg": read("lean", vehicle.lean_angle_deg),
    }  # fmt: skip
    if vehicle.return_speed_m_s is not None:
        speed = read("return_speed", vehicle.return_speed_m_s)
        changed["return_m_s"] = vehicle.return_m_s if speed == vehicle.return_speed_m_s else speed
        waits = read("return_waits", vehicle.return_waits_s)
        changed["return_wait_s"] = vehicle.return_wait_s if waits == vehicle.return_waits_s else waits
    if not commands_speed(mission):
        changed["speed_max_m_s"] = read("return_speed" if px4 else "speed", vehicle.speed_max_m_s)
    # What divides by a rate needs one above 0.
    least = {key: max(value, 0.01) for key, value in changed.items() if value is not None and key != "return_wait_s"}
    return replace(vehicle, **(changed | least))  # type: ignore[arg-type]


_RADIO, _GROUND = Note("after_radio_loss"), Note("after_ground_station_loss")
_LOW, _CRITICAL = Note("after_low_battery"), Note("after_critical_battery")
_FAILSAFE_VALUES: dict[Autopilot, dict[str, tuple[float, tuple[float, ...], Note]]] = {
    Autopilot.ARDUCOPTER: {
        "fs_radio": (1.0, (0.0, 2.0), _RADIO), "fs_ground": (1.0, (0.0, 2.0), _GROUND),
        "fs_battery": (2.0, (0.0,), _LOW), "fs_battery_critical": (2.0, (0.0,), _CRITICAL),
    },
    Autopilot.ARDUPLANE: {
        "fs_radio": (1.0, (0.0, 2.0), _RADIO), "fs_ground": (1.0, (0.0, 2.0, 3.0), _GROUND),
        "fs_long": (1.0, (0.0,), Note("after_long_failsafe")),
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
        why = Note("assumed_failsafe", after=after, by_mission=by_mission)
        rows.append(Setting(known[key], value, "equal", why, "report", also))
    if copter:
        why = Note("assumed_lost_position")
        rows.append(Setting(known["fs_position"], 1.0, "equal", why, "report", _LANDS))
    return tuple(rows)


def _fences(autopilot: Autopilot, extent: FlightExtent, returns_m: float | None) -> Iterator[Setting]:
    known, copter = SAFETY[autopilot], autopilot is Autopilot.ARDUCOPTER
    lowered = copter and returns_m is not None
    top_m, why = extent.top_rel_home_m, Note("assumed_highest_place")
    if lowered and returns_m is not None and returns_m + FENCE_MARGIN_M > top_m:
        top_m, why = returns_m + FENCE_MARGIN_M, Note("assumed_return_below_fence", returns_m=returns_m)
    matters: Matters = "return" if lowered else "flight"
    yield Setting(known["fence_top"], float(math.ceil(top_m)), "at least", why, matters)
    if lowered:
        yield Setting(known["fence_margin"], FENCE_MARGIN_M, "at most", Note("assumed_fence_margin"), "return")
    if autopilot is not Autopilot.PX4:
        why = Note("assumed_lowest_place")
        yield Setting(known["fence_floor"], float(math.floor(extent.bottom_rel_home_m)), "at most", why, "flight")
    why = Note("assumed_farthest_place")
    yield Setting(known["fence_radius"], float(math.ceil(extent.reach_m)), "at least", why, "flight")
    value, also = (3.0, (0.0, 1.0)) if autopilot is Autopilot.PX4 else (1.0, (0.0, 3.0) if copter else (0.0,))
    yield Setting(known["fence_action"], value, "equal", Note("assumed_fence_action"), "report", also)


def needed_groups(
    settings: Sequence[Setting], autopilot: Autopilot, values: Mapping[str, float] | None = None
) -> tuple[tuple[str, ...], ...]:
    """The names, by parameter, that the proof hangs on, so that silence is no answer.

    With ``values``, as they were read, the names of fences that are off are left out.
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
