"""Flight along tracks in simulated time: fixed steps, all vehicles of all runs at once.

A lane is one vehicle in one run: lane ``r · vehicles + v``. Its state is the distance along its track, its speed, and
the commanded speed. In each step it accelerates up to the limit set by the commanded speed, the piece, the wind and the
braking distance to everything ahead. A step of uniform acceleration is exact, so the step length matters only if a
limit begins within a step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.flight.times import DAY_S
from gcsplan.sim.flight.kinematics import AT_ONCE_M_S2
from gcsplan.sim.flight.trace import Trace
from gcsplan.sim.flight.track import PASSED, CommandedTrack
from gcsplan.sim.flight.wind import Air, Weather
from gcsplan.vehicle import Vehicle

FLIGHT_STEP_S = 0.1
SAMPLE_STEPS = 2
SAMPLE_S = FLIGHT_STEP_S * SAMPLE_STEPS
"""Seconds between recorded samples of the flight."""
CRAWL_M_S = 0.05
"""Lowest speed in a corner, m/s: a vehicle comes to rest only at a stop."""
HEADWAY_M_S = 0.3
"""Lowest speed over ground, m/s, against a wind that is too strong for the vehicle."""
PATIENCE = 4.0
"""Lanes are given up this many durations of the longest flight in still air, plus `PATIENCE_SPARE_S`, after the last
start."""
PATIENCE_SPARE_S = 300.0


@dataclass(frozen=True, eq=False, slots=True)
class FlownLanes:
    """The flown motion of L lanes, sampled at ``times_s`` (J,), seconds since the fleet's common start.

    ``along_m`` (J, L): distance along its track; ``offset_m`` (J, L, 3): offset from it in east, north and up, None
    without weather. ``begin_s``, ``arrive_s``, ``end_s`` (L,): times of leaving the ground, of reaching the goal, and
    of touch-down (or reaching the last point); NaN if never. ``hold_s`` (L,): seconds of standing in the air.
    ``air_m``, ``held_air_m`` (L,): horizontal metres through the air, while it moves and while it stands in the air;
    ``cruise_m_s`` (L,): mean airspeed, except in columns.
    ``stops``: for each lane, (node, time reached, time left) of every stop.
    """

    tracks: tuple[CommandedTrack, ...]
    runs: int
    times_s: Floats
    along_m: Floats
    offset_m: Floats | None
    begin_s: Floats
    arrive_s: Floats
    end_s: Floats
    hold_s: Floats
    air_m: Floats
    held_air_m: Floats
    cruise_m_s: Floats
    stops: tuple[tuple[tuple[int, float, float], ...], ...]

    def energy_j(self, lane: int, vehicle: Vehicle) -> float:
        """Joules of a lane in the air that it flew through, up to where it came."""
        track, held_s = self.track_of(lane), float(self.hold_s[lane])
        climbed_m = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(track.points[:, 2])))])
        up_m = float(np.interp(self.along_m[-1, lane], track.node_m, climbed_m))
        wind_m_s = float(self.held_air_m[lane]) / held_s if held_s > 0.0 else 0.0
        moving_j = vehicle.energy.under_way_j(up_m, float(self.air_m[lane]), self.moved_s(lane))
        return moving_j + vehicle.energy.hold_w(wind_m_s) * held_s

    def moved_s(self, lane: int) -> float:
        """Seconds of moving in the air, up to the end or, if it never came there, to the last sample."""
        end_s = float(self.end_s[lane])
        until_s = end_s if math.isfinite(end_s) else float(self.times_s[-1])
        return max(until_s - float(self.begin_s[lane]) - float(self.hold_s[lane]), 0.0)

    def track_of(self, lane: int) -> CommandedTrack:
        """Return the track of a lane."""
        return self.tracks[lane % len(self.tracks)]

    def points(self, lane: int) -> Floats:
        """(J, 3) positions of a lane at each sample."""
        return self._places(lane, self.times_s, self.along_m[:, lane])

    def trace(self, lane: int, *, leaves: bool = False) -> Trace:
        """Return the trace of a lane, from leaving the ground to its end; it includes every node of the track."""
        track = self.track_of(lane)
        s = track.node_m
        end_s = self.end_s[lane] if np.isfinite(self.end_s[lane]) else self.times_s[-1]
        kept = (self.times_s > self.begin_s[lane]) & (self.times_s < end_s)
        stops = [(at, float(s[node])) for node, reached, left in self.stops[lane] for at in (reached, left)]
        stops = [(at, where) for at, where in stops if self.begin_s[lane] <= at <= end_s]
        flown = self.along_m[:, lane]
        passed = s[(track.hold_s == PASSED) & (s < flown[-1])]
        sampled, first = np.unique(np.append(self.times_s[kept], [at for at, _ in stops]), return_index=True)
        sampled_m = np.maximum.accumulate(np.append(flown[kept], [where for _, where in stops])[first])
        slack = track.slack_m(sampled, sampled_m)
        times, first = np.unique(np.append(sampled, np.interp(passed, sampled_m, sampled)), return_index=True)
        along = np.maximum.accumulate(np.append(sampled_m, passed)[first])
        middle = 0.5 * (along[1:] + along[:-1])
        piece = np.clip(np.searchsorted(s, middle, side="right") - 1, 0, len(track.column) - 1)
        of = np.searchsorted(sampled, 0.5 * (times[1:] + times[:-1]), side="right") - 1
        return Trace(
            track.name, times, self._places(lane, times, along), track.column[piece], track.seq[piece],
            float(self.arrive_s[lane]), 0.0, slack[of], track.ends_in_air and not leaves, leaves,
        )  # fmt: skip

    def _places(self, lane: int, times: Floats, along: Floats) -> Floats:
        track = self.track_of(lane)
        on_track = np.column_stack([np.interp(along, track.node_m, track.points[:, k]) for k in range(3)])
        if self.offset_m is None:
            return on_track
        off = self.offset_m[:, lane]
        return on_track + np.column_stack([np.interp(times, self.times_s, off[:, k]) for k in range(3)])


class _Ways:
    """The pieces of all tracks in one array each, and for each piece the next stop."""

    def __init__(self, tracks: Sequence[CommandedTrack]) -> None:
        length, along = [t.length_m for t in tracks], [t.node_m for t in tracks]
        braking = [t.braking() for t in tracks]
        self.first: Indices = np.cumsum([0, *(len(one) for one in length[:-1])]).astype(np.intp)
        self.begin, self.end = np.concatenate([a[:-1] for a in along]), np.concatenate([a[1:] for a in along])
        self.square = np.concatenate([w[1:] for w in braking])
        self.cap = np.concatenate([t.cap_m_s for t in tracks])
        self.command = np.concatenate([t.command_m_s for t in tracks])
        self.level = np.concatenate([t.level for t in tracks])
        self.accel = np.concatenate([t.accel_m_s2 for t in tracks])
        self.column = np.concatenate([t.column for t in tracks])
        self.airspeed = np.concatenate([t.airspeed_m_s for t in tracks])
        # Pieces whose speed changes at once are flown by the clock: what each takes at its speed, and when it begins.
        with np.errstate(divide="ignore"):
            self.pace = np.minimum(self.cap, self.command / self.level)
        self.timed = (self.accel >= AT_ONCE_M_S2) & np.isfinite(self.pace)
        took = np.where(self.timed, (self.end - self.begin) / self.pace, 1.0)
        self.clock = np.cumsum(took) - took
        delta = np.concatenate([np.diff(t.points, axis=0)[:, :2] for t in tracks])
        run = np.hypot(delta[:, 0], delta[:, 1])
        self.course = delta / np.where(run > 0.0, run, 1.0)[:, None]
        self.flat = run / np.maximum(self.end - self.begin, 1e-9)  # horizontal metres per metre
        self.stop_node = np.concatenate([_next_stop(t) for t in tracks])
        last = np.concatenate([first + _next_stop(t) - 1 for first, t in zip(self.first, tracks, strict=True)])
        self.stop_clock = self.clock[last] + took[last]
        self.stop_at = np.concatenate([a[_next_stop(t)] for t, a in zip(tracks, along, strict=True)])
        self.hold = np.concatenate([t.hold_s[_next_stop(t)] for t in tracks])
        self.until = np.concatenate([t.until_s[_next_stop(t)] for t in tracks])
        # Just before the stop, so that a look-up there finds a piece before the stop.
        self.before_stop = np.nextafter(self.stop_at, -math.inf)
        self.stops_after = self.end >= self.stop_at
        self.last = np.concatenate([_next_stop(t) == len(t.points) - 1 for t in tracks])

    def calm_s(self) -> float:
        """Return the approximate duration of the longest flight in still air, seconds; acceleration is ignored."""
        slow = np.maximum(np.minimum(self.cap, self.command), CRAWL_M_S)
        holds = np.where(self.stops_after & np.isfinite(self.hold), self.hold, 0.0)
        return float(np.add.reduceat((self.end - self.begin) / slow + holds, self.first).max())


def _next_stop(track: CommandedTrack) -> Indices:
    """(N - 1,) the next node at which the vehicle stops, for each piece; the last node is always a stop."""
    n = len(track.points)
    stops = np.where(track.hold_s != PASSED, np.arange(n), n - 1)[1:]
    return np.minimum.accumulate(stops[::-1])[::-1].astype(np.intp)


def fly(
    tracks: Sequence[CommandedTrack], depart_s: Sequence[float] | Floats, *, weather: Weather | None = None,
    runs: int = 1, seed: int = 1, first_run: int = 0,
) -> FlownLanes:  # fmt: skip
    """Fly every track, each released at its ``depart_s`` (or one for each lane), in ``runs`` runs of different weather.

    In still air all runs are the same. The weather of run ``first_run`` + r does not depend on the other runs.
    """
    weather = weather or Weather()
    ways = _Ways(tracks)
    air = Air(weather, tracks, runs, seed, first_run)
    lanes = _Lanes(tracks, ways, np.resize(np.asarray(depart_s, dtype=np.float64), runs * len(tracks)), runs)
    latest_s = max(depart_s) + PATIENCE * ways.calm_s() + PATIENCE_SPARE_S
    latest_s += max(0.0, float(np.nanmax(ways.until, initial=0.0)))
    times, along, offset = [0.0], [lanes.s.copy()], [air.offset]
    step, through_m = 0, np.zeros(len(lanes.s))
    while not lanes.done.all() and step * FLIGHT_STEP_S < latest_s:
        step += 1
        with np.errstate(divide="ignore", invalid="ignore"):  # columns are not level, some speeds have no bound
            lanes.advance(step * FLIGHT_STEP_S, None if weather.calm else air.wind)
        if step % SAMPLE_STEPS == 0:
            times.append(step * FLIGHT_STEP_S)
            along.append(lanes.s.copy())
            if not weather.calm:
                came_m = lanes.air + lanes.held_air
                air.step(SAMPLE_S, step * FLIGHT_STEP_S, lanes.s, (came_m - through_m) / SAMPLE_S)
                through_m = came_m
                offset.append(air.offset)
    if step % SAMPLE_STEPS:
        times.append(step * FLIGHT_STEP_S)
        along.append(lanes.s.copy())
        offset.append(air.offset)
    return FlownLanes(
        tuple(tracks), runs, np.array(times), np.array(along), None if weather.calm else np.array(offset),
        lanes.begin, lanes.arrive, lanes.ended, lanes.stood, lanes.air, lanes.held_air,
        np.divide(lanes.cruised, lanes.cruised_s, out=np.zeros_like(lanes.cruised), where=lanes.cruised_s > 0.0),
        tuple(tuple(one) for one in lanes.stops),
    )  # fmt: skip


class _Lanes:
    """The state of every lane: arrays (L,)."""

    def __init__(self, tracks: Sequence[CommandedTrack], ways: _Ways, depart_s: Floats, runs: int) -> None:
        n = len(depart_s)
        self._ways, self._tracks = ways, tracks
        self._goal = np.tile([t.goal for t in tracks], runs)
        self._slowing = np.tile([t.slowing_m_s2 for t in tracks], runs)
        self._keeps = np.tile([t.keeps_airspeed for t in tracks], runs)
        self.piece = np.tile(ways.first, runs)
        self.s, self.v = np.zeros(n), np.zeros(n)
        self.command = ways.command[self.piece]
        self.clock = np.zeros(n)  # each lane's own time, which is behind after a stop within a step
        self.wait = depart_s + np.tile([max(float(t.hold_s[0]), 0.0) for t in tracks], runs)
        self.done = np.zeros(n, np.bool_)
        self.begin, self.arrive, self.ended = self.wait.copy(), np.full(n, np.nan), np.full(n, np.nan)
        self.stood = np.zeros(n)
        self.air, self.held_air, self.cruised, self.cruised_s = (np.zeros(n) for _ in range(4))
        self.stops: list[list[tuple[int, float, float]]] = [[(0, 0.0, float(w))] for w in self.wait]

    def advance(self, to_s: float, wind: Floats | None) -> None:
        """Advance every lane to the time ``to_s``; numbers may be divided by 0."""
        ways = self._ways
        b = to_s - self.clock
        waited = np.minimum(self.wait, b)
        holds = np.where(self.s > 0.0, waited, 0.0)  # not on the ground, before it leaves
        self.wait -= waited
        b -= waited
        b[self.done] = 0.0
        k, v, s = self.piece, self.v, self.s
        command = ways.command[k]
        slower = np.maximum(command, self.command - self._slowing * b)
        # The speeds of a wing's climb-out are those that it flies, its slowing down included.
        self.command = np.where((v > 0.0) & (command < self.command) & ~ways.column[k], slower, command)
        accel = ways.accel[k]
        over_ground = self.command if wind is None else self._over_ground(k, wind)
        # The limits at the end of the step count, because a step may lead into a corner or out of one.
        there = self._piece_at(k, np.minimum(s + v * b, ways.before_stop[k]))
        cap = np.minimum(ways.cap[there], over_ground / ways.level[there])
        slow = v >= np.minimum(ways.cap[k], over_ground / ways.level[k])
        # After a slow piece, acceleration begins at the end of that piece, not at the start of the step.
        after = np.where(slow & (there != k), b - (ways.begin[there] - s) / np.maximum(v, CRAWL_M_S), b)
        half = 0.5 * accel * b
        ahead = half**2 + ways.square[there] + 2.0 * accel * (ways.end[there] - s) - 2.0 * half * v
        braked = np.where(accel < AT_ONCE_M_S2, np.sqrt(np.maximum(ahead, 0.0)) - half, np.inf)
        braked = np.maximum(braked, np.where(ways.square[there] > 0.0, CRAWL_M_S, 0.0))
        steady = np.maximum(cap, v - 2.0 * half)
        faster = np.minimum(np.minimum(v + accel * np.minimum(np.maximum(after, 0.0), b), steady), braked)
        left = ways.stop_at[k] - s
        # Speeding up: full acceleration, then constant speed. Slowing down: uniform, as assumed for `braked`.
        gone = np.where(faster > v, faster * b - (faster - v) ** 2 / (2.0 * accel), 0.5 * (v + faster) * b)
        gone[b <= 0.0] = 0.0
        stops = ((gone >= left) | (2.0 * left <= v * b)) & (b > 0.0)
        timed, then, pace = self._by_clock(b, command, over_ground)
        at = np.searchsorted(ways.clock, then, side="right") - 1
        stops = np.where(timed, then >= ways.stop_clock[k], stops)
        gone = np.where(timed, ways.begin[at] + (then - ways.clock[at]) * ways.pace[at] - s, gone)
        faster = np.where(timed, ways.pace[at] * pace, faster)
        self.s = np.where(stops, ways.stop_at[k], s + gone)
        self.v = np.where(stops, 0.0, np.where(b > 0.0, faster, v))
        self.clock[:] = to_s
        came_m = self.s - s
        over_s = np.where(timed, (then - ways.stop_clock[k]) / np.maximum(pace, 1e-9), -1.0)
        for lane in stops.nonzero()[0].tolist():
            left_s = float(b[lane] - over_s[lane]) if over_s[lane] >= 0.0 else None
            self._stop(lane, to_s - float(b[lane]), float(v[lane]), float(faster[lane]), float(left[lane]), left_s)
        self.piece = np.where(stops | self.done, self.piece, self._piece_at(k, self.s))
        self._count(k, came_m, np.where(stops, b - (to_s - self.clock), b), holds, wind)

    def _count(self, k: Indices, came_m: Floats, moved_s: Floats, held_s: Floats, wind: Floats | None) -> None:
        """Add up a step in pieces ``k``: metres flown along them, seconds of moving and of standing."""
        air = np.zeros((len(k), 2)) if wind is None else wind
        over_ground = self._ways.course[k] * (came_m * self._ways.flat[k])[:, None]
        air_m = np.hypot(*(over_ground - air * moved_s[:, None]).T)
        cruises = ~self._ways.column[k]
        self.air += air_m
        self.cruised += np.where(cruises, air_m, 0.0)
        self.cruised_s += np.where(cruises, moved_s, 0.0)
        self.held_air += np.hypot(*air.T) * held_s

    def _by_clock(self, b: Floats, command: Floats, over_ground: Floats) -> tuple[Bools, Floats, Floats]:
        """Which lanes are in pieces that are flown by the clock; their time on it after ``b`` seconds; and its pace.

        The clock is slow where the wind allows less than the piece's speed, and fast until a lower commanded speed
        takes hold.
        """
        ways, k = self._ways, self.piece
        timed = ways.timed[k] & (b > 0.0)
        held = over_ground / (ways.level[k] * ways.pace[k])
        kept = self.command / command * ways.cap[k] / ways.pace[k]
        pace = np.where(timed, np.minimum(kept, held), 0.0)
        then = ways.clock[k] + (self.s - ways.begin[k]) / np.where(timed, ways.pace[k], 1.0) + b * pace
        return timed, np.where(timed, then, 0.0), pace

    def _piece_at(self, k: Indices, s: Floats) -> Indices:
        """Return the pieces at ``s`` (L,): piece ``k`` or a later one before the next stop."""
        ends, k = self._ways.end, k.copy()
        behind = (s >= ends[k]).nonzero()[0]
        while len(behind):
            behind = behind[~self._ways.stops_after[k[behind]]]
            k[behind] += 1
            behind = behind[s[behind] >= ends[k[behind]]]
        return k

    def _stop(self, lane: int, since_s: float, v: float, faster: float, left_m: float, left_s: float | None) -> None:
        """Stop a lane ``left_m`` ahead, in a step that began at ``since_s`` with the speed ``v``; after ``left_s`` if
        that is known."""
        ways, k = self._ways, int(self.piece[lane])
        accel, within_s = float(ways.accel[k]), float(self.clock[lane]) - since_s
        if left_s is not None:
            took = left_s
        elif accel >= AT_ONCE_M_S2:
            took = left_m / max(faster, CRAWL_M_S)
        else:
            took = 2.0 * left_m / v if v > 0.0 else math.sqrt(2.0 * left_m / accel)
        at = since_s + min(took, within_s)
        node, hold, until_s = int(ways.stop_node[k]), float(ways.hold[k]), float(ways.until[k])
        if not math.isnan(until_s):  # one that comes too late waits until the next day
            hold += (until_s - at) % DAY_S
        if node == self._goal[lane]:
            self.arrive[lane] = at
        self.stops[lane].append((node, at, at + hold))
        if ways.last[k] or math.isinf(hold):
            self.ended[lane] = at
            self.done[lane] = True
            return
        self.stood[lane] += hold
        self.clock[lane] = at
        self.wait[lane] = hold
        first = int(ways.first[lane % len(self._tracks)])
        self.piece[lane] = first + node

    def _over_ground(self, k: Indices, wind: Floats) -> Floats:
        """Return the speed over ground along the course while the vehicle crabs into the wind.

        A vehicle that keeps its airspeed is faster with the wind behind it; every other flies its commanded speed if
        its highest airspeed allows it.
        """
        course = self._ways.course[k]
        tail = (course * wind).sum(axis=1)
        cross = course[:, 0] * wind[:, 1] - course[:, 1] * wind[:, 0]
        # A vehicle that keeps its airspeed has it along its slope.
        flat = np.where(self._keeps, self._ways.flat[k], 1.0)
        aside = cross**2 + (1.0 - flat**2) * tail**2
        tail = tail * flat
        level, slope = self._ways.airspeed[k].T
        most = level
        for _ in range(2):  # through the air its slope is less steep in a headwind, and steeper in a tailwind
            in_air = np.where(self._keeps, np.minimum(self.command, most), most)
            through = np.sqrt(np.maximum(in_air**2 - aside, 0.0))
            headway = np.maximum(tail + through, HEADWAY_M_S)
            most = np.where(np.isinf(level), level, level + (slope - level) * np.minimum(headway / most, 1.5))
        return np.asarray(np.where(self._keeps, headway, np.minimum(self.command, headway)))
