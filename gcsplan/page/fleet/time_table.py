"""The time table of a plan for the page: when each vehicle leaves, arrives and lands, and how near others come."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from gcsplan.app.plan.model import Plan
from gcsplan.app.upload.job import JobResult, releases
from gcsplan.fleet.separation import Encounter, Separation
from gcsplan.report.views.fleet import separation_text
from gcsplan.units import Units

SECONDS, METRES, DEGREES = 2, 2, 7
"""Decimals of times, distances and places."""


def numbers_of(plan: Plan) -> dict[str, int]:
    """The number of each vehicle in the mission file, by its name; the plan lacks those that are left out."""
    return {request.vehicle.name: k for k, request in enumerate(plan.source.vehicles)}


def time_table(plan: Plan, units: Units) -> dict[str, Any] | None:
    """The rows of the vehicles that fly, in the order of arrival; None for a mission of one vehicle."""
    fleet, numbers = plan.fleet, numbers_of(plan)
    if fleet is None or len(numbers) < 2:
        return None
    apart, arrival = fleet.separation, plan.source.arrival
    rows: list[dict[str, Any]] = []
    for v in plan.vehicles:
        slot, motion, window_s = fleet.slot(v.name), fleet.motion(v.name), v.verdict.arrive_window_s(fleet.slot(v.name))
        rows.append({
            "vehicle": numbers[v.name], "name": v.name, "depart_s": round(slot.depart_s, SECONDS),
            "hold_s": slot.hold_s, "speed_m_s": round(slot.speed_m_s, METRES),
            "arrive_s": round(slot.arrive_s, SECONDS), "end_s": round(motion.end_s, SECONDS),
            "window_s": None if window_s is None else [round(s, SECONDS) for s in window_s],
            "in_air": motion.ends_in_air, "nearest": _nearest(apart, v.name),
        })  # fmt: skip
    rows.sort(key=lambda row: (row["arrive_s"], row["vehicle"]))
    return {
        "mode": fleet.mode, "required": arrival is not None, "interval_s": fleet.interval_s, "rows": rows,
        "end_s": max(row["end_s"] for row in rows), "separation": _separation(plan, apart, units),
    }  # fmt: skip


def release_table(plan: Plan, results: Sequence[JobResult]) -> dict[str, Any] | None:
    """When each vehicle of a fleet is started by hand, in order, and the common start in UTC; None for one vehicle.

    After an upload ``ready`` says whether a vehicle has its mission, else it is None."""
    rows = [
        {"name": slot.name, "release_s": slot.depart_s, "arrive_s": slot.arrive_s, "window_s": within,
         "ready": ready if results else None}
        for slot, within, ready in releases(plan, results)
    ]  # fmt: skip
    if plan.fleet is None or not rows:
        return None
    return {
        "rows": rows,
        "start_utc": None if plan.fleet.start_utc is None else f"{plan.fleet.start_utc:%Y-%m-%d %H:%M:%S}",
    }


def _nearest(apart: Separation | None, name: str) -> dict[str, Any] | None:
    """The other vehicle to which one comes nearest in the air, and its exact distance; None if there is none."""
    if apart is None:
        return None
    row = apart.distance_m[apart.names.index(name)]
    other = int(np.argmin(row))
    return {"name": apart.names[other], "distance_m": _down(row[other])} if math.isfinite(row[other]) else None


def _separation(plan: Plan, apart: Separation | None, units: Units) -> dict[str, Any] | None:
    """The rule, whether it is kept, the sentence on it, and the closest approach of all."""
    if apart is None:
        return None
    return {
        "safe": apart.safe, "required_m": apart.rules.separation_m, "needed_m": apart.rules.needed_m,
        "text": separation_text(apart, plan.notes, units),
        "closest": None if apart.least is None else _closest(plan, apart.least),
    }  # fmt: skip


def _closest(plan: Plan, met: Encounter) -> dict[str, Any]:
    east_m, north_m, _ = met.middle
    at = [round(float(v), DEGREES) for v in plan.world.frame.to_degrees(east_m, north_m)]
    return {"vehicles": list(met.vehicles), "distance_m": _down(met.distance_m), "time_s": met.time_s, "at": at}


def _down(distance_m: float) -> float:
    """A least distance, never rounded up."""
    return float(math.floor(distance_m * 100.0) / 100.0)
