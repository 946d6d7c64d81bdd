"""The lattice of a search: its edges carry the altitudes that zones forbid there, and no others."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.planners.lattice.lattice import STEPS, make_lattice
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.planner_worlds import ground


def test_edges_within_reach_of_a_zone_have_its_levels_and_no_others() -> None:
    zones = [
        Zone("over ground", Circle(300.0, 300.0, 40.0), Level(60.0, "agl"), Level(90.0, "agl")),
        Zone("fixed", Circle(300.0, 300.0, 40.0), None, Level(120.0, "amsl")),
        Zone("far away", Circle(5e4, 5e4, 40.0)),
    ]
    limits = Limits(min_agl_m=20.0, horizontal_clearance_m=15.0, altitude_error_m=5.0)
    air = Airspace(ground(0.0), zones)
    problem = Problem(air, limits, (100.0, 300.0, 500.0), (500.0, 300.0, 500.0))
    lattice = make_lattice(problem, (100.0, 100.0, 500.0, 500.0), 50.0, math.inf)
    edge = np.arange(lattice.nx * lattice.ny * 8)
    a = lattice.node_places(edge // 8)
    b = a + 50.0 * STEPS[edge % 8]
    inside = ((b >= 99.0) & (b <= 501.0)).all(axis=1)
    t = np.linspace(0.0, 1.0, 2001)[:, None, None]
    near = inside & (np.hypot(*(a + t * (b - a) - 300.0).transpose(2, 0, 1)).min(axis=0) < 55.0)
    assert near.any()
    assert np.diff(lattice.band_at).tolist() == (2 * near).tolist()
    found = np.column_stack([lattice.band_low, lattice.band_high, lattice.band_agl])
    assert {tuple(row) for row in found.tolist()} == {(55.0, 95.0, 1.0, 1.0), (-math.inf, 125.0, 0.0, 0.0)}
