"""The curve that ArduCopter flies to a SPLINE_WAYPOINT, as chords and how far it bulges from each.

A cubic Hermite curve between two way points with a direction at either end, of a length that is cut down where both
together exceed `LONGEST` times the distance (ArduCopter 4.1 and later: SplineCurve.cpp, `set_origin_and_destination`;
AC_WPNav.cpp, `set_spline_destination`). It leaves along the leg before it, or with no direction where the aircraft
stopped, and arrives parallel to the leg after it, or, if that is a spline too, to the line from its own beginning to
that one's end. In simulation ArduCopter 4.6.0 flew within 1.2 m of these chords, 57 m beside the straight line.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcsplan.check.stretch import Place

Vector = NDArray[np.float64]
LONGEST = 4.0  # SPLINE_FACTOR
BULGE_M = 0.25
MOST_PIECES = 200
LOOKS, SPREAD = 64, 0.05
DEGREE_M = 111_195.0


def towards(a: Place, b: Place) -> Vector:
    """(3,) from ``a`` to ``b``: east, north, up, metres."""
    east = ((b[1] - a[1] + 180.0) % 360.0 - 180.0) * DEGREE_M * math.cos(math.radians(0.5 * (a[0] + b[0])))
    return np.array([east, (b[0] - a[0]) * DEGREE_M, b[2] - a[2]])


Slopes = list[tuple[float, float]]


def chords(start: Place, end: Place, leaves: Vector, arrives: Vector) -> tuple[list[Place], float, Slopes]:
    """The curve's points from ``start`` to ``end`` (both returned exactly), and its bulge beyond their chords.

    ``leaves``, ``arrives``: (3,) directions with their lengths, metres. Last, for each chord, the steepest rise over
    run of the curve over it, up and down (negative).
    """
    way = towards(start, end)
    both = float(np.linalg.norm(leaves) + np.linalg.norm(arrives))
    most = LONGEST * float(np.linalg.norm(way))
    if both > most:
        leaves, arrives = leaves * (most / both), arrives * (most / both)
    square = 3.0 * way - 2.0 * leaves - arrives
    cube = leaves + arrives - 2.0 * way
    bend = max(float(np.linalg.norm(2.0 * square)), float(np.linalg.norm(2.0 * square + 6.0 * cube)))
    pieces = int(min(max(4, math.ceil(math.sqrt(bend / (8.0 * BULGE_M)))), MOST_PIECES))
    t = np.linspace(0.0, 1.0, pieces + 1)[1:-1, None]
    points = leaves * t + square * t**2 + cube * t**3
    flat = DEGREE_M * math.cos(math.radians(0.5 * (start[0] + end[0])))
    inner = [(start[0] + n / DEGREE_M, start[1] + e / flat, start[2] + u) for e, n, u in points.tolist()]
    return [start, *inner, end], bend / (8.0 * pieces**2), _slopes(leaves, square, cube, pieces)


def _slopes(leaves: Vector, square: Vector, cube: Vector, pieces: int) -> Slopes:
    """Steepest slopes of each piece, up and down, sampled in `LOOKS` places and raised by a part of their spread."""
    t = np.linspace(0.0, 1.0, pieces * LOOKS + 1)[:, None]
    speed = leaves + 2.0 * square * t + 3.0 * cube * t**2
    run = np.hypot(speed[:, 0], speed[:, 1])
    moves = run > 1e-6 * max(float(run.max()), 1e-9)
    slope = np.divide(speed[:, 2], run, out=np.full(len(run), np.nan), where=moves)
    known = np.flatnonzero(moves)
    if not len(known):
        return [(np.inf, -np.inf)] * pieces
    slope = np.interp(np.arange(len(run)), known, slope[known])  # standing still it has no direction
    by_piece = np.column_stack([slope[k : len(slope) - LOOKS + k : LOOKS] for k in range(LOOKS + 1)])
    up, down = by_piece.max(axis=1), by_piece.min(axis=1)
    more = SPREAD * (up - down)
    return list(zip((up + more).tolist(), (down - more).tolist(), strict=True))
