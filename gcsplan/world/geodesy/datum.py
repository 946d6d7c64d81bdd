"""The datums of a raster's coordinates and heights, and the conversion from them to altitudes above mean sea level.

A height without a datum is meaningless: ellipsoidal and geoid heights differ by up to 107 m. pyproj passes ellipsoidal
heights through *unchanged* if it lacks the geoid's grid, so nothing here relies on a transform between vertical
systems: an ellipsoidal raster needs the grid's file, and the shift from the grid is checked for plausibility.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pyproj import CRS, Transformer
from pyproj.crs.datum import Datum  # type: ignore[attr-defined]
from pyproj.exceptions import ProjError

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geodesy.height_unit import BY_FILE, METRE, HeightUnit, unit_of_length

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

_NOT_THE_SEA = re.compile(
    r"(?i)low[ _]water|high[ _]water|water[ _]level|chart|springs|caspian|wellbore|unknown|undefined"
    r"|wiener[ _]null|vienna|\baioc|\bkoc\b|\bkoc_|poolbeg|kiunga|kumul"
    r"|(?<!mean[ _-])(?<!zero[ _-])(?<!non[ _-])\btid(e|al)"
)
"""Zeros that are metres away from mean sea level: of tides, charts, inland seas and towns, or of unknown origin.

The register has Vienna's zero 157 m above Austria's, AIOC's at the Caspian Sea, and Poolbeg's 2.7 m below Malin Head's;
Kumul and Kiunga are 3 m off.
"""

_GEOCENTRIC = re.compile(
    r"(?i)WGS_?(19)?84|ETRS|ETRF|ITRF|IG[Sb]\d|NAD_?(19)?83|North_American_1983|GDA|NZGD|JGD|SIRGAS|POSGAR|RGF_?(19)?93"
    r"|SWEREF|EUREF|DREF91|CGCS|China_Geodetic|GRS80|ellipsoid"
)
"""Beginnings of names of ellipsoidal heights whose ellipsoid agrees with WGS 84's within a metre or two."""

ELLIPSOID_M, MOST_OFF_M, MOST_OFF_FLATTENING = 6_378_137.0, 1.5, 0.01
"""The semi-major axis of WGS 84, m, and the largest differences of another ellipsoid's axis, m, and of its inverse
flattening: on Bessel's ellipsoid heights are tens of metres off."""

_GRID = re.compile(r"""(?i)grids\s*=\s*([^\s"']+)|PARAMETERFILE\s*\[\s*"[^"]*"\s*,\s*"([^"]*)\"""")
_SHIFT = re.compile(r'(?i)"Vertical_Shift"\s*,\s*([-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?)')

_NAMED_CRS = re.compile(r"(?i)(EPSG|ESRI):\d{4,6}(\+\d{4,6})?|urn:ogc:def:crs:\w+:[\w.]*:\d+")


@dataclass(frozen=True, slots=True)
class VerticalDatum:
    """``name`` for the outputs; ``ellipsoidal`` heights must be converted; ``note`` is for the user."""

    name: str
    ellipsoidal: bool = False
    note: Note | None = None


@dataclass(frozen=True, eq=False)
class RasterCRS:
    """A raster's coordinate system, in its parts.

    ``horizontal`` is a 2D pyproj CRS, ``horizontal_unit`` the unit of its lengths (metres for degrees); ``vertical``
    and ``vertical_unit`` are the datum and the unit that it states for heights, or None.
    """

    horizontal: Any
    geographic: bool
    horizontal_unit: HeightUnit
    vertical: VerticalDatum | None
    vertical_unit: HeightUnit | None


