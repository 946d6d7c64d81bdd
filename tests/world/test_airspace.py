"""The exact check of legs: cases with answers worked out by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import shapely
from numpy.typing import ArrayLike, NDArray

from gcsplan.arrays import Floats
from gcsplan.world.airspace import Airspace, LegReport, Legs, Violation
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.random_worlds import jacksboro, random_zones


def world(heights: ArrayLike, zones: Sequence[Zone] = (), *, cell_m: float = 100.0, scale: float = 1.0) -> Airspace:
    """An airspace over rows of heights from north to south, with the south-western node at (0, 0)."""
    z = np.asarray(heights, float)
    return Airspace(Surface(z, z, GridMap.affine(0.0, (len(z) - 1) * cell_m, cell_m, cell_m)), zones, scale=scale)


def flat(zones: Sequence[Zone] = (), *, scale: float = 1.0) -> Airspace:
    """An airspace over ground at 0 m from (-1000, -1000) to (3000, 3000)."""
    z = np.zeros((41, 41))
    return Airspace(Surface(z, z, GridMap.affine(-1000.0, 3000.0, 100.0, 100.0)), zones, scale=scale)


def leg(start: ArrayLike, end: ArrayLike, *, column: bool = False, track: float = 0.0, altitude: float = 0.0) -> Legs:
    return Legs(
        np.array([start], float), np.array([end], float), np.array([column]), np.array([track]), np.array([altitude])
    )


def judged(airspace: Airspace, legs: Legs, limits: Limits) -> LegReport:
    """The report of `examine`, after an assertion that `clear` agrees with it."""
    report = airspace.examine(legs, limits)
    broken = {v.leg for v in report.violations}
    assert airspace.clear(legs, limits).tolist() == [i not in broken for i in range(len(legs))]
    return report


def only(airspace: Airspace, legs: Legs, limits: Limits) -> Violation:
    """The violation of a leg that has exactly one."""
    (violation,) = judged(airspace, legs, limits).violations
    assert violation.by > 0.0
    return violation


def kinds(airspace: Airspace, legs: Legs, limits: Limits) -> set[str]:
    return {v.kind for v in judged(airspace, legs, limits).violations}


# --- heights over the ground -----------------------------------------------------------------------------------------


@pytest.mark.nightly_but("3", "0")
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_a_leg_from_border_to_border_through_a_polygon_is_seen(seed: int) -> None:
    """Both ends lie on the border up to a rounding, perhaps outside, and then no edge seems to cross the leg."""
    rng = np.random.default_rng([13, seed])
    for _ in range(20):
        count = int(rng.integers(3, 10))
        turn = np.sort(rng.uniform(0.0, 2.0 * math.pi, count))
        radius = rng.uniform(100.0, 350.0, count)[:, None]
        ring = np.array([500.0, 500.0]) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        shape = shapely.Polygon(ring)
        if not shape.is_valid or not shapely.LinearRing(ring).is_ccw:
            continue
        airspace = flat([Zone("block", Polygon(ring), None, Level(100.0, "amsl"))])
        edge, f = rng.integers(0, count, (300, 2)), rng.random((300, 2, 1))
        ends = ring[edge] + f * (np.roll(ring, -1, axis=0)[edge] - ring[edge])
        lines = shapely.linestrings(ends)
        inside = shapely.length(shapely.intersection(shapely.buffer(shape, -1e-3), lines)) > 1e-3
        places = np.concatenate([ends, np.full((300, 2, 1), 60.0)], axis=2)
        legs = Legs.between(places[:, 0], places[:, 1], Limits(0.0))
        assert not airspace.clear(legs, Limits(0.0))[inside].any()
        assert inside.sum() > 50


def test_min_agl_at_the_limit_is_legal_and_a_millimetre_below_is_not() -> None:
    limits = Limits(60.0)
    assert not kinds(flat(), leg([100, 100, 60], [900, 700, 60]), limits)
    v = only(flat(), leg([100, 100, 60], [900, 700, 59.999]), limits)
    assert (v.kind, v.limit, v.unit, v.zone, v.leg) == ("min_agl", 60.0, "m", -1, 0)
    assert (v.value, v.by, v.fraction) == pytest.approx((59.999, 0.001, 1.0), abs=1e-9)
    assert (v.east_m, v.north_m, v.amsl_m) == pytest.approx((900, 700, 59.999))


def test_the_hill_between_two_ends_is_seen_where_it_is_highest() -> None:
    """The ground is a saddle, 100·u·(1 − v) + 100·v·(1 − u): 200·t·(1 − t) along one diagonal, 100 m less that along
    the other."""
    airspace = world([[100, 0], [0, 100]])
    over = judged(airspace, leg([0, 0, 150], [100, 100, 150]), Limits(0.0))
    assert (over.min_agl_m[0], over.min_agl_at[0], over.max_agl_m[0]) == pytest.approx((100.0, 0.5, 150.0))
    through = judged(airspace, leg([0, 100, 150], [100, 0, 150]), Limits(0.0))
    assert (through.min_agl_m[0], through.max_agl_m[0]) == pytest.approx((50.0, 100.0))
    assert through.min_agl_at[0] in (0.0, 1.0)


def test_the_quadratic_of_a_cell_is_met_exactly() -> None:
    """The ground is 100·u·v from the south-west: 100·t² along that diagonal, 100·t·(1 − t) along the other."""
    airspace = world([[0, 100], [0, 0]])
    up = judged(airspace, leg([0, 0, 130], [100, 100, 130]), Limits(0.0))
    assert (up.min_agl_m[0], up.min_agl_at[0], up.max_agl_m[0]) == pytest.approx((30.0, 1.0, 130.0))
    across = judged(airspace, leg([0, 100, 130], [100, 0, 130]), Limits(0.0))
    assert (across.min_agl_m[0], across.min_agl_at[0], across.max_agl_m[0]) == pytest.approx((105.0, 0.5, 130.0))
    # Climbing by 40 m: 130 + 40·t − 100·t·(1 − t) is least at t = 0.3.
    climbing = judged(airspace, leg([0, 100, 130], [100, 0, 170]), Limits(122.0))
    assert (climbing.min_agl_m[0], climbing.min_agl_at[0]) == pytest.approx((121.0, 0.3))
    assert climbing.violations[0].by == pytest.approx(1.0)
    assert climbing.violations[0].fraction == pytest.approx(0.3)


def test_obstacles_count_from_below_and_not_from_above() -> None:
    ground = np.zeros((3, 3))
    airspace = Airspace(Surface(ground, ground + 20.0, GridMap.affine(0.0, 200.0, 100.0, 100.0)))
    report = judged(airspace, leg([10, 10, 100], [190, 190, 100]), Limits(80.0, max_agl_m=100.0))
    assert not report.violations
    assert (report.min_agl_m[0], report.max_agl_m[0]) == pytest.approx((80.0, 100.0))
    assert only(airspace, leg([10, 10, 99], [190, 190, 99]), Limits(80.0)).value == pytest.approx(79.0)
    assert only(airspace, leg([10, 10, 101], [190, 190, 101]), Limits(0.0, max_agl_m=100.0)).value == pytest.approx(101)


def test_errors_of_the_leg_widen_and_those_of_the_limits_do_not() -> None:
    limits = Limits(60.0, max_amsl_m=100.0, track_error_m=50.0, altitude_error_m=50.0)
    assert not kinds(flat(), leg([100, 100, 65], [900, 700, 95], altitude=5.0), limits)
    assert only(flat(), leg([100, 100, 65], [900, 700, 64], altitude=5.0), limits).value == pytest.approx(59.0)
    v = only(flat(), leg([100, 100, 65], [900, 700, 97], altitude=5.0), limits)
    assert (v.kind, v.value, v.limit, v.fraction) == ("max_amsl", pytest.approx(102.0), 100.0, 1.0)


@pytest.mark.parametrize("scale", [1.0, 1.001])
def test_on_a_slope_the_track_error_costs_its_rise(scale: float) -> None:
    """The ground rises 0.5 m per metre to the east: within 8 m of the line it is up to 4 m higher than below it."""
    airspace = world(np.tile(np.arange(0, 1050, 50.0), (21, 1)), scale=scale)
    need = 0.5 * 1000.0 + 60.0 + 0.5 * 8.0 * scale
    over = leg([1000, 100, need + 1e-4], [1000, 1900, need + 1e-4], track=8.0)
    assert not kinds(airspace, over, Limits(60.0))
    assert airspace.clear_counted(over, Limits(60.0))[1] < 100  # not cut into pieces of a millimetre
    v = only(airspace, leg([1000, 100, need - 0.001], [1000, 1900, need - 0.001], track=8.0), Limits(60.0))
    assert v.by == pytest.approx(0.001, abs=1e-6)
    # For max AGL the downhill side counts.
    roof = 0.5 * 1000.0 + 120.0 - 0.5 * 8.0 * scale
    limits = Limits(0.0, max_agl_m=120.0)
    assert not kinds(airspace, leg([1000, 100, roof - 1e-4], [1000, 1900, roof - 1e-4], track=8.0), limits)
    assert kinds(airspace, leg([1000, 100, roof + 0.001], [1000, 1900, roof + 0.001], track=8.0), limits) == {"max_agl"}


@pytest.mark.nightly_but("3", "13", "0")
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_beside_a_line_over_bent_ground_what_is_nearer_than_the_reach_counts(seed: int) -> None:
    """A leg in one cell whose corners do not lie in a plane, held against the heights at 200,000 places beside it."""
    rng = np.random.default_rng([47, seed])
    airspace = world(rng.uniform(0.0, 60.0, (4, 4)))
    start, end = rng.uniform(120.0, 180.0, (2, 2))
    reach, climb = rng.uniform(2.0, 19.0), rng.uniform(-20.0, 20.0)
    along, (around, away) = rng.random(200_000), rng.random((2, 200_000))
    turn, away_m = 2.0 * np.pi * around, np.where(away < 0.5, reach, reach * np.sqrt(away))
    beside = start + along[:, None] * (end - start) + away_m[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    ground = airspace.surface.ground_at(*beside.T)
    need = float(np.max(ground - along * climb)) + 10.0
    limits = Limits(10.0, max_climb_deg=90.0, max_descent_deg=90.0)
    for more_m, legal in ((-0.01, False), (0.25, True)):
        legs = leg([*start, need + more_m], [*end, need + more_m + climb], track=reach)
        assert (not kinds(airspace, legs, limits)) is legal, (seed, more_m)


def test_beside_a_cliff_the_horizontal_clearance_binds() -> None:
    """A cliff of 200 m rises from 1000 m to 1100 m east: it is 100 m high at 1050 m east."""
    airspace = world(np.where(np.arange(21) > 10, 200.0, 0.0)[None, :].repeat(21, axis=0))
    limits = Limits(20.0, horizontal_clearance_m=30.0)
    assert not kinds(airspace, leg([1019.99, 100, 100], [1019.99, 1900, 100]), Limits(20.0, horizontal_clearance_m=30))
    v = only(airspace, leg([1020.1, 100, 100], [1020.1, 1900, 100]), limits)
    assert (v.kind, v.limit) == ("terrain_clearance", 0.0)
    assert v.by == pytest.approx(0.2, abs=0.02)
    assert v.value == pytest.approx(-v.by)
    # Track error adds to it, altitude error lowers the flight level.
    assert kinds(airspace, leg([1016.9, 100, 100], [1016.9, 1900, 100], track=3.2), limits) == {"terrain_clearance"}
    assert not kinds(airspace, leg([1016.7, 100, 100], [1016.7, 1900, 100], track=3.2), limits)
    assert kinds(airspace, leg([1019, 100, 100], [1019, 1900, 100], altitude=3), limits) == {"terrain_clearance"}


def test_a_tower_beside_the_line_is_seen_between_nodes() -> None:
    """One node is 300 m high: 50 m away from it the surface is 150 m high along an axis, and 75 m on the diagonal."""
    heights = np.zeros((21, 21))
    heights[10, 10] = 300.0
    airspace = world(heights)
    limits = Limits(0.0, horizontal_clearance_m=40.0)
    assert kinds(airspace, leg([1090.1, 100, 150], [1090.1, 1900, 150]), limits) == set()
    assert kinds(airspace, leg([1089.9, 100, 150], [1089.9, 1900, 150]), limits) == {"terrain_clearance"}


# --- angles, columns --------------------------------------------------------------------------------------------------


def test_climb_and_descent_at_their_angle_are_legal_and_a_hair_steeper_are_not() -> None:
    limits = Limits(0.0, max_climb_deg=15.0, max_descent_deg=10.0)
    rise, drop = 1000.0 * math.tan(math.radians(15.0)), 1000.0 * math.tan(math.radians(10.0))
    assert not kinds(flat(), leg([100, 100, 50], [1100, 100, 50 + rise]), limits)
    assert not kinds(flat(), leg([100, 100, 500], [1100, 100, 500 - drop]), limits)
    up = only(flat(), leg([100, 100, 50], [1100, 100, 50.01 + rise]), limits)
    assert (up.kind, up.unit, up.limit) == ("climb", "deg", 15.0)
    assert up.value == pytest.approx(math.degrees(math.atan2(rise + 0.01, 1000.0)))
    down = only(flat(), leg([100, 100, 500], [1100, 100, 499.99 - drop]), limits)
    assert (down.kind, down.limit) == ("descent", 10.0)
    assert down.value > 10.0


def test_a_vertical_leg_is_legal_where_there_is_no_limit_or_as_a_column() -> None:
    up = leg([100, 100, 50], [100, 100, 150])
    assert judged(flat(), up, Limits(0.0)).climb_deg[0] == 90.0
    assert kinds(flat(), up, Limits(0.0, max_climb_deg=80.0)) == {"climb"}
    assert not kinds(flat(), leg([100, 100, 50], [100, 100, 150], column=True), Limits(0.0, max_climb_deg=80.0))
    still = judged(flat(), leg([100, 100, 50], [100, 100, 50]), Limits(0.0, max_climb_deg=0.0, max_descent_deg=0.0))
    assert still.climb_deg[0] == 0.0
    assert not still.violations


def test_columns_are_exempt_from_the_ground_and_from_nothing_else() -> None:
    tower = np.zeros((21, 21))
    tower[10, 11] = 300.0
    zone = Zone("z", Circle(1000, 1000, 100), None, Level(50, "amsl"))
    limits = Limits(60.0, max_agl_m=100.0, max_amsl_m=90.0, horizontal_clearance_m=80.0, max_climb_deg=15.0)
    column = leg([1000, 1000, 0], [1000, 1000, 101], column=True, track=1.0)
    assert kinds(world(tower), column, limits) == {"max_agl", "max_amsl"}
    assert kinds(world(tower, [zone]), column, limits) == {"max_agl", "max_amsl", "zone"}
    # Columns must keep the clearance from a zone too, but not below its floor.
    beside = Zone("z", Circle(1000, 1175, 100), Level(50, "amsl"), None)
    low = Limits(60.0, horizontal_clearance_m=80.0)
    assert kinds(flat([beside]), leg([1000, 1000, 0], [1000, 1000, 65], column=True), low) == {"zone"}
    assert not kinds(flat([beside]), leg([1000, 1000, 0], [1000, 1000, 50], column=True), low)
    void = np.zeros((21, 21))
    void[10, 10] = np.nan
    assert kinds(world(void), leg([950, 950, 0], [950, 950, 50], column=True), low) == {"coverage"}


# --- coverage --------------------------------------------------------------------------------------------------------


def test_unknown_ground_is_never_ground() -> None:
    heights = np.zeros((21, 21))
    heights[10, 10] = np.nan  # the four cells around (1000, 1000) are unknown
    airspace = world(heights)
    limits = Limits(10.0, horizontal_clearance_m=20.0)
    high = 500.0
    through = judged(airspace, leg([950, 100, high], [950, 1900, high]), limits)
    assert [v.kind for v in through.violations] == ["coverage"]
    assert 900 <= through.violations[0].north_m <= 1100
    assert through.violations[0].value == 0.0
    assert not np.isnan(through.min_agl_m[0])  # the ground is known on the rest of the leg
    near = only(airspace, leg([885, 100, high], [885, 1900, high]), limits)
    assert (near.kind, near.value, near.limit) == ("coverage", pytest.approx(15.0, abs=0.01), 20.0)
    assert not kinds(airspace, leg([879.9, 100, high], [879.9, 1900, high]), limits)
    assert not kinds(airspace, leg([885, 100, high], [885, 1900, high]), Limits(10.0))
    assert kinds(airspace, leg([885, 100, high], [885, 1900, high], track=16.0), Limits(10.0)) == {"coverage"}
    assert np.isnan(judged(airspace, leg([950, 950, high], [960, 960, high]), limits).min_agl_m[0])


def test_along_the_border_is_covered_and_beyond_it_is_not() -> None:
    airspace, limits = world(np.zeros((21, 21))), Limits(10.0)
    for a, b in (((0, 0), (2000, 0)), ((2000, 0), (2000, 2000)), ((0, 2000), (1500, 2000)), ((0, 0), (2000, 2000))):
        assert not kinds(airspace, leg([*a, 50], [*b, 50]), limits)
        assert not kinds(airspace, leg([*b, 50], [*a, 50]), limits)
    assert kinds(airspace, leg([0, 0, 50], [2000.01, 0, 50]), limits) == {"coverage"}
    assert kinds(airspace, leg([3000, 3000, 50], [4000, 3000, 50]), limits) == {"coverage"}
    assert kinds(airspace, leg([0, 1000, 50], [1000, 1000, 50], track=1.0), limits) == {"coverage"}
    assert kinds(airspace, leg([0.9, 1000, 50], [1000, 1000, 50], track=1.0), limits) == {"coverage"}
    assert not kinds(airspace, leg([1.0, 1000, 50], [1000, 1000, 50], track=1.0), limits)


def test_beyond_the_square_that_the_map_was_fitted_to_nothing_is_known() -> None:
    ground = jacksboro()
    airspace = Airspace(Surface(ground.heights, ground.heights, ground.grid))
    for far in (40_000.0, 400_000.0):
        legs = leg([0, 0, 1500], [far, far, 1500])
        assert kinds(airspace, legs, Limits(10.0)) == {"coverage"}
        zones = Airspace(airspace.surface, [Zone("z", Circle(far, far, 9000.0), None, Level(100.0, "agl"))])
        assert kinds(zones, legs, Limits(10.0)) == {"coverage", "zone"}


# --- zones -----------------------------------------------------------------------------------------------------------


def test_a_tangent_to_a_cylinder_is_legal_and_a_millimetre_nearer_is_not() -> None:
    airspace = flat([Zone("z", Circle(1000, 1000, 300))])
    limits = Limits(0.0, horizontal_clearance_m=30.0)
    report = judged(airspace, leg([100, 1335, 50], [1900, 1335, 50], track=5.0), limits)
    assert not report.violations
    assert (report.zone_clearance_m[0], report.nearest_zone[0]) == (pytest.approx(35.0), 0)
    v = only(airspace, leg([100, 1334.999, 50], [1900, 1334.999, 50], track=5.0), limits)
    assert (v.kind, v.zone, v.limit, v.unit) == ("zone", 0, 35.0, "m")
    assert (v.value, v.by, v.fraction) == pytest.approx((34.999, 0.001, 0.5), abs=1e-6)
    inside = judged(airspace, leg([100, 900, 50], [1900, 900, 50]), limits)
    assert inside.violations[0].value == pytest.approx(-200.0)
    assert inside.zone_clearance_m[0] == 0.0


def test_the_scale_of_the_plane_widens_radius_and_clearance() -> None:
    airspace = flat([Zone("z", Circle(1000, 1000, 300))], scale=1.001)
    limits = Limits(0.0, horizontal_clearance_m=30.0)
    assert not kinds(airspace, leg([100, 1330.331, 50], [1900, 1330.331, 50]), limits)
    assert kinds(airspace, leg([100, 1330.329, 50], [1900, 1330.329, 50]), limits) == {"zone"}


def test_over_the_ceiling_and_under_the_floor_are_legal_up_to_touching() -> None:
    airspace = flat([Zone("z", Circle(1000, 1000, 300), Level(100, "amsl"), Level(200, "amsl"))])
    limits = Limits(0.0, horizontal_clearance_m=30.0)
    for level, legal in ((205.0, True), (204.9, False), (150.0, False), (95.1, False), (95.0, True)):
        legs = leg([100, 1000, level], [1900, 1000, level], altitude=5.0)
        assert kinds(airspace, legs, limits) == (set() if legal else {"zone"}), level
    # The climb is above the ceiling where it comes within reach: at 670 m of 1000 m, 100 m above the start.
    over = leg([0, 1000, 200 - 150 * 0.67 + 0.01], [1000, 1000, 350 - 150 * 0.67 + 0.01])
    assert not kinds(airspace, over, limits)
    assert kinds(airspace, leg([0, 1000, 99.4], [1000, 1000, 249.4]), limits) == {"zone"}
    report = judged(airspace, leg([100, 1000, 250], [1900, 1000, 250]), limits)
    assert (report.zone_clearance_m[0], report.nearest_zone[0]) == (math.inf, -1)


def test_levels_over_ground_follow_it_point_by_point() -> None:
    """The ground rises 0.1 m per metre to the east: 50 m AGL is 120 m AMSL in the zone's west and 180 m in its east."""
    heights = np.tile(np.arange(0, 210, 10.0), (21, 1))
    zone = Zone("z", Circle(1000, 1000, 300), None, Level(50, "agl"))
    airspace, limits = world(heights, [zone]), Limits(0.0)
    # Parallel to the ground, just above the ceiling everywhere, though far below the ceiling's highest point.
    assert not kinds(airspace, leg([500, 1000, 100.01], [1500, 1000, 200.01]), limits)
    assert kinds(airspace, leg([500, 1000, 99.99], [1500, 1000, 199.99]), limits) == {"zone"}
    # With clearance the ground within reach counts, but only inside the shape: at its eastern tip it is 130 m high.
    level = leg([500, 1000, 180.01], [1400, 1000, 180.01])
    assert not kinds(airspace, level, Limits(0.0, horizontal_clearance_m=30.0))
    low = leg([1310, 700, 179.5], [1310, 1300, 179.5])
    assert kinds(airspace, low, Limits(0.0, horizontal_clearance_m=20.0)) == {"zone"}
    assert not kinds(airspace, low, Limits(0.0, horizontal_clearance_m=9.9))
    # The same for floors: below 50 m AGL is free.
    raised = world(heights, [Zone("z", Circle(1000, 1000, 300), Level(50, "agl"), None)])
    assert not kinds(raised, leg([500, 1000, 99.99], [1500, 1000, 199.99]), limits)
    assert kinds(raised, leg([500, 1000, 100.01], [1500, 1000, 200.01]), limits) == {"zone"}


