"""A bound for worlds whose zones can be passed over: around each of them, or over it with all of the climb.

Every path passes around all zones, or over some. The cases are split one zone at a time: around it, the track is
longer; over it, the path rises to its top, crosses it, and descends (`crossing`). A case is closed when the way that
its bound belongs to meets no other zone below its top. The bound of all paths is the bound of the lowest case.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass, field
from itertools import count, pairwise

import numpy as np
import shapely

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.navmesh.crossing import Climb, Crossing, crossing
from gcsplan.planners.optimal.navmesh.outlines import ZoneOutline
from gcsplan.planners.optimal.navmesh.portals import Exhausted
from gcsplan.planners.optimal.plane.corridor import joined
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.plane.outline_tracks import OutlineTracks
from gcsplan.planners.problem import Problem
from gcsplan.world.geometry.path import distances_m, track_length_m

MOST_CASES = 48
"""Most cases that are looked at."""
CROSSING_ROUNDS = 6
"""Most times that one crossing is computed again, with arcs drawn more finely or more zones beside it."""
SHORT_TRACK_COST_M = 10.0
"""Cost of each metre by which a track is too short for its climb, m: then it is made longer without laps."""
LOWER_M = 0.01
"""A way is too low over a zone if it is more than this below its top, m."""


@dataclass(order=True, slots=True)
class _Case:
    """Paths that pass around the zones ``shut`` and over the zones ``over``: their least cost, and the ways of all legs
    (N, 3) that cost as much."""

    least: float
    number: int
    shut: Bools = field(compare=False)
    over: frozenset[int] = field(compare=False)
    ways: list[Floats] = field(compare=False)


@dataclass(frozen=True, slots=True)
class _Stretch:
    """The legs ``first`` to ``last`` (without the last) between two known altitudes, with tracks of ``lengths_m``."""

    first: int
    last: int
    from_m: float
    to_m: float
    lengths_m: list[float]

    @property
    def least_m(self) -> float:
        """The least length of paths over such tracks."""
        return math.hypot(sum(self.lengths_m), self.to_m - self.from_m)

    def climbs(self, leg: int, top_m: float, problem: Problem, *, outer: bool) -> tuple[Climb, Climb]:
        """The climb to an altitude on one of the legs, and the descent from it; ``outer``: for paths, without laps."""
        limits, off_m = problem.bound_limits, -problem.rounding_m[1]
        if outer:
            off_m = problem.limits.altitude_error_m - limits.altitude_error_m + LOWER_M
            limits = problem.limits
        rises_m = (max(top_m - z + off_m, 0.0) for z in (self.from_m, self.to_m))
        beyond_m = sum(self.lengths_m[: leg - self.first]), sum(self.lengths_m[leg - self.first + 1 :])
        slopes = limits.max_climb_slope, limits.max_descent_slope
        up, down = (
            Climb(rise, rise * math.hypot(1.0, 1.0 / slope) if rise > 0.0 else 0.0, more, SHORT_TRACK_COST_M * outer)
            for rise, slope, more in zip(rises_m, slopes, beyond_m, strict=True)
        )
        return up, down

    def ways(self, tracks: list[Floats], over: tuple[int, Crossing, float] | None = None) -> list[Floats]:
        """The ways (N, 3) of the legs over the ``tracks`` of all legs, with altitudes that change evenly; ``over``: a
        leg, its crossing, and the altitude there."""
        parts, at_m, z_m = tracks[self.first : self.last], [0.0], [self.from_m]
        if over is not None:
            leg, found, top_m = over
            parts[leg - self.first] = np.concatenate([found.before, found.after])
            begin_m = sum(map(track_length_m, parts[: leg - self.first]))
            at_m += [
                begin_m + track_length_m(found.before),
                begin_m + track_length_m(parts[leg - self.first]) - track_length_m(found.after),
            ]
            z_m += [max(top_m, self.from_m), max(top_m, self.to_m)]
        at_m, z_m = [*at_m, sum(map(track_length_m, parts))], [*z_m, self.to_m]
        begins_m = np.concatenate([[0.0], np.cumsum([track_length_m(part) for part in parts])])
        return [
            np.column_stack([part, np.interp(begin + distances_m(part), at_m, z_m)])
            for part, begin in zip(parts, begins_m.tolist(), strict=False)
        ]


class Overflight:
    """The bound of one problem with the outlines of its zones; ``outer``: the same for paths."""

    def __init__(self, incumbent: Incumbent, outlines: OutlineTracks, outer: bool = False) -> None:
        self.incumbent, self.problem, self.outlines, self.outer = incumbent, incumbent.problem, outlines, outer
        self._ends_m = [self.problem.start[2], *(z for _, _, z in outlines.legs)]
        self._number = count()
        self._crossings: dict[tuple[object, ...], tuple[Crossing, float]] = {}
        """Crossings by leg, shapes and climbs, with the limit they were computed for."""

    def look(self) -> None:
        """Raise the bound to the least cost of a path that is better than the best; then look for a path past the same
        zones as the way of that bound, if it leads over one. Raises Exhausted."""
        incumbent, outlines = self.incumbent, self.outlines
        around = self._cases(outlines.walls() | (outlines.over & ~outlines.under), frozenset())
        if around and around[0].least <= incumbent.bound:
            return  # a path around all zones is one of the cases, so no case raises the bound
        case = self._lowest()
        incumbent.raise_bound(incumbent.cost if case is None else case.least)
        if case is not None and case.over:
            paths = Overflight(incumbent, outlines, outer=True)._cases(case.shut, case.over)
            for ways in [case.ways, *(found.ways for found in paths)]:
                incumbent.take_along(joined([w[:, :2] for w in ways], [z for _, _, z in outlines.legs[:-1]]))

    def _lowest(self) -> _Case | None:
        """The case whose paths cost least; None if no path is better than the best. Raises Exhausted."""
        incumbent = self.incumbent
        cases = self._cases(self.outlines.walls(), frozenset())
        looked = 0
        while cases and cases[0].least < incumbent.cost:
            zone = self._too_low(cases[0])
            looked += 1
            if zone is None or looked > MOST_CASES or not incumbent.budget.goes_on():
                return cases[0]
            case = heapq.heappop(cases)
            around = case.shut.copy()
            around[zone] = True
            for new in (*self._cases(around, case.over), *self._cases(case.shut, case.over | {zone})):
                new.least = max(new.least, case.least)
                heapq.heappush(cases, new)
        return None

    def _too_low(self, case: _Case) -> int | None:
        """The zone below whose top a case's way is deepest, out of the zones that may be passed over or around; None if
        there is none."""
        outlines, way = self.outlines, np.concatenate(case.ways)
        line, along_m = shapely.LineString(way[:, :2]), distances_m(way)
        deepest_m, found = LOWER_M, None
        for k in np.flatnonzero(outlines.over & ~outlines.under & ~case.shut).tolist():
            inside = line.intersection(self._outline(k).shape) if k not in case.over else shapely.LineString()
            if shapely.length(inside) > 0.0:
                at_m = shapely.line_locate_point(line, shapely.points(shapely.get_coordinates(inside)))
                lacks_m = float(outlines.tops_m[k] - np.interp(at_m, along_m, way[:, 2]).min())
                if lacks_m > deepest_m:
                    deepest_m, found = lacks_m, k
        return found

    def _cases(self, shut: Bools, over: frozenset[int]) -> list[_Case]:
        """The case with such zones; nothing if no path of it is better than the best."""
        tracks = self.outlines.tracks(shut, outer=self.outer)
        if tracks is None:
            return []
        p, incumbent = self.problem, self.incumbent
        lengths_m = [track_length_m(t) * (1.0 - 1e-9) for t in tracks]
        if p.rates is not None:
            top_m = max((float(self.outlines.tops_m[k]) for k in over), default=-math.inf)
            least = p.least_cost(sum(lengths_m), incumbent.rise(top_m))
            level_m = max(top_m, *incumbent.known_m)
            ways = [np.column_stack([t, np.full(len(t), level_m)]) for t in tracks]
            return [_Case(least, next(self._number), shut, over, ways)]
        known = [k for k, z in enumerate(self._ends_m) if z is not None]
        ends_m = [z for z in self._ends_m if z is not None]
        stretches = [
            _Stretch(i, j, *z, lengths_m[i:j]) for (i, j), z in zip(pairwise(known), pairwise(ends_m), strict=True)
        ]
        ways = [way for s in stretches for way in s.ways(tracks)]
        least = max(incumbent.least(sum(lengths_m)), sum(s.least_m for s in stretches))
        case = _Case(least, next(self._number), shut, over, ways)
        for k in over:
            least, ways = self._over(k, shut, stretches, tracks)
            if least >= incumbent.cost:
                return []
            if least > case.least:
                case.least, case.ways = least, ways
        return [case]

    def _over(self, k: int, shut: Bools, stretches: list[_Stretch], tracks: list[Floats]) -> tuple[float, list[Floats]]:
        """The least length of paths over a zone and around the zones ``shut``, at most the best path's length, and ways
        of this length, as far as they are known. ``tracks``: the shortest tracks of all legs."""
        top_m, shape = float(self.outlines.tops_m[k]), self._outline(k).shape
        around = [way for s in stretches for way in s.ways(tracks)]
        all_m = sum(s.least_m for s in stretches)
        choices = []
        for stretch in stretches:
            for leg in range(stretch.first, stretch.last):
                up, down = self._climbs(stretch, leg, top_m)
                away_m, left_m = shapely.distance(shape, shapely.points(self.outlines.legs[leg][:2]))
                least_m = max(float(up.least_m(away_m) + down.least_m(left_m)), stretch.least_m)
                choices.append((all_m - stretch.least_m + least_m, leg, stretch))
        best = self.incumbent.cost, around
        for least, leg, stretch in sorted(choices, key=lambda choice: choice[:2]):
            if least >= best[0]:
                break
            others_m = all_m - stretch.least_m
            found = self._crossing(k, leg, shut, self._climbs(stretch, leg, top_m), best[0] - others_m)
            if found is None:
                best = least, around
            elif others_m + found.length_m < best[0]:
                over = stretch.ways(tracks, (leg, found, top_m)) if len(found.before) else stretch.ways(tracks)
                best = others_m + found.length_m, [*around[: stretch.first], *over, *around[stretch.last :]]
        return best

    def _outline(self, k: int) -> ZoneOutline:
        return self.outlines.outline(k, outer=self.outer)

    def _climbs(self, stretch: _Stretch, leg: int, top_m: float) -> tuple[Climb, Climb]:
        return stretch.climbs(leg, top_m, self.problem, outer=self.outer)

    def _crossing(self, k: int, leg: int, shut: Bools, climbs: tuple[Climb, Climb], limit_m: float) -> Crossing | None:
        """The crossing of a leg over a zone and around the zones that are ``shut`` and that its way meets; None if
        nothing is known, as for a leg that begins or ends over the zone."""
        outlines = self.outlines
        a, b, _ = outlines.legs[leg]
        beside: set[int] = set()
        found = None
        for _ in range(CROSSING_ROUNDS):
            known = [self._outline(j) for j in (k, *sorted(beside))]
            shapes = tuple(o.shape for o in known)
            if shapely.intersects_xy(shapes, *np.transpose([a, b])[:, :, None]).any():
                break
            new, until_m = self._crossings.get((leg, shapes, climbs), (None, 0.0))
            if new is None or until_m <= new.length_m < limit_m:
                try:
                    new = crossing(a, b, shapes[0], shapes[1:], *climbs, limit_m, self.problem.budget)
                except Exhausted:
                    break
                self._crossings[leg, shapes, climbs] = new, limit_m
            found = new
            if found.length_m >= limit_m or not len(found.before):
                break
            ways = shapely.LineString(found.before), shapely.LineString(found.after)
            finer = [o.refine(np.concatenate([found.before, found.after])) for o in known]
            met = {
                j for j in np.flatnonzero(shut).tolist()
                if j != k and j not in beside
                and any(shapely.relate_pattern(self._outline(j).shape, way, "T********") for way in ways)
            }  # fmt: skip
            beside |= met
            if not any(finer) and not met:
                break
        return found
