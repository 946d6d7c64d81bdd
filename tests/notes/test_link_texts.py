"""Sentences on vehicles on their links: in the units of the reader, with keys as he types them."""

from __future__ import annotations

import pytest

from gcsplan.notes.link_texts import LINK_TEXTS
from gcsplan.notes.note import Note, Wording
from gcsplan.units import AVIATION, METRIC
from tests.support.sentences import faults_of

OPTIONS = {"max_agl_m": "--max-agl", "altitude_error_m": "--altitude-error"}
OWN_UNITS: set[str] = {"assumed_last_ten_metres", "terrain_spacing_not_judged"}
"""Sentences that state a parameter's value, a file's resolution or sea level in metres, whatever the reader's units."""


def test_every_sentence_speaks_in_the_readers_units_and_names_keys_as_typed() -> None:
    assert list(faults_of(LINK_TEXTS, OWN_UNITS)) == []


@pytest.mark.parametrize(
    ("note", "metric", "aviation"),
    [
        (
            Note("home_on_board_elsewhere", away_m=120.4, off_m=12.25, above=False),
            "the vehicle's home is 120 m from the mission's start and 12.2 m below it",
            "the vehicle's home is 395 ft from the mission's start and 40.2 ft below it",
        ),
        (
            Note("lean_angle_unread", speed_m_s=15.0, needs_deg=40),
            "the largest lean angle on board could not be read: 15.0 m/s need about 40°",
            "the largest lean angle on board could not be read: 29.2 kt need about 40°",
        ),
        (
            Note("pitch_not_flown", value=25.0, flown_deg=15.0, judged_m=16.0),
            "above its take-off's altitude than the 16 m that are judged unless climb_out_m_s",
            "above its take-off's altitude than the 52.49 ft that are judged unless",
        ),
    ],
)
def test_a_note_is_told_in_metres_or_feet(note: Note, metric: str, aviation: str) -> None:
    assert metric in note.text(Wording(METRIC, OPTIONS))
    assert aviation in note.text(Wording(AVIATION, OPTIONS))
