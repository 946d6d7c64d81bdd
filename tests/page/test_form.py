"""The forms: a field for each key of the schema, or the reason why only the text of the mission has it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gcsplan.errors import InputError
from gcsplan.mission_file.json_schema import mission_schema
from gcsplan.mission_file.values.units import other_names
from gcsplan.page.form import (
    MOST_ENTRIES,
    SECTIONS,
    YAML_ONLY,
    arranged,
    changes_of,
    keys_of,
    part_of,
    require_own_files,
    section_form,
)
from gcsplan.page.refused import PageError


def parts_below(entry: Any) -> set[str]:
    """The parts of the schema that an entry refers to."""
    if isinstance(entry, dict):
        own = {entry["$ref"].rpartition("/")[2]} if "$ref" in entry else set()
        return own.union(*map(parts_below, entry.values()))
    return set().union(*map(parts_below, entry)) if isinstance(entry, list) else set()


def test_every_key_of_the_schema_has_a_field_or_a_reason_why_not() -> None:
    whole = mission_schema()
    parts = {"": whole, **whole["$defs"]}
    typed: set[str] = set()  # parts that a field takes as one value, typed as in the file
    missing = []
    for part in set(SECTIONS.values()):
        own = parts[part]["properties"]
        fields = keys_of(part)
        sections = {place.rpartition(".")[2].removesuffix("[]") for place in SECTIONS if place}
        for key in own.keys() - other_names(own).keys():
            if key in fields:
                typed |= parts_below(own[key])
            elif key not in sections:
                missing.append((part, key))
        typed |= {inner for one in typed for inner in parts_below(parts[one])}
    assert missing == []
    assert set(parts) - set(SECTIONS.values()) <= typed
    for part, key in YAML_ONLY:
        assert key in keys_of(part), "a reason for a key that is not there"


@pytest.mark.parametrize("section", [s.replace("[]", "[0]") for s in SECTIONS])
def test_a_field_says_unit_default_and_meaning_and_a_fixed_one_the_reason(section: str) -> None:
    fields = section_form(section, {}, [])["fields"]
    assert len({f["key"] for f in fields}) == len(fields) == len(keys_of(str(part_of(section))))
    for field in fields:
        assert field["help"]
        assert (field["kind"] == "fixed") == bool(field["reason"])
        assert field["kind"] in ("number", "text", "choice", "boolean", "yaml", "fixed")


def test_values_stand_in_their_own_units_and_lists_as_in_the_file() -> None:
    document = {"vehicles": [{"speed_kt": [5, 20], "climb_m_s": 3, "energy": {"battery_wh": 90}}]}
    fields = {f["key"]: f for f in section_form("vehicles[0]", document, [])["fields"]}
    assert (fields["vehicles[0].speed_kt"]["value"], fields["vehicles[0].speed_kt"]["unit"]) == ("[5, 20]", "kt")
    assert (fields["vehicles[0].climb_m_s"]["value"], fields["vehicles[0].climb_m_s"]["quantity"]) == (3, "climb_rate")
    energy = {f["key"]: f["value"] for f in section_form("vehicles[0].energy", document, [])["fields"]}
    assert energy["vehicles[0].energy.battery_wh"] == 90


@pytest.mark.parametrize("section", [None, 3, "vehicles", "vehicles[0].x", "__class__", "no_fly", "vehicles[0].via[0]"])
def test_a_section_without_a_form_is_refused(section: object) -> None:
    with pytest.raises(PageError):
        section_form(section, {}, [])


def test_a_value_is_typed_as_in_the_file_and_a_mistake_is_said_at_its_key() -> None:
    typed = {"vehicles[0].speed_m_s": "[3, 12.5]", "at": "2026-12-01T10:00Z"}
    assert changes_of({"changes": {"name": "x"}, "yaml": typed}) == {
        "name": "x", "vehicles[0].speed_m_s": [3, 12.5], "at": "2026-12-01T10:00Z"
    }  # fmt: skip
    with pytest.raises(PageError) as why:
        changes_of({"changes": {}, "yaml": {"wind.levels": "[{agl_m: 1"}})
    assert why.value.where == "wind.levels"


def test_a_text_names_no_file_outside_of_the_folder_but_those_it_had(tmp_path: Path) -> None:
    before = {"terrain": {"dem": "/data/dem.tif"}, "no_fly": [{"file": "../shared/zones.kml"}]}
    own = {"terrain": {"dem": ["/data/dem.tif", "sample:jacksboro", "here.tif"]}, "no_fly": [*before["no_fly"]]}
    require_own_files(own, before, tmp_path, "")
    wrong = {"terrain": {"dem": "/data/other.tif"}, "keep_in": [{"file": "a/../../b.kml"}], "wind": {"forecast": "w"}}
    text = "terrain: {dem: /data/other.tif}\nkeep_in:\n  - {file: a/../../b.kml}\nwind: {forecast: w}\n"
    with pytest.raises(InputError) as why:
        require_own_files(wrong, before, tmp_path, text)
    assert [(p.where, p.in_line) for p in why.value.problems] == [("terrain.dem", 1), ("keep_in[0].file", 3)]


def test_a_list_has_a_row_for_each_entry_and_says_what_one_may_be() -> None:
    document: dict[str, Any] = {"wind": {"levels": [{"agl_m": 10}]}, "vehicles": [{"via": [[1, 2], "46 N, 8 E"]}]}
    fields = {f["key"]: f["list"] for s in ("wind", "vehicles[0]", "no_fly[0]")
              for f in section_form(s, document, [])["fields"]}  # fmt: skip
    assert fields["wind.levels"]["entries"] == ["{agl_m: 10}"]
    assert fields["wind.levels"]["like"].startswith("{")
    assert fields["vehicles[0].via"]["entries"] == ["[1, 2]", '"46 N, 8 E"']
    assert fields["no_fly[0].ignore"]["choices"] == ["points", "lines", "empty"]
    assert {key for key in fields if key.startswith("no_fly") and fields[key]} == {
        f"no_fly[0].{key}" for key in ("polygon", "line", "ignore", "kinds", "authorised")
    }
    assert fields["wind.speed_m_s"] is fields["vehicles[0].start"] is None  # of a fixed length
    document["vehicles"][0]["via"] = [[1, 2]] * (MOST_ENTRIES + 1)
    long = {f["key"]: f["list"] for f in section_form("vehicles[0]", document, [])["fields"]}
    assert long["vehicles[0].via"] is None


def test_an_entry_of_a_section_is_moved_to_the_place_of_another() -> None:
    document = {"no_fly": [{"name": "a"}, {"file": "b.kml"}, {"name": "c"}]}
    move = {"list": "no_fly", "from": 2, "to": 0}
    assert arranged(document, move) == {"no_fly": [{"name": "c"}, {"name": "a"}, {"file": "b.kml"}]}
    for wrong in (
        {"list": "terrain"},
        {"list": "keep_in"},
        {"list": []},
        {"from": 3},
        {"to": -1},
        {"to": True},
        {"to": "0"},
    ):
        with pytest.raises(PageError):
            arranged(document, move | wrong)
