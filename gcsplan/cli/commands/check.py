"""`gcsplan check`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcsplan.cli.arguments import completion
from gcsplan.cli.arguments.changes import WindOption, wind_changes
from gcsplan.cli.arguments.options import (
    AtOption,
    ClusterOption,
    DatumOption,
    HeightUnitOption,
    IgnoreOption,
    JobsOption,
    JsonOption,
    ListZonesOption,
    NodataOption,
    OnBadOption,
    RequireWayHomeOption,
    UnitsChoice,
    UnitsOption,
    UnjudgedOption,
    WayHomeOption,
    as_options,
    require_html,
    terrain_keys,
)
from gcsplan.cli.process.exit import complain
from gcsplan.errors import InputError, UsageError, worst_of

if TYPE_CHECKING:
    from gcsplan.app.check.files import Batch
    from gcsplan.app.check.many import Archive, Form, Shown
    from gcsplan.app.check.worlds import Checked, Returns
    from gcsplan.mavlink.mission.return_parameters import ReturnRoute
    from gcsplan.mission_file.options_world import WorldOptions
    from gcsplan.mission_file.values.places import Degrees
    from gcsplan.mission_file.zones.file import Ignorable, OnBad
    from gcsplan.units import Units

Number = float | None

READ_BY = {"vertical_datum": "--vertical-datum", "height_unit": "--height-unit", "nodata": "--nodata"}
"""Keys of a mission's terrain, and the options that count before them."""

MOST_TABLES = 20
"""Most files of which tables are printed; of more, findings and a summary."""


