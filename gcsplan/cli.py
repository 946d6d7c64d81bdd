"""The command line: parse, one call, print, exit code. Heavy rooms are imported by the command that needs them."""

from __future__ import annotations

import json
import os
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from gcsplan.errors import CheckFailed, GcsplanError, InputError, NoMission, UsageError

if TYPE_CHECKING:
    from gcsplan.check.verdict import Verdict
    from gcsplan.delivery import Delivery

app = typer.Typer(
    name="gcsplan",
    help="Plans MAVLink missions over real terrain, proves every metre of them, uploads and verifies them.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit codes: 0 done, 2 bad input, 3 no mission, 4 violation, 5 refused, 6 unknown or dead link, "
    "7 read-back differs.",
)
bench_app = typer.Typer(help="Measurements: legs checked a second; upload beside MAVSDK's.", no_args_is_help=True)
app.add_typer(bench_app, name="bench")

MissionArgument = Annotated[Path, typer.Argument(metavar="MISSION.yaml", help="The mission file.")]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")]
UnjudgedOption = Annotated[
    bool, typer.Option("--allow-unjudged", help="Accept a mission of which something could not be judged.")
]
SysidOption = Annotated[int, typer.Option("--sysid", min=1, max=255, help="System id of the vehicle.")]
TypeOption = Annotated[str, typer.Option("--type", help="mission, fence or rally.")]
ArmedOption = Annotated[bool, typer.Option("--allow-armed", help="Send to an armed vehicle.")]
PlaceOption = Annotated[bool, typer.Option("--ignore-position", help="Send wherever the vehicle stands.")]


def emit(document: dict[str, Any]) -> None:
    """The one JSON document of ``--json``."""
    from gcsplan.export.summary import write_summary

    sys.stdout.write(write_summary(document, clocks=True))


@app.command()
def plan(
    mission: MissionArgument,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Output directory [default: ./<mission stem>]")
    ] = None,
    planner: Annotated[str | None, typer.Option(help="A name from `gcsplan planners`.")] = None,
    objective: Annotated[str | None, typer.Option(help="length or energy.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of everything random.")] = None,
    upload: Annotated[
        list[str] | None,
        typer.Option(help="URL for all, NAME=URL for one, `link` (the file's links) or `sim`. May be repeated."),
    ] = None,
    png: Annotated[Path | None, typer.Option(help="Also draw map and profiles to this PNG.")] = None,
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
    from gcsplan.export.outdir import add_output, retire_outputs, write_outputs
    from gcsplan.sim.loopback import loopback_fleet

    directory = out or Path(mission.stem)
    try:
        source = pipeline.load_mission(mission)
        targets = delivery.targets(upload or [], [r.vehicle for r in source.vehicles])
        with planning_status() as tell:
            planned = pipeline.plan(source, planner=planner, objective=objective, seed=seed, progress=tell)
        pipeline.require_passing({v.name: v.verdict for v in planned.vehicles}, allow_unjudged=allow_unjudged)
        files = outputs.outputs_of(planned)
    except (InputError, NoMission, CheckFailed):
        moved = retire_outputs(directory)
        if moved:
            say(f"earlier outputs in {directory} were moved to {directory / 'previous'}")
        raise
    write_outputs(directory, files)
    if png is not None:
        from gcsplan.report import picture

        picture.save(planned, png)
    if not as_json:
        plan_table(planned)
        say(f"written to {directory}{os.sep}: {', '.join(files)}")
    deliveries: list[Delivery] = []
    if targets:
        jobs = delivery.jobs_of(planned, targets)
        options = delivery.Options(allow_armed=allow_armed, ignore_position=ignore_position)
        with transfer_progress([job.name for job in jobs]) as moved_on:
            deliveries = delivery.deliver(jobs, options, moved_on, simulator=loopback_fleet)
        add_output(directory, "upload.json", outputs.upload_text(planned, deliveries))
        if not as_json:
            delivery_table(deliveries)
    if as_json:
        emit(outputs.summary_of(planned, deliveries))
    raise typer.Exit(delivery.exit_code(deliveries))


