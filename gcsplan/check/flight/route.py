"""The order in which the items of a mission are flown: jumps with their counts, as the autopilots count them.

- A jump's count belongs to the jump: once it is used up, the jump is skipped (ArduPilot's `AP_Mission::get_next_cmd`,
  PX4's `getNonJumpItem`). A count of 0 never jumps; −1 repeats without end on ArduPilot and 65,535 times on PX4, which
  keeps 16 bits.
- A skipped jump that is reached again, from a jump behind it, is skipped again before ArduPilot 4.7; since 4.7 its
  count begins anew, unless MIS_OPTIONS bit 3 is set. So what follows depends on the version, and is not judged.
- ArduPilot counts `MOST_JUMPS` jumps of one mission and treats the others as used up. Only ArduPilot has jump tags.
- A round that begins in the same state as the round before it is flown identically: it is followed once, and counted.
- Nothing is flown after a hold or a loop without end. On ArduPilot the DO_ items right after a hold are carried out
  while it lasts. Only a return leads to the items after a DO_LAND_START or DO_RETURN_PATH_START that stands behind a
  hold, a loop, a return or a landing: ArduPilot jumps there (AP_Mission.cpp, `jump_to_landing_sequence`,
  `jump_to_closest_mission_leg`). `Flight.apart_from` tells where they begin.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace
from typing import Protocol

from gcsplan.check.motion.commands import LAND_STARTS
from gcsplan.check.motion.stretch import Flight, Unreached
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.notes.note import Note

MOST_JUMPS = 15  # AP_MISSION_MAX_NUM_DO_JUMP_COMMANDS on small boards, 100 on large ones; the rest count as used up
MOST_ROUTE_STEPS = 100_000
"""Most steps before a mission is given up as endless. Rounds that repeat the round before them are not counted."""


class Pilot(Protocol):
    """The pilot that flies the items; see `flight`."""

    flight: Flight
    jumped_from: int | None
    airborne: bool
    known: bool

    def fly(self, seq: int, item: MissionItem) -> None:
        """Fly one item."""
        ...

    def finish(self) -> None:
        """Add what follows the last item."""
        ...

    @property
    def over(self) -> bool:
        """Whether the aircraft is down and stays there."""
        ...

    @property
    def stays(self) -> bool:
        """Whether the aircraft holds without end."""
        ...

    @property
    def state(self) -> Hashable:
        """Everything that the rest of the flight depends on, except the counts of the jumps."""
        ...


class _Jump:
    """One jump: the index of its target (None: no such item), its rounds (None: without end), and its progress.

    ``done``: rounds flown; ``passed``: how often it was skipped. ``was``: when it last jumped, the state then, and the
    numbers of ``stretches`` and ``instead``.
    """

    __slots__ = ("done", "passed", "rounds", "target", "was")

    def __init__(self, target: int | None, rounds: int | None) -> None:
        self.target, self.rounds, self.done, self.passed = target, rounds, 0, 0
        self.was: tuple[Hashable, int, int] | None = None


def fly_all(mission: Mission, make_pilot: Callable[[], Pilot]) -> Flight:
    """The flight of ``mission`` (as stored), and in `Flight.apart` what only a return leads to."""
    pilot = make_pilot()
    if fly_in_order(mission, pilot):
        pilot.finish()
    flight = pilot.flight
    start = flight.apart_from
    last = -1
    while start is not None and start > last:
        pilot = make_pilot()
        pilot.airborne, pilot.known = True, False  # where a return comes from is judged with the way home
        if fly_in_order(mission, pilot, start):
            pilot.finish()
        flight.apart.append(pilot.flight)
        flight.adopt(pilot.flight)
        last, start = start, pilot.flight.apart_from
    if start is not None:
        first, last_seq = mission.first_seq + start, mission.first_seq + len(mission.items) - 1
        flight.not_judged.append(Note("jumps_back_into_return", first=first, last=last_seq))
    return flight


def fly_in_order(mission: Mission, pilot: Pilot, start: int = 0) -> bool:
    """Make ``pilot`` fly the items of ``mission`` (as stored) in order; return False if that never ends.

    ``start``: the index of the first item.
    """
    jumps = _jumps(mission)
    flight, first, items = pilot.flight, mission.first_seq, mission.items
    if mission.autopilot.is_ardupilot and len(jumps) > MOST_JUMPS:
        flight.not_judged.append(Note("too_many_jumps", count=len(jumps), most=MOST_JUMPS))
    index, steps = start, 0
    while index < len(items):
        steps += 1
        if steps > MOST_ROUTE_STEPS:
            flight.not_judged.append(Note("too_many_steps", most=MOST_ROUTE_STEPS))
            return False
        if pilot.over and mission.autopilot.is_ardupilot and items[index].command in LAND_STARTS:
            flight.apart_from = index
            return True
        seq, jump = first + index, jumps.get(index)
        if jump is None or pilot.over:
            pilot.fly(seq, items[index])
            index += 1
            if pilot.stays:
                _never(mission, flight, seq, index, loop=False)
                return False
            continue
        if jump.target is None:
            flight.not_judged.append(Note("jump_target_missing", seq))
            return False
        if jump.rounds is not None and jump.done >= jump.rounds:
            _pass(mission, flight, seq, jump)
            index += 1
            continue
        others = tuple(j.done for j in jumps.values() if j is not jump)
        begins = (pilot.state, others)
        if jump.was is not None and jump.was[0] == begins:
            if jump.rounds is None:
                _without_end(flight, seq, first + jump.target, first + len(items) - 1, jump.was)
                if flight.loop_seq is not None:
                    _never(mission, flight, seq, index + 1, loop=True)
                return False
            _again(flight, jump, jump.was)
            _pass(mission, flight, seq, jump)
            index += 1
            continue
        jump.was = (begins, len(flight.stretches), len(flight.instead))
        jump.done += 1
        pilot.jumped_from = seq
        index = jump.target
    return True


def _jumps(mission: Mission) -> dict[int, _Jump]:
    first, items = mission.first_seq, mission.items
    tags: dict[float, int] = {}
    if mission.autopilot.is_ardupilot:
        for index, item in enumerate(items):
            if item.command == cmd.JUMP_TAG:
                tags.setdefault(item.params[0], index)
    jumps: dict[int, _Jump] = {}
    for index, item in enumerate(items):
        tagged = item.command == cmd.DO_JUMP_TAG and mission.autopilot.is_ardupilot
        if item.command != cmd.DO_JUMP and not tagged:
            continue
        where, count = item.params[0], item.params[1]
        numbered = int(where) - first if first <= where < first + len(items) else None
        target = tags.get(where) if tagged else numbered
        endless = mission.autopilot.is_ardupilot and count == -1.0
        jumps[index] = _Jump(target, None if endless else max(0, int(count)) if count == count else 0)
    return jumps


def _pass(mission: Mission, flight: Flight, seq: int, jump: _Jump) -> None:
    """Skip a jump that is used up; the second time, say that another version of ArduPilot does not."""
    jump.passed += 1
    if jump.passed == 2 and jump.rounds and mission.autopilot.is_ardupilot:
        flight.not_judged.append(Note("jump_counted_by_version", seq, rounds=jump.rounds))


def _again(flight: Flight, jump: _Jump, was: tuple[Hashable, int, int]) -> None:
    """Count the stretches of the last round for all remaining rounds too: they are flown identically."""
    assert jump.rounds is not None
    times = 1 + jump.rounds - jump.done
    _, since, instead = was
    flight.stretches[since:] = [replace(s, times=s.times * times) for s in flight.stretches[since:]]
    flight.instead[instead:] = [replace(s, times=s.times * times) for s in flight.instead[instead:]]
    jump.done = jump.rounds


def _never(mission: Mission, flight: Flight, seq: int, index: int, *, loop: bool) -> None:
    """Record the items from ``index`` on as never flown, because ``seq`` before them holds or jumps without end."""
    first, items, ardupilot = mission.first_seq, mission.items, mission.autopilot.is_ardupilot
    landing = len(items)
    if ardupilot:
        landing = next((i for i in range(index, len(items)) if items[i].command in LAND_STARTS), len(items))
    never = [
        i for i in range(index, landing)
        if not ardupilot or cmd.is_nav(items[i].command) or items[i].command in (cmd.DO_JUMP, cmd.DO_JUMP_TAG)
    ]  # fmt: skip
    if never:
        flight.unreached.append(Unreached(seq, first + never[0], first + never[-1], loop))
    if landing < len(items) - 1:
        flight.apart_from = landing


def _without_end(flight: Flight, seq: int, target: int, last: int, was: tuple[Hashable, int, int]) -> None:
    if len(flight.stretches) == was[1]:
        flight.not_judged.append(Note("jump_flies_nothing", seq, target=target))
        return
    flight.loop_seq = seq
    never = None if seq == last else Note("items_after_jump", first=seq + 1, last=last)
    flight.notes.append(Note("jumps_without_end", seq, target=target, never=never))
