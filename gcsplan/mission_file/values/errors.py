"""The mistakes in a section of a mission file: pydantic's errors in gcsplan's words, each with its place."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Literal, TypeVar, get_args, get_origin

from pydantic import ValidationError

from gcsplan.errors import Mistake
from gcsplan.mission_file.values.keys import Keys
from gcsplan.mission_file.values.places import PLACE_EXAMPLES
from gcsplan.mission_file.values.point_keys import POINT_FORMS
from gcsplan.mission_file.values.schema import POINT_FORM_NAMES, PlannerKeys, TerrainKeys, ZoneKeys, nearest, shown
from gcsplan.mission_file.values.units import UNIT_SYMBOLS, nearest_keys, other_names, unit_end
from gcsplan.mission_file.values.yaml import lines_of, missing_space

Section = TypeVar("Section", bound=Keys)

MOST_SWAPPED = 6
MOST_OF_A_SECTION = 100
"""Most mistakes of one section that are listed; a mission lists ten times as many."""

SHORT = {TerrainKeys: "dem", PlannerKeys: "name", ZoneKeys: "file"}
"""The key for which a text may be meant that stands in place of a whole section."""

MOST_OF_NUMBER = 40
_RANGE = re.compile(r"\s*(\d+(?:\.\d+)?)\s*(?:-|–|\.\.|to)\s*(\d+(?:\.\d+)?)\s*")
_NUMBER_AND_UNIT = re.compile(r"\s*[±+]?(-?\d+(?:[.,]\d+)?)\s*([a-zA-Z/²°%]*)\s*")


def read_section(kind: type[Section], value: Any, where: str, problems: list[Mistake]) -> Section | None:
    """``value`` as a section; None if it is not one, with every mistake added to ``problems``.

    If the only mistakes are unknown keys, the section is returned without them.
    ``where`` is the place so far (``FILE: vehicles[1]``).
    """
    if not isinstance(value, dict):
        keys = ", ".join(list(kind.model_fields)[:6])
        tight = ""
        if isinstance(value, str) and (kind not in SHORT or value.partition(":")[0].strip(" -") in kind.model_fields):
            tight = missing_space(value)
        elif isinstance(value, str):
            tight = f"did you mean `{{{SHORT[kind]}: {value[:60]}}}`?"
        hint = f"; {tight}" if tight else ""
        problems.append(Mistake(where, f"must be a mapping of keys ({keys}, …), given {shown(value)}{hint}"))
        return None
    try:
        return kind.model_validate(value)
    except ValidationError as why:
        errors = why.errors(include_url=False)
        problems += few(
            [_problem(kind, e, where) for e in errors[:MOST_OF_A_SECTION]], where, MOST_OF_A_SECTION, len(errors)
        )
        unknown = {e["loc"][0] for e in errors if e["type"] == "extra_forbidden" and len(e["loc"]) == 1}
        if len(unknown) < len(errors):
            return None
    # Only unknown keys are wrong: the other keys are read too, so that their mistakes are reported together.
    return kind.model_validate({k: v for k, v in value.items() if k not in unknown})


def with_lines(problems: Sequence[Mistake], text: str, where: str) -> list[Mistake]:
    """The problems with their lines in a mission's ``text``, whose keys begin with ``where``; others unchanged."""
    lines = lines_of(text, [p.where.removeprefix(where) if p.where.startswith(where) else "" for p in problems])
    ends = ["" if n is None else f" (line {n})" for n in lines]
    return [
        replace(p, message=p.message + end, line=end, in_line=n)
        for p, end, n in zip(problems, ends, lines, strict=True)
    ]


def few(problems: Sequence[Mistake], where: str, most: int, count: int | None = None) -> list[Mistake]:
    """The first ``most`` problems, and how many of ``count`` (None: of these) are left out."""
    more = (len(problems) if count is None else count) - most
    return [
        *problems[:most],
        *([Mistake(where, f"has {more} more mistakes, which are not listed")] if more > 0 else []),
    ]


