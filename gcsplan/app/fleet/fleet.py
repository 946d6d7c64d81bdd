"""Plan all vehicles together: departures and speeds, so that they arrive as requested and keep apart.

The routes are those of the missions as the autopilots store them. A schedule sets departures, holds and speeds. Each
mission is rebuilt with its own and judged again. Then the separation of every pair is judged, and conflicts are
resolved or refused. Of a fixed wing's flight the time table needs climb-out, glide and final circle besides the path.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np

from gcsplan.app.fleet.every_wind import (
    NotInEveryWind,
    SpeedRange,
    at_speeds,
    corners_cut_m,
    drifts,
    goals_too_near,
    in_every_wind,
    in_steadiest_order,
    require_intervals,
    schedule_in_wind,
    steadier,
    with_cures,
)
from gcsplan.app.fleet.gates import (
    WHERE,
    counts,
    gated,
    gates_bought,
    having,
    no_time_of_day,
    some_start,
    waits_for_time,
)
from gcsplan.app.fleet.reroute import Detours
from gcsplan.app.fleet.start_time import SLACK_S, GateTime, with_start_gates
from gcsplan.app.plan.flight_hours import within_hours
from gcsplan.app.plan.left_out import LeavingOut, LeftOut, least_to_leave
from gcsplan.app.plan.model import Brief, FleetPlan, Plan, VehiclePlan
from gcsplan.app.plan.vehicle import over_one_terrain, rebuilt
from gcsplan.arrays import Floats
from gcsplan.check.flight.times import over_ground, pace_over_ground
from gcsplan.check.motion.circles import PLANE_LOITER_RADIUS_M, circle_reach_m
from gcsplan.check.verdict import WHOLE_S, LegFigures
from gcsplan.errors import InputError, NoMission, heed_cancel
from gcsplan.fleet.arrival import Craft, Crew, NoSchedule, Schedule, Slot, schedule
from gcsplan.fleet.intervals import Interval, centred, intervals
from gcsplan.fleet.motion.timing import Course, Route, TimedPath, motion_error_m
from gcsplan.mission_file import ArrivalRequest
from gcsplan.notes.note import Note
from gcsplan.planners.problem import Progress
from gcsplan.world.world import World

if TYPE_CHECKING:
    from gcsplan.fleet.separation import AirPlace, Conflict, Rules, Separation, Where

__all__ = ["crew_of", "finished", "fleet_of", "motion_of", "route_of", "rules_of", "too_near", "without"]


def _climb_out_and_glide(v: VehiclePlan, world: World) -> tuple[Floats | None, Floats | None]:
    """The climb-out and the glide of a fixed wing, (K, 3) metres each; None where the flight has no such part."""
    if v.order.wing is None:
        return None, None
    legs = v.verdict.legs
    first = next(i for i, leg in enumerate(legs) if leg.on_path)
    down = [leg for leg in legs[first:] if leg.kind == "land"]
    return _line(legs[:first], world), _line(down, world) if down else None


def _climb_out_m_s(v: VehiclePlan) -> Floats | None:
    """Speeds (K - 1,) of the parts of the climb-out, m/s; None: the same as on any leg, or no fixed wing."""
    if v.order.wing is None or v.request.vehicle.climb_out is None:
        return None
    legs = v.verdict.legs
    first = next(i for i, leg in enumerate(legs) if leg.on_path)
    return np.array([leg.length_m / leg.time_s if leg.time_s > 0.0 else 1.0 for leg in legs[:first]])


def _circling_m(v: VehiclePlan) -> float:
    """Distance from its last point, m, that a vehicle may have while it circles there for good; 0 for any other end."""
    wing = v.order.wing
    if wing is None or v.request.end not in ("loiter", "rtl"):
        return 0.0  # circles for climbing are part of the motion
    highest = max(leg.end[2] for leg in v.verdict.legs)
    radius = wing.circle_m if v.request.end == "loiter" else PLANE_LOITER_RADIUS_M
    vehicle = v.request.vehicle
    radius = max(radius, math.ceil(vehicle.turn_radius_m))
    return circle_reach_m(radius, highest, vehicle.speed_max_m_s, vehicle.wind_m_s)


def _line(legs: Sequence[LegFigures], world: World) -> Floats:
    places = np.array([legs[0].start, *(leg.end for leg in legs)])
    return np.column_stack([world.frame.to_plane(places[:, 0], places[:, 1]), places[:, 2]])


LATER_S = 600.0
"""Seconds by which all arrivals may be delayed to keep a fleet apart, if the mission file sets no arrival time."""
SEPARATION_M = 30.0
"""Separation that is judged if the file has no `arrival`, m."""
DRIFT_ROUNDS = 3
"""Times that departures are chosen for the drifts of flights whose speeds then change."""
MOST_CONFLICTS = 8
"""Most conflicts that a refusal or a note names."""

_Left = tuple[tuple[tuple[VehiclePlan, ...], FleetPlan], LeavingOut]
"""Who flies with its time table, and who is left out."""


def finished(
    brief: Brief,
    vehicles: Sequence[VehiclePlan],
    progress: Callable[[str, Progress], None] | None = None,
    leaving: LeavingOut | None = None,
    gate: GateTime | None = None,
) -> Plan:
    """The plan of a mission from its vehicles' own ones. Raises InputError, NoMission."""
    leaving = leaving or LeavingOut(allowed=False)
    brief, vehicles = over_one_terrain(brief, vehicles, progress, leaving)
    leaving.require_some(vehicles)
    source = brief.source
    flown, fleet = fleet_of(vehicles, brief, gate, leaving)
    judged = within_hours(source, flown, [v.verdict for v in flown], fleet)
    flown = tuple(
        v if verdict is v.verdict else replace(v, verdict=verdict) for v, verdict in zip(flown, judged, strict=True)
    )
    notes: list[Note] = list(source.notes)
    if len(flown) > 1 and source.arrival is None:
        notes.append(Note("no_arrival_asked"))
    notes += fleet.notes
    notes += schedule_in_wind(flown, fleet)
    if brief.objective == "energy" and any(not v.verdict.energy_stated for v in flown):
        flown = tuple(replace(v, verdict=replace(v.verdict, energy_stated=True, paper_energy=True)) for v in flown)
        notes.append(Note("paper_energy_minimised"))
    return Plan(
        source, brief.world, brief.planner, brief.objective, brief.seed, flown, tuple(notes), fleet,
        tuple(leaving.found), leaving.allowed,
    )  # fmt: skip


