"""Files as people have them: read as they mean it, or refused in words that say what to do."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gcsplan.errors import InputError
from gcsplan.mavlink.files.plan_file import parse_plan
from gcsplan.mavlink.files.waypoints_file import parse_waypoints
from gcsplan.mission_file.published.policy import Policy
from gcsplan.mission_file.published.unused import used
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import zone_notes
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot

OPENAIR = "* Großer Platz\r\nAC R\r\nAN Ödland\r\nAL GND\r\nAH 3500FT AMSL\r\n{}\r\n{}\r\n{}\r\n"
PLAIN = ("DP 46:00:00 N 014:30:00 E", "DP 46:05:00 N 014:30:00 E", "DP 46:05:00 N 014:36:30 E")


def zones(path: Path) -> list[tuple[tuple[float, float], ...]]:
    found = read_zones(path, where="zones")
    assert [p.message for p in found.problems] == []
    return [draft.points for draft in found.zones]


@pytest.mark.parametrize(
    "written",
    [
        PLAIN,
        ("DP 460000.00N 0143000.00E", "DP 460500.00N 0143000.00E", "DP 460500N 0143630E"),
        ("DP N46:00:00 E014:30:00", "DP N460500.00 E0143000.00", "DP N 46:05:00 E 014:36:30"),
        ("DP 46 00 00 N 014 30 00 E", "DP 46 05 N 14 30 E", "DP N46 05 00 E014 36 30.0"),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_openair_in_compact_places_and_other_encodings(tmp_path: Path, written: Any, encoding: str) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(OPENAIR.format(*written).encode(encoding))
    (points,) = zones(path)
    wanted = [46.0, 14.5, 46.0 + 5 / 60, 14.5, 46.0 + 5 / 60, 14.6 + 0.5 / 60]
    assert [x for point in points for x in point] == pytest.approx(wanted)


@pytest.mark.parametrize(
    "place", ["DP 466000N 0143000E", "DP 4600N 01430E", "DP N46:00:00 014:30:00 E", "DP 46000000N 0143000E"]
)
def test_places_that_are_none_stay_refused(tmp_path: Path, place: str) -> None:
    path = tmp_path / "a.txt"
    path.write_text(OPENAIR.format(place, *PLAIN[1:]), encoding="utf-8")
    found = read_zones(path, where="zones")
    assert found.zones == []
    assert [place in str(problem) for problem in found.problems] == [True]


@pytest.mark.parametrize(
    ("old", "new", "bounds", "words"),
    [
        ("AL GND", "AL", "None 1066.8 m AMSL", "an empty AL or AH is no limit"),
        ("AL GND", "al \t", "None 1066.8 m AMSL", "an empty AL or AH is no limit"),
        ("AH 3500FT AMSL", "AH", "None None", "an empty AL or AH is no limit"),
        ("AC R", "AC", "None None", "AC has no class"),
    ],
)
def test_empty_records_of_openair_limit_nothing(tmp_path: Path, old: str, new: str, bounds: str, words: str) -> None:
    path = tmp_path / "a.txt"
    path.write_text(OPENAIR.replace(old, new).format(*PLAIN), encoding="utf-8")
    found = read_zones(path, where="zones", policy=Policy(kinds=("R",)) if old != "AC R" else None)
    (draft,) = found.zones
    assert not found.problems
    assert f"{draft.floor} {draft.ceiling}" == bounds
    assert words in "".join(map(str, zone_notes([(draft, None)])))


@pytest.mark.parametrize("head", ["sep=\t\n", "sep=;\n", '"sep=;"\n', "SEP=;;;;\n\n"])
def test_a_table_whose_first_line_says_what_parts_the_columns(tmp_path: Path, head: str) -> None:
    path = tmp_path / "a.csv"
    body = "name;lat;lon;radius_m\nX;46.0405;14,495;50\n"
    path.write_text(head + (body.replace(";", "\t") if "\t" in head else body), encoding="utf-16")
    assert zones(path) == [((46.0405, 14.495),)]


def test_esri_s_json_is_called_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    ring = [[14.5, 46.0], [14.51, 46.0], [14.51, 46.01], [14.5, 46.0]]
    path.write_text(json.dumps({"geometryType": "esriGeometryPolygon", "features": [{"geometry": {"rings": [ring]}}]}))
    with pytest.raises(InputError, match="this is Esri's JSON, not GeoJSON: ask the server for f=geojson"):
        read_zones(path, where="zones")


ROWS = "0\t1\t0\t16\t0\t0\t0\t0\t46.03\t14.48\t330\t1\n1\t0\t3\t22\t0\t0\t0\t0\t46.03\t14.48\t50\t1\n"


def test_the_advice_for_a_file_of_version_120_can_be_followed() -> None:
    with pytest.raises(InputError) as why:
        parse_waypoints("QGC WPL 120\n" + ROWS, autopilot=Autopilot.ARDUCOPTER, where="a")
    assert "no row is home; write 'QGC WPL 110' there" in str(why.value)
    read = parse_waypoints("QGC WPL 110\n" + ROWS, autopilot=Autopilot.ARDUCOPTER, where="a")
    assert len(read.mission.items) == 1


@pytest.mark.parametrize(("command", "words"), [(5001, "a fence"), (5100, "rally points")])
def test_a_fence_saved_as_way_points_is_no_mission(command: int, words: str) -> None:
    rows = "".join(f"{k}\t0\t3\t{command}\t3\t0\t0\t0\t46.0{k}\t14.{k}\t0\t1\n" for k in (1, 2, 3))
    text = "QGC WPL 110\n" + ROWS.splitlines()[0] + "\n" + rows
    with pytest.raises(InputError, match=f"the file holds {words} \\(3 items\\)"):
        parse_waypoints(text, autopilot=Autopilot.ARDUCOPTER, where="a")


def plan(**item: Any) -> str:
    entry = {"autoContinue": True, "command": 16, "doJumpId": 1, "frame": 3, "type": "SimpleItem",
             "params": [0, 0, 0, None, 46.03, 14.48, 170]} | item  # fmt: skip
    mission = {"items": [entry], "plannedHomePosition": [46.03, 14.48, 300], "firmwareType": 3, "vehicleType": 2,
               "version": 2}  # fmt: skip
    return json.dumps({"fileType": "Plan", "version": 1, "groundStation": "QGroundControl", "mission": mission,
                       "geoFence": {"circles": [], "polygons": [], "version": 2},
                       "rallyPoints": {"points": [], "version": 2}})  # fmt: skip


def test_a_plan_with_places_in_coordinate_says_how_to_save_it_again() -> None:
    with pytest.raises(InputError, match="the place stands in `coordinate`: open the file in QGroundControl"):
        parse_plan(plan(params=[0, 0, 0, 0], coordinate=[46.03, 14.48, 170]), autopilot=None, where="a")


@pytest.mark.parametrize(
    ("item", "told"),
    [
        ({"Altitude": 50, "AltitudeMode": 1}, "Altitude of 50 m is not the one that is sent, params[6] 170 m"),
        ({"Altitude": 170, "AltitudeMode": 1}, ""),
        ({"Altitude": 50, "AltitudeMode": 3, "AMSLAltAboveTerrain": 170, "frame": 0}, ""),
        ({"Altitude": 50, "AltitudeMode": 3, "AMSLAltAboveTerrain": 400, "frame": 0}, "Altitude of 400 m"),
        ({"Altitude": None, "AltitudeMode": 1}, ""),
        ({"Altitude": 50}, "Altitude of 50 m is not the one that is sent"),
        ({"Altitude": 170, "AltitudeMode": 2}, "AltitudeMode 2 says another reference of the altitude than frame 3"),
        ({"Altitude": 50, "AltitudeMode": 0}, ""),
    ],
)
def test_an_altitude_that_contradicts_what_is_sent_is_told(item: dict[str, Any], told: str) -> None:
    notes = "\n".join(map(str, parse_plan(plan(**item), autopilot=None, where="a").notes))
    assert told in notes
    assert bool(told) == ("Altitude" in notes)


# -- shapes beside zones, and ED-269 in GeoJSON

SQUARE = {"type": "Polygon", "coordinates": [[[14.5, 46.0], [14.51, 46.0], [14.51, 46.01], [14.5, 46.0]]]}
BESIDE = {
    "pin": {"type": "Point", "coordinates": [14.5, 46.0]},
    "way": {"type": "LineString", "coordinates": [[14.5, 46.0], [14.6, 46.0]]},
    "none": None,
    "bare": {"type": "GeometryCollection", "geometries": []},
}


def geojson(**shapes: Any) -> str:
    made = [{"type": "Feature", "properties": {"name": name}, "geometry": one} for name, one in shapes.items()]
    return json.dumps({"type": "FeatureCollection", "features": made})


def test_shapes_beside_polygons_are_ignored_by_name_or_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    both = {"type": "GeometryCollection", "geometries": [SQUARE, SQUARE, BESIDE["pin"]]}
    path.write_text(geojson(zone=SQUARE, both=both, **BESIDE))
    refused = read_zones(path, where="zones", policy=Policy(where="--zones"))
    assert [p.message.split(":")[0] for p in refused.problems] == [
        "a point needs a radius to be a zone, and so do 1 more", "a line needs a corridor's half-width to be a zone",
        "the feature has no geometry; remove it, draw it, or leave it out by name (ignore",
        "the feature has no geometry; remove it, draw it, or leave it out by name (ignore",
    ]  # fmt: skip
    found = read_zones(path, where="zones", policy=Policy(where="--zones", ignore=("points", "lines", "empty")))
    assert not found.problems
    assert [z.name for z in found.zones] == ["zone", "both/1", "both/2"]
    told = {note.data["kind"]: note.data["zones"] for note in found.notes if note.code == "shapes_ignored"}
    assert told == {
        "points without a radius": ("both/3", "pin"),
        "lines without a width": ("way",),
        "empty geometries": ("none", "bare"),
    }


def test_what_has_a_size_is_no_shape_to_ignore(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    path.write_text(geojson(zone=SQUARE, **BESIDE).replace('{"name": "pin"}', '{"name": "pin", "radius_m": 50}'))
    every = Policy(where="--zones", ignore=("points", "lines", "empty"))
    assert [z.name for z in read_zones(path, where="zones", policy=every).zones] == ["zone", "pin"]
    said = read_zones(path, where="zones", policy=every, radius_m=30.0).problems
    assert [str(problem) for problem in said] == ["--ignore: points have a size in the mission, too: leave one out"]


@pytest.mark.parametrize("inner", ["", "<Point><coordinates>14,46</coordinates></Point>", "<LinearRing/>", "<Model/>"])
def test_pins_and_paths_in_kml_are_ignored_by_name(tmp_path: Path, inner: str) -> None:
    ring = "<coordinates>14.5,46 14.51,46 14.51,46.01</coordinates>"
    zone = (
        f"<Placemark><Polygon><outerBoundaryIs><LinearRing>{ring}</LinearRing></outerBoundaryIs></Polygon></Placemark>"
    )
    path = tmp_path / "a.kml"
    path.write_text(f"<kml><Placemark><name>beside</name>{inner}</Placemark>{zone}</kml>")
    (problem,) = read_zones(path, where="zones").problems
    assert "leave" in problem.message
    assert "--ignore" in problem.message
    found = read_zones(path, where="zones", policy=Policy(ignore=("points", "lines", "empty")))
    assert not found.problems
    assert len(found.zones) == 1
    assert "beside" in "".join(map(str, found.notes))


def test_geojson_with_the_properties_of_ed269_is_an_authority_s(tmp_path: Path) -> None:
    def zone(restriction: Any, **more: Any) -> dict[str, Any]:
        given = {"identifier": "A", "name": str(restriction), "restriction": restriction, "uomDimensions": "M",
                 "lowerLimit": 0, "lowerVerticalReference": "AGL", "upperLimit": 120, "upperVerticalReference": "AGL",
                 "applicability": [{"permanent": "YES"}]} | more  # fmt: skip
        return {"type": "Feature", "properties": given, "geometry": SQUARE}

    week = {"permanent": "NO", "startDateTime": "2026-01-05T00:00:00Z", "endDateTime": "2026-01-06T00:00:00Z"}
    features = [zone("PROHIBITED"), zone("NO_RESTRICTION"), zone(None), zone("CONDITIONAL", applicability=[week])]
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    drafts = read_zones(path, where="zones").zones
    free = Note("zones_restrict_nothing")
    assert [(z.name, str(z.ceiling), z.unused) for z in drafts] == [
        ("PROHIBITED", "120 m AGL", None), ("NO_RESTRICTION", "120 m AGL", free), ("None", "None", None),
        ("CONDITIONAL", "120 m AGL", None),
    ]  # fmt: skip
    only = Policy(kinds=("PROHIBITED",))
    assert [z.name for z in used(read_zones(path, where="zones", policy=only).zones)] == ["PROHIBITED", "None"]


def test_a_network_link_is_named_with_its_file(tmp_path: Path) -> None:
    path = tmp_path / "a.kml"
    path.write_text(
        "<kml><NetworkLink><name>all</name><Link><href>https://x.test/z.kml</href></Link></NetworkLink></kml>"
    )
    (problem,) = read_zones(path, where="zones").problems
    assert "NetworkLink (all): the zones of the link to https://x.test/z.kml are not in this file" in str(problem)


@pytest.mark.parametrize("limit", ["Ask on 122.8", "1500"])
def test_own_zones_whose_limits_are_not_understood_refuse_or_count_whole(tmp_path: Path, limit: str) -> None:
    path = tmp_path / "a.geojson"
    path.write_text(geojson(zone=SQUARE).replace('{"name": "zone"}', json.dumps({"name": "zone", "UPPER": limit})))
    assert "cannot be read as a level" in str(read_zones(path, where="zones").problems)
    for on_bad in ("strict", "skip"):
        found = read_zones(path, where="zones", policy=Policy(on_bad=on_bad))
        assert not found.problems
        (draft,) = found.zones
        assert (draft.floor, draft.ceiling) == (None, None)
        assert draft.remarks[-1][0] == Note("zone_limits_not_understood", file="a.geojson")
