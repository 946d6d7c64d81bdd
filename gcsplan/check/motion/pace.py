"""Speeds of the flight: cruise, climb and descent, as a mission's speed changes set them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle

AIRSPEED, GROUND_SPEED, CLIMB, DESCENT = 0.0, 1.0, 2.0, 3.0  # SPEED_TYPE
DEFAULT = -2.0
"""This value resets a speed to its default; −1 leaves it unchanged."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Cruise speed over ground, and rates of climb and descent, m/s."""

    speed_m_s: float
    rates_m_s: tuple[float, float]

    @classmethod
    def of(cls, vehicle: Vehicle) -> Pace:
        """The pace at the beginning of a mission: the vehicle's own speeds."""
        return cls(vehicle.speed_max_m_s, (vehicle.climb_m_s, vehicle.descent_m_s))

    def changed(self, seq: int, item: MissionItem, vehicle: Vehicle) -> tuple[Pace, Note | None]:
        """The pace after a DO_CHANGE_SPEED, the item ``seq``, and a note on it (mostly there is none).

        On ArduPlane a ground speed is a lower bound, not a target (commands_logic.cpp, `do_change_speed`).
        """
        kind, value = item.params[0], item.params[1]
        plane = vehicle.autopilot is Autopilot.ARDUPLANE
        cruise = (AIRSPEED,) if plane else (AIRSPEED, GROUND_SPEED)
        if vehicle.autopilot is Autopilot.PX4 and kind in (CLIMB, DESCENT):
            return self, Note("climb_rate_uncounted", seq)
        if kind in cruise and value == DEFAULT:
            return replace(self, speed_m_s=vehicle.speed_max_m_s), None
        if not 0.0 < value < math.inf:
            return self, None
        if kind in cruise:
            return replace(self, speed_m_s=value), None
        if kind in (CLIMB, DESCENT) and not plane:
            up, down = self.rates_m_s
            return replace(self, rates_m_s=(value, down) if kind == CLIMB else (up, value)), None
        return self, None
