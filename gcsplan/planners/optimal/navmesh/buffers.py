"""Buffers that are reused from one mesh to the next."""

from __future__ import annotations

import math
import mmap
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

LARGE = 1 << 22
"""Size of an array, in bytes, from which numpy requests huge pages."""


class Scratch:
    """Named arrays that are kept and handed out again, with what their last user left in them.

    New memory is cleared by the operating system when it is first touched, which takes longer than the work done in it.
    Of a large array only a corridor is touched, a few numbers of each row; with huge pages, all of it would be cleared.
    """

    def __init__(self) -> None:
        self._held: dict[str, NDArray[Any]] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> NDArray[Any]:
        """An array of that shape with arbitrary content, free to use until the same name is requested again."""
        size = math.prod(shape)
        held = self._held.get(name)
        if held is None or held.size < size:
            self._held.pop(name, None)
            held = self._held[name] = _small_pages(size, np.dtype(dtype))
        return held[:size].reshape(shape)


def _small_pages(size: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    if size * dtype.itemsize < LARGE:
        return np.empty(size, dtype)
    return np.frombuffer(mmap.mmap(-1, size * dtype.itemsize), dtype)
