"""Vehicles with short missions to rehearse over flat ground."""

from __future__ import annotations

from dataclasses import replace

from gcsplan.check.judge import judge
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.sim.outcome import Rehearsal, RehearsalPart
from gcsplan.vehicle import Vehicle
from gcsplan.world.world import World
from tests.support import worlds

GROUND_M = 300.0
FLAT = worlds.world(GROUND_M, half_m=4000.0)
CLIMB_S = 70 / 2.5 + 2.5
CRUISE_M_S = 10.0
BRAKING_S = CRUISE_M_S / 1.5
"""The time of starting and stopping beside the cruise itself."""


def at(command: int, east_m: float, north_m: float, z: float, world: World = FLAT) -> MissionItem:
    lat, lon = (float(x) for x in world.frame.to_degrees(east_m, north_m))
    return MissionItem(command, m.RELATIVE, (0, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), z)


def a_part(
    number: int,
    *way: tuple[float, float],
    world: World = FLAT,
    height_m: float = 70.005,
    depart_s: float = 0.0,
    arrive_s: float | None = None,
    vehicle: Vehicle | None = None,
    land: bool = True,
) -> RehearsalPart:
    """A vehicle that takes off at the first place, passes the others at 10 m/s, and lands at the last."""
    vehicle = vehicle or replace(worlds.vehicle(), speed_max_m_s=CRUISE_M_S)
    vehicle = replace(vehicle, name=f"uav{number}", sysid=number)
    lat, lon = (float(x) for x in world.frame.to_degrees(*way[0]))
    home = Home.at(lat, lon, world.ground_amsl(lat, lon))
    items = [
        at(cmd.TAKEOFF, *way[0], height_m),
        MissionItem(cmd.DO_CHANGE_SPEED, m.NO_POSITION, (1.0, CRUISE_M_S, -1.0, 0.0)),
        *(at(cmd.WAYPOINT, *place, height_m) for place in way[1:]),
    ]  # fmt: skip
    if land:
        items.append(at(cmd.LAND, *way[-1], 0))
    mission = Mission(vehicle.autopilot, home, tuple(items), vehicle.name, number)
    return RehearsalPart(vehicle, mission, judge(mission, vehicle, world), depart_s, arrive_s)


def reached_s(length_m: float) -> float:
    """By hand: the climb to 70 m, and a straight way."""
    return CLIMB_S + length_m / CRUISE_M_S + BRAKING_S


def kinds(result: Rehearsal) -> list[str]:
    return sorted(b.kind for b in result.breaches)
