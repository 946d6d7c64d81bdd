"""The files that a mission reads, and whether they are unchanged.

Every reader reports a file here before it opens it, also one that is not there (it may appear) and one whose content is
remembered from an earlier mission. Within `reading` each report is kept with a mark of the found state:

- a file: SHA-256 of its content up to `WHOLE_BYTES`, as long as all of a mission's together have at most
  `TOGETHER_BYTES`; beyond these limits its size, time of change and inode
- a raster: the marks of itself and of every file beside it that its name begins (``dem.tif``: ``dem.*``), for GDAL
  finds sidecars, world files, overviews and masks there
- a folder: the names in it that count
- a setting: the value of an environment variable that names a place of files

docs/safety.md states the assumptions of "unchanged".
"""

from __future__ import annotations

import hashlib
import os
import stat
import time
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from gcsplan.errors import nearest_name

__all__ = [
    "FENCE_ZONES", "JSON_ZONES", "LOG_FILES", "MISSION_FILES", "OPENAIR_ZONES", "TERRAIN_FILES", "VECTOR_ZONES",
    "VEHICLE_FILES", "ZONES_BY_NAME", "ZONE_FILES", "FileReading", "absent", "beside", "files_of", "path_of", "reading",
    "sha256_of", "sha256_of_all", "states_of", "tell_file", "tell_folder", "tell_raster", "tell_setting",
]  # fmt: skip

# Endings, in lower case, by which a reader is chosen, and a message names the key to which a misplaced file belongs.
JSON_ZONES = (".geojson", ".json")
VECTOR_ZONES = (".gpkg", ".shp", ".fgb", ".zip")
ZONE_FILES = (*JSON_ZONES, ".kml", ".kmz", ".csv", *VECTOR_ZONES)
OPENAIR_ZONES = (".openair", ".air", ".txt")
FENCE_ZONES = (".fen", ".poly", ".waypoints")
"""Fences of Mission Planner and MAVProxy."""

ZONES_BY_NAME = (*(ending for ending in ZONE_FILES if ending != ".json"), ".fen", ".poly")
"""Zones by their names alone: JSON holds much else."""

TERRAIN_FILES = (".tif", ".tiff", ".vrt", ".hgt", ".asc", ".dat", ".dt0", ".dt1", ".dt2", ".img", ".nc", ".xyz")
LOG_FILES = (".bin", ".tlog", ".ulg")
VEHICLE_FILES = (".waypoints", ".plan")
MISSION_FILES = (".yaml", ".yml")

WHOLE_BYTES = 16 * 2**20
"""A larger file goes by its size, time and inode."""

TOGETHER_BYTES = 256 * 2**20
"""Most bytes of content that are read for the marks of one mission."""

SETTLED_NS = 2_000_000_000
"""A file that was changed less than this before it was looked at may change again within one tick of its clock."""

ABSENT, SPECIAL = "absent", "no regular file"
_MARK = 32
_MOST_KEPT, _MOST_FOLDERS = 100_000, 1_000

known_hashes: dict[tuple[int, ...], str] = {}
known_names: dict[tuple[object, ...], tuple[tuple[str, str], ...]] = {}
_now: ContextVar[FileReading | None] = ContextVar("reading", default=None)


class FileReading:
    """The reports since `reading` began: ``marks``, in this order."""

    def __init__(self) -> None:
        self.marks: dict[str, str] = {}
        self._left = TOGETHER_BYTES
        self._counted: set[tuple[int, int]] = set()

    def tell(self, key: str) -> None:
        """Mark what ``key`` names now, unless it is marked already."""
        if key not in self.marks:
            self.marks[key] = self._mark(key)

    def _mark(self, key: str) -> str:
        kind, _, rest = key.partition(" ")
        if kind == "file":
            return self._of_file(rest)
        if kind == "raster":
            found = beside(rest)
            return _digest([str(found[0].parent) if found else "", *(f"{f.name} {self._of_file(f)}" for f in found)])
        if kind == "near":
            return nearest_name(Path(rest))
        if kind == "setting":
            return os.environ.get(rest, ABSENT)
        suffixes, _, folder = rest.partition(" ")
        return _of_folder(folder, tuple(suffixes.split(",")))

    def _of_file(self, path: str | Path) -> str:
        try:
            about = os.stat(path)
        except (OSError, ValueError):
            return ABSENT
        if stat.S_ISDIR(about.st_mode):
            return "folder"
        if not stat.S_ISREG(about.st_mode):
            return SPECIAL
        one = (about.st_dev, about.st_ino)
        if about.st_size > WHOLE_BYTES or (one not in self._counted and about.st_size > self._left):
            return f"{about.st_size} {about.st_mtime_ns} {about.st_ino}"
        if one not in self._counted:
            self._counted.add(one)
            self._left -= about.st_size
        return _of_content(path)

    @staticmethod
    def changed(marks: Mapping[str, str]) -> str:
        """The first path of ``marks`` that has changed; empty if none has."""
        now = FileReading()
        for key, mark in marks.items():
            now.tell(key)
            if now.marks[key] != mark:
                return path_of(key)
        return ""


def path_of(key: str) -> str:
    """The path of a report, for messages."""
    kind, _, rest = key.partition(" ")
    return rest.partition(" ")[2] if kind == "folder" else rest


@contextmanager
def reading() -> Iterator[FileReading]:
    """Keep the reports of the body, by this thread."""
    found = FileReading()
    token = _now.set(found)
    try:
        yield found
    finally:
        _now.reset(token)


