"""Start, via points and goal of one vehicle, checked against the ground and the zones."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from gcsplan.errors import Mistake
from gcsplan.mission_file.request import VehicleRequest
from gcsplan.mission_file.scene import MissionPlace, zone_around
from gcsplan.mission_file.values.schema import VehicleKeys
from gcsplan.vehicle import Vehicle
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Zone

ON_GROUND_M = 0.5
"""An ``up_m`` within this distance of the ground, m, counts as on the ground."""

ELSEWHERE = "; move it, or make the zone smaller"


@dataclass(frozen=True, slots=True)
class Terminals:
    """One vehicle's keys and places; None where they are wrong."""

    keys: VehicleKeys
    vehicle: Vehicle | None
    start: MissionPlace | None
    goal: MissionPlace | None
    via: tuple[MissionPlace | None, ...]

    @property
    def all(self) -> list[MissionPlace]:
        """The places that are right so far."""
        return [p for p in (self.start, self.goal, *self.via) if p is not None]


@dataclass(frozen=True, slots=True)
class _End:
    """A start or goal: east, north, ground, and its altitude if it is above the ground."""

    at: tuple[float, float, float]
    amsl_m: float | None


def make_request(
    terminals: Terminals,
    frame: Frame,
    surface: Surface,
    zones: Sequence[Zone],
    good: Collection[MissionPlace],
    problems: list[Mistake],
) -> VehicleRequest | None:
    """A vehicle's request over the ground; None, and ``problems``, if a place is on unknown ground or in a zone.

    Only places in ``good`` are checked; the others are in ``problems`` already.
    """
    before = len(problems)
    keys, start, goal = terminals.keys, None, None
    if terminals.start in good and terminals.start is not None:
        start = _end("start", terminals.start, frame, surface, zones, keys.takeoff_agl_m, problems)
    if terminals.goal in good and terminals.goal is not None:
        goal = _end("goal", terminals.goal, frame, surface, zones, keys.approach_agl_m, problems)
    via = [_via(p, frame, surface, zones, problems) for p in terminals.via if p is not None and p in good]
    if len(problems) > before or terminals.vehicle is None or terminals.start is None or terminals.goal is None:
        return None
    if start is None or goal is None:
        return None
    return VehicleRequest(
        vehicle=terminals.vehicle,
        start=start.at,
        goal=goal.at,
        start_deg=terminals.start.in_degrees(frame),
        goal_deg=terminals.goal.in_degrees(frame),
        takeoff_agl_m=keys.takeoff_agl_m,
        approach_agl_m=keys.approach_agl_m,
        via=tuple(v for v in via if v is not None),
        end=keys.end,
        rtl_rel_home_m=keys.rtl_rel_home_m,
        return_route=keys.return_route,
        takeoff_heading_deg=keys.takeoff_heading_deg,
        climb_out=keys.climb_out,
        depart_window_s=keys.depart_window_s,
        start_amsl_m=start.amsl_m,
        goal_amsl_m=goal.amsl_m,
    )


def _ground(
    place: MissionPlace, frame: Frame, surface: Surface, problems: list[Mistake]
) -> tuple[float, float, float] | None:
    """East, north and ground; None, and a problem, if the ground is unknown."""
    east, north = place.in_plane(frame)
    ground_m = float(surface.ground_at(east, north))
    if math.isnan(ground_m):
        words = "lies on a void or at the edge of the DEM, where the ground is unknown; give a DEM with data here"
        problems.append(Mistake(place.where, words))
        return None
    return east, north, ground_m


def _end(
    what: str,
    place: MissionPlace,
    frame: Frame,
    surface: Surface,
    zones: Sequence[Zone],
    agl_m: float | None,
    problems: list[Mistake],
) -> _End | None:
    at = _ground(place, frame, surface, problems)
    if at is None:
        return None
    east, north, ground_m = at
    above_m = place.agl_m or 0.0
    if place.up_m is not None:
        above_m = frame.amsl_m + place.up_m - ground_m
        if above_m < -ON_GROUND_M:
            words = f"lies {-above_m:.2f} m under ground, which is at {ground_m:.2f} m AMSL"
            problems.append(Mistake(f"{place.where}.up_m", words))
            return None
        above_m = above_m if above_m > ON_GROUND_M else 0.0
    if above_m > 0.0 and agl_m is not None:
        key = "takeoff_agl_m" if what == "start" else "approach_agl_m"
        problems.append(Mistake(place.where, f"hangs {above_m:g} m above ground: leave {key} out"))
    zone = zone_around(zones, east, north, ground_m + above_m, ground_m)
    if zone is not None:
        problems.append(Mistake(place.where, f"the {what} lies {_in_zone(zone, east, north)}"))
    return _End(at, ground_m + above_m if above_m > 0.0 else None)


def _in_zone(zone: Zone, east_m: float, north_m: float) -> str:
    """Where a place lies that is inside a zone, and what to do about it."""
    if zone.outside is None:
        return f"inside the no-fly zone {zone.name!r}{ELSEWHERE}"
    near = min(zone.outside.areas, key=lambda area: area.distance_m(east_m, north_m))
    off_m = near.distance_m(east_m, north_m)
    how = (
        f"{off_m:.1f} m "
        if 0.0 < off_m < math.inf
        else "below its floor or above its ceiling, "
        if off_m == 0.0
        else ""
    )
    many = " and outside of all others" if len(zone.outside.areas) > 1 else ""
    return f"{how}outside of the keep-in area {near.name!r}{many}: move it inside, or draw the area larger"


def _via(
    place: MissionPlace, frame: Frame, surface: Surface, zones: Sequence[Zone], problems: list[Mistake]
) -> tuple[float, float, float | None] | None:
    at = _ground(place, frame, surface, problems)
    if at is None:
        return None
    east, north, ground_m = at
    agl_m = place.agl_m if place.up_m is None else frame.amsl_m + place.up_m - ground_m
    if agl_m is None:
        # Any height is acceptable, unless a zone occupies all heights.
        walls = [z for z in zones if z.floor is None and z.ceiling is None]
        zone = zone_around(walls, east, north, ground_m, ground_m)
    else:
        zone = zone_around(zones, east, north, ground_m + agl_m, ground_m)
    if zone is not None:
        problems.append(Mistake(place.where, f"lies {_in_zone(zone, east, north)}"))
    return east, north, agl_m
