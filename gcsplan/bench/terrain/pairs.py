"""Starts, goals, ceilings and zones over the sample DEM, drawn from a seed: the parts of the problems.

A pair is kept if a ceiling exists that blocks the straight line but leaves start and goal joined below it. Zones are
kept if the zones of unlimited height leave them joined too. Both are found by flooding the cells of the DEM from the
start; a cell is as high as its highest corner and blocked by a zone that touches it, so cells that count as joined are
joined. Whether the climb limit and the other zones leave a path is for the planners to find.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.bench.sample import SAMPLE_HALF_M, SAMPLE_MIDDLE_DEG, sample_spec
from gcsplan.mission_file.scene import make_box
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame, centre_of
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import NO_SIDES, Surface
from gcsplan.world.geometry.zones import Circle, Level, Zone
from gcsplan.world.terrain.terrain import Terrain, open_terrain

WAY_M = (5_000.0, 25_000.0)  # straight distance from start to goal: from the shortest to the longest stratum
PAIRS = 20
PAIR_MIN_AGL_M = 60.0
CLIMB_LIMITS_DEG = (10.0, 15.0)
ABOVE_JOIN_M = (5.0, 60.0)  # height of the ceiling above the lowest one that joins start and goal
RADIUS_M = (200.0, 1200.0)
SMALL_RADIUS_M = (30.0, 150.0)
CLEAR_OF_ENDS_M = 150.0  # between a zone and a start or goal, enough for clearance and errors
MOST_ZONE_SETS = 200  # drawn for one pair before the pair itself is drawn again


@dataclass(frozen=True, eq=False)
class TerrainPair:
    """A start and a goal, (east_m, north_m) in the plane of ``frame``, and the surface that a mission would load.

    ``ceiling_m`` is the max AMSL that blocks the straight line. ``steepest_deg`` is the climb and descent limit: they
    are equal, so that a leg is legal in both directions, which planners that grow trees from both ends assume.
    ``redraws`` counts the redraws of the pair and of its zones.
    """

    number: int
    frame: Frame
    start: tuple[float, float]
    goal: tuple[float, float]
    surface: Surface
    scale: float
    ceiling_m: float | None
    steepest_deg: float
    zones: tuple[Zone, ...]
    redraws: tuple[int, int]


@dataclass(frozen=True, eq=False)
class FloorCells:
    """The cells of a surface.

    ``floor_m`` (rows, cols) is the lowest altitude that is legal everywhere in the cell, NaN or inf if unknown;
    ``east_m``, ``north_m`` are the cells' middles; ``reach_m`` is the distance from the middle to the farthest corner.
    """

    floor_m: Floats
    east_m: Floats
    north_m: Floats
    reach_m: float

    @classmethod
    def of(cls, airspace: Airspace, limits: Limits) -> FloorCells:
        """The cells of the airspace's surface under ``limits``, without zones."""
        surface = airspace.surface
        rows, cols = surface.ground_m.shape
        if limits.horizontal_clearance_m > 0.0 or limits.track_error_m > 0.0:
            e, n = _nodes(surface, np.arange(cols, dtype=float), np.arange(rows, dtype=float))
            floor = np.where(np.isnan(surface.top_m), np.nan, airspace.floor_amsl(e, n, limits))
        else:
            floor = surface.top_m + (limits.min_agl_m + limits.altitude_error_m)
        highest = np.maximum(np.maximum(floor[1:, 1:], floor[1:, :-1]), np.maximum(floor[:-1, 1:], floor[:-1, :-1]))
        e, n = _nodes(surface, np.arange(cols - 1) + 0.5, np.arange(rows - 1) + 0.5)
        size = surface.grid.metres_per_cell(*surface.grid.centre)
        return cls(highest, e, n, 0.51 * float(np.hypot(*size)))

    def joined(self, surface: Surface, a: tuple[float, float], b: tuple[float, float], open_: Bools) -> bool:
        """Whether ``open_`` cells that share edges lead from the cell of ``a`` to the cell of ``b``."""
        from scipy.ndimage import label

        (c0, r0), (c1, r1) = (np.floor(surface.grid(*p)).astype(int) for p in (a, b))
        if not (open_[r0, c0] and open_[r1, c1]):
            return False
        piece = label(open_)[0]
        return bool(piece[r0, c0] == piece[r1, c1])

    def lowest_join(self, surface: Surface, a: tuple[float, float], b: tuple[float, float]) -> float:
        """The lowest altitude, to half a metre above, below which ``a`` and ``b`` are joined; inf if there is none."""
        return lowest_ceiling(self.floor_m, lambda ceiling_m: self.joined(surface, a, b, self.floor_m <= ceiling_m))

    def outside(self, zones: tuple[Zone, ...] | list[Zone], clearance_m: float = 0.0) -> Bools:
        """(rows, cols) the cells that no zone of unlimited height touches."""
        free = np.ones(self.floor_m.shape, np.bool_)
        for zone in zones:
            if zone.floor is None and zone.ceiling is None and isinstance(zone.shape, Circle):
                c, reach = zone.shape, zone.shape.radius_m + clearance_m + self.reach_m
                free &= (self.east_m - c.east_m) ** 2 + (self.north_m - c.north_m) ** 2 > reach * reach
        return free


