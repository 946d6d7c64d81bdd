"""The zones of one file from another program, in any of the formats.

Polygons are prisms, Points with ``radius_m`` are cylinders. ``floor_agl_m``, ``ceiling_agl_m``, ``floor_amsl_m``,
``ceiling_amsl_m`` are in a feature's properties, or in a Placemark's ExtendedData. A feature that cannot be understood
is refused, never skipped, because a zone that is left out would be flown through. A hole counts as no-fly.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from gcsplan.errors import InputError, Problem
from gcsplan.mission_file.zone_draft import Bounds, ZoneDraft, circle, polygon

MAX_ZONES = 20_000
LARGEST_M = 1e6
"""A height or radius above this, m, is a mistake."""

LEVEL_KEYS = ("floor_agl_m", "ceiling_agl_m", "floor_amsl_m", "ceiling_amsl_m")


@dataclass
class ZoneFile:
    """The contents of one file; ``problems`` are its mistakes, each with its place."""

    path: Path
    zones: list[ZoneDraft] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    holes: int = 0

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user."""
        if not self.holes:
            return ()
        return (f"{self.path.name}: {self.holes} hole(s) in polygons count as no-fly",)

    def add_ring(self, name: str, where: str, ring: list[tuple[float, float]], bounds: Bounds, key: str) -> None:
        """Add a polygon by its outline, (latitude, longitude)."""
        if self._room(where):
            draft = polygon(name, where, ring, bounds, self.problems, key=key)
            self.zones += [draft] if draft is not None else []

    def add_circle(
        self, name: str, where: str, centre: tuple[float, float], radius_m: float | None, bounds: Bounds
    ) -> None:
        """Add a circle by its centre, (latitude, longitude); a missing radius is a problem."""
        if radius_m is None:
            self.problems.append(Problem(where, "a Point needs radius_m to be a zone"))
        elif self._room(where):
            draft = circle(name, where, centre, radius_m, bounds, self.problems)
            self.zones += [draft] if draft is not None else []

    def _room(self, where: str) -> bool:
        if len(self.zones) >= MAX_ZONES:
            raise InputError(f"the file has more than {MAX_ZONES} zones", where=where)
        return True
