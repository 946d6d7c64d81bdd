"""Time tables that hold in every declared wind: the speeds that vehicles keep in each, and what else would do.

What a refusal reports is tried: the whole time table is made again with it, and judged.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gcsplan.app.fleet.gates import having, waits_for_time
from gcsplan.app.plan.model import Brief, FleetPlan, VehiclePlan
from gcsplan.app.plan.problem import built_again
from gcsplan.app.plan.vehicle import rebuilt
from gcsplan.errors import NoMission
from gcsplan.figures import floored, raised
from gcsplan.fleet.arrival import Crew, Hold, Mode, Schedule, schedule
from gcsplan.fleet.intervals import Interval, steadiest
from gcsplan.fleet.motion.timing import Course, flown_corners
from gcsplan.notes.note import Note
from gcsplan.wind.drift import Drifts

__all__ = [
    "NotInEveryWind",
    "at_speeds",
    "corners_cut_m",
    "drifts",
    "goals_too_near",
    "in_every_wind",
    "in_steadiest_order",
    "require_intervals",
    "schedule_in_wind",
    "steadier",
    "with_cures",
]

MOST_TRIED = 8
"""Most vehicles with which a refusal tries what would do."""
CURE_TRIES = 3
"""Winds, and intervals twice, that a refusal tries: up to the first that works, and then between."""
INTERVAL_FACTOR = 2
"""Factor from one interval that is tried to the next."""


@dataclass(frozen=True, slots=True)
class SpeedRange:
    """Lowest and highest speeds with which a time table is begun; departures may then need others, but none higher."""

    least_m_s: float = 0.0
    most_m_s: float = math.inf


Retimed = Callable[[Sequence[VehiclePlan], Brief], object]
"""Makes the time table of vehicles again, under the terms of a brief; raises NoMission."""


class NotInEveryWind(NoMission):
    """The time table cannot be kept in some declared wind; ``window_s`` is the least that its flights could keep.

    ``names`` are the vehicles that drift more than the ones beside them.
    """

    def __init__(self, message: str, window_s: float, names: frozenset[str]) -> None:
        super().__init__(message, reason="time")
        self.window_s, self.names = window_s, names


def drifts(v: VehiclePlan) -> bool:
    """Whether a declared wind, or a late departure, changes a time of the vehicle's flight."""
    return v.verdict.drift is not None and v.verdict.drift.moves


def _is_blown(v: VehiclePlan) -> bool:
    """Whether a declared wind changes a time of the vehicle's flight."""
    return v.verdict.drift is not None and v.verdict.drift.blown


def in_every_wind(flown: Sequence[VehiclePlan], brief: Brief) -> bool | None:
    """Whether the whole time table holds in every declared wind; None in still air."""
    if brief.source.wind.still or any(v.verdict.drift is None for v in flown):
        return None
    return brief.source.arrival is not None or not any(map(drifts, flown))


def steadier(vehicles: Sequence[VehiclePlan], hold: Hold) -> dict[str, SpeedRange]:
    """Ranges of speeds at which vehicles drift less, m/s; of the vehicles that have one.

    A multicopter keeps its speed over ground in every wind up to some speed. A fixed wing drifts the less the faster it
    is, and can wait on the ground instead.
    """
    found = {}
    for v in vehicles:
        blown, vehicle = v.verdict.in_wind, v.request.vehicle
        if blown is None or not _is_blown(v):
            continue
        keeps_m_s = floored(blown.keeps_part * v.speed_m_s, 2)
        if vehicle.keeps_airspeed and hold == "ground":
            found[v.name] = SpeedRange(vehicle.speed_max_m_s, vehicle.speed_max_m_s)
        elif vehicle.speed_min_m_s <= keeps_m_s < vehicle.speed_max_m_s:
            found[v.name] = SpeedRange(0.0, keeps_m_s)
    return found


def at_speeds(vehicles: Sequence[VehiclePlan], plan: Schedule, brief: Brief) -> dict[str, VehiclePlan]:
    """The vehicles' missions at the speeds of a schedule. One that may not fly is refused later, when it is timed."""
    found = {}
    slots = {slot.name: slot for slot in plan.slots}
    for v in vehicles:
        if v.name in slots:
            slot = slots[v.name]
            try:
                found[v.name] = rebuilt(v, brief, speed_m_s=slot.speed_m_s, hold_s=slot.hold_s, depart_s=slot.depart_s)
            except NoMission:
                found[v.name] = v
    return found


def in_steadiest_order(vehicles: Sequence[VehiclePlan], crews: Sequence[Crew], brief: Brief, spare_s: float) -> Brief:
    """The brief with an order in which the declared winds change the intervals least, if it leaves the order open.

    Its windows suffice if they can; ``spare_s``: seconds by which an interval may be beyond its window.
    """
    arrival = brief.source.arrival
    if arrival is None or not arrival.best_order or arrival.mode != "sequence" or arrival.hold != "ground":
        return brief
    alone = schedule(crews, "none")
    flown = at_speeds(vehicles, alone, brief)
    found = {name: v.verdict.arrival_drift for name, v in flown.items()}
    order = steadiest(alone.order, found, min(arrival.window_s + spare_s, arrival.interval_s))
    return _with(brief, arrival=replace(arrival, order=tuple(order), best_order=False))


