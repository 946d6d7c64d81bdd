"""True optima to compare planners with: exact tracks past discs, and altitude profiles by linear programme.

No code comes from the planners. The shortest track past discs consists of common tangents and arcs; the linear
programme works on a sampled floor and ceiling.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csr_array, eye_array, hstack, vstack
from scipy.sparse.csgraph import dijkstra

from gcsplan.arrays import Floats

TOUCH = 1e-9
"""Tolerance, in radii of the largest disc (at least 1 m), by which a tangent may enter a disc that it touches."""
NO_WAY = math.inf


def shortest_past_discs(start: tuple[float, float], goal: tuple[float, float], discs: Floats) -> float:
    """Length of the shortest track past the open ``discs`` (N, 3) of x, y, radius; inf if there is none.

    The track consists of common tangents (start and goal are discs of radius 0) and arcs between them; discs may
    overlap. The result is inf if an end lies inside a disc.
    """
    d = _without_nested(np.asarray(discs, dtype=np.float64).reshape(-1, 3))
    slack = TOUCH * max(1.0, float(d[:, 2].max(initial=0.0)))
    for end in (start, goal):
        if (np.hypot(d[:, 0] - end[0], d[:, 1] - end[1]) < d[:, 2] - slack).any():
            return NO_WAY
    all_discs = np.vstack([[*start, 0.0], [*goal, 0.0], d])
    at, of, ends, lengths = _tangents(all_discs, slack)
    rows, cols, weights = [ends[:, 0]], [ends[:, 1]], [lengths]
    for disc in range(2):  # all tangents of start (or goal) meet at that one point
        nodes = np.flatnonzero(of == disc)
        rows.append(nodes[:-1])
        cols.append(nodes[1:])
        weights.append(np.full(max(len(nodes) - 1, 0), 1e-300))
    for disc in range(2, len(all_discs)):
        nodes, arcs = _arcs(disc, at, of, all_discs, slack)
        if len(nodes):
            keep = np.isfinite(arcs)
            rows.append(nodes[keep])
            cols.append(np.roll(nodes, -1)[keep])
            weights.append(arcs[keep])
    first, last = np.flatnonzero(of == 0), np.flatnonzero(of == 1)
    if not len(first) or not len(last):
        return NO_WAY
    # Two arcs may join the same two nodes: keep the shorter one, since a sparse array would add them up.
    r, c, w = np.concatenate(rows), np.concatenate(cols), np.concatenate(weights)
    low, high = np.minimum(r, c).astype(np.int32), np.maximum(r, c).astype(np.int32)
    order = np.lexsort((w, high, low))
    low, high, w = low[order], high[order], w[order]
    one = np.ones(len(w), bool)
    one[1:] = (np.diff(low) != 0) | (np.diff(high) != 0)
    graph = csr_array((np.maximum(w[one], 1e-300), (low[one], high[one])), shape=(len(at), len(at)))
    return float(dijkstra(graph, directed=False, indices=first[0])[last[0]])


def _without_nested(d: Floats) -> Floats:
    """The discs that lie inside no other disc."""
    keep = np.ones(len(d), bool)
    for i in range(len(d)):
        for j in range(len(d)):
            inside = math.dist(d[i, :2], d[j, :2]) <= d[j, 2] - d[i, 2]
            if i != j and keep[j] and inside and (d[i, 2] < d[j, 2] or j < i):
                keep[i] = False
    return d[keep]


def _tangents(d: Floats, slack: float) -> tuple[Floats, NDArray[np.intp], NDArray[np.intp], Floats]:
    """All free common tangents: their ends (E, 2), the disc of each end (E,), tangents as pairs of ends (T, 2), and
    lengths (T,)."""
    i, j = np.triu_indices(len(d), 1)
    i, j, side, same = (
        a.ravel()
        for a in np.broadcast_arrays(
            i[:, None, None], j[:, None, None], np.array([-1.0, 1.0])[None, :, None], np.array([1.0, -1.0])[None, None]
        )
    )
    to = d[j, :2] - d[i, :2]
    apart = np.hypot(*to.T)
    # Cosine between the common normal and the line of centres; ``same`` = -1 gives the inner tangents.
    cosine = (d[i, 2] - same * d[j, 2]) / np.maximum(apart, 1e-300)
    # Where one disc is a point, inner and outer tangents are the same.
    ok = (np.abs(cosine) <= 1.0) & ((same > 0.0) | ((d[i, 2] > 0.0) & (d[j, 2] > 0.0)))
    if len(d) > 1:
        ok &= ~((d[i, 2] == 0.0) & (d[j, 2] == 0.0) & (side < 0.0))
    i, j, side, same, to, apart, cosine = (a[ok] for a in (i, j, side, same, to, apart, cosine))
    unit = to / apart[:, None]
    sine = side * np.sqrt(1.0 - cosine**2)
    normal = np.stack([unit[:, 0] * cosine - unit[:, 1] * sine, unit[:, 0] * sine + unit[:, 1] * cosine], axis=-1)
    a = d[i, :2] + d[i, 2, None] * normal
    b = d[j, :2] + (same * d[j, 2])[:, None] * normal
    along = b - a
    length = np.hypot(*along.T)
    for k in range(len(d)):
        off = d[k, :2] - a
        t = np.clip((off * along).sum(axis=1) / np.maximum(length**2, 1e-300), 0.0, 1.0)
        gap = np.hypot(*(off - t[:, None] * along).T)
        ok = gap >= d[k, 2] - slack
        a, b, along, length, i, j = a[ok], b[ok], along[ok], length[ok], i[ok], j[ok]
    count = len(a)
    return (
        np.vstack([a, b]),
        np.concatenate([i, j]),
        np.stack([np.arange(count), np.arange(count) + count], axis=-1),
        length,
    )


def _arcs(disc: int, at: Floats, of: NDArray[np.intp], d: Floats, slack: float) -> tuple[NDArray[np.intp], Floats]:
    """Tangent ends on a disc, sorted by angle, and the arc from each to the next; inf if another disc covers a part."""
    nodes = np.flatnonzero(of == disc)
    x, y, radius = d[disc]
    angle = np.arctan2(at[nodes, 1] - y, at[nodes, 0] - x)
    order = np.argsort(angle, kind="stable")
    nodes, angle = nodes[order], angle[order]
    span = np.diff(angle, append=angle[:1] + 2.0 * math.pi)
    free = np.ones(len(nodes), bool)
    for k in range(2, len(d)):
        apart = math.dist(d[k, :2], (x, y))
        if k == disc or apart >= radius + d[k, 2] - slack:
            continue
        # No end lies inside another disc, so an arc is covered if it contains the middle of the part that disc covers.
        middle = math.atan2(d[k, 1] - y, d[k, 0] - x)
        free &= ~((middle - angle) % (2.0 * math.pi) < span)
    return nodes, np.where(free, radius * span, NO_WAY)


@dataclass(frozen=True, eq=False)
class Profile:
    """Altitudes ``amsl_m`` (N,) at the samples, and the least sum of climb and descent (m)."""

    amsl_m: Floats
    vertical_m: float


def profile_by_programme(
    s_m: Floats, low_m: Floats, high_m: Floats, climb_slope: float = math.inf, descent_slope: float = math.inf
) -> Profile | None:
    """The profile between ``low_m`` and ``high_m`` (N,) with least climb plus descent; None if none is feasible.

    ``s_m`` (N,) are distances along the track; slopes are metres per metre.
    """
    n = len(s_m)
    run = np.diff(s_m)
    one, zero = eye_array(n - 1), csr_array((n - 1, n - 1))
    rise = eye_array(n - 1, n, k=1) - eye_array(n - 1, n)
    steep = np.concatenate([np.minimum(climb_slope, 1e6) * run, np.minimum(descent_slope, 1e6) * run])
    # The stubs of linprog know no sparse matrices, and no array of bounds.
    rows: Any = vstack([hstack([rise, -one]), hstack([-rise, -one]), hstack([rise, zero]), hstack([-rise, zero])])
    bounds: Any = np.vstack([np.stack([low_m, high_m], axis=-1), np.tile([0.0, np.inf], (n - 1, 1))])
    found: Any = linprog(
        np.concatenate([np.zeros(n), np.ones(n - 1)]),
        A_ub=rows,
        b_ub=np.concatenate([np.zeros(2 * (n - 1)), steep]),
        bounds=bounds,
    )
    return Profile(np.asarray(found.x[:n]), float(found.fun)) if found.status == 0 else None
