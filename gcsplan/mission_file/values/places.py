"""A place as people write it: decimal degrees, degrees with minutes and seconds, UTM and MGRS, all on WGS 84.

`read_place` reads a text. A text that two formats, or two readings of one format, would place differently is refused
with both readings; nothing is guessed. The letters in UTM and MGRS are decoded in `gcsplan.world.geodesy.grids`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

from gcsplan.notes.note import Note
from gcsplan.world.geodesy import grids

MAX_CHARS = 100
"""Longest text of a place; every known format is shorter than 60."""

PLACE_EXAMPLES = (
    "47.39708, 8.34403", "47.39708 N, 8.34403 E", "47°23'49.5\"N 8°20'38.5\"E", grids.UTM_EXAMPLE, grids.MGRS_EXAMPLE,
)  # fmt: skip
"""One text for each format, for messages and for the reference."""

LAT_LETTERS, LON_LETTERS = "NS", "EW"


@dataclass(frozen=True, slots=True)
class Degrees:
    """A place in degrees, with its height above ground if it has one, and a note on how it was read."""

    lat_deg: float
    lon_deg: float
    agl_m: float | None = None
    note: Note | None = None


class _Angle(NamedTuple):
    """One written angle in degrees, and whether it has minutes."""

    deg: float
    minutes: bool


_FIGURE = r"(?:\d+(?:\.\d*)?|\.\d+)"
_ANGLE = re.compile(
    rf"""(?P<sign>[-+]?)\s*(?P<deg>{_FIGURE})
    (?:\s*°\s*(?:(?P<m1>{_FIGURE})\s*(?:'\s*(?:(?P<s1>{_FIGURE})\s*"?)?)?)?  # 47°23'49.5", the last mark may be absent
      |:(?P<m2>{_FIGURE})(?::(?P<s2>{_FIGURE}))?                             # 47:23:49.5
      |\s+(?P<m3>{_FIGURE})(?:\s+(?P<s3>{_FIGURE}))?                         # 47 23 49.5
    )?""",
    re.VERBOSE,
)
_PLACE_FLOAT = re.compile(rf"[-+]?{_FIGURE}(?:E[-+]?\d{{1,3}})?")
_LETTERS_BEFORE = re.compile(r"([NSEW])\s*([^NSEW]+?)\s*[,;/]?\s*([NSEW])\s*([^NSEW]+)")
_AFTER = re.compile(r"([^NSEW]+?)\s*([NSEW])\s*[,;/]?\s*([^NSEW]+?)\s*([NSEW])")
_ONE_BEFORE, _ONE_AFTER = re.compile(r"([NSEW])\s*([^NSEW]+)"), re.compile(r"([^NSEW]+?)\s*([NSEW])")

_MARKS = {
    "°": "º˚∘", "'": "′’‘ʹʼ´`‛＇", '"': "″”“ʺ„‟〃＂", "-": "−–‐‑﹣－", " ": "\u00a0\u2000\u2001\u2002\u2003\u2004\u2005"
    "\u2006\u2007\u2008\u2009\u200a\u202f\u205f\u3000\t", "": "\u200b\u200e\u200f\u2060\ufeff",
}  # fmt: skip
"""The characters that programs and typographers write for each mark."""
_PLAIN_MARKS = str.maketrans({other: mark for mark, others in _MARKS.items() for other in others})
_WORDS_OF_PLACES = {"NORTH": "N", "SOUTH": "S", "EAST": "E", "WEST": "W", "DEGREES": "°", "DEG": "°"}


def read_place(text: str) -> Degrees:
    """The place that ``text`` names. Raises ValueError: the text, the format that it was taken for, and the cure."""
    if len(text) > MAX_CHARS:
        raise ValueError(
            f"a place has at most {MAX_CHARS} characters, given {len(text)}; for example `{PLACE_EXAMPLES[0]}`"
        )
    plain = _plain(text)
    if not re.search(r"\d", plain):
        raise ValueError(
            f"{text!r} is no place: write latitude and longitude (`{PLACE_EXAMPLES[0]}` or `{PLACE_EXAMPLES[2]}`), UTM "
            f"(`{grids.UTM_EXAMPLE}`) or MGRS (`{grids.MGRS_EXAMPLE}`)"
        )
    kind = "degrees"
    try:
        for grid, read in (("MGRS", grids.read_mgrs), ("UTM", grids.read_utm)):
            kind = grid
            found = read(plain)
            if found is not None:
                return Degrees(found.lat_deg, found.lon_deg, note=found.note)
        kind = "degrees"
        lat_deg, lon_deg = _read_degrees(plain)
        fault = range_fault(lat_deg, lon_deg)
        if fault:
            raise grids.NotAPlace(fault)
    except grids.NotAPlace as why:
        example = grids.GRID_EXAMPLES.get(
            kind, PLACE_EXAMPLES[2] if "°" in plain or "'" in plain else PLACE_EXAMPLES[0]
        )
        cure = f"; for example `{example}`" if why.needs_example else ""
        raise ValueError(f"{text!r} is read as {kind}: {why}{cure}") from None
    return Degrees(lat_deg, lon_deg)


def read_angle(value: Any, letters: str) -> Any:
    """A latitude (``letters`` NS) or longitude (EW) that is written as text, in degrees; anything else is itself."""
    if not isinstance(value, str):
        return value
    name, example = ("latitude", "47°23'49.5\"N") if letters == LAT_LETTERS else ("longitude", "8°20'38.5\"E")
    try:
        if len(value) > MAX_CHARS:
            raise grids.NotAPlace(f"it has {len(value)} characters, more than {MAX_CHARS}")
        plain = _abbreviated(_plain(value))
        before, after = _ONE_BEFORE.fullmatch(plain), _ONE_AFTER.fullmatch(plain)
        if before is None and after is None:
            return _angle(plain, "").deg
        letter, angle = before.groups() if before is not None else after.groups()[::-1]  # type: ignore[union-attr]
        if letter not in letters:
            raise grids.NotAPlace(f"{letter} is no letter of a {name} ({letters[0]} or {letters[1]})")
        return _angle(angle, letter).deg
    except grids.NotAPlace as why:
        raise ValueError(f"{value[:MAX_CHARS]!r} is read as a {name}: {why}; for example `{example}`") from None


def range_fault(lat_deg: float, lon_deg: float, *, most_lon_deg: float = 180.0) -> str:
    """Why the numbers are no place on Earth, or an empty text."""
    if abs(lat_deg) <= 90.0 and abs(lon_deg) <= most_lon_deg:
        return ""
    if is_swapped(lat_deg, lon_deg):
        return (
            f"latitude and longitude look swapped: {lat_deg:g} is no latitude; give [lat, lon], did you mean "
            f"{lon_deg:.10g}, {lat_deg:.10g}?"
        )
    if abs(lat_deg) >= 1000.0:
        return (
            f"latitude must be within ±90°, given {lat_deg:.10g} (metres of UTM need their zone: "
            f"`{grids.UTM_EXAMPLE}`; degrees with colons need quotes where YAML 1.1 is read: `47:23:49, 8:20:38`)"
        )
    if abs(lat_deg) > 90.0:
        return f"latitude must be within ±90°, given {lat_deg:g}"
    turned = (lon_deg + 180.0) % 360.0 - 180.0
    cure = f": write {turned:.10g}" if abs(lon_deg) <= 720.0 else ""
    return f"longitude must be within ±{most_lon_deg:g}°, given {lon_deg:.10g}{cure}"


def is_swapped(lat_deg: float, lon_deg: float) -> bool:
    """Whether numbers that are no place would be one if latitude and longitude were exchanged."""
    return 90.0 < abs(lat_deg) <= 180.0 and abs(lon_deg) <= 90.0


def _plain(text: str) -> str:
    """``text`` in capitals with plain marks, without the brackets around it."""
    plain = " ".join(text.translate(_PLAIN_MARKS).replace("''", '"').upper().split())
    if plain[:1] + plain[-1:] in ("()", "[]"):
        plain = plain[1:-1].strip()
    return plain


def _abbreviated(plain: str) -> str:
    """Words as letters and marks: NORTH is N, DEG and the D of 47D23' are °."""
    short = re.sub(r"[A-Z]+", lambda word: _WORDS_OF_PLACES.get(word[0], word[0]), plain)
    return re.sub(r"(?<=\d)\s*D(?![A-Z])", "°", short)


def _read_degrees(plain: str) -> tuple[float, float]:
    """Latitude and longitude in degrees, not yet checked for their range."""
    parts = plain.split(",")
    if len(parts) == 2 and all(
        _PLACE_FLOAT.fullmatch(part.strip()) for part in parts
    ):  # also 1e-05, as programs print it
        return float(parts[0]), float(parts[1])
    text = _abbreviated(plain)
    other = re.search(r"[^-+0-9NSEW°'\":.,;/ ]+", text)
    if other:
        raise grids.NotAPlace(f"{other[0][:20]!r} is no part of it")
    found = re.findall("[NSEW]", text)
    if not found:
        first, second = (_angle(part, "") for part in _halves(text))
        if first.minutes != second.minutes:  # `47,39 8` is meant with a decimal comma
            raise grids.NotAPlace("one angle has minutes and the other one has not")
        return first.deg, second.deg
    before, after = _LETTERS_BEFORE.fullmatch(text), _AFTER.fullmatch(text)
    if len(found) == 1 and (_ONE_BEFORE.fullmatch(text) or _ONE_AFTER.fullmatch(text)) and "," not in text:
        missing, there = ("longitude", "latitude") if found[0] in LAT_LETTERS else ("latitude", "longitude")
        raise grids.NotAPlace(f"it is a {there} alone; the {missing} is missing")
    if len(found) != 2 or (before is None and after is None):
        raise grids.NotAPlace(
            "both angles have a letter (N or S, E or W), before them or after them, or neither has one"
        )
    if sum(letter in LAT_LETTERS for letter in found) != 1:
        raise grids.NotAPlace(f"one letter is N or S and the other one E or W, given {found[0]} and {found[1]}")
    if before is not None:
        one, angle, two, other_angle = before.groups()
    else:
        assert after is not None
        angle, one, other_angle, two = after.groups()
    degrees = {letter: _angle(part, letter).deg for letter, part in ((one, angle), (two, other_angle))}
    lat, lon = (one, two) if one in LAT_LETTERS else (two, one)
    for name, letter, most in (("latitude", lat, 90), ("longitude", lon, 180)):
        if abs(degrees[letter]) > most:  # the letters say which is which, so nothing is swapped
            raise grids.NotAPlace(f"a {name} is at most {most}°, given {abs(degrees[letter]):.10g}° {letter}")
    return degrees[lat], degrees[lon]


def _halves(text: str) -> list[str]:
    """The two angles of a text without letters."""
    parts = [part.strip() for part in re.split(r"[,;/]", text)]
    if len(parts) == 1:
        parts = re.split(rf"\s+(?=[-+]?\s*{_FIGURE}\s*°)", text) if text.count("°") == 2 else text.split()
    if len(parts) == 2:
        return parts
    if "," in text and "." not in text and len(parts) > 1:
        raise grids.NotAPlace("a comma parts latitude and longitude; the decimals begin with a point")
    if len(parts) == 3:
        raise grids.NotAPlace("it has a third part; a height stands as agl_m beside lat and lon, or beside at")
    raise grids.NotAPlace("give a latitude and a longitude, with a comma between them")


def _angle(text: str, letter: str) -> _Angle:
    """One angle; ``letter`` is its hemisphere, or empty. Fractions keep the value exact to its digits."""
    match = _ANGLE.fullmatch(text.strip())
    if match is None:
        comma = "; decimals begin with a point" if re.search(r"\d,\d", text) else ""
        raise grids.NotAPlace(f"{text.strip()[:40]!r} is no angle{comma}")
    sign, whole = match["sign"], match["deg"]
    minutes, seconds = (match[f"{k}1"] or match[f"{k}2"] or match[f"{k}3"] for k in "ms")
    if sign and letter:
        raise grids.NotAPlace(f"{sign} and {letter} both say the hemisphere; keep one")
    for upper, lower, name in ((whole, minutes, "minutes"), (minutes, seconds, "seconds")):
        if lower is not None and "." in upper:
            raise grids.NotAPlace(f"{upper} has decimals, and {lower} {name} follow it")
        if lower is not None and not Fraction(lower) < 60:
            raise grids.NotAPlace(f"{name} are below 60, given {lower}")
    degrees = Fraction(whole) + Fraction(minutes or 0) / 60 + Fraction(seconds or 0) / 3600
    value = float(degrees)
    return _Angle(-value if value and (sign == "-" or letter in ("S", "W")) else value, minutes is not None)
