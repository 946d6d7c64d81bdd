"""One rounding for each kind of number: table, report, CSV, JSON, misses and rehearsal show the same least values."""

from __future__ import annotations

import csv
import html
import io
import json
import math
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gcsplan.app.check import verdict_json
from gcsplan.app.fleet import pipeline
from gcsplan.app.output import files as outputs
from gcsplan.check.margins import Miss
from gcsplan.cli import main as cli
from gcsplan.cli.output import console
from gcsplan.export.profile import write_profile
from gcsplan.export.summary import write_summary
from gcsplan.figures import counted, floored, raised, steepened
from gcsplan.report.parts import html as markup
from gcsplan.report.parts.page_data import Subject
from gcsplan.report.views import tables
from gcsplan.sim.outcome import Performance
from gcsplan.units import METRIC
from tests.support.paths import DATA

FLEET = """
version: 1
terrain: {flat_m: 100}
frame: {origin: [36.6, -84.3], amsl_m: 0}
limits: {min_agl_m: 30, track_error_m: 1, altitude_error_m: 1}
no_fly: [{name: tower, center: {east_m: 450, north_m: 60}, radius_m: 30}]
vehicles:
  - {name: a, sysid: 1, autopilot: arducopter, start: {east_m: 0, north_m: 0}, goal: {east_m: 900, north_m: 0}}
  - {name: b, sysid: 2, autopilot: arducopter, start: {east_m: 0, north_m: 9408.1}, goal: {east_m: 900, north_m: 9408.1}}
"""  # noqa: E501


@given(st.floats(-1e6, 1e6), st.integers(0, 3))
@example(65.19996, 1)
@example(59.999999999999, 1)
@example(math.nan, 1)
@example(math.inf, 1)
def test_a_least_value_is_never_shown_better_than_it_is_nor_a_digit_worse(value: float, decimals: int) -> None:
    shown = floored(value, decimals)
    if not math.isfinite(value):
        assert str(shown) == str(value)
        return
    digit = 10.0**-decimals
    assert value - digit < shown <= value + 1.001e-3 * digit + 1e-9 * abs(value)
    text = f"{shown:,.{decimals}f}".replace("-0" if shown == 0 else "\0", "0")
    assert console.least(value, decimals).replace("\u2009", ",").lstrip("-") == text.lstrip("-")
    assert markup.least(value, decimals).replace(markup.THIN, ",").lstrip("-") == text.lstrip("-")


def test_what_must_at_least_be_set_is_rounded_up() -> None:
    assert [raised(v, 0) for v in (291.4, 291.0, 291.0 + 1e-9)] == [292.0, 291.0, 291.0]
    assert raised(-3.26, 1) == -3.2
    assert math.isnan(raised(math.nan, 0))
    assert raised(math.inf, 0) == math.inf


@given(st.floats(-1e6, 1e6), st.integers(0, 3))
@example(690.4501, 1)
@example(4.849, 1)
@example(59.999999999999, 1)
@example(-4.849, 1)
@example(-0.049, 1)
def test_a_greatest_value_is_never_shown_better_than_it_is_nor_a_digit_worse(value: float, decimals: int) -> None:
    digit, noise = 10.0**-decimals, 1.001e-3 * 10.0**-decimals + 1e-9 * abs(value)
    assert value - noise <= raised(value, decimals) < value + digit
    steep = steepened(value, decimals)
    assert (abs(value) < 0.5 * digit and steep == 0.0) or abs(value) - noise <= abs(steep) < abs(value) + digit
    assert steep * value >= 0.0
    for shown, text in (
        (raised(value, decimals), markup.greatest(value, decimals)),
        (steep, markup.steepest(value, decimals).removesuffix("°")),
        (steep, console.steepest(value, decimals)),
    ):
        plain = re.sub("[\u2009\u202f]", "", text)
        assert float(plain) == pytest.approx(shown, abs=1e-9)


