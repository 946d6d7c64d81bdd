"""Uploads of a plan: who is reached over which link."""

from __future__ import annotations

from typing import Any

import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.upload import run as uploads
from gcsplan.app.upload.job import UploadOptions
from gcsplan.errors import UsageError
from gcsplan.mission_file import load_mission
from gcsplan.sim.vehicle.server import loopback_fleet

PORTS = ("udpout:127.0.0.1:14560", "udpout:127.0.0.1:14570")


def two(**changes: Any) -> dict[str, Any]:
    """Two vehicles of one system id, each with a link of its own."""
    vehicles = [
        {
            "name": f"uav{k + 1}", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 12], "link": PORTS[k],
            "start": {"east_m": 0, "north_m": 500.0 * k}, "goal": {"east_m": 900, "north_m": 500.0 * k},
        }
        for k in range(2)
    ]  # fmt: skip
    return {
        "version": 1, "terrain": {"flat_m": 100}, "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        "limits": {"min_agl_m": 30}, "vehicles": vehicles,
    } | changes  # fmt: skip


def test_two_of_one_system_id_are_not_sent_over_one_link() -> None:
    vehicles = [r.vehicle for r in load_mission(two()).vehicles]
    assert uploads.targets(["link"], vehicles) == dict(zip(("uav1", "uav2"), PORTS, strict=True))
    assert uploads.targets(["sim"], vehicles) == {"uav1": "sim", "uav2": "sim"}
    assert uploads.targets([f"uav1={PORTS[1]}"], vehicles) == {"uav1": PORTS[1]}
    same = PORTS[1].replace("127.0.0.1", "localhost") + ",5000"  # the same place, written otherwise
    for where in ([PORTS[0]], ["link", f"uav1={PORTS[1]}"], ["link", f"uav1={same}"]):
        with pytest.raises(UsageError, match="uav1 and uav2 both have system id 1") as caught:
            uploads.targets(where, vehicles)
        assert "a link of its own" in str(caught.value)


def test_simulated_vehicles_of_one_system_id_are_told_apart() -> None:
    planned = plan(two())
    jobs = uploads.jobs_of(planned, {"uav1": "sim", "uav2": "sim"})
    done = uploads.run_jobs(jobs, UploadOptions(), simulator=loopback_fleet)
    assert [(d.vehicle, d.outcome, d.verified) for d in done] == [
        ("uav1", "accepted", True), ("uav2", "accepted", True),
    ]  # fmt: skip