@app.command()
def check(
    mission: MissionArgument,
    files: Annotated[list[str], typer.Argument(metavar="FILE...", help="FILE or NAME=FILE, .waypoints or .plan.")],
    allow_unjudged: UnjudgedOption = False,
    as_json: JsonOption = False,
) -> None:
    """Does this .waypoints or .plan (anybody's) fly safely in this mission's world?"""
    from gcsplan import checking, outputs, pipeline
    from gcsplan.console import say_notes, verdict_table

    source = pipeline.load_mission(mission)
    checked = checking.check_files(source, files)
    if as_json:
        verdicts = [outputs.verdict_of(str(c.file), c.verdict) for c in checked]
        emit({"name": source.name, "verdicts": verdicts})
    else:
        for c in checked:
            say_notes(c.notes)
            verdict_table(f"{c.file} as {c.vehicle.name}", c.verdict)
    raise typer.Exit(_verdict_code([c.verdict for c in checked], allow_unjudged))


def _verdict_code(verdicts: list[Verdict], allow_unjudged: bool) -> int:
    bad = any(v.safe is False or (v.safe is None and not allow_unjudged) for v in verdicts)
    return CheckFailed.exit_code if bad else 0


@app.command()
def upload(
    files: Annotated[list[str], typer.Argument(metavar="FILE...", help="FILE or NAME=FILE, .waypoints or .plan.")],
    to: Annotated[
        str, typer.Option("--to", metavar="URL", help="udpout:HOST:PORT, tcp:HOST:PORT, /dev/ttyUSB0,57600 …")
    ],
    mission: Annotated[Path | None, typer.Option(help="Mission file whose world the files are checked in.")] = None,
    unchecked: Annotated[bool, typer.Option("--unchecked", help="Send without any check of safety.")] = False,
    sysid: SysidOption = 1,
    allow_unjudged: UnjudgedOption = False,
    allow_armed: ArmedOption = False,
    ignore_position: PlaceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Check mission files, upload them, read them back, and compare.

    A file goes out only with a passing verdict in --mission's world, or with --unchecked.
    """
    from gcsplan import checking, delivery, pipeline
    from gcsplan.console import delivery_table, say_notes, transfer_progress, verdict_table
    from gcsplan.sim.loopback import loopback_fleet

    if (mission is None) == (not unchecked):
        raise UsageError("give either --mission FILE, in whose world the files are checked, or --unchecked")
    options = delivery.Options(allow_armed=allow_armed, ignore_position=ignore_position, unchecked=unchecked)
    if mission is not None:
        source = pipeline.load_mission(mission)
        checked = checking.check_files(source, files)
        if not as_json:
            for c in checked:
                say_notes(c.notes)
                verdict_table(f"{c.file} as {c.vehicle.name}", c.verdict)
        verdicts = {c.vehicle.name: c.verdict for c in checked}
        pipeline.require_passing(verdicts, allow_unjudged=allow_unjudged)
        jobs = delivery.jobs_of_files(source, checked, to)
    else:
        jobs = [delivery.unchecked_job(name, to, sysid) for name in files]
    with transfer_progress([job.name for job in jobs]) as moved_on:
        deliveries = delivery.deliver(jobs, options, moved_on, simulator=loopback_fleet)
    if as_json:
        emit({"vehicles": [{"name": d.vehicle} | d.as_dict() for d in deliveries]})
    else:
        delivery_table(deliveries)
    raise typer.Exit(delivery.exit_code(deliveries))


@app.command()
def verify(
    file: Annotated[Path, typer.Argument(help=".waypoints or .plan that should be on board.")],
    to: Annotated[str, typer.Option("--to", metavar="URL", help="Where the vehicle is.")],
    sysid: SysidOption = 1,
    as_json: JsonOption = False,
) -> None:
    """Is exactly this file on board? Reads the mission back and compares; sends nothing else."""
    from gcsplan import delivery
    from gcsplan.console import delivery_table

    done = delivery.verify_file(file, to, sysid)
    if as_json:
        emit(done.as_dict())
    else:
        delivery_table([done], title="verify")
    raise typer.Exit(delivery.exit_code([done]))


@app.command()
def download(
    source: Annotated[str, typer.Option("--from", metavar="URL", help="Where the vehicle is.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write: .waypoints or .plan.")],
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
        say(f"{items} items written to {out}")


@app.command()
def clear(
    to: Annotated[str, typer.Option("--to", metavar="URL", help="Where the vehicle is.")],
    sysid: SysidOption = 1,
    kind: TypeOption = "mission",
    as_json: JsonOption = False,
) -> None:
    """Remove the mission, fence or rally points on board, and read back that nothing is left."""
    from gcsplan import delivery
    from gcsplan.console import say

    delivery.clear(to, sysid, kind)
    if as_json:
        emit({"cleared": kind, "sysid": sysid})
    else:
        say(f"the {kind} of vehicle {sysid} is empty now")


@app.command()
def sim(
    mission: Annotated[
        Path | None, typer.Argument(metavar="[MISSION.yaml]", help="One vehicle for each of the mission's.")
    ] = None,
    listen: Annotated[str, typer.Option(metavar="URL", help="Where to listen.")] = "udpin:127.0.0.1:14560",
    autopilot: Annotated[
        str, typer.Option(help="arducopter, arduplane or px4 (without a mission file).")
    ] = "arducopter",
    sysid: SysidOption = 1,
    misbehave: Annotated[str, typer.Option(help="e.g. drop=0.1,duplicate=0.05,corrupt=7,seed=3")] = "",
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
    if mission is not None:
        from gcsplan.pipeline import load_mission

        stands = [
            (r.vehicle.sysid, r.vehicle.autopilot, r.start_deg, r.start[2]) for r in load_mission(mission).vehicles
        ]
    elif autopilot in list(Autopilot):
        stands = [(sysid, Autopilot(autopilot), (36.6, -84.38), 471.0)]  # a valley of the sample terrain
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


@bench_app.command("check")
def bench_check(
    legs: Annotated[int, typer.Option(help="Random one-kilometre legs.")] = 200_000,
    seed: Annotated[int, typer.Option(help="Seed of the legs.")] = 1,
    as_json: JsonOption = False,
) -> None:
    """How many one-kilometre legs are checked in a second, on the sample terrain."""
    from gcsplan.bench import check as bench

    result = bench.run(legs=legs, seed=seed)
    if as_json:
        emit(result)
    else:
        print(bench.report(result))


@bench_app.command("upload")
def bench_upload(
    items: Annotated[int, typer.Option(help="Items of the mission.")] = 600,
    runs: Annotated[int, typer.Option(help="Runs of each, in turn.")] = 5,
    as_json: JsonOption = False,
) -> None:
    """Upload to the loopback vehicle, side by side with MAVSDK's upload to the same vehicle (extra `test`)."""
    from gcsplan.bench import upload as bench

    result = bench.run(items=items, runs=runs)
    if as_json:
        emit(result)
    else:
        print(bench.report(result))


@app.callback(invoke_without_command=True)
def root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback with an error.")] = False,
) -> None:
    """Options of all commands."""
    if version:
        from gcsplan import __version__

        print(__version__)
        raise typer.Exit


