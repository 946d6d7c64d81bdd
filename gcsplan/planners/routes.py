"""From a lattice to tracks that hold: search, test exactly, tell the lattice what it got wrong, search again."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.lattice import Lattice, Links, make_lattice, make_links, terminals
from gcsplan.planners.problem import Problem
from gcsplan.planners.search import Found, Label, search
from gcsplan.planners.track import Flown, Obstruction, Track, fly, make_track

Floats = NDArray[np.float64]

RETRIES = 12
"""Searches for one route; each follows an exact test that failed and changed the lattice."""


@dataclass(frozen=True, slots=True)
class Level:
    """How widely and how finely to look: ``detour`` in times the straight way, about ``nodes`` nodes."""

    detour: float
    nodes: int


LEVELS = (Level(1.35, 25_000), Level(2.0, 60_000), Level(math.inf, 120_000), Level(math.inf, 300_000))


def coverage(problem: Problem) -> tuple[float, float, float, float]:
    """West, south, east, north of the ground that is known about."""
    rows, cols = problem.airspace.surface.ground_m.shape
    # Edges of a raster in degrees bow in the plane: their middles count too.
    c, r = np.meshgrid((0.0, 0.5 * (cols - 1), cols - 1.0), (0.0, 0.5 * (rows - 1), rows - 1.0))
    corners = problem.airspace.surface.grid.to_plane(c.ravel(), r.ravel())
    west, south = corners.min(axis=0)
    east, north = corners.max(axis=0)
    return float(west), float(south), float(east), float(north)


def frame_of(problem: Problem, level: Level) -> tuple[tuple[float, float, float, float], float]:
    """Box and spacing of a lattice for ``level``."""
    west, south, east, north = coverage(problem)
    stops = np.array(terminals(problem))
    way = float(np.hypot(*np.diff(stops, axis=0).T).sum())
    # No ellipse of a detour reaches farther from its ends than this; a whole box reaches four ways at most.
    out = (0.5 * (level.detour - 1.0) if math.isfinite(level.detour) else 4.0) * way + 1.0
    if math.isfinite(level.detour):
        out = max(out, 0.5 * way * math.sqrt(level.detour**2 - 1.0))
    low, high = stops.min(axis=0) - out, stops.max(axis=0) + out
    box = (max(west, low[0]), max(south, low[1]), min(east, high[0]), min(north, high[1]))
    area = max(box[2] - box[0], 1e-3) * max(box[3] - box[1], 1e-3)
    cell = float(problem.airspace.surface.grid.metres_per_cell(*stops[0]).min())
    step = max(math.sqrt(area / level.nodes), min(cell, way) / 8.0)
    return box, step


@dataclass(eq=False, slots=True)
class Router:
    """A lattice with its terminals, and what the exact test last found on it."""

    problem: Problem
    lattice: Lattice
    stops: list[tuple[float, float]]
    links: list[Links]
    climb_factor: float = 1.0
    last: Obstruction | None = None
    last_place: Floats | None = field(default=None)

    @classmethod
    def at(cls, problem: Problem, level: Level) -> Router:
        """Build the lattice of ``level``."""
        box, step = frame_of(problem, level)
        lattice = make_lattice(problem, box, step, level.detour)
        stops = terminals(problem)
        heights = [problem.start[2], *(v.amsl_m for v in problem.via), problem.goal[2]]
        links = [make_links(problem, lattice, s, z) for s, z in zip(stops, heights, strict=True)]
        return cls(problem, lattice, stops, links)

    def way(self, cap_m: float = math.inf, weight: float = 0.0) -> Floats | None:
        """(N, 2) places of the best way over the lattice under ``cap_m``, through every stop; None if there is none."""
        found = self.labels(cap_m, weight)
        return found[0].places if found else None

    def labels(self, cap_m: float, weight: float) -> tuple[Label, ...]:
        """How the goal is reached, cheapest first."""
        p = self.problem
        z = p.start[2]
        labels: tuple[Label, ...] = (Label(0.0, z, z, z, z, np.array([self.stops[0]])),)
        ranges = [*((-math.inf, math.inf) if v.amsl_m is None else (v.amsl_m, v.amsl_m) for v in p.via)]
        ranges.append((p.goal[2], p.goal[2]))
        for k, goal_m in enumerate(ranges):
            free = math.isinf(goal_m[0])
            found: Found = search(
                self.lattice,
                list(labels),
                self.stops[k],
                self.stops[k + 1],
                self.links[k],
                self.links[k + 1],
                goal_m,
                cap_m=cap_m,
                climb_slope=p.limits.max_climb_slope * self.climb_factor,
                descent_slope=p.limits.max_descent_slope * self.climb_factor,
                weight=weight,
                want=4 if free else 1,
            )
            labels = found.labels
            if not labels:
                break
        return labels

    def route(self, cap_m: float = math.inf, weight: float = 0.0) -> tuple[Track, Flown] | None:
        """A track that passes the exact test under ``cap_m`` as the lattice sees it; None where none was found."""
        for attempt in range(RETRIES):
            way = self.way(cap_m, weight)
            if way is None:
                return None
            track = self.track_of(way)
            flown = fly(self.problem, track)
            if isinstance(flown, Flown):
                return track, flown
            self._learn(track, flown, attempt)
        return None

    def track_of(self, way: Floats) -> Track:
        """The track over ``way``, its stops pinned, its points on straight lines dropped."""
        pinned = np.zeros(len(way), bool)
        pin_m = np.full(len(way), np.nan)
        pinned[0] = pinned[-1] = True
        for (east, north), via in zip(self.stops[1:-1], self.problem.via, strict=True):
            at = np.flatnonzero((way[:, 0] == east) & (way[:, 1] == north) & ~pinned)
            if len(at):
                pinned[at[0]] = True
                pin_m[at[0]] = math.nan if via.amsl_m is None else via.amsl_m
        d = np.diff(way, axis=0)
        bent = np.abs(d[:-1, 0] * d[1:, 1] - d[:-1, 1] * d[1:, 0]) > 1e-9 * (d[:-1] ** 2).sum(-1)
        keep = pinned.copy()
        keep[1:-1] |= bent
        return make_track(self.problem, way[keep], pinned[keep], pin_m[keep])

    def _learn(self, track: Track, why: Obstruction, attempt: int) -> None:
        place = track.place(0.5 * (why.s0_m + why.s1_m))
        self.last, self.last_place = why, place
        by = why.by if math.isfinite(why.by) else math.inf
        if why.kind == "pinched":
            self.lattice.raise_floor(place, by + 0.5)
        elif why.kind == "zone":
            zone = self.problem.airspace.zones[why.zone]
            if attempt < 3 and (zone.floor is not None or zone.ceiling is not None):
                self.lattice.widen_zone(why.zone, by + 0.5)
            else:
                self.lattice.raise_floor(place, math.inf)
        else:
            self.climb_factor *= 0.97
