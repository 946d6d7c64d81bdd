"""The path actually flown, by a simulated vehicle or an autopilot, and its check against limits and other aircraft.

A trace contains the effects of corners, wind, noise and the autopilot's own errors. ``track_error_m`` and
``altitude_error_m`` stand for just these errors, so they are not added again; only the uncertainty between two samples
is. Climb angles are not judged: they limit the mission's legs, which the check has judged, and a noisy trace can have
any angle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.notes.note import Finding, Note
from gcsplan.vehicle import Vehicle
from gcsplan.world.airspace import Legs, Violation
from gcsplan.world.world import World

CHORD = 16
"""Sample intervals that are checked as one straight leg if the samples between lie near it."""
TRACK_M, HEIGHT_M = 0.25, 0.05
"""Metres, across and in altitude, by which those samples may lie off the leg; the leg is widened by their offset."""
BLOCK_STEPS = 16
"""Time steps for which the distance between two aircraft is bounded at once."""

FLOWN_NOTES = {
    "min_agl": "flew_too_low",
    "max_agl": "flew_too_high",
    "max_amsl": "flew_above_ceiling",
    "terrain_clearance": "flew_near_rising_ground",
}
"""The notes on limits of height, by the kind of the violation."""


@dataclass(frozen=True, eq=False, slots=True)
class Trace:
    """One aircraft's flown path over time.

    ``times_s`` (M,), increasing, and ``points`` (M, 3) east_m, north_m, amsl_m, from leaving the ground to the end. The
    true path is within ``off_m`` of the straight pieces between the points; at every time the aircraft is within
    ``slack_m`` (M - 1,) of its place in uniform motion between them. ``column`` and ``seq`` (M - 1,): whether a piece
    belongs to a take-off or landing, and its wire item. ``arrive_s``: time of reaching the goal, NaN if never.
    ``stays``: it stays in the air at the end; ``leaves``: it is gone after the end. ``why``: what kept it from
    arriving, where that is known.
    """

    name: str
    times_s: Floats
    points: Floats
    column: Bools
    seq: Indices
    arrive_s: float
    off_m: float
    slack_m: Floats
    stays: bool = False
    leaves: bool = False
    why: tuple[Note, ...] = ()

    @property
    def begin_s(self) -> float:
        """Time of leaving the ground."""
        return float(self.times_s[0])

    @property
    def end_s(self) -> float:
        """Time of touch-down, or of reaching the last point."""
        return float(self.times_s[-1])

    def at(self, times_s: Floats) -> Floats:
        """(K, 3) positions at ``times_s`` (K,); before the first and after the last time, the end points."""
        return np.column_stack([np.interp(times_s, self.times_s, self.points[:, k]) for k in range(3)])


@dataclass(frozen=True, slots=True)
class Judged:
    """``min_agl_m``: least height above ground and obstacles outside columns, NaN if none is known; and its place."""

    min_agl_m: float
    min_agl_at: tuple[float, float]
    findings: tuple[Finding, ...]


def examine(trace: Trace, vehicle: Vehicle, world: World) -> Judged:
    """Check a trace against the limits with the exact check, also between its samples."""
    legs, owner = _legs(trace)
    limits = replace(vehicle.limits, max_climb_deg=90.0, max_descent_deg=90.0)
    report = world.airspace.examine(legs, limits)
    free = ~legs.column & ~np.isnan(report.min_agl_m)
    agl, place = math.nan, (math.nan, math.nan)
    if free.any():
        height = np.where(free, report.min_agl_m - legs.altitude_error_m, np.inf)
        low = int(height.argmin())
        f = float(report.min_agl_at[low])
        here = legs.start[low, :2] + f * (legs.end[low, :2] - legs.start[low, :2])
        agl, place = float(height[low]), _degrees(world, here)
    worst: dict[tuple[str, int], Violation] = {}
    for v in report.violations:
        if (v.kind, v.zone) not in worst or v.by > worst[v.kind, v.zone].by:
            worst[v.kind, v.zone] = v
    found = [_finding(v, trace, int(owner[v.leg]), world) for v in worst.values()]
    return Judged(agl, place, tuple(found))


def _legs(trace: Trace) -> tuple[Legs, Indices]:
    """Return the trace as few straight legs, each widened by the offset of its samples, and each leg's first sample."""
    points = trace.points
    firsts: list[Indices] = []
    lasts: list[Indices] = []
    edges = [0, *(np.flatnonzero(np.diff(trace.column)) + 1).tolist(), len(trace.column)]
    for a, b in pairwise(edges):
        starts = np.arange(a, b, CHORD, dtype=np.intp)
        firsts.append(starts)
        lasts.append(np.minimum(starts + CHORD, b).astype(np.intp))
    first, last = np.concatenate(firsts), np.concatenate(lasts)
    inner = np.minimum(first[:, None] + np.arange(1, CHORD), last[:, None])
    track, height = _off(points[first], points[last], points[inner])
    bent = (track > TRACK_M) | (height > HEIGHT_M)
    each = np.concatenate([np.arange(a, b) for a, b in zip(first[bent], last[bent], strict=True)] or [first[:0]])
    owner = np.concatenate([first[~bent], each]).astype(np.intp)
    until = np.concatenate([last[~bent], each + 1]).astype(np.intp)
    none = np.zeros(len(each))
    return (
        Legs(
            points[owner], points[until], trace.column[owner],
            np.concatenate([track[~bent], none]) + trace.off_m, np.concatenate([height[~bent], none]) + trace.off_m,
        ),
        owner,
    )  # fmt: skip


