"""Conversion of a path in metres to a `Mission`.

Altitudes are sent in whole centimetres, degrees in whole 1e-7; the planner kept margins for both (`MARGINS`). Legs are
split until the line straight in the plane and the line straight in degrees lie within `Order.bow_m` of each other, so
that it does not matter which of the two an autopilot flies.

A corner that is cut too near gets one way point more behind it, or is moved outwards. ArduCopter blends two legs within
WPNAV_RADIUS, and not in the first half of either (`check.flight.corners`). A leg of some centimetres behind a corner,
in the direction of the next leg, leaves the line as it is, and hardly room to cut it. PX4 turns an acceptance radius
before a corner, whatever follows. So its corners are moved outwards by as much as they are cut there; the legs beside
them move less and less towards their other ends, as what is cut does.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.mavlink.build.fixed_wing import build_wing
from gcsplan.mavlink.build.order import Order, most_cm, none_zero, split_legs, whole_cm, with_gates
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.autopilots import altitude_of_cm
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.notes.note import Finding
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.path import Path
from gcsplan.world.world import World

COPTER_ACCEPTANCE_M = 2.0  # ArduCopter WPNAV_RADIUS, default
SHORT_LEG_M, ROUNDED_M = 0.05, 0.02
"""Length of the leg that is put behind a corner which must not be cut, metres, and what rounding may add to it."""
EXACT_M = 1e-3
"""Metres within which a way point is at a place of `Order.exact`."""
NEAR_M = 0.05
"""Metres within which an item is at a point of the path: rounding, and more."""
SLIGHT_TURN_RAD = 1e-3
"""A turn, rad, that is none."""
MORE, MORE_M = 1.05, 0.03
"""Times and metres by which a corner is moved farther than it is cut: moved, it turns more sharply."""
LEAST_COSINE = 0.5
"""Least cosine of half a turn that counts: what turns back on itself would have to be moved very far."""


def acceptance_radius_m(vehicle: Vehicle) -> float:
    """Return the acceptance radius: ArduCopter's own parameter; else the track error, sent with each item (1 … 255)."""
    if vehicle.autopilot is Autopilot.ARDUCOPTER:
        return COPTER_ACCEPTANCE_M
    return vehicle.acceptance_m


def cuts_corners(vehicle: Vehicle) -> bool:
    """Return whether a vehicle that can hover cuts corners by more than its errors may include."""
    errors_m = vehicle.limits.track_error_m
    if vehicle.autopilot is Autopilot.ARDUCOPTER:  # a mended corner is not cut in height, either
        errors_m = min(errors_m, vehicle.limits.altitude_error_m)
    bounded = vehicle.turn_radius_m <= 0.0 and math.isfinite(vehicle.corner_accel_m_s2)
    return bounded and acceptance_radius_m(vehicle) > errors_m


def corner_m(vehicle: Vehicle) -> float:
    """Return the planner's margin for corners that an ArduCopter cuts by more than ``track_error_m``: what is left to
    cut of a corner behind which a short leg begins; mostly 0. Others' corners are moved where they are cut."""
    if vehicle.autopilot is not Autopilot.ARDUCOPTER or not cuts_corners(vehicle):
        return 0.0
    return 0.5 * (SHORT_LEG_M + ROUNDED_M) if acceptance_radius_m(vehicle) > vehicle.limits.track_error_m else 0.0


