"""A flight for an SITL over ground that falls to the east."""

from __future__ import annotations

from typing import Any

from gcsplan.check.judge import judge
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.sim.outcome import RehearsalPart
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits
from tests.support.worlds import world

COPTER, PLANE = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE
LAT, LON = 36.6, -84.3


def ramp(slope: float = 0.1) -> Any:
    """A world that falls to the east."""
    return world(lambda e, n: 500.0 - slope * e, half_m=3000.0)


def a_part(where: Any, autopilot: Autopilot = COPTER, frame: int = m.RELATIVE, **craft: Any) -> RehearsalPart:
    vehicle = Vehicle(
        "uav1", 1, autopilot, Limits(10.0, track_error_m=3.0, altitude_error_m=5.0), speed_max_m_s=8.0, **craft
    )  # fmt: skip

    def at(command: int, east: float, z: float) -> MissionItem:
        lat, lon = where.frame.to_degrees(east, 0.0)
        return MissionItem(command, frame, (0, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), z)

    items = (at(cmd.TAKEOFF, 0.0, 60.0), at(cmd.WAYPOINT, 1500.0, 60.0), at(cmd.LAND, 1500.0, 0.0))
    mission = Mission(autopilot, m.Home.at(LAT, LON, where.ground_amsl(LAT, LON)), items, "uav1")
    return RehearsalPart(vehicle, mission, judge(mission, vehicle, where))
