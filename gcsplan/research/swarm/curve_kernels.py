"""Kernels from control points to samples: curves, legs and chords, and exponentials and angles without a library.

Exponentials and angles are computed by series, accurate to the last digits. Unlike a C library's functions they are
vectorised and give the same bits on every machine.
"""

from __future__ import annotations

import math

from gcsplan.arrays import Floats, Int64s
from gcsplan.research.swarm.compiled import device, kernel

CURVE = "f8[,] i8[,]"
"""Forms of a curve's bands and spans."""

EXP_MOST = 3.6
_E3, _E4, _E5, _E6, _E7, _E8, _E9, _E10, _E11 = (1.0 / math.factorial(n) for n in range(3, 12))
_EXP_MIDDLE = math.exp(EXP_MOST / 16.0)


@device
def exponential(x: float) -> float:
    """e^x for 0 <= x <= `EXP_MOST`: the series of e^(x/8) about the middle of its range, to the eighth power."""
    u = x * 0.125 - EXP_MOST / 16.0
    s = _E10 + u * _E11
    s = _E9 + u * s
    s = _E8 + u * s
    s = _E7 + u * s
    s = _E6 + u * s
    s = _E5 + u * s
    s = _E4 + u * s
    s = _E3 + u * s
    s = 0.5 + u * s
    s = 1.0 + u * s
    s = (1.0 + u * s) * _EXP_MIDDLE
    s = s * s
    s = s * s
    return s * s


@device
def angle(across: float, along: float) -> float:
    """atan2(across, along) for across >= 0, from 0 to π; 0 if both are 0. The series gives a quarter of the angle
    (folded to at most 45 degrees)."""
    a = abs(along)
    most, least = max(across, a), min(across, a)
    t = least / max(most, 1e-300)
    t = t / (1.0 + math.sqrt(1.0 + t * t))
    t = t / (1.0 + math.sqrt(1.0 + t * t))
    s = -t * t
    r = 1.0 / 21.0 + s * (1.0 / 23.0)
    r = 1.0 / 19.0 + s * r
    r = 1.0 / 17.0 + s * r
    r = 1.0 / 15.0 + s * r
    r = 1.0 / 13.0 + s * r
    r = 1.0 / 11.0 + s * r
    r = 1.0 / 9.0 + s * r
    r = 1.0 / 7.0 + s * r
    r = 0.2 + s * r
    r = 1.0 / 3.0 + s * r
    r = 4.0 * t * (1.0 + s * r)
    r = 0.5 * math.pi - r if across > a else r
    return math.pi - r if along < 0.0 else r


@device
def blend(
    b0: Floats, b1: Floats, b2: Floats, b3: Floats, p0: float, p1: float, p2: float, p3: float, out: Floats
) -> None:
    """Write one coordinate of the samples of a span, the weighted sum of four control points."""
    for i in range(len(out)):
        out[i] = b0[i] * p0 + b1[i] * p1 + b2[i] * p2 + b3[i] * p3


@device
def draw(controls: Floats, bands: Floats, spans: Int64s, x: Floats, y: Floats, z: Floats) -> None:
    """Write the samples of a curve of control points (N, 3), N >= 2.

    ``bands`` (4, S): weights of four control points, from the span's first on; ``spans`` (n, 3): first sample, end
    (exclusive), and first control point. With fewer than four control points the missing ones have weight 0.
    """
    last = len(controls) - 1
    for k in range(len(spans)):
        begin, end, first = spans[k, 0], spans[k, 1], spans[k, 2]
        a, b, c, d = (
            controls[first],
            controls[first + 1],
            controls[min(first + 2, last)],
            controls[min(first + 3, last)],
        )
        # Slices, because a loop over indices that might be negative would not be vectorised.
        b0, b1, b2, b3 = bands[0, begin:end], bands[1, begin:end], bands[2, begin:end], bands[3, begin:end]
        blend(b0, b1, b2, b3, a[0], b[0], c[0], d[0], x[begin:end])
        blend(b0, b1, b2, b3, a[1], b[1], c[1], d[1], y[begin:end])
        blend(b0, b1, b2, b3, a[2], b[2], c[2], d[2], z[begin:end])


@kernel(f"f8[,,] {CURVE} f8[] f8[] f8[] f8[,,]")
def samples_of(controls: Floats, bands: Floats, spans: Int64s, x: Floats, y: Floats, z: Floats, out: Floats) -> None:
    """Write the samples of curves (P, N, 3) to ``out`` (P, S, 3); ``x``, ``y``, ``z`` (S,) are working arrays."""
    for p in range(len(controls)):
        draw(controls[p], bands, spans, x, y, z)
        to = out[p]
        for i in range(len(x)):
            to[i, 0] = x[i]
            to[i, 1] = y[i]
            to[i, 2] = z[i]


@device
def weigh(leg: Floats, weight: Floats) -> None:
    """Write to ``weight`` the length that each sample stands for: half of each adjacent leg."""
    last = len(leg)
    weight[0] = 0.5 * leg[0]
    for i in range(last - 1):
        weight[i + 1] = 0.5 * (leg[i] + leg[i + 1])
    weight[last] = 0.5 * leg[last - 1]


@device
def divide(leg: Floats, step_m: float, x: Floats, y: Floats, z: Floats, weight: Floats, long: Floats) -> int:
    """Append points on every leg longer than ``step_m`` after the samples; return the number of all points.

    ``long`` is a working array for the indices of the long legs, which are collected without branches.
    """
    found = 0
    for i in range(len(leg)):
        long[found] = i
        found += 1 if leg[i] > step_m else 0
    count = len(leg) + 1
    for k in range(found):
        i = int(long[k])
        parts = int(leg[i] / step_m) + 1
        share = 1.0 / parts
        part = leg[i] * share
        dx, dy, dz = (x[i + 1] - x[i]) * share, (y[i + 1] - y[i]) * share, (z[i + 1] - z[i]) * share
        weight[i] -= 0.5 * (leg[i] - part)
        weight[i + 1] -= 0.5 * (leg[i] - part)
        for j in range(1, parts):
            x[count] = x[i] + j * dx
            y[count] = y[i] + j * dy
            z[count] = z[i] + j * dz
            weight[count] = part
            count += 1
    return count


@device
def chords(
    x: Floats, y: Floats, z: Floats, stride: int, east: Floats, north: Floats, run: Floats, rise: Floats, base: Floats
) -> int:
    """Write the chords between nodes (every ``stride``-th sample), except chords of no length; return how many.

    ``east``, ``north``: horizontal vector of a chord; a vertical chord keeps the vector of the chord before. ``run``
    and ``rise`` in metres; ``base``: the altitude at which a chord begins.
    """
    count = 0
    he, hn = 1.0, 0.0
    for i in range(stride, len(x), stride):
        dx, dy, dz = x[i] - x[i - stride], y[i] - y[i - stride], z[i] - z[i - stride]
        if dx != 0.0 or dy != 0.0:
            he, hn = dx, dy
        elif dz == 0.0:
            continue
        east[count], north[count], rise[count], base[count] = he, hn, dz, z[i - stride]
        run[count] = math.sqrt(dx * dx + dy * dy)
        count += 1
    return count
