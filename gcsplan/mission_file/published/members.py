"""Members of JSON objects that the readers of published zones share: texts, positions, rings, and who authorises."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Sequence
from itertools import chain
from typing import Any

from gcsplan.mission_file.published.policy import Published
from gcsplan.mission_file.published.volumes import AirspaceFile, Given, VolumeLimits
from gcsplan.mission_file.zones.attributes import ATTRIBUTES_UNREAD, MOST_ATTRIBUTES_SHOWN, is_number, meaning_of, shown
from gcsplan.mission_file.zones.draft import Remark, one_line
from gcsplan.mission_file.zones.file import ZoneFile
from gcsplan.world.geodesy.degree_shapes import Corner, beyond_outline

_MEMBER_NUMBER = re.compile(r"[-+]?\d{1,9}(\.\d{1,9})?", re.ASCII)


MOST_GEOMETRIES = 1000
"""Most geometries of a collection."""


class MemberError(ValueError):
    """A member of an object cannot be read; the text says why."""


def text_of(given: Any) -> str:
    """A text, or the English (or else first) text of ED-318's ``[{"text": …, "lang": …}]``; empty if there is none."""
    if isinstance(given, str):
        return given.strip()
    if not isinstance(given, list):
        return ""
    texts = [t for t in given if isinstance(t, dict) and isinstance(t.get("text"), str) and t["text"].strip()]
    best = min(texts, key=lambda t: not str(t.get("lang", "")).lower().startswith("en"), default=None)
    return "" if best is None else str(best["text"]).strip()


def authority_of(given: Any) -> str:
    """Who gives an authorisation, of ``zoneAuthority``: names, addresses, and how long before; empty if unknown."""
    found = []
    for one in given if isinstance(given, list) else []:
        if not isinstance(one, dict) or one.get("purpose") not in (None, "AUTHORIZATION", "AUTHORISATION"):
            continue
        parts = [text_of(one.get(key)) for key in ("name", "service", "email", "phone", "siteURL")]
        before = one.get("intervalBefore")
        parts.append(f"{before[:20]} before" if isinstance(before, str) and before.strip() else "")
        found.append(" ".join(dict.fromkeys(p[:60] for p in parts if p)))
    return "; ".join(f for f in found[:2] if f)


def unread(given: dict[str, Any], known: Collection[str], *, all_of_them: bool = False) -> list[Remark]:
    """A remark on the members that the format does not have and that seem to limit the zone, or on ``all_of_them``."""
    found = []
    for key, value in given.items():
        meaning = meaning_of(key)
        seems = all_of_them or meaning.limit is not None or meaning.seems_a_limit or meaning.seems_a_time
        if key not in known and seems and value not in (None, "", [], {}):
            found.append(one_line(f"{key[:40]} {shown(value)}"))
    return [(ATTRIBUTES_UNREAD, tuple(found[:MOST_ATTRIBUTES_SHOWN]))] if found else []


def position(given: Any) -> Corner:
    """(latitude, longitude) of ``[lon, lat]``. Raises MemberError."""
    if not isinstance(given, list) or len(given) < 2 or not all(is_number(x) for x in given[:2]):
        raise MemberError(f"a position is [longitude, latitude], given {shown(given)}")
    lon, lat = float(given[0]), float(given[1])
    if abs(lat) > 90.0 and abs(lon) <= 90.0 and abs(lat) <= 180.0:
        raise MemberError(f"longitude and latitude look swapped: they are [lon, lat], given [{lon:g}, {lat:g}]")
    return lat, lon


def outer_ring(given: Any) -> tuple[list[Corner], int]:
    """The outline of a polygon's rings, and the number of its holes. Raises MemberError."""
    if not isinstance(given, list) or not given or not isinstance(given[0], list):
        raise MemberError(f"a polygon is a list of rings, given {shown(given)}")
    outline, *holes = (_many(ring) or [position(p) for p in ring] for ring in given if isinstance(ring, list))
    if odd := beyond_outline(outline, holes):
        raise MemberError(odd)
    return outline, len(given) - 1


def _many(given: list[Any]) -> list[Corner]:
    """Positions that are right, all at once; none if one of them is wrong, or not plainly right."""
    plain = set(map(type, given)) == {list} and set(map(len, given)) <= {2, 3}
    if not plain or set(map(type, chain.from_iterable(given))) != {float}:
        return []
    lon, lat = [p[0] for p in given], [p[1] for p in given]
    right = min(lat) >= -90.0 and max(lat) <= 90.0 and min(lon) >= -180.0 and max(lon) <= 180.0
    return list(zip(lat, lon, strict=True)) if right else []


def number_or_none(given: Any, name: str) -> float | int | None:
    """A finite number, also as text, or None. Raises MemberError."""
    if given is None or is_number(given):
        return given  # type: ignore[no-any-return]
    if isinstance(given, str) and _MEMBER_NUMBER.fullmatch(given.strip()):
        return float(given)
    raise MemberError(f"{name} must be a number, given {shown(given)}")


def limit_of(given: Any, words: tuple[str, ...], key: str) -> Given | None:
    """A limit by its number; None without one. Another value stays as it is written, and mostly is no level then."""
    try:
        value = number_or_none(given, key)
    except MemberError:
        return Given(given if isinstance(given, str) else shown(given), words, (), key)
    return None if value is None else Given(value, words, (), key)


def read_features(
    file: AirspaceFile, features: Sequence[Any], key: str, add: Callable[[AirspaceFile, Any, str, str], None]
) -> ZoneFile:
    """The zones that ``add(file, feature, where, name)`` finds in each feature of a list called ``key``.

    ``name`` is for a feature without one; a MemberError refuses the file at that feature.
    """
    for i, feature in enumerate(features):
        where = f"{file.path}: {key}[{i}]"
        try:
            add(file, feature, where, f"{file.path.stem}[{i}]")
        except MemberError as why:
            file.fault(where, str(why))
    return file.finished()


def parts_of(geometry: Any, name: str) -> list[tuple[str, dict[str, Any]]]:
    """The polygons of a GeoJSON geometry, each with its name; a collection's are numbered. Raises MemberError."""
    whole: Any = [geometry]
    if isinstance(geometry, dict) and geometry.get("type") == "GeometryCollection":
        whole = geometry.get("geometries")
    if not isinstance(whole, list) or not 0 < len(whole) <= MOST_GEOMETRIES:
        raise MemberError(f"a GeometryCollection has geometries, given {shown(whole)}")
    for one in whole:
        kind = one.get("type") if isinstance(one, dict) else one
        if kind not in ("Polygon", "MultiPolygon"):
            raise MemberError(f"the geometry must be a Polygon or a MultiPolygon, given {shown(kind)}")
    return [(name if len(whole) == 1 else f"{name}/{i + 1}", one) for i, one in enumerate(whole)]


def add_polygons(
    file: AirspaceFile, zone: Published, part: str, where: str, geometry: dict[str, Any], limits: VolumeLimits
) -> None:
    """Add a Polygon or MultiPolygon of GeoJSON, whose holes count as no-fly. Raises MemberError."""
    kind, coordinates = geometry["type"], geometry.get("coordinates")
    polygons = [coordinates] if kind == "Polygon" else coordinates
    if not isinstance(polygons, list) or not polygons:
        raise MemberError(f"a {kind} has a list of coordinates, given {shown(polygons)}")
    for i, rings in enumerate(polygons):
        ring, holes = outer_ring(rings)
        file.add_ring(zone, part if len(polygons) == 1 else f"{part}/{i + 1}", where, ring, limits, holes)
