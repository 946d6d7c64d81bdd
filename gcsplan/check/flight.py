"""What an autopilot does with a mission: its items as the straight stretches that are flown.

Only motion is read here, judging is `judge`'s. A command whose motion we do not know is named in ``not_judged``,
never passed over in silence. Facts about the autopilots: ArduPilot's and PX4's sources and a flown ArduCopter.

- Frame-3 altitudes count from where the vehicle arms: the ground at home.
- The frame of the *target* decides how altitude runs along a leg: to a terrain-frame item it is interpolated above
  ground from the height above ground that the leg began with.
- ArduCopter: altitude 0 keeps the altitude in the item's own frame, latitude = longitude = 0 is "here"
  (mode_auto.cpp, `loc_from_cmd`); take-off ignores its place and ends a metre up at least.
- ArduPlane: altitude 0 is kept only at latitude = longitude = 0 (commands.cpp, `set_next_WP`). A change of less than
  GLIDE_SLOPE_MIN, and a climb that begins low, is flown at once and not along the leg (altitude.cpp): such a leg is
  judged as the whole band between both altitudes. A VTOL take-off climbs *by* its altitude, whatever its frame.
  Circles grow with altitude (AP_L1_Control.cpp, `loiter_radius`). It waits for no NAV_DELAY once it is armed.
- PX4 knows no "here": latitude = longitude = 0 lies off Africa. A VTOL take-off goes over to forward flight.
- LAND with a place flies there level (in terrain frame at its height above ground), then descends. ArduCopter before
  4.6 holds its height above ground wherever it has terrain data: that way is judged besides.
- RTL climbs first and returns straight; within a cone around home it climbs less (`RTL_CONE_SLOPE`, `RTL_CONE_ANG`).
  ArduPlane climbs on the way, and turns about first: judged as the whole band between both altitudes.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from gcsplan.check.stretch import Flight, Place, Stretch, StretchKind
from gcsplan.mavlink import mission as m
from gcsplan.mavlink.mission import Mission, MissionItem
from gcsplan.vehicle import Autopilot, Vehicle

PLANE_LOITER_RADIUS_M = 60.0  # ArduPlane WP_LOITER_RAD, default
PLANE_GLIDE_SLOPE_MIN_M = 15.0  # ArduPlane GLIDE_SLOPE_MIN, default
PLANE_LOW_M = 20.0  # ArduPlane setup_glide_slope: below this above home it climbs at once
COPTER_CIRCLE_RADIUS_M = 10.0  # ArduCopter CIRCLE_RADIUS, default
COPTER_CONE_SLOPE = 3.0  # ArduCopter RTL_CONE_SLOPE, default: rise over run
PX4_CONE_SLOPE = 1.0  # PX4 RTL_CONE_ANG 45, default
LEAST_CLIMB_M = {Autopilot.ARDUCOPTER: 1.0, Autopilot.PX4: 2.5}  # takeoff_start; MIS_TAKEOFF_ALT, default
PARACHUTE, RELEASE = 208, 2.0
UNMOVED = frozenset(
    {
        m.CONDITION_DELAY, 114, 115, m.DO_CHANGE_SPEED, 181, 182, 183, 184, 189,
        195, 196, 197, 200, 201, 202, 203, 204, 205, 206, 207, 211, 214, 215,
        530, 531, 532, 2000, 2001, 2500, 2501,
    }
)  # fmt: skip
"""Commands that move nothing but cameras, servos, speeds and clocks (CONDITION_* delay only the next DO_ command).

