"""Units of height: their names in files, the one that counts for a raster, and who states it."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.units import FOOT

US_FOOT_M = 1200 / 3937

SAME_UNIT = 1e-9
"""Units whose lengths differ by no more than this part are one unit: registers round the US survey foot."""


@dataclass(frozen=True, slots=True)
class HeightUnit:
    """A unit of height. ``by`` names who states it: the file, a key, a format, or nobody."""

    name: str
    metres: float
    by: str = ""

    def is_same(self, other: HeightUnit) -> bool:
        """Whether both are one length, whatever their names."""
        return math.isclose(self.metres, other.metres, rel_tol=SAME_UNIT)

    def stated(self) -> str:
        """The unit and who states it, for one line of a report."""
        return f"{self.name}, {self.by}" if self.by else self.name


METRE, FEET, US_FEET = HeightUnit("metres", 1.0), HeightUnit("feet", FOOT.size), HeightUnit("US survey feet", US_FOOT_M)
OF_KEY = {"m": METRE, "ft": FEET, "us_ft": US_FEET}
"""The unit of each value of ``height_unit``."""

BY_FILE, BY_FORMAT, BY_KEY, BY_NOBODY = "from the file", "as the format has them", "by height_unit", "no unit is stated"

_PREFIXES = {"": ("", 1.0), "k": ("kilo", 1000.0), "d": ("deci", 0.1), "c": ("centi", 0.01), "m": ("milli", 0.001)}
_SPELLED = {
    **dict.fromkeys(("ft", "foot", "feet"), FEET),
    **{of + word: FEET for of in ("international", "intl", "int", "i") for word in ("ft", "foot", "feet")},
    **{word + of: FEET for word in ("ft", "foot", "feet") for of in ("international", "intl", "int")},
    **{
        of + word: US_FEET
        for of in ("us", "ussurvey", "survey", "uss", "unitedstates", "unitedstatessurvey", "ussv")
        for word in ("ft", "foot", "feet")
    },
    **{word + of: US_FEET for word in ("ft", "foot", "feet") for of in ("us", "ussurvey", "survey", "uss")},
    "sft": US_FEET,
    **{
        word: HeightUnit(f"{long}metres", size)
        for short, (long, size) in _PREFIXES.items()
        for word in (f"{short}m", *(f"{long}{end}" for end in ("metre", "metres", "meter", "meters")))
    },
    "mtr": METRE, "mtrs": METRE, "ms": METRE,
}  # fmt: skip
"""By the words that files use, of which letters alone count, in lower case."""


def unit_named(words: str) -> HeightUnit | None:
    """The unit that a file calls ``words``; None if nobody knows it, or if they count with it (``m/10``)."""
    if re.search(r"[0-9/*^%]", words):
        return None
    return _SPELLED.get(re.sub(r"[^a-z]", "", words.lower()))


def unit_of_prj(text: str) -> str:
    """The name of the unit of heights in the text of ArcInfo's .prj (``Zunits FEET``); empty if it states none.

    GDAL reads the unit of its places alone. A number is how many units make a metre; only 1 is a unit with a name.
    """
    found = re.search(r"(?im)^[ \t]*zunits[ \t]+(\S.*?)\s*$", text)
    words = "" if found is None else found[1]
    return "" if words.upper() == "NO" else "metres" if re.fullmatch(r"1(\.0*)?", words) else words


def unit_of_length(metres: float, name: str) -> HeightUnit:
    """The unit of a coordinate system's axis, by its length; one without a name of its own is called ``name``."""
    for unit in OF_KEY.values():
        if math.isclose(unit.metres, metres, rel_tol=SAME_UNIT):
            return unit
    return HeightUnit(name, metres)


def unit_that_counts(
    stated: Sequence[HeightUnit], given: str | None, horizontal: HeightUnit, file: str, *, where: str
) -> tuple[HeightUnit, list[Note]]:
    """The unit of a file's heights, and notes.

    ``stated`` are the units that the file and the vertical datum state, ``given`` is ``height_unit`` (`OF_KEY`), which
    counts before all of them; ``horizontal`` is the unit of the grid. Where nothing is stated, metres count over a grid
    in metres or degrees. Raises InputError where two units are stated, and over a grid in feet where none is.
    """
    names = tuple(dict.fromkeys(f"{unit.name} ({unit.by})" for unit in stated))
    if given is not None:
        unit = replace(OF_KEY[given], by=BY_KEY)
        other = [s for s in stated if not s.is_same(unit)]
        return unit, [Note("heights_in_unit_of_key", file=file, height_unit=unit.name, stated=names)] if other else []
    if any(not s.is_same(stated[0]) for s in stated[1:]):
        raise InputError(
            f"{file} states two units of height: {', '.join(names)}; state the right one with `height_unit: us_ft` "
            "(or m, ft)",
            where=where,
        )
    if stated:
        unit = stated[0]
        plain = unit.is_same(METRE)
        return unit, [] if plain else [Note("heights_in_unit", file=file, height_unit=unit.name, by=unit.by)]
    if not horizontal.is_same(METRE):
        likely = next((key for key, unit in OF_KEY.items() if unit.is_same(horizontal)), "m")
        raise InputError(
            f"the grid of {file} is in {horizontal.name}, and nothing states the unit of its heights; state it with "
            f"`height_unit: {likely}` (or {', '.join(key for key in OF_KEY if key != likely)})",
            where=where,
        )
    return replace(METRE, by=BY_NOBODY), []
