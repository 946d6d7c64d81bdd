"""Zones: cylinders and prisms with a floor and a ceiling, in the metres of the plane; and keep-in areas.

A zone is no-fly, or a part of what lies outside of all keep-in areas (`gcsplan.world.geometry.outside`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from gcsplan.arrays import Floats

if TYPE_CHECKING:
    import shapely

NAMED = 4
"""Most keep-in areas that one message names."""

Box = tuple[float, float, float, float]
"""A part of the plane: west, south, east, north, m; infinite: everywhere."""


@dataclass(frozen=True, slots=True)
class Level:
    """A height above mean sea level, or one that follows the ground point by point."""

    value_m: float
    datum: Literal["amsl", "agl"]

    def __str__(self) -> str:
        return f"{self.value_m:g} m {self.datum.upper()}"


@dataclass(frozen=True, slots=True)
class Circle:
    """A disc in the plane."""

    east_m: float
    north_m: float
    radius_m: float


@dataclass(frozen=True, eq=False)
class Polygon:
    """A simple polygon in the plane: ``vertices`` (N, 2) east_m, north_m; not closed; counter-clockwise.

    Holes are not kept: a hole in a no-fly polygon counts as no-fly.
    """

    vertices: Floats

    @cached_property
    def bounds(self) -> Box:
        """West, south, east, north, metres."""
        (west, south), (east, north) = self.vertices.min(axis=0).tolist(), self.vertices.max(axis=0).tolist()
        return west, south, east, north


@dataclass(frozen=True, eq=False)
class AreaPart:
    """A part of a keep-in area: its outline and its holes, (N, 2) east_m, north_m each, not closed."""

    outline: Floats
    holes: tuple[Floats, ...] = ()

    def shape(self) -> shapely.Polygon:
        """The same as shapely has it."""
        import shapely  # most missions have no keep-in areas

        return shapely.Polygon(self.outline, self.holes)


@dataclass(frozen=True, eq=False)
class KeepIn:
    """An area, from ``floor`` to ``ceiling`` (None: without end); flights stay in the union of all areas.

    ``parts`` are those near the frame's origin: none if it is far away.
    """

    name: str
    parts: tuple[AreaPart, ...]
    floor: Level | None = None
    ceiling: Level | None = None

    @property
    def label(self) -> str:
        """Kind and name, as reports write them."""
        return f"keep-in area {self.name}"

    @property
    def bounds(self) -> Box:
        """West, south, east, north of all parts, metres; an infinite one without a part."""
        if not self.parts:
            return math.inf, math.inf, math.inf, math.inf
        corners = np.concatenate([part.outline for part in self.parts])
        (west, south), (east, north) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        return west, south, east, north

    def distance_m(self, east_m: float, north_m: float) -> float:
        """Horizontal distance of a place from the area, 0 inside; inf if the area is far away."""
        import shapely

        place = shapely.Point(east_m, north_m)
        return min((float(part.shape().distance(place)) for part in self.parts), default=math.inf)


@dataclass(frozen=True, eq=False)
class Outside:
    """A part of the plane outside of keep-in areas at some heights: ``edges`` (E, 2, 2) are its whole border."""

    areas: tuple[KeepIn, ...]
    edges: Floats

    @property
    def name(self) -> str:
        """The areas by their names, for messages."""
        names = [repr(a.name) for a in self.areas]
        shown = names if len(names) <= NAMED else [*names[: NAMED - 1], f"{len(names) - NAMED + 1} more"]
        words = f"{', '.join(shown[:-1])} and {shown[-1]}" if len(shown) > 1 else shown[0]
        return f"outside of {words}"

    def nearest(self, east_m: float, north_m: float) -> str:
        """The name of the area that is nearest to a place."""
        return min(self.areas, key=lambda a: a.distance_m(east_m, north_m)).name


@dataclass(frozen=True, eq=False)
class Zone:
    """A closed shape whose open inside, between ``floor`` and ``ceiling``, may not be flown.

    ``floor`` None reaches down without end, ``ceiling`` None up without end.
    """

    name: str
    shape: Circle | Polygon
    floor: Level | None = None
    ceiling: Level | None = None
    outside: Outside | None = None
    """The outside of keep-in areas that it is a part of; None: it is a no-fly zone."""

    @property
    def follows_ground(self) -> bool:
        """Whether the floor or the ceiling is above ground (AGL)."""
        return any(level is not None and level.datum == "agl" for level in (self.floor, self.ceiling))

    @property
    def bounds(self) -> Box:
        """West, south, east, north of the shape, metres."""
        s = self.shape
        if isinstance(s, Circle):
            return (s.east_m - s.radius_m, s.north_m - s.radius_m, s.east_m + s.radius_m, s.north_m + s.radius_m)
        return s.bounds

    def name_at(self, east_m: float, north_m: float) -> str:
        """The name of what is near a place: the zone's own, or that of the nearest area outside of which it lies."""
        return self.name if self.outside is None else self.outside.nearest(east_m, north_m)

    @property
    def edges(self) -> Floats:
        """(E, 2, 2) the border of a polygon, or of the whole outside that it is a part of."""
        if self.outside is not None:
            return self.outside.edges
        assert isinstance(self.shape, Polygon)
        return np.stack([self.shape.vertices, np.roll(self.shape.vertices, -1, axis=0)], axis=1)

    @property
    def label(self) -> str:
        """Kind and name, as reports write them."""
        return f"no-fly zone {self.name}" if self.outside is None else self.name

    @property
    def title(self) -> str:
        """What the user calls it: a no-fly zone, or keep-in areas."""
        if self.outside is None:
            return f"no-fly zone {self.name!r}"
        return f"keep-in area{'s' * (len(self.outside.areas) > 1)} {self.name.removeprefix('outside of ')}"


def keep_in_of(zones: Sequence[Zone]) -> tuple[KeepIn, ...]:
    """The keep-in areas outside of which some of ``zones`` lie."""
    return next((zone.outside.areas for zone in zones if zone.outside is not None), ())


def on_map(zones: Sequence[Zone]) -> tuple[Zone, ...]:
    """The zones to draw on a map seen from above: without what lies above and below keep-in areas, over all of them."""
    return tuple(zone for zone in zones if zone.outside is None or (zone.floor is None and zone.ceiling is None))


def no_fly_of(zones: Sequence[Zone]) -> tuple[Zone, ...]:
    """The no-fly zones among ``zones``."""
    return tuple(zone for zone in zones if zone.outside is None)
