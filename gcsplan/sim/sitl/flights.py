"""The rehearsal with real autopilots: SITL instances get the missions, are armed and started, and are observed.

Each vehicle flies in its own simulated time (``time_boot_ms``), so a machine that is too slow for all of them at once
does not change the result. Each time is shifted so that the acceptance of MISSION_START falls on the vehicle's
departure offset less `LIFT_S`; the instances need not be synchronous, because they do not interact. Arrival times are
taken from the reported positions.

Because this arms and starts vehicles, the peer must be a simulator (it has the parameter SIM_SPEEDUP) and must be on
this machine, unless the user insists.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Any

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.motion.commands import flown_in_order
from gcsplan.check.motion.stretch import Place, flat_m, offset_m
from gcsplan.errors import LinkError, UsageError, VehicleRefused
from gcsplan.mavlink.link.frames import signing_key
from gcsplan.mavlink.link.link import Channel, Link, LinkSteps, PumpJob, pump
from gcsplan.mavlink.link.session.parameters import settings_words
from gcsplan.mavlink.link.session.steps import discover_steps, parameter_steps
from gcsplan.mavlink.link.url import parse_url
from gcsplan.mavlink.link.watch import VehicleState, Watch
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.fences import FENCE_DECIDES
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mavlink.mission.parameter_list import parameter_list, safety_list
from gcsplan.mavlink.protocol.messages import Address
from gcsplan.notes.note import Note
from gcsplan.sim.flight.trace import Trace
from gcsplan.sim.flight.wind import Weather
from gcsplan.sim.outcome import Rehearsal, RehearsalPart, Tally, Terms, energy_of
from gcsplan.sim.rehearsal import upload_parts
from gcsplan.sim.sitl.wind_parameters import change_steps, wind_parameters, wind_vector
from gcsplan.vehicle import Autopilot
from gcsplan.world.world import World

__all__ = ["rehearse_sitl", "require_here"]

_ARMS_IN = {Autopilot.ARDUCOPTER: 4, Autopilot.ARDUPLANE: 0}
"""Custom modes in which a vehicle can be armed, and from which MISSION_START leads to AUTO: GUIDED, MANUAL."""
_READY_S, SILENT_S, ARM_S, _COMMAND_ANSWER_S = 180.0, 30.0, 120.0, 3.0
_RATE_US = 100_000.0
_ARMED_MS = 3000
"""Milliseconds from arming to MISSION_START: ArduCopter's motors do not turn for 2 s (ARMING_DELAY_SEC)."""
_NEAR_M, _STILL_M_S = 3.0, 0.4
"""The goal is reached when the vehicle is this near (m) and this slow (m/s)."""
_SLACK_M = 0.3
"""Metres: error of a reported position, and deviation from uniform motion between two messages."""
LIFT_S = 1.6
"""Seconds from MISSION_START to leaving the ground, measured on ArduCopter, whose motors spin up first."""
_ODD_LIFT_S = 0.7
_LATE = 1.5
_SPARE_S = 300.0
CIRCLE_RADII = 1.5
"""A plane is at a circle within so many radii of its centre: it flew circles with 1.12 of the item's radius."""
LEAST_REACH_M = 100.0
_CIRCLES = frozenset({cmd.LOITER_UNLIM, cmd.LOITER_TURNS, cmd.LOITER_TIME, cmd.LOITER_TO_ALT})
CIRCLES_S = 60.0
"""Seconds for which it is watched at its goal or, after an RTL, at home."""
_HIT = "SIM Hit ground at "
_HARD_M_S = 0.3
"""A vehicle that stands touches the ground more softly than this."""
_TEXTS = 3
_OTHER_GROUND_M = 5.0
_MODES = {
    Autopilot.ARDUCOPTER: {
        0: "STABILIZE", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 9: "LAND", 16: "POSHOLD",
        17: "BRAKE", 21: "SMART_RTL", 27: "AUTO_RTL",
    },
    Autopilot.ARDUPLANE: {
        0: "MANUAL", 1: "CIRCLE", 2: "STABILIZE", 5: "FBWA", 6: "FBWB", 7: "CRUISE", 10: "AUTO", 11: "RTL",
        12: "LOITER", 15: "GUIDED", 26: "AUTOLAND",
    },
}  # fmt: skip
_ON_GROUND = frozenset({cmd.TAKEOFF, cmd.LAND, cmd.RTL, cmd.VTOL_TAKEOFF, cmd.VTOL_LAND})
"""Commands that are carried out on the ground in part."""


