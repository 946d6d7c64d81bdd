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
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.optimal.leg import Spare
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.exact import sampled_track
from gcsplan.planners.profile.track import Lacking, Shut, distances, lacking

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Stops = tuple[Floats, Bools, Floats]
"""A track (N, 2), which of its points are stops, and their altitudes (NaN free)."""

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


_Open = tuple[float, int, float, Choice, Lacking | None, Stops | None]
"""What a path of a choice may cost, a number, how long its track is at least, the choice; what the track lacks, if that
is known; and that track, where a path over it is to be looked for."""


class Seeker(Protocol):
    """Who asks for a search, and keeps the best path.

    ``cost``, ``bound``: of the best path, and of all paths; ``wanted``: how far the one may be from the other, as a
    part. ``stops``: the shortest track of a choice's zones and most metres, below a cap, on the finer lattice or on
    that of the first look; ``least``: what a path costs at least whose track is so long; ``take_longer``: look for a
    path over a track, with laps where it is too steep, and keep it if it is the best; ``goes_on``: whether a better one
    is wanted, and there is time.
    """

    problem: Problem
    cost: float
    bound: float
    wanted: float

    def stops(self, choice: Choice, cap_m: float, fine: bool) -> Stops | None: ...
    def least(self, track_m: float) -> float: ...
    def take_longer(self, stops: Stops, fine: bool) -> bool: ...
    def goes_on(self) -> bool: ...


@dataclass(frozen=True, eq=False, slots=True)
class Search:
    """A search below a cap, on the finer lattice (``fine``) or on that of the first look."""

    ask: Seeker
    cap_m: float
    fine: bool

    def run(
        self, roots: list[Choice], most: int, *, first: bool, laps: bool, given: Stops | None = None
    ) -> Choice | None:
        """Look at ``most`` tracks; the choice that the best path was found with, if one was.

        ``first``: the first that is better than what is known will do; ``laps``: whether it may have laps; ``given``:
        the track of the first of the ``roots``, which the search begins with, if it is known.
        """
        open_set: list[_Open] = []
        best: Choice | None = None
        known: dict[bytes, Lacking | Shut] = {}
        flat: set[tuple[bytes, bytes, Lacking]] = set()
        done: set[tuple[bytes, bytes, Spare, float]] = set()
        looked = taken = pushed = 0
        hoped = self.ask.cost

        def push(length_m: float, choice: Choice, found: Lacking | None = None, over: Stops | None = None) -> None:
            nonlocal pushed
            pushed += 1
            key = self.ask.least(length_m + 0.5 * (sum(choice.least_m) + sum(choice.most_m)))
            if over is not None and found is not None:
                key = found.cost if found.cost > self.ask.bound * (1.0 + self.ask.wanted) else 0.0
            heappush(open_set, (key, pushed, length_m, choice, found, over))

        for root in roots:
            push(0.0, root)
        while open_set and taken < TAKEN and self.ask.goes_on():
            key, _, length_m, choice, found, over = heappop(open_set)
            if over is not None:
                if key < self.ask.cost:
                    taken += 1
                    if self.ask.take_longer(over, self.fine):
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
            known_stops = given if choice is roots[0] else None
            stops = known_stops or self.ask.stops(choice, self.cap_m, self.fine)
            if stops is None:
                continue
            length_m = float(distances(stops[0])[-1])
            if not self._may_help(length_m, choice):
                continue
            name = stops[0].tobytes()
            seen = name in known
            if not seen:
                known[name] = lacking(self.ask.problem, sampled_track(self.ask.problem, *stops))
            lack = known[name]
            if isinstance(lack, Shut):
                if not seen and lack.by < LACKING_M:
                    push(length_m, replace(choice, lower_m=choice.lower_m + lack.by + HAIR_M))
                self._shut(length_m, choice, lack.zones, push)
                continue
            if not seen and (laps or not lack.steep):
                push(length_m, replace(choice, most_m=_needed(self.ask.problem, choice, lack)), lack, stops)
                hoped = min(hoped, lack.cost)
            self._shut(length_m, choice, lack.zones, push)
            if lack.laps_m > MORE * sum(choice.most_m):
                flat.add((*sides, lack))  # with more to spare it is no other track
            else:
                self._split(length_m, replace(choice, tried=choice.tried.union(lack.zones)), lack, hoped, push)
        return best

    def _may_help(self, length_m: float, choice: Choice) -> bool:
        """Whether a choice whose track is so long may hold something that is better by more than a little."""
        cost = self.ask.cost
        little = min(NARROW * (cost - self.ask.bound), LITTLE * cost) if math.isfinite(cost) else 0.0
        return self.ask.least(length_m + sum(choice.least_m)) < cost - little

    def _shut(self, length_m: float, choice: Choice, zones: tuple[int, ...], push: Callable[..., None]) -> None:
        """The same with a side of one of the ``zones`` shut."""
        for zone in zones:
            levels, more = self.ask.problem.airspace.zones[zone], replace(choice, tried=frozenset())
            if zone not in choice.tried and levels.floor is not None and choice.under[zone]:
                push(length_m, replace(more, under=_without(choice.under, zone)))
            if zone not in choice.tried and levels.ceiling is not None and choice.over[zone]:
                push(length_m, replace(more, over=_without(choice.over, zone)))

    def _split(self, length_m: float, choice: Choice, lack: Lacking, hoped: float, push: Callable[..., None]) -> None:
        """Fewer spare metres than this track takes, and as many; ``hoped``: what the best path is taken to cost."""
        most = _needed(self.ask.problem, choice, lack)
        wide = [b - a for a, b in zip(choice.least_m, most, strict=True)]
        k = int(np.argmax(wide))
        if wide[k] * (self.ask.least(1.0) - self.ask.least(0.0)) <= NARROW * (hoped - self.ask.bound):
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


def joined(ways: list[Floats], heights: list[float | None]) -> Stops:
    """One track of those from stop to stop (N, 2), of which the ``heights`` of all but the ends are told."""
    points = np.vstack([ways[0], *(w[1:] for w in ways[1:])])
    pinned, pin_m = np.zeros(len(points), np.bool_), np.full(len(points), math.nan)
    pinned[0] = pinned[-1] = True
    at = 0
    for way, height in zip(ways[:-1], heights, strict=True):
        at += len(way) - 1
        pinned[at] = True
        pin_m[at] = math.nan if height is None else height
    return points, pinned, pin_m
