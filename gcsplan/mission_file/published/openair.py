"""Zones from OpenAir text: WinPilot's format of 1998, and the records that SeeYou has added to it since.

One record stands on a line; a zone begins with AC and ends with the next. A comment begins with ``*``. Distances are
nautical miles, bearings count from true north.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from gcsplan.errors import Mistake
from gcsplan.figures import counted
from gcsplan.mission_file.published.arcs import Arc, ArcError, corners_of, outline
from gcsplan.mission_file.published.policy import UNREAD_TIMES, Policy, Published
from gcsplan.mission_file.published.times import Period, TimeError, read_end, read_instant
from gcsplan.mission_file.published.volumes import AirspaceFile, Given, VolumeLimits
from gcsplan.mission_file.zones.contents import decoded
from gcsplan.mission_file.zones.draft import MAX_VERTICES, Remark, one_line
from gcsplan.mission_file.zones.file import ZoneFile
from gcsplan.notes.note import Datum, Note
from gcsplan.world.geodesy.degree_shapes import MOST_LON_DEG, Corner

NAUTICAL_MILE_M = 1852.0

SILENT_CLASSES = frozenset({"UNC", "NONE"})
"""A class and a type that say nothing; a zone with nothing else is no-fly."""

FREE_CLASSES_AND_TYPES = frozenset({"G", "FIR", "UIR", "FIS", "ACCSEC", "VFRSEC", "TRZ"})
"""Classes and types in which no rule keeps anybody out: class G, regions of information, hints."""

OPENAIR_CLASSES_AND_TYPES = (
    "A", "B", "C", "D", "E", "F", "G", "UNC", "R", "Q", "P", "GP", "CTR", "W", "ADIZ", "ALERT", "ASRA", "ATZ", "AWY",
    "CTA", "CUSTOM", "FIR", "FIS", "ACCSEC", "GSEC", "HTZ", "LTA", "MATZ", "MTA", "MTR", "MTMA", "N", "NONE", "OFR",
    "RMZ", "TFR", "TIA", "TIZ", "TMA", "TMZ", "TRA", "TRAFR", "TRZ", "TSA", "UIR", "UTA", "VFRR", "VFRSEC", "WARNING",
)  # fmt: skip
"""The classes (AC) of both editions and the types (AY) of the second."""

IGNORED = frozenset({"AF", "AG", "AX", "AI", "AT", "SP", "SB"})
"""Frequency, station, transponder code, number, place of a label, pen and brush: they limit nothing."""

DRAWING_RECORDS = frozenset({"DP", "DA", "DB", "DC", "DY"})

EMPTY_LIMITS = Note("zone_limits_empty")
UNSTATED_LIMITS = Note("zone_limits_in_feet_above_sea")

_RECORD = re.compile(r"(V|[A-Z]{2})\s+(\S.*)", re.IGNORECASE)
_VARIABLE = re.compile(r"([A-Z])\s*=\s*(.*)", re.IGNORECASE)
_OPENAIR_PLACE = re.compile(
    r"\s*(\d{1,3}(?:\.\d{1,20})?)(?:\s*:\s*(\d{1,2}(?:\.\d{1,20})?))?(?:\s*:\s*(\d{1,2}(?:\.\d{1,20})?))?\s*([NS])[\s,]*"
    r"(\d{1,3}(?:\.\d{1,20})?)(?:\s*:\s*(\d{1,2}(?:\.\d{1,20})?))?(?:\s*:\s*(\d{1,2}(?:\.\d{1,20})?))?\s*([EW])",
    re.ASCII | re.IGNORECASE,
)
_PART = r"(\d{1,3}(?:\.\d{1,20})?(?:\s*:\s*\d{1,2}(?:\.\d{1,20})?){0,2})"
_LETTERS_FIRST = re.compile(rf"([NS])\s*{_PART}[\s,]*([EW])\s*{_PART}", re.ASCII | re.IGNORECASE)
_COMPACT = re.compile(r"(?<![\d:.])(\d{2,3})([0-5]\d)([0-5]\d(?:\.\d{1,20})?)(?![\d:.])", re.ASCII)
"""Degrees, minutes and seconds in one number, such as 460500.00N 0143000.00E."""
_SPACED = re.compile(r"(?<=\d)[ \t]+(?=\d)", re.ASCII)
"""Between degrees, minutes and seconds, such as 46 05 00 N 014 30 00 E; between two places there are letters."""
_LONGEST_LINE = 2000

MOST_MISTAKES, MOST_FAULTS = 5, 1000
"""Mistakes of one zone, or before the first, that are reported; and those of a file after which it is not read on."""


class _RecordError(ValueError):
    """A record cannot be read; the text says why."""


@dataclass
class _Block:
    """The records of one zone: ``mistakes`` in its limits, and in its outline, so that its place is ``lost``."""

    line: int
    kinds: list[str]
    name: str = ""
    lower: str | None = None
    upper: str | None = None
    pieces: list[Corner | Arc] = field(default_factory=list)
    circles: list[tuple[Corner, float]] = field(default_factory=list)
    times: list[str] = field(default_factory=list)
    mistakes: list[tuple[int, str]] = field(default_factory=list)
    lost: list[tuple[int, str]] = field(default_factory=list)
    clockwise: bool = True
    has_centre: bool = False
    remarks: list[Remark] = field(default_factory=list)

    @property
    def where(self) -> str:
        """Line and name, for messages."""
        return f"line {self.line}" + (f" ({self.name[:60]})" if self.name else "")


def read_openair(path: Path, data: bytes, policy: Policy) -> ZoneFile:
    """The zones of OpenAir text; mistakes are in their problems and faults."""
    return _OpenAirReading(AirspaceFile(path, policy, OPENAIR_CLASSES_AND_TYPES, great_circles=True)).read(_text(data))


def _text(data: bytes) -> str:
    try:
        return decoded(data)
    except UnicodeDecodeError:
        return data.decode("latin-1")  # names alone have other letters, and older programs write them so


@dataclass
class _OpenAirReading:
    """One pass over one file.

    A centre holds for the arcs of the next zone too, as in the format's own sample, and a remark says so. A circle
    needs its own: with the centre of the zone before it would be nowhere near where it belongs.
    """

    file: AirspaceFile
    block: _Block | None = None
    centre: Corner | None = None
    passed: bool = False
    zones: int = 0
    terrain: list[str] = field(default_factory=list)
    number: int = 0

    def read(self, text: str) -> ZoneFile:
        for number, line in enumerate(text.splitlines(), start=1):
            record = line.split("*", 1)[0].strip()
            if not record:
                continue
            if not self.zones and self.block is None and len(self.file.found.problems) >= MOST_MISTAKES:
                break  # it is another format
            if len(self.file.found.problems) > MOST_FAULTS:
                break  # they refuse the file
            match = None if len(record) > _LONGEST_LINE else _RECORD.fullmatch(record)
            if match is None:
                self._odd(number, record)
                continue
            self.number = number
            try:
                self._record(number, match[1].upper(), match[2].strip())
            except (_RecordError, ArcError, TimeError) as why:
                words = f"{record[:60]!r}: {why}"
                if self.block is None:
                    self._fault(number, words)
                else:
                    of_limits = match[1].upper() in ("AL", "AH")
                    (self.block.mistakes if of_limits else self.block.lost).append((number, words))
        self._end()
        if self.terrain:
            more = len(self.terrain) - MOST_MISTAKES
            records: list[Datum] = [*self.terrain[:MOST_MISTAKES]]
            records += [Note("further_zones", count=more)] if more > 0 else []
            self.file.found.own_notes.append(Note("terrain_records_unused", records=tuple(records)))
        if not self.zones and not self.file.found.problems:
            self._fault(1, "the file holds no zone: an OpenAir zone begins with a line such as `AC R`")
        return self.file.finished()

    def _fault(self, number: int, words: str) -> None:
        self.file.fault(f"{self.file.path}: line {number}", words)

    def _odd(self, number: int, record: str) -> None:
        code = record.upper()
        if code in ("AN", "AY", *IGNORED):  # an empty record
            return
        if code == "AC":  # without a class the zone is no-fly, and never a part of the one before
            self._record(number, code, "")
            return
        if code in ("AL", "AH") and self.block is not None:
            self.block.remarks.append((EMPTY_LIMITS, Note("line_of_file", line=number, text=code)))
            return
        words = f"{record[:60]!r} is no record of OpenAir; write a comment with * before it"
        if self.block is not None:
            self.block.lost.append((number, words))
        else:
            self._fault(number, words)

    def _record(self, number: int, code: str, value: str) -> None:
        if code == "AC":
            self._end()
            self.block, self.passed = _Block(number, [_kind(value)] if value else []), False
            self.block.mistakes += [] if value else [(number, "AC has no class")]
        elif code in ("TO", "TC"):  # terrain, which other records draw as they draw zones
            self._end()
            self.passed = True
            self.terrain.append(f"line {number} ({code} {value[:40]})")
        elif self.passed or code in IGNORED:
            pass
        elif code == "V":
            self._variable(value)
        elif self.block is None:
            raise _RecordError("stands before the first AC, with which a zone begins")
        elif code in DRAWING_RECORDS:
            self._draw(self.block, code, value)
        elif code == "AN":
            if self.block.pieces or self.block.circles:
                raise _RecordError("a second name behind the zone's outline: does a line AC before it lack?")
            self.block.name = value
        elif code == "AY":
            self.block.kinds.append(_kind(value))
        elif code in ("AL", "AH"):
            self._limit(self.block, code, value)
        elif code == "AA":
            self.block.times.append(value)
        else:
            raise _RecordError(f"the record {code} is not known")

    def _limit(self, block: _Block, code: str, value: str) -> None:
        if (block.lower if code == "AL" else block.upper) is not None:
            raise _RecordError(f"the zone has two {code}; leave one out")
        if code == "AL":
            block.lower = value
        else:
            block.upper = value

    def _variable(self, value: str) -> None:
        match = _VARIABLE.fullmatch(value)
        if match is None:
            raise _RecordError("a variable is written as V X=39:29.9 N 119:46.1 W or V D=-")
        name, given = match[1].upper(), match[2].strip()
        if name == "X":
            self.centre = None  # an arc around the centre before would be elsewhere
            self.centre = self._places(given, 1)[0]
            if self.block is not None:
                self.block.has_centre = True
        elif name == "D":
            if given[:1] not in ("+", "-"):
                raise _RecordError("the direction is + (clockwise) or -")
            if self.block is not None:
                self.block.clockwise = given[0] == "+"
        elif name not in ("W", "Z"):  # width of airways, which DY refuses, and zoom
            raise _RecordError(f"the variable {name} is not known")

    def _draw(self, block: _Block, code: str, value: str) -> None:
        if code == "DY":
            raise _RecordError("airways are not read; draw the outline with DP")
        if len(block.pieces) > MAX_VERTICES:
            raise _RecordError(f"the zone has more than {MAX_VERTICES} points")
        if code == "DP":
            block.pieces.append(self._places(value, 1)[0])
            return
        if self.centre is None:
            raise _RecordError("has no centre: a line such as V X=39:29.9 N 119:46.1 W must stand before it")
        if not block.has_centre and self.zones:
            if code == "DC":
                raise _RecordError(
                    "has no centre of its own (V X=… in this zone); the centre of the zone before does not count"
                )
            block.remarks.append((Note("zone_centre_carried_over"), self._line(f"{code} {value[:40]}")))
        if code == "DC":
            block.circles.append((self.centre, _numbers(value, 1)[0] * NAUTICAL_MILE_M))
        elif code == "DA":
            radius, start, end = _numbers(value, 3)
            radius_m = radius * NAUTICAL_MILE_M
            block.pieces.append(Arc.by_bearings(self.centre, radius_m, start, end, block.clockwise))
        else:
            first, last = self._places(value, 2)
            block.pieces.append(Arc.by_ends(self.centre, first, last, block.clockwise))

    def _places(self, text: str, count: int) -> list[Corner]:
        """The first places of a text, after which none stands; a remark says what follows them."""
        places, rest = _places(text, count)
        if rest and self.block is not None:
            self.block.remarks.append((Note("zone_text_behind_place_unread"), self._line(rest[:40])))
        return places

    def _line(self, text: str) -> Note:
        """A note with the line that is being read."""
        return Note("line_of_file", line=self.number, text=one_line(text))

    def _end(self) -> None:
        """Add the zone that ends here."""
        block, self.block = self.block, None
        if block is None:
            return
        self.zones += 1
        file = self.file
        where = f"{file.path}: {block.where}"
        periods, unread = _times(block.times)
        remarks = (*dict(reversed(block.remarks)).items(), *([(UNREAD_TIMES, unread)] if unread else []))
        name = block.name or f"{file.path.stem}[{self.zones - 1}]"
        kinds = tuple(dict.fromkeys(block.kinds))
        restricts = any(k not in FREE_CLASSES_AND_TYPES | SILENT_CLASSES for k in kinds) or not any(
            k in FREE_CLASSES_AND_TYPES for k in kinds
        )
        zone = Published(name, kinds, restricts, "", periods, remarks)
        limits = _limits(block, where, file.policy)
        limits.faults += [
            Mistake(f"{file.path}: line {number}", words) for number, words in block.mistakes[:MOST_MISTAKES]
        ]
        for number, words in block.lost[:MOST_MISTAKES]:
            file.fault(f"{file.path}: line {number}", f"zone {name[:60]!r}: {words}", zone)
        if block.lost:  # the zone may reach farther than the part that is understood
            return
        if (count := corners_of(block.pieces)) > MAX_VERTICES:
            words = f"its outline has {len(block.pieces)} points and arcs, drawn with {count} corners, more than"
            file.fault(where, f"zone {name[:60]!r}: {words} {MAX_VERTICES}; simplify it", zone)
            return
        ring = outline(block.pieces)
        shapes = len(block.circles) + bool(ring)
        if not shapes:
            file.fault(where, "the zone has no outline (DP, DA, DB) and no circle (DC)", zone)
        for i, (centre, radius_m) in enumerate(block.circles):
            part = name if shapes == 1 else f"{name}/{i + 1}"
            file.add_circle(zone, part, where, centre, radius_m, limits)
        if ring:
            file.add_ring(zone, name if shapes == 1 else f"{name}/{shapes}", where, ring, limits)


def _limits(block: _Block, where: str, policy: Policy) -> VolumeLimits:
    remarks: list[Remark] = []
    given: list[Given | None] = []
    for key, text in (("AL", block.lower), ("AH", block.upper)):
        plain = text
        if text is not None and (match := re.fullmatch(r"([^()]*\S)\s*\([^()]*\)", text)):
            plain = match[1]
            remarks.append((Note("zone_text_behind_height_unread"), f"{key} {text[:60]}"))
        given.append(None if plain is None else Given(plain, (), ("FT", "AMSL"), key))
    limits = VolumeLimits.read(given[0], given[1], where, UNSTATED_LIMITS, policy=policy)
    limits.remarks += remarks
    return limits


def _kind(value: str) -> str:
    return value.upper()[:60]


def _times(texts: list[str]) -> tuple[tuple[Period, ...], str]:
    """The periods of AA records, and what is not understood. AA NONE waits for a NOTAM, so that it counts as always.

    A record with more than one period, such as one that says how it repeats, is not understood.
    """
    periods = []
    for text in texts:
        plain = text.strip()
        if plain.upper() == "NONE":
            return (), "AA NONE: they are activated at times that the file does not have"
        ends = [end.strip() for end in plain.split("/")]
        if len(ends) != 2:
            return (), f"AA {plain[:60]}"
        try:
            start = None if ends[0].upper() == "NONE" else read_instant(ends[0])
            end = None if ends[1].upper() == "NONE" else read_end(ends[1])
            periods.append(Period(start, end))
        except TimeError as why:
            return (), str(why)
    return tuple(periods), ""


def _places(text: str, count: int) -> tuple[list[Corner], str]:
    """The first places of a text, and what follows them, which is no place."""
    places: list[Corner] = []
    at = 0
    text = _SPACED.sub(":", _COMPACT.sub(r"\1:\2:\3", text))
    if text[:1].upper() in ("N", "S"):
        text = _LETTERS_FIRST.sub(r"\2 \1 \4 \3", text)
    for match in _matches(text):
        if len(places) == count:
            raise _RecordError(f"it has more than {counted(count, 'place')}; write a line for each")
        if text[at : match.start()].strip(" \t,"):
            break
        places.append((_degrees(match.group(1, 2, 3), match[4]), _degrees(match.group(5, 6, 7), match[8])))
        at = match.end()
    if len(places) == count:
        return places, text[at:].strip(" \t,")
    needed = "a place such as 39:29.9 N 119:46.1 W" if count == 1 else "two places with a comma between them"
    raise _RecordError(f"it needs {needed}")


def _matches(text: str) -> Iterator[re.Match[str]]:
    return _OPENAIR_PLACE.finditer(text)


def _degrees(parts: tuple[str | None, ...], side: str) -> float:
    whole, minutes, seconds = (None if p is None else float(p) for p in parts)
    assert whole is not None
    broken = (minutes is not None and whole != math.floor(whole)) or (
        seconds is not None and minutes is not None and minutes != math.floor(minutes)
    )
    if broken or max(minutes or 0.0, seconds or 0.0) > 60.0:  # 60 is what some programs write for a whole one
        raise _RecordError("degrees and minutes are whole numbers where others follow, minutes and seconds at most 60")
    value = whole + (minutes or 0.0) / 60.0 + (seconds or 0.0) / 3600.0
    if value > (90.0 if side.upper() in "NS" else MOST_LON_DEG):
        raise _RecordError(f"{value:g} {side.upper()} is no place on Earth")
    return -value if side.upper() in "SW" else value


def _numbers(text: str, count: int) -> list[float]:
    found = text.split(",")
    try:
        numbers = [float(t) for t in found]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(math.isfinite(n) for n in numbers):
        needed = "a radius in nautical miles" if count == 1 else "a radius in nautical miles and two bearings"
        raise _RecordError(f"it needs {needed}")
    return numbers
