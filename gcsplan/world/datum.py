"""The datums of a raster's coordinates and heights, and the conversion from them to altitudes above mean sea level.

A height without a datum is meaningless: ellipsoidal and geoid heights differ by up to 107 m. pyproj passes ellipsoidal
heights through *unchanged* if it lacks the geoid's grid, so nothing here relies on a transform between vertical
systems: an ellipsoidal raster needs the grid's file, and the shift from the grid is checked for plausibility.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError

from gcsplan.errors import InputError
from gcsplan.world.frame import Frame

WORST_SHIFT_M = 30.0
"""A horizontal datum shift less accurate than this, m, is refused: it would move hills by more than a DEM cell."""

# Keys hold only letters and digits.
_GEOIDS = {"EGM84": "EGM84", "EGM96": "EGM96", "EGM2008": "EGM2008", "AMSL": "AMSL", "MSL": "AMSL"}
_ELLIPSOIDAL = {"WGS84", "ELLIPSOIDAL", "ELLIPSOID", "HAE", "GRS80", "ETRS89"}
_NATIONAL = {
    "NAVD88", "NGVD29", "CGVD28", "CGVD2013", "DHHN92", "DHHN2016", "EVRF2000", "EVRF2007", "EVRF2019", "ODN", "NAP",
    "AHD", "NZVD2009", "NZVD2016", "NN1954", "NN2000", "RH2000", "DVR90", "LN02", "LHN95", "IGN69", "GHA", "JGD2011",
    "TWVD2001", "KRONSTADT", "BALTIC1977", "N2000", "EH2000", "CASCAIS", "ALICANTE", "OSTEND", "MALINHEAD",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class VerticalDatum:
    """``name`` for the outputs; ``ellipsoidal`` heights must be converted; ``note`` is shown to the user, or ""."""

    name: str
    ellipsoidal: bool = False
    note: str = ""


@dataclass(frozen=True, eq=False)
class RasterCRS:
    """A raster's coordinate system, in its parts.

    ``horizontal`` is a 2D pyproj CRS; ``vertical`` is the datum that the raster itself states for its heights, or None;
    ``vertical_unit_m`` is the length of its height unit in metres, or None.
    """

    horizontal: Any
    geographic: bool
    vertical: VerticalDatum | None
    vertical_unit_m: float | None


def take_apart(crs: str, *, where: str) -> RasterCRS:
    """Horizontal and vertical part of ``crs`` (WKT, PROJ string or ``EPSG:code``); raises InputError."""
    try:
        whole = CRS.from_user_input(crs)
        parts = whole.sub_crs_list if whole.is_compound else [whole]
        horizontal = parts[0]
        vertical: VerticalDatum | None = None
        unit_m: float | None = None
        if len(parts) > 1:
            axis = parts[1].axis_info[0] if parts[1].axis_info else None
            if axis is not None and axis.direction.lower() != "up":
                raise InputError(
                    f"the raster counts {parts[1].name!r} {axis.direction}wards; heights must count upwards: "
                    "convert it first",
                    where=where,
                )
            vertical = _named_by_raster(parts[1].name)
            unit_m = float(axis.unit_conversion_factor) if axis is not None else None
        elif len(horizontal.axis_info) == 3 and horizontal.is_geographic:
            vertical = VerticalDatum(f"{horizontal.name} ellipsoidal", ellipsoidal=True)
            horizontal = horizontal.to_2d()
        good = len(horizontal.axis_info) == 2 and (horizontal.is_geographic or horizontal.is_projected)
    except ProjError as why:
        raise InputError(
            f"the coordinate system is not understood ({_first_line(why)}); say what it is with `crs:`, "
            "for example `crs: EPSG:4326`",
            where=where,
        ) from None
    if not good:
        raise InputError(
            f"the coordinate system must be geographic or projected, given {whole.type_name} {whole.name!r}; "
            "say what it is with `crs:`, for example `crs: EPSG:4326`",
            where=where,
        )
    return RasterCRS(horizontal, bool(horizontal.is_geographic), vertical, unit_m)


def vertical_datum(given: str | None, raster: VerticalDatum | None, *, where: str) -> VerticalDatum:
    """The datum of a DEM's heights, from the mission file's key and the raster's statement; they must not contradict.

    Raises InputError if neither states one, if the key's value is unknown, and if the two differ.
    """
    if given is None:
        if raster is None:
            raise InputError(
                "the raster does not say what its heights are measured from; add `vertical_datum:` "
                "(EGM96 for SRTM, EGM2008 for Copernicus, a national datum such as NAVD88, or WGS84 for ellipsoidal "
                "heights)",
                where=where,
            )
        return raster
    stated = _named_by_user(given, where=where)
    if raster is None or raster.name == stated.name or (raster.ellipsoidal and stated.ellipsoidal):
        return stated
    if stated.name == "AMSL" and not raster.ellipsoidal:
        return raster
    raise InputError(
        f"the mission says {stated.name}, the raster itself says {raster.name}; remove the key, or correct the "
        "raster (gdal_edit.py -a_srs)",
        where=where,
    )


def plane_to_raster(
    frame: Frame, horizontal: Any, box: tuple[float, float, float, float], *, where: str
) -> tuple[Transformer, float]:
    """One fixed operation (east_m, north_m) -> (x, y) of the raster's CRS, and its accuracy in metres (-1 unknown).

    PROJ may choose another operation for every point, and a ballpark one (no datum shift at all) if it has nothing
    better. Here the best operation for the middle of ``box`` is used for all points, and never a ballpark one. Raises
    InputError if there is none, or none better than `WORST_SHIFT_M`.
    """
    middle = (0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]))
    try:
        several = Transformer.from_crs(frame.crs, horizontal, always_xy=True, allow_ballpark=False)
        x, y = several.transform(*middle)
        if not (np.isfinite(x) and np.isfinite(y)):
            raise ProjError("the mission lies where this coordinate system is not defined")
        one = several.get_last_used_operation()
    except ProjError as why:
        raise InputError(
            f"there is no known way from WGS84 to the raster's coordinate system {horizontal.name!r} "
            f"({_first_line(why)}); say what it is with `crs:`, or reproject it (gdalwarp -t_srs EPSG:4326)",
            where=where,
        ) from None
    accuracy_m = float(one.accuracy) if one.accuracy is not None else -1.0
    if accuracy_m > WORST_SHIFT_M:
        raise InputError(
            f"the best datum shift from WGS84 to {horizontal.name!r} is good to {accuracy_m:g} m only; reproject the "
            "raster with the proper grid (gdalwarp -t_srs EPSG:4326)",
            where=where,
        )
    return one, accuracy_m


def to_wgs84(horizontal: Any, *, where: str) -> Transformer:
    """From a raster's coordinates to (longitude, latitude) on WGS84; accurate enough to look up a geoid."""
    try:
        return Transformer.from_crs(horizontal, CRS.from_epsg(4326), always_xy=True)
    except ProjError as why:
        raise InputError(
            f"there is no known way from {horizontal.name!r} to WGS84 ({_first_line(why)}); say what the coordinate "
            "system is with `crs:`",
            where=where,
        ) from None


