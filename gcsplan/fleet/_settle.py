"""Fix the vehicles' times one after the other, by priority; retry with a later clock or with other paths.

Each vehicle gets the cheapest change to its flight that keeps it clear of the vehicles before it. A change costs joules
beyond the scheduled flight, and seconds by which any time moves; energy is compared first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gcsplan.fleet._sweep import reach_of
from gcsplan.fleet._taken import Spans, Taken
from gcsplan.fleet.arrival import WITHIN_S, Craft, Crew, Hold, Mode, Schedule, Slot, schedule
from gcsplan.fleet.motion.timing import Route, TimedPath, speed_for
from gcsplan.fleet.separation import TOLERANCE_M, Conflict, Rules, conflicts_of
from gcsplan.notes.note import Note

How = Literal["as scheduled", "departure", "speed", "hold", "path"]

EARLIER_LATER_S = (1.0, 2.0, 3.0, 5.0, 8.0, 13.0, 21.0, 34.0, 55.0, 89.0, 144.0, 233.0)
"""Shifts of the departure to try, s, with the speed that keeps the arrival; then `EVENLY` over the whole range."""

EVENLY = 12
CLOSER = 4
"""Halvings between the last departure that conflicts and the first that does not."""

CHANGE_SPARE_M = 0.02
"""Metres that a changed flight keeps beyond the need, so that it passes when the mission is timed again and rounded."""

HOLDS_S = (2.0, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0)
SLOWER = (0.9, 0.8, 0.7, 0.6, 0.5)
LONG_S = 20.0
"""Change of departure, s, beyond which lower speeds are tried too. Speeds below `SLOWER` would block the others."""

HORIZONS_S = (40.0, 160.0, 640.0, math.inf)
"""Ranges in which the least change of departure is searched, one after the other, s."""


Reroute = Callable[[str, Sequence[Conflict], int], Route | None]
"""``replan(name, avoid, attempt)``: another route for a vehicle that keeps away from the places of ``avoid`` (or flies
higher). ``attempt`` counts from 1. None: no more ideas."""

Again = Callable[[float], Schedule]
"""``again(interval_s)``: the schedule of the sequence with that interval."""

REROUTE_ATTEMPTS = 4
PROMOTIONS, MOST_AGAIN = 3, 150
"""Most vehicles that may be put before the one in their way if nothing else helps them and no priority is set; and most
vehicles that are fixed again for one of them."""

LATER_S = 600.0
"""Seconds by which the whole fleet may arrive later if its clock leaves a vehicle no possibility to evade."""


@dataclass(frozen=True, eq=False, slots=True)
class Option:
    """One candidate flight: joules more than scheduled, seconds by which its times move, its slot and its motion.

    ``moved_s`` adds up how far departure or arrival (the larger) and the hold move.
    """

    extra_j: float
    moved_s: float
    how: How
    slot: Slot
    path: TimedPath

    @property
    def cost(self) -> tuple[float, float]:
        """The key to minimise: energy, then seconds."""
        return max(0.0, round(self.extra_j, 6)), self.moved_s


@dataclass(frozen=True, slots=True)
class Freedom:
    """The allowed changes. With ``mode`` sequence or together the arrival is fixed, with none it is free.

    No vehicle leaves before 0 s. If nothing else helps, one may leave up to ``before_s`` earlier; the whole fleet then
    starts, and arrives, that much later.
    """

    mode: Mode
    hold: Hold
    before_s: float = 0.0

    @property
    def keeps_arrival(self) -> bool:
        """Whether a change of departure goes with a change of speed."""
        return self.mode != "none"


class Chooser:
    """The options of one vehicle on one route, against the vehicles that have priority."""

    def __init__(self, crew: Crew, was: Slot, freedom: Freedom, taken: Taken) -> None:
        self.craft = Craft(crew)
        self.was, self.freedom, self.taken = was, freedom, taken

    def base(self) -> Option | None:
        """The flight as scheduled; on another route, one that keeps the arrival. None if that is impossible."""
        was, craft = self.was, self.craft
        if craft.crew.route is was.route:
            return Option(0.0, 0.0, "as scheduled", was, self._motion(was))
        if not self.freedom.keeps_arrival:
            slot = craft.fly(was.speed_m_s, was.depart_s, was.hold_s)
        else:
            found = craft.at(was.arrive_s, self.freedom.hold)
            early_s = was.arrive_s - craft.fast_s
            if found is None and self.freedom.hold == "ground" and -self.freedom.before_s <= early_s < 0.0:
                found = craft.fly(craft.fastest_m_s, early_s)  # too long for the time left: leave before all others
            if found is None:
                return None
            slot = found
        return self._option("path", slot)

    def best(self, base: Option) -> Option | None:
        """The cheapest tried option that keeps clear; None if none does."""
        if self.clear(base):
            return base
        if not self.freedom.keeps_arrival:
            found = self._delays(base)
        else:
            found = self._departures(base, 0.0)
            if found is None and self.freedom.before_s > 0.0:
                found = self._departures(base, -self.freedom.before_s)
        return self._holds(base) if found is None else found  # changes that cost nothing come first

    def clear(self, option: Option) -> bool:
        """Whether an option keeps clear of all vehicles with priority."""
        spare_m = 0.0 if option.how == "as scheduled" else CHANGE_SPARE_M
        return self.taken.forbidden(option.path, spare_m=spare_m).free(0.0)

    # -- the arrival is free ------------------------------------------------------------------------------------

    def _delays(self, base: Option) -> Option | None:
        """The least change of departure that keeps clear, exact; if long, lower speeds that move less are tried."""
        found = self._shifted(base, "departure")
        if found is not None and found.moved_s <= LONG_S:
            return found
        for part in SLOWER:
            slot = self.craft.fly(part * base.slot.speed_m_s, base.slot.depart_s, base.slot.hold_s)
            option: Option | None = self._option("speed", slot)
            assert option is not None
            if found is not None and option.moved_s >= found.moved_s:
                break  # a lower speed moves even more
            if not self.clear(option):
                option = None if found is not None else self._shifted(option, "speed")
            if option is not None and (found is None or option.cost < found.cost):
                found = option
        return found

    def _shifted(self, option: Option, how: How) -> Option | None:
        """The same flight, earlier or later by the least time that keeps clear."""
        if self.freedom.hold != "ground":
            return option if self.clear(option) else None
        last = max((p.end_s for p in self.taken.paths), default=0.0)
        reach_s = [reach_of(p, self.taken.rules.window_s) for p in (*self.taken.paths, option.path)]
        latest = max(last - option.path.begin_s, 0.0) + 2.0 * max(reach_s) + 1.0
        spans, low, high = Spans.none(), 0.0, 0.0
        for horizon in HORIZONS_S:
            earlier, later = max(-horizon, -option.slot.depart_s), min(horizon, latest)
            if later > high or high == 0.0:
                spans = spans.joined(self.taken.forbidden(option.path, high, later, CHANGE_SPARE_M))
            if earlier < low:
                spans = spans.joined(self.taken.forbidden(option.path, earlier, low, CHANGE_SPARE_M))
            low, high = earlier, later
            shift = spans.least(low, high)
            if shift is not None:
                slot = option.slot
                slot = replace(slot, depart_s=slot.depart_s + shift, arrive_s=slot.arrive_s + shift)
                moved = self._option("departure" if option.how == "as scheduled" else how, slot)
                return moved if self.clear(moved) else None
        return None

    # -- the arrival stays --------------------------------------------------------------------------------------

    def _departures(self, base: Option, earliest_s: float) -> Option | None:
        """The nearest other departure that keeps clear, at the speed that keeps the arrival."""
        if self.freedom.hold != "ground":
            return None
        low, high = self._range(base.slot.hold_s, earliest_s)
        now = base.slot.depart_s
        offsets = [s for step in EARLIER_LATER_S for s in (now + step, now - step)]
        tried = sorted({d for d in [*offsets, *np.linspace(low, high, EVENLY)] if low <= d <= high},
                       key=lambda d: (abs(d - now), -d))  # fmt: skip
        last = {True: now, False: now}
        for depart in tried:
            option = self._arriving(float(depart), base.slot.hold_s, "departure")
            if option is None:
                continue
            if self.clear(option):
                return self._closer(option, last[depart > now], float(depart), base.slot.hold_s)
            last[depart > now] = float(depart)
        return None

    def _closer(self, option: Option, bad_s: float, good_s: float, hold_s: float) -> Option:
        """The flight whose departure is, by a few halvings, as near as possible to ``bad_s``, one that conflicts."""
        for _ in range(CLOSER):
            middle = 0.5 * (bad_s + good_s)
            other = self._arriving(middle, hold_s, "departure")
            if other is not None and self.clear(other):
                option, good_s = other, middle
            else:
                bad_s = middle
        return option

    def _range(self, hold_s: float, earliest_s: float = 0.0) -> tuple[float, float]:
        """The range of departures that can keep the arrival with this hold; empty if the first is above the second."""
        arrive = self.was.arrive_s
        return max(earliest_s, arrive - self.craft.slow_s - hold_s), arrive - self.craft.fast_s - hold_s

    def _arriving(self, depart_s: float, hold_s: float, how: How) -> Option | None:
        """The flight that leaves near ``depart_s``, holds ``hold_s``, and arrives as scheduled; None if impossible."""
        craft, arrive = self.craft, self.was.arrive_s
        flight_s = arrive - depart_s - hold_s
        if not craft.fast_s - WITHIN_S <= flight_s <= craft.slow_s + WITHIN_S:
            return None
        speed = speed_for(craft.course.time_to_goal_s, flight_s, craft.slowest_m_s, craft.fastest_m_s, 1e-3)
        slot = craft.fly(speed, depart_s, hold_s)
        # The speed is a float32 from a coarse search; the departure corrects its error.
        depart = depart_s + arrive - slot.arrive_s
        if depart_s >= 0.0:
            depart = max(0.0, depart)
        slot = replace(slot, depart_s=depart, arrive_s=slot.arrive_s + depart - depart_s)
        return self._option(how, slot)

    # -- a hold at the gate -------------------------------------------------------------------------------------

    def _holds(self, base: Option) -> Option | None:
        if self.freedom.hold == "none" or not self.craft.vehicle.can_hold:
            return None
        found: Option | None = None
        for hold in HOLDS_S:
            for option in self._with_hold(base, hold):
                if (found is None or option.cost < found.cost) and self.clear(option):
                    found = option
            if found is not None and self.craft.vehicle.energy.hold_w() > 0.0:
                break  # a longer hold costs more
        return found

    def _with_hold(self, base: Option, hold_s: float) -> Iterator[Option]:
        was = base.slot
        total = was.hold_s + hold_s
        if not self.freedom.keeps_arrival:
            option = self._option("hold", self.craft.fly(was.speed_m_s, was.depart_s, total))
            yield option
            shifted = self._shifted(option, "hold")
            if shifted is not None:
                yield shifted
            return
        low, high = self._range(total)
        if high < low:
            return
        departs = (
            [0.0] if self.freedom.hold == "gate" else np.unique(np.append(np.linspace(low, high, 4), was.depart_s))
        )
        for depart in departs:
            if low <= depart <= high:
                option_or_none = self._arriving(float(depart), total, "hold")
                if option_or_none is not None:
                    yield option_or_none

    # -----------------------------------------------------------------------------------------------------------

    def _option(self, how: How, slot: Slot) -> Option:
        was = self.was
        moved = max(abs(slot.depart_s - was.depart_s), abs(slot.arrive_s - was.arrive_s))
        moved += abs(slot.hold_s - was.hold_s)
        return Option(slot.energy_j - was.energy_j, moved, how, slot, self._motion(slot))

    def _motion(self, slot: Slot) -> TimedPath:
        return self.craft.motion(slot)


@dataclass(frozen=True, eq=False, slots=True)
class Change:
    """A change to one vehicle's flight, and the first conflict that made it necessary."""

    name: str
    how: str
    was: Slot
    slot: Slot
    extra_j: float
    because: Conflict

    def note(self) -> Note:
        """The change, and the vehicle that it keeps clear of."""
        changes = []
        later_s = self.slot.depart_s - self.was.depart_s
        if abs(later_s) > 0.005:
            changes.append(Note("leaves_later" if later_s > 0.0 else "leaves_earlier", by_s=abs(later_s)))
        if abs(self.slot.speed_m_s - self.was.speed_m_s) > 0.005:
            changes.append(Note("flies_at", speed_m_s=self.slot.speed_m_s, was_m_s=self.was.speed_m_s))
        if self.slot.hold_s > self.was.hold_s:
            changes.append(Note("holds_longer", by_s=self.slot.hold_s - self.was.hold_s))
        if self.how == "path":
            changes.append(Note("takes_another_path"))
        if abs(self.extra_j) >= 1.0:
            changes.append(Note("needs_more_energy", more_j=self.extra_j))
        met = self.because.worst
        [other] = {*met.vehicles} - {self.name}
        return Note("keeps_clear", changes=tuple(changes), other=other, time_s=met.time_s, amsl_m=met.middle[2])


