"""The papers' report: plain text for the terminal; CSV, Markdown, PNG and one self-contained HTML page as files."""

from __future__ import annotations

import base64
import csv
import html
import io
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gcsplan.bench.papers_printed import Number, Row
from gcsplan.bench.papers_remarks import legend, remarks, schedules
from gcsplan.bench.papers_statistics import FEW, LEAST_RUNS_TO_JUDGE, SIGNIFICANCE
from gcsplan.export.outdir import write_whole

IMPOSSIBLE, UNREACHED = "†", "‡"
LEGEND = (
    f"{IMPOSSIBLE} impossible: below the physical minimum (the straight line between the printed ends, its energy by "
    "Table 1), or a mean pitch that no path of the printed mean length has.",
    f"{UNREACHED} below the bound that is proven for the scenario as it stands here.",
)
UNITS = {"m": "m", "j": "J", "deg": "°"}
TITLE = "The five papers' experiments"

Summary = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Column:
    """``ours`` formats a row's value; ``printed`` are the papers' names for it; ``brief``: also in the terminal."""

    title: str
    ours: Callable[[dict[str, Any]], str]
    printed: tuple[str, ...] = ()
    brief: bool = False


@dataclass(frozen=True, slots=True)
class Table:
    """Plain cells under a heading, with notes."""

    heading: str
    header: tuple[str, ...]
    rows: list[tuple[str, ...]]
    notes: list[str] = field(default_factory=list)


def _number(key: str, digits: int) -> Callable[[dict[str, Any]], str]:
    return lambda row: "–" if row[key] is None else f"{row[key]:,.{digits}f}"


def _significant(value: float | None) -> str:
    """A number with five digits or more, so that a cost of any size can be read."""
    if value is None:
        return "–"
    whole = len(str(int(abs(value)))) if abs(value) >= 1.0 else 0
    return f"{value:,.{max(0, 5 - whole)}f}"


def _cost(key: str) -> Callable[[dict[str, Any]], str]:
    return lambda row: _significant(row[key])


def _mean(name: str, digits: int | None) -> Callable[[dict[str, Any]], str]:
    def words(row: dict[str, Any]) -> str:
        mean, std = row[f"mean_{name}"], row[f"std_{name}"]
        worded = [_significant(x) if digits is None or x is None else f"{x:,.{digits}f}" for x in (mean, std)]
        return worded[0] if std is None else " ± ".join(worded)

    return words


_COLUMNS = (
    _Column("algorithm", lambda row: row["algorithm"], brief=True),
    _Column("legal runs", lambda row: f"{row['legal']}/{row['runs']}", brief=True),
    _Column("best legal, m", _number("best_legal_length_m", 2), brief=True),
    _Column("best, m", _number("best_length_m", 2), ("best_length_m",)),
    _Column("mean ± std, m", _mean("length_m", 1), ("mean_length_m", "length_m", "length_sum_m"), brief=True),
    _Column(
        "collided runs (legs)", lambda row: f"{row['collided']} ({row['collisions']})", ("collisions",), brief=True
    ),
    _Column("time, CPU s", _mean("time_s", 2), ("time_s",), brief=True),
    _Column("evaluations", _number("mean_evaluations", 0), brief=True),
    _Column("pitch, °", _mean("pitch_deg", 1), ("pitch_deg",)),
    _Column("yaw, °", _mean("yaw_deg", 1), ("yaw_deg",)),
    _Column("to cylinders, m", _number("mean_nearest_m", 0), ("nearest_m",)),
    _Column("energy, J", _mean("energy_j", 0), ("energy_j",)),
    _Column("cost, best", _cost("best_cost"), ("best_cost",)),
    _Column("cost, mean ± std", _mean("cost", None), ("mean_cost",), brief=True),
    _Column("cost, median", _cost("median_cost"), ("median_cost",)),
    _Column("cost at equal evaluations", _cost("mean_cost_at_equal_evaluations")),
    _Column("iterations to 1 %", _number("median_converged", 0)),
)


def scenario_table(summary: Summary, *, brief: bool = False) -> Table:
    """A scenario's algorithms; each measured number is followed by the printed one if there is one."""
    cells: list[list[str]] = [[] for _ in summary["rows"]]
    header: list[str] = []
    for column in _COLUMNS:
        if brief and not column.brief:
            continue
        words = [column.ours(row) for row in summary["rows"]]
        if all(word == "–" for word in words) and not brief:
            continue
        header.append(column.title)
        for line, word in zip(cells, words, strict=True):
            line.append(word)
        printed = [_printed(summary, row["algorithm"], column.printed) for row in summary["rows"]]
        if any(printed):
            header.append("printed")
            for line, word in zip(cells, printed, strict=True):
                line.append(word or "–")
    return Table(summary["name"], tuple(header), [tuple(line) for line in cells], _notes(summary))


