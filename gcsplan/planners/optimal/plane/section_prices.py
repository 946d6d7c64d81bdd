"""Prices of a metre of climb on the sections across a leg, and what a metre of track then costs at least.

A straight leg with ``run`` metres of track that rises ``rise`` metres costs at least ``slant * run + price * rise`` for
every pair (slant, price) of `slants`: the pairs are the supporting lines of the cost. A leg that is steeper than the
climb limit stands for one that is longer. The pair that equals the cost of a leg is that of its slope.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gcsplan.arrays import Floats, Int64s
from gcsplan.planners.optimal.plane.sections import Sections
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.taut_string import Profile, taut_string

MIXED_M = 200.0
"""Metres aside within which the prices of several tracks are mixed evenly: their mean settles, each alone jumps."""
LEVEL_SLOPE = 0.02
"""Slope below which a metre of climb has a part of its price, for energy: else it would jump from descent to climb."""
RAMP = 0.1
"""Part of the climb limit, to both sides of it, over which the price of a steeper leg is reached."""
EXTRA = 1.0
"""Most metres of track that a metre of climb beyond the limit is worth: more would be flown in laps, which is rare."""
STEEPEST = 1.0
"""Slope from which on a climb limit does not count: legs that steep are rare."""


@dataclass(eq=False, slots=True)
class Prices:
    """Prices after each section, of some tracks that cross them: ``aside_m`` and ``price``, (S,) each."""

    aside_m: list[Floats] = field(default_factory=list)
    price: list[Floats] = field(default_factory=list)

    def add(self, aside_m: Floats, price: Floats) -> None:
        """Add the prices of a track that crosses the sections at ``aside_m``."""
        self.aside_m.append(aside_m)
        self.price.append(price)

    def at(self, sections: Sections) -> Floats:
        """(N,) prices at the nodes: a mean over the tracks, in which the nearest count most."""
        section = np.repeat(np.arange(len(sections.lines)), np.diff(sections.first))
        sums, weights = np.zeros(len(section)), np.zeros(len(section))
        for aside_m, price in zip(self.aside_m, self.price, strict=True):
            weight = 1.0 / (MIXED_M**2 + (sections.aside - aside_m[section]) ** 2)
            sums += weight * price[section]
            weights += weight
        return np.asarray(sums / weights)


def slants(problem: Problem, price: Floats) -> Floats:
    """The greatest cost of a metre of track with which a metre of climb may cost ``price``; (...) both."""
    slope, size = _steepest(problem, price), np.abs(price)
    if problem.objective == "energy":
        over = np.maximum(size - problem.vertical_j_per_m, 0.0)
        return np.asarray(np.maximum(problem.horizontal_j_per_m - over * slope, 0.0))
    flat = 1.0 / np.hypot(1.0, slope)
    sine, most = slope * flat, 1.0 / (slope * flat)
    over = flat * (most - size) / (most - sine)
    return np.asarray(np.maximum(np.where(size <= sine, np.sqrt(np.maximum(1.0 - size * size, 0.0)), over), 0.0))


def numbers(problem: Problem) -> tuple[float, float, float]:
    """The greatest price up to which costs are lengths in space (0 for energy), the greatest slant, and by how much
    slants change with the price, at most."""
    slopes = _steepest(problem, np.array([1.0, -1.0]))
    if problem.objective == "energy":
        return 0.0, problem.horizontal_j_per_m, float(slopes.max())
    return float((slopes / np.hypot(1.0, slopes)).min()), 1.0, 1.0


def prices_of(problem: Problem, slope: Floats) -> Floats:
    """The prices of legs of these slopes, smoothed where they jump; (...) both."""
    steepest = _steepest(problem, slope)
    beyond = np.clip((np.abs(slope) / steepest - 1.0 + RAMP) / (2.0 * RAMP), 0.0, 1.0) * (steepest < STEEPEST)
    if problem.objective == "energy":
        size = problem.vertical_j_per_m * np.minimum(np.abs(slope) / LEVEL_SLOPE, 1.0)
        size = size + beyond * np.minimum(1.0 / steepest, EXTRA) * problem.horizontal_j_per_m
    else:
        held = np.minimum(np.abs(slope), steepest)
        flat = 1.0 / np.hypot(1.0, steepest)
        size = held / np.hypot(1.0, held) + beyond * np.minimum(1.0 / (steepest * flat) - steepest * flat, EXTRA)
    return np.asarray(np.sign(slope) * size)


def chain_prices(problem: Problem, sections: Sections, nodes: Int64s) -> tuple[Floats, float]:
    """(S,) the prices of the taut string over a chain of ``nodes`` (S,), one of each section; and the string's cost."""
    run = np.hypot(np.diff(sections.x[nodes]), np.diff(sections.y[nodes]))
    at = np.concatenate([[0.0], np.cumsum(run)])
    low, high = sections.low[nodes], sections.high[nodes]
    low, high = np.minimum(low, high), np.maximum(low, high)
    string = taut_string(at, low, high, float(low[0]), float(low[-1]))
    assert isinstance(string, Profile)
    rise = np.diff(string.at(at))
    long = np.maximum(run, np.abs(rise) / _steepest(problem, rise))
    if problem.objective == "energy":
        cost = problem.horizontal_j_per_m * long.sum() + problem.vertical_j_per_m * np.abs(rise).sum()
    else:
        cost = np.hypot(long, rise).sum()
    return np.append(prices_of(problem, rise / run), 0.0), float(cost)


def _steepest(problem: Problem, upward: Floats) -> Floats:
    """The steepest slope of climbs, where ``upward`` is above 0, and of descents."""
    # The slopes are raised by the rounding of the angle, so that a path exactly at the limit counts.
    limits = problem.bound_limits
    up, down = (min(k, STEEPEST) + 2e-8 for k in (limits.max_climb_slope, limits.max_descent_slope))
    return np.where(upward > 0.0, up, down)
