"""Flights of a route, and of a schedule's slots, at one speed: `Course` in one call."""

from __future__ import annotations

from collections.abc import Sequence

from gcsplan.fleet.arrival import Crew, Schedule
from gcsplan.fleet.motion.timing import POSITION_ERROR_M, Course, Route, TimedPath
from gcsplan.vehicle import Vehicle


def fly(
    route: Route,
    vehicle: Vehicle,
    speed_m_s: float,
    depart_s: float = 0.0,
    hold_s: float = 0.0,
    error_m: float = POSITION_ERROR_M,
) -> TimedPath:
    """The motion of a whole flight; see `Course.fly`."""
    return Course(route, vehicle).fly(speed_m_s, depart_s, hold_s, error_m)


def time_to_goal_s(route: Route, vehicle: Vehicle, speed_m_s: float) -> float:
    """Seconds from leaving the ground to the arrival."""
    return Course(route, vehicle).time_to_goal_s(speed_m_s)


def motions(plan: Schedule, crews: Sequence[Crew]) -> tuple[TimedPath, ...]:
    """The motions of a schedule's slots, in its order."""
    vehicles = {c.name: c.vehicle for c in crews}
    return tuple(fly(s.route, vehicles[s.name], s.speed_m_s, s.depart_s, s.hold_s) for s in plan.slots)
