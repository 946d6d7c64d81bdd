"""Reading a mission file of either format, which is recognised by its content, not by its name."""

from __future__ import annotations

import os
import shlex
import stat
from dataclasses import replace
from os import PathLike
from pathlib import Path

from gcsplan.errors import InputError
from gcsplan.mavlink.files.file_items import MAX_FILE_BYTES, MissionFileRead, vtol_taken
from gcsplan.mavlink.files.plan_file import parse_plan, read_plan, write_plan
from gcsplan.mavlink.files.waypoints_file import parse_waypoints, read_waypoints, write_waypoints
from gcsplan.mavlink.mission.mission import Home
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot
from gcsplan.world.terrain.input_files import MISSION_FILES, TERRAIN_FILES, ZONES_BY_NAME

__all__ = [
    "MissionFileRead",
    "read_mission_file",
    "read_plan",
    "read_waypoints",
    "write_plan",
    "write_waypoints",
]


def read_mission_file(
    path: str | PathLike[str],
    *,
    autopilot: Autopilot | None,
    home_hint: Home | None = None,
    otherwise: Autopilot | None = None,
    data: bytes | None = None,
) -> MissionFileRead:
    """Read a `.waypoints` or `.plan` file; its content decides which it is. The mission is named after the file.

    ``autopilot`` None means the one that a `.plan` names. A `.waypoints` file names none: there, ``autopilot`` None
    means ``otherwise``, and the notes say so. ``home_hint`` is the home for a file that has none. ``data``: the content
    of a file that lies on no disk; ``path`` is then its name in messages. Raises InputError for every mistake, with
    line or key.
    """
    file = Path(path)
    where = str(path)
    text = _text(file, where, data)
    start = text.lstrip("\ufeff \t\r\n")[:40]
    if start.startswith("{"):
        read = parse_plan(text, autopilot=autopilot, where=where, home_hint=home_hint)
    elif start.startswith("QGC") or file.suffix.lower() in (".waypoints", ".txt"):
        taken = autopilot or otherwise
        if taken is None:
            raise InputError("a .waypoints file does not name its autopilot; say which it is", where=where)
        read = parse_waypoints(text, autopilot=taken, where=where, home_hint=home_hint)
        if autopilot is None:
            read = replace(read, notes=(*read.notes, Note("autopilot_taken", autopilot=taken.value)))
            read = replace(read, other_kind=vtol_taken(read.mission))
    else:
        raise InputError(
            f"neither a .waypoints file (first line 'QGC WPL 110') nor a .plan file (a JSON object){_instead(file)}",
            where=where,
        )
    return replace(read, mission=replace(read.mission, name=file.stem))


def _instead(file: Path) -> str:
    """The use of a file of another kind, by its name."""
    name, end = shlex.quote(str(file)), file.suffix.lower()
    if end in MISSION_FILES:
        return f"; a mission file comes first (gcsplan check {name} FILE), and gcsplan plan {name} makes such a file"
    if end in ZONES_BY_NAME:
        return f"; zones are given with --zones {name}, or in a mission file"
    return f"; terrain is given with --dem {name}, or in a mission file" if end in TERRAIN_FILES else ""


def _text(file: Path, where: str, data: bytes | None) -> str:
    try:
        regular = data is not None or stat.S_ISREG(file.stat().st_mode)
        if data is None:
            with open(file if regular else os.devnull, "rb") as stream:
                data = stream.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", where=where) from None
    except ValueError:
        raise InputError("not a file name", where=repr(where)) from None
    # A pipe or a device could block its reader for ever.
    if not regular:
        raise InputError("give a mission file: this is not a regular file", where=where)
    if len(data) > MAX_FILE_BYTES:
        raise InputError(f"a mission file of more than {MAX_FILE_BYTES // 10**6} MB is not read", where=where)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        words = f"not a text file in UTF-8 (byte {error.start}){_instead(file)}"
        raise InputError(words, where=where) from None
