"""How near a mission comes to the limits that it keeps, and by how much it breaks the others.

`nearest_misses`: the smallest margin to each limit, and its place. `nearest_pass`: how high the mission passes over a
zone, or how low under one: the distance that the horizontal one does not tell. `enough`: by how much a limit is broken.
A leg that is moved by this depth keeps the limit. The exact check resolves the ground beside a leg only as finely as a
yes or no needs, so its depth of a violation is exact to about a tenth. The depth reported here was tried: the leg,
moved by it, passes, unless `MOST_TRIES` steps found no such depth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.motion.stretch import Stretch
from gcsplan.notes.note import Note
from gcsplan.vehicle import Vehicle
from gcsplan.world.airspace import Airspace, LegReport, Legs, Violation
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle
from gcsplan.world.world import World

MOST_ZONES = 3
"""The number of zones reported, nearest first."""


@dataclass(frozen=True, slots=True)
class Miss:
    """The smallest margin to one limit (for zones: to one zone), after errors and clearances are subtracted.

    ``room``: the margin, negative if the limit is broken. ``value``: heights after the errors are subtracted, as in a
    finding; angles and distances to zones are those of the line itself. The place is where the margin is smallest.
    """

    kind: str
    room: float
    value: float
    limit: float
    unit: str
    seq: int
    lat_deg: float
    lon_deg: float
    amsl_m: float
    zone: str = ""

    @property
    def note(self) -> Note:
        """The note on this margin."""
        spare = self.room >= 0.0
        room = abs(self.room)
        if self.kind in NEAR_ANGLES:
            left = Note("spare_angle", room_deg=room) if spare else Note("broken_angle", room_deg=room)
            return Note(
                NEAR_ANGLES[self.kind], value_deg=self.value, limit_deg=self.limit, left=left, seq=self.seq,
                lat=self.lat_deg, lon=self.lon_deg, amsl_m=self.amsl_m,
            )  # fmt: skip
        if not self.zone:
            left = Note("spare_height", room_m=room) if spare else Note("broken_height", room_m=room)
            return Note(
                NEAR_HEIGHTS[self.kind], value_m=self.value, limit_m=self.limit, left=left, seq=self.seq,
                lat=self.lat_deg, lon=self.lon_deg, amsl_m=self.amsl_m,
            )  # fmt: skip
        left = Note("spare_distance", room_m=room) if spare else Note("broken_distance", room_m=room)
        return Note(
            "nearest_zone" if self.value >= 0.0 else "nearest_inside_zone", zone=self.zone, value_m=abs(self.value),
            limit_m=self.limit, left=left, seq=self.seq, lat=self.lat_deg, lon=self.lon_deg, amsl_m=self.amsl_m,
        )  # fmt: skip


NEAR_HEIGHTS = {
    "min_agl": "lowest_above_ground", "max_agl": "highest_above_ground", "max_amsl": "highest_altitude",
    "terrain_clearance": "lowest_within_clearance",
}  # fmt: skip
NEAR_ANGLES = {"climb": "steepest_climb", "descent": "steepest_descent"}
"""The notes on limits of height and of angle, by kind."""
LIFT_M = 50_000.0
"""An added altitude error, m, that breaks every limit of height on every leg; it breaks a limit by less the larger the
margin."""


def nearest_misses(
    stretches: Sequence[Stretch], legs: Legs, owner: Indices, report: LegReport, vehicle: Vehicle, world: World
) -> tuple[Miss, ...]:
    """Return a `Miss` for each limit that the vehicle has, and for the `MOST_ZONES` zones that it comes nearest to.

    ``owner`` (N,): index of each leg's stretch. Heights are those of the exact check: the lowest or highest within the
    track error.
    """
    limits = vehicle.limits
    run = np.hypot(*(legs.end - legs.start)[:, :2].T)
    found = _heights(stretches, legs, owner, vehicle, world)

    def least(kind: str, room: Floats, value: Floats, limit: float, unit: str, at: Floats, zone: str = "") -> None:
        leg = int(room.argmin())
        east, north, amsl = legs.start[leg] + float(at[leg]) * (legs.end[leg] - legs.start[leg])
        lat, lon = (float(x) for x in world.frame.to_degrees(east, north))
        seq = stretches[int(owner[leg])].seq
        found.append(Miss(kind, float(room[leg]), float(value[leg]), limit, unit, seq, lat, lon, float(amsl), zone))

    slanted = ~legs.column & (run > 0.0)
    for kind, sign, limit in (("climb", 1.0, limits.max_climb_deg), ("descent", -1.0, limits.max_descent_deg)):
        angle = np.where(slanted, sign * report.climb_deg, -1.0)
        if limit < 90.0 and angle.max() > 0.0:
            least(kind, limit - angle, angle, limit, "°", np.full(len(run), 0.5))
    near = report.zone_clearance_m / world.airspace.scale
    reach = limits.horizontal_clearance_m
    met = [k for k in dict.fromkeys(report.nearest_zone.tolist()) if k >= 0]
    for k in sorted(met, key=lambda k: float(near[report.nearest_zone == k].min()))[:MOST_ZONES]:
        distance = np.where(report.nearest_zone == k, near, np.inf)
        # The distance is a lower bound: where no violation is reported, the leg keeps its distance.
        room, at = np.maximum(distance - legs.track_error_m - reach, 0.0), np.zeros(len(run))
        for v in report.violations:  # inside a zone the reported clearance is 0 at any depth
            if v.kind == "zone" and v.zone == k:
                room[v.leg], distance[v.leg] = -v.by, v.value
        leg = int(room.argmin())
        at[leg] = _nearest_part(legs.start[leg], legs.end[leg], world, k)
        least("zone", room, distance, reach, "m", at, world.airspace.zones[k].name)
    return tuple(found)


def _heights(stretches: Sequence[Stretch], legs: Legs, owner: Indices, vehicle: Vehicle, world: World) -> list[Miss]:
    limits = vehicle.limits
    lifted = replace(legs, altitude_error_m=legs.altitude_error_m + LIFT_M)
    worst: dict[str, Violation] = {}
    for v in world.airspace.examine(lifted, limits).violations:
        if v.kind in NEAR_HEIGHTS:
            worst[v.kind] = max(worst.get(v.kind, v), v, key=lambda w: w.by)
    limits_m = {"min_agl": limits.min_agl_m, "max_agl": limits.max_agl_m or 0.0, "max_amsl": limits.max_amsl_m or 0.0}
    found = []
    for kind in NEAR_HEIGHTS:
        if (found_one := worst.get(kind)) is None or abs(found_one.by) > 1.5 * LIFT_M:
            continue
        room, limit = LIFT_M - found_one.by, limits_m.get(kind, 0.0)
        value = limit - room if kind in ("max_agl", "max_amsl") else limit + room
        lat, lon = (float(x) for x in world.frame.to_degrees(found_one.east_m, found_one.north_m))
        seq = stretches[int(owner[found_one.leg])].seq
        found.append(Miss(kind, room, value, limit, "m", seq, lat, lon, found_one.amsl_m))
    return found


def _nearest_part(start: Floats, end: Floats, world: World, zone: int) -> float:
    """The part of a leg, 0 to 1, at which it is nearest to a zone's outline, seen from above."""
    shape = world.airspace.zones[zone].shape
    way = (end - start)[:2]
    square = float(way @ way)
    if square == 0.0:
        return 0.0
    if isinstance(shape, Circle):
        return min(max(float((np.array([shape.east_m, shape.north_m]) - start[:2]) @ way) / square, 0.0), 1.0)
    t = np.linspace(0.0, 1.0, 101)
    points = start[:2] + t[:, None] * way
    a, b = shape.vertices, np.roll(shape.vertices, -1, axis=0)
    best, part = math.inf, 0.0
    for p, f in zip(points, t.tolist(), strict=True):
        along = np.clip(((p - a) * (b - a)).sum(1) / np.maximum(((b - a) ** 2).sum(1), 1e-12), 0.0, 1.0)
        off = float(np.hypot(*(p - a - along[:, None] * (b - a)).T).min())
        if off < best:
            best, part = off, f
    return part


