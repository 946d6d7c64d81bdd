"""The terms of every swarm cost for a whole population at once, from control points to numbers, in one pass.

Heights are bilinear in the raster's own grid, whose map from the plane is taken as quadratic (`scene.Scene`). All terms
are sampled, so they guide a search and never pass a mission. The papers' own terms are sums over the samples of the
curve. Broken limits are measured on denser samples, at most `SPACING` or little more than the path's mean apart:
without them a swarm bunches its samples in open space and jumps over walls between two of them.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Int64s, Singles
from gcsplan.research.swarm import scene_kernels as s
from gcsplan.research.swarm.compiled import device, kernel
from gcsplan.research.swarm.curve_kernels import CURVE, angle, chords, divide, draw, exponential, weigh
from gcsplan.research.swarm.scene_kernels import SCENE, gap_to, height_at, lookup, lookup_both, one_grid, place

# Columns of the terms, all >= 0, in metres unless stated otherwise; m²: a depth integrated along the path.
LENGTH, FLAT, RISE = 0, 1, 2  # length in space, in the plane, Σ|Δz|
STEEP = 3  # height by which legs climb or sink more than the slope limits allow
BELOW, SUNK = 4, 5  # length under the floor; its depth, m²
ABOVE, PROUD = 6, 7  # length over the ceiling; by how much, m²
UNKNOWN = 8  # length over unknown ground
INSIDE, DEEP = 9, 10  # length within reach of a zone and in its heights; its depth, m²
UNDER, OUTSIDE = 11, 12  # samples under the floor, samples out of the flight volume
HIGH, BURIED = 13, 14  # mean of max(0, AGL - h_min); sum over samples of how far they are under ground
THREAT = 15  # length times Σ over zones of max(0, 1 - d/R)
YAW, PITCH, NEAR = 16, 17, 18  # SSGWO's three sums over nodes; numbers
TURNS, SLOPES = 19, 20  # MSFOA's: how many turns, slopes are out of bounds
BEND, EXPOSED, SPHERE = 21, 22, 23  # IB-ABC's: radians turned in space, m² exposed, metres of threat
TERMS = 24

# Optional groups of terms, as bits; each takes extra time.
ANGLES, NODES_NEAR, SAMPLES_NEAR, HEIGHTS, BENDS, HIDING = 1, 2, 4, 8, 16, 32
CEILING = 64  # the ceiling follows the ground
YAWS = 128  # SSGWO's exponentials of angles
COUNTS = 256  # ABO's counts of samples

# The papers' constants, compiled in: no mission changes them.
D_SAFE, R_UAV, CLAMP_M, PITCH_MAX = 10.0, 1.0, 0.1, math.radians(45.0)  # D: SSGWO
TAN_PITCH_MAX = math.tan(PITCH_MAX)
TAN_TURN_MAX = math.tan(math.radians(45.0))  # D: MSFOA, whose φ_max follows from a load that it does not give
D_HIDE = 20.0  # D: IB-ABC's d_safe

UNEVEN = 1.5
"""Legs longer than this many times the mean leg, and longer than `SPACING`, are divided."""


@device
def _box_of(controls: Floats, box: Floats) -> None:
    """Write west, east, south, north of a path to ``box``; the path lies within the hull of its control points."""
    box[0], box[1], box[2], box[3] = controls[0, 0], controls[0, 0], controls[0, 1], controls[0, 1]
    for i in range(1, len(controls)):
        box[0], box[1] = min(box[0], controls[i, 0]), max(box[1], controls[i, 0])
        box[2], box[3] = min(box[2], controls[i, 1]), max(box[3], controls[i, 1])


@device
def _away(box: Floats, zone: Floats, reach: float) -> bool:
    """True if the box of a path proves that none of its points is within ``reach`` of a zone's centre."""
    e, n = zone[s.ZE], zone[s.ZN]
    return bool(box[0] > e + reach or box[1] < e - reach or box[2] > n + reach or box[3] < n - reach)


@device
def _hits(x: Floats, y: Floats, e: float, n: float, square: float) -> float:
    """Number of samples within the circle about (e, n) of squared radius ``square``."""
    hits = 0.0
    for i in range(len(x)):
        dx, dy = x[i] - e, y[i] - n
        hits += 1.0 if dx * dx + dy * dy < square else 0.0
    return hits


