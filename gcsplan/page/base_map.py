"""`BaseMap`: the map below the mission, of a file or an address that the user gives; without one there is none."""

from __future__ import annotations

import re
import sqlite3
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from gcsplan.errors import InputError, UsageError
from gcsplan.page.refused import not_installed

try:
    from pmtiles.reader import MmapSource, Reader
    from pmtiles.tile import MagicNumberNotFound, SpecVersionUnsupported, TileType
except ModuleNotFoundError as missing:
    raise not_installed(missing.name) from None

FORMATS = {"png": "image/png", "jpg": "image/jpeg", "jpeg": "image/jpeg", "webp": "image/webp"}
"""Formats of an MBTiles file that are served, by the word in its metadata."""

PMTILES_FORMATS = {TileType.PNG: "image/png", TileType.JPEG: "image/jpeg", TileType.WEBP: "image/webp"}
"""The same of a PMTiles file."""

MOST_BASE_TILE_BYTES = 4 * 2**20
MOST_DIRECTORY_BYTES = 2**20
"""Most bytes of an unpacked directory, or of the metadata, of a PMTiles file."""

MOST_BASE_ZOOM = 30
DATABASE_S = 5.0
"""Seconds that a question to an MBTiles file may take: its tables may be views that never end."""

_ADDRESS = re.compile(r"(https?://[A-Za-z0-9.-]+(?::\d+)?)/[^\s'\";,]*")
_BROKEN_PMTILES = (
    MagicNumberNotFound, SpecVersionUnsupported, ValueError, OSError, EOFError, IndexError, KeyError, OverflowError,
    TypeError, RecursionError, zlib.error,
)  # fmt: skip
_LONG_NUMBER = re.compile(rb"[\x80-\xff]{10}")
_ABOUT = "SELECT name, substr(value, 1, 1000) FROM metadata WHERE name IN ('format', 'attribution') LIMIT 2"


BASE_FORMS = "an .mbtiles or .pmtiles file, or an address with {z}, {x} and {y}"


class TileFile(Protocol):
    """A file of raster tiles: what it holds, and one of its tiles, for any thread."""

    media_type: str
    zooms: tuple[int, int]
    attribution: str

    def tile(self, z: int, x: int, y: int) -> bytes | None:
        """A tile, counted from the north-west; None if there is none."""


class MbtilesFile:
    """An MBTiles file, which is an SQLite database. Raises InputError."""

    def __init__(self, file: Path) -> None:
        self._address = f"{file.absolute().as_uri()}?mode=ro"
        try:
            with self._opened() as opened:
                known = {str(k): str(v) for k, v in opened.execute(_ABOUT)}
                low, high = opened.execute("SELECT min(zoom_level), max(zoom_level) FROM tiles").fetchone()
        except sqlite3.Error as why:
            late = getattr(why, "sqlite_errorcode", None) == sqlite3.SQLITE_INTERRUPT
            words = f"it does not answer within {DATABASE_S:g} s" if late else f"this is no MBTiles file: {why}"
            raise InputError(words, where=f"--base {file}") from None
        self.media_type = FORMATS.get(known.get("format", ""), "")
        if not self.media_type or low is None:
            raise InputError("give an MBTiles file with raster tiles (png, jpg or webp)", where=f"--base {file}")
        self.zooms, self.attribution = (low, high), known.get("attribution", "")

    @contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        """The database, bounded in bytes of a value and in seconds; its views call nothing outside SQLite."""
        end_s = time.monotonic() + DATABASE_S
        with closing(sqlite3.connect(self._address, uri=True)) as opened:
            opened.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BASE_TILE_BYTES)
            opened.set_progress_handler(lambda: time.monotonic() > end_s, 10_000)
            opened.execute("PRAGMA trusted_schema = OFF")
            yield opened

    def tile(self, z: int, x: int, y: int) -> bytes | None:
        """A tile, counted from the north-west; None if there is none."""
        question = "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ? LIMIT 1"
        try:
            with self._opened() as opened:
                row = opened.execute(question, (z, x, 2**z - 1 - y)).fetchone()
        except (sqlite3.Error, OverflowError):
            return None
        return row[0] if row is not None and isinstance(row[0], bytes) else None


