"""Arrival schedules: departures, speeds and arrivals of fleets that arrive together or one after the other.

After Tan et al. 2023 ("Multi-UAV path planning based on IB-ABC with restricted planned arrival sequence"): all leave at
the same time. In a sequence the first flies at its fastest and sets the clock, `T_i = T_1 + (i - 1)·interval`;
together, the slowest sets it. The speeds follow, `v_i = L_i / T_i`. Here the time model of `timing` replaces `L / v`:
the speed is found as a root, since time never rises with speed.

To arrive later a `Craft` flies slower. If that would be slower than its slowest speed, it leaves later (which costs
nothing), holds at the gate, or gets a longer path. If a vehicle is late even at its fastest, the first one waits; if
the clock forbids that (``clock="first"``, as in the paper) or it is impossible, there is no schedule.

So a vehicle can be at the goal from ``fast_s`` (its fastest) to ``latest_s`` (its slowest, or inf if it may wait). Turn
``p`` of a sequence that begins at ``first_s`` is at ``first_s + p·interval_s``: that decides in which orders a fleet
may arrive.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.errors import NoMission
from gcsplan.fleet.motion.ardupilot import lean_needed_deg
from gcsplan.fleet.motion.timing import Course, Route, TimedPath, speed_for
from gcsplan.notes.note import Note
from gcsplan.vehicle import DEFAULT_LEAN_DEG, LARGEST_LEAN_DEG, Autopilot, Vehicle, lean_for_deg, lean_words
from gcsplan.wind.drift import Drift
from gcsplan.world.geodesy.atmosphere import true_per_indicated

__all__ = ["WITHIN_S", "Clock", "Craft", "Crew", "Hold", "Longer", "Mode", "NoSchedule", "Schedule", "Slot", "schedule"]

Clock = Literal["first", "fleet"]
OrderCost = Callable[[Floats], Floats]

WITHIN_S = 1e-6
"""Times that differ by less than this, s, count as equal."""

MOST_CLOCKS = 400
"""Most starting times of a sequence that are tried if vehicles can neither be early nor wait."""


Hold = Literal["ground", "gate", "none"]
Longer = Callable[[str, float], Route | None]

LONGEST_HOLD_S = 65535.0
"""Longest hold, s: ArduPilot stores whole seconds in 16 bits, and a hold of 70000 s came back as 4464."""

LONGER_TRIES = 4

WITHIN_LEAN_DEG = 0.01
"""Degrees by which a lean angle may fall short, since speeds are float32 numbers."""

Mode = Literal["sequence", "together", "none"]

EXPLAINED = 3
"""Most omitted vehicles whose errors name a cure: finding it looks at the whole fleet."""


def interval_range(fast_s: Floats, latest_s: Floats, clock: Clock, first_s: float | None) -> tuple[float, float]:
    """Smallest and largest interval with which vehicles in this order can arrive.

    The smallest is above the largest if no interval works. ``first_s`` is the arrival of the first, s; None: at its
    fastest (``first``), or as early as the whole fleet can follow (``fleet``).
    """
    n = len(fast_s)
    turn = np.arange(n, dtype=np.float64)
    if first_s is None and clock == "fleet":
        # A starting time must be after every fast_j - j·d and before every latest_i - i·d.
        gap, apart = latest_s[:, None] - fast_s[None, :], turn[:, None] - turn[None, :]
        later, sooner = apart > 0.0, apart < 0.0
        low = float((gap[sooner] / apart[sooner]).max(initial=0.0))
        return low, float((gap[later] / apart[later]).min(initial=math.inf))
    begin = float(fast_s[0]) if first_s is None else first_s
    if begin < fast_s[0] - WITHIN_S or begin > latest_s[0] + WITHIN_S:
        return math.inf, 0.0
    low = max(0.0, float(((fast_s[1:] - begin) / turn[1:]).max(initial=0.0)))
    high = float(((latest_s[1:] - begin) / turn[1:]).min(initial=math.inf))
    return low, high


def earliest_first(fast_s: Floats, latest_s: Floats, interval_s: float) -> float | None:
    """The earliest starting time of a sequence in this order, s; None if none suits all vehicles."""
    turns = np.arange(len(fast_s)) * interval_s
    low, high = float((fast_s - turns).max()), float((latest_s - turns).min())
    return low if low <= high + WITHIN_S else None


def best_order(
    fast_s: Floats,
    latest_s: Floats,
    interval_s: float,
    clock: Clock,
    first_s: float | None,
    cost: OrderCost | None = None,
) -> Indices | None:
    """The order that finishes earliest, and the cheapest one of a starting time; None if none works.

    ``cost`` returns joules (n, n) of each vehicle (row) for arriving at the times (n,) that are passed to it. Exact for
    any number of vehicles: for a given starting time, turns are assigned as a linear assignment problem (if waiting
    costs nothing, sorting by ``fast_s`` solves it: swapping two neighbours that are out of order never helps the later
    one), and starting times are tried from the earliest. For a ``fleet`` clock whose vehicles cannot wait,
    `MOST_CLOCKS` starting times are tried: exact up to 20 vehicles.
    """
    n = len(fast_s)
    by_speed = np.argsort(fast_s, kind="stable").astype(np.intp)
    turns = np.arange(n, dtype=np.float64)
    turns *= interval_s
    if first_s is not None:
        return _assigned(fast_s, latest_s, first_s + turns, cost, by_speed)
    if clock == "first":
        for k in by_speed:
            others = by_speed[by_speed != k]
            times = float(fast_s[k]) + turns[1:]
            sub = None if cost is None else _rows(cost, others)
            found = _assigned(fast_s[others], latest_s[others], times, sub, np.arange(n - 1, dtype=np.intp))
            if found is not None:
                return np.concatenate([[k], others[found]]).astype(np.intp)
        return None
    least = float((fast_s[by_speed] - turns).max())
    begins = np.unique(fast_s[:, None] - turns[None, :])
    begins = begins[begins >= least - WITHIN_S][:MOST_CLOCKS]
    for begin in begins.tolist():
        found = _assigned(fast_s, latest_s, begin + turns, cost, by_speed)
        if found is not None:
            return found
    return None


def _rows(cost: OrderCost, rows: Indices) -> OrderCost:
    return lambda times: cost(times)[rows]


def _assigned(
    fast_s: Floats, latest_s: Floats, times: Floats, cost: OrderCost | None, by_speed: Indices
) -> Indices | None:
    """The vehicle for each of the ``times``, at the least cost; None if the times cannot all be kept."""
    n = len(times)
    if n == 0:
        return np.empty(0, dtype=np.intp)
    if (fast_s[by_speed] > times + WITHIN_S).any():
        return None  # sorted by fast_s a vehicle is late, so one is late in any other order too
    joules = np.zeros((n, n)) if cost is None else cost(times)
    able = (fast_s[:, None] <= times[None, :] + WITHIN_S) & (latest_s[:, None] >= times[None, :] - WITHIN_S)
    turn = np.arange(n)
    if able[by_speed, turn].all() and joules[by_speed, turn].sum() <= 0.0:
        return by_speed
    from scipy.optimize import linear_sum_assignment  # slow to import, so only if sorting does not solve it

    worst = 2.0 * (float(joules.max()) + 1.0) * n
    row, column = linear_sum_assignment(np.where(able, joules, worst))
    if not able[row, column].all():
        return None
    order = np.empty(n, dtype=np.intp)
    order[column] = row
    return order


@dataclass(frozen=True, slots=True)
class Crew:
    """One vehicle and its route. It flies at speeds of its range from ``least_m_s`` to ``most_m_s``. ``drift`` is its
    flight's in the declared winds, at about the speed at which it flies; None: no wind changes a time."""

    vehicle: Vehicle
    route: Route
    least_m_s: float = 0.0
    most_m_s: float = math.inf
    drift: Drift | None = None

    @property
    def name(self) -> str:
        """The vehicle's name."""
        return self.vehicle.name


