"""The free part of a plane, cut into convex pieces and the portals between them.

Nodes lie on a lattice, each with an *excess*: the plane is free where the excess is not above 0. A cell is two
triangles, the excess is linear in each, so the free part of a triangle is a triangle or a quadrangle with straight
edges. Cells that are free as a whole are joined along their row into one long piece, a *run*; runs end where the
lattice bends (every ``block`` columns), so that every piece is convex.

Only the portals are kept, the parts of edges that two pieces share: walls are where none is.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.compiled import device, digest, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SOURCES = digest("compiled.py", "_mesh.py")

OPEN = -1e-9
"""A node with less excess than this is free all around."""


@device
def _free(a: float, b: float, c: float, d: float, t: Floats) -> bool:
    """The part of an edge where two linear functions, a to b and c to d over 0 to 1, are both not above 0."""
    lo, hi = 0.0, 1.0
    for k in range(2):
        p, q = (a, b) if k == 0 else (c, d)
        if p > 0.0:
            if q > 0.0:
                return False
            lo = max(lo, p / (p - q))
        elif q > 0.0:
            hi = min(hi, p / (p - q))
    t[0], t[1] = lo, hi
    return hi >= lo


@device
def _corner(excess: Floats, of: Ints, values: Floats, nx: int, j: int, i: int, k: int) -> float:
    """Excess at corner ``k`` (0: this node, 1: next column, 2: next column and row, 3: next row) of cell (j, i)."""
    n = of[j * (nx - 1) + i]
    if n > 0:
        return values[n - 1, k]
    return excess[j + (k >> 1), i + ((k ^ (k >> 1)) & 1)]


@kernel
def make_pieces(
    excess: Floats, of: Ints, values: Floats, diagonal: NDArray[np.int8], piece: Ints, block: int,
    sources: str = SOURCES,
) -> int:  # fmt: skip
    """Number the pieces: ``piece`` (cells, 2), the lower and the upper triangle's, -1 where nothing is free.

    ``of`` (cells,) number from 1 of the row in ``values`` (K, 4) of a cell that has corner values of its own, or 0;
    ``diagonal`` (cells,) 0 from this node to the opposite one, 1 the other.
    """
    ny, nx = excess.shape
    count = 0
    for j in range(ny - 1):
        running = False
        for i in range(nx - 1):
            k = j * (nx - 1) + i
            a = _corner(excess, of, values, nx, j, i, 0)
            b = _corner(excess, of, values, nx, j, i, 1)
            c = _corner(excess, of, values, nx, j, i, 2)
            d = _corner(excess, of, values, nx, j, i, 3)
            if a <= 0.0 and b <= 0.0 and c <= 0.0 and d <= 0.0:
                if not running or i % block == 0:
                    count += 1
                    running = True
                piece[k, 0] = piece[k, 1] = count - 1
                continue
            running = False
            piece[k, 0] = piece[k, 1] = -1
            # Infinite excess is unknown ground: the whole cell is shut.
            if max(max(a, b), max(c, d)) == np.inf:
                continue
            low = min(a, min(b, c if diagonal[k] == 0 else d))
            high = min(c, min(d, a if diagonal[k] == 0 else b))
            for half in range(2):
                if (low if half == 0 else high) < 0.0:
                    piece[k, half] = count
                    count += 1
    return count


@device
def _side(piece: Ints, diagonal: NDArray[np.int8], k: int, right: bool) -> int:
    """The piece at the left or right side of a cell."""
    return piece[k, 0 if (diagonal[k] == 0) == right else 1]


@device
def _put(
    ends: Floats, names: NDArray[np.int64], joins: Ints, n: int, room: int, x0: float, y0: float, x1: float, y1: float,
    v0: int, v1: int, left: int, right: int,
) -> int:  # fmt: skip
    """Keep a portal from (x0, y0) to (x1, y1) with one piece at its left and one at its right."""
    if n < room:
        ends[n, 0], ends[n, 1], ends[n, 2], ends[n, 3] = x0, y0, x1, y1
        names[n, 0], names[n, 1] = v0, v1
        joins[n, 0], joins[n, 1] = left, right
    return n + 1


@device
def _is_corner(
    excess: Floats, of: Ints, values: Floats, piece: Ints, diagonal: NDArray[np.int8], nx: int, ny: int, j: int, i: int
) -> bool:
    """Whether a node may lie on a wall: something around it is not free."""
    if i == 0 or j == 0 or i == nx - 1 or j == ny - 1:
        return True
    for k in range(4):
        jj, ii = j - (k >> 1), i - ((k ^ (k >> 1)) & 1)
        c = jj * (nx - 1) + ii
        if piece[c, 0] < 0 and piece[c, 1] < 0:
            return True
        if _corner(excess, of, values, nx, jj, ii, k) > OPEN:
            return True
    return False


@kernel
def make_portals(
    excess: Floats, of: Ints, values: Floats, diagonal: NDArray[np.int8], piece: Ints, x: Floats, y: Floats, block: int,
    ends: Floats, names: NDArray[np.int64], joins: Ints, t: Floats, sources: str = SOURCES,
) -> int:  # fmt: skip
    """Every portal once: ``ends`` (room, 4) from x, y to x, y; ``names`` (room, 2) of its ends; ``joins`` (room, 2)
    the pieces at its left and right. Returns how many there are; room for fewer is filled.

    A name is unique to a place; it is not negative if a wall may stand there, so that a path may turn.
    """
    ny, nx = excess.shape
    room, n = len(ends), 0
    for j in range(ny):
        # Along the row: pieces below (row j - 1) and above (row j).
        x0 = y0 = x1 = y1 = 0.0
        v0 = v1 = 0
        was_below = was_above = -1
        whole = False
        for i in range(nx):
            below = above = -1
            found = False
            if 0 < j < ny - 1 and i < nx - 1:
                kb, ka = (j - 1) * (nx - 1) + i, j * (nx - 1) + i
                below, above = piece[kb, 1], piece[ka, 0]
                if below >= 0 and above >= 0:
                    found = _free(
                        _corner(excess, of, values, nx, j - 1, i, 3), _corner(excess, of, values, nx, j - 1, i, 2),
                        _corner(excess, of, values, nx, j, i, 0), _corner(excess, of, values, nx, j, i, 1), t,
                    )  # fmt: skip
            goes_on = found and whole and t[0] == 0.0 and below == was_below and above == was_above
            if was_below >= 0 and not goes_on:
                n = _put(ends, names, joins, n, room, x0, y0, x1, y1, v0, v1, was_above, was_below)
                was_below = -1
            if found:
                edge = 8 * (j * nx + i)
                if not goes_on:
                    x0, y0 = x[j, i] + t[0] * (x[j, i + 1] - x[j, i]), y[j, i] + t[0] * (y[j, i + 1] - y[j, i])
                    v0 = edge + 1
                    if t[0] == 0.0:
                        v0 = edge
                        if not _is_corner(excess, of, values, piece, diagonal, nx, ny, j, i):
                            v0 = -1 - v0
                x1, y1 = x[j, i] + t[1] * (x[j, i + 1] - x[j, i]), y[j, i] + t[1] * (y[j, i + 1] - y[j, i])
                v1 = edge + 2
                if t[1] == 1.0:
                    v1 = edge + 8
                    if not _is_corner(excess, of, values, piece, diagonal, nx, ny, j, i + 1):
                        v1 = -1 - v1
                was_below, was_above, whole = below, above, t[1] == 1.0
        if j == ny - 1:
            break
        # Within the row: sides and diagonals of its cells.
        for i in range(nx - 1):
            k = j * (nx - 1) + i
            if i > 0:
                left, right = _side(piece, diagonal, k - 1, True), _side(piece, diagonal, k, False)
                if (
                    left >= 0 and right >= 0 and left != right
                    and _free(
                        _corner(excess, of, values, nx, j, i - 1, 1), _corner(excess, of, values, nx, j, i - 1, 2),
                        _corner(excess, of, values, nx, j, i, 0), _corner(excess, of, values, nx, j, i, 3), t,
                    )
                ):  # fmt: skip
                    edge, beyond = 8 * (j * nx + i), 8 * ((j + 1) * nx + i)
                    v0, v1 = edge + 3, edge + 4
                    if t[0] == 0.0:
                        v0 = edge if _is_corner(excess, of, values, piece, diagonal, nx, ny, j, i) else -1 - edge
                    if t[1] == 1.0:
                        v1 = beyond
                        if not _is_corner(excess, of, values, piece, diagonal, nx, ny, j + 1, i):
                            v1 = -1 - beyond
                    dx, dy = x[j + 1, i] - x[j, i], y[j + 1, i] - y[j, i]
                    n = _put(
                        ends, names, joins, n, room, x[j, i] + t[0] * dx, y[j, i] + t[0] * dy,
                        x[j, i] + t[1] * dx, y[j, i] + t[1] * dy, v0, v1, left, right,
                    )  # fmt: skip
            if piece[k, 0] >= 0 and piece[k, 1] >= 0 and piece[k, 0] != piece[k, 1]:
                # The lower triangle lies at the right of the diagonal, seen from the lower row.
                i0, i1 = (i, i + 1) if diagonal[k] == 0 else (i + 1, i)
                c0, c1 = (0, 2) if diagonal[k] == 0 else (1, 3)
                p, q = _corner(excess, of, values, nx, j, i, c0), _corner(excess, of, values, nx, j, i, c1)
                if _free(p, q, p, q, t):
                    edge = 8 * (j * nx + i)
                    v0, v1 = edge + 5, edge + 6
                    if t[0] == 0.0:
                        v0 = 8 * (j * nx + i0)
                        if not _is_corner(excess, of, values, piece, diagonal, nx, ny, j, i0):
                            v0 = -1 - v0
                    if t[1] == 1.0:
                        v1 = 8 * ((j + 1) * nx + i1)
                        if not _is_corner(excess, of, values, piece, diagonal, nx, ny, j + 1, i1):
                            v1 = -1 - v1
                    dx, dy = x[j + 1, i1] - x[j, i0], y[j + 1, i1] - y[j, i0]
                    left, right = (piece[k, 1], piece[k, 0]) if diagonal[k] == 0 else (piece[k, 0], piece[k, 1])
                    n = _put(
                        ends, names, joins, n, room, x[j, i0] + t[0] * dx, y[j, i0] + t[0] * dy,
                        x[j, i0] + t[1] * dx, y[j, i0] + t[1] * dy, v0, v1, left, right,
                    )  # fmt: skip
    return n


@kernel
def sort_portals(joins: Ints, start: Ints, order: Ints, sources: str = SOURCES) -> None:
    """``order`` (2 N,) the portals of piece p at start[p] : start[p + 1]; ``start`` (pieces + 1,) is zeros."""
    pieces = len(start) - 1
    for n in range(len(joins)):
        for k in range(2):
            start[joins[n, k]] += 1
    total = 0
    for p in range(pieces):
        total += start[p]
        start[p] = total
    start[pieces] = total
    for n in range(len(joins)):
        for k in range(2):
            p = joins[n, k]
            start[p] -= 1
            order[start[p]] = n


@kernel
def least_of_cells(
    piece: Ints, value: Floats, cols: int, fine_piece: Ints, fine_cols: int, ratio: int, out: Floats,
    sources: str = SOURCES,
) -> None:  # fmt: skip
    """For each piece of a finer mesh (``out``, inf before) the least value of the coarse pieces in its cells.

    ``cols``, ``fine_cols``: cells in a row; both lattices begin at the same node.
    """
    for k in range(len(fine_piece)):
        if fine_piece[k, 0] < 0 and fine_piece[k, 1] < 0:
            continue
        j, i = (k // fine_cols) // ratio, (k % fine_cols) // ratio
        least = np.inf
        for half in range(2):
            if piece[j * cols + i, half] >= 0:
                least = min(least, value[piece[j * cols + i, half]])
        for half in range(2):
            p = fine_piece[k, half]
            if p >= 0 and least < out[p]:
                out[p] = least


EAST, NORTH, RADIUS, BOTTOM, TOP, BOTTOM_AGL, TOP_AGL, FIRST, LAST, UNDER = range(10)
PAIR, BOTTOM_2, TOP_2, BOTTOM_2_AGL, TOP_2_AGL, UNDER_2, NUMBERS = range(10, 17)


@device
def _depth(zones: Floats, edges: Floats, z: int, x: float, y: float) -> float:
    """How far a point is inside a zone's convex shape: concave, above 0 inside."""
    if zones[z, RADIUS] >= 0.0:
        return zones[z, RADIUS] - math.sqrt((x - zones[z, EAST]) ** 2 + (y - zones[z, NORTH]) ** 2)
    depth = np.inf
    for k in range(int(zones[z, FIRST]), int(zones[z, LAST])):
        depth = min(depth, _within(edges, k, x, y))
    return depth


