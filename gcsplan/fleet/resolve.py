"""Resolve conflicts by priority, at the least cost: by departure, speed, a hold or another path; or refuse.

Vehicles are fixed one after the other. A vehicle that meets an earlier one gets the cheapest change that keeps clear of
all earlier ones (`_settle`). In a fleet with fixed arrivals, a departure changes together with the speed, so that
the arrival stays. If nothing helps, the refusal names the two vehicles, the place and the time, and, if the goals are
the reason, the smallest interval or distance of goals that works. At the end `separation` judges the whole fleet.

Vehicles whose ways never come near each other form groups of their own, and the conflicts of each group are resolved on
their own. A group is found by the corners of the flights, without their times. Corners are cut in flight and other
paths may be taken, so that the separation of the whole fleet decides at the end: groups that meet are joined and fixed
again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import NoMission
from gcsplan.fleet._settle import (
    LATER_S,
    REROUTE_ATTEMPTS,
    Again,
    Change,
    Job,
    Reroute,
    Settlement,
    Stuck,
    maker,
    motion_of,
    moved,
    settle,
    with_leaving,
)
from gcsplan.fleet._taken import Taken
from gcsplan.fleet.arrival import EXPLAINED, Crew, Hold, Schedule
from gcsplan.fleet.motion.timing import Route, TimedPath, flown_corners
from gcsplan.fleet.separation import TOLERANCE_M, AirPlace, Conflict, Rules, Separation, Where, in_metres, separation

__all__ = ["Again", "Change", "NotSeparated", "Reroute", "Resolved", "resolve"]


CORNERS_CUT_M = 60.0
"""Metres by which two flights together may leave the lines between their corners, about."""

JOINED = 6
"""Times that groups which meet are joined; then the whole fleet is one group."""

Groups = list[list[str]]

MANY = 12
"""Most vehicles for which the smallest interval is searched with the whole fleet."""

INTERVAL_STEP_S = 0.1
LONGER = 1.3
LONGEST_INTERVAL_S = 3600.0


@dataclass(frozen=True, eq=False, slots=True)
class Resolved:
    """A fleet that keeps its separation.

    ``schedule`` has every slot as it is flown, ``paths`` the motions in its order, ``changes`` the changes to vehicles,
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
    def place(self) -> AirPlace:
        """The middle between the two: east_m, north_m, amsl_m."""
        return self.conflict.worst.middle

    @property
    def time_s(self) -> float:
        """The time at which they are nearest, s."""
        return self.conflict.worst.time_s


