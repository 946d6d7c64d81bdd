"""Answers of other planners: kept on the disk, not asked for again, judged again."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from gcsplan.bench.terrain import rivals as terrain_rivals
from gcsplan.bench.terrain.problems import NamedProblem, key_of
from tests.bench.terrain.made import easy, outcome, straight

pytestmark = pytest.mark.slow


def test_answers_outlive_a_run_that_is_cut_off_in_the_middle_of_a_line(tmp_path: Path) -> None:
    file = tmp_path / "sub" / "rivals.jsonl"
    answers = terrain_rivals.Answers(file)
    answers.add(outcome("a", "OMPL RRT* 1 s", 12.5, version="ompl 2", points=[[1.0, 2.0, 3.0]]))
    with file.open("a", encoding="utf-8") as torn:
        torn.write(json.dumps(asdict(outcome("b", "OMPL RRT* 1 s", 1.0)))[:40])
    again = terrain_rivals.Answers(file)
    again.add(outcome("c", "OMPL RRT* 1 s", None, version="ompl 2"))
    last = terrain_rivals.Answers(file)
    kept = last.get("a", "OMPL RRT* 1 s", "ompl 2")
    assert kept is not None
    assert (kept.cost, kept.points) == (12.5, [[1.0, 2.0, 3.0]])
    assert last.get("b", "OMPL RRT* 1 s", "") is None
    assert last.get("c", "OMPL RRT* 1 s", "ompl 2") is not None
    assert last.get("a", "OMPL RRT* 1 s", "ompl 3") is None


def test_what_is_kept_is_not_run_again_and_is_judged_again(
    main: list[NamedProblem], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    one = easy(main)
    good, bad = terrain_rivals.rivals([1.0], swarms=False)[:2]
    monkeypatch.setattr(terrain_rivals, "release", lambda rival: "v")
    monkeypatch.setattr(terrain_rivals, "RivalProcess", None)  # nobody may be asked
    answers = terrain_rivals.Answers(tmp_path / "rivals.jsonl")
    key = key_of(one.problem)
    answers.add(outcome(key, good.method, 1.0, version="v", points=straight(one.problem).tolist()))
    answers.add(outcome(key, bad.method, 1.0, version="v", points=[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]))
    found = list(terrain_rivals.compare([one], [good, bad], answers, seed=1))
    assert [o.status for o in found] == ["solved", "unsafe"]
    more = [good, terrain_rivals.Rival("ompl", "BIT*", 3.0)]
    kept = terrain_rivals.compare([one], more, answers, seed=1, kept_only=True)
    assert [o.method for o in kept] == [good.method]


def test_rivals_are_asked_for_shortest_and_fastest_paths_without_a_turn_radius(main: list[NamedProblem]) -> None:
    one = easy(main)
    named = [
        replace(one, kind=kind, problem=replace(one.problem, objective=objective, turn_radius_m=radius_m))
        for kind in ("main", "ceiling", "time", "turn")
        for objective in ("length", "energy", "time")
        for radius_m in (0.0, 80.0)
    ]
    asked = [(p.kind, p.problem.objective, p.problem.turn_radius_m) for p in terrain_rivals.solvable(named)]
    assert asked == [(kind, goal, 0.0) for kind in ("main", "ceiling", "time") for goal in ("length", "time")]
