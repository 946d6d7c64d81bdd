"""`summary.json`: a plan as one JSON document, keys in the order of the contract; same input, same bytes."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from itertools import islice
from typing import Any

from gcsplan.figures import floored, raised

SCHEMA = 1
"""The form of all JSON that gcsplan writes for programs: it grows by one when a key is taken away or means another
thing, not when one is added."""

ORDER: dict[str, tuple[str, ...]] = {
    "": ("schema", "name", "gcsplan", "planner", "objective", "seed", "inputs", "vehicles", "fleet"),
    "inputs": (
        "dem_sha256", "vertical_datum", "heights_read", "resolution_m", "bare_dem", "dem_source", "dem_kind",
        "dem_tiles", "dem_notice", "sea_tiles", "zones_sha256",
    ),
    "vehicles": (
        "name", "items", "length_m", "lower_bound_m", "gap_percent", "energy_j", "lower_bound_j", "path_time_s",
        "lower_bound_s", "battery_used_percent", "min_agl_m", "min_agl_at", "min_zone_clearance_m", "nearest_zone",
        "max_climb_deg", "speed_m_s", "depart_s", "arrive_s", "arrive_earliest_s", "arrive_latest_s", "planning_s",
        "first_path_s", "stopped_by", "safe", "not_judged", "upload",
    ),
    "min_agl_at": ("leg", "lat", "lon"),
    "upload": ("url", "outcome", "verified", "simulated", "items", "seconds", "retries"),
    "fleet": ("mode", "order", "min_separation_m", "closest"),
    "closest": ("vehicles", "time_s"),
}  # fmt: skip
"""Order of the known keys of each object, by the key of the object; other keys follow in their own order."""

CLOCKS = frozenset({"planning_s", "first_path_s", "search", "upload"})
"""Clock readings and their objects: they differ each time, so only ``--json`` and upload.json hold them."""

DECIMALS = (
    ("lat_deg", 7),
    ("lon_deg", 7),
    ("_m_s", 3),
    ("_m", 3),
    ("_j", 1),
    ("_s", 3),
    ("_deg", 3),
    ("_percent", 3),
    ("lat", 7),
    ("lon", 7),
)
OTHER_DECIMALS = 6

TOGETHER = 10_000
"""Pieces of JSON, each a number, a key or a comma, that are joined at once."""


def write_summary(summary: Mapping[str, Any], *, clocks: bool = False) -> str:
    """The JSON text of ``summary``; NaN and infinity become null, numpy's numbers become plain ones.

    The first key is ``schema``. ``clocks`` keeps the clock readings. Floats are rounded by their unit; least values and
    lower bounds (``min_…``, ``lower_bound_…``) are rounded down, greatest values (``max_…``) up, so that none looks
    better than it is. Raises TypeError for a type that JSON lacks.
    """
    return _text(document(summary, clocks=clocks), lines=True) + "\n"


def document(summary: Mapping[str, Any], *, clocks: bool = False) -> dict[str, Any]:
    """What `write_summary` writes, as plain values."""
    plain: dict[str, Any] = _plain({"schema": SCHEMA, **summary}, "", clocks)
    return plain


def json_of(value: Mapping[str, Any], key: str, *, lines: bool = True) -> str:
    """The JSON text of an element of the list ``key``, as `write_summary` writes it there, or on one line."""
    return _text(_plain(value, key, True), lines=lines)


def _text(plain: Any, *, lines: bool) -> str:
    """As ``json.dumps`` writes it, which however keeps every number and comma in a list of its own until all are there:
    400 MB for a mission that is flown around for 100,000 items."""
    encoder = json.JSONEncoder(indent=2 if lines else None, ensure_ascii=False, allow_nan=False)
    if not lines:
        return encoder.encode(plain)
    chunks = encoder.iterencode(plain)
    return "".join(iter(lambda: "".join(islice(chunks, TOGETHER)), ""))


def _plain(value: Any, key: str, clocks: bool) -> Any:
    if isinstance(value, Mapping):
        first = [k for k in ORDER.get(key, ()) if k in value]
        keys = first + [k for k in value if k not in first]
        return {str(k): _plain(value[k], str(k), clocks) for k in keys if clocks or k not in CLOCKS}
    if isinstance(value, list | tuple):
        return [_plain(v, key, clocks) for v in value]
    if isinstance(value, str):
        return str(value)
    if value is None or isinstance(value, bool | int):
        return value
    if hasattr(value, "tolist"):  # numpy's scalars and arrays, without an import of numpy
        return _plain(value.tolist(), key, clocks)
    if isinstance(value, float):
        return _rounded(value, key)
    raise TypeError(f"{key} holds a {type(value).__name__}, which JSON has not")


def _rounded(value: float, key: str) -> float | None:
    if not math.isfinite(value):
        return None
    decimals = next((n for suffix, n in DECIMALS if key.endswith(suffix)), OTHER_DECIMALS)
    if key.startswith(("min_", "lower_bound")):
        value = floored(value, decimals)
    if key.startswith("max_"):
        value = raised(value, decimals)
    return round(value, decimals) + 0.0