@device
def _within(edges: Floats, k: int, x: float, y: float) -> float:
    """How far a point is inside a disc or a half-plane."""
    if edges[k, 3] > 0.0:
        return edges[k, 0] - math.sqrt((x - edges[k, 1]) ** 2 + (y - edges[k, 2]) ** 2)
    return edges[k, 0] - edges[k, 1] * x - edges[k, 2] * y


@device
def _level(zones: Floats, z: int, level: int, ground: float) -> float:
    """A level of a zone where the ground is so high; its datum is told two numbers further on."""
    return zones[z, level] + (ground if zones[z, level + 2] > 0.0 else 0.0)


@device
def _open(zones: Floats, z: int, floor: float, allowed: float, ground: float) -> bool:
    """Whether there is an altitude to fly at, over a zone, under it, or between the two of a pair."""
    bottom, top = _level(zones, z, BOTTOM, ground), _level(zones, z, TOP, ground)
    if zones[z, PAIR] == 0.0:
        return top <= allowed or (zones[z, UNDER] > 0.0 and floor <= bottom)
    bottom_2, top_2 = _level(zones, z, BOTTOM_2, ground), _level(zones, z, TOP_2, ground)
    under, under_2 = zones[z, UNDER] > 0.0, zones[z, UNDER_2] > 0.0
    if max(top, top_2) <= allowed or (under and under_2 and floor <= min(bottom, bottom_2)):
        return True
    if under_2 and top <= min(bottom_2, allowed) and floor <= bottom_2:
        return True
    return under and top_2 <= min(bottom, allowed) and floor <= bottom


