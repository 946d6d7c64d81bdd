"""The terrain that an ArduPilot vehicle flies over in the terrain frame: its own grid, made of the mission's ground.

The vehicle knows the ground at posts alone, in whole metres, and is bilinear between them (`grid.TerrainGrid`). Over a
valley or a ridge that is narrower than its posts it flies higher or lower above the ground than it reports.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Floats
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.grid import DEGREE_E7, SPACING_M, PostHeights, TerrainGrid, cell_at, cells_of

TERRAIN_PARTS = 256
"""Parts of a line in which it is looked at for borders of degree tiles."""
BISECTIONS = 40
MOST_POSTS_AROUND = 1000
"""Reach of `VehicleTerrain.change_m`, in posts; beyond it the ground counts as not known."""
LEAST_DEGREE_M = 110_500.0
"""Less than a degree of latitude anywhere, m."""

TerrainPiece = tuple[float, float, Surface]
"""A part of a line, from and to (0 to 1), and the vehicle's ground under it."""


def _ground_at(frame: Frame, surface: Surface, lat_deg: Floats, lon_deg: Floats) -> Floats:
    plane = frame.to_plane(lat_deg, lon_deg)
    return surface.high_at(plane[..., 0], plane[..., 1])


class VehicleTerrain:
    """The vehicle's grid over ``surface``; unknown where the vehicle would not get all posts of a 4 × 4 part.

    Where the ground has two heights the posts have the greater one, and `spread_at` gives how much lower the posts of a
    vehicle may be whose terrain is another one of the sources.
    """

    def __init__(self, frame: Frame, surface: Surface, spacing_m: int = SPACING_M) -> None:
        self._frame, self._surface = frame, surface
        # No method of this object: a cycle would hold the terrain until Python looks for cycles.
        self.posts = PostHeights(TerrainGrid(spacing_m), partial(_ground_at, frame, surface))
        self._surfaces: dict[Cell, Surface | None] = {}
        self._range: tuple[Floats, Floats] | None = None
        self._spread: Floats | None = None

    def amsl(self, lat_deg: float, lon_deg: float) -> float:
        """The height that the vehicle reads at a place, m AMSL; NaN where unknown."""
        return float(self.posts.amsl(lat_deg * 1e7, lon_deg * 1e7))

    def change_m(self, lat_deg: float, lon_deg: float, reach_m: float) -> float:
        """How far the ground that it reads within ``reach_m`` of a place may be from the one that `amsl` says, m.

        Never less than it is, for all posts around count, and what sources differ; NaN where one of them is unknown, or
        the reach too long. At 0 m it is `spread_at`.
        """
        grid, spread_m = self.posts.grid, float(self.spread_at(*self._frame.to_plane(lat_deg, lon_deg)[:, None])[0])
        if reach_m == 0.0:
            return spread_m
        if not reach_m <= MOST_POSTS_AROUND * grid.spacing_m:
            return math.nan
        part = reach_m / LEAST_DEGREE_M
        wide = part / max(math.cos(math.radians(abs(lat_deg) + part)), 0.01)
        lat = 1e7 * (lat_deg + part * np.array([-1.0, -1.0, 1.0, 1.0]))
        lon = 1e7 * (lon_deg + wide * np.array([-1.0, 1.0, -1.0, 1.0]))
        here, most = self.amsl(lat_deg, lon_deg), 0.0
        for cell in cells_of(lat, lon):
            north, east = (
                (math.floor(m.min() / grid.spacing_m) - 1, math.ceil(m.max() / grid.spacing_m) + 1)
                for m in grid.offset_m(cell, lat, lon)
            )
            off_m = float(np.abs(self.posts.window(cell, north, east) - here).max())
            most = off_m if math.isnan(off_m) else max(most, off_m)  # a later tile keeps NaN: no number is above it
        return most + spread_m

    def ground_at(self, east_m: ArrayLike, north_m: ArrayLike) -> Floats:
        """The heights that it reads at points of the plane, m AMSL; NaN where unknown."""
        degrees = self._frame.to_degrees(*np.broadcast_arrays(np.asarray(east_m, float), np.asarray(north_m, float)))
        return self.posts.amsl(degrees[..., 0] * 1e7, degrees[..., 1] * 1e7)

    def spread_at(self, east_m: Floats, north_m: Floats) -> Floats:
        """How much lower the vehicle may read the ground at points of the plane (N,), m; 0 where sources agree.

        It is the largest difference within two and a half posts: as far as the posts of a piece of a leg may lie.
        """
        surface = self._surface
        if not surface.differs:
            return np.zeros(np.shape(east_m))
        if self._spread is None:
            from scipy.ndimage import maximum_filter  # hardly any terrain has two heights

            step = surface.grid.metres_per_cell(*surface.grid.centre)
            size = [2 * math.ceil(2.5 * self.posts.grid.spacing_m / m) + 1 for m in step[::-1]]
            off = np.nan_to_num(surface.high - surface.ground_m)
            self._spread = maximum_filter(off, size, mode="nearest")
        rows, cols = self._spread.shape
        at = np.rint(surface.grid(east_m, north_m)).astype(int)
        return np.asarray(self._spread[at[..., 1].clip(0, rows - 1), at[..., 0].clip(0, cols - 1)])

    def pieces(self, ends: Floats) -> list[TerrainPiece] | None:
        """A straight line of the plane (2, 2) in pieces over one surface each; None if it leads over no known posts.

        Where it crosses into another degree tile, with posts of its own, the height may step.
        """
        f = np.linspace(0.0, 1.0, TERRAIN_PARTS + 1)
        east, north = (ends[0] + f[:, None] * (ends[1] - ends[0])).T
        tiles = np.floor(self._frame.to_degrees(east, north) * 1e7 / DEGREE_E7)
        cuts = [0.0]
        on = [self._cell(ends, 0.0)]
        for k in np.flatnonzero((tiles[1:] != tiles[:-1]).any(axis=1)).tolist():
            cuts.append(self._crossing(ends, f[k], f[k + 1]))
            on.append(self._cell(ends, f[k + 1]))
        cuts.append(1.0)
        out = []
        for a, b, cell in zip(cuts, cuts[1:], on, strict=False):
            surface = self._surface_of(cell)
            if surface is None:
                return None
            out.append((a, b, surface))
        return out

    def _cell(self, ends: Floats, part: float) -> Cell:
        east, north = ends[0] + part * (ends[1] - ends[0])
        lat, lon = self._frame.to_degrees(east, north)
        return cell_at(lat * 1e7, lon * 1e7)

    def _crossing(self, ends: Floats, low: float, high: float) -> float:
        first = self._cell(ends, low)
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._cell(ends, middle) == first else (low, middle)
        return 0.5 * (low + high)

    def _surface_of(self, cell: Cell) -> Surface | None:
        """The vehicle's ground in a tile, as far as the terrain is loaded: nodes are posts, rows going north."""
        if cell not in self._surfaces:
            self._surfaces[cell] = self._made(cell)
        return self._surfaces[cell]

    def _made(self, cell: Cell) -> Surface | None:
        grid, spacing_m = self.posts.grid, self.posts.grid.spacing_m
        if self._range is None:
            rows, cols = self._surface.ground_m.shape
            c, r = np.meshgrid(np.linspace(0.0, cols - 1.0, 65), np.linspace(0.0, rows - 1.0, 65))
            plane = self._surface.grid.to_plane(c.ravel(), r.ravel())
            degrees = self._frame.to_degrees(plane[:, 0], plane[:, 1])
            self._range = degrees[:, 0] * 1e7, degrees[:, 1] * 1e7
        # Only as far as the tile: beyond its borders its posts are read no more, but for the next one.
        lat = np.clip(self._range[0], cell.lat_deg * DEGREE_E7, (cell.lat_deg + 1) * DEGREE_E7)
        turn = (self._range[1] - cell.lon_deg * DEGREE_E7 + 180.0 * DEGREE_E7) % (360.0 * DEGREE_E7) - 180.0 * DEGREE_E7
        lon = cell.lon_deg * DEGREE_E7 + np.clip(turn, 0.0, DEGREE_E7)
        north_m, east_m = grid.offset_m(cell, lat, lon)
        # One post more on each side: a point on the border itself is rounded to either side of it.
        north = math.floor(north_m.min() / spacing_m) - 1, math.ceil(north_m.max() / spacing_m) + 1
        east = math.floor(east_m.min() / spacing_m) - 1, math.ceil(east_m.max() / spacing_m) + 1
        heights = self.posts.window(cell, north, east)
        if np.isnan(heights).all():
            return None

        def exact(east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
            degrees = self._frame.to_degrees(east_m, north_m) * 1e7
            up, right = grid.offset_m(cell, degrees[..., 0], degrees[..., 1])
            return right / spacing_m - east[0], up / spacing_m - north[0]

        corners = grid.post_e7(cell, *np.meshgrid(np.linspace(*north, 17), np.linspace(*east, 17)))
        plane = self._frame.to_plane(corners[0] * 1e-7, corners[1] * 1e-7).reshape(-1, 2)
        (west, south), (right, top) = plane.min(axis=0).tolist(), plane.max(axis=0).tolist()
        return Surface(heights, heights, GridMap.fit(exact, (west, south, right, top)))
