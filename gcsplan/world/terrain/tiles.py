"""The files of a mosaic: those in a folder, and their common hash."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.datum import VerticalDatum
from gcsplan.world.geodesy.height_unit import HeightUnit
from gcsplan.world.terrain.input_files import tell_folder
from gcsplan.world.terrain.mosaic import Window

HASHED_BYTES = 256 * 2**20
"""Tiles of more bytes together are not hashed whole."""

RASTERS = (".tif", ".tiff", ".hgt", ".hgt.zip", ".asc")
"""The names of tiles in a folder end with these."""

MOST_TILES = 20_000
"""Most tiles of a mosaic."""


class Tile(Protocol):
    """What reports say of one file, and the datum that it states."""

    @property
    def stored_bytes(self) -> int:
        """Its size."""

    @property
    def name(self) -> str:
        """The file's name."""

    @property
    def vertical(self) -> VerticalDatum | None:
        """What its heights are above; None if it does not say."""

    @property
    def notes(self) -> tuple[Note, ...]:
        """What a user should know of it."""

    @property
    def unit(self) -> HeightUnit:
        """The unit in which it counts heights."""

    def sha256(self) -> str:
        """Its hash."""


def hash_of(tiles: Sequence[Tile], window: Window) -> str:
    """The hash of a single file; for several files the hash of their hashes, in the order given.

    Beyond `HASHED_BYTES` nobody waits until all is read: then it is of every tile's name and size, and of the heights
    that the mission has read, with their places.
    """
    if sum(tile.stored_bytes for tile in tiles) <= HASHED_BYTES:
        hashes = [tile.sha256() for tile in tiles]
        return hashes[0] if len(hashes) == 1 else hashlib.sha256("\n".join(hashes).encode()).hexdigest()
    digest = hashlib.sha256("\n".join(f"{tile.name} {tile.stored_bytes}" for tile in tiles).encode())
    for numbers in (window.x, window.y, window.heights_m):
        digest.update(np.ascontiguousarray(numbers).tobytes())
    return digest.hexdigest()


def tiles_of(paths: Sequence[str], *, where: str) -> list[str]:
    """The rasters that ``paths`` name, as files or in folders. Raises InputError."""
    found = [tile for path in paths for tile in _in_folder(path, where)]
    if len(found) > MOST_TILES:
        raise InputError(f"{len(found)} tiles are named; {MOST_TILES} are the most: give those around", where=where)
    return found


def _in_folder(path: str, where: str) -> list[str]:
    """The rasters in a folder, or the file itself."""
    tell_folder(path, RASTERS)
    if not os.path.isdir(path):  # not pathlib's, which raises for a name that no disk can hold
        return [path]
    try:
        found = sorted(str(p) for p in Path(path).iterdir() if p.name.lower().endswith(RASTERS) and p.is_file())
    except OSError as why:
        raise InputError(f"{path} cannot be read: {why.strerror or why}", where=where) from why
    if not found:
        raise InputError(f"{path} is a folder without tiles ({', '.join(RASTERS)}, .DAT); give a file", where=where)
    return found
