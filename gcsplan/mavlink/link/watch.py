"""The state that a vehicle reports: heartbeats, position, capabilities and texts, combined into a `VehicleState`.

Reports are kept separately for each address, so that two vehicles with the same system id are not taken for one.

Every number from a vehicle's messages passes through `finite`, `whole` or `place` before it is used in a calculation:
NaN, infinity and values out of range are rejected. Mission items do not pass: they are compared bit for bit, and NaN
has a meaning in them.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.mavlink.link.link import Heard
from gcsplan.mavlink.link.transport import Peer
from gcsplan.mavlink.mission.autopilots import GENERIC, INVALID, autopilot_name, type_name
from gcsplan.mavlink.mission.mission import Home
from gcsplan.mavlink.protocol.messages import Address

_MOST_HEIGHT_M = 100_000.0
_MOST_WIND_M_S = 100.0
_UNSURE_M_S = 3.0  # standard deviation of an estimate of the wind that says nothing yet


class VehiclePosition(NamedTuple):
    """A position in degrees and metres above mean sea level."""

    lat_deg: float
    lon_deg: float
    amsl_m: float


class WindEstimate(NamedTuple):
    """The wind that a vehicle estimates, by the place to which it blows; ``deviation_m_s`` is 0 if it is not known.

    ArduPilot sends WIND: a plane always, a copter once it knows its airspeed. PX4 sends WIND_COV once its filter runs.
    """

    east_m_s: float
    north_m_s: float
    deviation_m_s: float = 0.0

    @property
    def speed_m_s(self) -> float:
        """Its speed."""
        return math.hypot(self.east_m_s, self.north_m_s)

    @property
    def from_deg(self) -> float:
        """The direction it comes from, clockwise from true north, 0 to 360."""
        return math.degrees(math.atan2(-self.east_m_s, -self.north_m_s)) % 360.0


def finite(value: object) -> float | None:
    """Return ``value`` as a float; None if it is NaN, infinite or not a number."""
    if not isinstance(value, (int, float)):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def whole(value: object, low: int, high: int) -> int | None:
    """Return ``value`` as a whole number within ``low`` … ``high``; None if it is not one."""
    number = finite(value)
    return int(number) if number is not None and number == int(number) and low <= number <= high else None


def place(lat_e7: object, lon_e7: object, alt_mm: object) -> VehiclePosition | None:
    """Return the place for 1e-7 degrees and millimetres; None if out of range, or at 0, 0, which means no fix."""
    lat, lon = whole(lat_e7, -900_000_000, 900_000_000), whole(lon_e7, -1_800_000_000, 1_800_000_000)
    height_mm = finite(alt_mm)
    if lat is None or lon is None or height_mm is None or (lat, lon) == (0, 0):
        return None
    amsl_m = height_mm / 1e3
    return VehiclePosition(lat / 1e7, lon / 1e7, amsl_m) if abs(amsl_m) <= _MOST_HEIGHT_M else None


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
"""MAV_TYPEs that are no autopilot: ground stations, trackers, companion computers, gimbals, cameras and the like."""

FRESH_S = 3.0
"""Seconds for which a report counts as current. Heartbeats come once a second, so a longer gap means lost ones."""
_MOST_SOURCES = 64
_MOST_TEXTS = 20
_ODD_S = 5.0  # longest delay of a message on its way
_FASTEST = 2.0  # largest factor by which a vehicle's clock runs faster than ours
_LEAP_M = 300.0
_METRES_A_DEGREE = 111_195.0


@dataclass(frozen=True, slots=True)
class VehicleState:
    """The state that one vehicle reports; a field is None if the vehicle did not report it.

    ``address``: its autopilot's ids; ``peer``: its address on the link. ``system_status``: a MAV_STATE. ``amsl_m``:
    metres above mean sea level. ``capabilities``: MAV_PROTOCOL_CAPABILITY bits. ``flight_sw_version``: of its firmware,
    as in AUTOPILOT_VERSION. ``sources``: number of autopilots heard
    under this system id; more than one means several vehicles with the same id. ``texts``: its last status texts.
    ``beat_at`` and ``placed_at``: times of the last heartbeat and position (clock of the link; -inf: never).
    ``just_at``: another position reported within `FRESH_S`, too far away for the vehicle to have moved there.
    ``mavlink1``: its last message came in MAVLink 1. ``round_trip_s``: how long its first answer took; 0: not known.
    ``wind``: its newest estimate of the wind.
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
    peer: Peer | None = None
    beat_at: float = -math.inf
    placed_at: float = -math.inf
    just_at: VehiclePosition | None = None
    flight_sw_version: int | None = None
    mavlink1: bool = False
    round_trip_s: float = 0.0
    wind: WindEstimate | None = None

    @property
    def what(self) -> str:
        """Autopilot and vehicle type in words."""
        return f"{autopilot_name(self.mav_autopilot)} ({type_name(self.mav_type)})"

    @property
    def located(self) -> bool:
        """Whether it reports a position."""
        return self.lat_deg is not None and self.lon_deg is not None

    def can(self, capability: int) -> bool | None:
        """Whether it reports a capability; None if it reports no capabilities."""
        return None if self.capabilities is None else bool(self.capabilities & capability)


