"""The options of a session, its time limits, and the task of one list for one vehicle.

The user's timeout limits the time of a transfer without progress and, per item, the whole of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from gcsplan.errors import InputError
from gcsplan.mavlink.link.watch import VehicleState
from gcsplan.mavlink.mission.mission import MISSION, Mission, MissionItem
from gcsplan.mavlink.mission.parameter_list import Setting
from gcsplan.mavlink.mission.return_parameters import ReturnRoute
from gcsplan.mavlink.protocol.transfer import Timers, TransferProgress
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.terrain.grid import GroundHeights

TIMEOUT_S = 60.0
ITEM_S = 2.0
"""Seconds that each item adds to the limit of the whole transfer."""


def checked_timeout_s(timeout_s: float) -> float:
    """Return ``timeout_s`` if it lies within 0 … 3600 s (0 excluded); else raise InputError."""
    if not 0.0 < timeout_s <= 3600.0:
        raise InputError(f"a timeout must lie within 0 … 3600 s, given {timeout_s:g}")
    return timeout_s


class TransferPatience:
    """Two limits: ``timeout_s`` without progress, and ``timeout_s`` plus `ITEM_S` per item in all, even with progress.

    ``items`` is None if the number is unknown until the vehicle reports it.
    """

    def __init__(self, timeout_s: float, items: int | None, now: float) -> None:
        self.timeout_s = checked_timeout_s(timeout_s)
        self._known, self._items = items is not None, items or 0
        self._started = self._moved_on = now
        self._best: tuple[int, ...] = ()

    @property
    def deadline(self) -> float:
        """The time at which the transfer must end unless there is progress before."""
        return min(self._moved_on + self.timeout_s, self._started + self.timeout_s + ITEM_S * self._items)

    def over(self, mark: tuple[int, ...], total: int, now: float) -> str | None:
        """Return in words why the time is over at ``now``; None if it is not.

        ``mark`` grows with every step of progress. ``total`` is the number of items reported by the vehicle; it is used
        only if ``items`` was None.
        """
        if not self._known:
            self._items = max(self._items, total)
        if mark > self._best:
            self._best, self._moved_on = mark, now
        if now < self.deadline:
            return None
        if now >= self._moved_on + self.timeout_s:
            return f"nothing new for {self.timeout_s:g} s (--timeout)"
        return (
            f"not done after {now - self._started:.0f} s, for {self._items} items the longest that a timeout of "
            f"{self.timeout_s:g} s allows (--timeout)"
        )


TransferReport = Callable[[str, TransferProgress], None]
ReadBackJudge = Callable[[Mission, Mapping[str, float]], Note | None]
"""Repeats the caller's check with the parameters that were read: None if it passes, else why it does not."""


WindJudge = Callable[[VehicleState], Note | None]
"""Holds the vehicle's estimate of the wind, or that it has none, beside the winds of the plan; None: nothing to say."""


@dataclass(frozen=True, slots=True)
class SessionOptions:
    """Options of a session. ``unchecked``: send without a verdict. ``simulated``: only copied to the result.

    ``discover_s``: seconds to wait for a first heartbeat; ``listen_s``: to listen for rivals after it; ``standby_s``:
    to wait for a vehicle that is booting. ``ground_amsl_m``: DEM altitude at the start, by default the altitude of the
    mission's home. ``timeout_s``: longest time without progress of a transfer (see `TransferPatience`); it also limits
    ``discover_s`` and ``standby_s``. The parameters on board are compared with ``rtl_rel_home_m`` (the return altitude
    that was checked), ``route`` (of the return that was checked), ``advised_rel_home_m`` (the one to set, if another is
    better), ``settings`` (what the mission was judged with) and ``expected_parameters``, and a PX4's motion with
    ``vehicle``. ``terrain``: the ground for a mission in
    the terrain frame, which is then served and compared (`link.terrain`). ``wind``: what the vehicle's estimate of the
    wind is held beside; one that is late is waited for until ``wind_s`` after the first request.
    """

    unchecked: bool = False
    allow_armed: bool = False
    ignore_position: bool = False
    ground_amsl_m: float | None = None
    rtl_rel_home_m: float | None = None
    route: ReturnRoute | None = None
    advised_rel_home_m: float | None = None
    expected_parameters: Mapping[str, float] = field(default_factory=dict)
    terrain: GroundHeights | None = None
    read_parameters: bool = True
    discover_s: float = 10.0
    listen_s: float = 1.5
    standby_s: float = 30.0
    timeout_s: float = TIMEOUT_S
    attempts: int = 4
    timers: Timers = field(default_factory=Timers)
    simulated: bool = False
    vehicle: Vehicle | None = None
    settings: tuple[Setting, ...] = ()
    wind: WindJudge | None = None
    wind_s: float = 0.0

    def __post_init__(self) -> None:
        checked_timeout_s(self.timeout_s)


@dataclass(frozen=True)
class Task:
    """One list in wire order for one vehicle; ``mission``: set for a mission, None for a fence or rally points."""

    name: str
    sysid: int
    autopilot: Autopilot
    items: tuple[MissionItem, ...]
    mission_type: int
    options: SessionOptions
    mission: Mission | None = None
    judge: ReadBackJudge | None = None
    progress: TransferReport | None = None

    @classmethod
    def of(
        cls,
        mission: Mission,
        options: SessionOptions,
        judge: ReadBackJudge | None,
        progress: TransferReport | None = None,
    ) -> Task:
        """Return the task of sending ``mission``."""
        return cls(
            mission.name, mission.sysid, mission.autopilot, mission.wire_items(), MISSION, options, mission, judge,
            progress,
        )  # fmt: skip
