"""A brute-force check of legs, to compare the exact check with: plain numpy, fine samples, no shared code.

The oracle has the surface as arrays of heights and its own function from the plane to (col, row). For a DEM in degrees
that function transforms each sample to latitude and longitude by pyproj, so it needs no fitted polynomial and no
straight line in the grid. Sampling can miss a violation, but every violation that it finds is one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Zone


@dataclass(frozen=True, eq=False)
class Oracle:
    """A sampled world: ``to_grid(east, north) -> (col, row)``; heights (rows, cols), NaN where unknown.

    ``rings`` and ``spokes``: samples around each point; ``scale``: metres of the plane per true metre.
    """

    ground: Floats
    top: Floats
    to_grid: Callable[[Floats, Floats], tuple[Floats, Floats]]
    zones: Sequence[Zone] = ()
    scale: float = 1.0
    step_m: float = 0.5
    rings: int = 2
    spokes: int = 12

    def height(self, z: Floats, e: Floats, n: Floats) -> Floats:
        """Bilinear height at points of the plane; NaN outside, and where a corner with non-zero weight is unknown."""
        c, r = self.to_grid(e, n)
        rows, cols = z.shape
        noise = 1e-9
        out = ~((c >= -noise) & (c <= cols - 1 + noise) & (r >= -noise) & (r <= rows - 1 + noise))
        c, r = np.clip(np.where(out, 0, c), 0, cols - 1), np.clip(np.where(out, 0, r), 0, rows - 1)
        i, j = np.minimum(c.astype(int), cols - 2), np.minimum(r.astype(int), rows - 2)
        u, v = c - i, r - j
        total = np.zeros(np.shape(c))
        for jj, ii, w in (
            (j, i, (1 - u) * (1 - v)),
            (j, i + 1, u * (1 - v)),
            (j + 1, i, (1 - u) * v),
            (j + 1, i + 1, u * v),
        ):
            total = total + np.where(w > 1e-12, w * z[jj, ii], 0.0)
        return np.where(out, np.nan, total)

    def line(self, start: Floats, end: Floats) -> tuple[Floats, Floats]:
        """Samples at most ``step_m`` apart: fractions (S,), points (S, 3)."""
        count = max(2, math.ceil(float(np.linalg.norm(end - start)) / self.step_m) + 1)
        t = np.linspace(0.0, 1.0, count)
        return t, start + t[:, None] * (end - start)

    def highest(self, z: Floats, e: Floats, n: Floats, reach: float) -> Floats:
        """Highest sampled height within ``reach`` of each point; NaN as soon as one sample is unknown."""
        best = self.height(z, e, n)
        for k in range(1, self.rings + 1 if reach > 0 else 1):
            for a in np.arange(self.spokes) * (2 * np.pi / self.spokes) + 0.5 * k:
                d = reach * k / self.rings
                best = np.maximum(best, self.height(z, e + d * np.cos(a), n + d * np.sin(a)))
        return best

    def depths(
        self, start: Floats, end: Floats, column: bool, track: float, altitude: float, limits: Limits
    ) -> dict[str, float]:
        """By how much each limit is broken (positive) or kept (negative), by kind; coverage is 1 (unknown) or 0."""
        _, p = self.line(start, end)
        e, n, h = p.T
        near = track * self.scale
        far = near + limits.horizontal_clearance_m * self.scale
        found: dict[str, float] = {}
        top = self.highest(self.top, e, n, near)
        unknown = np.isnan(top).any()
        run, rise = math.hypot(*(end - start)[:2]), float(end[2] - start[2])
        climb = math.degrees(math.atan2(rise, run))
        if not column:
            found["min_agl"] = _most(limits.min_agl_m + altitude - (h - top))
            found["climb"], found["descent"] = climb - limits.max_climb_deg, -climb - limits.max_descent_deg
            if limits.horizontal_clearance_m > 0:
                wide = self.highest(self.top, e, n, far)
                unknown |= np.isnan(wide).any()
                found["terrain_clearance"] = _most(np.fmax(wide, top) - (h - altitude))
        found["coverage"] = 1.0 if unknown else 0.0
        if limits.max_agl_m is not None:
            lowest = -self.highest(-self.ground, e, n, near)
            found["max_agl"] = _most(h + altitude - lowest - limits.max_agl_m)
        if limits.max_amsl_m is not None:
            found["max_amsl"] = float(h.max()) + altitude - limits.max_amsl_m
        return found

    def levels(self, zone: Zone, e: Floats, n: Floats) -> tuple[Floats, Floats]:
        """Floor and ceiling (AMSL) of a zone at points; an AGL level is infinite over unknown ground."""
        ground = self.height(self.ground, e, n)
        out = []
        for level, none in ((zone.floor, -np.inf), (zone.ceiling, np.inf)):
            if level is None:
                out.append(np.full(np.shape(e), none))
            elif level.datum == "amsl":
                out.append(np.full(np.shape(e), level.value_m))
            else:
                out.append(np.where(np.isnan(ground), none, ground + level.value_m))
        return out[0], out[1]

    def shape_distance(self, zone: Zone, e: Floats, n: Floats) -> Floats:
        """Distance from the shape's border, negative inside."""
        if isinstance(zone.shape, Circle):
            s = zone.shape
            return np.asarray(np.hypot(e - s.east_m, n - s.north_m) - s.radius_m * self.scale)
        a = np.asarray(zone.shape.vertices, float)
        b = np.roll(a, -1, axis=0)
        best, winding = np.full(np.shape(e), np.inf), np.zeros(np.shape(e))
        for (ax, ay), (bx, by) in zip(a, b, strict=True):
            w = np.clip(((e - ax) * (bx - ax) + (n - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2), 0, 1)
            best = np.minimum(best, np.hypot(ax + w * (bx - ax) - e, ay + w * (by - ay) - n))
            # The angle that the edge subtends: seen from inside, all edges add up to a full turn.
            turn = np.arctan2(by - n, bx - e) - np.arctan2(ay - n, ax - e)
            winding += (turn + np.pi) % (2 * np.pi) - np.pi
        return np.where(np.abs(winding) > np.pi, -best, best)

    def zone_breach(
        self, k: int, start: Floats, end: Floats, track: float, altitude: float, limits: Limits,
        spokes: int = 16, rings: int = 4, grow_m: float = 0.0, lift_m: float = 0.0,
    ) -> bool:  # fmt: skip
        """Whether the leg is between floor and ceiling of zone ``k`` at a sampled point of it within reach of the leg.

        ``grow_m`` and ``lift_m`` (m) add to the reach and to the altitude error: with negative ones, only a breach
        deeper than that counts.
        """
        zone = self.zones[k]
        _, p = self.line(start, end)
        e, n, h = p.T
        reach = (track + limits.horizontal_clearance_m) * self.scale + grow_m
        altitude += lift_m
        gap = self.shape_distance(zone, e, n)
        close = gap < max(reach, 0.0) if reach > 0 else gap < reach
        if not close.any():
            return False
        e, n, h, gap = e[close], n[close], h[close], gap[close]
        if not any(x is not None and x.datum == "agl" for x in (zone.floor, zone.ceiling)):
            low, high = self.levels(zone, e, n)
            return bool(((low < high) & (h + altitude > low) & (h - altitude < high)).any())
        for k_ring in range(rings + 1 if reach > 0 else 1):
            for a in np.arange(spokes if k_ring else 1) * (2 * np.pi / max(spokes, 1)) + 0.3 * k_ring:
                d = reach * k_ring / rings * (1 - 1e-9)
                qe, qn = e + d * np.cos(a), n + d * np.sin(a)
                low, high = self.levels(zone, qe, qn)
                met = (low < high) & (h + altitude > low) & (h - altitude < high)
                deep = 0.0 if k_ring else min(grow_m, 0.0)
                if met.any() and (self.shape_distance(zone, qe[met], qn[met]) <= deep).any():
                    return True
        return False


def _most(values: Floats) -> float:
    known = values[~np.isnan(values)]
    return float(known.max()) if len(known) else -math.inf


def deepest(
    oracle: Oracle, z: Floats, sign: float, start: Floats, end: Floats, need: float, reach: float, hint: float,
    rng: np.random.Generator,
) -> float:  # fmt: skip
    """The largest sampled ``need − sign·(altitude − height)`` within ``reach`` of a leg: a lower bound of the maximum.

    Samples the whole leg and the neighbourhood of its fraction ``hint`` coarsely, then refines around the best places.
    """
    length = max(float(np.linalg.norm((end - start)[:2])), 1e-9)

    def look(t: Floats, r: Floats, a: Floats) -> Floats:
        p = start + t[:, None] * (end - start)
        depth = need - sign * (p[:, 2] - oracle.height(z, p[:, 0] + r * np.cos(a), p[:, 1] + r * np.sin(a)))
        return np.where(np.isnan(depth), -np.inf, depth)

    count = 6000
    t = np.where(np.arange(count) % 2, rng.uniform(0, 1, count), hint + rng.normal(0, 0.5 * reach / length, count))
    t = np.clip(t, 0, 1)
    r, a = reach * np.sqrt(rng.uniform(0, 1, count)), rng.uniform(0, 2 * np.pi, count)
    r[::3] = reach
    depth = look(t, r, a)
    best = float(depth.max())
    for k in np.argsort(depth)[::-1][:60:12]:
        at, wide = np.array([t[k], r[k], a[k]]), np.array([0.02, reach / 8, 0.2])
        for _ in range(9):
            near = at + rng.normal(0, 1, (120, 3)) * wide
            near[:20, 0], near[20:50, 1] = at[0], reach
            near[:, 0], near[:, 1] = near[:, 0].clip(0, 1), near[:, 1].clip(0, reach)
            found = look(*near.T)
            if found.max() >= best or found.max() >= depth[k]:
                at, depth[k] = near[found.argmax()], found.max()
            best, wide = max(best, float(found.max())), wide / 2.5
    return best
