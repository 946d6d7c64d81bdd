"""Build the planner's `Problem` from a vehicle's request, and the judged mission from the planner's solution."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

from gcsplan.app.plan.model import Brief, VehiclePlan
from gcsplan.arrays import Floats
from gcsplan.check.judge import judge
from gcsplan.check.motion.project import why_unknown
from gcsplan.check.verdict import Verdict
from gcsplan.errors import InputError, NoMission, heed_cancel
from gcsplan.mavlink.build.multirotor import build_mission, corner_m, cuts_corners
from gcsplan.mavlink.build.order import FLOWN_SLOPE, LEG_BOW_M, LONGEST_LEG_M, MARGINS, Margins, Order, slope_margin
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.autopilots import profile_of
from gcsplan.mavlink.mission.mission import Home, Mission
from gcsplan.mission_file import MissionFile, VehicleRequest
from gcsplan.notes.note import Note
from gcsplan.planners.airspeed import Airspeed
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution, Via, lowest_amsl
from gcsplan.planners.refusal.suggestions import FILLED
from gcsplan.units import METRIC
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.atmosphere import TROPOPAUSE_M
from gcsplan.world.geodesy.frame import FARTHEST_M
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Zone
from gcsplan.world.terrain.grid import NEAR_ENOUGH_M
from gcsplan.world.world import World

BYTES_PER_NODE = 64.0
"""Memory that a wider window takes for each of its nodes, terrain included: 58 bytes were measured."""
FARTHEST_DEG = 2.0 * FARTHEST_M / 110_500.0
"""Degrees of latitude from home that no mission leaves."""
LEAST_BOW_M = 0.01
"""Metres; legs of some 700 m have no larger bow."""
MOST_WIND = 0.95
"""The fastest wind for a least time, per indicated airspeed: the true one is 4 % less 700 m below the sea."""
SPOT_M = 0.02
"""Metres by which two altitudes of one place are set apart; wire numbers are rounded to half a centimetre."""


@dataclass(frozen=True, eq=False)
class Wider:
    """The ``widen`` of a problem: the same problem over more terrain of its mission file.

    ``source`` and ``world`` are those of the problem; ``zones`` are those that only the search sees.
    """

    source: MissionFile
    world: World
    request: VehicleRequest
    zones: tuple[Zone, ...]
    objective: str
    seed: int
    margins: Margins

    def __call__(self, margin_m: float, budget_mb: float) -> Problem | None:
        """See `Problem.widen`."""
        cells = math.floor(budget_mb * 2**20 / BYTES_PER_NODE)
        wide = None if self.source.wider is None else self.source.wider(margin_m, cells)
        if wide is None:
            return None
        there = next(r for r in wide.vehicles if r.vehicle.name == self.request.vehicle.name)
        request = replace(self.request, start=there.start, goal=there.goal)
        air = Airspace(wide.surface, (*wide.zones, *self.zones), scale=wide.airspace_scale)
        world = World(wide.frame, air)
        try:
            return make_problem(wide, request, world, self.objective, self.seed, self.margins)[0]
        except (InputError, NoMission):
            return None  # a terminal that is just legal here is illegal over the wider terrain


def looked_over(brief: Brief, solution: Solution) -> Brief:
    """``brief`` over the terrain that the solution was found in, which may be wider than the requested terrain."""
    over = None if solution.problem is None else solution.problem.widen
    if not isinstance(over, Wider):
        return brief
    world = over.world
    if over.zones:  # zones that only the search sees do not count in the check
        air = Airspace(world.airspace.surface, over.source.zones, scale=over.source.airspace_scale)
        world = World(world.frame, air)
    return brief.over(over.source, world)


def built_again(v: VehiclePlan, brief: Brief, order: Order) -> tuple[Mission, Verdict]:
    """`built` for a vehicle's path; what it was before, if nothing has changed of what it depends on."""
    source, air, frame = brief.source, brief.world.airspace, brief.world.frame
    wind = source.flight_wind(v.request)
    blows = None if wind is None else (wind.declared.key, wind.departs_s, wind.late_s)
    place = frame.lat_deg, frame.lon_deg, frame.amsl_m
    key = v.solution.path, order, v.request, blows, source.terrain_error_m, air.surface, air.zones, air.scale, place
    return v.built_last.get(key, lambda: built(brief, v.request, v.solution, order))


