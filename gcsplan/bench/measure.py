"""The instruments of benchmarks: the exact check of a whole path, memory, percentiles, and rank tests."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Legs

MOST_RUNS = 10_000
"""Most runs of an algorithm in one call."""
LEAST_RUNS_TO_JUDGE = 30
SIGNIFICANCE = 0.05
"""Runs of each, at least, from which rankings are judged, and the p below which they differ."""

CHORD_SAGITTA_M = 0.05
MERGED_M = 1e-6
"""Points of a track within this distance, m, are merged: a climb angle between them would be a rounding error."""


def passes(problem: Problem, points: object) -> bool:
    """Whether a path leads from start to goal and the exact check finds no violation on any leg, arcs included.

    With a turn radius, every corner is flown as the arc tangent to both legs, and arcs must not overlap.
    """
    p = np.asarray(points, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3 or len(p) < 2 or not np.isfinite(p).all():
        return False
    off = max(float(np.abs(p[0] - problem.start).max()), float(np.abs(p[-1] - problem.goal).max()))
    if off > 1e-6:
        return False
    legs = Legs.of_path(p, problem.limits)
    if problem.turn_radius_m > 0.0:
        track = flown(p, problem.turn_radius_m)
        if track is None:
            return False
        legs = Legs.of_path(track[0], problem.limits)
        legs = replace(legs, track_error_m=legs.track_error_m + CHORD_SAGITTA_M * track[1])
    return not problem.airspace.examine(legs, problem.limits).violations


def length_m(points: object) -> float:
    """The length in space of a path (N, 3), m."""
    return float(np.linalg.norm(np.diff(np.asarray(points, dtype=np.float64), axis=0), axis=1).sum())


def flown(points: Floats, radius_m: float) -> tuple[Floats, Bools] | None:
    """The track that a fixed wing flies along way points (N, 3): legs, and arcs as chords within `CHORD_SAGITTA_M`.

    Returns its points (M, 3), none within `MERGED_M` of the one before, and (M - 1,) whether a chord leads to the next.
    The altitude of a way point is reached in the middle of its arc and is linear along the track between. None if the
    arcs of neighbours overlap, so that the track cannot be flown. Written for this check alone; it shares nothing with
    the planners.
    """
    legs = np.diff(points[:, :2], axis=0)
    lengths = np.hypot(*legs.T)
    if not (lengths > 0.0).all():
        return None
    headings = np.arctan2(legs[:, 1], legs[:, 0])
    turns = (np.diff(headings) + math.pi) % (2.0 * math.pi) - math.pi
    with np.errstate(over="ignore"):
        reach = np.concatenate([[0.0], radius_m * np.tan(np.abs(turns) / 2.0), [0.0]])
    if (reach[:-1] + reach[1:] > lengths + 1e-3).any():
        return None
    step = 2.0 * math.acos(max(0.0, 1.0 - CHORD_SAGITTA_M / radius_m))
    track, middle, chord = [points[0, :2]], [0], [False]
    for i, turn in enumerate(turns.tolist()):
        halves = max(1, math.ceil(abs(turn) / (2.0 * step)))
        angle = headings[i] + np.linspace(0.0, turn, 2 * halves + 1)
        side = math.copysign(1.0, turn)
        begin = points[i + 1, :2] - reach[i + 1] * legs[i] / lengths[i]
        turned = np.stack([np.sin(angle) - np.sin(headings[i]), np.cos(headings[i]) - np.cos(angle)], axis=-1)
        middle.append(len(track) + halves)
        track += list(begin + side * radius_m * turned)
        chord += [False] + [True] * (2 * halves)
    middle.append(len(track))
    track.append(points[-1, :2])
    chord.append(False)
    flat = np.array(track)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(flat, axis=0).T))])
    return _distinct(np.column_stack([flat, np.interp(s, s[middle], points[:, 2])]), chord)


def _distinct(track: Floats, chord: Sequence[bool]) -> tuple[Floats, Bools]:
    """The track without points within `MERGED_M` of the last one kept; the first and the last point always stay.

    ``chord`` states for each point whether a chord leads to it. Distances are in space, so that no climb on the spot is
    lost.
    """
    kept = [0]
    for i in range(1, len(track)):
        if math.dist(track[kept[-1]], track[i]) > MERGED_M:
            kept.append(i)
    if kept[-1] != len(track) - 1:
        kept[max(1, len(kept) - 1) :] = [len(track) - 1]
    return track[kept], np.array(chord, dtype=np.bool_)[kept[1:]]


class Memory:
    """Peak resident memory of this process within a ``with`` block of `peak`, above the use before it, MB.

    It is the resident set, because arrays of compiled code and of other planners' C++ count too, which tracing Python's
    allocations would miss. None if the system does not provide it (it needs Linux's ``/proc``).
    """

    def __init__(self) -> None:
        self.peak_mb: float | None = None

    @contextlib.contextmanager
    def peak(self) -> Iterator[None]:
        """Measure the memory of the body."""
        gc.collect()
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).malloc_trim(0)  # memory that the C library keeps after free would hide new use
        before = None
        with contextlib.suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
            before = _status_kb("VmRSS")
        yield
        most = None if before is None else _status_kb("VmHWM")
        self.peak_mb = None if before is None or most is None else max(0.0, (most - before) / 1024.0)


def resident_mb(pid: int | None = None) -> float:
    """Resident memory of the process ``pid`` (None: this one), MB; 0 where the system does not say."""
    return (_status_kb("VmRSS", pid) or 0.0) / 1024.0


def _status_kb(key: str, pid: int | None = None) -> float | None:
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid or 'self'}/status").read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith(f"{key}:"):
                return float(line.split()[1])
    return None


def percentile(values: list[float], percent: float) -> float | None:
    """Percentile, linear between neighbours; None of an empty list."""
    return float(np.percentile(values, percent)) if values else None


def peak_mb() -> float:
    """The most memory that this process has had so far, MB."""
    import resource  # not on every system

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


def compare(low: Floats, high: Floats) -> tuple[float, float]:
    """Two-sided p by Mann and Whitney's U (normal approximation, corrected for ties), and the effect size: the
    probability that a run of ``low`` is less than one of ``high``, ties counted half (Vargha and Delaney's A)."""
    from scipy.stats import mannwhitneyu, rankdata

    ranks = rankdata(np.concatenate([low, high]))  # infinities tie with each other
    if np.ptp(ranks) == 0.0:
        return 1.0, 0.5
    found = mannwhitneyu(ranks[: len(low)], ranks[len(low) :], alternative="two-sided", method="asymptotic")
    return float(found.pvalue), 1.0 - float(found.statistic) / (len(low) * len(high))


def holm(p: Sequence[float]) -> list[float]:
    """Holm's step-down correction."""
    given = np.asarray(p, dtype=np.float64)
    order = np.argsort(given, kind="stable")
    steps = np.maximum.accumulate(given[order] * np.arange(len(given), 0, -1))
    out = np.empty_like(given)
    out[order] = np.minimum(steps, 1.0)
    return [float(x) for x in out]
