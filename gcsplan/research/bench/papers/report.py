"""The papers' report: plain text for the terminal; CSV, Markdown, PNG and one self-contained HTML page as files.

All but the files of times are the same to the byte whenever the same runs are made.

`remarks` are on the papers' printed tables, each computed from the table's own numbers.
"""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

from gcsplan.bench.files import write_all
from gcsplan.export.table import csv_of
from gcsplan.research.bench.papers.printed import PRINTED, PrintedNumber, PrintedRow
from gcsplan.research.bench.papers.scenarios import SCENARIOS, ReadyScenario
from gcsplan.research.bench.papers.statistics import schedule
from gcsplan.research.bench.papers.tables import (
    PaperTable,
    claims_table,
    counts,
    readings_table,
    significant,
    stands,
    times_tables,
)

IMPOSSIBLE_MARK, UNREACHED_MARK = "†", "‡"
LEGEND = (
    f"{IMPOSSIBLE_MARK} impossible: below the physical minimum (the straight line between the printed ends, its energy "
    "by Table 1), or a mean pitch that no path of the printed mean length has.",
    f"{UNREACHED_MARK} below the bound that is proven for the scenario as it stands here.",
)
FAULT_UNITS = {"m": "m", "j": "J", "deg": "°"}
PAPERS_TITLE = "The five papers' experiments"

ScenarioSummary = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Column:
    """``ours`` formats a row's value; ``printed`` are the papers' names for it; ``brief``: also in the terminal."""

    title: str
    ours: Callable[[dict[str, Any]], str]
    printed: tuple[str, ...] = ()
    brief: bool = False


def _number(key: str, digits: int) -> Callable[[dict[str, Any]], str]:
    return lambda row: "–" if row[key] is None else f"{row[key]:,.{digits}f}"


def _cost(key: str) -> Callable[[dict[str, Any]], str]:
    return lambda row: significant(row[key])


def _mean(name: str, digits: int | None) -> Callable[[dict[str, Any]], str]:
    def words(row: dict[str, Any]) -> str:
        mean, std = row[f"mean_{name}"], row[f"std_{name}"]
        worded = [significant(x) if digits is None or x is None else f"{x:,.{digits}f}" for x in (mean, std)]
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


def scenario_table(summary: ScenarioSummary, *, brief: bool = False) -> PaperTable:
    """A scenario's algorithms, then the planner optimal's path and its certified bound; each measured number is
    followed by the printed one if there is one."""
    header, rows = _cells(summary, summary["rows"], brief)
    rows += [_reference(header, summary, name, key) for name, key in (("optimal", "optimum"), ("its bound", "bound"))]
    return PaperTable(summary["name"], header, rows, _notes(summary))


def readings_of_scenario(summary: ScenarioSummary) -> PaperTable:
    """The same numbers of other readings of the paper."""
    header, rows = _cells(summary, summary["reading_rows"], brief=False)
    return PaperTable(f"{summary['name']}: other readings", header, rows)


def _reference(header: Sequence[str], summary: ScenarioSummary, name: str, key: str) -> tuple[str, ...]:
    """A row of a path that no swarm found: its length, and its energy if it is known."""
    cells = ["–"] * len(header)
    cells[0] = name
    for title, value, digits in (("best legal, m", summary[f"{key}_m"], 2), ("energy, J", summary[f"{key}_j"], 0)):
        if value is not None and title in header:
            cells[header.index(title)] = f"{value:,.{digits}f}"
    return tuple(cells)


