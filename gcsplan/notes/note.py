"""`Note`: one thing to say of a mission, as a code, the item that it is about, and data; and how its sentence is made.

`Finding`: one limit that a mission breaks, with a note on it.

A sentence of the catalogue names the data by fields of ``str.format``, each with the kind of number that it is:

    {away_m:distance.0}         a length in the units of the reader, without decimals; ``path leg far distance height
                                amsl speed climb_rate`` are the kinds of `gcsplan.units`
    {low_m:height.1 down}       rounded down; also ``up``, ``trimmed`` (no trailing zeros) and ``bare`` (no unit)
    {max_agl_m:height}          a value that was given, with the digits it has
    {length_m:reach}            in kilometres if it is long
    {climb_deg:angle.1 up}      an angle in degrees
    {left_s:seconds} {used_j:joules}
    {count} {count:item|items}  the first word for 1 and True, else the second; of a list its length decides
    {share:.1f} {zones}         anything else is formatted as Python does; a list is joined by commas
    {conflicts:lines}           a list, each of it in a line of its own below the sentence
    {findings:rows}             a list, each of it in a line of its own
    {unit:height}               the symbol of a kind's unit alone
    {key:max_agl_m}             what the reader types for a key of the mission file: the key, or an option
    {limit:key}                 the same for a datum that is the name of a key

Where it belongs stands around the sentence by itself, unless the sentence names it: a note on an item begins with
``item 5: `` (with ``way`` among its data, what is flown for the item, with ``item 5 (cruise): ``), one whose data have
a ``file``, a ``place`` in it or a ``vehicle`` with that, and one with ``zones`` ends with them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from string import Formatter
from types import MappingProxyType
from typing import Any, TypeAlias, get_args

from gcsplan.figures import floored, raised
from gcsplan.notes.check_texts import CHECK_TEXTS
from gcsplan.notes.input_texts import INPUT_TEXTS
from gcsplan.notes.link_texts import LINK_TEXTS
from gcsplan.notes.plan_texts import PLAN_TEXTS
from gcsplan.notes.way_home_texts import WAY_HOME_TEXTS
from gcsplan.units import Joules, Kind, Quantity, Reach, Rounding, Seconds, Symbol, Units

TEXTS: Mapping[str, str] = MappingProxyType(CHECK_TEXTS | INPUT_TEXTS | LINK_TEXTS | PLAN_TEXTS | WAY_HOME_TEXTS)
"""The catalogue: all sentences that gcsplan says of missions, by code."""

Datum: TypeAlias = "float | str | bool | Note | tuple[Datum, ...] | None"

NUMBER_KINDS: tuple[str, ...] = get_args(Kind)

BEFORE = ("file", "place", "vehicle")
"""Data that stand before the sentence, in this order."""


@dataclass(frozen=True, slots=True)
class Wording:
    """The wording for a reader: the units, and the option for each key of the mission file that he typed as one.

    ``units``: None writes SI as files have it, with seconds and joules.
    """

    units: Units | None = None
    options: Mapping[str, str] = field(default_factory=dict)


IN_FILES = Wording()
"""SI, and the keys of the mission file."""


class Note:
    """One thing to say: ``code`` of the catalogue, ``item`` (wire number) or None, and the data of its sentence.

    Notes are values: equal if all of that is equal, and hashable. Raises KeyError for a code that the catalogue lacks.
    """

    __slots__ = ("code", "data", "item")

    code: str
    item: int | None
    data: Mapping[str, Datum]

    def __init__(self, code: str, item: int | None = None, /, **data: Datum) -> None:
        if code not in TEXTS:
            raise KeyError(f"the catalogue of notes has no {code!r}")
        self.code, self.item, self.data = code, item, data

    def text(self, wording: Wording = IN_FILES, *, placed: bool = True) -> str:
        """The sentence. ``placed``: with the item before it; without where the item's number and way stand elsewhere.

        A ``way`` that is a note says more than the kind of the stretch, so it stands before the sentence anyway.
        """
        template = TEXTS[self.code]
        named = {name for _, name, _ in parts_of(template)}
        before = "".join(f"{self.data[place]}: " for place in BEFORE if place in self.data and place not in named)
        way = self.data.get("way")
        shown = "" if way is None else f"({_shown(way, '', wording)})"
        if placed and self.item is not None and "item" not in named:
            before += f"item {self.item} {shown}: " if shown else f"item {self.item}: "
        elif not placed and isinstance(way, Note):
            before += f"{shown}: "
        zones = "" if "zones" in named else _shown(self.data.get("zones"), "", wording)
        behind = f": {zones}" if zones else ""
        return before + sentence(template, {"item": self.item, **self.data}, wording) + behind

    def of(self, **place: Datum) -> Note:
        """The same note of a ``file``, ``place``, ``vehicle`` or ``zones``, which whoever made it did not know."""
        return Note(self.code, self.item, **{**place, **self.data})

    def of_no_item(self) -> Note:
        """The same note without its item and way, for what stands within another note."""
        return Note(self.code, **{name: value for name, value in self.data.items() if name != "way"})

    def without(self, name: str) -> Note:
        """The same note without a datum that its sentence does not need, such as the ``vehicle`` before it."""
        return Note(self.code, self.item, **{key: value for key, value in self.data.items() if key != name})

    def in_units(self, units: Units) -> str:
        """The sentence with its quantities in ``units``."""
        return self.text(Wording(units))

    def as_dict(self) -> dict[str, Any]:
        """The note for programs: ``code``, ``item`` and ``data`` in SI."""
        return {"code": self.code, "item": self.item, "data": {name: _plain(v) for name, v in self.data.items()}}

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        return f"<{self.code}: {self.text()}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Note) and self._all == other._all

    def __hash__(self) -> int:
        return hash(self._all)

    @property
    def _all(self) -> tuple[object, ...]:
        return self.code, self.item, frozenset(self.data.items())

    def __reduce__(self) -> tuple[Any, ...]:
        return _revived, (self.code, self.item, dict(self.data))


def note_of(given: Any) -> Note | None:
    """The note that `Note.as_dict` gave, also of JSON; None for another value, or a code of another version."""
    try:
        return Note(given["code"], given["item"], **{name: _datum(v) for name, v in given["data"].items()})
    except (KeyError, TypeError, AttributeError):
        return None


def _datum(value: Any) -> Datum:
    if isinstance(value, list):
        return tuple(map(_datum, value))
    return note_of(value) if isinstance(value, dict) else value


def in_json(key: str, notes: Iterable[Note], wording: Wording = IN_FILES) -> dict[str, Any]:
    """A list of notes for programs: its sentences under ``key``, and under ``key_data`` what they are made of."""
    every = list(notes)
    return {key: [note.text(wording) for note in every], f"{key}_data": [note.as_dict() for note in every]}


def _revived(code: str, item: int | None, data: dict[str, Datum]) -> Note:
    return Note(code, item, **data)


@cache
def parts_of(template: str) -> tuple[tuple[str, str | None, str], ...]:
    """The literals of a template, each with the field behind it and the field's kind."""
    return tuple((literal, name, spec or "") for literal, name, spec, _ in Formatter().parse(template))