@device
def _legs(x: Floats, y: Floats, z: Floats, leg: Floats, run: Floats, numbers: Floats, out: Floats) -> float:
    """Measure lengths and climbs of all legs; return how many legs are longer than `SPACING`."""
    length, flat, rise, steep, long = 0.0, 0.0, 0.0, 0.0, 0.0
    up, down, most = numbers[s.UP], numbers[s.DOWN], numbers[s.SPACING]
    for i in range(len(leg)):
        dx, dy, dz = x[i + 1] - x[i], y[i + 1] - y[i], z[i + 1] - z[i]
        square = dx * dx + dy * dy
        r, d = math.sqrt(square), math.sqrt(square + dz * dz)
        run[i] = r
        leg[i] = d
        length += d
        flat += r
        rise += abs(dz)
        steep += max(max(dz - up * r, -dz - down * r), 0.0)
        long += 1.0 if d > most else 0.0
    out[LENGTH], out[FLAT], out[RISE], out[STEEP] = length, flat, rise, steep
    return long


@device
def _unknown(floor: Floats, weight: Floats) -> float:
    """Length of path over unknown ground, in metres."""
    dark, unknown = 0.0, 0.0
    for i in range(len(floor)):
        dark += 1.0 if floor[i] != floor[i] else 0.0
    if dark > 0.0:
        for i in range(len(floor)):
            unknown += weight[i] if floor[i] != floor[i] else 0.0
    return unknown


@device
def _limit_terms(
    z: Floats, weight: Floats, ground: Floats, floor: Floats, follows: bool, numbers: Floats, out: Floats
) -> None:
    """Measure how much of a path is under its floor and over its ceiling, and how deeply.

    ``follows``: the ceiling follows the ``ground``. Counts are floats and loops are short: with integers, or in one
    loop, the compiler would not vectorise them.
    """
    below, sunk, above, proud = 0.0, 0.0, 0.0, 0.0
    agl, amsl = numbers[s.MAX_AGL], numbers[s.MAX_AMSL]
    for i in range(len(z)):
        deep, high = max(0.0, floor[i] - z[i]), max(0.0, z[i] - amsl)  # max(0, NaN) is 0 in this order
        below += weight[i] if deep > 0.0 else 0.0
        sunk += weight[i] * deep
        above += weight[i] if high > 0.0 else 0.0
        proud += weight[i] * high
    if follows:
        above, proud = 0.0, 0.0
        for i in range(len(z)):
            high = max(0.0, z[i] - min(ground[i] + agl, amsl))
            above += weight[i] if high > 0.0 else 0.0
            proud += weight[i] * high
    out[BELOW], out[SUNK], out[ABOVE], out[PROUD] = below, sunk, above, proud


@device
def _zone_terms(
    x: Floats, y: Floats, z: Floats, weight: Floats, leg: Floats, heights: Singles, quadratic: Floats, numbers: Floats,
    zones: Floats, corners: Floats, box: Floats, near: bool, out: Floats,
) -> None:  # fmt: skip
    """Measure the length inside zones and its depth; with ``near`` also MSFOA's threat and IB-ABC's spheres, over the
    samples of the curve alone."""
    inside, depth, threat, sphere = 0.0, 0.0, 0.0, 0.0
    for k in range(len(zones)):
        zone = zones[k]
        e, n, radius, margin = zone[s.ZE], zone[s.ZN], zone[s.ZR], zone[s.REACH]
        reach = radius + margin
        # Zones away from the path's box are skipped; in others a sample out of reach costs one comparison.
        if _away(box, zone, reach):
            continue
        square, follows = reach * reach, zone[s.LOW_AGL] != 0.0 or zone[s.HIGH_AGL] != 0.0
        hits = _hits(x, y, e, n, square)
        i = 0
        while hits > 0.0:
            dx, dy = x[i] - e, y[i] - n
            apart = dx * dx + dy * dy
            if apart < square:
                hits -= 1.0
                ground = height_at(heights, quadratic, numbers, x[i], y[i]) if follows else 0.0
                low, high = zone[s.Z_LOW] + zone[s.LOW_AGL] * ground, zone[s.Z_HIGH] + zone[s.HIGH_AGL] * ground
                within = low < z[i] < high
                own = near and i <= len(leg)
                if within or own:
                    gap = gap_to(zone, corners, x[i], y[i])
                    if within and gap < margin:
                        inside += weight[i]
                        depth += weight[i] * min(margin - gap, max(min(z[i] - low, high - z[i]), 0.0))
                    if own:
                        if i < len(leg):
                            threat += leg[i] * max(0.0, -gap) / radius
                        dz = z[i] - (zone[s.Z_MIDDLE] + zone[s.HIGH_AGL] * ground)
                        sphere += max(0.0, radius - math.sqrt(apart + dz * dz))
            i += 1
    out[INSIDE], out[DEEP], out[THREAT], out[SPHERE] = inside, depth, threat, sphere


