"""What every planner is asked, what it answers, and the refusal where it has no answer."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gcsplan.errors import NoMission, NoMissionReason
from gcsplan.planners.budget import Budget
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.limits import Limits
from gcsplan.world.path import Path

Objective = Literal["length", "energy"]

ENDS_M = 25.0
"""Bounds over a line are conservative, in rough ground by this much at worst; so whether start and goal themselves are
legal is not read from them."""


@dataclass(frozen=True, slots=True)
class Via:
    """A point to pass; ``amsl_m`` None leaves its height free."""

    east_m: float
    north_m: float
    amsl_m: float | None = None


@dataclass(frozen=True, slots=True)
class Progress:
    """Said now and then while planning: seconds since the call, best cost so far, bound (either may be None)."""

    elapsed_s: float
    cost: float | None
    lower_bound: float | None
    phase: str = ""


@dataclass(frozen=True, eq=False, slots=True)
class Problem:
    """From ``start`` to ``goal`` (east_m, north_m, amsl_m), past ``via`` in order.

    ``limits`` already hold the margins for wire rounding, so a path that `Airspace.examine` passes under them
    passes the final check too. Metres only: a planner never sees a degree. ``options`` are what only some planners
    know: the swarms' ``encoding``, ``cost``, ``points``, ``population``, ``iterations``, ``evaluations`` and
    ``parameters``.

    ``widen(margin_m, budget_mb)``: the same question over more terrain, at least so far around all terminals (inf:
    twice as far as here) if memory allows; None where it does not, or where there is no more; `Surface.goes_on` tells
    which.
    """

    airspace: Airspace
    limits: Limits
    start: tuple[float, float, float]
    goal: tuple[float, float, float]
    via: tuple[Via, ...] = ()
    objective: Objective = "length"
    vertical_j_per_m: float = 120.0
    horizontal_j_per_m: float = 100.0
    turn_radius_m: float = 0.0
    seed: int = 1
    gap_percent: float = 0.1
    budget_s: float = 10.0
    budget_mb: float = 1024.0
    budget: Budget = field(default_factory=Budget.endless)
    progress: Callable[[Progress], None] | None = None
    options: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))
    widen: Callable[[float, float], Problem | None] | None = None

    def leg_costs(self, start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
        """(...) cost of straight legs between points (..., 3), as `cost` sums them."""
        d = end - start
        flat = np.hypot(d[..., 0], d[..., 1])
        if self.objective == "energy":
            return np.asarray(self.horizontal_j_per_m * flat + self.vertical_j_per_m * np.abs(d[..., 2]))
        return np.asarray(np.hypot(flat, d[..., 2]))

    def legal(self, start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) whether straight legs from ``start`` (N, 3) to ``end`` pass the exact check; counted as work."""
        if not len(start):
            return np.zeros(0, np.bool_)
        grid = self.airspace.surface.grid
        metres = float(np.abs(end[:, :2] - start[:, :2]).sum())
        self.budget.spend("check", 1)
        self.budget.spend("leg", len(start))
        self.budget.spend("cell", metres / float(grid.metres_per_cell(*self.start[:2]).min()))
        legal, cut = self.airspace.clear_counted(Legs.between(start, end, self.limits), self.limits)
        self.budget.spend("cut", cut)
        return legal

    def floors(self, east_m: NDArray[np.float64], north_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Lowest legal altitudes over places, as `Airspace.floor_amsl` has them; counted as work."""
        self.budget.spend("place", np.size(east_m))
        return self.airspace.floor_amsl(east_m, north_m, self.limits)

    def cost(self, path: Path) -> float:
        """Metres or joules of ``path``, by the objective."""
        if self.objective == "energy":
            return path.energy_j(self.vertical_j_per_m, self.horizontal_j_per_m)
        return path.length_m


@dataclass(frozen=True, slots=True)
class Step:
    """One search of a plan: its name, seconds by the clock and megabytes by count, and by how many percent the best
    path became cheaper and the bound higher through it. ``refused``: it did not fit into what was left."""

    name: str
    s: float
    mb: float
    gained_percent: float = 0.0
    bound_percent: float = 0.0
    refused: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class Solution:
    """A path that `Airspace.examine` passes, and what is known about the best one.

    ``lower_bound`` holds for every feasible path of the stated model, in the objective's unit; None where the
    planner has none. ``stopped_by``: gap, exhausted, budget, evaluations, time. ``notes`` are said to the user.
    ``flown``: the track that ``path``'s points are flown by on, where there is a turn radius; None where corners are
    flown as they are. Of planners that search by samples: ``raw_violations``, how many limits the exact check found
    broken in the result of the search itself, and whether it was ``repaired``; None of all others.
    ``problem``: what was answered, where that is the problem over more terrain than it was asked for.
    """

    path: Path
    lower_bound: float | None = None
    stopped_by: str = "exhausted"
    planning_s: float = 0.0
    first_path_s: float = 0.0
    notes: tuple[str, ...] = ()
    flown: Path | None = None
    raw_violations: int | None = None
    repaired: bool | None = None
    search: tuple[Step, ...] = ()
    problem: Problem | None = None


class Refusal(NoMission):
    """No mission, and where: ``east_m``, ``north_m`` of the binding place, None where there is no one place.

    ``place_of``: what is at that place, where the message does not say so.
    ``untried``: another limit, or fewer zones, may help, and none has been tried yet (`refusal.with_cures` does).
    """

    def __init__(
        self,
        message: str,
        *,
        reason: NoMissionReason,
        place: tuple[float, float] | None = None,
        place_of: str = "",
        untried: bool = False,
    ) -> None:
        super().__init__(message, reason=reason)
        self.east_m = None if place is None else float(place[0])
        self.north_m = None if place is None else float(place[1])
        self.place_of = place_of
        self.untried = untried


def terminals_of(problem: Problem) -> list[tuple[float, float]]:
    """Start, every via, goal: (east_m, north_m)."""
    return [problem.start[:2], *((v.east_m, v.north_m) for v in problem.via), problem.goal[:2]]


def straight_way_m(problem: Problem) -> float:
    """Metres of the straight track from terminal to terminal."""
    return sum(math.dist(a, b) for a, b in pairwise(terminals_of(problem)))
