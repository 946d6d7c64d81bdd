"""ArduPilot's terrain files, read and written: N36W085.DAT holds the blocks of one degree tile, 2048 bytes a record.

AP_Terrain (`grid_block`, `seek_offset`) defines the layout: little-endian, a CRC-16 over the block, and the record's
place in the file given by the block's place in the tile. A record of zeros is a block that nobody has filled. An export
writes the blocks around a mission, together with the blocks of existing files.
"""

from __future__ import annotations

import binascii
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats, Indices
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.terrain.cell import Cell, cell_of
from gcsplan.world.terrain.grid import (
    ALL_PARTS,
    PART_POSTS,
    PARTS_OF_BLOCK,
    POSTS_OF_BLOCK,
    SAME_CORNER_E7,
    STRIDE,
    Block,
    PostHeights,
    TerrainGrid,
    known_parts,
)
from gcsplan.world.terrain.raster import require_file

RECORD_BYTES = 2048
DAT_SUFFIX = ".DAT"
VERSION = 1
MOST_DAT_BYTES = 256 * 2**20
"""Most bytes of one file, and of all files that one mission uses. A tile with posts every 15 m has fewer; so do nine
tiles with posts every 40 m."""

RECORD = np.dtype([
    ("bitmap", "<u8"), ("lat", "<i4"), ("lon", "<i4"), ("crc", "<u2"), ("version", "<u2"), ("spacing", "<u2"),
    ("height", "<i2", POSTS_OF_BLOCK), ("north", "<u2"), ("east", "<u2"), ("lon_degrees", "<i2"), ("lat_degrees", "i1"),
    ("spare", "V227"),
])  # fmt: skip
CRC_BYTES = RECORD_BYTES - 227
_CRC_AT = slice(16, 18)


MOST_BLOCKS_WRITTEN = 20_000
"""Blocks that are written at once, 40 MB: 250 × 250 km with posts every 100 m."""

KM_A_DEGREE = 111.2


class DatBlocks(Mapping[Block, Floats]):
    """Heights (28, 32) of the good blocks of a file, NaN for parts that are not known.

    They are kept as the file's own records, which take a quarter of the memory, and are decoded at their first use: a
    mission uses a few blocks of a tile.
    """

    def __init__(self, records: NDArray[np.void], numbers: Mapping[Block, int]) -> None:
        self._records, self._numbers = records, numbers

    def __getitem__(self, block: Block) -> Floats:
        return _heights(self._records[self._numbers[block]])

    def __contains__(self, block: object) -> bool:
        return block in self._numbers

    def __iter__(self) -> Iterator[Block]:
        return iter(self._numbers)

    @cached_property
    def places(self) -> Indices:
        """(N, 2) the places of all blocks in the tile, north and east, in their order."""
        return np.array([(block.north, block.east) for block in self._numbers], np.intp).reshape(-1, 2)

    def within(self, north: tuple[float, float], east: tuple[float, float]) -> Iterator[tuple[Block, Floats]]:
        """The blocks that hold posts with these first and last numbers, and their heights."""
        some = np.ones(len(self), np.bool_)
        for at, (first, last), stride in zip(self.places.T, (north, east), STRIDE, strict=True):
            some &= (at * stride <= last) & ((at + 1) * stride >= first)
        cell = next(iter(self._numbers)).cell
        for k in np.flatnonzero(some).tolist():
            block = Block(cell, *self.places[k].tolist())
            yield block, self[block]

    def __len__(self) -> int:
        return len(self._numbers)


@dataclass(frozen=True, eq=False)
class DatFile:
    """One file: its tile, its spacing, and the heights of its good blocks.

    ``left_out``: how many blocks are not used, by their fault.
    """

    name: str
    cell: Cell
    grid: TerrainGrid
    blocks: DatBlocks
    left_out: Mapping[Note, int]

    @property
    def notes(self) -> tuple[Note, ...]:
        """Notes for the user on its faults."""
        return tuple(
            Note("terrain_blocks_unused", file=self.name, count=n, why=why) for why, n in self.left_out.items()
        )


def file_name(cell: Cell) -> str:
    """Such as ``N36W085.DAT``."""
    return cell.name + DAT_SUFFIX


