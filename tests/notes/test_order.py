"""The order of notes for people: the flight's first, the planning's last, and the defaults in one line."""

from __future__ import annotations

from gcsplan.notes.note import TEXTS, Note
from gcsplan.notes.order import FLIGHT, PLANNING, for_people

DEFAULT = Note("limit_assumed", limit="track_error_m", value=3.0)
CLIMB = Note("climb_out", heading_deg=91.0, far_m=492.0, up_m=132.0)
BOUND = Note("bound_ignores_turns")
OTHER = Note("no_ceiling")


def test_what_changes_the_flight_comes_first_and_the_planning_last() -> None:
    rows = for_people([("", DEFAULT.of(vehicle="w1")), ("w1", BOUND), ("w1", OTHER), ("w1", CLIMB), ("w1", OTHER)])
    assert [note.code for _, note in rows] == ["climb_out", "no_ceiling", "bound_ignores_turns", "defaults_taken"]
    assert {name for name, _ in rows} == {"w1"}


def test_defaults_of_a_vehicle_share_a_line() -> None:
    given = [DEFAULT, Note("plane_climb_assumed", climb_deg=15.0), Note("one_speed", slow_m_s=20.0, fast_m_s=20.0)]
    [(name, note)] = for_people([("", each.of(vehicle="w1")) for each in given])
    assert name == "w1"
    assert str(note) == "not given, so by default: track_error_m 3, max_climb_deg 15, speed always 20 m/s"


def test_every_code_that_has_a_rank_is_in_the_catalogue_once() -> None:
    codes = [*FLIGHT, *PLANNING]
    assert set(codes) <= set(TEXTS)
    assert len(codes) == len(set(codes))


def test_a_note_on_a_vehicle_reads_well_behind_its_name() -> None:
    [(name, note)] = for_people([("", Note("speed_kept_in_wind", vehicle="w1", speed_m_s=7.5))])
    assert name == "w1"
    assert str(note) == "it flies at 7.50 m/s at most, which it keeps over ground in every declared wind"