def _cells(
    summary: ScenarioSummary, lines: Sequence[Any], brief: bool
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    cells: list[list[str]] = [[] for _ in lines]
    header: list[str] = []
    for column in _COLUMNS:
        if brief and not column.brief:
            continue
        words = [column.ours(row) for row in lines]
        if all(word == "–" for word in words) and not brief and column.title != "best legal, m":
            continue
        header.append(column.title)
        for line, word in zip(cells, words, strict=True):
            line.append(word)
        printed = [_printed(summary, row["algorithm"], column.printed) for row in lines]
        if any(printed):
            header.append("printed")
            for line, word in zip(cells, printed, strict=True):
                line.append(word or "–")
    return tuple(header), [tuple(line) for line in cells]


def _printed(summary: ScenarioSummary, algorithm: str, names: Sequence[str]) -> str:
    row: PrintedRow = summary["printed"].get(algorithm, {})
    for name in names:
        if name == "length_sum_m" and "length_1_m" in row:
            parts = [row[f"length_{i}_m"] for i in range(1, 5)]
            bad = any(f"length_{i}_m" in summary["faults"][algorithm] for i in range(1, 5))
            return f"{sum(p.value for p in parts):.2f}" + (f" {IMPOSSIBLE_MARK}" if bad else "")
        if name in row:
            return row[name].text + _mark(summary, algorithm, name, row[name])
    return ""


def _mark(summary: ScenarioSummary, algorithm: str, name: str, number: PrintedNumber) -> str:
    if name in summary["faults"][algorithm]:
        return f" {IMPOSSIBLE_MARK}"
    bound = summary["bound_m"] if name in ("length_m", "best_length_m", "mean_length_m") else None
    return f" {UNREACHED_MARK}" if bound is not None and number.below(bound) else ""


def _notes(summary: ScenarioSummary) -> list[str]:
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
    level = summary["equal_evaluations"]
    out.append(f"“Equal evaluations” are the first {level:,} of each run, with the schedule of the whole run.")
    reasons = {
        f"{name} {summary['printed'][name][measure].text} {FAULT_UNITS[measure.rpartition('_')[2]]}: {why}"
        for name, bad in summary["faults"].items()
        for measure, why in bad.items()
    }
    out += [f"{IMPOSSIBLE_MARK} {reason}." for reason in sorted(reasons)]
    return out + remarks(summary["name"])


def tables(result: dict[str, Any]) -> Iterator[tuple[ScenarioSummary | None, PaperTable]]:
    """All tables; a scenario's table comes with its summary."""
    if result["claims"]:
        yield None, claims_table(result["claims"])
    if result["readings"]:
        yield None, readings_table(result["readings"])
    for summary in result["scenarios"]:
        yield summary, scenario_table(summary)
        if summary["reading_rows"]:
            yield None, readings_of_scenario(summary)
        header, rows = schedules(summary)
        if rows:
            yield None, PaperTable(f"{summary['name']}: schedule", header, rows, legend(rows))


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
    judged = [*result["claims"], *result["times"]["claims"]]
    return "\n".join([*lines, *LEGEND, *counts(judged)]) + "\n"


def pictures_of(summary: ScenarioSummary) -> dict[str, bytes]:
    """PNG of a scenario by file name; none if readings alone were run."""
    from gcsplan.research.bench.papers.pictures import draw_boxes, draw_convergence, draw_fleet, draw_map, draw_space

    if not summary["records"]:
        return {}
    drawn = {"map": draw_map, "space": draw_space, "convergence": draw_convergence, "boxes": draw_boxes}
    out = {f"{summary['name']}-{what}.png": draw(summary) for what, draw in drawn.items()}
    fleet = draw_fleet(summary)
    return out if fleet is None else out | {f"{summary['name']}-fleet.png": fleet}


def write(
    result: dict[str, Any], out: Path, draw: Callable[[ScenarioSummary], dict[str, bytes]] = pictures_of
) -> list[Path]:
    """Write ``papers.csv``, ``papers.md``, ``papers.html``, ``papers-claims.csv`` and ``.md``, ``papers-readings.csv``,
    pictures of each scenario, and apart from them ``papers-times.csv`` and ``.md`` with all that a clock has measured.

    ``draw`` makes a scenario's pictures. Each file is written whole or not at all. Raises InputError if one cannot be
    written.
    """
    pictures = {name: data for summary in result["scenarios"] for name, data in draw(summary).items()}
    contents: dict[str, str | bytes] = {
        "papers.csv": _csv([_flat(s, row) for s in result["scenarios"] for row in (*s["rows"], *s["reading_rows"])]),
        "papers-claims.csv": _csv(result["claims"]),
        "papers-claims.md": "\n".join(_claims(result)).rstrip() + "\n",
        "papers-readings.csv": _csv(result["readings"]),
        "papers-times.csv": _csv(result["times"]["rows"]),
        "papers-times.md": "\n".join(_times(result)) + "\n",
        "papers.md": "\n".join(_markdown(result, pictures)) + "\n",
        "papers.html": "\n".join(_page(result, pictures)) + "\n",
        **pictures,
    }
    return write_all(out, contents)


def _flat(summary: ScenarioSummary, row: dict[str, Any]) -> dict[str, Any]:
    lengths = row["vehicle_lengths_m"]
    return row | {
        "vehicle_lengths_m": "" if lengths is None else " ".join(f"{x:.3f}" for x in lengths),
        "optimum_m": summary["optimum_m"],
        "bound_m": summary["bound_m"],
    }


def _csv(rows: Sequence[dict[str, Any]]) -> str:
    names = list(rows[0]) if rows else []
    return csv_of([names, *([row.get(name) for name in names] for row in rows)], end="\r\n") if rows else ""


def _about(result: dict[str, Any]) -> str:
    runs = result["settings"]["runs"]
    return (
        f"{'The papers’ numbers of' if runs is None else runs} runs of each algorithm, seed "
        f"{result['settings']['seed']}, the same for all. Lengths, pitch, yaw and energy are of all runs; a run is "
        "legal if the exact check finds no limit broken on its curve. Nothing was repaired. Made by the code "
        f"{result['settings']['code']} (`gcsplan bench papers`)."
    )


def _times(result: dict[str, Any]) -> Iterator[str]:
    yield from (f"# {PAPERS_TITLE}: times", "", "Seconds of one core.", "")
    for table in times_tables(result["times"]):
        yield from (f"## {table.heading}", "")
        yield from table.markdown()


def _stands(result: dict[str, Any]) -> Iterator[str]:
    yield from ("## What stands", "")
    for title, sentences in stands(result):
        yield from (f"### {title}", "", *(f"- {sentence}" for sentence in sentences), "")


def _claims(result: dict[str, Any]) -> Iterator[str]:
    """The page that one cites: what stands, every claim, every reading; it needs no other file."""
    yield from (f"# {PAPERS_TITLE}: what stands", "", _about(result), "")
    yield from _stands(result)
    for table in (claims_table(result["claims"]), readings_table(result["readings"])):
        if table.rows:
            yield from (f"## {table.heading}", "")
            yield from table.markdown()


def _of(summary: ScenarioSummary | None, pictures: Iterable[str]) -> list[str]:
    """The pictures of a scenario."""
    if summary is None:
        return []
    return [name for name in pictures if name.rpartition("-")[0] == summary["name"]]


def _markdown(result: dict[str, Any], pictures: Iterable[str]) -> Iterator[str]:
    yield from (f"# {PAPERS_TITLE}", "", _about(result), "")
    for line in LEGEND:
        yield from (line, "")
    yield from _stands(result)
    for summary, table in tables(result):
        yield from (f"## {table.heading}", "")
        if summary is not None:
            yield from (summary["source"], "")
        yield from table.markdown()
        for name in _of(summary, pictures):
            yield from (f"![{name.removesuffix('.png')}]({name})", "")


_STYLE = (
    "body{font:15px/1.45 system-ui,sans-serif;margin:2em;max-width:110em}table{border-collapse:collapse;font-size:13px}"
    "th,td{padding:.2em .6em;border-bottom:1px solid #ccc;text-align:right;white-space:nowrap}"
    "th:first-child,td:first-child{text-align:left}.wide{overflow-x:auto}img{max-width:100%;vertical-align:top}"
    "figure{display:inline-block;margin:1em 1em 1em 0}"
)


def _page(result: dict[str, Any], pictures: dict[str, bytes]) -> Iterator[str]:
    yield f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{PAPERS_TITLE}</title>'
    yield f"<style>{_STYLE}</style></head><body><h1>{PAPERS_TITLE}</h1><p>{html.escape(_about(result))}</p>"
    for line in LEGEND:
        yield f"<p>{html.escape(line)}</p>"
    yield "<h2>What stands</h2>"
    for title, sentences in stands(result):
        items = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in sentences)
        yield f"<h3>{html.escape(title)}</h3><ul>{items}</ul>"
    for summary, table in tables(result):
        yield f"<h2>{html.escape(table.heading)}</h2>"
        if summary is not None:
            yield f"<p>{html.escape(summary['source'])}</p>"
        yield from table.html()
        for name in _of(summary, pictures):
            data = base64.b64encode(pictures[name]).decode()
            yield f'<figure><img src="data:image/png;base64,{data}" alt="{name}"></figure>'
    yield "</body></html>"


