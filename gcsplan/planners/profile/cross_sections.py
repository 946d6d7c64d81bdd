"""Cross-section descent: a legal path is drawn together by moving all its points at once.

Each point gets candidate places on a cross-section of the path. The exact check judges every leg between places of two
neighbouring sections, and the cheapest chain of legs is found by dynamic programming. So points move together over an
edge or along a hillside, where a point alone would be stuck.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.track import divided
from gcsplan.world.geometry.path import track_length_m

FREE, UPRIGHT, FIXED = 0, 1, 2
"""Kinds of points: free to move, free to move up and down only, fixed."""
HALVINGS, ROUNDS = 7, 6
"""How often the size of the moves is halved, and most rounds with moves of one size."""
LITTLE = 1e-4
"""Part of the cost that a round must gain, or the moves are halved."""
ASIDE, UP = (0.0, -1.0, 1.0), (0.0, -1.0, -0.25, 0.25, 1.0)
"""Candidate places of a point, in moves to the side and up."""
FAR_AHEAD = 24
"""Most points that one leg may replace."""
SIZE, FEW = 0.016, 5
"""Twice the first moves of `tightened`, as a part of the path's length, and how often they are halved."""


def tightened(problem: Problem, points: Floats) -> tuple[Floats, Bools]:
    """A path (N, 3) drawn together with moves that suit its length, and (N,) which of its points are terminals."""
    size_m = SIZE * track_length_m(points)
    found, kinds = drawn(problem, points, kinds_of(problem, points), size_m, FEW)
    return found, kinds != FREE


def kinds_of(problem: Problem, points: Floats) -> Indices:
    """(N,) kinds of the points of a path that passes start, vias and goal."""
    kinds = np.full(len(points), FREE)
    at = 0
    for via in problem.via:
        off = np.hypot(points[at:, 0] - via.east_m, points[at:, 1] - via.north_m)
        off += 0.0 if via.amsl_m is None else np.abs(points[at:, 2] - via.amsl_m)
        at += int(np.argmax(off <= off.min() + 1e-6))
        kinds[at] = UPRIGHT if via.amsl_m is None else FIXED
    kinds[[0, -1]] = FIXED
    return kinds


def drawn(
    problem: Problem, points: Floats, kinds: Indices, size_m: float, halvings: int = HALVINGS
) -> tuple[Floats, Indices]:
    """A legal path (N, 3) of points of ``kinds`` (N,) made cheaper by moves of half ``size_m`` and less."""
    cost = problem.cost_through(points)
    for k in range(halvings):
        move_m = size_m * 0.5 ** (k + 1)
        for _ in range(ROUNDS):
            if not problem.budget.goes_on():
                return points, kinds
            finer, its_kinds = _divided(points, kinds, 1.5 * math.sqrt(size_m * move_m))
            moved = _moved(problem, finer, its_kinds, move_m)
            before, now = cost, problem.cost_through(moved)
            if now < cost:
                points, kinds, cost = moved, its_kinds, now
            if cost > before * (1.0 - LITTLE):
                break
        points, kinds = cheapest(problem, points, kinds)
        cost = problem.cost_through(points)
    return points, kinds


def cheapest(problem: Problem, points: Floats, kinds: Indices) -> tuple[Floats, Indices]:
    """The cheapest path over some points of a legal one, in order: all of its terminals, and of the others what
    helps."""
    n, ahead = len(points), min(FAR_AHEAD, len(points) - 1)
    terminals = np.concatenate([[0], np.cumsum(kinds != FREE)])
    last, back = (x.ravel() for x in np.meshgrid(np.arange(1, n), np.arange(1, ahead + 1), indexing="ij"))
    near = (back <= last) & (terminals[last] == terminals[np.maximum(last - back, 0) + 1])
    last, back = last[near], back[near]
    legal = back == 1
    legal[~legal] = problem.legal(points[last[~legal] - back[~legal]], points[last[~legal]])
    last, back = last[legal], back[legal]
    leg = np.full((n, ahead + 1), np.inf)
    leg[last, back] = problem.leg_costs(points[last - back], points[last])
    cost, before = np.zeros(n), np.zeros(n, np.intp)
    for k in range(1, n):
        most = min(k, ahead)
        over = cost[k - most : k] + leg[k, most:0:-1]
        before[k] = k - most + over.argmin()
        cost[k] = over.min()
    keep = [n - 1]
    while keep[-1] > 0:
        keep.append(int(before[keep[-1]]))
    keep.reverse()
    return points[keep], kinds[keep]


def _moved(problem: Problem, points: Floats, kinds: Indices, move_m: float) -> Floats:
    """The cheapest chain over places around each point, across the path and in height."""
    if len(points) < 3:
        return points
    along = points[2:] - points[:-2]
    aside = np.stack([-along[:, 1], along[:, 0], np.zeros(len(along))], axis=1)
    flat = np.hypot(aside[:, 0], aside[:, 1])
    aside = np.where(flat[:, None] > 1e-9, aside / np.maximum(flat, 1e-9)[:, None], np.array([1.0, 0.0, 0.0]))
    up = np.cross(along, aside)
    length = np.linalg.norm(up, axis=1)
    up = np.where(length[:, None] > 1e-9, up / np.maximum(length, 1e-9)[:, None], np.array([0.0, 0.0, 1.0]))
    kind = kinds[1:-1]
    aside[kind != FREE] = 0.0
    up[kind == UPRIGHT] = 0.0, 0.0, 1.0
    up[kind == FIXED] = 0.0
    # Where the climb is limited, a point moved aside must move up or down by less, or the legs are too steep.
    upright = min(1.0, problem.limits.max_climb_slope, problem.limits.max_descent_slope)
    i, j = (a.ravel()[:, None] for a in np.meshgrid(ASIDE, UP))
    places = points[1:-1, None] + move_m * (i * aside[:, None] + upright * j * up[:, None])  # (n, 15, 3)
    n, w = places.shape[:2]
    start = np.concatenate([np.repeat(points[:1], w, axis=0), np.repeat(places[:-1], w, axis=1).reshape(-1, 3)])
    end = np.concatenate([places[0], np.tile(places[1:], (1, w, 1)).reshape(-1, 3)])
    start, end = np.concatenate([start, places[-1]]), np.concatenate([end, np.repeat(points[-1:], w, axis=0)])
    legs = np.where(problem.legal(start, end), problem.leg_costs(start, end), np.inf)
    cost, before = legs[:w], []
    for step in legs[w:-w].reshape(n - 1, w, w):
        over = cost[:, None] + step
        before.append(over.argmin(axis=0))
        cost = over.min(axis=0)
    cost = cost + legs[-w:]
    at = int(cost.argmin())
    if not math.isfinite(cost[at]):
        return points  # where legs touch a limit, parts of them may fail by a rounding
    chosen = [at]
    for step_before in reversed(before):
        chosen.append(int(step_before[chosen[-1]]))
    out = points.copy()
    out[1:-1] = places[np.arange(n), chosen[::-1]]
    return out


def _divided(points: Floats, kinds: Indices, step_m: float) -> tuple[Floats, Indices]:
    """The same path with a point every ``step_m`` at least."""
    leg, part, parts = divided(points, step_m)
    t = (part / parts)[:, None]
    inner = points[leg] + t * (points[leg + 1] - points[leg])
    return np.vstack([inner, points[-1:]]), np.append(np.where(part == 0, kinds[leg], FREE), kinds[-1])
