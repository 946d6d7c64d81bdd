"""Plan many mission files: each is a piece of work of its own, and a bad one never stops the others.

Only this process writes; workers send the files' texts. A `Record` of each planned mission keeps its sources and its
outputs. A mission is not planned again if no file that it reads, no option and no output of it has changed. A record
is written before the outputs change and names their digests, so that a run that is killed in between, and whoever else
writes into the mission's folder, leaves a record that does not hold. A record holds if the request, the files that
were read and the outputs are unchanged; a record with anything odd in it counts as none.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan import __version__
from gcsplan.app.fleet.may_fly import flyable
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.named_files import named_files
from gcsplan.app.output import files as outputs
from gcsplan.app.parallel.executor import Executor
from gcsplan.app.plan.model import Plan, PlanOptions
from gcsplan.errors import GcsplanError, InputError, NoMission, UsageError, worst_of
from gcsplan.export.durable import locked, write_whole
from gcsplan.export.outdir import has_outputs, is_output, retire_outputs, settle_outputs, write_outputs
from gcsplan.mission_file.source import file_of, is_sample
from gcsplan.report.views.shaded_terrain import GroundPatch
from gcsplan.world.terrain.input_files import SPECIAL, FileReading, reading

__all__ = [
    "BATCH_COLUMNS",
    "MISSION_S",
    "BatchOptions",
    "MissionBatch",
    "Record",
    "columns_of",
    "exit_code",
    "missions_of",
    "record_of",
]

FOLDER = "records"
"""The folder within the batch's directory that says what is done."""

BATCH_TABLES = ("results.csv", "results.parquet", "index.html")
"""The files of a batch beside the folders of its missions."""

FORMAT = 4
MOST_BYTES_OF_A_RECORD = 64_000_000


@dataclass(frozen=True, slots=True)
class Record:
    """The result of one mission: a row for each vehicle (one without a vehicle if there is no mission), and tracks.

    ``request`` is the digest of `request_of`; ``inputs`` are the marks of all files that were read for the mission
    (`gcsplan.world.terrain.input_files`; None: not known, and planned again next time). ``code`` is the exit code that
    `plan` would end with. ``files`` are the outputs, name to text, empty if they are on disk already. ``tracks`` are
    lists of [latitude, longitude], one for each of the first rows; the vehicles of the other rows are left out.
    ``ground`` is the ground under them, None if none is known.
    """

    mission: str
    request: str
    code: int
    rows: tuple[Mapping[str, Any], ...]
    tracks: tuple[Sequence[Sequence[float]], ...] = ()
    files: Mapping[str, str] | None = None
    inputs: Mapping[str, str] | None = None
    ground: GroundPatch | None = None


def write_record(directory: Path, record: Record) -> None:
    """Write the record of a mission whose outputs are about to change. Raises OSError and InputError."""
    file = _file_of(directory, record.mission)
    file.parent.mkdir(parents=True, exist_ok=True)
    inputs = None if record.inputs is None else list(record.inputs.items())
    body = json.dumps(
        {
            "asked": record.request, "inputs": inputs, "outputs": digests_of(record.files or {}), "code": record.code,
            "rows": record.rows, "tracks": record.tracks, "ground": record.ground and asdict(record.ground),
        },
        default=dict,
    )  # fmt: skip
    # The body is a text within, so that its digest is of these very bytes.
    write_whole(file, json.dumps({"format": FORMAT, "sha256": _sha256(body), "body": body}) + "\n")


def kept_record(directory: Path, mission: str, request: str) -> Record | None:
    """The record of an earlier run; None unless it is of the same ``request``, and nothing has changed since."""
    try:
        with _file_of(directory, mission).open("rb") as file:
            kept = json.loads(file.read(MOST_BYTES_OF_A_RECORD))
        if not isinstance(kept, dict) or kept.get("format") != FORMAT or not isinstance(kept.get("body"), str):
            return None
        if kept.get("sha256") != _sha256(kept["body"]):
            return None
        body = json.loads(kept["body"])
        if body["asked"] != request or not body["inputs"]:
            return None
        inputs, outputs = dict(body["inputs"]), dict(body["outputs"])
        ground = body["ground"] and GroundPatch(tuple(body["ground"]["box_deg"]), body["ground"]["heights"])
        record = Record(
            mission, request, body["code"], tuple(body["rows"]), tuple(body["tracks"]), inputs=inputs, ground=ground
        )
        if type(record.code) is not int or not record.rows or any(row["mission"] != mission for row in record.rows):
            return None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    if not has_outputs(directory / mission, outputs) or SPECIAL in inputs.values() or FileReading.changed(inputs):
        return None
    return record


def digests_of(files: Mapping[str, str]) -> dict[str, str]:
    """The SHA-256 of every output."""
    return {name: _sha256(text) for name, text in files.items()}


