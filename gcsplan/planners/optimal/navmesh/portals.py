"""The portals between convex pieces of the plane, and shortest tracks through them: `polyanya` and its memory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats, Int32s, Int64s
from gcsplan.planners.optimal.navmesh.polyanya import search
from gcsplan.world.geometry.path import runs_m

GroundPlace = tuple[float, float]

FIRST_NODES, NODES_OF_PIECE = 1 << 19, 8
"""Search nodes that memory is first allocated for: `FIRST_NODES`, or `NODES_OF_PIECE` for each piece if that is more.
Untouched memory costs nothing; if there is too little, the search begins again with four times as much."""


class Exhausted(Exception):
    """A search was given up: all tracks shorter than ``seen_m`` were looked at, and none of them leads to the goal."""

    def __init__(self, seen_m: float) -> None:
        super().__init__(f"no track of less than {seen_m:.1f} m, and too much to look at beyond")
        self.seen_m = seen_m


@dataclass(eq=False, slots=True)
class GroundTrack:
    """A track: its ``points`` (N, 2) and its length."""

    points: Floats
    length_m: float


@dataclass(eq=False, slots=True)
class Portals:
    """Portals as `polyanya.search` takes them: ``order[start[p] : start[p + 1]]`` lists the portals of piece p.

    ``ends`` (portals, 4) is x, y of both ends, ``names`` (portals, 2) the names of both, all less than ``named``, and
    ``joins`` (portals, 2) the pieces at the left and at the right. ``fan``: most pieces that meet at one place.
    """

    start: Int32s
    ends: Floats
    names: Int64s
    joins: Int32s
    order: Int32s
    named: int
    fan: int

    @property
    def pieces(self) -> int:
        """How many pieces there are."""
        return len(self.start) - 1

    def shortest(
        self,
        start: GroundPlace,
        goal: GroundPlace,
        start_pieces: Sequence[int],
        goal_pieces: Sequence[int],
        most: int,
        *,
        limit_m: float = math.inf,
        slack: float = -1.0,
        remaining: Floats | None = None,
        met: Floats | None = None,
    ) -> tuple[GroundTrack | None, float]:
        """The shortest track, None if none is shorter than ``limit_m``, and the number of search nodes opened.

        ``slack``, ``remaining``, ``met``: see `polyanya.search`. Raises Exhausted if that needs more than ``most``.
        """
        if not len(start_pieces) or not len(goal_pieces):
            return None, 0.0
        portals, capacity = len(self.joins), max(FIRST_NODES, NODES_OF_PIECE * self.pieces)
        sources = np.array([(*start, 0.0)] * len(start_pieces))
        remaining, met = (np.zeros(0) if a is None else a for a in (remaining, met))
        while True:
            best, origin = np.zeros(self.named), np.zeros(self.named, np.int64)
            node, link, name = (
                np.empty((capacity, 8)),
                np.empty((capacity, 6), np.int32),
                np.empty((capacity, 3), np.int64),
            )
            first, widest, span = np.zeros(2 * portals, np.int32), np.zeros(portals, np.int32), np.empty((portals, 2))
            out = np.empty((capacity + 2, 3))  # a track has no more corners than nodes, beside its two ends
            n = search(
                self.start, self.ends, self.names, self.joins, self.order, self.fan, best, origin, first, widest, span,
                sources, np.array(start_pieces, np.int32), np.array(goal, np.float64),
                np.array(goal_pieces, np.int32), limit_m, slack, most, remaining, met, node, link, name,
                np.empty(capacity), np.empty(capacity, np.int32), out,
            )  # fmt: skip
            if n != -1:
                break
            capacity *= 4
            met[:] = np.inf
        opened = float(out[2, 2])
        if n == -2:
            raise Exhausted(float(out[0, 0]))
        if n <= 0:
            return None, opened
        points = out[:n][::-1, :2].copy()
        keep = np.concatenate([[True], runs_m(points) > 1e-6])
        keep[-1] = True
        return GroundTrack(points[keep], float(out[1, 2])), opened
