"""Tracks past what they can be flown neither over nor under, nor climb to: around it, or with laps on the way.

The mesh of a plane asks of each cell alone whether there is an altitude to pass it at. A track through it may still
have no profile: where a zone is entered below its floor and left above its ceiling, or the climb limit binds far from
the ends. Two things help. Sides of zones are shut, so that the track is another; or it is made longer, by laps, so that
there is more way to climb. How much longer is chosen before the track is: with metres to spare near the ends the walls
there, which stand because nothing can have climbed over them, are lower.

So a node of the search is what is shut, and from which to which spare metres: no path of it is shorter than its
shortest track with the most, and the least of them flown in laps. The node that may hold the least is looked at first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from heapq import heappop, heappush

import numpy as np

from gcsplan.arrays import Bools
from gcsplan.planners.optimal.corridor import PinnedTrack, Spare
from gcsplan.planners.optimal.incumbent import Incumbent
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.exact import sampled_track
from gcsplan.planners.profile.track import Closed, Lacking, distances, lacking

LACKING_M, HAIR_M = 3.0, 0.2
"""So little room is missing because cells are more lenient than the check, about terrain that is kept clear of
sideways most of all: the same is looked at lower by what is missing, and a hair."""
TAKEN = 5
"""Tracks that paths are looked for over, at most."""
MORE = 1.1
"""A track that takes that times more laps than it may take near the ends does not take them there."""
LITTLE = 1e-4
"""What is not worth a look, as a part of the cost."""
NARROW = 0.04
"""Spare metres that differ by less, as a part of what is between path and bound, are not told apart."""


@dataclass(frozen=True, eq=False, slots=True)
class Choice:
    """``under``, ``over`` (zones,): which may be passed so; from ``least_m`` to ``most_m`` spare metres near the ends;
    all of it so much ``lower_m`` than the highest altitude. ``tried``: zones that choices with more shut, and no fewer
    spare metres, were made of before."""

    under: Bools
    over: Bools
    least_m: Spare = (0.0, 0.0)
    most_m: Spare = (0.0, 0.0)
    lower_m: float = 0.0
    tried: frozenset[int] = frozenset()


_Open = tuple[float, int, float, Choice, Lacking | None, PinnedTrack | None]
"""What a path of a choice may cost, a number, how long its track is at least, the choice; what the track lacks, if that
is known; and that track, where a path over it is to be looked for."""


@dataclass(frozen=True, eq=False, slots=True)
class DetourSearch:
    """Tracks past what is in the way. ``terminals``: the shortest track of a choice's zones and most metres, from
    terminal to terminal; ``fine``: whether that is of a fine lattice. What is found goes to the ``incumbent``."""

    incumbent: Incumbent
    terminals: Callable[[Choice], PinnedTrack | None]
    fine: bool

    def run(
        self, roots: list[Choice], most: int, *, first: bool, laps: bool, given: PinnedTrack | None = None
    ) -> Choice | None:
        """Look at ``most`` tracks; the choice that the best path was found with, if one was.

        ``first``: the first that is better than what is known will do; ``laps``: whether it may have laps; ``given``:
        the track of the first of the ``roots``, which the search begins with, if it is known.
        """
        open_set: list[_Open] = []
        best: Choice | None = None
        known: dict[bytes, Lacking | Closed] = {}
        flat: set[tuple[bytes, bytes, Lacking]] = set()
        done: set[tuple[bytes, bytes, Spare, float]] = set()
        looked = taken = pushed = 0
        hoped = self.incumbent.cost

        def push(
            length_m: float, choice: Choice, found: Lacking | None = None, over: PinnedTrack | None = None
        ) -> None:
            nonlocal pushed
            pushed += 1
            key = self.incumbent.least(length_m + 0.5 * (sum(choice.least_m) + sum(choice.most_m)))
            if over is not None and found is not None:
                key = found.cost if found.cost > self.incumbent.bound * (1.0 + self.incumbent.wanted) else 0.0
            heappush(open_set, (key, pushed, length_m, choice, found, over))

        for root in roots:
            push(0.0, root)
        while open_set and taken < TAKEN and self.incumbent.goes_on():
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
            asked = *sides, choice.most_m, choice.lower_m
            if asked in done:
                continue
            done.add(asked)
            looked += 1
            known_terminals = given if choice is roots[0] else None
            terminals = known_terminals or self.terminals(choice)
            if terminals is None:
                continue
            length_m = float(distances(terminals[0])[-1])
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
                flat.add((*sides, lack))  # with more to spare it is no other track
            else:
                self._split(length_m, replace(choice, tried=choice.tried.union(lack.zones)), lack, hoped, push)
        return best

    def _may_help(self, length_m: float, choice: Choice) -> bool:
        """Whether a choice whose track is so long may hold something that is better by more than a little."""
        cost = self.incumbent.cost
        little = min(NARROW * (cost - self.incumbent.bound), LITTLE * cost) if math.isfinite(cost) else 0.0
        return self.incumbent.least(length_m + sum(choice.least_m)) < cost - little

    def _closed(self, length_m: float, choice: Choice, zones: tuple[int, ...], push: Callable[..., None]) -> None:
        """The same with a side of one of the ``zones`` shut."""
        for zone in zones:
            levels, more = self.incumbent.problem.airspace.zones[zone], replace(choice, tried=frozenset())
            if zone not in choice.tried and levels.floor is not None and choice.under[zone]:
                push(length_m, replace(more, under=_without(choice.under, zone)))
            if zone not in choice.tried and levels.ceiling is not None and choice.over[zone]:
                push(length_m, replace(more, over=_without(choice.over, zone)))

    def _split(self, length_m: float, choice: Choice, lack: Lacking, hoped: float, push: Callable[..., None]) -> None:
        """Fewer spare metres than this track takes, and as many; ``hoped``: what the best path is taken to cost."""
        most = _needed(self.incumbent.problem, choice, lack)
        wide = [b - a for a, b in zip(choice.least_m, most, strict=True)]
        k = int(np.argmax(wide))
        if wide[k] * (self.incumbent.least(1.0) - self.incumbent.least(0.0)) <= NARROW * (hoped - self.incumbent.bound):
            return
        less, more = list(most), list(choice.least_m)
        less[k] = more[k] = choice.least_m[k] + 0.5 * wide[k]
        push(length_m, replace(choice, most_m=(less[0], less[1])))
        push(length_m, replace(choice, least_m=(more[0], more[1]), most_m=most), lack)


def _needed(problem: Problem, choice: Choice, lack: Lacking) -> Spare:
    """Spare metres with which a choice's track is the same: no more than it takes."""
    limits = problem.limits
    climb = sum(why.by / limits.max_climb_slope for why in lack.steep if why.kind == "climb")
    descent = sum(why.by / limits.max_descent_slope for why in lack.steep if why.kind == "descent")
    low, high = choice.least_m, choice.most_m
    return min(max(climb, low[0]), high[0]), min(max(descent, low[1]), high[1])


def _without(which: Bools, zone: int) -> Bools:
    out = which.copy()
    out[zone] = False
    return out
