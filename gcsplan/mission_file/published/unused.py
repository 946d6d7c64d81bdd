"""Published zones near a mission that are not used, by name; and zones near it that are not understood."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import PurePath

from gcsplan.errors import Mistake
from gcsplan.mission_file.zones.draft import ZoneDraft, one_line
from gcsplan.mission_file.zones.file import SKIPPED
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Box, Zone

TURNS = (-720.0, -360.0, 0.0, 360.0, 720.0)
"""Whole turns by which a longitude may be written otherwise than the frame's, degrees."""

NAMED_WITHIN_M = 5000.0
"""Zones this near to the mission's surroundings are named at least, m."""


def faults_near(placed: Sequence[tuple[ZoneDraft, Zone]], box: Box) -> list[Mistake]:
    """The faults of zones that reach into the mission's surroundings."""
    found: dict[Mistake, None] = {}
    for draft, zone in placed:
        if draft.faults and _meets(zone, box):
            found |= dict.fromkeys(draft.faults)
    return list(found)


def not_understood_far(placed: Sequence[tuple[ZoneDraft, Zone]], far: Sequence[ZoneDraft], box: Box) -> list[Note]:
    """A note with the name of every zone that is not understood and lies too far from the mission to matter.

    ``far`` lies beyond the plane; of the others not even the surroundings reach into the mission's ``box``, beyond
    which no ground is known, so that no flight is judged safe there.
    """
    near = {id(draft) for draft, zone in placed if _meets(zone, box)}
    away = [*far, *(draft for draft, _ in placed if draft.faults and id(draft) not in near)]
    found: dict[str, dict[str, None]] = {}
    for draft in away:
        if draft.faults or draft.unread:
            found.setdefault(_file_of(draft), {})[one_line(draft.name)] = None
    return [Note("zones_not_understood_far", file=file, zones=tuple(names)) for file, names in found.items()]


def used(drafts: Sequence[ZoneDraft]) -> list[ZoneDraft]:
    """The zones that are no-fly."""
    return [d for d in drafts if not d.unused]


def left_out_by_hours(drafts: Sequence[ZoneDraft]) -> bool:
    """Whether a zone is not used because it does not apply in the hours of the mission."""
    return any(d.unused is not None and d.unused.code == "zones_out_of_hours" for d in drafts)


def unused_notes(drafts: Sequence[ZoneDraft], frame: Frame, box: Box) -> list[Note]:
    """A note for each reason, with the name of every zone near the mission that is not used for it.

    Near is as far around the mission's surroundings as they extend, and at least `NAMED_WITHIN_M`; zones beyond are
    counted. Zones that are not understood are named wherever they lie.
    """
    unused = [d for d in drafts if d.unused]
    if not unused:
        return []
    reach_m = max(box[2] - box[0], box[3] - box[1], NAMED_WITHIN_M)
    wider = (box[0] - reach_m, box[1] - reach_m, box[2] + reach_m, box[3] + reach_m)
    edges = frame.to_degrees(*zip(*_border(wider), strict=True))
    turned = (edges[:, 1] - frame.lon_deg + 180.0) % 360.0 - 180.0
    window = (turned.min(), edges[:, 0].min(), turned.max(), edges[:, 0].max())
    near = [draft for draft in unused if draft.unused == SKIPPED or _is_near(draft, frame, window)]
    notes = _reasons(near)
    if len(near) < len(unused):
        notes.append(Note("zones_unused_far_away", count=len(unused) - len(near)))
    return notes


def listed(drafts: Sequence[ZoneDraft]) -> tuple[list[ZoneDraft], list[Note]]:
    """The zones that are no-fly, and notes on all others and on what is not understood, wherever they lie."""
    faults = [Note("zone_not_understood", where=p.where, why=p.message) for draft in drafts for p in draft.faults]
    return used(drafts), [*_reasons([d for d in drafts if d.unused]), *dict.fromkeys(faults)]


def _reasons(unused: Sequence[ZoneDraft]) -> list[Note]:
    """A note for each file and reason, with the names of all zones that are not used for it."""
    about: dict[Note, list[str]] = {}
    for draft in unused:
        if draft.unused is not None:
            why = draft.unused.of(file=_file_of(draft))
            about.setdefault(why, []).append(one_line(draft.name))
    return [why.of(zones=tuple(names)) for why, names in about.items()]


def _file_of(draft: ZoneDraft) -> str:
    return PurePath(draft.where.split(": ", 1)[0]).name


def _border(box: Box) -> list[tuple[float, float]]:
    """Points of the box's border, near enough to each other to tell how far north it bows."""
    west, south, east, north = box
    along = [i / 16 for i in range(17)]
    level = [(west + part * (east - west), n) for part in along for n in (south, north)]
    return level + [(e, south + part * (north - south)) for part in along for e in (west, east)]


def _is_near(draft: ZoneDraft, frame: Frame, window: Box) -> bool:
    """Whether the rectangle of degrees around the zone meets the window, whose longitudes count from the frame's."""
    tall = 0.0 if draft.radius_m is None else math.degrees(draft.radius_m / 6_300_000.0)
    lat = [p[0] for p in draft.points]
    wide = tall / math.cos(math.radians(min(max(map(abs, lat)) + tall, 89.0)))
    lon = [p[1] - frame.lon_deg for p in draft.points]
    west, east = min(lon) - wide, max(lon) + wide
    level = min(lat) - tall <= window[3] and max(lat) + tall >= window[1]
    return level and any(west + turn <= window[2] and east + turn >= window[0] for turn in TURNS)


def _meets(zone: Zone, box: Box) -> bool:
    west, south, east, north = zone.bounds
    return bool(west <= box[2] and east >= box[0] and south <= box[3] and north >= box[1])
