"""The conversion between degrees and metres; the only importer of pyproj's plane transforms.

Inside gcsplan a place is (east_m, north_m) on a transverse Mercator plane whose origin lies in the middle of the
mission (scale 1 there), and a height is an altitude above mean sea level. The plane tangent to the ellipsoid is never
used: its "up" is off by d²/2R, 7.8 m at 10 km.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from pyproj import Transformer

from gcsplan.arrays import Floats
from gcsplan.errors import InputError

FARTHEST_M = 150_000.0
"""Farthest distance from the origin, m; the plane's scale is off by 2.8e-4 there. Missions beyond it are refused."""

EARTH_RADIUS_M = 6_371_008.8  # mean radius R1 of WGS84 (IUGG)

BOW_PARTS = np.arange(17) / 16.0
"""Parts of a leg at which `Frame.bow_m` measures; at the ends the distance is 0."""


class Frame:
    """One plane: ``to_plane`` and ``to_degrees`` are inverse to each other within a micrometre.

    ``amsl_m`` is the altitude of ``up_m: 0`` in missions written in local metres.
    """

    def __init__(self, lat_deg: float, lon_deg: float, amsl_m: float = 0.0) -> None:
        if not (abs(lat_deg) <= 85.0 and abs(lon_deg) <= 180.0):
            raise InputError(
                f"missions are planned between 85° south and 85° north, at longitudes within ±180°; given "
                f"{lat_deg:g}, {lon_deg:g}"
            )
        self.lat_deg = float(lat_deg)
        self.lon_deg = float(lon_deg)
        self.amsl_m = float(amsl_m)
        projection = f"+proj=tmerc +lat_0={self.lat_deg:.15g} +lon_0={self.lon_deg:.15g} +k=1 +x_0=0 +y_0=0"
        # The operation that PROJ derives from the two coordinate systems, identical to the last bit, without a search
        # in its database.
        plane = f"{projection} +ellps=WGS84"
        self._forward = Transformer.from_pipeline(
            f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step {plane}"
        )
        self._back = Transformer.from_pipeline(
            f"+proj=pipeline +step +inv {plane} +step +proj=unitconvert +xy_in=rad +xy_out=deg"
        )

    def __reduce__(self) -> tuple[type[Frame], tuple[float, float, float]]:
        return Frame, (self.lat_deg, self.lon_deg, self.amsl_m)

    def to_plane(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> Floats:
        """(..., 2) east_m, north_m of points in degrees (arrays of equal shape)."""
        east, north = self._forward.transform(np.asarray(lon_deg, float), np.asarray(lat_deg, float))
        return np.stack([np.asarray(east, float), np.asarray(north, float)], axis=-1)

    def to_degrees(self, east_m: ArrayLike, north_m: ArrayLike) -> Floats:
        """(..., 2) latitude, longitude in degrees of points in the plane."""
        lon, lat = self._back.transform(np.asarray(east_m, float), np.asarray(north_m, float))
        return np.stack([np.asarray(lat, float), np.asarray(lon, float)], axis=-1)

    def scale_at(self, distance_m: float) -> float:
        """Largest scale of the plane within ``distance_m`` of the origin: ``1 + d²/2R²`` (Snyder 1987, eq. 8-11)."""
        return 1.0 + 1.01 * distance_m**2 / (2.0 * EARTH_RADIUS_M**2)

    def bow_m(self, start_deg: ArrayLike, end_deg: ArrayLike) -> Floats:
        """(N,) how far the line that is straight in degrees lies from the line straight in the plane, metres.

        ``start_deg``, ``end_deg``: (N, 2) latitude, longitude. The distance is measured between points at the same part
        of both lines. It is quadratic in that part, with a cubic term that counts in legs of tens of kilometres, so it
        is measured at `BOW_PARTS`; between them it exceeds the measured maximum by less than 2 %, which are added.
        """
        a, b = np.atleast_2d(np.asarray(start_deg, float)), np.atleast_2d(np.asarray(end_deg, float))
        span = (b[:, 1] - a[:, 1] + 180.0) % 360.0 - 180.0
        part = BOW_PARTS[:, None]
        curved = self.to_plane(a[:, 0] + part * (b[:, 0] - a[:, 0]), a[:, 1] + part * span)
        straight = curved[0] + part[..., None] * (curved[-1] - curved[0])
        return np.asarray(1.02 * np.linalg.norm(curved - straight, axis=-1).max(axis=0))


def centre_of(lat_deg: ArrayLike, lon_deg: ArrayLike) -> tuple[float, float]:
    """Middle of a set of points in degrees, safe across the antimeridian, rounded to 1e-4 degrees.

    It is rounded so that moving one point by a little does not change every number in every file.
    """
    lat, lon = np.asarray(lat_deg, float), np.asarray(lon_deg, float)
    turned = (lon - lon[0] + 180.0) % 360.0 - 180.0
    middle = lon[0] + 0.5 * (turned.min() + turned.max())
    middle = (middle + 180.0) % 360.0 - 180.0
    return round(float(0.5 * (lat.min() + lat.max())), 4), round(math.fmod(float(middle), 360.0), 4)
