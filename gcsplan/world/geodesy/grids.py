"""UTM and MGRS, the two grids in metres that places are written in, on WGS 84.

PROJ does the projection. The letters of MGRS are decoded here: the `mgrs` package returns the middle of a square in
some versions and its corner in others, and takes a square outside its zone with a warning alone.
"""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from gcsplan.notes.note import Note

if TYPE_CHECKING:
    from pyproj import Proj

UTM_EXAMPLE, MGRS_EXAMPLE = "32T 473123 5249321", "32TMT7312349321"
GRID_EXAMPLES = {"UTM": UTM_EXAMPLE, "MGRS": MGRS_EXAMPLE}

BAND_LETTERS = "CDEFGHJKLMNPQRSTUVWX"
"""Bands of latitude: 8° each from 80° S, the last one 12°."""
COLUMN_LETTERS = ("ABCDEFGH", "JKLMNPQR", "STUVWXYZ")
"""Letters of the columns of squares from 100 km of easting, by the zone modulo 3."""
ROW_LETTERS = "ABCDEFGHJKLMNPQRSTUV"
"""Letters of the rows of squares; in even zones they begin with F at the equator."""
SQUARE_M = 100_000
EASTING_M = (100_000.0, 900_000.0)
MOST_NORTHING_M = 10_000_000.0

EDGE_DEG = 1e-5
"""About 1 m: a text in whole metres may lie so far past the edge of its band or zone."""
SQUARE_SIZES = {1: "10 km", 2: "1 km", 3: "100 m", 4: "10 m"}

_GRID_NUMBER = r"\d{1,9}(?:\.\d{0,9})?"
_LIKE_UTM = re.compile(r"(?:UTM|ZONE)\b|\d{1,2} ?(?:[A-Z]|NORTH|SOUTH)[ ,]+E? ?\d{4}")
_UTM = re.compile(
    rf"(?:UTM:? ?)?(?:ZONE:? ?)?(\d{{1,2}}) ?(NORTH|SOUTH|[A-Z])[ ,;]+(?:E ?)?({_GRID_NUMBER})(?: ?M? ?E)?"
    rf"[ ,;]+(?:N ?)?({_GRID_NUMBER})(?: ?M? ?N)?"
)
_LIKE_MGRS = re.compile(
    r"(?!\d+ ?DEG\b)(?:MGRS\b|\d{1,2} ?[A-Z] ?[A-Z]{2}(?:[ \d]|$)|\d{1,2}[A-Z]$|[ABYZ] ?[A-Z]{2} ?\d*(?: \d+)?$)"
)
_MGRS = re.compile(r"(?:MGRS:? ?)?(\d{1,2}) ?([A-Z]) ?([A-Z])([A-Z])((?: ?\d+)*)")


class NotAPlace(Exception):
    """Why a text is no place in its format; ``needs_example`` unless the words show what to write."""

    def __init__(self, words: str, *, needs_example: bool = True) -> None:
        super().__init__(words)
        self.needs_example = needs_example


class GridPlace(NamedTuple):
    """A place in degrees, and a note on how it was read."""

    lat_deg: float
    lon_deg: float
    note: Note | None = None


def read_utm(plain: str) -> GridPlace | None:
    """The place of ``32T 473123 5249321``; None if the text is not like UTM. Raises Refused.

    The letter is a band of latitude; N and the words NORTH and SOUTH are hemispheres, which for N is no difference. S
    is band S (32° to 40° N) or the southern hemisphere, and is refused where both are possible.
    """
    match = _UTM.fullmatch(plain)
    if not _LIKE_UTM.match(plain):
        return None
    if match is None:
        raise NotAPlace("give zone, band or hemisphere, easting and northing")
    zone, letter = _zone(match[1]), match[2]
    easting_m, northing_m = float(match[3]), float(match[4])
    _check_metres(easting_m, northing_m)
    if letter == "S":
        return _read_s(zone, match[3], match[4])
    if letter in ("N", "NORTH", "SOUTH"):
        found = to_degrees(zone, easting_m, northing_m, south=letter == "SOUTH")
        if not -80.0 - EDGE_DEG <= found.lat_deg <= 84.0 + EDGE_DEG:
            raise NotAPlace(f"UTM reaches from 80° S to 84° N, and this is at {found.lat_deg:.4f}°; write lat, lon")
        return found
    low, high = band_deg(letter)
    found = to_degrees(zone, easting_m, northing_m, south=low < 0.0)
    if not low - EDGE_DEG <= found.lat_deg <= high + EDGE_DEG:
        raise NotAPlace(
            f"the northing {match[4]} is at {found.lat_deg:.4f}°, outside band {letter} ({low:g}° to {high:g}°)"
        )
    return found


def read_mgrs(plain: str) -> GridPlace | None:
    """The south-west corner of the square ``32TMT7312349321``; None if the text is not like MGRS. Raises Refused."""
    if not _LIKE_MGRS.match(plain) or re.search("[°'\".,]", plain):
        return None
    match = _MGRS.fullmatch(plain)
    if match is None:
        polar = "; squares at the poles are not read, write lat, lon" if plain[:1] in "ABYZ" else ""
        raise NotAPlace(f"give zone, band, two letters of a square and an even number of digits{polar}")
    groups = match[5].split()
    digits = "".join(groups)
    if len(groups) > 2 or len({len(group) for group in groups}) > 1 or len(digits) % 2:
        raise NotAPlace(f"easting and northing have the same number of digits, given {' and '.join(groups)}")
    if not digits:
        raise NotAPlace(f"{plain} is a whole square of 100 km; add the digits of easting and northing")
    if len(digits) > 10:
        raise NotAPlace(f"it has at most 5 digits each of easting and northing (1 m), given {len(digits) // 2}")
    zone, half = _zone(match[1]), len(digits) // 2
    size_m = 10 ** (5 - half)
    within_m = tuple(int(part) * size_m for part in (digits[:half], digits[half:]))
    found = _square_corner(zone, match[2], match[3], match[4], within_m, size_m)
    note = None if half == 5 else Note("place_is_a_square", given=plain, size=SQUARE_SIZES[half])
    return GridPlace(found.lat_deg, found.lon_deg, note)


