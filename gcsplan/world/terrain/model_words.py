"""Words of every report on a terrain model: its missing parts, and how its heights were read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from gcsplan.figures import floored, raised
from gcsplan.notes.note import Note
from gcsplan.units import Quantity, UnitText
from gcsplan.world.geodesy.height_unit import HeightUnit

ABSENT = {
    "bare": "trees, masts and wires are not in it",
    "surface": "trees and buildings as the radar saw them; newer ones, masts and wires are not in it",
}
"""The parts that a DEM lacks, by its kind."""


def what_is_not_in(inputs: Mapping[str, object], model: str = " DEM") -> str:
    """The sentence for a surface's ``info`` or a report's inputs; empty if a bare DEM has obstacle heights. ``model``
    stands behind the kind; it is empty where the kind stands beside "terrain model" anyway."""
    kind = "surface" if inputs.get("dem_kind") == "surface" else "bare" if inputs.get("bare_dem", True) else ""
    return f"{kind}{model}: {ABSENT[kind]}" if kind else ""


def notes_on(info: Mapping[str, object]) -> tuple[Note, ...]:
    """Notes on the terrain for the user, from a surface's ``info``."""
    notes = info.get("notes", ())
    assert isinstance(notes, tuple)
    return notes


def heights_read(units: Iterable[HeightUnit], datum: str, low_m: float, high_m: float) -> UnitText:
    """How heights were read: ``US survey feet, from the file; NAVD88; ground 160–440 m AMSL``.

    ``units`` come from all files, ``low_m`` and ``high_m`` are the lowest and the highest ground that was loaded.
    """
    stated = " and ".join(dict.fromkeys(unit.stated() for unit in units))
    low, high = floored(low_m, 0), raised(high_m, 0)
    if low == high:
        return UnitText("{}; {}; ground {}", stated, datum, Quantity(low, "amsl", 0))
    to = " to " if low < 0.0 else "–"
    ends = Quantity(low_m, "amsl", 0, "down", bare=True), to, Quantity(high_m, "amsl", 0, "up")
    return UnitText("{}; {}; ground {}{}{}", stated, datum, *ends)


def heights_line(inputs: Mapping[str, object]) -> str | None:
    """The line of a surface's ``info`` or a report's inputs: ``heights: …``; None if they lack it."""
    read = inputs.get("heights_read")
    return UnitText("heights: {}", read) if isinstance(read, str) else None
