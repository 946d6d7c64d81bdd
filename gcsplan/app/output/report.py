"""The report of a plan as a `Page`, with the results of its uploads or of a rehearsal, and that page as HTML."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gcsplan.app.plan.model import Plan
from gcsplan.app.upload.job import JobResult
from gcsplan.app.upload.on_board import settings_of_plan
from gcsplan.check.difference import PlanDifference
from gcsplan.check.returns.verdict import WayHome
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.mission_file.published.times import hours_of
from gcsplan.planners.problem import UNIT_OF
from gcsplan.report.page import render_page
from gcsplan.report.parts.html import stated
from gcsplan.report.parts.page_data import Certificate, Compared, Page, Rehearsed, Subject
from gcsplan.sim.flight.trace import Trace
from gcsplan.sim.outcome import Rehearsal
from gcsplan.units import METRIC, Units
from gcsplan.world.geodesy.daylight import Daylight, daylight

MOST_IN_ORDER = 100
"""Most names of the order of arrival in one line; the schedule has all."""


def render(
    plan: Plan, results: Sequence[JobResult] = (), homes: Mapping[str, WayHome] | None = None, units: Units = METRIC,
    differences: Sequence[PlanDifference] = (),
) -> str:  # fmt: skip
    """The report of ``plan`` as HTML text, with the results of its uploads and the ``differences`` to earlier missions.

    ``homes``: vehicle name to its way home.
    """
    return render_page(replace(page_of_plan(plan, results, homes, units), differences=tuple(differences)))


def page_of_plan(
    plan: Plan, results: Sequence[JobResult] = (), homes: Mapping[str, WayHome] | None = None, units: Units = METRIC
) -> Page:
    """The page of a plan, with the results of its uploads and the way home of each vehicle named in ``homes``."""
    uploads = {d.vehicle: d for d in results}
    source, fleet = plan.source, plan.fleet
    facts = [("planner", plan.planner), ("objective", plan.objective), ("seed", str(plan.seed)),
             ("altitude frame", source.altitude_frame)]  # fmt: skip
    several = fleet is not None and len(plan.vehicles) > 1
    if fleet is not None and several and fleet.mode != "none":
        apart = f", {fleet.interval_s:g} s apart" if fleet.mode == "sequence" else ""
        order = ", ".join(fleet.order[:MOST_IN_ORDER]) + (" …" if len(fleet.order) > MOST_IN_ORDER else "")
        facts += [("arrival", f"{fleet.mode}: {order}{apart}")]
    subjects = []
    for v in plan.vehicles:
        certificate = Certificate(
            v.problem.objective, UNIT_OF[v.problem.objective], v.cost, v.solution.lower_bound, v.gap_percent,
            v.solution.stopped_by,
        )  # fmt: skip
        slot, sent = None if fleet is None else fleet.slot(v.name), uploads.get(v.name)
        subjects.append(
            Subject(
                v.name, v.verdict, v.request.vehicle, certificate, v.all_notes(fleet),
                None if fleet is None else fleet.motion(v.name), slot,
                (homes or {}).get(v.name), None if sent is None else sent.as_dict(),
                () if sent is None else sent.warnings, leaves=v.request.end == "none",
                settings=settings_of_plan(v, (homes or {}).get(v.name)),
            )
        )  # fmt: skip
    return Page(
        source.name, plan.world, tuple(subjects), dict(source.inputs), tuple(facts), tuple(dict.fromkeys(plan.notes)),
        fleet.separation if fleet is not None else None, fleet.order if fleet is not None else (), units,
        left_out=tuple((v.name, v.message) for v in plan.left_out), daylight=_daylight(plan),
    )  # fmt: skip


def _daylight(plan: Plan) -> Daylight | None:
    """The daylight at the first start, of the hours for which the mission is planned; None without any."""
    content = plan.source.content
    if content is None or not plan.source.vehicles:
        return None
    hours = hours_of(content.given.get("at"), content.departure, "at", [], instead=content.at)
    return None if hours is None else daylight(*plan.source.vehicles[0].start_deg, hours.start)


def render_rehearsal(
    plan: Plan, result: Rehearsal, homes: Mapping[str, WayHome] | None = None, units: Units = METRIC
) -> str:
    """The report of ``plan`` with what was flown beside it, as HTML text."""
    page = page_of_plan(plan, (), homes, units)
    flown = {trace.name: trace for trace in result.flown}
    subjects = tuple(replace(s, flown=_motion(flown[s.name]) if s.name in flown else None) for s in page.subjects)
    violations = tuple(b.note(result.runs) for b in result.breaches)
    compared = tuple(_compared(plan, result))
    rehearsed = Rehearsed(result.safe, _how(result, units), compared, violations, result.not_judged)
    return render_page(replace(page, subjects=subjects, rehearsed=rehearsed, notes=(*page.notes, *result.notes)))


def _motion(trace: Trace) -> TimedPath | None:
    """The flown path over time; None if it never left the ground."""
    rises = np.concatenate([[True], np.diff(trace.times_s) > 0.0])
    if rises.sum() < 2:
        return None
    arrive_s = trace.arrive_s if math.isfinite(trace.arrive_s) else trace.end_s
    return TimedPath(trace.name, trace.times_s[rises], trace.points[rises], arrive_s, trace.stays)


def _how(result: Rehearsal, units: Units) -> str:
    by = "gcsplan's simulated vehicles" if result.simulator == "gcsplan" else "ArduCopter SITL"
    wind, gusts, noise = (float(result.weather.get(key) or 0.0) for key in ("wind_m_s", "gusts_m_s", "noise_m"))
    calm = not (wind or gusts or noise)
    of_wind, of_gusts, of_noise = stated(wind, units.speed), stated(gusts, units.speed), stated(noise, units.distance)
    air = "in still air" if calm else f"with {of_wind} of wind, gusts of {of_gusts} and {of_noise} of noise"
    if (declared := result.weather.get("drawn_from")) is not None:
        air = (
            f"in winds of up to {stated(declared['most_m_s'], units.speed)}, drawn from those that the mission declares"
        )
    text = f"Flown by {by} {air}, from the missions that they stored."
    if result.runs == 1:
        return text
    return (
        f"{text} {result.runs} runs: flown times are the medians, heights and separations the least of all runs; map "
        "and replay show the first run."
    )


def _compared(plan: Plan, result: Rehearsal) -> Iterator[Compared]:
    """The plan's figures beside those of the rehearsal, which are not derived from them."""
    rows = [v.as_dict() for v in result.vehicles]
    for i, (v, row) in enumerate(zip(plan.vehicles, rows, strict=True)):
        lowest = v.verdict.lowest
        on_ground = None
        if plan.fleet is not None and not plan.fleet.motion(v.name).ends_in_air:
            on_ground = plan.fleet.motion(v.name).end_s
        never = math.inf
        yield Compared(i, v.name, "at its goal", row["planned_arrive_s"], _or(row["arrive_s"], never), "time")
        if on_ground is not None and v.request.end != "none":
            yield Compared(i, v.name, "on the ground", on_ground, _or(row["end_s"], never), "time")
        yield Compared(
            i, v.name, "lowest above ground", None if lowest is None else lowest.min_agl_m, row["min_agl_m"], "height"
        )  # fmt: skip
        if v.verdict.battery_used_percent is not None:
            used = row["battery_used_percent"]
            yield Compared(i, v.name, "battery used", v.verdict.battery_used_percent, used, "percent")
    planned = plan.fleet.closest if plan.fleet is not None else None
    if planned is not None or result.closest is not None:
        yield Compared(
            None, "fleet", "least separation", None if planned is None else planned.distance_m,
            None if result.closest is None else result.closest.distance_m, "distance",
        )  # fmt: skip


def _or(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value
