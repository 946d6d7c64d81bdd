"""The page of a batch: how many missions there are and how they ended, a map of all tracks, a table that filters."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.report.parts.html import THIN, document, energy, esc, greatest, least, num
from gcsplan.report.views.shaded_terrain import GroundPatch, picture_of
from gcsplan.units import Units, duration

MissionRow = Mapping[str, Any]
METRES_PER_DEGREE = 111_195.0
"""Length of a degree of a great circle, m."""
WIDE = 1000.0
"""Width of the map's own coordinates."""
PIXELS, LEAST_PIXELS = 600, 8
"""Pixels along the longer side of the terrain's picture; a mission on fewer than so many has no terrain there."""


def render_index(
    title: str, rows: Sequence[MissionRow], tracks: Mapping[int, Sequence[Sequence[float]]],
    grounds: Sequence[GroundPatch], units: Units, page: str,
) -> str:  # fmt: skip
    """The page; ``tracks`` are the row's number to its [latitude, longitude], ``page`` is a mission's file to open.

    ``grounds`` is the ground under the missions.

    A row has the columns of the table of results; one without a vehicle is a mission that has no plan.
    """
    missions = {row["mission"] for row in rows}
    bad = Counter(str(row["verdict"]) for row in rows if row["code"] != 0)
    words = f"{num(len(missions))} missions, {num(sum(r['code'] == 0 for r in rows))} vehicles planned"
    if bad:
        words += "; " + ", ".join(f"{num(n)} {esc(kind)}" for kind, n in sorted(bad.items()))
    body = (
        f'<header><p class="brand">gcsplan · batch</p><h1>{esc(title)}</h1><p>{words}.</p></header>'
        f"<main>{_failures(rows)}{_map(rows, tracks, grounds, units)}"
        '<label class="filter" hidden>Filter '
        '<input id="filter" type="search" placeholder="a name, a verdict, a reason">'
        '<span id="count" class="note"></span></label>'
        f"{_table(rows, units, page)}</main>"
    )
    return document(title, body, "", scripts=("index.js",), styles=("report.css", "index.css"), what="batch")


def _failures(rows: Sequence[MissionRow]) -> str:
    bad = [row for row in rows if row["code"] != 0]
    if not bad:
        return ""
    names = [f"{r['mission']} {r['vehicle']}".rstrip() for r in bad]
    items = [
        f"<li><b>{esc(name)}</b>: {esc(r['verdict'])}: {esc(r['message'])}</li>"
        for name, r in zip(names, bad, strict=True)
    ]
    return f'<h2>Without a plan</h2><ul class="findings">{"".join(items)}</ul>'


def _map(
    rows: Sequence[MissionRow], tracks: Mapping[int, Sequence[Sequence[float]]], grounds: Sequence[GroundPatch],
    units: Units,
) -> str:  # fmt: skip
    """All tracks, north up, each degree of longitude as short as it is in the middle; nothing without a track."""
    if not tracks:
        return ""
    lats = [p[0] for track in tracks.values() for p in track]
    west = next(iter(tracks.values()))[0][1]
    # Longitudes count from the first track, so that a batch across 180 degrees is drawn in one piece.
    lons = [_turned(p[1], west) for track in tracks.values() for p in track]
    shrink = max(0.05, math.cos(math.radians(0.5 * (min(lats) + max(lats)))))
    span = max((max(lons) - min(lons)) * shrink, max(lats) - min(lats), 1e-4)
    scale, edge = WIDE / span, 0.03 * WIDE
    high = (max(lats) - min(lats)) * scale
    parts = []
    for number, track in tracks.items():
        places = [
            f"{(_turned(lon, west) - min(lons)) * shrink * scale:.1f} {(max(lats) - lat) * scale:.1f}"
            for lat, lon in track
        ]
        name = f"{rows[number]['mission']} {rows[number]['vehicle']}"
        parts.append(f'<path data-row="{number}" d="M{"L".join(places)}"><title>{esc(name)}</title></path>')
    wide = (max(lons) - min(lons)) * shrink * scale
    sides = wide + 2 * edge, high + 2 * edge
    box = f"{-edge:.0f} {-edge:.0f} {sides[0]:.0f} {sides[1]:.0f}"
    per_lon, per_lat = shrink * scale, scale
    corner = max(lats) + edge / per_lat, west + min(lons) - edge / per_lon
    picture, words = _terrain(grounds, corner, (sides[1] / per_lat, sides[0] / per_lon), shrink, units)
    image = f'<image href="{picture}" x="{-edge:.0f}" y="{-edge:.0f}" width="{sides[0]:.0f}" height="{sides[1]:.0f}" '
    image = f'{image}preserveAspectRatio="none"/>' if picture else ""
    return (
        f'<svg id="tracks" viewBox="{box}" role="img" aria-label="all tracks, north up">{image}{"".join(parts)}</svg>'
        f'<p class="note">North is up; the map is {num(wide / scale * METRES_PER_DEGREE, 1, units.far)} wide. '
        f"{words}</p>"
    )


