"""What a mission must know of the firmware version on board (AUTOPILOT_VERSION): whether PX4 flies its legs straight.

PX4 until 1.17 changes its altitude evenly along a leg. Its development since June 2026 (pull request 27607, commit
1ae8f2383f; 1.18 beta) climbs or descends at its own rate at the beginning of a leg, swings about the altitude of its
target, and may so miss the way point's altitude window and fly on past it (upstream issue 28507). So it flies no leg
straight on which the altitude of the target or of the one after it differs.
"""

from __future__ import annotations

from collections.abc import Sequence

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import FRAME_SYNONYMS, NO_POSITION, MissionItem
from gcsplan.vehicle import Autopilot

__all__ = ["STRAIGHT_UNTIL", "flies_straight", "needs_straight", "version_of", "version_words"]

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
    """The version (major, minor) in AUTOPILOT_VERSION's number; None if it is not told."""
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
