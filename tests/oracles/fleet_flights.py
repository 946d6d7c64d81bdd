"""Fleets in one wind, flown in small steps of time from the items of their missions, their endings included.

It shares no code with the package: places are read from the items' degrees, speeds from DO_CHANGE_SPEED, and each
vehicle flies straight from item to item, with the wind triangle or its largest lean (`docs/concepts/wind.md`), then
lands, circles, or returns at the speed of its own return. Corners are not rounded and arcs not flown: a path of
chords is a little longer than its arcs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tests.oracles.wind import Share, Winds, true_air_m_s

WAYPOINT, LOITER_UNLIM, LOITER_TIME, RTL, LAND, TAKEOFF, DELAY, CHANGE_SPEED = 16, 17, 19, 20, 21, 22, 93, 178
SEMI_MAJOR_M, ECCENTRICITY2 = 6378137.0, 0.00669437999014
STEP_S, AROUND_S = 0.25, 300.0
"""Steps of time, and how long a vehicle that circles for good stays in sight."""
Place = tuple[float, float, float]


@dataclass(frozen=True)
class Item:
    """An item as it is on the wire; ``up_m`` above home."""

    command: int
    params: tuple[float, float, float, float]
    lat_deg: float
    lon_deg: float
    up_m: float


@dataclass(frozen=True)
class Ship:
    """A vehicle: ``air_m_s`` is a copter's largest airspeed, None a wing; ``home_deg``: latitude and longitude.

    ``return_up_m``: above home; ``waits_s``: over home, before it descends. ``circle_m``: of a circle over home.
    """

    name: str
    items: Sequence[Item]
    home_deg: tuple[float, float]
    departs_s: float
    accel_m_s2: float
    air_m_s: float | None
    return_m_s: float
    return_up_m: float
    waits_s: float
    circle_m: float
    climb_m_s: float
    descent_m_s: float


@dataclass(frozen=True)
class Track:
    """Places (N, 3) every `STEP_S` from ``begins_s``; from ``circles_s`` on it is somewhere within ``reach_m``."""

    name: str
    begins_s: float
    places: np.ndarray
    arrive_s: float
    circles_s: float
    reach_m: float


@dataclass(frozen=True)
class _Way:
    """A straight way: its end, the commanded speed, whether it ends at a standstill, and whether it is a column."""

    to: Place
    speed_m_s: float
    stops: bool = False
    waits_s: float = 0.0


def metres(lat_deg: float, lon_deg: float, origin: tuple[float, float]) -> tuple[float, float]:
    """East and north on the ellipsoid's tangent plane, by its radii of curvature halfway."""
    middle = math.radians(0.5 * (lat_deg + origin[0]))
    w2 = 1.0 - ECCENTRICITY2 * math.sin(middle) ** 2
    north_m = SEMI_MAJOR_M * (1.0 - ECCENTRICITY2) / w2**1.5
    east_m = SEMI_MAJOR_M / math.sqrt(w2) * math.cos(middle)
    return math.radians(lon_deg - origin[1]) * east_m, math.radians(lat_deg - origin[0]) * north_m


def _ways(ship: Ship, origin: tuple[float, float]) -> tuple[Place, list[_Way], int, float]:
    """Where it begins, its ways, the number of those to the goal, and the radius of a circle without end, or 0."""
    home = (*metres(*ship.home_deg, origin), 0.0)
    ways: list[_Way] = []
    speed, goal, circle_m = math.inf, 0, 0.0
    speeds = [item.params[1] for item in ship.items if item.command == CHANGE_SPEED]
    at: Place = home
    for item in ship.items:
        there = (*metres(item.lat_deg, item.lon_deg, origin), item.up_m)
        if item.command == CHANGE_SPEED:
            speed = item.params[1]
        elif item.command == TAKEOFF:
            speed = speeds[0] if ship.air_m_s is not None else ship.return_m_s  # a wing climbs out at its fastest
            up = there if ship.air_m_s is None else (*home[:2], item.up_m)
            ways.append(_Way(up, speed, stops=ship.air_m_s is not None))
            at, goal = up, goal + 1
        elif item.command in (LOITER_TIME, DELAY):
            ways[-1] = replace(ways[-1], stops=True, waits_s=item.params[0])
        elif item.command in (WAYPOINT, LOITER_UNLIM):
            ways.append(_Way(there, speed))
            at, goal = there, goal + 1
            circle_m = abs(item.params[2]) if item.command == LOITER_UNLIM else 0.0
        elif item.command == LAND:
            down = there if ship.air_m_s is None else (*at[:2], item.up_m)
            ways.append(_Way(down, speed, stops=ship.air_m_s is not None))
        elif item.command == RTL:
            up_m = max(ship.return_up_m, at[2]) if ship.air_m_s is not None else ship.return_up_m
            if ship.air_m_s is None:
                ways.append(_Way((*home[:2], up_m), ship.return_m_s))
                circle_m = ship.circle_m
            else:
                ways.append(_Way((*at[:2], up_m), speed, stops=True))
                ways.append(_Way((*home[:2], up_m), ship.return_m_s, stops=True, waits_s=ship.waits_s))
                ways.append(_Way(home, speed, stops=True))
    if ship.air_m_s is not None:
        ways[goal - 1] = replace(ways[goal - 1], stops=True)
    return home, ways, goal, circle_m


