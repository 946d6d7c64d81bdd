"""Random terrain files against a reading of their heights by hand: units, directions, datums, voids, and two heights.

    python -m tests.campaigns.heights --seconds 600 --seed 1

Each case is one mission's terrain: GeoTIFF, ESRI .asc, SRTM .hgt or ArduPilot's .DAT, with a vertical datum, a unit
and a void stated by keys, by the file, or by nobody, and often by several of them. The right answer is worked out
here, from tables written by hand: refused for one of the given reasons, or heights, bilinear between nodes. A fault is
a case that is read where it must be refused, refused where it must be read, refused for another reason, or read with
other heights.
"""

from __future__ import annotations

import argparse
import math
import re
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from affine import Affine
from pyproj import CRS, Transformer

from gcsplan.arrays import Floats
from gcsplan.dem.terrain import open_dem
from gcsplan.errors import InputError
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.terrain.terrain import TerrainSpec
from gcsplan.world.world import World
from tests.dem.test_dat_terrain import interpolated
from tests.dem.test_dat_terrain import write as write_dat

FOOT, US_FOOT = 0.3048, 0.304800609601219
HEIGHT_CODES = {  # EPSG code: metres of a unit, name
    5773: (1.0, "EGM96"), 3855: (1.0, "EGM2008"), 5798: (1.0, "EGM84"), 5703: (1.0, "NAVD88"),
    6360: (US_FOOT, "NAVD88"), 8228: (FOOT, "NAVD88"), 5702: (US_FOOT, "NGVD29"), 7837: (1.0, "DHHN2016"),
    5714: (1.0, "AMSL"), 8050: (FOOT, "AMSL"), 8052: (US_FOOT, "AMSL"), 5701: (1.0, "ODN"), 5711: (1.0, "AHD"),
    5728: (1.0, "LN02"), 5941: (1.0, "NN2000"), 5709: (1.0, "NAP"), 5621: (1.0, "EVRF2007"), 5613: (1.0, "RH2000"),
    6647: (1.0, "CGVD2013(CGG2013)"), 5720: (1.0, "NGF-IGN69"), 5783: (1.0, "DHHN92"), 5710: (1.0, "Ostend"),
    6130: (FOOT, "GCVD54"),
}  # fmt: skip
COMPOUND_CODES = {7405: (1.0, "ODN"), 5498: (1.0, "NAVD88"), 9518: (1.0, "EGM2008"), 5554: (1.0, "DHHN92")}
ELLIPSOIDAL_CODES = {4979: "ellipsoid", 4937: "ellipsoid", 9267: "other ellipsoid", 4985: "other ellipsoid",
                     4978: "no heights"}  # fmt: skip
DEPTH_CODES = (5715, 6357, 6358, 6359, 8051, 8053, 5861, 5866, 5336)
OTHER_ZERO_CODES = (5868, 5869, 5872, 5874, 5829, 5611, 8881, 5797, 5754, 7979)
WORDS = {"EGM96": "EGM96", "egm 2008": "EGM2008", "NAVD88": "NAVD88", "msl": "AMSL", "AMSL": "AMSL",
         "DHHN2016": "DHHN2016", "navd 88": "NAVD88"}  # fmt: skip
UNIT_WORDS = {
    "m": 1.0, "metre": 1.0, "Meters": 1.0, "ft": FOOT, "foot": FOOT, "Feet": FOOT, "US survey foot": US_FOOT,
    "us-ft": US_FOOT, "ftUS": US_FOOT, "Foot_US": US_FOOT, "us_ft": US_FOOT, "dm": 0.1, "cm": 0.01,
}  # fmt: skip
KEY_UNITS = {"m": 1.0, "ft": FOOT, "us_ft": US_FOOT}
REASONS = {
    "depths": "counts depths", "another zero": "do not count from mean sea level",
    "no datum": "does not say what its heights are measured from", "two datums": "the raster itself states",
    "two units": "two units of height", "unknown unit": "which is not known", "no unit": "nothing states the unit",
    "own unit": "states it itself", "in metres": "are in metres", "own voids": "marks its voids itself",
    "ellipsoid": "must be converted to mean sea level", "other ellipsoid": "count from another ellipsoid",
    "no heights": "has no axis of heights", "silent tile": "nothing states the unit of",
}  # fmt: skip
MARKS = (-9999.0, -32767.0, -32768.0)
"""Raw numbers that are voids wherever they stand."""
BOX = (-1200.0, -1200.0, 1200.0, 1200.0)
POINTS = 60
SHORE_M = 5.0

