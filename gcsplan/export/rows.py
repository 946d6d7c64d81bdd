"""The data for the writers: a row per item, a track per vehicle, and the outline of a zone in degrees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Circle, KeepIn, Level, Zone

HEIGHT_DECIMALS = 2
"""Decimals of heights on a map, in metres."""

OUTLINE_CORNERS = 72
OUTLINE_MARGIN_M = 0.02
"""Metres that a circle's outline stays outside the circle, to contain it after rounding to 1e-7 degrees (11 mm)."""


@dataclass(frozen=True, slots=True)
class ItemRow:
    """One mission item in numbers; None or NaN if there is none (a command without a place, unknown ground).

    ``time_s``: in still air; ``earliest_s``, ``latest_s``: in the declared winds.
    """

    vehicle: str
    seq: int
    command: str
    lat_deg: float | None = None
    lon_deg: float | None = None
    amsl_m: float | None = None
    agl_m: float | None = None
    min_agl_on_leg_m: float | None = None
    leg_m: float | None = None
    climb_deg: float | None = None
    energy_j: float | None = None
    cumulative_energy_j: float | None = None
    time_s: float | None = None
    earliest_s: float | None = None
    latest_s: float | None = None


@dataclass(frozen=True, slots=True)
class WayPoint:
    """A point of a track that an item ends at: its name, wire number, command, and heights.

    ``number`` and ``command`` are None for a home that is no item. ``agl_m`` is NaN over unknown ground. ``geoid_m`` is
    the geoid's height above the ellipsoid there, None if no geoid grid is known. ``time_s``: when its item is done,
    with its hold, seconds from the common start; None if that is not known.
    """

    name: str
    number: int | None
    command: str | None
    agl_m: float
    geoid_m: float | None = None
    time_s: float | None = None


@dataclass(frozen=True, eq=False)
class FlownTrack:
    """The line that one vehicle flies: (N,) degrees and AMSL metres, N >= 2, straight between neighbours.

    ``waypoints`` (N,) has the figures of the points that an item ends at, None for the others. ``reached_s``,
    ``left_s`` (N,): when the vehicle comes to each point and when it goes on, seconds from the common start; None if
    that is not known. ``description``: what a viewer says of it.
    """

    vehicle: str
    lat_deg: Floats
    lon_deg: Floats
    amsl_m: Floats
    waypoints: tuple[WayPoint | None, ...] = field(default=())
    reached_s: Floats | None = None
    left_s: Floats | None = None
    description: str = ""

    def __post_init__(self) -> None:
        columns = [np.asarray(getattr(self, name), float) for name in ("lat_deg", "lon_deg", "amsl_m")]
        shapes = {c.shape for c in columns}
        if len(shapes) != 1 or columns[0].ndim != 1 or len(columns[0]) < 2:
            raise ValueError(f"a track has at least two points in columns of equal length, given shapes {shapes}")
        if not all(np.isfinite(c).all() for c in columns):
            raise ValueError(f"the track of {self.vehicle} is not finite")
        if self.waypoints and len(self.waypoints) != len(columns[0]):
            raise ValueError(f"{len(columns[0])} points need as many way points, given {len(self.waypoints)}")
        for name, column in zip(("lat_deg", "lon_deg", "amsl_m"), columns, strict=True):
            object.__setattr__(self, name, column)


def outlines_deg(zones: Sequence[Zone], frame: Frame) -> list[Floats]:
    """For each of the zones (N, 2) latitude, longitude of its corners, counter-clockwise, not closed.

    A circle becomes a polygon of `OUTLINE_CORNERS` corners that contains all of it.
    """
    turn = 2.0 * np.pi * np.arange(OUTLINE_CORNERS) / OUTLINE_CORNERS
    east, north = np.cos(turn), np.sin(turn)
    rings = []
    for zone in zones:
        shape = zone.shape
        if isinstance(shape, Circle):
            reach = (shape.radius_m + OUTLINE_MARGIN_M) / math.cos(math.pi / OUTLINE_CORNERS)
            rings.append(np.stack([shape.east_m + reach * east, shape.north_m + reach * north], axis=-1))
        else:
            rings.append(shape.vertices)
    if not rings:
        return []
    corners = np.concatenate(rings)  # one call for all: each has a cost of its own
    return np.split(frame.to_degrees(corners[:, 0], corners[:, 1]), np.cumsum([len(r) for r in rings])[:-1])


def areas_deg(areas: Sequence[KeepIn], frame: Frame) -> list[tuple[KeepIn, list[Floats]]]:
    """Each part of each keep-in area: its outline, then its holes, (N, 2) latitude, longitude, not closed."""
    return [
        (area, [frame.to_degrees(*ring.T) for ring in (part.outline, *part.holes)])
        for area in areas
        for part in area.parts
    ]


def extent_words(zone: Zone | KeepIn) -> str:
    """The range of heights of a zone, in words."""

    def words(level: Level | None, none: str) -> str:
        return none if level is None else str(level)

    return f"from {words(zone.floor, 'the ground')} to {words(zone.ceiling, 'unlimited height')}"