def test_over_unknown_ground_a_zone_above_ground_has_no_end() -> None:
    heights = np.zeros((21, 21))
    heights[10, 10] = np.nan
    mast = Zone("mast", Circle(1000, 1000, 50), None, Level(100, "agl"))
    assert kinds(world(heights, [mast]), leg([100, 1000, 900], [1900, 1000, 900]), Limits(0.0)) == {"coverage", "zone"}
    capped = Zone("mast", Circle(1000, 1000, 50), Level(10, "agl"), Level(800, "amsl"))
    assert kinds(world(heights, [capped]), leg([100, 1000, 900], [1900, 1000, 900]), Limits(0.0)) == {"coverage"}


def test_a_zone_whose_floor_is_above_its_ceiling_is_empty() -> None:
    """A zone from 100 m AGL to 600 m AMSL is empty over ground above 500 m."""
    zone = Zone("z", Circle(1000, 1000, 300), Level(100, "agl"), Level(600, "amsl"))
    assert not kinds(world(np.full((21, 21), 550.0), [zone]), leg([100, 1000, 620], [1900, 1000, 620]), Limits(0.0))
    high = leg([100, 1000, 620], [1900, 1000, 620], altitude=30.0)
    assert not kinds(world(np.full((21, 21), 550.0), [zone]), high, Limits(0.0))
    assert kinds(world(np.full((21, 21), 450.0), [zone]), high, Limits(0.0)) == {"zone"}


