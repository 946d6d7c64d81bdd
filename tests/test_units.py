"""Units that people read: exact factors, rounding to the safe side, and one SI value behind all that is printed."""

from __future__ import annotations

import copy
import html
import json
import math
import pickle
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from gcsplan import report
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of, report_of
from gcsplan.app.output.report import page_of_plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.plan.way_home import homes_of
from gcsplan.app.rehearse import rehearse
from gcsplan.check.returns.verdict import WayHome
from gcsplan.cli import main as cli
from gcsplan.cli.output import console, verdict_table
from gcsplan.cli.output.verdict_table import say_homes
from gcsplan.errors import UsageError
from gcsplan.figures import floored, raised
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.values.units import OTHERS
from gcsplan.notes.note import Wording
from gcsplan.report.page import render_page
from gcsplan.report.parts import html as markup
from gcsplan.units import (
    AVIATION,
    IMPERIAL,
    METRIC,
    SYSTEMS,
    Quantity,
    Seconds,
    Units,
    UnitText,
    charge,
    duration,
    in_units,
)
from tests.support.shown import EXACT, NUMBER, number, same, seconds, taken_apart

pytestmark = pytest.mark.xdist_group("units")  # its mission is planned once
systems = pytest.mark.parametrize("units", SYSTEMS.values(), ids=SYSTEMS)

MISSION: dict[str, Any] = {
    "version": 1, "name": "two over the valley", "terrain": {"dem": "sample:jacksboro", "vertical_datum": "EGM96"},
    "limits": {"min_agl_m": 60, "max_agl_m": 400, "horizontal_clearance_m": 30, "track_error_m": 3,
               "altitude_error_m": 5, "max_climb_deg": 15},
    "no_fly": [
        {"name": "mast", "center": [36.6212, -84.3846], "radius_m": 60, "ceiling_agl_m": 457.2},
        {"name": "all", "center": [36.6230, -84.3790], "radius_m": 50},
    ],
    "vehicles": [
        {"name": "a", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 10], "rtl_rel_home_m": 120.5,
         "energy": {"hover_w": 400, "battery_mah": 12000, "battery_v": 22.2},
         "start": [36.6175, -84.3892], "goal": [36.6250, -84.3800]},
        {"name": "b", "sysid": 2, "autopilot": "arducopter", "speed_m_s": [3, 10],
         "energy": {"hover_w": 400, "battery_wh": 300},
         "start": [36.6165, -84.3880], "goal": [36.6240, -84.3785]},
    ],
    "arrival": {"mode": "sequence", "order": ["a", "b"], "interval_s": 20, "separation_m": 30},
}  # fmt: skip


@cache
def planned() -> tuple[Plan, dict[str, WayHome]]:
    done = plan(load_mission("units.yaml", text=yaml.safe_dump(MISSION)))
    return done, homes_of(done)


# -- conversions ------------------------------------------------------------------------------------------------------


def every_unit() -> Iterator[Any]:
    for system in SYSTEMS.values():
        for kind in system.as_dict():
            yield getattr(system, kind)


def test_every_factor_is_the_exact_one_and_there_is_one_table() -> None:
    for unit in every_unit():
        assert unit.size == float(EXACT[unit.symbol.removesuffix(" AMSL")]), unit
    assert float(charge(22.2).size) == pytest.approx(float(EXACT["mAh"]) * 22.2, rel=1e-15)
    keys = {unit.symbol: unit for others in OTHERS.values() for unit in others.values()}
    for unit in every_unit():
        assert keys.get(unit.symbol, unit).size == unit.size
    assert (IMPERIAL.speed.symbol, AVIATION.speed.symbol, AVIATION.climb_rate.symbol) == ("mph", "kt", "ft/min")


