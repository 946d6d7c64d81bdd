"""The attributes of a zone, in every format: its name, floor, ceiling, and its radius or buffer.

There is one table of names, and case does not matter. An attribute that seems to limit a zone but is not read leaves
the zone larger, and a remark says so; a limit that is read and not understood is a mistake.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from gcsplan.errors import Mistake
from gcsplan.mission_file.zones.draft import SIZE_KEYS, Bounds, Remark, one_line
from gcsplan.mission_file.zones.levels import (
    LARGEST_M,
    LEVEL_EXAMPLES,
    LEVEL_UNITS,
    REFERENCES,
    LevelError,
    Limit,
    read_level,
)
from gcsplan.notes.note import Note
from gcsplan.world.geometry.zones import Level

MOST_ATTRIBUTES_SHOWN = 6
"""Most attributes of one zone that a remark names."""

NAME_ATTRIBUTES = ("name", "title", "label", "designator", "identifier", "ident")
OWN = ("flooraglm", "flooramslm", "ceilingaglm", "ceilingamslm")
BOUNDS = {
    "lower": "floor", "floor": "floor", "bottom": "floor", "base": "floor",
    "upper": "ceiling", "ceiling": "ceiling", "top": "ceiling",
}  # fmt: skip
"""The words for a floor and for a ceiling with which attributes' names begin."""

UNIT_NAMES = ("unit", "units", "uom")
REFERENCE_NAMES = ("reference", "ref", "datum", "code")

KEEP_IN = "keep_in"

ATTRIBUTES_UNREAD = Note("zone_attributes_unread")
TIMES_UNREAD = Note("zone_times_unread")
UNDER_PRESSURE = Note("zone_floor_at_flight_level")
OVER_PRESSURE = Note("zone_ceiling_at_flight_level")

_WORD = "|".join(sorted({w.lower() for w in (*LEVEL_UNITS, *REFERENCES)}, key=len, reverse=True))
_LIMIT = re.compile(
    rf"(?:distvert)?(?P<bound>{'|'.join(BOUNDS)})(?:ceiling|limit|lim|altitude|alt|height|elevation|elev|level)?"
    rf"(?:(?:value|val)?(?P<first>{_WORD})?(?P<second>{_WORD})?|(?P<unit>{'|'.join(UNIT_NAMES)})"
    rf"|(?:vertical)?(?:reference)?(?P<reference>{'|'.join(REFERENCE_NAMES)}))"
)
"""The name of an attribute of a floor or ceiling, in lower case, letters alone."""

_SHARED = re.compile(
    rf"(?:altitude|vertical|height)?(?:{'|'.join(UNIT_NAMES)})|uomdimensions|(?:altitude|vertical)(?:reference|datum)"
)
_SEEMS_A_LIMIT = re.compile(
    r"floor|ceil|lower|upper|altitude|height|elev|vertical|limit|radius|buffer|(?<![a-z])(?:alt|agl|amsl|msl)(?![a-z])"
)
_SEEMS_A_TIME = re.compile(
    r"(?:valid|effective|activ\w*?|start|begin|end|expir\w*?|permanent)"
    r"(?:from|to|until|till|on|at|date|time|datetime|day|days|hour|hours|times|period|span|stamp|utc|local)*"
    r"|timespan|timestamp|\w*schedule|\w*applicability|(?:operating|opening|operational)?hours(?:ofoperation)?|weekdays?|times?ofuse|wkhr\w*"
)
"""The name of an attribute that says when a zone applies, in lower case, letters alone."""

_LIKE_A_LEVEL = re.compile(
    r"\d\s*(?:M|F|['\u2019\u2032])|FL\s*\d|^\s*(?:GND|SFC|GROUND|SURFACE|UNL\w*)\s*$", re.ASCII | re.IGNORECASE
)
"""A quick look at values, most of which are no levels."""

_OPENAIP_CODES = {"unit": {0: "M", 1: "FT", 6: "FL"}, "referencedatum": {0: "GND", 1: "MSL", 2: "STD"}}
"""The numbers with which openAIP's files name units and references."""


@dataclass(frozen=True, slots=True)
class Meaning:
    """The meaning of an attribute's name: ``own`` is a key of mission files, ``limit`` a floor or ceiling."""

    lower: str
    own: bool
    limit: re.Match[str] | None
    shared: bool
    used: bool
    seems_a_limit: bool
    seems_a_time: bool = False


