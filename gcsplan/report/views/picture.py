"""Pictures of a report's page: the map from above, altitude profiles, the fleet over time, the view in space.

`draw_space` has shaded terrain, zones as solids, and the tracks.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path as FilePath
from typing import IO

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle as CirclePatch
from matplotlib.patches import Patch
from matplotlib.patches import Polygon as PolygonPatch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from gcsplan.arrays import Floats
from gcsplan.check.verdict import Verdict
from gcsplan.report.parts.page_data import Page
from gcsplan.report.parts.track_samples import TrackLine, line_of
from gcsplan.report.views.fleet import apart_m, flown_m, instants, motions_of
from gcsplan.report.views.scene_data import exaggeration, zone_meshes
from gcsplan.report.views.shaded_terrain import TINTS, extent_of, relief_of, shaded
from gcsplan.world.geometry.zones import Circle, KeepIn, Zone, keep_in_of, no_fly_of, on_map
from gcsplan.world.world import World

PICTURE_COLOURS = ("#d62728", "#1f77b4", "#9467bd", "#e377c2", "#17becf", "#bcbd22")
PICTURE_ZONE_COLOUR = "#ff7f0e"
PICTURE_AREA_COLOUR = "#1a7f37"
PIXELS = 900
LABEL_PT, LINE_PT, LETTER_PT = 6.5, 9.0, 4.2
"""Size of a zone's label, height of its line, and mean width of a letter, points."""
MAP_PT = 9.3 * 72.0
"""Width of the map without its scale and colours, points; labels are placed for it."""