def build_mission(path: Path, world: World, vehicle: Vehicle, home_deg: tuple[float, float], order: Order) -> Mission:
    """Return the mission that flies ``path``: take-off at home, its points, and ``order.end``.

    The path begins above home at take-off altitude and ends above the goal. The mission is not yet checked.
    """
    if order.wing is not None:
        return build_wing(path, world, vehicle, home_deg, order)
    datum = world.ground_amsl(*(m.degrees_e7(x) / 1e7 for x in home_deg))
    home = Home.at(*home_deg, round(datum, 2))
    points = spaced_out(path.points, vehicle) if order.spaced else path.points
    terrain = order.altitude_frame == "terrain"
    if terrain:  # split legs in height above ground, because the autopilot interpolates that height along a leg
        ground = world.vehicle_terrain.ground_at(points[:, 0], points[:, 1])
        if np.isnan(ground).any():
            raise InputError(
                f"{vehicle.name}: its path leads over ground that the vehicle's terrain grid does not know, though the "
                "terrain model does: near the edge of the model, or of a void, not all posts of a part are known; give "
                "a larger DEM, or another altitude_frame"
            )
        points = np.column_stack([points[:, :2], points[:, 2] - ground])
    points = split_legs(points, world, order.bow_m)
    opens: dict[int, int] = {}
    gates = order.gates
    if gates is not None:
        points, rows = with_gates(points, gates.at_m)
        opens = dict(zip(rows, gates.opens_s, strict=True))
    places = world.frame.to_degrees(points[:, 0], points[:, 1])
    lat_e7 = np.rint(places[:, 0] * 1e7).astype(int)
    lon_e7 = np.rint(places[:, 1] * 1e7).astype(int)
    lat_e7[0], lon_e7[0] = home.lat_e7, home.lon_e7
    if terrain:
        frame, cm = m.TERRAIN, np.rint(points[:, 2] * 100).astype(int)
    else:
        base = datum if order.altitude_frame == "relative" else 0.0
        frame = m.RELATIVE if order.altitude_frame == "relative" else m.GLOBAL
        rounded = world.frame.to_plane(lat_e7 / 1e7, lon_e7 / 1e7)
        cm = _round_heights(points, rounded, base, vehicle, order)
    top_cm = round((path.points[0, 2] - datum) * 100)
    bearings = _bearings(points)
    px4 = vehicle.autopilot is Autopilot.PX4

    def item(command: int, i: int, frame: int, cm: int, *, radius_m: float = 0.0) -> MissionItem:
        yaw = round(float(bearings[max(i - 1, 0)]), 1) if px4 else 0.0
        z = 0.0 if command == cmd.LAND and not cm else altitude_of_cm(cm, vehicle.autopilot)
        return MissionItem(command, frame, (0.0, radius_m, 0.0, yaw), int(lat_e7[i]), int(lon_e7[i]), z)

    radius = 0.0 if vehicle.autopilot is Autopilot.ARDUCOPTER else acceptance_radius_m(vehicle)
    speed = vehicle.speed_max_m_s if order.speed_m_s is None else order.speed_m_s
    items = [
        item(cmd.TAKEOFF, 0, m.RELATIVE, top_cm),
        MissionItem(cmd.DO_CHANGE_SPEED, m.NO_POSITION, (1.0, speed, -1.0, 0.0)),
    ]
    if order.hold_s > 0 or order.gate_utc is not None:  # right after take-off: a gate is exact from a standstill
        items.insert(1, _gate(order, vehicle))
    last = len(points) - 1
    for i in range(1, last):
        items.append(item(cmd.WAYPOINT, i, frame, int(cm[i]), radius_m=radius))
        if i in opens:
            at = datetime.fromtimestamp(opens[i], UTC)
            items.append(_until((at.hour, at.minute, at.second), vehicle))
    if order.end == "loiter":
        items.append(item(cmd.LOITER_UNLIM, last, frame, int(cm[last])))
    else:
        items.append(item(cmd.WAYPOINT, last, frame, int(cm[last]), radius_m=radius))
    if order.end == "land":
        pad_cm = _pad_cm(world, items[-1], datum, vehicle)
        items.append(item(cmd.LAND, last, m.RELATIVE, pad_cm))
    elif order.end == "rtl":
        items.append(MissionItem(cmd.RTL, m.NO_POSITION))
    if order.return_path:
        items.append(MissionItem(cmd.DO_RETURN_PATH_START, m.NO_POSITION))
        items += [item(cmd.WAYPOINT, i, frame, int(cm[i]), radius_m=radius) for i in range(last, -1, -1)]
        items.append(item(cmd.LAND, 0, m.RELATIVE, 0))
    leaves_s = None if gates is None else gates.leaves_s
    return Mission(vehicle.autopilot, home, tuple(items), vehicle.name, vehicle.sysid, leaves_s)


def _pad_cm(world: World, above: MissionItem, datum: float, vehicle: Vehicle) -> int:
    """Return the ground below an item relative to home, cm, for ArduCopter's LAND; 0 for others, and where unknown.

    ArduCopter does not fly to this altitude, but since 4.7 it slows down for the landing at 10 m above it (before: 10 m
    above the terrain that it has, or above home).
    """
    # The greatest one: before ground that may be higher it slows down in time.
    ground = world.ground_amsl(above.lat_deg, above.lon_deg) + world.spread_m(above.lat_deg, above.lon_deg)
    if vehicle.autopilot is not Autopilot.ARDUCOPTER or math.isnan(ground):
        return 0
    return round((ground - datum) * 100.0)


def _gate(order: Order, vehicle: Vehicle) -> MissionItem:
    if order.gate_utc is not None:
        return _until(order.gate_utc, vehicle)
    if not vehicle.can_hold:
        raise ValueError(f"{vehicle.name} cannot wait so in the air: {vehicle.autopilot} goes on at once")
    return MissionItem(cmd.DELAY, m.NO_POSITION, (float(order.hold_s), -1.0, -1.0, -1.0))


def _until(time_of_day: tuple[int, int, int], vehicle: Vehicle) -> MissionItem:
    """The item that waits until hour, minute and second UTC."""
    if vehicle.autopilot is not Autopilot.ARDUCOPTER:
        raise ValueError(f"{vehicle.name} cannot wait so in the air: {vehicle.autopilot} goes on at once")
    hour, minute, second = time_of_day
    return MissionItem(cmd.DELAY, m.NO_POSITION, (-1.0, float(hour), float(minute), float(second)))


