"""Sections: parallel lines across the legs of a mission, with nodes, and floor and ceiling at each node.

A path's first crossings of the sections are a chain of places, one on each, and the path is no cheaper than the
straight legs of that chain. docs/planner.md, "Sections", has the bound that follows, and its proof.
"""

from __future__ import annotations

import math
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
from gcsplan.planners.optimal.plane.corridor import PinnedTrack
from gcsplan.planners.optimal.plane.leg import Leg
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch
from gcsplan.planners.optimal.plane.section_kernels import lay_sections

INSIDE_M = 0.05
"""Metres by which the circle of places within the track error, and the parts of sections in zones, are smaller."""
ERROR_PLACES = np.array([(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
"""Places within the track error whose ground counts, for a track error of 1."""
NODE_MB = 8e-4
"""Megabytes of a node, with its planes."""


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

    ``first`` (S + 1,): a section's nodes are those from ``first[k]`` to ``first[k + 1]``; sections k and k + 1 are
    ``gap[k]`` metres apart. For each node (N,): its place ``x``, ``y``; metres ``aside`` of the leg; ``low``, ``high``,
    between which all legal altitudes near it lie: where a zone splits these, a place has two nodes or more; straight
    metres from the start through the vias before it (``away``), and to the goal (``left``). Places are ``step_m``
    apart.
    """

    lines: list[Line]
    first: Int64s
    x: Floats
    y: Floats
    aside: Floats
    step_m: float
    low: Floats = field(init=False)
    high: Floats = field(init=False)
    away: Floats = field(init=False)
    left: Floats = field(init=False)
    gap: Floats = field(init=False)

    def rows(self) -> Int64s:
        """The first nodes of all rows of neighbours, and the number of nodes."""
        begins = np.append(np.abs(np.diff(self.aside, prepend=math.inf)) > 1.5 * self.step_m, True)
        begins[self.first] = True
        return np.flatnonzero(begins)

    def track_of(self, chain: Int64s) -> PinnedTrack:
        """A chain of nodes (K,) as a track."""
        terminal = np.repeat([line.leg is None for line in self.lines], np.diff(self.first))[chain]
        fixed = terminal & (self.low[chain] == self.high[chain])
        fixed[[0, -1]] = False
        track = np.stack([self.x[chain], self.y[chain]], axis=-1)
        return track, terminal, np.where(fixed, self.low[chain], math.nan)

    def middles_of(self, chain: Int64s) -> Floats:
        """(K, 3) places of a chain of nodes (K,), midway between floor and ceiling."""
        return np.stack([self.x[chain], self.y[chain], 0.5 * (self.low[chain] + self.high[chain])], axis=-1)

    def spans_of(self, nodes: Bools) -> SectionSpans:
        """The parts of each section that lie between one of the given nodes (N,) and a neighbour."""
        spans: SectionSpans = []
        for line, begin, end in zip(self.lines, self.first[:-1], self.first[1:], strict=True):
            aside = self.aside[begin:end][nodes[begin:end]]
            off = 0.0 if line.leg is None else self.step_m
            spans.append(_joined([(float(a) - off, float(a) + off) for a in aside]))
        return spans


SectionSpans = list[list[tuple[float, float]]]
"""Metres aside, from and to, of the parts of each section that count."""


def lines_of(plane: PlaneSearch, spacing_m: float, halvings: int = 0) -> list[Line]:
    """The sections' lines, at most ``spacing_m`` apart, and between them others by ``halvings``; with the terminals."""
    start = plane.legs[0].start
    lines, begin = [Line(None, *start.place, (0.0, 0.0), 0.0)], 0.0
    for leg in plane.legs:
        (x0, y0), (x1, y1), length = leg.start.place, leg.goal.place, leg.straight_m
        across = (y0 - y1) / length, (x1 - x0) / length
        count = max(math.ceil(length / spacing_m), 1) << halvings
        for t in np.arange(1, count) / count:
            place = x0 + t * (x1 - x0), y0 + t * (y1 - y0)
            lines.append(Line(leg, *place, across, begin + t * length, _chords(leg.plane.shapes, place, across)))
        begin += length
        lines.append(Line(None, x1, y1, (0.0, 0.0), begin))
    return lines


def widest_spans(plane: PlaneSearch, lines: list[Line], most_m: float) -> SectionSpans:
    """How far aside tracks of at most ``most_m`` metres may cross each line: within an ellipse around each leg."""
    straight_m = sum(leg.straight_m for leg in plane.legs)
    spans: SectionSpans = []
    begin = 0.0
    for line in lines:
        wide = 0.0
        if line.leg is None:
            begin = line.along_m
        else:
            half, middle = 0.5 * (most_m - straight_m + line.leg.straight_m), 0.5 * line.leg.straight_m
            flat = 1.0 - ((line.along_m - begin - middle) / half) ** 2
            wide = math.sqrt(max(half * half - middle * middle, 0.0) * max(flat, 0.0))
        spans.append([(-wide, wide)])
    return spans


def spans_within(spans: SectionSpans, widest: SectionSpans) -> SectionSpans:
    """The parts of spans that lie within the widest."""
    return [
        [(max(a, low), min(b, high)) for a, b in parts if a <= high and b >= low]
        for parts, ((low, high),) in zip(spans, widest, strict=True)
    ]


def halved_spans(made: Sections, nodes: Bools, spare_m: float, least_slope: float) -> SectionSpans:
    """`Sections.spans_of`, with a line more between every two sections of a leg, and where a path may cross it first.

    ``spare_m``: how much longer than straight, or than its climb needs, a level path may be from section to section;
    ``least_slope``: of the climb limits.
    """
    spans = made.spans_of(nodes)
    out = [spans[0]]
    for k, gap_m in enumerate(made.gap.tolist()):
        this, other = (
            np.arange(made.first[n], made.first[n + 1])[nodes[made.first[n] : made.first[n + 1]]] for n in (k, k + 1)
        )
        between: list[tuple[float, float]] = []
        if len(this) and len(other):
            rise_m = max(float(made.high[b].max() - made.low[a].min()) for a, b in ((this, other), (other, this)))
            more_m = spare_m * math.hypot(gap_m, rise_m) / gap_m + max(rise_m / least_slope - gap_m, 0.0)
            off_m = 0.5 * math.sqrt((gap_m + more_m) ** 2 - gap_m * gap_m)
            both = [*spans[k], *spans[k + 1]]
            between = [(min(a for a, _ in both) - off_m, max(b for _, b in both) + off_m)]
        out += [between, spans[k + 1]]
    return out


def lay_out(plane: PlaneSearch, lines: list[Line], spans: SectionSpans, step_m: float) -> Sections | None:
    """The nodes over spans of the lines, ``step_m`` apart; None if there is unknown ground among them."""
    places = [_places(line, parts, step_m) for line, parts in zip(lines, spans, strict=True)]
    sizes = np.array([len(part) for part in places])
    aside = np.concatenate(places)
    middle = np.repeat(np.array([(line.east_m, line.north_m) for line in lines]), sizes, axis=0)
    across = np.repeat(np.array([line.across for line in lines]), sizes, axis=0)
    x, y = np.ascontiguousarray((middle + aside[:, None] * across).T)
    first = np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes, dtype=np.int64)])
    made = Sections(lines, first, x, y, aside, step_m)
    if not _lay_heights(plane, made) or not _split_by_zones(plane, made):
        return None
    _lay_distances(plane, made)
    return made


