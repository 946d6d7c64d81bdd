"""Floors and ceilings sampled around a track, on which tracks are pulled tight at 100 trials per millisecond.

Floors and ceilings come from `Airspace`, on a raster along a corridor. Zones that are flown over or under are part
of them, all others are walls. The result is not proved legal: `profile.exact` checks it, and `Guide.learn` and
`Guide.narrow` correct the raster where it was wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices, Int64s
from gcsplan.planners.lattice import pull_kernels
from gcsplan.planners.problem import Problem, terminals_of
from gcsplan.planners.profile.track import denser
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import track_length_m
from gcsplan.world.geometry.zones import Level, Zone

SHUT_M = 1e5
"""Floor, in metres, where no altitude is free; finite, so that kernels need not handle infinities."""
MOST_RASTER_NODES = 150_000
FINEST_PART, COARSEST_M = 0.45, 40.0
"""Spacing of the raster: as a part of the terrain's cells, and at most in metres."""
RASTER_MARGIN_M = 0.3
"""Metres kept from floor and ceiling of the raster, for ground between samples."""
SLOPE_PART = 0.999
MISSING_COST = 50.0
"""Cost, in metres of track, of each metre that is missing for a track to be legal."""
MOVE_REACH_M = 2000.0
"""A move is evaluated over this many metres of the track to each side."""
PULL_ROUNDS = 6


@dataclass(frozen=True, eq=False, slots=True)
class GuidedTrack:
    """A track evaluated by the guide.

    ``points`` (N, 2); ``pinned`` (N,) vertices that stay; ``pin_m`` (N,) their altitudes, NaN where free; ``amsl_m``
    (N,) altitude of the profile at the vertices; ``cost``; ``missing``: metres that it lacks to be legal.
    """

    points: Floats
    pinned: Bools
    pin_m: Floats
    amsl_m: Floats
    cost: float
    missing: float

    @property
    def value(self) -> float:
        """Cost for comparisons: increased by 1000 times itself for each missing metre."""
        return self.cost * (1.0 + 1e3 * self.missing)