def resolve(  # noqa: PLR0913 - options by name, each with a default
    plan: Schedule,
    crews: Sequence[Crew],
    rules: Rules,
    *,
    priority: Sequence[str] | None = None,
    hold: Hold = "ground",
    replan: Reroute | None = None,
    attempts: int = REROUTE_ATTEMPTS,
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
    job = Job(crews, rules, priority, hold, later_s, replan, attempts, leave_out)
    if not leave_out:
        _refuse_goals(plan, job, where)
    settled, judged, moved_s = settle_groups(plan, job)
    left_out = tuple(
        _refusal(plan, job, stuck, again or maker(plan, crews, hold), where, cures=k < EXPLAINED)
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


def _refuse_goals(plan: Schedule, job: Job, where: Where) -> None:
    """Refuse at once if two goals are so near that no departure, speed or path can help."""
    crews, rules = job.crews, job.rules
    by_name = {c.name: c for c in crews}
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
        pair = [motion_of(s, replace(by_name[s.name], route=s.route)) for s in (a, b)]
        conflicts = separation(pair, rules).conflicts
        if not conflicts:
            continue
        conflict = max(conflicts, key=lambda c: c.from_s)
        goals_m = least_goals_m(plan, crews, rules, (a.name, b.name), hold=job.hold) or rounded_up(rules.needed_m)
        raise NotSeparated(
            f"the goals of {a.name} and {b.name} are {flat:.1f} m apart, and {why}; {_words(rules)}: put the goals at "
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
    return ", or state how long a landed vehicle stands on its pad (arrival: {pad_clear_s: …})"


def _words(rules: Rules) -> str:
    more = []
    if rules.error_m > 0.0:
        more.append(f"{rules.error_m:g} m of error of each")
    if rules.window_s > 0.0:
        more.append(f"each up to {rules.window_s:g} s early or late")
    return f"separation_m is {rules.separation_m:g}" + (f" ({', '.join(more)})" if more else "")


def _refusal(plan: Schedule, job: Job, stuck: Stuck, again: Again, where: Where, *, cures: bool) -> NotSeparated:
    """Why a vehicle is stuck and, with ``cures``, the cures."""
    conflict, rules = stuck.conflict, job.rules
    words = f"{conflict.note(where)}; no departure, speed, hold or other path of {stuck.name} that was tried helps"
    interval, goals_m = None, None
    if stuck.at_goals and cures:
        goals_m = least_goals_m(plan, job.crews, rules, conflict.worst.vehicles, hold=job.hold, later_s=job.later_s)
        works = [] if goals_m is None else [f"goals at least {goals_m:g} m apart, each on the side it is reached from"]
        if plan.mode == "sequence":
            interval = least_interval_s(
                plan, job.crews, rules, hold=job.hold, later_s=job.later_s, again=again, between=conflict.worst.vehicles
            )
            if interval is not None:
                works.insert(0, f"interval_s {interval:g}{' or more' if len(plan.slots) > MANY else ''}")
        words += f"; what works: {', or '.join(works)}" if works else ""
    return NotSeparated(words, conflict=conflict, vehicle=stuck.name, interval_s=interval, goals_m=goals_m)


def settle_groups(plan: Schedule, job: Job) -> tuple[Settlement, Separation | None, float]:
    """Choices for all vehicles, group by group; the separation of all, and the delay that `moved` gave them, s.

    Without ``job.leave_out`` the first vehicle that is stuck ends this, and there is no separation.
    """
    groups = groups_of(plan, job.rules)
    known: dict[tuple[str, ...], Settlement] = {}
    for joined in range(JOINED + 1):
        for group in groups:
            if tuple(group) not in known:
                found = settle(*_part(plan, job, group))
                if found.stuck and not job.leave_out:
                    return found, None, 0.0
                known[tuple(group)] = found
        parts = [known[tuple(group)] for group in groups]
        choices = {name: choice for part in parts for name, choice in part.done.items()}
        if not choices:
            return Settlement({}, tuple(s for part in parts for s in part.stuck)), None, 0.0
        done, moved_s = moved({name: choices[name] for name in plan.order if name in choices})
        judged = separation([choice.option.path for choice in done.values()], job.rules)
        met = [c.worst.vehicles for c in judged.conflicts]
        if not met or len(groups) == 1:
            break
        groups = _joined(plan.order, [*groups, *met]) if joined < JOINED - 1 else [list(plan.order)]
    return Settlement(done, tuple(s for part in parts for s in part.stuck)), judged, moved_s


def groups_of(plan: Schedule, rules: Rules) -> Groups:
    """The names of vehicles whose ways lead past each other, in the order of the schedule, first groups first."""
    import shapely  # slow to import, and most plans have one vehicle

    lines = [shapely.LineString(flown_corners(slot.route)[:, :2]) for slot in plan.slots]
    near = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=rules.needed_m + CORNERS_CUT_M)
    names = [slot.name for slot in plan.slots]
    return _joined(names, ([names[a], names[b]] for a, b in near.T.tolist() if a < b))


def _joined(names: Sequence[str], together: Iterable[Sequence[str]]) -> Groups:
    """The least groups in which all of each of ``together`` are in one."""
    number = {name: k for k, name in enumerate(names)}
    head = np.arange(len(names))

    def root(k: int) -> int:
        while head[k] != k:
            head[k] = head[head[k]]
            k = int(head[k])
        return k

    for first, *others in together:
        for other in others:
            a, b = sorted((root(number[first]), root(number[other])))
            head[b] = a
    groups: dict[int, list[str]] = {}
    for name, k in number.items():
        groups.setdefault(root(k), []).append(name)
    return list(groups.values())


def _part(plan: Schedule, job: Job, group: Sequence[str]) -> tuple[Schedule, Job]:
    """The schedule and the arguments for some of the vehicles."""
    of = frozenset(group)
    slots = tuple(s for s in plan.slots if s.name in of)
    priority = None if job.priority is None else [n for n in job.priority if n in of]
    return (
        replace(plan, slots=slots, order=tuple(n for n in plan.order if n in of)),
        replace(job, crews=[c for c in job.crews if c.name in of], priority=priority),
    )


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
    current = [replace(c, route=plan.of(c.name).route) for c in crews]
    job = Job(current, rules, None, hold, later_s)
    make = again or maker(plan, current, hold)

    def works(tenths: int) -> bool:
        try:
            anew = make(tenths * INTERVAL_STEP_S)
        except NoMission:
            return False
        return not settle(anew, job).stuck

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
    own = [replace(c, route=plan.of(c.name).route) for c in crews if c.name in between]
    still = next(c.route.points[-1] for c in own if c.name == between[0])
    distance = rules.needed_m
    while distance <= 10.0 * rules.needed_m:
        tenths = rounded_up(distance)
        moved = [c if c.name == between[0] else replace(c, route=_ended(c.route, still, tenths)) for c in own]
        try:
            anew = maker(pair, moved, hold)(pair.interval_s)
            if not settle(anew, Job(moved, rules, None, hold, later_s)).stuck:
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
