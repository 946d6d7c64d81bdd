"""Parts of a mission from which the return fails, joined to stretches that a person can read."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcsplan.check.rtl.rules import Target
from gcsplan.check.rtl.study import CLEAR, Study
from gcsplan.check.rtl.trail import Trail
from gcsplan.check.rtl.verdict import UnsafeStretch
from gcsplan.check.rtl.walls import GROUND, MAX_AGL, MAX_AMSL, Walls
from gcsplan.check.stretch import Place

Ints = NDArray[np.intp]
ROUND_M = 0.1
LOOKED_AT = 500
"""Points on a way home, of which the highest is named; for words alone."""


def rel_home(walls: Walls, level: float, home_amsl_m: float, returns: NDArray[np.bool_] | None = None) -> float | None:
    """A level as metres above home, rounded up where the rounded one passes too; None for none."""
    if math.isinf(level):
        return None
    mine = np.ones(len(walls), np.bool_) if returns is None else returns
    rounded = math.ceil((level - home_amsl_m) / ROUND_M - 1e-9) * ROUND_M
    passes = bool(walls.passes(home_amsl_m + rounded)[mine].all())
    return round(rounded, 1) if passes else level - home_amsl_m


def stretches_of(
    trail: Trail, study: Study, grade: int, level: float, target: Target | None, *, but: int | None = None
) -> tuple[UnsafeStretch, ...]:
    """What fails ``grade`` at ``level``, in the order flown; not what fails the grade ``but`` already.

    ``target``: where they lead, for the place of the obstacle; None: no place and no altitude is told.
    """
    bad = study.bad(grade, level)
    if but is not None:
        bad &= ~study.bad(but, level)
    found = [_stretch(trail, study, grade, level, group, target) for group in _groups(study, bad)]
    return _without_doubles(found)


def _groups(study: Study, bad: NDArray[np.bool_]) -> list[Ints]:
    """Runs of bad parts, one after the other on the trail."""
    where = np.flatnonzero(bad)
    if not len(where):
        return []
    return np.split(where, np.flatnonzero(np.diff(where) > 1) + 1)


def _stretch(trail: Trail, study: Study, grade: int, level: float, group: Ints, target: Target | None) -> UnsafeStretch:
    walls, cuts = study.strict[grade], study.cuts
    mine = np.zeros(len(walls), np.bool_)
    mine[group] = True
    own = walls.take(mine)
    home = math.nan if target is None else target.ground_amsl_m
    each = own.lowest(study.start)
    k = int(each.argmax())
    row = own.worst(k, level)
    assert row is not None
    first, last = int(group[0]), int(group[-1])
    a, b = float(cuts.start[first]), float(cuts.end[last])
    from_m, to_m = (float(np.interp(u, trail.u, trail.along)) for u in (a, b))
    zone = int(own.what[row])
    name = trail.world.airspace.zones[zone].name if zone >= 0 else ""
    obstacle = None
    if target is not None and zone == GROUND and math.isfinite(own.top[row]):
        obstacle = _obstacle(trail, float(cuts.middle[group[k]]), target)
    return UnsafeStretch(
        from_seq=int(trail.seq[cuts.stretch[first]]),
        to_seq=int(trail.seq[cuts.stretch[last]]),
        start=trail.place(a),
        end=trail.place(b),
        from_m=from_m,
        to_m=to_m,
        why=_why(own, row, name, grade, obstacle),
        zone=name,
        obstacle=obstacle,
        lowest_rel_home_m=None if target is None else rel_home(own, own.together(study.start), home),
    )


def _obstacle(trail: Trail, u: float, target: Target) -> Place | None:
    """The highest ground, obstacles on it included, straight on the way from a place on the trail."""
    start = trail.points(np.array([u]))[0, :2]
    places = start + np.linspace(0.0, 1.0, LOOKED_AT)[:, None] * (target.en - start)
    top = trail.world.airspace.surface.top_at(*places.T)
    if np.isnan(top).all():
        return None
    k = int(np.nanargmax(top))
    lat, lon = trail.world.frame.to_degrees(*places[k]).tolist()
    return lat, lon, float(top[k])


def _why(walls: Walls, row: int, name: str, grade: int, obstacle: Place | None) -> str:
    what, top, bottom = int(walls.what[row]), float(walls.top[row]), float(walls.bottom[row])
    if what == MAX_AMSL:
        return "the return rises above max_amsl_m"
    if what == MAX_AGL:
        return "the return comes higher above ground than max_agl_m"
    if what == GROUND:
        if math.isinf(top):
            return "the ground on the way home is unknown to the terrain model"
        place = "" if obstacle is None else f" at {obstacle[0]:.6f}, {obstacle[1]:.6f} ({obstacle[2]:.0f} m AMSL)"
        if grade == CLEAR:
            return f"the way home meets ground{place}: {top:.0f} m AMSL would clear it"
        return f"the way home comes nearer to the ground than min_agl_m{place}: {top:.0f} m AMSL would keep it"
    height = ""
    if math.isinf(top):
        height = ", which has no top" if math.isinf(bottom) else f", which begins at {bottom:.0f} m AMSL"
    return f"the way home meets no-fly zone “{name}” or its clearance{height}"


def _without_doubles(found: list[UnsafeStretch]) -> tuple[UnsafeStretch, ...]:
    """Stretches that lie within another one are left out: other versions fly another way between the same items."""
    kept = [
        s
        for i, s in enumerate(found)
        if not any(
            t.from_seq <= s.from_seq and s.to_seq <= t.to_seq and t.from_m <= s.from_m and s.to_m <= t.to_m
            for t in found[:i]
        )
    ]
    return tuple(sorted(kept, key=lambda s: (s.from_seq, s.from_m)))