@dataclass(slots=True)
class FlightWatch:
    """The events of one vehicle's flight since its mission was started. ``crashed``: it hit the ground on the way."""

    mission: Mission
    crashed: bool = False
    timed_out: bool = False
    item: int = 0
    _hit: Note | None = None
    _left: Note | None = None
    _texts: list[str] = field(default_factory=list)

    def note(self, message: Any, item: int) -> None:
        """Take a HEARTBEAT or STATUSTEXT of the vehicle, which flies ``item``."""
        self.item = item
        if message.get_type() == "HEARTBEAT":
            modes = _MODES[self.mission.autopilot]
            name = modes.get(message.custom_mode, f"mode {message.custom_mode}")
            if name != "AUTO" and self._left is None:
                self._left = Note("left_auto", item, mode=name)
        elif message.get_type() == "STATUSTEXT":
            self._text(str(message.text), message.severity)

    def _text(self, text: str, severity: int) -> None:
        if text.startswith(_HIT) and self._on_the_way() and _speed_m_s(text) >= _HARD_M_S:
            self.crashed = True
            self._hit = Note("hit_ground", self.item, speed_m_s=_speed_m_s(text))
        elif severity <= dialect.MAV_SEVERITY_WARNING and text not in self._texts:
            self._texts = [*self._texts, text][-_TEXTS:]

    def _on_the_way(self) -> bool:
        index = self.item - self.mission.first_seq
        return 0 <= index < len(self.mission.items) and self.mission.items[index].command not in _ON_GROUND

    def why(self, height_m: float = 0.0) -> tuple[Note, ...]:
        """Why it did not arrive, as far as it is known.

        ``height_m``: above the mission's ground at the end; a simulator that hits ground in the air has another ground.
        """
        known = [note for note in (self._hit, self._left) if note is not None]
        if self.timed_out:
            known.append(Note("time_was_up", self.item))
        if self.crashed and height_m > _OTHER_GROUND_M:
            known.append(Note("other_ground", height_m=height_m))
        if self._texts:
            known.append(Note("vehicle_said", texts=" / ".join(self._texts)))
        return tuple(known)


def _speed_m_s(text: str) -> float:
    """The number in ``SIM Hit ground at 1.5 m/s``; 0 if it is none."""
    try:
        return float(text.removeprefix(_HIT).split()[0])
    except (ValueError, IndexError):
        return 0.0


@dataclass(slots=True)
class _Log:
    """The reports of one vehicle in flight; ``released_ms``: its boot time at the acceptance of MISSION_START;
    ``reached_ms``: at which it reported an item as reached for the first time."""

    watch: FlightWatch
    released_ms: int = 0
    boot_ms: list[int] = field(default_factory=list)
    places: list[tuple[float, float, float]] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    items: list[int] = field(default_factory=list)
    reached_ms: dict[int, int] = field(default_factory=dict)
    down: bool = False


def require_here(urls: Sequence[str]) -> None:
    """Raise UsageError for a link to another machine or a serial port."""
    for url in urls:
        end = parse_url(url)
        if end.kind == "serial" or not (end.host.startswith("127.") or end.host in ("localhost", "::1")):
            raise UsageError(
                f"--sitl arms vehicles and starts their missions, and {url} is not an address of this machine alone: "
                f"give 127.0.0.1, or --i-know if what answers there is a simulator as well"
            )


