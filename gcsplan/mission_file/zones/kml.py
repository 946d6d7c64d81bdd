"""Zones from KML: Placemarks with Polygons, Points and LineStrings, whose sizes are in ExtendedData or in the mission.

Floors and ceilings come from ExtendedData. A polygon without them that is drawn from its altitude down to the ground
(``extrude``) has its highest altitude as the ceiling, above the ground or above sea level as altitudeMode says. Other
altitudes describe how a globe draws the outline, and a remark says that they are not read. Namespaces are not required.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import defusedxml.ElementTree
from defusedxml.common import DefusedXmlException

from gcsplan.errors import InputError, Mistake
from gcsplan.figures import counted
from gcsplan.mission_file.zones.attributes import Attribute, ZoneStatements, as_figure, read_attributes
from gcsplan.mission_file.zones.draft import SIZE_KEYS
from gcsplan.mission_file.zones.file import NOT_DRAWN, Drawn, Ignorable, ZoneFile
from gcsplan.mission_file.zones.levels import LARGEST_M
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.degree_shapes import beyond_outline
from gcsplan.world.geometry.zones import Level

MAX_KML_DEPTH = 60
MOST_TAGS = 2_000_000
"""Most beginnings and ends of elements, each of which takes some 300 bytes of memory; 20 MB of zones have a third."""

MODES: dict[str, Literal["agl", "amsl"]] = {"relativeToGround": "agl", "absolute": "amsl"}
"""The zero of altitudes, by the altitudeModes in which they count at all."""

DrawnCorner = tuple[float, float, float]
"""Latitude, longitude and altitude of a corner; not a number if it has no altitude."""

_PICTURES = ("PhotoOverlay", "ScreenOverlay", "Tour")
"""Elements that decorate the map and limit nothing."""

_READ_SHAPES = ("Polygon", "Point", "LineString")
_BESIDE: dict[str, Ignorable] = {
    "LinearRing": "lines", "Track": "lines", "MultiTrack": "lines", "Model": "points", "none": "empty",
}  # fmt: skip
"""How a mission ignores the geometries of a Placemark that are no zone."""

_KML_SHAPES = (*_READ_SHAPES, "LinearRing", "Model", "Track", "MultiTrack")


def read_kml(path: Path, data: bytes) -> ZoneFile:
    """The zones of KML text. Raises InputError if it is not KML."""
    found = ZoneFile(path, great_circles=True)  # as Google Earth draws them
    if data.count(b"<") > MOST_TAGS:
        raise InputError(
            f"the KML has more than {MOST_TAGS} tags; leave out zones far from the mission", where=str(path)
        )
    try:
        root = defusedxml.ElementTree.fromstring(data, forbid_dtd=True)
    except DefusedXmlException:
        raise InputError("the KML has a document type or entities; remove them", where=str(path)) from None
    except (ValueError, SyntaxError, LookupError) as why:  # ParseError is a SyntaxError; unknown encodings LookupError
        raise InputError(f"this is not KML: {str(why)[:200]}", where=str(path)) from None
    placemarks = 0
    loose: Counter[str] = Counter()
    pictures: Counter[str] = Counter()
    for element in _walk(root, path, leaves=("Placemark", *_PICTURES, *_KML_SHAPES)):
        kind = _kind(element)
        if kind in _KML_SHAPES:
            loose[kind] += 1
        elif kind in _PICTURES:
            pictures[kind] += 1
        if kind == "Placemark":
            placemarks += 1
            _placemark(found, element, placemarks)
        elif kind == "NetworkLink":
            found.problems.append(_network_link(element, path))
        elif kind in ("NetworkLinkControl", "GroundOverlay"):
            found.problems.append(Mistake(f"{path}: {kind}", f"a {kind} cannot be read as a zone; remove it"))
    if pictures:
        kinds = tuple(counted(count, kind) for kind, count in pictures.items())
        found.own_notes.append(Note("pictures_unused", kinds=kinds))
    for kind, count in loose.items():
        words = f"{counted(count, kind)} outside of a Placemark cannot be read as a zone; put each into a Placemark"
        found.problems.append(Mistake(f"{path}: {kind}", words))
    if not placemarks and not found.problems:
        raise InputError("the KML holds no Placemark", where=str(path))
    return found


def _walk(root: Any, path: Path, *, leaves: tuple[str, ...] = ()) -> Iterator[Any]:
    """Every element in the order of the file, without recursion; elements below ``leaves`` are left out."""
    stack = [(root, 0)]
    while stack:
        element, depth = stack.pop()
        if depth > MAX_KML_DEPTH:
            raise InputError(f"the KML is nested more than {MAX_KML_DEPTH} levels deep", where=str(path))
        yield element
        if _kind(element) not in leaves:
            stack += [(child, depth + 1) for child in reversed(element)]


def _kind(element: Any) -> str:
    """The tag without its namespace; empty for comments and processing instructions."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def _network_link(element: Any, path: Path) -> Mistake:
    """The mistake of a link, whose file may hold zones, and lies elsewhere."""
    texts = {_kind(e): (e.text or "").strip() for e in element.iter() if _kind(e) in ("name", "href")}
    named = f" ({texts['name'][:60]})" if texts.get("name") else ""
    words = f"the zones of the link to {texts.get('href', '')[:200] or 'nothing'} are not in this file, and gcsplan "
    words += (
        "follows no link: open it in Google Earth, save what it shows as .kmz, and name that file; or remove the link"
    )
    return Mistake(f"{path}: NetworkLink{named}", words)


