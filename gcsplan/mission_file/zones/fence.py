"""Zones from the fences of Mission Planner and MAVProxy: ``.waypoints`` with the items of a fence, ``.fen``, ``.poly``.

Rows of "QGC WPL" have NAV_FENCE commands; Mission Planner writes home before them, MAVProxy does not. A ``.fen``, and a
fence of older MAVProxy (``.txt``), has a line of latitude and longitude for the return point, then one for each corner
of the polygon that the aircraft stays in, and the first corner again. A ``.poly`` is a drawn polygon, without a return
point and without a meaning of its own. A fence has no heights.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from gcsplan.errors import InputError, Mistake
from gcsplan.mavlink.files.file_items import RawItem
from gcsplan.mavlink.files.waypoints_file import raw_items
from gcsplan.mavlink.mission.commands import (
    CIRCLE_IN,
    CIRCLE_OUT,
    FENCE_RETURN_POINT,
    POLYGON_IN,
    POLYGON_OUT,
    RALLY_POINT,
    WAYPOINT,
)
from gcsplan.mission_file.zones.attributes import ZoneStatements
from gcsplan.mission_file.zones.contents import decoded
from gcsplan.mission_file.zones.draft import Bounds
from gcsplan.mission_file.zones.file import ZoneFile
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.degree_shapes import Corner

_PAIR_PART = re.compile(r"[-+]?\d{1,3}(?:[.,]\d{1,20})?", re.ASCII)
_LONGEST_PAIR = 1000
_HOME = (0, WAYPOINT)
"""Commands of the row with home: Mission Planner writes 0 if it is unknown."""

_KINDS = {POLYGON_IN: True, CIRCLE_IN: True, POLYGON_OUT: False, CIRCLE_OUT: False}
"""The commands of areas, and whether the aircraft stays inside."""


def is_fence(data: bytes) -> bool:
    """Whether a text is a fence of these programs: its first line that is no comment is their header, or a place."""
    try:
        lines = decoded(data[:20_000]).splitlines()
    except UnicodeDecodeError:
        return False
    first = next((line for line in lines if line.strip() and not line.lstrip().startswith("#")), "")
    return first.split()[:2] == ["QGC", "WPL"] or _pair(first) is not None


def read_fence(path: Path, data: bytes) -> ZoneFile:
    """The areas of a fence, or of one polygon. Raises InputError if the file is none."""
    try:
        text = decoded(data)
    except UnicodeDecodeError as why:
        raise InputError(f"the file must be UTF-8 text, byte {why.start} is not", where=str(path)) from None
    found = ZoneFile(path)
    if text.split(maxsplit=2)[:2] == ["QGC", "WPL"]:
        _areas(found, _fence_rows(path, text))
        return found
    corners = [corner for corner in _corners(found, text) if corner is not None]
    if found.problems:
        return found
    if path.suffix.lower() != ".poly":
        _returns(found, 1)
        corners = corners[1:]
        if len(corners) < 4 or corners[0] != corners[-1]:
            words = "a fence has a return point, three corners or more, and the first corner again; is the file whole?"
            raise InputError(words, where=str(path))
    add_area(found, path.stem, str(path), corners, inside=path.suffix.lower() != ".poly")
    return found


def _corners(found: ZoneFile, text: str) -> Iterator[Corner | None]:
    """Latitude and longitude of each line; None, and a problem, for a line that has none."""
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1)]
    lines = [(number, line) for number, line in lines if line and not line.startswith("#")]
    if lines and lines[-1][1] == "END":
        words = "this is OpenStreetMap's .poly, with longitudes first: convert it to GeoJSON (ogr2ogr a.geojson FILE)"
        raise InputError(words, where=str(found.path))
    if not lines:
        raise InputError("the file holds no place", where=str(found.path))
    for number, line in lines:
        pair = _pair(line)
        if pair is None:
            words = f"a line holds latitude and longitude, as `46.02 14.47`, given {line[:60]!r}"
            found.problems.append(Mistake(f"{found.path}: line {number}", words))
            return
        yield pair


def _pair(line: str) -> Corner | None:
    """Latitude and longitude, also with the decimal commas that Mission Planner writes in some countries."""
    if len(line) > _LONGEST_PAIR:
        return None
    parts = [part for part in re.split(r"[\s;]+", line.strip()) if part]
    if len(parts) == 1 and line.count(",") == 1:
        parts = line.strip().split(",")
    parts = [part.rstrip(",") if len(parts) == 2 and i == 0 else part for i, part in enumerate(parts)]
    if len(parts) != 2 or not all(_PAIR_PART.fullmatch(part) for part in parts):
        return None
    lat, lon = (float(part.replace(",", ".")) for part in parts)
    return lat, lon


def _fence_rows(path: Path, text: str) -> list[tuple[int, RawItem]]:
    """The rows of a fence with their lines, without home. Raises InputError for a file that holds another list."""
    rows = raw_items(text, str(path))
    if rows and rows[0][1].command in _HOME:
        rows = rows[1:]
    others = {item.command for _, item in rows} - {*_KINDS, FENCE_RETURN_POINT}
    if not rows or others == {item.command for _, item in rows}:
        what = "rally points" if others == {RALLY_POINT} else "a mission" if rows else "nothing"
        words = f"the file holds {what}, and no fence"
        raise InputError(f"{words}; check takes a mission as FILE, without --zones", where=str(path))
    return rows


def _areas(found: ZoneFile, rows: Sequence[tuple[int, RawItem]]) -> None:
    """Add the areas of a fence: a row for each circle, and as many for each polygon as its first says."""
    k = number = returns = 0
    while k < len(rows):
        line, first = rows[k]
        where = f"{found.path}: line {line}"
        if first.command == FENCE_RETURN_POINT:
            returns += 1
            k += 1
            continue
        number += 1
        name = f"{found.path.stem} {number}"
        if first.command in (CIRCLE_IN, CIRCLE_OUT):
            add_area(
                found, name, where, [(first.x, first.y)], inside=_KINDS[int(first.command)], radius_m=first.params[0]
            )
            k += 1
            continue
        same = [item for _, item in rows[k:]]
        same = same[: next((i for i, item in enumerate(same) if item.command != first.command), len(same))]
        count = int(first.params[0]) if 3 <= first.params[0] <= len(same) else 0
        if first.command not in _KINDS:
            found.problems.append(Mistake(where, f"command {first.command:g} is none of a fence"))
            k += 1
        elif not count or any(item.params[0] != first.params[0] for item in same[:count]):
            words = (
                f"a polygon of {first.params[0]:g} corners needs as many rows of command {first.command:g} that say so"
            )
            before = len(found.problems)
            found.problems.append(Mistake(where, f"{words}; {len(same)} follow each other. Is the file whole?"))
            if _KINDS[int(first.command)]:
                found.refuse_since(before)
            k += len(same)
        else:
            corners = [(item.x, item.y) for item in same[:count]]
            add_area(found, name, where, corners, inside=_KINDS[int(first.command)])
            k += count
    _returns(found, returns)
    note_joined(found)


def _returns(found: ZoneFile, count: int) -> None:
    if count:
        found.own_notes.append(Note("fence_return_points_unused", count=count))


def note_joined(found: ZoneFile) -> None:
    """Note that a flight may be in any of several inclusion areas."""
    inside = sum(draft.keep_in for draft in found.zones)
    if inside > 1:
        found.own_notes.append(Note("fence_areas_joined", count=inside))


def add_area(
    found: ZoneFile, name: str, where: str, corners: list[Corner], *, inside: bool, radius_m: float | None = None
) -> None:
    """Add an area of a fence; one that the aircraft stays ``inside`` is a keep-in area, and is never left out."""
    before = len(found.problems)
    stated = ZoneStatements(name, radius_m, Bounds(), (), False, keep_in=inside)
    if radius_m is None:
        found.add_ring(stated, name, where, corners, "")
    else:
        found.add_circle(stated, name, where, corners[0])
    if inside:
        found.refuse_since(before)
