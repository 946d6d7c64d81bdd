"""MAVSDK 4.1 as a vehicle, as a ground station, and as a reader of our files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from gcsplan.mavlink.files.formats import write_plan, write_waypoints
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session import steps
from gcsplan.mavlink.link.session.session import (
    SessionOptions,
    clear_mission,
    upload_items,
    upload_mission,
    verify_mission,
)
from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, TERRAIN, Mission, MissionItem
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from sitl_tests.missions import HOME, a_mission, a_vehicle
from sitl_tests.peers import MavsdkVehicle, item_of, mavsdk_station, row_for
from sitl_tests.wire_json import Row

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
UNCHECKED = SessionOptions(unchecked=True, listen_s=0.1)


def a_fence(n: int) -> list[MissionItem]:
    circles = [MissionItem(5004, 3, (50.5 + i, 0, 0, 0), 366_000_000 + 9000 * i, -843_800_000) for i in range(n)]
    return [*circles, *(MissionItem(5002, 3, (3.0, 0, 0, 0), 367_000_000 + i * i, -843_000_000 + i) for i in range(3))]


def some_rally_points(n: int) -> list[MissionItem]:
    return [MissionItem(5100, 3, x=366_000_000 + i, y=-843_800_000, z=60.0 + i) for i in range(n)]


@pytest.fixture
def hasty_requests(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait only briefly for a vehicle's capabilities and position: MAVSDK's vehicle never sends them."""
    monkeypatch.setattr(steps, "ASK_AGAIN_S", 0.05)


def wires(rows: list[Row]) -> list[bytes]:
    """The wire numbers of each row, NaN equal to NaN."""
    assert [row[0] for row in rows] == list(range(len(rows)))
    return [item_of(row).wire for row in rows]


# ── as a vehicle ──────────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_every_item_arrives_at_a_mavsdk_vehicle_with_the_same_numbers(autopilot: Autopilot) -> None:
    mission = a_mission(autopilot, 60, sysid=7)
    with MavsdkVehicle(sysid=7) as vehicle, Link(vehicle.url) as link:
        result = upload_mission(link, mission, options=UNCHECKED)
        rows = vehicle.received()
        assert result.verified, result.reason
        assert wires(rows) == [item.wire for item in mission.wire_items()]
        assert [row[3] for row in rows] == [1] + [0] * (len(rows) - 1)  # exactly one is current
        assert any("could not be checked" in str(warning) for warning in result.warnings)  # it calls itself generic


@pytest.mark.nightly
@pytest.mark.usefixtures("hasty_requests")
def test_odd_numbers_arrive_at_a_mavsdk_vehicle_bit_by_bit() -> None:
    odd = (
        MissionItem(16, 3, (math.nan, -0.0, 1e-45, 3.4e38), -(2**31), 2**31 - 1, 0.1),
        MissionItem(17, 0, (0.0, 0.0, 0.0, math.nan), 1, -1, -1e-7),
        MissionItem(16, TERRAIN, z=49.995, autocontinue=False),
        MissionItem(31000, 2, (1.0, 2.0, 3.0, 4.0), 123456789, -987654321, 5.0),
    )
    mission = Mission(COPTER, HOME, odd, "odd")
    with MavsdkVehicle() as vehicle, Link(vehicle.url) as link:
        upload_mission(link, mission, options=UNCHECKED)
        assert wires(vehicle.received()) == [item.wire for item in mission.wire_items()]


@pytest.mark.nightly
@pytest.mark.usefixtures("hasty_requests")
def test_all_three_lists_of_a_mavsdk_vehicle_are_kept_apart() -> None:
    mission = a_mission(PX4, 12)
    with MavsdkVehicle() as vehicle, Link(vehicle.url) as link:
        assert upload_mission(link, mission, options=UNCHECKED).verified
        for mission_type, items in ((FENCE, a_fence(3)), (RALLY, some_rally_points(4))):
            assert upload_items(link, 1, items, PX4, mission_type, options=UNCHECKED).verified
        cleared = clear_mission(link, 1, FENCE, options=UNCHECKED)
        assert cleared.verified, cleared.reason
        assert verify_mission(link, mission, options=UNCHECKED).verified


# ── as a ground station ───────────────────────────────────────────────────────────────────────────────────────────


def as_mavsdk_reads(item: MissionItem, frames: dict[int, int]) -> bytes:
    return MissionItem(
        item.command, frames.get(item.frame, item.frame), item.params, item.x, item.y, item.z, item.autocontinue
    ).wire


