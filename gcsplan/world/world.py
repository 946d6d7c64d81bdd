"""The world of one mission: its plane, and the airspace over it."""

from __future__ import annotations

from dataclasses import dataclass

from gcsplan.world.airspace import Airspace
from gcsplan.world.frame import Frame


@dataclass(frozen=True, eq=False)
class World:
    """``frame`` is the only conversion from degrees; ``airspace`` knows only metres."""

    frame: Frame
    airspace: Airspace

    def ground_amsl(self, lat_deg: float, lon_deg: float) -> float:
        """Ground at a place, metres AMSL; NaN where unknown."""
        east, north = self.frame.to_plane(lat_deg, lon_deg)
        return float(self.airspace.surface.ground_at(east, north))