@dataclass(slots=True)
class _Source:
    """Heartbeats with one autopilot and vehicle type, from one component at one address."""

    autopilot: int
    kind: int
    armed: bool
    status: int
    first: float
    at: float
    armed_at: float = -math.inf

    def overlaps(self, other: _Source) -> bool:
        """Whether both were heard at the same time."""
        return self.first <= other.at and other.first <= self.at


@dataclass(slots=True)
class _Clock:
    """The boot time in one type of message from one address.

    The boot time falls back when a vehicle reboots, and is further on when it was not heard for long. Only if two
    vehicles take turns does it both fall back and advance by more than the time that has passed.
    """

    latest_s: float = -math.inf
    latest_at: float = -math.inf
    fell: bool = False
    leapt: bool = False

    def note(self, boot_s: float, now: float) -> None:
        ahead_s = boot_s - self.latest_s - _FASTEST * (now - self.latest_at)
        self.leapt = self.leapt or (self.latest_s > -math.inf and ahead_s > _ODD_S)
        self.fell = self.fell or boot_s < self.latest_s - _ODD_S
        if boot_s >= self.latest_s or boot_s < self.latest_s - _ODD_S:  # ignore a message that was overtaken
            self.latest_s, self.latest_at = boot_s, now

    @property
    def of_two(self) -> bool:
        """Whether the times cannot come from the clock of one vehicle."""
        return self.fell and self.leapt


@dataclass(slots=True)
class _Reports:
    """The reports of one component at one address, without its heartbeats."""

    clocks: dict[str, _Clock] = field(default_factory=dict)
    place: VehiclePosition | None = None
    from_fix: bool = False
    placed_at: float = -math.inf
    leaps: int = 0  # position changes faster than any vehicle moves
    leapt_from: VehiclePosition | None = None
    leapt_at: float = -math.inf
    capabilities: int | None = None
    version: int | None = None
    home: Home | None = None
    mavlink1: bool = False
    wind: WindEstimate | None = None
    first: float = 0.0
    at: float = 0.0


_Voice = tuple[int, Peer]  # component id and address
_Key = tuple[int, Peer, int, int]  # the same, and MAV_AUTOPILOT and MAV_TYPE