def fleet_of(
    vehicles: Sequence[VehiclePlan], brief: Brief, gate: GateTime | None = None, leaving: LeavingOut | None = None
) -> tuple[tuple[VehiclePlan, ...], FleetPlan]:
    """The vehicles' missions with their speeds and gates, and the fleet's time table.

    With ``gate`` every vehicle waits in the air until its own second of the day. Raises NoMission: ``time`` if they
    cannot arrive as requested, ``separation`` if they cannot keep apart; with ``leaving`` such vehicles may be left
    out, and the results are those of the others.
    """
    leaving = leaving or LeavingOut(allowed=False)
    arrival = brief.source.arrival
    if arrival is not None and gate is None and arrival.gates not in (None, "auto"):
        gate = GateTime.stated(brief.source)
        if gate is None:
            raise InputError(
                "gates open at times of the day: give the common start as the mission's `at` "
                "(2026-11-21T18:30:00Z), or as --gate-utc",
                where=WHERE,
            )
    at_start = gate if arrival is None or arrival.gates is None else None  # else they wait on the way, or nowhere
    if arrival is None or len(vehicles) < 2 or not any(drifts(v) for v in vehicles):
        gates = None if arrival is None else next(counts(arrival.gates))
        return _fleet_of(vehicles, having(brief, gates), at_start if gates is None else gate, leaving, {})

    def again(tried: Sequence[VehiclePlan], terms: Brief) -> tuple[tuple[VehiclePlan, ...], FleetPlan]:
        """With as few gates as are requested; as in still air, at speeds at which the vehicles drift less, or in an
        order, too, whose intervals drift less."""
        assert terms.source.arrival is not None
        request, refusal = terms.source.arrival.gates, NoMission("", reason="time")
        speeds = steadier(tried, terms.source.arrival.hold)
        paces: list[tuple[Mapping[str, SpeedRange], bool]] = [({}, False), (speeds, False)] if speeds else [({}, False)]
        if terms.source.arrival.best_order:
            paces.append((speeds, True))
        for gates in counts(None if request == "auto" and gate is None else request):
            for pace, steady in paces:
                start = at_start if gates is None else gate or GateTime(some_start(brief.source))
                try:
                    return _fleet_of(tried, having(terms, gates), start, LeavingOut(allowed=False), pace, steady)
                except NoMission as why:
                    if goals_too_near(why):
                        raise
                    if isinstance(why, NotInEveryWind) or not isinstance(refusal, NotInEveryWind):
                        refusal = why
        raise refusal

    try:
        return again(vehicles, brief)
    except NoMission as why:
        if not leaving.allowed:
            raise with_cures(why, vehicles, brief, again) from why
    return _fewest_left_out(vehicles, brief, gate, at_start, leaving)


