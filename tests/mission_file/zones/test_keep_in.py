"""Keep-in areas of mission files, and of files that they name: what is read, refused, planned and named."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan import load_mission, plan
from gcsplan.check.judge import judge
from gcsplan.errors import InputError, NoMission
from gcsplan.export.geojson import write_geojson
from gcsplan.export.kml import write_kml
from gcsplan.mission_file.request import MissionFile
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import zones_sha256
from gcsplan.world.geometry.zones import keep_in_of, no_fly_of
from tests.campaigns.keep_in import in_part

BEND = [[46.0, 14.0], [46.0, 14.02], [46.003, 14.02], [46.003, 14.006], [46.02, 14.006], [46.02, 14.0]]
SQUARE = [[46.0, 14.0], [46.0, 14.02], [46.02, 14.02], [46.02, 14.0]]


def mission(keep_in: object, **more: Any) -> dict[str, Any]:
    """A mission over flat ground from one end of `BEND` to the other, in the areas of ``keep_in``."""
    vehicle = {"name": "a", "sysid": 1, "autopilot": "arducopter", "start": [46.0015, 14.018], "goal": [46.018, 14.002]}
    limits = {"min_agl_m": 30, "horizontal_clearance_m": 10, "track_error_m": 3, "altitude_error_m": 2}
    return {
        "version": 1, "terrain": {"flat_m": 100}, "limits": limits | more.pop("limits", {}), "keep_in": keep_in,
        "vehicles": [vehicle | more.pop("vehicle", {})], **more,
    }  # fmt: skip


def refusal(document: dict[str, Any]) -> list[str]:
    with pytest.raises(InputError) as found:
        load_mission(document)
    return [f"{p.where}: {p.message}" for p in found.value.problems]


def ring(corners: list[list[float]]) -> list[list[float]]:
    """GeoJSON's positions, closed, of latitudes and longitudes."""
    return [[lon, lat] for lat, lon in [*corners, corners[0]]]


def features(*polygons: tuple[str, list[list[list[float]]]]) -> str:
    """GeoJSON of polygons, each a name and its rings."""
    made = [
        {"type": "Feature", "properties": {"name": name}, "geometry": {"type": "Polygon", "coordinates": rings}}
        for name, rings in polygons
    ]
    return json.dumps({"type": "FeatureCollection", "features": made})


def areas(source: MissionFile) -> list[str]:
    return [area.name for area in keep_in_of(source.zones)]


@pytest.mark.nightly
def test_a_plan_stays_inside_with_its_errors_and_clearance() -> None:
    made = plan(load_mission(mission([{"name": "bend", "polygon": BEND}])))
    (vehicle,) = made.vehicles
    (part,) = keep_in_of(made.world.airspace.zones)[0].parts
    assert vehicle.verdict.safe or not vehicle.verdict.findings
    turn = np.linspace(0.0, 2.0 * np.pi, 33)
    off = 12.99 * np.column_stack([np.cos(turn), np.sin(turn)])
    for leg in vehicle.verdict.legs:
        a, b = (made.world.frame.to_plane(*end[:2]) for end in (leg.start, leg.end))
        line = a + np.linspace(0.0, 1.0, 200)[:, None] * (b - a)
        assert in_part(part, (line[:, None] + off).reshape(-1, 2)).all()
    assert vehicle.solution.lower_bound > 2600.0  # the straight line has 2.2 km


@pytest.mark.nightly
def test_a_finding_names_the_area_that_a_mission_leaves_once() -> None:
    free = plan(load_mission(mission(None)))
    kept = plan(load_mission(mission([{"name": "bend", "polygon": BEND}])))
    verdict = judge(free.vehicles[0].mission, free.vehicles[0].request.vehicle, kept.world)
    (finding,) = [f for f in verdict.findings if f.kind == "zone"]
    assert finding.zone == "bend"
    assert finding.note.code == "outside_keep_in"
    assert "leaves keep-in area “bend”" in finding.message
    # The farthest place lies on a line from corner to corner; it may be moved by that to the nearest edge.
    assert 400.0 < finding.by < 800.0


