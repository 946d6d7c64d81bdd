"""The state of the aircraft while a mission is followed, and how it determines an item's place and altitude."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from gcsplan.check.motion.commands import Pace
from gcsplan.check.motion.spline import Direction
from gcsplan.check.motion.stretch import Flight, Place, Stretch, StretchKind, near_lon, place_on
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import LIFTS_M_S, Autopilot, Vehicle
from gcsplan.world.geodesy.atmosphere import true_per_indicated

PLANE_GLIDE_SLOPE_MIN_M = 15.0  # ArduPlane GLIDE_SLOPE_MIN, default
PLANE_LOW_M = 20.0  # ArduPlane setup_glide_slope: below this height above home it climbs at once

TERRAIN_ERROR_M = 30.0
"""ArduPilot shifts all terrain by up to this, m, when it arms; heights that it takes from the ground are as far off."""

PX4_DOWN_M_S = 1.5  # MPC_Z_VEL_MAX_DN, default
PX4_SLOW_BELOW_M = 5.0
"""MPC_LAND_ALT2, default: below this height over home a landing PX4 is as slow as MPC_LAND_SPEED."""


def reads_ground(item: MissionItem) -> bool:
    """Whether the item's altitude is above the ground that the vehicle reads."""
    return m.FRAME_SYNONYMS.get(item.frame, item.frame) == m.TERRAIN