@device
def _near_terms(
    x: Floats, y: Floats, z: Floats, heights: Singles, quadratic: Floats, numbers: Floats, zones: Floats,
    corners: Floats, box: Floats, stride: int, east: Floats, north: Floats, out: Floats,
) -> None:  # fmt: skip
    """SSGWO's obstacle cost (eq. 31, 32): the sum of 1/d over nodes and obstacles closer than d_safe. ``east`` and
    ``north`` are working arrays."""
    near, count = 0.0, 0
    for i in range(stride, len(x) - 1, stride):
        east[count], north[count] = x[i], y[i]
        count += 1
    for k in range(len(zones)):
        zone = zones[k]
        reach = zone[s.ZR] + D_SAFE + R_UAV
        if _away(box, zone, reach):
            continue
        e, n, square = zone[s.ZE], zone[s.ZN], reach * reach
        hits = _hits(east[:count], north[:count], e, n, square)
        i = 0
        while hits > 0.0:
            i += stride
            dx, dy = x[i] - e, y[i] - n
            if dx * dx + dy * dy >= square:
                continue
            hits -= 1.0
            ground = 0.0
            if zone[s.LOW_AGL] != 0.0 or zone[s.HIGH_AGL] != 0.0:
                ground = height_at(heights, quadratic, numbers, x[i], y[i])
            low, high = zone[s.Z_LOW] + zone[s.LOW_AGL] * ground, zone[s.Z_HIGH] + zone[s.HIGH_AGL] * ground
            beside = max(gap_to(zone, corners, x[i], y[i]) - R_UAV, 0.0)
            over = max(max(z[i] - high, low - z[i]) - R_UAV, 0.0)
            d = math.sqrt(beside * beside + over * over)
            if d < D_SAFE:
                near += 1.0 / max(d, CLAMP_M)
    out[NEAR] = near


@device
def _angle_terms(
    count: int, east: Floats, north: Floats, run: Floats, rise: Floats, base: Floats, bends: bool, out: Floats
) -> None:
    """Count turns and slopes between nodes that are out of bounds; with ``bends`` also add up the turns in radians."""
    slopes, turns, bend = 0.0, 0.0, 0.0
    for i in range(count):
        slope, h = rise[i] / max(run[i], 1e-9), base[i]
        # MSFOA eq. 27: the steepest climb and descent by altitude.
        alpha = -1.5377e-10 * h * h - 2.6997e-5 * h + 0.4211
        beta = 2.5063e-9 * h * h - 6.3014e-6 * h - 0.3257
        slopes += 1.0 if (slope > alpha) | (slope < beta) else 0.0
    for i in range(count - 1):
        cross = abs(east[i] * north[i + 1] - north[i] * east[i + 1])
        dot = east[i] * east[i + 1] + north[i] * north[i + 1]
        # Compares the tangent: whether a turn exceeds 45 degrees needs no angle.
        turns += 1.0 if cross > dot * TAN_TURN_MAX else 0.0
    if bends:
        for i in range(count - 1):
            # A vertical chord has no heading.
            e, n = (east[i], north[i]) if run[i] > 0.0 else (0.0, 0.0)
            f, m = (east[i + 1], north[i + 1]) if run[i + 1] > 0.0 else (0.0, 0.0)
            u, v = rise[i], rise[i + 1]
            a, b, c = n * v - u * m, u * f - e * v, e * m - n * f
            bend += angle(math.sqrt(a * a + b * b + c * c), e * f + n * m + u * v)
    out[SLOPES], out[TURNS], out[BEND] = slopes, turns, bend


