"""`Verdict`: the result of the check of one mission, in numbers and in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import TYPE_CHECKING

from gcsplan.check.flight.times import spare_s
from gcsplan.check.margins import Miss, ZonePass
from gcsplan.check.motion.stretch import Place, StretchKind
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mavlink.mission.parameter_list import FlightExtent
from gcsplan.notes.note import IN_FILES, Finding, Note, Wording
from gcsplan.wind.drift import Drift, Drifts

if TYPE_CHECKING:
    from gcsplan.check.flight.winds import FlightInWind
    from gcsplan.fleet.arrival import Slot


WHOLE_S = 1.0
"""Gates open at whole seconds of the day, so what they set may be off by this."""
PAPER_MARK = " (paper's figures)"


@dataclass(frozen=True, slots=True)
class LegFigures:
    """Figures of one flown stretch; NaN where the ground is unknown.

    ``min_agl_m`` counts from the ground and what stands on it, on the line itself; ``agl_end_m`` from bare ground.
    ``energy_j`` and ``time_s`` include the hold at the leg's end, ``hold_j`` and ``hold_s``; ``hold_s`` may be
    infinite (a loiter without end takes no energy and no time here). The figures are for one pass; ``times``: how
    often it is flown, if a jump leads back. ``until_s``: its hold ends at a time of day, so many seconds after
    the vehicle has left the ground. ``jumped_from``: the jump that leads to it. ``lead_j``: of ``energy_j``,
    what is at most spent ahead of an even share on the way: the base power while it is slower than its top speed.
    ``speed_m_s``: commanded. ``way_m``: from its start to its end, to east and to north in the mission's plane.
    """

    seq: int
    kind: StretchKind
    start: Place
    end: Place
    column: bool
    on_path: bool
    horizontal_m: float
    length_m: float
    climb_deg: float
    agl_end_m: float
    min_agl_m: float
    min_agl_at: tuple[float, float]
    max_agl_m: float
    zone_clearance_m: float
    nearest_zone: str
    energy_j: float
    time_s: float
    hold_s: float
    hold_j: float = 0.0
    times: int = 1
    jumped_from: int | None = None
    lead_j: float = 0.0
    speed_m_s: float = math.nan
    until_s: float | None = None
    way_m: tuple[float, float] = (math.nan, math.nan)


def by_item(legs: Sequence[LegFigures]) -> Iterator[tuple[LegFigures, int]]:
    """The figures of each item in the order flown, and how many stretches they are of: a spline's chords, for example.

    An item that a jump leads back to comes again. ``kind`` and ``end`` are those of its last stretch. ``min_agl_m`` and
    ``climb_deg`` leave columns out; without another stretch the height is NaN, and the angle that of the column.
    """
    group: list[LegFigures] = []
    for leg in legs:
        if group and (leg.jumped_from is not None or (leg.seq, leg.times) != (group[-1].seq, group[-1].times)):
            yield _together(group), len(group)
            group = []
        group.append(leg)
    if group:
        yield _together(group), len(group)


def _together(legs: Sequence[LegFigures]) -> LegFigures:
    first, last = legs[0], legs[-1]
    flown = [leg for leg in legs if not leg.column]
    low = min((leg for leg in flown if not math.isnan(leg.min_agl_m)), key=lambda leg: leg.min_agl_m, default=None)
    near = min((leg for leg in legs if leg.nearest_zone), key=lambda leg: leg.zone_clearance_m, default=last)

    def total(of: Callable[[LegFigures], float]) -> float:
        return math.fsum(map(of, legs))

    return replace(
        last, start=first.start, jumped_from=first.jumped_from, column=not flown,
        on_path=any(leg.on_path for leg in legs),
        horizontal_m=total(lambda leg: leg.horizontal_m), length_m=total(lambda leg: leg.length_m),
        energy_j=total(lambda leg: leg.energy_j), time_s=total(lambda leg: leg.time_s),
        hold_s=total(lambda leg: leg.hold_s), hold_j=total(lambda leg: leg.hold_j),
        lead_j=total(lambda leg: leg.lead_j), way_m=(total(lambda leg: leg.way_m[0]), total(lambda leg: leg.way_m[1])),
        climb_deg=max((leg.climb_deg for leg in flown or legs), key=abs),
        min_agl_m=math.nan if low is None else low.min_agl_m, min_agl_at=(low or last).min_agl_at,
        max_agl_m=max((leg.max_agl_m for leg in legs if not math.isnan(leg.max_agl_m)), default=math.nan),
        zone_clearance_m=near.zone_clearance_m, nearest_zone=near.nearest_zone,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Verdict:
    """The result of the check of ``mission`` (as sent), which judges the items as the autopilot stores them.

    ``misses``: how near it comes to each limit, on request. ``until_reserve_s``: if the mission ends in a hold or a
    round without end, seconds until the battery is down to its reserve. ``zone_pass``: the nearest zone that is passed
    over or under. ``energy_stated``: the vehicle's energy was given; else energies say nothing and are not reported.
    ``paper_energy``: energies count the paper's numbers, for the vehicle's own were not given. ``extent``: the greatest
    distances of the flight from home, errors counted; None where nothing was judged. ``in_wind``: the flight in the
    declared winds, None for still air; its windows are computed when they are read first. Times are in still air;
    energies are those of the worst declared wind, or of still air where that takes more.
    """

    mission: Mission
    legs: tuple[LegFigures, ...]
    findings: tuple[Finding, ...]
    not_judged: tuple[Note, ...]
    notes: tuple[Note, ...] = ()
    battery_used_percent: float | None = None
    misses: tuple[Miss, ...] = ()
    until_reserve_s: float | None = None
    zone_pass: ZonePass | None = None
    energy_stated: bool = True
    paper_energy: bool = False
    extent: FlightExtent | None = None
    in_wind: FlightInWind | None = None

    def __repr__(self) -> str:
        return f"<Verdict of {self.mission.name!r}: {self.word}, {len(self.legs)} legs, {self.length_m:.0f} m>"

    @property
    def word(self) -> str:
        """The verdict in a word or two."""
        return {True: "safe", False: f"{len(self.findings)} findings", None: "not judged"}[self.safe]

    def reported_j(self, joules: float) -> float | None:
        """An energy of this flight for people and files: None unless the vehicle's energy was given."""
        return joules if self.energy_stated else None

    @property
    def energy_figures(self) -> str | None:
        """Whose numbers the energies count: ``own`` or ``paper``; None if no energy is reported."""
        return ("paper" if self.paper_energy else "own") if self.energy_stated else None

    @property
    def energy_mark(self) -> str:
        """The mark behind an energy, or behind a part of the battery, in outputs for people."""
        return PAPER_MARK if self.paper_energy else ""

    @property
    def safe(self) -> bool | None:
        """True, False, or None if no limit is broken but something could not be judged."""
        if self.findings:
            return False
        return None if self.not_judged else True

    @property
    def path_legs(self) -> tuple[LegFigures, ...]:
        """The stretches that count for the path: from the top of the take-off to the approach."""
        return tuple(leg for leg in self.legs if leg.on_path)

    @property
    def length_m(self) -> float:
        """Length of the path in space, m."""
        return math.fsum(leg.length_m * leg.times for leg in self.path_legs)

    @property
    def path_energy_j(self) -> float:
        """Energy of the path alone, J; comparable with a planner's lower bound."""
        return math.fsum(leg.energy_j * leg.times for leg in self.path_legs)

    @property
    def energy_j(self) -> float:
        """Energy of the whole flight, J, including columns, holds and the return."""
        return math.fsum(leg.energy_j * leg.times for leg in self.legs)

    @property
    def time_s(self) -> float:
        """Duration of the whole flight, s; a loiter without end counts as 0."""
        return math.fsum(leg.time_s * leg.times for leg in self.legs)

    @property
    def arrive_s(self) -> float:
        """Seconds from leaving the ground to the end of the path (the goal at approach altitude)."""
        last, stays_s = self._arrival
        return math.fsum([*(leg.time_s * leg.times for leg in self.legs[: last + 1]), -stays_s])

    def arrive_window_s(self, slot: Slot | None = None) -> tuple[float, float] | None:
        """The earliest and the latest arrival in the declared winds, seconds; None in still air, or if it cannot fly.

        From leaving the ground; with ``slot`` since the fleet's common start, at which ``arrive_s`` is in still air.
        """
        if self.in_wind is None or self.in_wind.window is None or not self.legs:
            return None
        last, stays_s = self._arrival
        begins_s = 0.0 if slot is None else slot.arrive_s - self.arrive_s
        ends = self.in_wind.window.earliest_s, self.in_wind.window.latest_s
        return tuple(begins_s + float(s[last]) - stays_s for s in ends)  # type: ignore[return-value]

    @property
    def drift(self) -> Drift | None:
        """How much earlier or later each leg ends in each declared wind, and after a departure as late as it may be;
        None in still air with a departure on time, or if it cannot fly."""
        blown = self.in_wind
        if blown is None or blown.too_windy is not None or (blown.wind.still and not blown.flies_in.late_s):
            return None
        return blown.drift

    @property
    def arrival_drift(self) -> Drifts:
        """The drift of the arrival (1)."""
        last, _ = self._arrival
        return Drifts.none(1) if self.drift is None or last < 0 else self.drift.at_end_of(last)

    def leg_windows_s(self, slot: Slot | None = None) -> tuple[tuple[float, float], ...] | None:
        """The earliest and latest end of each leg, likewise, from leaving the ground as in `clock_s`."""
        if self.in_wind is None or self.in_wind.window is None:
            return None
        still = zip(self.clock_s(slot), self.clock_s(), strict=True)
        ends = zip(self.in_wind.window.earliest_s.tolist(), self.in_wind.window.latest_s.tolist(), strict=True)
        return tuple((early + a - b, late + a - b) for (a, b), (early, late) in zip(still, ends, strict=True))

    def gates_after_s(self) -> tuple[float, ...]:
        """When each gate may open at the earliest, so that the vehicle is there in every declared wind, seconds from
        leaving the ground: each as if the one before it opened as early as that. They open at the nearest whole
        second, so each has one to spare."""
        found: list[float] = []
        still_s = before = 0.0
        window = None if self.in_wind is None else self.in_wind.window
        for k, leg in enumerate(self.legs):
            if leg.until_s is None:
                still_s += leg.time_s * leg.times
                continue
            took_s = still_s if window is None else float(window.latest_s[k - 1]) - self._opened_s(k)
            before += took_s + spare_s(took_s) + WHOLE_S
            found.append(before)
            still_s = 0.0
        return tuple(found)

    def _opened_s(self, until: int) -> float:
        """When the last gate before a leg opens, seconds from leaving the ground; 0 before the first."""
        return next((leg.until_s for leg in reversed(self.legs[:until]) if leg.until_s is not None), 0.0)

    @property
    def _arrival(self) -> tuple[int, float]:
        """The leg with which the path ends, -1 if there is none, and the seconds that it holds there."""
        last = max((i for i, leg in enumerate(self.legs) if leg.on_path), default=-1)
        stays_s = self.legs[last].hold_s if last >= 0 else 0.0
        return last, stays_s if math.isfinite(stays_s) else 0.0

    @property
    def gate_s(self) -> float:
        """Seconds of holding before the path begins."""
        return math.fsum(leg.hold_s for leg in self._before_path if math.isfinite(leg.hold_s))

    def clock_s(self, slot: Slot | None = None) -> tuple[float, ...]:
        """Seconds from leaving the ground to the end of each leg, with all the rounds of a jump.

        ``slot``: the vehicle's part of the time table. A wait at its gate that the mission states as a time of day has
        no seconds in the mission: they count for the last leg before the path. A flight that is planned to begin in the
        air (in the papers) begins with its path.
        """
        before = len(self._before_path)
        times = [leg.time_s * leg.times for leg in self.legs]
        if slot is not None and slot.route.start_ground_amsl_m is None:
            times[:before] = [0.0] * before
        elif slot is not None and before:
            times[before - 1] += max(0.0, slot.hold_s - self.gate_s)
        return tuple(accumulate(times))

    @property
    def _before_path(self) -> tuple[LegFigures, ...]:
        first = next((i for i, leg in enumerate(self.legs) if leg.on_path), 0)
        return self.legs[:first]

    @property
    def lowest(self) -> LegFigures | None:
        """The stretch that is lowest above ground, except columns; None if there is none."""
        legs = [leg for leg in self.legs if not leg.column and not math.isnan(leg.min_agl_m)]
        return min(legs, key=lambda leg: leg.min_agl_m, default=None)

    @property
    def highest(self) -> LegFigures | None:
        """The stretch that is highest above ground, columns too; None if there is none."""
        legs = [leg for leg in self.legs if not math.isnan(leg.max_agl_m)]
        return max(legs, key=lambda leg: leg.max_agl_m, default=None)

    @property
    def nearest(self) -> LegFigures | None:
        """The stretch nearest to a zone whose height band it meets; None if there is none."""
        legs = [leg for leg in self.legs if leg.nearest_zone]
        return min(legs, key=lambda leg: leg.zone_clearance_m, default=None)

    @property
    def max_climb_deg(self) -> float:
        """The steepest angle of all stretches except columns, up or down, degrees."""
        return max((abs(leg.climb_deg) for leg in self.legs if not leg.column and leg.horizontal_m > 0), default=0.0)

    def describe(self, wording: Wording = IN_FILES) -> str:
        """All findings and all that is not judged, one per line."""
        unjudged = [f"not judged: {note.text(wording)}" for note in self.not_judged]
        return "\n".join([f.note.text(wording) for f in self.findings] + unjudged)
