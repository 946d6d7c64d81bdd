"""All sentences that gcsplan says of missions, by code; see `gcsplan.notes.note` for their fields."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from gcsplan.notes import (
    battery_texts,
    file_texts,
    finding_texts,
    flight_texts,
    link_texts,
    log_texts,
    mission_file_texts,
    return_texts,
    site_texts,
    terrain_texts,
    turn_texts,
    zone_texts,
)

TEXTS: Mapping[str, str] = MappingProxyType({
    code: text
    for room in (
        battery_texts, site_texts, finding_texts, flight_texts, return_texts, turn_texts, mission_file_texts,
        file_texts, link_texts, log_texts, terrain_texts, zone_texts,
    )
    for code, text in room.TEXTS.items()
})  # fmt: skip
