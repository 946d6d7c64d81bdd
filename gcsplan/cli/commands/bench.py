"""``gcsplan bench …``: all measurements; each command is one call into `gcsplan.bench`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from gcsplan.cli.arguments.options import ClusterOption, JobsOption, JsonOption
from gcsplan.cli.process.exit import emit, put
from gcsplan.errors import UsageError, needs

bench_app = typer.Typer(
    help="Measurements: planners on real terrain, the papers' tables, legs checked, uploads.", no_args_is_help=True
)


WithoutOption = Annotated[
    list[str] | None,
    typer.Option("--without", metavar="NAME", help="A search that the default planner does without; repeatable."),
]


OwnOption = Annotated[
    list[str] | None,
    typer.Option("--method", metavar="MODULE:FUNCTION", help="A method of your own beside the others; repeatable."),
]
QuickOption = Annotated[bool, typer.Option("--quick", help="A small part, which takes a minute or two.")]


def _tell(result: dict[str, Any], report: Callable[[Any], str], as_json: bool) -> None:
    if as_json:
        emit(result)
    else:
        put(report(result) + "\n")


@bench_app.command("check", short_help="Legs checked a second.")
def bench_check(
    legs: Annotated[int, typer.Option(metavar="N", help="Random one-kilometre legs.")] = 200_000,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of the legs.")] = 1,
    as_json: JsonOption = False,
) -> None:
    """Measure how many one-kilometre legs are checked per second, on the sample terrain."""
    from gcsplan.bench import check as bench

    result = bench.run(legs=legs, seed=seed)
    _tell(result, bench.report, as_json)


@bench_app.command("upload", short_help="Upload beside MAVSDK's; a fleet beside its slowest.")
def bench_upload(
    items: Annotated[
        int | None, typer.Option(metavar="N", help="Items of each mission [default: 600; of a fleet 50]")
    ] = None,
    runs: Annotated[int, typer.Option(metavar="N", help="Runs of each, in turn.")] = 15,
    fleet: Annotated[
        int | None, typer.Option(metavar="N", help="Instead: N vehicles at once, beside the slowest of them alone.")
    ] = None,
    drop: Annotated[float, typer.Option(metavar="P", help="With --fleet: part of the packets that is lost.")] = 0.05,
    as_json: JsonOption = False,
) -> None:
    """Measure uploads to the loopback vehicle, side by side with MAVSDK's upload to the same vehicle (extra `test`)."""
    from gcsplan.bench import upload as bench

    if fleet is not None:
        measured = bench.run_fleet(fleet=fleet, items=50 if items is None else items, drop=drop)
        _tell(measured, bench.report_fleet, as_json)
        return
    items = 600 if items is None else items
    result = bench.run(items=items, runs=runs)
    _tell(result, bench.report, as_json)


@bench_app.command("session", short_help="A living session: first path, cancelling, memory.")
def bench_session(
    changes: Annotated[int, typer.Option(metavar="N", help="Changes of the goal, on each terrain.")] = 40,
    cancels: Annotated[int, typer.Option(metavar="N", help="Plans that are cancelled at random moments.")] = 40,
    memory: Annotated[int, typer.Option(metavar="N", help="Changes over which memory is measured [0: none].")] = 0,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of missions and moments.")] = 1,
    as_json: JsonOption = False,
) -> None:
    """Measure a session of Python on the sample terrain with 40 zones and on a tile of one degree with 30 m posts."""
    from gcsplan.bench import session as bench

    _tell(bench.run(changes, cancels, memory, seed), bench.report, as_json)


@bench_app.command("map", short_help="The map's server: pointer to path.")
def bench_map(
    drags: Annotated[int, typer.Option(metavar="N", help="Drags of the goal over 50 places, on each terrain.")] = 8,
    memory: Annotated[int, typer.Option(metavar="N", help="Moves over which memory is measured [0: none].")] = 0,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of missions and drags.")] = 1,
    as_json: JsonOption = False,
) -> None:
    """Measure the server of gcsplan map with 40 and 200 zones, and on a tile of one degree (extra `map`)."""
    from gcsplan.bench import map as bench

    _tell(bench.run(drags, memory, seed), bench.report, as_json)


