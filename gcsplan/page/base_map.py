"""`BaseMap`: the map below the mission, of a file or an address that the user gives; without one there is none."""

from __future__ import annotations

import re
import sqlite3
import threading
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError, UsageError

FORMATS = {"png": "image/png", "jpg": "image/jpeg", "jpeg": "image/jpeg", "webp": "image/webp"}
"""Formats of an MBTiles file that are served, by the word in its metadata."""

MOST_BASE_TILE_BYTES = 4 * 2**20

_ADDRESS = re.compile(r"(https?://[A-Za-z0-9.-]+(?::\d+)?)/[^\s'\";,]*")


class BaseMap:
    """Raster tiles of an MBTiles file, or of an address with ``{z}``, ``{x}``, ``{y}``. Raises UsageError, InputError.

    ``host`` is the origin of an address, empty for a file.
    """

    def __init__(self, given: str) -> None:
        self.host = ""
        self._file: sqlite3.Connection | None = None
        self._lock = threading.Lock()
        self.media_type = ""
        if "://" in given:
            match = _ADDRESS.fullmatch(given)
            if match is None or not all(part in given for part in ("{z}", "{x}", "{y}")):
                raise UsageError(
                    f"--base {given[:200]}: give an address with {{z}}, {{x}} and {{y}}, or an .mbtiles file"
                )
            self.host = match[1]
            self._about: dict[str, Any] = {"tiles": given, "minzoom": 0, "maxzoom": 19, "attribution": ""}
            return
        self._about = self._opened(Path(given))

    def _opened(self, file: Path) -> dict[str, Any]:
        try:
            if not file.is_file():
                raise InputError("there is no such file", where=f"--base {file}")
            self._file = sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True, check_same_thread=False)
            known = {str(k): str(v) for k, v in self._file.execute("SELECT name, value FROM metadata LIMIT 200")}
            low, high = self._file.execute("SELECT min(zoom_level), max(zoom_level) FROM tiles").fetchone()
        except sqlite3.Error as why:
            raise InputError(f"this is no MBTiles file: {why}", where=f"--base {file}") from None
        self.media_type = FORMATS.get(known.get("format", ""), "")
        if not self.media_type or low is None:
            raise InputError("give an MBTiles file with raster tiles (png, jpg or webp)", where=f"--base {file}")
        attribution = re.sub(r"<[^>]*>", "", known.get("attribution", ""))[:300]
        return {"tiles": "base/{z}/{x}/{y}", "minzoom": int(low), "maxzoom": int(high), "attribution": attribution}

    def as_dict(self) -> dict[str, Any]:
        """The protocol's ``base``."""
        return dict(self._about)

    def tile(self, z: int, x: int, y: int) -> bytes | None:
        """A tile of the file; None if it has none there."""
        if self._file is None or not 0 <= z <= 30:
            return None
        question = "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ? LIMIT 1"
        with self._lock:
            try:
                row = self._file.execute(question, (z, x, 2**z - 1 - y)).fetchone()
            except (sqlite3.Error, OverflowError):
                return None
        data = row[0] if row is not None else None
        return data if isinstance(data, bytes) and len(data) <= MOST_BASE_TILE_BYTES else None