def maker(plan: Schedule, crews: Sequence[Crew], hold: Hold) -> Again:
    """A function that makes schedules like ``plan`` with another interval and the same first arrival."""
    first_s = min(s.arrive_s for s in plan.slots)

    def again(interval_s: float) -> Schedule:
        return schedule(crews, plan.mode, order=plan.order, interval_s=interval_s, hold=hold, arrive_s=first_s)

    return again


@dataclass(frozen=True, slots=True)
class Job:
    """The arguments of `resolve`, which stay the same over all tries."""

    crews: Sequence[Crew]
    rules: Rules
    priority: Sequence[str] | None
    hold: Hold
    later_s: float
    replan: Reroute | None = None
    attempts: int = 0
    leave_out: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class Stuck:
    """A vehicle that nothing helps, its first conflict, and the names of all that it meets.

    ``at_goals``: they meet where their goals are, so another order does not help either.
    """

    name: str
    conflict: Conflict
    others: tuple[str, ...]
    at_goals: bool


@dataclass(frozen=True, eq=False, slots=True)
class Choice:
    """How a vehicle flies, and the change that this needed."""

    option: Option
    change: Change | None

    def later(self, by_s: float) -> Choice:
        """The same choice ``by_s`` later, the flight before the change too."""
        option = replace(self.option, slot=_late(self.option.slot, by_s), path=self.option.path.delayed(by_s))
        if self.change is None:
            return Choice(option, None)
        return Choice(option, replace(self.change, slot=option.slot, was=_late(self.change.was, by_s)))


