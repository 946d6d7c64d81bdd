"""One raster file: its header, and windows of it in metres with NaN for everything unknown.

GDAL opens a file as the one format that its first bytes, or its name, tell, and only files that exist: a path from a
mission file must never become a web request. A .vrt is read if it only puts GeoTIFFs together.
Heights belong to pixel centres, whatever AREA_OR_POINT states: GDAL's transform refers to the corners in either case.
"""

from __future__ import annotations

import gzip
import hashlib
import math
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.datum import RasterCRS, VerticalDatum, require_unshifted, take_apart, with_vertical_of
from gcsplan.world.geodesy.height_unit import (
    BY_FILE,
    BY_FORMAT,
    METRE,
    HeightUnit,
    unit_named,
    unit_of_prj,
    unit_that_counts,
)
from gcsplan.world.terrain.input_files import absent, beside, files_of, sha256_of_all, states_of, tell_file, tell_raster

Reader = Callable[[int, int, int, int], Iterator[tuple[int, Floats]]]

MAX_CELLS = 50_000_000
"""Most cells of one window with one height each: 400 MB as float64, with which a command stays below 1 GB."""

MAX_BLOCK_BYTES = 64 * 2**20
"""Most bytes of one block of a file. GDAL unpacks a whole block to read one cell; its cache holds no more than this."""

FARTHEST_UNITS, LEAST_CELL = 1e9, 1e-11
"""Coordinates beyond the first are not on Earth in any unit; a cell smaller than the second, as a part of the grid's
largest coordinate, is lost in rounding."""

LOWEST_M, HIGHEST_M = -500.0, 9000.0
"""Ground outside of this range is an undeclared void (-9999, -32768, 3.4e38): unknown."""

MARKS = (-9999.0, -32767.0, -32768.0, -99999.0)
"""Raw numbers that stand for no height, declared or not: in centimetres or with an offset they may look like ground.
So do the largest and the smallest number of an integer of two bytes and more."""

MOST_OF_PRJ = 65_536

CACHE_BYTES = MAX_BLOCK_BYTES
"""Unpacked blocks that GDAL caches, bytes; its default is a twentieth of the machine's memory."""

MOST_HEADERS = 20_000
"""Most headers of files that this process remembers; one takes some kilobytes."""

_STRIP_CELLS = 4_000_000


@dataclass(frozen=True, eq=False)
class Raster:
    """A north-up raster's header, and the function that reads a window of it.

    ``read(col, row, cols, rows)`` yields strips (first row within the window, heights (n, cols)), NaN where unknown.
    ``west``, ``north`` are the outer corner in the raster's own units, ``dx``, ``dy`` > 0 the cell. ``read`` returns
    metres, but above the raster's own vertical datum; ``vertical`` is the file's statement of that datum. ``unit`` is
    the unit in which the file counts. ``stored_bytes``: the size of the file. ``files``: its sources, which are itself
    and its sidecars, masks and overviews.
    """

    name: str
    crs: RasterCRS
    west: float
    north: float
    dx: float
    dy: float
    cols: int
    rows: int
    vertical: VerticalDatum | None
    read: Reader
    stored_bytes: int
    sha256: Callable[[], str]
    notes: tuple[Note, ...] = ()
    unit: HeightUnit = METRE
    files: tuple[Path, ...] = ()


@dataclass(frozen=True, slots=True)
class RasterStatements:
    """The user's statements on a file, which count before the file's own statements.

    ``crs``: its coordinate system. ``height_unit``: a key of `OF_KEY`. ``datum_unit``: the unit that the vertical datum
    states. ``nodata``: a number of the file that stands for no height.
    """

    crs: str | None = None
    height_unit: str | None = None
    datum_unit: HeightUnit | None = None
    nodata: float | None = None


remembered_headers: dict[tuple[object, ...], tuple[Raster, tuple[float, float], tuple[object, ...]]] = {}
"""Headers of files, with scale and offset that make metres of their numbers, and the states of all files of each."""


