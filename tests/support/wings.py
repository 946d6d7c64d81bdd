"""A fixed wing over flat ground for tests: the aircraft, items at places of the plane, and missions through points."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.fly_by import tangents_m
from gcsplan.world.world import World
from tests.support.worlds import vehicle, world

HOME_DEG = (36.6, -84.3)


GROUND_M = 300.0


RADIUS_M = 100.0


SPEED_M_S = 20.0


FLAT = world(GROUND_M)


def wing(radius_m: float = RADIUS_M, **limits: float | None) -> Vehicle:
    base = vehicle(Autopilot.ARDUPLANE, **({"max_climb_deg": 8.0, "max_descent_deg": 8.0} | limits))
    return replace(
        base, turn_radius_m=radius_m, speed_max_m_s=SPEED_M_S, climb_m_s=5.0, descent_m_s=5.0,
        accel_m_s2=math.inf, corner_accel_m_s2=math.inf, vertical_accel_m_s2=math.inf,
    )  # fmt: skip


def at(command: int, east: float, north: float, up: float, *params: float, where: World = FLAT) -> MissionItem:
    lat, lon = (float(x) for x in where.frame.to_degrees(east, north))
    p1, p2, p3, p4 = (*params, *[0.0] * (4 - len(params)))
    return MissionItem(command, m.RELATIVE, (p1, p2, p3, p4), m.degrees_e7(lat), m.degrees_e7(lon), up)


def mission(*items: MissionItem) -> Mission:
    return Mission(Autopilot.ARDUPLANE, Home.at(*HOME_DEG, GROUND_M), items, "uav1", 1)


def take_off(up: float = 80.0, east: float = 600.0, north: float = 0.0) -> MissionItem:
    return at(cmd.TAKEOFF, east, north, up, 8.0)


def through(points: list[tuple[float, float, float]], accept: list[float] | None = None) -> Mission:
    """A take-off to the east, way points whose acceptance is the tangent length, and a circle at the last."""
    whole = np.array([(0.0, 0.0, 80.0), *points])
    radii = np.ceil(tangents_m(whole, RADIUS_M)[1:]) if accept is None else np.array(accept)
    items = [at(cmd.WAYPOINT, *p, 0.0, max(1.0, r)) for p, r in zip(points[:-1], radii, strict=False)]
    return mission(take_off(), *items, at(cmd.LOITER_UNLIM, *points[-1], 0.0, 0.0, 100.0))
