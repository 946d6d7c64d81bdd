"""`gcsplan upload`, `verify`, `download`, `clear`: what others wrote is taken only if it is judged safe."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import gcsplan
from gcsplan.mavlink.files.formats import read_mission_file
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.support.crossing import CROSSING, changed, vehicle

LAT, LON, ALT = 8, 9, 10
Change = Callable[[list[str]], None]


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a plan."""
    folder = tmp_path_factory.mktemp("planned") / "out"
    gcsplan.write(gcsplan.plan(CROSSING), folder)
    return folder


@pytest.fixture
def run(run: Any, planned: Path) -> Any:
    """`run` in a folder with a plan in ``out``; gives (exit code, all text in one line)."""

    def call(*arguments: object) -> tuple[int, str]:
        code, out, err = run(*arguments)
        return code, " ".join((out + err).split())

    shutil.copytree(planned, "out")
    return call


@pytest.fixture
def url() -> Iterator[str]:
    board = LoopbackVehicle(1, Autopilot.ARDUCOPTER, lat_deg=36.6, lon_deg=-84.38, amsl_m=471.0)
    with SimServer([board], "udpin:127.0.0.1:0", speedup=10.0) as server:
        yield server.url_for_gcs


def cut(row: list[str]) -> None:
    """As MAVProxy: ``int(wp.x*1.0e7)``."""
    for column in (LAT, LON):
        row[column] = f"{int(float(row[column]) * 1.0e7) / 1e7:.7f}"


def send(run: Any, url: str, change: Change, rows: slice = slice(2, None)) -> int:
    """Put the planned mission on board as ``change`` leaves it; returns how many rows changed."""
    lines = Path("out/uav1.waypoints").read_text().splitlines()
    changed = 0
    for i in range(len(lines))[rows]:
        row = lines[i].split("\t")
        if row[3] in ("16", "21", "22") and float(row[LAT]) != 0.0:
            before = [float(number) for number in row]
            change(row)
            changed += before != [float(number) for number in row]
            lines[i] = "\t".join(row)
    Path("other.waypoints").write_text("\n".join(lines) + "\n")
    assert run("upload", "other.waypoints", "--to", url, "--unchecked")[0] == 0
    return changed


@pytest.mark.slow
def test_what_mavproxy_cuts_is_named_judged_and_taken(run: Any, url: str) -> None:
    number = send(run, url, cut)
    assert number > 0
    differ = f"{number} items differ by up to 1" if number > 1 else "1 item differs by 1"
    verify = ("verify", "out/uav1.waypoints", "--to", url)
    code, said = run(*verify)
    assert code == 7
    assert differ in said
    assert "as MAVProxy and Mission Planner write positions: --mission MISSION.yaml --tolerance-m 0.02" in said
    code, said = run(*verify, "--mission", CROSSING, "--tolerance-m", "0.02")
    assert code == 0
    assert "write positions; judged again: safe" in said
    code, said = run(*verify, "--mission", CROSSING, "--tolerance-m", "0.02", "--json")
    document = json.loads(said)
    assert code == 0
    assert document["verified"] is True
    [judged] = [note for note in document["warnings_data"] if note["code"] == "positions_cut"]
    assert judged["data"]["safe"] is True
    assert judged["data"]["items"] == number
    assert len(document["warnings"]) == len(document["warnings_data"])
    assert "within the tolerance" in document["differences"][0]
    code, said = run(*verify, "--mission", CROSSING, "--tolerance-m", "0.001")
    assert code == 7
    assert "more than --tolerance-m 0.001" in said
    assert run(*verify, "--mission", CROSSING)[0] == 7


@pytest.mark.slow
def test_what_is_on_board_is_judged_and_not_the_file(run: Any, url: str) -> None:
    """Every way point 3 m lower: the file is safe, and what is on board flies too low."""

    def lower(row: list[str]) -> None:
        if row[3] == "16":
            row[ALT] = str(float(row[ALT]) - 3.0)

    assert send(run, url, lower) > 0
    code, said = run("verify", "out/uav1.plan", "--to", url, "--mission", CROSSING, "--tolerance-m", "5")
    assert code == 4
    assert "as read back fails the check" in said
    assert "judged again: not safe" in said


@pytest.mark.slow
def test_another_number_is_a_difference_whatever_the_tolerance(run: Any, url: str) -> None:
    def wait(row: list[str]) -> None:
        cut(row)
        row[4] = "7" if row[3] == "16" else row[4]

    assert send(run, url, wait, slice(4, None)) > 0
    code, said = run("verify", "out/uav1.plan", "--to", url, "--mission", CROSSING, "--tolerance-m", "5")
    assert code == 7
    assert "param1" in said
    assert "--tolerance-m is for positions alone" in said