NOTCH = Polygon(
    np.array([[500, 500], [1500, 500], [1500, 1500], [1100, 1500], [1100, 900], [900, 900], [900, 1500], [500, 1500]])
    .astype(float)
)  # fmt: skip


def test_a_notch_in_a_polygon_is_free_and_clearance_closes_it() -> None:
    airspace = flat([Zone("u", NOTCH)])
    into = leg([1000, 1900, 50], [1000, 1000, 50])
    assert not kinds(airspace, into, Limits(0.0, horizontal_clearance_m=100.0))
    v = only(airspace, into, Limits(0.0, horizontal_clearance_m=100.001))
    assert (v.value, v.by) == pytest.approx((100.0, 0.001), abs=1e-6)
    through = only(airspace, leg([1000, 1900, 50], [1000, 700, 50]), Limits(0.0))
    assert (through.value, through.fraction) == (pytest.approx(-200.0, abs=0.5), pytest.approx(1.0, abs=1e-3))
    across = judged(airspace, leg([300, 1200, 50], [1700, 1200, 50]), Limits(0.0))
    assert [v.kind for v in across.violations] == ["zone"]
    assert across.violations[0].value == pytest.approx(-200.0, abs=0.5)


@pytest.mark.slow
def test_without_clearance_a_polygon_may_be_touched() -> None:
    airspace, limits = flat([Zone("u", NOTCH)]), Limits(0.0)
    for a, b in (
        ((300, 500), (1700, 500)),  # along an edge and beyond both of its ends
        ((900, 1500), (1100, 1500)),  # across the notch's opening
        ((100, 900), (900, 1700)),  # through the corner (500, 1500)
        ((900, 900), (900, 1500)),  # inside the notch, along its wall
        ((1000, 1900), (1000, 900)),  # down to its bottom
    ):
        legal = a != (100, 900)
        assert kinds(airspace, leg([*a, 50], [*b, 50]), limits) == (set() if legal else {"zone"}), (a, b)
    assert not kinds(airspace, leg([300, 1300, 50], [700, 1700, 50]), limits)
    assert kinds(airspace, leg([300, 500.01, 50], [1700, 500.01, 50]), limits) == {"zone"}
    assert kinds(airspace, leg([600, 600, 50], [600, 600, 50]), limits) == {"zone"}