def fields_of(template: str) -> set[str]:
    """The names of the data that a sentence needs."""
    return {name for _, name, _ in parts_of(template) if name} - {"item", "key", "unit"}


def sentence(template: str, data: Mapping[str, Datum], wording: Wording = IN_FILES) -> str:
    """A template with its fields filled; see this module."""
    parts = []
    for literal, name, form in parts_of(template):
        parts.append(literal)
        if name == "key":
            parts.append(wording.options.get(form, form))
        elif name == "unit":
            parts.append(Symbol(form).text(wording.units))  # type: ignore[arg-type]
        elif name is not None:
            parts.append(_shown(data[name], form, wording))
    return "".join(parts)


def _shown(value: Any, spec: str, wording: Wording) -> str:  # noqa: PLR0911 - a table of formats
    """A datum as its field in the sentence says."""
    if "|" in spec:
        one, several = spec.split("|")
        return one if (len(value) if isinstance(value, tuple) else value) == 1 else several
    if spec == "lines":
        return "".join(f"\n  {_shown(each, '', wording)}" for each in value)
    if spec == "rows":
        return "\n".join(_shown(each, "", wording) for each in value)
    if isinstance(value, tuple):
        return ", ".join(_shown(each, spec, wording) for each in value)
    if isinstance(value, Note):
        return value.text(wording)
    if value is None:
        return ""
    kind, *how = spec.split() or [""]
    name, _, decimals = kind.partition(".")
    if name in NUMBER_KINDS:
        exactly = int(decimals) if decimals else None
        return Quantity(value, name, exactly, _rounding(how), "trimmed" in how, "bare" in how).text(wording.units)  # type: ignore[arg-type]
    if name == "angle":
        rounding, places = _rounding(how), int(decimals or 0)
        degrees = floored(value, places) if rounding == "down" else raised(value, places) if rounding == "up" else value
        return f"{degrees:.{places}f} °"
    if name == "key":
        return wording.options.get(value, value)
    if name == "reach":
        return Reach(value).text(wording.units)
    if name == "seconds":
        return Seconds(value, int(decimals or 0)).text(wording.units)
    if name == "joules":
        return Joules(value).text(wording.units)
    return format(value, spec)


def _rounding(how: Sequence[str]) -> Rounding:
    return "down" if "down" in how else "up" if "up" in how else "near"


def _plain(value: Datum) -> Any:
    if isinstance(value, Note):
        return value.as_dict()
    return [_plain(each) for each in value] if isinstance(value, tuple) else value


@dataclass(frozen=True, slots=True)
class Finding:
    """One limit broken by wire item ``seq``: the note on it, the place, and by how much.

    ``zone`` is the zone's name or empty.
    """

    seq: int
    kind: str
    note: Note
    lat_deg: float
    lon_deg: float
    amsl_m: float
    value: float
    limit: float
    by: float
    unit: str
    zone: str = ""

    @property
    def message(self) -> str:
        """The note on it as a sentence, in SI."""
        return str(self.note)

    def as_dict(self, wording: Wording = IN_FILES) -> dict[str, Any]:
        """The finding for programs: its fields with the message, and the note's code and data."""
        fields = {name: getattr(self, name) for name in self.__slots__ if name != "note"}
        note = self.note.as_dict()
        begins = {"seq": fields.pop("seq"), "kind": fields.pop("kind"), "message": self.note.text(wording)}
        return begins | fields | {"code": note["code"], "data": note["data"]}
