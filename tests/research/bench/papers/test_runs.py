"""One run, what makes it old, and the file that keeps it."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from gcsplan.errors import InputError
from gcsplan.research.bench.papers import runs as papers_runs
from gcsplan.research.bench.papers.runs import PaperRun, Store, code_digest, seed_of, work
from gcsplan.research.bench.papers.scenarios import mission_text
from tests.research.bench.papers.made import SCENARIO, record

ROOT = Path(papers_runs.__file__).parents[3]


def _counted() -> set[Path]:
    return {file for pattern in papers_runs.CODE for file in ROOT.glob(pattern)}


@pytest.mark.parametrize("package", ["planners", "research/optimisers", "research/swarm", "world"])
def test_a_change_of_any_planner_makes_kept_runs_old(package: str) -> None:
    assert set((ROOT / package).rglob("*.py")) <= _counted()


@pytest.mark.parametrize("pattern", papers_runs.CODE)
def test_every_file_that_makes_kept_runs_old_is_there(pattern: str) -> None:
    assert list(ROOT.glob(pattern))


@pytest.mark.slow
def test_a_change_of_anything_that_a_run_calls_makes_kept_runs_old(
    finished: tuple[dict[str, Any], Path], missions: Path
) -> None:
    called: set[Path] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_flags & inspect.CO_OPTIMIZED:  # no body of a module or class
            called.add(Path(frame.f_code.co_filename))

    text = (missions / f"{SCENARIO}.yaml").read_text(encoding="utf-8")
    job = PaperRun(SCENARIO, "gwo", text, 1, 0, code_digest())
    before = sys.getprofile()
    sys.setprofile(note)  # `finished` has imported and warmed everything, so this sees the run alone
    try:
        work(job)
    finally:
        sys.setprofile(before)
    ours = {file for file in called if file.is_relative_to(ROOT)}
    assert ROOT / "research" / "optimisers" / "wolves.py" in ours
    assert ours <= _counted()


def test_a_line_cut_short_is_passed_over_and_the_next_begins_a_line(tmp_path: Path) -> None:
    store = Store(tmp_path / "runs.jsonl")
    assert store.load() == {}
    some = [record("gwo", k, 1000.0 + k) for k in range(3)]
    store.append(some[0])
    store.append(some[1])
    whole = store.path.read_bytes()
    for cut in (1, 40, len(whole) // 2 - 1):
        store.path.write_bytes(whole[:-cut])
        there = store.load()
        assert len(there) == (2 if cut == 1 else 1)
        store.append(some[2])
        assert [r["number"] for r in store.load().values()] == [*(r["number"] for r in there.values()), 2]
    store.path.write_bytes(b'[1]\n{"scenario": 1}\n\xff\n' + whole)
    assert len(store.load()) == 2
    with pytest.raises(InputError, match="cannot be written"):
        Store(tmp_path / "none" / "runs.jsonl").append(some[0])


def test_seeds_differ_by_run_and_vehicle_only() -> None:
    seeds = {seed_of(s, number, vehicle) for s in (1, 2) for number in range(10) for vehicle in range(4)}
    assert len(seeds) == 80


def test_a_worker_of_another_version_refuses() -> None:
    with pytest.raises(InputError, match="another version"):
        work(PaperRun(SCENARIO, "gwo", mission_text(SCENARIO), 1, 0, "0" * 16))
