"""Tubes cut and joined: floor, ceiling and bands at dense places are those of the whole tube."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.world.tube import Band, Tube, cut, join


def tube_of(rng: np.random.Generator, length_m: float = 100.0) -> Tube:
    """A tube with jumps between its pieces, part of it unlimited, and a band of two pieces."""
    s = np.concatenate([[0.0], np.sort(rng.uniform(1.0, length_m - 1.0, 9)), [length_m]])
    floor = rng.uniform(0.0, 50.0, (10, 2))
    ceiling = floor + rng.uniform(20.0, 50.0, (10, 2))
    ceiling[4] = np.inf
    at = np.array([30.0, 45.0, 60.0])
    band = Band(3, 30.0, 60.0, at, rng.uniform(50.0, 60.0, (2, 2)), rng.uniform(70.0, 80.0, (2, 2)))
    return Tube(s, floor, ceiling, (band,))


def value_at(s: Floats, values: Floats, at: Floats) -> Floats:
    """Values (K, 2) of pieces between ``s`` (K + 1,) at places strictly inside of pieces."""
    k = np.searchsorted(s, at, side="right") - 1
    u = (at - s[k]) / (s[k + 1] - s[k])
    with np.errstate(invalid="ignore"):
        found = values[k, 0] + u * (values[k, 1] - values[k, 0])
    return np.asarray(np.where(np.isfinite(values[k]).all(axis=1), found, values[k, 0]))


@pytest.mark.parametrize("seed", range(5))
def test_a_cut_tube_is_the_whole_one_there(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tube = tube_of(rng)
    low, high = np.sort(rng.uniform(0.0, 100.0, 2)).tolist()
    part = cut(tube, low, high)
    assert part is not None
    assert (part.s_m[0], part.s_m[-1]) == (0.0, pytest.approx(high - low))
    at = rng.uniform(low, high, 300)
    for whole, piece in ((tube.floor_m, part.floor_m), (tube.ceiling_m, part.ceiling_m)):
        np.testing.assert_allclose(value_at(part.s_m, piece, at - low), value_at(tube.s_m, whole, at), atol=1e-9)
    (band,) = tube.bands
    inside = at[(at > 30.0) & (at < 60.0)]
    assert len(part.bands) == (low < 60.0 and high > 30.0)
    for cut_band in part.bands:
        assert (cut_band.s0_m, cut_band.s1_m) == pytest.approx((max(low, 30.0) - low, min(high, 60.0) - low))
        for whole, piece in ((band.bottom_m, cut_band.bottom_m), (band.top_m, cut_band.top_m)):
            found = value_at(cut_band.s_m, piece, inside - low)
            np.testing.assert_allclose(found, value_at(band.s_m, whole, inside), atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_what_is_cut_and_joined_is_the_tube_with_one_band_for_each_zone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tube = tube_of(rng)
    ends = [0.0, *np.sort(rng.uniform(5.0, 95.0, 3)), 100.0]
    parts = [cut(tube, a, b) for a, b in pairwise(ends)]
    again = join([part for part in parts if part is not None])
    at = rng.uniform(0.0, 100.0, 500)
    for whole, piece in ((tube.floor_m, again.floor_m), (tube.ceiling_m, again.ceiling_m)):
        np.testing.assert_allclose(value_at(again.s_m, piece, at), value_at(tube.s_m, whole, at), atol=1e-9)
    (band,) = again.bands
    assert (band.zone, band.s0_m, band.s1_m) == (3, pytest.approx(30.0), pytest.approx(60.0))


def test_bands_of_two_zones_stay_two_and_a_single_tube_stays_itself() -> None:
    tube = tube_of(np.random.default_rng(1))
    (band,) = tube.bands
    beside = Band(4, 0.0, 30.0, band.s_m - 30.0, band.bottom_m, band.top_m)
    other = Tube(tube.s_m, tube.floor_m, tube.ceiling_m, (beside,))
    assert [b.zone for b in join([tube, other]).bands] == [3, 4]
    assert join([tube]) is tube


def test_a_part_without_length_is_none() -> None:
    assert cut(tube_of(np.random.default_rng(1)), 40.0, 40.0) is None