_SAME_RATIO = 5e-4


def remarks(scenario: str) -> list[str]:
    """Sentences on the printed tables of a scenario, and on how it is run here."""
    paper = SCENARIOS[scenario].paper
    rows = {c.name: PRINTED[scenario, c.name] for c in paper.contenders if (scenario, c.name) in PRINTED}
    if paper.name == "krill":
        return _krill(rows)
    if paper.name == "ssgwo":
        twin = scenario.endswith("-tall")
        how = "unlimited, as a plan view has them" if twin else "as high as printed, so that they may be overflown"
        return [f"The cylinders are {how}. Printed collisions are of 50 runs."]
    if paper.name == "msfoa":
        return _msfoa(rows)
    if paper.name == "abo":
        return [
            "The paper prints no numbers and draws its peaks at random: these are ours. Its best choice α = β = 1 is "
            "the parrot optimizer, so abo and po do the same; abo-α-β are the other choices of its fig. 6.",
        ]
    return [
        "The terrain is not given: ours. Each vehicle is planned alone; of the arrival only the schedule's arithmetic "
        "stands here, and no separation between vehicles is planned or judged.",
    ]


def _krill(rows: dict[str, PrintedRow]) -> list[str]:
    every = [row for (_, _), row in PRINTED.items() if "energy_j" in row]
    ratios = [row["energy_j"].value / row["length_m"].value for row in every]
    common = max(ratios, key=lambda r: sum(abs(x - r) < _SAME_RATIO * r for x in ratios))
    same = sum(abs(x - common) < _SAME_RATIO * common for x in ratios)
    own = rows["krill"]["energy_j"].value
    saved = ", ".join(
        f"{100.0 * (1.0 - own / row['energy_j'].value):.1f} % against {name}"
        for name, row in rows.items()
        if name != "krill"
    )
    return [
        f"{same} of the paper's {len(ratios)} printed energies are {common:.2f} J/m times the printed length, whatever "
        "the climb; Table 1's 120 J/m up or down and 100 J/m along give many times more even for the straight line.",
        f"Printed energy saved here by krill: {saved}.",
    ]


