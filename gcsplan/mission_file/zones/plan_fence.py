"""The fence of a `.plan`: its exclusion areas are no-fly zones, its inclusion areas are areas to stay in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError, Mistake
from gcsplan.mavlink.files.plan_fence import FENCE_KEYS, FENCE_VERSION, fence_items, unread_keys
from gcsplan.mavlink.mission.commands import CIRCLE_IN, CIRCLE_OUT, POLYGON_IN
from gcsplan.mission_file.zones.draft import Bounds, circle, polygon
from gcsplan.mission_file.zones.file import ZoneFile
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.degree_shapes import unwrapped


def read_plan_fence(path: Path, whole: Any) -> ZoneFile:
    """The areas of a plan's fence, from its JSON. Raises InputError if there is none, or if some of it is not read.

    A fence has no heights: its areas have all.
    """
    found = ZoneFile(path)
    fence = whole.get("geoFence") if isinstance(whole, dict) else None
    where = f"{path}: geoFence"
    if others := unread_keys(fence, FENCE_KEYS, FENCE_VERSION, "geoFence"):
        raise InputError(f"not read: {others}; open the file in QGroundControl and save it again", where=where)
    try:
        items = list(fence_items(fence, "geoFence", found.own_notes))
    except InputError as why:
        raise InputError.of([Mistake(f"{path}: {p.where}", p.message) for p in why.problems]) from None
    if not items:
        raise InputError("the plan has no fence; draw one in QGroundControl, and save it", where=where)
    inside = 0
    while items:
        first, before = items[0], len(found.problems)
        name, is_circle = f"{path.stem}[{len(found.zones)}]", first.command in (CIRCLE_IN, CIRCLE_OUT)
        at = f"{where}: area {len(found.zones) + 1}"
        count = 1 if is_circle else int(first.params[0])
        places = [(item.lat_deg, item.lon_deg) for item in items[:count]]
        if is_circle:
            draft = circle(name, at, places[0], float(first.params[0]), Bounds(), found.problems)
        else:
            ring = [(float(lat), float(lon)) for lon, lat in unwrapped(places, places[0][1])]
            draft = polygon(name, at, ring, Bounds(), found.problems)
        is_inside = first.command in (CIRCLE_IN, POLYGON_IN)
        inside += is_inside
        found.add(draft and replace(draft, keep_in=is_inside, kept_by=str(path)), [])
        if is_inside:
            found.refuse_since(before)
        items = items[count:]
    if inside > 1:
        found.own_notes.append(Note("fence_areas_joined", count=inside))
    return found
