"""Many straight lines at once: how high the ground is under each, and which zones each meets.

It does for hundreds of lines to be flown level what `Airspace.tube` does for one track, with the same kernels and the
same margins: never below what `Airspace.examine` demands.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.errors import heed_cancel
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry import hulls
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import runs_m
from gcsplan.world.kernels.entries import pieces
from gcsplan.world.kernels.neighbourhood import LineBatch
from gcsplan.world.kernels.shared import (
    BAND_HIGH,
    BAND_LOW,
    BOW_M,
    CEILING,
    CEILING_AGL,
    EAST,
    FIRST,
    FLOOR,
    FLOOR_AGL,
    LAST,
    NORTH,
    RADIUS,
    TOUCH_M,
)
from gcsplan.world.tube import TUBE_MARGIN_M, ZONE_ROOM_M, Reaches
from gcsplan.world.zone_table import grown_edges

WIDER_REACH = 1.6
GroundPieces = tuple[Indices, Floats, tuple[Floats, Floats, Floats]]
UNUSED = -1e9
"""A reach for which the kernel need not look for anything."""
MOST_GROUND_PIECES = 300_000
"""Most pieces of ground that are looked at under lines together, about; longer pieces stand for more."""
MOST_LEVEL_ROWS = 200_000
"""Most pieces of the lines that are looked at together: the kernel's rows take 11 MB, which a cache holds, so returns
of 240 km are judged in two thirds of the time that all at once take."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """K crossings, each of a line within reach of a zone; all arrays (K,).

    From ``s0_m`` to ``s1_m`` along the line (the hull, if there are several parts) a flight must stay at or below
    ``bottom_m`` or at or above ``top_m`` AMSL; -inf, inf if no flight below or above is possible. Altitude errors
    are included. ``begins``: whether the line begins within reach of the zone.
    """

    line: Indices
    zone: Indices
    s0_m: Floats
    s1_m: Floats
    bottom_m: Floats
    top_m: Floats
    begins: Bools

    def take(self, which: Bools) -> Crossings:
        """The crossings that are True in ``which``."""
        names = ("line", "zone", "s0_m", "s1_m", "bottom_m", "top_m", "begins")
        return Crossings(*(getattr(self, name)[which] for name in names))


@dataclass(frozen=True, eq=False)
class Swept:
    """The regions that N bundles of lines cover; zones are compared with them exactly.

    ``regions`` (N, K, 2): the convex hull of these points; the bundle begins in the hull of the first ``begin``.
    ``extra_m`` (N,): by how much, in metres of the plane, it is wider than the limits' errors make it. If ``inner``
    (N, J, 2) is given, the clearance of the limits is kept from the hull of these points alone, whose first two it
    begins between, and from the rest no more than their errors.
    """

    regions: Floats
    extra_m: Floats
    begin: int = 2
    inner: Floats | None = None

    def near(self, met: Indices, row: Floats, vertex: Floats, demanded: Floats, spared_m: float) -> tuple[Bools, Bools]:
        """For the bundles ``met``: whether each is nearer to a zone than ``demanded`` (M,), and whether its begin is.

        ``spared_m``: the part of it that is clearance.
        """
        spared = 0.0 if self.inner is None else spared_m
        found, begins = (
            _nearer(self.regions[met, :count], row, vertex, demanded - spared - TOUCH_M) for count in (None, self.begin)
        )
        if self.inner is not None:
            found |= _nearer(self.inner[met], row, vertex, demanded - TOUCH_M)
            begins |= _nearer(self.inner[met, :2], row, vertex, demanded - TOUCH_M)
        return found, begins


@dataclass(frozen=True, eq=False)
class LevelLines:
    """The ground and obstacles that N lines meet.

    ``clear_m`` (N,): the lowest AMSL level over the whole line that meets no ground or obstacle within errors and
    clearance; ``legal_m`` (N,): the lowest that also keeps min AGL; both +inf over unknown ground. ``ceiling_m`` (N,):
    the highest level that keeps max AGL. For each piece (P,): its line, the distance along the line of its end nearer
    to the start, and the two floors over it.
    """

    clear_m: Floats
    legal_m: Floats
    ceiling_m: Floats
    crossings: Crossings
    piece_line: Indices
    piece_s_m: Floats
    piece_clear_m: Floats
    piece_legal_m: Floats


def over(
    air: Airspace, starts: Floats, ends: Floats, limits: Limits, wide_m: float = 0.0, swept: Swept | None = None,
    step_m: float = 0.0,
) -> LevelLines:  # fmt: skip
    """The lines from each of ``starts`` (N, 2) straight to its ``ends`` (N, 2), all widened by ``wide_m`` of the plane.

    Errors and clearance of ``limits`` are included; a line of no length stands for its point. ``swept``: the regions
    that the lines represent, which lie within ``wide_m`` of them: zones that do not meet these regions are left out.
    ``step_m``: see `step_of`; 0: pieces as short as the cells of the terrain model.
    """
    starts, ends = (np.ascontiguousarray(a, dtype=np.float64) for a in (starts, ends))
    reach = Reaches.of(limits, air.field, air.scale)
    near, far = reach.near_m + wide_m, reach.far_m + wide_m
    error = limits.altitude_error_m
    margin = reach.near_margin_m if wide_m == step_m == 0.0 else TUBE_MARGIN_M
    n = len(starts)
    clear_m, legal_m, ceiling_m = np.full(n, -np.inf), np.full(n, -np.inf), np.full(n, np.inf)
    found: list[tuple[Indices, Floats, Floats, Floats]] = []
    look = _pieces if step_m == 0.0 else partial(_steps, step_m)
    for first, last in pairwise(batches(air, starts, ends, MOST_LEVEL_ROWS, step_m)):
        heed_cancel()
        line, s0, (below, high, beside) = look(
            air, starts[first:last], ends[first:last],
            (
                near if limits.max_agl_m is not None else UNUSED,
                near,
                far if limits.horizontal_clearance_m > 0.0 else UNUSED,
            ),
            of_top=True,
        )  # fmt: skip
        high += error + margin
        legal = high + limits.min_agl_m
        if limits.horizontal_clearance_m > 0.0:
            beside += error + max(reach.far_margin_m, margin)
            high, legal = np.maximum(high, beside), np.maximum(legal, beside)
        unknown = np.isnan(high) | np.isnan(legal)
        high, legal = np.where(unknown, np.inf, high), np.where(unknown, np.inf, legal)
        line += first
        np.maximum.at(clear_m, line, high)
        np.maximum.at(legal_m, line, legal)
        if limits.max_agl_m is not None:
            low = np.where(unknown, -np.inf, below - (error + margin))
            np.minimum.at(ceiling_m, line, low + limits.max_agl_m)
        found.append((line, s0, high, legal))
    line, s0, high, legal = (np.concatenate(parts) for parts in zip(*found, strict=True))
    clearance_m = limits.horizontal_clearance_m * air.scale
    crossings = _crossings(air, starts, ends, reach, wide_m, limits.over_zone_m, swept, clearance_m, look)
    return LevelLines(clear_m, legal_m, ceiling_m, crossings, line, s0, high, legal)


def step_of(air: Airspace, starts: Floats, ends: Floats) -> float:
    """How long the pieces are, m, in which `over` may look at the ground under these lines; 0: cell by cell.

    Lines with more than `MOST_GROUND_PIECES` cells are looked at by longer pieces, each by the highest and lowest
    ground that may be below any of it: the levels are then higher than they need be, never lower, and the work has a
    limit.
    """
    cells = float(_cells(air, starts, ends).sum())
    return float(np.hypot(*(ends - starts).T).sum()) / MOST_GROUND_PIECES if cells > MOST_GROUND_PIECES else 0.0


def _cells(air: Airspace, starts: Floats, ends: Floats) -> Floats:
    """(N,) about how many pieces each line has, cell by cell."""
    return np.asarray(16.0 + 3.0 * np.hypot(*(ends - starts).T) / min(air.field.step_x, air.field.step_y))


def batches(air: Airspace, starts: Floats, ends: Floats, most: int, step_m: float = 0.0) -> list[int]:
    """The first line of each batch of some ``most`` pieces, and the number of lines.

    Batches begin with an even line: `_pieces` follows every other one backwards.
    """
    count = _cells(air, starts, ends) if step_m == 0.0 else 1.0 + np.hypot(*(ends - starts).T) / step_m
    batch = np.floor(np.cumsum(count) / most)[::2]
    return [0, *(2 * (1 + np.flatnonzero(np.diff(batch)))).tolist(), len(starts)]


def _steps(
    step_m: float, air: Airspace, starts: Floats, ends: Floats, reaches: tuple[float, float, float], *, of_top: bool
) -> GroundPieces:
    """The same as `_pieces` in pieces of ``step_m`` or less: the ground within reach of a piece lies within reach and
    half a piece of its middle."""
    length = np.hypot(*(ends - starts).T)
    counts = np.maximum(np.ceil(length / step_m), 1.0).astype(np.intp)
    line = np.repeat(np.arange(len(counts)), counts)
    nth = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    own_m = length / counts
    places = starts[line] + ((nth + 0.5) / counts[line])[:, None] * (ends - starts)[line]
    lines, bow = LineBatch(starts, ends), 0.0 if air.field.affine else BOW_M + 2.0 * air.field.error_m
    out = []
    for reach, sign, top in zip(reaches, (-1.0, 1.0, 1.0), (False, of_top, of_top), strict=True):
        if reach == UNUSED:
            out.append(np.zeros(len(line)))
            continue
        within = reach + bow + 0.5 * float(own_m.max(initial=0.0))
        held = air.extrema_along(top, _few(within, air), lines)
        out.append(sign * air.around(sign, places, within, held, of_top=top))
    return line, nth * own_m[line], (out[0], out[1], out[2])


def _pieces(
    air: Airspace, starts: Floats, ends: Floats, reaches: tuple[float, float, float], *, of_top: bool
) -> GroundPieces:
    """The line of each piece, the distance along it at which the piece begins, and bounds of the surface there.

    The bounds (P,): the lowest ground within the first reach, the highest top within the second and the third; NaN
    where it is not known; any number for a reach that is `UNUSED`. Both surfaces are the ground unless ``of_top``.
    Every other line is followed backwards, so that one track covers all of them: out, home, out again.
    """
    n = len(starts)
    still = np.hypot(*(ends - starts).T) == 0.0
    if still.any():  # the kernel takes no line of no length: 0.1 mm instead
        ends = np.where(still[:, None], ends + np.array([1e-4, 0.0]), ends)
    track = np.empty((2 * n, 2))
    back = np.arange(n) % 2 == 1
    track[0::2], track[1::2] = np.where(back[:, None], ends, starts), np.where(back[:, None], starts, ends)
    bow = 0.0 if air.field.affine else BOW_M + 2.0 * air.field.error_m
    # Where the third reach is not used, the extrema of the second are there already.
    kinds = zip((False, of_top, of_top), (*reaches[:2], max(reaches[1:])), strict=True)
    lines = LineBatch(track[:-1], track[1:])
    held = [air.extrema_along(top, _few(max(reach, 0.0) + bow, air), lines) for top, reach in kinds]
    surfaces = air.surfaces if of_top else air.grounds
    length = runs_m(track)
    room = 4096 + 16 * n + int(3.0 * float(length.sum()) / min(air.field.step_x, air.field.step_y))
    while True:
        rows = np.empty((room, 7))
        count = pieces(surfaces, *held, track, *reaches, rows)
        if count <= room:
            break
        room = count
    rows = rows[:count]
    after = np.cumsum(length)
    begin = np.concatenate([[0.0], rows[:-1, 0]])
    leg = np.minimum(np.searchsorted(after, 0.5 * (begin + rows[:, 0]), side="right"), 2 * n - 2)
    own = leg % 2 == 0  # the others lead from line to line
    leg, begin, rows = leg[own], begin[own], rows[own]
    line = leg // 2
    base = np.concatenate([[0.0], after])[leg]
    s0 = np.where(back[line], after[leg] - rows[:, 0], begin - base)
    # For two columns, this is ten times faster than ``max(axis=1)``.
    bounds = np.minimum(rows[:, 1], rows[:, 2]), *(np.maximum(rows[:, k], rows[:, k + 1]) for k in (3, 5))
    return line, np.maximum(s0, 0.0), bounds


def _few(reach_m: float, air: Airspace) -> float:
    """A reach that is no less, rounded up to one of few: local extrema are computed once for each."""
    cell = min(air.field.step_x, air.field.step_y)
    if reach_m <= cell:
        return reach_m
    return float(cell * WIDER_REACH ** math.ceil(math.log(reach_m / cell) / math.log(WIDER_REACH)))


def _crossings(
    air: Airspace, starts: Floats, ends: Floats, reach: Reaches, wide_m: float, error_m: float, swept: Swept | None,
    clearance_m: float, look: Callable[..., GroundPieces],
) -> Crossings:  # fmt: skip
    table, vertex = air.zone_table.arrays.table, air.zone_table.arrays.vertex
    step = ends - starts
    length = np.hypot(*step.T)
    unit = np.divide(step, length[:, None], out=np.tile([1.0, 0.0], (len(starts), 1)), where=length[:, None] > 0.0)
    over_ground = air.zone_table.follow_ground
    lines, zones, firsts, lasts, begins = [], [], [], [], []
    low, high = np.minimum(starts, ends).min(axis=0), np.maximum(starts, ends).max(axis=0)
    box_m = *low.tolist(), *high.tolist()
    for k in air.zone_table.within(box_m, reach.far_m + wide_m + ZONE_ROOM_M):
        row = table[k]
        if row[FLOOR_AGL] == row[CEILING_AGL] and not row[FLOOR] < row[CEILING]:
            continue  # the floor is not below the ceiling: nothing is inside
        within = reach.far_m + wide_m + (ZONE_ROOM_M if over_ground[k] else 0.0)
        if row[RADIUS] >= 0.0:
            s0, s1 = _in_circle(row[[EAST, NORTH]] - starts, unit, float(row[RADIUS]) + within, length)
        else:
            s0, s1 = _in_polygon(vertex[int(row[FIRST]) : int(row[LAST])], starts, unit, within, length)
        met = np.flatnonzero(s0 <= s1)
        if swept is None:
            begin = s0[met] <= 0.0
        else:
            demanded = swept.extra_m[met] + (within - wide_m if over_ground[k] else reach.zone_m)
            near_it, begin = swept.near(met, row, vertex, demanded, clearance_m)
            met, begin = met[near_it], begin[near_it]
        lines.append(met)
        begins.append(begin)
        zones.append(np.full(len(met), k))
        firsts.append(s0[met])
        lasts.append(s1[met])
    if not lines:
        nothing, none = np.zeros(0), np.zeros(0, np.intp)
        return Crossings(none, none, nothing, nothing, nothing, nothing, np.zeros(0, np.bool_))
    line, zone = np.concatenate(lines), np.concatenate(zones)
    s0, s1 = np.concatenate(firsts), np.concatenate(lasts)
    bottom, top = table[zone, FLOOR], table[zone, CEILING]
    follow = np.flatnonzero(over_ground[zone])
    if len(follow):
        wide = reach.far_m + wide_m + ZONE_ROOM_M
        a = starts[line[follow]] + s0[follow, None] * unit[line[follow]]
        b = starts[line[follow]] + s1[follow, None] * unit[line[follow]]
        part, _, (below, above, _) = look(air, a, b, (wide, wide, UNUSED), of_top=False)
        low, high = np.full(len(follow), np.inf), np.full(len(follow), -np.inf)
        # Bounds over all the ground under the zone hold too; where ground is unknown, the zone can be neither overflown
        # nor underflown.
        row = table[zone[follow]]
        with np.errstate(invalid="ignore"):
            unknown = np.isnan(below)
            np.minimum.at(low, part, np.where(unknown, -np.inf, below))
            np.maximum.at(high, part, np.where(unknown, np.inf, above))
            known = np.isfinite(low) & np.isfinite(high)
            floor = np.fmax(low + (bottom[follow] - TUBE_MARGIN_M), row[:, BAND_LOW])
            ceiling = np.fmin(high + (top[follow] + TUBE_MARGIN_M), row[:, BAND_HIGH])
        agl = row[:, FLOOR_AGL] != 0.0
        bottom[follow[agl]] = np.where(known, floor, -np.inf)[agl]
        agl = row[:, CEILING_AGL] != 0.0
        top[follow[agl]] = np.where(known, ceiling, np.inf)[agl]
    return Crossings(line, zone, s0, s1, bottom - error_m, top + error_m, np.concatenate(begins))


def _nearer(regions: Floats, row: Floats, vertex: Floats, limit: Floats) -> Bools:
    """Which regions (M, K, 2) are nearer to a zone than their own ``limit`` (M,), m; one that overlaps is at -1 m."""
    if row[RADIUS] >= 0.0:
        return np.asarray(hulls.to_point(regions, row[[EAST, NORTH]]) - float(row[RADIUS]) < limit)
    corners = vertex[int(row[FIRST]) : int(row[LAST])]
    return np.asarray(hulls.to_polygon(regions, corners, np.maximum(limit, 0.0)) < limit)


def _in_circle(away: Floats, unit: Floats, radius: float, length: Floats) -> tuple[Floats, Floats]:
    """First and last place (empty: first > last) of each line from the origin along ``unit`` in a disc at ``away``."""
    middle = (away * unit).sum(axis=1)
    aside = away[:, 1] * unit[:, 0] - away[:, 0] * unit[:, 1]
    half = np.sqrt(np.maximum((radius - np.abs(aside)) * (radius + np.abs(aside)), 0.0))
    s0, s1 = np.maximum(middle - half, 0.0), np.minimum(middle + half, length)
    return np.where(np.abs(aside) < radius, s0, np.inf), np.where(np.abs(aside) < radius, s1, -np.inf)


def _in_polygon(corners: Floats, starts: Floats, unit: Floats, reach: float, length: Floats) -> tuple[Floats, Floats]:
    """The same for a polygon grown by ``reach``: the hull of all parts."""
    at_once = max(hulls.POINTS_AT_ONCE // len(corners), 1)
    if len(starts) > at_once:
        parts = [slice(k, k + at_once) for k in range(0, len(starts), at_once)]
        found = [_in_polygon(corners, starts[s], unit[s], reach, length[s]) for s in parts]
        return np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found])
    away = corners[None] - starts[:, None]
    along = (away * unit[:, None]).sum(axis=-1)
    aside = away[..., 1] * unit[:, None, 0] - away[..., 0] * unit[:, None, 1]
    first, last, crossing = grown_edges(along, aside, reach)
    meets = (last >= 0.0) & (first <= length[:, None])
    s0 = np.where(meets, np.maximum(first, 0.0), np.inf).min(axis=1)
    s1 = np.where(meets, np.minimum(last, length[:, None]), -np.inf).max(axis=1)
    begins = (crossing > 0.0).sum(axis=1) % 2 == 1
    ends = (crossing > length[:, None]).sum(axis=1) % 2 == 1
    s0 = np.where(begins, 0.0, np.where(ends, np.minimum(s0, length), s0))
    s1 = np.where(ends, length, np.where(begins, np.maximum(s1, 0.0), s1))
    return s0, s1
