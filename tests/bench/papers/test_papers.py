"""The papers' experiments: printed numbers and their faults, runs that resume, rank tests, schedules, the report."""

from __future__ import annotations

import csv
import inspect
import json
import math
import re
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import false_discovery_control, mannwhitneyu

from gcsplan.app import executor
from gcsplan.bench.measure import compare, holm
from gcsplan.bench.papers import runs as papers_runs
from gcsplan.bench.papers import speed as papers_speed
from gcsplan.bench.papers.judge import TOO_FEW_RUNS
from gcsplan.bench.papers.pictures import best_run, distances, draw_fleet, spread, stepwise
from gcsplan.bench.papers.printed import PRINTED, PRINTED_ENDS, PrintedNumber, StraightFlight, faults, least_of
from gcsplan.bench.papers.remarks import remarks, schedules
from gcsplan.bench.papers.report import IMPOSSIBLE_MARK as MARK
from gcsplan.bench.papers.report import report, scenario_table, write
from gcsplan.bench.papers.run import PAPER_RUNS_FILE, plain, run
from gcsplan.bench.papers.runs import PaperRun, Store, code_digest, seed_of, work
from gcsplan.bench.papers.scenarios import SCENARIOS, choose, mission_text, prepare, settings_of
from gcsplan.bench.papers.statistics import row, schedule, values
from gcsplan.errors import InputError
from tests.support.effort import draws

SCENARIO = "ssgwo-table7-tall"
PAIR = ("ssgwo", "gwo")


# -- printed numbers ---------------------------------------------------------------------------------------------------


ROOT = Path(papers_runs.__file__).parents[2]


def _counted() -> set[Path]:
    return {file for pattern in papers_runs.CODE for file in ROOT.glob(pattern)}


@pytest.mark.parametrize("package", ["planners", "optimisers", "world"])
def test_a_change_of_any_planner_makes_kept_runs_old(package: str) -> None:
    assert set((ROOT / package).rglob("*.py")) <= _counted()


@pytest.mark.parametrize("pattern", papers_runs.CODE)
def test_every_file_that_makes_kept_runs_old_is_there(pattern: str) -> None:
    assert list(ROOT.glob(pattern))


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
    assert ROOT / "optimisers" / "wolves.py" in ours
    assert ours <= _counted()


def test_a_printed_number_is_below_another_only_after_rounding() -> None:
    assert PrintedNumber("1129").below(1131.47)
    assert not PrintedNumber("1131").below(1131.47)  # 1131.47 rounds to it
    assert PrintedNumber("1131.0").below(1131.47)
    assert PrintedNumber("150.6818").below(150.682)
    assert PrintedNumber("29").above(28.4)
    assert not PrintedNumber("29").above(28.6)


def _impossible(scenario: str) -> dict[tuple[str, str], str]:
    out = {}
    for (place, algorithm), printed in PRINTED.items():
        if place == scenario:
            for measure in faults(printed, least_of(scenario), 120.0, 100.0):
                out[algorithm, measure] = printed[measure].text
    return out


def test_impossible_numbers_are_those_below_the_straight_way() -> None:
    energies = {(name, "energy_j") for name in ("aco", "abc", "krill")}
    assert set(_impossible("krill-mound")) == {("krill", "length_m"), ("abc", "length_m")} | energies
    assert set(_impossible("krill-hills")) == set(_impossible("krill-forest")) == energies
    assert {k for k in _impossible("ssgwo-table7") if "length" in k[1]} == {("ssgwo", "best_length_m")}
    assert not any("length" in k[1] for k in _impossible("ssgwo-table3"))
    assert _impossible("ib-abc-together") == {("ib-abc", "length_3_m"): "327.469"}
    assert set(_impossible("ib-abc-sequence")) == {
        ("ib-abc", "length_2_m"), ("b-abc", "length_2_m"), ("abc", "length_2_m"), ("ib-abc", "length_3_m"),
    }  # fmt: skip
    assert not _impossible("msfoa-1")