def open_raster(
    path: Path,
    *,
    where: str,
    crs: str | None = None,
    height_unit: str | None = None,
    datum_unit: HeightUnit | None = None,
    nodata: float | None = None,
    data: bytes | None = None,
) -> Raster:
    """Header of the raster at ``path`` (GeoTIFF, .vrt of GeoTIFFs, SRTM .hgt, DTED, .img, netCDF, .xyz, ESRI .asc).

    The keywords are the user's statements (`RasterStatements`). ``data``: the bytes of a GeoTIFF that lies on no disk;
    ``path`` is then its name in messages.

    If neither the file nor one beside it or that it names has changed since this process opened it, it is not opened
    again: many missions use the same tiles. Raises InputError for anything that is not a readable, georeferenced,
    north-up raster of real numbers.
    """
    given = RasterStatements(crs, height_unit, datum_unit, nodata)
    try:
        if data is not None:
            with gdal(path, data=data) as dataset:
                return _header(dataset, path, given, data, where=where)[0]
        tell_raster(path)
        require_file(path, where=where)
        key = (path.absolute(), given, states_of(beside(path)))
        found = remembered_headers.get(key)
        if found is None or found[2] != states_of(found[0].files):  # one that a sidecar names may lie anywhere
            with gdal(path) as dataset:
                header, to_metres = _header(dataset, path, given, None, where=where)
            if len(remembered_headers) >= MOST_HEADERS:
                remembered_headers.clear()
            found = remembered_headers[key] = header, to_metres, states_of(header.files)
        header, to_metres, _ = found
        for file in header.files:
            tell_file(file)
        return replace(header, read=_reader(path, *to_metres, given.nodata, where=where))
    except InputError:
        raise
    except Exception as why:
        # GDAL and rasterio raise many types of exception on broken headers; all mean the same to the user.
        raise InputError(_unreadable(path, why), where=where) from None


def require_file(path: Path, *, where: str) -> None:
    """Raise InputError unless ``path`` is a file that can be read and is not empty."""
    tell_file(path)
    try:
        if path.is_dir():
            raise InputError(f"{path} is a folder without .DAT files; give a file", where=where)
        if not path.is_file():
            raise InputError(absent(path), where=where)
        with path.open("rb") as file:
            if not file.read(1):
                raise InputError(f"{path} is empty", where=where)
    except InputError:
        raise
    except (OSError, ValueError) as why:
        raise InputError(f"{path} cannot be read: {why}", where=where) from None


@contextmanager
def gdal(path: Path, other: str = "", data: bytes | None = None) -> Iterator[Any]:
    """The dataset at ``path``, whatever GDAL's environment variables state about pixel corners.

    ``other``: the driver for a file that is no GeoTIFF, if the file's name does not decide it. ``data``: the bytes of a
    GeoTIFF, in place of the file.
    """
    with _quiet_proj():
        import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    with (
        warnings.catch_warnings(),
        # GDAL gives the vertical part of older GeoTIFFs only on request.
        rasterio.Env(
            GTIFF_POINT_GEO_IGNORE=False,
            GDAL_PAM_ENABLED=True,
            GDAL_CACHEMAX=CACHE_BYTES,
            GTIFF_REPORT_COMPD_CS=True,
            CPL_VSIL_GZIP_WRITE_PROPERTIES="NO",
        ),
    ):
        # Our own check of the georeference reports more; the other warnings are between rasterio and its dependencies.
        for category in (NotGeoreferencedWarning, DeprecationWarning, PendingDeprecationWarning):
            warnings.simplefilter("ignore", category)
        if data is not None:
            with rasterio.MemoryFile(data) as held, held.open(driver="GTiff") as dataset:
                yield dataset
            return
        with rasterio.open(_opened(path), driver=_driver(path, other)) as dataset:
            yield dataset