Not among them, though they go nowhere themselves: DO_SET_PARAMETER 180, DO_AUTOTUNE_ENABLE 212, DO_AUX_FUNCTION 218
(which may change the mode), DO_GUIDED_LIMITS 222, DO_ENGINE_CONTROL 223, and a parachute that is released.
"""


def follow(
    mission: Mission,
    vehicle: Vehicle,
    ground_amsl: Callable[[float, float], float],
    *,
    rtl_rel_home_m: float | None = None,
) -> Flight:
    """The flight that ``mission`` (as stored on board) asks for.

    ``ground_amsl(lat_deg, lon_deg)`` is the terrain, NaN where unknown. ``rtl_rel_home_m`` is the altitude of a
    return above home; without it an RTL is not judged.
    """
    pilot = _Pilot(mission, vehicle, ground_amsl, rtl_rel_home_m)
    for seq, item in enumerate(mission.items, start=mission.first_seq):
        pilot.fly(seq, item)
    pilot.finish()
    return pilot.flight


class _Pilot:
    def __init__(
        self,
        mission: Mission,
        vehicle: Vehicle,
        ground_amsl: Callable[[float, float], float],
        rtl_rel_home_m: float | None,
    ) -> None:
        self.flight = Flight()
        self.autopilot = mission.autopilot
        self.vehicle = vehicle
        self.ground = ground_amsl
        self.rtl_rel_home_m = rtl_rel_home_m
        self.speed_m_s = vehicle.speed_max_m_s
        self.circle_m = 0.0
        lat, lon = mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7
        ground = ground_amsl(lat, lon)
        if math.isnan(ground):
            self.flight.not_judged.append(f"the ground at home ({lat:.7f}, {lon:.7f}) is unknown")
            ground = mission.home.amsl_m
        elif abs(ground - mission.home.amsl_m) > max(1.0, vehicle.limits.altitude_error_m):
            self.flight.notes.append(
                f"home is given as {mission.home.amsl_m:.1f} m AMSL and the terrain model says {ground:.1f} m there: "
                f"the terrain model was taken"
            )
        self.home: Place = (lat, lon, ground)
        self.at: Place = self.home
        self.airborne = False
        self.known = True
        self.landed = False

    # -- one item --------------------------------------------------------------------------------------------

    def fly(self, seq: int, item: MissionItem) -> None:
        if self.landed:
            self.flight.not_judged.append(f"item {seq} comes after the landing: what it does is not judged")
            return
        command = item.command
        if self.autopilot is Autopilot.PX4 and self._off_africa(item):
            self._lose(seq, item)
        elif command in (m.TAKEOFF, m.VTOL_TAKEOFF):
            self._take_off(seq, item)
        elif command == m.WAYPOINT:
            self._go(seq, item, hold_s=self._hold(item))
        elif command in (m.LOITER_UNLIM, m.LOITER_TIME, m.LOITER_TURNS):
            self._loiter(seq, item)
        elif command in (m.LAND, m.VTOL_LAND):
            self._land(seq, item)
        elif command == m.RTL:
            self._return_home(seq)
        elif command == m.DO_CHANGE_SPEED:
            # On ArduPlane a ground speed is a lower bound, not a target (commands_logic.cpp, `do_change_speed`).
            targets = (0.0,) if self.autopilot is Autopilot.ARDUPLANE else (0.0, 1.0)
            if item.params[0] in targets and item.params[1] > 0:
                self.speed_m_s = item.params[1]
        elif command == m.DELAY:
            self._wait(seq, item)
        elif command not in UNMOVED and (command != PARACHUTE or item.params[0] == RELEASE):
            self._lose(seq, item)

    def finish(self) -> None:
        """What happens after the last item, where it is not a landing."""
        if self.airborne and not self.landed and self.autopilot is Autopilot.ARDUPLANE:
            last = self.flight.stretches[-1]
            if last.kind != "loiter" or last.hold_s < math.inf:
                self.flight.not_judged.append(
                    "after the last item ArduPlane returns home by itself (RTL): that way is not judged; "
                    "end the mission with a landing, a loiter or an RTL"
                )

    # -- pieces ----------------------------------------------------------------------------------------------

    def _take_off(self, seq: int, item: MissionItem) -> None:
        if self.airborne:
            self._lose(seq, item)
            return
        if item.command == m.TAKEOFF and self.autopilot is Autopilot.ARDUPLANE:
            self.flight.not_judged.append(
                f"item {seq}: a runway take-off (NAV_TAKEOFF on ArduPlane) leaves straight ahead on a heading that "
                f"the mission does not hold"
            )
            self.airborne, self.known = True, False
            return
        if item.command == m.VTOL_TAKEOFF and self.autopilot is not Autopilot.ARDUPLANE:
            self._lose(seq, item)
            return
        lat, lon, ground = self.home
        if self.autopilot is Autopilot.PX4 and self._has_place(item):
            away_m = _flat_m((lat, lon, 0.0), (item.lat_deg, item.lon_deg, 0.0))
            if away_m > 1.0:
                self.flight.not_judged.append(
                    f"item {seq}: take-off lies {away_m:.0f} m from home: what PX4 does between is not judged"
                )
        top = self._altitude(item, (lat, lon, ground))
        if self.autopilot is Autopilot.ARDUPLANE and m.FRAME_SYNONYMS.get(item.frame, item.frame) != m.RELATIVE:
            self.flight.not_judged.append(
                f"item {seq}: ArduPlane's VTOL take-off climbs by its altitude, whatever its frame, unless Q_OPTIONS "
                f"says otherwise: only an altitude relative to home (frame 3) is judged"
            )
            top = None if top is None else max(top, ground + item.z)
        if top is None:
            self._lose(seq, item)
            return
        top = max(top, ground + LEAST_CLIMB_M.get(self.autopilot, 0.0))
        self._add(seq, "takeoff", (lat, lon, ground), (lat, lon, top), column=True)
        self.at = (lat, lon, top)
        self.airborne = True

    def _go(self, seq: int, item: MissionItem, *, hold_s: float = 0.0, short_m: float = 0.0) -> None:
        """To the item's place; its altitude is reached ``short_m`` before it, at a circle's edge."""
        target = self._target(item)
        if target is None:
            self._lose(seq, item)
            return
        if not self.airborne or not self.known:
            if not self.airborne:
                self.flight.not_judged.append(
                    f"item {seq} is the first to fly to and there is no take-off before it: the way from home to it "
                    f"is not judged"
                )
            self.airborne = self.known = True
            self.at = target
        terrain, away_m = item.frame in (m.TERRAIN, 11), _flat_m(self.at, target)
        if short_m > 0.0 and away_m > short_m and not terrain:
            part = 1.0 - short_m / away_m
            edge = tuple(a + part * (b - a) for a, b in zip(self.at[:2], target[:2], strict=True))
            self._leg(seq, "cruise", (edge[0], edge[1], target[2]), terrain=False)
        self._leg(seq, "cruise", target, terrain=terrain, hold_s=hold_s)

    def _leg(self, seq: int, kind: StretchKind, target: Place, *, terrain: bool, hold_s: float = 0.0) -> None:
        """From here to ``target``, in whatever way the autopilot changes its altitude on the way."""
        here = self.at
        self._add(seq, kind, here, target, terrain=terrain, hold_s=hold_s, on_path=kind == "cruise")
        self.at = target
        if self.autopilot is not Autopilot.ARDUPLANE:
            return
        start = self.ground(*target[:2]) + here[2] - self.ground(*here[:2]) if terrain else here[2]
        rise = target[2] - start
        if abs(rise) < PLANE_GLIDE_SLOPE_MIN_M or (rise > 0 and here[2] - self.home[2] <= PLANE_LOW_M):
            middle = 0.5 * rise
            low, high = (*here[:2], here[2] + middle), (*target[:2], target[2] - middle)
            self._instead(seq, kind, low, high, terrain=terrain, band_m=abs(middle))

    def _loiter(self, seq: int, item: MissionItem) -> None:
        turns = item.command == m.LOITER_TURNS
        if turns and self.autopilot is Autopilot.PX4:  # refused on upload
            self._lose(seq, item)
            return
        given_m = abs(item.params[2]) if turns and math.isfinite(item.params[2]) else 0.0
        plane = self.autopilot is Autopilot.ARDUPLANE
        reach_m = 0.0
        if turns or plane:
            default_m, parameter = (
                (PLANE_LOITER_RADIUS_M, "WP_LOITER_RAD") if plane else (COPTER_CIRCLE_RADIUS_M, "CIRCLE_RADIUS")
            )
            reach_m = given_m or max(default_m, self.circle_m)
            if not given_m:
                self.flight.notes.append(
                    f"item {seq}: the circle is judged with {parameter} {default_m:g} m, the default"
                )
        if turns and not plane:
            self.circle_m = reach_m  # a radius once given holds for later circles that give none
        self._go(seq, item, short_m=0.0 if plane else reach_m)
        if not self.known:
            return
        if plane:
            reach_m *= _circle_growth(self.at[2])
        hold_s = self._turns_s(item, reach_m) if turns else self._loiter_s(item)
        self._add(seq, "loiter", self.at, self.at, reach_m=reach_m, hold_s=hold_s)

    def _land(self, seq: int, item: MissionItem) -> None:
        if not self.known or not self.airborne:
            self._lose(seq, item)
            return
        if item.command == m.LAND and self.autopilot is Autopilot.ARDUPLANE:
            self.flight.not_judged.append(f"item {seq}: a runway landing's glide (NAV_LAND on ArduPlane) is not judged")
            self.landed = True
            return
        if self._has_place(item):
            self._fly_to_landing(seq, item)
        ground = self.ground(self.at[0], self.at[1])
        if math.isnan(ground):
            self.flight.not_judged.append(f"item {seq}: the ground at the landing place is unknown")
        else:
            down = (self.at[0], self.at[1], ground)
            self._add(seq, "land", self.at, down, column=True)
            self.at = down
        self.landed = True

    def _fly_to_landing(self, seq: int, item: MissionItem) -> None:
        here, terrain = self.at, item.frame in (m.TERRAIN, 11) and self.autopilot is Autopilot.ARDUCOPTER
        level = (item.lat_deg, item.lon_deg, here[2])
        agl = here[2] - self.ground(*here[:2])
        follows = (*level[:2], self.ground(*level[:2]) + agl)
        self.at = follows if terrain and not math.isnan(agl) else level
        if _flat_m(here, level) <= 0.02:
            self.at = level
            return
        self._add(seq, "land", here, self.at, terrain=terrain)
        if self.autopilot is Autopilot.ARDUCOPTER and not terrain and not math.isnan(follows[2]):
            down = (*level[:2], min(follows[2], self.ground(*level[:2])))
            self._instead(seq, "land", here, follows, terrain=True)
            self._instead(seq, "land", follows, down, column=True)

    def _return_home(self, seq: int) -> None:
        if not self.known or not self.airborne or self.rtl_rel_home_m is None:
            why = "its altitude is the vehicle's own (give rtl_rel_home_m)" if self.known else "its start is unknown"
            self.flight.not_judged.append(f"item {seq}: the return home is not judged: {why}")
            self.landed = True
            return
        lat, lon, ground = self.home
        height = ground + self.rtl_rel_home_m
        if self.autopilot is Autopilot.ARDUPLANE:
            middle, half = 0.5 * (height + self.at[2]), 0.5 * abs(height - self.at[2])
            # The track error holds the turn radius: to turn about takes twice as much.
            self._instead(seq, "rtl", self.at, self.at, reach_m=2.0 * self.vehicle.limits.track_error_m)
            self._add(seq, "rtl", (*self.at[:2], middle), (lat, lon, middle), band_m=half, reach_m=0.0)
            self._add(
                seq, "rtl", (lat, lon, height), (lat, lon, height),
                reach_m=PLANE_LOITER_RADIUS_M * _circle_growth(height), hold_s=math.inf,
            )  # fmt: skip
            self.at = (lat, lon, height)
        else:
            height = max(height, self.at[2])  # neither autopilot descends before it is home
            slope = PX4_CONE_SLOPE if self.autopilot is Autopilot.PX4 else COPTER_CONE_SLOPE
            least = ground + slope * _flat_m(self.at, self.home)
            if self.autopilot is Autopilot.PX4 and least < height:
                least = self.at[2]  # versions differ in what they do near home
            least = max(self.at[2], least)
            if least < height:
                middle, half = 0.5 * (least + height), 0.5 * (height - least)
                self._instead(seq, "rtl", (*self.at[:2], middle), (lat, lon, middle), band_m=half)
            up = (*self.at[:2], height)
            self._add(seq, "rtl", self.at, up, column=True)
            self._add(seq, "rtl", up, (lat, lon, height))
            self._add(seq, "rtl", (lat, lon, height), (lat, lon, ground), column=True)
            self.at = (lat, lon, ground)
        self.landed = True

    def _wait(self, seq: int, item: MissionItem) -> None:
        if self.autopilot is Autopilot.ARDUPLANE and self.airborne:
            return
        if 0 < item.params[0] < math.inf:
            self._add(seq, "loiter", self.at, self.at, hold_s=item.params[0], column=not self.airborne)
        else:
            self.flight.not_judged.append(f"item {seq}: a wait until a time of day costs what is not known beforehand")

    def _lose(self, seq: int, item: MissionItem) -> None:
        self.flight.not_judged.append(
            f"item {seq}: what {self.autopilot} flies for command {item.command} is not judged"
        )
        target = self._target(item) if self._has_place(item) else None
        if target is not None and item.command < 95:
            self.at, self.known, self.airborne = target, True, True
        elif item.command < 95 or item.command in (m.DO_JUMP, m.DO_SET_HOME):
            self.known = False

    # -- small helpers ---------------------------------------------------------------------------------------

    def _instead(self, seq: int, kind: StretchKind, start: Place, end: Place, **more: object) -> None:
        self.flight.instead.append(Stretch(seq, kind, start, end, self.speed_m_s, **more))  # type: ignore[arg-type]

    def _add(self, seq: int, kind: StretchKind, start: Place, end: Place, **more: object) -> None:
        self.flight.stretches.append(Stretch(seq, kind, start, end, self.speed_m_s, **more))  # type: ignore[arg-type]

    def _has_place(self, item: MissionItem) -> bool:
        return item.frame != m.NO_POSITION and not (item.x == 0 and item.y == 0)

    def _off_africa(self, item: MissionItem) -> bool:
        """A way point at latitude = longitude = 0, for an autopilot to which that is a place like any other."""
        moves = (m.WAYPOINT, m.LOITER_UNLIM, m.LOITER_TIME, m.LAND, m.VTOL_LAND)
        return item.command in moves and item.x == 0 and item.y == 0

    def _target(self, item: MissionItem) -> Place | None:
        lat, lon = (item.lat_deg, item.lon_deg) if self._has_place(item) else self.at[:2]
        if not self._has_place(item) and not self.known:
            return None
        amsl = self._altitude(item, (lat, lon, self.at[2]))
        return None if amsl is None else (lat, lon, amsl)

    def _altitude(self, item: MissionItem, here: Place) -> float | None:
        frame = m.FRAME_SYNONYMS.get(item.frame, item.frame)
        if not math.isfinite(item.z):
            return None
        keeps = self.autopilot is Autopilot.ARDUCOPTER and item.command != m.TAKEOFF
        keeps = keeps or (self.autopilot is Autopilot.ARDUPLANE and not self._has_place(item))
        if item.z == 0.0 and keeps:
            if not self.known:
                return None
            if frame != m.TERRAIN or self.autopilot is Autopilot.ARDUPLANE:
                return self.at[2]
            kept = self.ground(*here[:2]) + self.at[2] - self.ground(*self.at[:2])
            return None if math.isnan(kept) else kept
        if frame == m.GLOBAL:
            return item.z
        if frame == m.RELATIVE:
            return self.home[2] + item.z
        if frame == m.TERRAIN:
            ground = self.ground(here[0], here[1])
            return None if math.isnan(ground) else ground + item.z
        return None

    def _hold(self, item: MissionItem) -> float:
        if self.autopilot is Autopilot.ARDUPLANE or not math.isfinite(item.params[0]):
            return 0.0
        return max(0.0, item.params[0])

    def _loiter_s(self, item: MissionItem) -> float:
        if item.command != m.LOITER_TIME:
            return math.inf
        return max(0.0, item.params[0]) if math.isfinite(item.params[0]) else math.inf

    def _turns_s(self, item: MissionItem, reach_m: float) -> float:
        turns = item.params[0] if math.isfinite(item.params[0]) and item.params[0] > 0 else 1.0
        return turns * 2.0 * math.pi * reach_m / self.speed_m_s


def _circle_growth(amsl_m: float) -> float:
    """By how much ArduPlane widens a circle at an altitude: (true over equivalent airspeed)², ISA, on a hot day."""
    return float(1.1 / (1.0 - 2.25577e-5 * max(amsl_m, 0.0)) ** 4.2559)


def _flat_m(a: Place, b: Place) -> float:
    """Horizontal metres between places, good for telling whether they are the same."""
    north = (b[0] - a[0]) * 111_195.0
    east = ((b[1] - a[1] + 180.0) % 360.0 - 180.0) * 111_195.0 * math.cos(math.radians(0.5 * (a[0] + b[0])))
    return math.hypot(north, east)