Load = Callable[[TerrainSpec, Frame], Surface]


def load(spec: TerrainSpec, frame: Frame) -> Surface:
    """The surface as a mission reads it."""
    return open_dem(spec, where="terrain").around(frame, BOX).load(frame, BOX)


@dataclass
class Tally:
    """The outcomes of the cases: how many were read, how many refused for which reason, and the faults."""

    read: int = 0
    formats: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    two_heights: int = 0
    voids: int = 0
    faults: list[str] = field(default_factory=list)

    def lines(self) -> list[str]:
        why = ", ".join(f"{count} {reason}" for reason, count in self.refused.most_common())
        of = ", ".join(f"{count} {name}" for name, count in sorted(self.formats.items()))
        return [
            f"{sum(self.formats.values())} cases ({of}): {self.read} read, {self.two_heights} of them with two heights "
            f"and {self.voids} with voids; {self.refused.total()} refused: {why or 'none'}",
            *self.faults,
            f"{len(self.faults)} faults",
        ]


@dataclass
class Case:
    """One terrain: its spec, and what must become of it.

    ``reasons``: for one of these it must be refused; else ``low``, ``high`` (rows, cols) are the metres of the nodes,
    and ``at(lat, lon)`` gives columns and rows. ``spare_m``: how far heights may be off.
    """

    spec: TerrainSpec
    frame: Frame
    reasons: set[str]
    low: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    high: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    at: Callable[[Floats, Floats], tuple[Floats, Floats]] | None = None
    spare_m: float = 1e-3


def bilinear(z: Floats, col: Floats, row: Floats) -> Floats:
    i, j = np.floor(col).astype(int), np.floor(row).astype(int)
    u, v = col - i, row - j
    return np.asarray(
        (1 - u) * (1 - v) * z[j, i] + u * (1 - v) * z[j, i + 1] + (1 - u) * v * z[j + 1, i] + u * v * z[j + 1, i + 1]
    )


# -- statements -------------------------------------------------------------------------------------------------------