@pytest.mark.nightly
def test_thousands_of_zones_are_found_through_the_lattice_as_one_by_one() -> None:
    rng = np.random.default_rng(3)
    ground = jacksboro()
    zones = [z for _ in range(500) for z in random_zones(rng, ground, 4)][:1000]
    surface = Surface(ground.heights, ground.heights, ground.grid)
    a = rng.uniform(-12_000.0, 12_000.0, (2000, 2))
    legs = Legs(
        np.column_stack([a, np.full(2000, 1200.0)]),
        np.column_stack([a + rng.normal(0.0, 700.0, (2000, 2)), rng.uniform(1150.0, 1300.0, 2000)]),
        np.zeros(2000, np.bool_),
        np.full(2000, 3.0),
        np.full(2000, 5.0),
    )
    limits = Limits(0.0, horizontal_clearance_m=30.0)
    clear = Airspace(surface, zones).clear(legs, limits)
    single = np.ones(2000, np.bool_)
    for k in range(0, len(zones), 20):  # up to twenty zones are not sorted into a lattice
        single &= Airspace(surface, zones[k : k + 20]).clear(legs, limits)
    assert clear.tolist() == single.tolist()
    assert 0.05 < clear.mean() < 0.95
    judged(Airspace(surface, zones), legs, limits)


