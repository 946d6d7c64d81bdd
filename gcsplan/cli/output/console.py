"""Output for people: tables and verdicts on standard output; notes, progress and messages on standard error.

Both are consoles of rich: `console` and `aside`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO, cast

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from gcsplan.check.returns.words import verdict_words
from gcsplan.cli.process.exit import put
from gcsplan.figures import floored, raised, steepened
from gcsplan.notes.note import IN_FILES, Note, Wording
from gcsplan.notes.order import for_people
from gcsplan.units import KILOJOULE, METRIC, WATT_HOUR, Unit, Units, charge, duration, in_units, span
from gcsplan.world.terrain.model_words import heights_line, notes_on, what_is_not_in

if TYPE_CHECKING:
    from gcsplan.app.plan.model import FleetPlan, Plan, VehiclePlan
    from gcsplan.app.upload.job import JobResult
    from gcsplan.check.returns.verdict import WayHome
    from gcsplan.mavlink.protocol.machine import TransferProgress as Transfer
    from gcsplan.mission_file import MissionFile
    from gcsplan.notes.note import Note

PLAIN_WIDTH = 130
"""Columns of a log file or a pipe, whose width is unknown."""


class _Results:
    """Standard output as a file for rich: a full disk or a closed output is our error, not one of rich."""

    def write(self, text: str) -> int:
        try:
            if text:
                put(text)
        except BaseException:  # rich would keep what it could not write, and write it before the next words
            console.begin_capture()
            console.end_capture()
            raise
        return len(text)

    def flush(self) -> None:
        """`put` has flushed already."""

    def isatty(self) -> bool:
        return sys.stdout is not None and sys.stdout.isatty()

    def fileno(self) -> int:
        return sys.stdout.fileno()

    @property
    def encoding(self) -> str:
        return getattr(sys.stdout, "encoding", None) or "utf-8"


RESULTS = cast(TextIO, _Results())

console = Console(file=RESULTS, highlight=False, soft_wrap=True)
"""Results."""
aside = Console(stderr=True, highlight=False, soft_wrap=True)
"""Notes, progress and errors."""
for screen in (console, aside):
    if not screen.is_terminal:
        screen.width = PLAIN_WIDTH


WIDEST = 100_000
WITHIN, PATH_TIME = "within", "path at full speed"
"""Columns of the earliest and the latest arrivals, and of the time that an objective of time lessens."""
MOST_WITH_ALL_COLUMNS = 30
"""Most vehicles whose table has all columns, and whose transfers have a bar each."""
MOST_NOTES, MOST_NAMES = 120, 110
"""Most notes on vehicles that are printed, and most names in one line."""


def number(value: float | None, decimals: int = 0, unit: Unit | None = None) -> str:
    """A number for a table, converted from SI to ``unit``, which the column names; a dash if there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    if unit is not None:
        value, decimals = unit.of(value), unit.decimals(decimals)
    return f"{value:,.{decimals}f}".replace(",", "\u2009")


def least(value: float | None, decimals: int = 0, unit: Unit | None = None) -> str:
    """A least value as in `number`, but rounded down, after it is converted."""
    if value is None or unit is None:
        return number(None if value is None else floored(value, decimals), decimals)
    return number(floored(unit.of(value), unit.decimals(decimals)), unit.decimals(decimals))


def greatest(value: float | None, decimals: int = 0, unit: Unit | None = None) -> str:
    """A greatest value as in `number`, but rounded up, after it is converted."""
    if value is None or unit is None:
        return number(None if value is None else raised(value, decimals), decimals)
    return number(raised(unit.of(value), unit.decimals(decimals)), unit.decimals(decimals))


def steepest(degrees: float | None, decimals: int = 1) -> str:
    """A climb or descent as in `number`, but rounded away from level."""
    return number(None if degrees is None else steepened(degrees, decimals), decimals)


def new_table(title: str, columns: Sequence[tuple[str, bool]]) -> Table:
    """A table without rows; ``columns``: name, and whether it is right-aligned."""
    table = Table(
        title=title, title_justify="left", box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0)
    )
    for name, right in columns:
        table.add_column(name, justify="right" if right else "left", no_wrap=True)
    return table


def table_width(table: Table) -> int:
    """Terminal columns that ``table`` needs if nothing is cut."""
    return console.measure(table, options=console.options.update(width=WIDEST)).maximum


def print_table(table: Table) -> None:
    """Print the whole table, even if a narrow terminal breaks its lines: a verdict must not be cut off."""
    width = table_width(table)
    wide = console if width <= console.width else Console(file=RESULTS, highlight=False, soft_wrap=True, width=width)
    wide.print(table)