def _placemark(found: ZoneFile, placemark: Any, number: int) -> None:
    name = next((t for c in placemark if _kind(c) == "name" and (t := (c.text or "").strip())), "")
    where = f"{found.path}: Placemark {number}" + (f" ({name[:60]})" if name else "")
    given = [Attribute("name", name, where), *_extended_data(placemark, where), *_times(placemark, where)]
    stated = read_attributes(given, where, f"{found.path.stem}[{number}]", found.problems)
    if stated is None:
        return
    below = list(_walk(placemark, found.path, leaves=_KML_SHAPES))
    if any(_kind(e) == "Placemark" for e in below[1:]):
        found.problems.append(Mistake(where, "holds another Placemark; end each before the next begins"))
        return
    shapes = [e for e in below if _kind(e) in _KML_SHAPES]
    others = dict.fromkeys(_kind(e) for e in shapes if _kind(e) not in _READ_SHAPES)
    for kind in others or ([] if shapes else ["none"]):
        words = f"its geometry must be Polygons, Points with a radius_m or LineStrings with a buffer_m, given {kind}"
        ignored = _BESIDE[kind]
        cure = f"remove it, or leave it out by name (ignore: [{ignored}], --ignore {ignored})"
        found.unshaped.append((ignored, stated.name, Mistake(where, f"{words}; {cure}")))
    shapes = [e for e in shapes if _kind(e) in _READ_SHAPES]
    for i, shape in enumerate(shapes):
        part = stated.name if len(shapes) == 1 else f"{stated.name}/{i + 1}"
        if _kind(shape) == "Point":
            points = _coordinates(found, shape, where)
            if points is not None and len(points) == 1:
                found.add_circle(stated, part, where, points[0][:2], _unread(points).remarks)
            elif points is not None:
                found.problems.append(Mistake(where, f"a Point has one coordinate, given {len(points)}"))
        elif _kind(shape) == "LineString":
            points = _coordinates(found, shape, where)
            if points is not None:
                found.add_line(stated, part, where, [p[:2] for p in points], "", _unread(points).remarks)
        else:
            _polygon(found, shape, stated, part, where)


def _polygon(found: ZoneFile, shape: Any, stated: ZoneStatements, part: str, where: str) -> None:
    outer = [e for e in _walk(shape, found.path) if _kind(e) == "outerBoundaryIs"]
    if len(outer) != 1:
        found.problems.append(Mistake(where, f"a Polygon has one outerBoundaryIs, given {len(outer)}"))
        return
    points = _coordinates(found, outer[0], where)
    inner = [e for e in _walk(shape, found.path) if _kind(e) == "innerBoundaryIs"]
    rings = [_coordinates(found, e, where) for e in inner]
    holes = [[p[:2] for p in ring] for ring in rings if ring]
    odd = beyond_outline([p[:2] for p in points or []], holes)
    if odd:
        found.problems.append(Mistake(where, odd))
    elif points is not None:
        drawn = _unread(points) if stated.of_levels else _drawn(shape, points)
        found.add_ring(stated, part, where, [p[:2] for p in points], "", drawn, holes)


