"""Terrain and zones that a script has as objects, as the files that they would be.

Rasters become GeoTIFFs and zones become GeoJSON, in memory: then the readers of files read them, with the same checks
and messages. What an object is decides what it can do, not its class, so that none of its packages is needed here.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from gcsplan.errors import InputError, raised
from gcsplan.world.terrain.raster import MAX_CELLS, missing, require_numbers

__all__ = ["copied", "geojson_bytes", "with_rasters", "with_zones"]

Made = TypeVar("Made")

GEOJSON = frozenset(
    {
        "FeatureCollection", "Feature", "Point", "MultiPoint", "LineString", "MultiLineString", "Polygon",
        "MultiPolygon", "GeometryCollection",
    }
)  # fmt: skip
"""The values of ``type`` by which a mapping is GeoJSON; a zone of a mission file has no such key."""

CRS_CURE = "such as \"EPSG:32617\", or 'EPSG:4326' for degrees"
TRANSFORM_CURE = "as rasterio's Affine has it: (dx, 0, west, 0, -dy, north), of the outer corner of the first cell"


def with_rasters(terrain: Any, where: str, held: dict[str, bytes]) -> Any:
    """``terrain:`` of a script's mission, with names in place of arrays and datasets, which are added to ``held``.

    Raises InputError.
    """
    if not isinstance(terrain, Mapping) or "dem" not in terrain:
        return terrain
    dem, at = terrain["dem"], f"{where}.dem"
    keys = {k: v for k, v in terrain.items() if k != "transform"}
    several = isinstance(dem, list | tuple) and any(map(_is_raster, dem))
    if several or _is_raster(dem):
        names = []
        for k, one in enumerate(dem if several else [dem]):
            name = one if isinstance(one, str) else f"terrain.dem[{k}]" if several else "terrain.dem"
            if _is_raster(one):
                held[name] = copied(at, _geotiff, one, None, None, at)
            names.append(name)
        if "transform" in terrain:
            raise InputError(f"belongs to an array; a {type(dem).__name__} has its own", where=f"{where}.transform")
        return {**keys, "dem": names if several else names[0]}
    if not _is_array(dem):
        return terrain  # text, or a mistake that the reader of the keys explains
    crs = terrain.get("crs")
    if crs is None:
        raise InputError(f"is missing: an array needs its coordinate system, {CRS_CURE}", where=f"{where}.crs")
    system = None if isinstance(crs, str) else crs  # a text goes the way of every mission file
    if system is not None:
        system = _system(system, f"{where}.crs")
        del keys["crs"]
    given = terrain.get("transform")
    if given is None:
        raise InputError(f"is missing: an array needs its six numbers, {TRANSFORM_CURE}", where=f"{where}.transform")
    transform = _transform(given, f"{where}.transform")
    held["terrain.dem"] = copied(at, _geotiff, np.ma.asanyarray(dem), transform, system, at)
    return {**keys, "dem": "terrain.dem"}


def with_zones(zones: Any, where: str, held: dict[str, bytes]) -> Any:
    """``no_fly:`` or ``keep_in:`` of a script's mission, with names in place of GeoJSON, which is added to ``held``.

    Raises InputError.
    """
    entries = [zones] if _is_geojson(zones) else zones
    if not isinstance(entries, list | tuple):
        return entries
    out = []
    for i, entry in enumerate(entries):
        at = f"{where}[{i}]"
        names = (f"{where.rpartition(': ')[2]}[{i}]{f'.{k}' if k > 1 else ''}.geojson" for k in count(1))
        name = next(name for name in names if name not in held)
        if _is_geojson(entry):
            held[name] = copied(at, geojson_bytes, entry, at)
            entry = {"file": name}
        elif isinstance(entry, Mapping) and (_is_geojson(entry.get("file")) or isinstance(entry.get("file"), Mapping)):
            held[name] = copied(f"{at}.file", geojson_bytes, entry["file"], f"{at}.file")
            entry = {**entry, "file": name}
        out.append(entry)
    return out


def copied(where: str, make: Callable[..., Made], *given: Any) -> Made:
    """What ``make`` makes of a stranger's object, whose methods may raise anything. Raises InputError."""
    try:
        return make(*given)
    except InputError as why:
        if why.where:
            raise
        raise InputError(why.message, where=where) from why
    except Exception as why:
        raise InputError(f"cannot be read: {raised(why)}", where=where) from why


