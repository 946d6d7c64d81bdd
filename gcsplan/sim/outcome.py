"""The result of a rehearsal: how every vehicle flew in every run, and which requirements were violated.

A `RehearsalPart` is the plan of one vehicle's flight; `energy_of` is the energy of its flight, `lateness` says whether
it came too late.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.flight.times import MODEL_PART, MODEL_S
from gcsplan.check.verdict import PAPER_MARK, Verdict
from gcsplan.errors import CheckFailed
from gcsplan.figures import floored
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.notes.note import Note, in_json
from gcsplan.sim.flight.trace import Judged, Meeting, Trace, examine, meetings
from gcsplan.units import METRIC, Units, duration
from gcsplan.vehicle import Vehicle
from gcsplan.world.world import World

LATE_FLIGHT_PART, LATE_FLIGHT_S = 0.1, 5.0
"""A flight that is later by more than this part of its planned time, and by more than these seconds, is late."""


@dataclass(frozen=True, eq=False)
class RehearsalPart:
    """One vehicle's part in a rehearsal: its mission with its verdict, and its planned departure and arrival.

    ``depart_s``, ``arrive_s``: seconds since the fleet's common start; ``arrive_s`` is None if none is planned.
    ``window_s``: the earliest and the latest arrival over the declared winds; None: planned in still air alone.
    ``airborne``: it begins at the top of its take-off (missions from papers); ``leaves``: it is gone when it arrives.
    ``late_s``: how much later than planned it departs; ``depart_window_s``: and so much later again, drawn in each run.
    """

    vehicle: Vehicle
    mission: Mission
    verdict: Verdict
    depart_s: float = 0.0
    arrive_s: float | None = None
    rtl_rel_home_m: float | None = None
    airborne: bool = False
    leaves: bool = False
    window_s: tuple[float, float] | None = None
    late_s: float = 0.0
    depart_window_s: float = 0.0

    @property
    def shifted_s(self) -> float:
        """How much later it arrives because it departs late: nothing where it waits until a time of day."""
        return 0.0 if any(leg.until_s is not None for leg in self.verdict.legs) else self.late_s

    @property
    def leaves_s(self) -> float:
        """When it departs, seconds since the fleet's common start."""
        return self.depart_s + self.late_s

    @property
    def planned_s(self) -> tuple[float, float] | None:
        """Planned seconds from its departure to its latest arrival and its end; None if the plan has no arrival."""
        if self.arrive_s is None:
            return None
        arrives_s = (self.arrive_s if self.window_s is None else self.window_s[1]) - self.depart_s
        return arrives_s, arrives_s + max(self.verdict.time_s - self.verdict.arrive_s, 0.0)


def lateness(part: RehearsalPart, trace: Trace) -> tuple[Note, float] | None:
    """How much too late a flight came to its goal or to its end, also in seconds; None if it did not."""
    if part.planned_s is None or not math.isfinite(trace.arrive_s):
        return None
    flown_s = trace.arrive_s - part.leaves_s, trace.end_s - part.leaves_s
    worst: tuple[Note, float] | None = None
    for arrived, planned, took in zip((True, False), part.planned_s, flown_s, strict=True):
        late_s = took - planned
        if not late_s > max(LATE_FLIGHT_PART * planned, LATE_FLIGHT_S) or (worst is not None and worst[1] >= late_s):
            continue
        late = Note(
            "arrived_late" if arrived else "down_late", name=trace.name, late_s=late_s, took_s=took, told_s=planned
        )  # fmt: skip
        worst = late, late_s
    return worst


def outside_s(window_s: tuple[float, float] | None, depart_s: float, arrive_s: float) -> float:
    """By how many seconds an arrival is outside its window: negative before it, positive after it; 0 without one."""
    if window_s is None or not math.isfinite(arrive_s):
        return 0.0
    off_s = arrive_s - min(max(arrive_s, window_s[0]), window_s[1])
    return off_s if abs(off_s) > max(MODEL_PART * (arrive_s - depart_s), MODEL_S) else 0.0


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


