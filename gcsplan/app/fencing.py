"""Fences of missions: made of a world's zones, held against the mission itself, uploaded before it, read back.

A fence that the mission would breach turns it round in the air. So a fence is only made after the whole of the flight
as the autopilot flies it, from the ground at the start to the ground at the goal, was found to stay outside every
area of it by the track error and the clearance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gcsplan.check.flight import follow
from gcsplan.check.judge import judge
from gcsplan.check.verdict import Finding, Verdict
from gcsplan.errors import CheckFailed, GcsplanError, InputError
from gcsplan.mavlink.build.fence import Area, Fence, areas_of, fence_of
from gcsplan.mavlink.mission.autopilots import manner
from gcsplan.mavlink.mission.mission import FENCE, Mission, MissionItem
from gcsplan.vehicle import Vehicle
from gcsplan.world.airspace import Airspace
from gcsplan.world.world import World
from gcsplan.world.zones import Circle

if TYPE_CHECKING:
    from gcsplan.app.jobs import Job
    from gcsplan.mavlink.link import session
    from gcsplan.mavlink.link.link import Link
    from gcsplan.mavlink.link.results import UploadResult

ROUNDING_M = 0.15

__all__ = ["Fence", "breaches", "fence_for", "not_fenced", "own_fence", "upload_fences", "with_fences"]


def fence_for(
    mission: Mission, vehicle: Vehicle, world: World, *, infinite: bool = False, rtl_rel_home_m: float | None = None
) -> Fence:
    """The fence that the world's zones make for ``mission``; see `fence_of` for ``infinite`` and for what is told.

    Raises CheckFailed where the mission itself would breach it, naming zone and item; InputError where the autopilot
    cannot keep it.
    """
    fence = fence_of(world.airspace.zones, world.frame, mission.autopilot, infinite=infinite)
    try:
        areas = areas_of([manner(mission.autopilot).stored(item) for item in fence.items], world.frame)
    except InputError as error:  # what we made ourselves, as it is stored
        raise GcsplanError(f"the fence would not be stored as it was made: {error}") from error
    named = [replace(a, zone=replace(a.zone, name=z.name)) for a, z in zip(areas, fence.zones, strict=True)]
    found = breaches(named, mission, vehicle, world, rtl_rel_home_m=rtl_rel_home_m)
    if found:
        lines = "\n".join(f"  {f.message}" for f in found)
        cure = (
            "leave out --fence-infinite: those zones have a height, and a fence has none"
            if infinite
            else "the vehicle would turn round in the air; plan again, or send no fence"
        )
        raise CheckFailed(
            f"the mission itself would breach this fence:\n{lines}\n{cure}", where=vehicle.name, reason="fence"
        )
    return fence


def breaches(
    areas: Sequence[Area], mission: Mission, vehicle: Vehicle, world: World, *, rtl_rel_home_m: float | None = None
) -> list[Finding]:
    """Where the flight of ``mission`` comes into an exclusion area, or out of an inclusion area, of a fence.

    The flight is widened by its track error and keeps the horizontal clearance, as from zones. An aircraft must be
    inside each inclusion area.
    """
    out = [a.zone for a in areas if not a.inclusion]
    found: list[Finding] = []
    if out:
        fenced = World(world.frame, Airspace(world.airspace.surface, out, scale=world.airspace.scale))
        # A fence is a zone rounded to what its items can say; that much may be taken from the clearance.
        clearance_m = max(0.0, vehicle.limits.horizontal_clearance_m - ROUNDING_M)
        craft = replace(vehicle, limits=replace(vehicle.limits, horizontal_clearance_m=clearance_m))
        verdict = judge(mission, craft, fenced, rtl_rel_home_m=rtl_rel_home_m)
        found += [
            replace(f, kind="fence", message=f.message.replace("inside no-fly zone", "inside the fence's area"))
            for f in verdict.findings
            if f.kind == "zone"
        ]
    inside = [a for a in areas if a.inclusion]
    if inside:
        stored = replace(mission, items=tuple(manner(mission.autopilot).stored(i) for i in mission.items))
        flight = follow(stored, vehicle, world.ground_amsl, rtl_rel_home_m=rtl_rel_home_m)
        for area in inside:
            for s in flight.stretches:
                reach_m = (vehicle.limits.track_error_m + s.reach_m) * world.airspace.scale
                ends = world.frame.to_plane(np.array([s.start[0], s.end[0]]), np.array([s.start[1], s.end[1]]))
                short_m = _outside_m(area, ends, reach_m)
                if short_m > 0.0:
                    lat, lon, amsl = s.end
                    words = f"item {s.seq} ({s.kind}): leaves the fence's area “{area.zone.name}” (by {short_m:.1f} m)"
                    found.append(
                        Finding(s.seq, "fence", words, lat, lon, amsl, -short_m, 0.0, short_m, "m", area.zone.name)
                    )
                    break
    return found


def _outside_m(area: Area, ends: np.ndarray[tuple[int, ...], np.dtype[np.float64]], reach_m: float) -> float:
    """How far a line, widened by ``reach_m``, goes beyond an area's border; 0 where it stays inside."""
    shape = area.zone.shape
    if isinstance(shape, Circle):  # a disc is convex: the ends decide
        away = np.hypot(*(ends - [shape.east_m, shape.north_m]).T) + reach_m - shape.radius_m
        return max(0.0, float(away.max()))
    import shapely

    polygon, line = shapely.Polygon(shape.vertices), shapely.LineString(ends)
    beyond = line.difference(polygon)
    if (not beyond.is_empty and beyond.length > 0.0) or not polygon.covers(line):
        return reach_m + float(max(polygon.distance(shapely.Point(p)) for p in shapely.get_coordinates(beyond)))
    return max(0.0, reach_m - float(polygon.exterior.distance(line)))


