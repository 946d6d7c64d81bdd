"""A fixed wing turns before its climb-out ends, and rises above its altitude; a landing says how the ground slopes."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, ClimbOut, Vehicle
from gcsplan.world.geodesy.atmosphere import true_per_indicated
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.noted import coded, codes
from tests.support.worlds import Height, world

TOP_M = 80.0


def verdict(
    east_m: float, north_m: float, *zones: tuple[float, float, float] | Zone, max_agl_m: float | None = None,
    frame: int = m.RELATIVE, next_m: float = TOP_M, ground: Height | float = 300.0, climbs: ClimbOut | None = None,
) -> Verdict:  # fmt: skip
    """Take-off to the north over 569 m at 8°, then to a place; zones, or their (east, north, radius)."""
    forbidden = [z if isinstance(z, Zone) else Zone("mast", Circle(*z)) for z in zones]
    where = world(ground, zones=forbidden)

    def at(command: int, east: float, north: float, pitch: float = 0.0, z: float = TOP_M) -> MissionItem:
        lat, lon = (float(x) for x in where.frame.to_degrees(east, north))
        own = m.RELATIVE if command == cmd.TAKEOFF else frame
        return MissionItem(command, own, (pitch, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), z)

    limits = Limits(
        40.0, max_agl_m=max_agl_m, track_error_m=10.0, altitude_error_m=8.0, max_climb_deg=8.0, max_descent_deg=8.0
    )
    craft = Vehicle(
        "wing1", 1, Autopilot.ARDUPLANE, limits, speed_min_m_s=14.0, speed_max_m_s=20.0, climb_m_s=2.8, descent_m_s=2.8,
        turn_radius_m=100.0, climb_out=climbs,
    )  # fmt: skip
    items = (
        at(cmd.TAKEOFF, 0, 569, 8.0), at(cmd.WAYPOINT, east_m, north_m, z=next_m),
        at(cmd.WAYPOINT, 2.0 * east_m, 2.0 * north_m, z=next_m),
        at(cmd.LOITER_UNLIM, 3.0 * east_m, 3.0 * north_m, z=next_m),
    )  # fmt: skip
    return judge(Mission(Autopilot.ARDUPLANE, Home.at(36.6, -84.3, 300.0), items), craft, where)


@pytest.mark.parametrize(("east_m", "north_m"), [(148.0, 394.0), (710.0, 501.0)])
def test_a_zone_where_an_arduplane_flew_after_an_early_turn_is_met(east_m: float, north_m: float) -> None:
    """ArduPlane in SITL flew over these places on its way to (1000, 560); the leg lies 170 and 63 m north of them."""
    found = verdict(1000.0, 560.0, (east_m, north_m, 8.0))
    assert {f.kind for f in found.findings} == {"zone"}


def test_a_zone_beside_all_ways_to_the_next_item_is_not_met() -> None:
    assert verdict(1000.0, 560.0, (500.0, 150.0, 20.0)).findings == ()
    assert verdict(1000.0, 560.0, (-150.0, 300.0, 20.0)).findings == ()


def test_ahead_nothing_is_added() -> None:
    ahead = verdict(0.0, 1500.0, (200.0, 569.0, 20.0), (-200.0, 300.0, 20.0))
    assert ahead.findings == ()
    assert "turns_early" not in codes(ahead.notes)


def test_a_ceiling_is_kept_by_an_aircraft_that_levels_off_late() -> None:
    """It flew 16 m above its take-off's altitude; 8 m are the altitude error."""
    assert [f.kind for f in verdict(0.0, 1500.0, max_agl_m=95.0).findings] == ["max_agl"]
    assert verdict(0.0, 1500.0, max_agl_m=97.0).findings == ()


@pytest.mark.slow
def test_an_early_way_to_an_item_above_ground_follows_the_ground() -> None:
    """A valley of 30 m lies across the ways to (3000, 560): they sink into it, down to what stands at its bottom."""

    def valley(east: Floats, north: Floats) -> Floats:
        return 300.0 - 30.0 * np.exp(-(((east - 1500.0) / 600.0) ** 2)) + 0.0 * north

    cable = Zone("cable", Circle(1500.0, 330.0, 8.0), ceiling=Level(335.0, "amsl"))
    found = verdict(3000.0, 560.0, cable, frame=m.TERRAIN, ground=valley, next_m=100.0).findings
    assert [(f.seq, f.kind) for f in found] == [(1, "zone")]
    assert verdict(3000.0, 560.0, cable, ground=valley, next_m=100.0).findings == ()


