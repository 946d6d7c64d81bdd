"""One vehicle's part in a rehearsal: what was told of its flight, what that took, and whether it came too late."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.notes.note import Note
from gcsplan.sim.flight.trace import Trace
from gcsplan.vehicle import Vehicle

__all__ = ["RehearsalPart", "energy_of", "lateness"]

LATE_FLIGHT_PART, LATE_FLIGHT_S = 0.1, 5.0
"""Later by more than this part of the flight that was told, and by more than these seconds, is not as planned."""


@dataclass(frozen=True, eq=False)
class RehearsalPart:
    """One vehicle's part in a rehearsal: its mission with its verdict, and its planned departure and arrival.

    ``depart_s``, ``arrive_s``: seconds since the fleet's common start; ``arrive_s`` is None if none is planned.
    ``airborne``: it begins at the top of its take-off (missions from papers); ``leaves``: it is gone when it arrives.
    """

    vehicle: Vehicle
    mission: Mission
    verdict: Verdict
    depart_s: float = 0.0
    arrive_s: float | None = None
    rtl_rel_home_m: float | None = None
    airborne: bool = False
    leaves: bool = False

    @property
    def told_s(self) -> tuple[float, float] | None:
        """Seconds from its departure to its arrival and to its end, as they are told; None if no arrival is."""
        if self.arrive_s is None:
            return None
        arrives_s = self.arrive_s - self.depart_s
        return arrives_s, arrives_s + max(self.verdict.time_s - self.verdict.arrive_s, 0.0)


def lateness(part: RehearsalPart, trace: Trace) -> tuple[Note, float] | None:
    """How much too late a flight came to its goal or to its end, also in seconds; None if it did not."""
    if part.told_s is None or not math.isfinite(trace.arrive_s):
        return None
    flown_s = trace.arrive_s - part.depart_s, trace.end_s - part.depart_s
    worst: tuple[Note, float] | None = None
    for arrived, told, took in zip((True, False), part.told_s, flown_s, strict=True):
        late_s = took - told
        if not late_s > max(LATE_FLIGHT_PART * told, LATE_FLIGHT_S) or (worst is not None and worst[1] >= late_s):
            continue
        late = Note(
            "arrived_late" if arrived else "down_late", name=trace.name, late_s=late_s, took_s=took, told_s=told
        )  # fmt: skip
        worst = late, late_s
    return worst


def energy_of(
    points: Floats, hold_s: float, vehicle: Vehicle, moving_s: float = math.nan, air_m: float | None = None,
    wind_m_s: float = 0.0,
) -> float:  # fmt: skip
    """The joules of a path (M, 3) flown in ``moving_s``, and of ``hold_s`` of hovering in a wind.

    ``air_m``: its horizontal metres through the air; None: the air is still.
    """
    delta = np.diff(points, axis=0)
    along_m = float(np.hypot(delta[:, 0], delta[:, 1]).sum()) if air_m is None else air_m
    moving_j = vehicle.energy.under_way_j(float(np.abs(delta[:, 2]).sum()), along_m, moving_s)
    return moving_j + vehicle.energy.hold_w(wind_m_s) * hold_s