def _named_by_user(given: str, *, where: str) -> VerticalDatum:
    if re.fullmatch(r"(?i)EPSG:\d{4,6}", given.strip()):
        try:
            crs = CRS.from_user_input(given.strip().upper())
        except ProjError:
            raise InputError(f"{given} is not in the EPSG register", where=where) from None
        vertical = [c for c in ([crs, *crs.sub_crs_list]) if c.is_vertical and not c.is_compound]
        if vertical:
            return _named_by_raster(vertical[0].name)
        if crs.is_geographic and len(crs.axis_info) == 3:
            return VerticalDatum(f"{crs.name} ellipsoidal", ellipsoidal=True)
        raise InputError(f"{given} ({crs.name}) says nothing about heights", where=where)
    key = re.sub(r"[^A-Z0-9]", "", given.upper())
    if key in _GEOIDS:
        return VerticalDatum(_GEOIDS[key])
    if key in _ELLIPSOIDAL or re.fullmatch(r"ITRF\d{2,4}", key):
        return VerticalDatum("WGS84 ellipsoidal", ellipsoidal=True)
    if key in _NATIONAL:
        return _national(key)
    raise InputError(
        f"unknown vertical datum {given!r}; known are {', '.join(dict.fromkeys(_GEOIDS.values()))}, WGS84 "
        "(ellipsoidal), EPSG:code, and national ones such as NAVD88, DHHN2016 or AHD; AMSL stands for any other that "
        "follows mean sea level",
        where=where,
    )


def _named_by_raster(name: str) -> VerticalDatum:
    if "ellips" in name.lower():
        return VerticalDatum("WGS84 ellipsoidal", ellipsoidal=True)
    short = re.sub(r"(?i)\s*(height|\(.*\))\s*", "", name).strip() or name
    key = re.sub(r"[^A-Z0-9]", "", short.upper())
    return VerticalDatum(_GEOIDS[key]) if key in _GEOIDS else _national(short)


def _national(name: str) -> VerticalDatum:
    return VerticalDatum(name, note=f"heights in {name} are taken as AMSL; it may differ from EGM96 by a metre or two")


def _first_line(why: Exception) -> str:
    return (str(why).strip() or type(why).__name__).splitlines()[0][:200]
