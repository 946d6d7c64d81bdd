"""Cures for goals that are nearer to each other than the separation: the interval, or the goals' distance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import NoMission
from gcsplan.fleet._settle import LATER_S, Again, Ask, maker, motion_of, settle, with_leaving
from gcsplan.fleet._taken import Taken
from gcsplan.fleet.arrival import Crew, Hold, Schedule
from gcsplan.fleet.motion.timing import Route
from gcsplan.fleet.separation import Rules

MANY = 12
"""Most vehicles for which the smallest interval is searched with the whole fleet."""

INTERVAL_STEP_S = 0.1
LONGER = 1.3
LONGEST_INTERVAL_S = 3600.0


def least_interval_s(
    plan: Schedule,
    crews: Sequence[Crew],
    rules: Rules,
    *,
    hold: Hold = "ground",
    later_s: float = LATER_S,
    again: Again | None = None,
    between: tuple[str, str] | None = None,
) -> float | None:
    """The smallest interval of a sequence at which `resolve` succeeds without other paths; None if above an hour.

    It is a whole number of tenths of a second, not below the plan's own; a tenth less fails. It is searched around a
    guess with doubling steps, then by halving. Of more than `MANY` vehicles only the two named ``between`` are
    considered: the result is then necessary, and may not be enough for all.
    """
    rules = with_leaving(rules, plan)
    if len(plan.slots) > MANY and between is not None:
        apart = abs(plan.order.index(between[0]) - plan.order.index(between[1]))
        pair = _pair(plan, between)
        pair = replace(pair, interval_s=plan.interval_s * apart)
        two = [c for c in crews if c.name in between]
        found = least_interval_s(pair, two, rules, hold=hold, later_s=later_s, between=between)
        return None if found is None else rounded_up(found / apart)
    current = [Crew(c.vehicle, plan.of(c.name).route) for c in crews]
    ask = Ask(current, rules, None, hold, later_s)
    make = again or maker(plan, current, hold)

    def works(tenths: int) -> bool:
        try:
            anew = make(tenths * INTERVAL_STEP_S)
        except NoMission:
            return False
        return not settle(anew, ask).stuck

    floor = math.floor(plan.interval_s / INTERVAL_STEP_S + 1e-9)
    bad, good, step = floor, floor + max(1, _guess(plan, current, rules, between)), 1
    if works(good):
        while good - step > floor and works(good - step):
            good, step = good - step, 2 * step
        bad = max(floor, good - step)
    else:
        bad, good = good, good + step
        while not works(good):
            step *= 2
            bad, good = good, good + step
            if good * INTERVAL_STEP_S > LONGEST_INTERVAL_S:
                return None
    while good - bad > 1:
        middle = (good + bad) // 2
        good, bad = (middle, bad) if works(middle) else (good, middle)
    return round(good * INTERVAL_STEP_S, 1)


def _guess(plan: Schedule, crews: Sequence[Crew], rules: Rules, between: tuple[str, str] | None) -> int:
    """By how many tenths of a second to lengthen the interval at first: the delay that one of two vehicles needs."""
    if between is None:
        return 1
    by_name = {c.name: c for c in crews}
    first, second = (motion_of(s, by_name[s.name]) for s in plan.slots if s.name in between)
    taken = Taken(rules)
    taken.add(first)
    later = taken.forbidden(second, 0.0, LONGEST_INTERVAL_S).least(0.0, LONGEST_INTERVAL_S)
    apart = abs(plan.order.index(between[0]) - plan.order.index(between[1]))
    return 1 if later is None else math.ceil(later / apart / INTERVAL_STEP_S)


def least_goals_m(
    plan: Schedule,
    crews: Sequence[Crew],
    rules: Rules,
    between: tuple[str, str],
    *,
    hold: Hold = "ground",
    later_s: float = LATER_S,
) -> float | None:
    """A distance of two goals with which the two keep apart at the plan's interval, in metres; None if none was found.

    It is the needed separation, or the first beyond it that works, in steps of 30 %, up to ten times as much. Each is
    tried with the second's last point moved back from the first's goal towards its own start.
    """
    rules = with_leaving(rules, plan)
    pair = _pair(plan, between)
    own = [Crew(c.vehicle, plan.of(c.name).route) for c in crews if c.name in between]
    still = next(c.route.points[-1] for c in own if c.name == between[0])
    distance = rules.needed_m
    while distance <= 10.0 * rules.needed_m:
        tenths = rounded_up(distance)
        moved = [c if c.name == between[0] else Crew(c.vehicle, _ended(c.route, still, tenths)) for c in own]
        try:
            anew = maker(pair, moved, hold)(pair.interval_s)
            if not settle(anew, Ask(moved, rules, None, hold, later_s)).stuck:
                return tenths
        except NoMission:
            pass
        distance *= LONGER
    return None


def _pair(plan: Schedule, names: tuple[str, str]) -> Schedule:
    slots = tuple(s for s in plan.slots if s.name in names)
    return replace(plan, slots=slots, order=tuple(s.name for s in slots))


def _ended(route: Route, goal: Floats, distance_m: float) -> Route:
    """A route that ends ``distance_m`` short of a goal, on the side of its start."""
    points = route.points.copy()
    back = points[0, :2] - goal[:2]
    points[-1, :2] = goal[:2] + back * (distance_m / max(float(np.hypot(*back)), 1e-9))
    return replace(route, points=points)


def rounded_up(metres: float) -> float:
    """Tenths, rounded up, so that a value that a user copies works."""
    return math.ceil(metres * 10.0 - 1e-6) / 10.0
