"""What a terrain model does not hold, in one sentence for every report."""

from __future__ import annotations

from collections.abc import Mapping

BARE_DEM = "bare DEM: trees, masts and wires are not in it"
SURFACE_DEM = "surface DEM: trees and buildings as the radar saw them; newer ones, masts and wires are not in it"


def what_is_not_in(inputs: Mapping[str, object]) -> str:
    """The sentence for a surface's ``info`` or a report's inputs; empty if a bare DEM has obstacle heights."""
    if inputs.get("dem_kind") == "surface":
        return SURFACE_DEM
    return BARE_DEM if inputs.get("bare_dem", True) else ""
