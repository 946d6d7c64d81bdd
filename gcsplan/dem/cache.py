"""The cache: tiles on the disk, each with a record of its state, its origin and its checksum.

``<cache>/<source>/N36W085.tif`` counts only with ``N36W085.json`` beside it, which is written last. A record may also
state that there is no tile, because it is sea or because the source lacks it. Nothing here uses the network.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from gcsplan.dem.sources import DemSource, names_of
from gcsplan.errors import InputError, Mistake
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.input_files import tell_file, tell_setting

CACHE_VARIABLE = "GCSPLAN_DEM_CACHE"
TileState = Literal["tile", "sea", "absent"]
RECORD_FORMAT = 1
MOST_RECORD_BYTES = 65_536


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingTiles(Mistake):
    """Tiles that are needed and not in the cache."""

    source: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True, slots=True)
class TileRecord:
    """The cache's knowledge of a tile.

    ``state``: ``tile`` (the file is there), ``sea`` (neither the source nor GLO-90 lists it), ``absent`` (the source
    does not list it, GLO-90 does). ``lists`` are the addresses and checksums of the lists that show the state.
    ``sha256`` is the checksum of the downloaded bytes; ``etag_agrees``: the server's ETag is a checksum equal to it.
    """

    tile: str
    source: str
    state: TileState
    kind: str
    vertical_datum: str
    fetched_utc: str
    url: str = ""
    etag: str = ""
    etag_agrees: bool = False
    bytes: int = 0
    sha256: str = ""
    lists: tuple[str, ...] = ()


def cache_folder() -> Path:
    """``$GCSPLAN_DEM_CACHE``, else ``$XDG_CACHE_HOME/gcsplan/dem``, else the platform's folder for caches."""
    tell_setting(CACHE_VARIABLE)
    own = os.environ.get(CACHE_VARIABLE, "")
    if own:
        return Path(os.path.expanduser(own)).absolute()
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"):
        tell_setting(name)
    xdg = os.environ.get("XDG_CACHE_HOME", "")
    if xdg and Path(xdg).is_absolute():  # its specification ignores others
        return Path(xdg) / "gcsplan" / "dem"
    local = os.environ.get("LOCALAPPDATA", "")
    try:
        home = Path(local) if sys.platform == "win32" and local else Path.home() / ".cache"
    except RuntimeError:
        raise InputError(f"no folder for the cache is known; set {CACHE_VARIABLE}") from None
    return home / "gcsplan" / "dem"


class Cache:
    """The tiles of one source in one folder."""

    def __init__(self, source: DemSource, folder: Path | None = None) -> None:
        self.source = source
        self.root = cache_folder() if folder is None else folder
        self.folder = self.root / source.name

    def tile_path(self, cell: Cell) -> Path:
        """Where the tile lies, if its state is ``tile``."""
        return self.folder / f"{cell.name}.tif"

    def record_path(self, cell: Cell) -> Path:
        """Where the record lies."""
        return self.folder / f"{cell.name}.json"

    def find(self, cell: Cell) -> TileRecord | None:
        """The cache's record of a tile; None if there is none that can be relied on."""
        tell_file(self.record_path(cell))
        tell_file(self.tile_path(cell))
        record = _read(self.record_path(cell))
        if record is None or (record.tile, record.source) != (cell.name, self.source.name):
            return None
        if (record.kind, record.vertical_datum) != (self.source.kind, self.source.vertical_datum):
            return None
        try:
            whole = record.state != "tile" or self.tile_path(cell).stat().st_size == record.bytes > 0
        except OSError:
            return None
        return record if whole else None

    def need(self, cells: Iterable[Cell], *, where: str) -> dict[Cell, TileRecord]:
        """The records of all ``cells``. Raises InputError, with the command to run, if any is missing."""
        found = {cell: self.find(cell) for cell in cells}
        missing = tuple(cell for cell, record in found.items() if record is None)
        if missing:
            raise InputError.of([self.missing(missing, where)])
        return {cell: record for cell, record in found.items() if record is not None}

    def missing(self, cells: tuple[Cell, ...], where: str, why: str = "not in the cache") -> MissingTiles:
        """The problem to report for tiles that are not there, with the command to run."""
        tiles = "tile of this area is" if len(cells) == 1 else "tiles of this area are"
        words = (
            f"{len(cells)} {self.source.name} {tiles} {why} ({self.root}); run "
            f"`gcsplan dem fetch --source {self.source.name} --tiles {names_of(cells)}`"
        )
        return MissingTiles(where, words, source=self.source.name, cells=cells)


def text_of(record: TileRecord) -> str:
    """The JSON text of a record."""
    return json.dumps({"format": RECORD_FORMAT, **asdict(record)}, indent=2, ensure_ascii=False) + "\n"


def _read(path: Path) -> TileRecord | None:
    """A record of this format; None for anything else, which then counts as not cached."""
    try:
        with path.open("rb") as file:
            data = json.loads(file.read(MOST_RECORD_BYTES))
        if not isinstance(data, dict) or data.pop("format", None) != RECORD_FORMAT:
            return None
        record = TileRecord(**data | {"lists": tuple(data.get("lists", ()))})
    except (OSError, ValueError, TypeError):
        return None
    texts = (record.tile, record.source, record.kind, record.vertical_datum, record.url, record.etag, record.sha256)
    good = all(isinstance(text, str) for text in texts) and type(record.bytes) is int
    return record if good and record.state in ("tile", "sea", "absent") else None
