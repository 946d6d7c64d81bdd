"""Zones as fences and back, fences held against their missions, and sent over bad links to both kinds of autopilot."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gcsplan.app.check import fence_breaches
from gcsplan.app.upload import fence as fencing
from gcsplan.app.upload import run as uploads
from gcsplan.app.upload.on_board import judge_on_board
from gcsplan.check.judge import judge
from gcsplan.cli import main as cli
from gcsplan.errors import InputError
from gcsplan.mavlink.build.fence import areas_of, fence_of
from gcsplan.mavlink.build.multirotor import build_mission
from gcsplan.mavlink.build.order import Order
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session import session
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.autopilots import stored
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.mavlink.mission.mission import FENCE, Mission, MissionItem
from gcsplan.mavlink.protocol.messages import Address
from gcsplan.mavlink.protocol.transfer import VerifiedUpload
from gcsplan.notes.note import Note
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.server import SimServer, loopback_fleet
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.outside import outside_of
from gcsplan.world.geometry.path import Path as FlightPath
from gcsplan.world.geometry.zones import AreaPart, Circle, KeepIn, Level, Polygon, Zone
from gcsplan.world.world import World
from tests.support import lossy
from tests.support.effort import draws
from tests.support.fences import COPTER, FRAME, corners, metres, mission_in
from tests.support.impatient import be_impatient
from tests.support.lossy import Weather
from tests.support.worlds import vehicle, world


def square(east: float, north: float, half_m: float, name: str = "square", **levels: Level) -> Zone:
    ring = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half_m + [east, north]
    return Zone(name, Polygon(ring.astype(float)), **levels)


@st.composite
def zones(draw: st.DrawFn) -> Zone:
    east, north, size = draw(metres), draw(metres), draw(st.floats(5.0, 3000.0))
    if draw(st.booleans()):
        return Zone("z", Circle(east, north, size))
    turns = sorted(draw(st.lists(st.floats(0.0, 6.28), min_size=3, max_size=12, unique_by=lambda a: round(a, 1))))
    radii = draw(st.lists(st.floats(0.5 * size, size), min_size=len(turns), max_size=len(turns)))
    ring = np.array([[east + r * math.cos(a), north + r * math.sin(a)] for a, r in zip(turns, radii, strict=True)])
    polygon = shapely.Polygon(ring)
    if len(turns) < 3 or not polygon.is_valid or polygon.area < 20.0 or not polygon.exterior.is_ccw:
        return Zone("z", Circle(east, north, size))
    return Zone("z", Polygon(ring))


FIVE = np.array([(3.0, 0.0), (1.621, 2.524), (-5.546, 2.29), (-3.96, 0.564), (1.418, -4.795)])


def outline(shape: Circle | Polygon) -> shapely.Polygon:
    if isinstance(shape, Polygon):
        return shapely.Polygon(shape.vertices)
    return shapely.Point(shape.east_m, shape.north_m).buffer(shape.radius_m, 256)


@pytest.mark.slow
@settings(max_examples=draws(80))
@given(zones(), st.sampled_from(list(Autopilot)))
@example(Zone("two corners as far out", Polygon(FIVE)), Autopilot.ARDUCOPTER)
def test_a_zone_comes_back_from_its_items_as_they_are_stored(zone: Zone, autopilot: Autopilot) -> None:
    fence = fence_of([zone], FRAME, autopilot)
    kept = [stored(item, autopilot) for item in fence.items]
    (area,) = areas_of(kept, FRAME)
    assert area.inclusion is False
    assert all(item.frame == m.GLOBAL and math.isfinite(item.params[0]) for item in fence.items)
    if isinstance(zone.shape, Circle):
        assert isinstance(area.shapes[0], Circle)
        assert -1e-3 <= area.shapes[0].radius_m - zone.shape.radius_m <= 0.011
        off = math.hypot(area.shapes[0].east_m - zone.shape.east_m, area.shapes[0].north_m - zone.shape.north_m)
        assert off < 0.01
    else:
        # Between its corners a fence is straight in degrees, a zone here straight in the plane.
        places = np.array([(item.lat_deg, item.lon_deg) for item in kept])
        bow_m = float(FRAME.bow_m(places, np.roll(places, -1, axis=0)).max())
        assert outline(area.shapes[0]).hausdorff_distance(outline(zone.shape)) < 0.12 + bow_m
        if bow_m > 0.05:
            return
    # Made again of what came back, it is the same to the bit, from whichever corner on.
    again = fence_of([Zone("z", area.shapes[0])], FRAME, autopilot).items
    assert any(again[k:] + again[:k] == fence.items for k in range(len(again)))


def test_corners_that_only_follow_a_straight_edge_are_left_out() -> None:
    side = np.linspace(-500, 500, 21)[:-1]
    ring = np.concatenate(
        [
            np.c_[side, side * 0 - 500],
            np.c_[side * 0 + 500, side],
            np.c_[-side, side * 0 + 500],
            np.c_[side * 0 - 500, -side],
        ]
    )
    fence = fence_of([Zone("z", Polygon(ring))], FRAME, COPTER)
    assert len(fence.items) == 4
    (area,) = areas_of(fence.items, FRAME)
    assert outline(area.shapes[0]).symmetric_difference(outline(Polygon(ring))).area < 30.0


def test_zones_with_a_floor_or_a_ceiling_are_left_out_and_named_or_taken_to_the_sky() -> None:
    mast = Zone("mast", Circle(0, 0, 60), None, Level(100, "agl"))
    shelf = square(3000, 0, 200, "shelf", floor=Level(900, "amsl"))
    yard = Zone("yard", Circle(1000, 0, 50))
    fence = fence_of([mast, shelf, yard], FRAME, COPTER)
    assert [z.name for z in fence.zones] == ["yard"]
    assert fence.left_out == ("mast", "shelf")
    assert Note("fence_leaves_out", names=("'mast'", "'shelf'")) in fence.notes
    whole = fence_of([mast, shelf, yard], FRAME, COPTER, infinite=True)
    assert len(whole.items) == 1 + 4 + 1
    assert whole.left_out == ()
    assert [note.code for note in whole.notes] == ["fence_without_heights"]


def circles(count: int) -> list[Zone]:
    return [Zone(f"c{i}", Circle(100.0 * i, 0, 40)) for i in range(count)]


def test_circles_in_circles_are_joined_and_more_than_arducopter_keeps_are_refused() -> None:
    assert len(fence_of(circles(42), FRAME, COPTER).items) == 42
    with pytest.raises(InputError, match=r"43 circle.*42 circles"):
        fence_of(circles(43), FRAME, COPTER)
    assert len(fence_of(circles(43), FRAME, Autopilot.PX4).items) == 43
    with pytest.raises(InputError, match="keeps 64"):
        fence_of(circles(65), FRAME, Autopilot.PX4)
    inside = [Zone("big", Circle(0, 0, 9000)), *circles(60), Zone("big too", Circle(0, 0, 9000))]
    fence = fence_of(inside, FRAME, COPTER)
    assert [z.name for z in fence.zones] == ["big"]
    assert fence.notes[0].code == "fence_circles_inside"
    ring = np.array([[1000 * math.cos(a), 1000 * math.sin(a)] for a in np.linspace(0, 2 * math.pi, 71)[:-1]])
    with pytest.raises(InputError, match="70 corners"):
        fence_of([Zone("round", Polygon(ring))], FRAME, COPTER)


@pytest.mark.parametrize(
    ("items", "said"),
    [
        ([MissionItem(5004, 0, (math.nan, 0, 0, 0), 1, 1)], "radius"),
        ([MissionItem(5002, 0, (3, 0, 0, 0), 1, 1)] * 2, "not whole"),
        ([MissionItem(5002, 0, (2, 0, 0, 0), 1, 1)] * 2, "not whole"),
        ([MissionItem(16, 0)], "command 16"),
        ([MissionItem(5002, 0, (3, 0, 0, 0), i, i) for i in (0, 1, 2)], "touches"),
        ([MissionItem(5001, 0, (3, 0, 0, 0), i, 0) for i in (0, 1, 0)], "3 different points"),
        ([MissionItem(5001, 0, (4, 0, 0, 0), x, y) for x, y in ((0, 0), (9, 9), (9, 0), (0, 9))], "crosses"),
    ],
)
def test_what_is_no_fence_is_refused(items: list[MissionItem], said: str) -> None:
    with pytest.raises(InputError, match=said):
        areas_of(items, FRAME)


def inside_in_degrees(lat: float, lon: float, ring: list[tuple[float, float]]) -> bool:
    """By the crossings of its parallel to the east; no edge goes farther round than half a turn."""
    crossings = 0
    for (lat0, lon0), (lat1, lon1) in zip(ring, ring[1:] + ring[:1], strict=True):
        if (lat0 > lat) != (lat1 > lat):
            crossings += lon0 + (lat - lat0) / (lat1 - lat0) * (lon1 - lon0) > lon
    return crossings % 2 == 1


@pytest.mark.nightly_but("0.01", "0.5", "95.0")
@pytest.mark.slow
@pytest.mark.parametrize("far", [0.01, 0.5, 3.0, 30.0, 84.3, 90.0, 95.0])
def test_a_fences_edges_are_straight_in_degrees_however_far_its_corners_are(far: float) -> None:
    """The plane bends long edges by hundreds of metres, and has no place for what is a quarter of the globe away."""
    rng = np.random.default_rng(int(far * 100))
    for _ in range(6):
        near = [(36.6 + a, -84.3 + b) for a, b in rng.uniform(-0.05, 0.05, (2, 2))]
        ring = [*near, (float(np.clip(36.6 + rng.uniform(-far, far), -89, 89)), -84.3 + far)]
        (area,) = areas_of(corners(5002, *ring), FRAME)
        shape = shapely.union_all([outline(s) for s in area.shapes])
        found = 0
        for lat, lon in rng.uniform((36.54, -84.36), (36.66, -84.24), (400, 2)):
            point = shapely.Point(*FRAME.to_plane(lat, lon))
            if shape.boundary.distance(point) > 0.2:
                assert shape.contains(point) == inside_in_degrees(lat, lon, ring), (ring, lat, lon)
                found += shape.contains(point)
        assert 0 < found < 400 or far < 0.1


@pytest.mark.parametrize("command", [5003, 5004])
def test_areas_far_away_have_no_shape_and_places_that_are_none_are_refused(command: int) -> None:
    circle = MissionItem(command, 0, (900.0, 0, 0, 0), 0, 57_000_000)
    polygon = corners(command - 2, (0.0, 5.7), (1.0, 5.7), (1.0, 6.5))
    assert [a.shapes for a in areas_of([circle, *polygon], FRAME)] == [(), ()]
    assert [a.inclusion for a in areas_of([circle, *polygon], FRAME)] == [command == 5003] * 2
    for wrong in (replace(circle, x=2**31 - 1), replace(circle, y=-(2**31)), replace(circle, params=(1e6, 0, 0, 0))):
        with pytest.raises(InputError, match=r"item 1 .*(not a place|100000 m)"):
            areas_of([MissionItem(5000, 0), wrong], FRAME)


# -- held against the mission ---------------------------------------------------------------------------------------


def test_a_vehicle_whose_parameters_cut_a_corner_into_the_fence_is_refused() -> None:
    # The flight turns left above the shed's ceiling, 40 m outside it; with WPNAV_RADIUS 100 m it cuts the corner over
    # the shed, which is legal, and which a fence without a height would end.
    shed = Zone("shed", Circle(2940, 60, 20), None, Level(40, "agl"))
    where, craft = world(zones=[shed]), vehicle(horizontal_clearance_m=30)
    path = FlightPath(np.array([[0.0, 0, 420], [3000, 0, 420], [3000, 3000, 420]]))
    mission = build_mission(path, where, craft, (36.6, -84.3), Order())
    job = replace(
        job_of("uav1", 1, "udpout:127.0.0.1:9", mission, craft, where),
        fence=fence_breaches.fence_for(mission, craft, where, infinite=True),
    )
    again = judge_on_board(job, allow_unjudged=False)
    assert again is not None
    assert again(mission, {"WPNAV_RADIUS": 200.0}) is None
    wide = again(mission, {"WPNAV_RADIUS": 10000.0})
    assert wide is not None
    assert wide.code == "breaches_own_fence"
    assert "shed" in str(wide)
    bare = judge_on_board(replace(job, fence=None), allow_unjudged=False)
    assert bare is not None
    assert bare(mission, {"WPNAV_RADIUS": 10000.0}) is None


# -- to vehicles ----------------------------------------------------------------------------------------------------

MIXED = [Zone("a", Circle(500, 500, 120.5)), square(3000, -900, 200), Zone("b", Circle(-700, 0, 80))]


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_a_fence_is_uploaded_read_back_and_compared(autopilot: Autopilot) -> None:
    fence = fence_of(MIXED, FRAME, autopilot)
    craft = LoopbackVehicle(1, autopilot, lat_deg=36.6, lon_deg=-84.3, amsl_m=300.0)
    with SimServer([craft], "udpin:127.0.0.1:0", speedup=10.0) as server, Link(server.url_for_gcs) as link:
        options = session.SessionOptions(listen_s=0.1, discover_s=5.0)
        result = session.upload_items(link, 1, fence.items, autopilot, FENCE, options=options, name="uav1")
        assert result.outcome == "accepted"
        assert result.verified, result.differences
        enforced = autopilot is Autopilot.PX4
        assert enforced or any("FENCE_ENABLE is 0" in str(w) for w in result.warnings)
        read = session.download_items(link, 1, FENCE, options=options)
    assert faults(compare(fence.items, read, autopilot, FENCE)) == ()
    back = areas_of(read, FRAME)
    assert len(back) == len(MIXED)
    for area, zone in zip(back, fence.zones, strict=True):
        assert outline(area.shapes[0]).hausdorff_distance(outline(zone.shape)) < 0.12


@pytest.mark.draws
@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_over_bad_links_a_fence_that_is_called_verified_is_on_board(autopilot: Autopilot) -> None:
    """Where a link is so bad that nothing can be known, nothing is claimed."""
    items = fence_of(MIXED, FRAME, autopilot).items
    sure = 0
    for seed in range(draws(60)):
        weather = Weather(loss=0.03 * (seed % 8), duplicate=0.1, held_up=0.1)
        board = LoopbackVehicle(1, autopilot, lat_deg=36.6, lon_deg=-84.3, amsl_m=300.0)
        machine = VerifiedUpload(items, autopilot, us=Address(255, 190), vehicle=Address(1, 1), mission_type=FENCE)
        lossy.run(machine, board, weather, seed, lambda machine=machine: machine.result is not None)  # type: ignore[misc]
        assert machine.result is not None
        if machine.result.verified:
            sure += 1
            assert faults(compare(items, board.items(FENCE), autopilot, FENCE)) == (), seed
    assert sure >= draws(60) * 5 / 6


def job_of(name: str, sysid: int, url: str, mission: Mission, craft: Vehicle, where: World) -> uploads.UploadJob:
    craft = replace(craft, name=name, sysid=sysid)
    mission = replace(mission, name=name, sysid=sysid)
    return uploads.UploadJob(name, url, mission, judge(mission, craft, where), craft, where)


@pytest.mark.slow
def test_fences_go_before_missions_and_an_absent_vehicle_stops_nobody_else(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    be_impatient(monkeypatch)
    where, craft = world(zones=MIXED), vehicle()
    mission = mission_in(where, craft)
    boards = [
        LoopbackVehicle(1, COPTER, lat_deg=36.6, lon_deg=-84.3, amsl_m=300.0),
        LoopbackVehicle(2, COPTER, lat_deg=36.6, lon_deg=-84.3, amsl_m=300.0, misbehave=Misbehaviour(no_space=True)),
    ]
    with SimServer(boards, "udpin:127.0.0.1:0", speedup=10.0) as server:
        plain = [job_of(f"uav{n}", n, server.url_for_gcs, mission, craft, where) for n in (1, 2)]
        jobs, notes = fencing.with_lists(plain, fencing.ListsSent(fence=True))
        assert notes == []
        first, second = uploads.run_jobs(jobs, uploads.UploadOptions())
    assert first.verified
    assert first.as_dict()["fence"]["verified"] is True
    assert any("FENCE_ENABLE is 0" in str(w) for w in first.warnings)
    assert len(boards[0].items(FENCE)) == 6
    assert second.verified is False
    assert "fence is not on board" in second.message
    assert second.code in (5, 6)
    assert boards[1].items(FENCE) == ()
    assert boards[1].items() == ()


def test_vehicles_without_zones_keep_their_fence(monkeypatch: pytest.MonkeyPatch) -> None:
    be_impatient(monkeypatch)
    where, craft = world(), vehicle()
    job = job_of("uav1", 1, uploads.SIM, mission_in(where, craft), craft, where)
    jobs, notes = fencing.with_lists([job], fencing.ListsSent(fence=True))
    assert "left as it is" in str(notes[0][1])
    (done,) = uploads.run_jobs(jobs, uploads.UploadOptions(), simulator=loopback_fleet)
    assert done.verified
    assert "fence" not in done.as_dict()


@pytest.mark.slow
def test_a_simulated_upload_sends_the_fence_too() -> None:
    where, craft = world(zones=MIXED), vehicle()
    job = job_of("uav1", 1, uploads.SIM, mission_in(where, craft), craft, where)
    jobs, _ = fencing.with_lists([job], fencing.ListsSent(fence=True))
    (done,) = uploads.run_jobs(jobs, uploads.UploadOptions(), simulator=loopback_fleet)
    assert done.verified
    assert done.as_dict()["fence"]["items"] == 6


# -- on the command line --------------------------------------------------------------------------------------------

MISSION = """
version: 1
terrain: {dem: "sample:jacksboro"}
limits: {min_agl_m: 60, horizontal_clearance_m: 30, track_error_m: 3, altitude_error_m: 5}
no_fly:
  - {name: mast, center: [36.598, -84.367], radius_m: 150}
  - {name: shed, center: [36.5975, -84.373], radius_m: 60, ceiling_agl_m: 40}
