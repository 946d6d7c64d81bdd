"""The mistakes in a section of a mission file: pydantic's errors in gcsplan's words, each with its place."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, TypeVar, get_args

from pydantic import ValidationError

from gcsplan.errors import Problem
from gcsplan.mission_file.keys import Keys
from gcsplan.mission_file.places import EXAMPLES
from gcsplan.mission_file.point_keys import POINT_FORMS
from gcsplan.mission_file.schema import FORMS, nearest, shown
from gcsplan.mission_file.units import nearest_key
from gcsplan.mission_file.yaml_slips import missing_space

Section = TypeVar("Section", bound=Keys)


def read_section(kind: type[Section], value: Any, where: str, problems: list[Problem]) -> Section | None:
    """``value`` as a section; None if it is not one, with every mistake added to ``problems``.

    If the only mistakes are unknown keys, the section is returned without them.
    ``where`` is the place so far (``FILE: vehicles[1]``).
    """
    if not isinstance(value, dict):
        keys = ", ".join(list(kind.model_fields)[:6])
        tight = missing_space(value) if isinstance(value, str) else ""
        hint = f"; {tight}" if tight else ""
        problems.append(Problem(where, f"must be a mapping of keys ({keys}, …), given {shown(value)}{hint}"))
        return None
    try:
        return kind.model_validate(value)
    except ValidationError as why:
        errors = why.errors(include_url=False)
        problems += [_problem(kind, e, where) for e in errors]
        unknown = {e["loc"][0] for e in errors if e["type"] == "extra_forbidden" and len(e["loc"]) == 1}
        if len(unknown) < len(errors):
            return None
    # Only unknown keys are wrong: the other keys are read too, so that their mistakes are reported together.
    return kind.model_validate({k: v for k, v in value.items() if k not in unknown})


def unknown_keys(given: Iterable[str], known: Iterable[str], where: str) -> list[Problem]:
    """One problem for each unknown key, with the nearest known one."""
    names = list(known)
    prefix = where if where.endswith(": ") else where + "."
    return [Problem(f"{prefix}{key[:80]}", _unknown(key, names)) for key in given if key not in names]


def key_path(where: str, loc: Iterable[int | str]) -> str:
    """Join place and keys: ``FILE: vehicles[1]`` and ("speed_m_s", 0) give ``FILE: vehicles[1].speed_m_s[0]``."""
    path = where
    for part in loc:
        if isinstance(part, int):
            path += f"[{part}]"
        elif part not in FORMS:
            path += part[:80] if path.endswith(": ") else f".{part[:80]}"
    return path


def _unknown(key: str, known: list[str]) -> str:
    near = nearest_key(key, known)
    return "unknown key" + (near or f"; known are {', '.join(known)}")


def _problem(kind: type[Keys], error: Any, where: str) -> Problem:
    loc, given = error["loc"], shown(error["input"])
    path = key_path(where, loc)
    context = error.get("ctx", {})
    match error["type"]:
        case "missing":
            return Problem(path, "is missing")
        case "extra_forbidden":
            return Problem(path, _unknown(str(loc[-1]), list(_model_at(kind, loc[:-1]).model_fields)))
        case "value_error":
            return Problem(path, str(context["error"]))
        case "literal_error":
            choices = re.findall(r"'([^']*)'", context["expected"])
            near = nearest(error["input"], choices) if isinstance(error["input"], str) else ""
            return Problem(path, f"must be one of {', '.join(choices)}, given {given}{near}")
        case "string_pattern_mismatch":
            return Problem(path, f"must be made of letters, digits, _ and -, given {given}")
        case "string_type":
            return Problem(path, f"must be text (in quotes, if it looks like a number), given {given}")
        case "float_type":
            return Problem(path, f"must be a number, given {given}")
        case "int_type" | "int_from_float" | "int_parsing_size":
            return Problem(path, f"must be a whole number, given {given}")
        case "finite_number":
            return Problem(path, f"must be a finite number, given {given}")
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            word = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
            bound = next(k for k in ("gt", "ge", "lt", "le") if k in context)
            return Problem(path, f"must be {word[bound]} {context[bound]:g}, given {given}")
        case "too_short" | "too_long":
            least, most = context.get("min_length"), context.get("max_length")
            bound = f"at least {least}" if least is not None else f"at most {most}"
            given = context.get("actual_length", given)
            whole = _form_of(loc) and given == 4 and all(type(v) is int for v in error["input"])
            hint = f"; decimals begin with a point: [{EXAMPLES[0]}]" if whole else ""
            return Problem(path, f"must have {bound} values{_form_of(loc)}, given {given}{hint}")
        case "list_type" if _form_of(loc):
            words = f"must be [lat, lon], {{lat, lon}}, or text such as {EXAMPLES[0]}"
            return Problem(path, f"{words}, or {{east_m, north_m}} in a mission with a frame, given {given}")
        case "list_type":
            return Problem(path, f"must be a list, given {given}")
        case "model_type" | "dict_type" | "model_attributes_type":
            return Problem(path, f"must be a mapping of keys, given {given}")
    return Problem(path, f"{error['msg'][:1].lower()}{error['msg'][1:]}, given {given}")


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
