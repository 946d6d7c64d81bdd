"""The page's steps over loopback: what is sent is what was shown and looked at, and nothing else can be sent."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra map is not installed")
pytest.importorskip("uvicorn", reason="the extra map is not installed")
pytest.importorskip("websockets", reason="the extra map is not installed")

from typer.testing import CliRunner

from gcsplan import load_mission, plan
from gcsplan.cli.command_table import app
from gcsplan.errors import Cancelled, LinkError
from gcsplan.page.edits import Edits
from gcsplan.page.refused import PageError
from gcsplan.page.server import MapServer
from gcsplan.page.steps.flight_steps import STEP_KINDS, ShownPlan
from gcsplan.page.steps.live_vehicles import WATCHER, is_silent
from gcsplan.page.steps.words import live_of
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.parameters import set_up
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.units import METRIC
from tests.page.talk import FLAT, Page, eventually, get, serving

pytestmark = pytest.mark.xdist_group("map")


@contextmanager
def field(folder: Path, text: str = FLAT) -> Iterator[tuple[MapServer, Path]]:
    """A server of the field's mission, and its file."""
    file = folder / "field.yaml"
    file.write_text(text, encoding="utf-8")
    with serving(file, folder) as server:
        yield server, file


@contextmanager
def flying(trouble: str = "", *, elsewhere: bool = False) -> Iterator[tuple[str, LoopbackVehicle]]:
    """The field's vehicle at a link of its own, which is not `sim` to the page."""
    [v] = plan(load_mission(FLAT)).vehicles
    home = v.mission.home
    vehicle = LoopbackVehicle(
        1, v.mission.autopilot, lat_deg=46.6 if elsewhere else home.lat_e7 / 1e7, lon_deg=home.lon_e7 / 1e7,
        amsl_m=home.amsl_m, misbehave=Misbehaviour.parse(trouble), parameters=set_up(v.request.vehicle, home),
    )  # fmt: skip
    server = SimServer([vehicle], "udpin:127.0.0.1:0").start()
    try:
        yield server.url_for_gcs, vehicle
    finally:
        server.stop()


def shown(page: Page) -> int:
    """The number of the plan that the page shows, once its way home is judged."""
    page.send("hello")
    found = page.until("plan")
    page.until("home")
    return int(found["plan"])


def look(page: Page, number: int, to: str = "sim", **more: Any) -> dict[str, Any]:
    page.send("look", plan=number, to=to, **more)
    return page.until("looked", "error")


def upload(page: Page, ticket: Any, number: Any) -> dict[str, Any]:
    page.send("upload", ticket=ticket, plan=number)
    return page.until("uploaded", "error")


# -- without vehicles


