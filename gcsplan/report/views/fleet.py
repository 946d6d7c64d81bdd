"""A fleet over time: distance flown by each vehicle, distances between them, and the schedule in numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.fleet.separation import Separation
from gcsplan.notes.note import Note
from gcsplan.report.parts.html import Mark, esc, least, num, stated, table, tools
from gcsplan.report.parts.page_data import Page, only_some
from gcsplan.report.views.chart import Axes, chart_html
from gcsplan.report.views.plan import COLOURS
from gcsplan.units import Units, duration

INSTANTS = 600
MOST_PAIRS = 6
"""Most pairs that are drawn one by one; with more, only the nearest two at each time are drawn."""
FLEET_TALL = 0.34
BAND_WORDS = (
    "<style>path.band { fill: var(--t); opacity: .25; stroke: none; }</style>"
    '<p class="note">Lines are in still air; bands hold all declared winds at the way points.</p>'
)


def motions_of(page: Page) -> list[tuple[int, TimedPath]]:
    """The subjects that have a motion in the fleet's time, by number; empty for a single one."""
    found = [(i, s.motion) for i, s in enumerate(page.subjects) if s.motion is not None]
    return found if len(found) > 1 else []


def fleet_html(page: Page, charts: dict[str, object], full: frozenset[int]) -> str:
    """The two charts and the table; the charts' numbers are added to ``charts`` for the page's script.

    The way flown is drawn of the vehicles in ``full``.
    """
    motions = motions_of(page)
    if not motions:
        return _one_in_wind(page, charts)
    times = instants(motions)
    words = "The distances are drawn at sampled moments, while both of two vehicles are in the air."
    return (
        f'<section id="fleet"><h2>The fleet in time</h2><p>{separation_words(page)}</p>'
        + _schedule(page, motions)
        + "<h3>Way flown over time</h3>"
        + tools("distance")
        + _distance_chart(page, [m for m in motions if m[0] in full], times, charts)
        + only_some(page, full)
        + "<h3>Separation over time</h3>"
        + tools("separation")
        + _separation_chart(page, motions, times, charts)
        + f'<p class="note">{words}</p></section>'
    )


def _one_in_wind(page: Page, charts: dict[str, object]) -> str:
    """The way of a single vehicle over time, if its mission declares winds."""
    motions = [(i, s.motion) for i, s in enumerate(page.subjects) if s.motion is not None and s.window_s is not None]
    if not motions:
        return ""
    chart = _distance_chart(page, motions, instants(motions), charts)
    return f'<section id="fleet"><h2>The flight in time</h2>{tools("distance")}{chart}</section>'


def _bands(page: Page, motions: Sequence[tuple[int, TimedPath]]) -> dict[int, Floats]:
    """(L + 1, 3) by subject: metres flown at home and at each leg's end, and the earliest and latest time there."""
    found = {}
    for i, _ in motions:
        s = page.subjects[i]
        windows = s.verdict.leg_windows_s(s.slot)
        if windows is not None:
            run_m = np.cumsum([leg.horizontal_m * leg.times for leg in s.verdict.legs])
            times_s = s.depart_s + np.array([(0.0, 0.0), *windows])
            found[i] = np.column_stack([np.append(0.0, run_m), times_s])
    return found


def instants(motions: Sequence[tuple[int, TimedPath]]) -> Floats:
    """The times for the charts: evenly spaced, plus every time at which a vehicle begins a new piece."""
    begin, end = min(m.begin_s for _, m in motions), max(m.end_s for _, m in motions)
    own = np.concatenate([m.times_s for _, m in motions])
    if len(own) > 2 * INSTANTS:
        own = own[:0]
    return np.unique(np.round(np.concatenate([np.linspace(begin, end, INSTANTS), own]), 2))


def flown_m(motion: TimedPath, times_s: Floats) -> Floats:
    """(M,) horizontal distance flown at each time; NaN before take-off and after the end."""
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(motion.points[:, :2], axis=0).T))])
    inside = (times_s >= motion.begin_s - 1e-6) & (times_s <= motion.end_s + 1e-6)
    return np.where(inside, np.interp(times_s, motion.times_s, run), np.nan)


