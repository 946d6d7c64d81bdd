"""All runs of a call: they resume, and processes and a cluster give the same numbers."""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.app.parallel import executor
from gcsplan.errors import InputError
from gcsplan.research.bench.papers import runs as papers_runs
from gcsplan.research.bench.papers.judge import TOO_FEW_RUNS
from gcsplan.research.bench.papers.run import PAPER_RUNS_FILE, run
from gcsplan.research.bench.papers.runs import Store, work
from tests.research.bench.papers.made import PAIR, SCENARIO, same_numbers


def test_a_run_is_what_its_search_gives(finished: tuple[dict[str, Any], Path]) -> None:
    result, _ = finished
    summary = result["scenarios"][0]
    assert summary["straight_m"] == pytest.approx(math.dist((0, 0, 0), (800, 800, 15)), rel=1e-9)
    assert summary["bound_m"] >= summary["straight_m"] - 1e-6
    for name in PAIR:
        one, two = summary["records"][name]
        assert one["cost"] != two["cost"]
        for record in (one, two):
            assert record["length_m"] >= summary["straight_m"]
            assert record["evaluations"] == 9 * 16
            history = record["history"]
            assert history["iterations"][-1] == 15
            assert history["evaluations"][-1] == record["evaluations"]
            assert history["cost"][-1] == pytest.approx(record["cost"])
            path = np.array(record["paths"][0])
            assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == pytest.approx(record["length_m"], rel=1e-3)
    assert {c["twin_ranking"] for c in result["claims"]} == {TOO_FEW_RUNS}
    assert len(result["claims"]) == 4  # those on length, collisions, pitch and yaw of these two


@pytest.mark.slow
def test_what_is_finished_is_not_run_again(
    finished: tuple[dict[str, Any], Path], missions: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result, out = finished
    calls: list[str] = []
    monkeypatch.setattr(papers_runs, "work", lambda job: calls.append(job.algorithm) or work(job))
    kept = (out / PAPER_RUNS_FILE).read_bytes()
    (tmp_path / PAPER_RUNS_FILE).write_bytes(kept[:-30])  # the last run was being written when the power failed
    last = json.loads(kept.splitlines()[-1])
    told: list[tuple[int, int]] = []
    again = run([SCENARIO], PAIR, 2, jobs=1, out=tmp_path, missions=missions, done=lambda k, n: told.append((k, n)))
    assert calls == [last["algorithm"]]
    assert told == [(4, 5), (5, 5)]
    assert same_numbers(again) == same_numbers(result)
    # One more run of each; those that are there stay.
    run([SCENARIO], PAIR, 3, jobs=1, out=tmp_path, missions=missions)
    assert calls[1:] == list(PAIR)
    # Another seed or another mission is another experiment.
    run([SCENARIO], ["gwo"], 1, 2, jobs=1, out=tmp_path, missions=missions)
    assert calls[3:] == ["gwo"]
    text = (missions / f"{SCENARIO}.yaml").read_text(encoding="utf-8")
    (tmp_path / f"{SCENARIO}.yaml").write_text(text.replace("radius_m: 60", "radius_m: 61"), encoding="utf-8")
    run([SCENARIO], ["gwo"], 1, jobs=1, out=tmp_path, missions=tmp_path)
    assert calls[4:] == ["optimal", "gwo"]


@pytest.mark.nightly
def test_ctrl_c_loses_nothing_that_is_finished_and_processes_give_the_same_numbers(
    finished: tuple[dict[str, Any], Path], missions: Path, tmp_path: Path
) -> None:
    def interrupt(there: int, _: int) -> None:
        if there == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run([SCENARIO], PAIR, 2, jobs=2, out=tmp_path, missions=missions, done=interrupt)
    kept = Store(tmp_path / PAPER_RUNS_FILE).load()
    assert 1 <= len(kept) <= 5
    told: list[int] = []
    again = run([SCENARIO], PAIR, 2, jobs=1, out=tmp_path, missions=missions, done=lambda k, n: told.append(k))
    assert told == list(range(len(kept), 6))
    assert same_numbers(again) == same_numbers(finished[0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"runs": 0}, "1 to 10000 runs"),
        ({"jobs": 0}, "1 job or more"),
        ({"seed": -1}, "a seed of 0 or more, not 1, 1 and -1"),
        ({"scenarios": []}, "no scenario is given; known: krill-mound"),
        ({"algorithms": ["pso"]}, "there is no algorithm 'pso' here"),
    ],
)
def test_what_cannot_be_run_is_refused_before_anything_is_made(
    change: dict[str, Any], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message):
        run(**{"scenarios": [SCENARIO], "runs": 1, "jobs": 1, "out": tmp_path / "out", **change})
    assert not (tmp_path / "out").exists()


def test_a_cluster_without_its_extra_names_the_extra(missions: Path, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=re.escape("pip install 'gcsplan[cluster]'")):
        run([SCENARIO], PAIR, 1, out=tmp_path, missions=missions, cluster="tcp://127.0.0.1:1")


@pytest.mark.slow
def test_a_cluster_gives_the_same_numbers(
    finished: tuple[dict[str, Any], Path], missions: Path, tmp_path: Path, monkeypatch: Any
) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(executor, "ANSWER_S", 0.5)
    with pytest.raises(InputError, match="no dask scheduler answers"):
        run([SCENARIO], PAIR, 1, out=tmp_path, missions=missions, cluster="tcp://127.0.0.1:1")
    monkeypatch.undo()
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp",
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    ) as cluster:
        again = run([SCENARIO], PAIR, 2, out=tmp_path, missions=missions, cluster=cluster.scheduler_address)
    assert same_numbers(again) == same_numbers(finished[0])
    assert len(Store(tmp_path / PAPER_RUNS_FILE).load()) == 5