@dataclass(frozen=True, eq=False, slots=True)
class Slot:
    """One vehicle's part of a schedule.

    It leaves the ground ``depart_s`` after the common start, holds ``hold_s`` (whole seconds) at the gate, flies at
    ``speed_m_s`` (a float32, as DO_CHANGE_SPEED carries it) and is at the goal at ``arrive_s``. ``energy_j`` is for the
    whole flight. ``route`` is the one to fly, which is longer than the original one if that was needed.
    """

    name: str
    depart_s: float
    hold_s: float
    speed_m_s: float
    arrive_s: float
    energy_j: float
    route: Route
    notes: tuple[Note, ...] = ()


class Craft:
    """A crew with its timing: the arrivals within its reach.

    If it leaves the ground at the common start, it is at the goal ``fast_s`` later at its fastest and ``slow_s`` later
    at its slowest. Both speeds are float32 numbers within its range.
    """

    def __init__(self, crew: Crew) -> None:
        self.crew, self.name = crew, crew.name
        self.vehicle = crew.vehicle
        self.course = Course(crew.route, crew.vehicle)
        most_m_s = max(min(crew.vehicle.speed_max_m_s, crew.most_m_s), crew.vehicle.speed_min_m_s)
        least_m_s = min(max(crew.vehicle.speed_min_m_s, crew.least_m_s), most_m_s)
        self.slowest_m_s, self.fastest_m_s = _float32_range(least_m_s, most_m_s)
        self.fast_s = self.course.time_to_goal_s(self.fastest_m_s)
        self.slow_s = self.course.time_to_goal_s(self.slowest_m_s)

    @property
    def circle_s(self) -> tuple[float, float] | None:
        """Seconds of a circle of its turn radius at its slowest and at its fastest in still air; None if it is no wing.

        ArduPlane widens circles in thin air by the square of what makes it faster.
        """
        if not self.vehicle.keeps_airspeed:
            return None
        round_m = math.tau * self.vehicle.turn_radius_m * float(true_per_indicated(self.crew.route.points[-1:, 2])[0])
        return round_m / self.slowest_m_s, round_m / self.fastest_m_s

    def latest_s(self, hold: Hold) -> float:
        """Its latest arrival with the allowed kind of waiting, s."""
        if hold == "ground":
            return math.inf
        return self.slow_s + (LONGEST_HOLD_S if hold == "gate" and self.vehicle.can_hold else 0.0)

    def waiting_w(self, hold: Hold) -> float:
        """Cost of each second by which it must be later than its slowest speed takes it, W.

        0 on the ground, hovering at the gate; if it cannot wait, about the energy of flying for that second.
        """
        energy = self.vehicle.energy
        if hold == "ground":
            return 0.0
        if hold == "gate" and self.vehicle.can_hold:
            return energy.hold_w()
        return max(energy.horizontal_j_per_m, 1.0) * self.slowest_m_s + energy.base_w

    def fly(self, speed_m_s: float, depart_s: float = 0.0, hold_s: float = 0.0, notes: Sequence[Note] = ()) -> Slot:
        """The slot of a flight with this speed (put into range), departure and hold."""
        speed = min(max(float(np.float32(speed_m_s)), self.slowest_m_s), self.fastest_m_s)
        arrive_s = depart_s + self.course.time_to_goal_s(speed, hold_s)
        moving_s = self.course.moving_s(speed) if self.vehicle.energy.base_w else math.nan
        joules = self.crew.route.energy_j(self.vehicle, hold_s, moving_s)
        all_notes = (*notes, *_speed_notes(self.vehicle, speed))
        return Slot(self.name, depart_s, hold_s, speed, arrive_s, joules, self.crew.route, all_notes)

    def motion(self, slot: Slot) -> TimedPath:
        """The motion of a slot, with its drifts in the declared winds."""
        return self.course.fly(slot.speed_m_s, slot.depart_s, slot.hold_s).drifting(self.crew.drift)

    def at(self, arrive_s: float, hold: Hold = "ground", longer: Longer | None = None) -> Slot | None:
        """The slot that arrives at ``arrive_s``: at a lower speed, else at its slowest, with waiting as allowed.

        None if that is impossible: too early for its fastest, or too late for its slowest without waiting.
        """
        if arrive_s < self.fast_s - WITHIN_S:
            return None
        spare_s = arrive_s - self.slow_s
        if spare_s <= WITHIN_S:
            return self.fly(self._speed_for(arrive_s))
        if hold == "ground":
            return self.fly(self.slowest_m_s, spare_s, notes=[Note("waits_on_ground", wait_s=spare_s)])
        if hold == "gate" and self.vehicle.can_hold and spare_s <= LONGEST_HOLD_S:
            return self._held(arrive_s, spare_s)
        return None if longer is None else self._longer(arrive_s, longer)

    def _speed_for(self, time_s: float) -> float:
        return speed_for(self.course.time_to_goal_s, time_s, self.slowest_m_s, self.fastest_m_s)

    def _held(self, arrive_s: float, spare_s: float) -> Slot:
        """Hold whole seconds at the gate; the speed makes up for the fraction, or, if it cannot, the departure."""
        hold_s = math.ceil(spare_s - WITHIN_S)
        joules = self.vehicle.energy.hold_w() * hold_s
        if arrive_s - hold_s >= self.fast_s:
            note = Note("holds_at_gate", hold_s=hold_s, energy_j=joules)
            return self.fly(self._speed_for(arrive_s - hold_s), 0.0, float(hold_s), [note])
        hold_s = math.floor(spare_s)
        joules = self.vehicle.energy.hold_w() * hold_s
        note = Note("holds_and_waits", hold_s=hold_s, energy_j=joules, wait_s=spare_s - hold_s)
        return self.fly(self.slowest_m_s, spare_s - hold_s, float(hold_s), [note])

    def _longer(self, arrive_s: float, longer: Longer) -> Slot | None:
        """Fly a longer path at the slowest speed or a little faster; lengths are tried until one fits."""
        length_m = self.crew.route.length_m + (arrive_s - self.slow_s) * self.slowest_m_s
        for _ in range(LONGER_TRIES):
            route = longer(self.name, length_m)
            if route is None:
                return None
            other = Craft(replace(self.crew, route=route))
            if other.fast_s - WITHIN_S <= arrive_s <= other.slow_s + WITHIN_S:
                more_m = route.length_m - self.crew.route.length_m
                slot = other.at(arrive_s, "none")
                assert slot is not None
                return other.fly(slot.speed_m_s, notes=[Note("flies_longer", more_m=more_m)])
            off_s = arrive_s - (other.slow_s if arrive_s > other.slow_s else 0.5 * (other.slow_s + other.fast_s))
            length_m += off_s * self.slowest_m_s
        return None


