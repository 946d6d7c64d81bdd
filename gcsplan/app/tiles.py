"""Which tiles of a published source an area needs: a mission's, the surroundings of a place, or tiles by name."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from gcsplan.dem import DEFAULT_SOURCE
from gcsplan.dem.cache import MissingTiles
from gcsplan.dem.sources import MOST_TILES_OF_AREA, SOURCES, DemSource, cells_in
from gcsplan.errors import PATH_KINDS, InputError, UsageError, require_kind, unknown_name
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.values.places import read_place
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.terrain.cell import Cell, cell_of

__all__ = ["tiles_of"]

MOST_RADIUS_KM = 1000.0
"""Largest radius around a place, km; far fewer tiles are brought at once."""


def tiles_of(
    mission: str | os.PathLike[str] | Mapping[str, Any] | None,
    around: str | None,
    radius_km: float | None,
    tiles: str | None,
    source: str | None,
) -> tuple[DemSource, Sequence[Cell]]:
    """The source, and the tiles of the one area that is given, as the options of ``dem fetch`` describe it.

    Raises InputError, UsageError.
    """
    ways = {"MISSION": mission, "--around": around, "--tiles": tiles}
    given = [name for name, value in ways.items() if value is not None]
    if len(given) != 1:
        raise UsageError(f"which area? Give one of {', '.join(ways)}; given {' and '.join(given) or 'none'}")
    if (around is None) != (radius_km is None):
        raise UsageError("--around LAT,LON and --radius-km N belong together")
    if source is not None and source not in SOURCES:
        raise UsageError(unknown_name(f"--source: there is no source {source[:64]!r}", source, SOURCES).message)
    if mission is not None:
        return _of_mission(mission, source)
    chosen = SOURCES[source or DEFAULT_SOURCE]
    return chosen, _named(tiles or "") if around is None or radius_km is None else _around(around, radius_km)


def _of_mission(
    mission: str | os.PathLike[str] | Mapping[str, Any], source: str | None
) -> tuple[DemSource, Sequence[Cell]]:
    """The source that a mission names, and the tiles that it needs: all of them, or the missing ones."""
    expected = "the path of a mission file, or a mapping"
    require_kind("fetch_dem()", "mission", mission, (Mapping, *PATH_KINDS), expected)
    path = "mission" if isinstance(mission, Mapping) else os.fspath(mission)
    try:
        inputs = load_mission(mission).inputs
        name, cells = str(inputs.get("dem_source", "")), str(inputs.get("dem_tiles", ""))
        found = tuple(cell for cell in map(cell_of, cells.split(",")) if cell is not None)
    except InputError as why:
        missing = [p for p in why.problems if isinstance(p, MissingTiles)]
        if not missing:
            raise
        name, found = missing[0].source, tuple(dict.fromkeys(cell for p in missing for cell in p.cells))
    if name not in SOURCES:
        raise InputError(
            f"names no published source, so that there is nothing to fetch; write {' or '.join(SOURCES)}, or fetch "
            "with --around",
            where=f"{path}: terrain.dem",
        )
    if source not in (None, name):
        raise UsageError(f"--source {source}: {path} says `dem: {name}`; change it there")
    return SOURCES[name], found


def _around(text: str, radius_km: float) -> Sequence[Cell]:
    try:
        place = read_place(text)
    except ValueError as why:
        raise UsageError(f"--around {text[:100]}: give LAT,LON in degrees, such as 36.6,-84.38: {why}") from None
    if not 0.0 < radius_km <= MOST_RADIUS_KM:
        raise UsageError(f"--radius-km {radius_km:g}: give more than 0 km, and at most {MOST_RADIUS_KM:g} km")
    reach_m = 1000.0 * radius_km
    try:
        frame = Frame(place.lat_deg, place.lon_deg)
    except InputError:
        raise UsageError(
            f"--around {text[:100]}: give a place within ±85° of latitude, where missions are planned"
        ) from None
    return cells_in(frame, (-reach_m, -reach_m, reach_m, reach_m), where="--radius-km")


def _named(text: str) -> Sequence[Cell]:
    names = [name.strip().upper() for name in text.split(",") if name.strip()]
    cells = [cell_of(name) for name in names]
    wrong = [name for name, cell in zip(names, cells, strict=True) if cell is None]
    if wrong or not cells or len(cells) > MOST_TILES_OF_AREA:
        what = f"given {wrong[0][:32]!r}" if wrong else f"given {len(cells)} of them"
        raise UsageError(f"--tiles: give 1 to {MOST_TILES_OF_AREA} names such as N36W085, with commas: {what}")
    return tuple(dict.fromkeys(cell for cell in cells if cell is not None))
