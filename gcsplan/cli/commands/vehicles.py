"""The commands that talk to vehicles: `gcsplan upload`, `verify`, `download`, `clear`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gcsplan.cli.arguments import completion
from gcsplan.cli.arguments.options import (
    LINKS,
    ArmedOption,
    AtomicOption,
    AtOption,
    FenceInfiniteOption,
    FenceOption,
    FilesArgument,
    JsonOption,
    ParametersOption,
    PlaceOption,
    RallyOption,
    RequireWayHomeOption,
    SysidOption,
    TimeoutOption,
    ToOption,
    TypeOption,
    UncheckedSysidOption,
    UnitsChoice,
    UnitsOption,
    UnjudgedOption,
    UnlessMissionSysidOption,
    WayHomeOption,
)
from gcsplan.cli.process.exit import emit, talking
from gcsplan.errors import UsageError
from gcsplan.figures import counted


def upload(
    files: FilesArgument,
    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="URL",
            help=f"Where the vehicles are: {LINKS} With --mission also `link`, `sim` or NAME=URL, as in plan --upload.",
        ),
    ],
    mission: Annotated[
        Path | None,
        typer.Option(
            metavar="MISSION.yaml",
            autocompletion=completion.missions,
            help="Mission file whose world the files are checked in.",
        ),
    ] = None,
    unchecked: Annotated[bool, typer.Option("--unchecked", help="Send without any check of safety.")] = False,
    at: AtOption = None,
    sysid: UncheckedSysidOption = None,
    way_home: WayHomeOption = False,
    require_way_home: RequireWayHomeOption = False,
    units: UnitsOption = UnitsChoice.METRIC,
    allow_unjudged: UnjudgedOption = False,
    allow_armed: ArmedOption = False,
    ignore_position: PlaceOption = False,
    allow_parameters: ParametersOption = False,
    atomic: AtomicOption = False,
    fence: FenceOption = False,
    fence_infinite: FenceInfiniteOption = False,
    rally: RallyOption = False,
    timeout: TimeoutOption = 60.0,
    as_json: JsonOption = False,
) -> None:
    """Check mission files, upload them, read them back, and compare.

    A file is sent only with a passing verdict in --mission's world, or with --unchecked. The file's name (uav1.plan) or
    NAME= states which vehicle of the mission it is for.
    """
    from gcsplan.app.check import files as checking
    from gcsplan.app.check import worlds as check_sites
    from gcsplan.app.fleet import pipeline
    from gcsplan.app.fleet.may_fly import require_passing
    from gcsplan.app.plan import way_home as returns
    from gcsplan.app.upload import fence as fencing
    from gcsplan.app.upload import run as uploads
    from gcsplan.app.upload.job import UploadOptions
    from gcsplan.cli.output.console import say_notes, say_notes_of, transfer_progress, upload_table
    from gcsplan.cli.output.verdict_table import say_warnings, verdict_table
    from gcsplan.export.outdir import require_settled, steady
    from gcsplan.notes.note import Wording
    from gcsplan.sim.vehicle.server import loopback_fleet
    from gcsplan.units import units_of

    if (mission is None) == (not unchecked):
        raise UsageError("give either --mission FILE, in whose world the files are checked, or --unchecked")
    if unchecked and at is not None:
        raise UsageError("--at decides which zones of a mission file count: give --mission FILE instead of --unchecked")
    if unchecked and fence_infinite:
        raise UsageError("--fence-infinite is about the zones of a mission file: give --mission FILE, not --unchecked")
    if unchecked and (way_home or require_way_home):
        raise UsageError("the way home is judged in the world of a mission file: give --mission FILE, not --unchecked")
    options = UploadOptions(
        allow_armed=allow_armed, ignore_position=ignore_position, unchecked=unchecked, atomic=atomic,
        timeout_s=timeout, allow_parameters=allow_parameters,
    )  # fmt: skip
    if mission is not None:
        if sysid is not None:
            raise UsageError(
                "--sysid goes with --unchecked: with --mission each vehicle's number is the mission file's"
            )
        source = pipeline.load_mission(mission, at=at)
        returned = check_sites.Returns(way_home, require_way_home, rally=rally)
        uploads.targets([to], [r.vehicle for r in source.vehicles])  # report a wrong URL before any table
        with steady(check_sites.split_name(file)[1] for file in files):
            checked = checking.check_files(source, files, returns=returned)
        if not as_json:
            wording = Wording(units_of(units))
            for c in checked:
                say_notes(c.notes, wording)
                name = f"{c.file} as {c.vehicle.name}"
                verdict_table(name, c.verdict, c.way_home, wording=wording, energy=c.vehicle.energy)
        verdicts = {c.vehicle.name: c.verdict for c in checked}
        require_passing(verdicts, allow_unjudged=allow_unjudged)
        homes = {c.vehicle.name: c.way_home for c in checked}
        returns.require(homes, required=returns.is_required(source, require_way_home))
        if not as_json:
            say_warnings(homes, Wording(units_of(units)))
        jobs = uploads.jobs_of_files(source, checked, to)
    else:
        if len(files) > 1:
            raise UsageError("--unchecked takes one FILE, for the vehicle --sysid; send the others one by one")
        require_settled([check_sites.split_name(files[0])[1]])
        job, notes = uploads.unchecked_job(files[0], to, sysid or 1)
        jobs = [job]
        say_notes(notes, Wording(units_of(units)))
    jobs, list_notes = fencing.with_lists(jobs, fencing.ListsSent(fence, rally, fence_infinite))
    say_notes_of(list_notes, Wording(units_of(units)))
    names = [job.name for job in jobs]
    with talking(names), transfer_progress(names) as moved_on:
        results = uploads.run_jobs(jobs, options, moved_on, simulator=loopback_fleet)
    if as_json:
        emit({"vehicles": [{"name": d.vehicle} | d.as_dict() for d in results]}, uploads.failure(results))
    else:
        upload_table(results)
    raise typer.Exit(uploads.exit_code(results))


def verify(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="The .waypoints or .plan that should be on board; with --mission also NAME=FILE (the vehicle's name).",
        ),
    ],
    to: ToOption,
    mission: Annotated[
        Path | None,
        typer.Option(
            metavar="MISSION.yaml",
            autocompletion=completion.missions,
            help="Mission file in whose world the mission on board is judged again.",
        ),
    ] = None,
    tolerance_m: Annotated[
        float | None,
        typer.Option(
            "--tolerance-m",
            metavar="M",
            help="With --mission: accept positions this far away, in metres, if the mission on board is safe "
            "[default: 0]",
        ),
    ] = None,
    at: AtOption = None,
    sysid: UnlessMissionSysidOption = None,
    allow_parameters: ParametersOption = False,
    timeout: TimeoutOption = 60.0,
    as_json: JsonOption = False,
) -> None:
    """Check that exactly this file is on board: read the mission back and compare; the vehicle keeps what it has.

    With --mission the whole mission on board is also judged, with the vehicle's parameters: exit 4 if it is not safe.
    """
    from gcsplan.app.check import worlds as check_sites
    from gcsplan.app.fleet import pipeline
    from gcsplan.app.upload import position_tolerance as shifts
    from gcsplan.app.upload import run as uploads
    from gcsplan.cli.output.console import upload_table
    from gcsplan.export.outdir import require_settled

    if mission is not None and sysid is not None:
        raise UsageError("--sysid goes without --mission: with it the vehicle's number is the mission file's")
    if mission is None and at is not None:
        raise UsageError("--at decides which zones of a mission file count: give --mission FILE, too")
    shifts.require_tolerance(tolerance_m, judged=mission is not None)
    require_settled([check_sites.split_name(file)[1]])
    source = None if mission is None else pipeline.load_mission(mission, at=at)
    done = uploads.verify_file(
        file, to, sysid or 1, source=source, tolerance_m=tolerance_m, timeout_s=timeout,
        allow_parameters=allow_parameters,
    )  # fmt: skip
    if as_json:
        emit(done.as_dict(), uploads.failure([done]))
    else:
        upload_table([done], title="verify")
    raise typer.Exit(uploads.exit_code([done]))


def download(
    source: Annotated[str, typer.Option("--from", metavar="URL", help=f"Where the vehicle is: {LINKS}")],
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="FILE", help="File to write, .waypoints or .plan; replaced if there.")
    ],
    sysid: SysidOption = 1,
    timeout: TimeoutOption = 60.0,
    as_json: JsonOption = False,
) -> None:
    """Read the mission on board into a file."""
    from gcsplan.app.upload import run as uploads
    from gcsplan.cli.output.console import say

    items = len(uploads.download_to(source, sysid, out, timeout_s=timeout).wire_items())
    if as_json:
        emit({"file": str(out), "items": items})
    else:
        say(f"{counted(items, 'item')} written to {out}")


def clear(
    to: ToOption,
    sysid: SysidOption = 1,
    kind: TypeOption = "mission",
    allow_armed: ArmedOption = False,
    timeout: TimeoutOption = 60.0,
    as_json: JsonOption = False,
) -> None:
    """Remove the mission, fence or rally points on board, and read back that nothing is left."""
    from gcsplan.app.upload import run as uploads
    from gcsplan.cli.output.console import say

    with talking([f"vehicle {sysid}"]):
        uploads.clear(to, sysid, kind, allow_armed=allow_armed, timeout_s=timeout)
    if as_json:
        emit({"cleared": kind, "sysid": sysid})
    else:
        what = {"rally": "list of rally points"}.get(kind, kind)
        say(f"the {what} of vehicle {sysid} is empty now")