class Watch:
    """Collects the messages of one system id: `note` records a message, `state` returns the resulting state.

    ``texts`` holds the last status texts, ``texts_heard`` counts all of them. Once a vehicle is `pin`ned, `state` is
    the state of the vehicle at the pinned address, even if others use the same system id.
    """

    def __init__(self, sysid: int) -> None:
        self.sysid = sysid
        self.texts: deque[str] = deque(maxlen=_MOST_TEXTS)
        self.texts_heard = 0
        self._sources: dict[_Key, _Source] = {}
        self._reports: dict[_Voice, _Reports] = {}
        self._pinned: _Voice | None = None
        self._pinned_at = 0.0

    def pin(self, state: VehicleState, now: float) -> None:
        """Hold on to the vehicle in ``state``; from now on, anybody else with its system id is a rival."""
        self._pinned, self._pinned_at = (state.address.compid, state.peer), now

    def note(self, heard: Heard, now: float) -> None:
        """Record one message."""
        kind = heard.message.get_type()
        if heard.late:
            self._note_against(heard, kind, now)
            return
        reports = self._voice((heard.source.compid, heard.peer), now)
        reports.mavlink1 = is_mavlink1(heard.message)
        if kind in _CLOCKS and heard.message.time_boot_ms:
            reports.clocks.setdefault(kind, _Clock()).note(heard.message.time_boot_ms / 1e3, now)
        if kind == "HEARTBEAT":
            self._heartbeat(heard, now)
        elif kind == "STATUSTEXT":
            self._text(heard.message)
        elif kind in _TELLS:
            _TELLS[kind](reports, heard.message, now)

    def _note_against(self, heard: Heard, kind: str, now: float) -> None:
        """Record a late message, which cannot confirm the state but can show a second vehicle or that it is armed."""
        m, reports = heard.message, self._reports.get((heard.source.compid, heard.peer))
        if reports is None:
            return
        if kind in _CLOCKS and m.time_boot_ms:
            reports.clocks.setdefault(kind, _Clock()).note(m.time_boot_ms / 1e3, now)
        if kind == "GLOBAL_POSITION_INT" and reports.place and now - reports.placed_at <= FRESH_S:
            found = place(m.lat, m.lon, m.alt)
            if found is not None and _leap(reports.place, found):
                reports.leaps, reports.leapt_from, reports.leapt_at = reports.leaps + 2, found, now
        if kind == "HEARTBEAT" and m.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED:
            for key, source in self._sources.items():
                if key[:2] == (heard.source.compid, heard.peer):
                    source.armed_at = now

    def texts_since(self, texts_heard: int) -> tuple[str, ...]:
        """Return the status texts after the first ``texts_heard`` of all, as far as they are still kept."""
        new = min(self.texts_heard - texts_heard, len(self.texts))
        return tuple(self.texts)[len(self.texts) - new :]

    @property
    def contested(self) -> bool:
        """Whether another autopilot than the pinned one was ever heard under the system id."""
        return self._pinned is not None and bool(self._others(self._pinned))

    def newcomer_at(self) -> float:
        """Return when the latest other autopilot was first heard under the system id since `pin`; -inf: none."""
        if self._pinned is None:
            return -math.inf
        firsts = (self._span(voice)[0] for voice in self._others(self._pinned))
        return max((at for at in firsts if at >= self._pinned_at), default=-math.inf)

    def state(self, now: float) -> VehicleState | None:
        """Return the state at ``now``; None before the first heartbeat of an autopilot."""
        pilots = {key: s for key, s in self._sources.items() if _is_autopilot(key[0], s)}
        fresh = {key: s for key, s in pilots.items() if now - s.at <= FRESH_S} or pilots
        if self._pinned:
            fresh = {key: s for key, s in pilots.items() if key[:2] == self._pinned}
        if not fresh:
            return None
        best = min(
            fresh,
            key=lambda key: (
                key[0] != _AUTOPILOT_COMPID, fresh[key].autopilot in (GENERIC, INVALID),
                -fresh[key].at if self._pinned else 0,
            ),
        )  # fmt: skip
        source, reports = fresh[best], self._reports.get(best[:2]) or _Reports()
        lat, lon, amsl = reports.place or (None, None, None)
        armed = source.armed or now - source.armed_at <= FRESH_S  # if two vehicles take turns, one of them is armed
        return VehicleState(
            Address(self.sysid, best[0]), source.autopilot, source.kind, armed, source.status,
            lat, lon, amsl, reports.capabilities, self._rivals(best[:2]), reports.home, tuple(self.texts),
            best[1], source.at, reports.placed_at,
            reports.leapt_from if now - reports.leapt_at <= FRESH_S else None, reports.version,
            reports.mavlink1, wind=reports.wind,
        )  # fmt: skip

    def alike(self) -> bool:
        """Whether all messages from the pinned address may come from one autopilot: one type, boot clock, position."""
        return self._pinned is None or self._rivals(self._pinned, here=True) == 1

    def _voices_at(self, voice: _Voice) -> int:
        kinds = [s for key, s in self._sources.items() if key[:2] == voice]
        overlapping = any(a is not b and a.overlaps(b) for a in kinds for b in kinds)
        reports = self._reports.get(voice)
        taking_turns = reports is not None and any(clock.of_two for clock in reports.clocks.values())
        return 2 if overlapping or taking_turns or (reports is not None and reports.leaps > 1) else 1

    def _rivals(self, mine: _Voice, *, here: bool = False) -> int:
        """Count the autopilots heard at the same time as ``mine``, including it; ``here``: only at its address."""
        first, until = self._span(mine)
        others = [voice for voice in self._others(mine) if not here or voice[1] == mine[1]]
        spans = [self._span(voice) for voice in others]
        return sum(begin <= until and first <= end for begin, end in spans) + self._voices_at(mine)

    def _others(self, mine: _Voice) -> set[_Voice]:
        """Return the other components and addresses that are autopilots, or have the component id of ``mine``."""
        pilots = {
            key[:2]
            for key, s in self._sources.items()
            if _is_autopilot(key[0], s) and (key[0] == mine[0] or s.autopilot not in (GENERIC, INVALID))
        }
        # A vehicle whose heartbeats are missing or lost counts too.
        return (pilots | {voice for voice in self._reports if voice[0] == mine[0]}) - {mine}

    def _span(self, voice: _Voice) -> tuple[float, float]:
        """Return when a voice was first and last heard, by any message."""
        heard = [(s.first, s.at) for key, s in self._sources.items() if key[:2] == voice]
        if voice in self._reports:
            heard.append((self._reports[voice].first, self._reports[voice].at))
        return min(first for first, _ in heard), max(at for _, at in heard)

    def _voice(self, voice: _Voice, now: float) -> _Reports:
        reports = self._reports.get(voice)
        if reports is None:
            if len(self._reports) >= _MOST_SOURCES:
                del self._reports[
                    min((v for v in self._reports if v != self._pinned), key=lambda v: self._reports[v].at)
                ]
            reports = self._reports[voice] = _Reports(first=now)
        reports.at = now
        return reports

    def _heartbeat(self, heard: Heard, now: float) -> None:
        m = heard.message
        key = (heard.source.compid, heard.peer, int(m.autopilot), int(m.type))
        armed = bool(m.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
        source = self._sources.get(key)
        if source is not None:
            source.armed, source.status, source.at = armed, m.system_status, now
            source.armed_at = now if armed else source.armed_at
            return
        if len(self._sources) >= _MOST_SOURCES:
            del self._sources[
                min((k for k in self._sources if k[:2] != self._pinned), key=lambda k: self._sources[k].at)
            ]
        self._sources[key] = _Source(key[2], key[3], armed, m.system_status, now, now, now if armed else -math.inf)

    def _text(self, m: Any) -> None:
        text = m.text if isinstance(m.text, str) else bytes(m.text).decode(errors="replace")
        self.texts_heard += 1
        self.texts.append("".join(c for c in text if c.isprintable()).strip())


def is_mavlink1(message: Any) -> bool:
    """Whether a message came in a frame of MAVLink 1; False for one that came in none."""
    frame = message.get_msgbuf()
    return bool(frame) and frame[0] == dialect.PROTOCOL_MARKER_V1


def _is_autopilot(compid: int, source: _Source) -> bool:
    return compid == _AUTOPILOT_COMPID or source.kind not in _NO_AUTOPILOT_TYPES


def _position(reports: _Reports, m: Any, now: float) -> None:
    found = place(m.lat, m.lon, m.alt)
    if found is not None:
        _put(reports, found, now, from_fix=False)


def _put(reports: _Reports, found: VehiclePosition, now: float, *, from_fix: bool) -> None:
    if reports.place is not None and now - reports.placed_at <= FRESH_S and _leap(reports.place, found):
        reports.leaps, reports.leapt_from, reports.leapt_at = reports.leaps + 1, reports.place, now
    reports.place, reports.from_fix, reports.placed_at = found, from_fix, now


def _leap(a: VehiclePosition, b: VehiclePosition) -> bool:
    """Whether two positions reported within `FRESH_S` are farther apart than any vehicle flies in that time."""
    north_m = (a.lat_deg - b.lat_deg) * _METRES_A_DEGREE
    turn_deg = (a.lon_deg - b.lon_deg + 180.0) % 360.0 - 180.0
    east_m = turn_deg * _METRES_A_DEGREE * math.cos(math.radians(a.lat_deg))
    return math.hypot(north_m, east_m) > _LEAP_M


def _fix(reports: _Reports, m: Any, now: float) -> None:
    found = place(m.lat, m.lon, m.alt)
    if found is not None and m.fix_type >= dialect.GPS_FIX_TYPE_3D_FIX and (reports.place is None or reports.from_fix):
        _put(reports, found, now, from_fix=True)


def _version(reports: _Reports, m: Any, now: float) -> None:
    reports.capabilities, reports.version = int(m.capabilities), int(m.flight_sw_version)


def _home_position(reports: _Reports, m: Any, now: float) -> None:
    found = place(m.latitude, m.longitude, m.altitude)
    if found is not None:
        reports.home = Home(m.latitude, m.longitude, found.amsl_m)


def _wind(reports: _Reports, m: Any, now: float) -> None:
    """WIND of ArduPilot: the direction is the one that the wind comes from."""
    speed_m_s, from_deg = finite(m.speed), finite(m.direction)
    if speed_m_s is not None and from_deg is not None:
        from_rad = math.radians(from_deg)
        _estimate(reports, WindEstimate(-speed_m_s * math.sin(from_rad), -speed_m_s * math.cos(from_rad)))


def _wind_cov(reports: _Reports, m: Any, now: float) -> None:
    """WIND_COV of PX4: the velocity of the air to north and east, and the sum of both variances."""
    north_m_s, east_m_s, variance = finite(m.wind_x), finite(m.wind_y), finite(m.var_horiz)
    if north_m_s is not None and east_m_s is not None and (variance is None or variance >= 0.0):
        _estimate(reports, WindEstimate(east_m_s, north_m_s, math.sqrt(variance or 0.0)))


def _estimate(reports: _Reports, found: WindEstimate) -> None:
    """Take an estimate. Exactly no wind is how a filter begins that has estimated none yet."""
    if 0.0 < found.speed_m_s <= _MOST_WIND_M_S and found.deviation_m_s <= _UNSURE_M_S:
        reports.wind = found


_CLOCKS = frozenset({"SYSTEM_TIME", "ATTITUDE", "GLOBAL_POSITION_INT"})
_TELLS = {
    "GLOBAL_POSITION_INT": _position,
    "GPS_RAW_INT": _fix,
    "AUTOPILOT_VERSION": _version,
    "HOME_POSITION": _home_position,
    "WIND": _wind,
    "WIND_COV": _wind_cov,
}
