"""`Handout`: a plan that may fly, with what goes to files and to vehicles: the same for the command line and the map.

Whether a plan may be written or sent is decided here, in this order: it passes the check, a return that is required is
safe, its fence is not breached. Nothing is written or sent before all of it has held.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from gcsplan.app.fleet.may_fly import flyable
from gcsplan.app.fleet.start_time import GateTime
from gcsplan.app.output import files as outputs
from gcsplan.app.plan.model import Plan
from gcsplan.app.plan.way_home import is_required
from gcsplan.notes.note import Note
from gcsplan.units import METRIC, Units

if TYPE_CHECKING:
    from gcsplan.app.plan.earlier import EarlierMission
    from gcsplan.app.upload.job import JobResult, UploadJob
    from gcsplan.check.difference import PlanDifference
    from gcsplan.check.returns.verdict import WayHome

__all__ = ["Handout", "handout"]


@dataclass(frozen=True, eq=False)
class Handout:
    """``plan`` without the vehicles that are left out, its ways ``homes`` by vehicle, an upload job for each vehicle
    that has a target, ``notes`` on their fences and rally points as (name, note), and ``differences`` to earlier
    missions. ``rally``: the points that the ways home propose go along."""

    plan: Plan
    homes: Mapping[str, WayHome]
    jobs: Sequence[UploadJob] = ()
    notes: Sequence[tuple[str, Note]] = ()
    differences: Sequence[PlanDifference] = ()
    rally: bool = False

    def files(self, report: Units | None = None) -> dict[str, str]:
        """File name to text of every output, with ``report.html`` in these units if they are given."""
        fences = {job.name: job.fence.items for job in self.jobs if job.fence is not None}
        files = outputs.outputs_of(self.plan, self.homes, fences, rally=self.rally)
        return files if report is None else files | {"report.html": self.report((), report)}

    def report(self, results: Sequence[JobResult], units: Units = METRIC) -> str:
        """``report.html``, with what an upload came to."""
        return outputs.report_of(self.plan, results, self.homes, units, self.differences)


def handout(
    plan: Plan,
    targets: Mapping[str, str] = MappingProxyType({}),
    lists: tuple[bool, bool, bool] = (False, False, False),
    earlier: Sequence[Mapping[str, EarlierMission]] = (),
    *,
    allow_unjudged: bool = False,
    home: bool = False,
    require_way_home: bool = False,
) -> Handout:
    """What a plan is handed out as; ``targets``: vehicle name to URL, empty if nothing is sent.

    ``lists`` (fence, rally points, a fence with zones that have a height) go to the vehicles and into the `.plan`;
    ``earlier`` has missions that it is compared with. With ``home`` the ways home are judged. Raises CheckFailed,
    NoMission or InputError for a plan that must not be handed out.
    """
    GateTime.require_of(plan)
    planned, homes = flyable(plan, allow_unjudged=allow_unjudged, home=home, require_way_home=require_way_home)
    if any(way.safe is False for way in homes.values()):
        from gcsplan.app.fleet.earlier_landing import with_earlier_landing

        homes = with_earlier_landing(planned, homes)
    jobs: Sequence[UploadJob] = ()
    notes: Sequence[tuple[str, Note]] = ()
    fence, rally, infinite = lists
    if targets or fence or infinite:
        from gcsplan.app.upload import fence as fencing
        from gcsplan.app.upload import run as uploads

        where = targets or dict.fromkeys((v.name for v in planned.vehicles), "")
        required = is_required(planned.source, require_way_home)
        orders = uploads.jobs_of(planned, where, homes, required, rally=rally)
        jobs, notes = fencing.with_lists(orders, fencing.ListsSent(fence, rally, infinite))
    found: list[PlanDifference] = []
    if any(earlier):
        from gcsplan.app.plan.earlier import differences

        found = [difference for missions in earlier for difference in differences(planned, missions).values()]
    return Handout(planned, homes, jobs, notes, found, rally)
