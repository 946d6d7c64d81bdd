"""No-fly zones: cylinders and prisms with a floor and a ceiling, in the metres of the plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from gcsplan.arrays import Floats

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
class Zone:
    """A closed shape whose open inside, between ``floor`` and ``ceiling``, may not be flown.

    ``floor`` None reaches down without end, ``ceiling`` None up without end.
    """

    name: str
    shape: Circle | Polygon
    floor: Level | None = None
    ceiling: Level | None = None

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
