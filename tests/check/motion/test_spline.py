"""The curve of a spline way point: its steepest slopes, in metres of the ellipsoid."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import Geod

from gcsplan.check.judge import judge
from gcsplan.check.motion.spline import chords, steepest_slopes, towards
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits
from tests.support.effort import seeds
from tests.support.worlds import world

WGS84 = Geod(ellps="WGS84")
LOOKS = 200_000


@pytest.mark.parametrize("seed", seeds(6, 6, 40))
def test_no_place_of_a_curve_is_steeper_than_is_said(seed: int) -> None:
    """Compared with 200,000 samples of the curve; curves that almost turn back peak within a thousandth of it."""
    rng = np.random.default_rng(seed)
    leaves, square, cube = rng.normal(0.0, [[30.0, 30.0, 10.0]] * 3)
    if seed % 2:  # the horizontal speed almost vanishes at one point
        t0, v = rng.uniform(0.2, 0.8), rng.normal(0.0, 30.0, 2)
        cube[:2] = v / 3.0
        square[:2] = -v * t0 + rng.normal(0.0, 0.5, 2)
        leaves[:2] = v * t0**2 + rng.normal(0.0, 0.5, 2)
    t = np.linspace(0.0, 1.0, LOOKS + 1)
    speed = leaves + 2.0 * square * t[:, None] + 3.0 * cube * t[:, None] ** 2
    slope = speed[:, 2] / np.hypot(speed[:, 0], speed[:, 1])
    pieces = 8
    for k, (up, down) in enumerate(steepest_slopes(leaves, square, cube, pieces)):
        mine = slope[k * LOOKS // pieces : (k + 1) * LOOKS // pieces + 1]
        assert mine.max() <= up + 1e-9 * max(1.0, abs(up))
        assert mine.min() >= down - 1e-9 * max(1.0, abs(down))
    ups, downs = zip(*steepest_slopes(leaves, square, cube, pieces), strict=True)
    assert max(ups) <= slope.max() + 1e-3 * abs(slope.max()) + 1e-3  # and the bound is tight
    assert min(downs) >= slope.min() - 1e-3 * abs(slope.min()) - 1e-3


@pytest.mark.parametrize("stands", ["at_start", "at_end", "on_the_way"])
@pytest.mark.parametrize("seed", seeds(2, 2, 20))
def test_where_a_curve_stands_still_it_is_as_steep_as_it_leaves_and_arrives(stands: str, seed: int) -> None:
    """A spline after a hold begins with speed zero: its slope there is the limit of the slope."""
    rng = np.random.default_rng(seed)
    way, other = rng.normal(0.0, [[100.0, 100.0, 20.0]] * 2)
    leaves, arrives = (np.zeros(3), other) if stands == "at_start" else (other, np.zeros(3))
    square, cube = 3.0 * way - 2.0 * leaves - arrives, leaves + arrives - 2.0 * way
    if stands == "on_the_way":  # the speed is (t - t0) (a + b t)
        t0, a, b = rng.uniform(0.2, 0.8), way, other
        leaves, square, cube = -t0 * a, 0.5 * (a - t0 * b), b / 3.0
    pieces = 4
    t = np.linspace(0.0, 1.0, LOOKS + 1)[1:-1]
    speed = leaves + 2.0 * square * t[:, None] + 3.0 * cube * t[:, None] ** 2
    run = np.hypot(speed[:, 0], speed[:, 1])
    slope, t = (speed[:, 2] / run)[run > 1e-7 * run.max()], t[run > 1e-7 * run.max()]
    for k, (up, down) in enumerate(steepest_slopes(leaves, square, cube, pieces)):
        mine = slope[(t >= k / pieces) & (t <= (k + 1) / pieces)]
        assert np.degrees(np.arctan(mine.max())) <= np.degrees(np.arctan(up)) + 0.002
        assert np.degrees(np.arctan(mine.min())) >= np.degrees(np.arctan(down)) - 0.002


@pytest.mark.parametrize("lat", [-60.0, -12.0, 0.0, 36.0, 70.0])
@pytest.mark.parametrize("bearing", [0.0, 50.0, 90.0])
def test_metres_of_a_curve_are_the_ellipsoids(lat: float, bearing: float) -> None:
    lon, north, _ = WGS84.fwd(20.0, lat, bearing, 100.0)
    start, end = (lat, 20.0, 0.0), (north, lon, 50.0)
    assert np.hypot(*towards(start, end)[:2]) == pytest.approx(100.0, rel=1e-6)
    straight = towards(start, end)
    places, bulge_m, slopes = chords(start, end, straight, straight)  # the curve is the straight line
    assert bulge_m == pytest.approx(0.0, abs=1e-9)
    assert all(s == pytest.approx((0.5, 0.5), rel=1e-6) for s in slopes)
    a, b = places[1], places[2]
    _, _, run_m = WGS84.inv(a[1], a[0], b[1], b[0])
    assert (b[2] - a[2]) / run_m == pytest.approx(0.5, rel=1e-5)


WIDE = ((0, 150), (150, 300), (350, 250), (420, 60), (600, 0), (700, 150), (880, 150), (1000, 0))
NARROW = ((0, 60), (40, 100), (90, 90), (120, 40), (160, 40), (190, 80), (240, 80), (270, 40))
LEVEL, HILLY = (40,) * 8, (40, 55, 45, 60, 50, 40, 52, 45)


@pytest.mark.first_quick
@pytest.mark.parametrize(
    ("places", "heights", "speed_m_s", "flown_s"),
    [
        (WIDE, LEVEL, 5.0, 328.2), (WIDE, LEVEL, 10.0, 170.9), (WIDE, LEVEL, 15.0, 133.3),
        (WIDE, HILLY, 5.0, 328.3), (WIDE, HILLY, 10.0, 171.0), (WIDE, HILLY, 15.0, 133.7),
        (NARROW, HILLY, 5.0, 98.9), (NARROW, HILLY, 10.0, 82.5), (NARROW, HILLY, 15.0, 82.5),
    ],
)  # fmt: skip
def test_splines_take_as_long_as_an_arducopter_flew(
    places: tuple[tuple[int, int], ...], heights: tuple[int, ...], speed_m_s: float, flown_s: float
) -> None:
    """Six splines between two way points, from the top of the take-off, as ArduCopter 4.7.0-dev flew them in SITL."""
    where = world(half_m=3000.0)

    def at(command: int, east: float, north: float, up: float, hold_s: float = 0.0) -> MissionItem:
        lat, lon = (float(x) for x in where.frame.to_degrees(east, north))
        return MissionItem(command, m.RELATIVE, (hold_s, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), up)

    ways = [at(cmd.SPLINE_WAYPOINT, *en, up) for en, up in zip(places, heights, strict=True)]
    ways[0] = at(cmd.WAYPOINT, *places[0], heights[0])
    ways[-1] = at(cmd.WAYPOINT, *places[-1], heights[-1], 2.0)
    beyond = at(cmd.WAYPOINT, places[-1][0], places[-1][1] - 80, heights[-1])
    items = (at(cmd.TAKEOFF, 0, 0, 40), *ways, beyond, at(cmd.LAND, places[-1][0], places[-1][1] - 80, 0))
    craft = Vehicle(
        "uav1", 1, Autopilot.ARDUCOPTER, Limits(10.0), speed_max_m_s=speed_m_s, leg_jerk_m_s3=1.0,
        lean_angle_deg=45.0 if speed_m_s > 9.0 else 30.0,
    )  # fmt: skip
    verdict = judge(Mission(Autopilot.ARDUCOPTER, Home.at(36.6, -84.3, 300.0), items), craft, where)
    told_s = sum(leg.time_s - leg.hold_s for leg in verdict.legs if 1 < leg.seq <= 9)
    assert told_s == pytest.approx(flown_s, rel=0.01)
