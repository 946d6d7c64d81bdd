"""The scenarios of the five papers: mission file, algorithms, number of runs. `claims` has what they claim."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

import numpy as np

from gcsplan.bench.papers.printed import StraightFlight
from gcsplan.bench.papers.readings import readings_of
from gcsplan.errors import InputError, unknown_name
from gcsplan.mavlink.build.order import Margins
from gcsplan.mission_file import MissionFile, samples
from gcsplan.planners.problem import Problem
from gcsplan.planners.registry import get as get_planner
from gcsplan.planners.swarm.settings import Settings
from gcsplan.world.world import World

MISSION_FOLDERS = (Path("missions", "papers"), *(folder / "papers" for folder in samples.SAMPLE_FOLDERS))
"""Folders in which the mission files are searched: here, then those of the samples."""


@dataclass(frozen=True, slots=True)
class Contender:
    """An algorithm of a paper's table: a planner's name, and its options on top of the scenario's mission file."""

    name: str
    planner: str
    options: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))


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
    """The scenarios called ``names`` (None: all), each with those of its contenders that ``algorithms`` names; None:
    all, or without ``readings`` the paper's own.

    Raises InputError for an unknown name, and if nothing is left.
    """
    asked = _known("scenario", names, SCENARIOS)
    here = {c.name: None for name in asked for c in SCENARIOS[name].contenders}
    wanted = _known("algorithm", algorithms, here)
    if algorithms is None and not readings:
        wanted = [name for name in wanted if ":" not in name]
    picked = [(SCENARIOS[n], [c for c in SCENARIOS[n].contenders if c.name in wanted]) for n in asked]
    return [(scenario, contenders) for scenario, contenders in picked if contenders]


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
    return Settings.of(get_planner(contender.planner), {**options, "speed_m_s": speed_m_s})
