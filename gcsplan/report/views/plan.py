"""The map: shaded ground, contours, zones, tracks, way points and tight places, seen from above."""

from __future__ import annotations

import math
from collections.abc import Container, Sequence

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.report.parts.html import Mark, at_least, esc, least, marks_html, num, place, stated
from gcsplan.report.parts.page_data import Page, Subject
from gcsplan.report.parts.track_samples import TrackLine, distance_m
from gcsplan.report.views.shaded_terrain import TINTS, MapExtent, Relief, nice_step, tints
from gcsplan.units import Unit, Units, duration
from gcsplan.world.geometry.zones import Circle, KeepIn, Level, Zone, keep_in_of, no_fly_of, on_map
from gcsplan.world.world import World

NAME_INSIDE = 0.12
"""Part of the map's height above which a zone's name is inside it; the names of smaller ones are beside them."""
MOST_IN_LEGEND = 100
"""Most vehicles that the legend names."""
COLOURS = 8
"""Number of the style sheet's classes t0 …; more vehicles reuse them from the first."""


def map_marks(page: Page, lines: Sequence[TrackLine | None], relief: Relief, full: Container[int]) -> list[Mark]:
    """The marks of the map: zones' names, and of the vehicles in ``full`` way points, starts, goals, tight places."""
    zones = page.world.airspace.zones
    named: list[Zone | KeepIn] = [*no_fly_of(zones), *keep_in_of(zones)]
    marks = [m for zone in named for m in _zone_mark(zone, relief.extent, page.units)]
    for i, (subject, line) in enumerate(zip(page.subjects, lines, strict=True)):
        if line is not None and i in full:
            marks += _track_marks(subject, line, i, relief.extent, page.world, page.units)
    return marks


def map_html(
    page: Page, lines: Sequence[TrackLine | None], relief: Relief, marks: Sequence[Mark], flown: Sequence[Floats] = ()
) -> str:
    """The map as a figure with its legend. ``marks``: see `map_marks`.

    ``flown``: (N, 2) east and north of each line flown in a rehearsal.
    """
    extent, zones = relief.extent, page.world.airspace.zones
    height = extent.height_m * extent.scale
    shapes = [
        f'<image href="{relief.picture}" x="0" y="0" width="10000" height="{height:.1f}" preserveAspectRatio="none"/>',
        f'<path class="contour" d="{relief.contours}"/>' if relief.contours else "",
        *(_zone_svg(zone, i, extent, page.units) for i, zone in enumerate(on_map(zones))),
        *(_area_svg(area, extent, page.units) for area in keep_in_of(zones)),
        *(
            _no_return_svg(s, line, extent, page.units)
            for s, line in zip(page.subjects, lines, strict=True)
            if line is not None
        ),
        *(_track_svg(line, i, extent) for i, line in enumerate(lines) if line is not None),
        *(_flown_svg(line, extent) for line in flown),
    ]
    words = f"{len(page.subjects)} vehicle{'s' * (len(page.subjects) != 1)}, {len(no_fly_of(zones))} no-fly zones"
    words += f", {len(areas)} keep-in area{'s' * (len(areas) != 1)}" if (areas := keep_in_of(zones)) else ""
    aspect = extent.width_m / extent.height_m
    bar, bar_words = scale_bar(extent.width_m / 8.0, page.units)
    return (
        f'<figure class="view map" id="map" '
        f'style="aspect-ratio:{aspect:.4f};max-width:max(320px,calc(88vh*{aspect:.4f}))" '
        f'data-width-m="{extent.width_m:.3f}" data-height-m="{extent.height_m:.3f}">'
        f'<svg viewBox="0 0 10000 {height:.1f}" preserveAspectRatio="none" role="img" '
        f'aria-label="Map of {esc(page.title)}: {words}; the tables below hold the same numbers">'
        f'<g id="drawing">{"".join(shapes)}</g><path class="cursor" d=""/></svg>'
        f'<div class="marks">{marks_html(marks, extent.height_m / extent.width_m)}</div>'
        f'<div class="north" aria-hidden="true">N<br>↑</div>'
        f'<div class="scale" style="width:{100 * bar / extent.width_m:.3f}%"><b>{bar_words}</b></div></figure>'
        + legend(page, relief)
    )