@pytest.mark.slow
def test_a_mission_of_another_place_is_a_difference_and_no_crash(run: Any, url: str) -> None:
    def far(row: list[str]) -> None:
        row[LAT], row[LON] = str(-float(row[LAT])), "120.5"

    assert send(run, url, far) > 0
    code, said = run("verify", "out/uav1.plan", "--to", url, "--mission", CROSSING)
    assert code == 7
    assert "Traceback" not in said


@pytest.mark.slow
def test_with_a_mission_file_what_is_on_board_is_judged_in_its_world(run: Any, url: str, tmp_path: Path) -> None:
    stricter = tmp_path / "stricter.yaml"
    stricter.write_text(CROSSING.read_text().replace("min_agl_m: 60", "min_agl_m: 70"))
    assert run("upload", "out/uav1.plan", "--to", url, "--mission", CROSSING)[0] == 0
    code, said = run("verify", "uav1=out/uav1.plan", "--to", url, "--mission", CROSSING)
    assert code == 0
    assert "judged again: safe" in said
    code, said = run("verify", "out/uav1.plan", "--to", url, "--mission", stricter)
    assert code == 4
    assert "too low above ground" in said


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--tolerance-m", "0.02"), "give --mission MISSION.yaml"),
        (("--tolerance-m", "0", "--mission", CROSSING), "more than 0"),
        (("--tolerance-m", "nan", "--mission", CROSSING), "more than 0"),
        (("--tolerance-m", "50", "--mission", CROSSING), "at most 10 m"),
        (("--sysid", "1", "--mission", CROSSING), "--sysid goes without --mission"),
    ],
)
def test_options_that_do_not_go_together_are_refused(run: Any, options: tuple[object, ...], words: str) -> None:
    code, said = run("verify", "out/uav1.plan", "--to", "udpout:127.0.0.1:9", *options)
    assert code == 2
    assert words in said


@pytest.mark.slow
def test_another_autopilot_than_the_mission_files_is_refused(run: Any) -> None:
    board = LoopbackVehicle(1, Autopilot.PX4, lat_deg=36.6, lon_deg=-84.38, amsl_m=471.0)
    with SimServer([board], "udpin:127.0.0.1:0", speedup=10.0) as server:
        code, said = run("verify", "out/uav1.waypoints", "--to", server.url_for_gcs, "--mission", CROSSING)
    assert code == 5
    assert "the mission is written for ArduCopter, and the vehicle is PX4" in said


def test_an_empty_board_was_sent_nothing(run: Any, url: str) -> None:
    code, text = run("verify", "out/uav1.plan", "--to", url)
    assert code == 7
    assert "on board is 0" in text
    assert "sent" not in text


@pytest.mark.slow
def test_files_are_uploaded_verified_downloaded_and_cleared(run: Any, tmp_path: Path) -> None:
    assert run("plan", CROSSING, "-o", "out")[0] == 0
    with SimServer([vehicle()], "udpin:127.0.0.1:0", speedup=10.0) as server:
        url = server.url_for_gcs
        assert run("verify", "out/uav1.waypoints", "--to", url)[0] == 7
        assert run("upload", "out/uav1.plan", "--to", url, "--mission", CROSSING)[0] == 0
        assert run("verify", "out/uav1.waypoints", "--to", url)[0] == 0
        assert run("download", "--from", url, "-o", "back.waypoints")[0] == 0
        back = read_mission_file(tmp_path / "back.waypoints", autopilot=Autopilot.ARDUCOPTER).mission
        sent = read_mission_file(tmp_path / "out" / "uav1.plan", autopilot=None).mission
        assert [i.command for i in back.items] == [i.command for i in sent.items]
        assert run("check", CROSSING, "uav1=back.waypoints")[0] == 0
        assert run("clear", "--to", url)[0] == 0
        assert server.vehicles[0].items()[1:] == ()


@pytest.mark.slow
def test_an_unsafe_file_is_not_sent_unless_unchecked(run: Any, tmp_path: Path) -> None:
    assert run("plan", CROSSING, "-o", "out")[0] == 0
    higher = changed(tmp_path, "min_agl_m: 60", "min_agl_m: 70")
    with SimServer([vehicle()], "udpin:127.0.0.1:0", speedup=10.0) as server:
        assert run("upload", "out/uav1.plan", "--to", server.url_for_gcs, "--mission", higher)[0] == 4
        assert server.vehicles[0].items()[1:] == ()
        assert run("upload", "out/uav1.waypoints", "--to", server.url_for_gcs, "--unchecked")[0] == 0
        assert len(server.vehicles[0].items()) > 5
        plan = json.loads((tmp_path / "out" / "uav1.plan").read_text())
        plan["geoFence"] = {"polygon": [[36.0, -84.0], [36.1, -84.0], [36.1, -84.1]], "version": 1}
        (tmp_path / "fenced.plan").write_text(json.dumps(plan))
        code, said = run("upload", "fenced.plan", "--to", server.url_for_gcs, "--unchecked")
        assert code == 0
        assert "note: the file's geoFence of version 1 (polygon) is not read" in said
