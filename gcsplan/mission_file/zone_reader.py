"""Zones from a file of either format, GeoJSON or KML, chosen by its name."""

from __future__ import annotations

from pathlib import Path

from gcsplan.errors import InputError
from gcsplan.mission_file.zone_file import ZoneFile
from gcsplan.mission_file.zone_geojson import read_geojson
from gcsplan.mission_file.zone_kml import read_kml

MAX_BYTES = 20_000_000


def read_zones(path: Path, *, where: str) -> ZoneFile:
    """The zones of a .geojson, .json or .kml file.

    ``where`` is the key that the zones belong to. Mistakes in single features are collected in ``problems``; a file
    that cannot be read at all raises InputError.
    """
    kind = path.suffix.lower()
    if kind not in (".geojson", ".json", ".kml"):
        hint = " (unpack a .kmz first: it is a zip of a .kml)" if kind == ".kmz" else ""
        raise InputError(f"zones are read from .geojson, .json and .kml files, given {path.name}{hint}", where=where)
    data = _bytes(path, where)
    if kind == ".kml":
        return read_kml(path, data)
    return read_geojson(path, data)


def _bytes(path: Path, where: str) -> bytes:
    try:
        if not path.is_file():
            raise InputError(f"{path} is not there (paths are relative to the mission file)", where=where)
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise InputError(f"{path} has {size} bytes, more than {MAX_BYTES}; simplify or split it", where=where)
        return path.read_bytes()
    except (OSError, ValueError) as why:
        if isinstance(why, InputError):
            raise
        raise InputError(f"{path} cannot be read: {why}", where=where) from None
