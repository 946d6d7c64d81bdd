"""One vehicle's plan, or why there is none and what would help, found with whole missions."""

from __future__ import annotations

from typing import Any

import pytest

from gcsplan.app.fleet.explain import plan_or_explain
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import Brief
from gcsplan.errors import NoMission
from gcsplan.mission_file import load_mission
from tests.support.batches import mission

CEILING = {"name": "lid", "center": [47.0, 8.01], "radius_m": 5000, "floor_agl_m": 50}


def brief_of(**changes: Any) -> Brief:
    """The brief of a mission that can be planned, over the world of the changed one."""
    [done] = plan(load_mission(text=mission())).vehicles
    assert done.brief is not None
    source = load_mission(text=mission(**changes))
    from gcsplan.app.parallel.sites import world_of

    return done.brief.over(source, world_of(source))


def test_a_mission_that_can_be_flown_is_planned() -> None:
    brief = brief_of()
    [request] = brief.source.vehicles
    made = plan_or_explain(brief, request)
    assert made.verdict.safe is True
    assert made.name == "uav1"


def test_a_refusal_names_a_change_with_which_a_whole_mission_was_planned() -> None:
    brief = brief_of(limits={"min_agl_m": 60}, no_fly=[CEILING])
    [request] = brief.source.vehicles
    with pytest.raises(NoMission) as refused:
        plan_or_explain(brief, request)
    said = str(refused.value)
    assert "uav1" in said
    assert "min_agl_m" in said or "lid" in said
