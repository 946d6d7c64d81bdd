"""MAVProxy, if installed (pip install MAVProxy), as a router behind a bad radio."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from gcsplan.errors import GcsplanError
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session import SessionOptions, UploadOrder, upload_fleet
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.sim.server import SimServer
from gcsplan.vehicle import Autopilot
from sitl_tests.missions import a_mission, a_vehicle
from sitl_tests.relay import LossyRelay

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("MAVProxy") is None, reason="MAVProxy is not installed"),
]

COPTER, PX4 = Autopilot.ARDUCOPTER, Autopilot.PX4


@contextmanager
def mavproxy(master: str, folder: Path, *more: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run MAVProxy in ``folder`` until the context ends."""
    script = next(
        p for base in map(Path, sys.path) for p in (base / "bin" / "mavproxy.py", base / "mavproxy.py") if p.is_file()
    )
    command = [
        sys.executable, str(script), f"--master={master}", "--daemon", "--non-interactive", "--default-modules=wp",
        f"--state-basedir={folder}", "--source-system=250", *more,
    ]  # fmt: skip
    environment = {**os.environ, "MAVLINK20": "1", "HOME": str(folder)}
    with (folder / "mavproxy.txt").open("wb") as said:
        process = subprocess.Popen(
            command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=said, stderr=said
        )
        try:
            yield process
        finally:
            process.kill()
            process.wait(10.0)


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
    said = (tmp_path / "mavproxy.txt").read_text(errors="replace")
    if isinstance(result, GcsplanError):
        assert result.exit_code in (5, 6), said
        assert loss > 0.2, (result, said)
        return
    if result.verified:
        assert not faults(compare(mission.wire_items(), board.items(), autopilot))
    assert result.verified or loss > 0.2, result.reason
