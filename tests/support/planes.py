"""A mission's plane as a coordinate system of pyproj, beside which ours is held."""

from __future__ import annotations

from pyproj import CRS

from gcsplan.world.geodesy.frame import Frame


def crs_of(frame: Frame) -> CRS:
    """The transverse Mercator plane of ``frame`` on WGS 84."""
    middle = f"+lat_0={frame.lat_deg:.15g} +lon_0={frame.lon_deg:.15g}"
    return CRS.from_proj4(f"+proj=tmerc {middle} +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m")
