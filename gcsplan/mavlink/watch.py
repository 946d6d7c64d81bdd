"""What a vehicle says of itself: heartbeats, position, capabilities and texts, folded into a `VehicleState`."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.mavlink.autopilots import GENERIC, INVALID, autopilot_name, type_name
from gcsplan.mavlink.link import Heard
from gcsplan.mavlink.messages import Address
from gcsplan.mavlink.mission import Home
from gcsplan.mavlink.transport import Peer

# MAV_STATE
UNINIT, BOOT, CALIBRATING, STANDBY, ACTIVE, CRITICAL, EMERGENCY, POWEROFF, TERMINATION = range(9)
STATE_WORDS = {
    UNINIT: "not initialised", BOOT: "booting", CALIBRATING: "calibrating", STANDBY: "standby", ACTIVE: "active",
    CRITICAL: "critical", EMERGENCY: "in an emergency", POWEROFF: "powering off", TERMINATION: "terminating",
}  # fmt: skip

# MAV_PROTOCOL_CAPABILITY
CAN_MISSION_INT, CAN_TERRAIN, CAN_FENCE, CAN_RALLY = 4, 512, 16384, 32768

_AUTOPILOT_COMPID = 1
_NO_AUTOPILOT_TYPES = frozenset({5, 6, 18, 26, 27, 30, 31, 32, 33, 34, 36, 37, 38, 39, 40, 41, 42, 44})
"""Ground stations, trackers, companion computers, gimbals, cameras and the like."""

_FRESH_S = 3.0
_MOST_SOURCES = 64
_MOST_TEXTS = 20


@dataclass(frozen=True, slots=True)
class VehicleState:
    """One vehicle as it reports itself; None where it did not.

    ``address`` is its autopilot's. ``system_status`` is a MAV_STATE, ``amsl_m`` metres above mean sea level,
    ``capabilities`` MAV_PROTOCOL_CAPABILITY bits. ``sources`` counts those who send an autopilot's heartbeats under
    this system id: more than one are two vehicles with one number. ``texts`` are its last messages to people.
    """

    address: Address
    mav_autopilot: int
    mav_type: int
    armed: bool
    system_status: int
    lat_deg: float | None = None
    lon_deg: float | None = None
    amsl_m: float | None = None
    capabilities: int | None = None
    sources: int = 1
    home: Home | None = None
    texts: tuple[str, ...] = ()

    @property
    def what(self) -> str:
        """Kind of autopilot and vehicle in words."""
        return f"{autopilot_name(self.mav_autopilot)} ({type_name(self.mav_type)})"

    @property
    def located(self) -> bool:
        """Whether it reports a position."""
        return self.lat_deg is not None and self.lon_deg is not None

    def can(self, capability: int) -> bool | None:
        """Whether it says it can; None where it says nothing."""
        return None if self.capabilities is None else bool(self.capabilities & capability)


@dataclass(slots=True)
class _Source:
    autopilot: int
    kind: int
    armed: bool
    status: int
    at: float


class Watch:
    """Collects what one system id says; `note` takes every message, `state` is what it amounts to.

    ``texts`` are the last things said to people, ``said`` counts all of them.
    """

    def __init__(self, sysid: int) -> None:
        self.sysid = sysid
        self.texts: deque[str] = deque(maxlen=_MOST_TEXTS)
        self.said = 0
        self._sources: dict[tuple[int, Peer], _Source] = {}
        self._place: tuple[float, float, float] | None = None
        self._place_from_fix = False
        self.capabilities: int | None = None
        self._home: Home | None = None

    def note(self, heard: Heard, now: float) -> None:
        """Take one message in."""
        handler = {
            "HEARTBEAT": self._heartbeat,
            "GLOBAL_POSITION_INT": self._position,
            "GPS_RAW_INT": self._fix,
            "AUTOPILOT_VERSION": self._version,
            "HOME_POSITION": self._home_position,
            "STATUSTEXT": self._text,
        }.get(heard.message.get_type())
        if handler:
            handler(heard, heard.message, now)

    def texts_since(self, said: int) -> tuple[str, ...]:
        """The texts, as far as they are kept, after the first ``said`` of them."""
        new = min(self.said - said, len(self.texts))
        return tuple(self.texts)[len(self.texts) - new :]

    def state(self, now: float) -> VehicleState | None:
        """The state now; None before an autopilot's heartbeat."""
        fresh = {key: s for key, s in self._sources.items() if now - s.at <= _FRESH_S} or self._sources
        pilots = [key for key, s in fresh.items() if _is_autopilot(key[0], s)]
        if not pilots:
            return None
        best = min(pilots, key=lambda key: (key[0] != _AUTOPILOT_COMPID, fresh[key].autopilot in (GENERIC, INVALID)))
        source = fresh[best]
        rivals = [key for key in pilots if key[0] == best[0] or fresh[key].autopilot not in (GENERIC, INVALID)]
        lat, lon, amsl = self._place or (None, None, None)
        return VehicleState(
            Address(self.sysid, best[0]), source.autopilot, source.kind, source.armed, source.status,
            lat, lon, amsl, self.capabilities, len(rivals), self._home, tuple(self.texts),
        )  # fmt: skip

    def _heartbeat(self, heard: Heard, m: Any, now: float) -> None:
        key = (heard.source.compid, heard.peer)
        if key not in self._sources and len(self._sources) >= _MOST_SOURCES:
            del self._sources[min(self._sources, key=lambda k: self._sources[k].at)]
        armed = bool(m.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
        self._sources[key] = _Source(m.autopilot, m.type, armed, m.system_status, now)

    def _position(self, heard: Heard, m: Any, now: float) -> None:
        if (m.lat, m.lon) != (0, 0):  # 0, 0 is how the lack of a position is reported
            self._place, self._place_from_fix = (m.lat / 1e7, m.lon / 1e7, m.alt / 1e3), False

    def _fix(self, heard: Heard, m: Any, now: float) -> None:
        if m.fix_type >= dialect.GPS_FIX_TYPE_3D_FIX and (self._place is None or self._place_from_fix):
            self._place, self._place_from_fix = (m.lat / 1e7, m.lon / 1e7, m.alt / 1e3), True

    def _version(self, heard: Heard, m: Any, now: float) -> None:
        self.capabilities = int(m.capabilities)

    def _home_position(self, heard: Heard, m: Any, now: float) -> None:
        self._home = Home(m.latitude, m.longitude, m.altitude / 1e3)

    def _text(self, heard: Heard, m: Any, now: float) -> None:
        text = m.text if isinstance(m.text, str) else bytes(m.text).decode(errors="replace")
        self.said += 1
        self.texts.append("".join(c for c in text if c.isprintable()).strip())


def _is_autopilot(compid: int, source: _Source) -> bool:
    return compid == _AUTOPILOT_COMPID or source.kind not in _NO_AUTOPILOT_TYPES
