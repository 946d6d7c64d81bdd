"""The briefing: two printed pages with what a crew reads and signs; on the screen they are not shown.

The first has verdict, map, limits, times and lines to sign on, the second parameters and way points. They hold nothing
that the rest of the report does not hold, but for the daylight. Names and messages are cut to a length, and lists to a
number, so that each stays one page; the page says how much it leaves out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from gcsplan import __version__
from gcsplan.check.verdict import by_item
from gcsplan.figures import counted
from gcsplan.mavlink.mission.parameter_list import Setting
from gcsplan.mavlink.mission.return_parameters import setting
from gcsplan.report.parts.html import (
    Mark,
    energy,
    esc,
    greatest,
    least,
    marks_html,
    num,
    place,
    plain,
    stated,
    steepest,
    table,
)
from gcsplan.report.parts.page_data import Page, Subject
from gcsplan.report.views.fleet import motions_of, separation_words
from gcsplan.report.views.plan import COLOURS
from gcsplan.report.views.shaded_terrain import Relief
from gcsplan.units import Units, duration, in_units, span
from gcsplan.world.terrain.model_words import what_is_not_in

MOST_VEHICLES = 4
MOST_FINDINGS, MOST_RALLY, MOST_NOTES = 2, 4, 1
NAME, MESSAGE = 28, 105
"""Most letters of a name in the table, and of a message."""
MAP_MM, SMALL_MAP_MM, WIDE_MM = 44.0, 16.0, 180.0
"""Height of the map, height where problems take the room, and greatest width."""
PX_PER_MM = 96.0 / 25.4
MAIN_PARAMETERS = ("speed", "return_speed", "lean", "roll")
"""The parameters that stand on the briefing, by their newest names; the report's tables have all."""
MARK_KINDS = ("start", "goal", "rally", "name")
"""The marks of the map that are on the briefing's, too."""
MOST_PARAMETERS, MOST_WAY_POINTS = 30, 24
"""Most parameters, and most way points of all vehicles together, on the second page."""
NOT_IN_IT = "{wind}, emergency landing sites and moving obstacles are not in the model."


def briefing_html(page: Page, verdict: tuple[str, str, str, str], relief: Relief, marks: Sequence[Mark]) -> str:
    """The section. ``verdict`` is the page's class, sign, word and sentence; ``marks`` are those of its map."""
    kind, sign, word, words = verdict
    shown = _shown(page)
    rest = len(page.subjects) - len(shown)
    more = f"{rest} more vehicles are not on this page: see the tables that follow." if rest else ""
    absent = what_is_not_in(page.inputs)
    bare = f"{esc(absent[0].upper() + absent[1:])}. " if absent else ""
    apart = separation_words(page)
    wind = "Wind" if page.wind.code == "still_air" else "Tracks and corners in the wind"
    problems = _problems(page)
    high_mm = SMALL_MAP_MM if problems else MAP_MM
    return (
        '<section class="briefing" id="briefing"><p class="brand">mission briefing</p>'
        f'<p class="title">{esc(_short(page.title, 60))}</p>'
        f'<p class="verdict {kind}"><b>{sign} {word}</b> {words}</p>'
        f"{problems}{_map(page, relief, marks, high_mm)}{_vehicles(page, shown)}"
        + "".join(f'<p class="fact">{text}</p>' for text in (more, _rally(page, shown), apart, _order(page)) if text)
        + f'<p class="fact"><b>{bare}</b>{NOT_IN_IT.format(wind=wind)} {_inputs(page)}</p>{_signatures()}</section>'
        + f'<section class="briefing" id="briefing-2"><p class="brand">mission briefing, second page</p>'
        f'<p class="fact">Wind: {esc(in_units(page.wind, page.units))}. {_daylight(page)}</p>'
        f"{_parameters(shown)}{_way_points(page, shown)}</section>"
    )


