"""The way home on the command line: one decision in plan, check, upload and rehearse, and one headline in each."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
import yaml

import gcsplan
from gcsplan.errors import CheckFailed
from gcsplan.sim.vehicle import parameters
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot

HEADLINE = "path safe; no safe return from "
HILL = {
    "version": 1,
    "terrain": {"flat_m": 0, "peaks": [{"center": [1000, 0], "height_m": 80, "decay_m": [150, 3000]}]},
    "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
    "limits": {"min_agl_m": 30, "max_climb_deg": 30},
}
UAV1 = {
    "name": "uav1", "sysid": 1, "autopilot": "arducopter",
    "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 2000, "north_m": 0},
}  # fmt: skip


@pytest.fixture
def run(run: Any) -> Any:
    """`run` of the folder; gives (exit code, all text, standard output)."""

    def call(*arguments: object) -> tuple[int, str, str]:
        code, out, err = run(*arguments)
        return code, out + err, out

    return call


def write(tmp_path: Path, name: str = "hill", *, rtl_rel_home_m: float | None = None, **more: Any) -> Path:
    file = tmp_path / f"{name}.yaml"
    vehicle = UAV1 | ({} if rtl_rel_home_m is None else {"rtl_rel_home_m": rtl_rel_home_m})
    file.write_text(yaml.safe_dump(HILL | {"vehicles": [vehicle]} | more))
    return file


def board(**parameters: float) -> LoopbackVehicle:
    return LoopbackVehicle(
        1, Autopilot.ARDUCOPTER, lat_deg=36.6, lon_deg=-84.3, amsl_m=0.0, parameters=parameters
    )  # fmt: skip


def flyable(folder: Path) -> list[str]:
    return [f.name for f in folder.glob("*") if f.suffix in (".plan", ".waypoints")]


LOW_AND_HIGH: dict[str, dict[str, float]] = {"low": {}, "high": {"rtl_rel_home_m": 200.0}}
COMMANDS = ["plan", "check", "upload", "rehearse"]


def arguments(command: str, mission: Path, file: Path) -> list[object]:
    more = {"plan": ["-o", mission.stem], "check": [file], "rehearse": []}
    return [command, file, "--mission", mission, "--to", "sim"] if command == "upload" else \
           [command, mission, *more[command]]  # fmt: skip


@pytest.fixture
def planned(run: Any, tmp_path: Path) -> Path:
    """A mission file's `.plan` over the hill, written where nothing was asked of its return."""
    assert run("plan", write(tmp_path, "first"), "-o", "first")[0] == 0
    return tmp_path / "first" / "uav1.plan"


@pytest.mark.nightly_but("check", "upload")
@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_return_that_is_reported_is_a_warning_with_one_headline_in_every_command(
    run: Any, tmp_path: Path, planned: Path, command: str
) -> None:
    code, text, _ = run(*arguments(command, write(tmp_path), planned), "--way-home")
    assert code == 0, text
    assert "warning: " in text
    assert HEADLINE in text
    assert "RTL_ALT " in text
    assert "UNSAFE" not in text


@pytest.mark.slow
@pytest.mark.nightly_but("check-option", "plan-file")
@pytest.mark.first_quick
@pytest.mark.parametrize("how", ["file", "option"])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_return_that_is_required_decides_the_same_way_in_every_command(
    run: Any, tmp_path: Path, planned: Path, command: str, how: str
) -> None:
    key, option = ({"way_home": "required"}, []) if how == "file" else ({}, ["--require-way-home"])
    code, text, _ = run(*arguments(command, write(tmp_path, "low", **key), planned), *option)
    assert code == 4, text
    assert HEADLINE in text
    assert "set RTL_ALT " in text
    code, text, _ = run(*arguments(command, write(tmp_path, "high", rtl_rel_home_m=200.0, **key), planned), *option)
    assert code == 0, text
    assert "warning" not in text


@pytest.mark.slow
def test_a_batch_writes_no_mission_without_the_safe_return_that_its_file_requires(run: Any, tmp_path: Path) -> None:
    missions = [write(tmp_path, name, way_home="required", **more) for name, more in LOW_AND_HIGH.items()]
    code, text, _ = run("batch", *missions, "-o", "out", "--report")
    assert code == 4, text
    assert flyable(tmp_path / "out" / "low") == []
    assert sorted(flyable(tmp_path / "out" / "high")) == ["uav1.plan", "uav1.waypoints"]
    assert "a safe return is required" in (tmp_path / "out" / "results.csv").read_text()
    told = json.loads((tmp_path / "out" / "high" / "summary.json").read_text())
    assert told["vehicles"][0]["way_home"]["safe"] is True


