"""The scenarios of the five papers: mission file, algorithms, number of runs, and each paper's claims.

A claim is derived from the printed numbers (which is below which) if there are any. The claims from curves that a paper
shows without numbers are written out here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

import numpy as np

from gcsplan.bench.papers_printed import PRINTED, Least
from gcsplan.errors import InputError, unknown_name
from gcsplan.mavlink.build.order import Margins
from gcsplan.mission_file import MissionFile, samples
from gcsplan.planners.problem import Problem
from gcsplan.planners.registry import get as get_planner
from gcsplan.planners.swarm.planner import Settings
from gcsplan.world.world import World

FOLDERS = (Path("missions", "papers"), *(folder / "papers" for folder in samples.FOLDERS))
"""Folders in which the mission files are searched: here, then those of the samples."""


@dataclass(frozen=True, slots=True)
class Contender:
    """An algorithm of a paper's table: a planner's name, and its options on top of the scenario's mission file."""

    name: str
    planner: str
    options: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True, slots=True)
class Claim:
    """ "``low`` has less of ``measure`` than ``high``", as a paper claims."""

    measure: str
    low: str
    high: str
    source: str


@dataclass(frozen=True, slots=True)
class Paper:
    """A paper: its contenders, its own algorithm first, and its number of runs (30 if it names none)."""

    name: str
    title: str
    runs: int
    contenders: tuple[Contender, ...]
    claimed: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """Printed measure to the measure of gcsplan that is ranked for it."""
    shown: tuple[Claim, ...] = ()
    fleet: str = ""


@dataclass(frozen=True, slots=True)
class Scenario:
    """A mission file's stem, its paper, and the paper's tables for it."""

    name: str
    paper: Paper
    tables: str


def _plain(*names: str) -> tuple[Contender, ...]:
    return tuple(Contender(name, name) for name in names)


def _adapted(alpha: int, beta: int) -> Contender:
    more = {"alpha": float(alpha), "beta": float(beta)}
    return Contender(f"abo-{alpha}-{beta}", "abo", MappingProxyType({"parameters": more}))


_KRILL = Paper(
    "krill", "Xu, Zhu, Sun 2024, Biomimetics 9, 353", 30, _plain("krill", "abc", "aco"),
    MappingProxyType({"length_m": "length", "energy_j": "energy", "time_s": "time"}),
    tuple(Claim("iterations", low, high, "figs. 14-18") for low, high in (("krill", "abc"), ("abc", "aco"))),
)  # fmt: skip
_SSGWO = Paper(
    "ssgwo", "Feng et al. 2024, Electronics 13, 68", 50, _plain("ssgwo", "gwo", "mgwo", "igwo", "sogwo"),
    MappingProxyType({"mean_length_m": "length", "collisions": "collisions", "pitch_deg": "pitch", "yaw_deg": "yaw"}),
)  # fmt: skip
_MSFOA = Paper(
    "msfoa", "Shi, Zhang, Xia 2020, Applied Sciences 10, 2822", 40,
    # Table 1 gives the bees 50 employed and 50 onlookers: 50 food sources.
    (*_plain("msfoa", "foa", "pso", "de"), Contender("abc", "abc", MappingProxyType({"population": 50})),
     *_plain("iffo", "mfoa")),
    MappingProxyType({"mean_cost": "cost"}), fleet="priority",
)  # fmt: skip
_ABO = Paper(
    "abo", "Li et al. 2024, adaptive budgerigar optimization", 30,
    (*_plain("abo", "po", "pso"), _adapted(1, 2), _adapted(2, 1), _adapted(2, 2)),
    shown=(Claim("cost", "abo", "pso", "fig. 5"), Claim("cost", "abo", "abo-1-2", "fig. 6"),
           Claim("cost", "abo", "abo-2-1", "fig. 6"), Claim("cost", "abo", "abo-2-2", "fig. 6")),
)  # fmt: skip
_IB_ABC = Paper(
    "ib-abc", "Tan et al. 2023, Robotica 41, 1244-1257", 10, _plain("ib-abc", "b-abc", "abc", "gwo"),
    MappingProxyType({"length_sum_m": "length"}), (Claim("length", "ib-abc", "gwo", "section 4.1, 4.2"),), "alone",
)  # fmt: skip

