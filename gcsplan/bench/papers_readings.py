"""Readings of the papers: other ways to understand a rule or a setting, run and judged beside the one that is decided.

A reading changes the options of some algorithms of its paper. Those run under a name of their own
(`ssgwo:leaders-all`), and every claim in which one of them takes part is judged once more with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

Options = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Reading:
    """One reading: ``what`` says what differs; ``changes``: algorithm of the paper to its options on top."""

    name: str
    what: str
    changes: Mapping[str, Options]

    def stands_for(self, algorithm: str) -> str:
        """The name under which an algorithm runs in this reading."""
        return f"{algorithm}:{self.name}" if algorithm in self.changes else algorithm


def _of(name: str, what: str, **changes: Options) -> Reading:
    return Reading(name, what, MappingProxyType({key.replace("_", "-"): value for key, value in changes.items()}))


def _with(**parameters: object) -> Options:
    return MappingProxyType({"parameters": parameters})


READINGS: Mapping[str, tuple[Reading, ...]] = MappingProxyType({
    "abo": (
        _of("inertia-1", "PSO with inertia 1 throughout", pso=_with(inertia_first=1.0, inertia_last=1.0)),
        _of("inertia-0.8", "PSO with inertia 0.8 throughout", pso=_with(inertia_first=0.8, inertia_last=0.8)),
    ),
})  # fmt: skip
"""By paper."""


def readings_of(paper: str) -> tuple[Reading, ...]:
    """The readings of a paper."""
    return READINGS.get(paper, ())
