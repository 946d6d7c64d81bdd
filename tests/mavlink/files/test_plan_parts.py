"""Parts of a `.plan`: landing patterns as QGroundControl sends them, fences and rally points there and back."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError
from gcsplan.mavlink.files.plan_fence import (
    FENCE_KEYS,
    MAX_PROBLEMS,
    fence_items,
    fence_json,
    rally_items,
    rally_json,
    unread_keys,
)
from gcsplan.mavlink.files.plan_file import landing_entries, parse_plan
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.notes.note import Note
from tests.support.effort import draws

LANDING: dict[str, Any] = {
    "type": "ComplexItem", "complexItemType": "fwLandingPattern", "landCoordinate": [36.6, -84.38, 0.0],
    "landingApproachCoordinate": [36.61, -84.38, 40.0], "altitudesAreRelative": True, "loiterRadius": 75,
    "loiterClockwise": True, "useLoiterToAlt": True,
}  # fmt: skip


def told(entry: dict[str, Any]) -> list[tuple[int, int, list[Any]]]:
    entries = landing_entries(entry)
    assert entries is not None
    return [(e["command"], e["frame"], e["params"]) for e in entries]


def test_a_landing_pattern_is_a_start_a_loiter_to_altitude_and_a_landing() -> None:
    assert told(LANDING) == [
        (189, 2, [0, 0, 0, 0, 0, 0, 0]),
        (31, 3, [1, 75, 0, 1, 36.61, -84.38, 40.0]),
        (21, 3, [0, 0, 0, 0, 36.6, -84.38, 0.0]),
    ]


def test_a_pattern_turns_left_with_a_negative_radius_and_a_vtol_lands_as_one() -> None:
    left = told(LANDING | {"loiterClockwise": False, "complexItemType": "vtolLandingPattern"})
    assert left[1][2][1] == -75
    assert left[2][0] == 85


def test_a_pattern_without_a_loiter_has_a_way_point_and_its_wishes_come_before() -> None:
    wishes = {"useLoiterToAlt": False, "useDoChangeSpeed": True, "finalApproachSpeed": 12, "stopTakingPhotos": True,
              "stopVideoPhotos": True}  # fmt: skip
    entries = told(LANDING | wishes)
    assert [command for command, _, _ in entries] == [189, 178, 206, 2001, 2501, 16, 21]
    assert entries[1][2][:3] == [1, 12, -1]


@pytest.mark.parametrize(
    ("given_", "frames"),
    [
        ({"altitudesAreRelative": False}, [0, 0]),
        ({"altitudesAreRelative": None, "loiterAltitudeRelative": False, "landingAltitudeRelative": True}, [0, 3]),
        ({"altitudesAreRelative": None}, [3, 3]),
    ],
)
def test_altitudes_are_of_home_or_of_the_sea_as_the_pattern_says(given_: dict[str, Any], frames: list[int]) -> None:
    assert [frame for _, frame, _ in told(LANDING | given_)[1:]] == frames


@pytest.mark.parametrize("lost", ["landCoordinate", "landingApproachCoordinate"])
def test_a_pattern_without_its_places_is_none(lost: str) -> None:
    assert landing_entries({k: v for k, v in LANDING.items() if k != lost}) is None
    assert landing_entries(LANDING | {lost: [36.6, -84.38]}) is None


def test_an_older_pattern_names_its_approach_a_loiter() -> None:
    older = {k: v for k, v in LANDING.items() if k != "landingApproachCoordinate"}
    assert told(older | {"loiterCoordinate": LANDING["landingApproachCoordinate"]}) == told(LANDING)


# -- fences and rally points --------------------------------------------------------------------------------------

PLACES = st.tuples(st.integers(-900_000_000, 900_000_000), st.integers(-1_800_000_000, 1_800_000_000))
CIRCLES = st.builds(
    lambda inside, at, r: [MissionItem(5003 if inside else 5004, 0, (float(r), 0.0, 0.0, 0.0), *at)],
    st.booleans(), PLACES, st.integers(1, 100_000),
)  # fmt: skip
POLYGONS = st.builds(
    lambda inside, at: [MissionItem(5001 if inside else 5002, 0, (float(len(at)), 0.0, 0.0, 0.0), *p) for p in at],
    st.booleans(), st.lists(PLACES, min_size=3, max_size=7),
)  # fmt: skip


@settings(max_examples=draws(100))
@given(st.lists(CIRCLES, max_size=4), st.lists(POLYGONS, max_size=4))
def test_a_fence_is_read_as_it_was_written_circles_first(
    circles: list[list[MissionItem]], polygons: list[list[MissionItem]]
) -> None:
    in_file = [item for shape in (*circles, *polygons) for item in shape]
    mixed = [item for shape in (*polygons, *circles) for item in shape]
    notes: list[str] = []
    assert list(fence_items(fence_json(mixed), "geoFence", notes)) == in_file
    assert notes == []


def test_a_polygon_that_lacks_corners_cannot_be_written() -> None:
    corner = MissionItem(5001, 0, (3.0, 0.0, 0.0, 0.0), 1, 2)
    with pytest.raises(InputError, match="whole polygons and circles"):
        fence_json([corner, corner])


def test_every_mistake_of_a_fence_is_told_with_its_key_and_only_so_many() -> None:
    circles = [{"inclusion": True, "circle": {"center": [91, 0], "radius": 5}}, {"circle": {}}]
    polygons = [{"inclusion": False, "polygon": [[1, 2], [3, 4]]}]
    with pytest.raises(InputError) as caught:
        fence_items({"circles": circles, "polygons": polygons}, "f", [])
    where = [p.where for p in caught.value.problems]
    assert where == ["f.circles[0].circle.center", "f.circles[1]", "f.polygons[0].polygon"]
    with pytest.raises(InputError) as caught:
        fence_items({"circles": [{}] * 100_000}, "f", [])
    assert len(caught.value.problems) <= MAX_PROBLEMS


def test_a_breach_return_point_is_told_as_not_read() -> None:
    notes: list[Note] = []
    assert fence_items({"breachReturn": [36.6, -84.3, 50]}, "geoFence", notes) == ()
    assert [str(note) for note in notes] == ["the file's fence has a breach return point, which was not read"]


def test_rally_points_are_read_as_they_were_written() -> None:
    points = tuple(
        MissionItem(5100, 3, (0.0, 0.0, 0.0, 0.0), 366_000_000 + n, -843_800_000, 50.5 + n) for n in range(3)
    )
    assert rally_items(rally_json(points), "rallyPoints") == points
    for bad in ([36.6, -84.3], [36.6, -84.3, None], "here"):
        with pytest.raises(InputError, match=r"rallyPoints\.points\[0\]"):
            rally_items({"points": [bad]}, "rallyPoints")


def test_what_of_a_section_is_not_read_is_named() -> None:
    circle = {"circle": {}, "inclusion": True, "version": 1}
    assert unread_keys({"version": 2, "circles": [circle], "polygons": []}, FENCE_KEYS, 2, "geoFence") == ""
    odd = {"version": 2, "ceiling": 120, "empty": [], "circles": [circle | {"height": 5, "version": 3}]}
    assert unread_keys(odd, FENCE_KEYS, 2, "geoFence") == (
        "geoFence.ceiling, geoFence.circles[0].height, geoFence.circles[0] of version 3"
    )
    assert unread_keys({"version": 9, "a": 1}, FENCE_KEYS, 2, "geoFence") == "geoFence of version 9 (a)"
    assert unread_keys([1], FENCE_KEYS, 2, "geoFence") == "geoFence is no object"


@pytest.mark.parametrize(
    ("plan", "words"),
    [
        ({"groundStation": "QGroundControl", "items": [], "version": "1.0"}, r"old QGroundControl .* save it again"),
        ({"fileType": "GeoFence", "version": 1}, "one of 'GeoFence': give the file of the mission"),
    ],
)
def test_another_json_file_of_a_ground_station_is_named_with_a_cure(plan: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        parse_plan(json.dumps(plan), autopilot=None, where="a.mission")


@pytest.mark.parametrize(
    ("kind", "words"), [("survey", "save it again"), ("StructureScan", "read it back with `gcsplan download`")]
)
def test_a_complex_item_without_its_way_points_is_refused_with_a_cure(kind: str, words: str) -> None:
    entry = {"type": "ComplexItem", "complexItemType": kind, "version": 3}
    mission = {
        "version": 2, "firmwareType": 12, "vehicleType": 2, "plannedHomePosition": [36.6, -84.4, 0], "items": [entry],
    }  # fmt: skip
    with pytest.raises(InputError, match=words):
        parse_plan(json.dumps({"fileType": "Plan", "version": 1, "mission": mission}), autopilot=None, where="f")
