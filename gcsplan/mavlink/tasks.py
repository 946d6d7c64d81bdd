"""The tasks behind `session`: each a generator for `link.pump`, about one vehicle, from finding it to the result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from gcsplan.errors import LinkError, VehicleRefused
from gcsplan.mavlink.compare import compare, faults
from gcsplan.mavlink.link import Channel, Steps, drive
from gcsplan.mavlink.mission import FENCE, MISSION, RELATIVE, Home, Mission, MissionItem
from gcsplan.mavlink.parameters import FENCE_GROUPS, GROUPS, judge_fence_parameters, judge_parameters
from gcsplan.mavlink.preflight import NEAR_GROUND_M, NEAR_START_M, distance_m, preflight
from gcsplan.mavlink.results import UploadResult, outcome_word
from gcsplan.mavlink.steps import discover_steps, parameter_steps
from gcsplan.mavlink.transfer import Accepted, Clear, Download, Progress, Refused, Settled, Timers, VerifiedUpload
from gcsplan.mavlink.watch import VehicleState, Watch
from gcsplan.vehicle import Autopilot

ProgressCall = Callable[[str, Progress], None]
Judge = Callable[[Mission], str | None]
"""The check again, on what was read back: None if it passes, else why not."""


@dataclass(frozen=True, slots=True)
class Options:
    """How to go about it. ``unchecked`` sends without a verdict; ``simulated`` is only passed on to the result.

    ``discover_s``: wait for a first heartbeat; ``listen_s``: listen for rivals after it; ``standby_s``: wait for a
    vehicle that is booting. ``ground_amsl_m``: DEM height at the start, by default the altitude of the mission's home.
    ``rtl_rel_home_m`` and ``expected_parameters`` are what the parameters on board are compared with.
    """

    unchecked: bool = False
    allow_armed: bool = False
    ignore_position: bool = False
    ground_amsl_m: float | None = None
    rtl_rel_home_m: float | None = None
    expected_parameters: Mapping[str, float] = field(default_factory=dict)
    read_parameters: bool = True
    discover_s: float = 10.0
    listen_s: float = 1.5
    standby_s: float = 30.0
    attempts: int = 4
    timers: Timers = field(default_factory=Timers)
    simulated: bool = False


@dataclass(frozen=True)
class Task:
    """One list in wire order for one vehicle; ``mission`` where it is one, else a fence or rally points."""

    name: str
    sysid: int
    autopilot: Autopilot
    items: tuple[MissionItem, ...]
    mission_type: int
    options: Options
    mission: Mission | None = None
    judge: Judge | None = None
    progress: ProgressCall | None = None

    @classmethod
    def of(cls, mission: Mission, options: Options, judge: Judge | None, progress: ProgressCall | None = None) -> Task:
        """The task of sending ``mission``."""
        return cls(
            mission.name, mission.sysid, mission.autopilot, mission.wire_items(), MISSION, options, mission, judge,
            progress,
        )  # fmt: skip


def finding(channel: Channel, watch: Watch, options: Options) -> Steps[VehicleState]:
    """Find the vehicle, and wait for it while it boots."""
    return discover_steps(
        channel, watch, timeout_s=options.discover_s, listen_s=options.listen_s, standby_s=options.standby_s
    )


def uploading(channel: Channel, task: Task) -> Steps[UploadResult]:
    """Find, preflight, read parameters, upload and prove. Raises VehicleRefused, LinkError."""
    clock, options, mission = channel.link.clock, task.options, task.mission
    watch = Watch(task.sysid)
    state = yield from finding(channel, watch, options)
    warnings = preflight(
        state,
        task.items,
        task.autopilot,
        mission_type=task.mission_type,
        start=mission.home if mission else None,
        ground_amsl_m=options.ground_amsl_m,
        allow_armed=options.allow_armed,
        ignore_position=options.ignore_position,
    )
    if mission and options.read_parameters:
        values = yield from parameter_steps(channel, state, GROUPS[task.autopilot], watch)
        warnings += judge_parameters(
            values, mission, rtl_rel_home_m=options.rtl_rel_home_m, expected=options.expected_parameters
        )
    if task.mission_type == FENCE and options.read_parameters:
        values = yield from parameter_steps(channel, state, FENCE_GROUPS[task.autopilot], watch)
        warnings += judge_fence_parameters(values)
    said_before = watch.said
    machine = VerifiedUpload(
        task.items,
        task.autopilot,
        us=channel.link.us,
        vehicle=state.address,
        mission_type=task.mission_type,
        timers=options.timers,
        attempts=options.attempts,
    )
    started = clock()
    yield from drive(
        machine,
        channel,
        watch=lambda heard: watch.note(heard, clock()),
        progress=lambda: task.progress(task.name, machine.progress) if task.progress else None,
    )
    assert machine.result is not None
    after = watch.state(clock())
    if after and after.armed and not state.armed:
        warnings.append("the vehicle was armed by somebody during the upload")
    return result_of(task, channel, machine.result, clock() - started, warnings, watch.texts_since(said_before))


def reading(channel: Channel, state: VehicleState, mission_type: int, options: Options) -> Steps[Download]:
    """Read one list whole. Raises VehicleRefused, LinkError."""
    machine = Download(us=channel.link.us, vehicle=state.address, mission_type=mission_type, timers=options.timers)
    yield from drive(machine, channel)
    where = f"vehicle {state.address.sysid}"
    if isinstance(machine.outcome, Refused):
        raise VehicleRefused(f"the list cannot be read: {machine.outcome}", where=where)
    if not isinstance(machine.outcome, Accepted):
        raise LinkError(f"the list could not be read: {machine.outcome}", where=where)
    return machine


def verifying(channel: Channel, task: Task) -> Steps[UploadResult]:
    """Read the list and compare; nothing is written."""
    watch = Watch(task.sysid)
    state = yield from finding(channel, watch, task.options)
    started = channel.link.clock()
    read = yield from reading(channel, state, task.mission_type, task.options)
    differences = tuple(compare(task.items, read.items, task.autopilot, task.mission_type))
    settled = Settled(Accepted(read.opaque_id), not faults(differences), differences, read.items, "", 1, read.retries)
    return result_of(task, channel, settled, channel.link.clock() - started, [], tuple(watch.texts))


def clearing(channel: Channel, name: str, kinds: tuple[int, ...], options: Options) -> Steps[UploadResult]:
    """Clear each of ``kinds`` and read back that nothing is left. Raises VehicleRefused, LinkError."""
    clock = channel.link.clock
    watch = Watch(channel.sysid)
    state = yield from finding(channel, watch, options)
    if state.armed and not options.allow_armed:
        raise VehicleRefused(
            "not cleared: the vehicle is armed: disarm it, or allow it with --allow-armed",
            where=f"vehicle {channel.sysid}",
            reason="armed",
        )
    started, retries, left = clock(), 0, 0
    for kind in kinds:
        machine = Clear(us=channel.link.us, vehicle=state.address, mission_type=kind, timers=options.timers)
        yield from drive(machine, channel, watch=lambda heard: watch.note(heard, clock()))
        retries += machine.retries
        assert machine.outcome is not None
        if isinstance(machine.outcome, Refused):
            raise VehicleRefused(f"not cleared: {machine.outcome}", where=f"vehicle {channel.sysid}")
        read = yield from reading(channel, state, kind, options)  # settles a lost answer as well
        retries += read.retries
        left += 0 if kind == MISSION and len(read.items) == 1 else len(read.items)  # ArduPilot's home may stay
    return UploadResult(
        name,
        channel.sysid,
        channel.link.url,
        "unknown" if left else "accepted",
        not left,
        0,
        clock() - started,
        retries,
        simulated=options.simulated,
        mission_type=kinds[0],
        reason=f"unknown: {left} items are still there" if left else "accepted",
        on_board=f"the vehicle still holds {left} items" if left else "",
        texts=tuple(watch.texts),
    )


def result_of(
    task: Task, channel: Channel, settled: Settled, seconds: float, warnings: list[str], texts: tuple[str, ...]
) -> UploadResult:
    """What became of ``task``, with the caller's check of what was read back."""
    mission: Mission | None = None
    failed: str | None = None
    if task.mission and settled.read_back:
        mission = Mission.from_wire(
            task.autopilot, settled.read_back, home=task.mission.home, name=task.name, sysid=task.sysid
        )
        failed = task.judge(mission) if task.judge else None
        warnings = warnings + _other_home(task.mission, settled.read_back)
    return UploadResult(
        task.name,
        task.sysid,
        channel.link.url,
        outcome_word(settled.outcome),
        settled.verified and failed is None,
        len(task.items),
        seconds,
        settled.retries,
        settled.attempts,
        task.options.simulated,
        task.mission_type,
        str(settled.outcome),
        settled.on_board,
        failed,
        settled.differences,
        tuple(warnings),
        texts,
        settled.read_back,
        mission,
    )


def _other_home(mission: Mission, read: tuple[MissionItem, ...]) -> list[str]:
    """ArduPilot's item 0 is where it will count relative altitudes from, unless it is armed elsewhere."""
    if not mission.autopilot.is_ardupilot or (read[0].x, read[0].y) == (0, 0):
        return []
    theirs, ours = Home(read[0].x, read[0].y, read[0].z), mission.home
    away_m = distance_m(ours.lat_e7 / 1e7, ours.lon_e7 / 1e7, theirs.lat_e7 / 1e7, theirs.lon_e7 / 1e7)
    higher_m = theirs.amsl_m - ours.amsl_m
    if away_m <= NEAR_START_M and abs(higher_m) <= NEAR_GROUND_M:
        return []
    relative = any(item.frame in (RELATIVE, 6) for item in mission.items)
    counts = "; its relative altitudes count from there if it is not armed at the start" if relative else ""
    return [f"the vehicle's home is {away_m:.0f} m from the mission's start and {higher_m:+.1f} m in height{counts}"]
