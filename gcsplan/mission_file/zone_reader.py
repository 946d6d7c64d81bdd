"""Zones from a file of any format, chosen by its name, and in JSON by its members.

Published formats are known likewise: OpenAir by its name, the others by members that no other format has.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError
from gcsplan.mission_file.memory_files import copied, geojson_bytes
from gcsplan.mission_file.published.ed269 import is_ed269, is_ed269_geojson, read_ed269, read_ed269_geojson
from gcsplan.mission_file.published.ed318 import is_ed318, read_ed318
from gcsplan.mission_file.published.openaip import is_openaip, read_openaip
from gcsplan.mission_file.published.openair import read_openair
from gcsplan.mission_file.published.policy import Policy
from gcsplan.mission_file.zones.contents import load_json, require_wgs84, sent_in_part, unpack
from gcsplan.mission_file.zones.csv import read_csv
from gcsplan.mission_file.zones.fence import is_fence, read_fence
from gcsplan.mission_file.zones.file import OnBad, ZoneFile
from gcsplan.mission_file.zones.geojson import read_geojson
from gcsplan.mission_file.zones.kml import read_kml
from gcsplan.mission_file.zones.plan_fence import read_plan_fence
from gcsplan.plugins import ZONE_READERS, failing
from gcsplan.world.terrain.input_files import (
    FENCE_ZONES,
    JSON_ZONES,
    OPENAIR_ZONES,
    VECTOR_ZONES,
    ZONE_FILES,
    absent,
    tell_file,
)

PLAN = ".plan"

MAX_ZONE_BYTES = 20_000_000
"""Most bytes of a file, and of what is unpacked from one."""

TEXT_READERS: dict[str, Callable[[Path, bytes], ZoneFile]] = {
    ".kml": read_kml, ".csv": read_csv, **dict.fromkeys((*FENCE_ZONES, *OPENAIR_ZONES), read_fence),
}  # fmt: skip
"""The reader of each ending of text other than JSON."""


def read_zones(
    path: Path,
    *,
    where: str,
    radius_m: float | None = None,
    buffer_m: float | None = None,
    layer: str | None = None,
    policy: Policy | None = None,
    keep_in: bool = False,
    data: bytes | None = None,
) -> ZoneFile:
    """The zones of a file in any of the formats; with ``keep_in`` they become areas to stay in, without their holes.

    ``where`` is the key that the zones belong to, ``radius_m`` the radius of points and ``buffer_m`` the half-width
    around lines that have none of their own, ``layer`` the only layer to read, and ``policy`` says which published
    zones are no-fly. ``data``: the content of a file that lies on no disk; ``path`` is then its name in messages.

    Mistakes in single features are collected in ``problems``; a file that cannot be read at all raises InputError.
    """
    kind = path.suffix.lower()
    own = (*ZONE_FILES, *FENCE_ZONES, PLAN, *OPENAIR_ZONES)
    added = None if kind in own else ZONE_READERS.get(kind)
    if added is None and kind not in own:
        known = f"{', '.join((*ZONE_FILES, *FENCE_ZONES, PLAN))} and OpenAir ({', '.join(OPENAIR_ZONES)}) files"
        raise InputError(f"zones are read from {known}, given {path.name}", where=where)
    if layer is not None and kind not in VECTOR_ZONES:
        raise InputError(f"a {kind} file has no layers; leave `layer` out", where=where)
    policy = policy or Policy()
    data = _bytes(path, where) if data is None else _few(path, len(data), data, where)
    if added is not None:  # what it makes is read as a file of GeoJSON
        kind, data = JSON_ZONES[0], geojson_by(added, path, data)
    whole = load_json(path, data) if kind in (*JSON_ZONES, PLAN) else None
    require_wgs84(whole, path, json_format(whole)[0])
    in_part = sent_in_part(whole, path)
    found = None if kind == PLAN else read_published(path, data, whole, policy)
    if found is not None and keep_in:
        words = f"{path.name} is a file of an authority, whose zones are no-fly: draw the area that may be flown"
        raise InputError(f"{words} as a polygon, here or in a .geojson or .kml", where=where)
    on_bad: OnBad = policy.on_bad or ("refuse" if found is None else "strict")
    if found is None:
        for key in policy.keys:
            words = f"{path.name} is no file of an authority (OpenAir, ED-269, ED-318, openAIP), and has no {key}"
            raise InputError(words, where=f"{policy.where}.{key}")
        found = read_geojson(path, whole) if kind in JSON_ZONES else _read(path, kind, data, layer, whole)
        ignore_at = policy.place_of("ignore", "--ignore")
        found.give_sizes(radius_m, buffer_m, policy.ignore, ignore_at, skip=on_bad == "skip")
    elif policy.ignore and not policy.by_options:
        words = "is for files of your own; an authority's zones without a shape are left out by on_bad: skip"
        raise InputError(words, where=f"{policy.where}.ignore")
    found.refusals[:0] = in_part
    skipped = "--on-bad skip" if policy.by_options else "on_bad: skip"
    found.settle(on_bad, f"leave it out by name ({skipped})")
    found.holes = 0 if keep_in else found.holes
    return found


def geojson_by(read: Callable[[bytes], Any], path: Path, data: bytes) -> bytes:
    """The GeoJSON that the reader of another package makes of a file. Raises InputError."""
    where = f"{path}: its reader"
    with failing(where):
        found = read(data)
    return copied(where, geojson_bytes, found, where)


def _read(path: Path, kind: str, data: bytes, layer: str | None, whole: Any) -> ZoneFile:
    if kind == PLAN:
        return read_plan_fence(path, whole)
    if kind == ".kmz":
        return read_kml(path, unpack(path, data, [".kml"], MAX_ZONE_BYTES)[".kml"])
    if kind in VECTOR_ZONES:
        from gcsplan.mission_file.zones.vector import read_vector  # most missions need neither it nor PROJ's database

        return read_vector(path, data, layer=layer, most_bytes=MAX_ZONE_BYTES)
    return TEXT_READERS[kind](path, data)


def _bytes(path: Path, where: str) -> bytes:
    tell_file(path)
    try:
        if not path.is_file():
            raise InputError(absent(path), where=where)
        return _few(path, path.stat().st_size, None, where)
    except (OSError, ValueError) as why:
        if isinstance(why, InputError):
            raise
        raise InputError(f"{path} cannot be read: {why}", where=where) from None


def _few(path: Path, size: int, data: bytes | None, where: str) -> bytes:
    """``data``, or the bytes of the file; InputError for more than `MAX_ZONE_BYTES`."""
    if size > MAX_ZONE_BYTES:
        raise InputError(f"{path} has {size} bytes, more than {MAX_ZONE_BYTES}; simplify or split it", where=where)
    return path.read_bytes() if data is None else data


_JSON_FORMATS = (
    ("ED-269", is_ed269, read_ed269), ("ED-318", is_ed318, read_ed318), ("openAIP's export", is_openaip, read_openaip),
    ("GeoJSON with the properties of ED-269", is_ed269_geojson, read_ed269_geojson),
)  # fmt: skip


def json_format(whole: Any) -> tuple[str, Callable[[Path, Any, Policy], ZoneFile] | None]:
    """The name of the format that JSON has, and the reader of a published one; None for GeoJSON."""
    return next(((name, read) for name, is_format, read in _JSON_FORMATS if is_format(whole)), ("GeoJSON", None))


def read_published(path: Path, data: bytes, whole: Any, policy: Policy) -> ZoneFile | None:
    """The zones of a published file; None if it has none of these formats. ``whole`` is what its JSON holds."""
    if path.suffix.lower() in OPENAIR_ZONES and not is_fence(data):
        return read_openair(path, data, policy)
    read = json_format(whole)[1]
    return None if read is None else read(path, whole, policy)