def draw(page: Page) -> Figure:
    """Map and profiles of ``page``, in metres, labelled."""
    rows = len(page.subjects)
    west, south, east, north = _extent(page)
    map_inches = min(max(9.0 * (north - south) / (east - west) + 0.8, 2.5), 14.0)
    figure = Figure(figsize=(11, map_inches + 2.6 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1 + rows, 1, height_ratios=[map_inches] + [2.6] * rows)
    _map(axes[0], page, (west, south, east, north))
    for ax, vehicle, colour in zip(axes[1:], page.subjects, _colours(rows), strict=True):
        _profile(ax, page.world, vehicle.verdict, vehicle.vehicle.limits.min_agl_m, colour)
        ax.set_title(f"{vehicle.name}: {vehicle.verdict.length_m:,.0f} m", loc="left", fontsize=10)
    return figure


def save(page: Page, file: FilePath | IO[bytes], form: str = "png") -> None:
    """Write the picture of `draw` as png, svg or pdf; the same page gives the same bytes."""
    # A dollar sign in a name must stay a dollar sign, and names within an SVG must not be random.
    with rc_context({"text.parse_math": False, "svg.hashsalt": "gcsplan"}):
        draw(page).savefig(file, format=form, dpi=110, metadata=_described(page, form))


def figures(page: Page) -> dict[str, bytes]:
    """File name to PNG of each separate figure.

    They are report-map.png, report-space.png, report-profile.png, and for a fleet report-fleet.png.
    """
    drawn = {"report-map.png": _map_alone(page), "report-profile.png": _profiles_alone(page)}
    tracks = [
        (v.name, colour, line)
        for v, colour in zip(page.subjects, _colours(len(page.subjects)), strict=True)
        if (line := line_of(v.verdict, page.world, v.vehicle.limits, samples=400)) is not None
    ]
    space = draw_space(page.title, page.world, tracks)
    if space is not None:
        drawn["report-space.png"] = space
    if motions_of(page):
        drawn["report-fleet.png"] = _fleet_alone(page)
    out = {}
    with rc_context({"text.parse_math": False}):
        for name, figure in drawn.items():
            buffer = io.BytesIO()
            figure.savefig(buffer, format="png", dpi=110, metadata=_described(page))
            out[name] = buffer.getvalue()
    return out


def _described(page: Page, form: str = "png") -> dict[str, str | None]:
    """The metadata of a picture: the mission, and the length of each vehicle's path; no date and no program."""
    lengths = "; ".join(f"{v.name}: {v.verdict.length_m:,.0f} m" for v in page.subjects)
    if form == "pdf":
        return {"Title": page.title, "Subject": lengths, "Creator": None, "Producer": None, "CreationDate": None}
    without = {"Date": None, "Creator": None} if form == "svg" else {"Software": None}
    return {**without, "Title": page.title, "Description": lengths}


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _map_alone(page: Page) -> Figure:
    extent = _extent(page)
    west, south, east, north = extent
    figure = _figure(11, min(max(9.0 * (north - south) / (east - west) + 0.8, 2.5), 14.0))
    _map(figure.subplots(), page, extent)
    return figure


def _profiles_alone(page: Page) -> Figure:
    rows = len(page.subjects)
    figure = _figure(11, 2.8 * rows)
    axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
    for ax, vehicle, colour in zip(axes, page.subjects, _colours(rows), strict=True):
        _profile(ax, page.world, vehicle.verdict, vehicle.vehicle.limits.min_agl_m, colour)
        ax.set_title(f"{vehicle.name}: {vehicle.verdict.length_m:,.0f} m", loc="left", fontsize=10)
    return figure


def _fleet_alone(page: Page) -> Figure:
    motions = motions_of(page)
    times = instants(motions)
    figure = _figure(11, 6.5)
    way, apart = figure.subplots(2, 1, sharex=True)
    for (_, motion), colour in zip(motions, _colours(len(motions)), strict=True):
        way.plot(times, flown_m(motion, times) / 1000.0, color=colour, lw=1.6, label=motion.name)
    way.set(ylabel="way flown, km", xlim=(times[0], times[-1]))
    way.legend(fontsize=8, ncols=2)
    every = np.stack([apart_m(a, b, times) for (_, a), (_, b) in combinations(motions, 2)])
    some = ~np.isnan(every).all(axis=0)
    if some.any():
        apart.plot(times[some], np.nanmin(every[:, some], axis=0), color="#111111", lw=1.4, label="nearest two")
    if page.separation is not None:
        needed = page.separation.rules.needed_m
        apart.axhline(needed, color="#d62728", lw=1.0, ls="--", label=f"needed, {needed:g} m")
    apart.set(xlabel="time, s", ylabel="apart, m", ylim=(0, None))
    apart.legend(fontsize=8)
    for ax in (way, apart):
        ax.grid(alpha=0.3)
    return figure


def _colours(n: int) -> list[str]:
    return [PICTURE_COLOURS[i % len(PICTURE_COLOURS)] for i in range(n)]


def track_en(world: World, verdict: Verdict) -> Floats:
    """(N, 3) east_m, north_m, amsl_m of the ends of the flown stretches, with columns."""
    places = np.array([verdict.legs[0].start, *(leg.end for leg in verdict.legs)])
    return np.column_stack([world.frame.to_plane(places[:, 0], places[:, 1]), places[:, 2]])


def _extent(page: Page) -> tuple[float, float, float, float]:
    """West, south, east, north of the box around all tracks, with a margin."""
    every = np.concatenate([track_en(page.world, v.verdict) for v in page.subjects])[:, :2]
    low, high = every.min(axis=0), every.max(axis=0)
    pad = max(0.12 * float((high - low).max()), 50.0)
    return float(low[0] - pad), float(low[1] - pad), float(high[0] + pad), float(high[1] + pad)


def _map(ax: Axes, page: Page, extent: tuple[float, float, float, float]) -> None:
    tracks = [track_en(page.world, v.verdict) for v in page.subjects]
    west, south, east, north = extent
    columns = PIXELS
    lines = max(2, round(PIXELS * (north - south) / (east - west)))
    e, n = np.linspace(west, east, columns), np.linspace(north, south, lines)
    ground = page.world.airspace.surface.ground_at(e, n[:, None])
    low, high = (float(np.nanmin(ground)), float(np.nanmax(ground))) if not np.isnan(ground).all() else (0.0, 0.0)
    picture = shaded(ground, e, n, low, high)
    ax.imshow(np.rint(picture).astype(np.uint8), extent=(west, east, south, north))
    tints = LinearSegmentedColormap.from_list("ground", [(at, (r / 255, g / 255, b / 255)) for at, (r, g, b) in TINTS])
    heights = ScalarMappable(Normalize(low, max(high, low + 1.0)), tints)
    ax.figure.colorbar(heights, ax=ax, label="ground, m AMSL")
    zones = page.world.airspace.zones
    for zone in on_map(zones):
        ax.add_patch(_zone_patch(zone))
    halo = [withStroke(linewidth=2.0, foreground="white", alpha=0.7)]
    for area in keep_in_of(zones):
        for part in area.parts:
            for ring in (part.outline, *part.holes):
                ax.add_patch(PolygonPatch(ring, fill=False, edgecolor=PICTURE_AREA_COLOUR, linewidth=1.6))
    for words, place in _labels((*no_fly_of(zones), *keep_in_of(zones)), extent):
        ax.annotate(words, place, ha="center", va="center", fontsize=LABEL_PT, path_effects=halo, zorder=4)
    for vehicle, track, colour in zip(page.subjects, tracks, _colours(len(tracks)), strict=True):
        ax.plot(track[:, 0], track[:, 1], color=colour, lw=2, label=vehicle.name, marker=".", ms=5)
        ax.plot(*track[0, :2], "o", color=colour, ms=9, mec="white")
        ax.plot(*track[-1, :2], "s", color=colour, ms=9, mec="white")
    ax.set(xlim=(west, east), ylim=(south, north), xlabel="east, m", ylabel="north, m")
    ax.set_aspect("equal")
    handles, _ = ax.get_legend_handles_labels()
    ax.legend(handles=[*handles, Patch(fc=PICTURE_ZONE_COLOUR, alpha=0.4, label="no-fly")], loc="upper right")
    ax.set_title(f"{page.title}: planner {dict(page.facts).get('planner', 'none')}", loc="left")


def _zone_patch(zone: Zone) -> CirclePatch | PolygonPatch:
    patch: CirclePatch | PolygonPatch
    if isinstance(zone.shape, Circle):
        patch = CirclePatch((zone.shape.east_m, zone.shape.north_m), zone.shape.radius_m)
    else:
        patch = PolygonPatch(zone.shape.vertices)
    line = 1.2 if zone.outside is None else 0.0
    patch.set(facecolor=PICTURE_ZONE_COLOUR, edgecolor="#a04000", alpha=0.4, linewidth=line)
    return patch


def _zone_words(zone: Zone | KeepIn) -> str:
    if zone.floor is None and zone.ceiling is None:
        return zone.name
    return f"{zone.name}\n{zone.floor or 'ground'} – {zone.ceiling or 'unlimited'}".replace(" m AGL –", " –")


def _labels(
    zones: Sequence[Zone | KeepIn], extent: tuple[float, float, float, float]
) -> list[tuple[str, tuple[float, float]]]:
    """The label of each zone on the map and its middle: on the zone, or above or below it if another label is there.

    Small zones first, since a label beside a large one is hard to assign to it.
    """
    west, south, east, north = extent
    m_per_pt = (east - west) / MAP_PT
    taken: list[tuple[float, float, float, float]] = []
    found = []
    for zone in sorted(zones, key=lambda z: z.bounds[2] - z.bounds[0]):
        x0, y0, x1, y1 = zone.bounds
        if not (x1 > west and x0 < east and y1 > south and y0 < north):
            continue
        words = _zone_words(zone)
        lines = words.split("\n")
        half = 0.5 * m_per_pt * max(map(len, lines)) * LETTER_PT, 0.5 * m_per_pt * len(lines) * LINE_PT
        x, middle = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
        steps = [0.0, *(sign * k * half[1] for k in range(1, 9) for sign in (-1.0, 1.0))]
        boxes = [(x - half[0], middle + d - half[1], x + half[0], middle + d + half[1]) for d in steps]
        free = [b for b in boxes if not any(_overlap(b, other) for other in taken)]
        box = (free or boxes)[0]
        taken.append(box)
        found.append((words, (x, 0.5 * (box[1] + box[3]))))
    return found


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _profile(ax: Axes, world: World, verdict: Verdict, min_agl_m: float, colour: str) -> None:
    track = track_en(world, verdict)
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track[:, :2], axis=0).T))])
    s = np.linspace(0.0, run[-1], 2000) if run[-1] > 0 else run
    keep = np.concatenate([[True], np.diff(run) > 0])
    east, north = (np.interp(s, run[keep], track[keep, i]) for i in (0, 1))
    top = world.airspace.surface.top_at(east, north)
    ax.fill_between(s / 1000, np.nanmin(top) - 20, top, color="#8c7b6b", lw=0, label="ground")
    ax.plot(s / 1000, top + min_agl_m, color="#555555", lw=0.8, ls="--", label=f"min AGL {min_agl_m:g} m")
    ax.plot(run / 1000, track[:, 2], color=colour, marker=".", lw=1.6, label="path")
    ax.set(xlabel="distance, km", ylabel="m AMSL", xlim=(0, max(run[-1] / 1000, 1e-3)))
    ax.grid(alpha=0.3)
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize=8, frameon=False)


