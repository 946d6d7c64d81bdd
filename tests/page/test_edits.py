"""The parts of an edited mission: the steps of undo, keys that the page may change, places, zones, the file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.mission_file.kept import KeptWorld
from gcsplan.mission_file.load import zones_by_entry
from gcsplan.mission_file.request import Content
from gcsplan.page.form import cure_changes, require_changes, short_form
from gcsplan.page.history import MOST_STEPS, EditHistory
from gcsplan.page.places import place_of, read_text, vehicles_of, with_heights
from gcsplan.page.refused import PageError
from gcsplan.page.store import MissionStore
from gcsplan.page.zone_features import DrawnZones
from gcsplan.units import AVIATION, METRIC
from gcsplan.world.geodesy.frame import Frame


def test_steps_are_taken_back_in_order_and_bounded() -> None:
    steps = EditHistory()
    for k in range(MOST_STEPS + 50):
        steps.step({"k": k})
    now: dict[str, Any] | None = {"k": -1}
    seen = 0
    while now is not None and steps.can_undo:
        now = steps.undo(now)
        seen += 1
    assert (seen, now) == (MOST_STEPS, {"k": 50})
    assert steps.redo({"k": 50}) == {"k": 51}
    steps.step({"k": 0})
    assert not steps.can_redo


@pytest.mark.parametrize(
    "place",
    ["vehicles[0].goal", "vehicles[12].via", "vehicles[1].max_agl_m", "vehicles[1].limits.max_agl_ft", "no_fly[3]",
     "limits.max_agl_ft", "no_fly[3].radius_m", "keep_in[0].ceiling_amsl_m", "planner.objective",
     "terrain.obstacle_height_m", "name", "planner.name", "at", "frame.origin", "wind.up_to_kt", "no_fly[0].on_bad",
     "vehicles[0].energy.battery_wh", "vehicles[0].energy", "wind"],
)  # fmt: skip
def test_the_page_changes_places_zones_and_the_form(place: str) -> None:
    assert require_changes({place: None}) == {place: None}


@pytest.mark.parametrize(
    "place",
    ["terrain.dem", "terrain.canopy", "terrain.geoid_grid", "wind.forecast", "no_fly[0].file", "vehicles[0].link",
     "vehicles[0]", "", "no_fly", "vehicles[0].name.x", "limits", "vehicles.uav1.goal", "vehicles[0].energy", "version",
     "terrain", "planner.parameters.x", "vehicles", "arrival"],
)  # fmt: skip
def test_the_page_changes_nothing_else(place: str) -> None:
    with pytest.raises(PageError):
        require_changes({place: 1})


@pytest.mark.parametrize("value", ["north \ud83d", {"center": [46.5, 8.5], "radius_m": 50, "name": "\udc00"}])
def test_half_of_a_character_is_refused_at_its_key(value: object) -> None:
    with pytest.raises(PageError, match=r"has '\\ud(83d|c00)', half of a character") as refused:
        require_changes({"no_fly[3].name" if isinstance(value, str) else "no_fly[3]": value})
    assert refused.value.problems[0].where.startswith("no_fly[3]")


def test_a_cure_is_set_where_the_mission_has_the_limit() -> None:
    document = {"limits": {"max_agl_ft": 100}, "vehicles": [{"name": "a"}, {"name": "b", "max_amsl_m": 900}]}
    assert cure_changes(document, "a", (("max_agl_m", 60.96),)) == {"limits.max_agl_ft": 200.0}
    assert cure_changes(document, "b", (("max_amsl_m", 950.0),)) == {"vehicles[1].max_amsl_m": 950.0}
    assert cure_changes(document, "b", (("max_climb_deg", 9.0),)) == {"limits.max_climb_deg": 9.0}


def test_a_form_has_what_the_reference_says_of_each_key() -> None:
    fields = {field["key"]: field for field in short_form({"limits": {"min_agl_m": 30}}, [])}
    assert fields["limits.min_agl_m"]["value"] == 30
    assert fields["vehicles[0].end"]["choices"] == ["land", "loiter", "rtl", "none"]
    assert all(field["help"] and field["label"] for field in fields.values())


def test_places_are_read_in_every_form() -> None:
    assert read_text("46°30'N 8°30'E") == [46.5, 8.5]
    assert place_of({"lat": 46.5, "lon": 8.5, "agl_m": 50}, None) == [46.5, 8.5]
    assert place_of({"east_m": 0, "north_m": 0}, None) is None
    assert place_of({"east_m": 0, "north_m": 0}, Frame(46.5, 8.5)) == pytest.approx([46.5, 8.5])
    for wrong in (None, [1], "here", {"lat": 1}, [1e9, 2, 3], True):
        assert place_of(wrong, None) is None
    assert vehicles_of({"vehicles": [None, {"name": "a", "start": [1, 2]}]}, None)[0]["start"] == [1, 2]


def test_an_inserted_via_leaves_the_others_as_they_are_written() -> None:
    old = ["46.5 N, 8.5 E", {"lat": 46.6, "lon": 8.6, "agl_m": 70}]
    assert with_heights(old, [[46.5, 8.5], [46.55, 8.55], [46.6, 8.6]]) == [old[0], [46.55, 8.55], old[1]]
    assert with_heights(None, [[1, 2]]) == [[1, 2]]


def test_zones_are_drawn_although_others_are_wrong(tmp_path: Path) -> None:
    (tmp_path / "zones.geojson").write_text(json.dumps({
        "type": "Feature", "properties": {"name": "wood"},
        "geometry": {"type": "Polygon", "coordinates": [[[8.5, 46.5], [8.6, 46.5], [8.6, 46.6], [8.5, 46.5]]]},
    }))  # fmt: skip
    document: dict[str, Any] = {
        "version": 1,
        "no_fly": [
            {"name": "a", "center": [46.5, 8.5], "radius_m": 100, "ceiling_agl_m": 120},
            {"name": "wrong", "center": [46.5, 8.5]},
            {"file": "zones.geojson"},
            {"name": "line", "line": [[46.5, 8.5], [46.6, 8.5]], "buffer_m": 20},
        ],
        "keep_in": [{"name": "all", "polygon": [[46, 8], [47, 8], [47, 9]]}],
    }
    entries = zones_by_entry(Content(tmp_path / "m.yaml", "m.yaml", document, None), KeptWorld())
    features = DrawnZones().geojson(document, entries, None, AVIATION)["features"]
    about = {f["properties"]["name"]: f["properties"] for f in features}
    assert set(about) == {"a", "wood", "line", "all"}
    assert (about["a"]["key"], about["a"]["editable"], about["a"]["ceiling"]) == (
        "no_fly[0]",
        True,
        {"ceiling_agl_m": 120},
    )
    assert " ft AGL" in about["a"]["levels"]
    assert (about["wood"]["key"], about["wood"]["shape"], about["wood"]["editable"]) == ("no_fly[2]", "file", False)
    assert (about["all"]["kind"], about["all"]["editable"]) == ("keep_in", True)
    assert about["line"]["editable"] is False
    assert DrawnZones().geojson({}, {}, None, METRIC)["features"] == []


def test_a_zone_over_the_antimeridian_is_cut_there_for_the_map(tmp_path: Path) -> None:
    document = {"no_fly": [{"name": "atoll", "center": [-17.0, 179.999], "radius_m": 900}]}
    entries = zones_by_entry(Content(tmp_path / "m.yaml", "m.yaml", document, None), KeptWorld())
    [feature] = DrawnZones().geojson(document, entries, None, METRIC)["features"]
    assert feature["geometry"]["type"] == "MultiPolygon"
    spans = [np.ptp([lon for lon, _ in outline]) for [outline] in feature["geometry"]["coordinates"]]
    assert len(spans) == 2
    assert max(spans) < 0.02


def test_kept_edits_that_are_no_mission_are_left_alone(tmp_path: Path) -> None:
    store = MissionStore(tmp_path, None, None)
    for text in ("", "[]", "{}", '{"mission": 3}', '{"of_sha256": "", "mission": {"a": 1e999}}', "[" * 100_000):
        store.edits.write_text(text)
        found = store.kept()
        assert found is None or found == {"a": float("inf")}
        assert store.edits.read_text() == text
