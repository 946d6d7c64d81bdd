"""The JSON Schema of a mission file, for editors: the models of the keys, and what the reader does before them.

It accepts all that the reader accepts. The reader refuses more: whatever takes more than one key, or the terrain.
"""

from __future__ import annotations

import ast
import copy
import inspect
import re
from collections.abc import Mapping
from functools import cache
from typing import Any

from gcsplan.mission_file import vehicles
from gcsplan.mission_file.load import TERRAIN_ERROR_M
from gcsplan.mission_file.values import point_keys, schema
from gcsplan.mission_file.values.keys import Keys
from gcsplan.mission_file.values.units import other_names

FILE_NAME = "gcsplan.schema.json"
"""The file beside a mission that its first line names."""

MODELINE = f"# yaml-language-server: $schema={FILE_NAME}"
"""The line by which an editor finds the schema."""

DIALECT = "https://json-schema.org/draft/2020-12/schema"
SCHEMA_TITLE = "gcsplan mission file, version 1"

LATE_DEFAULTS: Mapping[str, float] = {
    **vehicles.ERRORS,
    "separation_m": vehicles.SEPARATION_M,
    "terrain_error_m": TERRAIN_ERROR_M,
}
"""Defaults that the reader of the mission file puts in, since they depend on other keys."""

_BOUNDS = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")


@cache
def descriptions() -> dict[tuple[str, str], str]:
    """Class and key to the text below the key, as one line, in the modules of the keys."""
    found = {}
    for kind in [*ast.parse(inspect.getsource(schema)).body, *ast.parse(inspect.getsource(point_keys)).body]:
        if isinstance(kind, ast.ClassDef):
            for field, text in zip(kind.body, kind.body[1:], strict=False):
                if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
                    found[kind.name, ast.unparse(field.target)] = " ".join(ast.literal_eval(text.value).split())
    return found


def describe(kind: type[Keys], key: str) -> str:
    """The description of a key, in plain text; ``kind`` may have inherited the key."""
    description = next((text for base in kind.__mro__ if (text := descriptions().get((base.__name__, key)))), "")
    return re.sub(r"\[([^\]]+)\]\([^)]+\)", r"\1", description)  # without links of the reference


def mission_schema() -> dict[str, Any]:
    """The JSON Schema of the whole file."""
    from gcsplan.planners.registry import PLANNER_PACKAGES

    whole = schema.MissionKeys.model_json_schema()
    parts = whole.pop("$defs")
    kinds = {kind.__name__: kind for kind in _kinds(Keys)}
    for name, part in parts.items():
        _complete(part, kinds[name])
    parts["PlannerKeys"]["properties"]["name"]["enum"] = list(PLANNER_PACKAGES)
    _complete(whole, schema.MissionKeys)
    for key, entry in whole["properties"].items():
        if key not in whole["required"] and not _takes_null(entry):  # the reader takes a key without a value for absent
            words = {word: entry.pop(word) for word in ("description", "default") if word in entry}
            whole["properties"][key] = {"anyOf": [entry, {"type": "null"}], **words}
    return {"$schema": DIALECT, **whole, "title": SCHEMA_TITLE, "$defs": parts}


def _kinds(kind: type[Keys]) -> list[type[Keys]]:
    return [kind, *(inner for one in kind.__subclasses__() for inner in _kinds(one))]


def _takes_null(entry: Mapping[str, Any]) -> bool:
    return {"type": "null"} in entry.get("anyOf", ())


def _complete(part: dict[str, Any], kind: type[Keys]) -> None:
    """Add to the schema of a section what its keys are, and their names in other units."""
    part.pop("title", None)
    part["description"] = part.get("description", "").replace("``", "`")
    own: dict[str, Any] = part["properties"]
    for key, entry in own.items():
        entry.pop("title", None)
        if entry.get("default") is None or isinstance(entry["default"], dict):
            entry.pop("default", None)
        if key in LATE_DEFAULTS and key in kind.__annotations__:  # a vehicle inherits the limits of all
            entry["default"] = LATE_DEFAULTS[key]
        if words := describe(kind, point_keys.ALIASES.get(key, key)):
            entry["description"] = words
    others = {name: written for name, written in other_names(kind.model_fields).items() if written.key in own}
    for name, written in others.items():
        words = f"`{written.key}` in {written.other.symbol}. {own[written.key].get('description', '')}".strip()
        own[name] = _without_bounds(own[written.key]) | {"description": words}
    required = part.pop("required", [])
    choices = {key: [key, *(name for name, w in others.items() if w.key == key)] for key in required}
    if always := [key for key, allowed in choices.items() if len(allowed) == 1]:
        part["required"] = always
    several = [allowed for allowed in choices.values() if len(allowed) > 1]
    if several:
        part["allOf"] = [*part.get("allOf", []), *({"anyOf": [{"required": [n]} for n in some]} for some in several)]


def _without_bounds(entry: Any) -> Any:
    """A copy without the bounds of numbers and the default, which hold in the key's own unit."""
    if isinstance(entry, list):
        return [_without_bounds(one) for one in entry]
    if isinstance(entry, dict):
        return {key: _without_bounds(one) for key, one in entry.items() if key not in (*_BOUNDS, "default")}
    return copy.copy(entry)
