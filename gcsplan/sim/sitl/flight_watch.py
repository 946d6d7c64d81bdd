"""Why a vehicle in SITL does not arrive: what it says in flight, a mode that it changes to, ground that it hits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot

_HIT = "SIM Hit ground at "
_HARD_M_S = 0.3
"""Touches softer than this are those of a vehicle that stands."""
_TEXTS = 3
_OTHER_GROUND_M = 5.0
_MODES = {
    Autopilot.ARDUCOPTER: {
        0: "STABILIZE", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 9: "LAND", 16: "POSHOLD",
        17: "BRAKE", 21: "SMART_RTL", 27: "AUTO_RTL",
    },
    Autopilot.ARDUPLANE: {
        0: "MANUAL", 1: "CIRCLE", 2: "STABILIZE", 5: "FBWA", 6: "FBWB", 7: "CRUISE", 10: "AUTO", 11: "RTL",
        12: "LOITER", 15: "GUIDED", 26: "AUTOLAND",
    },
}  # fmt: skip
_ON_GROUND = frozenset({cmd.TAKEOFF, cmd.LAND, cmd.RTL, cmd.VTOL_TAKEOFF, cmd.VTOL_LAND})
"""Commands that are carried out on the ground in part."""


@dataclass(slots=True)
class FlightWatch:
    """The events of one vehicle's flight since its mission was started. ``crashed``: it hit the ground on the way."""

    mission: Mission
    crashed: bool = False
    timed_out: bool = False
    item: int = 0
    _hit: Note | None = None
    _left: Note | None = None
    _texts: list[str] = field(default_factory=list)

    def note(self, message: Any, item: int) -> None:
        """Take a HEARTBEAT or STATUSTEXT of the vehicle, which flies ``item``."""
        self.item = item
        if message.get_type() == "HEARTBEAT":
            modes = _MODES[self.mission.autopilot]
            name = modes.get(message.custom_mode, f"mode {message.custom_mode}")
            if name != "AUTO" and self._left is None:
                self._left = Note("left_auto", item, mode=name)
        elif message.get_type() == "STATUSTEXT":
            self._text(str(message.text), message.severity)

    def _text(self, text: str, severity: int) -> None:
        if text.startswith(_HIT) and self._on_the_way() and _speed_m_s(text) >= _HARD_M_S:
            self.crashed = True
            self._hit = Note("hit_ground", self.item, speed_m_s=_speed_m_s(text))
        elif severity <= dialect.MAV_SEVERITY_WARNING and text not in self._texts:
            self._texts = [*self._texts, text][-_TEXTS:]

    def _on_the_way(self) -> bool:
        index = self.item - self.mission.first_seq
        return 0 <= index < len(self.mission.items) and self.mission.items[index].command not in _ON_GROUND

    def why(self, height_m: float = 0.0) -> tuple[Note, ...]:
        """Why it did not arrive, as far as it is known.

        ``height_m``: above the mission's ground at the end; a simulator that hits ground in the air has another ground.
        """
        known = [note for note in (self._hit, self._left) if note is not None]
        if self.timed_out:
            known.append(Note("time_was_up", self.item))
        if self.crashed and height_m > _OTHER_GROUND_M:
            known.append(Note("other_ground", height_m=height_m))
        if self._texts:
            known.append(Note("vehicle_said", texts=" / ".join(self._texts)))
        return tuple(known)


def _speed_m_s(text: str) -> float:
    """The number in ``SIM Hit ground at 1.5 m/s``; 0 if it is none."""
    try:
        return float(text.removeprefix(_HIT).split()[0])
    except (ValueError, IndexError):
        return 0.0
