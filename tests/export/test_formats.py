"""The profile, KML, GeoJSON and summary: what stands in them, to the digit; the same input gives the same bytes."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import tracemalloc
import xml.etree.ElementTree as ET
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod

from gcsplan.export.geojson import write_geojson
from gcsplan.export.kml import DRAWN_TOP_M, write_kml
from gcsplan.export.profile import write_profile
from gcsplan.export.rows import FlownTrack, ItemRow, WayPoint, outlines_deg
from gcsplan.export.summary import ORDER, SCHEMA, json_of, write_summary
from gcsplan.export.table import csv_of
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import place_zones
from gcsplan.vehicle import Autopilot
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.effort import draws
from tests.support.paths import REPOSITORY

FRAME = Frame(36.6, -84.3)
TRACK = FlownTrack(
    "uav1",
    np.array([36.6, 36.61234567, 36.62]),
    np.array([-84.38, -84.37, -84.36000001]),
    np.array([300.0, 412.345, 500.125]),
    (
        WayPoint("TAKEOFF", 1, "take-off", 0.0, time_s=12.0),
        None,
        WayPoint("WAYPOINT <2> & more", 3, "waypoint", 65.2599, -33.25, 180.25),
    ),
    np.array([12.0, 90.0, 150.25]),
    np.array([12.0, 90.0, 180.25]),
)
SQUARE = Polygon(np.array([[0.0, 0.0], [1000.0, 0.0], [1000.0, 800.0], [0.0, 800.0]]))
ZONES = (
    Zone("village", Circle(2000.0, -500.0, 400.0)),
    Zone("mast", Circle(-100.0, 100.0, 60.0), None, Level(100.0, "agl")),
    Zone("airfield", SQUARE, Level(50.0, "agl"), Level(900.5, "amsl")),
)
KML = "{http://www.opengis.net/kml/2.2}"
GX = "{http://www.google.com/kml/ext/2.2}"
WGS84 = Geod(ellps="WGS84")


# -- profile.csv --------------------------------------------------------------------------------------------------

HEADER = "vehicle,seq,command,lat,lon,amsl_m,agl_m,min_agl_on_leg_m,leg_m,climb_deg,energy_j,cumulative_energy_j,time_s"


def test_the_profile_has_the_contracts_columns_and_a_row_for_each_item() -> None:
    row = ItemRow(
        "uav1", 2, "WAYPOINT", 36.61234567, -84.5, 412.3456, 65, 60.0004, 1234.5678, -3.21, 1.25e5, 2.5e5, 82.3
    )
    text = write_profile([row, ItemRow("uav1", 3, "DO_CHANGE_SPEED", agl_m=math.nan, leg_m=math.inf)])
    assert text.splitlines() == [
        HEADER,
        "uav1,2,WAYPOINT,36.6123457,-84.5000000,412.346,65.000,60.000,1234.568,-3.210,125000.0,250000.0,82.30",
        "uav1,3,DO_CHANGE_SPEED,,,,,,,,,,",
    ]
    assert text.endswith("\n")
    assert "\r" not in text


def test_a_zero_has_no_sign_and_a_comma_in_a_name_is_quoted() -> None:
    text = write_profile([ItemRow('a,"b"', 1, "LAND", climb_deg=-0.0001, agl_m=-0.0)])
    row = next(csv.DictReader(io.StringIO(text)))
    assert (row["vehicle"], row["climb_deg"], row["agl_m"]) == ('a,"b"', "0.000", "0.000")


# -- tracks and outlines ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lat", "lon", "waypoints"),
    [([1.0], [1.0], ()), ([1.0, 2.0], [1.0], ()), ([1.0, math.nan], [1.0, 2.0], ()), ([1.0, 2.0], [1.0, 2.0], (None,))],
)
def test_a_track_that_is_none_is_refused(lat: list[float], lon: list[float], waypoints: tuple[None, ...]) -> None:
    with pytest.raises(ValueError, match=r"track|way points"):
        FlownTrack("a", np.array(lat), np.array(lon), np.array(lat), waypoints)


@settings(max_examples=draws(60))
@given(st.floats(-40_000, 40_000), st.floats(-40_000, 40_000), st.floats(1.0, 20_000.0))
def test_the_outline_of_a_circle_holds_the_circle_even_after_rounding(east: float, north: float, radius: float) -> None:
    corners = np.round(outlines_deg([Zone("z", Circle(east, north, radius))], FRAME)[0], 7)
    ring = FRAME.to_plane(corners[:, 0], corners[:, 1])
    ahead = np.roll(ring, -1, axis=0)
    edge = ahead - ring
    centre = np.array([east, north])
    left_m = (edge[:, 0] * (centre - ring)[:, 1] - edge[:, 1] * (centre - ring)[:, 0]) / np.linalg.norm(edge, axis=1)
    assert (left_m >= radius).all()  # counter-clockwise: the centre lies left of every edge
    assert (left_m <= radius * 1.0001 + 0.05).all()


# -- KML ----------------------------------------------------------------------------------------------------------


def coordinates(element: ET.Element | None) -> list[list[float]]:
    assert element is not None
    assert element.text is not None
    return [[float(x) for x in place.split(",")] for place in element.text.split()]


def test_the_kml_holds_tracks_points_and_zones_where_they_are() -> None:
    root = ET.fromstring(write_kml("Ridge & <valley>", [TRACK], ZONES, FRAME))
    assert root.tag == KML + "kml"
    assert root.findtext(f"{KML}Document/{KML}name") == "Ridge & <valley>"
    line = root.find(f".//{KML}LineString")
    assert line is not None
    assert line.findtext(KML + "altitudeMode") == "absolute"
    assert line.findtext(KML + "extrude") == "1"
    assert coordinates(line.find(KML + "coordinates")) == [
        [-84.38, 36.6, 300.0], [-84.37, 36.6123457, 412.35], [-84.36, 36.62, 500.12],
    ]  # fmt: skip
    points = [p for p in root.iter(KML + "Placemark") if p.find(KML + "Point") is not None]
    assert [p.findtext(KML + "name") for p in points] == ["TAKEOFF", "WAYPOINT <2> & more"]


def test_a_balloon_tells_number_command_heights_and_time_of_its_way_point() -> None:
    root = ET.fromstring(write_kml("m", [TRACK], ZONES, FRAME))
    told = [
        {d.get("name"): d.findtext(KML + "value") for d in p.iter(KML + "Data")}
        for p in root.iter(KML + "Placemark")
        if p.find(KML + "Point") is not None
    ]
    keys = ("vehicle", "number", "command", "amsl_m", "agl_m", "time_s")
    assert told == [
        dict(zip(keys, ("uav1", "1", "take-off", "300.00", "0.00", "12.0"), strict=True)),
        dict(zip(keys, ("uav1", "3", "waypoint", "500.12", "65.25", "180.2"), strict=True)),
    ]
    balloon = root.findtext(f".//{KML}BalloonStyle/{KML}text") or ""
    assert set(re.findall(r"\$\[(\w+)\]", balloon)) == {"name", *told[0]}
    void = replace(TRACK, waypoints=(None, None, WayPoint("x", 2, "y", math.nan)))
    fields = ET.fromstring(write_kml("m", [void], [], FRAME)).iter(KML + "Data")
    assert {d.get("name"): d.findtext(KML + "value") for d in fields} == {
        "vehicle": "uav1", "number": "2", "command": "y", "amsl_m": "500.12", "agl_m": "unknown", "time_s": "unknown",
    }  # fmt: skip


def test_an_item_has_one_placemark_whatever_it_is_flown_as() -> None:
    again = replace(TRACK, waypoints=(TRACK.waypoints[0], TRACK.waypoints[2], TRACK.waypoints[2]))
    for track in (TRACK, again):
        root = ET.fromstring(write_kml("m", [track], [], FRAME))
        points = [p for p in root.iter(KML + "Placemark") if p.find(KML + "Point") is not None]
        assert [p.findtext(KML + "name") for p in points] == ["TAKEOFF", "WAYPOINT <2> & more"]


def test_the_document_and_each_track_have_a_view_of_all_that_they_show() -> None:
    other = replace(TRACK, vehicle="uav2", lat_deg=TRACK.lat_deg + 0.1)
    root = ET.fromstring(write_kml("m", [TRACK, other], ZONES, FRAME))
    views = list(root.iter(KML + "LookAt"))
    assert len(views) == 3
    for view, places in zip(views, ([TRACK, other], [TRACK], [other]), strict=True):
        lat, lon, away = (float(view.findtext(KML + k) or "nan") for k in ("latitude", "longitude", "range"))
        assert view.findtext(KML + "altitudeMode") == "absolute"
        for track in places:
            for a, b in zip(track.lat_deg, track.lon_deg, strict=True):
                assert WGS84.inv(lon, lat, b, a)[2] <= 0.5 * away
    north_east = float(views[1].findtext(KML + "heading") or "nan")
    assert north_east == pytest.approx(WGS84.inv(-84.38, 36.6, -84.36, 36.62)[0], abs=1.0)
    wide = ET.fromstring(write_kml("m", [], ZONES, FRAME)).find(f".//{KML}LookAt")
    assert wide is not None


def test_a_marker_moves_only_where_the_mission_has_a_time_of_day() -> None:
    assert "gx:Track" not in write_kml("m", [TRACK], ZONES, FRAME)
    start = datetime(2026, 11, 21, 18, 30, tzinfo=UTC)
    root = ET.fromstring(write_kml("m", [TRACK], ZONES, FRAME, start))
    (track,) = root.iter(GX + "Track")
    when = [e.text for e in track.iter(KML + "when")]
    places = [[float(x) for x in (e.text or "").split()] for e in track.iter(GX + "coord")]
    assert when == [f"2026-11-21T18:{m}Z" for m in ("30:12.000", "31:30.000", "32:30.250", "33:00.250")]
    assert places == [
        [-84.38, 36.6, 300.0], [-84.37, 36.6123457, 412.35], [-84.36, 36.62, 500.12], [-84.36, 36.62, 500.12],
    ]  # fmt: skip
    assert "gx:Track" not in write_kml("m", [replace(TRACK, reached_s=None, left_s=None)], [], FRAME, start)


CHILDREN = {
    "kml": ["Document"],
    "Document": ["name", "open", "LookAt", "Style", "StyleMap", "Folder"],
    "Folder": ["name", "visibility", "LookAt", "Placemark", "Folder"],
    "Placemark": [
        "name", "visibility", "description", "styleUrl", "ExtendedData", "Point", "LineString", "Polygon",
        "MultiGeometry", "Track",
    ],
    "LookAt": ["longitude", "latitude", "altitude", "heading", "tilt", "range", "altitudeMode"],
    "Style": ["IconStyle", "LabelStyle", "LineStyle", "PolyStyle", "BalloonStyle"],
    "StyleMap": ["Pair"], "Pair": ["key", "styleUrl"],
    "IconStyle": ["color", "scale"], "LabelStyle": ["scale"], "LineStyle": ["color", "width"], "PolyStyle": ["color"],
    "BalloonStyle": ["text"], "ExtendedData": ["Data"], "Data": ["value"],
    "Point": ["altitudeMode", "coordinates"], "LineString": ["extrude", "altitudeMode", "coordinates"],
    "Polygon": ["extrude", "altitudeMode", "outerBoundaryIs"], "outerBoundaryIs": ["LinearRing"],
    "LinearRing": ["coordinates"], "MultiGeometry": ["Polygon"], "Track": ["altitudeMode", "when", "coord"],
}  # fmt: skip
"""The children of our KML's elements, in the order of ogckml22.xsd and kml22gx.xsd; Style and StyleMap take turns."""


