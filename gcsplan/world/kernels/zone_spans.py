"""Where a track is within reach of zones, and how deep a leg comes inside one."""

from __future__ import annotations

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.world.geometry.zones import Circle
from gcsplan.world.kernels.shared import (
    CEILING_AGL,
    EAST,
    EAST_E,
    FIRST,
    FLOOR_AGL,
    LAST,
    NORTH,
    NORTH_N,
    RADIUS,
    SOUTH_N,
    WEST_E,
    Zones,
)

DEEP_M, DEEP_PART = 0.005, 0.0005
MOST_LOOKS = 200_000


def spans(track: Floats, zones: Zones, within_m: float, over_ground_m: float) -> list[tuple[int, float, float]]:
    """(zone, s0_m, s1_m) of each span of ``track`` (N, 2) within reach of a zone, by zone and distance along the track.

    The reach is ``within_m``, or ``over_ground_m`` for a zone with a level over ground.
    """
    table = zones.table
    start, step = track[:-1], np.diff(track, axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    begin = np.cumsum(length) - length
    reach = np.where((table[:, FLOOR_AGL] != 0.0) | (table[:, CEILING_AGL] != 0.0), over_ground_m, within_m)
    low, high = np.minimum(start, start + step), np.maximum(start, start + step)
    legs, which = np.nonzero(
        (length[:, None] > 0.0)
        & (table[:, WEST_E] - reach <= high[:, None, 0])
        & (table[:, EAST_E] + reach >= low[:, None, 0])
        & (table[:, SOUTH_N] - reach <= high[:, None, 1])
        & (table[:, NORTH_N] + reach >= low[:, None, 1])
    )
    found: list[tuple[int, float, float]] = []
    for leg, k in zip(legs.tolist(), which.tolist(), strict=True):
        unit = step[leg] / length[leg]
        if table[k, RADIUS] >= 0.0:
            away = table[k, [EAST, NORTH]] - start[leg]
            parts = _circle(away, unit, float(table[k, RADIUS] + reach[k]), float(length[leg]))
        else:
            corners = zones.vertex[int(table[k, FIRST]) : int(table[k, LAST])] - start[leg]
            parts = _polygon(corners, unit, float(reach[k]), float(length[leg]))
        found += [(k, float(begin[leg] + a), float(begin[leg] + b)) for a, b in parts]
    found.sort()
    merged: list[tuple[int, float, float]] = []
    for k, s0, s1 in found:
        # A span that continues on the next leg is one span.
        if merged and merged[-1][0] == k and s0 <= merged[-1][2] + 1e-6:
            merged[-1] = (k, merged[-1][1], max(merged[-1][2], s1))
        else:
            merged.append((k, s0, s1))
    return merged


def _circle(away: Floats, unit: Floats, radius: float, length: float) -> list[tuple[float, float]]:
    middle, aside = float(away @ unit), float(away[1] * unit[0] - away[0] * unit[1])
    if abs(aside) >= radius:
        return []
    half = float(np.sqrt((radius - aside) * (radius + aside)))
    a, b = max(middle - half, 0.0), min(middle + half, length)
    return [(a, b)] if a <= b else []


def _polygon(corners: Floats, unit: Floats, reach: float, length: float) -> list[tuple[float, float]]:
    """Parts of the line from the origin along ``unit`` within ``reach`` of a polygon, its inside included."""
    along = corners @ unit
    aside = corners[:, 1] * unit[0] - corners[:, 0] * unit[1]
    low, high, crossing = grown_edges(along, aside, reach)
    keep = (low <= high) & (high >= 0.0) & (low <= length)
    marks = sorted(zip(low[keep].clip(0.0, length).tolist(), high[keep].clip(0.0, length).tolist(), strict=True))
    crossings = np.sort(crossing[~np.isnan(crossing)])
    out: list[tuple[float, float]] = []
    done = 0.0
    for a, b in [*marks, (length, length)]:
        # A gap between two parts is entirely inside or outside the polygon; an inside gap belongs to the span.
        inside = a > done and np.searchsorted(crossings, 0.5 * (a + done)) % 2 == 1
        first = done if inside else a
        if out and first <= out[-1][1]:
            out[-1] = (out[-1][0], max(out[-1][1], b))
        elif first < b:
            out.append((first, b))
        done = max(done, b)
    return out


def deepest_inside(corners: Floats, start: Floats, end: Floats) -> tuple[float, float]:
    """Greatest distance from a polygon's border of a segment's point inside it, and where on the segment (0 … 1).

    Never too small, and too large by at most `DEEP_M` or `DEEP_PART` of it, unless `MOST_LOOKS` places end the search
    early; 0 if no part is inside. For reports.
    """
    length = float(np.hypot(*(end - start)))
    best, at, looks = 0.0, 0.5, 0
    middle, half = np.linspace(0.0, 1.0, 33), 1.0 / 64
    while len(middle):
        depth = _depth_inside(corners, start + middle[:, None] * (end - start))
        k = int(depth.argmax())
        if depth[k] > best:
            best, at = float(depth[k]), float(middle[k])
        # The signed distance from the border changes by no more than the distance moved, inside and outside.
        looks += len(middle)
        spare = max(DEEP_M, DEEP_PART * best) if looks < MOST_LOOKS else np.inf
        open_ = middle[depth + half * length > best + spare]
        half *= 0.5
        middle = np.concatenate([open_ - half, open_ + half])
        middle = middle[(middle >= -half) & (middle <= 1.0 + half)].clip(0.0, 1.0)
    return (best + max(DEEP_M, DEEP_PART * best) if best > 0.0 else 0.0), at


def deepest_in_circle(shape: Circle, radius_m: float, p: Floats, q: Floats) -> tuple[float, float]:
    """How deep a segment gets into a circle, m, and where on it."""
    way, to = q - p, np.array([shape.east_m, shape.north_m]) - p
    square = float(way @ way)
    t = min(max(float(to @ way) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return radius_m - float(np.hypot(*(to - t * way))), t


def _depth_inside(corners: Floats, p: Floats) -> Floats:
    """(N,) signed distance of points (N, 2) from a polygon's border, positive inside."""
    after = np.roll(corners, -1, axis=0)
    edge = after - corners
    away = p[:, None] - corners
    w = ((away * edge).sum(-1) / np.maximum((edge * edge).sum(-1), 1e-30)).clip(0.0, 1.0)
    distance = np.linalg.norm(away - w[..., None] * edge, axis=-1).min(axis=1)
    e, n = p[:, :1], p[:, 1:]
    spans_n = (corners[:, 1] > n) != (after[:, 1] > n)
    with np.errstate(divide="ignore", invalid="ignore"):
        east_of = corners[:, 0] + (n - corners[:, 1]) / edge[:, 1] * edge[:, 0] > e
    return np.asarray(np.where((spans_n & east_of).sum(axis=1) % 2 == 1, distance, -distance))


def grown_edges(along: Floats, aside: Floats, reach: float) -> tuple[Floats, Floats, Floats]:
    """For each edge of a polygon, grown by ``reach``: the part of a line within it, and where the line crosses it.

    ``along``, ``aside`` (…, N) are the corners' coordinates along and beside the line. If no part is met, the beginning
    is above the end (inf, -inf); if nothing is crossed, the crossing is NaN.
    """
    along1, aside1 = np.roll(along, -1, axis=-1), np.roll(aside, -1, axis=-1)
    low, high = np.full(along.shape, np.inf), np.full(along.shape, -np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        # An edge grown by a disc is a strip and two discs; the hull of the line's parts in them is exact.
        for a, o in ((along, aside), (along1, aside1)):
            half = np.sqrt(reach * reach - o * o)
            low, high = np.fmin(low, a - half), np.fmax(high, a + half)
        edge = np.hypot(along1 - along, aside1 - aside)
        for side in (-reach, reach):
            a = along - side * (aside1 - aside) / edge
            o = aside + side * (along1 - along) / edge
            w = -o / (aside1 - aside)
            cut = np.where((w >= 0.0) & (w <= 1.0), a + w * (along1 - along), np.nan)
            low, high = np.fmin(low, cut), np.fmax(high, cut)
        crossing = np.where(
            (aside > 0.0) != (aside1 > 0.0), along - aside * (along1 - along) / (aside1 - aside), np.nan
        )
    return low, high, crossing
