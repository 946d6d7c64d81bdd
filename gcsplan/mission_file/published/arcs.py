"""Arcs and large circles around a place, and the outlines that have them.

They become polygons that are nowhere smaller (`outline`). An arc that bulges out of its zone is drawn around the
circle, one that bulges into it is drawn inside the circle. So the polygon contains the zone, and reaches beyond it by
some metres, or by less than a thousandth of a radius of more than 100 km.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from gcsplan.errors import InputError
from gcsplan.world.geodesy.degree_shapes import Corner
from gcsplan.world.geodesy.frame import EARTH_RADIUS_M, Frame

MOST_ARC_M = 1_000_000.0
"""Largest radius of an arc or circle, m."""

NEAREST_POLE_DEG = 1.0
"""A circle that reaches nearer to a pole than this, degrees, has no outline in longitudes."""

STRETCHED = 1e-6
"""A circle is drawn larger by at least this part of its radius."""

ARC_SAGITTA_M = 3.0
WIDEST_STEP = math.radians(10.0)

UNEVEN_M, UNEVEN_PART = 1000.0, 0.1
"""Ends of one arc may lie this much nearer to its centre than each other, m or part of the radius: files round them."""


class ArcError(ValueError):
    """The arc cannot be drawn; the text says why."""


@dataclass(frozen=True, slots=True)
class Arc:
    """An arc around ``centre``: bearings from true north, radians, the second reached from the first in its direction.

    ``ends`` are the corners that it joins, if the file gives them; the radii are at its two ends, m.
    """

    centre: Corner
    start: float
    sweep: float
    radii_m: tuple[float, float]
    ends: tuple[Corner, Corner] | None = None

    @classmethod
    def by_bearings(cls, centre: Corner, radius_m: float, start_deg: float, end_deg: float, clockwise: bool) -> Arc:
        """An arc of OpenAir's DA record. Raises ArcError."""
        if not 0.0 < radius_m <= MOST_ARC_M:
            raise ArcError(f"its radius must be above 0 and at most {MOST_ARC_M:g} m, given {radius_m:g} m")
        if not (abs(start_deg) <= 720.0 and abs(end_deg) <= 720.0):
            raise ArcError("its angles must be bearings in degrees")
        _frame(centre)
        sweep = _sweep(math.radians(start_deg), math.radians(end_deg), clockwise)
        return cls(centre, math.radians(start_deg), sweep, (radius_m, radius_m))

    @classmethod
    def by_ends(cls, centre: Corner, first: Corner, last: Corner, clockwise: bool) -> Arc:
        """An arc of OpenAir's DB record. Raises ArcError."""
        frame = _frame(centre)
        (e0, n0), (e1, n1) = frame.to_plane(*first), frame.to_plane(*last)
        radii = math.hypot(e0, n0), math.hypot(e1, n1)
        if not (all(math.isfinite(r) for r in radii) and 0.0 < min(radii) <= max(radii) <= MOST_ARC_M):
            words = f"its ends must lie within {MOST_ARC_M:g} m of its centre"
            raise ArcError(f"{words}, given {radii[0]:.0f} m and {radii[1]:.0f} m")
        if abs(radii[0] - radii[1]) > max(UNEVEN_M, UNEVEN_PART * max(radii)):
            raise ArcError(f"its ends lie {radii[0]:.0f} m and {radii[1]:.0f} m from its centre: that is no circle")
        start, end = math.atan2(e0, n0), math.atan2(e1, n1)
        return cls(centre, start, _sweep(start, end, clockwise), (radii[0], radii[1]), (first, last))

    @classmethod
    def circle(cls, centre: Corner, radius_m: float) -> Arc:
        """A whole circle. Raises ArcError."""
        whole = cls.by_bearings(centre, radius_m, 0.0, 0.0, clockwise=True)
        if abs(centre[0]) + math.degrees(radius_m / EARTH_RADIUS_M) > 90.0 - NEAREST_POLE_DEG:
            raise ArcError(f"its radius of {radius_m:g} m reaches a pole; draw a polygon")
        return whole

    @property
    def pieces(self) -> int:
        """How many straight pieces the arc is drawn with; it has up to four corners more."""
        step = min(WIDEST_STEP, 2.0 * math.acos(1.0 - min(ARC_SAGITTA_M / max(self.radii_m), 0.5)))
        return max(1, math.ceil(abs(self.sweep) / step))

    def _bow_m(self, part: float) -> float:
        """How far a piece of ``part`` radians, straight in degrees, may lie from the line straight in the plane, m."""
        highest = min(abs(self.centre[0]) + math.degrees(max(self.radii_m) / EARTH_RADIUS_M), 89.0)
        return 1.1 * (max(self.radii_m) * part) ** 2 * math.tan(math.radians(highest)) / (8.0 * EARTH_RADIUS_M)

    def corners(self, outward: bool | None) -> list[Corner]:
        """The arc's corners: around the circle if it bulges ``outward``, inside it if not, on it if that is unknown."""
        count = self.pieces
        part = self.sweep / count
        bow_m = self._bow_m(part)
        least, most = min(self.radii_m) - bow_m, max(self.radii_m) + bow_m
        if outward:  # tangents: their corners lie over the middle of each piece
            radius = most / math.cos(0.5 * part)
            places = [(self.start, most), *((self.start + (i + 0.5) * part, radius) for i in range(count))]
            places.append((self.start + self.sweep, most))
            # the plane stretches distances to the east, by (r/R)²/6
            stretch = [(1.0 + STRETCHED + 0.2 * (r * math.sin(b) / EARTH_RADIUS_M) ** 2) for b, r in places]
            places = [(b, r * more) for (b, r), more in zip(places, stretch, strict=True)]
        else:
            radius = least if outward is not None else max(self.radii_m)
            places = [(self.start + i * part, radius) for i in range(count + 1)]
        frame = _frame(self.centre)
        at = frame.to_degrees([r * math.sin(b) for b, r in places], [r * math.cos(b) for b, r in places])
        centre_lon = self.centre[1]  # beyond the antimeridian, if that is where the circle goes
        corners = [(float(lat), centre_lon + ((float(lon) - centre_lon + 180.0) % 360.0 - 180.0)) for lat, lon in at]
        return corners if self.ends is None else [self.ends[0], *corners, self.ends[1]]