def take_apart(crs: str, *, where: str) -> RasterCRS:
    """Horizontal and vertical part of ``crs`` (WKT, PROJ string or ``EPSG:code``); raises InputError."""
    require_unshifted(crs, where=where)
    try:
        whole = CRS.from_user_input(crs)
        require_no_grid(crs, whole, where=where)
        horizontal, vertical, unit = _parts(whole, BY_FILE, where)
        good = horizontal is not None and (horizontal.is_geographic or horizontal.is_projected)
        good = good and len(horizontal.axis_info) == 2
    except ProjError as why:
        raise InputError(
            f"the coordinate system is not understood ({_first_line(why)}); state it with `crs:`, "
            "for example `crs: EPSG:4326`",
            where=where,
        ) from None
    if not good:
        raise InputError(
            f"the coordinate system must be geographic or projected, given {whole.type_name} {whole.name!r}; "
            "state it with `crs:`, for example `crs: EPSG:4326`",
            where=where,
        )
    geographic = bool(horizontal.is_geographic)
    axis = horizontal.axis_info[0]
    length = METRE if geographic else unit_of_length(float(axis.unit_conversion_factor), axis.unit_name)
    return RasterCRS(horizontal, geographic, length, vertical, unit)


def with_vertical_of(given: RasterCRS, own: str, prj: str, *, where: str) -> RasterCRS:
    """``given``, which replaces a file's own system, with the vertical part of that system, ``own``.

    ``prj`` is its text beside the file, if there is one: libraries forget a part of it (`require_unshifted`).

    A user who names the grid has stated nothing about heights, and the file's heights still count downwards or from
    another zero. A vertical system that no register knows counts as none: this is the way to read such a file. Raises
    InputError for heights that are refused; a ``given`` with a vertical part is taken as it is.
    """
    if given.vertical is not None:
        return given
    try:
        require_unshifted(prj or own, where=where)
        whole = CRS.from_user_input(own)
        if whole.is_geocentric or not (whole.is_compound or whole.is_vertical or len(whole.axis_info) == 3):
            return given
        _, vertical, unit = _parts(whole, BY_FILE, where, any_name=True)
    except ProjError:
        return given
    except InputError as why:
        cure = "if the file is wrong about that, state both parts with `crs:`, such as EPSG:4326+5773"
        raise InputError(f"{why.message}; {cure}", where=where) from None
    return replace(given, vertical=vertical, vertical_unit=unit)


def require_unshifted(text: str, *, where: str) -> None:
    """Raise InputError for Esri's text of a vertical system that shifts its heights; libraries read it without that."""
    shift = _SHIFT.search(text)
    if shift is not None and float(shift[1]) != 0.0:
        raise InputError(
            f"the raster's vertical system is shifted by {shift[1]} (Vertical_Shift), which is not read: convert the "
            "heights, and write the system without it",
            where=where,
        )


def require_no_grid(text: str, whole: Any, *, where: str) -> None:
    """Raise InputError for a system, a text and its pyproj CRS, that names a file of shifts.

    PROJ looks for it in the current folder and in folders of its own, and takes none if it is not there, so that the
    same mission would lie elsewhere on another day.
    """
    named = [*_GRID.findall(text), *_GRID.findall(whole.to_wkt())]
    grids = [one.lstrip("@") for group in named for one in "".join(group).split(",")]
    grids = [one for one in grids if one not in ("", "null")]
    if grids:
        raise InputError(
            f"the coordinate system names a file of shifts, {grids[0][:80]!r}, which is not read: name the system by "
            "its code, such as EPSG:31468, or convert the file (gdalwarp or ogr2ogr -t_srs EPSG:4326)",
            where=where,
        )


