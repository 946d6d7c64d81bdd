"""Ways to where a return joins the mission: which joins may be chosen, and legs that cover all ways to one of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.motion.stopping import levels_off_m
from gcsplan.check.returns.return_targets import Join
from gcsplan.check.returns.trace import MissionTrace, TraceParts
from gcsplan.vehicle import Vehicle
from gcsplan.world.airspace import Legs

PLACES_M = 4.0
"""Places that stand for all around them are this far apart, m."""

AWAY_PART = 0.002
"""By how much distances to far legs may be off, as a part of them: ArduPilot's plane is not ours."""


@dataclass(frozen=True, eq=False)
class Ways:
    """All ways from N parts to a join. Each begins in a strip along a line to the join.

    ``start`` (N, 2): its far end; ``unit`` (N, 2): the direction from there to the join; ``away_m`` (N,): the distance;
    ``reach_m`` (N,): the strip's length; ``wide_m`` (N,): its half width, with all errors in the plane; ``low``,
    ``high`` (N,): altitudes AMSL at which the ways begin; ``error_m`` (N,): the error in height. ``flown`` (N,): False
    where there is only a descent. ``column`` (N,): they climb or descend where the vehicle takes off or lands.
    """

    join: Join
    start: Floats
    unit: Floats
    away_m: Floats
    reach_m: Floats
    wide_m: Floats
    low: Floats
    high: Floats
    error_m: Floats
    flown: Bools
    column: Bools

    @property
    def rise_m(self) -> Floats:
        """(N,) by how much they rise or fall at most."""
        return np.asarray(np.maximum(np.abs(self.low - self.join.at[2]), np.abs(self.high - self.join.at[2])))

    def legs(self, some: Indices, piece: int = 0, pieces: int = 1, *, level: bool = False) -> Legs:
        """One leg for each of ``some``, that covers its ways from one of ``pieces`` of its strip.

        A way rises evenly. So where it begins nearer to the join by a part of the distance, it is off the leg by no
        more than that part of its rise. ``level``: instead it may be anywhere between its ends' altitudes.
        """
        away, step = self.away_m[some], self.reach_m[some] / pieces
        skipped = np.minimum(piece * step, away)
        start = self.start[some] + skipped[:, None] * self.unit[some]
        end = np.tile(self.join.at[:2], (len(some), 1))
        low, high = self.low[some], self.high[some]
        begins = finishes = 0.5 * (low + high)
        band = 0.5 * (high - low)
        if level and not self.join.lands:
            low, high = np.minimum(low, self.join.at[2]), np.maximum(high, self.join.at[2])
            begins = finishes = 0.5 * (low + high)
            band = 0.5 * (high - low)
        elif not self.join.lands:
            left = away - skipped
            share = np.divide(step, left, out=np.ones(len(some)), where=left > step)
            finishes, band = np.full(len(some), self.join.at[2]), band + share * self.rise_m[some]
        return Legs(
            np.column_stack([start, begins]), np.column_stack([end, finishes]), self.column[some],
            self.wide_m[some], self.error_m[some] + band,
        )  # fmt: skip


def candidates(trace: MissionTrace, joins: Sequence[Join], vehicle: Vehicle, parts: TraceParts) -> Bools:
    """(N, J) which joins a return from each part may choose."""
    out = np.ones((len(parts), len(joins)), np.bool_)
    counts = [len(join.legs) for join in joins]
    if not sum(counts):
        return out
    every = np.concatenate([join.legs for join in joins])
    owner = np.repeat(np.arange(len(joins)), counts)
    begin, levels = trace.beginnings(parts)
    low, high = trace.heights(parts)
    down_m, up_m = levels_off_m(vehicle)
    low, high = low - down_m * levels[:, 0], high + up_m * levels[:, 1]
    middle = np.column_stack([begin.mean(axis=1), 0.5 * (low + high)])
    limits = vehicle.limits
    reach = np.hypot(*(begin - middle[:, None, :2]).transpose(2, 0, 1)).max(axis=1)
    # Distances to legs change by no more than the vehicle moves: so a few places stand for all around them.
    first, far = (
        begin[:, 0],
        begin[np.arange(len(parts)), np.hypot(*(begin - begin[:, :1]).transpose(2, 0, 1)).argmax(1)],
    )
    pieces = max(1, math.ceil(float(2.0 * reach.max()) / PLACES_M))
    share = (np.arange(pieces) + 0.5) / pieces
    width = np.abs(_beside(begin, first, far)).max(axis=1)
    error = math.hypot(limits.track_error_m, limits.altitude_error_m)
    out[:] = False
    for s in share:
        at = np.column_stack([first + s * (far - first), middle[:, 2]])
        away = _distances(at, every)
        own = np.hypot(*(far - first).T) / (2 * pieces) + width + 0.5 * (high - low) + trace.track_m[parts.stretch]
        room = 2.0 * (own + error) + AWAY_PART * away.min(axis=1)
        chosen = away <= (away.min(axis=1) + room)[:, None]
        for k in range(len(joins)):
            out[:, k] |= chosen[:, owner == k].any(axis=1)
    return out


def _beside(points: Floats, first: Floats, far: Floats) -> Floats:
    """(N, K) how far points (N, K, 2) lie from the lines through ``first`` and ``far`` (N, 2)."""
    way = far - first
    length = np.hypot(*way.T)
    unit = np.divide(way, length[:, None], out=np.zeros_like(way), where=length[:, None] > 0.0)
    off = points - first[:, None]
    return np.asarray(off[..., 0] * unit[:, None, 1] - off[..., 1] * unit[:, None, 0])


def _distances(at: Floats, legs: Floats) -> Floats:
    """(N, L) the distances in space of places (N, 3) from legs (L, 2, 3)."""
    a, way = legs[:, 0], legs[:, 1] - legs[:, 0]
    square = np.maximum((way**2).sum(axis=1), 1e-12)
    part = np.clip(((at[:, None] - a) * way).sum(axis=2) / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(at[:, None] - (a + part[..., None] * way), axis=2))
