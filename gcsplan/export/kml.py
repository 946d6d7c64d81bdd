"""`mission.kml` (KML 2.2, OGC 07-147r2, with Google's gx): what is flown, and no-fly zones as solids, for a 3-D viewer.

KML knows times of day alone, and a mission mostly has none: times are seconds from the common start, in the balloon of
each way point. Only a plan that starts at a time of day also has a moving marker for each vehicle (``gx:Track``).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime, timedelta
from xml.sax.saxutils import escape

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.export.rows import HEIGHT_DECIMALS, FlownTrack, WayPoint, areas_deg, extent_words, outlines_deg
from gcsplan.figures import floored
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import KeepIn, Level, Zone, keep_in_of, no_fly_of

KML_COLOURS = ("ff0099ff", "ffff9900", "ff66cc00", "ffcc00cc", "ff00cccc", "ff3333ff")  # aabbggrr
MOST_CURTAINS = 100
"""Most tracks that are drawn with a curtain to the ground and all way points; of more, way points are there to tick."""
DRAWN_TOP_M = 300.0
"""Metres above the highest track up to which a zone without a ceiling is drawn."""

TILT_DEG, FARTHER, NEAREST_M = 50.0, 1.2, 400.0
"""A view is this much off the vertical, from this many diagonals of what it shows away, or this far if that is more."""

SAME_TIME_S = 0.05
"""A vehicle that is at a place no longer than this does not wait there."""

BALLOON = (
    "<![CDATA[<b>$[vehicle], $[name]</b><table><tr><td>item</td><td>$[number]</td></tr>"
    "<tr><td>command</td><td>$[command]</td></tr><tr><td>AMSL, m</td><td>$[amsl_m]</td></tr>"
    "<tr><td>above ground, m</td><td>$[agl_m]</td></tr><tr><td>time, s after the start</td><td>$[time_s]</td></tr>"
    "</table>]]>"
)
"""The balloon of a way point, with the fields of its ExtendedData."""

_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""The characters that XML 1.0 does not allow (complement of production 2, Char)."""


def write_kml(
    name: str, tracks: Sequence[FlownTrack], zones: Sequence[Zone], frame: Frame, start: datetime | None = None
) -> str:
    """The KML text of a mission called ``name``; the same input gives the same bytes.

    Heights are AMSL (``absolute``); zones with an AGL level follow the ground (``relativeToGround``). A zone is drawn
    as a solid from the ground to its ceiling, or, if it has a floor, as the two faces floor and ceiling. ``start``: the
    time of day from which the tracks' times count, if there is one.
    """
    top_m = max((float(t.amsl_m.max()) for t in tracks), default=0.0) + DRAWN_TOP_M
    areas = areas_deg(keep_in_of(zones), frame)
    zones = no_fly_of(zones)
    outlines = outlines_deg(zones, frame)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">',
        "<Document>",
        f"<name>{_text(name)}</name>",
        "<open>1</open>",
        *_look_at(_everything(tracks, outlines), frame),
        *(line for number, colour in enumerate(KML_COLOURS) for line in _styles(number, colour)),
        '<Style id="zone"><LineStyle><color>ff0000ff</color></LineStyle>'
        "<PolyStyle><color>600000ff</color></PolyStyle></Style>",
        '<Style id="area"><LineStyle><color>ff00a000</color></LineStyle>'
        "<PolyStyle><color>0000a000</color></PolyStyle></Style>",
    ]
    light = len(tracks) > MOST_CURTAINS
    for number, track in enumerate(tracks):
        lines += _track(track, number % len(KML_COLOURS), frame, start, light=light)
    if zones:
        lines += ["<Folder>", "<name>no-fly zones</name>"]
        for zone, outline in zip(zones, outlines, strict=True):
            lines += _zone(zone, outline, top_m)
        lines.append("</Folder>")
    if areas:
        lines += ["<Folder>", "<name>keep-in areas</name>"]
        for area, rings in areas:
            lines += _area(area, rings, top_m)
        lines.append("</Folder>")
    return "\n".join([*lines, "</Document>", "</kml>"]) + "\n"


def _everything(tracks: Sequence[FlownTrack], outlines: Sequence[Floats]) -> Floats:
    """(N, 3) degrees and AMSL of what the document shows: the tracks, or the zones if there are none."""
    if tracks:
        return np.vstack([_places(t) for t in tracks])
    return np.vstack([np.column_stack([o, np.zeros(len(o))]) for o in outlines]) if outlines else np.zeros((0, 3))


def _places(track: FlownTrack) -> Floats:
    return np.column_stack([track.lat_deg, track.lon_deg, track.amsl_m])


