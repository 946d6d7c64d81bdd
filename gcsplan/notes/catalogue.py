"""All sentences that gcsplan says of missions, by code; see `gcsplan.notes.note` for their fields."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from gcsplan.notes import battery_texts, flight_texts

TEXTS: Mapping[str, str] = MappingProxyType({
    code: text
    for texts in (battery_texts.TEXTS, flight_texts.TEXTS)
    for code, text in texts.items()
})  # fmt: skip
