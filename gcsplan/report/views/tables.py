"""The page's tables: legs, limits with what is left of each, zones, certificate, upload, inputs, rehearsal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from gcsplan.check.verdict import LegFigures, by_item
from gcsplan.figures import floored
from gcsplan.mavlink.mission.autopilots import profile_of
from gcsplan.notes.note import Wording
from gcsplan.report.parts.html import (
    THIN,
    at_least,
    between,
    energy,
    esc,
    greatest,
    least,
    num,
    place,
    stated,
    steepest,
    table,
)
from gcsplan.report.parts.page_data import Compared, Page, Subject
from gcsplan.report.parts.track_samples import Passage, TrackLine
from gcsplan.report.views.plan import COLOURS, zone_heights
from gcsplan.report.views.profile import passed
from gcsplan.units import KILOJOULE, SECOND, Unit, Units, duration, in_units
from gcsplan.world.terrain.model_words import what_is_not_in

MOST_DIFFERENCES = 30
"""Most vehicles that show what changed."""
CLOSE = 0.02
"""Part of a limit's value: if less than this is left, the limit is called close."""


def vehicles_table(page: Page, verdicts: Sequence[str]) -> str:
    """The key figures, a row for each vehicle."""
    units, rows, marks = page.units, [], []
    for s, word in zip(page.subjects, verdicts, strict=True):
        verdict, low, near = s.verdict, s.verdict.lowest, s.verdict.nearest
        high = verdict.highest
        bound = s.certificate.gap_percent if s.certificate is not None else None
        home = {True: "safe", False: "no safe return", None: "not judged"}[s.home.safe] if s.home is not None else "–"
        rows.append(
            (
                esc(s.name), word, num(verdict.length_m, 0, units.path), num(bound, 2, "%"),
                least(low.min_agl_m if low else None, 1, units.height),
                greatest(high.max_agl_m if high else None, 1, units.height),
                f"{least(near.zone_clearance_m, 1, units.distance)} {esc(near.nearest_zone)}" if near else "–",
                steepest(verdict.max_climb_deg),
                energy(verdict.reported_j(verdict.energy_j), 0, s.vehicle.energy.battery_v) + esc(verdict.energy_mark),
                num(verdict.battery_used_percent, 1, "%"),
                duration(s.arrive_s, page.time_decimals) + s.window_words(page.time_decimals), home,
            )
        )  # fmt: skip
        marks.append("bad" if verdict.safe is False else "close" if verdict.safe is None or s.homeless else "")
    head = ("vehicle|", "verdict|", "path", "gap", "lowest AGL", "highest AGL", "nearest zone|", "steepest", "energy",
            "battery", "arrives", "way home|")  # fmt: skip
    return table("Key figures", head, rows, marks=marks, numbers=range(len(rows)))


def differences_html(page: Page) -> str:
    """What changed since earlier missions, for each vehicle; empty where there is none to compare with."""
    parts = []
    for d in page.differences[:MOST_DIFFERENCES]:
        parts.append(f"<h3>{esc(d.name)}: {esc(d.headline.text(Wording(page.units)))}</h3>")
        if not d.equal:
            rows = [tuple(map(esc, row)) for row in d.rows(page.units)]
            parts.append(table(f"Figures of {esc(d.name)}", ("|", "before", "now", "change"), rows))
            listed = "".join(f"<li>{esc(note.text(Wording(page.units)))}</li>" for note in d.remarks())
            parts.append(f"<ul>{listed}</ul>" if listed else "")
    rest = len(page.differences) - MOST_DIFFERENCES
    more = f'<p class="note">and {rest} more vehicles: <code>--json</code> has all</p>' if rest > 0 else ""
    return f'<section id="difference"><h2>What changed</h2>{"".join(parts)}{more}</section>' if parts else ""


