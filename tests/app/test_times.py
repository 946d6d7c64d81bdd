"""Every time of a mission is one number: in table, JSON, CSV, report, check of the written file, and rehearsal."""

from __future__ import annotations

import csv
import io
import math
import re
from datetime import UTC, datetime
from itertools import accumulate
from pathlib import Path

import pytest
import yaml

from gcsplan.app.check.files import check_files, more_of
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of, report_of, summary_of
from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.check.verdict import by_item
from gcsplan.cli.output.console import plan_row
from gcsplan.fleet.arrival import Slot
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.mission_file import load_mission
from gcsplan.units import duration
from tests.support.plans import CASES, FLOWN_LONG, cases, flown, planned, reported, text_rows, written
from tests.support.shown import seconds

SAME_S = 1e-6
"""Seconds by which two sums of the same times may differ."""

pytestmark = pytest.mark.xdist_group("plans")  # one process plans the missions, not three


def parts(done: Plan) -> list[tuple[VehiclePlan, Slot, TimedPath]]:
    assert done.fleet is not None
    return [(v, done.fleet.slot(v.name), done.fleet.motion(v.name)) for v in done.vehicles]


@pytest.mark.first_quick
@cases
def test_the_sum_of_the_legs_is_the_arrival_and_the_motions(case: str) -> None:
    _, done = planned(case)
    for v, slot, motion in parts(done):
        assert motion.arrive_s == pytest.approx(slot.arrive_s, abs=SAME_S)
        climb_s = v.verdict.legs[0].time_s if slot.route.start_ground_amsl_m is None else 0.0  # not in a paper's times
        assert slot.depart_s + v.verdict.arrive_s - climb_s == pytest.approx(slot.arrive_s, abs=SAME_S)
        assert motion.end_s - motion.begin_s == pytest.approx(v.verdict.time_s - climb_s, abs=SAME_S)
        assert v.verdict.time_s == pytest.approx(math.fsum(leg.time_s for leg in v.verdict.legs), abs=SAME_S)
        # Item by item: columns, corners and holds have the same share in both.
        assert motion.pieces is not None
        until = dict(zip(motion.pieces.tolist(), motion.times_s[1:].tolist(), strict=True))
        clock = {leg.seq: at for leg, at in zip(v.verdict.legs, v.verdict.clock_s(slot), strict=True)}
        takeoff = v.verdict.legs[0].seq
        for seq in until.keys() - ({takeoff} if slot.hold_s else set()):
            assert slot.depart_s + clock[seq] == pytest.approx(until[seq], abs=SAME_S), seq


@pytest.mark.first_quick
@cases
def test_table_json_csv_and_report_say_the_same_times(case: str) -> None:
    _, done = planned(case)
    files, told = written(case), {v["name"]: v for v in summary_of(done)["vehicles"]}
    rows = list(csv.DictReader(io.StringIO(files["profile.csv"])))
    page = reported(case)
    decimals = 1 if len(done.vehicles) > 1 else 0  # the order of a fleet may hang on tenths
    off_s = 0.501 * 10.0**-decimals
    for v, slot, _ in parts(done):
        legs, clock = v.verdict.legs, v.verdict.clock_s(slot)
        assert told[v.name]["arrive_s"] == slot.arrive_s
        assert seconds(plan_row(v, done.fleet)["arrives"]) == pytest.approx(slot.arrive_s, abs=off_s)
        until = {leg.seq: slot.depart_s + at for leg, at in zip(legs, clock, strict=True)}
        mine = {int(r["seq"]): float(r["time_s"]) for r in rows if r["vehicle"] == v.name and r["time_s"]}
        assert mine == pytest.approx(until, abs=0.00501)
        last = max(i for i, leg in enumerate(legs) if leg.on_path)
        assert mine[legs[last].seq] == pytest.approx(slot.arrive_s, abs=0.00501)
        [shown] = re.findall(
            r"<dt>arrives</dt><dd>([^<]*)<small>", page.split(f"</i>{v.name}<span")[1].split("</dl>")[0]
        )
        assert seconds(shown) == pytest.approx(slot.arrive_s, abs=off_s)
        table = text_rows(page, f"Legs of {v.name},")
        items = list(by_item(legs))
        ends = [clock[n - 1] for n in accumulate(stretches for _, stretches in items)]
        assert [row[-1] for row in table] == [duration(at) for at in ends]
        assert [seconds(row[-1]) for row in table] == pytest.approx(ends, abs=0.501)
        assert [seconds(row[-2]) for row in table] == pytest.approx([item.time_s for item, _ in items], abs=0.501)
        drawn = re.findall(
            rf'"vehicle"><value>{v.name}</value>.*?"number"><value>(\d+)</value>.*?"time_s"><value>([\d.]+)<',
            files["mission.kml"],
        )
        in_kml = {int(seq): float(at) for seq, at in drawn}
        assert in_kml
        assert {seq: at for seq, at in in_kml.items() if seq in until} == pytest.approx(until, abs=0.0501)