def _msfoa(rows: dict[str, PrintedRow]) -> list[str]:
    out = [
        "The paper shows its scenarios as pictures only: terrain, threats, starts and goal are ours, so its costs "
        "cannot be compared with ours, only rankings can. Vehicles are planned one by one in the order of priority, "
        "each keeping away from those before it within its cost; no exact check of the separation is made here.",
    ]
    sums = {
        name: round(sum(row[f"best_cost_{i}"].value for i in (1, 2, 3)), 2) for name, row in rows.items()
    }  # Table 2 is printed to 0.01
    wrong = [name for name, row in rows.items() if abs(sums[name] - row["best_cost_sum"].value) > 0.02]
    if wrong:
        words = ", ".join(f"{name} {sums[name]:.2f} (printed {rows[name]['best_cost_sum'].text})" for name in wrong)
        ranking = " < ".join(f"{name} {sums[name]:.2f}" for name in sorted(sums, key=lambda n: sums[n])[:3])
        out.append(f"Table 2's rows do not add up to its sums: {words}. By its rows the best three are {ranking}.")
    for a, b in combinations(rows, 2):
        if all(rows[a][k].text == rows[b][k].text for k in ("best_cost", "mean_cost", "median_cost")):
            out.append(f"Table 3's rows of {a} and {b} are identical.")
    return out


def schedules(summary: dict[str, Any]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows of IB-ABC's schedule, by the measured and the printed lengths; no rows for other papers."""
    header = (
        "algorithm", "vehicle", "L, m", "T, s", "v = L/T, m/s", "", "printed L, m", "its T, s", "its v, m/s",
        "printed T, s", "printed v, m/s",
    )  # fmt: skip
    ready: ReadyScenario = summary["set"]
    arrival = ready.source.arrival
    if summary["paper"] != "ib-abc" or arrival is None:
        return header, []
    vehicle = ready.source.vehicles[0].vehicle
    schedule_of = (arrival.mode, arrival.interval_s, vehicle.speed_min_m_s, vehicle.speed_max_m_s)
    out: list[tuple[str, ...]] = []
    for row in summary["rows"]:
        lengths = row["vehicle_lengths_m"]
        printed = summary["printed"].get(row["algorithm"])
        ours = None if lengths is None else schedule(lengths, *schedule_of)
        count = len(ready.problems)
        theirs = None if printed is None else [printed[f"length_{i}_m"].value for i in range(1, count + 1)]
        right = None if theirs is None else schedule(theirs, *schedule_of)
        # The printed lengths are rounded, so the results that follow from them have a tolerance.
        off_m = 0.0 if printed is None else max(printed[f"length_{i}_m"].half_unit for i in range(1, count + 1))
        off_s = off_m / vehicle.speed_max_m_s
        for i, request in enumerate(ready.source.vehicles):
            cells = [row["algorithm"], request.vehicle.name]
            if ours is None or lengths is None:
                cells += ["–", "–", "–", "refused"]
            else:
                cells += [f"{lengths[i]:.2f}", f"{ours[i].time_s:.3f}", f"{ours[i].speed_m_s:.3f}", ours[i].trouble]
            if right is None or printed is None:
                cells += ["–"] * 5
            else:
                v = right[i].speed_m_s
                cells += [
                    printed[f"length_{i + 1}_m"].text,
                    f"{right[i].time_s:.3f}",
                    f"{v:.3f}",
                    _against(printed[f"time_{i + 1}_s"], right[i].time_s, off_s),
                    _against(printed[f"speed_{i + 1}_m_s"], v, (off_m + v * off_s) / right[i].time_s),
                ]
            out.append(tuple(cells))
    return header, out


def _against(printed: PrintedNumber, right: float, tolerance: float) -> str:
    """The printed number, marked if the arithmetic does not round to it."""
    off = printed.below(right - tolerance) or printed.above(right + tolerance)
    return f"{printed.text} ≠" if off else printed.text


def legend(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """The meaning of the marks in a schedule, if it has any."""
    if not any("≠" in cell for row in rows for cell in row):
        return []
    return ["≠ not what T and v = L/T are by the paper's own rule from its own printed lengths (“its T”, “its v”)."]
