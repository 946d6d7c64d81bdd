"""`gcsplan plan` and `gcsplan planners`."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gcsplan.cli.arguments import completion
from gcsplan.cli.arguments.changes import (
    AvoidFileOption,
    AvoidOption,
    GoalOption,
    MaxAglOption,
    MinAglOption,
    SaveOption,
    SpeedOption,
    StartOption,
    ViaOption,
    WindOption,
    ZonesInsteadOption,
    changes_of,
)
from gcsplan.cli.arguments.options import (
    LINKS,
    ArmedOption,
    AtomicOption,
    AtOption,
    ClusterOption,
    DatumOption,
    HeightUnitOption,
    JobsOption,
    JsonOption,
    LeaveOutOption,
    ListZonesOption,
    MissionArgument,
    NodataOption,
    ObjectiveOption,
    ParametersOption,
    PlaceOption,
    PlannerOption,
    RequireWayHomeOption,
    SeedOption,
    TimeoutOption,
    UnitsChoice,
    UnitsOption,
    UnjudgedOption,
    WayHomeOption,
    terrain_keys,
)
from gcsplan.cli.process.exit import complain, emit, talking
from gcsplan.errors import CheckFailed, InputError, NoMission, UsageError

if TYPE_CHECKING:
    from gcsplan.app.output.handout import Handout
    from gcsplan.app.plan.earlier import EarlierMission
    from gcsplan.app.plan.model import Plan
    from gcsplan.app.upload.job import JobResult
    from gcsplan.mission_file import MissionFile
    from gcsplan.mission_file.changes import MissionChange
    from gcsplan.notes.note import Note
    from gcsplan.units import Units

MOST_NAMED = 15
"""Names of written files that are printed at most; a fleet has hundreds of files."""


EncodingOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        autocompletion=completion.encodings,
        help="A swarm's encoding: paper (its paper's), box, sections, sections-whole, polar, polar-signed, "
        "bspline, offsets.",
    ),
]
CostOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", autocompletion=completion.costs, help="A swarm's cost: krill, ssgwo, msfoa, abo, ib-abc."
    ),
]
WarmStartOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", help="A swarm begins around this path: `optimal`, the default planner's, or a vehicle's."
    ),
]


def plan(
    mission: MissionArgument,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Output directory [default: ./<mission stem>]")
    ] = None,
    planner: PlannerOption = None,
    objective: ObjectiveOption = None,
    avoid: AvoidOption = None,
    avoid_file: AvoidFileOption = None,
    zones: ZonesInsteadOption = None,
    max_agl: MaxAglOption = None,
    min_agl: MinAglOption = None,
    start: StartOption = None,
    goal: GoalOption = None,
    via: ViaOption = None,
    speed: SpeedOption = None,
    wind: WindOption = None,
    save: SaveOption = False,
    seed: SeedOption = None,
    encoding: EncodingOption = None,
    cost: CostOption = None,
    warm_start: WarmStartOption = None,
    upload: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WHERE",
            autocompletion=completion.words("sim", "link"),
            help="A URL for all vehicles, NAME=URL for one, `link` (the mission file's links) or `sim` (simulated "
            f"vehicles). May be repeated. URLs: {LINKS}",
        ),
    ] = None,
    gate_utc: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help="The common start as a time of day, UTC (18:30:00): every vehicle waits in the air for its own "
            "second. ArduCopter alone; needs --allow-unjudged, for nobody knows how long it will wait.",
        ),
    ] = None,
    compare_to: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WHERE",
            autocompletion=completion.words("link"),
            help="Say what changes to the missions on board, too: a URL for all vehicles, NAME=URL for one, or `link`. "
            "Nothing is written to a vehicle.",
        ),
    ] = None,
    at: AtOption = None,
    report: Annotated[
        bool, typer.Option("--report", help="Also write report.html: map, profiles, way home, fleet; one page.")
    ] = False,
    way_home: WayHomeOption = False,
    require_way_home: RequireWayHomeOption = False,
    apply: Annotated[
        bool,
        typer.Option(
            "--apply",
            help="Take the best change that is tried for the way home, without rally points: plan with it, and write "
            "it into the mission file.",
        ),
    ] = False,
    rally: Annotated[
        bool,
        typer.Option(
            "--rally",
            help="Write the rally points that the way home proposes into each .plan; with --upload, send them.",
        ),
    ] = False,
    fence: Annotated[
        bool,
        typer.Option("--fence", help="Zones without floor and ceiling as a fence: in the .plan, and sent first."),
    ] = False,
    fence_infinite: Annotated[
        bool, typer.Option("--fence-infinite", help="As --fence, with zones that have a height as if they had none.")
    ] = False,
    png: Annotated[
        Path | None,
        typer.Option(
            "--picture",
            "--png",
            metavar="FILE|DIR",
            help="Also draw map and profiles to this .png, .svg or .pdf; into a directory: each figure as a .png.",
        ),
    ] = None,
    units: UnitsOption = UnitsChoice.METRIC,
    allow_unjudged: UnjudgedOption = False,
    allow_armed: ArmedOption = False,
    ignore_position: PlaceOption = False,
    allow_parameters: ParametersOption = False,
    atomic: AtomicOption = False,
    timeout: TimeoutOption = 60.0,
    vertical_datum: DatumOption = None,
    height_unit: HeightUnitOption = None,
    nodata: NodataOption = None,
    list_zones: ListZonesOption = False,
    leave_out: LeaveOutOption = False,
    jobs: JobsOption = None,
    cluster: ClusterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Plan a mission file, write its outputs, and upload and verify them on request.

    Options such as --avoid, --max-agl or --goal change the mission for this run, and --save writes them into its file.
    Without --upload nothing is sent. The outputs are written whole or not at all. If no safe mission exists, earlier
    outputs are moved to DIR/previous, so that no old mission is flown by mistake. One vehicle without a mission refuses
    a whole fleet, unless it may be left out.
    """
    from gcsplan.app.fleet import pipeline
    from gcsplan.app.fleet.start_time import GateTime
    from gcsplan.app.output import files as outputs
    from gcsplan.app.output.handout import handout
    from gcsplan.cli.output.console import release_table, remark, upload_table
    from gcsplan.export.outdir import settle_outputs
    from gcsplan.mission_file.source import file_of
    from gcsplan.notes.note import in_json
    from gcsplan.units import units_of

    system = units_of(units)
    if list_zones:
        return _list_zones(mission, system, upload, as_json, at)
    directory = Path(file_of(mission).stem) if out is None else out
    changes = changes_of(
        avoid, avoid_file, zones, {"max_agl_m": max_agl, "min_agl_m": min_agl}, {"start": start, "goal": goal}, via,
        speed, terrain_keys(vertical_datum, height_unit, nodata), wind,
    )  # fmt: skip
    gate = None if gate_utc is None else GateTime.parse(gate_utc, datetime.now(UTC))
    each = _require_options(planner, objective, png, directory)
    if settle_outputs(directory):
        remark(f"an earlier run was cut off while it wrote to {directory}: the outputs before it were put back")
    source: MissionFile | None = None
    try:
        depart = None if gate is None else gate.start
        source = pipeline.load_mission(mission, departure=depart, at=at, changes=changes)
        _begin_changes(source, save=save)
        targets: dict[str, str] = {}
        if upload:  # otherwise the upload modules need not be imported
            from gcsplan.app.upload import run as uploads

            targets = uploads.targets(upload, [r.vehicle for r in source.vehicles])
        earlier = _earlier(source, directory, compare_to or [], timeout)
        how = {
            "planner": planner, "objective": objective, "seed": seed, "gate_utc": depart, "jobs": jobs,
            "options": _given(encoding=encoding, cost=cost, warm_start=warm_start), "cluster": cluster,
            "leave_out": leave_out or None,
        }  # fmt: skip
        planned = _plan(source, how)
        if apply and (best := _best_changes(planned)):
            source = pipeline.load_mission(mission, departure=depart, at=at, changes=[*changes, *best])
            planned = _plan(source, how)
        keep = _keeping(source, mission, save=save or (apply and bool(best)))
        home = report or way_home or rally or apply
        handed = handout(
            planned, targets, (fence, rally, fence_infinite), earlier, allow_unjudged=allow_unjudged, home=home,
            require_way_home=require_way_home,
        )  # fmt: skip
        planned, homes = handed.plan, handed.homes
        files = handed.files(system if report else None)
    except UsageError:
        raise  # a mistake on the command line does not invalidate an earlier mission
    except (InputError, NoMission, CheckFailed):
        _retire(directory, None if as_json else source, system)
        raise
    pictures = {} if png is None else _pictures(planned, png, each)
    _write(directory, files, pictures, later=["upload.json"] if targets else [])
    keep()
    if not as_json:
        _show(handed, system)
        _say_written(directory, list(files), handed.notes, system)
    results: list[JobResult] = []
    if targets:
        results = _upload(
            handed, allow_armed=allow_armed, ignore_position=ignore_position, atomic=atomic,
            allow_parameters=allow_parameters, timeout_s=timeout,
        )  # fmt: skip
        _add_results(directory, handed, results, system if report else None)
        if not as_json:
            upload_table(results, units=system)
            release_table(planned, results)
    left_out = _left_out(planned, mission)
    failure = (uploads.failure(results) if targets else None) or left_out
    if as_json:
        more = in_json("changes", source.changes) | {"differences": [d.as_dict() for d in handed.differences]}
        emit(outputs.summary_of(planned, results, homes) | more, failure)
    raise typer.Exit(failure["code"] if failure is not None else 0)