vehicles:
  - {name: uav1, sysid: 1, autopilot: arducopter, start: [36.600, -84.380], goal: [36.596, -84.355], max_climb_deg: 15}
planner: {gap_percent: 5}
"""


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> Any:
    monkeypatch.chdir(tmp_path)
    be_impatient(monkeypatch)
    (tmp_path / "m.yaml").write_text(MISSION)

    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["gcsplan", *arguments])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = capfd.readouterr()
        assert isinstance(ended.value.code, int)
        return ended.value.code, out, err

    return call


@pytest.mark.slow
def test_plan_and_upload_send_the_fence_where_that_is_asked_for(run: Any) -> None:
    code, _, err = run("plan", "m.yaml", "-o", "out", "--upload", "sim", "--fence")
    assert code == 0, err
    assert "'shed' is left out" in err
    assert "a fence of 1 item is on board too" in err
    board = LoopbackVehicle(1, COPTER, lat_deg=36.6, lon_deg=-84.38, amsl_m=471.0)
    with SimServer([board], "udpin:127.0.0.1:0", speedup=10.0) as server:
        to = ("--to", server.url_for_gcs)
        code, out, _ = run("upload", "out/uav1.plan", *to, "--mission", "m.yaml", "--fence", "--json")
        assert code == 0
        (told,) = json.loads(out)["vehicles"]
        assert told["fence"]["verified"] is True
        assert "a fence of 1 item is on board too, read back and compared" in told["warnings"]
        (circle,) = board.items(FENCE)
        assert circle.params[0] == 150.0
        # Over the shed it flies legally, and a fence without a height would turn it round.
        code, _, err = run("upload", "out/uav1.plan", *to, "--mission", "m.yaml", "--fence-infinite")
        assert code == 4
        assert "shed" in err
        assert board.items(FENCE) == (circle,)
        # Without a world the file's own fence goes alone, and there must be one.
        assert run("upload", "out/uav1.plan", *to, "--unchecked", "--fence")[0] == 0
        assert run("upload", "out/uav1.waypoints", *to, "--unchecked", "--fence")[0] == 2
        assert run("clear", *to, "--type", "fence")[0] == 0
    assert board.items(FENCE) == ()


# -- keep-in areas --------------------------------------------------------------------------------------------------


def area_of(name: str, ring: list[tuple[float, float]], *holes: list[tuple[float, float]], **levels: Level) -> KeepIn:
    inner = tuple(np.array(hole, float) for hole in holes)
    return KeepIn(name, (AreaPart(np.array(ring, float), inner),), **levels)


WEST = area_of("west", [(-300, -200), (300, -200), (300, 300), (-300, 300)], [(50, 150), (90, 150), (70, 180)])
EAST = area_of("east", [(300, -200), (700, -200), (700, 390), (300, 390)], ceiling=Level(900.0, "amsl"))
APART = area_of("apart", [(900, 0), (990, 0), (990, 90)])


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_the_fence_of_areas_is_an_inclusion_polygon_read_back_from_the_vehicle(autopilot: Autopilot) -> None:
    zones_of = outside_of([WEST, EAST, APART], 240_000.0)
    fence = fence_of([*zones_of, Zone("hut", Circle(200, -50, 20))], FRAME, autopilot)
    craft = LoopbackVehicle(1, autopilot, lat_deg=36.6, lon_deg=-84.3, amsl_m=300.0)
    with SimServer([craft], "udpin:127.0.0.1:0", speedup=10.0) as server, Link(server.url_for_gcs) as link:
        options = session.SessionOptions(listen_s=0.1, discover_s=5.0)
        result = session.upload_items(link, 1, fence.items, autopilot, FENCE, options=options, name="uav1")
        assert result.verified, result.differences
        back = areas_of(session.download_items(link, 1, FENCE, options=options), FRAME)
    assert [(a.inclusion, z.name) for a, z in zip(back, fence.zones, strict=True)] == [
        (False, "hut"), (True, "keep-in areas"), (False, "hole in keep-in areas"),
    ]  # fmt: skip
    both = shapely.union_all([part.shape() for area in (WEST, EAST) for part in area.parts])
    whole, hole = outline(back[1].shapes[0]), outline(back[2].shapes[0])
    assert whole.difference(hole).covers(both)
    assert whole.difference(hole).hausdorff_distance(both) < 0.5
    assert {note.code for note in fence.notes} == {"fence_of_one_piece", "fence_areas_without_heights"}


def test_the_fence_is_of_the_piece_around_home() -> None:
    home = tuple(FRAME.to_degrees(950.0, 30.0).tolist())
    (zone,) = fence_of(outside_of([WEST, APART], 240_000.0), FRAME, COPTER, home=home).zones
    assert outline(zone.shape).covers(APART.parts[0].shape())
    assert outline(zone.shape).area < 1.1 * APART.parts[0].shape().area


def test_a_flight_at_the_limit_of_its_areas_does_not_breach_their_fence() -> None:
    tight = area_of("tight", [(-4, -4), (3001, -4), (6004, 996), (6004, 1004.5), (5990, 1004.5), (2999, 4), (-4, 4)])
    where, craft = world(zones=outside_of([tight], 240_000.0)), vehicle()
    mission = mission_in(where, craft)
    assert not [f for f in judge(mission, craft, where).findings if f.kind == "zone"]
    assert len(fence_breaches.fence_for(mission, craft, where).items) == 7


def test_areas_of_more_corners_than_are_stored_are_fenced_by_fewer_around_them() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 300, endpoint=False)
    ring = (2000.0 + 100.0 * np.sin(9.0 * turn))[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    area = KeepIn("round", (AreaPart(ring),))
    fence = fence_of([*outside_of([area], 240_000.0), *circles(8)], FRAME, COPTER)
    assert len(fence.items) < 8 + 58
    (wider,) = [note for note in fence.notes if note.code == "fence_area_wider"]
    assert wider.data["given"] == 300
    kept = next(a for a in areas_of(fence.items, FRAME) if a.inclusion)
    assert outline(kept.shapes[0]).covers(shapely.Polygon(ring))


def test_areas_that_are_all_far_away_have_no_fence() -> None:
    with pytest.raises(InputError, match="'far' are far from the mission"):
        fence_of(outside_of([KeepIn("far", ())], 240_000.0), FRAME, COPTER)
