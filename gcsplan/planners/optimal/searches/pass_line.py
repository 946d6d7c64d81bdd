"""The line on which a track crosses a pass that is open by centimetres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.track import denser

DENSE_M, BEFORE_M, MOST_PLACES = 0.5, 15.0, 600
"""Step of a track through a pass, m; how far before and behind the pass it may be moved; and its most places."""
SIDE_M, TRIED, MOST_ASIDE, WITHIN_M = 6.0, 49, 3, 1e-3
"""How far it may be moved aside, m; the places tried for that; how many of them from step to step; and how closely the
lowest floor is found, m."""
STRAIGHT_M = 2e-3
"""Metres by which its places may be left aside where it is straight."""
SPARE_M, DEAR, LITTLE = 0.1, 100.0, 1e-6
"""Metres below the cap at which a floor is low enough; metres aside that a metre lower is worth; and what decides
between floors that are alike."""


@dataclass(frozen=True, eq=False, slots=True)
class _Strip:
    """The ``places`` (N, 2) of a track over a pass, and the direction ``aside`` (2,) in which they may be moved.

    All of them in one direction: across a bend of the track, they would come apart.
    """

    problem: Problem
    cap_m: float
    places: Floats
    aside: Floats

    def moved(self, by_m: Floats) -> Floats:
        """(N, ..., 2) the places, moved aside by metres (N, ...)."""
        places = self.places.reshape(len(self.places), *(1,) * (by_m.ndim - 1), 2)
        return np.asarray(places + by_m[..., None] * self.aside)

    def over(self, at: Floats) -> Floats:
        """(...) by how many metres the exact check's floor over places (..., 2) exceeds the cap, at least -`SPARE_M`:
        a floor that is low enough need not be lower."""
        floor = self.problem.floors(*at.reshape(-1, 2).T).reshape(at.shape[:-1])
        return np.asarray(np.maximum(floor - self.cap_m, -SPARE_M))


def over_pass(problem: Problem, cap_m: float, track: Floats) -> Floats:
    """A track (N, 2) moved aside where terrain shuts it below ``cap_m``, to where the exact check's floor is low, and
    without jumps. Its ends stay; all of it does where nothing is shut, or too much."""
    import shapely  # most missions need none here

    places = denser(track, DENSE_M)
    shut = np.flatnonzero(problem.floors(*places.T) > cap_m)
    if not len(shut):
        return track
    near = round(BEFORE_M / DENSE_M)
    first, last = max(int(shut[0]) - near, 0), min(int(shut[-1]) + near, len(places) - 1)
    if last - first > MOST_PLACES:
        return track
    aside = (places[last] - places[first])[::-1] * [-1.0, 1.0]
    aside /= max(float(np.hypot(*aside)), 1e-9)
    strip = _Strip(problem, cap_m, places[first : last + 1], aside)
    off = _settled(strip, _chain(strip))
    line = np.vstack([places[:first], strip.moved(off), places[last + 1 :]])
    return np.asarray(shapely.LineString(line).simplify(STRAIGHT_M).coords)


def _chain(strip: _Strip) -> Floats:
    """(N,) metres aside, of `TRIED` places each, with which the sum of floors above the cap is least; by dynamic
    programming."""
    steps = np.linspace(-1.0, 1.0, TRIED)
    at = strip.moved(np.tile(SIDE_M * steps, (len(strip.places), 1)))
    # From each place of a row to those of the next that are a few places aside, by way of the middle.
    beside = np.arange(TRIED)[:, None] + np.arange(-MOST_ASIDE, MOST_ASIDE + 1)
    there = beside.clip(0, TRIED - 1)
    ways = strip.over(0.5 * (at[:-1, :, None] + at[1:, there])) + strip.over(at)[1:, there]
    ways = DEAR * ways + 2.0 * SIDE_M / (TRIED - 1) * np.abs(beside - np.arange(TRIED)[:, None])
    ways[:, beside != there] = np.inf
    left, back = np.where(steps == 0.0, 0.0, np.inf), list[Indices]()
    for row in ways[::-1]:  # from the end
        whole = row + left[there]
        back.append(there[np.arange(TRIED), whole.argmin(axis=1)])
        left = whole.min(axis=1)
    chosen = [TRIED // 2]
    for to in reversed(back):
        chosen.append(int(to[chosen[-1]]))
    return np.asarray(SIDE_M * steps[chosen])


def _settled(strip: _Strip, off: Floats) -> Floats:
    """Metres aside (N,) near ``off`` with the lowest floors; 0 at both ends."""
    steps, rows = np.linspace(-1.0, 1.0, TRIED), np.arange(len(off))
    width = 2.0 * SIDE_M / (TRIED - 1)
    while width > WITHIN_M:
        tried = off[:, None] + width * steps
        best = (strip.over(strip.moved(tried)) + LITTLE * np.abs(steps)).argmin(axis=1)
        off = tried[rows, best]
        width *= 4.0 / (TRIED - 1)
    # The line goes on before and behind the pass, so that no leg cuts its corner.
    tight = strip.over(strip.moved(off)) > -SPARE_M
    for step in (1, -1):
        further = np.where(np.roll(tight, step) & ~tight, np.roll(off, step), off)
        off = np.where(strip.over(strip.moved(further)) <= 0.0, further, off)
    off[[0, -1]] = 0.0
    return off
