"""The ground under a zone within reach of places, which decides the zone's levels above ground there."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Polygon, Zone

GROUND_RINGS = ((0.0, 1), (1.0 / 3.0, 8), (2.0 / 3.0, 16), (0.9, 32), (1.0, 64))
"""Circles of points at which ground is read: their radius, as a part of the reach, and how many."""
RING_POINTS = sum(n for _, n in GROUND_RINGS)
_TURNS = [(r, math.tau * k / n) for r, n in GROUND_RINGS for k in range(n)]
_RING_OFFSETS = np.array([(r * math.cos(turn), r * math.sin(turn)) for r, turn in _TURNS])


def own_ground(surface: Surface, zone: Zone, places: Floats, reach_m: float) -> tuple[Floats, Floats]:
    """(N,) lowest and highest ground under a zone within ``reach_m`` of places (N, 2), as far as `RING_POINTS` around
    each show; inf and -inf where none of them is under the zone or known."""
    shape = zone.shape
    points = (places[:, None] + reach_m * _RING_OFFSETS).reshape(-1, 2)
    if isinstance(shape, Polygon):
        import shapely  # many missions have no polygons

        within = shapely.contains_xy(shapely.Polygon(shape.vertices), points)
    else:
        within = np.hypot(points[:, 0] - shape.east_m, points[:, 1] - shape.north_m) <= shape.radius_m
    ground = surface.ground_at(*points.T)
    within &= np.isfinite(ground)
    low, high = np.where(within, ground, np.inf), np.where(within, ground, -np.inf)
    return low.reshape(len(places), -1).min(axis=1), high.reshape(len(places), -1).max(axis=1)
