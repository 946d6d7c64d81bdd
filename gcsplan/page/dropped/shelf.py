"""`Shelf`: the file that was dropped on the page, in memory until the user takes it or drops another.

A dropped file is a stranger's: its bytes are bounded by its ending before any is read, and its name has no folder.
Rasters may be several: tiles side by side, a .vrt with what it puts together, and the files beside them (.prj, …).
"""

from __future__ import annotations

import os
import re
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from gcsplan.errors import InputError
from gcsplan.export.durable import write_whole
from gcsplan.mavlink.files.file_items import MAX_FILE_BYTES
from gcsplan.mission_file.zone_reader import MAX_ZONE_BYTES, PLAN
from gcsplan.plugins import ZONE_READERS
from gcsplan.world.terrain.input_files import (
    FENCE_ZONES,
    LOG_FILES,
    MISSION_FILES,
    OPENAIR_ZONES,
    TERRAIN_FILES,
    VEHICLE_FILES,
    ZONE_FILES,
)

DroppedKind = Literal["mission", "zones", "ground"]

RASTER_SIDECARS = (".prj", ".aux.xml", ".tfw", ".wld", ".hdr", ".ovr", ".msk", ".ige", ".rrd")
"""Endings of files beside a raster, which GDAL finds by its name."""

GROUND_ENDINGS = (*TERRAIN_FILES, *RASTER_SIDECARS)

MOST_GROUND_BYTES, MOST_TOGETHER_BYTES, MOST_TOGETHER = 128 * 2**20, 256 * 2**20, 64
"""Most bytes of a raster, and most bytes and number of all that are dropped together."""

MOST_NAME = 96

_WAYPOINTS = b"QGC WPL"
"""The first bytes by which a text of any name is a mission for vehicles."""


@dataclass(frozen=True, slots=True)
class Dropped:
    """A file: its ``name`` without a folder, its kind by name and first bytes, and its content.

    ``more``: the files that were dropped together with it, all of them of ground.
    """

    name: str
    kind: DroppedKind
    data: bytes
    more: tuple[Dropped, ...] = ()

    @property
    def all(self) -> tuple[Dropped, ...]:
        """This file and the others."""
        return (self, *self.more)

    @property
    def rasters(self) -> list[str]:
        """The names that ``terrain.dem`` has of ground: a .vrt stands for what it puts together."""
        names = [one.name for one in self.all if ending_of(one.name) not in RASTER_SIDECARS]
        return [name for name in names if ending_of(name) == ".vrt"] or names


def endings() -> dict[str, int]:
    """The endings of files that may be dropped, each with the most bytes of such a file."""
    return {
        **dict.fromkeys(_zone_endings(), MAX_ZONE_BYTES),
        **dict.fromkeys(VEHICLE_FILES, MAX_FILE_BYTES),
        **dict.fromkeys(GROUND_ENDINGS, MOST_GROUND_BYTES),
    }


def _zone_endings() -> tuple[str, ...]:
    return (*ZONE_FILES, *OPENAIR_ZONES, *FENCE_ZONES, *ZONE_READERS.names())


def ending_of(name: str) -> str:
    """The ending of a file's name in lower case, with both parts of ``.aux.xml``."""
    return ".aux.xml" if name.lower().endswith(".aux.xml") else Path(name).suffix.lower()


def may_be_zones(name: str) -> bool:
    """Whether a file of this name may hold zones, too: a mission's own fence."""
    return Path(name).suffix.lower() in (PLAN, *FENCE_ZONES, *OPENAIR_ZONES)


def safe_name(given: str) -> str:
    """A name for the mission's folder: the last part of ``given``, with letters, digits, blanks, _ - . alone."""
    plain = re.sub(r"[^\w.-]+", "_", re.split(r"[/\\]", given)[-1], flags=re.ASCII)
    stem, dot, ending = plain.rpartition(".")
    kept = stem.lstrip("._-") or ("file" if "_" in stem else "")  # a name in another script keeps its ending
    return f"{kept[: max(MOST_NAME - len(ending) - 1, 0)]}{dot}{ending}".lstrip("._-")[:MOST_NAME] or "file"


def most_bytes(name: str) -> int:
    """The most bytes of a file of this name. Raises InputError for an ending that is not read here, with a cure."""
    ending = ending_of(name)
    found = endings().get(ending)
    if found is not None:
        return found
    other = {
        **dict.fromkeys(MISSION_FILES, "this is a mission file: open it with gcsplan map, or paste its text as YAML"),
        **dict.fromkeys(LOG_FILES, "this is a flight log: gcsplan fit-energy reads it"),
    }.get(ending)  # fmt: skip
    kinds = (("a mission", VEHICLE_FILES), ("zones", _zone_endings()), ("terrain", TERRAIN_FILES))
    read = "; ".join(f"{kind}: {', '.join(dict.fromkeys(of_kind))}" for kind, of_kind in kinds)
    raise InputError(other or f"files that end so are not read. Drop {read}", where=name)


