"""A fleet's session among other tabs, hostile pages and floods, and a vehicle of it that vanishes in an upload."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra map is not installed")
pytest.importorskip("uvicorn", reason="the extra map is not installed")
pytest.importorskip("websockets", reason="the extra map is not installed")

from websockets.exceptions import ConnectionClosed, InvalidStatus

from gcsplan.errors import LinkError
from tests.page.steps.test_flight_steps import look, shown, upload
from tests.page.talk import FLAT, Page, get, serving

pytestmark = [pytest.mark.nightly, pytest.mark.xdist_group("map")]
HEAD, _, FIRST = FLAT.partition("vehicles:\n")
VEHICLES = 14


def vehicle(k: int) -> str:
    """A vehicle beside the first one, as text of the mission."""
    text = FIRST.replace("uav1", f"uav{k}").replace("sysid: 1", f"sysid: {k}")
    return text.replace("8.5]", f"{8.5 + 0.002 * (k - 1):.3f}]").replace("8.51]", f"{8.51 + 0.002 * (k - 1):.3f}]")


def mission(folder: Path, vehicles: int) -> Path:
    """A mission of vehicles that arrive one after the other."""
    rule = "arrival: {mode: sequence, interval_s: 10, separation_m: 30}\n"
    text = f"{HEAD}vehicles:\n{''.join(vehicle(k) for k in range(1, vehicles + 1))}{rule}"
    (folder / "fleet.yaml").write_text(text, encoding="utf-8")
    return folder / "fleet.yaml"


def order(found: dict[str, Any]) -> list[str]:
    return [row["name"] for row in found["fleet"]["rows"]]


def test_a_second_tab_of_a_fleet_has_the_edits_of_the_first_and_not_its_drag(tmp_path: Path) -> None:
    fleet = mission(tmp_path, VEHICLES)
    before = fleet.read_bytes()
    with serving(fleet, fleet.parent) as server, Page(server) as first:
        first.send("hello")
        names = order(first.until("plan"))
        first.send("change", changes={"arrival.order": [names[-1], *names[:-1]]})
        edited = order(first.until("plan"))
        assert edited == [names[-1], *names[:-1]]
        first.send("change", changes={"vehicles[3].goal": [46.5105, 8.52]}, live=True)
        first.until("path")
        first.send("change", changes={"arrival.interval_s": 11})  # its plan is under way as the other tab comes
        with Page(server) as second:
            second.send("hello")
            state = second.until("state")
            assert state["vehicles"][3]["goal"] == pytest.approx([46.51, 8.516])
            assert (state["undo"], state["saved"]) == (True, False)
            found = second.until("plan")
            assert (order(found), found["fleet"]["interval_s"]) == (edited, 11)
            with pytest.raises(ConnectionClosed):
                first.until("never")
            assert first.heard[-1]["code"] == "taken_over"
    assert fleet.read_bytes() == before


def test_hostile_pages_and_a_flood_while_a_fleet_is_planned_change_nothing(tmp_path: Path) -> None:
    fleet = mission(tmp_path, VEHICLES)
    with serving(fleet, fleet.parent) as server:
        with Page(server) as page:
            page.send("hello")
            page.until("state")
            evil = {"Origin": "http://evil.example"}
            assert get(server, "", **evil)[0] == 403
            assert get(server, "", Host="evil.example")[0] == 403
            assert get(server, "", Sec_Fetch_Site="cross-site")[0] == 403
            for headers in (evil, {"Origin": f"http://127.0.0.1:{server.port + 1}"}, {"Origin": "null"}):
                with pytest.raises(InvalidStatus) as refused:
                    Page(server, **headers)
                assert refused.value.response.status_code == 403
            found = page.until("plan")  # neither ended nor taken over
            assert (found["verdict"], len(found["fleet"]["rows"])) == ("safe", VEHICLES)
            with suppress(ConnectionClosed):
                for k in range(3000):
                    page.send("change", changes={f"vehicles[{k % VEHICLES}].goal": [46.51, 8.6]}, live=True)
            with pytest.raises(ConnectionClosed):
                page.until("never")
        with Page(server) as page:
            page.send("hello")
            assert page.until("state")["saved"]
            assert page.until("plan")["fleet"]["rows"] == found["fleet"]["rows"]


@contextmanager
def simulated(file: Path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A process with the vehicles of a mission behind a slow link, and where it is reached."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "gcsplan", "sim", str(file), "--listen", f"udpin:127.0.0.1:{port}"]
    slow = ["--misbehave", "delay=1,delay_s=0.4,seed=3"]
    with subprocess.Popen([*command, *slow], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()  # it listens
        try:
            yield f"udpout:127.0.0.1:{port}", process
        finally:
            process.kill()


def test_a_vehicle_whose_process_ends_midway_is_unknown_and_the_others_are_verified(tmp_path: Path) -> None:
    fleet, alone = mission(tmp_path, 3), tmp_path / "second.yaml"
    alone.write_text(f"{HEAD}vehicles:\n{vehicle(2)}", encoding="utf-8")
    with serving(fleet, fleet.parent) as server, Page(server) as page, simulated(alone) as (url, process):
        number = shown(page)
        to = f"uav1=sim uav2={url} uav3=sim"
        seen = look(page, number, to)
        assert seen["ticket"], seen
        n = page.send("upload", ticket=seen["ticket"], plan=number)
        while page.until("progress", n=n)["name"] != "uav2":
            pass
        process.kill()
        while (end := page.until("progress", "uploaded", n=n))["type"] != "uploaded":
            pass
        assert end["code"] == LinkError.exit_code
        found = {v["name"]: (v["outcome"], v["verified"]) for v in end["vehicles"]}
        assert found.pop("uav2") == ("unknown", False)
        assert set(found.values()) == {("accepted", True)}
        assert "the outcome is unknown: the vehicle fell silent" in end["message"]
        again = look(page, number, to)
        assert [v["found"] for v in again["vehicles"]] == [True, False, True]
        assert again["vehicles"][1]["against"]
        assert upload(page, seen["ticket"], number)["code"] == "not_sent"
