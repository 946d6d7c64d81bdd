"""How high a mission passes over a zone, or how low under one: the distance that the horizontal one does not tell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.motion.stretch import Stretch
from gcsplan.world.airspace import Legs, Violation
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Level
from gcsplan.world.world import World

__all__ = ["ZonePass", "nearest_pass"]

FARTHEST_M, WITHIN_M = 1000.0, 0.002
"""Passes at a greater height are not told; and how closely the height is found, metres."""


@dataclass(frozen=True, slots=True)
class ZonePass:
    """The least height of the mission's line over (``over``) or under a zone within its outline, seen from above."""

    seq: int
    zone: str
    height_m: float
    over: bool
    lat_deg: float
    lon_deg: float

    @property
    def side(self) -> str:
        """``over`` or ``under``."""
        return "over" if self.over else "under"


def nearest_pass(
    stretches: Sequence[Stretch], legs: Legs, owner: Indices, limits: Limits, world: World
) -> ZonePass | None:  # fmt: skip
    """The nearest pass over or under a zone; None if there is none, or if the line leads into a zone.

    ``owner`` (N,): index of each leg's stretch. The exact check of the legs, without errors and clearance to the side,
    is asked how large an altitude error may be: no less than told is free above a zone or below it.
    """
    air = world.airspace
    near = np.flatnonzero(_meets_box(legs, air.zone_boxes))
    if not len(near):
        return None
    free = replace(limits, horizontal_clearance_m=0.0, min_agl_m=0.0, max_agl_m=None, max_amsl_m=None)
    some = Legs(legs.start[near], legs.end[near], legs.column[near], np.zeros(len(near)), np.zeros(len(near)))

    def hit(error_m: float) -> Violation | None:
        lifted = replace(some, altitude_error_m=np.full(len(near), error_m))
        return next((v for v in air.examine(lifted, free).violations if v.kind == "zone"), None)

    found, clear_m, hits_m = hit(FARTHEST_M), 0.0, FARTHEST_M
    if found is None or hit(0.0) is not None:
        return None
    while hits_m - clear_m > WITHIN_M:
        middle = 0.5 * (clear_m + hits_m)
        v = hit(middle)
        clear_m, hits_m, found = (middle, hits_m, found) if v is None else (clear_m, middle, v)
    zone = air.zones[found.zone]
    ground = float(air.surface.ground_at(found.east_m, found.north_m))
    floor, ceiling = _amsl_m(zone.floor, ground, -math.inf), _amsl_m(zone.ceiling, ground, math.inf)
    lat, lon = (float(x) for x in world.frame.to_degrees(found.east_m, found.north_m))
    over = found.amsl_m - ceiling >= floor - found.amsl_m
    seq = stretches[int(owner[near[found.leg]])].seq
    return ZonePass(seq, zone.name, clear_m, over, lat, lon)


def _amsl_m(level: Level | None, ground_m: float, without_m: float) -> float:
    if level is None:
        return without_m
    return level.value_m + (ground_m if level.datum == "agl" else 0.0)


def _meets_box(legs: Legs, boxes: Floats) -> Bools:
    """(N,) whether a leg's box meets that of a zone, (Z, 4) west, south, east, north."""
    low, high = (f(legs.start[:, :2], legs.end[:, :2]) for f in (np.minimum, np.maximum))
    met = np.zeros(len(low), np.bool_)
    all_low, all_high = low.min(axis=0, initial=np.inf), high.max(axis=0, initial=-np.inf)
    for west, south, east, north in boxes[((boxes[:, :2] <= all_high) & (boxes[:, 2:] >= all_low)).all(axis=1)]:
        met |= (low <= (east, north)).all(axis=1) & (high >= (west, south)).all(axis=1)
    return met