@pytest.mark.slow
def test_a_plan_is_the_same_until_an_edit_or_a_file_changes(tmp_path: Path) -> None:
    file = tmp_path / "field.yaml"
    zones = tmp_path / "more.geojson"
    ring = [[8.6, 46.6], [8.61, 46.6], [8.61, 46.61], [8.6, 46.6]]
    shape = {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    zones.write_text(json.dumps(shape), encoding="utf-8")
    file.write_text(FLAT.replace("no_fly:\n", "no_fly:\n  - {file: more.geojson}\n"), encoding="utf-8")
    edits = Edits.of_file(file)
    assert edits.planner is not None
    here = ShownPlan(3, edits.planner.plan())
    assert (here.for_step(edits, 3).folder, here.for_step(edits, 3).saved) == (tmp_path / "field", True)
    for other in (2, True, None, "3"):
        with pytest.raises(PageError, match="planned anew"):
            here.for_step(edits, other)
    edits.change({"vehicles[0].goal": [46.511, 8.51]}, live=True)
    with pytest.raises(PageError, match="was changed since"):
        here.for_step(edits, 3)
    edits.cancel()
    edits.change({"vehicles[0].goal": [46.511, 8.51]}, live=False)
    with pytest.raises(PageError, match="was changed since"):
        here.for_step(edits, 3)
    edits.undo()
    here.for_step(edits, 3)
    ring[1][0] = 8.62
    zones.write_text(json.dumps(shape), encoding="utf-8")
    with pytest.raises(PageError, match="the zones or the wind were changed"):
        here.for_step(edits, 3)
    file.write_text(FLAT, encoding="utf-8")
    with pytest.raises(PageError, match=r"field\.yaml was changed on the disk"):
        here.for_step(edits, 3)


def test_a_vehicle_that_is_not_heard_is_silent_and_listening_is_another_station() -> None:
    found = live_of("uav1", 0, "sim", None, 0.0, None, METRIC)
    assert (found["silent"], found["at"]) == (True, None)
    assert is_silent(3.5)
    assert not is_silent(1.5)
    assert WATCHER.sysid != 255
    assert "stop" in STEP_KINDS


# -- with vehicles


@pytest.mark.slow
def test_what_was_looked_at_is_sent_read_back_and_written_as_by_the_command_line(tmp_path: Path) -> None:
    with field(tmp_path) as (server, _), Page(server) as page:
        number = shown(page)
        seen = look(page, number)
        [vehicle] = seen["vehicles"]
        assert vehicle["safe"]
        assert vehicle["against"] == ""
        assert vehicle["on_board"]["headline"] == "there is no mission on board"
        assert {"WPNAV_SPEED", "RTL_SPEED"} <= {row["name"] for row in vehicle["parameters"]}
        end = upload(page, seen["ticket"], number)
        assert (end["code"], end["vehicles"][0]["verified"], end["vehicles"][0]["simulated"]) == (0, True, True)
        assert upload(page, seen["ticket"], number)["code"] == "not_sent"  # a ticket is good once
        assert upload(page, "", number)["code"] == upload(page, "\ud800", number)["code"] == "not_sent"
        again = look(page, number)
        assert again["vehicles"][0]["on_board"]["headline"].startswith("nothing changed since the mission on board")
        page.send("change", changes={"limits.min_agl_m": 40})
        newer = page.until("plan")["plan"]
        assert upload(page, again["ticket"], number)["code"] == "not_sent"  # of the plan before
        assert upload(page, again["ticket"], newer)["code"] == "not_sent"
        status, headers, report = get(server, "report.html")
        assert (status, headers["content-security-policy"].split()[0]) == (200, "sandbox")
        assert b"mission report" in report
    written = {file.name for file in (tmp_path / "field").iterdir()}
    assert {"uav1.plan", "uav1.waypoints", "summary.json", "upload.json", "report.html"} <= written
    assert json.loads((tmp_path / "field" / "upload.json").read_text())["vehicles"][0]["upload"]["verified"] is True


@pytest.mark.nightly
def test_the_files_are_those_of_the_command_line_byte_for_byte(tmp_path: Path) -> None:
    with field(tmp_path) as (server, file), Page(server) as page:
        page.send("write", plan=shown(page))
        assert page.until("written", "error")["code"] == 0
    done = CliRunner().invoke(app, ["plan", str(file), "-o", str(tmp_path / "cli"), "--report"])
    assert done.exit_code == 0, done.output
    names = sorted(path.name for path in (tmp_path / "cli").iterdir() if path.is_file() and path.name != ".gcsplan")
    assert names
    for name in names:
        assert (tmp_path / "cli" / name).read_bytes() == (tmp_path / "field" / name).read_bytes(), name


@pytest.mark.nightly
def test_a_change_on_the_disk_between_the_dialogue_and_the_click_is_refused(tmp_path: Path) -> None:
    with field(tmp_path) as (server, file), Page(server) as page, flying() as (url, vehicle):
        number = shown(page)
        seen = look(page, number, url)
        file.write_text(FLAT.replace("30}", "35}"), encoding="utf-8")
        end = upload(page, seen["ticket"], number)
        assert end["code"] == "not_sent"
        assert "changed on the disk" in end["message"]
        assert vehicle.items() == ()


@pytest.mark.nightly
def test_a_plan_that_breaks_a_limit_is_neither_looked_at_nor_sent_nor_written(tmp_path: Path) -> None:
    required = FLAT.replace("name: field", "name: field\nway_home: required")
    required = required.replace("[46.505, 8.5]", "[46.505, 8.505]")  # between start and goal
    with field(tmp_path, required) as (server, _), Page(server) as page, flying() as (url, vehicle):
        page.send("hello")
        found = page.until("plan")
        assert found["verdict"] == "violations"
        end = look(page, found["plan"], url, allow_unjudged=True)
        assert (end["code"], end.get("ticket", "")) == (4, "")
        page.send("write", plan=found["plan"])
        assert page.until("written")["code"] == 4
        assert vehicle.items() == ()
    assert not (tmp_path / "field").exists()


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("trouble", "elsewhere", "words", "permission"),
    [
        ("armed", False, "the vehicle is armed", "allow_armed"),
        ("", True, "from the mission's start", "ignore_position"),
    ],
)
def test_what_the_command_line_refuses_has_no_ticket_without_its_permission(
    tmp_path: Path, trouble: str, elsewhere: bool, words: str, permission: str
) -> None:
    with field(tmp_path) as (server, _), Page(server) as page, flying(trouble, elsewhere=elsewhere) as (url, _):
        number = shown(page)
        seen = look(page, number, url)
        assert words in seen["vehicles"][0]["against"]
        assert seen["vehicles"][0]["on_board"]["headline"] == "there is no mission on board"  # read all the same
        assert seen["ticket"] == ""
        assert upload(page, "", number)["code"] == "not_sent"
        allowed = look(page, number, url, **{permission: True})
        end = upload(page, allowed["ticket"], number)
        assert (end["code"], end["vehicles"][0]["verified"]) == (0, True)