def _look_at(places: Floats, frame: Frame, *, along: bool = False) -> Iterable[str]:
    """The view of (N, 3) places from the south, or, ``along``, in the direction from the first to the last."""
    if not len(places):
        return
    plane = frame.to_plane(places[:, 0], places[:, 1])
    low, high = plane.min(axis=0), plane.max(axis=0)
    lat, lon = (float(x) for x in frame.to_degrees(*(0.5 * (low + high))))
    amsl = 0.5 * float(places[:, 2].min() + places[:, 2].max())
    away = max(FARTHER * float(np.hypot(*(high - low))), NEAREST_M)
    heading = math.degrees(math.atan2(*(plane[-1] - plane[0]))) % 360.0 if along else 0.0
    yield (
        f"<LookAt><longitude>{lon:.7f}</longitude><latitude>{lat:.7f}</latitude><altitude>{amsl:.2f}</altitude>"
        f"<heading>{heading:.1f}</heading><tilt>{TILT_DEG:g}</tilt><range>{away:.0f}</range>"
        "<altitudeMode>absolute</altitudeMode></LookAt>"
    )


def _styles(number: int, colour: str) -> Iterable[str]:
    """The styles of one colour: the track, and its way points, whose names stand beside them only under the pointer."""
    yield (
        f'<Style id="track{number}"><LineStyle><color>{colour}</color><width>3</width></LineStyle>'
        f"<PolyStyle><color>40{colour[2:]}</color></PolyStyle></Style>"
    )
    for state, icon, label in (("normal", 0.6, 0), ("highlight", 0.9, 1)):
        yield (
            f'<Style id="point{number}-{state}"><IconStyle><color>{colour}</color><scale>{icon}</scale></IconStyle>'
            f"<LabelStyle><scale>{label}</scale></LabelStyle><BalloonStyle><text>{BALLOON}</text></BalloonStyle></Style>"
        )
    pairs = (f"<Pair><key>{s}</key><styleUrl>#point{number}-{s}</styleUrl></Pair>" for s in ("normal", "highlight"))
    yield f'<StyleMap id="point{number}">{"".join(pairs)}</StyleMap>'


def _text(words: str) -> str:
    return escape(_NOT_XML.sub("\ufffd", words))


def _coordinates(lat_deg: Floats, lon_deg: Floats, height_m: Floats) -> str:
    return " ".join(_place(*p) for p in np.stack([lat_deg, lon_deg, height_m], axis=-1).tolist())


def _place(lat_deg: float, lon_deg: float, height_m: float) -> str:
    return f"{lon_deg:.7f},{lat_deg:.7f},{height_m:.2f}"


def _track(track: FlownTrack, style: int, frame: Frame, start: datetime | None, *, light: bool) -> Iterable[str]:
    name = _text(track.vehicle)
    yield "<Folder>"
    yield f"<name>{name}</name>"
    yield from _look_at(_places(track), frame, along=True)
    described = f"<description>{_text(track.description)}</description>" if track.description else ""
    yield f"<Placemark><name>{name}</name>{described}<styleUrl>#track{style}</styleUrl>"
    yield f"<LineString>{'' if light else '<extrude>1</extrude>'}<altitudeMode>absolute</altitudeMode>"
    yield f"<coordinates>{_coordinates(track.lat_deg, track.lon_deg, track.amsl_m)}</coordinates>"
    yield "</LineString></Placemark>"
    if start is not None and track.left_s is not None:
        yield from _moving(track, style, start)
    if light:
        yield "<Folder><name>way points</name><visibility>0</visibility>"
    hidden = "<visibility>0</visibility>" if light else ""  # of each: a viewer shows what its own element says
    shown: set[int | None] = set()
    for point, lat, lon, amsl in zip(track.waypoints, track.lat_deg, track.lon_deg, track.amsl_m, strict=False):
        if point is None or (point.number in shown and point.number is not None):
            continue  # a jump leads back to an item that has its place already
        shown.add(point.number)
        yield (
            f"<Placemark><name>{_text(point.name)}</name>{hidden}<styleUrl>#point{style}</styleUrl>"
            f"<ExtendedData>{_fields(track, point, float(amsl))}</ExtendedData>"
            f"<Point><altitudeMode>absolute</altitudeMode><coordinates>{_place(lat, lon, amsl)}</coordinates></Point>"
            "</Placemark>"
        )
    if light:
        yield "</Folder>"
    yield "</Folder>"


