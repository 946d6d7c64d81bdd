"""Check an archive: any number of files in one world, whose results come one by one, in the order of the files.

All files are read first, for the world that they share must hold all of them. Then an executor judges them in pieces.
At most `KEPT_READ_BYTES` of the files are kept in memory; the others are read again. A result holds texts and counts,
neither mission nor terrain, so memory does not grow with the number of files.

A `Form` is the form of a result: the lines of each file, a row of JSON, or the whole JSON document.
"""

from __future__ import annotations

import hashlib
import pickle
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, TypeVar

import numpy as np

from gcsplan.app.check.files import Batch, Failing, failing_of, failing_to_read, finding_lines, more_of
from gcsplan.app.check.verdict_json import verdict_of
from gcsplan.app.check.worlds import (
    Checked,
    CheckSite,
    MissionSite,
    OptionsSite,
    Returns,
    VerdictParts,
    beyond_m,
    match,
    places_of,
)
from gcsplan.app.parallel.executor import Executor, in_order, require_same_inputs
from gcsplan.app.plan.way_home import is_required
from gcsplan.arrays import Floats
from gcsplan.errors import GcsplanError, InputError, UsageError, worst_of
from gcsplan.export.summary import json_of
from gcsplan.figures import counted
from gcsplan.mavlink.files.file_items import MissionFileRead
from gcsplan.mission_file import MissionFile
from gcsplan.mission_file.load import load_content
from gcsplan.mission_file.options_world import WorldExtent, WorldOptions
from gcsplan.mission_file.request import Content
from gcsplan.notes.note import Note
from gcsplan.units import METRIC, Units
from gcsplan.vehicle import Autopilot

__all__ = ["Archive", "FileResult", "Form", "Shown", "Summary", "results_of_batch"]

OUTCOMES = {0: "pass", 4: "do not pass", 2: "cannot be read", 70: "met a bug of gcsplan"}
"""The outcome of a file, by exit code."""


@dataclass(frozen=True, slots=True)
class FileResult:
    """The result of one file: its exit code, and how many findings of each kind it has.

    ``lines`` are its findings, as with ``-q``, and ``error`` says why it was not judged. ``text`` is its JSON, empty
    in the form ``lines``. ``failing`` is None if it passes.
    """

    file: str
    code: int
    kinds: Mapping[str, int]
    lines: tuple[str, ...] = ()
    error: GcsplanError | None = None
    text: str = ""
    failing: Failing | None = None


def result_of(c: Checked, form: str, *, allow_unjudged: bool, units: Units) -> FileResult:
    """The result of a file that was judged, in a `Form`."""
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
    return FileResult(str(c.file), code, dict(kinds), lines, None, text, failing)


def results_of_batch(batch: Batch, form: str, *, allow_unjudged: bool, units: Units) -> Iterator[FileResult]:
    """The results of a batch: first the files that were judged, then the files that could not be read."""
    for c in batch.checked:
        yield result_of(c, form, allow_unjudged=allow_unjudged, units=units)
    for argument, error in batch.unreadable:
        yield result_of_error(argument, error, form)


def result_of_error(argument: str, why: GcsplanError, form: str) -> FileResult:
    """The result of a file that was not judged, and why."""
    kind = "unreadable" if isinstance(why, InputError) else "internal"
    row = {"file": argument, "code": why.exit_code, "error": why.as_dict()}
    text = json_of(row, "verdicts", lines=False) if form == "row" else ""
    return FileResult(argument, why.exit_code, {kind: 1}, (), why, text, failing_to_read(argument, why))


@dataclass(slots=True)
class Summary:
    """How many files there were, with which outcome and which findings."""

    files: int = 0
    codes: Counter[int] = field(default_factory=Counter)
    with_kind: Counter[str] = field(default_factory=Counter)
    of_kind: Counter[str] = field(default_factory=Counter)

    def add(self, result: FileResult) -> None:
        """Count one more file."""
        self.files += 1
        self.codes[result.code] += 1
        self.with_kind.update(result.kinds.keys())
        self.of_kind.update(result.kinds)

    @property
    def code(self) -> int:
        """The worst exit code."""
        return worst_of(self.codes)

    def as_dict(self) -> dict[str, Any]:
        """The summary as ``--json`` prints it, the commonest finding first."""
        kinds = sorted(self.with_kind, key=lambda kind: (-self.with_kind[kind], kind))
        return {
            "files": self.files,
            "codes": {str(code): self.codes[code] for code in sorted(self.codes)},
            "findings": {k: {"files": self.with_kind[k], "findings": self.of_kind[k]} for k in kinds},
        }

    def lines(self) -> list[str]:
        """The summary as lines for people."""
        outcomes = [f"{self.codes[code]} {words}" for code, words in OUTCOMES.items() if self.codes[code]]
        lines = [f"{counted(self.files, 'file')}: {', '.join(outcomes) or 'none'}"]
        found = self.as_dict()["findings"]
        wide = max(map(len, found), default=0)
        for kind, count in found.items():
            files, findings = counted(count["files"], "file"), counted(count["findings"], "finding")
            lines.append(f"  {kind:{wide}}  in {files}, {findings}")
        return lines


