"""Plans of changed versions of a problem for which no path was found, bounded in number and time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from gcsplan.arrays import Floats
from gcsplan.errors import InputError, NoMission
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution

Plan = Callable[[Problem], Solution]

TRIES = 32
"""Most plans of changed problems."""
SHARE, LEAST_S = 0.3, 1.0
"""No plan begins after this part of ``budget_s``, or after this many seconds if that is more."""
GRACE_S = 1.0
"""A plan that runs this many seconds beyond that time is stopped at its next progress report."""
PARTS = 12
"""The ``budget_s`` of one plan is that time divided by this number."""
VALUES = 9
"""Most values of one limit that are tried."""
ANY_PERCENT = 1e6
"""Wanted gap so large that the first path is good enough."""
HIGHEST_M, LEAST_DEG = 9500.0, 0.05
"""The highest ceiling, metres, and the smallest climb limit, degrees, that are tried."""


class Trials:
    """Plans of changed versions of one problem: at most `TRIES`, and none begun after ``share_s`` seconds."""

    def __init__(self, problem: Problem, plan: Plan) -> None:
        self.problem, self._plan = problem, plan
        self.share_s = max(SHARE * problem.budget_s, LEAST_S)
        self._begun_s = time.perf_counter()
        self._left = TRIES
        self.stopped = False
        """Whether the last plan was stopped, so that it is not known whether its problem has a path."""

    @property
    def spent(self) -> bool:
        """Whether no further plan is to be begun."""
        return self.stopped or self._left <= 0 or time.perf_counter() - self._begun_s >= self.share_s

    def _watch(self, progress: Progress) -> None:
        if time.perf_counter() - self._begun_s > self.share_s + GRACE_S:
            self.stopped = True
            raise Refusal("no mission: no path was found in the time for it", reason="not_found")

    def path(self, changed: Problem, what: str) -> Floats | None:
        """(N, 3) points of a path of a changed problem; None if the planner refuses. ``what`` names the change in
        progress reports."""
        self._left -= 1
        if self.problem.progress is not None:
            words = f"no path; tries {what}"
            self.problem.progress(Progress(time.perf_counter() - self._begun_s, None, None, words))
        budget_s = min(self.problem.budget_s, self.share_s / PARTS)
        try:
            solution = self._plan(replace(changed, gap_percent=ANY_PERCENT, budget_s=budget_s, progress=self._watch))
        except (NoMission, InputError):
            return None
        return solution.path.points

    def least(self, name: str, at: Callable[[float], Problem], given: float, enough: float, values: Values) -> Least:
        """The least value over ``given`` with which a path was found; ``at(value)`` is the problem with it.

        The first value tried is ``enough``, which need not suffice; ``name`` of the limit, for progress reports.
        """
        bad, good, found = given, enough, Least()
        for _ in range(VALUES):
            value = good if found.path is None else values.between(bad, good)
            if self.spent or not bad < value <= values.most or (found.path is not None and value >= good):
                break
            path = self.path(at(value), f"{name} {value:g}")
            if path is not None:
                good, found.value, found.path = value, value, path
            elif not self.stopped:
                bad, found.in_vain = value, value
                if found.path is None:
                    good = min(values.beyond(given, value), values.most)
        return found


@dataclass(slots=True)
class Least:
    """The least value with which a path was found, that path, and the largest value below it without one; NaN and None
    where there is none."""

    value: float = math.nan
    path: Floats | None = None
    in_vain: float = math.nan

    def words(self, given: str) -> str:
        """The bracketed words of a message: the value that was ``given``, and the one that does not suffice."""
        return f"({given}" + ("" if math.isnan(self.in_vain) else f", with {self.in_vain:g} none is found") + ")"


@dataclass(frozen=True, slots=True)
class Values:
    """The next values of a limit to try: ``between(bad, good)`` after an insufficient and a sufficient one, or
    ``beyond(given, value)`` after ``value`` was insufficient and none has sufficed; never more than ``most``."""

    between: Callable[[float, float], float]
    beyond: Callable[[float, float], float]
    most: float


def metres_from(guess: float) -> Values:
    """Values in whole metres: none lower than ``guess``, and a quarter of the interval above the insufficient value
    instead of half-way; ``guess`` 0: unknown."""
    part = 0.25 if guess > 0.0 else 0.5
    return Values(
        between=lambda bad, good: float(max(math.floor(bad + part * (good - bad)), math.floor(bad) + 1, guess)),
        beyond=lambda given, value: float(math.ceil(given + 3.0 * (value - given))),
        most=HIGHEST_M,
    )


# Climb limits are approached from the sufficient side: planners take longest to refuse values just over the given one.
DEGREES = Values(
    between=lambda bad, good: bad if good <= 1.1 * bad else two_digits(max(0.5 * good, math.sqrt(bad * good))),
    beyond=lambda given, value: two_digits(2.0 * value),
    most=89.0,
)


def two_digits(value: float) -> float:
    """``value`` rounded up to two significant digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return round(math.ceil(value / unit - 1e-9) * unit, 9)
