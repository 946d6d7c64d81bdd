"""The zones that a leg may meet: each whose box overlaps that of the leg, once, with the lattice and without."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Zone
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.judging import FEW_ZONES, candidates
from gcsplan.world.zone_table import ZoneTable

GRID = GridMap.affine(0.0, 1000.0, 100.0, 100.0)
LEVEL = np.zeros((11, 11))


@pytest.mark.parametrize("count", [0, FEW_ZONES, FEW_ZONES + 1, 200])
def test_the_zones_that_a_leg_may_meet_are_those_whose_boxes_overlap_its_own(count: int) -> None:
    rng = np.random.default_rng(count)
    numbers = np.column_stack([rng.uniform(0.0, 1000.0, (count, 2)), rng.uniform(1.0, 90.0, count)]).tolist()
    zones = [Zone(f"z{k}", Circle(*n)) for k, n in enumerate(numbers)]
    arrays = ZoneTable.of(zones, Surface(LEVEL, LEVEL, GRID), Field.of(GRID), 1.0).arrays
    seen, list_of = np.full(count, -1), np.full(count, -1)
    for stamp in range(40):
        (west, east), (south, north) = np.sort(rng.uniform(-100.0, 1100.0, (2, 2))).tolist()
        found = candidates(
            arrays.table, arrays.lattice, arrays.bucket, arrays.near, west, south, east, north, seen, stamp, list_of
        )
        expected = [
            k
            for k, (e, n, r) in enumerate(numbers)
            if e - r < east and e + r > west and n - r < north and n + r > south
        ]
        assert sorted(list_of[:found].tolist()) == expected