def corners_cut_m(v: VehiclePlan, course: Course) -> float:
    """How far a multicopter's way may be from the one in still air: where it is slower it cuts its corners less."""
    if not _is_blown(v) or v.verdict.in_wind is None or v.verdict.in_wind.vehicle.keeps_airspeed:
        return 0.0
    corners, points = flown_corners(course.route), course.fly(v.speed_m_s).points
    a, along = corners[:-1], np.diff(corners, axis=0)
    length2 = np.maximum((along**2).sum(axis=1), 1e-12)
    part = np.clip(((points[:, None] - a) * along).sum(axis=2) / length2, 0.0, 1.0)
    off = np.linalg.norm(points[:, None] - a - part[..., None] * along, axis=2)
    return float(off.min(axis=1).max())


def require_intervals(
    found: Sequence[Interval], mode: Mode, window_s: float, drifts_of: Mapping[str, Drifts],
    vehicles: Sequence[VehiclePlan],
) -> None:  # fmt: skip
    """Raise NotInEveryWind unless order and intervals of ``vehicles`` hold in every wind, with late departures;
    ``drifts_of``: the arrivals' by name."""
    bad = [one for one in found if not one.kept(mode, window_s)]
    if not bad:
        return
    worst = max(bad, key=lambda one: one.off_s)
    widest_s = max(one.width_s for one in found)
    least_s, most_s = floored(worst.least_s, 1), raised(worst.most_s, 1)
    apart = f"{least_s:.1f} to {most_s:.1f} s" if least_s >= 0.0 else f"{-least_s:.1f} s before to {most_s:.1f} s"
    request = f"{abs(round(worst.requested_s, 1)):g} s" + (
        f" ± {window_s:g} s (window_s)" if window_s else " (window_s: 0)"
    )
    late_s = max(v.request.depart_window_s for v in vehicles)
    when = "in the declared winds" if any(map(_is_blown, vehicles)) else ""
    if late_s:
        when += f"{', ' if when else ''}with departures up to {late_s:g} s late (depart_window_s),"
    raise NotInEveryWind(
        f"{when} {worst.second} arrives {apart} after {worst.first}, requested are {request}", widest_s,
        frozenset(max(one.first, one.second, key=lambda name: drifts_of[name].most_s) for one in bad),
    )  # fmt: skip


def schedule_in_wind(flown: Sequence[VehiclePlan], fleet: FleetPlan) -> list[Note]:
    """The note on what the declared winds make of a time table: it holds in each, or nothing was requested of it."""
    placed = sorted(((fleet.slot(v.name), v.verdict) for v in flown), key=lambda one: one[0].arrive_s)
    known = [w for w in (verdict.arrive_window_s(slot) for slot, verdict in placed) if w is not None]
    blown = [v.verdict.in_wind for v in flown]
    if len(known) < 2 or all(one is None or one.wind.still for one in blown):  # departures alone make windows, too
        return []
    if fleet.in_every_wind and not any(drifts(v) for v in flown):
        return [Note("schedule_in_every_wind")]
    if fleet.in_every_wind:
        off_s = max((one.off_s for one in fleet.intervals), default=0.0)
        return [Note("schedule_kept_in_winds", off_s=off_s)]
    over_s = [before[1] - after[0] for before, after in pairwise(known)]
    return [Note("schedule_in_still_air", overlapping=sum(s > 0.0 for s in over_s), most_s=max(*over_s, 0.0))]


def goals_too_near(why: NoMission) -> bool:
    """Whether goals are so near that no departure, speed or path helps; the refusal says how far apart they must be."""
    from gcsplan.fleet.resolve import NotSeparated

    return isinstance(why, NotSeparated) and why.goals_m is not None and why.interval_s is None


def with_cures(why: NoMission, vehicles: Sequence[VehiclePlan], brief: Brief, again: Retimed) -> NoMission:
    """The refusal with what would do, each tried: a wider window, a longer interval, gates, lower speeds, a weaker wind
    or shorter windows of departure."""
    curable = isinstance(why, NotInEveryWind) or (why.reason == "separation" and not goals_too_near(why))
    if len(vehicles) > MOST_TRIED or not curable:
        return why
    near: list[NoMission] = []

    def tried(some: Sequence[VehiclePlan], terms: Brief) -> object:
        try:
            return again(some, terms)
        except NoMission as refusal:
            near.extend([refusal] if goals_too_near(refusal) else [])
            raise

    found = [
        *_windows(why, vehicles, brief, tried),
        *_gates(vehicles, brief, tried),
        *_speeds(vehicles, brief, tried),
        *_winds(vehicles, brief, tried),
        *_departures(vehicles, brief, tried),
    ]
    what = (
        f"what works: {', or '.join(found)}"
        if found
        else "no window, interval, gate, speed, departure or weaker wind that was tried helps"
        + (f", for {near[0]}" if near else "")
    )
    return NoMission(f"{why}; {what}", reason="time" if isinstance(why, NotInEveryWind) else "separation")