def cell_of_file(path: Path, *, where: str) -> Cell:
    """The tile that a file's name gives. Raises InputError if it gives none."""
    cell = cell_of(path.stem.upper())
    if cell is None:
        raise InputError(
            f"{path} must be named after its south-west corner, as N36W085.DAT, given {path.name}", where=where
        )
    return cell


def is_dat(path: Path) -> bool:
    """Whether a file of this name is a terrain file of ArduPilot."""
    return path.suffix.upper() == DAT_SUFFIX


def packed(grid: TerrainGrid, cell: Cell, blocks: Mapping[Block, Floats]) -> bytes:
    """The bytes of a file with ``blocks``, of one tile; blocks of which nothing is known are left out."""
    known = {block: heights for block, heights in blocks.items() if known_parts(heights)}
    if not known:
        return b""
    row = grid.blocks_a_row(cell)
    last = max(block.north * row + block.east for block in known)
    out = np.zeros(last + 1, RECORD)
    for block, heights in known.items():
        record = out[block.north * row + block.east]
        record["bitmap"], record["version"], record["spacing"] = known_parts(heights), VERSION, grid.spacing_m
        record["lat"], record["lon"] = grid.corner_e7(block)
        record["height"] = np.where(np.isnan(heights), 0.0, heights)
        record["north"], record["east"] = block.north, block.east
        record["lat_degrees"], record["lon_degrees"] = cell.lat_deg, cell.lon_deg
        record["crc"] = crc_of(record.tobytes())
    return out.tobytes()


def crc_of(record: bytes) -> int:
    """The CRC-16 (XMODEM) of a record, its own field counted as zero."""
    data = bytearray(record[:CRC_BYTES])
    data[_CRC_AT] = b"\0\0"
    return binascii.crc_hqx(bytes(data), 0)


def read_dat(path: Path, *, where: str) -> DatFile:
    """Read a file. Blocks that the autopilot would not take are left out. Raises InputError if none is left."""
    require_file(path, where=where)
    size = path.stat().st_size
    cell = cell_of_file(path, where=where)
    if size > MOST_DAT_BYTES or size % RECORD_BYTES:
        raise InputError(
            f"{path} is no terrain file of ArduPilot: {size} bytes, expected records of {RECORD_BYTES} bytes, "
            f"{MOST_DAT_BYTES >> 20} MB at most",
            where=where,
        )
    try:
        data = path.read_bytes()
    except OSError as why:
        raise InputError(f"{path} cannot be read: {why.strerror or why}", where=where) from None
    records = np.frombuffer(data, RECORD)
    used = [int(k) for k in np.flatnonzero(records["bitmap"] & np.uint64(ALL_PARTS))]
    spacings = Counter(int(records["spacing"][k]) for k in used)
    left_out: Counter[Note] = Counter()
    if not used:
        raise InputError(f"{path} holds no block of terrain: copy it after the autopilot has filled it", where=where)
    grid = TerrainGrid(max(spacings, key=lambda s: (spacings[s], -s)))
    numbers: dict[Block, int] = {}
    for k in used:
        fault = _fault(records, k, data, grid, cell) if grid.spacing_m > 0 else Note("spacing_is_zero")
        if fault:
            left_out[fault] += 1
            continue
        numbers[Block(cell, int(records["north"][k]), int(records["east"][k]))] = k
    if not numbers:
        raise InputError(f"{path} holds no good block of terrain: {next(iter(left_out))}", where=where)
    return DatFile(path.name, cell, grid, DatBlocks(records, numbers), dict(left_out))


def _fault(records: NDArray[np.void], k: int, data: bytes, grid: TerrainGrid, cell: Cell) -> Note | None:
    """Why the autopilot does not take a record; None if it does."""
    record = records[k]
    if int(record["crc"]) != crc_of(data[k * RECORD_BYTES : (k + 1) * RECORD_BYTES]):
        return Note("checksum_wrong")
    if int(record["version"]) != VERSION:
        return Note("format_of_other_version", version=int(record["version"]), wanted=VERSION)
    if int(record["spacing"]) != grid.spacing_m:
        return Note("spacing_differs", spacing_m=int(record["spacing"]), most_m=grid.spacing_m)
    block = Block(cell, int(record["north"]), int(record["east"]))
    lat, lon = grid.corner_e7(block)
    stated = (int(record["lat_degrees"]), int(record["lon_degrees"]))
    misplaced = max(abs(lat - int(record["lat"])), abs(lon - int(record["lon"]))) > SAME_CORNER_E7
    if stated != cell or misplaced or k != block.north * grid.blocks_a_row(cell) + block.east:
        return Note("block_lies_elsewhere")
    return None