@bench_app.command("fleet", short_help="A large fleet, from mission file to upload.")
def bench_fleet(
    vehicles: Annotated[int, typer.Option(metavar="N", help="Vehicles, 2 to 2000.")] = 1000,
    interval: Annotated[float, typer.Option(metavar="S", help="Time between one arrival and the next.")] = 4.0,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of depots, places and zones.")] = 1,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Mission file and outputs go there.")] = Path(
        "bench-fleet"
    ),
    upload: Annotated[bool, typer.Option("--upload", help="Also upload to simulated vehicles.")] = False,
    jobs: JobsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Make the mission of a large fleet over the sample terrain, plan and export it, and sample all distances."""
    from gcsplan.bench import fleet as bench

    result = bench.run(vehicles, out, seed=seed, interval_s=interval, jobs=jobs, upload=upload)
    _tell(result, bench.report, as_json)


@bench_app.command("wind", short_help="Flights in declared winds, beside their windows.")
def bench_wind(
    flights: Annotated[int, typer.Option(metavar="N", help="Rehearsed flights in declared winds.")] = 1000,
    beyond: Annotated[int, typer.Option(metavar="N", help="Flights in winds beyond the declared ones.")] = 200,
    fleets: Annotated[
        int | None, typer.Option(metavar="N", help="Rehearsed fleets in place of flights: what order, intervals keep.")
    ] = None,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of missions and winds.")] = 1,
    quick: QuickOption = False,
    as_json: JsonOption = False,
) -> None:
    """Plan and rehearse copters and wings in constant winds, ranges, profiles, forecasts, and winds that vary.

    Gusts blow in half of the missions. Count the arrivals inside the windows, and the flights that take more energy
    than is planned. The exit code is 4 if there is one outside or above. With --fleets, count the fleets of copters and
    wings that keep order, intervals and separation in every run; 4 if a plan that does not say that its time table
    holds in still air alone is lost.
    """
    from gcsplan.bench import wind as bench
    from gcsplan.cli.output.console import remark

    if fleets is not None:
        result = bench.run_fleets(min(fleets, 4) if quick else fleets, seed=seed, tell=remark)
        _tell(result, bench.report_fleets, as_json)
        raise typer.Exit(4 if result["faults"] else 0)
    result = bench.run(
        min(flights, 40) if quick else flights, min(beyond, 20) if quick else beyond, seed=seed, tell=remark
    )
    _tell(result, bench.report, as_json)
    raise typer.Exit(4 if result["faults"] else 0)


@bench_app.command("functions", short_help="SSGWO's nine functions.")
def bench_functions(
    runs: Annotated[int, typer.Option(metavar="N", help="Runs of each (paper: 50).")] = 50,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of all runs.")] = 1,
    method: OwnOption = None,
    quick: QuickOption = False,
    jobs: JobsOption = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="DIR", help="CSV and Markdown go there.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Run SSGWO's tables 1 and 2 again, beside the printed numbers, with optima in the middle and moved."""
    from gcsplan.bench.files import ready

    with needs("gcsplan.research", "this benchmark"):
        from gcsplan.research.bench import functions as bench

    if out is not None:
        ready(out)  # find a bad directory before the long run
    chosen = (*bench.WOLVES, *(method or ()))
    result = bench.run(runs=min(runs, 3) if quick else runs, seed=seed, jobs=jobs, algorithms=chosen)
    if out is not None:
        bench.write(result, out)
    _tell(result, bench.report, as_json)


@bench_app.command("terrain", short_help="Planners over real terrain, beside OMPL and mealpy.")
def bench_terrain(
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Tables and figure go there.")] = Path(
        "bench-terrain"
    ),
    kinds: Annotated[
        str, typer.Option(metavar="LIST", help="Kinds of problems; `everyday` is one more.")
    ] = "main,energy,band,large,many,turn",
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of the problems.")] = 1,
    runs: Annotated[int, typer.Option(metavar="N", help="Runs of ours; medians are reported.")] = 9,
    seconds: Annotated[str, typer.Option(metavar="LIST", help="OMPL's seconds.")] = "1,10",
    rivals: Annotated[bool, typer.Option("--rivals/--no-rivals", help="Run OMPL too (extra `bench`).")] = True,
    swarms: Annotated[bool, typer.Option("--swarms/--no-swarms", help="Run mealpy too (extra `bench`).")] = True,
    kept: Annotated[bool, typer.Option("--kept", help="Rivals' answers already in DIR only.")] = False,
    minute: Annotated[bool, typer.Option("--minute", help="Ours once more with 60 s.")] = False,
    errors: Annotated[bool, typer.Option("--errors", help="With the clearance and errors of a real mission.")] = False,
    gap: Annotated[float, typer.Option("--gap", metavar="PERCENT", help="Certified gap at which ours may stop.")] = 0.1,
    count: Annotated[int | None, typer.Option(metavar="N", help="Problems of each group [default: all]")] = None,
    without: WithoutOption = None,
    method: OwnOption = None,
    quick: QuickOption = False,
) -> None:
    """Plan a set of problems made from a seed with every planner; the same exact check judges all."""
    from rich.console import Console

    from gcsplan.bench.terrain import report as terrain_report
    from gcsplan.bench.terrain import run as terrain
    from gcsplan.cli.output.console import RESULTS, remark

    try:
        budgets = [float(s) for s in seconds.split(",")]
    except ValueError:
        raise UsageError(f"--seconds takes numbers such as 1,10, given {seconds!r}") from None
    result = terrain.run(
        out, seed=seed, kinds=["main"] if quick else kinds.split(","), runs=1 if quick else runs,
        seconds=budgets[:1] if quick else budgets, rivals=rivals and not quick, swarms=swarms, kept_only=kept,
        long=minute, errors=errors, count=2 if quick else count, tell=remark, gap_percent=gap, without=without or (),
        methods=method or (),
    )  # fmt: skip
    Console(file=RESULTS, width=200).print(terrain_report.table(result.lines, f"terrain, seed {seed}"))


