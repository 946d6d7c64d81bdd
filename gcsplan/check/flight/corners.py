"""Corners as autopilots cut them: where a vehicle turns before the way point, and how much that widens its legs.

A way point counts as reached within a radius. There the vehicle turns, and flies to the end of the next leg. Facts:

- PX4 (mission_block.cpp, `is_mission_item_reached`): a multicopter uses a way point's own radius (param2). It uses
  NAV_ACC_RAD (10 m) if that is 0, negative or not finite, and for every other command. A hold begins within that
  radius too. A take-off ends NAV_MC_ALT_RAD below its top.
- ArduCopter (SCurve.cpp, `advance_target_along_track`): it begins the next leg while it still brakes on this one, where
  the middle of the turn lies within WPNAV_RADIUS (2 m), and not in the first half of either leg. The item's own radius
  is not stored. It stops at a hold, and before a landing, a return or a circle.
- ArduPlane turns with a radius, as a VTOL too: that is in `arcs`. Without a radius its corners are not judged.
- After a circle the next leg begins anywhere on it.

The only assumption about how a vehicle gets onto its next leg: it stays between that leg and the straight line from
where it turned to the leg's end. If the turn begins R before a corner of angle A, that line is R·sin(A) off the next
leg at the leg's beginning and 0 at its end, and no more than R·sin(A)·cos(A) off the leg before.

``track_error_m`` and ``altitude_error_m`` include corners by definition, so offsets within them widen nothing. Offsets
beyond them widen the legs, and the widened legs are added as flown in place of the straight ones. A vehicle whose
``corner_accel_m_s2`` is not bounded turns on the spot by definition.

While an ArduCopter turns, it is where it would be on the one leg, moved by what it has flown, or will fly, of the
other, which is half of the shorter leg at most. In height that is at most what both climb over so many metres.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from gcsplan.check.fixed_wing.arcs import bend
from gcsplan.check.motion.stretch import SAME_PLACE_M, Flight, Stretch, flat_m, offset_m, place_on
from gcsplan.check.motion.turn_parameters import DEFAULTS, Tuning
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geodesy.frame import Frame

__all__ = ["round_corners"]

LEG_PARTS = (0.0, 0.0625, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0)
"""Places along a leg where it is cut into parts; each part is widened by what its beginning needs."""


def round_corners(flight: Flight, mission: Mission, vehicle: Vehicle, frame: Frame, tuning: Tuning = DEFAULTS) -> None:
    """Add to ``flight`` the arcs or widened legs that are flown at the corners of ``mission`` (as stored).

    What is unknown about its flights `apart` becomes unknown about the whole.
    """
    for part in flight.apart:
        round_corners(part, mission, vehicle, frame, tuning)
        flight.adopt(part)
    if vehicle.turn_radius_m > 0.0:
        bend(flight, mission, vehicle, frame, tuning)
        return
    if mission.autopilot is Autopilot.ARDUPLANE:
        flight.not_judged.append(Note("arcs_without_radius"))
        return
    if math.isinf(vehicle.corner_accel_m_s2):
        return
    cutter = _Cutter(flight, mission, vehicle, tuning)
    flight.instead += cutter.widened(flight.stretches)
    flight.notes += [note for note in cutter.notes if note not in flight.notes]


@dataclass(frozen=True, slots=True)
class _Off:
    """How far from the beginning of a leg a vehicle may begin it, metres: to the side, and in height.

    ``meant``: the mission itself puts it there, on a circle; the vehicle's error is added to the offset.
    """

    aside_m: float = 0.0
    height_m: float = 0.0
    meant: bool = False


NOT_OFF = _Off()


class _Cutter:
    """Goes through a flight leg by leg, with the offset that the vehicle may have at the beginning of each."""

    def __init__(self, flight: Flight, mission: Mission, vehicle: Vehicle, tuning: Tuning) -> None:
        limits = vehicle.limits
        self.mission, self.tuning, self.limits = mission, tuning, limits
        self.copter = mission.autopilot is Autopilot.ARDUCOPTER
        self.included = self.copter and tuning.copter_radius_m <= min(limits.track_error_m, limits.altitude_error_m)
        self.twins: dict[tuple[object, ...], list[Stretch]] = {}
        for s in flight.instead:
            self.twins.setdefault(_way(s), []).append(s)
        self.notes: list[Note] = []

    def widened(self, stretches: Sequence[Stretch]) -> list[Stretch]:
        """The stretches flown in place of ``stretches`` wherever corners are cut by more than the errors include."""
        found: list[Stretch] = []
        off, last, stops = _Off(), None, False
        for s in stretches:
            if not s.column and s.start == s.end:
                stops = stops or s.hold_s > 0.0
                if s.reach_m > 0.0:  # a circle, which may be left anywhere
                    off, last = _Off(s.reach_m, s.band_m, meant=True), None
                continue
            begun = off if last is None else self._leave(last, s, off, stops)
            if s.column:
                if last is None and s.kind == "land" and self._has_place(s.seq):
                    begun = _Off()  # it leaves the circle for the landing place first
                found += self._parts(s, (0.0, 1.0), self._beyond(replace(begun, height_m=0.0), s), fading=False)
                climbed = s.kind == "takeoff" and self.mission.autopilot is Autopilot.PX4
                off = _Off(0.0, self.tuning.px4_height_m if climbed else 0.0)
                if s.kind == "rtl":  # a climb ends any offset in height
                    off = replace(begun, height_m=0.0) if s.end[2] > s.start[2] else begun
                last, stops = None, False
                continue
            if last is not None:
                found += self._before(last, s, begun, stops)
            blends = self.copter and last is not None
            found += self._parts(s, (0.0, 0.5) if blends else LEG_PARTS, self._beyond(begun, s), fading=not blends)
            off, last, stops = begun, s, s.hold_s > 0.0
        return found

    def _leave(self, s: Stretch, after: Stretch, off: _Off, stops: bool) -> _Off:
        """How far off the beginning of ``after`` the vehicle may begin it; ``off``: the same for ``s``."""
        if self.included:
            return NOT_OFF
        turn, long_m = _turn(s, after), flat_m(s.start, s.end)
        sine = 1.0 if after.column else math.sin(min(turn, 0.5 * math.pi))
        rise_m = abs(s.end[2] - s.start[2])
        radius_m = self._radius_m(s, after, stops)
        if radius_m <= 0.0:
            return _Off()
        if self.copter:
            next_m, next_rise_m = flat_m(after.start, after.end), abs(after.end[2] - after.start[2])
            shorter_m = 0.5 * min(long_m, next_m)
            height_m = min(radius_m, 0.5 * max(rise_m, next_rise_m))
            if shorter_m > 0.0 and not (s.terrain or after.terrain):
                half_m = 0.5 * min(math.hypot(long_m, rise_m), math.hypot(next_m, next_rise_m))
                height_m = min(height_m, half_m * (rise_m / long_m + next_rise_m / next_m))
            return _Off(min(radius_m, shorter_m * sine), height_m)
        if radius_m >= long_m:  # it turns at once, wherever it is
            aside_m, sag_m = min(radius_m, long_m + off.aside_m), rise_m + off.height_m
        else:
            part = radius_m / long_m
            aside_m, sag_m = min(radius_m, radius_m * sine + part * off.aside_m), part * (rise_m + off.height_m)
        return _Off(aside_m, min(sag_m, self.tuning.px4_height_m))

    def _radius_m(self, s: Stretch, after: Stretch, stops: bool) -> float:
        """How far before the end of ``s`` the vehicle may turn, m; 0 if it does not turn early."""
        item = self._item(s.seq)
        within = s.seq == after.seq and s.kind == after.kind == "cruise"  # pieces of one curve, or up to one circle
        if item is None or within or s.kind == "rtl":
            return 0.0
        if self.copter:
            nearby = self._item(after.seq)
            curves = nearby is not None and nearby.command == cmd.SPLINE_WAYPOINT
            fast = item.command in (cmd.WAYPOINT, cmd.ARC_WAYPOINT) and after.kind == "cruise" and not (stops or curves)
            if fast and self.tuning.copter_radius_m > self.limits.track_error_m:
                read = "WPNAV_RADIUS" in self.tuning.read
                self._say(Note("corners_cut", radius_m=self.tuning.copter_radius_m, read=read))
            return self.tuning.copter_radius_m if fast else 0.0
        accepts_m, own = self.tuning.px4_accepts_m(item)
        if not own and accepts_m > self.limits.track_error_m:
            read = "NAV_ACC_RAD" in self.tuning.read
            self._say(Note("reached_within_default", s.seq, radius_m=accepts_m, read=read))
        return accepts_m

    # -- what is flown -------------------------------------------------------------------------------------------

    def _before(self, s: Stretch, after: Stretch, begun: _Off, stops: bool) -> Iterator[Stretch]:
        """The end of ``s`` from where the vehicle turns: its course from there need not lie beside ``after``."""
        aside_m, height_m = self._beyond(begun, after)
        if aside_m <= 0.0 and height_m <= 0.0:
            return
        radius_m, long_m = self._radius_m(s, after, stops), flat_m(s.start, s.end)
        if self.copter or radius_m >= long_m:
            yield from self._parts(s, (0.5 if self.copter else 0.0, 1.0), (aside_m, height_m), fading=False)
            return
        aside_m *= math.cos(min(_turn(s, after), 0.5 * math.pi))
        yield from self._parts(s, (1.0 - radius_m / long_m, 1.0), (aside_m, height_m), fading=False)

    def _parts(
        self, s: Stretch, cuts: Sequence[float], off_m: tuple[float, float], *, fading: bool
    ) -> Iterator[Stretch]:
        """The parts of ``s`` between ``cuts``, widened by ``off_m`` (aside, in height); ``fading``: down to 0."""
        aside_m, height_m = off_m
        if aside_m <= 1e-9 and height_m <= 0.0:
            return
        for one in (s, *self.twins.get(_way(s), ())):
            # In the terrain frame height follows the ground: such a leg stays whole.
            for a, b in [(0.0, 1.0)] if one.terrain else pairwise(cuts):
                left = 1.0 - a if fading else 1.0
                band_m = height_m if one.kind == "rtl" else left * height_m
                start, end = place_on(one.start, one.end, a), place_on(one.start, one.end, b)
                yield replace(
                    one, start=start, end=end, reach_m=one.reach_m + left * aside_m,
                    band_m=one.band_m + band_m, hold_s=0.0, on_path=False,
                )  # fmt: skip

    def _beyond(self, off: _Off, s: Stretch) -> tuple[float, float]:
        """The offset that widens ``s``; 0 where the vehicle's own errors include it.

        A return is flown at the altitude at which it began, so an error of that altitude always widens it.
        """
        if off.meant:
            return off.aside_m, off.height_m
        aside_m = off.aside_m if off.aside_m > self.limits.track_error_m else 0.0
        return aside_m, off.height_m if s.kind == "rtl" or off.height_m > self.limits.altitude_error_m else 0.0

    # -- what the mission says -----------------------------------------------------------------------------------

    def _item(self, seq: int) -> MissionItem | None:
        index = seq - self.mission.first_seq
        return self.mission.items[index] if 0 <= index < len(self.mission.items) else None

    def _has_place(self, seq: int) -> bool:
        item = self._item(seq)
        return item is not None and (item.x != 0 or item.y != 0)

    def _say(self, note: Note) -> None:
        if note not in self.notes:
            self.notes.append(note)


def _way(s: Stretch) -> tuple[object, ...]:
    return s.seq, s.kind, s.start[:2], s.end[:2]


def _turn(s: Stretch, after: Stretch) -> float:
    """The angle between two legs seen from above, radians; a right angle if one of them has no horizontal length."""
    one, two = _course(s), _course(after)
    if one is None or two is None:
        return 0.5 * math.pi
    return abs((two - one + math.pi) % (2.0 * math.pi) - math.pi)


def _course(s: Stretch) -> float | None:
    east, north = offset_m(s.start, s.end)
    return math.atan2(north, east) if math.hypot(east, north) > SAME_PLACE_M else None
