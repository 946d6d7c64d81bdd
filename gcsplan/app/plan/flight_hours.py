"""Whether a flight lies within the hours for which zones were left out (`at`), from departure to landing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta

from gcsplan.app.plan.model import FleetPlan, VehiclePlan
from gcsplan.check.verdict import Verdict
from gcsplan.errors import InputError
from gcsplan.mission_file import MissionFile
from gcsplan.mission_file.published.times import Hours
from gcsplan.notes.note import Note

FAR_S = 1e8
"""A flight that lasts longer lands in no year that a date is written in, s."""

LANDINGS = ("land", "rtl")

WRITE = "write at: [from, to] with all of the flight in it"


def landing_of(verdict: Verdict, departure: datetime) -> datetime | None:
    """When a flight that leaves the ground at ``departure``, or so late as it may, is over in the slowest declared
    wind, all holds included; None if it has no end."""
    if not verdict.legs or verdict.legs[-1].kind not in LANDINGS:
        return None
    window = None if verdict.in_wind is None else verdict.in_wind.window
    lasts_s = verdict.time_s if window is None else max(verdict.time_s, float(window.latest_s[-1]))
    if not math.isfinite(lasts_s) or any(math.isinf(leg.hold_s) for leg in verdict.legs):
        return None
    return departure + timedelta(seconds=math.ceil(min(lasts_s, FAR_S)))


def beyond_hours(verdict: Verdict, hours: Hours | None) -> Note | None:
    """Why the hours, which begin with the departure, do not hold the flight; None if they do, or if none are given."""
    if hours is None or not verdict.legs:
        return None
    end = landing_of(verdict, hours.start)
    if end is None:
        return Note("hours_without_landing", hours=str(hours))
    return None if end <= hours.end else Note("flies_beyond_hours", hours=str(hours), until=_shown(end))


def beyond_forecast(verdict: Verdict, waits_s: float = 0.0) -> Note | None:
    """Why the hours of a forecast do not hold the flight, which begins so long after T+0; None if they do."""
    blown = verdict.in_wind
    if blown is None or len(blown.wind.times_s) == 1 or blown.window is None:
        return None
    until_s = float(blown.wind.times_s[-1])
    lands = landing_of(verdict, datetime.fromtimestamp(until_s, UTC)) is not None
    if lands and blown.flies_in.departs_s[0] + waits_s + float(blown.window.latest_s[-1]) <= until_s:
        return None
    return Note("flies_beyond_forecast", until=_shown(datetime.fromtimestamp(until_s, UTC)))


def within_hours(
    source: MissionFile, vehicles: Sequence[VehiclePlan], verdicts: Sequence[Verdict], fleet: FleetPlan
) -> list[Verdict]:
    """The verdicts on a plan's vehicles; a flight without an end is not judged, if zones were left out for the hours,
    and none is beyond those of a forecast of the wind.

    Raises InputError if a flight lasts beyond them.
    """
    flown = [
        _not_judged(verdict, beyond_forecast(verdict, waits_s(v, fleet)))
        for v, verdict in zip(vehicles, verdicts, strict=True)
    ]
    hours = source.hours
    if hours is None:
        return flown
    start = fleet.start_utc or hours.start
    judged = []
    for v, verdict in zip(vehicles, flown, strict=True):
        end = landing_of(verdict, start + timedelta(seconds=waits_s(v, fleet)))
        if start < hours.start or (end is not None and end > hours.end):
            lasts = "without end" if end is None else f"to {_shown(end)}"
            raise InputError(
                f"zones were left out that do not apply from {hours}, but {v.name} flies from {_shown(start)} {lasts}; "
                f"{WRITE}",
                where=f"{source.path}: at",
            )
        without = None if end is not None else Note("hours_without_landing", hours=str(hours))
        judged.append(_not_judged(verdict, without))
    return judged


def _not_judged(verdict: Verdict, why: Note | None) -> Verdict:
    return verdict if why is None else replace(verdict, not_judged=(*verdict.not_judged, why))


def hours_left(source: MissionFile, v: VehiclePlan, fleet: FleetPlan | None) -> Hours | None:
    """The hours of one vehicle of a plan, from its own departure on; None if no zone was left out for them."""
    hours = source.hours
    if hours is None or fleet is None:
        return hours
    departure = (fleet.start_utc or hours.start) + timedelta(seconds=waits_s(v, fleet))
    return Hours(departure, hours.end)


def waits_s(v: VehiclePlan, fleet: FleetPlan) -> float:
    """Seconds from the fleet's start until a vehicle's own clock begins, so that it arrives as its slot says."""
    return min(fleet.slot(v.name).arrive_s - v.verdict.arrive_s, FAR_S)


def _shown(moment: datetime) -> str:
    return f"{moment:%Y-%m-%d %H:%M}Z"
