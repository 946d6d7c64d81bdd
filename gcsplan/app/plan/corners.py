"""Corners of a path that are cut too near: one way point more behind each, or the corner moved outwards.

ArduCopter blends two legs within WPNAV_RADIUS, and not in the first half of either (`check.corners`). A leg of some
centimetres behind a corner, in the direction of the next leg, leaves the line as it is, and hardly room to cut it.

PX4 and a VTOL turn an acceptance radius before a corner, whatever follows. So their corners are moved outwards by as
much as they are cut there; the legs beside them move less and less towards their other ends, as what is cut does.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.mavlink.build.multirotor import ROUNDED_M, SHORT_LEG_M
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.notes.note import Finding
from gcsplan.world.world import World

__all__ = ["cut", "moved", "sharpened"]

NEAR_M = 0.05
"""Metres within which an item is at a point of the path: rounding, and more."""
SLIGHT_TURN_RAD = 1e-3
"""A turn, rad, that is none."""
MORE, MORE_M = 1.05, 0.03
"""Times and metres by which a corner is moved farther than it is cut: moved, it turns more sharply."""
LEAST_COSINE = 0.5
"""Least cosine of half a turn that counts: what turns back on itself would have to be moved very far."""


def cut(mission: Mission, findings: Sequence[Finding], points: Floats, world: World) -> set[int]:
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


def sharpened(points: Floats, corners: Collection[int]) -> Floats:
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


def moved(points: Floats, corners: Collection[int], radius_m: float) -> Floats:
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
