"""Tracks: rounded corners, speeds in the autopilot's metres, and legs over the ground."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.sim.flight.mission_flight import fly
from gcsplan.sim.flight.track import make_track
from gcsplan.vehicle import Autopilot
from tests.support import worlds
from tests.support.short_flights import CLIMB_S, COPTER, GROUND_M, TAKEOFF, at, speed, speed_at, track


@pytest.mark.nightly
def test_a_right_angle_is_rounded_two_metres_off_at_the_speed_of_the_arc() -> None:
    way = track(TAKEOFF, at(cmd.WAYPOINT, 0, 500, 50), at(cmd.WAYPOINT, 500, 500, 50))
    nearest_m = np.linalg.norm(way.points - [0, 500, GROUND_M + 50], axis=1).min()
    assert nearest_m == pytest.approx(2.0, abs=0.05)
    radius_m = 2 / (math.sqrt(2) - 1)
    arc_m = radius_m * math.pi / 2
    slow = math.sqrt(2.5 * radius_m)
    flown = fly([way], [0.0])
    assert speed_at(flown, 50 + 500 - radius_m + arc_m / 2) == pytest.approx(slow, abs=0.05)
    leg_m = 500 - radius_m
    leg_s = 10 / 1.5 + (10 - slow) / 1.5 + (leg_m - 100 / 3 - (100 - slow**2) / 3) / 10
    assert flown.arrive_s[0] == pytest.approx(CLIMB_S + 2 * leg_s + arc_m / slow, abs=0.1)


@pytest.mark.parametrize("lat_deg", [0.0, 36.6, -65.0])
@pytest.mark.parametrize(("autopilot", "jerk_m_s3"), [("arducopter", 1.0), ("arducopter", math.inf), ("px4", 1.0)])
def test_a_speed_counts_in_the_metres_of_the_autopilot(lat_deg: float, autopilot: str, jerk_m_s3: float) -> None:
    """Against the ellipsoid's radii: what ArduPilot takes for a metre is more north, and less east, by its latitude."""
    world = worlds.world(GROUND_M, lat_deg=lat_deg)
    vehicle = replace(COPTER, autopilot=Autopilot(autopilot), leg_jerk_m_s3=jerk_m_s3)
    lat, lon = (float(x) for x in world.frame.to_degrees(0.0, 0.0))
    s2 = 0.00669437999 * math.sin(math.radians(lat)) ** 2
    along_parallel = 6378137.0 / math.sqrt(1 - s2) / math.degrees(1.0)
    along_meridian = 6378137.0 * (1 - 0.00669437999) / (1 - s2) ** 1.5 / math.degrees(1.0)
    for way, degree_m in (((2000.0, 0.0), along_parallel), ((0.0, 2000.0), along_meridian)):
        place = world.frame.to_degrees(*way)
        goal = MissionItem(
            cmd.WAYPOINT, m.RELATIVE, (0, 0, 0, 0), m.degrees_e7(float(place[0])), m.degrees_e7(float(place[1])), 50
        )
        top = MissionItem(cmd.TAKEOFF, m.RELATIVE, (0, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), 50)
        mission = Mission(vehicle.autopilot, Home.at(lat, lon, GROUND_M), (top, speed(8), goal))
        flown = make_track(mission, vehicle, world, Kinematics.of(vehicle))
        ratio = degree_m / 111318.845 if vehicle.lays_curves else 1.0
        assert flown.command_m_s[-1] == pytest.approx(8.0 * ratio, rel=2e-5)


@pytest.mark.slow
def test_neither_a_change_of_pitch_nor_a_way_point_on_a_line_costs_time() -> None:
    straight = fly([track(TAKEOFF, at(cmd.WAYPOINT, 0, 800, 50))], [0.0])
    cut = fly([track(TAKEOFF, at(cmd.WAYPOINT, 0, 300, 50), at(cmd.WAYPOINT, 0, 800, 50))], [0.0])
    assert cut.arrive_s[0] == pytest.approx(straight.arrive_s[0], abs=0.05)
    bent = fly([track(TAKEOFF, at(cmd.WAYPOINT, 0, 400, 60), at(cmd.WAYPOINT, 0, 800, 50))], [0.0])
    assert bent.arrive_s[0] == pytest.approx(straight.arrive_s[0], abs=0.1)


@pytest.mark.slow
def test_a_terrain_leg_follows_the_ground() -> None:
    def hill(east: np.ndarray, north: np.ndarray) -> np.ndarray:
        return GROUND_M + 40 * np.exp(-((north - 600) ** 2) / 200**2) + 0 * east

    ground = worlds.world(hill)
    way = track(TAKEOFF, at(cmd.WAYPOINT, 0, 100, 50, frame=10), at(cmd.WAYPOINT, 0, 1200, 50, frame=10), world=ground)
    flown = fly([way], [0.0])
    points = flown.points(0)
    far = points[points[:, 1] > 100]
    agl = far[:, 2] - ground.vehicle_terrain.ground_at(far[:, 0], far[:, 1])
    assert np.abs(agl - 50).max() < 0.5
    assert points[:, 2].max() > GROUND_M + 85
