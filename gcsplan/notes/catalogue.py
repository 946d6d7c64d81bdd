"""All sentences that gcsplan says of missions, by code; see `gcsplan.notes.note` for their fields."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from gcsplan.notes import check_texts, input_texts, link_texts, plan_texts, return_texts

ROOMS = (check_texts, input_texts, link_texts, plan_texts, return_texts)

TEXTS: Mapping[str, str] = MappingProxyType({
    code: text
    for room in ROOMS
    for code, text in room.TEXTS.items()
})  # fmt: skip
