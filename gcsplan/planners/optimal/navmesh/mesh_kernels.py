"""Kernels that cut the free part of a plane into convex pieces and find the portals between them.

Nodes lie on a lattice, each with an *excess*: the plane is free where the excess is not above 0. A cell is two
triangles. In each, the excess is linear, and so are the *walls* that the cell has of its own (zones); therefore the
part of a triangle that all of them leave free is convex. Wholly free cells are joined along their row into one long
piece, a *run*; runs end where the lattice bends (every ``block`` columns), so that every piece is convex.

Only the portals are stored, the parts of edges that two pieces share: where there is no portal, there is a wall.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Bools, Floats, Int8s, Int32s, Int64s
from gcsplan.planners.compiled import device, kernel

OPEN = -1e-9
"""Excess, m, above which a wall may stand at a node; a node with less is free all around."""

NEXT, WALL = 4, 5
"""Column of a wall's row with the number of the cell's next wall (0 after its last), and the length of such a row."""


@device
def _cut(p: float, q: float, t: Floats) -> bool:
    """Shrink the part ``t`` of an edge to where a linear function, p at 0 and q at 1, is not above 0; return whether
    anything remains."""
    if p > 0.0:
        if q > 0.0:
            return False
        t[0] = max(t[0], p / (p - q))
    elif q > 0.0:
        t[1] = min(t[1], p / (p - q))
    return t[1] >= t[0]


@device
def _cut_own(of: Int32s, values: Floats, k: int, start: int, end: int, t: Floats) -> bool:
    """Shrink the part ``t`` of an edge of cell k, from corner ``start`` to corner ``end``, to where none of the cell's
    own walls stands; return whether anything remains."""
    n = of[k]
    while n > 0:
        if not _cut(values[n - 1, start], values[n - 1, end], t):
            return False
        n = int(values[n - 1, NEXT])
    return True


@kernel("f8[,] i4[] f8[,] i1[] i4[,] i4[,] i4[,] i8 b1[]")
def make_pieces(
    excess: Floats, of: Int32s, values: Floats, diagonal: Int8s, around: Int32s, span: Int32s, piece: Int32s,
    block: int, alone: Bools,
) -> int:  # fmt: skip
    """Number the pieces in ``piece`` (cells, 2: lower and upper triangle, -1 where nothing is free); return how many.

    ``span`` (rows - 1, 2): first column, and that after the last, of the cells of a row that may be free; ``around``:
    see `clearance_kernels.blank`. ``of`` (cells,): number, from 1, of the row in ``values`` (K, 5) of a cell's first
    own wall; 0: it has none. Such a row holds the wall's excess at this node, at the one in the next column, in the
    next column and row, and in the next row, and the number of the cell's next wall. ``diagonal`` (cells,): 0 cuts a
    cell from this node to the opposite one, 1 along the other diagonal. ``block``: columns after which a run ends.
    ``alone`` (cells,): cells that are no part of a run; empty if there are none.
    """
    count = 0
    ny, nx = excess.shape
    for j in range(ny - 1):
        for i in range(around[j, 0], min(around[j, 1], nx - 1)):
            piece[j * (nx - 1) + i, 0] = piece[j * (nx - 1) + i, 1] = -1
    for j in range(ny - 1):
        running = False
        for i in range(span[j, 0], span[j, 1]):
            k = j * (nx - 1) + i
            a, b, c, d = excess[j, i], excess[j, i + 1], excess[j + 1, i + 1], excess[j + 1, i]
            whole = lower = upper = True
            n = of[k]
            while True:
                if not (a <= 0.0 and b <= 0.0 and c <= 0.0 and d <= 0.0):
                    whole = False
                    # Infinite or NaN excess means unknown ground: the whole cell is shut.
                    known = a < np.inf and b < np.inf and c < np.inf and d < np.inf
                    lower = lower and known and min(a, min(b, c if diagonal[k] == 0 else d)) < 0.0
                    upper = upper and known and min(c, min(d, a if diagonal[k] == 0 else b)) < 0.0
                if n == 0:
                    break
                a, b, c, d = values[n - 1, 0], values[n - 1, 1], values[n - 1, 2], values[n - 1, 3]
                n = int(values[n - 1, NEXT])
            if whole:
                apart = len(alone) > 0 and alone[k]
                if not running or i % block == 0 or apart:
                    count += 1
                    running = not apart
                piece[k, 0] = piece[k, 1] = count - 1
                continue
            running = False
            for half in range(2):
                if lower if half == 0 else upper:
                    piece[k, half] = count
                    count += 1
    return count


@device
def _side(piece: Int32s, diagonal: Int8s, k: int, right: bool) -> int:
    """The piece at the right side of a cell, or at the left (not ``right``)."""
    return piece[k, 0 if (diagonal[k] == 0) == right else 1]


@device
def _put(
    ends: Floats, names: Int64s, joins: Int32s, n: int, room: int, x0: float, y0: float, x1: float, y1: float,
    v0: int, v1: int, left: int, right: int,
) -> int:  # fmt: skip
    """Store portal n, from (x0, y0) to (x1, y1), with the pieces at its left and right, if there is room; return
    n + 1."""
    if n < room:
        ends[n, 0], ends[n, 1], ends[n, 2], ends[n, 3] = x0, y0, x1, y1
        names[n, 0], names[n, 1] = v0, v1
        joins[n, 0], joins[n, 1] = left, right
    return n + 1


@device
def stands(of: Int32s, values: Floats, cell: int, corner: int, above: float) -> bool:
    """Whether one of a cell's own walls exceeds ``above`` at a corner."""
    n = of[cell]
    while n > 0:
        if values[n - 1, corner] > above:
            return True
        n = int(values[n - 1, NEXT])
    return False