def verdict_cell(safe: bool | None, home: WayHome | None, units: Units, *, lines: bool = False) -> str:
    """The verdict's words, coloured: green if path and return are safe; ``lines``: the return below the path."""
    words = in_units(verdict_words(safe, home), units)
    if lines:
        words = words.replace(", ", ",\n", 1).replace("; ", ";\n", 1).replace(" from ", "\nfrom ", 1)
    return_safe = home is not None and home.safe is True
    colour = "bold red" if safe is False else "green" if safe and return_safe else "yellow"
    return f"[{colour}]{words}[/]"


def plan_table(plan: Plan, homes: Mapping[str, WayHome], units: Units = METRIC) -> None:
    """Print a plan: a column for each vehicle, values beside their limits; a row for each in a large fleet."""
    rows = [plan_row(v, plan.fleet, homes.get(v.name), units, lines=len(plan.vehicles) > 1) for v in plan.vehicles]
    for rare in (WITHIN, PATH_TIME, "energy, mAh", f"over or under a zone, {units.distance.symbol}"):  # mostly none
        if all(row[rare] == "–" for row in rows):
            rows = [{name: words for name, words in row.items() if name != rare} for row in rows]
    if len(rows) > MOST_WITH_ALL_COLUMNS:
        brief = _brief(units)
        rows = [{name: row[name] for name in brief if name in row} for row in rows]
    title = f"[bold]{escape(plan.source.name)}[/]  planner {plan.planner}, objective {plan.objective}"
    if len(rows) > 4:
        rows_table(title, rows, left=("vehicle", "verdict"))
    else:
        _columns_table(title, rows)
    _say_fleet(plan, units)
    noted = [("", note) for note in plan.notes]
    noted += [(v.name, note) for v in plan.vehicles for note in v.all_notes(plan.fleet)]
    say_notes_of(for_people(noted), Wording(units))
    say_heights(plan.source.inputs, units)
    if words := what_is_not_in(plan.source.inputs):
        console.print(words, style="yellow", markup=False)


def _brief(units: Units) -> tuple[str, ...]:
    """The columns that the table of a larger fleet has."""
    return (
        "vehicle", f"length, {units.path.symbol}", "battery, %", f"lowest AGL, {units.height.symbol}",
        f"speed, {units.speed.symbol}", "departs", "arrives", WITHIN, "verdict",
    )  # fmt: skip


def say_heights(inputs: Mapping[str, object], units: Units) -> None:
    """Print how the terrain's heights were read, as one note."""
    if (line := heights_line(inputs)) is not None:
        _say_noted([in_units(line, units)])


def say_terrain(source: MissionFile, units: Units) -> None:
    """Print what a mission's terrain has to note, if anything, and how its heights were read: it may explain why there
    is no mission."""
    if notes := notes_on(source.surface.info):
        say_notes(notes, Wording(units))
        say_heights(source.inputs, units)


def _say_fleet(plan: Plan, units: Units) -> None:
    """Print how the fleet arrives, and the least distance between two of its vehicles."""
    fleet, arrival = plan.fleet, plan.source.arrival
    if fleet is None or len(fleet.slots) < 2:
        return
    how = f"{fleet.interval_s:g} s apart" if fleet.mode == "sequence" else ""
    if fleet.mode != "none":
        say(f"arrival: {fleet.mode}{f', {how}' if how else ''}; order {names_of(fleet.order)}")
    closest = fleet.closest
    if fleet.separation is None:
        return
    still = {None: "", True: " in every declared wind", False: " in still air"}[fleet.in_every_wind]
    unit = units.distance
    needed = f" of {unit.stated(arrival.separation_m)} {unit.symbol} required" if arrival is not None else ""
    if closest is None:
        say(f"separation{still}: no two vehicles are in the air at the same time")
    else:
        a, b = closest.vehicles
        near = f"{floored(unit.of(closest.distance_m), unit.decimals(1)):.{unit.decimals(1)}f} {unit.symbol}"
        say(f"separation{still}: {near}{needed}, {a} and {b} at T+{duration(closest.time_s, 1)}")


def _columns(title: str, rows: Sequence[Mapping[str, str]], each: int) -> list[Table]:
    """Tables with a column for each of ``rows``, at most ``each`` of them side by side."""
    tables = []
    for first in range(0, len(rows), each):
        some = rows[first : first + each]
        table = new_table("" if first else title, [("", False), *((row["vehicle"], True) for row in some)])
        for name in list(rows[0])[1:]:
            table.add_row(name, *(row[name] for row in some))
        tables.append(table)
    return tables