@dataclass(eq=False, slots=True)
class CorridorRaster:
    """Rasters ``floor_m``, ``ceiling_m`` (rows, cols) from (``west_m``, ``south_m``), rows going north, and the walls:
    ``circles`` (C, 3) east, north, radius; ``edges`` (E, 4) of polygons. ``work``: working arrays of the kernel."""

    problem: Problem
    west_m: float
    south_m: float
    step_m: float
    floor_m: Floats
    ceiling_m: Floats
    circles: Floats
    edges: Floats
    work: tuple[Floats | Int64s, ...]
    margin_m: float = RASTER_MARGIN_M
    slope_part: float = SLOPE_PART

    def strict(self, by_m: float) -> None:
        """Keep more from floor and ceiling, up to 0.3 m, and 0.1 % more from the steepest slope, after the exact check
        refused a line that was legal here because it lacked ``by_m`` of height."""
        self.margin_m += min(by_m + 0.05, 0.3)
        self.slope_part -= 0.001

    def learn(self, samples: Floats) -> None:
        """Raise the floor and lower the ceiling, by up to 10 m, where ``samples`` (K, 4) of east, north, floor, ceiling
        are stricter than the rasters."""
        x, y = (samples[:, 0] - self.west_m) / self.step_m, (samples[:, 1] - self.south_m) / self.step_m
        rows, cols = self.floor_m.shape
        i, j = np.clip(np.floor(x).astype(int), 0, cols - 2), np.clip(np.floor(y).astype(int), 0, rows - 2)
        u, v = x - i, y - j
        for raster, sign, known in ((self.floor_m, 1.0, samples[:, 2]), (self.ceiling_m, -1.0, samples[:, 3])):
            read = (1 - v) * ((1 - u) * raster[j, i] + u * raster[j, i + 1])
            read += v * ((1 - u) * raster[j + 1, i] + u * raster[j + 1, i + 1])
            less = sign * (np.clip(known, -SHUT_M, SHUT_M) - read)
            less = np.where(less > 0.0, np.minimum(less, 10.0), 0.0)
            more = np.zeros_like(raster)
            for dj, di in ((0, 0), (0, 1), (1, 0), (1, 1)):
                np.maximum.at(more, (j + dj, i + di), less)
            raster += sign * more

    def pull(self, line: GuidedTrack, steps_m: Floats, gain_m: float, rounds: int = PULL_ROUNDS) -> GuidedTrack:
        """Make a line cheaper by moves of ``steps_m`` metres, each of which must gain ``gain_m`` metres of track.

        A line of too many points is returned as it is.
        """
        p, n = self.problem, len(line.points)
        unit, climbing = p.rates or (1.0, 0.0)
        capacity = pull_kernels.MOST_PULLED
        if n > capacity - 2:
            return line
        points, pinned, pin_m, amsl = (
            np.zeros((capacity, 2)),
            np.zeros(capacity),
            np.full(capacity, np.nan),
            np.zeros(capacity),
        )
        points[:n], pinned[:n], pin_m[:n], amsl[:n] = line.points, line.pinned, line.pin_m, line.amsl_m
        pin_m[[0, n - 1]] = np.nan
        limits = p.limits
        spec = np.array(
            [
                self.west_m,
                self.south_m,
                1.0 / self.step_m,
                max(0.85 * self.step_m, 3.0 * track_length_m(line.points) / pull_kernels.MOST_DOORS),
                self.margin_m,
                limits.max_climb_slope * self.slope_part,
                limits.max_descent_slope * self.slope_part,
                climbing,
                unit,
                float(p.rates is not None),
                MISSING_COST * unit,
                p.airspace.beside_m(p.limits),
            ]
        )
        p.budget.spend("pull", n * len(steps_m))
        count = pull_kernels.pull(
            points, pinned, pin_m, amsl, n, float(p.start[2]), float(p.goal[2]), self.floor_m, self.ceiling_m,
            self.circles, self.edges, spec, steps_m, gain_m * unit, rounds, MOVE_REACH_M, *self.work,
        )  # fmt: skip
        cost, missing = self.work[-1]
        return GuidedTrack(
            points[:count].copy(),
            pinned[:count] > 0.0,
            pin_m[:count].copy(),
            amsl[:count].copy(),
            float(cost),
            float(missing),
        )

    def narrow(self, place: Floats, by_m: float, ceiling: bool = False) -> None:
        """Raise the floor (or lower the ceiling) by ``by_m`` at nodes around a place that the exact check refused."""
        i, j = math.floor((place[0] - self.west_m) / self.step_m), math.floor((place[1] - self.south_m) / self.step_m)
        rows, cols = slice(max(j, 0), max(j + 2, 0)), slice(max(i, 0), max(i + 2, 0))
        if ceiling:
            self.ceiling_m[rows, cols] -= by_m
        else:
            self.floor_m[rows, cols] += by_m


def line_of(points: Floats, pinned: Bools, pin_m: Floats) -> GuidedTrack:
    """A line that is not evaluated yet."""
    return GuidedTrack(points, pinned, pin_m, np.zeros(len(points)), math.inf, math.inf)


def make_guide(
    problem: Problem, ways: list[Floats], radius_m: float, over: dict[int, bool], finest_m: float = COARSEST_M
) -> CorridorRaster:
    """The guide within about ``radius_m`` of some tracks ``ways`` (N, 2).

    ``over``: zones known to be flown over (True) or under (False). ``finest_m``: most metres between nodes, unless the
    raster would have more than `MOST_RASTER_NODES`.
    """
    air, limits = problem.airspace, problem.limits
    everything = np.vstack(ways)
    west, south = (float(x) for x in everything.min(axis=0) - radius_m)
    east, north = (float(x) for x in everything.max(axis=0) + radius_m)
    length = sum(track_length_m(w) for w in ways)
    cell = float(air.surface.grid.metres_per_cell(*terminals_of(problem)[0]).min())
    area = min((east - west) * (north - south), 2.0 * radius_m * (length + 2.0 * radius_m))
    step = max(min(FINEST_PART * cell, finest_m, 0.02 * length), math.sqrt(area / MOST_RASTER_NODES), 0.05)
    x: Floats = np.arange(west, east + step, step)
    y: Floats = np.arange(south, north + step, step)
    near = np.zeros((len(y), len(x)), bool)
    r = math.ceil(radius_m / step)
    for way in ways:
        for place in denser(way, 0.4 * radius_m):
            i, j = round((place[0] - west) / step), round((place[1] - south) / step)
            near[max(j - r, 0) : j + r + 1, max(i - r, 0) : i + r + 1] = True
    jj, ii = np.nonzero(near)
    floor, ceiling = np.full(near.shape, SHUT_M), np.full(near.shape, -SHUT_M)
    floor[jj, ii] = np.minimum(problem.floors(x[ii], y[jj]), SHUT_M)
    ceiling[jj, ii] = np.clip(air.ceiling_amsl(x[ii], y[jj], limits), -SHUT_M, SHUT_M)
    circles, edges = [], []
    for number in air.zone_table.within((west, south, float(x[-1]), float(y[-1])), air.beside_m(limits) + step):
        zone, (js, is_) = air.zones[number], _near(problem, number, x, y, step)
        if not len(js) or _passed(problem, zone, over.get(number), x, y, js, is_, floor, ceiling):
            continue
        corners = air.zone_table.corners_m(number)
        edges.extend(np.hstack([corners, np.roll(corners, -1, axis=0)]).tolist())
        if not len(corners):
            circles.append(air.zone_table.discs_m[number] + (0.0, 0.0, air.beside_m(limits)))
    return CorridorRaster(
        problem, west, south, step, floor, ceiling,
        np.array(circles).reshape(-1, 3), np.array(edges).reshape(-1, 4), pull_kernels.workspace(),
    )  # fmt: skip