@device
def _is_corner(excess: Floats, of: Int32s, values: Floats, piece: Int32s, nx: int, ny: int, j: int, i: int) -> bool:
    """Whether a node may lie on a wall or touches something that is not free, so that a track may turn there."""
    if i == 0 or j == 0 or i == nx - 1 or j == ny - 1 or excess[j, i] > OPEN:
        return True
    for k in range(4):
        c = (j - (k >> 1)) * (nx - 1) + i - ((k ^ (k >> 1)) & 1)
        if (piece[c, 0] < 0 and piece[c, 1] < 0) or stands(of, values, c, k, OPEN):
            return True
    return False


@device
def _name(excess: Floats, of: Int32s, values: Floats, piece: Int32s, j: int, i: int) -> int:
    """A node's name; negative where no wall can stand, so that no track turns there."""
    ny, nx = excess.shape
    name = 8 * (j * nx + i)
    return name if _is_corner(excess, of, values, piece, nx, ny, j, i) else -1 - name


@kernel("f8[,] i4[] f8[,] i1[] i4[,] i4[,] f8[,] f8[,] f8[,] i8[,] i4[,] f8[]")
def make_portals(
    excess: Floats, of: Int32s, values: Floats, diagonal: Int8s, span: Int32s, piece: Int32s,
    x: Floats, y: Floats, ends: Floats, names: Int64s, joins: Int32s, t: Floats,
) -> int:  # fmt: skip
    """Find every portal once: ``ends`` (room, 4) from x, y to x, y; ``names`` (room, 2) of its ends; ``joins``
    (room, 2) the pieces at its left and right. Returns how many there are, of which only the first ``room`` are stored.

    A name is unique to a place. It is not negative if a wall may stand there, so that a track may turn. ``t`` (2,) is
    a work array.
    """
    n = 0
    ny, nx = excess.shape
    room = len(ends)
    for j in range(ny):
        # Portals along row j of nodes, between pieces below it (row j - 1 of cells) and above it (row j).
        x0 = y0 = was_t = 0.0
        v0 = was = 0
        was_below = was_above = -1
        first = last = 0
        if 0 < j < ny - 1:
            first, last = max(span[j - 1, 0], span[j, 0]), min(span[j - 1, 1], span[j, 1])
        for i in range(first, last + 1):
            below = above = kb = ka = -1
            found = False
            if i < last:
                kb, ka = (j - 1) * (nx - 1) + i, j * (nx - 1) + i
                below, above = piece[kb, 1], piece[ka, 0]
                if below >= 0 and above >= 0:
                    t[0], t[1] = 0.0, 1.0
                    found = _cut(excess[j, i], excess[j, i + 1], t)
                    found = found and _cut_own(of, values, kb, 3, 2, t)
                    found = found and _cut_own(of, values, ka, 0, 1, t)
            goes_on = found and was_t == 1.0 and t[0] == 0.0 and below == was_below and above == was_above
            if was_below >= 0 and not goes_on:
                x1 = x[j, was] + was_t * (x[j, was + 1] - x[j, was])
                y1 = y[j, was] + was_t * (y[j, was + 1] - y[j, was])
                v1 = 8 * (j * nx + was) + 2
                if was_t == 1.0:
                    v1 = _name(excess, of, values, piece, j, was + 1)
                n = _put(ends, names, joins, n, room, x0, y0, x1, y1, v0, v1, was_above, was_below)
                was_below = -1
            if found:
                if not goes_on:
                    x0, y0 = x[j, i] + t[0] * (x[j, i + 1] - x[j, i]), y[j, i] + t[0] * (y[j, i + 1] - y[j, i])
                    v0 = 8 * (j * nx + i) + 1
                    if t[0] == 0.0:
                        v0 = _name(excess, of, values, piece, j, i)
                was, was_below, was_above, was_t = i, below, above, t[1]
        if j == ny - 1:
            break
        # Portals within row j of cells: sides and diagonals.
        for i in range(span[j, 0], span[j, 1]):
            k = j * (nx - 1) + i
            if i > 0:
                left = _side(piece, diagonal, k - 1, True)
                right = _side(piece, diagonal, k, False)
                t[0], t[1] = 0.0, 1.0
                if (
                    left >= 0 and right >= 0 and left != right and _cut(excess[j, i], excess[j + 1, i], t)
                    and _cut_own(of, values, k - 1, 1, 2, t) and _cut_own(of, values, k, 0, 3, t)
                ):  # fmt: skip
                    edge = 8 * (j * nx + i)
                    v0, v1 = edge + 3, edge + 4
                    if t[0] == 0.0:
                        v0 = _name(excess, of, values, piece, j, i)
                    if t[1] == 1.0:
                        v1 = _name(excess, of, values, piece, j + 1, i)
                    dx, dy = x[j + 1, i] - x[j, i], y[j + 1, i] - y[j, i]
                    n = _put(
                        ends, names, joins, n, room, x[j, i] + t[0] * dx, y[j, i] + t[0] * dy,
                        x[j, i] + t[1] * dx, y[j, i] + t[1] * dy, v0, v1, left, right,
                    )  # fmt: skip
            lower, upper = piece[k, 0], piece[k, 1]
            if lower >= 0 and upper >= 0 and lower != upper:
                # The lower triangle lies at the right of the diagonal, seen from the lower row.
                i0, i1 = (i, i + 1) if diagonal[k] == 0 else (i + 1, i)
                c0, c1 = (0, 2) if diagonal[k] == 0 else (1, 3)
                t[0], t[1] = 0.0, 1.0
                if _cut(excess[j, i0], excess[j + 1, i1], t) and _cut_own(of, values, k, c0, c1, t):
                    edge = 8 * (j * nx + i)
                    v0, v1 = edge + 5, edge + 6
                    if t[0] == 0.0:
                        v0 = _name(excess, of, values, piece, j, i0)
                    if t[1] == 1.0:
                        v1 = _name(excess, of, values, piece, j + 1, i1)
                    dx, dy = x[j + 1, i1] - x[j, i0], y[j + 1, i1] - y[j, i0]
                    left, right = (upper, lower) if diagonal[k] == 0 else (lower, upper)
                    n = _put(
                        ends, names, joins, n, room, x[j, i0] + t[0] * dx, y[j, i0] + t[0] * dy,
                        x[j, i0] + t[1] * dx, y[j, i0] + t[1] * dy, v0, v1, left, right,
                    )  # fmt: skip
    return n


