"""The zones of one file from another program, in any of the formats.

Polygons are prisms, Points with ``radius_m`` are cylinders. Floors and ceilings are in a feature's properties, or in a
Placemark's ExtendedData (`zone_attributes`). A feature that cannot be understood is refused, never skipped, because a
zone that is left out would be flown through. A hole counts as no-fly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from gcsplan.errors import InputError, Problem
from gcsplan.figures import counted
from gcsplan.mission_file.zone_attributes import Said
from gcsplan.mission_file.zone_draft import Remark, ZoneDraft, circle, polygon
from gcsplan.world.zones import Level

MAX_ZONES = 20_000
RADIUS_OF_POLYGON = "the radius of a polygon is not read, so that nothing beyond its outline is kept clear"


@dataclass(frozen=True, slots=True)
class Drawn:
    """The heights with which a format draws a polygon, as far as they limit it, and what is said of them."""

    ceiling: Level | None = None
    remarks: tuple[Remark, ...] = ()


NOT_DRAWN = Drawn()


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
        return (f"{self.path.name}: {counted(self.holes, 'hole')} in polygons counted as no-fly",)

    def add_ring(
        self, said: Said, part: str, where: str, ring: list[tuple[float, float]], key: str, drawn: Drawn = NOT_DRAWN
    ) -> None:
        """Add a polygon called ``part`` by its outline, (latitude, longitude)."""
        bounds = said.bounds
        remarks = [*said.remarks, *drawn.remarks]
        if drawn.ceiling is not None:
            bounds = replace(bounds, **{f"ceiling_{drawn.ceiling.datum}_m": drawn.ceiling.value_m})
        if said.radius_m is not None:
            remarks.append((RADIUS_OF_POLYGON, f"{said.radius_m:g} m"))
        self._add(polygon(part[:200], where, ring, bounds, self.problems, key=key), where, remarks)

    def add_circle(
        self, said: Said, part: str, where: str, centre: tuple[float, float], remarks: Sequence[Remark] = ()
    ) -> None:
        """Add a circle called ``part`` by its centre, (latitude, longitude); a missing radius is a problem."""
        if said.radius_m is None:
            self.problems.append(Problem(where, "a Point needs radius_m to be a zone"))
        else:
            draft = circle(part[:200], where, centre, said.radius_m, said.bounds, self.problems)
            self._add(draft, where, [*said.remarks, *remarks])

    def _add(self, draft: ZoneDraft | None, where: str, remarks: Sequence[Remark]) -> None:
        if draft is None:
            return
        if len(self.zones) >= MAX_ZONES:
            raise InputError(f"the file has more than {MAX_ZONES} zones", where=where)
        of_file = tuple((f"{self.path.name}: {sentence}", detail) for sentence, detail in remarks)
        self.zones.append(replace(draft, remarks=of_file))
