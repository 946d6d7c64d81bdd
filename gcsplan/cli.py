"""The command line: parse, one call, print, exit code. Heavy rooms are imported by the command that needs them."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from gcsplan.benches import bench_app
from gcsplan.ending import Interrupted, emit, explained, fail, put, speak_plainly, talking
from gcsplan.errors import CheckFailed, GcsplanError, InputError, NoMission, UsageError
from gcsplan.options import (
    LINKS,
    ArmedOption,
    AutopilotOption,
    FilesArgument,
    JsonOption,
    ListenOption,
    MisbehaveOption,
    MissionArgument,
    PlaceOption,
    SimSysidOption,
    SysidOption,
    ToOption,
    TypeOption,
    UncheckedSysidOption,
    UnjudgedOption,
)

if TYPE_CHECKING:
    from gcsplan.delivery import Delivery

app = typer.Typer(
    name="gcsplan",
    help="Plans MAVLink missions over real terrain, proves every metre of them, uploads and verifies them.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit codes: 0 done, 2 bad input, 3 no mission, 4 violation, 5 refused, 6 unknown or dead link, "
    "7 read-back differs, 70 a bug of ours, 130 interrupted.",
)
app.add_typer(bench_app, name="bench")


@app.command(short_help="Plan a mission file; upload and verify if asked.")
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


@app.command(short_help="Does a file fly safely in a mission's world?")
def check(
    mission: MissionArgument,
    files: FilesArgument,
    allow_unjudged: UnjudgedOption = False,
    as_json: JsonOption = False,
) -> None:
    """Does this .waypoints or .plan (anybody's) fly safely in this mission's world?

    The file's name (uav1.plan) or NAME= says which vehicle of the mission it is for.
    """
    from gcsplan import checking, outputs, pipeline
    from gcsplan.console import say_notes, verdict_table

    source = pipeline.load_mission(mission)
    checked = checking.check_files(source, files)
    if as_json:
        verdicts = [outputs.verdict_of(str(c.file), c.verdict) for c in checked]
        emit({"name": source.name, "verdicts": verdicts}, checking.failure(checked, allow_unjudged=allow_unjudged))
    else:
        for c in checked:
            say_notes(c.notes)
            verdict_table(f"{c.file} as {c.vehicle.name}", c.verdict)
    raise typer.Exit(CheckFailed.exit_code if checking.failure(checked, allow_unjudged=allow_unjudged) else 0)


@app.command(short_help="Check files, upload them, read them back, compare.")
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
        Path | None, typer.Option(metavar="MISSION.yaml", help="Mission file whose world the files are checked in.")
    ] = None,
    unchecked: Annotated[bool, typer.Option("--unchecked", help="Send without any check of safety.")] = False,
    sysid: UncheckedSysidOption = None,
    allow_unjudged: UnjudgedOption = False,
    allow_armed: ArmedOption = False,
    ignore_position: PlaceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Check mission files, upload them, read them back, and compare.

    A file goes out only with a passing verdict in --mission's world, or with --unchecked. The file's name (uav1.plan)
    or NAME= says which vehicle of the mission it is for.
    """
    from gcsplan import checking, delivery, pipeline
    from gcsplan.console import delivery_table, say_notes, transfer_progress, verdict_table
    from gcsplan.sim.loopback import loopback_fleet

    if (mission is None) == (not unchecked):
        raise UsageError("give either --mission FILE, in whose world the files are checked, or --unchecked")
    options = delivery.Options(allow_armed=allow_armed, ignore_position=ignore_position, unchecked=unchecked)
    if mission is not None:
        if sysid is not None:
            raise UsageError(
                "--sysid goes with --unchecked: with --mission each vehicle's number is the mission file's"
            )
        source = pipeline.load_mission(mission)
        delivery.targets([to], [r.vehicle for r in source.vehicles])  # a slip in the URL shows before the tables do
        checked = checking.check_files(source, files)
        if not as_json:
            for c in checked:
                say_notes(c.notes)
                verdict_table(f"{c.file} as {c.vehicle.name}", c.verdict)
        verdicts = {c.vehicle.name: c.verdict for c in checked}
        pipeline.require_passing(verdicts, allow_unjudged=allow_unjudged)
        jobs = delivery.jobs_of_files(source, checked, to)
    else:
        if len(files) > 1:
            raise UsageError("--unchecked takes one FILE, for the vehicle --sysid; send the others one by one")
        jobs = [delivery.unchecked_job(files[0], to, sysid or 1)]
    names = [job.name for job in jobs]
    with talking(names), transfer_progress(names) as moved_on:
        deliveries = delivery.deliver(jobs, options, moved_on, simulator=loopback_fleet)
    if as_json:
        emit({"vehicles": [{"name": d.vehicle} | d.as_dict() for d in deliveries]}, delivery.failure(deliveries))
    else:
        delivery_table(deliveries)
    raise typer.Exit(delivery.exit_code(deliveries))


@app.command(short_help="Is exactly this file on board?")
def verify(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The .waypoints or .plan that should be on board.")],
    to: ToOption,
    sysid: SysidOption = 1,
    as_json: JsonOption = False,
) -> None:
    """Is exactly this file on board? Reads the mission back and compares; sends nothing else."""
    from gcsplan import delivery
    from gcsplan.console import delivery_table

    done = delivery.verify_file(file, to, sysid)
    if as_json:
        emit(done.as_dict(), delivery.failure([done]))
    else:
        delivery_table([done], title="verify")
    raise typer.Exit(delivery.exit_code([done]))


@app.command()
def download(
    source: Annotated[str, typer.Option("--from", metavar="URL", help=f"Where the vehicle is: {LINKS}")],
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="FILE", help="File to write, .waypoints or .plan; replaced if there.")
    ],
    sysid: SysidOption = 1,
    as_json: JsonOption = False,
) -> None:
    """Read the mission on board into a file."""
    from gcsplan import delivery
    from gcsplan.console import say

    items = delivery.download_to(source, sysid, out)
    if as_json:
        emit({"file": str(out), "items": items})
    else:
        say(f"{items} item{'' if items == 1 else 's'} written to {out}")


