"""Why a vehicle in SITL does not arrive: what it says in flight, a mode that it changes to, ground that it hits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission
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
    """What happened to one vehicle since its mission was started. ``crashed``: it hit the ground on the way."""

    mission: Mission
    crashed: bool = False
    timed_out: bool = False
    item: int = 0
    _hit: str = ""
    _left: str = ""
    _texts: list[str] = field(default_factory=list)

    def note(self, message: Any, item: int) -> None:
        """Take a HEARTBEAT or STATUSTEXT of the vehicle, which flies ``item``."""
        self.item = item
        if message.get_type() == "HEARTBEAT":
            modes = _MODES[self.mission.autopilot]
            name = modes.get(message.custom_mode, f"mode {message.custom_mode}")
            if name != "AUTO" and not self._left:
                self._left = f"it left AUTO for {name} at item {item}"
        elif message.get_type() == "STATUSTEXT":
            self._text(str(message.text), message.severity)

    def _text(self, text: str, severity: int) -> None:
        if text.startswith(_HIT) and self._on_the_way() and _speed_m_s(text) >= _HARD_M_S:
            self.crashed = True
            self._hit = f"it hit the ground at {_speed_m_s(text):.1f} m/s on its way to item {self.item}"
        elif severity <= dialect.MAV_SEVERITY_WARNING and text not in self._texts:
            self._texts = [*self._texts, text][-_TEXTS:]

    def _on_the_way(self) -> bool:
        index = self.item - self.mission.first_seq
        return 0 <= index < len(self.mission.items) and self.mission.items[index].command not in _ON_GROUND

    def why(self, height_m: float = 0.0) -> str:
        """Why it did not arrive, as far as it is known; empty if it is not.

        ``height_m``: above the mission's ground at the end; a simulator that hits ground in the air has another ground.
        """
        late = f"it still flew to item {self.item} when the time was up" if self.timed_out else ""
        known = [words for words in (self._hit, self._left, late) if words]
        if self.crashed and height_m > _OTHER_GROUND_M:
            known.append(
                f"that is {height_m:.0f} m above the mission's ground: without terrain an SITL's ground is flat at the "
                f"altitude of home, and --sitl-binary starts one with the mission's terrain"
            )
        if self._texts:
            known.append(f"it said: {' / '.join(self._texts)}")
        return "; ".join(known)


def _speed_m_s(text: str) -> float:
    """The number in ``SIM Hit ground at 1.5 m/s``; 0 if it is none."""
    try:
        return float(text.removeprefix(_HIT).split()[0])
    except (ValueError, IndexError):
        return 0.0
