"""The mission file: what it means, and that every mistake in it is told, all at once, with place and cure."""

from __future__ import annotations

import copy
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rasterio.transform import Affine

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file import MissionFile, load_mission
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Energy
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Level, Polygon
from tests.support.attacks import draw_attacks, require_placed_words
from tests.support.effort import draws
from tests.support.paths import DATA

EXAMPLE = DATA / "interface_example.yaml"
PLANNERS = ("optimal", "krill")


def base(**changes: Any) -> dict[str, Any]:
    """A small good mission on the sample; ``changes`` replace its top-level keys."""
    whole = {
        "version": 1,
        "terrain": {"dem": "sample:jacksboro", "vertical_datum": "EGM96"},
        "limits": {"min_agl_m": 60, "horizontal_clearance_m": 30, "track_error_m": 3, "altitude_error_m": 5},
        "no_fly": [{"name": "village", "center": [36.61, -84.31], "radius_m": 400}],
        "vehicles": [vehicle()],
    }
    return {k: v for k, v in (whole | changes).items() if v is not ...}


def vehicle(**changes: Any) -> dict[str, Any]:
    whole = {"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [36.6, -84.38], "goal": [36.55, -84.2]}
    return {k: v for k, v in (whole | changes).items() if v is not ...}


def local(**changes: Any) -> dict[str, Any]:
    """The krill paper's mound: 100 m cube, one peak."""
    whole = {
        "version": 1,
        "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        "terrain": {"peaks": [{"center": [50, 50], "height_m": 70, "decay_m": [20, 20]}]},
        "limits": {"min_agl_m": 3},
        "vehicles": [
            vehicle(
                start={"east_m": 0, "north_m": 0, "up_m": 0},
                goal={"east_m": 100, "north_m": 100, "up_m": 60},
                end="loiter",
            )
        ],
    }
    return {k: v for k, v in (whole | changes).items() if v is not ...}


def load(whole: Any, folder: Path = Path()) -> MissionFile:
    text = whole if isinstance(whole, str) else yaml.safe_dump(whole, sort_keys=False)
    return load_mission(folder / "m.yaml", text=text, planner_names=PLANNERS)


def problems(whole: Any, folder: Path = Path()) -> tuple[Mistake, ...]:
    with pytest.raises(InputError) as caught:
        load(whole, folder)
    assert caught.value.exit_code == 2
    return caught.value.problems


def the_problem(whole: Any, folder: Path = Path()) -> tuple[str, str]:
    """Key path and message of the only problem."""
    found = problems(whole, folder)
    assert len(found) == 1, found
    return found[0].where.split(": ", 1)[-1], found[0].message


@pytest.mark.slow
def test_motion_that_px4_flies_otherwise_has_defaults_of_its_own() -> None:
    own = [load(base(vehicles=[vehicle(autopilot=a)])).vehicles[0].vehicle for a in ("arducopter", "px4")]
    assert [(v.climb_m_s, v.land_m_s, v.corner_accel_m_s2) for v in own] == [(2.5, 0.5, 2.5), (3.0, 0.7, 1.5)]
    given = load(base(vehicles=[vehicle(autopilot="px4", climb_m_s=1.0, land_m_s=0.3)])).vehicles[0].vehicle
    assert (given.climb_m_s, given.land_m_s) == (1.0, 0.3)


# -- the example --------------------------------------------------------------------------------------------------


def test_the_example_of_the_interface_loads_as_printed() -> None:
    mission = load_mission(EXAMPLE)
    assert mission.name == "Ridge crossing near Jacksboro"
    assert mission.stem == "interface_example"
    assert [z.name for z in mission.zones] == ["village", "mast", "airfield"]
    assert [z.floor for z in mission.zones] == [None, None, None]
    assert [z.ceiling for z in mission.zones] == [None, Level(100.0, "agl"), Level(300.0, "agl")]
    one, two = mission.vehicles
    assert one.vehicle.limits == Limits(
        min_agl_m=60, max_amsl_m=780.5, horizontal_clearance_m=30, track_error_m=3, altitude_error_m=5,
        max_climb_deg=15, max_descent_deg=15,
    )  # fmt: skip
    assert one.vehicle.energy == Energy(120, 100, 400, 5.0e6, 0.2)
    assert one.vehicle.link == "udpout:127.0.0.1:14560"
    assert one.vehicle.autopilot is Autopilot.ARDUCOPTER
    assert (one.takeoff_agl_m, one.approach_agl_m, two.takeoff_agl_m, two.approach_agl_m) == (65.0, 65.0, None, None)
    assert (one.start_deg, one.goal_deg) == ((36.6, -84.38), (36.55, -84.2))
    assert np.allclose(one.start[:2], mission.frame.to_plane(36.6, -84.38))
    assert one.start[2] == pytest.approx(float(mission.surface.ground_at(one.start[0], one.start[1])))
    assert one.start_amsl_m is None
    arrival = mission.arrival
    assert arrival is not None
    assert (arrival.mode, arrival.order, arrival.interval_s, arrival.separation_m) == (
        "sequence",
        ("uav1", "uav2"),
        9,
        30,
    )
    assert mission.planner.name == "optimal"
    assert mission.altitude_frame == "relative"
    assert not mission.local
    assert mission.inputs["vertical_datum"] == "EGM96"
    assert mission.inputs["resolution_m"] == 92
    assert mission.inputs["bare_dem"] is True
    assert {len(str(mission.inputs[k])) for k in ("dem_sha256", "zones_sha256")} == {64}
    assert json.loads(json.dumps(mission.inputs)) == mission.inputs


# -- limits and defaults ------------------------------------------------------------------------------------------


def test_errors_that_are_not_given_are_not_zero_on_the_real_earth_and_are_told() -> None:
    mission = load(base(limits={"min_agl_m": 60}))
    limits = mission.vehicles[0].vehicle.limits
    assert (limits.horizontal_clearance_m, limits.track_error_m, limits.altitude_error_m) == (30, 3, 5)
    assert sum(n.code == "limit_assumed" for n in mission.notes) == 3


def test_a_plane_is_not_taken_to_climb_at_any_angle() -> None:
    mission = load(base(vehicles=[vehicle(autopilot="arduplane")]))
    limits = mission.vehicles[0].vehicle.limits
    assert (limits.max_climb_deg, limits.max_descent_deg) == (15, 15)
    assert "plane_climb_assumed" in [n.code for n in mission.notes]


def test_min_agl_must_be_said_somewhere() -> None:
    assert the_problem(base(limits=...))[0] == "vehicles[0].min_agl_m"


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"min_agl_m": 70, "max_agl_m": 60}, "min_agl_m", "not be above max_agl_m"),
        ({"min_agl_m": 60, "max_agl_m": 69}, "max_agl_m", "leaves no room"),
        ({"speed_m_s": [15, 3]}, "speed_m_s", "slowest"),
        ({"takeoff_agl_m": 64}, "takeoff_agl_m", "at least 65 m AGL"),
        ({"approach_agl_m": 64.9}, "approach_agl_m", "at least 65 m AGL"),
        ({"approach_agl_m": 120, "max_agl_m": 120}, "approach_agl_m", "at most 115 m AGL"),
        ({"via": [[36.58, -84.3, 20]]}, "via[0]", "at least 65 m AGL"),
        ({"turn_radius_m": 80}, "turn_radius_m", "a multicopter has no turn radius"),
        ({"end": "rtl"}, "rtl_rel_home_m", "is missing"),
        ({"min_agl_m": 70, "limits": {"min_agl_m": 70}}, "min_agl_m", "keep one"),
        ({"name": "uav 1"}, "name", "letters, digits"),
        ({"name": 7}, "name", "must be text"),
        ({"sysid": 0}, "sysid", "at least 1"),
        ({"sysid": 256}, "sysid", "at most 255"),
        ({"sysid": 1.0}, "sysid", "whole number"),
        ({"sysid": True}, "sysid", "whole number"),
        ({"autopilot": "arducoptr"}, "autopilot", "did you mean arducopter?"),
        ({"climb_m_s": "2.5"}, "climb_m_s", "must be a number, given the text '2.5'"),
        ({"climb_m_s": True}, "climb_m_s", "must be a number, given true"),
        ({"climb_m_s": 0}, "climb_m_s", "above 0"),
        ({"climb_m_s": 1e-320}, "climb_m_s", "at least 0.001"),
        ({"accel_m_s2": 9e-4}, "accel_m_s2", "at least 0.001"),
        ({"energy": {"battery_j": 1e-300}}, "energy.battery_j", "at least 0.001"),
        ({"climb_m_s": math.nan}, "climb_m_s", "finite"),
        ({"descent_m_s": math.inf}, "descent_m_s", "finite"),
        ({"descent_m_s": 10**400}, "descent_m_s", "number"),
        ({"max_climb_deg": 91}, "max_climb_deg", "at most 90"),
        ({"energy": {"reserve": 1}}, "energy.reserve", "below 1"),
        ({"energy": {"hover": 1}}, "energy.hover", "did you mean hover_w?"),
        ({"takeof_agl_m": 65}, "takeof_agl_m", "did you mean takeoff_agl_m?"),
        ({"speed_m_s": [3]}, "speed_m_s", "at least 2 values"),
        ({"speed_m_s": [3, math.nan]}, "speed_m_s[1]", "finite"),
        ({"start": 36.6}, "start", "must be [lat, lon]"),
        ({"start": [36.6]}, "start", "at least 2 values [lat, lon]"),
        ({"start": [36.6, "x"]}, "start[1]", "must be a number"),
        ({"goal": ...}, "goal", "is missing"),
        ({"goal": {"east_m": 1, "north_m": 2}}, "goal", "frame: {origin"),
        ({"link": 14550}, "link", "must be text"),
        ({"rtl_rel_home_m": -1}, "rtl_rel_home_m", "above 0"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_vehicle_is_told_with_its_key(change: dict[str, Any], key: str, words: str) -> None:
    where, message = the_problem(base(vehicles=[vehicle(**change)]))
    assert where == f"vehicles[0].{key}"
    assert words in message


# -- points and zones ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("zone", "key", "words"),
    [
        ({"center": [36.61, -84.31], "radius_m": -4}, ".radius_m", "above 0"),
        ({"center": [36.61, -84.31], "radius_m": 1e9}, ".radius_m", "at most 100000"),
        ({"center": [36.61, -84.31], "radius_m": math.nan}, ".radius_m", "finite"),
        ({"center": [36.61, -84.31]}, ".radius_m", "is missing"),
        ({"radius_m": 4}, "", "one of center (with radius_m), polygon, line (with buffer_m) and file, given none"),
        ({"center": [36.6, -84.3], "radius_m": 4, "polygon": []}, "", "given center and polygon"),
        ({"center": [-84.31, 36.61], "radius_m": 40}, "", "look swapped"),
        ({"center": [36.61, 84.31], "radius_m": 40}, "", "too far from the mission"),
        ({"center": [-91, 36], "radius_m": 40}, ".center", "look swapped"),
        ({"center": [36.61, -84.31], "radius_m": 40, "ceiling_amsl_m": 100}, ".ceiling_amsl_m", "wholly under ground"),
        ({"center": [36.61, -84.31], "radius_m": 40, "ceiling_agl_m": 0}, ".ceiling_agl_m", "wholly under ground"),
        ({"center": [36.61, -84.31], "radius_m": 40, "floor_agl_m": 90, "ceiling_agl_m": 50}, ".floor_agl_m", "below"),
        ({"center": [36.61, -84.31], "radius_m": 40, "floor_agl_m": 900, "ceiling_amsl_m": 800}, "", "nowhere below"),
        ({"center": [36.61, -84.31], "radius_m": 40, "floor_amsl_m": 2900, "ceiling_agl_m": 80}, "", "nowhere below"),
        ({"center": [36.61, -84.31], "radius_m": 40, "floor_amsl_m": 9, "floor_agl_m": 8}, ".floor_agl_m", "both"),
        ({"center": [36.61, -84.31], "radius_m": 4, "celing_agl_m": 8}, ".celing_agl_m", "mean ceiling_agl_m?"),
        ({"polygon": [[36.6, -84.3], [36.61, -84.3]]}, ".polygon", "at least 3 different points"),
        ({"polygon": [[36.6, -84.3], [36.61, -84.29], [36.6, -84.29], [36.61, -84.3]]}, ".polygon", "crosses"),
        ({"polygon": [[36.6, -84.3], [36.61, -84.29], {"east_m": 0, "north_m": 0}]}, ".polygon[2]", "frame: {origin"),
        ({"polygon": [[36.6, -84.3], [36.61, -84.29], [36.6, -84.29]], "radius_m": 5}, ".radius_m", "not to a polygon"),
        ({"line": [[36.6, -84.3], [36.61, -84.29]]}, ".buffer_m", "is missing"),
        ({"line": [[36.6, -84.3], [36.6, -84.3]], "buffer_m": 5}, ".line", "at least 2 different points, given 1"),
        ({"line": [[36.6, -84.3], [36.61, -84.29]], "buffer_m": 5, "radius_m": 5}, ".radius_m", "not to a line"),
        ({"line": [[36.6, -84.3], [36.61, -84.29]], "buffer_m": 1e5}, ".buffer_m", "at most 20000 (a wider zone is"),
        ({"line": [[36.6, -84.3], [36.61, -84.29]], "buffer_m": 5, "layer": "a"}, ".layer", "belongs to a file"),
        ({"file": "none.kml", "radius_m": -5}, ".radius_m", "above 0"),
        ({"file": "none.geojson"}, ".file", "is not there"),
        ({"file": "zones.doc"}, ".file", ".geojson, .json, .kml"),
        ("village", "", "must be a mapping"),
        ({"center": [36.61, -84.31], "radius_m": 9, "name": 5}, ".name", "must be text"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_zone_is_told_with_its_key(zone: Any, key: str, words: str) -> None:
    where, message = the_problem(base(no_fly=[zone]))
    assert where == f"no_fly[0]{key}"
    assert words in message


@pytest.mark.slow
def test_a_zone_of_one_dem_cell_is_judged_by_the_ground_in_it_alone() -> None:
    """On a slope the lowest corner of the cell is far below the lowest ground in a small zone."""
    mission = load(base())
    east, north = mission.frame.to_plane(36.61, -84.31)
    turn = np.linspace(0, 2 * np.pi, 1000)
    lowest = float(mission.surface.ground_at(east + 10 * np.cos(turn), north + 10 * np.sin(turn)).min())
    for ceiling_m, buried in ((lowest - 0.1, True), (lowest + 0.1, False)):
        zone = {"name": "z", "center": [36.61, -84.31], "radius_m": 10, "ceiling_amsl_m": ceiling_m}
        if buried:
            assert "wholly under ground" in the_problem(base(no_fly=[zone]))[1]
        else:
            assert load(base(no_fly=[zone])).zones[0].ceiling == Level(ceiling_m, "amsl")


def test_a_floor_that_is_nowhere_above_ground_is_no_floor() -> None:
    zone = {"center": [36.61, -84.31], "radius_m": 400, "ceiling_agl_m": 50}
    mission = load(base(no_fly=[zone | {"floor_amsl_m": 100}, zone | {"floor_amsl_m": 650, "ceiling_agl_m": 500}]))
    assert mission.zones[0].floor is None
    assert mission.zones[1].floor == Level(650.0, "amsl")


def test_polygons_in_the_file_are_prisms() -> None:
    corners = [[36.60, -84.30], [36.61, -84.30], [36.61, -84.29]]
    (zone,) = load(base(no_fly=[{"name": "t", "polygon": corners, "ceiling_agl_m": 50}])).zones
    assert isinstance(zone.shape, Polygon)
    assert len(zone.shape.vertices) >= 3


def test_zones_from_files_are_found_beside_the_mission_and_keep_their_names_apart(tmp_path: Path) -> None:
    def point(lon: float, lat: float, **properties: Any) -> dict[str, Any]:
        return {"type": "Feature", "properties": properties, "geometry": {"type": "Point", "coordinates": [lon, lat]}}

    (tmp_path / "sub").mkdir()
    features = [point(-84.3, 36.6, name="R", radius_m=50), point(-84.25, 36.58, name="R", radius_m=60),
                point(8.0, 47.0, name="far", radius_m=70)]  # fmt: skip
    (tmp_path / "sub" / "z.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    mission = load(base(no_fly=[{"file": "sub/z.geojson"}]), tmp_path)
    assert [z.name for z in mission.zones] == ["R", "R #2"]
    assert Note("zones_left_out", count=1) in mission.notes
    features[1]["properties"]["radius_m"] = "60"
    features[2]["geometry"]["coordinates"] = [36.6, -84.3]
    (tmp_path / "sub" / "z.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    found = problems(base(no_fly=[{"file": "sub/z.geojson"}]), tmp_path)
    assert "features[1].properties.radius_m" in found[0].where
    assert "look swapped" in found[1].message


def test_bounds_of_a_file_stand_in_the_file(tmp_path: Path) -> None:
    found = problems(base(no_fly=[{"file": "z.kml", "ceiling_agl_m": 50}]), tmp_path)
    assert [p.where.split(": ")[1] for p in found] == ["no_fly[0].ceiling_agl_m", "no_fly[0].file"]


# -- terrain ------------------------------------------------------------------------------------------------------


def dem(path: Path, heights: Any, west: float = -84.6, north: float = 36.6) -> None:
    transform = Affine(0.002, 0, west, 0, -0.002, north)
    rows, cols = heights.shape
    with rasterio.open(
        path, "w", driver="GTiff", width=cols, height=rows, count=1, dtype=heights.dtype, crs="EPSG:4326",
        transform=transform,
    ) as file:  # fmt: skip
        file.write(heights, 1)


# -- local metres -------------------------------------------------------------------------------------------------


def test_a_mission_in_local_metres_has_no_errors_and_may_hang_its_goal_in_the_air() -> None:
    mission = load(local())
    assert mission.local
    one = mission.vehicles[0]
    limits = one.vehicle.limits
    assert (limits.horizontal_clearance_m, limits.track_error_m, limits.altitude_error_m) == (0, 0, 0)
    assert one.start == pytest.approx((0.0, 0.0, 0.0), abs=0.011)
    assert one.start_amsl_m is None
    assert one.goal == pytest.approx((100.0, 100.0, 0.0), abs=0.011)
    assert one.goal_amsl_m == pytest.approx(60.0)
    assert np.allclose(mission.frame.to_plane(*one.goal_deg), (100, 100), atol=1e-6)
    assert float(mission.surface.ground_at(50, 50)) == pytest.approx(70.0, abs=0.011)
    box = [float(x) for x in mission.surface.grid.to_plane(0, mission.surface.ground_m.shape[0] - 1)]
    assert box == pytest.approx([-50, -50])


# -- the fleet, the planner and the rest --------------------------------------------------------------------------


def fleet(*vehicles: dict[str, Any], **more: Any) -> dict[str, Any]:
    return base(vehicles=list(vehicles), **more)


def test_doubled_names_and_system_ids_are_told() -> None:
    found = problems(fleet(vehicle(), vehicle(name="UAV1"), vehicle(name="uav3", sysid="x")))
    assert {p.where.split(": ")[1] for p in found} == {"vehicles[1].name", "vehicles[1].sysid", "vehicles[2].sysid"}


@pytest.mark.slow
def test_vehicles_of_one_system_id_need_links_of_their_own() -> None:
    def wrong(*links: str | None) -> list[str]:
        some = [vehicle(name=f"v{k}", **({} if link is None else {"link": link})) for k, link in enumerate(links)]
        return [p.where.split(": ")[1] for p in problems(fleet(*some))]

    a, b = "udpout:127.0.0.1:14560", "udpout:127.0.0.1:14570"
    assert load(fleet(vehicle(link=a), vehicle(name="b", link=b))).vehicles[1].vehicle.sysid == 1
    assert wrong(a, b, a) == ["vehicles[2].sysid"]
    assert wrong(a, None) == wrong(None, a) == ["vehicles[1].sysid"]


@pytest.mark.slow
def test_three_hundred_vehicles_are_read() -> None:
    links = [f"udpout:127.0.0.1:{14560 + 10 * k}" for k in range(2)]
    many = [vehicle(name=f"v{k}", sysid=k // 2 + 1, link=links[k % 2]) for k in range(300)]
    assert len(load(fleet(*many)).vehicles) == 300


@pytest.mark.parametrize(
    ("arrival", "key", "words"),
    [
        ({"mode": "sequence", "order": ["uav1", "uav3"], "interval_s": 9}, "arrival.order[1]", "did you mean"),
        ({"mode": "sequence", "order": ["uav1"], "interval_s": 9}, "arrival.order", "missing: uav2"),
        ({"mode": "sequence", "order": ["uav1", "uav2", "uav1"], "interval_s": 9}, "arrival.order[2]", "stands twice"),
        ({"mode": "sequence", "order": ["uav1", "uav2"]}, "arrival.interval_s", "is missing"),
        ({"mode": "sequenz", "interval_s": 9}, "arrival.mode", "did you mean sequence?"),
        ({"mode": "together", "separation_m": -1}, "arrival.separation_m", "at least 0"),
        ({"order": []}, "arrival.mode", "is missing"),
        ([1], "arrival", "must be a mapping"),
    ],
)  # fmt: skip
def test_a_mistake_in_the_arrival_is_told(arrival: Any, key: str, words: str) -> None:
    found = problems(fleet(vehicle(), vehicle(name="uav2", sysid=2), arrival=arrival))
    told = {p.where.split(": ", 1)[1]: p.message for p in found}
    assert words in told[key]
    assert len(told) <= 2


@pytest.mark.parametrize(
    ("planner", "key", "words"),
    [
        ({"name": "optiml"}, "planner.name", "did you mean optimal?"),
        ({"name": "zzz"}, "planner.name", "known are optimal, krill"),
        ({"sede": 1}, "planner.sede", "did you mean seed?"),
        ({"seed": -1}, "planner.seed", "at least 0"),
        ({"objective": "speed"}, "planner.objective", "one of length, energy, time"),
        ({"budget_s": 0}, "planner.budget_s", "above 0"),
        ({"parameters": {"a": [1]}}, "planner.parameters", "plain number or word"),
    ],
)  # fmt: skip
def test_a_mistake_in_the_planner_is_told(planner: Any, key: str, words: str) -> None:
    where, message = the_problem(base(planner=planner))
    assert where == key
    assert words in message


def test_the_planners_own_table_is_asked_where_none_is_handed_in() -> None:
    with pytest.raises(InputError, match=r"planner\.name"):
        load_mission("m.yaml", text=yaml.safe_dump(base(planner={"name": "no such planner"})))


@pytest.mark.parametrize(
    ("top", "key", "words"),
    [
        ({"version": 2}, "version", "version 1, given 2"),
        ({"version": True}, "version", "version 1, given true"),
        ({"version": "1"}, "version", "given the text '1'"),
        ({"version": ...}, "version", "write `version: 1`"),
        ({"terrain": ...}, "terrain", "is missing"),
        ({"vehicles": ...}, "vehicles", "is missing"),
        ({"vehicles": []}, "vehicles", "1 to 2000 vehicles"),
        ({"vehicles": {}}, "vehicles", "1 to 2000 vehicles"),
        ({"no_fly": {}}, "no_fly", "must be a list"),
        ({"no_flie": []}, "no_flie", "did you mean no_fly?"),
        ({"altitude_frame": "amls"}, "altitude_frame", "did you mean amsl?"),
        ({"altitude_frame": 3}, "altitude_frame", "one of relative, amsl, terrain"),
        ({"name": 3}, "name", "must be text"),
        ({"limits": 3}, "limits", "must be a mapping"),
        ({"terrain_error_m": -1}, "terrain_error_m", "from 0 to 1000"),
        ({"altitude_frame": "terrain", "vehicles": [vehicle(autopilot="px4")]}, "vehicles[0].autopilot", "px4"),
    ],
)  # fmt: skip
def test_a_mistake_at_the_top_is_told(top: dict[str, Any], key: str, words: str) -> None:
    where, message = the_problem(base(**top))
    assert where == key
    assert words in message


def test_every_mistake_is_told_at_once_schema_and_world_alike() -> None:
    whole = base(
        limits={"min_agl_m": 60, "max_agl_m": 50},
        no_fly=[{"name": "a", "center": [36.61, -84.31], "radius_m": 40, "ceiling_amsl_m": 100},
                {"name": "a", "center": [36.6, -84.3], "radius_m": -1}, {"file": "none.kml"}],
        vehicles=[vehicle(start=[-84.38, 36.6], speed_m_s=[9, 3]), vehicle(sysid="2"), vehicle(name="c", sysid=3)],
        planner={"name": "optimalt"}, altitude_frame="amsel", typo=1,
    )  # fmt: skip
    told = {p.where.split(": ", 1)[1] for p in problems(whole)}
    assert told >= {
        "typo", "altitude_frame", "planner.name", "vehicles[0].speed_m_s", "vehicles[0].min_agl_m", "vehicles[1].sysid",
        "vehicles[1].name", "vehicles[0].start", "no_fly[0].ceiling_amsl_m", "no_fly[1].radius_m", "no_fly[1].name",
        "no_fly[2].file", "vehicles[2].min_agl_m",
    }  # fmt: skip


def test_the_message_names_file_key_given_and_wanted(tmp_path: Path) -> None:
    path = tmp_path / "ridge.yaml"
    path.write_text(yaml.safe_dump(base(no_fly=[{"center": [36.6, -84.3], "radius_m": "400"}])))
    with pytest.raises(InputError) as caught:
        load_mission(path, planner_names=PLANNERS)
    words = "must be a number, given the text '400'; write the number alone, without quotes: 400 (line 10)"
    assert str(caught.value) == f"{path}: no_fly[0].radius_m: {words}"


# -- files --------------------------------------------------------------------------------------------------------


# -- hostile files ------------------------------------------------------------------------------------------------

JUNK = st.one_of(
    st.none(), st.booleans(), st.integers(-(10**30), 10**30), st.floats(), st.text(max_size=6),
    st.sampled_from([0, -1, 1e308, 36.6, -84.3, "sample:jacksboro", "land", [], {}, [[]], [36.6, -84.3], [1, 2, 3],
                     {"east_m": 1, "north_m": 2}, {"file": "x.kml"}, {"name": "a"}]),
)  # fmt: skip


def paths_into(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    found = [path] if path else []
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        found += paths_into(inner, (*path, key))
    return found


@pytest.fixture(scope="module")
def seeds() -> list[Any]:
    return [yaml.safe_load(EXAMPLE.read_text(encoding="utf-8").replace("5.0e6", "5.0e+6")), local(), base()]


@pytest.mark.slow
@settings(max_examples=draws(75), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_mutation_of_a_mission_loads_or_is_refused(seeds: list[Any], tmp_path: Path, data: st.DataObject) -> None:
    whole = copy.deepcopy(data.draw(st.sampled_from(seeds)))
    for _ in range(data.draw(st.integers(1, 4))):
        paths = paths_into(whole)
        if not paths:
            break
        *parents, last = data.draw(st.sampled_from(paths))
        at = whole
        for key in parents:
            at = at[key]
        match data.draw(st.sampled_from(["junk", "delete", "scale", "swap", "rename"])):
            case "delete":
                del at[last]
            case "scale" if isinstance(at[last], int | float):
                at[last] = at[last] * data.draw(st.sampled_from([-1, 0, 1e-9, 1e3, 1e300]))
            case "swap" if isinstance(at, list):
                at.reverse()
            case "rename" if isinstance(at, dict):
                at[str(last)[:-1]] = at.pop(last)
            case _:
                at[last] = copy.deepcopy(data.draw(JUNK))
    try:
        mission = load(json.dumps(whole), tmp_path)
    except InputError as error:
        assert all(p.where and p.message for p in error.problems)  # noqa: PT017
        return
    assert np.isfinite([x for v in mission.vehicles for x in (*v.start, *v.goal)]).all()
    assert all(math.isfinite(x) for z in mission.zones for x in z.bounds)
    assert mission.surface.ground_m.size <= 4_000_000
    assert mission.airspace_scale >= 1.0


@pytest.mark.slow
@pytest.mark.draws
def test_any_damage_to_the_text_of_a_mission_is_read_or_refused() -> None:
    assert draw_attacks(50, damaged) == {"read", "refused"}


def damaged(data: st.DataObject) -> str:
    text = EXAMPLE.read_text(encoding="utf-8")
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text)))
        junk = data.draw(
            st.sampled_from(["", ":", "\n", "  ", "\t", "[", "}", "-", "'", "#", "&a ", "*a", "!!x ", "\x00", "9"])
        )
        text = text[:at] + junk + text[at + data.draw(st.integers(0, 12)) :]
    try:
        mission = load(text)
    except InputError as error:
        require_placed_words(error)
        return "refused"
    assert mission.vehicles
    return "read"
