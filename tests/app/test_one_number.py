"""Every number of a mission is one number: twelve missions through table, JSON, CSV, report, check and rehearsal."""

from __future__ import annotations

import csv
import html
import io
import math
import re
from pathlib import Path
from typing import Any

import pytest

from gcsplan.app.check.files import check_files
from gcsplan.app.check.verdict_json import verdict_of
from gcsplan.app.output.files import summary_of
from gcsplan.app.output.report import render_rehearsal
from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.check.verdict import Verdict, by_item
from gcsplan.cli.output.console import plan_row
from gcsplan.cli.output.verdict_table import verdict_table
from gcsplan.export.summary import write_summary
from gcsplan.figures import floored, steepened
from tests.support.plans import CASES, FLOWN_LONG, SLOW, cases, flown, planned, reported, text_rows, written
from tests.support.shown import number, seconds

pytestmark = pytest.mark.xdist_group("plans")  # one process plans the missions, not three

WIRE_M, WIRE_J = 0.05, 50.0
"""What rounding a mission to its file may change: 1e-7 degrees and centimetres at each of some dozen points."""


def truth(v: VehiclePlan, done: Plan) -> dict[str, Any]:
    """The numbers of one vehicle, from the one place that computes each."""
    verdict, low, near = v.verdict, v.verdict.lowest, v.verdict.nearest
    assert done.fleet is not None
    return {
        "length_m": verdict.length_m, "energy_j": verdict.energy_j if verdict.energy_stated else None,
        "battery_percent": verdict.battery_used_percent,
        "min_agl_m": None if low is None else low.min_agl_m,
        "zone_m": None if near is None else near.zone_clearance_m, "zone": None if near is None else near.nearest_zone,
        "climb_deg": verdict.max_climb_deg, "speed_m_s": v.speed_m_s,
        "arrive_s": done.fleet.slot(v.name).arrive_s, "items": len(v.mission.wire_items()),
    }  # fmt: skip


def shown_as(text: str, value: float, decimals: int, *, least: bool = False, steepest: bool = False) -> None:
    """A number in words is the value to its last digit; least values are rounded down, the steepest up."""
    wanted = floored(value, decimals) if least else steepened(value, decimals) if steepest else round(value, decimals)
    off = 1e-9 if least or steepest else 0.51 * 10.0**-decimals
    assert number(text) == pytest.approx(wanted, abs=off), (text, value)


def test_there_are_twelve_missions() -> None:
    assert len(CASES) >= 12


@pytest.mark.slow
@cases
def test_the_table_shows_it(case: str) -> None:
    _, done = planned(case)
    for v in done.vehicles:
        row, true = plan_row(v, done.fleet), truth(v, done)
        assert row["items"] == str(true["items"])
        shown_as(row["length, m"], true["length_m"], 0)
        if true["energy_j"] is None:  # nobody stated what a metre takes
            assert (row["energy, kJ"], row["energy, Wh"]) == ("–", "–")
        else:
            shown_as(row["energy, kJ"], true["energy_j"] / 1e3, 0)
            shown_as(row["energy, Wh"], true["energy_j"] / 3600.0, 0)
        if true["battery_percent"] is not None:
            shown_as(row["battery, %"], true["battery_percent"], 0)
        if true["min_agl_m"] is not None:
            shown_as(row["lowest AGL, m"].split(" of ")[0], true["min_agl_m"], 1, least=True)
        if true["zone"] is not None:
            clearance, name = row["nearest zone, m"].split(" ", 1)
            shown_as(clearance, true["zone_m"], 1, least=True)
            assert name == true["zone"]
        shown_as(row["steepest, °"].split(" of ")[0], true["climb_deg"], 1, steepest=True)
        shown_as(row["speed, m/s"], true["speed_m_s"], 2)


@pytest.mark.first_quick
@cases
def test_json_and_csv_hold_it(case: str) -> None:
    _, done = planned(case)
    told = {v["name"]: v for v in summary_of(done)["vehicles"]}
    rows = list(csv.DictReader(io.StringIO(written(case)["profile.csv"])))
    for v in done.vehicles:
        entry, true, verdict = told[v.name], truth(v, done), v.verdict
        for key, name in (
            ("length_m", "length_m"), ("flight_energy_j", "energy_j"), ("battery_used_percent", "battery_percent"),
            ("min_agl_m", "min_agl_m"), ("min_zone_clearance_m", "zone_m"), ("nearest_zone", "zone"),
            ("max_climb_deg", "climb_deg"), ("speed_m_s", "speed_m_s"), ("arrive_s", "arrive_s"), ("items", "items"),
        ):  # fmt: skip
            assert entry[key] == true[name], key
        assert entry["energy_j"] == (None if true["energy_j"] is None else verdict.path_energy_j)
        mine = [r for r in rows if r["vehicle"] == v.name]

        def column(name: str, mine: list[dict[str, str]] = mine) -> list[float]:
            return [float(r[name]) for r in mine if r[name]]

        if true["energy_j"] is None:
            assert column("cumulative_energy_j") == column("energy_j") == []
        else:
            assert column("cumulative_energy_j")[-1] == pytest.approx(true["energy_j"], abs=0.051 * len(mine))
            assert math.fsum(column("energy_j")) == pytest.approx(true["energy_j"], abs=0.051 * len(mine))
        assert math.fsum(column("leg_m")) == pytest.approx(
            math.fsum(leg.length_m * leg.times for leg in verdict.legs), abs=0.00051 * len(mine)
        )
        if true["min_agl_m"] is not None:
            assert min(column("min_agl_on_leg_m")) == floored(true["min_agl_m"], 3)


