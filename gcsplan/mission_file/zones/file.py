"""`ZoneFile`: the zones of one file from another program, as the reader of any format collects them.

Polygons are prisms, points with ``radius_m`` are cylinders, lines with ``buffer_m`` corridors; the mission may give
both sizes for all shapes of a file that have none of their own, or ignore these. Floors and ceilings are in a feature's
properties, or in a Placemark's ExtendedData (`read_attributes`). A hole counts as no-fly, but
for the holes of a polygon around the world: they are keep-in areas.

A zone that is left out would be flown through. So what cannot be understood is collected, with its place, and
`ZoneFile.settle` is the one place that decides by the mission's ``on_bad`` what it does: it refuses the file, or the
mission near it, or it is left out by name.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.zones.attributes import ZoneStatements
from gcsplan.mission_file.zones.draft import Bounds, Remark, ZoneDraft, circle, corridor, one_line, polygon
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.degree_shapes import Corner, is_world
from gcsplan.world.geometry.zones import Level

MAX_ZONES = 20_000
MOST_SKIPPED = 1000
"""Most elements of a file that are left out because they are not understood."""

OnBad = Literal["refuse", "strict", "skip"]
"""The rule for elements that are not understood; see `ZoneFile.settle`."""

Ignorable = Literal["points", "lines", "empty"]
IGNORABLE: dict[Ignorable, str] = {
    "points": "points without a radius", "lines": "lines without a width", "empty": "empty geometries",
}  # fmt: skip
"""The shapes beside zones that a mission may ignore, in words."""

SKIPPED = Note("zones_skipped")
RADIUS_OF_POLYGON = Note("zone_radius_of_polygon_unread")
BUFFER_OF_POLYGON = Note("zone_buffer_of_polygon_unread")


EMPTY_CURE = "remove it, draw it, or leave it out by name (ignore: [empty], --ignore empty)"


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

    kind: Literal["points", "lines"]
    at: int
    name: str
    where: str
    make: Callable[[float], ZoneDraft | None]
    remarks: tuple[Remark, ...]


@dataclass
class ZoneFile:
    """The contents of one file; ``problems`` are the mistakes of elements that cannot be read, each with its place.

    ``refusals`` are mistakes of the file as a whole, ``unshaped`` elements that are no shape of a zone, each with its
    kind, name and mistake.
    """

    path: Path
    zones: list[ZoneDraft] = field(default_factory=list)
    problems: list[Mistake] = field(default_factory=list)
    refusals: list[Mistake] = field(default_factory=list)
    unshaped: list[tuple[Ignorable, str, Mistake]] = field(default_factory=list)
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

    def settle(self, on_bad: OnBad, cure: str = "") -> None:
        """Decide what elements that are not understood do; afterwards ``problems`` are all that refuses the file.

        - ``refuse``: each of them refuses the file.
        - ``strict``: a zone whose outline is known counts from the ground up without end, one whose surroundings alone
          are known refuses a mission in them, and an element whose place is unknown refuses the file.
        - ``skip``: as strict, but what has no outline is left out by name. A file of which nothing can be read, or of
          which more than `MOST_SKIPPED` elements cannot, is refused all the same.

        ``cure`` says how these are left out. Zones that are not used for another reason refuse nothing.
        """
        if on_bad == "refuse":
            for draft in self.zones:
                named = [Mistake(p.where, f"zone {draft.name[:60]!r}: {p.message}") for p in draft.unread]
                self.problems += [] if draft.unused else [*draft.faults, *named]
            self.zones = [d for d in self.zones if d.unused or not (d.faults or d.unread)]
        else:
            self.zones = [self._counted(draft, on_bad) for draft in self.zones]
        if on_bad == "skip" and self.zones and len(self.problems) <= MOST_SKIPPED:
            before = f"{self.path}: "
            self.own_notes += [
                Note("zone_skipped", where=p.where.removeprefix(before), why=p.message) for p in self.problems
            ]
            self.problems = []
        elif on_bad != "refuse" and self.problems and cure:
            first = self.problems[0]
            self.problems[0] = replace(first, message=f"{first.message}; or {cure}")
        self.problems[:0] = self.refusals
        self.refusals = []

    def refuse_since(self, count: int) -> None:
        """Make the problems after the first ``count`` refuse the file by every rule of ``on_bad``.

        They are an area's to stay in: without it a flight may be anywhere.
        """
        self.refusals += self.problems[count:]
        del self.problems[count:]

    def _counted(self, draft: ZoneDraft, on_bad: OnBad) -> ZoneDraft:
        """A zone that is not understood as it counts, with a remark; any other zone as it is."""
        if draft.unread and not draft.unused:
            note = Note("zone_limits_not_understood", file=self.path.name)
            draft = replace(draft, remarks=(*draft.remarks, (note, draft.unread[0].message)))
        if draft.faults and not draft.unused and on_bad == "skip":
            draft = replace(draft, unused=SKIPPED)
        return draft

    def give_sizes(
        self, radius_m: float | None, buffer_m: float | None, ignore: Collection[Ignorable] = (), where: str = "",
        *, skip: bool = False,
    ) -> None:  # fmt: skip
        """Give the points and lines without a size of their own that of the mission, which has ``ignore`` at ``where``.

        Those without one, and what is no shape of a zone, are ignored by name, or are problems. With ``skip`` all of
        them are ignored beside zones.
        """
        given: dict[Ignorable, float | None] = {"points": radius_m, "lines": buffer_m}
        for kind, size_m in given.items():
            if kind in ignore and size_m is not None:
                self.refusals.append(Mistake(where, f"{kind} have a size in the mission, too: leave one out"))
        for some in reversed(self.unsized):  # from the last one, so that the others' places stay
            size_m = given[some.kind]
            if size_m is not None and (draft := some.make(size_m)) is not None:
                self.zones.insert(some.at, self._remarked(draft, some.remarks))
        ignore = IGNORABLE if skip and self.zones else ignore
        self._without_size("points", "a point needs a radius", "radius_m", radius_m, ignore)
        self._without_size("lines", "a line needs a corridor's half-width", "buffer_m", buffer_m, ignore)
        self.problems += [problem for kind, _, problem in self.unshaped if kind not in ignore]
        for kind, words in IGNORABLE.items():
            names = [some.name for some in self.unsized if some.kind == kind and given.get(kind) is None]
            names += [name for one, name, _ in self.unshaped if one == kind]
            if kind in ignore and names:
                self.own_notes.append(Note("shapes_ignored", kind=words, zones=tuple(map(one_line, names))))
        self.unsized, self.unshaped = [], []

    def _without_size(
        self, kind: Ignorable, need: str, key: str, size_m: float | None, ignore: Collection[Ignorable]
    ) -> None:
        """A problem for the points or lines that have no size, and are not ignored."""
        lacking = [some.where for some in self.unsized if some.kind == kind and size_m is None]
        if not lacking or kind in ignore:
            return
        others = f", and so do {len(lacking) - 1} more" if len(lacking) > 1 else ""
        found = f"; columns found: {', '.join(self.columns)}" if self.columns else ""
        words = (
            f"{need} to be a zone{others}: give each a {key}, or write {key} beside `file` in the mission, for all of "
            f"them{found}; or leave them out by name (ignore: [{kind}], --ignore {kind})"
        )
        self.problems.append(Mistake(lacking[0], words))

    def add_ring(
        self, stated: ZoneStatements, part: str, where: str, ring: list[tuple[float, float]], key: str,
        drawn: Drawn = NOT_DRAWN, holes: Sequence[Sequence[Corner]] = (),
    ) -> None:  # fmt: skip
        """Add a polygon called ``part`` by its outline, (latitude, longitude), and its holes.

        The holes of a world are keep-in areas; otherwise they count as no-fly.
        """
        if holes and is_world(ring):
            self._add_holes_of_world(stated, part, where, key, holes)
            return
        self.holes += 0 if stated.keep_in else len(holes)
        bounds = stated.bounds
        remarks = [*stated.remarks, *drawn.remarks]
        if drawn.ceiling is not None:
            bounds = replace(bounds, **{f"ceiling_{drawn.ceiling.datum}_m": drawn.ceiling.value_m})
        for size_m, note in ((stated.radius_m, RADIUS_OF_POLYGON), (stated.buffer_m, BUFFER_OF_POLYGON)):
            if size_m is not None:
                remarks.append((note, Note("size_of_zone", size_m=size_m)))
        draft = polygon(part[:200], where, ring, bounds, self.problems, key=key, holes=holes)
        self.add(None if draft is None else self._stated(draft, stated), remarks)

    def _stated(self, draft: ZoneDraft, stated: ZoneStatements) -> ZoneDraft:
        """The draft with what its attributes say of it besides its shape."""
        return replace(draft, unread=stated.unread, keep_in=stated.keep_in, kept_by=str(self.path))

    def _add_holes_of_world(
        self, stated: ZoneStatements, part: str, where: str, key: str, holes: Sequence[Sequence[Corner]]
    ) -> None:
        """Add the holes of a polygon around the world: outside of them all is no-fly, so that flights stay inside."""
        before = len(self.problems)
        if stated.bounds != Bounds() or stated.unread:
            words = "a polygon around the world is no-fly at all heights outside of its holes: leave its levels out"
            self.problems.append(Mistake(where, words))
        for i, hole in enumerate(holes):
            name = part if len(holes) == 1 else f"{part}/{i + 1}"
            draft = polygon(name[:200], where, hole, Bounds(), self.problems, key=key)
            self.add(draft and replace(draft, keep_in=True, kept_by=f"{part} of {where}"), stated.remarks)
        self.refuse_since(before)

    def add_circle(
        self, stated: ZoneStatements, part: str, where: str, centre: Corner, remarks: Sequence[Remark] = ()
    ) -> None:
        """Add a circle called ``part`` by its centre, (latitude, longitude); its radius may come from the mission."""
        make = partial(circle, part[:200], where, centre, bounds=stated.bounds, problems=self.problems)
        self._add_sized("points", stated, part, stated.radius_m, lambda size_m: make(radius_m=size_m), where, remarks)

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
        self._add_sized("lines", stated, part, stated.buffer_m, lambda size_m: make(buffer_m=size_m), where, remarks)

    def _add_sized(
        self, kind: Literal["points", "lines"], stated: ZoneStatements, part: str, size_m: float | None,
        make: Callable[[float], ZoneDraft | None], where: str, remarks: Sequence[Remark],
    ) -> None:  # fmt: skip
        def whole(size_m: float) -> ZoneDraft | None:
            draft = make(size_m)
            return None if draft is None else self._stated(draft, stated)

        remarks = [*stated.remarks, *remarks]
        if size_m is not None:
            self.add(whole(size_m), remarks)
            return
        self._require_room(where)
        self.unsized.append(Unsized(kind, len(self.zones), part, where, whole, tuple(remarks)))

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
