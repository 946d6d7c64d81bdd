"""The problem set of ``gcsplan bench terrain``: real ground, made from a seed alone, the same on every machine.

Kinds:

- ``main``: 20 pairs 5 to 25 km apart, each with 0, 10 and 40 zones (the ten are the first of the forty); at least 60 m
  above ground, a max AMSL that blocks the straight line, climb and descent of 10 to 15 degrees;
- ``energy``: all of ``main``, in joules;
- ``time``: all of ``main``, in seconds, at 15 m/s, with climbs of 2.5 and descents of 1.5 m/s;
- ``band``: 20 pairs, 60 to 120 m above ground, climb and descent of 10 degrees and again of 15, no max AMSL, no zones:
  it is not known beforehand whether a path exists;
- ``large``: five pairs of ``main`` with ten zones over the whole sample, refined ten times by cubic splines (3431 ×
  4021 nodes);
- ``many``: a pair of ``main`` with a thousand small zones;
- ``turn``: all of ``main`` with a turn radius of 100 m, and again of 200 m;
- ``everyday``: missions of ``gcsplan bench everyday`` without vias, half of them with clearance and errors;
- ``ceiling``: 100 missions below a ceiling above ground (`under_ceiling`), with objectives and errors of their own;
- ``room``: 20 pairs as in ``main``, each with 0, 10 and 20 zones, whose ceilings and zones leave a wide corridor
  (`draw_with_room`), for planners that search by samples; always with the clearance and errors of a real mission.

Starts and goals are at the lowest legal altitude, rounded up to a centimetre. Clearance and errors are zero, so that
other planners need only a yes or no; ``errors`` sets a real mission's values. Everyday missions have their own.

A mission has room if a *corridor* joins its ends: a strip that advances along the straight track, turns at most 45° off
it and stays within half its length to either side, so that a point on each plane across the track can follow it. It is
`CORRIDOR_WIDE_M` wide, `CORRIDOR_NARROW_M` within `CORRIDOR_NEAR_M` of an end. All over its width, the lowest legal
altitude is below the ceiling and below a cone over either end that rises with `CORRIDOR_CONE` of the climb limit, and
no zone reaches it, whatever the zone's floor and ceiling. The ceiling is drawn just above the lowest that leaves a
corridor, and blocks the straight track.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.ndimage import maximum_filter

from gcsplan.arrays import Bools, Floats
from gcsplan.bench.everyday import missions as everyday_missions
from gcsplan.bench.everyday import run as everyday
from gcsplan.bench.terrain import under_ceiling
from gcsplan.bench.terrain.pairs import (
    ABOVE_JOIN_M,
    MOST_ZONE_SETS,
    PAIR_MIN_AGL_M,
    PAIRS,
    SMALL_RADIUS_M,
    FloorCells,
    TerrainPair,
    draw_above,
    draw_pair,
    draw_zones,
    lowest_ceiling,
    place,
    problem_of,
    sample,
    stratum,
)
from gcsplan.errors import InputError
from gcsplan.planners.problem import Objective, Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Polygon, Zone

MAIN_ZONES, ROOM_ZONES = (0, 10, 40), (0, 10, 20)
BAND_M, BAND_DEG = (60.0, 120.0), (10.0, 15.0)
LARGE_FINER, LARGE_PAIRS = 10, (1, 5, 9, 13, 17)
MANY_PAIR, MANY_ZONES = 10, 1000
TURN_RADII_M = (100.0, 200.0)

NO_ERRORS = Limits(min_agl_m=PAIR_MIN_AGL_M)
REAL_ERRORS = Limits(min_agl_m=PAIR_MIN_AGL_M, horizontal_clearance_m=30.0, track_error_m=3.0, altitude_error_m=5.0)


@dataclass(frozen=True, eq=False, slots=True)
class NamedProblem:
    """A problem with its name (kind, seed, pair, what varies), its kind, and the group for the report.

    ``redraws`` are the pairs and the sets of zones that were drawn in vain before it.
    """

    name: str
    problem: Problem
    kind: str
    group: str
    redraws: tuple[int, int] = (0, 0)
    seed: int = 1
    errors: bool = False


def problems(
    kind: str, seed: int = 1, *, objective: Objective = "length", errors: bool = False, count: int | None = None
) -> list[NamedProblem]:
    """The problems of one kind, or the first ``count`` of each group. Raises InputError for an unknown kind.

    ``errors``: with the clearance and errors of a real mission; ceilings and zones are then drawn for them.
    """
    make = _PROBLEM_MAKERS.get(kind)
    if make is None:
        raise InputError(f"the kinds of problems are {', '.join(_PROBLEM_MAKERS)}, given {kind!r}")
    found = []
    seen: dict[str, int] = {}
    for one in make(seed, REAL_ERRORS if errors else NO_ERRORS, count):
        seen[one.group] = seen.get(one.group, 0) + 1
        if count is None or seen[one.group] <= count:
            if kind != "ceiling":
                goal: Objective = kind if kind in ("energy", "time") else objective  # type: ignore[assignment]
                one = replace(one, problem=replace(one.problem, objective=goal))
            found.append(replace(one, seed=seed, errors=errors or kind == "ceiling"))
    return found


def key_of(problem: Problem) -> str:
    """A hash of everything in ``problem`` that affects its answer, the same for equal problems on every machine.

    Metres are rounded to a millimetre in it, because libraries differ in the last digits of a projection.
    """
    surface, p = problem.airspace.surface, problem
    zones = [
        (f"{z.shape.east_m:.3f} {z.shape.north_m:.3f} {z.shape.radius_m:.3f}", str(z.floor), str(z.ceiling))
        for z in p.airspace.zones
        if isinstance(z.shape, Circle)
    ]
    zones += [
        (" ".join(f"{x:.3f}" for x in z.shape.vertices.ravel()), str(z.floor), str(z.ceiling))
        for z in p.airspace.zones
        if isinstance(z.shape, Polygon)
    ]
    rows, cols = surface.ground_m.shape
    corners = surface.grid.to_plane([0.0, cols - 1.0], [0.0, rows - 1.0])
    inputs = (
        [f"{x:.3f}" for x in (*p.start, *p.goal, *corners.ravel().tolist())], p.via, zones, p.limits,
        p.objective, p.vertical_j_per_m, p.horizontal_j_per_m, p.turn_radius_m, round(p.airspace.scale, 9),
        *((p.speed_m_s, p.climb_m_s, p.descent_m_s) if p.objective == "time" else ()),
    )  # fmt: skip
    digest = hashlib.sha256(repr(inputs).encode())
    digest.update(surface.ground_m.tobytes())
    if surface.top_m is not surface.ground_m:
        digest.update(surface.top_m.tobytes())
    return digest.hexdigest()[:20]


@cache
def pair_of(seed: int, number: int, limits: Limits, kind: str = "main") -> TerrainPair:
    """Pair ``number``; each has its own random numbers, so that none depends on how many are requested."""
    rng = np.random.default_rng([seed, number, {"main": 0, "band": 1, "room": 3}[kind]])
    if kind == "room":
        return draw_with_room(rng, number, limits, max(ROOM_ZONES))
    return draw_pair(rng, number, limits, max(MAIN_ZONES) if kind == "main" else 0, ceiling=kind == "main")


def _main(seed: int, limits: Limits, count: int | None) -> Iterator[NamedProblem]:
    for zones in MAIN_ZONES:
        for number in _spread(count):
            pair = pair_of(seed, number, limits)
            problem = problem_of(
                pair, Airspace(pair.surface, pair.zones[:zones], scale=pair.scale), _held(pair, limits)
            )
            yield NamedProblem(
                f"main {seed}/{number:02d}, {zones} zones", problem, "main", f"{zones} zones", pair.redraws
            )


def _main_for(objective: Objective) -> Callable[[int, Limits, int | None], Iterator[NamedProblem]]:
    """All of ``main`` with another objective, which `problems` sets."""

    def make(seed: int, limits: Limits, count: int | None) -> Iterator[NamedProblem]:
        for one in _main(seed, limits, count):
            name, group = one.name.replace("main", objective), f"{one.group}, {objective}"
            yield replace(one, name=name, kind=objective, group=group)

    return make


def _band(seed: int, limits: Limits, count: int | None) -> Iterator[NamedProblem]:
    for degrees in BAND_DEG:
        for number in _spread(count):
            pair = pair_of(seed, number, limits, "band")
            held = replace(
                limits, min_agl_m=BAND_M[0], max_agl_m=BAND_M[1], max_climb_deg=degrees, max_descent_deg=degrees
            )
            problem = problem_of(pair, Airspace(pair.surface, scale=pair.scale), held)
            name = f"band {seed}/{number:02d}, {degrees:g}°"
            yield NamedProblem(name, problem, "band", f"{BAND_M[0]:g}–{BAND_M[1]:g} m, {degrees:g}°", pair.redraws)


def _large(seed: int, limits: Limits, count: int | None) -> Iterator[NamedProblem]:
    for number in LARGE_PAIRS[:count]:
        pair = pair_of(seed, number, limits)
        far = (-1e5, -1e5, 1e5, 1e5)  # the whole sample, wherever the pair is on it
        surface = _refined(sample().load(pair.frame, far))
        rows, cols = surface.ground_m.shape
        corners = surface.grid.to_plane([0, 0, cols - 1, cols - 1], [0, rows - 1, 0, rows - 1])
        scale = pair.frame.scale_at(float(np.hypot(*corners.T).max()))
        airspace = Airspace(surface, pair.zones[:10], scale=scale)
        held = _held(pair, limits)
        assert pair.ceiling_m is not None
        if not _joined(airspace, pair, limits, pair.ceiling_m):
            # Sometimes a spline rises above the saddles between the nodes of the DEM.
            join = FloorCells.of(airspace, limits).lowest_join(surface, pair.start, pair.goal)
            held = replace(held, max_amsl_m=math.floor(join + ABOVE_JOIN_M[0] + limits.altitude_error_m) + 0.5)
        name = f"large {seed}/{number:02d}, 10 zones"
        problem = problem_of(pair, airspace, held)
        # A new airspace, because the data derived for the old one takes hundreds of megabytes.
        problem = replace(problem, airspace=Airspace(surface, airspace.zones, scale=scale))
        yield NamedProblem(name, problem, "large", f"{rows} × {cols} nodes", pair.redraws)


def _many(seed: int, limits: Limits, count: int | None) -> Iterator[NamedProblem]:
    pair = pair_of(seed, MANY_PAIR, limits)
    rng = np.random.default_rng([seed, MANY_PAIR, 2])
    held = _held(pair, limits)
    assert pair.ceiling_m is not None
    for redraws in range(1000):
        zones = draw_zones(rng, pair, MANY_ZONES, SMALL_RADIUS_M)
        airspace = Airspace(pair.surface, zones, scale=pair.scale)
        if _joined(airspace, pair, limits, pair.ceiling_m):
            problem = problem_of(pair, airspace, held)
            name = f"many {seed}/{MANY_PAIR:02d}, {MANY_ZONES} zones"
            yield NamedProblem(name, problem, "many", f"{MANY_ZONES} zones", (pair.redraws[0], redraws))
            return
    raise InputError(f"no set of {MANY_ZONES} zones leaves a way for seed {seed}: give another seed")


def _turn(seed: int, limits: Limits, count: int | None) -> Iterator[NamedProblem]:
    for radius_m in TURN_RADII_M:
        for one in _main(seed, limits, count):
            problem = replace(one.problem, turn_radius_m=radius_m)
            name = f"{one.name.replace('main', 'turn')}, radius {radius_m:g} m"
            yield replace(
                one, name=name, problem=problem, kind="turn", group=f"{one.group}, turn radius {radius_m:g} m"
            )


def _everyday(seed: int, limits: Limits, count: int | None) -> Iterator[NamedProblem]:
    each = everyday.MISSIONS_OF_A_SEED // len(everyday_missions.EVERYDAY_KINDS) if count is None else count
    for number in range(each * len(everyday_missions.EVERYDAY_KINDS)):
        one = everyday_missions.draw(seed, number)
        problem = everyday.problem_of(one)
        if not problem.via:
            yield NamedProblem(f"everyday {one.name}, {one.kind}", problem, "everyday", one.kind, (0, one.redraws))


def _room(seed: int, limits: Limits, count: int | None) -> Iterator[NamedProblem]:
    for zones in ROOM_ZONES:
        for number in _spread(count):
            pair = pair_of(seed, number, REAL_ERRORS, "room")
            airspace = Airspace(pair.surface, pair.zones[:zones], scale=pair.scale)
            problem = problem_of(pair, airspace, _held(pair, REAL_ERRORS))
            name = f"room {seed}/{number:02d}, {zones} zones"
            yield NamedProblem(name, problem, "room", f"room, {zones} zones", pair.redraws)


def _ceiling(seed: int, limits: Limits, count: int | None) -> Iterator[NamedProblem]:
    del limits  # each mission has its own
    for number in range(under_ceiling.CEILING_MISSIONS):
        if count is not None and number >= 20 * count:  # each group is among twenty in a row
            return
        group, problem, redraws = under_ceiling.mission(seed, number)
        yield NamedProblem(f"ceiling {seed}/{number:02d}, {group}", problem, "ceiling", group, redraws)


_PROBLEM_MAKERS: dict[str, Callable[[int, Limits, int | None], Iterator[NamedProblem]]] = {
    "main": _main, "energy": _main_for("energy"), "band": _band, "large": _large, "many": _many, "turn": _turn,
    "everyday": _everyday, "ceiling": _ceiling, "room": _room, "time": _main_for("time"),
}  # fmt: skip
PROBLEM_KINDS = tuple(_PROBLEM_MAKERS)
MOUNTAINS = PROBLEM_KINDS[:-4]
"""The kinds over real mountains that are measured unless others are named."""


def _spread(count: int | None) -> list[int]:
    """The numbers of the pairs: all, or ``count`` of them from short to long."""
    if count is None or count >= PAIRS:
        return list(range(PAIRS))
    return [(2 * k + 1) * PAIRS // (2 * count) for k in range(count)]


def _held(pair: TerrainPair, limits: Limits) -> Limits:
    return replace(
        limits, max_amsl_m=pair.ceiling_m, max_climb_deg=pair.steepest_deg, max_descent_deg=pair.steepest_deg
    )


def _joined(airspace: Airspace, pair: TerrainPair, limits: Limits, ceiling_m: float) -> bool:
    """Whether start and goal are joined under the ceiling and among the zones of unlimited height."""
    cells = FloorCells.of(airspace, limits)
    free = cells.outside(airspace.zones, limits.horizontal_clearance_m + limits.track_error_m)
    free &= cells.floor_m <= ceiling_m - limits.altitude_error_m
    return cells.joined(airspace.surface, pair.start, pair.goal, free)


def _refined(surface: Surface) -> Surface:
    """The surface on a grid `LARGE_FINER` times finer: cubic splines through the nodes, rounded to the centimetre."""
    grid = surface.grid
    finer = GridMap(grid.coefficients * LARGE_FINER, grid.centre, grid.scale_m, grid.error_m)
    ground = _refined_ground(surface.ground_m.tobytes(), surface.ground_m.shape)
    return Surface(ground, ground, finer, {**surface.info, "resolution_m": round(92.0 / LARGE_FINER, 1)})


@cache
def _refined_ground(nodes: bytes, shape: tuple[int, int]) -> Floats:
    from scipy.ndimage import zoom

    ground = np.frombuffer(nodes).reshape(shape)
    size = [(n - 1) * LARGE_FINER + 1 for n in shape]
    return np.round(zoom(ground, [m / n for m, n in zip(size, shape, strict=True)], order=3), 2)


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
