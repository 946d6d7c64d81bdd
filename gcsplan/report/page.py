"""The report: one self-contained HTML page for a plan, or for files that were checked.

`render_page` returns the whole page as text: no external addresses, no clock, and the same bytes for the same input.
Style and script are in `assets/`. The script can only draw (the page's policy enforces it), and without it the page
still has every number, the map and the profiles.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gcsplan import __version__
from gcsplan.notes.note import Wording
from gcsplan.notes.order import for_people
from gcsplan.report.briefing import briefing_html
from gcsplan.report.parts.html import (
    data_block,
    document,
    energy,
    esc,
    greatest,
    least,
    num,
    place,
    stated,
    steepest,
    tools,
)
from gcsplan.report.parts.page_data import (
    Page,
    Subject,
    in_full,
    left_out_html,
    only_some,
    samples_of,
)
from gcsplan.report.parts.track_samples import Passage, TrackLine, passages
from gcsplan.report.views import tables
from gcsplan.report.views.fleet import fleet_html, motions_of
from gcsplan.report.views.home import home_html, home_lines
from gcsplan.report.views.plan import COLOURS, map_html, map_marks
from gcsplan.report.views.profile import profile_html, profile_legend
from gcsplan.report.views.replay import replay_html
from gcsplan.report.views.space import drawn, space_data, space_html
from gcsplan.report.views.tables import headline, rehearsal_html
from gcsplan.units import KILOJOULE, SECOND, Unit, Units, duration, in_units, span
from gcsplan.world.geometry.zones import no_fly_of, on_map
from gcsplan.world.terrain.model_words import what_is_not_in

__all__ = ["render_page"]

OPEN_VEHICLES = 3
"""Vehicles whose profiles are open at first; the others open on a tap, and on paper. So do a fleet's tables."""
MOST_NOTES = 200
"""Most notes that are open at first."""
MOST_CARDS = 6
"""Most vehicles with cards; the key figures of more are in one table."""
FILTER = (
    '<label class="filter" hidden>Filter vehicles <input type="search" placeholder="a name, a verdict, a zone">'
    '<span class="note"></span></label>'
)
SCRIPTS = ("paper.js", "numbers.js", "base.js", "labels.js", "view.js", "flight.js", "replay.js", "charts.js",
           "mesh.js", "scene.js", "filter.js", "start.js")  # fmt: skip


def render_page(page: Page) -> str:
    """A `Page` as HTML text."""
    full = in_full(page)
    seen = drawn(page, samples_of(page, full))
    lines, relief, replay = seen.lines, seen.relief, seen.replay
    zones = page.world.airspace.zones
    crossed = (*no_fly_of(zones), *(zone for zone in zones if zone not in on_map(zones)))
    found = [
        passages(line, crossed, _reach_m(subject)) if line is not None and i in full else []
        for i, (subject, line) in enumerate(zip(page.subjects, lines, strict=True))
    ]
    charts: dict[str, object] = {}
    fleet, home = fleet_html(page, charts, full), home_html(page, lines, charts, full)
    flown = [t.places[:, 1:3] for t in replay.tracks if t.flown] if replay is not None else []
    data = space_data(page, seen) | {"charts": charts, "units": page.units.as_dict()}
    marks = map_marks(page, lines, relief, full)
    body = "".join(
        (
            briefing_html(page, _verdict(page), relief, marks), _header(page), _vehicles(page),
            f'<section><h2>Map</h2>{tools("map")}{map_html(page, lines, relief, marks, flown)}'
            f"{replay_html(replay, page) if replay else ''}</section>",
            tables.differences_html(page), rehearsal_html(page), space_html(page, relief),
            *_profiles(page, lines, found, full), home, fleet, *_details(page, lines, found, full), _end(page),
        )
    )  # fmt: skip
    return document(page.title, body, data_block("data", data), scripts=SCRIPTS)


def _reach_m(subject: Subject) -> float:
    limits = subject.vehicle.limits
    return limits.horizontal_clearance_m + limits.track_error_m


VERDICTS = {
    True: ("safe", "✓", "SAFE", "Every metre was checked and keeps every limit."),
    False: ("unsafe", "✕", "NOT SAFE", "Limits are broken: do not fly this."),
    None: ("unjudged", "?", "NOT JUDGED", "No limit is broken, but not everything could be judged."),
}


PATH_ONLY = (
    "unjudged",
    "!",
    "PATH SAFE",
    "Every metre of the path keeps every limit. A safe return from all of it is not shown.",
)
"""A path without a return that was judged safe is never shown as safe."""


def verdict_of(safe: bool | None, *, homeless: bool) -> tuple[str, str, str, str]:
    """Class, sign, word and sentence of a verdict; ``homeless``: the return is not safe, or not judged."""
    return PATH_ONLY if safe is True and homeless else VERDICTS[safe]


