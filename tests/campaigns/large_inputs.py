"""Inputs of a given size, one function for each amount that a user's file decides: items, cells, vehicles, lines, …

Each writes the files of one input into the current folder and returns the arguments of ``gcsplan``. All inputs lie
around one place, most on flat ground, so that the amount alone makes the work.
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import yaml
from rasterio.transform import Affine

LAT, LON = 46.0, 14.5
NORTH_M, EAST_M = 111_160.0, 77_300.0
"""Metres of a degree at this place, roughly."""

_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)

Places = Sequence[tuple[float, float]]
"""(east, north), metres from the place."""


def degrees(places: Places) -> list[list[float]]:
    """[latitude, longitude] of each place."""
    return [[LAT + n / NORTH_M, LON + e / EAST_M] for e, n in places]


def spiky(count: int, rng: random.Random, middle: tuple[float, float] = (2000.0, 0.0), outer: float = 900.0) -> Places:
    """A ring whose every corner is a spike."""
    turn = [2.0 * math.pi * k / count for k in range(count)]
    radii = [outer * rng.uniform(0.66, 1.0) for _ in range(count)]
    return [(middle[0] + r * math.cos(a), middle[1] + r * math.sin(a)) for a, r in zip(turn, radii, strict=True)]


def smooth(count: int, rng: random.Random) -> Places:
    """A coast: a ring whose corners lie on a soft curve, as surveyors measure it."""
    turn = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)
    radius = 700.0 + sum(120.0 / k * np.sin(k * turn + rng.uniform(0.0, 6.0)) for k in range(2, 9))
    return list(zip((2000.0 + radius * np.cos(turn)).tolist(), (radius * np.sin(turn)).tolist(), strict=True))


def mission(
    no_fly: list[dict[str, object]] | None = None, goal: tuple[float, float] = (4000.0, 100.0), **keys: object
) -> list[str]:
    """Write ``m.yaml``: one copter over flat ground; ``keys`` replace the file's keys, or its vehicle's."""
    start, end = degrees([(0.0, 0.0), goal])
    vehicle: dict[str, object] = {
        "name": "u", "sysid": 1, "autopilot": "arducopter", "start": start, "goal": end, "speed_m_s": [3, 10],
    }  # fmt: skip
    vehicle |= {
        k: keys.pop(k)
        for k in ("start", "via", "turn_radius_m", "autopilot", "takeoff_heading_deg", "end")
        if k in keys
    }
    document: dict[str, object] = {
        "version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 30}, "no_fly": no_fly or [],
        "vehicles": [vehicle], "planner": {"budget_s": 5},
    }  # fmt: skip
    Path("m.yaml").write_text(yaml.dump(document | keys, Dumper=_DUMPER, default_flow_style=None))
    return ["m.yaml"]


def waypoints(places: Places, command: int = 16, more: Sequence[Sequence[float]] = ()) -> None:
    """Write ``u.waypoints``: a take-off, the places 50 m above home, and further rows behind them."""
    rows = [[0, 16, 0, 0, 0, 0, LAT, LON, 100.0], [3, 22, 0, 0, 0, 0, 0, 0, 50.0]]
    rows += [[3, command, 0, 0, 0, 0, lat, lon, 50.0] for lat, lon in degrees(places)]
    rows += [list(r) for r in more]
    text = ["QGC WPL 110"]
    for seq, (frame, what, *params) in enumerate(rows):
        text.append("\t".join([str(seq), str(int(seq == 0)), str(int(frame)), str(int(what)), *map(repr, params), "1"]))
    Path("u.waypoints").write_text("\n".join(text) + "\n")


def ring_file(ring: Places) -> None:
    """Write ``zones.geojson`` with one polygon."""
    points = [[lon, lat] for lat, lon in degrees([*ring, ring[0]])]
    shape = {"type": "Polygon", "coordinates": [points]}
    feature = {"type": "Feature", "properties": {"name": "z"}, "geometry": shape}
    Path("zones.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))


def snake(count: int) -> Places:
    """A line that runs to and fro over fields beside the spiky ring, as a survey does: 100 columns a field."""
    places = []
    for k in range(count):
        row, column = divmod(k // 2, 100)
        column = 99 - column if row % 2 else column
        places.append((40.0 * column, 1500.0 + 440.0 * row + 400.0 * ((k // 2 + k) % 2)))
    return places


def items(count: int, rng: random.Random) -> list[str]:
    ring_file(spiky(100, rng))
    waypoints(snake(count - 2))
    return ["check", *mission([{"file": "zones.geojson"}]), "u.waypoints", "--json"]


def items_at_home(count: int, rng: random.Random) -> list[str]:
    return [*items(count, rng), "--way-home"]


def items_drawn(count: int, rng: random.Random) -> list[str]:
    return [*items(count, rng), "--report", "r.html"]


def splines(count: int, rng: random.Random) -> list[str]:
    waypoints(snake(count - 2), command=82)
    return ["check", *mission(), "u.waypoints", "--json"]


def jumps(count: int, rng: random.Random) -> list[str]:
    """Fifteen jumps, each of which repeats all items before it many times."""
    more = [[3, 177, 2 + k, 30000, 0, 0, 0, 0, 0] for k in range(15)]
    waypoints(snake(count - 2), more=more)
    return ["check", *mission(), "u.waypoints", "--json"]


def vias(count: int, rng: random.Random) -> list[str]:
    places = degrees([(4000.0 * k / (count + 1), rng.uniform(-500.0, 500.0)) for k in range(1, count + 1)])
    return ["plan", *mission(via=places), "-o", "out", "--json"]


def cells(count: float, rng: random.Random) -> list[str]:
    """A raster with ``count`` million cells around the mission, six tenths of the whole."""
    side = round(1000.0 * math.sqrt(count / 0.607))
    step = 0.2 / side
    rows = np.random.default_rng(rng.randrange(10**9)).uniform(100.0, 130.0, (1, side)).astype(np.float32)
    with rasterio.open(
        "dem.tif", "w", driver="GTiff", width=side, height=side, count=1, dtype="float32", crs="EPSG:4326",
        transform=Affine(step, 0, LON - 0.1, 0, -step, LAT + 0.1), tiled=True, compress="deflate",
    ) as file:  # fmt: skip
        block = np.repeat(rows, 256, axis=0)
        for row in range(0, side, 256):
            height = min(256, side - row)
            file.write(block[:height], 1, window=((row, row + height), (0, side)))
    terrain = {"dem": "dem.tif", "vertical_datum": "EGM96"}
    return ["plan", *mission(terrain=terrain), "-o", "out", "--json"]


def tiles(count: int, rng: random.Random) -> list[str]:
    """Terrain in ``count`` tiles: a square of them around the mission, and the rest in rows north of it."""
    side = max(math.isqrt(count), 1)
    names = [f"t{k}.tif" for k in range(count)]
    step = 0.2 / (side * 20)
    for k, name in enumerate(names):
        r, c = divmod(k, side)
        corner = Affine(step, 0, LON - 0.1 + c * 20 * step, 0, -step, LAT - 0.1 + (r + 1) * 20 * step)
        with rasterio.open(
            name, "w", driver="GTiff", width=20, height=20, count=1, dtype="float32", crs="EPSG:4326", transform=corner,
        ) as file:  # fmt: skip
            file.write(np.full((20, 20), 100.0 + rng.random(), np.float32), 1)
    return ["plan", *mission(terrain={"dem": names, "vertical_datum": "EGM96"}), "-o", "out", "--json"]


def tiles_named(count: int, rng: random.Random) -> list[str]:
    """A mission file that names ``count`` tiles, none of which is there."""
    names = [f"t{k}.tif" for k in range(count)]
    return ["plan", *mission(terrain={"dem": names, "vertical_datum": "EGM96"}), "-o", "out", "--json"]


def fleet(count: int, rng: random.Random) -> list[str]:
    """Vehicles side by side that fly to the other side; vehicles of one system id have links of their own."""
    fliers = []
    for k in range(count):
        start, goal = degrees(
            [(60.0 * (k % 100), -60.0 * (k // 100)), (60.0 * ((k + 7) % 100), 2000.0 + 60.0 * (k // 100))]
        )
        fliers.append({"name": f"u{k}", "sysid": k % 250 + 1, "autopilot": "arducopter", "start": start, "goal": goal,
                       "speed_m_s": [3, 10], "link": f"udpout:127.0.0.1:{15_000 + k // 250}"})  # fmt: skip
    arrival = {"mode": "none", "separation_m": 20}
    return ["plan", *mission(vehicles=fliers, arrival=arrival), "-o", "out", "--json"]


def long_wing(count: int, rng: random.Random) -> list[str]:
    """A fixed wing's flight of ``count`` kilometres."""
    keys: dict[str, Any] = {"autopilot": "arduplane", "turn_radius_m": 100, "takeoff_heading_deg": 90, "end": "loiter"}
    return ["plan", *mission(goal=(1000.0 * count, 100.0), **keys), "-o", "out", "--report", "--json"]


