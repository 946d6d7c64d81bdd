"""The command line: parse, one call, print, exit code. Heavy rooms are imported by the command that needs them."""

from __future__ import annotations

import io
import json
import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NoReturn

import typer

from gcsplan.errors import CheckFailed, GcsplanError, InputError, NoMission, UsageError

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
bench_app = typer.Typer(help="Measurements: legs checked a second; upload beside MAVSDK's.", no_args_is_help=True)
app.add_typer(bench_app, name="bench")

LINKS = "udpout:HOST:PORT sends, udpin:HOST:PORT listens, tcp:HOST:PORT, /dev/ttyUSB0,57600."
MISBEHAVIOURS = (
    "drop, duplicate, reorder, delay (probabilities), delay_s, corrupt (an item), corrupt_field, silent_after "
    "(messages), reboot_at (an item), reboot_s, reboot_loses, edit (an item), stray_sysid, stale_type, answer_sysid, "
    "refuse (an item), refuse_code, no_space, armed, seed"
)

MissionArgument = Annotated[Path, typer.Argument(metavar="MISSION.yaml", help="The mission file.")]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")]
UnjudgedOption = Annotated[
    bool, typer.Option("--allow-unjudged", help="Accept a mission of which something could not be judged.")
]
SysidOption = Annotated[
    int, typer.Option("--sysid", metavar="N", min=1, max=255, help="System id of the vehicle, 1 to 255.")
]
ToOption = Annotated[str, typer.Option("--to", metavar="URL", help=f"Where the vehicle is: {LINKS}")]
FilesArgument = Annotated[
    list[str], typer.Argument(metavar="FILE...", help="FILE or NAME=FILE (the vehicle's name); .waypoints or .plan.")
]
TypeOption = Annotated[str, typer.Option("--type", metavar="KIND", help="mission, fence or rally.")]
ArmedOption = Annotated[bool, typer.Option("--allow-armed", help="Send to an armed vehicle.")]
PlaceOption = Annotated[bool, typer.Option("--ignore-position", help="Send wherever the vehicle stands.")]


class Interrupted(GcsplanError):
    """Ctrl-C while vehicles were being talked to: says what is to be done about them."""

    exit_code: ClassVar[int] = 130
    default_reason: ClassVar[str] = "interrupted"


def emit(document: dict[str, Any], error: dict[str, Any] | None = None) -> None:
    """The one JSON document of ``--json``, with what went wrong."""
    from gcsplan.export.summary import write_summary

    put(write_summary(document | ({"error": error} if error else {}), clocks=True))


