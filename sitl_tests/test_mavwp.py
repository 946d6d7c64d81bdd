"""pymavlink's reader of way point files, which MAVProxy uses, reads our files."""

from __future__ import annotations

from pathlib import Path

import pytest
from pymavlink import mavwp

from gcsplan.mavlink.files.formats import read_mission_file, write_waypoints
from gcsplan.mavlink.mission.mission import float32
from gcsplan.vehicle import Autopilot
from sitl_tests.missions import a_mission

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")


@pytest.mark.first_quick
@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_mavwp_reads_our_waypoints(autopilot: Autopilot, tmp_path: Path) -> None:
    mission = a_mission(autopilot, 60)
    file = tmp_path / "uav1.waypoints"
    file.write_bytes(write_waypoints(mission).encode())
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(file)) == 61
    home, *items = (loader.wp(n) for n in range(loader.count()))
    assert (round(home.x * 1e7), round(home.y * 1e7), home.z) == (
        mission.home.lat_e7,
        mission.home.lon_e7,
        mission.home.amsl_m,
    )
    for seq, (read, ours) in enumerate(zip(items, mission.items, strict=True), start=1):
        assert (read.seq, read.command, read.frame, read.autocontinue) == (seq, ours.command, ours.frame, 1)
        assert (round(read.x * 1e7), round(read.y * 1e7)) == (ours.x, ours.y)
        assert tuple(float32(p) for p in (read.param1, read.param2, read.param3, read.param4)) == ours.params
        assert float32(read.z) == ours.z


def test_what_mavwp_saves_is_read_to_its_six_decimals(tmp_path: Path) -> None:
    mission = a_mission(Autopilot.ARDUCOPTER, 20)
    ours, theirs = tmp_path / "ours.waypoints", tmp_path / "theirs.waypoints"
    ours.write_bytes(write_waypoints(mission).encode())
    loader = mavwp.MAVWPLoader()
    loader.load(str(ours))
    loader.save(str(theirs))
    read = read_mission_file(theirs, autopilot=Autopilot.ARDUCOPTER).mission
    assert [i.command for i in read.items] == [i.command for i in mission.items]
    for a, b in zip(read.items, mission.items, strict=True):
        assert abs(a.x - b.x) <= 6
        assert abs(a.y - b.y) <= 6
