"""Sentences on the way home: in the units of the reader, with keys as he types them."""

from __future__ import annotations

import pytest

from gcsplan.notes.note import Note, Wording
from gcsplan.notes.way_home_texts import WAY_HOME_TEXTS
from gcsplan.units import AVIATION, METRIC
from tests.support.sentences import faults_of

OPTIONS = {"max_agl_m": "--max-agl", "altitude_error_m": "--altitude-error"}
OWN_UNITS: set[str] = set()
"""Sentences that state a parameter's value, a file's resolution or sea level in metres, whatever the reader's units."""


def test_every_sentence_speaks_in_the_readers_units_and_names_keys_as_typed() -> None:
    assert list(faults_of(WAY_HOME_TEXTS, OWN_UNITS)) == []


@pytest.mark.parametrize(
    ("note", "metric", "aviation"),
    [
        (
            Note("no_return_from_part", path=Note("path_safe"), no_return_m=1852.0),
            "path safe; no safe return from 1.9 km of it",
            "path safe; no safe return from 1.0 NM of it",
        ),
        (
            Note("between_altitudes", lowest_m=30.04, highest_m=99.96),
            "from all of the path at 30.1 m to 99.9 m above home",
            "from all of the path at 98.6 ft to 327.9 ft above home",
        ),
        (
            Note("judged_at", rel_home_m=15.0, assumed=True),
            "15 m above home, the autopilot's default",
            "49.21 ft above home, the autopilot's default",
        ),
        (
            Note("above_max_agl", max_agl_m=120.0),
            ", but above --max-agl (120 m) over home",
            ", but above --max-agl (393.7 ft) over home",
        ),
    ],
)
def test_a_note_is_told_in_metres_or_feet(note: Note, metric: str, aviation: str) -> None:
    assert metric in note.text(Wording(METRIC, OPTIONS))
    assert aviation in note.text(Wording(AVIATION, OPTIONS))
