"""The campaign of keep-in areas: a few judgements, and that it finds an outside that is not whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gcsplan.world.airspace import Airspace
from tests.campaigns.keep_in import Count, judge, leaves, scene


def test_no_leg_that_passes_leaves_the_union_of_areas() -> None:
    count = Count()
    for seed in range(400, 410):
        judge(seed, count)
    assert count.judged > 5
    assert (count.unsafe, count.less) == (0, 0)


def test_the_oracle_finds_legs_outside_if_a_part_of_the_outside_is_missing() -> None:
    rng = np.random.default_rng(1)
    one = scene(rng)
    bare = replace(one, air=Airspace(one.air.surface))
    assert bare.passes(300.0, 0.0)
    assert not one.passes(300.0, 0.0)
    assert leaves(bare, 300.0, 0.0, rng) > 0
