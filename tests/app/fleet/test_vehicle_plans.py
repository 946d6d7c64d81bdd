"""Plans of vehicles, by an executor too: what comes back, in which order, who is left out, and what would help."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.fleet.vehicle_plans import answer_of, plan_or_explain, planned_by
from gcsplan.app.parallel.executor import Executor, Inline
from gcsplan.app.parallel.sites import site_of
from gcsplan.app.plan.left_out import LeavingOut
from gcsplan.app.plan.model import Brief
from gcsplan.errors import GcsplanError, InputError, NoMission
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


def two() -> str:
    craft = {"autopilot": "arducopter", "speed_m_s": [3, 12]}
    vehicles = [
        craft | {"name": f"uav{k}", "sysid": k, "start": [47.0, 8.0 + 0.01 * k], "goal": [47.01, 8.0 + 0.01 * k]}
        for k in (1, 2)
    ]
    return mission(vehicles=vehicles)


def brief() -> Brief:
    made = plan(load_mission(text=two())).vehicles[0].brief
    assert made is not None
    return made


class LastFirst(Executor):
    """Does the last piece first; the result of those in ``fails`` is their error."""

    count, dashboard = 2, ""

    def __init__(self, **fails: GcsplanError) -> None:
        self.fails = fails

    def each(self, function: Any, shared: Any, items: Any, **_: Any) -> Iterator[tuple[int, Any]]:
        for number in reversed(range(len(items))):
            sent = pickle.loads(pickle.dumps((function, shared, items[number])))
            yield number, self.fails.get(items[number]) or sent[0](*sent[1:])


def test_plans_come_back_in_the_order_of_the_file_over_the_callers_terrain() -> None:
    asked, seen = brief(), list[tuple[str, int]]()
    made = planned_by(LastFirst(), asked, lambda name, count: seen.append((name, count)))
    assert [v.name for v in made] == ["uav1", "uav2"]
    assert seen == [("uav2", 1), ("uav1", 2)]
    assert [v.brief.source.level if v.brief else None for v in made] == [asked.source.level] * 2
    alone = planned_by(Inline(), asked)
    assert [v.mission.items for v in made] == [v.mission.items for v in alone]


def test_the_first_refusal_in_the_file_counts_whoever_answers_first() -> None:
    both = LastFirst(uav1=NoMission("the first", reason="blocked"), uav2=NoMission("the second", reason="blocked"))
    with pytest.raises(NoMission, match="the first"):
        planned_by(both, brief())


@pytest.mark.slow
def test_who_has_no_mission_is_left_out_where_that_is_allowed_and_bad_input_never_is() -> None:
    leaving = LeavingOut(allowed=True)
    made = planned_by(LastFirst(uav1=NoMission("no way", reason="blocked")), brief(), leaving=leaving)
    assert [v.name for v in made] == ["uav2"]
    assert [left.name for left in leaving.found] == ["uav1"]
    with pytest.raises(InputError, match="other terrain"):
        planned_by(LastFirst(uav2=InputError("other terrain")), brief(), leaving=LeavingOut(allowed=True))


def test_a_worker_gives_an_error_back_instead_of_raising_it() -> None:
    asked = brief()
    site = site_of(asked.source)
    elsewhere = replace(site, key="elsewhere", inputs={**site.inputs, "zones_sha256": "0"})
    assert isinstance(answer_of((elsewhere, asked.packed()), "uav1"), InputError)
    other = answer_of((site_of(asked.source), asked.packed()), "uav2")
    assert not isinstance(other, GcsplanError)
    assert other[0].name == "uav2"
    assert other[1] == asked.source.level
