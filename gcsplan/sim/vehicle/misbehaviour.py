"""Intentional faults: a bad link, bad memory, a second ground station, a reboot; random ones are drawn from a seed.

`Misbehaviour` holds the settings, `Faults` is their interface for the protocol machines, `LossyChannel` is one
direction of a bad link.
"""

from __future__ import annotations

import dataclasses
import difflib
import heapq
import math
import random
from dataclasses import dataclass

from gcsplan.errors import Mistake, UsageError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import MISSION, MissionItem, float32
from gcsplan.mavlink.protocol.messages import Packet
from gcsplan.sim.vehicle.stored_lists import ItemRefused

FIELDS = ("x", "y", "z", "param1", "param2", "param3", "param4", "command", "frame", "autocontinue")

# Most packets that one direction holds back; further ones are lost.
QUEUE_LIMIT = 1000


@dataclass(frozen=True, slots=True)
class Misbehaviour:
    """The requested faults. Probabilities are per packet and apply in both directions.

    ``drop``, ``duplicate``, ``reorder``, ``delay``: probabilities 0 … 1; a delayed packet waits up to ``delay_s``, a
    reordered one is overtaken by the next. ``corrupt``: seq of an item that is stored with a wrong ``corrupt_field``.
    ``silent_after``: number of received messages after which nothing is sent, not even heartbeats. ``reboot_at``:
    number of received items after which it reboots for ``reboot_s``, silent for the first half and booting in the
    second; with ``reboot_loses`` the mission is then gone, else what was stored stays. ``edit``: seq of an item that a
    second ground station changes between the ACK and the read-back. ``stray_sysid``: id of another vehicle on the same
    link that sends wrong answers before every right one. ``stale_type``: another mission type of which wrong answers
    come likewise. ``answer_sysid``: system id of the answers instead of the vehicle's. ``refuse``: seq of an item that
    is answered with the ACK ``refuse_code``. ``no_space``: every upload gets NO_SPACE. ``armed``: the vehicle is armed.
    ``mute``: a parameter that it does not answer for, the first ``mute_times`` times (None: never).
    """

    drop: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    delay: float = 0.0
    delay_s: float = 0.3
    corrupt: int | None = None
    corrupt_field: str = "z"
    silent_after: int | None = None
    reboot_at: int | None = None
    reboot_s: float = 2.0
    reboot_loses: bool = False
    edit: int | None = None
    stray_sysid: int | None = None
    stale_type: int | None = None
    answer_sysid: int | None = None
    refuse: int | None = None
    refuse_code: int = 5
    no_space: bool = False
    armed: bool = False
    mute: str = ""
    mute_times: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        problems = []
        for name in ("drop", "duplicate", "reorder", "delay"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                problems.append(Mistake(name, f"wants a probability 0 … 1, given {getattr(self, name)}"))
        for name in ("delay_s", "reboot_s"):
            if not 0.0 <= getattr(self, name) <= 3600.0:
                problems.append(Mistake(name, f"wants seconds 0 … 3600, given {getattr(self, name)}"))
        for name in ("corrupt", "edit", "refuse", "silent_after", "reboot_at", "mute_times"):
            if (value := getattr(self, name)) is not None and not 0 <= value <= 65535:
                problems.append(Mistake(name, f"wants a whole number 0 … 65535, given {value}"))
        for name in ("stray_sysid", "answer_sysid"):
            if (value := getattr(self, name)) is not None and not 1 <= value <= 255:
                problems.append(Mistake(name, f"wants a system id 1 … 255, given {value}"))
        if self.stale_type is not None and self.stale_type not in (0, 1, 2):
            problems.append(Mistake("stale_type", f"wants 0 mission, 1 fence or 2 rally, given {self.stale_type}"))
        if not 1 <= self.refuse_code <= 15:
            problems.append(Mistake("refuse_code", f"wants a MAV_MISSION_RESULT 1 … 15, given {self.refuse_code}"))
        if self.corrupt_field not in FIELDS:
            problems.append(Mistake("corrupt_field", f"wants one of {', '.join(FIELDS)}, given {self.corrupt_field!r}"))
        if problems:
            raise UsageError.of(problems)

    @classmethod
    def parse(cls, text: str) -> Misbehaviour:
        """Parse ``"drop=0.1,duplicate=0.05,corrupt=7,seed=3"``; a flag needs no value (``"armed,no_space"``).

        Raises UsageError that lists every mistake.
        """
        kinds = {f.name: str(f.type) for f in dataclasses.fields(cls)}
        given: dict[str, float | int | bool | str] = {}
        problems = []
        for part in filter(None, (p.strip() for p in text.split(","))):
            name, _, value = (piece.strip() for piece in part.partition("="))
            if name not in kinds:
                near = difflib.get_close_matches(name, kinds, n=1)
                hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(kinds)}"
                problems.append(Mistake("--misbehave", f"unknown misbehaviour {name!r}; {hint}"))
            elif name in given:
                problems.append(Mistake("--misbehave", f"{name} is given twice"))
            else:
                try:
                    given[name] = _parsed(kinds[name], value)
                except ValueError as error:
                    problems.append(Mistake("--misbehave", f"{name} wants {error}, given {value!r}"))
        if problems:
            raise UsageError.of(problems)
        return cls(**given)  # type: ignore[arg-type]  # each value was read as its field's type

    def __str__(self) -> str:
        differing = (
            (f.name, getattr(self, f.name)) for f in dataclasses.fields(self) if getattr(self, f.name) != f.default
        )
        return ",".join(name if value is True else f"{name}={value}" for name, value in differing)


