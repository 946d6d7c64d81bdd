"""The members of a JSON document on itself: the coordinate system of its places, and whether a server sent all of it.

GeoJSON, ED-318 and openAIP's export share these members, so they are read in every document, whatever its zones are.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.zones.attributes import is_number

_DEGREES = re.compile(r"(?:^|[^A-Z0-9])(?:CRS:?84H?|4326(?:\+\d+)?|4979)[^A-Z0-9]*$", re.IGNORECASE)
"""The ends of the names, codes and addresses of WGS 84 in degrees."""


def require_wgs84(whole: Any, path: Path, format_name: str = "GeoJSON") -> None:
    """Raise InputError for another coordinate system than WGS 84, of the document or of any object in it.

    RFC 7946 removed ``crs`` from the draft of 2008, but files have it, and the draft allowed it in every object.
    """
    for where, crs in _stated(whole):
        if crs is not None and not _DEGREES.search(_name_of(crs)):
            raise InputError(
                f"{format_name} is in WGS84 degrees{' (RFC 7946)' if format_name == 'GeoJSON' else ''}, this file says "
                f"{json.dumps(crs)[:100]}; convert it with ogr2ogr -t_srs EPSG:4326",
                where=f"{path}: {where}crs",
            )


def _stated(whole: Any) -> Iterator[tuple[str, Any]]:
    """Each ``crs`` with the place of the object that it stands in: the document, features, geometries."""
    if not isinstance(whole, dict):
        return
    yield "", whole.get("crs")
    features = whole.get("features")
    for i, feature in enumerate(features if isinstance(features, list) else [whole]):
        if not isinstance(feature, dict):
            continue
        where = "" if feature is whole else f"features[{i}]."
        geometry = feature.get("geometry")
        yield where, feature.get("crs")
        if isinstance(geometry, dict):
            yield f"{where}geometry.", geometry.get("crs")
            inner = geometry.get("geometries")
            for k, one in enumerate(inner if isinstance(inner, list) else []):
                if isinstance(one, dict):
                    yield f"{where}geometry.geometries[{k}].", one.get("crs")


def _name_of(crs: Any) -> str:
    """The name, the code or the address of a coordinate system."""
    given = crs.get("properties", crs) if isinstance(crs, dict) else crs
    if isinstance(given, dict):
        given = next((given[key] for key in ("name", "code", "href") if key in given), given)
    return given if isinstance(given, str) else json.dumps(given)


def sent_in_part(whole: Any, path: Path) -> list[Mistake]:
    """The problem of what a server sent in part, since the zones of the rest would be missing; empty if it is whole."""
    if not isinstance(whole, dict):
        return []
    inner = whole.get("properties")
    given = {**inner, **whole} if isinstance(inner, dict) else whole
    matched: Any = given.get("numberMatched")
    returned: Any = given.get("numberReturned")
    if given.get("exceededTransferLimit") is True:
        words = "the server sent a part of the features alone (exceededTransferLimit); ask for all, page by page"
        return [Mistake(f"{path}: exceededTransferLimit", words)]
    if is_number(matched) and is_number(returned) and matched > returned:
        words = f"the server sent {returned} of {matched} features; ask for all, page by page"
        return [Mistake(f"{path}: numberMatched", words)]
    return []
