"""The tasks behind `session`: each is a generator for `link.pump` that handles one vehicle from discovery to result.

The parameters on board are read before a list is sent, held against what it was judged with, and judged again.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from gcsplan.errors import GcsplanError, LinkError, VehicleRefused
from gcsplan.mavlink.link.link import Channel, LinkSteps
from gcsplan.mavlink.link.options import SessionOptions, Task, TransferPatience
from gcsplan.mavlink.link.session.parameters import (
    FENCE_GROUPS,
    PARAMETER_GROUPS,
    judge_fence_parameters,
    judge_parameters,
    settings_words,
    slower_words,
)
from gcsplan.mavlink.link.session.preflight import (
    NEAR_START_M,
    Reasons,
    apart_m,
    identity,
    objections,
    other_home,
    preflight,
    rivals_words,
)
from gcsplan.mavlink.link.session.recheck import Recheck
from gcsplan.mavlink.link.session.recheck import StateJudge as JudgeState
from gcsplan.mavlink.link.session.results import FailsCheck, UploadResult, outcome_word
from gcsplan.mavlink.link.session.steps import (
    SLOW_ANSWER_S,
    ask_wind,
    discover_steps,
    drive,
    parameter_steps,
    wind_steps,
)
from gcsplan.mavlink.link.terrain import TERRAIN_GROUPS, flies_terrain, terrain_steps
from gcsplan.mavlink.link.watch import VehicleState, Watch
from gcsplan.mavlink.mission.autopilots import ARDUPILOTMEGA, max_items, sent_for
from gcsplan.mavlink.mission.autopilots import PX4 as MAV_PX4
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.mavlink.mission.mission import FENCE, MISSION, Mission
from gcsplan.mavlink.mission.parameter_list import needed_groups
from gcsplan.mavlink.mission.parameter_names import OnBoard
from gcsplan.mavlink.mission.return_parameters import deciding
from gcsplan.mavlink.protocol.transfer import (
    Accepted,
    Changed,
    Clear,
    Download,
    Refused,
    Settled,
    VerifiedUpload,
)
from gcsplan.notes.note import Note

_LOOK_S = 0.02


_MOST_HELD = {ARDUPILOTMEGA: 4369, MAV_PX4: 2000}
_MOST_HELD_BY_ANY = 4369


def finding(channel: Channel, watch: Watch, options: SessionOptions) -> LinkSteps[VehicleState]:
    """Find the vehicle and wait while it boots."""
    return discover_steps(
        channel, watch, timeout_s=min(options.discover_s, options.timeout_s), listen_s=options.listen_s,
        standby_s=min(options.standby_s, options.timeout_s),
    )  # fmt: skip


@dataclass(slots=True)
class Readied:
    """A vehicle before a list is sent to it, as far as its checks have come: see `readying`.

    ``against``: why nothing may be sent; ``mission``: what it holds. Both are for `looking` alone.
    """

    watch: Watch
    state: VehicleState | None = None
    warnings: list[Note] = field(default_factory=list)
    values: OnBoard = field(default_factory=OnBoard)
    against: GcsplanError | None = None
    mission: Mission | None = None


def readying(channel: Channel, task: Task, found: Readied) -> LinkSteps[tuple[VehicleState, Recheck]]:
    """Find the vehicle, run preflight, read parameters and wind, and judge; ``found`` has each as soon as it is known.

    Raises VehicleRefused and LinkError where the list may not be sent.
    """
    clock, options, watch, warnings = channel.link.clock, task.options, found.watch, found.warnings
    state = found.state = yield from finding(channel, watch, options)
    recheck = _holding(channel, watch, state, options, lambda now: objections(
        now, task.items, task.autopilot, **_terms(task)
    ))  # fmt: skip
    warnings += _of_link(channel)
    warnings += preflight(state, task.items, task.autopilot, **_terms(task))
    wind_until = clock() + options.wind_s + state.round_trip_s
    if options.wind is not None:
        ask_wind(channel, state)  # its answer is there before all parameters are
    against, found.values = yield from reading_parameters(channel, task, state, watch, recheck)
    warnings += against
    if options.wind is not None:
        found.state = yield from wind_steps(channel, state, recheck, wind_until if options.wind_s else clock())
        beside = options.wind(found.state)
        warnings += [] if beside is None else [beside]
    noted, off = yield from terrain_steps(
        channel, state.address, task.items, found.values, options.terrain, recheck.note
    )
    warnings += noted
    found.values.update(off)
    failed = None
    if task.mission and options.read_parameters:
        failed = yield from judging(channel, task, task.mission, found.values, recheck)
    if failed is not None:
        raise FailsCheck(failed, task.sysid)
    return state, recheck


def looking(channel: Channel, task: Task) -> LinkSteps[Readied]:
    """Check a vehicle as `uploading` does before it sends, and read the mission on board; nothing is written.

    Raises LinkError and VehicleRefused if the vehicle is not found or what it holds cannot be read.
    """
    found = Readied(Watch(task.sysid))
    try:
        yield from readying(channel, task, found)
    except VehicleRefused as why:
        found.against = why
    if found.state is None:
        raise found.against or LinkError("the vehicle was not found", where=f"vehicle {task.sysid}")
    # One that must not be sent to, for it is armed or stands elsewhere, may be read.
    reader = _holding(channel, found.watch, found.state, replace(task.options, ignore_position=True), _ambiguous)
    read = yield from reading(channel, found.state, task.mission_type, task.options, reader)
    home = task.mission.home if task.mission else None
    found.mission = Mission.from_wire(task.autopilot, read.items, home=home, name=task.name, sysid=task.sysid)
    return found


def uploading(channel: Channel, task: Task) -> LinkSteps[UploadResult]:
    """Find the vehicle, run preflight, read parameters, upload and verify. Raises VehicleRefused, LinkError."""
    clock, options = channel.link.clock, task.options
    found = Readied(Watch(task.sysid))
    state, recheck = yield from readying(channel, task, found)
    watch, warnings, values = found.watch, found.warnings, found.values
    texts_before = watch.texts_heard
    machine = VerifiedUpload(
        task.items,
        task.autopilot,
        us=channel.link.us,
        vehicle=state.address,
        mission_type=task.mission_type,
        timers=options.timers,
        attempts=options.attempts,
        gate=recheck.gate,
        most=max_items(task.autopilot, task.mission_type),
    )
    started = clock()
    yield from drive(
        machine,
        channel,
        recheck=recheck,
        patience=TransferPatience(options.timeout_s, len(task.items), started),
        progress=lambda: task.progress(task.name, machine.progress) if task.progress else None,
    )
    settled = machine.result
    assert settled is not None
    changed = settled.outcome if isinstance(settled.outcome, Changed) else None
    if settled.read_back is not None and changed is None:
        seen = yield from recheck.last_look()
        changed = seen if isinstance(seen, Changed) else None
        if seen is not None and changed is None:
            warnings.append(Note("changed_after_read_back", outcome=str(seen)))
    after = watch.state(clock())
    if after and after.armed and not state.armed:
        warnings.append(Note("armed_during_upload"))
    ended_s = clock() - started
    result = yield from result_of(
        task, channel, settled, ended_s, warnings, watch.texts_since(texts_before), values, recheck
    )
    result = replace(result, state=state)
    return replace(result, changed=changed.reason, change=changed.why) if changed else result


def _of_link(channel: Channel) -> list[Note]:
    return [channel.link.note] if channel.link.note else []


def _terms(task: Task) -> dict[str, Any]:
    """Return the arguments of preflight, for the first run and every repetition."""
    options = task.options
    return {
        "mission_type": task.mission_type, "start": task.mission.home if task.mission else None,
        "ground_amsl_m": options.ground_amsl_m, "allow_armed": options.allow_armed,
        "ignore_position": options.ignore_position, "judged": task.judge is not None,
    }  # fmt: skip


def _holding(
    channel: Channel, watch: Watch, state: VehicleState, options: SessionOptions, judge: JudgeState
) -> Recheck:
    return Recheck(channel, watch, state, judge, may_move=options.ignore_position, standby_s=options.standby_s)


def reading(
    channel: Channel, state: VehicleState, mission_type: int, options: SessionOptions, recheck: Recheck | None = None
) -> LinkSteps[Download]:
    """Read one whole list from the address at which ``state`` was heard. Raises VehicleRefused, LinkError."""
    channel.pin(state.peer)
    machine = Download(
        us=channel.link.us, vehicle=state.address, mission_type=mission_type, timers=options.timers,
        most=_MOST_HELD.get(state.mav_autopilot, _MOST_HELD_BY_ANY),
    )  # fmt: skip
    yield from drive(
        machine, channel, recheck=recheck, patience=TransferPatience(options.timeout_s, None, channel.link.clock())
    )
    where = f"vehicle {state.address.sysid}"
    if isinstance(machine.outcome, Changed):
        words = f"reading was stopped: {machine.outcome.why}"
        raise VehicleRefused(words, where=where, reason=machine.outcome.reason)
    if isinstance(machine.outcome, Refused):
        raise VehicleRefused(f"the list cannot be read: {machine.outcome}", where=where)
    if not isinstance(machine.outcome, Accepted):
        raise LinkError(f"the list could not be read: {machine.outcome}", where=where)
    return machine


def looking_at(channel: Channel, options: SessionOptions) -> LinkSteps[tuple[VehicleState, Recheck]]:
    """Find a vehicle to read from and pin its address. Raises VehicleRefused if two vehicles have its system id."""
    watch = Watch(channel.sysid)
    state = yield from finding(channel, watch, options)
    _require_one(state)
    return state, _holding(channel, watch, state, replace(options, ignore_position=True), _ambiguous)


def verifying(channel: Channel, task: Task) -> LinkSteps[UploadResult]:
    """Read the list and compare it with the task's; nothing is written.

    With a judge the parameters are read too, since they decide where the vehicle turns.
    """
    state, recheck = yield from looking_at(channel, task.options)
    warnings = _of_link(channel)
    values = OnBoard()
    if task.judge is not None:
        against: Reasons = []
        identity(state, task.autopilot, against, warnings, judged=True)
        if against:
            raise VehicleRefused(f"not compared: {against[0][1]}", where=f"vehicle {task.sysid}", reason=against[0][0])
        noted, values = yield from reading_parameters(channel, task, state, recheck.watch, recheck)
        warnings += noted
    started = channel.link.clock()
    read = yield from reading(channel, state, task.mission_type, task.options, recheck)
    found = compare(task.items, read.items, task.autopilot, task.mission_type)
    differences = tuple(replace(d, unsent=True) for d in found)
    settled = Settled(Accepted(read.opaque_id), not faults(differences), differences, read.items, "", 1, read.retries)
    ended_s = channel.link.clock() - started
    result = yield from result_of(task, channel, settled, ended_s, warnings, recheck.texts, values, recheck)
    return result


def clearing(
    channel: Channel, name: str, kinds: tuple[int, ...], options: SessionOptions, same: VehicleState | None = None
) -> LinkSteps[UploadResult]:
    """Clear each of ``kinds`` and verify by reading back that nothing is left. Raises VehicleRefused, LinkError.

    ``same``: the intended vehicle as it was seen before; another one is not touched.
    """
    clock = channel.link.clock
    watch = Watch(channel.sysid)
    state = yield from finding(channel, watch, options)
    judge = partial(_against_clearing, options, same)
    against, _ = judge(state)
    if against:
        words = f"not cleared: {'; '.join(text for _, text in against)}"
        raise VehicleRefused(words, where=f"vehicle {channel.sysid}", reason=against[0][0])
    recheck = _holding(channel, watch, state, options, judge)
    started, retries, left = clock(), 0, 0
    for kind in kinds:
        machine = Clear(
            us=channel.link.us, vehicle=state.address, mission_type=kind, timers=options.timers, gate=recheck.gate
        )
        yield from drive(machine, channel, recheck=recheck, patience=TransferPatience(options.timeout_s, 1, clock()))
        retries += machine.retries
        assert machine.outcome is not None
        if isinstance(machine.outcome, (Refused, Changed)):
            reason = machine.outcome.reason if isinstance(machine.outcome, Changed) else ""
            raise VehicleRefused(f"not cleared: {machine.outcome}", where=f"vehicle {channel.sysid}", reason=reason)
        read = yield from reading(channel, state, kind, options, recheck)  # also decides if the ACK was lost
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
        warnings=tuple(_of_link(channel)),
        texts=tuple(watch.texts),
    )


def _against_clearing(
    options: SessionOptions, same: VehicleState | None, state: VehicleState
) -> tuple[Reasons, list[Note]]:
    against, warnings = _ambiguous(state)
    if state.armed and not options.allow_armed:
        against.append(("armed", "the vehicle is armed: disarm it, or allow it with --allow-armed"))
    if same is not None and (same.address, same.peer) != (state.address, state.peer):
        against.append(("another", "it speaks from another address than the vehicle that was uploaded to"))
    away_m = apart_m(same, state) if same is not None else None
    if away_m is not None and away_m > NEAR_START_M and not options.ignore_position:
        against.append(("wrong_place", f"it is {away_m:.0f} m from where the vehicle was that was uploaded to"))
    return against, warnings


def _ambiguous(state: VehicleState) -> tuple[Reasons, list[Note]]:
    return ([("ambiguous", rivals_words(state))] if state.sources > 1 else []), []


def _require_one(state: VehicleState) -> None:
    against, _ = _ambiguous(state)
    if against:
        raise VehicleRefused(against[0][1], where=f"vehicle {state.address.sysid}", reason="ambiguous")


def result_of(
    task: Task,
    channel: Channel,
    settled: Settled,
    seconds: float,
    warnings: list[Note],
    texts: tuple[str, ...],
    values: OnBoard,
    recheck: Recheck,
) -> LinkSteps[UploadResult]:
    """Return the result of ``task``; the caller's check is repeated on the read-back with the parameters read."""
    mission: Mission | None = None
    failed: Note | None = None
    if task.mission and settled.read_back:
        mission = Mission.from_wire(
            task.autopilot, settled.read_back, home=task.mission.home, name=task.name, sysid=task.sysid
        )
        failed = yield from judging(channel, task, sent_for(mission), values, recheck)
        warnings = warnings + other_home(task.mission, settled.read_back)
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