FARTHEST_M, WITHIN_M = 1000.0, 0.002
"""The greatest height of a pass that gets a note, m; the error of that height, m."""


@dataclass(frozen=True, slots=True)
class ZonePass:
    """The least height of the mission's line over (``over``) or under a zone within its outline, seen from above."""

    seq: int
    zone: str
    height_m: float
    over: bool
    lat_deg: float
    lon_deg: float

    @property
    def side(self) -> str:
        """``over`` or ``under``."""
        return "over" if self.over else "under"


def nearest_pass(
    stretches: Sequence[Stretch], legs: Legs, owner: Indices, limits: Limits, world: World
) -> ZonePass | None:  # fmt: skip
    """The nearest pass over or under a zone; None if there is none, or if the line leads into a zone.

    ``owner`` (N,): index of each leg's stretch. The exact check of the legs, without errors and clearance to the side,
    finds the largest altitude error that passes: that height at least is free between the line and each zone.
    """
    air = world.airspace
    near = np.flatnonzero(_meets_box(legs, air.zone_table.box_m))
    if not len(near):
        return None
    free = replace(
        limits, horizontal_clearance_m=0.0, vertical_clearance_m=0.0, min_agl_m=0.0, max_agl_m=None, max_amsl_m=None
    )
    some = Legs(legs.start[near], legs.end[near], legs.column[near], np.zeros(len(near)), np.zeros(len(near)))

    def hit(error_m: float) -> Violation | None:
        lifted = replace(some, altitude_error_m=np.full(len(near), error_m))
        return next((v for v in air.examine(lifted, free).violations if v.kind == "zone"), None)

    found, clear_m, hits_m = hit(FARTHEST_M), 0.0, FARTHEST_M
    if found is None or hit(0.0) is not None:
        return None
    while hits_m - clear_m > WITHIN_M:
        middle = 0.5 * (clear_m + hits_m)
        v = hit(middle)
        clear_m, hits_m, found = (middle, hits_m, found) if v is None else (clear_m, middle, v)
    ground = float(air.surface.ground_at(found.east_m, found.north_m))
    floor, ceiling = (float(levels[found.zone]) for levels in air.zone_table.levels_m(ground_m=ground))
    lat, lon = (float(x) for x in world.frame.to_degrees(found.east_m, found.north_m))
    over = found.amsl_m - ceiling >= floor - found.amsl_m
    seq = stretches[int(owner[near[found.leg]])].seq
    return ZonePass(seq, air.zones[found.zone].name, clear_m, over, lat, lon)