# --- the whole check -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_clear_says_what_examine_says_of_ten_thousand_legs_over_mountains() -> None:
    rng = np.random.default_rng(4)
    ground = jacksboro()
    surface = Surface(ground.heights, ground.heights, ground.grid)
    airspace = Airspace(surface, [z for _ in range(10) for z in random_zones(rng, ground)], scale=1.00001)
    a = rng.uniform(-13_000.0, 13_000.0, (10_000, 2))
    b = a + rng.normal(0.0, 700.0, a.shape)
    heights = [surface.top_at(*p.T) + rng.uniform(60.0, 200.0, len(p)) for p in (a, b)]
    errors = rng.uniform(0.0, 20.0, 10_000), rng.uniform(0.0, 10.0, 10_000)
    legs = Legs(np.column_stack([a, heights[0]]), np.column_stack([b, heights[1]]), rng.random(10_000) < 0.1, *errors)
    limits = Limits(60.0, 300.0, 900.0, 40.0, max_climb_deg=15.0, max_descent_deg=15.0)
    report = judged(airspace, legs, limits)
    assert {v.kind for v in report.violations} >= {"min_agl", "max_agl", "max_amsl", "climb", "descent"}
    for kind in ("min_agl", "max_agl", "max_amsl", "terrain_clearance"):
        assert airspace.deepest(legs, limits, kind) == max(v.by for v in report.violations if v.kind == kind)
    keys = [(v.leg, v.kind, v.zone) for v in report.violations]
    assert len(set(keys)) == len(keys)
    assert [v.leg for v in report.violations] == sorted(v.leg for v in report.violations)
    for v in report.violations[::50]:
        assert 0.0 <= v.fraction <= 1.0
        assert v.by == pytest.approx(abs(v.value - v.limit), abs=2e-6)
        at = legs.start[v.leg] + v.fraction * (legs.end[v.leg] - legs.start[v.leg])
        assert (v.east_m, v.north_m, v.amsl_m) == pytest.approx(tuple(at))


