"""From the vehicles' own plans to the plan of a mission: one terrain for all, their time table, the hours of zones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from gcsplan.app.fleet.fleet import fleet_of
from gcsplan.app.fleet.start_time import GateTime
from gcsplan.app.plan.flight_hours import within_hours
from gcsplan.app.plan.left_out import LeavingOut
from gcsplan.app.plan.model import Brief, Plan, VehiclePlan
from gcsplan.app.plan.vehicle import over_one_terrain
from gcsplan.notes.note import Note
from gcsplan.planners.problem import Progress

__all__ = ["finished"]


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
    flown = within_hours(source, flown, fleet)
    notes: list[Note] = list(source.notes)
    if len(flown) > 1 and source.arrival is None:
        notes.append(Note("no_arrival_asked"))
    notes += fleet.notes
    if brief.objective == "energy" and any(not v.verdict.energy_stated for v in flown):
        flown = tuple(replace(v, verdict=replace(v.verdict, energy_stated=True, paper_energy=True)) for v in flown)
        notes.append(Note("paper_energy_minimised"))
    return Plan(
        source, brief.world, brief.planner, brief.objective, brief.seed, flown, tuple(notes), fleet,
        tuple(leaving.found), leaving.allowed,
    )  # fmt: skip