def listed_once(problems: Iterable[Mistake]) -> list[Mistake]:
    """The problems, without the ones that end with another one's cure.

    A key is not missing if an unknown one beside it stands for it, and one message is enough for places that are all
    swapped.
    """
    found = list(problems)
    unknown = [p for p in found if p.code == "unknown_key"]
    missing = [p for p in found if p.code in ("missing", "missing_limit")]
    meant: dict[int, Mistake] = {}  # the unknown key that stands for a missing one, by the id of that one's problem
    for gap in missing:
        section, key = _section_and_key(gap.where)
        beside = [u for u in unknown if _section_and_key(u.where)[0] == section]
        named = [u for u in beside if key in u.meant]
        if gap.code == "missing_limit":
            named += [u for u in unknown if u.meant == ("limits",)]
        alone = [g for g in missing if _section_and_key(g.where)[0] == section] == [gap]
        if not named and len(beside) == 1 and alone and not beside[0].meant:
            named = beside
        if named:
            meant[id(gap)] = named[0]
    instead = {}
    for gap in missing:
        u = meant.get(id(gap))
        if u is not None and not u.meant:
            key = _section_and_key(gap.where)[1]
            instead[id(u)] = _unknown(u.where, (key,), f"; did you mean {key}, which is missing?")
    listed = [instead.get(id(p), p) for p in found if id(p) not in meant]
    swapped = [p for p in listed if p.code == "swapped"]
    if len(swapped) < 2:
        return listed
    others = ", ".join(p.key for p in swapped[1:MOST_SWAPPED])
    more = f" and {len(swapped) - MOST_SWAPPED} more" if len(swapped) > MOST_SWAPPED else ""
    first = replace(swapped[0], message=f"{swapped[0].message} (the same at {others}{more})")
    return [first if p is swapped[0] else p for p in listed if p is swapped[0] or p not in swapped]


def _section_and_key(where: str) -> tuple[str, str]:
    """The place of the section, and the key in it."""
    file, _, path = where.rpartition(": ")
    section, _, key = path.rpartition(".")
    return f"{file}: {section}", key


def unknown_keys(given: Iterable[str], known: Iterable[str], where: str) -> list[Mistake]:
    """One problem for each unknown key, with the nearest known one."""
    names = list(known)
    prefix = where if where.endswith(": ") else where + "."
    wrong = [key for key in given if key not in names]
    listed = [_unknown_of(f"{prefix}{key[:80]}", key, names) for key in wrong[:MOST_OF_A_SECTION]]
    return few(listed, where.removesuffix(": "), MOST_OF_A_SECTION, len(wrong))


def key_path(where: str, loc: Iterable[int | str]) -> str:
    """Join place and keys: ``FILE: vehicles[1]`` and ("speed_m_s", 0) give ``FILE: vehicles[1].speed_m_s[0]``."""
    path = where
    for part in loc:
        if isinstance(part, int):
            path += f"[{part}]"
        elif part not in POINT_FORM_NAMES:
            path += part[:80] if path.endswith(": ") else f".{part[:80]}"
    return path


def _unknown_of(where: str, key: str, known: list[str]) -> Mistake:
    """The problem of an unknown ``key``, with the nearest of the known ones."""
    meant, words = nearest_keys(key, known)
    return _unknown(where, meant, words or f"; known are {', '.join(known)}")


def _unknown(where: str, meant: tuple[str, ...], words: str) -> Mistake:
    return Mistake(where, f"unknown key{words}", "unknown_key", meant)


