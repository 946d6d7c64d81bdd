"""The scenarios: each has its mission and its contenders, with the paper's settings."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gcsplan.errors import InputError
from gcsplan.research.bench.papers.printed import PRINTED
from gcsplan.research.bench.papers.scenarios import SCENARIOS, choose, mission_text, prepare, settings_of
from tests.research.bench.papers.made import SCENARIO


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


def test_an_added_optimiser_runs_in_the_space_of_the_papers_own_algorithm() -> None:
    place = "gcsplan.research.optimisers.classics:de"
    [(scenario, contenders)] = choose(["ssgwo-table3"], ["gwo", place])
    assert [c.name for c in contenders] == ["gwo", place]
    ready = prepare(scenario.name, mission_text(scenario.name))
    assert settings_of(contenders[1], ready.source) == settings_of(scenario.contender("ssgwo"), ready.source)
    assert (contenders[1].optimiser, scenario.contender("gwo").optimiser) == (place, "gwo")
    assert [len(c) for _, c in choose(["krill-mound"], [place], readings=False)] == [4]
    with pytest.raises(InputError, match="there is no algorithm 'gradient' here"):
        choose(None, ["gradient"])
