"""`gcsplan rehearse`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcsplan.cli.arguments.options import (
    AtOption,
    ClusterOption,
    JobsOption,
    JsonOption,
    MissionArgument,
    PlannerOption,
    RequireWayHomeOption,
    UnitsChoice,
    UnitsOption,
    UnjudgedOption,
    WayHomeOption,
    require_html,
)
from gcsplan.cli.process.exit import complain, emit, talking
from gcsplan.errors import GcsplanError, UsageError
from gcsplan.units import Quantity, duration, in_units, units_of

if TYPE_CHECKING:
    from gcsplan.app.plan.model import Plan
    from gcsplan.sim.outcome import Rehearsal
    from gcsplan.units import Units


def rehearse(
    mission: MissionArgument,
    planner: PlannerOption = None,
    wind: Annotated[
        float | None,
        typer.Option(
            metavar="M_S", help="A steady wind [default: each run draws one of the mission's winds, else still air]"
        ),
    ] = None,
    wind_from: Annotated[
        float | None,
        typer.Option(metavar="DEG", help="Where it blows from [default: another direction in each run]"),
    ] = None,
    gusts: Annotated[float, typer.Option(metavar="M_S", help="Gusts, as a standard deviation.")] = 0.0,
    noise_m: Annotated[float, typer.Option(metavar="M", help="Position error, as a standard deviation.")] = 0.0,
    airspeed: Annotated[
        float | None,
        typer.Option(
            metavar="M_S",
            help="The most through the air [default: what the lean angle allows, else 1.2 times the fastest cruise]",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of wind, gusts and noise.")] = 1,
    runs: Annotated[int, typer.Option(metavar="K", min=1, max=10_000, help="Fly it so often, with other weather.")] = 1,
    sitl: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=URL",
            help="Fly it with a running ArduPilot SITL, one for each vehicle: uav1=tcp:127.0.0.1:5760. It is armed "
            "and started.",
        ),
    ] = None,
    sitl_binary: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Start an SITL over the mission's terrain for each other vehicle: a program, or a folder with "
            "arducopter and arduplane.",
        ),
    ] = None,
    params: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[NAME=]FILE|URL",
            help="Fly with these parameters in place of what the plan assumes: a .param file, or a vehicle to read.",
        ),
    ] = None,
    late: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=S", help="A vehicle departs so many seconds late; may be repeated for others."),
    ] = None,
    jobs: JobsOption = None,
    cluster: ClusterOption = None,
    speedup: Annotated[
        float | None, typer.Option(metavar="X", help="With --sitl-binary: how fast its clock runs [default: 5]")
    ] = None,
    i_know: Annotated[
        bool,
        typer.Option("--i-know", help="With --sitl: arm and start vehicles elsewhere, or that are no simulators."),
    ] = False,
    at: AtOption = None,
    way_home: WayHomeOption = False,
    require_way_home: RequireWayHomeOption = False,
    units: UnitsOption = UnitsChoice.METRIC,
    allow_unjudged: UnjudgedOption = False,
    report: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="Also write the report, with the flights beside the plan."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Plan, upload to simulated vehicles, fly them all in simulated time, and judge arrivals, separation and limits.

    The vehicles fly what they stored. Flight times come from a model of motion that shares nothing with the one that
    planned them. The exit code is 4 if a limit was broken, the order or the separation was lost, or a safe return is
    required and there is none.
    """
    from gcsplan.app import rehearse as rehearsing
    from gcsplan.app.fleet import pipeline
    from gcsplan.app.fleet.gates import some_start
    from gcsplan.app.fleet.may_fly import flyable
    from gcsplan.app.output.report import render_rehearsal
    from gcsplan.app.plan.left_out import refusal_of
    from gcsplan.cli.output.console import remark, say, say_notes
    from gcsplan.cli.output.progress import WorkDisplay, planning_display
    from gcsplan.cli.output.verdict_table import say_homes
    from gcsplan.export.outdir import write_whole
    from gcsplan.notes.note import Wording

    if airspeed is not None and not airspeed > 0.0:
        raise UsageError(f"--airspeed {airspeed:g}: give a speed above 0")
    require_html(report)
    in_sitl = bool(sitl) or sitl_binary is not None
    if in_sitl and (noise_m or runs > 1 or airspeed is not None):
        raise UsageError("--noise-m, --airspeed and --runs are the built-in simulator's, not --sitl's")
    if speedup is not None and sitl_binary is None:
        raise UsageError("--speedup goes with --sitl-binary")
    if in_sitl and late:
        raise UsageError("--late is the built-in simulator's: release an SITL's vehicle late by hand")
    if in_sitl and params:
        raise UsageError("--params is the built-in simulator's: an SITL has parameters of its own")
    source = pipeline.load_mission(mission, at=at)
    weather = rehearsing.weather_of(source, wind, wind_from, gusts, noise_m)
    names = [r.vehicle.name for r in source.vehicles]
    addresses, late_s = rehearsing.seats_of(sitl or [], names), rehearsing.late_of(late or [], names)
    with planning_display(names, source.planner.objective) as progress:
        has_gates = source.arrival is not None and source.arrival.gates is not None
        planned = pipeline.plan(
            source, planner=planner, progress=progress, jobs=jobs, cluster=cluster,
            gate_utc=some_start(source) if has_gates else None,
        )  # fmt: skip
    planned, homes = flyable(
        planned, allow_unjudged=allow_unjudged, home=way_home or report is not None, require_way_home=require_way_home
    )
    if in_sitl:
        with talking(names):
            result = rehearsing.rehearse_in_sitl(
                planned, binary=sitl_binary, addresses=addresses, speedup=speedup, i_know=i_know,
                report=None if as_json else lambda name, what: remark(f"{name} {what}"), weather=weather, seed=seed,
            )  # fmt: skip
    else:
        display = WorkDisplay(runs, "runs")
        result = rehearsing.rehearse(
            planned, weather=weather, runs=runs, seed=seed, airspeed_m_s=airspeed, jobs=jobs, cluster=cluster,
            parameters=rehearsing.parameters_of(params or [], planned), late_s=late_s, watch=display.workers,
            progress=lambda done, _: display.done(done),
        )  # fmt: skip
    error: GcsplanError | None = result.error(allow_unjudged=allow_unjudged)
    if planned.left_out:
        complain(refusal := refusal_of(planned.left_out))
        error = error or refusal
    if report is not None:  # also of a rehearsal that found violations: it shows where
        write_whole(report, render_rehearsal(planned, result, homes, units_of(units)))
    if as_json:
        failure = None
        if error is not None:
            failure = error.as_dict() | {"where": str(mission)}
        judged = {"way_home": {name: home.as_dict() for name, home in homes.items()}} if homes else {}
        emit({"name": source.name} | result.as_dict() | judged, failure)
    else:
        _show(planned, result, units_of(units))
        say_notes(result.notes, Wording(units_of(units)))
        for line in _ending(result, units_of(units)):
            say(line)
        say_homes(homes, units_of(units))
    raise typer.Exit(error.exit_code if error is not None else 0)