def _float32_range(low: float, high: float) -> tuple[float, float]:
    """The range of float32 numbers within a range; if it holds none, the nearest one twice."""
    inside_low, inside_high = np.float32(low), np.float32(high)
    if float(inside_low) < low:
        inside_low = np.nextafter(inside_low, np.float32(math.inf))
    if float(inside_high) > high:
        inside_high = np.nextafter(inside_high, np.float32(0.0))
    if inside_low > inside_high:
        return float(np.float32(high)), float(np.float32(high))
    return float(inside_low), float(inside_high)


def _speed_notes(vehicle: Vehicle, speed_m_s: float) -> list[Note]:
    """The lean that an ArduCopter needs: for the speed in still air, and as far as forecasts in wind count."""
    if vehicle.autopilot is not Autopilot.ARDUCOPTER:
        return []
    lean_deg = max(math.ceil(lean_for_deg(speed_m_s) - WITHIN_LEAN_DEG), round(lean_needed_deg(speed_m_s)))
    counts_deg = vehicle.lean_angle_deg or 0.0
    notes = []
    if lean_deg > LARGEST_LEAN_DEG:
        return [Note("lean_beyond_largest", speed_m_s=speed_m_s, largest_deg=LARGEST_LEAN_DEG)]
    if lean_deg > DEFAULT_LEAN_DEG:
        notes.append(
            Note(
                "lean_to_set", speed_m_s=speed_m_s, lean_deg=lean_deg, parameter=lean_words(lean_deg, vehicle.autopilot)
            )
        )
    if counts_deg > max(lean_deg, DEFAULT_LEAN_DEG):
        notes.append(
            Note("lean_counted_with", lean_deg=counts_deg, parameter=lean_words(counts_deg, vehicle.autopilot))
        )
    return notes