def _is_array(value: Any) -> bool:
    return isinstance(value, np.ndarray) or (hasattr(value, "__array__") and not isinstance(value, str))


def _is_raster(value: Any) -> bool:
    """Whether it is an open rasterio dataset, or an array of xarray with rioxarray."""
    return hasattr(value, "rio") or all(hasattr(value, name) for name in ("read", "transform", "crs", "dtypes"))


def _is_geojson(value: Any) -> bool:
    """Whether it is GeoJSON or says that it can be."""
    if isinstance(value, Mapping):
        kind = value.get("type")
        return isinstance(kind, str) and kind in GEOJSON
    return hasattr(type(value), "__geo_interface__") or hasattr(value, "__geo_interface__")


def _transform(given: Any, where: str) -> tuple[float, ...]:
    """The six numbers of an affine map from column and row to x and y. Raises InputError."""
    try:
        six = tuple(float(x) for x in list(given)[:6])
    except Exception:  # a stranger's numbers
        six = ()
    if len(six) != 6 or not all(map(math.isfinite, six)):
        raise InputError(f"must be six numbers, {TRANSFORM_CURE}", where=where)
    if six[1] > 0.0 and six[0] != 0.0 and six[2] == 0.0 and six[5] < 0.0 and six[4] == 0.0:
        raise InputError(
            f"looks like GDAL's order of the six numbers: give rasterio.Affine.from_gdal(*numbers), {TRANSFORM_CURE}",
            where=where,
        )
    return six


def _system(given: Any, where: str) -> Any:
    """A coordinate system of rasterio or pyproj, or its number, as rasterio's. Raises InputError."""
    import rasterio

    try:
        return rasterio.crs.CRS.from_user_input(given)
    except Exception as why:  # rasterio's and GDAL's errors, and what a stranger's object raises
        words = f"must be a coordinate system, {CRS_CURE}; given {type(given).__name__}"
        raise InputError(words, where=where) from why


def _geotiff(source: Any, transform: Any, crs: Any, where: str) -> bytes:
    """A GeoTIFF of an array, or of a dataset that states the rest itself. Raises InputError."""
    nodata, scale, offset, unit = None, 1.0, 0.0, ""
    if hasattr(source, "rio"):
        source, transform, crs, nodata, scale, offset, unit = _of_xarray(source, where)
    elif not isinstance(source, np.ndarray):
        source, transform, crs, nodata, scale, offset, unit = _of_dataset(source, where)
    heights = np.ma.getdata(source)
    while heights.ndim > 2 and len(heights) == 1:
        heights, source = heights[0], source[0]
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise InputError(f"must be rows and columns of heights, given the shape {heights.shape}", where=where)
    _require_few(heights.shape, where)
    if heights.dtype.kind not in "iuf":
        raise InputError(f"must be heights as numbers, given an array of {heights.dtype}", where=where)
    unknown = np.ma.getmaskarray(source)
    if heights.dtype.itemsize > 4 and heights.dtype.kind in "iu":
        heights = heights.astype(np.float64)
    if heights.dtype == np.float16 or heights.dtype.itemsize > 8:
        heights = heights.astype(np.float32 if heights.dtype == np.float16 else np.float64)
    if float(transform[4]) > 0.0:  # rows that go north, as xarray has them: the same heights the other way round
        heights, unknown = heights[::-1], unknown[::-1]
        transform = (*transform[:4], -transform[4], transform[5] + transform[4] * len(heights))
    return _written(np.ascontiguousarray(heights), unknown, transform, crs, nodata, (scale, offset, unit))