def put(text: str) -> None:
    """Write to standard output, now: what does not arrive there is an error. Raises InputError (or BrokenPipeError)."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except (OSError, AttributeError) as error:  # a full disk; a standard output that was closed is None
        with suppress(OSError, AttributeError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        words = getattr(error, "strerror", None) or "it is closed"
        raise InputError(f"cannot be written: {words}", where="standard output") from error


@contextmanager
def talking(names: list[str]) -> Iterator[None]:
    """Around a conversation with vehicles: Ctrl-C in it leaves something to be told."""
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(
            f"interrupted while talking to {', '.join(names)}: a transfer under way was broken off, and the vehicle "
            f"told so; what it holds now is unknown: send it again, or compare with gcsplan verify"
        ) from None


@app.command()
def plan(
    mission: MissionArgument,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Output directory [default: ./<mission stem>]")
    ] = None,
    planner: Annotated[str | None, typer.Option(metavar="NAME", help="A name from `gcsplan planners`.")] = None,
    objective: Annotated[str | None, typer.Option(metavar="WHAT", help="length or energy.")] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", help="Seed of everything random.")] = None,
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
    from gcsplan.sim.loopback import loopback_fleet

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
            planned = pipeline.plan(source, planner=planner, objective=objective, seed=seed, progress=tell)
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


@app.command()
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


@app.command()
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
    sysid: Annotated[
        int | None,
        typer.Option(
            "--sysid", metavar="N", min=1, max=255, help="With --unchecked: system id of the vehicle [default: 1]"
        ),
    ] = None,
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


@app.command()
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


@app.command()
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


@app.command()
def sim(
    mission: Annotated[
        Path | None, typer.Argument(metavar="MISSION.yaml", help="One vehicle for each of the mission's.")
    ] = None,
    listen: Annotated[
        str,
        typer.Option(metavar="URL", help="udpin:HOST:PORT or tcpin:HOST:PORT listens, udpout:HOST:PORT speaks first."),
    ] = "udpin:127.0.0.1:14560",
    autopilot: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Without a mission file: arducopter, arduplane or px4 [default: arducopter]"),
    ] = None,
    sysid: Annotated[
        int | None,
        typer.Option("--sysid", metavar="N", min=1, max=255, help="Without a mission file: system id [default: 1]"),
    ] = None,
    misbehave: Annotated[
        str,
        typer.Option(metavar="HOW", help=f"Trouble, for example drop=0.1,corrupt=7,seed=3. Known: {MISBEHAVIOURS}."),
    ] = "",
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


@bench_app.command("check")
def bench_check(
    legs: Annotated[int, typer.Option(metavar="N", help="Random one-kilometre legs.")] = 200_000,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of the legs.")] = 1,
    as_json: JsonOption = False,
) -> None:
    """How many one-kilometre legs are checked in a second, on the sample terrain."""
    from gcsplan.bench import check as bench

    result = bench.run(legs=legs, seed=seed)
    if as_json:
        emit(result)
    else:
        put(bench.report(result) + "\n")


@bench_app.command("upload")
def bench_upload(
    items: Annotated[int, typer.Option(metavar="N", help="Items of the mission.")] = 600,
    runs: Annotated[int, typer.Option(metavar="N", help="Runs of each, in turn.")] = 5,
    as_json: JsonOption = False,
) -> None:
    """Upload to the loopback vehicle, side by side with MAVSDK's upload to the same vehicle (extra `test`)."""
    from gcsplan.bench import upload as bench

    result = bench.run(items=items, runs=runs)
    if as_json:
        emit(result)
    else:
        put(bench.report(result) + "\n")


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
    _speak_plainly()
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
        fail(_explained(error), as_json, debug)


def _speak_plainly() -> None:
    """JSON is UTF-8 everywhere, and no terminal or pipe is so poor that a ° or a – would end the program."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8" if "--json" in sys.argv else None, errors="backslashreplace")


def _explained(error: Exception) -> GcsplanError:
    """What an exception that is none of ours amounts to."""
    told = getattr(error, "format_message", None)  # click's usage errors, whichever click typer brings along
    if told is not None:
        context = getattr(error, "ctx", None)
        if type(error).__name__ == "NoArgsIsHelpError":
            return UsageError(f"a command is wanted\n\n{told()}")
        return UsageError(f"{told()} (see {context.command_path if context else 'gcsplan'} --help)")
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, KeyboardInterrupt):  # compiled code turns Ctrl-C into an error of its own
            return Interrupted("interrupted")
        cause = cause.__cause__ or cause.__context__
    return GcsplanError(f"internal error, a bug in gcsplan: {type(error).__name__}: {error} (--debug shows where)")


def fail(error: GcsplanError, as_json: bool, debug: bool) -> NoReturn:
    """One message on standard error, one JSON document if asked, and the exit code."""
    code = error.exit_code
    if debug:
        traceback.print_exc()
    with suppress(OSError):  # there is nobody left to tell
        # Names of files and values come from anywhere: none of them may speak to the terminal.
        words = "".join(c if c.isprintable() or c in "\n\u2009" else "\ufffd" for c in str(error))
        print(f"gcsplan: {words}", file=sys.stderr)
    if as_json:
        document = {"code": code, "reason": error.reason, "message": error.message, "where": error.where}
        if isinstance(error, InputError):
            document["problems"] = [{"where": p.where, "message": p.message} for p in error.problems]
        with suppress(InputError, BrokenPipeError):
            put(json.dumps({"error": document}) + "\n")
    sys.exit(code)


if __name__ == "__main__":
    main()
