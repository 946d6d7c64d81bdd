"""Files as people have them: read as they mean it, or refused in words that say what to do."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gcsplan.errors import InputError
from gcsplan.mavlink.files.plan_file import parse_plan
from gcsplan.mavlink.files.waypoints_file import parse_waypoints
from gcsplan.mission_file.zone_reader import read_zones
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


@pytest.mark.parametrize("head", ["sep=;\n", '"sep=;"\n', "SEP=;;;;\n\n"])
def test_a_table_whose_first_line_says_what_parts_the_columns(tmp_path: Path, head: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(head + "name;lat;lon;radius_m\nX;46.0405;14,495;50\n", encoding="utf-16")
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
