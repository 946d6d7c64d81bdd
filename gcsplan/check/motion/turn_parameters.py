"""The autopilot parameters that decide where it turns: their defaults, or the values read from the vehicle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import MissionItem

__all__ = ["DEFAULTS", "Tuning"]

LEAST_RADIUS_M = 1e-7
""" A smaller acceptance radius counts as none."""


@dataclass(frozen=True, slots=True)
class Tuning:
    """Where the autopilots turn, in metres. ``read``: names of the parameters that were read from the vehicle."""

    copter_radius_m: float = 2.0  # ArduCopter WPNAV_RADIUS 200 cm (WP_RADIUS_M from 4.7 on)
    px4_radius_m: float = 10.0  # PX4 NAV_ACC_RAD
    px4_height_m: float = 0.8  # PX4 NAV_MC_ALT_RAD
    plane_radius_m: float = 90.0  # ArduPlane WP_RADIUS
    l1_period_s: float = 17.0  # ArduPlane NAVL1_PERIOD
    l1_damping: float = 0.75  # ArduPlane NAVL1_DAMPING
    roll_deg: float = 45.0  # ArduPlane ROLL_LIMIT_DEG (LIM_ROLL_CD before 4.5)
    read: frozenset[str] = frozenset()

    @classmethod
    def of(cls, values: Mapping[str, float]) -> Tuning:
        """The tuning from ``values`` (parameters by name, in their own units), with defaults for the others.

        Numbers that are not finite or not positive are ignored.
        """
        known = {
            "WPNAV_RADIUS": ("copter_radius_m", 0.01), "WP_RADIUS_M": ("copter_radius_m", 1.0),
            "NAV_ACC_RAD": ("px4_radius_m", 1.0), "NAV_MC_ALT_RAD": ("px4_height_m", 1.0),
            "WP_RADIUS": ("plane_radius_m", 1.0), "NAVL1_PERIOD": ("l1_period_s", 1.0),
            "NAVL1_DAMPING": ("l1_damping", 1.0), "ROLL_LIMIT_DEG": ("roll_deg", 1.0),
            "LIM_ROLL_CD": ("roll_deg", 0.01),
        }  # fmt: skip
        usable = {name: v for name, v in values.items() if name in known and math.isfinite(v) and v > 0.0}
        fields = {known[name][0]: value * known[name][1] for name, value in usable.items()}
        return cls(**fields, read=frozenset(usable))

    def px4_accepts_m(self, item: MissionItem) -> tuple[float, bool]:
        """The radius within which PX4 counts an item as reached, m, and whether it is the item's own."""
        own = item.params[1] if item.command == cmd.WAYPOINT else 0.0
        return (own, True) if math.isfinite(own) and own > LEAST_RADIUS_M else (self.px4_radius_m, False)

    @property
    def l1_slower(self) -> float:
        """How many times slower than with the default NAVL1_PERIOD ArduPlane settles on a leg, at least 1."""
        return max(self.l1_period_s / DEFAULTS.l1_period_s, 1.0)

    def l1_ahead_m(self, speed_m_s: float) -> float:
        """The L1 distance, m: how far ahead on its leg ArduPlane aims."""
        return self.l1_damping * self.l1_period_s / math.pi * speed_m_s

    def plane_turns_m(self, speed_m_s: float, turn_rad: float, growth: float = 1.0) -> float:
        """How far before a way point without its own radius ArduPlane turns, m (`AP_L1_Control::turn_distance`)."""
        return min(self.plane_radius_m * growth, self.l1_ahead_m(speed_m_s)) * min(1.0, abs(turn_rad) / (0.5 * math.pi))


DEFAULTS = Tuning()