@dataclass
class Statements:
    """The statements on heights, by who makes them; None if nobody does."""

    key: str | None
    key_unit: float | None
    key_name: str | None
    own_code: int | None
    height_unit: str | None
    reasons: set[str]

    @classmethod
    def draw(cls, rng: np.random.Generator, *, own: bool) -> Statements:
        reasons: set[str] = set()

        def code() -> int:
            group = rng.choice(["up", "up", "up", "up", "up", "up", "down", "other"])
            codes = {"up": tuple(HEIGHT_CODES), "down": DEPTH_CODES, "other": OTHER_ZERO_CODES}[group]
            return int(rng.choice(codes))

        def unit_of(number: int) -> tuple[float | None, str | None]:
            if number in DEPTH_CODES:
                reasons.add("depths")
                return None, None
            if number in OTHER_ZERO_CODES:
                reasons.add("another zero")
                return None, None
            return HEIGHT_CODES[number]

        own_code = code() if own and rng.random() < 0.35 else None
        key, key_unit, key_name = None, None, None
        way = rng.random()
        if way < 0.35 or (own_code is None and way < 0.5):
            number = own_code if own_code is not None and rng.random() < 0.7 else code()
            key = f"{rng.choice(['EPSG:', 'epsg:', 'EPSG:4326+'])}{number}"
            if (odd := rng.random()) < 0.06:
                number = int(rng.choice([*COMPOUND_CODES]))
                key, (key_unit, key_name) = f"EPSG:{number}", COMPOUND_CODES[number]
            elif odd < 0.1:
                number = int(rng.choice([*ELLIPSOIDAL_CODES]))
                key, key_unit, key_name = f"EPSG:{number}", 1.0, "ellipsoid"
                reasons.add(ELLIPSOIDAL_CODES[number])
            else:
                key_unit, key_name = unit_of(number)
        elif way < 0.6 or own_code is None:
            key = str(rng.choice(list(WORDS)))
            key_name = WORDS[key]
            if rng.random() < 0.04:
                key, key_name = "WGS84", "ellipsoid"
        own_name = None
        if own_code is not None:
            own_name = unit_of(own_code)[1]
        if key is None and own_code is None:
            reasons.add("no datum")
        if key_name is not None and own_name is not None and key_name not in (own_name, "AMSL"):
            reasons.add("two datums")
        if key == "WGS84":
            reasons.add("ellipsoid")
        if rng.random() < 0.03 and not reasons:  # a refusal by a key stays, also without the key
            key, key_unit, key_name = None, None, None
            if own_code is None:
                reasons.add("no datum")
        height_unit = str(rng.choice(list(KEY_UNITS))) if rng.random() < 0.25 else None
        return cls(key, key_unit, key_name, own_code, height_unit, reasons)

    def spec(self, dem: tuple[str, ...], nodata: Any, crs: str | None = None) -> TerrainSpec:
        """The keys of a mission."""
        unit: Any = self.height_unit
        return TerrainSpec(dem=dem, crs=crs, vertical_datum=self.key, height_unit=unit, nodata=nodata)

    def metres(self, band: str | None, *, feet_grid: bool, by_format: bool = False) -> float:
        """Metres of one unit of the file's numbers; what forbids that goes to ``reasons``."""
        own = None if self.own_code is None else HEIGHT_CODES.get(self.own_code, (None, ""))[0]
        units = [u for u in (self.key_unit, own) if u is not None]
        if band is not None and band in UNIT_WORDS:
            units.append(UNIT_WORDS[band])
        if by_format:
            units.append(1.0)
        if self.height_unit is not None:
            return KEY_UNITS[self.height_unit]
        if band is not None and band not in UNIT_WORDS:
            self.reasons.add("unknown unit")
        if any(abs(u / units[0] - 1.0) > 1e-7 for u in units[1:]):
            self.reasons.add("two units")
        if not units and feet_grid:
            self.reasons.add("no unit")
        return units[0] if units else 1.0


# -- rasters ----------------------------------------------------------------------------------------------------------


def shoreless(z: Floats) -> Floats:
    """True at patches of exact 0 that touch no node within `SHORE_M` of 0 but some node at all; by flooding."""
    void = np.zeros(z.shape, bool)
    seen = np.zeros(z.shape, bool)
    for at in np.argwhere(z == 0.0):
        if seen[tuple(at)]:
            continue
        seen[tuple(at)] = True
        patch, queue, near = [], [tuple(at)], math.inf
        while queue:
            r, c = queue.pop()
            patch.append((r, c))
            for a in range(max(r - 1, 0), min(r + 2, z.shape[0])):
                for b in range(max(c - 1, 0), min(c + 2, z.shape[1])):
                    if z[a, b] == 0.0 and not seen[a, b]:
                        seen[a, b] = True
                        queue.append((a, b))
                    elif z[a, b] != 0.0 and not math.isnan(z[a, b]):
                        near = min(near, abs(z[a, b]))
        if SHORE_M < near < math.inf:
            for at_patch in patch:
                void[at_patch] = True
    return void


def slopes(rng: np.random.Generator, rows: int, cols: int, low: float, high: float) -> Floats:
    """Smooth hills between two heights, metres."""
    c, r = np.meshgrid(np.linspace(0, 6, cols), np.linspace(0, 6, rows))
    wave = np.sin(c * rng.uniform(0.5, 1.5) + rng.uniform(0, 6)) * np.cos(r * rng.uniform(0.5, 1.5) + rng.uniform(0, 6))
    return np.asarray(low + (high - low) * 0.5 * (1.0 + wave))


