"""Other units for the keys of a mission file: ``min_agl_ft: 164`` for ``min_agl_m``.

A key's name ends in its unit. Every key whose unit is in `OTHERS` may be written with one of the other endings there;
`in_own_units` converts it before anything else reads the file. The keys come from the models in `schema`, so that a new
key has its other units at once.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple, TypeGuard, get_args

from gcsplan.errors import Mistake
from gcsplan.mission_file.values.keys import Keys, with_error
from gcsplan.mission_file.values.schema import MOST_VOLTS, MissionKeys, shown
from gcsplan.notes.note import Note
from gcsplan.units import FOOT, KM_PER_HOUR, KNOT, MILLIAMPERE_HOUR, MINUTE, NAUTICAL_MILE, WATT_HOUR, Unit
from gcsplan.vehicle import Energy

UNIT_SYMBOLS = {
    "_j_per_m": "J/m", "_m_s3": "m/s³", "_m_s2": "m/s²", "_m_s": "m/s", "_percent": "%", "_deg": "°", "_mb": "MB",
    "_m": "m", "_s": "s", "_j": "J", "_w": "W", "_v": "V",
}  # fmt: skip
"""Symbol of each unit, by the end of a key; longer ends first, since ``climb_m_s`` also ends in ``_s``."""

VOLTS = "_v"
"""End of the key beside a charge in mAh: the battery's nominal voltage."""


OTHERS: Mapping[str, Mapping[str, Unit]] = {
    "_m": {"_ft": FOOT, "_nm": NAUTICAL_MILE},
    "_m_s": {"_kt": KNOT, "_kmh": KM_PER_HOUR},
    "_s": {"_min": MINUTE},
    "_j": {"_wh": WATT_HOUR, "_mah": MILLIAMPERE_HOUR},
}
"""The units that are understood, by the end of the key's own name and by the end that replaces it."""

CHARGE = "_mah"

MOST_CONVERSIONS = 20
"""Most notes on conversions; more are counted."""


class Written(NamedTuple):
    """A key that may be written for another: the canonical ``key``, and the end that replaces ``own``."""

    key: str
    own: str
    end: str

    @property
    def other(self) -> Unit:
        """The unit that it is written in."""
        return OTHERS[self.own][self.end]


@dataclass(frozen=True)
class Converted:
    """A mission in its own units: the mapping, what was converted, and the mistakes.

    ``given`` maps the place of each converted key to its place in the file and how it was converted.
    """

    raw: dict[str, Any]
    notes: tuple[Note, ...]
    problems: tuple[Mistake, ...]
    given: Mapping[str, tuple[str, Note]]

    def as_written(self, problem: Mistake) -> Mistake:
        """The problem at the key that is in the file, if it is about a converted one."""
        for place, (written, how) in self.given.items():
            rest = problem.where.removeprefix(place)
            if rest != problem.where and rest[:1] in ("", "[", "."):
                return replace(problem, where=written + rest, message=f"{problem.message} ({how})")
        return problem

    def with_battery_key(self, energy: Energy, place: str) -> Energy:
        """``energy`` with the key that its battery stands under at ``place`` in the file, and the unit of that key."""
        if place not in self.given:
            return energy
        key = self.given[place][0].rpartition(".")[2]
        end = next(end for end in OTHERS["_j"] if key.endswith(end))
        unit_j = OTHERS["_j"][end].size * (energy.battery_v or 1.0 if end == CHARGE else 1.0)
        return replace(energy, battery_key=key, battery_unit_j=unit_j)


def unit_end(key: str) -> str:
    """The end of a key that is its unit, such as ``_m``, or an empty text."""
    return next((end for end in UNIT_SYMBOLS if key.endswith(end)), "")


def other_names(keys: Iterable[str]) -> dict[str, Written]:
    """Every name in another unit that may stand for one of ``keys``."""
    return {
        key.removesuffix(own) + end: Written(key, own, end)
        for key in keys
        if (own := unit_end(key)) in OTHERS
        for end in OTHERS[own]
    }


def nearest_keys(key: str, known: Iterable[str]) -> tuple[tuple[str, ...], str]:
    """The nearest key under all the names that may be meant, and ``; did you mean …?``; both empty if none is near.

    For a key that ends in another unit the suggestion says the units that it may have, since the value differs too.
    """
    own = list(known)
    others = other_names(own)
    close = difflib.get_close_matches(key[:80], [*own, *others], n=1, cutoff=0.6)
    if not close:
        return (), ""
    found = close[0]
    canonical = others[found].key if found in others else found
    unit = unit_end(canonical)
    end = others[found].end if found in others else unit
    if key == canonical.removesuffix(unit):  # the value may be in any of the units
        end = unit
        found = canonical
    if not unit or key.endswith(end) or key.rsplit("_", 1)[-1] in canonical.removesuffix(unit).split("_"):
        return (found,), f"; did you mean {found}?"
    more = [name for name, written in others.items() if written.key == canonical]
    names = [f"{canonical} (in {UNIT_SYMBOLS[unit]})", *more]
    words = " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
    return (canonical, *more), f"; did you mean {words}?"


