"""Kernels of zones on a lattice: how deep a place lies in one, its levels, its own ground, and the walls that it makes.

A level over ground (AGL) counts from the ground under the zone itself, also where it limits flight beside the zone,
within reach. That *own ground* is read in two ways. For paths, on circles around a node (`look_beside`): as good as
dense samples, and the check judges the flight. For bounds, cell by cell (`own_ground`): what holds for the corners of a
cell and those of another one within reach holds for every place of the two, because the zone's parts are convex, and
so is what is within reach.

Cells that a zone shuts, wholly or in part, get walls of their own (`stamp_zones`).
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Int32s, Int64s
from gcsplan.planners.compiled import device, kernel
from gcsplan.planners.optimal.navmesh.mesh_kernels import NEXT

EAST, NORTH, RADIUS, BOTTOM, TOP, BOTTOM_AGL, TOP_AGL, FIRST, LAST, UNDER = range(10)
PAIR, BOTTOM_2, TOP_2, BOTTOM_2_AGL, TOP_2_AGL, UNDER_2, THIN, LOOKS, OWN_BOTTOM, OWN_TOP = range(10, 20)
ONE, OTHER, RISE, NUMBERS = range(20, 24)
"""Columns of the array ``zones``, and their number; a 2 marks the columns of the second zone of a crossing pair. Where
its bottom and top are no more than ``THIN`` apart, there is no zone: ground lifts a floor over a ceiling AMSL. A zone
that ``LOOKS`` follows its own ground, also beside it: ``OWN_BOTTOM``, ``OWN_TOP`` are its levels over that; a pair does
if one of its zones does. ``ONE``, ``OTHER``: the rows of the zones of a pair. ``RISE``: metres that ground may rise or
fall within reach anywhere at a zone; 0 where the slopes at nodes give a closer value (see `BESIDE`)."""
BESIDE = 2.0
"""Datum of a level over all ground within reach, for paths; 1: over the ground below; 0: AMSL."""
NODE_RINGS = ((0.0, 1), (1.0 / 3.0, 10), (2.0 / 3.0, 21), (1.0, 32))
"""Circles around a node on which ground is read for `BESIDE`, as parts of the reach, and places on each."""
PLACES = np.array(
    [(r * math.cos(a), r * math.sin(a)) for r, n in NODE_RINGS for a in np.arange(n) * (2.0 * math.pi / n)]
)
"""Those places: metres east and north of the node, for a reach of 1."""
RIM = 0.01
"""Part of the reach by which they may lie outside of the zone: at its rim, few places lie within."""
CELL_RINGS = ((1.0, 32), (0.8, 16), (0.5, 8), (0.25, 4), (0.0, 1))
"""Circles around a cell on which ground is read, as parts of the reach, and cells on each: on a slope, the lowest and
the highest lie on the largest."""
DISC = np.array([(r * math.sin(a), r * math.cos(a)) for r, n in CELL_RINGS for a in np.arange(n) * (2.0 * math.pi / n)])
"""Those cells: rows and columns away, for a reach of 1."""
STAMPED = 10
"""Places read for `BESIDE` that take as long as one cell that a zone may shut."""


@device
def depth(zones: Floats, edges: Floats, z: int, x: float, y: float) -> float:
    """How far, m, a point is inside a zone's convex shape: a concave function, above 0 inside."""
    if zones[z, RADIUS] >= 0.0:
        return zones[z, RADIUS] - math.sqrt((x - zones[z, EAST]) ** 2 + (y - zones[z, NORTH]) ** 2)
    depth = np.inf
    for k in range(int(zones[z, FIRST]), int(zones[z, LAST])):
        depth = min(depth, within(edges, k, x, y))
    return depth


@device
def within(edges: Floats, k: int, x: float, y: float) -> float:
    """How far, m, a point is inside form k, a disc or a half-plane."""
    if edges[k, 3] > 0.0:
        return edges[k, 0] - math.sqrt((x - edges[k, 1]) ** 2 + (y - edges[k, 2]) ** 2)
    return edges[k, 0] - edges[k, 1] * x - edges[k, 2] * y


@device
def level(zones: Floats, z: int, level: int, ground: float) -> float:
    """The altitude of a zone's level (`BOTTOM`, …) over ground of altitude ``ground``; its datum is two columns on."""
    return zones[z, level] + (ground if zones[z, level + 2] > 0.0 else 0.0)


