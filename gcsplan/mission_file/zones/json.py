"""The values of a zone file in JSON, read strictly: no key twice, no NaN, no number without bounds."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError
from gcsplan.mission_file.zones.text import decoded


def load_json(path: Path, data: bytes) -> Any:
    """The value that the text holds. Raises InputError."""
    try:
        return json.loads(decoded(data), object_pairs_hook=_unique, parse_constant=_no_constant, parse_int=_bounded_int)
    except RecursionError:
        raise InputError("the file is nested too deeply to be GeoJSON", where=str(path)) from None
    except ValueError as why:  # bad UTF-8, bad JSON, and the refusals below
        start = data[:200].lstrip(b"\xef\xbb\xbf \t\r\n")
        hint = "; it looks like KML: name it .kml" if start.startswith(b"<") else ""
        raise InputError(f"this is not GeoJSON: {str(why)[:200]}{hint}", where=str(path)) from None


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    whole = dict(pairs)
    if len(whole) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise ValueError(f"the key {key[:60]!r} stands twice")
            seen.add(key)
    return whole


def _no_constant(name: str) -> Iterator[None]:
    raise ValueError(f"{name} is no number")


def _bounded_int(digits: str) -> float:
    # int() refuses thousands of digits with a message about its own limits; as inf the number is refused by gcsplan.
    return int(digits) if len(digits) <= 300 else math.inf