def built(brief: Brief, request: VehicleRequest, solution: Solution, order: Order) -> tuple[Mission, Verdict]:
    """The mission of a path, and the check of it. Raises NoMission if it has more items than the autopilot takes."""
    heed_cancel()
    vehicle, source = request.vehicle, brief.source
    mission = build_mission(solution.path, brief.world, vehicle, request.start_deg, order)
    _require_room(mission, vehicle)
    return mission, judge(
        mission, vehicle, brief.world, rtl_rel_home_m=request.rtl_rel_home_m, terrain_error_m=source.terrain_error_m,
        wind=source.flight_wind(request),
    )  # fmt: skip


def _require_room(mission: Mission, vehicle: Vehicle) -> None:
    limit, count = profile_of(vehicle.autopilot).max_items, len(mission.wire_items())
    if count > limit:
        raise NoMission(
            f"{vehicle.name}: the mission has {count} items and {vehicle.autopilot} takes {limit}: put the goal "
            f"nearer, or plan it in stages",
            reason="too_many_items",
        )


def unsafe(verdict: Verdict, vehicle: Vehicle) -> NoMission:
    """The NoMission for a verdict with findings: a path was found, but its mission breaks limits as it is flown."""
    words = "\n".join(f"  {f.message}" for f in verdict.findings[:8])
    if all(f.kind == "battery" for f in verdict.findings):
        note = verdict.findings[0].note
        cure = _battery_that_would_do(verdict, vehicle.energy)
        return NoMission(f"{vehicle.name}: {note.in_units(METRIC)}; {cure}", reason="battery")
    windy = next((f for f in verdict.findings if f.kind == "wind"), None)
    if windy is not None:
        return NoMission(f"{vehicle.name}: {windy.note.in_units(METRIC)}", reason="wind")
    items, first = verdict.mission.items, verdict.mission.first_seq
    returns = {i + first for i, item in enumerate(items) if item.command == cmd.RTL}
    if any(f.seq in returns for f in verdict.findings):
        words += (
            "\n  an rtl leads straight home at the return altitude: end: land and end: loiter end the mission at the "
            "goal, and rtl_rel_home_m is the altitude"
        )
        if vehicle.turn_radius_m > 0.0:
            words += "; a fixed wing climbs to it on the way, and begins higher with a higher approach_agl_m"
    return NoMission(
        f"{vehicle.name}: a path was found, but the mission as {vehicle.autopilot} flies it breaks limits:\n{words}",
        reason="not_found",
    )


def _battery_that_would_do(verdict: Verdict, energy: Energy) -> Note:
    """The least battery of three digits, in the unit that the mission file has it in, with which the flight passes.

    A battery whose endurance is given lasts longer in proportion: else a larger one would only mean more power.
    """
    least = verdict.energy_j / (1.0 - energy.reserve) / energy.battery_unit_j
    step = 10.0 ** (math.floor(math.log10(least)) - 2)
    units = math.ceil(least / step)
    while verdict.energy_j > (1.0 - energy.reserve) * (units * step * energy.battery_unit_j):
        units += 1
    lasts = None
    if energy.endurance_s is not None and energy.battery_j:
        lasting_min = energy.endurance_s / 60.0 * (units * step * energy.battery_unit_j / energy.battery_j)
        lasts = Note("battery_lasts", key_name="endurance_min", lasting_min=math.ceil(1e3 * lasting_min) / 1e3)
    return Note("battery_that_would_do", key_name=energy.battery_key, enough=f"{units * step:.10g}", lasts=lasts)


