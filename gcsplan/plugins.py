"""What other packages add to gcsplan, by name: registered by a script, or by the entry points of an installed package.

A table of gcsplan's own counts before both, so that nothing added replaces what is there. Installed packages are looked
through once for a process, and only when a name is not gcsplan's own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any

from gcsplan.errors import GcsplanError, InputError, raised, wrong_argument

__all__ = [
    "OPTIMISERS_ADDED", "OUTPUTS", "PLANNERS", "ZONE_READERS", "Added", "failing", "function_at", "register_optimiser",
    "register_output", "register_planner", "register_zone_reader",
]  # fmt: skip

_ADDED_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


class Added:
    """The functions of one group of entry points, such as ``gcsplan.planners``."""

    def __init__(self, group: str) -> None:
        self.group = group
        self._registered: dict[str, Callable[..., Any]] = {}

    def register(self, name: str, function: Callable[..., Any]) -> None:
        """Add a function for this process; a later one of the same name replaces it. Raises UsageError."""
        if not isinstance(name, str) or not _ADDED_NAME.fullmatch(name.removeprefix(".")):
            expected = "text of letters, digits, . _ and - (64 characters at most)"
            raise wrong_argument(self.group, "a name", name, expected)
        if not callable(function):
            raise wrong_argument(self.group, name, function, "a function")
        self._registered[name] = function

    def forget(self) -> None:
        """Forget what was registered in this process."""
        self._registered.clear()

    def names(self) -> tuple[str, ...]:
        """All names that were added, in order."""
        return tuple(sorted({*self._registered, *_entry_points(self.group)}))

    def get(self, name: str) -> Callable[..., Any] | None:
        """The function called ``name``; None if there is none. Raises InputError if its package cannot be imported."""
        if name in self._registered:
            return self._registered[name]
        point = _entry_points(self.group).get(name)
        if point is None:
            return None
        with failing(f"{self.group}: {name}"):
            found = point.load()
        if not callable(found):
            raise InputError(f"the entry point {point.value} is no function", where=f"{self.group}: {name}")
        return found  # type: ignore[no-any-return]


PLANNERS, OUTPUTS = Added("gcsplan.planners"), Added("gcsplan.outputs")
ZONE_READERS, OPTIMISERS_ADDED = Added("gcsplan.zone_readers"), Added("gcsplan.optimisers")


@cache
def _entry_points(group: str) -> Mapping[str, Any]:
    from importlib.metadata import entry_points

    return {point.name: point for point in entry_points(group=group)}


def function_at(place: str, where: str) -> Callable[..., Any]:
    """The function at ``MODULE:FUNCTION``. Raises InputError."""
    module, _, name = place.partition(":")
    with failing(f"{where}: {place}"):
        try:
            found = getattr(import_module(module), name)
        except ModuleNotFoundError as why:
            words = f"there is no module {why.name}: install it, or let PYTHONPATH name its folder"
            raise InputError(words, where=f"{where}: {place}") from why
    if not callable(found):
        raise InputError(f"{place} is no function", where=where)
    return found  # type: ignore[no-any-return]


@contextmanager
def failing(where: str) -> Iterator[None]:
    """Around the code of another package: what it raises becomes an InputError, but for gcsplan's own errors."""
    try:
        yield
    except GcsplanError:
        raise
    except Exception as why:
        raise InputError(f"failed with {raised(why)}", where=where) from why


def register_planner(name: str, function: Callable[..., Any]) -> None:
    """Add a planner for this process: ``function(problem: Problem) -> Solution``, which may raise `Refusal`.

    ``plan(mission, planner=name)``, ``--planner`` and mission files then know it. Its path is judged like any other;
    a lower bound or a proof that it claims is not taken over, because nothing can check them. A package adds one for
    all processes by an entry point of the group ``gcsplan.planners``. Raises UsageError for a bad name.
    """
    PLANNERS.register(name, function)


def register_output(name: str, function: Callable[..., Any]) -> None:
    """Add an output for this process: ``function(plan: Plan) -> Mapping[str, str]``, from file names to texts.

    They are written with every plan, whole or not at all, beside gcsplan's own files. Entry points:
    ``gcsplan.outputs``. Raises UsageError for a bad name.
    """
    OUTPUTS.register(name, function)


def register_zone_reader(ending: str, function: Callable[..., Any]) -> None:
    """Add a format of zone files for this process: ``function(data: bytes) -> Mapping``, the zones as GeoJSON.

    ``ending`` is that of the files' names, such as ``.dat``. The GeoJSON is read with all checks of a GeoJSON file.
    Entry points: ``gcsplan.zone_readers``, named by the ending. Raises UsageError for a bad name.
    """
    ZONE_READERS.register(ending.lower() if isinstance(ending, str) else ending, function)


def register_optimiser(name: str, function: Callable[..., Any]) -> None:
    """Add an optimiser for this process: a generator function ``function(run)`` that yields populations.

    Entry points: ``gcsplan.optimisers``. Raises UsageError for a bad name.
    """
    OPTIMISERS_ADDED.register(name, function)
