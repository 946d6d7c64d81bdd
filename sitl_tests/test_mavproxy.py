"""MAVProxy, if installed (pip install MAVProxy), as a router behind a bad radio."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from gcsplan.app.upload.position_tolerance import CUTTING, shift_of
from gcsplan.errors import GcsplanError
from gcsplan.mavlink.files.formats import write_waypoints
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session.session import SessionOptions, UploadOrder, upload_fleet
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from sitl_tests.missions import a_mission, a_vehicle
from sitl_tests.relay import LossyRelay

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("MAVProxy") is None, reason="MAVProxy is not installed"),
]

COPTER, PX4 = Autopilot.ARDUCOPTER, Autopilot.PX4


@contextmanager
def mavproxy(master: str, folder: Path, *more: str, typed: bool = False) -> Iterator[subprocess.Popen[bytes]]:
    """Run MAVProxy in ``folder`` until the context ends; ``typed``: commands may be written to its standard input."""
    script = next(
        p for base in map(Path, sys.path) for p in (base / "bin" / "mavproxy.py", base / "mavproxy.py") if p.is_file()
    )
    command = [
        sys.executable, str(script), f"--master={master}", "--default-modules=wp",
        *([] if typed else ["--daemon", "--non-interactive"]), f"--state-basedir={folder}", "--source-system=250",
        *more,
    ]  # fmt: skip
    environment = {**os.environ, "MAVLINK20": "1", "HOME": str(folder)}
    with (folder / "mavproxy.txt").open("wb") as log:
        source = subprocess.PIPE if typed else subprocess.DEVNULL
        process = subprocess.Popen(command, cwd=folder, env=environment, stdin=source, stdout=log, stderr=log)
        try:
            yield process
        finally:
            process.kill()
            if process.stdin is not None:
                process.stdin.close()
            process.wait(10.0)


def test_what_mavproxy_loads_itself_is_named_as_its_writing(tmp_path: Path) -> None:
    """MAVProxy's own ``wp load`` cuts degrees: nothing but positions differs, by a centimetre, and it is named."""
    mission = a_mission(COPTER, 60)
    file = tmp_path / "uav1.waypoints"
    file.write_bytes(write_waypoints(mission).encode())
    board = a_vehicle(COPTER)
    with (
        SimServer([board], "udpin:127.0.0.1:0") as server,
        mavproxy(server.url_for_gcs, tmp_path, typed=True) as process,
    ):
        deadline = time.monotonic() + 60.0

        def until(done: Callable[[], bool]) -> None:
            while not done() and time.monotonic() < deadline:
                time.sleep(0.2)

        until(lambda: "online system" in (tmp_path / "mavproxy.txt").read_text(errors="replace"))
        assert process.stdin is not None
        process.stdin.write(f"wp load {file}\n".encode())
        process.stdin.flush()
        until(lambda: len(board.items()) == len(mission.wire_items()))
    log = (tmp_path / "mavproxy.txt").read_text(errors="replace")
    found = faults(compare(mission.wire_items(), board.items(), COPTER))
    shift = shift_of(mission, board.items(), found)
    assert shift is not None, log
    assert shift.sender == CUTTING
    assert shift.most_m < 0.016


@pytest.mark.parametrize(
    ("autopilot", "loss", "seed"), [(COPTER, 0.0, 1), (PX4, 0.1, 2), (COPTER, 0.3, 3), (PX4, 0.6, 4)]
)
def test_what_is_called_verified_through_mavproxy_is_on_board(
    autopilot: Autopilot, loss: float, seed: int, tmp_path: Path
) -> None:
    board, mission = a_vehicle(autopilot), a_mission(autopilot, 15)
    options = SessionOptions(unchecked=True, timeout_s=10.0 if loss else 30.0, discover_s=30.0)
    with (
        SimServer([board], "udpin:127.0.0.1:0") as server,
        LossyRelay(server.address, loss=loss, seed=seed) as relay,
        Link("udpin:127.0.0.1:0") as link,
        mavproxy(relay.url, tmp_path, f"--out=udpout:{link.place}"),
    ):
        (result,) = upload_fleet([UploadOrder(link, mission, options=options)])
    log = (tmp_path / "mavproxy.txt").read_text(errors="replace")
    if isinstance(result, GcsplanError):
        assert result.exit_code in (5, 6), log
        assert loss > 0.2, (result, log)
        return
    if result.verified:
        assert not faults(compare(mission.wire_items(), board.items(), autopilot))
    assert result.verified or loss > 0.2, result.reason
