"""`gcsplan plan` and `gcsplan planners`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.support.batches import mission
from tests.support.crossing import CROSSING, OUTPUTS, vehicle


@pytest.mark.slow
def test_plan_writes_its_outputs_into_a_directory_of_the_missions_name(run: Any, tmp_path: Path) -> None:
    code, out, err = run("plan", CROSSING)
    assert code == 0
    assert "safe" in out
    assert "bare DEM" in out
    assert "written to crossing" in out
    assert all(line.startswith("note: ") for line in err.splitlines())
    assert {p.name for p in (tmp_path / "crossing").iterdir() if not p.name.startswith(".")} == OUTPUTS


def test_the_same_plan_twice_gives_the_same_bytes(run: Any, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert run("plan", CROSSING, "-o", name)[0] == 0
    for name in OUTPUTS:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name


def test_plan_upload_sim_is_verified_and_says_simulated(run: Any, tmp_path: Path) -> None:
    code, out, _ = run("plan", CROSSING, "--upload", "sim")
    assert code == 0
    assert "verified" in out
    assert "simulated" in out
    upload = json.loads((tmp_path / "crossing" / "upload.json").read_text())["vehicles"][0]["upload"]
    assert upload["verified"] is True
    assert upload["simulated"] is True
    assert "upload" not in json.loads((tmp_path / "crossing" / "summary.json").read_text())["vehicles"][0]


@pytest.mark.parametrize("planner", ["optimal", "optimum"])
def test_an_unknown_planner_names_the_nearest(run: Any, planner: str) -> None:
    code, _, err = run("plan", CROSSING, "--planner", planner)
    assert code == (0 if planner == "optimal" else 2)
    assert planner == "optimal" or "optimal" in err


@pytest.mark.slow
def test_a_vehicle_that_stands_elsewhere_is_refused_unless_that_is_ignored(run: Any) -> None:
    with SimServer([vehicle(amsl_m=900.0)], "udpin:127.0.0.1:0", speedup=10.0) as server:
        assert run("plan", CROSSING, "--upload", server.url_for_gcs)[0] == 5
        assert run("plan", CROSSING, "--upload", server.url_for_gcs, "--ignore-position")[0] == 0


@pytest.mark.slow
def test_the_wrong_autopilot_is_refused(run: Any) -> None:
    with SimServer([vehicle(Autopilot.PX4)], "udpin:127.0.0.1:0", speedup=10.0) as server:
        code, _, err = run("plan", CROSSING, "--upload", server.url_for_gcs)
    assert code == 5
    assert "PX4" in err


@pytest.mark.parametrize("word", ["uav9=udpout:127.0.0.1:1", "carrier-pigeon", "link"])
def test_an_upload_target_that_cannot_be_is_refused_before_planning(run: Any, tmp_path: Path, word: str) -> None:
    assert run("plan", CROSSING, "--upload", word)[0] == 2
    assert not (tmp_path / "crossing").exists()


def test_planners_are_listed(run: Any) -> None:
    code, out, _ = run("planners")
    assert code == 0
    assert "optimal" in out
    assert json.loads(run("planners", "--json")[1])["planners"][0]["name"] == "optimal"


@pytest.mark.slow
def test_a_plan_says_which_outputs_of_the_earlier_one_are_gone(run: Any, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run("plan", str(CROSSING), "-o", str(out), "--report")[0] == 0
    code, _, err = run("plan", str(CROSSING), "-o", str(out))
    assert code == 0
    assert not (out / "report.html").exists()
    assert "gone from" in err
    assert "report.html; --report writes one of this plan" in err
    assert "gone from" not in run("plan", str(CROSSING), "-o", str(out))[2]


@pytest.mark.slow
def test_a_plan_says_what_changed_since_the_last_one_and_since_the_mission_on_board(run: Any) -> None:
    with SimServer([vehicle()], "udpin:127.0.0.1:0", speedup=10.0) as server:
        assert "since" not in run("plan", CROSSING, "--upload", server.url_for_gcs)[1]
        code, out, _ = run("plan", CROSSING, "--compare-to", server.url_for_gcs)
        assert code == 0
        assert "uav1: nothing changed since the last plan" in out
        assert f"uav1: nothing changed since {server.url_for_gcs}" in out
        _, out, _ = run("plan", CROSSING, "--min-agl", "75", "--compare-to", server.url_for_gcs, "--json")
    last, board = json.loads(out)["differences"]
    assert (last["equal"], board["equal"]) == (False, False)
    assert last["after"]["min_agl_m"] > 75.0 > last["before"]["min_agl_m"]
    assert last["earlier_breaks_data"][0]["code"]


@pytest.mark.slow
def test_a_vehicle_without_a_mission_is_named_and_not_compared(run: Any) -> None:
    with SimServer([vehicle()], "udpin:127.0.0.1:0", speedup=10.0) as server:
        code, out, err = run("plan", CROSSING, "--compare-to", server.url_for_gcs, "--json")
    assert (code, json.loads(out)["differences"]) == (0, [])
    assert "uav1: there is no mission on board to compare with" in err


@pytest.mark.parametrize("where", ["sim", "uav9=udpout:127.0.0.1:1", "link"])
def test_a_wrong_mission_to_compare_with_is_refused_before_planning(run: Any, tmp_path: Path, where: str) -> None:
    assert run("plan", CROSSING, "--compare-to", where)[0] == 2
    assert not (tmp_path / "crossing").exists()


@pytest.mark.slow
def test_the_best_way_home_is_applied_and_saved(run: Any, tmp_path: Path) -> None:
    file = tmp_path / "field.yaml"
    zone = {"name": "tower", "center": [47.0, 8.01], "radius_m": 60, "ceiling_agl_m": 45}
    file.write_text("# mine\n" + mission(no_fly=[zone]))
    assert "no safe return" in run("plan", file, "--way-home")[1]
    code, out, err = run("plan", file, "--apply")
    assert code == 0
    assert "safe return from all of it" in out
    assert "--apply: vehicles[0].rtl_rel_home_m is" in err
    text = file.read_text()
    assert text.startswith("# mine\n")
    assert "rtl_rel_home_m" in text
    assert run("plan", file, "--require-way-home")[0] == 0
    before = file.read_bytes()
    assert run("plan", file, "--apply")[0] == 0  # nothing is left to be improved
    assert file.read_bytes() == before