def main() -> NoReturn:
    """Entry point: runs a command and ends with its exit code; one message, no traceback (``--debug`` shows it)."""
    debug = "--debug" in sys.argv
    arguments = [a for a in sys.argv[1:] if a != "--debug"]
    as_json = "--json" in arguments
    try:
        # Outside standalone mode click hands typer.Exit's code back instead of exiting.
        code = app(args=arguments, prog_name="gcsplan", standalone_mode=False)
        sys.stdout.flush()
        sys.exit(code if isinstance(code, int) else 0)
    except GcsplanError as error:
        fail(error, error.exit_code, error.reason, as_json, debug)
    except (KeyboardInterrupt, typer.Abort):
        fail(GcsplanError("interrupted"), 130, "interrupted", as_json, debug)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except Exception as error:  # the one place where a bug of ours becomes an exit code
        told = getattr(error, "format_message", None)  # click's usage errors, whichever click typer brings along
        if told is not None:
            usage = type(error).__name__ != "NoArgsIsHelpError"
            fail(UsageError(f"{told()} (see gcsplan --help)" if usage else told()), 2, "usage", as_json, debug)
        words = f"internal error, a bug in gcsplan: {type(error).__name__}: {error} (--debug shows where)"
        fail(GcsplanError(words), 70, "internal", as_json, debug)


def fail(error: GcsplanError, code: int, reason: str, as_json: bool, debug: bool) -> NoReturn:
    """One message on standard error, one JSON document if asked, and the exit code."""
    if debug:
        traceback.print_exc()
    print(f"gcsplan: {error}", file=sys.stderr)
    if as_json:
        document = {"error": {"code": code, "reason": reason, "message": error.message, "where": error.where}}
        if isinstance(error, InputError):
            document["error"]["problems"] = [{"where": p.where, "message": p.message} for p in error.problems]
        print(json.dumps(document, ensure_ascii=False))
    sys.exit(code)


if __name__ == "__main__":
    main()
