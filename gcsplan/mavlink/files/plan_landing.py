"""QGroundControl's landing patterns: a complex item of a `.plan` as the simple items that are sent for it.

The items are those of QGroundControl (LandingComplexItem.cc, `appendMissionItems`): DO_LAND_START; where requested a
speed change and the end of photos and video; the final approach (LOITER_TO_ALT or a way point); and the landing.
"""

from __future__ import annotations

from typing import Any

from gcsplan.mavlink.mission.commands import (
    DO_CHANGE_SPEED,
    DO_LAND_START,
    DO_SET_CAM_TRIGG_DIST,
    IMAGE_STOP_CAPTURE,
    LAND,
    LOITER_TO_ALT,
    VIDEO_STOP_CAPTURE,
    VTOL_LAND,
    WAYPOINT,
)
from gcsplan.mavlink.mission.mission import GLOBAL, NO_POSITION, RELATIVE

LANDING_PATTERNS = {"fwLandingPattern": LAND, "vtolLandingPattern": VTOL_LAND}


def landing_entries(entry: dict[str, Any]) -> list[dict[str, Any]] | None:
    """Return a landing pattern's simple items in a plan's JSON form; None if its coordinates are missing."""
    land = entry.get("landCoordinate")
    approach = entry.get("landingApproachCoordinate", entry.get("loiterCoordinate"))
    if not (isinstance(land, list) and isinstance(approach, list) and len(land) == len(approach) == 3):
        return None
    both = entry.get("altitudesAreRelative")
    frames = [
        RELATIVE if (both if isinstance(both, bool) else entry.get(key, True)) else GLOBAL
        for key in ("loiterAltitudeRelative", "landingAltitudeRelative")
    ]
    radius = entry.get("loiterRadius", 0)
    turn = radius if entry.get("loiterClockwise", True) or not isinstance(radius, int | float) else -radius
    items = [_entry(DO_LAND_START, NO_POSITION)]
    if entry.get("useDoChangeSpeed"):
        items.append(_entry(DO_CHANGE_SPEED, NO_POSITION, 1, entry.get("finalApproachSpeed", 0), -1))
    if entry.get("stopTakingPhotos"):
        items += [_entry(DO_SET_CAM_TRIGG_DIST, NO_POSITION), _entry(IMAGE_STOP_CAPTURE, NO_POSITION)]
    if entry.get("stopVideoPhotos"):
        items.append(_entry(VIDEO_STOP_CAPTURE, NO_POSITION))
    if entry.get("useLoiterToAlt", True):
        items.append(_entry(LOITER_TO_ALT, frames[0], 1, turn, 0, 1, at=approach))
    else:
        items.append(_entry(WAYPOINT, frames[0], at=approach))
    items.append(_entry(LANDING_PATTERNS[str(entry.get("complexItemType"))], frames[1], at=land))
    return items


def _entry(command: int, frame: int, *params: Any, at: list[Any] | None = None) -> dict[str, Any]:
    numbers = [*params, 0, 0, 0, 0][:4]
    return {
        "type": "SimpleItem", "autoContinue": True, "command": command, "frame": frame,
        "params": [*numbers, *(at or (0, 0, 0))],
    }  # fmt: skip
