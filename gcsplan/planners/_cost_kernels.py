"""The terms of every swarm cost for a whole population at once, from samples to numbers, in one pass.

Paths come as samples, (P, 3, S), which one product of matrices made from control points. Heights are bilinear in the
raster's own grid, whose map from the plane is taken as quadratic (`scene.Scene`). Sampled, so it guides a search and
never passes a mission.
"""

from __future__ import annotations

import math

from gcsplan.planners._scene_kernels import (
    BOTTOM,
    CORNERS,
    DOWN,
    EAST,
    H_MAX,
    H_MIN,
    HIGH_AGL,
    LOW_AGL,
    MAX_AGL,
    MAX_AMSL,
    NORTH,
    REACH,
    SOURCES,
    SOUTH,
    TOP,
    UP,
    WEST,
    Z_HIGH,
    Z_LOW,
    Z_MIDDLE,
    ZE,
    ZN,
    ZR,
    device,
    gap_to,
    height_at,
    kernel,
    lookup,
    lookup_both,
    one_grid,
)  # fmt: skip

# Columns of the terms, all >= 0. Metres unless said otherwise; m² are depths summed along the path.
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

# Groups of terms that cost time of their own: which are wanted, as bits; GROUND: all along the path.
ANGLES, NODES_NEAR, SAMPLES_NEAR, HEIGHTS, BENDS, HIDING, GROUND = 1, 2, 4, 8, 16, 32, 64
YAWS = 128  # SSGWO's exponentials of angles

# The papers' constants: compiled in, for no mission changes them.
D_SAFE, R_UAV, CLAMP_M, PITCH_MAX = 10.0, 1.0, 0.1, math.radians(45.0)  # D: SSGWO
TAN_PITCH_MAX = math.tan(PITCH_MAX)
TAN_TURN_MAX = math.tan(math.radians(45.0))  # D: MSFOA, whose φ_max follows from a load that it does not give
D_HIDE = 20.0  # D: IB-ABC's d_safe

SCRATCH = 7
"""Arrays of a path's samples that `measure` works in: ground, floor, leg, run, weight, column, row. They are arrays of
their own, not rows of one: only then does the compiler see that a store to one leaves the others, and vectorises."""


@device
def _away(box, zone, reach):  # type: ignore[no-untyped-def]
    """Whether no point of a path's box is within ``reach`` of a zone's centre, for sure."""
    e, n = zone[ZE], zone[ZN]
    return box[0] > e + reach or box[1] < e - reach or box[2] > n + reach or box[3] < n - reach


@device
def _zone_terms(x, y, z, heights, quadratic, numbers, leg, weight, zones, corners, box, near, out):  # type: ignore[no-untyped-def]
    """Length inside zones and its depth; with ``near`` also MSFOA's threat and IB-ABC's spheres, on every sample."""
    samples = len(x)
    for k in range(len(zones)):
        zone = zones[k]
        reach, e, n = zone[ZR] + zone[REACH], zone[ZE], zone[ZN]
        # Zones away from the path's box cost nothing.
        if _away(box, zone, reach):
            continue
        square = reach * reach
        hits = 0.0
        for i in range(samples):
            dx, dy = x[i] - e, y[i] - n
            hits += 1.0 if dx * dx + dy * dy < square else 0.0
        if hits == 0.0:
            continue
        for i in range(samples):
            dx, dy = x[i] - e, y[i] - n
            if dx * dx + dy * dy >= square:
                continue
            ground = 0.0
            if zone[LOW_AGL] != 0.0 or zone[HIGH_AGL] != 0.0:
                ground = height_at(heights, quadratic, numbers, x[i], y[i])
            low, high = zone[Z_LOW] + zone[LOW_AGL] * ground, zone[Z_HIGH] + zone[HIGH_AGL] * ground
            within = low < z[i] < high
            if not (within or near):
                continue
            gap = gap_to(zone, corners, x[i], y[i])
            if within and gap < zone[REACH]:
                out[INSIDE] += weight[i]
                out[DEEP] += weight[i] * min(zone[REACH] - gap, max(min(z[i] - low, high - z[i]), 0.0))
            if near:
                out[THREAT] += leg[i] * max(0.0, -gap) / zone[ZR]
                dz = z[i] - (zone[Z_MIDDLE] + zone[HIGH_AGL] * ground)
                out[SPHERE] += max(0.0, zone[ZR] - math.sqrt(dx * dx + dy * dy + dz * dz))


@device
def _near_terms(x, y, z, heights, quadratic, numbers, zones, corners, box, stride, out):  # type: ignore[no-untyped-def]
    """SSGWO's obstacle cost (eq. 31, 32): 1/d over nodes and obstacles nearer than d_safe."""
    for k in range(len(zones)):
        zone = zones[k]
        reach = zone[ZR] + D_SAFE + R_UAV
        if _away(box, zone, reach):
            continue
        for i in range(stride, len(x) - 1, stride):
            dx, dy = x[i] - zone[ZE], y[i] - zone[ZN]
            if dx * dx + dy * dy >= reach * reach:
                continue
            ground = 0.0
            if zone[LOW_AGL] != 0.0 or zone[HIGH_AGL] != 0.0:
                ground = height_at(heights, quadratic, numbers, x[i], y[i])
            low, high = zone[Z_LOW] + zone[LOW_AGL] * ground, zone[Z_HIGH] + zone[HIGH_AGL] * ground
            beside = max(gap_to(zone, corners, x[i], y[i]) - R_UAV, 0.0)
            over = max(max(z[i] - high, low - z[i]) - R_UAV, 0.0)
            d = math.sqrt(beside * beside + over * over)
            if d < D_SAFE:
                out[NEAR] += 1.0 / max(d, CLAMP_M)


