"""The published JSON Schemas: documents of earlier versions and of this one are valid, broken ones are not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

from gcsplan.app.fleet.pipeline import plan
from gcsplan.cli.command_table import app
from gcsplan.export.output_schema import FORMS, output_schema

OLD = sorted((Path(__file__).parents[1] / "data" / "documents").glob("*.json"))
"""Documents as released versions wrote them, FORM-VERSION.json; none is ever changed, and each release adds some."""

FLAT = {
    "version": 1, "terrain": {"flat_m": 100}, "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
    "limits": {"min_agl_m": 30},
    "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 15],
                  "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 900, "north_m": 0}}],
}  # fmt: skip


def faults(form: str, document: Any) -> list[str]:
    return [error.message for error in Draft202012Validator(output_schema(form)).iter_errors(document)]


@pytest.mark.parametrize("file", OLD, ids=lambda f: f.stem)
def test_a_document_of_an_earlier_version_stays_valid(file: Path) -> None:
    assert faults(file.stem.rpartition("-")[0], json.loads(file.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize("form", FORMS)
def test_each_form_is_a_schema_that_the_command_prints_and_has_an_old_document(form: str) -> None:
    Draft202012Validator.check_schema(output_schema(form))
    printed = CliRunner().invoke(app, ["schema", form])
    assert json.loads(printed.stdout) == output_schema(form)
    assert any(file.name.startswith(form) for file in OLD)


def test_the_document_of_a_plan_is_valid_and_a_broken_one_is_not() -> None:
    document = json.loads(json.dumps(plan(FLAT).to_dict()))
    assert faults("plan", document) == []
    for key in ("vehicles", "fleet", "schema"):
        assert faults("plan", {k: v for k, v in document.items() if k != key})
    wrong = {**document, "vehicles": [{**document["vehicles"][0], "length_m": "far"}]}
    assert faults("plan", wrong)


@pytest.mark.slow
def test_an_unknown_form_is_refused_with_those_that_there_are() -> None:
    found = CliRunner().invoke(app, ["schema", "plans"])
    assert found.exit_code != 0
    assert "plan, check" in str(found.exception) + found.output
