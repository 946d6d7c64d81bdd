"""Missions that are followed without a world: items by degrees, over level ground or over a slope."""

from __future__ import annotations

from gcsplan.check.flight.follow import follow
from gcsplan.check.motion.stretch import Flight
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits

GROUND_M = 300.0


HOME = Home.at(36.6, -84.3, GROUND_M)


def vehicle(autopilot: Autopilot = Autopilot.ARDUCOPTER) -> Vehicle:
    return Vehicle("uav1", 1, autopilot, Limits(min_agl_m=60))


def fly(
    *items: MissionItem,
    autopilot: Autopilot = Autopilot.ARDUCOPTER,
    home: Home = HOME,
    ground_m: float = GROUND_M,
    rtl_rel_home_m: float | None = None,
) -> Flight:
    mission = Mission(autopilot, home, items)
    return follow(mission, vehicle(autopilot), lambda lat, lon: ground_m, rtl_rel_home_m=rtl_rel_home_m)


def at(command: int, north: float, east: float, z: float, frame: int = m.RELATIVE, p1: float = 0.0) -> MissionItem:
    return MissionItem(command, frame, (p1, 0, 0, 0), m.degrees_e7(36.6 + north), m.degrees_e7(-84.3 + east), z)


TAKEOFF = at(cmd.TAKEOFF, 0, 0, 65)


VTOL_TAKEOFF = at(cmd.VTOL_TAKEOFF, 0, 0, 65)


def unknown(flight: Flight) -> list[int]:
    """The commands whose flight is not judged."""
    return [n.data["command"] for n in flight.not_judged if n.code == "flown_unknown"]  # type: ignore[misc]


SLOPE = 20_000.0  # metres that the ground rises per degree of latitude


def fly_over_a_slope(
    *items: MissionItem, autopilot: Autopilot = Autopilot.ARDUCOPTER, rtl_rel_home_m: float | None = None
) -> Flight:
    mission = Mission(autopilot, HOME, items)
    craft = vehicle(autopilot)
    return follow(
        mission, craft, lambda lat, lon: GROUND_M + SLOPE * (lat - 36.6), rtl_rel_home_m=rtl_rel_home_m
    )  # fmt: skip
