"""The way home on the page: the return altitude needed along the track, unsafe parts, and the battery by leg."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.returns.verdict import WayHome
from gcsplan.figures import counted
from gcsplan.notes.note import Wording
from gcsplan.report.parts.html import at_least, between, energy, esc, num, place, stated, table, tools
from gcsplan.report.parts.page_data import Page, Subject, only_some
from gcsplan.report.parts.track_samples import TrackLine
from gcsplan.report.views.chart import chart_html
from gcsplan.report.views.plan import COLOURS
from gcsplan.report.views.profile import along_axes
from gcsplan.units import METRIC

HOME_TALL = 0.3


MOST_LINES = 4


def home_lines(page: Page) -> str:
    """Lines for the page's head on ways home that are unsafe or not judged; one line for all if there are many."""
    several = len(page.subjects) > 1
    lines = [(s, line) for s in page.subjects if (line := _home_line(s, several, s.wording(page.units)))]
    if len(lines) <= MOST_LINES:
        return "".join(line for _, line in lines)
    names = ", ".join(esc(s.name) for s, _ in lines[:MOST_LINES])
    text = f"<b>{len(lines)} vehicles have no safe return, or it was not judged</b> ({names} …)"
    return f'<p class="bare bad">{text}: see <a href="#home">the way home</a></p>'


def _home_line(subject: Subject, several: bool, wording: Wording) -> str:
    """The headline for the page's head if the way home is unsafe or not judged; empty otherwise."""
    home = subject.home
    if home is None or home.safe is True:
        return ""
    who = f"{esc(subject.name)}: " if several else ""
    cure = f": {esc(home.advice.text(wording))}" if home.advice is not None else ""
    bad = " bad" if home.safe is False else ""
    see = 'see <a href="#home">the way home</a>'
    return f'<p class="bare{bad}"><b>{who}{esc(home.headline.text(wording))}</b>{cure}; {see}</p>'


def home_html(page: Page, lines: Sequence[TrackLine | None], charts: dict[str, object], full: frozenset[int]) -> str:
    """The section; empty if no way home was judged. The charts' numbers are added to ``charts``."""
    parts: list[str] = []
    for i in sorted(full):
        subject = page.subjects[i]
        if subject.home is not None:
            parts.append(_one(subject, subject.home, lines[i], i, charts, subject.wording(page.units), open_=not parts))
    if not parts:
        return ""
    head = '<section id="home"><h2>The way home after a failsafe</h2>'
    return f"{head}{only_some(page, full)}{''.join(parts)}</section>"


def _one(
    subject: Subject, home: WayHome, line: TrackLine | None, index: int, charts: dict[str, object], wording: Wording, *,
    open_: bool,
) -> str:  # fmt: skip
    chart = ""
    if line is not None and home.profile:
        name = f"home-{index}"
        chart = tools(name) + _chart(name, subject, home, line, index, charts, wording) + _legend(home)
    listed = "".join(f"<li>{esc(note.text(wording))}</li>" for note in (*home.not_judged, *home.notes))
    headline = esc(home.headline.text(wording))
    return (
        f"<details{' open' if open_ else ''}><summary>{esc(subject.name)}: {headline}</summary>"
        f"{chart}{_facts(home, wording)}{_stretches(subject, home, wording)}{_battery(subject, home)}"
        + (f"<ul>{listed}</ul>" if listed else "")
        + "</details>"
    )


def _facts(home: WayHome, wording: Wording) -> str:
    rows = [(row.about, esc(row.label), esc(row.note.text(wording))) for row in home.rows()]
    elsewhere = ("no_return", "not_judged", "still_no_return")
    listed = [(label, text) for about, label, text in rows if about not in elsewhere]
    left = "".join(f"<li>{text}</li>" for about, _, text in rows if about == "still_no_return")
    title = f"No safe return even so: {counted(len(home.left), 'stretch', 'stretches')}"
    folded = f"<details><summary>{title}</summary><ul>{left}</ul></details>" if left else ""
    caption = f"Return of {esc(home.vehicle)}, judged from every point of its path"
    return table(caption, ("what|", "found|"), listed) + folded