def make_problem(
    source: MissionFile,
    request: VehicleRequest,
    world: World,
    objective: str,
    seed: int,
    margins: Margins = MARGINS,
    progress: Callable[[Progress], None] | None = None,
    options: Mapping[str, object] | None = None,
    known: Floats | None = None,
) -> tuple[Problem, tuple[Note, ...]]:
    """The planner's problem for one vehicle, and notes for the user.

    The limits of its paths have the wire's margins; its bounds have the limits of the check.

    The altitudes of start and goal are whole centimetres above home. If ``takeoff_agl_m`` meets min AGL plus altitude
    error but not the ground's slope within the track error, it is raised, with a note; a lower value is bad input.
    """
    heed_cancel()
    vehicle = request.vehicle
    _require_one_height(source, request, world)
    if objective == "time":
        _require_times(source, vehicle)
    given, margins = margins, replace(margins, bow_m=bow_margin_m(request, world, margins))
    margins = replace(margins, track_m=margins.track_m + corner_m(vehicle))
    checked = vehicle.limits
    spread_m = world.spread_m(*request.start_deg)  # of home's ground, from which altitudes count
    checked = replace(checked, altitude_error_m=checked.altitude_error_m + spread_m)
    if source.altitude_frame == "terrain":
        checked = replace(checked, altitude_error_m=checked.altitude_error_m + source.terrain_error_m)
    limits = _with_margins(checked, margins, terrain=source.altitude_frame == "terrain")
    air = world.airspace
    notes: list[Note] = []

    start_agl_m = _given_agl_m(request.takeoff_agl_m, request.start_amsl_m, request.start[2])
    goal_agl_m = _given_agl_m(request.approach_agl_m, request.goal_amsl_m, request.goal[2])
    ends = _Ends(source, request, world, limits, checked, notes)
    start_amsl = ends.amsl_m("start", request.start, "takeoff_agl_m", start_agl_m)
    goal_amsl = ends.amsl_m("goal", request.goal, "approach_agl_m", goal_agl_m)
    via = _vias(air, request, (start_amsl, goal_amsl), notes)
    limits = _less_steep(limits, margins.slope + _slope_margin(source, request, limits, abs(goal_amsl - start_amsl)))
    settings = source.planner
    own = world.airspace.zones[len(source.zones) :]
    airspeed = _airspeed(source, vehicle) if objective == "time" else None
    tail_m_s = 0.0 if airspeed is None else airspeed.blows_m_s
    wider = Wider(source, world, request, own, objective, seed, given)
    problem = Problem(
        airspace=air,
        limits=limits,
        checked=checked,
        rounding_m=margins.rounding_m,
        start=(request.start[0], request.start[1], start_amsl),
        goal=(request.goal[0], request.goal[1], goal_amsl),
        via=via,
        objective=objective,  # type: ignore[arg-type]
        vertical_j_per_m=vehicle.energy.vertical_j_per_m,
        horizontal_j_per_m=least_horizontal_j_per_m(vehicle, request.start_deg[0]),
        speed_m_s=vehicle.fastest_over_ground_m_s(vehicle.speed_max_m_s, top_of(vehicle)) + tail_m_s,
        climb_m_s=vehicle.climb_m_s,
        descent_m_s=vehicle.descent_m_s,
        airspeed=airspeed,
        turn_radius_m=vehicle.turn_radius_m,
        seed=seed,
        gap_percent=settings.gap_percent,
        budget_s=settings.budget_s,
        budget_mb=settings.budget_mb,
        progress=progress,
        options=dict(settings.extras if options is None else options),
        widen=None if source.wider is None else wider,
        known=known,
    )
    if vehicle.vtol:
        notes.append(Note("flown_as_quadplane", radius_m=vehicle.turn_radius_m))
    return problem, tuple(notes)


def top_of(vehicle: Vehicle) -> float:
    """An altitude AMSL, m, above which the vehicle is no faster or may not fly."""
    return TROPOPAUSE_M if vehicle.limits.max_amsl_m is None else vehicle.limits.max_amsl_m


def least_horizontal_j_per_m(vehicle: Vehicle, home_lat_deg: float) -> float:
    """The least that a horizontal metre takes in still air, J: what is minimised, and bounded from below.

    With a base power a metre takes it for no less time than at the fastest speed over ground. Climbs, corners and stops
    take longer, which counts in the flight's energy and not here.
    """
    energy = vehicle.energy
    if not energy.base_w:
        return energy.horizontal_j_per_m
    fastest = vehicle.fastest_over_ground_m_s(vehicle.speed_max_m_s, top_of(vehicle))
    if vehicle.lays_curves:  # towards the equator ArduPilot's own metres of longitude are too long
        near, far = (math.radians(max(abs(home_lat_deg) - part * FARTHEST_DEG, 0.0)) for part in (0.5, 1.0))
        fastest *= math.cos(far) / math.cos(near)
    return energy.horizontal_j_per_m + energy.base_w / fastest


def _require_times(source: MissionFile, vehicle: Vehicle) -> None:
    """Raise InputError where the objective ``time`` knows no time of a leg."""
    words, cure = "", "use length"
    airspeed = _airspeed(source, vehicle)
    if vehicle.keeps_airspeed and airspeed is None:
        words = f"{vehicle.name} is a fixed wing, whose fastest path depends on which of the declared winds blows"
        cure = "use length, or declare one constant wind without gusts (wind: {speed_m_s: 5, from_deg: 270})"
    elif airspeed is not None and airspeed.blows_m_s > MOST_WIND * airspeed.indicated_m_s:
        words = f"{vehicle.name} is a fixed wing, and the declared wind is about as fast as it flies"
        cure = f"use length, or a wind of {MOST_WIND * airspeed.indicated_m_s:.1f} m/s at most"
    elif math.isinf(vehicle.climb_m_s + vehicle.descent_m_s):
        words = f"climb_m_s and descent_m_s do not both bound {vehicle.name}, whose fastest path is the shortest then"
    elif source.altitude_frame == "terrain":
        words = "altitude_frame terrain leaves open how steep a leg is, because it follows the ground"
    if words:
        where = f"{source.path}: planner.objective"
        raise InputError(f"the least time is not known, because {words}: {cure}", where=where)


