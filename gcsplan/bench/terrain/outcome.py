"""One planner's attempt at one problem of the benchmark, and its outcome."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

OutcomeStatus = Literal["solved", "infeasible", "not found", "unsafe", "failed"]
OUR_METHOD = "gcsplan"
OUR_LONG_METHOD = "gcsplan 60 s"


@dataclass(frozen=True, slots=True)
class MethodOutcome:
    """One method's attempt at one problem; times are medians of ``runs``.

    ``status``: solved means that the whole path from start to goal passes the exact check; infeasible, that no path
    exists, with proof; unsafe, that the exact check rejects the returned path. ``cost`` and ``bound`` are in metres or
    joules; ``raw_cost`` is the cost before a rival's path was simplified. ``sweep_s`` is the time of an exact check of
    100,000 one-kilometre legs, measured in between. ``memory_mb`` is the peak above the use before. ``points`` is the
    path, of rivals only. ``gap_asked_percent`` is the certified gap at which gcsplan's planner may stop.
    """

    key: str
    name: str
    kind: str
    group: str
    method: str
    status: OutcomeStatus
    detail: str = ""
    cost: float | None = None
    raw_cost: float | None = None
    bound: float | None = None
    first_path_s: float | None = None
    planning_s: float | None = None
    sweep_s: float | None = None
    memory_mb: float | None = None
    checks: int | None = None
    gap_asked_percent: float | None = None
    runs: int = 1
    stopped_by: str = ""
    version: str = ""
    points: list[list[float]] = field(default_factory=list)

    @property
    def gap_percent(self) -> float | None:
        """Percent above its own bound; None if cost or bound is missing."""
        return None if not self.cost or not self.bound else 100.0 * (self.cost / self.bound - 1.0)


def beyond(cost: float | None, bound: float | None) -> float | None:
    """Percent of ``cost`` above ``bound``; None if either is missing."""
    return None if cost is None or not bound or not math.isfinite(bound) else 100.0 * (cost / bound - 1.0)
