"""The world as the lattice search sees it: a square lattice of nodes with floors, ceilings and zones on its edges.

Floors and ceilings come from `Airspace`, on a lattice of half the spacing, so that they are known at the ends and in
the middle of every edge; zones are tested against the whole line of an edge. The lattice only guides: the result of
a search is checked exactly along its line, and `Lattice.raise_floor` corrects the lattice for the next search.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Bools, Floats, Int64s
from gcsplan.planners.problem import ENDS_M, Problem, terminals_of
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits

STEPS = np.array([(1, 0), (0, 1), (1, 1), (-1, 1), (2, 1), (1, 2), (-1, 2), (-2, 1)], dtype=np.int64)
"""Half of the 16 directions, in nodes (east, north); edge ``node * 8 + k`` goes from ``node`` by ``STEPS[k]``."""

LINK_DOORS = 9
"""Places along an edge between a terminal and a node at which floor and ceiling are read."""


@dataclass(eq=False, slots=True)
class Lattice:
    """Node (i, j) lies at (west_m + i·step_m, south_m + j·step_m) and has the number ``j·nx + i``.

    ``floor_m``, ``ceiling_m``, ``ground_m`` (2·ny − 1, 2·nx − 1): AMSL on the half lattice, the ground only where a
    zone needs it. A band is the altitudes that a zone forbids on an edge, from ``band_low`` to ``band_high``;
    ``band_agl`` (B, 2): which of the two count from the ground. Bands of edge e are at
    ``band_at[e] : band_at[e + 1]``, lowest first. ``reach_m``: distance kept from zones in the plane.
    """

    west_m: float
    south_m: float
    step_m: float
    nx: int
    ny: int
    floor_m: Floats
    ceiling_m: Floats
    ground_m: Floats
    band_at: Int64s
    band_low: Floats
    band_high: Floats
    band_agl: Bools
    reach_m: float

    def node_places(self, nodes: Int64s) -> Floats:
        """Places (K, 2) of nodes."""
        j, i = np.divmod(nodes, self.nx)
        return np.stack([self.west_m + i * self.step_m, self.south_m + j * self.step_m], axis=-1)

    def raise_floor(self, place: Floats, by_m: float) -> None:
        """Raise the floor by ``by_m`` around a place where the exact check was stricter than the samples."""
        half = 0.5 * self.step_m
        i, j = round((place[0] - self.west_m) / half), round((place[1] - self.south_m) / half)
        self.floor_m[max(j - 1, 0) : max(j + 2, 0), max(i - 1, 0) : max(i + 2, 0)] += by_m

    def shut(self, place: Floats, radius_m: float) -> None:
        """Close all altitudes within ``radius_m`` of a place."""
        half = 0.5 * self.step_m
        x, y = (place[0] - self.west_m) / half, (place[1] - self.south_m) / half
        rows, cols = self.floor_m.shape
        j, i = np.ogrid[:rows, :cols]
        self.floor_m[(i - x) ** 2 + (j - y) ** 2 <= (radius_m / half) ** 2] = np.inf


def make_lattice(problem: Problem, box: tuple[float, float, float, float], step_m: float, detour: float) -> Lattice:
    """A lattice over ``box`` (west, south, east, north), limited to places that need no longer detour than ``detour``.

    A place is kept if the track from a terminal to it and on to the next terminal is at most ``detour`` times the
    straight track between the two (plus four steps), for any pair of neighbouring terminals; ``inf`` keeps all.
    """
    west, south, east, north = box
    nx = max(2, math.ceil((east - west) / step_m) + 1)
    ny = max(2, math.ceil((north - south) / step_m) + 1)
    half = 0.5 * step_m
    x: Floats = west + half * np.arange(2 * nx - 1, dtype=np.float64)
    y: Floats = south + half * np.arange(2 * ny - 1, dtype=np.float64)
    inside = _within_detour(problem, x, y, detour, 2.0 * step_m)
    shape = (len(y), len(x))
    floor = np.full(shape, np.inf)
    ceiling = np.full(shape, -np.inf)
    jj, ii = np.nonzero(inside)
    air, limits = problem.airspace, problem.limits
    floor[jj, ii] = problem.floors(x[ii], y[jj])
    ceiling[jj, ii] = air.ceiling_amsl(x[ii], y[jj], limits)
    reach = air.beside_m(limits)
    ground = _ground_of_zones(problem, x, y, inside, reach + 2.0 * step_m)
    edges, low, high, agl = _edge_bands(air, limits, reach, west, south, step_m, ground)
    at = np.zeros(nx * ny * 8 + 1, np.int64)
    np.cumsum(np.bincount(edges, minlength=nx * ny * 8), out=at[1:])
    return Lattice(west, south, step_m, nx, ny, floor, ceiling, ground, at, low, high, agl, reach)


def _ground_of_zones(problem: Problem, x: Floats, y: Floats, inside: Bools, beside_m: float) -> Floats:
    """Ground altitude at ``inside`` places no farther than ``beside_m`` from the box of a zone with a level AGL; 0
    elsewhere."""
    near = np.zeros(inside.shape, np.bool_)
    table = problem.airspace.zone_table
    for w, s, e, n in table.box_m[table.follow_ground].tolist():
        cols = slice(*np.searchsorted(x, (w - beside_m, e + beside_m)))
        rows = slice(*np.searchsorted(y, (s - beside_m, n + beside_m)))
        near[rows, cols] = inside[rows, cols]
    ground = np.zeros(inside.shape)
    jj, ii = np.nonzero(near)
    # Unknown ground has an infinite floor, so its altitude does not matter here.
    ground[jj, ii] = _known(problem.airspace.surface.ground_at(x[ii], y[jj]), 0.0)
    return ground


def _within_detour(problem: Problem, x: Floats, y: Floats, detour: float, slack_m: float) -> Bools:
    if math.isinf(detour):
        return np.ones((len(y), len(x)), bool)
    terminals = terminals_of(problem)
    out = np.zeros((len(y), len(x)), bool)
    for a, b in pairwise(terminals):
        to = np.hypot(x[None, :] - a[0], y[:, None] - a[1]) + np.hypot(x[None, :] - b[0], y[:, None] - b[1])
        out |= to <= detour * math.hypot(b[0] - a[0], b[1] - a[1]) + 2.0 * slack_m
    return out


def _edge_bands(
    air: Airspace, limits: Limits, reach: float, west: float, south: float, step: float, ground: Floats
) -> tuple[Int64s, Floats, Floats, Bools]:
    """Edge, low, high and (B, 2) which of these are AGL, of every band of every zone; sorted by edge, then by low."""
    ny, nx = (ground.shape[0] + 1) // 2, (ground.shape[1] + 1) // 2
    table, far = air.zone_table, reach + 2.0 * step
    edges, zones = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for zone in table.within((west, south, west + (nx - 1) * step, south + (ny - 1) * step), far):
        w, s, e, n = table.box_m[zone].tolist()
        i0, i1 = max(0, math.floor((w - far - west) / step)), min(nx - 1, math.ceil((e + far - west) / step))
        j0, j1 = max(0, math.floor((s - far - south) / step)), min(ny - 1, math.ceil((n + far - south) / step))
        k, j, i = (a.ravel() for a in np.mgrid[0 : len(STEPS), j0 : j1 + 1, i0 : i1 + 1])
        ends_i, ends_j = i + STEPS[k, 0], j + STEPS[k, 1]
        inside = (ends_i >= 0) & (ends_i < nx) & (ends_j < ny)
        a = np.stack([west + i * step, south + j * step], axis=-1)
        b = np.stack([west + ends_i * step, south + ends_j * step], axis=-1)
        hit = np.flatnonzero(inside & table.near(zone, a, b, reach))
        edges.append((j[hit] * nx + i[hit]) * 8 + k[hit])
        zones.append(np.full(len(hit), zone))
    edge, of = np.concatenate(edges), np.concatenate(zones)
    (low, high), agl = table.levels_m(limits.over_zone_m), table.over_ground
    row, col = np.divmod(edge // 8, nx)
    order = np.lexsort((low[of] + agl[of, 0] * ground[2 * row, 2 * col], edge))
    of = of[order]
    return edge[order], low[of], high[of], agl[of]


def _known(ground: Floats, unknown: float) -> Floats:
    return np.where(np.isnan(ground), unknown, ground)


@dataclass(frozen=True, eq=False, slots=True)
class Links:
    """Edges between a terminal and nodes, one row for each gap between bands: ``node`` (K,), ``length_m`` (K,),
    ``low_m``, ``high_m`` (K, LINK_DOORS) from the terminal to the node."""

    node: Int64s
    length_m: Floats
    low_m: Floats
    high_m: Floats


def make_links(problem: Problem, lattice: Lattice, place: tuple[float, float], amsl_m: float | None) -> Links:
    """Links from a terminal at ``amsl_m`` (None: any altitude) to the nodes within 2.1 steps of it.

    Whether the terminal itself is legal is checked elsewhere: its own door is widened to ``amsl_m`` if that lies less
    than `ENDS_M` outside.
    """
    x, y = (place[0] - lattice.west_m) / lattice.step_m, (place[1] - lattice.south_m) / lattice.step_m
    jj, ii = (a.ravel() for a in np.mgrid[math.floor(y) - 2 : math.ceil(y) + 3, math.floor(x) - 2 : math.ceil(x) + 3])
    keep = (ii >= 0) & (ii < lattice.nx) & (jj >= 0) & (jj < lattice.ny) & (np.hypot(ii - x, jj - y) <= 2.1)
    node = (jj * lattice.nx + ii)[keep]
    b = lattice.node_places(node)
    a = np.broadcast_to(np.asarray(place), b.shape)
    at = a[:, None] + np.linspace(0.0, 1.0, LINK_DOORS)[None, :, None] * (b - a)[:, None]
    air, limits, table = problem.airspace, problem.limits, problem.airspace.zone_table
    low = np.asarray(air.floor_amsl(at[..., 0], at[..., 1], limits))
    high = np.asarray(air.ceiling_amsl(at[..., 0], at[..., 1], limits))
    bands: list[list[tuple[Floats, Floats]]] = [[] for _ in node]
    bottom, top = table.levels_m(limits.over_zone_m)
    follows = bool(table.follow_ground.any())
    ground = _known(air.surface.ground_at(at[..., 0], at[..., 1]), 0.0) if follows else np.zeros(at.shape[:2])
    for zone in table.within((*place, *place), lattice.reach_m + 3.0 * lattice.step_m):
        for row in np.flatnonzero(table.near(zone, a, b, lattice.reach_m)):
            under = np.where(table.over_ground[zone, :, None], ground[row], 0.0)
            bands[row].append((bottom[zone] + under[0], top[zone] + under[1]))
    rows, lows, highs = [], [], []
    for k, found in enumerate(bands):
        for gap_low, gap_high in gaps(found):
            rows.append(k)
            lows.append(np.maximum(low[k], gap_low))
            highs.append(np.minimum(high[k], gap_high))
    if amsl_m is not None:
        for under, over in zip(lows, highs, strict=True):
            if under[0] < amsl_m + ENDS_M and over[0] > amsl_m - ENDS_M:
                under[0], over[0] = min(under[0], amsl_m), max(over[0], amsl_m)
    shape = (-1, LINK_DOORS)
    length = np.hypot(*(b - a).T)
    return Links(
        node[rows].astype(np.int64), length[rows], np.array(lows).reshape(shape), np.array(highs).reshape(shape)
    )


def gaps(bands: list[tuple[Floats, Floats]]) -> list[tuple[Floats, Floats]]:
    """Closed altitude intervals, lowest first, that are free at all of several doors (D,): each lies over some of the
    forbidden ``bands`` and under the others. Bands are ordered by their lowest altitude at the first door."""
    shape = np.shape(bands[0][0]) if bands else (LINK_DOORS,)
    order = sorted(bands, key=lambda band: float(np.ravel(band[0])[0]))
    lows = [np.full(shape, -np.inf)]
    for _, top in order:
        lows.append(np.maximum(lows[-1], top))
    highs = [np.full(shape, np.inf)]
    for bottom, _ in order[::-1]:
        highs.append(np.minimum(highs[-1], bottom))
    return [
        (low, high)
        for low, high in zip(lows, highs[::-1], strict=True)
        if (low <= high).all() and (low < np.inf).all() and (high > -np.inf).all()
    ]