def _daylight(page: Page) -> str:
    """Sunrise and sunset at the start, if it is known when the mission is flown."""
    light = page.daylight
    if light is None:
        return "Daylight is not known: the mission does not say when it is flown (<code>at</code>)."
    day = f"{light.noon:%Y-%m-%d}"
    if light.sunrise is None or light.sunset is None:
        return f"Daylight at the start on {day}: the sun {'does not set' if light.up else 'does not rise'}."
    return f"Daylight at the start on {day}: sunrise {light.sunrise:%H:%M}, sunset {light.sunset:%H:%M} UTC."


def _parameters(shown: Sequence[tuple[int, Subject]]) -> str:
    """The parameters to set, failsafes among them, a column for each vehicle."""
    values = [{s.parameter.names[-1].name: _set_to(s) for s in subject.settings} for _, subject in shown]
    names = list(dict.fromkeys(name for column in values for name in column))
    if not names:
        return ""
    rows = [(esc(name), *(esc(column.get(name, "–").strip()) for column in values)) for name in names[:MOST_PARAMETERS]]
    rest = len(names) - len(rows)
    head = ["|", *(f"{esc(_name(s.name))}|" for _, s in shown)]
    title = "Parameters and failsafes on board that this was judged with: set them, or compare"
    return table(title, head, rows) + (f'<p class="fact">and {rest} more, in the tables.</p>' if rest else "")


def _set_to(setting: Setting) -> str:
    """The value of a parameter by its newest name, and the rule if others are within it."""
    rule = setting.rule_words()
    return f"{setting.parameter.names[-1].value(setting.value):.6g}" + (f" ({rule})" if rule else "")


def _way_points(page: Page, shown: Sequence[tuple[int, Subject]]) -> str:
    """The way points of each vehicle with their heights and times; of many the first."""
    units, parts = page.units, []
    for _, s in shown:
        clock, flown, rows = s.verdict.clock_s(s.slot), 0, []
        for item, stretches in by_item(s.verdict.legs):
            flown += stretches
            rows.append(
                (
                    f"{item.seq} {esc(item.kind)}", place(*item.end[:2]), num(item.end[2], 0, units.amsl),
                    least(item.agl_end_m, 0, units.height), num(item.length_m, 0, units.leg),
                    duration(s.depart_s + clock[flown - 1]),
                )
            )  # fmt: skip
        most = MOST_WAY_POINTS // len(shown)
        rest = len(rows) - most
        head = ("to item|", "place|", "altitude", "above ground", "leg", "at")
        parts.append(table(f"Way points of {esc(_name(s.name))}", head, rows[:most]))
        parts.append(f'<p class="fact">and {rest} more, in the tables.</p>' if rest > 0 else "")
    return "".join(parts)


def _shown(page: Page) -> list[tuple[int, Subject]]:
    """The vehicles on this page: the first to arrive, where not all have room."""
    every = list(enumerate(page.subjects))
    first = sorted(every, key=lambda s: s[1].arrive_s)[:MOST_VEHICLES] if len(every) > MOST_VEHICLES else every
    return sorted(first, key=lambda s: s[0])


def _problems(page: Page) -> str:
    """The first broken limits, and the first parts that were not judged."""
    found = [f"{s.name}: {f.note.text(s.wording(page.units))}" for s in page.subjects for f in s.verdict.findings]
    found += [f"{name}: no mission, left out: {why}" for name, why in page.left_out]
    found += [in_units(text, page.units) for text in page.rehearsed.violations] if page.rehearsed is not None else []
    unjudged = [
        f"{s.name}: not judged: {note.text(s.wording(page.units))}"
        for s in page.subjects
        for note in s.verdict.not_judged
    ]
    out = [*found[:MOST_FINDINGS], *unjudged[:MOST_NOTES]]
    rest = len(found) + len(unjudged) - len(out)
    listed = "".join(f"<li>{esc(_short(text, MESSAGE))}</li>" for text in out)
    listed += f"<li>and {rest} more, on the pages that follow</li>" if rest else ""
    return f'<ul class="findings">{listed}</ul>' if listed else ""


