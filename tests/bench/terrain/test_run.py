"""A run of the benchmark: what it refuses, what an interrupted one has written; every answer of ours is an outcome."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gcsplan.bench.terrain import run as terrain
from gcsplan.bench.terrain.outcome import OUR_METHOD, MethodOutcome
from gcsplan.bench.terrain.problems import NamedProblem, key_of
from gcsplan.errors import InputError, NoMission
from tests.bench.terrain.made import Fake, easy, several


@pytest.mark.slow
def test_the_report_is_written_whole_even_when_the_run_is_interrupted(
    main: list[NamedProblem], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[str] = []
    gaps: list[float] = []

    def measure(one: NamedProblem, sweep: object, **more: object) -> MethodOutcome:
        asked.append(one.name)
        gaps.append(one.problem.gap_percent)
        if len(asked) > 2:
            raise KeyboardInterrupt
        found = replace(several()[len(asked) - 1], key=key_of(one.problem), name=one.name, group=one.group)
        return replace(found, gap_asked_percent=one.problem.gap_percent)

    monkeypatch.setattr(terrain, "measure", measure)
    monkeypatch.setattr(terrain, "Sweep", lambda: None)
    monkeypatch.setattr(terrain, "warm_up", lambda named, planner: 0.0)
    said: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        terrain.run(tmp_path, kinds=["main"], runs=1, count=1, rivals=False, tell=said.append)
    assert [f"gcsplan: {name}" for name in asked] == said[2:]
    assert (tmp_path / "terrain.png").read_bytes().startswith(b"\x89PNG")
    rows = (tmp_path / "terrain.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 3
    assert set(gaps) == {terrain.GAP_PERCENT}
    assert "certified gap of 0.1 % (gcsplan)" in (tmp_path / "terrain.md").read_text(encoding="utf-8")
    assert rows[0].startswith("key,name,kind,group,method,status")
    assert asked[1].split(",")[0] in rows[2]
    assert "| 0 zones | gcsplan | 1/1 |" in (tmp_path / "terrain.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"kinds": ["mian"]}, "main, energy, band, large, many, turn, everyday, ceiling, room, time, given 'mian'"),
        ({"runs": 0}, "runs and count must be 1 or more"),
        ({"count": 0}, "runs and count must be 1 or more"),
        ({"seconds": [0.0]}, "seconds more than 0"),
        ({"gap_percent": -1.0}, "gap_percent must be 0 or more, given -1"),
    ],
)
def test_wrong_orders_are_refused_before_anything_is_done(
    wrong: dict[str, object], message: str, tmp_path: Path
) -> None:
    told: list[str] = []
    with pytest.raises(InputError, match=message):
        terrain.run(tmp_path, **wrong, tell=told.append)  # type: ignore[arg-type]
    assert told == []
    assert list(tmp_path.iterdir()) == []


@pytest.mark.nightly_but("None-solved", "error3-failed")
@pytest.mark.slow
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
    monkeypatch.setattr(terrain, "get_planner", lambda name: fake)
    one = easy(main)
    outcome = terrain.measure(one, lambda: 0.01, runs=3)  # type: ignore[arg-type]
    assert (outcome.status, outcome.method, outcome.runs, outcome.sweep_s) == (status, OUR_METHOD, 3, 0.01)
    assert len(fake.airspaces) == 3
    assert id(one.problem.airspace) not in fake.airspaces
    if error is None:
        assert outcome.gap_percent == pytest.approx(100.0)
        assert outcome.first_path_s == 0.1
    else:
        assert str(error) in outcome.detail


@pytest.mark.slow
def test_a_path_that_the_exact_check_rejects_is_unsafe_whatever_its_planner_says(
    main: list[NamedProblem], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(terrain, "get_planner", lambda name: Fake())
    assert terrain.measure(main[8], lambda: 0.01, runs=1).status == "unsafe"  # type: ignore[arg-type]