SPACE_NODES = 140
TURN_DEG, TILT_DEG = -118.0, 38.0
SOLID_COLOUR = "#e0511a"


def draw_space(title: str, world: World, tracks: Sequence[tuple[str, str, TrackLine]]) -> Figure | None:
    """The figure of ``tracks`` (name, colour and line of each vehicle); None if no ground is known."""
    lines = [line for _, _, line in tracks]
    relief = relief_of(world, extent_of(lines, no_fly_of(world.airspace.zones), world.airspace.surface))
    if not np.isfinite(relief.low_m):
        return None
    extent, high = relief.extent, exaggeration(relief, lines)
    longer = max(extent.width_m, extent.height_m)
    east = np.linspace(extent.west_m, extent.east_m, max(2, round(SPACE_NODES * extent.width_m / longer)))
    north = np.linspace(extent.north_m, extent.south_m, max(2, round(SPACE_NODES * extent.height_m / longer)))
    ground = world.airspace.surface.ground_at(east, north[:, None])
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.add_subplot(projection="3d", computed_zorder=False)
    assert isinstance(ax, Axes3D)
    colours = shaded(ground, east, north, relief.low_m, relief.high_m)[:-1, :-1] / 255.0
    km = 1000.0
    look = {"facecolors": colours, "shade": False, "lw": 0, "antialiased": False, "zorder": 1}
    ax.plot_surface(*np.meshgrid(east / km, north / km), ground, rstride=1, cstride=1, **look)
    top = max([relief.high_m, *(float(line.amsl_m.max()) for line in lines)])
    for mesh in zone_meshes(no_fly_of(world.airspace.zones), world.airspace.surface, relief, lines):
        at = np.array(mesh["at"]).reshape(-1, 3)
        corners = np.column_stack([(at[:, 0] + extent.west_m) / km, (at[:, 1] + extent.south_m) / km, at[:, 2]])
        faces = corners[np.array(mesh["faces"]).reshape(-1, 3)]
        ax.add_collection3d(Poly3DCollection(faces, facecolor=SOLID_COLOUR, alpha=0.12, lw=0, zorder=2))
        label = corners[corners[:, 2].argmax()]
        top = max(top, float(label[2]))
        ax.text(*label, str(mesh["name"]), fontsize=7, color="#8f2d08", ha="center", zorder=5)
    for name, colour, line in tracks:
        ax.plot(line.east_m / km, line.north_m / km, line.amsl_m, color=colour, lw=1.8, label=name, zorder=4)
    ax.set(xlabel="east, km", ylabel="north, km", zlabel="m AMSL", zlim=(relief.low_m, max(top, relief.low_m + 1.0)))
    ax.zaxis.set_major_locator(MaxNLocator(4))
    ax.set_box_aspect((extent.width_m, extent.height_m, max(high * (top - relief.low_m), 0.02 * longer)), zoom=1.1)
    ax.view_init(elev=TILT_DEG, azim=TURN_DEG)
    ax.legend(loc="upper right", fontsize=8)
    ax.set_title(f"{title}: heights × {high:g}", loc="left")
    return figure
