"""Keep-in areas: from drafts of a mission file, or of files that it names, to areas in the plane.

An area may never be larger than it is written, where a no-fly zone may never be smaller: a circle becomes a polygon of
chords, an edge that may be a great circle as well as a straight line counts as the one that is farther inside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.zones.draft import MOST_ALL_CORNERS, OTHER_SIDE, ZoneDraft
from gcsplan.world.geodesy.degree_shapes import (
    EDGE_BOW_M,
    ZONE_FAR_M,
    along_great_circles,
    counter_clockwise,
    near_circle,
    near_polygons,
    outline_of,
)
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.outside import outside_of
from gcsplan.world.geometry.zones import AreaPart, Circle, KeepIn, Polygon, Zone

if TYPE_CHECKING:
    import shapely

CHORD_M, CHORD_PART = 0.05, 2e-4
"""The chords of a circle lie inside it by at most the first, m, or this part of its radius if that is more."""

UNSAFE_REMARKS = {
    "drawn_height_of_highest_corner": "its corners are drawn at different heights: give it a ceiling",
    "zone_floor_at_flight_level": "its floor is a flight level: give it in metres or feet above sea level",
    "zone_ceiling_at_flight_level": "its ceiling is a flight level: give it in metres or feet above sea level",
    "zone_attributes_unread": "an attribute of it looks like a floor or a ceiling and is not read: write it as "
    "floor_agl_m, floor_amsl_m, ceiling_agl_m or ceiling_amsl_m, or leave it out",
    "zone_times_unread": "it has times that are not read: leave them out if it is open for the whole flight",
}
"""Remarks on how a zone was read that make a no-fly zone larger than it is, and why no keep-in area may have them."""

ONE_STATEMENT = (
    "each of them says that a flight stays inside, and gcsplan takes one such statement: draw what they have in common "
    "under keep_in"
)

LINE = "a keep-in area is a circle or a polygon, not a line: draw the corridor's outline as a polygon"


def as_keep_in(drafts: Sequence[ZoneDraft], where: str, problems: list[Mistake]) -> list[ZoneDraft]:
    """The drafts of one entry of ``keep_in`` as areas. An entry without any would leave flights free, so it is refused.

    A file that has areas to stay in by itself (the inclusion areas of a fence, a world with holes) may have nothing
    else: its zones would be flown through.
    """
    if not drafts and not problems:
        problems.append(Mistake(where, "has no area; leave it out if a flight may be anywhere"))
    by_file = [d.keep_in for d in drafts]
    if any(by_file) and not all(by_file):
        words = (
            "the file has keep-in areas and no-fly zones (inclusion and exclusion areas of a fence, or a world with "
            "holes beside other polygons): name it under no_fly, where both count"
        )
        problems.append(Mistake(where, words))
        return []
    if all(by_file) and len({d.kept_by for d in drafts}) > 1:
        problems.append(Mistake(where, f"the file has several worlds with holes: {ONE_STATEMENT}"))
    return [replace(d, keep_in=True, kept_by="keep_in") for d in drafts]


def apart(drafts: Sequence[ZoneDraft], problems: list[Mistake]) -> tuple[list[ZoneDraft], list[ZoneDraft]]:
    """The no-fly zones and the areas to stay in among ``drafts``; what cannot be an area goes to ``problems``."""
    inside = [d for d in drafts if d.keep_in]
    others = [d for d in inside if d.kept_by != inside[0].kept_by]
    if others:
        words = f"keep-in area {others[0].name[:60]!r} stands beside {inside[0].name[:60]!r} of another file or key"
        problems.append(Mistake(others[0].where, f"{words}: {ONE_STATEMENT}"))
    for draft in inside:
        codes = {str(getattr(note, "code", "")) for remark in draft.remarks for note in remark}
        problems += [Mistake(draft.where, f"keep-in area {draft.name[:60]!r}: {UNSAFE_REMARKS[code]}")
                     for code in sorted(codes & UNSAFE_REMARKS.keys())]  # fmt: skip
        problems += [Mistake(p.where, f"keep-in area {draft.name[:60]!r}: {p.message}") for p in draft.unread]
        problems += draft.faults
        if draft.buffer_m is not None:
            problems.append(Mistake(draft.where, LINE))
        if draft.doubt:
            problems.append(Mistake(draft.where, f"keep-in area {draft.name[:60]!r}: {OTHER_SIDE}"))
    return [d for d in drafts if not d.keep_in], inside


def place_keep_in(drafts: Sequence[ZoneDraft], frame: Frame) -> tuple[KeepIn, ...]:
    """Each draft as an area of the plane, cut to the part near enough to matter. Raises InputError."""
    areas, corners = [], 0
    for draft in drafts:
        area = KeepIn(draft.name, tuple(_parts(draft, frame)), draft.floor, draft.ceiling)
        corners += sum(len(ring) for part in area.parts for ring in (part.outline, *part.holes))
        if corners > MOST_ALL_CORNERS:
            words = f"with this one the keep-in areas have {corners} corners, more than {MOST_ALL_CORNERS}"
            raise InputError(f"keep-in area {draft.name[:60]!r}: {words}; simplify them", where=draft.where)
        areas.append(area)
    return tuple(areas)


def outside_zones(areas: Sequence[KeepIn], *, local: bool) -> tuple[Zone, ...]:
    """The outside of the areas as zones.

    Edges in degrees are known to `EDGE_BOW_M`, so that slits of twice that between areas are none.
    """
    return outside_of(areas, ZONE_FAR_M, slit_m=0.0 if local else EDGE_BOW_M)


def _parts(draft: ZoneDraft, frame: Frame) -> list[AreaPart]:
    if draft.radius_m is not None:
        centre = draft.points[0] if draft.local else frame.to_plane(*draft.points[0]).tolist()
        circle = near_circle(centre, draft.radius_m)
        return [] if circle is None else [AreaPart(_chords(circle))]
    if draft.local:
        return [AreaPart(counter_clockwise(np.asarray(draft.points, float)).vertices)]
    whole = near_polygons(draft.points, frame)
    bent = along_great_circles(draft.points) if draft.great_circles else None
    if not draft.holes and bent is None:
        return [AreaPart(polygon.vertices) for polygon in whole]
    import shapely

    area = _union(whole)
    if bent is not None:
        area = shapely.intersection(area, _union(near_polygons(bent, frame)))
    for hole in draft.holes:
        ring, fault = outline_of(hole)
        if fault:
            raise InputError(f"keep-in area {draft.name[:60]!r}: a hole of it: {fault}", where=draft.where)
        area = shapely.difference(area, _union(near_polygons(ring, frame, great_circles=draft.great_circles)))
    parts = [p for p in shapely.get_parts(area) if p.geom_type == "Polygon" and not p.is_empty]
    return [
        AreaPart(np.asarray(p.exterior.coords)[:-1], tuple(np.asarray(hole.coords)[:-1] for hole in p.interiors))
        for p in parts
    ]


def _union(polygons: Sequence[Polygon]) -> shapely.Geometry:
    import shapely

    return shapely.union_all([shapely.Polygon(p.vertices) for p in polygons])


def _chords(circle: Circle) -> Floats:
    """Corners of a polygon inside a circle. A metre of the plane is never longer than one on the ground."""
    inside = min(max(CHORD_M / circle.radius_m, CHORD_PART), 0.3)
    count = max(math.ceil(math.pi / math.acos(1.0 - inside)), 8)
    turn = 2.0 * np.pi * np.arange(count) / count
    middle = np.array([circle.east_m, circle.north_m])
    return np.asarray(middle + circle.radius_m * np.column_stack([np.cos(turn), np.sin(turn)]))