def _map(page: Page, relief: Relief, marks: Sequence[Mark], high_mm: float) -> str:
    """The report's own map once more, small; its shapes are referred to, not repeated."""
    extent = relief.extent
    ratio = extent.height_m / extent.width_m
    wide_mm = min(WIDE_MM, high_mm / ratio)
    few = [m for m in marks if m.kind.split(" ")[0] in MARK_KINDS]
    return (
        f'<figure class="view map brief" id="brief" style="aspect-ratio:{1.0 / ratio:.4f};'
        f'width:{wide_mm:.1f}mm"><svg viewBox="0 0 10000 {extent.height_m * extent.scale:.1f}" '
        f'preserveAspectRatio="none" role="img" aria-label="Map of {esc(page.title)}, small"><use href="#drawing"/>'
        f'</svg><div class="marks">{marks_html(few, ratio, wide_mm * PX_PER_MM)}</div>'
        '<div class="north" aria-hidden="true">N<br>↑</div></figure>'
    )


def _vehicles(page: Page, shown: Sequence[tuple[int, Subject]]) -> str:
    """One column for each vehicle: where, limits with what is left of them, times, way home."""
    if not shown:
        return ""
    head = ["|", *(f'<i class="swatch t{i % COLOURS}"></i>{esc(_name(s.name))}|' for i, s in shown)]
    columns = [dict(_facts(page, s, page.units)) for _, s in shown]
    names = list(dict.fromkeys(name for column in columns for name in column))
    rows = [(name, *(column.get(name, "–") for column in columns)) for name in names]
    since = "T+0, the common start" if motions_of(page) else "T+0, the start" if shown[0][1].motion else "take-off"
    return table(f"Limits, margins and times; times are h:mm:ss after {since}", head, rows)


def _facts(page: Page, s: Subject, units: Units) -> Iterator[tuple[str, str]]:
    verdict, limits, craft = s.verdict, s.vehicle.limits, s.vehicle
    yield "vehicle", f"{esc(str(verdict.mission.autopilot))}, system {craft.sysid}"
    if len(page.subjects) > 1:
        yield "verdict", esc(in_units(s.words, units))
    if verdict.legs:
        for name, at in (("starts at", verdict.legs[0].start), ("ends at", verdict.legs[-1].end)):
            yield name, f"{place(*at[:2])}<br>{num(at[2], 0, units.amsl)}"
    items = len(verdict.mission.wire_items())
    speed = f", {num(s.slot.speed_m_s, 1, units.speed)}" if s.slot is not None else ""
    yield "path", f"{num(verdict.length_m, 0, units.path)}, {items} items{speed}"
    low, near = verdict.lowest, verdict.nearest
    lowest = least(low.min_agl_m, 1, units.height) if low is not None else "–"
    yield "lowest above ground", f"{lowest}; at least {stated(limits.min_agl_m, units.height)}"
    peak = max((max(leg.start[2], leg.end[2]) for leg in verdict.legs), default=math.nan)
    most = f"; at most {stated(limits.max_amsl_m, units.height)}" if limits.max_amsl_m is not None else ""
    yield "highest", greatest(peak, 0, units.amsl) + most
    high = verdict.highest
    most = "no limit is set" if limits.max_agl_m is None else f"at most {stated(limits.max_agl_m, units.height)}"
    yield "highest above ground", f"{greatest(high.max_agl_m if high else None, 1, units.height)}; {most}"
    zone = f"{least(near.zone_clearance_m, 1, units.distance)}, {esc(_name(near.nearest_zone))}" if near else "none"
    if (over := verdict.zone_pass) is not None:
        zone += f"; {least(over.height_m, 1, units.distance)} {over.side} {esc(_name(over.zone))}"
    yield "nearest zone", f"{zone}; at least {stated(limits.horizontal_clearance_m, units.distance)}"
    angle = f"; at most {num(limits.max_climb_deg, 0, '°')}" if limits.max_climb_deg < 90.0 else ""
    yield "steepest", steepest(verdict.max_climb_deg) + angle
    across, up = stated(limits.track_error_m, units.distance), stated(limits.altitude_error_m, units.height)
    yield "errors kept off", f"{across} across, {up} in height"
    yield "battery", _battery(s)
    yield "leaves", duration(s.depart_s)
    yield "at its goal", duration(s.arrive_s)
    if s.window_s is not None:
        yield "at its goal within", span(s.window_s)
    if s.motion is not None:
        end = duration(s.motion.end_s)
        yield "on the ground", "stays in the air" if s.motion.ends_in_air else "flies on" if s.leaves else end
    yield from _way_home(s, units)
    main = [(t.parameter.names[-1], t.value) for t in s.settings if t.parameter.key in MAIN_PARAMETERS]
    if main:
        values = ", ".join(f"{name.name} {name.value(value):.6g}" for name, value in main)
        versions = " and ".join(sorted({name.versions for name, _ in main if name.versions}))
        named = f" (so named {versions})" if versions else ""
        yield "parameters", esc(f"{values}{named}")