def spaced_out(points: Floats, vehicle: Vehicle) -> Floats:
    """Drop inner points nearer than two acceptance radii to the previous kept point or to the last point."""
    apart_m, places = 2.0 * acceptance_radius_m(vehicle), points.tolist()
    kept = [0]
    for k in range(1, len(places) - 1):
        if math.dist(places[k], places[kept[-1]]) >= apart_m and math.dist(places[k], places[-1]) >= apart_m:
            kept.append(k)
    return points[[*kept, -1]]


def corners_cut(mission: Mission, findings: Sequence[Finding], points: Floats, world: World) -> set[int]:
    """The corners of a path (N, 3) at which the legs with ``findings`` begin and end, by index."""
    way, legs = points[:, :2], np.diff(points, axis=0)
    long = np.hypot(*legs[:, :2].T)
    ways = legs / np.maximum(np.linalg.norm(legs, axis=1), 1e-9)[:, None]
    turns = np.linalg.norm(np.diff(ways, axis=0), axis=1)  # in height, too
    found: set[int] = set()
    for seq in {s for f in findings for s in (f.seq - 1, f.seq)}:
        index = seq - mission.first_seq
        if not 0 <= index < len(mission.items):
            continue
        item = mission.items[index]
        if item.command not in (cmd.WAYPOINT, cmd.LOITER_UNLIM):
            continue
        place = np.array(world.frame.to_plane(item.x / 1e7, item.y / 1e7), dtype=float)
        for k in (np.flatnonzero(np.hypot(*(way[1:-1] - place).T) < NEAR_M) + 1).tolist():
            if turns[k - 1] > SLIGHT_TURN_RAD and long[k] > 2.0 * SHORT_LEG_M:
                found.add(k)
    return found


def sharpened_corners(points: Floats, corners: Collection[int]) -> Floats:
    """The path with another point `SHORT_LEG_M` behind each of ``corners``, on the leg that begins there, or so near
    above or below it that rounding makes the way there no steeper than the leg."""
    out = []
    for k, p in enumerate(points):
        out.append(p)
        if k in corners:
            leg = points[k + 1] - p
            behind = p + SHORT_LEG_M / float(np.hypot(*leg[:2])) * leg
            rise_m = float(behind[2] - p[2])
            behind[2] -= math.copysign(min(abs(rise_m), ROUNDED_M), rise_m)
            out.append(behind)
    return np.array(out)


def moved_corners(points: Floats, corners: Collection[int], radius_m: float) -> Floats:
    """The path (N, 3) with each of ``corners`` moved outwards in the plane by what a vehicle that turns ``radius_m``
    before it leaves aside of the next leg."""
    legs = np.diff(points[:, :2], axis=0)
    long = np.maximum(np.hypot(*legs.T), 1e-9)
    ways = legs / long[:, None]
    out, off_m = points.copy(), 0.0
    for k in range(1, len(points) - 1):
        bend = ways[k - 1] - ways[k]
        half = math.asin(min(0.5 * float(np.hypot(*bend)), 1.0))
        part = min(radius_m / float(long[k - 1]), 1.0)
        off_m = min(radius_m, radius_m * math.sin(min(2.0 * half, 0.5 * math.pi)) + part * off_m)
        if k in corners and half > 0.5 * SLIGHT_TURN_RAD:
            away_m = (MORE * off_m + MORE_M) / max(math.cos(half), LEAST_COSINE)
            out[k, :2] += away_m * bend / float(np.hypot(*bend))
    return out


def _round_heights(points: Floats, places_m: Floats, base_m: float, vehicle: Vehicle, order: Order) -> NDArray[np.int_]:
    """Return heights above ``base_m`` in whole centimetres; rounding makes no leg steeper than its limit.

    ``points`` (N, 3) are the path's, ``places_m`` (N, 2) what is left of their places on the wire.
    """
    up, down = vehicle.limits.max_climb_slope, vehicle.limits.max_descent_slope
    if order.return_path:  # flown backwards, too
        up = down = min(up, down)
    run_m = np.hypot(*np.diff(places_m, axis=0).T)
    exact = np.zeros(len(points), np.bool_)
    for place in order.exact:
        exact |= np.hypot(*(points[:, :2] - place).T) < EXACT_M
    given_cm, up_cm, down_cm = (points[:, 2] - base_m) * 100.0, most_cm(run_m, up), most_cm(run_m, down)
    cm = whole_cm(given_cm, up_cm, down_cm, exact)
    return none_zero(cm, given_cm, up_cm, down_cm) if vehicle.autopilot is Autopilot.ARDUCOPTER else cm


def _bearings(points: Floats) -> Floats:
    """(N - 1,) course of each leg, degrees clockwise from the plane's north, in [0, 360)."""
    d = np.diff(points[:, :2], axis=0)
    return np.asarray(np.degrees(np.arctan2(d[:, 0], d[:, 1])) % 360.0)
