"""Plan many mission files: each is a piece of work of its own, and a bad one never stops the others.

What is done is kept: a file whose content, terrain, zones and options are unchanged is not planned again. Only this
process writes; workers send the files' texts.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan import __version__
from gcsplan.app import outputs
from gcsplan.app.executor import Executor
from gcsplan.app.flying import flyable
from gcsplan.app.model import Plan
from gcsplan.app.named_files import named_files
from gcsplan.app.pipeline import plan
from gcsplan.errors import GcsplanError, InputError, NoMission, UsageError, worst_of
from gcsplan.export.outdir import retire_outputs, settle_outputs, write_outputs, write_whole
from gcsplan.mission_file.read_files import files_of
from gcsplan.mission_file.samples import file_of, is_sample

__all__ = ["Batch", "BatchOptions", "Record", "exit_code", "missions_of"]

FOLDER = "records"
"""The folder within the batch's directory that says what is done."""

RULES = 3
"""Counts the changes of what lets a mission fly: records of earlier rules do not hold."""

PIECE_S = 0.4
"""Seconds that a mission takes, about: 0.16 over hills (`bench scale`), 0.6 in mountains with margins."""

POINTS = 60
"""Most points of a track on the index page."""

MOST_MISSIONS = 100_000


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """What overrides every mission file's own settings, as in `plan`; ``report``: a page for each mission."""

    planner: str | None = None
    objective: str | None = None
    seed: int | None = None
    report: bool = False
    allow_unjudged: bool = False
    at: str | None = None


@dataclass(frozen=True, slots=True)
class Record:
    """The result of one mission: a row for each vehicle (one without a vehicle if there is no mission), and tracks.

    ``code`` is the exit code that `plan` would end with; ``files`` are the outputs, name to text, empty if they are on
    disk already. ``tracks`` are lists of [latitude, longitude], one for each of the first rows; the vehicles of the
    other rows are left out.
    """

    mission: str
    key: str
    code: int
    rows: tuple[Mapping[str, Any], ...]
    tracks: tuple[Sequence[Sequence[float]], ...] = ()
    files: Mapping[str, str] | None = None


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
class Batch:
    """The missions of a batch and the directory of its results."""

    missions: Sequence[tuple[str, Path]]
    directory: Path
    options: BatchOptions

    def run(self, workers: Executor, todo: Sequence[int], told: Callable[[Record], None]) -> None:
        """Plan the missions with the numbers ``todo``; each is written, then ``told``, as it is done."""
        items = [(self.missions[k][0], str(self.missions[k][1])) for k in todo]

        def lost(item: tuple[str, str], why: GcsplanError) -> Record:
            row = _refusal(item[0], why.exit_code, why.reason, str(why))
            return Record(item[0], key_of(Path(item[1]), self.options), why.exit_code, (row,))

        for number, record in workers.each(record_of, self.options, items, lost=lost):
            told(self._written(record, todo[number]))

    def known(self) -> tuple[list[Record], list[int]]:
        """The records that still hold, and the numbers of the missions that must be planned."""
        kept: list[Record] = []
        todo: list[int] = []
        for number, (name, path) in enumerate(self.missions):
            record = self._kept(name)
            if record is not None and record.key == key_of(path, self.options):
                kept.append(record)
            else:
                todo.append(number)
        return kept, todo

    def _kept(self, name: str) -> Record | None:
        """The record of an earlier run; None if there is none, or if its outputs are gone."""
        try:
            given = json.loads(self._record_file(name).read_text(encoding="utf-8"))
            record = Record(name, given["key"], given["code"], tuple(given["rows"]), tuple(given["tracks"]))
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if record.tracks and not (self.directory / name / "summary.json").is_file():
            return None
        return record

    def _record_file(self, name: str) -> Path:
        return self.directory / FOLDER / f"{name}.json"

    def _written(self, record: Record, number: int) -> Record:
        """Write a mission's outputs, or move earlier ones out of the way, and then its record."""
        out = self.directory / self.missions[number][0]
        try:
            settle_outputs(out)
            if record.files:
                write_outputs(out, record.files)
            else:
                retire_outputs(out)
            file = self._record_file(record.mission)
            file.parent.mkdir(parents=True, exist_ok=True)
            kept = {"key": record.key, "code": record.code, "rows": record.rows, "tracks": record.tracks}
            write_whole(file, json.dumps(kept, indent=1, default=dict))
        except (OSError, GcsplanError) as why:
            raise InputError(f"cannot be written: {why}", where=str(out)) from why
        return Record(record.mission, record.key, record.code, record.rows, record.tracks)


def key_of(path: Path, options: BatchOptions) -> str:
    """A digest of all that a result depends on: the file, the files that it names (size and time), options, version."""
    digest = hashlib.sha256(repr((__version__, RULES, options)).encode())
    try:
        digest.update(path.read_bytes())
        for file in files_of(path):
            about = file.stat()
            digest.update(repr((str(file), about.st_size, about.st_mtime_ns)).encode())
    except (OSError, GcsplanError) as why:
        digest.update(repr(why).encode())
    return digest.hexdigest()


def record_of(options: BatchOptions, item: tuple[str, str]) -> Record:
    """Plan one mission, in whatever process; every failure becomes a row."""
    name, file = item
    key = key_of(Path(file), options)  # of what is planned now: since `known` read it, the file may have changed
    try:
        planned = plan(
            file, planner=options.planner, objective=options.objective, seed=options.seed, at=options.at,
        )  # fmt: skip
        planned, homes = flyable(planned, allow_unjudged=options.allow_unjudged, asked=options.report)
        files = outputs.outputs_of(planned, homes)
        if options.report:
            files["report.html"] = outputs.report_of(planned, (), homes)
    except GcsplanError as why:
        return Record(name, key, why.exit_code, (_refusal(name, why.exit_code, why.reason, str(why)),))
    except Exception as why:  # a bug of ours in one mission must not cost the others
        words = f"internal error, a bug in gcsplan: {type(why).__name__}: {why}"
        return Record(name, key, 70, (_refusal(name, 70, "internal", words),))
    out = [_refusal(name, NoMission.exit_code, v.reason, v.message, v.name) for v in planned.left_out]
    code = NoMission.exit_code if out else 0
    return Record(name, key, code, (*_rows(name, files["summary.json"]), *out), tuple(_tracks(planned)), files)


COLUMNS = (
    "mission", "vehicle", "code", "verdict", "reason", "message", "length_m", "gap_percent", "energy_j",
    "flight_energy_j", "battery_used_percent", "min_agl_m", "max_agl_m", "min_zone_clearance_m", "min_zone_height_m",
    "max_climb_deg", "speed_m_s", "depart_s", "arrive_s", "items", "stopped_by", "safe", "return_safe",
)  # fmt: skip
"""The columns of the table of results."""


def _refusal(name: str, code: int, reason: str, message: str, vehicle: str = "") -> dict[str, Any]:
    verdict = {3: "no mission", 4: "not safe"}.get(code, "error")
    return {"mission": name, "vehicle": vehicle, "code": code, "verdict": verdict, "reason": reason, "message": message}


def _rows(name: str, summary: str) -> list[dict[str, Any]]:
    """One row for each vehicle, out of the summary's text, so that both have the same numbers."""
    rows = []
    for told in json.loads(summary)["vehicles"]:
        row = {"mission": name, "vehicle": told["name"], "code": 0, "reason": "", "message": ""}
        row |= {"return_safe": told.get("way_home", {}).get("safe")}
        rows.append(row | {key: told[key] for key in COLUMNS if key in told})
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