@device
def _yaw_terms(count: int, east: Floats, north: Floats, run: Floats, rise: Floats, out: Floats) -> None:
    """SSGWO's sums of exponentials of turns and slopes between nodes (eq. 29, 30)."""
    steep, pitch, yaw = 0.0, 0.0, 0.0
    for i in range(count - 1):
        cross = abs(east[i] * north[i + 1] - north[i] * east[i + 1])
        yaw += exponential(angle(cross, east[i] * east[i + 1] + north[i] * north[i + 1])) - 1.0
    for i in range(count):
        steep += 1.0 if abs(rise[i]) > run[i] * TAN_PITCH_MAX else 0.0
    if steep > 0.0:
        for i in range(count):
            more = angle(abs(rise[i]), run[i]) - PITCH_MAX
            pitch += exponential(max(more, 0.0)) if abs(rise[i]) > run[i] * TAN_PITCH_MAX else 0.0
    out[YAW], out[PITCH] = yaw, pitch


@device
def _count_terms(x: Floats, y: Floats, z: Floats, floor: Floats, numbers: Floats, out: Floats) -> None:
    """Count ABO's samples under the floor or over unknown ground, and samples out of the flight volume."""
    west, south, bottom = numbers[s.WEST], numbers[s.SOUTH], numbers[s.BOTTOM]
    east, north, top = numbers[s.EAST], numbers[s.NORTH], numbers[s.TOP]
    under, outside = 0.0, 0.0
    for i in range(1, len(z) - 1):
        under += 1.0 if floor[i] > z[i] else 0.0
    for i in range(len(z)):
        under += 1.0 if floor[i] != floor[i] else 0.0
        away = (x[i] < west) | (x[i] > east) | (y[i] < south) | (y[i] > north) | (z[i] < bottom) | (z[i] > top)
        outside += 1.0 if away else 0.0
    out[UNDER], out[OUTSIDE] = under, outside


@device
def _height_terms(z: Floats, ground: Floats, numbers: Floats, out: Floats) -> None:
    """MSFOA's altitude and terrain costs (eq. 21, 23)."""
    h_min, high, buried = numbers[s.H_MIN], 0.0, 0.0
    for i in range(len(z)):
        agl = z[i] - ground[i]
        high += max(0.0, agl - h_min)
        buried += max(0.0, -agl)
    out[HIGH], out[BURIED] = high / len(z), buried


@device
def _hiding_terms(
    x: Floats, y: Floats, z: Floats, ground: Floats, run: Floats, zones: Floats, corners: Floats, numbers: Floats,
    box: Floats, cost: Floats, out: Floats,
) -> None:  # fmt: skip
    """IB-ABC's concealment (eq. 4). ``cost`` (S,) is a working array: the cost of a metre at each sample."""
    lit = 3.0 * (numbers[s.H_MAX] + D_HIDE)
    for i in range(len(x)):
        apart = z[i] - ground[i]
        cost[i] = apart - D_HIDE if apart >= D_HIDE else lit  # NaN gives `lit`
    for k in range(len(zones)):
        zone = zones[k]
        reach = zone[s.ZR] + D_HIDE
        if _away(box, zone, reach):
            continue
        e, n, square = zone[s.ZE], zone[s.ZN], reach * reach
        if zone[s.CORNERS] == 0.0:
            for i in range(len(x)):
                dx, dy = x[i] - e, y[i] - n
                cost[i] = lit if dx * dx + dy * dy < square else cost[i]
            continue
        for i in range(len(x)):
            dx, dy = x[i] - e, y[i] - n
            # Samples near ground or another zone have the highest cost already: skip the distance.
            if dx * dx + dy * dy < square and cost[i] != lit and gap_to(zone, corners, x[i], y[i]) < D_HIDE:
                cost[i] = lit
    exposed = 0.0
    for i in range(len(run)):
        exposed += cost[i + 1] * run[i]
    out[EXPOSED] = exposed