def _printed(summary: Summary, algorithm: str, names: Sequence[str]) -> str:
    row: Row = summary["printed"].get(algorithm, {})
    for name in names:
        if name == "length_sum_m" and "length_1_m" in row:
            parts = [row[f"length_{i}_m"] for i in range(1, 5)]
            bad = any(f"length_{i}_m" in summary["faults"][algorithm] for i in range(1, 5))
            return f"{sum(p.value for p in parts):.2f}" + (f" {IMPOSSIBLE}" if bad else "")
        if name in row:
            return row[name].text + _mark(summary, algorithm, name, row[name])
    return ""


def _mark(summary: Summary, algorithm: str, name: str, number: Number) -> str:
    if name in summary["faults"][algorithm]:
        return f" {IMPOSSIBLE}"
    bound = summary["bound_m"] if name in ("length_m", "best_length_m", "mean_length_m") else None
    return f" {UNREACHED}" if bound is not None and number.below(bound) else ""


def _notes(summary: Summary) -> list[str]:
    straight = f"Straight line: {summary['straight_m']:,.2f} m"
    if summary["optimum_j"] is not None:
        straight += f", {summary['straight_j']:,.0f} J"
    if summary["optimum_m"] is None:
        best = f"the planner optimal: {summary['optimum_refused'] or 'no path'}"
    else:
        best = f"the planner optimal: {summary['optimum_m']:,.2f} m"
        best += "" if summary["bound_m"] is None else f", and no path is below {summary['bound_m']:,.2f} m"
        if summary["optimum_j"] is not None:
            best += f"; for energy {summary['optimum_j']:,.0f} J"
            best += "" if summary["bound_j"] is None else f" (none below {summary['bound_j']:,.0f} J)"
    out = [f"{straight}; {best}."]
    legal = [row["best_legal_length_m"] for row in summary["rows"] if row["best_legal_length_m"] is not None]
    if legal and summary["optimum_m"] is not None:
        part = 100.0 * (min(legal) / summary["optimum_m"] - 1.0)
        words = "above the planner optimal's" if part >= 0.0 else "below the path that the planner optimal found"
        out.append(f"The shortest legal run is {min(legal):,.2f} m, {abs(part):.2f} % {words}.")
    level = summary["rows"][0]["equal_evaluations"]
    out.append(f"“Equal evaluations” are the first {level:,} of each run, its schedule being that of the whole run.")
    reasons = {
        f"{name} {summary['printed'][name][measure].text} {UNITS[measure.rpartition('_')[2]]}: {why}"
        for name, bad in summary["faults"].items()
        for measure, why in bad.items()
    }
    out += [f"{IMPOSSIBLE} {reason}." for reason in sorted(reasons)]
    return out + remarks(summary["name"])


def claims_table(claims: Sequence[dict[str, Any]]) -> Table:
    """Every ranking that the papers claim, with its verdict."""
    rows: list[tuple[str, ...]] = [
        (
            c["scenario"], c["source"], c["measure"], c["claim"], _median(c["median_low"]), _median(c["median_high"]),
            "–" if c["p"] is None else f"{c['p']:.2g}", c["verdict"],
        )
        for c in claims
    ]  # fmt: skip
    header = ("scenario", "printed in", "measure", "claim", "median", "against", "p (Holm)", "verdict")
    return Table("Rankings", header, rows, verdicts(claims))


def _median(value: float | None) -> str:
    return "illegal" if value is None else _significant(value)


def verdicts(claims: Sequence[dict[str, Any]]) -> list[str]:
    """How many claims of each paper were reproduced, in words."""
    if not claims:
        return []
    out = [
        f"Mann and Whitney's U, one-sided, Holm-corrected over all claims of a paper, p < {SIGNIFICANCE:g}; "
        "runs that break a limit rank last in length and energy (“illegal”: half of the runs or more)."
    ]
    for paper in dict.fromkeys(c["paper"] for c in claims):
        count = Counter(c["verdict"] for c in claims if c["paper"] == paper)
        out.append(f"{paper}: " + ", ".join(f"{number} {verdict}" for verdict, number in count.items()) + ".")
    if any(c["verdict"] == FEW for c in claims):
        out.append(f"Rankings are judged from {LEAST_RUNS_TO_JUDGE} runs on.")
    return out


def tables(result: dict[str, Any]) -> Iterator[tuple[Summary | None, Table]]:
    """All tables; those of scenarios come with their summary."""
    for summary in result["scenarios"]:
        yield summary, scenario_table(summary)
        header, rows = schedules(summary)
        if rows:
            yield None, Table(f"{summary['name']}: schedule", header, rows, legend(rows))
    if result["claims"]:
        yield None, claims_table(result["claims"])


