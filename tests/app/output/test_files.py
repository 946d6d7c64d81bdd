"""The files of a plan."""

from __future__ import annotations

import pytest
import yaml

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of, summary_of
from gcsplan.mission_file import load_mission
from tests.app.fleet.test_fleet import CROSS
from tests.support.paths import DATA


@pytest.mark.slow
def test_the_same_fleet_twice_gives_the_same_bytes() -> None:
    text = yaml.safe_dump(CROSS | {"arrival": {"mode": "together", "separation_m": 30}})
    first, second = (outputs_of(plan(load_mission("fleet.yaml", text=text))) for _ in range(2))
    assert first == second


@pytest.mark.slow
def test_the_example_of_the_contract_plans_as_printed() -> None:
    done = plan(load_mission(DATA / "interface_example.yaml"))
    assert [v.name for v in done.vehicles] == ["uav1", "uav2"]
    for v in done.vehicles:
        assert v.verdict.safe is True
        assert v.verdict.length_m > 17_000
    summary = summary_of(done)
    assert summary["fleet"]["order"] == ["uav1", "uav2"]
    first, second = (v["arrive_s"] for v in summary["vehicles"])
    assert second - first == pytest.approx(9.0, abs=1e-3)
    assert summary["fleet"]["min_separation_m"] >= 30
    assert summary["fleet"]["closest"]["vehicles"] == ["uav1", "uav2"]