def _late(slot: Slot, by_s: float) -> Slot:
    return replace(slot, depart_s=slot.depart_s + by_s, arrive_s=slot.arrive_s + by_s)


ChoicesByName = dict[str, Choice]
"""Choices by name, in the order in which they were fixed."""


@dataclass(frozen=True, eq=False, slots=True)
class Settlement:
    """The choices of all vehicles but the ``stuck`` ones: at most one, unless vehicles may be left out."""

    done: ChoicesByName
    stuck: tuple[Stuck, ...] = ()


def settle(plan: Schedule, job: Job) -> Settlement:
    """Choices for all vehicles. Other paths are used only if nothing else helps.

    A vehicle may leave up to ``job.later_s`` before 0 s; see `moved`.
    """
    if job.replan is None:
        return _settle(plan, job, {})[0]
    found, before = _settle(plan, replace(job, replan=None, leave_out=False), {})
    return _settle(plan, job, before)[0] if found.stuck else found


def moved(settled: ChoicesByName) -> tuple[ChoicesByName, float]:
    """Delay all equally, so that no vehicle leaves before 0 s; returns the choices and the delay, s."""
    later = max(0.0, -min((choice.option.slot.depart_s for choice in settled.values()), default=0.0))
    return (settled if later <= 0.0 else {name: choice.later(later) for name, choice in settled.items()}), later


