"""A flight in the winds that its mission declares: where it cannot fly, its windows, and what it takes at most.

The fleet's model of motion gives the times (`times.FlightTimes`), with each part at most as fast over ground as its
winds allow (`gcsplan.wind`). Columns are flown as in still air. [Winds](docs/concepts/wind.md) has the definitions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.flight.times import FlightTimes, Parts
from gcsplan.check.motion.stretch import Stretch
from gcsplan.figures import floored
from gcsplan.fleet.motion.ardupilot import MOST_TILT_DEG, leaning_m_s
from gcsplan.vehicle import AIRSPEED_SPARE, Vehicle
from gcsplan.wind.ability import ADVANCES_M_S, Ability, WindsAlong, circle_ratio, winds_within
from gcsplan.wind.declared import DeclaredWind, FlightWind
from gcsplan.wind.drift import Drift
from gcsplan.wind.window import TimeWindow, cover, slowest_m_s, window, witnessed
from gcsplan.world.geodesy.atmosphere import true_per_indicated

UNEVEN_S = 0.1
"""Before each turn of an ArduPilot or a PX4, a flight may be later by this at a higher speed: the most of 70,000 random
flights was 0.09 s. Slower legs of the other models are never earlier."""

STIFF_S, STIFF_M, STIFF_PER_S = 0.35, 200.0, 2.0
"""A PX4 whose acceleration, m/s², is more than its jerk, m/s³, times the last of these is less regular: each of its
legs that is shorter than the second may be later by the first."""

COUPLED, COUPLED_SMOOTH = 2.0, 4.0
"""Seconds by which speeding up and braking may be shorter where a part is 1 m/s faster, times the acceleration, m/s²;
1.6 and 3.9 were the most of 6,000 random flights."""

GUST_SIGMAS = 3.0
"""The highest gust is this many standard deviations of the turbulence, and its share of a window is this many of the
distance by which turbulence displaces an aircraft."""

LOW_FT, HIGH_FT, FOOT_M = 10.0, 1000.0, 0.3048
STRETCHES_BESIDE = 2
"""Stretches before and after one at whose speeds it may be flown, while the aircraft speeds up and brakes."""
PIECE_M, MOST_PIECES = 5.0, 24
"""A leg through a wind that depends on the height is cut into pieces that rise by at most this, at most so many."""
_TRIED_STEPS = 12
_SLOPE_ROUNDS = 4
_LEAST_WAIT_S = 1e-3
_TIMED_CELLS = 16
_NO_RUN_M = 1e-6


@dataclass(frozen=True, slots=True)
class TooWindy:
    """The stretch on which a wind is too strong, that wind, and the highest speed of a set of its form that would do.

    ``up_to_m_s`` has the gusts in it, and was tried: with all speeds of the set in proportion.
    """

    stretch: int
    speed_m_s: float
    from_deg: float
    up_to_m_s: float


@dataclass(frozen=True, eq=False, slots=True)
class Costs:
    """What N stretches take at most: ``air_m`` (N,) metres through the air, ``seconds`` (N,) without the holds.

    ``hold_s`` (N,) are the holds, ``wind_m_s`` (N,) is the highest speed of the wind there.
    """

    air_m: Floats
    seconds: Floats
    hold_s: Floats
    wind_m_s: Floats


def air_m_s(vehicle: Vehicle, speed_m_s: Floats, slopes: Floats, amsl_m: Floats) -> tuple[Floats, Floats]:
    """(P,) the least and the most that a vehicle's airspeed is bounded by, where its way through the air rises by a
    slope between two, ``slopes`` (P, 2).

    A fixed wing keeps its true airspeed. Others lean: the steeper they climb, the faster they are, up to the slope of
    `MOST_TILT_DEG`, and slower beyond it.
    """
    if vehicle.keeps_airspeed:
        true = speed_m_s * true_per_indicated(amsl_m)
        return true, true
    if vehicle.largest_lean_deg is None:
        most = np.full(len(amsl_m), AIRSPEED_SPARE * vehicle.speed_max_m_s)
        return most, most
    fastest = math.tan(math.radians(MOST_TILT_DEG - vehicle.largest_lean_deg))
    slant = np.arctan(np.column_stack([slopes, np.clip(fastest, slopes.min(axis=1), slopes.max(axis=1))]))
    each = leaning_m_s(vehicle.largest_lean_deg, slant, amsl_m[:, None]) * np.cos(slant)
    return each.min(axis=1), each.max(axis=1)


def gust_length_m(agl_m: float) -> float:
    """The length of turbulence along the wind near the ground, by MIL-F-8785C; above `HIGH_FT` as there."""
    feet = min(max(agl_m / FOOT_M, LOW_FT), HIGH_FT)
    return float(FOOT_M * feet / (0.177 + 0.000823 * feet) ** 1.2)


class FlightInWind:
    """A flight's N stretches in the winds of a set; ``agl_m`` (N, 2): lowest and highest height above ground of each.

    ``agl_of``: the same (P, 2) of straight ways from ``start`` (P, 3) to ``end``; None: each way has the heights of its
    stretch. NaN where the ground is not known.
    """

    def __init__(
        self, stretches: Sequence[Stretch], times: FlightTimes, vehicle: Vehicle, wind: FlightWind, agl_m: Floats,
        agl_of: Callable[[Floats, Floats], Floats] | None = None,
    ) -> None:  # fmt: skip
        self.stretches, self.times, self.vehicle, self.flies_in = stretches, times, vehicle, wind
        self.wind, self._departs_s = wind.declared, wind.departs_s
        self._parts, self._cuts = _pieces(times.parts, wind.declared)
        self._ability, self._run_m, self._rise = _ability(vehicle, self._parts)
        self._agl_m, parts = _known(agl_m), self._parts
        self._piece_agl_m = self._agl_m[parts.stretch]
        if agl_of is not None and self.wind.heights == "agl" and (self._cuts > 1).any():
            self._piece_agl_m = _known(agl_of(parts.start, parts.end))
        self._still_s = times.seconds()
        self._waits = np.array([s.until_s is not None for s in stretches], dtype=np.bool_)
        # The last stretch before, or at, each that ends at a time of day; and that time.
        self._gate = np.maximum.accumulate(np.where(self._waits, np.arange(len(stretches)), -1))
        until_s = np.array([s.until_s or 0.0 for s in stretches])
        self._opened_s = np.where(self._gate >= 0, until_s[self._gate], 0.0)

    @cached_property
    def too_windy(self) -> TooWindy | None:
        """Where the aircraft cannot keep its track or its place, or does not advance, in some wind of the set, gusts
        counted."""
        bad = self._cannot(self.wind)
        if bad is None:
            return None
        stretch, (east, north) = bad
        most = self.wind.strongest_m_s
        low, high = 0.0, 1.0
        for _ in range(_TRIED_STEPS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._cannot(self.wind.scaled(middle)) is None else (low, middle)
        up_to_m_s = floored(low * most, 1)
        while up_to_m_s > 0.0 and self._cannot(self.wind.scaled(up_to_m_s / most)) is not None:
            up_to_m_s = floored(up_to_m_s - 0.1, 1)
        come_from = math.degrees(math.atan2(-east, -north)) % 360.0
        return TooWindy(stretch, math.hypot(east, north), come_from, up_to_m_s)

    @cached_property
    def window(self) -> TimeWindow | None:
        """The window of the end of each stretch, its hold and its rounds included, with the share of gusts, and after a
        departure as late as it may be.

        None if the flight cannot be flown in one of the winds.
        """
        if self.too_windy is not None:
            return None
        found, opened_s = self._timed[0], self._opened_s
        return TimeWindow(found.earliest_s + opened_s, found.latest_s + opened_s + self._departs_late_s)

    @property
    def _departs_late_s(self) -> Floats:
        """(N,) by how much a stretch may end later because of a late departure, for which the first gate makes up."""
        return np.where(self._gate < 0, self.flies_in.late_s, 0.0)

    @cached_property
    def _timed(self) -> tuple[TimeWindow, Floats]:
        """The window since the departure or the last gate, and the hours (P, 2) in which each part is flown."""
        hours_s = self._any_hour
        found = self._windowed(hours_s)
        if len(self.wind.times_s) > 1 and not (self._rounds > 1.0).any():
            of = self._parts.stretch
            begins = np.append(0.0, (found.earliest_s + self._opened_s)[:-1])
            hours_s = np.column_stack([begins[of], (found.latest_s + self._opened_s)[of]]) + self._departs_s
            found = self._windowed(hours_s)
        return found, hours_s

    @property
    def _any_hour(self) -> Floats:
        return np.tile([self._departs_s[0], math.inf], (len(self._run_m), 1))

    def _windowed(self, hours_s: Floats) -> TimeWindow:
        along = self._along(self.wind, hours_s)
        found = window(along, self)
        late_s, early_s = self._gust_s(along, found.latest_s)
        earliest_s = np.maximum(found.earliest_s - early_s, 0.0)
        if not self.vehicle.keeps_airspeed:  # no gust makes it faster than commanded
            fastest = self._ability.most_m_s
            earliest_s = np.maximum(earliest_s, np.minimum(found.earliest_s, self.between(fastest, fastest).earliest_s))
        return TimeWindow(earliest_s, found.latest_s + late_s)

    @cached_property
    def drift(self) -> Drift:
        """How much earlier or later than planned each stretch ends, its hold included, in each wind at once, and after
        a departure as late as it may be.

        Of a flight that can be flown in all winds and flies no stretch twice. Gusts have no share in what two vehicles
        have in common: theirs count outward for each.
        """
        still_m_s = self._ability.slowest_m_s(zero := np.zeros(len(self._run_m)), zero)
        # Without a forecast the window, which is a search, is not needed here.
        along = self._witnessing(self._timed[1] if len(self.wind.times_s) > 1 else self._any_hour)
        found = witnessed(along, self, still_m_s)
        late_s, early_s = self._gust_s(along, found.latest_s.max(axis=0))
        earliest_s = found.earliest_s - early_s
        if len(earliest_s) == 1 and not self.vehicle.keeps_airspeed:  # no gust makes it faster than commanded
            fastest = self.between(self._ability.most_m_s, self._ability.most_m_s).earliest_s
            earliest_s = np.maximum(earliest_s, np.minimum(found.earliest_s, fastest))
        hold = np.array([0.0 if math.isinf(s.hold_s) else s.hold_s for s in self.stretches])
        hold[self._waits] = 0.0
        still_s = self._since_gate(np.cumsum((self._still_s + hold) * self._rounds))
        least_s, most_s = self._held_s
        rises, falls = (self._nearby(np.maximum(rate, 0.0)) for rate in (found.slower, found.faster))
        gusts_s = self._steps(late_s) + self._steps(early_s)
        beside = np.maximum(self._uneven_s, np.maximum(np.roll(self._uneven_s, 1), np.roll(self._uneven_s, -1)))
        loose_s = gusts_s + np.where((rises + falls).any(axis=0), beside, 0.0)
        loose_s += np.abs(least_s - hold) + np.abs(most_s - hold)
        early, late = earliest_s - still_s, found.latest_s + late_s + self._departs_late_s - still_s
        for k in np.flatnonzero(self._waits).tolist():  # waiting makes up for the drift, second by second
            early[:, k] = late[:, k] = loose_s[k] = 0.0
            hold_s = max(self.stretches[k].hold_s, _LEAST_WAIT_S)
            rises[:, k], falls[:, k] = (
                np.maximum(-early[:, k - 1], 0.0) / hold_s,
                np.maximum(late[:, k - 1], 0.0) / hold_s,
            )
        seq = np.array([s.seq for s in self.stretches], dtype=np.intp)
        return Drift(seq, early, late, rises, falls, loose_s, self._departs_late_s)

    @cached_property
    def keeps_part(self) -> float:
        """The part of its commanded speed that a multicopter keeps along its path in every declared wind, with gusts.

        1 or more: no wind changes a time there. inf for a fixed wing, whose speed over ground is never the same.
        """
        on_path = np.array([s.on_path for s in self.stretches])[self._parts.stretch] & (self._run_m > _NO_RUN_M)
        if self.vehicle.keeps_airspeed or not on_path.any():
            return math.inf
        along = self._witnessing(self._any_hour)
        free = replace(along.ability, most_m_s=np.full(len(self._run_m), math.inf))
        slow = slowest_m_s(replace(along, ability=free), self.wind.gusts_add_m_s)
        return float((slow / self._ability.most_m_s)[on_path].min())

    def _witnessing(self, hours_s: Floats) -> WindsAlong:
        one_level = len(self.wind.heights_m) == 1 and len(self.wind.times_s) == 1
        return replace(self._along(self.wind, hours_s), circumscribed=one_level)

    def _nearby(self, rates: Floats) -> Floats:
        """(Q, N) the largest of the rates (Q, P) of the parts of each stretch and of those before and after it."""
        count = len(self.stretches)
        own = np.zeros((count + 2 * STRETCHES_BESIDE, len(rates)))
        np.maximum.at(own, self._parts.stretch + STRETCHES_BESIDE, rates.T)
        return np.asarray(np.max([own[k : k + count] for k in range(2 * STRETCHES_BESIDE + 1)], axis=0).T)

    @cached_property
    def costs(self) -> Costs:
        """What each stretch takes at most with any wind of the set; no wind counts as a gain."""
        return self._costs(lambda each: np.asarray(each.max(axis=0)))

    @cached_property
    def costs_so_far(self) -> Costs:
        """As `costs`, but each stretch has what it adds to the most that the flight up to its end takes in one wind.

        The sum up to the end of a stretch, or to a place on it, is the most in any wind of the set; the sum from there
        to the end is none. Where the wind varies, or a part is flown again, it is `costs`.
        """
        if self.wind.varying or any(s.times > 1 or s.jumped_from is not None for s in self.stretches):
            return self.costs
        return self._costs(lambda each: np.diff(np.cumsum(each, axis=1).max(axis=0), prepend=0.0))

    def _costs(self, most: Callable[[Floats], Floats]) -> Costs:
        """The costs; ``most`` makes those of the set, (N,), from those of each cell of its winds, (K, N)."""
        # Without a forecast the window, which is a search, is not needed here.
        hours_s = self._timed[1] if len(self.wind.times_s) > 1 else self._any_hour
        along, cells = self._along(self.wind, hours_s), cover(self.wind)
        air, slows = along.costs(cells)[0], along.speeds_m_s(cells)[0]
        slow, _ = self.even_m_s(slows.min(axis=0), slows.max(axis=0))
        moving_s = self._moving_s(slow)
        late_s, _ = self._gust_s(along, self.between(slow, slow).latest_s)
        later_s = self._steps(late_s) / self._rounds
        stretch, count = self._parts.stretch, len(self.stretches)
        air_m = most(
            np.array([np.bincount(stretch, weights=w, minlength=count) for w in self._run_m * np.maximum(air, 1.0)])
        )
        fastest = np.zeros(count)
        np.maximum.at(fastest, stretch, along.ability.most_air_m_s)
        wind_m_s = self._places(self.wind).strongest_m_s(cells)
        # Where it speeds up, brakes and turns, it is slower than the wind allows: the wind blows past for longer.
        even = [np.bincount(stretch, weights=self._run_m / g, minlength=count) for g in (slow, self._ability.most_m_s)]
        uneven_s = np.maximum(moving_s - even[0], self._still_s - even[1]) + self._uneven_s
        blown_m = np.maximum(uneven_s, 0.0) * (0.0 if self.vehicle.keeps_airspeed else wind_m_s)
        blown_m += self._gust_air_m(moving_s)
        if self.vehicle.energy.base_w and len(cells) > 1:  # else times cost nothing
            groups = np.array_split(slows, _TIMED_CELLS)
            moving_s = most(self._moving_s(self.even_m_s(np.array([g.min(axis=0) for g in groups]), slows[0])[0]))
        held_s = self._held_s[1].copy()
        for k in np.flatnonzero(self._waits).tolist():  # the earlier it comes, the longer it waits
            assert self.window is not None
            held_s[k] = max(self._opened_s[k] - float(self.window.earliest_s[k - 1]), 0.0)
        return Costs(air_m + blown_m + later_s * fastest, moving_s + later_s, held_s, wind_m_s)

    def _moving_s(self, slow_m_s: Floats) -> Floats:
        """(..., N) the most seconds of each stretch, if no part is flown slower than this, and none earlier than in
        still air."""
        return np.maximum(self._seconds(slow_m_s) + (not self.wind.single) * self._uneven_s, self._still_s)

    @cached_property
    def _held_s(self) -> tuple[Floats, Floats]:
        """(N,) the shortest and the longest hold at the end of each stretch: whole circles take longer in a wind.

        Without waits until a time of day, after which times begin anew. ArduPlane leaves a circle when its nose points
        to the next item, up to a circle later (navigation.cpp, `verify_loiter_heading`), and counts turns from where it
        is first on the circle: a hold there may be half a circle shorter.
        """
        hold = np.array([0.0 if math.isinf(s.hold_s) else s.hold_s for s in self.stretches])
        hold[self._waits] = 0.0
        least, most = hold.copy(), hold.copy()
        slowest_m_s = 0.0 if self.wind.varying else float(self.wind.speed_m_s[..., 0].min())
        for i, s in enumerate(self.stretches):
            if self._circles[i] or (s.turns and hold[i] > 0.0):
                amsl_m, speed = np.array([s.end[2]]), np.array([s.speed_m_s])
                bounds = air_m_s(self.vehicle, speed, np.zeros((1, 2)), amsl_m)
                own = math.inf if self.vehicle.keeps_airspeed else s.speed_m_s
                longest = circle_ratio(self.wind.most_m_s, float(bounds[0][0]), own)
                if s.turns:
                    least[i] *= circle_ratio(slowest_m_s, float(bounds[1][0]), own)
                    most[i] *= longest
                if self._circles[i]:
                    circle_s = longest * math.tau * s.reach_m / float(bounds[0][0])
                    least[i], most[i] = max(least[i] - 0.5 * circle_s, 0.0), most[i] + circle_s
        return least, most

    def _since_gate(self, total: Floats) -> Floats:
        """(..., N) sums up to the end of each stretch, from the departure or from the last gate on."""
        return total if (self._gate < 0).all() else total - np.where(self._gate >= 0, total[..., self._gate], 0.0)

    def _steps(self, since_gate: Floats) -> Floats:
        """(N,) what each stretch adds to sums since the last gate."""
        steps = np.diff(since_gate, prepend=0.0)
        steps[self._waits] = 0.0
        return steps

    # -- a `FlightClock`, whose points are the ends of the stretches, with holds and rounds --------------------------
    # All of it counts from the departure, or from the last gate on.

    @property
    def run_m(self) -> Floats:
        """(P,) lengths of the parts over ground."""
        return self._run_m

    def summed(self, seconds: Floats) -> Floats:
        """(..., N) the sums of seconds of parts (..., P) up to the end of each stretch."""
        return self._since_gate(self._totals(seconds))

    def _totals(self, seconds: Floats) -> Floats:
        upto = np.searchsorted(self._parts.stretch, np.arange(len(self.stretches)), side="right")
        sums = np.cumsum(seconds * self._rounds[self._parts.stretch], axis=-1)
        return np.concatenate([np.zeros((*sums.shape[:-1], 1)), sums], axis=-1)[..., upto]

    def loose_s(self, slow_m_s: Floats, fast_m_s: Floats) -> Floats:
        """(..., N) by how much what is beyond lengths over speeds may fall where speeds rise: at joints, where an
        aircraft speeds up and brakes."""
        per_m_s = (COUPLED_SMOOTH if self.vehicle.smooths else COUPLED) / self.vehicle.accel_m_s2
        least_s, most_s = self._held_s
        joints_s = self._totals((fast_m_s - slow_m_s) * per_m_s / np.repeat(self._cuts, self._cuts))
        after_s = np.concatenate([joints_s[..., 1:], joints_s[..., -1:]], axis=-1)  # the joint to the next stretch
        begun_s = np.where(self._gate >= 0, joints_s[..., self._gate], 0.0)
        return after_s - begun_s + self._since_gate(np.cumsum((most_s - least_s + 2.0 * self._uneven_s) * self._rounds))

    def even_m_s(self, slow_m_s: Floats, fast_m_s: Floats) -> tuple[Floats, Floats]:
        """(..., P) the lowest and the highest speed of all pieces of each part's leg."""
        if (self._cuts == 1).all():
            return slow_m_s, fast_m_s
        first = np.cumsum(self._cuts) - self._cuts
        low, high = np.minimum.reduceat(slow_m_s, first, axis=-1), np.maximum.reduceat(fast_m_s, first, axis=-1)
        return np.repeat(low, self._cuts, axis=-1), np.repeat(high, self._cuts, axis=-1)

    def _seconds(self, even_m_s: Floats) -> Floats:
        """(..., N) seconds of the stretches, with all pieces of a leg at most at one speed."""
        return self.times.seconds(even_m_s[..., np.cumsum(self._cuts) - 1])

    def between(self, slow_m_s: Floats, fast_m_s: Floats) -> TimeWindow:
        """The window where each part is flown at most at a speed between two; these are even."""
        least_s, most_s = self._held_s
        latest = earliest = self._seconds(slow_m_s)
        differ = np.zeros(latest.shape, dtype=np.bool_)
        np.logical_or.at(differ.T, self._parts.stretch, (slow_m_s != fast_m_s).T)
        if differ.any():
            # A leg ends in the turn to the next one.
            beside = differ.copy()
            beside[..., :-1] |= differ[..., 1:]
            beside[..., 1:] |= differ[..., :-1]
            uneven_s = np.where(beside, self._uneven_s, 0.0)
            latest, earliest = latest + uneven_s, np.maximum(self._seconds(fast_m_s) - uneven_s, 0.0)
        totals = ((earliest + least_s) * self._rounds, (latest + most_s) * self._rounds)
        return TimeWindow(*(self._since_gate(np.cumsum(total, axis=-1)) for total in totals))

    @cached_property
    def _rounds(self) -> Floats:
        return np.array([float(s.times) for s in self.stretches])

    @cached_property
    def _uneven_s(self) -> Floats:
        """(N,) by how much a stretch may be later if it is flown faster."""
        count = len(self.stretches)
        uneven = np.zeros(count)
        if self.vehicle.keeps_airspeed or not (self.vehicle.lays_curves or self.vehicle.smooths):
            return uneven
        turns, run_m = self.times.turns, np.bincount(self._parts.stretch, weights=self._run_m, minlength=count)
        seqs = [s.seq for s in self.stretches]
        ends = [*(i for i, (a, b) in enumerate(pairwise(seqs)) if a != b), count - 1]
        stiff = self.vehicle.smooths and self.vehicle.accel_m_s2 > STIFF_PER_S * self.vehicle.leg_jerk_m_s3
        first = 0
        for last in ends:  # chords of one item are one leg
            length_m = float(run_m[first : last + 1].sum())
            uneven[last] = UNEVEN_S * turns[last]
            if stiff and _NO_RUN_M < length_m < STIFF_M:
                uneven[last] = STIFF_S
            first = last + 1
        return uneven

    def _gust_s(self, along: WindsAlong, latest_s: Floats) -> tuple[Floats, Floats]:
        """(N,) by how much gusts make the end of each stretch later, and earlier.

        Turbulence of the length L drifts past at the airspeed V: its displacement in T seconds has the variance
        2·σ²·τ²·(T/τ - 1 + exp(-T/τ)) with τ = L/V. Besides, gusts across the track cost a fixed wing the mean speed
        σ²/2·√(V² - n²) at most, and a multicopter, which no gust makes faster than commanded, σ/√(2π) where a gust may
        slow it down; where none may, it is not displaced.
        """
        add_m_s, nothing = self.wind.gusts_add_m_s, np.zeros(len(self.stretches))
        if not add_m_s or not len(self._run_m):
            return nothing, nothing
        cells, sigma = cover(self.wind), add_m_s / GUST_SIGMAS
        slow = along.speeds_m_s(cells)[0].min(axis=0)
        weak = along.speeds_m_s(cells, add_m_s)[0].min(axis=0) < self._ability.most_m_s
        per_m_s, air = nothing.copy(), float(along.ability.least_air_m_s.min())
        np.maximum.at(per_m_s, self._parts.stretch, np.where(weak, 1.0 / slow, 0.0))
        lost_m_s = sigma / math.sqrt(2.0 * math.pi)
        if self.vehicle.keeps_airspeed:
            lost_m_s = 0.5 * sigma**2 / math.sqrt(max(air**2 - self.wind.most_m_s**2, sigma**2))
        tau = gust_length_m(float(self._agl_m[:, 1].max())) / air
        drifts = latest_s / tau
        moved_m = add_m_s * tau * np.sqrt(2.0 * np.maximum(drifts - 1.0 + np.exp(-drifts), 0.0))
        early_s = np.maximum.accumulate(per_m_s) * moved_m
        lost_s = self._since_gate(np.cumsum(self._steps(latest_s) * per_m_s * lost_m_s))
        return early_s + lost_s, early_s

    def _gust_air_m(self, seconds: Floats) -> Floats:
        """(N,) metres that gusts add to a multicopter's way through the air: how far they may carry it on the whole,
        and those across, which count by half of their square per airspeed. A fixed wing keeps its airspeed."""
        add_m_s = self.wind.gusts_add_m_s
        if not add_m_s or self.vehicle.keeps_airspeed or not len(self._run_m):
            return np.zeros(len(seconds))
        sigma = add_m_s / GUST_SIGMAS
        air = max(float(self._ability.most_m_s.min()) - self.wind.most_m_s, sigma)
        tau = gust_length_m(float(self._agl_m[:, 1].max())) / air
        drifts = np.cumsum(seconds) / tau
        moved_m = add_m_s * tau * np.sqrt(2.0 * np.maximum(drifts - 1.0 + np.exp(-drifts), 0.0))
        return np.asarray(np.diff(moved_m, prepend=0.0) + seconds * 0.5 * sigma**2 / air)

    def _cannot(self, wind: DeclaredWind) -> tuple[int, Floats] | None:
        """A stretch that cannot be flown in a wind of the set, and that wind (2,); None if there is none."""
        cells, gust_m_s = cover(wind), wind.gusts_add_m_s
        if len(self._run_m):
            along = self._along(wind, self._any_hour)
            slow, _ = along.speeds_m_s(cells, gust_m_s)
            slow = np.where(self._run_m > _NO_RUN_M, np.nan_to_num(slow, nan=-math.inf), math.inf)
            cell, part = np.unravel_index(int(np.argmin(slow)), slow.shape)
            if not slow[cell, part] >= ADVANCES_M_S:
                return int(self._parts.stretch[part]), along.wind_of(int(part), cells[cell])
        places = self._places(wind)
        spare = np.where(self._stays, places.ability.least_air_m_s - places.strongest_m_s(cells) - gust_m_s, math.inf)
        worst = int(np.argmin(spare))
        return None if spare[worst] > 0.0 else (worst, places.wind_of(worst, cells[0]))

    @cached_property
    def _circles(self) -> Bools:
        """(N,) whether a stretch is a fixed wing's circle that it leaves again."""
        left = [s.reach_m > 0.0 and s.start == s.end and math.isfinite(s.hold_s) for s in self.stretches]
        return np.array(left, dtype=np.bool_) & self.vehicle.keeps_airspeed

    @cached_property
    def _stays(self) -> Bools:
        """(N,) whether it keeps a place, or a circle, on a stretch or at its end."""
        wing = self.vehicle.keeps_airspeed
        stays = [(s.hold_s > 0.0 and (not wing or s.reach_m > 0.0)) or (s.column and not wing) for s in self.stretches]
        return np.array(stays, dtype=np.bool_) | self._circles

    def _places(self, wind: DeclaredWind) -> WindsAlong:
        """The winds over the stretches' places, at any hour of the flight."""
        amsl_m = np.sort([(s.start[2], s.end[2]) for s in self.stretches], axis=1)
        count = len(amsl_m)
        speed = np.array([s.speed_m_s for s in self.stretches])
        least, most = air_m_s(self.vehicle, speed, np.zeros((count, 2)), amsl_m[:, 1])
        east = np.tile([1.0, 0.0], (count, 1))
        ability = Ability(east, np.zeros(count), least, most, np.full(count, math.inf))
        hours_s = np.tile([self._departs_s[0], math.inf], (count, 1))
        return winds_within(wind, ability, amsl_m, self._agl_m, hours_s)

    def _along(self, wind: DeclaredWind, hours_s: Floats) -> WindsAlong:
        """The winds of a set along the parts, within hours (P, 2)."""
        able = self._leaning if wind is self.wind else self._able(wind)
        return winds_within(wind, able, self._amsl_m, self._piece_agl_m, hours_s)

    @cached_property
    def _amsl_m(self) -> Floats:
        return np.sort(np.column_stack([self._parts.start[:, 2], self._parts.end[:, 2]]), axis=1)

    @cached_property
    def _leaning(self) -> Ability:
        return self._able(self.wind)

    def _able(self, wind: DeclaredWind) -> Ability:
        """What the vehicle can do on the parts in the winds of a set, with gusts.

        A multicopter that leans its most rises through the air by the slope of its leg times its speed over ground per
        airspeed. That is two at most where it keeps its place, and `_cannot` finds the winds in which it does not. Each
        range of airspeeds gives a nearer one of slopes.
        """
        able, rise, middle_m = self._ability, self._rise, self._amsl_m.mean(axis=1)
        if self.vehicle.largest_lean_deg is None or not rise.any():
            return able
        per_air = np.tile([0.0, 2.0], (len(rise), 1))
        for _ in range(_SLOPE_ROUNDS):
            least, most = air_m_s(self.vehicle, self._parts.speed_m_s, rise[:, None] * per_air, middle_m)
            able = replace(able, least_air_m_s=least, most_air_m_s=most)
            along = winds_within(wind, able, self._amsl_m, self._piece_agl_m, self._any_hour)
            per_air = np.clip(along.advance_per_air(cover(wind), wind.gusts_add_m_s), per_air[:, :1], per_air[:, 1:])
        return able