@pytest.mark.parametrize("autopilot", [PX4, COPTER, PLANE])
def test_mavsdk_takes_our_vehicle_for_one_and_its_missions_survive(autopilot: Autopilot) -> None:
    vehicle = a_vehicle(autopilot, sysid=3)
    sent = list(a_mission(autopilot, 40).wire_items())
    rows = [row_for(n, item, current=int(n == 0)) for n, item in enumerate(sent)]
    fence = [row_for(n, item, FENCE, current=int(n == 0)) for n, item in enumerate(a_fence(2))]
    rally = [row_for(n, item, RALLY, current=int(n == 0)) for n, item in enumerate(some_rally_points(2))]
    with SimServer([vehicle], "udpin:127.0.0.1:0") as server:
        answers = mavsdk_station(
            server.url_for_gcs,
            [
                ["upload", MISSION, rows],
                ["download", MISSION],
                ["upload", FENCE, fence],
                ["download", FENCE],
                ["upload", RALLY, rally],
                ["download", RALLY],
            ],
        )
        assert server.mishandled == 0
    assert answers[0::2] == ["SUCCESS"] * 3
    for mission_type, back in zip((MISSION, FENCE, RALLY), answers[1::2], strict=True):
        assert wires(back) == [item.wire for item in vehicle.items(mission_type)]
    if autopilot is PX4:  # it keeps items as sent, except that it uses the _INT numbers of the frames
        assert wires(answers[1]) == [
            as_mavsdk_reads(MissionItem(i.command, i.frame, (*i.params[:3], b.params[3]), i.x, i.y, i.z), {0: 5, 3: 6})
            for i, b in zip(sent, vehicle.items(), strict=True)
        ]
        assert all(
            i.params[3] == pytest.approx(b.params[3], abs=1e-4) for i, b in zip(sent, vehicle.items(), strict=True)
        )


@pytest.mark.nightly
def test_mavsdk_clears_our_vehicle_and_hears_each_refusal() -> None:
    vehicle = a_vehicle(PX4)
    good = [row_for(n, item, current=int(n == 0)) for n, item in enumerate(a_mission(PX4, 6).items)]
    bad = [*good[:3], row_for(3, MissionItem(16, TERRAIN, z=50.0))]
    with SimServer([vehicle], "udpin:127.0.0.1:0") as server:
        answers = mavsdk_station(server.url_for_gcs, [["upload", MISSION, good], ["upload", MISSION, bad]])
        assert answers == ["SUCCESS", {"failed": "UNSUPPORTED"}]
        assert len(vehicle.items()) == 6  # PX4 keeps the old one
        assert mavsdk_station(server.url_for_gcs, [["clear"]]) == ["SUCCESS"]
    assert vehicle.items() == ()


# ── as a reader of our files ──────────────────────────────────────────────────────────────────────────────────────


def imported(autopilot: Autopilot, steps: list[list[Any]]) -> list[Any]:
    with SimServer([a_vehicle(autopilot)], "udpin:127.0.0.1:0") as server:
        return mavsdk_station(server.url_for_gcs, steps)


@pytest.mark.nightly
def test_mavsdk_imports_our_plan_exactly(tmp_path: Path) -> None:
    mission = a_mission(PX4, 50)
    unturned = MissionItem(17, 3, (0.0, 0.0, 25.0, math.nan), 366_000_001, -843_800_001, 70.0)
    mission = Mission(PX4, mission.home, (*mission.items[:-1], unturned), "uav1")
    fence, rally = a_fence(2), some_rally_points(2)
    file = tmp_path / "uav1.plan"
    file.write_text(write_plan(mission, fence=fence, rally=rally))
    ((items, fences, rallies),) = imported(PX4, [["import_plan", str(file)]])
    assert wires(items) == [item.wire for item in mission.items]
    assert [row[3] for row in items] == [1] + [0] * (len(items) - 1)
    assert {(r[2], r[9], r[10]) for r in fences} == {(i.command, i.x, i.y) for i in fence}
    assert [(r[2], r[9], r[10], float.fromhex(r[11])) for r in rallies] == [(i.command, i.x, i.y, i.z) for i in rally]


@pytest.mark.parametrize(("autopilot", "homes"), [(COPTER, 2), (PLANE, 2), (PX4, 1)])
def test_mavsdk_imports_our_waypoints_after_its_leading_homes(autopilot: Autopilot, homes: int, tmp_path: Path) -> None:
    # For PX4 MAVSDK keeps our home row as an item, for ArduPilot it adds another home before it; both are known.
    mission = a_mission(autopilot, 50)
    file = tmp_path / "uav1.waypoints"
    file.write_bytes(write_waypoints(mission).encode())
    ((items, fences, rallies),) = imported(autopilot, [["import_waypoints", str(file)]])
    assert (fences, rallies) == ([], [])
    assert [item_of(row).wire for row in items[homes:]] == [item.wire for item in mission.items]
    (home,) = {(r[2], r[9], r[10]) for r in items[homes - 1 : homes]}
    assert home == (16, HOME.lat_e7, HOME.lon_e7)
