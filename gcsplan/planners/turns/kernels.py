"""Kernels of arc paths: tangents, outlines, how far a track breaks its limits, and its tube over arcs."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Bools, Floats, Int64s
from gcsplan.planners.turns.compiled import device, kernel

END_M, FORGIVEN_M = 60.0, 25.0
"""Within `END_M` metres of start and goal, floors that are exceeded by less than `FORGIVEN_M` metres are ignored (see
`profile.track`)."""

SLIGHT = 0.5
"""A turn of up to so many radians past a pin is not divided there: way points that are near to each other are moved by
rounding on the wire so far that their arcs overlap."""

CHORD_M = 0.05
"""Most metres by which an arc lies outside its chords."""


@kernel("f8[,] f8 f8[,] f8[] f8[] f8[] f8[]")
def tangents(
    ends: Floats, radius: float, centre: Floats, sense: Floats, heading: Floats, turn: Floats, out: Floats
) -> None:
    """Write the headings of the legs and the turns between them; into ``out`` (1,) the metres by which neighbouring
    discs are too close for a tangent, summed (0: there is one everywhere)."""
    n = len(sense)
    gap = 0.0
    for k in range(n + 1):
        if k == 0:
            ax, ay, sa = ends[0, 0], ends[0, 1], 0.0
        else:
            ax, ay, sa = centre[k - 1, 0], centre[k - 1, 1], sense[k - 1]
        if k == n:
            bx, by, sb = ends[1, 0], ends[1, 1], 0.0
        else:
            bx, by, sb = centre[k, 0], centre[k, 1], sense[k]
        dx, dy = bx - ax, by - ay
        d = math.hypot(dx, dy)
        across = (sb - sa) * radius
        if abs(across) > d:
            gap += abs(across) - d
            across = math.copysign(d, across)
        heading[k] = math.atan2(dy, dx) - (math.asin(across / d) if d > 0.0 else 0.0)
    for k in range(n):
        t = sense[k] * (heading[k + 1] - heading[k])
        # From -90 degrees (turns the wrong way: the disc is not touched) to 270 degrees.
        turn[k] = (t + 0.5 * math.pi) % (2.0 * math.pi) - 0.5 * math.pi
    out[0] = gap


@kernel("f8[,] f8 f8[,] f8[] b1[]")
def part_neighbours(ends: Floats, radius: float, centre: Floats, sense: Floats, fixed: Bools) -> None:
    """Push neighbouring discs apart that are too close for a tangent, in place; ``fixed`` ones stay."""
    n = len(sense)
    for k in range(n + 1):
        first, last = k == 0, k == n
        if first and last:
            continue
        need = radius if first or last else abs(sense[k] - sense[k - 1]) * radius
        need *= 1.0 + 1e-6
        a = ends[0] if first else centre[k - 1]
        b = ends[1] if last else centre[k]
        dx, dy = b[0] - a[0], b[1] - a[1]
        d = math.hypot(dx, dy)
        if d >= need:
            continue
        if d < 1e-6:
            dx, dy, d = 1.0, 0.0, 1.0
        by = need - d
        hold_a, hold_b = first or fixed[k - 1], last or fixed[k]
        if not hold_a:
            part = by if hold_b else 0.5 * by
            centre[k - 1, 0] -= part * dx / d
            centre[k - 1, 1] -= part * dy / d
        if not hold_b:
            part = by if hold_a else 0.5 * by
            centre[k, 0] += part * dx / d
            centre[k, 1] += part * dy / d


@device
def _turn_to_pin(east: float, north: float, begin: float, sense: float, whole: float) -> float:
    """The turn of an arc as far as to its pin, seen from its centre; -1 without a pin. ``begin``: see the caller."""
    if east != east:
        return -1.0
    t = sense * (math.atan2(north, east) - begin)
    return min(max((t + 0.5 * math.pi) % (2.0 * math.pi) - 0.5 * math.pi, 0.0), whole)


@kernel("f8[,] f8 f8[,] f8[] f8[,] f8[] f8[] f8 f8 f8[,] f8[] f8[] i8[,] f8[,] i8[] i8[]")
def fill_outline(
    ends: Floats, radius: float, centre: Floats, sense: Floats, pin: Floats, heading: Floats, turn: Floats,
    step: float, most: float, points: Floats, true_m: Floats, widen: Floats, arcs: Int64s, corners: Floats,
    disc: Int64s, pin_at: Int64s,
) -> int:  # fmt: skip
    """Fill the arrays of `Outline` (``widen[i]`` belongs to the chord that ends at point i); return how many points.

    ``step``: largest angle of a chord, ``most``: largest angle of a turn, both in radians. The number of turns goes
    into the last element of ``disc``.
    """
    points[0, 0], points[0, 1] = ends[0, 0], ends[0, 1]
    true_m[0] = 0.0
    n, turns = 1, 0
    for k in range(len(sense)):
        whole = turn[k]
        straight = whole <= 1e-12
        if straight and pin[k, 0] != pin[k, 0]:
            continue
        # Angle, seen from the centre, at which the arc begins; it runs in the direction of ``sense``.
        begin = heading[k] - sense[k] * 0.5 * math.pi
        x = centre[k, 0] + radius * math.cos(begin)
        y = centre[k, 1] + radius * math.sin(begin)
        if straight:
            x, y = pin[k, 0], pin[k, 1]
        way = math.hypot(x - points[n - 1, 0], y - points[n - 1, 1])
        if way > 1e-6:
            points[n, 0], points[n, 1] = x, y
            true_m[n] = true_m[n - 1] + way
            n += 1
        if straight:
            pin_at[k] = n - 1
            continue
        cut = _turn_to_pin(pin[k, 0] - centre[k, 0], pin[k, 1] - centre[k, 1], begin, sense[k], whole)
        alone = whole <= SLIGHT and abs(cut - 0.5 * whole) < 1e-6
        cut = -1.0 if alone else cut
        for part in range(2):
            if part == 0:
                t0, t1 = 0.0, whole if cut < 0.0 else cut
            elif cut < 0.0:
                break
            else:
                t0, t1 = cut, whole
                pin_at[k] = n - 1
            if t1 - t0 <= 1e-12:
                continue
            pieces = max(1, math.ceil((t1 - t0) / most))
            for piece in range(pieces):
                u0 = t0 + (t1 - t0) * piece / pieces
                u1 = t0 + (t1 - t0) * (piece + 1) / pieces
                half = 0.5 * (u1 - u0)
                chords = max(1, math.ceil(half / step))
                arcs[turns, 0] = n - 1
                arcs[turns, 1] = n - 1 + chords
                arcs[turns, 2] = n - 1 + 2 * chords
                for c in range(1, 2 * chords + 1):
                    at = begin + sense[k] * (u0 + half * c / chords)
                    points[n, 0] = centre[k, 0] + radius * math.cos(at)
                    points[n, 1] = centre[k, 1] + radius * math.sin(at)
                    true_m[n] = true_m[n - 1] + radius * half / chords
                    widen[n] = CHORD_M
                    n += 1
                at = begin + sense[k] * (u0 + half)
                out = radius / math.cos(half)
                corners[turns, 0] = centre[k, 0] + out * math.cos(at)
                corners[turns, 1] = centre[k, 1] + out * math.sin(at)
                disc[turns] = k
                turns += 1
        if alone:
            pin_at[k] = arcs[turns - 1, 1]
        if cut >= 0.0 or alone:
            points[pin_at[k], 0], points[pin_at[k], 1] = pin[k, 0], pin[k, 1]
    way = math.hypot(ends[1, 0] - points[n - 1, 0], ends[1, 1] - points[n - 1, 1])
    if way > 1e-6:
        points[n, 0], points[n, 1] = ends[1, 0], ends[1, 1]
        true_m[n] = true_m[n - 1] + way
        n += 1
    else:
        points[n - 1, 0], points[n - 1, 1] = ends[1, 0], ends[1, 1]
    disc[len(disc) - 1] = turns
    return n


@kernel("f8[] f8[,] f8[,] f8 f8 f8 f8 f8[]")
def pinched(
    s: Floats, floor: Floats, ceiling: Floats, z0: float, z1: float, up: float, down: float, out: Floats
) -> None:
    """Write to ``out`` (3,): metres of floor above ceiling, integrated along the track; the worst place; metres there.

    The ceiling includes the height that can be reached from the start (``z0``), or left for the goal (``z1``). Places
    near the ends are ignored if little is missing (`END_M`, `FORGIVEN_M`): the ends are checked elsewhere.
    """
    total, worst, most = 0.0, 0.0, 0.0
    length = s[-1]
    for k in range(len(floor)):
        a, b = s[k], s[k + 1]
        middle = 0.5 * (a + b)
        part = 0.0
        for e in range(2):
            at = a if e == 0 else b
            high = ceiling[k, e]
            if np.isfinite(up):
                high = min(high, z0 + up * at)
            if np.isfinite(down):
                high = min(high, z1 + down * (length - at))
            gap = min(floor[k, e] - high, 1e3)
            if (at < END_M or at > length - END_M) and gap < FORGIVEN_M:
                continue
            part = max(part, gap)
        if part > 0.0:
            total += part * (b - a)
            if part > most:
                worst, most = middle, part
    out[0], out[1], out[2] = total, worst, most


@kernel("f8[] f8[,] f8[,] f8[] f8[,] f8[,] f8[]")
def shut(s: Floats, floor: Floats, ceiling: Floats, at: Floats, bottom: Floats, top: Floats, out: Floats) -> None:
    """Write to ``out`` (2,): metres of a band that can be passed neither under nor over, and the middle of these."""
    length, first, last = 0.0, at[-1], at[0]
    for i in range(len(floor)):
        for j in range(len(bottom)):
            a, b = max(s[i], at[j]), min(s[i + 1], at[j + 1])
            if b <= a:
                continue
            low = min(floor[i, 0], floor[i, 1])
            high = max(ceiling[i, 0], ceiling[i, 1])
            if max(bottom[j, 0], bottom[j, 1]) < low and min(top[j, 0], top[j, 1]) > high:
                length += b - a
                first, last = min(first, a), max(last, b)
    out[0], out[1] = length, 0.5 * (first + last)


@kernel("f8[] f8[,] f8[,] f8[,] f8[] f8[,] f8[,] f8[]")
def straighten(
    s: Floats, floor: Floats, ceiling: Floats, halves: Floats, at: Floats, low: Floats, high: Floats, slopes: Floats
) -> int:
    """Replace floor and ceiling over each half arc by straight lines that leave the most altitude free between them.

    The new tube goes into ``at`` (n + 1,), ``low`` and ``high`` (n, 2) for n pieces; returns the number of its pieces.
    ``slopes`` (5,) is a working array.
    """
    n = len(floor)
    at[0] = s[0]
    out, i, h = 0, 0, 0
    while i < n:
        while h < len(halves) and halves[h, 1] < s[i] + 1e-6:
            h += 1
        if h == len(halves) or s[i] < halves[h, 0] - 1e-6:
            for e in range(2):
                low[out, e], high[out, e] = floor[i, e], ceiling[i, e]
            at[out + 1] = s[i + 1]
            out, i = out + 1, i + 1
            continue
        j = i
        while j < n and s[j] < halves[h, 1] - 1e-6:
            j += 1
        a, b = s[i], s[j]
        for k in range(5):
            slopes[k] = 0.0
        slopes[1] = (floor[j - 1, 1] - floor[i, 0]) / (b - a)
        slopes[2] = (ceiling[j - 1, 1] - ceiling[i, 0]) / (b - a)
        # Two more slopes to try: from the floor's first point to its highest, and from its highest to its last.
        peak, peak_at = -np.inf, a
        for k in range(i, j):
            for e in range(2):
                if floor[k, e] > peak:
                    peak, peak_at = floor[k, e], s[k + e]
        if peak_at > a:
            slopes[3] = (peak - floor[i, 0]) / (peak_at - a)
        if peak_at < b:
            slopes[4] = (floor[j - 1, 1] - peak) / (b - peak_at)
        best = -np.inf
        for m in slopes:
            if not np.isfinite(m):
                continue
            under = -np.inf
            for k in range(i, j):
                for e in range(2):
                    under = max(under, floor[k, e] - m * (s[k + e] - a))
            for w in (m, slopes[2], 0.0):
                if not np.isfinite(w):
                    continue
                over = np.inf
                for k in range(i, j):
                    for e in range(2):
                        over = min(over, ceiling[k, e] - w * (s[k + e] - a))
                tight = min(over - under, over + w * (b - a) - under - m * (b - a))
                # Missing height counts a million times more than free height.
                score = (1e6 * tight if tight < 0.0 else 0.0) - (2.0 * under + m * (b - a))
                if over < np.inf:
                    score += 2.0 * over + w * (b - a)
                if score > best or best == -np.inf:
                    best = score
                    low[out, 0], low[out, 1] = under, under + m * (b - a)
                    high[out, 0], high[out, 1] = over, over + w * (b - a)
        at[out + 1] = b
        out, i = out + 1, j
    return out


@kernel("f8[] f8[,] f8[,] f8[,] f8[] f8[,] f8[,]")
def level(s: Floats, bottom: Floats, top: Floats, halves: Floats, at: Floats, under: Floats, over: Floats) -> int:
    """Extend a band to whole half arcs, each with the lowest bottom and the highest top along it; the number of pieces.

    Written to ``at`` (most + 1,), ``under`` and ``over`` (most, 2) with ``most`` = n + 2 H + 2, for H half arcs.
    """
    n, first, last = len(bottom), s[0], s[-1]
    for h in range(len(halves)):
        if halves[h, 0] < last - 1e-6 and halves[h, 1] > first + 1e-6:
            first, last = min(first, halves[h, 0]), max(last, halves[h, 1])
    at[0] = first
    out, h, here = 0, 0, first
    while here < last - 1e-6:
        while h < len(halves) and halves[h, 1] < here + 1e-6:
            h += 1
        inside = h < len(halves) and halves[h, 0] < here + 1e-6
        there = halves[h, 1] if inside else (halves[h, 0] if h < len(halves) else last)
        there = min(there, last)
        if inside:
            lowest, highest = np.inf, -np.inf
            for k in range(n):
                if s[k] < there - 1e-9 and s[k + 1] > here + 1e-9:
                    lowest = min(lowest, min(bottom[k, 0], bottom[k, 1]))
                    highest = max(highest, max(top[k, 0], top[k, 1]))
            under[out, 0] = under[out, 1] = lowest
            over[out, 0] = over[out, 1] = highest
        else:
            k = 0
            while k < n - 1 and s[k + 1] < here + 1e-9:
                k += 1
            there = min(there, s[k + 1])
            under[out, 0], under[out, 1] = bottom[k, 0], bottom[k, 1]
            over[out, 0], over[out, 1] = top[k, 0], top[k, 1]
            width = s[k + 1] - s[k]
            if width > 0.0:
                u, v = (here - s[k]) / width, (there - s[k]) / width
                for e in range(2):
                    w = u if e == 0 else v
                    if bottom[k, 0] != bottom[k, 1] and np.isfinite(bottom[k, 0] + bottom[k, 1]):
                        under[out, e] = bottom[k, 0] + w * (bottom[k, 1] - bottom[k, 0])
                    if top[k, 0] != top[k, 1] and np.isfinite(top[k, 0] + top[k, 1]):
                        over[out, e] = top[k, 0] + w * (top[k, 1] - top[k, 0])
        out += 1
        at[out] = there
        here = there
    return out