def rehearse_sitl(
    parts: Sequence[RehearsalPart],
    world: World,
    terms: Terms,
    seats: Mapping[str, str],
    *,
    i_know: bool = False,
    report: Callable[[str, str], None] | None = None,
    weather: Weather | None = None,
    seed: int = 1,
) -> Rehearsal:
    """Upload, arm, start, observe and judge one run.

    ``seats``: the URL of each vehicle's autopilot, by its name; ``report(vehicle, what)``: progress. ``weather``: its
    wind and gusts are set in the simulators for the flight, the same at every height; ``seed``: of what it draws.

    Raises UsageError for a vehicle without a URL, an autopilot that is not ArduPilot, and (unless ``i_know``) a link
    to another machine; VehicleRefused if a peer is no simulator, does not arm, or refuses its mission; LinkError if
    nobody answers.
    """
    for part in parts:
        if part.vehicle.name not in seats:
            name = part.vehicle.name
            raise UsageError(f"--sitl: {name} has no address; give {name}=tcp:127.0.0.1:5760")
        if part.vehicle.autopilot not in _ARMS_IN:
            raise UsageError(f"--sitl flies ArduCopter and ArduPlane; {part.vehicle.name} is {part.vehicle.autopilot}")
    if not i_know:
        require_here([seats[p.vehicle.name] for p in parts])
    tell = report or (lambda name, what: None)
    with ExitStack() as stack:
        urls = list(dict.fromkeys(seats[p.vehicle.name] for p in parts))
        links = {url: stack.enter_context(Link(url, key=signing_key())) for url in urls}
        channels = [links[seats[p.vehicle.name]].channel(p.vehicle.sysid) for p in parts]
        found = _all([PumpJob(c, _ready(c, p, tell, i_know=i_know)) for c, p in zip(channels, parts, strict=True)])
        states: list[VehicleState] = [state for state, _ in found]
        upload_parts(parts, [channel.link for channel in channels])
        weather = (weather or Weather()).steady(seed)
        wind = wind_parameters(weather, seed)
        calm = _all([PumpJob(c, change_steps(c, s, wind)) for c, s in zip(channels, states, strict=True)])
        flights = [PumpJob(c, _fly(c, p, s, world, tell)) for c, p, s in zip(channels, parts, states, strict=True)]
        logs = _all(flights)
        _all([PumpJob(c, change_steps(c, s, was)) for c, s, was in zip(channels, states, calm, strict=True)])
    tally = Tally(parts, terms)
    traces = [_trace(log, part, world) for log, part in zip(logs, parts, strict=True)]
    tally.add(traces, world, [_spent_j(t, p, weather, seed) for t, p in zip(traces, parts, strict=True)])
    tally.notes += [words for _, unlike in found for words in unlike]
    tally.notes.append(Note("released_early", before_s=LIFT_S))
    tally.notes += [
        Note("left_ground_off_time", vehicle=t.name, off_s=t.begin_s - p.depart_s)
        for t, p in zip(traces, parts, strict=True)
        if abs(t.begin_s - p.depart_s) > _ODD_LIFT_S
    ]
    return tally.result("sitl", seed if wind else 0, weather.as_dict() if wind else {}, [()] * len(parts))


def _spent_j(trace: Trace, part: RehearsalPart, weather: Weather, seed: int) -> float:
    """The energy of a flight, J: by its time, and the metres through the mean wind."""
    held_s = math.fsum(leg.hold_s * leg.times for leg in part.verdict.legs if math.isfinite(leg.hold_s))
    held_s = min(held_s, trace.end_s - trace.begin_s)
    moved_s = trace.end_s - trace.begin_s - held_s
    if not weather.wind_m_s:
        return energy_of(trace.points, held_s, part.vehicle, moved_s)
    blown = np.diff(trace.times_s)[:, None] * np.array(wind_vector(weather, seed))
    air_m = float(np.hypot(*(np.diff(trace.points[:, :2], axis=0) - blown).T).sum())
    # The metres of the holds are among them; they are those of the wind.
    air_m = max(air_m - weather.wind_m_s * held_s, 0.0)
    return energy_of(trace.points, held_s, part.vehicle, moved_s, air_m, weather.wind_m_s)


def _all(jobs: list[PumpJob[Any]]) -> list[Any]:
    """Run all jobs to their ends and return their results; raise the first error."""
    pump(jobs)
    for job in jobs:
        if job.error is not None:
            raise job.error
    return [job.result for job in jobs]


# -- one vehicle ----------------------------------------------------------------------------------------------------


