"""How each autopilot returns: one table of rules, one return as straight pieces, and the seconds that it takes at most.

- ArduCopter (mode_rtl.cpp, ``compute_return_target``): climbs on the spot to the higher of its altitude and RTL_ALT
  (RTL_ALT_M since 4.7; relative to home), flies straight home at that altitude, descends. Within a cone around home it
  climbs less: to RTL_CONE_SLOPE times the distance, at least 2.5 m. RTL_CLIMB_MIN (0) is added to its own altitude.
  Over home it hovers for RTL_LOIT_TIME (5 s), turning its nose as it was when it armed, before it descends.
- PX4 (rtl.cpp): the same with RTL_RETURN_ALT (30 m for multicopters, rc.mc_defaults) and RTL_CONE_ANG (45 degrees).
  Later versions have the cone only within RTL_MIN_DIST (10 m) of home and climb fully beyond it; older ones go to
  RTL_DESCEND_ALT within that distance. It flies home at MPC_XY_CRUISE (`Vehicle.return_speed_m_s`). It
  returns so with RTL_TYPE 0 alone (`return_parameters.returns_otherwise`).
- ArduPlane, a QuadPlane too: turns and flies home at once, and on the way climbs or glides to RTL_ALTITUDE
  (ALT_HOLD_RTL before 4.5; -1 keeps its altitude). Over home it circles with WP_LOITER_RAD, grown with altitude.

How far each goes on before it flies home is in `stopping`.

Two modules read these rules. `returned` is the return of an RTL item, from one place; `returns.obstacles` judges the
return after a failsafe, from every point of a mission. Where an autopilot may fly one of several altitudes, both judge
all of them: in the cone from the cone's altitude up to the return altitude, on a plane's flight home from its altitude
to the return altitude. Not judged: RTL_ALT_TYPE 1 (terrain), RTL_CLIMB_MIN, fences that cap the return, Q_RTL_MODE,
missions with DO_LAND_START. `cone_differs` is judged in `returned` alone.

`return_s` is what a base power (`gcsplan.vehicle.Energy`) needs to know of a return; a wind makes its way longer
(`flight.ways_home.WaysHome`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise
from typing import TypeAlias, TypeVar

from gcsplan.arrays import Floats
from gcsplan.check.motion.circles import PLANE_LOITER_RADIUS_M, circle_growth
from gcsplan.check.motion.stretch import Place, Stretch, flat_m
from gcsplan.fleet.motion.timing import LAND_SLOWLY_M, PX4_LAND_SLOWLY_M
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits

AT_HOME_M = 5.0
"""Within this distance of home, m, or within the track error if that is larger, a return is only a descent."""

ASIDE_PARTS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Parts of a plane's flight home: it begins aside of the line, and nears the line all the way; each has one width."""

Metres = TypeVar("Metres", float, Floats)


class RallyAltitude(Enum):
    """The meaning of a rally point's altitude for a return to it."""

    GROUND = "the point must lie on the ground, and the return altitude counts from it"
    RAISES = "the return is no lower than the point's altitude"
    OWN = "the return is at the point's altitude"


@dataclass(frozen=True, slots=True)
class ReturnRule:
    """The return of one autopilot; all numbers are the autopilot's defaults.

    ``parameter``: its name for the return altitude, which counts from home. ``climbs_first``: it climbs on the spot,
    never descends before it is home, and then descends vertically; else it turns, changes its altitude on the way, and
    circles over home with ``loiter_radius_m``. ``cone_slope``: rise over run of the cone around home; inside the cone
    it climbs only to the cone's altitude; 0: no cone. ``cone_differs``: some versions may fly lower near home, so an
    RTL item is judged as if it did not climb within the cone.
    """

    parameter: str
    default_rel_home_m: float
    climbs_first: bool
    cone_slope: float
    cone_differs: bool
    loiter_radius_m: float
    rally: RallyAltitude

    def level_amsl_m(self, return_amsl_m: float, begins_amsl_m: float) -> float:
        """The altitude AMSL of the flight home, for a return altitude and the altitude at which the return begins."""
        return max(return_amsl_m, begins_amsl_m) if self.climbs_first else return_amsl_m

    def cone_amsl_m(self, base_amsl_m: float, distance_m: Metres) -> Metres:
        """The lowest altitude to climb to at a distance from home; the cone's tip is at ``base_amsl_m``."""
        return base_amsl_m + self.cone_slope * distance_m

    def circle_m(self, amsl_m: float) -> float:
        """Radius of the circle over home at an altitude, m."""
        return self.loiter_radius_m * circle_growth(amsl_m)


RETURN_RULES = {
    Autopilot.ARDUCOPTER: ReturnRule(
        "RTL_ALT", 15.0, climbs_first=True,
        cone_slope=3.0,  # RTL_CONE_SLOPE
        cone_differs=False, loiter_radius_m=0.0, rally=RallyAltitude.RAISES,
    ),
    Autopilot.ARDUPLANE: ReturnRule(
        "RTL_ALTITUDE", 100.0, climbs_first=False, cone_slope=0.0, cone_differs=False,
        loiter_radius_m=PLANE_LOITER_RADIUS_M, rally=RallyAltitude.OWN,
    ),
    Autopilot.PX4: ReturnRule(
        "RTL_RETURN_ALT", 30.0, climbs_first=True,
        cone_slope=1.0,  # RTL_CONE_ANG 45°
        cone_differs=True, loiter_radius_m=0.0, rally=RallyAltitude.GROUND,
    ),
}  # fmt: skip


