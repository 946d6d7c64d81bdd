"""What is told of the files of an archive: the lines of each, its JSON, and the summary by finding."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from gcsplan.app.check.files import Batch, Failing, failing_of, failing_to_read, finding_lines, more_of
from gcsplan.app.check.verdict_json import verdict_of
from gcsplan.app.check.worlds import Checked
from gcsplan.errors import GcsplanError, InputError, worst_of
from gcsplan.export.summary import json_of
from gcsplan.figures import counted
from gcsplan.units import Units

__all__ = ["Summary", "Told", "told_of", "told_of_batch", "told_of_error"]

OUTCOMES = {0: "pass", 4: "do not pass", 2: "cannot be read", 70: "met a bug of gcsplan"}
"""What became of a file, by exit code."""


@dataclass(frozen=True, slots=True)
class Told:
    """The result of one file: its exit code, and how many findings of each kind it has.

    ``lines`` are its findings, as with ``-q``, and ``error`` says why it was not judged. ``text`` is its JSON, if that
    is asked for. ``failing`` is None if it passes.
    """

    file: str
    code: int
    kinds: Mapping[str, int]
    lines: tuple[str, ...] = ()
    error: GcsplanError | None = None
    text: str = ""
    failing: Failing | None = None


def told_of(c: Checked, form: str, *, allow_unjudged: bool, units: Units) -> Told:
    """What is told of a file that was judged; see `archive.Form`."""
    failing = failing_of(c, allow_unjudged=allow_unjudged)
    kinds = Counter(f.kind for f in c.verdict.findings)
    if c.verdict.not_judged:
        kinds["not_judged"] = len(c.verdict.not_judged)
    if c.way_home is not None and c.way_home.safe is not True:
        kinds["way_home"] = 1
    code = 0 if failing is None else failing.code
    verdict = partial(verdict_of, str(c.file), c.verdict, c.way_home, c.wording())
    lines: tuple[str, ...] = ()
    if form != "whole":
        lines = tuple(finding_lines(c, allow_unjudged=allow_unjudged, wording=c.wording(units)))
    text = ""
    if form == "whole":
        text = json_of(verdict() | more_of(c), "verdicts")
    elif form == "row":
        row = {"file": str(c.file), "code": code} | verdict()
        home = {} if c.way_home is None else {"way_home": c.way_home.as_dict(c.wording())}
        text = json_of(row | home, "verdicts", lines=False)
    return Told(str(c.file), code, dict(kinds), lines, None, text, failing)


def told_of_batch(batch: Batch, form: str, *, allow_unjudged: bool, units: Units) -> Iterator[Told]:
    """What is told of files that are at hand: those that were judged, then the others."""
    for c in batch.checked:
        yield told_of(c, form, allow_unjudged=allow_unjudged, units=units)
    for argument, error in batch.unreadable:
        yield told_of_error(argument, error, form)


def told_of_error(argument: str, why: GcsplanError, form: str) -> Told:
    """What is told of a file that was not judged."""
    kind = "unreadable" if isinstance(why, InputError) else "internal"
    row = {"file": argument, "code": why.exit_code, "error": why.as_dict()}
    text = json_of(row, "verdicts", lines=False) if form == "row" else ""
    return Told(argument, why.exit_code, {kind: 1}, (), why, text, failing_to_read(argument, why))


@dataclass(slots=True)
class Summary:
    """How many files there were, with which outcome and which findings."""

    files: int = 0
    codes: Counter[int] = field(default_factory=Counter)
    with_kind: Counter[str] = field(default_factory=Counter)
    of_kind: Counter[str] = field(default_factory=Counter)

    def add(self, told: Told) -> None:
        """Count one more file."""
        self.files += 1
        self.codes[told.code] += 1
        self.with_kind.update(told.kinds.keys())
        self.of_kind.update(told.kinds)

    @property
    def code(self) -> int:
        """The worst exit code."""
        return worst_of(self.codes)

    def as_dict(self) -> dict[str, Any]:
        """What ``--json`` says of it; the commonest finding first."""
        kinds = sorted(self.with_kind, key=lambda kind: (-self.with_kind[kind], kind))
        return {
            "files": self.files,
            "codes": {str(code): self.codes[code] for code in sorted(self.codes)},
            "findings": {k: {"files": self.with_kind[k], "findings": self.of_kind[k]} for k in kinds},
        }

    def lines(self) -> list[str]:
        """The same for people."""
        outcomes = [f"{self.codes[code]} {words}" for code, words in OUTCOMES.items() if self.codes[code]]
        lines = [f"{counted(self.files, 'file')}: {', '.join(outcomes) or 'none'}"]
        found = self.as_dict()["findings"]
        wide = max(map(len, found), default=0)
        for kind, count in found.items():
            files, findings = counted(count["files"], "file"), counted(count["findings"], "finding")
            lines.append(f"  {kind:{wide}}  in {files}, {findings}")
        return lines