def legend(page: Page, relief: Relief) -> str:
    """The legend of colours, for the map and the view in space."""
    units = page.units
    tracks = "".join(
        f'<li><i class="swatch t{i % COLOURS}"></i>{esc(s.name)}</li>' for i, s in enumerate(page.subjects)
    )
    if len(page.subjects) > MOST_IN_LEGEND:
        tracks = f"<li>{len(page.subjects)} vehicles in {COLOURS} colours</li>"
    stops = ",".join(f"rgb({r},{g},{b}) {100 * at:g}%" for at, (r, g, b) in TINTS)
    ground = ""
    if math.isfinite(relief.low_m):
        flat = tuple(int(v) for v in tints(np.zeros(1))[0])
        ramp = f"linear-gradient(90deg,{stops})" if relief.high_m - relief.low_m > 1e-6 else f"rgb{flat}"
        ground = (
            f'<li>ground {num(relief.low_m, 0, units.height)} <i class="ramp" style="background:{ramp}"></i> '
            f"{num(relief.high_m, 0, units.amsl)}</li>"
        )
    contours = f"<li>contours every {num(relief.interval_m, 0 if relief.interval_m >= 1 else 1, units.height)}</li>"
    unknown = "" if relief.all_known else '<li><i class="swatch unknown"></i>ground unknown</li>'
    zone = '<li><i class="swatch zone"></i>no-fly zone</li>' if page.world.airspace.zones else ""
    if keep_in_of(page.world.airspace.zones):
        zone = '<li><i class="swatch zone"></i>no-fly: zones, and outside of keep-in areas</li>'
        zone += '<li><i class="swatch area"></i>edge of a keep-in area</li>'
    homes = ""
    if any(s.home is not None and s.home.unsafe for s in page.subjects):
        homes = '<li><i class="swatch nowhere"></i>no safe return from here</li>'
    if any(s.home is not None and s.home.rally for s in page.subjects):
        homes += '<li><i class="dot rally"></i>rally point proposed</li>'
    return (
        f'<ul class="legend">{tracks}{zone}'
        f'<li><i class="dot tight"></i>tight place</li>{homes}{ground}'
        f"{contours if relief.contours else ''}{unknown}</ul>"
    )


def zone_heights(zone: Zone | KeepIn, units: Units) -> str:
    """The range of heights of a zone, in short words."""
    if zone.floor is None and zone.ceiling is None:
        return "all heights"

    def words(level: Level) -> str:
        return f"{units.height.stated(level.value_m)} {units.height.symbol} {level.datum.upper()}"

    on_ground = zone.floor is None or (zone.floor.value_m == 0 and zone.floor.datum == "agl")
    low = "ground" if zone.floor is None or on_ground else words(zone.floor)
    return f"{low} – {'unlimited' if zone.ceiling is None else words(zone.ceiling)}"


def _zone_svg(zone: Zone, index: int, extent: MapExtent, units: Units) -> str:
    title = f"<title>{esc(zone.label)}: {esc(zone_heights(zone, units))}{_size(zone, units)}</title>"
    part = " outside" if zone.outside is not None else ""
    part += " part" if zone.floor is not None or zone.ceiling is not None else ""
    if isinstance(zone.shape, Circle):
        x, y = extent.units(np.array(zone.shape.east_m), np.array(zone.shape.north_m))
        shape = f'circle cx="{x:.1f}" cy="{y:.1f}" r="{zone.shape.radius_m * extent.scale:.1f}"'
    else:
        points = extent.units(zone.shape.vertices[:, 0], zone.shape.vertices[:, 1])
        shape = 'polygon points="' + " ".join(f"{x:.1f},{y:.1f}" for x, y in points) + '"'
    name = shape.split(" ", 1)[0]
    return f'<{shape} class="zone{part}" data-zone="{index}">{title}</{name}>'