MOST_FILES = 100_000
KEPT_READ_BYTES = 64_000_000
"""Most bytes of read files that wait in memory until they are judged: some 20,000 files of 50 items."""

PIECE, PIECE_HOME = 32, 2
"""Number of files in a piece of work; the second number with the way home, which takes about 1 s for each file."""

FILE_S, FILE_HOME_S = 0.006, 1.0
"""Seconds that a file of 50 items takes, about; the second number with the way home."""

Done = TypeVar("Done")
Form = Literal["lines", "row", "whole"]
"""The form of a file's result: the lines of its findings, those lines with a row of JSON, or its JSON document."""


@dataclass(frozen=True, slots=True)
class Shown:
    """How results are shown; with ``several`` files a bug of ours in one of them does not end the others."""

    form: Form = "lines"
    allow_unjudged: bool = False
    units: Units = METRIC
    several: bool = True


@dataclass(frozen=True, slots=True)
class ArchiveRequest:
    """The part of a request that all files share: a mission's content, or options, from which any process makes a site.

    ``extent``: the extent of the world that options describe, if all files share one; ``inputs``: the sources that the
    world must have. ``key``: a digest of the content and the options.
    """

    content: Content | None
    options: WorldOptions | None
    autopilot: Autopilot | None
    returns: Returns
    shown: Shown
    extent: WorldExtent | None = None
    inputs: Mapping[str, object] | None = None
    key: str = ""


@dataclass(frozen=True, slots=True)
class Read:
    """A file that was read: its mission, pickled (empty if it takes too much memory), and the places that it visits."""

    packed: bytes
    places: Floats
    reach_m: float


sites: dict[str, CheckSite] = {}
"""The site that this process has made for others; the last one only, for terrain is large."""


