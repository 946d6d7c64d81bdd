"""The exact check of legs: every violation along the whole of every leg, never by sampling.

The leg is tested in the DEM's own grid: its ends are mapped there, and it is cut into straight parts short enough that
the bow against the line straight in the plane stays within centimetres; that bow widens the leg. Legs, limits and zones
are in metres of the plane; `gcsplan.world.geodesy.frame` converts to and from degrees.

Exact are: the ground under the line, zones with levels above mean sea level, ceilings, angles. Conservative, by a few
centimetres at most, are: ground beside the line within its errors and clearance, and zones over ground. Touching a
limit is legal; a micrometre is float noise.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.native.signature import Held
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Polygon, Zone
from gcsplan.world.kernels.compiled import FOUND, ONE_SURFACE, SURFACE, WORK, ZONES
from gcsplan.world.kernels.entries import around, judge
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.neighbourhood import LineBatch, Neighbourhoods
from gcsplan.world.kernels.shared import (
    ANGLE_DEG,
    BAND_HIGH,
    BAND_LOW,
    BOW_M,
    CEILING,
    CEILING_AGL,
    CLIMB,
    COVERAGE,
    CUT,
    DESCENT,
    FLOOR,
    FLOOR_AGL,
    MAX_AGL,
    MAX_AMSL,
    MIN_AGL,
    TERRAIN,
    TOUCH_M,
    Demands,
)
from gcsplan.world.tube import ZONE_ROOM_M, Band, Reaches, Tube, make_tube
from gcsplan.world.zone_table import ZoneTable, deepest_in_circle, deepest_inside, over_both_grounds

__all__ = ["Airspace", "Band", "LegReport", "Legs", "Tube", "Violation", "ViolationKind"]


NEAR_M, NEAR_PART = 0.01, 0.01
"""The kernel finds the nearest place of a zone over ground to this many metres, or this part of the distance
(`sweep_zones.nearest_conflict`)."""

ViolationKind = Literal["min_agl", "max_agl", "max_amsl", "terrain_clearance", "zone", "climb", "descent", "coverage"]

ZONE = 7  # follows the kernel's kinds
_VIOLATION_KINDS: dict[int, ViolationKind] = {
    ZONE: "zone", MIN_AGL: "min_agl", TERRAIN: "terrain_clearance", MAX_AGL: "max_agl", MAX_AMSL: "max_amsl",
    COVERAGE: "coverage", CLIMB: "climb", DESCENT: "descent",
}  # fmt: skip

_NO_ZONES = (
    np.zeros((0, 4)), np.zeros((0, 7, 2)), np.zeros(0, np.intp), np.zeros((0, 2), np.intp), np.zeros((0, 2)),
)  # fmt: skip
_HELD_NOTHING = Held(FOUND, *_NO_ZONES)


@dataclass(frozen=True, eq=False)
class Legs:
    """N straight legs. ``start``, ``end``: (N, 3) east_m, north_m, amsl_m.

    ``column`` (N,): take-off and landing columns, exempt from min AGL, climb angle and terrain clearance, never from
    zones, their clearance, ceilings, or DEM coverage. ``track_error_m``, ``altitude_error_m`` (N,): the whole errors of
    each leg (the caller includes the limits' errors, bows and margins). Kept as read-only copies or views. Raises
    ValueError for other shapes, for numbers that are not finite, and for negative errors.
    """

    start: Floats
    end: Floats
    column: Bools
    track_error_m: Floats
    altitude_error_m: Floats

    def __post_init__(self) -> None:
        n = len(self.start)
        for name, shape, dtype in (
            ("start", (n, 3), np.float64), ("end", (n, 3), np.float64), ("column", (n,), np.bool_),
            ("track_error_m", (n,), np.float64), ("altitude_error_m", (n,), np.float64),
        ):  # fmt: skip
            a: NDArray[np.generic] = np.ascontiguousarray(getattr(self, name), dtype=dtype).view()
            if a.shape != shape:
                raise ValueError(f"{name} of {n} legs must have the shape {shape}, given {a.shape}")
            if dtype is np.float64 and not np.isfinite(a).all():
                raise ValueError(f"{name} of a leg must be finite")
            if name.endswith("error_m") and n and a.min() < 0.0:
                raise ValueError(f"{name} of a leg must be 0 or more, given {a.min():g}")
            a.setflags(write=False)
            object.__setattr__(self, name, a)

    @classmethod
    def of_path(cls, points: ArrayLike, limits: Limits) -> Legs:
        """The legs between neighbours of ``points`` (N + 1, 3), with the errors of ``limits``, no columns."""
        p = np.asarray(points, dtype=np.float64)
        return cls.between(p[:-1], p[1:], limits)

    @classmethod
    def between(cls, start: Floats, end: Floats, limits: Limits) -> Legs:
        """The legs from each of ``start`` (N, 3) to its ``end``, with the errors of ``limits``, no columns."""
        n = len(start)
        return cls(
            start, end, np.zeros(n, np.bool_), np.full(n, limits.track_error_m), np.full(n, limits.altitude_error_m)
        )

    def __len__(self) -> int:
        return len(self.start)


@dataclass(frozen=True, slots=True)
class Violation:
    """One limit broken on one leg, at its worst point.

    ``fraction`` in [0, 1] along the leg; ``value`` found, ``limit`` required, ``by`` the difference (> 0), in ``unit``
    (m or deg); ``zone`` the zone's index, or -1. Errors and clearances are included in ``value``:

    - min_agl, max_agl, max_amsl: the height that is left, or reached, at the worst point within the leg's errors;
    - terrain_clearance: lowest flight level over the highest ground within the clearance, against 0;
    - zone: horizontal distance from the zone's shape, negative inside, against clearance plus track error;
    - coverage: distance from unknown ground against the reach within which ground must be known;
    - climb, descent: degrees.
    """

    leg: int
    kind: ViolationKind
    fraction: float
    east_m: float
    north_m: float
    amsl_m: float
    value: float
    limit: float
    by: float
    unit: str = "m"
    zone: int = -1


@dataclass(frozen=True, eq=False)
class LegReport:
    """The results of the check; arrays are (N,) over the legs.

    ``min_agl_m``: lowest height above top (ground + obstacles) on the line itself, errors not subtracted (the
    violations subtract them); ``min_agl_at`` its fraction; ``max_agl_m`` highest above ground. NaN where the ground is
    unknown on the whole leg. ``climb_deg`` signed. ``zone_clearance_m``: horizontal distance, on the line itself, to
    the nearest zone whose height band the leg (widened by its altitude error) meets, ``inf`` if none, 0 inside;
    ``nearest_zone`` its index or -1. For a zone over ground the distance is a lower bound, made with the lowest and
    highest ground under the zone; if the leg keeps clear of the zone, it is never less than the required distance.
    """

    min_agl_m: Floats
    min_agl_at: Floats
    max_agl_m: Floats
    climb_deg: Floats
    zone_clearance_m: Floats
    nearest_zone: Indices
    violations: tuple[Violation, ...]


def _remade(surface: Surface, zones: Sequence[Zone], scale: float) -> Airspace:
    return Airspace(surface, zones, scale=scale)


class Airspace:
    """A surface and its zones, with the functions that judge legs.

    ``scale`` >= 1: largest scale of the plane over the mission; real metres times it are at most metres of the plane,
    so every horizontal clearance is multiplied by it. ``zones`` are those that were ``given``, with higher ceilings
    above ground where the ground has two heights (`over_both_grounds`), and ``zone_table`` is what the planners read of
    them. ``field``, ``surfaces`` and ``grounds`` are the surface as the kernels read it.
    """

    def __init__(self, surface: Surface, zones: Sequence[Zone] = (), *, scale: float = 1.0) -> None:
        if not 1.0 <= scale < 2.0:
            raise ValueError(f"scale must be 1 or a little more, given {scale:g}")
        self.surface = surface
        self.scale = scale
        self.given = tuple(zones)
        self.field = Field.of(surface.grid)
        self.zone_table = ZoneTable.of(over_both_grounds(zones, surface, self.field, scale), surface, self.field, scale)
        self.zones = self.zone_table.zones
        self._neighbourhoods = Neighbourhoods(surface.grid, self.field)
        ground, top = (np.ascontiguousarray(a, dtype=np.float64) for a in (surface.ground_m, surface.top_m))
        self._heights = ground, top
        self.surfaces = Held(SURFACE, self.field.packed, ground, top)
        self.grounds = Held(SURFACE, self.field.packed, ground, ground)
        self._tops, self._bare = (Held(ONE_SURFACE, self.field.packed, z) for z in (top, ground))
        self._held_zones = Held(ZONES, *self.zone_table.arrays)

    def __reduce__(self) -> tuple[Callable[..., Airspace], tuple[Surface, tuple[Zone, ...], float]]:
        return _remade, (self.surface, self.given, self.scale)

    def __repr__(self) -> str:
        return f"<Airspace: {self.surface!r}, {len(self.zones)} zones>"

    def examine(self, legs: Legs, limits: Limits) -> LegReport:
        """Every violation along the whole of every leg. ``limits``' own errors are not used: the legs carry them."""
        found, worst, nearest, hit, hit_at = self._examined(legs, limits)
        run, rise = np.hypot(*(legs.end - legs.start)[:, :2].T), legs.end[:, 2] - legs.start[:, 2]
        climb_deg = np.degrees(np.arctan2(rise, run))
        violations = self._violations(legs, limits, climb_deg, worst, hit, hit_at)
        return LegReport(found[:, 0], found[:, 1], found[:, 2], climb_deg, found[:, 3], nearest, violations)

    def deepest(self, legs: Legs, limits: Limits, kind: ViolationKind) -> float:
        """By how much the worst of ``legs`` breaks a limit of height, as in `examine`; 0 if none does."""
        return float(np.fmax.reduce(self._examined(legs, limits)[1][:, _KIND_NUMBERS[kind], 0], initial=0.0))

    def _examined(self, legs: Legs, limits: Limits) -> tuple[Floats, Floats, Indices, Indices, Floats]:
        """The kernel's findings: figures (N, 4), the worst of each kind (N, 7, 2), the nearest zone (N,), and the zones
        that are hit: leg and zone (H, 2), distance and fraction (H, 2)."""
        n = len(legs)
        ok, found = np.zeros(n, np.bool_), np.full((n, 4), np.nan)
        worst, nearest = np.full((n, 7, 2), np.nan), np.full(n, -1, np.intp)
        worst[:, :, 1] = 0.0
        room = n + 64
        while True:
            hit, hit_at = np.zeros((room, 2), np.intp), np.zeros((room, 2))
            hits = self._judge(legs, limits, True, ok, Held(FOUND, found, worst, nearest, hit, hit_at))
            if hits <= room:
                return found, worst, nearest, hit[:hits], hit_at[:hits]
            room = hits

    def clear(self, legs: Legs, limits: Limits) -> Bools:
        """(N,) True where `examine` would find no violation; faster."""
        return self.clear_counted(legs, limits)[0]

    def clear_counted(self, legs: Legs, limits: Limits) -> tuple[Bools, float]:
        """The result of `clear`, and the number of pieces into which ground beside the legs was cut: most of the work
        close to ground."""
        ok = np.zeros(len(legs), np.bool_)
        self._judge(legs, limits, False, ok, _HELD_NOTHING)
        return ok, work_arrays.cut

    def floor_amsl(self, east_m: ArrayLike, north_m: ArrayLike, limits: Limits) -> Floats:
        """Lowest legal altitude over points of the plane, for terrain; conservative; +inf where unknown.

        It includes min AGL, the clearance and the errors of ``limits``; it does not include zones.
        """
        reach = Reaches.of(limits, self.field, self.scale)
        floor = self._around(1.0, east_m, north_m, reach.near_m) + (limits.min_agl_m + reach.near_margin_m)
        if limits.horizontal_clearance_m > 0.0:
            floor = np.maximum(floor, self._around(1.0, east_m, north_m, reach.far_m) + reach.far_margin_m)
        floor += limits.altitude_error_m
        return np.where(np.isnan(floor), np.inf, floor)

    def ceiling_amsl(self, east_m: ArrayLike, north_m: ArrayLike, limits: Limits) -> Floats:
        """Highest legal altitude over points (max AGL, max AMSL; less the errors); conservative; -inf where unknown."""
        reach = Reaches.of(limits, self.field, self.scale)
        ground = -self._around(-1.0, east_m, north_m, reach.near_m) - reach.near_margin_m
        ceiling = ground + ((math.inf if limits.max_agl_m is None else limits.max_agl_m) - limits.altitude_error_m)
        if limits.max_amsl_m is not None:
            ceiling = np.minimum(ceiling, limits.max_amsl_m - limits.altitude_error_m)
        return np.where(np.isnan(ground), -np.inf, ceiling)

    def tube(self, track: ArrayLike, limits: Limits) -> Tube:
        """The tube over a track (N, 2) of points in the plane, errors of ``limits`` included."""
        points = np.array(track, dtype=np.float64, order="C")
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not np.isfinite(points).all():
            raise ValueError(f"a track is (N, 2) finite metres with N >= 2, given shape {points.shape}")

        lines = LineBatch(points[:-1], points[1:])

        def extrema(of_top: bool, reach_m: float) -> Held:
            return self.extrema_along(of_top, reach_m, lines)

        return make_tube(points, limits, self.field, self.zone_table, extrema, self.surfaces, self.grounds, self.scale)

    def straight_cells(self, bow_m: float) -> int:
        """How many cells of the terrain model in a row have lines that are straight in the plane within ``bow_m``."""
        f = self.field
        if f.affine:
            return int(max(self.surface.ground_m.shape))
        return max(int(math.sqrt(4.0 * bow_m / f.bend) / max(f.step_x, f.step_y)), 1)

    def _around(self, sign: float, east_m: ArrayLike, north_m: ArrayLike, reach_m: float) -> Floats:
        """Highest value of ``sign`` times height within reach of each point; NaN where unknown."""
        e, n = np.broadcast_arrays(np.asarray(east_m, dtype=np.float64), np.asarray(north_m, dtype=np.float64))
        points = np.stack([e.ravel(), n.ravel()], axis=-1)
        held = self.extrema_along(sign > 0.0, reach_m, LineBatch(points, points))
        return self.around(sign, points, reach_m, held, of_top=sign > 0.0).reshape(e.shape)

    def around(self, sign: float, points: Floats, reach_m: float, held: Held, *, of_top: bool) -> Floats:
        """(N,) an upper bound of ``sign`` times the height of top or ground within reach of points (N, 2); NaN: none.

        ``held``: `extrema_along` lines through the points, for that reach or a wider one.
        """
        out = np.empty(len(points))
        around(self._tops if of_top else self._bare, held, sign, points, reach_m, out)
        return out

    def extrema_along(self, of_top: bool, reach_m: float, lines: LineBatch) -> Held:
        """The kernels' extrema of top or ground for a reach, along lines."""
        of_top = of_top and self.surface.top_m is not self.surface.ground_m
        return self._neighbourhoods.along(of_top, self._heights[of_top], reach_m, lines)

    def _judge(
        self,
        legs: Legs,
        limits: Limits,
        full: bool,
        ok: Bools,
        found: Held,
    ) -> int:
        f = self.field
        spare = 0.0 if f.affine else BOW_M + f.error_m
        near_m = float(legs.track_error_m.max(initial=0.0)) * self.scale + spare
        lines = LineBatch(legs.start, legs.end)
        near = self.extrema_along(True, near_m, lines)
        far = self.extrema_along(True, near_m + limits.horizontal_clearance_m * self.scale, lines)
        return int(
            judge(
                self.surfaces, near, far, self.extrema_along(False, near_m, lines), self._held_zones,
                legs.start, legs.end, legs.column, legs.track_error_m, legs.altitude_error_m,
                *Demands.of(limits, self.scale), full, ok, found,
                work_arrays(self.zone_table.arrays.most_corners, len(self.zones)),
            )
        )  # fmt: skip

    def beside_m(self, limits: Limits) -> float:
        """Horizontal distance to keep from zones on every side, metres of the plane: clearance plus track error."""
        return (limits.horizontal_clearance_m + limits.track_error_m) * self.scale

    def beside_over_ground_m(self, limits: Limits) -> float:
        """The same for zones with a level above ground, as far as a `Tube` counts them: never less."""
        return Reaches.of(limits, self.field, self.scale).far_m + ZONE_ROOM_M

    def _violations(
        self, legs: Legs, limits: Limits, climb_deg: Floats, worst: Floats, hit: Indices, hit_at: Floats
    ) -> tuple[Violation, ...]:
        """Violations by leg, in the order of the kinds."""
        leg, kind = np.nonzero(worst[:, :, 0] > 0.0)
        if not len(leg) and not len(hit):
            return ()
        by, at = worst[leg, kind, 0], worst[leg, kind, 1]
        reach = (legs.track_error_m + limits.horizontal_clearance_m) * self.scale
        known_within = np.where(legs.column, legs.track_error_m * self.scale, reach)
        steep = (kind == CLIMB) | (kind == DESCENT)
        bounds = np.zeros(len(_VIOLATION_KINDS))
        bounds[[MIN_AGL, CLIMB, DESCENT]] = limits.min_agl_m, limits.max_climb_deg, limits.max_descent_deg
        bounds[[MAX_AGL, MAX_AMSL]] = limits.max_agl_m or 0.0, limits.max_amsl_m or 0.0
        limit = np.where(kind == COVERAGE, known_within[leg], bounds[kind])
        by = np.where(steep, np.maximum(np.abs(climb_deg[leg]) - limit, ANGLE_DEG), by)
        value = limit + np.where((kind == MIN_AGL) | (kind == TERRAIN) | (kind == COVERAGE), -by, by)
        value = np.where(kind == COVERAGE, np.maximum(value, 0.0), value)
        hit_value, hit_t = self._depths(legs, limits, hit, hit_at)
        hit_reach = reach[hit[:, 0]]
        leg = np.concatenate([leg, hit[:, 0]])
        at = np.concatenate([at, hit_t])
        order = np.argsort(leg, kind="stable")
        place = legs.start[leg] + at[:, None] * (legs.end[leg] - legs.start[leg])
        columns = (
            leg,
            np.concatenate([kind, np.full(len(hit), ZONE)]),
            at,
            *place.T,
            np.concatenate([value, hit_value]),
            np.concatenate([limit, hit_reach]),
            np.concatenate([by, np.maximum(hit_reach - hit_value, TOUCH_M)]),
            np.concatenate([np.full(len(kind), -1), hit[:, 1]]),
        )
        rows = zip(*(c[order].tolist() for c in columns), strict=True)
        return tuple(
            Violation(i, _VIOLATION_KINDS[k], t, e, n, h, v, lim, off, "deg" if k in (CLIMB, DESCENT) else "m", zone)
            for i, k, t, e, n, h, v, lim, off, zone in rows
        )

    def _depths(self, legs: Legs, limits: Limits, hit: Indices, hit_at: Floats) -> tuple[Floats, Floats]:
        """Signed distances to broken zones, never too large, and where on the leg.

        The kernel returns 0 anywhere inside a polygon, and any place inside a zone over ground: there the deepest place
        within the zone's band of heights is searched for.
        """
        value, at = hit_at[:, 0].copy(), hit_at[:, 1].copy()
        for row in range(len(hit)):
            leg, k = hit[row].tolist()
            numbers, shape = self.zone_table.arrays.table[k], self.zones[k].shape
            over_ground = bool(numbers[FLOOR_AGL] or numbers[CEILING_AGL])
            if over_ground and value[row] > 0.0:  # the kernel's distance is accurate to NEAR_M or NEAR_PART of it
                value[row] = max(0.0, value[row] - max(NEAR_M, NEAR_PART * value[row]))
                continue
            if value[row] > 0.0 or not (over_ground or isinstance(shape, Polygon)):
                continue
            a, b, error = legs.start[leg], legs.end[leg], legs.altitude_error_m[leg] + limits.vertical_clearance_m
            part = np.array([0.0, 1.0])
            if a[2] != b[2]:
                low, high = (BAND_LOW, BAND_HIGH) if over_ground else (FLOOR, CEILING)
                levels = np.array([numbers[low] - error, numbers[high] + error])
                part = np.sort((levels - a[2]) / (b[2] - a[2])).clip(0.0, 1.0)
            p, q = a[:2] + part[:, None] * (b - a)[:2]
            if isinstance(shape, Polygon):
                depth, t = deepest_inside(self.zones[k].edges, p, q)
            else:
                depth, t = deepest_in_circle(shape, shape.radius_m * self.scale, p, q)
            if depth > -value[row]:
                value[row], at[row] = -depth, part[0] + t * (part[1] - part[0])
        return value, at


_KIND_NUMBERS = {kind: number for number, kind in _VIOLATION_KINDS.items()}


class WorkArrays(threading.local):
    """Arrays for `judge` to work in: one set for each thread, reset before each call.

    Pieces of legs that are still to be looked at (256, 8); numbers of the leg at hand (`kernels/sweep_terrain.py`),
    and the count `cut`; splits of a leg by a polygon, two for each corner; for each zone the leg that it was listed
    for, -1 before; and a list of zones (0, 1, …).
    """

    def __init__(self) -> None:
        self._size = (-1, -1)
        self._out = np.zeros(CUT + 1)

    def __call__(self, most_corners: int, zones: int) -> Held:
        """The arrays for polygons of at most ``most_corners`` corners, and ``zones`` zones."""
        if self._size != (most_corners, zones):
            self._seen = np.empty(zones, np.int64)
            self._list = np.arange(zones)
            self._ready = Held(
                WORK, np.empty((256, 8)), self._out, np.empty(2 * most_corners), self._seen, np.arange(zones)
            )
            self._size = most_corners, zones
        self._out.fill(0.0)
        self._seen.fill(-1)
        self._ready.arguments[-1][:] = self._list
        return self._ready

    @property
    def cut(self) -> float:
        """How many pieces of ground the last call of `judge` cut, see `sweep_beside.deepest`."""
        return float(self._out[CUT])


work_arrays = WorkArrays()
