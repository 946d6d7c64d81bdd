"""Notes: their sentences for each reader, and that they are values."""

from __future__ import annotations

import json
import pickle

import pytest

from gcsplan.notes.note import Datum, Note, Wording, in_json, sentence
from gcsplan.units import AVIATION, IMPERIAL, METRIC


@pytest.mark.parametrize(
    ("text", "data", "metric", "aviation"),
    [
        ("it is {away_m:distance.0} away", {"away_m": 1234.4}, "it is 1234 m away", "it is 4050 ft away"),
        ("low {low_m:height.1 down}", {"low_m": 29.99}, "low 29.9 m", "low 98.3 ft"),
        ("high {top_m:height.1 up}", {"top_m": 29.91}, "high 30.0 m", "high 98.2 ft"),
        ("{a_m:height.1 bare} to {b_m:height.1}", {"a_m": 1.0, "b_m": 2.0}, "1.0 to 2.0 m", "3.3 to 6.6 ft"),
        ("a limit of {limit_m:height}", {"limit_m": 60.0}, "a limit of 60 m", "a limit of 196.85 ft"),
        ("far: {far_m:reach}", {"far_m": 18520.0}, "far: 18.5 km", "far: 10.0 NM"),
        ("in {unit:height}", {}, "in m", "in ft"),
        ("{left_s:seconds}", {"left_s": 61.0}, "0:01:01", "0:01:01"),
        ("{count} {count:item|items}", {"count": 1}, "1 item", "1 item"),
        ("{count} {count:item|items}", {"count": 2}, "2 items", "2 items"),
        ("{zones:zone|zones} {zones}", {"zones": ("a", "b")}, "zones a, b", "zones a, b"),
        ("{loop:round|hold}", {"loop": True}, "round", "round"),
        ("near:{pairs:lines}", {"pairs": ("a", "b")}, "near:\n  a\n  b", "near:\n  a\n  b"),
        ("{found:rows}", {"found": ("a", "b")}, "a\nb", "a\nb"),
        ("{share:.1f} %", {"share": 3.14}, "3.1 %", "3.1 %"),
        ("because {why}", {"why": Note("battery_lasts_unknown", 3)},
         "because item 3: how long the battery lasts there is not known, for hover_w is 0",
         "because item 3: how long the battery lasts there is not known, for hover_w is 0"),
    ],
)  # fmt: skip
def test_a_sentence_is_made_in_the_units_of_its_reader(
    text: str, data: dict[str, Datum], metric: str, aviation: str
) -> None:
    assert sentence(text, data, Wording(METRIC)) == metric
    assert sentence(text, data, Wording(AVIATION)) == aviation


def test_files_have_si_with_seconds_and_joules() -> None:
    data: dict[str, Datum] = {"left_s": 61.0, "used_j": 7200.0, "away_m": 1500.0}
    assert sentence("{left_s:seconds.1}, {used_j:joules}, {away_m:far.1}", data) == "61.0 s, 7200 J, 1.5 km"


def test_a_key_is_named_as_the_reader_types_it() -> None:
    text = "set {key:max_agl_m} or {key:speed_m_s}"
    assert sentence(text, {}) == "set max_agl_m or speed_m_s"
    assert sentence(text, {}, Wording(options={"max_agl_m": "--max-agl"})) == "set --max-agl or speed_m_s"


def test_an_item_stands_before_its_sentence_unless_the_sentence_names_it() -> None:
    plain, named = Note("battery_lasts_unknown", 5), Note("energy_fitted_elsewhere", 5, fitted=(8.0,), speed_m_s=12.0)
    assert str(plain) == f"item 5: {plain.text(placed=False)}"
    assert str(named) == named.text(placed=False)
    assert "from item 5 on it flies" in str(named)
    assert not str(Note("paper_energy")).startswith("item")


def test_equal_notes_are_one_and_survive_another_process() -> None:
    one, same = (Note("battery_until_reserve", 4, loop=True, left_s=12.5) for _ in range(2))
    other = Note("battery_until_reserve", 5, loop=True, left_s=12.5)
    assert list(dict.fromkeys([one, same, other])) == [one, other]
    assert pickle.loads(pickle.dumps(one)) == one
    assert one != str(one)


def test_programs_get_the_code_the_item_and_the_numbers() -> None:
    made = Note("battery_until_reserve", 4, loop=True, left_s=12.5, others=("a", Note("paper_energy"))).as_dict()
    assert json.loads(json.dumps(made)) == {
        "code": "battery_until_reserve", "item": 4,
        "data": {"loop": True, "left_s": 12.5, "others": ["a", {"code": "paper_energy", "item": None, "data": {}}]},
    }  # fmt: skip


def test_a_code_that_the_catalogue_lacks_is_an_error() -> None:
    with pytest.raises(KeyError, match="no 'battery_full'"):
        Note("battery_full")


def test_a_note_is_told_in_imperial_units_too() -> None:
    made = Note("battery_until_reserve", 4, loop=False, left_s=12.0)
    assert made.in_units(IMPERIAL).startswith("item 4: its hold has no end")


def test_the_way_stands_behind_the_item_or_by_itself_if_it_says_more_than_the_kind() -> None:
    place: dict[str, Datum] = {"lat": 36.6, "lon": -84.3, "amsl_m": 450.0}
    straight = Note("over_unknown_ground", 4, way="cruise", **place)
    jumped = Note("over_unknown_ground", 4, way=Note("after_jump", way="cruise", jump=7), **place)
    said = "over ground that the terrain model does not know at 36.600000, -84.300000, 450.0 m AMSL"
    assert (str(straight), straight.text(placed=False)) == (f"item 4 (cruise): {said}", said)
    assert str(jumped) == f"item 4 (cruise, after the jump at item 7): {said}"
    assert jumped.text(placed=False) == f"(cruise, after the jump at item 7): {said}"


def test_angles_are_rounded_away_from_the_limit_too() -> None:
    assert (
        sentence("{up_deg:angle.1 up}, {down_deg:angle.1 down}", {"up_deg": 4.81, "down_deg": 10.19}) == "4.9 °, 10.1 °"
    )


def test_programs_get_a_list_of_sentences_and_what_they_are_made_of() -> None:
    made = in_json(
        "notes",
        [Note("flown_by_computer", 3, name="PAUSE"), Note("no_ceiling")],
        Wording(options={"max_agl_m": "--max-agl"}),
    )
    assert made == {
        "notes": [
            "item 3: PAUSE: another computer flies from there on",
            "--max-agl is not set: nothing limits the height above ground",
        ],
        "notes_data": [
            {"code": "flown_by_computer", "item": 3, "data": {"name": "PAUSE"}},
            {"code": "no_ceiling", "item": None, "data": {}},
        ],
    }
