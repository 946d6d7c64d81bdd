"""What every report says of a terrain model: what it does not hold, and how its heights were read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from gcsplan.units import Quantity, UnitText
from gcsplan.world.height_unit import HeightUnit

BARE_DEM = "bare DEM: trees, masts and wires are not in it"
SURFACE_DEM = "surface DEM: trees and buildings as the radar saw them; newer ones, masts and wires are not in it"


def what_is_not_in(inputs: Mapping[str, object]) -> str:
    """The sentence for a surface's ``info`` or a report's inputs; empty if a bare DEM has obstacle heights."""
    if inputs.get("dem_kind") == "surface":
        return SURFACE_DEM
    return BARE_DEM if inputs.get("bare_dem", True) else ""


def heights_read(units: Iterable[HeightUnit], datum: str, low_m: float, high_m: float) -> UnitText:
    """How heights were read: ``US survey feet, from the file; NAVD88; ground 160–440 m``.

    ``units`` are those of all files, ``low_m`` and ``high_m`` the lowest and the highest ground that was loaded.
    """
    told = " and ".join(dict.fromkeys(unit.told() for unit in units))
    low, high = Quantity(low_m, "amsl", 0, "down"), Quantity(high_m, "amsl", 0, "up")
    if low.text(None) == high.text(None):
        return UnitText("{}; {}; ground {}", told, datum, high)
    ends = "{} to {}" if low_m < 0.0 else "{}–{}"
    return UnitText(f"{{}}; {{}}; ground {ends}", told, datum, replace(low, bare=True), high)


def heights_line(inputs: Mapping[str, object]) -> UnitText | None:
    """The line of a surface's ``info`` or a report's inputs: ``heights: …``; None if they do not say it."""
    read = inputs.get("heights_read")
    return UnitText("heights: {}", read) if isinstance(read, str) else None