class Archive:
    """Files that are checked in one call, at one site."""

    def __init__(self, name: str, request: ArchiveRequest, site: CheckSite, arguments: Sequence[str]) -> None:
        if len(arguments) > MOST_FILES:
            raise UsageError(f"at most {MOST_FILES} files are checked in one call, given {len(arguments)}")
        self.name, self.request, self.site, self.arguments = name, _keep(request, site), site, arguments
        self.packed: dict[int, bytes] = {}
        self._unread: dict[int, FileResult] = {}

    @classmethod
    def in_mission(cls, source: MissionFile, arguments: Sequence[str], returns: Returns, shown: Shown) -> Archive:
        """Files FILE or NAME=FILE in the world of a mission. Raises UsageError if a file's vehicle is not clear."""
        for argument in arguments:
            match(source, argument)
        returns = replace(returns, required=is_required(source, returns.required))
        return cls(
            source.name, ArchiveRequest(source.content, None, None, returns, shown), MissionSite(source), arguments
        )

    @classmethod
    def with_options(
        cls, options: WorldOptions, autopilot: Autopilot | None, arguments: Sequence[str], returns: Returns,
        shown: Shown,
    ) -> Archive:  # fmt: skip
        """Files in the world that options describe. Raises InputError if they are wrong."""
        request = ArchiveRequest(None, options, autopilot, returns, shown)
        return cls("check", request, OptionsSite(options, autopilot), arguments)

    @property
    def work(self) -> tuple[int, float]:
        """The number of pieces of work, and the seconds that one of them takes, about."""
        size = self._size
        return -(-len(self.arguments) // size), size * (FILE_S if size == PIECE else FILE_HOME_S)

    @property
    def _size(self) -> int:
        return PIECE_HOME if self.request.returns.judged or self.request.returns.required else PIECE

    def read(self, workers: Executor, on_read: Callable[[int], None] = lambda _: None) -> None:
        """Read all files and load the world that they need; ``on_read(count)`` is called after each piece.

        Raises InputError if there is no world for any of them.
        """
        pieces = [self.arguments[k : k + PIECE] for k in range(0, len(self.arguments), PIECE)]
        places: list[Floats] = []
        reach_m, kept = 0.0, 0
        for number, found in in_order(workers.each(read_piece, self.request, pieces)):
            for k, one in enumerate(found, number * PIECE):
                if isinstance(one, FileResult):
                    self._unread[k] = one
                    continue
                places.append(one.places)
                reach_m = max(reach_m, one.reach_m)
                if (kept := kept + len(one.packed)) <= KEPT_READ_BYTES:
                    self.packed[k] = one.packed
            on_read(min((number + 1) * PIECE, len(self.arguments)))
        if places:
            self.site.settle(np.concatenate(places), reach_m, several=len(places) > 1)
        self._settled()

    def _settled(self) -> None:
        """Put the world that was found into the request."""
        request = self.request
        if isinstance(self.site, OptionsSite):
            extent = self.site.extent
            request = replace(request, extent=extent, inputs=self.site.sources[0] if extent is not None else None)
        elif isinstance(self.site, MissionSite):
            request = replace(request, content=self.site.source.content, inputs=self.site.sources[0])
        self.request = _keep(request, self.site)

    @property
    def sources(self) -> tuple[Mapping[str, object], tuple[Note, ...]]:
        """The sources of the world, and notes on them; the first file's, if each file has a world of its own."""
        site = self.site
        for k in range(len(self.arguments) if isinstance(site, OptionsSite) and not site.sources[0] else 0):
            if k in self._unread:
                continue
            try:
                read = _unpacked(site, self.arguments[k], self.packed.get(k))
                site.judged(self.arguments[k], read, VerdictParts(misses=False, times=False))
            except InputError:
                continue
            break
        return site.sources

    def judged(self, workers: Executor) -> Iterator[FileResult]:
        """The result of every file, in their order. Raises GcsplanError where `Executor.each` does."""
        numbers = [k for k in range(len(self.arguments)) if k not in self._unread]
        size = self._size
        pieces = [
            [(self.arguments[k], self.packed.get(k)) for k in numbers[i : i + size]]
            for i in range(0, len(numbers), size)
        ]
        found = (one for _, piece in in_order(workers.each(judge_piece, self.request, pieces)) for one in piece)
        for k in range(len(self.arguments)):
            yield self._unread[k] if k in self._unread else next(found)


def read_piece(request: ArchiveRequest, arguments: Sequence[str]) -> list[Read | FileResult]:
    """Read some files, in any process; a file that cannot be read has its result at once."""
    site = _site_of(request)
    return [_result_unless(request, argument, partial(_read, site, argument)) for argument in arguments]


def judge_piece(request: ArchiveRequest, items: Sequence[tuple[str, bytes | None]]) -> list[FileResult]:
    """Judge some files that were read, in any process."""
    site = _site_of(request)
    shown = request.shown
    whole = shown.form == "whole"
    parts = VerdictParts(request.returns, misses=whole, times=whole)

    def judged(argument: str, packed: bytes | None) -> FileResult:
        checked = site.judged(argument, _unpacked(site, argument, packed), parts)
        return result_of(checked, shown.form, allow_unjudged=shown.allow_unjudged, units=shown.units)

    return [_result_unless(request, argument, partial(judged, argument, packed)) for argument, packed in items]


def _result_unless(request: ArchiveRequest, argument: str, done: Callable[[], Done]) -> Done | FileResult:
    """The result of a step, or the result that names its error: one bad file must not cost the others."""
    try:
        return done()
    except InputError as why:
        return result_of_error(argument, why, request.shown.form)
    except (MemoryError, UsageError):
        raise
    except Exception as why:
        if not request.shown.several:
            raise
        words = f"internal error, a bug in gcsplan: {type(why).__name__}: {why}"
        return result_of_error(argument, GcsplanError(words, where=argument), request.shown.form)


def _read(site: CheckSite, argument: str) -> Read:
    read = site.read(argument)
    places = np.array(places_of(read.mission), float)
    return Read(pickle.dumps(read, pickle.HIGHEST_PROTOCOL), places, beyond_m(read.mission))


def _unpacked(site: CheckSite, argument: str, packed: bytes | None) -> MissionFileRead:
    """The mission of a file, from this process or from a worker; read again if it was not kept."""
    if packed is None:
        return site.read(argument)
    read: MissionFileRead = pickle.loads(packed)
    return read


def _keep(request: ArchiveRequest, site: CheckSite) -> ArchiveRequest:
    """``request`` with its key, by which `_site_of` then finds ``site`` in this process."""
    made_of = request.content, request.options, request.autopilot
    request = replace(request, key=hashlib.sha256(pickle.dumps(made_of)).hexdigest())
    sites.clear()
    sites[request.key] = site
    return request


def _site_of(request: ArchiveRequest) -> CheckSite:
    """The site of a request, with its world if that is known; made once in each process."""
    site = sites.get(request.key)
    if site is None:
        if request.content is not None:
            site = MissionSite(load_content(request.content))
        else:
            assert request.options is not None
            site = OptionsSite(request.options, request.autopilot)
        _keep(request, site)
    if isinstance(site, OptionsSite) and request.extent is not None and request.extent != site.extent:
        site.settle_in(request.extent)
    if request.inputs is not None:
        require_same_inputs(
            site.sources[0], request.inputs, "--dem" if request.content is None else request.content.where
        )
    return site