@kernel
def stamp_zones(
    excess: Floats, floor: Floats, ground: Floats, x: Floats, y: Floats, zones: Floats, edges: Floats, boxes: Ints,
    low: bool, of: Ints, values: Floats, sources: str = SOURCES,
) -> int:  # fmt: skip
    """Give cells that zones shut corner values of their own: how deep in the shape they lie. Returns how many.

    ``zones`` (Z, NUMBERS), ``boxes`` (Z, 4) first and last column and row of the cells that each may touch. ``low``: only
    what is shut for certain (of several zones, and ground, the one that shuts most); else all that may be shut.
    """
    nx = excess.shape[1]
    count = 0
    for z in range(len(zones)):
        for j in range(boxes[z, 2], boxes[z, 3] + 1):
            for i in range(boxes[z, 0], boxes[z, 1] + 1):
                deepest, shallowest = -np.inf, np.inf
                ways = 0
                for k in range(4):
                    jj, ii = j + (k >> 1), i + ((k ^ (k >> 1)) & 1)
                    g = _depth(zones, edges, z, x[jj, ii], y[jj, ii])
                    deepest, shallowest = max(deepest, g), min(shallowest, g)
                    if _open(zones, z, floor[jj, ii], floor[jj, ii] - excess[jj, ii], ground[jj, ii]):
                        ways += 1
                if ways == 4:
                    continue
                if shallowest > 0.0 and zones[z, PAIR] == 0.0 and zones[z, UNDER] == 0.0 and zones[z, TOP] < np.inf:
                    # The whole cell is under a lid, which is what must be flown over: bilinear, as ground is.
                    count = _lid(excess, floor, ground, zones, z, low, of, values, j, i, count)
                    continue
                if low and ways > 0:
                    continue
                dx, dy = x[j + 1, i + 1] - x[j, i], y[j + 1, i + 1] - y[j, i]
                square = dx * dx + dy * dy
                more = 0.0
                if not low:
                    # A linear function under a concave one: by so much it may be too low between the corners.
                    more = 0.02
                    if zones[z, RADIUS] >= 0.0:
                        more += square / (8.0 * max(zones[z, RADIUS] - math.sqrt(square), 0.5 * math.sqrt(square)))
                    elif zones[z, LAST] - zones[z, FIRST] > 1.0 and shallowest < 0.0:
                        more += _kink(zones, edges, z, x, y, j, i)
                    if zones[z, RADIUS] >= 0.0 and deepest + more <= 0.0 and _meets(zones, z, x, y, j, i):
                        more = 0.02 - deepest  # a disc that no corner lies near
                if deepest + more <= 0.0:
                    continue
                k = j * (nx - 1) + i
                n = of[k]
                if n == 0:
                    count += 1
                    n = of[k] = count
                    for q in range(4):
                        values[n - 1, q] = excess[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)]
                was = now = 0.0
                for q in range(4):
                    g = more + _depth(zones, edges, z, x[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)],
                                      y[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)])  # fmt: skip
                    if not low:
                        values[n - 1, q] = max(values[n - 1, q], g)
                    was += 1e6 if values[n - 1, q] > 0.0 else 0.0
                    was += min(max(values[n - 1, q], -1e3), 1e3)
                    now += (1e6 if g > 0.0 else 0.0) + min(max(g, -1e3), 1e3)
                if low and now > was:
                    for q in range(4):
                        values[n - 1, q] = _depth(zones, edges, z, x[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)],
                                                  y[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)])  # fmt: skip
    return count