def _places(line: Line, parts: list[tuple[float, float]], step_m: float) -> Floats:
    """Metres aside of the nodes of a line: all parts lie between two neighbours."""
    if line.leg is None or not parts:
        return np.zeros(len(parts))
    begin = math.floor(parts[0][0] / step_m)
    aside = np.arange(begin, max(math.ceil(parts[-1][1] / step_m), begin + 1) + 1) * step_m
    near = np.any([(aside > a - step_m) & (aside < b + step_m) for a, b in parts], axis=0)
    return np.asarray(aside[near], np.float64)


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
    over = made.rows(), row, col, beside
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
    made.gap = np.diff([line.along_m for line in made.lines])
    made.left = sums[-1] - sums[leg + 1] + np.hypot(made.x - ends[leg + 1, 0], made.y - ends[leg + 1, 1])


def _split_by_zones(plane: PlaneSearch, made: Sections) -> bool:
    """Split nodes where a zone forbids altitudes all the way from one neighbour to the other, and drop nodes without
    any altitude. Returns False if ground that a zone's level follows is not known."""
    follow = any(levels[3] or levels[4] for line in made.lines for levels in line.chords)
    lowest = highest = np.zeros(len(made.x))
    if follow:
        surface, here = plane.problem.airspace.surface, np.zeros((1, 2))
        col, row = np.ascontiguousarray(surface.grid(made.x, made.y).T)
        lowest, highest = np.empty(len(made.x)), np.empty(len(made.x))
        for sign, out in ((1.0, lowest), (-1.0, highest)):
            if not lay_sections(surface.ground_m, sign, 0.0, -math.inf, made.rows(), row, col, here, out):
                return False
        highest *= -1.0
    nodes, lows, highs, far_m = [], [], [], made.step_m + INSIDE_M
    for line, begin, end in zip(made.lines, made.first[:-1].tolist(), made.first[1:].tolist(), strict=True):
        at, low, high = np.arange(begin, end), made.low[begin:end], made.high[begin:end]
        for (_, bottom, top, bottom_agl, top_agl, thin), parts in line.chords.items():
            for a, b in parts:
                floor_m = bottom + (highest[at] if bottom_agl else 0.0)
                ceiling_m = top + (lowest[at] if top_agl else 0.0)
                inside = (made.aside[at] >= a + far_m) & (made.aside[at] <= b - far_m)
                cut = inside & (ceiling_m > floor_m + thin) & (floor_m < high) & (ceiling_m > low)
                if cut.any():
                    below, above = cut & (low <= floor_m), cut & (ceiling_m <= high)
                    kept = np.concatenate([np.flatnonzero(part) for part in (~cut, below, above)])
                    floor_m, ceiling_m = (np.broadcast_to(v, at.shape) for v in (floor_m, ceiling_m))
                    split = np.cumsum([(~cut).sum(), below.sum()])
                    at, low, high = at[kept], low[kept].copy(), high[kept].copy()
                    high[split[0] : split[1]] = floor_m[below]
                    low[split[1] :] = ceiling_m[above]
        some = np.flatnonzero(low <= high)
        some = some[np.argsort(at[some], kind="stable")]
        nodes.append(at[some])
        lows.append(low[some])
        highs.append(high[some])
    made.first = np.cumsum([0, *(len(part) for part in nodes)], dtype=np.int64)
    node = np.concatenate(nodes)
    made.x, made.y, made.aside = made.x[node], made.y[node], made.aside[node]
    made.low, made.high = np.concatenate(lows), np.concatenate(highs)
    return True


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