@pytest.mark.parametrize("count", [1, 101])
def test_elements_stand_in_the_order_of_the_schema(count: int) -> None:
    start = datetime(2026, 11, 21, 18, 30, tzinfo=UTC)
    root = ET.fromstring(write_kml("m", [TRACK] * count, ZONES, FRAME, start))
    seen = set()
    for element in root.iter():
        tag = element.tag.split("}")[1]
        assert element.tag.startswith(GX if tag in ("Track", "coord") else KML)
        children = [c.tag.split("}")[1] for c in element]
        order = CHILDREN.get(tag, [])
        assert set(children) <= set(order), tag
        ranks = [order.index("Style" if c == "StyleMap" else c) for c in children]
        assert ranks == sorted(ranks), (tag, children)
        seen.add(tag)
    assert set(CHILDREN) <= seen
    ids = [e.get("id") for e in root.iter() if e.get("id")]
    assert len(ids) == len(set(ids))
    assert {u.text for u in root.iter(KML + "styleUrl")} <= {f"#{i}" for i in ids}


def test_a_large_fleets_way_points_are_there_to_tick_and_its_tracks_lack_curtains() -> None:
    root = ET.fromstring(write_kml("m", [replace(TRACK, vehicle=f"uav{n}") for n in range(101)], ZONES, FRAME))
    whole = ET.fromstring(write_kml("m", [TRACK], ZONES, FRAME))
    tracks = [p for p in root.iter(f"{KML}Placemark") if p.find(f"{KML}LineString") is not None]
    points = [p for p in root.iter(f"{KML}Placemark") if p.find(f"{KML}Point") is not None]
    assert len(tracks) == 101
    assert not [p for p in tracks if p.find(f".//{KML}extrude") is not None or p.find(f"{KML}visibility") is not None]
    assert [p.findtext(f"{KML}visibility") for p in points] == ["0"] * 202
    line = f".//{KML}LineString/{KML}coordinates"
    assert root.findtext(line) == whole.findtext(line)
    assert not list(whole.iter(f"{KML}visibility"))


