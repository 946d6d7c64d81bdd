"""The bounds around each cell of a surface, in one pass over it: the kernel of `_neighbourhood`."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Int64s, Singles
from gcsplan.world.kernels.compiled import device, kernel
from gcsplan.world.kernels.shared import LEAST_SLOPE, MASK, SHIFT

SLOPE, HIGH, LOW, LOST = range(4)


@kernel("f8[,] f8 f8 i8 i8 i8[] f4[,,] f4[,,] f4[,,] f4[,,]")
def local_extrema(
    z: Floats, step_x: float, step_y: float, cols: int, rows: int, box: Int64s, room: Singles, slope: Singles,
    high: Singles, low: Singles,
) -> int:  # fmt: skip
    """Fill a ``box`` of a `LocalExtrema` of nodes ``z``: ``slope``, ``high``, ``low`` (strips, rows - 1, `STRIP`).

    ``box``: first row, end of rows, first column, end of columns. ``room``: work array for a block and the
    cells around it.
    """
    n, m = min(box[1], z.shape[0] - 1), min(box[3], z.shape[1] - 1)
    tall, wide = room.shape[0] - 2 * rows, room.shape[2] - 2 * cols
    for top in range(box[0], n, tall):
        height = min(tall, n - top)
        for left in range(box[2], m, wide):
            width = min(wide, m - left)
            far = width + 2 * cols
            any_lost = False
            for i in range(height + 2 * rows):
                if _look_at(z, step_x, step_y, top - rows + i, left - cols, far, room[i]):
                    any_lost = True
            fields = 4 if any_lost else 3
            for i in range(height):
                # Which cells are themselves unknown, before that is spread.
                lost = room[rows + i, LOST, cols:]
                for j in range(left, left + width):
                    slope[j >> SHIFT, top + i, j & MASK] = lost[j - left]
            for k in range(fields):
                for i in range(height + 2 * rows):
                    _spread_along(room[i, k], far, 2 * cols + 1)
                _spread_down(room, k, height + 2 * rows, width, 2 * rows + 1)
            for i in range(height):
                for k in range(left >> SHIFT, ((left + width - 1) >> SHIFT) + 1):
                    begin, end = max(k << SHIFT, left), min((k + 1) << SHIFT, left + width)
                    _put(
                        room[i], any_lost, slope[k, top + i], high[k, top + i], low[k, top + i], begin - left,
                        begin & MASK, end - begin,
                    )  # fmt: skip
    return 0


@device
def _look_at(z: Floats, step_x: float, step_y: float, row: int, left: int, count: int, into: Singles) -> bool:
    """Fill in steepest slope, highest and lowest (negated) node and unknown flag of ``count`` cells of a row.

    Return whether any is unknown. Beyond the border everything is unknown.
    """
    n, m = z.shape[0] - 1, z.shape[1] - 1
    slope, high, low, lost = into[SLOPE], into[HIGH], into[LOW], into[LOST]
    first, last = (max(-left, 0), min(m - left, count)) if 0 <= row < n else (count, count)
    for j in range(count):
        if j < first or j >= last:
            slope[j], high[j], low[j], lost[j] = 0.0, -np.inf, -np.inf, 1.0
    some = last - first < count
    if first >= last:
        return some
    a, b = z[row, left + first : left + last + 1], z[row + 1, left + first : left + last + 1]
    a1, b1 = a[1:], b[1:]
    slope, high, low, lost = slope[first:last], high[first:last], low[first:last], lost[first:last]
    per_x, per_y = 1.0 / step_x, 1.0 / step_y
    for j in range(last - first):
        nw, ne, sw, se = a[j], a1[j], b[j], b1[j]
        # The gradient of a bilinear patch is largest in a corner.
        across, across_south = abs(ne - nw), abs(se - sw)
        down, down_east = abs(sw - nw), abs(se - ne)
        across = (across if across > across_south else across_south) * per_x
        down = (down if down > down_east else down_east) * per_y
        slope[j] = math.sqrt(across * across + down * down) * (1.0 + 1e-6)
        most, most_south = ne if ne > nw else nw, se if se > sw else sw
        least, least_south = ne if ne < nw else nw, se if se < sw else sw
        most = most if most > most_south else most_south
        least = least if least < least_south else least_south
        high[j] = most + (1e-4 + 1e-6 * abs(most))
        low[j] = (1e-4 + 1e-6 * abs(least)) - least
        known = nw + ne + sw + se
        lost[j] = 0.0 if known == known else 1.0
    for j in range(last - first):
        if lost[j] != 0.0:
            slope[j], high[j], low[j] = 0.0, -np.inf, -np.inf
            some = True
    return some


@device
def _spread_along(line: Singles, count: int, window: int) -> None:
    """Replace each place by the greatest of the ``window`` places from it on, wherever there are that many."""
    done, left = 1, count
    while done < window:
        shift = min(done, window - done)
        left -= shift
        beside = line[shift:]
        for j in range(left):
            line[j] = line[j] if line[j] > beside[j] else beside[j]
        done += shift


@device
def _spread_down(room: Singles, k: int, count: int, width: int, window: int) -> None:
    """The same across rows, for field ``k``."""
    done, left = 1, count
    while done < window:
        shift = min(done, window - done)
        left -= shift
        for i in range(left):
            line, below = room[i, k], room[i + shift, k]
            for j in range(width):
                line[j] = line[j] if line[j] > below[j] else below[j]
        done += shift


@device
def _put(
    line: Singles, any_lost: bool, slope: Singles, high: Singles, low: Singles, first: int, left: int, width: int
) -> None:
    """Write ``width`` spread values from the ``first`` on to a strip's row, from its column ``left`` on.

    ``slope`` holds the flags of the cells that are themselves unknown.
    """
    of_slope, of_high, of_low, near = line[SLOPE, first:], line[HIGH, first:], line[LOW, first:], line[LOST, first:]
    slope, high, low = slope[left : left + width], high[left : left + width], low[left : left + width]
    for j in range(width):
        high[j] = of_high[j]
        low[j] = -of_low[j]
    if not any_lost:
        for j in range(width):
            slope[j] = of_slope[j] if of_slope[j] > LEAST_SLOPE else LEAST_SLOPE
        return
    for j in range(width):
        if slope[j] != 0.0:
            slope[j] = np.inf
        elif near[j] != 0.0:
            slope[j] = -of_slope[j] - np.float32(1e-9)
        else:
            slope[j] = of_slope[j] if of_slope[j] > LEAST_SLOPE else LEAST_SLOPE
