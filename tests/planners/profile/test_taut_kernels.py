"""Edges of tubes at doors, and strings through them: against numpy, and machine code against the plain functions."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.planners.profile.taut_kernels import draw, edge


@pytest.mark.parametrize("highest", [True, False])
@pytest.mark.parametrize("seed", range(10))
def test_an_edge_is_linear_in_pieces_and_at_a_jump_the_stricter_limit(seed: int, highest: bool) -> None:
    rng = np.random.default_rng(seed)
    at = np.cumsum(rng.uniform(1.0, 5.0, 6))
    value = rng.uniform(-10.0, 10.0, (5, 2))
    s = np.sort(np.concatenate([at, rng.uniform(at[0], at[-1], 30)]))
    out = np.empty(len(s))
    edge(s, at, value, highest, out)
    for where, found in zip(s.tolist(), out.tolist(), strict=True):
        limits = [float(np.interp(where, at[k : k + 2], value[k])) for k in range(5) if at[k] <= where <= at[k + 1]]
        assert found == pytest.approx(max(limits) if highest else min(limits))


def doors(seed: int) -> tuple[Floats, Floats, Floats]:
    rng = np.random.default_rng(seed)
    s = np.cumsum(rng.uniform(0.5, 3.0, 14))
    low = rng.uniform(-8.0, 4.0, 14)
    return s, low, low + rng.uniform(0.5, 9.0, 14)


@pytest.mark.parametrize("seed", range(12))
def test_no_string_through_the_doors_is_shorter(seed: int) -> None:
    s, low, high = doors(seed)
    z0, z1 = 0.5 * (low[0] + high[0]), 0.5 * (low[-1] + high[-1])
    at, chains = np.zeros((3, 15), np.int64), np.zeros((3, 15))
    count = draw(s, low, high, z0, z1, at, chains)
    z = np.interp(s, s[at[0, :count]], chains[0, :count])
    assert (z[0], z[-1]) == (z0, z1)
    assert (z[1:-1] >= low[1:-1] - 1e-9).all()
    assert (z[1:-1] <= high[1:-1] + 1e-9).all()
    drawn = np.hypot(np.diff(s), np.diff(z)).sum()
    for k in range(1, 13):  # a convex problem: where no single door can be passed better, none of them can
        for other in np.linspace(low[k], high[k], 21).tolist():
            moved = z.copy()
            moved[k] = other
            assert np.hypot(np.diff(s), np.diff(moved)).sum() >= drawn - 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_machine_code_draws_the_string_of_the_plain_function(seed: int) -> None:
    s, low, high = doors(seed)
    found = [(np.zeros((3, 15), np.int64), np.zeros((3, 15))) for _ in range(2)]
    counts = [
        f(s, low, high, float(low[0]), float(high[-1]), *a)
        for f, a in zip((draw, draw.__wrapped__), found, strict=True)
    ]
    assert counts[0] == counts[1]
    for here, there in zip(*found, strict=True):
        np.testing.assert_array_equal(here, there)
