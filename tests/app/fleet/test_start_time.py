"""Gates at a time of day: whole seconds that everybody reaches early, and refusals of what would wait for a day."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import pairwise

import pytest
import yaml

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.fleet.start_time import SLACK_S, GateTime
from gcsplan.app.output.files import outputs_of, summary_of
from gcsplan.app.plan.model import Plan
from gcsplan.errors import InputError, UsageError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mission_file import load_mission
from tests.app.fleet.test_fleet import CROSS
from tests.support.noted import one

NOW = datetime(2026, 3, 1, 12, 0, 0, tzinfo=UTC)
START = datetime(2026, 3, 1, 23, 59, 0, tzinfo=UTC)


def planned(**vehicle: object) -> Plan:
    vehicles = [CROSS["vehicles"][0], CROSS["vehicles"][1] | vehicle]
    arrival = {"mode": "sequence", "order": ["west", "south"], "interval_s": 30, "separation_m": 30}
    text = yaml.safe_dump(CROSS | {"vehicles": vehicles, "arrival": arrival})
    return plan(load_mission("fleet.yaml", text=text), gate_utc=START)


def test_the_markers_of_the_kml_move_by_the_time_table_from_the_common_start() -> None:
    done = planned()
    files = outputs_of(done)
    assert "gx:Track" not in outputs_of(replace(done, fleet=replace(done.fleet, start_utc=None)))["mission.kml"]
    rows = list(csv.DictReader(io.StringIO(files["profile.csv"])))
    assert done.fleet is not None
    for name, marker in zip(
        ("west", "south"), re.findall("<gx:Track>.*?</gx:Track>", files["mission.kml"], re.S), strict=True
    ):
        when = [datetime.fromisoformat(text) for text in re.findall("<when>(.*?)</when>", marker)]
        assert len(re.findall("<gx:coord>", marker)) == len(when)
        assert when == sorted(when)
        after = [(at - START).total_seconds() for at in when]
        slot = done.fleet.slot(name)
        assert after[0] == pytest.approx(slot.depart_s, abs=2e-3)
        for row in rows:
            if row["vehicle"] == name and row["time_s"]:
                assert min(abs(float(row["time_s"]) - t) for t in after) < 0.01
        assert min(abs(slot.arrive_s - t) for t in after) < 0.01
        assert max(b - a for a, b in pairwise(after)) >= slot.hold_s - 0.01  # it stands at its gate


@pytest.mark.parametrize(
    ("text", "start"),
    [
        ("18:30", datetime(2026, 3, 1, 18, 30, 0, tzinfo=UTC)),
        ("12:01:30", datetime(2026, 3, 1, 12, 1, 30, tzinfo=UTC)),
        ("2026-03-02T01:00:00Z", datetime(2026, 3, 2, 1, 0, 0, tzinfo=UTC)),
        ("2026-03-01T20:00:00+02:00", datetime(2026, 3, 1, 18, 0, 0, tzinfo=UTC)),
    ],
)
def test_times_are_read_in_both_forms(text: str, start: datetime) -> None:
    assert GateTime.parse(text, NOW).start == start


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("11:59:59", "past"), ("12:00:30", "too near"), ("2026-02-28T18:30:00Z", "past"),
        ("2026-03-02T11:00:00Z", "too far"), ("noon", "18:30:00"), ("25:00", "18:30:00"),
    ],
)  # fmt: skip
def test_what_is_near_past_or_far_is_refused(text: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        GateTime.parse(text, NOW)


def test_a_start_that_has_come_near_since_is_refused_before_anything_is_sent() -> None:
    gate = GateTime.parse("12:05:00", NOW)
    gate.require_ahead(NOW + timedelta(seconds=239))
    with pytest.raises(UsageError, match="too near"):
        gate.require_ahead(NOW + timedelta(seconds=241))


def test_every_gate_opens_at_the_planned_second_and_its_vehicle_is_there_early() -> None:
    done = planned()
    assert done.fleet is not None
    for v, slot, motion in zip(done.vehicles, done.fleet.slots, done.fleet.motions, strict=True):
        gate = next(i for i in v.mission.items if i.command == cmd.DELAY)
        assert gate.params[0] == -1.0
        hour, minute, second = (int(x) for x in gate.params[1:])
        opens = datetime(2026, 3, 1, hour, minute, second, tzinfo=UTC)
        opens = opens if opens >= START else opens + timedelta(days=1)  # it may be past midnight
        opens_s = (opens - START).total_seconds()
        at = motion.at([opens_s - SLACK_S + 0.5, opens_s, opens_s + 5.0])
        assert at[0] == pytest.approx(at[1], abs=1e-6)  # it has been waiting
        assert abs(at[2] - at[1]).max() > 1.0  # and goes then
        assert slot.arrive_s == pytest.approx(motion.arrive_s, abs=1e-3)
    west, south = summary_of(done)["vehicles"]
    assert south["arrive_s"] - west["arrive_s"] == pytest.approx(30.0, abs=1.0)
    assert one("gates_open", done.notes).data["spare_s"] == SLACK_S
    # Nobody knows how long it will wait: the user has to take that.
    assert done.vehicles[0].verdict.safe is None


@pytest.mark.parametrize("autopilot", ["px4", "arduplane"])
def test_autopilots_that_know_no_time_of_day_are_refused(autopilot: str) -> None:
    with pytest.raises(InputError, match="ArduCopter's alone"):
        planned(autopilot=autopilot, max_climb_deg=30)