@pytest.mark.nightly
def test_several_threads_may_share_an_airspace() -> None:
    rng = np.random.default_rng(5)
    airspace = flat([Zone("u", NOTCH), Zone("z", Circle(1000, 0, 300), None, Level(50.0, "agl"))])
    a = rng.uniform(0.0, 2000.0, (3000, 2))
    points = [np.column_stack([p, np.full(3000, 51.0)]) for p in (a, a + rng.normal(0.0, 200.0, a.shape))]
    legs = Legs(points[0], points[1], np.zeros(3000, np.bool_), np.zeros(3000), np.zeros(3000))
    alone = judged(airspace, legs, Limits(10.0))
    with ThreadPoolExecutor(4) as pool:
        for report in pool.map(lambda _: airspace.examine(legs, Limits(10.0)), range(8)):
            assert report.violations == alone.violations


def test_a_leg_of_fifty_kilometres_is_cut_until_it_is_straight_in_the_grid() -> None:
    """A leg from east to west across the whole sample finds what short legs find kilometre by kilometre."""
    ground = jacksboro()
    surface = Surface(ground.heights, ground.heights, ground.grid)
    airspace = Airspace(surface)
    ends = np.array([[-14_500.0, 5000.0, 700.0], [14_500.0, 5500.0, 900.0]])
    whole = judged(airspace, Legs.of_path(ends, Limits(0.0)), Limits(0.0))
    t = np.linspace(0.0, 1.0, 30)[:, None]
    pieces = judged(airspace, Legs.of_path(ends[0] + t * (ends[1] - ends[0]), Limits(0.0)), Limits(0.0))
    assert whole.min_agl_m[0] == pytest.approx(pieces.min_agl_m.min(), abs=0.05)
    assert whole.max_agl_m[0] == pytest.approx(pieces.max_agl_m.max(), abs=0.05)
    fine = np.linspace(0.0, 1.0, 100_001)[:, None]
    p = ends[0] + fine * (ends[1] - ends[0])
    sampled = p[:, 2] - surface.top_at(p[:, 0], p[:, 1])
    assert whole.min_agl_m[0] == pytest.approx(sampled.min(), abs=0.05)
    assert whole.min_agl_at[0] == pytest.approx(fine[sampled.argmin(), 0], abs=1e-3)


