"""What a batch has done: a record of each mission, of what it was made of, and which outputs it has.

A record is written before the outputs change and names their digests, so that a run that is killed in between, and
whoever else writes into the mission's folder, leaves a record that does not hold. A record holds if nothing that is
asked, no file that was read and no output has changed; whatever is odd in one counts as none.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcsplan.export.durable import write_whole
from gcsplan.export.outdir import has_outputs, is_output
from gcsplan.world.terrain.input_files import SPECIAL, FileReading

__all__ = ["FOLDER", "TABLES", "Record", "digests_of", "fault_of_name", "kept_record", "write_record"]

FOLDER = "records"
"""The folder within the batch's directory that says what is done."""

TABLES = ("results.csv", "results.parquet", "index.html")
"""The files of a batch beside the folders of its missions."""

FORMAT = 3
MOST_BYTES = 64_000_000


@dataclass(frozen=True, slots=True)
class Record:
    """The result of one mission: a row for each vehicle (one without a vehicle if there is no mission), and tracks.

    ``asked`` is a digest of what was asked for; ``inputs`` are the marks of all files that were read for it
    (`gcsplan.world.terrain.input_files`; None: not known, and planned again next time). ``code`` is the exit code that
    `plan` would end with. ``files`` are the outputs, name to text, empty if they are on disk already. ``tracks`` are
    lists of [latitude, longitude], one for each of the first rows; the vehicles of the other rows are left out.
    """

    mission: str
    asked: str
    code: int
    rows: tuple[Mapping[str, Any], ...]
    tracks: tuple[Sequence[Sequence[float]], ...] = ()
    files: Mapping[str, str] | None = None
    inputs: Mapping[str, str] | None = None


def write_record(directory: Path, record: Record) -> None:
    """Write the record of a mission whose outputs are about to change. Raises OSError and InputError."""
    file = _file_of(directory, record.mission)
    file.parent.mkdir(parents=True, exist_ok=True)
    inputs = None if record.inputs is None else list(record.inputs.items())
    body = json.dumps(
        {
            "asked": record.asked, "inputs": inputs, "outputs": digests_of(record.files or {}), "code": record.code,
            "rows": record.rows, "tracks": record.tracks,
        },
        default=dict,
    )  # fmt: skip
    # The body is a text within, so that its digest is of these very bytes.
    write_whole(file, json.dumps({"format": FORMAT, "sha256": _sha256(body), "body": body}) + "\n")


def kept_record(directory: Path, mission: str, asked: str) -> Record | None:
    """The record of an earlier run; None unless it is of what is ``asked`` now, and nothing has changed since."""
    try:
        with _file_of(directory, mission).open("rb") as file:
            kept = json.loads(file.read(MOST_BYTES))
        if not isinstance(kept, dict) or kept.get("format") != FORMAT or not isinstance(kept.get("body"), str):
            return None
        if kept.get("sha256") != _sha256(kept["body"]):
            return None
        body = json.loads(kept["body"])
        if body["asked"] != asked or not body["inputs"]:
            return None
        inputs, outputs = dict(body["inputs"]), dict(body["outputs"])
        record = Record(mission, asked, body["code"], tuple(body["rows"]), tuple(body["tracks"]), inputs=inputs)
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
    if parts[0] in (FOLDER, *TABLES):
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
