"""The loop that plans a vehicle again, with larger margins, until its mission passes: one for all aircraft."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import VehiclePlan
from gcsplan.app.plan.replanning import Attempts, replanned
from gcsplan.errors import NoMission
from gcsplan.mavlink.build.order import MARGINS, Margins
from gcsplan.mission_file import load_mission
from gcsplan.notes.note import Finding, Note
from gcsplan.planners.problem import Problem
from tests.support.paths import MISSIONS

FLAT = """
version: 1
terrain: {flat_m: 0}
limits: {min_agl_m: 30}
vehicles:
  - {name: a, sysid: 1, autopilot: arducopter, start: [36.3, -84.2], goal: [36.3, -84.195]}
"""

NOTED = (Note("flown_as_quadplane"),)


@pytest.fixture(scope="module")
def passed() -> VehiclePlan:
    [found] = plan(load_mission(MISSIONS / "m.yaml", text=FLAT)).vehicles
    return replace(found, notes=())


def low_by(found: VehiclePlan, by_m: float, kind: str = "min_agl") -> VehiclePlan:
    """The plan with a finding at its first way point."""
    seq = next(i for i, item in enumerate(found.mission.items) if item.command == 16) + found.mission.first_seq
    finding = Finding(seq, kind, Note("landing_without_place", seq), 36.3, -84.2, 0.0, 0.0, 30.0, by_m, "m")
    return replace(found, verdict=replace(found.verdict, findings=(finding,)))


class Tried:
    """Attempts whose results are given; it keeps the margins and the problems that it was asked with."""

    def __init__(self, problem: Problem, *results: Callable[[], VehiclePlan]) -> None:
        self.problem, self.results = problem, list(results)
        self.margins: list[Margins] = []
        self.flown: list[Problem] = []

    def problem_of(self, margins: Margins) -> tuple[Problem, tuple[Note, ...]]:
        self.margins.append(margins)
        return self.problem, NOTED

    def fly(self, problem: Problem) -> VehiclePlan:
        self.flown.append(problem)
        return self.results.pop(0)()

    def end(self, most: int = 5) -> VehiclePlan:
        return replanned(Attempts(most, MARGINS, self.fly), self.problem_of)


def refuse() -> VehiclePlan:
    raise NoMission("margins shut the way", reason="not_found")


def test_the_first_mission_that_passes_is_taken_with_the_notes_on_its_problem(passed: VehiclePlan) -> None:
    tried = Tried(passed.problem, lambda: passed)
    found = tried.end()
    assert (found.notes, found.solution) == (NOTED, passed.solution)
    assert tried.margins == [MARGINS]


def test_margins_grow_by_what_was_lacking_and_work_halves_until_a_mission_passes(passed: VehiclePlan) -> None:
    tried = Tried(passed.problem, lambda: low_by(passed, 1.0), lambda: low_by(passed, 2.0), lambda: passed)
    found = tried.end()
    assert [m.altitude_m for m in tried.margins] == pytest.approx([0.02, 1.09, 3.21])
    assert [p.budget_s / passed.problem.budget_s for p in tried.flown] == [1.0, 0.5, 0.25]
    assert Note("planned_again", times=3) in found.solution.notes
    assert found.solution.planning_s == pytest.approx(3 * passed.solution.planning_s)


def test_what_the_last_mission_breaks_is_said_where_all_break_something(passed: VehiclePlan) -> None:
    tried = Tried(passed.problem, lambda: low_by(passed, 1.0), lambda: low_by(passed, 2.0), lambda: passed)
    with pytest.raises(NoMission, match="the mission as arducopter flies it breaks limits"):
        tried.end(most=2)
    assert len(tried.results) == 1


def test_no_margins_cure_a_battery(passed: VehiclePlan) -> None:
    tried = Tried(passed.problem, lambda: low_by(passed, 1.0, "battery"), lambda: passed)
    with pytest.raises(NoMission) as caught:
        tried.end()
    assert (caught.value.reason, len(tried.results)) == ("battery", 1)


def test_a_refusal_counts_only_if_no_mission_was_found_before(passed: VehiclePlan) -> None:
    with pytest.raises(NoMission, match="margins shut the way"):
        Tried(passed.problem, refuse).end()
    with pytest.raises(NoMission, match="a path was found, but the mission"):
        Tried(passed.problem, lambda: low_by(passed, 1.0), refuse).end()


def test_a_problem_that_larger_margins_forbid_counts_like_a_path_that_is_not_found(passed: VehiclePlan) -> None:
    class Forbidden(Tried):
        def problem_of(self, margins: Margins) -> tuple[Problem, tuple[Note, ...]]:
            return super().problem_of(margins) if margins == MARGINS else (refuse().problem, ())

    with pytest.raises(NoMission, match="a path was found, but the mission"):
        Forbidden(passed.problem, lambda: low_by(passed, 1.0)).end()
