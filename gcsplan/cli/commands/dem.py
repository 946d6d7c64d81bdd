"""`gcsplan dem fetch`: the only command that brings terrain from the network."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcsplan.cli.arguments.options import JsonOption
from gcsplan.cli.process.exit import emit, interrupted
from gcsplan.errors import InputError, UsageError

if TYPE_CHECKING:
    from gcsplan.dem.fetch import Fetched, FetchProgress
    from gcsplan.dem.sources import DemSource
    from gcsplan.world.terrain.cell import Cell

dem_app = typer.Typer(help="Terrain from published sources.", no_args_is_help=True)

DEFAULT_SOURCE = "copernicus-glo30"
MOST_KM = 300.0


@dem_app.callback()
def dem() -> None:
    """Terrain from published sources."""


@dem_app.command("fetch", short_help="Bring the tiles that a mission or a place needs.")
def fetch(
    mission: Annotated[
        Path | None, typer.Argument(metavar="MISSION.yaml", help="Its area; its `terrain: dem:` names the source.")
    ] = None,
    around: Annotated[
        str | None, typer.Option(metavar="LAT,LON", help="Instead of a mission: the area around a place.")
    ] = None,
    radius_km: Annotated[
        float | None, typer.Option(metavar="N", min=0.1, max=MOST_KM, help="With --around: half the side of the area.")
    ] = None,
    tiles: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Instead: tiles by their south-west corners, N36W085,N36W084.")
    ] = None,
    source: Annotated[
        str | None, typer.Option(metavar="NAME", help=f"copernicus-glo30 or srtm [default: {DEFAULT_SOURCE}]")
    ] = None,
    mirror: Annotated[
        str,
        typer.Option(
            envvar="GCSPLAN_DEM_MIRROR",
            metavar="URL",
            help="A copy of the public buckets, each in a folder of its name.",
        ),
    ] = "",
    offline: Annotated[
        bool, typer.Option("--offline", help="Only look whether all of it is in the cache; use no network.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Bring terrain into the cache, from where `plan` and `check` take it; they never use the network themselves.

    For a mission:    gcsplan dem fetch mission.yaml

    For a place:    gcsplan dem fetch --around 47.39708,8.34403 --radius-km 10

    The mission file then says `terrain: {dem: copernicus-glo30}`. The cache is $GCSPLAN_DEM_CACHE, or gcsplan/dem in
    $XDG_CACHE_HOME. The exit code is 0 once every tile is there, 6 if some could not be had (the others stay, and the
    same command goes on from there).
    """
    from gcsplan.dem.cache import Cache
    from gcsplan.dem.fetch import Fetch

    ways = {"MISSION": mission, "--around": around, "--tiles": tiles}
    given = [name for name, value in ways.items() if value is not None]
    if len(given) != 1:
        raise UsageError(f"which area? Give one of {', '.join(ways)}; given {' and '.join(given) or 'none'}")
    if (around is None) != (radius_km is None):
        raise UsageError("--around LAT,LON and --radius-km N belong together")
    chosen = _source(source)
    if mission is not None:
        chosen, cells = _of_mission(mission, source)
    elif around is not None and radius_km is not None:
        cells = _around(around, radius_km)
    else:
        cells = _named(tiles or "")
    cache = Cache(chosen)
    if offline:
        done = Fetch(cache).look(cells)
    else:
        try:
            with _progress() as progress:
                done = Fetch(cache, mirror=mirror, progress=progress).run(cells)
        except KeyboardInterrupt:
            raise interrupted("interrupted: what came is kept, and the same command goes on from here") from None
    _tell(chosen, cache.root, done, as_json)


def _source(name: str | None) -> DemSource:
    from gcsplan.dem.sources import SOURCES
    from gcsplan.errors import unknown_name

    if name is not None and name not in SOURCES:
        raise UsageError(unknown_name(f"--source: there is no source {name[:64]!r}", name, SOURCES).message)
    return SOURCES[name or DEFAULT_SOURCE]


