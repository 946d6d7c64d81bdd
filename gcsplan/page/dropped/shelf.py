"""`Shelf`: the one file that was dropped on the page, in memory until the user takes it or drops another.

A dropped file is a stranger's: its bytes are bounded by its ending before any is read, and its name has no folder.
"""

from __future__ import annotations

import os
import re
import threading
from dataclasses import dataclass
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

GEOTIFF = (".tif", ".tiff")
"""Terrain that is read out of memory; all other kinds have to lie in a folder."""

MOST_GROUND_BYTES = 128 * 2**20
MOST_NAME = 96

_WAYPOINTS = b"QGC WPL"
"""The first bytes by which a text of any name is a mission for vehicles."""


@dataclass(frozen=True, slots=True)
class Dropped:
    """A file: its ``name`` without a folder, its kind by name and first bytes, and its content."""

    name: str
    kind: DroppedKind
    data: bytes


def endings() -> dict[str, int]:
    """The endings of files that may be dropped, each with the most bytes of such a file."""
    zones = (*ZONE_FILES, *OPENAIR_ZONES, *FENCE_ZONES, *ZONE_READERS.names())
    return {
        **dict.fromkeys(zones, MAX_ZONE_BYTES),
        **dict.fromkeys(VEHICLE_FILES, MAX_FILE_BYTES),
        **dict.fromkeys(GEOTIFF, MOST_GROUND_BYTES),
    }


def may_be_zones(name: str) -> bool:
    """Whether a file of this name may hold zones, too: a mission's own fence."""
    return Path(name).suffix.lower() in (PLAN, *FENCE_ZONES, *OPENAIR_ZONES)


def safe_name(given: str) -> str:
    """A name for the mission's folder: the last part of ``given``, with letters, digits, blanks, _ - . alone."""
    plain = re.sub(r"[^\w.-]+", "_", re.split(r"[/\\]", given)[-1], flags=re.ASCII).lstrip("._-")
    stem, dot, ending = plain.rpartition(".")
    return f"{stem[: MOST_NAME - len(ending) - 1]}{dot}{ending}"[:MOST_NAME] or "file"


def most_bytes(name: str) -> int:
    """The most bytes of a file of this name. Raises InputError for an ending that is not read here, with a cure."""
    ending = Path(name).suffix.lower()
    found = endings().get(ending)
    if found is not None:
        return found
    other = {
        **dict.fromkeys(TERRAIN_FILES, "of terrain only GeoTIFF is read here; copy this file into the folder of the "
                        "mission, and it is offered as ground"),
        **dict.fromkeys(MISSION_FILES, "this is a mission file: open it with gcsplan map, or paste its text as YAML"),
        **dict.fromkeys(LOG_FILES, "this is a flight log: gcsplan fit-energy reads it"),
    }.get(ending, f"files that end so are not read; drop {', '.join(endings())}")  # fmt: skip
    raise InputError(other, where=name)


class Receiving:
    """The bytes of one file as they come; `add` raises InputError for more than its kind may have."""

    def __init__(self, shelf: Shelf, name: str, most: int) -> None:
        self._shelf, self.name, self._most = shelf, name, most
        self.data = bytearray()

    def add(self, part: bytes) -> None:
        """Take the next bytes. Raises InputError, also where a newer file is being dropped."""
        if len(self.data) + len(part) > self._most:
            raise InputError(f"the file has more than {self._most} bytes: simplify or split it", where=self.name)
        if not self._shelf.expects(self):
            raise InputError("another file was dropped meanwhile: drop this one again", where=self.name)
        self.data += part


class Shelf:
    """Holds the newest file; may be used from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._coming: Receiving | None = None
        self._held: Dropped | None = None

    def receive(self, name: str, size: int | None) -> Receiving:
        """Begin with a file of ``size`` bytes (None: unknown), which supersedes any other. Raises InputError."""
        own = safe_name(name)
        most = most_bytes(own)
        if size is not None and size > most:
            raise InputError(f"the file has {size} bytes, more than {most}: simplify or split it", where=own)
        with self._lock:
            self._held, self._coming = None, Receiving(self, own, most)
            return self._coming

    def expects(self, coming: Receiving) -> bool:
        """Whether no newer file is being dropped."""
        with self._lock:
            return self._coming is coming

    def put(self, whole: Receiving) -> Dropped:
        """Keep a file that has come whole. Raises InputError."""
        data, ending = bytes(whole.data), Path(whole.name).suffix.lower()
        mission = ending in VEHICLE_FILES or data.removeprefix(b"\xef\xbb\xbf").startswith(_WAYPOINTS)
        kind: DroppedKind = "mission" if mission else "ground" if ending in GEOTIFF else "zones"
        if not self.expects(whole):
            raise InputError("another file was dropped meanwhile: drop this one again", where=whole.name)
        with self._lock:
            self._held, self._coming = Dropped(whole.name, kind, data), None
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


def place_in(folder: Path, dropped: Dropped) -> Path:
    """Write a file into the folder, which the user has confirmed. Raises InputError."""
    target = folder / dropped.name
    if target.is_dir():
        raise InputError("a folder has this name: rename the file, and drop it again", where=dropped.name)
    if has_other(target, dropped.data) or not target.exists():
        write_whole(target, dropped.data)
    return target
