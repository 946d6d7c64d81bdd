"""Missions with room, for planners that search by samples: a wide corridor leads from start to goal.

A mission has room if a *corridor* joins its ends: a strip that advances along the straight track, turns at most 45° off
it and stays within half its length to either side, so that a point on each plane across the track can follow it. It is
`CORRIDOR_WIDE_M` wide, `CORRIDOR_NARROW_M` within `CORRIDOR_NEAR_M` of an end. All over its width, the lowest legal
altitude is below the ceiling and below a cone over either end that rises with `CORRIDOR_CONE` of the climb limit, and
no zone reaches it, whatever the zone's floor and ceiling. The ceiling is drawn just above the lowest that leaves a
corridor, and blocks the straight track.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter

from gcsplan.arrays import Bools, Floats
from gcsplan.bench.terrain.pairs import (
    MOST_ZONE_SETS,
    TerrainPair,
    draw_above,
    draw_zones,
    lowest_ceiling,
    place,
    stratum,
)
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Zone

CORRIDOR_STEP_M = 50.0
CORRIDOR_WIDE_M, CORRIDOR_NARROW_M, CORRIDOR_NEAR_M = 600.0, 200.0, 1_000.0
CORRIDOR_ASIDE = 0.5
CORRIDOR_CONE = 0.7
MOST_PAIRS_WITHOUT_ROOM = 200


@dataclass(frozen=True, eq=False)
class Corridors:
    """A lattice along the straight track, (stations, sides), of the corridors between two ends.

    ``east_m``, ``north_m``: its places; ``needed_m``: the highest lowest-legal altitude within half a corridor's width
    (inf where no corridor passes); ``half_m`` (stations,): half a corridor's width.
    """

    east_m: Floats
    north_m: Floats
    needed_m: Floats
    half_m: Floats

    @classmethod
    def of(cls, pair: TerrainPair, airspace: Airspace, limits: Limits) -> Corridors:
        """The corridors of a pair; the airspace's zones do not count."""
        a, b = np.array(pair.start), np.array(pair.goal)
        way = float(math.dist(a, b))
        stations, sides = (
            math.ceil(way / CORRIDOR_STEP_M) + 1,
            2 * math.ceil(CORRIDOR_ASIDE * way / CORRIDOR_STEP_M) + 1,
        )
        along = (b - a) / way
        s = np.linspace(0.0, way, stations)
        aside = (np.arange(sides) - sides // 2) * CORRIDOR_STEP_M
        places = a + s[:, None, None] * along + aside[:, None] * np.array([-along[1], along[0]])
        floor = airspace.floor_amsl(places[..., 0], places[..., 1], limits)
        floor = np.where(np.isfinite(floor), floor, np.inf)
        ends_m = np.minimum(s, way - s)
        half = np.where(ends_m < CORRIDOR_NEAR_M, 0.5 * CORRIDOR_NARROW_M, 0.5 * CORRIDOR_WIDE_M)
        narrow, wide = (
            maximum_filter(floor, footprint=_disc(w / 2.0), mode="nearest")
            for w in (CORRIDOR_NARROW_M, CORRIDOR_WIDE_M)
        )
        needed = np.where((ends_m < CORRIDOR_NEAR_M)[:, None], narrow, wide)
        rise = CORRIDOR_CONE * math.tan(math.radians(pair.steepest_deg))
        for row, end in ((0, a), (-1, b)):
            far = np.hypot(places[..., 0] - end[0], places[..., 1] - end[1])
            cone = floor[row, sides // 2] + rise * far
            # Within half a width of the end, its own floor counts instead of the corridor's.
            beyond = (needed > cone) & (far > 0.5 * CORRIDOR_NARROW_M)
            needed = np.where(beyond, np.inf, needed)
            needed[row, sides // 2] = floor[row, sides // 2]
        return cls(places[..., 0], places[..., 1], needed, half)

    def open(self, ceiling_m: float, zones: tuple[Zone, ...] | list[Zone] = (), reach_m: float = 0.0) -> bool:
        """Whether a corridor below ``ceiling_m`` joins the ends, clear of ``zones`` by ``reach_m``."""
        free: Bools = self.needed_m <= ceiling_m
        for zone in zones:
            assert isinstance(zone.shape, Circle)
            c = zone.shape
            beside = np.hypot(self.east_m - c.east_m, self.north_m - c.north_m)
            free &= beside > c.radius_m + reach_m + self.half_m[:, None]
        middle = free.shape[1] // 2
        here = np.zeros(free.shape[1], np.bool_)
        here[middle] = free[0, middle]
        for row in free[1:]:
            spread = here.copy()
            spread[1:] |= here[:-1]
            spread[:-1] |= here[1:]
            here = spread & row
        return bool(here[middle])

    def lowest(self) -> float:
        """The lowest ceiling, to half a metre above, that leaves a corridor; inf if none does."""
        return lowest_ceiling(self.needed_m, self.open)


def draw_with_room(rng: np.random.Generator, number: int, limits: Limits, zones: int) -> TerrainPair:
    """Pair ``number`` with room, its ceiling, and its ``zones``; ``limits`` have no ceiling.

    Raises ValueError if `MOST_PAIRS_WITHOUT_ROOM` draws in a row had none."""
    sets = 0
    way_m, steepest_deg = stratum(rng, number)
    for pairs in range(MOST_PAIRS_WITHOUT_ROOM):
        pair = place(rng, number, way_m, steepest_deg)
        airspace = Airspace(pair.surface, scale=pair.scale)
        corridors = Corridors.of(pair, airspace, limits)
        ceiling_m = draw_above(rng, pair, corridors.lowest(), limits)
        if ceiling_m is None:
            continue
        reach = limits.horizontal_clearance_m + limits.track_error_m
        for _ in range(MOST_ZONE_SETS):
            found = draw_zones(rng, pair, zones)
            if corridors.open(ceiling_m - limits.altitude_error_m, found, reach):
                return replace(pair, ceiling_m=ceiling_m, zones=tuple(found), redraws=(pairs, sets))
            sets += 1
    raise ValueError(f"pair {number}: no pair of {MOST_PAIRS_WITHOUT_ROOM} has room for {zones} zones")


def _disc(radius_m: float) -> Bools:
    n = math.ceil(radius_m / CORRIDOR_STEP_M)
    i, j = np.meshgrid(np.arange(-n, n + 1), np.arange(-n, n + 1))
    return np.asarray(i * i + j * j <= (radius_m / CORRIDOR_STEP_M) ** 2 + 1e-9)
