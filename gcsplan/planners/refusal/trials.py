"""Plans of changed versions of a problem for which no path was found, bounded in number and time.

There are two kinds. A quick one stops at its first path: it says which changes are worth more. A whole one has the
problem's own budget and wanted gap, and all that the caller asks of a plan: only it says that a value would do.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from gcsplan.arrays import Floats
from gcsplan.errors import CheckFailed, GcsplanError, InputError, NoMission
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution

Plan = Callable[[Problem], Solution]

TRIES = 32
"""Most plans of changed problems."""
SHARE, LEAST_S = 0.3, 1.0
"""No plan begins after this part of ``budget_s``, or after this many seconds if that is more."""
GRACE_S = 1.0
"""A plan that runs this many seconds beyond that time is stopped at its next progress report."""
WHOLE_SHARE = 2.0
"""No whole plan begins after whole plans took this many times ``budget_s``, and none runs on after once more of it."""
PARTS = 12
"""The ``budget_s`` of one plan is that time divided by this number."""
VALUES, WHOLE = 9, 3
"""Most values of one limit that are tried quickly, and that are planned whole."""
LACKS = {
    "battery": "the battery is too small",
    "time": "the arrival time is not kept",
    "too_many_items": "the mission has too many items",
}
"""What is said of a plan that found a path, and no mission, by the reason of its refusal."""
ANY_PERCENT = 1e6
"""Wanted gap so large that the first path is good enough."""
HIGHEST_M, LEAST_DEG = 9500.0, 0.05
"""The highest ceiling, metres, and the smallest climb limit, degrees, that are tried."""


class Trials:
    """Plans of changed versions of one problem: at most `TRIES` quick ones, none of them begun after ``share_s``
    seconds, and whole ones, bounded by `WHOLE_SHARE`.

    ``plan`` returns a solution or raises NoMission; ``whole`` is the same with everything that the caller asks of a
    plan, and may also raise CheckFailed.
    """

    def __init__(self, problem: Problem, plan: Plan, whole: Plan | None = None) -> None:
        self.problem, self._plan, self._whole = problem, plan, whole or plan
        self.share_s = max(SHARE * problem.budget_s, LEAST_S)
        self._begun_s = time.perf_counter()
        self._whole_s = 0.0
        self._left = TRIES
        self.stopped = False
        """Whether the last quick plan was stopped, so that it is not known whether its problem has a path."""
        self.lacks = ""
        """What the last plan without a mission lacked, in words."""

    @property
    def _now_s(self) -> float:
        return time.perf_counter() - self._begun_s

    @property
    def spent(self) -> bool:
        """Whether no further quick plan is to be begun."""
        return self.stopped or self._left <= 0 or self._now_s - self._whole_s >= self.share_s

    def path(self, changed: Problem, what: str) -> Floats | None:
        """(N, 3) points of a path of a changed problem, found quickly; None if the planner refuses. ``what`` names the
        change in progress reports."""
        self._left -= 1
        until_s = self.share_s + GRACE_S + self._whole_s

        def watch(progress: Progress) -> None:
            if self._now_s > until_s:
                self.stopped = True
                raise Refusal("no mission: no path was found in the time for it", reason="not_found")

        budget_s = min(self.problem.budget_s, self.share_s / PARTS)
        quick = replace(changed, gap_percent=ANY_PERCENT, budget_s=budget_s, progress=watch)
        return self._points(self._plan, quick, what)

    def whole(self, changed: Problem, what: str) -> Floats | None:
        """(N, 3) points of the path of a whole plan of a changed problem; None if it is refused, or stopped: then
        ``lacks`` is empty."""
        begun_s, stopped = self._now_s, self._whole_s >= WHOLE_SHARE * self.problem.budget_s
        until_s = begun_s + (WHOLE_SHARE + 1.0) * self.problem.budget_s - self._whole_s

        def watch(progress: Progress) -> None:
            nonlocal stopped
            if self._now_s > until_s:
                stopped = True
                raise Refusal("no mission: no path was found in the time for it", reason="not_found")

        points = (
            None if stopped else self._points(self._whole, replace(changed, progress=watch), f"the whole of {what}")
        )
        self._whole_s += self._now_s - begun_s
        if stopped:
            self.lacks = ""
        return points

    def _points(self, plan: Plan, changed: Problem, what: str) -> Floats | None:
        if self.problem.progress is not None:
            self.problem.progress(Progress(self._now_s, None, None, f"no path; tries {what}"))
        try:
            return plan(changed).path.points
        except (NoMission, InputError, CheckFailed) as refused:
            self.lacks = _lacks(refused)
            return None

    def least(self, name: str, at: Callable[[float], Problem], given: float, enough: float, values: Values) -> Least:
        """The least value over ``given`` with which a mission was planned; ``at(value)`` is the problem with it.

        The first value tried is ``enough``, which need not suffice; ``name`` of the limit, for progress reports. Values
        with a path are found quickly; the lowest of them with a whole plan is the result.
        """
        bad, good, found, open_ = given, enough, Least(), list[float]()
        for _ in range(VALUES):
            value = values.between(bad, good) if open_ else good
            if self.spent or not bad < value <= values.most or (open_ and value >= good):
                break
            if self.path(at(value), f"{name} {value:g}") is not None:
                good = value
                open_.append(value)
            elif not self.stopped:
                bad = value
                found.failed(value, self.lacks)
                if not open_:
                    good = min(values.beyond(given, value), values.most)
        for _ in range(WHOLE):
            if not open_:
                break
            value = open_.pop()
            found.path = self.whole(at(value), f"{name} {value:g}")
            if found.path is not None:
                found.value = value
                break
            if not self.lacks:  # stopped
                found.untried = value
                break
            found.failed(value, self.lacks)
            beyond = min(values.beyond(given, value), values.most)
            if not open_ and beyond > value:
                open_.append(beyond)
        return found


def _lacks(refused: GcsplanError) -> str:
    """What a plan that was refused lacks, in words that follow ``with VALUE``."""
    if isinstance(refused, CheckFailed):  # its first line says what failed, those behind it where
        return refused.message.partition("\n")[0]
    if isinstance(refused, InputError):
        return "the mission file is refused"
    return LACKS.get(refused.reason or "", "none is found")


@dataclass(slots=True)
class Least:
    """The least value with which a whole plan has a mission, its path, and the largest value below it without one, and
    what that lacks; a value with a path whose whole plan was not tried. NaN and None where there is none."""

    value: float = math.nan
    path: Floats | None = None
    in_vain: float = math.nan
    lacks: str = ""
    untried: float = math.nan

    def failed(self, value: float, lacks: str) -> None:
        """Note that a value does not suffice."""
        self.in_vain, self.lacks = value, lacks

    def words(self, given: str) -> str:
        """The bracketed words of a message: the value that was ``given``, and the one that does not suffice."""
        return f"({given}" + ("" if math.isnan(self.in_vain) else f", with {self.in_vain:g} {self.lacks}") + ")"

    @property
    def no_value(self) -> str:
        """The words behind ``there is a path`` where no value is known to do."""
        words = "" if math.isnan(self.in_vain) else f", but with {self.in_vain:g} {self.lacks}"
        if not math.isnan(self.untried):
            words += f", and with {self.untried:g}, whose whole mission was not tried in time"
        return words


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
