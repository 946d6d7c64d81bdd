"""Fences made from zones, with MAVSDK as a vehicle and as a reader of plans, and with real ArduPilots."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gcsplan.mavlink.build.fence import Fence, areas_of, fence_of
from gcsplan.mavlink.files.formats import write_plan
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session import steps
from gcsplan.mavlink.link.session.session import SessionOptions, clear_mission, download_items, upload_items
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.mavlink.mission.mission import FENCE, Mission
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from sitl_tests import sitl
from sitl_tests.missions import a_mission, a_vehicle
from sitl_tests.peers import MavsdkVehicle, item_of, mavsdk_station

COPTER, PX4 = Autopilot.ARDUCOPTER, Autopilot.PX4
FRAME = Frame(36.6, -84.38)
ZONES = (
    Zone("yard", Circle(900.0, 400.0, 120.5)),
    Zone("field", Polygon(np.array([[-900.0, -900], [-500, -950], [-300, -500], [-700, -300], [-1000, -600]]))),
    Zone("mast", Circle(0.0, 1500.0, 60.0), None, Level(100.0, "agl")),
    Zone("pond", Circle(-1500.0, 0.0, 80.0)),
)
QUICK = SessionOptions(unchecked=True, listen_s=0.1)


def a_fence(autopilot: Autopilot) -> Fence:
    fence = fence_of(ZONES, FRAME, autopilot)
    assert fence.left_out == ("mast",)
    assert len(fence.items) == 1 + 5 + 1
    return fence


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_a_fence_arrives_at_a_mavsdk_vehicle_and_reads_back(
    autopilot: Autopilot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(steps, "ASK_AGAIN_S", 0.05)  # it never sends its capabilities or its position
    fence = a_fence(autopilot)
    with MavsdkVehicle(sysid=4) as vehicle, Link(vehicle.url) as link:
        result = upload_items(link, 4, fence.items, autopilot, FENCE, options=QUICK)
        assert result.verified, result.differences
        read = download_items(link, 4, FENCE, options=QUICK)
    assert faults(compare(fence.items, read, autopilot, FENCE)) == ()
    assert len(areas_of(read, FRAME)) == 3


@pytest.mark.nightly
def test_mavsdk_imports_the_fence_of_a_plan(tmp_path: Path) -> None:
    fence = a_fence(PX4)
    mission: Mission = a_mission(PX4, 8)
    file = tmp_path / "uav1.plan"
    file.write_text(write_plan(mission, fence=fence.items))
    with SimServer([a_vehicle(PX4)], "udpin:127.0.0.1:0") as server:
        ((_, fences, _),) = mavsdk_station(server.url_for_gcs, [["import_plan", str(file)]])
    items = [item_of(row) for row in fences]
    numbers = [(i.command, i.params, i.x, i.y) for i in items]
    assert sorted(numbers) == sorted((i.command, i.params, i.x, i.y) for i in fence.items)
    assert len(areas_of(items, FRAME)) == 3


@sitl.either()
def test_a_real_ardupilot_keeps_a_fence(autopilot: Autopilot, tmp_path: Path) -> None:
    fence = a_fence(autopilot)
    with sitl.running(autopilot, tmp_path) as link:
        sitl.ready(link, 1, autopilot)
        result = upload_items(link, 1, fence.items, autopilot, FENCE, options=QUICK)
        assert result.verified, (result.reason, result.differences)
        read = download_items(link, 1, FENCE, options=QUICK)
        assert faults(compare(fence.items, read, autopilot, FENCE)) == ()
        circles = [Zone(f"c{i}", Circle(200.0 * i, 3000.0, 40.0)) for i in range(42)]
        full = upload_items(link, 1, fence_of(circles, FRAME, autopilot).items, autopilot, FENCE, options=QUICK)
        assert full.verified, (full.reason, full.differences)
        assert clear_mission(link, 1, FENCE, options=QUICK).verified