@device
def _lid(
    excess: Floats, floor: Floats, ground: Floats, zones: Floats, z: int, low: bool, of: Ints, values: Floats,
    j: int, i: int, count: int,
) -> int:  # fmt: skip
    """Give a cell the excess of a zone's ceiling where that is above the floor; returns how many cells have their own."""
    k = j * (excess.shape[1] - 1) + i
    more = 0
    for q in range(4):
        jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
        if _level(zones, z, TOP, ground[jj, ii]) > floor[jj, ii]:
            more += 1
    n = of[k]
    if more == 0 or (low and (more < 4 or n > 0)):
        return count
    if n == 0:
        count += 1
        n = of[k] = count
        for q in range(4):
            values[n - 1, q] = excess[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)]
    for q in range(4):
        jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
        values[n - 1, q] = max(values[n - 1, q], _level(zones, z, TOP, ground[jj, ii]) - floor[jj, ii] + excess[jj, ii])
    return count


@device
def _meets(zones: Floats, z: int, x: Floats, y: Floats, j: int, i: int) -> bool:
    """Whether a disc reaches into the box around a cell."""
    west, east = min(x[j, i], x[j + 1, i]), max(x[j, i + 1], x[j + 1, i + 1])
    south, north = min(y[j, i], y[j, i + 1]), max(y[j + 1, i], y[j + 1, i + 1])
    dx = zones[z, EAST] - min(max(zones[z, EAST], west), east)
    dy = zones[z, NORTH] - min(max(zones[z, NORTH], south), north)
    return dx * dx + dy * dy < zones[z, RADIUS] ** 2


@device
def _kink(zones: Floats, edges: Floats, z: int, x: Floats, y: Floats, j: int, i: int) -> float:
    """How much the least of several linear functions may rise between a cell's corners above its interpolation."""
    most = 0.0
    for k in range(int(zones[z, FIRST]), int(zones[z, LAST])):
        # Where one edge alone binds at all four corners, the function is linear: nothing to add.
        alone = True
        for q in range(4):
            jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
            own = _within(edges, k, x[jj, ii], y[jj, ii])
            if own > _depth(zones, edges, z, x[jj, ii], y[jj, ii]) + 1e-9:
                alone = False
        if alone:
            return 0.0
        most = 1.0
    dx, dy = x[j + 1, i + 1] - x[j, i], y[j + 1, i + 1] - y[j, i]
    return 0.5 * math.sqrt(dx * dx + dy * dy) * most