def _earlier(
    source: MissionFile, directory: Path, compare_to: list[str], timeout_s: float
) -> list[dict[str, EarlierMission]]:
    """The missions of the last plan, and those on board where these are to be compared, each by vehicle."""
    from gcsplan.cli.output.console import remark
    from gcsplan.export.outdir import outputs_in

    found: list[dict[str, EarlierMission]] = []
    if outputs_in(directory):
        from gcsplan.app.plan.earlier import last_plan
        from gcsplan.cli.output.console import say_notes

        last, notes = last_plan(source, directory)
        say_notes(notes)
        found.append(last)
    if compare_to:
        from gcsplan.app.plan.earlier import EarlierMission
        from gcsplan.app.upload import run as uploads
        from gcsplan.app.upload.job import SIM

        where = uploads.targets(compare_to, [r.vehicle for r in source.vehicles])
        if SIM in where.values():
            raise UsageError("--compare-to sim: a simulated vehicle has nothing on board; give a URL, or `link`")
        with talking(list(where)):
            missions = uploads.on_board(source, where, timeout_s=timeout_s)
        for name in (name for name, mission in missions.items() if not mission.items):
            remark(f"{name}: there is no mission on board to compare with, by {where[name]}")
        found.append({name: EarlierMission(where[name], m) for name, m in missions.items() if m.items})
    return found


