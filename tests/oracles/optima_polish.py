"""Make any feasible path cheaper, using only legs that the exact check passes.

A path is pulled taut (`pull`), then all its points are improved together (`polish`): each point tries about twenty
places, and dynamic programming picks the cheapest combination of clear legs between them. No code is shared with the
planners.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Legs
from gcsplan.world.geometry.path import Path


@dataclass(frozen=True, slots=True)
class Effort:
    """How hard to search: ``points`` in the plane and altitude ``levels`` of the lattice; ``tries``, all but the first
    with disturbed costs; ``rounds`` of `polish` per scale; how many of the ``best`` paths to polish; seconds for each.
    """

    points: int = 300
    levels: int = 4
    tries: int = 2
    rounds: int = 3
    best: int = 1
    polish_s: float = 0.25


QUICK = Effort()
PATIENT = Effort(900, 7, 8, 12, 3, 3.0)


def clear(problem: Problem, start: Floats, end: Floats) -> NDArray[np.bool_]:
    """Which legs (N,) the exact check passes."""
    n, limits = len(start), problem.limits
    errors = np.full(n, limits.track_error_m), np.full(n, limits.altitude_error_m)
    return problem.airspace.clear(Legs(start, end, np.zeros(n, np.bool_), *errors), limits)


def is_feasible(problem: Problem, points: Floats) -> bool:
    """Whether a path starts at the start, ends at the goal, passes all vias in order, and every leg is clear."""
    ends = np.array([problem.start, problem.goal])
    stops = [(v.east_m, v.north_m, v.amsl_m) for v in problem.via]
    at = 0
    for east, north, amsl in stops:
        while at < len(points) and not (
            math.dist(points[at, :2], (east, north)) < 1e-6 and (amsl is None or abs(points[at, 2] - amsl) < 1e-6)
        ):
            at += 1
    return bool(
        at < len(points)
        and np.abs(points[[0, -1]] - ends).max() < 1e-6
        and clear(problem, points[:-1], points[1:]).all()
    )


def thinner(amsl_m: Any) -> Any:
    """True airspeed per indicated one, by the temperature and the pressure of the standard atmosphere."""
    warm = 1.0 - 0.0065 * amsl_m / 288.15
    return 1.0 / np.sqrt(warm ** (9.80665 / (287.053 * 0.0065)) / warm)


def leg_costs(problem: Problem, a: Floats, b: Floats) -> Floats:
    """Metres, joules or seconds of legs (..., 3) to (..., 3)."""
    d = b - a
    flat = np.hypot(d[..., 0], d[..., 1])
    if problem.objective == "time" and problem.airspeed is not None:
        fast, rise = problem.airspeed, d[..., 2]
        thin = thinner(a[..., 2] + np.linspace(0.0, 1.0, 33).reshape(-1, *[1] * rise.ndim) * rise)
        # The least time of which the way, less what the wind carries meanwhile, is flown at the airspeed.
        carried, still = d[..., :2] @ np.array(fast.wind_m_s), np.hypot(flat, rise)
        spare = (fast.indicated_m_s * thin) ** 2 - math.hypot(*fast.wind_m_s) ** 2
        along = (np.sqrt(spare * still**2 + carried**2) - carried) / spare
        rates = np.maximum(rise / fast.climb_m_s, -rise / fast.descent_m_s) / thin
        return np.asarray(np.maximum(along, rates).mean(axis=0))
    if problem.objective == "time":
        times = flat / problem.speed_m_s, d[..., 2] / problem.climb_m_s, -d[..., 2] / problem.descent_m_s
        return np.asarray(np.maximum.reduce(times))
    if problem.objective == "energy":
        return problem.horizontal_j_per_m * flat + problem.vertical_j_per_m * np.abs(d[..., 2])
    return np.hypot(flat, d[..., 2])


def cost_of(problem: Problem, points: Floats) -> float:
    """Cost of a path by the problem's objective."""
    if problem.objective == "time":
        return float(leg_costs(problem, points[:-1], points[1:]).sum())
    return problem.cost(Path(points))


