"""The intervals between arrivals over all declared winds, and the departures that centre them on the requested ones.

One wind blows for the whole fleet, so an interval is bounded by the drifts of its two vehicles in the same wind
(`gcsplan.wind.drift`). [Winds](docs/concepts/wind.md) has the definitions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np

from gcsplan.arrays import Bools
from gcsplan.fleet.arrival import Mode, Schedule, Slot
from gcsplan.wind.drift import Drifts, between

__all__ = ["Interval", "centred", "intervals", "steadiest"]

MOST_ORDER_STEPS = 100_000
"""Steps of the search for one order: enough for every order of 8 vehicles."""
AGREES_S = 1e-3
"""Seconds by which an interval may be beyond its window: a time table is in float32 speeds."""


@dataclass(frozen=True, slots=True)
class Interval:
    """How long after the first of two vehicles the second arrives at least and at most, over all winds, s.

    ``requested_s``: as the mission file requests.
    """

    first: str
    second: str
    requested_s: float
    least_s: float
    most_s: float

    @property
    def off_s(self) -> float:
        """By how much it differs from the requested one at most, s."""
        return max(self.requested_s - self.least_s, self.most_s - self.requested_s)

    @property
    def width_s(self) -> float:
        """The smallest window that any departures of these two flights could keep, s."""
        return 0.5 * (self.most_s - self.least_s)

    def kept(self, mode: Mode, window_s: float) -> bool:
        """Whether the order holds in every wind, and the interval within ``window_s``."""
        ordered = self.least_s >= -AGREES_S or mode != "sequence"
        return ordered and self.off_s <= window_s + AGREES_S


def intervals(requested: Schedule, slots: Sequence[Slot], drifts: Mapping[str, Drifts]) -> list[Interval]:
    """The intervals of neighbours in a sequence, in its order, or of each two that are to arrive together; else none.

    ``requested`` has the arrivals that are requested, ``slots`` are flown; ``drifts``: of each vehicle's arrival (1).
    """
    turn_s = {slot.name: slot.arrive_s for slot in requested.slots}
    table_s = {slot.name: slot.arrive_s for slot in slots}
    names = [slot.name for slot in requested.slots if slot.name in table_s]
    pairs = pairwise(names) if requested.mode == "sequence" else combinations(names, 2)
    found = []
    for a, b in pairs if requested.mode != "none" else ():
        low, high = between(drifts[a], drifts[b])
        least_s, most_s = (table_s[b] - table_s[a] + float(s[0]) for s in (low, high))
        found.append(Interval(a, b, turn_s[b] - turn_s[a], least_s, most_s))
    return found


def centred(requested: Schedule, plan: Schedule, drifts: Mapping[str, Drifts], *, later: bool = True) -> Schedule:
    """``plan`` with the departures at which each interval is as much too long in one wind as too short in another.

    ``requested`` has the arrivals of the request. With ``later`` all leave later if one would leave before the common
    start; otherwise no vehicle leaves earlier.
    """
    if plan.mode == "none" or not plan.slots:
        return plan
    turn_s = {slot.name: slot.arrive_s for slot in requested.slots}
    slots = {slot.name: slot for slot in plan.slots}
    names = [slot.name for slot in requested.slots if slot.name in slots]
    at_s = {names[0]: slots[names[0]].arrive_s}
    for before, name in pairwise(names):
        beside = before if plan.mode == "sequence" else names[0]
        low, high = between(drifts[beside], drifts[name])
        at_s[name] = at_s[beside] + turn_s[name] - turn_s[beside] - 0.5 * float(low[0] + high[0])
    moved_s = {name: at_s[name] - slot.arrive_s for name, slot in slots.items()}
    early_s = -min(slot.depart_s + moved_s[name] for name, slot in slots.items())
    wait_s = max(early_s, 0.0) if later else 0.0
    return replace(
        plan,
        slots=tuple(_moved(slot, max(moved_s[slot.name] + wait_s, -slot.depart_s)) for slot in plan.slots),
    )


def steadiest(names: Sequence[str], drifts: Mapping[str, Drifts], enough_s: float) -> list[str]:
    """An order of a sequence, as near to ``names`` as may be, in which no interval needs a wider window than
    ``enough_s``; if there is none, the one whose widest interval is the narrowest.

    Exact up to 8 vehicles; of more, the search may end before it has found an order.
    """
    width_s = np.zeros((len(names), len(names)))
    for i, j in combinations(range(len(names)), 2):
        low, high = between(drifts[names[i]], drifts[names[j]])
        width_s[i, j] = width_s[j, i] = 0.5 * float(high[0] - low[0])
    tried_s = [enough_s, *(s for s in np.unique(width_s).tolist() if s > enough_s)]
    found = _way_through(width_s <= tried_s[0])
    first, last = 1, len(tried_s) - 1
    if found is None:
        found = list(range(len(names)))  # within the widest of all
        while first < last:
            middle = (first + last) // 2
            one = _way_through(width_s <= tried_s[middle])
            found, first, last = (found, middle + 1, last) if one is None else (one, first, middle)
    return [names[k] for k in found]


def _way_through(beside: Bools) -> list[int] | None:
    """The first order of all rows in which neighbours are ``beside`` each other; None if none is found."""
    count, way, visited, dead = len(beside), list[int](), 0, set[tuple[int, int]]()
    ahead = [iter(range(count))]
    for _ in range(MOST_ORDER_STEPS):
        row = next(ahead[-1], None)
        if row is None:
            if not way:
                return None
            ahead.pop()
            dead.add((visited, way[-1]))  # no order of the others follows it
            visited ^= 1 << way.pop()
        elif not visited >> row & 1 and (not way or beside[way[-1], row]) and (visited | 1 << row, row) not in dead:
            way.append(row)
            visited |= 1 << row
            if len(way) == count:
                return way
            ahead.append(iter(range(count)))
    return None


def _moved(slot: Slot, by_s: float) -> Slot:
    return slot if by_s == 0.0 else replace(slot, depart_s=slot.depart_s + by_s, arrive_s=slot.arrive_s + by_s)