@pytest.mark.slow
def test_a_hundred_vehicles_make_a_file_that_viewers_open() -> None:
    points = tuple(WayPoint(f"{n} NAV_WAYPOINT", n, "NAV_WAYPOINT", 60.0, None, 10.0 * n) for n in range(50))
    places = np.linspace(36.6, 36.7, 50)
    tracks = [FlownTrack(f"uav{n}", places, places - 121.0, 1e3 * places, points) for n in range(100)]
    assert len(write_kml("m", tracks, [], FRAME)) < 100 * 50 * 700


def test_zones_stand_in_the_kml_from_floor_to_ceiling() -> None:
    root = ET.fromstring(write_kml("m", [TRACK], ZONES, FRAME))
    zones = {
        p.findtext(KML + "name"): p for p in root.iter(KML + "Placemark") if p.find(f".//{KML}Polygon") is not None
    }
    assert set(zones) == {"village", "mast", "airfield"}

    def faces(name: str) -> list[tuple[str | None, str | None, float]]:
        found = []
        for polygon in zones[name].iter(KML + "Polygon"):
            ring = coordinates(polygon.find(f".//{KML}coordinates"))
            assert ring[0] == ring[-1]
            assert len({p[2] for p in ring}) == 1
            found.append((polygon.findtext(KML + "altitudeMode"), polygon.findtext(KML + "extrude"), ring[0][2]))
        return found

    assert faces("village") == [("absolute", "1", 500.12 + DRAWN_TOP_M)]
    assert faces("mast") == [("relativeToGround", "1", 100.0)]
    assert faces("airfield") == [("relativeToGround", "0", 50.0), ("absolute", "0", 900.5)]
    assert "unlimited" in str(zones["village"].findtext(KML + "description"))
    assert "from 50 m AGL to 900.5 m AMSL" in str(zones["airfield"].findtext(KML + "description"))