def test_an_early_way_to_an_item_little_lower_is_judged_at_both_altitudes() -> None:
    """ArduPlane makes for an altitude less than 15 m away at once (GLIDE_SLOPE_MIN)."""
    under = Zone("net", Circle(148.0, 394.0, 8.0), ceiling=Level(364.0, "amsl"))
    assert [f.kind for f in verdict(1000.0, 560.0, under, next_m=68.0).findings] == ["zone"]
    assert verdict(1000.0, 560.0, under).findings == ()


FLOWN = [
    ("20 m/s, 80 m", 20.74, 80.0, 8.0, 9.52, 24.97, 31.8, (23.26, 52.24)),
    ("20 m/s, 150 m", 20.88, 150.0, 8.0, 9.87, 25.61, 31.9, (45.29, 74.08)),
    ("15 m/s", 15.59, 80.0, 8.0, 8.70, 25.96, 32.7, (24.00, 62.45)),
    ("25 m/s", 25.91, 80.0, 8.0, 9.20, 25.67, 35.0, (20.79, 43.93)),
    ("TECS_PITCH_MAX 8", 20.74, 80.0, 8.0, 7.48, 27.27, 33.8, (20.99, 49.90)),
    ("TECS_PITCH_MAX 25", 20.74, 80.0, 8.0, 11.27, 23.21, 34.1, (24.55, 53.49)),
    ("12 degrees", 20.75, 80.0, 12.0, 9.30, 25.31, 31.8, (13.60, 42.35)),
    ("60 % throttle", 20.73, 80.0, 8.0, 6.35, 17.73, 127.5, (23.29, 52.17)),
    ("45 % throttle", 20.74, 80.0, 8.0, 4.04, 15.67, 341.5, (14.89, 44.91)),
    ("40 m", 20.68, 40.0, 8.0, 8.33, 24.44, 31.8, (10.34, 39.16)),
]
"""Climb-outs of ArduPlane 4.7.0-dev in SITL: cruise speed (true), altitude, pitch, mean climb rate and speed over
ground, ground run, and seconds from leaving the ground to the item's place and 600 m further."""


@pytest.mark.parametrize(("name", "cruise", "top_m", "deg", "rate", "over_ground", "run_m", "flown_s"), FLOWN)
def test_a_known_climb_out_takes_the_time_that_was_flown(
    name: str, cruise: float, top_m: float, deg: float, rate: float, over_ground: float, run_m: float,
    flown_s: tuple[float, float],
) -> None:  # fmt: skip
    where = world(half_m=6000.0)
    ahead_m = top_m / math.tan(math.radians(deg))

    def at(command: int, north: float, pitch: float = 0.0) -> MissionItem:
        lat, lon = (float(x) for x in where.frame.to_degrees(0.0, north))
        return MissionItem(command, m.RELATIVE, (pitch, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), top_m)

    items = (at(cmd.TAKEOFF, ahead_m, deg), at(cmd.WAYPOINT, ahead_m + 600.0), at(cmd.LOITER_UNLIM, ahead_m + 2000.0))
    limits = Limits(10.0, altitude_error_m=8.0, max_climb_deg=deg, max_descent_deg=deg)
    craft = Vehicle(
        "wing1", 1, Autopilot.ARDUPLANE, limits, speed_max_m_s=cruise / float(true_per_indicated(300.0 + top_m)),
        climb_m_s=3.0, descent_m_s=3.0, turn_radius_m=100.0, accel_m_s2=math.inf, corner_accel_m_s2=math.inf,
        vertical_accel_m_s2=math.inf, climb_out=ClimbOut(rate, over_ground),
    )  # fmt: skip
    mission = Mission(Autopilot.ARDUPLANE, Home.at(36.6, -84.3, 300.0), items)
    legs = judge(mission, craft, where).legs
    told = [sum(leg.time_s for leg in legs if leg.seq <= seq) - run_m / cruise for seq in (1, 2)]
    assert told == pytest.approx(flown_s, abs=1.4), name
    assert legs[0].horizontal_m / legs[0].time_s == pytest.approx(over_ground, rel=1e-3)
    assert sum(leg.horizontal_m for leg in legs if leg.seq == 1) == pytest.approx(ahead_m, abs=0.1)


