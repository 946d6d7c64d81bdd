"""Fences and failsafes on board: their parameters, and which fences of a vehicle are in force.

A fence that a mission leaves makes the vehicle turn round in the air. ArduCopter also flies a return no higher than
FENCE_ALT_MAX less FENCE_MARGIN (mode_rtl.cpp, `compute_return_target`), whatever the fence's action. Sources:
AC_Fence.cpp, events.cpp (Copter), Parameters.cpp (Plane); geofence_params.c, commander_params.c (PX4).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from gcsplan.mavlink.mission.parameter_names import Name, Parameter
from gcsplan.vehicle import Autopilot

__all__ = [
    "CIRCLE",
    "FENCE_DECIDES",
    "FENCE_MARGIN_M",
    "FLOOR",
    "POLYGON",
    "SAFETY",
    "TOP",
    "acts",
    "fences_in_force",
    "is_fence",
]

FENCE_MARGIN_M = 2.0
"""FENCE_MARGIN, default."""

TOP, CIRCLE, POLYGON, FLOOR = 1, 2, 4, 8
"""Bits of FENCE_TYPE; the circle is the one around home."""

_BITS = {"fence_top": TOP, "fence_margin": TOP, "fence_radius": CIRCLE, "fence_floor": FLOOR}
_MOST_BITS = 255.0
_ONLY_TELLS = 1.0  # GF_ACTION; ArduPilot's is 0

FENCE_DECIDES: dict[Autopilot, tuple[tuple[str, ...], ...]] = {
    Autopilot.ARDUCOPTER: (("FENCE_ENABLE",), ("FENCE_AUTOENABLE",), ("FENCE_TYPE",), ("FENCE_ACTION",)),
    Autopilot.ARDUPLANE: (("FENCE_ENABLE",), ("FENCE_AUTOENABLE",), ("FENCE_TYPE",), ("FENCE_ACTION",)),
    Autopilot.PX4: (("GF_ACTION",),),
}
"""Parameters that decide which of a vehicle's fences are in force."""


def _p(key: str, name: str, default: float, unit: str = "") -> Parameter:
    return Parameter(key, (Name(name),), default, unit)


_FENCES = (
    _p("fence_top", "FENCE_ALT_MAX", 100.0, "m"), _p("fence_floor", "FENCE_ALT_MIN", -10.0, "m"),
    _p("fence_radius", "FENCE_RADIUS", 300.0, "m"), _p("fence_margin", "FENCE_MARGIN", FENCE_MARGIN_M, "m"),
    _p("fence_action", "FENCE_ACTION", 1.0),
)  # fmt: skip
SAFETY: dict[Autopilot, dict[str, Parameter]] = {
    autopilot: {p.key: p for p in rows}
    for autopilot, rows in {
        Autopilot.ARDUCOPTER: (
            *_FENCES, _p("fs_radio", "FS_THR_ENABLE", 1.0), _p("fs_ground", "FS_GCS_ENABLE", 0.0),
            _p("fs_battery", "BATT_FS_LOW_ACT", 0.0), _p("fs_battery_critical", "BATT_FS_CRT_ACT", 0.0),
            _p("fs_position", "FS_EKF_ACTION", 1.0),
        ),
        Autopilot.ARDUPLANE: (
            *_FENCES, _p("fs_radio", "THR_FAILSAFE", 1.0), _p("fs_ground", "FS_GCS_ENABL", 0.0),
            _p("fs_long", "FS_LONG_ACTN", 0.0), _p("fs_battery", "BATT_FS_LOW_ACT", 0.0),
            _p("fs_battery_critical", "BATT_FS_CRT_ACT", 0.0),
        ),
        Autopilot.PX4: (
            _p("fence_top", "GF_MAX_VER_DIST", 0.0, "m"), _p("fence_radius", "GF_MAX_HOR_DIST", 0.0, "m"),
            _p("fence_action", "GF_ACTION", 2.0), _p("fs_radio", "NAV_RCL_ACT", 2.0),
            _p("fs_ground", "NAV_DLL_ACT", 0.0), _p("fs_battery", "COM_LOW_BAT_ACT", 0.0),
        ),
    }.items()
}  # fmt: skip
"""By autopilot and key: the fences and failsafes that a list of parameters has."""


def is_fence(key: str) -> bool:
    """Whether a parameter is one of a fence's, by its key."""
    return key.startswith("fence_")


def fences_in_force(values: Mapping[str, float], autopilot: Autopilot, *, unread_m: float = 0.0) -> frozenset[str]:
    """The keys of `SAFETY` of those fences that a vehicle with these parameters keeps to.

    FENCE_AUTOENABLE of ArduPilot enables a fence that FENCE_ENABLE 0 leaves out, at take-off or with arming.
    ``unread_m``: a PX4's distance that was not read; with 0 that fence is off.
    """

    def read(name: str, unread: float = 0.0) -> float:
        value = values.get(name, unread)
        return value if math.isfinite(value) else unread

    if autopilot is Autopilot.PX4:
        distances = {"fence_top": "GF_MAX_VER_DIST", "fence_radius": "GF_MAX_HOR_DIST"}
        on = {key for key, name in distances.items() if read("GF_ACTION") > 0.0 and read(name, unread_m) > 0.0}
        return frozenset(on | {"fence_action"} if on else on)
    kinds = int(min(max(read("FENCE_TYPE"), 0.0), _MOST_BITS))
    if not kinds or not (read("FENCE_ENABLE") != 0.0 or read("FENCE_AUTOENABLE") > 0.0):
        return frozenset()
    return frozenset({key for key, bit in _BITS.items() if kinds & bit} | {"fence_action"})


def acts(values: Mapping[str, float], autopilot: Autopilot) -> bool:
    """Whether a breach of a fence changes the flight, and is not only reported; a parameter that was not read does."""
    if autopilot is Autopilot.PX4:
        return values.get("GF_ACTION", math.inf) > _ONLY_TELLS
    return values.get("FENCE_ACTION", math.inf) != 0.0