def pinned(problem: Problem, points: Floats) -> Floats:
    """Which coordinates (N, 3) of a path's points are fixed: its ends' coordinates, and its vias' in order."""
    fixed = np.zeros(points.shape, bool)
    fixed[[0, -1]] = True
    at = 0
    for v in problem.via:
        while math.dist(points[at, :2], (v.east_m, v.north_m)) >= 1e-6 or (
            v.amsl_m is not None and abs(points[at, 2] - v.amsl_m) >= 1e-6
        ):
            at += 1
        fixed[at, :2] = True
        fixed[at, 2] |= v.amsl_m is not None
    return fixed


def pull(problem: Problem, points: Floats, pieces: int = 40) -> Floats:
    """The cheapest path of clear legs through points on the given path: its own and others at even steps between."""
    for _ in range(3):
        before = cost_of(problem, points)
        fine = _subdivide(points, float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) / pieces)
        points = _shortcut(problem, fine)
        if cost_of(problem, points) > before * (1.0 - 1e-6):
            break
    return points


def _subdivide(points: Floats, step_m: float) -> Floats:
    parts = [points[:1]]
    for a, b in pairwise(points):
        n = max(1, math.ceil(float(np.linalg.norm(b - a)) / max(step_m, 1e-9) - 1e-6))
        parts.append(a + np.linspace(0.0, 1.0, n + 1)[1:, None] * (b - a))
    return np.vstack(parts)


def _shortcut(problem: Problem, points: Floats, leg_cost: float = 1e-12) -> Floats:
    stops = np.flatnonzero(pinned(problem, points)[:, 0])
    out = [points[:1]]
    for first, last in pairwise(stops):
        part = points[first : last + 1]
        i, j = np.triu_indices(len(part), 1)
        ok = clear(problem, part[i], part[j]) | (j == i + 1)
        cost = leg_costs(problem, part[i], part[j])
        best, back = np.full(len(part), np.inf), np.zeros(len(part), int)
        best[0] = 0.0
        table = np.full((len(part), len(part)), np.inf)
        table[i[ok], j[ok]] = cost[ok]
        for k in range(1, len(part)):
            # Every leg costs a little extra, so that points that gain nothing are dropped.
            total = best[:k] + table[:k, k] * (1.0 + 1e-12) + leg_cost
            back[k] = int(np.argmin(total))
            best[k] = total[back[k]]
        chain = [len(part) - 1]
        while chain[-1]:
            chain.append(int(back[chain[-1]]))
        out.append(part[chain[::-1]][1:])
    return np.vstack(out)


def simplify(problem: Problem, points: Floats, worth: float = 5e-6) -> Floats:
    """The path with fewer points: each one removed may raise the cost by about ``worth`` of it."""
    few = _shortcut(problem, points, worth * cost_of(problem, points))
    return few if is_feasible(problem, few) else points


def polish(
    problem: Problem, points: Floats, rng: np.random.Generator, effort: Effort = QUICK, widest: float = 0.02
) -> Floats:
    """Improve a feasible path, by wide moves first (``widest`` of its length), then finer ones.

    The result never costs more and is always clear.
    """
    until = time.perf_counter() + effort.polish_s
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    wide = widest * length
    while wide > 1e-6 * length and time.perf_counter() < until:
        points = _refined(points, length)
        for _ in range(effort.rounds):
            before = cost_of(problem, points)
            points = _improve(problem, points, wide, rng)
            if cost_of(problem, points) > before * (1.0 - 1e-7) or time.perf_counter() > until:
                break
        shorter = _shortcut(problem, points)
        points = shorter if cost_of(problem, shorter) <= cost_of(problem, points) else points
        wide /= 2.5
    return points


