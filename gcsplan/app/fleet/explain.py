"""One vehicle's plan, or the reason why there is none and what would help.

A change is reported as a help only if a whole mission was planned with it. It is tried with the limits and zones of the
mission file, through the same steps as any plan: with the margins for the wire, the climb-out and glide of a fixed
wing, and the verdict on the mission as stored, battery included. A value is reported to do only if `plan` would write
its mission: arrival, hours and a required return count, too, but for what other vehicles of a fleet do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from gcsplan.app.fleet.fleet import finished
from gcsplan.app.fleet.may_fly import flyable
from gcsplan.app.plan.model import Brief, VehiclePlan
from gcsplan.app.plan.problem import in_degrees, make_problem
from gcsplan.app.plan.vehicle import plan_vehicle
from gcsplan.errors import NoMission
from gcsplan.mission_file import VehicleRequest
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution
from gcsplan.planners.refusal.suggestions import with_cures
from gcsplan.world.world import World

__all__ = ["plan_or_explain"]


def plan_or_explain(
    brief: Brief,
    request: VehicleRequest,
    progress: Callable[[Progress], None] | None = None,
    *,
    options: Mapping[str, object] | None = None,
) -> VehiclePlan:
    """`plan_vehicle`, whose NoMission also says what would help. Raises InputError, NoMission."""
    try:
        return plan_vehicle(brief, request, progress, options=options)
    except NoMission as refused:
        bare = refused.__cause__
        if not isinstance(bare, Refusal) or not bare.untried:
            raise
        why = _explained(brief, request, bare, progress, options)
    raise in_degrees(why, request.vehicle, brief.world) from why


def _explained(
    brief: Brief,
    request: VehicleRequest,
    bare: Refusal,
    progress: Callable[[Progress], None] | None,
    options: Mapping[str, object] | None,
) -> Refusal:
    vehicle = request.vehicle

    def planned(changed: Problem) -> tuple[Brief, VehiclePlan]:
        planner = replace(brief.source.planner, gap_percent=changed.gap_percent, budget_s=changed.budget_s)
        tried = replace(
            brief,
            source=replace(brief.source, planner=planner),
            world=World(brief.world.frame, changed.airspace),
        )
        limited = replace(request, vehicle=replace(vehicle, limits=changed.limits))
        return tried, plan_vehicle(tried, limited, changed.progress, options=options)

    def whole(changed: Problem) -> Solution:
        tried, found = planned(changed)
        flyable(finished(tried, [found]))
        return found.solution

    problem, _ = make_problem(
        brief.source, request, brief.world, brief.objective, brief.seed, progress=progress, options=options
    )
    # The limits as the user wrote them: planning a change of them adds the margins for the wire again.
    problem = replace(problem, limits=vehicle.limits, checked=None)
    alone = "that is tried without the other vehicles" if len(brief.source.vehicles) > 1 else ""
    return with_cures(problem, bare, lambda changed: planned(changed)[1].solution, whole, alone)
