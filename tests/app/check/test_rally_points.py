"""A `.plan`'s own fence and rally points: judged, sent before the mission, read back, or named as not sent."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from gcsplan.cli import main as cli
from gcsplan.mavlink.mission.mission import FENCE, RALLY
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.support.fences import COPTER
from tests.support.impatient import be_impatient

PX4 = (12, 2)
MISSION = """version: 1
name: lists
terrain: {{flat_m: 300}}
limits: {{min_agl_m: 30, horizontal_clearance_m: 20, track_error_m: 3, altitude_error_m: 5}}
no_fly:
  - {{name: mast, center: [36.603, -84.370], radius_m: 60}}
vehicles:
  - {{name: uav1, sysid: 1, autopilot: {autopilot}, start: [36.600, -84.380], goal: [36.600, -84.370]}}
"""
OUT = {"inclusion": False, "circle": {"center": [36.61, -84.36], "radius": 80}, "version": 1}
IN = {
    "inclusion": True, "version": 1,
    "polygon": [[36.59, -84.39], [36.59, -84.35], [36.62, -84.35], [36.62, -84.39]],
}  # fmt: skip


@pytest.fixture(params=["arducopter", "px4"])
def run(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path, request: pytest.FixtureRequest
) -> Any:
    monkeypatch.chdir(tmp_path)
    be_impatient(monkeypatch)
    (tmp_path / "m.yaml").write_text(MISSION.format(autopilot=request.param))

    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["gcsplan", *arguments])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = capfd.readouterr()
        assert isinstance(ended.value.code, int)
        return ended.value.code, out, err

    assert call("plan", "m.yaml", "-o", "out")[0] == 0
    return call


def brings(points: list[list[float]], *shapes: dict[str, Any]) -> None:
    file = Path("out/uav1.plan")
    plan = json.loads(file.read_text())
    plan["geoFence"] = {
        "version": 2,
        "circles": [s for s in shapes if "circle" in s],
        "polygons": [s for s in shapes if "polygon" in s],
    }
    plan["rallyPoints"] = {"version": 2, "points": points}
    file.write_text(json.dumps(plan))


def board(call: Any) -> LoopbackVehicle:
    pilot = json.loads(Path("out/uav1.plan").read_text())["mission"]["firmwareType"]
    kind = COPTER if pilot == 3 else Autopilot.PX4
    return LoopbackVehicle(1, kind, lat_deg=36.6, lon_deg=-84.38, amsl_m=300.0)


@pytest.mark.slow
def test_own_lists_are_sent_read_back_and_named_where_they_are_not(run: Any) -> None:
    brings([[36.6, -84.375, 0.0], [36.6, -84.372, 0.0]], OUT, IN)
    vehicle = board(run)
    with SimServer([vehicle], "udpin:127.0.0.1:0", speedup=10.0) as server:
        to = ("upload", "out/uav1.plan", "--to", server.url_for_gcs, "--mission", "m.yaml", "--json")
        code, out, _ = run(*to)
        assert code == 0, out
        (told,) = json.loads(out)["vehicles"]
        assert not {"fence", "rally"} & set(told)
        words = " ".join(told["warnings"])
        assert "geoFence (5 items) is not sent: --fence sends it" in words
        assert "rallyPoints (2 items) is not sent: --rally sends it" in words
        code, out, _ = run(*to, "--fence", "--rally", "--way-home")
        assert code == 0, out
        (told,) = json.loads(out)["vehicles"]
        assert told["fence"] == {**told["fence"], "verified": True, "items": 6}  # the zone, and five of the file
        assert told["rally"] == {**told["rally"], "verified": True, "items": 2}
        assert "2 rally points are on board too, read back and compared" in told["warnings"]
        assert not any("is not sent" in w for w in told["warnings"])
        assert [(i.x, i.y) for i in vehicle.items(RALLY)] == [(366000000, -843750000), (366000000, -843720000)]
        assert len(vehicle.items(FENCE)) == 6
        # Without a world the file's own lists go alone.
        code, out, _ = run("upload", "out/uav1.plan", "--to", server.url_for_gcs, "--unchecked", "--fence", "--rally")
        assert code == 0, out
        assert len(vehicle.items(FENCE)) == 5


@pytest.mark.slow
def test_a_zone_that_the_files_fence_has_already_is_sent_once(run: Any) -> None:
    assert run("plan", "m.yaml", "-o", "out", "--fence")[0] == 0
    vehicle = board(run)
    with SimServer([vehicle], "udpin:127.0.0.1:0", speedup=10.0) as server:
        to = ("upload", "out/uav1.plan", "--to", server.url_for_gcs, "--mission", "m.yaml", "--fence")
        assert run(*to)[0] == 0
    assert len(vehicle.items(FENCE)) == 1


def test_rally_points_in_zones_underground_or_outside_the_fence_are_refused(run: Any) -> None:
    small = {**IN, "polygon": [[36.598, -84.383], [36.598, -84.368], [36.602, -84.368], [36.602, -84.383]]}
    for points, shapes, words in (
        ([[36.603, -84.3701, 0.0]], (), "rally point 1, where a return would land: inside no-fly zone “mast”"),
        ([[36.6, -84.374, 0.0], [36.6, -84.375, -40.0]], (), "rally point 2 is flown over at 260"),
        ([[36.61, -84.375, 0.0]], (small,), "rally point 1, where a return would land: leaves the fence's area"),
        ([[37.9, -84.375, 0.0]], (), "rally point 1"),
    ):
        brings(points, *shapes)
        code, out, err = run("check", "m.yaml", "out/uav1.plan", "-q")
        if "260" in words and "arducopter" in Path("m.yaml").read_text():
            assert code == 0, "ArduCopter returns no lower than RTL_ALT"
            continue
        assert code == 4, words
        assert words in out + err


@pytest.mark.slow
def test_returns_lead_to_the_nearest_rally_point(run: Any) -> None:
    """A point behind the mast's zone makes a return fly through it, though the way home is clear."""
    for points, code in (([], 0), ([[36.6, -84.379, 0.0]], 0), ([[36.6, -84.379, 0.0], [36.605, -84.37, 0.0]], 4)):
        brings(points)
        ended, out, err = run("check", "m.yaml", "out/uav1.plan", "--require-way-home")
        assert ended == code, out + err
        assert ("no safe return" in out + err) == (code == 4)