@pytest.mark.parametrize("scenario", PRINTED_ENDS)
def test_marks_follow_from_the_ends_and_not_from_a_list(scenario: str) -> None:
    near = tuple(StraightFlight.between(start, start) for start, _ in PRINTED_ENDS[scenario])
    far = tuple(StraightFlight(1e6, 1e6, 1e6) for _ in PRINTED_ENDS[scenario])
    for (place, _), printed in PRINTED.items():
        if place == scenario:
            lengths = {m for m in printed if m.endswith("_m") and "length" in m}
            assert not {m for m in faults(printed, near, 120.0, 100.0) if "length" in m or "energy" in m}
            assert lengths <= set(faults(printed, far, 120.0, 100.0))


@given(st.lists(st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5)), min_size=1, max_size=30))
@settings(max_examples=draws(60))
def test_no_path_of_even_steps_pitches_more_than_its_length_allows(steps: list[tuple[float, float]]) -> None:
    heading, pitch = np.array(steps).T
    legs = np.stack([np.cos(pitch) * np.cos(heading), np.cos(pitch) * np.sin(heading), np.sin(pitch)], axis=-1)
    least = StraightFlight.between((0.0, 0.0, 0.0), legs.sum(axis=0))
    assert np.degrees(np.abs(pitch)).mean() <= least.most_pitch_deg(float(len(steps))) + 1e-4


def test_what_is_said_of_the_tables_is_worked_out_from_them() -> None:
    krill = " ".join(remarks("krill-forest"))
    assert "5 are 14.32 J/m" in krill
    assert "1.0 % against abc" in krill
    assert "2.1 % against aco" in krill
    msfoa = [" ".join(remarks(f"msfoa-{i}")) for i in (1, 2, 3)]
    assert "abc 411.17 < msfoa 416.96 < mfoa 417.06" in msfoa[0]
    assert "mfoa 388.33 < abc 401.01 < msfoa 404.21" in msfoa[1]
    assert "msfoa 454.52 < abc 457.46" in msfoa[2]
    assert "rows of foa and pso are identical" in msfoa[1]
    assert "identical" not in msfoa[0] + msfoa[2]


# -- scenarios ---------------------------------------------------------------------------------------------------------


def test_every_scenario_has_its_mission_and_every_printed_algorithm_its_contender() -> None:
    for name, scenario in SCENARIOS.items():
        assert f"name: {scenario.paper.name}" in mission_text(name)
        printed = {algorithm for place, algorithm in PRINTED if place == name}
        assert printed <= {c.name for c in scenario.paper.contenders}
    assert {place for place, _ in PRINTED} <= set(SCENARIOS)


@pytest.mark.first_quick
@pytest.mark.parametrize("name", ["krill-mound", "ssgwo-table3", "msfoa-1", "abo", "ib-abc-together"])
def test_contenders_search_as_the_paper_has_it(name: str) -> None:
    ready = prepare(name, mission_text(name))
    told = {c.name: settings_of(c, ready.source) for c in SCENARIOS[name].paper.contenders}
    assert {s.cost for s in told.values()} == {SCENARIOS[name].paper.name}
    assert len({s.iterations for s in told.values()}) == 1
    if name == "msfoa-1":
        assert told["abc"].population == 50
        assert {n for n, s in told.items() if s.encoding == "polar"} == {"msfoa", "foa"}
        assert {s.speed_m_s for s in told.values()} == {15.0}
    if name == "abo":
        assert told["abo-1-2"].parameters["beta"] == 2.0
        assert told["abo-1-2"].parameters["top_m"] == 100
        assert "beta" not in told["pso"].parameters
    if name == "ib-abc-together":
        assert {(s.encoding, s.points, s.population) for s in told.values()} == {("sections", 10, 20)}


def test_unknown_names_are_refused_with_the_nearest() -> None:
    with pytest.raises(InputError, match="'krill-mound'"):
        choose(["krill-mount"], None)
    with pytest.raises(InputError, match="Known: ssgwo, gwo"):
        choose([SCENARIO], ["whale"])
    assert [c.name for c in choose(["abo", SCENARIO], ["pso"])[0][1]] == ["pso"]
    with pytest.raises(InputError, match=re.escape("abo.yaml is in none of")):
        mission_text("abo", Path("nowhere"))