def corners_of(pieces: Sequence[Corner | Arc]) -> int:
    """How many corners the outline of points and arcs has, before it is drawn; no more than it has."""
    return sum(p.pieces if isinstance(p, Arc) else 1 for p in pieces)


def outline(pieces: Sequence[Corner | Arc]) -> list[Corner]:
    """The corners of an outline of points and arcs, in the order of the file."""
    arcs = [p for p in pieces if isinstance(p, Arc)]
    if not arcs:
        return [p for p in pieces if not isinstance(p, Arc)]
    clockwise = _is_clockwise(_drawn(pieces, None))
    return _drawn(pieces, clockwise)


def _drawn(pieces: Sequence[Corner | Arc], clockwise: bool | None) -> list[Corner]:
    ring: list[Corner] = []
    for piece in pieces:
        if isinstance(piece, Arc):
            ring += piece.corners(None if clockwise is None else (piece.sweep > 0.0) == clockwise)
        else:
            ring.append(piece)
    return ring


def _is_clockwise(ring: Sequence[Corner]) -> bool:
    """Each edge goes the short way: a file may write 179 and -179 side by side."""
    points = [(lon, lat) for lat, lon in ring[:1]]
    for lat, lon in ring[1:]:
        before = points[-1][0]
        points.append((before + (lon - before + 180.0) % 360.0 - 180.0, lat))
    area = sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(points, [*points[1:], points[0]], strict=True))
    return area < 0.0


def _sweep(start: float, end: float, clockwise: bool) -> float:
    """The turn from ``start`` to ``end``, positive if clockwise; a whole turn if both are the same bearing."""
    turn = (end - start) % (2.0 * math.pi) if clockwise else -((start - end) % (2.0 * math.pi))
    return turn or (2.0 * math.pi if clockwise else -2.0 * math.pi)


@lru_cache(maxsize=64)  # a file draws several arcs around one place
def _frame(centre: Corner) -> Frame:
    try:
        return Frame(*centre)
    except InputError:
        raise ArcError(f"its centre {centre[0]:g}, {centre[1]:g} lies too near to a pole") from None