def at_home_m(limits: Limits) -> float:
    """The distance from home within which a return is only a descent, m."""
    return max(AT_HOME_M, limits.track_error_m)


Flies: TypeAlias = Callable[..., Stretch]
"""Makes a stretch of a return from its two places, and other fields of `Stretch` by name."""


def returned(
    flies: Flies,
    rule: ReturnRule,
    at: Place,
    home: Place,
    return_amsl_m: float,
    *,
    about_m: float,
    circle_m: float = 0.0,
    waits_s: float = 0.0,
) -> tuple[list[Stretch], list[Stretch]]:
    """The return from ``at`` to ``home`` (a place on the ground); and what some versions fly in place of parts of it.

    ``waits_s``: the seconds over home before it descends. ``about_m``: see `stopping.about_turn_m`; a plane flies home
    from anywhere that far from ``at``, and circles over home within ``circle_m``, see `stopping.circle_home_m`.
    """
    lat, lon, ground = home
    level = rule.level_amsl_m(return_amsl_m, at[2])
    over = (lat, lon, level)
    if not rule.climbs_first:
        aside = _band(flies, at, home, at[2], level)
        return [
            aside,
            flies(over, over, reach_m=circle_m, hold_s=math.inf),
        ], [
            flies(at, at, reach_m=about_m),
            *(_part(aside, a, b, (1.0 - a) * about_m) for a, b in pairwise(ASIDE_PARTS)),
        ]
    cone = rule.cone_amsl_m(ground, flat_m(at, home))
    if rule.cone_differs and cone < level:
        cone = -math.inf
    lowest = max(at[2], min(cone, level))
    up = (*at[:2], level)
    return [
        flies(at, up, column=True),
        flies(up, over),
        *([flies(over, over, hold_s=waits_s)] if waits_s > 0.0 else []),
        flies(over, (lat, lon, ground), column=True),
    ], [_band(flies, at, home, lowest, level)] if lowest < level else []


def _part(way: Stretch, a: float, b: float, reach_m: float) -> Stretch:
    """A part of a level stretch, widened."""
    (lat, lon, amsl), end = way.start, way.end
    places = [(lat + f * (end[0] - lat), lon + f * (end[1] - lon), amsl) for f in (a, b)]
    return replace(way, start=places[0], end=places[1], reach_m=reach_m)


def _band(flies: Flies, at: Place, home: Place, a_amsl_m: float, b_amsl_m: float) -> Stretch:
    """A level flight home at any altitude between two."""
    middle, half = 0.5 * (a_amsl_m + b_amsl_m), 0.5 * abs(b_amsl_m - a_amsl_m)
    return flies((*at[:2], middle), (*home[:2], middle), band_m=half)


CHANGES = 1.5
"""A flight home stops, starts and stops: each takes half of speed over acceleration longer than at full speed."""

RETURN_OWN_METRES = 1.02
"""ArduPilot's own metres may be this much longer than those over ground, 150 km from home at most."""


def speed_home_m_s(vehicle: Vehicle, speed_m_s: float) -> float:
    """The speed of the flight home; ``speed_m_s``: the mission's where it begins (NaN: the vehicle's fastest)."""
    own_m_s = vehicle.speed_max_m_s if math.isnan(speed_m_s) else speed_m_s
    return own_m_s if vehicle.return_speed_m_s is None else min(own_m_s, vehicle.return_speed_m_s)


def return_s(vehicle: Vehicle, way_m: float, rise_m: float, down_m: float, speed_m_s: float) -> float:
    """Seconds of a return without its wait over home: no fewer than the time table has (`fleet.motion.timing`).

    ``way_m``: horizontal; ``rise_m``: from its beginning to its level, negative if that is lower; ``down_m``: from
    there to the ground at home; ``speed_m_s``: the mission's speed where it begins (NaN: the vehicle's fastest). The
    result is convex in the three lengths.
    """
    speed = speed_home_m_s(vehicle, speed_m_s)
    # A rate that is not bounded is the speed in space.
    climb, descent, land = (
        speed if math.isinf(rate) else rate for rate in (vehicle.climb_m_s, vehicle.descent_m_s, vehicle.land_m_s)
    )
    slow_m = PX4_LAND_SLOWLY_M if vehicle.autopilot is Autopilot.PX4 else LAND_SLOWLY_M
    seconds = max(rise_m, 0.0) / climb + max(-rise_m, 0.0) / descent + down_m / descent
    seconds += min(down_m, slow_m) / min(land, descent)
    seconds += way_m / speed * (RETURN_OWN_METRES if vehicle.lays_curves else 1.0)
    if math.isfinite(vehicle.vertical_accel_m_s2):
        seconds += (climb + 2.0 * descent) / vehicle.vertical_accel_m_s2
    if math.isfinite(vehicle.accel_m_s2):
        # PX4 brakes by 2 a/j seconds at the speed earlier (`fleet.motion.px4`); without a bound of the jerk this is 0.
        jerks_s = (4.0 if vehicle.smooths else 2.0) * vehicle.accel_m_s2 / vehicle.leg_jerk_m_s3
        seconds += CHANGES * (speed / vehicle.accel_m_s2 + jerks_s)
    return seconds
