"""`gcsplan dem fetch`: the only command that brings terrain from the network."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcsplan.cli.arguments.options import JsonOption
from gcsplan.cli.process.exit import emit, interrupted
from gcsplan.dem import DEFAULT_SOURCE

if TYPE_CHECKING:
    from gcsplan.dem.fetch import Fetched, FetchProgress
    from gcsplan.dem.sources import DemSource

dem_app = typer.Typer(help="Terrain from published sources.", no_args_is_help=True)

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
    from gcsplan.app.tiles import tiles_of
    from gcsplan.dem.cache import Cache
    from gcsplan.dem.fetch import Fetch

    chosen, cells = tiles_of(mission, around, radius_km, tiles, source)
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
