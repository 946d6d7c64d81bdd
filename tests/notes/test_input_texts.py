"""Sentences on files that were read: in the units of the reader, with keys as he types them."""

from __future__ import annotations

import pytest

from gcsplan.notes.input_texts import INPUT_TEXTS
from gcsplan.notes.note import Note, Wording
from gcsplan.units import AVIATION, METRIC
from tests.support.sentences import faults_of

OPTIONS = {"max_agl_m": "--max-agl", "altitude_error_m": "--altitude-error"}
OWN_UNITS: set[str] = {
    "six_decimals",
    "terrain_in_whole_metres",
    "tiles_are_sea",
    "tiles_are_sea_by_mission",
    "velocity_bounds_speed",
    "zeros_are_voids",
    "zeros_are_voids_in_several_places",
    "zeros_without_neighbours",
}
"""Sentences that state a parameter's value, a file's resolution or sea level in metres, whatever the reader's units."""


def test_every_sentence_speaks_in_the_readers_units_and_names_keys_as_typed() -> None:
    assert list(faults_of(INPUT_TEXTS, OWN_UNITS)) == []


@pytest.mark.parametrize(
    ("note", "metric", "aviation"),
    [
        (
            Note("spacing_differs", file="N36W085.DAT", spacing_m=50, most_m=100),
            "N36W085.DAT: its spacing is 50 m, and most blocks have 100 m",
            "N36W085.DAT: its spacing is 164.04 ft, and most blocks have 328.08 ft",
        ),
        (
            Note("home_row_blank", file="a.waypoints"),
            "a.waypoints: the file's home row is blank: the vehicle's start in the mission file",
            "a.waypoints: the file's home row is blank: the vehicle's start in the mission file",
        ),
        (
            Note("terrain_in_whole_metres"),
            "them: up to 1 m lower than its source; --altitude-error should hold it",
            "them: up to 1 m lower than its source; --altitude-error should hold it",
        ),
    ],
)
def test_a_note_is_told_in_metres_or_feet(note: Note, metric: str, aviation: str) -> None:
    assert metric in note.text(Wording(METRIC, OPTIONS))
    assert aviation in note.text(Wording(AVIATION, OPTIONS))