def in_own_units(raw: Mapping[str, Any], where: str) -> Converted:
    """The mission ``raw`` with every key under its own name; ``where`` precedes the places (``FILE: ``)."""
    walk = _Walk()
    plain = walk.section(MissionKeys, raw, where)
    places: dict[Note, list[str]] = {}
    for written, how in walk.given.values():
        places.setdefault(how, []).append(written.removeprefix(where))
    notes = [
        (how if len(at) == 1 else Note("and_as_many_more", note=how, count=len(at) - 1)).of(place=at[0])
        for how, at in places.items()
    ]
    if len(notes) > MOST_CONVERSIONS:
        notes[MOST_CONVERSIONS:] = [Note("more_values_converted", count=len(notes) - MOST_CONVERSIONS)]
    return Converted(plain, tuple(notes), tuple(walk.problems), walk.given)


class _Walk:
    """One walk over a file, section by section, with what it found."""

    def __init__(self) -> None:
        self.problems: list[Mistake] = []
        self.given: dict[str, tuple[str, Note]] = {}

    def section(self, kind: type[Keys], raw: Mapping[str, Any], where: str) -> dict[str, Any]:
        """A section in its own units; ``where`` precedes its keys."""
        others, inner = _keys_of(kind)
        charges = {_volts_of(written): key for key, written in others.items() if written.end == CHARGE}
        plain: dict[str, Any] = {}
        for key, value in raw.items():
            if key in others:
                self._convert(others[key], key, raw, plain, where)
            elif key in charges and charges[key] not in raw and not self._is_charged(charges[key], raw, others):
                names = ", ".join(_names_of(others[charges[key]]))
                self.problems.append(
                    Mistake(where + key, f"counts with the battery's capacity only: give one of {names}")
                )
            elif key not in charges or charges[key] not in raw or _is_voltage(value):
                plain[key] = self._inside(inner[key], value, where + key) if key in inner else value
        return plain

    @staticmethod
    def _is_charged(charge: str, raw: Mapping[str, Any], others: Mapping[str, Written]) -> bool:
        """Whether the capacity that goes with a voltage is there, in any unit."""
        return any(name in raw for name in _names_of(others[charge]))

    def _inside(self, kind: type[Keys], value: Any, place: str) -> Any:
        """A section, or a list with sections in it; anything else is left for the reader to refuse."""
        if isinstance(value, Mapping):
            return self.section(kind, value, f"{place}.")
        if isinstance(value, list):
            return [
                self.section(kind, v, f"{place}[{i}].") if isinstance(v, Mapping) else v for i, v in enumerate(value)
            ]
        return value

    def _convert(
        self, written: Written, key: str, raw: Mapping[str, Any], plain: dict[str, Any], where: str
    ) -> None:  # fmt: skip
        """Put the value of ``key`` into ``plain`` under its own name."""
        place, value = where + key, raw[key]
        twice = [name for name in raw if name == written.key or (name != key and name in _siblings(written))]
        if twice:
            self.problems.append(Mistake(place, f"stands as {' and '.join(twice)} too; keep one"))
        size, volts = written.other.size, 0.0
        if written.end == CHARGE:
            beside = _volts_of(written)
            volt = raw.get(beside)
            if not _is_voltage(volt):
                given = "" if volt is None else f", given {shown(volt)}"
                words = f"needs {beside}, the nominal voltage: a number above 0 and at most {MOST_VOLTS:g}{given}"
                self.problems.append(Mistake(place, words))
                return
            volts = float(volt)
            size *= volts
        plain[written.key] = own = _times(value, size)
        how = Note("key_read_as_another", own_key=written.key)
        if own is not value:
            how = Note(
                "charge_converted" if volts else "value_converted", given=_figures(value), symbol=written.other.symbol,
                volts=volts, own_key=written.key, value=_figures(own),
            )  # fmt: skip
        self.given[where + written.key] = (place, how)


@cache
def _keys_of(kind: type[Keys]) -> tuple[dict[str, Written], dict[str, type[Keys]]]:
    """The other names of a section's keys, and the keys that hold sections."""
    inner = {key: found for key, field in kind.model_fields.items() if (found := _section_in(field.annotation))}
    return other_names(kind.model_fields), inner


def _section_in(annotation: Any) -> type[Keys] | None:
    if isinstance(annotation, type) and issubclass(annotation, Keys):
        return annotation
    return next((found for part in get_args(annotation) if (found := _section_in(part)) is not None), None)


def _siblings(written: Written) -> set[str]:
    stem = written.key.removesuffix(written.own)
    return {stem + end for end in OTHERS[written.own]}


def _names_of(written: Written) -> list[str]:
    """A key's own name and its names in other units."""
    return [written.key, *(name for name, w in other_names([written.key]).items() if w.key == written.key)]


def _is_voltage(value: Any) -> TypeGuard[float]:
    return _is_number(value) and 0.0 < value <= MOST_VOLTS


def _volts_of(written: Written) -> str:
    """The key of the voltage that a charge is converted with."""
    return written.key.removesuffix(written.own) + VOLTS


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def _times(value: Any, size: float) -> Any:
    """A number, each number of a list, or a number with its error, times ``size``; the reader refuses anything else."""
    if _is_number(value):
        return float(value) * size
    if (parts := with_error(value)) is not None:
        return " ± ".join(f"{part * size:.9f}" for part in parts)
    if isinstance(value, list) and value and all(map(_is_number, value)):
        return [float(v) * size for v in value]
    return value


def _figures(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_figures, value))}]"
    if isinstance(value, str):
        return " ± ".join(map(_figures, with_error(value) or ())) or value
    return f"{value:.10g}" if math.isfinite(value) else str(value)