def _opened(path: Path) -> str:
    """The name by which GDAL opens a file; a packed tile is unpacked once before, for its size may be a lie."""
    if path.suffix.lower() != ".gz":
        return str(path.resolve())
    with gzip.open(path) as packed:
        if len(packed.read(MOST_OF_HGT + 1)) > MOST_OF_HGT:
            raise InputError(f"{path} unpacks to more than a tile of 3601 posts a side has")
    return f"/vsigzip/{path.resolve()}"


@contextmanager
def _quiet_proj() -> Iterator[None]:
    """Keep the PROJ inside rasterio from writing to standard error, as it does for units in damaged headers.

    It reads the variable once, when rasterio is imported. The PROJ of pyproj is another one, and reports by exceptions.
    """
    given = os.environ.get("PROJ_DEBUG")
    os.environ.setdefault("PROJ_DEBUG", "0")
    try:
        yield
    finally:
        if given is None:
            os.environ.pop("PROJ_DEBUG", None)


TIFF_MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_BY_MAGIC = {
    **dict.fromkeys(TIFF_MAGIC, "GTiff"), b"UHL1": "DTED", b"EHFA": "HFA", b"CDF\1": "netCDF", b"CDF\2": "netCDF",
    b"CDF\5": "netCDF", b"\x89HDF": "netCDF",
}  # fmt: skip


def magic_of(path: Path) -> bytes:
    """The first four bytes of a file."""
    with path.open("rb") as file:
        return file.read(4)


def _driver(path: Path, other: str) -> str:
    """GDAL's name of the format, by the file's first bytes, else by its name."""
    found = _BY_MAGIC.get(magic_of(path))
    if found is not None and (found == "GTiff" or not other):
        return found
    if other:
        return other
    if path.suffix.lower() == ".vrt":
        _require_plain(path)
        return "VRT"
    return "SRTMHGT" if _is_hgt(path) else "XYZ" if path.suffix.lower() == ".xyz" else "AAIGrid"


PLAIN_VRT = frozenset({
    "VRTDataset", "SRS", "GeoTransform", "Metadata", "MDI", "VRTRasterBand", "ColorInterp", "Description",
    "NoDataValue", "UnitType", "Offset", "Scale", "HideNoDataValue", "SimpleSource", "ComplexSource", "SourceFilename",
    "SourceBand", "SourceProperties", "SrcRect", "DstRect", "NODATA", "BlockXSize", "BlockYSize", "Histograms",
    "HistItem", "HistMin", "HistMax", "BucketCount", "IncludeOutOfRange", "Approximate", "HistCounts",
})  # fmt: skip
"""Elements of a .vrt that puts rasters together, as gdalbuildvrt writes them."""

MOST_OF_VRT, MOST_OF_HGT = 8 * 2**20, 2 * 3601**2
"""Bytes of a .vrt, and of an unpacked .hgt."""


def _require_plain(path: Path) -> None:
    """Raise InputError unless a .vrt only puts GeoTIFFs together that lie on this machine."""
    import defusedxml.ElementTree

    advice = "`rio convert FILE.vrt a.tif`, which is installed with gcsplan, makes a GeoTIFF of one that you trust"
    with path.open("rb") as file:
        text = file.read(MOST_OF_VRT + 1)
    if len(text) > MOST_OF_VRT:
        raise InputError(f"{path} has more than {MOST_OF_VRT >> 20} MB: {advice}")
    root = defusedxml.ElementTree.fromstring(text, forbid_dtd=True)
    for element in root.iter():
        if element.tag not in PLAIN_VRT or "subClass" in element.attrib:
            what = element.attrib.get("subClass", element.tag)
            raise InputError(f"{path} does more than putting rasters together ({str(what)[:40]}): {advice}")
        if element.tag == "SourceFilename":
            name = element.text or ""
            source = path.resolve().parent / name if element.attrib.get("relativeToVRT") == "1" else Path(name)
            tell_file(source)
            if not source.is_file():
                raise InputError(f"{path} names a raster that is not there: {name[:200]}")
            if magic_of(source) not in TIFF_MAGIC:
                raise InputError(f"{path} names {name[:200]}, which is no GeoTIFF: {advice}")


