"""Plans of changes to a problem for which there is no path: bounded in number and time."""

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
"""Plans of changed problems, at most."""
SHARE, LEAST_S = 0.3, 1.0
"""No plan begins after this part of ``budget_s``, or after this time where that is more."""
GRACE_S = 1.0
"""A plan that goes on for so long beyond that is stopped as soon as the planner reports progress."""
PARTS = 12
"""One plan's ``budget_s`` is this part of that time."""
VALUES = 9
"""Values of one limit that are tried, at most."""
ANY_PERCENT = 1e6
"""Gap with which the first path is good enough."""
HIGHEST_M, LEAST_DEG = 9500.0, 0.05
"""No higher ceiling and no smaller climb limit is tried."""


class Trials:
    """Plans of changes to one problem: at most `TRIES`, and none begun later than a share of ``budget_s``."""

    def __init__(self, problem: Problem, plan: Plan) -> None:
        self.problem, self._plan = problem, plan
        self.share_s = max(SHARE * problem.budget_s, LEAST_S)
        self._begun_s = time.perf_counter()
        self._left = TRIES
        self.stopped = False
        """Whether the last plan was stopped: nothing is known of its problem."""

    @property
    def spent(self) -> bool:
        """Whether nothing more is tried."""
        return self.stopped or self._left <= 0 or time.perf_counter() - self._begun_s >= self.share_s

    def _watch(self, progress: Progress) -> None:
        if time.perf_counter() - self._begun_s > self.share_s + GRACE_S:
            self.stopped = True
            raise Refusal("no mission: no path was found in the time for it", reason="not_found")

    def path(self, changed: Problem, what: str) -> Floats | None:
        """(N, 3) points of a path of a changed problem; None where the planner refuses. ``what`` is changed."""
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
        """The least value over ``given`` that was found to do, beginning with ``enough``, which may or may not."""
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
    """The least value that did, with its path, and the largest under it that did not; NaN, None: there is none."""

    value: float = math.nan
    path: Floats | None = None
    in_vain: float = math.nan

    def words(self, given: str) -> str:
        """What was given, and what does not do."""
        return f"({given}" + ("" if math.isnan(self.in_vain) else f", with {self.in_vain:g} none is found") + ")"


@dataclass(frozen=True, slots=True)
class Values:
    """Which values of a limit are tried: ``between`` two, the first of which does not do, and ``beyond`` the last."""

    between: Callable[[float, float], float]
    beyond: Callable[[float, float], float]
    most: float


def metres_from(guess: float) -> Values:
    """Whole metres: no lower than a ``guess``, and close to it rather than half-way; 0: nobody knows."""
    part = 0.25 if guess > 0.0 else 0.5
    return Values(
        between=lambda bad, good: float(max(math.floor(bad + part * (good - bad)), math.floor(bad) + 1, guess)),
        beyond=lambda given, value: float(math.ceil(given + 3.0 * (value - given))),
        most=HIGHEST_M,
    )


# From the side that does: values just over the given one are those that take a planner longest to refuse.
DEGREES = Values(
    between=lambda bad, good: bad if good <= 1.1 * bad else two_digits(max(0.5 * good, math.sqrt(bad * good))),
    beyond=lambda given, value: two_digits(2.0 * value),
    most=89.0,
)


def two_digits(value: float) -> float:
    """``value`` rounded up to two digits that count."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return round(math.ceil(value / unit - 1e-9) * unit, 9)
