"""Missions of 5 to 40 km for the benchmark of scale: over the sample terrain, and over a mosaic of made hills."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from gcsplan.arrays import Floats
from gcsplan.bench.sample import SAMPLE_TERRAIN
from gcsplan.export.outdir import write_whole

SAMPLE_BOX = (36.46, -84.40, 36.71, -84.10)
"""South, west, north, east of the sample terrain, without a border for the way around."""
MADE_BOX = (46.55, 8.05, 46.95, 8.75)
MADE_TILES = (46.5, 8.0, 0.1, 5, 8)
"""South, west and size of a made tile in degrees; rows and columns of tiles."""
LENGTHS_M = (5000.0, 40_000.0)
EQUATOR_DEGREE_M = 111_320.0
TILE_POSTS = 120
"""Posts of a made tile along each side: 3 arc seconds."""
ROUGH_M, WAVES = 900.0, 40
END_DRAWS = 1000


def make_mosaic(folder: Path, seed: int, posts: int = TILE_POSTS) -> list[Path]:
    """Write tiles of hills into ``folder``, each with ``posts`` × ``posts`` cells; the hills do not depend on that."""
    import rasterio
    from rasterio.transform import Affine

    south, west, size, rows, cols = MADE_TILES
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for row in range(rows):
        for col in range(cols):
            left, top = west + col * size, south + (row + 1) * size
            step = size / posts
            middle = np.arange(posts, dtype=np.float64) + 0.5
            lon, lat = np.asarray(left + step * middle), np.asarray(top - step * middle)
            path = folder / f"hills_{row}{col}.tif"
            with rasterio.open(
                path, "w", driver="GTiff", width=posts, height=posts, count=1, dtype="float32", crs="EPSG:4326",
                transform=Affine(step, 0.0, left, 0.0, -step, top), compress="deflate",
            ) as file:  # fmt: skip
                file.write(_hills(lat, lon, seed).astype(np.float32), 1)
            made.append(path)
    return made


def _hills(lat: Floats, lon: Floats, seed: int) -> Floats:
    """(rows, cols) heights, m: waves of 3 to 40 km in all directions, the long ones higher."""
    rng = np.random.default_rng(seed)
    north, east = (lat - 46.7) * EQUATOR_DEGREE_M, (lon - 8.4) * EQUATOR_DEGREE_M * math.cos(math.radians(46.7))
    heights = np.full((len(lat), len(lon)), ROUGH_M)
    for _ in range(WAVES):
        wave_m = math.exp(rng.uniform(math.log(3e3), math.log(40e3)))
        turn, phase = rng.uniform(0.0, 2.0 * math.pi, 2)
        along = north[:, None] * math.cos(turn) + east[None, :] * math.sin(turn)
        heights += ROUGH_M / 6.0 * (wave_m / 40e3) ** 0.8 * np.sin(2.0 * math.pi * along / wave_m + phase)
    return np.asarray(np.maximum(heights, 0.0))


def make_missions(folder: Path, count: int, seed: int, tiles: Path) -> list[Path]:
    """Write ``count`` missions of one copter each, in turn over the sample and over the mosaic in ``tiles``."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for number in range(count):
        path = folder / f"m{number:04d}.yaml"
        write_whole(path, yaml.safe_dump(mission(number, seed, tiles), sort_keys=False))
        files.append(path)
    return files


def mission(number: int, seed: int, tiles: Path, zones: int | None = None) -> dict[str, Any]:
    """The content of one mission; odd numbers are over the mosaic. ``zones``: how many; None: up to eight."""
    rng = np.random.default_rng((seed, number))
    made = number % 2 == 1
    box = MADE_BOX if made else SAMPLE_BOX
    start, goal = _ends(rng, box)
    return {
        "version": 1,
        "name": f"mission {number}",
        "terrain": SAMPLE_TERRAIN | ({"dem": str(tiles)} if made else {}),
        "limits": {
            "min_agl_m": 60, "horizontal_clearance_m": 30, "track_error_m": 3, "altitude_error_m": 5,
        },
        "no_fly": _zones(rng, start, goal, int(rng.integers(0, 9)) if zones is None else zones),
        "vehicles": [
            {
                "name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 12],
                "start": [round(float(x), 6) for x in start], "goal": [round(float(x), 6) for x in goal],
            }
        ],
        # Counted work alone ends a search, so that a busy machine plans the same.
        "planner": {"budget_s": 600, "gap_percent": 0.5},
    }  # fmt: skip


def _ends(rng: np.random.Generator, box: tuple[float, float, float, float]) -> tuple[Floats, Floats]:
    """Start and goal in a box, as far apart as drawn; the box is wider than the longest in one direction."""
    south, west, north, east = box
    scale = np.array([EQUATOR_DEGREE_M, EQUATOR_DEGREE_M * math.cos(math.radians(south))])
    low, high = np.array([south, west]), np.array([north, east])
    longest_m = 0.95 * float(np.hypot(*((high - low) * scale)))
    for _ in range(END_DRAWS):  # most succeed within ten
        length_m = rng.uniform(LENGTHS_M[0], min(LENGTHS_M[1], longest_m))
        turn = rng.uniform(0.0, 2.0 * math.pi)
        start = rng.uniform(low, high)
        goal = start + length_m * np.array([math.cos(turn), math.sin(turn)]) / scale
        if ((goal >= low) & (goal <= high)).all():
            return start, goal
    return low, high


def _zones(rng: np.random.Generator, start: Floats, goal: Floats, count: int) -> list[dict[str, Any]]:
    """Circles beside and on the straight line, none within 1.5 km of its ends; smaller where there are many."""
    scale = np.array([EQUATOR_DEGREE_M, EQUATOR_DEGREE_M * math.cos(math.radians(float(start[0])))])
    way = (goal - start) * scale
    length_m = float(np.hypot(*way))
    along, across = way / length_m, np.array([-way[1], way[0]]) / length_m
    zones = []
    for k in range(count):
        radius_m = rng.uniform(150.0, 900.0) / max(1.0, count / 20.0) ** 0.5
        gone_m = rng.uniform(0.0, length_m)
        aside_m = rng.uniform(-3000.0, 3000.0)
        if min(gone_m, length_m - gone_m) < 1500.0 + radius_m and abs(aside_m) < 1500.0 + radius_m:
            aside_m = math.copysign(1500.0 + radius_m, aside_m)
        centre = start + (gone_m * along + aside_m * across) / scale
        zone: dict[str, Any] = {
            "name": f"zone {k + 1}",
            "center": [round(float(x), 6) for x in centre],
            "radius_m": round(radius_m),
        }
        zones.append(zone | ({"floor_agl_m": 0, "ceiling_agl_m": 200} if k % 3 == 2 else {}))
    return zones