def _area_svg(area: KeepIn, extent: MapExtent, units: Units) -> str:
    title = f"<title>keep-in area {esc(area.name)}: {esc(zone_heights(area, units))}</title>"
    rings = [ring for part in area.parts for ring in (part.outline, *part.holes)]
    ways = (extent.units(ring[:, 0], ring[:, 1]) for ring in rings)
    d = " ".join("M" + "L".join(f"{x:.1f},{y:.1f}" for x, y in way) + "Z" for way in ways)
    return f'<path class="area" d="{d}">{title}</path>'


def _size(zone: Zone, units: Units) -> str:
    return f", radius {stated(zone.shape.radius_m, units.distance)}" if isinstance(zone.shape, Circle) else ""


def _zone_mark(zone: Zone | KeepIn, extent: MapExtent, units: Units) -> list[Mark]:
    west, south, east, north = zone.bounds
    large = (north - south) / extent.height_m > NAME_INSIDE
    x, y = _part(extent, 0.5 * (west + east), 0.5 * (south + north) if large else north)
    if not (0 < x < 1 and 0 < y < 1):
        return []
    heights = zone_heights(zone, units)
    label = zone.name if heights == "all heights" else f"{zone.name}\n{heights}"
    return [Mark(x, y, "name" if large else "name beside", label, f"{zone.label}: {heights}", 3)]


def _track_svg(line: TrackLine, index: int, extent: MapExtent) -> str:
    xy = extent.units(line.east_m, line.north_m)
    keep = line.end.copy()
    keep[0] = True
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in xy[keep])
    return (
        f'<polyline class="casing" data-line="{index}" points="{points}"/>'
        f'<polyline class="track t{index % COLOURS}" data-line="{index}" points="{points}"/>'
    )


def _flown_svg(line: Floats, extent: MapExtent) -> str:
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in extent.units(line[:, 0], line[:, 1]))
    return f'<polyline class="flown" points="{points}"/>'


def _track_marks(
    subject: Subject, line: TrackLine, index: int, extent: MapExtent, world: World, units: Units
) -> list[Mark]:  # fmt: skip
    legs, colour = subject.verdict.legs, f"t{index % COLOURS}"
    ends = np.flatnonzero(line.end)
    many = "" if index == 0 else f"{subject.name} "
    marks = []
    for leg, at in zip(legs, ends, strict=True):
        if leg.column or leg.kind != "cruise":
            continue
        x, y = _part(extent, line.east_m[at], line.north_m[at])
        tip = f"{subject.name} item {leg.seq}: {place(*leg.end[:2])}; {num(leg.end[2], 1, units.amsl)}, " + (
            f"{least(leg.agl_end_m, 1, units.height)} above ground; {duration(line.time_s[at])} after take-off"
        )
        marks.append(Mark(x, y, f"wp {colour}", str(leg.seq), tip, 4))
    first, last = _part(extent, line.east_m[0], line.north_m[0]), _part(extent, line.east_m[-1], line.north_m[-1])
    begins = f"{subject.name} starts at {place(*legs[0].start[:2])}, {num(legs[0].start[2], 1, units.amsl)}"
    finishes = f"{subject.name} ends at {place(*legs[-1].end[:2])}, {num(legs[-1].end[2], 1, units.amsl)}"
    marks.append(Mark(*first, f"start {colour}", f"{subject.name} start", begins, 1))
    if math.dist(first, last) > 1e-4:
        marks.append(Mark(*last, f"goal {colour}", f"{subject.name} goal", finishes, 1))
    places = tight_places(subject, line, world, units) + _home_places(subject, world, units)
    return marks + [Mark(*_part(extent, e, n), kind, many + label, tip, 0) for e, n, kind, label, tip in places]


