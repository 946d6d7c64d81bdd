"""A plan between processes, and what may be asked for in place of a mission file's own keys."""

from __future__ import annotations

import pickle
from dataclasses import asdict, replace
from inspect import signature

import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import PlanOptions
from gcsplan.mission_file import load_mission
from tests.support.paths import MISSIONS


@pytest.mark.slow
def test_a_packed_plan_holds_no_terrain_and_is_restored_as_it_was() -> None:
    [made] = plan(load_mission(MISSIONS / "jacksboro.yaml")).vehicles
    assert made.brief is not None
    sent = pickle.dumps(made.packed())
    assert len(sent) < 100_000
    packed = pickle.loads(sent)
    assert packed.brief is None
    assert packed.problem.airspace is None
    assert packed.problem.widen is None
    found = packed.restored(made.brief)
    assert found.brief is made.brief
    assert found.problem.airspace is made.brief.world.airspace
    assert found.verdict.describe() == made.verdict.describe()
    assert found.mission == made.mission
    assert found.notes == made.notes
    assert found.order == made.order
    assert found.solution.lower_bound == made.solution.lower_bound
    assert replace(found.problem, airspace=made.problem.airspace).start == made.problem.start


def test_what_may_be_asked_for_are_arguments_of_plan_and_nothing_is_asked_by_itself() -> None:
    asked = asdict(PlanOptions())
    accepted = signature(plan).parameters
    assert set(asked) <= set(accepted)
    assert {name: value or None for name, value in asked.items()} == {name: accepted[name].default for name in asked}
