"""No-fly zones as users write them, in degrees or local metres, and their conversion into the plane."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.values.places import is_swapped, range_fault
from gcsplan.notes.note import Datum, Note
from gcsplan.world.geodesy.degree_shapes import (
    LARGEST_BUFFER_M,
    LARGEST_RADIUS_M,
    MOST_LON_DEG,
    across,
    counter_clockwise,
    near_circle,
    near_corridors,
    near_polygons,
    outline_of,
    plain_polygons,
    wide_fault,
)
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.outlines import fewer_corners
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone

SIZE_KEYS = ("radius_m", "buffer_m")
"""The keys of a zone's size, in a mission file as in the attributes of other files."""

MAX_VERTICES = 100_000
"""Most vertices of one polygon."""

MOST_ZONE_CORNERS = 20_000
"""Most corners of one polygon near the mission; more are drawn wider, by at most `WIDEST_M`, with fewer."""

MOST_ALL_CORNERS = 400_000
"""Most corners of all polygons near enough to matter, corridors' polygons included; more refuse a mission near them,
and twice as many each mission: they are not even drawn."""

WIDEST_M, MUCH_WIDER_M = 0.5, (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""How much wider an outline is drawn without a request, m, and tolerances that are tried for a cure."""

DRAWN_WIDER = Note("zone_outline_widened", most_corners=MOST_ZONE_CORNERS, wider_m=WIDEST_M)

MAX_LINE_POINTS = 20_000
"""Most points of one line: its corridor takes a second for some thousand points."""

Remark = tuple[Note, Datum]
"""A remark for the user on how a zone was read: a note for all such zones, and the datum of this one."""

ACROSS_ANTIMERIDIAN = Note("zone_across_the_antimeridian")
OTHER_SIDE = (
    "its outline is read as across the 180° meridian, but if it goes around the other side the mission is in it: write "
    "longitudes past 180 where it crosses (181 for -179), or cut it there in two"
)

SHOWN_ZONES = 20
"""Most zones named in one note."""


@dataclass(frozen=True, slots=True)
class ZoneDraft:
    """A zone before there is a plane.

    ``points`` is the centre alone (with ``radius_m``), a line (with ``buffer_m``, the half-width of its corridor), or a
    polygon's vertices, not closed: (latitude, longitude) in degrees, or (east_m, north_m) if ``local``. ``where`` is
    its place in the user's file. ``unused`` says why a zone of an authority's file is not used; ``faults`` are what is
    not understood of its outline, which refuses a mission near it, ``unread`` what is not of its floor and ceiling:
    it then counts from the ground up without end. ``great_circles``: its format does not say that edges are
    straight in degrees, so that what they enclose along great circles belongs to the zone, too. ``doubt`` is where a
    polygon that is read as across the antimeridian lies if it goes around the other side: a mission there is refused.
    ``keep_in``: it is no zone, but an area that flights stay in, without its ``holes``; a zone's holes count as no-fly.
    ``kept_by`` is the statement that it is one: flights stay in the union of the areas of one statement.
    """

    name: str
    where: str
    points: tuple[tuple[float, float], ...]
    local: bool = False
    radius_m: float | None = None
    floor: Level | None = None
    ceiling: Level | None = None
    remarks: tuple[Remark, ...] = ()
    buffer_m: float | None = None
    unused: Note | None = None
    faults: tuple[Mistake, ...] = ()
    unread: tuple[Mistake, ...] = ()
    great_circles: bool = False
    doubt: tuple[tuple[float, float], ...] = ()
    keep_in: bool = False
    kept_by: str = ""
    holes: tuple[tuple[tuple[float, float], ...], ...] = ()


@dataclass(frozen=True, slots=True)
class Bounds:
    """The four keys for a zone's floor and ceiling; None if absent."""

    floor_agl_m: float | None = None
    ceiling_agl_m: float | None = None
    floor_amsl_m: float | None = None
    ceiling_amsl_m: float | None = None

    def levels(self, where: str, problems: list[Mistake]) -> tuple[Level | None, Level | None]:
        """Floor and ceiling; contradictions go to ``problems``.

        A floor at 0 m AGL is no floor: the zone reaches down without end, so nothing passes below it.
        """
        for bound in ("floor", "ceiling"):
            if getattr(self, f"{bound}_agl_m") is not None and getattr(self, f"{bound}_amsl_m") is not None:
                problems.append(
                    Mistake(f"{where}.{bound}_agl_m", f"give {bound}_agl_m or {bound}_amsl_m, not both for one {bound}")
                )
        floor = _level(self.floor_agl_m, self.floor_amsl_m)
        ceiling = _level(self.ceiling_agl_m, self.ceiling_amsl_m)
        if floor is not None and floor.datum == "agl" and floor.value_m < 0.0:
            problems.append(Mistake(f"{where}.floor_agl_m", f"must be at least 0, given {floor.value_m:g}"))
        if ceiling is not None and ceiling.datum == "agl" and ceiling.value_m <= 0.0:
            problems.append(
                Mistake(
                    f"{where}.ceiling_agl_m",
                    f"must be above 0, given {ceiling.value_m:g}: the zone would lie wholly under ground",
                )
            )
        elif floor and ceiling and floor.datum == ceiling.datum and floor.value_m >= ceiling.value_m:
            problems.append(
                Mistake(
                    f"{where}.floor_{floor.datum}_m",
                    f"the floor must be below the ceiling, given {floor.value_m:g} and {ceiling.value_m:g}",
                )
            )
        if floor == Level(0.0, "agl"):
            floor = None
        return floor, ceiling


def _level(agl_m: float | None, amsl_m: float | None) -> Level | None:
    if agl_m is not None:
        return Level(agl_m, "agl")
    return Level(amsl_m, "amsl") if amsl_m is not None else None


def circle(
    name: str, where: str, centre: tuple[float, float], radius_m: float, bounds: Bounds, problems: list[Mistake],
    *, local: bool = False,
) -> ZoneDraft | None:  # fmt: skip
    """A cylinder; None, and new ``problems``, if it is wrong."""
    before = len(problems)
    check_size(radius_m, f"{where}.radius_m", problems)
    if not local:
        check_degrees(centre, f"{where}.center", problems)
    floor, ceiling = bounds.levels(where, problems)
    if len(problems) > before:
        return None
    return ZoneDraft(name, where, (centre,), local, radius_m, floor, ceiling)


def polygon(
    name: str, where: str, points: Sequence[tuple[float, float]], bounds: Bounds, problems: list[Mistake],
    *, local: bool = False, key: str = "polygon", holes: Sequence[Sequence[tuple[float, float]]] = (),
) -> ZoneDraft | None:  # fmt: skip
    """A prism; None, and new ``problems``, if its outline is not simple or its bounds contradict each other."""
    before = len(problems)
    at = f"{where}.{key}" if key else where
    _check_points(points, at, problems, local=local)
    floor, ceiling = bounds.levels(where, problems)
    if len(problems) > before:
        return None
    points, doubt = (points, ()) if local else across(points, len(holes))
    if not local and (wide := wide_fault(points, len(holes))):
        problems.append(Mistake(at, f"zone {name[:60]!r}: {wide}"))
        return None
    ring, fault = outline_of(points, local=local)
    if fault:
        problems.append(Mistake(at, fault))
        return None
    remarks = ((ACROSS_ANTIMERIDIAN, None),) if doubt else ()
    inner = tuple(tuple(hole) for hole in holes)
    return ZoneDraft(name, where, tuple(ring), local, None, floor, ceiling, remarks=remarks, doubt=doubt, holes=inner)


def corridor(
    name: str, where: str, points: Sequence[tuple[float, float]], buffer_m: float, bounds: Bounds,
    problems: list[Mistake], *, local: bool = False, key: str = "line",
) -> ZoneDraft | None:  # fmt: skip
    """All within ``buffer_m`` of a line, as a prism; None, and new ``problems``, if it is wrong."""
    before = len(problems)
    at = f"{where}.{key}" if key else where
    check_size(buffer_m, f"{where}.buffer_m", problems)
    _check_points(points, at, problems, local=local)
    if len(points) > MAX_LINE_POINTS:
        problems.append(Mistake(at, f"has {len(points)} points, more than {MAX_LINE_POINTS}; simplify or split it"))
    elif len(set(points)) < 2:
        problems.append(Mistake(at, f"a line needs at least 2 different points, given {len(set(points))}"))
    elif not local and (wide := wide_fault(points, closed=False)):
        problems.append(Mistake(at, wide))
    floor, ceiling = bounds.levels(where, problems)
    if len(problems) > before:
        return None
    line = tuple(p for i, p in enumerate(points) if i == 0 or p != points[i - 1])
    return ZoneDraft(name, where, line, local, None, floor, ceiling, buffer_m=buffer_m)


def check_size(value_m: float, where: str, problems: list[Mistake]) -> bool:
    """Whether a radius, or a half-width (``where`` ends in ``buffer_m``), is sound; if not, a problem is added."""
    is_buffer = where.endswith("buffer_m")
    most = LARGEST_BUFFER_M if is_buffer else LARGEST_RADIUS_M
    if 0.0 < value_m <= most:
        return True
    words = f"must be above 0 and at most {most:g} (a {'wider' if is_buffer else 'larger'} zone is a polygon)"
    problems.append(Mistake(where, f"{words}, given {value_m:g}"))
    return False


def _check_points(points: Sequence[tuple[float, float]], at: str, problems: list[Mistake], *, local: bool) -> None:
    if len(points) > MAX_VERTICES:
        problems.append(Mistake(at, f"has {len(points)} points, more than {MAX_VERTICES}; simplify it"))
    elif not local:
        # One swapped point means that all are swapped, so that one problem is enough.
        all(check_degrees(point, f"{at}[{i}]", problems) for i, point in enumerate(points))


def check_degrees(
    point: tuple[float, float], where: str, problems: list[Mistake], most_lon_deg: float = MOST_LON_DEG
) -> bool:
    """Whether (latitude, longitude) can be a place; if not, a problem is added, with a guess at swapped numbers.

    The places of zones may have longitudes to `MOST_LON_DEG`, of other points to 180°.
    """
    fault = range_fault(*point, most_lon_deg=most_lon_deg)
    if fault:
        problems.append(Mistake(where, fault, "swapped" if is_swapped(*point) else ""))
    return not fault


def place_zones(drafts: Sequence[ZoneDraft], frame: Frame) -> tuple[list[tuple[ZoneDraft, Zone]], list[ZoneDraft]]:
    """Each draft's zones in the plane, and the drafts that are too far away to matter.

    A polygon cut at the edge of the world may give several zones, or none. Polygons are cut to `FAR_M`: no mission goes
    beyond that.
    """
    placed: list[tuple[ZoneDraft, Zone]] = []
    far: list[ZoneDraft] = []
    corners = 0
    plain = _plain(drafts, frame)
    for draft in drafts:
        try:
            shapes = [plain[id(draft)]] if id(draft) in plain else _shapes(draft, frame)
        except InputError as why:
            raise InputError(f"zone {draft.name[:60]!r}: {why.message}", where=draft.where) from None
        if not shapes:
            far.append(draft)
        draft, shapes = _with_fewer_corners(draft, shapes)
        corners += sum(len(shape.vertices) for shape in shapes if isinstance(shape, Polygon))
        if corners > MOST_ALL_CORNERS and draft.radius_m is None:
            words = (
                f"with this one the zones have {corners} corners, more than {MOST_ALL_CORNERS} together; simplify them"
            )
            fault = Mistake(draft.where, f"zone {draft.name[:60]!r}: {words}")
            if corners > 2 * MOST_ALL_CORNERS:
                raise InputError(
                    f"{fault.message}, or give a file of those around the mission alone (ogr2ogr -spat)",
                    where=draft.where,
                )
            draft = replace(draft, faults=(*draft.faults, fault))
        for i, shape in enumerate(shapes):
            name = draft.name if len(shapes) == 1 else f"{draft.name}/{i + 1}"
            placed.append((draft, Zone(name, shape, draft.floor, draft.ceiling)))
        if draft.doubt:
            fault = Mistake(draft.where, f"zone {draft.name[:60]!r}: {OTHER_SIDE}")
            other = replace(draft, points=draft.doubt, faults=(fault,), remarks=())
            placed += [(other, Zone(draft.name, shape)) for shape in near_polygons(other.points, frame)]
    return placed, far


def _with_fewer_corners(
    draft: ZoneDraft, shapes: Sequence[Circle | Polygon]
) -> tuple[ZoneDraft, Sequence[Circle | Polygon]]:
    """The shapes; a shape with too many corners is drawn wider with fewer of them, and the zone has a remark on that.

    If that does not help, the zone has a fault: it refuses a mission nearby.
    """
    found: list[Circle | Polygon] = []
    for shape in shapes:
        if isinstance(shape, Circle) or len(shape.vertices) <= MOST_ZONE_CORNERS:
            found.append(shape)
            continue
        count, drawn = len(shape.vertices), _wider(shape)
        if drawn is not None:
            fewer = Note("drawn_with_fewer_corners", corners=len(drawn.vertices), given=count)
            draft = replace(draft, remarks=(*draft.remarks, (DRAWN_WIDER, fewer)))
            found.append(drawn)
            continue
        tried = ((more_m, fewer_corners(shape.vertices, more_m, most=MOST_ZONE_CORNERS)) for more_m in MUCH_WIDER_M)
        cures = (f"drawn up to {more_m:g} m wider it has {len(ring)}" for more_m, ring in tried if ring is not None)
        words = f"its outline has {count} corners, more than {MOST_ZONE_CORNERS}; simplify it: "
        words += next(cures, "draw a simpler one around it")
        fault = Mistake(draft.where, f"zone {draft.name[:60]!r}: {words}")
        draft = replace(draft, faults=(*draft.faults, fault))
        found.append(shape)
    return draft, found


def _wider(shape: Polygon) -> Polygon | None:
    """The polygon drawn wider by at most `WIDEST_M` with few enough corners; None if that fails."""
    for more_m in (0.1 * WIDEST_M, WIDEST_M):
        ring = fewer_corners(shape.vertices, more_m, most=MOST_ZONE_CORNERS)
        if ring is not None:
            return Polygon(np.ascontiguousarray(ring))
    return None


def zone_notes(placed: Sequence[tuple[ZoneDraft, object]]) -> list[Note]:
    """The remarks of the zones, beside their drafts, with one note for all zones that share a remark."""
    about: dict[Note, list[Datum]] = {}
    for draft in {id(draft): draft for draft, _ in placed}.values():  # a polygon may be cut into several zones
        for note, given in draft.remarks:
            detail = one_line(given) if isinstance(given, str) else given
            named = Note("zone_and_detail", zone=draft.name, detail=detail) if detail else draft.name
            about.setdefault(note, []).append(named)
    return [note.of(zones=_first(zones)) for note, zones in about.items()]


def _first(zones: list[Datum]) -> tuple[Datum, ...]:
    """The zones that a note names, and how many more there are."""
    more = len(zones) - SHOWN_ZONES
    return (*zones[:SHOWN_ZONES], *([Note("further_zones", count=more)] if more > 0 else []))


def looks_swapped(draft: ZoneDraft, frame: Frame) -> bool:
    """Whether a far zone would be near if latitude and longitude were exchanged."""
    if draft.local or any(abs(lon) > 85.0 for _, lon in draft.points):
        return False
    turned = replace(draft, points=tuple((lon, lat) for lat, lon in draft.points))
    return bool(_shapes(turned, frame))


def uniquely_named(drafts: Sequence[ZoneDraft]) -> list[ZoneDraft]:
    """The drafts with a name of one line each: those in zone files may repeat, and reports need unique names."""
    seen: Counter[str] = Counter()
    named = []
    for draft in drafts:
        name = one_line(draft.name)
        seen[name] += 1
        name = f"{name} #{seen[name]}" if seen[name] > 1 else name
        named.append(draft if name == draft.name else replace(draft, name=name))
    return named


def one_line(text: str) -> str:
    """``text`` for tables, files and terminals: one line, no control characters, no halves of surrogate pairs."""
    return "".join(c if c.isprintable() else " " if c.isspace() else "\ufffd" for c in text).strip()


def zones_sha256(drafts: Sequence[ZoneDraft]) -> str:
    """Hash of the zones' contents, independent of where and in what layout they were written."""
    found = hashlib.sha256()
    for d in drafts:
        plain = [d.name, len(d.points), d.local, d.radius_m, d.buffer_m, d.floor and str(d.floor)]
        found.update(json.dumps([*plain, d.ceiling and str(d.ceiling)]).encode())
        found.update(np.array(d.points, "<f8").tobytes())
        for hole in d.holes if d.keep_in else ():
            found.update(np.array(hole, "<f8").tobytes())
        found.update(b"keep_in" * d.keep_in)
    return found.hexdigest()


def _plain(drafts: Sequence[ZoneDraft], frame: Frame) -> dict[int, Circle | Polygon]:
    """The shapes, by the identity of their drafts, of near zones that need no more than to be projected."""
    found: dict[int, Circle | Polygon] = {}
    circles = [(d, d.radius_m) for d in drafts if d.radius_m is not None and not d.local]
    if circles:
        places = frame.to_plane(*np.array([d.points[0] for d, _ in circles]).T).tolist()
        round_ = [(d, near_circle(place, radius_m)) for (d, radius_m), place in zip(circles, places, strict=True)]
        found = {id(d): circle for d, circle in round_ if circle is not None}
    for great_circles in (False, True):
        some = [
            d
            for d in drafts
            if not (d.local or d.radius_m is not None or d.buffer_m is not None) and d.great_circles is great_circles
        ]
        shapes = plain_polygons([d.points for d in some], frame, great_circles=great_circles)
        found |= {id(d): shape for d, shape in zip(some, shapes, strict=True) if shape is not None}
    return found


def _shapes(draft: ZoneDraft, frame: Frame) -> Sequence[Circle | Polygon]:
    if draft.radius_m is not None:
        centre = draft.points[0] if draft.local else frame.to_plane(*draft.points[0]).tolist()
        circle = near_circle(centre, draft.radius_m)
        return [circle] if circle is not None else []
    if draft.buffer_m is not None:
        return near_corridors(draft.points, draft.buffer_m, frame, local=draft.local, great_circles=draft.great_circles)
    if draft.local:
        return [counter_clockwise(np.asarray(draft.points, float))]
    return near_polygons(draft.points, frame, great_circles=draft.great_circles)
