"""The way home on the terminal: a table of the fleet, the rows of one vehicle, and the headlines as warnings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from rich.markup import escape

from gcsplan.app.plan.way_home import warnings
from gcsplan.cli.output.console import rows_table, say
from gcsplan.cli.output.screens import aside, console
from gcsplan.figures import raised
from gcsplan.mavlink.mission.return_parameters import setting
from gcsplan.notes.note import Wording
from gcsplan.units import Reach, Unit, Units

if TYPE_CHECKING:
    from gcsplan.check.returns.verdict import WayHome

MOST_ROWS = 8
"""Rows with one label that are printed; the report and JSON have all of them."""

WORDS = {True: "[green]safe[/]", False: "[bold red]no safe return[/]", None: "[yellow]not judged[/]"}


def say_homes(homes: Mapping[str, WayHome], units: Units) -> None:
    """Print one row for each vehicle whose way home was judged, and a warning for each that has no safe one."""
    if not homes:
        return
    unit = units.height
    rows = [
        {
            "vehicle": escape(name),
            f"return at, {unit.symbol}": _return_at(home, unit),
            "way home": WORDS[home.safe],
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