def _chart(
    name: str, subject: Subject, home: WayHome, line: TrackLine, index: int, charts: dict[str, object], wording: Wording
) -> str:
    units = wording.units or METRIC
    x = np.array([(p.from_m, p.to_m) for p in home.profile]).ravel()
    clear, legal = (
        np.repeat([np.nan if v is None else v for v in values], 2)
        for values in ([p.clear_amsl_m for p in home.profile], [p.legal_amsl_m for p in home.profile])
    )
    level = home.home[2] + home.rtl_rel_home_m
    known = np.concatenate([line.amsl_m, line.ground_m[np.isfinite(line.ground_m)], [level], clear[np.isfinite(clear)],
                            legal[np.isfinite(legal)]])  # fmt: skip
    low, high = float(known.min()), float(known.max())
    room, long = 0.06 * max(high - low, 1.0), max(line.length_m, 1e-3)
    axes = along_axes(line, low - room, high + 1.6 * room, units)
    run = line.run_m
    shapes = [axes.area(run, np.full(len(run), -np.inf), line.ground_m, "ground")]
    for s in home.unsafe:
        ends = [s.from_m, max(s.to_m, s.from_m + 0.002 * long)]
        shapes.append(
            axes.area(ends, [-np.inf, -np.inf], [np.inf, np.inf], "nowhere", f"no safe return: {s.why.text(wording)}")
        )
    shapes += [
        axes.line(x, legal, "legal"), axes.line(x, clear, "clear"),
        axes.line([0.0, long], [level, level], "level"),
        axes.line(run, line.amsl_m, f"track t{index % COLOURS}"),
    ]  # fmt: skip
    tip = f"the return flies at {num(level, 1, units.amsl)}, or higher where it begins higher"
    marks = [axes.mark(0.08 * long, level, "tag", f"return at {stated(home.rtl_rel_home_m, units.height)}", tip, 1)]
    charts[name] = _numbers(x, clear, legal, np.interp(x, run, line.amsl_m), level, line.length_m > 2000.0)
    words = f"Return altitude needed along the way of {subject.name}, beside {num(level, 0, units.amsl)} that is set"
    return chart_html(name, axes, shapes, marks, words, HOME_TALL)


def _legend(home: WayHome) -> str:
    return (
        '<ul class="legend"><li><i class="stroke level"></i>return altitude judged</li>'
        '<li><i class="stroke clear"></i>needed to be clear of everything</li>'
        '<li><i class="stroke legal"></i>needed to keep min AGL too</li>'
        + ('<li><i class="swatch nowhere"></i>no safe return from here</li>' if home.unsafe else "")
        + '<li><i class="swatch ground"></i>ground under the track</li></ul>'
    )


def _numbers(x: Floats, clear: Floats, legal: Floats, amsl: Floats, level: float, far: bool) -> dict[str, object]:
    def tenths(values: Floats) -> list[float | None]:
        return [round(float(v), 1) if np.isfinite(v) else None for v in values]

    series = (
        ("path", amsl),
        ("return judged at", np.full(len(x), level)),
        ("clear from", clear),
        ("legal from", legal),
    )
    return {
        "x": [round(float(v), 1) for v in x], "xunit": "far" if far else "distance", "xname": "along the track",
        "xdecimals": 2 if far else 0,
        "series": [{"name": n, "unit": "amsl", "decimals": 1, "y": tenths(y)} for n, y in series],
    }  # fmt: skip


def _stretches(subject: Subject, home: WayHome, wording: Wording) -> str:
    units = wording.units or METRIC
    rows, marks = [], []
    for kind, stretches in (("no safe return", home.unsafe), ("outside a limit", home.irregular)):
        for s in stretches:
            rows.append(
                (
                    esc(str(s.items)), kind, between(s.from_m, s.to_m, units.far),
                    esc(s.why.text(wording)),
                    place(*s.obstacle[:2]) + f", {num(s.obstacle[2], 0, units.amsl)}" if s.obstacle else "–",
                    at_least(s.lowest_rel_home_m, 1, units.height) if s.lowest_rel_home_m is not None else "none",
                )
            )  # fmt: skip
            marks.append("close" if stretches is home.irregular else "bad")
    if not rows:
        return ""
    head = ("on the way to|", "|", "along the track", "why|", "in the way|", "safe from, above home")
    title = f"Where the return of {esc(subject.name)} hits something or breaks a limit"
    return table(title, head, rows, marks=marks, stacked=True)


def _battery(subject: Subject, home: WayHome) -> str:
    battery = home.battery
    if battery is None:
        return ""
    may = 100.0 * battery.usable_j / battery.battery_j
    rows, marks = [], []
    for leg in battery.legs:
        rows.append(
            (
                f"{leg.seq} {esc(leg.kind)}", energy(leg.energy_j, 1), num(leg.used_percent, 1, "%"),
                energy(leg.return_j, 1), num(leg.with_return_percent, 1, "%"),
            )
        )  # fmt: skip
        marks.append("bad" if leg.with_return_percent is not None and leg.with_return_percent > may else "")
    head = ("to item|", "energy", "used so far", "return from there", "used with the return")
    caption = f"Battery of {esc(subject.name)} by leg; with the return at most {num(may, 0, '%')} may be used"
    inner = table(caption, head, rows, marks=marks)
    return f"<details><summary>Battery by leg, with the return</summary>{inner}</details>"
