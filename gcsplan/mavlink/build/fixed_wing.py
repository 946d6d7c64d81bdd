"""A fixed wing's mission items: take-off straight ahead, fly-by way points, and the end.

- NAV_TAKEOFF: param1 is the minimum pitch in whole degrees; ArduPlane holds the heading of its launch. The item's
  location is the end of the climb-out, which shows that heading to the launching person and to the check.
- NAV_WAYPOINT: param2, the acceptance radius, is the tangent length of the corner, rounded up to whole metres: the
  turn begins there. Where an arc takes all of its leg, as behind a via, it is rounded down: a way point that lies
  within its own radius when the leg begins would be passed over. ArduPlane stores it in one byte, so a corner that
  needs more becomes two way points on one arc.
- No DO_LAND_START before a landing: with it ArduPlane does not arm unless RTL_AUTOLAND is set.
- A VTOL takes off and lands vertically, and flies to its landing from the way point before the path's last one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.mavlink.build.order import Order, most_cm, split_legs, whole_cm
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.autopilots import altitude_of_cm
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.vehicle import Vehicle
from gcsplan.world.geometry.fly_by import flown_m, tangents_m, turns_of
from gcsplan.world.geometry.path import Path
from gcsplan.world.world import World

__all__ = ["accepted_m", "build_wing", "parted", "pitch_deg"]


FARTHEST_ACCEPTED_M = 255.0
"""Largest acceptance radius that ArduPlane stores, in metres (one byte)."""

RADIUS_ROUNDED_M = 1e-3
"""Metres: a tangent that exceeds whole metres by less is not rounded up."""

LEAST_ACCEPTED_M = 1.0


def pitch_deg(vehicle: Vehicle) -> int:
    """Return the take-off pitch: whole degrees, at most ``max_climb_deg``."""
    return math.floor(vehicle.steepest_in_air_deg + 1e-9)


def parted(points: Floats, radius_m: float) -> Floats:
    """Return ``points`` with each corner too large for `FARTHEST_ACCEPTED_M` replaced by two corners on the same arc.

    The altitude of each new corner is that at the middle of its half of the arc, so the altitude flown is unchanged.
    """
    while True:
        tangent = tangents_m(points, radius_m)
        far = np.flatnonzero(tangent > FARTHEST_ACCEPTED_M - 1.0)
        if not len(far):
            return points
        k = int(far[0])
        turn = abs(float(turns_of(points)[k - 1]))
        short = radius_m * math.tan(0.25 * turn)
        back, on = points[k - 1] - points[k], points[k + 1] - points[k]
        flown = flown_m(points, radius_m)
        quarter = 0.25 * radius_m * turn
        pair = []
        for way, run in ((back, flown[k - 1]), (on, flown[k])):
            flat = (tangent[k] - short) * way[:2] / math.hypot(way[0], way[1])
            pair.append([*(points[k, :2] + flat), points[k, 2] + way[2] * quarter / max(run, 1e-9)])
        points = np.vstack([points[:k], pair, points[k + 1 :]])


def accepted_m(tangent_m: float, run_m: float) -> float:
    """The acceptance radius of a corner at the end of a leg of ``run_m``: whole metres, and not above ``run_m``.

    So a turn begins less than a metre early, or, where its arc begins with the leg, less than a metre late.
    """
    accepted = math.ceil(tangent_m - RADIUS_ROUNDED_M)
    if accepted > run_m:
        accepted = math.floor(run_m)
    return min(max(LEAST_ACCEPTED_M, accepted), FARTHEST_ACCEPTED_M)


def build_wing(path: Path, world: World, vehicle: Vehicle, home_deg: tuple[float, float], order: Order) -> Mission:
    """Return the mission that flies ``path`` (fly-by way points) between the ends in ``order.wing``."""
    wing = order.wing
    assert wing is not None
    if order.hold_s > 0 or order.gate_utc is not None:
        raise ValueError(f"{vehicle.name} cannot wait in the air: a fixed wing goes on at once")
    if order.altitude_frame == "terrain":
        raise ValueError(f"{vehicle.name}: a fixed wing's turns are planned for altitudes above home or sea level")
    datum = world.ground_amsl(*(m.degrees_e7(x) / 1e7 for x in home_deg))
    home = Home.at(*home_deg, round(datum, 2))
    radius = vehicle.turn_radius_m
    points = split_legs(parted(path.points, radius), world)
    base = datum if order.altitude_frame == "relative" else 0.0
    frame = m.RELATIVE if order.altitude_frame == "relative" else m.GLOBAL
    cm = _heights_cm(points, base, vehicle)
    # The first point turns from the climb-out into the path, the last one from the path into the glide.
    upright = vehicle.vtol
    whole = np.array([wing.leaves, *points, *([] if wing.touch is None or upright else [wing.touch])])
    tangent = tangents_m(whole, radius)[1:]
    run = np.hypot(*np.diff(whole[:, :2], axis=0).T)
    places = world.frame.to_degrees(points[:, 0], points[:, 1])

    def item(
        command: int, place: Floats, frame: int, cm: int, params: tuple[float, float, float, float]
    ) -> MissionItem:
        z = altitude_of_cm(cm, vehicle.autopilot)
        return MissionItem(command, frame, params, m.degrees_e7(float(place[0])), m.degrees_e7(float(place[1])), z)

    top = world.frame.to_degrees(wing.top[0], wing.top[1])
    speed = vehicle.speed_max_m_s if order.speed_m_s is None else order.speed_m_s
    up, pitch = (cmd.VTOL_TAKEOFF, 0.0) if upright else (cmd.TAKEOFF, float(pitch_deg(vehicle)))
    items = [
        item(up, top, m.RELATIVE, round((wing.top[2] - datum) * 100), (pitch, 0.0, 0.0, 0.0)),
        MissionItem(cmd.DO_CHANGE_SPEED, m.NO_POSITION, (0.0, speed, -1.0, 0.0)),
    ]
    if wing.up is not None:
        place, up_cm = world.frame.to_degrees(wing.up[0], wing.up[1]), round((wing.up[2] - datum) * 100)
        items.insert(1, item(cmd.LOITER_TO_ALT, place, m.RELATIVE, up_cm, (0.0, wing.up_m, 0.0, 0.0)))
    for i in range(len(points) - (upright and wing.touch is not None)):
        if i == len(points) - 1 and order.end == "loiter":
            items.append(item(cmd.LOITER_UNLIM, places[i], frame, int(cm[i]), (0.0, 0.0, wing.circle_m, 0.0)))
            continue
        accepted = accepted_m(float(tangent[i]), float(run[i]))
        items.append(item(cmd.WAYPOINT, places[i], frame, int(cm[i]), (0.0, accepted, 0.0, 0.0)))
    if wing.touch is not None:
        touch = world.frame.to_degrees(wing.touch[0], wing.touch[1])
        land = cmd.VTOL_LAND if upright else cmd.LAND
        items.append(item(land, touch, m.RELATIVE, round((wing.touch[2] - datum) * 100), (0.0, 0.0, 0.0, 0.0)))
    elif order.end == "rtl":
        items.append(MissionItem(cmd.RTL, m.NO_POSITION))
    return Mission(vehicle.autopilot, home, tuple(items), vehicle.name, vehicle.sysid)


def _heights_cm(points: Floats, base_m: float, vehicle: Vehicle) -> NDArray[np.int_]:
    """Return heights above ``base_m`` in whole centimetres; rounding makes no flown leg steeper than its limit."""
    run_m = flown_m(points, vehicle.turn_radius_m) - 0.03
    # The check judges arcs by their chords, which are shorter by less than a thousandth.
    up, down = 0.999 * vehicle.limits.max_climb_slope, 0.999 * vehicle.limits.max_descent_slope
    exact = np.zeros(len(points), np.bool_)
    return whole_cm((points[:, 2] - base_m) * 100.0, most_cm(run_m, up), most_cm(run_m, down), exact)
