"""The plane stretched along a constant wind, in which a fixed wing's fastest path is the shortest:
docs/concepts/bound.md#fixed-wings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.planners.airspeed import Airspeed
from gcsplan.planners.optimal.plane.plane_search import FEW_NODES
from gcsplan.planners.problem import Problem, Via
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Outside, Polygon, Zone

ELLIPSE_CORNERS = 48
"""Corners of the polygon inside a stretched circle, whose sides lie up to 0.2 % of the radius inside of it."""


@dataclass(frozen=True, eq=False, slots=True)
class WindPlane:
    """``forth`` (2, 2) maps the true plane to the stretched one, ``back`` from there: symmetric, 1 across the wind, and
    ``most`` along it, which is 1 or more. ``true_m_s``: the true airspeed for which it is exact."""

    forth: Floats
    back: Floats
    most: float
    true_m_s: float

    @classmethod
    def of(cls, airspeed: Airspeed, amsl_m: float) -> WindPlane:
        """The plane for an altitude AMSL."""
        true_m_s, blows_m_s = airspeed.true_m_s(amsl_m), airspeed.blows_m_s
        most = true_m_s / math.sqrt(true_m_s**2 - blows_m_s**2)
        along = np.outer(airspeed.wind_m_s, airspeed.wind_m_s) / max(blows_m_s**2, 1e-300)
        return cls(np.eye(2) + (most - 1.0) * along, np.eye(2) + (1.0 / most - 1.0) * along, most, true_m_s)

    def problem(self, true: Problem) -> Problem:
        """The problem of the shortest path with sharp corners in the stretched plane, over no more terrain than here.

        Every path of ``true`` that the check passes is, stretched, one of this problem under its `bound_limits`: no two
        places come nearer to each other, and no slope gets steeper. Its own paths may be illegal in the true plane.
        """
        here = true.airspace
        air = Airspace(self._surface(here.surface), [self._zone(zone) for zone in here.given], scale=here.scale)

        def place(east_m: float, north_m: float) -> tuple[float, float]:
            east_m, north_m = (np.array([east_m, north_m]) @ self.forth).tolist()
            return east_m, north_m

        return replace(
            true, objective="length", airspace=air, turn_radius_m=0.0, widen=None, known=None,
            start=(*place(*true.start[:2]), true.start[2]), goal=(*place(*true.goal[:2]), true.goal[2]),
            via=tuple(Via(*place(v.east_m, v.north_m), v.amsl_m) for v in true.via),
            rounding_m=(self.most * true.rounding_m[0], true.rounding_m[1]),
        )  # fmt: skip

    def stretched(self, points: Floats) -> Floats:
        """Points (N, 2 or more) of the true plane in the stretched one."""
        return np.column_stack([points[:, :2] @ self.forth, points[:, 2:]])

    def _surface(self, true: Surface) -> Surface:
        """The same heights over the stretched plane; level ground goes on to the sides of the box around it."""
        if true.level_m is None or true.ground_m.size > FEW_NODES:
            high_m = true.high_m if true.differs else None
            return Surface(true.ground_m, true.top_m, true.grid.mapped(self.back), true.info, true.goes_on, high_m)
        rows, cols = true.ground_m.shape
        corners = self.stretched(true.grid.to_plane([0, cols - 1, cols - 1, 0], [0, 0, rows - 1, rows - 1]))
        (west_m, south_m), (east_m, north_m) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        grid = GridMap.affine(west_m, north_m, east_m - west_m, north_m - south_m)
        ground, top = (np.full((2, 2), z[0, 0]) for z in (true.ground_m, true.top_m))
        return Surface(ground, ground if true.top_m is true.ground_m else top, grid, true.info, true.goes_on)

    def _zone(self, true: Zone) -> Zone:
        """The stretched zone; of a circle a polygon inside its ellipse."""
        shape, outside = true.shape, true.outside
        if isinstance(shape, Circle):
            angle = np.linspace(0.0, 2.0 * math.pi, ELLIPSE_CORNERS, endpoint=False)
            around = shape.radius_m * np.column_stack([np.cos(angle), np.sin(angle)])
            shape = Polygon(self.stretched(around + np.array([shape.east_m, shape.north_m])))
        else:
            shape = Polygon(self.stretched(shape.vertices))
        if outside is not None:
            outside = Outside(outside.areas, outside.edges @ self.forth)
        return replace(true, shape=shape, outside=outside)