def apart_m(a: TimedPath, b: TimedPath, times_s: Floats) -> Floats:
    """(M,) distance in space at each time while both are in the air; NaN otherwise."""
    begin = max(a.begin_s, b.begin_s)
    end = min(math.inf if a.ends_in_air else a.end_s, math.inf if b.ends_in_air else b.end_s)
    inside = (times_s >= begin) & (times_s <= end)
    return np.where(inside, np.linalg.norm(a.at(times_s) - b.at(times_s), axis=1), np.nan)


def nearest_two_m(motions: Sequence[TimedPath], times_s: Floats) -> Floats:
    """(M,) distance in space of the nearest two of those in the air at each time; NaN if there are no two."""
    from scipy.spatial import cKDTree  # slow to import, and most pages show one vehicle

    places = np.full((len(times_s), len(motions), 3), np.nan)
    for k, m in enumerate(motions):
        inside = (times_s >= m.begin_s) & (times_s <= (math.inf if m.ends_in_air else m.end_s))
        places[inside, k] = m.at(times_s[inside])
    out = np.full(len(times_s), np.nan)
    for row, here in enumerate(places):
        flying = here[~np.isnan(here[:, 0])]
        if len(flying) > 1:
            out[row] = np.asarray(cKDTree(flying).query(flying, k=[2])[0]).min()
    return out


def _schedule(page: Page, motions: Sequence[tuple[int, TimedPath]]) -> str:
    order = {name: i + 1 for i, name in enumerate(page.order)}
    rows = []
    for i, motion in sorted(motions, key=lambda m: m[1].arrive_s):
        slot = page.subjects[i].slot
        rows.append(
            (
                f'<i class="swatch t{i % COLOURS}"></i>{esc(motion.name)}', str(order.get(motion.name, "–")),
                duration(motion.begin_s, 1), duration(slot.hold_s if slot else None),
                num(slot.speed_m_s if slot else None, 2, page.units.speed),
                duration(motion.arrive_s, 1) + page.subjects[i].window_words(1),
                "in the air" if motion.ends_in_air else duration(motion.end_s, 1),
                num(float(flown_m(motion, np.array([motion.end_s]))[0]), 0, page.units.path),
            )
        )  # fmt: skip
    head = (
        "vehicle|",
        "place in the order",
        "takes off",
        "holds",
        "speed",
        "at its goal",
        "on the ground",
        "horizontal way",
    )
    of = [i for i, _ in sorted(motions, key=lambda m: m[1].arrive_s)]
    return table("Schedule: times since the fleet's common start, h:mm:ss", head, rows, numbers=of)


def separation_words(page: Page) -> str:
    """`separation_text` as HTML."""
    text = esc(separation_text(page.separation, page.notes, page.units))
    return text.replace("Separation broken", "Separation <b>broken</b>", 1)


def separation_text(found: Separation | None, notes: Sequence[Note], units: Units) -> str:
    """The fleet's exact least distance in a sentence; empty if none was judged."""
    if found is None:
        return ""
    unit = units.distance
    needed = (
        f"{stated(found.rules.separation_m, unit)} required, {stated(found.rules.needed_m, unit)} needed in the model"
    )
    if found.least is None:
        return f"No two vehicles are ever in the air at the same time ({needed})."
    a, b = found.least.vehicles
    near = f"{least(found.least.distance_m, 1, unit)} at {duration(found.least.time_s, 1)}"
    word = "kept" if found.safe else "broken"
    still = " in still air" if any(note.code == "schedule_in_still_air" for note in notes) else ""
    return f"Separation {word}{still}: {a} and {b} come nearest, {near} ({needed}; exact, not sampled)."


