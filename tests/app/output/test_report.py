"""The report of a plan."""

from __future__ import annotations

import json

import pytest

from gcsplan.app.output.files import outputs_of, report_of
from gcsplan.cli.output.console import plan_table
from gcsplan.units import AVIATION
from tests.app.fleet.test_fleet import planned, sequence


@pytest.mark.slow
def test_a_note_is_sentence_and_data_in_json_and_in_units_on_page_and_terminal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    done = planned(sequence(60, hold="none"), {}, {"speed_m_s": [9, 10]})
    told = json.loads(outputs_of(done)["summary.json"])["vehicles"][1]
    assert len(told["notes"]) == len(told["notes_data"])
    [data] = [d for d in told["notes_data"] if d["code"] == "flies_longer"]
    more_m = data["data"]["more_m"]
    assert data["item"] is None
    assert told["notes"][told["notes_data"].index(data)] == f"flies {more_m:.0f} m more, to arrive so late"
    in_feet = f"flies {more_m / 0.3048:.0f} ft more, to arrive so late"
    assert in_feet in report_of(done, units=AVIATION)
    plan_table(done, {}, AVIATION)
    assert f"note: south: {in_feet}" in " ".join(capsys.readouterr().err.split())
