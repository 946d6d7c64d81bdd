"""The difference of a plan to earlier missions, on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.markup import escape

from gcsplan.cli.output.console import new_table, print_table, say, say_notes
from gcsplan.notes.note import Wording

if TYPE_CHECKING:
    from gcsplan.check.difference import PlanDifference
    from gcsplan.units import Units

MOST_WITH_FIGURES = 4
"""Most vehicles whose figures are in a table; of more only the headlines."""
MOST_HEADLINES = 30


def say_differences(differences: Sequence[PlanDifference], units: Units) -> None:
    """Print what changed for each vehicle: a headline, and of a few vehicles that changed figures, legs and notes."""
    wording = Wording(units)
    changed = [d for d in differences if not d.equal]
    for d in differences[:MOST_HEADLINES]:
        headline = f"{d.name}: {d.headline.text(wording)}"
        if d.equal or len(changed) > MOST_WITH_FIGURES:
            say(headline)
            continue
        table = new_table(f"[bold]{escape(headline)}[/]", [("", False), ("before", True), ("now", True), ("", True)])
        for row in d.rows(units):
            table.add_row(*row)
        print_table(table)
        say_notes(d.remarks(), wording)
    if len(differences) > MOST_HEADLINES:
        say(f"… and {len(differences) - MOST_HEADLINES} more: --json has all")
