"""`mission.kml` (KML 2.2, OGC 07-147r2): tracks at their altitude and no-fly zones as solids, for a 3-D viewer."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from xml.sax.saxutils import escape

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.export.rows import Track, extent_words, outline_deg
from gcsplan.world.frame import Frame
from gcsplan.world.zones import Level, Zone

TRACK_COLOURS = ("ff0099ff", "ffff9900", "ff66cc00", "ffcc00cc", "ff00cccc", "ff3333ff")  # aabbggrr
DRAWN_TOP_M = 300.0
"""Metres above the highest track up to which a zone without a ceiling is drawn."""

_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""The characters that XML 1.0 does not allow (complement of production 2, Char)."""


def write_kml(name: str, tracks: Sequence[Track], zones: Sequence[Zone], frame: Frame) -> str:
    """The KML text of a mission called ``name``; the same input gives the same bytes.

    Heights are AMSL (``absolute``); zones with an AGL level follow the ground (``relativeToGround``). A zone is drawn
    as a solid from the ground to its ceiling, or, if it has a floor, as the two faces floor and ceiling.
    """
    top_m = max((float(t.amsl_m.max()) for t in tracks), default=0.0) + DRAWN_TOP_M
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<kml xmlns="http://www.opengis.net/kml/2.2">',
        "<Document>",
        f"<name>{_text(name)}</name>",
        *(
            f'<Style id="track{i}"><LineStyle><color>{colour}</color><width>3</width></LineStyle>'
            f"<PolyStyle><color>40{colour[2:]}</color></PolyStyle></Style>"
            for i, colour in enumerate(TRACK_COLOURS)
        ),
        '<Style id="zone"><LineStyle><color>ff0000ff</color></LineStyle>'
        "<PolyStyle><color>600000ff</color></PolyStyle></Style>",
    ]
    for number, track in enumerate(tracks):
        lines += _track(track, f"#track{number % len(TRACK_COLOURS)}")
    if zones:
        lines += ["<Folder>", "<name>no-fly zones</name>"]
        for zone in zones:
            lines += _zone(zone, outline_deg(zone, frame), top_m)
        lines.append("</Folder>")
    return "\n".join([*lines, "</Document>", "</kml>"]) + "\n"


def _text(words: str) -> str:
    return escape(_NOT_XML.sub("\ufffd", words))


def _coordinates(lat_deg: Floats, lon_deg: Floats, height_m: Floats) -> str:
    return " ".join(_place(*p) for p in np.stack([lat_deg, lon_deg, height_m], axis=-1).tolist())


def _place(lat_deg: float, lon_deg: float, height_m: float) -> str:
    return f"{lon_deg:.7f},{lat_deg:.7f},{height_m:.2f}"


def _track(track: Track, style: str) -> Iterable[str]:
    name = _text(track.vehicle)
    yield "<Folder>"
    yield f"<name>{name}</name>"
    yield f"<Placemark><name>{name}</name><styleUrl>{style}</styleUrl>"
    yield "<LineString><extrude>1</extrude><altitudeMode>absolute</altitudeMode>"
    yield f"<coordinates>{_coordinates(track.lat_deg, track.lon_deg, track.amsl_m)}</coordinates>"
    yield "</LineString></Placemark>"
    points = zip(track.labels, track.lat_deg, track.lon_deg, track.amsl_m, strict=True)
    for label, lat, lon, amsl in points:
        if label:
            yield (
                f"<Placemark><name>{_text(label)}</name><Point><altitudeMode>absolute</altitudeMode>"
                f"<coordinates>{_place(lat, lon, amsl)}</coordinates></Point></Placemark>"
            )
    yield "</Folder>"


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


def _limit(key: str, level: Level | None, without: str) -> str:
    """The level in words that `mission_file` reads: a zone without end is drawn with one, and must not be read so."""
    words = without if level is None else f"{float(level.value_m)!r} m {level.datum.upper()}"
    return f'<Data name="{key}"><value>{words}</value></Data>'


def _face(ring: Floats, level: Level, *, solid: bool) -> str:
    closed = np.vstack([ring, ring[:1]])
    heights = np.full(len(closed), level.value_m)
    mode = "absolute" if level.datum == "amsl" else "relativeToGround"
    return (
        f"<Polygon><extrude>{int(solid)}</extrude><altitudeMode>{mode}</altitudeMode>"
        f"<outerBoundaryIs><LinearRing><coordinates>{_coordinates(closed[:, 0], closed[:, 1], heights)}</coordinates>"
        "</LinearRing></outerBoundaryIs></Polygon>"
    )
