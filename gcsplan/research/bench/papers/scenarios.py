"""The scenarios of the five papers: mission file, algorithms, number of runs. `judge` has their claims.

`READINGS` are other ways to understand a rule or a setting, run and judged beside the one that is decided. One changes
the options of some algorithms of its paper. Those run under a name of their own (`ssgwo:leaders-all`), and every claim
in which one of them takes part is judged once more with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

import numpy as np

from gcsplan.errors import InputError, unknown_name
from gcsplan.mavlink.build.order import Margins
from gcsplan.mission_file import MissionFile
from gcsplan.mission_file.source import SAMPLE_FOLDERS
from gcsplan.planners.problem import Problem
from gcsplan.plugins import OPTIMISERS_ADDED
from gcsplan.research.bench.papers.printed import StraightFlight
from gcsplan.research.optimisers.registry import get as get_optimiser
from gcsplan.research.swarm import SWARM_PLANNERS
from gcsplan.research.swarm.settings import Settings
from gcsplan.world.world import World

Options = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class PaperReading:
    """One reading: ``what`` names the difference; ``changes``: algorithm of the paper to its options on top."""

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


_BEES = ("all-bees-at-once", "all bees of one kind start from the results of the kind before (ABC)")
_BY_OFFSETS = MappingProxyType({"encoding": "offsets"})
_BY_SECTIONS = MappingProxyType({"encoding": "sections"})
_BY_METRES = MappingProxyType({"encoding": "sections-whole"})
_BY_POLAR, _BY_BOX = MappingProxyType({"encoding": "polar"}), MappingProxyType({"encoding": "box"})
FIELD_M = 800.0
"""Side of SSGWO's map, in which SOGWO's published code would measure its distances."""

READINGS: Mapping[str, tuple[PaperReading, ...]] = MappingProxyType({
    "krill": (
        _of("one-krill-at-a-time", "each krill sees where the ones before it went (fig. 9)", krill=_with(moves="one")),
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


MISSION_FOLDERS = (Path("missions", "papers"), *(folder / "papers" for folder in SAMPLE_FOLDERS))
"""Folders in which the mission files are searched: here, then the folders of the samples."""


@dataclass(frozen=True, slots=True)
class Contender:
    """An algorithm of a paper's table: a planner's name, and its options on top of the scenario's mission file.

    ``added``: an optimiser that was added, which searches in place of the planner's own.
    """

    name: str
    planner: str
    options: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))
    added: str = ""

    @property
    def optimiser(self) -> str:
        """The name of the optimiser that searches."""
        return self.added or SWARM_PLANNERS[self.planner].optimiser


@dataclass(frozen=True, slots=True)
class Paper:
    """A paper: its contenders, its own algorithm first, and its number of runs (30 if it names none)."""

    name: str
    title: str
    runs: int
    contenders: tuple[Contender, ...]
    fleet: str = ""

    @property
    def readings(self) -> tuple[Contender, ...]:
        """The contenders that other readings of the paper make of its own, under names such as ``pso:inertia-1``."""
        return tuple(
            Contender(reading.stands_for(c.name), c.planner, _merged(c.options, reading.changes[c.name]))
            for reading in readings_of(self.name)
            for c in self.contenders
            if c.name in reading.changes
        )


@dataclass(frozen=True, slots=True)
class Scenario:
    """A mission file's stem, its paper, and the paper's tables for it.

    ``twin_of``: the scenario of which this is another reading of the world; empty for the paper's own.
    """

    name: str
    paper: Paper
    tables: str
    twin_of: str = ""

    @property
    def contenders(self) -> tuple[Contender, ...]:
        """All that run here: the paper's own, and its readings unless this is a twin."""
        return self.paper.contenders if self.twin_of else (*self.paper.contenders, *self.paper.readings)

    def contender(self, name: str) -> Contender:
        """The contender called ``name``; of an optimiser that was added, in the search space of the paper's own."""
        own = next((c for c in self.contenders if c.name == name), None)
        return own or Contender(name, self.paper.contenders[0].planner, added=name)


def _merged(options: Mapping[str, object], more: Mapping[str, object]) -> Mapping[str, object]:
    """``options`` replaced by ``more``; of ``parameters`` each by itself."""
    both = {**options, **more}
    parts = [dict(some["parameters"]) for some in (options, more) if isinstance(some.get("parameters"), Mapping)]  # type: ignore[call-overload]
    if parts:
        both["parameters"] = {key: value for part in parts for key, value in part.items()}
    return MappingProxyType(both)


def _plain(*names: str) -> tuple[Contender, ...]:
    return tuple(Contender(name, name) for name in names)


def _adapted(alpha: int, beta: int) -> Contender:
    more = {"alpha": float(alpha), "beta": float(beta)}
    return Contender(f"abo-{alpha}-{beta}", "abo", MappingProxyType({"parameters": more}))


