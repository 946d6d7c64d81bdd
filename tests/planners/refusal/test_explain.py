"""Refusals: the message names the limit, zone or place that prevents a path, and numbers that help."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem, Refusal, Via
from gcsplan.planners.refusal.explain import check_ends
from gcsplan.planners.refusal.suggestions import with_cures
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.planner_worlds import Floats, ground

LOW = Limits(min_agl_m=10.0)


def ridge(east: Floats, north: Floats) -> Floats:
    """Ground with a ridge from border to border, 300 m high, with a pass at 180 m around 1500 m north."""
    crest = 300.0 - 120.0 * np.exp(-(((north - 1500.0) / 150.0) ** 2))
    return crest * np.exp(-(((east - 1000.0) / 150.0) ** 2))


def refused(
    surface: Surface,
    zones: tuple[Zone, ...] = (),
    limits: Limits = LOW,
    start: tuple[float, float, float] = (200.0, 1000.0, 20.0),
    goal: tuple[float, float, float] = (1800.0, 1000.0, 20.0),
    **more: object,
) -> Refusal:
    p = replace(Problem(Airspace(surface, zones), limits, start, goal), **more)  # type: ignore[arg-type]
    with pytest.raises(Refusal) as caught:
        plan(p)
    return with_cures(replace(p, budget_s=30.0), caught.value, plan)  # enough even on a busy machine


@pytest.mark.slow
def test_ceiling_under_the_lowest_pass_names_the_pass_and_the_limit_that_would_do() -> None:
    e = refused(ground(ridge), limits=replace(LOW, max_amsl_m=150.0))
    assert e.reason == "infeasible"
    assert "(150 is given" in e.message
    assert (e.east_m, e.north_m) == (pytest.approx(1000.0, abs=60.0), pytest.approx(1500.0, abs=60.0))
    enough = float(e.message.split("max_amsl_m ")[1].split()[0])
    assert 190.0 <= enough <= 194.0
    p = Problem(Airspace(ground(ridge)), replace(LOW, max_amsl_m=enough), (200, 1000, 20), (1800, 1000, 20))
    assert plan(p).path.points[:, 2].max() <= enough


def test_start_whose_floor_is_over_the_ceiling() -> None:
    e = refused(ground(95.0), limits=replace(LOW, max_amsl_m=100.0), start=(200, 1000, 105), goal=(1800, 1000, 105))
    assert e.reason == "infeasible"
    assert "at the start the lowest legal altitude, 105.0 m AMSL" in e.message
    assert "max_amsl_m 100" in e.message
    assert (e.east_m, e.north_m) == (200.0, 1000.0)


def test_goal_too_low_and_too_high() -> None:
    e = refused(ground(0.0), goal=(1800.0, 1000.0, 5.0))
    assert "goal at 5.0 m AMSL is under the lowest legal altitude there, 10.0 m" in e.message
    e = refused(ground(0.0), limits=replace(LOW, max_agl_m=50.0), goal=(1800.0, 1000.0, 60.0))
    assert "goal at 60.0 m AMSL is over the highest legal altitude there, 50.0 m" in e.message
    assert "max_agl_m 50" in e.message


def test_start_within_a_zones_clearance_names_the_zone() -> None:
    e = refused(
        ground(0.0), (Zone("village", Circle(200.0, 1150.0, 100.0)),), replace(LOW, horizontal_clearance_m=60.0)
    )
    assert e.reason == "infeasible"
    assert "the start lies in no-fly zone 'village' or within 60.0 m" in e.message


@pytest.mark.parametrize("way", ["goal", "via"])
@pytest.mark.parametrize("aside", [1.0, -1.0])
def test_beside_a_zone_above_ground_its_own_ground_decides(aside: float, way: str) -> None:
    """Within 60 m of a zone that lies down a slope (``aside`` 1) a place over the zone's ceiling is legal, though it is
    under the ceiling over the ground below; up the slope (-1) it is the other way round."""
    surface = ground(lambda east, north: 0.5 * (2000.0 - north) * np.ones_like(east))
    zone = Zone("lid", Circle(1500.0, 1000.0 + 130.0 * aside, 100.0), None, Level(60.0, "agl"))
    limits = replace(LOW, horizontal_clearance_m=60.0)
    air = Airspace(surface, (zone,))
    at = (1500.0, 1000.0, 500.0 + 60.0 - 3.0 * aside)
    leg = Legs.between(np.array([at]), np.array([at]), limits)
    assert bool(air.clear(leg, limits)[0]) == (aside > 0.0)
    if way == "goal":
        problem = Problem(air, limits, (200.0, 1000.0, 560.0), at)
    else:
        problem = Problem(air, limits, (200.0, 1000.0, 560.0), (200.0, 1400.0, 560.0), via=(Via(*at),))
    if aside > 0.0:
        check_ends(problem)
        return
    with pytest.raises(Refusal, match="lies in no-fly zone 'lid'"):
        check_ends(problem)


def test_start_inside_a_polygon_names_it() -> None:
    square = Polygon(np.array([[100.0, 900.0], [300.0, 900.0], [300.0, 1100.0], [100.0, 1100.0]]))
    e = refused(ground(0.0), (Zone("town", square),))
    assert "the start lies in no-fly zone 'town'" in e.message


def test_via_inside_a_zone_names_both() -> None:
    e = refused(ground(0.0), (Zone("village", Circle(1000.0, 1150.0, 100.0)),), via=(Via(1000.0, 1100.0),))
    assert "via point 1 lies in no-fly zone 'village'" in e.message


def test_goal_fenced_in_names_the_zones() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    fence = tuple(
        Zone(f"post {k}", Circle(1600.0 + 250.0 * np.cos(a), 1000.0 + 250.0 * np.sin(a), 110.0))
        for k, a in enumerate(turn)
    )
    e = refused(ground(0.0), fence, goal=(1600.0, 1000.0, 20.0))
    assert "without no-fly zone 'post 4' there is a path" in e.message
    assert e.east_m is not None


@pytest.mark.nightly
def test_one_zone_across_the_map_is_named_alone() -> None:
    bar = Zone("border", Circle(1000.0, 1000.0, 1200.0), Level(0.0, "amsl"), Level(4000.0, "amsl"))
    dot = Zone("dot", Circle(300.0, 300.0, 50.0))
    e = refused(
        ground(0.0), (dot, bar), replace(LOW, max_amsl_m=500.0), start=(50.0, 50.0, 20.0), goal=(1950.0, 1950.0, 20.0)
    )
    assert "'border'" in e.message
    assert "'dot'" not in e.message


@pytest.mark.nightly
def test_climb_limit_too_tight_says_what_would_do() -> None:
    def cliff(east: Floats, north: Floats) -> Floats:
        return np.where(east < 1000.0, 300.0, 0.0)

    e = refused(
        ground(cliff),
        limits=Limits(10.0, max_agl_m=100.0, max_climb_deg=20.0, max_descent_deg=20.0),
        start=(1500.0, 1000.0, 20.0),
        goal=(200.0, 1000.0, 310.0),
    )
    assert "would do (20 is given" in e.message
    enough = float(e.message.split("max_climb_deg ")[1].split()[0])
    assert 45.0 < enough < 89.0


def test_unknown_ground_between_start_and_goal_is_not_flown_over() -> None:
    z = ground(0.0).ground_m.copy()
    z[:, 45:55] = np.nan
    e = refused(Surface(z, z, GridMap.affine(0.0, 2000.0, 20.0, 20.0)))
    assert e.reason == "infeasible"


def test_start_over_unknown_ground() -> None:
    z = ground(0.0).ground_m.copy()
    z[:, :20] = np.nan
    e = refused(Surface(z, z, GridMap.affine(0.0, 2000.0, 20.0, 20.0)))
    assert "start" in e.message
    assert "unknown" in e.message


def test_via_straight_over_the_start_is_refused_and_not_forgotten() -> None:
    e = refused(ground(0.0), via=(Via(200.0, 1000.0, 60.0),))
    assert "the start and via point 1 are one place, 40.0 m apart in height" in e.message


def test_same_place_is_no_mission() -> None:
    e = refused(ground(0.0), goal=(200.0, 1000.0, 20.0))
    assert "same place" in e.message
    assert "same place" in refused(ground(0.0), goal=(200.0, 1000.0, 20.0), via=(Via(200.0, 1000.0),)).message