@pytest.mark.slow
def test_a_known_climb_out_levels_off_within_two_seconds_of_its_climb() -> None:
    """With 4.6 m/s SITL rose 3 m too high, with a mean of 11.3 m/s 18.5 m; 8 m are the altitude error."""
    assert verdict(0.0, 1500.0, max_agl_m=92.0, climbs=ClimbOut(6.0, 20.0)).findings == ()
    assert [f.kind for f in verdict(0.0, 1500.0, max_agl_m=91.0, climbs=ClimbOut(6.0, 20.0)).findings] == ["max_agl"]
    assert verdict(0.0, 1500.0, max_agl_m=103.0, climbs=ClimbOut(11.3, 23.0)).findings == ()
    assert [f.kind for f in verdict(0.0, 1500.0, max_agl_m=102.0, climbs=ClimbOut(11.3, 23.0)).findings] == ["max_agl"]


def test_a_known_climb_out_is_judged_as_slant_too() -> None:
    """What it meets on the slant of its pitch it meets still: with less power than usual it flies there."""
    mast = Zone("mast", Circle(0.0, 300.0, 8.0), ceiling=Level(338.0, "amsl"))
    for climbs in (None, ClimbOut(9.5, 25.0)):
        assert {f.kind for f in verdict(0.0, 1500.0, mast, climbs=climbs).findings} == {"zone"}


@pytest.mark.first_quick
@pytest.mark.parametrize(
    "climbs", [ClimbOut(9.5, 25.0), ClimbOut(2.9, 20.0), ClimbOut(2.82, 20.0), ClimbOut(4.0, 28.0)]
)
@pytest.mark.parametrize("to", [(1000.0, 560.0), (600.0, 1100.0), (0.0, 1500.0)])
def test_a_known_climb_out_changes_times_alone(to: tuple[float, float], climbs: ClimbOut) -> None:
    """Also where the turn at its end is an arc that begins on it, and where hardly any of it is level."""
    plain, known = verdict(*to), verdict(*to, climbs=climbs)
    assert (known.findings, known.not_judged) == ((), ())
    for what in ("horizontal_m", "length_m", "energy_j"):
        assert math.fsum(getattr(leg, what) for leg in known.legs) == pytest.approx(
            math.fsum(getattr(leg, what) for leg in plain.legs), rel=1e-9
        )
    assert all(a.end == b.start for a, b in pairwise(known.legs))
    late_s = sum(leg.time_s for leg in plain.legs) - sum(leg.time_s for leg in known.legs)
    assert -0.5 < late_s < 8.0


def notes(slope: float, error_m: float = 8.0) -> list[Note]:
    """Of a landing towards the north on a place 2 km north of home; the ground there falls by ``slope`` northwards."""
    where = world(lambda east, north: 300.0 - slope * (north - 2000.0))

    def at(command: int, north: float, z: float, pitch: float = 0.0) -> MissionItem:
        lat, lon = (float(x) for x in where.frame.to_degrees(0.0, north))
        return MissionItem(command, m.GLOBAL, (pitch, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), z)

    limits = Limits(40.0, track_error_m=10.0, altitude_error_m=error_m, max_climb_deg=8.0, max_descent_deg=8.0)
    craft = Vehicle(
        "wing1", 1, Autopilot.ARDUPLANE, limits, speed_max_m_s=20.0, climb_m_s=2.8, descent_m_s=2.8, turn_radius_m=100.0
    )
    home_m = 300.0 + slope * 2000.0
    items = (
        at(cmd.TAKEOFF, 600.0, home_m + 80.0, 8.0), at(cmd.WAYPOINT, 1500.0, 370.0), at(cmd.LAND, 2000.0, 300.0)
    )  # fmt: skip
    return list(judge(Mission(Autopilot.ARDUPLANE, Home.at(36.6, -84.3, home_m), items), craft, where).notes)


@pytest.mark.parametrize("slope", [0.0, -0.05, 0.005])
def test_a_landing_on_the_level_or_uphill_is_not_told(slope: float) -> None:
    told = codes(notes(slope))
    assert "lands_downhill" not in told
    assert "climb_out_straight" in told  # it was judged


def test_a_landing_downhill_is_told_with_where_it_touches_down() -> None:
    told = coded(notes(0.06), "lands_downhill")
    # 70 m over 500 m are 14 %: at 100 m it is 14 m high, and within 8 m of the 6 m of ground there.
    assert told.item == 3
    assert told.data["slope_percent"] == pytest.approx(6.0, abs=0.1)
    assert (told.data["early_m"], coded(notes(0.06, 2.0), "lands_downhill").data["early_m"]) == (100.0, 20.0)
    assert told.data["uphill_deg"] == pytest.approx(180.0, abs=0.1)
