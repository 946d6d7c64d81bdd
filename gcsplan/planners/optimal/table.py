"""The searches of the default planner: each module of `searches` has one, of the module's name."""

from __future__ import annotations

import pkgutil
from collections.abc import Sequence
from functools import cache
from importlib import import_module

from gcsplan.errors import InputError
from gcsplan.planners.optimal import searches
from gcsplan.planners.optimal.loop.search import Search
from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.problem import Problem

NAMES = tuple(sorted(module.name for module in pkgutil.iter_modules(searches.__path__)))
"""The names of all searches; which of them a mission has depends on its objective and limits."""


@cache
def kinds() -> tuple[type[Search], ...]:
    """All searches, by name."""
    found = []
    for name in NAMES:
        module = import_module(f"{searches.__name__}.{name}")
        found += [c for c in vars(module).values() if isinstance(c, type) and getattr(c, "NAME", "") == name]
    return tuple(found)


def all_searches(work: Workspace) -> list[Search]:
    """The searches of one problem, without the ones that its options exclude. Raises InputError for an unknown name."""
    without = left_out(work.incumbent.problem)
    return [kind(work) for kind in kinds() if kind.NAME not in without]


def left_out(problem: Problem) -> tuple[str, ...]:
    """The searches that a problem's options leave out. Raises InputError for an unknown name."""
    without = problem.options.get("without", ())
    names = tuple(str(n) for n in without) if isinstance(without, tuple | list) else (str(without),)
    require_names(names)
    return names


def require_names(names: Sequence[str]) -> None:
    """Raise InputError for a name that no search has."""
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        raise InputError(f"the searches are {', '.join(NAMES)}; given {', '.join(unknown)}")