def wing_over_cells(count: int, rng: random.Random) -> list[str]:
    """The same across hills of 80 m in cells of 30 m: 40 million cells for 240 km."""
    return _wing_over(40.0, count, rng)


def wing_over_hills(count: int, rng: random.Random) -> list[str]:
    """The same across hills of 300 m: no return altitude is safe from everywhere, and rally points are looked for."""
    return _wing_over(150.0, count, rng)


def _wing_over(high_m: float, count: int, rng: random.Random) -> list[str]:
    goal = 950.0 * count, 312.0 * count
    columns, rows = (math.ceil((d + 60_000.0) / 30.0) for d in goal)
    lat, lon = 30.0 / NORTH_M, 30.0 / EAST_M
    corner = Affine(lon, 0, LON - 30_000.0 / EAST_M, 0, -lat, LAT + (goal[1] + 30_000.0) / NORTH_M)
    waves, noise = rng.uniform(0.0, 6.0), np.random.default_rng(rng.randrange(10**9))
    hills = np.sin(np.arange(columns) / 60.0 + waves)
    with rasterio.open(
        "dem.tif", "w", driver="GTiff", width=columns, height=rows, count=1, dtype="float32", crs="EPSG:4326",
        transform=corner, tiled=True,
    ) as file:  # fmt: skip
        for row in range(0, rows, 256):
            height = min(256, rows - row)
            north = np.cos(np.arange(row, row + height) / 45.0)
            heights = 400.0 + high_m * north[:, None] * hills + noise.uniform(0.0, 5.0, (height, columns))
            file.write(heights.astype(np.float32), 1, window=((row, row + height), (0, columns)))
    keys: dict[str, Any] = {"autopilot": "arduplane", "turn_radius_m": 100, "takeoff_heading_deg": 90, "end": "loiter"}
    terrain = {"dem": "dem.tif", "vertical_datum": "EGM96"}
    return ["plan", *mission(goal=goal, terrain=terrain, **keys), "-o", "out", "--report", "--json"]


def runs(count: int, rng: random.Random) -> list[str]:
    return ["rehearse", *mission(), "--runs", str(count), "--gusts", "1", "--json"]


def unknown_keys(count: int, rng: random.Random) -> list[str]:
    """A mission file with ``count`` keys that no mission has."""
    arguments = mission()
    with Path("m.yaml").open("a") as file:
        file.writelines(f"k{k}: 1\n" for k in range(count))
    return ["check", *arguments, "u.waypoints", "--json"]


def parameters(count: int, rng: random.Random) -> list[str]:
    """A rehearsal with a file of ``count`` parameters."""
    Path("u.param").write_text("".join(f"P{k:07d},{rng.uniform(0.0, 100.0):.3f}\n" for k in range(count)))
    return ["rehearse", *mission(), "--params", "u.param", "--json"]
