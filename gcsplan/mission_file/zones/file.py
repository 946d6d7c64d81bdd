"""`ZoneFile`: the zones of one file from another program, as the reader of any format collects them.

Polygons are prisms, points with ``radius_m`` are cylinders, lines with ``buffer_m`` corridors; the mission may give
both sizes for all shapes of a file that have none of their own. Floors and ceilings are in a feature's properties, or
in a Placemark's ExtendedData (`read_attributes`). A feature that cannot be understood is refused, never skipped,
because a zone that is left out would be flown through. A hole counts as no-fly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.zones.attributes import ZoneStatements
from gcsplan.mission_file.zones.draft import Remark, ZoneDraft, circle, corridor, polygon
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.degree_shapes import Corner
from gcsplan.world.geometry.zones import Level

MAX_ZONES = 20_000
RADIUS_OF_POLYGON = Note("zone_radius_of_polygon_unread")
BUFFER_OF_POLYGON = Note("zone_buffer_of_polygon_unread")


@dataclass(frozen=True, slots=True)
class Drawn:
    """The heights with which a format draws a polygon, as far as they limit it, and remarks on them."""

    ceiling: Level | None = None
    remarks: tuple[Remark, ...] = ()


NOT_DRAWN = Drawn()


def drawn_unread(altitudes_m: Sequence[float]) -> Drawn:
    """A remark on the altitudes of corners, which limit nothing."""
    if not altitudes_m:
        return NOT_DRAWN
    return Drawn(remarks=((Note("zone_corner_altitudes_unread"), Note("drawn_up_to", top_m=max(altitudes_m))),))


@dataclass(frozen=True, slots=True)
class Unsized:
    """A point or line without a size of its own; ``make`` makes it with one, and it belongs before zone ``at``."""

    kind: Literal["point", "line"]
    at: int
    where: str
    make: Callable[[float], ZoneDraft | None]
    remarks: tuple[Remark, ...]


@dataclass
class ZoneFile:
    """The contents of one file; ``problems`` are its mistakes, each with its place."""

    path: Path
    zones: list[ZoneDraft] = field(default_factory=list)
    problems: list[Mistake] = field(default_factory=list)
    holes: int = 0
    own_notes: list[Note] = field(default_factory=list)
    columns: tuple[str, ...] = ()
    unsized: list[Unsized] = field(default_factory=list)
    great_circles: bool = False
    """Whether the format leaves it open that edges are great circles."""

    @property
    def notes(self) -> tuple[Note, ...]:
        """The notes for the user on how the file was read."""
        holes = [Note("holes_are_no_fly", count=self.holes)] if self.holes else []
        return tuple(note.of(file=self.path.name) for note in [*self.own_notes, *holes])

    def give_sizes(self, radius_m: float | None, buffer_m: float | None) -> None:
        """Give the points and lines without a size of their own that of the mission; without one they are a problem."""
        given = {"point": radius_m, "line": buffer_m}
        for some in reversed(self.unsized):  # from the last one, so that the others' places stay
            size_m = given[some.kind]
            if size_m is not None and (draft := some.make(size_m)) is not None:
                self.zones.insert(some.at, self._remarked(draft, some.remarks))
        for kind, what, key in (("point", "a radius", "radius_m"), ("line", "a corridor's half-width", "buffer_m")):
            lacking = [some.where for some in self.unsized if some.kind == kind and given[kind] is None]
            if lacking:
                others = f", and so do {len(lacking) - 1} more" if len(lacking) > 1 else ""
                found = f"; columns found: {', '.join(self.columns)}" if self.columns else ""
                words = (
                    f"a {kind} needs {what} to be a zone{others}: give each a {key}, or write {key} beside `file` in "
                    f"the mission, for all of them{found}"
                )
                self.problems.append(Mistake(lacking[0], words))
        self.unsized = []

    def add_ring(
        self, stated: ZoneStatements, part: str, where: str, ring: list[tuple[float, float]], key: str,
        drawn: Drawn = NOT_DRAWN, holes: int = 0,
    ) -> None:  # fmt: skip
        """Add a polygon called ``part`` by its outline, (latitude, longitude), and the number of its holes."""
        self.holes += holes
        bounds = stated.bounds
        remarks = [*stated.remarks, *drawn.remarks]
        if drawn.ceiling is not None:
            bounds = replace(bounds, **{f"ceiling_{drawn.ceiling.datum}_m": drawn.ceiling.value_m})
        for size_m, note in ((stated.radius_m, RADIUS_OF_POLYGON), (stated.buffer_m, BUFFER_OF_POLYGON)):
            if size_m is not None:
                remarks.append((note, Note("size_of_zone", size_m=size_m)))
        self.add(polygon(part[:200], where, ring, bounds, self.problems, key=key, holes=holes), remarks)

    def add_circle(
        self, stated: ZoneStatements, part: str, where: str, centre: Corner, remarks: Sequence[Remark] = ()
    ) -> None:
        """Add a circle called ``part`` by its centre, (latitude, longitude); its radius may come from the mission."""
        make = partial(circle, part[:200], where, centre, bounds=stated.bounds, problems=self.problems)
        self._add_sized(
            "point", stated.radius_m, lambda size_m: make(radius_m=size_m), where, [*stated.remarks, *remarks]
        )

    def add_line(
        self,
        stated: ZoneStatements,
        part: str,
        where: str,
        line: list[Corner],
        key: str,
        remarks: Sequence[Remark] = (),
    ) -> None:
        """Add the corridor around a line, (latitude, longitude); its half-width may come from the mission."""
        make = partial(corridor, part[:200], where, line, bounds=stated.bounds, problems=self.problems, key=key)
        self._add_sized(
            "line", stated.buffer_m, lambda size_m: make(buffer_m=size_m), where, [*stated.remarks, *remarks]
        )

    def _add_sized(
        self, kind: Literal["point", "line"], size_m: float | None, make: Callable[[float], ZoneDraft | None],
        where: str, remarks: Sequence[Remark],
    ) -> None:  # fmt: skip
        if size_m is not None:
            self.add(make(size_m), remarks)
            return
        self._require_room(where)
        self.unsized.append(Unsized(kind, len(self.zones), where, make, tuple(remarks)))

    def add(self, draft: ZoneDraft | None, remarks: Sequence[Remark]) -> None:
        """Add a zone that is right."""
        if draft is not None:
            self._require_room(draft.where)
            self.zones.append(self._remarked(draft, remarks))

    def _require_room(self, where: str) -> None:
        if len(self.zones) + len(self.unsized) >= MAX_ZONES:
            raise InputError(f"the file has more than {MAX_ZONES} zones", where=where)

    def _remarked(self, draft: ZoneDraft, remarks: Sequence[Remark]) -> ZoneDraft:
        of_file = tuple((note.of(file=self.path.name), detail) for note, detail in [*remarks, *draft.remarks])
        return replace(draft, remarks=of_file, great_circles=self.great_circles)
