"""A mission's line as samples, for drawing and for the pointer; the check itself never samples."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.verdict import Verdict
from gcsplan.fleet.arrival import Slot
from gcsplan.mavlink.mission.mission import TERRAIN
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Zone
from gcsplan.world.world import World

TERRAIN_FRAMES = (TERRAIN, 11)
MOST_SAMPLES = 12_000
"""Samples of all vehicles together; a few more if there are many legs."""


@dataclass(frozen=True, eq=False)
class TrackLine:
    """One flown line as (N,) samples, metres; the ends of every leg are among them.

    ``run_m`` is the horizontal distance so far. ``ground_m`` and ``top_m`` (with obstacles) are NaN where unknown.
    ``floor_m`` and ``ceiling_m`` are the lowest and highest altitude that terrain and limits allow there, errors taken
    off (columns are exempt from the floor). ``leg`` is the index of the leg in the verdict; ``end`` marks the last
    sample of each leg. ``time_s`` is since take-off, ``used_j`` the energy so far.
    """

    run_m: Floats
    east_m: Floats
    north_m: Floats
    amsl_m: Floats
    ground_m: Floats
    top_m: Floats
    floor_m: Floats
    ceiling_m: Floats
    time_s: Floats
    used_j: Floats
    leg: Indices
    end: Bools

    @property
    def length_m(self) -> float:
        """Horizontal length, m."""
        return float(self.run_m[-1])


def line_of(
    verdict: Verdict, world: World, limits: Limits, *, samples: int = 1200, slot: Slot | None = None
) -> TrackLine | None:
    """The samples of a verdict's legs; None if it has none (nothing could be followed).

    ``slot``: the vehicle's part of the time table, see `Verdict.clock_s`.
    """
    legs = verdict.legs
    if not legs:
        return None
    places = np.array([(leg.start, leg.end) for leg in legs])
    plane = world.frame.to_plane(places[..., 0], places[..., 1])
    horizontal = np.array([leg.horizontal_m for leg in legs])
    step = max(float(horizontal.sum()) / samples, 1e-6)
    surface = world.airspace.surface
    items = verdict.mission.wire_items()
    columns: list[tuple[Floats, ...]] = []
    before = np.concatenate([[0.0], np.cumsum(horizontal)])
    clock = verdict.clock_s(slot)
    spent = np.concatenate([[0.0], np.cumsum([leg.energy_j for leg in legs])])
    for i, leg in enumerate(legs):
        t = np.linspace(0.0, 1.0, max(2, math.ceil(horizontal[i] / step) + 1))
        en = plane[i, 0] + t[:, None] * (plane[i, 1] - plane[i, 0])
        z = leg.start[2] + t * (leg.end[2] - leg.start[2])
        frame = items[leg.seq].frame if leg.seq < len(items) else 0
        if frame in TERRAIN_FRAMES and leg.kind == "cruise":
            ground = world.vehicle_terrain.ground_at(en[:, 0], en[:, 1])
            agl = leg.start[2] - ground[0] + t * (leg.end[2] - ground[-1] - leg.start[2] + ground[0])
            z = np.where(np.isnan(ground + agl), z, ground + agl)
        columns.append(
            (
                before[i] + t * horizontal[i], en[:, 0], en[:, 1], z,
                clock[i] - (1.0 - t) * leg.time_s, spent[i] + t * leg.energy_j,
                np.full(len(t), float(i)), np.arange(len(t)) == len(t) - 1,
            )
        )  # fmt: skip
    run, east, north, amsl, time_s, used, index, end = (np.concatenate(c) for c in zip(*columns, strict=True))
    return TrackLine(
        run, east, north, amsl, surface.ground_at(east, north), surface.top_at(east, north),
        world.airspace.floor_amsl(east, north, limits), world.airspace.ceiling_amsl(east, north, limits),
        time_s, used, index.astype(np.intp), end.astype(np.bool_),
    )  # fmt: skip


def distance_m(zone: Zone, east_m: Floats, north_m: Floats) -> Floats:
    """(N,) horizontal distance from a zone's shape, negative inside."""
    shape = zone.shape
    if isinstance(shape, Circle):
        return np.asarray(np.hypot(east_m - shape.east_m, north_m - shape.north_m) - shape.radius_m)
    best, inside = np.full(len(east_m), np.inf), np.zeros(len(east_m), np.bool_)
    corners = shape.vertices
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along, here = b - a, np.column_stack([east_m, north_m]) - a
        t = np.clip(here @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        best = np.minimum(best, np.hypot(*(here - t[:, None] * along).T))
        crosses = (a[1] > north_m) != (b[1] > north_m)
        if along[1] != 0.0:
            inside ^= crosses & (east_m < a[0] + (north_m - a[1]) / along[1] * along[0])
    return np.where(inside, -best, best)


def level_amsl(level: Level | None, ground_m: Floats, none: float) -> Floats:
    """(N,) a zone's floor or ceiling over ``ground_m``, AMSL; ``none`` if there is no such level."""
    if level is None:
        return np.full(len(ground_m), none)
    return ground_m + level.value_m if level.datum == "agl" else np.full(len(ground_m), level.value_m)


@dataclass(frozen=True, eq=False)
class Passage:
    """A zone whose shape and clearance a line passes: above its ceiling, below its floor, or inside.

    ``over_m`` is the least height above its ceiling, ``under_m`` the least depth below its floor, over the samples
    within the clearance; None if the line does not pass there. ``first``, ``last`` are samples, both included.
    """

    zone: Zone
    first: int
    last: int
    over_m: float | None
    under_m: float | None


def passages(line: TrackLine, zones: tuple[Zone, ...], reach_m: float) -> list[Passage]:
    """The passages of ``line`` within ``reach_m`` of each zone's shape, in the order flown."""
    found = []
    box = (line.east_m.min(), line.north_m.min(), line.east_m.max(), line.north_m.max())
    for zone in zones:
        west, south, east, north = zone.bounds
        if west - reach_m > box[2] or east + reach_m < box[0] or south - reach_m > box[3] or north + reach_m < box[1]:
            continue
        near = distance_m(zone, line.east_m, line.north_m) < reach_m
        edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(np.int8)))
        floor = level_amsl(zone.floor, line.ground_m, -np.inf)
        ceiling = level_amsl(zone.ceiling, line.ground_m, np.inf)
        for first, stop in edges.reshape(-1, 2):
            part = slice(first, stop)
            over, under = line.amsl_m[part] - ceiling[part], floor[part] - line.amsl_m[part]
            found.append(
                Passage(
                    zone, int(first), int(stop) - 1,
                    float(np.nanmin(over)) if (over >= under).all() and np.isfinite(over).any() else None,
                    float(np.nanmin(under)) if (under > over).all() and np.isfinite(under).any() else None,
                )
            )  # fmt: skip
    return sorted(found, key=lambda p: p.first)