def _heights(record: np.void) -> Floats:
    if int(record["bitmap"]) & ALL_PARTS == ALL_PARTS:
        return np.asarray(record["height"], float)
    bits = (
        int(record["bitmap"]) >> np.arange(PARTS_OF_BLOCK[0] * PARTS_OF_BLOCK[1], dtype=np.uint64).astype(object)
    ) & 1
    known = np.kron(np.array(bits, bool).reshape(PARTS_OF_BLOCK), np.ones((PART_POSTS, PART_POSTS), bool))
    return np.where(known, record["height"].astype(float), np.nan)


@dataclass(frozen=True, slots=True)
class DatContent:
    """One file: its bytes, how many blocks are new and how many were there."""

    path: Path
    data: bytes
    blocks: int
    kept: int

    def as_dict(self) -> dict[str, object]:
        """The values for JSON."""
        return {"file": str(self.path), "blocks": self.blocks, "kept": self.kept, "bytes": len(self.data)}


@dataclass(frozen=True, slots=True)
class DatContents:
    """All files, and how many blocks are unknown, or partly known."""

    files: tuple[DatContent, ...]
    unknown: int
    partly: int


def blocks_around(
    grid: TerrainGrid, box_deg: tuple[float, float, float, float], margin_km: float, *, where: str
) -> list[Block]:
    """The blocks of a box (south, west, north, east) and a margin. Raises InputError beyond `MOST_BLOCKS_WRITTEN`."""
    south, west, north, east = box_deg
    more = margin_km / KM_A_DEGREE
    wide = more / max(0.01, math.cos(math.radians(max(abs(south), abs(north)))))
    edges = (max(south - more, -90.0), west - wide, min(north + more, 90.0), east + wide)
    blocks = list(islice(grid.blocks_within(*(x * 1e7 for x in edges)), MOST_BLOCKS_WRITTEN + 1))
    if len(blocks) > MOST_BLOCKS_WRITTEN:
        raise InputError(
            f"the mission and {margin_km:g} km around it are more than {MOST_BLOCKS_WRITTEN} blocks of "
            f"{grid.spacing_m} m: give a smaller --margin-km or a larger --spacing",
            where=where,
        )
    return sorted(blocks)


def contents_of(posts: PostHeights, blocks: Iterable[Block], folder: Path, *, add: bool, where: str) -> DatContents:
    """The files for ``blocks`` in ``folder``; with ``add`` the other blocks of files that are there stay.

    Raises InputError if a file is there and ``add`` is not given, if its spacing is another, and if nothing is known.
    """
    heights = {block: posts.block(block) for block in blocks}
    bits = {block: known_parts(h) for block, h in heights.items()}
    files = []
    for cell in dict.fromkeys(block.cell for block in heights if bits[block]):
        mine = {block: h for block, h in heights.items() if block.cell == cell and bits[block]}
        path, others = folder / file_name(cell), {}
        if path.exists():
            if not add:
                raise InputError("is there already: move it away, or give --add to keep its other blocks",
                                 where=str(path))  # fmt: skip
            old = read_dat(path, where=str(path))
            if old.grid != posts.grid:
                raise InputError(
                    f"has posts every {old.grid.spacing_m} m, not {posts.grid.spacing_m}: move it away, or give "
                    "--spacing",
                    where=str(path),
                )
            others = {block: h for block, h in old.blocks.items() if block not in mine}
        files.append(DatContent(path, packed(posts.grid, cell, others | mine), len(mine), len(others)))
    if not files:
        raise InputError("its terrain is unknown everywhere: nothing is written", where=where)
    unknown = sum(not b for b in bits.values())
    return DatContents(tuple(files), unknown, sum(0 < b < ALL_PARTS for b in bits.values()))