@dataclass(frozen=True, eq=False, slots=True)
class Schedule:
    """Slots in the order of ``order``: by arrival for sequence and none, as requested for together.

    ``left_out`` has the reason for each vehicle without a slot; its turn stays empty.
    """

    mode: Mode
    order: tuple[str, ...]
    slots: tuple[Slot, ...]
    interval_s: float = 0.0
    left_out: tuple[NoSchedule, ...] = ()

    def of(self, name: str) -> Slot:
        """The slot of a vehicle."""
        return next(s for s in self.slots if s.name == name)

    @property
    def energy_j(self) -> float:
        """Energy of all flights, J."""
        return sum(s.energy_j for s in self.slots)


class NoSchedule(NoMission):
    """The vehicles cannot arrive as requested; ``vehicle`` names the one that cannot.

    ``interval_s`` is the smallest interval with which the same order works, ``arrive_s`` the earliest clock (the first
    arrival of a sequence, the common arrival of ``together``); None if there is none.
    """

    def __init__(
        self, message: str, *, vehicle: str, interval_s: float | None = None, arrive_s: float | None = None
    ) -> None:
        super().__init__(message, reason="time")
        self.vehicle = vehicle
        self.interval_s = interval_s
        self.arrive_s = arrive_s


def schedule(
    crews: Sequence[Crew | Craft],
    mode: Mode,
    *,
    order: Sequence[str] | Literal["best"] | None = None,
    interval_s: float = 0.0,
    hold: Hold = "ground",
    clock: Clock = "fleet",
    arrive_s: float | None = None,
    longer: Longer | None = None,
    leave_out: bool = False,
) -> Schedule:
    """Departures and speeds with which the fleet arrives as requested.

    ``mode``: ``sequence`` is in ``order`` (names; None: as in ``crews``; ``best``: the order that finishes earliest,
    exact, see `best_order`), ``interval_s`` apart; ``together`` has a common arrival; with ``none`` all leave at
    once, at their fastest. With ``arrive_s``, the first of a sequence, or all together, arrive then. Without it,
    together arrives when the slowest can at its fastest, and a sequence begins as early as all can follow
    (``clock="fleet"``: the first at its fastest, or later if another one could not keep its turn), or with the first at
    its fastest whatever the others can (``clock="first"``).
    A vehicle that must come later than its slowest speed allows leaves later (``hold="ground"``: costs nothing), or all
    leave at once and it holds at the gate (``gate``: multicopters; costs ``hover_w``), or nobody waits (``none``). If
    it cannot wait, ``longer(name, length_m)`` is called for a path of that length.

    Raises NoSchedule if a vehicle cannot comply, with the smallest interval or the earliest arrival that works. With
    ``leave_out`` only if none can; otherwise the others keep their turns, and ``left_out`` has the errors.
    """
    craft = [c if isinstance(c, Craft) else Craft(c) for c in crews]
    if not craft or len({c.name for c in craft}) != len(craft):
        raise ValueError("a schedule needs vehicles of different names")
    if mode == "none":
        slots = sorted((c.fly(c.fastest_m_s) for c in craft), key=lambda s: s.arrive_s)
        return Schedule(mode, tuple(s.name for s in slots), tuple(slots))
    craft = _ordered(craft, mode, order, interval_s, hold, clock, arrive_s, longer)
    step_s = interval_s if mode == "sequence" else 0.0
    fast = np.array([c.fast_s for c in craft])
    if arrive_s is not None:
        first_s = arrive_s
    elif mode == "together" or clock == "fleet":
        first_s = float((fast - np.arange(len(craft)) * step_s).max())
    else:
        first_s = float(fast[0])
    slots = []
    left_out: list[NoSchedule] = []
    for turn, one in enumerate(craft):
        slot = one.at(first_s + turn * step_s, hold, longer)
        if slot is None:
            cures = len(left_out) < EXPLAINED
            left_out.append(_refusal(craft, turn, mode, step_s, hold, clock, arrive_s, first_s, cures=cures))
            if not leave_out:
                raise left_out[0]
        else:
            slots.append(slot)
    if not slots:
        raise left_out[0]
    leads = slots[0].name == craft[0].name
    if leads and mode == "sequence" and arrive_s is None and first_s > craft[0].fast_s + WITHIN_S:
        slots[0] = replace(slots[0], notes=(*slots[0].notes, _why_later(craft, first_s, step_s)))
    return Schedule(mode, tuple(s.name for s in slots), tuple(slots), step_s, tuple(left_out))


