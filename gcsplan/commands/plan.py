"""`gcsplan plan` and `gcsplan planners`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcsplan.commands.ending import emit, talking
from gcsplan.commands.options import LINKS, ArmedOption, JsonOption, MissionArgument, PlaceOption, UnjudgedOption
from gcsplan.errors import CheckFailed, InputError, NoMission, UsageError

if TYPE_CHECKING:
    from gcsplan.delivery import Delivery


def plan(
    mission: MissionArgument,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Output directory [default: ./<mission stem>]")
    ] = None,
    planner: Annotated[str | None, typer.Option(metavar="NAME", help="A name from `gcsplan planners`.")] = None,
    objective: Annotated[str | None, typer.Option(metavar="WHAT", help="length or energy.")] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", help="Seed of everything random.")] = None,
    encoding: Annotated[
        str | None, typer.Option(metavar="NAME", help="A swarm's encoding: box, sections, polar, bspline, offsets.")
    ] = None,
    cost: Annotated[
        str | None, typer.Option(metavar="NAME", help="A swarm's cost: krill, ssgwo, msfoa, abo, ib-abc.")
    ] = None,
    upload: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WHERE",
            help="A URL for all vehicles, NAME=URL for one, `link` (the mission file's links) or `sim` (simulated "
            f"vehicles). May be repeated. URLs: {LINKS}",
        ),
    ] = None,
    png: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Also draw map and profiles to this picture.")
    ] = None,
    allow_unjudged: UnjudgedOption = False,
    allow_armed: ArmedOption = False,
    ignore_position: PlaceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Plan a mission file, write its outputs, and upload and verify them if asked.

    Without --upload nothing is ever sent. The outputs are written whole or not at all; where no safe mission
    exists, earlier outputs are moved to DIR/previous, so that no old mission is flown by mistake.
    """
    from gcsplan import delivery, outputs, pipeline
    from gcsplan.console import delivery_table, plan_table, planning_status, say, transfer_progress
    from gcsplan.export.outdir import add_output, retire_outputs, write_outputs, write_whole
    from gcsplan.planners import table

    directory = Path(mission.stem) if out is None else out
    if planner is not None:
        try:
            table.get(planner)
        except InputError as error:
            raise UsageError(f"--planner: {error}") from None
    if objective not in (None, "length", "energy"):
        raise UsageError(f"--objective {objective}: length or energy is wanted")
    if png is not None and (png.suffix.lower() != ".png" or not (png.parent.is_dir() or png.parent == directory)):
        raise UsageError(f"--png {png}: a name that ends in .png, in a directory that is there, is wanted")
    try:
        source = pipeline.load_mission(mission)
        targets = delivery.targets(upload or [], [r.vehicle for r in source.vehicles])
        with planning_status() as tell:
            told = {k: v for k, v in (("encoding", encoding), ("cost", cost)) if v is not None}
            planned = pipeline.plan(
                source, planner=planner, objective=objective, seed=seed, options=told, progress=tell
            )
        pipeline.require_passing({v.name: v.verdict for v in planned.vehicles}, allow_unjudged=allow_unjudged)
        files = outputs.outputs_of(planned)
    except UsageError:
        raise  # a slip on the command line says nothing against an earlier mission
    except (InputError, NoMission, CheckFailed):
        moved = retire_outputs(directory)
        if moved:
            say(f"earlier outputs in {directory} were moved to {directory / 'previous'}")
        raise
    picture = None if png is None else outputs.picture_of(planned)
    in_the_way = write_outputs(directory, files)
    if png is not None and picture is not None:
        write_whole(png, picture)
    if in_the_way:
        say(f"{', '.join(in_the_way)} in {directory} were not gcsplan's, and were moved to {directory / 'previous'}")
    if not as_json:
        plan_table(planned)
        say(f"written to {directory}{os.sep}: {', '.join(files)}")
    deliveries: list[Delivery] = []
    if targets:
        from gcsplan.sim.loopback import loopback_fleet

        jobs = delivery.jobs_of(planned, targets)
        options = delivery.Options(allow_armed=allow_armed, ignore_position=ignore_position)
        names = [job.name for job in jobs]
        with talking(names), transfer_progress(names) as moved_on:
            deliveries = delivery.deliver(jobs, options, moved_on, simulator=loopback_fleet)
        if not as_json:
            delivery_table(deliveries)
        try:
            add_output(directory, "upload.json", outputs.upload_text(planned, deliveries))
        except InputError as error:  # what became of the upload matters more
            say(f"note: upload.json is not written: {error}")
    if as_json:
        emit(outputs.summary_of(planned, deliveries), delivery.failure(deliveries))
    raise typer.Exit(delivery.exit_code(deliveries))


def planners(as_json: JsonOption = False) -> None:
    """The table of planners, with paper and default parameters."""
    from gcsplan.console import planners_table
    from gcsplan.planners import table

    rows = [
        {"name": e.name, "summary": e.summary, "paper": e.paper, "defaults": dict(e.defaults)}
        for e in table.TABLE.values()
    ]
    if as_json:
        emit({"planners": rows})
    else:
        planners_table(rows)
