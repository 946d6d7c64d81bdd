"""One vehicle: from its request to a path, to a mission, to a verdict on it as the autopilot stores it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.errors import InputError, NoMission
from gcsplan.mavlink.autopilots import manner
from gcsplan.mavlink.build import LONGEST_LEG_M, MARGINS, Margins, Order, build_mission, corner_m
from gcsplan.mavlink.mission import Mission
from gcsplan.mission_file import MissionFile, VehicleRequest
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution, Via
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.airspace import Airspace
from gcsplan.world.limits import Limits
from gcsplan.world.world import World
from gcsplan.world.zones import Zone

__all__ = ["Brief", "VehiclePlan", "make_problem", "over_one_terrain", "plan_vehicle", "rebuilt"]

BYTES_PER_NODE = 64.0
"""What a wider window takes in memory for each of its nodes, terrain included: 58 bytes were measured."""

ATTEMPTS = 4
"""Plans for one vehicle, each with larger margins than the one before, until the decoded mission passes."""


@dataclass(frozen=True, eq=False)
class Brief:
    """How all vehicles of a mission file are planned: ``run`` is the planner, ``options`` what only it knows.

    ``by_priority``: each vehicle is planned with those before it in view, and gives way to them.
    """

    source: MissionFile
    world: World
    run: Callable[[Problem], Solution]
    objective: str
    seed: int
    options: Mapping[str, object]
    by_priority: bool = False


@dataclass(frozen=True, eq=False)
class VehiclePlan:
    """One vehicle's request and everything that became of it; ``brief``: over which terrain it was planned."""

    request: VehicleRequest
    problem: Problem
    solution: Solution
    mission: Mission
    verdict: Verdict
    speed_m_s: float
    notes: tuple[str, ...] = ()
    order: Order = field(default_factory=Order)
    brief: Brief | None = None

    @property
    def name(self) -> str:
        """The vehicle's name."""
        return str(self.request.vehicle.name)

    @property
    def cost(self) -> float:
        """Metres or joules of the path as it is flown, by the objective."""
        return self.verdict.path_energy_j if self.problem.objective == "energy" else self.verdict.length_m

    @property
    def gap_percent(self) -> float | None:
        """How far the flown path may be above the best, percent of the bound; None without a bound."""
        bound = self.solution.lower_bound
        return None if not bound else max(0.0, 100.0 * (self.cost / bound - 1.0))


def plan_vehicle(
    brief: Brief,
    request: VehicleRequest,
    progress: Callable[[Progress], None] | None = None,
    *,
    searched: World | None = None,
    limits: Limits | None = None,
    options: Mapping[str, object] | None = None,
) -> VehiclePlan:
    """One vehicle's path, mission and verdict. Raises InputError, NoMission.

    ``searched`` and ``limits``: a world with more zones, and tighter limits, to look for another path in; the verdict
    is on the mission file's own. ``options`` are for the planner, on top of the brief's.
    """
    source, vehicle = brief.source, request.vehicle
    asked = request if limits is None else replace(request, vehicle=replace(vehicle, limits=limits))
    world = brief.world if searched is None else searched
    told = {**brief.options, **(options or {})}
    if vehicle.turn_radius_m > 0.0:
        from gcsplan.steps.wings import plan_wing  # few missions have wings

        return plan_wing(brief, request, asked, world, told, progress)
    margins, failed = MARGINS, None
    for _ in range(ATTEMPTS):
        problem, notes = make_problem(source, asked, world, brief.objective, brief.seed, margins, progress, told)
        solution = run_planner(brief.run, problem, vehicle, world)
        over = looked_over(brief, solution)
        for spaced in (True, False):  # way points nearer than the acceptance radii are dropped where that is legal
            order = Order(request.end, source.altitude_frame, spaced=spaced)
            mission, verdict = built(over, request, solution, order)
            if not verdict.findings:
                return VehiclePlan(
                    request, problem, solution, mission, verdict, vehicle.speed_max_m_s, notes, order, over
                )
        failed = verdict
        if not any(f.seq > mission.first_seq for f in verdict.findings if f.kind != "battery"):
            break  # no margin mends a battery or a take-off column
        all_along = source.altitude_frame == "terrain" or vehicle.autopilot is Autopilot.ARDUPLANE
        margins = _larger(margins, verdict, all_along=all_along)
    assert failed is not None
    raise unsafe(failed, vehicle)


