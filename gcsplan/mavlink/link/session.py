"""What a user calls: find a vehicle, upload to it and prove that it holds what was sent; download, verify, clear.

    with Link("udpout:127.0.0.1:14560") as link:
        result = upload_mission(link, mission, verdict=verdict)
        result.raise_for_outcome()

An upload is: the passing verdict, `preflight`, failsafe parameters read, `VerifiedUpload` (upload, settle the unknown
by reading back, compare), and the caller's check once more on what was read back. The steps are in `tasks`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

from gcsplan.errors import CheckFailed, GcsplanError, InputError
from gcsplan.mavlink.link.link import Channel, Link, PumpJob, Steps, pump, run
from gcsplan.mavlink.link.results import UploadResult
from gcsplan.mavlink.link.steps import discover_steps
from gcsplan.mavlink.link.tasks import (
    Judge,
    ProgressCall,
    SessionOptions,
    Task,
    clearing,
    looking_at,
    reading,
    uploading,
    verifying,
)
from gcsplan.mavlink.link.watch import VehicleState, Watch
from gcsplan.mavlink.mission.mission import ALL, FENCE, MISSION, RALLY, Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot

__all__ = [
    "Checked",
    "EndCall",
    "Judge",
    "ListOrder",
    "ProgressCall",
    "SessionOptions",
    "UploadOrder",
    "UploadResult",
    "clear_fleet",
    "clear_mission",
    "discover",
    "download_items",
    "download_mission",
    "require_verdict",
    "upload_fleet",
    "upload_items",
    "upload_lists",
    "upload_mission",
    "verify_mission",
]

T = TypeVar("T")


class Checked(Protocol):
    """A verdict, as far as an upload needs it."""

    @property
    def safe(self) -> bool | None:
        """True only if every limit was judged and holds."""
        ...

    @property
    def mission(self) -> Mission:
        """The mission that was judged."""
        ...


@dataclass(frozen=True)
class UploadOrder:
    """One upload of a fleet."""

    link: Link
    mission: Mission
    verdict: Checked | None = None
    options: SessionOptions = field(default_factory=SessionOptions)
    judge: Judge | None = None
    progress: ProgressCall | None = None


EndCall = Callable[[UploadOrder, UploadResult | GcsplanError], None]


def discover(
    link: Link, sysid: int, timeout_s: float = 10.0, *, listen_s: float = 1.5, standby_s: float = 0.0
) -> VehicleState:
    """What system ``sysid`` says of itself. Raises LinkError if nobody answers, naming the other direction."""
    watch = Watch(sysid)
    return _run(
        link, sysid, lambda c: discover_steps(c, watch, timeout_s=timeout_s, listen_s=listen_s, standby_s=standby_s)
    )


def upload_mission(
    link: Link,
    mission: Mission,
    *,
    verdict: Checked | None = None,
    options: SessionOptions | None = None,
    judge: Judge | None = None,
    progress: ProgressCall | None = None,
) -> UploadResult:
    """Upload ``mission`` to the vehicle with its system id, and prove it.

    Raises CheckFailed without a passing ``verdict`` of this very mission (unless ``options.unchecked``),
    VehicleRefused if it may not go to that vehicle as it stands, LinkError if nobody answers. How the transfer itself
    ended is in the result.
    """
    result = upload_fleet([UploadOrder(link, mission, verdict, options or SessionOptions(), judge, progress)])[0]
    if isinstance(result, GcsplanError):
        raise result
    return result


def upload_fleet(orders: Sequence[UploadOrder], *, ended: EndCall | None = None) -> list[UploadResult | GcsplanError]:
    """Several uploads at once, on one link or several; results in the order given, an error in place of a result.

    ``ended(order, outcome)`` is called as each of them ends. Raises CheckFailed, and sends nothing to anybody, unless
    every mission has its passing verdict; InputError where two missions are meant for one vehicle.
    """
    for order in orders:
        require_verdict(order.mission, order.verdict, unchecked=order.options.unchecked)
    seats = [(id(order.link), order.mission.sysid) for order in orders]
    if len(set(seats)) < len(seats):
        raise InputError("two missions of one fleet are meant for the same system id on the same link")

    def starting(order: UploadOrder) -> Callable[[Channel], Steps[UploadResult]]:
        task = Task.of(order.mission, order.options, order.judge, order.progress)
        return lambda channel: _telling(uploading(channel, task), order, ended)

    return _together([(order.link, order.mission.sysid, starting(order)) for order in orders])


@dataclass(frozen=True)
class ListOrder:
    """A fence or rally points for one vehicle of a fleet."""

    link: Link
    sysid: int
    items: tuple[MissionItem, ...]
    autopilot: Autopilot
    name: str = ""
    options: SessionOptions = field(default_factory=SessionOptions)


def upload_lists(orders: Sequence[ListOrder], mission_type: int) -> list[UploadResult | GcsplanError]:
    """Fences (1) or rally points (2) of several vehicles at once, each proved; results as of `upload_fleet`."""
    _require_list(mission_type)

    def starting(order: ListOrder) -> Callable[[Channel], Steps[UploadResult]]:
        task = Task(order.name, order.sysid, order.autopilot, order.items, mission_type, order.options)
        return lambda channel: uploading(channel, task)

    return _together([(order.link, order.sysid, starting(order)) for order in orders])


def clear_fleet(
    orders: Sequence[UploadOrder], seen: Mapping[str, VehicleState | None]
) -> list[UploadResult | GcsplanError]:
    """Clear the mission on every vehicle of ``orders``, all at once, and read back that it is gone.

    ``seen``: by mission name the vehicle that was uploaded to; one that speaks from another address is left alone.
    Results in the order given, an error in place of a result: a vehicle that is armed, or gone, keeps what it has.
    """

    def starting(order: UploadOrder) -> Callable[[Channel], Steps[UploadResult]]:
        same = seen.get(order.mission.name)
        return lambda channel: clearing(channel, order.mission.name, (MISSION,), order.options, same)

    return _together([(order.link, order.mission.sysid, starting(order)) for order in orders])


def _together(
    starts: Sequence[tuple[Link, int, Callable[[Channel], Steps[UploadResult]]]],
) -> list[UploadResult | GcsplanError]:
    jobs: list[PumpJob[UploadResult]] = []
    try:
        for link, sysid, steps in starts:
            channel = link.channel(sysid)
            jobs.append(PumpJob(channel, steps(channel)))
        pump(jobs)
    finally:
        for job in jobs:
            job.channel.link.drop(job.channel)
    outcomes: list[UploadResult | GcsplanError] = []
    for job in jobs:
        outcome = job.error or job.result
        assert outcome is not None
        outcomes.append(outcome)
    return outcomes


def _telling(steps: Steps[UploadResult], order: UploadOrder, ended: EndCall | None) -> Steps[UploadResult]:
    """``steps``, and how they ended told to the caller at once: the others of the fleet may take much longer."""
    try:
        result = yield from steps
    except GcsplanError as error:
        if ended:
            ended(order, error)
        raise
    if ended:
        ended(order, result)
    return result


def require_verdict(mission: Mission, verdict: Checked | None, *, unchecked: bool = False) -> None:
    """Raises CheckFailed unless ``verdict`` is a passing one of ``mission``, or ``unchecked``."""
    if unchecked:
        return
    where = mission.name or f"system {mission.sysid}"
    if verdict is None:
        words = "a mission is sent with its passing verdict: check it first, or send it unchecked on purpose"
        raise CheckFailed(words, where=where, reason="unchecked")
    if verdict.safe is not True:
        said = "did not pass the check" if verdict.safe is False else "could not be judged in full"
        raise CheckFailed(f"the mission {said}: it is not sent", where=where)
    if not _same_mission(verdict.mission, mission):
        raise CheckFailed("the verdict is of another mission than the one to be sent", where=where, reason="unchecked")


def upload_items(
    link: Link,
    sysid: int,
    items: Sequence[MissionItem],
    autopilot: Autopilot,
    mission_type: int,
    *,
    options: SessionOptions | None = None,
    name: str = "",
) -> UploadResult:
    """Upload a fence (1) or rally points (2), and prove it. Raises as `upload_mission` does, but for the verdict."""
    _require_list(mission_type)
    task = Task(name, sysid, autopilot, tuple(items), mission_type, options or SessionOptions())
    return _run(link, sysid, lambda channel: uploading(channel, task))


def _require_list(mission_type: int) -> None:
    if mission_type not in (FENCE, RALLY):
        raise InputError(f"fence (1) or rally points (2) are wanted, given mission type {mission_type}")


def download_items(
    link: Link, sysid: int, mission_type: int = MISSION, *, options: SessionOptions | None = None
) -> tuple[MissionItem, ...]:
    """The list on board in wire order. Raises LinkError or VehicleRefused if it cannot be read."""
    settings = options or SessionOptions()

    def steps(channel: Channel) -> Steps[tuple[MissionItem, ...]]:
        state, recheck = yield from looking_at(channel, settings)
        read = yield from reading(channel, state, mission_type, settings, recheck)
        return read.items

    return _run(link, sysid, steps)


def download_mission(
    link: Link,
    sysid: int,
    autopilot: Autopilot,
    *,
    home: Home | None = None,
    name: str = "",
    options: SessionOptions | None = None,
) -> Mission:
    """The mission on board. PX4 keeps no home in it: ``home``, else the one that the vehicle reports, else its place.

    Raises InputError where no home is known, LinkError or VehicleRefused if it cannot be read.
    """
    settings = options or SessionOptions()

    def steps(channel: Channel) -> Steps[Mission]:
        state, recheck = yield from looking_at(channel, settings)
        read = yield from reading(channel, state, MISSION, settings, recheck)
        start = home
        if start is None and (not autopilot.is_ardupilot or not read.items):
            start = state.home
            if start is None and state.lat_deg is not None and state.lon_deg is not None:
                start = Home.at(state.lat_deg, state.lon_deg, state.amsl_m or 0.0)
        return Mission.from_wire(autopilot, read.items, home=start, name=name, sysid=sysid)

    return _run(link, sysid, steps)


def verify_mission(
    link: Link, mission: Mission, *, options: SessionOptions | None = None, judge: Judge | None = None
) -> UploadResult:
    """Read the mission on board and compare it with ``mission``; nothing is written.

    Raises LinkError or VehicleRefused if it cannot be read; what differs is in the result.
    """
    task = Task.of(mission, options or SessionOptions(), judge)
    return _run(link, mission.sysid, lambda channel: verifying(channel, task))


def clear_mission(
    link: Link, sysid: int, mission_type: int = MISSION, *, options: SessionOptions | None = None, name: str = ""
) -> UploadResult:
    """Clear one list, or mission, fence and rally points (255), and read back that nothing is left.

    Raises VehicleRefused (armed, or being flown) and LinkError.
    """
    kinds = (MISSION, FENCE, RALLY) if mission_type == ALL else (mission_type,)
    return _run(link, sysid, lambda channel: clearing(channel, name, kinds, options or SessionOptions()))


def _same_mission(a: Mission, b: Mission) -> bool:
    """Equal to the bit, NaN included."""
    same = (a.autopilot, a.home, a.sysid) == (b.autopilot, b.home, b.sysid)
    return same and [item.wire for item in a.items] == [item.wire for item in b.items]


def _run(link: Link, sysid: int, steps: Callable[[Channel], Steps[T]]) -> T:
    channel = link.channel(sysid)
    try:
        return run(channel, steps(channel))
    finally:
        link.drop(channel)