@given(st.floats(-1e5, 1e5), st.integers(0, 2), st.sampled_from(list(every_unit())))
@example(60.96, 1, IMPERIAL.height)
@example(33.0, 1, IMPERIAL.height)
def test_a_least_value_is_never_better_than_true_nor_a_digit_worse(value: float, of_si: int, unit: Any) -> None:
    size, decimals = EXACT[unit.symbol.removesuffix(" AMSL")], unit.decimals(of_si)
    true, digit = Fraction(value) / size, Fraction(1, 10**decimals)
    noise = Fraction(2, 1000) * digit
    for text, side in (
        (markup.least(value, of_si, unit), 1),
        (console.least(value, of_si, unit), 1),
        (Quantity(value, "distance", of_si, "down").text(METRIC) if unit.symbol == "m" else "", 1),
        (markup.at_least(value, of_si, unit), -1),
    ):
        if text:
            shown = Fraction(
                number(re.match(r"[-\d.\u2009\u202f]+", text)[0].rstrip("\u2009\u202f"))
            ).limit_denominator(10**decimals)  # type: ignore[index]
            assert -noise <= side * (true - shown) < digit + noise, text


@given(st.floats(0, 2e5), st.integers(0, 2))
@example(3599.96, 1)
@example(59.5, 0)
def test_a_duration_is_the_number_rounded(value: float, decimals: int) -> None:
    text = duration(value, decimals)
    assert seconds(text) == pytest.approx(value, abs=0.5001 * 10.0**-decimals)
    assert len(text.partition(".")[2]) == decimals
    assert re.fullmatch(r"\d+:[0-5]\d:[0-5]\d(\.\d+)?", text)


def test_durations_that_are_none_or_negative() -> None:
    assert [duration(v) for v in (None, math.inf, math.nan, -0.2, -61.0)] == ["–", "–", "–", "0:00:00", "-0:01:01"]


@pytest.mark.slow
def test_units_by_name() -> None:
    with pytest.raises(UsageError, match=r"units must be metric, imperial, aviation, given 'furlong'"):
        report(planned()[0], way_home=False, units="furlong")  # type: ignore[arg-type]


# -- texts that know their quantities ---------------------------------------------------------------------------------


def test_a_text_is_in_si_as_a_str_and_in_any_system_when_told() -> None:
    inner = UnitText("{} at {}", Quantity(65.19, "height", 1, "down"), Seconds(1905.96, 1))
    text = UnitText("{{zone}} “{}”: {}, set {}", "a {brace}", inner, Quantity(291.32, "height", 1, "up", trimmed=True))
    assert text == "{zone} “a {brace}”: 65.1 m at 1906.0 s, set 291.4 m"
    assert in_units(text, METRIC) == "{zone} “a {brace}”: 65.1 m at 0:31:46.0, set 291.4 m"
    assert in_units(text, AVIATION) == "{zone} “a {brace}”: 213.8 ft at 0:31:46.0, set 955.8 ft"
    for twin in (copy.deepcopy(text), pickle.loads(pickle.dumps(text))):
        assert twin == text
        assert in_units(twin, IMPERIAL) == in_units(text, IMPERIAL)
    assert json.loads(json.dumps([text])) == [str(text)]
    assert in_units("plain", IMPERIAL) == "plain"


# -- what is printed --------------------------------------------------------------------------------------------------


def page_words(page: str) -> str:
    """All words of a page but those of scales, ticks and the contours' interval, whose numbers are round in a unit."""
    page = re.sub(r"<(script|style).*?</\1>", " ", page, flags=re.DOTALL)
    page = re.sub(r'<div class="(scale|[xy]ticks|[xy]label)".*?</div>', " ", page, flags=re.DOTALL)
    page = re.sub(r"<li>contours every.*?</li>", " ", page)
    page = re.sub(r'<section id="notes">.*?</section>', " ", page, flags=re.DOTALL)  # notes stay in metres
    tips = re.findall(r'(?:title|aria-label)="([^"]*)"', page)
    words = html.unescape("\n".join([re.sub(r"<[^>]+>", "\n", page), *tips]))
    return "\n".join(line for line in words.splitlines() if line.strip())


