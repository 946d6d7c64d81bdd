"""Missions for the tests, with every kind of number that gcsplan writes, for each autopilot."""

from __future__ import annotations

import math

from gcsplan.mavlink.mission.commands import DELAY, DO_CHANGE_SPEED, LAND, TAKEOFF, WAYPOINT
from gcsplan.mavlink.mission.mission import GLOBAL, NO_POSITION, RELATIVE, Home, Mission, MissionItem, degrees_e7
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.vehicle import Autopilot

HOME = Home.at(36.6000123, -84.3799877, 371.25)


def a_mission(autopilot: Autopilot, n: int, *, sysid: int = 1) -> Mission:
    """A mission of ``n`` items without home: take-off, a speed, way points in two frames, a delay, a landing."""
    half_cm = 0.005 if autopilot.is_ardupilot else 0.0
    heading = 90.25 if autopilot is Autopilot.PX4 else 0.0

    def at(command: int, i: int, z: float, frame: int = RELATIVE) -> MissionItem:
        bend = math.sin(i / 7.0)
        lat, lon = degrees_e7(36.6000123 - 1e-5 * i), degrees_e7(-84.3799877 + 3e-5 * i + 1e-4 * bend)
        return MissionItem(command, frame, (0.0, 0.0, 0.0, heading), lat, lon, z)

    points = [
        at(
            WAYPOINT,
            i,
            65.0 + (i * 37 % 1000) / 100 + half_cm + (371.25 if i % 3 == 0 else 0.0),
            GLOBAL if i % 3 == 0 else RELATIVE,
        )
        for i in range(1, n - 3)
    ]
    items = [
        at(TAKEOFF, 0, 65.0 + half_cm),
        MissionItem(DO_CHANGE_SPEED, NO_POSITION, (1.0, 12.34, -1.0, 0.0)),
        *points,
        MissionItem(DELAY, NO_POSITION, (2.5, -1.0, -1.0, -1.0)),
        at(LAND, n - 4, 0.0),
    ]  # fmt: skip
    assert len(items) == n
    return Mission(autopilot, HOME, tuple(items), "uav1", sysid)


def a_vehicle(autopilot: Autopilot, trouble: str = "", *, sysid: int = 1) -> LoopbackVehicle:
    """A loopback vehicle at the missions' home."""
    return LoopbackVehicle(
        sysid,
        autopilot,
        lat_deg=HOME.lat_e7 / 1e7,
        lon_deg=HOME.lon_e7 / 1e7,
        amsl_m=HOME.amsl_m,
        misbehave=Misbehaviour.parse(trouble),
    )
