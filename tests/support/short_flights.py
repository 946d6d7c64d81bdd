"""Short flights of one copter over flat ground, as tracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.sim.flight.mission_flight import FlownLanes
from gcsplan.sim.flight.track import CommandedTrack, make_track
from gcsplan.vehicle import Vehicle
from gcsplan.world.world import World
from tests.support import worlds

GROUND_M = 300.0
FLAT = worlds.world(GROUND_M)
COPTER = replace(worlds.vehicle(), speed_max_m_s=10.0)


def at(command: int, east_m: float, north_m: float, z: float, p1: float = 0.0, frame: int = m.RELATIVE) -> MissionItem:
    lat, lon = (float(x) for x in FLAT.frame.to_degrees(east_m, north_m))
    return MissionItem(command, frame, (p1, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), z)


def speed(m_s: float) -> MissionItem:
    return MissionItem(cmd.DO_CHANGE_SPEED, m.NO_POSITION, (1.0, m_s, -1.0, 0.0))


def track(
    *items: MissionItem, vehicle: Vehicle = COPTER, world: World = FLAT, rtl_rel_home_m: float | None = None
) -> CommandedTrack:
    lat, lon = (float(x) for x in FLAT.frame.to_degrees(0.0, 0.0))
    mission = Mission(vehicle.autopilot, Home.at(lat, lon, GROUND_M), items)
    return make_track(mission, vehicle, world, Kinematics.of(vehicle), rtl_rel_home_m=rtl_rel_home_m)


def speed_at(flown: FlownLanes, along_m: float) -> float:
    """Speed of the only lane where it has come so far along its track."""
    s = flown.along_m[:, 0]
    j = int(np.searchsorted(s, along_m))
    return float((s[j + 1] - s[j - 1]) / (flown.times_s[j + 1] - flown.times_s[j - 1]))


TAKEOFF = at(cmd.TAKEOFF, 0, 0, 50)
CLIMB_S = 50 / 2.5 + 2.5 / 1.0
"""To 50 m: 2.5 m/s reached and lost again at 1 m/s²."""
