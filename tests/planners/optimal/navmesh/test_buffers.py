"""Arrays that are handed out again: large enough, of the asked shape, and one memory under one name."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.planners.optimal.navmesh.grid import HUGE_PAGE_BYTES, Scratch


@pytest.mark.parametrize("dtype", [np.float64, np.int32, np.bool_])
def test_an_array_has_its_shape_and_type_and_can_be_written(dtype: type) -> None:
    array = Scratch().array("a", (7, 3), dtype)
    array[:] = np.arange(21).reshape(7, 3) % 2
    assert (array.shape, array.dtype) == ((7, 3), dtype)
    assert array.sum() == 10


def test_the_same_name_is_the_same_memory_until_more_is_asked_for() -> None:
    scratch = Scratch()
    first = scratch.array("a", (10,))
    first[:] = 5.0
    assert np.shares_memory(first, scratch.array("a", (2, 4)))
    assert not np.shares_memory(first, scratch.array("b", (10,)))
    larger = scratch.array("a", (11,))
    assert not np.shares_memory(first, larger)
    assert np.shares_memory(larger, scratch.array("a", (10,)))


def test_a_large_one_can_be_written_to_its_ends() -> None:
    array = Scratch().array("a", (HUGE_PAGE_BYTES // 8 + 1,))
    array[0], array[-1] = 1.0, 2.0
    assert (array[0], array[-1], array.nbytes) == (1.0, 2.0, HUGE_PAGE_BYTES + 8)
