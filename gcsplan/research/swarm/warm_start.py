"""Warm start: members of the first population around a known path: of the planner `optimal` or of another vehicle.

The control points whose curve is nearest to the path are found by least squares, and then the numbers that encode them.
One member is the path itself, as well as the encoding can draw it; others are scattered around it, and the rest of the
population stays random, so that a search can still leave the corridor.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.planners.problem import Problem
from gcsplan.research.swarm.encodings import along_and_aside, get_encoding

if TYPE_CHECKING:
    from gcsplan.research.swarm.objectives import Cost
    from gcsplan.research.swarm.settings import Settings

OPTIMAL = "optimal"
MORE_POINTS = 2
"""Times the way points of a search that begins anywhere."""
RAISES = 8
"""Rounds in which a curve is raised where it is below the path."""
SHARE, SPREAD = 0.25, 0.02
"""Part of the first population that is around the path, and the standard deviation of its numbers, in parts of the
unit box."""


def resolved(problem: Problem, settings: Settings) -> Settings:
    """``settings`` with the path of the planner `optimal`, if they request it. Raises NoMission if it finds none.

    By default, a search around a path has `MORE_POINTS` times the encoding's way points: it can follow the path more
    closely, and need not find it among so many numbers.
    """
    around, points = settings.around, settings.points
    if around is None and settings.warm_start == OPTIMAL:
        from gcsplan.planners.registry import get

        around = get(OPTIMAL).plan(replace(problem, options={}, turn_radius_m=0.0, progress=None)).path.points
    if around is not None and points is None:
        points = MORE_POINTS * get_encoding(settings.encoding).points
    return replace(settings, around=around, points=points)


def members(cost: Cost, path: Floats, seed: int, population: int) -> Floats:
    """Members (m, dim) of a first ``population`` around a polyline (N, 3), the first of them nearest to it.

    Raises InputError if the polyline has no length.
    """
    nearest = encoded(cost, path)
    count = max(1, round(SHARE * population))
    noise = np.random.default_rng([seed, 1]).standard_normal((count, cost.dim))
    noise[0] = 0.0
    return np.clip(nearest + SPREAD * noise, 0.0, 1.0)


def encoded(cost: Cost, path: Floats) -> Floats:
    """The numbers (dim,) whose curve is nearest to a polyline (N, 3), as far as the encoding reaches."""
    if len(path) < 2 or not float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) > 0.0:
        raise InputError("the path to start from has no length")
    code, curve = cost.code, cost.curve
    scene, encoding = code.scene, code.encoding
    parts = _stages(path, scene.terminals)
    out, row = [], 0
    for i, (count, part) in enumerate(zip(code.points, parts, strict=True)):
        a, b = scene.terminals[i], scene.terminals[i + 1]
        samples = slice(int(curve.terminals[i]), int(curve.terminals[i + 1]) + 1)
        basis = curve.basis[row : row + count + 2, samples]
        stations = encoding.stations(count)
        if stations is None:
            places = _resampled(part, basis.shape[1])
        else:
            places = _over(part, a, b, np.asarray(np.concatenate([[0.0], stations, [1.0]]) @ basis, np.float64))
        inner = _fitted(basis, a, b, places)
        out.append(encoding.encode(scene, a, b, inner).ravel())
        row += count + 1
    return np.clip(np.concatenate(out), 0.0, 1.0)


def _fitted(basis: Floats, a: Floats, b: Floats, places: Floats) -> Floats:
    """Control points (K, 3) between ``a`` and ``b`` whose curve is nearest to ``places`` (S, 3), and hardly below it.

    A path near the ground is smoothed into the ground. So where the curve is below it, the path is raised.
    """
    of_ends = basis[[0, -1]].T @ np.stack([a, b])
    solver = np.linalg.pinv(basis[1:-1].T)
    inner = np.asarray(solver @ (places - of_ends))
    raised = places[:, 2].copy()
    for _ in range(RAISES):
        z = of_ends[:, 2] + basis[1:-1].T @ inner[:, 2]
        raised += np.maximum(places[:, 2] - z, 0.0)
        inner[:, 2] = solver @ (raised - of_ends[:, 2])
    return inner


def _stages(path: Floats, terminals: Floats) -> list[Floats]:
    """The polyline cut at its vertices nearest to the via points, in order; each part begins and ends at terminals."""
    cuts = [0]
    for via in terminals[1:-1]:
        rest = np.linalg.norm(path[cuts[-1] :, :2] - via[:2], axis=1)
        cuts.append(cuts[-1] + int(rest.argmin()))
    cuts.append(len(path) - 1)
    return [
        np.vstack([terminals[i], path[a + 1 : b], terminals[i + 1]])
        for i, (a, b) in enumerate(itertools.pairwise(cuts))
    ]


def _resampled(path: Floats, count: int) -> Floats:
    """Points (count, 3) evenly spaced along a polyline."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.linspace(0.0, s[-1], count)
    return np.stack([np.interp(at, s, path[:, i]) for i in range(3)], axis=-1)


def _over(path: Floats, a: Floats, b: Floats, parts: Floats) -> Floats:
    """Points (n, 3) of a polyline over ``parts`` (n,) of the straight track from ``a`` to ``b``.

    Where it turns back along the track, its farthest point so far counts.
    """
    dense = _resampled(path, 8 * len(parts))
    along, aside = along_and_aside(a, b, dense)
    ahead = np.maximum.accumulate(along)
    keep = np.concatenate([[True], np.diff(ahead) > 0.0])
    side, z = (np.interp(parts, ahead[keep], values[keep]) for values in (aside, dense[:, 2]))
    track = b[:2] - a[:2]
    left = np.array([-track[1], track[0]])
    return np.column_stack([a[:2] + parts[:, None] * track + side[:, None] * left, z])
