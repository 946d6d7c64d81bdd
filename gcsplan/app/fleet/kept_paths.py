"""`KeptPaths`: the vehicles' own plans of a session's last mission, for the next one in which only the arrival differs.

Who arrives when is decided after each vehicle has its path, so another order or interval needs no search. The plans are
kept as a worker of an executor returns them, and are put over the terrain and zones of the mission that is read anew.
"""

from __future__ import annotations

from gcsplan.app.fleet.vehicle_plans import Answer, restored
from gcsplan.app.plan.left_out import LeavingOut, LeftOut
from gcsplan.app.plan.model import Brief, VehiclePlan
from gcsplan.mission_file.request import Content


class KeptPaths:
    """The memory of one session, for one thread at a time; it holds the plans of one mission."""

    def __init__(self) -> None:
        self._of: tuple[Brief, Content] | None = None
        self._answers: list[Answer] = []
        self._left_out: list[LeftOut] = []

    def get(self, brief: Brief, leaving: LeavingOut) -> list[VehiclePlan] | None:
        """The plans of a mission, and in ``leaving`` the vehicles without one; None if they are not known."""
        content = brief.source.content
        if self._of is None or content is None or not _alike(self._of, (brief, content)):
            return None
        if self._left_out and not leaving.allowed:
            return None  # the first of them refuses the mission, with a reason that is found anew
        leaving.found += self._left_out
        return [restored(brief, *answer) for answer in self._answers]

    def put(self, brief: Brief, vehicles: list[VehiclePlan], leaving: LeavingOut) -> None:
        """Keep the plans of a mission instead of all before."""
        content = brief.source.content
        self._of = None
        if content is None or brief.by_priority or any(v.brief is None for v in vehicles):
            return
        self._of = brief.packed(), content
        self._answers = [(v.packed(), v.brief.source.level) for v in vehicles if v.brief is not None]
        self._left_out = list(leaving.found)


def _alike(a: tuple[Brief, Content], b: tuple[Brief, Content]) -> bool:
    """Whether all that a vehicle's own plan depends on is the same."""
    (before, was), (after, now) = a, b
    return (
        _own_keys(was) == _own_keys(now)
        and (was.held, was.around, was.departure, was.at) == (now.held, now.around, now.departure, now.at)
        and (before.planner, before.objective, before.seed, before.options, before.own)
        == (after.planner, after.objective, after.seed, after.options, after.own)
        and not after.by_priority
    )


def _own_keys(content: Content) -> dict[str, object]:
    return {key: value for key, value in content.given.items() if key != "arrival"}
