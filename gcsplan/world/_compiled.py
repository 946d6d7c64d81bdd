"""The compiled kernels of the exact check, in the form in which Python calls them."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.native.form import Held
from gcsplan.native.kernels import Kernels

_EXTREMA = "f4[,] f4[,] f4[,] i8 i8"
_ZONES = "f8[,] f8[,] f8[] i8[] i8[] i8"
_ROOM = "f8[,] f8[] f8[] i8[] i8[]"

KERNELS = Kernels(
    "world",
    Path(__file__).parent,
    (
        "_shared.py",
        "_sweep.py",
        "_sweep_terrain.py",
        "_sweep_beside.py",
        "_sweep_zones.py",
        "_judge.py",
        "_envelope.py",
        "_extrema.py",
        "_entries.py",
        "surface.py",
    ),
    "gcsplan.world._entries",
    {
        "judge": (
            f"f8[] f8[,] f8[,] {_EXTREMA} {_EXTREMA} {_EXTREMA} {_ZONES} f8[,] f8[,] b1[] f8[] f8[] "
            f"f8 f8 f8 f8 f8 f8 f8 b1 b1[] f8[,] f8[,,] i8[] i8[,] f8[,] {_ROOM}"
        ),
        "pieces": f"f8[] f8[,] f8[,] {_EXTREMA} {_EXTREMA} {_EXTREMA} f8[,] f8 f8 f8 f8[,]",
        "around": f"f8[] f8[,] {_EXTREMA} f8 f8[,] f8 f8[]",
        "local_extrema": "f8[,] f8 f8 i8 i8 i8[] f4[,,] f4[,] f4[,] f4[,]",
    },
)


SURFACE, ONE_SURFACE, EXTREMA, ZONES = "f8[] f8[,] f8[,]", "f8[] f8[,]", _EXTREMA, _ZONES
"""Forms of arguments that stay the same over many calls: the map with one or both surfaces, extrema, zones."""

FOUND = "f8[,] f8[,,] i8[] i8[,] f8[,]"
"""Forms of the arrays into which `judge` writes its results."""


class Room(threading.local):
    """Work arrays for `judge`, one set for each thread, reset before each call."""

    def __init__(self) -> None:
        self._size = (-1, -1)
        self._out = np.zeros(12)

    def __call__(self, most_corners: int, zones: int) -> Held:
        """The work arrays for polygons of at most ``most_corners`` corners, and ``zones`` zones."""
        if self._size != (most_corners, zones):
            self._seen = np.empty(zones, np.int64)
            self._list = np.arange(zones)
            self._ready = Held(
                _ROOM, np.empty((256, 8)), self._out, np.empty(2 * most_corners), self._seen, np.arange(zones)
            )
            self._size = most_corners, zones
        self._out.fill(0.0)
        self._seen.fill(-1)
        self._ready.arguments[-1][:] = self._list
        return self._ready

    @property
    def cut(self) -> float:
        """How many pieces of ground the last call of `judge` cut, see `_sweep_beside.deepest`."""
        return float(self._out[-1])  # `_sweep_terrain.CUT`, whose module needs the compiler


room = Room()


def judge(*arguments: Any) -> int:
    """See `gcsplan.world._entries.judge`."""
    return KERNELS["judge"](*arguments)


def pieces(*arguments: Any) -> int:
    """See `gcsplan.world._entries.pieces`."""
    return KERNELS["pieces"](*arguments)


def around(*arguments: Any) -> int:
    """See `gcsplan.world._entries.around`."""
    return KERNELS["around"](*arguments)


def local_extrema(*arguments: Any) -> int:
    """See `gcsplan.world._extrema.local_extrema`."""
    return KERNELS["local_extrema"](*arguments)