@bench_app.command("swarms", short_help="Swarms over real terrain, beside optimal.")
def bench_swarms(
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="DIR", help="Tables go there; the same command goes on there.")
    ] = Path("bench-swarms"),
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of the missions.")] = 1,
    count: Annotated[int | None, typer.Option(metavar="N", help="Missions of each group [default: all 20]")] = None,
    evaluations: Annotated[int, typer.Option(metavar="N", help="Paths that each search may try.")] = 10_000,
    method: Annotated[
        list[str] | None,
        typer.Option(
            "--method", metavar="NAME", help="krill, 'mealpy DE', …, or MODULE:FUNCTION beside them; repeatable [all]."
        ),
    ] = None,
    quick: QuickOption = False,
    encodings: Annotated[bool, typer.Option("--encodings", help="Compare encodings instead.")] = False,
    warm: Annotated[bool, typer.Option("--warm", help="Searches around the path of `optimal`, too.")] = False,
    jobs: JobsOption = None,
) -> None:
    """Search 60 missions with room by every swarm: raw legal, repaired or refused, and the length over `optimal`."""
    from rich.console import Console

    from gcsplan.cli.output.console import RESULTS, remark

    with needs("gcsplan.research", "this benchmark"):
        from gcsplan.research.bench.swarms import run as swarms

    result = swarms.run(
        out,
        seed=seed,
        count=1 if quick else count,
        evaluations=min(evaluations, 2000) if quick else evaluations,
        names=method,
        encodings=encodings,
        warm=warm,
        jobs=jobs,
        tell=remark,
    )
    Console(file=RESULTS, width=200).print(result.table())


@bench_app.command("everyday", short_help="A working day's missions, beside a visibility graph.")
def bench_everyday(
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Tables go there.")] = Path("bench-everyday"),
    seeds: Annotated[str, typer.Option(metavar="LIST", help="Seeds of the missions.")] = "1",
    count: Annotated[int, typer.Option(metavar="N", help="Missions of each seed.")] = 100,
    kinds: Annotated[str | None, typer.Option(metavar="LIST", help="Kinds of missions [default: all]")] = None,
    without: WithoutOption = None,
) -> None:
    """Plan short legs, walls, hooks, combs, rings, circles, polygons, vias, levels: flat, hills, the sample DEM."""
    from gcsplan.bench.everyday import run as everyday
    from gcsplan.bench.everyday.missions import EVERYDAY_KINDS
    from gcsplan.cli.output.console import remark

    try:
        numbers = [int(s) for s in seeds.split(",")]
    except ValueError:
        raise UsageError(f"--seeds takes whole numbers such as 1,2,3, given {seeds!r}") from None
    chosen = EVERYDAY_KINDS if kinds is None else kinds.split(",")
    outcomes = everyday.run(out, seeds=numbers, count=count, kinds=chosen, without=without or (), tell=remark)
    put(everyday.report(outcomes))


