"""The altitude profile along the track: ground, altitudes that terrain and limits allow, zones, and the path."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.report.parts.html import Mark, greatest, least, num, place, stated
from gcsplan.report.parts.page_data import Subject
from gcsplan.report.parts.track_samples import Passage, TrackLine, level_amsl
from gcsplan.report.views.chart import Axes, chart_html
from gcsplan.report.views.plan import COLOURS, zone_heights
from gcsplan.units import Units
from gcsplan.world.world import World

PROFILE_TALL = 0.38


def profile_html(
    subject: Subject, line: TrackLine, found: list[Passage], index: int, world: World, units: Units
) -> str:  # fmt: skip
    """The chart of one vehicle; ``found`` are the zones that its line passes over, under or through."""
    run = line.run_m
    axes = _axes(line, found, units)
    limits = subject.vehicle.limits
    floor = np.where(np.isfinite(line.floor_m), line.floor_m, np.nan)
    bottom = np.full(len(run), -np.inf)
    shapes = []
    ceiling = np.where(np.isfinite(line.ceiling_m), line.ceiling_m, np.nan)
    if np.isfinite(ceiling).any():
        shapes.append(axes.area(run, ceiling, np.full(len(run), np.inf), "above"))
        shapes.append(axes.line(run, ceiling, "ceiling"))
    shapes.append(axes.area(run, bottom, floor, "below"))
    shapes.append(axes.line(run, floor, "floor"))
    for p in found:
        part = slice(p.first, p.last + 1)
        low = level_amsl(p.zone.floor, line.ground_m[part], -math.inf)
        high = level_amsl(p.zone.ceiling, line.ground_m[part], math.inf)
        title = f"{p.zone.label}: {zone_heights(p.zone, units)}"
        shapes.append(axes.area(_wide(run[part], axes), low, high, "zone", title))
    if not np.array_equal(line.top_m, line.ground_m, equal_nan=True):
        shapes.append(axes.area(run, line.ground_m, line.top_m, "obstacles", f"{_standing(world)}, as stated"))
    shapes.append(axes.area(run, bottom, line.ground_m, "ground"))
    shapes.append(axes.line(run, line.amsl_m, "casing"))
    shapes.append(axes.line(run, line.amsl_m, f"track t{index % COLOURS}"))
    words = (
        f"Altitude profile of {subject.name}: {num(line.length_m, 2, units.far)} along the track, ground from "
        f"{num(_least(line.ground_m), 0, units.height)} to {num(_most(line.ground_m), 0, units.amsl)}, path up to "
        f"{greatest(float(line.amsl_m.max()), 0, units.amsl)}, min AGL {stated(limits.min_agl_m, units.height)}"
    )
    marks = _marks(subject, line, found, axes, index, units) + _broken(subject, line, axes, world, units)
    return chart_html(f"profile-{index}", axes, shapes, marks, words, PROFILE_TALL)


def profile_legend(subject: Subject, line: TrackLine, found: list[Passage], world: World, units: Units) -> str:
    """The legend of a profile's colours."""
    limits = subject.vehicle.limits
    trees = not np.array_equal(line.top_m, line.ground_m, equal_nan=True)
    top = np.isfinite(line.ceiling_m).any()
    return (
        '<ul class="legend"><li><i class="swatch ground"></i>ground</li>'
        + (f'<li><i class="swatch obstacles"></i>{_standing(world)}</li>' if trees else "")
        + '<li><i class="swatch below"></i>too low: min AGL '
        + f"{stated(limits.min_agl_m, units.height)}, clearance and errors</li>"
        + ('<li><i class="swatch above"></i>too high for the limits</li>' if top else "")
        + ('<li><i class="swatch zone"></i>no-fly zone on the way</li>' if found else "")
        + "</ul>"
    )


def _standing(world: World) -> str:
    """The name of the band between the ground and its top."""
    differs, bare = world.airspace.surface.differs, bool(world.airspace.surface.info.get("bare_dem", True))
    if not differs:
        return "trees and buildings"
    return "the ground's greatest height" if bare else "trees and buildings on the ground's greatest height"


def _axes(line: TrackLine, found: list[Passage], units: Units) -> Axes:
    low, high = _least(line.ground_m, line.amsl_m), _most(line.amsl_m, line.ground_m)
    for p in found:  # include a level near the path, but not one far above, which would flatten everything else
        ground = line.ground_m[p.first : p.last + 1]
        levels = np.concatenate(
            [level_amsl(p.zone.floor, ground, math.nan), level_amsl(p.zone.ceiling, ground, math.nan)]
        )
        near = levels[np.abs(levels - 0.5 * (low + high)) < 1.2 * (high - low) + 10.0]
        high, low = max(high, _most(near, low)), min(low, _least(near, high))
    top = line.ceiling_m[np.isfinite(line.ceiling_m)]
    if len(top) and float(top.max()) < high + 0.6 * (high - low):
        high = max(high, float(top.max()))
    room = max(0.06 * (high - low), 1e-3 * max(line.length_m, 10.0))
    return along_axes(line, low - room, high + 1.6 * room, units)