def plan_row(
    v: VehiclePlan,
    fleet: FleetPlan | None,
    home: WayHome | None = None,
    units: Units = METRIC,
    *,
    lines: bool = False,
) -> dict[str, str]:
    """The words of one vehicle by name; times have tenths in a fleet, whose order may hang on them."""
    verdict, energy = v.verdict, v.request.vehicle.energy
    slot = None if fleet is None else fleet.slot(v.name)
    tenths = 1 if fleet is not None and len(fleet.slots) > 1 else 0
    held = f" + {duration(slot.hold_s)} at the gate" if slot and slot.hold_s > 0 else ""
    lowest, highest, nearest, passed = verdict.lowest, verdict.highest, verdict.nearest, verdict.zone_pass
    joules = verdict.reported_j(verdict.energy_j)
    limits, mark = v.request.vehicle.limits, verdict.energy_mark
    climb = f" of {limits.max_climb_deg:g}" if limits.max_climb_deg < 90 else ""
    return {
        "vehicle": v.name,
        "items": str(len(v.mission.wire_items())),
        f"length, {units.path.symbol}": number(verdict.length_m, 0, units.path),
        PATH_TIME: duration(v.cost, 1) if v.problem.objective == "time" else "–",
        "above the bound, %": number(v.gap_percent, 2),
        "energy, kJ": number(joules, 0, KILOJOULE) + mark,
        "energy, Wh": number(joules, 0, WATT_HOUR) + mark,
        "energy, mAh": number(joules, 0, charge(energy.battery_v)) + mark if energy.battery_v else "–",
        "battery, %": number(verdict.battery_used_percent) + (mark if verdict.battery_used_percent is not None else ""),
        f"lowest AGL, {units.height.symbol}": (
            f"{least(lowest.min_agl_m, 1, units.height)} of {units.height.stated(limits.min_agl_m)}" if lowest else "–"
        ),
        f"highest AGL, {units.height.symbol}": (
            greatest(highest.max_agl_m, 1, units.height)
            + (f" of {units.height.stated(limits.max_agl_m)}" if limits.max_agl_m is not None else "")
            if highest
            else "–"
        ),
        f"nearest zone, {units.distance.symbol}": (
            f"{least(nearest.zone_clearance_m, 1, units.distance)} {escape(nearest.nearest_zone)}" if nearest else "–"
        ),
        f"over or under a zone, {units.distance.symbol}": (
            f"{least(passed.height_m, 1, units.distance)} {passed.side} {escape(passed.zone)}" if passed else "–"
        ),
        "steepest, °": f"{steepest(verdict.max_climb_deg)}{climb}",
        f"speed, {units.speed.symbol}": number(v.speed_m_s, 2, units.speed),
        "departs": duration(slot.depart_s if slot else 0.0, tenths) + held,
        "arrives": duration(slot.arrive_s if slot else verdict.arrive_s, tenths),
        WITHIN: span(verdict.arrive_window_s(slot), tenths),
        "verdict": verdict_cell(verdict.safe, home, units, lines=lines),
    }


def upload_table(results: Sequence[JobResult], title: str = "upload", units: Units = METRIC) -> None:
    """Print one row for each vehicle that was sent to or compared with."""
    sent = title == "upload"
    columns = [("vehicle", False), ("link", False), ("items", True), *([("outcome", False)] if sent else []),
               ("read back", False), ("s", True), ("retries", True)]  # fmt: skip
    table = new_table(f"[bold]{title}[/]", columns)
    for d in results:
        outcome_words = {"accepted": "[green]accepted[/]", "withdrawn": "[yellow]withdrawn[/]"}.get(
            d.outcome, f"[bold red]{d.outcome}[/]"
        )
        verified = "[green]verified[/]" if d.verified else "[bold red]not verified[/]"
        link = escape(d.url) + (" [bold yellow]simulated[/]" if d.simulated else "")
        outcome = [outcome_words] if sent else []  # a comparison sends nothing
        table.add_row(escape(d.vehicle), link, str(d.items), *outcome, verified, number(d.seconds, 2), str(d.retries))
    print_table(table)
    say_notes_of([(d.vehicle, w) for d in results for w in d.warnings], Wording(units))
    for d in results:
        if d.message:
            aside.print(f"{d.vehicle}: {d.message}", style="red", markup=False)


def release_table(plan: Plan, results: Sequence[JobResult]) -> None:
    """Print when to start each vehicle of a fleet by hand: nothing is armed or started here."""
    from gcsplan.app.upload.job import releases  # after an upload alone: what sends takes long to import

    rows = releases(plan, results)
    if not rows:
        return
    windy = [(WITHIN, True)] if any(within for _, within, _ in rows) else []
    columns = [("vehicle", False), ("release, T+", True), ("at the goal, T+", True), *windy, ("", False)]
    table = new_table("[bold]release[/]  by hand: nothing is armed or started from here", columns)
    for slot, within, ready in rows:
        state = "" if ready else "[bold red]not ready[/]"
        window = [span(within, 1)] if windy else []
        table.add_row(escape(slot.name), duration(slot.depart_s, 1), duration(slot.arrive_s, 1), *window, state)
    print_table(table)
    if plan.fleet is not None and plan.fleet.start_utc is not None:
        say(f"T+0 is {plan.fleet.start_utc:%Y-%m-%d %H:%M:%S} UTC")


