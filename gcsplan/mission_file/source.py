"""The source of a mission: a file, a sample, its text, or a mapping made by a script; all become the same mapping.

``sample:NAME`` is a mission file that comes with gcsplan. They lie in ``missions/`` of the repository; the build copies
them into the package (pyproject.toml), so that they are there after ``pip install`` alone.

`what_else` says what another file is that is given where a mission file belongs, and which command or key takes it.
"""

from __future__ import annotations

import datetime
import os
import shlex
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from gcsplan.errors import PATH_KINDS, InputError, UsageError, require_kind, wrong_argument
from gcsplan.mission_file.memory_files import copied, with_rasters, with_zones
from gcsplan.mission_file.values.errors import read_section, unknown_keys
from gcsplan.mission_file.values.schema import PLAIN_PLANNER_KEYS, PlannerKeys, nearest, shown, text_keys
from gcsplan.mission_file.values.yaml import (
    MAX_YAML_BYTES,
    MAX_YAML_DEPTH,
    MAX_YAML_NODES,
    missing_space,
    number_or_text,
    read_yaml,
)
from gcsplan.world.terrain.input_files import LOG_FILES, TERRAIN_FILES, VEHICLE_FILES, ZONES_BY_NAME, tell_file

SAMPLE_PREFIX = "sample:"
SAMPLE_FOLDERS = (Path(__file__).parents[1] / "missions", Path(__file__).parents[2] / "missions")
"""Where the files are: within an installed package, or beside the sources."""


def sample_names() -> list[str]:
    """The names of all samples, without the prefix; those in a folder begin with its name (``papers/abo``)."""
    folder = _sample_folder()
    return sorted(file.relative_to(folder).with_suffix("").as_posix() for file in folder.rglob("*.yaml"))


def is_sample(source: str | os.PathLike[str]) -> bool:
    """Whether ``source`` names a sample; a file that is really called so keeps its meaning."""
    if not os.fspath(source).startswith(SAMPLE_PREFIX):
        return False
    tell_file(source)
    return not os.path.exists(source)


def file_of(source: str | os.PathLike[str]) -> Path:
    """The file that ``source`` names, a path or ``sample:NAME``. Raises InputError for a sample that does not exist."""
    if not is_sample(source):
        return Path(source)
    name = os.fspath(source).removeprefix(SAMPLE_PREFIX).replace(os.sep, "/")
    known = sample_names()
    if name not in known:
        near = nearest(name, known) or "."
        raise InputError(f"there is no such sample{near} There are: {', '.join(known)}", where=os.fspath(source))
    return _sample_folder() / f"{name}.yaml"


def sample_hint(file: Path) -> str:
    """``; did you mean sample:…?`` where a missing file has the name of a sample, or an empty text."""
    return f"; did you mean {SAMPLE_PREFIX}{file.stem}?" if file.stem in sample_names() else ""


def _sample_folder() -> Path:
    return next((folder for folder in SAMPLE_FOLDERS if folder.is_dir()), SAMPLE_FOLDERS[0])


MOST_OF_A_NAME = 300
"""Most characters of a file's name in a message, where the name may be what is wrong."""

MOST_BITS = 4096
"""Most bits of a whole number; Python makes no text of a number of thousands more."""

UNNAMED = Path("mission.yaml")
"""Path of a mission that has no file; files that the mission names are then found from the current folder."""