def _near(problem: Problem, zone: int, x: Floats, y: Floats, step: float) -> tuple[Indices, ...]:
    """Rows and columns of the nodes within reach of a zone plus three quarters of a step."""
    air = problem.airspace
    w, s, e, n = air.zone_table.box_m[zone].tolist()
    reach = air.beside_m(problem.limits) + 0.75 * step
    i = np.flatnonzero((x > w - reach - 1.0) & (x < e + reach + 1.0))
    j = np.flatnonzero((y > s - reach - 1.0) & (y < n + reach + 1.0))
    jj, ii = (a.ravel() for a in np.meshgrid(j, i, indexing="ij"))
    at = np.stack([x[ii], y[jj]], axis=-1)
    close = air.zone_table.near(zone, at, at, reach)
    return jj[close], ii[close]


def _passed(
    problem: Problem, zone: Zone, over: bool | None, x: Floats, y: Floats, jj: Indices, ii: Indices,
    floor: Floats, ceiling: Floats,
) -> bool:  # fmt: skip
    """Raise the floor over a zone, or lower the ceiling to below it, whichever leaves more altitude free.

    Return False and change nothing if the zone can be passed neither over nor under: it is a wall.
    """
    error = problem.limits.over_zone_m
    capacity = []
    for upper, level in ((True, zone.ceiling), (False, zone.floor)):
        if level is None or over is (not upper):
            continue
        at = _level(problem, level, upper, x[ii], y[jj]) if level.datum == "agl" else np.full(len(ii), level.value_m)
        if level.datum == "amsl":
            at = at + (error if upper else -error)
        spare = (
            ceiling[jj, ii] - np.maximum(floor[jj, ii], at)
            if upper
            else np.minimum(ceiling[jj, ii], at) - floor[jj, ii]
        )
        if (spare >= 0.0).any():
            capacity.append((float(np.median(spare)), upper, at))
    if not capacity:
        return False
    _, upper, at = max(capacity, key=lambda r: r[0])
    if upper:
        floor[jj, ii] = np.minimum(np.maximum(floor[jj, ii], at), SHUT_M)
    else:
        ceiling[jj, ii] = np.maximum(np.minimum(ceiling[jj, ii], at), -SHUT_M)
    return True


def _level(problem: Problem, level: Level, upper: bool, east: Floats, north: Floats) -> Floats:
    """Altitude that clears, over (``upper``) or under it, a level of a zone that follows the ground within reach."""
    limits, air = problem.limits, problem.airspace
    if upper:
        wide = replace(limits, min_agl_m=0.0)
        return air.floor_amsl(east, north, wide) + (level.value_m + limits.vertical_clearance_m)
    wide = Limits(
        0.0, max_agl_m=level.value_m, track_error_m=limits.track_error_m + limits.horizontal_clearance_m,
        altitude_error_m=limits.over_zone_m,
    )  # fmt: skip
    return air.ceiling_amsl(east, north, wide)