def _off(a: Floats, b: Floats, inner: Floats) -> tuple[Floats, Floats]:
    """(N,) largest horizontal and largest vertical offset of ``inner`` (N, K, 3) from the lines ``a``-``b`` (N, 3)."""
    along = b - a
    square = np.maximum((along**2).sum(axis=1), 1e-12)
    f = np.clip(((inner - a[:, None]) * along[:, None]).sum(axis=2) / square[:, None], 0.0, 1.0)
    apart = inner - (a[:, None] + f[..., None] * along[:, None])
    return np.hypot(apart[..., 0], apart[..., 1]).max(axis=1), np.abs(apart[..., 2]).max(axis=1)


def _finding(v: Violation, trace: Trace, sample: int, world: World) -> Finding:
    lat, lon = _degrees(world, np.array([v.east_m, v.north_m]))
    zone = world.airspace.zones[v.zone] if v.zone >= 0 else None
    name = "" if zone is None else zone.name_at(v.east_m, v.north_m)
    time_s, seq, who, at_m = float(trace.times_s[sample]), int(trace.seq[sample]), trace.name, v.amsl_m
    if v.kind == "coverage":
        note = Note("flew_over_unknown_ground", seq, name=who, time_s=time_s, lat=lat, lon=lon, amsl_m=at_m)
    elif zone is not None:
        note = Note(
            "flew_into_zone" if zone.outside is None else "flew_out_of_keep_in", seq, name=who, zone=name, by_m=v.by,
            time_s=time_s, lat=lat, lon=lon, amsl_m=at_m,
        )  # fmt: skip
    else:
        note = Note(FLOWN_NOTES[v.kind], seq, name=who, by_m=v.by, time_s=time_s, lat=lat, lon=lon, amsl_m=at_m)
    return Finding(seq, v.kind, note, lat, lon, v.amsl_m, v.value, v.limit, v.by, v.unit, name)


def _degrees(world: World, place: Floats) -> tuple[float, float]:
    lat, lon = (float(x) for x in world.frame.to_degrees(place[0], place[1]))
    return lat, lon


# -- separation ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Meeting:
    """Two aircraft at their least distance; the uncertainty between samples is subtracted from ``distance_m``.

    ``kind``: ``air``, or ``landing`` if the first lands beside the second, which stands on the ground."""

    names: tuple[str, str]
    distance_m: float
    time_s: float
    kind: str = "air"

    def note(self, needed_m: float) -> Note:
        """Return how near they came; ``needed_m`` is the required separation."""
        first, second = self.names
        return Note(
            "came_too_near" if self.kind == "air" else "landed_too_near", first=first, second=second,
            distance_m=self.distance_m, needed_m=needed_m, time_s=self.time_s,
        )  # fmt: skip


def meetings(
    traces: Sequence[Trace], needed_m: float, step_s: float, *, pad_clear_s: float = math.inf
) -> list[Meeting]:
    """Return the least distance of each pair nearer than ``needed_m`` while both are in the air, and of the nearest.

    The search runs in steps of ``step_s``, then at the traces' own times. The possible deviation from uniform motion
    between those is subtracted, so the distances are never optimistic. The nearest pair is first. Landings within
    ``needed_m`` of an aircraft that landed up to ``pad_clear_s`` before follow.
    """
    found: list[Meeting] = []
    if len(traces) > 1:
        first = math.floor(min(t.begin_s for t in traces) / step_s)
        last = math.ceil(max(t.end_s for t in traces) / step_s) + 1
        times = step_s * np.arange(first, last + 1, dtype=np.float64)
        found = _in_the_air(traces, times, needed_m)
    landed = sorted((t for t in traces if not t.stays and not t.leaves), key=lambda t: t.end_s)
    for n, late in enumerate(landed):
        for early in landed[:n]:
            apart_m = float(np.hypot(*(late.points[-1] - early.points[-1])[:2]))
            if apart_m < needed_m and late.end_s < early.end_s + pad_clear_s:
                found.append(Meeting((late.name, early.name), apart_m, late.end_s, "landing"))
    return found


