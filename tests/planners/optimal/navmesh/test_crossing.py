"""The least length over a zone, compared with brute force over places on its outline and another visibility graph."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from scipy.sparse.csgraph import dijkstra

from gcsplan.arrays import Floats
from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal.navmesh.crossing import Climb, Crossing, crossing

A, B = (-400.0, 0.0), (400.0, 0.0)
FAR_M = 1e5


def over(zone: shapely.Polygon, *others: shapely.Polygon, up: Climb, down: Climb, limit_m: float = 5e3) -> Crossing:
    return crossing(A, B, zone, others, up, down, limit_m, Budget.endless())


def brute_force(zone: shapely.Polygon, *others: shapely.Polygon, up: Climb, down: Climb, step_m: float) -> float:
    """The least sum over all pairs of places on the outline, ``step_m`` apart, and its corners."""
    ring = shapely.segmentize(zone.exterior, step_m)
    places = shapely.get_coordinates(ring)[:-1]
    corners = [shapely.get_coordinates(o)[:-1] for o in others]
    nodes = np.concatenate([[A, B], places, *corners])
    solid = shapely.union_all([zone, *others]).buffer(-1e-3, join_style="mitre")
    i, j = np.triu_indices(len(nodes), 1)
    free = ~shapely.intersects(solid, shapely.linestrings(nodes[np.stack([i, j], axis=1)]))
    metres = np.zeros((len(nodes),) * 2)
    metres[i[free], j[free]] = np.hypot(*(nodes[i] - nodes[j])[free].T)
    away = dijkstra(metres, directed=False, indices=[0, 1])[:, 2 : 2 + len(places)]

    def flown(track_m: Floats, climb: Climb) -> Floats:
        return np.maximum(np.hypot(track_m + climb.more_m, climb.rise_m), climb.slant_m)

    across = np.hypot(*np.moveaxis(places[:, None] - places, 2, 0))
    return float((flown(away[0], up)[:, None] + across + flown(away[1], down)).min())


def climb(rise_m: float, slope: float = math.inf, more_m: float = 0.0) -> Climb:
    return Climb(rise_m, rise_m * math.hypot(1.0, 1.0 / slope), more_m)


def star(rng: np.random.Generator, east_m: float, north_m: float, size_m: float) -> shapely.Polygon:
    """A polygon, rarely convex."""
    angle = np.sort(rng.uniform(0.0, 2.0 * math.pi, int(rng.integers(4, 9))))
    reach = size_m * rng.uniform(0.4, 1.0, len(angle))
    return shapely.Polygon(np.stack([east_m + reach * np.cos(angle), north_m + reach * np.sin(angle)], axis=-1))


def test_straight_over_a_square_is_up_across_and_down() -> None:
    found = over(shapely.box(-100.0, -80.0, 100.0, 90.0), up=climb(60.0), down=climb(0.0))
    assert found.length_m == pytest.approx(math.hypot(300.0, 60.0) + 200.0 + 300.0, abs=0.06)
    assert found.before[-1] == pytest.approx([-100.0, 0.0], abs=0.5)


def test_a_corner_is_cut_where_that_shortens_the_flight_at_the_top() -> None:
    # Over the middle the flight at the top is 200 m long, over the corner next to nothing.
    found = over(shapely.Polygon([(-100, -200), (0, 10), (100, -200)]), up=climb(120.0), down=climb(120.0))
    assert found.length_m == pytest.approx(2.0 * math.hypot(400.0, 120.0), rel=1e-3)


def test_a_climb_that_takes_longer_than_the_way_to_the_zone_ends_beyond_it() -> None:
    gentle = climb(60.0, slope=0.1)
    found = over(shapely.box(-100.0, -80.0, 100.0, 90.0), up=gentle, down=climb(0.0))
    assert found.length_m == pytest.approx(gentle.slant_m + 300.0, abs=0.06)  # around the zone, then in from behind
    before = over(shapely.box(-100.0, -80.0, 100.0, 90.0), up=climb(60.0, 0.1, more_m=400.0), down=climb(0.0))
    assert before.length_m == pytest.approx(math.hypot(700.0, 60.0) + 500.0, abs=0.06)


def test_tracks_that_are_too_short_for_their_climb_can_be_made_dearer() -> None:
    gentle = Climb(60.0, 60.0 * math.hypot(1.0, 6.0), dearer=10.0)  # 360 m of track; the zone's middle is 300 m away
    found = over(shapely.box(-100.0, -250.0, 100.0, 250.0), up=gentle, down=climb(0.0))
    assert np.hypot(*np.diff(found.before, axis=0).T).sum() >= 360.0 - 0.05
    assert (
        found.length_m > over(shapely.box(-100.0, -250.0, 100.0, 250.0), up=climb(60.0, 1 / 6), down=climb(0)).length_m
    )


def test_no_place_of_the_outline_in_reach_is_the_limit() -> None:
    found = over(shapely.box(-100.0, 900.0, 100.0, 1000.0), up=climb(60.0), down=climb(60.0), limit_m=900.0)
    assert found.length_m == 900.0
    assert not len(found.before)


@pytest.mark.slow
@pytest.mark.nightly_but("seeds0")
@pytest.mark.parametrize("seeds", [range(12), range(12, 120)])
def test_the_bound_is_that_of_brute_force(seeds: range) -> None:
    for seed in seeds:
        rng = np.random.default_rng(seed)
        zone = star(rng, *rng.uniform(-120.0, 120.0, 2), rng.uniform(60.0, 200.0))
        others = [
            star(rng, *rng.uniform(-300.0, 300.0, 2), rng.uniform(20.0, 120.0)) for _ in range(rng.integers(0, 4))
        ]
        others = [o for o in others if o.is_valid]
        ends = shapely.points([A, B])
        if not zone.is_valid or any(shapely.distance(s, ends).min() < 1.0 for s in (zone, *others)):
            continue
        slope = float(rng.choice([0.2, math.inf]))
        up, down = (climb(float(rng.uniform(0.0, 150.0)), slope, float(rng.choice([0.0, 200.0]))) for _ in range(2))
        found = over(zone, *others, up=up, down=down)
        best = brute_force(zone, *others, up=up, down=down, step_m=4.0)
        assert found.length_m <= min(best, 5e3) * (1.0 + 1e-9), seed
        assert found.length_m >= min(best, 5e3) * (1.0 - 2e-3) - 0.5, seed
