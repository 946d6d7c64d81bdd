"""Parts of a mission from which the return fails, joined to stretches for messages."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Bools, Indices
from gcsplan.check.rtl.obstacles import GROUND, MAX_AGL, MAX_AMSL, Obstacles
from gcsplan.check.rtl.refinement import CLEAR, Refinement
from gcsplan.check.rtl.sweep import Target
from gcsplan.check.rtl.trace import MissionTrace
from gcsplan.check.rtl.verdict import UnsafeStretch
from gcsplan.check.stretch import Place
from gcsplan.units import Quantity, UnitText

ROUND_M = 0.1
LOOKED_AT = 500
"""Samples on the line home; messages name the highest of them."""


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
    """The stretches that fail ``grade`` at ``level``, in the order flown, without those that fail the grade ``but``.

    ``target``: where the returns lead, needed to locate the obstacle; with None neither the obstacle's place nor an
    altitude is reported.
    """
    bad = refinement.bad(grade, level)
    if but is not None:
        bad &= ~refinement.bad(but, level)
    found = [_stretch(trace, refinement, grade, level, group, target) for group in _groups(refinement, bad)]
    return _without_doubles(found)


def _groups(refinement: Refinement, bad: Bools) -> list[Indices]:
    """Runs of bad parts that follow each other on the trace."""
    where = np.flatnonzero(bad)
    if not len(where):
        return []
    return np.split(where, np.flatnonzero(np.diff(where) > 1) + 1)


def _stretch(
    trace: MissionTrace, refinement: Refinement, grade: int, level: float, group: Indices, target: Target | None
) -> UnsafeStretch:
    obstacles, parts = refinement.strict[grade], refinement.parts
    mine = np.zeros(len(obstacles), np.bool_)
    mine[group] = True
    own = obstacles.take(mine)
    home = math.nan if target is None else target.ground_amsl_m
    each = own.lowest(refinement.start)
    k = int(each.argmax())
    row = own.worst(k, level)
    assert row is not None
    first, last = int(group[0]), int(group[-1])
    a, b = float(parts.start[first]), float(parts.end[last])
    from_m, to_m = (float(np.interp(u, trace.u, trace.along)) for u in (a, b))
    zone = int(own.what[row])
    name = trace.world.airspace.zones[zone].name if zone >= 0 else ""
    obstacle = None
    if target is not None and zone == GROUND and math.isfinite(own.top[row]):
        obstacle = _obstacle(trace, float(parts.middle[group[k]]), target)
    return UnsafeStretch(
        from_seq=int(trace.seq[parts.stretch[first]]),
        to_seq=int(trace.seq[parts.stretch[last]]),
        start=trace.place(a),
        end=trace.place(b),
        from_m=from_m,
        to_m=to_m,
        why=_why(own, row, name, grade, obstacle),
        zone=name,
        obstacle=obstacle,
        lowest_rel_home_m=None if target is None else rel_home(own, own.together(refinement.start), home),
    )


def _obstacle(trace: MissionTrace, u: float, target: Target) -> Place | None:
    """The highest ground, with what stands on it, on the straight line from a place on the trace to ``target``."""
    start = trace.points(np.array([u]))[0, :2]
    places = start + np.linspace(0.0, 1.0, LOOKED_AT)[:, None] * (target.en - start)
    top = trace.world.airspace.surface.top_at(*places.T)
    if np.isnan(top).all():
        return None
    k = int(np.nanargmax(top))
    lat, lon = trace.world.frame.to_degrees(*places[k]).tolist()
    return lat, lon, float(top[k])


def _why(obstacles: Obstacles, row: int, name: str, grade: int, obstacle: Place | None) -> str:
    what, top, bottom = int(obstacles.what[row]), float(obstacles.top[row]), float(obstacles.bottom[row])
    if what == MAX_AMSL:
        return "the return rises above max_amsl_m"
    if what == MAX_AGL:
        return "the return comes higher above ground than max_agl_m"
    if what == GROUND:
        if math.isinf(top):
            return "the ground on the way home is unknown to the terrain model"
        place: str = ""
        if obstacle is not None:
            place = UnitText(" at {:.6f}, {:.6f} ({})", *obstacle[:2], Quantity(obstacle[2], "amsl", 0))
        meets = (
            "meets ground{} and would clear"
            if grade == CLEAR
            else "comes nearer than min_agl_m to ground{} and would keep"
        )
        return UnitText(f"the return {meets} it at {{}}", place, Quantity(top, "amsl", 0, "up"))
    height: str = ""
    if math.isinf(top):
        height = " (no top)" if math.isinf(bottom) else UnitText(" (from {} up)", Quantity(bottom, "amsl", 0))
    return UnitText("the return meets no-fly zone “{}”{} or its clearance", name, height)


def _without_doubles(found: list[UnsafeStretch]) -> tuple[UnsafeStretch, ...]:
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
