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
class PaperReading:
    """One reading: ``what`` says what differs; ``changes``: algorithm of the paper to its options on top."""

    name: str
    what: str
    changes: Mapping[str, Options]

    def stands_for(self, algorithm: str) -> str:
        """The name under which an algorithm runs in this reading."""
        return f"{algorithm}:{self.name}" if algorithm in self.changes else algorithm


def _of(name: str, what: str, **changes: Options) -> PaperReading:
    return PaperReading(name, what, MappingProxyType({key.replace("_", "-"): value for key, value in changes.items()}))


def _with(**parameters: object) -> Options:
    return MappingProxyType({"parameters": parameters})


_BEES = ("all-bees-at-once", "all bees of one kind start from what the kind before left (ABC)")
_BY_OFFSETS = MappingProxyType({"encoding": "offsets"})
_BY_SECTIONS = MappingProxyType({"encoding": "sections"})
_BY_METRES = MappingProxyType({"encoding": "sections-whole"})
_BY_POLAR, _BY_BOX = MappingProxyType({"encoding": "polar"}), MappingProxyType({"encoding": "box"})
FIELD_M = 800.0
"""Side of SSGWO's map, in which SOGWO's published code would measure its distances."""

READINGS: Mapping[str, tuple[PaperReading, ...]] = MappingProxyType({
    "krill": (
        _of("one-krill-at-a-time", "each krill sees where those before it went (fig. 9)", krill=_with(moves="one")),
        _of("printed-crowd", "it goes where food over n_f is less than δ times its own", krill=_with(crowd="printed")),
        _of(*_BEES, abc=_with(bees="together")),
    ),
    "ssgwo": (
        _of("leaders-apart", "leaders move by eq. 17-19, and only to improve", ssgwo=_with(leaders="apart")),
        _of("trial-alpha", "eq. 24 tries α alone, all others move anyway", ssgwo=_with(trial="alpha")),
        _of("printed", "eq. 13 and 17-23 as printed, for all wolves", ssgwo=_with(factor="printed", leaders="printed")),
        _of("published-sogwo", "SOGWO's opposition as in its authors' code, distances in metres",
            sogwo=_with(alike="distances", span=FIELD_M)),
        _of("offsets", "all wolves search lateral offsets and altitudes at stations", ssgwo=_BY_OFFSETS,
            gwo=_BY_OFFSETS, mgwo=_BY_OFFSETS, igwo=_BY_OFFSETS, sogwo=_BY_OFFSETS),
        _of("sections", "all wolves search points on planes across the track", ssgwo=_BY_SECTIONS, gwo=_BY_SECTIONS,
            mgwo=_BY_SECTIONS, igwo=_BY_SECTIONS, sogwo=_BY_SECTIONS),
    ),
    "msfoa": (
        _of("printed-step", "global step 1 as in eq. 7-8, clipped to the quarter circle", msfoa=_with(global_step=1.0)),
        _of("redrawn", "global step 1, drawn again where S is above 1 (step 8)",
            msfoa=_with(global_step=1.0, beyond="redrawn")),
        # The hidden variables span twice as much, so the same steps are half as many parts of the unit box.
        _of("signed", "hidden X and Y may be negative; steps in S as decided, drawn again where S is above 1",
            msfoa=MappingProxyType({"encoding": "polar-signed", "parameters": {
                "global_step": 0.15, "local_step": 0.025, "beyond": "redrawn", "origin": 0.5}})),
        _of("signed-printed-step", "the same with global step 1",
            msfoa=MappingProxyType({"encoding": "polar-signed", "parameters": {
                "global_step": 0.5, "local_step": 0.025, "beyond": "redrawn", "origin": 0.5}})),
        _of("all-in-a-box", "MSFOA and FOA search the box, as their rivals do", msfoa=_BY_BOX, foa=_BY_BOX),
        _of("all-polar", "the rivals search hidden variables, as MSFOA and FOA do", pso=_BY_POLAR, de=_BY_POLAR,
            abc=_BY_POLAR, iffo=_BY_POLAR, mfoa=_BY_POLAR),
    ),
    "abo": (
        _of("inertia-1", "PSO with inertia 1 throughout", pso=_with(inertia_first=1.0, inertia_last=1.0)),
        _of("inertia-0.8", "PSO with inertia 0.8 throughout", pso=_with(inertia_first=0.8, inertia_last=0.8)),
        # No particle has a speed of ten boxes: the bounds stop it before.
        _of("inertia-1-unlimited", "PSO with inertia 1 and no limit of speed",
            pso=_with(inertia_first=1.0, inertia_last=1.0, top_speed=10.0)),
        _of("inertia-0.8-unlimited", "PSO with inertia 0.8 and no limit of speed",
            pso=_with(inertia_first=0.8, inertia_last=0.8, top_speed=10.0)),
        _of("published-po", "PO as in its authors' code, lengths in metres", po=_with(rule="authors", span=100.0)),
    ),
    "ib-abc": (
        _of("20-iterations", "“iteration cycle 20” is the number of iterations",
            **{name.replace("-", "_"): MappingProxyType({"iterations": 20})
               for name in ("ib-abc", "b-abc", "abc", "gwo")}),
        _of("phi-to-half", "φ of eq. 7 and 9 from −½ to ½", ib_abc=_with(scale=0.5), b_abc=_with(scale=0.5)),
        _of("counts-from-0", "the first Tr is 0, so no bee moves in the first cycle", ib_abc=_with(counts_from="zero")),
        _of("whole-metres", "way points are whole metres (section 2.2)", ib_abc=_BY_METRES, b_abc=_BY_METRES,
            abc=_BY_METRES, gwo=_BY_METRES),
        _of(*_BEES, abc=_with(bees="together")),
    ),
})  # fmt: skip
"""By paper."""


def readings_of(paper: str) -> tuple[PaperReading, ...]:
    """The readings of a paper."""
    return READINGS.get(paper, ())