# -- statistics --------------------------------------------------------------------------------------------------------


def _record(name: str, number: int, length: float, violations: int = 0, **more: Any) -> dict[str, Any]:
    return {
        "scenario": SCENARIO, "algorithm": name, "seed": 1, "number": number, "digest": "x", "status": "found",
        "length_m": length, "lengths_m": [length], "cost": length + 100.0 * violations, "energy_j": 100.0 * length,
        "violations": violations, "collisions": violations, "time_s": 1.0, "evaluations": 10, "iterations": 9,
        "converged": 5, "pitch_deg": 1.0, "yaw_deg": 2.0, "nearest_m": None,
        "history": {"iterations": [0, 9], "evaluations": [5, 10], "cost": [None, length]}, "paths": [],
    } | more  # fmt: skip


def test_the_rank_test_is_scipys_on_made_runs() -> None:
    rng = np.random.default_rng(3)
    for shift in (-0.5, 0.0, 0.5, 2.0):
        a, b = rng.normal(0.0, 1.0, 35), rng.normal(shift, 1.0, 40)
        p, effect = compare(a, b)
        assert p == pytest.approx(mannwhitneyu(a, b, alternative="two-sided", method="asymptotic").pvalue)
        assert effect == pytest.approx(np.mean([(x < y) + 0.5 * (x == y) for x in a for y in b]))
    same = np.full(30, 7.0)
    assert compare(same, same) == (1.0, 0.5)
    # Infinities rank last and tie.
    a, b = np.array([1.0, 2.0, math.inf]), np.array([3.0, math.inf, math.inf])
    finite = [np.where(np.isinf(x), 99.0, x) for x in (a, b)]
    p, effect = compare(a, b)
    assert p == pytest.approx(mannwhitneyu(*finite, alternative="two-sided", method="asymptotic").pvalue)
    assert effect == pytest.approx((3.0 + 3.0 + 0.0 + 2 * 0.5) / 9.0)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
@settings(max_examples=draws(60))
def test_holms_correction_lies_between_the_raw_values_and_bonferronis(p: list[float]) -> None:
    out = holm(p)
    order = np.argsort(p, kind="stable")
    assert (np.diff(np.array(out)[order]) >= 0.0).all()
    assert out[order[0]] == pytest.approx(min(1.0, len(p) * p[order[0]]))
    for raw, fixed, mild in zip(p, out, false_discovery_control(p), strict=True):
        assert raw <= fixed + 1e-15
        assert fixed <= min(1.0, len(p) * raw) + 1e-12
        assert mild <= fixed + 1e-12


def test_a_row_says_what_numpy_says() -> None:
    records = [_record("gwo", k, x, k % 2) for k, x in enumerate((1140.0, 1132.0, 1160.0))]
    line = row(SCENARIO, "gwo", [*records, {"status": "refused"}], 9)
    lengths = [r["length_m"] for r in records]
    assert line["mean_length_m"] == pytest.approx(np.mean(lengths))
    assert line["std_length_m"] == pytest.approx(np.std(lengths, ddof=1))
    assert line["median_length_m"] == 1140.0
    assert line["best_length_m"] == 1132.0
    assert line["best_legal_length_m"] == 1140.0
    assert (line["runs"], line["refused"], line["legal"], line["collided"]) == (4, 1, 2, 1)
    assert line["mean_cost_at_equal_evaluations"] is None  # at 9 evaluations no cost was finite
    assert values(records, "cost, equal evaluations", 10).tolist() == lengths
    assert best_run(records) is records[0]
    assert best_run(records[1:2]) is records[1]
    assert row(SCENARIO, "gwo", [{"status": "refused"}], 0)["mean_length_m"] is None