def _distance_chart(
    page: Page, motions: Sequence[tuple[int, TimedPath]], times: Floats, charts: dict[str, object]
) -> str:
    bands = _bands(page, motions)
    latest_s = max((float(band[-1, 2]) for band in bands.values()), default=-math.inf)
    if latest_s > times[-1]:
        times = np.append(times, np.linspace(times[-1], latest_s, INSTANTS // 4)[1:])
    ways = [flown_m(m, times) for _, m in motions]
    longest = max(float(np.nanmax(w)) for w in ways)
    axes = Axes(
        float(times[0]), float(times[-1]), 0.0, 1.05 * max(longest, 1.0), "time", "way flown", None, page.units.far
    )
    shapes = [
        axes.area(times, np.interp(times, b[:, 2], b[:, 0]), np.interp(times, b[:, 1], b[:, 0]), f"band t{i % COLOURS}")
        for i, b in bands.items()
    ]
    shapes += [axes.line(times, w, f"track t{i % COLOURS}") for (i, _), w in zip(motions, ways, strict=True)]
    marks = []
    for i, m in motions:
        y = float(flown_m(m, np.array([min(max(m.arrive_s, m.begin_s), m.end_s)]))[0])
        tip = f"{m.name} reaches its goal after {duration(m.arrive_s, 1)}"
        marks.append(axes.mark(m.arrive_s, y, f"goal t{i % COLOURS}", m.name, tip, 1))
    charts["distance"] = _numbers(times, [(m.name, "far", 3, w) for (_, m), w in zip(motions, ways, strict=True)])
    words = f"Way flown over time by {len(motions)} vehicles, from {duration(times[0])} to {duration(times[-1])}"
    return chart_html("distance", axes, shapes, marks, words, FLEET_TALL) + (BAND_WORDS if bands else "")


def _separation_chart(
    page: Page, motions: Sequence[tuple[int, TimedPath]], times: Floats, charts: dict[str, object]
) -> str:
    nearest = nearest_two_m([m for _, m in motions], times)
    if np.isnan(nearest).all():
        return '<p class="note">No two vehicles are ever in the air at the same time.</p>'
    few = math.comb(len(motions), 2) <= MOST_PAIRS
    pairs = [(a, b, apart_m(a[1], b[1], times)) for a, b in combinations(motions, 2)] if few else []
    needed_m = page.separation.rules.needed_m if page.separation is not None else None
    unit = page.units.distance
    high = max(float(np.nanmax(nearest)), 1.4 * (needed_m or 0.0), 1.0)
    axes = Axes(float(times[0]), float(times[-1]), 0.0, 1.08 * high, "time", "apart", None, unit)
    shapes, numbers = [], [("nearest two", "distance", 1, nearest)]
    if needed_m:
        ends, zero = [times[0], times[-1]], [0.0, 0.0]
        shapes += [axes.area(ends, zero, [needed_m, needed_m], "below"), axes.line(ends, [needed_m, needed_m], "floor")]
    if pairs:
        shapes += [axes.line(times, d, "pair") for _, _, d in pairs]
        numbers += [(f"{a[1].name} – {b[1].name}", "distance", 1, d) for a, b, d in pairs]
    shapes.append(axes.line(times, nearest, "nearest"))
    mark = _nearest_mark(page, axes, times, nearest)
    marks = [] if mark is None else [mark]
    charts["separation"] = _numbers(times, numbers)
    nearest_words = "" if mark is None else f"; {mark.tip}"
    words = f"Distance of the nearest two vehicles over time{nearest_words}; required: {num(needed_m, 1, unit)}"
    key = (
        '<ul class="legend"><li><i class="stroke nearest"></i>nearest two</li>'
        + ('<li><i class="stroke pair"></i>each pair</li>' if pairs else "")
        + ('<li><i class="swatch below"></i>nearer than needed</li>' if needed_m else "")
        + "</ul>"
    )
    return chart_html("separation", axes, shapes, marks, words, FLEET_TALL) + key


def _nearest_mark(page: Page, axes: Axes, times: Floats, nearest: Floats) -> Mark | None:
    """The nearest approach: the exact one, if the separation was judged, else that of the sampled moments."""
    found = page.separation
    if found is None:
        at = int(np.nanargmin(nearest))
        time_s, distance_m, who, about = float(times[at]), float(nearest[at]), "two vehicles", "about "
    elif found.least is None:
        return None
    else:
        time_s, distance_m, who, about = (
            found.least.time_s,
            found.least.distance_m,
            " and ".join(found.least.vehicles),
            "",
        )
    label = least(distance_m, 1, page.units.distance)
    broken = found is not None and distance_m < found.rules.needed_m - 1e-6
    tip = f"{who} are nearest at {duration(time_s, 1)}: {about}{label}"
    return axes.mark(time_s, distance_m, "broken" if broken else "tight", label, tip, 0)


def _numbers(times: Floats, series: Sequence[tuple[str, str, int, Floats]]) -> dict[str, object]:
    """The numbers that the page's script shows of a chart under the pointer."""
    return {
        "x": [round(float(t), 2) for t in times], "xunit": "time",
        "series": [
            {"name": name, "unit": unit, "decimals": decimals,
             "y": [None if math.isnan(v) else round(float(v), 3) for v in y]}
            for name, unit, decimals, y in series
        ],
    }  # fmt: skip