def _meets_box(legs: Legs, boxes: Floats) -> Bools:
    """(N,) whether a leg's box meets that of a zone, (Z, 4) west, south, east, north."""
    low, high = (f(legs.start[:, :2], legs.end[:, :2]) for f in (np.minimum, np.maximum))
    met = np.zeros(len(low), np.bool_)
    all_low, all_high = low.min(axis=0, initial=np.inf), high.max(axis=0, initial=-np.inf)
    for west, south, east, north in boxes[((boxes[:, :2] <= all_high) & (boxes[:, 2:] >= all_low)).all(axis=1)]:
        met |= (low <= (east, north)).all(axis=1) & (high >= (west, south)).all(axis=1)
    return met


LIFT_SIGN = {"min_agl": 1.0, "terrain_clearance": 1.0, "max_agl": -1.0}
"""The direction in which a leg is moved to keep a limit of height: 1 up, −1 down."""

MOST_TRIES = 8
LEAST_PART = 0.95
"""The part of a depth that suffices which is tried next, at least: the kernel's depth is mostly exact to 1 %."""

FINE_PART = 1 / 200
"""A depth that suffices is the answer if this part less of it does not."""

CENTIMETRE = 0.01


def rounded_up(by: float) -> float:
    """``by`` rounded up to whole hundredths; unchanged if it is not finite or is 1e9 or more."""
    return round(math.ceil(by * 100.0 - 1e-7) / 100.0, 2) if math.isfinite(by) and by < 1e9 else by


def enough(v: Violation, broken: Indices, legs: Legs, limits: Limits, air: Airspace) -> Violation:
    """``v`` with a ``by`` in hundredths that is enough for all of ``broken``, the legs that break the same limit."""
    if v.kind == "coverage":
        return v
    by = _lift(v, broken, legs, limits, air) if v.kind in LIFT_SIGN else rounded_up(v.by)
    below = v.kind in ("min_agl", "terrain_clearance", "zone")
    return replace(v, by=by, value=v.limit - by if below else v.limit + by)


def _lift(v: Violation, broken: Indices, legs: Legs, limits: Limits, air: Airspace) -> float:
    """The smallest sufficient move found by trial, in metres: up, or down under a ceiling."""
    alone = Limits(
        min_agl_m=limits.min_agl_m if v.kind == "min_agl" else -1e9,
        max_agl_m=limits.max_agl_m if v.kind == "max_agl" else None,
        horizontal_clearance_m=limits.horizontal_clearance_m if v.kind == "terrain_clearance" else 0.0,
    )

    def left(by: float) -> float:
        lift = np.array([0.0, 0.0, LIFT_SIGN[v.kind] * by])
        moved = Legs(
            legs.start[broken] + lift, legs.end[broken] + lift, legs.column[broken], legs.track_error_m[broken],
            legs.altitude_error_m[broken],
        )  # fmt: skip
        return air.deepest(moved, alone, v.kind)

    low, by = 0.0, rounded_up(v.by)
    for _ in range(MOST_TRIES):
        missing = left(by)
        if missing <= 0.0:
            break
        low, by = by, rounded_up(by + max(missing, CENTIMETRE))
    for _ in range(MOST_TRIES):
        less = rounded_up(max(0.5 * (low + by), LEAST_PART * by))
        if by - low <= FINE_PART * by or not low < less < by:
            break
        low, by = (low, less) if left(less) <= 0.0 else (less, by)
    return by
