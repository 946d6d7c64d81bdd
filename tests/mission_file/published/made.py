"""Published zones made from the schemas of their formats, and how a file of them is read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.published.policy import Policy
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import ZoneDraft
from gcsplan.mission_file.zones.file import ZoneFile
from tests.support.attacks import require_placed_words

RING = [[8.0, 47.0], [8.1, 47.0], [8.1, 47.1], [8.0, 47.1], [8.0, 47.0]]
HOLE = [[8.04, 47.04], [8.06, 47.04], [8.06, 47.06], [8.04, 47.04]]


def read(folder: Path, content: Any, name: str = "zones.json", **policy: Any) -> ZoneFile:
    path = folder / name
    data = content if isinstance(content, str | bytes) else json.dumps(content)
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return read_zones(path, where="m: no_fly[0].file", policy=Policy(**policy, where="m: no_fly[0]"))


def said(folder: Path, content: Any, name: str = "zones.json", **policy: Any) -> str:
    """Everything that is wrong with a file: what refuses it, what refuses a mission near it, and what is not read."""
    try:
        found = read(folder, content, name, **policy)
    except InputError as error:
        return str(error)
    unread = [Mistake(p.where, f"zone {z.name!r}: {p.message}") for z in found.zones for p in z.unread]
    return "\n".join(str(p) for p in [*found.problems, *(f for z in found.zones for f in z.faults), *unread])


def outcome(folder: Path, content: Any, name: str = "zones.json") -> str:
    """How a file ends: with ``zones`` alone, or ``refused``, whole or in parts, with a place and words for each."""
    try:
        found = read(folder, content, name)
    except InputError as error:
        require_placed_words(error)
        return "refused"
    assert all(p.where and p.message for p in found.problems)
    assert all(zone.name for zone in found.zones)
    return "refused" if found.problems or any(zone.faults for zone in found.zones) else "zones"


def limits(zone: ZoneDraft) -> tuple[str, str]:
    """Floor and ceiling of a draft."""
    return str(zone.floor or "ground"), str(zone.ceiling or "unlimited")


def remarks(found: ZoneFile) -> str:
    return "\n".join(str(note.of(zones=(detail,))) for z in found.zones for note, detail in z.remarks)


def volume(**changes: Any) -> dict[str, Any]:
    """A made volume of ED-269."""
    whole = {
        "uomDimensions": "M",
        "lowerLimit": 0, "lowerVerticalReference": "AGL", "upperLimit": 120, "upperVerticalReference": "AGL",
        "horizontalProjection": {"type": "Polygon", "coordinates": [RING]},
    }  # fmt: skip
    return {k: v for k, v in (whole | changes).items() if v is not ...}


def ed269(*volumes: Any, **changes: Any) -> dict[str, Any]:
    """A made zone of ED-269."""
    whole = {
        "identifier": "CH0001", "country": "CHE", "name": "Made zone", "type": "COMMON", "restriction": "PROHIBITED",
        "applicability": [{"permanent": "YES"}],
        "zoneAuthority": [{"name": "Office", "email": "a@b.example", "intervalBefore": "P3D"}],
        "geometry": list(volumes) or [volume()],
    }  # fmt: skip
    return whole | changes


def ed318(geometry: Any = None, layer: Any = None, **changes: Any) -> dict[str, Any]:
    """A made feature of ED-318."""
    given = layer or {"upper": 150, "upperReference": "AGL", "lower": 50, "lowerReference": "AGL", "uom": "m"}
    shape = {"type": "Polygon", "coordinates": [RING], "layer": given} if geometry is None else geometry
    properties = {
        "identifier": "SE0001", "country": "SWE",
        "name": [{"text": "Gjord", "lang": "se"}, {"text": "Made", "lang": "en"}],
        "type": "PROHIBITED", "variant": "COMMON", "zoneAuthority": [{"purpose": "INFORMATION"}],
    }  # fmt: skip
    return {"type": "Feature", "properties": properties | changes, "geometry": shape}


def openaip(**changes: Any) -> dict[str, Any]:
    """A made airspace of openAIP's service."""
    whole = {
        "_id": "62614f5b", "name": "Made CTR", "type": 4, "icaoClass": 3, "activity": 0, "onDemand": False,
        "lowerLimit": {"value": 0, "unit": 1, "referenceDatum": 0},
        "upperLimit": {"value": 3500, "unit": 1, "referenceDatum": 1},
        "geometry": {"type": "Polygon", "coordinates": [RING]},
    }  # fmt: skip
    return {k: v for k, v in (whole | changes).items() if v is not ...}


def collection(*features: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features)}
