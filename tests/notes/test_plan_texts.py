"""Sentences on plans, fleets and rehearsals: in the units of the reader, with keys as he types them."""

from __future__ import annotations

import pytest

from gcsplan.notes.note import Note, Wording
from gcsplan.notes.plan_texts import PLAN_TEXTS
from gcsplan.units import AVIATION, METRIC
from tests.support.sentences import faults_of

OPTIONS = {"max_agl_m": "--max-agl", "altitude_error_m": "--altitude-error"}
OWN_UNITS: set[str] = set()
"""Sentences that state a parameter's value, a file's resolution or sea level in metres, whatever the reader's units."""


def test_every_sentence_speaks_in_the_readers_units_and_names_keys_as_typed() -> None:
    assert list(faults_of(PLAN_TEXTS, OWN_UNITS)) == []


@pytest.mark.parametrize(
    ("note", "metric", "aviation"),
    [
        (
            Note("bound_ignores_turns"),
            "the lower bound is that of paths with sharp corners: it ignores turn_radius_m",
            "the lower bound is that of paths with sharp corners: it ignores turn_radius_m",
        ),
        (
            Note("bound_of_farther_paths", within_m=18520.0),
            "the terrain was looked at within 18.5 km of the straight track: the lower bound is",
            "the terrain was looked at within 10.0 NM of the straight track: the lower bound is",
        ),
        (
            Note("takeoff_raised", asked_m=30.0, raised_m=33.2),
            "takeoff_agl_m 30 m raised to 33.20 m: so far the ground rises within the track error",
            "takeoff_agl_m 98.43 ft raised to 108.92 ft: so far the ground rises within the",
        ),
        (
            Note("via_moved", via=2, aside_m=60.0),
            "via point 2 is moved 60 m aside: the climb there is on the spot",
            "via point 2 is moved 196.85 ft aside: the climb there is on the spot",
        ),
    ],
)
def test_a_note_is_told_in_metres_or_feet(note: Note, metric: str, aviation: str) -> None:
    assert metric in note.text(Wording(METRIC, OPTIONS))
    assert aviation in note.text(Wording(AVIATION, OPTIONS))
