"""What an autopilot does with a mission: its items as the straight stretches that are flown.

Only motion is read here, judging is `judge`'s. A command whose motion we do not know is named in ``not_judged``,
never passed over in silence. Facts about the autopilots: ArduPilot's and PX4's sources and a flown ArduCopter.

- Frame-3 altitudes count from where the vehicle arms: the ground at home.
- The frame of the *target* decides how altitude runs along a leg: to a terrain-frame item it is interpolated above
  ground from the height above ground that the leg began with.
- ArduCopter: altitude 0 keeps the altitude, latitude = longitude = 0 is "here"; take-off ignores its place.
- LAND with a place flies there level, then descends. RTL climbs first and returns straight (ArduPlane climbs on the
  way, which is judged as the whole band between both altitudes).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from gcsplan.mavlink import mission as m
from gcsplan.mavlink.mission import Mission, MissionItem
from gcsplan.vehicle import Autopilot, Vehicle

StretchKind = Literal["takeoff", "cruise", "land", "loiter", "rtl"]
Place = tuple[float, float, float]
"""Latitude, longitude in degrees, altitude AMSL in metres."""

PLANE_LOITER_RADIUS_M = 60.0  # ArduPlane WP_LOITER_RAD, default
COPTER_CIRCLE_RADIUS_M = 10.0  # ArduCopter CIRCLE_RADIUS, default
UNMOVED = frozenset(
    {
        m.DELAY, m.CONDITION_DELAY, 114, 115, m.DO_CHANGE_SPEED, 180, 181, 182, 183, 184, 189,
        195, 196, 197, 200, 201, 202, 203, 204, 205, 206, 207, 208, 211, 212, 214, 215, 218, 222, 223,
        530, 531, 532, 2000, 2001, 2500, 2501,
    }
)  # fmt: skip
"""Commands that move nothing but cameras, servos, speeds and clocks (CONDITION_* delay only the next DO_ command)."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """One straight stretch, flown on behalf of wire item ``seq``.

    ``column``: vertical take-off or landing. ``terrain``: altitude is interpolated above ground between the ends.
    ``band_m`` widens the altitude error (altitude is known only within a band), ``reach_m`` the track error (a
    loiter's circle). ``on_path``: counts for the path's length, from the top of the take-off to the approach.
    """

    seq: int
    kind: StretchKind
    start: Place
    end: Place
    speed_m_s: float
    column: bool = False
    terrain: bool = False
    band_m: float = 0.0
    reach_m: float = 0.0
    hold_s: float = 0.0
    on_path: bool = False


@dataclass(slots=True)
class Flight:
    """All stretches in order, what could not be followed, and what is assumed."""

    stretches: list[Stretch] = field(default_factory=list)
    not_judged: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


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
        if command in (m.TAKEOFF, m.VTOL_TAKEOFF):
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
            if item.params[0] in (0.0, 1.0) and item.params[1] > 0:
                self.speed_m_s = item.params[1]
        elif command == m.DELAY:
            self._wait(seq, item)
        elif command not in UNMOVED:
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
        lat, lon, ground = self.home
        if self.autopilot is Autopilot.PX4 and self._has_place(item):
            away_m = _flat_m((lat, lon, 0.0), (item.lat_deg, item.lon_deg, 0.0))
            if away_m > 1.0:
                self.flight.not_judged.append(
                    f"item {seq}: take-off lies {away_m:.0f} m from home: what PX4 does between is not judged"
                )
        top = self._altitude(item, (lat, lon, ground))
        if top is None:
            self._lose(seq, item)
            return
        self._add(seq, "takeoff", (lat, lon, ground), (lat, lon, top), column=True)
        self.at = (lat, lon, top)
        self.airborne = True

    def _go(self, seq: int, item: MissionItem, *, hold_s: float = 0.0, kind: StretchKind = "cruise") -> None:
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
        terrain = item.frame in (m.TERRAIN, 11)
        self._add(seq, kind, self.at, target, terrain=terrain, hold_s=hold_s, on_path=True)
        self.at = target

    def _loiter(self, seq: int, item: MissionItem) -> None:
        self._go(seq, item)
        if not self.known:
            return
        turns = item.command == m.LOITER_TURNS
        given_m = abs(item.params[2]) if turns and math.isfinite(item.params[2]) else 0.0
        if self.autopilot is Autopilot.ARDUPLANE:
            reach_m, parameter = given_m or PLANE_LOITER_RADIUS_M, "WP_LOITER_RAD"
        else:
            reach_m, parameter = (given_m or COPTER_CIRCLE_RADIUS_M, "CIRCLE_RADIUS") if turns else (0.0, "")
        if reach_m and not given_m:
            self.flight.notes.append(f"item {seq}: the circle is judged with {parameter} {reach_m:g} m, the default")
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
            over = (item.lat_deg, item.lon_deg, self.at[2])
            if _flat_m(self.at, over) > 0.02:
                self._add(seq, "land", self.at, over)
            self.at = over
        ground = self.ground(self.at[0], self.at[1])
        if math.isnan(ground):
            self.flight.not_judged.append(f"item {seq}: the ground at the landing place is unknown")
        else:
            down = (self.at[0], self.at[1], ground)
            self._add(seq, "land", self.at, down, column=True)
            self.at = down
        self.landed = True

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
            self._add(seq, "rtl", (*self.at[:2], middle), (lat, lon, middle), band_m=half, reach_m=0.0)
            self._add(
                seq, "rtl", (lat, lon, height), (lat, lon, height), reach_m=PLANE_LOITER_RADIUS_M, hold_s=math.inf
            )
            self.at = (lat, lon, height)
        else:
            height = max(height, self.at[2])  # neither autopilot descends before it is home
            up = (*self.at[:2], height)
            self._add(seq, "rtl", self.at, up, column=True)
            self._add(seq, "rtl", up, (lat, lon, height))
            self._add(seq, "rtl", (lat, lon, height), (lat, lon, ground), column=True)
            self.at = (lat, lon, ground)
        self.landed = True

    def _wait(self, seq: int, item: MissionItem) -> None:
        if item.params[0] > 0:
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

    def _add(self, seq: int, kind: StretchKind, start: Place, end: Place, **more: object) -> None:
        self.flight.stretches.append(Stretch(seq, kind, start, end, self.speed_m_s, **more))  # type: ignore[arg-type]

    def _has_place(self, item: MissionItem) -> bool:
        return item.frame != m.NO_POSITION and not (item.x == 0 and item.y == 0)

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
        if item.z == 0.0 and self.autopilot is Autopilot.ARDUCOPTER and item.command not in (m.TAKEOFF,):
            return self.at[2] if self.known else None
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


def _flat_m(a: Place, b: Place) -> float:
    """Horizontal metres between places, good for telling whether they are the same."""
    north = (b[0] - a[0]) * 111_195.0
    east = ((b[1] - a[1] + 180.0) % 360.0 - 180.0) * 111_195.0 * math.cos(math.radians(0.5 * (a[0] + b[0])))
    return math.hypot(north, east)