def legs_table(subject: Subject, units: Units) -> str:
    """Each item in the order flown: its end, heights, climb angle, nearest zone, energy and time."""
    bad = {f.seq for f in subject.verdict.findings}
    battery = subject.vehicle.energy.battery_j
    clock = subject.verdict.clock_s(subject.slot)
    used, flown, rows, marks = 0.0, 0, [], []
    for item, stretches in by_item(subject.verdict.legs):
        used += item.energy_j * item.times
        flown += stretches
        name = f"{item.seq} {item.kind}" + (f" ×{THIN}{item.times}" if item.times > 1 else "")
        away = least(item.zone_clearance_m, 0, units.distance)
        near = f"{away} {esc(item.nearest_zone)}" if item.nearest_zone else "–"
        rows.append(
            (
                esc(name), num(item.length_m, 0, units.leg), num(item.end[2], 1, units.height),
                least(item.agl_end_m, 1, units.height),
                "column" if item.column else least(item.min_agl_m, 1, units.height),
                greatest(item.max_agl_m, 1, units.height), steepest(item.climb_deg), near,
                energy(subject.verdict.reported_j(item.energy_j), 1),
                num(100.0 * used / battery, 1, "%") if battery else "–", duration(item.time_s),
                duration(clock[flown - 1]),
            )
        )  # fmt: skip
        marks.append("bad" if item.seq in bad else "")
    head = ("to item|", "length", "AMSL there", "AGL there", "lowest AGL", "highest AGL", "climb", "nearest zone|",
            "energy", "battery used", "time", "since take-off")  # fmt: skip
    return table(f"Legs of {esc(subject.name)}, in the order flown", head, rows, marks=marks)


def limits_table(subject: Subject, line: TrackLine | None, units: Units) -> str:
    """Every limit with its errors, the value that was reached, and what is left."""
    rows, marks = [], []
    for name, needed, reached, left, unit, where, share in _limits(subject, line, units):
        broken = left is not None and left < -1e-6
        close = left is not None and not broken and share is not None and left <= share
        word = "broken" if broken else "close" if close else "kept" if left is not None else "–"
        rows.append((name, needed, reached, least(left, _decimals(unit), unit), word, where))
        marks.append("bad" if broken else "close" if close else "")
    head = ("limit|", "required", "reached", "left", "|", "where|")
    return table(f"Limits of {esc(subject.name)}, and how near each came to binding", head, rows, marks=marks)


def _decimals(unit: str | Unit) -> int:
    """Decimals of what is left of a limit: metres to a centimetre, angles and percent to a tenth, items whole."""
    return 2 if isinstance(unit, Unit) else 1 if unit else 0


LimitRow = tuple[str, str, str, float | None, str | Unit, str, float | None]
"""Limit, required value, value reached, what is left, its unit, place, and what is left at most to be called close."""