def _is_hgt(path: Path) -> bool:
    """Whether a file of this name is an SRTM tile, zipped or not: GDAL then reads the one tile of that name inside."""
    return path.name.lower().endswith((".hgt", ".hgt.zip", ".hgt.gz"))


def _unreadable(path: Path, why: Exception) -> str:
    hint = ""
    if _is_hgt(path):
        hint = (
            "; an .hgt tile is named after its south-west corner (N36W085.hgt, N36W085.hgt.gz, or N36W085.hgt.zip with "
            "that inside) and holds 1201 or 3601 posts a side"
        )
    elif path.suffix.lower() == ".zip":
        hint = "; unpack it first"
    cause = why.__cause__ or why  # rasterio's own words are "see previous exception"
    reason = (str(cause).strip() or type(cause).__name__).splitlines()[0].replace(str(path.absolute()), path.name)[:200]
    return (
        f"{path} cannot be read as a GeoTIFF, .vrt, SRTM .hgt, DTED, .img, netCDF, .xyz or ESRI .asc grid "
        f"({reason}){hint}; "
        "`rio convert FILE a.tif`, which is installed with gcsplan, makes a GeoTIFF of other formats"
    )


def require_numbers(dataset: Any, path: Path, *, where: str) -> None:
    """Raise InputError if an opened file holds no real numbers, or reading one number costs too much memory."""
    from rasterio.enums import ColorInterp, Interleaving

    if dataset.colorinterp[0] in (ColorInterp.red, ColorInterp.palette) or "complex" in dataset.dtypes[0]:
        raise InputError(f"{path} is a picture, not a raster of heights", where=where)
    bands = dataset.count if dataset.interleaving == Interleaving.pixel else 1
    if math.prod(dataset.block_shapes[0]) * np.dtype(dataset.dtypes[0]).itemsize * bands > MAX_BLOCK_BYTES:
        raise InputError(
            f"{path} is stored in blocks of {dataset.block_shapes[0]} cells, above {MAX_BLOCK_BYTES >> 20} MB each; "
            "rewrite it in tiles (gdal_translate -co TILED=YES)",
            where=where,
        )


def _header(
    dataset: Any, path: Path, given: RasterStatements, data: bytes | None, *, where: str
) -> tuple[Raster, tuple[float, float]]:
    notes: list[Note] = []
    crs = given.crs
    if dataset.count < 1:
        raise InputError(f"{path} holds no raster band", where=where)
    if dataset.count > 1:
        notes.append(Note("several_bands", raster=path.name, bands=int(dataset.count)))
    require_numbers(dataset, path, where=where)
    t = dataset.transform
    geometry = (t.a, t.b, t.c, t.d, t.e, t.f)
    if not all(math.isfinite(x) for x in geometry):
        raise InputError(f"{path} has a broken georeference {geometry}", where=where)
    if geometry == (1.0, 0.0, 0.0, 0.0, 1.0, 0.0):
        raise InputError(
            f"{path} has no georeference (which place a cell is); add one with gdal_edit.py -a_ullr, or gdalwarp it",
            where=where,
        )
    if abs(t.b) > 1e-9 * abs(t.a) or abs(t.d) > 1e-9 * abs(t.e) or t.a <= 0 or t.e >= 0:
        raise InputError(
            f"{path} must be north-up (rows going south, columns east), its geotransform is {geometry}: "
            "gdalwarp makes it so",
            where=where,
        )
    _require_grid(t, dataset, path, where=where)
    text = crs if crs is not None else (dataset.crs.to_wkt() if dataset.crs else None)
    if text is None:
        raise InputError(
            f"{path} does not state its coordinate system; add `crs:`, for example `crs: EPSG:4326` for degrees",
            where=where,
        )
    if crs is not None and dataset.crs:
        notes.append(Note("crs_replaced", file=path.name, crs=crs))
    prj = _prj_beside(path) if dataset.driver == "AAIGrid" else ""
    if crs is None:
        require_unshifted(prj, where=where)
    system = take_apart(text, where=where)
    if crs is not None and dataset.crs:
        system = with_vertical_of(system, dataset.crs.to_wkt(), prj, where=where)
    if system.geographic:
        _require_degrees(t, dataset, path, where=where)
    unit, unit_notes = _unit(dataset, system, given, path, prj, where=where)
    factor = unit.metres
    notes += unit_notes
    scale, offset = float(dataset.scales[0]), float(dataset.offsets[0])
    if not (math.isfinite(scale) and math.isfinite(offset)) or scale == 0.0:
        raise InputError(f"{path} has a broken scale {scale} or offset {offset}", where=where)

    files = files_of(dataset, path) if data is None else ()
    to_metres = (scale * factor, offset * factor)
    header = Raster(
        path.name, system, t.c, t.f, t.a, -t.e, dataset.width, dataset.height, system.vertical,
        _reader(path, *to_metres, given.nodata, data, where=where), _stored_bytes(files) if data is None else len(data),
        partial(sha256_of_all, files) if data is None else hashlib.sha256(data).hexdigest, tuple(notes), unit, files,
    )  # fmt: skip
    return header, to_metres