@app.command(short_help="Remove the mission, fence or rally points.")
def clear(
    to: ToOption,
    sysid: SysidOption = 1,
    kind: TypeOption = "mission",
    allow_armed: ArmedOption = False,
    as_json: JsonOption = False,
) -> None:
    """Remove the mission, fence or rally points on board, and read back that nothing is left."""
    from gcsplan import delivery
    from gcsplan.console import say

    with talking([f"vehicle {sysid}"]):
        delivery.clear(to, sysid, kind, allow_armed=allow_armed)
    if as_json:
        emit({"cleared": kind, "sysid": sysid})
    else:
        what = {"rally": "list of rally points"}.get(kind, kind)
        say(f"the {what} of vehicle {sysid} is empty now")


@app.command(short_help="Loopback vehicles that take missions.")
def sim(
    mission: Annotated[
        Path | None, typer.Argument(metavar="MISSION.yaml", help="One vehicle for each of the mission's.")
    ] = None,
    listen: ListenOption = "udpin:127.0.0.1:14560",
    autopilot: AutopilotOption = None,
    sysid: SimSysidOption = None,
    misbehave: MisbehaveOption = "",
) -> None:
    """A loopback vehicle (or one for each of the mission's vehicles) that takes missions like a real one.

    Ctrl-C ends it.
    """
    from gcsplan.console import say
    from gcsplan.sim.misbehaviour import Misbehaviour
    from gcsplan.sim.server import SimServer, serve
    from gcsplan.sim.vehicle import LoopbackVehicle
    from gcsplan.vehicle import Autopilot

    trouble = Misbehaviour.parse(misbehave)
    if mission is not None and (autopilot is not None or sysid is not None):
        raise UsageError("--autopilot and --sysid go without a mission file: its vehicles have their own")
    if mission is not None:
        from gcsplan.pipeline import load_mission

        stands = [
            (r.vehicle.sysid, r.vehicle.autopilot, r.start_deg, r.start[2]) for r in load_mission(mission).vehicles
        ]
    elif autopilot is None or autopilot in list(Autopilot):
        kind = Autopilot(autopilot or Autopilot.ARDUCOPTER)
        stands = [(sysid or 1, kind, (36.6, -84.38), 471.0)]  # a valley of the sample terrain
    else:
        raise UsageError(f"--autopilot {autopilot}: one of {', '.join(Autopilot)} is wanted")
    vehicles = [
        LoopbackVehicle(number, kind, lat_deg=place[0], lon_deg=place[1], amsl_m=amsl_m, misbehave=trouble)
        for number, kind, place, amsl_m in stands
    ]

    def ready(server: SimServer) -> None:
        names = ", ".join(f"system {v.sysid} ({v.autopilot})" for v in vehicles)
        say(f"simulating {names}; connect to {server.url_for_gcs}; Ctrl-C ends it")

    serve(vehicles, listen, on_ready=ready)


@app.command()
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


@app.callback(invoke_without_command=True)
def root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback with an error.")] = False,
) -> None:
    """Options of all commands."""
    if version:
        from gcsplan import __version__

        put(f"{__version__}\n")
        raise typer.Exit


def main() -> NoReturn:
    """Entry point: runs a command and ends with its exit code; one message, no traceback (``--debug`` shows it)."""
    debug = "--debug" in sys.argv
    arguments = [a for a in sys.argv[1:] if a != "--debug"]
    as_json = "--json" in arguments
    speak_plainly()
    try:
        # Outside standalone mode click hands typer.Exit's code back instead of exiting.
        code = app(args=arguments, prog_name="gcsplan", standalone_mode=False)
        if code == Interrupted.exit_code:  # what typer makes of Ctrl-C
            raise KeyboardInterrupt
        put("")
        sys.exit(code if isinstance(code, int) else 0)
    except GcsplanError as error:
        fail(error, as_json, debug)
    except (KeyboardInterrupt, typer.Abort):
        fail(Interrupted("interrupted"), as_json, debug)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except MemoryError:
        words = "not enough memory for this: give a smaller area, coarser terrain, fewer zones or items"
        fail(InputError(words, reason="memory"), as_json, debug)
    except Exception as error:  # the one place where a bug of ours becomes an exit code
        fail(explained(error), as_json, debug)


if __name__ == "__main__":
    main()