def _parts(
    whole: Any, by: str, where: str, *, any_name: bool = False
) -> tuple[Any, VerticalDatum | None, HeightUnit | None]:
    """The parts of a pyproj CRS: the horizontal one in 2D (None if there is none), vertical datum, and unit of heights.

    Unit and direction come from the vertical axis itself. ``by`` names the one who states the unit. ``any_name``: a
    vertical system that no register knows has a unit and no datum. Raises InputError for heights that count downwards,
    and for zeros that are not the sea's.
    """
    parts = whole.sub_crs_list if whole.is_compound else [whole]
    horizontal = None if parts[0].is_vertical else parts[0]
    if horizontal is not None and len(horizontal.axis_info) == 3:
        axis = horizontal.axis_info[2]
        if axis.direction.lower() != "up" or not (horizontal.is_geographic or horizontal.is_projected):
            raise InputError(f"{horizontal.name!r} has no axis of heights; name the vertical system", where=where)
        _require_geocentric(horizontal, where)
        datum = VerticalDatum(f"{horizontal.name} ellipsoidal", ellipsoidal=True)
        unit = unit_of_length(float(axis.unit_conversion_factor), axis.unit_name)
        return horizontal.to_2d(), datum, replace(unit, by=by)
    vertical = [part for part in parts if part.is_vertical]
    if not vertical:
        return horizontal, None, None
    name, axes = str(vertical[0].name), vertical[0].axis_info
    if not axes or axes[0].direction.lower() != "up":
        raise InputError(
            f"{name!r} counts depths, downwards from its zero; only heights, which count upwards, are read: turn the "
            "numbers around (gdal_calc.py --calc=-A), and state the datum of the heights (for MSL depth it is "
            "EPSG:5714, for NAVD88 depth EPSG:5703)",
            where=where,
        )
    zero = f"{name} {vertical[0].datum.name if vertical[0].datum is not None else ''}"
    if _NOT_THE_SEA.search(zero):
        raise InputError(
            f"heights in {name!r} do not count from mean sea level, and their zero may be metres away from it: "
            "convert them (gdalwarp -t_srs with another vertical datum), and state that datum",
            where=where,
        )
    ellipsoidal = "ellipsoid" in f"{name} {axes[0].name}".lower()
    if ellipsoidal and not _GEOCENTRIC.match(name):
        raise _not_geocentric(name, where)
    unit = replace(unit_of_length(float(axes[0].unit_conversion_factor), axes[0].unit_name), by=by)
    if ellipsoidal:
        return horizontal, VerticalDatum("WGS84 ellipsoidal", ellipsoidal=True), unit
    if any_name and not _is_registered(vertical[0]):
        return horizontal, None, unit
    _require_registered(vertical[0], where)
    return horizontal, _named_by_raster(name), unit


def _require_registered(vertical: Any, where: str) -> None:
    """Raise InputError for a vertical system whose zero no register knows, or that shifts another one's."""
    name = str(vertical.name)
    if vertical.source_crs is not None:
        raise InputError(
            f"heights in {name!r} are shifted from {str(vertical.source_crs.name)!r}: convert them (gdalwarp "
            "-t_srs with that system)",
            where=where,
        )
    if not _is_registered(vertical):
        raise InputError(
            f"the raster has heights in {name!r}, which no register knows; state `vertical_datum:` (AMSL if it follows "
            "mean sea level) and, in place of the raster's own system, `crs:` (its horizontal part, such as EPSG:4326)",
            where=where,
        )


def _is_registered(vertical: Any) -> bool:
    """Whether a vertical system, or its datum, is one that a register knows."""
    if vertical.source_crs is not None:
        return True  # its shift is refused elsewhere
    datum = "" if vertical.datum is None else str(vertical.datum.name)
    return vertical.to_authority() is not None or _is_known(str(vertical.name)) or _is_known(datum)


def _is_known(name: str) -> bool:
    """Whether a name is, or begins with, the name of a vertical system or datum that we or PROJ's registers know."""
    key = re.sub(r"[^A-Z0-9]", "", name.upper())
    if any(key.startswith(known) for known in (*_GEOIDS, *_NATIONAL)) or _of_name(name) is not None:
        return True
    try:
        found = str(Datum.from_name(name).name)
    except ProjError:
        return False
    return _letters(found) == _letters(name)


def _require_geocentric(crs: Any, where: str) -> None:
    """Raise InputError if the ellipsoid of a 3D system is not about WGS 84's."""
    of = crs.ellipsoid
    off = (
        abs(of.semi_major_metre - ELLIPSOID_M) > MOST_OFF_M
        or abs(of.inverse_flattening - 298.257) > MOST_OFF_FLATTENING
    )
    if off or re.match(r"(?i)WGS 72", crs.name):
        raise _not_geocentric(str(crs.name), where)


