"""Parameters of the autopilots that decide how a mission is flown: every name, its unit, and its default.

ArduCopter 4.7 renamed most of them and changed their units (ArduPilot's list of renamed parameters; AC_WPNav.cpp,
mode_rtl.cpp, Parameters.cpp); ArduPlane 4.5 renamed its limits of roll and airspeed. PX4 has the same names in its
sources of 2023 (1.14) and of 2026. A vehicle answers to one of the names of a parameter. ArduPilot before 4.7 says
nothing to a name that it does not have, so a parameter that is newer than the oldest firmware says its first version
(ArduPilot's parameter lists of Copter and Plane 4.1 to 4.8).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from gcsplan.vehicle import Autopilot

__all__ = ["PARAMETERS", "Name", "OnBoard", "Parameter", "ParameterValues", "unanswered"]

ParameterValues = Mapping[str, float]
"""Values that were read from a vehicle, by the names of its parameters."""


@dataclass(frozen=True, slots=True)
class Name:
    """One name of a parameter. ``per_unit``: its units in one of the parameter's; ``versions``: who has it."""

    name: str
    per_unit: float = 1.0
    versions: str = ""

    def value(self, amount: float) -> float:
        """The value on board of an amount in the parameter's unit."""
        return round(amount * self.per_unit, 6)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter under all its names, with its default in ``unit``; ``key`` is what gcsplan calls it.

    ``since``: the first firmware (major, minor) that has it under any name.
    """

    key: str
    names: tuple[Name, ...]
    default: float
    unit: str
    since: tuple[int, int] = (0, 0)

    def group(self) -> tuple[str, ...]:
        """The names, of which a vehicle answers to one."""
        return tuple(name.name for name in self.names)

    def read(self, values: Mapping[str, float]) -> float | None:
        """The amount on board in ``unit``; None if it was not read or is no number."""
        found = self.on_board(values)
        return None if found is None else values[found.name] / found.per_unit

    def on_board(self, values: Mapping[str, float]) -> Name | None:
        """The name under which it was read as a finite number; None if it was not."""
        return next((n for n in self.names if math.isfinite(values.get(n.name, math.nan))), None)

    def setting(self, amount: float, values: Mapping[str, float] | None = None) -> str:
        """The setting for an amount: the name that was read with its value, or every name."""
        found = self.on_board(values) if values else None
        names = self.names if found is None else (found,)
        return " or ".join(f"{n.name} {n.value(amount):.10g}" for n in names)


class OnBoard(dict[str, float]):
    """Parameters that were read, by name. ``absent``: names that the vehicle says it does not have.

    ``generic``: it does not say what autopilot it is, so nothing is known of its parameters. ``version``: the version
    of its firmware (major, minor), None if it does not report it.
    """

    def __init__(
        self,
        values: Mapping[str, float] | None = None,
        absent: Collection[str] = (),
        *,
        generic: bool = False,
        version: tuple[int, int] | None = None,
    ) -> None:
        super().__init__(values or {})
        self.absent, self.generic, self.version = frozenset(absent), generic, version

    def too_old_for(self, group: tuple[str, ...]) -> bool:
        """Whether the firmware on board is older than the parameter of these names."""
        return self.version is not None and self.version < _SINCE.get(group, (0, 0))

    def lacks(self, group: tuple[str, ...]) -> bool:
        """Whether a firmware is known to be without the parameter: too old for it, or built without fences.

        That is one that answers for other parameters, and for no fence's.
        """
        family = next((f for f in _FENCE_FAMILIES if group[0].startswith(f)), None)
        unfenced = family is not None and bool(self) and not any(n.startswith(family) for n in (*self, *self.absent))
        return unfenced or self.too_old_for(group)


def unanswered(values: Mapping[str, float], groups: Iterable[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """The ``groups`` in which no name was read as a number, and not all names are known to be absent.

    "Does not exist" is an answer, and so is a firmware that is too old for it; silence is none, and does not count as a
    default.
    """
    board = values if isinstance(values, OnBoard) else OnBoard(values)
    return [
        group
        for group in groups
        if not any(math.isfinite(board.get(n, math.nan)) for n in group)
        and not all(n in board.absent for n in group)
        and not board.lacks(group)
    ]


_FENCE_FAMILIES = ("FENCE_", "GF_")
_BEFORE, _RENAMED = "before ArduPilot 4.7", "since ArduPilot 4.7"


def _copter(
    key: str,
    old: str,
    new: str,
    default: float,
    unit: str,
    per_unit: float = 100.0,
    since: tuple[int, int] = (0, 0),
) -> Parameter:
    return Parameter(key, (Name(old, per_unit, _BEFORE), Name(new, 1.0, _RENAMED)), default, unit, since)


def _one(key: str, name: str, default: float, unit: str = "", per_unit: float = 1.0) -> Parameter:
    return Parameter(key, (Name(name, per_unit),), default, unit)


def _table(*rows: Parameter) -> dict[str, Parameter]:
    return {row.key: row for row in rows}


PARAMETERS: dict[Autopilot, dict[str, Parameter]] = {
    Autopilot.ARDUCOPTER: _table(
        _copter("speed", "WPNAV_SPEED", "WP_SPD", 10.0, "m/s"),
        _copter("return_speed", "RTL_SPEED", "RTL_SPEED_MS", 0.0, "m/s"),
        _copter("climb", "WPNAV_SPEED_UP", "WP_SPD_UP", 2.5, "m/s"),
        _copter("descent", "WPNAV_SPEED_DN", "WP_SPD_DN", 1.5, "m/s"),
        _copter("land", "LAND_SPEED", "LAND_SPD_MS", 0.5, "m/s"),
        _copter("land_high", "LAND_SPEED_HIGH", "LAND_SPD_HIGH_MS", 0.0, "m/s"),
        _copter("land_low", "LAND_ALT_LOW", "LAND_ALT_LOW_M", 10.0, "m"),
        _copter("accel", "WPNAV_ACCEL", "WP_ACC", 2.5, "m/s²"),
        _copter("vertical_accel", "WPNAV_ACCEL_Z", "WP_ACC_Z", 1.0, "m/s²"),
        _copter("corner_accel", "WPNAV_ACCEL_C", "WP_ACC_CNR", 0.0, "m/s²", since=(4, 4)),
        _copter("jerk", "WPNAV_JERK", "WP_JERK", 1.0, "m/s³", 1.0),
        _copter("radius", "WPNAV_RADIUS", "WP_RADIUS_M", 2.0, "m"),
        _copter("terrain_margin", "WPNAV_TER_MARGIN", "WP_TER_MARGIN", 10.0, "m", 1.0, since=(4, 2)),
        _copter("lean", "ANGLE_MAX", "ATC_ANGLE_MAX", 30.0, "°"),
        _copter("return_altitude", "RTL_ALT", "RTL_ALT_M", 15.0, "m"),
        _copter("return_climb", "RTL_CLIMB_MIN", "RTL_CLIMB_MIN_M", 0.0, "m"),
        _copter("return_end", "RTL_ALT_FINAL", "RTL_ALT_FINAL_M", 0.0, "m"),
        _one("return_altitude_type", "RTL_ALT_TYPE", 0.0),
        _one("cone", "RTL_CONE_SLOPE", 3.0),
        _one("return_waits", "RTL_LOIT_TIME", 5.0, "s", 1000.0),
    ),
    Autopilot.ARDUPLANE: _table(
        Parameter(
            "speed", (Name("AIRSPEED_CRUISE", 1.0, "since ArduPilot 4.5"),
                      Name("TRIM_ARSPD_CM", 100.0, "before ArduPilot 4.5")), 12.0, "m/s",
        ),
        Parameter(
            "speed_most", (Name("AIRSPEED_MAX", 1.0, "since ArduPilot 4.5"),
                           Name("ARSPD_FBW_MAX", 1.0, "before ArduPilot 4.5")), 22.0, "m/s",
        ),
        Parameter(
            "speed_least", (Name("AIRSPEED_MIN", 1.0, "since ArduPilot 4.5"),
                            Name("ARSPD_FBW_MIN", 1.0, "before ArduPilot 4.5")), 9.0, "m/s",
        ),
        Parameter(
            "roll", (Name("ROLL_LIMIT_DEG", 1.0, "since ArduPilot 4.5"),
                     Name("LIM_ROLL_CD", 100.0, "before ArduPilot 4.5")), 45.0, "°",
        ),
        Parameter(
            "return_altitude", (Name("RTL_ALTITUDE", 1.0, "since ArduPilot 4.5"),
                                Name("ALT_HOLD_RTL", 100.0, "before ArduPilot 4.5")), 100.0, "m",
        ),
        _one("radius", "WP_RADIUS", 90.0, "m"),
        _one("l1_period", "NAVL1_PERIOD", 17.0, "s"),
        _one("l1_damping", "NAVL1_DAMPING", 0.75),
        _one("circle", "WP_LOITER_RAD", 60.0, "m"),
        _one("return_circle", "RTL_RADIUS", 0.0, "m"),
        _one("climb_most", "TECS_CLMB_MAX", 5.0, "m/s"),
        _one("descent_most", "TECS_SINK_MAX", 5.0, "m/s"),
        _one("pitch", "TECS_PITCH_MAX", 15.0, "°"),
        _one("lifts", "Q_ENABLE", 0.0),
        _one("brakes", "Q_TRANS_DECEL", 2.0, "m/s²"),
    ),
    Autopilot.PX4: _table(
        _one("speed_most", "MPC_XY_VEL_MAX", 12.0, "m/s"),
        _one("return_speed", "MPC_XY_CRUISE", 5.0, "m/s"),
        _one("climb", "MPC_Z_V_AUTO_UP", 3.0, "m/s"),
        _one("descent", "MPC_Z_V_AUTO_DN", 1.5, "m/s"),
        _one("land", "MPC_LAND_SPEED", 0.7, "m/s"),
        _one("land_high", "MPC_LAND_ALT1", 10.0, "m"),
        _one("land_low", "MPC_LAND_ALT2", 5.0, "m"),
        _one("takeoff", "MPC_TKO_SPEED", 1.5, "m/s"),
        _one("accel", "MPC_ACC_HOR", 3.0, "m/s²"),
        _one("jerk", "MPC_JERK_AUTO", 4.0, "m/s³"),
        _one("corner", "MPC_XY_TRAJ_P", 0.5),
        _one("radius", "NAV_ACC_RAD", 10.0, "m"),
        _one("radius_height", "NAV_MC_ALT_RAD", 0.8, "m"),
        _one("lean", "MPC_TILTMAX_AIR", 45.0, "°"),
        _one("return_altitude", "RTL_RETURN_ALT", 30.0, "m"),
        _one("return_type", "RTL_TYPE", 0.0),
        _one("cone", "RTL_CONE_ANG", 45.0, "°"),
        _one("return_waits", "RTL_LAND_DELAY", 0.0, "s"),
    ),
}  # fmt: skip
"""By autopilot and key."""

_SINCE = {p.group(): p.since for known in PARAMETERS.values() for p in known.values()} | {
    ("TERRAIN_OFS_MAX",): (4, 2), ("FENCE_AUTOENABLE",): (4, 6),  # of Copter; Plane has it since 4.1
}  # fmt: skip
