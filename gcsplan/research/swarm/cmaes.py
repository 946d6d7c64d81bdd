"""CMA-ES of the package ``cma`` (Hansen's own), as an update rule of our driver; the extra ``bench`` brings it.

All randomness comes from the run, so the same arguments give the same bytes.
"""

from __future__ import annotations

import math
from importlib import import_module
from types import MappingProxyType
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.research.optimisers.box import Run, Steps, clipped
from gcsplan.research.optimisers.registry import OptimiserEntry

DOUBLINGS = 5
"""Most times that a restart doubles the population."""


def cmaes(run: Run, *, step: float, step_given: float) -> Steps:
    """CMA-ES with restarts of twice the population (IPOP: Auger, Hansen 2005), kept in the box by cma's own transform.

    ``step``: first step size; it begins in the middle of the box. If the run is given start points, it begins at the
    first of them, with ``step_given``. A restart begins at a random place with ``step``.
    """
    try:
        cma = import_module("cma")
    except ImportError:
        raise InputError("CMA-ES needs the package cma, which is not installed: pip install 'gcsplan[bench]'") from None
    given = len(run.start) > 0
    mean = run.start[0].copy() if given else np.full(run.dim, 0.5)
    search = _search(cma, run, mean, step_given if given else step, run.population)
    x = _drawn(search)
    search.tell(x, list((yield x)))
    doubled = 0
    for _ in run.cycles():
        if search.stop():
            doubled = min(doubled + 1, DOUBLINGS)
            search = _search(cma, run, run.rng.random(run.dim), step, run.population << doubled)
        x = _drawn(search)
        search.tell(x, list((yield x)))


def _search(cma: Any, run: Run, mean: Floats, step: float, population: int) -> Any:
    return cma.CMAEvolutionStrategy(
        mean, step,
        {"popsize": population, "bounds": [0.0, 1.0], "seed": math.nan, "verbose": -9, "verb_log": 0,
         "randn": lambda *shape: run.rng.standard_normal(shape)},
    )  # fmt: skip


def _drawn(search: Any) -> Floats:
    return clipped(np.array(search.ask(), dtype=np.float64))


ENTRY = OptimiserEntry(
    name="cmaes",
    summary="CMA-ES with restarts of twice the population, by the package cma",
    update="gcsplan.research.swarm.cmaes:cmaes",
    paper="Hansen, Ostermeier 2001; Auger, Hansen 2005; package cma",
    equations="by the package",
    population=30,
    iterations=500,
    defaults=MappingProxyType({"step": 0.3, "step_given": 0.05}),
    least_population=3,
)
"""The optimiser's row: beside the table of `gcsplan.research.optimisers`, which uses numpy alone."""
