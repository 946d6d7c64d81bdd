"""Conflicts resolved in order of priority: departure, speed, a hold, another path; least cost first; or a refusal.

Vehicles are fixed one after the other. Who meets one of those before it is given the cheapest change that keeps clear
of all of them (`_changes`): in a fleet that arrives on time a departure changes together with the speed, so that the
arrival stays. What nothing helps is refused with the two vehicles, the place and the time, and, where goals are the
reason, with the smallest interval or distance of goals that works. The last word is `separation` of the whole fleet.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.errors import NoMission
from gcsplan.fleet._settle import (
    ATTEMPTS,
    LATER_S,
    Again,
    Ask,
    Change,
    Replan,
    Stuck,
    maker,
    motion_of,
    moved,
    settle,
    with_leaving,
)
from gcsplan.fleet.arrival import Crew, Hold, Schedule
from gcsplan.fleet.goals import MANY, least_goals_m, least_interval_s, rounded_up
from gcsplan.fleet.motion import TimedPath
from gcsplan.fleet.separation import TOLERANCE_M, Conflict, Place, Rules, Separation, Where, in_metres, separation

__all__ = [
    "Again", "Change", "NotSeparated", "Replan", "Resolved", "least_goals_m", "least_interval_s", "motions", "resolve",
]  # fmt: skip


@dataclass(frozen=True, eq=False, slots=True)
class Resolved:
    """A fleet that keeps its separation: the schedule with every slot as it is flown, the motions in its order, what
    was changed, the exact judgement, and by how much all arrive later."""

    schedule: Schedule
    paths: tuple[TimedPath, ...]
    changes: tuple[Change, ...]
    separation: Separation
    later_s: float = 0.0

    def notes(self, where: Where = in_metres) -> tuple[str, ...]:
        """What was changed, for people, a line each."""
        lines = [change.describe(where) for change in self.changes]
        if self.later_s > 0.0:
            lines.insert(
                0, f"all arrive {self.later_s:.1f} s later than the clock asks: it left somebody no room to evade"
            )
        return tuple(lines)


class NotSeparated(NoMission):
    """No way was found to keep two vehicles apart.

    ``conflict`` has the two, the places, the time; ``interval_s`` the smallest interval that works, and ``goals_m`` the
    distance of goals that works, where goals nearer than needed are the reason (else, or where none does, None).
    """

    def __init__(
        self, message: str, *, conflict: Conflict, interval_s: float | None = None, goals_m: float | None = None
    ) -> None:
        super().__init__(message, reason="separation")
        self.conflict = conflict
        self.interval_s = interval_s
        self.goals_m = goals_m

    @property
    def vehicles(self) -> tuple[str, str]:
        """The two that meet."""
        return self.conflict.worst.vehicles

    @property
    def place(self) -> Place:
        """Half-way between the two: east_m, north_m, amsl_m."""
        return self.conflict.worst.middle

    @property
    def time_s(self) -> float:
        """When they are nearest."""
        return self.conflict.worst.time_s


def motions(plan: Schedule, crews: Sequence[Crew]) -> tuple[TimedPath, ...]:
    """The motions of a schedule's slots, in its order."""
    vehicles = {c.name: c.vehicle for c in crews}
    return tuple(motion_of(s, Crew(vehicles[s.name], s.route)) for s in plan.slots)


def resolve(
    plan: Schedule,
    crews: Sequence[Crew],
    rules: Rules,
    *,
    priority: Sequence[str] | None = None,
    hold: Hold = "ground",
    replan: Replan | None = None,
    attempts: int = ATTEMPTS,
    later_s: float = LATER_S,
    again: Again | None = None,
    where: Where = in_metres,
) -> Resolved:
    """Change ``plan`` until every two vehicles keep ``rules``, whatever the vehicles before them in priority do.

    ``priority`` names all, first come first served (None: the schedule's order; then a vehicle that nothing helps may
    be put before the one in its way). With mode sequence or together all arrivals stay as scheduled, or, where that is
    too tight, all move by the same time of at most ``later_s`` (0: the clock stands); with none they are free.
    ``hold`` as in `arrival.schedule`: ``ground`` departures may change, and where that does not help a multicopter
    holds at the gate; ``gate`` all leave as scheduled; ``none`` nobody waits. Routes that end with ``none`` are gone on
    arrival. ``replan`` is called last. ``again(interval_s)`` makes a schedule anew (None: from ``crews``).

    Raises NotSeparated (NoMission, ``separation``).
    """
    rules = with_leaving(rules, plan)
    if priority is not None and sorted(priority) != sorted(s.name for s in plan.slots):
        raise ValueError(f"a priority names every vehicle once: {', '.join(plan.order)}; given {', '.join(priority)}")
    _refuse_goals(plan, crews, rules, hold, where)
    ask = Ask(crews, rules, priority, hold, later_s, replan, attempts)
    settled = settle(plan, ask)
    if isinstance(settled, Stuck):
        raise _refusal(plan, ask, settled, again or maker(plan, crews, hold), where)
    done, moved_s = moved(settled)
    slots = tuple(done[s.name].option.slot for s in plan.slots)
    if plan.mode == "none":
        slots = tuple(sorted(slots, key=lambda s: s.arrive_s))
    paths = tuple(done[s.name].option.path for s in slots)
    changes = tuple(choice.change for choice in done.values() if choice.change is not None)
    judged = separation(paths, rules)
    if not judged.safe:  # the shifts and the judgement are two ways to one answer
        worst = judged.conflicts[0]
        raise NotSeparated(f"{worst.describe(where)}: resolving it failed", conflict=worst)
    return Resolved(replace(plan, order=tuple(s.name for s in slots), slots=slots), paths, changes, judged, moved_s)