@pytest.mark.slow
@settings(max_examples=draws(25))
@given(st.text())
def test_no_name_breaks_the_kml(name: str) -> None:
    zone = Zone(name, Circle(0.0, 0.0, 10.0))
    track = FlownTrack(name, TRACK.lat_deg, TRACK.lon_deg, TRACK.amsl_m, (WayPoint(name, 1, name, 0.0), None, None))
    text = write_kml(name, [track], [zone], FRAME)
    root = ET.fromstring(text.encode("utf-8"))
    said = root.findtext(f"{KML}Document/{KML}name") or ""
    assert len(said) == len(name)


def test_an_empty_kml_is_a_valid_one() -> None:
    assert ET.fromstring(write_kml("m", [], [], FRAME)).find(f".//{KML}Placemark") is None


# -- GeoJSON ------------------------------------------------------------------------------------------------------


def features(text: str, kind: str) -> list[dict[str, Any]]:
    document = json.loads(text)
    assert document["type"] == "FeatureCollection"
    assert all(f["type"] == "Feature" for f in document["features"])
    return [f for f in document["features"] if f["properties"]["kind"] == kind]


def test_the_geojson_holds_tracks_and_points_with_their_altitudes() -> None:
    text = write_geojson("m", [TRACK], ZONES, FRAME)
    (line,) = features(text, "track")
    assert line["geometry"]["type"] == "LineString"
    assert line["geometry"]["coordinates"][1] == [-84.37, 36.6123457, 412.35]
    assert line["properties"]["vehicle"] == "uav1"
    points = features(text, "waypoint")
    assert [p["properties"]["name"] for p in points] == ["TAKEOFF", "WAYPOINT <2> & more"]
    assert points[0]["geometry"] == {"type": "Point", "coordinates": [-84.38, 36.6, 300.0]}
    assert "metres above mean sea level" in json.loads(text)["heights"]
    for feature in (line, *points):
        assert feature["properties"]["third_coordinate"] == "amsl_m"
    assert [{k: p["properties"].get(k) for k in ("number", "command", "agl_m", "ellipsoidal_m")} for p in points] == [
        {"number": 1, "command": "take-off", "agl_m": 0.0, "ellipsoidal_m": None},
        {"number": 3, "command": "waypoint", "agl_m": 65.25, "ellipsoidal_m": 466.88},
    ]
    assert points[1]["properties"]["amsl_m"] == points[1]["geometry"]["coordinates"][2] == 500.12


