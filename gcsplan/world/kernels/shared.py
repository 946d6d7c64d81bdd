"""Definitions shared by kernels and Python: tolerances, indices of numbers in arrays, and named groups of arrays."""

from __future__ import annotations

import math
from typing import NamedTuple

from gcsplan.arrays import Floats, Int8s, Int64s, Singles
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.kernels.compiled import device

TOUCH_M = 1e-6
"""Float noise: a limit that is broken by less than this, m, counts as touched, and touching is legal."""

ANGLE_DEG = 1e-7
"""Float noise of an angle: a climb that is steeper by less is legal."""

RESOLUTION_M = 0.005
"""Height, m, to which branch and bound resolves what lies within reach; cases that are closer are refused."""

CUT = 11
"""Index in `judge`'s work array ``out`` of the pieces of ground cut so far, of all legs."""
BOW_M = 0.05
"""A leg is mapped to the grid in parts whose plane-straight and grid-straight lines differ by at most this, m."""

# Indices of the array that gives kernels the map from the plane to the grid. From LINEAR on: the constant, the u and
# the v coefficients, used alone if the map is affine; from HORNER on: all coefficients, highest power first.
AFFINE, CENTRE_E, CENTRE_N, PER_UNIT, HALF, BEND, ERROR_M, STEP_X, STEP_Y, LINEAR = range(10)
HORNER = LINEAR + 6

# Indices of a zone's row of numbers. Circle: east, north, radius in metres of the plane; a negative radius marks a
# polygon, whose vertices go from FIRST up to LAST. Box: west, south, east, north. Floor and ceiling are above
# mean sea level, or above ground if the _AGL mark is not 0; -inf and inf if there is none. Band: lowest floor and
# highest ceiling above mean sea level over all the ground under the zone. Cells: first and last column, first and last
# row that the shape may touch.
EAST, NORTH, RADIUS, FIRST, LAST, WEST_E, SOUTH_N, EAST_E, NORTH_N = range(9)
FLOOR, FLOOR_AGL, CEILING, CEILING_AGL, BAND_LOW, BAND_HIGH, COL0, COL1, ROW0, ROW1 = range(9, 19)
ZONE_NUMBERS = 19

# The limits that can be broken: indices into what `judge` reports for a leg.
MIN_AGL, TERRAIN, MAX_AGL, MAX_AMSL, COVERAGE, CLIMB, DESCENT = range(7)


class Zones(NamedTuple):
    """The zones as arrays: ``table`` (n, `ZONE_NUMBERS`); ``vertex`` (v, 2) of all polygons, one after the other.

    ``lattice``: a coarse lattice, as west, south, 1 / side, columns, rows; ``bucket``, ``near``: the zones of its
    square k are ``near[bucket[k]:bucket[k + 1]]``. ``most_corners``: the largest number of corners of a polygon.
    """

    table: Floats
    vertex: Floats
    lattice: Floats
    bucket: Int64s
    near: Int64s
    most_corners: int


LEAST_SLOPE = 1e-37
"""The slope of level ground in `LocalExtrema`: no height that is added to one of metres."""


STRIP, SHIFT, MASK = 128, 7, 127
"""Columns of a strip of `LocalExtrema`; column i is in strip ``i >> SHIFT``, the ``i & MASK``th there."""


class LocalExtrema(NamedTuple):
    """Bounds over the known cells within ``cols`` and ``rows`` of each cell, (strips, rows - 1, `STRIP`) float32.

    Cell (j, i) is at ``[i >> SHIFT, j, i & MASK]``: where a few tiles of a large surface are examined, memory is taken
    for these alone, and not for a page of each row.

    ``slope`` (rise over run) is ``inf`` in a cell that is itself unknown, 0 in one that was not examined, which counts
    as unknown too, and negative (its magnitude is the slope) if an unknown cell, or the border, lies within reach;
    level ground has `LEAST_SLOPE`. ``high`` and ``low`` are metres AMSL; all three are rounded outward. ``gaps``: see
    `unknown_gaps`; without cells if the reach has so few that they are looked at one by one.
    """

    slope: Singles
    high: Singles
    low: Singles
    gaps: Int8s
    cols: int
    rows: int


class Demands(NamedTuple):
    """Limits for the kernel; ``inf`` means no limit. ``max_climb``, ``max_descent``: rise over run.

    ``clearance_m`` and track errors times ``scale`` are metres of the plane; ``over_m`` is kept above and below zones.
    """

    min_agl_m: float
    max_agl_m: float
    max_amsl_m: float
    clearance_m: float
    scale: float
    max_climb: float
    max_descent: float
    over_m: float

    @classmethod
    def of(cls, limits: Limits, scale: float) -> Demands:
        """The demands of ``limits`` in a plane with ``scale`` metres for a metre on the ground."""
        return cls(
            float(limits.min_agl_m),
            math.inf if limits.max_agl_m is None else float(limits.max_agl_m),
            math.inf if limits.max_amsl_m is None else float(limits.max_amsl_m),
            float(limits.horizontal_clearance_m),
            float(scale),
            steepest(limits.max_climb_deg),
            steepest(limits.max_descent_deg),
            float(limits.vertical_clearance_m),
        )


def steepest(degrees: float) -> float:
    """Rise over run of the steepest legal leg, with float noise allowed."""
    return math.inf if degrees >= 90.0 else math.tan(math.radians(degrees + ANGLE_DEG))


@device
def steps_of(a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """Lower bounds, m, of a column and a row from d(east, north)/d(col, row), [[a, b], [c, d]]; skew shortens both."""
    xx, yy, xy = a * a + c * c, b * b + d * d, abs(a * b + c * d)
    k = math.sqrt(xx / yy)
    return math.sqrt(max(xx - xy * k, 0.0)), math.sqrt(max(yy - xy / k, 0.0))