def test_no_legs_are_no_violations() -> None:
    none = Legs(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, bool), np.zeros(0), np.zeros(0))
    assert judged(flat(), none, Limits(60.0)).violations == ()


def test_legs_of_a_path_take_the_errors_of_the_limits() -> None:
    legs = Legs.of_path([[0, 0, 1], [2, 0, 1], [2, 2, 3]], Limits(60.0, track_error_m=3.0, altitude_error_m=5.0))
    assert len(legs) == 2
    assert legs.start.tolist() == [[0, 0, 1], [2, 0, 1]]
    assert legs.end.tolist() == [[2, 0, 1], [2, 2, 3]]
    assert (legs.track_error_m.tolist(), legs.altitude_error_m.tolist(), legs.column.any()) == ([3, 3], [5, 5], False)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start": np.zeros((1, 2))}, "shape"),
        ({"end": np.array([[0.0, math.nan, 0.0]])}, "finite"),
        ({"end": np.array([[0.0, math.inf, 0.0]])}, "finite"),
        ({"track_error_m": np.array([-1.0])}, "0 or more"),
        ({"altitude_error_m": np.zeros(2)}, "shape"),
    ],
)
def test_legs_that_make_no_sense_are_refused(change: dict[str, Floats], message: str) -> None:
    good: dict[str, NDArray[np.generic]] = {
        "start": np.zeros((1, 3)), "end": np.ones((1, 3)), "column": np.zeros(1, np.bool_),
        "track_error_m": np.zeros(1), "altitude_error_m": np.zeros(1),
    }  # fmt: skip
    with pytest.raises(ValueError, match=message):
        Legs(**(good | change))  # type: ignore[arg-type]


def test_pieces_of_ground_are_counted_where_legs_pass_close_over_it() -> None:
    ground = jacksboro()
    airspace = Airspace(Surface(ground.heights, ground.heights, ground.grid), [], scale=1.0)
    limits = Limits(60.0, horizontal_clearance_m=30.0, track_error_m=3.0, altitude_error_m=5.0)
    east = np.linspace(-5_000.0, 5_000.0, 200)
    floor = airspace.floor_amsl(east, np.zeros(200), limits)
    counts = []
    for over_m in (0.01, 300.0):
        points = np.column_stack([east, np.zeros(200), floor + over_m])
        legs = Legs.of_path(points, limits)
        legal, cut = airspace.clear_counted(legs, limits)
        assert np.array_equal(legal, airspace.clear(legs, limits))
        counts.append(cut)
    assert counts[0] > 100.0 > counts[1] == 0.0
    assert airspace.clear_counted(Legs.of_path(points[:2], limits), limits)[1] == 0.0  # of that call alone
