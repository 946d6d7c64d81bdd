"""The report of a plan as a `Page`, with the results of its uploads, and that page as HTML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gcsplan.app.model import Plan
from gcsplan.app.upload_job import JobResult
from gcsplan.check.rtl.verdict import WayHome
from gcsplan.report.page import render_page
from gcsplan.report.subject import Certificate, Page, Subject
from gcsplan.units import METRIC, Units


def render(
    plan: Plan, results: Sequence[JobResult] = (), homes: Mapping[str, WayHome] | None = None, units: Units = METRIC
) -> str:
    """The report of ``plan`` as HTML text, with the results of its uploads. ``homes``: vehicle name to its way home."""
    return render_page(page_of_plan(plan, results, homes, units))


def page_of_plan(
    plan: Plan, results: Sequence[JobResult] = (), homes: Mapping[str, WayHome] | None = None, units: Units = METRIC
) -> Page:
    """The page of a plan, with the results of its uploads and the way home of each vehicle named in ``homes``."""
    uploads = {d.vehicle: d.as_dict() for d in results}
    source, fleet = plan.source, plan.fleet
    facts = [("planner", plan.planner), ("objective", plan.objective), ("seed", str(plan.seed)),
             ("altitude frame", source.altitude_frame)]  # fmt: skip
    several = fleet is not None and len(plan.vehicles) > 1
    if fleet is not None and several and fleet.mode != "none":
        apart = f", {fleet.interval_s:g} s apart" if fleet.mode == "sequence" else ""
        facts += [("arrival", f"{fleet.mode}: {', '.join(fleet.order)}{apart}")]
    subjects = []
    for v in plan.vehicles:
        certificate = Certificate(
            v.problem.objective, "m" if v.problem.objective == "length" else "J",
            v.cost, v.solution.lower_bound, v.gap_percent, v.solution.stopped_by,
        )  # fmt: skip
        slot = None if fleet is None else fleet.slot(v.name)
        notes = (*v.notes, *v.solution.notes, *v.verdict.notes, *(slot.notes if slot is not None else ()))
        subjects.append(
            Subject(
                v.name, v.verdict, v.request.vehicle, certificate, tuple(dict.fromkeys(notes)),
                None if fleet is None else fleet.motion(v.name), slot,
                (homes or {}).get(v.name), uploads.get(v.name), leaves=v.request.end == "none",
            )
        )  # fmt: skip
    return Page(
        source.name, plan.world, tuple(subjects), dict(source.inputs), tuple(facts), tuple(dict.fromkeys(plan.notes)),
        fleet.separation if fleet is not None else None, fleet.order if fleet is not None else (), units,
    )  # fmt: skip
