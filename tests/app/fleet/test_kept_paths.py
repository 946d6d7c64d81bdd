"""A session whose arrival alone changes searches no path anew, and plans what a new session would."""

from __future__ import annotations

from typing import Any

import pytest

from gcsplan.app.fleet.kept_paths import KeptPaths
from gcsplan.app.fleet.pipeline import plan_again
from gcsplan.app.parallel.sites import world_of
from gcsplan.app.plan.model import PlanOptions
from gcsplan.app.session import BetterPath, Planner
from gcsplan.errors import Cancelled
from gcsplan.mission_file import load_mission
from tests.export.test_output_schema import FLAT

PAIR: dict[str, Any] = {
    **FLAT,
    "vehicles": [FLAT["vehicles"][0] | {"name": name, "sysid": k, "start": {"east_m": 0, "north_m": 90 * k},
                                        "goal": {"east_m": 700, "north_m": 90 * k}}
                 for k, name in ((1, "a"), (2, "b"))],
    "arrival": {"mode": "sequence", "interval_s": 20, "separation_m": 30},
}  # fmt: skip


@pytest.mark.slow
def test_another_arrival_needs_no_search_and_gives_the_same_missions() -> None:
    session = Planner(PAIR)
    heard: list[str] = []
    session.plan(on_path=lambda better: heard.append(better.vehicle))
    assert set(heard) == {"a", "b"}
    heard.clear()
    session.change({"arrival.order": ["b", "a"], "arrival.interval_s": 35})
    again = session.plan(on_path=lambda better: heard.append(better.vehicle))
    anew = Planner(session.mission).plan()
    assert heard == []
    assert again.fleet is not None
    assert again.fleet.order == ("b", "a")
    assert [v.mission.wire_items() for v in again.vehicles] == [v.mission.wire_items() for v in anew.vehicles]
    session.change({"limits.min_agl_m": 41})
    session.plan(on_path=lambda better: heard.append(better.vehicle))
    assert set(heard) == {"a", "b"}


def test_another_objective_or_a_vehicle_left_out_before_is_searched_anew() -> None:
    kept, source = KeptPaths(), load_mission(PAIR)
    heard: list[str] = []

    def plans(objective: str | None = None) -> list[str]:
        heard.clear()
        plan_again(source, world_of(source), PlanOptions(objective=objective), kept, lambda name, _: heard.append(name))
        return sorted(set(heard) - {""})

    assert plans() == ["a", "b"]
    assert plans() == []
    assert plans("energy") == ["a", "b"]


def test_a_vehicle_alone_is_planned_without_a_time_table() -> None:
    session = Planner(PAIR)
    only = session.plan(alone="b")
    assert [v.name for v in only.vehicles] == ["b"]
    assert [v.name for v in session.plan().vehicles] == ["a", "b"]


def test_a_moved_start_is_planned_alone_and_a_cancelled_plan_leaves_what_it_found() -> None:
    def flown(name: str, sysid: int, north_m: int, east_m: int = 700) -> dict[str, Any]:
        ends = {"start": {"east_m": 0, "north_m": north_m}, "goal": {"east_m": east_m, "north_m": north_m}}
        return {**PAIR["vehicles"][0], "name": name, "sysid": sysid, **ends}

    inner = [flown("v3", 3, 270, 600), flown("v4", 4, 360, 600)]
    outer = flown("c", 9, 500)  # the window stays, for the outer ones stay
    session = Planner(PAIR | {"vehicles": [*PAIR["vehicles"], *inner, outer]})
    heard: list[str] = []

    def hear(better: BetterPath) -> None:
        heard.append(better.vehicle)
        if better.vehicle == "v4" and len(set(heard)) == 4:
            session.cancel()

    with pytest.raises(Cancelled):
        session.plan(on_path=hear)
    heard.clear()
    session.plan(on_path=lambda better: heard.append(better.vehicle))
    assert not {"a", "b", "v3"} & set(heard)
    heard.clear()
    session.change({"vehicles.v3.start": {"east_m": 20, "north_m": 280}})
    again = session.plan(on_path=lambda better: heard.append(better.vehicle))
    assert set(heard) == {"v3"}
    anew = Planner(session.mission).plan()
    assert [v.mission.wire_items() for v in again.vehicles] == [v.mission.wire_items() for v in anew.vehicles]
