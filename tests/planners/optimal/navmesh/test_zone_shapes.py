"""Zones as the lattice takes them for bounds: no slit between the parts of one zone, and nothing beyond the zone."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.navmesh.zone_kernels import FIRST, LAST
from gcsplan.planners.optimal.navmesh.zone_shapes import CLOSE, LOOSE, Fit, make_shapes
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Level, Polygon, Zone
from tests.support.planner_worlds import ground

RING = [(300, 300), (900, 250), (950, 800), (500, 900), (520, 880), (930, 790), (885, 265), (310, 318)]
"""The corners of a thin wall around a yard that is open to the west."""


def shut_by(problem: Problem, fit: Fit, places: Floats) -> Bools:
    """(N,) which places (N, 2) lie within a part of a zone, for bounds."""
    x, y = np.meshgrid(np.linspace(0.0, 2000.0, 41), np.linspace(0.0, 2000.0, 41))
    rows, forms = make_shapes(problem, x, y, fit).low
    inside = np.zeros(len(places), np.bool_)
    for first, last in rows[:, [FIRST, LAST]].astype(int).tolist():
        a, b, c, disc = forms[first:last].T
        assert not disc.any()
        inside |= (a - np.outer(places[:, 0], b) - np.outer(places[:, 1], c) > 0.0).all(axis=1)
    return inside


@pytest.mark.slow
@pytest.mark.nightly_but("fit1-0.03-None", "fit0-0.004-None", "fit0-0.0-None")
@pytest.mark.first_quick
@pytest.mark.parametrize("ceiling", [None, Level(80.0, "agl")])
@pytest.mark.parametrize("track_error_m", [0.0, 0.004, 0.03, 1.0])
@pytest.mark.parametrize("fit", [LOOSE, CLOSE])
def test_the_parts_of_a_zone_leave_no_slit_between_them(fit: Fit, track_error_m: float, ceiling: Level | None) -> None:
    zone = Zone("ring", Polygon(np.array(RING, float)), None, ceiling)
    limits = Limits(10.0, track_error_m=track_error_m)
    problem = Problem(Airspace(ground(0.0), (zone,)), limits, (0.0, 0.0, 50.0), (1900.0, 0.0, 50.0))
    wall = shapely.Polygon(RING)
    rng = np.random.default_rng(1)
    box = rng.uniform((280.0, 230.0), (980.0, 920.0), (60_000, 2))
    places = box[shapely.dwithin(wall, shapely.points(box), 2.0)]
    away = np.where(shapely.contains_xy(wall, *places.T), -1.0, 1.0) * shapely.distance(
        wall.exterior, shapely.points(places)
    )
    shut = shut_by(problem, fit, places)
    assert not shut[away > track_error_m - fit.spare_m + 1e-9].any()
    # Corners are cut off by chords; away from them, all of the zone is shut.
    beside = shapely.distance(shapely.MultiPoint(RING), shapely.points(places)) > 8.0
    deep = beside & (away < (track_error_m if ceiling is None else 0.0) - fit.spare_m - 1e-6)
    assert deep.sum() > 100
    assert shut[deep].all()
