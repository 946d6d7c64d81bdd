"""One volume of a published zone, from what its format says to the drafts that all zone files share.

What is not understood never makes a zone smaller. Limits, or a kind, are kept as ``unread`` of the draft, which then
counts from the ground up without end; an outline that is not understood is a fault, which refuses a mission in its
surroundings (`unused.faults_near`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.published.arcs import Arc, ArcError
from gcsplan.mission_file.published.policy import Policy, PolicyJudge, Published
from gcsplan.mission_file.zones.attributes import OVER_PRESSURE, UNDER_PRESSURE, level_read
from gcsplan.mission_file.zones.draft import (
    ACROSS_ANTIMERIDIAN,
    MAX_VERTICES,
    Bounds,
    Remark,
    ZoneDraft,
    check_degrees,
    one_line,
)
from gcsplan.mission_file.zones.file import ZoneFile
from gcsplan.mission_file.zones.levels import LEVEL_EXAMPLES, LevelError, Limit, read_level
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.degree_shapes import (
    HALF_TURN_DEG,
    LARGEST_RADIUS_M,
    Corner,
    across,
    along_great_circles,
    latitudes_between,
    outline_of,
    unwrapped,
    wide_fault,
)
from gcsplan.world.geometry.outlines import MOST_CROSSINGS, MOST_EDGE_PAIRS, crossings, overlapping_pairs
from gcsplan.world.geometry.zones import Level

ELLIPSOID = "WGS84"
LEAST_GEOID_M, GREATEST_GEOID_M = -110.0, 90.0
"""Bounds of the geoid's height above the ellipsoid, m (EGM96: -107 to 86)."""

_read = lru_cache(maxsize=4096)(read_level)  # zones repeat their limits

NO_CEILING_M = 30_000.0
"""Ceilings from here up, m, are no limit: states write 99 999 m or ft for none."""

AROUND_DEG = 0.01
"""Degrees by which a zone without an outline is taken to reach beyond its points."""

OUTLINE_CURE = "complete its outline, or delete it from the file if it is no zone"


@dataclass(frozen=True, slots=True)
class Given:
    """One limit as it is written: the value, words that belong to it, and words that hold where it says nothing."""

    value: str | int | float
    words: tuple[str, ...] = ()
    spare: tuple[str, ...] = ()
    key: str = ""

    def __str__(self) -> str:
        words = " ".join(w for w in self.words if w)
        return one_line(f"{self.key} {str(self.value)[:60]}{f' {words[:40]}' if words else ''}")


@dataclass
class VolumeLimits:
    """Floor and ceiling of one volume, what a user has to know of them, and why they cannot be read."""

    bounds: Bounds = field(default_factory=Bounds)
    remarks: list[Remark] = field(default_factory=list)
    faults: list[Mistake] = field(default_factory=list)

    @classmethod
    def read(
        cls, lower: Given | None, upper: Given | None, where: str, spared: Note | None = None, *, policy: Policy
    ) -> VolumeLimits:
        """The limits; a missing one is no limit. ``spared`` is the note on a limit that needs its spare words."""
        found = cls()
        error_m = policy.flight_level_error_m
        levels: dict[str, float] = {}
        for bound, given in (("floor", lower), ("ceiling", upper)):
            if given is None:
                continue
            try:
                level = found._level(bound, given, spared, error_m)
            except LevelError as why:
                cure = f"{given} cannot be read as a level: {why}. Write for example {LEVEL_EXAMPLES}"
                found.faults.append(Mistake(where, cure))
                continue
            if level is not None:
                levels[f"{bound}_{level.datum}_m"] = level.value_m
        found.bounds = Bounds(**levels)
        if not found.faults:
            found.bounds.levels(where, found.faults)
        return found

    def _level(self, bound: str, given: Given, spared: Note | None, error_m: float | None) -> Level | None:
        words = tuple("AMSL" if w.upper() == ELLIPSOID else w for w in given.words)
        try:
            level = _read(given.value, words)
        except LevelError:
            if not given.spare:
                raise
            level = read_level(given.value, words, given.spare)
            self.remarks += [(spared, str(given))] if spared else []
        if level is Limit.PRESSURE and error_m is not None:
            return self._off(bound, given, _of_flight_level(given), error_m, Note("zone_flight_levels_uncertain"))
        if level is Limit.PRESSURE:
            self.remarks.append((UNDER_PRESSURE if bound == "floor" else OVER_PRESSURE, str(given)))
            return None
        if level is Limit.UNLIMITED:
            if bound == "floor":
                raise LevelError("a floor needs a height")
            return None
        assert isinstance(level, Level)
        if bound == "ceiling" and level.value_m >= NO_CEILING_M:
            return None
        if words != given.words:
            error_m = GREATEST_GEOID_M if bound == "floor" else -LEAST_GEOID_M
            return self._off(bound, given, level.value_m, error_m, Note("zone_limits_above_ellipsoid"))
        return level

    def _off(self, bound: str, given: Given, amsl_m: float, error_m: float, note: Note) -> Level:
        """A level that may lie ``error_m`` lower or higher: the one with which the zone is larger."""
        level = Level(amsl_m - error_m if bound == "floor" else amsl_m + error_m, "amsl")
        self.remarks.append((note, level_read(given, bound, level)))
        return level


