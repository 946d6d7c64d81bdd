"""Sections: parallel lines across the legs of a mission, with nodes, and floor and ceiling at each node.

A path's first crossings of the sections are a chain of places, one on each, and the path is no cheaper than the
straight legs of that chain. docs/planner.md, "Sections", has the bound that follows, and its proof.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from gcsplan.arrays import Bools, Floats, Int64s
from gcsplan.planners.optimal.navmesh.zone_kernels import (
    BOTTOM,
    BOTTOM_AGL,
    FIRST,
    LOOKS,
    PAIR,
    THIN,
    TOP,
    TOP_AGL,
)
from gcsplan.planners.optimal.navmesh.zone_shapes import LOOSE, Shapes
from gcsplan.planners.optimal.plane.leg import Leg
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch
from gcsplan.planners.optimal.plane.section_kernels import lay_sections

INSIDE_M = 0.05
"""Metres by which the circle of places within the track error, and the parts of sections in zones, are smaller."""
ERROR_PLACES = np.array([(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
"""Places within the track error whose ground counts, for a track error of 1."""
NODE_MB = 3e-4
"""Megabytes of a node."""


ChordZone = tuple[int, float, float, float, float, float]
"""A zone's number and levels: bottom and top, whether each is above ground, and the thickness at which it is none."""
Chords = dict[ChordZone, list[tuple[float, float]]]
"""The parts of a line, metres aside, in each zone; they do not touch."""


@dataclass(frozen=True, eq=False, slots=True)
class Line:
    """A section's line: the leg that it crosses (None: a terminal, a single place), its middle, its direction, straight
    metres along the legs up to it, and its parts in zones."""

    leg: Leg | None
    east_m: float
    north_m: float
    across: tuple[float, float]
    along_m: float
    chords: Chords = field(default_factory=dict)


@dataclass(eq=False, slots=True)
class Sections:
    """The nodes of all sections from start to goal, terminals included.

    ``first`` (S + 1,): a section's nodes are those from ``first[k]`` to ``first[k + 1]``. For each node (N,): its place
    ``x``, ``y``; metres ``aside`` of the leg; ``low``, ``high``, between which and those of its neighbours straight
    lines leave all legal altitudes; ``shut``: no legal place is nearer to it than its neighbours; ``loose``: the most
    by which ``low`` or ``high`` differ from a neighbour's; straight metres from the start through the vias before it
    (``away``), and to the goal (``left``). Nodes are ``step_m`` apart; tracks are at most ``most_m`` long.
    """

    lines: list[Line]
    first: Int64s
    x: Floats
    y: Floats
    aside: Floats
    step_m: float
    most_m: float
    low: Floats = field(init=False)
    high: Floats = field(init=False)
    shut: Bools = field(init=False)
    loose: Floats = field(init=False)
    away: Floats = field(init=False)
    left: Floats = field(init=False)

    @property
    def beside(self) -> Bools:
        """(N - 1,) whether a node and the next one are of one section."""
        same = np.ones(len(self.x) - 1, np.bool_)
        same[self.first[1:-1] - 1] = False
        return same

    def widest(self, values: Floats) -> Floats:
        """(N,) the most by which a value differs from that of a neighbour in the section."""
        off = np.where(self.beside, np.abs(np.diff(values)), 0.0)
        return np.asarray(np.maximum(np.append(off, 0.0), np.append(0.0, off)))

    def touched(self, nodes: Bools) -> Bools:
        """(N,) the given nodes (N,) and their neighbours in the section: a place is between two nodes."""
        same, out = self.beside, nodes.copy()
        out[:-1] |= nodes[1:] & same
        out[1:] |= nodes[:-1] & same
        return out

    def nearest(self, aside_m: Floats) -> Int64s:
        """(S,) the nodes nearest to places ``aside_m`` (S,) of the legs."""
        first, last = self.first[:-1], self.first[1:] - 1
        off = np.rint((aside_m - self.aside[first]) / self.step_m).astype(np.int64)
        return np.asarray(np.clip(first + off, first, last))


SectionSpans = list[tuple[float, float]]
"""Metres aside, least and greatest, that each section spans."""


def lines_of(plane: PlaneSearch, spacing_m: float) -> list[Line]:
    """The sections' lines, at most ``spacing_m`` apart, with the terminals between."""
    start = plane.legs[0].start
    lines, begin = [Line(None, *start.place, (0.0, 0.0), 0.0)], 0.0
    for leg in plane.legs:
        (x0, y0), (x1, y1), length = leg.start.place, leg.goal.place, leg.straight_m
        across = (y0 - y1) / length, (x1 - x0) / length
        count = max(math.ceil(length / spacing_m), 1)
        for t in np.arange(1, count) / count:
            place = x0 + t * (x1 - x0), y0 + t * (y1 - y0)
            lines.append(Line(leg, *place, across, begin + t * length, _chords(leg.plane.shapes, place, across)))
        begin += length
        lines.append(Line(None, x1, y1, (0.0, 0.0), begin))
    return lines


