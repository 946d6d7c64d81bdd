"""The files that a mission file names: its terrain and its zones. Whoever keeps results asks whether they changed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gcsplan.dem.sources import source_or_path
from gcsplan.mission_file.content import read_content

MOST_FILES = 100_000
"""Most files of a folder of tiles that are looked at."""


def files_of(mission: Path) -> tuple[Path, ...]:
    """Every file that ``mission`` names and that exists, those of a folder of tiles too, sorted.

    Raises InputError if the mission cannot be read at all.
    """
    file, _, given, _ = read_content(mission, None)
    folder = file.parent
    terrain, zones = given.get("terrain"), given.get("no_fly")
    named: list[Any] = []
    if isinstance(terrain, dict):
        dem = terrain.get("dem")
        named += [source_or_path(str(d), folder) for d in (dem if isinstance(dem, list) else [dem]) if _is_path(d)]
        named += [folder / terrain[key] for key in ("canopy", "geoid_grid") if isinstance(terrain.get(key), str)]
    for zone in zones if isinstance(zones, list) else ():
        if isinstance(zone, dict) and isinstance(zone.get("file"), str):
            named.append(folder / zone["file"])
    found: set[Path] = set()
    for one in named:
        path = Path(one)
        some = path.rglob("*") if path.is_dir() else [path]
        for inside in some:
            if len(found) < MOST_FILES and inside.is_file():
                found.add(inside)
    return tuple(sorted(found))


def _is_path(given: Any) -> bool:
    return isinstance(given, str) and not given.startswith("sample:")
