"""Brute force of returns that join a mission: ArduPilot's choice item by item, and dense samples along the way there.

`choice` is written from the behaviour of `AP_Mission::jump_to_closest_mission_leg`; it shares no code with the check.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.mavlink.mission.commands import DO_LAND_START, DO_RETURN_PATH_START, LAND, TAKEOFF, WAYPOINT
from gcsplan.mavlink.mission.mission import NO_POSITION, RELATIVE, MissionItem
from gcsplan.vehicle import Autopilot
from tests.oracles.returns import Case, random_case

LOCATED = (WAYPOINT, LAND, TAKEOFF, DO_LAND_START, DO_RETURN_PATH_START)


def with_path(rng: np.random.Generator, case: Case) -> Case:
    """The same world, and a mission that ends with a landing or a hold, behind which one or two return paths stand."""
    items = list(case.mission.items)
    ways = [i for i in items if i.command == WAYPOINT]
    if items[-1].command != LAND:
        items.append(replace(ways[-1], command=LAND, z=0.0))
    home = case.mission.home
    for _ in range(int(rng.integers(1, 3))):
        items.append(MissionItem(DO_RETURN_PATH_START, NO_POSITION))
        back = list(reversed(ways))
        if rng.random() < 0.5:
            back = [replace(i, z=i.z + float(rng.uniform(0.0, 60.0))) for i in back]
        if rng.random() < 0.3:
            rng.shuffle(back)
        items += back[int(rng.integers(0, len(back))) :]
        if rng.random() < 0.5:
            items.append(
                replace(items[-1], x=home.lat_e7, y=home.lon_e7, z=float(rng.uniform(5.0, 90.0)), command=WAYPOINT)
            )
        items.append(replace(items[-1], command=LAND, x=home.lat_e7, y=home.lon_e7, z=0.0, frame=RELATIVE))
    return replace(case, mission=replace(case.mission, items=tuple(items)))


def random_path_case(rng: np.random.Generator) -> Case | None:
    """A small rough world with a copter's mission that holds return paths."""
    case = random_case(rng, Autopilot.ARDUCOPTER)
    return None if case is None else with_path(rng, case)


def choice(case: Case, at: Floats) -> tuple[int, Floats]:
    """The wire item that a return from ``at`` (east, north, AMSL) flies to first, and its place."""
    items, base = case.mission.items, case.corners[0][2]
    places = []
    for i in items:
        known = i.command in LOCATED and (i.x or i.y)
        en = case.world.frame.to_plane(i.lat_deg, i.lon_deg)
        up = math.trunc(float(np.float32(i.z) * np.float32(100.0))) / 100.0
        places.append(np.array([float(en[0]), float(en[1]), base + up]) if known else None)
    best, chosen = math.inf, -1
    for k, item in enumerate(items):
        if item.command != DO_RETURN_PATH_START:
            continue
        before, nearest, mine = None, -1.0, -1
        for j in range(k, len(items)):
            place = places[j]
            if place is not None:
                if before is None:
                    nearest, mine, before = float(np.linalg.norm(place - at)), j, place
                elif (place != before).any():
                    way = place - before
                    part = min(max(float((at - before) @ way / (way @ way)), 0.0), 1.0)
                    away = float(np.linalg.norm(before + part * way - at))
                    before = place
                    if away < nearest:
                        nearest, mine = away, j
            if items[j].command in (LAND, DO_LAND_START):
                break
        if mine >= 0 and nearest <= best:
            best, chosen = nearest, mine
    there = places[chosen]
    assert there is not None
    return case.mission.first_seq + chosen, there


def join_breach(case: Case, at: Floats, stop: Floats, wrong: Floats, *, legal: bool, column: bool) -> str:
    """The limits broken by the return from ``at`` that stops at ``stop`` and takes itself to be off by ``wrong``; or
    empty.

    ``column``: it begins in the take-off, whose ground does not count for a return that ends above it.
    """
    limits, oracle = case.vehicle.limits, case.oracle
    if not legal:
        limits = replace(limits, min_agl_m=0.0, max_agl_m=None, max_amsl_m=None, horizontal_clearance_m=0.0)
    seq, there = choice(case, stop + wrong)
    ways = [(at, stop)] if (stop != at).any() and not legal else []
    if case.mission.items[seq - case.mission.first_seq].command == LAND:
        there = np.array([*there[:2], stop[2]])
        if math.hypot(*(there - stop)[:2]) > max(5.0, limits.track_error_m) + 1.0:
            ways.append((stop, there))
    else:
        ways.append((stop, there))
    for start, end in ways:
        for k in range(len(oracle.zones)):
            if oracle.zone_breach(
                k, start, end, limits.track_error_m, limits.altitude_error_m, limits, spokes=10, rings=2
            ):
                return f"zone {k} on the way to item {seq}"
        above = column and math.hypot(*(end - start)[:2]) <= max(5.0, limits.track_error_m)
        depths = oracle.depths(start, end, above, limits.track_error_m, limits.altitude_error_m, limits)
        depths["coverage"] -= 0.5
        bad = [name for name, depth in depths.items() if depth > 1e-6 and name not in ("climb", "descent")]
        if bad:
            return f"{bad[0]} by {depths[bad[0]]:.3f} on the way to item {seq}"
    return ""