def _fewest_left_out(
    vehicles: Sequence[VehiclePlan], brief: Brief, gate: GateTime | None, at_start: GateTime | None, leaving: LeavingOut
) -> tuple[tuple[VehiclePlan, ...], FleetPlan]:
    """`fleet_of` with the least number of gates with which the fewest vehicles are left out."""
    arrival, found, refusals = brief.source.arrival, list[_Left](), list[NoMission]()
    assert arrival is not None
    for gates in counts(None if arrival.gates == "auto" and gate is None else arrival.gates):
        start = at_start if gates is None else gate
        try:
            found.append(_leaving_out(vehicles, having(brief, gates), start, leaving.found))
        except NoMission as why:
            refusals.append(why)
            continue
        if len(found[-1][1].found) == len(leaving.found) + 1:
            break  # not fewer, for with all it is refused
    if not found:
        raise refusals[0]
    flown, left = min(found, key=lambda one: len(one[1].found))
    leaving.found = left.found
    return flown


def _leaving_out(
    vehicles: Sequence[VehiclePlan], brief: Brief, gate: GateTime | None, found: Sequence[LeftOut]
) -> _Left:
    """`fleet_of` without the vehicles that cannot keep the time table with these gates, and who is left out, ``found``
    included. Raises NoMission if none is left."""
    arrival = brief.source.arrival
    assert arrival is not None
    speeds, left = steadier(vehicles, arrival.hold), LeavingOut(allowed=True, found=found)
    while True:
        tried = LeavingOut(allowed=True, found=left.found)
        waits = arrival.gates is None or any(waits_for_time(v.request.vehicle) for v in vehicles)
        terms, start = (brief, gate) if waits else (having(brief, None), None)
        try:
            return _fleet_of(vehicles, terms, start, tried, speeds, steady=True), tried
        except NotInEveryWind as why:  # the sequence closes up
            for name in sorted(why.names):
                left.leave(name, why)
            vehicles = [v for v in vehicles if v.name not in why.names]
            left.require_some(vehicles)