def _show(handed: Handout, units: Units) -> None:
    """Print the plan, what changed, and the ways home."""
    from gcsplan.cli.output.console import plan_table
    from gcsplan.cli.output.difference_table import say_differences
    from gcsplan.cli.output.verdict_table import say_homes

    plan_table(handed.plan, handed.homes, units)
    say_differences(handed.differences, units)
    say_homes(handed.homes, units)


def _plan(source: MissionFile, how: Mapping[str, Any]) -> Plan:
    """The plan of a mission, with its progress shown; ``how`` are options of `gcsplan.plan`."""
    from gcsplan.app.fleet import pipeline
    from gcsplan.cli.output.progress import planning_display

    names = [r.vehicle.name for r in source.vehicles]
    with planning_display(names, how["objective"] or source.planner.objective) as progress:
        return pipeline.plan(source, progress=progress, **how)


def _best_changes(planned: Plan) -> list[MissionChange]:
    """The best change for the way home of each vehicle that has one; a vehicle that lacks both is named."""
    from gcsplan.app.fleet.earlier_landing import best_changes, with_earlier_landing
    from gcsplan.app.plan.way_home import homes_of
    from gcsplan.cli.output.console import remark

    homes = with_earlier_landing(planned, homes_of(planned))
    for name, home in homes.items():
        if home.safe is not True and not best_changes({name: home}):
            remark(f"note: --apply: no key that was tried makes more of the way home of {name} safe")
    return best_changes(homes)


