"""Tracks past obstacles that they can pass neither over nor under, nor climb over in time: around them, or with laps.

The mesh of a plane decides for each cell alone whether there is an altitude at which to pass it. A track through it may
still have no profile: if it enters a zone below its floor and leaves it above its ceiling, or if the climb limit binds
far from the ends. Two changes help. Sides of zones (under, over) are shut, which gives another track; or laps make the
track longer, so that it can climb more. The length of the laps is chosen before the track: walls near the ends stand
because no path can have climbed over them yet, so with spare metres for laps there they are lower.

So a node of the search is a choice of open zone sides and a range of spare metres. No path of it is shorter than its
shortest track for the most spare metres, plus the least spare metres in laps. The node with the lowest bound of the
cost is searched first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from heapq import heappop, heappush

import numpy as np

from gcsplan.arrays import Bools
from gcsplan.planners.optimal.plane.corridor import PinnedTrack, SideChoice, Spare
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.exact import sampled_track
from gcsplan.planners.profile.track import Closed, Lacking, lacking
from gcsplan.world.geometry.path import distances_m

LACKING_M, HAIR_M = 3.0, 0.2
"""If a track lacks less than `LACKING_M` between floor and ceiling, cells may be more lenient than the exact check,
mostly beside terrain with a horizontal clearance: the search repeats under a cap lowered by the missing height and
`HAIR_M`."""
MOST_PUSHED = 100_000
"""Most choices that one search weighs."""
TAKEN = 5
"""Most tracks over which paths are looked for."""
MORE = 1.1
"""A track that takes more than this many times the spare metres near the ends in laps takes its laps elsewhere."""
LEAST_GAIN = 1e-4
"""Part of the cost below which a gain is not worth a search."""
NARROW = 0.04
"""Ranges of spare metres are not split if they cost less than this part of the difference between path and bound."""


_Open = tuple[float, int, float, SideChoice, Lacking | None, PinnedTrack | None]
"""The least cost of a path of a choice (the key), a running number, the least length of its track, the choice; what the
track lacks, if known; and the track itself, if a path over it is to be looked for."""


@dataclass(frozen=True, eq=False, slots=True)
class DetourSearch:
    """A best-first search for tracks past obstacles; paths go to the ``incumbent``. ``terminals``: returns the shortest
    track of a choice with its most spare metres, through all terminals; ``fine``: whether that is on a fine lattice."""

    incumbent: Incumbent
    terminals: Callable[[SideChoice], PinnedTrack | None]
    fine: bool

    def run(  # noqa: C901, PLR0912 - one best-first search, whose cases share its state
        self, roots: list[SideChoice], most: int, *, first: bool, laps: bool, given: PinnedTrack | None = None
    ) -> SideChoice | None:
        """Try at most ``most`` tracks; return the choice with which the best path was found, None if none was better.

        ``first``: stop at the first path that is better than the best known; ``laps``: whether it may have laps;
        ``roots``: the choices to begin with; ``given``: the track of the first of them, if it is known.
        """
        open_set: list[_Open] = []
        best: SideChoice | None = None
        known: dict[bytes, Lacking | Closed] = {}
        flat: set[tuple[bytes, bytes, Lacking]] = set()
        done: set[tuple[bytes, bytes, Spare, float]] = set()
        looked = taken = pushed = 0
        hoped = self.incumbent.cost

        def push(
            length_m: float, choice: SideChoice, found: Lacking | None = None, over: PinnedTrack | None = None
        ) -> None:
            nonlocal pushed
            pushed += 1
            key = self.incumbent.least(length_m + 0.5 * (sum(choice.least_m) + sum(choice.most_m)))
            if over is not None and found is not None:
                key = found.cost if found.cost > self.incumbent.bound * (1.0 + self.incumbent.most_gap) else 0.0
            heappush(open_set, (key, pushed, length_m, choice, found, over))

        for root in roots:
            push(0.0, root)
        while open_set and taken < TAKEN and pushed < MOST_PUSHED and self.incumbent.goes_on():
            key, _, length_m, choice, found, over = heappop(open_set)
            if over is not None:
                if key < self.incumbent.cost:
                    taken += 1
                    if self.incumbent.take_longer(over, self.fine):
                        best = choice
                        if first:
                            return best
                continue
            if looked >= most or not self._may_help(length_m, choice):
                continue
            sides = choice.under.tobytes(), choice.over.tobytes()
            if found is not None:
                if (*sides, found) not in flat:
                    self._split(length_m, choice, found, hoped, push)
                continue
            case = *sides, choice.most_m, choice.lower_m
            if case in done:
                continue
            done.add(case)
            looked += 1
            known_terminals = given if choice is roots[0] else None
            terminals = known_terminals or self.terminals(choice)
            if terminals is None:
                continue
            length_m = float(distances_m(terminals[0])[-1])
            if not self._may_help(length_m, choice):
                continue
            name = terminals[0].tobytes()
            seen = name in known
            if not seen:
                known[name] = lacking(self.incumbent.problem, sampled_track(self.incumbent.problem, *terminals))
            lack = known[name]
            if isinstance(lack, Closed):
                if not seen and lack.by < LACKING_M:
                    push(length_m, replace(choice, lower_m=choice.lower_m + lack.by + HAIR_M))
                self._closed(length_m, choice, lack.zones, push)
                continue
            if not seen and (laps or not lack.steep):
                push(length_m, replace(choice, most_m=_needed(self.incumbent.problem, choice, lack)), lack, terminals)
                hoped = min(hoped, lack.cost)
            self._closed(length_m, choice, lack.zones, push)
            if lack.laps_m > MORE * sum(choice.most_m):
                flat.add((*sides, lack))  # more spare metres give the same track
            else:
                self._split(length_m, replace(choice, tried=choice.tried.union(lack.zones)), lack, hoped, push)
        return best

    def _may_help(self, length_m: float, choice: SideChoice) -> bool:
        """Whether a choice whose track is at least ``length_m`` long may hold a path that is better by more than a
        little."""
        cost = self.incumbent.cost
        little = min(NARROW * (cost - self.incumbent.bound), LEAST_GAIN * cost) if math.isfinite(cost) else 0.0
        return self.incumbent.least(length_m + sum(choice.least_m)) < cost - little

    def _closed(self, length_m: float, choice: SideChoice, zones: tuple[int, ...], push: Callable[..., None]) -> None:
        """Push, for each of the ``zones`` and each of its open sides, the choice with that side shut."""
        for zone in zones:
            levels, more = self.incumbent.problem.airspace.zones[zone], replace(choice, tried=frozenset())
            if zone not in choice.tried and levels.floor is not None and choice.under[zone]:
                push(length_m, replace(more, under=_without(choice.under, zone)))
            if zone not in choice.tried and levels.ceiling is not None and choice.over[zone]:
                push(length_m, replace(more, over=_without(choice.over, zone)))

    def _split(
        self, length_m: float, choice: SideChoice, lack: Lacking, hoped: float, push: Callable[..., None]
    ) -> None:
        """Split the choice's range of spare metres, up to what this track takes, in two halves and push both; the upper
        one has the same track. ``hoped``: expected cost of the best path."""
        most = _needed(self.incumbent.problem, choice, lack)
        wide = [b - a for a, b in zip(choice.least_m, most, strict=True)]
        k = int(np.argmax(wide))
        rates = self.incumbent.problem.rates
        metre = self.incumbent.least(1.0) - self.incumbent.least(0.0) if rates is None else rates[0]
        if wide[k] * metre <= NARROW * (hoped - self.incumbent.bound):
            return
        less, more = list(most), list(choice.least_m)
        less[k] = more[k] = choice.least_m[k] + 0.5 * wide[k]
        push(length_m, replace(choice, most_m=(less[0], less[1])))
        push(length_m, replace(choice, least_m=(more[0], more[1]), most_m=most), lack)


def _needed(problem: Problem, choice: SideChoice, lack: Lacking) -> Spare:
    """The spare metres near start and goal that a choice's track takes in laps, within the choice's range: with no more
    than these the track stays the same."""
    limits = problem.limits
    climb = sum(why.by / limits.max_climb_slope for why in lack.steep if why.kind == "climb")
    descent = sum(why.by / limits.max_descent_slope for why in lack.steep if why.kind == "descent")
    low, high = choice.least_m, choice.most_m
    return min(max(climb, low[0]), high[0]), min(max(descent, low[1]), high[1])


def _without(which: Bools, zone: int) -> Bools:
    """A copy of ``which`` with one zone set to False."""
    out = which.copy()
    out[zone] = False
    return out
