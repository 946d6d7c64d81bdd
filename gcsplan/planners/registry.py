"""The names of all planners, and the package that holds each one's row: summary, source, how to call it.

Cheap to import: a package is imported only when one of its planners is named.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from types import MappingProxyType
from typing import cast

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError, NoMission, needs, unknown_name
from gcsplan.planners.problem import Problem, Refusal, Solution, passes_vias
from gcsplan.plugins import PLANNERS, failing, function_at
from gcsplan.world.geometry.path import Path

VOLUME_KEYS = ("west_m", "south_m", "bottom_m", "east_m", "north_m", "top_m")
"""Keys of a swarm's ``parameters`` for the six sides of the flight volume, metres in the plane and metres AMSL."""


ENDS_OFF_M = 1e-6
"""Metres by which the ends of a path may lie beside the ends of its problem."""


@dataclass(frozen=True, slots=True)
class PlannerEntry:
    """One planner; ``module`` holds its ``plan`` and is imported only on the first call.

    ``paper`` is its source, empty if it is gcsplan's own. ``defaults`` are fields of `Problem`, or keys of
    ``Problem.options``. ``warm_starts``: it takes the option ``warm_start``, a vehicle whose path is planned before.
    ``options``: keys of ``Problem.options`` that a script may give, and no mission file.
    """

    name: str
    summary: str
    module: str
    paper: str = ""
    defaults: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))
    warm_starts: bool = False
    options: tuple[str, ...] = ()

    def plan(self, problem: Problem) -> Solution:
        """A safe path for ``problem``. Raises NoMission if none exists or none was found."""
        return cast(Solution, import_module(self.module).plan(problem))

    def by_priority(self, options: Mapping[str, object]) -> bool:
        """Whether, with these ``options``, vehicles are planned in their order of arrival, each knowing the earlier."""
        return False


@dataclass(frozen=True, slots=True)
class AddedEntry(PlannerEntry):
    """A planner of another package, or a function of a script: its path is looked at, its claims are not taken over."""

    function: Callable[[Problem], Solution] | None = None

    def plan(self, problem: Problem) -> Solution:
        """As `PlannerEntry.plan`; raises InputError for a result that is no path of the problem."""
        assert self.function is not None
        with failing(f"planner {self.name}"):
            try:
                found = self.function(problem)
            except NoMission as why:
                if why.reason != "infeasible":
                    raise
                raise Refusal(f"{why.message} (as {self.name} says; nothing proves it)", reason="not_found") from why
        return _looked_at(found, problem, f"planner {self.name}")


def _looked_at(found: object, problem: Problem, where: str) -> Solution:
    """A stranger's solution as a path alone. Raises InputError."""
    if not isinstance(found, Solution):
        raise InputError(f"a planner returns a Solution, given {type(found).__name__}", where=where)
    points: Floats = np.empty(0)
    times_s = math.nan, math.nan
    with suppress(Exception):  # whatever a stranger's numbers raise: they are none
        times_s = float(found.planning_s), float(found.first_path_s)
        points = np.asarray(found.path.points, dtype=object).astype(np.float64)
    if not all(0.0 <= time_s < math.inf for time_s in times_s):
        raise InputError("planning_s and first_path_s are seconds, 0 or more", where=where)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2 or not np.isfinite(points).all():
        raise InputError("a path is an array (N, 3) of finite east_m, north_m, amsl_m", where=where)
    off_m = np.abs(points[[0, -1]] - np.array([problem.start, problem.goal])).max()
    if off_m > ENDS_OFF_M or not passes_vias(problem, points):
        words = f"by {off_m:.3f} m at an end" if off_m > ENDS_OFF_M else "a via is not passed"
        raise InputError(f"a path leads from problem.start by problem.via to problem.goal: {words}", where=where)
    return Solution(Path(points), planning_s=times_s[0], first_path_s=times_s[1])


_SWARM_NAMES = (
    "krill", "aco", "abc", "b-abc", "ib-abc", "gwo", "mgwo", "igwo", "sogwo", "ssgwo", "foa", "mfoa", "iffo", "msfoa",
    "pso", "de", "lshade", "cmaes", "po", "abo",
)  # fmt: skip

PLANNER_PACKAGES: Mapping[str, str] = MappingProxyType(
    {"optimal": "gcsplan.planners.optimal", **dict.fromkeys(_SWARM_NAMES, "gcsplan.research.swarm")}
)
"""Name to the package whose function ``entry`` returns the planner's row; the default planner stands first."""


def names() -> tuple[str, ...]:
    """Every planner's name, the default one first, planners of other packages last."""
    return (*PLANNER_PACKAGES, *(name for name in PLANNERS.names() if name not in PLANNER_PACKAGES))


def get(name: str) -> PlannerEntry:
    """The planner called ``name``.

    It may be ``MODULE:FUNCTION``, too, but not in a mission file. Raises InputError if there is none, with the nearest
    known name, or if its package is not installed.
    """
    if name not in PLANNER_PACKAGES:
        added = function_at(name, "planner") if ":" in name else PLANNERS.get(name)
        if added is not None:
            return own(added, name)
        raise unknown_name(f"there is no planner {name[:64]!r}", name, names())
    with needs(PLANNER_PACKAGES[name], f"the planner {name!r}"):
        return cast(PlannerEntry, import_module(PLANNER_PACKAGES[name]).entry(name))


def own(function: Callable[[Problem], Solution], name: str = "") -> AddedEntry:
    """The row of a function that plans."""
    words = (inspect.getdoc(function) or "").partition("\n")[0]
    module = getattr(function, "__module__", "")
    return AddedEntry(
        name or getattr(function, "__qualname__", type(function).__name__), words, module, function=function
    )


def rows() -> Iterator[PlannerEntry]:
    """All planners, the default one first; the summary of a planner whose package is not installed names that."""
    for name in names():
        try:
            yield get(name)
        except InputError as why:
            package = PLANNER_PACKAGES.get(name, "")
            yield PlannerEntry(name, f"not installed: it needs {package}" if package else why.message, package)
