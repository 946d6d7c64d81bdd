"""The table of all planners: what each is, where it comes from, and how to call it. Cheap to import."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from importlib import import_module
from types import MappingProxyType
from typing import cast

from gcsplan.errors import InputError
from gcsplan.planners.problem import Problem, Solution


@dataclass(frozen=True, slots=True)
class Entry:
    """One planner; ``module`` holds its ``plan`` and is imported on the first call only.

    ``paper`` is its source, empty where it is our own; ``defaults`` its parameters as `Problem` has them.
    """

    name: str
    summary: str
    module: str
    paper: str = ""
    defaults: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))

    def plan(self, problem: Problem) -> Solution:
        """A safe path for ``problem``. Raises NoMission where none exists or was found."""
        return cast(Solution, import_module(self.module).plan(problem))


_ENTRIES = (
    Entry(
        name="optimal",
        summary="lattice search over reachable altitudes, string pulling, taut-string altitude profile",
        module="gcsplan.planners.optimal",
        defaults=MappingProxyType({"gap_percent": 0.1, "budget_s": 10.0}),
    ),
)

TABLE: Mapping[str, Entry] = MappingProxyType({entry.name: entry for entry in _ENTRIES})


def names() -> tuple[str, ...]:
    """Every planner's name, the default one first."""
    return tuple(TABLE)


def get(name: str) -> Entry:
    """The planner called ``name``. Raises InputError that names the nearest known one."""
    entry = TABLE.get(name)
    if entry is None:
        near = get_close_matches(name, TABLE, n=1, cutoff=0.5)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise InputError(f"there is no planner {name!r}.{hint} Known: {', '.join(TABLE)}")
    return entry