def _known(agl_m: Floats) -> Floats:
    """Lowest and highest heights above ground (..., 2), any height where the ground is not known."""
    return np.where(np.isnan(agl_m), [0.0, math.inf], agl_m)


def _pieces(parts: Parts, wind: DeclaredWind) -> tuple[Parts, Indices]:
    """Parts cut so that a wind that depends on the height has its own on each piece; how many each gives (P,)."""
    rise_m = np.abs(parts.end[:, 2] - parts.start[:, 2])
    cuts = np.clip(np.ceil(rise_m / PIECE_M), 1, MOST_PIECES).astype(np.intp)
    if len(wind.heights_m) == 1:
        cuts = np.ones_like(cuts)
    number = np.repeat(np.arange(len(cuts)), cuts)
    before = np.arange(len(number)) - np.repeat(np.cumsum(cuts) - cuts, cuts)
    way = parts.end - parts.start
    start, end = (parts.start[number] + (k / cuts[number])[:, None] * way[number] for k in (before, before + 1.0))
    return Parts(start, end, parts.stretch[number], parts.speed_m_s[number]), cuts


def _ability(vehicle: Vehicle, parts: Parts) -> tuple[Ability, Floats, Floats]:
    """What the vehicle can do on parts in still air; their lengths over ground (P,), and their rise per metre (P,)."""
    d = parts.end - parts.start
    run = np.hypot(d[:, 0], d[:, 1])
    moves = run > _NO_RUN_M
    level = np.where(moves, run, 1.0)
    course = np.where(moves[:, None], d[:, :2] / level[:, None], 0.0)
    slope = np.where(moves, d[:, 2] / level, 0.0)
    middle_m = 0.5 * (parts.start[:, 2] + parts.end[:, 2])
    least, most = air_m_s(vehicle, parts.speed_m_s, np.column_stack([np.zeros_like(slope), slope]), middle_m)
    wing = vehicle.keeps_airspeed
    bound = np.full(len(run), math.inf) if wing else parts.speed_m_s
    return Ability(course, slope if wing else np.zeros_like(slope), least, most, bound), run, slope