def test_stepwise_curves_hold_their_last_value() -> None:
    got = stepwise([10, 20, 30], [None, 5.0, 4.0], np.array([0.0, 10.0, 19.9, 20.0, 35.0]))
    assert got.tolist() == [math.inf, math.inf, math.inf, 5.0, 4.0]


def test_the_schedules_arithmetic_is_the_papers() -> None:
    slots = schedule([261.115, 306.704, 350.520, 421.547], "sequence", 9.0, 3.0, 30.0)
    assert [s.time_s for s in slots] == pytest.approx([8.7038, 17.7038, 26.7038, 35.7038], abs=1e-4)
    assert [s.speed_m_s for s in slots] == pytest.approx([30.0, 17.324, 13.126, 11.807], abs=1e-3)
    together = schedule([261.670, 349.734, 327.469, 301.035], "together", 9.0, 3.0, 30.0)
    assert {round(s.time_s, 3) for s in together} == {11.658}
    assert together[1].speed_m_s == pytest.approx(30.0)
    late = schedule([90.0, 450.0, 30.0], "sequence", 9.0, 3.0, 30.0)
    assert [bool(s.trouble) for s in late] == [False, True, True]
    assert "faster" in late[1].trouble
    assert "slower" in late[2].trouble


def test_printed_times_that_stand_in_the_wrong_column_are_marked() -> None:
    name = "ib-abc-sequence"
    rows = [row(name, a, [_record(a, 0, 1000.0, lengths_m=[250.0] * 4)], 0) for a in ("ib-abc", "b-abc", "abc")]
    summary = {"paper": "ib-abc", "set": prepare(name, mission_text(name)), "rows": rows,
               "printed": {a: PRINTED[name, a] for a in ("ib-abc", "b-abc", "abc")}}  # fmt: skip
    header, cells = schedules(summary)
    at = header.index("printed T, s")
    marked = {(c[0], c[1]) for c in cells if "≠" in c[at]}
    right = {("ib-abc", "uav1"), ("b-abc", "uav1"), ("abc", "uav1"), ("ib-abc", "uav4")}
    assert marked == {(a, f"uav{i}") for a in ("ib-abc", "b-abc", "abc") for i in (1, 2, 3, 4)} - right


# -- runs --------------------------------------------------------------------------------------------------------------


def test_a_line_cut_short_is_passed_over_and_the_next_begins_a_line(tmp_path: Path) -> None:
    store = Store(tmp_path / "runs.jsonl")
    assert store.load() == {}
    some = [_record("gwo", k, 1000.0 + k) for k in range(3)]
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