def _airspeed(source: MissionFile, vehicle: Vehicle) -> Airspeed | None:
    """What a fixed wing's least time depends on; None of others, and where one of several winds may blow."""
    wind_m_s = source.wind.constant_m_s
    if wind_m_s is None or not vehicle.keeps_airspeed:
        return None
    return Airspeed(vehicle.speed_max_m_s, vehicle.climb_m_s, vehicle.descent_m_s, wind_m_s)


@dataclass(frozen=True)
class _Ends:
    """The altitudes of a path's ends: whole centimetres above home, legal under ``limits``, which paths keep."""

    source: MissionFile
    request: VehicleRequest
    world: World
    limits: Limits
    checked: Limits
    notes: list[Note]

    def amsl_m(self, what: str, place: tuple[float, float, float], key: str, given_agl_m: float | None) -> float:
        """The altitude AMSL of one end, as ``given_agl_m`` above ground or raised, with a note. Raises InputError,
        NoMission."""
        east, north, ground = place
        vehicle, air, datum = self.request.vehicle, self.world.airspace, self.request.start[2]
        low = lowest_amsl(air, east, north, self.limits)
        needed = self.limits.min_agl_m + vehicle.limits.altitude_error_m
        if given_agl_m is not None and given_agl_m < needed - 1e-6:
            raise InputError(
                f"must be at least min_agl_m + altitude_error_m = {needed:g}, given {given_agl_m:g}: "
                f"the path begins and ends there",
                where=f"{self.source.path}: vehicles.{vehicle.name}.{key}",
            )
        if math.isinf(low):
            shut = math.isinf(lowest_amsl(air, east, north, self.checked))
            words = f"the ground within reach of the {what} is unknown to the terrain model: {FILLED}"
            refusal = Refusal(words, reason="infeasible" if shut else "not_found", place=(east, north))
            raise in_degrees(refusal, vehicle, self.world)
        amsl = max(low, ground + (given_agl_m or 0.0))
        amsl = datum + math.ceil((amsl - datum) * 100.0 - 1e-6) / 100.0
        if given_agl_m is not None and amsl - ground > given_agl_m + 0.011:
            self.notes.append(
                Note(
                    "takeoff_raised" if what == "start" else "approach_raised",
                    asked_m=given_agl_m, raised_m=amsl - ground,
                )
            )  # fmt: skip
        return amsl


def _require_one_height(source: MissionFile, request: VehicleRequest, world: World) -> None:
    """Raise InputError where home's ground is not one number: altitudes count from it."""
    unsure = why_unknown(Home.at(*request.start_deg, request.start[2]), request.vehicle, world)
    if unsure is not None:
        raise InputError(str(unsure), where=f"{source.path}: vehicles.{request.vehicle.name}.start")


def _vias(
    air: Airspace, request: VehicleRequest, ends_amsl_m: tuple[float, float], notes: list[Note]
) -> tuple[Via, ...]:
    """The via points. Planners need a leg between two altitudes: for a multicopter, a via that is one place with the
    terminal before it, or with the goal behind it, at another altitude is moved aside by `SPOT_M`, with a note."""
    start, goal = (Via(*end[:2], z) for end, z in zip((request.start, request.goal), ends_amsl_m, strict=True))
    via = [Via(e, n, None if agl is None else float(air.surface.high_at(e, n)) + agl) for e, n, agl in request.via]
    if request.vehicle.turn_radius_m > 0.0:
        return tuple(via)
    out: list[Via] = []
    for k, v in enumerate(via):
        before = out[-1] if out else start
        beside = [before, goal] if k == len(via) - 1 else [before]
        same = [x for x in beside if math.dist((x.east_m, x.north_m), (v.east_m, v.north_m)) < 0.5 * SPOT_M]
        if any(v.amsl_m is not None and x.amsl_m is not None and abs(x.amsl_m - v.amsl_m) > SPOT_M for x in same):
            # Not all to the same side: the one before may have been moved from the same place.
            east_m, north_m = (SPOT_M, 0.0) if k % 2 == 0 else (0.0, SPOT_M)
            v = replace(v, east_m=v.east_m + east_m, north_m=v.north_m + north_m)
            notes.append(Note("via_moved", via=k + 1, aside_m=SPOT_M))
        out.append(v)
    return tuple(out)