def widest_spans(plane: PlaneSearch, lines: list[Line], most_m: float) -> SectionSpans:
    """How far aside tracks of at most ``most_m`` metres may cross each line: within an ellipse around each leg."""
    straight_m = sum(leg.straight_m for leg in plane.legs)
    spans, begin = [], 0.0
    for line in lines:
        wide = 0.0
        if line.leg is None:
            begin = line.along_m
        else:
            half, middle = 0.5 * (most_m - straight_m + line.leg.straight_m), 0.5 * line.leg.straight_m
            flat = 1.0 - ((line.along_m - begin - middle) / half) ** 2
            wide = math.sqrt(max(half * half - middle * middle, 0.0) * max(flat, 0.0))
        spans.append((-wide, wide))
    return spans


def lay_out(
    plane: PlaneSearch, lines: list[Line], spans: SectionSpans, step_m: float, most_m: float
) -> Sections | None:
    """The nodes over spans of the lines, ``step_m`` apart; None if there is unknown ground among them."""
    counts = [
        (0, 0) if line.leg is None else (math.floor(a / step_m), math.ceil(b / step_m))
        for line, (a, b) in zip(lines, spans, strict=True)
    ]
    sizes = np.array([b - a + 1 for a, b in counts])
    aside = np.concatenate([np.arange(a, b + 1) for a, b in counts]) * step_m
    middle = np.repeat(np.array([(line.east_m, line.north_m) for line in lines]), sizes, axis=0)
    across = np.repeat(np.array([line.across for line in lines]), sizes, axis=0)
    x, y = np.ascontiguousarray((middle + aside[:, None] * across).T)
    first = np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes, dtype=np.int64)])
    made = Sections(lines, first, x, y, aside, step_m, most_m + 4.0 * step_m)
    if not _lay_heights(plane, made):
        return None
    _lay_distances(plane, made)
    made.shut = ~made.touched(made.low <= made.high)
    for part, over, below in _in_zones(plane, made):
        made.shut[part] |= over & below
    made.loose = np.maximum(made.widest(made.low), made.widest(made.high))
    return made


def _lay_heights(plane: PlaneSearch, made: Sections) -> bool:
    """Set floors and ceilings. The ends' and vias' own altitudes are both; free altitudes have both as elsewhere."""
    problem, limits = plane.problem, plane.problem.bound_limits
    surface = problem.airspace.surface
    col, row = np.ascontiguousarray(surface.grid(made.x, made.y).T)
    # Metres of a cell change away from the start, so the places are nearer by as much.
    far_m = float(np.hypot(made.x - problem.start[0], made.y - problem.start[1]).max())
    radius_m = (limits.track_error_m - surface.grid.error_m) * (1.0 - problem.airspace.field.bend * far_m) - INSIDE_M
    places = radius_m * ERROR_PLACES if radius_m > 0.0 else ERROR_PLACES[:1]
    beside = np.ascontiguousarray((places @ surface.grid.jacobian(*problem.start[:2]).T)[:, ::-1])
    made.low, made.high = np.empty(len(made.x)), np.full(len(made.x), plane.top_m + _spare_m(plane))
    up, down = heights_above_ground(plane)
    over = made.first, row, col, beside
    if not lay_sections(surface.top_m, 1.0, down, -math.inf, *over, made.low):
        return False
    if math.isfinite(up):
        if not lay_sections(surface.ground_m, -1.0, -up, up - made.high[0], *over, made.high):
            return False
        made.high *= -1.0
    places_of = [k for k, line in enumerate(made.lines) if line.leg is None]
    for k, end in zip(places_of, [plane.legs[0].start, *(leg.goal for leg in plane.legs)], strict=True):
        if end.amsl_m is not None:
            made.low[made.first[k]] = made.high[made.first[k]] = end.amsl_m
    return True


def _spare_m(plane: PlaneSearch) -> float:
    return LOOSE.spare_m + plane.problem.bound_spare_m


def heights_above_ground(plane: PlaneSearch) -> tuple[float, float]:
    """The greatest height above ground that bounds allow (inf: there is no limit), and the least."""
    limits, spare_m = plane.problem.bound_limits, _spare_m(plane)
    most = math.inf if limits.max_agl_m is None else limits.max_agl_m - limits.altitude_error_m + spare_m
    return most, limits.min_agl_m + limits.altitude_error_m - spare_m


def _lay_distances(plane: PlaneSearch, made: Sections) -> None:
    """Set straight metres from the start and to the goal, through the vias between."""
    ends = np.array([plane.legs[0].start.place, *(leg.goal.place for leg in plane.legs)])
    sums = np.concatenate([[0.0], np.cumsum([leg.straight_m for leg in plane.legs])])
    terminal = np.array([line.leg is None for line in made.lines])
    leg = np.repeat(np.maximum(np.cumsum(terminal) - terminal, 1) - 1, np.diff(made.first))
    made.away = sums[leg] + np.hypot(made.x - ends[leg, 0], made.y - ends[leg, 1])
    made.left = sums[-1] - sums[leg + 1] + np.hypot(made.x - ends[leg + 1, 0], made.y - ends[leg + 1, 1])


