"""Fills the cache: lists name the tiles that exist; a tile is downloaded, verified and only then moved into the cache.

Whole tiles are downloaded, not windows of them: a checksum covers a whole file, and a whole tile serves every later
mission there.
"""

from __future__ import annotations

import hashlib
import logging
import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from gcsplan.dem.cache import Cache, TileRecord, TileState, text_of
from gcsplan.dem.download import DownloadPatience, ServerUnreachable, download, is_address
from gcsplan.dem.sources import MOST_LIST_BYTES, WITNESS, DemSource
from gcsplan.errors import GcsplanError, InputError, LinkError
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.input_files import sha256_of
from gcsplan.world.terrain.raster import Raster, open_raster

try:
    import fcntl
except ImportError:  # Windows: every process brings its own copy of a tile
    POSIX = False
else:
    POSIX = True

_log = logging.getLogger(__name__)

LIST_DAYS = 30.0
"""A list is downloaded anew after this many days."""

FetchProgress = Callable[[str, int, int | None], None]
"""Called with the name of a tile or list, and the number of bytes received and of the whole, if known."""


@dataclass(frozen=True, slots=True)
class Fetched:
    """One tile after a fetch; ``cached`` if it was there before."""

    cell: Cell
    record: TileRecord
    cached: bool


class Fetch:
    """One run for one source; ``mirror`` is the address of a copy of the public buckets, or empty."""

    def __init__(
        self,
        cache: Cache,
        *,
        mirror: str = "",
        patience: DownloadPatience | None = None,
        progress: FetchProgress | None = None,
    ) -> None:
        if mirror and not is_address(mirror):
            raise InputError(
                f"expected an address such as https://mirror.example/dem, given {mirror[:200]!r}", where="--mirror"
            )
        self.cache, self.source = cache, cache.source
        self._mirror = mirror.rstrip("/")
        self._patience = patience or DownloadPatience()
        self._progress = progress
        self._lists: dict[str, tuple[frozenset[str], str] | LinkError] = {}

    def run(self, cells: Sequence[Cell]) -> list[Fetched]:
        """Bring every tile that is not in the cache. Raises LinkError, naming each that could not be downloaded."""
        done: list[Fetched] = []
        failed: list[tuple[Cell, GcsplanError]] = []
        for i, cell in enumerate(cells):
            try:
                done.append(self._one(cell))
            except (LinkError, InputError) as why:
                failed.append((cell, why))
                if isinstance(why, ServerUnreachable):
                    failed += [(c, LinkError("not tried")) for c in cells[i + 1 :] if not self._is_good(c)]
                    break
        if failed:
            lines = "\n".join(f"  {cell.name}: {why}" for cell, why in failed)
            raise LinkError(
                f"{len(failed)} of {len(cells)} tiles could not be downloaded; the others are kept, and the same "
                f"command goes on from here:\n{lines}",
                reason="download",
            )
        return done

    def look(self, cells: Sequence[Cell]) -> list[Fetched]:
        """The same without the network. Raises InputError if a tile is not in the cache, or damaged there."""
        bad = tuple(cell for cell in cells if not self._is_good(cell))
        if bad:
            raise InputError.of([self.cache.missing(bad, "--offline")])
        return [Fetched(cell, record, True) for cell, record in self.cache.need(cells, where="--offline").items()]

    def _is_good(self, cell: Cell) -> bool:
        """Whether the cache holds a tile, undamaged."""
        record = self.cache.find(cell)
        if record is None:
            return False
        return record.state != "tile" or sha256_of(self.cache.tile_path(cell)) == record.sha256

    def _one(self, cell: Cell) -> Fetched:
        try:
            self.cache.folder.mkdir(parents=True, exist_ok=True)
            with self._alone(f"{self.source.name}-{cell.name}"):
                record = self.cache.find(cell) if self._is_good(cell) else None
                if record is not None and (record.state == "tile" or self._is_new(cell)):
                    return Fetched(cell, record, True)
                try:
                    brought = self._bring(cell)
                    _log.info("%s of %s: %s", cell.name, self.source.name, brought.state)
                    return Fetched(cell, brought, False)
                except LinkError:
                    if record is None:
                        raise
                    return Fetched(cell, record, True)  # an old record that there is no tile still counts
        except OSError as why:
            if isinstance(why, GcsplanError):
                raise
            words = f"the cache cannot be written: {why.strerror or why}"
            raise InputError(words, where=str(self.cache.folder)) from why

    def _is_new(self, cell: Cell) -> bool:
        """Whether a record is so new that the lists need not be read again."""
        return _age_days(self.cache.record_path(cell)) < LIST_DAYS

    def _bring(self, cell: Cell) -> TileRecord:
        published, line = self._list(self.source)
        if cell.name in published:
            return self._tile(cell)
        fuller, more = self._list(WITNESS)
        return self._none(cell, "absent" if cell.name in fuller else "sea", (line, more))

    # -- one tile ------------------------------------------------------------------------------------------------

    def _tile(self, cell: Cell) -> TileRecord:
        url = self._address(self.source, self.source.object_of(cell))
        part = self._part(self.cache.folder / cell.name)
        arrived = download(
            url, part, most_bytes=self.source.most_tile_bytes, patience=self._patience, report=self._report(cell.name)
        )
        try:
            verify(part, cell, self.source)
        except InputError as why:
            _drop(part)
            raise LinkError(f"the server's file is not this tile, and was removed: {why.message}", where=url) from None
        record = TileRecord(
            cell.name, self.source.name, "tile", self.source.kind, self.source.vertical_datum, _now(), url,
            arrived.etag, arrived.agrees, arrived.bytes, arrived.sha256,
        )  # fmt: skip
        # Without its record a tile does not count, so the old one goes first and the new one comes last.
        self.cache.record_path(cell).unlink(missing_ok=True)
        _sync(part)
        os.replace(part, self.cache.tile_path(cell))
        self._write(self.cache.record_path(cell), text_of(record).encode())
        _drop(part)
        return record

    def _none(self, cell: Cell, state: TileState, lists: tuple[str, ...]) -> TileRecord:
        source = self.source
        record = TileRecord(cell.name, source.name, state, source.kind, source.vertical_datum, _now(), lists=lists)
        self._write(self.cache.record_path(cell), text_of(record).encode())
        return record

    # -- lists ---------------------------------------------------------------------------------------------------

    def _list(self, source: DemSource) -> tuple[frozenset[str], str]:
        """The tiles that a source publishes, and a line that names the list."""
        found = self._lists.get(source.bucket)
        if found is None:
            try:
                with self._alone(f"list-{source.bucket}"):
                    found = self._read_list(source)
            except LinkError as why:
                found = why
            self._lists[source.bucket] = found
        if isinstance(found, LinkError):
            raise found
        return found

    def _read_list(self, source: DemSource) -> tuple[frozenset[str], str]:
        url = self._address(source, source.listing)
        folder = self.cache.root / "lists"
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / f"{hashlib.sha256(url.encode()).hexdigest()[:16]}-{source.bucket}.txt"
        names = _tiles_in(source, file) if _age_days(file) < LIST_DAYS else None
        if names is None:
            part = self._part(file)
            download(
                url,
                part,
                most_bytes=MOST_LIST_BYTES,
                patience=self._patience,
                report=self._report(f"list of {source.name}"),
            )
            names = _tiles_in(source, part)
            if names is None:
                _drop(part)
                raise LinkError(
                    f"the server's file is not the whole list of {source.title}, so that a tile that it lacks "
                    "could be land",
                    where=url,
                )
            _sync(part)
            os.replace(part, file)
            _drop(part)
        return names, f"{url} sha256:{sha256_of(file)}"

    # -- files ---------------------------------------------------------------------------------------------------

    def _address(self, source: DemSource, name: str) -> str:
        return f"{self._mirror}/{source.bucket}/{name}" if self._mirror else f"{source.address}/{name}"

    def _report(self, name: str) -> Callable[[int, int | None], None] | None:
        progress = self._progress
        return None if progress is None else lambda have, whole: progress(name, have, whole)

    def _part(self, path: Path) -> Path:
        own = "" if POSIX else f"-{os.getpid()}"
        return path.with_name(f"{path.name}{own}.part")

    def _write(self, path: Path, data: bytes) -> None:
        part = self._part(path)
        part.write_bytes(data)
        _sync(part)
        os.replace(part, path)

    @contextmanager
    def _alone(self, name: str) -> Iterator[None]:
        """Keep other processes from the same tile; they wait, and then find it in the cache."""
        if not POSIX:
            yield
            return
        folder = self.cache.root / "locks"
        folder.mkdir(parents=True, exist_ok=True)
        until = time.monotonic() + self._patience.whole_s
        with (folder / name).open("ab") as file:
            while True:
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    if time.monotonic() > until:
                        raise LinkError(
                            f"another gcsplan has been fetching it for {self._patience.whole_s:g} s"
                        ) from None
                    time.sleep(0.05)
            yield