@kernel("i4[,] i4[] i4[]")
def sort_portals(
    joins: Int32s,
    start: Int32s,
    order: Int32s,
) -> None:
    """List the portals of each piece p in ``order`` (2 N,), at start[p] : start[p + 1]; ``start`` (pieces + 1,) must
    be zeros."""
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


@kernel("i4[,] f8[] i8 i4[,] i4[,] i8 i8 i8 i8 f8[]")
def least_of_cells(
    piece: Int32s, value: Floats, cols: int, fine_piece: Int32s, fine_span: Int32s, fine_cols: int, ratio: int,
    row: int, col: int, out: Floats,
) -> None:  # fmt: skip
    """Find, for each piece of a finer mesh, the least value of the coarse pieces in its cells (``out``, inf before).

    ``cols``, ``fine_cols``: cells in a row; ``ratio``: fine cells along a side of a coarse one; ``row``, ``col``: the
    coarse cell at which the finer mesh begins.
    """
    for q in range(len(fine_span)):
        j = q // ratio + row
        if not 0 <= j < len(piece) // cols:
            continue
        least, known = np.inf, -1
        for p in range(fine_span[q, 0], fine_span[q, 1]):
            i = p // ratio + col
            if not 0 <= i < cols:
                continue
            if i != known:
                least, known = np.inf, i
                for half in range(2):
                    if piece[j * cols + i, half] >= 0:
                        least = min(least, value[piece[j * cols + i, half]])
            for half in range(2):
                n = fine_piece[q * fine_cols + p, half]
                if n >= 0 and least < out[n]:
                    out[n] = least


