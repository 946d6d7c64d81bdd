"""The public functions: find a vehicle, upload to it and verify what it holds; download, compare, clear.

    with Link("udpout:127.0.0.1:14560") as link:
        result = upload_mission(link, mission, verdict=verdict)
        result.raise_for_outcome()

An upload requires a passing verdict. It runs `preflight`, reads the failsafe parameters, runs `VerifiedUpload` (upload,
read back, compare), and repeats the caller's check on the list that was read back. The tasks are in `jobs`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol, TypeVar

from gcsplan.errors import CheckFailed, GcsplanError, InputError
from gcsplan.mavlink.link.link import Channel, Link, LinkSteps, PumpJob, pump, run
from gcsplan.mavlink.link.options import ReadBackJudge, SessionOptions, Task, TransferReport
from gcsplan.mavlink.link.session.jobs import (
    Readied,
    clearing,
    looking,
    looking_at,
    reading,
    uploading,
    verifying,
)
from gcsplan.mavlink.link.session.parameters import PARAMETER_GROUPS
from gcsplan.mavlink.link.session.results import UploadResult
from gcsplan.mavlink.link.session.steps import SLOW_ANSWER_S, discover_steps, parameter_steps
from gcsplan.mavlink.link.watch import VehicleState, Watch
from gcsplan.mavlink.mission.autopilots import autopilot_of
from gcsplan.mavlink.mission.mission import ALL, FENCE, MISSION, RALLY, Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot

__all__ = [
    "CheckedMission",
    "EndCall",
    "ReadBackJudge",
    "SessionOptions",
    "Task",
    "TransferReport",
    "UploadOrder",
    "UploadResult",
    "clear_fleet",
    "clear_mission",
    "discover",
    "download_items",
    "download_mission",
    "look_fleet",
    "read_vehicle",
    "require_verdict",
    "upload_fleet",
    "upload_items",
    "upload_lists",
    "upload_mission",
    "verify_mission",
]

T = TypeVar("T")

MOST_AT_ONCE, MOST_ON_LINK = 50, 25
"""Most vehicles of a fleet that are talked to at a time, on all links and on one."""


class CheckedMission(Protocol):
    """The part of a verdict that an upload needs."""

    @property
    def safe(self) -> bool | None:
        """True only if every limit was judged and is kept."""
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
    verdict: CheckedMission | None = None
    options: SessionOptions = field(default_factory=SessionOptions)
    judge: ReadBackJudge | None = None
    progress: TransferReport | None = None


EndCall = Callable[[UploadOrder, UploadResult | GcsplanError], None]


def discover(
    link: Link, sysid: int, timeout_s: float = 10.0, *, listen_s: float = 1.5, standby_s: float = 0.0
) -> VehicleState:
    """Return the state that system ``sysid`` reports. Raises LinkError, with hints, if nobody answers."""
    watch = Watch(sysid)
    return _run(
        link, sysid, lambda c: discover_steps(c, watch, timeout_s=timeout_s, listen_s=listen_s, standby_s=standby_s)
    )


def read_vehicle(
    link: Link, sysid: int, *, options: SessionOptions | None = None
) -> tuple[VehicleState, Autopilot | None, dict[str, float]]:
    """Return what a vehicle reports, its autopilot if gcsplan knows it, and the parameters that missions are judged by.

    Nothing is written. Raises LinkError if nobody answers, VehicleRefused if two vehicles have its system id.
    """
    settings = options or SessionOptions()

    def steps(channel: Channel) -> LinkSteps[tuple[VehicleState, Autopilot | None, dict[str, float]]]:
        state, recheck = yield from looking_at(channel, settings)
        autopilot = autopilot_of(state.mav_autopilot, state.mav_type)
        values: dict[str, float] = {}
        if autopilot is not None:
            groups = PARAMETER_GROUPS[autopilot]
            values = yield from parameter_steps(
                channel, state, groups, recheck.watch, recheck, needed=groups, most_s=SLOW_ANSWER_S
            )
        return state, autopilot, values

    return _run(link, sysid, steps)


def upload_mission(
    link: Link,
    mission: Mission,
    *,
    verdict: CheckedMission | None = None,
    options: SessionOptions | None = None,
    judge: ReadBackJudge | None = None,
    progress: TransferReport | None = None,
) -> UploadResult:
    """Upload ``mission`` to the vehicle with its system id, and verify it by reading back.

    Raises CheckFailed without a passing ``verdict`` of this very mission (unless ``options.unchecked``),
    VehicleRefused if the vehicle's state does not permit it, LinkError if nobody answers. The result states how the
    transfer itself ended.
    """
    result = upload_fleet([UploadOrder(link, mission, verdict, options or SessionOptions(), judge, progress)])[0]
    if isinstance(result, GcsplanError):
        raise result
    return result


def upload_fleet(orders: Sequence[UploadOrder], *, ended: EndCall | None = None) -> list[UploadResult | GcsplanError]:
    """Run several uploads at once, on one link or several; return results or errors in the order of ``orders``.

    At most `MOST_AT_ONCE` run at a time, and `MOST_ON_LINK` on one link; the others wait for their turn.
    ``ended(order, outcome)`` is called as each of them ends. Raises CheckFailed, before anything is sent, unless every
    mission has its passing verdict; InputError if two missions are for the same vehicle.
    """
    for order in orders:
        require_verdict(order.mission, order.verdict, unchecked=order.options.unchecked)
    _require_seats(orders)

    def starting(order: UploadOrder) -> Callable[[Channel], LinkSteps[UploadResult]]:
        task = Task.of(order.mission, order.options, order.judge, order.progress)
        return lambda channel: _telling(uploading(channel, task), order, ended)

    return _together([(order.link, order.mission.sysid, starting(order)) for order in orders])


def look_fleet(orders: Sequence[UploadOrder]) -> list[Readied | GcsplanError]:
    """Check the vehicles of several orders as an upload does before it sends, all at once, and read what they hold.

    Nothing is written, and no verdict is needed. Raises InputError if two missions are for the same vehicle.
    """
    _require_seats(orders)

    def starting(order: UploadOrder) -> Callable[[Channel], LinkSteps[Readied]]:
        task = Task.of(order.mission, replace(order.options, terrain=None), order.judge)
        return lambda channel: looking(channel, task)

    return _together([(order.link, order.mission.sysid, starting(order)) for order in orders])


def _require_seats(orders: Sequence[UploadOrder]) -> None:
    seats = [(id(order.link), order.mission.sysid) for order in orders]
    if len(set(seats)) < len(seats):
        raise InputError("two missions of one fleet are meant for the same system id on the same link")


def upload_lists(orders: Sequence[tuple[Link, Task]]) -> list[UploadResult | GcsplanError]:
    """Upload fences or rally points of several vehicles at once and verify each; results as `upload_fleet`."""

    def starting(task: Task) -> Callable[[Channel], LinkSteps[UploadResult]]:
        _require_list(task.mission_type)
        return lambda channel: uploading(channel, task)

    return _together([(link, task.sysid, starting(task)) for link, task in orders])


def clear_fleet(
    orders: Sequence[UploadOrder], seen: Mapping[str, VehicleState | None]
) -> list[UploadResult | GcsplanError]:
    """Clear the mission on every vehicle of ``orders``, all at once, and verify by reading back that it is gone.

    ``seen``: by mission name, the vehicle that was uploaded to; one at another address is not touched. Returns results
    or errors in the order of ``orders``: a vehicle that is armed or does not answer keeps its mission.
    """

    def starting(order: UploadOrder) -> Callable[[Channel], LinkSteps[UploadResult]]:
        same = seen.get(order.mission.name)
        return lambda channel: clearing(channel, order.mission.name, (MISSION,), order.options, same)

    return _together([(order.link, order.mission.sysid, starting(order)) for order in orders])


def _together(
    starts: Sequence[tuple[Link, int, Callable[[Channel], LinkSteps[T]]]],
) -> list[T | GcsplanError]:
    jobs: list[PumpJob[T]] = []
    try:
        for link, sysid, steps in starts:
            channel = link.channel(sysid)
            jobs.append(PumpJob(channel, steps(channel)))
        pump(jobs, most=MOST_AT_ONCE, most_on_link=MOST_ON_LINK)
    finally:
        for job in jobs:
            job.channel.link.drop(job.channel)
    outcomes: list[T | GcsplanError] = []
    for job in jobs:
        outcome = job.error or job.result
        assert outcome is not None
        outcomes.append(outcome)
    return outcomes


def _telling(steps: LinkSteps[UploadResult], order: UploadOrder, ended: EndCall | None) -> LinkSteps[UploadResult]:
    """Run ``steps`` and report their end to the caller at once, because the rest of the fleet may take much longer."""
    try:
        result = yield from steps
    except GcsplanError as error:
        if ended:
            ended(order, error)
        raise
    if ended:
        ended(order, result)
    return result


def require_verdict(mission: Mission, verdict: CheckedMission | None, *, unchecked: bool = False) -> None:
    """Raise CheckFailed unless ``verdict`` is a passing verdict of ``mission``, or ``unchecked`` is set."""
    if unchecked:
        return
    where = mission.name or f"system {mission.sysid}"
    if verdict is None:
        words = "a mission is sent with its passing verdict: check it first, or send it unchecked on purpose"
        raise CheckFailed(words, where=where, reason="unchecked")
    if verdict.safe is not True:
        failure = "did not pass the check" if verdict.safe is False else "could not be judged in full"
        raise CheckFailed(f"the mission {failure}: it is not sent", where=where)
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
    """Upload a fence (1) or rally points (2) and verify it. Raises as `upload_mission`, but needs no verdict."""
    _require_list(mission_type)
    task = Task(name, sysid, autopilot, tuple(items), mission_type, options or SessionOptions())
    return _run(link, sysid, lambda channel: uploading(channel, task))


def _require_list(mission_type: int) -> None:
    if mission_type not in (FENCE, RALLY):
        raise InputError(f"mission type {mission_type}: give 1 (fence) or 2 (rally points)")


def download_items(
    link: Link, sysid: int, mission_type: int = MISSION, *, options: SessionOptions | None = None
) -> tuple[MissionItem, ...]:
    """Return the list on board in wire order. Raises LinkError or VehicleRefused if it cannot be read."""
    settings = options or SessionOptions()

    def steps(channel: Channel) -> LinkSteps[tuple[MissionItem, ...]]:
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
    """Return the mission on board.

    PX4 stores no home in it: there, home is ``home``, else the home that the vehicle reports, else its position. Raises
    InputError if no home is known, LinkError or VehicleRefused if the list cannot be read.
    """
    settings = options or SessionOptions()

    def steps(channel: Channel) -> LinkSteps[Mission]:
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
    link: Link, mission: Mission, *, options: SessionOptions | None = None, judge: ReadBackJudge | None = None
) -> UploadResult:
    """Read the mission on board and compare it with ``mission``; nothing is written.

    Raises LinkError or VehicleRefused if it cannot be read; the result holds the differences.
    """
    task = Task.of(mission, options or SessionOptions(), judge)
    return _run(link, mission.sysid, lambda channel: verifying(channel, task))


def clear_mission(
    link: Link, sysid: int, mission_type: int = MISSION, *, options: SessionOptions | None = None, name: str = ""
) -> UploadResult:
    """Clear one list, or mission, fence and rally points (255), and verify by reading back that nothing is left.

    Raises VehicleRefused (for example: armed, or the mission is being flown) and LinkError.
    """
    kinds = (MISSION, FENCE, RALLY) if mission_type == ALL else (mission_type,)
    return _run(link, sysid, lambda channel: clearing(channel, name, kinds, options or SessionOptions()))


def _same_mission(a: Mission, b: Mission) -> bool:
    """Whether two missions are equal bit for bit, including NaN."""
    same = (a.autopilot, a.home, a.sysid) == (b.autopilot, b.home, b.sysid)
    return same and [item.wire for item in a.items] == [item.wire for item in b.items]


def _run(link: Link, sysid: int, steps: Callable[[Channel], LinkSteps[T]]) -> T:
    channel = link.channel(sysid)
    try:
        return run(channel, steps(channel))
    finally:
        link.drop(channel)