def read_content(
    source: str | os.PathLike[str] | Mapping[str, Any] | None,
    text: str | None,
    held: dict[str, bytes] | None = None,
) -> tuple[Path, str, dict[str, Any], str | None, dict[str, bytes]]:
    """The file, its name in messages, the mapping of keys, its text if it has one, and files that lie on no disk.

    ``held``: files that have names already.
    Raises InputError and UsageError as `load_mission`.
    """
    held = {} if held is None else held
    expected = "a path, the text of a mission file, or a mapping"
    if text is not None:
        require_kind("load_mission()", "text", text, str, "the text of a mission file")
    if isinstance(source, str) and ("\n" in source or "\r" in source):
        if text is not None:
            raise UsageError(
                "load_mission takes one text: the first argument is the file's path where text= is given", where="text"
            )
        source, text = None, source
    if isinstance(source, Mapping):
        if text is not None:
            raise UsageError("load_mission takes a mapping or a text, not both", where="text")
        file, where, raw = UNNAMED, "mission", _Plain(held).of(source, "mission", 0)
    elif isinstance(source, os.PathLike) or (isinstance(source, str) and source):
        require_kind("load_mission()", "source", source, PATH_KINDS, expected)
        file, where = Path(source), str(source)
        if text is None:
            file = file_of(source)
            text, raw = _read(file, where)
        else:
            raw = read_yaml(text, where=where)
    elif source is None and text is not None:
        file, where, raw = UNNAMED, "mission", read_yaml(text, where="mission")
    else:
        raise wrong_argument("load_mission()", "source", source, expected)
    if not isinstance(raw, dict):
        tight = missing_space(raw) if isinstance(raw, str) else ""
        words = f"a mission file is a mapping of keys (version, terrain, …), given {shown(raw)}"
        raise InputError(f"{words}; {tight}" if tight else words, where=where)
    return file, where, raw, text, held


def _read(file: Path, where: str) -> tuple[str, Any]:
    """The text of a file and what it says. Raises InputError; of a file of another kind one that says what takes it."""
    try:
        text = _text(file, where)
        raw = read_yaml(text, where=where)
    except InputError:
        other = what_else(file)
        if other:
            raise InputError(other, where=where) from None
        raise
    other = what_else(file, raw)
    if other:
        raise InputError(other, where=where)
    return text, raw


def _text(file: Path, where: str) -> str:
    tell_file(file)
    try:
        if file.is_dir():
            raise InputError("this is a folder; give a mission file (.yaml)", where=where)
        with file.open("rb") as opened:  # this does not read the file's size, since a pipe or a device has none
            data = opened.read(MAX_YAML_BYTES + 1)
        if len(data) > MAX_YAML_BYTES:
            raise InputError(f"a mission file has at most {MAX_YAML_BYTES} bytes, this one has more", where=where)
        return data.decode("utf-8-sig")
    except InputError:
        raise
    except UnicodeDecodeError as why:
        raise InputError(f"the file must be UTF-8 text, byte {why.start} is not", where=where) from None
    except FileNotFoundError:
        raise InputError(f"there is no such file{sample_hint(file)}", where=where) from None
    except (OSError, ValueError) as why:
        words = getattr(why, "strerror", None) or str(why)  # without the name, which stands before
        raise InputError(f"the file cannot be read: {words}", where=where[:MOST_OF_A_NAME]) from None


class _Plain:
    """Copies a script's mapping into YAML's types: tuples become lists, numpy's numbers become Python's.

    Terrain and zones that are objects become files in ``held``, and their names take their places.
    """

    def __init__(self, held: dict[str, bytes]) -> None:
        self._values, self._held = 0, held

    def of(self, value: Any, where: str, depth: int, key: str = "") -> Any:
        """``value`` of ``key`` at ``where``, which is ``depth`` levels deep. Raises InputError, also for what the
        value's own methods raise."""
        return copied(where, self._of, value, where, depth, key)

    def _of(self, value: Any, where: str, depth: int, key: str) -> Any:
        self._values += 1
        if depth == 1 and key in ("terrain", "no_fly", "keep_in"):
            value = (with_rasters if key == "terrain" else with_zones)(value, where, self._held)
        if depth > MAX_YAML_DEPTH or self._values > MAX_YAML_NODES:
            most = f"{MAX_YAML_DEPTH} levels deep" if depth > MAX_YAML_DEPTH else f"{MAX_YAML_NODES} values"
            raise InputError(f"the mission has more than {most}", where=where)
        if value is None or isinstance(value, datetime.date):
            return value
        for kind in (bool, int, float, str):
            if isinstance(value, kind):
                plain = kind(value)
                if isinstance(plain, int) and plain.bit_length() > MOST_BITS:
                    raise InputError("is a number of more digits than any key takes", where=where)
                return number_or_text(plain) if isinstance(plain, str) and key not in text_keys() else plain
        if isinstance(value, os.PathLike):
            return os.fspath(value)
        if isinstance(value, Mapping):
            for name in value:
                if not isinstance(name, str):
                    raise InputError(f"a key is text, given {name!r}", where=where)
            # Within the file a place is a key path; before it are the name of the file and ": ".
            return {str(k): self.of(v, f"{where}: {k}" if not depth else f"{where}.{k}", depth + 1, k)
                    for k, v in value.items()}  # fmt: skip
        if isinstance(value, list | tuple):
            return [self.of(v, f"{where}[{k}]", depth + 1, key) for k, v in enumerate(value)]
        if hasattr(value, "tolist"):  # numpy's arrays and numbers
            return self.of(value.tolist(), where, depth + 1, key)
        raise InputError(
            f"a value is text, a number, true, false, a list or a mapping, given {type(value).__name__}", where=where
        )


