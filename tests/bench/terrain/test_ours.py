"""gcsplan's planner on a problem: every answer is an outcome, judged by the exact check."""

from __future__ import annotations

import pytest

from gcsplan.bench.terrain import ours as terrain_ours
from gcsplan.bench.terrain.outcome import OUR_METHOD
from gcsplan.bench.terrain.problems import NamedProblem
from gcsplan.errors import NoMission
from tests.bench.terrain.made import Fake, easy

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (None, "solved"),
        (NoMission("no way", reason="infeasible"), "infeasible"),
        (NoMission("no way seen", reason="not_found"), "not found"),
        (ZeroDivisionError("a bug"), "failed"),
    ],
)
def test_every_answer_of_ours_is_an_outcome(
    main: list[NamedProblem], monkeypatch: pytest.MonkeyPatch, error: Exception | None, status: str
) -> None:
    fake = Fake(error)
    monkeypatch.setattr(terrain_ours, "get_planner", lambda name: fake)
    one = easy(main)
    outcome = terrain_ours.measure(one, lambda: 0.01, runs=3)  # type: ignore[arg-type]
    assert (outcome.status, outcome.method, outcome.runs, outcome.sweep_s) == (status, OUR_METHOD, 3, 0.01)
    assert len(fake.airspaces) == 3
    assert id(one.problem.airspace) not in fake.airspaces
    if error is None:
        assert outcome.gap_percent == pytest.approx(100.0)
        assert outcome.first_path_s == 0.1
    else:
        assert str(error) in outcome.detail


def test_a_path_that_the_exact_check_rejects_is_unsafe_whatever_its_planner_says(
    main: list[NamedProblem], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(terrain_ours, "get_planner", lambda name: Fake())
    assert terrain_ours.measure(main[8], lambda: 0.01, runs=1).status == "unsafe"  # type: ignore[arg-type]