def _fleet_of(
    vehicles: Sequence[VehiclePlan], brief: Brief, gate: GateTime | None, leaving: LeavingOut,
    speeds: Mapping[str, SpeedRange], steady: bool = False,
) -> tuple[tuple[VehiclePlan, ...], FleetPlan]:  # fmt: skip
    """`fleet_of`, with the ``speeds`` of some vehicles; ``steady``: in an order in which winds change little."""
    world, arrival = brief.world, brief.source.arrival
    gates = None if arrival is None or gate is None else arrival.gates
    common, gate_times = gate, None if gates else gate

    def on_way(some: Sequence[VehiclePlan], leaving: LeavingOut) -> list[VehiclePlan]:
        if not gates or common is None or isinstance(gates, str):
            return list(some)
        most_m_s = {name: pace.most_m_s for name, pace in speeds.items()}
        return gated(some, brief, gates, common.start, most_m_s, leaving)

    vehicles = on_way(vehicles, leaving)
    waiting = {v.name for v in vehicles if v.order.gates is not None}
    crews = [_paced(crew_of(v, world), _pace_of(v, speeds)) for v in vehicles]
    if steady:
        brief = in_steadiest_order(vehicles, crews, brief, 0.0 if gate is None else WHOLE_S)
        arrival = brief.source.arrival
    notes: list[Note] = []
    requested = None
    if arrival is None:
        plan = schedule(crews, "none")
    else:
        detours = Detours(
            vehicles, brief, partial(rules_of, arrival, vehicles, world), lambda v: route_of(v, world),
            lambda v: on_way([v], LeavingOut(allowed=False))[0] if v.name in waiting else v,
        )  # fmt: skip
        requested, notes = _scheduled(crews, arrival, detours, leaving)
        plan = requested
        if any(drifts(v) for v in vehicles):
            plan = _kept_in_wind(requested, crews, brief, gate, detours, leaving)
        elif len(plan.slots) > 1:
            plan = _kept_apart(plan, crews, brief, arrival, detours, leaving)
        placed = {slot.name: slot for slot in plan.slots}
        vehicles = [detours.plan_of(v.name, placed[v.name].route) for v in vehicles if v.name in placed]
        crews = [crew_of(v, world) for v in vehicles]
    flown, slots = _timed(vehicles, crews, plan, brief, gate_times, leaving)
    leaving.require_some(flown)
    flown, slots, motions, found = _judged(flown, slots, arrival, world, leaving)
    if found is not None:
        notes += found.notes
        if not found.safe:
            notes.append(Note("nothing_keeps_apart", met=too_near(found.conflicts, world)))
    apart = _intervals(requested, flown, slots, arrival, gate)
    if gate is not None:
        start_utc = f"{gate.start:%Y-%m-%d %H:%M:%S}"
        notes.append(
            Note("gates_on_way_open", start_utc=start_utc) if gates
            else Note("gates_open", start_utc=start_utc, spare_s=SLACK_S)
        )  # fmt: skip
    notes += [
        Note("speed_kept_in_wind", vehicle=v.name, speed_m_s=speeds[v.name].most_m_s)
        for v in flown if v.name in speeds and not v.request.vehicle.keeps_airspeed
    ]  # fmt: skip
    if gates:
        notes += [
            no_time_of_day(v.request.vehicle).of(vehicle=v.name)
            for v in flown if not waits_for_time(v.request.vehicle)
        ]  # fmt: skip
        flown = [gates_bought(v, slot, brief) for v, slot in zip(flown, slots, strict=True)]
    names = {v.name for v in flown}
    order = tuple(name for name in plan.order if name in names)
    return tuple(flown), FleetPlan(
        plan.mode, order, plan.interval_s, tuple(slots), tuple(motions), found, tuple(notes),
        None if gate is None else gate.start, apart,
        in_every_wind(flown, brief),
    )  # fmt: skip


def _judged(
    flown: list[VehiclePlan], slots: list[Slot], arrival: ArrivalRequest | None, world: World, leaving: LeavingOut
) -> tuple[list[VehiclePlan], list[Slot], list[TimedPath], Separation | None]:
    """The vehicles that keep apart, with their slots, motions and separation. Raises NoMission."""
    motions = [motion_of(v, slot, world) for v, slot in zip(flown, slots, strict=True)]
    found = _separation(motions, flown, arrival, world)
    if found is not None and not found.safe and arrival is not None:
        # The missions as built are what is flown, so this check decides.
        if not leaving.allowed:
            raise NoMission(str(too_near(found.conflicts, world)), reason="separation")
        leave = least_to_leave(found.conflicts)
        for name, conflict in leave.items():
            leaving.leave(name, NoMission(str(too_near([conflict], world)), reason="separation"))
        rows = [k for k, v in enumerate(flown) if v.name not in leave]
        flown, slots, motions = [flown[k] for k in rows], [slots[k] for k in rows], [motions[k] for k in rows]
        found = _separation(motions, flown, arrival, world)
    return flown, slots, motions, found


def _pace_of(v: VehiclePlan, speeds: Mapping[str, SpeedRange]) -> SpeedRange:
    """The speeds of a vehicle: with gates the one for which they open."""
    return speeds.get(v.name, SpeedRange()) if v.order.gates is None else SpeedRange(v.speed_m_s, v.speed_m_s)