def _verdict(page: Page) -> tuple[str, str, str, str]:
    return headline(page, verdict_of(page.safe, homeless=page.homeless))


def _header(page: Page) -> str:
    kind, sign, word, words = _verdict(page)
    wrong = [(s, f.note.text(s.wording(page.units))) for s in page.subjects for f in s.verdict.findings]
    wrong += [(s, f"not judged: {text}") for s, text in _unjudged(page)]
    several = len(page.subjects) > 1
    listed = "".join(f"<li>{f'<b>{esc(s.name)}</b>: ' if several else ''}{esc(text)}</li>" for s, text in wrong)
    verdicts = "" if several else "".join(f"<b>{esc(in_units(s.words, page.units))}.</b> " for s in page.subjects)
    absent = what_is_not_in(page.inputs)
    bare = f'<p class="bare"><b>{esc(absent)}</b></p>' if absent else ""
    return (
        f'<header><p class="brand">gcsplan mission report</p><h1>{esc(page.title)}</h1>'
        f'<div class="verdict {kind}"><span class="sign" aria-hidden="true">{sign}</span>'
        f"<div><strong>{word}</strong><p>{verdicts}{words}</p></div></div>"
        + (f'<ul class="findings">{listed}</ul>' if listed else "")
        + left_out_html(page)
        + bare
        + home_lines(page)
        + "</header>"
    )


def _vehicles(page: Page) -> str:
    if len(page.subjects) > MOST_CARDS:
        signs = [verdict_of(s.verdict.safe, homeless=s.homeless)[1] for s in page.subjects]
        words = [f"{sign} {esc(in_units(s.words, page.units))}" for s, sign in zip(page.subjects, signs, strict=True)]
        return f'<section id="vehicles">{FILTER}{tables.vehicles_table(page, words)}</section>'
    cards = "".join(_card(s, i, page) for i, s in enumerate(page.subjects))
    return f'<section class="cards" aria-label="Key figures">{cards}</section>'


def _card(subject: Subject, index: int, page: Page) -> str:
    units, in_fleet = page.units, bool(motions_of(page))
    verdict, limits, c = subject.verdict, subject.vehicle.limits, subject.certificate
    kind, sign, _, _ = verdict_of(verdict.safe, homeless=subject.homeless)
    word = esc(in_units(subject.words, units))
    low, near = verdict.lowest, verdict.nearest
    figures = [("path", num(verdict.length_m, 0, units.path), _bound_words(subject, units))]
    if low is not None:
        figures.append(
            ("lowest above ground", least(low.min_agl_m, 1, units.height),
             f"min AGL {stated(limits.min_agl_m, units.height)}; on the leg to item {low.seq}, "
             f"{place(*low.min_agl_at)}")
        )  # fmt: skip
    if (high := verdict.highest) is not None:
        most = f"max AGL {stated(limits.max_agl_m, units.height)}" if limits.max_agl_m is not None else "no max AGL"
        figures.append(
            (
                "highest above ground",
                greatest(high.max_agl_m, 1, units.height),
                f"{most}; on the leg to item {high.seq}",
            )
        )
    figures.append(
        ("nearest zone", least(near.zone_clearance_m, 1, units.distance),
         f"{esc(near.nearest_zone)}; clearance {stated(limits.horizontal_clearance_m, units.distance)}")
        if near is not None else ("nearest zone", "none", "no zone at the path's height")
    )  # fmt: skip
    if (over := verdict.zone_pass) is not None:
        where = f"{over.side} {esc(over.zone)}, on the leg to item {over.seq}"
        figures.append(("over or under a zone", least(over.height_m, 1, units.distance), where))
    limit = f"limit {num(limits.max_climb_deg, 0, '°')}" if limits.max_climb_deg < 90 else "no limit"
    figures.append(("steepest", steepest(verdict.max_climb_deg), limit))
    battery = subject.vehicle.energy
    used = energy(verdict.reported_j(verdict.energy_j), 0, battery.battery_v) + esc(verdict.energy_mark)
    figures.append(
        ("battery", num(verdict.battery_used_percent, 1, "%"),
         f"{used}, of {energy(battery.battery_j, 0, battery.battery_v)}; "
         f"{num(100 * battery.reserve, 0, '%')} must be left")
        if verdict.battery_used_percent is not None
        else ("energy", used, "battery capacity not given")
    )  # fmt: skip
    since = "after the fleet's start" if in_fleet else "after take-off"
    if not in_fleet and subject.depart_s > 0.0:
        since = f"after the start, {duration(subject.depart_s)} of it on the ground"
    if subject.window_s is not None:
        since += f"; within {span(subject.window_s, page.time_decimals)}"
    items = len(verdict.mission.wire_items())
    figures.append(
        (
            "arrives",
            duration(subject.arrive_s, page.time_decimals),
            f"{since}; {items} mission items",
        )
    )
    if c is not None and c.objective == "energy":
        figures.insert(1, ("path energy", energy(c.cost, 1), _gap_words(c.bound, c.gap_percent, KILOJOULE)))
    if c is not None and c.objective == "time":
        figures.insert(1, ("path at full speed", num(c.cost, 1, SECOND), _gap_words(c.bound, c.gap_percent, SECOND)))
    cells = "".join(f"<div><dt>{name}</dt><dd>{value}<small>{more}</small></dd></div>" for name, value, more in figures)
    return (
        f'<article class="card t{index % COLOURS}"><h2><i class="swatch t{index % COLOURS}"></i>{esc(subject.name)}'
        f'<span class="pill {kind}">{sign} {word}</span></h2><dl>{cells}</dl></article>'
    )