@pytest.mark.slow
@systems
def test_the_chart_of_separations_names_the_exact_least_distance(units: Units) -> None:
    """The curve's samples may miss it by some centimetres, which feet show."""
    page = page_of_plan(planned()[0], units=units)
    assert page.separation is not None
    assert page.separation.least is not None
    nearer = replace(page.separation.least, distance_m=page.separation.least.distance_m - 0.2)
    exact = markup.least(nearer.distance_m, 1, units.distance)
    text = render_page(replace(page, separation=replace(page.separation, least=nearer)))
    chart = text.partition('id="separation"')[2].partition("</figure>")[0]
    assert re.findall(r'class="mark tight".*?<b>([^<]*)</b>', chart) == [exact]


@pytest.mark.slow
@pytest.mark.nightly_but("imperial")
@pytest.mark.parametrize("units", [IMPERIAL, AVIATION], ids=["imperial", "aviation"])
def test_every_number_of_the_report_is_the_same_in_every_system(units: Units) -> None:
    done, homes = planned()
    words, wanted = taken_apart(page_words(report_of(done, (), homes)))
    others, found = taken_apart(page_words(report_of(done, (), homes, units)))
    assert others.splitlines() == words.splitlines()
    assert len(wanted) > 150
    same(found, wanted)
    page = report_of(done, (), homes, units)
    assert not re.search(r"\d\u202f(m|km|m/s)\b", page.split('<section id="notes">')[0])
    assert page == report(done, units=units.name)  # type: ignore[arg-type]


def plan_rows(units: Units) -> list[dict[str, str]]:
    done, homes = planned()
    return [console.plan_row(v, done.fleet, homes[v.name], units) for v in done.vehicles]


def columns(rows: list[dict[str, str]]) -> tuple[list[dict[str, str]], list[tuple[float, float]]]:
    """Rows whose units stand in the names of the columns, without their numbers, and these in SI."""
    words, found = [], []
    for row in rows:
        kept = {}
        for name, text in row.items():
            stem, _, symbol = name.rpartition(", ")
            if symbol in EXACT and symbol not in ("kJ", "Wh", "mAh"):
                text = re.sub(NUMBER, lambda m, s=symbol: f"{m[0]} {s}", text)
                text, numbers = taken_apart(text)
                found += numbers
                name = stem
            kept[name] = text
        words.append(kept)
    return words, found


@pytest.mark.parametrize("units", [IMPERIAL, AVIATION], ids=["imperial", "aviation"])
def test_every_number_of_plan_and_rehearsal_is_the_same_in_every_system(units: Units) -> None:
    rows, other_rows = ([{k: w for k, w in r.items() if k != "verdict"} for r in plan_rows(u)] for u in (METRIC, units))
    words, wanted = columns(rows)
    others, found = columns(other_rows)
    assert others == words
    assert len(wanted) >= 2 * 6
    same(found, wanted)
    flown = _flown()
    words, wanted = columns(flown.rows())
    others, found = columns(flown.rows(units))
    assert others == words
    assert len(wanted) == 2
    same(found, wanted)


@cache
def _flown() -> Any:
    return rehearse(planned()[0])


@pytest.mark.nightly
def test_what_the_numbers_are(capsys: pytest.CaptureFixture[str]) -> None:
    """The default's words, and the energy in every unit."""
    row = plan_rows(METRIC)[0]
    v = planned()[0].vehicles[0]
    assert list(row) == [
        "vehicle", "items", "length, m", "path at full speed", "above the bound, %", "energy, kJ", "energy, Wh",
        "energy, mAh", "battery, %",
        "lowest AGL, m", "highest AGL, m", "nearest zone, m", "over or under a zone, m", "steepest, °", "speed, m/s",
        "departs", "arrives", "within", "verdict",
    ]  # fmt: skip
    joules = v.verdict.energy_j
    assert number(row["energy, Wh"]) == pytest.approx(joules / 3600, abs=0.51)
    assert number(row["energy, mAh"]) == pytest.approx(joules / 3600 / 22.2 * 1000, abs=0.51)
    assert plan_rows(METRIC)[1]["energy, mAh"] == "–"
    assert number(row["battery, %"]) == pytest.approx(100 * joules / (12.0 * 22.2 * 3600), abs=0.51)
    page = report_of(planned()[0])
    assert f"{markup.num(joules, 0, charge(22.2))}" in page


