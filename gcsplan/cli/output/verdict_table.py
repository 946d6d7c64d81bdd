"""A verdict on the terminal: what was found, a row for each item, energy and heights; and the way home.

Of the way home there are a table of the fleet, the rows of one vehicle, and the headlines as warnings.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from rich.markup import escape

from gcsplan.app.plan.way_home import warnings
from gcsplan.check.verdict import by_item
from gcsplan.cli.output.console import (
    WITHIN,
    aside,
    console,
    greatest,
    least,
    new_table,
    number,
    print_table,
    rows_table,
    say,
    say_notes,
    steepest,
    table_width,
    verdict_cell,
)
from gcsplan.figures import raised
from gcsplan.mavlink.mission.return_parameters import setting
from gcsplan.notes.note import Wording
from gcsplan.units import KILOJOULE, METRIC, WATT_HOUR, Reach, Unit, Units, charge, duration, span

if TYPE_CHECKING:
    from gcsplan.check.returns.verdict import WayHome
    from gcsplan.check.verdict import Verdict
    from gcsplan.vehicle import Energy

IN_METRES = Wording(METRIC)


def verdict_table(
    name: str,
    verdict: Verdict,
    home: WayHome | None = None,
    *,
    wording: Wording = IN_METRES,
    energy: Energy | None = None,
) -> None:
    """Print what was found, then one row for each item that is flown, and for each time that a jump leads to it."""
    units = wording.units or METRIC
    title = f"[bold]{escape(name)}[/]  {verdict_cell(verdict.safe, home, units)}"
    if verdict.findings or verdict.not_judged:
        console.print(title)
        console.print(verdict.describe(wording), style="red" if verdict.findings else "yellow", markup=False)
        title = ""
    height, near = units.height, units.distance
    columns = [("item", True), ("", False), (f"leg {units.leg.symbol}", True), (f"AMSL {height.symbol}", True),
               (f"AGL {height.symbol}", True), (f"low AGL {height.symbol}", True), (f"high AGL {height.symbol}", True),
               ("climb °", True), (f"nearest zone {near.symbol}", True), ("energy kJ", True),
               ("time", True)]  # fmt: skip
    bad = {f.seq for f in verdict.findings}
    items = [item for item, _ in by_item(verdict.legs)]
    rows = [
        (
            str(item.seq), item.kind, number(item.length_m, 0, units.leg), number(item.end[2], 1, height),
            least(item.agl_end_m, 1, height), least(item.min_agl_m, 1, height), greatest(item.max_agl_m, 1, height),
            steepest(item.climb_deg),
            f"{least(item.zone_clearance_m, 0, near)} {escape(item.nearest_zone)}" if item.nearest_zone else "–",
            number(verdict.reported_j(item.energy_j), 1, KILOJOULE), duration(item.time_s),
        )
        for item in items
    ]  # fmt: skip
    # Too narrow: without time, energy, length, and the highest AGL, which stands below the table for the whole.
    for hidden in ((), (10,), (9, 10), (2, 9, 10), (2, 6, 9, 10)):
        shown = [i for i in range(len(columns)) if i not in hidden]
        table = new_table(title, [columns[i] for i in shown])
        for item, row in zip(items, rows, strict=True):
            table.add_row(*(row[i] for i in shown), style="red" if item.seq in bad else None)
        if table_width(table) <= console.width:
            break
    print_table(table)
    if verdict.legs:
        joules, mark = verdict.reported_j(verdict.energy_j), verdict.energy_mark
        used = [] if joules is None else [energy_words(joules, None if energy is None else energy.battery_v)]
        if verdict.battery_used_percent is not None:
            used.append(f"{verdict.battery_used_percent:.0f} % of the battery")
        length = f"{number(verdict.length_m, 0, units.path)} {units.path.symbol}"
        flight = f"path {length}; whole flight {duration(verdict.time_s)}"
        if mark and used:  # one line would be wider than 80 columns
            say(flight)
            say(f"energy{mark}: {', '.join(used)}")
        else:
            say(", ".join([flight, *used]))
        if (window_s := verdict.arrive_window_s()) is not None:
            say(f"arrives {duration(verdict.arrive_s)} in still air, {WITHIN} {span(window_s)}")
        say_extremes(verdict, units)
    say_notes(verdict.notes, wording)


def say_extremes(verdict: Verdict, units: Units) -> None:
    """Print the lowest and the highest height above ground, and how high a zone is passed over or under."""
    lowest, highest, passed = verdict.lowest, verdict.highest, verdict.zone_pass
    words = []
    if lowest is not None:
        words.append(f"lowest {least(lowest.min_agl_m, 1, units.height)} {units.height.symbol} (item {lowest.seq})")
    if highest is not None:
        words.append(
            f"highest {greatest(highest.max_agl_m, 1, units.height)} {units.height.symbol} (item {highest.seq})"
        )
    if words:
        say(f"above ground: {', '.join(words)}")
    if passed is not None:
        height = f"{least(passed.height_m, 1, units.distance)} {units.distance.symbol}"
        say(f"nearest pass over or under a zone: {height} {passed.side} {passed.zone}, item {passed.seq}")


def energy_words(joules: float, volts: float | None = None) -> str:
    """An energy in every unit that it has: ``2 737 kJ, 760 Wh``, with a voltage ``34 245 mAh``, too."""
    units = (KILOJOULE, WATT_HOUR, *([charge(volts)] if volts else []))
    return ", ".join(f"{number(joules, 0, unit)} {unit.symbol}" for unit in units)


MOST_ROWS = 8
"""Rows with one label that are printed; the report and JSON have all of them."""

RETURN_WORDS = {True: "[green]safe[/]", False: "[bold red]no safe return[/]", None: "[yellow]not judged[/]"}


def say_homes(homes: Mapping[str, WayHome], units: Units) -> None:
    """Print one row for each vehicle whose way home was judged, and a warning for each that has no safe one."""
    if not homes:
        return
    unit = units.height
    rows = [
        {
            "vehicle": escape(name),
            f"return at, {unit.symbol}": _return_at(home, unit),
            "way home": RETURN_WORDS[home.safe],
            "unsafe from": Reach(home.no_return_m).text(units) if home.safe is False else "–",
            f"to set, {unit.symbol}": _to_set(home, unit),
            "then unsafe from": "–" if not home.set_leaves_m else Reach(home.set_leaves_m).text(units),
            "rally points": str(len(home.rally)) if home.rally else "–",
        }
        for name, home in homes.items()
    ]
    title = "[bold]way home[/]  the autopilot's own return, from every point of the path"
    rows_table(title, rows, left=("vehicle", "way home"))
    known = {(h.autopilot, h.set_rel_home_m): _to_set(h, unit) for h in homes.values()}
    for (autopilot, best_m), words in known.items():
        if best_m is not None:
            say(f"{words} {unit.symbol} above home: {setting(autopilot, best_m)}")
    routes = [h.advice for h in homes.values() if h.safe is True and h.route == "mission"]
    for note in dict.fromkeys(note for note in routes if note is not None):
        say(f"by the mission: {note.text(Wording(units))}")
    say_warnings(homes, Wording(units))


def _return_at(home: WayHome, unit: Unit) -> str:
    if home.route == "mission":
        return "by the mission"
    return str(unit.stated(home.rtl_rel_home_m)) + (" (default)" if home.assumed else "")


def _to_set(home: WayHome, unit: Unit) -> str:
    """The altitude to set: rounded up, unless it is the judged one, which reads the same in both places."""
    if home.set_rel_home_m is None:
        return "–"
    same = home.set_rel_home_m == home.rtl_rel_home_m
    return unit.stated(home.set_rel_home_m, *([] if same else [raised]))


def say_home(home: WayHome, wording: Wording) -> None:
    """Print the rows of one way home; of many stretches the first `MOST_ROWS`."""
    say(f"way home: {home.headline.text(wording)}")
    seen: dict[str, int] = {}
    for row in home.rows():
        seen[row.label] = seen.get(row.label, 0) + 1
        bad = row.about in ("no_return", "still_no_return")
        if seen[row.label] <= MOST_ROWS:
            text = f"  {row.label}: {row.note.text(wording)}"
            console.print(text, style="red" if bad else None, markup=False)
    for label, count in seen.items():
        if count > MOST_ROWS:
            say(f"  {label}: … and {count - MOST_ROWS} more (all of them: --report, --json)")


def say_warnings(homes: Mapping[str, WayHome | None], wording: Wording) -> None:
    """Print a headline for each vehicle without a safe return; the path's own verdict stands elsewhere."""
    for line in warnings(homes, wording):
        aside.print(f"warning: {line}", style="bold yellow", markup=False)