def _bound_words(subject: Subject, units: Units) -> str:
    c = subject.certificate
    if c is None or c.objective != "length":
        return f"{duration(subject.verdict.time_s)} in the air"
    return _gap_words(c.bound, c.gap_percent, units.path)


def _gap_words(bound: float | None, gap_percent: float | None, unit: Unit) -> str:
    if bound is None:
        return "no bound: this planner proves none"
    return f"no path is below {least(bound, 0, unit)}; gap {num(gap_percent, 2, '%')}"


def _profiles(
    page: Page, lines: Sequence[TrackLine | None], found: Sequence[list[Passage]], full: frozenset[int]
) -> list[str]:
    parts = ['<section id="profiles"><h2>Altitude along the way</h2>', only_some(page, full)]
    for i in sorted(full):
        subject, line = page.subjects[i], lines[i]
        if line is None or not np.isfinite(line.ground_m).any():
            parts.append(f'<p class="note">{esc(subject.name)}: there is no line over known ground to draw.</p>')
            continue
        shown = " open" if len(parts) < 2 + OPEN_VEHICLES else ""
        unit = page.units.along(line.length_m)
        length = num(line.length_m, 2 if unit is page.units.far else 0, unit)
        parts.append(
            f"<details{shown}><summary>{esc(subject.name)}: {length} along the track"
            f"</summary>{tools(f'profile-{i}')}{profile_html(subject, line, found[i], i, page.world, page.units)}"
            f"{profile_legend(subject, line, found[i], page.world, page.units)}</details>"
        )
    parts.append("</section>")
    return parts


def _details(
    page: Page, lines: Sequence[TrackLine | None], found: Sequence[list[Passage]], full: frozenset[int]
) -> list[str]:
    parts = ['<section id="numbers"><h2>Numbers</h2>', tables.certificate_table(page), only_some(page, full)]
    for i in sorted(full):
        subject, line = page.subjects[i], lines[i]
        shown = " open" if len(page.subjects) == 1 else ""
        parts.append(f"<details{shown}><summary>{esc(subject.name)}: limits, zones and legs</summary>")
        parts.append(tables.limits_table(subject, line, page.units))
        if line is not None:
            parts.append(tables.zones_table(page, subject, line, found[i]))
        parts.append(tables.legs_table(subject, page.units) + tables.parameters_table(subject) + "</details>")
    parts.append("</section>")
    return parts


def _unjudged(page: Page) -> list[tuple[Subject, str]]:
    return [(s, note.text(s.wording(page.units))) for s in page.subjects for note in s.verdict.not_judged]


def _end(page: Page) -> str:
    wording = next((s.wording(page.units) for s in page.subjects), Wording(page.units))  # a page has one reader
    noted = [("", note) for note in page.notes] + [(s.name, note) for s in page.subjects for note in s.notes]
    notes = [(note.text(wording), name) for name, note in for_people(noted)]
    several = len(page.subjects) > 1
    listed = "".join(
        f"<li>{f'<b>{esc(who)}</b>: ' if who and several else ''}{esc(n)}</li>" for n, who in dict.fromkeys(notes)
    )
    missing = "".join(f"<li><b>{esc(s.name)}</b>: {esc(text)}</li>" for s, text in _unjudged(page))
    inputs = tables.inputs_table(page.inputs, page.facts, page.units)
    return (
        f'<section id="sent"><h2>Upload</h2>{tables.upload_table(page)}</section>'
        '<section id="notes"><h2>Notes, and what was not judged</h2>'
        + (f"<h3>Not judged</h3><ul>{missing}</ul>" if missing else "")
        + (_notes(listed, len(dict.fromkeys(notes))) if listed else "")
        + "<p>Wind, emergency landing sites and moving obstacles are not in the model. The terrain model has errors of "
        "its own.</p></section>"
        f'<section id="inputs"><h2>What went in</h2>{inputs}</section>'
        f"<footer>gcsplan {esc(__version__)}; numbers of room and clearance are rounded down</footer>"
    )


def _notes(listed: str, count: int) -> str:
    if count <= MOST_NOTES:
        return f"<h3>Notes</h3><ul>{listed}</ul>"
    return f"<details><summary>{count} notes</summary><ul>{listed}</ul></details>"
