"""Room for arrays that are needed anew for one mesh after the other."""

from __future__ import annotations

import math
import mmap
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

LARGE = 1 << 22
"""Bytes from which on numpy asks for huge pages."""


class Scratch:
    """Arrays by name, each as it was left by whoever had it last: memory is cleared by the system when it is first
    touched, which takes longer than what is done with it.

    Of large arrays only a corridor is touched, a few numbers of each row. With huge pages that would be all of them.
    """

    def __init__(self) -> None:
        self._held: dict[str, NDArray[Any]] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> NDArray[Any]:
        """Room of that shape with anything in it, until that name is asked for again."""
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