def _drawn(shape: Any, points: list[DrawnCorner]) -> Drawn:
    """The ceiling of a polygon that is drawn down to the ground: its highest corner, so that it is not made lower.

    Altitudes of 0 are what programs write that draw flat outlines, and are no ceiling.
    """

    def texts(kind: str) -> set[str]:
        return {(e.text or "").strip() for e in shape if _kind(e) == kind}

    modes, heights = texts("altitudeMode"), [p[2] for p in points]
    mode = modes.pop() if len(modes) == 1 else ""
    if mode not in MODES or texts("extrude") not in ({"1"}, {"true"}) or not all(math.isfinite(h) for h in heights):
        return _unread(points, mode)
    top_m = max(heights)
    if not any(heights) or (mode == "relativeToGround" and top_m <= 0.0):
        return _unread(points, mode)
    ceiling = Level(top_m, MODES[mode])
    height = Note(
        "drawn_height" if min(heights) == top_m else "drawn_height_of_highest_corner",
        top_m=top_m, datum=ceiling.datum.upper(),
    )  # fmt: skip
    return Drawn(ceiling, ((Note("zone_ceiling_as_drawn"), height),))


def _unread(points: list[DrawnCorner], mode: str = "") -> Drawn:
    heights = [p[2] for p in points if math.isfinite(p[2]) and p[2] != 0.0]
    if not heights:
        return NOT_DRAWN
    top_m = max(heights)
    up_to = Note("drawn_up_to_in_mode", top_m=top_m, mode=mode[:40]) if mode else Note("drawn_up_to", top_m=top_m)
    return Drawn(remarks=((Note("zone_drawn_altitudes_unread"), up_to),))


def _coordinates(found: ZoneFile, parent: Any, where: str) -> list[DrawnCorner] | None:
    """Each ``lon,lat[,alt]`` below ``parent``; None, and a problem, if one is wrong."""
    text = " ".join(e.text or "" for e in _walk(parent, found.path) if _kind(e) == "coordinates")
    points = []
    for word in text.split():
        try:
            lon, lat, *up = (float(x) for x in word.split(",")[:3])
        except ValueError:
            lon, lat, up = math.nan, math.nan, []
        if not (math.isfinite(lon) and math.isfinite(lat)):
            found.problems.append(Mistake(where, f"coordinates are lon,lat[,alt] without spaces, given {word[:60]!r}"))
            return None
        if abs(lat) > 90.0 and abs(lon) <= 90.0 and abs(lat) <= 180.0:
            swapped = f"longitude and latitude look swapped: KML is lon,lat, given {word[:60]}"
            found.problems.append(Mistake(where, swapped))
            return None
        points.append((lat, lon, up[0] if up and abs(up[0]) <= LARGEST_M else math.nan))
    if not points:
        found.problems.append(Mistake(where, "has no coordinates"))
        return None
    return points


def _times(placemark: Any, where: str) -> list[Attribute]:
    """The times of a Placemark, which are not read."""
    kinds = ("TimeSpan", "TimeStamp")
    return [Attribute(_kind(e), " to ".join("".join(e.itertext()).split())[:60], where) for e in placemark
            if _kind(e) in kinds]  # fmt: skip


def _extended_data(placemark: Any, where: str) -> list[Attribute]:
    """Names and texts of ``<Data name><value>`` and ``<SimpleData name>``; a radius in figures is a number."""
    given = []
    for child in placemark:
        if _kind(child) != "ExtendedData":
            continue
        for element in child.iter():
            if _kind(element) not in ("Data", "SimpleData"):
                continue
            key = element.get("name", "")
            texts = [element] if _kind(element) == "SimpleData" else [e for e in element if _kind(e) == "value"]
            text = next((e.text or "" for e in texts), "").strip()
            given.append(Attribute(key, as_figure(text) if key.lower() in SIZE_KEYS else text, f"{where}.{key[:80]}"))
    return given
