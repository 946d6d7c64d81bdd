"""The replay: where every vehicle is at a time of the time table, planned and (after a rehearsal) flown.

The page's script interpolates between few places. They are chosen so that it is nowhere farther from the motion than a
stated distance, and so that the page stays small however many vehicles fly for however long.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.report.parts.html import at_least, esc, table
from gcsplan.report.parts.page_data import Page
from gcsplan.report.views.plan import COLOURS
from gcsplan.world.geometry.surface import Surface

MOST_PLACES = 20_000
"""Places of all vehicles together, planned and flown: at 20 bytes each, about 0.5 MB of the page."""
FINE_M = 0.2
"""Error at which no more places are added, in space and in height above ground."""
MOST_LOOKED, MOST_MOMENTS = 6_000, 120_000
"""Moments of one motion, and of all together, among which the places are chosen."""
SPEEDS = (1, 2, 5, 10, 20, 30, 60)
WATCH_S = 90.0
"""The speed at first is the lowest with which the replay is over after this time."""


@dataclass(frozen=True, eq=False)
class Thinned:
    """One motion, thinned: ``places`` (N, 5) are time, east, north, AMSL, height above ground and what stands on it.

    ``subject`` is its number on the page, ``flown`` False for the planned one. ``leaves``: it is gone after its end.
    """

    subject: int
    flown: bool
    motion: TimedPath
    leaves: bool
    places: Floats


@dataclass(frozen=True, eq=False)
class Replay:
    """All motions of a page; ``within_m`` bounds their error in place and height above ground."""

    tracks: tuple[Thinned, ...]
    within_m: float
    closest_s: float | None

    @property
    def end_s(self) -> float:
        """The last moment at which something moves, s."""
        return max(t.motion.end_s for t in self.tracks)


def replay_of(page: Page, *, most: int = MOST_PLACES) -> Replay | None:
    """The thinned motions of a page's subjects; None if it has no motions (checked files)."""
    found = [
        (i, flown, motion)
        for i, s in enumerate(page.subjects)
        for flown, motion in ((False, s.motion), (True, s.flown))
        if motion is not None
    ]
    if not found:
        return None
    least = page.separation.least if page.separation is not None else None
    surface = page.world.airspace.surface
    moments = min(MOST_LOOKED, MOST_MOMENTS // len(found))
    looked = [
        _looked_at(m, surface, moments, () if least is None or flown or m.name not in least.vehicles else least.times_s)
        for _, flown, m in found
    ]
    kept, error_m = thin([places for places, _ in looked], [always for _, always in looked], most)
    tracks = tuple(
        Thinned(i, flown, m, page.subjects[i].leaves, places[rows])
        for (i, flown, m), (places, _), rows in zip(found, looked, kept, strict=True)
    )
    return Replay(tracks, max([error_m, *map(_off_m, tracks)]), None if least is None else least.time_s)


def _looked_at(motion: TimedPath, surface: Surface, moments: int, more: Sequence[float]) -> tuple[Floats, Indices]:
    """(M, 5) places of a motion, and those of them that are always kept: ends, arrival and the times ``more``.

    About ``moments`` places: of the motion's own times as many as half of them, and evenly spaced ones, for the ground.
    """
    own = motion.times_s[:: math.ceil(len(motion.times_s) / max(moments // 2, 2))]
    span = np.linspace(motion.begin_s, motion.end_s, max(moments - len(own), 2))
    inside = [t for t in (motion.arrive_s, *more) if motion.begin_s <= t <= motion.end_s]
    always = np.array([motion.begin_s, *inside, motion.end_s])
    times = np.unique(np.concatenate([own, span, always]))
    at = motion.at(times)
    agl = at[:, 2] - surface.top_at(at[:, 0], at[:, 1])
    return np.column_stack([times, at, agl]), np.unique(np.searchsorted(times, always)).astype(np.intp)


def thin(tracks: Sequence[Floats], always: Sequence[Indices], most: int) -> tuple[list[Indices], float]:
    """Rows of each of ``tracks`` (M, 5) that are kept, and the largest error of linear interpolation between them.

    The row with the largest error of all is added until the error is at most `FINE_M`, or there are ``most`` rows.
    ``always`` are kept in any case. The error is the larger one of place and height above ground, where that is known.
    """
    kept = [set(rows.tolist()) for rows in always]
    heap = [
        (-error, track, a, b, worst)
        for track, rows in enumerate(always)
        for a, b in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True)
        for error, worst in (_worst(tracks[track], a, b),)
    ]
    heapify(heap)
    count = sum(map(len, kept))
    while heap and count < most and -heap[0][0] > FINE_M:
        _, track, a, b, middle = heappop(heap)
        kept[track].add(middle)
        count += 1
        for first, last in ((a, middle), (middle, b)):
            error, worst = _worst(tracks[track], first, last)
            heappush(heap, (-error, track, first, last, worst))
    return [np.array(sorted(rows), dtype=np.intp) for rows in kept], -heap[0][0] if heap else 0.0


def _worst(places: Floats, first: int, last: int) -> tuple[float, int]:
    """The largest error of interpolation between two rows, and its row."""
    if last - first < 2:
        return 0.0, first
    ends, inner = places[[first, last]], places[first + 1 : last]
    part = ((inner[:, 0] - ends[0, 0]) / (ends[1, 0] - ends[0, 0]))[:, None]
    off = np.abs(inner[:, 1:] - ends[0, 1:] - part * (ends[1, 1:] - ends[0, 1:]))
    error = np.maximum(np.sqrt((off[:, :3] ** 2).sum(axis=1)), np.nan_to_num(off[:, 3]))
    worst = int(error.argmax())
    return float(error[worst]), first + 1 + worst


def _off_m(track: Thinned) -> float:
    """The largest error of place at the motion's own times, of which only a part was looked at if there are many."""
    own = track.motion
    drawn = np.column_stack([np.interp(own.times_s, track.places[:, 0], track.places[:, k]) for k in (1, 2, 3)])
    return float(np.linalg.norm(drawn - own.points, axis=1).max())


def replay_data(replay: Replay, page: Page) -> dict[str, object]:
    """The replay for the page's script: places as 32-bit floats, five in a row."""
    return {
        "end": math.ceil(replay.end_s), "closest": replay.closest_s,
        "tracks": [
            {
                "k": t.subject, "name": page.subjects[t.subject].name, "flown": t.flown, "leaves": t.leaves,
                "stays": t.motion.ends_in_air,
                "places": base64.b64encode(t.places.astype("<f4").tobytes()).decode("ascii"),
            }
            for t in replay.tracks
        ],
    }  # fmt: skip


def replay_html(replay: Replay, page: Page) -> str:
    """The controls and the table, hidden until the page's script runs them."""
    both, several = any(t.flown for t in replay.tracks), len(page.subjects) > 1
    first = next((s for s in SPEEDS if replay.end_s <= s * WATCH_S), SPEEDS[-1])
    speeds = "".join(
        f'<option value="{s}"{" selected" if s == first else ""}>{s}×</option>' for s in SPEEDS
    )  # fmt: skip
    near = '<button type="button" data-do="closest">closest approach</button>' if replay.closest_s is not None else ""
    rows = [
        (
            f'<i class="swatch t{t.subject % COLOURS}"></i>{esc(page.subjects[t.subject].name)}'
            + (f" {'flown' if t.flown else 'planned'}" if both else ""),
            *[""] * (3 + several + both),
        )
        for t in replay.tracks
    ]
    head = [
        "vehicle|",
        "is|",
        "AMSL",
        "above ground",
        *(["nearest other in the air|"] * several),
        *(["away from the plan"] * both),
    ]
    within = at_least(replay.within_m, 1, page.units.distance)
    note = f"Between stored places the replay is within {within} of the time table"
    if both:
        note += " and of the flight. Planned vehicles are rings, flown ones dots; the dashed line is the flight"
    exact = " Least separations are exact under “The fleet in time”." if several else ""
    return (
        '<div class="replay" id="replay" role="group" aria-label="Replay" hidden>'
        '<button type="button" data-do="play" aria-label="play">▶</button>'
        '<label>time <input type="range" min="0" max="0" step="1" value="0"></label>'
        '<output aria-live="off">T+0:00:00</output>'
        f"<label>speed <select>{speeds}</select></label>{near}"
        f"<details><summary>Every vehicle at this time</summary>{table('At the time above', head, rows)}</details>"
        f'<p class="note">{note}.{exact}</p></div>'
    )