def over_one_terrain(
    brief: Brief, vehicles: Sequence[VehiclePlan], progress: Callable[[str, Progress], None] | None = None
) -> tuple[Brief, list[VehiclePlan]]:
    """All vehicles over the widest terrain that any of them needed, each judged there; planned anew where it fails."""
    wide = widest(brief, vehicles)
    out = []
    for v in vehicles:
        if v.brief is None or v.brief.source is wide.source:
            out.append(v)
            continue
        mission, verdict = built(wide, v.request, v.solution, v.order)
        if not verdict.findings:
            out.append(replace(v, mission=mission, verdict=verdict, brief=wide))
            continue
        tell = None if progress is None else lambda what, who=v.name: progress(who, what)
        out.append(plan_vehicle(wide, v.request, tell))
    return wide, out


def rebuilt(
    v: VehiclePlan,
    brief: Brief,
    *,
    speed_m_s: float,
    hold_s: float = 0.0,
    gate_utc: tuple[int, int, int] | None = None,
) -> VehiclePlan:
    """The same path flown at another speed, after ``hold_s`` (whole seconds) at the gate: its mission, judged anew.

    Raises NoMission where that one breaks a limit: a hold costs energy, and an item.
    """
    order = replace(v.order, speed_m_s=speed_m_s, hold_s=0 if gate_utc else round(hold_s), gate_utc=gate_utc)
    if order == v.order:
        return v
    mission, verdict = built(widest(brief, [v]), v.request, v.solution, order)
    if verdict.findings:
        raise unsafe(verdict, v.request.vehicle)
    return replace(v, mission=mission, verdict=verdict, speed_m_s=speed_m_s, order=order)