def _ready(
    channel: Channel, part: RehearsalPart, report: Callable[[str, str], None], *, i_know: bool
) -> LinkSteps[tuple[VehicleState, list[Note]]]:
    """Wait until the vehicle has a position and a home, and make sure that it is a simulator and not armed.

    Return its state, and which of its parameters are not those that the mission was judged with.
    """
    clock, name = channel.link.clock, part.vehicle.name
    end = clock() + _READY_S
    report(name, "waits for its position")
    while True:
        watch = Watch(channel.sysid)
        state = yield from discover_steps(channel, watch, timeout_s=20.0, listen_s=0.0, standby_s=60.0)
        if state.located and state.home is not None:
            break
        if clock() > end:
            raise VehicleRefused(f"{name}: it has no position after {_READY_S:g} s", where=channel.link.url)
    settings = parameter_list(part.mission, part.vehicle, rtl_rel_home_m=part.rtl_rel_home_m)
    decide: tuple[tuple[str, ...], ...] = ()
    if part.verdict.extent is not None:
        settings += safety_list(part.vehicle.autopilot, part.verdict.extent)
        decide = FENCE_DECIDES[part.vehicle.autopilot]
    groups = (("SIM_SPEEDUP",), *dict.fromkeys((*(s.parameter.group() for s in settings), *decide)))
    values = yield from parameter_steps(channel, state, groups, watch)
    if "SIM_SPEEDUP" not in values and not i_know:
        raise VehicleRefused(
            f"{name}: what answers at {channel.link.url} has no parameter SIM_SPEEDUP, so it is no simulator: a "
            f"rehearsal would arm it and start its mission. Nothing was sent to it (--i-know insists)"
        )
    if state.armed:
        raise VehicleRefused(f"{name}: it is armed already: let it land, or start it anew", where=channel.link.url)
    return state, [note.of(vehicle=name) for note in settings_words(settings, values, part.vehicle.autopilot)]