class Aboard:
    """Position, speed and stretches flown so far; and what an item's numbers mean at that point."""

    def __init__(
        self,
        mission: Mission,
        vehicle: Vehicle,
        ground_amsl: Callable[[float, float], float],
        rtl_rel_home_m: float | None,
        read_amsl: Callable[[float, float], float] | None = None,
        read_change_m: Callable[[float, float, float], float] | None = None,
        terrain_error_m: float = TERRAIN_ERROR_M,
    ) -> None:
        self.flight = Flight()
        self.autopilot = mission.autopilot
        self.vehicle = vehicle
        self.ground = ground_amsl
        self.read = ground_amsl if read_amsl is None else read_amsl
        self.read_change_m, self.terrain_error_m = read_change_m, terrain_error_m
        self.off_m = 0.0  # how far `at` may be from its altitude, because it was taken from the ground
        self.rtl_rel_home_m = rtl_rel_home_m
        self.pace = Pace.of(vehicle)
        self.circle_m = 0.0
        self.mission, self.items, self.first_seq = mission, mission.items, mission.first_seq
        self.direction: Direction | None = None
        self.jumped_from: int | None = None
        lat, lon = mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7
        ground = ground_amsl(lat, lon)
        if math.isnan(ground):
            self.flight.not_judged.append(Note("home_ground_unknown", lat=lat, lon=lon))
            ground = mission.home.amsl_m
        elif abs(ground - mission.home.amsl_m) > max(1.0, vehicle.limits.altitude_error_m):
            self.flight.notes.append(Note("home_height_differs", given_m=mission.home.amsl_m, ground_m=ground))
        self.home: Place = (lat, lon, ground)
        self.at: Place = self.home
        self.airborne = False
        self.known = True
        self.landed = self.stopped = False
        self.low_m, self.around_m = 0.0, 0.0  # how far below `at` (negative: above) and aside the next leg may begin, m

    def note(self, note: Note | None) -> None:
        """Add a note unless it is there, if there is one: a round may be flown more than once."""
        if note is not None and note not in self.flight.notes:
            self.flight.notes.append(note)

    def instead(self, seq: int, kind: StretchKind, start: Place, end: Place, **more: object) -> None:
        """Add a stretch that some autopilot versions fly in place of another one."""
        self.flight.instead.append(self.stretch(seq, kind, start, end, more))

    def add(self, seq: int, kind: StretchKind, start: Place, end: Place, **more: object) -> None:
        """Add the next stretch; ``more`` are fields of `Stretch`."""
        self.flight.stretches.append(self.stretch(seq, kind, start, end, more))

    def at_once(
        self, seq: int, kind: StretchKind, here: Place, target: Place, *, terrain: bool, reach_m: float = 0.0
    ) -> None:
        """The altitudes of a leg whose slope an ArduPlane does not fly: it makes for ``target``'s altitude at once."""
        start = self.read(*target[:2]) + here[2] - self.read(*here[:2]) if terrain else here[2]
        rise = target[2] - start
        if abs(rise) < PLANE_GLIDE_SLOPE_MIN_M or (rise > 0 and here[2] - self.home[2] <= PLANE_LOW_M):
            middle = 0.5 * rise
            low, high = (*here[:2], here[2] + middle), (*target[:2], target[2] - middle)
            self.instead(seq, kind, low, high, terrain=terrain, reach_m=reach_m, band_m=abs(middle))

    def begins_low(
        self, seq: int, kind: StretchKind, here: Place, target: Place, *, column: bool = False, part: float = 0.5
    ) -> None:
        """The beginning of a leg that an ArduPlane may begin lower or higher, behind a circle: it corrects that within
        a ``part`` of it."""
        if self.low_m:
            on = place_on(here, target, part)
            low, end = (*here[:2], here[2] - self.low_m), (*on[:2], on[2] - self.low_m)
            self.instead(seq, kind, low, end, reach_m=self.around_m, column=column)

    def stretch(self, seq: int, kind: StretchKind, start: Place, end: Place, more: dict[str, object]) -> Stretch:
        """One stretch at the present pace."""
        rates = LIFTS_M_S if self.vehicle.vtol and more.get("column") else self.pace.rates_m_s
        fields: dict[str, object] = {"rates_m_s": rates, "jumped_from": self.jumped_from} | more
        made = Stretch(seq, kind, start, end, self.pace.speed_m_s, **fields)  # type: ignore[arg-type]
        return made if made.terrain or not self.off_m else replace(made, band_m=made.band_m + self.off_m)

    def settled(self, item: MissionItem) -> None:
        """The vehicle is at the item: its altitude is the item's own, or as far off it as the ground that it read."""
        if reads_ground(item):
            self.circles_over_ground(item, 0.0)
        elif not self.keeps_altitude(item):
            self.off_m = 0.0

    def circles_over_ground(self, item: MissionItem, reach_m: float) -> bool:
        """Count how far a circle around the present place follows the ground up and down; False: it is not known."""
        if not reads_ground(item):
            return True
        alone_m = 0.0 if reach_m == 0.0 else math.nan
        change_m = self.read_change_m(*self.at[:2], reach_m) if self.read_change_m else alone_m
        self.off_m = self.terrain_error_m + (0.0 if math.isnan(change_m) else change_m)
        return not math.isnan(change_m)

    def has_place(self, item: MissionItem) -> bool:
        """Whether the item holds a place; latitude = longitude = 0 means "here"."""
        return item.frame != m.NO_POSITION and not (item.x == 0 and item.y == 0)

    def place(self, item: MissionItem) -> tuple[float, float]:
        """The item's latitude, and its longitude on home's side of the antimeridian."""
        return item.lat_deg, near_lon(item.lon_deg, self.home[1])

    def off_africa(self, item: MissionItem) -> bool:
        """Whether the item goes to latitude = longitude = 0, for an autopilot that takes this as an ordinary place."""
        moves = (cmd.WAYPOINT, cmd.LOITER_UNLIM, cmd.LOITER_TIME, cmd.LAND, cmd.VTOL_LAND)
        return item.command in moves and item.x == 0 and item.y == 0

    def target(self, item: MissionItem) -> Place | None:
        """The place that the item leads to; None if it is unknown."""
        lat, lon = self.place(item) if self.has_place(item) else self.at[:2]
        if not self.has_place(item) and not self.known:
            return None
        amsl = self.altitude(item, (lat, lon, self.at[2]))
        return None if amsl is None else (lat, lon, amsl)

    def keeps_altitude(self, item: MissionItem) -> bool:
        """Whether the item's altitude of 0 means the altitude that the vehicle has."""
        keeps = self.autopilot is Autopilot.ARDUCOPTER and item.command != cmd.TAKEOFF
        keeps = keeps or (self.autopilot is Autopilot.ARDUPLANE and not self.has_place(item))
        return item.z == 0.0 and keeps

    def altitude(self, item: MissionItem, here: Place) -> float | None:
        """The item's altitude AMSL at ``here``, in its frame; None if the ground or the frame is unknown."""
        frame = m.FRAME_SYNONYMS.get(item.frame, item.frame)
        if not math.isfinite(item.z):
            return None
        if self.keeps_altitude(item):
            if not self.known:
                return None
            if frame != m.TERRAIN or self.autopilot is Autopilot.ARDUPLANE:
                return self.at[2]
            kept = self.read(*here[:2]) + self.at[2] - self.read(*self.at[:2])
            return None if math.isnan(kept) else kept
        if frame == m.GLOBAL:
            return item.z
        if frame == m.RELATIVE:
            return self.home[2] + item.z
        if frame == m.TERRAIN:
            ground = self.read(here[0], here[1])
            return None if math.isnan(ground) else ground + item.z
        return None

    def lands_fast(self, seq: int, ground_amsl_m: float) -> None:
        """Note a landing so far above home that PX4 does not slow down for it."""
        above_m = ground_amsl_m - self.home[2]
        if self.autopilot is Autopilot.PX4 and above_m > PX4_SLOW_BELOW_M:
            self.note(Note("lands_fast", seq, above_m=above_m, speed_m_s=PX4_DOWN_M_S))

    def hold(self, item: MissionItem) -> float:
        """Seconds for which the vehicle holds at a way point."""
        if self.autopilot is Autopilot.ARDUPLANE or not math.isfinite(item.params[0]):
            return 0.0
        return max(0.0, item.params[0])

    def loiter_s(self, item: MissionItem) -> float:
        """Seconds of a loiter in one place; inf without end."""
        if item.command != cmd.LOITER_TIME:
            return math.inf
        return max(0.0, item.params[0]) if math.isfinite(item.params[0]) else math.inf

    def turns_s(self, item: MissionItem, reach_m: float) -> float:
        """Seconds that the item's turns take on a circle of radius ``reach_m``.

        In thin air ArduPlane flies a circle that is wider by the square of what makes it faster.
        """
        turns = item.params[0] if math.isfinite(item.params[0]) and item.params[0] > 0 else 1.0
        wider = float(true_per_indicated(self.at[2])) if self.autopilot is Autopilot.ARDUPLANE else 1.0
        return turns * 2.0 * math.pi * reach_m * wider / self.pace.speed_m_s
