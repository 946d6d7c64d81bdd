"""CONTRACT (to be implemented): the exact check of legs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gcsplan.world.limits import Limits
from gcsplan.world.surface import Surface
from gcsplan.world.zones import Zone

Floats = NDArray[np.float64]
Kind = Literal["min_agl", "max_agl", "max_amsl", "terrain_clearance", "zone", "climb", "descent", "coverage"]


@dataclass(frozen=True, eq=False)
class Legs:
    """N straight legs. ``start``, ``end``: (N, 3) east_m, north_m, amsl_m.

    ``column`` (N,): take-off and landing columns, exempt from min AGL, climb angle and terrain clearance, never
    from zones, their clearance, ceilings, or DEM coverage. ``track_error_m``, ``altitude_error_m`` (N,): of each
    leg, added to nothing else (the caller puts the limits' errors, bows and margins in).
    """

    start: Floats
    end: Floats
    column: NDArray[np.bool_]
    track_error_m: Floats
    altitude_error_m: Floats

    @classmethod
    def of_path(cls, points: ArrayLike, limits: Limits) -> Legs:
        """The legs between neighbours of ``points`` (N + 1, 3), with the errors of ``limits``, no columns."""
        raise NotImplementedError

    def __len__(self) -> int:
        return len(self.start)


@dataclass(frozen=True, slots=True)
class Violation:
    """One limit broken on one leg, at its worst point.

    ``fraction`` in [0, 1] along the leg; ``value`` what was found, ``limit`` what was wanted, ``by`` how far
    off it is (> 0), in ``unit`` (m or deg); ``zone`` the zone's index, or -1.
    """

    leg: int
    kind: Kind
    fraction: float
    east_m: float
    north_m: float
    amsl_m: float
    value: float
    limit: float
    by: float
    unit: str = "m"
    zone: int = -1


@dataclass(frozen=True, eq=False)
class LegReport:
    """What the check found; arrays are (N,) over the legs.

    ``min_agl_m``: lowest height above top (ground + obstacles) on the line itself, errors not taken off (the
    violations take them off); ``min_agl_at`` its fraction; ``max_agl_m`` highest above ground. NaN where the
    ground is unknown on the whole leg. ``climb_deg`` signed. ``zone_clearance_m``: horizontal distance, on the
    line itself, to the nearest zone whose height band the leg (widened by its altitude error) meets, ``inf``
    where none, 0 inside; ``nearest_zone`` its index or -1.
    """

    min_agl_m: Floats
    min_agl_at: Floats
    max_agl_m: Floats
    climb_deg: Floats
    zone_clearance_m: Floats
    nearest_zone: NDArray[np.intp]
    violations: tuple[Violation, ...]


@dataclass(frozen=True, eq=False)
class Tube:
    """Room for an altitude profile over a ground track of legs, one piece after the other.

    ``s_m`` (M + 1,): breakpoints, horizontal metres along the track. ``floor_m``, ``ceiling_m`` (M, 2): AMSL at
    both ends of each piece, linear between (neighbouring pieces may jump); ``floor_m`` never below what
    `Airspace.examine` demands, ``ceiling_m`` never above it; ``inf``/-inf where unbounded; floor +inf where
    the ground is unknown. Zones are not in them: they stand in ``bands``.
    """

    s_m: Floats
    floor_m: Floats
    ceiling_m: Floats
    bands: tuple[Band, ...]


@dataclass(frozen=True, eq=False)
class Band:
    """The track is horizontally within reach of a zone from ``s0_m`` to ``s1_m`` (one span, perhaps of several):
    fly at or below ``bottom_m`` or at or above ``top_m``; each (K, 2) over pieces with breakpoints ``s_m``
    (K + 1,), conservative as in `Tube`; bottom -inf: cannot be underflown; top +inf: cannot be overflown."""

    zone: int
    s0_m: float
    s1_m: float
    s_m: Floats
    bottom_m: Floats
    top_m: Floats


class Airspace:
    """A surface and its zones, ready to judge legs.

    ``scale`` >= 1: largest scale of the plane over the mission; real metres times it are metres of the plane at
    most, so every horizontal clearance is multiplied by it.
    """

    def __init__(self, surface: Surface, zones: Sequence[Zone] = (), *, scale: float = 1.0) -> None:
        self.surface = surface
        self.zones = tuple(zones)
        self.scale = scale

    def examine(self, legs: Legs, limits: Limits) -> LegReport:
        """Every violation along the whole of every leg. ``limits``' own errors are not used: the legs carry them."""
        raise NotImplementedError

    def clear(self, legs: Legs, limits: Limits) -> NDArray[np.bool_]:
        """(N,) True where `examine` would find no violation; faster."""
        raise NotImplementedError

    def floor_amsl(self, east_m: ArrayLike, north_m: ArrayLike, limits: Limits) -> Floats:
        """Lowest legal altitude over points of the plane, for terrain (min AGL, clearance; errors of ``limits``
        added); conservative; +inf where unknown. Zones are not in it."""
        raise NotImplementedError

    def ceiling_amsl(self, east_m: ArrayLike, north_m: ArrayLike, limits: Limits) -> Floats:
        """Highest legal altitude over points (max AGL, max AMSL; errors taken off); conservative; -inf unknown."""
        raise NotImplementedError

    def tube(self, track: ArrayLike, limits: Limits) -> Tube:
        """The tube over a ground track (N, 2) of points in the plane, errors of ``limits`` included."""
        raise NotImplementedError
