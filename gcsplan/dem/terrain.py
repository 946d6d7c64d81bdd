"""Opens the terrain that a mission states: rasters, ArduPilot's .DAT files, flat ground, or a published source.

A source's tiles come from the cache alone, and a mission uses the tiles that its first window needs: the same ones
whatever else the cache holds, so that a plan does not change when another mission's tiles are fetched.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Bools, Floats
from gcsplan.dem.cache import Cache, TileRecord
from gcsplan.dem.dat_terrain import DatTerrain, dat_files
from gcsplan.dem.sources import SOURCES, DemSource, cells_in, names_of
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.datum import VerticalDatum, take_apart
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geodesy.height_unit import METRE
from gcsplan.world.geometry.zones import Box
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.input_files import sha256_of, sha256_of_all
from gcsplan.world.terrain.mosaic import Mosaic
from gcsplan.world.terrain.raster import Raster, open_raster
from gcsplan.world.terrain.terrain import (
    NO_MORE_VOIDS,
    OpenTerrain,
    Terrain,
    TerrainSpec,
    open_terrain,
    place,
    require_metres,
    terrain_of,
)

TILE_ROWS = 3600
"""Rows of a tile of sea if no tile beside it has another number."""


def open_dem(spec: TerrainSpec, *, where: str) -> OpenTerrain:
    """Open what ``spec`` names; a published source is one name of `SOURCES`. Raises InputError."""
    named = [name for name in spec.dem if name in SOURCES]
    if not named:
        paths = dat_files(spec.dem, where=place(where, "dem"))
        if spec.sea and (paths or not spec.dem):
            raise InputError("sea goes with rasters and published sources: remove it", where=place(where, "sea"))
        return DatTerrain(paths, spec, where=where) if paths else open_terrain(spec, where=where)
    if len(spec.dem) > 1:
        raise InputError(f"{named[0]} stands alone: no other tile beside it", where=place(where, "dem"))
    for key in ("crs", "height_unit", "nodata"):
        if getattr(spec, key) is not None:
            raise InputError(f"{named[0]} states it itself; remove the key", where=place(where, key))
    require_metres(spec, f"the heights of {named[0]} are", where=place(where, "vertical_datum"))
    return _SourceTerrain(SOURCES[named[0]], spec, where)


class _SourceTerrain:
    """A source, all over the globe; which tiles are needed is known with a mission's area."""

    middle_deg = None

    def __init__(self, source: DemSource, spec: TerrainSpec, where: str) -> None:
        self._source, self._spec, self._where = source, spec, where

    def covers(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> Bools:
        return np.ones(np.shape(lat_deg), np.bool_)

    def around(self, frame: Frame, box: Box) -> Terrain:
        at = place(self._where, "dem")
        cache = Cache(self._source)
        records = cache.need(cells_in(frame, box, where=at), where=at)
        sea = [c for c, r in records.items() if r.state == "sea" or (r.state == "absent" and self._spec.sea)]
        absent = [c for c, r in records.items() if r.state == "absent" and c not in sea]
        tiles = {c: _tile(cache, c, r, at) for c, r in records.items() if r.state == "tile"}
        if not tiles and not sea:
            raise InputError(f"{_not_published(self._source, absent)}; give another DEM", where=at)
        sample = next(iter(tiles.values()), None)
        found = [tiles[c] if c in tiles else _sea(self._source, c, sample) for c in records if c in tiles or c in sea]
        # Ground that these sources publish at 0 m is sea: their voids are filled or declared.
        spec = replace(self._spec, dem=(self._source.name,), nodata=NO_MORE_VOIDS, sea=False)
        info, notes = _reported(self._source, records, sea, absent)
        return terrain_of(Mosaic(found, where=at), spec, where=self._where, info=info, notes=notes)


def _reported(
    source: DemSource, records: Mapping[Cell, TileRecord], sea: list[Cell], absent: list[Cell]
) -> tuple[dict[str, object], tuple[Note, ...]]:
    """The report's entry for the terrain, and notes."""
    info: dict[str, object] = {
        "dem_source": source.name,
        "dem_kind": source.kind,
        "dem_tiles": names_of(records),
        "dem_notice": source.notice,
        "source": source.title,
    }
    notes = []
    if source.kind == "surface":
        info["bare_dem"] = False
        notes.append(Note("terrain_is_a_surface", source=source.name))
    if sea:
        info["sea_tiles"] = names_of(sea)
        stated = [c for c in sea if records[c].state == "absent"]
        listed = [c for c in sea if c not in stated]
        if listed:
            notes.append(Note("tiles_are_sea", tiles=names_of(listed), source=source.name))
        if stated:
            notes.append(Note("tiles_are_sea_by_mission", tiles=names_of(stated)))
    if absent:
        notes.append(_not_published(source, absent))
    return info, tuple(notes)


def _not_published(source: DemSource, cells: list[Cell]) -> Note:
    return Note("tiles_not_published", source=source.name, tiles=names_of(cells))


def _tile(cache: Cache, cell: Cell, record: TileRecord, where: str) -> Raster:
    """A cached tile with its source's datum, if it still agrees with its record."""
    path = cache.tile_path(cell)
    if sha256_of(path) != record.sha256:
        raise InputError.of([cache.missing((cell,), where, "damaged, unlike its checksum")])
    raster = open_raster(path, where=where)
    return replace(
        raster, vertical=VerticalDatum(cache.source.vertical_datum),
        unit=replace(METRE, by=f"as {cache.source.name} has them"),
        sha256=lambda: sha256_of_all(raster.files, record.sha256),
    )  # fmt: skip


def _sea(source: DemSource, cell: Cell, sample: Raster | None) -> Raster:
    """A tile at 0 m on the grid that the source's tiles have, ``sample`` being one of them."""
    rows = TILE_ROWS if sample is None else round(1.0 / sample.dy)
    cols = round(rows * source.columns_of(cell) / TILE_ROWS)
    dx, dy = 1.0 / cols, 1.0 / rows
    more = 1 if source.shares_edges else 0

    def read(col: int, row: int, width: int, height: int) -> Iterator[tuple[int, Floats]]:
        yield 0, np.zeros((height, width))

    return Raster(
        f"sea {cell.name}", take_apart("EPSG:4326", where=source.name), cell.lon_deg - 0.5 * dx,
        cell.lat_deg + 1.0 + 0.5 * dy, dx, dy, cols + more, rows + more, VerticalDatum(source.vertical_datum), read,
        (rows + more) * (cols + more), lambda: hashlib.sha256(f"sea {cell.name}".encode()).hexdigest(),
        unit=replace(METRE, by=f"as {source.name} has them"),
    )  # fmt: skip
