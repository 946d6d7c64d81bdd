"""The incumbent: best path so far, highest lower bound, and budget, which all searches of a plan share."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal.plane.corridor import PinnedTrack
from gcsplan.planners.problem import Problem, Progress, Solution, Step, passes_vias, straight_bound, straight_way_m
from gcsplan.planners.profile.climb_laps import pins_of, with_laps
from gcsplan.planners.profile.exact import LegJudge, Unsettled, settle, way_points
from gcsplan.planners.profile.track import Flown, Obstruction, Track, fly, make_track
from gcsplan.planners.profile.zone_levels import may_pass
from gcsplan.planners.simplify import LAST_GAIN, fewer, polished
from gcsplan.world.geometry.path import Path, track_length_m

STRAIGHTER = 5e-6
"""Part of the cost that removing way points may add to a path during the searches."""
HOPE = 1.5
"""A path is simplified only if it would become the best by gaining this many times the most that simplifying gained for
a path of its kind so far."""
NEARER = 0.45
"""Part of the requested gap down to which cheap searches that mostly help still run, and which a bound tries first."""
HIGHER_M = 0.2
"""Added to the highest altitude of better paths, m."""
STEEP_RISE = 0.15
"""Rise of a path, as a part of its track's length, from which it counts as steep: one cap for the whole track is a
poor measure then, since a zone that is passed low must be flown around, and one that is passed high need not."""


class Incumbent:
    """Best path, bound and budget of one problem; ``sharp``: paths are flown with sharp corners. If not, their corners
    become arcs afterwards: then paths fly no laps if one without laps is known, and leave room for arcs at terrain.
    ``piece``: the problem is a piece of another one, whose first path starts the next budget; this one's does not."""

    def __init__(self, problem: Problem, sharp: bool = True, *, piece: bool = False) -> None:
        self.problem, self.sharp, self.piece = problem, sharp, piece
        self.budget: Budget = problem.budget
        self.rounding = problem.rounding()
        self.most_gap = problem.gap_percent / 100.0
        self.nearer = NEARER * self.most_gap
        self.judge = LegJudge(problem)
        self.best: Floats | None = None
        self.pinned: Bools = np.zeros(0, np.bool_)
        """(N,) which points of the best path are terminals."""
        self.cost = math.inf
        self.bound = straight_bound(problem) * (1.0 - 1e-12)
        self.track_m = straight_way_m(problem) * (1.0 - 1e-12)
        """A lower bound of the track length of every path better than the best."""
        self.first_s = math.inf
        self.proved_infeasible = False
        """Whether it is proved that there is no path."""
        self.steps: list[Step] = []
        self._gained: dict[tuple[bool, bool], float] = {}
        self._simplified: set[tuple[bool, bytes]] = set()
        self.known_m = [problem.start[2], *(v.amsl_m for v in problem.via if v.amsl_m is not None), problem.goal[2]]

    # ------------------------------------------------------------------------------------------------- paths

    def take_along(self, terminals: PinnedTrack, *, fine: bool = True) -> bool:
        """Look for a path over a track; return whether it is the best so far. ``fine``: see `take_simpler`."""
        track = make_track(self.problem, *terminals)
        flown = fly(self.problem, track)
        if not isinstance(flown, Flown) and not may_pass(self.problem, track, flown):
            return False
        found = self.exact(track, flown)
        return not isinstance(found, Unsettled) and self.take_simpler(*found, fine=fine, longer=False)

    def take_longer(self, terminals: PinnedTrack, fine: bool) -> bool:
        """Look for a path over a track, with laps where it is too steep; return whether it is the best so far."""
        track = make_track(self.problem, *terminals)
        flown = fly(self.problem, track)
        if isinstance(flown, Flown) and not isinstance(found := self.exact(track, flown), Unsettled):
            return self.take_simpler(*found, fine=fine, longer=False)
        laps = with_laps(self.problem, *terminals, self.exact)
        taken = [self.take_simpler(*path, fine=fine, longer=True) for path in laps]
        return any(taken)

    def exact(self, track: Track, flown: Flown | Obstruction) -> tuple[Floats, Bools] | Unsettled:
        """Way points over a track that pass the exact check, and which must stay: of the profile ``flown``, or else of
        one that `settle` draws from floors read point by point; or why neither passes."""
        if isinstance(flown, Flown):
            found = way_points(self.problem, track, flown)
            if not self.judge.violations(found[0]):
                return found
        return settle(self.problem, self.judge, track.points, track.pinned, track.pin_m)

    def take_simpler(
        self, points: Floats, pinned: Bools, *, fine: bool, longer: bool, last_gain: float = LAST_GAIN
    ) -> bool:
        """Simplify a path and keep it if it is then the best so far; do nothing if that is unlikely (`HOPE`).

        ``fine``, ``longer``: the kind of path, that is, whether its track is of the fine lattice, and worth being drawn
        tight point by point, and whether the track was made longer. ``last_gain``: see `polished`. Returns
        whether the path was kept.
        """
        self._first()
        cost = self.problem.cost(Path(points))
        hope = self._gained.get((fine, longer), math.inf)
        as_given = fine, points.tobytes()
        if as_given in self._simplified or cost > self.cost * (1.0 + HOPE * hope + STRAIGHTER):
            return False
        self._simplified.add(as_given)
        points, pinned = fewer(self.problem, points, pinned, STRAIGHTER * cost)
        if fine:
            points, pinned = polished(self.problem, points, pinned, last_gain)
        gained = cost / max(self.problem.cost(Path(points)), 1e-9) - 1.0  # a level flight may cost nothing
        self._gained[fine, longer] = max(self._gained.get((fine, longer), 0.0), gained)
        return self.take(points, pinned)

    def take(self, points: Floats, pinned: Bools | None = None) -> bool:
        """Keep a path that passes the exact check if it is the best so far, and return whether it is; ``pinned`` (N,):
        which points are terminals (None: the ones at their places)."""
        cost = self.problem.cost(Path(points))
        if cost >= self.cost or not passes_vias(self.problem, points):
            return False
        self._first()
        self.best, self.cost = points, cost
        self.pinned = pins_of(self.problem, points)[0] if pinned is None else pinned
        self.tell("improve")
        return True

    def take_over(self, other: Incumbent) -> None:
        """Take the path, the bound and the record of another search of the same ends under limits as tight."""
        self.steps += other.steps
        self.bound = max(self.bound, min(other.bound, self.cost))
        if other.best is not None:
            self.take(other.best, other.pinned)
            straighter = fewer(self.problem, other.best, other.pinned, STRAIGHTER * self.cost)
            self.take(*polished(self.problem, *straighter))

    def offer(self, found: tuple[Floats, Bools] | None) -> bool:
        """`take` a path that a search made from legs it checked one by one, if it found one and the path as a whole
        passes the exact check."""
        return found is not None and not self.judge.violations(found[0]) and self.take(*found)

    def _first(self) -> None:
        if self.best is None and math.isinf(self.first_s) and not self.piece:
            self.first_s = self.budget.elapsed_s
            self.budget.found_first()

    # ------------------------------------------------------------------------------------------------- bounds

    def raise_bound(self, cost: float) -> None:
        """Raise the lower bound to ``cost``, in the objective's unit, if that is higher."""
        # The factor covers rounding in the bound's own arithmetic.
        self.bound = max(self.bound, min(cost * (1.0 - 1e-9), self.cost))
        self.tell("bound")

    def prove_infeasible(self) -> None:
        """Note that there is no path."""
        self.proved_infeasible = True

    def raise_track_bound(self, track_m: float) -> None:
        """Raise the lower bound to the least cost of paths whose tracks are at least ``track_m`` metres long. The track
        of every path that is better than the best one must be that long."""
        self.track_m = max(self.track_m, track_m)
        self.raise_bound(self.least(track_m))

    def least(self, track_m: float) -> float:
        """The least cost of a path whose track is at least ``track_m`` metres long."""
        p = self.problem
        if p.rates is not None:
            return p.least_cost(track_m, self.rise(-math.inf))
        # A straight line over the unrolled track: no path over it between the first and last altitude is shorter.
        return math.hypot(track_m, abs(self.known_m[-1] - self.known_m[0]))

    def rise(self, touched_m: float) -> float:
        """The least metres climbed and descended in all by a path that reaches the altitude ``touched_m`` AMSL."""
        least = sum(abs(b - a) for a, b in pairwise(self.known_m))
        return least + 2.0 * max(touched_m - max(self.known_m), 0.0)

    def highest(self, else_m: float) -> float:
        """An upper bound, metres AMSL, of the altitude of every path better than the best, which has only so much
        left to climb; ``else_m`` if none is known."""
        if self.best is None:
            return else_m
        climbed_m = self.problem.most_climbed_m(self.cost, self.track_m)
        spare_m = max(climbed_m - self.rise(-math.inf), 0.0)
        return min(max(self.known_m) + 0.5 * spare_m + HIGHER_M, else_m)

    def longest(self, else_m: float, cost: float | None = None, climbed_m: float = -math.inf) -> float:
        """An upper bound, metres, of the track length of every path cheaper than ``cost`` (None: than the best) that
        climbs and descends at least ``climbed_m`` in all; ``else_m`` if none is known."""
        rates = self.problem.rates
        cost = self.cost if cost is None else cost
        if math.isinf(cost) or (rates is not None and rates[0] == 0.0):
            return else_m
        if rates is not None:
            return (cost - rates[1] * max(self.rise(-math.inf), climbed_m)) / rates[0]
        return cost

    # ------------------------------------------------------------------------------------------------- where it stands

    @property
    def gap(self) -> float:
        """By how much the best path's cost exceeds the bound, as a part of the bound."""
        return (self.cost - self.bound) / max(self.bound, 1e-9)

    def done(self) -> bool:
        """Whether the gap to the reported bound is as small as requested."""
        return self.cost <= self.enough

    @property
    def enough(self) -> float:
        """The greatest cost within the requested gap of the reported bound, which is of paths whose ends may lie beside
        the exact ones."""
        return self.rounding.bound(self.bound) * (1.0 + self.most_gap)

    def goes_on(self) -> bool:
        """Whether the gap is larger than requested, more bound is of use, and budget is left."""
        return not self.done() and not self.needs_terrain and self.budget.goes_on()

    @property
    def needs_terrain(self) -> bool:
        """Whether a path is known, and only paths that leave the surface may still be better; see `Problem.leaving`."""
        return self.best is not None and self.bound > self.problem.leaving * (1.0 + self.most_gap)

    @property
    def is_steep(self) -> bool:
        """Whether the best path rises by at least `STEEP_RISE` of its track's length."""
        if self.best is None:
            return False
        track_m = track_length_m(self.best)
        return float(np.ptp(self.best[:, 2])) >= STEEP_RISE * track_m

    @property
    def climbs(self) -> bool:
        """Whether there is a climb limit."""
        limits = self.problem.limits
        return math.isfinite(limits.max_climb_slope) or math.isfinite(limits.max_descent_slope)

    def tell(self, phase: str, cost: float | None = None) -> None:
        """Report progress with ``cost``, or else with the best path's cost if there is a path."""
        if self.problem.progress is not None:
            known = self.cost if cost is None and self.best is not None else cost
            whole = None if self.best is None or self.piece or cost is not None else Path(self.best)
            self.problem.progress(Progress(self.budget.elapsed_s, known, self.bound, phase, whole))

    def solution(self) -> Solution:
        """The best path, with the way points that are worth their price, and the bound. A requested gap that the path
        meets stays met."""
        assert self.best is not None
        most = self.enough - self.cost if self.done() else math.inf
        self.best, self.pinned = fewer(self.problem, self.best, self.pinned, most)
        self.cost = self.problem.cost(Path(self.best))
        self.tell("done")
        budget = self.budget
        return Solution(
            path=Path(self.best),
            lower_bound=self.bound,
            stopped_by="gap" if self.done() else budget.stopped_by,
            planning_s=budget.elapsed_s,
            first_path_s=self.first_s,
            search=tuple(self.steps),
        )