def _show(planned: Plan, result: Rehearsal, units: Units) -> None:
    """Print a row for each vehicle."""
    from rich.markup import escape

    from gcsplan.cli.output.console import rows_table

    by = "built-in simulator" if result.simulator == "gcsplan" else "ArduPilot SITL"
    runs = f", {result.runs} runs" if result.runs > 1 else ""
    rows_table(f"rehearsal of {escape(planned.source.name)}  {by}{runs}", result.rows(units))


def _ending(result: Rehearsal, units: Units) -> list[str]:
    """Order, intervals, separation and violations in words."""
    from gcsplan.check.flight.times import MODEL_S

    lines = []
    kept = f" in {result.order_kept_runs} of {result.runs} runs" if result.runs > 1 else ""
    if result.terms.order and (result.order_kept_runs or result.runs > 1):
        lines.append(f"order of arrival {', '.join(result.terms.order)}: kept{kept}")
    if result.interval_error_s is not None:
        off_s, runs = result.interval_error_s, f" in {result.intervals_kept_runs} of {result.runs} runs"
        within = f"within {result.terms.window_s + MODEL_S:g} s of"
        allowed = f"intervals between arrivals {within} the plan"
        off = f"the worst is {abs(off_s):.1f} s too {'long' if off_s > 0.0 else 'short'}"
        if result.terms.together:
            allowed, off = f"arrivals {within} each other", f"at most {off_s:.1f} s apart"
        kept = f"kept{runs if result.runs > 1 else ''}" if result.intervals_kept_runs else "not kept"
        lines.append(f"{allowed}: {kept}; {off if math.isfinite(off_s) else 'one never arrived'}")
    if result.closest is not None:
        a, b = result.closest.names
        apart = Quantity(result.closest.distance_m, "distance", 1, "down").text(units)
        least = f"least separation {apart} ({a} and {b}, at T+{duration(result.closest.time_s, 1)})"
        if result.terms.separation_m is not None:
            kept = f", kept in {result.separation_kept_runs} of {result.runs} runs" if result.runs > 1 else ""
            least += f" of {Quantity(result.terms.separation_m, 'distance', None).text(units)} required{kept}"
        lines.append(least)
    if result.runs > 1 and result.p95_s is not None:
        lines.append(f"95 % of all arrivals lie within {result.p95_s:.2f} s of the plan")
    if result.inside_windows is not None:
        inside, arrivals = result.inside_windows
        late = ", which a late departure moves as much" if any(v.shifted_s for v in result.vehicles) else ""
        lines.append(
            f"{inside} of {arrivals} {'arrivals lie' if arrivals > 1 else 'arrival lies'} inside the window{late}"
        )
    lines += [f"violation: {in_units(b.note(result.runs), units)}" for b in result.breaches]
    lines += [f"not flown: {in_units(what, units)}" for what in result.not_judged]
    lines.append(
        {True: "flown as planned", False: "VIOLATIONS were found", None: "not everything was flown"}[result.safe]
    )
    return lines
