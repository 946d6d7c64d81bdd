"""`gcsplan terrain`: what vehicles need to know of the ground, as files for their SD card and over a link."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcsplan.cli.arguments.options import LINKS, JsonOption, MissionArgument
from gcsplan.cli.process.exit import emit, talking
from gcsplan.errors import CheckFailed, GcsplanError, InputError, LinkError
from gcsplan.figures import counted

if TYPE_CHECKING:
    from gcsplan.app.upload.terrain_service import Report
    from gcsplan.mavlink.link.terrain import TerrainComparison

terrain_app = typer.Typer(help="Terrain for the vehicle, out of the mission's own.", no_args_is_help=True)

SpacingOption = Annotated[
    int, typer.Option("--spacing", metavar="M", min=5, max=1000, help="The vehicle's TERRAIN_SPACING, metres.")
]
LinkOption = Annotated[
    list[str],
    typer.Option("--link", metavar="URL", help=f"Where the vehicles are: {LINKS} Also NAME=URL, or `link`."),
]


@terrain_app.callback()
def terrain() -> None:
    """Terrain for the vehicle, out of the mission's own."""


@terrain_app.command("dat", short_help="Write ArduPilot's terrain files for the SD card.")
def dat(
    mission: MissionArgument,
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="DIR", help="Folder for N36W085.DAT …; copy them to APM/TERRAIN.")
    ],
    margin_km: Annotated[
        float, typer.Option("--margin-km", metavar="N", min=0.0, max=100.0, help="Around the ground that plan loads.")
    ] = 5.0,
    spacing: SpacingOption = 100,
    add: Annotated[
        bool, typer.Option("--add", help="Keep the other blocks of files that are there; their terrain is not ours.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Write the terrain that a mission's vehicles need as ArduPilot's .DAT files.

    Heights are whole metres, upwards: no post lies below the mission's terrain. Where that is unknown, nothing is
    written, and the vehicle asks a ground station. A file that is there is not replaced: --add puts the blocks in.
    """
    from gcsplan.app.upload.job import MissionGround
    from gcsplan.cli.output.console import remark, say
    from gcsplan.dem.dat_file import blocks_around, contents_of
    from gcsplan.export.durable import write_whole
    from gcsplan.mission_file import load_mission
    from gcsplan.world.terrain.grid import PostHeights, TerrainGrid

    ground, grid = MissionGround(load_mission(mission)), TerrainGrid(spacing)
    blocks = blocks_around(grid, ground.degrees_box(), margin_km, where=str(mission))
    made = contents_of(PostHeights(grid, ground), blocks, out, add=add, where=str(mission))
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as why:
        raise InputError(f"cannot be made: {why.strerror or why}", where=str(out)) from None
    for file in made.files:
        write_whole(file.path, file.data)
    if as_json:
        rows = [file.as_dict() for file in made.files]
        emit({"spacing_m": spacing, "files": rows, "unknown_blocks": made.unknown, "partly_known_blocks": made.partly})
        return
    for file in made.files:
        say(f"{file.path}  {counted(file.blocks, 'block')}" + (f", {file.kept} kept" if file.kept else ""))
    if made.unknown or made.partly:
        remark(
            f"the ground is unknown in {counted(made.unknown, 'block')} and in parts of {made.partly} more: they are "
            "not in the files, and the vehicle asks a ground station for them"
        )
    remark(f"copy to APM/TERRAIN on the SD card; the vehicle's TERRAIN_SPACING must be {spacing}")


@terrain_app.command("serve", short_help="Answer the vehicles' terrain requests.")
def serve(
    mission: MissionArgument,
    link: LinkOption,
    seconds: Annotated[
        float, typer.Option("--seconds", metavar="S", min=1.0, help="End after so long [default: Ctrl-C ends it]")
    ] = math.inf,
    until_loaded: Annotated[
        bool, typer.Option("--until-loaded", help="End when every vehicle has had nothing pending for 5 s.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Answer TERRAIN_REQUEST with TERRAIN_DATA from the mission's own terrain, until Ctrl-C.

    A vehicle that is to fly the terrain frame, or below its home, asks for the ground around it and around its way
    points. Unknown ground is not sent but reported. Serve it before the flight, --until-loaded, or beside it.
    """
    from gcsplan.app.upload import terrain_service as terrain_link
    from gcsplan.cli.output.console import remark, say
    from gcsplan.mission_file import load_mission

    source = load_mission(mission)
    if not as_json:
        remark(f"serving the terrain of {source.name or mission}; Ctrl-C ends it")
    with _progress("{} parts loaded, {} pending", as_json) as report:
        done = terrain_link.serve(source, link, seconds=seconds, until_loaded=until_loaded, report=report)
    late = [d for d in done if until_loaded and not d.complete]
    error = LinkError(
        f"{', '.join(d.vehicle for d in late)} did not get all terrain in {seconds:g} s: "
        f"{', '.join(f'{max(d.pending, 0)} parts pending' for d in late)}",
        reason="terrain_pending",
    )
    if as_json:
        emit({"vehicles": [d.as_dict() for d in done]}, error.as_dict() if late else None)
        raise typer.Exit(error.exit_code if late else 0)
    for d in done:
        say(f"{d.vehicle}: {counted(d.parts, 'part')} of {counted(d.blocks, 'block')} sent"
            f"{', nothing pending' if d.complete else ''}")  # fmt: skip
        for note in d.notes:
            remark(str(note))
    if late:
        raise error


@terrain_app.command("check", short_help="Does the vehicle read the terrain as planned?")
def check(
    mission: MissionArgument,
    link: LinkOption,
    points: Annotated[
        int, typer.Option("--points", metavar="N", min=1, max=100_000, help="Random places that are compared.")
    ] = 200,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Seed of the random places.")] = 1,
    spacing: SpacingOption = 100,
    as_json: JsonOption = False,
) -> None:
    """Ask with TERRAIN_CHECK what the vehicle reads, and compare it with the mission's terrain as it is served.

    The places lie anywhere in the ground that plan loads; what the vehicle lacks is served. Exit code 4 if it reads
    more than 0.5 m off, 6 if it has no height at some place.
    """
    from gcsplan.app.upload import terrain_service as terrain_link
    from gcsplan.mission_file import load_mission

    source = load_mission(mission)
    with talking([r.vehicle.name for r in source.vehicles]), _progress("{} of {} places", as_json) as report:
        found = terrain_link.compare(source, link, points=points, seed=seed, spacing_m=spacing, report=report)
    worst: GcsplanError | None = None
    rows = []
    for name, outcome in found.items():
        error = outcome if isinstance(outcome, GcsplanError) else _against(name, outcome)
        if error is not None and (worst is None or error.exit_code > worst.exit_code):
            worst = error
        rows.append(_row(name, outcome))
    if as_json:
        emit({"vehicles": rows}, None if worst is None else worst.as_dict())
        raise typer.Exit(0 if worst is None else worst.exit_code)
    from gcsplan.cli.output.console import say

    for row in rows:
        if row.get("read"):
            say(f"{row['name']}: {row['read']} of {row['places']} places read, worst {row['worst_m']:.3f} m off")
    if worst is not None:
        raise worst


def _row(name: str, outcome: TerrainComparison | GcsplanError) -> dict[str, object]:
    if isinstance(outcome, GcsplanError):
        return {"name": name, "message": outcome.message}
    worst = None if math.isnan(outcome.worst_m) else outcome.worst_m
    at = None if outcome.worst_at is None else list(outcome.worst_at)
    return {"name": name, "places": len(outcome.places_e7), "read": outcome.read, "worst_m": worst, "worst_at": at,
            "loaded": outcome.loaded, "pending": outcome.pending}  # fmt: skip


def _against(name: str, compared: TerrainComparison) -> GcsplanError | None:
    from gcsplan.world.terrain.grid import NEAR_ENOUGH_M

    if compared.worst_m > NEAR_ENOUGH_M and compared.worst_at is not None:
        lat, lon = compared.worst_at
        return CheckFailed(
            f"{name} reads terrain {compared.worst_m:.1f} m off that of the mission at {lat:.6f}, {lon:.6f}: it holds "
            "terrain from elsewhere (remove it from its SD card), or shifted it when it was armed (restart it)",
            reason="terrain",
        )
    if compared.read < len(compared.places_e7):
        missing = len(compared.places_e7) - compared.read
        return LinkError(
            f"{name} has no terrain at {missing} of {len(compared.places_e7)} places ({compared.pending} parts "
            "pending): is TERRAIN_ENABLE 1, and TERRAIN_SPACING as in --spacing?",
            reason="terrain_pending",
        )
    return None


@contextmanager
def _progress(words: str, as_json: bool) -> Iterator[Report | None]:
    """A line for each vehicle, on a terminal only."""
    from gcsplan.cli.output.console import aside

    if as_json or not aside.is_terminal:
        yield None
        return
    with aside.status("waits for the vehicle") as status:
        lines: dict[str, str] = {}

        def update(name: str, first: int, second: int) -> None:
            lines[name] = f"{name}: {words.format(first, second)}"
            status.update("  ".join(lines.values()))

        yield update