class PmtilesFile:
    """A PMTiles file of version 3. Raises InputError."""

    def __init__(self, file: Path) -> None:
        try:
            with file.open("rb") as opened:
                source = MmapSource(opened)  # its calls have no types
            self._reader = Reader(partial(_bytes_of, source, True))
            about, header = Reader(partial(_bytes_of, source, False)).metadata(), self._reader.header()
        except _BROKEN_PMTILES:
            raise InputError("this is no PMTiles file of version 3", where=f"--base {file}") from None
        self.media_type = PMTILES_FORMATS.get(header["tile_type"], "")
        if not self.media_type:
            raise InputError("give a PMTiles file with raster tiles (png, jpg or webp)", where=f"--base {file}")
        self.zooms = int(header["min_zoom"]), int(header["max_zoom"])
        self.attribution = str(about.get("attribution", "")) if isinstance(about, dict) else ""

    def tile(self, z: int, x: int, y: int) -> bytes | None:
        """A tile, counted from the north-west; None if there is none."""
        try:
            found = self._reader.get(z, x, y)
        except _BROKEN_PMTILES:
            return None
        return found if isinstance(found, bytes) else None


def _bytes_of(source: Callable[[int, int], bytes], numbers: bool, offset: int, length: int) -> bytes:
    """A part of a PMTiles file that is not too large, packed or not; ``numbers``: if it is packed, with no number of
    more than 64 bits. Raises ValueError."""
    data = source(offset, min(length, MOST_BASE_TILE_BYTES + 1))
    if len(data) > MOST_BASE_TILE_BYTES:
        raise ValueError("a part is too large")
    rest, held = data, b""
    while rest.startswith(b"\x1f\x8b"):
        unpacking = zlib.decompressobj(wbits=31)
        held += unpacking.decompress(rest, MOST_DIRECTORY_BYTES + 1 - len(held))
        if len(held) > MOST_DIRECTORY_BYTES or (numbers and _LONG_NUMBER.search(held)):
            raise ValueError("a directory is too large")
        rest = unpacking.unused_data.lstrip(b"\0")
    return data


FILES: dict[str, type[MbtilesFile | PmtilesFile]] = {".mbtiles": MbtilesFile, ".pmtiles": PmtilesFile}
"""Files of tiles by the end of their name."""


class BaseMap:
    """Raster tiles of a file, or of an address with ``{z}``, ``{x}``, ``{y}``. Raises UsageError, InputError.

    ``host`` is the origin of an address, empty for a file.
    """

    def __init__(self, given: str) -> None:
        self.host = ""
        self._file: TileFile | None = None
        self.media_type = ""
        if "://" in given:
            match = _ADDRESS.fullmatch(given)
            if match is None or not all(part in given for part in ("{z}", "{x}", "{y}")):
                raise UsageError(f"--base {given[:200]}: give {BASE_FORMS}")
            self.host = match[1]
            self._about: dict[str, Any] = {"tiles": given, "minzoom": 0, "maxzoom": 19, "attribution": ""}
            return
        file = Path(given)
        kind = FILES.get(file.suffix.lower())
        if kind is None:
            raise UsageError(f"--base {given[:200]}: give {BASE_FORMS}")
        if not file.is_file():
            raise InputError("there is no such file", where=f"--base {file}")
        self._file = kind(file)
        self.media_type, (low, high) = self._file.media_type, self._file.zooms
        if not (isinstance(low, int) and isinstance(high, int) and 0 <= low <= high <= MOST_BASE_ZOOM):
            found = f"{str(low)[:20]} to {str(high)[:20]}"
            words = f"it has zooms from {found}: give tiles of zooms from 0 to {MOST_BASE_ZOOM}"
            raise InputError(words, where=f"--base {file}")
        attribution = re.sub(r"<[^>]*>", "", self._file.attribution)[:300]
        self._about = {"tiles": "base/{z}/{x}/{y}", "minzoom": low, "maxzoom": high, "attribution": attribution}

    def as_dict(self) -> dict[str, Any]:
        """The protocol's ``base``."""
        return dict(self._about)

    def tile(self, z: int, x: int, y: int) -> bytes | None:
        """A tile of the file; None if it has none there."""
        if self._file is None or not (0 <= z <= MOST_BASE_ZOOM and 0 <= x < 2**z and 0 <= y < 2**z):
            return None
        data = self._file.tile(z, x, y)
        return data if data is not None and len(data) <= MOST_BASE_TILE_BYTES else None
