"""Zones from other people's files: what one file holds, whichever format it has.

Polygons are prisms, Points with ``radius_m`` cylinders; ``floor_agl_m``, ``ceiling_agl_m``, ``floor_amsl_m``,
``ceiling_amsl_m`` stand in a feature's properties, or in a Placemark's ExtendedData. What cannot be understood is
refused, never skipped: a zone that is left out is a zone that is flown through. A hole counts as no-fly.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from gcsplan.errors import InputError, Problem
from gcsplan.mission_file.zone_draft import Bounds, ZoneDraft, circle, polygon

MAX_ZONES = 20_000
LARGEST_M = 1e6
"""A height or radius beyond it is a slip."""

LEVEL_KEYS = ("floor_agl_m", "ceiling_agl_m", "floor_amsl_m", "ceiling_amsl_m")


@dataclass
class ZoneFile:
    """What one file holds; ``problems`` are its mistakes, each with its place."""

    path: Path
    zones: list[ZoneDraft] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    holes: int = 0

    @property
    def notes(self) -> tuple[str, ...]:
        """Said to the user."""
        if not self.holes:
            return ()
        return (f"{self.path.name}: {self.holes} hole(s) in polygons count as no-fly",)

    def add_ring(self, name: str, where: str, ring: list[tuple[float, float]], bounds: Bounds, key: str) -> None:
        """A polygon's outline, (latitude, longitude)."""
        if self._room(where):
            draft = polygon(name, where, ring, bounds, self.problems, key=key)
            self.zones += [draft] if draft is not None else []

    def add_circle(
        self, name: str, where: str, centre: tuple[float, float], radius_m: float | None, bounds: Bounds
    ) -> None:
        """A point, (latitude, longitude), which must have a radius."""
        if radius_m is None:
            self.problems.append(Problem(where, "a Point needs radius_m to be a zone"))
        elif self._room(where):
            draft = circle(name, where, centre, radius_m, bounds, self.problems)
            self.zones += [draft] if draft is not None else []

    def _room(self, where: str) -> bool:
        if len(self.zones) >= MAX_ZONES:
            raise InputError(f"the file has more than {MAX_ZONES} zones", where=where)
        return True