@pytest.mark.nightly
def test_a_vehicle_that_vanishes_midway_ends_with_the_words_and_code_of_the_command(tmp_path: Path) -> None:
    with field(tmp_path) as (server, _), Page(server) as page, flying() as (url, vehicle):
        number = shown(page)
        seen = look(page, number, url)
        vehicle.misbehave = Misbehaviour.parse("silent_after=0")
        end = upload(page, seen["ticket"], number)
        assert (end["code"], end["reason"]) == (LinkError.exit_code, "no_heartbeat")
        assert "no heartbeat of system 1" in end["message"]
    told = json.loads((tmp_path / "field" / "upload.json").read_text())["vehicles"][0]["upload"]
    assert (told["outcome"], told["verified"]) == ("unknown", False)


def slowly(page: Page, url: str) -> None:
    """An upload over a link so bad that it is under way for long."""
    number = shown(page)
    seen = look(page, number, url)
    page.send("upload", ticket=seen["ticket"], plan=number)
    page.until("progress")


@pytest.mark.nightly
def test_stop_ends_an_upload_as_ctrl_c_does_and_the_vehicle_hears_of_it(tmp_path: Path) -> None:
    with field(tmp_path) as (server, _), Page(server) as page, flying("delay=1,delay_s=1.5,seed=3") as (url, _):
        slowly(page, url)
        n = page.n
        page.send("stop")
        end = page.until("uploaded", n=n)
        assert end["code"] == Cancelled.exit_code
        assert "its mission is now unknown" in end["message"]


@pytest.mark.nightly
@pytest.mark.parametrize("another", [False, True], ids=["closed", "another tab"])
def test_an_upload_whose_tab_is_gone_is_broken_off_and_the_next_page_hears_of_it(tmp_path: Path, another: bool) -> None:
    with field(tmp_path) as (server, _), flying("delay=1,delay_s=1.5,seed=3") as (url, _):
        with Page(server) as page:
            slowly(page, url)
            if another:
                with Page(server) as newer:
                    newer.send("hello")
                    newer.until("plan")
        assert eventually(lambda: told_last(server) is not None, 20.0)
        last = told_last(server)
        assert last is not None
        assert last["code"] == Cancelled.exit_code


def told_last(server: MapServer) -> dict[str, Any] | None:
    """What a page that comes now is told of the last upload."""
    with Page(server) as page:
        page.send("hello")
        last: dict[str, Any] | None = page.until("steps")["last"]
    return last


@pytest.mark.nightly
@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
def test_ctrl_c_in_the_middle_of_an_upload_ends_map_as_it_ends_the_command(tmp_path: Path) -> None:
    file = tmp_path / "field.yaml"
    file.write_text(FLAT, encoding="utf-8")
    command = [sys.executable, "-m", "gcsplan", "map", str(file), "--no-browser"]
    with (
        flying("delay=1,delay_s=1.5,seed=3") as (url, _),
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process,
    ):
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(2)]
        address = next(word for line in lines for word in line.split() if word.startswith("http://"))
        here = SimpleNamespace(url=address, port=int(address.split(":")[2].split("/")[0]))
        with Page(here) as page:  # type: ignore[arg-type]
            slowly(page, url)
            process.send_signal(signal.SIGINT)
            rest, _ = process.communicate(timeout=20.0)
    assert process.returncode == Cancelled.exit_code
    assert "interrupted while talking to uav1: a transfer under way was broken off" in rest


@pytest.mark.nightly
def test_a_ticket_is_of_no_use_to_another_tab(tmp_path: Path) -> None:
    with field(tmp_path) as (server, _), flying() as (url, vehicle), Page(server) as page:
        number = shown(page)
        ticket = look(page, number, url)["ticket"]
        with Page(server) as other:
            newer = shown(other)
            assert upload(other, ticket, number)["code"] == "not_sent"
            assert upload(other, ticket, newer)["code"] == "not_sent"
        assert vehicle.items() == ()