def _fields(track: FlownTrack, point: WayPoint, amsl_m: float) -> str:
    """The text of a way point's balloon."""
    agl = f"{floored(point.agl_m, HEIGHT_DECIMALS):.{HEIGHT_DECIMALS}f}" if math.isfinite(point.agl_m) else "unknown"
    values = {
        "vehicle": track.vehicle,
        "number": "none" if point.number is None else str(point.number),
        "command": point.command or "none",
        "amsl_m": f"{amsl_m:.{HEIGHT_DECIMALS}f}",
        "agl_m": agl,
        "time_s": "unknown" if point.time_s is None else f"{point.time_s:.1f}",
    }
    return "".join(f'<Data name="{key}"><value>{_text(value)}</value></Data>' for key, value in values.items())


def _moving(track: FlownTrack, style: int, start: datetime) -> Iterable[str]:
    """The track with the time of day at each point, and at the end of each wait."""
    assert track.reached_s is not None
    assert track.left_s is not None
    rows: list[tuple[float, str]] = []
    points = np.column_stack([track.lon_deg, track.lat_deg, track.amsl_m]).tolist()
    for (lon, lat, amsl), reached, left in zip(points, track.reached_s.tolist(), track.left_s.tolist(), strict=True):
        coord = f"{lon:.7f} {lat:.7f} {amsl:.2f}"
        rows.append((reached, coord))
        if left - reached > SAME_TIME_S:
            rows.append((left, coord))
    yield f"<Placemark><name>{_text(track.vehicle)} in time</name><styleUrl>#track{style}</styleUrl><gx:Track>"
    yield "<altitudeMode>absolute</altitudeMode>"
    for seconds, _ in rows:
        at = start.astimezone(UTC) + timedelta(seconds=seconds)
        yield f"<when>{at.isoformat(timespec='milliseconds').removesuffix('+00:00')}Z</when>"
    for _, coord in rows:
        yield f"<gx:coord>{coord}</gx:coord>"
    yield "</gx:Track></Placemark>"


def _zone(zone: Zone, ring: Floats, top_m: float) -> Iterable[str]:
    yield (
        f"<Placemark><name>{_text(zone.name)}</name><description>no-fly {extent_words(zone)}</description>"
        f"<styleUrl>#zone</styleUrl><ExtendedData>{_limit('lower', zone.floor, 'GND')}"
        f"{_limit('upper', zone.ceiling, 'UNL')}</ExtendedData>"
    )
    ceiling = zone.ceiling or Level(top_m, "amsl")
    if zone.floor is None or zone.floor == Level(0.0, "agl"):
        yield _face(ring, ceiling, solid=True)
    else:
        yield "<MultiGeometry>"
        yield _face(ring, zone.floor, solid=False)
        yield _face(ring, ceiling, solid=False)
        yield "</MultiGeometry>"
    yield "</Placemark>"


def _area(area: KeepIn, rings: Sequence[Floats], top_m: float) -> Iterable[str]:
    """A part of a keep-in area, as an outline at its ceiling; ``kind`` says that it is no no-fly zone."""
    yield (
        f"<Placemark><name>{_text(area.name)}</name><description>keep in, {extent_words(area)}</description>"
        f'<styleUrl>#area</styleUrl><ExtendedData><Data name="kind"><value>keep_in</value></Data>'
        f"{_limit('lower', area.floor, 'GND')}{_limit('upper', area.ceiling, 'UNL')}</ExtendedData>"
    )
    yield _face(rings[0], area.ceiling or Level(top_m, "amsl"), solid=False, holes=rings[1:])
    yield "</Placemark>"


def _limit(key: str, level: Level | None, without: str) -> str:
    """The level in words that `mission_file` reads: a zone without end is drawn with one, and must not be read so."""
    words = without if level is None else f"{float(level.value_m)!r} m {level.datum.upper()}"
    return f'<Data name="{key}"><value>{words}</value></Data>'


def _face(ring: Floats, level: Level, *, solid: bool, holes: Sequence[Floats] = ()) -> str:
    def boundary(kind: str, corners: Floats) -> str:
        closed = np.vstack([corners, corners[:1]])
        places = _coordinates(closed[:, 0], closed[:, 1], np.full(len(closed), level.value_m))
        return f"<{kind}><LinearRing><coordinates>{places}</coordinates></LinearRing></{kind}>"

    mode = "absolute" if level.datum == "amsl" else "relativeToGround"
    return (
        f"<Polygon><extrude>{int(solid)}</extrude><altitudeMode>{mode}</altitudeMode>"
        f"{boundary('outerBoundaryIs', ring)}{''.join(boundary('innerBoundaryIs', hole) for hole in holes)}</Polygon>"
    )
