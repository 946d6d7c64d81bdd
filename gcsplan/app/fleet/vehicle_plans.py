"""The plan of each vehicle of a mission file, or the reason why there is none and what would help; by any executor.

A change is reported as a help only if a whole mission was planned with it. It is tried with the limits and zones of the
mission file, through the same steps as any plan: with the margins for the wire, the climb-out and glide of a fixed
wing, and the verdict on the mission as stored, battery included. A value is reported to do only if `plan` would write
its mission: arrival, hours and a required return count, too, but for what other vehicles of a fleet do.

A worker of an executor reads the mission again from its content, once for all vehicles, and must find the same terrain
and zones. Its results hold no terrain: the caller puts them into its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache

from gcsplan.app.fleet.fleet import finished
from gcsplan.app.fleet.may_fly import flyable
from gcsplan.app.parallel.executor import Executor
from gcsplan.app.parallel.sites import Site, site_of, widened, world_of
from gcsplan.app.plan.left_out import LeavingOut
from gcsplan.app.plan.model import Brief, VehiclePlan
from gcsplan.app.plan.problem import in_degrees, make_problem
from gcsplan.app.plan.vehicle import plan_vehicle
from gcsplan.errors import GcsplanError, NoMission
from gcsplan.mission_file import VehicleRequest
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution
from gcsplan.planners.refusal.suggestions import with_cures
from gcsplan.world.world import World

__all__ = ["PIECE_S", "Answer", "over_levels", "plan_or_explain", "planned_by"]

PIECE_S = 0.6
"""Seconds that planning a vehicle takes, about: the median of 60 over mountains with margins."""


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


SiteAndBrief = tuple[Site, Brief]
"""The data that all vehicles of a mission share: its terrain and zones, and the packed brief."""

Answer = tuple[VehiclePlan, int]
"""A vehicle's packed plan, and the level of the terrain that it was made over."""


def planned_by(
    workers: Executor,
    brief: Brief,
    on_done: Callable[[str, int], None] | None = None,
    leaving: LeavingOut | None = None,
) -> list[VehiclePlan]:
    """Every vehicle's own plan, in the file's order; ``on_done(vehicle, count)`` is called after each.

    Raises what planning one after the other would raise: InputError, NoMission of the first vehicle that has none,
    unless ``leaving`` may leave it out.
    """
    leaving = leaving or LeavingOut(allowed=False)
    source = brief.source
    site_and_brief = site_of(source), brief.packed()
    names = [r.vehicle.name for r in source.vehicles]
    answers: dict[int, Answer] = {}
    refused: dict[int, GcsplanError] = {}
    for number, answer in workers.each(answer_of, site_and_brief, names):
        if isinstance(answer, GcsplanError):
            refused[number] = answer
        else:
            answers[number] = answer
        if on_done is not None:
            on_done(names[number], len(answers) + len(refused))
        fatal = [k for k, why in refused.items() if not (leaving.allowed and isinstance(why, NoMission))]
        if fatal and all(k in answers or k in refused for k in range(min(fatal))):
            raise refused[min(fatal)]
    for number, why in sorted(refused.items()):
        if isinstance(why, NoMission):
            leaving.leave(names[number], why)
    over = over_levels(brief)
    return [plan.restored(over(level)) for _, (plan, level) in sorted(answers.items())]


def answer_of(site_and_brief: SiteAndBrief, name: str) -> Answer | GcsplanError:
    """Plan one vehicle, in whatever process; why there is no plan is returned, so that the caller can order it."""
    try:
        site, packed = site_and_brief
        brief = packed.over(*site.read())
        [request] = [r for r in brief.source.vehicles if r.vehicle.name == name]
        plan = plan_or_explain(brief, request)
    except GcsplanError as why:
        return why
    assert plan.brief is not None
    return plan.packed(), plan.brief.source.level


def over_levels(brief: Brief) -> Callable[[int], Brief]:
    """A function that puts the brief over the mission's terrain of a level, each made once. It raises InputError."""

    @cache
    def over(level: int) -> Brief:
        source = widened(brief.source, level)
        return brief if source is brief.source else brief.over(source, world_of(source))

    return over