def planner_options(given: Mapping[Any, object], others: Collection[str] | None) -> dict[str, object]:
    """A script's options of a planner, as the keys of a mission file's ``planner`` are read, so that none has another
    limit. ``others`` are keys that only this planner has (None: it takes any); they stay as they are.

    Raises UsageError with all mistakes.
    """
    for key in given:
        if not isinstance(key, str):
            raise wrong_argument("options", "a key", key, "text, such as 'points'")
    single = [key for key in PlannerKeys.model_fields if key not in PLAIN_PLANNER_KEYS]
    mine = {key: value for key, value in given.items() if key not in single and (others is None or key in others)}
    plain = _Plain({}).of({"options": {k: v for k, v in given.items() if k not in mine}}, "planner", 0)["options"]
    problems = unknown_keys(plain, single, "options")
    keys = read_section(PlannerKeys, {k: v for k, v in plain.items() if k in single}, "options", problems)
    if problems:
        raise UsageError.of(problems)
    return {**mine, **({} if keys is None else keys.given)}


VEHICLES, ZONES, TERRAIN, LOG = "vehicles", "zones", "terrain", "log"

SUFFIXES_BY_KIND = {
    VEHICLES: VEHICLE_FILES,
    ZONES: ZONES_BY_NAME,
    TERRAIN: TERRAIN_FILES,
    LOG: LOG_FILES,
}

FIRST_BYTES = {
    b"QGC WPL": VEHICLES, b"II*\0": TERRAIN, b"MM\0*": TERRAIN, b"<?xml": ZONES, b"<kml": ZONES, b"PK\x03\x04": ZONES,
    b"SQLite format 3": ZONES, b"\xa3\x95": LOG,
}  # fmt: skip

MEMBERS_BY_KIND = (("fileType", VEHICLES), ("features", ZONES), ("geometry", ZONES))
"""Members of JSON by which other files are known; a mission file has none of them."""


def what_else(file: Path, raw: object = None) -> str:
    """The kind of ``file``, and the command that takes it; empty if it may be a mission file.

    ``raw`` is its content if that could be read as YAML, whose kind counts before the name.
    """
    kind = ""
    if isinstance(raw, dict):
        kind = next((kind for member, kind in MEMBERS_BY_KIND if member in raw), "")
    else:
        try:
            with file.open("rb") as opened:
                first = opened.read(16).removeprefix(b"\xef\xbb\xbf").lstrip()
        except (OSError, ValueError):
            return ""
        kind = next((kind for begins, kind in FIRST_BYTES.items() if first.startswith(begins)), "")
        kind = kind or next((kind for kind, ends in SUFFIXES_BY_KIND.items() if file.suffix.lower() in ends), "")
    name = shlex.quote(str(file))
    return {
        VEHICLES: f"this is a mission for vehicles, not a mission file: use check (gcsplan check MISSION.yaml {name})",
        ZONES: f"this is a file of zones, not a mission file: name it in one (no_fly: [{{file: …}}]), or look at it "
        f"with gcsplan check {name} --list-zones",
        TERRAIN: f"this is a file of terrain, not a mission file: name it in one (terrain: {{dem: …}}), or begin one "
        f"with gcsplan new --dem {name}",
        LOG: f"this is a flight log, not a mission file: use fit-energy (gcsplan fit-energy {name})",
    }.get(kind, "")
