"""The ground under a line in one cell: the least distance is that of dense samples."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.world.kernels.sweep_terrain import least_in_cell


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("seed", range(20))
def test_the_least_height_over_a_line_in_a_cell_is_that_of_samples(seed: int, sign: float) -> None:
    rng = np.random.default_rng(seed)
    kd, turn, before, after = rng.normal(0.0, 5.0, 4).tolist()
    first, last = np.sort(rng.uniform(0.0, 1.0, 2)).tolist()
    s = np.linspace(0.0, 1.0, 4001)
    values = before + (after - before) * s + sign * kd * turn * s * (1.0 - s)
    least, at = least_in_cell(sign, kd, turn, before, after, first, last)
    assert least == pytest.approx(values.min(), abs=1e-5)
    assert at == pytest.approx(first + s[values.argmin()] * (last - first), abs=2e-3 * (last - first) + 1e-9)


def test_a_bulge_upwards_leaves_the_lower_end_the_least() -> None:
    assert least_in_cell(1.0, 2.0, 1.0, 5.0, 3.0, 0.25, 0.75) == (3.0, 0.75)