def say_notes(notes: Iterable[Note], wording: Wording = IN_FILES) -> None:
    """Print notes, each once, in order."""
    _say_noted([note.text(wording) for note in notes])


def _say_noted(lines: Sequence[str]) -> None:
    for line in dict.fromkeys(lines):
        aside.print(f"note: {line}", style="dim", markup=False)


def say_notes_of(notes: Sequence[tuple[str, Note]], wording: Wording = IN_FILES) -> None:
    """Print notes on vehicles, (name, note) each; a note on several is printed once with all their names."""
    names: dict[Note, list[str]] = {}
    for name, note in dict.fromkeys(notes):
        names.setdefault(note, []).append(name)
    lines = [f"{names_of(of)}: {note.text(wording)}" if any(of) else note.text(wording) for note, of in names.items()]
    if len(lines) > MOST_NOTES:
        lines = [*lines[:MOST_NOTES], f"… and {len(lines) - MOST_NOTES} more on vehicles: --json has all"]
    _say_noted(lines)


def names_of(names: Sequence[str]) -> str:
    """Names in a line; of many the first and the last."""
    if len(names) <= MOST_NAMES:
        return ", ".join(names)
    return f"{', '.join(names[: MOST_NAMES // 2])}, … {', '.join(names[-2:])} ({len(names)} in all)"


@contextmanager
def transfer_progress(names: Sequence[str]) -> Iterator[Callable[[str, Transfer], None]]:
    """Show a live table of transfers, on a terminal only; yields a function to call with (name, progress).

    Of more than `MOST_WITH_ALL_COLUMNS` vehicles it shows how many have ended.
    """
    if not aside.is_terminal:
        yield lambda name, transfer: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    columns = (
        TextColumn("{task.description}"), TextColumn("{task.fields[phase]}"), BarColumn(), MofNCompleteColumn(),
        TimeElapsedColumn(),
    )  # fmt: skip
    with Bars(*columns, console=aside, transient=True) as bars:
        if len(names) > MOST_WITH_ALL_COLUMNS:
            whole, over = bars.add_task(f"{len(names)} vehicles", total=len(names), phase=""), dict[str, bool]()

            def count(name: str, transfer: Transfer) -> None:
                if transfer.failed is not None:
                    over[name] = transfer.failed
                    bad = f"[bold red]{sum(over.values())} failed[/]" if any(over.values()) else ""
                    bars.update(whole, completed=len(over), phase=bad)

            yield count
            return
        tasks = {name: bars.add_task(escape(name), total=None, phase="looking for it") for name in names}

        def update(name: str, transfer: Transfer) -> None:
            phase = transfer.phase
            if transfer.failed is not None:
                phase = f"[{'bold red' if transfer.failed else 'green'}]{phase}[/]"
                bars.stop_task(tasks[name])
            bars.update(tasks[name], completed=transfer.done, total=transfer.total, phase=phase)

        yield update


def planners_table(rows: Sequence[Mapping[str, object]]) -> None:
    """Print the planners, one per row."""
    table = new_table("planners", [("name", False)])
    for name in ("what it does", "paper", "defaults"):
        table.add_column(name)
    for row in rows:
        defaults = row["defaults"]
        words = ", ".join(f"{k} {v}" for k, v in defaults.items()) if isinstance(defaults, Mapping) else ""
        table.add_row(str(row["name"]), str(row["summary"]), str(row["paper"]) or "–", words or "–")
    console.print(table, soft_wrap=False)


def say(message: str) -> None:
    """Print one line of the result."""
    console.print(message, markup=False)


def remark(message: str) -> None:
    """Print one line of what is done or noticed meanwhile."""
    aside.print(message, markup=False)


def rows_table(title: str, rows: Sequence[Mapping[str, str]], *, left: Sequence[str] = ("vehicle",)) -> None:
    """Print rows of words by column name, or, where these are too wide, a column for each of ``rows``.

    Columns in ``left`` are left-aligned, the others right-aligned.
    """
    table = new_table(title, [(name, name not in left) for name in rows[0]])
    for row in rows:
        table.add_row(*row.values())
    if table_width(table) <= console.width:
        print_table(table)
    else:
        _columns_table(title, rows)


def _columns_table(title: str, rows: Sequence[Mapping[str, str]]) -> None:
    """Print a column for each of ``rows``, as many side by side as there is room for, up to four."""
    each = next((n for n in (4, 3, 2) if all(table_width(t) <= console.width for t in _columns(title, rows, n))), 1)
    for table in _columns(title, rows, each):
        print_table(table)
