"""The ground of a mission file for vehicles that ask for terrain: more of it is loaded where a place lies beyond."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.mission_file import MissionFile

MOST_CELLS = 25_000_000
"""Cells of the widest terrain that is loaded, 400 MB."""


@dataclass(eq=False)
class MissionGround:
    """Ground, m AMSL, at latitudes and longitudes; NaN where the mission's terrain does not know it."""

    source: MissionFile

    def __call__(self, lat_deg: Floats, lon_deg: Floats) -> Floats:
        """See `terrain_grid.GroundHeights`. Raises InputError if the terrain cannot be read."""
        while True:
            plane = self.source.frame.to_plane(lat_deg, lon_deg)
            heights = self.source.surface.high_at(plane[..., 0], plane[..., 1])
            unknown = np.isnan(heights)
            if not unknown.any() or not self._widened(plane[unknown]):
                return heights

    def _widened(self, plane: Floats) -> bool:
        """Load more terrain if some of these places lie beyond a side where there is more."""
        surface = self.source.surface
        rows, cols = surface.ground_m.shape
        at = surface.grid(plane[:, 0], plane[:, 1])
        beyond = (at[:, 0] < 0.0, at[:, 1] < 0.0, at[:, 0] > cols - 1, at[:, 1] > rows - 1)
        if not any(more and bool(out.any()) for more, out in zip(surface.goes_on, beyond, strict=True)):
            return False
        wide = None if self.source.wider is None else self.source.wider(0.0, MOST_CELLS)
        if wide is None:
            return False
        self.source = wide
        return True

    def degrees_box(self) -> tuple[float, float, float, float]:
        """South, west, north, east, degrees, of the terrain that is loaded; east is beyond 180 where it wraps."""
        surface, frame = self.source.surface, self.source.frame
        rows, cols = surface.ground_m.shape
        f = np.linspace(0.0, 1.0, 33)
        c, r = np.meshgrid(f * (cols - 1), f * (rows - 1))
        plane = surface.grid.to_plane(c.ravel(), r.ravel())
        degrees = frame.to_degrees(plane[:, 0], plane[:, 1])
        lon = frame.lon_deg + (degrees[:, 1] - frame.lon_deg + 180.0) % 360.0 - 180.0
        return float(degrees[:, 0].min()), float(lon.min()), float(degrees[:, 0].max()), float(lon.max())