def tell_file(path: str | os.PathLike[str]) -> None:
    """Report a file that is opened, or looked for, as it is."""
    _tell("file", path)


def absent(path: Path) -> str:
    """The words for a file that is not there, with the nearest name in its folder, which is reported, too; or for what
    has its name and is no file."""
    _tell("near", path)
    if os.path.exists(path):  # False for names that no disk can hold, where pathlib may raise
        return f"{path} is no file: give a file, not a {'folder' if os.path.isdir(path) else 'pipe or a device'}"
    near = nearest_name(path)
    hint = f"; did you mean {path.with_name(near)}?" if near else ""
    return f"{path} is not there (paths are relative to the mission file){hint}"


def tell_raster(path: str | os.PathLike[str]) -> None:
    """Report a file that GDAL opens, with all that may belong to it."""
    _tell("raster", path)


def tell_setting(name: str) -> None:
    """Report an environment variable that names a place of files."""
    now = _now.get()
    if now is not None:
        now.tell(f"setting {name}")


def tell_folder(path: str | os.PathLike[str], suffixes: Sequence[str]) -> None:
    """Report a folder whose names with these endings (lower case) are read."""
    _tell(f"folder {','.join(suffixes)}", path)


def beside(path: str | os.PathLike[str]) -> list[Path]:
    """The files beside a raster that its name, without its last suffix and in any case, begins; links are followed.

    The raster itself is among them. They are sorted by name; an unreadable folder has none.
    """
    try:
        real = Path(path).resolve()
        folder = os.stat(real.parent)
    except (OSError, ValueError, RuntimeError):
        return []
    key = (real.parent, folder.st_dev, folder.st_ino, folder.st_mtime_ns, folder.st_ctime_ns)
    names = known_names.get(key)
    if names is None:
        try:
            names = tuple(sorted((name.casefold(), name) for name in os.listdir(real.parent)))
        except OSError:
            return []
        if time.time_ns() - max(folder.st_mtime_ns, folder.st_ctime_ns) > SETTLED_NS:
            if len(known_names) >= _MOST_FOLDERS:
                known_names.clear()
            known_names[key] = names
    stem = real.stem.casefold()
    found = []
    for k in range(bisect_left(names, (stem, "")), len(names)):
        alike, name = names[k]
        if not alike.startswith(stem):
            break
        # dem.tif.aux.xml and dem_rpc.txt belong to dem.tif; dem2.tif does not.
        mine = name == real.name or alike[len(stem) : len(stem) + 1] in (".", "_")
        if mine and os.path.isfile(real.parent / name):
            found.append(real.parent / name)
    return found


def states_of(files: Iterable[Path]) -> tuple[tuple[object, ...], ...]:
    """Names, sizes, times and inodes of existing files: they must not change while their content is kept."""
    found = []
    for file in files:
        try:
            about = os.stat(file)
        except OSError:
            continue
        found.append((str(file), about.st_size, about.st_mtime_ns, about.st_ctime_ns, about.st_ino))
    return tuple(found)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's bytes, read in pieces; of a file that is unchanged since it was read here, the same again."""
    with path.open("rb") as file:
        about = os.fstat(file.fileno())
        key = (about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns, about.st_ctime_ns)
        known = known_hashes.get(key)
        if known is not None:
            return known
        began_ns = time.time_ns()
        found = hashlib.file_digest(file, "sha256").hexdigest()
    if began_ns - max(about.st_mtime_ns, about.st_ctime_ns) > SETTLED_NS:
        if len(known_hashes) >= _MOST_KEPT:
            known_hashes.clear()
        known_hashes[key] = found
    return found


def sha256_of_all(files: Sequence[Path], first: str | None = None) -> str:
    """SHA-256 of the first file if it is alone, else of the names and hashes of all; ``first``: its hash if known."""
    whole = first or sha256_of(files[0])
    if len(files) == 1:
        return whole
    lines = [whole, *(f"{file.name} {sha256_of(file)}" for file in files[1:])]
    return hashlib.sha256("\n".join(lines).encode("utf-8", "surrogateescape")).hexdigest()


def files_of(dataset: Any, path: Path) -> tuple[Path, ...]:
    """The file that GDAL opened, and every other one that it names as a part: sidecars, masks, overviews."""
    found = {Path(name) for name in dataset.files if os.path.isfile(name)} - {path, path.resolve()}
    return (path, *sorted(found))


def _tell(kind: str, path: str | os.PathLike[str]) -> None:
    now = _now.get()
    if now is not None:
        now.tell(f"{kind} {os.path.abspath(path)}")


def _of_content(path: str | Path) -> str:
    try:
        return sha256_of(Path(path))[:_MARK]
    except OSError as why:
        return f"unreadable {why.errno}"


def _of_folder(path: str, suffixes: tuple[str, ...]) -> str:
    try:
        with os.scandir(path) as entries:
            found = [f"{e.name}{'/' if e.is_dir() else ''}" for e in entries if e.name.lower().endswith(suffixes)]
    except NotADirectoryError:
        return "file"
    except (OSError, ValueError):
        return ABSENT
    return _digest(sorted(found))


def _digest(texts: Sequence[str]) -> str:
    return hashlib.sha256("\n".join(texts).encode("utf-8", "surrogateescape")).hexdigest()[:_MARK]