@pytest.mark.nightly
def test_a_flood_of_steps_is_refused_and_the_one_under_way_comes_to_its_end(tmp_path: Path) -> None:
    with field(tmp_path) as (server, _), Page(server) as page, flying() as (url, _):
        number = shown(page)
        first = page.send("look", plan=number, to=url)
        for _ in range(100):
            page.send("look", plan=number, to=url)
        kinds = [page.until("looked", "error", n=n) for n in range(first, page.n + 1) if n != first]
        assert {answer.get("code") for answer in kinds} == {"not_sent"}
        assert [a["n"] for a in page.heard if a["type"] == "looked"] in ([], [first])
        odd: list[dict[str, Any]] = [
            {"to": "x" * 5000}, {"to": 1}, {"to": ""}, {"to": "a " * 300}, {"to": "http://evil.example"},
            {"allow_armed": 1}, {"fence": "yes"}, {"to": "other=sim"},
        ]  # fmt: skip
        for more in odd:
            page.send("look", **{"plan": number, "to": url, **more})
            assert page.until("error")["code"] in ("not_sent", "bad_message"), more


@pytest.mark.nightly
@pytest.mark.parametrize("to", ["sim", "link"])
def test_a_connected_vehicle_is_shown_where_it_is_and_nothing_is_written_to_it(tmp_path: Path, to: str) -> None:
    with field(tmp_path) as (server, _), Page(server) as page, flying() as (url, vehicle):
        vehicle.wind = None
        number = shown(page)
        page.send("connect", to=url if to == "link" else to)
        assert page.until("steps")["where"] == (url if to == "link" else to)
        found = heard(page)
        assert found["at"] == [46.5, 8.5]
        assert not found["armed"]
        seen = look(page, number, url)  # the same link: listening gives way, and goes on
        assert seen["vehicles"][0]["found"]
        assert heard(page)["heard"]
        page.send("on_board", plan=number, to=url)
        assert page.until("on_board")["vehicles"][0]["headline"] == "there is no mission on board"
        page.send("disconnect")
        assert page.until("steps")["where"] == ""
        assert vehicle.items() == ()


def heard(page: Page) -> dict[str, Any]:
    """The vehicle as soon as it is heard, since now."""
    end_s = time.monotonic() + 20.0
    while time.monotonic() < end_s:
        found: dict[str, Any] = page.until("live", n=0)["vehicles"][0]
        if found["heard"] and found["at"]:
            return found
    raise AssertionError("it was never heard")


@pytest.mark.slow
def test_vehicles_are_heard_before_there_is_a_plan_and_get_their_names_with_it(tmp_path: Path) -> None:
    with flying() as (url, vehicle), serving(None, tmp_path) as server, Page(server) as page:
        for to in ("sim", "udpout:127.0.0.1:1 udpout:127.0.0.1:2", "nowhere"):
            page.send("connect", to=to)
            assert page.until("error")["code"] == "not_sent", to
        page.send("connect", to=url)
        page.until("steps")
        [heard] = page.until("live", n=0)["vehicles"]
        assert (heard["name"], heard["vehicle"], heard["silent"]) == ("vehicle 1", -1, False)
        page.send("new", terrain={"flat_m": 100}, preset="copter", max_agl_m=None, start=heard["at"])
        assert page.until("state")["vehicles"][0]["start"] == heard["at"]
        page.send("change", changes={"vehicles[0].goal": [46.51, 8.51]})
        page.until("plan")
        assert eventually(lambda: page.until("live", n=0)["vehicles"][0]["name"] == "uav1")
        assert vehicle.items() == ()


@pytest.mark.nightly
def test_a_fleet_is_released_by_the_table_of_the_command_line_and_may_have_gates(tmp_path: Path) -> None:
    second = FLAT.partition("vehicles:\n")[2].replace("uav1", "uav2").replace("sysid: 1", "sysid: 2")
    second = second.replace("8.5]   #", "8.52]   #").replace("8.51]", "8.53]")
    rule = "arrival: {mode: sequence, interval_s: 20, separation_m: 30}\n"
    with field(tmp_path, FLAT + second + rule) as (server, file), Page(server) as page:
        number = shown(page)
        start = datetime.now(UTC) + timedelta(hours=1)
        for wrong in ("soon", f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"):
            assert look(page, number, gate_utc=wrong)["code"] == "not_sent"
        assert look(page, number, gate_utc=f"{start:%Y-%m-%dT%H:%M:%SZ}")["code"] == 4  # by nobody judged
        gated = look(page, number, gate_utc=f"{start:%Y-%m-%dT%H:%M:%SZ}", allow_unjudged=True)
        assert gated["release"]["start_utc"] == f"{start:%Y-%m-%d %H:%M:%S}"
        found = look(page, number)
        assert found["release"]["start_utc"] is None
        done = upload(page, found["ticket"], number)
        rows = done["release"]["rows"]
        assert (done["code"], [row["ready"] for row in rows]) == (0, [True, True])
        fleet = plan(load_mission(file)).fleet
        assert fleet is not None
        assert {row["name"]: row["release_s"] for row in rows} == {s.name: s.depart_s for s in fleet.slots}
        assert {row["name"]: row["arrive_s"] for row in rows} == {s.name: s.arrive_s for s in fleet.slots}
