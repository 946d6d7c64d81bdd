"""From a track and its profile to few way points: vertices of both, thinned under the exact check."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.track import Flown, Track

Floats = NDArray[np.float64]

APART_M = 5.0
"""Way points nearer to each other than this are merged where that is legal (two acceptance radii of a copter)."""


def way_points(problem: Problem, track: Track, flown: Flown) -> tuple[Floats, NDArray[np.bool_]]:
    """(N, 3) every vertex of the track and of its profile, and (N,) which of them must stay."""
    profile = flown.profile
    s = np.concatenate([track.s_m, profile.s_m])
    must = np.concatenate([track.pinned, np.zeros(len(profile.s_m), bool)])
    order = np.lexsort((~must, s))
    s, must = s[order], must[order]
    # Vertices of both within a millimetre are one; the pinned one comes first.
    group = np.concatenate([[0], np.cumsum(np.diff(s) > 1e-3)])
    first = np.flatnonzero(np.concatenate([[True], np.diff(group) > 0]))
    pins = np.zeros(len(first), bool)
    np.logical_or.at(pins, group, must)
    at = s[first]
    for k in np.flatnonzero(pins):
        at[k] = s[group == k][must[group == k]][0]
    points = np.stack(
        [
            np.interp(at, track.s_m, track.points[:, 0]),
            np.interp(at, track.s_m, track.points[:, 1]),
            np.asarray(profile.at(at)),
        ],
        axis=-1,
    )
    points[0], points[-1] = problem.start, problem.goal
    return points, pins


def thin(problem: Problem, points: Floats, pinned: NDArray[np.bool_], worth: float) -> Floats:
    """(M, 3) fewer way points: none whose absence is legal and costs less than ``worth``, none needlessly close."""
    points, pinned = _drop(problem, points, pinned, worth)
    points, pinned = _spread(problem, points, pinned)
    return _drop(problem, points, pinned, worth)[0]


def clear(problem: Problem, points: Floats) -> NDArray[np.bool_]:
    """(N - 1,) which legs between neighbours are legal."""
    return problem.legal(points[:-1], points[1:])


def _cost(problem: Problem, points: Floats) -> float:
    return float(problem.leg_costs(points[:-1], points[1:]).sum())


def _drop(
    problem: Problem, points: Floats, pinned: NDArray[np.bool_], worth: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """Drop free points, all that can go in one sweep, until a sweep drops none. No two neighbours in one sweep."""
    spent = 0.0
    for _ in range(len(points)):
        n = len(points)
        if n < 3:
            break
        inner = np.arange(1, n - 1)
        legal = problem.legal(points[:-2], points[2:]) & ~pinned[inner]
        now = problem.leg_costs(points[:-1], points[1:])
        rise = problem.leg_costs(points[:-2], points[2:]) - now[:-1] - now[1:]
        drop = np.zeros(n, bool)
        for i in inner[np.argsort(rise, kind="stable")]:
            extra = max(float(rise[i - 1]), 0.0)
            if legal[i - 1] and not drop[i - 1] and not drop[i + 1] and spent + extra <= worth:
                drop[i] = True
                spent += extra
        if not drop.any():
            break
        points, pinned = points[~drop], pinned[~drop]
    return points, pinned


def _spread(problem: Problem, points: Floats, pinned: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.bool_]]:
    """Merge points nearer than `APART_M`, where one of a few places for the merged point is legal on both sides."""
    i = 0
    while i < len(points) - 1:
        if np.linalg.norm(points[i + 1] - points[i]) >= APART_M:
            i += 1
            continue
        a, b = points[i], points[i + 1]
        ends = (i == 0 or pinned[i], i + 1 == len(points) - 1 or pinned[i + 1])
        if all(ends):
            i += 1
            continue
        if any(ends):
            choices = [a if ends[0] else b]
        else:
            flat = 0.5 * (a + b)[:2]
            heights = (max(a[2], b[2]), min(a[2], b[2]), 0.5 * (a[2] + b[2]))
            choices = [a, b, *(np.array([*xy, z]) for xy in (a[:2], b[:2], flat) for z in heights)]
        best: Floats | None = None
        for choice in choices:
            new = np.vstack([points[:i], choice[None], points[i + 2 :]])
            near = new[max(i - 1, 0) : i + 2]
            if clear(problem, near).all() and (best is None or _cost(problem, new) < _cost(problem, best)):
                best = new
        if best is None:
            i += 1
            continue
        keep = pinned[i] or pinned[i + 1]
        pinned = np.concatenate([pinned[:i], [keep], pinned[i + 2 :]])
        points = best
    return points, pinned
