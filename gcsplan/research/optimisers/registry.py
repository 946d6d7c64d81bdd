"""The table of all optimisers: summary, paper, equations and defaults of each. Fast to import.

An optimiser is listed here and nowhere else: the driver, the tests and the benchmarks use this table. ``population`` is
the number of solutions in a swarm. One iteration evaluates a multiple of it (``evaluations_per_iteration``, in words),
so comparisons should use equal evaluations too.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

from gcsplan.errors import InputError, unknown_name
from gcsplan.plugins import OPTIMISERS_ADDED, function_at

if TYPE_CHECKING:
    from gcsplan.research.optimisers.box import Steps

Value = float | int | bool | str | None


@dataclass(frozen=True, slots=True)
class OptimiserEntry:
    """One optimiser.

    ``update`` is "module:function" of its update rule (a module of this package unless dotted, imported only on the
    first call), or the function itself. ``equations`` are numbers in the paper. ``loses_to_random`` is empty, or states
    why the rule does not beat random search of equal evaluations on a shifted Sphere and Rastrigin of 30 dimensions.
    """

    name: str
    summary: str
    update: str | Callable[..., Steps]
    paper: str
    equations: str
    population: int
    iterations: int
    evaluations_per_iteration: str = "P"
    defaults: Mapping[str, Value] = field(default_factory=lambda: MappingProxyType({}))
    least_population: int = 1
    loses_to_random: str = ""

    def rule(self) -> Callable[..., Steps]:
        """The generator function of the update rule; imports its module."""
        if callable(self.update):
            return self.update
        module, _, function = self.update.partition(":")
        where = module if "." in module else f"gcsplan.research.optimisers.{module}"
        return cast("Callable[..., Steps]", getattr(import_module(where), function))

    def with_defaults(self, parameters: Mapping[str, object] | None = None) -> dict[str, object]:
        """The defaults, replaced by ``parameters``. Raises InputError for an unknown name or a wrong kind of value."""
        given = dict(parameters or {})
        for name, value in given.items():
            if name not in self.defaults:
                raise unknown_name(f"{self.name} has no parameter {name!r}", name, self.defaults)
            usual = self.defaults[name]
            if not _fits(value, usual):
                raise InputError(f"{self.name}: {name} must be {_kind(usual)}, given {value!r}")
        return {**self.defaults, **given}


def _fits(value: object, usual: Value) -> bool:
    if isinstance(usual, bool) or isinstance(value, bool):
        return isinstance(usual, bool) and isinstance(value, bool)
    if isinstance(usual, int):
        return isinstance(value, int) and value >= 1
    if isinstance(usual, str):
        return isinstance(value, str)
    # A number equals itself unless it is NaN.
    return (value is None and usual is None) or (isinstance(value, (int, float)) and value == value)


def _kind(usual: Value) -> str:
    if isinstance(usual, bool):
        return "true or false"
    if isinstance(usual, int):
        return "a whole number, 1 or more"
    return "a word" if isinstance(usual, str) else "a number"


def _set(**values: Value) -> Mapping[str, Value]:
    return MappingProxyType(values)


_KRILL_PAPER = "Xu, Zhu, Sun 2024, Biomimetics 9, 353"
_SSGWO_PAPER = "Feng et al. 2024, Electronics 13, 68"
_MSFOA_PAPER = "Shi, Zhang, Xia 2020, Multiple Swarm Fruit Fly Optimization Algorithm Based Path Planning"
_ABO_PAPER = "Li et al., Adaptive Budgerigar Optimization-based Obstacle Avoidance Path Planning"
_IB_ABC_PAPER = "Tan et al. 2023, Robotica 41, 1244-1257"

_OPTIMISERS = (
    OptimiserEntry(
        name="krill",
        summary="foraging, enemy avoidance and cruising of krill",
        update="krill:krill",
        paper=_KRILL_PAPER,
        equations="5-8",
        population=50,
        iterations=100,
        evaluations_per_iteration="2P to 23P, about 20P",
        defaults=_set(sight=0.3, step=0.1, crowding=0.618, attempts=10, moves="together", crowd="ranks"),
    ),
    OptimiserEntry(
        name="abc",
        summary="artificial bee colony",
        update="bees:abc",
        paper=f"Karaboga 2005; as in {_KRILL_PAPER}",
        equations="3-4",
        population=50,
        iterations=500,
        evaluations_per_iteration="2P, and 1 for a scout",
        defaults=_set(limit=20, group=1, bees="one"),
        least_population=2,
    ),
    OptimiserEntry(
        name="b-abc",
        summary="balanced bee colony: IB-ABC without its feedback (our reading)",
        update="bees:ib_abc",
        paper=_IB_ABC_PAPER,
        equations="7-10, μ = 1",
        population=20,
        iterations=200,
        evaluations_per_iteration="2P, and P/2 for scouts",
        defaults=_set(feedback=False, scale=1.0, spent_share=0.5, group=1, counts_from="one"),
        least_population=3,
    ),
    OptimiserEntry(
        name="ib-abc",
        summary="balanced bee colony with feedback from failed searches",
        update="bees:ib_abc",
        paper=_IB_ABC_PAPER,
        equations="7-10",
        population=20,
        iterations=200,
        evaluations_per_iteration="2P, and P/2 for scouts",
        defaults=_set(feedback=True, scale=1.0, spent_share=0.5, group=1, counts_from="one"),
        least_population=3,
    ),
    OptimiserEntry(
        name="gwo",
        summary="grey wolf optimizer",
        update="wolves:gwo",
        paper=f"Mirjalili, Mirjalili, Lewis 2014; as in {_SSGWO_PAPER}",
        equations="1-12",
        population=30,
        iterations=500,
        defaults=_set(origin=0.0),
        least_population=3,
    ),
    OptimiserEntry(
        name="mgwo",
        summary="grey wolves with weights and greedy moves (our reading)",
        update="wolves:mgwo",
        paper=f"Zhang 2021, of which {_SSGWO_PAPER} names three parts",
        equations="none printed",
        population=30,
        iterations=500,
        defaults=_set(origin=0.0),
        least_population=3,
    ),
    OptimiserEntry(
        name="igwo",
        summary="grey wolves that learn from neighbours",
        update="wolves:igwo",
        paper=f"Nadimi-Shahraki, Taghian, Mirjalili 2021; named in {_SSGWO_PAPER}",
        equations="Nadimi-Shahraki 10-13",
        population=30,
        iterations=500,
        evaluations_per_iteration="2P",
        defaults=_set(origin=0.0),
        least_population=3,
    ),
    OptimiserEntry(
        name="sogwo",
        summary="grey wolves with selective opposition",
        update="wolves:sogwo",
        paper=f"Dhargupta et al. 2020; named in {_SSGWO_PAPER}",
        equations="Dhargupta's Spearman rule",
        population=30,
        iterations=500,
        defaults=_set(origin=0.0, alike="ranks", span=1.0),
        least_population=3,
    ),
    OptimiserEntry(
        name="ssgwo",
        summary="grey wolves with relative distances and simulated annealing",
        update="wolves:ssgwo",
        paper=_SSGWO_PAPER,
        equations="9-11, 13-25",
        population=30,
        iterations=500,
        defaults=_set(origin=0.0, factor="cosine", leaders="all", trial="every"),
        least_population=5,
    ),
    OptimiserEntry(
        name="ssgwo-printed",
        summary="SSGWO as its equations 13 and 17-23 are printed, for all wolves",
        update="wolves:ssgwo",
        paper=_SSGWO_PAPER,
        equations="13-25",
        population=30,
        iterations=500,
        defaults=_set(origin=0.0, factor="printed", leaders="printed", trial="every"),
        least_population=5,
    ),
    OptimiserEntry(
        name="foa",
        summary="fruit fly optimization, one swarm",
        update="fruit_flies:foa",
        paper=f"Pan 2012; as in {_MSFOA_PAPER}",
        equations="1-6, without 3",
        population=100,
        iterations=200,
        defaults=_set(step=0.3),
    ),
    OptimiserEntry(
        name="mfoa",
        summary="fruit flies in several swarms of a shrinking radius",
        update="fruit_flies:mfoa",
        paper=f"Yuan et al. 2014; named in {_MSFOA_PAPER}",
        equations="none printed",
        population=100,
        iterations=200,
        evaluations_per_iteration="P + 1",
        defaults=_set(swarms=5, power=6.0, radius=0.5),
    ),
    OptimiserEntry(
        name="iffo",
        summary="fruit flies that change one dimension at a time",
        update="fruit_flies:iffo",
        paper=f"Pan, Sang, Duan, Gao 2014; named in {_MSFOA_PAPER}",
        equations="none printed",
        population=100,
        iterations=200,
        defaults=_set(radius_most=0.5, radius_least=0.01),
    ),
    OptimiserEntry(
        name="msfoa",
        summary="fruit flies in several swarms, global and local search, competing offspring",
        update="fruit_flies:msfoa",
        paper=_MSFOA_PAPER,
        equations="7-19",
        population=100,
        iterations=200,
        evaluations_per_iteration="2P",
        defaults=_set(
            swarms=5, own_share=0.2, global_step=0.3, local_step=0.05, threshold=None, beyond="clipped", origin=0.0
        ),
    ),
    OptimiserEntry(
        name="pso",
        summary="particle swarm, inertia falling, synchronous",
        update="classics:pso",
        paper=f"Shi, Eberhart 1998; set as in {_MSFOA_PAPER}",
        equations="table 1",
        population=100,
        iterations=200,
        defaults=_set(inertia_first=0.9, inertia_last=0.4, own_pull=2.0, swarm_pull=2.0, top_speed=0.2),
    ),
    OptimiserEntry(
        name="de",
        summary="differential evolution rand/1/bin, a scale factor for each individual",
        update="classics:de",
        paper=f"Storn, Price 1997; set as in {_MSFOA_PAPER}",
        equations="table 1",
        population=100,
        iterations=200,
        defaults=_set(scale_least=0.2, scale_most=0.9, crossover=0.9),
        least_population=4,
    ),
    OptimiserEntry(
        name="lshade",
        summary="differential evolution with learnt settings and a shrinking population",
        update="classics:lshade",
        paper="Tanabe, Fukunaga 2014, CEC, 1658-1665",
        equations="algorithms 1, 2",
        population=100,
        iterations=400,
        evaluations_per_iteration="P, falling to 4",
        defaults=_set(memory=6, archive_share=2.6, best_share=0.11, least=4),
        least_population=4,
    ),
    OptimiserEntry(
        name="po",
        summary="parrot optimizer: budgerigars with α = β = 1",
        update="budgerigars:abo",
        paper=f"Lian et al. 2024; as in {_ABO_PAPER}",
        equations="8-13, α = β = 1",
        population=200,
        iterations=100,
        defaults=_set(alpha=1.0, beta=1.0, origin=0.0, stay_step=0.01, talk="added", rule="equations", span=100.0),
    ),
    OptimiserEntry(
        name="abo",
        summary="adaptive budgerigars; the paper's own best choice, α = β = 1, is the parrot optimizer",
        update="budgerigars:abo",
        paper=_ABO_PAPER,
        equations="8-13",
        population=200,
        iterations=100,
        defaults=_set(alpha=1.0, beta=1.0, origin=0.0, stay_step=0.01, talk="added", rule="equations", span=100.0),
    ),
)

ADDED_POPULATION, ADDED_ITERATIONS = 50, 400
"""Population and iterations of an optimiser that was added, unless a benchmark sets its own."""

OPTIMISERS: Mapping[str, OptimiserEntry] = MappingProxyType({entry.name: entry for entry in _OPTIMISERS})


def names() -> tuple[str, ...]:
    """Names of all optimisers, family by family."""
    return tuple(OPTIMISERS)


def added_code(name: str) -> str:
    """Digest of the file of an optimiser that was added; empty for gcsplan's own. Raises InputError as `get` does."""
    if name in OPTIMISERS:
        return ""
    file = inspect.getsourcefile(get(name).rule())
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()[:16] if file else ""


def get(name: str) -> OptimiserEntry:
    """The optimiser called ``name``, or at ``MODULE:FUNCTION``.

    Raises InputError if it is unknown, with the closest known name.
    """
    entry = OPTIMISERS.get(name)
    if entry is not None:
        return entry
    added = function_at(name, "optimiser") if ":" in name else OPTIMISERS_ADDED.get(name)
    if added is None:
        raise unknown_name(f"there is no optimiser {name!r}", name, (*OPTIMISERS, *OPTIMISERS_ADDED.names()))
    words = (inspect.getdoc(added) or "").partition("\n")[0]
    return OptimiserEntry(name, words, added, "", "", population=ADDED_POPULATION, iterations=ADDED_ITERATIONS)
