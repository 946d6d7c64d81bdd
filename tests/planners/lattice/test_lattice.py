"""Which segments lie near a zone: against shapely for random segments, most of them far away."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from gcsplan.planners.lattice.lattice import near_zone
from gcsplan.world.geodesy.degree_shapes import counter_clockwise
from gcsplan.world.geometry.zones import Zone


@pytest.mark.draws
def test_segments_near_a_polygon_are_found_wherever_they_lie() -> None:
    rng = np.random.default_rng(5)
    for _ in range(60):
        corners = rng.uniform(-100, 100, (3, 2))
        zone = Zone("zone", counter_clockwise(corners))
        reach = rng.uniform(0, 80)
        a = rng.uniform(-1, 1, (rng.integers(0, 8), 2)) * rng.choice([150, 400, 4000]) + rng.uniform(-300, 300, 2)
        b = a + rng.uniform(-1, 1, a.shape) * rng.choice([0.0, 50.0, 900.0])
        exact = [
            shapely.Polygon(corners).distance(shapely.LineString([p, q]) if (p != q).any() else shapely.Point(p))
            for p, q in zip(a, b, strict=True)
        ]
        found = near_zone(a, b, zone, reach, 1.0)
        assert found.shape == (len(a),)
        assert found.tolist() == [d <= reach for d in exact]