def _works(again: Retimed, vehicles: Sequence[VehiclePlan], brief: Brief) -> bool:
    try:
        again(vehicles, brief)
    except NoMission:
        return False
    return True


def _windows(why: NoMission, vehicles: Sequence[VehiclePlan], brief: Brief, again: Retimed) -> list[str]:
    """The smallest window, and with it, or with the present one, the smallest of the intervals that are tried."""
    arrival = brief.source.arrival
    assert arrival is not None
    window_s = max(arrival.window_s, raised(why.window_s, 1) if isinstance(why, NotInEveryWind) else 0.0)
    words = "" if window_s == arrival.window_s else f"window_s: {window_s:g}"

    def works(interval_s: float) -> bool:
        request = replace(arrival, window_s=window_s, interval_s=interval_s)
        return _works(again, vehicles, _with(brief, arrival=request))

    if words and works(arrival.interval_s):
        return [words]
    if arrival.mode != "sequence":
        return []
    bad, good = math.floor(arrival.interval_s), max(math.ceil(arrival.interval_s), math.ceil(2.0 * window_s)) + 1
    for _ in range(CURE_TRIES):
        if works(good):
            break
        bad, good = good, good * INTERVAL_FACTOR
    else:
        return []
    for _ in range(CURE_TRIES):
        middle = (good + bad) // 2
        if middle == bad:
            break
        bad, good = (bad, middle) if works(middle) else (middle, good)
    return [f"{words} with interval_s: {good}" if words else f"interval_s: {good}"]


def _gates(vehicles: Sequence[VehiclePlan], brief: Brief, again: Retimed) -> list[str]:
    """The least number of gates on the copters' ways, where these need a common start that is not given."""
    arrival = brief.source.arrival
    assert arrival is not None
    if arrival.gates not in (None, "auto") or not any(waits_for_time(v.request.vehicle) for v in vehicles):
        return []
    for count in range(1, CURE_TRIES + 1):
        if _works(again, vehicles, having(brief, count)):
            return [f"gates: {count} with a common start (--gate-utc)"]
    return []


def _speeds(vehicles: Sequence[VehiclePlan], brief: Brief, again: Retimed) -> list[str]:
    """The lower ends of speed ranges at which multicopters keep their speeds in every wind."""
    slower, words = [], []
    for v in vehicles:
        blown, vehicle = v.verdict.in_wind, v.request.vehicle
        keeps_m_s = math.inf if blown is None else floored(blown.keeps_part * v.speed_m_s, 1)
        if 0.0 < keeps_m_s < vehicle.speed_min_m_s:
            words.append(f"speed_m_s of {v.name} from {keeps_m_s:g}")
            vehicle = replace(vehicle, speed_min_m_s=keeps_m_s)
        slower.append(replace(v, request=replace(v.request, vehicle=vehicle)))
    return [" and ".join(words)] if words and _works(again, slower, brief) else []


def _winds(vehicles: Sequence[VehiclePlan], brief: Brief, again: Retimed) -> list[str]:
    """The strongest of some weaker sets of winds of the same form."""
    wind = brief.source.wind

    def works(up_to_m_s: float) -> bool:
        return _judged_works(again, vehicles, _with(brief, wind=wind.scaled(up_to_m_s / wind.strongest_m_s)))

    most_m_s = _most(wind.strongest_m_s, works)
    return [f"winds of at most {most_m_s:g} m/s, gusts included"] if most_m_s else []


def _departures(vehicles: Sequence[VehiclePlan], brief: Brief, again: Retimed) -> list[str]:
    """The longest of some shorter windows of departure."""

    def works(late_s: float) -> bool:
        requests = [replace(v.request, depart_window_s=min(v.request.depart_window_s, late_s)) for v in vehicles]
        tried = [replace(v, request=request) for v, request in zip(vehicles, requests, strict=True)]
        return _judged_works(again, tried, brief)

    most_s = _most(max(v.request.depart_window_s for v in vehicles), works)
    return [f"depart_window_s: {most_s:g} at most"] if most_s else []


def _most(refused: float, works: Callable[[float], bool]) -> float:
    """The largest of some smaller values, in tenths, that works; 0 if none does."""
    low, high = 0.0, refused
    for _ in range(CURE_TRIES):
        middle = floored(0.5 * (low + high), 1)
        if middle <= low:
            break
        low, high = (middle, high) if works(middle) else (low, middle)
    return low


def _judged_works(again: Retimed, vehicles: Sequence[VehiclePlan], brief: Brief) -> bool:
    """As `_works`, with the missions judged anew."""
    try:
        tried = []
        for v in vehicles:
            mission, verdict = built_again(v, brief, v.order)
            tried.append(replace(v, mission=mission, verdict=verdict))
    except NoMission:
        return False
    return _works(again, tried, brief)


def _with(brief: Brief, **changes: object) -> Brief:
    return replace(brief, source=replace(brief.source, **changes))  # type: ignore[arg-type]
