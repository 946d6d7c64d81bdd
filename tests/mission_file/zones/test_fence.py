"""Fences of Mission Planner and MAVProxy, as way points, as places, and as drawn polygons."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gcsplan.errors import InputError
from gcsplan.mission_file.published.policy import Policy
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.fence import is_fence, read_fence

HOME = "0\t1\t0\t16\t0\t0\t0\t0\t46.03\t14.48\t330\t1"


def zones(path: Path) -> list[tuple[tuple[float, float], ...]]:
    found = read_fence(path, path.read_bytes())
    assert [p.message for p in found.problems] == []
    return [draft.points for draft in found.zones]


def fence_rows(*items: tuple[int, float, float, float]) -> str:
    """A fence as Mission Planner saves it: (command, first parameter, latitude, longitude)."""
    rows = [
        f"{k}\t0\t3\t{command}\t{p1}\t0\t0\t0\t{lat}\t{lon}\t0\t1" for k, (command, p1, lat, lon) in enumerate(items, 1)
    ]
    return "\n".join(["QGC WPL 110", HOME, *rows]) + "\n"


TRIANGLE = [(46.02, 14.47), (46.06, 14.47), (46.06, 14.52)]
OUT = [(5002, 3, *corner) for corner in TRIANGLE]


def test_a_fence_saved_as_way_points_is_read_as_zones(tmp_path: Path) -> None:
    path = tmp_path / "a.waypoints"
    path.write_text(fence_rows(*OUT, (5004, 100, 46.1, 14.6), (5000, 0, 46.1, 14.6)))
    found = read_zones(path, where="zones")
    assert [(z.points, z.radius_m) for z in found.zones] == [(tuple(TRIANGLE), None), (((46.1, 14.6),), 100.0)]
    assert "a.waypoints: not used: 1 point to which a fence sends the aircraft" in map(str, found.notes)
    path.write_text(
        "\n".join(line for line in fence_rows(*OUT).splitlines() if "\t330\t" not in line).replace("\n1\t", "\n1\t")
    )
    assert zones(path) == [tuple(TRIANGLE)]  # MAVProxy writes no home


@pytest.mark.parametrize(
    ("items", "words"),
    [
        (OUT[:2], "a polygon of 3 corners needs as many rows of command 5002 that say so; 2 follow each other"),
        ([*OUT, (16, 0, 46.0, 14.0)], "command 16 is none of a fence"),
        ([(5004, 0, 46.0, 14.0)], "must be above 0"),
        ([(16, 0, 46.0, 14.0)], "the file holds a mission, and no fence"),
        ([(5100, 0, 46.0, 14.0)], "the file holds rally points, and no fence"),
        ([], "the file holds nothing, and no fence"),
    ],
)
def test_a_fence_that_is_not_whole_or_no_zone_says_so(tmp_path: Path, items: Any, words: str) -> None:
    path = tmp_path / "a.waypoints"
    path.write_text(fence_rows(*items))
    try:
        said = "\n".join(map(str, read_zones(path, where="zones").problems))
    except InputError as why:
        said = str(why)
    assert words in said


def test_inclusion_areas_of_a_fence_are_keep_in_areas(tmp_path: Path) -> None:
    path = tmp_path / "a.waypoints"
    path.write_text(fence_rows(*[(5001, 3, *corner) for corner in TRIANGLE], (5004, 100, 46.1, 14.6)))
    assert [(z.keep_in, z.radius_m) for z in read_zones(path, where="zones").zones] == [(True, None), (False, 100.0)]
    for name in ("a.fen", "a.txt"):
        (tmp_path / name).write_text(HEAD + RETURN + CORNERS + FIRST)
        (zone,) = read_zones(tmp_path / name, where="zones").zones
        assert (zone.keep_in, zone.points) == (True, tuple(TRIANGLE))


HEAD = "#saved by Mission Planner 1.3.80\n"
RETURN = "46.03 14.48\n"
CORNERS = "46.02 14.47\n46.06 14.47\n46.06 14.52\n"
FIRST = "46.02 14.47\n"


@pytest.mark.parametrize(
    "written", [CORNERS, CORNERS + FIRST, (CORNERS + FIRST).replace(".", ","), CORNERS.replace(" ", ", ")]
)
def test_a_drawn_polygon_of_mission_planner_is_a_zone(tmp_path: Path, written: str) -> None:
    path = tmp_path / "a.poly"
    path.write_text(HEAD + written)
    assert zones(path) == [tuple(TRIANGLE)]


@pytest.mark.parametrize("name", ["a.fen", "a.txt"])
@pytest.mark.parametrize(
    ("written", "words"),
    [
        (RETURN + CORNERS, "is the file whole?"),
        (RETURN + "46.02 14.47 3\n", "line 3: a line holds latitude and longitude, as `46.02 14.47`, given"),
        ("14.47 46.02\nEND\n", "this is OpenStreetMap's .poly"),
    ],
)
def test_a_fence_of_places_is_known_and_named(tmp_path: Path, name: str, written: str, words: str) -> None:
    path = tmp_path / name
    path.write_text(HEAD + written)
    try:
        said = "\n".join(map(str, read_zones(path, where="zones").problems))
    except InputError as why:
        said = str(why)
    assert words in said


def test_an_area_that_the_aircraft_stays_in_is_a_keep_in_area(tmp_path: Path) -> None:
    inside = [(5001, 3, *corner) for corner in TRIANGLE]
    places = HEAD + RETURN + CORNERS + FIRST
    for name, text in (("a.waypoints", fence_rows(*inside)), ("a.fen", places), ("a.txt", places)):
        path = tmp_path / name
        path.write_text(text)
        (draft,) = read_zones(path, where="zones").zones
        assert (draft.keep_in, draft.points) == (True, tuple(TRIANGLE))
    path = tmp_path / "a.waypoints"
    path.write_text(fence_rows(*inside, *inside))
    assert "fence_areas_joined" in [note.code for note in read_zones(path, where="zones").notes]


def test_an_area_to_stay_in_that_is_not_whole_is_never_skipped(tmp_path: Path) -> None:
    path = tmp_path / "a.waypoints"
    crossed = [(5001, 4, 46.0, 14.0), (5001, 4, 46.1, 14.1), (5001, 4, 46.0, 14.1), (5001, 4, 46.1, 14.0)]
    for bad in ([(5001, 3, 46.0, 14.0)], crossed, [(5003, 0, 46.0, 14.0)]):
        path.write_text(fence_rows(*OUT, *bad))
        assert read_zones(path, where="zones", policy=Policy(on_bad="skip")).problems
    path.write_text(fence_rows(*OUT, (5004, 0, 46.0, 14.0)))
    assert not read_zones(path, where="zones", policy=Policy(on_bad="skip")).problems


@pytest.mark.parametrize(
    ("data", "known"),
    [
        (b"QGC WPL 110\n", True), (b"# x\n\n46.0 14.5\n", True), ("46,0 14,5".encode("utf-16"), True), (b"", False),
        (b"AC R\nDP 46:00:00 N 014:00:00 E", False), (b"46.0 14.5 3", False), (b"\xff\xfe\x00", False),
    ],
)  # fmt: skip
def test_a_fence_is_known_by_its_first_line(data: bytes, known: bool) -> None:
    assert is_fence(data) is known