@lru_cache(maxsize=4096)  # features repeat their attributes' names
def meaning_of(key: str) -> Meaning:
    """The meaning of a name, whatever its case, spaces and signs."""
    lower = key.lower()
    plain = re.sub(r"[^a-z0-9]", "", lower)
    limit, shared = _LIMIT.fullmatch(plain), bool(_SHARED.fullmatch(plain))
    used = limit is not None or shared or lower in (*NAME_ATTRIBUTES, *SIZE_KEYS)
    is_time = not used and bool(_SEEMS_A_TIME.fullmatch(re.sub(r"[^a-z]", "", lower)))
    return Meaning(lower, plain in OWN, limit, shared, used, bool(_SEEMS_A_LIMIT.search(lower)), is_time)


@dataclass(frozen=True, slots=True)
class Attribute:
    """A name and a value as the file has them, and the place for messages."""

    key: str
    value: Any
    where: str
    stands_for: str = ""
    """The name in the table for which its own name stands in this file, if that is another."""

    @property
    def meaning(self) -> Meaning:
        """The meaning of its name."""
        return meaning_of(self.stands_for or self.key)

    def __str__(self) -> str:
        return one_line(f"{self.key[:40]} {repr(self.value)[:60]}")


@dataclass(frozen=True, slots=True)
class ZoneStatements:
    """The name, limits and size of one zone, by its attributes."""

    name: str
    radius_m: float | None
    bounds: Bounds
    remarks: tuple[Remark, ...]
    of_levels: bool
    """Whether an attribute speaks of a floor or ceiling, if only to say that there is none."""
    buffer_m: float | None = None
    unread: tuple[Mistake, ...] = ()
    """Mistakes in its floor and ceiling, which are then missing."""
    keep_in: bool = False
    """Whether it is an area to stay in: gcsplan's own files say so, by ``kind``."""


def read_attributes(
    given: Sequence[Attribute], where: str, name: str, problems: list[Mistake]
) -> ZoneStatements | None:
    """The statements of the attributes of the zone at ``where``; ``name`` is for a zone without one.

    None, and ``problems``, if its size cannot be read; mistakes in its floor and ceiling are in ``unread``.
    """
    known: list[Attribute] = []
    ignored: list[Attribute] = []
    times: list[Attribute] = []
    for a in given:
        if a.value is None or (isinstance(a.value, str) and not a.value.strip()):
            continue
        meaning = a.meaning
        if meaning.used:
            known.append(a)
        elif meaning.seems_a_time:
            times.append(a)
        elif meaning.seems_a_limit or _reads_as_level(a.value):
            ignored.append(a)
    before = len(problems)
    own_name = _name(known) or name
    sizes = _ZoneReading(own_name, problems)
    radius_m, buffer_m = (sizes.size_m([a for a in known if a.meaning.lower == size]) for size in SIZE_KEYS)
    unread: list[Mistake] = []
    reading = _ZoneReading("", unread)
    bounds = reading.bounds(known)
    if not unread:
        bounds.levels(where, unread)
    for note, some in ((ATTRIBUTES_UNREAD, ignored), (TIMES_UNREAD, times)):
        if some:
            more = ("…",) if len(some) > MOST_ATTRIBUTES_SHOWN else ()
            reading.remarks.append((note, (*map(str, some[:MOST_ATTRIBUTES_SHOWN]), *more)))
    if len(problems) > before:
        return None
    inside = any(a.meaning.lower == "kind" and a.value == KEEP_IN for a in given)
    return ZoneStatements(
        own_name, radius_m, Bounds() if unread else bounds, tuple(reading.remarks), reading.of_levels, buffer_m,
        tuple(unread), inside,
    )  # fmt: skip


def level_read(given: object, bound: str, level: Level) -> Note:
    """A note on the reading of a limit as it is written: ``bound`` is floor or ceiling."""
    return Note("level_of_attribute", given=str(given), bound=bound, level_m=level.value_m, datum=level.datum.upper())


def shown(value: Any) -> str:
    """A value of a file, for messages."""
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else f"a list of {len(value)}"
    return repr(value)[:60]


def as_figure(text: str) -> float | str:
    """The number that a text is, in formats that have no numbers; the text if it is none."""
    try:
        return float(text)
    except ValueError:
        return text


def is_number(value: Any) -> bool:
    """Whether the value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _name(given: Sequence[Attribute]) -> str:
    """The name: the first in the table's order, and of its spellings the one in lower case."""
    named = [a for a in given if a.meaning.lower in NAME_ATTRIBUTES]
    best = min(named, key=lambda a: (NAME_ATTRIBUTES.index(a.meaning.lower), a.key != a.meaning.lower), default=None)
    return "" if best is None else str(best.value).strip()


def _reads_as_level(value: Any) -> bool:
    try:
        return isinstance(value, str) and bool(_LIKE_A_LEVEL.search(value)) and bool(read_level(value))
    except LevelError:
        return False