def own_fence(
    items: Sequence[MissionItem], verdict: Verdict, vehicle: Vehicle, world: World
) -> tuple[Verdict, tuple[str, ...]]:
    """``verdict`` with what a file's own fence has against the mission, and what is to be said of that fence."""
    if not items:
        return verdict, ()
    try:
        areas = areas_of(items, world.frame)
    except InputError as error:
        return replace(verdict, not_judged=(*verdict.not_judged, f"the file's fence: {error.message}")), ()
    out = sum(not a.inclusion for a in areas)
    words = f"the file brings a fence of its own: {out} area(s) to stay out of, {len(areas) - out} to stay inside of"
    # A fence acts where it is: it is the errors that may carry the aircraft into it, not the clearance from zones.
    plain = replace(vehicle, limits=replace(vehicle.limits, horizontal_clearance_m=0.0))
    found = breaches(areas, verdict.mission, plain, world) if verdict.legs else []
    return replace(verdict, findings=(*verdict.findings, *found)), (words,)


def with_fences(jobs: Sequence[Job], *, infinite: bool = False) -> tuple[list[Job], list[tuple[str, str]]]:
    """``jobs``, each with the fence that its world's zones make for its mission; and notes, (name, words) each.

    Raises what `fence_for` raises, and InputError for a mission that was not checked: nobody knows what it would
    breach.
    """
    fenced: list[Job] = []
    notes: list[tuple[str, str]] = []
    for job in jobs:
        if job.vehicle is None or job.world is None:
            raise InputError("a fence is made of the zones that a mission was checked with, and this one was not")
        fence = fence_for(job.mission, job.vehicle, job.world, infinite=infinite, rtl_rel_home_m=job.rtl_rel_home_m)
        notes += _notes(job.name, fence)
        fenced.append(replace(job, fence=fence))
    return fenced, notes


def _notes(name: str, fence: Fence) -> list[tuple[str, str]]:
    notes = [(name, words) for words in fence.told]
    if not fence.items:
        notes.append((name, "no zone can be told as a fence: the fence on board is left as it is"))
    return notes


def upload_fences(
    jobs: Sequence[Job], links: Mapping[str, Link], options: session.Options
) -> dict[str, UploadResult | GcsplanError]:
    """Send each job's fence over the link of its URL, all at once, read them back, compare; results by job's name.

    To be done before the missions go out: an autopilot may refuse a mission for an old fence. Vehicles without a
    fence, or with an empty one, are left as they are and are not in the result; one vehicle's failure leaves the
    others standing.
    """
    from gcsplan.mavlink.link import session

    def order_of(job: Job, fence: Fence) -> session.ListOrder:
        simulated = job.url == "sim"
        own = replace(options, simulated=simulated, listen_s=0.0 if simulated else options.listen_s)
        mission = job.mission
        return session.ListOrder(links[job.url], mission.sysid, fence.items, mission.autopilot, job.name, own)

    orders = [order_of(j, j.fence) for j in jobs if j.fence is not None and j.fence.items and j.url in links]
    return dict(zip([o.name for o in orders], session.upload_lists(orders, FENCE), strict=True))


def not_fenced(ended: Mapping[str, UploadResult | GcsplanError]) -> dict[str, GcsplanError]:
    """Those whose fence is not proved to be on board, and why: their missions are not to be sent."""
    errors = {name: r if isinstance(r, GcsplanError) else r.error() for name, r in ended.items()}
    return {
        name: type(e)(f"the mission was not sent, for its fence is not on board: {e.message}", where=e.where,
                      reason=e.reason)
        for name, e in errors.items() if e is not None
    }  # fmt: skip