@pytest.mark.slow
def test_the_highest_and_the_steepest_are_the_same_everywhere_and_not_flattered() -> None:
    plan = pipeline.plan(pipeline.load_mission(DATA / "crossing.yaml"))
    (v,) = plan.vehicles
    legs = tuple(leg if leg.column else replace(leg, climb_deg=4.8101, max_agl_m=690.4501) for leg in v.verdict.legs)
    verdict = replace(v.verdict, legs=legs)
    changed = replace(v, verdict=verdict)
    assert console.plan_row(changed, None)["steepest, °"].split(" of ")[0] == "4.9"
    rows = csv.DictReader(io.StringIO(write_profile(outputs.item_rows("uav1", verdict))))
    assert "4.811" in {row["climb_deg"] for row in rows}
    assert json.loads(write_summary(verdict_json.verdict_of("file", verdict)))["max_climb_deg"] == 4.811
    subject = Subject(
        "uav1", verdict, replace(v.request.vehicle, limits=replace(v.request.vehicle.limits, max_agl_m=700))
    )
    table = tables.legs_table(subject, METRIC)
    assert "4.9°" in table
    assert "690.5\u202fm" in table
    assert "690.46\u202fm" in tables.limits_table(subject, None, METRIC)
    miss = Miss("max_amsl", 0.0499, 690.4501, 690.5, "m", 1, 36.6, -84.3, 685.4)
    assert str(miss.note).startswith("highest altitude, with the errors: 690.5 m of 690.5, 0.0 m to spare")
    assert Miss("climb", 10.19, 4.8101, 15.0, "°", 1, 36.6, -84.3, 0.0).note.text().startswith("steepest climb: 4.9 °")


def test_a_height_that_the_nearest_number_flatters_is_the_same_everywhere() -> None:
    plan = pipeline.plan(pipeline.load_mission(DATA / "crossing.yaml"))
    (v,) = plan.vehicles
    low = v.verdict.lowest
    assert low is not None
    legs = tuple(replace(leg, min_agl_m=33.46) if leg is low else leg for leg in v.verdict.legs)
    verdict = replace(v.verdict, legs=legs)
    table = console.plan_row(replace(v, verdict=verdict), None)["lowest AGL, m"]
    assert table.split(" of ")[0] == "33.4"
    assert markup.least(verdict.lowest.min_agl_m, 1) == "33.4"
    rows = csv.DictReader(io.StringIO(write_profile(outputs.item_rows("uav1", verdict))))
    assert "33.460" in [row["min_agl_on_leg_m"] for row in rows]
    assert json.loads(write_summary(verdict_json.verdict_of("file", verdict)))["min_agl_m"] == 33.46
    flown = Performance("uav1", 0.0, None, (1.0,), (2.0,), 33.46, (0.0, 0.0), None)
    assert flown.row(1)["lowest AGL, m"] == "33.4"


def test_csv_and_json_have_the_same_least_height() -> None:
    plan = pipeline.plan(pipeline.load_mission(DATA / "crossing.yaml"))
    verdict = plan.vehicles[0].verdict
    for metres in (65.19996, 65.2004, 64.9999999999):
        legs = tuple(leg if leg.column else replace(leg, min_agl_m=metres) for leg in verdict.legs)
        changed = replace(verdict, legs=legs)
        rows = list(csv.DictReader(io.StringIO(write_profile(outputs.item_rows("uav1", changed)))))
        told = json.loads(write_summary(verdict_json.verdict_of("file", changed)))["min_agl_m"]
        assert {float(row["min_agl_on_leg_m"]) for row in rows if row["min_agl_on_leg_m"]} == {told}


def test_a_count_has_its_noun_in_the_right_number() -> None:
    assert [counted(n, "item") for n in (0, 1, 2)] == ["0 items", "1 item", "2 items"]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> Any:
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> str:
        monkeypatch.setattr(sys, "argv", ["gcsplan", *map(str, arguments)])
        with pytest.raises(SystemExit):
            cli.main()
        return "\n".join(capfd.readouterr())

    return call


@pytest.mark.nightly_but("arrival: {mode: sequence, interval_s: 5}")
@pytest.mark.slow
@pytest.mark.parametrize("arrival", ["", "arrival: {mode: none}", "arrival: {mode: sequence, interval_s: 5}"])
def test_no_unit_is_told_twice_and_the_separation_is_one_number(run: Any, tmp_path: Path, arrival: str) -> None:
    (tmp_path / "m.yaml").write_text(FLEET + arrival)
    said = (
        run("plan", "m.yaml", "-o", "out", "--report")
        + run("rehearse", "m.yaml")
        + run("check", "m.yaml", "out/a.plan")
    )
    page = re.sub(r"<(script|style).*?</\1>", "", (tmp_path / "out" / "report.html").read_text(), flags=re.DOTALL)
    words = html.unescape(re.sub(r"<[^>]+>", " ", page)) + " ".join(re.findall(r'(?:title|aria-label)="([^"]*)"', page))
    for text in (said, words):
        assert not re.search(r"\b(m|km|s|°|kJ|m/s)[\s\u2009\u202f]+\1(?![\w/])", text)
        assert not re.search(r"(?<![\d.,\u2009\u202f])1[ \u202f](items|vehicles|zones|points|legs|rounds|runs)\b", text)
    if arrival:
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        least = f"{floored(summary['fleet']['min_separation_m'], 1):.1f}"
        assert f"separation: {least} m" in said
        assert f"{least[0]}\u202f{least[1:]}\u202fm at" in words