def _paced(crew: Crew, speeds: SpeedRange) -> Crew:
    return replace(crew, least_m_s=speeds.least_m_s, most_m_s=speeds.most_m_s)


def _kept_in_wind(
    requested: Schedule, crews: Sequence[Crew], brief: Brief, gate: GateTime | None, detours: Detours,
    leaving: LeavingOut,
) -> Schedule:  # fmt: skip
    """The schedule with its intervals in the middle of what the declared winds make of them, and kept apart in each.

    Drifts depend on speeds, which change where vehicles are kept apart, so this is done again until nothing changes.
    Raises NotInEveryWind if no departures of these flights keep the order and the intervals.
    """
    arrival = brief.source.arrival
    assert arrival is not None
    plan = requested
    for _ in range(DRIFT_ROUNDS):
        routes = {slot.name: slot.route for slot in plan.slots}
        flown = at_speeds([detours.plan_of(name, route) for name, route in routes.items()], plan, brief)
        if arrival.hold == "ground":
            found = {name: v.verdict.arrival_drift for name, v in flown.items()}
            plan = centred(requested, plan, found, later=arrival.arrive_s is None)
            _intervals(requested, list(flown.values()), plan.slots, arrival, gate)
        crews = [
            replace(
                c, least_m_s=0.0 if flown[c.name].order.gates is None else c.least_m_s,
                drift=flown[c.name].verdict.drift, route=routes[c.name],
            )
            for c in crews if c.name in flown
        ]  # fmt: skip
        before = {slot.name: (slot.speed_m_s, slot.route) for slot in plan.slots}
        if len(plan.slots) > 1:
            plan = _kept_apart(plan, crews, brief, arrival, detours, leaving)
        if all(before[slot.name] == (slot.speed_m_s, slot.route) for slot in plan.slots):
            break
    return plan


def _intervals(
    requested: Schedule | None, flown: Sequence[VehiclePlan], slots: Sequence[Slot], arrival: ArrivalRequest | None,
    gate: GateTime | None,
) -> tuple[Interval, ...]:  # fmt: skip
    """The intervals over all declared winds and departures; none in still air with departures on time. Raises
    NotInEveryWind if they are not kept."""
    if requested is None or arrival is None or all(v.verdict.drift is None for v in flown):
        return ()
    arrivals = {v.name: v.verdict.arrival_drift for v in flown}
    found = intervals(requested, slots, arrivals)
    if any(drifts(v) for v in flown):  # gates open at whole seconds
        require_intervals(found, arrival.mode, arrival.window_s + (0.0 if gate is None else WHOLE_S), arrivals, flown)
    return tuple(found)


def without(fleet: FleetPlan, kept: Sequence[VehiclePlan], arrival: ArrivalRequest | None, world: World) -> FleetPlan:
    """The time table of the vehicles that are ``kept``; the turns of the others stay empty."""
    names = [v.name for v in kept]
    motions = tuple(fleet.motion(name) for name in names)
    return replace(
        fleet, order=tuple(name for name in fleet.order if name in names),
        slots=tuple(fleet.slot(name) for name in names), motions=motions,
        separation=_separation(motions, kept, arrival, world),
        intervals=tuple(one for one in fleet.intervals if {one.first, one.second} <= set(names)),
    )  # fmt: skip


def _separation(
    motions: Sequence[TimedPath], flown: Sequence[VehiclePlan], arrival: ArrivalRequest | None, world: World
) -> Separation | None:
    heed_cancel()
    if len(flown) < 2:
        return None
    from gcsplan.fleet.separation import separation  # imported here because most plans have one vehicle

    drifting = [motion.drifting(v.verdict.drift) for motion, v in zip(motions, flown, strict=True)]
    return separation(drifting, rules_of(arrival, flown, world))