def lowest_ceiling(floors_m: Floats, joined: Callable[[float], bool]) -> float:
    """The lowest ceiling, to half a metre above, under which ends are ``joined``; inf if they are under none.

    ``floors_m`` are the altitudes that matter; near the map's border nothing is legal, and they are NaN or inf.
    """
    known = floors_m[np.isfinite(floors_m)]
    low, high = float(known.min()), float(known.max())
    if not joined(high):
        return math.inf
    while high - low > 0.5:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if joined(middle) else (middle, high)
    return high


@cache
def sample() -> Terrain:
    """The sample DEM, opened as for a mission file that names it."""
    return open_terrain(sample_spec(), where="the benchmark's terrain")


def draw_pair(rng: np.random.Generator, number: int, limits: Limits, zones: int, *, ceiling: bool) -> TerrainPair:
    """Pair ``number`` of `PAIRS`, with its ceiling (if ``ceiling``) and its zones; ``limits`` have no ceiling."""
    pairs = sets = 0
    way, steepest_deg = stratum(rng, number)
    while True:
        pair = place(rng, number, way, steepest_deg)
        airspace = Airspace(pair.surface, scale=pair.scale)
        cells = FloorCells.of(airspace, limits)
        top = draw_ceiling(rng, pair, cells, limits) if ceiling else None
        if top is not None or not ceiling:
            below = cells.floor_m <= (1e9 if top is None else top - limits.altitude_error_m)
            found, tried = draw_joined_zones(rng, pair, cells, below, limits, zones)
            sets += tried
            if found is not None:
                return replace(pair, ceiling_m=top, zones=found, redraws=(pairs, sets))
        pairs += 1


def draw_joined_zones(
    rng: np.random.Generator, pair: TerrainPair, cells: FloorCells, below: Bools, limits: Limits, count: int
) -> tuple[tuple[Zone, ...] | None, int]:
    """Zones that leave the ends joined through the cells ``below``, and how many sets were drawn in vain before; None
    after `MOST_ZONE_SETS`."""
    reach_m = limits.horizontal_clearance_m + limits.track_error_m
    for tried in range(MOST_ZONE_SETS):
        found = draw_zones(rng, pair, count)
        if cells.joined(pair.surface, pair.start, pair.goal, below & cells.outside(found, reach_m)):
            return tuple(found), tried
    return None, MOST_ZONE_SETS


def problem_of(pair: TerrainPair, airspace: Airspace, limits: Limits) -> Problem:
    """The problem between a pair's ends at their lowest legal altitudes, rounded up to a centimetre."""
    (e0, n0), (e1, n1) = pair.start, pair.goal
    floors = airspace.floor_amsl(np.array([e0, e1]), np.array([n0, n1]), limits)
    z0, z1 = (math.ceil(100.0 * z - 1e-4) / 100.0 for z in floors.tolist())
    return Problem(airspace, limits, (e0, n0, z0), (e1, n1, z1))


def stratum(rng: np.random.Generator, number: int) -> tuple[float, float]:
    """The straight distance of pair ``number``, m, in its stratum of `WAY_M`, and its climb limit, degrees."""
    step = (WAY_M[1] - WAY_M[0]) / PAIRS
    way = WAY_M[0] + (number + rng.uniform()) * step
    return way, round(float(rng.uniform(*CLIMB_LIMITS_DEG)), 1)


def draw_ceiling(rng: np.random.Generator, pair: TerrainPair, cells: FloorCells, limits: Limits) -> float | None:
    """`draw_above` the lowest altitude that joins start and goal."""
    return draw_above(rng, pair, cells.lowest_join(pair.surface, pair.start, pair.goal), limits)