def band_deg(letter: str) -> tuple[float, float]:
    """Lowest and highest latitude of a band. Raises Refused for a letter that is none."""
    if letter not in BAND_LETTERS:
        raise NotAPlace(f"{letter} is no band of latitude (C to X without I and O)")
    low = -80.0 + 8.0 * BAND_LETTERS.index(letter)
    return low, 84.0 if letter == "X" else low + 8.0


def zone_deg(zone: int, letter: str) -> tuple[float, float]:
    """Western and eastern longitude of a zone in a band, wider and narrower around Norway and Svalbard."""
    west, east = 6.0 * zone - 186.0, 6.0 * zone - 180.0
    if letter == "V":
        return {31: (0.0, 3.0), 32: (3.0, 12.0)}.get(zone, (west, east))
    if letter == "X":
        wide = {31: (0.0, 9.0), 33: (9.0, 21.0), 35: (21.0, 33.0), 37: (33.0, 42.0)}
        if zone in (32, 34, 36):
            raise NotAPlace(f"there is no zone {zone}X: around Svalbard its neighbours are wider")
        return wide.get(zone, (west, east))
    return west, east


def to_degrees(zone: int, easting_m: float, northing_m: float, *, south: bool) -> GridPlace:
    """The place of an easting and northing."""
    lon, lat = _projection(zone, south)(easting_m, northing_m, inverse=True)
    return GridPlace(float(lat), float(lon))


@cache
def _projection(zone: int, south: bool) -> Proj:
    from pyproj import Proj  # imported here because most missions are in degrees

    return Proj(proj="utm", zone=zone, south=south, ellps="WGS84")


def _zone(digits: str) -> int:
    if not 1 <= int(digits) <= 60:
        raise NotAPlace(f"zones are 1 to 60, given {digits}")
    return int(digits)


def _check_metres(easting_m: float, northing_m: float) -> None:
    low, high = EASTING_M
    if easting_m > high and low <= northing_m <= high:
        raise NotAPlace("easting and northing look swapped: the easting is first")
    if not low <= easting_m <= high:
        raise NotAPlace(f"an easting is {low:.0f} to {high:.0f}, given {easting_m:.10g}")
    if not northing_m <= MOST_NORTHING_M:
        raise NotAPlace(f"a northing is at most {MOST_NORTHING_M:.0f}, given {northing_m:.10g}")


def _read_s(zone: int, easting: str, northing: str) -> GridPlace:
    """UTM with the letter S: refused if it may be band S as well as the southern hemisphere."""
    north, south = (to_degrees(zone, float(easting), float(northing), south=s) for s in (False, True))
    low, high = band_deg("S")
    if low - EDGE_DEG <= north.lat_deg <= high + EDGE_DEG:
        raise NotAPlace(
            f"S is band S or the southern hemisphere: write `{zone} north {easting} {northing}` for "
            f"{north.lat_deg:.5f}, {north.lon_deg:.5f} or `{zone} south {easting} {northing}` for "
            f"{south.lat_deg:.5f}, {south.lon_deg:.5f}",
            needs_example=False,
        )
    if south.lat_deg < -80.0 - EDGE_DEG:
        raise NotAPlace(f"UTM reaches from 80° S to 84° N, and this is at {south.lat_deg:.4f}°; write lat, lon")
    return south._replace(note=Note("zone_letter_is_the_hemisphere", zone=zone))


def _square_corner(zone: int, band: str, column: str, row: str, within_m: tuple[int, ...], size_m: int) -> GridPlace:
    """The corner of a square: of the rows with its letter, 2000 km apart, the one in the band."""
    low, high = band_deg(band)
    west, east = zone_deg(zone, band)
    columns, name = COLUMN_LETTERS[(zone - 1) % 3], f"{zone}{band}{column}{row}"
    if column not in columns or row not in ROW_LETTERS:
        raise NotAPlace(
            f"there is no square {column}{row} in zone {zone}: its columns are {columns}, its rows A to V without I "
            "and O"
        )
    easting_m = (columns.index(column) + 1) * SQUARE_M + within_m[0]
    first_m = (ROW_LETTERS.index(row) - (0 if zone % 2 else 5)) % len(ROW_LETTERS) * SQUARE_M + within_m[1]
    for northing_m in range(first_m, int(MOST_NORTHING_M), len(ROW_LETTERS) * SQUARE_M):
        corners = [
            to_degrees(zone, easting_m + e, northing_m + n, south=low < 0.0) for e in (0, size_m) for n in (0, size_m)
        ]
        lats = [c.lat_deg for c in corners]
        if min(lats) > high + EDGE_DEG or max(lats) < low - EDGE_DEG:
            continue
        middle = (west + east) / 2.0
        away = [(c.lon_deg - middle + 180.0) % 360.0 - 180.0 for c in corners]
        if min(away) <= (east - west) / 2.0 + EDGE_DEG and max(away) >= -(east - west) / 2.0 - EDGE_DEG:
            return corners[0]
        raise NotAPlace(f"square {name} with these digits is at {corners[0].lon_deg:.4f}°, outside zone {zone}{band} "
                      f"({west:g}° to {east:g}°)")  # fmt: skip
    raise NotAPlace(f"square {name} with these digits is not in band {band} ({low:g}° to {high:g}°)")