@pytest.mark.slow
@cases
def test_the_report_shows_it(case: str) -> None:
    _, done = planned(case)
    page = reported(case)
    for v in done.vehicles:
        true = truth(v, done)
        card = page.split(f"</i>{v.name}<span")[1].split("</dl>")[0]
        cells = dict(re.findall(r"<dt>([^<]*)</dt><dd>([^<]*)<small>", card))
        notes = dict(re.findall(r"<dt>([^<]*)</dt><dd>[^<]*<small>([^<]*)</small>", card))

        def quantity(text: str) -> str:
            return re.sub(r"\u202f?[^\d\u202f.]+$", "", html.unescape(text))

        shown_as(quantity(cells["path"]), true["length_m"], 0)
        if true["min_agl_m"] is not None:
            shown_as(quantity(cells["lowest above ground"]), true["min_agl_m"], 1, least=True)
        if true["zone"] is not None:
            shown_as(quantity(cells["nearest zone"]), true["zone_m"], 1, least=True)
            assert html.unescape(notes["nearest zone"]).startswith(true["zone"])
        shown_as(quantity(cells["steepest"]), true["climb_deg"], 1, steepest=True)
        if true["energy_j"] is not None:
            used = cells["energy"] if "energy" in cells else notes["battery"]
            shown_as(quantity(used.split("kJ")[0]), true["energy_j"] / 1e3, 0)
        if true["battery_percent"] is not None:
            shown_as(quantity(cells["battery"]), true["battery_percent"], 1)
        legs, items = text_rows(page, f"Legs of {v.name},"), list(by_item(v.verdict.legs))
        for row, (item, _) in zip(legs, items, strict=True):
            shown_as(quantity(row[1]), item.length_m, 0)
            if not item.column and math.isfinite(item.min_agl_m):
                shown_as(quantity(row[4]), item.min_agl_m, 1, least=True)


def agrees(again: Verdict, v: VehiclePlan) -> None:
    first = v.verdict
    assert again.length_m == pytest.approx(first.length_m, abs=WIRE_M)
    assert again.energy_j == pytest.approx(first.energy_j, abs=WIRE_J)
    assert again.max_climb_deg == pytest.approx(first.max_climb_deg, abs=0.02)
    for mine, theirs in ((again.lowest, first.lowest), (again.nearest, first.nearest)):
        assert (mine is None) == (theirs is None)
    if again.lowest is not None and first.lowest is not None:
        assert again.lowest.min_agl_m == pytest.approx(first.lowest.min_agl_m, abs=WIRE_M)
    if again.nearest is not None and first.nearest is not None:
        assert again.nearest.zone_clearance_m == pytest.approx(first.nearest.zone_clearance_m, abs=WIRE_M)


@pytest.mark.slow
@cases
def test_the_check_of_the_written_file_finds_it(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, done = planned(case)
    files = written(case)
    for v in done.vehicles:
        path = tmp_path / f"{v.name}.plan"
        path.write_text(files[path.name], encoding="utf-8")
        [again] = check_files(source, [f"{v.name}={path}"])
        agrees(again.verdict, v)
        told = verdict_of(v.name, again.verdict)
        entry = next(e for e in summary_of(done)["vehicles"] if e["name"] == v.name)
        for key in ("length_m", "min_agl_m", "min_zone_clearance_m", "max_climb_deg", "battery_used_percent"):
            assert told[key] == pytest.approx(entry[key], abs=WIRE_M), key
        for key in ("energy_j", "flight_energy_j"):
            assert told[key] == pytest.approx(entry[key], abs=WIRE_J), key
        capsys.readouterr()
        verdict_table(v.name, again.verdict)
        said = capsys.readouterr().out
        shown_as(said.split("path ")[-1].split(" m;")[0], again.verdict.length_m, 0)


@pytest.mark.slow
@pytest.mark.parametrize("case", [n for n in CASES if n not in SLOW])
@pytest.mark.nightly_but(*CASES.keys() - FLOWN_LONG)
def test_a_rehearsal_has_the_plans_numbers_beside_what_was_flown(case: str) -> None:
    _, done = planned(case)
    found = flown(case)
    rows = text_rows(render_rehearsal(done, found), "What was flown")
    for v in done.vehicles:
        true = truth(v, done)
        of = {row[1]: row for row in rows if row[0] == v.name}
        assert seconds(of["at its goal"][2]) == pytest.approx(true["arrive_s"], abs=0.0501)
        if true["min_agl_m"] is not None:
            shown_as(of["lowest above ground"][2].rstrip("m\u202f "), true["min_agl_m"], 1, least=True)
        if true["battery_percent"] is not None:
            shown_as(of["battery used"][2].rstrip("%\u202f "), true["battery_percent"], 1)
    assert write_summary({"vehicles": [v.as_dict() for v in found.vehicles]})