SCENARIOS: Mapping[str, Scenario] = MappingProxyType(
    {
        s.name: s
        for s in (
            Scenario("krill-mound", _KRILL, "table 2"),
            Scenario("krill-forest", _KRILL, "table 3"),
            Scenario("krill-hills", _KRILL, "table 4"),
            *(Scenario(f"ssgwo-table{n}{twin}", _SSGWO, f"table {n + 1}") for n in (3, 5, 7) for twin in ("", "-tall")),
            *(Scenario(f"msfoa-{n}", _MSFOA, "tables 2, 3") for n in (1, 2, 3)),
            Scenario("abo", _ABO, "figs. 3-6"),
            Scenario("ib-abc-together", _IB_ABC, "table II"),
            Scenario("ib-abc-sequence", _IB_ABC, "table IV"),
        )
    }
)  # fmt: skip


def choose(names: Sequence[str] | None, algorithms: Sequence[str] | None) -> list[tuple[Scenario, list[Contender]]]:
    """The scenarios called ``names`` (None: all), each with the contenders of its paper that ``algorithms`` names.

    Raises InputError for an unknown name, and if nothing is left.
    """
    asked = _known("scenario", names, SCENARIOS)
    here = {c.name: None for name in asked for c in SCENARIOS[name].paper.contenders}
    wanted = _known("algorithm", algorithms, here)
    picked = [(SCENARIOS[n], [c for c in SCENARIOS[n].paper.contenders if c.name in wanted]) for n in asked]
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


def claims_of(scenario: Scenario) -> list[Claim]:
    """The paper's claims: its algorithm against each other one, and the printed order of the others."""
    own = scenario.paper.contenders[0].name
    out: list[Claim] = []
    rows = {c.name: printed_measures(scenario.name, c.name) for c in scenario.paper.contenders}
    names = [name for name, row in rows.items() if row]
    pairs = [(own, rival) for rival in names if rival != own]
    if scenario.paper in (_KRILL, _IB_ABC):  # these papers rank their baselines too
        pairs += [(a, b) for i, a in enumerate(names) for b in names[i + 1 :] if own not in (a, b)]
    for printed, ours in scenario.paper.claimed.items():
        for a, b in pairs:
            x, y = rows[a].get(printed), rows[b].get(printed)
            if x is not None and y is not None and x != y:
                out.append(Claim(ours, *((a, b) if x < y else (b, a)), scenario.tables))
    return out + list(scenario.paper.shown)


def printed_measures(scenario: str, algorithm: str) -> dict[str, float]:
    """The printed numbers, and the sum of a fleet's lengths."""
    row = {measure: number.value for measure, number in PRINTED.get((scenario, algorithm), {}).items()}
    lengths = [row[f"length_{i}_m"] for i in range(1, 5) if f"length_{i}_m" in row]
    if lengths:
        row["length_sum_m"] = sum(lengths)
    return row


def mission_text(name: str, folder: Path | None = None) -> str:
    """The text of the scenario's mission file. Raises InputError with the folders that were searched."""
    folders = FOLDERS if folder is None else (folder,)
    for place in folders:
        file = place / f"{name}.yaml"
        if file.is_file():
            return file.read_text(encoding="utf-8")
    raise InputError(
        f"the mission file {name}.yaml is in none of {', '.join(map(str, folders))}: run this in a copy of the "
        "sources, or name the directory of the missions"
    )


@dataclass(frozen=True, eq=False, slots=True)
class Set:
    """A scenario's mission, ready for a search: one problem per vehicle."""

    source: MissionFile
    world: World
    problems: tuple[Problem, ...]

    @property
    def least(self) -> tuple[Least, ...]:
        """The straight flight of each vehicle between the mission's ends."""
        return tuple(Least.between(p.start, p.goal) for p in self.problems)


@lru_cache(maxsize=20)
def prepare(name: str, text: str) -> Set:
    """The mission ``text`` of scenario ``name``, without margins for the wire, since nothing is sent."""
    from gcsplan.app.pipeline import load_mission, world_of
    from gcsplan.app.problems import make_problem

    source = load_mission(f"{name}.yaml", text=text)
    world = world_of(source)
    bare = Margins(0.0, 0.0, 0.0, 0.0)
    objective = source.planner.objective
    problems = tuple(make_problem(source, r, world, objective, source.planner.seed, bare)[0] for r in source.vehicles)
    return Set(source, world, problems)


def settings_of(contender: Contender, source: MissionFile) -> Settings:
    """The settings of a contender: its planner's defaults, overridden by the mission's keys, then by its options."""
    options: dict[str, object] = dict(source.planner.extras)
    for key, value in contender.options.items():
        if key == "parameters":
            assert isinstance(value, Mapping)
            options[key] = {**dict(source.planner.extras.get(key) or {}), **value}
        else:
            options[key] = value
    speed_m_s = float(np.max([r.vehicle.speed_max_m_s for r in source.vehicles]))
    return Settings.of(get_planner(contender.planner).defaults, {**options, "speed_m_s": speed_m_s})