@device
def _angle_terms(x, y, z, stride, bends, out):  # type: ignore[no-untyped-def]
    """Turns and slopes between nodes, every ``stride``-th sample: how many are too much, and ``bends``, radians."""
    first = True
    he, hn = 1.0, 0.0  # the way it heads; climbing on the spot keeps it
    px = py = pz = pl = 0.0
    for i in range(stride, len(x), stride):
        h = z[i - stride]
        dx, dy, dz = x[i] - x[i - stride], y[i] - y[i - stride], z[i] - h
        run = math.sqrt(dx * dx + dy * dy)
        length = math.sqrt(run * run + dz * dz)
        if length <= 0.0:
            continue
        slope = dz / max(run, 1e-9)
        # MSFOA eq. 27: the steepest climb and descent by altitude.
        alpha = -1.5377e-10 * h * h - 2.6997e-5 * h + 0.4211
        beta = 2.5063e-9 * h * h - 6.3014e-6 * h - 0.3257
        if slope > alpha or slope < beta:
            out[SLOPES] += 1.0
        e, n = (dx, dy) if run > 0.0 else (he, hn)
        if not first:
            # No angle is needed to know that it is more than 45 degrees.
            if abs(he * n - hn * e) > (he * e + hn * n) * TAN_TURN_MAX:
                out[TURNS] += 1.0
            if bends:
                cosine = (px * dx + py * dy + pz * dz) / (pl * length)
                out[BEND] += math.acos(min(max(cosine, -1.0), 1.0))
        he, hn, first = e, n, False
        px, py, pz, pl = dx, dy, dz, length


@device
def _yaw_terms(x, y, z, stride, out):  # type: ignore[no-untyped-def]
    """SSGWO's sums of exponentials of turns and slopes between nodes (eq. 29, 30)."""
    heading, first = 0.0, True
    for i in range(stride, len(x), stride):
        dx, dy, dz = x[i] - x[i - stride], y[i] - y[i - stride], z[i] - z[i - stride]
        run = math.sqrt(dx * dx + dy * dy)
        if run <= 0.0 and dz == 0.0:
            continue
        now = math.atan2(dy, dx) if run > 0.0 else heading
        # tan(45 degrees) is 1: the angle itself is needed beyond it alone.
        if abs(dz) > run * TAN_PITCH_MAX:
            out[PITCH] += math.exp(math.atan2(abs(dz), run) - PITCH_MAX)
        if not first:
            turn = abs(now - heading)
            if turn > math.pi:
                turn = 2.0 * math.pi - turn
            out[YAW] += math.exp(turn) - 1.0
        heading, first = now, False


@device
def _height_terms(z, ground, numbers, out):  # type: ignore[no-untyped-def]
    """MSFOA's altitude and terrain costs (eq. 21, 23)."""
    h_min, high, buried = numbers[H_MIN], 0.0, 0.0
    for i in range(len(z)):
        agl = z[i] - ground[i]
        high += max(0.0, agl - h_min)
        buried += max(0.0, -agl)
    out[HIGH], out[BURIED] = high / len(z), buried


@device
def _hiding_terms(x, y, z, ground, run, zones, corners, numbers, box, cost, out):  # type: ignore[no-untyped-def]
    """IB-ABC's concealment (eq. 4). ``cost`` (S,) is scratch: of a metre at each sample."""
    lit = 3.0 * (numbers[H_MAX] + D_HIDE)
    for i in range(len(x)):
        apart = z[i] - ground[i]
        cost[i] = apart - D_HIDE if apart >= D_HIDE else lit  # NaN is lit
    for k in range(len(zones)):
        zone = zones[k]
        reach = zone[ZR] + D_HIDE
        if _away(box, zone, reach):
            continue
        e, n, square, circle = zone[ZE], zone[ZN], reach * reach, zone[CORNERS] == 0.0
        for i in range(len(x)):
            dx, dy = x[i] - e, y[i] - n
            # What is near ground or another zone already needs no distance.
            if dx * dx + dy * dy < square and cost[i] != lit and (circle or gap_to(zone, corners, x[i], y[i]) < D_HIDE):
                cost[i] = lit
    exposed = 0.0
    for i in range(1, len(x)):
        exposed += cost[i] * run[i - 1]
    out[EXPOSED] = exposed