def test_zones_of_the_geojson_carry_the_mission_files_own_keys() -> None:
    zones = features(write_geojson("m", [TRACK], ZONES, FRAME), "no_fly")
    assert [z["properties"] for z in zones] == [
        {"kind": "no_fly", "name": "village"},
        {"kind": "no_fly", "name": "mast", "ceiling_agl_m": 100.0},
        {"kind": "no_fly", "name": "airfield", "floor_agl_m": 50.0, "ceiling_amsl_m": 900.5},
    ]
    for zone in zones:
        (ring,) = zone["geometry"]["coordinates"]
        assert ring[0] == ring[-1]
        area, _ = WGS84.polygon_area_perimeter([p[0] for p in ring], [p[1] for p in ring])
        assert area > 0  # counter-clockwise, RFC 7946 section 3.1.6
    (square,) = zones[2]["geometry"]["coordinates"]
    back = FRAME.to_plane([p[1] for p in square[:-1]], [p[0] for p in square[:-1]])
    assert np.abs(back - SQUARE.vertices).max() < 0.02


def test_the_geojson_can_be_given_back_as_a_file_of_zones(tmp_path: Path) -> None:
    file = tmp_path / "mission.geojson"
    file.write_text(write_geojson("m", [TRACK], ZONES, FRAME), encoding="utf-8")
    found = read_zones(file, where="no_fly[0].file")
    assert found.problems == []
    assert [(z.name, z.floor, z.ceiling) for z in found.zones] == [(z.name, z.floor, z.ceiling) for z in ZONES]
    (_, village), *_ = place_zones(found.zones, FRAME)[0]
    assert isinstance(village.shape, Polygon)
    reach = np.linalg.norm(village.shape.vertices - [2000.0, -500.0], axis=1)
    assert reach.min() > 400.0
    assert reach.max() < 401.0


def test_a_track_across_the_antimeridian_is_cut_there() -> None:
    lon = np.array([179.9, -179.9, -179.8, 179.8])
    track = FlownTrack("a", np.array([10.0, 10.2, 10.3, 10.7]), lon, np.array([100.0, 200.0, 300.0, 500.0]))
    (line,) = features(write_geojson("m", [track], [], FRAME), "track")
    assert line["geometry"] == {
        "type": "MultiLineString",
        "coordinates": [
            [[179.9, 10.0, 100.0], [180.0, 10.1, 150.0]],
            [[-180.0, 10.1, 150.0], [-179.9, 10.2, 200.0], [-179.8, 10.3, 300.0], [-180.0, 10.5, 400.0]],
            [[180.0, 10.5, 400.0], [179.8, 10.7, 500.0]],
        ],
    }