def _limits(subject: Subject, line: TrackLine | None, units: Units) -> list[LimitRow]:
    verdict, limits = subject.verdict, subject.vehicle.limits
    error, track = limits.altitude_error_m, limits.track_error_m
    flown = [leg for leg in verdict.legs if not leg.column]
    height, distance = units.height, units.distance
    rows: list[LimitRow] = []
    low = verdict.lowest
    if low is not None:
        needed_m = limits.min_agl_m + error
        words = f"{stated(limits.min_agl_m, height)} + {stated(error, height)} error"
        at = f"item {low.seq}, {place(*low.min_agl_at)}"
        rows.append(("lowest above ground and what stands on it", words, least(low.min_agl_m, 2, height),
                     low.min_agl_m - needed_m, height, at, CLOSE * needed_m))  # fmt: skip
    top = verdict.highest
    if limits.max_agl_m is None and top is not None:
        rows.append(("highest above ground", "no limit is set", greatest(top.max_agl_m, 2, height), None, height,
                     f"item {top.seq}", None))  # fmt: skip
    if limits.max_agl_m is not None and top is not None:
        rows.append(("highest above ground", f"{stated(limits.max_agl_m, height)} − {stated(error, height)} error",
                     greatest(top.max_agl_m, 2, height), limits.max_agl_m - error - top.max_agl_m, height,
                     f"item {top.seq}", CLOSE * limits.max_agl_m))  # fmt: skip
    if limits.max_amsl_m is not None and verdict.legs:
        peak = max(verdict.legs, key=lambda leg: max(leg.start[2], leg.end[2]))
        z = max(peak.start[2], peak.end[2])
        rows.append(("highest above sea level", f"{stated(limits.max_amsl_m, height)} − {stated(error, height)} error",
                     greatest(z, 2, height), limits.max_amsl_m - error - z, height, f"item {peak.seq}",
                     1.0))  # fmt: skip
    near = verdict.nearest
    if near is not None:
        needed_m = limits.horizontal_clearance_m + track
        rows.append(("horizontal distance from zones at the path's height",
                     f"{stated(limits.horizontal_clearance_m, distance)} + {stated(track, distance)} error",
                     least(near.zone_clearance_m, 2, distance), near.zone_clearance_m - needed_m, distance,
                     f"item {near.seq}, {esc(near.nearest_zone)}", max(CLOSE * needed_m, 1.0)))  # fmt: skip
    if (over := verdict.zone_pass) is not None:
        kept = f"{stated(limits.vertical_clearance_m, distance)} + " if limits.vertical_clearance_m else ""
        rows.append((f"height {over.side} a zone, less the error", f"{kept}{stated(error, distance)} error",
                     least(over.height_m, 2, distance), over.height_m - limits.over_zone_m, distance,
                     f"item {over.seq}, {esc(over.zone)}", max(CLOSE * limits.over_zone_m, 1.0)))  # fmt: skip
    if line is not None:
        rows += _height_left(subject, line, units)
    rows += _steepness(flown, limits.max_climb_deg, limits.max_descent_deg)
    battery = subject.vehicle.energy
    if battery.battery_j and verdict.battery_used_percent is not None:
        may = 100.0 * (1.0 - battery.reserve)
        rows.append(("battery", f"{num(may, 1)} ({num(100 * battery.reserve, 0)} kept)",
                     num(verdict.battery_used_percent, 1, "%") + esc(verdict.energy_mark),
                     may - verdict.battery_used_percent, "%", "whole flight", 5.0))  # fmt: skip
    items, most = len(verdict.mission.wire_items()), profile_of(verdict.mission.autopilot).max_items
    if most is not None:
        rows.append(
            ("mission items", num(most), num(items), float(most - items), "", str(verdict.mission.autopilot), 0.0)
        )
    return rows


def _height_left(subject: Subject, line: TrackLine, units: Units) -> list[LimitRow]:
    """The least height above all that terrain requires: min AGL, clearance and errors together, at the samples."""
    legs = subject.verdict.legs
    free = np.array([leg.column for leg in legs])[line.leg]
    room = np.where(free | ~np.isfinite(line.floor_m), np.inf, line.amsl_m - line.floor_m)
    at = int(room.argmin())
    if not math.isfinite(room[at]):
        return []
    words = "the judgement is exact; this is drawn from samples, on the safe side, to some centimetres"
    needed = f'<abbr title="{words}">{at_least(float(line.floor_m[at]), 1, units.amsl)}</abbr>'
    left = float(room[at])
    return [("terrain with clearance and all errors, tightest sample", needed,
             num(float(line.amsl_m[at]), 1, units.amsl),
             max(left, 0.0) if left > -0.5 and subject.verdict.safe is not False else left, units.height,
             f"item {legs[line.leg[at]].seq}, {num(line.run_m[at], 2, units.far)} along", 1.0)]  # fmt: skip


def _steepness(flown: Sequence[LegFigures], climb_deg: float, descent_deg: float) -> list[LimitRow]:
    rows: list[LimitRow] = []
    if not flown:
        return rows
    up, down = max(flown, key=lambda leg: leg.climb_deg), min(flown, key=lambda leg: leg.climb_deg)
    for name, limit, sign, steep in (("climb", climb_deg, 1.0, up), ("descent", descent_deg, -1.0, down)):
        if limit >= 90.0:
            continue
        angle = max(sign * steep.climb_deg, 0.0)
        rows.append((f"steepest {name}", num(limit, 1, "°"), steepest(angle, 2), limit - angle, "°",
                     f"item {steep.seq}", CLOSE * limit))  # fmt: skip
    return rows


def zones_table(page: Page, subject: Subject, line: TrackLine, found: Sequence[Passage]) -> str:
    """The zones along the track of one vehicle: those passed over, under or at their height."""
    if not found:
        return ""
    rows = []
    for p in found:
        ends = between(float(line.run_m[p.first]), float(line.run_m[p.last]), page.units.far)
        rows.append((esc(p.zone.name), esc(zone_heights(p.zone, page.units)), ends, passed(p, page.units)))
    limits = subject.vehicle.limits
    reach = stated(limits.horizontal_clearance_m + limits.track_error_m, page.units.distance)
    caption = f"Zones that {esc(subject.name)} passes within {reach} of their outline (heights at samples)"
    return table(caption, ("zone|", "reaches|", "along the track", "how|"), rows)