def _refined(points: Floats, length: float, most: int = 40) -> Floats:
    """The path with more points: on long legs, and on both sides of bends, the sharpest bends first."""
    points = _subdivide(points, length / 6.0)
    d = np.diff(points, axis=0)
    legs = np.linalg.norm(d, axis=1)
    unit = d / np.maximum(legs, 1e-9)[:, None]
    bend = np.concatenate([[0.0], np.arccos(np.clip((unit[1:] * unit[:-1]).sum(axis=1), -1.0, 1.0)), [0.0]])
    room = max(0, (most - len(points)) // 2)
    sharp = set(np.argsort(-bend)[:room][np.sort(-bend)[:room] < -0.04].tolist())
    out = [points[0]]
    for k in range(1, len(points)):
        a, b = points[k - 1], points[k]
        # A leg between two bends is split in thirds; its middle third stays straight.
        if k - 1 in sharp:
            out.append(a + (b - a) / 3.0)
        if k in sharp:
            out.append(b - (b - a) / 3.0)
        out.append(b)
    return np.array(out)


def _improve(problem: Problem, points: Floats, wide: float, rng: np.random.Generator) -> Floats:
    """Move every point by about ``wide`` (m): the cheapest of all clear combinations of tried places."""
    air, limits = problem.airspace, problem.limits
    n = len(points)
    fixed = pinned(problem, points)
    along = np.zeros((n, 2))
    along[1:-1] = points[2:, :2] - points[:-2, :2]
    along /= np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    tall = wide * float(rng.choice([0.1, 0.3, 1.0]))
    shifts = np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1], [0.4, 0, 0], [-0.4, 0, 0], [0, 1, 0]])
    shifts = np.vstack([shifts, [[0, -1, 0]], rng.normal(0.0, 0.6, (5, 3))])
    flat = wide * (shifts[None, :, :1] * across[:, None] + shifts[None, :, 1:2] * along[:, None])
    rise = np.broadcast_to(tall * shifts[:, 2:], (n, len(shifts), 1))
    at = points[:, None] + np.concatenate([flat, rise], axis=-1)
    # Also try the lowest and the highest legal altitude over the first three places.
    floor = air.floor_amsl(at[:, :3, 0], at[:, :3, 1], limits)
    ceiling = np.minimum(air.ceiling_amsl(at[:, :3, 0], at[:, :3, 1], limits), 1e6)
    lowest, highest = at[:, :3].copy(), at[:, :3].copy()
    lowest[..., 2] = np.where(np.isfinite(floor), floor, lowest[..., 2])
    highest[..., 2] = np.where(np.isfinite(ceiling) & (ceiling < 1e6), ceiling, highest[..., 2])
    at = np.concatenate([at, lowest, highest], axis=1)
    at = np.where(fixed[:, None], points[:, None], at)
    m = at.shape[1]
    a = np.broadcast_to(at[:-1, :, None], (n - 1, m, m, 3)).reshape(-1, 3)
    b = np.broadcast_to(at[1:, None], (n - 1, m, m, 3)).reshape(-1, 3)
    cost = np.where(clear(problem, a, b), leg_costs(problem, a, b), np.inf).reshape(n - 1, m, m)
    cost[:, 0, 0] = leg_costs(problem, points[:-1], points[1:])  # the path as given is clear already
    total = np.full(m, np.inf)
    total[0] = 0.0
    back = np.zeros((n, m), int)
    for k in range(n - 1):
        ways = total[:, None] + cost[k]
        back[k + 1] = ways.argmin(axis=0)
        total = ways[back[k + 1], np.arange(m)]
    choice = [int(total.argmin())]
    for k in range(n - 1, 0, -1):
        choice.append(int(back[k, choice[-1]]))
    found = at[np.arange(n), choice[::-1]]
    found[-1] = points[-1]
    gone = np.zeros(n, bool)
    gone[1:] = (np.abs(np.diff(found, axis=0)).max(axis=1) < 1e-9) & ~fixed[1:].any(axis=1)
    return found[~gone]
