"""The names of all planners, and the package that holds each one's row: summary, source, how to call it.

Cheap to import: a package is imported only when one of its planners is named.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from types import MappingProxyType
from typing import cast

from gcsplan.errors import InputError, needs, unknown_name
from gcsplan.planners.problem import Problem, Solution

VOLUME_KEYS = ("west_m", "south_m", "bottom_m", "east_m", "north_m", "top_m")
"""Keys of a swarm's ``parameters`` for the six sides of the flight volume, metres in the plane and metres AMSL."""


@dataclass(frozen=True, slots=True)
class PlannerEntry:
    """One planner; ``module`` holds its ``plan`` and is imported only on the first call.

    ``paper`` is its source, empty if it is gcsplan's own. ``defaults`` are fields of `Problem`, or keys of
    ``Problem.options``. ``warm_starts``: it takes the option ``warm_start``, a vehicle whose path is planned before.
    """

    name: str
    summary: str
    module: str
    paper: str = ""
    defaults: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))
    warm_starts: bool = False

    def plan(self, problem: Problem) -> Solution:
        """A safe path for ``problem``. Raises NoMission if none exists or none was found."""
        return cast(Solution, import_module(self.module).plan(problem))

    def by_priority(self, options: Mapping[str, object]) -> bool:
        """Whether, with these ``options``, vehicles are planned in their order of arrival, each knowing the earlier."""
        return False


_SWARM_NAMES = (
    "krill", "aco", "abc", "b-abc", "ib-abc", "gwo", "mgwo", "igwo", "sogwo", "ssgwo", "foa", "mfoa", "iffo", "msfoa",
    "pso", "de", "lshade", "cmaes", "po", "abo",
)  # fmt: skip

PLANNER_PACKAGES: Mapping[str, str] = MappingProxyType(
    {"optimal": "gcsplan.planners.optimal", **dict.fromkeys(_SWARM_NAMES, "gcsplan.research.swarm")}
)
"""Name to the package whose function ``entry`` returns the planner's row; the default planner stands first."""


def names() -> tuple[str, ...]:
    """Every planner's name, the default one first."""
    return tuple(PLANNER_PACKAGES)


def get(name: str) -> PlannerEntry:
    """The planner called ``name``.

    Raises InputError if there is none, with the nearest known name, or if its package is not installed.
    """
    if name not in PLANNER_PACKAGES:
        raise unknown_name(f"there is no planner {name!r}", name, PLANNER_PACKAGES)
    with needs(PLANNER_PACKAGES[name], f"the planner {name!r}"):
        return cast(PlannerEntry, import_module(PLANNER_PACKAGES[name]).entry(name))


def rows() -> Iterator[PlannerEntry]:
    """All planners, the default one first; the summary of a planner whose package is not installed names that."""
    for name, package in PLANNER_PACKAGES.items():
        try:
            yield get(name)
        except InputError:
            yield PlannerEntry(name, f"not installed: it needs {package}", package)