@device
def value_at(a: Floats, fineness: int, j: float, i: float) -> float:
    """The value at place (j, i) of a lattice ``fineness`` times finer than ``a``: bilinear between its nodes."""
    jj, ii = min(int(j / fineness), len(a) - 2), min(int(i / fineness), a.shape[1] - 2)
    v, u = j / fineness - jj, i / fineness - ii
    south = a[jj, ii] + u * (a[jj, ii + 1] - a[jj, ii])
    return float(south + v * (a[jj + 1, ii] + u * (a[jj + 1, ii + 1] - a[jj + 1, ii]) - south))


@device
def over_ground(zones: Floats, z: int) -> bool:
    """Whether a zone has a level over ground (AGL) past which a path may fly."""
    under_agl = zones[z, UNDER] > 0.0 and zones[z, BOTTOM_AGL] > 0.0
    return bool(under_agl or (zones[z, TOP] < np.inf and zones[z, TOP_AGL] > 0.0))


@device
def level_at(zones: Floats, z: int, at: int, ground: Floats, up: Floats, down: Floats, j: int, i: int) -> float:
    """The altitude of a zone's level at a node, also of datum `BESIDE`: ``up``, ``down`` are how far the ground rises
    and falls within reach."""
    value = level(zones, z, at, ground[j, i])
    if zones[z, at + 2] < BESIDE:
        return value
    return value + up[j, i] if at in (TOP, TOP_2) else value - down[j, i]


@device
def looks_beside(zones: Floats, z: int) -> bool:
    """Whether a level of a zone depends on ground within reach: its datum is `BESIDE`."""
    if zones[z, PAIR] > 0.0 and max(zones[z, TOP_2_AGL], zones[z, BOTTOM_2_AGL]) >= BESIDE:
        return True
    return bool(max(zones[z, TOP_AGL], zones[z, BOTTOM_AGL]) >= BESIDE)


@device
def looking(zones: Floats, z: int) -> int:
    """The row of the one zone whose own ground decides, of a zone or a pair; -1 if none does, or both of a pair."""
    if zones[z, PAIR] == 0.0:
        return z if looks_beside(zones, z) else -1
    one, other = int(zones[z, ONE]), int(zones[z, OTHER])
    if looks_beside(zones, one):
        return -1 if looks_beside(zones, other) else one
    return other if looks_beside(zones, other) else -1


