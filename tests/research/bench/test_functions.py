"""The printed table of the nine functions, and the benchmark that runs them beside it."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from gcsplan.errors import InputError
from gcsplan.research.bench.functions import (
    PAPER_RUNS,
    WOLVES,
    WOLVES_PRINTED,
    PrintedWolf,
    claims_of,
    report,
    run,
    write,
)
from gcsplan.research.optimisers.functions import FUNCTIONS


def test_the_printed_table_is_whole() -> None:
    assert set(WOLVES_PRINTED) == {(f"f{k}", wolf) for k in range(1, 10) for wolf in WOLVES}
    assert WOLVES_PRINTED["f5", "sogwo"] == PrintedWolf(1.7322e-106, 2.7528e-107, 4.2975e-109)
    # The paper's claim, as far as its own numbers go.
    for (function, wolf), row in WOLVES_PRINTED.items():
        assert WOLVES_PRINTED[function, "ssgwo"].mean <= row.mean, (function, wolf)


def test_printed_rows_that_no_experiment_can_give_are_marked() -> None:
    assert WOLVES_PRINTED["f1", "ssgwo"].fault == "the mean is below the best"
    assert "too small" in WOLVES_PRINTED["f3", "ssgwo"].fault
    assert "too large" in WOLVES_PRINTED["f7", "gwo"].fault
    assert not WOLVES_PRINTED["f1", "gwo"].fault
    assert not WOLVES_PRINTED["f9", "mgwo"].fault


def test_no_experiment_is_marked_by_mistake() -> None:
    rng = np.random.default_rng(7)
    for _ in range(200):
        values = rng.lognormal(sigma=rng.uniform(0.01, 5.0), size=PAPER_RUNS)
        for ddof in (0, 1):
            assert not PrintedWolf(values.mean(), values.std(ddof=ddof), values.min()).fault
    # Not even the two that have the least and the most spread.
    low = np.append(np.full(PAPER_RUNS - 1, 1.0), 0.0)
    high = np.append(np.zeros(PAPER_RUNS - 1), 1.0)
    for values in (low, high):
        for ddof in (0, 1):
            assert not PrintedWolf(values.mean(), values.std(ddof=ddof), values.min()).fault


@pytest.mark.slow
def test_a_claim_holds_only_where_the_runs_say_so() -> None:
    rng = np.random.default_rng(5)
    low, high = rng.random(40), 2.0 + rng.random(40)
    costs = {("f1", wolf, setting): high for wolf in WOLVES for setting in ("middle", "shifted")}
    costs["f1", "ssgwo", "middle"] = low
    costs["f1", "ssgwo", "shifted"] = high + 1.0
    claims = claims_of(costs, ["f1"], WOLVES, 40, 30)
    assert {c["claim"] for c in claims} == {f"ssgwo < {w}" for w in WOLVES[:4]}
    assert all(c["reproduced"] == (c["setting"] == "middle") for c in claims)
    # Table 2 has MGWO and SSGWO level on f7.
    costs = {("f7", wolf, setting): high for wolf in ("mgwo", "ssgwo") for setting in ("middle", "shifted")}
    costs["f7", "ssgwo", "middle"] = low
    tie = {c["setting"]: c for c in claims_of(costs, ["f7"], ["mgwo", "ssgwo"], 40, 30)}
    assert tie["middle"]["claim"] == "ssgwo = mgwo"
    assert not tie["middle"]["reproduced"]
    assert tie["shifted"]["reproduced"]
    assert claims_of(costs, ["f7"], ["mgwo", "ssgwo"], 29, 30) == []


def test_rankings_among_values_that_doubles_cannot_tell_apart_are_left_open() -> None:
    least = FUNCTIONS["f1"].resolution(30)
    assert least == pytest.approx(30 * (200.0 * 2.0**-53) ** 2, rel=4.0)
    tiny, more = np.zeros(40), np.full(40, least / 2.0)
    costs = {("f1", wolf, setting): more for wolf in ("gwo", "ssgwo") for setting in ("middle", "shifted")}
    costs["f1", "ssgwo", "middle"] = tiny
    middle = claims_of(costs, ["f1"], ["gwo", "ssgwo"], 40, 30)[0]
    assert middle["p"] < 0.05
    assert middle["reproduced"] is None
    costs["f1", "gwo", "middle"] = np.full(40, 2.0 * least)
    assert claims_of(costs, ["f1"], ["gwo", "ssgwo"], 40, 30)[0]["reproduced"] is True


@pytest.mark.slow
def test_the_benchmark_gives_the_same_numbers_over_processes_as_in_one(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    asked = {"runs": 12, "seed": 3, "algorithms": ("gwo", "de"), "functions": ("f1", "f6"), "dim": 4, "iterations": 12}
    parts: list[tuple[int, int]] = []
    alone = run(jobs=1, population=8, done=lambda k, n: parts.append((k, n)), **asked)
    assert parts == [(k, 16) for k in range(1, 17)]
    assert run(jobs=2, population=8, **asked) == alone
    for row in alone["rows"]:
        costs = alone["costs"][f"{row['function']}/{row['algorithm']}/{row['setting']}"]
        assert len(set(costs)) == 12
        assert row["mean"] == pytest.approx(sum(costs) / 12)
        assert row["best"] == min(costs)
        assert row["std"] == pytest.approx(float(np.std(costs, ddof=1)))
        assert row["evaluations"] == 8 * 13
        assert row["printed_mean"] == (
            WOLVES_PRINTED[row["function"], "gwo"].mean if row["algorithm"] == "gwo" else None
        )

    files = write(alone, tmp_path / "out")
    with files[0].open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    assert [float(line["mean"]) for line in table] == [row["mean"] for row in alone["rows"]]
    with files[1].open(encoding="utf-8", newline="") as file:
        runs = list(csv.DictReader(file))
    assert len(runs) == 8 * 12
    assert [float(line["cost"]) for line in runs[:12]] == alone["costs"]["f1/gwo/middle"]
    page = files[2].read_text(encoding="utf-8")
    assert page.count("| f1 Sphere |") == page.count("| f6 Quartic with noise |") == 2
    assert "3.25e-26" in page
    text = report(alone)
    assert "f6 Quartic with noise" in text
    assert "30 runs or more" in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"runs": 0}, "give 1 to 10000 runs, not 0"),
        ({"jobs": 0}, "jobs"),
        ({"functions": ("f10",)}, "f8, f9, given f10"),
        ({"functions": ()}, "given none"),
        ({"algorithms": ("gow",)}, "gwo"),
    ],
)
def test_what_cannot_be_run_is_refused(change: dict[str, object], message: str) -> None:
    parts: list[tuple[int, int]] = []
    with pytest.raises(InputError, match=message):
        run(**{"runs": 1, "jobs": 1, **change}, done=lambda k, n: parts.append((k, n)))  # type: ignore[arg-type]
    assert parts == []
