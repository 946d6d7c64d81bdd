"""How `gcsplan check` tells the results of its files: one by one as they come, then the summary."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Protocol

from gcsplan.cli.process.exit import closers, complain, explained, interrupted, printable, put
from gcsplan.errors import GcsplanError, InputError

if TYPE_CHECKING:
    from gcsplan.app.check.files import Failing
    from gcsplan.app.check.many import Archive, FileResult, Summary
    from gcsplan.notes.note import Note
    from gcsplan.units import Units

LINE_S = 5.0
"""Seconds between two lines of progress."""

MOST_FAILING = 100
"""Files of which the ``error`` of a document says why they do not pass; the verdicts say it of all."""

Header = tuple[str, Mapping[str, object], "tuple[Note, ...]", Mapping[str, str]]
"""The name of the mission, the sources of the world, notes, and the options that the reader types."""


class Printer(Protocol):
    """Prints the results of files."""

    def begin(self, header: Header) -> None:
        """Print what comes first."""

    def tell(self, result: FileResult) -> None:
        """Print the result of a file."""

    def end(self, header: Header, summary: Summary, error: dict[str, Any] | None) -> None:
        """Print what comes last; ``error`` is that of the document."""


class Lines:
    """The findings, a line for each; ``summed``: with notes before them, and the summary after them."""

    def __init__(self, units: Units, *, summed: bool) -> None:
        self.units, self.summed = units, summed

    def begin(self, header: Header) -> None:
        """See `Printer`."""
        from gcsplan.cli.output.console import say_heights, say_notes
        from gcsplan.notes.note import Wording

        if self.summed:
            say_notes(header[2], Wording(self.units, header[3]))
            say_heights(header[1], self.units)

    def tell(self, result: FileResult) -> None:
        """See `Printer`."""
        from gcsplan.cli.output.console import remark, say

        for line in result.lines:
            say(printable(line))
        for problem in getattr(result.error, "problems", ()):
            remark(printable(f"{problem}" if problem.where.startswith(result.file) else f"{result.file}: {problem}"))
        if result.error is not None and not isinstance(result.error, InputError):
            remark(printable(str(result.error)))

    def end(self, header: Header, summary: Summary, error: dict[str, Any] | None) -> None:
        """See `Printer`."""
        from gcsplan.cli.output.console import say

        for line in summary.lines() if self.summed else ():
            say(line)


class Rows:
    """JSON lines: an object for each file, then one with the summary."""

    def begin(self, header: Header) -> None:
        """See `Printer`."""

    def tell(self, result: FileResult) -> None:
        """See `Printer`."""
        put(result.text + "\n")
        if result.error is not None:
            complain(result.error)

    def end(self, header: Header, summary: Summary, error: dict[str, Any] | None) -> None:
        """See `Printer`."""
        from gcsplan.export.summary import SCHEMA, json_of

        last = {"schema": SCHEMA} | _head(header) | {"summary": summary.as_dict()} | _error(error)
        put(json_of(last, "", lines=False) + "\n")


class Document:
    """One JSON document, written as the results come."""

    def __init__(self) -> None:
        self._count = 0

    def begin(self, header: Header) -> None:
        """See `Printer`."""
        from gcsplan.export.summary import write_summary

        put(write_summary(_head(header)).removesuffix("\n}\n") + ',\n  "verdicts": [')

    def tell(self, result: FileResult) -> None:
        """See `Printer`."""
        if result.error is not None:
            complain(result.error)
            return
        put(("," if self._count else "") + "\n    " + result.text.replace("\n", "\n    "))
        self._count += 1

    def end(self, header: Header, summary: Summary, error: dict[str, Any] | None) -> None:
        """See `Printer`."""
        from gcsplan.export.summary import json_of

        rest = json_of({"summary": summary.as_dict()} | _error(error), "") + "\n"
        put(("\n  ]" if self._count else "]") + "," + rest.removeprefix("{"))


def _head(header: Header) -> dict[str, Any]:
    from gcsplan.notes.note import Wording, in_json

    name, inputs, notes, typed = header
    return {"name": name, "inputs": dict(inputs), **in_json("notes", notes, Wording(options=typed))}


def _error(error: dict[str, Any] | None) -> dict[str, Any]:
    return {} if error is None else {"error": error}


def tell_archive(
    archive: Archive, printer: Printer, jobs: int | None, cluster: str | None, reading: AbstractContextManager[None]
) -> int:
    """Read and judge the files of an archive, and print each as it comes; returns the worst exit code.

    ``reading`` is what the files are read in.
    """
    from gcsplan.app.parallel.executor import executor
    from gcsplan.cli.output.console import remark

    pieces, piece_s = archive.work
    count = len(archive.arguments)
    begun_s = printed_s = time.perf_counter()

    def progress(words: str) -> None:
        nonlocal printed_s
        now_s = time.perf_counter()
        if now_s - printed_s >= LINE_S:
            printed_s = now_s
            remark(f"{words}, {now_s - begun_s:.0f} s")

    with executor(jobs, cluster, pieces=pieces, piece_s=piece_s) as workers:
        if link := getattr(workers, "dashboard", ""):
            remark(f"the workers can be watched at {link}")
        with reading:
            archive.read(workers, lambda read: progress(f"{read} of {count} files read"))
        inputs, notes = archive.sources
        header = (archive.name, inputs, notes, archive.site.typed)
        return tell(header, archive.judged(workers), printer, count, progress)


def tell(
    header: Header, results: Iterable[FileResult], printer: Printer, count: int,
    progress: Callable[[str], None] = lambda _: None,
) -> int:  # fmt: skip
    """Print the results of ``count`` files as they come; returns the worst exit code.

    What ends it early closes a document, in which it is the ``error``, and ends the command with its code.
    """
    from gcsplan.app.check.files import failure
    from gcsplan.app.check.many import Summary

    summary, more = Summary(), 0
    failing: list[Failing] = []
    broken: GcsplanError | None = None
    printer.begin(header)
    closers.append(lambda error: printer.end(header, summary, error.as_dict()))
    try:
        for result in results:
            summary.add(result)
            printer.tell(result)
            if result.failing is not None and len(failing) < MOST_FAILING:
                failing.append(result.failing)
            elif result.failing is not None:
                more += 1
            progress(f"{summary.files} of {count} files, {summary.files - summary.codes[0]} do not pass")
    except (KeyboardInterrupt, Exception) as why:
        if isinstance(printer, Lines):
            printer.end(header, summary, None)
            raise
        broken = interrupted() if isinstance(why, KeyboardInterrupt) else explained(why)
    finally:
        closers.pop()
    printer.end(header, summary, failure(failing, more) if broken is None else broken.as_dict())
    if broken is not None:  # not raised, for a second document must not follow
        complain(broken)
        raise SystemExit(broken.exit_code)
    return summary.code