SAMPLE_ARRAYS, FINE_ARRAYS, CHORD_ARRAYS = 3, 8, 5
"""Numbers of working arrays of `measure`: for a path's samples, for twice as many, and for chords between nodes."""

ROOM = " ".join(["f8[]"] * (SAMPLE_ARRAYS + FINE_ARRAYS + CHORD_ARRAYS + 1))
"""Forms of all working arrays. They are separate arrays, not rows of one, so that the compiler knows that they do not
overlap."""


def room(samples: int) -> list[Floats]:
    """Working arrays of `measure` for paths of ``samples`` samples."""
    sizes = [samples, samples - 1, samples - 1] + [2 * samples] * FINE_ARRAYS
    return [np.zeros(n) for n in (*sizes, *[samples] * CHORD_ARRAYS, 4)]


@kernel(f"f8[,,] {CURVE} {SCENE} i8 i8 {ROOM} f8[,]")
def measure(
    controls: Floats, bands: Floats, spans: Int64s,
    heights: Singles, quadratic: Floats, floors: Singles, floor_map: Floats, numbers: Floats, zones: Floats,
    corners: Floats, stride: int, groups: int,
    cost: Floats, leg: Floats, run: Floats,
    all_x: Floats, all_y: Floats, all_z: Floats, weight: Floats, floor: Floats, ground: Floats,
    column: Floats, row: Floats,
    east: Floats, north: Floats, flat: Floats, rise: Floats, base: Floats,
    box: Floats,
    out: Floats,
) -> None:  # fmt: skip
    """Write the terms of P paths of N control points, ``controls`` (P, N, 3), to ``out`` (P, TERMS).

    ``stride``: samples from node to node; ``groups``: bits of the optional groups of terms. The rest are working arrays
    (see `room`): for samples and legs; for samples followed by points added on long legs; for chords; for a box.
    """
    count = len(cost)
    x, y, z = all_x[:count], all_y[:count], all_z[:count]
    grounded = (groups & (CEILING | HEIGHTS | HIDING)) != 0
    shared = one_grid(heights, quadratic, floors, floor_map)
    for p in range(len(controls)):
        to = out[p]
        for k in range(TERMS):
            to[k] = 0.0
        _box_of(controls[p], box)
        draw(controls[p], bands, spans, x, y, z)
        long = _legs(x, y, z, leg, run, numbers, to)
        weigh(leg, weight)
        many = count
        if long > 0.0:
            step_m = max(numbers[s.SPACING], UNEVEN * to[LENGTH] / len(leg))
            many = divide(leg, step_m, all_x, all_y, all_z, weight, row)
        off = place(floors, floor_map, numbers, all_x[:many], all_y[:many], column, row)
        if grounded and shared:
            lookup_both(floors, heights, column, row, off, floor[:many], ground[:many])
        else:
            lookup(floors, column, row, off, floor[:many])
            if grounded:
                off = place(heights, quadratic, numbers, all_x[:many], all_y[:many], column, row)
                lookup(heights, column, row, off, ground[:many])
        to[UNKNOWN] = _unknown(floor[:many], weight)
        _zone_terms(
            all_x[:many], all_y[:many], all_z, weight, leg, heights, quadratic, numbers, zones, corners, box,
            (groups & SAMPLES_NEAR) != 0, to,
        )  # fmt: skip
        weight[0] = weight[count - 1] = 0.0  # start and goal are fixed, and may lie exactly on the floor
        _limit_terms(all_z[:many], weight, ground, floor, (groups & CEILING) != 0, numbers, to)

        if groups & COUNTS:
            _count_terms(x, y, z, floor, numbers, to)
        if groups & NODES_NEAR:
            _near_terms(x, y, z, heights, quadratic, numbers, zones, corners, box, stride, east, north, to)
        if groups & (ANGLES | YAWS):
            legs = chords(x, y, z, stride, east, north, flat, rise, base)
            if groups & ANGLES:
                _angle_terms(legs, east, north, flat, rise, base, (groups & BENDS) != 0, to)
            if groups & YAWS:
                _yaw_terms(legs, east, north, flat, rise, to)
        if groups & HEIGHTS:
            _height_terms(z, ground, numbers, to)
        if groups & HIDING:
            _hiding_terms(x, y, z, ground, run, zones, corners, numbers, box, cost, to)