def _of_mission(path: Path, source: str | None) -> tuple[DemSource, Sequence[Cell]]:
    """The source that a mission names, and the tiles that it needs: all of them, or the missing ones."""
    from gcsplan.dem.cache import MissingTiles
    from gcsplan.dem.sources import SOURCES
    from gcsplan.mission_file import load_mission
    from gcsplan.world.terrain.cell import cell_of

    try:
        inputs = load_mission(path).inputs
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
    from gcsplan.dem.sources import cells_in
    from gcsplan.mission_file.values.places import read_place
    from gcsplan.world.geodesy.frame import Frame

    try:
        place = read_place(text)
    except ValueError as why:
        raise UsageError(f"--around {text[:100]}: give LAT,LON in degrees, such as 36.6,-84.38: {why}") from None
    reach_m = 1000.0 * radius_km
    try:
        frame = Frame(place.lat_deg, place.lon_deg)
    except InputError:
        raise UsageError(
            f"--around {text[:100]}: give a place within ±85° of latitude, where missions are planned"
        ) from None
    return cells_in(frame, (-reach_m, -reach_m, reach_m, reach_m), where="--radius-km")


def _named(text: str) -> Sequence[Cell]:
    from gcsplan.dem.sources import MOST_TILES_OF_AREA
    from gcsplan.world.terrain.cell import cell_of

    names = [name.strip().upper() for name in text.split(",") if name.strip()]
    cells = [cell_of(name) for name in names]
    wrong = [name for name, cell in zip(names, cells, strict=True) if cell is None]
    if wrong or not cells or len(cells) > MOST_TILES_OF_AREA:
        what = f"given {wrong[0][:32]!r}" if wrong else f"given {len(cells)} of them"
        raise UsageError(f"--tiles: give 1 to {MOST_TILES_OF_AREA} names such as N36W085, with commas: {what}")
    return tuple(dict.fromkeys(cell for cell in cells if cell is not None))


@contextmanager
def _progress() -> Iterator[FetchProgress | None]:
    """Bars of what is being brought, on a terminal only."""
    from gcsplan.cli.output.console import aside

    if not aside.is_terminal:
        yield None
        return
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TransferSpeedColumn

    columns = (TextColumn("{task.description}"), BarColumn(bar_width=20), DownloadColumn(), TransferSpeedColumn())
    with Progress(*columns, console=aside, transient=True) as bars:
        tasks: dict[str, object] = {}

        def update(name: str, have: int, whole: int | None) -> None:
            if name not in tasks:
                tasks[name] = bars.add_task(name, total=whole)
            bars.update(tasks[name], completed=have, total=whole)  # type: ignore[arg-type]

        yield update


def _tell(source: DemSource, root: Path, done: Sequence[Fetched], as_json: bool) -> None:
    from gcsplan.cli.output.console import remark, say

    if as_json:
        rows = [
            {"tile": f.cell.name, "state": f.record.state, "cached": f.cached, "bytes": f.record.bytes,
             "sha256": f.record.sha256, "url": f.record.url, "lists": list(f.record.lists)}
            for f in done
        ]  # fmt: skip
        emit({
            "source": source.name, "kind": source.kind, "vertical_datum": source.vertical_datum, "cache": str(root),
            "tiles": rows,
        })  # fmt: skip
        return
    for f in done:
        say(f"{f.cell.name}  {_words(f)}")
    what = "surface model (trees and buildings are in it)" if source.kind == "surface" else "bare-earth model"
    remark(f"{source.title}, {what}, heights above {source.vertical_datum}; cache {root}")
    remark(source.notice)


def _words(f: Fetched) -> str:
    if f.record.state == "sea":
        return "sea: neither this source nor GLO-90 lists a tile"
    if f.record.state == "absent":
        return "not published by this source, though GLO-90 shows land: unknown ground"
    return f"{f.record.bytes / 1e6:.1f} MB" + (", in the cache already" if f.cached else ", fetched")