def _problem(kind: type[Keys], error: Any, where: str) -> Mistake:  # noqa: PLR0911 - a table of messages
    loc, given = error["loc"], shown(error["input"])
    path = key_path(where, loc)
    context = error.get("ctx", {})
    match error["type"]:
        case "missing":
            field = _model_at(kind, loc[:-1]).model_fields.get(str(loc[-1]))
            choices = [] if field is None or get_origin(field.annotation) is not Literal else get_args(field.annotation)
            words = f"; it is one of {', '.join(choices)}" if choices else ""
            return Mistake(path, f"is missing{words}", "missing")
        case "extra_forbidden":
            return _unknown_of(path, str(loc[-1]), list(_model_at(kind, loc[:-1]).model_fields))
        case "value_error":
            return Mistake(path, str(context["error"]))
        case "literal_error":
            choices = re.findall(r"'([^']*)'", context["expected"])
            near = nearest(error["input"], choices, most=2) if isinstance(error["input"], str) else ""
            return Mistake(path, f"must be one of {', '.join(choices)}, given {given}{near}")
        case "string_pattern_mismatch":
            return Mistake(path, f"must be made of letters, digits, _ and -, given {given}")
        case "string_type":
            return Mistake(path, f"must be text (in quotes, if it looks like a number), given {given}")
        case "float_type":
            return Mistake(path, f"must be a number, given {given}{_as_number(loc, error['input'])}")
        case "int_type" | "int_from_float" | "int_parsing_size":
            return Mistake(path, f"must be a whole number, given {given}{_as_number(loc, error['input'])}")
        case "finite_number":
            return Mistake(path, f"must be a finite number, given {given}")
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            word = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
            bound = next(k for k in ("gt", "ge", "lt", "le") if k in context)
            part = bound == "lt" and context[bound] == 1.0 and 1.0 <= error["input"] < 100.0
            hint = f"; {error['input']:g} % is {error['input'] / 100.0:g}" if part else ""
            return Mistake(path, f"must be {word[bound]} {context[bound]:g}, given {given}{hint}")
        case "too_short" | "too_long":
            least, most = context.get("min_length"), context.get("max_length")
            bound = f"at least {least}" if least is not None else f"at most {most}"
            given = context.get("actual_length", given)
            whole = _form_of(loc) and given == 4 and all(type(v) is int for v in error["input"])
            hint = f"; decimals begin with a point: [{PLACE_EXAMPLES[0]}]" if whole else ""
            return Mistake(path, f"must have {bound} values{_form_of(loc)}, given {given}{hint}")
        case "list_type" if _form_of(loc):
            words = f"must be [lat, lon], {{lat, lon}}, or text such as {PLACE_EXAMPLES[0]}"
            return Mistake(path, f"{words}, or {{east_m, north_m}} in a mission with a frame, given {given}")
        case "list_type":
            return Mistake(path, f"must be a list, given {given}")
        case "model_type" | "dict_type" | "model_attributes_type":
            return Mistake(path, f"must be a mapping of keys, given {given}")
    return Mistake(path, f"{error['msg'][:1].lower()}{error['msg'][1:]}, given {given}")


def _as_number(loc: tuple[int | str, ...], given: Any) -> str:
    """``; write …`` for a text that is a number in quotes, with a decimal comma or with its unit; or an empty text."""
    if not isinstance(given, str) or len(given) > MOST_OF_NUMBER:
        return ""
    if "one" in loc and (several := _RANGE.fullmatch(given)):
        return f"; write [{several[1]}, {several[2]}]"
    match = _NUMBER_AND_UNIT.fullmatch(given)
    key = next((part for part in reversed(loc) if isinstance(part, str) and part not in POINT_FORM_NAMES), "")
    if match is None or not key:
        return ""
    number, unit, end = match[1].replace(",", "."), match[2], unit_end(key)
    if not unit:  # the key is not named, since it may be written in another unit
        return f"; write the number alone, without quotes: {number}"
    if unit.lower() == UNIT_SYMBOLS.get(end, "").lower():
        return f"; write the number alone: `{key}: {number}`"
    other = key.removesuffix(end) + "_" + unit.lower().replace("km/h", "kmh")
    return f"; write `{other}: {number}`" if other in other_names([key]) else ""


def _form_of(loc: tuple[int | str, ...]) -> str:
    return " [lat, lon]" if "[lat, lon]" in loc else ""


def _model_at(kind: type[Keys], loc: Iterable[int | str]) -> type[Keys]:
    """The section that holds the key at ``loc``, whose names are the known ones."""
    for part in loc:
        if part in POINT_FORMS:
            kind = POINT_FORMS[part]
        elif isinstance(part, str) and part in kind.model_fields:
            kind = _sections_in(kind.model_fields[part].annotation) or kind
    return kind


def _sections_in(annotation: Any) -> type[Keys] | None:
    if isinstance(annotation, type) and issubclass(annotation, Keys):
        return annotation
    places = POINT_FORMS.values()
    return next((s for a in get_args(annotation) if (s := _sections_in(a)) is not None and s not in places), None)