def raster_case(rng: np.random.Generator, folder: Path, kind: str) -> Case:
    """A GeoTIFF or an .asc of 120 × 120 nodes, at times two that overlap."""
    feet_grid = kind == "tif" and rng.random() < 0.2
    stated = Statements.draw(rng, own=True)
    band = str(rng.choice([*UNIT_WORDS, "fathoms", "m/10", "0.1 ft"])) if rng.random() < 0.3 else None
    metres = stated.metres(band, feet_grid=feet_grid)
    n = 120
    low, high = (40.0, 400.0) if rng.random() < 0.8 else (-430.0, -300.0)  # the Dead Sea
    truth = slopes(rng, n, n, low, high)
    scale, offset = 1.0, 0.0
    if kind == "tif" and stated.own_code is None and rng.random() < 0.25:  # GDAL writes no scale beside a vertical part
        scale, offset = float(rng.choice([0.5, 0.1])), float(rng.choice([0.0, 50.0]))
    raw = np.round((truth / metres - offset) / scale)
    dtype = "int16" if kind == "tif" and np.abs(raw).max() < 30_000 and rng.random() < 0.5 else "float32"
    raw = raw.astype(dtype).astype(float)
    nodata, key_nodata = _voids(rng, raw, metres * scale)
    second = None
    if rng.random() < 0.25:
        second = raw + np.round(rng.uniform(-60.0, 60.0) / metres / scale)
        second = second.astype(dtype).astype(float)
        known = raw != (key_nodata if isinstance(key_nodata, float) else nodata)
        second = np.where(known & (raw != 0.0), second, raw)
        if rng.random() < 0.5:
            second[:, : n // 2] = raw[:, : n // 2]
    surfaces = [raw] if second is None else [raw, second]
    bands = [band, band]
    if second is not None and band in UNIT_WORDS and rng.random() < 0.3:  # the second tile is silent
        bands[1] = None
        own_unit = None if stated.own_code is None else HEIGHT_CODES.get(stated.own_code, (None, ""))[0]
        if stated.height_unit is None and stated.key_unit is None and own_unit is None:
            stated.reasons |= ({"silent tile"} if UNIT_WORDS[band] != 1.0 else set()) | (
                {"no unit"} if feet_grid else set()
            )
    read = []
    for z in surfaces:
        m = np.where(np.isin(z, MARKS), np.nan, z)
        m = np.where(z == nodata, np.nan, m) if nodata is not None else m
        m = np.where(z == key_nodata, np.nan, m) if isinstance(key_nodata, float) else m
        m = (m * scale + offset) * metres
        read.append(np.where((m >= -500.0) & (m <= 9000.0), m, np.nan))
    low_m, high_m = np.fmin.reduce(read), np.fmax.reduce(read)
    if key_nodata is None:
        void = shoreless(high_m) | shoreless(low_m)
        low_m, high_m = (np.where(void, np.nan, z) for z in (low_m, high_m))
    frame, transform, at, spare_m = _place(rng, feet_grid, n)
    crs = "EPSG:2264" if feet_grid else "EPSG:4326"
    own = crs if stated.own_code is None else f"{crs}+{stated.own_code}"
    paths, by_key = [], kind == "asc" and rng.random() < 0.3
    for k, z in enumerate(surfaces):
        path = folder / f"{k}.{kind}"
        if kind == "tif":
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                with rasterio.open(
                    path, "w", driver="GTiff", width=n, height=n, count=1, dtype=dtype, crs=own, transform=transform,
                    nodata=nodata, GEOTIFF_VERSION=str(rng.choice(["1.0", "1.1"])),
                ) as file:  # fmt: skip
                    file.write(z.astype(dtype), 1)
                    file.scales, file.offsets = (scale,), (offset,)
                    if bands[k] is not None:
                        file.units = (bands[k],)
        else:
            head = f"ncols {n}\nnrows {n}\nxllcorner {transform.c!r}\nyllcorner {transform.f - n * transform.a!r}\n"
            head += f"cellsize {transform.a!r}\n" + (f"NODATA_value {nodata:g}\n" if nodata is not None else "")
            path.write_text(head + "\n".join(" ".join(f"{x:.10g}" for x in line) for line in z))
            if not by_key:
                (folder / f"{k}.prj").write_text(CRS(own).to_wkt("WKT1_ESRI"))
            if bands[k] is not None:
                xml = (
                    f'<PAMDataset><PAMRasterBand band="1"><UnitType>{bands[k]}</UnitType></PAMRasterBand></PAMDataset>'
                )
                (folder / f"{k}.asc.aux.xml").write_text(xml)
        paths.append(str(path))
    spec = stated.spec(tuple(paths), key_nodata, own if by_key else None)
    return Case(spec, frame, stated.reasons, low_m, high_m, at, spare_m)


def _voids(rng: np.random.Generator, raw: Floats, metres: float) -> tuple[float | None, Any]:
    """Put a void into raw heights; returns the file's nodata and the key's."""
    way = str(
        rng.choice(
            ["none", "none", "declared", "undeclared", "mark", "zero", "lake", "key", "zeros are ground", "all sea"]
        )
    )
    r, c = rng.integers(50, 64, 2)
    hole = slice(r, r + int(rng.integers(1, 9))), slice(c, c + int(rng.integers(1, 9)))
    if way == "declared":
        raw[hole] = -9999.0
        return -9999.0, None
    if way == "undeclared":
        raw[hole] = -32768.0
    elif way == "mark":
        raw[hole] = rng.choice(MARKS)
    elif way in ("zero", "lake", "zeros are ground"):
        raw[hole] = 0.0
        if way == "lake":
            raw[hole[0].stop, hole[1].start] = max(1.0, math.floor(3.0 / metres)) if metres <= 3.0 else 0.0
    elif way == "key":
        raw[hole] = 12345.0
        return None, 12345.0
    elif way == "all sea":
        raw[:] = 0.0
    return None, "none" if way == "zeros are ground" else None


def _place(
    rng: np.random.Generator, feet_grid: bool, n: int
) -> tuple[Frame, Affine, Callable[[Floats, Floats], tuple[Floats, Floats]], float]:
    """The frame, the grid's transform, columns and rows of places, and how far heights may be off."""
    if feet_grid:
        there = Transformer.from_crs("EPSG:4326", "EPSG:2264", always_xy=True)
        lat, lon = float(rng.uniform(35.2, 35.9)), float(rng.uniform(-83.0, -79.0))
        x, y = there.transform(lon, lat)
        step = 150.0
        west, north = x - n * step / 2, y + n * step / 2

        def at(lat: Floats, lon: Floats) -> tuple[Floats, Floats]:
            x, y = there.transform(lon, lat)
            return (np.asarray(x) - west) / step - 0.5, (north - np.asarray(y)) / step - 0.5

        return Frame(lat, lon), Affine(step, 0.0, west, 0.0, -step, north), at, 1.0
    lat, lon = float(rng.uniform(-60.0, 60.0)), float(rng.uniform(-170.0, 170.0))
    step = 0.0005
    west, north = lon - n * step / 2, lat + n * step / 2

    def in_degrees(lat: Floats, lon: Floats) -> tuple[Floats, Floats]:
        return (lon - west) / step - 0.5, (north - lat) / step - 0.5

    return Frame(lat, lon), Affine(step, 0.0, west, 0.0, -step, north), in_degrees, 0.02


# -- tiles of posts ---------------------------------------------------------------------------------------------------


def hgt_case(rng: np.random.Generator, folder: Path) -> Case:
    """A tile of 1201 posts a side, metres by its format, at times with a neighbour that differs along their border."""
    stated = Statements.draw(rng, own=False)
    metres = stated.metres(None, feet_grid=False, by_format=True)
    raw = np.round(slopes(rng, 1201, 1201, 40.0, 400.0) / (metres if stated.height_unit else 1.0))
    r, c = 600, 600
    key_nodata: Any = None
    if rng.random() < 0.3:
        raw[r : r + 5, c : c + 5] = -32768.0
    elif rng.random() < 0.4:
        raw[r : r + 5, c : c + 5] = 0.0
        key_nodata = "none" if rng.random() < 0.3 else None
    (folder / "N36W085.hgt").write_bytes(raw.astype(">i2").tobytes())
    if rng.random() < 0.3:
        return _neighbours(rng, folder, stated, raw, metres)
    z = np.where(raw == -32768.0, np.nan, raw) * metres
    if key_nodata is None:
        z[500:700, 500:700] = np.where(shoreless(z[500:700, 500:700]), np.nan, z[500:700, 500:700])
    spec = stated.spec(dem=(str(folder / "N36W085.hgt"),), nodata=key_nodata)

    def at(lat: Floats, lon: Floats) -> tuple[Floats, Floats]:
        return (lon + 85.0) * 1200.0, (37.0 - lat) * 1200.0

    return Case(spec, Frame(36.5, -84.5), stated.reasons, z, z, at, 0.02)


def _neighbours(rng: np.random.Generator, folder: Path, stated: Statements, west: Floats, metres: float) -> Case:
    """Two tiles whose common column of posts differs; the mission lies over it."""
    east = np.round(slopes(rng, 1201, 1201, 40.0, 400.0) / (metres if stated.height_unit else 1.0))
    off = np.round(rng.uniform(-40.0, 40.0, 1201) * (rng.random(1201) < 0.7))
    east[:, 0] = west[:, -1] + off
    if rng.random() < 0.5:
        east[590:600, 0:2] = -32768.0  # a void at the border of one tile is known from the other
    (folder / "N36W084.hgt").write_bytes(east.astype(">i2").tobytes())
    left, right = (np.where(z == -32768.0, np.nan, z) * metres for z in (west, east))
    low, high = (np.concatenate([left[:, :-1], end(left[:, -1:], right[:, :1]), right[:, 1:]], axis=1)
                 for end in (np.fmin, np.fmax))  # fmt: skip
    for z in (low, high):
        part = z[500:700, 1100:1300]
        part[shoreless(part)] = np.nan
    paths = (str(folder / "N36W085.hgt"), str(folder / "N36W084.hgt"))

    def at(lat: Floats, lon: Floats) -> tuple[Floats, Floats]:
        return (lon + 85.0) * 1200.0, (37.0 - lat) * 1200.0

    return Case(stated.spec(paths, None), Frame(36.5, -84.0), stated.reasons, low, high, at, 0.02)


def dat_case(rng: np.random.Generator, folder: Path) -> tuple[Case, Path]:
    """ArduPilot's files of a place, often at a degree line: what the autopilot reads lies between both heights."""
    stated = Statements.draw(rng, own=False)
    if stated.height_unit is not None:
        stated.reasons.add("own unit")
    if stated.key_unit is not None and stated.key_unit != 1.0:
        stated.reasons.add("in metres")
    key_nodata: Any = None
    if rng.random() < 0.1:
        key_nodata = 0.0
        stated.reasons.add("own voids")
    lat = float(rng.integers(-60, 60) + rng.choice([0.003, 0.5, 0.997]))
    lon = float(rng.integers(-170, 170) + rng.choice([0.003, 0.5, 0.997]))
    (north, east), waves_m = rng.uniform(-0.6, 0.6, 2), float(rng.choice([0.0, 5.0, 40.0]))
    wide = math.cos(math.radians(lat))

    def ground(lat_deg: Floats, lon_deg: Floats) -> Floats:
        away = (lon_deg - lon + 180.0) % 360.0 - 180.0
        waves = waves_m * np.sin(lat_deg * 2000.0) * np.cos(away * 2000.0)
        return np.asarray(3500.0 + 111_000.0 * (north * (lat_deg - lat) + east * wide * away) + waves)

    path = write_dat(folder / "terrain", lat, lon, reach_deg=0.06, ground=ground)
    spec = stated.spec(dem=(str(path),), nodata=key_nodata)
    return Case(spec, Frame(lat, lon), stated.reasons, spare_m=2.1 if waves_m == 0.0 else math.inf), path


# -- the judgement ----------------------------------------------------------------------------------------------------


def attempt(seed: int, tally: Tally, reader: Load = load) -> None:
    """One case; its faults go to the tally."""
    rng = np.random.default_rng(seed)
    kind = str(rng.choice(["tif", "tif", "tif", "asc", "asc", "hgt", "dat"]))
    tally.formats[kind] += 1

    def fault(words: str) -> None:
        tally.faults.append(f"seed {seed} ({kind}): {words}")

    with tempfile.TemporaryDirectory() as name:
        folder, dat = Path(name), None
        if kind == "dat":
            case, dat = dat_case(rng, folder)
        else:
            case = hgt_case(rng, folder) if kind == "hgt" else raster_case(rng, folder, kind)
        try:
            surface = reader(case.spec, case.frame)
        except InputError as why:
            found = {reason for reason, words in REASONS.items() if words in str(why)}
            if not case.reasons or not found & case.reasons:
                fault(f"refused ({re.sub(r'/tmp/[^ ]*/', '', str(why))[:160]}), expected {case.reasons or 'heights'}")
            tally.refused[next(iter(sorted(found & case.reasons)), "another reason")] += 1
            return
        if case.reasons:
            fault(f"read, and must be refused for {case.reasons}: {case.spec}")
            return
        tally.read += 1
        plane = rng.uniform(-1000.0, 1000.0, (POINTS, 2))
        degrees = case.frame.to_degrees(plane[:, 0], plane[:, 1])
        if dat is not None:
            true = np.array([interpolated(dat, *(math.floor(x * 1e7) for x in d)) for d in degrees])
            expected = true, true
        else:
            assert case.at is not None
            at = case.at(degrees[:, 0], degrees[:, 1])
            expected = bilinear(case.low, *at), bilinear(case.high, *at)
    got = surface.ground_at(*plane.T), surface.high_at(*plane.T)
    tally.two_heights += bool((got[1] > got[0] + 1e-6).any())
    tally.voids += bool(np.isnan(got[0]).any())
    if dat is not None:
        if not (got[0] <= expected[0] + 0.03).all() or not (got[1] >= expected[0] - 0.03).all():
            fault("what the autopilot reads lies outside of both heights")
        if (got[1] - got[0]).max() > case.spare_m:
            fault(f"a plane has two heights {(got[1] - got[0]).max():.1f} m apart")
        return
    near = _beside_voids(case, at)
    for name, a, b in zip(("least", "greatest"), got, expected, strict=True):
        if (np.isnan(a) != np.isnan(b))[~near].any():
            fault(f"{name}: {np.isnan(a).sum()} places unknown, expected {np.isnan(b).sum()}; {case.spec}")
        off = np.abs(a - b)[~np.isnan(a) & ~np.isnan(b)]
        if off.size and off.max() > case.spare_m:
            fault(f"{name}: off by {off.max():.3f} m; {case.spec}")
    world = World(case.frame, Airspace(surface))
    spread = world.spread_m(case.frame.lat_deg, case.frame.lon_deg)
    here = case.at(np.array([case.frame.lat_deg]), np.array([case.frame.lon_deg]))
    by_hand = float(bilinear(case.high, *here)[0] - bilinear(case.low, *here)[0])
    if not math.isnan(by_hand) and abs(spread - by_hand) > 2.0 * case.spare_m:
        fault(f"home's two heights are {spread:.3f} m apart, expected {by_hand:.3f}")


def _beside_voids(case: Case, at: tuple[Floats, Floats]) -> Floats:
    """Places so near to a cell's border that a datum shift may put them into the next one."""
    if case.spare_m < 0.5:
        return np.zeros(len(at[0]), bool)
    return np.minimum(*(np.abs(a - np.rint(a)) for a in at)) < 0.2


def run(seconds: float, seed: int, *, most: int | None = None, reader: Load = load) -> Tally:
    """Cases from ``seed`` on, for so many seconds, or ``most`` of them."""
    tally, until_s, k = Tally(), time.monotonic() + seconds, 0
    while time.monotonic() < until_s and (most is None or k < most):
        attempt(seed + k, tally, reader)
        k += 1
    return tally


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    tally = run(given.seconds, given.seed)
    print("\n".join(tally.lines()))
    return 1 if tally.faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
