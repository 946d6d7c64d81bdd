"""Arrays for `judge` to work in."""

from __future__ import annotations

import threading

import numpy as np

from gcsplan.native.signature import Held
from gcsplan.world.kernels.compiled import WORK
from gcsplan.world.kernels.shared import CUT


class WorkArrays(threading.local):
    """One set of arrays for each thread, reset before each call.

    Pieces of legs that are still to be looked at (256, 8); numbers of the leg at hand (`_sweep_terrain`), and the count
    `cut`; splits of a leg by a polygon, two for each corner; for each zone the leg that it was listed for, -1 before;
    and a list of zones (0, 1, …).
    """

    def __init__(self) -> None:
        self._size = (-1, -1)
        self._out = np.zeros(CUT + 1)

    def __call__(self, most_corners: int, zones: int) -> Held:
        """The arrays for polygons of at most ``most_corners`` corners, and ``zones`` zones."""
        if self._size != (most_corners, zones):
            self._seen = np.empty(zones, np.int64)
            self._list = np.arange(zones)
            self._ready = Held(
                WORK, np.empty((256, 8)), self._out, np.empty(2 * most_corners), self._seen, np.arange(zones)
            )
            self._size = most_corners, zones
        self._out.fill(0.0)
        self._seen.fill(-1)
        self._ready.arguments[-1][:] = self._list
        return self._ready

    @property
    def cut(self) -> float:
        """How many pieces of ground the last call of `judge` cut, see `_sweep_beside.deepest`."""
        return float(self._out[CUT])


work_arrays = WorkArrays()
