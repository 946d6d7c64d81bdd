"""The route of a mission from somebody's file: where it begins, which places it passes, and where it ends."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from gcsplan.errors import InputError
from gcsplan.mavlink.files.file_items import HAS_PLACE
from gcsplan.mavlink.mission.commands import (
    LAND,
    SPLINE_WAYPOINT,
    TAKEOFF,
    VTOL_TAKEOFF,
    WAYPOINT,
    command_name,
    is_nav,
)
from gcsplan.mavlink.mission.mission import NO_POSITION, Mission
from gcsplan.mission_file.values.schema import MOST_VIAS

TAKE_OFFS = (TAKEOFF, VTOL_TAKEOFF)
FINAL_ITEMS = (LAND,)
SAME_E7 = 10
"""Places that differ by no more than this, in 1e-7 of a degree, are one: about a decimetre."""

RoutePlace = tuple[float, float]


@dataclass(frozen=True, slots=True)
class FileRoute:
    """Places in degrees; ``start`` is None if the file has no home. ``left_out`` names the rest."""

    start: RoutePlace | None
    via: tuple[RoutePlace, ...]
    goal: RoutePlace
    left_out: tuple[str, ...]


def route_of(mission: Mission, where: str) -> FileRoute:
    """The route of a mission's items: every place that it flies to, once in a row. Raises InputError without one."""
    home = mission.home
    places: list[tuple[int, int]] = []
    others: Counter[str] = Counter()
    for item in mission.items:
        flown = is_nav(item.command) and item.command in HAS_PLACE and item.frame != NO_POSITION
        if item.command in TAKE_OFFS:
            continue  # it leaves from the start
        if not flown or not (item.x or item.y):
            if item.command not in FINAL_ITEMS:
                others[command_name(item.command)] += 1
            continue
        if item.command not in (WAYPOINT, SPLINE_WAYPOINT, *FINAL_ITEMS):
            others[command_name(item.command)] += 1  # its place is passed, and nothing more
        elif item.command not in FINAL_ITEMS and item.params[0] > 0.0:
            others["hold"] += 1
        if not places or max(abs(item.x - places[-1][0]), abs(item.y - places[-1][1])) > SAME_E7:
            places.append((item.x, item.y))
    if not places:
        raise InputError("no item flies to a place, so there is no route to plan", where=where)
    if len(places) - 1 > MOST_VIAS:
        raise InputError(f"the route passes {len(places) - 1} places, more than {MOST_VIAS}: split it", where=where)
    degrees = [(lat / 1e7, lon / 1e7) for lat, lon in places]
    start = None if home.lat_e7 == home.lon_e7 == 0 else (home.lat_e7 / 1e7, home.lon_e7 / 1e7)
    left_out = tuple(name if count == 1 else f"{count} × {name}" for name, count in others.items())
    return FileRoute(start, tuple(degrees[:-1]), degrees[-1], left_out)