WALL = """version: 1
name: wall
terrain: {dem: sample:jacksboro}
limits: {min_agl_m: 60, horizontal_clearance_m: 30, track_error_m: 3, altitude_error_m: 5}
no_fly:
  - {name: wall, center: [36.612, -84.345], radius_m: 900}
vehicles:
  - {name: uav1, sysid: 1, autopilot: arducopter, start: [36.6175, -84.3892], goal: [36.6133, -84.3000],
     rtl_rel_home_m: 100}
planner: {gap_percent: 5}
"""


@pytest.mark.slow
@pytest.mark.parametrize("run", ["arducopter"], indirect=True)
def test_proposed_points_are_sent_and_judged_again_as_the_plan_says(run: Any) -> None:
    Path("m.yaml").write_text(WALL)
    code, out, err = run("plan", "m.yaml", "-o", "out", "--rally", "--upload", "sim", "--json")
    assert code == 0, err
    (told,) = json.loads(out)["vehicles"]
    count = len(told["way_home"]["rally"])
    assert count > 0
    assert told["upload"]["rally"] == {**told["upload"]["rally"], "verified": True, "items": count}
    code, out, _ = run("check", "m.yaml", "out/uav1.plan", "--way-home", "--json")
    again = json.loads(out)["verdicts"][0]
    assert again["rally_points"] == count
    assert again["way_home"]["no_return_m"] == pytest.approx(told["way_home"]["set_leaves_m"], abs=5.0)
