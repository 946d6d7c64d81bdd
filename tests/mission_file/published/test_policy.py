"""Missions with published zones: which are no-fly, when, what is said of the others, and how long they take."""

from __future__ import annotations

import json
import math
import random
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.errors import InputError
from gcsplan.mission_file import MissionFile, load_mission
from gcsplan.mission_file.options_world import OpenWorld, WorldOptions
from gcsplan.notes.note import Note
from tests.mission_file.published.made import ed269, volume

MONDAYS = [{"permanent": "NO", "schedule": [{"day": ["MON"], "startTime": "06:00Z", "endTime": "18:00Z"}]}]


def box(lon: float, lat: float, size: float = 0.01, **changes: Any) -> dict[str, Any]:
    """A made volume over a square."""
    ring = [[lon, lat], [lon + size, lat], [lon + size, lat + size], [lon, lat + size], [lon, lat]]
    return volume(horizontalProjection={"type": "Polygon", "coordinates": [ring]}, **changes)


def mission(folder: Path, *zones: Any, entry: Any = None, departure: datetime | None = None, **top: Any) -> MissionFile:
    """A mission of 2 km at 47 N 8 E with a published file of zones."""
    if zones:
        (folder / "zones.json").write_text(json.dumps({"features": list(zones)}))
    whole = {
        "version": 1, "terrain": {"flat_m": 400}, "limits": {"min_agl_m": 40, "max_agl_m": 100},
        "no_fly": [{"file": str(folder / "zones.json")} | (entry or {})],
        "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 9],
                      "start": [47.0, 8.0], "goal": [47.02, 8.0]}],
    }  # fmt: skip
    return load_mission(whole | top, departure=departure)


def names(found: MissionFile) -> set[str]:
    return {z.name for z in found.zones}


def notes(found: MissionFile) -> str:
    return "\n".join(map(str, found.notes))


FREE = ed269(box(8.02, 47.0), restriction="NO_RESTRICTION", name="free", identifier="F1")
ASK = ed269(box(8.02, 47.01), restriction="REQ_AUTHORISATION", name="ask", identifier="A1")
SHUT = ed269(box(8.04, 47.0), restriction="PROHIBITED", name="shut", identifier="P1")
WEEKLY = ed269(box(8.04, 47.01), applicability=MONDAYS, name="weekly", identifier="W1")
FAR = ed269(box(12.0, 47.0), restriction="NO_RESTRICTION", name="far")


def test_all_that_restricts_is_no_fly_and_the_rest_is_named(tmp_path: Path) -> None:
    found = mission(tmp_path, FREE, ASK, SHUT, WEEKLY, FAR)
    assert names(found) == {"ask", "shut", "weekly"}
    assert Note("zones_restrict_nothing", file="zones.json", zones=("free",)) in found.notes
    assert Note("zones_unused_far_away", count=1) in found.notes
    assert found.hours is None


def test_kinds_and_authorisations_are_the_mission_s(tmp_path: Path) -> None:
    found = mission(tmp_path, FREE, ASK, SHUT, entry={"kinds": ["req_authorization", "NO_RESTRICTION"]})
    assert names(found) == {"free", "ask"}
    assert "the mission uses other kinds alone (req_authorization, NO_RESTRICTION): shut" in notes(found)
    found = mission(tmp_path, ASK, SHUT, entry={"authorised": ["A1", "shut"]})
    assert not names(found)
    assert "authorised to enter them: ask, shut" in notes(found)


def test_an_authorisation_for_a_zone_that_is_not_used_is_no_slip(tmp_path: Path) -> None:
    assert names(mission(tmp_path, FREE, SHUT, entry={"authorised": ["F1"]})) == {"shut"}


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"kinds": ["PROHIBTED"]}, "no_fly[0].kinds[0]: the file has no kind 'PROHIBTED'; did you mean PROHIBITED?"),
        ({"kinds": []}, "no_fly[0].kinds: must have at least 1 values"),
        ({"authorised": ["A1", "A2"]}, "no_fly[0].authorised[1]: no zone of the file has the identifier or name 'A2'"),
        ({"name": "x"}, "no_fly[0].name: stands in the file itself"),
        ({"flight_level_error_m": -1}, "no_fly[0].flight_level_error_m: must be at least 0"),
    ],
)
def test_a_slip_in_the_policy_is_refused(tmp_path: Path, entry: Any, words: str) -> None:
    with pytest.raises(InputError) as error:
        mission(tmp_path, ASK, entry=entry)
    assert words in str(error.value)


