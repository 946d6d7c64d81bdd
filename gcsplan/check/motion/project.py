"""A flight's stretches as straight legs of the plane; terrain-frame stretches as pieces that follow the ground.

Over a bilinear surface the ground under a straight line is a quadratic in each cell. So is the altitude of a leg that
is interpolated above ground: its middle gives its distance from a chord, and its slope is steepest at an end.

Home's ground may have two heights. Relative altitudes count from it, so all of them are uncertain together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.check.motion.stretch import Stretch
from gcsplan.figures import raised
from gcsplan.mavlink.mission.mission import Home
from gcsplan.notes.note import Note
from gcsplan.vehicle import Vehicle
from gcsplan.world.airspace import LegReport, Legs, Violation, ViolationKind
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.terrain.vehicle_terrain import VehicleTerrain
from gcsplan.world.world import World


def spread_at_home_m(home: Home, world: World) -> float:
    """How far the greatest ground at home lies above the least one, m; 0 where they are one or unknown."""
    return world.spread_m(home.lat_e7 / 1e7, home.lon_e7 / 1e7)


def why_unknown(home: Home, vehicle: Vehicle, world: World) -> Note | None:
    """Why altitudes above home cannot be judged: its ground is not one number within the altitude error; else None."""
    spread_m, error_m = spread_at_home_m(home, world), vehicle.limits.altitude_error_m
    if spread_m <= error_m:
        return None
    lat, lon = home.lat_e7 / 1e7, home.lon_e7 / 1e7
    low_m = world.ground_amsl(lat, lon)
    return Note(
        "home_has_two_heights", lat=lat, lon=lon, low_m=low_m, high_m=low_m + spread_m, spread_m=raised(spread_m, 1)
    )


def with_error_of_home(vehicle: Vehicle, home: Home, world: World) -> Vehicle:
    """The vehicle with an altitude error that holds the uncertainty of home's ground too.

    Home is taken for its least height: from a higher one the whole mission is flown higher.
    """
    spread_m = spread_at_home_m(home, world)
    if spread_m == 0.0:
        return vehicle
    limits = vehicle.limits
    return replace(vehicle, limits=replace(limits, altitude_error_m=limits.altitude_error_m + spread_m))


GROUND_SAG_M = 0.05
"""How far a chord may lie from the quadratic that it replaces, m; added to the altitude error of its piece."""

GRID_BOW_M = 0.01
"""How far lines straight in the plane may lie from lines straight in the grid, m, when legs are cut at cell borders."""

SHORTEST_PIECE_M = 1e-3
MOST_GROUND_PARTS = 200
"""Most parts into which a piece of a terrain-frame leg is cut to keep `GROUND_SAG_M`."""

NOISE_DEG = 1e-6
_STRAIGHT = (math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class PlaneLegs:
    """The legs of all stretches in the plane; ``owner`` (N,) is the index of each leg's stretch.

    ``steep`` (N, 2): steepest rise over run, up and down (negative), if that is not the leg's own slope; else NaN.
    ``unread``: the terrain-frame stretches over ground that the vehicle's grid does not know; they stay straight.
    """

    legs: Legs
    owner: Indices
    steep: Floats
    unread: tuple[int, ...] = ()


def ends_of(stretches: Sequence[Stretch], world: World) -> tuple[Floats, Floats]:
    """(N, 2, 3) start and end of each stretch: as latitude, longitude, AMSL, and as metres of the plane."""
    places = np.array([(s.start, s.end) for s in stretches])
    plane = np.empty_like(places)
    plane[..., :2] = world.frame.to_plane(places[..., 0], places[..., 1])
    plane[..., 2] = places[..., 2]
    return places, plane


def legs_in_plane(stretches: Sequence[Stretch], limits: Limits, world: World, terrain_error_m: float) -> PlaneLegs:
    """The stretches as straight legs of the plane, with their errors; terrain-frame stretches in many pieces."""
    places, plane = ends_of(stretches, world)
    bow_m = world.frame.bow_m(places[:, 0, :2], places[:, 1, :2])
    track = limits.track_error_m + bow_m + np.array([s.reach_m for s in stretches])
    height = limits.altitude_error_m + np.array([s.band_m + (terrain_error_m if s.terrain else 0.0) for s in stretches])
    column = np.array([s.column for s in stretches])
    if not any(s.terrain for s in stretches):
        slopes = np.array([s.steep or _STRAIGHT for s in stretches])
        return PlaneLegs(Legs(plane[:, 0], plane[:, 1], column, track, height), np.arange(len(stretches)), slopes)
    starts, ends, counts, deviation, steep = [], [], [], [], []
    unread: list[int] = []
    for i, s in enumerate(stretches):
        followed = follow_ground(plane[i], world.vehicle_terrain) if s.terrain else None
        if s.terrain and followed is None:
            unread.append(i)
        if s.terrain and followed is not None and world.airspace.surface.differs:
            begins, finishes, off_m, slopes = followed
            spread = [world.vehicle_terrain.spread_at(p[:, 0], p[:, 1]) for p in (begins, finishes)]
            followed = begins, finishes, off_m + np.maximum(*spread), slopes
        begins, finishes, off_m, slopes = followed or (
            plane[i, :1],
            plane[i, 1:],
            np.zeros(1),
            np.array([s.steep or _STRAIGHT]),
        )
        starts.append(begins)
        ends.append(finishes)
        counts.append(len(begins))
        deviation.append(off_m)
        steep.append(slopes)
    owner = np.repeat(np.arange(len(stretches)), counts)
    legs = Legs(
        np.concatenate(starts), np.concatenate(ends), column[owner], track[owner],
        height[owner] + np.concatenate(deviation),
    )  # fmt: skip
    return PlaneLegs(legs, owner, np.concatenate(steep), tuple(unread))


Followed = tuple[Floats, Floats, Floats, Floats]
"""Starts and ends of pieces (N, 3), their deviations, m (N,), and `steep` (N, 2)."""


def follow_ground(ends: Floats, terrain: VehicleTerrain) -> Followed | None:
    """A terrain-frame leg (2, 3) as straight pieces over the ground that the vehicle reads; None where it reads none.

    Height above that ground is interpolated between the ends.
    """
    run_m = float(np.hypot(*(ends[1, :2] - ends[0, :2])))
    if run_m <= SHORTEST_PIECE_M:
        return ends[:1], ends[1:], np.zeros(1), np.full((1, 2), np.nan)
    parts = terrain.pieces(ends[:, :2])
    if parts is None:
        return None
    (first, last), xy = (parts[0][2], parts[-1][2]), ends[:, :2]
    agl = np.array([ends[0, 2] - float(first.ground_at(*xy[0])), ends[1, 2] - float(last.ground_at(*xy[1]))])
    found = []
    for a, b, surface in parts:
        if (b - a) * run_m <= SHORTEST_PIECE_M:
            continue
        piece = _follow(
            xy[0] + a * (xy[1] - xy[0]),
            xy[0] + b * (xy[1] - xy[0]),
            surface,
            agl[0] + np.array([a, b]) * (agl[1] - agl[0]),
        )
        if piece is None:
            return None
        found.append(piece)
    starts, finishes, off, steep = (np.concatenate(x) for x in zip(*found, strict=True))
    starts[0], finishes[-1] = ends
    return starts, finishes, off, steep


def _follow(begin: Floats, end: Floats, surface: Surface, agl: Floats) -> Followed | None:
    """The piece of a leg over one surface; ``agl`` (2,) above it at its ends."""
    ends = np.stack([begin, end])
    run_m = float(np.hypot(*(end - begin)))
    t = _cell_cuts(ends, surface, run_m)

    def altitude(f: Floats) -> Floats:
        en = begin + f[:, None] * (end - begin)
        return np.asarray(surface.ground_at(en[:, 0], en[:, 1]) + agl[0] + f * (agl[1] - agl[0]))

    z, middle = altitude(t), altitude(0.5 * (t[1:] + t[:-1]))
    if np.isnan(z).any() or np.isnan(middle).any():
        return None
    sag = middle - 0.5 * (z[1:] + z[:-1])
    long_m = np.diff(t) * run_m
    slope, bend = np.diff(z) / long_m, 4.0 * np.abs(sag) / long_m
    parts = np.clip(np.ceil(np.sqrt(np.abs(sag) / GROUND_SAG_M)), 1, MOST_GROUND_PARTS).astype(int)
    piece = np.repeat(np.arange(len(parts)), parts)
    begun = np.concatenate([[0], np.cumsum(parts)[:-1]])
    share = (np.arange(len(piece)) - begun[piece]) / parts[piece]
    f = np.append(t[:-1][piece] + np.diff(t)[piece] * share, 1.0)
    # Points on the quadratic itself (chord plus four times its sag at the middle), so that neighbouring pieces meet.
    z = np.append(z[:-1][piece] + (np.diff(z)[piece] + 4.0 * sag[piece] * (1.0 - share)) * share, z[-1])
    points = np.column_stack([begin + f[:, None] * (end - begin), z])
    off = np.abs(sag) / parts**2
    return points[:-1], points[1:], off[piece], np.column_stack([slope + bend, slope - bend])[piece]


def _cell_cuts(ends: Floats, surface: Surface, run_m: float) -> Floats:
    """Where a line crosses cell borders: rising parts from 0 to 1, at least `SHORTEST_PIECE_M` apart."""
    way = ends[1, :2] - ends[0, :2]
    middle, both = surface.grid(*(ends[0, :2] + 0.5 * way)), surface.grid(ends[:, 0], ends[:, 1])
    bow_m = float(np.hypot(*((middle - both.mean(axis=0)) * surface.grid.metres_per_cell(*ends[0, :2]))))
    parts = max(1, math.ceil(math.sqrt(bow_m / GRID_BOW_M)))
    f = np.linspace(0.0, 1.0, parts + 1)
    grid = surface.grid(*(ends[0, :2] + f[:, None] * way).T)
    cuts = [f]
    for axis in (0, 1):
        for k in range(parts):
            a, b = float(grid[k, axis]), float(grid[k + 1, axis])
            lines = np.arange(math.ceil(min(a, b)), math.floor(max(a, b)) + 1)
            if a != b:
                cuts.append((k + (lines - a) / (b - a)) / parts)
    t = np.unique(np.clip(np.concatenate(cuts), 0.0, 1.0))
    far = np.diff(t) * run_m > SHORTEST_PIECE_M
    return np.concatenate([t[:1], t[1:-1][far[:-1] & (1.0 - t[1:-1] > SHORTEST_PIECE_M / run_m)], t[-1:]])


def steep_report(plane: PlaneLegs, report: LegReport, limits: Limits) -> LegReport:
    """``report`` with the steepest angle of each piece that follows the ground, instead of its chord's angle."""
    mine = np.flatnonzero(~np.isnan(plane.steep[:, 0]) & ~plane.legs.column)
    if not len(mine):
        return report
    angles = np.degrees(np.arctan(plane.steep[mine]))
    climb = report.climb_deg.copy()
    climb[mine] = np.where(angles[:, 0] >= -angles[:, 1], angles[:, 0], angles[:, 1])
    own = set(mine.tolist())
    violations = [v for v in report.violations if v.leg not in own or v.kind not in ("climb", "descent")]
    tried: tuple[tuple[ViolationKind, float, Floats], ...] = (
        ("climb", limits.max_climb_deg, angles[:, 0]), ("descent", limits.max_descent_deg, -angles[:, 1]),
    )  # fmt: skip
    for kind, limit, found in tried:
        worst: dict[int, int] = {}
        for k in np.flatnonzero(found > limit + NOISE_DEG).tolist():
            owner = int(plane.owner[mine[k]])
            if owner not in worst or found[k] > found[worst[owner]]:
                worst[owner] = k
        for k in worst.values():
            leg, value = int(mine[k]), float(found[k])
            east, north, amsl = plane.legs.start[leg].tolist()
            violations.append(Violation(leg, kind, 0.0, east, north, amsl, value, limit, value - limit, "deg"))
    return replace(report, climb_deg=climb, violations=tuple(sorted(violations, key=lambda v: v.leg)))