class Receiving:
    """The bytes of one file as they come; `add` raises InputError for more than its kind may have.

    ``behind``: the files that were dropped before it and belong to it.
    """

    def __init__(self, shelf: Shelf, name: str, most: int, behind: Dropped | None = None) -> None:
        self._shelf, self.name, self._most, self.behind = shelf, name, most, behind
        self.data = bytearray()

    def add(self, part: bytes) -> None:
        """Take the next bytes. Raises InputError, also where a newer file is being dropped."""
        if len(self.data) + len(part) > self._most:
            raise InputError(f"the file has more than {self._most} bytes: simplify or split it", where=self.name)
        if not self._shelf.expects(self):
            raise InputError("another file was dropped meanwhile: drop this one again", where=self.name)
        self.data += part


class Shelf:
    """Holds the newest file, or files of ground; may be used from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._coming: Receiving | None = None
        self._held: Dropped | None = None

    def receive(self, name: str, size: int | None, *, more: bool = False) -> Receiving:
        """Begin with a file of ``size`` bytes (None: unknown), which supersedes any other, or, as one ``more``, joins
        those of ground that are there. Raises InputError."""
        own = safe_name(name)
        behind = self.held if more else None
        most = most_bytes(own)
        if behind is not None:
            if not behind.kind == _kind_of(own, b"") == "ground":
                raise InputError("only files of ground are dropped together: drop this one alone", where=own)
            if len(behind.all) >= MOST_TOGETHER or own in (one.name for one in behind.all):
                raise InputError(f"{MOST_TOGETHER} files of different names are the most: drop fewer", where=own)
            most = min(most, MOST_TOGETHER_BYTES - sum(len(one.data) for one in behind.all))
        if size is not None and size > most:
            raise InputError(f"the file has {size} bytes, more than {most}: simplify or split it", where=own)
        with self._lock:
            self._held, self._coming = None, Receiving(self, own, most, behind)
            return self._coming

    def expects(self, coming: Receiving) -> bool:
        """Whether no newer file is being dropped."""
        with self._lock:
            return self._coming is coming

    def put(self, whole: Receiving) -> Dropped:
        """Keep a file that has come whole. Raises InputError."""
        data, behind = bytes(whole.data), whole.behind
        one = Dropped(whole.name, _kind_of(whole.name, data), data)
        if not self.expects(whole):
            raise InputError("another file was dropped meanwhile: drop this one again", where=whole.name)
        with self._lock:
            self._held = one if behind is None else replace(behind, more=(*behind.more, one))
            self._coming = None
            return self._held

    @property
    def held(self) -> Dropped:
        """The file. Raises InputError without one."""
        with self._lock:
            if self._held is None:
                raise InputError("the file is no longer here: drop it again")
            return self._held

    def clear(self) -> None:
        """Forget the file."""
        with self._lock:
            self._held = self._coming = None


def _kind_of(name: str, data: bytes) -> DroppedKind:
    ending = ending_of(name)
    if ending in VEHICLE_FILES or data.removeprefix(b"\xef\xbb\xbf").startswith(_WAYPOINTS):
        return "mission"
    return "ground" if ending in GROUND_ENDINGS else "zones"


@contextmanager
def laid_out(dropped: Dropped) -> Iterator[Path]:
    """A folder of our own with the files, for readers that find one by the name of another; it goes at the end."""
    with tempfile.TemporaryDirectory(prefix="gcsplan-") as made:
        folder = Path(made).resolve()
        try:
            for one in dropped.all:
                (folder / one.name).write_bytes(one.data)
        except OSError as why:
            raise InputError(f"the file cannot be laid out to be read: {why.strerror}", where=dropped.name) from None
        yield folder


def has_other(target: Path, data: bytes) -> bool:
    """Whether something else than these bytes has the name."""
    if not os.path.lexists(target):
        return False
    try:
        if target.is_symlink() or not target.is_file() or target.stat().st_size != len(data):
            return True
        return target.read_bytes() != data
    except OSError:
        return True


def place_in(folder: Path, dropped: Dropped) -> None:
    """Write a file, and those that came with it, into the folder, which the user has confirmed. Raises InputError."""
    for one in dropped.all:
        if (folder / one.name).is_dir():
            raise InputError("a folder has this name: rename the file, and drop it again", where=one.name)
    for one in dropped.all:
        target = folder / one.name
        if has_other(target, one.data) or not target.exists():
            write_whole(target, one.data)