# -- the command line -------------------------------------------------------------------------------------------------


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> Any:
    done, _ = planned()
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(MISSION), encoding="utf-8")
    lower = MISSION | {"limits": MISSION["limits"] | {"min_agl_m": 80}}
    (tmp_path / "higher.yaml").write_text(yaml.safe_dump(lower), encoding="utf-8")
    (tmp_path / "a.plan").write_text(outputs_of(done)["a.plan"], encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["gcsplan", *arguments])
        with pytest.raises(SystemExit) as end:
            cli.main()
        out, err = capfd.readouterr()
        return int(str(end.value.code)), out, err

    return call


def checked(out: str) -> tuple[list[str], list[tuple[float, float]]]:
    """The words of ``gcsplan check``, and its numbers in SI: those of the table, and those beside their unit."""
    lines, found, symbols = [], [], []
    for line in out.splitlines():
        cells = re.split(r" {2,}", line.strip())
        if cells[0] == "item" or line.startswith("item  "):
            head = re.split(r" {2,}", line.strip())
            symbols = [name.rsplit(" ", 1)[-1] for name in head]
            continue
        if symbols and re.fullmatch(r"\d+", cells[0]):
            row = re.match(r"\s*(\d+)  (\w+)\s+(.*)", line)
            assert row is not None
            values = re.split(r" {2,}", row[3])
            for symbol, text in zip([s for s in symbols if s != "item"], values, strict=True):
                if symbol in EXACT and symbol != "kJ" and text != "–":
                    shown = re.match(NUMBER, text)
                    assert shown is not None
                    digits = len(shown[0].partition(".")[2])
                    size = float(EXACT[symbol])
                    found.append((size * number(shown[0]), size * 10.0**-digits))
            lines.append(row[1] + row[2])
            continue
        symbols = [] if line.startswith("path ") else symbols
        if re.match(r" *(-?\d+|(m|ft) AMSL) ", line):  # the profile in letters, whose heights are in the middle of rows
            continue
        words, numbers = taken_apart(line)
        lines.append(words)
        found += numbers
    return lines, found


@pytest.mark.slow
@pytest.mark.parametrize("units", [IMPERIAL, AVIATION], ids=["imperial", "aviation"])
@pytest.mark.parametrize("mission", ["m.yaml", "higher.yaml"], ids=["kept", "broken"])
def test_check_says_the_same_in_every_system(run: Any, units: Units, mission: str) -> None:
    code, out, _ = run("check", mission, "a.plan", "--way-home")
    other, told_so, _ = run("check", mission, "a.plan", "--way-home", "--units", units.name)
    assert code == other
    words, wanted = checked(out)
    others, found = checked(told_so)
    assert others == words
    assert len(wanted) > 40
    same(found, wanted)
    assert not re.search(r"\d (m|km|m/s)\b(?! \(|\)|,| or)", re.sub(r"RTL_ALT_M \d+ \(m\)", "", told_so))