def _begin_changes(source: MissionFile, *, save: bool) -> None:
    """Say the changes of a mission, and refuse now what cannot be saved once the plan is written. Raises UsageError."""
    from gcsplan.cli.output.console import say_notes
    from gcsplan.mission_file.changes import saving

    say_notes(source.changes)
    if save and source.content is not None:
        saving(source.content)


def _keeping(source: MissionFile, mission: Path, *, save: bool) -> Callable[[], None]:
    """The function that saves a mission's changes once the plan is written, if they are to be saved."""
    from gcsplan.cli.output.console import remark, say_notes
    from gcsplan.mission_file.changes import saving

    say_notes(note for note in source.changes if note.data["option"] == "--apply")
    if save:
        assert source.content is not None
        write = saving(source.content)

        def keep() -> None:
            write()
            remark(f"the changes are written into {mission}")

        return keep
    if source.changes:
        remark("note: changed for this run alone; --save writes it into the mission file")
    return lambda: None


def _add_results(directory: Path, handed: Handout, results: list[JobResult], report: Units | None) -> None:
    """Add what an upload came to; ``report``: the units of a report that tells it too, None without one."""
    from gcsplan.app.output import files as outputs

    texts = {"upload.json": lambda: outputs.upload_text(handed.plan, results, handed.homes)}
    if report is not None:
        texts["report.html"] = lambda: handed.report(results, report)
    _add(directory, texts)


def _left_out(planned: Plan, mission: Path) -> dict[str, Any] | None:
    """Name the vehicles that are left out on standard error; returns the ``error`` of ``--json``, None without one."""
    from gcsplan.app.plan.left_out import refusal_of

    if not planned.left_out:
        return None
    refusal = refusal_of(planned.left_out)
    complain(refusal)
    return refusal.as_dict() | {"where": str(mission)}


def _given(**options: object) -> dict[str, object]:
    """The options that are given."""
    return {key: value for key, value in options.items() if value is not None}


def _list_zones(mission: Path, units: Units, upload: list[str] | None, as_json: bool, at: str | None) -> None:
    from gcsplan.cli.commands.zones import show_zones

    if upload:
        raise UsageError("--list-zones plans nothing, so that nothing can be sent; leave --upload out")
    show_zones([mission], units, as_json=as_json, at=at)


def _require_options(planner: str | None, objective: str | None, png: Path | None, directory: Path) -> bool:
    """Whether ``png`` is a directory of separate figures. Raises UsageError for wrong options."""
    from gcsplan.planners import registry

    if planner is not None:
        try:
            registry.get(planner)
        except InputError as error:
            raise UsageError(f"--planner: {error}") from None
    if objective not in (None, "length", "energy", "time"):
        raise UsageError(f"--objective {objective}: give length, energy or time")
    each = png is not None and (png.is_dir() or png == directory)
    drawn = png is not None and png.suffix.lower() in (".png", ".svg", ".pdf")
    if png is not None and not (each or (drawn and (png.parent.is_dir() or png.parent == directory))):
        raise UsageError(
            f"--picture {png}: give a directory, or a name that ends in .png, .svg or .pdf in a directory that exists"
        )
    return each


def _retire(directory: Path, source: MissionFile | None, units: Units) -> None:
    """Move the outputs of an earlier plan out of the way, since there is no mission now, and say what its
    terrain has to note."""
    from gcsplan.cli.output.console import remark, say_terrain
    from gcsplan.export.outdir import retire_outputs

    try:
        if retire_outputs(directory):
            remark(f"earlier outputs in {directory} were moved to {directory / 'previous'}")
    except InputError as error:  # the reason why there is no mission matters more
        remark(f"note: earlier outputs are still in {directory} and are of no use now: {error}")
    if source is not None:
        say_terrain(source, units)


