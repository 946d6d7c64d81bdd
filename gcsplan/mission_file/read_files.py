"""What a file is that is given where a mission file belongs, and which command or key takes it."""

from __future__ import annotations

import shlex
from pathlib import Path

__all__ = ["what_else"]

VEHICLES, ZONES, TERRAIN, LOG = "vehicles", "zones", "terrain", "log"

SUFFIXES_BY_KIND = {
    VEHICLES: (".waypoints", ".plan"),
    ZONES: (".kml", ".kmz", ".geojson", ".gpkg", ".shp", ".fgb", ".csv", ".zip"),
    TERRAIN: (".tif", ".tiff", ".hgt", ".asc", ".dat"),
    LOG: (".bin", ".tlog", ".ulg"),
}

FIRST_BYTES = {
    b"QGC WPL": VEHICLES, b"II*\0": TERRAIN, b"MM\0*": TERRAIN, b"<?xml": ZONES, b"<kml": ZONES, b"PK\x03\x04": ZONES,
    b"SQLite format 3": ZONES, b"\xa3\x95": LOG,
}  # fmt: skip

MEMBERS_BY_KIND = (("fileType", VEHICLES), ("features", ZONES), ("geometry", ZONES))
"""Members of JSON by which other files are known; a mission file has none of them."""


def what_else(file: Path, raw: object = None) -> str:
    """What ``file`` is, and what takes it; empty if it may be a mission file.

    ``raw`` is its content if that could be read as YAML, whose kind counts before the name.
    """
    kind = ""
    if isinstance(raw, dict):
        kind = next((kind for member, kind in MEMBERS_BY_KIND if member in raw), "")
    else:
        try:
            with file.open("rb") as opened:
                first = opened.read(16).removeprefix(b"\xef\xbb\xbf").lstrip()
        except (OSError, ValueError):
            return ""
        kind = next((kind for begins, kind in FIRST_BYTES.items() if first.startswith(begins)), "")
        kind = kind or next((kind for kind, ends in SUFFIXES_BY_KIND.items() if file.suffix.lower() in ends), "")
    name = shlex.quote(str(file))
    return {
        VEHICLES: f"this is a mission for vehicles, not a mission file: use check (gcsplan check MISSION.yaml {name})",
        ZONES: f"this is a file of zones, not a mission file: name it in one (no_fly: [{{file: …}}]), or look at it "
        f"with gcsplan check {name} --list-zones",
        TERRAIN: f"this is a file of terrain, not a mission file: name it in one (terrain: {{dem: …}}), or begin one "
        f"with gcsplan new --dem {name}",
        LOG: f"this is a flight log, not a mission file: use fit-energy (gcsplan fit-energy {name})",
    }.get(kind, "")
