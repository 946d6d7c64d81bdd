"""Rules for every sentence of the catalogue: it uses its reader's units, and names keys as the reader types them.

A room of the catalogue is a dict of templates by code; `faults_of` fills each of them with numbers, as a note would.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from gcsplan.notes.note import NUMBER_KINDS, TEXTS, Datum, Note, Wording, fields_of, parts_of
from gcsplan.units import AVIATION, METRIC

SI = re.compile(r"(\d|\})\s?(m|km|m/s|ft|kt)\b")
"""A unit that is written out behind a number or a field, so that no reader's system changes it."""

KEYS = {form for text in TEXTS.values() for _, name, form in parts_of(text) if name == "key"} - {"start"}
"""Keys of the mission file that some sentence names; `start` is a word, too."""


def datum_for(forms: set[str]) -> Datum:
    """A value that a field of these forms can show."""
    kinds = {form.split()[0].partition(".")[0] for form in forms if form and "|" not in form}
    if kinds & {"lines", "rows"}:
        return "one", "two"
    if "key" in kinds:
        return "min_agl_m"
    if kinds & {*NUMBER_KINDS, "angle", "reach", "seconds", "joules"}:
        return 1234.5
    if any("|" in form for form in forms):
        return 3
    return 12.5 if any(form for form in forms) else "word"


def note_of(code: str) -> Note:
    """A note with numbers for all fields of its sentence."""
    text = TEXTS[code]
    data = {name: datum_for({form for _, n, form in parts_of(text) if n == name}) for name in fields_of(text)}
    return Note(code, 7, **data)


def faults_of(room: Mapping[str, str], own_units: set[str]) -> Iterator[str]:
    """The faults of the sentences of a room. ``own_units``: codes of sentences that write a unit out with reason."""
    options = {key: f"--{key.replace('_', '-')}" for key in KEYS}
    for code, text in room.items():
        note = note_of(code)
        metric, aviation = (note.text(Wording(units, options)) for units in (METRIC, AVIATION))
        forms = {form.split()[0].partition(".")[0] for _, name, form in parts_of(text) if name and form}
        if forms & {*NUMBER_KINDS, "reach"} and metric == aviation:
            yield f"{code}: the same in every system: {metric}"
        if bool(SI.search(text)) != (code in own_units):
            yield f"{code}: a unit is written out, or none is where one was: {text}"
        literals = "".join(literal for literal, *_ in parts_of(text))
        yield from (f"{code}: {key} is no {{key:{key}}}" for key in KEYS if re.search(rf"\b{key}\b", literals))
        named = {form for _, name, form in parts_of(text) if name == "key"}
        yield from (f"{code}: {key} is not named as typed" for key in named if options.get(key, key) not in metric)
        if "{" in metric or not metric.strip():
            yield f"{code}: not a sentence: {metric}"
