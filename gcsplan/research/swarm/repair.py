"""Repair of a curve that fails the exact check: a new altitude profile, or a track pushed out sideways.

The push is a dynamic programme over a ribbon around the curve. It chooses a side step at each station, so that
neighbouring points are connected over open ground, and carries the interval of altitudes that the climb limits allow.
The new track gets the taut string's profile through the exact tube, and the exact check decides.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.exact import way_points
from gcsplan.planners.profile.track import Flown, Track, fly, make_track
from gcsplan.planners.simplify import fewer
from gcsplan.research.swarm import scene_kernels as k
from gcsplan.research.swarm.scene import Scene
from gcsplan.world.airspace import Legs, Violation
from gcsplan.world.geometry.path import distances_m, track_length_m

STATIONS, SIDES, REACH = 160, 30, 4
"""Stations along the ribbon; side steps to either side; most side steps between neighbouring stations."""

PUSHES = ((0.03, 0.0), (0.1, 0.0), (0.1, 0.01), (0.3, 0.0), (0.3, 0.01), (0.6, 0.005))
"""Half-widths of the ribbon and additional margin over the floor, as parts of the straight track; tried in turn."""

CORRECTIONS, CORRECTED_M = 12, 0.01
"""Most corrections of a profile after violations in the exact check; metres added to the size of each violation."""

FEWER_POINTS_COST = 1e-4
"""Extra cost that fewer way points may have, as a part of the cost."""


@dataclass(frozen=True, eq=False)
class Repaired:
    """Way points (N, 3) that pass the exact check; ``pushed_m``: largest sideways move of the track."""

    points: Floats
    pushed_m: float


def violations(problem: Problem, points: Floats) -> tuple[Violation, ...]:
    """Violations that the exact check finds on a polyline (N, 3)."""
    return problem.airspace.examine(Legs.of_path(points, problem.limits), problem.limits).violations


def repair(problem: Problem, scene: Scene, samples: Floats, terminals: Indices) -> Repaired | None:
    """A legal path near the curve ``samples`` (S, 3), whose ``terminals`` (indices) stay; None if none is found.

    Tries a new profile over the curve's own track first, then tracks pushed out further and further.
    """
    flat = samples[:, :2]
    points = _with_profile(problem, flat, terminals)
    if points is not None:
        return Repaired(points, 0.0)
    way = track_length_m(scene.terminals)
    for width, margin in PUSHES:
        pushed = _push(problem, scene, flat, terminals, width * way, margin * way)
        if pushed is None:
            continue
        track, at, by = pushed
        points = _with_profile(problem, track, at)
        if points is not None:
            return Repaired(points, by)
    return None


def _with_profile(problem: Problem, flat: Floats, terminals: Indices) -> Floats | None:
    """Way points over a track (N, 2) with the best altitude profile; None if no profile passes the exact check."""
    pinned = np.zeros(len(flat), bool)
    pinned[terminals] = True
    pin_m = np.full(len(flat), np.nan)
    for i, via in zip(terminals[1:-1], problem.via, strict=True):
        pin_m[i] = math.nan if via.amsl_m is None else via.amsl_m
    track = make_track(problem, np.ascontiguousarray(flat), pinned, pin_m)
    with np.errstate(invalid="ignore"):  # over a zone without a top, without a ceiling: inf minus inf
        flown = fly(problem, track)
    if not isinstance(flown, Flown):
        return None
    return _checked(problem, track, flown)


def _checked(problem: Problem, track: Track, flown: Flown) -> Floats | None:
    """Way points that pass the exact check, or None.

    Where the profile is too low or too high the altitude that is needed becomes a door, and the profile is drawn again.
    """
    known: list[tuple[float, float, float]] = []
    for _ in range(CORRECTIONS):
        points, pinned = way_points(problem, track, flown)
        found = violations(problem, points)
        if not found:
            few = fewer(problem, points, pinned, FEWER_POINTS_COST * flown.cost)[0]
            return points if violations(problem, few) else few
        s = distances_m(points)
        for v in found:
            at = float(s[v.leg] + v.fraction * (s[v.leg + 1] - s[v.leg]))
            room = v.by + CORRECTED_M
            if v.kind in ("min_agl", "terrain_clearance"):
                known.append((at, v.amsl_m + room, math.inf))
            elif v.kind in ("max_agl", "max_amsl"):
                known.append((at, -math.inf, v.amsl_m - room))
            else:
                return None
        with np.errstate(invalid="ignore"):
            again = fly(problem, track, known=known)
        if not isinstance(again, Flown):
            return None
        flown = again
    return None


def _push(
    problem: Problem, scene: Scene, flat: Floats, terminals: Indices, half_m: float, margin_m: float
) -> tuple[Floats, Indices, float] | None:
    """Push a track to open places within ``half_m``; return it, the indices of its terminals, and the largest push.

    It is the shortest chain of side steps. A step is open if its middle and its end are, and if the altitudes that can
    be reached along the shortest chain so far include legal ones there. None if no chain is open.
    """
    base, left, at_terminal = _ribbon(flat, terminals, half_m)
    n, m = len(base), 2 * SIDES + 1
    step = half_m / SIDES
    aside = (np.arange(m) - SIDES) * step
    places = base[:, None] + aside[None, :, None] * left[:, None]  # (n, m, 2)
    shifts = np.arange(-REACH, REACH + 1)
    source = np.arange(m)[:, None] - shifts  # (m, t) side at the station before
    legal = (source >= 0) & (source < m)
    source = np.clip(source, 0, m - 1)
    low, high = _room(problem, scene, places, margin_m)
    _pin(problem, low, high, at_terminal)
    up, down = min(problem.limits.max_climb_slope, 1e6), min(problem.limits.max_descent_slope, 1e6)
    cost = np.where(np.arange(m) == SIDES, 0.0, np.inf)
    least, most = np.full(m, problem.start[2]), np.full(m, problem.start[2])
    came = np.zeros((n, m), np.intp)
    rows = np.arange(m)
    for i in range(1, n):
        a, b = places[i - 1][source], np.broadcast_to(places[i][:, None], (*source.shape, 2))
        run = np.hypot(*np.moveaxis(b - a, -1, 0))
        mid_low, mid_high = _room(problem, scene, a + 0.5 * (b - a), margin_m)
        # Altitudes at the middle, then at the station.
        half = 0.5 * run
        lo = np.maximum(mid_low, least[source] - down * half)
        hi = np.minimum(mid_high, most[source] + up * half)
        open_way = legal & (lo <= hi)
        lo, hi = np.maximum(low[i][:, None], lo - down * half), np.minimum(high[i][:, None], hi + up * half)
        open_way &= lo <= hi
        whole = np.where(open_way, cost[source] + run, np.inf)
        best = whole.argmin(axis=1)
        came[i], cost = source[rows, best], whole[rows, best]
        least, most = lo[rows, best], hi[rows, best]
        if not np.isfinite(cost).any():
            return None
    side = SIDES
    if not np.isfinite(cost[side]):
        return None
    sides = [side]
    for i in range(n - 1, 0, -1):
        side = int(came[i, side])
        sides.append(side)
    chosen = np.array(sides[::-1])
    track = places[np.arange(n), chosen]
    track[at_terminal] = flat[terminals]
    return track, at_terminal, float(np.abs(aside[chosen]).max())


def _ribbon(flat: Floats, terminals: Indices, half_m: float) -> tuple[Floats, Floats, Indices]:
    """Stations (n, 2) along a track, unit vectors to the left there (n, 2), and the indices of its terminals.

    A ribbon must not fold: so turns of the track within the half-width are smoothed between terminals.
    """
    parts, at_terminal = [flat[:1]], [0]
    whole = float(distances_m(flat)[-1])
    for a, b in itertools.pairwise(terminals):
        track = _smoothed(flat[a : b + 1], half_m)
        s = distances_m(track)
        count = max(2, round(STATIONS * s[-1] / max(whole, 1e-9)))
        at = np.linspace(0.0, s[-1], count + 1)[1:]
        parts.append(np.stack([np.interp(at, s, track[:, i]) for i in range(2)], axis=-1))
        at_terminal.append(at_terminal[-1] + count)
    base = np.vstack(parts)
    ahead = base[np.minimum(np.arange(len(base)) + 2, len(base) - 1)] - base[np.maximum(np.arange(len(base)) - 2, 0)]
    long = np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-9)
    return base, np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1) / long[:, None], np.array(at_terminal)


def _smoothed(track: Floats, reach_m: float) -> Floats:
    """A track (n, 2) averaged along itself over ``reach_m`` to either side; over less near its ends, which stay."""
    s = distances_m(track)
    count = 400  # parts of the track
    at = np.linspace(0.0, s[-1], count + 1)
    even = np.stack([np.interp(at, s, track[:, i]) for i in range(2)], axis=-1)
    total = np.vstack([np.zeros((1, 2)), np.cumsum(even, axis=0)])
    here = np.arange(count + 1)
    reach = np.minimum(round(reach_m / max(s[-1], 1e-9) * count), np.minimum(here, count - here))
    return np.asarray((total[here + reach + 1] - total[here - reach]) / (2 * reach + 1)[:, None])


def _room(problem: Problem, scene: Scene, places: Floats, margin_m: float) -> tuple[Floats, Floats]:
    """Lowest and highest legal altitude at places (..., 2); the lowest is infinite where a zone closes a place."""
    flat = np.ascontiguousarray(places.reshape(-1, 2))
    air, limits = problem.airspace, problem.limits
    low = air.floor_amsl(flat[:, 0], flat[:, 1], limits) + margin_m
    # The ground between two places is not read, so more is kept from a ceiling that follows it.
    high = air.ceiling_amsl(flat[:, 0], flat[:, 1], limits) - 0.02 * (limits.max_agl_m or 0.0)
    shut = np.empty(len(flat), np.bool_)
    ground = np.nan_to_num(scene.ground(flat))
    k.shut_by_zones(flat, ground, low, np.minimum(high, 1e8), scene.zones, scene.corners, shut)
    low = np.where(shut, np.inf, low)
    return low.reshape(places.shape[:-1]), high.reshape(places.shape[:-1])


def _pin(problem: Problem, low: Floats, high: Floats, at_terminal: Indices) -> None:
    """Close the ribbon at terminals except in its middle, and there all but the altitude of the terminal, if fixed;
    in place."""
    heights = [problem.start[2], *(v.amsl_m for v in problem.via), problem.goal[2]]
    for i, z in zip(at_terminal, heights, strict=True):
        here = low[i, SIDES], high[i, SIDES]
        low[i], high[i] = np.inf, -np.inf
        low[i, SIDES], high[i, SIDES] = here if z is None else (z, z)
