"""A binary heap in two arrays for compiled searches: equal keys leave in the order of their numbers."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@njit(cache=True)
def push(heap: Floats, ids: Ints, size: int, key: float, item: int) -> int:
    """Put ``item`` in with ``key``; the new size. The arrays have room."""
    k = size
    while k > 0:
        up = (k - 1) >> 1
        if heap[up] < key or (heap[up] == key and ids[up] <= item):
            break
        heap[k], ids[k] = heap[up], ids[up]
        k = up
    heap[k], ids[k] = key, item
    return size + 1


@njit(cache=True)
def pop(heap: Floats, ids: Ints, size: int) -> int:
    """Take the root, which the caller has read, away; the new size."""
    size -= 1
    key, item = heap[size], ids[size]
    k = 0
    while True:
        c = 2 * k + 1
        if c >= size:
            break
        if c + 1 < size and (heap[c + 1] < heap[c] or (heap[c + 1] == heap[c] and ids[c + 1] < ids[c])):
            c += 1
        if heap[c] > key or (heap[c] == key and ids[c] >= item):
            break
        heap[k], ids[k] = heap[c], ids[c]
        k = c
    heap[k], ids[k] = key, item
    return size