def _terrain(
    grounds: Sequence[GroundPatch], corner: tuple[float, float], size: tuple[float, float], shrink: float, units: Units
) -> tuple[str, str]:  # fmt: skip
    """The ground under the missions as one picture, and words on it; no picture if the missions are too small on it.

    ``corner``: latitude and longitude of the picture's north-west corner; ``size``: its height and width, degrees.
    """
    if not grounds:
        return "", ""
    per_px = max(size[0], size[1] * shrink) / PIXELS
    rows, cols = (max(round(n / per_px), 2) for n in (size[0], size[1] * shrink))
    half_lat, half_lon = 0.5 * size[0] / rows, 0.5 * size[1] / cols
    lat: Floats = np.linspace(corner[0] - half_lat, corner[0] - size[0] + half_lat, rows)
    lon: Floats = np.linspace(half_lon, size[1] - half_lon, cols)
    ground = np.full((rows, cols), np.nan)
    for one in grounds:
        south, west, north, east = one.box_deg
        if min(north - south, (east - west) * shrink) < LEAST_PIXELS * per_px:
            continue
        begin = _turned(west, corner[1])
        own_lat = slice(*np.searchsorted(-lat, (-north, -south)))
        own_lon = slice(*np.searchsorted(lon, (begin, begin + east - west)))
        found = one.at(lat[own_lat], west - begin + lon[own_lon])
        ground[own_lat, own_lon] = np.where(np.isnan(found), ground[own_lat, own_lon], found)
    if np.isnan(ground).all():
        apart = num(per_px * PIXELS * METRES_PER_DEGREE, 0, units.far)
        return "", f"Terrain is not drawn: the missions lie up to {apart} apart, and each is too small on this map."
    low, high = float(np.nanmin(ground)), float(np.nanmax(ground))
    east_m: Floats = lon * (shrink * METRES_PER_DEGREE)
    north_m: Floats = lat * METRES_PER_DEGREE
    words = "The ground around the missions is drawn coarsely and smoothed: read no heights off it."
    return picture_of(ground, east_m, north_m, low, high, clear=True), words


def _turned(lon_deg: float, from_deg: float) -> float:
    return (lon_deg - from_deg + 180.0) % 360.0 - 180.0


def _table(rows: Sequence[MissionRow], units: Units, page: str) -> str:
    head = (
        ("mission", ""), ("vehicle", ""), ("verdict", ""), ("length", "n"), ("gap", "n"), ("energy", "n"),
        ("lowest AGL", "n"), ("highest AGL", "n"), ("arrives, T+", "n"),
    )  # fmt: skip
    out = ['<div class="scroll"><table id="results"><caption>Every vehicle of every mission</caption><thead><tr>']
    out += [f'<th scope="col" class="{kind}">{name}</th>' for name, kind in head]
    out.append("</tr></thead><tbody>")
    for number, row in enumerate(rows):
        if row["code"] != 0:
            continue
        link = f'<a href="{_address(str(row["mission"]))}/{page}">{esc(row["mission"])}</a>'
        cells = [
            f'<th scope="row">{link}</th>',
            f"<td>{esc(row['vehicle'])}</td>",
            f'<td class="{_colour(row)}">{esc(row["verdict"])}</td>',
            f'<td class="n">{num(row.get("length_m"), 2, units.path)}</td>',
            f'<td class="n">{_percent(row.get("gap_percent"))}</td>',
            f'<td class="n">{energy(row.get("energy_j"))}</td>',
            f'<td class="n">{least(row.get("min_agl_m"), 1, units.height)}</td>',
            f'<td class="n">{greatest(row.get("max_agl_m"), 1, units.height)}</td>',
            f'<td class="n">{_arrival(row.get("arrive_s"))}</td>',
        ]
        out.append(f'<tr data-row="{number}">{"".join(cells)}</tr>')
    out.append("</tbody></table></div>")
    return "".join(out)


def _colour(row: MissionRow) -> str:
    """The class of a verdict: good if the path is safe and no return was found unsafe."""
    return "good" if row.get("safe") is True and row.get("return_safe") is not False else "bad"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}{THIN}%"


def _arrival(seconds: float | None) -> str:
    return "–" if seconds is None or not math.isfinite(seconds) else duration(seconds)


def _address(name: str) -> str:
    """The relative address of a folder, with the characters escaped that an address cannot have."""
    return PurePosixPath("/", name).as_uri().removeprefix("file:///")