def _no_return_svg(subject: Subject, line: TrackLine, extent: MapExtent, units: Units) -> str:
    """Lines along the parts of the track from which the way home is not safe."""
    home, paths = subject.home, []
    for s in home.unsafe if home is not None else ():
        mine = np.flatnonzero((line.run_m >= s.from_m) & (line.run_m <= s.to_m))
        if len(mine) > 1:
            xy = extent.units(line.east_m[mine], line.north_m[mine])
            points = " ".join(f"{x:.1f},{y:.1f}" for x, y in xy)
            why = esc(s.why.text(subject.wording(units)))
            paths.append(f'<polyline class="nohome" points="{points}"><title>no safe return: {why}</title></polyline>')
    return "".join(paths)


def _home_places(subject: Subject, world: World, units: Units) -> list[tuple[float, float, str, str, str]]:
    """Proposed rally points, and the point of no return."""
    home, found = subject.home, []
    for r in home.rally if home is not None else ():
        e, n = (float(v) for v in world.frame.to_plane(r.lat_deg, r.lon_deg))
        tip = f"{subject.name}: rally point proposed at {place(r.lat_deg, r.lon_deg)}"
        found.append((e, n, "rally", "rally", f"{tip}, {at_least(r.rel_home_m, 0, units.height)} above home; {r.why}"))
    battery = home.battery if home is not None else None
    if battery is not None and battery.point_of_no_return is not None:
        e, n = (float(v) for v in world.frame.to_plane(*battery.point_of_no_return[:2]))
        found.append((e, n, "broken", "no return", f"{subject.name}: {battery.note.text(subject.wording(units))}"))
    return found


def tight_places(
    subject: Subject, line: TrackLine, world: World, units: Units
) -> list[tuple[float, float, str, str, str]]:
    """East, north, class, label and words of the lowest point, the nearest zone, and every finding with a place."""
    found = []
    verdict = subject.verdict
    low, near = verdict.lowest, verdict.nearest
    if low is not None:
        e, n = (float(v) for v in world.frame.to_plane(*low.min_agl_at))
        words = f"{least(low.min_agl_m, 1, units.height)} AGL"
        tip = f"{subject.name}: lowest above ground, {words}, on the leg to item {low.seq}, at {place(*low.min_agl_at)}"
        found.append((e, n, "tight", words, tip))
    zones = [z for z in world.airspace.zones if near is not None and z.name == near.nearest_zone]
    if near is not None and zones:
        mine = np.flatnonzero(line.leg == verdict.legs.index(near))
        away = np.min([distance_m(z, line.east_m[mine], line.north_m[mine]) for z in zones], axis=0)
        at = mine[int(away.argmin())]
        words = f"{least(near.zone_clearance_m, 1, units.distance)} from {near.nearest_zone}"
        tip = f"{subject.name}: nearest to a zone at its height, {words}, on the leg to item {near.seq}"
        found.append((float(line.east_m[at]), float(line.north_m[at]), "tight", words, tip))
    for f in verdict.findings:
        if math.isfinite(f.lat_deg) and math.isfinite(f.lon_deg):
            e, n = (float(v) for v in world.frame.to_plane(f.lat_deg, f.lon_deg))
            found.append(
                (
                    e,
                    n,
                    "broken",
                    f"item {f.seq}: {f.kind.replace('_', ' ')}",
                    f"{subject.name}: {f.note.text(subject.wording(units))}",
                )
            )
    return [t for t in found if math.isfinite(t[0]) and math.isfinite(t[1])]


def _part(extent: MapExtent, east_m: float, north_m: float) -> tuple[float, float]:
    return (float(east_m) - extent.west_m) / extent.width_m, (extent.north_m - float(north_m)) / extent.height_m


def scale_bar(about_m: float, units: Units) -> tuple[float, str]:
    """The length of a scale bar, a round number of its unit, in metres; and its words."""
    unit: Unit = units.far if about_m > 0.5 * units.far.size else units.distance
    length = nice_step(unit.of(about_m))
    return length * unit.size, num(length, 0 if length >= 1 else 2, unit.symbol)