BREACHES_SHOWN = 8
"""Most violations that an error's message names."""
MEETING_STEP_S = 0.2


@dataclass(frozen=True, slots=True)
class Terms:
    """The requirements of a fleet.

    ``order``: names in the required order of arrival, empty if any order is allowed. ``separation_m`` None: the least
    distance is reported but not judged. ``pad_clear_s``: seconds for which a landed vehicle blocks its place.
    ``window_s``: how much an interval between two arrivals in this order may differ from the planned one.
    ``intervals_s``: the planned ones, between neighbours in this order; empty: as in the time table, which holds in
    still air. ``together``: any two arrive within ``window_s``."""

    order: tuple[str, ...] = ()
    separation_m: float | None = None
    pad_clear_s: float = math.inf
    window_s: float = 0.0
    intervals_s: tuple[float, ...] = ()
    together: bool = False

    @property
    def timed(self) -> bool:
        """Whether times between arrivals are requested."""
        return self.together or len(self.order) > 1


@dataclass(frozen=True, slots=True)
class Breach:
    """A violated requirement: its worst instance, and the number of runs in which it happened."""

    kind: str
    vehicles: tuple[str, ...]
    message: Note
    by: float
    runs: int

    def note(self, of_runs: int) -> Note:
        """Return what was broken, and in how many of ``of_runs``, all runs."""
        return (
            self.message if of_runs == 1 else Note("in_some_runs", what=self.message, runs=self.runs, of_runs=of_runs)
        )

    def as_dict(self) -> dict[str, Any]:
        """Return a dict for JSON."""
        parts = self.message.as_dict()
        return {
            "kind": self.kind, "vehicles": list(self.vehicles), "message": str(self.message), "by": _number(self.by),
            "runs": self.runs, "code": parts["code"], "data": parts["data"],
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Performance:
    """One vehicle in all runs. ``arrive_s``, ``end_s``: of each run (NaN: never). ``min_agl_m``: least of all runs."""

    name: str
    depart_s: float
    planned_s: float | None
    arrive_s: tuple[float, ...]
    end_s: tuple[float, ...]
    min_agl_m: float
    min_agl_at: tuple[float, float]
    battery_used_percent: float | None
    not_flown: tuple[Note, ...] = ()
    paper_energy: bool = False
    window_s: tuple[float, float] | None = None
    late_s: float = 0.0
    shifted_s: float = 0.0

    @property
    def inside_runs(self) -> int | None:
        """In how many runs it arrived inside its window, of its late departure if that is late; None without one."""
        if self.window_s is None:
            return None
        came = [a - self.shifted_s for a in self.arrive_s]
        return sum(math.isfinite(a) and not outside_s(self.window_s, self.depart_s, a) for a in came)

    @property
    def errors_s(self) -> tuple[float, ...]:
        """Arrival minus plan of each run (late: positive); infinite if it never arrived. Empty without a plan."""
        if self.planned_s is None:
            return ()
        return tuple(math.inf if math.isnan(a) else a - self.planned_s for a in self.arrive_s)

    @property
    def p95_s(self) -> float | None:
        """95th percentile of the absolute arrival error over the runs, s; None without a plan."""
        return percentile_95([abs(e) for e in self.errors_s])

    def as_dict(self) -> dict[str, Any]:
        """Return a dict for JSON; ``arrive_s`` is the median of the runs."""
        errors = self.errors_s
        worst = max(errors, key=abs, default=None)
        return {
            "name": self.name, "depart_s": self.depart_s, **({"late_s": self.late_s} if self.late_s else {}),
            "planned_arrive_s": self.planned_s,
            "arrive_s": _number(_median(self.arrive_s)), "error_s": _number(_median(errors)),
            "p95_error_s": _number(self.p95_s), "worst_error_s": _number(worst),
            "end_s": _number(_median(self.end_s)), "min_agl_m": _number(self.min_agl_m),
            "min_agl_at": {"lat": _number(self.min_agl_at[0]), "lon": _number(self.min_agl_at[1])},
            "battery_used_percent": self.battery_used_percent,
            "energy_figures": None if self.battery_used_percent is None else "paper" if self.paper_energy else "own",
            **self._window_in_json(), **in_json("not_flown", self.not_flown),
        }  # fmt: skip

    def _window_in_json(self) -> dict[str, Any]:
        if self.window_s is None:
            return {}
        earliest_s, latest_s = map(_number, self.window_s)
        return {"arrive_earliest_s": earliest_s, "arrive_latest_s": latest_s, "inside_window_runs": self.inside_runs}

    def row(self, runs: int, units: Units = METRIC, decimals: int = 0) -> dict[str, str]:
        """Return a table row over ``runs`` runs; its times have ``decimals``."""

        def clock(value: float | None) -> str:
            return duration(value, decimals) if value is None or math.isfinite(value) else "never"

        row = {"vehicle": self.name, "leaves": clock(self.depart_s + self.late_s), "planned": clock(self.planned_s)}
        if self.window_s is not None:
            row["window"] = " – ".join(clock(at_s + self.shifted_s) for at_s in self.window_s)
        arrived = _median(self.arrive_s)
        row["arrives"] = clock(math.inf if arrived is None or math.isnan(arrived) else arrived)
        error = _median(self.errors_s)
        row["error, s"] = "–" if error is None else f"{error:+.2f}" if math.isfinite(error) else "never"
        if runs > 1:
            row["95 % within, s"] = "–" if self.p95_s is None else f"{self.p95_s:.2f}"
        row["down"] = clock(_median(self.end_s))
        height = units.height
        lowest = floored(height.of(self.min_agl_m), height.decimals(1))
        row[f"lowest AGL, {height.symbol}"] = "–" if math.isnan(self.min_agl_m) else f"{lowest:.{height.decimals(1)}f}"
        mark = PAPER_MARK if self.paper_energy else ""
        row["battery, %"] = "–" if self.battery_used_percent is None else f"{self.battery_used_percent:.0f}{mark}"
        return row


@dataclass(frozen=True)
class Rehearsal:
    """The result of a rehearsal.

    ``closest``: the nearest approach of any two vehicles in any run, None if no two flew at the same time.
    ``intervals_kept_runs``: in how many runs all intervals between arrivals in the planned order were as planned, up to
    the terms' ``window_s`` and `MODEL_S`; ``interval_error_s``: how much longer (shorter: negative) than planned the
    worst was, None if none is requested; together: between the first and the last. ``simulator``: ``gcsplan`` or
    ``sitl``. ``weather``: the simulated weather, for output. ``flown``: the flown paths of the first run, in the order
    of ``vehicles``.
    """

    simulator: str
    runs: int
    seed: int
    weather: dict[str, Any]
    vehicles: tuple[Performance, ...]
    terms: Terms
    order_flown: tuple[str, ...]
    order_kept_runs: int
    separation_kept_runs: int
    closest: Meeting | None
    breaches: tuple[Breach, ...]
    notes: tuple[Note, ...] = ()
    flown: tuple[Trace, ...] = field(default=(), compare=False, repr=False)
    intervals_kept_runs: int = 0
    interval_error_s: float | None = None

    @property
    def not_judged(self) -> tuple[Note, ...]:
        """The parts of the missions that were not flown."""
        return tuple(what.of(vehicle=v.name) for v in self.vehicles for what in v.not_flown)

    @property
    def safe(self) -> bool | None:
        """False if a requirement was violated, else None if something was not flown, else True."""
        if self.breaches:
            return False
        return None if self.not_judged else True

    @property
    def inside_windows(self) -> tuple[int, int] | None:
        """How many arrivals of all runs lie inside their windows, and of how many; None without windows."""
        inside = [v.inside_runs for v in self.vehicles if v.inside_runs is not None]
        return (sum(inside), self.runs * len(inside)) if inside else None

    @property
    def p95_s(self) -> float | None:
        """95th percentile of the absolute arrival error over all vehicles and runs, s."""
        return percentile_95([abs(e) for v in self.vehicles for e in v.errors_s])

    def error(self, *, allow_unjudged: bool = False) -> CheckFailed | None:
        """Return the error for this result; None if all is well. ``allow_unjudged``: accept parts not flown."""
        if self.breaches:
            lines = [str(b.note(self.runs)) for b in self.breaches[:BREACHES_SHOWN]]
            rest = len(self.breaches) - BREACHES_SHOWN
            lines += [f"and {rest} more"] if rest > 0 else []
            return CheckFailed("the rehearsal found violations:\n  " + "\n  ".join(lines))
        if self.not_judged and not allow_unjudged:
            words = "not everything could be flown (--allow-unjudged takes it as it is):\n  "
            return CheckFailed(words + "\n  ".join(map(str, self.not_judged)), reason="not_judged")
        return None

    def as_dict(self) -> dict[str, Any]:
        """Return a dict for JSON."""
        closest = None
        if self.closest is not None:
            closest = {"vehicles": list(self.closest.names), "time_s": _number(self.closest.time_s)}
        return {
            "simulator": self.simulator, "runs": self.runs, "seed": self.seed, "weather": self.weather,
            "safe": self.safe, "vehicles": [v.as_dict() for v in self.vehicles],
            "fleet": {
                "order": list(self.terms.order), "order_flown": list(self.order_flown),
                "order_kept_runs": self.order_kept_runs if self.terms.order else None,
                "intervals_kept_runs": self.intervals_kept_runs if self.terms.timed else None,
                "worst_interval_error_s": _number(self.interval_error_s),
                "separation_m": self.terms.separation_m,
                "min_separation_m": None if self.closest is None else _number(self.closest.distance_m),
                "closest": closest,
                "separation_kept_runs": None if self.terms.separation_m is None else self.separation_kept_runs,
                "p95_error_s": _number(self.p95_s),
            },
            "violations": [b.as_dict() for b in self.breaches], **in_json("not_judged", self.not_judged),
            **in_json("notes", self.notes),
        }  # fmt: skip

    def rows(self, units: Units = METRIC) -> list[dict[str, str]]:
        """Return a table row for each vehicle; times in the fleet's order have tenths."""
        return [v.row(self.runs, units, 1 if len(self.vehicles) > 1 else 0) for v in self.vehicles]


def percentile_95(values: Sequence[float]) -> float | None:
    """Return the smallest of ``values`` that 95 % of them do not exceed; None if there are none."""
    return sorted(values)[math.ceil(0.95 * len(values)) - 1] if values else None


def _median(values: Sequence[float]) -> float | None:
    if not values:
        return None
    ordered = sorted(math.inf if math.isnan(v) else v for v in values)
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else 0.5 * (ordered[middle - 1] + ordered[middle])


def _number(value: float | None) -> float | None:
    """Return a number for JSON: None for infinity and NaN, else rounded to 7 decimals."""
    return None if value is None or not math.isfinite(value) else round(value, 7)


@dataclass
class Tally:
    """Accumulates the runs of a rehearsal; `result` returns the `Rehearsal`.

    ``most_j``: the most energy that each vehicle took in a run. ``flown``: the traces of the first run.
    """

    parts: Sequence[RehearsalPart]
    terms: Terms
    runs: int = 0
    order_kept: int = 0
    intervals_kept: int = 0
    interval_error_s: float = 0.0
    separation_kept: int = 0
    closest: Meeting | None = None
    order_flown: tuple[str, ...] = ()
    notes: list[Note] = field(default_factory=list)
    flown: tuple[Trace, ...] = ()
    _breaches: dict[tuple[object, ...], Breach] = field(default_factory=dict)
    _seen: set[tuple[object, ...]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._arrive: list[list[float]] = [[] for _ in self.parts]
        self._end: list[list[float]] = [[] for _ in self.parts]
        self._lowest: list[Judged | None] = [None] * len(self.parts)
        self.most_j = [0.0] * len(self.parts)

    def add(self, traces: Sequence[Trace], world: World, spent_j: Sequence[float]) -> None:
        """Add one run; ``traces``, and the energy that each flight took, J, are in the order of the parts."""
        self.runs += 1
        self.flown = self.flown or tuple(traces)
        self._seen = set()
        for i, (part, trace) in enumerate(zip(self.parts, traces, strict=True)):
            arrived = math.isfinite(trace.arrive_s)
            self._arrive[i].append(trace.arrive_s)
            self._end[i].append(trace.end_s if arrived else math.nan)
            if not arrived:
                never = Note("never_arrived", name=trace.name)
                if trace.why:
                    never = Note("never_arrived_for", name=trace.name, why=trace.why)
                self.breach("arrival", (trace.name,), never, math.inf)
            judged = examine(trace, part.vehicle, world)
            self._lower(i, judged)
            self.most_j[i] = max(self.most_j[i], spent_j[i])
            self._battery(part, spent_j[i])
            if (late := lateness(part, trace)) is not None:
                self.breach("late", (trace.name,), *late)
            if part.window_s is not None and (
                off_s := outside_s(part.window_s, part.depart_s, trace.arrive_s - part.shifted_s)
            ):
                earliest_s, latest_s = (at - part.depart_s for at in part.window_s)
                outside = Note(
                    "arrived_outside_window", name=trace.name, off_s=abs(off_s), late=off_s > 0.0,
                    earliest_s=earliest_s, latest_s=latest_s,
                )  # fmt: skip
                self.breach("window", (trace.name,), outside, abs(off_s))
            for f in judged.findings:
                self.breach(f.kind, (trace.name,), f.note, f.by, f.zone)
        self._order(traces)
        self._intervals(traces)
        self._separation(traces)

    def join(self, later: Tally) -> None:
        """Add the runs of another tally of the same parts, which come after these: as if all had been added here."""
        for mine, more in ((self._arrive, later._arrive), (self._end, later._end)):
            for i, times in enumerate(more):
                mine[i] += times
        for i, judged in enumerate(later._lowest):
            if judged is not None:
                self._lower(i, judged)
            self.most_j[i] = max(self.most_j[i], later.most_j[i])
        for key, found in later._breaches.items():
            was = self._breaches.get(key)
            worst = found if was is None or found.by > was.by else was
            self._breaches[key] = replace(worst, runs=found.runs + (was.runs if was is not None else 0))
        if self.runs == 0 or (later.terms.order and later.order_kept < later.runs):
            self.order_flown = later.order_flown
        self.flown = self.flown or later.flown
        self.runs += later.runs
        self.order_kept += later.order_kept
        self.intervals_kept += later.intervals_kept
        self.interval_error_s = max(self.interval_error_s, later.interval_error_s, key=abs)
        self.separation_kept += later.separation_kept
        self._nearer(later.closest)
        self.notes += later.notes

    def _lower(self, i: int, judged: Judged) -> None:
        before = self._lowest[i]
        if before is None or math.isnan(before.min_agl_m) or judged.min_agl_m < before.min_agl_m:
            self._lowest[i] = judged

    def _nearer(self, meeting: Meeting | None) -> None:
        if meeting is not None and (self.closest is None or meeting.distance_m < self.closest.distance_m):
            self.closest = meeting

    def breach(self, kind: str, vehicles: tuple[str, ...], message: Note, by: float, more: object = None) -> None:
        """Record a breach; of one kind, vehicle set and ``more``, keep the worst and count each run once."""
        key = (kind, vehicles, more)
        was = self._breaches.get(key)
        runs = (was.runs if was else 0) + (key not in self._seen)
        self._seen.add(key)
        new = Breach(kind, vehicles, message, by, runs)
        if was is not None and was.by >= by:
            new = Breach(kind, vehicles, was.message, was.by, runs)
        self._breaches[key] = new

    def _used_percent(self, part: RehearsalPart, spent_j: float) -> float | None:
        battery_j = part.vehicle.energy.battery_j
        return None if battery_j is None else 100.0 * spent_j / battery_j

    def _battery(self, part: RehearsalPart, spent_j: float) -> None:
        used, reserve = self._used_percent(part, spent_j), part.vehicle.energy.reserve
        if used is not None and used > 100.0 * (1.0 - reserve) + 1e-9:
            name, paper = part.vehicle.name, part.vehicle.energy.papers
            note = Note("battery_used_up", name=name, used_percent=used, paper=paper, reserve_percent=100.0 * reserve)
            self.breach("battery", (name,), note, used - 100.0 * (1.0 - reserve))

    def _order(self, traces: Sequence[Trace]) -> None:
        came = [t.name for t in sorted(traces, key=lambda t: math.inf if math.isnan(t.arrive_s) else t.arrive_s)]
        if self.runs == 1:
            self.order_flown = tuple(came)
        planned = list(self.terms.order)
        if not planned:
            return
        if came == planned:
            self.order_kept += 1
            return
        self.order_flown = tuple(came)
        self.breach("order", (), Note("order_lost", came=tuple(came), planned=tuple(planned)), 1.0)

    def _intervals(self, traces: Sequence[Trace]) -> None:
        """Compare the times between the arrivals in the planned order with the planned ones; together: of any two."""
        came_s = {t.name: t.arrive_s for t in traces}
        table_s = {p.vehicle.name: p.arrive_s or 0.0 for p in self.parts}
        pairs = list(pairwise(self.terms.order))
        planned_s = self.terms.intervals_s or [table_s[after] - table_s[before] for before, after in pairs]
        off_s = [came_s[after] - came_s[before] - s for (before, after), s in zip(pairs, planned_s, strict=True)]
        if self.terms.together:
            off_s = (
                [max(came_s.values()) - min(came_s.values())]
                if all(map(math.isfinite, came_s.values()))
                else [math.inf]
            )
        off_s = [off if math.isfinite(off) else math.inf for off in off_s]
        if off_s:
            worst_s = max(off_s, key=abs)
            self.intervals_kept += abs(worst_s) <= self.terms.window_s + MODEL_S
            self.interval_error_s = max(self.interval_error_s, worst_s, key=abs)

    def _separation(self, traces: Sequence[Trace]) -> None:
        needed = self.terms.separation_m
        found = meetings(traces, needed or 0.0, MEETING_STEP_S, pad_clear_s=self.terms.pad_clear_s)
        in_air = [m for m in found if m.kind == "air"]
        self._nearer(in_air[0] if in_air else None)
        if needed is None:
            return
        close = [m for m in found if m.distance_m < needed - 1e-6]
        for m in close:
            self.breach("separation", m.names, m.note(needed), needed - m.distance_m, m.kind)
        self.separation_kept += not close

    def result(
        self, simulator: str, seed: int, weather: dict[str, Any], not_flown: Sequence[tuple[Note, ...]]
    ) -> Rehearsal:
        """Return the rehearsal's result."""
        performances = []
        for i, part in enumerate(self.parts):
            low = self._lowest[i]
            performances.append(
                Performance(
                    part.vehicle.name, part.depart_s, part.arrive_s, tuple(self._arrive[i]), tuple(self._end[i]),
                    math.nan if low is None else low.min_agl_m, (math.nan, math.nan) if low is None else low.min_agl_at,
                    self._used_percent(part, self.most_j[i]), not_flown[i], part.vehicle.energy.papers,
                    part.window_s, part.late_s, part.shifted_s,
                )
            )  # fmt: skip
        breaches = sorted(self._breaches.values(), key=lambda b: (-b.runs, b.kind, b.vehicles))
        return Rehearsal(
            simulator, self.runs, seed, weather, tuple(performances), self.terms, self.order_flown, self.order_kept,
            self.separation_kept, self.closest, tuple(breaches), tuple(dict.fromkeys(self.notes)), self.flown,
            self.intervals_kept, self.interval_error_s if self.terms.timed else None,
        )  # fmt: skip