def _parsed(kind: str, value: str) -> float | int | bool | str:
    """Return ``value`` as a field's type. Raises ValueError that states what is expected."""
    if kind == "bool":
        if value.lower() in ("", "1", "true", "yes"):
            return True
        if value.lower() in ("0", "false", "no"):
            return False
        raise ValueError("nothing, 1 or 0")
    if kind == "float":
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise ValueError("a number")
        return number
    if kind.startswith("int"):
        if not value.removeprefix("-").isascii() or not value.removeprefix("-").isdigit() or len(value) > 18:
            raise ValueError("a whole number")
        return int(value)
    return value


class Faults:
    """The faults of a `Misbehaviour` that the protocol machines apply while they store items."""

    def __init__(self, order: Misbehaviour) -> None:
        self._order = order

    @property
    def no_space(self) -> bool:
        """Whether every upload is answered with NO_SPACE."""
        return self._order.no_space

    def refuse(self, mission_type: int, seq: int) -> None:
        """Raise `ItemRefused` if the item is the one to refuse."""
        if mission_type == MISSION and seq == self._order.refuse:
            raise ItemRefused(self._order.refuse_code)

    def spoil(self, mission_type: int, seq: int, item: MissionItem) -> MissionItem:
        """Return ``item``, or its corrupted version if it is the one to corrupt."""
        if mission_type == MISSION and seq == self._order.corrupt:
            return spoilt(item, self._order.corrupt_field)
        return item


def spoilt(item: MissionItem, field: str) -> MissionItem:
    """Return ``item`` with one field slightly wrong: by 1e-7°, 1 m or one unit, or with another command or frame."""
    if field in ("x", "y"):
        value = getattr(item, field)
        return dataclasses.replace(item, **{field: value + 1 if value < 2**31 - 1 else value - 1})
    if field == "z":
        return dataclasses.replace(item, z=_another(item.z))
    if field == "command":
        return dataclasses.replace(item, command=cmd.LOITER_UNLIM if item.command == cmd.WAYPOINT else cmd.WAYPOINT)
    if field == "frame":
        return dataclasses.replace(item, frame={0: 3, 3: 0, 5: 6, 6: 5}.get(item.frame, 0))
    if field == "autocontinue":
        return dataclasses.replace(item, autocontinue=not item.autocontinue)
    index = int(field.removeprefix("param")) - 1
    first, second, third, fourth = (_another(p) if i == index else p for i, p in enumerate(item.params))
    return dataclasses.replace(item, params=(first, second, third, fourth))


def _another(value: float) -> float:
    more = float32(value + 1.0)
    return more if math.isfinite(more) and more != value else 0.0 if value != 0.0 else 1.0


class LossyChannel:
    """One direction of a bad link: packets come out at once, later, twice, in another order, or not at all."""

    OVERTAKEN_WITHIN_S = 0.2

    def __init__(self, order: Misbehaviour, rng: random.Random) -> None:
        self._order, self._rng = order, rng
        self._queue: list[tuple[float, int, Packet]] = []
        self._held: list[tuple[float, Packet]] = []  # waits to be overtaken, at most one
        self._pushed = 0

    def push(self, packet: Packet, now: float) -> None:
        """Add one packet."""
        order, rng = self._order, self._rng
        copies = 0 if rng.random() < order.drop else 2 if rng.random() < order.duplicate else 1
        overtaken, self._held = self._held, []
        for _ in range(copies):
            late_s = rng.uniform(0.0, order.delay_s) if rng.random() < order.delay else 0.0
            if not overtaken and not self._held and rng.random() < order.reorder:
                self._held.append((now + self.OVERTAKEN_WITHIN_S, packet))
            else:
                self._put(now + late_s, packet)
        for _, earlier in overtaken:
            self._put(now, earlier)

    def _put(self, due: float, packet: Packet) -> None:
        if len(self._queue) < QUEUE_LIMIT:
            heapq.heappush(self._queue, (due, self._pushed, packet))
            self._pushed += 1

    @property
    def deadline(self) -> float | None:
        """The time at which the next packet comes out, or None."""
        return min([entry[0] for entry in self._queue[:1]] + [entry[0] for entry in self._held], default=None)

    def due(self, now: float) -> list[Packet]:
        """Remove and return the packets that have come through by ``now``, in order."""
        out = []
        while self._queue and self._queue[0][0] <= now:
            out.append(heapq.heappop(self._queue)[2])
        if self._held and self._held[0][0] <= now:
            out.append(self._held.pop()[1])
        return out

    def clear(self) -> None:
        """Drop all packets under way."""
        self._queue.clear()
        self._held.clear()