def flown(ship: Ship, winds: Winds, share_of: Callable[[int], Share], origin: tuple[float, float]) -> Track:
    """A flight in the wind whose share on its way k is ``share_of(k)``; flat ground at home's altitude, 0 AMSL."""
    home, ways, goal, circle_m = _ways(ship, origin)
    left_m = [0.0] * len(ways)  # from the end of each way to the next standstill
    starts = [home, *(way.to for way in ways)]
    for k in range(len(ways) - 2, -1, -1):
        flat_m = math.dist(starts[k + 1][:2], ways[k + 1].to[:2])
        left_m[k] = 0.0 if ways[k].stops else left_m[k + 1] + flat_m
    at, clock, v, places, due_s, arrive_s = home, ship.departs_s, 0.0, [home], ship.departs_s + STEP_S, math.inf

    def go(to: Place, seconds: float) -> None:
        """Move evenly, and note where it is at each step of time."""
        nonlocal at, clock, due_s
        while due_s <= clock + seconds:
            part = (due_s - clock) / seconds
            places.append(tuple(a + part * (b - a) for a, b in zip(at, to, strict=True)))  # type: ignore[arg-type]
            due_s += STEP_S
        at, clock = to, clock + seconds

    for k, way in enumerate(ways):
        run_m, rise_m = math.dist(at[:2], way.to[:2]), way.to[2] - at[2]
        if run_m < 0.05:
            rate = ship.climb_m_s if rise_m > 0.0 else ship.descent_m_s
            if ship.air_m_s is not None and abs(rise_m) > 0.0:
                go(way.to, abs(rise_m) / rate)
            v = 0.0 if ship.air_m_s is not None else v
        else:
            begun, done, unit = at, 0.0, ((way.to[0] - at[0]) / run_m, (way.to[1] - at[1]) / run_m)
            while run_m - done > 1e-6:
                up_m = begun[2] + done / run_m * rise_m
                wind = winds.at(share_of(k), up_m, up_m, clock)
                along, across = (
                    wind[0] * unit[0] + wind[1] * unit[1],
                    wind[1] * unit[0] - wind[0] * unit[1],
                )
                most = _ground_m_s(ship, way.speed_m_s, rise_m / run_m, up_m, along, across)
                step_s = STEP_S / 5.0
                if ship.air_m_s is None:
                    v, step_s = most, STEP_S
                else:
                    rest_m = run_m - done + left_m[k]
                    brakes = math.sqrt(max(2.0 * ship.accel_m_s2 * rest_m, 1e-4))
                    gain = ship.accel_m_s2 * step_s
                    v = max(min(most, brakes, v + gain), v - gain, 0.05)
                    if v == most:
                        step_s = min(STEP_S, max(step_s, (rest_m - v * v / (2.0 * ship.accel_m_s2)) / v))
                step_s = min(step_s, (run_m - done) / v)
                done += v * step_s
                part = min(done / run_m, 1.0)
                go(
                    (begun[0] + part * run_m * unit[0], begun[1] + part * run_m * unit[1], begun[2] + part * rise_m),
                    step_s,
                )
            at = way.to
            v = 0.0 if way.stops else v
        if way.waits_s:
            go(at, way.waits_s)
        if k == goal - 1:
            arrive_s = clock
    circles_s = math.inf
    if circle_m:
        circles_s = clock
        go(at, AROUND_S)
    return Track(ship.name, ship.departs_s, np.array(places), arrive_s, circles_s, circle_m)


def _ground_m_s(ship: Ship, speed_m_s: float, slope: float, up_m: float, along: float, across: float) -> float:
    """The speed over ground along a way."""
    if ship.air_m_s is not None:
        rate = ship.climb_m_s if slope > 0.0 else ship.descent_m_s
        by_rate = rate / abs(slope) if abs(slope) > 1e-9 else math.inf
        return min(speed_m_s, along + math.sqrt(max(ship.air_m_s**2 - across**2, 0.0)), by_rate)
    air2, slant2 = true_air_m_s(speed_m_s, up_m) ** 2, 1.0 + slope**2
    return (along + math.sqrt(along**2 - slant2 * (along**2 + across**2 - air2))) / slant2


def least_m(a: Track, b: Track) -> tuple[float, float]:
    """The least distance of two while both fly, m; and the same with circles at their nearest points."""
    times = np.arange(
        max(a.begins_s, b.begins_s), min(t.begins_s + (len(t.places) - 1) * STEP_S for t in (a, b)), STEP_S
    )
    if not len(times):
        return math.inf, math.inf
    at = [
        np.column_stack([
            np.interp(times, t.begins_s + STEP_S * np.arange(len(t.places)), t.places[:, k]) for k in range(3)
        ])
        for t in (a, b)
    ]  # fmt: skip
    flat, rise = np.hypot(*(at[0] - at[1])[:, :2].T), (at[0] - at[1])[:, 2]
    reach = sum(np.where(times >= t.circles_s, t.reach_m, 0.0) for t in (a, b))
    return float(np.hypot(flat, rise).min()), float(np.hypot(np.maximum(flat - reach, 0.0), rise).min())
