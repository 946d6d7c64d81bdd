"""The papers' claims: each once, with stable numbers; their verdicts, twins, equal evaluations and readings."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.research.bench.papers import judge as papers_judge
from gcsplan.research.bench.papers import scenarios as papers_scenarios
from gcsplan.research.bench.papers.judge import (
    CLAIMS,
    HOLDS,
    IMPOSSIBLE_AS_PRINTED,
    NO_LEGAL,
    NOT_RUN,
    REVERSED,
    TIE,
    TOO_FEW_RUNS,
    judge,
    standing,
)
from gcsplan.research.bench.papers.scenarios import READINGS, SCENARIOS, PaperReading, choose
from gcsplan.research.bench.papers.tables import claims_table, readings_table
from gcsplan.research.optimisers.registry import get as get_optimiser
from gcsplan.research.swarm import SWARM_PLANNERS
from gcsplan.research.swarm.encodings import get_encoding
from gcsplan.research.swarm.settings import Settings

SCENARIO, TWIN = "ssgwo-table3", "ssgwo-table3-tall"


def test_every_claim_stands_once_and_can_be_cited() -> None:
    # 33 + 48 + 18 + 8 as printed; ABO's four from its curves, and the one that it makes in words.
    assert Counter(c.paper for c in CLAIMS) == {"krill": 33, "ssgwo": 48, "msfoa": 18, "abo": 5, "ib-abc": 8}
    assert len({(c.scenario, c.measure, c.low, c.high) for c in CLAIMS}) == len(CLAIMS)
    assert len({c.number for c in CLAIMS}) == len(CLAIMS)
    assert not any(SCENARIOS[c.scenario].twin_of for c in CLAIMS)
    by_number = {c.number: (c.scenario, c.measure, c.low, c.high) for c in CLAIMS}
    assert by_number["krill-1"] == ("krill-mound", "length", "krill", "abc")
    assert by_number["ssgwo-17"] == ("ssgwo-table5", "length", "ssgwo", "gwo")
    assert by_number["msfoa-12"] == ("msfoa-2", "cost", "mfoa", "msfoa")  # Table 3 has it so
    assert by_number["ib-abc-8"] == ("ib-abc-sequence", "length", "ib-abc", "gwo")


def test_claims_that_rest_on_impossible_numbers_say_which() -> None:
    why = {c.number: c.impossible for c in CLAIMS if c.impossible}
    assert why["krill-2"] == "krill: 150.6818, but the straight line is 153.62 m"
    assert "327.469, but the straight line is 375.53 m" in why["ib-abc-1"]
    assert "parrot optimizer" in why["abo-5"]
    kinds = Counter((c.paper, c.measure) for c in CLAIMS if c.impossible)
    assert kinds["krill", "energy"] == 9  # all of them
    assert ("ssgwo", "length") not in kinds


def _record(name: str, number: int, length: float, violations: int = 0, **more: Any) -> dict[str, Any]:
    return {
        "algorithm": name, "number": number, "status": "found", "length_m": length, "cost": length,
        "violations": violations, "collisions": violations, "energy_j": length, "time_s": length, "evaluations": 10,
        "converged": 5, "pitch_deg": 1.0, "yaw_deg": 2.0,
        "history": {"iterations": [0, 9], "evaluations": [5, 10], "cost": [None, length]},
    } | more  # fmt: skip


def _runs(name: str, least: float, count: int = 30, **more: Any) -> list[dict[str, Any]]:
    noise = np.random.default_rng([len(name), int(least)]).random(count)
    return [_record(name, k, least + x, **more) for k, x in enumerate(noise)]


def _case(scenario: str = SCENARIO, words: str = "ssgwo < gwo", **runs: list[dict[str, Any]]) -> dict[str, Any]:
    cases = judge([SCENARIOS[scenario]], {(scenario, name): some for name, some in runs.items()})["claims"]
    return next(c for c in cases if c["words"] == words and c["measure"] == "length, m")


@pytest.mark.slow
def test_a_claim_holds_ties_or_is_reversed_only_where_the_runs_say_so() -> None:
    low, level, high = _runs("ssgwo", 1150.0), _runs("igwo", 1150.0), _runs("gwo", 1160.0)
    assert _case(ssgwo=low, gwo=high)["verdict"] == HOLDS
    assert _case(ssgwo=low, gwo=high)["effect"] == 1.0
    assert _case(ssgwo=high, gwo=low)["verdict"] == REVERSED
    assert _case(ssgwo=high, gwo=low)["effect"] == 0.0
    assert _case(words="ssgwo < igwo", ssgwo=low, igwo=level)["verdict"] == TIE
    few = _case(ssgwo=low[:29], gwo=high)
    assert (few["verdict"], few["p"]) == (TOO_FEW_RUNS, None)
    # A short path through a cylinder is worth less than any that passes the check.
    through = _runs("gwo", 1131.0, violations=3)
    assert _case(ssgwo=low, gwo=through)["verdict"] == HOLDS
    assert _case(ssgwo=through, gwo=through)["verdict"] == NO_LEGAL
    assert _case(ssgwo=low, gwo=[{"status": "refused"}] * 30)["verdict"] == HOLDS


def test_what_is_impossible_as_printed_still_tells_how_it_ranks_here() -> None:
    found = {("krill-mound", "krill"): _runs("krill", 155.0), ("krill-mound", "abc"): _runs("abc", 160.0)}
    judged = judge([SCENARIOS["krill-mound"]], found)
    first = judged["claims"][0]
    assert (first["claim"], first["verdict"], first["ranking"]) == ("krill-1", IMPOSSIBLE_AS_PRINTED, HOLDS)
    assert all("time" not in c["measure"] for c in judged["claims"])
    assert [(c["claim"], c["verdict"]) for c in judged["times"]] == [("krill-7", HOLDS)]
    assert any(re.search(r"impossible as printed [1-9]", line) for line in standing(judged, "krill"))


def test_twins_and_equal_evaluations_are_columns_and_no_claims() -> None:
    runs = {"ssgwo": _runs("ssgwo", 1150.0), "gwo": _runs("gwo", 1160.0)}
    tall = {"ssgwo": _runs("ssgwo", 1170.0), "gwo": _runs("gwo", 1160.0)}
    for record in runs["ssgwo"]:  # twice the evaluations, and its best path is found in the second half
        record["evaluations"] = 20
        record["history"] = {"iterations": [0, 4, 9], "evaluations": [5, 10, 20],
                             "cost": [None, 1200.0, record["length_m"]]}  # fmt: skip
    found = {(SCENARIO, name): some for name, some in runs.items()} | {(TWIN, name): s for name, s in tall.items()}
    judged = judge([SCENARIOS[SCENARIO], SCENARIOS[TWIN]], found)
    case = judged["claims"][0]
    assert (case["scenario"], case["verdict"]) == (SCENARIO, HOLDS)
    assert (case["equal_ranking"], case["equal_evaluations"]) == (REVERSED, 10)
    assert case["twin_ranking"] == REVERSED
    assert {c["scenario"] for c in judged["claims"]} == {SCENARIO}
    alone = judge([SCENARIOS[TWIN]], {(TWIN, name): some for name, some in tall.items()})["claims"][0]
    assert (alone["verdict"], alone["twin_ranking"]) == (NOT_RUN, REVERSED)
    table = claims_table(judged["claims"])
    assert table.rows[0][table.header.index("twin")].startswith(REVERSED)


def test_p_is_corrected_over_the_claims_of_a_paper() -> None:
    rng = np.random.default_rng(8)
    runs = {name: [_record(name, k, x) for k, x in enumerate(rng.normal(middle, 1.0, 30))]
            for name, middle in (("ssgwo", 1150.0), ("gwo", 1150.55), ("igwo", 1150.0))}  # fmt: skip
    one = _case(ssgwo=runs["ssgwo"], gwo=runs["gwo"])
    both = _case(**runs)
    assert both["effect"] == one["effect"]
    assert both["p"] > one["p"]


def test_a_reading_is_judged_on_the_claims_of_the_algorithms_that_it_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    reading = PaperReading("other", "another rule", {"ssgwo": {}})
    monkeypatch.setattr(papers_judge, "readings_of", lambda _: (reading,))
    runs = {"ssgwo": _runs("ssgwo", 1170.0), "gwo": _runs("gwo", 1160.0), "ssgwo:other": _runs("other", 1150.0)}
    judged = judge([SCENARIOS[SCENARIO]], {(SCENARIO, name): some for name, some in runs.items()})
    of = {r["claim"]: r["ranking"] for r in judged["readings"] if r["measure"] == "length, m"}
    assert of == {"ssgwo-1": HOLDS}
    assert judged["claims"][0]["verdict"] == REVERSED
    last = list(standing(judged, "ssgwo"))[-1]
    assert last.startswith(
        "The reading other (another rule) changes 1 of 4 claims, from “reversed” to “holds”: ssgwo-1"
    )
    assert readings_table(judged["readings"]).notes == ["other: another rule."]


def test_every_reading_runs_under_a_name_of_its_own_with_options_that_exist() -> None:
    assert set(READINGS) <= {s.paper.name for s in SCENARIOS.values()}
    for paper, readings in READINGS.items():
        scenario = next(s for s in SCENARIOS.values() if s.paper.name == paper)
        names = {c.name for c in scenario.paper.contenders}
        assert len({r.name for r in readings}) == len(readings)
        for reading in readings:
            assert reading.what
            assert set(reading.changes) <= names
        for contender in scenario.paper.readings:
            base = next(c for c in scenario.paper.contenders if c.name == contender.name.partition(":")[0])
            assert contender.options != base.options
            told = Settings.of(SWARM_PLANNERS[contender.planner], contender.options)
            get_encoding(told.encoding)
            get_optimiser(SWARM_PLANNERS[contender.planner].optimiser).with_defaults(told.split()[1])


def test_readings_run_in_the_papers_own_scenarios_and_not_in_their_twins() -> None:
    assert papers_scenarios.readings_of("none") == ()
    for scenario, contenders in choose(None, None):
        assert any(":" in c.name for c in contenders) <= (not scenario.twin_of)
    assert not any(":" in c.name for _, contenders in choose(None, None, readings=False) for c in contenders)
    assert [c.name for c in choose(["abo"], ["pso:inertia-1"])[0][1]] == ["pso:inertia-1"]


def test_the_page_in_the_documents_has_every_claim_but_those_on_time_once() -> None:
    page = (Path(__file__).parents[4] / "docs" / "research" / "papers-claims.md").read_text(encoding="utf-8")
    table = page.split("\n## Claims\n")[1].split("\n## ")[0]
    told = re.findall(r"^\| ([a-z-]+-\d+) \|", table, re.MULTILINE)
    assert told == [claim.number for claim in CLAIMS if claim.measure != "time"]
    assert re.search(r"at commit [0-9a-f]{7,40} \(code [0-9a-f]{16}, seed 1, 30 runs", page)
