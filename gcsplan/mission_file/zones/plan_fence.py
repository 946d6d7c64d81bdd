"""The fence of a `.plan`: its exclusion areas are no-fly zones, its inclusion areas are areas to stay in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gcsplan.errors import InputError, Mistake
from gcsplan.mavlink.files.plan_fence import FENCE_KEYS, FENCE_VERSION, RESAVE, fence_items, unread_keys
from gcsplan.mavlink.mission.commands import CIRCLE_IN, CIRCLE_OUT, POLYGON_IN
from gcsplan.mission_file.zones.fence import add_area, note_joined
from gcsplan.mission_file.zones.file import ZoneFile
from gcsplan.world.geodesy.degree_shapes import unwrapped


def read_plan_fence(path: Path, whole: Any) -> ZoneFile:
    """The areas of a plan's fence, from its JSON. Raises InputError if there is none, or if some of it is not read.

    A fence has no heights: its areas have all.
    """
    found = ZoneFile(path)
    fence = whole.get("geoFence") if isinstance(whole, dict) else None
    where = f"{path}: geoFence"
    if others := unread_keys(fence, FENCE_KEYS, FENCE_VERSION, "geoFence"):
        raise InputError(f"not read: {others}; {RESAVE}", where=where)
    try:
        items = list(fence_items(fence, "geoFence", found.own_notes))
    except InputError as why:
        raise InputError.of([Mistake(f"{path}: {p.where}", p.message) for p in why.problems]) from None
    if not items:
        raise InputError("the plan has no fence; draw one in QGroundControl, and save it", where=where)
    while items:
        first, circle = items[0], items[0].command in (CIRCLE_IN, CIRCLE_OUT)
        count = 1 if circle else int(first.params[0])
        places = [(item.lat_deg, item.lon_deg) for item in items[:count]]
        add_area(
            found, f"{path.stem}[{len(found.zones)}]", f"{where}: area {len(found.zones) + 1}",
            [(float(lat), float(lon)) for lon, lat in unwrapped(places, places[0][1])],
            inside=first.command in (CIRCLE_IN, POLYGON_IN), radius_m=float(first.params[0]) if circle else None,
        )  # fmt: skip
        items = items[count:]
    note_joined(found)
    return found