def along_axes(line: TrackLine, low_m: float, high_m: float, units: Units) -> Axes:
    """Altitudes over the way along a line."""
    long_m = max(line.length_m, 1e-3)
    unit = units.along(line.length_m)
    return Axes(-0.012 * long_m, 1.012 * long_m, low_m, high_m, "along the track", "", unit, units.amsl)


def _least(*arrays: Floats | float) -> float:
    every = np.concatenate([np.atleast_1d(np.asarray(a, float)) for a in arrays])
    return float(np.min(every[np.isfinite(every)]))


def _most(*arrays: Floats | float) -> float:
    every = np.concatenate([np.atleast_1d(np.asarray(a, float)) for a in arrays])
    return float(np.max(every[np.isfinite(every)]))


def _wide(run: Floats, axes: Axes) -> Floats:
    """Widen a zone that is passed in an instant, so that it can be seen."""
    least_run = 0.002 * (axes.x1 - axes.x0)
    short = least_run - float(run[-1] - run[0])
    return run if short <= 0 else run + short * (np.linspace(-0.5, 0.5, len(run)) if len(run) > 1 else 0.0)


def _marks(
    subject: Subject, line: TrackLine, found: list[Passage], axes: Axes, index: int, units: Units
) -> list[Mark]:  # fmt: skip
    legs, colour, height = subject.verdict.legs, f"t{index % COLOURS}", units.height
    marks = []
    for leg, at in zip(legs, np.flatnonzero(line.end), strict=True):
        if leg.kind != "cruise" or leg.column:
            continue
        tip = f"item {leg.seq}: {num(leg.end[2], 1, units.amsl)}, {least(leg.agl_end_m, 1, height)} above ground"
        marks.append(axes.mark(line.run_m[at], line.amsl_m[at], f"wp {colour}", str(leg.seq), tip, 4))
    for p in found:
        middle = (p.first + p.last) // 2
        ground = np.nan_to_num(line.ground_m[middle], nan=axes.y0)
        low = max(level_amsl(p.zone.floor, line.ground_m[middle : middle + 1], axes.y0)[0], ground)
        high = level_amsl(p.zone.ceiling, line.ground_m[middle : middle + 1], axes.y1)[0]
        y = min(max(0.5 * (max(low, axes.y0) + min(high, axes.y1)), axes.y0), axes.y1)
        tip = f"{p.zone.label}: {zone_heights(p.zone, units)}; {passed(p, units)}"
        marks.append(axes.mark(line.run_m[middle], float(y), "name", p.zone.name, tip, 3))
    lowest = subject.verdict.lowest
    if lowest is not None:
        mine = np.flatnonzero(line.leg == legs.index(lowest))
        agl = line.amsl_m[mine] - line.top_m[mine]
        if np.isfinite(agl).any():
            tightest = mine[int(np.nanargmin(agl))]
            words = f"{least(lowest.min_agl_m, 1, height)} AGL"
            tip = f"lowest above ground, {words}, on the leg to item {lowest.seq}, at {place(*lowest.min_agl_at)}"
            marks.append(axes.mark(line.run_m[tightest], line.amsl_m[tightest], "tight", words, tip, 0))
    return marks


def _broken(subject: Subject, line: TrackLine, axes: Axes, world: World, units: Units) -> list[Mark]:
    """Marks of the findings, each at the nearest sample of its item."""
    marks, seq = [], np.array([leg.seq for leg in subject.verdict.legs])
    for f in subject.verdict.findings:
        mine = np.flatnonzero(seq[line.leg] == f.seq)
        if len(mine) and math.isfinite(f.lat_deg + f.lon_deg + f.amsl_m):
            e, n = (float(v) for v in world.frame.to_plane(f.lat_deg, f.lon_deg))
            away = np.hypot(np.hypot(line.east_m[mine] - e, line.north_m[mine] - n), line.amsl_m[mine] - f.amsl_m)
            x = line.run_m[int(mine[int(away.argmin())])]
            text = f.note.text(subject.wording(units))
            marks.append(axes.mark(x, f.amsl_m, "broken", f.kind.replace("_", " "), text, 0))
    return marks


def passed(p: Passage, units: Units) -> str:
    """The passage of a zone, in words; the numbers come from samples."""
    if p.over_m is not None and p.over_m >= 0.0:
        return f"passed {least(p.over_m, 0, units.height)} above its ceiling"
    if p.under_m is not None and p.under_m >= 0.0:
        return f"passed {least(p.under_m, 0, units.height)} below its floor"
    return "passed at its height, within its clearance or inside"
