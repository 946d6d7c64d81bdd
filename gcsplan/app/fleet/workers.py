"""Plan the vehicles of a mission file with an executor: what a worker is sent, and what it sends back.

A worker reads the mission again from its content, once for all vehicles, and must find the same terrain and zones. Its
results hold no terrain: the caller puts them into its own.
"""

from __future__ import annotations

from collections.abc import Callable

from gcsplan.app.fleet.explain import plan_or_explain
from gcsplan.app.parallel.executor import Executor
from gcsplan.app.parallel.sites import Site, site_of, widened, world_of
from gcsplan.app.plan.left_out import LeavingOut
from gcsplan.app.plan.model import Brief, VehiclePlan
from gcsplan.errors import GcsplanError, NoMission

__all__ = ["planned_by"]

PIECE_S = 0.6
"""Seconds that planning a vehicle takes, about: the median of 60 over mountains with margins."""


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
    return [_restored(brief, *answers[k]) for k in sorted(answers)]


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


def _restored(brief: Brief, plan: VehiclePlan, level: int) -> VehiclePlan:
    source = widened(brief.source, level)
    return plan.restored(brief if source is brief.source else brief.over(source, world_of(source)))
