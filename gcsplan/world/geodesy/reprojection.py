"""Shapes in the coordinate systems of other programs, converted to WGS 84 degrees.

An edge that is straight in a projected system is not straight in degrees, so it is cut until its pieces are.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError

from gcsplan.arrays import Floats, Indices
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.datum import WORST_SHIFT_M, require_no_grid, ways
from gcsplan.world.geodesy.degree_shapes import EDGE_BOW_M, HALF_TURN_DEG, unwrapped

METRES_OF_DEGREE = 111_700.0
"""The most metres of a degree of latitude."""

MEASURED_AT = np.array([0.25, 0.5, 0.75])
"""Parts of an edge at which its bow is measured."""


class ToDegrees:
    """From one coordinate system to WGS 84, by one operation for all of a layer, never a ballpark one.

    ``crs`` is WKT, a PROJ string or ``EPSG:code``; ``middle`` (x, y) lies among the shapes. ``note`` names the
    operation, and is None for degrees on WGS 84. Raises InputError.
    """

    def __init__(self, crs: str, middle: tuple[float, float], *, where: str) -> None:
        self._where = where
        self._operation: Transformer | None = None
        self._degrees: tuple[float, float] | None = None
        self.note: Note | None = None
        try:
            horizontal = _horizontal(crs, where)
            self.name = str(horizontal.name)
            if horizontal.equals(CRS.from_epsg(4326), ignore_axis_order=True):
                return
            several = ways(horizontal, CRS.from_epsg(4326), allow_ballpark=False)
            if not all(math.isfinite(x) for x in several.transform(*middle)):
                raise ProjError("the shapes lie where it is not defined")
            self._operation = _used(several)
            if horizontal.is_geographic:
                unit = math.degrees(horizontal.axis_info[0].unit_conversion_factor)
                meridian = horizontal.prime_meridian
                self._degrees = unit, math.degrees(meridian.longitude * meridian.unit_conversion_factor)
        except ProjError as why:
            reason = str(why).splitlines()[0][:100]
            raise self._refused(f"there is no known way from its coordinate system to WGS 84 ({reason})") from None
        accuracy_m = self._operation.accuracy
        if accuracy_m is not None and accuracy_m > WORST_SHIFT_M:
            raise self._refused(f"PROJ's best way from {self.name!r} to WGS 84 is good to {accuracy_m:g} m only")
        if accuracy_m is not None and accuracy_m >= 0.0:
            self.note = Note("converted_to_wgs84", crs=self.name, accuracy_m=accuracy_m)
        else:
            self.note = Note("converted_to_wgs84_somehow", crs=self.name)

    def points(self, xy: Floats) -> Floats:
        """(N, 2) latitude, longitude of points (N, 2) x, y."""
        if self._operation is None:
            return np.ascontiguousarray(xy[:, ::-1])
        lon, lat = self._operation.transform(xy[:, 0], xy[:, 1])
        if (
            self._degrees is not None
        ):  # PROJ turns longitudes back to within 180°, and the side of an edge hangs on them
            lon = lon + 360.0 * np.round((xy[:, 0] * self._degrees[0] + self._degrees[1] - lon) / 360.0)
        found = np.stack([np.asarray(lat, float), np.asarray(lon, float)], axis=-1)
        if not np.isfinite(found).all():
            x, y = xy[int(np.argmax(~np.isfinite(found).all(axis=1)))]
            raise self._refused(f"{x:g}, {y:g} lies where {self.name!r} is not defined")
        return found

    def line(self, xy: Floats, most: int, *, any_width: bool = False) -> Floats:
        """(M, 2) latitude, longitude of a line (N, 2) x, y, cut until it is straight in degrees from point to point.

        No more than ``most`` points are added. Raises InputError if more are needed, and unless ``any_width`` for an
        edge of half a turn and more: a zone across the antimeridian that somebody converted to Mercator lies around the
        rest of the globe.
        """
        ends = self.points(xy)
        if self._operation is None or len(xy) < 2:
            return ends
        begin, step = xy[:-1], np.diff(xy, axis=0)
        within = [self.points(begin + part * step) for part in MEASURED_AT]
        # In degrees a longitude is as it is written; from metres PROJ makes it one within 180°.
        turn = _turn if self._degrees is None else np.asarray
        straight = [ends[:-1] + part * turn(ends[1:] - ends[:-1]) for part in MEASURED_AT]
        off = np.stack([turn(a - b) for a, b in zip(within, straight, strict=True)])
        off[..., 1] *= np.cos(np.radians(ends[:-1, 0]))
        bow_m = 1.2 * METRES_OF_DEGREE * np.hypot(off[..., 0], off[..., 1]).max(axis=0)
        pieces = np.maximum(1, np.ceil(np.sqrt(bow_m / EDGE_BOW_M))).astype(int)
        if pieces.sum() > len(xy) + most:
            raise self._refused("its edges are too long to be straight in degrees")
        cut = [b + s * (np.arange(n) / n)[:, None] for b, s, n in zip(begin, step, pieces, strict=True)]
        found = self.points(np.concatenate([*cut, xy[-1:]]))
        if self._degrees is not None:
            return found
        lon, lat = unwrapped(found, found[0, 1]).T
        if not any_width:
            self._require_narrow(xy, lon, np.append(0, np.cumsum(pieces)))
        return np.stack([lat, lon], axis=-1)

    def _require_narrow(self, xy: Floats, lon_deg: Floats, corner: Indices) -> None:
        """Raise InputError for an edge of half a turn and more; ``corner`` are the places of ``xy`` in ``lon_deg``."""
        wide_deg = np.abs(np.diff(lon_deg[corner]))
        k = int(wide_deg.argmax())
        if wide_deg[k] >= HALF_TURN_DEG:
            a, b = (f"{x:.7g}, {y:.7g}" for x, y in xy[k : k + 2])
            raise InputError(
                f"the edge from {a} to {b} spans {wide_deg[k]:.6g}° of longitude, and from {HALF_TURN_DEG:g}° on it "
                "may run on either side of the globe: cut the zone in two at the 180° meridian if it crosses it, else "
                "put a corner between",
                where=self._where,
            )
        if np.array_equal(xy[0], xy[-1]) and abs(lon_deg[-1] - lon_deg[0]) > HALF_TURN_DEG:
            raise InputError("the outline goes around a pole: cut the zone there in two", where=self._where)

    def _refused(self, words: str) -> InputError:
        return InputError(f"{words}; convert it with ogr2ogr -t_srs EPSG:4326", where=self._where)


def _horizontal(crs: str, where: str) -> Any:
    whole = CRS.from_user_input(crs)
    require_no_grid(crs, whole, where=where)
    part = whole.sub_crs_list[0] if whole.is_compound else whole
    unknown = "undefined" in part.name.lower() or "unknown" in part.name.lower()
    if unknown or not (part.is_geographic or part.is_projected):
        raise InputError(
            f"its coordinate system is {part.name!r}, whose place on Earth is not known; set the true one (in QGIS "
            "Layer > Set CRS, then export; or ogr2ogr -a_srs EPSG:CODE)",
            where=where,
        )
    return part.to_2d() if len(part.axis_info) == 3 else part


def _used(several: Transformer) -> Transformer:
    """The operation that was used last; PROJ names none where there is only one."""
    try:
        return several.get_last_used_operation()
    except ProjError:
        return several


def _turn(difference: Floats) -> Floats:
    """Differences (N, 2) of latitude and longitude, the short way around the Earth."""
    return np.stack([difference[:, 0], (difference[:, 1] + 180.0) % 360.0 - 180.0], axis=-1)