def _stored_bytes(files: Sequence[Path]) -> int:
    """Bytes that hold the heights: the file's own, or those of the files that a .vrt puts together."""
    parts = files[1:] if files[0].suffix.lower() == ".vrt" else files[:1]
    return sum(part.stat().st_size for part in parts)


def _reader(
    path: Path, scale: float, offset: float, nodata: float | None, data: bytes | None = None, *, where: str
) -> Reader:
    def read(col: int, row: int, cols: int, rows: int) -> Iterator[tuple[int, Floats]]:
        try:
            with gdal(path, data=data) as opened:
                yield from _strips(opened, (col, row, cols, rows), scale, offset, nodata)
        except Exception as why:
            raise InputError(_unreadable(path, why), where=where) from None

    return read


def _prj_beside(path: Path) -> str:
    """The text of the .prj beside an .asc, as far as a coordinate system is long."""
    for prj in (path.with_suffix(".prj"), path.with_suffix(".PRJ")):
        if prj.is_file():
            with prj.open("rb") as file:
                return file.read(MOST_OF_PRJ).decode("utf-8", "replace")
    return ""


def _require_grid(t: Any, dataset: Any, path: Path, *, where: str) -> None:
    corners = (t.c, t.f, t.c + t.a * dataset.width, t.f + t.e * dataset.height)
    largest, cell = max(1.0, *map(abs, corners)), min(t.a, -t.e)
    if not (largest <= FARTHEST_UNITS and cell >= LEAST_CELL * largest):
        raise InputError(
            f"{path} has a broken georeference: cells of {t.a:g} × {-t.e:g} from {t.c:g}, {t.f:g} to {corners[2]:g}, "
            f"{corners[3]:g} are no grid on Earth; correct it (gdal_edit.py -a_ullr, or the header of an .asc)",
            where=where,
        )


def _require_degrees(t: Any, dataset: Any, path: Path, *, where: str) -> None:
    south = t.f + t.e * dataset.height
    east = t.c + t.a * dataset.width
    # A global grid of posts ends half a cell beyond the pole.
    if t.f > 90.0 - t.e or south < -90.0 + t.e or t.c < -540.0 or east > 540.0:
        raise InputError(
            f"{path} is in degrees but reaches from {t.c:g}, {south:g} to {east:g}, {t.f:g}: if it is in metres, "
            "state its coordinate system with `crs:`",
            where=where,
        )


