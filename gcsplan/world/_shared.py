"""What kernels and Python share: tolerances, the places of numbers in arrays, and arrays that belong together."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats

TOUCH_M = 1e-6
"""Float noise: a limit that is broken by less is touched, and touching is legal."""

RESOLUTION_M = 0.005
"""Height to which the branch and bound resolves what lies within reach; what it cannot tell apart, it refuses."""

BOW_M = 0.05
"""A leg is mapped to the grid in parts whose plane-straight and grid-straight lines lie within this."""

# The map from the plane to the grid as one array, which is what kernels hand on: numbers by these places, then the
# constant, the u and the v coefficients, used alone where the map is affine, then all of them, highest power first.
AFFINE, CENTRE_E, CENTRE_N, PER_UNIT, HALF, BEND, ERROR_M, STEP_X, STEP_Y, LINEAR = range(10)
HORNER = LINEAR + 6

# A zone is a row of numbers by these places. Circle: east, north, radius in metres of the plane; a negative radius
# marks a polygon, whose vertices are those from FIRST up to LAST. Box: west, south, east, north. Floor and ceiling are
# above mean sea level, or above ground where the mark is not 0; -inf and inf where there is none. Band: the same above
# mean sea level, over all the ground that the zone stands on. Cells: first and last column, first and last row that
# the shape may touch.
EAST, NORTH, RADIUS, FIRST, LAST, WEST_E, SOUTH_N, EAST_E, NORTH_N = range(9)
FLOOR, FLOOR_AGL, CEILING, CEILING_AGL, BAND_LOW, BAND_HIGH, COL0, COL1, ROW0, ROW1 = range(9, 19)
ZONE_NUMBERS = 19

# What can be broken, by place in what `judge` says of a leg.
MIN_AGL, TERRAIN, MAX_AGL, MAX_AMSL, COVERAGE, CLIMB, DESCENT = range(7)


class Zones(NamedTuple):
    """The zones as arrays: ``table`` (n, `ZONE_NUMBERS`); ``vertex`` (v, 2) of all polygons, one after the other.

    ``lattice``: a coarse one, as west, south, 1 / side, columns, rows; ``bucket``, ``near``: the zones of each of its
    squares, ``near[bucket[k]:bucket[k + 1]]``. ``most_corners`` of any polygon.
    """

    table: Floats
    vertex: Floats
    lattice: Floats
    bucket: NDArray[np.int64]
    near: NDArray[np.int64]
    most_corners: int


class Halo(NamedTuple):
    """Bounds over the known cells within ``cols`` and ``rows`` of each cell, (rows - 1, cols - 1) float32.

    ``slope`` (rise over run) is ``inf`` in a cell that is itself unknown, and negative (its size is the slope) where
    an unknown cell, or the border, lies within. ``high`` and ``low`` are AMSL metres; all three are rounded outward.
    """

    slope: NDArray[np.float32]
    high: NDArray[np.float32]
    low: NDArray[np.float32]
    cols: int
    rows: int


class Demands(NamedTuple):
    """Limits for the kernel; ``inf`` is no limit. ``max_climb``, ``max_descent``: rise over run.

    ``clearance_m`` and track errors times ``scale`` are metres of the plane.
    """

    min_agl_m: float
    max_agl_m: float
    max_amsl_m: float
    clearance_m: float
    scale: float
    max_climb: float
    max_descent: float


def steps_of(a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """Metres of a column and of a row from d(east, north)/d(col, row), [[a, b], [c, d]]; skew is taken off both."""
    xx, yy, xy = a * a + c * c, b * b + d * d, abs(a * b + c * d)
    k = math.sqrt(xx / yy)
    return math.sqrt(max(xx - xy * k, 0.0)), math.sqrt(max(yy - xy / k, 0.0))
