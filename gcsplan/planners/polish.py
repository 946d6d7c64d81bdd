"""A legal path made shorter and simpler by many small moves at once, each put to the exact check."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Legs

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

PARTS = np.array([1.0, 0.5, 0.22, 0.1, 0.04, 0.015])
"""How far a point is moved towards the line between its neighbours, as parts of the way."""
ROUNDS = 24
LITTLE = 2e-6
"""A round of moves that gains no more, as a part of the cost, is the last."""


def polished(problem: Problem, points: Floats, pinned: Bools) -> tuple[Floats, Bools]:
    """Move free points towards the lines between their neighbours, in space and in the plane, as far as is legal."""
    cost = _cost(problem, points)
    for k in range(2 * ROUNDS):
        points = _moved(problem, points, pinned, k % 2)
        if k % 2:
            now = _cost(problem, points)
            if cost - now <= LITTLE * cost:
                break
            cost = now
    return points, pinned


def _moved(problem: Problem, points: Floats, pinned: Bools, parity: int) -> Floats:
    """The path with every second point moved to the cheapest of its legal places."""
    at = np.arange(1 + parity, len(points) - 1, 2)
    at = at[~pinned[at]]
    if not len(at):
        return points
    before, here, after = points[at - 1], points[at], points[at + 1]
    chord = after - before
    flat = (chord[:, :2] ** 2).sum(axis=1)
    t = ((here - before)[:, :2] * chord[:, :2]).sum(axis=1) / np.maximum(flat, 1e-12)
    foot = before + np.clip(t, 0.0, 1.0)[:, None] * chord
    level = foot.copy()
    level[:, 2] = here[:, 2]  # in the plane alone
    upright = here.copy()
    upright[:, 2] = foot[:, 2]  # in height alone
    aims = np.stack([foot, level, upright], axis=1)  # (n, 3, 3)
    places = here[:, None, None] + PARTS[None, None, :, None] * (aims - here[:, None])[:, :, None]
    places = places.reshape(len(at), -1, 3)
    old = problem.leg_costs(before, here) + problem.leg_costs(here, after)
    new = problem.leg_costs(before[:, None], places) + problem.leg_costs(places, after[:, None])
    gain = old[:, None] - new
    worth = gain > 1e-9 * old[:, None]
    row, column = np.nonzero(worth)
    if not len(row):
        return points
    place = places[row, column]
    legal = _clear(problem, before[row], place) & _clear(problem, place, after[row])
    gain = np.where(worth, gain, -np.inf)
    gain[row[~legal], column[~legal]] = -np.inf
    best = gain.argmax(axis=1)
    better = np.isfinite(gain[np.arange(len(at)), best])
    out = points.copy()
    out[at[better]] = places[np.arange(len(at)), best][better]
    return out


def fewer(problem: Problem, points: Floats, pinned: Bools, worth: float) -> tuple[Floats, Bools]:
    """Fewer points: one left out, or two made one where their outer legs meet, all of it for ``worth`` at most."""
    spent = 0.0
    while len(points) > 2:
        n = len(points)
        drop = np.array([i for i in range(1, n - 1) if not pinned[i]], np.intp)
        legs_a: list[Floats] = []
        legs_b: list[Floats] = []
        choices: list[tuple[int, Floats | None]] = []
        for i in drop.tolist():
            legs_a.append(points[i - 1 : i])
            legs_b.append(points[i + 1 : i + 2])
            choices.append((i, None))
        for i in range(1, n - 2):
            if not pinned[i] and not pinned[i + 1]:
                for corner in _corners(points[i - 1 : i + 3]):
                    choices.append((i, corner))
                    legs_a.append(np.array([points[i - 1], corner]))
                    legs_b.append(np.array([corner, points[i + 2]]))
        if not choices:
            break
        # Costs of what is now, and of what would be instead: two legs for one, three for two.
        now = np.concatenate([[0.0], np.cumsum(problem.leg_costs(points[:-1], points[1:]))])
        first = np.array([i - 1 for i, _ in choices])
        last = np.array([i + (1 if choice is None else 2) for i, choice in choices])
        mids = np.array([points[i - 1] if choice is None else choice for i, choice in choices])
        extra = (
            problem.leg_costs(points[first], mids) + problem.leg_costs(mids, points[last]) - (now[last] - now[first])
        )
        cheap = [k for k in np.argsort(extra, kind="stable").tolist() if spent + max(float(extra[k]), 0.0) <= worth]
        if not cheap:
            break
        sizes = [len(legs_a[k]) for k in cheap]
        ok = _clear(problem, np.concatenate([legs_a[k] for k in cheap]), np.concatenate([legs_b[k] for k in cheap]))
        firsts = np.cumsum([0, *sizes[:-1]])
        legal = [k for k, f, size in zip(cheap, firsts, sizes, strict=True) if ok[f : f + size].all()]
        taken: list[tuple[int, Floats | None]] = []
        busy: set[int] = set()
        for k in legal:
            i, choice = choices[k]
            touched = set(range(i - 1, i + (2 if choice is None else 3)))
            if touched & busy or spent + max(float(extra[k]), 0.0) > worth:
                continue
            busy |= touched
            spent += max(float(extra[k]), 0.0)
            taken.append((i, choice))
        if not taken:
            break
        keep = np.ones(n, np.bool_)
        points = points.copy()
        for i, place in taken:
            if place is None:
                keep[i] = False
            else:
                points[i] = place
                keep[i + 1] = False
        points, pinned = points[keep], pinned[keep]
    return points, pinned


def _corners(four: Floats) -> list[Floats]:
    """Places for one point instead of the two in the middle: where the outer legs meet, at a few heights."""
    a, b, c, d = four
    p, q, w = b - a, c - d, d - a
    det = p[0] * q[1] - p[1] * q[0]
    places = [b[:2], c[:2], 0.5 * (b + c)[:2]]
    if abs(det) > 1e-9 * max(float(p[:2] @ p[:2]), float(q[:2] @ q[:2]), 1e-12):
        t, u = (w[0] * q[1] - w[1] * q[0]) / det, (w[0] * p[1] - w[1] * p[0]) / det
        if t >= 1.0 and u >= 1.0:
            places.append(a[:2] + t * p[:2])
    heights = {max(b[2], c[2]), min(b[2], c[2]), 0.5 * (b[2] + c[2])}
    return [np.array([*place, z]) for place in places for z in sorted(heights)]


def _clear(problem: Problem, start: Floats, end: Floats) -> Bools:
    return problem.airspace.clear(Legs.between(start, end, problem.limits), problem.limits)


def _cost(problem: Problem, points: Floats) -> float:
    return float(problem.leg_costs(points[:-1], points[1:]).sum())