def _not_geocentric(name: str, where: str) -> InputError:
    return InputError(
        f"ellipsoidal heights in {name!r} count from another ellipsoid than WGS 84's, which may be tens of metres "
        "away: convert them (gdalwarp -t_srs EPSG:4979, or to a datum at mean sea level), and state that datum",
        where=where,
    )


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
    stated, _ = stated_datum(given, where=where)
    if raster is None or raster.name == stated.name or (raster.ellipsoidal and stated.ellipsoidal):
        return stated
    if stated.name == "AMSL" and not raster.ellipsoidal:
        return raster
    raise InputError(
        f"the mission states {stated.name}, the raster itself states {raster.name}; remove the key, or correct the "
        "raster (gdal_edit.py -a_srs, or `crs:` with both parts, such as EPSG:4326+5773)",
        where=where,
    )


@lru_cache(maxsize=32)
def ways(source: CRS, target: CRS, *, allow_ballpark: bool) -> Transformer:
    """All ways of PROJ from one system to another, x before y; kept, because it takes milliseconds to find them.

    pyproj makes what is not safe to share once in each thread. Raises ProjError.
    """
    return Transformer.from_crs(source, target, always_xy=True, allow_ballpark=allow_ballpark)


@cache
def _degrees() -> CRS:
    """The degrees that every plane is made of."""
    return CRS.from_proj4("+proj=longlat +datum=WGS84 +no_defs")


@dataclass(frozen=True, slots=True)
class RasterWay:
    """One fixed operation between the plane and a raster's coordinates, which passes degrees on WGS 84.

    ``accuracy_m``: how well PROJ knows it; -1 unknown.
    """

    frame: Frame
    from_degrees: Transformer
    accuracy_m: float

    def to_raster(self, east_m: ArrayLike, north_m: ArrayLike) -> tuple[Floats, Floats]:
        """x, y of places in the plane; not finite where the raster's system is not defined."""
        lat, lon = np.moveaxis(self.frame.to_degrees(east_m, north_m), -1, 0)
        x, y = self.from_degrees.transform(lon, lat)
        return np.asarray(x, float), np.asarray(y, float)

    def to_plane(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """(..., 2) east_m, north_m of a raster's coordinates; not finite beyond the plane."""
        lon, lat = self.from_degrees.transform(x, y, direction="INVERSE")
        return self.frame.to_plane(lat, lon)


def plane_to_raster(frame: Frame, horizontal: Any, box: tuple[float, float, float, float], *, where: str) -> RasterWay:
    """The operation from the plane to the raster's CRS. The ways from WGS 84 are searched once for all planes.

    PROJ may choose another operation for every point, and a ballpark one (no datum shift at all) if it has nothing
    better. Here the best operation for the middle of ``box`` is used for all points, and never a ballpark one. Raises
    InputError if there is none, or none better than `WORST_SHIFT_M`.
    """
    lat, lon = frame.to_degrees(0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])).tolist()
    try:
        several = ways(_degrees(), horizontal, allow_ballpark=False)
        x, y = several.transform(lon, lat)
        if not (np.isfinite(x) and np.isfinite(y)):
            raise ProjError("the mission lies where this coordinate system is not defined")
        # The one that changes nothing stands alone, and is not remembered as used.
        one = several if several.name == "noop" else several.get_last_used_operation()
    except ProjError as why:
        raise InputError(
            f"there is no known way from WGS84 to the raster's coordinate system {horizontal.name!r} "
            f"({_first_line(why)}); state it with `crs:`, or reproject it (gdalwarp -t_srs EPSG:4326)",
            where=where,
        ) from None
    accuracy_m = float(one.accuracy) if one.accuracy is not None else -1.0
    if accuracy_m > WORST_SHIFT_M:
        raise InputError(
            f"the best datum shift from WGS84 to {horizontal.name!r} is good to {accuracy_m:g} m only; reproject the "
            "raster with the proper grid (gdalwarp -t_srs EPSG:4326)",
            where=where,
        )
    return RasterWay(frame, one, accuracy_m)


