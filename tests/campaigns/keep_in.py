"""Random keep-in areas and legs at the limit: no leg that the exact check passes leaves the union of the areas.

    python -m tests.campaigns.keep_in --judgements 2000 --seed 1

Areas are polygons, also with holes, that overlap, adjoin or lie apart, each from a floor to a ceiling above sea level
or above the ground, or without. For each leg the greatest error that the check passes is found by bisection, to 0.1 mm.
Then an oracle looks at thousands of places within the leg's errors, by the areas' own definition alone: is each in one
of the prisms? A place that is in none is a fault. Legs that could have had `MORE_M` more are counted, too.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.outside import outside_of
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import AreaPart, KeepIn, Level

REACH_M = 400.0
AT_LIMIT_M, MORE_M, HAIR_M = 1e-4, 0.02, 1e-3
FREE = Limits(min_agl_m=-1e6)


@dataclass(frozen=True, eq=False)
class Scene:
    """Areas over ground that is one slanted plane, and a leg."""

    areas: tuple[KeepIn, ...]
    air: Airspace
    start: Floats
    end: Floats

    def ground(self, at: Floats) -> Floats:
        return np.asarray(self.air.surface.ground_at(at[..., 0], at[..., 1]))

    def passes(self, track_m: float, altitude_m: float) -> bool:
        legs = Legs(
            self.start[None], self.end[None], np.zeros(1, np.bool_), np.array([track_m]), np.array([altitude_m])
        )
        return bool(self.air.clear(legs, FREE)[0])


def scene(rng: np.random.Generator) -> Scene:
    """One random scene; most legs are inside, without errors."""
    kind = rng.choice(["none", "amsl", "agl", "mixed"])
    shapes = _shapes(rng)
    areas = tuple(
        KeepIn(f"area {k}", (part,), *_levels(rng, kind if kind != "mixed" else rng.choice(["none", "amsl", "agl"])))
        for k, part in enumerate(shapes)
    )
    nodes = np.arange(9.0)
    slope = rng.uniform(-30.0, 30.0, 2)
    ground = 100.0 + slope[0] * nodes[None, :] + slope[1] * nodes[:, None]
    surface = Surface(ground, ground, GridMap.affine(-800.0, 800.0, 200.0, 200.0))
    air = Airspace(surface, outside_of(areas, 3000.0))
    inside = _places(rng, areas)
    a, b = inside[rng.integers(len(inside))], inside[rng.integers(len(inside))]
    b = a + (b - a) * rng.choice([0.0, 0.1, 0.5, 1.0])
    low = np.asarray(surface.ground_at([a[0], b[0]], [a[1], b[1]]))
    height = rng.uniform(20.0, 140.0, 2) if rng.random() < 0.6 else np.repeat(rng.uniform(20.0, 140.0), 2)
    return Scene(areas, air, np.array([*a, low[0] + height[0]]), np.array([*b, low[1] + height[1]]))


def _shapes(rng: np.random.Generator) -> list[AreaPart]:
    """Polygons around random middles: some of them are neighbours that share an edge, cut at different corners."""
    parts = []
    for _ in range(rng.integers(1, 4)):
        middle, size = rng.uniform(-REACH_M / 2, REACH_M / 2, 2), rng.uniform(80.0, 250.0)
        corners = rng.integers(3, 12)
        angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
        if np.diff(angle, append=angle[0] + 2.0 * np.pi).max() > 2.0:
            angle = np.arange(corners) * 2.0 * np.pi / corners
        radius = size * rng.uniform(0.3, 1.0, corners)
        ring = middle + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        hole = middle + 0.05 * size * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
        parts.append(AreaPart(ring, (hole,) if rng.random() < 0.2 and corners > 6 else ()))
    if rng.random() < 0.5:  # beside the last one, along one of its edges: longer than it, and cut elsewhere
        ring = parts[-1].outline
        a, b = ring[0], ring[1]
        out = np.array([(b - a)[1], -(b - a)[0]])
        part = rng.uniform(0.1, 0.9)
        parts.append(AreaPart(np.array([b, a + part * (b - a), a, a + out, b + out])[::-1]))
    return parts


def _levels(rng: np.random.Generator, kind: str) -> tuple[Level | None, Level | None]:
    if kind == "none" or rng.random() < 0.2:
        return None, None
    datum: Literal["amsl", "agl"] = "amsl" if kind == "amsl" else "agl"
    zero = 100.0 if kind == "amsl" else 0.0
    floor = Level(zero + float(rng.choice([-200.0, 20.0, 40.0])), datum)
    ceiling = Level(zero + float(rng.choice([80.0, 120.0, 160.0])), datum)
    if datum == "agl" and floor.value_m < 0.0:
        return None, ceiling
    return (floor if rng.random() < 0.5 else None), (ceiling if rng.random() < 0.8 else None)


def _places(rng: np.random.Generator, areas: tuple[KeepIn, ...]) -> Floats:
    at = rng.uniform(-2.0 * REACH_M, 2.0 * REACH_M, (4000, 2))
    held = np.any([in_part(part, at) for area in areas for part in area.parts], axis=0)
    return np.asarray(at[held])


def in_ring(ring: Floats, at: Floats) -> Bools:
    """(N,) whether places (N, 2) lie inside a ring (V, 2), by the crossings of a line to the east."""
    inside = np.zeros(len(at), np.bool_)
    for (x0, y0), (x1, y1) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        if y0 != y1:
            spans = (y0 > at[:, 1]) != (y1 > at[:, 1])
            inside ^= spans & (at[:, 0] < x0 + (at[:, 1] - y0) * (x1 - x0) / (y1 - y0))
    return inside


def in_part(part: AreaPart, at: Floats) -> Bools:
    """(N,) whether places lie in a part, and in none of its holes."""
    return np.asarray(in_ring(part.outline, at) & ~np.any([in_ring(h, at) for h in part.holes] or [[False]], axis=0))


def leaves(one: Scene, track_m: float, altitude_m: float, rng: np.random.Generator) -> int:
    """How many of the places within a leg's errors that are looked at are in none of the prisms.

    They lie on circles around the leg, and a hair beside the areas' edges, their corners and the crossings of edges.
    """
    way = one.end - one.start
    steps = np.concatenate([np.linspace(0.0, 1.0, 60), rng.random(60)])
    turn = np.arange(48) * (2.0 * np.pi / 48)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    off = track_m * np.concatenate([np.zeros((1, 2)), 0.5 * circle, circle])
    around = (one.start[:2] + steps[:, None] * way[:2])[:, None] + off
    beside = (_edge_places(one.areas)[:, None] + HAIR_M * circle[::6]).reshape(-1, 2)
    square = float(way[:2] @ way[:2])
    nearest = ((beside - one.start[:2]) @ way[:2] / square).clip(0.0, 1.0) if square > 0.0 else rng.random(len(beside))
    near = np.hypot(*(one.start[:2] + nearest[:, None] * way[:2] - beside).T) < track_m
    at = np.concatenate([around.reshape(-1, 2), beside[near]])
    part = np.concatenate([np.repeat(steps, len(off)), nearest[near]])
    ground = one.ground(at)
    out = 0
    for more in (-altitude_m, 0.0, altitude_m):
        height = one.start[2] + part * way[2] + more
        held = np.zeros(len(at), np.bool_)
        for area in one.areas:
            low, high = (_above(level, ground) for level in (area.floor, area.ceiling))
            fits = (True if low is None else height >= low) & (True if high is None else height <= high)
            held |= np.any([in_part(part, at) for part in area.parts], axis=0) & fits
        out += int((~held).sum())
    return out


def _edge_places(areas: tuple[KeepIn, ...]) -> Floats:
    """(N, 2) places on the edges of all areas, a metre apart, their corners, and where edges cross."""
    rings = [ring for area in areas for part in area.parts for ring in (part.outline, *part.holes)]
    first = np.concatenate(rings)
    step = np.concatenate([np.roll(ring, -1, axis=0) - ring for ring in rings])
    found = [first]
    for a, d in zip(first, step, strict=True):
        found.append(a + np.arange(0.0, 1.0, 1.0 / max(np.hypot(*d), 1.0))[:, None] * d)
        across = d[0] * step[:, 1] - d[1] * step[:, 0]
        some = np.abs(across) > 1e-9
        off = first[some] - a
        t = (off[:, 0] * step[some, 1] - off[:, 1] * step[some, 0]) / across[some]
        s = (off[:, 0] * d[1] - off[:, 1] * d[0]) / across[some]
        found.append(a + t[(t >= 0.0) & (t <= 1.0) & (s >= 0.0) & (s <= 1.0)][:, None] * d)
    return np.concatenate(found)


def _above(level: Level | None, ground: Floats) -> Floats | None:
    return None if level is None else level.value_m + (ground if level.datum == "agl" else 0.0)


@dataclass
class Count:
    """Legs that were judged at their limit; of these, unsafe ones, and ones that could have had `MORE_M` more."""

    judged: int = 0
    unsafe: int = 0
    less: int = 0


def judge(seed: int, count: Count) -> None:
    """Judge one leg at its limit, and count what the oracle finds."""
    rng = np.random.default_rng(seed)
    one = scene(rng)
    altitude_m = float(rng.choice([0.0, 3.0, 10.0]))
    if not one.passes(0.0, altitude_m):
        return
    low, high = 0.0, 2.0 * REACH_M
    while high - low > AT_LIMIT_M:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if one.passes(middle, altitude_m) else (low, middle)
    count.judged += 1
    # A hair less than the errors that passed: touching the edge is legal.
    out = leaves(one, max(low - 2.0 * AT_LIMIT_M, 0.0), max(altitude_m - 2.0 * AT_LIMIT_M, 0.0), rng)
    if out:
        count.unsafe += 1
        print(f"UNSAFE: seed {seed}: {out} places outside, {low:.4f} m, {altitude_m:g} m")
    count.less += not leaves(one, low + MORE_M, altitude_m, rng)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--judgements", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    count, seed = Count(), args.seed
    while count.judged < args.judgements:
        judge(seed, count)
        seed += 1
    print(
        f"{count.judged} judgements at the limit, {count.unsafe} unsafe, {count.less} with {MORE_M:g} m more to spare"
    )


if __name__ == "__main__":
    main()
