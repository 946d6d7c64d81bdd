"""What is to be written as ArduPilot's .DAT files: the blocks around a mission, with those of files that are there."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from gcsplan.dem.dat_file import file_name, packed, read_dat
from gcsplan.errors import InputError
from gcsplan.world.terrain.grid import ALL_PARTS, Block, PostHeights, TerrainGrid, known_parts

MOST_BLOCKS_WRITTEN = 20_000
"""Blocks that are written at once, 40 MB: 250 × 250 km with posts every 100 m."""

KM_A_DEGREE = 111.2


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
