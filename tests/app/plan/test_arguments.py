"""Wrong types at the door of the functions for scripts: gcsplan's own errors, with place and cure."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import gcsplan
from gcsplan.errors import InputError, UsageError
from tests.support.paths import DATA


def no_planner(problem: object) -> None:
    """A function that plans nothing."""


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"planner": 7}, r"plan\(\).*planner is the name of a planner.*given int"),
        ({"seed": "1"}, "seed is a whole number; given str '1'"),
        ({"seed": True}, "seed is a whole number"),
        ({"options": 3}, "options is a mapping"),
        ({"objective": 3}, "objective is 'length', 'energy' or 'time'"),
        ({"progress": 3}, "progress is a function"),
        ({"cluster": 7}, "cluster is a dask scheduler's address or file, or a client or cluster of dask; given int 7"),
        ({"cluster": ["tcp://127.0.0.1:1"]}, "cluster is a dask scheduler's address"),
        ({"gate_utc": "18:30"}, "gate_utc is a datetime"),
    ],
)
def test_plan_refuses_arguments_of_another_type(given: dict[str, Any], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        gcsplan.plan(DATA / "crossing.yaml", **given)


def test_a_function_that_plans_nothing_is_refused_by_its_name() -> None:
    with pytest.raises(InputError, match="planner no_planner: a planner returns a Solution, given NoneType"):
        gcsplan.plan(DATA / "crossing.yaml", planner=no_planner)  # type: ignore[arg-type]


@pytest.mark.parametrize("function", ["write", "report", "rehearse", "upload", "check"])
def test_a_plan_is_a_plan(function: str) -> None:
    arguments: tuple[Any, ...] = (5, "folder") if function == "write" else (5,)
    with pytest.raises(UsageError, match=rf"{function}\(\).* is .*plan.*; given int 5"):
        getattr(gcsplan, function)(*arguments)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"points": math.nan}, r"options\.points.*given nan"),
        ({"iterations": 10**12}, r"options\.iterations.*10 ?000 ?000"),
        ({"population": True}, r"options\.population"),
        ({"encoding": "bokx"}, r"options\.encoding.*bspline"),
        ({"parameters": {"c1": math.inf}}, r"options\.parameters.*c1"),
        ({"point": 3}, r"options\.point.*points"),
        ({"earlier": ()}, r"options\.earlier"),
        ({3: 4}, r"a key is text.*given int 3"),
    ],
)
def test_options_of_a_script_have_the_limits_of_the_mission_file(options: Any, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        gcsplan.plan(DATA / "crossing.yaml", planner="pso", options=options)
    with pytest.raises(UsageError, match=words):
        gcsplan.Planner(DATA / "crossing.yaml", planner="pso", options=options).plan()


def test_options_may_be_numpys_and_a_script_s_own_planner_takes_any() -> None:
    given: list[Any] = []

    def seen(problem: gcsplan.Problem) -> gcsplan.Solution:
        given.append(dict(problem.options))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gcsplan.plan(DATA / "crossing.yaml", planner=seen, options={"points": np.int64(3), "mine": seen})
    assert given == [{"points": 3, "mine": seen}]


@pytest.mark.parametrize("radius_km", [math.nan, math.inf, -1.0, 0, 10**12])
def test_a_radius_of_terrain_is_positive_and_bounded(radius_km: float) -> None:
    with pytest.raises(UsageError, match="--radius-km"):
        gcsplan.fetch_dem(around="36.6, -84.3", radius_km=radius_km, offline=True)
