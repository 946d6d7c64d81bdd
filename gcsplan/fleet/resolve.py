"""Resolve conflicts by priority, at the least cost: by departure, speed, a hold or another path; or refuse.

Vehicles are fixed one after the other. A vehicle that meets one of those before it gets the cheapest change that keeps
clear of all of them (`_changes`). In a fleet with fixed arrivals, a departure changes together with the speed, so that
the arrival stays. If nothing helps, the refusal names the two vehicles, the place and the time, and, if the goals are
the reason, the smallest interval or distance of goals that works. At the end `separation` judges the whole fleet.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.errors import NoMission
from gcsplan.fleet._groups import settle_groups
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
    with_leaving,
)
from gcsplan.fleet.arrival import EXPLAINED, Crew, Hold, Schedule
from gcsplan.fleet.goals import MANY, least_goals_m, least_interval_s, rounded_up
from gcsplan.fleet.motion.timed_path import TimedPath
from gcsplan.fleet.separation import TOLERANCE_M, Conflict, Place, Rules, Separation, Where, in_metres, separation

__all__ = ["Again", "Change", "NotSeparated", "Replan", "Resolved", "resolve"]


@dataclass(frozen=True, eq=False, slots=True)
class Resolved:
    """A fleet that keeps its separation.

    ``schedule`` has every slot as it is flown, ``paths`` the motions in its order, ``changes`` what was changed,
    ``separation`` the exact judgement. ``later_s`` is the delay of all arrivals. ``left_out`` has an error for each
    vehicle that is left out.
    """

    schedule: Schedule
    paths: tuple[TimedPath, ...]
    changes: tuple[Change, ...]
    separation: Separation
    later_s: float = 0.0
    left_out: tuple[NotSeparated, ...] = ()


class NotSeparated(NoMission):
    """No possibility was found to keep two vehicles apart.

    ``conflict`` has the two vehicles, the places and the time; ``vehicle`` is the one that has to give way. If goals
    nearer than the needed distance are the reason, ``interval_s`` is the smallest interval that works, and ``goals_m``
    the distance of goals that works; both are None otherwise, or if none works.
    """

    def __init__(
        self,
        message: str,
        *,
        conflict: Conflict,
        vehicle: str = "",
        interval_s: float | None = None,
        goals_m: float | None = None,
    ) -> None:
        super().__init__(message, reason="separation")
        self.conflict, self.vehicle = conflict, vehicle
        self.interval_s = interval_s
        self.goals_m = goals_m

    @property
    def vehicles(self) -> tuple[str, str]:
        """The two vehicles that meet."""
        return self.conflict.worst.vehicles

    @property
    def place(self) -> Place:
        """The middle between the two: east_m, north_m, amsl_m."""
        return self.conflict.worst.middle

    @property
    def time_s(self) -> float:
        """The time at which they are nearest, s."""
        return self.conflict.worst.time_s


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
    leave_out: bool = False,
) -> Resolved:
    """Change ``plan`` until every two vehicles keep ``rules``.

    ``priority`` names all vehicles; the first has the right of way (None: the schedule's order; a vehicle that nothing
    helps may then be put before the one in its way). With mode sequence or together, all arrivals stay as scheduled,
    or, if that is too tight, all move by the same time of at most ``later_s`` (0: arrivals are fixed); with none they
    are free. ``hold`` is as in `arrival.schedule`: with ``ground`` departures may change, and if that does not help a
    multicopter holds at the gate; with ``gate`` all leave as scheduled; with ``none`` nobody waits. Vehicles whose
    route ends with ``none`` are gone on arrival. ``replan`` is called last. ``again(interval_s)`` makes a new schedule
    (None: from ``crews``).

    Vehicles that never come near each other are resolved in groups of their own. With ``leave_out`` a vehicle that
    nothing helps is left out, and its turn stays empty.

    Raises NotSeparated (NoMission, ``separation``); with ``leave_out`` only if no vehicle is left.
    """
    rules = with_leaving(rules, plan)
    if priority is not None and sorted(priority) != sorted(s.name for s in plan.slots):
        raise ValueError(f"a priority names every vehicle once: {', '.join(plan.order)}; given {', '.join(priority)}")
    ask = Ask(crews, rules, priority, hold, later_s, replan, attempts, leave_out)
    if not leave_out:
        _refuse_goals(plan, ask, where)
    settled, judged, moved_s = settle_groups(plan, ask)
    left_out = tuple(
        _refusal(plan, ask, stuck, again or maker(plan, crews, hold), where, cures=k < EXPLAINED)
        for k, stuck in enumerate(settled.stuck)
    )
    if judged is None:
        raise left_out[0]
    done = settled.done
    slots = tuple(done[s.name].option.slot for s in plan.slots if s.name in done)
    if plan.mode == "none":
        slots = tuple(sorted(slots, key=lambda s: s.arrive_s))
    paths = tuple(done[s.name].option.path for s in slots)
    changes = tuple(choice.change for choice in done.values() if choice.change is not None)
    if not judged.safe and not leave_out:  # a cross-check: shifts and judgement are computed independently
        worst = judged.conflicts[0]
        raise NotSeparated(f"{worst.note(where)}: resolving it failed", conflict=worst)
    timed = replace(plan, order=tuple(s.name for s in slots), slots=slots)
    return Resolved(timed, paths, changes, judged, moved_s, left_out)


# -- goals nearer than the separation, and refusals -------------------------------------------------------------------


def _refuse_goals(plan: Schedule, ask: Ask, where: Where) -> None:
    """Refuse at once if two goals are so near that no departure, speed or path can help."""
    crews, rules = ask.crews, ask.rules
    vehicles = {c.name: c.vehicle for c in crews}
    slots, needed = plan.slots, rules.needed_m - TOLERANCE_M
    goals = np.array([s.route.points[-1] for s in slots])
    first, second = np.triu_indices(len(slots), 1)
    apart = np.hypot(*(goals[first] - goals[second])[:, :2].T)
    for row in np.flatnonzero(apart < needed).tolist():
        i, j, flat = first[row], second[row], float(apart[row])
        a, b = slots[i], slots[j]
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
        goals_m = least_goals_m(plan, crews, rules, (a.name, b.name), hold=ask.hold) or rounded_up(rules.needed_m)
        raise NotSeparated(
            f"the goals of {a.name} and {b.name} are {flat:.1f} m apart, and {why}; {_asked(rules)}: put the goals at "
            f"least {goals_m:g} m apart{_other_cure(plan, ends)}; {conflict.note(where)}",
            conflict=conflict,
            vehicle=b.name,
            goals_m=goals_m,
        )


def _other_cure(plan: Schedule, ends: Set[str]) -> str:
    if plan.mode == "together":
        return ", or let them arrive in sequence (arrival: {mode: sequence})"
    if ends == {"loiter"}:
        return ", or let the first fly on (end: rtl)"
    return ", or say how long a landed vehicle stands on its pad (arrival: {pad_clear_s: …})"


def _asked(rules: Rules) -> str:
    more = []
    if rules.error_m > 0.0:
        more.append(f"{rules.error_m:g} m of error of each")
    if rules.window_s > 0.0:
        more.append(f"each up to {rules.window_s:g} s early or late")
    return f"separation_m is {rules.separation_m:g}" + (f" ({', '.join(more)})" if more else "")


def _refusal(plan: Schedule, ask: Ask, stuck: Stuck, again: Again, where: Where, *, cures: bool) -> NotSeparated:
    """Why a vehicle is stuck and, with ``cures``, what would work."""
    conflict, rules = stuck.conflict, ask.rules
    words = f"{conflict.note(where)}; no departure, speed, hold or other path of {stuck.name} that was tried helps"
    interval, goals_m = None, None
    if stuck.at_goals and cures:
        goals_m = least_goals_m(plan, ask.crews, rules, conflict.worst.vehicles, hold=ask.hold, later_s=ask.later_s)
        said = [] if goals_m is None else [f"goals at least {goals_m:g} m apart, each on the side it is reached from"]
        if plan.mode == "sequence":
            interval = least_interval_s(
                plan, ask.crews, rules, hold=ask.hold, later_s=ask.later_s, again=again, between=conflict.worst.vehicles
            )
            if interval is not None:
                said.insert(0, f"interval_s {interval:g}{' or more' if len(plan.slots) > MANY else ''}")
        words += f"; what works: {', or '.join(said)}" if said else ""
    return NotSeparated(words, conflict=conflict, vehicle=stuck.name, interval_s=interval, goals_m=goals_m)