@dataclass(frozen=True, eq=False)
class Wider:
    """A problem's ``widen``: the same question over more terrain of its mission file.

    ``source`` and ``world`` are those that the problem is of; ``zones``: those of the search alone.
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
            return None  # an end that is legal by a hair here is not there


def looked_over(brief: Brief, solution: Solution) -> Brief:
    """``brief`` over the terrain that a solution was found in: more than it was asked for, where that was needed."""
    over = None if solution.problem is None else solution.problem.widen
    if not isinstance(over, Wider):
        return brief
    world = over.world
    if over.zones:  # a search's own zones are nobody else's
        air = Airspace(world.airspace.surface, over.source.zones, scale=over.source.airspace_scale)
        world = World(world.frame, air)
    return replace(brief, source=over.source, world=world)


def widest(brief: Brief, plans: Sequence[VehiclePlan]) -> Brief:
    """Of ``brief`` and those that vehicles were planned under the one that looks over the most terrain."""
    return max([brief, *(v.brief for v in plans if v.brief is not None)], key=lambda b: b.source.level)


def built(brief: Brief, request: VehicleRequest, solution: Solution, order: Order) -> tuple[Mission, Verdict]:
    vehicle, source = request.vehicle, brief.source
    mission = build_mission(solution.path, brief.world, vehicle, request.start_deg, order)
    _require_room(mission, vehicle)
    return mission, judge(
        mission, vehicle, brief.world, rtl_rel_home_m=request.rtl_rel_home_m, terrain_error_m=source.terrain_error_m
    )


def _require_room(mission: Mission, vehicle: Vehicle) -> None:
    limit, count = manner(vehicle.autopilot).max_items, len(mission.wire_items())
    if count > limit:
        raise NoMission(
            f"{vehicle.name}: the mission has {count} items and {vehicle.autopilot} takes {limit}: put the goal "
            f"nearer, or plan it in stages",
            reason="too_many_items",
        )


def _larger(margins: Margins, verdict: Verdict, *, all_along: bool) -> Margins:
    """Margins for another attempt.

    ``all_along``: what is off is off on many legs, not at one hilltop: a terrain-frame leg over sloping ground, and
    ArduPlane's, which changes height by less than GLIDE_SLOPE_MIN at once.
    """
    heights = ("min_agl", "max_agl", "max_amsl", "terrain_clearance")
    low_m = max((f.by for f in verdict.findings if f.kind in heights), default=0.0) if all_along else 0.0
    return Margins(
        3.0 * margins.altitude_m + 1.05 * low_m, 3.0 * margins.track_m, 3.0 * margins.bow_m, 3.0 * margins.slope
    )


def unsafe(verdict: Verdict, vehicle: Vehicle) -> NoMission:
    """No mission: the one that was found does not pass as the autopilot would fly it."""
    words = "\n".join(f"  {f.message}" for f in verdict.findings[:8])
    if all(f.kind == "battery" for f in verdict.findings):
        return NoMission(f"{vehicle.name}: {verdict.findings[0].message}", reason="battery")
    return NoMission(
        f"{vehicle.name}: a path was found, but the mission as {vehicle.autopilot} flies it breaks limits:\n{words}",
        reason="infeasible",
    )


def make_problem(
    source: MissionFile,
    request: VehicleRequest,
    world: World,
    objective: str,
    seed: int,
    margins: Margins = MARGINS,
    progress: Callable[[Progress], None] | None = None,
    options: Mapping[str, object] | None = None,
) -> tuple[Problem, tuple[str, ...]]:
    """The planner's question for one vehicle, with the wire's margins in its limits, and notes for the user.

    The ends are in whole centimetres above home. A ``takeoff_agl_m`` that meets min AGL and the altitude error but
    not the slope of the ground within the track error is raised, and a note says so; a lower one is bad input.
    """
    vehicle = request.vehicle
    given, margins = margins, replace(margins, bow_m=min(margins.bow_m, _largest_bow_m(world)))
    margins = replace(margins, track_m=margins.track_m + corner_m(vehicle))
    limits = _with_margins(vehicle.limits, margins, terrain=source.altitude_frame == "terrain", source=source)
    air = world.airspace
    datum = request.start[2]
    notes: list[str] = []

    def end_point(what: str, place: tuple[float, float, float], key: str, wanted_agl_m: float | None) -> float:
        east, north, ground = place
        low = lowest_amsl(air, east, north, limits)
        needed = limits.min_agl_m + vehicle.limits.altitude_error_m
        if wanted_agl_m is not None and wanted_agl_m < needed - 1e-6:
            raise InputError(
                f"must be at least min_agl_m + altitude_error_m = {needed:g}, given {wanted_agl_m:g}: "
                f"the path begins and ends there",
                where=f"{source.path}: vehicles.{vehicle.name}.{key}",
            )
        if math.isinf(low):
            raise NoMission(
                f"{vehicle.name}: the ground within reach of the {what} is unknown to the terrain model",
                reason="infeasible",
            )
        amsl = max(low, ground + (wanted_agl_m or 0.0))
        amsl = datum + math.ceil((amsl - datum) * 100.0 - 1e-6) / 100.0
        if wanted_agl_m is not None and amsl - ground > wanted_agl_m + 0.011:
            notes.append(
                f"{key} {wanted_agl_m:g} raised to {amsl - ground:.2f}: so far the ground rises within the track error"
            )
        return amsl

    start_agl = request.takeoff_agl_m
    goal_agl = request.approach_agl_m
    if start_agl is None and request.start_amsl_m is not None and request.start_amsl_m > request.start[2]:
        start_agl = request.start_amsl_m - request.start[2]
    if goal_agl is None and request.goal_amsl_m is not None and request.goal_amsl_m > request.goal[2]:
        goal_agl = request.goal_amsl_m - request.goal[2]
    start_amsl = end_point("start", request.start, "takeoff_agl_m", start_agl)
    goal_amsl = end_point("goal", request.goal, "approach_agl_m", goal_agl)
    via = tuple(
        Via(e, n, None if agl is None else float(air.surface.ground_at(e, n)) + agl) for e, n, agl in request.via
    )
    asked = source.planner
    own = world.airspace.zones[len(source.zones) :]
    wider = Wider(source, world, request, own, objective, seed, given)
    problem = Problem(
        airspace=air,
        limits=limits,
        start=(request.start[0], request.start[1], start_amsl),
        goal=(request.goal[0], request.goal[1], goal_amsl),
        via=via,
        objective="energy" if objective == "energy" else "length",
        vertical_j_per_m=vehicle.energy.vertical_j_per_m,
        horizontal_j_per_m=vehicle.energy.horizontal_j_per_m,
        turn_radius_m=vehicle.turn_radius_m,
        seed=seed,
        gap_percent=asked.gap_percent,
        budget_s=asked.budget_s,
        budget_mb=asked.budget_mb,
        progress=progress,
        options=dict(asked.extras if options is None else options),
        widen=None if source.wider is None else wider,
    )
    if vehicle.autopilot is Autopilot.ARDUPLANE and vehicle.turn_radius_m <= 0.0:
        notes.append(
            "arduplane with turn_radius_m 0 is flown as a VTOL (QuadPlane): vertical take-off and landing; corners "
            "are cut and the landing place is overshot while braking: track_error_m must hold both"
        )
    return problem, tuple(notes)


def lowest_amsl(air: Airspace, east_m: float, north_m: float, limits: Limits) -> float:
    """The lowest altitude that a path may begin or end with, in whichever direction it leaves; inf over unknown ground.

    A path's room is bounded piece by piece (`Airspace.tube`), a little above what hovering at the point would need.
    """
    low = float(air.floor_amsl(east_m, north_m, limits))
    for east, north in ((0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5)):
        tube = air.tube([(east_m, north_m), (east_m + east, north_m + north)], limits)
        low = max(low, float(tube.floor_m.max()))
    return low


def _largest_bow_m(world: World) -> float:
    """Bow of the longest leg that may be flown in this world (small in the papers' 100 m worlds)."""
    surface = world.airspace.surface
    rows, cols = surface.ground_m.shape
    corners = surface.grid.to_plane([0, cols - 1, 0, cols - 1], [0, 0, rows - 1, rows - 1])
    north_m = float(corners[:, 1].max())
    half_m = 0.5 * min(LONGEST_LEG_M, float(np.linalg.norm(np.ptp(corners, axis=0))))
    ends = world.frame.to_degrees([-half_m, half_m], [north_m, north_m])
    return float(world.frame.bow_m(ends[0], ends[1])[0]) + 1e-3


def _with_margins(limits: Limits, margins: Margins, *, terrain: bool, source: MissionFile) -> Limits:
    """The limits a planner is held to: the vehicle's, less what the wire's rounding and the bow may take."""

    def less(angle_deg: float) -> float:
        return math.degrees(math.atan(math.tan(math.radians(angle_deg)) * (1.0 - margins.slope)))

    return replace(
        limits,
        track_error_m=limits.track_error_m + margins.track_m + margins.bow_m,
        altitude_error_m=limits.altitude_error_m + margins.altitude_m + (source.terrain_error_m if terrain else 0.0),
        max_climb_deg=limits.max_climb_deg if limits.max_climb_deg >= 90 else less(limits.max_climb_deg),
        max_descent_deg=limits.max_descent_deg if limits.max_descent_deg >= 90 else less(limits.max_descent_deg),
    )


def run_planner(run: Callable[[Problem], Solution], problem: Problem, vehicle: Vehicle, world: World) -> Solution:
    try:
        return run(problem)
    except Refusal as refusal:
        raise in_degrees(refusal, vehicle, world) from refusal
    except NoMission as refusal:
        raise NoMission(f"{vehicle.name}: {refusal.message}", reason=refusal.reason) from refusal  # type: ignore[arg-type]


def in_degrees(refusal: Refusal, vehicle: Vehicle, world: World) -> NoMission:
    """A planner's refusal as the user reads it: whose it is, and its place in degrees."""
    place = ""
    if refusal.east_m is not None and refusal.north_m is not None:
        lat, lon = (float(x) for x in world.frame.to_degrees(refusal.east_m, refusal.north_m))
        place = f" ({refusal.place_of + ' ' if refusal.place_of else ''}at {lat:.6f}, {lon:.6f})"
    return NoMission(f"{vehicle.name}: {refusal.message}{place}", reason=refusal.reason)  # type: ignore[arg-type]