def _settle(plan: Schedule, job: Job, done: ChoicesByName) -> tuple[Settlement, ChoicesByName]:
    """Fix all in order; the first vehicles, in ``done``, stay as they are. Also returns the ones before any trouble.

    A vehicle that is stuck is moved before the vehicles in its way, if no priority is set and not too many are fixed
    again; else it is left out, or ends this.
    """
    order = list(plan.order if job.priority is None else job.priority)
    slots, crews = {s.name: s for s in plan.slots}, {c.name: c for c in job.crews}
    freedom = Freedom(plan.mode, job.hold, job.later_s)
    promoted: set[str] = set()
    left: list[Stuck] = []
    before: ChoicesByName | None = None
    taken, turn = _taken(job.rules, done), len(done)
    while turn < len(order):
        name = order[turn]
        was = slots[name]
        found = _choice(Chooser(replace(crews[name], route=was.route), was, freedom, taken), plan, job)
        if isinstance(found, Choice):
            done = done | {name: found}
            taken.add(found.option.path)
            turn += 1
            continue
        before = done if before is None else before
        order.pop(turn)
        first = min(order.index(other) for other in found.others)
        may = job.priority is None and not found.at_goals and name not in promoted
        if may and len(promoted) < PROMOTIONS and turn - first <= MOST_AGAIN:
            promoted.add(name)
            order.insert(first, name)
            done = {name: done[name] for name in order[:first]}
            taken, turn = _taken(job.rules, done), first
            continue
        left.append(found)
        if not job.leave_out:
            break
    return Settlement(done, tuple(left)), done if before is None else before