# -- goals nearer than the separation, and refusals -------------------------------------------------------------------


def _refuse_goals(plan: Schedule, crews: Sequence[Crew], rules: Rules, hold: Hold, where: Where) -> None:
    """Refuse at once what no departure, speed or path can help: where two of the fleet end up too near each other."""
    vehicles = {c.name: c.vehicle for c in crews}
    slots, needed = plan.slots, rules.needed_m - TOLERANCE_M
    goals = np.array([s.route.points[-1] for s in slots])
    for i, j in zip(*np.triu_indices(len(slots), 1), strict=True):
        a, b = slots[i], slots[j]
        flat = float(np.hypot(*(goals[i] - goals[j])[:2]))
        if flat >= needed:
            continue
        near = float(np.linalg.norm(goals[i] - goals[j])) < needed
        ends = {a.route.end, b.route.end}
        if plan.mode == "together" and near:
            why = "they are to be there at the same moment"
        elif ends == {"loiter"} and near:
            why = "both stay there"
        elif ends == {"land"} and math.isinf(rules.pad_clear_s):
            why = "both land there and stay"
        else:
            continue
        pair = [motion_of(s, Crew(vehicles[s.name], s.route)) for s in (a, b)]
        conflicts = separation(pair, rules).conflicts
        if not conflicts:
            continue
        conflict = max(conflicts, key=lambda c: c.from_s)
        goals_m = least_goals_m(plan, crews, rules, (a.name, b.name), hold=hold) or rounded_up(rules.needed_m)
        raise NotSeparated(
            f"the goals of {a.name} and {b.name} are {flat:.1f} m apart, and {why}; {_asked(rules)}: put the goals at "
            f"least {goals_m:g} m apart{_other_cure(plan, ends)}; {conflict.describe(where)}",
            conflict=conflict,
            goals_m=goals_m,
        )


def _other_cure(plan: Schedule, ends: Set[str]) -> str:
    if plan.mode == "together":
        return ", or let them arrive in sequence"
    return ", or let the first fly on (end: rtl)" if ends == {"loiter"} else ", or say when a pad is cleared"


def _asked(rules: Rules) -> str:
    more = []
    if rules.error_m > 0.0:
        more.append(f"{rules.error_m:g} m of error of each")
    if rules.window_s > 0.0:
        more.append(f"each up to {rules.window_s:g} s early or late")
    return f"separation_m is {rules.separation_m:g}" + (f" ({', '.join(more)})" if more else "")


def _refusal(plan: Schedule, ask: Ask, stuck: Stuck, again: Again, where: Where) -> NotSeparated:
    conflict, rules = stuck.conflict, ask.rules
    words = f"{conflict.describe(where)}; no departure, speed, hold or other path of {stuck.name} that was tried helps"
    interval, goals_m = None, None
    if stuck.at_goals:
        goals_m = least_goals_m(plan, ask.crews, rules, conflict.worst.vehicles, hold=ask.hold, later_s=ask.later_s)
        cures = [] if goals_m is None else [f"goals at least {goals_m:g} m apart, each on the side it is reached from"]
        if plan.mode == "sequence":
            interval = least_interval_s(
                plan, ask.crews, rules, hold=ask.hold, later_s=ask.later_s, again=again, between=conflict.worst.vehicles
            )
            if interval is not None:
                cures.insert(0, f"interval_s {interval:g}{' or more' if len(plan.slots) > MANY else ''}")
        words += f"; what works: {', or '.join(cures)}" if cures else ""
    return NotSeparated(words, conflict=conflict, interval_s=interval, goals_m=goals_m)
