"""The last plan of a folder, the mission on board, and what changed since."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gcsplan.app.api import write
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import report_of
from gcsplan.app.plan.earlier import LAST_PLAN, EarlierMission, differences, last_plan
from gcsplan.app.plan.model import Plan
from tests.support.batches import mission


def planned(folder: Path, **changes: Any) -> Plan:
    file = folder / "field.yaml"
    file.write_text(mission(**changes))
    return plan(file)


ZONE = {"no_fly": [{"name": "crane", "center": [47.0, 8.01], "radius_m": 80}]}


@pytest.fixture(name="first")
def write_first(tmp_path: Path) -> Plan:
    first = planned(tmp_path)
    write(first, tmp_path / "out")
    return first


def test_the_same_plan_again_has_no_difference(tmp_path: Path, first: Plan) -> None:
    earlier, notes = last_plan(first.source, tmp_path / "out")
    [difference] = differences(first, earlier).values()
    assert notes == []
    assert (difference.equal, difference.moved, difference.left_m) == (True, (), 0.0)
    assert difference.new == difference.gone == ()
    assert difference.before == pytest.approx(difference.after, rel=1e-6)


@pytest.mark.slow
def test_a_new_zone_moves_legs_and_the_earlier_mission_breaks_it(tmp_path: Path, first: Plan) -> None:
    second = planned(tmp_path, **ZONE)
    [difference] = differences(second, last_plan(second.source, tmp_path / "out")[0]).values()
    assert difference.since == LAST_PLAN
    assert difference.moved
    assert difference.left_m is not None
    clear_m = 80.0 + second.source.vehicles[0].vehicle.limits.horizontal_clearance_m
    assert clear_m < difference.left_m < clear_m + 20.0
    assert "crane" in str(difference.breaks[0])
    assert difference.after["length_m"] > difference.before["length_m"]  # type: ignore[operator]
    page = report_of(second, differences=[difference])
    assert "What changed" in page
    assert str(difference.headline.text()).split(",")[0] in page


@pytest.mark.slow
def test_the_mission_on_board_is_compared_without_a_summary(tmp_path: Path, first: Plan) -> None:
    second = planned(tmp_path, **ZONE)
    there = {"uav1": EarlierMission("udpout:127.0.0.1:14550", first.vehicles[0].mission)}
    [difference] = differences(second, there).values()
    assert "since udpout:127.0.0.1:14550" in str(difference.headline)
    assert json.loads(json.dumps(difference.as_dict()))["moved"]


def test_a_last_plan_that_cannot_be_read_is_a_note(tmp_path: Path, first: Plan) -> None:
    (tmp_path / "out" / "uav1.waypoints").write_text("nothing")
    earlier, [note] = last_plan(first.source, tmp_path / "out")
    assert earlier == {}
    assert note.code == "last_plan_unread"
    (tmp_path / "out" / "summary.json").write_text("[1]")
    assert last_plan(first.source, tmp_path / "elsewhere") == ({}, [])


def test_a_broken_summary_leaves_the_missions(tmp_path: Path, first: Plan) -> None:
    (tmp_path / "out" / "summary.json").write_text("[1]")
    earlier, _ = last_plan(first.source, tmp_path / "out")
    assert earlier["uav1"].notes is None
    assert differences(first, earlier)["uav1"].equal