def _taken(rules: Rules, done: ChoicesByName) -> Taken:
    taken = Taken(rules)
    for choice in done.values():
        taken.add(choice.option.path)
    return taken


def _choice(chooser: Chooser, plan: Schedule, job: Job) -> Choice | Stuck:
    """The best option of one vehicle against the vehicles before it."""
    was, taken = chooser.was, chooser.taken
    base = chooser.base()
    assert base is not None
    best = chooser.best(base)
    if best is base:
        return Choice(base, None)
    met = _conflicts(base.path, taken)
    if best is None and job.replan is not None:
        best = _other_path(was.name, chooser, met, job.replan, job.attempts)
    if best is None:
        others = tuple({n for c in met for n in c.worst.vehicles} - {was.name})
        near_goals = [c for c in met if _at_goals(c, plan, job.rules)]  # no departure, speed or path can help these
        return Stuck(was.name, [*near_goals, *met][0], others, bool(near_goals))
    change = Change(was.name, best.how, was, best.slot, best.extra_j, met[0])
    best = replace(best, slot=replace(best.slot, notes=(*best.slot.notes, change.note())))
    return Choice(best, replace(change, slot=best.slot))


def _other_path(name: str, chooser: Chooser, met: Sequence[Conflict], replan: Reroute, attempts: int) -> Option | None:
    """The first route of ``replan`` on which some option keeps clear; None if there is none."""
    avoid = list(met)
    for attempt in range(1, attempts + 1):
        route = replan(name, tuple(avoid), attempt)
        if route is None:
            return None
        other = Chooser(replace(chooser.craft.crew, route=route), chooser.was, chooser.freedom, chooser.taken)
        base = other.base()
        if base is None:
            continue  # too long to arrive in time, or too short without waiting
        best = other.best(base)
        if best is not None:
            return replace(best, how="path")
        avoid += _conflicts(base.path, chooser.taken)
    return None


def _conflicts(path: TimedPath, taken: Taken) -> list[Conflict]:
    """The conflicts of a motion with the vehicles that have priority, by time."""
    spans = taken.forbidden(path)
    others = sorted(set(spans.who[spans.holds(0.0)].tolist()))
    return conflicts_of(path, [taken.paths[k] for k in others], taken.rules)


def _at_goals(conflict: Conflict, plan: Schedule, rules: Rules) -> bool:
    """Whether two vehicles meet near the goals of both."""
    goals = [plan.of(name).route.points[-1, :2] for name in conflict.worst.vehicles]
    apart = float(np.hypot(*(goals[0] - goals[1])))
    away = [float(np.hypot(*(np.array(p[:2]) - g))) for p, g in zip(conflict.worst.places, goals, strict=True)]
    return apart < rules.needed_m - TOLERANCE_M and max(away) < 2.0 * rules.needed_m


def with_leaving(rules: Rules, plan: Schedule) -> Rules:
    gone = frozenset(s.name for s in plan.slots if s.route.end == "none")
    return replace(rules, leaving=rules.leaving | gone)


def motion_of(slot: Slot, crew: Crew) -> TimedPath:
    return Craft(crew).motion(slot)
