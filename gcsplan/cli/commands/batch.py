"""`gcsplan batch`."""

from __future__ import annotations

from os.path import isfile  # a name that no disk can hold is no file, rather than an error
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcsplan.cli.arguments.options import (
    AtOption,
    ClusterOption,
    JobsOption,
    JsonOption,
    ObjectiveOption,
    PlannerOption,
    SeedOption,
    UnitsChoice,
    UnitsOption,
    UnjudgedOption,
)  # fmt: skip
from gcsplan.cli.process.exit import emit
from gcsplan.errors import InputError
from gcsplan.figures import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gcsplan.app.batch import Record

MOST_FAILURES = 20
"""Missions without a plan that are printed at most; the table has all of them."""


def batch(
    missions: Annotated[
        list[str],
        typer.Argument(metavar="MISSION…", help="Mission files, folders of them, or patterns ('north/*.yaml')."),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Directory of all results.")],
    jobs: JobsOption = None,
    cluster: ClusterOption = None,
    planner: PlannerOption = None,
    objective: ObjectiveOption = None,
    seed: SeedOption = None,
    at: AtOption = None,
    report: Annotated[bool, typer.Option("--report", help="Also write a report.html for each mission.")] = False,
    allow_unjudged: UnjudgedOption = False,
    units: UnitsOption = UnitsChoice.METRIC,
    as_json: JsonOption = False,
) -> None:
    """Plan many mission files: a table of all results, a page with a map, the outputs of each.

    Nothing is sent. A mission that fails never stops the others, and the exit code is the worst. A mission that is
    planned and unchanged is not planned again, so that the same command goes on after an interruption.
    """
    from gcsplan.app.batch import MISSION_S, BatchOptions, MissionBatch, exit_code, missions_of
    from gcsplan.app.parallel.executor import executor
    from gcsplan.app.plan.model import PlanOptions
    from gcsplan.cli.output.console import remark, say
    from gcsplan.cli.output.progress import WorkDisplay

    options = BatchOptions(PlanOptions(planner, objective, seed, at=at), report, allow_unjudged)
    work = MissionBatch(missions_of(missions), out, options)
    display = WorkDisplay(len(work.missions), "missions")
    with work.alone():
        done, todo = work.known()
        if done:
            failed = sum(r.code != 0 for r in done)
            without = f", {failed} of them without a plan" if failed else ""
            remark(f"{len(done)} of {len(work.missions)} missions are done and unchanged{without}")

        def on_done(record: Record) -> None:
            done.append(record)
            display.done(len(done), f", {sum(r.code != 0 for r in done)} without a plan")

        pages = [] if report else [page for k in todo if isfile(page := out / work.missions[k][0] / "report.html")]
        try:
            if todo:
                with executor(jobs, cluster, pieces=len(todo), piece_s=MISSION_S) as workers:
                    display.workers(workers)
                    work.run(workers, todo, on_done)
        finally:
            order = {name: k for k, (name, _) in enumerate(work.missions)}
            done.sort(key=lambda r: order[r.mission])
            gone = sum(not page.is_file() for page in pages)
            if gone:
                remark(f"{counted(gone, 'report')} of earlier plans are gone; --report writes them anew")
            written = _tables(out, done, units, "report.html" if report else "summary.json") if done else []
    if as_json:
        emit({"missions": len(work.missions), "rows": [dict(row) for r in done for row in r.rows]})
    else:
        bad = [r for r in done if r.code != 0]
        for record in bad[:MOST_FAILURES]:
            row = next(row for row in record.rows if row["code"] != 0)
            name = f"{record.mission} {row['vehicle']}".rstrip()
            say(f"{name}: {row['verdict']}: {str(row['message']).splitlines()[0]}")
        if len(bad) > MOST_FAILURES:
            say(f"… and {len(bad) - MOST_FAILURES} more; the table has all of them")
        count = sum(row["code"] == 0 for r in done for row in r.rows)
        took = f"{count} vehicles, in {display.elapsed_s:.1f} s"
        say(f"{len(done) - len(bad)} of {len(done)} missions planned, {took}")
        say(f"written to {out}/: {', '.join(written)}")
    raise typer.Exit(exit_code(done))


def _tables(out: Path, done: Sequence[Record], units: UnitsChoice, page: str) -> list[str]:
    """Write the table and the page of all results; returns their names."""
    from gcsplan.app.batch import columns_of
    from gcsplan.cli.output.console import remark
    from gcsplan.export.outdir import write_whole
    from gcsplan.export.table import csv_text, parquet_bytes
    from gcsplan.report.index_page import render_index
    from gcsplan.units import units_of

    rows = [row for record in done for row in record.rows]
    tracks = [track for r in done for track in (*r.tracks, *[[]] * (len(r.rows) - len(r.tracks)))]
    drawn = {k: track for k, track in enumerate(tracks) if len(track) > 1}
    files: dict[str, str | bytes] = {
        "results.csv": csv_text(columns_of(rows), rows),
        "index.html": render_index(
            out.resolve().name, rows, drawn, [r.ground for r in done if r.ground is not None], units_of(units), page
        ),
    }
    try:
        files["results.parquet"] = parquet_bytes(columns_of(rows), rows)
    except InputError as why:
        remark(f"note: results.parquet is not written: {why}")
    for name, content in files.items():
        write_whole(out / name, content)
    return sorted(files)
