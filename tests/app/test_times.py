"""Every time of a mission is one number: in table, JSON, CSV, report, check of the written file, and rehearsal."""

from __future__ import annotations

import csv
import html
import io
import math
import re
from datetime import UTC, datetime
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import Any

import pytest
import yaml

from gcsplan.app.checking import check_files, more_of
from gcsplan.app.model import Plan, VehiclePlan
from gcsplan.app.outputs import outputs_of, report_of, summary_of
from gcsplan.app.pipeline import plan
from gcsplan.app.rehearsing import rehearse
from gcsplan.check.verdict import by_item
from gcsplan.cli.console import _plan_row
from gcsplan.fleet.arrival import Slot
from gcsplan.fleet.motion import TimedPath
from gcsplan.mission_file import load_mission
from gcsplan.units import duration
from tests.support.paths import MISSIONS
from tests.support.shown import seconds

SAME_S = 1e-6
"""Seconds by which two sums of the same times may differ."""


def _craft(name: str, sysid: int, **more: Any) -> dict[str, Any]:
    return {"name": name, "sysid": sysid, "autopilot": "arducopter", "speed_m_s": [3, 10]} | more


FLAT: dict[str, Any] = {
    "version": 1, "name": "times", "frame": {"origin": [36.6, -84.3], "amsl_m": 0}, "terrain": {"flat_m": 0},
    "limits": {"min_agl_m": 40, "max_climb_deg": 30},
}  # fmt: skip
MOTION = {"climb_m_s": 2.5, "descent_m_s": 1.5, "accel_m_s2": 1.5, "leg_jerk_m_s3": 1.0, "corner_accel_m_s2": 2.5}
VALLEY: dict[str, Any] = {
    "version": 1, "name": "valley", "terrain": {"dem": "sample:jacksboro", "vertical_datum": "EGM96"},
    "limits": {"min_agl_m": 60, "horizontal_clearance_m": 30, "track_error_m": 3, "altitude_error_m": 5,
               "max_climb_deg": 15},
}  # fmt: skip
UP = {"start": [36.6175, -84.3892], "goal": [36.6250, -84.3800]}

CASES: dict[str, Any] = {
    "jacksboro": MISSIONS / "jacksboro.yaml",
    "jacksboro-wing": MISSIONS / "jacksboro-wing.yaml",
    "fleet-4": MISSIONS / "fleet-4.yaml",
    "a hold at the gate": FLAT | {
        "vehicles": [
            _craft("west", 1, start={"east_m": -500, "north_m": 0}, goal={"east_m": 500, "north_m": 0}, **MOTION),
            _craft("south", 2, start={"east_m": 0, "north_m": -500}, goal={"east_m": 0, "north_m": 500}, **MOTION,
                   energy={"hover_w": 400}),
        ],
        "arrival": {"mode": "sequence", "order": ["west", "south"], "interval_s": 300, "separation_m": 30,
                    "hold": "gate"},
    },
    "one that leaves later": FLAT | {
        "vehicles": [
            _craft("late", 1, start={"east_m": 0, "north_m": 0}, goal={"east_m": 300, "north_m": 0},
                   via=[{"east_m": 150, "north_m": 60}], **MOTION),
        ],
        "arrival": {"mode": "together", "arrive_s": 400, "separation_m": 30},
    },
    "terrain frame and return": VALLEY | {
        "vehicles": [_craft("over", 1, end="rtl", rtl_rel_home_m=300, max_climb_deg=60, **UP)],
        "altitude_frame": "terrain",
    },
    "px4 that stays": VALLEY | {"vehicles": [_craft("px4", 1, autopilot="px4", end="loiter", **UP)]},
    "a wing slower than it can": FLAT | {
        "limits": {"min_agl_m": 40, "max_climb_deg": 10, "track_error_m": 10},
        "vehicles": [
            _craft("wing", 1, autopilot="arduplane", speed_m_s=[12, 20], turn_radius_m=100, end="land",
                   start={"east_m": 0, "north_m": 0}, goal={"east_m": 3000, "north_m": 0},
                   via=[{"east_m": 1500, "north_m": 800}]),
        ],
        "arrival": {"mode": "together", "arrive_s": 260, "separation_m": 30},
    },
    "a wing that returns": FLAT | {
        "limits": {"min_agl_m": 40, "max_climb_deg": 10, "track_error_m": 10},
        "vehicles": [
            _craft("back", 1, autopilot="arduplane", speed_m_s=[12, 20], turn_radius_m=100, end="rtl",
                   rtl_rel_home_m=150, start={"east_m": 0, "north_m": 0}, goal={"east_m": 3000, "north_m": 0}),
        ],
    },
    "a paper's": MISSIONS / "papers" / "ib-abc-sequence.yaml",
}  # fmt: skip

