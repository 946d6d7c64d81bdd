"""`KeptPaths`: the vehicles' own plans of a session's last mission, for the next one, which differs in a few of them.

Who arrives when is decided after each vehicle has its path, so another order or interval needs no search, and a vehicle
whose start is moved is searched alone. The plans are kept as a worker of an executor returns them, and are put over the
terrain and zones of the mission that is read anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gcsplan.app.fleet.vehicle_plans import Answer, over_levels
from gcsplan.app.plan.left_out import LeftOut
from gcsplan.app.plan.model import Brief, VehiclePlan
from gcsplan.mission_file.kept import is_kept
from gcsplan.mission_file.request import Content, VehicleRequest
from gcsplan.world.world import World


class KeptPaths:
    """The memory of one session, for one thread at a time; it holds the plans of one mission."""

    def __init__(self) -> None:
        self._of: tuple[Brief, Content] | None = None
        self._world: World | None = None
        self._answers: dict[str, Answer] = {}
        self._left_out: dict[str, tuple[VehicleRequest, LeftOut]] = {}

    def get(self, brief: Brief, *, allowed: bool) -> tuple[dict[str, VehiclePlan], list[LeftOut]]:
        """The plans of a mission's vehicles that are known, by their names, and the known vehicles without one if such
        are ``allowed``; otherwise the first of them refuses the mission, with a reason that is found anew."""
        plans: dict[str, VehiclePlan] = {}
        left_out: list[LeftOut] = []
        content = brief.source.content
        if self._of is None or content is None or not _alike(self._of, (brief, content)):
            return plans, left_out
        same = _without(self._of[1], "arrival") == _without(content, "arrival")
        if not same and (brief.options.get("warm_start") is not None or brief.world is not self._world):
            return plans, left_out  # a plan depends on another vehicle's, or the plane or its ground is another one
        over = over_levels(brief)
        for request in brief.source.vehicles:
            name = request.vehicle.name
            if name in self._answers:
                plan, level = self._answers[name]
                if same or (plan.request == request and level == brief.source.level):
                    plans[name] = plan.restored(over(level))
            elif name in self._left_out and allowed:
                of, left = self._left_out[name]
                if same or of == request:
                    left_out.append(left)
        return plans, left_out

    def put(self, brief: Brief, vehicles: Sequence[VehiclePlan], left_out: Sequence[LeftOut]) -> None:
        """Keep the plans of a mission instead of all before."""
        content = brief.source.content
        self._of = None
        if content is None or brief.by_priority or any(v.brief is None for v in vehicles):
            return
        requests = {request.vehicle.name: request for request in brief.source.vehicles}
        self._of = brief.packed(), content
        self._world = brief.world if is_kept(brief.world.airspace.surface) else None
        self._answers = {
            v.name: (replace(v.packed(), built_last=v.built_last), v.brief.source.level)
            for v in vehicles if v.brief is not None
        }  # fmt: skip
        self._left_out = {left.name: (requests[left.name], left) for left in left_out}


def _alike(a: tuple[Brief, Content], b: tuple[Brief, Content]) -> bool:
    """Whether all that a vehicle's own plan depends on, beside the vehicle and its ground, is the same."""
    (before, was), (after, now) = a, b
    return (
        _without(was, "arrival", "vehicles") == _without(now, "arrival", "vehicles")
        and (was.held, was.around, was.departure, was.at) == (now.held, now.around, now.departure, now.at)
        and (before.planner, before.objective, before.seed, before.options, before.own)
        == (after.planner, after.objective, after.seed, after.options, after.own)
        and not after.by_priority
    )


def _without(content: Content, *sections: str) -> dict[str, object]:
    return {key: value for key, value in content.given.items() if key not in sections}
