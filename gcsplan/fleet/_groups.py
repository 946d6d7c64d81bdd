"""Groups of vehicles whose ways never come near each other: the conflicts of each group are resolved on their own.

A group is found by the corners of the flights, without their times. Corners are cut in flight and other paths may be
taken, so that the separation of the whole fleet decides at the end: groups that meet are joined and fixed again.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from gcsplan.fleet._settle import Ask, Settlement, moved, settle
from gcsplan.fleet.arrival import Schedule
from gcsplan.fleet.motion.timing import flown_corners
from gcsplan.fleet.separation import Rules, Separation, separation

CUT_M = 60.0
"""Metres by which two flights together may leave the lines between their corners, about."""

JOINED = 6
"""Times that groups which meet are joined; then the whole fleet is one group."""

Groups = list[list[str]]


def settle_groups(plan: Schedule, ask: Ask) -> tuple[Settlement, Separation | None, float]:
    """Choices for all vehicles, group by group; the separation of all, and the delay that `moved` gave them, s.

    Without ``ask.leave_out`` the first vehicle that is stuck ends this, and there is no separation.
    """
    groups = groups_of(plan, ask.rules)
    known: dict[tuple[str, ...], Settlement] = {}
    for joined in range(JOINED + 1):
        for group in groups:
            if tuple(group) not in known:
                found = settle(*_part(plan, ask, group))
                if found.stuck and not ask.leave_out:
                    return found, None, 0.0
                known[tuple(group)] = found
        parts = [known[tuple(group)] for group in groups]
        choices = {name: choice for part in parts for name, choice in part.done.items()}
        if not choices:
            return Settlement({}, tuple(s for part in parts for s in part.stuck)), None, 0.0
        done, moved_s = moved({name: choices[name] for name in plan.order if name in choices})
        judged = separation([choice.option.path for choice in done.values()], ask.rules)
        met = [c.worst.vehicles for c in judged.conflicts]
        if not met or len(groups) == 1:
            break
        groups = _joined(plan.order, [*groups, *met]) if joined < JOINED - 1 else [list(plan.order)]
    return Settlement(done, tuple(s for part in parts for s in part.stuck)), judged, moved_s


def groups_of(plan: Schedule, rules: Rules) -> Groups:
    """The names of vehicles whose ways lead past each other, in the order of the schedule, first groups first."""
    import shapely  # slow to import, and most plans have one vehicle

    lines = [shapely.LineString(flown_corners(slot.route)[:, :2]) for slot in plan.slots]
    near = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=rules.needed_m + CUT_M)
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


def _part(plan: Schedule, ask: Ask, group: Sequence[str]) -> tuple[Schedule, Ask]:
    """The schedule and the arguments for some of the vehicles."""
    of = frozenset(group)
    slots = tuple(s for s in plan.slots if s.name in of)
    priority = None if ask.priority is None else [n for n in ask.priority if n in of]
    return (
        replace(plan, slots=slots, order=tuple(n for n in plan.order if n in of)),
        replace(ask, crews=[c for c in ask.crews if c.name in of], priority=priority),
    )