@dataclass
class _ZoneReading:
    """One zone while its attributes are read; without a ``name`` its mistakes do not begin with it."""

    name: str
    problems: list[Mistake]
    remarks: list[Remark] = field(default_factory=list)
    of_levels: bool = False
    read_as: list[Note] = field(default_factory=list)

    def size_m(self, given: Sequence[Attribute]) -> float | None:
        found = {self._metres(a): a for a in given}
        if len(found) > 1:
            self._wrong(given[1], f"and {given[0]} contradict each other: leave one out")
        return next(iter(found), None)

    def _metres(self, attribute: Attribute) -> float | None:
        value = attribute.value
        if is_number(value) and abs(value) <= LARGEST_M:
            return float(value)
        self.problems.append(Mistake(attribute.where, f"must be a number, given {shown(value)}"))
        return None

    def bounds(self, given: Sequence[Attribute]) -> Bounds:
        shared = [str(a.value) for a in given if a.meaning.shared]
        limits = [(a, match) for a in given if (match := a.meaning.limit) is not None]
        levels: dict[str, float] = {}
        for bound in ("floor", "ceiling"):
            own = [(a, match) for a, match in limits if BOUNDS[match["bound"]] == bound]
            beside = [str(a.value) for a, match in own if match["unit"] or match["reference"]]
            read: dict[Level | Limit, Attribute] = {}
            for a, match in own:
                if match["unit"] or match["reference"]:
                    continue
                self.of_levels = True
                implied = [w for w in (match["first"], match["second"]) if w]
                level = self._level(a, implied + beside, shared)
                if level is not None:
                    read.setdefault(level, a)
            levels |= self._settled(bound, read)
        if self.read_as:
            self.remarks.append((Note("zone_limits_read"), tuple(self.read_as)))
        return Bounds(**levels)

    def _settled(self, bound: str, read: dict[Level | Limit, Attribute]) -> dict[str, float]:
        """The level of one bound as the key and the value of a mission file; nothing where it has no end."""
        if not read:
            return {}
        if len(read) > 1:
            one, other = list(read.values())[:2]
            self._wrong(other, f"and {one} say two things about one {bound}: leave one out, not both can hold")
            return {}
        ((level, attribute),) = read.items()
        if isinstance(level, Level):
            if bound == "ceiling" and level == Level(0.0, "agl"):
                self._wrong(attribute, "is a ceiling at the ground, and the zone would lie wholly under ground")
                return {}
            if not attribute.meaning.own and level != Level(0.0, "agl"):
                self.read_as.append(level_read(attribute, bound, level))
            return {f"{bound}_{level.datum}_m": level.value_m}
        if level is Limit.PRESSURE:
            self.remarks.append((UNDER_PRESSURE if bound == "floor" else OVER_PRESSURE, str(attribute)))
        elif bound == "floor":
            self._wrong(attribute, f"is a floor without end; write a height such as {LEVEL_EXAMPLES}")
        return {}

    def _level(self, attribute: Attribute, words: Sequence[str], shared: Sequence[str]) -> Level | Limit | None:
        value = attribute.value
        try:
            if isinstance(value, str) and attribute.meaning.own:
                value = as_figure(value)
            if isinstance(value, dict):
                value, more = _parts(value)
                words = [*words, *more]
            if isinstance(value, bool) or not isinstance(value, int | float | str):
                raise LevelError("it is no number and no text")
            return read_level(value, words, shared)
        except LevelError as why:
            beside = f"({', '.join(words)[:60]}) " if words else ""
            self._wrong(
                attribute,
                f"{beside}cannot be read as a level: {why}. Write for example {LEVEL_EXAMPLES}; rename "
                "the attribute if it is no level",
            )
            return None

    def _wrong(self, attribute: Attribute, words: str) -> None:
        named = f"zone {self.name[:60]!r}: " if self.name else ""
        self.problems.append(Mistake(attribute.where, f"{named}{attribute} {words}"))


def _parts(value: dict[Any, Any]) -> tuple[Any, list[str]]:
    """Value and words of an object such as openAIP's ``{"value": 1500, "unit": 1, "referenceDatum": 1}``."""
    number: Any = None
    words = []
    for key, part in value.items():
        plain = re.sub(r"[^a-z]", "", str(key).lower())
        if plain in ("value", "val"):
            number = part
        elif plain in (*UNIT_NAMES, *REFERENCE_NAMES, "referencedatum"):
            words.append(_OPENAIP_CODES.get(plain, {}).get(part, "") if is_number(part) else str(part))
            if not words[-1]:
                raise LevelError(f"its {str(key)[:20]} {part!r} is not known")
        else:
            raise LevelError(f"its {str(key)[:20]!r} is not known")
    return number, words
