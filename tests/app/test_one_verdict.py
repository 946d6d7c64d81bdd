"""One verdict in every output, which names what was judged; energies are told only of an aircraft whose energy is."""

from __future__ import annotations

import json
from html import unescape
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gcsplan.app.batch import BATCH_COLUMNS, BatchOptions, MissionBatch
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of, report_of, summary_of
from gcsplan.app.parallel.executor import Inline
from gcsplan.app.plan.way_home import homes_of
from gcsplan.app.rehearse import rehearse
from gcsplan.check.returns.words import verdict_words
from gcsplan.cli.output.console import plan_table
from gcsplan.cli.output.verdict_table import verdict_table
from gcsplan.export.table import csv_text
from gcsplan.mission_file import load_mission
from gcsplan.notes.note import Note
from gcsplan.report.index_page import render_index
from gcsplan.units import METRIC
from tests.check.test_energy import ENERGY, mission
from tests.support.paths import DATA

NOT_JUDGED = "path safe, return not judged"


@pytest.mark.parametrize(
    ("path", "home", "said"),
    [
        (True, None, NOT_JUDGED),
        (True, SimpleNamespace(safe=None, no_return_m=0.0), NOT_JUDGED),
        (True, SimpleNamespace(safe=True, no_return_m=0.0), "path safe; safe return from all of it"),
        (True, SimpleNamespace(safe=False, no_return_m=8500.0), "path safe; no safe return from 8.5 km of it"),
        (False, None, "path UNSAFE, return not judged"),
        (None, None, "path not judged in full, return not judged"),
    ],
)
def test_the_sentence_names_what_was_judged(path: bool | None, home: Any, said: str) -> None:
    assert str(verdict_words(path, home)) == said


@pytest.mark.slow
def test_table_json_kml_and_report_tell_the_same_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    done = plan(load_mission(DATA / "crossing.yaml"))
    homes = homes_of(done)
    assert homes["uav1"].safe is False  # at ArduCopter's default return altitude
    for judged, said in (({}, NOT_JUDGED), (homes, str(verdict_words(True, homes["uav1"])))):
        plan_table(done, judged)
        assert said in capsys.readouterr().out
        told = json.loads(outputs_of(done, judged)["summary.json"])["vehicles"][0]
        assert (told["verdict"], told["safe"]) == (said, True)
        assert ("way_home" in told) is bool(judged)
        assert f"<description>{said}, lowest" in outputs_of(done, judged)["mission.kml"]
        page = report_of(done, (), judged)
        assert f"{said}." in page
        assert ">SAFE<" not in page


@pytest.mark.slow
def test_a_batch_tells_in_index_and_csv_what_its_pages_tell(tmp_path: Path) -> None:
    for report, ends in ((False, "return not judged"), (True, "of it")):
        out = tmp_path / str(report)
        batch = MissionBatch([("crossing", DATA / "crossing.yaml")], out, BatchOptions(report=report))
        records: list[Any] = []
        batch.run(Inline(), [0], records.append)
        [row] = records[0].rows
        assert row["verdict"].endswith(ends)
        assert (row["safe"], row["return_safe"]) == (True, False if report else None)
        assert row["verdict"] in csv_text(BATCH_COLUMNS, [row])
        assert row["verdict"] in render_index("b", records[0].rows, {}, (), METRIC, "report.html")
        if report:
            assert row["verdict"] in (out / "crossing" / "report.html").read_text(encoding="utf-8")
        assert row["max_agl_m"] > row["min_agl_m"]


@pytest.mark.slow
def test_without_an_energy_key_no_output_tells_an_energy(capsys: pytest.CaptureFixture[str]) -> None:
    for energy, told in ((None, False), (ENERGY, True)):
        done = plan(load_mission(mission(energy)))
        plan_table(done, {})
        table = capsys.readouterr().out
        assert ("energy, Wh" in table and "–" not in table.split("energy, Wh")[1].split("\n")[0]) is told
        [vehicle] = summary_of(done)["vehicles"]
        assert (vehicle["energy_j"] is not None, vehicle["flight_energy_j"] is not None) == (told, told)
        last = outputs_of(done)["profile.csv"].splitlines()[-1].split(",")
        assert (last[10] != "", last[11] != "") == (told, told)
        assert ("<dt>energy</dt><dd>–" in report_of(done)) is not told


@pytest.mark.nightly
def test_a_battery_without_energy_is_judged_by_the_papers_numbers_and_says_so(
    capsys: pytest.CaptureFixture[str],
) -> None:
    done = plan(load_mission(mission({"battery_wh": 900})))
    [v] = done.vehicles
    mark = "(paper's figures)"
    assert Note("paper_energy") in v.verdict.notes
    plan_table(done, {})
    assert capsys.readouterr().out.count(mark) >= 2
    verdict_table("uav1", v.verdict, energy=v.request.vehicle.energy)
    assert mark in capsys.readouterr().out
    [vehicle] = summary_of(done)["vehicles"]
    assert (vehicle["energy_figures"], vehicle["battery_used_percent"] > 0.0) == ("paper", True)
    page = unescape(report_of(done))
    assert page.count(mark) >= 3  # figures, what is left, the briefing
    [flown] = rehearse(done).vehicles
    assert flown.as_dict()["energy_figures"] == "paper"
    own = plan(load_mission(mission(ENERGY)))
    assert summary_of(own)["vehicles"][0]["energy_figures"] == "own"
    assert mark not in unescape(report_of(own))


def test_the_papers_energy_is_told_where_it_is_what_is_minimised() -> None:
    done = plan(load_mission(mission(None)), objective="energy")
    assert summary_of(done)["vehicles"][0]["energy_j"] > 0.0
    assert Note("paper_energy_minimised") in done.notes


@pytest.mark.slow
def test_an_advised_return_altitude_above_max_agl_is_told() -> None:
    raw = mission(ENERGY) | {"no_fly": [{"center": [46.012, 14.012], "radius_m": 200, "ceiling_agl_m": 300}]}
    [home] = homes_of(plan(load_mission(raw))).values()
    assert home.set_rel_home_m is not None
    assert home.set_rel_home_m > 200.0
    assert "but above max_agl_m (200 m) over home" in str(home.advice)
    assert home.as_dict()["set_above_max_agl"] is True
