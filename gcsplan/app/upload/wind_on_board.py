"""The vehicle's own estimate of the wind, beside the winds that its mission was planned for.

The estimate is *among* them if it is no farther from one of them, at the vehicle's height and the departure, than the
declared gusts add, `SURE_M_S`, and twice the standard deviation that the vehicle gives. Another estimate is a note and
no refusal: a vehicle on the ground estimates little, and the wind of its flight is not there yet.
"""

from __future__ import annotations

import math

from gcsplan.app.upload.job import UploadJob
from gcsplan.mavlink.link.options import WindJudge
from gcsplan.mavlink.link.watch import VehicleState
from gcsplan.notes.note import Note
from gcsplan.wind.declared import STILL_AIR, FlightWind
from gcsplan.wind.wording import wind_note

__all__ = ["SURE_M_S", "WIND_S", "flight_wind_of", "wind_judge"]

SURE_M_S = 1.0
"""By how much an estimate may be off that gives no standard deviation, or a small one, m/s."""

WIND_S = 1.0
"""How long an estimate is waited for where winds are declared, s."""

DEVIATIONS = 2.0


def flight_wind_of(job: UploadJob) -> FlightWind:
    """The winds that a job's mission was judged in; still air if it declares none."""
    found = None if job.verdict is None else job.verdict.in_wind
    return FlightWind(STILL_AIR) if found is None else found.flies_in


def wind_judge(job: UploadJob) -> WindJudge | None:
    """The notes on a vehicle's estimate; None without a world, where no wind was counted."""
    world, flies_in = job.world, flight_wind_of(job)
    if world is None or job.verdict is None:
        return None
    declared = flies_in.declared

    def beside(state: VehicleState) -> Note | None:
        found = state.wind
        if found is None:
            return None if declared.still else Note("wind_not_estimated")
        home = job.mission.home
        lat_deg, lon_deg = (state.lat_deg, state.lon_deg) if state.located else (home.lat_e7 / 1e7, home.lon_e7 / 1e7)
        amsl_m = home.amsl_m if state.amsl_m is None else state.amsl_m
        ground_m = world.ground_amsl(float(lat_deg or 0.0), float(lon_deg or 0.0))
        agl_m = 0.0 if math.isnan(ground_m) else max(amsl_m - ground_m, 0.0)
        vector = found.east_m_s, found.north_m_s
        away_m_s = min(declared.away_m_s(vector, amsl_m, agl_m, at_s + job.waits_s) for at_s in flies_in.departs_s)
        within_m_s = declared.gusts_add_m_s + max(SURE_M_S, DEVIATIONS * found.deviation_m_s)
        speed_m_s, from_deg, winds = found.speed_m_s, found.from_deg, wind_note(declared)
        if away_m_s <= within_m_s:
            return Note("wind_as_declared", speed_m_s=speed_m_s, from_deg=from_deg, declared=winds)
        return Note("wind_not_as_declared", speed_m_s=speed_m_s, from_deg=from_deg, declared=winds, away_m_s=away_m_s)

    return beside