def certificate_table(page: Page) -> str:
    """Length, energy or time, the bound that no path can beat, and the gap between the two."""
    rows = []
    for s in page.subjects:
        c = s.certificate
        if c is None:
            continue
        unit = {"m": page.units.path, "J": KILOJOULE, "s": SECOND}[c.unit]
        rows.append(
            (
                esc(s.name), esc(c.objective), num(c.cost, 1, unit),
                least(c.bound, 1, unit) if c.bound is not None else "none: this planner proves nothing",
                num(c.gap_percent, 3, "%"), esc(c.stopped_by),
            )
        )  # fmt: skip
    if not rows:
        return ""
    head = ("vehicle|", "objective|", "flown path", "no path is below", "gap at most", "search ended by|")
    return table("Certificate: how far the path can be from the best there is", head, rows)


def parameters_table(subject: Subject) -> str:
    """The parameters that a mission was judged with; empty if there are none."""
    if not subject.settings:
        return ""
    rows = [
        (
            "<br>".join(esc(n.name) for n in s.parameter.names),
            "<br>".join(f"{n.value(s.value):.6g}" for n in s.parameter.names),
            esc(s.rule_words()), esc(str(s.why)),
        )
        for s in subject.settings
    ]  # fmt: skip
    return table("Parameters of the vehicle that this was judged with", ("parameter|", "value", "rule|", "why|"), rows)


def upload_table(page: Page) -> str:
    """The result of each upload; a note if nothing was sent."""
    rows, marks = [], []
    for s in page.subjects:
        u = s.upload
        if u is None:
            continue
        where = esc(u.get("url", "")) + (" (simulated)" if u.get("simulated") else "")
        seconds = u.get("seconds")
        rows.append(
            (
                esc(s.name), where, esc(u.get("items", "–")), esc(u.get("outcome", "–")),
                "read back the same" if u.get("verified") else "not verified",
                num(float(seconds), 2, "s") if isinstance(seconds, int | float) else "–", esc(u.get("message", "")),
            )
        )  # fmt: skip
        marks.append("" if u.get("verified") else "bad")
    if not rows:
        return '<p class="note">Nothing was sent to any vehicle when this report was written.</p>'
    head = ("vehicle|", "link|", "items", "outcome|", "read back|", "took", "said|")
    warned = [(s.name, in_units(note, page.units)) for s in page.subjects for note in s.warnings]
    listed = "".join(f"<li><b>{esc(who)}</b>: {esc(words)}</li>" for who, words in warned)
    return table("Upload", head, rows, marks=marks) + (f"<ul>{listed}</ul>" if listed else "")


def inputs_table(inputs: Mapping[str, object], facts: Sequence[tuple[str, str]], units: Units) -> str:
    """The inputs: terrain model, its datum and resolution, hashes; and what was requested."""
    names = {
        "dem_sha256": "terrain model, SHA-256", "vertical_datum": "vertical datum", "heights_read": "heights",
        "resolution_m": "resolution",
        "bare_dem": "terrain model", "zones_sha256": "zones, SHA-256",
        "dem_source": "terrain from", "dem_notice": "terrain data", "dem_tiles": "tiles",
        "sea_tiles": "tiles taken as sea, 0 m",
    }  # fmt: skip
    rows = []
    for key, value in inputs.items():
        if value is None or key == "dem_kind":  # which stands in the words of bare_dem
            continue
        words = esc(in_units(value, units) if isinstance(value, str) else value)
        if key == "bare_dem":
            words = esc(what_is_not_in(inputs, model="") or "obstacle heights were given")
        elif key == "resolution_m" and isinstance(value, int | float):
            words = num(float(value), 0 if value >= 10 else 3, units.distance)
        elif key.endswith("sha256"):
            words = f"<code>{words}</code>"
        rows.append((esc(names.get(key, key.replace("_", " "))), words))
    rows += [(esc(name), esc(value)) for name, value in facts]
    return table("What went in", ("input|", "value|"), rows)


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