@device
def _box_of(x, y, box):  # type: ignore[no-untyped-def]
    """West, east, south, north of a path's samples."""
    west, east, south, north = x[0], x[0], y[0], y[0]
    for i in range(len(x)):
        west, east = min(west, x[i]), max(east, x[i])
        south, north = min(south, y[i]), max(north, y[i])
    box[0], box[1], box[2], box[3] = west, east, south, north


@device
def _legs(x, y, z, leg, run, weight, numbers, out):  # type: ignore[no-untyped-def]
    """Lengths, climbs and the length that each sample stands for."""
    n = len(x)
    length, flat, rise, steep = 0.0, 0.0, 0.0, 0.0
    up, down = numbers[UP], numbers[DOWN]
    for i in range(n - 1):
        dx, dy, dz = x[i + 1] - x[i], y[i + 1] - y[i], z[i + 1] - z[i]
        square = dx * dx + dy * dy
        r, d = math.sqrt(square), math.sqrt(square + dz * dz)
        run[i] = r
        leg[i] = d
        length += d
        flat += r
        rise += abs(dz)
        steep += max(max(dz - up * r, -dz - down * r), 0.0)
    run[n - 1] = 0.0
    leg[n - 1] = 0.0
    weight[0] = 0.5 * leg[0]
    for i in range(n - 1):
        weight[i + 1] = 0.5 * (leg[i] + leg[i + 1])
    out[LENGTH], out[FLAT], out[RISE], out[STEEP] = length, flat, rise, steep


@device
def _limit_terms(x, y, z, ground, floor, weight, numbers, out):  # type: ignore[no-untyped-def]
    """How much of a path is under its floor, over its ceiling, over unknown ground, out of the volume.

    Counted in floats and in short loops: mixed with whole numbers, or all in one, they would not be vectorised.
    """
    agl, amsl = numbers[MAX_AGL], numbers[MAX_AMSL]
    west, south, bottom = numbers[WEST], numbers[SOUTH], numbers[BOTTOM]
    east, north, top = numbers[EAST], numbers[NORTH], numbers[TOP]
    below, sunk, above, proud, unknown, under, outside, dark = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(1, len(x) - 1):  # start and goal are given, and stand on the floor itself
        w, h = weight[i], z[i]
        deep, high = max(0.0, floor[i] - h), max(0.0, h - min(ground[i] + agl, amsl))  # NaN comes second: 0 stays
        below += w if deep > 0.0 else 0.0
        sunk += w * deep
        above += w if high > 0.0 else 0.0
        proud += w * high
        under += 1.0 if deep > 0.0 else 0.0
    for i in range(len(x)):
        away = (x[i] < west) | (x[i] > east) | (y[i] < south) | (y[i] > north) | (z[i] < bottom) | (z[i] > top)
        outside += 1.0 if away else 0.0
    for i in range(len(x)):
        dark += 1.0 if floor[i] != floor[i] else 0.0
    if dark > 0.0:
        for i in range(len(x)):
            unknown += weight[i] if floor[i] != floor[i] else 0.0
    out[BELOW], out[SUNK], out[ABOVE], out[PROUD], out[UNKNOWN] = below, sunk, above, proud, unknown
    out[UNDER], out[OUTSIDE] = under + dark, outside


@kernel
def measure(  # type: ignore[no-untyped-def]
    paths, heights, quadratic, floors, floor_map, numbers, zones, corners, stride, wanted, scratch, box, out,
    sources=SOURCES,
):  # fmt: skip
    """Terms of P paths into ``out`` (P, TERMS).

    ``paths`` (P, 3, S) samples; ``stride`` of them between two nodes; ``wanted`` groups of terms; ``scratch`` SCRATCH
    arrays (S,), ``box`` (4,).
    """
    ground, floor, leg, run, weight, column, row = scratch
    shared = one_grid(heights, quadratic, floors, floor_map)
    for p in range(len(paths)):
        x, y, z = paths[p, 0], paths[p, 1], paths[p, 2]
        to = out[p]
        for k in range(TERMS):
            to[k] = 0.0
        _box_of(x, y, box)
        _legs(x, y, z, leg, run, weight, numbers, to)
        if shared and wanted & GROUND:
            lookup_both(floors, heights, floor_map, numbers, x, y, floor, ground, column, row)
        else:
            lookup(floors, floor_map, numbers, x, y, floor, column, row)
            if wanted & GROUND:
                lookup(heights, quadratic, numbers, x, y, ground, column, row)
        _limit_terms(x, y, z, ground, floor, weight, numbers, to)
        _zone_terms(
            x, y, z, heights, quadratic, numbers, leg, weight, zones, corners, box, (wanted & SAMPLES_NEAR) != 0, to
        )
        if wanted & ANGLES:
            _angle_terms(x, y, z, stride, (wanted & BENDS) != 0, to)
        if wanted & YAWS:
            _yaw_terms(x, y, z, stride, to)
        if wanted & NODES_NEAR:
            _near_terms(x, y, z, heights, quadratic, numbers, zones, corners, box, stride, to)
        if wanted & HEIGHTS:
            _height_terms(z, ground, numbers, to)
        if wanted & HIDING:
            _hiding_terms(x, y, z, ground, run, zones, corners, numbers, box, column, to)
