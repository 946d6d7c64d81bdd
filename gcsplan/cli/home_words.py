"""The way home on the terminal: a table of the fleet, the rows of one vehicle, and the headlines as warnings."""

from __future__ import annotations

from collections.abc import Mapping

from rich.markup import escape

from gcsplan.app.way_home import warnings
from gcsplan.check.rtl.verdict import WayHome
from gcsplan.check.rtl.words import NO_RETURN, STILL_NO_RETURN
from gcsplan.cli.console import aside, console, new_table, print_table, say
from gcsplan.figures import raised
from gcsplan.mavlink.mission.return_altitude import setting
from gcsplan.units import Reach, Units, in_units

MOST_ROWS = 8
"""Rows with one label that are printed; the report and JSON have all of them."""

WORDS = {True: "[green]safe[/]", False: "[bold red]no safe return[/]", None: "[yellow]not judged[/]"}


def say_homes(homes: Mapping[str, WayHome], units: Units) -> None:
    """Print one row for each vehicle whose way home was judged, and a warning for each that has no safe one."""
    if not homes:
        return
    unit = units.height
    columns = [("vehicle", False), (f"return at, {unit.symbol}", True), ("way home", False), ("unsafe from", True),
               (f"to set, {unit.symbol}", True), ("then unsafe from", True), ("rally points", True)]  # fmt: skip
    table = new_table("[bold]way home[/]  the autopilot's own return, from every point of the path", columns)
    for name, home in homes.items():
        at = unit.stated(home.rtl_rel_home_m) + (" (default)" if home.assumed else "")
        best = home.set_rel_home_m
        table.add_row(
            escape(name), at, WORDS[home.safe], Reach(home.no_return_m).text(units) if home.safe is False else "–",
            "–" if best is None else unit.stated(best, raised),
            "–" if not home.set_leaves_m else Reach(home.set_leaves_m).text(units),
            str(len(home.rally)) if home.rally else "–",
        )  # fmt: skip
    print_table(table)
    known = dict.fromkeys((h.autopilot, h.set_rel_home_m) for h in homes.values() if h.set_rel_home_m is not None)
    for autopilot, best in known:
        say(f"{unit.stated(best, raised)} {unit.symbol} above home: {setting(autopilot, best)}")
    say_warnings(homes, units)


def say_home(home: WayHome, units: Units) -> None:
    """Print the rows of one way home; of many stretches the first `MOST_ROWS`."""
    say(f"way home: {in_units(home.headline, units)}")
    seen: dict[str, int] = {}
    rows = home.rows()
    for label, words in rows:
        seen[label] = seen.get(label, 0) + 1
        bad = label in (NO_RETURN, STILL_NO_RETURN)
        if seen[label] <= MOST_ROWS:
            console.print(f"  {label}: {in_units(words, units)}", style="red" if bad else None, markup=False)
    for label, count in seen.items():
        if count > MOST_ROWS:
            say(f"  {label}: … and {count - MOST_ROWS} more (all of them: --report, --json)")


def say_warnings(homes: Mapping[str, WayHome | None], units: Units) -> None:
    """Print a headline for each vehicle without a safe return; the path's own verdict stands elsewhere."""
    for line in warnings(homes):
        aside.print(f"warning: {in_units(line, units)}", style="bold yellow", markup=False)
