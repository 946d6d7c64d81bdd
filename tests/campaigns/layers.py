"""Terrain of several layers against an independent bilinear reading of its files, at places all over and near seams.

    python -m tests.campaigns.layers --points 20000 --seed 1

The reading shares no code with gcsplan: by pyproj each place in each file; the finest file that knows it counts.
No place may be higher than the greatest height, nor lower than the least, by more than `TOLERANCE_M`.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import rasterio
from affine import Affine

from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.terrain.terrain import TerrainSpec, load_terrain

TOLERANCE_M = 0.002
LAT, LON = 46.05, 14.5
M_DEG = 1.0 / 111_200.0
BOX_M = 900.0
UTM, OTHER_UTM, DEGREES = "EPSG:32633", "EPSG:32632", "EPSG:4326"
Heights = Callable[[Any, Any], Any]


def hills(seed: int, steep: float = 1.0, up_m: float = 400.0) -> Heights:
    """Ground over metres from the middle: waves of every length from 7 m on, so that no grid holds all of it."""
    rng = np.random.default_rng(seed)
    waves = [(rng.uniform(7.0, 900.0), rng.uniform(0.0, 6.3), rng.uniform(0.0, 6.3)) for _ in range(24)]

    def at(x: Any, y: Any) -> Any:
        z = np.full(np.shape(x), up_m)
        for length, turn, phase in waves:
            z = z + steep * 0.05 * length * np.sin((x * np.cos(turn) + y * np.sin(turn)) * 6.283 / length + phase)
        return z

    return at


@dataclass
class File:
    """A raster: its system, its cell in the system's units, its half width and offset, m, and its ground."""

    name: str
    crs: str
    cell: tuple[float, float]
    half_m: float
    ground: Heights
    at_m: tuple[float, float] = (0.0, 0.0)
    holes: Sequence[tuple[float, float, float]] = ()
    vertical: str = ""
    unit_m: float = 1.0
    rank: int = 0
    path: Path = field(default_factory=Path)

    def write(self, folder: Path) -> None:
        """Write it as a GeoTIFF whose nodes have the ground at their places."""
        to = pyproj.Transformer.from_crs(DEGREES, self.crs, always_xy=True)
        x0, y0 = to.transform(LON + self.at_m[0] * M_DEG / np.cos(np.radians(LAT)), LAT + self.at_m[1] * M_DEG)
        per_m = (M_DEG / np.cos(np.radians(LAT)), M_DEG) if self.crs == DEGREES else (1.0, 1.0)
        cols, rows = (2 * int(self.half_m * m / c) + 1 for m, c in zip(per_m, self.cell, strict=True))
        i, j = np.meshgrid(np.arange(cols) - cols // 2, rows // 2 - np.arange(rows))
        x, y = x0 + i * self.cell[0], y0 + j * self.cell[1]
        east, north = (x - x0) / per_m[0] + self.at_m[0], (y - y0) / per_m[1] + self.at_m[1]
        z = self.ground(east, north) / self.unit_m
        for east_m, north_m, radius_m in self.holes:
            z[np.hypot(east - east_m, north - north_m) < radius_m] = -9999.0
        west, top = x0 - (cols // 2 + 0.5) * self.cell[0], y0 + (rows // 2 + 0.5) * self.cell[1]
        self.path = folder / f"{self.name}.tif"
        crs = f"{self.crs}+{self.vertical}" if self.vertical else self.crs
        with rasterio.open(
            self.path, "w", driver="GTiff", width=cols, height=rows, count=1, dtype="float64", crs=crs, nodata=-9999.0,
            transform=Affine(self.cell[0], 0.0, west, 0.0, -self.cell[1], top),
        ) as out:  # fmt: skip
            out.write(z, 1)

    def read(self, lat: Any, lon: Any) -> Any:
        """Its ground at places, NaN where it does not know all the nodes that count."""
        with rasterio.open(self.path) as file:
            z, t = file.read(1) * self.unit_m, file.transform
            z[file.read(1) == -9999.0] = np.nan
        x, y = pyproj.Transformer.from_crs(DEGREES, self.crs, always_xy=True).transform(lon, lat)
        c, r = (x - t.c) / t.a - 0.5, (y - t.f) / t.e - 0.5
        i, j = np.floor(c).astype(int), np.floor(r).astype(int)
        inside = (i >= 0) & (j >= 0) & (i < z.shape[1] - 1) & (j < z.shape[0] - 1)
        i, j = np.where(inside, i, 0), np.where(inside, j, 0)
        u, v = c - i, r - j
        upper = (1 - u) * z[j, i] + u * z[j, i + 1]
        return np.where(inside, (1 - v) * upper + v * ((1 - u) * z[j + 1, i] + u * z[j + 1, i + 1]), np.nan)


@dataclass
class Layout:
    """Files with their ranks, from the finest on, and the keys of the mission file."""

    name: str
    files: list[File]
    keys: dict[str, Any] = field(default_factory=dict)


def layouts(seed: int, wider: float = 1.0) -> list[Layout]:
    """Twelve ways in which terrain of different files meets; ``wider``: the finer files' cells by this factor."""
    rng = np.random.default_rng(seed)
    a, b, c = hills(seed), hills(seed + 1, up_m=410.0), hills(seed + 2, 2.0, 395.0)
    second = 1.0 / 3600.0
    part = float(rng.uniform(2.2, 7.7))
    east, north = rng.uniform(-150.0, 150.0, 2)

    def srtm(ground: Heights = b, rank: int = 1, **more: Any) -> File:
        return File(f"srtm{rank}", DEGREES, (second, second), 6000.0, ground, rank=rank, **more)

    def lidar(cell_m: float = 4.0, ground: Heights = a, crs: str = UTM, **more: Any) -> File:
        cell_m *= wider
        cell = (cell_m * M_DEG / np.cos(np.radians(LAT)), cell_m * M_DEG) if crs == DEGREES else (cell_m, cell_m)
        return File(more.pop("name", "lidar"), crs, cell, more.pop("half_m", 400.0), ground,
                    more.pop("at_m", (east, north)), **more)  # fmt: skip

    nested_cell = second / max(2, round(6.0 / wider))
    nested = File("lidar", DEGREES, (nested_cell, nested_cell), 400.0, a)
    holes = [(east + dx, north + dy, r) for dx, dy, r in rng.uniform((-380, -380, 5), (380, 380, 90), (9, 3))]
    return [
        Layout("nested in degrees", [nested, srtm()]),
        Layout("in degrees, no whole ratio", [lidar(27.0 / part, crs=DEGREES), srtm()]),
        Layout("in UTM", [lidar(), srtm()]),
        Layout("in another zone's UTM, turned by degrees", [lidar(6.0, crs=OTHER_UTM), srtm(c)]),
        Layout("with holes", [lidar(holes=holes), srtm()]),
        Layout("with holes in both", [
            lidar(holes=holes), srtm(holes=[(x + 60.0, y - 30.0, r + 40.0) for x, y, r in holes])
        ]),
        Layout("three layers", [
            lidar(3.0, half_m=150.0), lidar(9.0, c, OTHER_UTM, name="photo", rank=1, half_m=500.0), srtm(rank=2)
        ]),
        Layout("equally fine", [
            lidar(8.0), lidar(9.5, c, OTHER_UTM, name="other", at_m=(-east, -north)), srtm()
        ]),
        Layout("a cliff of forty metres", [lidar(ground=hills(seed, up_m=440.0)), srtm()]),
        Layout("in feet beside metres", [lidar(vertical="6360", unit_m=1200.0 / 3937.0), srtm(vertical="5773")],
               {"vertical_datum": None}),
        Layout("at a sea", [lidar(ground=hills(seed, 0.2, 3.0), holes=holes)], {"sea": True}),
        Layout("two parts with a gap", [
            lidar(half_m=180.0, at_m=(-220.0, 20.0)), lidar(half_m=180.0, at_m=(217.3, -31.0), name="east"), srtm()
        ]),
    ]  # fmt: skip


@dataclass
class Outcome:
    """How a layout did: places, those outside of the heights, the worst, and how far the heights are apart."""

    name: str
    known: int
    wrong: int
    worst_m: float
    unknown: int
    apart_m: float


def places(layout: Layout, count: int, rng: np.random.Generator) -> tuple[Any, Any]:
    """Latitudes and longitudes: half all over the box, half within 40 m of the edges and holes of the files."""
    east, north = rng.uniform(-BOX_M, BOX_M, (2, count))
    for k in range(count // 2):
        f = layout.files[k % len(layout.files)]
        if f.holes and rng.random() < 0.5:
            x, y, r = f.holes[rng.integers(len(f.holes))]
            turn = rng.uniform(0.0, 6.3)
            east[k], north[k] = x + r * np.cos(turn), y + r * np.sin(turn)
        elif f.half_m < BOX_M:
            side, along = rng.integers(4), rng.uniform(-f.half_m, f.half_m)
            edge = f.half_m * (1 if side % 2 else -1)
            east[k], north[k] = np.add(f.at_m, (edge, along) if side < 2 else (along, edge))
        east[k] += rng.uniform(-40.0, 40.0)
        north[k] += rng.uniform(-40.0, 40.0)
    return LAT + north * M_DEG, LON + east * M_DEG / np.cos(np.radians(LAT))


def run(layout: Layout, folder: Path, count: int, seed: int) -> Outcome:
    """Load the layout and compare ``count`` places."""
    for file in layout.files:
        file.write(folder)
    keys = {"vertical_datum": "EGM96"} | layout.keys
    frame = Frame(LAT, LON)
    spec = TerrainSpec(dem=tuple(str(f.path) for f in layout.files), **keys)
    surface = load_terrain(spec, frame, (-BOX_M, -BOX_M, BOX_M, BOX_M), where="m")
    lat, lon = places(layout, count, np.random.default_rng(seed))
    low, high = np.full(count, np.nan), np.full(count, np.nan)
    for rank in sorted({f.rank for f in layout.files}):
        read = [f.read(lat, lon) for f in layout.files if f.rank == rank]
        least, most = np.fmin.reduce(read), np.fmax.reduce(read)
        low, high = np.where(np.isnan(low), least, low), np.where(np.isnan(high), most, high)
    if layout.keys.get("sea"):
        low, high = np.where(np.isnan(low), 0.0, low), np.where(np.isnan(high), 0.0, high)
    plane = frame.to_plane(lat, lon)
    under, over = surface.ground_at(*plane.T), surface.high_at(*plane.T)
    known = ~np.isnan(under)
    assert not (known & np.isnan(low)).any(), f"{layout.name}: ground where no file knows any"
    off = np.fmax(high - over, under - low)[known]
    return Outcome(
        layout.name, int(known.sum()), int((off > TOLERANCE_M).sum()), float(off.max()),
        int((~known & ~np.isnan(low)).sum()), float(np.mean((over - under)[known])),
    )  # fmt: skip


def main() -> int:
    """Run all layouts and print a line for each."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--points", type=int, default=20_000)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--rounds", type=int, default=1)
    given = options.parse_args()
    wrong = 0
    for number in range(given.rounds):
        seed = given.seed + 100 * number
        for layout in layouts(seed):
            with tempfile.TemporaryDirectory() as folder:
                o = run(layout, Path(folder), given.points, seed)
            wrong += o.wrong
            print(f"{o.name}: {o.known} places, {o.wrong} outside, worst {o.worst_m:.4f} m, {o.unknown} known to the "
                  f"files alone, heights {o.apart_m:.2f} m apart", flush=True)  # fmt: skip
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
