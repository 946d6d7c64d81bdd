"""The missions of ``gcsplan bench fleet``: depots over the sample terrain whose copters fly to places around them.

Each depot has rows of pads; each pad has one copter, and each copter a place of its own, drawn around its depot. Places
are drawn apart from each other, from every pad and from zones, but without a look at heights or at the battery, which
is the same for all: a copter whose place is too far or too high for it has no mission. Arrivals are in sequence, and
the depots take turns. System ids repeat; each link has a system id once. This module uses no planner.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError

__all__ = ["MOST_FLEET", "fleet_document"]

Document = dict[str, Any]

MIDDLE_DEG = (36.575, -84.255)
HALF_M = 11_000.0
"""Half the side of the square of depots around `MIDDLE_DEG`, m."""
REACH_M = 14_000.0
"""The same of the square of goals, which is within the sample terrain."""

METRES_PER_DEGREE = 111_200.0
PADS = 10
"""Pads in a row of a depot, and rows."""
PAD_M = 90.0
BATTERY_J, RESERVE = 6.2e5, 0.2
"""Battery of each copter, J, and the part of it that must be left: too little for about one flight in a hundred."""
NEAREST_M, FARTHEST_M = 1500.0, 4000.0
"""Distance of a copter's goal from the middle of its depot, m."""
APART_M = 100.0
"""Least distance of two places, m."""
DEPOTS_APART_M = 4500.0
ZONES = 40
ON_A_LINK = 200
"""Most vehicles that one link carries; system ids go to 255."""
FIRST_PORT = 14_600
MOST_FLEET = 2000
DRAWS = 10_000


def fleet_document(vehicles: int, seed: int = 1, interval_s: float = 4.0) -> Document:
    """A mission file, as read from YAML, with a number of vehicles. Raises InputError for a number out of range."""
    if not 2 <= vehicles <= MOST_FLEET or not interval_s > 0.0:
        words = f"2 to {MOST_FLEET} vehicles and an interval above 0 s are wanted, given {vehicles}, {interval_s:g}"
        raise InputError(words)
    rng = np.random.default_rng([seed, vehicles])
    depots = _apart(rng, math.ceil(vehicles / PADS**2), DEPOTS_APART_M)
    starts = _pads(depots, vehicles)
    zones, radius_m = rng.uniform(-HALF_M, HALF_M, (ZONES, 2)), rng.uniform(100.0, 500.0, ZONES)
    high = rng.random(ZONES) < 0.5
    clear = np.linalg.norm(zones[:, None] - depots[None], axis=2).min(axis=1) > PADS * PAD_M + radius_m
    goals = _goals(rng, depots, starts, zones[clear], radius_m[clear] + APART_M)
    return {
        "version": 1,
        "name": f"{vehicles} from {len(depots)} depots",
        "terrain": {"dem": "sample:jacksboro", "vertical_datum": "EGM96"},
        "limits": {
            "min_agl_m": 40, "horizontal_clearance_m": 20, "track_error_m": 3, "altitude_error_m": 5,
            "max_climb_deg": 25,
        },
        "no_fly": [
            {
                "name": f"zone {k + 1}", "center": _degrees(zones[k]), "radius_m": round(float(radius_m[k])),
                **({} if high[k] else {"ceiling_agl_m": 150}),
            }
            for k in np.flatnonzero(clear).tolist()
        ],
        "vehicles": [
            {
                "name": f"uav{k + 1:04d}", "sysid": k % ON_A_LINK + 1, "autopilot": "arducopter",
                "start": _degrees(starts[k]), "goal": _degrees(goals[k]), "speed_m_s": [3, 10],
                "energy": {"battery_j": BATTERY_J, "reserve": RESERVE},
                "link": f"udpout:127.0.0.1:{FIRST_PORT + k // ON_A_LINK}",
            }
            for k in range(vehicles)
        ],
        "arrival": {"mode": "sequence", "interval_s": interval_s, "separation_m": 30},
        "planner": {"name": "optimal", "objective": "length", "seed": 1, "gap_percent": 2},
    }  # fmt: skip


def _apart(rng: np.random.Generator, count: int, apart_m: float) -> Floats:
    """Middles of depots (count, 2), metres east and north; the distance shrinks where they find no room."""
    found: list[Floats] = []
    for draw in range(DRAWS):
        one = rng.uniform(-HALF_M, HALF_M, 2)
        if all(np.hypot(*(one - other)) >= apart_m * (1.0 - draw / DRAWS) for other in found):
            found.append(one)
        if len(found) == count:
            return np.array(found)
    raise InputError(f"no room for {count} depots")


def _pads(depots: Floats, count: int) -> Floats:
    """Starts (count, 2): vehicle k stands at depot k modulo their number."""
    turn, depot = np.divmod(np.arange(count), len(depots))
    row, column = np.divmod(turn, PADS)
    return np.asarray(depots[depot] + PAD_M * (np.column_stack([column, row]) - (PADS - 1) / 2.0))


def _goals(rng: np.random.Generator, depots: Floats, starts: Floats, zones: Floats, radius_m: Floats) -> Floats:
    """A goal (count, 2) for each start, outside circles around ``zones`` (n, 2)."""
    taken = np.vstack([starts, np.full_like(starts, math.inf)])
    count = len(starts)
    for k in range(count):
        middle = depots[k % len(depots)]
        for _ in range(DRAWS):
            far_m = math.sqrt(rng.uniform(NEAREST_M**2, FARTHEST_M**2))
            to = rng.uniform(0.0, 2.0 * math.pi)
            goal = middle + far_m * np.array([math.cos(to), math.sin(to)])
            outside = (np.hypot(*(zones - goal).T) >= radius_m).all()
            if outside and np.abs(goal).max() <= REACH_M and np.hypot(*(taken - goal).T).min() >= APART_M:
                taken[count + k] = goal
                break
        else:
            raise InputError(f"no room for the goal of vehicle {k + 1}")
    return np.asarray(taken[count:])


def _degrees(place: Floats) -> list[float]:
    lat, lon = MIDDLE_DEG
    east_m, north_m = (float(x) for x in place)
    per_east = METRES_PER_DEGREE * math.cos(math.radians(lat))
    return [round(lat + north_m / METRES_PER_DEGREE, 6), round(lon + east_m / per_east, 6)]