def _given_agl_m(agl_m: float | None, amsl_m: float | None, ground_m: float) -> float | None:
    """The height above ground that the file requests at an end: stated as AGL, or by an altitude above the ground."""
    if agl_m is None and amsl_m is not None and amsl_m > ground_m:
        return amsl_m - ground_m
    return agl_m


def _straight_legs_m(request: VehicleRequest) -> list[float]:
    """The lengths of the straight legs from start to goal past the vias, in the plane."""
    places = [request.start[:2], *(v[:2] for v in request.via), request.goal[:2]]
    return [math.dist(a, b) for a, b in pairwise(places)]


def bow_margin_m(request: VehicleRequest, world: World, margins: Margins = MARGINS) -> float:
    """The bow that a mission's legs may have, m: the bow of a straight leg between its terminals, so that no leg need
    be cut, and `LEAST_BOW_M` at least. It is as many times as large as the bow of ``margins`` is beside `MARGINS`."""
    longest_m = max(_straight_legs_m(request))
    own_m = LEAST_BOW_M
    if request.vehicle.turn_radius_m > 0.0:
        own_m = LEG_BOW_M  # arcs, climb-outs and approaches have legs of their own
    straight_m = world.bow_m(min(longest_m, LONGEST_LEG_M))
    bow_m = min(max(own_m, straight_m), LEG_BOW_M) * margins.bow_m / LEG_BOW_M
    return bow_m if bow_m <= straight_m else min(bow_m, world.bow_m(LONGEST_LEG_M))


def _with_margins(limits: Limits, margins: Margins, *, terrain: bool) -> Limits:
    """The limits of the planner's paths: the limits of the check, reduced by the wire's rounding and the bow, with the
    slopes as they are.

    In the terrain frame, too, by what a vehicle may read amiss and still be taken: an upload judges with it.
    """
    return replace(
        limits,
        track_error_m=limits.track_error_m + margins.track_m + margins.bow_m,
        altitude_error_m=limits.altitude_error_m + margins.altitude_m + (NEAR_ENOUGH_M if terrain else 0.0),
    )


def _slope_margin(source: MissionFile, request: VehicleRequest, limits: Limits, rise_m: float) -> float:
    """The part of the climb limits that paths keep for rounding, or for legs that are not straight. ``rise_m``: between
    the ends; a path may climb more where it is longer than that needs."""
    if request.vehicle.turn_radius_m > 0.0 or source.altitude_frame == "terrain":
        return FLOWN_SLOPE
    slope = min(limits.max_climb_slope, limits.max_descent_slope, 1.0)
    rise_m = max(rise_m, slope * sum(_straight_legs_m(request)))
    return slope_margin(rise_m, cut=request.vehicle.autopilot is Autopilot.ARDUCOPTER and cuts_corners(request.vehicle))


def _less_steep(limits: Limits, part: float) -> Limits:
    """``limits`` with slopes that are less than those of the check by ``part`` of them."""
    up, down = (
        deg if deg >= 90.0 else math.degrees(math.atan(math.tan(math.radians(deg)) * (1.0 - part)))
        for deg in (limits.max_climb_deg, limits.max_descent_deg)
    )
    return replace(limits, max_climb_deg=up, max_descent_deg=down)


def run_planner(run: Callable[[Problem], Solution], problem: Problem, vehicle: Vehicle, world: World) -> Solution:
    try:
        return run(problem)
    except Refusal as refusal:
        raise in_degrees(refusal, vehicle, world) from refusal
    except NoMission as refusal:
        raise NoMission(f"{vehicle.name}: {refusal.message}", reason=refusal.reason) from refusal  # type: ignore[arg-type]


def in_degrees(refusal: Refusal, vehicle: Vehicle, world: World) -> NoMission:
    """A planner's refusal for the user: with the vehicle's name, and its place in degrees."""
    place, at = "", None
    if refusal.east_m is not None and refusal.north_m is not None:
        lat, lon = (float(x) for x in world.frame.to_degrees(refusal.east_m, refusal.north_m))
        place, at = f" ({refusal.place_of + ' ' if refusal.place_of else ''}at {lat:.6f}, {lon:.6f})", (lat, lon)
    return NoMission(
        f"{vehicle.name}: {refusal.message}{place}", reason=refusal.reason, vehicle=vehicle.name, at=at,  # type: ignore[arg-type]
        cures=refusal.cures,
    )  # fmt: skip
