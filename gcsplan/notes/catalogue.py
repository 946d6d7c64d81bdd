"""All sentences that gcsplan says of missions, by code; see `gcsplan.notes.note` for their fields."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from gcsplan.notes import (
    battery_texts,
    file_texts,
    finding_texts,
    fleet_texts,
    flight_texts,
    link_texts,
    log_texts,
    mission_file_texts,
    plan_texts,
    rehearsal_texts,
    return_texts,
    site_texts,
    terrain_texts,
    turn_texts,
    upload_texts,
    zone_texts,
)

ROOMS = (
    battery_texts, file_texts, finding_texts, fleet_texts, flight_texts, link_texts, log_texts, mission_file_texts,
    plan_texts, rehearsal_texts, return_texts, site_texts, terrain_texts, turn_texts, upload_texts, zone_texts,
)  # fmt: skip

TEXTS: Mapping[str, str] = MappingProxyType({
    code: text
    for room in ROOMS
    for code, text in room.TEXTS.items()
})  # fmt: skip