@pytest.mark.slow
def test_json_and_files_are_in_si_in_every_system(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    _, out, _ = run("check", "higher.yaml", "a.plan", "--way-home", "--json")
    monkeypatch.setenv("GCSPLAN_UNITS", "imperial")
    assert run("check", "higher.yaml", "a.plan", "--way-home", "--json")[1] == out
    message = json.loads(out)["verdicts"][0]["violations"][0]["message"]
    assert re.search(r"limit 80\.00 m \(by \d+\.\d\d m\)", message)
    _, quiet, _ = run("check", "higher.yaml", "a.plan", "-q")
    run("check", "m.yaml", "a.plan", "--report", "r.html")
    assert "ft AMSL" in Path("r.html").read_text(encoding="utf-8")
    assert "limit 262.47 ft" in quiet  # the environment's system; an option comes before it
    assert "limit 80.00 m" in run("check", "higher.yaml", "a.plan", "-q", "--units", "metric")[1]


@pytest.mark.parametrize("by", ["option", "environment"])
def test_other_units_are_one_clear_message(run: Any, monkeypatch: pytest.MonkeyPatch, by: str) -> None:
    if by == "environment":
        monkeypatch.setenv("GCSPLAN_UNITS", "furlong")
    code, out, err = run("check", "m.yaml", "a.plan", *(["--units", "furlong"] if by == "option" else []))
    assert (code, out) == (2, "")
    assert "'--units'" in err
    assert "'furlong' is not one of 'metric', 'imperial', 'aviation'" in err
    assert ("GCSPLAN_UNITS" in err) >= (by == "environment")


@systems
def test_tables_fit_80_columns(
    monkeypatch: pytest.MonkeyPatch, units: Units, capfd: pytest.CaptureFixture[str]
) -> None:
    done, homes = planned()
    monkeypatch.setattr(console.console, "width", 80)
    console.plan_table(done, homes, units)
    verdict_table.verdict_table("a.plan as a (arducopter)", done.vehicles[0].verdict, wording=Wording(units))
    say_homes(homes, units)
    console.rows_table(
        "wide", [{"vehicle": name, **{f"a wide column {i}": "0:00" for i in range(9)}} for name in homes]
    )
    lines = [line for line in capfd.readouterr().out.splitlines() if " above home: " not in line]  # a sentence
    assert max(map(len, lines)) <= 80, max(lines, key=len)


@systems
def test_the_table_of_items_gives_up_the_length_before_it_breaks(
    monkeypatch: pytest.MonkeyPatch, units: Units, capfd: pytest.CaptureFixture[str]
) -> None:
    verdict = planned()[0].vehicles[0].verdict
    legs = tuple(replace(leg, nearest_zone=leg.nearest_zone and "raptor cliffs over it") for leg in verdict.legs)
    monkeypatch.setattr(console.console, "width", 80)
    verdict_table.verdict_table("a.plan", replace(verdict, legs=legs), wording=Wording(units))
    lines = capfd.readouterr().out.splitlines()[1:-1]
    assert "raptor cliffs over it" in "".join(lines)
    assert max(map(len, lines)) <= 80, max(lines, key=len)


def test_an_altitude_to_set_reads_as_the_judged_one_that_it_is(capfd: pytest.CaptureFixture[str]) -> None:
    """600 m are 1968.504 ft: rounded up beside the rounded one they were two altitudes."""
    home = next(iter(planned()[1].values()))
    assert home is not None
    for judged_m, words in ((600.0, ["1968.5", "1968.5"]), (599.0, ["1965.22", "1968.51"])):
        say_homes({"a": replace(home, rtl_rel_home_m=judged_m, assumed=False, set_rel_home_m=600.0)}, AVIATION)
        out = capfd.readouterr().out
        assert re.findall(r"19\d\d\.\d+", out.splitlines()[-2]) == words
        assert out.splitlines()[-1].startswith(f"{words[1]} ft above home: RTL_ALT 60000 (cm)")


def test_a_return_by_the_mission_says_what_to_set_for_it(capfd: pytest.CaptureFixture[str]) -> None:
    home = next(iter(planned()[1].values()))
    assert home is not None
    way = replace(
        home, route="mission", starts=(3,), along_path=True, unsafe=(), irregular=(), battery=None, not_judged=()
    )
    say_homes({"a": way, "b": way}, METRIC)
    [line] = [line for line in capfd.readouterr().out.splitlines() if line.startswith("by the mission: ")]
    assert "set FS_THR_ENABLE, FS_GCS_ENABLE, BATT_FS_LOW_ACT, BATT_FS_CRT_ACT 6 (Auto RTL)" in line


def test_rounding_after_the_conversion_differs_from_before_it() -> None:
    """33.05 m rounded down before it becomes feet would lose a tenth: 108.2 ft for 108.4 ft."""
    assert IMPERIAL.distance.of(floored(33.05, 1)) < 108.3
    assert markup.least(33.05, 1, IMPERIAL.distance) == "108.4\u202fft"
    assert markup.at_least(33.05, 1, IMPERIAL.distance) == "108.5\u202fft"
    assert raised(IMPERIAL.distance.of(33.05), 1) == 108.5