def fault_of_name(name: str, missions: set[str]) -> str:
    """Why a mission of this name cannot be beside the batch's own files and the others'; empty if it can.

    ``missions`` are the names of all, in lower case, for some disks ignore case.
    """
    parts = name.casefold().split("/")
    if parts[0] in (FOLDER, *BATCH_TABLES):
        return f"{name.split('/')[0]} is a name of the batch's own files; rename the mission, or its folder"
    for k, part in enumerate(parts):
        above = "/".join(parts[:k])
        if part.startswith(".gcsplan"):
            return f"names that begin with .gcsplan are gcsplan's own, given {part}; rename the mission, or its folder"
        if above in missions and is_output(part):
            return f"{part} is a name of the files that the mission {above} writes; rename the one or the other"
        if k and part and above.endswith(".json") and above[: -len(".json")] in missions:
            return f"{above} is the name of another mission's record; rename the folder"
    return ""


def _file_of(directory: Path, mission: str) -> Path:
    return directory / FOLDER / f"{mission}.json"


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


RECORD_RULES = 4
"""Counts the changes of what lets a mission fly: records of earlier rules do not hold."""

MISSION_S = 0.4
"""Seconds that a mission takes, about: 0.16 over hills (`bench scale`), 0.6 in mountains with margins."""

POINTS = 60
"""Most points of a track on the index page."""

MOST_MISSIONS = 100_000


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """``plan``: what overrides every mission file's own settings. ``report``: a page for each mission."""

    plan: PlanOptions = field(default_factory=PlanOptions)
    report: bool = False
    allow_unjudged: bool = False


def missions_of(given: Sequence[str]) -> list[tuple[str, Path]]:
    """Name and path of every mission that files, folders (their ``*.yaml``) and patterns name, each once, in order.

    Names are the paths without suffix from the folder that all have in common. Raises UsageError for none.
    """
    found: dict[Path, None] = {}
    for text in given:
        for path in _named(text):
            found.setdefault(path.resolve())
            if len(found) > MOST_MISSIONS:
                raise UsageError(f"a batch has at most {MOST_MISSIONS} missions; {text} leads beyond that")
    paths = list(found)
    if not paths:
        raise UsageError(f"no mission file is named by {', '.join(given)}")
    common = Path(os.path.commonpath([p.parent for p in paths]))
    names = [p.relative_to(common).with_suffix("").as_posix() for p in paths]
    twice = sorted({n for n in names if names.count(n) > 1}) if len(set(names)) < len(names) else []
    if twice:
        raise UsageError(f"two missions differ by their suffix alone: {twice[0]}; rename one")
    return list(zip(names, paths, strict=True))


def _named(text: str) -> list[Path]:
    if is_sample(text):
        return [file_of(text)]
    return named_files(text, (".yaml",))