def _timed(
    vehicles: Sequence[VehiclePlan],
    crews: Sequence[Crew],
    plan: Schedule,
    brief: Brief,
    gate: GateTime | None,
    leaving: LeavingOut,
) -> tuple[list[VehiclePlan], list[Slot]]:
    """Every vehicle's mission with its speed and gate, and its slot."""
    placed = {slot.name: slot for slot in plan.slots}
    slots = [placed[v.name] for v in vehicles]
    opens: list[int | None] = [None] * len(slots)
    if gate is not None:
        with_gates = with_start_gates(crews, slots)
        slots, opens = [slot for slot, _ in with_gates], [opens_s for _, opens_s in with_gates]
    flown, kept = [], []
    for v, slot, opens_s in zip(vehicles, slots, opens, strict=True):
        at = None if gate is None or opens_s is None else gate.of_day(opens_s)
        try:
            made = rebuilt(v, brief, speed_m_s=slot.speed_m_s, hold_s=slot.hold_s, gate_utc=at, depart_s=slot.depart_s)
        except NoMission as why:
            leaving.leave(v.name, why)
            continue
        flown.append(made)
        kept.append(slot if made.order.gates is None else replace(slot, arrive_s=slot.depart_s + made.verdict.arrive_s))
    return flown, kept


def crew_of(v: VehiclePlan, world: World) -> Crew:
    """A vehicle and its route, in the form that the fleet package takes."""
    heed_cancel()
    return Crew(v.request.vehicle, route_of(v, world))


def route_of(v: VehiclePlan, world: World) -> Route:
    """The judged flight of the mission in metres, from the top of take-off to the approach, and how it ends.

    A mission of a paper that begins in the air and ends at its goal has no columns. Terrain-frame legs are cut every
    `check.clock.TERRAIN_STEP_M`: between way points they rise and sink with the ground.
    """
    request, legs = v.request, v.verdict.legs
    flown = [leg for leg in legs if leg.on_path]
    ends = np.array([flown[0].start, *(leg.end for leg in flown)])
    points = np.column_stack([world.frame.to_plane(ends[:, 0], ends[:, 1]), ends[:, 2]])
    first = legs.index(flown[0])
    holds = np.array([v.verdict.gate_s, *(leg.hold_s for leg in flown)])
    waits = [leg for leg in legs if leg.until_s is not None]
    for wait in waits:  # at the way point before it
        holds[1 + max(k for k, leg in enumerate(flown) if leg.seq < wait.seq)] += wait.hold_s
    ideal = request.end == "none" and request.start_amsl_m is not None
    ground = legs[0].start[2]
    ends_with = [leg for leg in legs[first:] if not leg.on_path]
    last = ends_with[-1] if ends_with else flown[-1]
    numbers = np.array([leg.seq for leg in flown], dtype=np.intp)
    if v.order.altitude_frame == "terrain":
        points, holds, numbers = over_ground(points, holds, numbers, world.vehicle_terrain)
    items = np.array([legs[0].seq, *numbers, last.seq], dtype=np.intp)
    own = np.append(items[:1], numbers)  # a hold belongs to its way point, unless it is an item of its own
    for wait in waits:
        own[np.flatnonzero(own < wait.seq)[-1]] = wait.seq
    pace = pace_over_ground(points, legs[0].start[:2], world.frame) if request.vehicle.lays_curves else None
    climb_out, glide = _climb_out_and_glide(v, world)
    return Route(
        v.name, points,
        start_ground_amsl_m=None if ideal else ground,
        goal_ground_amsl_m=last.end[2] if request.end == "land" else None,
        end=request.end,
        rtl_amsl_m=None if request.rtl_rel_home_m is None else ground + request.rtl_rel_home_m,
        holds_s=holds,
        items=items,
        climb_out=climb_out,
        climb_out_m_s=_climb_out_m_s(v),
        glide=glide,
        pace=pace,
        follows=v.order.altitude_frame == "terrain",
        hold_items=own if waits else None,
    )  # fmt: skip