@device
def guess_beside(
    around: Int32s,
    steep: Floats,
    fineness: int,
    zones: Floats,
    boxes: Int32s,
    z: int,
    reach: float,
    up: Floats,
    down: Floats,
) -> None:
    """Set ``up`` and ``down`` at a zone's nodes to the most that ground rises and falls within reach: the zone's `RISE`
    if it is known, or else by the slope ``steep``."""
    for j in range(boxes[z, 2], boxes[z, 3] + 2):
        for i in range(max(boxes[z, 0], around[j, 0]), min(boxes[z, 1] + 2, around[j, 1])):
            if zones[z, RISE] > 0.0:
                up[j, i] = down[j, i] = zones[z, RISE]
                continue
            jj, ii = min(j // fineness, len(steep) - 2), min(i // fineness, steep.shape[1] - 2)
            v, u = j / fineness - jj, i / fineness - ii
            south, north = steep[jj, ii] * (1.0 - u), steep[jj + 1, ii] * (1.0 - u)
            if u > 0.0:  # a weight of 0 does not carry an unknown neighbour's NaN over
                south, north = south + u * steep[jj, ii + 1], north + u * steep[jj + 1, ii + 1]
            up[j, i] = down[j, i] = reach * (south if v <= 0.0 else south * (1.0 - v) + north * v)


@device
def look_beside(
    around: Int32s, excess: Floats, ground: Floats, coarse: Floats, x: Floats, y: Floats, fineness: int, zones: Floats,
    edges: Floats, boxes: Int32s, z: int, reach: float, more: float, disc: Floats, up: Floats, down: Floats,
    read: Int64s,
) -> None:  # fmt: skip
    """Set ``up`` and ``down`` at nodes of a zone's box to how far the own ground of the zone `looking` within reach
    rises above, and falls below, the ground there, and ``more``; 0 where none is known, and -inf where the zone does
    not reach. The zone is grown by ``reach``, so its own ground is where it is deeper than that. Nodes of cells without
    any free place are left out.

    ``ground``: at the nodes; ``coarse``, ``x``, ``y``: at nodes of a lattice ``fineness`` times coarser; ``disc`` (N,
    2): the places around a node, m east and north, at which it is read. ``read`` (1,) counts them.
    """
    ex, ey = (x[0, 1] - x[0, 0]) / fineness, (y[0, 1] - y[0, 0]) / fineness
    nx, ny = (x[1, 0] - x[0, 0]) / fineness, (y[1, 0] - y[0, 0]) / fineness
    area = ex * ny - ey * nx
    own, own_depth = looking(zones, z), reach * (1.0 - RIM)
    for j in range(boxes[z, 2], boxes[z, 3] + 2):
        for i in range(max(boxes[z, 0], around[j, 0]), min(boxes[z, 1] + 2, around[j, 1])):
            up[j, i] = down[j, i] = 0.0
            if excess[j, i] == np.inf or not _is_near_free(excess, around, j, i):
                continue
            if depth(zones, edges, own, value_at(x, fineness, j, i), value_at(y, fineness, j, i)) <= 0.0:
                up[j, i] = down[j, i] = -np.inf
                continue
            most, least = -np.inf, np.inf
            read[0] += len(disc)
            for k in range(len(disc)):
                dx, dy = disc[k, 0], disc[k, 1]
                jj, ii = j + (ex * dy - ey * dx) / area, i + (ny * dx - nx * dy) / area
                if not (0.0 <= jj <= (len(x) - 1) * fineness and 0.0 <= ii <= (x.shape[1] - 1) * fineness):
                    continue
                height = value_at(coarse, fineness, jj, ii)
                # False as well where ground is unknown.
                if not (height < least or height > most):
                    continue
                at_x, at_y = value_at(x, fineness, jj, ii), value_at(y, fineness, jj, ii)
                if depth(zones, edges, own, at_x, at_y) > own_depth:
                    most, least = max(most, height), min(least, height)
            if most > -np.inf:
                up[j, i], down[j, i] = most - ground[j, i] + more, ground[j, i] - least + more


@device
def _is_near_free(excess: Floats, around: Int32s, j: int, i: int) -> bool:
    """Whether any node of the cells at a node is free."""
    for q in range(max(j - 1, 0), min(j + 2, len(excess))):
        for p in range(max(i - 1, around[q, 0]), min(i + 2, around[q, 1])):
            if excess[q, p] <= 0.0:
                return True
    return False


@device
def node(a: Floats, fineness: int, j: int, i: int) -> float:
    """`value_at` a node; fast where the lattice is that of ``a``."""
    return float(a[j, i]) if fineness == 1 else value_at(a, fineness, j, i)


@device
def _covers(
    x: Floats, y: Floats, fineness: int, zones: Floats, edges: Floats, z: int, reach: float, near: float, j: int,
    i: int, jj: int, ii: int,
) -> bool:  # fmt: skip
    """Whether cell (jj, ii) lies wholly in a zone, each corner within ``near`` of the same corner of cell (j, i)."""
    for k in range(4):
        v, u = k >> 1, k & 1
        px, py = node(x, fineness, jj + v, ii + u), node(y, fineness, jj + v, ii + u)
        dx, dy = px - node(x, fineness, j + v, i + u), py - node(y, fineness, j + v, i + u)
        if dx * dx + dy * dy > near * near or depth(zones, edges, z, px, py) <= reach:
            return False
    return True


@device
def lowest_and_highest(
    ground: Floats, x: Floats, y: Floats, fineness: int, zones: Floats, edges: Floats, z: int, reach: float,
    near: float, j: int, i: int,
) -> tuple[int, int, int, int, int]:  # fmt: skip
    """Row and column of the cell with the lowest ground, and of the cell with the highest, among cells whose ground is
    a zone's own and within reach of cell (j, i); all -1 if there is none. Then the number of cells that were read.

    ``ground``, ``x``, ``y``: at the nodes of a lattice of which cell (j, i) is a part, ``fineness`` times finer.
    ``reach``: metres by which the zone is grown; ``near``: a little less, from each place of the cell to that ground.
    """
    ex = node(x, fineness, j, i + 1) - node(x, fineness, j, i)
    ey = node(y, fineness, j, i + 1) - node(y, fineness, j, i)
    nx = node(x, fineness, j + 1, i) - node(x, fineness, j, i)
    ny = node(y, fineness, j + 1, i) - node(y, fineness, j, i)
    across, along = math.sqrt(ex * ex + ey * ey), math.sqrt(nx * nx + ny * ny)
    low_j = low_i = high_j = high_i = -1
    if depth(zones, edges, z, node(x, fineness, j, i), node(y, fineness, j, i)) <= reach - near:
        return low_j, low_i, high_j, high_i, 1
    least, most = np.inf, -np.inf
    for n in range(len(DISC)):
        jj, ii = j + int(DISC[n, 0] * near / along), i + int(DISC[n, 1] * near / across)
        if not (0 <= jj < (len(x) - 1) * fineness and 0 <= ii < (x.shape[1] - 1) * fineness):
            continue
        height = node(ground, fineness, jj, ii) + node(ground, fineness, jj + 1, ii + 1)
        # False as well where ground is unknown.
        if not ((height < least or height > most) and height + node(ground, fineness, jj, ii + 1) < np.inf):
            continue
        if not _covers(x, y, fineness, zones, edges, z, reach, near, j, i, jj, ii):
            continue
        if height < least:
            least, low_j, low_i = height, jj, ii
        if height > most:
            most, high_j, high_i = height, jj, ii
    return low_j, low_i, high_j, high_i, len(DISC)


@device
def bulge(ground: Floats, fineness: int, j: int, i: int) -> float:
    """Metres by which a cell's bilinear ground differs from its triangles, at most."""
    straight = node(ground, fineness, j, i) + node(ground, fineness, j + 1, i + 1)
    return 0.25 * abs(straight - node(ground, fineness, j, i + 1) - node(ground, fineness, j + 1, i))


@device
def own_ground(
    ground: Floats, x: Floats, y: Floats, fineness: int, zones: Floats, edges: Floats, boxes: Int32s, z: int,
    reach: float, near: float, j: int, i: int, own: Int32s, own_at: Int64s, read: Int64s,
) -> tuple[int, int, int, int]:  # fmt: skip
    """`lowest_and_highest`, read once for each zone and cell: ``own`` (K, 4) keeps it from row ``own_at`` of the zone
    on for all cells of its box, rows of a box first; -2 where it is not known yet. ``read`` (1,) counts cells read."""
    width = boxes[z, 1] - boxes[z, 0] + 1
    at = own_at[z] + (j - boxes[z, 2]) * width + i - boxes[z, 0]
    if own[at, 0] < -1:
        low_j, low_i, high_j, high_i, count = lowest_and_highest(
            ground, x, y, fineness, zones, edges, z, reach, near, j, i
        )
        own[at, 0], own[at, 1], own[at, 2], own[at, 3] = low_j, low_i, high_j, high_i
        read[0] += count
    return own[at, 0], own[at, 1], own[at, 2], own[at, 3]


@device
def own_level(zones: Floats, z: int, level: int, ground: float) -> float:
    """The altitude of a zone's level, `OWN_BOTTOM` or `OWN_TOP`, over its own ground of altitude ``ground``."""
    over = zones[z, BOTTOM_AGL if level == OWN_BOTTOM else TOP_AGL] > 0.0
    return float(zones[z, level] + (ground if over else 0.0))


@device
def _lid_over(lids: Floats, fineness: int, floor: Floats, excess: Floats, j: int, i: int) -> float:
    """The highest altitude over a cell by the ``lids`` of a lattice ``fineness`` times coarser, if it is below the cap
    at all corners; inf if it is not, or if there are no lids."""
    if not len(lids):
        return math.inf
    lid = float(lids[j // fineness, i // fineness])
    for q in range(4):
        jj, ii = j + (q >> 1), i + (q & 1)
        if not lid < floor[jj, ii] - excess[jj, ii]:
            return math.inf
    return lid


@device
def _open(
    zones: Floats, z: int, floors: Floats, excess: Floats, ground: Floats, up: Floats, down: Floats, lid: float, j: int,
    i: int,
) -> bool:  # fmt: skip
    """Whether an altitude up to ``lid`` is free at a node: over a zone, under it, or between the two of a pair."""
    floor, allowed = floors[j, i], min(floors[j, i] - excess[j, i], lid)
    bottom, top = (
        level_at(zones, z, BOTTOM, ground, up, down, j, i), level_at(zones, z, TOP, ground, up, down, j, i)
    )  # fmt: skip
    under = zones[z, UNDER] > 0.0
    none = under and top - bottom <= zones[z, THIN]
    if zones[z, PAIR] == 0.0:
        return none or top <= allowed or (under and floor <= bottom)
    bottom_2, top_2 = (
        level_at(zones, z, BOTTOM_2, ground, up, down, j, i), level_at(zones, z, TOP_2, ground, up, down, j, i)
    )  # fmt: skip
    under_2 = zones[z, UNDER_2] > 0.0
    if none:
        bottom, top = np.inf, -np.inf
    if under_2 and top_2 - bottom_2 <= zones[z, THIN]:
        bottom_2, top_2 = np.inf, -np.inf
    if max(top, top_2) <= allowed or (under and under_2 and floor <= min(bottom, bottom_2)):
        return True
    if under_2 and top <= min(bottom_2, allowed) and floor <= bottom_2:
        return True
    return under and top_2 <= min(bottom, allowed) and floor <= bottom


@kernel(
    "i4[,] i4[,] f8[,] f8[,] f8[,] f8[,] f8[,] f8[,] f8[,] f8[,] i8 f8 f8 f8[,] i8[] f8[,] f8[,] f8[,] f8[,] f8[,] "
    "f8[,] i4[,] b1 i4[] f8[,]"
)
def stamp_zones(
    around: Int32s, span: Int32s, excess: Floats, floor: Floats, ground: Floats, coarse: Floats, coarse_x: Floats,
    coarse_y: Floats, steep: Floats, lids: Floats, fineness: int, reach: float, exact: float, disc: Floats,
    read: Int64s, up: Floats, down: Floats, x: Floats, y: Floats, zones: Floats, edges: Floats, boxes: Int32s,
    low: bool, of: Int32s, values: Floats,
) -> int:  # fmt: skip
    """Give the cells that zones shut walls of their own; return how many walls there are.

    A wall's values are how deep the cell's corners lie in the shape, or how far its top is above the allowed height, m.
    ``zones`` (Z, NUMBERS); ``boxes`` (Z, 4): first and last column, first and last row of the cells each may touch;
    ``around``, ``span``, ``of``, ``values``: as in `mesh_kernels`. ``low``: only cells that are certainly shut; else
    all cells that may be shut. ``lids``: the highest altitudes over the cells of a lattice ``fineness`` times coarser,
    where no path is higher; none for (0, 0).

    For paths, ground within ``reach`` decides levels of datum `BESIDE`. How far it rises and falls at each node
    (``up``, ``down``: work arrays) is guessed from ``steep``, the slopes at the nodes of a lattice ``fineness`` times
    coarser; or, if ``exact`` is 0 or more, read (`look_beside`), with ``exact`` metres more. ``read`` counts the work.
    """
    for j in range(len(span)):
        for i in range(around[j, 0], min(around[j, 1], excess.shape[1] - 1)):
            of[j * (excess.shape[1] - 1) + i] = 0
    count = 0
    wall = values[len(values) - 1]
    for z in range(len(zones)):
        if exact >= 0.0 and looking(zones, z) >= 0:
            look_beside(
                around, excess, ground, coarse, coarse_x, coarse_y, fineness, zones, edges, boxes, z, reach, exact,
                disc, up, down, read,
            )  # fmt: skip
        elif looks_beside(zones, z):
            guess_beside(around, steep, fineness, zones, boxes, z, reach, up, down)
        west = east = north_west = north_east = 0.0
        west_open = east_open = north_west_open = north_east_open = False
        for j in range(boxes[z, 2], boxes[z, 3] + 1):
            before, lid_before = -2, math.inf
            for i in range(max(boxes[z, 0], span[j, 0]), min(boxes[z, 1] + 1, span[j, 1])):
                cell = j * (excess.shape[1] - 1) + i
                if min(min(excess[j, i], excess[j, i + 1]), min(excess[j + 1, i], excess[j + 1, i + 1])) > 0.0:
                    continue  # nothing there is free anyway
                read[0] += STAMPED
                under = zones[z, UNDER] > 0.0
                first, lid = 0, _lid_over(lids, fineness, floor, excess, j, i)
                if before == i - 1 and lid == lid_before:  # the western nodes are the eastern ones of the cell before
                    west, north_west = east, north_east
                    west_open, north_west_open = east_open, north_east_open
                    first = 1
                for q in range(first, 2):
                    south_depth = depth(zones, edges, z, x[j, i + q], y[j, i + q])
                    north_depth = depth(zones, edges, z, x[j + 1, i + q], y[j + 1, i + q])
                    south_open = _open(zones, z, floor, excess, ground, up, down, lid, j, i + q)
                    north_open = _open(zones, z, floor, excess, ground, up, down, lid, j + 1, i + q)
                    if q == 0:
                        west, north_west, west_open, north_west_open = south_depth, north_depth, south_open, north_open
                    else:
                        east, north_east, east_open, north_east_open = south_depth, north_depth, south_open, north_open
                before, lid_before = i, lid
                ways = int(west_open) + int(east_open) + int(north_east_open) + int(north_west_open)
                if ways == 4:
                    continue
                wall[0], wall[1], wall[2], wall[3] = west, east, north_east, north_west
                deepest = max(max(west, east), max(north_east, north_west))
                shallowest = min(min(west, east), min(north_east, north_west))
                if shallowest > 0.0 and zones[z, PAIR] == 0.0 and not under and zones[z, TOP] < np.inf:
                    _below_top(zones, z, floor, excess, ground, up, down, lid, low, wall, j, i)
                    count = put(of, values, cell, wall, count)
                    continue
                if low and ways > 0:
                    if deepest > 0.0 and zones[z, PAIR] == 0.0:
                        count = _in_part(
                            excess, floor, ground, lid, zones, z, of, values, wall, shallowest, j, i, count
                        )
                    continue
                if not low:
                    more = _more_between(zones, edges, z, wall, deepest, shallowest, x, y, j, i)
                    for k in range(4):
                        wall[k] += more
                count = put(of, values, cell, wall, count)
    return count


@device
def put(of: Int32s, values: Floats, cell: int, wall: Floats, count: int) -> int:
    """Store a cell's wall, its values at the corners, if it is above 0 at any; return how many walls there are."""
    if max(max(wall[0], wall[1]), max(wall[2], wall[3])) <= 0.0:
        return count
    for k in range(4):
        values[count, k] = wall[k]
    values[count, NEXT] = of[cell]
    of[cell] = count + 1
    return count + 1


@device
def _twist(floor: Floats, ground: Floats, j: int, i: int) -> float:
    """Metres that the ground's bilinear patch may lie from its triangles in a cell that is cut to suit the floor; 0 if
    the floor is the ground plus a constant."""
    same = floor[j, i] - ground[j, i]
    for q in range(1, 4):
        jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
        if abs(floor[jj, ii] - ground[jj, ii] - same) > 1e-9 * (1.0 + abs(floor[jj, ii])):
            return max(0.25 * abs(ground[j, i] + ground[j + 1, i + 1] - ground[j, i + 1] - ground[j + 1, i]), 1e-9)
    return 0.0


@device
def _below_top(
    zones: Floats, z: int, floor: Floats, excess: Floats, ground: Floats, up: Floats, down: Floats, lid: float,
    low: bool, wall: Floats, j: int, i: int,
) -> None:  # fmt: skip
    """How far a zone that covers the whole cell, and can only be flown over, rises above the highest altitude at its
    corners: its top is bilinear, as the ground is."""
    twist = _twist(floor, ground, j, i) if zones[z, TOP_AGL] > 0.0 else 0.0
    for k in range(4):
        jj, ii = j + (k >> 1), i + ((k ^ (k >> 1)) & 1)
        top = level_at(zones, z, TOP, ground, up, down, jj, ii)
        wall[k] = top - min(floor[jj, ii] - excess[jj, ii], lid) - (twist if low else -twist)


@device
def _in_part(
    excess: Floats, floor: Floats, ground: Floats, lid: float, zones: Floats, z: int, of: Int32s, values: Floats,
    wall: Floats, least: float, j: int, i: int, count: int,
) -> int:  # fmt: skip
    """Shut the part of a cell that certainly lies in a zone where it can be passed neither over nor under.

    ``wall``: how deep the cell's corners lie in the zone; ``least``: the least of these. A place is shut if the minimum
    of depth and heights is above 0. In either triangle, each of these is concave, or linear and not above the bilinear
    function; so linear values between the corners are nowhere above the minimum. If floors are not measured from the
    ground, the ground's patch may be cut along the wrong diagonal: the top is lowered by `_twist`, and a zone that can
    be passed under a floor over ground shuts nothing. Returns how many walls there are.
    """
    spare, under = 0.0, zones[z, UNDER] > 0.0
    if zones[z, TOP_AGL] > 0.0 or (under and zones[z, BOTTOM_AGL] > 0.0):
        spare = _twist(floor, ground, j, i)
        if spare > 0.0 and under and zones[z, BOTTOM_AGL] > 0.0:
            return count
    for k in range(4):
        jj, ii = j + (k >> 1), i + ((k ^ (k >> 1)) & 1)
        g = ground[jj, ii]
        shut = level(zones, z, TOP, g) - min(floor[jj, ii] - excess[jj, ii], lid) - spare
        if under:
            bottom = level(zones, z, BOTTOM, g)
            shut = min(min(shut, floor[jj, ii] - bottom), level(zones, z, TOP, g) - bottom - zones[z, THIN] - spare)
        # The whole cell is inside if its corners are, so depth does not matter then.
        wall[k] = shut if least > 0.0 else min(shut, wall[k])
    return put(of, values, j * (excess.shape[1] - 1) + i, wall, count)


@device
def _meets(zones: Floats, z: int, x: Floats, y: Floats, j: int, i: int) -> bool:
    """Whether a disc reaches into the bounding box of a cell."""
    west, east = min(x[j, i], x[j + 1, i]), max(x[j, i + 1], x[j + 1, i + 1])
    south, north = min(y[j, i], y[j, i + 1]), max(y[j + 1, i], y[j + 1, i + 1])
    dx = zones[z, EAST] - min(max(zones[z, EAST], west), east)
    dy = zones[z, NORTH] - min(max(zones[z, NORTH], south), north)
    return dx * dx + dy * dy < zones[z, RADIUS] ** 2


@device
def _more_between(
    zones: Floats, edges: Floats, z: int, depths: Floats, deepest: float, shallowest: float, x: Floats, y: Floats,
    j: int, i: int,
) -> float:  # fmt: skip
    """How far, m, the depth at a place of a cell may exceed the linear value between its corners, for depth is concave.
    -inf if all of the cell surely lies outside."""
    dx, dy = x[j + 1, i + 1] - x[j, i], y[j + 1, i + 1] - y[j, i]
    square = dx * dx + dy * dy
    if zones[z, RADIUS] >= 0.0:
        more = square / (8.0 * max(zones[z, RADIUS] - math.sqrt(square), 0.5 * math.sqrt(square)))
        if deepest + more <= 0.0 and _meets(zones, z, x, y, j, i):
            more = 0.02 - deepest  # a disc that no corner lies near
        return more
    if zones[z, LAST] - zones[z, FIRST] <= 1.0 or shallowest >= 0.0:
        return 0.0
    most = 0.5 * math.sqrt(square)
    if deepest + most <= 0.0:
        return -np.inf
    return most if _is_kinked(zones, edges, z, depths, x, y, j, i) else 0.0


@device
def _is_kinked(zones: Floats, edges: Floats, z: int, depths: Floats, x: Floats, y: Floats, j: int, i: int) -> bool:
    """Whether the least of a zone's linear functions is not linear over a cell: no single edge binds at all four
    corners, whose ``depths`` are known."""
    for k in range(int(zones[z, FIRST]), int(zones[z, LAST])):
        alone = True
        for q in range(4):
            jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
            if within(edges, k, x[jj, ii], y[jj, ii]) > depths[q] + 1e-9:
                alone = False
                break
        if alone:
            return False
    return True