def _why_later(craft: Sequence[Craft], first_s: float, step_s: float) -> Note:
    last = craft[max(range(len(craft)), key=lambda k: craft[k].fast_s - k * step_s)]
    return Note(
        "first_waits_for", arrive_s=first_s, alone_s=craft[0].fast_s, last=last.name, needs_s=last.fast_s
    )  # fmt: skip


def _least_interval(craft: Sequence[Craft], hold: Hold, clock: Clock, arrive_s: float | None) -> float | None:
    fast, latest = np.array([c.fast_s for c in craft]), np.array([c.latest_s(hold) for c in craft])
    low, high = interval_range(fast, latest, clock, arrive_s)
    return low if low <= high + WITHIN_S else None


def _by_name(craft: Sequence[Craft], order: Sequence[str] | None) -> list[Craft]:
    if order is None:
        return list(craft)
    known: Mapping[str, Craft] = {c.name: c for c in craft}
    if sorted(order) != sorted(known):
        raise ValueError(f"an order names every vehicle once: {', '.join(known)}; given {', '.join(order)}")
    return [known[name] for name in order]


def _ordered(
    craft: list[Craft], mode: Mode, order: Sequence[str] | None, interval_s: float, hold: Hold, clock: Clock,
    arrive_s: float | None, longer: Longer | None,
) -> list[Craft]:  # fmt: skip
    if order != "best":
        return _by_name(craft, order)
    if mode != "sequence":
        return craft
    return _best(craft, interval_s, hold, clock, arrive_s, longer) or sorted(craft, key=lambda c: c.fast_s)


