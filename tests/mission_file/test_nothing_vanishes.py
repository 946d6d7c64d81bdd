"""What a reader does not use is named with its place, or refused: nothing of a file vanishes without a word."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gcsplan.errors import InputError
from gcsplan.mavlink.files.plan_file import parse_plan
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import zone_notes
from gcsplan.notes.note import Note
from tests.support import zone_files

SQUARE = [(14.48, 46.03), (14.52, 46.03), (14.52, 46.06), (14.48, 46.06)]
POLYGON = {"type": "Polygon", "coordinates": [[list(p) for p in [*SQUARE, SQUARE[0]]]]}
ZONE = {"type": "Feature", "properties": {"name": "z"}, "geometry": POLYGON}
LINE = {"type": "LineString", "coordinates": [[14.48, 46.03, 300.0], [14.52, 46.06, 300.0]]}
SAIL = "\n".join(f"DP {lat} N {lon} E" for lon, lat in SQUARE)


def told(file: Path, text: Any) -> str:
    """Everything that is said of a zone file: problems, notes and remarks."""
    file.write_text(text if isinstance(text, str) else json.dumps(text), encoding="utf-8")
    try:
        found = read_zones(file, where="zones")
    except InputError as why:
        return "\n".join(map(str, why.problems))
    faults = [fault for draft in found.zones for fault in draft.faults]
    notes = [*found.notes, *zone_notes([(d, None) for d in found.zones])]
    return "\n".join(map(str, [*found.problems, *notes, *faults]))


def feature(geometry: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": geometry}


@pytest.mark.parametrize(
    "one",
    [feature(LINE, kind="track", name="pipeline"),
     feature({"type": "Point", "coordinates": [14.5, 46.04]}, kind="waypoint", name="mast")],
)  # fmt: skip
def test_somebodys_track_or_waypoint_is_a_shape_without_a_size(tmp_path: Path, one: dict[str, Any]) -> None:
    said = told(tmp_path / "z.geojson", {"type": "FeatureCollection", "features": [ZONE, one]})
    assert "features[1]: a " in said
    assert "to be a zone" in said


@pytest.mark.parametrize("mark", [{"generator": "gcsplan"}, {"heights": "as every output had before the mark"}])
def test_own_tracks_are_known_by_the_mark_of_the_collection(tmp_path: Path, mark: dict[str, str]) -> None:
    """Outputs from before the mark had ``heights``, and their tracks and way points the reference of theirs."""
    track = feature(LINE, kind="track", vehicle="uav1", third_coordinate="amsl_m")
    document = {"type": "FeatureCollection", **mark, "features": [ZONE, track]}
    assert told(tmp_path / "z.geojson", document) == "z.geojson: not used: 1 track or way point of a mission"


def test_a_second_openair_zone_without_its_beginning_is_no_part_of_the_first(tmp_path: Path) -> None:
    """The outlines of both would be joined to one that need not hold either of them."""
    said = told(tmp_path / "z.openair", f"AC P\nAN one\n{SAIL}\nAN two\n{SAIL}")
    assert (
        "line 7: zone 'one': 'AN two': a second name behind the zone's outline: does a line AC before it lack?" in said
    )
    assert told(tmp_path / "z.openair", f"AC P\nAN one\nAN two\n{SAIL}") == ""


def test_times_of_other_programs_are_named_and_limit_nothing(tmp_path: Path) -> None:
    one = feature(POLYGON, name="z", validFrom="2026-11-24T10:00Z", schedule="MON-FRI", created_at="2020", endpoint="x")
    said = told(tmp_path / "z.geojson", one)
    assert said == (
        "z.geojson: these attributes of times are not read: the zones count as always: z "
        "(validFrom '2026-11-24T10:00Z', schedule 'MON-FRI')"
    )
    corners = "<LinearRing><coordinates>14.4,46 14.5,46 14.5,46.1</coordinates></LinearRing>"
    ring = f"<outerBoundaryIs>{corners}</outerBoundaryIs>"
    span = "<TimeSpan><begin>2026-11-24</begin><end>2026-11-25</end></TimeSpan>"
    kml = f"<kml><Placemark><name>z</name>{span}<Polygon>{ring}</Polygon></Placemark></kml>"
    assert "count as always: z (TimeSpan " in told(tmp_path / "z.kml", kml)


def test_kml_beside_placemarks_is_refused(tmp_path: Path) -> None:
    zone = zone_files.kml(tmp_path, [[SQUARE]]).read_text(encoding="utf-8")
    for other, words in (
        ("<Polygon><outerBoundaryIs/></Polygon>", "1 Polygon outside of a Placemark"),
        ("<Folder><Track/><Track/></Folder>", "2 Tracks outside of a Placemark"),
        ("<NetworkLinkControl/>", "a NetworkLinkControl cannot be read as a zone"),
        ("<ScreenOverlay/><PhotoOverlay><Point/></PhotoOverlay>", "not used: 1 ScreenOverlay, 1 PhotoOverlay"),
        ("<GroundOverlay/>", "a GroundOverlay cannot be read as a zone"),
    ):
        assert words in told(tmp_path / "z.kml", zone.replace("</kml>", f"{other}</kml>"))


def test_an_openair_circle_needs_its_own_centre(tmp_path: Path) -> None:
    first = "AC P\nAN one\nV X=46:00:00 N 014:00:00 E\nDC 1\n"
    said = told(tmp_path / "z.openair", first + "AC P\nAN two\nDC 2\n")
    assert "line 7: zone 'two': 'DC 2': has no centre of its own" in said
    arc = first + "AC P\nAN two\nDA 2,0,180\nDP 46:00:00 N 013:57:30 E\n"
    assert "are drawn around that of the zone before: two (line 7: DA 2,0,180)" in told(tmp_path / "z.openair", arc)
    assert told(tmp_path / "z.openair", "V X=46:00:00 N 014:00:00 E\nAC P\nAN one\nDC 1") == ""


def test_an_openair_line_has_one_place(tmp_path: Path) -> None:
    text = f"AC P\nAN z\n{SAIL}"
    second = text.replace("E\n", "E 46:05:00 N 014:30:00 E\n", 1)
    assert "line 3: zone 'z': 'DP 46.03 N 14.48 E 46:05:00 N 014:30:00 E': it has more than 1 place" in told(
        tmp_path / "z.openair", second
    )
    comment = text.replace("E\n", "E the mill\n", 1)
    assert told(tmp_path / "z.openair", comment) == "z.openair: text behind a place is not read: z (line 3: the mill)"


def test_openair_terrain_is_named(tmp_path: Path) -> None:
    said = told(tmp_path / "z.openair", f"AC P\nAN z\n{SAIL}\nTO ridge\nDP 46:05:00 N 014:30:00 E\n")
    assert said == "z.openair: not used, because they draw terrain: line 7 (TO ridge)"


def test_members_beside_those_of_the_standards_are_named(tmp_path: Path) -> None:
    whole = json.loads(zone_files.ed269(tmp_path, [[SQUARE]]).read_text(encoding="utf-8"))
    zone = whole["features"][0]
    assert told(tmp_path / "z.json", whole) == ""
    zone["validUntil"] = "2026-11-24"
    zone["geometry"][0]["minimumAltitude"] = 100
    zone["geometry"][0]["horizontalProjection"]["radius"] = 500
    said = told(tmp_path / "z.json", whole)
    for word in ("validUntil '2026-11-24'", "minimumAltitude 100", "radius 500"):
        assert word in said
    both = told(tmp_path / "z.json", whole | {"UASZoneList": [zone]})
    assert "UASZoneList: the file has a list of features, too" in both
    whole = json.loads(zone_files.ed318(tmp_path, [[SQUARE]]).read_text(encoding="utf-8"))
    assert told(tmp_path / "z.json", whole) == ""
    whole["features"][0]["geometry"]["extent"] = {"subType": "Circle", "radius": 900}
    assert "extent an object" in told(tmp_path / "z.json", whole)


ITEM = {"autoContinue": True, "command": 22, "doJumpId": 1, "frame": 3, "params": [0, 0, 0, None, 46.03, 14.48, 50],
        "type": "SimpleItem"}  # fmt: skip
PLAN: dict[str, Any] = {
    "fileType": "Plan", "version": 1, "groundStation": "QGroundControl", "rallyPoints": {"points": [], "version": 2},
    "geoFence": {"circles": [], "polygons": [], "version": 2},
    "mission": {"items": [ITEM], "plannedHomePosition": [46.03, 14.48, 300], "firmwareType": 3, "vehicleType": 2,
                "version": 2},
}  # fmt: skip


@pytest.mark.parametrize(
    ("fence", "words"),
    [
        ({"polygon": [[46.0, 14.0], [46.1, 14.0], [46.1, 14.1]], "version": 1}, "geoFence of version 1 (polygon)"),
        ({"circles": [], "polygons": [], "areas": [1], "version": 2}, "geoFence.areas"),
        ({"circle": {"center": [46.0, 14.0], "radius": 50}, "version": 2}, "geoFence.circle"),
        ({"circles": [], "polygons": [{"inclusion": True, "polygon": []}], "version": 3}, "geoFence of version 3"),
        ([1], "geoFence is no object"),
        ({"polygon": [], "version": 1}, ""),
        ({"circles": [], "polygons": [], "version": 2}, ""),
        (None, ""),
    ],
)
def test_a_plans_fence_that_is_not_read_is_told(fence: Any, words: str) -> None:
    read = parse_plan(json.dumps(PLAN | {"geoFence": fence}), autopilot=None, where="a.plan")
    assert read.fence == ()
    assert str(read.unread_fence).startswith(f"the file's {words}") if words else read.unread_fence is None


@pytest.mark.parametrize(
    ("firmware", "kind", "named"),
    [(12, 1, "fixed wing"), (12, 20, "VTOL"), (12, 10, "rover"), (12, "wing", "wing"), (12, 2, ""), (12, None, ""),
     (3, 1, ""),
     (3, 20, "")],
)  # fmt: skip
def test_a_plan_for_a_kind_of_vehicle_that_is_flown_otherwise_is_not_judged(
    firmware: int, kind: Any, named: str
) -> None:
    mission = PLAN["mission"] | {"firmwareType": firmware, "vehicleType": kind}
    read = parse_plan(json.dumps(PLAN | {"mission": mission}), autopilot=None, where="a.plan")
    assert [note.code for note in read.not_judged] == ["plan_for_other_kind"] * bool(named)
    assert all(named in str(note) for note in read.not_judged)


CORNERS = [[46.0, 14.0], [46.1, 14.0], [46.1, 14.1]]


@pytest.mark.parametrize(
    ("fence", "words"),
    [
        ({"polygons": [{"inclusion": False, "polygon": CORNERS, "version": 1}]}, ""),
        (
            {"polygons": [{"inclusion": False, "polygon": CORNERS, "maxAltitude": 50}]},
            "geoFence.polygons[0].maxAltitude",
        ),
        ({"polygons": [{"inclusion": False, "polygon": CORNERS, "version": 2}]}, "geoFence.polygons[0] of version 2"),
        (
            {"circles": [{"inclusion": True, "circle": {"center": [46.0, 14.0], "radius": 50}, "floor": 10}]},
            "geoFence.circles[0].floor",
        ),
        (
            {"circles": [{"inclusion": False, "circle": {"center": [46.0, 14.0], "radius": 50, "unit": "NM"}}]},
            "geoFence.circles[0].circle.unit",
        ),
    ],
)
def test_what_a_shape_of_a_plans_fence_has_besides_is_told(fence: Any, words: str) -> None:
    whole = {"circles": [], "polygons": [], "version": 2} | fence
    read = parse_plan(json.dumps(PLAN | {"geoFence": whole}), autopilot=None, where="a.plan")
    assert read.fence
    assert str(read.unread_fence).startswith(f"the file's {words}") if words else read.unread_fence is None


def test_a_plans_other_keys_and_rally_points_are_told() -> None:
    rally = {"points": [[46.0, 14.0, 50]], "version": 1}
    read = parse_plan(json.dumps(PLAN | {"rallyPoints": rally, "corridor": [1]}), autopilot=None, where="a.plan")
    assert read.rally == ()
    assert "the file's rallyPoints of version 1 (points) was not read; open the file in" in str(read.notes[0])
    assert read.notes[1] == Note("plan_keys_unread", keys=("corridor",))
    assert parse_plan(json.dumps(PLAN), autopilot=None, where="a.plan").notes == ()