@bench_app.command("papers", short_help="The five papers' tables run again.")
def bench_papers(
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="DIR", help="Runs and report; the same command goes on there.")
    ] = Path("papers"),
    scenario: Annotated[
        list[str] | None,
        typer.Option("--scenario", metavar="NAME", help="Run this mission of missions/papers; repeatable [all]."),
    ] = None,
    algorithm: Annotated[
        list[str] | None,
        typer.Option(
            "--algorithm", metavar="NAME", help="Run this algorithm or reading (`ssgwo:leaders-all`); repeatable [all]."
        ),
    ] = None,
    method: OwnOption = None,
    quick: QuickOption = False,
    runs: Annotated[int | None, typer.Option(metavar="N", help="Runs of each [the paper's number, or 30].")] = None,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of all runs.")] = 1,
    jobs: JobsOption = None,
    cluster: ClusterOption = None,
    missions: Annotated[Path | None, typer.Option(metavar="DIR", help="Where the mission files are.")] = None,
    readings: Annotated[
        bool, typer.Option("--readings/--no-readings", help="Run other readings of the papers too.")
    ] = True,
    speed: Annotated[
        bool, typer.Option("--speed", help="Measure speed instead, beside mealpy's (extra `bench`).")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Run every scenario and algorithm of the five papers, beside their printed numbers, straight line and optimum."""
    if speed:
        with needs("gcsplan.research", "this benchmark"):
            from gcsplan.research.bench.papers import speed as papers_speed

        measured = papers_speed.run(missions=missions)
        if as_json:
            emit(measured)
        else:
            put(papers_speed.report(measured))
        return
    with needs("gcsplan.research", "this benchmark"):
        from gcsplan.research.bench.papers import report as papers_report
        from gcsplan.research.bench.papers import run as papers

    if quick:
        scenario, runs, readings = scenario or ["krill-mound"], min(runs or 2, 2), False
    result = papers.run(
        scenario or None, [*(algorithm or ()), *(method or ())] or None, runs, seed, jobs, out, cluster, None,
        missions=missions, readings=readings,
    )  # fmt: skip
    files = papers_report.write(result, out)
    if as_json:
        emit(papers.plain(result) | {"files": [str(file) for file in files]})
    else:
        put(papers_report.report(result))


@bench_app.command("metabox", short_help="Our optimisers beside MetaEvoBox's, on its UAV family.")
def bench_metabox(
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Instances and tables go there.")] = Path(
        "bench-metabox"
    ),
    python: Annotated[
        Path | None,
        typer.Option("--python", metavar="FILE", help="Python of MetaEvoBox's environment [default: this one]."),
    ] = None,
    instances: Annotated[int, typer.Option(metavar="N", help="Generated instances, 15 and 30 threats in turn.")] = 2,
    runs: Annotated[int, typer.Option(metavar="N", help="Runs of each optimiser on each instance.")] = 5,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of instances and runs.")] = 1,
    evaluations: Annotated[
        int, typer.Option(metavar="N", help="Evaluations in each run; the default is MetaEvoBox's.")
    ] = 2500,
    algorithm: Annotated[
        list[str] | None,
        typer.Option("--algorithm", metavar="NAME", help="Run this optimiser, ours or theirs; repeatable [all]."),
    ] = None,
    jobs: Annotated[int, typer.Option(metavar="N", help="Processes of MetaEvoBox.")] = 1,
    as_json: JsonOption = False,
) -> None:
    """Run our optimisers beside MetaEvoBox's own on generated instances of its UAV family (extra `metabox`)."""
    from gcsplan.cli.output.console import remark

    with needs("gcsplan.research", "this benchmark"):
        from gcsplan.research.bench.metabox import run as metabox

    def tell(done: int, of: int) -> None:
        if done % 50 == 0 or done == of:
            remark(f"{done} of {of} runs")

    result = metabox.run(
        out, python, instances=instances, runs=runs, seed=seed, evaluations=evaluations,
        algorithms=algorithm or None, jobs=jobs, done=tell,
    )  # fmt: skip
    files = metabox.write(result, out)
    if as_json:
        emit(result | {"rows": metabox.rows(result), "files": [str(file) for file in files]})
    else:
        put(metabox.report(result))


@bench_app.command("scale", short_help="Cost against size, and what a cluster would do.")
def bench_scale(
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Tables and picture go there.")] = Path(
        "bench-scale"
    ),
    axes: Annotated[str, typer.Option(metavar="LIST", help="Sizes to vary.")] = "missions,vehicles,zones,cells,workers",
    missions: Annotated[int, typer.Option(metavar="N", help="Missions of the longest batch.")] = 40,
    workers: Annotated[int, typer.Option(metavar="N", help="Processes that share a batch, at most.")] = 2,
    kill: Annotated[bool, typer.Option("--kill", help="Also kill a worker in the middle of a batch.")] = False,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of missions and hills.")] = 1,
    as_json: JsonOption = False,
) -> None:
    """Measure time and memory against missions, vehicles, zones, cells of the DEM and workers (extra `cluster`)."""
    from gcsplan.bench.files import ready
    from gcsplan.bench.scale import run as bench
    from gcsplan.cli.output.console import remark

    ready(out)  # find a bad directory before the long run
    result = bench.run(axes.split(","), missions, workers, seed, kill=kill, tell=remark)
    bench.write(result, out)
    _tell(result, bench.report, as_json)
