"""Gates on the way: way points at which copters wait until a second of the day, after which their times begin anew.

NAV_DELAY with hour, minute and second UTC holds no date: a vehicle that comes a moment too late waits for nearly a day.
So a gate opens after the latest second at which its vehicle may be there in the declared winds, which the check of the
mission proves again. In the air only ArduCopter waits so: ArduPlane goes on at once while it is armed
(`verify_nav_delay`), and PX4 reads the seconds alone, of which a time of day has none (`get_time_inside`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Literal

import numpy as np

from gcsplan.app.plan.left_out import LeavingOut
from gcsplan.app.plan.model import Brief, VehiclePlan
from gcsplan.app.plan.problem import built_again
from gcsplan.app.plan.vehicle import rebuilt
from gcsplan.errors import InputError, NoMission
from gcsplan.fleet.arrival import Slot
from gcsplan.mavlink.build.order import Gates
from gcsplan.mission_file.request import GatePlaces, MissionFile
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.path import nearest_on, track_length_m

__all__ = ["WHERE", "counts", "gated", "gates_bought", "having", "no_time_of_day", "some_start", "waits_for_time"]

WHERE = "arrival.gates"
MOST_SOUGHT = 8
"""Most gates that `auto` tries."""
BESIDE_WAY_M = 100.0
"""Metres within which a vehicle passes a place, to have a gate beside it."""
BETWEEN_GATES_M = 200.0
"""Least distance of gates on a way from each other, and from its begin, m."""
BEFORE_GOAL_M = 50.0
"""Least distance of a gate from the goal, m: only what is flown behind the last one makes the arrival uncertain, and a
copter that a wind slows to 3 m/s flies 200 m in up to 30 s more."""
GUESS_S = 600
"""Seconds between gates before it is known how long the flight to them takes."""

ANY_START = datetime(2000, 1, 1, tzinfo=UTC)

GateRequest = int | GatePlaces | Literal["auto"] | None


def some_start(source: MissionFile) -> datetime:
    """A common start for what is not flown: a rehearsal in simulated time, and how many gates would do."""
    return source.departure or ANY_START


def counts(request: GateRequest) -> Iterator[int | GatePlaces | None]:
    """The gates to try for a request, in turn."""
    if isinstance(request, str):
        yield from (None, *range(1, MOST_SOUGHT + 1))
    else:
        yield request


def having(brief: Brief, gates: int | GatePlaces | None) -> Brief:
    """The brief with these gates."""
    arrival = brief.source.arrival
    if arrival is None or arrival.gates == gates:
        return brief
    return replace(brief, source=replace(brief.source, arrival=replace(arrival, gates=gates)))


def waits_for_time(vehicle: Vehicle) -> bool:
    """Whether it waits in the air until a time of day."""
    return vehicle.autopilot is Autopilot.ARDUCOPTER and vehicle.can_hold


def no_time_of_day(vehicle: Vehicle) -> Note:
    """Why a vehicle has no gates."""
    return Note("no_gates_on_way", autopilot=vehicle.autopilot.value, px4=vehicle.autopilot is Autopilot.PX4)


def gated(
    vehicles: Sequence[VehiclePlan], brief: Brief, gates: int | GatePlaces, start: datetime,
    most_m_s: Mapping[str, float], leaving: LeavingOut,
) -> list[VehiclePlan]:  # fmt: skip
    """The vehicles, with gates on the ways of all that can wait, which fly at no more than their ``most_m_s``.

    Raises InputError if no vehicle passes a gate. Raises NoMission if a way is too short for its gates, or if its
    mission then breaks a limit, unless such a vehicle may be left out.
    """
    found: list[VehiclePlan] = []
    passes = False
    for v in vehicles:
        try:
            at_m = _places_m(v, gates) if waits_for_time(v.request.vehicle) else ()
            passes = passes or bool(at_m)
            found.append(_with(v, brief, at_m, start, most_m_s.get(v.name, math.inf)) if at_m else v)
        except NoMission as why:
            passes = True
            leaving.leave(v.name, why)
    if not passes:
        able = [v for v in vehicles if waits_for_time(v.request.vehicle)]
        words = (
            f"no vehicle passes within {BESIDE_WAY_M:g} m of a place, {BETWEEN_GATES_M:g} m behind its start and "
            f"{BEFORE_GOAL_M:g} m before its goal: "
            "give other places, or how many gates each has"
            if able
            else f"{vehicles[0].name} {no_time_of_day(vehicles[0].request.vehicle)}: leave gates out, and give a wider "
            "window_s"
        )
        raise InputError(words, where=WHERE)
    return found


def _with(v: VehiclePlan, brief: Brief, at_m: tuple[float, ...], start: datetime, most_m_s: float) -> VehiclePlan:
    start_s = (start if start.tzinfo else start.replace(tzinfo=UTC)).timestamp()
    opens_s = tuple(round(start_s) + GUESS_S * (k + 1) for k in range(len(at_m)))
    v = replace(v, order=replace(v.order, gates=Gates(at_m, opens_s, start_s, start_s)))
    return rebuilt(v, brief, speed_m_s=min(v.speed_m_s, most_m_s))


def _places_m(v: VehiclePlan, gates: int | GatePlaces) -> tuple[float, ...]:
    """Metres over ground from the begin of the path to each gate: a number of them at equal distances, the last just
    before the goal."""
    points = v.solution.path.points[:, :2]
    way_m = track_length_m(points)
    if isinstance(gates, int):
        most = max(math.floor((way_m - BEFORE_GOAL_M) / BETWEEN_GATES_M), 0)
        if gates > most:
            raise NoMission(
                f"{v.name}: its way of {way_m:.0f} m has room for {most} gates {BETWEEN_GATES_M:g} m apart, "
                f"not for {gates}",
                reason="time",
            )
        return tuple((way_m - BEFORE_GOAL_M) * (k + 1) / gates for k in range(gates))
    away_m, along_m = nearest_on(np.array(gates), points)
    kept: list[float] = []
    for at in sorted(along_m[away_m <= BESIDE_WAY_M].tolist()):
        if at - (kept[-1] if kept else 0.0) >= BETWEEN_GATES_M and way_m - at >= BEFORE_GOAL_M:
            kept.append(at)
    return tuple(kept)


def gates_bought(v: VehiclePlan, slot: Slot, brief: Brief) -> VehiclePlan:
    """A vehicle with a note on what its gates cost and buy; itself if it has none."""
    if v.order.gates is None:
        return v
    waits = [leg for leg in v.verdict.legs if leg.until_s is not None]
    without = built_again(v, brief, replace(v.order, gates=None))[1]
    after, before = v.verdict.arrive_window_s(slot), without.arrive_window_s()
    takes_j = v.verdict.reported_j(math.fsum(leg.hold_j for leg in waits))
    note = Note(
        "waits_at_gates", count=len(waits), wait_s=math.fsum(leg.hold_s for leg in waits),
        energy=None if takes_j is None else Note("gates_take", energy_j=takes_j),
        width_s=0.0 if after is None else after[1] - after[0],
        without_s=0.0 if before is None else before[1] - before[0],
    )  # fmt: skip
    return replace(v, notes=(*v.notes, note))
