"""Floors and ceilings of zones as authorities write them: ``1500 FT AMSL``, ``450 m AGL``, ``FL 65``, ``GND``, ``UNL``.

A level is a number, a unit and a reference in any order, or a word for the ground or for no limit. The words may also
stand beside the number, in the attribute's name (``LOWER_FT_AGL``) or in attributes of their own (``LOWER_UOM``). A
missing part is never guessed: a unit or a reference that is guessed wrong makes a zone smaller than it is.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from decimal import Decimal
from enum import Enum

from gcsplan.units import FOOT
from gcsplan.world.geometry.zones import Level

LARGEST_M = 1e6
"""A height or radius above this, m, is a mistake."""

FOOT_M = Decimal(str(FOOT.size))
PRESSURE = "STD"

LEVEL_UNITS = (
    dict.fromkeys(("M", "METER", "METERS", "METRE", "METRES"), Decimal(1))
    | dict.fromkeys(("FT", "FOOT", "FEET"), FOOT_M)
    | {"FL": 100 * FOOT_M}
)
"""Metres of one unit, by its names."""

REFERENCES = (
    dict.fromkeys(("AMSL", "MSL", "ASL"), "amsl")
    | dict.fromkeys(("AGL", "GND", "SFC", "GROUND", "SURFACE", "AGND", "ASFC"), "agl")
    | {PRESSURE: PRESSURE}
)
"""The zero of a height, by its names."""

GROUND_WORDS = frozenset({"GND", "SFC", "GROUND", "SURFACE"})
UNLIMITED_WORDS = frozenset({"UNL", "UNLIM", "UNLTD", "UNLIMITED"})

LEVEL_EXAMPLES = "1500 FT AMSL, 450 M AGL, FL 65, GND or UNL"

_MOST_LEVEL_CHARACTERS = 60
_TOKEN = re.compile(
    r"\s+|(?P<number>[+-]?(?:(?:\d+(?:,\d{3})+(?![\d,])|\d+)(?:\.\d*)?|\.\d+)(?:E[+-]?\d{1,2}(?!\d))?)|(?P<word>[A-Z]+)",
    re.ASCII,
)
_FEET_MARKS = str.maketrans(dict.fromkeys("'\u2019\u2032", " FT "))
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}\.\d{3}", re.ASCII)


class Limit(Enum):
    """Levels that are not a number of metres."""

    UNLIMITED = "unlimited"
    PRESSURE = "a flight level"


class LevelError(ValueError):
    """The level cannot be read; the text says why."""


def read_level(value: str | int | float, words: Iterable[str] = (), spare: Sequence[str] = ()) -> Level | Limit:
    """The level of a number or text. Raises LevelError.

    ``words`` belong to it too (units and references in other attributes, or in the attribute's name); ``spare`` are
    used for what is missing alone. The ground is 0 m AGL.
    """
    numbers, named = _tokens(str(value).translate(_FEET_MARKS) if isinstance(value, str) else repr(value))
    for more in words:
        further, names = _tokens(more)
        numbers += further
        named |= names
    units = {LEVEL_UNITS[w] for w in named if w in LEVEL_UNITS}
    references = {REFERENCES[w] for w in named if w in REFERENCES}
    if unknown := sorted(named - LEVEL_UNITS.keys() - REFERENCES.keys() - UNLIMITED_WORDS):
        raise LevelError(f"{unknown[0]!r} is not known")
    if len(numbers) > 1:
        raise LevelError("it holds several numbers")
    if named & UNLIMITED_WORDS:
        if numbers or named & GROUND_WORDS:
            raise LevelError("it is unlimited and has a limit")
        return Limit.UNLIMITED
    if not numbers:
        if named & GROUND_WORDS and references == {"agl"}:
            return Level(0.0, "agl")
        raise LevelError("it holds no number")
    for word in (text.strip().upper() for text in spare):
        if not units and word in LEVEL_UNITS:
            units = {LEVEL_UNITS[word]}
        elif not references and word in REFERENCES:
            references = {REFERENCES[word]}
    if isinstance(value, str):
        _require_plain(numbers[0], units)
    return _level(Decimal(numbers[0].replace(",", "")), units, references)


def _tokens(text: str) -> tuple[list[str], set[str]]:
    """The numbers and the words of a text."""
    if len(text) > _MOST_LEVEL_CHARACTERS:
        raise LevelError("it is too long")
    text = text.upper()
    numbers, words, at = [], set(), 0
    while at < len(text):
        token = _TOKEN.match(text, at)
        if token is None:
            raise LevelError(f"{text[at]!r} is not known")
        if token["number"]:
            numbers.append(token["number"])
        elif token["word"]:
            words.add(token["word"])
        at = token.end()
    return numbers, words


def _require_plain(number: str, units: set[Decimal]) -> None:
    """Refuse numbers that are a thousand times larger in one country than in another.

    Nobody writes a thousandth of a foot, so that a comma before three digits parts thousands of feet.
    """
    grouped = "," in number and not (units and units <= {FOOT_M} and not number.lstrip("+-").startswith("0"))
    if grouped or _GROUPED.fullmatch(number):
        raise LevelError(f"{number} has a decimal point in some countries, in others thousands: leave it out")


def _level(number: Decimal, units: set[Decimal], references: set[str]) -> Level | Limit:
    if len(units) > 1 or len(references) > 1:
        raise LevelError(f"it has two {'units' if len(units) > 1 else 'references'}")
    is_flight_level = units == {LEVEL_UNITS["FL"]}
    if is_flight_level and references - {PRESSURE}:
        raise LevelError("a flight level is a pressure altitude, not one above ground or sea")
    if is_flight_level or references == {PRESSURE}:
        return Limit.PRESSURE
    if number == 0 and not references:  # of both meanings the one that reaches lower
        return Level(0.0, "agl")
    missing = [what for what, has in (("unit", units or number == 0), ("reference", references)) if not has]
    if missing:
        raise LevelError(f"it has no {' and no '.join(missing)}")
    height_m = number * (units.pop() if units else 1)
    if abs(height_m) > LARGEST_M:
        raise LevelError(f"it is more than {LARGEST_M:g} m")
    return Level(float(height_m), "amsl" if references == {"amsl"} else "agl")