def draw_above(rng: np.random.Generator, pair: TerrainPair, lowest_m: float, limits: Limits) -> float | None:
    """A max AMSL at x.5 m, some metres (`ABOVE_JOIN_M`) above ``lowest_m`` and below the straight line's highest floor.

    The half metre keeps it off all sums of whole metres, the heights of this DEM. None if there is none.
    """
    least = lowest_m + ABOVE_JOIN_M[0]
    t = np.linspace(0.0, 1.0, 1 + math.ceil(math.dist(pair.start, pair.goal) / 5.0))
    e, n = (pair.start[i] + t * (pair.goal[i] - pair.start[i]) for i in (0, 1))
    needed = float(pair.surface.top_at(e, n).max()) + limits.min_agl_m + limits.altitude_error_m
    most = min(least - ABOVE_JOIN_M[0] + ABOVE_JOIN_M[1], needed - 1.0)
    if math.isinf(least) or not math.ceil(least - 0.5) + 0.5 <= most:
        return None
    choices = np.arange(math.ceil(least - 0.5) + 0.5, most + 1e-9)
    return float(rng.choice(choices)) + limits.altitude_error_m


def draw_zones(
    rng: np.random.Generator, pair: TerrainPair, count: int, radius_m: tuple[float, float] = RADIUS_M
) -> list[Zone]:
    """Discs around the line from start to goal, none over either; radii are spread evenly in their logarithm.

    In each four, two have unlimited height, one has a ceiling (to be flown over), and one a floor (to be flown under)
    and, in half of the cases, a ceiling too. Levels are above ground or, equally often, above mean sea level.
    """
    a, b = np.array(pair.start), np.array(pair.goal)
    way = float(math.dist(a, b))
    along, spare = (b - a) / way, max(2_000.0, 0.15 * way)
    across, aside = np.array([-along[1], along[0]]), max(3_000.0, 0.3 * way)
    zones: list[Zone] = []
    while len(zones) < count:
        kind = len(zones) % 4
        at = a + rng.uniform(-spare, way + spare) * along + rng.uniform(-aside, aside) * across
        east, north = (round(float(x), 1) for x in at)
        radius = round(float(np.exp(rng.uniform(*np.log(radius_m)))), 1)
        over, thick = (float(np.round(rng.uniform(*x))) for x in ((70.0, 200.0), (100.0, 300.0)))
        amsl, band = rng.integers(2, size=2)
        ground = float(pair.surface.ground_at(east, north))
        if min(math.dist(at, a), math.dist(at, b)) < radius + CLEAR_OF_ENDS_M or math.isnan(ground):
            continue
        base = math.floor(ground) + 0.5 if amsl else 0.0
        low, high = (Level(base + x, "amsl" if amsl else "agl") for x in (over, over + thick))
        floor = low if kind == 3 else None
        ceiling = low if kind == 2 else high if kind == 3 and band else None
        zones.append(Zone(f"zone {len(zones) + 1}", Circle(east, north, radius), floor, ceiling))
    return zones


def place(rng: np.random.Generator, number: int, way_m: float, steepest_deg: float) -> TerrainPair:
    """A pair without ceiling and zones, over the part of the sample that a mission between its points would load."""
    whole = Frame(*SAMPLE_MIDDLE_DEG)
    while True:
        a = rng.uniform(-1.0, 1.0, 2) * SAMPLE_HALF_M
        turn = rng.uniform(0.0, 2.0 * math.pi)
        b = a + way_m * np.array([math.cos(turn), math.sin(turn)])
        if (np.abs(b) <= SAMPLE_HALF_M).all():
            break
    # Rounded, so that every machine has the same numbers to the last digit.
    degrees = np.round(whole.to_degrees(*np.stack([a, b], axis=-1)), 5)
    frame = Frame(*centre_of(degrees[:, 0], degrees[:, 1]))
    (e0, n0), (e1, n1) = np.round(frame.to_plane(degrees[:, 0], degrees[:, 1]), 2).tolist()
    box = make_box([(e0, n0), (e1, n1)], [], local=False)
    scale = frame.scale_at(max(math.hypot(e, n) for e in (box[0], box[2]) for n in (box[1], box[3])))
    surface = replace(sample().load(frame, box), goes_on=NO_SIDES)  # the window is the whole world, for rivals too
    return TerrainPair(number, frame, (e0, n0), (e1, n1), surface, scale, None, steepest_deg, (), (0, 0))


def _nodes(surface: Surface, col: Floats, row: Floats) -> tuple[Floats, Floats]:
    """East and north of a lattice of grid points, interpolated between exact ones, to millimetres."""
    from scipy.interpolate import RectBivariateSpline

    rows, cols = surface.ground_m.shape
    c, r = np.linspace(0.0, cols - 1.0, 17), np.linspace(0.0, rows - 1.0, 17)
    exact = surface.grid.to_plane(*np.meshgrid(c, r))
    east, north = (np.asarray(RectBivariateSpline(r, c, exact[..., i])(row, col)) for i in (0, 1))
    return east, north
