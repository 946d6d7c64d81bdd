"""Fix the vehicles' times one after the other, by priority; retry with a later clock or with other paths."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.fleet._changes import Chooser, Freedom, Option
from gcsplan.fleet._taken import Taken
from gcsplan.fleet.arrival import Craft, Crew, Hold, Schedule, Slot, schedule
from gcsplan.fleet.motion.timed_path import TimedPath
from gcsplan.fleet.motion.timing import Route
from gcsplan.fleet.separation import TOLERANCE_M, Conflict, Rules, separation
from gcsplan.notes.note import Note

Replan = Callable[[str, Sequence[Conflict], int], Route | None]
"""``replan(name, avoid, attempt)``: another route for a vehicle that keeps away from the places of ``avoid`` (or flies
higher). ``attempt`` counts from 1. None: no more ideas."""

Again = Callable[[float], Schedule]
"""``again(interval_s)``: the schedule of the sequence with that interval."""

ATTEMPTS = 4
PROMOTIONS, MOST_AGAIN = 3, 150
"""Most vehicles that may be put before the one in their way if nothing else helps them and no priority is set; and most
vehicles that are fixed again for one of them."""

LATER_S = 600.0
"""Seconds by which the whole fleet may arrive later if its clock leaves a vehicle no possibility to evade."""


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
        """What changes, and which vehicle it keeps clear of."""
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
class Ask:
    """The arguments of `resolve`, which stay the same over all tries."""

    crews: Sequence[Crew]
    rules: Rules
    priority: Sequence[str] | None
    hold: Hold
    later_s: float
    replan: Replan | None = None
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


Settled = dict[str, Choice]
"""Choices by name, in the order in which they were fixed."""


@dataclass(frozen=True, eq=False, slots=True)
class Settlement:
    """The choices of all vehicles but those that are ``stuck``: at most one, unless vehicles may be left out."""

    done: Settled
    stuck: tuple[Stuck, ...] = ()


def settle(plan: Schedule, ask: Ask) -> Settlement:
    """Choices for all vehicles. Other paths are used only if nothing else helps.

    A vehicle may leave up to ``ask.later_s`` before 0 s; see `moved`.
    """
    if ask.replan is None:
        return _settle(plan, ask, {})[0]
    found, before = _settle(plan, replace(ask, replan=None, leave_out=False), {})
    return _settle(plan, ask, before)[0] if found.stuck else found


def moved(settled: Settled) -> tuple[Settled, float]:
    """Delay all equally, so that no vehicle leaves before 0 s; returns the choices and the delay, s."""
    later = max(0.0, -min((choice.option.slot.depart_s for choice in settled.values()), default=0.0))
    return (settled if later <= 0.0 else {name: choice.later(later) for name, choice in settled.items()}), later


def _settle(plan: Schedule, ask: Ask, done: Settled) -> tuple[Settlement, Settled]:
    """Fix all in order; those in ``done``, the first of them, stay as they are. Also returns those before any trouble.

    A vehicle that is stuck is moved before those in its way, if no priority is set and not too many are fixed again;
    else it is left out, or ends this.
    """
    order = list(plan.order if ask.priority is None else ask.priority)
    slots, vehicles = {s.name: s for s in plan.slots}, {c.name: c.vehicle for c in ask.crews}
    freedom = Freedom(plan.mode, ask.hold, ask.later_s)
    promoted: set[str] = set()
    left: list[Stuck] = []
    before: Settled | None = None
    taken, turn = _taken(ask.rules, done), len(done)
    while turn < len(order):
        name = order[turn]
        was = slots[name]
        found = _choice(Chooser(vehicles[name], was.route, was, freedom, taken), plan, ask)
        if isinstance(found, Choice):
            done = done | {name: found}
            taken.add(found.option.path)
            turn += 1
            continue
        before = done if before is None else before
        order.pop(turn)
        first = min(order.index(other) for other in found.others)
        may = ask.priority is None and not found.at_goals and name not in promoted
        if may and len(promoted) < PROMOTIONS and turn - first <= MOST_AGAIN:
            promoted.add(name)
            order.insert(first, name)
            done = {name: done[name] for name in order[:first]}
            taken, turn = _taken(ask.rules, done), first
            continue
        left.append(found)
        if not ask.leave_out:
            break
    return Settlement(done, tuple(left)), done if before is None else before


def _taken(rules: Rules, done: Settled) -> Taken:
    taken = Taken(rules)
    for choice in done.values():
        taken.add(choice.option.path)
    return taken


def _choice(chooser: Chooser, plan: Schedule, ask: Ask) -> Choice | Stuck:
    """The best option of one vehicle against those before it."""
    was, taken = chooser.was, chooser.taken
    base = chooser.base()
    assert base is not None
    best = chooser.best(base)
    if best is base:
        return Choice(base, None)
    met = _conflicts(base.path, taken)
    if best is None and ask.replan is not None:
        best = _other_path(was.name, chooser, met, ask.replan, ask.attempts)
    if best is None:
        others = tuple({n for c in met for n in c.worst.vehicles} - {was.name})
        near_goals = [c for c in met if _at_goals(c, plan, ask.rules)]  # what no departure, speed or path can help
        return Stuck(was.name, [*near_goals, *met][0], others, bool(near_goals))
    change = Change(was.name, best.how, was, best.slot, best.extra_j, met[0])
    best = replace(best, slot=replace(best.slot, notes=(*best.slot.notes, change.note())))
    return Choice(best, replace(change, slot=best.slot))


def _other_path(name: str, chooser: Chooser, met: Sequence[Conflict], replan: Replan, attempts: int) -> Option | None:
    """The first route of ``replan`` on which some option keeps clear; None if there is none."""
    avoid = list(met)
    for attempt in range(1, attempts + 1):
        route = replan(name, tuple(avoid), attempt)
        if route is None:
            return None
        other = Chooser(chooser.craft.vehicle, route, chooser.was, chooser.freedom, chooser.taken)
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
    judged = separation([path, *(taken.paths[k] for k in others)], taken.rules)
    return [c for c in judged.conflicts if path.name in c.worst.vehicles]


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
    return Craft(crew).course.fly(slot.speed_m_s, slot.depart_s, slot.hold_s)
