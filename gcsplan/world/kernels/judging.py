"""The kernel behind `Airspace.examine` and `Airspace.clear`: one for both, so that they cannot disagree."""

from __future__ import annotations

import math

from gcsplan.arrays import Bools, Floats, Int64s
from gcsplan.world.kernels.compiled import device, inlined
from gcsplan.world.kernels.shared import (
    CLIMB,
    COVERAGE,
    DESCENT,
    EAST_E,
    MAX_AGL,
    MAX_AMSL,
    MIN_AGL,
    NORTH_N,
    SOUTH_N,
    TERRAIN,
    TOUCH_M,
    WEST_E,
    Demands,
    LocalExtrema,
    Zones,
)
from gcsplan.world.kernels.sweep_terrain import (
    DEPTH,
    DEPTH_AT,
    LOW,
    LOW_AT,
    REACH,
    STEEPEST,
    UNKNOWN,
    UNKNOWN_AT,
    glance,
    sweep,
)
from gcsplan.world.kernels.sweep_zones import meets

FEW_ZONES = 24  # up to this many, a look through all boxes is faster than the lattice


@inlined
def judge_terrain(
    m: Floats, ground: Floats, top: Floats, near: LocalExtrema, far: LocalExtrema, over: LocalExtrema, column: bool,
    e0: float, n0: float, h0: float, e1: float, n1: float, h1: float, track: float, altitude: float, limits: Demands,
    stack: Floats, full: bool, out: Floats, worst: Floats, leg: int,
) -> bool:  # fmt: skip
    """Judge ground, obstacles and ceilings of one leg; return False at the first violation unless ``full``.

    ``near``, ``far``: local extrema of the top for the track error and for the clearance; ``over``: of the ground for
    the track error. ``worst[leg, kind]``: depth (for coverage, how far unknown ground reaches in) and fraction.
    ``out[8:11]``: lowest height above top, its fraction, and highest above ground; the rest of ``out`` is `sweep`'s.
    """
    fine = True
    track_m = track * limits.scale
    out[8], out[9], out[10] = math.nan, 0.0, math.nan
    for kind in (MIN_AGL, TERRAIN, MAX_AGL):
        z, extrema, sign, need, reach = top, near, 1.0, limits.min_agl_m + altitude, track_m
        judged = True
        if kind == MIN_AGL:
            need = -math.inf if column else need
        elif kind == TERRAIN:
            if column or limits.clearance_m <= 0.0:
                continue
            extrema, need, reach = far, altitude, track_m + limits.clearance_m * limits.scale
            # Skip the search if even the steepest slope does not lift the ground to the flight level.
            same = near.cols == far.cols and near.rows == far.rows
            if same and out[LOW] - altitude >= (out[REACH] + limits.clearance_m * limits.scale) * out[STEEPEST]:
                continue
        else:
            z, extrema, sign, need = ground, over, -1.0, altitude - limits.max_agl_m
            judged = limits.max_agl_m < math.inf
            if not (full or judged):
                continue
        sure = glance(m, z, extrema.slope, sign, e0, n0, h0, e1, n1, h1, need, reach, full, out)
        good = sure > 0
        if sure < 0 and judged:
            return False
        if not good:
            extremes = extrema.high if sign > 0.0 else extrema.low
            good = sweep(
                m, z, extrema.slope, extremes, extrema.gaps, extrema.cols, extrema.rows, sign,
                e0, n0, h0, e1, n1, h1, need, reach, stack, full, out,
            )  # fmt: skip
        if not good and judged:
            if not full:
                return False
            fine = False
            if out[DEPTH] > TOUCH_M:
                worst[leg, kind, 0], worst[leg, kind, 1] = out[DEPTH], out[DEPTH_AT]
            short = out[REACH] - out[UNKNOWN]
            if (out[UNKNOWN] <= 0.0 or short > TOUCH_M) and not worst[leg, COVERAGE, 0] >= short:
                worst[leg, COVERAGE, 0], worst[leg, COVERAGE, 1] = max(short, TOUCH_M), out[UNKNOWN_AT]
        if kind == MIN_AGL and out[LOW] < math.inf:
            out[8], out[9] = out[LOW], out[LOW_AT]
        elif kind == MAX_AGL and out[LOW] < math.inf:
            out[10] = -out[LOW]
    return fine


