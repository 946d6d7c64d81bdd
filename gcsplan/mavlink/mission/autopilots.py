"""Autopilot profiles in one table: the ids that each autopilot reports, what it accepts, and what it stores of that.

Sources stand beside the numbers; `stored_ardupilot` and `stored_px4` hold the rules for items.

What matters of the firmware version on board (AUTOPILOT_VERSION) is whether PX4 flies its legs straight. Until 1.17 it
changes its altitude evenly along a leg. Its development since June 2026 (pull request 27607, commit
1ae8f2383f; 1.18 beta) climbs or descends at its own rate at the beginning of a leg, swings about the altitude of its
target, and may so miss the way point's altitude window and fly on past it (upstream issue 28507). So it flies no leg
straight on which the altitude of the target or of the one after it differs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from gcsplan.errors import InputError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import FENCE, FRAME_SYNONYMS, MISSION, NO_POSITION, Mission, MissionItem, float32
from gcsplan.mavlink.mission.mission import MissionItem as Item
from gcsplan.mavlink.mission.stored_ardupilot import (
    read_back_altitudes,
    refused_by_copter,
    refused_by_plane,
    stored_by_copter,
    stored_by_plane,
    stored_cm,
)
from gcsplan.mavlink.mission.stored_px4 import refused_by_px4, stored_by_px4
from gcsplan.vehicle import Autopilot

# MAV_AUTOPILOT
GENERIC, ARDUPILOTMEGA, INVALID, PX4 = 0, 3, 8, 12
_AUTOPILOT_NAMES = {GENERIC: "a generic autopilot", ARDUPILOTMEGA: "ArduPilot", INVALID: "no autopilot", PX4: "PX4"}

# MAV_TYPE
COPTERS = frozenset({2, 3, 4, 13, 14, 15, 29, 35, 43})
"""Quadrotor, coaxial, helicopter, hexa-, octo-, tri-, dodeca-, decarotor, generic multirotor."""
PLANES = frozenset({1, 19, 20, 21, 22, 23, 24, 25, 28})
"""Fixed wing, the VTOLs, parafoil."""
_TYPE_NAMES = {
    0: "generic", 1: "fixed wing", 2: "quadrotor", 3: "coaxial helicopter", 4: "helicopter", 6: "ground station",
    10: "rover", 11: "boat", 12: "submarine", 13: "hexarotor", 14: "octorotor", 15: "tricopter", 19: "VTOL tailsitter",
    20: "VTOL tailsitter", 21: "VTOL tiltrotor", 22: "VTOL with fixed rotors", 23: "VTOL tailsitter",
    24: "VTOL tiltwing", 25: "VTOL", 28: "parafoil", 29: "dodecarotor", 35: "decarotor", 43: "multirotor",
}  # fmt: skip

ALTITUDE_LIMIT_M = 83_000.0
"""Largest altitude, either sign, in metres: ArduPilot stores centimetres in 24 bits (``LOCATION_ALT_MAX_M``)."""


@dataclass(frozen=True, slots=True)
class AutopilotProfile:
    """The items that one autopilot accepts, and how it stores them.

    ``max_items`` counts wire items, including home where home is one. ``stored(item)`` returns the item that reads
    back; ``refuses(item)`` returns why the autopilot refuses it, empty if it accepts it. ``atomic``: the new mission
    replaces the old one only at the end of an upload, so a broken upload leaves the old one. ``holds_s``: seconds for
    which a broken upload keeps the vehicle busy. The check follows a mission as vehicles of
    ``judged_types``, a part of ``mav_types``, fly it: a PX4's as a multicopter flies it.
    """

    autopilot: Autopilot
    label: str
    mav_autopilot: int
    mav_types: frozenset[int]
    judged_types: frozenset[int]
    max_items: int
    atomic: bool
    holds_s: float
    stored: Callable[[Item], Item]
    refuses: Callable[[Item], str]


_TABLE: dict[Autopilot, AutopilotProfile] = {
    Autopilot.ARDUCOPTER: AutopilotProfile(
        Autopilot.ARDUCOPTER,
        "ArduCopter",
        ARDUPILOTMEGA,
        COPTERS,
        COPTERS,
        max_items=650,  # measured; an item takes 15 bytes in the storage of a 16 KB board (StorageManager.cpp)
        atomic=False,  # MissionItemProtocol_Waypoints.cpp: COUNT truncates, items replace one by one
        holds_s=8.0,  # MissionItemProtocol.h: upload_timeout_ms
        stored=stored_by_copter,
        refuses=refused_by_copter,
    ),
    Autopilot.ARDUPLANE: AutopilotProfile(
        Autopilot.ARDUPLANE,
        "ArduPlane",
        ARDUPILOTMEGA,
        PLANES,
        PLANES,
        max_items=650,  # ArduPlane's own layout holds 655; the smaller number is used for both
        atomic=False,
        holds_s=8.0,
        stored=stored_by_plane,
        refuses=refused_by_plane,
    ),
    Autopilot.PX4: AutopilotProfile(
        Autopilot.PX4,
        "PX4",
        PX4,
        COPTERS | PLANES,
        COPTERS,
        # navigation.h: NUM_MISSIONS_SUPPORTED 2000 on boards with an SD card, 65534 in simulation, 500 with missions
        # in RAM and 50 on the smallest boards; a board that holds fewer answers NO_SPACE.
        max_items=2000,
        atomic=True,  # mavlink_mission.cpp: written to the inactive bank, swapped after the last item
        holds_s=5.0,  # mavlink_mission.h: MAVLINK_MISSION_PROTOCOL_TIMEOUT_DEFAULT
        stored=stored_by_px4,
        refuses=refused_by_px4,
    ),
}


def profile_of(autopilot: Autopilot) -> AutopilotProfile:
    """Return the profile of ``autopilot``."""
    return _TABLE[autopilot]


def autopilot_of(mav_autopilot: int, mav_type: int) -> Autopilot | None:
    """Return the autopilot with these ids of a heartbeat; None if gcsplan does not know it."""
    return next(
        (a for a, row in _TABLE.items() if row.mav_autopilot == mav_autopilot and mav_type in row.mav_types), None
    )


def stored(item: Item, autopilot: Autopilot) -> Item:
    """Return ``item`` as it reads back from ``autopilot``."""
    return _TABLE[autopilot].stored(item)


def sent_for(mission: Mission) -> Mission:
    """The mission that its autopilot stores as this one, which was read back from it.

    ArduPilot truncates metres to centimetres, and some of them read back just below the whole centimetre: 7163 as
    71.62999… m. Whoever stores such an item again, as every check does, would judge it a centimetre lower than it is.
    """
    if not mission.autopilot.is_ardupilot:
        return mission
    return replace(mission, items=tuple(_sent_for(item, mission.autopilot) for item in mission.items))


def _sent_for(item: MissionItem, autopilot: Autopilot) -> MissionItem:
    if not abs(item.z) < ALTITUDE_LIMIT_M:
        return item
    cm = round(item.z * 100.0)
    if stored_cm(item.z) == cm or item.z not in read_back_altitudes(cm):
        return item
    return replace(item, z=altitude_of_cm(cm, autopilot))


def max_items(autopilot: Autopilot, mission_type: int = MISSION) -> int:
    """Return the most items of that list: fence 70 (84 on ArduPlane, 64 on PX4), rally points 32."""
    if mission_type == MISSION:
        return _TABLE[autopilot].max_items
    if mission_type == FENCE:  # polygon vertices; circles take more storage on ArduPilot, which holds 42
        return {Autopilot.ARDUCOPTER: 70, Autopilot.ARDUPLANE: 84, Autopilot.PX4: 64}[autopilot]
    return 32


def altitude_of_cm(cm: int, autopilot: Autopilot) -> float:
    """Return the metres (float32) to send so that exactly ``cm`` centimetres are stored.

    ArduPilot truncates towards zero after a float32 product, so half a centimetre is added, away from zero. Raises
    InputError beyond `ALTITUDE_LIMIT_M`.
    """
    if abs(cm) >= ALTITUDE_LIMIT_M * 100:
        raise InputError(f"an altitude must lie within ±{ALTITUDE_LIMIT_M:.0f} m, given {cm / 100} m")
    if _TABLE[autopilot].mav_autopilot == ARDUPILOTMEGA:
        return float32((cm + math.copysign(0.5, cm)) / 100.0)
    return float32(cm / 100.0)


def autopilot_name(mav_autopilot: int) -> str:
    """Return a MAV_AUTOPILOT in words."""
    return _AUTOPILOT_NAMES.get(mav_autopilot, f"autopilot kind {mav_autopilot}")


def type_name(mav_type: int) -> str:
    """Return a MAV_TYPE in words."""
    return _TYPE_NAMES.get(mav_type, f"vehicle type {mav_type}")


def is_generic(mav_autopilot: int) -> bool:
    """Whether a peer does not report which autopilot it is."""
    return mav_autopilot in (GENERIC, INVALID)


STRAIGHT_UNTIL = (1, 17)
"""The last version (major, minor) of PX4 that is known to fly straight legs."""

_BETA = 128
_RELEASE_KINDS = ((255, ""), (192, " release candidate"), (_BETA, " beta"), (64, " alpha"), (0, " development"))
"""FIRMWARE_VERSION_TYPE, from this number on."""

_FLOWN_TO = frozenset({
    cmd.WAYPOINT, cmd.LOITER_UNLIM, cmd.LOITER_TIME, cmd.LOITER_TO_ALT, cmd.LAND, cmd.TAKEOFF, cmd.VTOL_TAKEOFF,
    cmd.VTOL_LAND,
})  # fmt: skip
_SAME_M = 0.001


def version_words(flight_sw_version: int | None) -> str:
    """``1.18.0 beta``, from the number in AUTOPILOT_VERSION."""
    if not flight_sw_version:
        return "of a version that it does not tell"
    major, minor, patch, kind = flight_sw_version.to_bytes(4, "big")
    return f"{major}.{minor}.{patch}" + next(words for least, words in _RELEASE_KINDS if kind >= least)


def version_of(flight_sw_version: int | None) -> tuple[int, int] | None:
    """The version (major, minor) in AUTOPILOT_VERSION's number; None if the vehicle does not report it."""
    if not flight_sw_version:
        return None
    major, minor, _, _ = flight_sw_version.to_bytes(4, "big")
    return (major, minor)


def flies_straight(flight_sw_version: int | None) -> bool:
    """Whether a PX4 of this version is known to fly straight legs; False too for one that is not known.

    Development and alpha builds of the last such version are not known: the numbers do not tell what is in them.
    """
    if not flight_sw_version:
        return False
    major, minor, _, kind = flight_sw_version.to_bytes(4, "big")
    return (major, minor) < STRAIGHT_UNTIL or ((major, minor) == STRAIGHT_UNTIL and kind >= _BETA)


def needs_straight(items: Sequence[MissionItem], autopilot: Autopilot) -> bool:
    """Whether a mission depends on straight legs: it is for PX4, and not all of it is at one altitude."""
    if autopilot is not Autopilot.PX4:
        return False
    flown = [i for i in items if i.command in _FLOWN_TO and i.frame != NO_POSITION]
    levels = {(FRAME_SYNONYMS.get(i.frame, i.frame), round(i.z / _SAME_M) if abs(i.z) < 1e9 else None) for i in flown}
    return len(levels) > 1