def _unit(
    dataset: Any, system: RasterCRS, given: RasterStatements, path: Path, prj: str, *, where: str
) -> tuple[HeightUnit, list[Note]]:
    """The unit of the heights, and notes; ``prj`` is the text of the .prj beside an .asc. Raises InputError."""
    stated = [unit for unit in (system.vertical_unit, given.datum_unit) if unit is not None]
    for words in (str(dataset.units[0] or "").strip(), unit_of_prj(prj)):
        if not words:
            continue
        unit = unit_named(words)
        if unit is not None:
            stated.append(replace(unit, by=BY_FORMAT if dataset.driver == "SRTMHGT" else BY_FILE))
        elif given.height_unit is None and (system.vertical_unit is None or words != system.vertical_unit.name):
            raise InputError(
                f"{path} gives heights in {words!r}, which is not known; state the unit with `height_unit: m` "
                "(or ft, us_ft; a canopy states its own: gdal_edit.py -units metre)",
                where=where,
            )
    return unit_that_counts(stated, given.height_unit, system.horizontal_unit, path.name, where=where)


def _strips(
    dataset: Any, window: tuple[int, int, int, int], scale: float, offset: float, nodata: float | None
) -> Iterator[tuple[int, Floats]]:
    """Strips of ``raw * scale + offset``, metres; masked, non-finite and implausible cells are NaN.

    ``window``: column, row, columns, rows. ``nodata``: a further raw number that stands for no height.
    """
    from rasterio.windows import Window

    col, row, cols, rows = window
    if dataset.driver == "AAIGrid":
        # GDAL seeks a row after a missing one in a time that doubles with each; read in order it fails at once.
        for above in range(row + rows):
            dataset.read(1, window=Window(0, above, 1, 1))
    strip = max(1, _STRIP_CELLS // cols)
    for first in range(0, rows, strip):
        n = min(strip, rows - first)
        raw = dataset.read(1, window=Window(col, row + first, cols, n), masked=True)
        part = raw.data.astype(np.float64)
        part[np.ma.getmaskarray(raw)] = np.nan
        for block in missing(dataset, 1, col, row + first, cols, n):
            part[block] = np.nan
        for mark in (*MARKS, *_ends(raw.data.dtype)):  # before a scale or a unit can hide them
            part[part == mark] = np.nan
        if nodata is not None:
            part[part == _as_stored(nodata, raw.data.dtype)] = np.nan
        with np.errstate(over="ignore", invalid="ignore"):
            part = part * scale + offset
            part[~((part >= LOWEST_M) & (part <= HIGHEST_M))] = np.nan
        yield first, part


def _ends(dtype: Any) -> tuple[float, ...]:
    """The numbers at both ends of an integer type of two bytes and more; 0 is no end."""
    if dtype.kind not in "iu" or dtype.itemsize < 2:
        return ()
    info = np.iinfo(dtype)
    return (float(info.max), float(info.min)) if info.min else (float(info.max),)


def _as_stored(number: float, dtype: Any) -> float:
    """A number as a file of that type holds it: -3.4e38 in single precision is another one than in double."""
    with np.errstate(over="ignore"):
        return float(dtype.type(number)) if dtype.kind == "f" else number


def missing(dataset: Any, band: int, col: int, row: int, cols: int, rows: int) -> Iterator[tuple[slice, slice]]:
    """Blocks of a GeoTIFF's window of a band that were never written, as slices; GDAL reads them as 0 m."""
    if dataset.driver != "GTiff":
        return
    height, width = dataset.block_shapes[0]
    for i in range(row // height, (row + rows - 1) // height + 1):
        for j in range(col // width, (col + cols - 1) // width + 1):
            if dataset.get_tag_item(f"BLOCK_OFFSET_{j}_{i}", "TIFF", bidx=band) is None:
                top, left = i * height - row, j * width - col
                yield slice(max(top, 0), max(top + height, 0)), slice(max(left, 0), max(left + width, 0))
