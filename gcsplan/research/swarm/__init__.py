"""Planners by swarm optimisers: encoding, cost, scene, repair, and ants; the entry of all but `aco` is `planner`.

`SWARM_PLANNERS` has their rows; it is cheap to import, and the planners themselves are imported on the first call.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from types import MappingProxyType
from typing import cast

from gcsplan.planners.problem import Problem, Solution
from gcsplan.planners.registry import PlannerEntry

ENCODING = "offsets"
"""A swarm's encoding by default: the best for most over real terrain (docs/research/benchmarks.md)."""
PAPER = "paper"
"""The encoding's name for the encoding of the planner's own paper."""


@dataclass(frozen=True, slots=True)
class SwarmEntry(PlannerEntry):
    """One planner by a swarm; its ``defaults`` are keys of ``Problem.options``.

    ``optimiser``: its name in `gcsplan.research.optimisers.registry`, aco or cmaes. ``space``: the ``encoding`` and
    ``points`` of its paper, which stand for `PAPER`.
    """

    optimiser: str = ""
    space: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))

    def plan(self, problem: Problem) -> Solution:
        """As `PlannerEntry.plan`; the planner takes its row along."""
        return cast(Solution, import_module(self.module).plan(problem, self))

    def by_priority(self, options: Mapping[str, object]) -> bool:
        """The cost of MSFOA counts the vehicles planned before."""
        return (options.get("cost") or self.defaults.get("cost")) == "msfoa"


def _swarm(name: str, summary: str, paper: str, system: Mapping[str, object], **own: object) -> SwarmEntry:
    """The table's row for an optimiser: its paper's search space and cost (``system``), then its ``own`` defaults."""
    both = {**system, **own}
    space = {key: both[key] for key in ("encoding", "points")}
    if name != "aco":  # ants know their own sections alone
        del both["points"]
        both["encoding"] = ENCODING
    return SwarmEntry(
        name=name,
        summary=summary,
        module="gcsplan.research.swarm.aco" if name == "aco" else "gcsplan.research.swarm.planner",
        paper=paper,
        defaults=MappingProxyType(both),
        warm_starts=True,
        optimiser=name,
        space=MappingProxyType(space),
    )


_KRILL_PAPER = "Xu, Zhu, Sun 2024, Biomimetics 9, 353"
_SSGWO_PAPER = "Feng et al. 2024, Electronics 13, 68"
_MSFOA_CITED = "Shi et al. 2020, Applied Sciences 10, 2822"
_ABO_CITED = "Li et al. 2024, adaptive budgerigar optimization"
_IB_ABC_PAPER = "Tan et al. 2023, Robotica 41, 1244-1257"

# The search space of each paper. D, our decision where the paper is silent: the number of points of MSFOA and IB-ABC.
_KRILL: Mapping[str, object] = {"encoding": "box", "cost": "krill", "points": 5, "population": 50, "iterations": 100}
_SSGWO: Mapping[str, object] = {"encoding": "box", "cost": "ssgwo", "points": 30, "population": 30, "iterations": 500}
_MSFOA: Mapping[str, object] = {"encoding": "box", "cost": "msfoa", "points": 5, "population": 100, "iterations": 200}
_ABO: Mapping[str, object] = {"encoding": "box", "cost": "abo", "points": 3, "population": 200, "iterations": 100}
_IB_ABC: Mapping[str, object] = {
    "encoding": "sections", "cost": "ib-abc", "points": 10, "population": 20, "iterations": 200,
}  # fmt: skip


# D: the papers of these do not plan paths.
_BASELINE: Mapping[str, object] = {
    "encoding": ENCODING, "cost": "krill", "points": None, "population": 100, "evaluations": 10_000,
}  # fmt: skip

SWARM_PLANNERS: Mapping[str, SwarmEntry] = MappingProxyType(
    {
        entry.name: entry
        for entry in (
            _swarm("krill", "krill swarm: foraging, enemy avoidance, cruising", _KRILL_PAPER, _KRILL),
            _swarm("aco", "ants on a grid of sections across the track", _KRILL_PAPER, _KRILL, encoding="sections"),
            _swarm("abc", "artificial bee colony", f"Karaboga 2005; as in {_KRILL_PAPER}", _KRILL),
            _swarm("b-abc", "balanced bee colony, no feedback", _IB_ABC_PAPER, _IB_ABC),
            _swarm("ib-abc", "balanced bee colony with feedback", _IB_ABC_PAPER, _IB_ABC),
            _swarm("gwo", "grey wolves", f"Mirjalili 2014; as in {_SSGWO_PAPER}", _SSGWO),
            _swarm(
                "mgwo", "grey wolves, weighted and greedy (our reading)", f"Zhang 2021; as in {_SSGWO_PAPER}", _SSGWO
            ),
            _swarm(
                "igwo", "grey wolves that learn from neighbours", f"Nadimi-Shahraki 2021; as in {_SSGWO_PAPER}", _SSGWO
            ),
            _swarm("sogwo", "grey wolves with selective opposition", f"Dhargupta 2020; as in {_SSGWO_PAPER}", _SSGWO),
            _swarm("ssgwo", "grey wolves, relative distances, annealing", _SSGWO_PAPER, _SSGWO),
            _swarm("foa", "fruit flies, one swarm", f"Pan 2012; as in {_MSFOA_CITED}", _MSFOA, encoding="polar"),
            _swarm("mfoa", "fruit flies, swarms of a shrinking radius", f"Yuan 2014; as in {_MSFOA_CITED}", _MSFOA),
            _swarm("iffo", "fruit flies, one dimension at a time", f"Pan 2014; as in {_MSFOA_CITED}", _MSFOA),
            _swarm("msfoa", "fruit flies, competing swarms", _MSFOA_CITED, _MSFOA, encoding="polar"),
            _swarm("pso", "particle swarm", f"Shi, Eberhart 1998; as in {_MSFOA_CITED}", _MSFOA),
            _swarm("de", "differential evolution rand/1/bin", f"Storn, Price 1997; as in {_MSFOA_CITED}", _MSFOA),
            _swarm("lshade", "differential evolution, learnt settings", "Tanabe, Fukunaga 2014, CEC", _BASELINE),
            _swarm(
                "cmaes",
                "CMA-ES with restarts, by the package cma",
                "Hansen, Ostermeier 2001; Auger, Hansen 2005",
                _BASELINE,
                population=30,
            ),
            _swarm("po", "parrot optimizer", f"Lian 2024; as in {_ABO_CITED}", _ABO),
            _swarm("abo", "adaptive budgerigars", _ABO_CITED, _ABO),
        )
    }
)


def entry(name: str) -> SwarmEntry:
    """The row of the planner called ``name``; of an optimiser that was added, the row of a baseline."""
    return SWARM_PLANNERS.get(name) or _swarm(name, "", "", _BASELINE)
