"""`gcsplan sim`: which vehicles it simulates, and what it refuses. The server itself has tests of its own."""

from __future__ import annotations

from typing import Any

import pytest

from gcsplan.sim.vehicle import server
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.vehicle import Autopilot
from tests.support.crossing import CROSSING


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> list[tuple[LoopbackVehicle, str]]:
    """The vehicles that the command serves, each with the address; it ends at once instead of at Ctrl-C."""
    found: list[tuple[LoopbackVehicle, str]] = []

    def serve(vehicles: list[LoopbackVehicle], url: str, *, on_ready: Any) -> None:
        with server.SimServer(vehicles, url) as running:
            on_ready(running)
        found.extend((v, url) for v in vehicles)

    monkeypatch.setattr(server, "serve", serve)
    return found


def test_without_a_mission_there_is_one_copter_in_a_valley_of_the_sample(run: Any, served: list[Any]) -> None:
    code, out, err = run("sim", "--listen", "udpin:127.0.0.1:0", "--misbehave", "refuse=3", "--wind", "5.5,270")
    assert (code, out) == (0, "")
    [(vehicle, url)] = served
    assert (vehicle.sysid, vehicle.autopilot, url) == (1, Autopilot.ARDUCOPTER, "udpin:127.0.0.1:0")
    assert (vehicle.misbehave.refuse, vehicle.wind) == (3, (5.5, 270.0))
    assert "simulating system 1 (arducopter" in err
    assert "connect to udpout:127.0.0.1:" in err
    assert "Ctrl-C ends it" in err


def test_each_vehicle_of_a_mission_stands_at_its_start(run: Any, served: list[Any]) -> None:
    assert run("sim", CROSSING, "--listen", "udpin:127.0.0.1:0")[0] == 0
    [(vehicle, _)] = served
    assert vehicle.sysid == 1
    start = vehicle.home
    assert (start.lat_e7, start.lon_e7) == (366000000, -843800000)
    assert start.amsl_m == pytest.approx(471.0, abs=1.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((CROSSING, "--sysid", 2), "--autopilot and --sysid go without a mission file"),
        (("--autopilot", "paparazzi"), "--autopilot paparazzi: give one of arducopter, arduplane, px4"),
        (("--misbehave", "sulk=1"), "sulk"),
        (("--wind", "up-to:5"), "--wind up-to:5: give M_S,FROM_DEG (5,270)"),
        (("--wind", "76,0"), "at most 75 m/s and 360°"),
    ],
)
def test_what_does_not_go_together_is_refused(run: Any, served: list[Any], arguments: Any, words: str) -> None:
    code, out, err = run("sim", *arguments)
    assert (code, out, served) == (2, "", [])
    assert words in err