@pytest.mark.nightly
def test_who_has_no_safe_return_is_left_out_where_vehicles_may_be(run: Any, tmp_path: Path) -> None:
    beside = UAV1 | {
        "name": "uav2", "sysid": 2, "start": {"east_m": 0, "north_m": 400}, "goal": {"east_m": 2000, "north_m": 400},
        "rtl_rel_home_m": 200.0,
    }  # fmt: skip
    third = beside | {
        "name": "uav3",
        "sysid": 3,
        "start": {"east_m": 0, "north_m": 800},
        "goal": {"east_m": 2000, "north_m": 800},
    }
    file = tmp_path / "three.yaml"
    arrival = {"mode": "sequence", "interval_s": 5, "separation_m": 30}
    whole = HILL | {"vehicles": [beside, UAV1, third], "arrival": arrival, "way_home": "required"}
    file.write_text(yaml.safe_dump(whole))
    code, text, _ = run("plan", file, "-o", "out")
    assert code == 4, text
    assert flyable(tmp_path / "out") == []
    code, text, _ = run("plan", file, "-o", "out", "--leave-out")
    assert code == 3, text
    assert "1 vehicle without a mission, left out: uav1" in text
    assert "set RTL_ALT " in text
    assert sorted({name.split(".")[0] for name in flyable(tmp_path / "out")}) == ["uav2", "uav3"]
    told = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert [v["name"] for v in told["vehicles"]] == ["uav2", "uav3"]
    assert [(v["name"], v["reason"]) for v in told["left_out"]] == [("uav1", "violation")]
    assert told["fleet"]["order"] == ["uav2", "uav3"]
    file.write_text(yaml.safe_dump(whole | {"vehicles": [UAV1], "arrival": {"leave_out": True} | arrival}))
    code, text, _ = run("plan", file, "-o", "out")
    assert code == 3, text
    assert flyable(tmp_path / "out") == []


@pytest.mark.slow
def test_what_could_not_be_judged_is_refused_where_a_safe_return_is_required(
    run: Any, tmp_path: Path, planned: Path
) -> None:
    plan = json.loads(planned.read_text())
    items = plan["mission"]["items"]
    odd = {"command": 218, "frame": 2, "params": [9, 2, 0, 0, 0, 0, 0]}  # DO_AUX_FUNCTION: what it does is not known
    items.insert(2, items[0] | odd)
    for number, item in enumerate(items, start=1):
        item["doJumpId"] = number
    file = planned.with_name("odd.plan")
    file.write_text(json.dumps(plan))
    mission = write(tmp_path, "high", rtl_rel_home_m=200.0)
    code, text, _ = run("check", mission, file, "--allow-unjudged", "--way-home")
    assert code == 0, text
    assert "return not judged" in text
    code, text, _ = run("check", mission, file, "--allow-unjudged", "--require-way-home", "--json")
    assert code == 4
    assert json.loads(text[: text.rindex("}") + 1])["error"]["reason"] == "not_judged"


@pytest.mark.slow
def test_where_a_safe_return_is_required_nothing_flyable_is_left_and_nothing_is_sent(run: Any, tmp_path: Path) -> None:
    mission = write(tmp_path)
    assert run("plan", mission)[0] == 0
    assert flyable(tmp_path / "hill")
    with SimServer([board()], "udpin:127.0.0.1:0", speedup=10.0) as server:
        url = server.url_for_gcs
        assert run("plan", mission, "--require-way-home", "--upload", url)[0] == 4
        assert not flyable(tmp_path / "hill")
        file = tmp_path / "hill" / "previous" / "uav1.plan"
        assert run("upload", file, "--mission", mission, "--to", url, "--require-way-home")[0] == 4
        assert server.vehicles[0].items() == ()
    planned = gcsplan.plan(gcsplan.load_mission(write(tmp_path, way_home="required")))
    for call in (gcsplan.write, gcsplan.upload):
        with pytest.raises(CheckFailed, match="a safe return is required"):
            call(planned, tmp_path / "script" if call is gcsplan.write else "sim")
    with pytest.raises(CheckFailed):
        gcsplan.rehearse(planned)
    assert not flyable(tmp_path / "script")


@pytest.mark.nightly_but("upload")
@pytest.mark.slow
@pytest.mark.parametrize("way", ["plan", "upload"])
def test_a_vehicle_with_another_return_altitude_is_refused_before_anything_is_sent(
    run: Any, tmp_path: Path, planned: Path, way: str
) -> None:
    mission = write(tmp_path, rtl_rel_home_m=200.0, way_home="required")
    for centimetres, expected in ((1500, 5), (20000, 0)):
        with SimServer([board(RTL_ALT=centimetres)], "udpin:127.0.0.1:0", speedup=10.0) as server:
            url = server.url_for_gcs
            call = ["plan", mission, "--upload", url] if way == "plan" else \
                   ["upload", planned, "--mission", mission, "--to", url]  # fmt: skip
            code, text, _ = run(*call)
            assert code == expected, text
            assert bool(server.vehicles[0].items()) == (expected == 0)
        assert ("judged at 200 m above home, and this vehicle returns at 15 m: set RTL_ALT 20000 (cm)" in text) == (
            expected == 5
        )