def reading_parameters(
    channel: Channel, task: Task, state: VehicleState, watch: Watch, recheck: Recheck
) -> LinkSteps[tuple[list[Note], OnBoard]]:
    """Read the parameters on board; return warnings about values that do not fit the list, and the values read.

    Until the timeout, it requests the parameters that the judge needs.
    """
    options, mission = task.options, task.mission
    warnings: list[Note] = []
    values = OnBoard()
    if mission and options.read_parameters:
        terrain = TERRAIN_GROUPS if flies_terrain(task.items) else ()
        needed = (*needed_groups(options.settings, task.autopilot), *terrain, *deciding(mission))
        values = yield from parameter_steps(
            channel, state, PARAMETER_GROUPS[task.autopilot] + terrain, watch, recheck,
            needed=needed if task.judge is not None else (), most_s=options.timeout_s,
        )  # fmt: skip
        warnings += judge_parameters(
            values, mission, rtl_rel_home_m=options.rtl_rel_home_m, advised_rel_home_m=options.advised_rel_home_m,
            expected=options.expected_parameters, route=options.route,
            settings=options.settings,
        )  # fmt: skip
        warnings += settings_words(options.settings, values, task.autopilot)
        warnings += slower_words(values, options.vehicle) if options.vehicle else []
    if task.mission_type == FENCE and options.read_parameters:
        groups = FENCE_GROUPS[task.autopilot]
        values = yield from parameter_steps(
            channel, state, groups, watch, recheck, needed=groups, most_s=min(SLOW_ANSWER_S, options.timeout_s)
        )
        warnings += judge_fence_parameters(values)
    return warnings, values


def judging(
    channel: Channel, task: Task, mission: Mission, values: Mapping[str, float], recheck: Recheck
) -> LinkSteps[Note | None]:
    """Ask the task's judge, beside the other vehicles' transfers; return its answer, None without a judge.

    A judge that has not ended after the timeout has not passed. In simulated time the judge runs in line, for no time
    passes meanwhile.
    """
    judge = task.judge
    if judge is None:
        return None
    clock = channel.link.clock
    if clock is not time.monotonic:
        return judge(mission, values)
    ended: list[Note | BaseException | None] = []

    def ask() -> None:
        try:
            ended.append(judge(mission, values))
        except BaseException as error:
            ended.append(error)

    threading.Thread(target=ask, daemon=True, name=f"judge {task.name}").start()
    until = clock() + task.options.timeout_s
    while not ended:
        if clock() >= until:
            return Note("not_judged_in_time", timeout_s=task.options.timeout_s)
        yield clock() + _LOOK_S
        for heard in channel.take():
            recheck.note(heard, clock())
    answer = ended[0]
    if isinstance(answer, BaseException):
        raise answer
    return answer


# Longest list that is read. ArduPilot: 64 KB of missions on an SD card (BRD_SD_MISSION) at 15 bytes per item.