@pytest.fixture(scope="module")
def missions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scenario with few iterations."""
    folder = tmp_path_factory.mktemp("missions")
    text = (
        mission_text(SCENARIO).replace("iterations: 500", "iterations: 15").replace("population: 30", "population: 9")
    )
    (folder / f"{SCENARIO}.yaml").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def finished(missions: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """Two algorithms twice, in this process."""
    out = tmp_path_factory.mktemp("papers")
    return run([SCENARIO], PAIR, 2, jobs=1, out=out, missions=missions), out


def _same(result: dict[str, Any]) -> list[dict[str, Any]]:
    rows = [r for s in result["scenarios"] for r in s["rows"]]
    return [{k: v for k, v in r.items() if "time_s" not in k} for r in rows]


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
    assert _same(again) == _same(result)
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


@pytest.mark.slow
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
    assert _same(again) == _same(finished[0])


@pytest.mark.parametrize("change", [{"runs": 0}, {"jobs": 0}, {"seed": -1}, {"scenarios": []}, {"algorithms": ["pso"]}])
def test_what_cannot_be_run_is_refused_before_anything_is_made(change: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(InputError):
        run(**{"scenarios": [SCENARIO], "runs": 1, "jobs": 1, "out": tmp_path / "out", **change})
    assert not (tmp_path / "out").exists()


# -- a cluster ---------------------------------------------------------------------------------------------------------


def test_a_cluster_without_its_extra_names_the_extra(missions: Path, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=re.escape("pip install 'gcsplan[cluster]'")):
        run([SCENARIO], PAIR, 1, out=tmp_path, missions=missions, cluster="tcp://127.0.0.1:1")


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
    assert _same(again) == _same(finished[0])
    assert len(Store(tmp_path / PAPER_RUNS_FILE).load()) == 5


# -- the report --------------------------------------------------------------------------------------------------------


def test_the_report_has_ours_beside_the_printed_and_marks_the_impossible(
    finished: tuple[dict[str, Any], Path],
) -> None:
    result, _ = finished
    table = scenario_table(result["scenarios"][0])
    best = table.header.index("best, m")
    assert table.header[best + 1] == "printed"
    ours = result["scenarios"][0]["rows"][0]
    assert table.rows[0][best] == f"{ours['best_length_m']:,.2f}"
    assert table.rows[0][best + 1] == f"1129 {MARK}"
    assert table.rows[1][best + 1] == "1263"
    text = report(result)
    assert "Straight line: 1,131.47 m" in text
    assert "Rankings are judged from 30 runs on" in text


def test_the_files_hold_the_numbers_and_the_page_needs_no_other_file(finished: tuple[dict[str, Any], Path]) -> None:
    result, out = finished
    files = {path.name: path for path in write(result, out)}
    assert set(files) == {
        "papers.csv", "papers-claims.csv", "papers-claims.md", "papers-readings.csv", "papers-times.csv",
        "papers-times.md", "papers.md", "papers.html", f"{SCENARIO}-map.png", f"{SCENARIO}-convergence.png",
        f"{SCENARIO}-space.png", f"{SCENARIO}-boxes.png",
    }  # fmt: skip
    with files["papers.csv"].open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    rows = result["scenarios"][0]["rows"]
    assert [float(line["mean_length_m"]) for line in lines] == [r["mean_length_m"] for r in rows]
    for name in (n for n in files if n.endswith(".png")):
        assert files[name].read_bytes().startswith(b"\x89PNG\r\n")
    said = json.loads(json.dumps(plain(result), allow_nan=False))["scenarios"][0]
    assert said["rows"] == rows
    assert said["printed"]["ssgwo"]["best_length_m"] == "1129"
    page = files["papers.html"].read_text(encoding="utf-8")
    assert re.findall(r'src="(.{0,22})', page) == ["data:image/png;base64,"] * 4
    assert "http" not in page
    assert "<script" not in page
    text = files["papers.md"].read_text(encoding="utf-8")
    assert f"1129 {MARK}" in text
    assert "the straight line is 1131.47 m" in text


def test_another_clock_changes_the_files_of_times_alone(
    finished: tuple[dict[str, Any], Path], missions: Path, tmp_path: Path
) -> None:
    (tmp_path / "slow").mkdir()
    (tmp_path / "fast").mkdir()
    runs = [json.loads(line) for line in (finished[1] / PAPER_RUNS_FILE).read_text(encoding="utf-8").splitlines()]
    for record in runs[::-1]:  # finished in another order, at another speed
        Store(tmp_path / "slow" / PAPER_RUNS_FILE).append(record | {"time_s": 7.0 + record["time_s"]})
    (tmp_path / "fast" / PAPER_RUNS_FILE).write_bytes((finished[1] / PAPER_RUNS_FILE).read_bytes())
    said, seen = [], []
    for place in (tmp_path / "slow", tmp_path / "fast"):
        result = run([SCENARIO], PAIR, 2, jobs=1, out=place, missions=missions)
        said.append(report(result))
        seen.append({file.name: file.read_bytes() for file in write(result, place, draw=lambda _: {})})
    assert said[0] == said[1]
    assert {name for name in seen[0] if seen[0][name] != seen[1][name]} == {"papers-times.csv", "papers-times.md"}


def test_distances_of_a_fleet_are_those_of_points_that_fly_evenly() -> None:
    one = np.array([[0.0, 0.0, 0.0], [30.0, 0.0, 0.0], [30.0, 70.0, 0.0]])
    other = np.array([[0.0, 10.0, 0.0], [0.0, 10.0, 50.0]])
    t, gap = distances(one, 10.0, other, 20.0)  # 10 m/s and 2.5 m/s
    assert (t[0], t[-1]) == (0.0, 10.0)
    for moment, found in zip(t, gap, strict=True):
        first = (10.0 * moment, 0.0, 0.0) if moment <= 3.0 else (30.0, 10.0 * moment - 30.0, 0.0)
        assert found == pytest.approx(math.dist(first, (0.0, 10.0, 2.5 * moment)))


def test_box_plots_show_costs_of_all_runs_and_lengths_of_legal_ones() -> None:
    records = [_record("gwo", k, x, k % 2) for k, x in enumerate((1140.0, 1132.0, 1160.0))]
    records.append({"status": "refused"})
    assert spread(records, "cost").tolist() == [1140.0, 1232.0, 1160.0]
    assert spread(records, "length_m").tolist() == [1140.0, 1160.0]


@pytest.mark.slow
def test_a_fleet_has_its_distances_drawn_and_one_vehicle_none(finished: tuple[dict[str, Any], Path]) -> None:
    assert draw_fleet(finished[0]["scenarios"][0]) is None
    for name, paths in (("msfoa-1", 3), ("ib-abc-sequence", 4)):
        ready = prepare(name, mission_text(name))
        ends = [[list(p.start), list(p.goal)] for p in ready.problems]
        assert len(ends) == paths
        summary = {"name": name, "set": ready, "records": {"own": [_record("own", 0, 1.0, paths=ends)]}}
        picture = draw_fleet(summary)
        assert picture is not None
        assert picture.startswith(b"\x89PNG")
        assert draw_fleet(summary) == picture


# -- speed -------------------------------------------------------------------------------------------------------------


def test_speed_is_measured_on_one_and_the_same_objective(monkeypatch: pytest.MonkeyPatch) -> None:
    cost, size, rounds = papers_speed.cost_of(papers_speed.CASE, None)
    assert (cost.dim, size, rounds) == (90, 30, 500)
    u = np.random.default_rng(1).random((40, 90))
    assert np.array([cost(x[None])[0] for x in u]) == pytest.approx(cost(u))
    monkeypatch.setitem(sys.modules, "mealpy", None)
    with pytest.raises(InputError, match=re.escape("pip install 'gcsplan[bench]'")):
        papers_speed.run(1)
    with pytest.raises(InputError, match="1 or more"):
        papers_speed.run(0)


def test_the_speed_report_says_what_was_missed() -> None:
    made = {
        "repeats": 3, "population": 30, "iterations": 500, "run_s": 0.2, "single_s": 1.0,
        "krill_s": {"krill-mound": 0.6}, "costs_per_s": {"krill cost, bspline": 3e5},
        "single_ratio": 5.0, "mealpy_ratio": 9.0, "parts_us": {},
    }  # fmt: skip
    lines = [line.split() for line in papers_speed.report(made).splitlines()[1:]]
    assert [line[-1] for line in lines] == ["reached", "missed", "reached", "missed", "reached"]
    assert "mealpy" not in papers_speed.report(made | {"mealpy_ratio": None})
    assert "\n  zones                                                  0.80\n" in papers_speed.report(
        made | {"parts_us": {"zones": 0.8}}
    )


def test_the_parts_of_the_costs_time_add_up() -> None:
    took = {name: float(i) for i, name in enumerate(papers_speed.parts_of_cost(), start=1)}
    parts = papers_speed.differences(took)
    assert list(parts) == list(took)
    bare = (papers_speed.BARE_PART, papers_speed.DIVIDED_PART, papers_speed.ZONES_PART)
    assert sum(parts[name] for name in bare) == took[papers_speed.ZONES_PART]
    for name in papers_speed.TERM_GROUPS:
        assert parts[name] + took[papers_speed.ZONES_PART] == took[name]
    for measured in papers_speed.parts_of_cost().values():
        measured()