def _write(directory: Path, files: Mapping[str, str], pictures: dict[Path, bytes], later: Sequence[str]) -> None:
    """Write the outputs and the pictures; those inside the directory are written and removed with its outputs.

    ``later``: outputs that are written afterwards.
    """
    from gcsplan.cli.output.console import remark
    from gcsplan.export.outdir import can_hold, outputs_in, write_outputs, write_whole

    beside = [file for file in pictures if can_hold(directory, file)]
    earlier = outputs_in(directory)
    in_the_way = write_outputs(directory, {**files, **{file.name: pictures.pop(file) for file in beside}})
    gone = [name for name in earlier if name not in later and not os.path.lexists(directory / name)]
    for file, content in pictures.items():
        write_whole(file, content)
    if gone:
        shown = ", ".join(
            [
                *gone[:MOST_NAMED],
                *([f"{len(gone) - MOST_NAMED} more"] if len(gone) > MOST_NAMED else []),
            ]
        )
        cure = "; --report writes one of this plan" if "report.html" in gone else ""
        remark(f"note: gone from {directory}, because this plan has no such output: {shown}{cure}")
    if in_the_way:
        remark(f"{', '.join(in_the_way)} in {directory} were not gcsplan's, and were moved to {directory / 'previous'}")


def _add(directory: Path, files: Mapping[str, Callable[[], str]]) -> None:
    """Write what became of the upload beside the other outputs; the outcome itself matters more than a failure here."""
    from gcsplan.cli.output.console import remark
    from gcsplan.export.outdir import add_output

    try:
        for name, content in files.items():
            add_output(directory, name, content())
    except InputError as error:
        remark(f"note: the result of the upload is not written: {error}")


def _say_written(directory: Path, files: list[str], notes: Sequence[tuple[str, Note]], units: Units) -> None:
    """Print the notes on the fences, and the written files; a fleet has hundreds of files."""
    from gcsplan.cli.output.console import say, say_notes_of
    from gcsplan.notes.note import Wording

    say_notes_of(notes, Wording(units))
    shown = [*files[:MOST_NAMED], f"… and {len(files) - MOST_NAMED} more"] if len(files) > MOST_NAMED + 1 else files
    say(f"written to {directory}{os.sep}: {', '.join(shown)}")


def _pictures(planned: Plan, png: Path, each: bool) -> dict[Path, bytes]:
    """One picture of everything, or one for each figure in the directory ``png``."""
    from gcsplan.app.output import files as outputs

    if each:
        return {png / name: content for name, content in outputs.figures_of(planned).items()}
    return {png: outputs.picture_of(planned, png.suffix.lower()[1:])}


def _upload(handed: Handout, **options: Any) -> list[JobResult]:
    """Upload all jobs with their progress shown; ``options`` are those of `UploadOptions`."""
    from gcsplan.app.fleet.start_time import GateTime
    from gcsplan.app.upload import run as uploads
    from gcsplan.app.upload.job import UploadOptions
    from gcsplan.cli.output.console import transfer_progress
    from gcsplan.sim.vehicle.server import loopback_fleet

    GateTime.require_of(handed.plan)  # planning took time, so check again
    jobs = handed.jobs
    names = [job.name for job in jobs]
    with talking(names), transfer_progress(names) as moved_on:
        return uploads.run_jobs(jobs, UploadOptions(**options), moved_on, simulator=loopback_fleet)


def planners(as_json: JsonOption = False) -> None:
    """List the planners, with paper and default parameters."""
    from gcsplan.cli.output.console import planners_table
    from gcsplan.planners import registry

    rows = [
        {"name": e.name, "summary": e.summary, "paper": e.paper, "defaults": dict(e.defaults)} for e in registry.rows()
    ]
    if as_json:
        emit({"planners": rows})
    else:
        planners_table(rows)
