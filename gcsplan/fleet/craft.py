"""The arrivals that one vehicle can reach, and how it flies to arrive at a requested time.

It flies slower. If that would be slower than its slowest speed, it leaves later, holds at the gate, or gets a longer
path.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gcsplan.fleet.motion.lean import lean_needed_deg
from gcsplan.fleet.motion.timing import Course, Route, speed_for
from gcsplan.fleet.order import WITHIN_S
from gcsplan.notes.note import Note
from gcsplan.vehicle import DEFAULT_LEAN_DEG, LARGEST_LEAN_DEG, Autopilot, Vehicle, lean_for_deg, lean_words

Hold = Literal["ground", "gate", "none"]
Longer = Callable[[str, float], Route | None]

LONGEST_HOLD_S = 65535.0
"""Longest hold, s: ArduPilot stores whole seconds in 16 bits, and a hold of 70000 s came back as 4464."""

LONGER_TRIES = 4

WITHIN_LEAN_DEG = 0.01
"""Degrees by which a lean angle may fall short, since speeds are float32 numbers."""


@dataclass(frozen=True, slots=True)
class Crew:
    """One vehicle and its route."""

    vehicle: Vehicle
    route: Route

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
        self.slowest_m_s, self.fastest_m_s = _float32_range(crew.vehicle.speed_min_m_s, crew.vehicle.speed_max_m_s)
        self.fast_s = self.course.time_to_goal_s(self.fastest_m_s)
        self.slow_s = self.course.time_to_goal_s(self.slowest_m_s)

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
        said = (*notes, *_speed_notes(self.vehicle, speed))
        return Slot(self.name, depart_s, hold_s, speed, arrive_s, joules, self.crew.route, said)

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
        wanted_m = self.crew.route.length_m + (arrive_s - self.slow_s) * self.slowest_m_s
        for _ in range(LONGER_TRIES):
            route = longer(self.name, wanted_m)
            if route is None:
                return None
            other = Craft(Crew(self.vehicle, route))
            if other.fast_s - WITHIN_S <= arrive_s <= other.slow_s + WITHIN_S:
                more_m = route.length_m - self.crew.route.length_m
                slot = other.at(arrive_s, "none")
                assert slot is not None
                return other.fly(slot.speed_m_s, notes=[Note("flies_longer", more_m=more_m)])
            off_s = arrive_s - (other.slow_s if arrive_s > other.slow_s else 0.5 * (other.slow_s + other.fast_s))
            wanted_m += off_s * self.slowest_m_s
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
    """What an ArduCopter must be able to lean: for the speed in still air, and as far as forecasts in wind count."""
    if vehicle.autopilot is not Autopilot.ARDUCOPTER:
        return []
    lean_deg = max(math.ceil(lean_for_deg(speed_m_s) - WITHIN_LEAN_DEG), round(lean_needed_deg(speed_m_s)))
    counts_deg = vehicle.lean_angle_deg or 0.0
    notes = []
    if lean_deg > LARGEST_LEAN_DEG:
        return [Note("lean_beyond_largest", speed_m_s=speed_m_s, largest_deg=LARGEST_LEAN_DEG)]
    if lean_deg > DEFAULT_LEAN_DEG:
        notes.append(Note("lean_to_set", speed_m_s=speed_m_s, lean_deg=lean_deg, parameter=lean_words(lean_deg)))
    if counts_deg > max(lean_deg, DEFAULT_LEAN_DEG):
        notes.append(Note("lean_counted_with", lean_deg=counts_deg, parameter=lean_words(counts_deg)))
    return notes