SLOW = {"fleet-4", "a paper's"}
FLOWN_QUICKLY = {"a hold at the gate", "one that leaves later", "terrain frame and return"}


@cache
def _planned(case: str) -> tuple[Any, Plan]:
    asked = CASES[case]
    source = load_mission(asked if isinstance(asked, Path) else "times.yaml", **(
        {} if isinstance(asked, Path) else {"text": yaml.safe_dump(asked)}
    ))  # fmt: skip
    return source, plan(source)


cases = pytest.mark.parametrize(
    "case", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in CASES]
)


def parts(done: Plan) -> list[tuple[VehiclePlan, Slot, TimedPath]]:
    assert done.fleet is not None
    return [(v, done.fleet.slot(v.name), done.fleet.motion(v.name)) for v in done.vehicles]


def text_rows(page: str, title: str) -> list[list[str]]:
    """The cells of each row of the table with ``title``, as text."""
    table = page[page.index(f"<caption>{title}") :].split("</table>")[0]
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", table, re.DOTALL)
    cells = [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row, re.DOTALL) for row in rows]
    return [[html.unescape(re.sub(r"<[^>]+>", "", cell)) for cell in row] for row in cells[1:]]


@cases
def test_the_sum_of_the_legs_is_the_arrival_and_the_motions(case: str) -> None:
    _, done = _planned(case)
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


@cases
def test_table_json_csv_and_report_say_the_same_times(case: str) -> None:
    _, done = _planned(case)
    files, told = outputs_of(done), {v["name"]: v for v in summary_of(done)["vehicles"]}
    rows = list(csv.DictReader(io.StringIO(files["profile.csv"])))
    page = report_of(done)
    decimals = 1 if len(done.vehicles) > 1 else 0  # the order of a fleet may hang on tenths
    off_s = 0.501 * 10.0**-decimals
    for v, slot, _ in parts(done):
        legs, clock = v.verdict.legs, v.verdict.clock_s(slot)
        assert told[v.name]["arrive_s"] == slot.arrive_s
        assert seconds(_plan_row(v, done.fleet)["arrives"]) == pytest.approx(slot.arrive_s, abs=off_s)
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
        ends = [clock[n - 1] for n in accumulate(item.stretches for item in items)]
        assert [row[-1] for row in table] == [duration(at) for at in ends]
        assert [seconds(row[-1]) for row in table] == pytest.approx(ends, abs=0.501)
        assert [seconds(row[-2]) for row in table] == pytest.approx([item.time_s for item in items], abs=0.501)


@cases
def test_the_check_of_the_written_file_says_the_same_times(case: str, tmp_path: Path) -> None:
    source, done = _planned(case)
    files = outputs_of(done)
    for v, _, _ in parts(done):
        for ending in (".waypoints", ".plan"):
            path = tmp_path / f"{v.name}{ending}"
            path.write_text(files[path.name], encoding="utf-8")
            [again] = check_files(source, [f"{v.name}={path}"])
            assert again.verdict.arrive_s == pytest.approx(v.verdict.arrive_s, abs=1e-3)
            assert more_of(again)["time_s"] == pytest.approx(v.verdict.time_s, abs=1e-3)
            times = [leg["time_s"] for leg in more_of(again)["legs"]]
            assert times == pytest.approx([leg.time_s for leg in v.verdict.legs], abs=1e-3)


@pytest.mark.parametrize(
    "case", [pytest.param(name, marks=[] if name in FLOWN_QUICKLY else [pytest.mark.slow]) for name in CASES]
)
def test_a_rehearsal_compares_with_the_planned_time(case: str) -> None:
    _, done = _planned(case)
    found = rehearse(done)
    rows = {row["vehicle"]: row for row in found.rows()}
    for performance, (v, slot, _) in zip(found.vehicles, parts(done), strict=True):
        assert performance.planned_s == slot.arrive_s
        off_s = 0.0501 if len(done.vehicles) > 1 else 0.501
        assert seconds(rows[v.name]["planned"]) == pytest.approx(slot.arrive_s, abs=off_s)
        assert performance.as_dict()["planned_arrive_s"] == pytest.approx(slot.arrive_s, abs=1e-6)
        # What flies shares no code with the plan: the model is right to a hundredth.
        assert performance.arrive_s[0] == pytest.approx(slot.arrive_s, rel=0.01, abs=0.5)


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
