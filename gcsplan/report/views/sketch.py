"""A plan as a small map and a table, for notebooks and for the web pages of others.

Nothing in it is a script, a style, or a file from elsewhere, so that a page shows it under any content security policy.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.verdict import Verdict
from gcsplan.report.parts.html import esc, least, num
from gcsplan.report.parts.page_data import Page
from gcsplan.units import duration
from gcsplan.world.geometry.zones import Circle, Zone
from gcsplan.world.world import World

TRACK_COLOURS = ("#d62728", "#1f77b4", "#9467bd", "#e377c2", "#17becf", "#bcbd22")
WIDTH_PX, MARGIN_PART, LEAST_SIDE = 480, 0.06, 0.6
MOST_TRACKS, MOST_ZONES = 200, 500
"""Most tracks and zones that are drawn, and rows of the table; a fleet's page has all."""

JUDGED = {True: "safe", False: "not safe", None: "not judged"}


def sketch_html(page: Page, verdicts: Sequence[str]) -> str:
    """Map and table of a page as a fragment of HTML; ``verdicts`` are sentences, one for each vehicle."""
    tracks = [_track(page.world, s.verdict) for s in page.subjects[:MOST_TRACKS]]
    rows = "".join(
        f"<tr><th>{esc(s.name)}</th><td>{JUDGED[s.verdict.safe]}</td>"
        f"<td>{num(s.verdict.length_m, 0, page.units.path)}</td>"
        f"<td>{least(low.min_agl_m if (low := s.verdict.lowest) else None, 1, page.units.height)}</td>"
        f"<td>{duration(s.arrive_s, page.time_decimals)}</td><td>{esc(words)}</td></tr>"
        for s, words in zip(page.subjects[:MOST_TRACKS], verdicts, strict=False)
    )
    more = len(page.subjects) - MOST_TRACKS
    caption = f"{esc(page.title)}{f': the first {MOST_TRACKS} of {len(page.subjects)} vehicles' if more > 0 else ''}"
    head = "<tr><th>vehicle</th><th>path</th><th>length</th><th>lowest AGL</th><th>arrives</th><th>verdict</th></tr>"
    return f"<div>{_map(page, tracks)}<table><caption>{caption}</caption>{head}{rows}</table></div>"


def _track(world: World, verdict: Verdict) -> Floats:
    """(N, 2) east_m, north_m of the ends of the flown stretches."""
    places = np.array([verdict.legs[0].start, *(leg.end for leg in verdict.legs)])
    return world.frame.to_plane(places[:, 0], places[:, 1])


def _map(page: Page, tracks: Sequence[Floats]) -> str:
    if not tracks:
        return ""
    every = np.concatenate(tracks)
    low, high = every.min(axis=0), every.max(axis=0)
    longer = max(float((high - low).max()), 50.0)
    margin = np.maximum(MARGIN_PART * longer, 0.5 * (LEAST_SIDE * longer - (high - low)))
    low, high = low - margin, high + margin
    scale = WIDTH_PX / max(float((high - low).max()), 1.0)
    width, height = (high - low) * scale

    def at(places: Floats) -> str:
        x, y = (places[..., 0] - low[0]) * scale, (high[1] - places[..., 1]) * scale
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(np.atleast_1d(x), np.atleast_1d(y), strict=True))

    def zone_svg(zone: Zone) -> str:
        look = 'fill="#ff7f0e" fill-opacity="0.35" stroke="#ff7f0e"'
        title = f"<title>{esc(zone.name)}</title>"
        if isinstance(zone.shape, Circle):
            x, y = at(np.array([zone.shape.east_m, zone.shape.north_m])).split(",")
            return f'<circle cx="{x}" cy="{y}" r="{zone.shape.radius_m * scale:.1f}" {look}>{title}</circle>'
        return f'<polygon points="{at(zone.shape.vertices)}" {look}>{title}</polygon>'

    near = [z for z in page.world.airspace.zones if _meets(z, low, high)][:MOST_ZONES]
    lines = "".join(
        f'<polyline points="{at(track)}" fill="none" stroke="{TRACK_COLOURS[i % len(TRACK_COLOURS)]}" stroke-width="2">'
        f"<title>{esc(s.name)}</title></polyline>"
        for i, (s, track) in enumerate(zip(page.subjects, tracks, strict=False))
    )
    words = f"Map of {esc(page.title)}, north is up; vehicles: {len(page.subjects)}, zones: {len(near)}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" role="img" aria-label="{words}"><rect width="{width:.0f}" height="{height:.0f}" '
        f'fill="#f4f4f0"/>{"".join(map(zone_svg, near))}{lines}</svg>'
    )


def _meets(zone: Zone, low: Floats, high: Floats) -> bool:
    west, south, east, north = zone.bounds
    return bool(west < high[0] and east > low[0] and south < high[1] and north > low[1])