def check(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="[MISSION.yaml] FILE",
            autocompletion=completion.missions,
            help="A mission file, in whose world they are checked (or --dem and --min-agl), and .waypoints or .plan "
            "files, folders of them, or patterns; NAME=FILE says for which vehicle of the mission a file is.",
        ),
    ],
    dem: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE",
            autocompletion=completion.dems,
            help="Terrain; may be repeated. Or a source of dem fetch.",
        ),
    ] = None,
    vertical_datum: DatumOption = None,
    height_unit: HeightUnitOption = None,
    nodata: NodataOption = None,
    geoid_grid: Annotated[str | None, typer.Option(metavar="FILE", help="For an ellipsoidal DEM.")] = None,
    crs: Annotated[str | None, typer.Option(metavar="EPSG:N", help="Coordinates of a DEM that states none.")] = None,
    obstacle_height: Annotated[Number, typer.Option(metavar="M", help="Height of trees and houses everywhere.")] = None,
    zones: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE",
            help="No-fly zones: .geojson, .kml, .kmz, .gpkg, .csv, …, or a state's; may be repeated.",
        ),
    ] = None,
    on_bad: OnBadOption = None,
    ignore: IgnoreOption = None,
    keep_in: Annotated[
        list[str] | None,
        typer.Option(metavar="FILE", help="Areas to stay in: a file as for --zones, or a .plan with a fence."),
    ] = None,
    min_agl: Annotated[Number, typer.Option(metavar="M", help="Lowest height above ground.")] = None,
    max_agl: Annotated[Number, typer.Option(metavar="M", help="Highest height above ground.")] = None,
    max_amsl: Annotated[Number, typer.Option(metavar="M", help="Highest altitude above sea level.")] = None,
    clearance: Annotated[Number, typer.Option(metavar="M", help="From zones and rising ground [default: 30]")] = None,
    vertical_clearance: Annotated[Number, typer.Option(metavar="M", help="Over and under zones [default: 0]")] = None,
    track_error: Annotated[Number, typer.Option(metavar="M", help="How far off track it may be [default: 3]")] = None,
    altitude_error: Annotated[Number, typer.Option(metavar="M", help="Likewise in height [default: 5]")] = None,
    max_climb: Annotated[Number, typer.Option(metavar="DEG", help="Steepest climb.")] = None,
    max_descent: Annotated[Number, typer.Option(metavar="DEG", help="Steepest descent [default: --max-climb]")] = None,
    autopilot: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            autocompletion=completion.autopilots,
            help="arducopter, arduplane or px4, where the file does not say.",
        ),
    ] = None,
    home: Annotated[
        str | None,
        typer.Option(
            metavar="LAT,LON", help="Where the vehicle arms, instead of the file's home; or as text in UTM, MGRS, …"
        ),
    ] = None,
    speed: Annotated[Number, typer.Option(metavar="M_S", help="Cruise speed, where the file sets none.")] = None,
    climb_rate: Annotated[Number, typer.Option(metavar="M_S", help="Fastest climb [default: 2.5]")] = None,
    descent_rate: Annotated[Number, typer.Option(metavar="M_S", help="Fastest descent [default: 1.5]")] = None,
    rtl_altitude: Annotated[
        Number, typer.Option(metavar="M", help="Above home, at which the vehicle returns (its own parameter).")
    ] = None,
    return_route: Annotated[
        str | None,
        typer.Option(metavar="ROUTE", help="straight home, or by the mission's return path or landing: mission."),
    ] = None,
    at: AtOption = None,
    wind: WindOption = None,
    way_home: WayHomeOption = False,
    require_way_home: RequireWayHomeOption = False,
    units: UnitsOption = UnitsChoice.METRIC,
    allow_unjudged: UnjudgedOption = False,
    quiet: Annotated[
        bool, typer.Option("-q", "--quiet", help="Only findings, one a line: file:item: message. Nothing if all pass.")
    ] = False,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Also write the report: map, profiles, tables.")
    ] = None,
    list_zones: ListZonesOption = False,
    jobs: JobsOption = None,
    cluster: ClusterOption = None,
    json_lines: Annotated[
        bool, typer.Option("--json-lines", help="A line of JSON for each file as it is judged, then the summary.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Check whether .waypoints or .plan files, of any origin, fly safely.

    In the world of a mission file:    gcsplan check mission.yaml uav1.plan

    Or with options alone:    gcsplan check *.plan --dem dem.tif --vertical-datum EGM96 --zones zones.kml --min-agl 60

    Thousands of files:                gcsplan check mission.yaml archive/ --json-lines

    Every leg is judged along its whole length, as the autopilot flies it: jumps, loiters, take-off, landing, speeds,
    each altitude frame. The exit code is 0 if all pass, 4 on a violation or if anything could not be judged, else 2 if
    a file cannot be read. A return that is not safe is a warning, unless a safe one is required.

    With --list-zones a FILE may also be a file of zones.
    """
    from gcsplan.app.check import files as checking
    from gcsplan.app.check import worlds as check_sites
    from gcsplan.app.check.many import Shown, results_of_batch
    from gcsplan.cli.output.check_output import Document, Lines, Rows, tell, tell_archive
    from gcsplan.export.outdir import steady
    from gcsplan.units import units_of

    if list_zones:
        from gcsplan.cli.commands.zones import show_zones

        named = [Path(f) for f in files if Path(f).suffix.lower() not in (".waypoints", ".plan")]
        named += [Path(f) for f in (*(zones or []), *(keep_in or []))]
        if not named:  # a fence may be in one
            named = [Path(f) for f in files if Path(f).suffix.lower() == ".waypoints"]
        if not named:
            raise UsageError("--list-zones: of which zones? Give a mission file (.yaml) or a file of zones, too")
        rule, ignored = _rule(on_bad), _ignored(ignore)
        return show_zones(named, units_of(units), as_json=as_json, at=at, on_bad=rule, ignore=ignored)
    given: dict[str, object] = {
        "--dem": dem, **as_options(terrain_keys(vertical_datum, height_unit, nodata)), "--geoid-grid": geoid_grid,
        "--crs": crs, "--obstacle-height": obstacle_height, "--zones": zones, "--keep-in": keep_in,
        "--on-bad": on_bad, "--ignore": ignore, "--min-agl": min_agl, "--max-agl": max_agl, "--max-amsl": max_amsl,
        "--clearance": clearance, "--vertical-clearance": vertical_clearance, "--track-error": track_error,
        "--altitude-error": altitude_error, "--max-climb": max_climb, "--max-descent": max_descent,
        "--autopilot": autopilot, "--home": home, "--speed": speed, "--climb-rate": climb_rate,
        "--descent-rate": descent_rate, "--rtl-altitude": rtl_altitude, "--return-route": return_route,
    }  # fmt: skip
    given = {k: v for k, v in given.items() if v not in (None, [])}
    require_html(report)
    if as_json and json_lines:
        raise UsageError("--json is one document and --json-lines one for each file: give one of them")
    returns, rows = check_sites.Returns(way_home, require_way_home), as_json or json_lines
    mission, arguments = (files[0], files[1:]) if _is_mission(files[0]) else (None, files)
    arguments = [file for argument in arguments for file in _named(argument)]
    form: Form = "whole" if as_json else "row" if json_lines else "lines"
    shown = Shown(form, allow_unjudged, units_of(units), len(arguments) > 1)
    archive = _archive(mission, arguments, given, returns, shown, (at, wind))
    printer = Document() if as_json else Rows() if json_lines else Lines(shown.units, summed=not quiet)
    reading = steady(check_sites.split_name(file)[1] for file in arguments)
    if report is None and (rows or quiet or len(arguments) > MOST_TABLES):
        raise typer.Exit(tell_archive(archive, printer, jobs, cluster, reading))
    with reading:
        batch = checking.check_at(
            archive.site, archive.name, arguments, check_sites.VerdictParts(archive.request.returns)
        )
    if report is not None:
        _report(batch, report, units_of(units))
    if rows or quiet or len(arguments) > MOST_TABLES:
        results = results_of_batch(batch, form, allow_unjudged=allow_unjudged, units=units_of(units))
        header = (batch.name, batch.inputs, batch.notes, batch.typed)
        raise typer.Exit(tell(header, results, printer, len(arguments)))
    _say_all(batch, units_of(units))
    failing = [f for c in batch.checked if (f := checking.failing_of(c, allow_unjudged=allow_unjudged)) is not None]
    raise typer.Exit(worst_of({*(f.code for f in failing), *(error.exit_code for _, error in batch.unreadable)}))


def _rule(word: object) -> OnBad | None:
    from typing import get_args

    from gcsplan.mission_file.zones.file import OnBad

    found: OnBad | None = next((rule for rule in get_args(OnBad) if rule == word), None)
    if word is not None and found is None:
        raise UsageError(f"--on-bad {word}: give one of {', '.join(get_args(OnBad))}")
    return found


def _ignored(words: object) -> tuple[Ignorable, ...]:
    """The shapes that `--ignore` names, each word or several with commas."""
    from gcsplan.mission_file.zones.file import IGNORABLE

    given = [word.strip() for text in (words if isinstance(words, list) else ()) for word in str(text).split(",")]
    for word in given:
        if word not in IGNORABLE:
            raise UsageError(f"--ignore {word}: give one of {', '.join(IGNORABLE)}")
    return tuple(kind for kind in IGNORABLE if kind in given)


def _named(argument: str) -> list[str]:
    """The files that an argument names: a file, a folder, or a pattern."""
    from gcsplan.app.named_files import named_files, names_several

    if not names_several(argument):
        return [argument]
    found = [str(path) for path in named_files(argument, (".waypoints", ".plan"))]
    if not found:
        raise UsageError(f"{argument} holds no .waypoints or .plan file")
    return found


def _is_mission(argument: str) -> bool:
    from gcsplan.mission_file.source import is_sample

    return Path(argument).suffix.lower() in (".yaml", ".yml") or is_sample(argument)


def _archive(
    mission: str | None, files: list[str], given: dict[str, object], returns: Returns, shown: Shown,
    when: tuple[str | None, str | None],
) -> Archive:  # fmt: skip
    """The files in the world of a mission file, or in the world of the options; ``when``: ``--at`` and ``--wind``."""
    from gcsplan.app.check.many import Archive
    from gcsplan.app.fleet import pipeline
    from gcsplan.vehicle import Autopilot

    at, winds = when[0], wind_changes(when[1])
    if mission is not None:
        terrain = {key: given.pop(option) for key, option in READ_BY.items() if option in given}
        if given:
            raise UsageError(f"{', '.join(given)}: the mission file says that; leave it out, or give no mission file")
        if not files:
            raise UsageError(f"which files are to be checked in the world of {mission}? Give .waypoints or .plan files")
        source = pipeline.load_mission(Path(mission), at=at, terrain=terrain, changes=winds)
        return Archive.in_mission(source, files, returns, shown)
    missing = [name for name in ("--dem", "--min-agl") if name not in given]
    if missing:
        raise UsageError(
            f"in which world? Give a mission file (.yaml) first, or {' and '.join(missing)} (see gcsplan check --help)"
        )
    name = given.get("--autopilot")
    if name is not None and name not in tuple(Autopilot):
        raise UsageError(f"--autopilot {name}: give one of {', '.join(Autopilot)}")
    pilot = None if name is None else Autopilot(str(name))
    options = replace(world_options(given, at), wind=winds[0].value if winds else None)
    return Archive.with_options(options, pilot, files, returns, shown)


def world_options(given: dict[str, object], at: str | None = None) -> WorldOptions:
    from gcsplan.mission_file.options_world import KEY_OPTIONS, WorldOptions
    from gcsplan.mission_file.published.times import texts_of

    def under(*keys: str) -> dict[str, object]:
        return {key: given[KEY_OPTIONS[key]] for key in keys if KEY_OPTIONS[key] in given}

    limits = ("min_agl_m", "max_agl_m", "max_amsl_m", "horizontal_clearance_m", "vertical_clearance_m",
              "track_error_m", "altitude_error_m",
              "max_climb_deg", "max_descent_deg")  # fmt: skip
    vehicle = under("climb_m_s", "descent_m_s")
    if isinstance(speed := given.get("--speed"), float):
        vehicle["speed_m_s"] = [min(speed, 3.0), speed]
    rtl, route = given.get("--rtl-altitude"), given.get("--return-route")
    zones, keep_in = (
        tuple(str(name) for name in names) if isinstance(names, list) else ()
        for names in (given.get("--zones"), given.get("--keep-in"))
    )
    home = _home(str(given["--home"])) if "--home" in given else None
    return WorldOptions(
        terrain=under("dem", "vertical_datum", "height_unit", "nodata", "geoid_grid", "crs", "obstacle_height_m"),
        zones=zones,
        keep_in=keep_in,
        limits={k: float(str(v)) for k, v in under(*limits).items()},
        vehicle=vehicle,
        home=None if home is None else (home.lat_deg, home.lon_deg),
        rtl_rel_home_m=rtl if isinstance(rtl, float) else None,
        return_route=_route(route),
        at=texts_of(at),
        on_bad=_rule(given.get("--on-bad")),
        ignore=_ignored(given.get("--ignore")),
        notes=() if home is None or not home.note else (home.note.of(place="--home"),),
    )


def _route(given: object) -> ReturnRoute | None:
    if given in (None, "straight", "mission"):
        return given
    raise UsageError(f"--return-route {given}: give straight or mission")


def _home(text: str) -> Degrees:
    from gcsplan.mission_file.values.places import read_place

    try:
        return read_place(text)
    except ValueError as why:
        raise UsageError(f"--home {text[:100]}: give LAT,LON in degrees, for example 36.6,-84.38: {why}") from None


def _say_all(batch: Batch, units: Units) -> None:
    from gcsplan.cli.output.console import say, say_heights, say_notes
    from gcsplan.cli.output.verdict_table import say_home, say_warnings, verdict_table
    from gcsplan.export.profile import profile_lines
    from gcsplan.notes.note import Wording

    wording = Wording(units, batch.typed)
    say_notes(batch.notes, wording)
    say_heights(batch.inputs, units)
    for c in batch.checked:
        say_notes(c.notes, wording)
        name = f"{c.file} as {c.vehicle.name} ({c.vehicle.autopilot})"
        verdict_table(name, c.verdict, c.way_home, wording=wording, energy=c.vehicle.energy)
        for miss in c.verdict.misses:
            say(miss.note.text(wording))
        for line in profile_lines(c.verdict, c.world, units):
            say(line)
        if c.way_home is not None:
            say_home(c.way_home, wording)
    say_warnings({str(c.file): c.way_home for c in batch.checked}, wording)
    for _, error in batch.unreadable:
        complain(error)


def _report(batch: Batch, file: Path, units: Units) -> None:
    from gcsplan.export.outdir import write_whole
    from gcsplan.notes.note import Note
    from gcsplan.report.page import render_page
    from gcsplan.report.parts.page_data import page_of_check

    worlds: list[Checked] = list({id(c.world): c for c in batch.checked}.values())
    if len(worlds) != 1:
        raise InputError("a report shows files of one area; none could be judged, or they lie too far apart")
    notes = [*batch.notes, *(Note("file_not_read", why=str(error)) for _, error in batch.unreadable)]
    homes = [c.way_home for c in batch.checked]
    page = page_of_check(
        batch.name, worlds[0].world, batch.checked, inputs=batch.inputs, notes=notes, homes=homes, units=units
    )
    write_whole(file, render_page(page))