@pytest.mark.parametrize("key", ["kinds", "authorised"])
def test_a_policy_needs_a_file_of_an_authority(tmp_path: Path, key: str) -> None:
    for entry in ({"center": [47.1, 8.1], "radius_m": 50}, {"file": str(tmp_path / "plain.geojson")}):
        ring = [[8.1, 47.1], [8.2, 47.1], [8.2, 47.2], [8.1, 47.1]]
        (tmp_path / "plain.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
        with pytest.raises(InputError, match="of an authority"):
            mission(tmp_path, no_fly=[entry | {key: ["x"]}])


def test_a_zone_with_times_is_left_out_by_name_and_only_outside_them(tmp_path: Path) -> None:
    assert "weekly" in names(mission(tmp_path, WEEKLY, SHUT))  # no date: always
    assert "weekly" in names(mission(tmp_path, WEEKLY, SHUT, at="2026-11-23T17:00Z"))
    found = mission(tmp_path, WEEKLY, SHUT, at="2026-11-24T17:00Z")
    assert names(found) == {"shut"}
    assert found.hours is not None
    hours = "2026-11-24 17:00Z to 19:00Z"
    assert Note("zones_out_of_hours", file="zones.json", hours=hours, zones=("weekly",)) in found.notes
    monday = datetime(2026, 11, 23, 18, 20, tzinfo=UTC)
    assert "weekly" in names(mission(tmp_path, WEEKLY, SHUT, departure=monday))  # vehicles rise before the common start
    assert "weekly" not in names(mission(tmp_path, WEEKLY, SHUT, departure=monday + timedelta(hours=1)))
    with pytest.raises(InputError, match="mission: at: '10:00' is no time"):
        mission(tmp_path, WEEKLY, at="10:00")


@pytest.mark.slow
def test_a_flight_that_outlasts_the_hours_is_refused(tmp_path: Path) -> None:
    short = mission(tmp_path, WEEKLY, at=["2026-11-23T18:01Z", "2026-11-23T18:03Z"])
    with pytest.raises(InputError, match=r"but uav1 flies from 2026-11-23 18:01Z to 2026-11-23 18:0[5-9]Z; write at:"):
        plan(short)
    assert plan(mission(tmp_path, WEEKLY, at="2026-11-23T18:01Z")).vehicles[0].verdict.safe
    assert plan(mission(tmp_path, SHUT, at=["2026-11-23T18:01Z", "2026-11-23T18:03Z"])).vehicles  # nothing is left out
    with pytest.raises(InputError, match="zones were left out"):
        plan(mission(tmp_path, WEEKLY, at="2026-11-24"), gate_utc=datetime(2026, 11, 25, 0, 30, tzinfo=UTC))
    with pytest.raises(InputError, match="zones were left out"):
        plan(mission(tmp_path, WEEKLY, at="2026-11-24"), gate_utc=datetime(2026, 11, 23, 22, 0, tzinfo=UTC))


ODD = {"lowerLimit": 50, "upperVerticalReference": "QNE"}
NEAR = ed269(box(8.02, 47.0, **ODD), name="near")
BENT = ed269(
    volume(horizontalProjection={"type": "Polygon", "coordinates": [[[8.005, 47.0], [8.03, 47.0], [8.02, 47.0]]]}),
    name="bent",
)
LOST = ed269(volume(horizontalProjection={"type": "Circle", "center": [8.02, 47.0]}), name="lost")
FAR_AWAY = ed269(box(40.0, 47.0, **ODD), name="far away")


def test_limits_that_are_not_understood_count_from_the_ground_up_without_end(tmp_path: Path) -> None:
    found = mission(tmp_path, SHUT, NEAR, FAR_AWAY)
    [near] = [z for z in found.zones if z.name == "near"]
    assert (near.floor, near.ceiling) == (None, None)
    assert "they count from the ground up without end: near (upperLimit 120 M QNE cannot be read" in notes(found)
    assert "not understood, and too far from the mission to matter: far away" in notes(found)
    unused = ed269(box(8.02, 47.0, **ODD), name="odd", restriction="NO_RESTRICTION")
    assert "restricts nothing: odd" in notes(mission(tmp_path, SHUT, unused))


def test_a_kind_that_is_not_understood_is_no_fly_whichever_kinds_are(tmp_path: Path) -> None:
    strange = ed269(box(8.02, 47.0), restriction=None, name="strange")
    for entry in ({}, {"kinds": ["PROHIBITED"]}):
        found = mission(tmp_path, SHUT, strange, entry=entry)
        assert names(found) == {"shut", "strange"}
        assert "strange (restriction must be text, given None)" in notes(found)


@pytest.mark.parametrize(("zone", "place"), [(LOST, "nowhere"), (BENT, "here")])
def test_an_outline_that_is_not_understood_refuses_where_it_may_lie(tmp_path: Path, zone: Any, place: str) -> None:
    with pytest.raises(InputError, match=f"zone '{zone['name']}'"):
        mission(tmp_path, SHUT, zone)
    far = json.loads(json.dumps(zone).replace("8.0", "40.0"))
    if place == "nowhere":
        with pytest.raises(
            InputError, match=r"a radius in metres, given None; or leave it out by name \(on_bad: skip\)"
        ):
            mission(tmp_path, SHUT, far)
    else:
        assert "too far from the mission to matter: bent" in notes(mission(tmp_path, SHUT, far))


def test_a_mission_refuses_or_skips_what_is_not_understood(tmp_path: Path) -> None:
    for zone in (NEAR, LOST, BENT, FAR_AWAY):
        with pytest.raises(InputError, match=f"zone '{zone['name']}'"):
            mission(tmp_path, SHUT, zone, entry={"on_bad": "refuse"})
    with pytest.raises(InputError, match="zone 'lost'"):
        mission(tmp_path, SHUT, LOST, entry={"on_bad": "strict"})
    found = mission(tmp_path, SHUT, NEAR, LOST, BENT, entry={"on_bad": "skip"})
    assert names(found) == {"shut", "near"}
    assert "left out, because it is not understood: features[2].geometry[0]: zone 'lost'" in notes(found)
    assert "left out, because their outlines are not understood: bent" in notes(found)
    with pytest.raises(InputError, match="zone 'lost'"):
        mission(tmp_path, LOST, entry={"on_bad": "skip"})  # nothing of the file is read
    with pytest.raises(InputError, match=r"no_fly\[0\].ignore: is for files of your own"):
        mission(tmp_path, SHUT, entry={"ignore": ["points"]})
    with pytest.raises(InputError, match=r"no_fly\[0\].on_bad: belongs to a file"):
        mission(tmp_path, no_fly=[{"center": [47.1, 8.1], "radius_m": 50, "on_bad": "skip"}])
    with pytest.raises(InputError, match=r"no_fly\[0\].on_bad: must be one of refuse, strict, skip"):
        mission(tmp_path, SHUT, entry={"on_bad": "ignore"})


def test_the_options_of_check_judge_as_a_mission_file_does(tmp_path: Path) -> None:
    mission(tmp_path, FREE, SHUT)
    options = WorldOptions(terrain={"flat_m": 400}, zones=(str(tmp_path / "zones.json"),), limits={"min_agl_m": 40})
    world, inputs = OpenWorld(options).around([(47.0, 8.0), (47.02, 8.0)])
    assert [z.name for z in world.airspace.zones] == ["shut"]
    free = Note("zones_restrict_nothing", file="zones.json", zones=("free",))
    assert free in inputs["notes"]  # type: ignore[operator]
    mission(tmp_path, FREE, ed269(box(9.5, 47.0, upperVerticalReference="QNE")))
    OpenWorld(options).around([(47.0, 8.0), (47.02, 8.0)])
    (tmp_path / "zones.json").write_text(json.dumps([SHUT, BENT]))
    with pytest.raises(InputError, match="zone 'bent'"):
        OpenWorld(options).around([(47.0, 8.0), (47.02, 8.0)])
    OpenWorld(replace(options, on_bad="skip")).around([(47.0, 8.0), (47.02, 8.0)])


def many(count: int, corners: int) -> list[Any]:
    """Zones as they lie over a country of 400 km by 200 km."""
    rng = random.Random(7)
    zones = []
    for i in range(count):
        lat, lon, size = rng.uniform(46.2, 47.8), rng.uniform(6.0, 10.5), rng.uniform(0.01, 0.04)
        turns = [2.0 * math.pi * k / corners for k in range(corners)]
        ring = [[lon + size * math.cos(t), lat + 0.7 * size * math.sin(t)] for t in turns]
        shape = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
        datum = rng.choice(["AGL", "AMSL"])
        kind = rng.choice(["REQ_AUTHORISATION", "PROHIBITED", "NO_RESTRICTION"])
        one = volume(horizontalProjection=shape, upperLimit=rng.choice([300, 99999]), upperVerticalReference=datum)
        if math.hypot(lat - 47.01, lon - 8.0) > 2.0 * size or kind == "NO_RESTRICTION":
            zones.append(ed269(one, name=f"zone {i}", identifier=f"Z{i}", restriction=kind))
    return zones


@pytest.mark.nightly
def test_1200_zones_add_at_most_a_second(tmp_path: Path) -> None:
    zones = many(1200, 40)

    def seconds(*some: Any) -> float:
        mission(tmp_path, *some)  # writes the file, and imports and compiles what is needed
        taken = []
        for _ in range(5):
            begin = time.process_time()
            plan(mission(tmp_path))
            taken.append(time.process_time() - begin)
        return min(taken)

    assert seconds(*zones) - seconds(SHUT) < 1.0