def _fly(
    channel: Channel, part: RehearsalPart, state: VehicleState, world: World, report: Callable[[str, str], None]
) -> LinkSteps[_Log]:
    """Arm, start, and record until the vehicle is down, or at its goal if it stays in the air."""
    to, name, log = state.address, part.vehicle.name, _Log(FlightWatch(part.mission))
    pilot = _SitlPilot(channel, to, log)
    for message, every_us in (
        (dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, _RATE_US), (dialect.MAVLINK_MSG_ID_MISSION_CURRENT, _RATE_US)
    ):  # fmt: skip
        yield from pilot.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, message, every_us)
    report(name, "arms")
    mode = _ARMS_IN[part.vehicle.autopilot]
    yield from pilot.insist(dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, mode)
    yield from pilot.insist(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    armed_ms = pilot.boot_ms
    while pilot.boot_ms < armed_ms + _ARMED_MS:
        yield from pilot.listen(_COMMAND_ANSWER_S)
    yield from pilot.insist(dialect.MAV_CMD_MISSION_START)
    report(name, "flies")
    planned_s = part.verdict.time_s if part.arrive_s is None else part.arrive_s - part.depart_s + part.verdict.time_s
    latest_ms = log.released_ms + 1000.0 * (_LATE * planned_s + _SPARE_S)
    goal = _goal(part)
    landing = part.mission.first_seq + len(part.mission.items) - 1
    last = flown_in_order(part.mission)[-1].command
    item = 0
    while True:
        yield from pilot.listen(_COMMAND_ANSWER_S)
        if item != pilot.item:
            item = pilot.item
            report(name, f"flies item {item}")
        if log.down or pilot.boot_ms > latest_ms or log.watch.crashed:
            log.watch.timed_out = pilot.boot_ms > latest_ms
            return log
        if not log.places:
            continue
        if last == cmd.LAND and item == landing:
            lat_deg, lon_deg, amsl_m = log.places[-1]
            if amsl_m <= world.ground_amsl(lat_deg, lon_deg) + 0.3:
                log.down = True  # an SITL without terrain, flat at the altitude of home, would sink into higher ground
                return log
        if part.vehicle.autopilot is Autopilot.ARDUPLANE:
            if is_over(part, log.places, log.boot_ms, goal):
                return log
        elif (
            last not in (cmd.LAND, cmd.RTL)
            and _apart_m(log.places[-1], goal) <= _NEAR_M
            and log.speeds[-1] <= _STILL_M_S
        ):
            return log


class _SitlPilot:
    """Sends commands to one vehicle and records its messages; its methods are generators of `link.LinkSteps`."""

    def __init__(self, channel: Channel, to: Address, log: _Log) -> None:
        self._channel, self._to, self._log = channel, to, log
        self._results: dict[int, int] = {}
        self._texts: list[str] = []
        self._heard_at = channel.link.clock()
        self._was_armed = False
        self.boot_ms, self.item = 0, 0

    def listen(self, within_s: float) -> LinkSteps[None]:
        """Record messages; return as soon as one came, or after ``within_s``. Raises LinkError after `SILENT_S`."""
        clock = self._channel.link.clock
        if not self._channel.waits:
            yield clock() + within_s
        for heard in self._channel.take():
            if heard.source == self._to:
                self._heard_at = clock()
                self._note(heard.message)
        if clock() - self._heard_at > SILENT_S:
            raise LinkError(
                f"system {self._to.sysid} has been silent for {SILENT_S:g} s in the middle of the rehearsal",
                where=self._channel.link.url,
            )

    def _note(self, message: Any) -> None:
        kind, log = message.get_type(), self._log
        if kind == "GLOBAL_POSITION_INT":
            self.boot_ms = message.time_boot_ms
            if log.released_ms:
                log.boot_ms.append(message.time_boot_ms)
                log.places.append((message.lat / 1e7, message.lon / 1e7, message.alt / 1e3))
                log.speeds.append(math.hypot(message.vx, message.vy, message.vz) / 100.0)
                log.items.append(self.item)
        elif kind == "MISSION_CURRENT":
            self.item = message.seq
        elif kind == "MISSION_ITEM_REACHED":
            log.reached_ms.setdefault(message.seq, self.boot_ms)
        elif kind == "HEARTBEAT":
            armed = bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
            log.down = log.down or (bool(log.released_ms) and self._was_armed and not armed)
            self._was_armed = armed
        elif kind == "COMMAND_ACK":
            self._results[message.command] = message.result
            started = message.command == dialect.MAV_CMD_MISSION_START
            if started and message.result == dialect.MAV_RESULT_ACCEPTED and not log.released_ms:
                log.released_ms = self.boot_ms  # at the message's place in the stream, not when the task reads it
        elif kind == "STATUSTEXT":
            self._texts.append(str(message.text))
        if log.released_ms:
            log.watch.note(message, self.item)

    def command(self, command: int, *params: float) -> LinkSteps[int | None]:
        """Send a command once; return its MAV_RESULT, None without an answer."""
        clock = self._channel.link.clock
        self._results.pop(command, None)
        p = (*params, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)[:7]
        self._channel.send(dialect.MAVLink_command_long_message(*self._to, command, 0, *p), self._to)
        end = clock() + _COMMAND_ANSWER_S
        while command not in self._results and clock() < end:
            yield from self.listen(end - clock())
        return self._results.get(command)

    def insist(self, command: int, *params: float) -> LinkSteps[None]:
        """Send a command until it is accepted; an autopilot that has just got its position does not arm at once.

        Raises VehicleRefused after `ARM_S`.
        """
        clock = self._channel.link.clock
        end = clock() + ARM_S
        while True:
            result = yield from self.command(command, *params)
            if result == dialect.MAV_RESULT_ACCEPTED:
                return
            if clock() > end:
                texts = " / ".join(self._texts[-3:])
                raise VehicleRefused(
                    f"system {self._to.sysid} does not take command {command} (result {result}); it says: "
                    f"{texts or 'nothing'}",
                    where=self._channel.link.url,
                )
            again = clock() + 1.0
            while clock() < again:
                yield from self.listen(again - clock())


# -- what was flown -------------------------------------------------------------------------------------------------


def _goal(part: RehearsalPart) -> tuple[float, float, float]:
    """Return the end of the path: latitude, longitude, amsl_m."""
    legs = part.verdict.path_legs or part.verdict.legs
    return legs[-1].end


def _apart_m(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    return math.hypot(*offset_m(a, b), b[2] - a[2])


def _trace(log: _Log, part: RehearsalPart, world: World) -> Trace:
    """Return the positions as a trace in the fleet's time, from leaving the ground to the end."""
    name = part.vehicle.name
    if len(log.places) < 2:
        raise LinkError(f"{name}: no positions came after its mission was started")
    released_s = part.depart_s - LIFT_S
    times, first = np.unique((np.array(log.boot_ms) - log.released_ms) / 1000.0 + released_s, return_index=True)
    places, items = np.array(log.places)[first], np.array(log.items)[first]
    points = np.column_stack([world.frame.to_plane(places[:, 0], places[:, 1]), places[:, 2]])
    goal = _goal(part)
    aim = np.array([*world.frame.to_plane(goal[0], goal[1]), goal[2]])
    apart = np.linalg.norm(points - aim, axis=1)
    there = (apart <= _NEAR_M) & (np.array(log.speeds)[first] <= _STILL_M_S)
    arrive_s = float(times[int(there.argmax())]) if there.any() else math.nan
    if not there.any() and float(apart.min()) <= _NEAR_M:  # it passed the goal without stopping
        arrive_s = float(times[int(apart.argmin())])
    wing = part.vehicle.autopilot is Autopilot.ARDUPLANE
    if wing:
        level = np.linalg.norm((points - aim)[:, :2], axis=1)
        arrive_s = arrival_s(part, times, level, np.array(log.speeds)[first])
    up = int((points[:, 2] > points[0, 2] + 0.3).argmax())
    begin = max(0, up - 1)
    legs = part.verdict.path_legs or part.verdict.legs
    if legs[-1].seq in log.reached_ms:  # it says so itself; it is slow and near about a second before
        arrive_s = (log.reached_ms[legs[-1].seq] - log.released_ms) / 1000.0 + released_s
    command = {part.mission.first_seq + i: item.command for i, item in enumerate(part.mission.items)}
    moved = np.hypot(*np.diff(points[:, :2], axis=0).T) < np.abs(np.diff(points[:, 2])) + 0.05
    vertical = np.array([command.get(int(i)) in (cmd.TAKEOFF, cmd.LAND, cmd.RTL) for i in items[:-1]])
    before = items[:-1] < part.mission.first_seq  # no current item reported yet: it is taking off
    column = is_column(part, points, items) if wing else (vertical & moved) | before
    last = flown_in_order(part.mission)[-1].command
    height_m = float(points[-1, 2]) - world.ground_amsl(*places[-1, :2])
    return Trace(
        name, times[begin:], points[begin:], column[begin:], items[:-1][begin:].astype(np.intp),
        arrive_s, _SLACK_M, np.full(len(times) - begin - 1, _SLACK_M),
        not log.down and last not in (cmd.LAND, cmd.RTL) and not part.leaves, part.leaves, log.watch.why(height_m),
    )  # fmt: skip


# -- a plane: when it arrives at its goal, at which it does not stop, and when its flight is over --------------------


def reach_m(part: RehearsalPart) -> float:
    """How near to its goal, m, a plane is there."""
    return max(LEAST_REACH_M, CIRCLE_RADII * part.vehicle.turn_radius_m)


def arrival_s(part: RehearsalPart, times_s: Floats, apart_m: Floats, speed_m_s: Floats) -> float:
    """When it is at its goal: where it is nearest to it, seconds; NaN if it never comes within `reach_m`.

    A plane that is to circle about its goal turns aside before: it has arrived when it would have been there.
    """
    inside = apart_m <= reach_m(part)
    if not inside.any():
        return math.nan
    first = nearest = int(inside.argmax())
    while nearest + 1 < len(apart_m) and apart_m[nearest + 1] < apart_m[nearest]:
        nearest += 1
    if flown_in_order(part.mission)[-1].command in _CIRCLES:
        return float(times_s[first] + apart_m[first] / max(float(speed_m_s[first]), 1.0))
    return float(times_s[nearest])


def is_column(part: RehearsalPart, points: Floats, items: Indices) -> Bools:
    """(M - 1,) whether each piece between M points belongs to the climb-out or the glide.

    A plane climbs out faster than planned: it is in its climb-out as long as the planned one is, whatever it flies to.
    """
    climb_out = takewhile(lambda leg: leg.column, part.verdict.legs)
    climb_out_m = math.fsum(leg.horizontal_m for leg in climb_out)
    flown_m = np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))
    landing = part.mission.first_seq + len(part.mission.items) - 1
    glides = (items[:-1] == landing) & (flown_in_order(part.mission)[-1].command == cmd.LAND)
    return np.asarray((flown_m <= climb_out_m) | glides)


def is_over(part: RehearsalPart, places: Sequence[Place], boot_ms: Sequence[int], goal: Place) -> bool:
    """Whether it has been at the end of its flight for `CIRCLES_S`; a landing ends otherwise."""
    last = flown_in_order(part.mission)[-1].command
    home = part.mission.home
    end = (home.lat_e7 / 1e7, home.lon_e7 / 1e7, home.amsl_m) if last == cmd.RTL else goal
    if last == cmd.LAND or flat_m(places[-1], end) > reach_m(part):
        return False
    since = len(places) - 1
    while since > 0 and boot_ms[-1] - boot_ms[since - 1] <= 1000.0 * CIRCLES_S:
        since -= 1
    return boot_ms[-1] - boot_ms[since] >= 990.0 * CIRCLES_S and flat_m(places[since], end) <= reach_m(part)