def rules_of(arrival: ArrivalRequest | None, vehicles: Sequence[VehiclePlan], world: World) -> Rules:
    """The requested separation, with the error of the modelled motions."""
    from gcsplan.fleet.separation import Rules

    error_m = max(motion_error_m(v.request.vehicle) + _circling_m(v) for v in vehicles)
    error_m += max(
        corners_cut_m(v, Course(route_of(v, world), v.request.vehicle)) if drifts(v) else 0.0 for v in vehicles
    )
    leaving = frozenset(v.name for v in vehicles if v.request.end == "none")
    if arrival is None:
        return Rules(SEPARATION_M, error_m=error_m, leaving=leaving)
    return Rules(
        arrival.separation_m,
        error_m=error_m,
        window_s=arrival.window_s,
        pad_clear_s=math.inf if arrival.pad_clear_s is None else arrival.pad_clear_s,
        leaving=leaving,
    )


def _scheduled(
    crews: Sequence[Crew], arrival: ArrivalRequest, detours: Detours, leaving: LeavingOut
) -> tuple[Schedule, list[Note]]:
    """The requested schedule, and notes on it.

    If the file does not set `clock`, the first vehicle's clock is tried, then that of the whole fleet.
    """
    crafts = [Craft(c) for c in crews]
    names = {c.name for c in crafts}

    def by_clock(clock: Literal["first", "fleet"], *, leave_out: bool) -> Schedule:
        plan = schedule(
            crafts, arrival.mode,
            order="best" if arrival.best_order else [name for name in arrival.order if name in names],
            interval_s=arrival.interval_s, hold=arrival.hold, clock=clock, arrive_s=arrival.arrive_s,
            longer=detours.longer, leave_out=leave_out,
        )  # fmt: skip
        for why in plan.left_out:
            leaving.leave(why.vehicle, why)
        return plan

    open_clock = arrival.clock is None and arrival.arrive_s is None and arrival.mode == "sequence"
    try:
        return by_clock(arrival.clock or "first", leave_out=leaving.allowed and not open_clock), []
    except NoSchedule:
        if not open_clock:
            raise
    plan = by_clock("fleet", leave_out=leaving.allowed)
    first = plan.slots[0]
    alone_s = min(c.fast_s for c in crafts if c.name == first.name)
    note = Note(
        "clock_of_fleet", first=first.name, arrive_s=first.arrive_s, alone_s=alone_s, interval_s=plan.interval_s
    )  # fmt: skip
    return plan, [note]


def _kept_apart(
    plan: Schedule,
    crews: Sequence[Crew],
    brief: Brief,
    arrival: ArrivalRequest,
    detours: Detours,
    leaving: LeavingOut,
) -> Schedule:
    """The schedule with its conflicts resolved by departures, speeds, holds or other paths."""
    from gcsplan.fleet.resolve import resolve  # imported here because most plans have one vehicle

    settled = resolve(
        plan, crews, detours.rules,
        priority=[name for name in arrival.order if name in plan.order] if brief.by_priority else None,
        hold=arrival.hold,
        later_s=0.0 if arrival.arrive_s is not None else LATER_S,
        replan=detours,
        where=on_map(brief.world),
        leave_out=leaving.allowed,
    )  # fmt: skip
    for why in settled.left_out:
        leaving.leave(why.vehicle, why)
    return settled.schedule


def motion_of(v: VehiclePlan, slot: Slot, world: World) -> TimedPath:
    """The motion of the mission as built. Its items contain the hold already, unless a time of day ends it."""
    heed_cancel()
    course = Course(route_of(v, world), v.request.vehicle)
    return course.fly(slot.speed_m_s, slot.depart_s, slot.hold_s if v.order.gate_utc else 0.0)


def on_map(world: World) -> Where:
    """A function that names a place so that a person can find it on a map."""

    def named(place: AirPlace) -> Note:
        lat_deg, lon_deg = (float(x) for x in world.frame.to_degrees(place[0], place[1]))
        return Note("place_on_map", lat_deg=lat_deg, lon_deg=lon_deg, amsl_m=place[2])

    return named


def too_near(conflicts: Sequence[Conflict], world: World) -> Note:
    """Which vehicles come too near to each other, when and where; the first `MOST_CONFLICTS` of all."""
    where = on_map(world)
    first = [c.note(where) for c in conflicts[:MOST_CONFLICTS]]
    if len(conflicts) > MOST_CONFLICTS:
        first.append(Note("more_conflicts", count=len(conflicts) - MOST_CONFLICTS))
    return Note("too_near", conflicts=tuple(first))
