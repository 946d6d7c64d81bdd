"""A run of the benchmark: what it refuses, and what it has written when it is interrupted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gcsplan.bench.terrain import ours as terrain_ours
from gcsplan.bench.terrain import run as terrain
from gcsplan.bench.terrain.outcome import MethodOutcome
from gcsplan.bench.terrain.problems import NamedProblem, key_of
from gcsplan.errors import InputError
from tests.bench.terrain.made import several


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

    monkeypatch.setattr(terrain_ours, "measure", measure)
    monkeypatch.setattr(terrain_ours, "Sweep", lambda: None)
    monkeypatch.setattr(terrain_ours, "warm_up", lambda named, planner: 0.0)
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
        ({"kinds": ["mian"]}, "main, energy, band, large, many, turn, everyday, room, given 'mian'"),
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