_PAPER_KRILL = Paper(
    "krill", "Xu, Zhu, Sun 2024, Biomimetics 9, 353", 30, _plain("krill", "abc", "aco"),
)  # fmt: skip
_PAPER_SSGWO = Paper(
    "ssgwo", "Feng et al. 2024, Electronics 13, 68", 50, _plain("ssgwo", "gwo", "mgwo", "igwo", "sogwo"),
)  # fmt: skip
# Table 1 gives the bees 50 employed and 50 onlookers: 50 food sources. They fly together: one by one, the 60,000 costs
# of a run take as long as ten other runs, and in the other papers' scenarios the order makes no difference.
_MSFOA_ABC = Contender("abc", "abc", MappingProxyType({"population": 50, "parameters": {"bees": "together"}}))
_PAPER_MSFOA = Paper(
    "msfoa", "Shi, Zhang, Xia 2020, Applied Sciences 10, 2822", 40,
    (*_plain("msfoa", "foa", "pso", "de"), _MSFOA_ABC, *_plain("iffo", "mfoa")),
    fleet="priority",
)  # fmt: skip
_PAPER_ABO = Paper(
    "abo", "Li et al. 2024, adaptive budgerigar optimization", 30,
    (*_plain("abo", "po", "pso"), _adapted(1, 2), _adapted(2, 1), _adapted(2, 2)),
)  # fmt: skip
_PAPER_IB_ABC = Paper(
    "ib-abc", "Tan et al. 2023, Robotica 41, 1244-1257", 10, _plain("ib-abc", "b-abc", "abc", "gwo"),
    fleet="alone",
)  # fmt: skip

SCENARIOS: Mapping[str, Scenario] = MappingProxyType(
    {
        s.name: s
        for s in (
            Scenario("krill-mound", _PAPER_KRILL, "table 2"),
            Scenario("krill-forest", _PAPER_KRILL, "table 3"),
            Scenario("krill-hills", _PAPER_KRILL, "table 4"),
            *(Scenario(f"ssgwo-table{n}{twin}", _PAPER_SSGWO, f"table {n + 1}", f"ssgwo-table{n}" if twin else "")
              for n in (3, 5, 7) for twin in ("", "-tall")),
            *(Scenario(f"msfoa-{n}", _PAPER_MSFOA, "tables 2, 3") for n in (1, 2, 3)),
            Scenario("abo", _PAPER_ABO, "figs. 3-6"),
            Scenario("ib-abc-together", _PAPER_IB_ABC, "table II"),
            Scenario("ib-abc-sequence", _PAPER_IB_ABC, "table IV"),
        )
    }
)  # fmt: skip


def choose(
    names: Sequence[str] | None, algorithms: Sequence[str] | None, *, readings: bool = True
) -> list[tuple[Scenario, list[Contender]]]:
    """The scenarios called ``names`` (None: all), each with its contenders that ``algorithms`` names; None: all, or
    without ``readings`` the paper's own. An optimiser that was added, or is at ``MODULE:FUNCTION``, runs in each, too,
    and chooses none of the others.

    Raises InputError for an unknown name, and if nothing is left.
    """
    chosen = _known("scenario", names, SCENARIOS)
    here = {c.name: None for name in chosen for c in SCENARIOS[name].contenders}
    added = [a for a in algorithms or () if a not in here and (":" in a or OPTIMISERS_ADDED.get(a) is not None)]
    own = None if added and len(added) == len(algorithms or ()) else algorithms
    allowed = _known("algorithm", None if own is None else [a for a in own if a not in added], here)
    if own is None and not readings:
        allowed = [name for name in allowed if ":" not in name]
    for name in added:
        get_optimiser(name)
    picked = [(SCENARIOS[n], [c for c in SCENARIOS[n].contenders if c.name in allowed]) for n in chosen]
    more = list(dict.fromkeys(added))
    return [(s, contenders + [s.contender(name) for name in more]) for s, contenders in picked if contenders]


def _known(what: str, names: Sequence[str] | None, known: Mapping[str, object]) -> list[str]:
    if names is None:
        return list(known)
    for name in names:
        if name not in known:
            raise unknown_name(f"there is no {what} {name!r} here", name, known)
    if not names:
        raise InputError(f"no {what} is given; known: {', '.join(known)}")
    return list(dict.fromkeys(names))


def mission_text(name: str, folder: Path | None = None) -> str:
    """The text of the scenario's mission file. Raises InputError with the folders that were searched."""
    folders = MISSION_FOLDERS if folder is None else (folder,)
    for place in folders:
        file = place / f"{name}.yaml"
        if file.is_file():
            return file.read_text(encoding="utf-8")
    raise InputError(
        f"the mission file {name}.yaml is in none of {', '.join(map(str, folders))}: run this in a copy of the "
        "sources, or name the directory of the missions"
    )


@dataclass(frozen=True, eq=False, slots=True)
class ReadyScenario:
    """A scenario's mission, ready for a search: one problem per vehicle."""

    source: MissionFile
    world: World
    problems: tuple[Problem, ...]

    @property
    def least(self) -> tuple[StraightFlight, ...]:
        """The straight flight of each vehicle between the mission's ends."""
        return tuple(StraightFlight.between(p.start, p.goal) for p in self.problems)


@lru_cache(maxsize=20)
def prepare(name: str, text: str) -> ReadyScenario:
    """The mission ``text`` of scenario ``name``, without margins for the wire, since nothing is sent."""
    from gcsplan.app.fleet.pipeline import load_mission, world_of
    from gcsplan.app.plan.problem import make_problem

    source = load_mission(f"{name}.yaml", text=text)
    world = world_of(source)
    bare = Margins(0.0, 0.0, 0.0, 0.0, (0.0, 0.0))
    objective = source.planner.objective
    problems = tuple(make_problem(source, r, world, objective, source.planner.seed, bare)[0] for r in source.vehicles)
    return ReadyScenario(source, world, problems)


def settings_of(contender: Contender, source: MissionFile) -> Settings:
    """The settings of a contender: its planner's defaults, overridden by the mission's keys, then by its options."""
    options = _merged(dict(source.planner.extras), contender.options)
    speed_m_s = float(np.max([r.vehicle.speed_max_m_s for r in source.vehicles]))
    return Settings.of(SWARM_PLANNERS[contender.planner], {**options, "speed_m_s": speed_m_s})