def _best(
    craft: Sequence[Craft], interval_s: float, hold: Hold, clock: Clock, arrive_s: float | None, longer: Longer | None
) -> list[Craft] | None:
    fast, slow = np.array([c.fast_s for c in craft]), np.array([c.slow_s for c in craft])
    latest = np.array([math.inf if longer is not None else c.latest_s(hold) for c in craft])
    watts = np.array([c.waiting_w(hold) for c in craft])

    def joules(times: Floats) -> Floats:
        cost: Floats = watts[:, None] * np.maximum(times[None, :] - slow[:, None], 0.0)
        return cost

    found = best_order(fast, latest, interval_s, clock, arrive_s, joules)
    return None if found is None else [craft[k] for k in found]


def _refusal(
    craft: Sequence[Craft], turn: int, mode: Mode, step_s: float, hold: Hold, clock: Clock, arrive_s: float | None,
    first_s: float, *, cures: bool,
) -> NoSchedule:  # fmt: skip
    """The NoSchedule with the reason why this turn cannot be kept and, with ``cures``, with cures."""
    one, at_s = craft[turn], first_s + turn * step_s
    late = at_s < one.fast_s
    what = f"the common arrival is {at_s:.1f} s" if mode == "together" else f"its turn is {at_s:.1f} s"
    speed_m_s, needs_s = (one.fastest_m_s, one.fast_s) if late else (one.slowest_m_s, one.slow_s)
    why = f"{one.name} cannot arrive {'in time' if late else 'so late'}: {what} after the start, and at its "
    why += f"{'fastest' if late else 'slowest'} ({speed_m_s:g} m/s) it needs {needs_s:.1f} s"
    if not late:
        why += "; nobody may wait" if hold == "none" else f"; {_cannot_wait(one, at_s)}"
    if not cures:
        return NoSchedule(why, vehicle=one.name)
    fast, latest = np.array([c.fast_s for c in craft]), np.array([c.latest_s(hold) for c in craft])
    earliest = earliest_first(fast, latest, step_s)
    interval = _least_interval(craft, hold, clock, arrive_s) if mode == "sequence" else None
    words = []
    if mode == "together":
        words.append(
            "there is no common arrival of all" if earliest is None
            else f"the earliest common arrival is arrive_s: {_up(earliest)}"
        )  # fmt: skip
    else:
        low, high = interval_range(fast, latest, clock, arrive_s)
        if interval is None:
            words.append("no interval_s works in this order")
        elif late:
            words.append(f"the earliest feasible interval_s is {_up(interval)}")
        else:
            words.append(f"an interval_s from {_up(low)} to {math.floor(high * 1e3 + 1e-6) / 1e3:.3f} works")
        if earliest is not None:
            words.append(f"with this interval all can follow a first at {_up(earliest)} s (clock: fleet)")
        if _best(craft, step_s, hold, clock, arrive_s, None) is not None:
            words.append("order: best finds an order that works")
    if hold != "ground" and not late:
        words.append("hold: ground lets it leave later")
    if interval is not None or earliest is not None:
        words.append("only times are compared here, neither batteries nor separation")
    return NoSchedule(f"{why}; {'; '.join(words)}", vehicle=one.name, interval_s=interval, arrive_s=earliest)


def _cannot_wait(one: Craft, at_s: float) -> str:
    if one.vehicle.can_hold:
        return f"a hold is at most {LONGEST_HOLD_S:.0f} s"
    why, circle_s = f"{one.vehicle.autopilot} cannot hold in the air for a set time", one.circle_s
    if circle_s is None:
        return why
    slow_s, fast_s = circle_s
    count = math.ceil((at_s - one.slow_s) / slow_s)
    fits = one.fast_s + count * fast_s <= at_s
    return (
        f"{why}, and no longer path was found; "
        + (f"{count} whole circle{'' if count == 1 else 's'} " if fits else "whole circles ")
        + f"of {one.vehicle.turn_radius_m:g} m ({fast_s:.1f} to {slow_s:.1f} s each) "
        + ("would take so long, but it " if fits else "do not fit, and it ")
        + "leaves a circle only on the heading of its next leg, up to one circle later: none is planned"
    )


def _up(seconds: float) -> str:
    """Milliseconds, rounded up, so that a value that a user copies works."""
    return f"{math.ceil(seconds * 1e3 - 1e-6) / 1e3:.3f}"