def _of_flight_level(given: Given) -> float:
    """The height of a pressure altitude in the standard atmosphere, m."""
    text = " ".join([str(given.value), *given.words]).upper()
    level = read_level(text.replace("FL", " ").replace("STD", " "), (), ("FT", "AMSL"))
    if not isinstance(level, Level):
        raise LevelError("it has no height")
    return level.value_m * (100.0 if "FL" in text else 1.0)


@dataclass
class AirspaceFile:
    """The zones of one published file while it is read. ``seen`` counts the zones, used or not."""

    path: Path
    policy: Policy
    vocabulary: Sequence[str]
    great_circles: bool = False
    found: ZoneFile = field(init=False)
    judge: PolicyJudge = field(init=False)

    def __post_init__(self) -> None:
        self.found = ZoneFile(self.path, great_circles=self.great_circles)
        self.judge = PolicyJudge(self.policy, self.vocabulary)

    def finished(self) -> ZoneFile:
        """The zones, after what the policy names and no zone has is reported."""
        self.found.refusals += self.judge.slips()
        return self.found

    def fault(self, where: str, message: str, zone: Published | None = None) -> None:
        """Report a zone of which not even the place is known; one that is not used anyway has a note by its name."""
        unused = None if zone is None else self.judge.reason(zone)
        if zone is None or unused is None:
            self.found.problems.append(Mistake(where, message))
        else:
            note = unused.of(zones=(one_line(zone.name),))
            self.found.own_notes += [note] if self.found.own_notes[-1:] != [note] else []

    def refuse(self, where: str, message: str) -> None:
        """Report a mistake of the file as a whole."""
        self.found.refusals.append(Mistake(where, message))

    def add_circle(
        self, zone: Published, part: str, where: str, centre: Corner, radius_m: float, limits: VolumeLimits
    ) -> None:
        """Add a cylinder called ``part``; a large one is a polygon around the circle."""
        if not check_degrees(centre, where, self.found.problems):
            return
        if 0.0 < radius_m <= LARGEST_RADIUS_M:
            self._add(zone, part, where, (centre,), radius_m, limits, [])
            return
        try:
            ring = Arc.circle(centre, radius_m).corners(outward=True)
        except ArcError as why:  # it may reach the mission from anywhere
            self.fault(where, f"zone {zone.name[:60]!r}: {why}", zone)
            return
        self.add_ring(zone, part, where, ring, limits)

    def add_ring(
        self, zone: Published, part: str, where: str, ring: Sequence[Corner], limits: VolumeLimits, holes: int = 0
    ) -> None:
        """Add a prism called ``part`` by its outline and the number of its holes."""
        self.found.holes += holes
        if len(ring) > MAX_VERTICES:
            self.fault(where, f"has {len(ring)} points, more than {MAX_VERTICES}; simplify it", zone)
            return
        for lat, lon in ring:
            right = -90.0 <= lat <= 90.0 and -180.0 <= lon <= 180.0  # most are: no call for each of 100,000
            if not right and not check_degrees((lat, lon), where, self.found.problems):
                return
        ring, doubt = across(ring, holes)
        wide = wide_fault(ring, holes)
        if wide:
            self._add(zone, part, where, self._around(ring), None, limits, [Mistake(where, wide)])
            return
        outline, why = outline_of(ring)
        if not why:
            self._add(zone, part, where, tuple(outline), None, limits, [], doubt)
            return
        if len(set(outline)) < 3:  # where its other corners are is unknown
            self.fault(where, f"zone {zone.name[:60]!r}: {why}; {OUTLINE_CURE}", zone)
            return
        at = np.asarray(outline, float)
        tangled = overlapping_pairs(at) > MOST_EDGE_PAIRS or crossings(at) > MOST_CROSSINGS
        if tangled:
            why = f"its outline of {len(outline)} corners is too tangled to tell what it encloses"
        parts = [] if tangled else enclosed(outline)
        if not parts:
            self._add(zone, part, where, self._around(ring), None, limits, [Mistake(where, f"{why}; {OUTLINE_CURE}")])
            return
        if self.great_circles:  # whose crossings lie elsewhere
            try:
                bent = along_great_circles(outline)
            except InputError as too_many:
                self._add(zone, part, where, self._around(ring), None, limits, [Mistake(where, too_many.message)])
                return
            parts = parts if bent is None else enclosed(outline, bent)
        limits = VolumeLimits(limits.bounds, [*limits.remarks, (Note("zone_outline_crosses"), None)], limits.faults)
        for i, piece in enumerate(parts):
            name = part if len(parts) == 1 else f"{part}/{i + 1}"
            self._add(zone, name, where, tuple(piece), None, limits, [], doubt)

    def _around(self, points: Sequence[Corner]) -> tuple[Corner, ...]:
        """A rectangle with all points well inside, to tell whether a zone without an outline lies near.

        A zone that is half a turn wide may lie on either side of its corners: then the rectangle goes around the globe,
        as far north and south as great circles reach, and to the poles where they may be in it.
        """
        at = np.asarray(points, float)
        (south, west), (north, east) = at.min(axis=0) - AROUND_DEG, at.max(axis=0) + AROUND_DEG
        if east - west >= HALF_TURN_DEG:
            west, east = -HALF_TURN_DEG, HALF_TURN_DEG
            short = unwrapped([*points, points[0]], points[0][1])[:, 0]
            if abs(short[-1] - short[0]) > 1.0:
                south, north = -90.0, 90.0
            elif self.great_circles:
                lows, highs = latitudes_between(at, np.roll(at, -1, axis=0))
                south, north = min(south, lows.min() - AROUND_DEG), max(north, highs.max() + AROUND_DEG)
        south, north = max(south, -90.0), min(north, 90.0)
        corners = ((south, west), (south, east), (north, east), (north, west))
        return tuple((float(lat), float(lon)) for lat, lon in corners)

    def _add(
        self, zone: Published, part: str, where: str, points: tuple[Corner, ...], radius_m: float | None,
        limits: VolumeLimits, faults: list[Mistake], doubt: tuple[Corner, ...] = (),
    ) -> None:  # fmt: skip
        unread = (*limits.faults, *(Mistake(where, why) for why in zone.unread))
        floor, ceiling = (None, None) if faults or unread else limits.bounds.levels(where, [])
        faults = [Mistake(p.where, f"zone {zone.name[:60]!r}: {p.message}") for p in faults]
        remarks = [*zone.remarks, *limits.remarks]
        if doubt:
            remarks.append((ACROSS_ANTIMERIDIAN, None))
        draft = ZoneDraft(
            part[:200], where, points, False, radius_m, floor, ceiling,
            unused=self.judge.reason(zone), faults=tuple(faults), unread=unread, doubt=doubt,
        )  # fmt: skip
        self.found.add(draft, remarks)


def enclosed(*outlines: Sequence[Corner]) -> list[list[Corner]]:
    """The outlines of all that lines which cross themselves and each other enclose, whichever way they run."""
    import shapely

    lines = [shapely.LineString(np.asarray([*outline, outline[0]], float)[:, ::-1]) for outline in outlines]
    faces = shapely.get_parts(shapely.polygonize([shapely.union_all(lines)]))
    whole = shapely.union_all(faces)
    outer = [shapely.Polygon(p.exterior) for p in shapely.get_parts(whole) if p.geom_type == "Polygon"]
    rings = []
    for face in shapely.get_parts(shapely.union_all(outer)):
        ring = [(float(lat), float(lon)) for lon, lat in np.asarray(face.exterior.coords)[:-1]]
        if not outline_of(ring)[1]:
            rings.append(ring)
    return rings
