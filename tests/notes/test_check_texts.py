"""Sentences on what the check finds: in the units of the reader, with keys as he types them."""

from __future__ import annotations

import pytest

from gcsplan.notes.check_texts import CHECK_TEXTS
from gcsplan.notes.note import Note, Wording
from gcsplan.units import AVIATION, METRIC
from tests.support.sentences import faults_of

OPTIONS = {"max_agl_m": "--max-agl", "altitude_error_m": "--altitude-error"}
OWN_UNITS: set[str] = set()
"""Sentences that state a parameter's value, a file's resolution or sea level in metres, whatever the reader's units."""


def test_every_sentence_speaks_in_the_readers_units_and_names_keys_as_typed() -> None:
    assert list(faults_of(CHECK_TEXTS, OWN_UNITS)) == []


@pytest.mark.parametrize(
    ("note", "metric", "aviation"),
    [
        (
            Note("energy_fitted_elsewhere", 5, fitted=(8.0, 10.0), speed_m_s=12.0),
            "the energy is fitted to flights at 8 m/s, 10 m/s, and from item 5 on it flies at",
            "the energy is fitted to flights at 15.55 kt, 19.44 kt, and from item 5 on it flies",
        ),
        (
            Note("reads_terrain_on_board", spacing_m=100, error_m=20.0),
            "reads this terrain, at posts every 100 m, with 20 m of error",
            "reads this terrain, at posts every 328.08 ft, with 65.62 ft of error",
        ),
        (
            Note("takes_off_elsewhere", 1, away_m=12.4),
            "item 1: take-off lies 12 m from home: what PX4 does between is not judged; give it",
            "item 1: take-off lies 41 ft from home: what PX4 does between is not judged; give it",
        ),
        (
            Note("no_ceiling"),
            "--max-agl is not set: nothing limits the height above ground",
            "--max-agl is not set: nothing limits the height above ground",
        ),
    ],
)
def test_a_note_is_told_in_metres_or_feet(note: Note, metric: str, aviation: str) -> None:
    assert metric in note.text(Wording(METRIC, OPTIONS))
    assert aviation in note.text(Wording(AVIATION, OPTIONS))