def _in_the_air(traces: Sequence[Trace], times: Floats, needed_m: float) -> list[Meeting]:
    flying = np.array([(times[1:] >= t.begin_s) & ((times[:-1] <= t.end_s) | t.stays) for t in traces])
    n = len(times) - 1
    blocks = np.arange(0, n, BLOCK_STEPS)
    places = np.stack([t.at(times[blocks]) for t in traces])
    reach = np.array([_reach(t, times[blocks], times[np.minimum(blocks + BLOCK_STEPS, n)]) for t in traces])
    i, j = np.triu_indices(len(traces), 1)
    bound = np.full((len(i), len(blocks)), np.inf)
    for m, (a, b) in enumerate(zip(i.tolist(), j.tolist(), strict=True)):
        both = np.logical_or.reduceat(flying[a] & flying[b], blocks)
        apart = np.linalg.norm(places[a] - places[b], axis=1)
        bound[m] = np.where(both, apart - reach[a] - reach[b], np.inf)
    found: list[Meeting] = []
    best = math.inf
    for m in np.argsort(bound.min(axis=1)).tolist():
        if bound[m].min() > max(best, needed_m):
            break
        a, b = traces[i[m]], traces[j[m]]
        rows = (blocks[bound[m] <= max(best, needed_m)][:, None] + np.arange(BLOCK_STEPS)).ravel()
        rows = rows[rows < n]
        rows = rows[flying[i[m], rows] & flying[j[m], rows]]
        least, when = _nearest(a, b, times, rows)
        if least < needed_m or least < best:
            found.append(Meeting((a.name, b.name), least, when))
        best = min(best, least)
    found.sort(key=lambda meeting: meeting.distance_m)
    return [f for k, f in enumerate(found) if k == 0 or f.distance_m < needed_m]


def _reach(trace: Trace, begin_s: Floats, end_s: Floats) -> Floats:
    """Upper bound of its distance, between ``begin_s`` and ``end_s``, from its position at ``begin_s``."""
    flown = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(trace.points, axis=0), axis=1)))
    along = np.interp(end_s, trace.times_s, flown) - np.interp(begin_s, trace.times_s, flown)
    return np.asarray(along + 2.0 * trace.slack_m.max(initial=0.0))


def _nearest(a: Trace, b: Trace, times: Floats, rows: Indices) -> tuple[float, float]:
    """Return the least distance, and its time, while both fly within the intervals ``rows`` of ``times``.

    The possible deviations from uniform motion are subtracted.
    """
    begin = max(a.begin_s, b.begin_s)
    end = min(math.inf if t.stays else t.end_s for t in (a, b))
    knots = np.unique(np.concatenate([times[rows], times[rows + 1], a.times_s, b.times_s]))
    knots = knots[(knots >= begin) & (knots <= end)]
    middle = 0.5 * (knots[1:] + knots[:-1])
    looked = np.zeros(len(times), np.bool_)
    looked[rows] = True
    kept = looked[np.searchsorted(times, middle, side="right") - 1]
    if not kept.any():
        return math.inf, math.nan
    apart = a.at(knots) - b.at(knots)
    p, d = apart[:-1][kept], np.diff(apart, axis=0)[kept]
    f = np.clip(-(p * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-18), 0.0, 1.0)
    distance = np.linalg.norm(p + f[:, None] * d, axis=1) - _uneven(a, middle[kept]) - _uneven(b, middle[kept])
    low = int(distance.argmin())
    when = knots[:-1][kept][low] + f[low] * np.diff(knots)[kept][low]
    return max(0.0, float(distance[low])), float(when)


def _uneven(trace: Trace, times_s: Floats) -> Floats:
    """Metres by which the aircraft may be off uniform motion at ``times_s``."""
    at = np.searchsorted(trace.times_s, times_s, side="right") - 1
    inside = (at >= 0) & (at < len(trace.slack_m))
    return np.where(inside, trace.slack_m[np.where(inside, at, 0)], 0.0)
