"""A session whose arrival alone changes searches no path anew, and plans what a new session would."""

from __future__ import annotations

from typing import Any

import pytest

from gcsplan.app.fleet.kept_paths import KeptPaths
from gcsplan.app.fleet.pipeline import plan_again
from gcsplan.app.output.files import outputs_of
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


@pytest.mark.slow
def test_missions_that_stay_are_not_judged_again_and_changes_of_the_world_are() -> None:
    session = Planner(PAIR | {"wind": {"up_to_m_s": 3}})
    first = session.plan()
    session.change({"arrival.interval_s": 35})
    again = session.plan()
    # The second flies slower.
    assert [a.verdict is b.verdict for a, b in zip(first.vehicles, again.vehicles, strict=True)] == [True, False]
    assert [slot.arrive_s for slot in first.fleet.slots] != [slot.arrive_s for slot in again.fleet.slots]  # type: ignore[union-attr]
    for change in ({"wind.up_to_m_s": 3.5}, {"vehicles.a.energy": {"battery_j": 1e6}, "vehicles.b.end": "none"},
                   {"no_fly": [{"name": "z", "center": {"east_m": 350, "north_m": 900}, "radius_m": 50}]},
                   {"terrain": {"flat_m": 120}}):  # fmt: skip
        session.change(change)
        other, anew = session.plan(), Planner(session.mission).plan()
        assert not {id(v.verdict) for v in first.vehicles} & {id(v.verdict) for v in other.vehicles}
        assert outputs_of(other) == outputs_of(anew)
        first = other


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