@dataclass(frozen=True, slots=True)
class MissionBatch:
    """The missions of a batch and the directory of its results."""

    missions: Sequence[tuple[str, Path]]
    directory: Path
    options: BatchOptions

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Make the directory, and keep other batches out of it meanwhile. Raises InputError if one is at work there."""
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
        except OSError as why:
            raise InputError(f"cannot be made: {why.strerror or why}", where=str(self.directory)) from why
        with locked(self.directory):
            yield

    def run(self, workers: Executor, todo: Sequence[int], on_done: Callable[[Record], None]) -> None:
        """Plan the missions with the numbers ``todo``; write each as it is planned, then call ``on_done``."""
        names = {name.casefold() for name, _ in self.missions}
        good = []
        for number in todo:
            name, _ = self.missions[number]
            fault = fault_of_name(name, names)
            if fault:
                on_done(_failed(name, "", InputError(fault)))
            else:
                good.append(number)
        items = [(self.missions[k][0], str(self.missions[k][1])) for k in good]

        def lost(item: tuple[str, str], why: GcsplanError) -> Record:
            return _failed(item[0], request_of(item[1], self.options), why)

        for _, record in workers.each(record_of, self.options, items, lost=lost):
            on_done(self._written(record))

    def known(self) -> tuple[list[Record], list[int]]:
        """The records that still hold, and the numbers of the missions that must be planned."""
        kept: list[Record] = []
        todo: list[int] = []
        for number, (name, path) in enumerate(self.missions):
            record = kept_record(self.directory, name, request_of(path, self.options))
            if record is not None:
                kept.append(record)
            else:
                todo.append(number)
        return kept, todo

    def _written(self, record: Record) -> Record:
        """Write a mission's record, and then its outputs, or move earlier ones out of the way.

        What cannot be written is that mission's failure, and its earlier outputs leave if they can.
        """
        out = self.directory / record.mission
        changed = FileReading.changed(record.inputs or {})
        if changed:
            words = (
                f"{changed} is not what was read here: it changed while the mission was planned, or a worker of the "
                "cluster sees another file there; run the same command again"
            )
            record = _failed(record.mission, record.request, InputError(words))
        try:
            settle_outputs(out)
            write_record(self.directory, record)
            if record.files:
                write_outputs(out, record.files)
            else:
                retire_outputs(out)
        except (OSError, ValueError, GcsplanError) as why:
            with suppress(OSError, GcsplanError):
                retire_outputs(out)
            record = _failed(record.mission, record.request, InputError(f"cannot be written: {why}", where=str(out)))
        return replace(record, files=None)


def request_of(path: str | Path, options: BatchOptions) -> str:
    """A digest of the request beside the content of files: which mission, the options, the version."""
    request = repr((__version__, RECORD_RULES, options, os.path.abspath(path)))
    return hashlib.sha256(request.encode("utf-8", "surrogatepass")).hexdigest()


def record_of(options: BatchOptions, item: tuple[str, str]) -> Record:
    """Plan one mission, in whatever process; every failure becomes a row."""
    name, file = item
    request = request_of(file, options)
    with reading() as read:
        try:
            planned = plan(file, **asdict(options.plan))
            planned, homes = flyable(planned, allow_unjudged=options.allow_unjudged, home=options.report)
            files = outputs.outputs_of(planned, homes)
            if options.report:
                files["report.html"] = outputs.report_of(planned, (), homes)
        except GcsplanError as why:
            return _failed(name, request, why, read)
        except Exception as why:  # a bug of ours in one mission must not cost the others
            words = f"internal error, a bug in gcsplan: {type(why).__name__}: {why}"
            row = _refusal(name, 70, "internal", words)
            return Record(name, request, 70, (row,), inputs=read.marks)
    out = [_refusal(name, NoMission.exit_code, v.reason, v.message, v.name) for v in planned.left_out]
    code = NoMission.exit_code if out else 0
    rows = (*_rows(name, files["summary.json"]), *out)
    tracks = tuple(_tracks(planned))
    return Record(name, request, code, rows, tracks, files, read.marks, GroundPatch.under(planned.world, tracks))


def _failed(name: str, request: str, why: GcsplanError, read: FileReading | None = None) -> Record:
    """The record of a mission without a plan; without ``read`` it is tried again next time."""
    row = _refusal(name, why.exit_code, why.reason, str(why))
    return Record(name, request, why.exit_code, (row,), inputs=None if read is None else read.marks)


BATCH_COLUMNS = (
    "mission", "vehicle", "code", "verdict", "reason", "message", "length_m", "gap_percent", "energy_j",
    "flight_energy_j", "energy_figures", "battery_used_percent", "min_agl_m", "max_agl_m", "min_zone_clearance_m",
    "min_zone_height_m",
    "max_climb_deg", "speed_m_s", "depart_s", "arrive_s", "items", "stopped_by", "safe", "return_safe",
)  # fmt: skip
"""The columns of the table of results."""

WINDOW_COLUMNS = ("arrive_earliest_s", "arrive_latest_s")
"""The last columns of the table, where a mission declares winds."""


def columns_of(rows: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """The columns of the table of these results."""
    return BATCH_COLUMNS + (WINDOW_COLUMNS if any(column in row for row in rows for column in WINDOW_COLUMNS) else ())


def _refusal(name: str, code: int, reason: str, message: str, vehicle: str = "") -> dict[str, Any]:
    verdict = {3: "no mission", 4: "not safe"}.get(code, "error")
    return {"mission": name, "vehicle": vehicle, "code": code, "verdict": verdict, "reason": reason, "message": message}


def _rows(name: str, summary: str) -> list[dict[str, Any]]:
    """One row for each vehicle, out of the summary's text, so that both have the same numbers."""
    rows = []
    for done in json.loads(summary)["vehicles"]:
        row = {"mission": name, "vehicle": done["name"], "code": 0, "reason": "", "message": ""}
        row |= {"return_safe": done.get("way_home", {}).get("safe")}
        rows.append(row | {key: done[key] for key in BATCH_COLUMNS + WINDOW_COLUMNS if key in done})
    return rows


def _tracks(planned: Plan) -> list[list[list[float]]]:
    """Every vehicle's track over ground, thinned to `POINTS`: for a map of the whole batch, not for flying."""
    found = []
    for v in planned.vehicles:
        legs = v.verdict.legs
        places = np.array([legs[0].start[:2], *(leg.end[:2] for leg in legs)])
        keep = np.unique(np.linspace(0, len(places) - 1, min(POINTS, len(places))).round().astype(int))
        found.append(np.round(places[keep], 5).tolist())
    return found


def exit_code(records: Sequence[Record]) -> int:
    """The worst code of all missions."""
    return worst_of({r.code for r in records})
