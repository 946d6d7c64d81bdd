"""Paths along the ways of bounds, past what is shut there by little.

The way of a bound is as short as a way can be. Where the exact check shuts it, it does so for a few hundred metres at
most, for metres or centimetres: beside it, between cells too large to show it, there may be a slit that is open. Each
such stretch is a problem of its own, so small that its cells are a metre or two wide.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.detours import joined
from gcsplan.planners.track import distances

if TYPE_CHECKING:
    from gcsplan.planners.below import Below
    from gcsplan.planners.leg import Leg

Floats = NDArray[np.float64]
Point = tuple[float, float, float]

STEP_M = 8.0
"""Between places of a way at which the exact check is asked."""
ROOM_M = 8.0
"""Over the floor at both ends of a stretch: there the slit is over."""
UNDER_M = 0.5
"""How far below the cap stretches begin and end."""
REACHED = 0.95
"""What part of the way from or to a stop is climbed on."""
APART_M = 1e-3
"""Places nearer to each other are one."""
SLACKS = (0.008, 0.15)
"""How much longer than the shortest tracks of a stretch are, as a part; longer ones are no slits."""
FARTHEST = 1.5
"""How many times as long as the straight way tracks may be that are looked for between two places."""
MOST = 24
"""Stretches of a way, of which more are not looked at."""


def follow(below: Below) -> bool:
    """Look for a path along the ways of the last bounds, leg by leg; True if it is the best so far."""
    paths: list[Floats] = []
    start = below.problem.start
    for leg in below.legs:
        path = _along(below, leg, start)
        if path is None:
            return False
        paths.append(path)
        start = tuple(path[-1].tolist())
    points, pinned, _ = joined(paths, [None] * (len(paths) - 1))
    return not below.judge.violations(points) and below.take_simpler(points, pinned, fine=True, longer=False)


def _along(below: Below, leg: Leg, start: Point) -> Floats | None:
    """(N, 3) way points along the way of a leg's last bound, led past what is shut on it; None where that fails."""
    way = leg.last_way
    at = distances(way)
    s = np.linspace(0.0, at[-1], math.ceil(at[-1] / STEP_M) + 1)
    places = np.stack([np.interp(s, at, way[:, k]) for k in range(2)], axis=-1)
    east, north = places.T
    over = below.problem.airspace.floor_amsl(east, north, below.problem.limits) - below.top_m
    stretches = _stretches(over)
    if len(stretches) > MOST:
        return None
    cuts = sorted({0, len(s) - 1, *(k for stretch in stretches for k in stretch)})
    out: list[Floats] = []
    for first, last in pairwise(cuts):
        goal = _height(below, leg, *map(float, (s[last], at[-1] - s[last], over[last])))
        part = replace(
            below.problem, start=start, goal=(*places[last].tolist(), goal), via=(), progress=None, objective="length"
        )
        found = type(below)(part, below.begun_s)
        for piece in found.legs:
            piece.farthest = FARTHEST
        if (first, last) not in stretches:
            open_way = np.vstack([places[first], way[(at > s[first]) & (at < s[last])], places[last]])
            found.take_along(joined([open_way], []))
        if found.best is None:
            found.look(SLACKS, (False,))
        if found.best is None or not below.in_time():
            return None
        out.append(found.best if not out else found.best[1:])
        start = part.goal
    return np.vstack(out)


def _stretches(over: Floats) -> list[tuple[int, int]]:
    """First and last of places, between which there is less room than `ROOM_M`, and somewhere none."""
    out: list[tuple[int, int]] = []
    tight = over > -ROOM_M
    for k in np.flatnonzero(over > 0.0).tolist():
        if out and k <= out[-1][1]:
            continue
        before, after = np.flatnonzero(~tight[:k]), np.flatnonzero(~tight[k:])
        out.append((int(before[-1]) if len(before) else 0, k + int(after[0]) if len(after) else len(over) - 1))
    return out


def _height(below: Below, leg: Leg, from_start_m: float, to_goal_m: float, over_m: float) -> float:
    """How high a path goes on at a place: below the cap by half of what there is to spare, or less; that of the goal
    there; and what can be reached from start and goal."""
    limits = below.problem.limits
    z = below.top_m - min(UNDER_M, max(-0.5 * over_m, 0.0))
    for stop, way_m, slope in (
        (leg.start, from_start_m, limits.max_climb_slope),
        (leg.goal, to_goal_m, limits.max_descent_slope),
    ):
        if stop.amsl_m is not None:
            z = stop.amsl_m if way_m < APART_M else min(z, stop.amsl_m + REACHED * slope * way_m)
    return z