@inlined
def candidates(
    zone: Floats, lat: Floats, bucket: Int64s, near: Int64s, west: float, south: float, east: float, north: float,
    seen: Int64s, stamp: int, list_of: Int64s,
) -> int:  # fmt: skip
    """Put the zones whose boxes overlap a box into ``list_of``, once each; return their number."""
    count = 0
    zones = len(zone)
    cols, rows = int(lat[3]), int(lat[4])
    few = zones <= FEW_ZONES
    i0, i1, j0, j1 = 0, 0, 0, 0
    if not few:
        i0, i1 = int(max((west - lat[0]) * lat[2], 0.0)), int(min((east - lat[0]) * lat[2], cols - 1.0))
        j0, j1 = int(max((south - lat[1]) * lat[2], 0.0)), int(min((north - lat[1]) * lat[2], rows - 1.0))
    for j in range(j0, j1 + 1):
        for i in range(i0, i1 + 1):
            first, last = (0, zones) if few else (bucket[j * cols + i], bucket[j * cols + i + 1])
            for q in range(first, last):
                k = q if few else near[q]
                if (
                    zone[k, WEST_E] < east
                    and zone[k, EAST_E] > west
                    and zone[k, SOUTH_N] < north
                    and zone[k, NORTH_N] > south
                    and seen[k] != stamp
                ):
                    seen[k] = stamp
                    list_of[count] = k
                    count += 1
    return count


@device
def judge(
    m: Floats, ground: Floats, top: Floats, near: LocalExtrema, far: LocalExtrema, over: LocalExtrema, zs: Zones,
    start: Floats, end: Floats, column: Bools, track: Floats, altitude: Floats, limits: Demands, full: bool, ok: Bools,
    found: Floats, worst: Floats, nearest: Int64s, hit: Int64s, hit_at: Floats, stack: Floats, out: Floats,
    events: Floats, seen: Int64s, list_of: Int64s,
) -> int:  # fmt: skip
    """Judge every leg; return the number of zone violations.

    ``m``, ``ground``, ``top``: map, surfaces; ``near``, ``far``, ``over``: see `judge_terrain`; ``zs``: zones;
    ``start`` … ``altitude``: as in `Legs`. The last five are work arrays, see `WorkArrays`.

    ``ok`` (n,): no violation. With ``full`` also ``found`` (n, 4): lowest height above top, its fraction, highest above
    ground, zone clearance; ``worst`` (n, 7, 2) by kind: depth (NaN if there is none; 1 for a climb too steep) and
    fraction; ``nearest`` (n,) zone; and, as many as fit, ``hit`` (leg, zone), ``hit_at`` (signed distance, fraction).
    """
    zone = zs.table
    hits = 0
    for i in range(len(start)):
        e0, n0, h0 = start[i, 0], start[i, 1], start[i, 2]
        e1, n1, h1 = end[i, 0], end[i, 1], end[i, 2]
        flat = math.sqrt((e1 - e0) ** 2 + (n1 - n0) ** 2)
        over_top = max(h0, h1) + altitude[i] - limits.max_amsl_m
        # A slope without limit is inf, and inf times the 0 m run of a vertical leg is NaN, which nothing exceeds.
        up = not column[i] and h1 - h0 > flat * limits.max_climb
        down = not column[i] and h0 - h1 > flat * limits.max_descent
        fine = not (up or down or over_top > TOUCH_M)
        ok[i] = False
        if not (fine or full):
            continue
        fine = (
            judge_terrain(
                m, ground, top, near, far, over, column[i], e0, n0, h0, e1, n1, h1,
                track[i], altitude[i], limits, stack, full, out, worst, i,
            )
            and fine
        )  # fmt: skip
        if not (fine or full):
            continue
        reach = (track[i] + limits.clearance_m) * limits.scale
        west, east, south, north = min(e0, e1), max(e0, e1), min(n0, n1), max(n0, n1)
        count = len(zone)
        if not full:
            count = candidates(
                zone, zs.lattice, zs.bucket, zs.near, west - reach, south - reach, east + reach, north + reach,
                seen, i, list_of,
            )  # fmt: skip
        best, which = math.inf, -1
        for q in range(count):
            k = list_of[q]
            if full:
                dx = max(zone[k, WEST_E] - east, 0.0, west - zone[k, EAST_E])
                dy = max(zone[k, SOUTH_N] - north, 0.0, south - zone[k, NORTH_N])
                gap = math.sqrt(dx * dx + dy * dy)
                if gap > 0.0 and gap >= best and gap >= reach:
                    continue
            broken, dist, at = meets(
                m, ground, zone, zs.vertex, k, e0, n0, h0, e1, n1, h1, altitude[i] + limits.over_m, reach, stack,
                events, full, out,
            )  # fmt: skip
            if broken:
                fine = False
                if not full:
                    break
                if hits < len(hit):
                    hit[hits, 0], hit[hits, 1] = i, k
                    hit_at[hits, 0], hit_at[hits, 1] = dist, at
                hits += 1
            if max(dist, 0.0) < best:
                best, which = max(dist, 0.0), k
        ok[i] = fine
        if full:
            found[i, 0], found[i, 1], found[i, 2], found[i, 3] = out[8], out[9], out[10], best
            nearest[i] = which
            if up:
                worst[i, CLIMB, 0] = 1.0
            if down:
                worst[i, DESCENT, 0] = 1.0
            if over_top > TOUCH_M:
                worst[i, MAX_AMSL, 0], worst[i, MAX_AMSL, 1] = over_top, 1.0 if h1 >= h0 else 0.0
    return hits
