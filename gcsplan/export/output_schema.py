"""JSON Schemas of what gcsplan writes for programs, for the form `SCHEMA`.

They grow with it: a key may be added any time, so that every object may have more keys than stand here, and a document
of an earlier version stays valid. A key that stands here is neither taken away nor made to mean another thing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gcsplan.export.summary import SCHEMA

DIALECT = "https://json-schema.org/draft/2020-12/schema"

TEXT, NUMBER, COUNT, FLAG = {"type": "string"}, {"type": "number"}, {"type": "integer"}, {"type": "boolean"}
MAYBE_NUMBER, MAYBE_TEXT, MAYBE_FLAG = ({"type": [kind, "null"]} for kind in ("number", "string", "boolean"))


def listed(items: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


def an_object(required: Mapping[str, Any], optional: Mapping[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    """An object with keys that it always has, keys that it may have, and any others."""
    return {"type": "object", "properties": {**required, **(optional or {})}, "required": list(required), **more}


NOTE = an_object({"code": MAYBE_TEXT, "item": {"type": ["integer", "null"]}, "data": {"type": "object"}})
NOTES = {"notes": listed(TEXT), "notes_data": listed(NOTE)}
ERROR = an_object(
    {"code": {"enum": [2, 3, 4, 5, 6, 7, 70, 129, 130, 143]}, "reason": TEXT, "message": TEXT, "where": TEXT},
    {"problems": listed(an_object({"where": TEXT, "message": TEXT}, {"code": TEXT}))},
)
INPUTS = an_object(
    {"dem_sha256": TEXT, "vertical_datum": TEXT, "resolution_m": NUMBER, "bare_dem": FLAG},
    {"heights_read": TEXT, "zones_sha256": TEXT, "dem_source": TEXT, "dem_kind": TEXT, "dem_tiles": TEXT,
     "dem_notice": TEXT, "sea_tiles": TEXT, "geoid_sha256": TEXT, "canopy_sha256": TEXT},
)  # fmt: skip
UPLOAD = an_object(
    {"url": TEXT, "outcome": {"enum": ["accepted", "refused", "unknown", "withdrawn"]}, "verified": FLAG,
     "simulated": FLAG, "items": COUNT},
    {"seconds": NUMBER, "retries": COUNT, "message": TEXT, "warnings": listed(TEXT)},
)  # fmt: skip
COMMON_FIGURES = {
    "items": COUNT, "length_m": NUMBER, "energy_j": MAYBE_NUMBER, "min_agl_m": MAYBE_NUMBER,
    "min_zone_clearance_m": MAYBE_NUMBER, "nearest_zone": MAYBE_TEXT, "max_climb_deg": NUMBER, "safe": MAYBE_FLAG,
    "not_judged": listed(TEXT), "battery_used_percent": MAYBE_NUMBER,
}  # fmt: skip
"""The figures of a mission that `plan` and `check` share."""
MORE_FIGURES = {
    "flight_energy_j": MAYBE_NUMBER, "energy_figures": {"enum": ["own", "paper", None]}, "verdict": TEXT,
    "max_agl_m": MAYBE_NUMBER, "min_zone_height_m": MAYBE_NUMBER, "zone_passed": {"type": ["object", "null"]},
    "arrive_earliest_s": NUMBER, "arrive_latest_s": NUMBER,
    "gates": listed(an_object({"seq": COUNT, "earliest_s": NUMBER, "latest_s": NUMBER, "opens_s": NUMBER,
                               "wait_s": NUMBER, "energy_j": MAYBE_NUMBER})),
    "not_judged_data": listed(NOTE), **NOTES, "way_home": an_object({"safe": MAYBE_FLAG}),
}  # fmt: skip
VEHICLE_PLAN = an_object(
    {"name": TEXT, **COMMON_FIGURES, "lower_bound_m": MAYBE_NUMBER, "gap_percent": MAYBE_NUMBER,
     "lower_bound_j": MAYBE_NUMBER, "speed_m_s": NUMBER, "depart_s": NUMBER, "arrive_s": NUMBER,
     "stopped_by": {"enum": ["gap", "exhausted", "budget", "evaluations", "time"]},
     "min_agl_at": {"anyOf": [an_object({"leg": COUNT, "lat": NUMBER, "lon": NUMBER}), {"type": "null"}]}},
    {**MORE_FIGURES, "path_time_s": NUMBER, "lower_bound_s": MAYBE_NUMBER, "hold_s": NUMBER, "planning_s": NUMBER,
     "first_path_s": NUMBER, "search": listed({}),
     "upload": {"anyOf": [UPLOAD, {"type": "null"}]}, "parameters": listed({"type": "object"}),
     "raw_violations": COUNT, "repaired": FLAG},
)  # fmt: skip
FLEET = an_object(
    {"mode": TEXT, "order": listed(TEXT), "min_separation_m": MAYBE_NUMBER,
     "closest": {"anyOf": [an_object({"vehicles": listed(TEXT), "time_s": NUMBER}), {"type": "null"}]}},
    {"interval_s": MAYBE_NUMBER, "separation_m": MAYBE_NUMBER, "in_every_wind": FLAG,
     "intervals": listed(an_object({"first": TEXT, "second": TEXT, "requested_s": NUMBER, "least_s": NUMBER,
                                    "most_s": NUMBER}))},
)  # fmt: skip
VIOLATION = an_object(
    {"seq": {"type": ["integer", "null"]}, "kind": TEXT, "message": TEXT},
    {"lat_deg": MAYBE_NUMBER, "lon_deg": MAYBE_NUMBER, "amsl_m": MAYBE_NUMBER, "value": MAYBE_NUMBER,
     "limit": MAYBE_NUMBER, "by": MAYBE_NUMBER, "unit": TEXT, "zone": MAYBE_TEXT, "code": TEXT,
     "data": {"type": "object"}},
)  # fmt: skip

FORMS: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "plan": (
        "summary.json, upload.json and plan --json",
        {"name": TEXT, "gcsplan": TEXT, "planner": TEXT, "objective": {"enum": ["length", "energy", "time"]},
         "seed": COUNT, "inputs": INPUTS, "vehicles": listed(VEHICLE_PLAN), "fleet": FLEET},
        {**NOTES, "left_out": listed(an_object({"name": TEXT, "reason": TEXT, "message": TEXT}))},
    ),
    "check": (
        "check --json",
        {"verdicts": listed({"anyOf": [
            an_object(
                {"file": TEXT, "vehicle": TEXT, **COMMON_FIGURES}, {**MORE_FIGURES, "violations": listed(VIOLATION)}
            ),
            an_object({"file": TEXT, "error": ERROR}),
        ]})},
        {"name": TEXT, "inputs": {"type": "object"}, **NOTES, "summary": {"type": "object"}},
    ),
    "document": ("--json of every command", {}, {}),
}  # fmt: skip
"""By name: which documents have the form, the keys that each of them has, and keys that it may have."""


def output_schema(form: str) -> dict[str, Any]:
    """The JSON Schema of a form of `FORMS`: of a command that did its work, or that ended with an error."""
    title, required, optional = FORMS[form]
    envelope = {"schema": {"const": SCHEMA}}
    whole = an_object({**envelope, **required}, {**optional, "error": ERROR})
    failed = an_object({**envelope, "error": ERROR})
    return {
        "$schema": DIALECT, "title": f"gcsplan: {title}, schema {SCHEMA}",
        **(whole if not required else {"anyOf": [whole, failed]}),
    }  # fmt: skip