def report(result: dict[str, Any]) -> str:
    """The report for the terminal: the main columns of each scenario, and the verdicts."""
    from rich.console import Console
    from rich.table import Table as RichTable

    page = io.StringIO()
    console = Console(file=page, width=170, color_system=None)
    for summary in result["scenarios"]:
        shown = scenario_table(summary, brief=True)
        grid = RichTable(title=summary["name"], title_justify="left", box=None, padding=(0, 2, 0, 0))
        for k, column in enumerate(shown.header):
            grid.add_column(column, justify="right" if k else "left", no_wrap=True)
        for row in shown.rows:
            grid.add_row(*row)
        console.print(grid)
        page.write(shown.notes[0] + "\n\n")
    lines = [line.rstrip() for line in page.getvalue().splitlines()]
    return "\n".join([*lines, *LEGEND, *verdicts(result["claims"])]) + "\n"


def write(result: dict[str, Any], out: Path) -> list[Path]:
    """Write ``papers.csv``, ``papers-claims.csv``, ``papers.md``, ``papers.html``, and two pictures per scenario.

    Each file is written whole or not at all. Raises InputError if one cannot be written.
    """
    from gcsplan.bench.papers_pictures import draw_convergence, draw_map

    pictures = {}
    for summary in result["scenarios"]:
        pictures[f"{summary['name']}-map.png"] = draw_map(summary)
        pictures[f"{summary['name']}-convergence.png"] = draw_convergence(summary)
    files: dict[str, str | bytes] = {
        "papers.csv": _csv([_flat(row) for summary in result["scenarios"] for row in summary["rows"]]),
        "papers-claims.csv": _csv(result["claims"]),
        "papers.md": "\n".join(_markdown(result)) + "\n",
        "papers.html": "\n".join(_page(result, pictures)) + "\n",
        **pictures,
    }
    for name, content in files.items():
        write_whole(out / name, content)
    return [out / name for name in files]


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    lengths = row["vehicle_lengths_m"]
    return row | {"vehicle_lengths_m": "" if lengths is None else " ".join(f"{x:.3f}" for x in lengths)}


def _csv(rows: Sequence[dict[str, Any]]) -> str:
    text = io.StringIO(newline="")
    if rows:
        writer = csv.DictWriter(text, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return text.getvalue()


def _about(result: dict[str, Any]) -> str:
    runs = result["settings"]["runs"]
    return (
        f"{'The papers’ numbers of' if runs is None else runs} runs of each algorithm, seed "
        f"{result['settings']['seed']}, the same for all. Lengths, pitch, yaw and energy are of all runs; a run is "
        "legal if the exact check finds no limit broken on its curve. Nothing was repaired. Time is of one core."
    )


def _markdown(result: dict[str, Any]) -> Iterator[str]:
    yield from (f"# {TITLE}", "", _about(result), "")
    for line in LEGEND:
        yield from (line, "")
    for summary, table in tables(result):
        yield from (f"## {table.heading}", "")
        if summary is not None:
            yield from (summary["source"], "")
        yield f"| {' | '.join(table.header)} |"
        yield f"| {' | '.join('---' if k == 0 else '---:' for k in range(len(table.header)))} |"
        for row in table.rows:
            yield f"| {' | '.join(row)} |"
        yield ""
        for note in table.notes:
            yield f"- {note}"
        yield ""
        if summary is not None:
            for what in ("map", "convergence"):
                yield from (f"![{summary['name']}, {what}]({summary['name']}-{what}.png)", "")


_STYLE = (
    "body{font:15px/1.45 system-ui,sans-serif;margin:2em;max-width:110em}table{border-collapse:collapse;font-size:13px}"
    "th,td{padding:.2em .6em;border-bottom:1px solid #ccc;text-align:right;white-space:nowrap}"
    "th:first-child,td:first-child{text-align:left}.wide{overflow-x:auto}img{max-width:100%;vertical-align:top}"
    "figure{display:inline-block;margin:1em 1em 1em 0}"
)


def _page(result: dict[str, Any], pictures: dict[str, bytes]) -> Iterator[str]:
    yield f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{TITLE}</title>'
    yield f"<style>{_STYLE}</style></head><body><h1>{TITLE}</h1><p>{html.escape(_about(result))}</p>"
    for line in LEGEND:
        yield f"<p>{html.escape(line)}</p>"
    for summary, table in tables(result):
        yield f"<h2>{html.escape(table.heading)}</h2>"
        if summary is not None:
            yield f"<p>{html.escape(summary['source'])}</p>"
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in table.header)
        yield f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>'
        for row in table.rows:
            yield f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>"
        yield "</tbody></table></div><ul>"
        for note in table.notes:
            yield f"<li>{html.escape(note)}</li>"
        yield "</ul>"
        if summary is not None:
            for what in ("map", "convergence"):
                name = f"{summary['name']}-{what}.png"
                data = base64.b64encode(pictures[name]).decode()
                yield f'<figure><img src="data:image/png;base64,{data}" alt="{name}"></figure>'
    yield "</body></html>"
