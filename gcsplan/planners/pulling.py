"""Pull a ground track tight: every change is kept only if the exact test passes and the real cost falls.

The moves are those of a string around pegs: drop a vertex, cut a corner from one side or from both, bend or shift
the track sideways (which is how a lower pass or a gentler climb is found). What the search's lattice made of the
way is forgotten; which side of a hill or zone it took is kept.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.lattice import Lattice
from gcsplan.planners.problem import Problem
from gcsplan.planners.track import Flown, Obstruction, Track, fly, replace_part

Floats = NDArray[np.float64]

NO_POINTS: Floats = np.zeros((0, 2))
HALVINGS = 4
"""How finely the widest cut of a corner is looked for."""


@dataclass(slots=True)
class Allowance:
    """Work that may still be done: counted trials, and a deadline (`time.perf_counter`) as a backstop only."""

    trials: int
    deadline_s: float = math.inf
    timed_out: bool = field(default=False)

    def grant(self, trials: int) -> None:
        """Set the number of trials, unless time is up."""
        self.trials = 0 if self.timed_out else trials

    def spend(self) -> bool:
        """Take one trial; False where none is left."""
        if self.trials <= 0:
            return False
        if time.perf_counter() > self.deadline_s:
            self.timed_out = True
            self.trials = 0
            return False
        self.trials -= 1
        return True


@dataclass(slots=True)
class Pulled:
    """A track and its profile, getting better. ``guide`` spares exact tests, None asks for all of them."""

    problem: Problem
    track: Track
    flown: Flown
    allowance: Allowance
    guide: Lattice | None = None
    hopeless: set[tuple[bytes, float]] = field(default_factory=set)

    @property
    def unit(self) -> float:
        """Cost of a metre of track."""
        return self.problem.horizontal_j_per_m if self.problem.objective == "energy" else 1.0

    def trial(
        self, s0_m: float, s1_m: float, between: Floats = NO_POINTS, gain_m: float = 0.0
    ) -> tuple[Track, Flown] | None:
        """The track with a part replaced, if that is legal and saves at least ``gain_m`` metres of track."""
        way = [self.track.place(s0_m), *between.reshape(-1, 2), self.track.place(s1_m)]
        below = self.flown.cost - gain_m * self.unit
        longer = sum(math.dist(a, b) for a, b in pairwise(way)) - (s1_m - s0_m)
        if self._at_least(float(self.track.s_m[-1]) + longer) >= below:
            return None
        if self.guide is not None and not all(self.guide.seems_open(a, b) for a, b in pairwise(way)):
            return None
        if not self.allowance.spend():
            return None
        new = replace_part(self.problem, self.track, s0_m, s1_m, between)
        flown = fly(self.problem, new, below, branches=0)
        return None if isinstance(flown, Obstruction) else (new, flown)

    def _at_least(self, flat_m: float) -> float:
        """No profile over a track of that length costs less."""
        p = self.problem
        rise = abs(p.goal[2] - p.start[2])
        if p.objective == "energy":
            return p.horizontal_j_per_m * flat_m + p.vertical_j_per_m * rise
        return math.hypot(flat_m, rise)

    def keep(self, found: tuple[Track, Flown] | None) -> bool:
        """Go on from ``found``, if there is one."""
        if found is not None:
            self.track, self.flown = found
        return found is not None

    def settle(self) -> None:
        """Choose anew, with care, on which side of each zone to pass."""
        flown = fly(self.problem, self.track)
        if isinstance(flown, Flown) and flown.cost < self.flown.cost:
            self.flown = flown

    def straighten(self) -> None:
        """From each vertex on, go straight to the farthest one that can be seen (galloping, then halving)."""
        i = 0
        while i < len(self.track.points) - 2 and self.allowance.trials > 0:
            pins = np.flatnonzero(self.track.pinned)
            reach = int(pins[np.searchsorted(pins, i, "right")]) - i
            s, best = self.track.s_m, None
            seen, hidden, ahead = 1, reach + 1, 2
            while seen < reach and hidden - seen > 1:
                j = min(ahead, reach) if hidden > reach else (seen + hidden) // 2
                found = self.trial(float(s[i]), float(s[i + j]))
                if found is None:
                    hidden = j
                else:
                    seen, best, ahead = j, found, 2 * j
            self.keep(best)
            i += 1

    def tighten(self, gain_m: float, rounds: int = 8) -> None:
        """Drop vertices and cut corners, each for a gain of ``gain_m`` at least, until a round brings no more."""
        for _ in range(rounds):
            before = self.flown.cost
            i = 1
            while i < len(self.track.points) - 1 and self.allowance.trials > 0:
                i = self._corner(i, gain_m)
            if before - self.flown.cost < gain_m * self.unit:
                break

    def _corner(self, i: int, gain_m: float) -> int:
        """Work on vertex i; the number of the vertex to look at next."""
        t = self.track
        if t.pinned[i]:
            return i + 1
        key = (t.points[i - 1 : i + 2].tobytes(), gain_m)
        if key in self.hopeless:
            return i + 1
        a, v, b = t.points[i - 1], t.points[i], t.points[i + 1]
        d1, d2 = math.dist(a, v), math.dist(v, b)
        s = float(t.s_m[i])
        # A corner too flat to gain anything goes if its absence costs next to nothing.
        turn = d1 + d2 - math.dist(a, b)
        if self.keep(self.trial(s - d1, s + d2, gain_m=min(0.0, 0.1 * (turn - gain_m)))):
            return max(i - 1, 1)
        # The widest cut that goes: from the vertex before, to the vertex after, or as far on both sides.
        d = min(d1, d2)
        for r1, r2, f1, f2 in ((d1, d2, 0.0, 1.0), (d1, d2, 1.0, 0.0), (d, d, 1.0, 1.0)):
            low, high, best = 0.0, 1.0, None
            for _ in range(HALVINGS):
                f = 0.5 * (low + high)
                back, on = r1 * (f if f1 else 1.0), r2 * (f if f2 else 1.0)
                chord = math.dist(v + (a - v) * (back / d1), v + (b - v) * (on / d2))
                if back + on - chord < gain_m:
                    break  # narrower cuts gain less
                found = self.trial(s - back, s + on, gain_m=gain_m)
                if found is None:
                    high = f
                else:
                    low, best = f, found
            if self.keep(best):
                return i + (1 if f1 == f2 else 0)
        if self.allowance.trials > 0:
            self.hopeless.add(key)
        return i + 1

    def shift(self, step_m: float, gain_m: float) -> None:
        """Move every free vertex by ``step_m`` sideways or along while that saves something."""
        i = 1
        while i < len(self.track.points) - 1 and self.allowance.trials > 0:
            if not self.track.pinned[i]:
                t = self.track
                a, b = t.points[i - 1], t.points[i + 1]
                along = (b - a) / max(math.dist(a, b), 1e-9)
                across = np.array([-along[1], along[0]])
                for move in (across, -across, along, -along):
                    self._follow(i, move * step_m, gain_m)
            i += 1

    def _follow(self, i: int, move: Floats, gain_m: float) -> None:
        for _ in range(4):
            t = self.track
            if not 0 < i < len(t.points) - 1:
                return
            ends = float(t.s_m[i - 1]), float(t.s_m[i + 1])
            if not self.keep(self.trial(*ends, t.points[i] + move, gain_m)):
                return

    def bend(self, step_m: float, gain_m: float) -> None:
        """Bend the track sideways where its profile turns, at the tops and bottoms of its climbs.

        A straight leg over a ridge has no vertex to shift; this makes one where a lower pass lies beside it.
        """
        profile = self.flown.profile
        rise = np.sign(np.diff(profile.amsl_m))
        for s in profile.s_m[1:-1][rise[1:] != rise[:-1]]:
            t = self.track
            i = int(np.searchsorted(t.s_m, s, "right")) - 1
            if i >= len(t.s_m) - 1 or min(s - t.s_m[i], t.s_m[i + 1] - s) < step_m:
                continue
            place, along = t.place(float(s)), t.points[i + 1] - t.points[i]
            across = np.array([-along[1], along[0]]) / math.hypot(*along)
            before = self.flown
            for move in (across, -across):
                if self.keep(self.trial(float(t.s_m[i]), float(t.s_m[i + 1]), place + move * step_m, gain_m)):
                    self._follow(i + 1, move * step_m, gain_m)
                    break
            if self.flown is not before:
                return  # places along the track are new; the caller comes again

    def simplify(self, worth_m: float) -> None:
        """Let two neighbouring corners become one, where their outer legs meet, while all of it costs ``worth_m``."""
        start = self.flown.cost
        tried: set[bytes] = set()
        while self.allowance.trials > 0:
            t = self.track
            best: tuple[float, int, Floats] | None = None
            for i in range(1, len(t.points) - 2):
                if t.pinned[i] or t.pinned[i + 1] or t.points[i - 1 : i + 3].tobytes() in tried:
                    continue
                corner = _meet(*t.points[i - 1 : i + 3])
                if corner is None:
                    continue
                extra = sum(math.dist(corner, p) for p in t.points[[i, i + 1]]) - math.dist(*t.points[i : i + 2])
                if best is None or extra < best[0]:
                    best = (extra, i, corner)
            left_m = worth_m - (self.flown.cost - start) / self.unit
            if best is None or best[0] > left_m:
                return
            _, i, corner = best
            tried.add(t.points[i - 1 : i + 3].tobytes())
            self.keep(self.trial(float(t.s_m[i - 1]), float(t.s_m[i + 2]), corner, gain_m=-left_m))


def _meet(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats | None:
    """Where the line from a past b meets the line from d past c; None where it does not, or far away."""
    p, q = b - a, c - d
    det = p[0] * q[1] - p[1] * q[0]
    if abs(det) < 1e-9 * max(float(p @ p), float(q @ q)):
        return None
    w = d - a
    t, u = (w[0] * q[1] - w[1] * q[0]) / det, (w[0] * p[1] - w[1] * p[0]) / det
    if t < 1.0 or u < 1.0:
        return None
    return np.asarray(a + t * p)
