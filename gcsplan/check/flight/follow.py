"""The flight that an autopilot makes of a mission: its items as straight stretches.

This module reads only motion; `judge` judges it. A command whose motion we do not know is listed in ``not_judged``, so
nothing is lost silently. Facts about the autopilots come from ArduPilot's and PX4's sources and a flown ArduCopter.

- Frame-3 altitudes count from where the vehicle arms: the ground at home.
- The frame of the *target* decides the altitude along a leg: on the leg to a terrain-frame item it is interpolated
  above ground, beginning with the height above ground at which the leg begins.
- ArduCopter: altitude 0 keeps the altitude in the item's own frame, latitude = longitude = 0 means "here"
  (mode_auto.cpp, `loc_from_cmd`); take-off ignores its place and climbs at least 1 m.
- ArduPlane: altitude 0 keeps the altitude only at latitude = longitude = 0 (commands.cpp, `set_next_WP`). A change of
  less than GLIDE_SLOPE_MIN, and a climb that begins low, is flown at once and not along the leg (altitude.cpp): such a
  leg is judged as the whole band between both altitudes. A VTOL take-off climbs *by* its altitude, whatever its frame.
  Circles grow with altitude (AP_L1_Control.cpp, `loiter_radius`). It does not wait for NAV_DELAY once it is armed.
- PX4 has no "here": latitude = longitude = 0 lies off Africa. A VTOL take-off changes to forward flight. After an item
  without autocontinue PX4 flies no further item (mission.cpp, `on_active`); ArduPilot ignores that flag.
- A circle's radius is param3 of LOITER_TURNS and of ArduPlane's LOITER_UNLIM, and param2 of its LOITER_TO_ALT; its
  LOITER_TIME uses WP_LOITER_RAD whatever the item says, and so does a radius of 1 m or less (commands_logic.cpp).
- LAND with a place flies there level (in terrain frame at its height above ground), then descends. ArduCopter before
  4.6 holds its height above ground wherever it has terrain data: that is judged too.
- RTL: `return_rules`. Jumps: `route`. Splines: `spline`. Arcs: `arc_waypoint`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import replace
from itertools import pairwise

from gcsplan.check.fixed_wing.ends import (
    REACHED_M,
    circle_up,
    climb_out,
    glide,
    is_wing,
    level_approach,
    sets_off,
    turns_early,
)
from gcsplan.check.flight.arc_waypoint import fly_arc
from gcsplan.check.flight.route import fly_all
from gcsplan.check.flight.times import DAY_S
from gcsplan.check.motion.circles import PLANE_LOITER_RADIUS_M, circle_reach_m, circle_too_banked, circle_widened
from gcsplan.check.motion.commands import flown_otherwise, moves_nothing, why_lost
from gcsplan.check.motion.flight_state import TERRAIN_ERROR_M, Aboard, reads_ground
from gcsplan.check.motion.return_rules import RETURN_RULES, returned
from gcsplan.check.motion.spline import NO_DIRECTION, chords, slowed, towards
from gcsplan.check.motion.stopping import about_turn_m, circle_home_m
from gcsplan.check.motion.stretch import Flight, Place, StretchKind, flat_m, place_on
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.world import World

COPTER_CIRCLE_RADIUS_M = 10.0  # ArduCopter CIRCLE_RADIUS, default
LEAST_CLIMB_M = {Autopilot.ARDUCOPTER: 1.0, Autopilot.PX4: 2.5}  # takeoff_start; MIS_TAKEOFF_ALT, default
TAKE_OFF_ELSEWHERE_M = 30.0
SOME_S = 1.0
"""A wait until a time of day counts as this many seconds, until it is known how long the flight to it takes."""


def follow(
    mission: Mission,
    vehicle: Vehicle,
    ground_amsl: Callable[[float, float], float],
    read_amsl: Callable[[float, float], float] | None = None,
    read_change_m: Callable[[float, float, float], float] | None = None,
    *,
    rtl_rel_home_m: float | None = None,
    terrain_error_m: float = TERRAIN_ERROR_M,
) -> Flight:
    """Return the flight that ``mission`` (as stored on board) leads to.

    ``ground_amsl(lat_deg, lon_deg)`` is the terrain, NaN where unknown; ``read_amsl`` likewise what the vehicle takes
    for it in the terrain frame, by default the same, and ``read_change_m(lat_deg, lon_deg, reach_m)`` how far that
    changes around a place. ``rtl_rel_home_m`` is the altitude of a return above home; without it an RTL is not judged.
    """
    terms = ground_amsl, rtl_rel_home_m, read_amsl, read_change_m, terrain_error_m
    return fly_all(mission, lambda: _Pilot(mission, vehicle, *terms))


def follow_in(
    world: World, mission: Mission, vehicle: Vehicle, *, rtl_rel_home_m: float | None = None,
    terrain_error_m: float = TERRAIN_ERROR_M,
) -> Flight:  # fmt: skip
    """`follow` in a world, whose terrain the vehicle has on board."""
    return follow(
        mission, vehicle, world.ground_amsl, world.read_amsl, world.read_change_m, rtl_rel_home_m=rtl_rel_home_m,
        terrain_error_m=terrain_error_m,
    )  # fmt: skip


class _Pilot(Aboard):
    """Flies the items one by one."""

    @property
    def over(self) -> bool:
        return self.landed

    @property
    def stays(self) -> bool:
        last = self.flight.stretches[-1] if self.flight.stretches else None
        return self.stopped or (last is not None and last.kind == "loiter" and math.isinf(last.hold_s))

    @property
    def state(self) -> Hashable:
        return self.at, self.off_m, self.airborne, self.known, self.pace, self.circle_m, self.direction

    def fly(self, seq: int, item: MissionItem) -> None:
        flown = len(self.flight.stretches)
        if note := flown_otherwise(seq, item, self.mission):
            self.flight.not_judged.append(note)
        self._fly(seq, item)
        if self.autopilot is Autopilot.PX4 and not (item.autocontinue or self.landed):
            self.stopped = True
            if self.airborne and self.known:
                self.add(seq, "loiter", self.at, self.at, hold_s=math.inf)
        if len(self.flight.stretches) > flown:
            self.jumped_from = None

    def _fly(self, seq: int, item: MissionItem) -> None:
        if self.landed:
            self.flight.not_judged.append(Note("comes_after_landing", seq))
            return
        command = item.command
        if self.autopilot is Autopilot.PX4 and self.off_africa(item):
            self._lose(seq, item)
        elif command in (cmd.TAKEOFF, cmd.VTOL_TAKEOFF):
            self._take_off(seq, item)
        elif command == cmd.WAYPOINT:
            self._go(seq, item, hold_s=self.hold(item))
        elif command == cmd.SPLINE_WAYPOINT:
            self._curve(seq, item)
        elif command == cmd.ARC_WAYPOINT:
            if not fly_arc(self, seq, item, self._next(seq)):
                self._lose(seq, item)
        elif command in (cmd.LOITER_UNLIM, cmd.LOITER_TIME, cmd.LOITER_TURNS):
            self._loiter(seq, item)
        elif command == cmd.LOITER_TO_ALT:
            self._change_altitude(seq, item)
        elif command in (cmd.LAND, cmd.VTOL_LAND):
            self._land(seq, item)
        elif command == cmd.RTL:
            self._return_home(seq)
        elif command == cmd.DO_CHANGE_SPEED:
            self.pace, note = self.pace.changed(seq, item, self.vehicle)
            self.note(note)
        elif command == cmd.DELAY:
            self._wait(seq, item)
        elif not moves_nothing(command, item.params[0]):
            self._lose(seq, item)

    def finish(self) -> None:
        """Report the return that ArduPlane flies after the last item as not judged."""
        if self.airborne and not self.landed and self.autopilot is Autopilot.ARDUPLANE:
            last = self.flight.stretches[-1] if self.flight.stretches else None
            if last is not None and (last.kind != "loiter" or last.hold_s < math.inf):
                self.flight.not_judged.append(Note("returns_by_itself"))

    # -- pieces ----------------------------------------------------------------------------------------------

    def _take_off(self, seq: int, item: MissionItem) -> None:
        if self.airborne:
            self._lose(seq, item)
            return
        if item.command == cmd.TAKEOFF and self.autopilot is Autopilot.ARDUPLANE:
            if is_wing(self.vehicle):
                climb_out(self, seq, item, after := self._next(seq))
                turns_early(self, seq, after)
                return
            self.flight.not_judged.append(Note("runway_take_off", seq))
            self.airborne, self.known = True, False
            return
        if item.command == cmd.VTOL_TAKEOFF and self.autopilot is Autopilot.PX4:
            self._lose(seq, item)
            return
        lat, lon, ground = self.home
        if self.autopilot is Autopilot.PX4 and self.has_place(item):
            away_m = flat_m((lat, lon, 0.0), (item.lat_deg, item.lon_deg, 0.0))
            if away_m > 1.0:
                self.flight.not_judged.append(Note("takes_off_elsewhere", seq, away_m=away_m))
        elif self.autopilot is Autopilot.ARDUCOPTER and self.has_place(item):
            away_m = flat_m((lat, lon, 0.0), (item.lat_deg, item.lon_deg, 0.0))
            if away_m > TAKE_OFF_ELSEWHERE_M:
                self.flight.notes.append(Note("takes_off_where_it_stands", seq, away_m=away_m))
        top = self.altitude(item, (lat, lon, ground))
        if self.autopilot is Autopilot.ARDUPLANE and m.FRAME_SYNONYMS.get(item.frame, item.frame) != m.RELATIVE:
            self.flight.not_judged.append(Note("vtol_climbs_by_altitude", seq))
            top = None if top is None else max(top, ground + item.z)
        if top is None:
            self._lose(seq, item)
            return
        top = max(top, ground + LEAST_CLIMB_M.get(self.autopilot, 0.0))
        self.add(seq, "takeoff", (lat, lon, ground), (lat, lon, top), column=True)
        self.at, self.direction = (lat, lon, top), None
        self.airborne = True

    def _go(self, seq: int, item: MissionItem, *, hold_s: float = 0.0, short_m: float = 0.0) -> None:
        """Fly to the item's place; its altitude is reached ``short_m`` before it, at a circle's edge."""
        target = self.target(item)
        if target is None:
            self._lose(seq, item)
            return
        if not self.airborne or not self.known:
            if not self.airborne:
                self.flight.not_judged.append(Note("no_take_off", seq))
            self.airborne = self.known = True
            self.at = target
        terrain, away_m = reads_ground(item), flat_m(self.at, target) if short_m > 0.0 else 0.0
        if short_m > 0.0 and away_m > short_m:
            lat, lon, _ = place_on(self.at, target, 1.0 - short_m / away_m)
            above_m = self.read(lat, lon) - self.read(*target[:2]) if terrain else 0.0
            if math.isnan(above_m):
                self._lose(seq, item)
                return
            self._leg(seq, "cruise", (lat, lon, target[2] + above_m), terrain=terrain)
        self._leg(seq, "cruise", target, terrain=terrain, hold_s=hold_s)
        self.settled(item)

    def _curve(self, seq: int, item: MissionItem) -> None:
        """A spline as ArduCopter flies it; both a pass through its beginning and a stop there are judged."""
        target, after = self.target(item), self._next(seq)
        terrain = any(i is not None and reads_ground(i) for i in (item, after))
        copter = self.autopilot is Autopilot.ARDUCOPTER
        known = self.airborne and self.known
        if not copter or target is None or terrain or not known or after is None or after.command == cmd.ARC_WAYPOINT:
            self._lose(seq, item)
            return
        here, self.at, arrives = self.at, target, NO_DIRECTION  # altitude 0 in the next item means the one here
        beyond = self.target(after) if self.has_place(after) else None
        self.at = here
        if beyond is not None and self.hold(item) == 0.0:
            arrives = towards(here if after.command == cmd.SPLINE_WAYPOINT else target, beyond)
        before, pace = self.direction or NO_DIRECTION, self.pace
        self.pace = slowed(pace, self.vehicle, (here, target), (before, arrives), after.command)
        for leaves, fly in ((before, self.add), (NO_DIRECTION, self.instead)):
            if fly == self.instead and not any(before):
                break
            places, bulge_m, steep = chords(here, target, leaves, arrives)
            for (a, b), slopes in zip(pairwise(places), steep, strict=True):
                fly(seq, "cruise", a, b, band_m=bulge_m, reach_m=bulge_m, on_path=True, steep=slopes)
        self.pace, self.at, self.direction = pace, target, None if self.hold(item) else arrives
        self.settled(item)
        if hold_s := self.hold(item):
            self.add(seq, "loiter", target, target, hold_s=hold_s)
        self.note(Note("splines_by_version"))

    def _next(self, seq: int) -> MissionItem | None:
        """The next item that is flown to after ``seq``, an RTL if none is left; None if a jump decides."""
        for item in self.items[seq + 1 - self.first_seq :]:
            if item.command in (cmd.DO_JUMP, cmd.DO_JUMP_TAG):
                return None
            if cmd.is_nav(item.command):
                return item
        return MissionItem(cmd.RTL, m.NO_POSITION)

    def _leg(self, seq: int, kind: StretchKind, target: Place, *, terrain: bool, hold_s: float = 0.0) -> None:
        """A leg from here to ``target``, with all the altitude profiles that the autopilot may fly on it."""
        here = self.at
        self.note(sets_off(self, target))
        self.add(seq, kind, here, target, terrain=terrain, hold_s=hold_s, on_path=kind == "cruise")
        self.at = target
        self.direction = None if hold_s else towards(here, target)
        if self.autopilot is not Autopilot.ARDUPLANE:
            return
        if not terrain:
            self.begins_low(seq, kind, here, target)
        self.low_m = 0.0
        self.at_once(seq, kind, here, target, terrain=terrain)

    def _loiter(self, seq: int, item: MissionItem) -> None:
        turns = item.command == cmd.LOITER_TURNS
        if turns and self.autopilot is Autopilot.PX4:  # refused on upload
            self._lose(seq, item)
            return
        plane = self.autopilot is Autopilot.ARDUPLANE
        reach_m = 0.0
        if turns or plane:
            reach_m = self._circle(seq, 0.0 if item.command == cmd.LOITER_TIME else item.params[2])
        if turns and not plane:
            self.circle_m = reach_m  # holds for later circles without a radius
        self._go(seq, item, short_m=0.0 if plane else reach_m)
        if not self.known:
            return
        hold_s = self.turns_s(item, reach_m) if turns else self.loiter_s(item)
        if plane:
            self.note(circle_widened(seq, reach_m, self.at[2]))
            reach_m = self._circles_m(reach_m, self.at[2])
        if not self.circles_over_ground(item, reach_m):
            self._lose(seq, item)
            return
        self.add(seq, "loiter", self.at, self.at, reach_m=reach_m, hold_s=hold_s, turns=turns)
        self.direction = None

    def _circle(self, seq: int, radius_m: float) -> float:
        """Radius of a circle whose item says ``radius_m``, m (its sign is the direction)."""
        plane = self.autopilot is Autopilot.ARDUPLANE
        radius_m = abs(radius_m) if math.isfinite(radius_m) else 0.0
        if radius_m > (1.0 if plane else 0.0):
            radius_m = max(radius_m, self.vehicle.turn_radius_m)
        else:
            parameter, default_m = (
                ("WP_LOITER_RAD", PLANE_LOITER_RADIUS_M) if plane else ("CIRCLE_RADIUS", COPTER_CIRCLE_RADIUS_M)
            )
            self.note(Note("circle_by_default", seq, parameter=parameter, radius_m=default_m))
            radius_m = max(default_m, self.circle_m, self.vehicle.turn_radius_m)
        tight = circle_too_banked(seq, radius_m, self.pace.speed_m_s) if plane else None
        if tight is not None and tight not in self.flight.not_judged:
            self.flight.not_judged.append(tight)
        return radius_m

    def _circles_m(self, radius_m: float, amsl_m: float) -> float:
        """How far from its middle a plane's circle reaches."""
        return circle_reach_m(radius_m, amsl_m, self.vehicle.speed_max_m_s, self.vehicle.wind_m_s)

    def _change_altitude(self, seq: int, item: MissionItem) -> None:
        """LOITER_TO_ALT: to the place, then up or down there; a plane circles while it does."""
        before = self.at
        plane = self.autopilot is Autopilot.ARDUPLANE
        reach_m = self._circle(seq, item.params[1]) if plane else 0.0
        if plane and is_wing(self.vehicle) and not reads_ground(item) and circle_up(self, seq, item, reach_m):
            return
        self._go(seq, item)
        if not self.known:
            return
        self.direction = None
        low, high = sorted((before[2], self.at[2]))
        place = self.at[:2]
        if plane:
            around = (*place, 0.5 * (low + high))
            self.note(circle_widened(seq, reach_m, high))
            reach_m = self._circles_m(reach_m, high)
            if not self.circles_over_ground(item, reach_m):
                self._lose(seq, item)
                return
            self.add(seq, "loiter", around, around, band_m=0.5 * (high - low), reach_m=reach_m)
            rise = self.at[2] - before[2]
            self.low_m, self.around_m = math.copysign(min(REACHED_M, abs(rise)), rise), reach_m
        elif self.autopilot is Autopilot.PX4 and before[2] != self.at[2]:  # level first, then up or down there
            self.instead(seq, "cruise", before, (*place, before[2]))
            self.instead(seq, "loiter", (*place, before[2]), self.at, column=True)

    def _land(self, seq: int, item: MissionItem) -> None:
        if not self.known or not self.airborne:
            self._lose(seq, item)
            return
        if item.command == cmd.LAND and self.autopilot is Autopilot.ARDUPLANE:
            if is_wing(self.vehicle):
                glide(self, seq, item)
                return
            self.flight.not_judged.append(Note("runway_landing", seq))
            self.landed = True
            return
        if self.has_place(item):
            level_approach(self, seq, item)
            self._fly_to_landing(seq, item)
        ground = self.ground(self.at[0], self.at[1])
        if math.isnan(ground):
            self.flight.not_judged.append(Note("landing_ground_unknown", seq))
        else:
            down = (self.at[0], self.at[1], ground)
            self.lands_fast(seq, ground)
            self.add(seq, "land", self.at, down, column=True)
            self.at = down
        self.landed = True

    def _fly_to_landing(self, seq: int, item: MissionItem) -> None:
        here, terrain = self.at, reads_ground(item) and self.autopilot is Autopilot.ARDUCOPTER
        level = (*self.place(item), here[2])
        if flat_m(here, level) <= 0.02:
            self.at = level
            return
        agl = here[2] - self.read(*here[:2])
        follows = (*level[:2], self.read(*level[:2]) + agl)
        self.at = follows if terrain and not math.isnan(follows[2]) else level
        vtol = self.vehicle.vtol
        self.add(seq, "cruise" if vtol else "land", here, self.at, terrain=terrain, on_path=vtol)
        if terrain:
            self.settled(item)
        if self.autopilot is Autopilot.ARDUCOPTER and not terrain and not math.isnan(follows[2]):
            down = (*level[:2], min(follows[2], self.ground(*level[:2])))
            self.instead(seq, "land", here, follows, terrain=True)
            self.instead(seq, "land", follows, down, column=True)

    def _return_home(self, seq: int) -> None:
        if not self.known or not self.airborne or self.rtl_rel_home_m is None:
            why = Note("return_altitude_not_given" if self.known else "return_start_unknown", seq)
            self.flight.not_judged.append(why)
            self.landed = True
            return
        rule, level_m = RETURN_RULES[self.autopilot], self.home[2] + self.rtl_rel_home_m
        if rule.climbs_first and self.at[2] + self.off_m <= level_m:
            self.off_m = 0.0  # it climbs to the same altitude from wherever it is
        self.pace = replace(self.pace, speed_m_s=self.vehicle.return_speed_m_s or self.pace.speed_m_s)
        flown, instead = returned(
            lambda start, end, **more: self.stretch(seq, "rtl", start, end, more),
            rule, self.at, self.home, level_m,
            about_m=about_turn_m(self.vehicle, self.pace.speed_m_s, self.at[2], flat_m(self.at, self.home)),
            circle_m=circle_home_m(rule.circle_m(level_m), self.vehicle, level_m),
            waits_s=self.vehicle.return_waits_s,
        )  # fmt: skip
        self.flight.stretches += flown
        self.flight.instead += instead
        self.at = flown[-1].end
        self.landed = True

    def _wait(self, seq: int, item: MissionItem) -> None:
        if self.autopilot is Autopilot.ARDUPLANE and self.airborne:
            return
        self.direction = None
        if 0 < item.params[0] < math.inf:
            self.add(seq, "loiter", self.at, self.at, hold_s=item.params[0], column=not self.airborne)
        elif (until_s := self._until_s(item)) is not None:
            self.add(seq, "loiter", self.at, self.at, hold_s=SOME_S, until_s=until_s)
        else:
            self.flight.not_judged.append(Note("waits_until_time", seq))

    def _until_s(self, item: MissionItem) -> float | None:
        """Seconds from leaving the ground to an item's time of day, negative if it was within the twelve hours before;
        None if that, or the departure, is not known."""
        copter = self.autopilot is Autopilot.ARDUCOPTER and self.airborne and self.known
        if not copter or item.until_s is None or self.mission.leaves_s is None:
            return None
        return (item.until_s - self.mission.leaves_s + 0.5 * DAY_S) % DAY_S - 0.5 * DAY_S

    def _lose(self, seq: int, item: MissionItem) -> None:
        self.direction = None
        why = why_lost(item, self.mission)
        self.flight.not_judged.append(
            Note("flown_unknown", seq, autopilot=self.autopilot.value, command=item.command, why=why)
        )
        target = self.target(item) if self.has_place(item) else None
        if target is not None and cmd.is_nav(item.command):
            self.at, self.known, self.airborne = target, True, True
        elif cmd.is_nav(item.command) or item.command in (cmd.DO_JUMP, cmd.DO_SET_HOME):
            self.known = False