@pytest.mark.slow
@cases
def test_the_check_of_the_written_file_says_the_same_times(case: str, tmp_path: Path) -> None:
    source, done = planned(case)
    files = written(case)
    for v, _, _ in parts(done):
        for ending in (".waypoints", ".plan"):
            path = tmp_path / f"{v.name}{ending}"
            path.write_text(files[path.name], encoding="utf-8")
            [again] = check_files(source, [f"{v.name}={path}"])
            assert again.verdict.arrive_s == pytest.approx(v.verdict.arrive_s, abs=1e-3)
            assert more_of(again)["time_s"] == pytest.approx(v.verdict.time_s, abs=1e-3)
            times = [leg["time_s"] for leg in more_of(again)["legs"]]
            assert times == pytest.approx([leg.time_s for leg in v.verdict.legs], abs=1e-3)


@pytest.mark.slow
@pytest.mark.nightly_but(*CASES.keys() - FLOWN_LONG)
@pytest.mark.parametrize("case", CASES)
def test_a_rehearsal_compares_with_the_planned_time(case: str) -> None:
    _, done = planned(case)
    found = flown(case)
    rows = {row["vehicle"]: row for row in found.rows()}
    for performance, (v, slot, _) in zip(found.vehicles, parts(done), strict=True):
        assert performance.planned_s == slot.arrive_s
        off_s = 0.0501 if len(done.vehicles) > 1 else 0.501
        assert seconds(rows[v.name]["planned"]) == pytest.approx(slot.arrive_s, abs=off_s)
        assert performance.as_dict()["planned_arrive_s"] == pytest.approx(slot.arrive_s, abs=1e-6)
        # What flies shares no code with the plan: the model is right to a hundredth.
        assert performance.arrive_s[0] == pytest.approx(slot.arrive_s, rel=0.01, abs=0.5)


@pytest.mark.slow
def test_a_wait_until_a_time_of_day_counts_in_every_output() -> None:
    source = load_mission("times.yaml", text=yaml.safe_dump(CASES["a hold at the gate"]))
    done = plan(source, gate_utc=datetime(2026, 3, 1, 12, 0, tzinfo=UTC))
    page, rows = report_of(done), list(csv.DictReader(io.StringIO(outputs_of(done)["profile.csv"])))
    for v, slot, motion in parts(done):
        assert slot.hold_s >= 30.0
        assert v.verdict.gate_s == 0.0
        clock = v.verdict.clock_s(slot)
        last = max(i for i, leg in enumerate(v.verdict.legs) if leg.on_path)
        assert slot.depart_s + clock[last] == pytest.approx(slot.arrive_s, abs=SAME_S)
        assert slot.depart_s + clock[last] == pytest.approx(motion.arrive_s, abs=SAME_S)
        mine = {int(r["seq"]): float(r["time_s"]) for r in rows if r["vehicle"] == v.name and r["time_s"]}
        assert mine[v.verdict.legs[last].seq] == pytest.approx(slot.arrive_s, abs=0.00501)
        assert [row[-1] for row in text_rows(page, f"Legs of {v.name},")] == [duration(at) for at in clock]
