"""Arrival schedules: departures, speeds and arrivals of fleets that arrive together or one after the other.

After Tan et al. 2023 ("Multi-UAV path planning based on IB-ABC with restricted planned arrival sequence"): all leave at
the same time. In a sequence the first flies at its fastest and sets the clock, `T_i = T_1 + (i - 1)·interval`;
together, the slowest sets it. The speeds follow, `v_i = L_i / T_i`. Here the time model of `timing` replaces `L / v`:
the speed is found as a root, since time never rises with speed.

A vehicle that would have to fly slower than its slowest speed leaves later (which costs nothing), holds at the gate, or
gets a longer path. If a vehicle is late even at its fastest, the first one waits; if that is not wanted
(``clock="first"``, as in the paper) or impossible, there is no schedule.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import NoMission
from gcsplan.fleet.craft import LONGEST_HOLD_S, Craft, Crew, Hold, Longer, Slot
from gcsplan.fleet.order import WITHIN_S, Clock, best_order, earliest_first, interval_range
from gcsplan.notes.note import Note

__all__ = [
    "WITHIN_S", "Clock", "Craft", "Crew", "Hold", "Longer", "Mode", "NoSchedule", "Schedule", "Slot",
    "schedule",
]  # fmt: skip

Mode = Literal["sequence", "together", "none"]

EXPLAINED = 3
"""Vehicles that are left out whose errors say what would work: finding it looks at the whole fleet."""


@dataclass(frozen=True, eq=False, slots=True)
class Schedule:
    """Slots in the order of ``order``: by arrival for sequence and none, as requested for together.

    ``left_out`` says of each vehicle without a slot why it cannot comply; its turn stays empty.
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
    crews: Sequence[Crew],
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
    exact, see `order.best_order`), ``interval_s`` apart; ``together`` has a common arrival; with ``none`` all leave at
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
    craft = [Craft(c) for c in crews]
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
    """The NoSchedule that says why this turn cannot be kept and, with ``cures``, what would work."""
    one, at_s = craft[turn], first_s + turn * step_s
    late = at_s < one.fast_s
    what = f"the common arrival is {at_s:.1f} s" if mode == "together" else f"its turn is {at_s:.1f} s"
    speed_m_s, needs_s = (one.fastest_m_s, one.fast_s) if late else (one.slowest_m_s, one.slow_s)
    why = f"{one.name} cannot arrive {'in time' if late else 'so late'}: {what} after the start, and at its "
    why += f"{'fastest' if late else 'slowest'} ({speed_m_s:g} m/s) it needs {needs_s:.1f} s"
    if not late:
        why += "; nobody may wait" if hold == "none" else f"; {_cannot_wait(one)}"
    if not cures:
        return NoSchedule(why, vehicle=one.name)
    fast, latest = np.array([c.fast_s for c in craft]), np.array([c.latest_s(hold) for c in craft])
    earliest = earliest_first(fast, latest, step_s)
    interval = _least_interval(craft, hold, clock, arrive_s) if mode == "sequence" else None
    said = []
    if mode == "together":
        said.append(
            "there is no common arrival of all" if earliest is None
            else f"the earliest common arrival is arrive_s: {_up(earliest)}"
        )  # fmt: skip
    else:
        low, high = interval_range(fast, latest, clock, arrive_s)
        if interval is None:
            said.append("no interval_s works in this order")
        elif late:
            said.append(f"the earliest feasible interval_s is {_up(interval)}")
        else:
            said.append(f"an interval_s from {_up(low)} to {math.floor(high * 1e3 + 1e-6) / 1e3:.3f} works")
        if earliest is not None:
            said.append(f"with this interval all can follow a first at {_up(earliest)} s (clock: fleet)")
        if _best(craft, step_s, hold, clock, arrive_s, None) is not None:
            said.append("order: best finds an order that works")
    if hold != "ground" and not late:
        said.append("hold: ground lets it leave later")
    if interval is not None or earliest is not None:
        said.append("only times are compared here, neither batteries nor separation")
    return NoSchedule(f"{why}; {'; '.join(said)}", vehicle=one.name, interval_s=interval, arrive_s=earliest)


def _cannot_wait(one: Craft) -> str:
    if one.vehicle.can_hold:
        return f"a hold is at most {LONGEST_HOLD_S:.0f} s"
    return f"{one.vehicle.autopilot} cannot hold in the air for a set time"


def _up(seconds: float) -> str:
    """Milliseconds, rounded up, so that a value that a user copies works."""
    return f"{math.ceil(seconds * 1e3 - 1e-6) / 1e3:.3f}"