def verify(path: Path, cell: Cell, source: DemSource) -> Raster:
    """The raster in ``path``. Raises InputError unless it is this tile of this source, and every cell can be read."""
    import numpy as np

    with path.open("rb") as file:
        if file.read(4) not in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
            raise InputError("it is no GeoTIFF")
    raster = open_raster(path, where="")
    tile = f"{cell.name} of {source.name}"
    if not raster.crs.geographic:
        raise InputError(f"it is not in degrees, as {tile} is")
    if raster.vertical is not None and raster.vertical.name != source.vertical_datum:
        raise InputError(f"its heights are {raster.vertical.name}, and {tile} has heights {source.vertical_datum}")
    # The first node lies on the north-west corner; the last ones on the next tiles' first, or one cell before.
    off = (
        (raster.west + 0.5 * raster.dx - cell.lon_deg) / raster.dx,
        (raster.north - 0.5 * raster.dy - cell.lat_deg - 1.0) / raster.dy,
    )
    more = 1 if source.shares_edges else 0
    sides = (raster.cols - more) * raster.dx, (raster.rows - more) * raster.dy
    if max(map(abs, off)) > 1e-3 or not all(math.isclose(side, 1.0, abs_tol=1e-6) for side in sides):
        raise InputError(
            f"it covers {sides[0]:.6g}° by {sides[1]:.6g}° from {raster.north - 0.5 * raster.dy:.6f}, "
            f"{raster.west + 0.5 * raster.dx:.6f}; {tile} covers one degree from {cell.lat_deg + 1}, {cell.lon_deg}"
        )
    known = sum(int(np.isfinite(strip).sum()) for _, strip in raster.read(0, 0, raster.cols, raster.rows))
    if not known:
        raise InputError("it holds nothing but voids")
    return raster


def _tiles_in(source: DemSource, path: Path) -> frozenset[str] | None:
    try:
        return source.tiles_in(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        return None


def _age_days(path: Path) -> float:
    """Days since a file was written; a file that is not there, or from the future, is old."""
    try:
        age = (time.time() - path.stat().st_mtime) / 86_400.0
    except OSError:
        return math.inf
    return age if age >= 0.0 else math.inf


def _sync(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _drop(part: Path) -> None:
    """Remove a part and the file beside it."""
    part.unlink(missing_ok=True)
    part.with_name(part.name + ".json").unlink(missing_ok=True)


def _now() -> str:
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
