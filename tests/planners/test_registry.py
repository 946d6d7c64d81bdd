"""The table of planners: each row can be called, and names a source and an optimiser that exist."""

from __future__ import annotations

import inspect
from importlib import import_module
from typing import get_args

import pytest

from gcsplan.errors import InputError
from gcsplan.mission_file.values.schema import EncodingName
from gcsplan.planners import registry
from gcsplan.research import swarm
from gcsplan.research.optimisers import registry as optimisers
from gcsplan.research.swarm import SwarmEntry


def test_the_default_planner_stands_first_and_every_name_finds_its_row() -> None:
    assert registry.names()[0] == "optimal"
    assert [registry.get(name).name for name in registry.names()] == list(registry.names())


@pytest.mark.parametrize("name", registry.names())
def test_a_row_names_a_planner_that_takes_what_it_is_called_with(name: str) -> None:
    entry = registry.get(name)
    plan = import_module(entry.module).plan
    inspect.signature(plan).bind(*([None, entry] if isinstance(entry, SwarmEntry) else [None]))
    assert entry.summary
    assert bool(entry.paper) == isinstance(entry, SwarmEntry)


@pytest.mark.parametrize("name", swarm.SWARM_PLANNERS)
def test_a_swarm_has_its_optimiser_and_encodings_that_a_mission_may_ask_for(name: str) -> None:
    entry = swarm.SWARM_PLANNERS[name]
    assert name in ("aco", "cmaes") or entry.optimiser in optimisers.OPTIMISERS  # ants on a grid, and a package
    assert {entry.space["encoding"], entry.defaults["encoding"]} <= set(get_args(EncodingName))


def test_every_swarm_has_its_name_in_the_table_and_every_row_its_own_name() -> None:
    assert ("optimal", *swarm.SWARM_PLANNERS) == registry.names()
    assert all(row.name == name for name, row in swarm.SWARM_PLANNERS.items())


def test_an_unknown_name_is_refused_with_the_nearest() -> None:
    with pytest.raises(InputError, match="Did you mean 'krill'"):
        registry.get("kril")


def test_the_rows_cannot_be_changed() -> None:
    with pytest.raises(TypeError):
        registry.PLANNER_PACKAGES["mine"] = "gcsplan.planners.optimal"  # type: ignore[index]
    with pytest.raises(TypeError):
        swarm.SWARM_PLANNERS["mine"] = swarm.SWARM_PLANNERS["krill"]  # type: ignore[index]
    with pytest.raises(TypeError):
        registry.get("krill").defaults["points"] = 3  # type: ignore[index]
