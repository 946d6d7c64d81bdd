"""Results of `gcsplan check` as they are told: lines, rows of JSON, or one document that is whole however it ends."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest

from gcsplan.app.check.many import FileResult
from gcsplan.cli.output.check_output import Document, Header, Lines, Printer, Rows, tell
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.units import METRIC

HEADER: Header = ("ridge", {"dem": "a.tif"}, (Note("no_ceiling"),), {"max_agl_m": "--max-agl"})


def told(file: str, **fields: Any) -> FileResult:
    return FileResult(**{"file": file, "code": 0, "kinds": {}, "text": f'{{"file": "{file}"}}', **fields})


def results(*, broken: bool = False) -> Iterator[FileResult]:
    yield told("a.plan", lines=("a.plan:3: too low",), code=4)
    yield told("b.plan")
    if broken:
        raise InputError("other terrain", where="c.plan")


def test_a_document_holds_header_verdicts_and_summary(capsys: pytest.CaptureFixture[str]) -> None:
    assert tell(HEADER, results(), Document(), 2) == 4
    document = json.loads(capsys.readouterr().out)
    assert document["name"] == "ridge"
    assert document["notes"] == ["--max-agl is not set: nothing limits the height above ground"]
    assert [row["file"] for row in document["verdicts"]] == ["a.plan", "b.plan"]
    assert document["summary"]["files"] == 2


def test_a_document_without_results_is_whole_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert tell(HEADER, iter(()), Document(), 0) == 0
    assert json.loads(capsys.readouterr().out)["verdicts"] == []


def test_what_ends_it_early_closes_the_document_and_is_its_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        tell(HEADER, results(broken=True), Document(), 3)
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert ended.value.code == document["error"]["code"] == 2
    assert len(document["verdicts"]) == 2
    assert "other terrain" in err


def test_rows_are_one_json_object_a_line_and_the_summary_last(capsys: pytest.CaptureFixture[str]) -> None:
    assert tell(HEADER, results(), Rows(), 2) == 4
    *rows, last = map(json.loads, capsys.readouterr().out.splitlines())
    assert [row["file"] for row in rows] == ["a.plan", "b.plan"]
    assert last["summary"]["files"] == 2
    assert last["schema"]


@pytest.mark.parametrize("summed", [False, True])
def test_lines_are_the_findings_alone_unless_they_are_summed(
    capsys: pytest.CaptureFixture[str], *, summed: bool
) -> None:
    printer: Printer = Lines(METRIC, summed=summed)
    assert tell(HEADER, results(), printer, 2) == 4
    out, err = capsys.readouterr()
    assert out.splitlines()[0] == "a.plan:3: too low"
    assert (len(out.splitlines()) > 1) is summed
    assert ("--max-agl is not set" in err) is summed


def test_an_error_of_lines_is_raised_for_there_is_nothing_to_close(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError, match="other terrain"):
        tell(HEADER, results(broken=True), Lines(METRIC, summed=False), 3)
    assert capsys.readouterr().out == "a.plan:3: too low\n"