def test_a_track_that_ends_or_turns_on_the_antimeridian_is_not_cut() -> None:
    for lon in ([179.9, 180.0, 179.9], [179.9, -180.0, 179.9], [180.0, 179.9, 179.8]):
        track = FlownTrack("a", np.array([1.0, 2.0, 3.0]), np.array(lon), np.zeros(3))
        (line,) = features(write_geojson("m", [track], [], FRAME), "track")
        assert line["geometry"]["type"] == "LineString"
        assert {p[0] for p in line["geometry"]["coordinates"]} <= {180.0, 179.9, 179.8}


def test_a_zone_across_the_antimeridian_becomes_two_polygons_of_the_same_area() -> None:
    frame = Frame(52.0, 180.0)
    for zone in (Zone("c", Circle(300.0, 0.0, 1000.0)), Zone("p", SQUARE), Zone("q", Polygon(SQUARE.vertices - 500.0))):
        (feature,) = features(write_geojson("m", [], [zone], frame), "no_fly")
        geometry = feature["geometry"]
        parts = geometry["coordinates"] if geometry["type"] == "MultiPolygon" else [geometry["coordinates"]]
        assert len(parts) == (1 if zone.name == "p" else 2)
        total = 0.0
        for (ring,) in parts:
            assert ring[0] == ring[-1]
            assert len({math.copysign(1.0, p[0]) for p in ring}) == 1
            assert all(abs(p[0]) <= 180.0 for p in ring)
            total += WGS84.polygon_area_perimeter([p[0] for p in ring], [p[1] for p in ring])[0]
        corners = frame.to_plane(*outlines_deg([zone], frame)[0].T)
        e, n = corners.T
        shoelace = 0.5 * float(np.sum(e * np.roll(n, -1) - n * np.roll(e, -1)))
        assert total == pytest.approx(shoelace, rel=1e-4)


# -- summary.json -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_json_is_that_of_the_library_and_takes_little_more_than_its_text() -> None:
    """A mission that is flown around for 100,000 items took a gigabyte, most of it for commas and numbers in a list."""
    value = {"legs": [{"leg": i, "length_m": 0.5 * i, "what": "Übung", "none": None} for i in range(5_000)]}
    expected = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
    tracemalloc.start()
    try:
        text = json_of(value, "verdicts")
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert text == expected
    assert json_of(value, "verdicts", lines=False) == json.dumps(value, ensure_ascii=False)
    plain = 5_000 * 500  # the rounded copy
    assert most < 3 * len(text) + plain, (most, len(text))


def summary() -> dict[str, Any]:
    """A summary with its keys in another order than the contract's, and with numbers as numpy gives them."""
    vehicle = {
        "extra": "kept", "safe": np.bool_(True), "planning_s": 1.234, "first_path_s": 0.5, "upload": {"url": "x"},
        "name": "uav1", "items": np.int64(34), "length_m": 21234.56789, "lower_bound_m": 21200.99999,
        "gap_percent": 0.0123456, "min_agl_m": 59.9999999999,
        "min_agl_at": {"lon": -84.123456789, "lat": 36.6, "leg": 7}, "min_zone_clearance_m": math.inf,
        "nearest_zone": None, "energy_j": np.float64(123.456), "lower_bound_j": None,
        "speed_m_s": -0.0, "max_climb_deg": 14.99999, "not_judged": (), "stopped_by": "gap",
    }  # fmt: skip
    return {"vehicles": [vehicle], "seed": 1, "name": "Grat", "planner": "optimal", "fleet": None, "inputs": {}}


def test_the_summary_has_the_contracts_keys_in_its_order() -> None:
    document = json.loads(write_summary(summary()))
    assert list(document) == ["schema", "name", "planner", "seed", "inputs", "vehicles", "fleet"]
    vehicle = document["vehicles"][0]
    known = [key for key in ORDER["vehicles"] if key in vehicle]
    assert list(vehicle) == [*known, "extra"]
    assert list(vehicle["min_agl_at"]) == ["leg", "lat", "lon"]