@pytest.mark.nightly
def test_two_areas_that_share_an_edge_are_flown_through() -> None:
    south, north = [*BEND[:3], [46.003, 14.0]], [[46.003, 14.0], BEND[3], BEND[4], BEND[5]]
    both = [{"name": "south", "polygon": south}, {"name": "north", "polygon": north}]
    one = plan(load_mission(mission([{"name": "bend", "polygon": BEND}])))
    two = plan(load_mission(mission(both)))
    assert two.vehicles[0].cost == pytest.approx(one.vehicles[0].cost, rel=1e-3)
    with pytest.raises(NoMission, match=r"which is proved; .*without the keep-in areas 'south' and 'north' there is"):
        plan(load_mission(mission([both[0], both[1] | {"polygon": [[46.0035, 14.0], [46.0035, 14.006], *BEND[4:]]}])))


def test_a_start_outside_is_refused_with_the_nearest_area_and_its_distance() -> None:
    far = {"name": "far", "polygon": [[46.1, 14.0], [46.1, 14.02], [46.12, 14.02]]}
    (said,) = refusal(mission([{"name": "bend", "polygon": BEND}, far], vehicle={"start": [46.0045, 14.018]}))
    assert said == (
        "mission: vehicles[0].start: the start lies 166.7 m outside of the keep-in area 'bend' and outside of all "
        "others: move it inside, or draw the area larger"
    )
    with pytest.raises(
        NoMission, match=r"the start lies outside of keep-in area 'bend' or within 13\.\d m of the edge"
    ):
        plan(load_mission(mission([{"name": "bend", "polygon": BEND}], vehicle={"start": [46.00294, 14.018]})))


@pytest.mark.nightly
def test_a_ceiling_keeps_the_flight_below_it_with_the_vertical_clearance() -> None:
    kept = [{"name": "bend", "polygon": BEND, "ceiling_agl_m": 50}]
    made = plan(load_mission(mission(kept, limits={"vertical_clearance_m": 15.0})))
    assert not made.vehicles[0].verdict.findings
    with pytest.raises(NoMission, match="below the ceiling, or above the floor, of keep-in area 'bend'"):
        plan(load_mission(mission(kept, limits={"vertical_clearance_m": 17.0})))
    (start, goal) = refusal(mission([{"name": "bend", "polygon": BEND, "floor_agl_m": 20}]))
    assert "the start lies below its floor or above its ceiling" in start
    assert "the goal lies" in goal


def test_a_floor_that_is_nowhere_above_the_ground_is_none() -> None:
    source = load_mission(mission([{"polygon": BEND, "floor_amsl_m": 100}]))
    assert [(z.floor, z.ceiling) for z in source.zones] == [(None, None)] * 2
    assert areas(source) == ["keep_in[0]"]


@pytest.mark.parametrize(
    ("keep_in", "said"),
    [
        ([], "keep_in: must be a list of areas, given a list of 0; leave the key out"),
        ({"name": "a"}, "keep_in: must be a list of areas, given a mapping; begin each area with a dash"),
        ([{"line": BEND, "buffer_m": 50.0}], "is a circle or a polygon, not a line"),
        ([{"polygon": BEND, "kinds": ["A"]}], "keep_in[0].kinds: belongs to a file of an authority"),
        ([{"polygon": BEND, "name": "a"}, {"polygon": BEND, "name": "a"}], "is the name of keep_in[0] already"),
        ([{"polygon": BEND, "foo": 1}], "keep_in[0].foo: unknown key"),
        ([{"file": "none.geojson"}], "keep_in[0].file: none.geojson is not there"),
        ([{"polygon": BEND, "floor_agl_m": 90, "ceiling_agl_m": 80}], "the floor must be below the ceiling"),
    ],
)  # fmt: skip
def test_wrong_keys_are_refused_with_their_place_and_a_cure(keep_in: object, said: str) -> None:
    assert any(said in one for one in refusal(mission(keep_in)))


