"""The mission protocol's messages as plain values, which `transfer` and the loopback vehicle exchange.

`wire` translates them to and from pymavlink's messages. Nothing here uses a socket or a clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from gcsplan.mavlink.mission.mission import MISSION, MissionItem


class Address(NamedTuple):
    """System and component id; as a target, 0 means every system or every component."""

    sysid: int
    compid: int


@dataclass(frozen=True, slots=True)
class Count:
    """MISSION_COUNT (44)."""

    count: int
    mission_type: int = MISSION
    opaque_id: int = 0


@dataclass(frozen=True, slots=True)
class RequestList:
    """MISSION_REQUEST_LIST (43)."""

    mission_type: int = MISSION


@dataclass(frozen=True, slots=True)
class Request:
    """MISSION_REQUEST_INT (51), or MISSION_REQUEST (40) if ``legacy``; the answer to both is an `Item`."""

    seq: int
    mission_type: int = MISSION
    legacy: bool = False


@dataclass(frozen=True, slots=True)
class Item:
    """MISSION_ITEM_INT (73)."""

    seq: int
    item: MissionItem
    mission_type: int = MISSION
    current: int = 0


@dataclass(frozen=True, slots=True)
class LegacyItem(Item):
    """MISSION_ITEM (39), the old form: degrees as float32, which resolve about 0.4 m; a download refuses it."""


@dataclass(frozen=True, slots=True)
class Ack:
    """MISSION_ACK (47); ``code`` is a MAV_MISSION_RESULT."""

    code: int
    mission_type: int = MISSION
    opaque_id: int = 0


@dataclass(frozen=True, slots=True)
class ClearAll:
    """MISSION_CLEAR_ALL (45)."""

    mission_type: int = MISSION


MissionMessage = Count | RequestList | Request | Item | Ack | ClearAll


@dataclass(frozen=True, slots=True)
class Packet:
    """A message with its sender and its addressee."""

    source: Address
    target: Address
    message: MissionMessage