def test_numbers_of_the_summary_are_rounded_by_their_unit_and_never_for_the_better() -> None:
    vehicle = json.loads(write_summary(summary()))["vehicles"][0]
    assert vehicle["length_m"] == 21234.568
    assert vehicle["lower_bound_m"] == 21200.999  # down, although 21201 is nearer
    assert vehicle["min_agl_m"] == 60.0  # noise is not a millimetre
    assert vehicle["min_agl_at"] == {"leg": 7, "lat": 36.6, "lon": -84.1234568}
    assert vehicle["min_zone_clearance_m"] is None
    assert (vehicle["energy_j"], vehicle["items"], vehicle["safe"]) == (123.5, 34, True)
    assert math.copysign(1.0, vehicle["speed_m_s"]) == 1.0
    assert vehicle["max_climb_deg"] == 15.0
    assert vehicle["not_judged"] == []
    assert json.loads(write_summary({"min_agl_m": -1.2345}))["min_agl_m"] == -1.235


def test_clock_readings_stay_out_of_the_file_and_in_what_is_printed() -> None:
    vehicle = json.loads(write_summary(summary()))["vehicles"][0]
    assert {"planning_s", "first_path_s", "upload"} & set(vehicle) == set()
    told = json.loads(write_summary(summary(), clocks=True))["vehicles"][0]
    assert (told["planning_s"], told["first_path_s"], told["upload"]) == (1.234, 0.5, {"url": "x"})


def test_plain_words_and_nothing_else_go_into_json() -> None:
    assert json.loads(write_summary({"autopilot": Autopilot.PX4}))["autopilot"] == "px4"
    assert "Straße" in write_summary({"name": "Straße"})
    with pytest.raises(TypeError, match="a holds a object"):
        write_summary({"a": object()})


@pytest.mark.slow
@settings(max_examples=draws(100))
@given(st.dictionaries(st.sampled_from(["a_m", "min_b_m", "lat", "c"]), st.floats() | st.integers() | st.text()))
def test_any_numbers_make_valid_json(values: dict[str, Any]) -> None:
    document = json.loads(write_summary(values), parse_constant=lambda word: pytest.fail(word))
    assert set(document) == {"schema", *values}
    assert document["schema"] == SCHEMA
    for key, value in values.items():
        if isinstance(value, float) and math.isfinite(value):
            assert document[key] == pytest.approx(value, rel=1e-9, abs=1.1e-3)
            assert not key.startswith("min_") or document[key] <= value + 1.1e-6 + 1e-15 * abs(value)


# -- all ----------------------------------------------------------------------------------------------------------


def test_the_same_input_gives_the_same_bytes() -> None:
    for write in (write_kml, write_geojson):
        assert write("m", [TRACK], ZONES, FRAME) == write("m", [TRACK], ZONES, Frame(36.6, -84.3))
    assert write_summary(summary()) == write_summary(dict(reversed(summary().items())))


@pytest.mark.parametrize(
    ("value", "cell"),
    [
        ("=1+1", "'=1+1"), ("+cmd", "'+cmd"), ("-uav", "'-uav"), ("@sum", "'@sum"), ("\tx", "'\tx"), ("\rx", '"\'\rx"'),
        ("-5.25", "-5.25"), ("+1e-3", "+1e-3"), (-5.25, "-5.25"), ("uav=1", "uav=1"), ("", ""), (None, ""),
        ("=1,2", '"\'=1,2"'), ("-1+2", "'-1+2"), ("-.5", "-.5"),
    ],
)  # fmt: skip
def test_no_text_of_a_csv_is_a_formula(value: object, cell: str) -> None:
    assert csv_of([["a", value]]) == f"a,{cell}\n"


def test_every_csv_is_written_in_one_place() -> None:
    writers = [
        path.name for path in (REPOSITORY / "gcsplan").rglob("*.py")
        if re.search(r"csv\.(Dict)?[wW]riter", path.read_text(encoding="utf-8"))
    ]  # fmt: skip
    assert writers == ["table.py"]
