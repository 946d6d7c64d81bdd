"""The way home: the autopilot's own return, judged from every point of every leg of a mission.

Each point of a mission has its own straight line home. Parts of the mission are judged as a whole: every return from a
part lies within half its length of the return from its middle. The ground is bounded over that line widened by so much,
with the kernels and margins of the exact check (`gcsplan.world.level_lines`), and zones are compared with the region
that the returns sweep. Nothing is sampled, so a point reported as safe is safe. A point reported as unsafe is unsafe,
except: at the ends of a stretch (`refinement.SMALLEST_PART_M`), in safe gaps within a stretch that are shorter than
`COARSE_M` (`COARSEST_M` on long missions), and for what the bounds of the ground beside a line cost: the widening times
the slope there, and half a piece more on long missions over fine cells (`level_lines.step_of`). Apart from that the
lowest altitude is at most `LEVEL_M` too high.

`lowest_agl`: the lowest height of the returns above ground, at one return altitude. It counts from the ground and what
stands on it, within the track error of where a return is, at the altitudes that the autopilot may fly; the altitude
error is not taken off. The descent over home, the climb on the spot and the mission itself do not count. Parts of the
mission are split where the lowest height is until it is known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.battery import battery_home
from gcsplan.check.flight.corners import round_corners
from gcsplan.check.flight.follow import follow_in
from gcsplan.check.flight.ways_home import WaysHome
from gcsplan.check.motion.commands import LAND_STARTS
from gcsplan.check.motion.flight_state import TERRAIN_ERROR_M
from gcsplan.check.motion.project import why_unknown, with_error_of_home
from gcsplan.check.motion.return_rules import ASIDE_PARTS, RETURN_RULES, at_home_m, speed_home_m_s
from gcsplan.check.motion.stopping import circle_home_m
from gcsplan.check.motion.stretch import Flight, Place
from gcsplan.check.returns.along_mission import return_by_mission
from gcsplan.check.returns.footprint import Target, places_of_returns
from gcsplan.check.returns.obstacles import CIRCLE_ABOVE_M, GradedObstacles, alike_in_width, obstacles_of_returns
from gcsplan.check.returns.rally import Proposal, propose, returns_to
from gcsplan.check.returns.refinement import CLEAR, LEGAL, SMALLEST_PART_M, Refinement, sizes_m
from gcsplan.check.returns.return_targets import LANDS, joins_of
from gcsplan.check.returns.stretches import rel_home, stretches_of
from gcsplan.check.returns.trace import TINY_M, MissionTrace, TraceParts, trace_of
from gcsplan.check.returns.verdict import LowestAgl, ProfilePoint, WayHome
from gcsplan.check.returns.words import together_m
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission.autopilots import profile_of
from gcsplan.mavlink.mission.commands import command_name
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.mavlink.mission.return_parameters import ReturnRoute
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.wind.wording import gusts_note
from gcsplan.world import level_lines
from gcsplan.world.world import World

PROFILE_POINTS = 400
NOISE_M = 1e-3
"""Subtracted from the highest altitude, so that it does not touch what is above it, m."""

MOST_UNKNOWN = 5
"""Most stretches that are listed, from which a return that joins the mission is not known."""


def way_home(
    verdict: Verdict,
    vehicle: Vehicle,
    world: World,
    *,
    rtl_rel_home_m: float | None = None,
    terrain_error_m: float = TERRAIN_ERROR_M,
    rally: bool = True,
    route: ReturnRoute | None = None,
    points: Sequence[MissionItem] = (),
) -> WayHome:
    """Judge the return home from every point of the mission of ``verdict``.

    ``rtl_rel_home_m`` is the vehicle's return altitude above home; None: the autopilot's default. ``rally``: propose
    rally points if no altitude is clear from every point. ``route``: straight home, or to where the return joins the
    mission (`joins`); None: not given, which counts as straight home. ``points``: rally points on board. Never raises
    for a mission that is merely unsafe.
    """
    mission, rule = verdict.mission, RETURN_RULES[vehicle.autopilot]
    stored = replace(mission, items=tuple(profile_of(mission.autopilot).stored(item) for item in mission.items))
    lat, lon = mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7
    ground, unsure = world.ground_amsl(lat, lon), why_unknown(mission.home, vehicle, world)
    vehicle = with_error_of_home(vehicle, mission.home, world)
    judged_m = rule.default_rel_home_m if rtl_rel_home_m is None else rtl_rel_home_m
    flight = follow_in(world, stored, vehicle, rtl_rel_home_m=judged_m, terrain_error_m=terrain_error_m)
    if verdict.legs:
        round_corners(flight, stored, vehicle, world.frame)
    trace = trace_of(flight, vehicle, world, terrain_error_m) if verdict.legs else None
    if trace is None or math.isnan(ground) or unsure is not None:
        why = unsure or Note("mission_not_followed" if trace is None else "home_not_on_ground")
        return _not_judged(verdict, vehicle, judged_m, rtl_rel_home_m is None, (why,))
    if route == "mission":
        return _beside(points, _along_mission(verdict, vehicle, stored, flight, trace, judged_m))
    home = (lat, lon, ground)
    east, north = (float(x) for x in world.frame.to_plane(lat, lon))
    target = Target(east, north, ground, ground)
    level = ground + judged_m
    refinement = refinement_of(trace, target, vehicle, level)
    lowest, highest = _lowest(refinement, CLEAR, ground)
    lowest_legal, highest_legal = _lowest(refinement, LEGAL, ground)
    unsafe = stretches_of(trace, refinement, CLEAR, level, target)
    irregular = stretches_of(trace, refinement, LEGAL, level, target, but=CLEAR)
    proposal = propose(trace, refinement, target, vehicle, judged_m) if rally and lowest is None else None
    unsafe_m = together_m((s.from_m, s.to_m) for s in unsafe)
    if proposal is not None and not proposal.points and _left_m(proposal) >= unsafe_m:
        # The proposal was looked at less closely than the altitude that was judged, which is as good.
        proposal = replace(proposal, rel_home_m=judged_m, left=tuple(unsafe))
    best_m = judged_m if not unsafe and not irregular else _whole(lowest_legal, highest_legal)
    if best_m is None:
        best_m = judged_m if not unsafe else _whole(lowest, highest)
    notes = _notes(vehicle, judged_m, rtl_rel_home_m is None) + _warnings(refinement, vehicle, ground, lowest)
    straight = WayHome(
        vehicle=vehicle.name,
        autopilot=vehicle.autopilot,
        path_safe=verdict.safe,
        max_agl_m=vehicle.limits.max_agl_m,
        parameter=rule.parameter,
        rtl_rel_home_m=judged_m,
        assumed=rtl_rel_home_m is None,
        home=home,
        lowest_rel_home_m=lowest,
        highest_rel_home_m=highest,
        lowest_legal_rel_home_m=lowest_legal,
        unsafe=unsafe,
        irregular=irregular,
        battery=battery_home(verdict, vehicle, home, level),
        advised_rel_home_m=proposal.rel_home_m if proposal else lowest,
        set_rel_home_m=proposal.rel_home_m if best_m is None and proposal else best_m,
        set_leaves_m=_left_m(proposal) if best_m is None else _short_m(verdict, vehicle, home, best_m),
        rally=proposal.points if proposal else (),
        left=proposal.left if proposal else (),
        profile=_profile(trace, refinement),
        lowest=lowest_agl(trace, trace.cut(refinement.first_m), target, vehicle, level),
        not_judged=(
            *_left_out(flight, verdict, vehicle, world, (ground, max(level, float(trace.amsl.max())))),
            *(() if route == "straight" else _landing_sequence(mission)),
        ),
        notes=tuple(notes + list(proposal.notes if proposal else ())),
    )
    return _to_points(straight, points, verdict, vehicle, trace, refinement, target) if points else straight


def _beside(points: Sequence[MissionItem], along: WayHome) -> WayHome:
    """The way home along the mission, with rally points on board."""
    return replace(along, not_judged=(*along.not_judged, Note("rally_points_unjudged"))) if points else along


def _to_points(
    straight: WayHome,
    points: Sequence[MissionItem],
    verdict: Verdict,
    vehicle: Vehicle,
    trace: MissionTrace,
    refinement: Refinement,
    home: Target,
) -> WayHome:
    """The way home with rally points on board; ``straight`` is the one without them.

    No other altitude was looked for than the one that was judged.
    """
    kept = [profile_of(vehicle.autopilot).stored(point) for point in points]
    returns = returns_to(trace, refinement, home, vehicle, kept, straight.rtl_rel_home_m)
    unsafe = stretches_of(trace, returns.refinement, CLEAR, returns.refinement.start, None)
    irregular = stretches_of(trace, returns.refinement, LEGAL, returns.refinement.start, None, but=CLEAR)
    battery = battery_home(verdict, vehicle, straight.home, returns.highest_amsl_m)
    short_m = 0.0 if battery is None else together_m(battery.short)
    return replace(
        straight, unsafe=unsafe, irregular=irregular, battery=battery, lowest_rel_home_m=None,
        highest_rel_home_m=None, lowest_legal_rel_home_m=None, advised_rel_home_m=None,
        set_rel_home_m=None if unsafe else straight.rtl_rel_home_m, set_leaves_m=None if unsafe else short_m,
        profile=(), lowest=None, not_judged=(*straight.not_judged, *returns.unknown),
        notes=(*straight.notes, *returns.notes),
    )  # fmt: skip


def _along_mission(
    verdict: Verdict, vehicle: Vehicle, stored: Mission, flight: Flight, trace: MissionTrace, judged_m: float
) -> WayHome:
    """The way home if returns join the mission, at a return path or a landing sequence."""
    home = _not_judged(verdict, vehicle, judged_m, False, ())
    if vehicle.autopilot is Autopilot.PX4:
        return replace(home, route="mission", not_judged=(Note("px4_joins_unread"),))
    wind = None if verdict.in_wind is None else verdict.in_wind.flies_in
    joins = joins_of(stored, flight, vehicle, trace.world, wind)
    heights_m = float(trace.amsl.min()), float(trace.amsl.max())
    known = _left_out(flight, verdict, vehicle, trace.world, heights_m)
    if joins.why_not:
        return replace(home, route="mission", starts=joins.starts, along_path=joins.path,
                       not_judged=(*joins.why_not, *known))  # fmt: skip
    landing = frozenset(k for k, item in enumerate(stored.items, stored.first_seq) if item.command in LANDS)
    found = return_by_mission(trace, joins, landing, verdict, vehicle)
    notes = list(home.notes)
    if joins.path:
        notes.append(Note("return_path_by_version"))
    if vehicle.autopilot is Autopilot.ARDUCOPTER:
        notes.append(Note("fence_returns_straight"))
    if found.stopped_early:
        notes.append(Note("mission_too_long"))
    return replace(
        home, route="mission", starts=joins.starts, along_path=joins.path, unsafe=found.unsafe,
        irregular=found.irregular, battery=found.battery, notes=tuple(notes),
        not_judged=(*(Note("from_stretch", stretch=s.place_and_why) for s in found.unknown[:MOST_UNKNOWN]), *known),
    )  # fmt: skip


def _left_out(
    flight: Flight, verdict: Verdict, vehicle: Vehicle, world: World, amsl_m: tuple[float, float]
) -> list[Note]:
    """Notes on what of a flight and its returns between two altitudes is not judged.

    ArduPlane's own return at the flight's end is judged here.
    """
    unjudged = [note for note in flight.not_judged if note.code != "returns_by_itself"]
    return [*unjudged, *_too_windy(verdict, vehicle, world, amsl_m)]


def _too_windy(verdict: Verdict, vehicle: Vehicle, world: World, amsl_m: tuple[float, float]) -> list[Note]:
    """A note if no return is sure between two altitudes, for a declared wind there is too strong to fly against."""
    if verdict.in_wind is None:
        return []
    agl_m = amsl_m[1] - float(np.nanmin(world.airspace.surface.ground_m))
    ways = WaysHome(vehicle, verdict.in_wind.flies_in, amsl_m, agl_m)
    speeds_m_s = {speed_home_m_s(vehicle, leg.speed_m_s) for leg in verdict.legs if not leg.column}
    if all(ways.advances(speed_m_s) for speed_m_s in speeds_m_s):
        return []
    return [Note("return_too_windy", wind_m_s=ways.wind_m_s, gusts=gusts_note(verdict.in_wind.flies_in.declared))]


def refinement_of(trace: MissionTrace, target: Target, vehicle: Vehicle, level: float) -> Refinement:
    """The returns from all of ``trace`` to ``target``, refined for ``level``."""

    def judged(parts: TraceParts, whole: bool) -> GradedObstacles:
        return obstacles_of_returns(trace, parts, target, vehicle, whole=whole)

    field = trace.world.airspace.field
    away_m = float(np.hypot(trace.east - target.east_m, trace.north - target.north_m).mean())
    sizes = sizes_m(trace, away_m, min(field.step_x, field.step_y))
    return Refinement(trace, judged, target.ground_amsl_m, (level,), *sizes)


def _lowest(refinement: Refinement, grade: int, home_amsl_m: float) -> tuple[float | None, float | None]:
    """The lowest altitude that is safe from every point, and the highest up to which it stays so, above home."""
    obstacles = refinement.strict[grade]
    level = obstacles.together(refinement.start)
    top = obstacles.highest(level) if math.isfinite(level) else math.inf
    return rel_home(obstacles, level, home_amsl_m), None if math.isinf(top) else top - home_amsl_m - NOISE_M


def _whole(lowest_m: float | None, highest_m: float | None) -> float | None:
    """An altitude to set: the lowest in whole metres, rounded up, or exactly if that is above the highest."""
    if lowest_m is None:
        return None
    whole = float(max(math.ceil(lowest_m - 1e-6), 1))
    return whole if highest_m is None or whole <= highest_m else lowest_m


def _short_m(verdict: Verdict, vehicle: Vehicle, home: Place, rel_home_m: float) -> float:
    """Metres of the mission from which the battery is not enough for a return at that altitude."""
    battery = battery_home(verdict, vehicle, home, home[2] + rel_home_m)
    return 0.0 if battery is None else together_m(battery.short)


def _left_m(proposal: Proposal | None) -> float:
    return math.inf if proposal is None else together_m((s.from_m, s.to_m) for s in proposal.left)


def _profile(trace: MissionTrace, refinement: Refinement) -> tuple[ProfilePoint, ...]:
    """The levels that each part of the mission needs; parts are joined into at most `PROFILE_POINTS` groups."""
    parts, mains = refinement.parts, trace.mains
    own = np.flatnonzero(parts.stretch < mains)
    if not len(own):
        return ()
    a, b = (np.interp(u[own], trace.u, trace.along) for u in (parts.start, parts.end))
    low, high = trace.heights(parts)
    needs = [refinement.strict[g].lowest(refinement.start)[own] for g in (CLEAR, LEGAL)]
    bins = np.minimum((a / max(float(b.max()), 1e-9) * PROFILE_POINTS).astype(int), PROFILE_POINTS - 1)
    at = np.flatnonzero(np.diff(bins, prepend=-1))
    columns = [
        np.minimum.reduceat(a, at), np.maximum.reduceat(b, at),
        np.minimum.reduceat(low[own], at), np.maximum.reduceat(high[own], at),
        *(np.maximum.reduceat(need, at) for need in needs),
    ]  # fmt: skip
    return tuple(
        ProfilePoint(*row[:4], *(x if math.isfinite(x) else None for x in row[4:]))
        for row in zip(*(c.tolist() for c in columns), strict=True)
    )


def _notes(vehicle: Vehicle, judged_m: float, assumed: bool) -> list[Note]:
    rule = RETURN_RULES[vehicle.autopilot]
    notes = []
    if assumed:
        notes.append(Note("return_altitude_assumed", rel_home_m=judged_m, parameter=rule.parameter))
    if not rule.climbs_first:
        notes.append(Note("return_from_flight"))
    return notes


def _landing_sequence(mission: Mission) -> list[Note]:
    """That ArduPlane's return may lead to a landing sequence of the mission; empty if there is none.

    With DO_LAND_START or DO_RETURN_PATH_START in its mission ArduPlane arms only with RTL_AUTOLAND set, and RTL then
    leads there: at once (2), after home (1), or to the nearest leg of the return path (4) (mode_rtl.cpp, `navigate`);
    with 3 it does not.
    """
    starts = [k for k, item in enumerate(mission.items, start=mission.first_seq) if item.command in LAND_STARTS]
    if mission.autopilot is not Autopilot.ARDUPLANE or not starts:
        return []
    name = command_name(mission.items[starts[0] - mission.first_seq].command)
    return [Note("return_leads_on", starts[0], command=name)]


def _warnings(refinement: Refinement, vehicle: Vehicle, ground: float, lowest: float | None) -> list[Note]:
    """Notes for the user on the altitudes that were found."""
    notes = []
    most_amsl = vehicle.limits.max_amsl_m
    if most_amsl is not None and lowest is not None and ground + lowest > most_amsl - vehicle.limits.altitude_error_m:
        most_m = most_amsl - vehicle.limits.altitude_error_m - ground
        notes.append(
            Note("clear_above_ceiling", lowest_m=lowest, most_m=most_m)
            if most_m > 0.0
            else Note("clear_above_low_ceiling", lowest_m=lowest)
        )
    if refinement.stopped_early:
        notes.append(Note("terrain_too_fine"))
    return notes


def _not_judged(verdict: Verdict, vehicle: Vehicle, judged_m: float, assumed: bool, why: tuple[Note, ...]) -> WayHome:
    home = verdict.mission.home
    return WayHome(
        vehicle=vehicle.name, autopilot=vehicle.autopilot, path_safe=verdict.safe,
        parameter=RETURN_RULES[vehicle.autopilot].parameter, rtl_rel_home_m=judged_m, assumed=assumed,
        home=(home.lat_e7 / 1e7, home.lon_e7 / 1e7, home.amsl_m), lowest_rel_home_m=None, highest_rel_home_m=None,
        lowest_legal_rel_home_m=None, unsafe=(), irregular=(), battery=None, advised_rel_home_m=None,
        set_rel_home_m=None, set_leaves_m=None, rally=(), left=(), profile=(), lowest=None, not_judged=why,
        notes=tuple(_notes(vehicle, judged_m, assumed)),
    )  # fmt: skip


ENOUGH_M = 1.0
"""The lowest height is known to within this, m, or less."""

ROUNDS, PIECES, AT_ONCE = 12, 4, 64
"""How often the parts with the lowest heights are split, into how many, and how many at once."""


def lowest_agl(
    trace: MissionTrace, parts: TraceParts, target: Target, vehicle: Vehicle, level_amsl_m: float
) -> LowestAgl | None:
    """The lowest height of the returns from ``parts`` at the return altitude; None over unknown ground."""
    agl = heights_agl(trace, parts, target, vehicle, level_amsl_m)
    for _ in range(ROUNDS):
        lowest = np.argsort(agl, kind="stable")[:AT_ONCE]
        few = parts.take(lowest)
        middle = TraceParts(few.middle, few.middle, few.stretch)
        known = float(heights_agl(trace, middle, target, vehicle, level_amsl_m).min())
        open_ = lowest[(agl[lowest] < known - ENOUGH_M) & (few.size > SMALLEST_PART_M)]
        if not len(open_):
            break
        new = parts.take(open_).split(PIECES)
        kept = np.ones(len(parts), np.bool_)
        kept[open_] = False
        old = parts.take(kept)
        parts = TraceParts(
            np.append(old.start, new.start), np.append(old.end, new.end), np.append(old.stretch, new.stretch)
        )
        agl = np.append(agl[kept], heights_agl(trace, new, target, vehicle, level_amsl_m))
    k = int(agl.argmin())
    if not np.isfinite(agl[k]):
        return None
    at_m = float(np.interp(parts.middle[k], trace.u, trace.along))
    return LowestAgl(float(agl[k]), at_m, int(trace.seq[parts.stretch[k]]))


def heights_agl(
    trace: MissionTrace, parts: TraceParts, target: Target, vehicle: Vehicle, level_amsl_m: float
) -> Floats:
    """(N,) a lower bound of the height above ground of the returns from all of each part; -inf over unknown ground."""
    rule, air, n = RETURN_RULES[vehicle.autopilot], trace.world.airspace, len(parts)
    limits = replace(vehicle.limits, min_agl_m=0.0, max_agl_m=None, horizontal_clearance_m=0.0, altitude_error_m=0.0)
    places = places_of_returns(trace, parts, target, vehicle)
    start, reach, half, nearest = places.lines_home()
    end = np.tile(target.en, (n, 1))
    wide = places.wide_m * air.scale
    extra, aside = half + wide + places.bow_m * air.scale, places.aside_m * air.scale
    out, step_m = np.full(n, np.inf), level_lines.step_of(air, start, end)

    def ground(a: Floats, b: Floats, width: Floats) -> level_lines.LevelLines:
        return level_lines.over(air, a, b, limits, float(width.max(initial=0.0)), step_m=step_m)

    if rule.climbs_first:
        there_m = at_home_m(limits)
        away = np.flatnonzero(np.hypot(*(end - start).T) > there_m)
        cone = rule.cone_amsl_m(target.cone_amsl_m, np.maximum(nearest, there_m))
        level = np.maximum(places.low, np.minimum(level_amsl_m, cone))
        for i in alike_in_width(extra, away):
            out[i] = level[i] - ground(start[i], end[i], extra[i]).clear_m
        begin = places.regions[:, :4]
        beside = np.hypot(*(begin[:, 2:] - begin[:, 1:2]).transpose(2, 0, 1)).max(axis=1) + wide
        runs = np.flatnonzero(np.hypot(*(begin[:, 1] - begin[:, 0]).T) > TINY_M)
        for i in alike_in_width(beside, runs):
            met = ground(np.ascontiguousarray(begin[i, 0]), np.ascontiguousarray(begin[i, 1]), beside[i])
            out[i] = np.minimum(out[i], places.low[i] - met.clear_m)
        return out
    climb = vehicle.climb_m_s / vehicle.speed_max_m_s if np.isfinite(vehicle.climb_m_s) else 1.0
    for i in alike_in_width(extra + aside, np.arange(n)):
        met = ground(start[i], start[i], (reach + wide + aside)[i])
        out[i] = np.minimum(level_amsl_m, places.low[i]) - met.clear_m
        step = end[i] - start[i]
        length = np.hypot(*step.T)
        for a, b in pairwise(ASIDE_PARTS):
            met = ground(start[i] + a * step, start[i] + b * step, (extra + (1.0 - a) * aside)[i])
            flown = np.maximum(met.piece_s_m + (a * length - reach[i] - aside[i])[met.piece_line], 0.0)
            reached = np.minimum(level_amsl_m, places.low[i][met.piece_line] + climb * flown)
            np.minimum.at(out, i[met.piece_line], reached - met.piece_clear_m)
    high = target.ground_amsl_m + CIRCLE_ABOVE_M
    circle = circle_home_m(rule.circle_m(high), vehicle, high)
    over = ground(target.en[None], target.en[None], np.array([circle * air.scale]))
    return np.asarray(np.minimum(out, level_amsl_m - over.clear_m[0]))
