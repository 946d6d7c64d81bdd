"""Paths below altitude caps, and the bound of all of them; see `planner`."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.lattice.planner import straight_bound
from gcsplan.planners.optimal.cap_search import above_all
from gcsplan.planners.optimal.corridor import End
from gcsplan.planners.optimal.leg import Leg
from gcsplan.planners.optimal.sources.detours import Choice, Search, Stops, joined
from gcsplan.planners.problem import Problem, Progress, Solution, terminals
from gcsplan.planners.profile.climb_laps import with_laps
from gcsplan.planners.profile.exact import Judge, Unsettled, settle
from gcsplan.planners.profile.track import Flown, Obstruction, Track, fly, make_track
from gcsplan.planners.profile.waypoints import way_points
from gcsplan.planners.simplify import fewer, polished
from gcsplan.world.path import Path

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SLACKS = (0.008, 0.15, 0.6)
"""How much longer than the shortest the tracks are that are looked at, as a part of it, until a path is known."""
LITTLE, WORTH = 5e-6, 2e-5
"""What fewer way points may cost, as a part: on the way, and at last."""
HOPE = 1.5
"""A path is made simpler if it would be the best so far by gaining that times what one of its kind has gained yet."""
ZONES_SHUT = 8
"""Tracks that are looked at below a cap where a zone can be passed neither over nor under on the first."""
PAST = 12
"""Tracks past what is in the way that are looked at."""
STEEP = 0.5
"""What part of the gap climbing up and down again must be before lower caps are tried for length, too."""
FAR = 5e-3
"""Gap, as a part, beyond which other ways to find a path are asked for a better one, too."""
DARED_M, PINCHED_M = (0.05, 0.1, 0.2, 0.4), 1.0
"""By how much more than it lacked the nodes beside a track through a slit are raised, one after the other, and what it
may lack for another to be looked for."""
SMALL = 50.0
"""A world is small where the straight ways from stop to stop are so many cells of the terrain model long, at most."""


class Below:
    """One problem, its legs in the plane, the best path and bound yet; ``laps``: seek some where a path is known."""

    def __init__(self, problem: Problem, begun_s: float, laps: bool = True) -> None:
        self.problem, self.begun_s, self.laps = problem, begun_s, laps
        self.wanted = problem.gap_percent / 100.0
        self.judge = Judge(problem)
        self.best: Floats | None = None
        self.pinned: Bools | None = None
        self.cost = math.inf
        self.bound = straight_bound(problem)
        self.first_s = math.inf
        self._gained: dict[tuple[bool, bool], float] = {}
        self._simplified: set[tuple[bool, bytes]] = set()
        self.unsettled: Unsettled | None = None
        """Why the last track that was looked at closely holds no path."""
        self.proved_shut = False
        self.by_storeys = False
        """Whether bounds ask where tracks can get to by what they climb and descend on their way."""
        self.timed_out = self.in_space = self.searched = False
        self.may_spend = 1.0
        """What part of the time may be spent by now."""
        limits = problem.limits
        top_m = limits.max_amsl_m
        self.top_m = above_all(problem) if top_m is None else top_m - limits.altitude_error_m
        stops = terminals(problem)
        heights = [problem.start[2], *(v.amsl_m for v in problem.via), problem.goal[2]]
        ends = [End(*place, z) for place, z in zip(stops, heights, strict=True)]
        self.legs = [Leg(problem, a, b, self.top_m) for a, b in pairwise(ends) if math.dist(a.place, b.place) > 1e-3]
        self.known_m = [z for z in heights if z is not None]
        zones = len(problem.airspace.zones)
        self._open = Choice(np.ones(zones, np.bool_), np.ones(zones, np.bool_))
        self.choice = self._open
        """With what shut the last tracks were found that had to go past something."""

    def tell(self, phase: str, cost: float | None = None) -> None:
        """Report progress."""
        if self.problem.progress is not None:
            known = self.cost if cost is None and self.best is not None else cost
            self.problem.progress(Progress(time.perf_counter() - self.begun_s, known, self.bound, phase))

    def look(self, slacks: tuple[float, ...] = SLACKS, dares: tuple[bool, ...] = (False, True)) -> None:
        """Flood the legs, and find the first path, over a track that is so much longer than the shortest at most.

        ``dares``: how `dare` looks for one where there is no other.
        """
        for slack in slacks:
            for leg in self.legs:
                leg.flood(slack)
                if math.isinf(leg.length_m):
                    self.proved_shut = True
                    return
            self._raise_tracks()
            # Ways that the first look misses are short, or there are no others.
            patient = slack in (slacks[0], slacks[-1])
            if self.try_below(self.top_m, fine=False) or (patient and self.try_below(self.top_m, fine=True)):
                return
            if self.past(PAST, fine=False, first=True):
                return
        for closely in dares:
            if self.dare(closely=closely):
                return

    def try_below(self, cap_m: float, *, fine: bool) -> bool:
        """Look for a path below a cap; True if it is the best so far."""
        self.unsettled = None
        stops = self.stops(self.choice, cap_m, fine)
        if stops is None:
            return False
        track = make_track(self.problem, *stops)
        flown = fly(self.problem, track)
        if isinstance(flown, Flown) or flown.kind == "pinched":  # by centimetres, or tracks would not lead there
            found = self._exact(track, flown)
            if found is not None or isinstance(flown, Flown):
                return found is not None and self.take_simpler(*found, fine=fine, longer=False)
        past = flown.kind == "zone" or self.best is None
        return past and self.past(ZONES_SHUT, fine=fine, cap_m=cap_m, given=stops)

    def dare(self, *, closely: bool = False) -> bool:
        """Look for a path through what is open for the exact check alone: a lattice keeps as much beside its tracks as
        the ground may rise there. ``closely``: along the way of the bound, in cells as small as can be. True if it is
        the best so far."""
        limits = self.problem.limits
        if max(limits.track_error_m, limits.horizontal_clearance_m) <= 0.0:
            return False
        shut: list[tuple[Floats, float]] = []
        for leg in self.legs:
            leg.exact, leg.closely, leg.shut = True, closely, shut
        found = False
        for more_m in DARED_M:
            found = self.try_below(self.top_m, fine=True)
            lacks = self.unsettled
            if found or lacks is None or lacks.kind != "pinched" or not lacks.by < PINCHED_M or not self.in_time():
                break
            shut.append((lacks.place, lacks.by + more_m))
        for leg in self.legs:
            leg.exact = leg.closely = False
        return found

    def stops(self, choice: Choice, cap_m: float, fine: bool) -> Stops | None:
        """The shortest track of a choice below a cap, from stop to stop; see `Leg.track`."""
        ways = []
        for leg in self.legs:
            limit = self.limit(leg)
            wanted = leg.corridor(limit) if fine and leg.has_fine else None
            way = leg.track(cap_m - choice.lower_m, wanted, limit, choice.under, choice.most_m, choice.over)
            if way is None:
                return None
            ways.append(way.points)
        return joined(ways, [leg.goal.amsl_m for leg in self.legs[:-1]])

    def past(
        self, most: int, *, fine: bool, first: bool = False, cap_m: float | None = None, given: Stops | None = None
    ) -> bool:
        """Look for tracks past what is in the way, at ``most`` of them; True if a path over one is the best so far.

        ``cap_m``: below that cap, the first, which needs no laps where a path is known, from a ``given`` track on;
        else, ``first``, the first, or the best, with metres to spare for laps near the ends.
        """
        laps = self.climbs() and (self.best is None or (self.laps and cap_m is None))
        spare_m = self.longest() - sum(leg.length_m for leg in self.legs) if laps else 0.0
        search = Search(self, self.top_m if cap_m is None else cap_m, fine)
        roots = [self.choice]
        if cap_m is None:
            roots = [replace(c, most_m=(spare_m, spare_m)) for c in dict.fromkeys([self._open, self.choice])]
            if laps:
                roots.append(self.choice)  # a climb far from the ends takes laps there, and none near them
        found = search.run(roots, most, first=first or cap_m is not None, laps=laps, given=given)
        if found is not None:
            self.choice = replace(found, least_m=(0.0, 0.0), most_m=(0.0, 0.0))
        return found is not None

    def take_along(self, stops: Stops) -> bool:
        """Look for a path over a track; True if it is the best so far."""
        track = make_track(self.problem, *stops)
        flown = fly(self.problem, track)
        if not isinstance(flown, Flown) and flown.kind != "pinched":
            return False
        found = self._exact(track, flown)
        return found is not None and self.take_simpler(*found, fine=True, longer=False)

    def take_longer(self, stops: Stops, fine: bool) -> bool:
        """Look for a path over a track, with laps where it is too steep; True if it is the best so far."""
        track = make_track(self.problem, *stops)
        flown = fly(self.problem, track)
        if isinstance(flown, Flown) and (found := self._exact(track, flown)) is not None:
            return self.take_simpler(*found, fine=fine, longer=False)
        found = with_laps(self.problem, *stops, self._exact)
        return found is not None and self.take_simpler(*found, fine=fine, longer=True)

    def goes_on(self) -> bool:
        """Whether a better path is wanted, and there is time, which a first one is worth in any case."""
        return self.best is None or (not self.done() and self.in_time())

    def take_simpler(self, points: Floats, pinned: Bools, *, fine: bool, longer: bool) -> bool:
        """Make a path simpler and keep it, if it is the best so far; not where there is no hope of that.

        ``fine``, ``longer``: its kind, whether its track is of the fine lattice, and whether it was made longer.
        """
        if self.best is None:  # what follows makes it better; it could be flown now
            self.first_s = time.perf_counter() - self.begun_s
        cost = self.problem.cost(Path(points))
        hope = self._gained.get((fine, longer), math.inf)
        as_given = fine, points.tobytes()
        if as_given in self._simplified or cost > self.cost * (1.0 + HOPE * hope + LITTLE):
            return False
        self._simplified.add(as_given)
        points, pinned = fewer(self.problem, points, pinned, LITTLE * cost)
        if fine:
            points, pinned = polished(self.problem, points, pinned)
        gained = cost / max(self.problem.cost(Path(points)), 1e-9) - 1.0  # a level flight may cost nothing
        self._gained[fine, longer] = max(self._gained.get((fine, longer), 0.0), gained)
        return self.take(points, pinned)

    def _exact(self, track: Track, flown: Flown | Obstruction) -> tuple[Floats, Bools] | None:
        """Way points over a track that the exact check passes: of this profile, or of one drawn with more care."""
        if isinstance(flown, Flown):
            found = way_points(self.problem, track, flown)
            if not self.judge.violations(found[0]):
                return found
        careful = settle(self.problem, self.judge, track.points, track.pinned, track.pin_m)
        self.unsettled = careful if isinstance(careful, Unsettled) else None
        return None if isinstance(careful, Unsettled) else careful

    def search_space(self) -> bool:
        """Look for a path that is no cap's, where the best one climbs much; True if that is the best so far."""
        p, best = self.problem, self.best
        if best is None or self.gap <= FAR or not self.in_time() or (p.objective == "length" and not self.is_steep()):
            return False
        from gcsplan.planners.optimal.sources.roadmap_3d import is_steep, steep_path  # few worlds are as high as wide

        self.in_space = is_steep(p, best)
        found = steep_path(p, best, self.in_time) if self.in_space else None
        return found is not None and not self.judge.violations(found[0]) and self.take(*found)

    @property
    def is_small(self) -> bool:
        """Whether every leg is so short that a search among few places costs little beside all else."""
        cell_m = float(self.problem.airspace.surface.grid.metres_per_cell(*self.problem.start[:2]).max())
        short = [leg for leg in self.legs if leg.straight_m <= SMALL * cell_m]
        return len(short) == len(self.problem.via) + 1  # legs from a place to itself are not among the legs

    def search_small(self, wanted: float = FAR) -> bool:
        """Look for a path between few places, in small worlds where the best is farther than ``wanted`` (a part) from
        the bound; True if that is the best so far."""
        missing = self.best is None
        enough = not missing and (self.done() or self.gap <= wanted or not self.in_time())
        if self.searched or enough or not self.is_small:
            return False
        from gcsplan.planners.optimal.sources.local_roadmap import small_path  # most missions are longer

        self.searched = True
        # A first path is worth more than the time it takes.
        found = small_path(self.problem, self.best, (lambda: True) if missing else self.in_time)
        return found is not None and not self.judge.violations(found[0]) and self.take(*found)

    def take(self, points: Floats, pinned: Bools | None = None) -> bool:
        """Keep a path if it is the best so far; ``pinned`` (N,) its stops."""
        cost = self.problem.cost(Path(points))
        if cost >= self.cost:
            return False
        if self.best is None:
            self.first_s = min(self.first_s, time.perf_counter() - self.begun_s)
        self.best, self.cost, self.pinned = points, cost, pinned
        self.tell("improve")
        return True

    def is_steep(self) -> bool:
        """Whether what the best path climbs is more than half of what it lacks: a longer track may climb less."""
        assert self.best is not None
        track_m = float(np.hypot(*np.diff(self.best[:, :2], axis=0).T).sum())
        return self.cost - math.hypot(track_m, self.rise(-math.inf)) > STEEP * (self.cost - self.bound)

    def climbs(self) -> bool:
        """Whether there is a climb limit."""
        limits = self.problem.limits
        return math.isfinite(limits.max_climb_slope) or math.isfinite(limits.max_descent_slope)

    def longest(self) -> float:
        """No track of a path that is better than the best is longer."""
        p = self.problem
        free = p.objective == "energy" and p.horizontal_j_per_m == 0.0
        if self.best is None or free:
            return sum(leg.reach_m for leg in self.legs)
        if p.objective == "energy":
            return (self.cost - p.vertical_j_per_m * self.rise(-math.inf)) / p.horizontal_j_per_m
        return self.cost

    def limit(self, leg: Leg) -> float:
        """The same for one leg, the others as short as they can be."""
        return self.longest() - sum(other.length_m for other in self.legs if other is not leg)

    def rise(self, touched_m: float) -> float:
        """Metres climbed and descended in all, at least, by a path that touches a height."""
        least = sum(abs(b - a) for a, b in pairwise(self.known_m))
        return least + 2.0 * max(touched_m - max(self.known_m), 0.0)

    def bound_of_tracks(self) -> float:
        """The bound of tracks alone, for regimes in which paths are found elsewhere; inf: there is none, proved."""
        for leg in self.legs:
            leg.flood(SLACKS[0])
        if any(math.isinf(leg.length_m) for leg in self.legs):
            return math.inf
        self._raise_tracks()
        return self.bound

    def _raise_tracks(self) -> None:
        """What the shortest tracks alone tell of the cost."""
        self.raise_bound(self.least(sum(leg.length_m for leg in self.legs)))

    def least(self, track_m: float) -> float:
        """What a path costs at least whose track is so long."""
        p = self.problem
        if p.objective == "energy":
            return p.horizontal_j_per_m * track_m + p.vertical_j_per_m * self.rise(-math.inf)
        return track_m

    def raise_bound(self, cost: float) -> None:
        """A new bound, in metres or joules by the objective."""
        # The bound's own arithmetic is rounded.
        self.bound = max(self.bound, min(cost * (1.0 - 1e-9), self.cost))
        self.tell("bound")

    @property
    def gap(self) -> float:
        """How far the best path is above the bound, as a part of it."""
        return (self.cost - self.bound) / max(self.bound, 1e-9)

    def done(self) -> bool:
        return self.gap <= self.wanted

    def in_time(self) -> bool:
        """Whether there is time left, of the part of it that may be spent by now."""
        if time.perf_counter() - self.begun_s > self.may_spend * self.problem.budget_s:
            self.timed_out = True  # what comes later may be in time again, but something was left out
            return False
        return True

    def solution(self) -> Solution:
        """The best path, with as few way points as are worth it, and the bound."""
        assert self.best is not None
        if self.pinned is not None:
            self.best, self.pinned = fewer(self.problem, self.best, self.pinned, WORTH * self.cost)
            self.cost = self.problem.cost(Path(self.best))
        self.tell("done")
        return Solution(
            path=Path(self.best),
            lower_bound=self.bound,
            stopped_by="gap" if self.done() else "time" if self.timed_out else "exhausted",
            planning_s=time.perf_counter() - self.begun_s,
            first_path_s=self.first_s,
        )
