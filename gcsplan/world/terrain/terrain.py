"""Loads the terrain that a mission names as the `Surface` over which paths are planned and checked.

`open_terrain` reads only headers, so that `Terrain.covers` works before there is a plane; `load_terrain` reads the part
that a mission needs. Unknown ground (voids, nodata, outside of every tile) stays NaN.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.datum import VerticalDatum, stated_datum, vertical_datum
from gcsplan.world.geodesy.frame import FARTHEST_M, Frame
from gcsplan.world.geodesy.height_unit import METRE
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Box
from gcsplan.world.terrain.geoid import GeoidGrid
from gcsplan.world.terrain.mixture import TerrainLayer, cell_m, finest_first, mixed
from gcsplan.world.terrain.model_words import heights_read
from gcsplan.world.terrain.mosaic import (
    Mosaic,
    NotCovered,
    Tile,
    Window,
    hash_of,
    layers_of,
    require_known_units,
    tiles_of,
)
from gcsplan.world.terrain.obstacles import canopy_on
from gcsplan.world.terrain.peaks import Peak, flat_grid, peaks_grid
from gcsplan.world.terrain.raster import MAX_CELLS, Raster, open_raster, require_file
from gcsplan.world.terrain.sample import SAMPLE, sample_jacksboro
from gcsplan.world.terrain.voids import take_out_zeros

HeightUnitKey = Literal["m", "ft", "us_ft"]
NO_MORE_VOIDS: Literal["none"] = "none"

RASTER_SPARE_M = 3000.0
"""Read around the requested box, m, so that the edge of the map lies beyond the box."""

WIDER_M, WIDER_CELLS = (4000.0, 8000.0, 16_000.0, 32_000.0, 64_000.0, 120_000.0), 30_000_000
"""How far around the box, m, and over how many cells zeros are followed that fill the window to its border."""

STANDING, CANOPY, MIXED = 2, 4, 4
"""Arrays of a window that are held at once where obstacles of one height stand, with a canopy, or of several layers."""

MOST_LAYERS = 20
"""Most grids of one terrain: each is looked at all over the finest one."""

FILES_NAMED = 4
"""Files of a layer that a note names."""

GEOID_STEP_M = 100.0
"""Spacing at which the geoid is looked up, linear between, m: it bends by less than a millimetre over that."""


@dataclass(frozen=True, slots=True)
class TerrainSpec:
    """The terrain as the user states it; paths are opened as they are (the mission file resolves relative ones).

    Either ``dem`` (paths of tiles, or ``sample:jacksboro`` alone), or ``flat_m`` with ``peaks`` on it (metres of a
    local frame; heights above its ``up_m: 0``). ``crs`` and ``height_unit`` count before the rasters' own statements.
    ``nodata``: a number of the rasters that stands for no height, or "none": only the numbers that they declare do, and
    exact zeros are ground or sea.
    ``obstacle_height_m`` stands everywhere; ``canopy`` is a raster of heights above ground, whose nodata cells are
    unknown unless ``canopy_nodata_m`` sets their height; if both are set the higher one counts. ``sea``: where a
    published source has no tile, or no tile of the user's own knows the ground, there is sea. ``held``: by
    their names in ``dem``, GeoTIFFs that lie on no disk.
    """

    dem: tuple[str, ...] = ()
    vertical_datum: str | None = None
    geoid_grid: str | None = None
    crs: str | None = None
    height_unit: HeightUnitKey | None = None
    nodata: float | Literal["none"] | None = None
    flat_m: float | None = None
    peaks: tuple[Peak, ...] = ()
    obstacle_height_m: float = 0.0
    canopy: str | None = None
    canopy_nodata_m: float | None = None
    sea: bool = False
    held: Mapping[str, bytes] = field(default_factory=dict)


class OpenTerrain(Protocol):
    """A terrain that has been found and accepted, as far as that is possible before a mission's area is known."""

    @property
    def middle_deg(self) -> tuple[float, float] | None:
        """Latitude and longitude of a place in the middle of some tile; None for terrain that is everywhere."""

    def covers(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> Bools:
        """True where a place lies on the terrain (which may still be void there)."""

    def around(self, frame: Frame, box: Box) -> Terrain:
        """The terrain that a mission in ``box`` (west, south, east, north, plane metres) uses. Raises InputError."""


class Terrain(OpenTerrain, Protocol):
    """A terrain whose headers have been read and accepted."""

    @property
    def is_flat(self) -> bool:
        """True if the ground has one height everywhere."""

    @property
    def geoid(self) -> GeoidGrid | None:
        """The geoid grid that ellipsoidal heights are converted with; None if there is none."""

    def extent(self, frame: Frame, box: Box) -> Box:
        """A box of the plane that holds all of the terrain, as far as the plane reaches; ``box`` is the mission's."""

    def load(self, frame: Frame, box: Box, *, most_cells: int | None = None) -> Surface:
        """The surface over ``box`` (west, south, east, north, plane metres).

        ``most_cells``: raise InputError if the surface needs more cells, or a grid coarser than it should be; None:
        only the general limits apply.
        """


class Tiles(Protocol):
    """Files as one grid of heights: a `Mosaic` of rasters, or posts of another kind."""

    @property
    def rasters(self) -> Sequence[Tile]:
        """The files."""

    def covers(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> Bools:
        """See `OpenTerrain.covers`."""

    def extent(self, frame: Frame, box: Box) -> Box:
        """See `Terrain.extent`."""

    def window(self, frame: Frame, box: Box, *, spare_m: float = 0.0, most_cells: int | None = None) -> Window:
        """See `Mosaic.window`."""

    def node_degrees(self, window: Window, cols: ArrayLike, rows: ArrayLike) -> tuple[Floats, Floats]:
        """See `Mosaic.node_degrees`."""


def load_terrain(spec: TerrainSpec, frame: Frame, box: Box, *, where: str) -> Surface:
    """The surface over ``box`` (west, south, east, north, plane metres); ``where`` names the spec in messages.

    Raises InputError for every fault of the files, for a missing or contradictory datum, if the DEM does not meet the
    box or holds only voids there, and if the window would not fit into memory.
    """
    return open_terrain(spec, where=where).load(frame, box)


def open_terrain(spec: TerrainSpec, *, where: str) -> Terrain:
    """Open and check every file of ``spec`` without reading heights. Raises InputError."""
    if bool(spec.dem) == (spec.flat_m is not None or bool(spec.peaks)):
        raise InputError("give either `dem` or `flat_m` and `peaks`", where=where)
    if not spec.dem:
        return _LocalTerrain(spec, where)
    at = place(where, "dem")
    rasters = _rasters(spec, at)
    require_known_units(rasters, at)
    layers = layers_of(rasters)
    if len(layers) > MOST_LAYERS:
        raise InputError(
            f"the files lie on {len(layers)} grids, more than {MOST_LAYERS}: bring them together (gdalwarp -tr, or "
            "gdal_merge.py)",
            where=at,
        )
    return _RasterTerrain([Mosaic(layer, where=at) for layer in layers], spec, where, {}, ())


def terrain_of(
    tiles: Tiles,
    spec: TerrainSpec,
    *,
    where: str,
    info: Mapping[str, object] | None = None,
    notes: Sequence[Note] = (),
) -> Terrain:
    """Terrain of tiles on one grid; ``spec`` states the rest, ``info`` and ``notes`` go with its surfaces too.

    Raises InputError.
    """
    return _RasterTerrain([tiles], spec, where, info or {}, notes)


def place(where: str, key: str) -> str:
    """The place of a key in messages; ``where`` is a place in a mission file, or a command-line option (no keys)."""
    return where if where.startswith("-") else f"{where}.{key}" if where else key


class _TileSource:
    """Tiles on one grid, the datum of their heights, and the geoid with which these become heights above the sea."""

    def __init__(self, tiles: Tiles, spec: TerrainSpec, datum: VerticalDatum, where: str) -> None:
        self.tiles, self.datum, self._spec, self._where = tiles, datum, spec, where
        self.geoid = _geoid(spec, datum, where)

    def window(self, frame: Frame, box: Box, *, spare_m: float, most_cells: int, whole: bool = False) -> Window:
        """The window with heights above the sea, without undeclared voids; see `Mosaic.window`."""
        mosaic = self.tiles
        if whole and isinstance(mosaic, Mosaic):
            window = mosaic.window(frame, box, spare_m=spare_m, most_cells=most_cells, whole=True)
        else:
            window = mosaic.window(frame, box, spare_m=spare_m, most_cells=most_cells)
        notes = [n for r in mosaic.rasters for n in r.notes] + list(window.notes)
        if self._spec.nodata is None:
            wider = self._wider(frame, box) if any(window.goes_on) else ()
            degrees = partial(mosaic.node_degrees, window)
            notes += take_out_zeros(window, degrees, wider, where=place(self._where, "dem"))
        if self.datum.note:
            notes.append(self.datum.note)
        if self.geoid is not None:
            _take_off_geoid(window, self.geoid, mosaic)
        return replace(window, notes=tuple(notes))

    @property
    def datum_words(self) -> str:
        """The datum for the outputs."""
        return self.datum.name if self.geoid is None else f"{self.datum.name}, made AMSL with {self.geoid.path.name}"

    def _wider(self, frame: Frame, box: Box) -> Iterator[Window]:
        """Windows around ``box`` that grow until the tiles end, or what may be read for them."""
        west, south, east, north = box
        for more_m in WIDER_M:
            larger = west - more_m, south - more_m, east + more_m, north + more_m
            try:
                window = self.tiles.window(frame, larger, most_cells=WIDER_CELLS)
            except InputError:
                return
            yield window
            if not any(window.goes_on):
                return


class _RasterTerrain:
    def __init__(
        self,
        tiles: Sequence[Tiles],
        spec: TerrainSpec,
        where: str,
        info: Mapping[str, object],
        notes: Sequence[Note],
    ) -> None:
        self._spec, self._where = spec, where
        self._info, self._notes = info, notes
        self._sources = [
            _TileSource(t, spec, datum, where) for t, datum in zip(tiles, _datums(tiles, spec, where), strict=True)
        ]
        self._canopy: Mosaic | None = None
        if spec.canopy is not None:
            # The canopy's heights are above ground: its vertical datum, if it names one, means nothing.
            raster = open_raster(Path(spec.canopy), where=place(where, "canopy"))
            self._canopy = Mosaic([raster], where=place(where, "canopy"))

    @property
    def middle_deg(self) -> tuple[float, float] | None:
        return next((s.tiles.middle_deg for s in self._sources if isinstance(s.tiles, Mosaic)), None)

    def covers(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> Bools:
        on = np.full(np.broadcast(lat_deg, lon_deg).shape, self._spec.sea)
        for source in self._sources:
            on |= source.tiles.covers(lat_deg, lon_deg)
        return on

    def around(self, frame: Frame, box: Box) -> Terrain:
        return self

    @property
    def is_flat(self) -> bool:
        return False

    @property
    def geoid(self) -> GeoidGrid | None:
        return next((source.geoid for source in self._sources if source.geoid is not None), None)

    def extent(self, frame: Frame, box: Box) -> Box:
        boxes = np.array([source.tiles.extent(frame, box) for source in self._sources])
        low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def load(self, frame: Frame, box: Box, *, most_cells: int | None = None) -> Surface:
        spec = self._spec
        held = CANOPY if self._canopy is not None else STANDING if spec.obstacle_height_m > 0.0 else 1
        held = max(held, MIXED) if self._mixes else held
        most_cells = min(MAX_CELLS // held, MAX_CELLS if most_cells is None else most_cells)
        window, used = self._window(frame, box, most_cells)
        rasters = [raster for source in used for raster in source.tiles.rasters]
        read_hash = hash_of(rasters, window)
        notes = list(window.notes)
        high = window.heights_m
        if np.isnan(high).all():
            raise InputError(
                "the DEM holds nothing but voids around the mission; give one with data here",
                where=place(self._where, "dem"),
            )
        datum = " and ".join(dict.fromkeys(source.datum_words for source in used))
        info: dict[str, object] = {}
        if self.geoid is not None:
            info["geoid_sha256"] = self.geoid.sha256()
        ground = high if window.low_m is None else window.low_m
        rows, cols = ground.shape
        size = window.grid.metres_per_cell(*window.grid.centre)
        info |= {
            "dem_sha256": read_hash,
            "vertical_datum": datum,
            "heights_read": heights_read(
                (r.unit for r in rasters), datum, float(np.nanmin(ground)), float(np.nanmax(high))
            ),
            "resolution_m": _rounded(float(size.max())),
            "bare_dem": spec.obstacle_height_m == 0.0 and spec.canopy is None,
            "source": ", ".join(r.name for r in rasters),
        }
        top = high
        if spec.obstacle_height_m > 0.0:
            top = high + spec.obstacle_height_m
        if self._canopy is not None and spec.canopy is not None:
            unknown_m = np.nan if spec.canopy_nodata_m is None else spec.canopy_nodata_m
            canopy = self._canopy.window(frame, window.plane_box, most_cells=MAX_CELLS // CANOPY)
            trees = canopy_on(window, canopy, unknown_m=unknown_m)
            notes += [n for n in (*self._canopy.rasters[0].notes, *canopy.notes) if n.code != "nodes_unknown"]
            blind = int(np.count_nonzero(np.isnan(trees) & ~np.isnan(ground)))
            if blind:
                notes.append(Note("canopy_unknown", unknown=blind, nodes=rows * cols))
            top = np.maximum(trees, spec.obstacle_height_m, out=trees)  # in place: these are the largest arrays
            top += high
            info["canopy_sha256"] = self._canopy.rasters[0].sha256()
        info |= {**self._info, "notes": (*notes, *self._notes)}
        return Surface(ground, top, window.grid, info, window.goes_on, high)

    @property
    def _mixes(self) -> bool:
        return len(self._sources) > 1 or self._spec.sea

    def _window(self, frame: Frame, box: Box, most_cells: int) -> tuple[Window, list[_TileSource]]:
        """The window with the ground of all sources, and those that are in it. Raises InputError if none is."""
        if not self._mixes:
            only = self._sources[0]
            return only.window(frame, box, spare_m=RASTER_SPARE_M, most_cells=most_cells), self._sources
        wide = box[0] - RASTER_SPARE_M, box[1] - RASTER_SPARE_M, box[2] + RASTER_SPARE_M, box[3] + RASTER_SPARE_M
        beside: NotCovered | None = None
        found: list[tuple[TerrainLayer, _TileSource]] = []
        for source in self._sources:
            try:
                window = source.window(frame, wide, spare_m=0.0, most_cells=most_cells)
            except NotCovered as why:
                beside = beside or why
                continue
            name = ", ".join(r.name for r in source.tiles.rasters[:FILES_NAMED])
            found.append((TerrainLayer(window, cell_m(window), name), source))
        if not found:
            assert beside is not None
            raise beside
        used = {id(layer): source for layer, source in found}
        order = finest_first([layer for layer, _ in found])
        finest = used[id(order[0])]
        held = wide if self._spec.sea else _within(wide, [layer.window.plane_box for layer, _ in found])
        whole = finest.window(frame, held, spare_m=0.0, most_cells=most_cells, whole=True)
        # Every other layer must reach as far as the finest one's grid does.
        around = [
            used[id(layer)].window(frame, whole.plane_box, spare_m=0.0, most_cells=most_cells) for layer in order[1:]
        ]
        layers = [replace(order[0], window=whole)]
        layers += [replace(layer, window=window) for layer, window in zip(order[1:], around, strict=True)]
        window = mixed(layers, sea=self._spec.sea)
        if self._spec.sea:
            degrees = partial(finest.tiles.node_degrees, window)
            window = replace(window, notes=(*window.notes, *take_out_zeros(window, degrees, where=self._where)))
        if beside is not None:  # a source that ends before this window may go on elsewhere
            window = replace(window, goes_on=(True, True, True, True))
        return window, [used[id(layer)] for layer in order]


def _within(box: Box, parts: Sequence[Box]) -> Box:
    """The part of a box that the box around ``parts`` holds, too."""
    low, high = np.min(parts, axis=0), np.max(parts, axis=0)
    west, south = max(box[0], float(low[0])), max(box[1], float(low[1]))
    return west, south, min(box[2], float(high[2])), min(box[3], float(high[3]))


def _datums(tiles: Sequence[Tiles], spec: TerrainSpec, where: str) -> list[VerticalDatum]:
    """The datum of each source. The user's statement counts for all, or for sources that state none beside others."""
    at, stated = place(where, "vertical_datum"), [t.rasters[0].vertical for t in tiles]
    silent = None in stated
    return [
        vertical_datum(None if silent and own is not None and len(tiles) > 1 else spec.vertical_datum, own, where=at)
        for own in stated
    ]


class _LocalTerrain:
    """Flat ground and peaks: known everywhere."""

    middle_deg = None

    def __init__(self, spec: TerrainSpec, where: str) -> None:
        self._spec = spec
        for key in ("geoid_grid", "crs", "height_unit", "nodata", "canopy", "canopy_nodata_m"):
            if getattr(spec, key) is not None:
                raise InputError(f"{key} belongs to a `dem`, not to flat ground and peaks", where=place(where, key))
        at = place(where, "vertical_datum")
        self._datum = vertical_datum(spec.vertical_datum or "AMSL", None, where=at)
        require_metres(spec, "flat ground and peaks are", where=at)
        if self._datum.ellipsoidal:
            raise InputError("flat ground and peaks are above mean sea level", where=at)

    def covers(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> Bools:
        return np.ones(np.shape(lat_deg), np.bool_)

    def around(self, frame: Frame, box: Box) -> Terrain:
        return self

    @property
    def is_flat(self) -> bool:
        return not self._spec.peaks

    @property
    def geoid(self) -> GeoidGrid | None:
        return None

    def extent(self, frame: Frame, box: Box) -> Box:
        return -FARTHEST_M, -FARTHEST_M, FARTHEST_M, FARTHEST_M

    def load(self, frame: Frame, box: Box, *, most_cells: int | None = None) -> Surface:
        spec = self._spec
        base = frame.amsl_m + (spec.flat_m or 0.0)
        heights, grid = peaks_grid(base, spec.peaks, box, most_cells) if spec.peaks else flat_grid(base, box)
        canonical = json.dumps(
            {"flat_m": spec.flat_m or 0.0, "peaks": [asdict(p) for p in spec.peaks], "amsl_m": frame.amsl_m},
            sort_keys=True,
        )
        info: dict[str, object] = {
            "dem_sha256": hashlib.sha256(canonical.encode()).hexdigest(),
            "vertical_datum": self._datum.name,
            "heights_read": heights_read((METRE,), self._datum.name, float(heights.min()), float(heights.max())),
            "resolution_m": _rounded(float(grid.metres_per_cell(0.0, 0.0).max())) if spec.peaks else 0,
            "bare_dem": spec.obstacle_height_m == 0.0,
            "source": f"{len(spec.peaks)} peaks" if spec.peaks else "flat",
            "notes": () if self._datum.note is None else (self._datum.note,),
        }
        top = heights + spec.obstacle_height_m if spec.obstacle_height_m > 0.0 else heights
        west, south, east, north = box
        goes_on = (west > -FARTHEST_M, north < FARTHEST_M, east < FARTHEST_M, south > -FARTHEST_M)
        return Surface(heights, top, grid, info, goes_on)


def _rasters(spec: TerrainSpec, where: str) -> list[Raster]:
    if SAMPLE in spec.dem:
        if len(spec.dem) > 1 or spec.crs or spec.height_unit or spec.nodata is not None:
            raise InputError(f"{SAMPLE} stands alone: no other tile, no crs, height_unit or nodata", where=where)
        return [sample_jacksboro()]
    if any(d.startswith("sample:") for d in spec.dem):
        raise InputError(f"the only sample is {SAMPLE}, given {spec.dem[0]}", where=where)
    if spec.held:  # in the order given, which counts where layers overlap
        paths = [path for d in spec.dem for path in ([d] if d in spec.held else tiles_of([d], where=where))]
    else:
        paths = tiles_of(spec.dem, where=where)
    datum = place(where.removesuffix(".dem"), "vertical_datum")
    unit = None if spec.vertical_datum is None else stated_datum(spec.vertical_datum, where=datum)[1]
    nodata = None if spec.nodata == NO_MORE_VOIDS else spec.nodata
    return [
        open_raster(
            Path(path), where=f"{where}[{i}]" if len(paths) > 1 else where, crs=spec.crs,
            height_unit=spec.height_unit, datum_unit=unit, nodata=nodata, data=spec.held.get(path),
        )
        for i, path in enumerate(paths)
    ]  # fmt: skip


def _geoid(spec: TerrainSpec, datum: VerticalDatum, where: str) -> GeoidGrid | None:
    at = place(where, "geoid_grid")
    if datum.ellipsoidal:
        if spec.geoid_grid is None:
            raise InputError(
                f"heights above the ellipsoid ({datum.name}) must be converted to mean sea level; give the geoid with "
                "`geoid_grid: FILE` (for example egm96_15.gtx, or us_nga_egm96_15.tif from cdn.proj.org)",
                where=at,
            )
        require_file(Path(spec.geoid_grid), where=at)
        return GeoidGrid(Path(spec.geoid_grid), where=at)
    if spec.geoid_grid is not None:
        raise InputError(
            f"a geoid grid is for ellipsoidal heights, and these are {datum.name}: remove it, or state "
            "`vertical_datum: WGS84`",
            where=at,
        )
    return None


def require_metres(spec: TerrainSpec, what: str, *, where: str) -> None:
    """Raise InputError if the vertical datum that ``spec`` names states another unit than metres."""
    unit = None if spec.vertical_datum is None else stated_datum(spec.vertical_datum, where=where)[1]
    if unit is not None and not unit.is_same(METRE):
        raise InputError(
            f"{what} in metres, and {spec.vertical_datum} counts {unit.name}: name the datum of heights in metres",
            where=where,
        )


def _take_off_geoid(window: Window, geoid: GeoidGrid, mosaic: Tiles) -> None:
    """Lower every node, in place, by the geoid's height above the ellipsoid there."""
    rows, cols = window.heights_m.shape
    size = window.grid.metres_per_cell(*window.grid.centre)
    c, r = (_sampled(n, max(1, int(GEOID_STEP_M / m))) for n, m in zip((cols, rows), size, strict=True))
    lat, lon = mosaic.node_degrees(window, c, r)
    coarse = geoid.height_m(lat, lon)
    along = np.stack([np.interp(np.arange(cols), c, line) for line in coarse])
    below = np.searchsorted(r, np.arange(rows), side="right").clip(1, len(r) - 1) - 1
    weight = (np.arange(rows) - r[below]) / (r[below + 1] - r[below])
    for heights in (window.heights_m, window.low_m):
        if heights is not None:
            for line, j, w in zip(heights, below, weight, strict=True):
                line -= (1.0 - w) * along[j] + w * along[j + 1]


def _sampled(count: int, step: int) -> Indices:
    """0, step, 2·step … and the last index."""
    return np.unique(np.append(np.arange(0, count, step), count - 1))


def _rounded(metres: float) -> float:
    """Rounded to whole metres; below 10 m to millimetres (the papers' worlds are fine-grained)."""
    return round(metres) if metres >= 10.0 else round(metres, 3)