@pytest.mark.nightly_but("nothing")
@pytest.mark.slow
@pytest.mark.parametrize("told", [{}, {"RTL_ALT": math.nan}], ids=["nothing", "no number"])
def test_a_vehicle_that_hides_its_return_altitude_gets_no_mission_that_requires_one(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, told: dict[str, float]
) -> None:
    mission = write(tmp_path, rtl_rel_home_m=200.0, way_home="required")
    table = {name: parameters.StoredParameter(parameters.REAL32, value) for name, value in told.items()}
    monkeypatch.setitem(parameters.PARAMETER_TABLES, Autopilot.ARDUCOPTER, table)
    with SimServer([board()], "udpin:127.0.0.1:0", speedup=10.0) as server:
        code, text, _ = run("plan", mission, "--upload", server.url_for_gcs, "--timeout", "2")
        assert (code, server.vehicles[0].items()) == (5, ()), text
        assert "the return altitude on board could not be read" in text
        mission = write(tmp_path, rtl_rel_home_m=200.0)  # nor does it tell what the path hangs on
        code, text, _ = run("plan", mission, "--upload", server.url_for_gcs, "--timeout", "2")
        assert (code, server.vehicles[0].items()) == (5, ()), text
        assert "WPNAV_RADIUS or WP_RADIUS_M" in text


@pytest.mark.slow
def test_an_rtl_item_is_judged_at_the_altitude_of_the_vehicle_before_it_is_sent(run: Any, tmp_path: Path) -> None:
    # The mission itself returns over the hill. At 15 m above home, as the vehicle is set, it would meet it.
    mission = tmp_path / "back.yaml"
    vehicle = UAV1 | {"rtl_rel_home_m": 200.0, "end": "rtl"}
    mission.write_text(yaml.safe_dump(HILL | {"vehicles": [vehicle]}))
    for centimetres, expected in ((1500, 5), (20000, 0)):
        with SimServer([board(RTL_ALT=centimetres)], "udpin:127.0.0.1:0", speedup=10.0) as server:
            code, text, _ = run("plan", mission, "--upload", server.url_for_gcs)
            assert (code, bool(server.vehicles[0].items())) == (expected, expected == 0), text
            assert ("(rtl): too low above ground" in text) == (expected == 5)
    assert run("plan", mission, "--upload", "sim")[0] == 0  # nobody has set a simulated vehicle's altitude


@pytest.mark.slow
def test_what_was_judged_is_not_called_unchecked_and_the_vehicles_own_name_is_told(run: Any, tmp_path: Path) -> None:
    code, text, _ = run("plan", write(tmp_path), "--way-home", "--upload", "sim")
    assert code == 0, text
    assert "not checked" not in text
    advice = json.loads((tmp_path / "hill" / "summary.json").read_text())["vehicles"][0]["way_home"]["set"]
    value = next(a["value"] for a in advice if a["parameter"] == "RTL_ALT")
    # The simulated vehicle has the older name, so it alone stands in the note.
    assert f"the return is at 15 m above home (RTL_ALT), as judged: set RTL_ALT {value:.0f} (cm)\n" in text


@pytest.mark.slow
def test_the_value_that_is_told_to_set_makes_the_return_safe(run: Any, tmp_path: Path) -> None:
    assert run("plan", write(tmp_path), "--way-home")[0] == 0
    told = json.loads((tmp_path / "hill" / "summary.json").read_text())["vehicles"][0]["way_home"]
    assert told["headline"].startswith(HEADLINE)
    assert told["set_leaves_m"] == 0.0
    code, text, _ = run("plan", write(tmp_path, rtl_rel_home_m=told["set_rel_home_m"]), "--require-way-home")
    assert code == 0, text
    assert "within all limits" not in text  # no advice where nothing is wrong


@pytest.mark.slow
def test_unchecked_files_have_no_way_home(run: Any, planned: Path) -> None:
    code, text, _ = run("upload", planned, "--to", "udpout:127.0.0.1:9", "--unchecked", "--require-way-home")
    assert code == 2
    assert "--mission" in text


def test_a_word_that_way_home_does_not_know_is_refused(run: Any, tmp_path: Path) -> None:
    code, text, _ = run("plan", write(tmp_path, way_home="require"))
    assert code == 2
    assert "did you mean required" in text


@pytest.mark.slow
def test_a_quiet_check_prints_the_headline_as_a_warning(run: Any, tmp_path: Path, planned: Path) -> None:
    code, text, _ = run("check", write(tmp_path), planned, "--way-home", "-q")
    [line] = text.splitlines()
    assert code == 0
    assert ": warning: way_home: path safe; no safe return from " in line


@pytest.mark.slow
def test_the_report_of_a_check_has_the_way_home_too(run: Any, tmp_path: Path, planned: Path) -> None:
    assert run("check", write(tmp_path), planned, "--way-home", "--report", "page.html")[0] == 0
    page = (tmp_path / "page.html").read_text()
    assert HEADLINE in page
    assert "PATH SAFE" in page
