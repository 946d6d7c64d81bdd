"""Parts of a mission from which the return fails, joined to stretches for messages."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.motion.stretch import Place
from gcsplan.check.returns.footprint import Target
from gcsplan.check.returns.obstacles import AHEAD, GROUND, MAX_AGL, MAX_AMSL, Obstacles
from gcsplan.check.returns.refinement import CLEAR, Refinement
from gcsplan.check.returns.trace import MissionTrace
from gcsplan.check.returns.verdict import UnsafeStretch
from gcsplan.check.returns.words import both
from gcsplan.notes.note import Note
from gcsplan.world.geometry.zones import Zone

ROUND_M = 0.1
LINE_SAMPLES = 500
"""Samples on the line home; messages name the highest of them."""

SHORT_M, MOST_PIECES = 100.0, 12
"""A stretch is cut where its reasons change, into pieces no shorter than this, and no more than this many."""


def rel_home(obstacles: Obstacles, level: float, home_amsl_m: float, returns: Bools | None = None) -> float | None:
    """A level as metres above home, rounded up if the rounded level passes too; None if it is infinite."""
    if math.isinf(level):
        return None
    mine = np.ones(len(obstacles), np.bool_) if returns is None else returns
    rounded = math.ceil((level - home_amsl_m) / ROUND_M - 1e-9) * ROUND_M
    passes = bool(obstacles.passes(home_amsl_m + rounded)[mine].all())
    return round(rounded, 1) if passes else level - home_amsl_m


def stretches_of(
    trace: MissionTrace,
    refinement: Refinement,
    grade: int,
    level: float,
    target: Target | None,
    *,
    but: int | None = None,
) -> tuple[UnsafeStretch, ...]:
    """The stretches that fail ``grade`` at ``level`` but not the grade ``but``, in the order flown.

    ``target``: where the returns lead, needed to locate the obstacle; with None neither the obstacle's place nor an
    altitude is reported.
    """
    bad = refinement.bad(grade, level)
    if but is not None:
        bad &= ~refinement.bad(but, level)
    kinds = _kinds(refinement.strict[grade], level)
    runs = [run for group in _groups(bad) for run in _alike(group, kinds, refinement)]
    found = [_stretch(trace, refinement, grade, level, run, target) for run in runs]
    return without_doubles(found)


def _groups(bad: Bools) -> list[Indices]:
    """Runs of bad parts that follow each other on the trace."""
    where = np.flatnonzero(bad)
    if not len(where):
        return []
    return np.split(where, np.flatnonzero(np.diff(where) > 1) + 1)


def _kinds(obstacles: Obstacles, level: float) -> list[frozenset[int]]:
    """The kinds of obstacles that each return hits at the level."""
    hit = obstacles.hit(level)
    found: list[set[int]] = [set() for _ in range(len(obstacles))]
    for back, kind in zip(obstacles.back[hit].tolist(), obstacles.kind()[hit].tolist(), strict=True):
        found[back].add(kind)
    return [frozenset(one) for one in found]


def _alike(group: Indices, kinds: Sequence[frozenset[int]], refinement: Refinement) -> list[Indices]:
    """A run of parts, cut where the reasons change; of two pieces that differ, one shorter than `SHORT_M` is joined."""
    pieces = [[int(k)] for k in group]
    size = refinement.parts.size

    def reasons(piece: list[int]) -> frozenset[int]:
        return frozenset().union(*(kinds[k] for k in piece))

    joined: list[tuple[frozenset[int], list[int]]] = []
    for piece in pieces:
        mine = reasons(piece)
        if joined and joined[-1][0] == mine:
            joined[-1][1].extend(piece)
        else:
            joined.append((mine, piece))
    while len(joined) > 1:
        lengths = [float(size[piece].sum()) for _, piece in joined]
        k = min(range(len(joined)), key=lengths.__getitem__)
        if lengths[k] >= SHORT_M and len(joined) <= MOST_PIECES:
            break
        beside = [i for i in (k - 1, k + 1) if 0 <= i < len(joined)]
        i = max(beside, key=lambda i: (len(joined[i][0] & joined[k][0]), -lengths[i]))
        a, b = min(i, k), max(i, k)
        joined[a : b + 1] = [(joined[a][0] | joined[b][0], joined[a][1] + joined[b][1])]
    return [np.array(piece) for _, piece in joined]


def _stretch(
    trace: MissionTrace, refinement: Refinement, grade: int, level: float, group: Indices, target: Target | None
) -> UnsafeStretch:
    parts = refinement.parts
    mine = np.zeros(len(parts), np.bool_)
    mine[group] = True
    own = refinement.strict[grade].take(mine)
    home = math.nan if target is None else target.ground_amsl_m
    first, last = int(group[0]), int(group[-1])
    a, b = float(parts.start[first]), float(parts.end[last])
    from_m, to_m = (float(np.interp(u, trace.u, trace.along)) for u in (a, b))
    clauses, zone, obstacle = _reasons(trace, own, parts.middle[group], level, grade, target)
    together = own.together(refinement.start)
    return UnsafeStretch(
        from_seq=int(trace.seq[parts.stretch[first]]),
        to_seq=int(trace.seq[parts.stretch[last]]),
        start=trace.place(a),
        end=trace.place(b),
        from_m=from_m,
        to_m=to_m,
        why=Note("return_fails", does=both(clauses)),
        zone=zone,
        obstacle=obstacle,
        lowest_rel_home_m=None if target is None else rel_home(own, together, home),
        because=_because(trace, own, refinement.start, level) if math.isinf(together) else None,
    )


def _reasons(
    trace: MissionTrace, own: Obstacles, middle: Floats, level: float, grade: int, target: Target | None
) -> tuple[list[Note], str, Place | None]:
    """The faults of a stretch's returns at the level, worst first; the first zone's name; the place of the ground."""
    hit, kind, over = own.hit(level), own.kind(), own.over()
    zones = trace.world.airspace.zones
    clauses: list[tuple[tuple[bool, float], Note]] = []
    obstacle = None
    zone = ""
    for one in np.unique(kind[hit]).tolist():
        rows = np.flatnonzero(hit & (kind == one))
        row = int(rows[np.lexsort((own.top[rows], np.isinf(over[rows])))[-1]])
        place = None
        if one in (GROUND, AHEAD) and target is not None:
            place = _obstacle(trace, float(middle[own.back[row]]), target) if one == GROUND else None
            obstacle = obstacle or place
        if one >= 0:
            zone = zone or zones[one].name
        clauses.append(((math.isinf(over[row]), float(own.top[row])), _why(own, row, zones, grade, place)))
    clauses.sort(key=lambda c: c[0], reverse=True)
    return [does for _, does in clauses], zone, obstacle


def _because(trace: MissionTrace, own: Obstacles, start: float, level: float) -> Note | None:
    """Why no return altitude helps, if that is not among the reasons at the level itself."""
    last = own.last_hit(start)
    if not last.any():
        return Note("needs_differ")
    kind = own.kind()
    known = set(kind[own.hit(level) & np.isinf(own.over())].tolist())
    rows = [int(np.flatnonzero(last & (kind == k))[0]) for k in np.unique(kind[last]).tolist() if k not in known]
    if not rows or known:
        return None
    zones = trace.world.airspace.zones
    return Note("at_another_altitude", does=both([_why(own, row, zones, CLEAR, None) for row in rows]))


def _obstacle(trace: MissionTrace, u: float, target: Target) -> Place | None:
    """The highest ground, with what stands on it, on the straight line from a place on the trace to ``target``."""
    start = trace.points(np.array([u]))[0, :2]
    places = start + np.linspace(0.0, 1.0, LINE_SAMPLES)[:, None] * (target.en - start)
    top = trace.world.airspace.surface.top_at(*places.T)
    if np.isnan(top).all():
        return None
    k = int(np.nanargmax(top))
    lat, lon = trace.world.frame.to_degrees(*places[k]).tolist()
    return lat, lon, float(top[k])


def _why(obstacles: Obstacles, row: int, zones: Sequence[Zone], grade: int, obstacle: Place | None) -> Note:
    """The note on a return that hits an obstacle."""
    what, top, bottom = int(obstacles.what[row]), float(obstacles.top[row]), float(obstacles.bottom[row])
    if what == MAX_AMSL:
        return Note("does_above_ceiling")
    if what == MAX_AGL:
        return Note("does_above_max_agl")
    if what in (GROUND, AHEAD):
        if math.isinf(top):
            return Note("does_over_unknown_ground")
        if what == AHEAD:
            return Note("does_brake_into_ground", top_m=top)
        at = None
        if obstacle is not None:
            lat, lon, amsl = obstacle
            at = Note("at_place", lat=lat, lon=lon, amsl_m=amsl)
        if math.isinf(obstacles.over()[row]):
            return Note(
                "does_meet_ground_on_climb" if grade == CLEAR else "does_near_ground_on_climb", at=at, top_m=top
            )
        return Note("does_meet_ground" if grade == CLEAR else "does_near_ground", at=at, top_m=top)
    height = None
    if math.isinf(top):
        height = Note("zone_without_top") if math.isinf(bottom) else Note("zone_from", bottom_m=bottom)
    if zones[what].outside is not None:
        return Note("does_leave_keep_in", areas=zones[what].title, height=height)
    return Note("does_meet_zone", zone=zones[what].name, height=height)


def without_doubles(found: list[UnsafeStretch]) -> tuple[UnsafeStretch, ...]:
    """Drop stretches within another one: they come from other versions that fly differently between these items."""
    kept = [
        s
        for i, s in enumerate(found)
        if not any(
            t.from_seq <= s.from_seq and s.to_seq <= t.to_seq and t.from_m <= s.from_m and s.to_m <= t.to_m
            for t in found[:i]
        )
    ]
    return tuple(sorted(kept, key=lambda s: (s.from_seq, s.from_m)))
