"""The world of one mission: its plane, the airspace over it, and the terrain that its vehicles know."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.terrain.grid import SPACING_M
from gcsplan.world.terrain.vehicle_terrain import VehicleTerrain

ANSWERS_KEPT = 64
"""Most places whose ground is kept, and lengths whose bow is."""


@dataclass(frozen=True, eq=False)
class World:
    """``frame`` is the only conversion from degrees; ``airspace`` knows only metres.

    ``post_spacing_m``: of the terrain in the vehicles (ArduPilot's TERRAIN_SPACING).
    """

    frame: Frame
    airspace: Airspace
    post_spacing_m: int = SPACING_M

    def __reduce__(self) -> tuple[type[World], tuple[Frame, Airspace, int]]:
        return World, (self.frame, self.airspace, self.post_spacing_m)  # without the answers that are kept

    def spread_m(self, lat_deg: float, lon_deg: float) -> float:
        """How far the greatest ground at a place lies above the least one, m; 0 where they are one or unknown."""
        surface = self.airspace.surface
        if not surface.differs:
            return 0.0
        east, north = self.frame.to_plane(lat_deg, lon_deg)
        spread = float(surface.high_at(east, north) - surface.ground_at(east, north))
        return spread if spread > 0.0 else 0.0

    def ground_amsl(self, lat_deg: float, lon_deg: float) -> float:
        """Least ground at a place, metres AMSL; NaN where unknown."""
        place = lat_deg, lon_deg
        if place not in self._grounds:
            if len(self._grounds) >= ANSWERS_KEPT:
                self._grounds.clear()
            east, north = self.frame.to_plane(lat_deg, lon_deg)
            self._grounds[place] = float(self.airspace.surface.ground_at(east, north))
        return self._grounds[place]

    @cached_property
    def _grounds(self) -> dict[tuple[float, float], float]:
        """The ground at the places requested last: home is requested again and again."""
        return {}

    def bow_m(self, longest_m: float) -> float:
        """Metres that a leg of ``longest_m``, or the longest one that fits into this world, may lie beside the line
        that is straight in degrees, wherever it is (little in the papers' 100 m worlds)."""
        north_m, across_m = self._extent_m
        half_m = 0.5 * min(longest_m, across_m)
        if half_m not in self._bows:
            if len(self._bows) >= ANSWERS_KEPT:
                self._bows.clear()
            ends = self.frame.to_degrees([-half_m, half_m], [north_m, north_m])
            self._bows[half_m] = float(self.frame.bow_m(ends[0], ends[1])[0]) + 1e-3
        return self._bows[half_m]

    @cached_property
    def _extent_m(self) -> tuple[float, float]:
        """The northernmost place of the surface, metres north, and the diagonal of the box around it, metres."""
        surface = self.airspace.surface
        rows, cols = surface.ground_m.shape
        corners = surface.grid.to_plane([0, cols - 1, 0, cols - 1], [0, 0, rows - 1, rows - 1])
        return float(corners[:, 1].max()), float(np.linalg.norm(np.ptp(corners, axis=0)))

    @cached_property
    def _bows(self) -> dict[float, float]:
        """The bows of the legs requested last, by half their length: every attempt at a plan requests them again."""
        return {}

    def read_amsl(self, lat_deg: float, lon_deg: float) -> float:
        """Ground at a place as the vehicle's own grid has it, metres AMSL; NaN where it has none."""
        return self.vehicle_terrain.amsl(lat_deg, lon_deg)

    def read_change_m(self, lat_deg: float, lon_deg: float, reach_m: float) -> float:
        """How far that ground changes within ``reach_m`` of a place; see `VehicleTerrain.change_m`."""
        return self.vehicle_terrain.change_m(lat_deg, lon_deg, reach_m)

    @cached_property
    def vehicle_terrain(self) -> VehicleTerrain:
        """The ground as a vehicle that has this terrain on board reads it, in the terrain frame."""
        return VehicleTerrain(self.frame, self.airspace.surface, self.post_spacing_m)

    def with_posts(self, spacing_m: int) -> World:
        """The same world for vehicles with other posts."""
        return self if spacing_m == self.post_spacing_m else replace(self, post_spacing_m=spacing_m)
