"""`Mission`: decoded wire items, the autopilot, and home. It is checked, written to files and sent to vehicles.

Numbers are those of the wire: degrees times 1e7 as int32, everything else float32. Home is not among the items;
`Mission.wire_items` puts it first for ArduPilot, which stores it as item 0.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from gcsplan.errors import InputError, raised
from gcsplan.mavlink.mission.commands import DELAY, DO_CHANGE_SPEED, WAYPOINT
from gcsplan.vehicle import Autopilot

# Frames (MAV_FRAME). The _INT frames 5, 6, 11 mean the same as 0, 3, 10: both are read, 0, 3, 10 are written.
GLOBAL, NO_POSITION, RELATIVE, TERRAIN = 0, 2, 3, 10
FRAME_SYNONYMS = {5: GLOBAL, 6: RELATIVE, 11: TERRAIN}

AltitudeFrame = Literal["relative", "amsl", "terrain"]
"""The zero of a mission's altitudes: home, sea level or the terrain."""

NumberKept = Callable[[float], float]
"""From a number that was sent to the number that an autopilot keeps."""

# Types of lists (MAV_MISSION_TYPE).
MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255


_ONE, _WIRE = struct.Struct("<f"), struct.Struct("<4fiifHBB")


def float32(value: float) -> float:
    """Return the float32 nearest to ``value``, as sent on the wire; ``±inf`` beyond its range."""
    try:
        return float(_ONE.unpack(_ONE.pack(value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


def degrees_e7(degrees: float) -> int:
    """Return degrees as the wire's integer, times 1e7 and rounded, not truncated."""
    return round(degrees * 1e7)


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One MISSION_ITEM_INT without its addresses and seq.

    ``params`` are param1..param4; ``x``, ``y`` latitude and longitude times 1e7 (or raw numbers for commands
    without a location); ``z`` metres in ``frame``. The constructor rounds params and z to float32.
    """

    command: int
    frame: int
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    x: int = 0
    y: int = 0
    z: float = 0.0
    autocontinue: bool = True

    def __post_init__(self) -> None:
        try:
            *params, z = self._rounded()
        except InputError:
            raise
        except Exception as why:  # numbers of another type, or a stranger's
            words = "an item has whole numbers command, frame, x and y, and numbers params (four) and z"
            raise InputError(f"{words}: {raised(why)}", where="MissionItem()") from why
        object.__setattr__(self, "params", tuple(params))
        object.__setattr__(self, "z", z)

    def _rounded(self) -> Sequence[float]:
        """Params and z as the wire has them."""
        if len(self.params) != 4:
            raise InputError(f"an item has 4 params, given {len(self.params)}")
        if not (
            0 <= self.command <= 65535 and 0 <= self.frame <= 255
            and -(2**31) <= self.x < 2**31 and -(2**31) <= self.y < 2**31
        ):  # fmt: skip
            self._refuse()
        try:
            *params, _, _, z, _, _, _ = _WIRE.unpack(self.wire)
        except OverflowError:
            return [float32(value) for value in (*self.params, self.z)]
        return *params, z

    def __reduce__(self) -> tuple[Callable[[bytes], MissionItem], tuple[bytes]]:
        """Pickle the numbers of the wire: small, and quick, for archives are handed from process to process."""
        return _from_wire, (self.wire,)

    def _refuse(self) -> None:
        for name, value, low, high in (
            ("command", self.command, 0, 65535), ("frame", self.frame, 0, 255),
            ("x", self.x, -(2**31), 2**31 - 1), ("y", self.y, -(2**31), 2**31 - 1),
        ):  # fmt: skip
            if not low <= value <= high:
                raise InputError(f"{name} of a mission item must lie within {low} … {high}, given {value}")

    @property
    def wire(self) -> bytes:
        """The numbers as bytes, in which NaN equals NaN: params, x, y, z, command, frame, autocontinue."""
        return _WIRE.pack(*self.params, self.x, self.y, self.z, self.command, self.frame, self.autocontinue)

    @property
    def lat_deg(self) -> float:
        """Latitude of a located item, degrees."""
        return self.x / 1e7

    @property
    def lon_deg(self) -> float:
        """Longitude of a located item, degrees."""
        return self.y / 1e7

    @property
    def until_s(self) -> float | None:
        """The second of the day, UTC, until which a delay waits; None for any other item."""
        hour, minute, second = self.params[1:]
        given = 0 <= hour < 24 and 0 <= minute < 60 and 0 <= second < 60
        waits = self.command == DELAY and given and not 0 < self.params[0] < math.inf
        return 3600.0 * hour + 60.0 * minute + second if waits else None


def _from_wire(wire: bytes) -> MissionItem:
    *params, x, y, z, command, frame, autocontinue = _WIRE.unpack(wire)
    return MissionItem(command, frame, tuple(params), x, y, z, bool(autocontinue))


@dataclass(frozen=True, slots=True)
class Home:
    """The place where the vehicle arms: degrees times 1e7, and metres above mean sea level."""

    lat_e7: int
    lon_e7: int
    amsl_m: float

    @classmethod
    def at(cls, lat_deg: float, lon_deg: float, amsl_m: float) -> Home:
        """Return the home at a place in degrees."""
        return cls(degrees_e7(lat_deg), degrees_e7(lon_deg), float(amsl_m))

    def as_item(self) -> MissionItem:
        """Return ArduPilot's item 0."""
        return MissionItem(WAYPOINT, GLOBAL, (0.0, 0.0, 0.0, 0.0), self.lat_e7, self.lon_e7, self.amsl_m)


@dataclass(frozen=True, slots=True)
class Mission:
    """The mission of one vehicle. ``items`` exclude home. ``name`` is the vehicle's.

    ``leaves_s``: when it leaves the ground, seconds UTC since 1970, from which waits until a time of day count; None:
    not known.
    """

    autopilot: Autopilot
    home: Home
    items: tuple[MissionItem, ...]
    name: str = ""
    sysid: int = 1
    leaves_s: float | None = None

    def __repr__(self) -> str:
        return f"<Mission {self.name!r} for {self.autopilot}, system {self.sysid}: {len(self.wire_items())} items>"

    @property
    def first_seq(self) -> int:
        """Wire seq of ``items[0]``: 1 where home is item 0, else 0."""
        return 1 if self.autopilot.is_ardupilot else 0

    @property
    def commanded_m_s(self) -> float:
        """The fastest cruise that its items command, m/s; 0 if they command none."""
        speeds = (i.params[1] for i in self.items if i.command == DO_CHANGE_SPEED and i.params[0] in (0.0, 1.0))
        return max((speed for speed in speeds if 0.0 < speed < math.inf), default=0.0)

    def wire_items(self) -> tuple[MissionItem, ...]:
        """Return all items in wire order: seq is the index."""
        return (self.home.as_item(), *self.items) if self.autopilot.is_ardupilot else self.items

    @classmethod
    def from_wire(
        cls,
        autopilot: Autopilot,
        wire: Sequence[MissionItem],
        *,
        home: Home | None = None,
        name: str = "",
        sysid: int = 1,
    ) -> Mission:
        """Return the mission of items in wire order. On ArduPilot item 0 is home unless ``home`` overrides it.

        Raises InputError if neither contains a home.
        """
        items = tuple(wire)
        if autopilot.is_ardupilot:
            if items and home is None:
                first = items[0]
                home = Home(first.x, first.y, first.z)
            items = items[1:]
        if home is None:
            raise InputError(f"a mission for {autopilot} needs a home, and there is none in its items")
        return cls(autopilot, home, items, name, sysid)
