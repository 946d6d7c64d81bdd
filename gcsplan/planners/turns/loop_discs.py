"""Loops of arc paths: free discs beside pins that are too close to their neighbours for turns of this radius.

The arc of a pinned disc passes its pin in the middle. Between pins less than some 1.4 radii apart, or between a pin and
an end that lies in its disc, there is no such arc path. With a free disc between them, which is flown around in a loop,
there is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from gcsplan.planners.turns.arc_path import ArcPath, inserted, lacking_m, missed_m

WAYS, RUNS = 12, (0.0, 0.75, 2.0, 4.0)
"""Headings at which a loop leaves its pin or arrives there, and how far from it, in turn radii."""

RUNS_AT_ENDS = (2.0, 4.0)
"""Likewise at start and goal, where a turn from another heading or to another one may have to fit."""

SPARE_M = 1e-6
"""Metres that turns to different sides must leave between them: discs that just touch may overlap by rounding."""


def with_loops(arc_path: ArcPath) -> ArcPath:
    """``arc_path`` with free discs beside pins where legs are too short; the same if there are none, or none helps."""
    for _ in range(len(arc_path.sense) + 1 if arc_path.pinned.any() else 0):
        short = _short_legs(arc_path)
        for leg in short:
            found = min(_loops(arc_path, leg), key=_badness, default=arc_path)
            if _badness(found)[0] < len(short):
                arc_path = found
                break
        else:
            return arc_path
    return arc_path


def _short_legs(arc_path: ArcPath) -> list[int]:
    """Legs that are too short; if there are none, those at a pinned disc whose arc does not reach its pin; in order."""
    bad = lacking_m(arc_path) > -SPARE_M
    if not bad.any():
        missed = np.concatenate([[0.0], missed_m(arc_path), [0.0]])
        bad = (missed[:-1] > 0.0) | (missed[1:] > 0.0)
    return [int(k) for k in np.flatnonzero(bad)]


def _badness(arc_path: ArcPath) -> tuple[int, float]:
    """The number of legs that are too short, and the length of the path, m."""
    way = np.vstack([arc_path.ends[:1], arc_path.centre, arc_path.ends[1:]])
    side = np.concatenate([[0.0], arc_path.sense, [0.0]])
    apart = np.hypot(*np.diff(way, axis=0).T)
    legs = np.sqrt(np.maximum(apart**2 - (np.diff(side) * arc_path.radius_m) ** 2, 0.0))
    return len(_short_legs(arc_path)), float(legs.sum() + arc_path.radius_m * np.abs(arc_path.turn).sum())


def _loops(arc_path: ArcPath, leg: int) -> Iterator[ArcPath]:
    """Yield ``arc_path`` with one free disc more on a leg, on either side, near the beginning or the end of the leg."""
    places = np.where(arc_path.pinned[:, None], arc_path.pin, arc_path.centre)
    stops = np.vstack([arc_path.ends[:1], places, arc_path.ends[1:]])
    for place, on in ((stops[leg], 1.0), (stops[leg + 1], -1.0)):
        for way in range(WAYS):
            heading = 2.0 * math.pi * way / WAYS
            for run in RUNS if 0 < leg + (on < 0.0) < len(stops) - 1 else RUNS_AT_ENDS:
                away = on * run * arc_path.radius_m * np.array([math.cos(heading), math.sin(heading)])
                for sense in (1.0, -1.0):
                    yield inserted(arc_path, leg, place + away, heading, sense)
