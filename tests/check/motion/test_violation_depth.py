"""The depth that a finding tells was tried: it suffices, and hardly any less does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.check.motion.violation_depth import CENTIMETRE, FINE_PART, enough
from gcsplan.world.airspace import Legs, Violation
from tests.support.worlds import vehicle, world

OFF = {"min_agl": 1.0, "terrain_clearance": 1.0, "max_agl": -1.0}
MOST_OVER = 2.0 * FINE_PART


@pytest.mark.parametrize("kind", sorted(OFF))
@pytest.mark.parametrize("seed", range(12))
def test_the_depth_suffices_and_hardly_less_does(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    (a, b), (c, d) = rng.uniform(2e-4, 4e-3, (2, 2))
    where = world(lambda e, n: 300.0 + 60.0 * np.sin(a * e + b * n) + 25.0 * np.cos(c * e + d * n))
    limits = vehicle(
        min_agl_m=60.0 if kind == "min_agl" else 0.0,
        max_agl_m=90.0 if kind == "max_agl" else None,
        horizontal_clearance_m=40.0 if kind == "terrain_clearance" else 0.0,
    ).limits
    height_m = {"min_agl": 380.0, "terrain_clearance": 330.0, "max_agl": 420.0}[kind] + rng.uniform(-25.0, 25.0)
    ends = np.column_stack([rng.uniform(-4000.0, 4000.0, (5, 2)), np.full(5, height_m)])
    legs = Legs.of_path(ends, limits)

    def broken(by: float) -> list[Violation]:
        lift = np.array([0.0, 0.0, OFF[kind] * by])
        moved = replace(legs, start=legs.start + lift, end=legs.end + lift)
        return [v for v in where.airspace.examine(moved, limits).violations if v.kind == kind]

    found = broken(0.0)
    assert found, "the legs are too high to break anything"
    worst = max(found, key=lambda v: v.by)
    depth = enough(worst, np.array(sorted({v.leg for v in found})), legs, limits, where.airspace).by
    assert depth == round(depth, 2)
    assert not broken(depth)
    assert broken((1.0 - MOST_OVER) * depth - 2.0 * CENTIMETRE)