def _written(heights: Any, unknown: Any, transform: Any, crs: Any, nodata: Any, numbers: tuple[Any, Any, str]) -> bytes:
    import rasterio

    profile = {
        "driver": "GTiff", "dtype": heights.dtype.name, "count": 1, "height": heights.shape[0],
        "width": heights.shape[1], "crs": rasterio.crs.CRS.from_user_input(crs) if crs is not None else None,
        "transform": rasterio.Affine(*transform[:6]), "nodata": nodata,
    }  # fmt: skip
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.MemoryFile() as file:
        with file.open(**profile) as dataset:
            dataset.write(heights, 1)
            dataset.scales, dataset.offsets = (float(numbers[0]),), (float(numbers[1]),)
            if numbers[2]:
                dataset.units = (numbers[2],)
            if unknown.any():
                dataset.write_mask(~unknown)
        return bytes(file.getbuffer())


def _of_dataset(dataset: Any, where: str) -> tuple[Any, ...]:
    """Heights, transform, coordinate system, number of no height, scale, offset and unit of an open dataset."""
    if getattr(dataset, "closed", False):
        raise InputError("the dataset is closed: give it while it is open, or the path of its file", where=where)
    if dataset.count != 1:
        raise InputError(
            f"a dataset of heights has one band, given {dataset.count}: give the path of its file, or the array of the "
            f"band with its transform and crs",
            where=where,
        )
    _require_few(dataset.shape, where)
    require_numbers(dataset, Path("the dataset"), where=where)
    heights = dataset.read(1, masked=True)
    unknown = np.ma.getmaskarray(heights).copy()
    for block in missing(dataset, 1, 0, 0, dataset.width, dataset.height):
        unknown[block] = True
    return (
        np.ma.array(heights.data, mask=unknown), dataset.transform, dataset.crs, dataset.nodata, dataset.scales[0],
        dataset.offsets[0], str(dataset.units[0] or ""),
    )  # fmt: skip


def _of_xarray(array: Any, where: str) -> tuple[Any, ...]:
    """The same of an array of xarray, by rioxarray's names."""
    rio = array.rio
    if rio.crs is None:
        raise InputError(f"states no coordinate system: array.rio.write_crs(…), {CRS_CURE}", where=where)
    _require_few(array.shape[-2:], where)
    about = {**getattr(array, "encoding", {}), **array.attrs}
    return (
        np.ma.masked_invalid(np.asarray(array)) if array.dtype.kind == "f" else np.asarray(array), rio.transform(),
        rio.crs, rio.nodata if rio.nodata is None or math.isfinite(rio.nodata) else None,
        array.attrs.get("scale_factor", 1.0), array.attrs.get("add_offset", 0.0), str(about.get("units", "") or ""),
    )  # fmt: skip


def _require_few(shape: Any, where: str) -> None:
    if math.prod(shape) > MAX_CELLS:
        raise InputError(
            f"has {' × '.join(map(str, shape))} cells, more than {MAX_CELLS / 1e6:.3g} million: give the path of its "
            "file, of which only the part around the mission is read, or cut that part out",
            where=where,
        )


def geojson_bytes(value: Any, where: str) -> bytes:
    """The text of GeoJSON in WGS 84. Raises InputError."""
    if hasattr(value, "to_crs") and hasattr(value, "to_json"):  # a GeoDataFrame or GeoSeries, in a system of its own
        if value.crs is None:
            raise InputError("states no coordinate system: set_crs(4326) for degrees", where=where)
        return str(value.to_crs(4326).to_json()).encode()
    whole = value if isinstance(value, Mapping) or not _is_geojson(value) else value.__geo_interface__
    return json.dumps(whole, default=_plain).encode()


def _plain(value: Any) -> Any:
    """A value that JSON lacks as one that it has: numpy's numbers and arrays, times, shapes of shapely."""
    for name in ("tolist", "isoformat"):
        with suppress(AttributeError):
            return getattr(value, name)()
    if hasattr(value, "__geo_interface__"):
        return value.__geo_interface__
    raise InputError(f"GeoJSON holds text, numbers, lists and mappings, given {type(value).__name__}")
