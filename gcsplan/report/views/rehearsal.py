"""A rehearsal on the page: every figure of the plan beside what was flown, with their difference."""

from __future__ import annotations

import math

from gcsplan.figures import floored
from gcsplan.report.parts.html import esc, least, num, table
from gcsplan.report.parts.page_data import Compared, Page
from gcsplan.report.views.plan import COLOURS
from gcsplan.units import Unit, Units, duration, in_units

REHEARSAL_WORDS = {
    False: ("unsafe", "✕", "NOT AS PLANNED", "The rehearsal broke a limit, or lost what the fleet must keep."),
    None: ("unjudged", "?", "NOT ALL FLOWN", "No limit was broken, but parts of the missions were not flown."),
}


def headline(page: Page, verdict: tuple[str, str, str, str]) -> tuple[str, str, str, str]:
    """The page's ``verdict`` (class, sign, word, sentence), or the rehearsal's if that is worse."""
    if page.rehearsed is None or page.rehearsed.safe is True or verdict[0] == "unsafe":
        return verdict
    return REHEARSAL_WORDS[page.rehearsed.safe]


def rehearsal_html(page: Page) -> str:
    """The section; empty if nothing was rehearsed."""
    found = page.rehearsed
    if found is None:
        return ""
    rows = [
        (
            esc(c.vehicle) if c.subject is None else f'<i class="swatch t{c.subject % COLOURS}"></i>{esc(c.vehicle)}',
            esc(c.what), _value(c, c.planned, page.units), _value(c, c.flown, page.units),
            _difference(c, page.units),
        )
        for c in found.compared
    ]  # fmt: skip
    listed = "".join(f"<li>{esc(in_units(words, page.units))}</li>" for words in (*found.violations, *found.not_flown))
    left_out = f'<ul class="findings">{listed}</ul>' if listed else ""
    head = ("vehicle|", "figure|", "planned", "flown", "difference")
    return (
        f'<section id="rehearsed"><h2>Flown beside planned</h2><p>{esc(found.how)}</p>{left_out}'
        + table("What was flown comes from the flown tracks alone", head, rows)
        + "</section>"
    )


def _value(c: Compared, value: float | None, units: Units) -> str:
    if value is not None and math.isinf(value):
        return "never"
    if c.kind == "time":
        return duration(value, 1)
    if c.kind == "percent":
        return num(value, 1, "%")
    return least(value, 1, getattr(units, c.kind))


def _difference(c: Compared, units: Units) -> str:
    """Flown less planned, with its sign; of least values as they are shown, rounded down."""
    if c.planned is None or c.flown is None or not math.isfinite(c.flown - c.planned):
        return "–"
    apart = c.flown - c.planned
    if c.kind == "time":
        shown, text = round(apart, 2), num(abs(apart), 2, "s")
    elif c.kind == "percent":
        shown, text = round(apart, 1), num(abs(apart), 1, "%")
    else:
        unit: Unit = getattr(units, c.kind)
        decimals = unit.decimals(1)
        shown = round(floored(unit.of(c.flown), decimals) - floored(unit.of(c.planned), decimals), decimals)
        text = num(abs(shown) * unit.size, 1, unit)
    return ("−" if shown < 0.0 else "+") + text
