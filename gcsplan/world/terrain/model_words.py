"""What every report says of a terrain model: what it does not hold, and how its heights were read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from gcsplan.figures import floored, raised
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.height_unit import HeightUnit

BARE_DEM = "bare DEM: trees, masts and wires are not in it"
SURFACE_DEM = "surface DEM: trees and buildings as the radar saw them; newer ones, masts and wires are not in it"


def what_is_not_in(inputs: Mapping[str, object]) -> str:
    """The sentence for a surface's ``info`` or a report's inputs; empty if a bare DEM has obstacle heights."""
    if inputs.get("dem_kind") == "surface":
        return SURFACE_DEM
    return BARE_DEM if inputs.get("bare_dem", True) else ""


def notes_on(info: Mapping[str, object]) -> tuple[Note, ...]:
    """What a user has to know of the terrain, of a surface's ``info``."""
    notes = info.get("notes", ())
    assert isinstance(notes, tuple)
    return notes


def heights_read(units: Iterable[HeightUnit], datum: str, low_m: float, high_m: float) -> str:
    """How heights were read: ``US survey feet, from the file; NAVD88; ground 160–440 m``.

    ``units`` are those of all files, ``low_m`` and ``high_m`` the lowest and the highest ground that was loaded.
    """
    told = " and ".join(dict.fromkeys(unit.told() for unit in units))
    low, high = floored(low_m, 0), raised(high_m, 0)
    ends = f"{high:.0f}" if low == high else f"{low:.0f}{' to ' if low < 0.0 else '–'}{high:.0f}"
    return f"{told}; {datum}; ground {ends} m AMSL"


def heights_line(inputs: Mapping[str, object]) -> str | None:
    """The line of a surface's ``info`` or a report's inputs: ``heights: …``; None if they do not say it."""
    read = inputs.get("heights_read")
    return f"heights: {read}" if isinstance(read, str) else None
