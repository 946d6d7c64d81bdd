"""Make a legal path shorter and simpler by many small moves at once; every move must pass the exact check.

Most of the work is the exact check, so no leg is checked twice for the same move: the result for a move stays valid
until a point that it depends on moves, and the second leg of a move is checked only if the first is legal.

`thinned` looks at the shape alone, and checks nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices, Int8s
from gcsplan.planners.problem import Problem

MOVED_PARTS = np.array([1.0, 0.5, 0.22, 0.1, 0.04, 0.015])
"""How far a point is moved towards the line between its neighbours, as parts of the distance to that line."""
MOVE_ROUNDS = 24
"""Most rounds of moves; each round moves the points of odd and then of even index."""
SHARE = 0.3
"""Part of the counted work left that the moves of one path may take: legs along a zone over a slope take long."""
LAST_GAIN = 2e-6
"""A round that gains at most this part of the cost is the last, where no other part is given."""

WAY_POINT_PRICE = 2e-5
"""The most that a path may become dearer for one way point less, as a part of its cost."""

OPEN, LEGAL, SHUT = 0, 1, 2
"""State of a choice: not checked, all its legs are legal, or one of them is not."""


def polished(problem: Problem, points: Floats, pinned: Bools, last_gain: float = LAST_GAIN) -> tuple[Floats, Bools]:
    """Move free points towards the lines between their neighbours as far as is legal: in space, in the plane alone, or
    in altitude alone. Returns the points (N, 3) and ``pinned`` (N,), which of them are terminals, unchanged.
    ``last_gain``: a round that gains at most this part of the cost is the last."""
    cost = problem.cost_through(points)
    points = points.copy()
    still = np.zeros(len(points), np.bool_)
    with problem.budget.allow(SHARE):
        for k in range(2 * MOVE_ROUNDS):
            if not problem.budget.goes_on():
                break
            _move(problem, points, pinned, still, k % 2)
            if k % 2:
                now = problem.cost_through(points)
                if cost - now <= last_gain * cost:
                    break
                cost = now
    return points, pinned


def _move(problem: Problem, points: Floats, pinned: Bools, still: Bools, parity: int) -> None:
    """Move every second point to the cheapest of its legal places; changes ``points``.

    ``still`` (N,): points without a cheaper legal place, until they or a neighbour move; updated here.
    """
    at = np.arange(1 + parity, len(points) - 1, 2)
    at = at[~(pinned[at] | still[at])]
    if not len(at):
        return
    before, here, after = points[at - 1], points[at], points[at + 1]
    chord = after - before
    flat = (chord[:, :2] ** 2).sum(axis=1)
    t = ((here - before)[:, :2] * chord[:, :2]).sum(axis=1) / np.maximum(flat, 1e-12)
    foot = before + np.clip(t, 0.0, 1.0)[:, None] * chord
    aims = np.stack([foot, foot, here], axis=1)  # (n, 3, 3): in space, in the plane alone, in altitude alone
    aims[:, 1, 2], aims[:, 2, 2] = here[:, 2], foot[:, 2]
    places = here[:, None, None] + MOVED_PARTS[None, None, :, None] * (aims - here[:, None])[:, :, None]
    places = places.reshape(len(at), -1, 3)
    old = problem.leg_costs(before, here) + problem.leg_costs(here, after)
    new = problem.leg_costs(before[:, None], places) + problem.leg_costs(places, after[:, None])
    gain = old[:, None] - new
    row, column = np.nonzero(gain > 1e-9 * old[:, None])
    place = places[row, column]
    legal = problem.legal(before[row], place)
    legal[legal] = problem.legal(place[legal], after[row[legal]])
    row, column = row[legal], column[legal]
    legally = np.full(gain.shape, -np.inf)
    legally[row, column] = gain[row, column]
    best = legally.argmax(axis=1)
    moved = np.unique(row)
    points[at[moved]] = places[moved, best[moved]]
    still[at] = True
    still[at[moved, None] + np.arange(-1, 2)] = False


@dataclass(frozen=True, eq=False, slots=True)
class _Choices:
    """The choices to remove one point, a row for each stretch of a path (N, 3): first the N - 2 stretches with one
    inner point, then the N - 3 with two.

    ``first``, ``last`` (R,): indices of the points at which a stretch begins and ends. ``mids`` (R, 12, 3): places of
    the one point that may replace two inner ones; valid where ``allowed`` (R, 12). For a stretch with one inner point
    the only choice is to leave it out; its place is then the place of ``first``.
    """

    first: Indices
    last: Indices
    mids: Floats
    allowed: Bools


def fewer(problem: Problem, points: Floats, pinned: Bools, most: float = math.inf) -> tuple[Floats, Bools]:
    """Remove points: leave one out, or replace two by one (see `_choices`), cheapest first, under the exact check. Each
    removal may cost `WAY_POINT_PRICE`, and all together ``most``, in the objective's unit. Returns the points and which
    of them are ``pinned`` (which stay)."""
    spent, price = 0.0, WAY_POINT_PRICE * problem.cost_through(points)
    came_from, marks = np.full(len(points), -1), np.zeros((0, 12), np.int8)
    while len(points) > 2:
        choices = _choices(points, pinned)
        first, last, mids = choices.first, choices.last, choices.mids
        now = np.concatenate([[0.0], np.cumsum(problem.leg_costs(points[:-1], points[1:]))])
        extra = problem.leg_costs(points[first][:, None], mids) + problem.leg_costs(mids, points[last][:, None])
        extra -= (now[last] - now[first])[:, None]
        cheap = choices.allowed & (extra <= min(price, most - spent))
        marks = _still_known(marks, came_from)
        _look(problem, points, choices, cheap & (marks == OPEN), marks)
        extra[~(cheap & (marks == LEGAL))] = np.inf
        best = extra.argmin(axis=1)
        more = extra[np.arange(len(best)), best]
        busy = bytearray(len(points))
        keep = np.ones(len(points), np.bool_)
        came_from = np.arange(len(points))
        points = points.copy()
        for row in np.argsort(more, kind="stable")[: np.count_nonzero(np.isfinite(more))].tolist():
            a, b, dearer = int(first[row]), int(last[row]), max(float(more[row]), 0.0)
            if any(busy[a : b + 1]) or spent + dearer > most:
                continue
            busy[a : b + 1] = bytes([1]) * (b + 1 - a)
            spent += dearer
            keep[b - 1] = False
            if b - a == 3:
                points[a + 1], came_from[a + 1] = mids[row, best[row]], -1
        if keep.all():
            break
        points, pinned, came_from = points[keep], pinned[keep], came_from[keep]
    return points, pinned


def _choices(points: Floats, pinned: Bools) -> _Choices:
    """All choices to remove one point of a path; see `_Choices`.

    Two points may be replaced by one at the place of either, midway, or where the outer legs meet; each place at three
    altitudes: the altitude of each point and the mean.
    """
    n = len(points)
    one, two = np.arange(n - 2), np.arange(n - 3)
    mids, allowed = np.zeros((2 * n - 5, 12, 3)), np.zeros((2 * n - 5, 12), np.bool_)
    mids[: n - 2] = points[:-2, None]
    allowed[: n - 2, 0] = ~pinned[1:-1]
    a, b, c, d = points[:-3], points[1:-2], points[2:-1], points[3:]
    p, q, w = b - a, c - d, d - a
    det = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    long = np.maximum((p[:, :2] ** 2).sum(axis=1), (q[:, :2] ** 2).sum(axis=1))
    meet = np.abs(det) > 1e-9 * np.maximum(long, 1e-12)
    det[~meet] = 1.0
    t, u = (w[:, 0] * q[:, 1] - w[:, 1] * q[:, 0]) / det, (w[:, 0] * p[:, 1] - w[:, 1] * p[:, 0]) / det
    meet &= (t >= 1.0) & (u >= 1.0)
    t[~meet] = 0.0
    middle = 0.5 * (b + c)
    height = np.sort(np.stack([b[:, 2], middle[:, 2], c[:, 2]], axis=1), axis=1)
    places, free = mids[n - 2 :].reshape(n - 3, 4, 3, 3), allowed[n - 2 :].reshape(n - 3, 4, 3)
    for k, place in enumerate((b, c, middle, a + t[:, None] * p)):
        places[:, k, :, :2] = place[:, None, :2]
    places[..., 2] = height[:, None]
    free[:] = ~(pinned[1:-2] | pinned[2:-1])[:, None, None]
    free[:, 3] &= meet[:, None]
    free[:, :, 1:] &= (height[:, 1:] != height[:, :-1])[:, None]
    return _Choices(np.concatenate([one, two]), np.concatenate([one + 2, two + 3]), mids, allowed)


def _still_known(marks: Int8s, came_from: Indices) -> Int8s:
    """The states of a path's choices that remain valid from the path before.

    ``came_from`` (N,): index of each point in the path before, -1 if it is new; ``marks``: the states of that path's
    choices. A stretch whose points are not the same ones in a row is `OPEN` again.
    """
    n, before = len(came_from), (len(marks) + 5) // 2
    known = np.zeros((2 * n - 5, 12), np.int8)
    beside = (came_from[:-1] >= 0) & (came_from[1:] == came_from[:-1] + 1)
    one = np.flatnonzero(beside[:-1] & beside[1:])
    known[one] = marks[came_from[one]]
    two = np.flatnonzero(beside[:-2] & beside[1:-1] & beside[2:])
    known[n - 2 + two] = marks[before - 2 + came_from[two]]
    return known


def _look(problem: Problem, points: Floats, choices: _Choices, unseen: Bools, marks: Int8s) -> None:
    """Run the exact check on the ``unseen`` choices (R, 12), and record the result in ``marks`` (R, 12)."""
    row, column = np.nonzero(unseen)
    first, last, place = choices.first[row], choices.last[row], choices.mids[row, column]
    legal = np.ones(len(row), np.bool_)
    two = last - first == 3
    legal[two] = problem.legal(points[first[two]], place[two])
    legal[legal] = problem.legal(place[legal], points[last[legal]])
    marks[row, column] = np.where(legal, LEGAL, SHUT)


def thinned(points: Floats, kept: Indices, corridor_m: float) -> Indices:
    """Indices of a subset of ``points`` (S, 3) whose polyline is within ``corridor_m`` of every point; ``kept`` stay.

    Douglas and Peucker 1973, between neighbours of ``kept``.
    """
    chosen = [int(kept[0])]
    for a, b in zip(kept[:-1].tolist(), kept[1:].tolist(), strict=True):
        stack, inside = [(a, b)], []
        while stack:
            i, j = stack.pop()
            if j - i < 2:
                continue
            off = _distances(points[i + 1 : j], points[i], points[j])
            worst = int(off.argmax())
            if off[worst] > corridor_m:
                middle = i + 1 + worst
                inside.append(middle)
                stack += [(i, middle), (middle, j)]
        chosen += [*sorted(inside), b]
    return np.array(chosen)


def _distances(points: Floats, a: Floats, b: Floats) -> Floats:
    """Distances (N,) of points from the segment a–b."""
    d = b - a
    square = float(d @ d)
    t = np.clip((points - a) @ d / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - (a + t[:, None] * d), axis=1))
