"""The common part of both autopilots' protocol machines: the board that survives a reboot, ACK codes, phases.

Two rules hold for both machines. (1) The machine's table maps (phase, message type) to a handler; a message without
an entry is ignored, as the autopilot ignores it. (2) A handler returns the messages to send as
``(addressee, message)`` pairs and sends nothing itself.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Protocol

from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, Home, MissionItem, float32
from gcsplan.mavlink.protocol.messages import Address, MissionMessage

# MAV_MISSION_RESULT. Not those of `gcsplan.mavlink.protocol`: these vehicles are what the protocol is tested against.
ACCEPTED, ERROR, UNSUPPORTED_FRAME, UNSUPPORTED, NO_SPACE, INVALID = 0, 1, 2, 3, 4, 5
INVALID_PARAM1, INVALID_PARAM2, INVALID_PARAM3, INVALID_PARAM4, INVALID_X, INVALID_Y, INVALID_Z = range(6, 13)
INVALID_SEQUENCE, DENIED, CANCELLED = 13, 14, 15

Out = list[tuple[Address, MissionMessage]]


ParamKept = Callable[[float], float]
"""From a param that was sent to the param that reads back."""
ParamsKept = tuple[ParamKept, ParamKept, ParamKept, ParamKept]
"""How each of an item's four params reads back."""


def as_sent(value: float) -> float:
    """A param that is kept as a float."""
    return value


def lost(value: float) -> float:
    """A param that is not kept."""
    return 0.0


def as_flag(value: float) -> float:
    """A param of which is kept whether it is above 0."""
    return 1.0 if value > 0 else 0.0


NOTHING_KEPT: ParamsKept = (lost, lost, lost, lost)


class ItemRefused(Exception):
    """The autopilot refuses the item; ``code`` is the MAV_MISSION_RESULT that it answers."""

    def __init__(self, code: int) -> None:
        super().__init__(f"MAV_MISSION_RESULT {code}")
        self.code = code


class Phase(Enum):
    """The phase of a machine."""

    IDLE = auto()
    RECEIVING = auto()  # an upload: the vehicle requests items, the ground station answers
    SENDING = auto()  # a download (only PX4 has this state)


def through_float(item: MissionItem) -> MissionItem:
    """Return ``item`` with its location rounded as in MISSION_ITEM: float32 degrees, about 0.4 m at 36°."""
    x, y = (round(float32(float32(v) * float32(1e-7)) * 1e7) for v in (item.x, item.y))
    return MissionItem(item.command, item.frame, item.params, x, y, item.z, item.autocontinue)


@dataclass
class Board:
    """The stored lists, which survive a reboot, and the vehicle's state. On ArduPilot, slot 0 of a mission is home."""

    home: Home
    lists: dict[int, list[MissionItem]] = field(default_factory=lambda: {MISSION: [], FENCE: [], RALLY: []})
    armed: bool = False
    flying_mission: bool = False  # in AUTO or mission mode
    booting: bool = False
    uploads: int = 0  # finished uploads of a mission

    def opaque_id(self, mission_type: int) -> int:
        """Return a number that changes with the list."""
        return zlib.crc32(b"".join(item.wire for item in self.lists.get(mission_type, [])))


class MissionServer(Protocol):
    """An autopilot's side of the protocol for all its lists."""

    def receive(self, message: MissionMessage, sender: Address, now: float) -> Out:
        """Return the answers to ``message``."""
        ...

    @property
    def deadline(self) -> float | None:
        """The next time to call `on_timer`, or None."""
        ...

    def on_timer(self, now: float) -> Out:
        """Return the messages that are due at ``now``."""
        ...

    def reset(self) -> None:
        """Drop every transfer, as a reboot does."""
        ...