@kernel("i4[,] f8[] f8[]")
def least_of_portals(joins: Int32s, met: Floats, entered: Floats) -> None:
    """Find the least value ``met`` of each piece's portals (``entered``, inf before)."""
    for n in range(len(joins)):
        for k in range(2):
            p = joins[n, k]
            if met[n] < entered[p]:
                entered[p] = met[n]


@kernel("i4[,] f8[] f8[] f8 b1[] i4[,] b1[]")
def within(
    joins: Int32s, from_start: Floats, from_goal: Floats, limit: float, met: Bools, piece: Int32s,
    out: Bools,
) -> None:  # fmt: skip
    """Mark the cells (``out``, all false before) of pieces that tracks no longer than ``limit`` may enter: pieces at
    portals that such tracks meet, and pieces where ``met`` (pieces,) is true before, at both ends of the tracks."""
    for n in range(len(joins)):
        if from_start[n] + from_goal[n] <= limit:
            met[joins[n, 0]] = met[joins[n, 1]] = True
    for k in range(len(piece)):
        for half in range(2):
            if piece[k, half] >= 0 and met[piece[k, half]]:
                out[k] = True


@kernel("i4[,] f8[] f8[,] f8[,] f8 f8 f8 b1[,]")
def in_reach(
    piece: Int32s, entered: Floats, x: Floats, y: Floats, at_x: float, at_y: float, limit: float, out: Bools
) -> None:
    """Mark the cells (``out``, all false before) for which ``entered`` of their pieces plus the straight distance from
    the cell to the place (``at_x``, ``at_y``) is at most ``limit``."""
    ny, nx = x.shape
    for j in range(ny - 1):
        for i in range(nx - 1):
            k = j * (nx - 1) + i
            least = np.inf
            for half in range(2):
                if piece[k, half] >= 0:
                    least = min(least, entered[piece[k, half]])
            if least < np.inf:
                wide = 0.0
                middle_x = 0.25 * (x[j, i] + x[j, i + 1] + x[j + 1, i] + x[j + 1, i + 1])
                middle_y = 0.25 * (y[j, i] + y[j, i + 1] + y[j + 1, i] + y[j + 1, i + 1])
                for q in range(4):
                    jj, ii = j + (q >> 1), i + (q & 1)
                    wide = max(wide, math.sqrt((x[jj, ii] - middle_x) ** 2 + (y[jj, ii] - middle_y) ** 2))
                straight = math.sqrt((middle_x - at_x) ** 2 + (middle_y - at_y) ** 2) - wide
                out[j, i] = least + straight <= limit
