"""The orders in which a fleet may arrive: a time window for each vehicle, turns at equal intervals.

A vehicle can be at the goal from ``fast_s`` (its fastest) to ``latest_s`` (its slowest, or inf if it may wait). Turn
``p`` of a sequence that begins at ``first_s`` is at ``first_s + p·interval_s``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import numpy as np

from gcsplan.arrays import Floats, Indices

Clock = Literal["first", "fleet"]
Cost = Callable[[Floats], Floats]

WITHIN_S = 1e-6
"""Times that differ by less than this, s, count as equal."""

MOST_CLOCKS = 400
"""Most starting times of a sequence that are tried if vehicles can neither be early nor wait."""


def interval_range(fast_s: Floats, latest_s: Floats, clock: Clock, first_s: float | None) -> tuple[float, float]:
    """Smallest and largest interval with which vehicles in this order can arrive.

    The smallest is above the largest if no interval works. ``first_s`` is the arrival of the first, s; None: at its
    fastest (``first``), or as early as the whole fleet can follow (``fleet``).
    """
    n = len(fast_s)
    turn = np.arange(n, dtype=np.float64)
    if first_s is None and clock == "fleet":
        # A starting time must be after every fast_j - j·d and before every latest_i - i·d.
        gap, apart = latest_s[:, None] - fast_s[None, :], turn[:, None] - turn[None, :]
        later, sooner = apart > 0.0, apart < 0.0
        low = float((gap[sooner] / apart[sooner]).max(initial=0.0))
        return low, float((gap[later] / apart[later]).min(initial=math.inf))
    begin = float(fast_s[0]) if first_s is None else first_s
    if begin < fast_s[0] - WITHIN_S or begin > latest_s[0] + WITHIN_S:
        return math.inf, 0.0
    low = max(0.0, float(((fast_s[1:] - begin) / turn[1:]).max(initial=0.0)))
    high = float(((latest_s[1:] - begin) / turn[1:]).min(initial=math.inf))
    return low, high


def earliest_first(fast_s: Floats, latest_s: Floats, interval_s: float) -> float | None:
    """The earliest starting time of a sequence in this order, s; None if none suits all vehicles."""
    turns = np.arange(len(fast_s)) * interval_s
    low, high = float((fast_s - turns).max()), float((latest_s - turns).min())
    return low if low <= high + WITHIN_S else None


def best_order(
    fast_s: Floats, latest_s: Floats, interval_s: float, clock: Clock, first_s: float | None, cost: Cost | None = None
) -> Indices | None:
    """The order that finishes earliest, and among those with the same starting time the cheapest; None if none works.

    ``cost`` returns joules (n, n) of each vehicle (row) for arriving at the times (n,) that are passed to it. Exact for
    any number of vehicles: for a given starting time, turns are assigned as a linear assignment problem (if waiting
    costs nothing, sorting by ``fast_s`` solves it: swapping two neighbours that are out of order never helps the later
    one), and starting times are tried from the earliest. For a ``fleet`` clock whose vehicles cannot wait,
    `MOST_CLOCKS` starting times are tried: exact up to 20 vehicles.
    """
    n = len(fast_s)
    by_speed = np.argsort(fast_s, kind="stable").astype(np.intp)
    turns = np.arange(n, dtype=np.float64)
    turns *= interval_s
    if first_s is not None:
        return _assigned(fast_s, latest_s, first_s + turns, cost, by_speed)
    if clock == "first":
        for k in by_speed:
            others = by_speed[by_speed != k]
            times = float(fast_s[k]) + turns[1:]
            sub = None if cost is None else _rows(cost, others)
            found = _assigned(fast_s[others], latest_s[others], times, sub, np.arange(n - 1, dtype=np.intp))
            if found is not None:
                return np.concatenate([[k], others[found]]).astype(np.intp)
        return None
    least = float((fast_s[by_speed] - turns).max())
    begins = np.unique(fast_s[:, None] - turns[None, :])
    begins = begins[begins >= least - WITHIN_S][:MOST_CLOCKS]
    for begin in begins.tolist():
        found = _assigned(fast_s, latest_s, begin + turns, cost, by_speed)
        if found is not None:
            return found
    return None


def _rows(cost: Cost, rows: Indices) -> Cost:
    return lambda times: cost(times)[rows]


def _assigned(fast_s: Floats, latest_s: Floats, times: Floats, cost: Cost | None, by_speed: Indices) -> Indices | None:
    """The vehicle for each of the ``times``, at the least cost; None if the times cannot all be kept."""
    n = len(times)
    if n == 0:
        return np.empty(0, dtype=np.intp)
    if (fast_s[by_speed] > times + WITHIN_S).any():
        return None  # sorted by fast_s a vehicle is late, so one is late in any other order too
    joules = np.zeros((n, n)) if cost is None else cost(times)
    able = (fast_s[:, None] <= times[None, :] + WITHIN_S) & (latest_s[:, None] >= times[None, :] - WITHIN_S)
    turn = np.arange(n)
    if able[by_speed, turn].all() and joules[by_speed, turn].sum() <= 0.0:
        return by_speed
    from scipy.optimize import linear_sum_assignment  # slow to import, so only if sorting does not solve it

    worst = 2.0 * (float(joules.max()) + 1.0) * n
    row, column = linear_sum_assignment(np.where(able, joules, worst))
    if not able[row, column].all():
        return None
    order = np.empty(n, dtype=np.intp)
    order[column] = row
    return order
