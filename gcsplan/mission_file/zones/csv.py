"""Circles from a table (CSV): a row for each mast, its place, height and radius in columns with common names."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass
from pathlib import Path

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.values.places import read_place
from gcsplan.mission_file.zones.attributes import Attribute, as_figure, read_attributes
from gcsplan.mission_file.zones.contents import decoded
from gcsplan.mission_file.zones.draft import SIZE_KEYS
from gcsplan.mission_file.zones.file import ZoneFile

LAT = ("lat", "latitude", "latdeg", "latitudedeg", "latdec", "latdd", "latwgs84")
LON = ("lon", "lng", "long", "longitude", "londeg", "longitudedeg", "londec", "longdec", "londd", "longdd", "lonwgs84")
PLACE = ("position", "coordinates", "coordinate", "coords", "latlon", "latlong", "place", "utm", "mgrs")

DELIMITERS = ",;\t|"
EXAMPLE = "name,lat,lon,height_m,radius_m"
MOST_COLUMNS = 500

_HEIGHT = re.compile(
    r"(?:(?:structure|mast|tower|obstacle)?(?:height|hgt)|agl)(?:agl)?(m|metres|meters|ft|feet)(?:agl)?"
)
"""The height of what stands there, whose top is the zone's ceiling above ground. Without a unit it is not read."""

_SIZE = re.compile(r"(radius|buffer)(?:m|metres|meters)")
_SEPARATOR = re.compile(r'"?sep=([,;\t|])"?[,;\t|]*', re.IGNORECASE)
"""The first line in which Excel says what parts the columns."""

_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")


@dataclass(frozen=True, slots=True)
class _Columns:
    """The header: its names, and which columns hold the place (one, or latitude and longitude)."""

    names: tuple[str, ...]
    place: tuple[int, ...]
    comma: bool
    """Whether numbers may have a decimal comma, since another sign parts the columns."""


def read_csv(path: Path, data: bytes) -> ZoneFile:
    """The zones of a table. Raises InputError if it is none, or if it has no columns for a place."""
    try:
        text = decoded(data)
    except UnicodeDecodeError as why:
        words = f"the file must be UTF-8 text, byte {why.start} is not; save it as `CSV UTF-8`"
        raise InputError(words, where=str(path)) from None
    lines = text.splitlines()
    filled = [line.strip(" ") for line in lines[:20] if line.strip()]  # a tab may be what sep= says
    separator = _SEPARATOR.fullmatch(filled[0]) if filled else None
    header = filled[0] if filled else ""
    delimiter = separator[1] if separator is not None else max(DELIMITERS, key=header.count)
    # A cell longer than csv's limit, 128 KiB, or a zero byte is an error of csv.
    rows = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True)
    found = ZoneFile(path)
    columns: _Columns | None = None
    try:
        for row in rows:
            if not any(cell.strip() for cell in row):
                continue
            if separator is not None and columns is None and row[0].strip().lower().startswith("sep="):
                continue
            if columns is None:
                columns = _header(path, row, delimiter)
                found.columns = columns.names
            else:
                _row(found, columns, row, f"{path}: line {rows.line_num}", f"{path.stem}[{rows.line_num}]")
    except csv.Error as why:
        raise InputError(f"this is not a table: {why}", where=f"{path}: line {rows.line_num}") from None
    if columns is None or not (found.zones or found.unsized or found.unshaped or found.problems):
        raise InputError(f"holds no row; the first line names the columns ({EXAMPLE})", where=str(path))
    return found


def _header(path: Path, row: list[str], delimiter: str) -> _Columns:
    names = tuple(cell.strip() for cell in row)
    if len(names) > MOST_COLUMNS:
        raise InputError(f"has {len(names)} columns, more than {MOST_COLUMNS}", where=str(path))
    plain = [_plain(name) for name in names]
    found = "columns found: " + ", ".join(name[:40] or "(empty)" for name in names[:30])
    twice = next((name for i, name in enumerate(plain) if name and name in plain[:i]), None)
    if twice is not None:
        raise InputError(f"two columns are called {names[plain.index(twice)]!r}; rename one", where=str(path))
    lat, lon, place = ([i for i, name in enumerate(plain) if name in known] for known in (LAT, LON, PLACE))
    one = len(place) == 1 and not lat and not lon
    if not one and (len(lat), len(lon)) != (1, 1):
        if len(lat) > 1 or len(lon) > 1:
            which = ", ".join(names[i] for i in (lat if len(lat) > 1 else lon))
            raise InputError(f"which column is the place, {which}? Leave one; {found}", where=str(path))
        what = "latitude and longitude" if not lat and not lon else "latitude" if not lat else "longitude"
        words = f"no column is called as a {what} is; the first line names the columns, such as {EXAMPLE}"
        raise InputError(f"{words}; {found}", where=str(path))
    return _Columns(names, tuple(place) if one else (lat[0], lon[0]), delimiter != ",")


def _row(found: ZoneFile, columns: _Columns, row: list[str], where: str, fallback: str) -> None:
    if any(cell.strip() for cell in row[len(columns.names) :]):
        words = (
            f"has {len(row)} cells, the first line {len(columns.names)}: is there a comma within a number or a name? "
        )
        cure = 'Write a point in numbers, and names in quotes "…"'
        found.problems.append(Mistake(where, words + cure))
        return
    cells = [cell.strip() for cell in row] + [""] * (len(columns.names) - len(row))
    empty = [columns.names[i] for i in columns.place if not cells[i]]
    if empty:
        words = f"{' and '.join(empty)} is empty; write the place, or remove the row, or leave it out by name"
        mistake = Mistake(where, f"{words} (ignore: [empty], --ignore empty)")
        found.unshaped.append(("empty", f"{fallback} {cells[0][:60]}".strip(), mistake))
        return
    centre = _place(found, columns, cells, where)
    given = [_attribute(columns, i, cell, where) for i, cell in enumerate(cells) if i not in columns.place and cell]
    stated = read_attributes(given, where, fallback, found.problems)
    if centre is not None and stated is not None:
        found.add_circle(stated, stated.name, where, centre)


def _place(found: ZoneFile, columns: _Columns, cells: list[str], where: str) -> tuple[float, float] | None:
    """(latitude, longitude) of a row; None, and a problem, if it has none."""
    written = [cells[i] for i in columns.place]
    if len(written) == 2 and columns.comma:
        written = [_pointed(cell) for cell in written]
    try:
        place = read_place(", ".join(written))
    except ValueError as why:
        found.problems.append(Mistake(where, str(why)))
        return None
    if place.note:
        found.own_notes.append(place.note.of(place=where.rpartition(": ")[2]))
    return place.lat_deg, place.lon_deg


def _attribute(columns: _Columns, i: int, cell: str, where: str) -> Attribute:
    key = columns.names[i]
    at, plain = f"{where}.{key[:80]}", _plain(key)
    if match := _SIZE.fullmatch(plain):
        size = f"{match[1]}_m"
        assert size in SIZE_KEYS
        # Three digits after a comma may be thousands, and are left to be refused.
        return Attribute(key, as_figure(_pointed(cell) if columns.comma and cell[-4:-3] != "," else cell), at, size)
    if match := _HEIGHT.fullmatch(plain):
        return Attribute(key, cell, at, f"top_{match[1]}_agl")
    return Attribute(key, cell, at)


def _pointed(cell: str) -> str:
    """A number with a decimal comma, with a point."""
    return cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())
