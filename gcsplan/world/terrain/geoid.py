"""The height of a geoid above the ellipsoid, from a grid file in PROJ's formats (.gtx, GeoTIFF).

PROJ itself never opens the file: a GeoTIFF with strips of no rows ends the whole process in a division by zero. GDAL
reads it, and heights between four posts are bilinear, as in PROJ's own ``vgridshift``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.world.geodesy.height_unit import METRE, unit_named
from gcsplan.world.terrain.input_files import files_of, sha256_of_all, tell_file, tell_raster
from gcsplan.world.terrain.raster import gdal, missing, require_numbers

WORST_GEOID_M = 120.0
"""No geoid is farther from its ellipsoid than this, m (EGM2008: -107 … +86 m)."""

MAX_POSTS = 4_000_000
"""Most posts of a grid that a mission may need; the finest existing geoid has 2,000 per square degree."""

_UNDULATION = "geoid_undulation"  # PROJ's name for the band of heights, if there are several


class GeoidGrid:
    """Height of a geoid above the ellipsoid. Raises InputError if the file is missing or is no grid."""

    def __init__(self, path: Path, *, where: str) -> None:
        self.path = path
        self.where = where
        self._files: tuple[Path, ...] = (path,)
        tell_raster(path)
        if not path.is_file():
            raise InputError(f"the geoid grid {path} is not there; give the path of a .gtx or .tif grid", where=where)
        self._read(None, None)

    def sha256(self) -> str:
        """The hash of the grid, and of the files that belong to it."""
        return sha256_of_all(self._files)

    def height_m(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> Floats:
        """Geoid above the ellipsoid at points (any equal shapes), metres; AMSL = ellipsoidal height - this.

        Raises InputError where the grid does not cover a point, or holds no geoid there.
        """
        lat, lon = np.asarray(lat_deg, float), np.asarray(lon_deg, float)
        height = self._read(lat, lon)
        if not np.isfinite(height).all():
            at = tuple(np.argwhere(~np.isfinite(np.atleast_1d(height)))[0])
            raise InputError(
                f"the geoid grid {self.path} does not cover {np.atleast_1d(lat)[at]:.4f}, "
                f"{np.atleast_1d(lon)[at]:.4f}; give one that covers the mission",
                where=self.where,
            )
        if height.size and np.abs(height).max() > WORST_GEOID_M:
            raise InputError(
                f"the geoid grid {self.path} gives {height.ravel()[np.abs(height).argmax()]:g} m; a geoid lies "
                f"within ±{WORST_GEOID_M:g} m of its ellipsoid",
                where=self.where,
            )
        if height.size and not height.any():
            raise InputError(
                f"the geoid grid {self.path} changes nothing here (0 m everywhere); give a real geoid", where=self.where
            )
        return height

    def _read(self, lat: Floats | None, lon: Floats | None) -> Floats:
        """Heights at points, NaN where the grid has none; without points: only check that the file is a grid."""
        try:
            with gdal(self.path, "GTX") as dataset:
                require_numbers(dataset, self.path, where=self.where)
                self._files = files_of(dataset, self.path)
                for file in self._files:
                    tell_file(file)
                return _heights(dataset, lat, lon)
        except InputError:
            raise
        except Exception as why:
            # As for rasters: GDAL and rasterio raise many types of exception on broken headers.
            cause = (str(why.__cause__ or why).strip() or type(why).__name__).splitlines()[0][:200]
            raise InputError(
                f"the geoid grid {self.path} cannot be read as a .gtx or GeoTIFF grid ({cause})", where=self.where
            ) from None


def _heights(dataset: Any, lat: Floats | None, lon: Floats | None) -> Floats:
    """Heights, bilinear between posts at the centres of pixels. Raises ValueError if it is no grid in degrees."""
    t, cols, rows = dataset.transform, dataset.width, dataset.height
    if (
        t.b
        or t.d
        or not (1e-6 < t.a < 90.0 and -90.0 < t.e < -1e-6 and abs(t.c) + abs(t.f) < 1e4)
        or min(cols, rows) < 2
    ):
        raise ValueError("it must be north-up, in degrees, and of two posts a side at least")
    band = _band(dataset)
    _unit_m(dataset, band)
    if lat is None or lon is None:
        return np.empty(0)
    row = (t.f - lat) / -t.e - 0.5
    around = cols * t.a >= 360.0 - 1e-6  # around the globe: the first column follows the last
    col = ((lon - t.c) % 360.0) / t.a - 0.5
    col = np.where(col < -1e-9, col + 360.0 / t.a, col) if around else col
    row, col = np.clip(row, *_kept(row, rows - 1)), col if around else np.clip(col, *_kept(col, cols - 1))
    inside = (row >= 0.0) & (row <= rows - 1) & (col >= 0.0) & (col <= (cols if around else cols - 1))
    height = np.full(lat.shape, np.nan)
    if inside.any():
        height[inside] = _between(dataset, band, row[inside], col[inside], cols if around else 0)
    return height


def _band(dataset: Any) -> int:
    names = [name or "" for name in dataset.descriptions]
    return names.index(_UNDULATION) + 1 if _UNDULATION in names else 1


def _unit_m(dataset: Any, band: int) -> float:
    """Metres of one unit of the grid; metres where it states none. Raises ValueError if nobody knows the unit."""
    stated = str(dataset.units[band - 1] or "").strip()
    unit = unit_named(stated) if stated else METRE
    if unit is None:
        raise ValueError(
            f"its unit {stated!r} is not known; write metre or ft with gdal_edit.py -units, or give another"
        )
    return unit.metres


def _kept(at: Floats, last: int) -> tuple[Floats, Floats]:
    """Bounds that move a point onto an edge if it is off that edge only by rounding."""
    low = np.where(np.abs(at) < 1e-6, 0.0, -np.inf)
    high = np.where(np.abs(at - last) < 1e-6, float(last), np.inf)
    return low, high


def _between(dataset: Any, band: int, row: Floats, col: Floats, around: int) -> Floats:
    from rasterio.windows import Window

    r0 = np.minimum(np.floor(row).astype(int), dataset.height - 2)
    c0 = np.floor(col).astype(int) if around else np.minimum(np.floor(col).astype(int), dataset.width - 2)
    columns = np.unique(np.concatenate([c0, c0 + 1]) % around) if around else np.arange(c0.min(), c0.max() + 2)
    top, bottom, left, right = int(r0.min()), int(r0.max()) + 2, int(columns.min()), int(columns.max()) + 1
    if (bottom - top) * (right - left) > MAX_POSTS:
        raise ValueError(f"the mission would need {bottom - top} × {right - left} posts of it")
    raw = dataset.read(band, window=Window(left, top, right - left, bottom - top), masked=True)
    posts = raw.data.astype(np.float64)
    posts[np.ma.getmaskarray(raw)] = np.nan
    for block in missing(dataset, band, left, top, right - left, bottom - top):
        posts[block] = np.nan
    with np.errstate(over="ignore", invalid="ignore"):
        posts = (posts * float(dataset.scales[band - 1]) + float(dataset.offsets[band - 1])) * _unit_m(dataset, band)
        c1 = (c0 + 1) % around if around else c0 + 1
        u, v = col - c0, row - r0
        upper = (1.0 - u) * posts[r0 - top, c0 - left] + u * posts[r0 - top, c1 - left]
        lower = (1.0 - u) * posts[r0 + 1 - top, c0 - left] + u * posts[r0 + 1 - top, c1 - left]
        between: Floats = (1.0 - v) * upper + v * lower
    return between