def _in_zones(plane: PlaneSearch, made: Sections) -> Iterator[tuple[slice, Bools | bool, Bools | bool]]:
    """Nodes between two neighbours in one zone; and whether it reaches above their ceilings, and below their floors."""
    up, down = heights_above_ground(plane)
    for k, line in enumerate(made.lines):
        begin, end = int(made.first[k]), int(made.first[k + 1])
        if line.leg is None or end - begin < 3:
            continue
        for (_, bottom, top, bottom_agl, top_agl, thin), parts in line.chords.items():
            if not (math.isinf(top) or math.isinf(bottom) or (bottom_agl == top_agl and top - bottom > thin)):
                continue
            for a, b in parts:
                m = math.ceil((a + INSIDE_M - made.aside[begin]) / made.step_m) + 1
                n = math.floor((b - INSIDE_M - made.aside[begin]) / made.step_m)
                first, last = begin + max(m, 1), begin + min(n, end - begin - 1)
                if first < last:
                    low, high = (v[first - 1 : last + 1] for v in (made.low, made.high))
                    highest = np.maximum(np.maximum(high[:-2], high[1:-1]), high[2:])
                    lowest = np.minimum(np.minimum(low[:-2], low[1:-1]), low[2:])
                    over = top >= up if top_agl else top >= highest
                    below = bottom <= down if bottom_agl else bottom <= lowest
                    yield slice(first, last), over, below


def _chords(shapes: Shapes, place: tuple[float, float], across: tuple[float, float]) -> Chords:
    """The parts in zones of the line through a place in the direction ``across``."""
    zones, forms = shapes.low
    if not len(zones):
        return {}
    first = zones[:, FIRST].astype(np.intp)
    low, high = _in_forms(forms, place, across)
    low, high = np.maximum.reduceat(low, first), np.minimum.reduceat(high, first)
    met = np.flatnonzero((low < high) & (zones[:, PAIR] == 0.0) & (zones[:, LOOKS] == 0.0))
    found: Chords = {}
    for k, levels in zip(met.tolist(), zones[met][:, [BOTTOM, TOP, BOTTOM_AGL, TOP_AGL, THIN]].tolist(), strict=True):
        found.setdefault((int(shapes.owner[k, 0]), *levels), []).append((float(low[k]), float(high[k])))
    return {levels: _joined(parts) for levels, parts in found.items()}


def _in_forms(forms: Floats, place: tuple[float, float], across: tuple[float, float]) -> tuple[Floats, Floats]:
    """(E,) the least and the greatest metres aside of a line within each disc and half-plane (`zone_shapes.Shapes`);
    inf and -inf where it meets none."""
    size, x, y, disc = forms.T
    dx, dy = x - place[0], y - place[1]
    middle = dx * across[0] + dy * across[1]
    square = size * np.abs(size) - (dx * dx + dy * dy - middle * middle)
    half = np.sqrt(np.maximum(square, 0.0))
    depth, slope = size - x * place[0] - y * place[1], x * across[0] + y * across[1]
    along = np.abs(slope) < 1e-12
    end = depth / np.where(along, 1.0, slope)
    inside = np.where(disc > 0.0, square > 0.0, ~along | (depth > 0.0))
    low = np.where(disc > 0.0, middle - half, np.where(along | (slope > 0.0), -np.inf, end))
    high = np.where(disc > 0.0, middle + half, np.where(along | (slope < 0.0), np.inf, end))
    return np.where(inside, low, np.inf), np.where(inside, high, -np.inf)


def _joined(parts: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The union of intervals."""
    out: list[tuple[float, float]] = []
    for a, b in sorted(parts):
        if out and a <= out[-1][1]:
            out[-1] = out[-1][0], max(out[-1][1], b)
        else:
            out.append((a, b))
    return out


def crossings(plane: PlaneSearch, lines: list[Line], points: Floats) -> Floats:
    """(S,) metres aside of the legs at which a path (N, 3) first crosses each line; 0 at terminals."""
    out, at = np.zeros(len(lines)), 0
    for leg in plane.legs:
        a, b = np.array(leg.start.place), np.array(leg.goal.place)
        ahead = (b - a) / leg.straight_m
        last = at + int(np.argmin(np.hypot(*(points[at:, :2] - b).T)))
        off = points[at : last + 1, :2] - a
        own = [k for k, line in enumerate(lines) if line.leg is leg]
        if own and len(off) > 1:
            along, aside = off @ ahead, off @ [-ahead[1], ahead[0]]
            where = np.array([(lines[k].east_m, lines[k].north_m) for k in own]) - a
            where = np.minimum(where @ ahead, along.max())
            after = np.maximum(np.searchsorted(np.maximum.accumulate(along), where), 1)
            part = (where - along[after - 1]) / np.maximum(along[after] - along[after - 1], 1e-9)
            out[own] = aside[after - 1] + np.clip(part, 0.0, 1.0) * (aside[after] - aside[after - 1])
        at = last
    return out