def test_holes_of_a_file_are_outside(tmp_path: Path) -> None:
    hole = [[46.008, 14.001], [46.008, 14.005], [46.012, 14.005], [46.012, 14.001]]
    (tmp_path / "a.geojson").write_text(features(("yard", [ring(SQUARE), ring(hole)])), encoding="utf-8")
    kept = [{"file": str(tmp_path / "a.geojson")}]
    assert any("outside of the keep-in area 'yard'" in one for one in
               refusal(mission(kept, vehicle={"goal": [46.01, 14.003]})))  # fmt: skip
    source = load_mission(mission(kept))
    assert not [note for note in source.notes if note.code == "holes_are_no_fly"]
    (yard,) = keep_in_of(source.zones)
    assert [len(part.holes) for part in yard.parts] == [1]


def test_a_world_with_a_hole_keeps_flights_in_the_hole(tmp_path: Path) -> None:
    world = [[-180.0, -85.0], [180.0, -85.0], [180.0, 85.0], [-180.0, 85.0], [-180.0, -85.0]]
    hut = [[46.01, 14.01], [46.01, 14.011], [46.011, 14.011]]
    file = tmp_path / "world.geojson"
    file.write_text(features(("outside", [world, ring(SQUARE)]), ("hut", [ring(hut)])), encoding="utf-8")
    source = load_mission(mission(None, no_fly=[{"file": str(file)}]))
    assert areas(source) == ["outside"]
    assert [zone.name for zone in no_fly_of(source.zones)] == ["hut"]
    assert any("name it under no_fly, where both count" in one for one in refusal(mission([{"file": str(file)}])))
    both = refusal(mission([{"name": "bend", "polygon": BEND}], no_fly=[{"file": str(file)}]))
    assert any("keep-in area 'bend' stands beside 'outside' of another file or key" in one for one in both)
    file.write_text(features(("outside", [world, ring(SQUARE)])), encoding="utf-8")
    assert areas(load_mission(mission([{"file": str(file)}]))) == ["outside"]
    file.write_text(features(("a", [world, ring(SQUARE)]), ("b", [world, ring(BEND)])), encoding="utf-8")
    for two in (mission([{"file": str(file)}]), mission(None, no_fly=[{"file": str(file)}])):
        assert any("gcsplan takes one such statement" in one for one in refusal(two))


@pytest.mark.parametrize(
    ("properties", "said"),
    [
        ({"upper": "FL 65"}, "its ceiling is a flight level"),
        ({"max_height": 100}, "looks like a floor or a ceiling and is not read"),
        ({"validUntil": "2026-12-01"}, "it has times that are not read"),
    ],
)
def test_a_file_that_may_make_an_area_smaller_is_refused(
    tmp_path: Path, properties: dict[str, object], said: str
) -> None:
    made = json.loads(features(("yard", [ring(SQUARE)])))
    made["features"][0]["properties"] |= properties
    (tmp_path / "a.geojson").write_text(json.dumps(made), encoding="utf-8")
    assert any(said in one for one in refusal(mission([{"file": str(tmp_path / "a.geojson")}])))


def test_files_of_authorities_and_files_without_an_area_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("AC R\nAN x\nAL GND\nAH UNL\nV X=46:00:00 N 014:00:00 E\nDC 5\n", encoding="utf-8")
    assert any("is a file of an authority, whose zones are no-fly" in one for one in
               refusal(mission([{"file": str(tmp_path / "a.txt")}])))  # fmt: skip
    track = {"type": "LineString", "coordinates": [[14.0, 46.0], [14.1, 46.1]]}
    made = {"type": "FeatureCollection", "generator": "gcsplan",
            "features": [{"type": "Feature", "properties": {"kind": "track"}, "geometry": track}]}  # fmt: skip
    (tmp_path / "t.geojson").write_text(json.dumps(made), encoding="utf-8")
    assert any("has no area" in one for one in refusal(mission([{"file": str(tmp_path / "t.geojson")}])))