def _battery(s: Subject) -> str:
    used, battery, mark = s.verdict.battery_used_percent, s.vehicle.energy, esc(s.verdict.energy_mark)
    if used is None:
        return f"{energy(s.verdict.reported_j(s.verdict.energy_j), 0, battery.battery_v)}{mark}; capacity not given"
    return f"{num(used, 1, '%')} used{mark}; {num(100.0 * battery.reserve, 0, '%')} must be left"


def _way_home(s: Subject, units: Units) -> Iterator[tuple[str, str]]:
    home = s.home
    if home is None:
        yield "way home", "not judged"
        return
    yield "way home", esc(_short(home.headline.text(s.wording(units)), MESSAGE))
    if home.route == "mission" and home.advice is not None:
        yield "to set", esc(_short(home.advice.text(s.wording(units)), MESSAGE))
    if home.set_rel_home_m is not None and home.then is not None:
        yield "to set", esc(setting(home.autopilot, home.set_rel_home_m))
        points = f"with {counted(len(home.rally), 'rally point')} on board: " if home.rally else ""
        yield "what that leaves", esc(_short(points + home.then.text(s.wording(units)), MESSAGE))


def _rally(page: Page, shown: Sequence[tuple[int, Subject]]) -> str:
    """The proposed rally points, with their altitudes above home."""
    several = len(page.subjects) > 1
    every = [(s.name, r) for _, s in shown if s.home is not None for r in s.home.rally]
    words = [
        (f"{esc(_name(name))} " if several else "")
        + f"{place(r.lat_deg, r.lon_deg)} at {num(r.rel_home_m, 0, page.units.height)}"
        for name, r in every[:MOST_RALLY]
    ]
    rest = f"; and {len(every) - MOST_RALLY} more" if len(every) > MOST_RALLY else ""
    return f"Rally points proposed: {'; '.join(words)}{rest}." if words else ""


def _order(page: Page) -> str:
    """The order of arrival, if it is of few vehicles."""
    return f"Order: {esc(_short(', '.join(page.order), MESSAGE))}." if len(page.order) > 1 else ""


def _inputs(page: Page) -> str:
    dem, datum = page.inputs.get("dem_sha256"), page.inputs.get("vertical_datum")
    words = [
        f"terrain model {esc(str(dem)[:12])}…" if dem else "",
        f"heights {esc(_short(str(datum), NAME))}" if datum else "",
    ]
    return ", ".join(["Made by gcsplan " + esc(__version__), *(w for w in words if w)]) + "."


def _signatures() -> str:
    """Lines to sign on; nobody's name is known here."""
    line = "".join(f"<span>{what}</span>" for what in ("name", "date", "signature"))
    return "".join(f'<div class="sign-here"><b>{who}</b>{line}</div>' for who in ("planned by", "flown by"))


def _name(text: str) -> str:
    """A name, cut in the middle: what tells names apart is at their ends."""
    words = plain(text)
    return words if len(words) <= NAME else f"{words[: NAME // 2]}…{words[1 - NAME // 2 :]}"


def _short(text: str, most: int) -> str:
    """``text`` cut to ``most`` letters."""
    words = plain(text)
    return words if len(words) <= most else words[: most - 1] + "…"