def to_wgs84(horizontal: Any, *, where: str) -> Transformer:
    """From a raster's coordinates to (longitude, latitude) on WGS84; accurate enough to look up a geoid."""
    try:
        return ways(horizontal, CRS.from_epsg(4326), allow_ballpark=True)
    except ProjError as why:
        raise InputError(
            f"there is no known way from {horizontal.name!r} to WGS84 ({_first_line(why)}); state the coordinate "
            "system with `crs:`",
            where=where,
        ) from None


def stated_datum(given: str, *, where: str) -> tuple[VerticalDatum, HeightUnit | None]:
    """The datum that a key names, and the unit that it states with it: a coordinate system has one, a word has none.

    ``given`` is a word (EGM96, NAVD88, WGS84, …), a code (EPSG:6360, also of a compound system), or the name of a
    vertical system as PROJ has it (``NAVD88 height (ftUS)``). Raises InputError for everything else, and as `_parts`.
    """
    text = re.sub(r"\s+", " ", given).strip()
    if _NAMED_CRS.fullmatch(text.replace(" ", "")):
        code = text.replace(" ", "")
        try:
            crs = CRS.from_user_input(code if code.lower().startswith("urn") else code.upper())
        except ProjError:
            raise InputError(f"{text} is not in the register of coordinate systems", where=where) from None
        return _stated_by(crs, text, where)
    key = re.sub(r"[^A-Z0-9]", "", given.upper())
    if key in _GEOIDS:
        return VerticalDatum(_GEOIDS[key]), None
    if key in _ELLIPSOIDAL or re.fullmatch(r"ITRF\d{2,4}", key):
        return VerticalDatum("WGS84 ellipsoidal", ellipsoidal=True), None
    if key in _NATIONAL:
        return _national(key), None
    named_crs = _of_name(text)
    if named_crs is not None:
        return _stated_by(named_crs, text, where)
    raise InputError(
        f"unknown vertical datum {given!r}; known are {', '.join(dict.fromkeys(_GEOIDS.values()))}, WGS84 "
        "(ellipsoidal), EPSG:code, and national ones such as NAVD88, DHHN2016 or AHD; AMSL stands for any other that "
        "follows mean sea level",
        where=where,
    )


def _stated_by(crs: Any, text: str, where: str) -> tuple[VerticalDatum, HeightUnit | None]:
    _, datum, unit = _parts(crs, f"by vertical_datum {text}", where)
    if datum is None:
        raise InputError(f"{text} ({crs.name}) has no part for heights", where=where)
    return datum, unit


def _of_name(text: str) -> Any | None:
    """The coordinate system of exactly that name; PROJ itself takes names that are only like one."""
    if re.search(r"[^\w .,()&/+-]", text) or text.startswith("+"):  # no PROJ string, no path, no WKT
        return None
    try:
        crs = CRS.from_user_input(text)
    except ProjError:
        return None
    return crs if _letters(crs.name) == _letters(text) else None


def _letters(text: str) -> str:
    return re.sub(r"[^a-z0-9]", "", text.lower())


def _named_by_raster(name: str) -> VerticalDatum:
    short = re.sub(r"(?i)[\s_]*(height|geoid|\(.*\))[\s_]*", "", name).strip() or name
    key = re.sub(r"[^A-Z0-9]", "", short.upper())
    return VerticalDatum(_GEOIDS[key]) if key in _GEOIDS else _national(short)


def _national(name: str) -> VerticalDatum:
    return VerticalDatum(name, note=Note("heights_taken_as_amsl", datum=name))


def _first_line(why: Exception) -> str:
    return (str(why).strip() or type(why).__name__).splitlines()[0][:200]