def test_inclusion_areas_of_a_plan_are_joined_and_exclusions_are_zones(tmp_path: Path) -> None:
    circle = {"circle": {"center": [46.01, 14.01], "radius": 300}, "inclusion": True, "version": 1}
    fence: dict[str, Any] = {
        "version": 2, "circles": [circle], "polygons": [{"polygon": BEND, "inclusion": True, "version": 1}],
    }  # fmt: skip
    file = tmp_path / "field.plan"
    file.write_text(json.dumps({"fileType": "Plan", "geoFence": fence}), encoding="utf-8")
    source = load_mission(mission([{"file": str(file)}]))
    assert areas(source) == ["field[0]", "field[1]"]
    assert [note.code for note in source.notes if note.code == "fence_areas_joined"]
    circle["inclusion"] = False
    file.write_text(json.dumps({"geoFence": fence}), encoding="utf-8")
    assert any("name it under no_fly" in one for one in refusal(mission([{"file": str(file)}])))
    source = load_mission(mission(None, no_fly=[{"file": str(file)}]))
    assert areas(source) == ["field[1]"]
    assert [zone.name for zone in no_fly_of(source.zones)] == ["field[0]"]


@pytest.mark.parametrize("ending", ["geojson", "kml"])
def test_exported_areas_are_read_as_areas_again(tmp_path: Path, ending: str) -> None:
    kept = [{"name": "yard", "polygon": SQUARE, "ceiling_agl_m": 90.0}, {"name": "bend", "polygon": BEND}]
    source = load_mission(mission(kept, no_fly=[{"name": "hut", "center": [46.01, 14.01], "radius_m": 20}]))
    write = {"geojson": write_geojson, "kml": write_kml}[ending]
    file = tmp_path / f"out.{ending}"
    file.write_text(write("out", [], source.zones, source.frame), encoding="utf-8")
    found = read_zones(file, where="zones")
    assert not found.problems
    assert {draft.name: draft.keep_in for draft in found.zones} == {"hut": False, "yard": True, "bend": True}
    again = load_mission(mission(None, no_fly=[{"file": str(file)}]))
    assert {a.name: str(a.ceiling) for a in keep_in_of(again.zones)} == {"yard": "90 m AGL", "bend": "None"}


def test_areas_and_their_holes_count_in_the_hash_of_the_zones(tmp_path: Path) -> None:
    (tmp_path / "a.geojson").write_text(features(("yard", [ring(SQUARE), ring(BEND[:3])])), encoding="utf-8")
    found = read_zones(tmp_path / "a.geojson", where="keep_in", keep_in=True).zones
    plain = load_mission(mission([{"name": "yard", "polygon": SQUARE}]))
    assert plain.inputs["zones_sha256"] != load_mission(mission(None)).inputs["zones_sha256"]
    assert zones_sha256(found) != plain.inputs["zones_sha256"]


@pytest.mark.nightly
def test_inside_a_kml_edge_is_what_its_line_and_its_great_circle_enclose(tmp_path: Path) -> None:
    """Along 46° N a great circle over 4° of longitude lies 1.2 km north of the straight line."""
    corners = "14,46,0 18,46,0 18,47,0 14,47,0 14,46,0"
    outline = f"<outerBoundaryIs><LinearRing><coordinates>{corners}</coordinates></LinearRing></outerBoundaryIs>"
    file = tmp_path / "a.kml"
    file.write_text(
        f'<kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><Polygon>{outline}</Polygon></Placemark></kml>',
        encoding="utf-8",
    )

    def inside(lat: float) -> bool:
        there = {"start": [lat, 16.0], "goal": [lat, 16.01]}
        try:
            load_mission(mission([{"file": str(file)}], vehicle=there))
        except InputError as why:
            return "outside of the keep-in area" not in why.problems[0].message
        return True

    assert [inside(lat) for lat in (46.005, 46.02, 46.995, 47.005)] == [False, True, True, False]
