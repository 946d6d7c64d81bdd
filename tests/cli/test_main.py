"""The command line as scripts see it: exit codes, one message, one JSON document, nothing half-written."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from gcsplan.sim.vehicle.server import SimServer
from tests.support.crossing import CROSSING, OUTPUTS, changed, vehicle


@pytest.mark.slow
def test_json_puts_exactly_one_document_on_standard_output(run: Any) -> None:
    code, out, _ = run("plan", CROSSING, "--json", "--upload", "sim")
    document = json.loads(out)
    assert code == 0
    assert document["vehicles"][0]["safe"] is True
    assert document["vehicles"][0]["planning_s"] > 0
    assert document["vehicles"][0]["upload"]["outcome"] == "accepted"


def test_bad_input_is_exit_2_with_every_mistake_and_its_place(run: Any, tmp_path: Path) -> None:
    bad = changed(tmp_path, "min_agl_m: 60, horizontal_clearance_m: 30", "min_agl_m: .nan, horizontal_clearence_m: 30")
    code, out, err = run("plan", bad, "--json")
    assert code == 2
    assert "Traceback" not in err
    error = json.loads(out)["error"]
    assert error["code"] == 2
    places = " ".join(p["where"] for p in error["problems"])
    assert "limits.min_agl_m" in places
    assert "horizontal_clearence_m" in places
    assert not (tmp_path / "changed").exists()


def test_no_way_is_exit_3_and_retires_the_outputs_of_an_earlier_plan(run: Any, tmp_path: Path) -> None:
    assert run("plan", CROSSING, "-o", "out")[0] == 0
    bad = changed(tmp_path, "min_agl_m: 60,", "min_agl_m: 60, max_amsl_m: 600.5,")
    code, out, err = run("plan", bad, "-o", "out", "--json")
    assert code == 3
    assert json.loads(out)["error"]["reason"] in ("infeasible", "not_found")
    assert "max_amsl_m" in err
    assert "previous" in err
    assert not (tmp_path / "out" / "uav1.waypoints").exists()
    assert {p.name for p in (tmp_path / "out" / "previous").iterdir() if not p.name.startswith(".")} == OUTPUTS


@pytest.mark.parametrize("arguments", [("plan",), ("plan", "x.yaml", "--nope"), ("frobnicate",), ("upload", "x.plan")])
def test_wrong_usage_is_exit_2(run: Any, arguments: tuple[str, ...]) -> None:
    code, _, err = run(*arguments)
    assert code == 2
    assert "Traceback" not in err


def test_a_missing_mission_file_is_named(run: Any) -> None:
    code, _, err = run("plan", "nowhere.yaml")
    assert code == 2
    assert "nowhere.yaml" in err


@pytest.mark.parametrize(
    ("trouble", "code", "word"),
    [
        ({"armed": True}, 5, "armed"),
        ({"refuse": 4, "refuse_code": 5}, 5, "item 4"),
        ({"corrupt": 5, "corrupt_field": "z"}, 7, "5"),
        ({"edit": 3}, 7, "3"),
    ],
)
def test_each_kind_of_trouble_has_its_exit_code_and_is_named(
    run: Any, trouble: dict[str, Any], code: int, word: str
) -> None:
    with SimServer([vehicle(**trouble)], "udpin:127.0.0.1:0", speedup=10.0) as server:
        got, _, err = run("plan", CROSSING, "--upload", server.url_for_gcs)
    assert got == code, err
    assert word in err
    assert "Traceback" not in err


def test_a_bug_of_ours_is_exit_70_with_one_message(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from gcsplan.app.fleet import pipeline

    def broken(*_: object) -> None:
        raise ZeroDivisionError("boom")

    monkeypatch.setattr(pipeline, "load_mission", broken)
    code, out, err = run("plan", CROSSING, "--json")
    assert code == 70
    assert "Traceback" not in err
    assert json.loads(out)["error"]["code"] == 70
    assert "Traceback" in run("plan", CROSSING, "--debug")[2]


def test_ctrl_c_is_exit_130(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from gcsplan.app.fleet import pipeline

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(pipeline, "load_mission", interrupted)
    assert run("plan", CROSSING)[0] == 130


@pytest.mark.nightly
def test_results_go_to_standard_output_and_all_else_to_standard_error(run: Any, tmp_path: Path) -> None:
    asides = ("note: ", "planning ", "compiling ")
    with SimServer([vehicle()], "udpin:127.0.0.1:0", speedup=10.0) as server:
        link = server.url_for_gcs
        for words, arguments in (
            ("written to out", ["plan", CROSSING, "-o", "out", "--upload", link]),
            ("read back", ["plan", CROSSING, "-o", "out", "--upload", link]),
            ("lowest above ground", ["check", CROSSING, "out/uav1.plan"]),
            ("accepted", ["upload", "out/uav1.plan", "--to", link, "--mission", CROSSING]),
            ("verified", ["verify", "out/uav1.plan", "--to", link]),
            ("written to back.plan", ["download", "--from", link, "-o", "back.plan"]),
            ("is empty now", ["clear", "--to", link]),
            ("flown as planned", ["rehearse", CROSSING]),
            ("what it does", ["planners"]),
        ):
            code, out, err = run(*arguments)
            assert code == 0, (arguments, err)
            assert words in out, arguments
            assert "note: " not in out, arguments
            assert all(line.startswith(asides) for line in err.splitlines()), (arguments, err)
            code, out, err = run(*arguments, "--json")
            assert code == 0, (arguments, err)
            json.loads(out)  # the document alone
            assert all(line.startswith(asides) for line in err.splitlines()), (arguments, err)


@pytest.mark.nightly
def test_what_is_piped_is_the_table_and_a_reader_that_goes_away_is_no_bug(run: Any, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gcsplan", "plan", str(CROSSING), "-o", str(tmp_path / "out")]
    log = tmp_path / "log.txt"
    with log.open("w") as opened:
        assert subprocess.run(command, stdout=opened, stderr=subprocess.DEVNULL, timeout=120).returncode == 0
    text = log.read_text()
    assert "lowest AGL, m" in text
    assert re.search(r"verdict +path safe, return not judged\n", text)
    assert "\x1b" not in text
    whole = {p.name: p.read_bytes() for p in (tmp_path / "out").iterdir()}
    shutil.rmtree(tmp_path / "out")
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdout.close()
        err = process.stderr.read()
        assert process.wait(timeout=120) == 0
    assert not re.search("Traceback|internal|pipe", err, re.IGNORECASE)
    assert {p.name: p.read_bytes() for p in (tmp_path / "out").iterdir()} == whole


@pytest.mark.nightly_but("--help-0", "planners-0")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "code"), [("--help", 0), ("planners", 0), ("plan sample:nope", 2), ("plan sample:nope --json", 2)]
)
def test_a_command_ends_alike_whoever_reads_it(arguments: str, code: int) -> None:
    command = [sys.executable, "-m", "gcsplan", *arguments.split()]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        process.stdout.close()  # `2>&1 | true`
        assert process.wait(timeout=120) == code


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("uav1.plan", '{"fileType": "Plan", "version": 1}', "use check (gcsplan check MISSION.yaml 'a b/uav1.plan')"),
        ("uav1.waypoints", "QGC WPL 110\n0\t1\t0\n", "use check"), ("m.txt", "QGC WPL 110\n", "use check"),
        ("z.kml", "<?xml version='1.0'?><kml/>", "this is a file of zones"),
        ("z.geojson", '{"type": "FeatureCollection", "features": []}', "gcsplan check 'a b/z.geojson' --list-zones"),
        ("d.tif", "II*\0\0\0\0\0", "this is a file of terrain"), ("log.bin", "\u00a3\0", "use fit-energy"),
    ],
)  # fmt: skip
def test_a_file_of_another_kind_is_told_where_it_belongs(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, content: str, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a b").mkdir()
    (tmp_path / "a b" / name).write_text(content)
    code, _, err = run("plan", f"a b/{name}")
    assert code == 2
    assert words in err
    assert len(err.splitlines()) == 1


def test_a_mission_file_among_files_to_check_is_told_what_makes_them(run: Any, tmp_path: Path) -> None:
    file = tmp_path / "Flug \u00dcbung.yaml"
    file.write_text(CROSSING.read_text())
    code, _, err = run("check", str(CROSSING), str(file))
    assert code == 2
    assert f"gcsplan plan '{file}' makes such a file" in err


@pytest.mark.slow
def test_advised_commands_are_quoted(run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    place = ("--start", "47.0,8.0", "--goal", "47.0,8.02", "--flat", "100")
    code, out, _ = run("new", *place, "-o", "Flug \u00dcbung.yaml")
    assert code == 0
    assert "plan it: gcsplan plan 'Flug \u00dcbung.yaml'" in out
    assert "gcsplan plan 'Flug \u00dcbung.yaml'" in (tmp_path / "Flug \u00dcbung.yaml").read_text(encoding="utf-8")


def test_the_pole_is_refused_without_an_origin_that_nobody_gave(run: Any, tmp_path: Path) -> None:
    code, _, err = run("new", "--start", "89,8", "--goal", "89,8.02", "--flat", "100", "-o", str(tmp_path / "p.yaml"))
    assert code == 2
    assert "between 85° south and 85° north" in err
    assert "origin" not in err
