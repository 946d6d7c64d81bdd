"""Inputs of a given size, one kind for each amount that a user's file decides: corners, arcs, zones, items, cells, …

``write(kind, count, seed)`` writes the files of one input into the current folder and returns the arguments of
``gcsplan``. All inputs lie around one place on flat ground, so that the amount alone makes the work.

    python -m tests.campaigns.sizes KIND COUNT [SEED]     # writes one input here, and prints its command

`campaign` runs inputs at the limits that docs/safety.md states, below and beyond them. Each must end with an exit code
of the contract within its stated time and memory; beyond a limit it may be refused by name (exit 2) instead.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import math
import os
import random
import re
import shlex
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import yaml
from rasterio.transform import Affine

from gcsplan.cli import main

LAT, LON = 46.0, 14.5
NORTH_M, EAST_M = 111_160.0, 77_300.0
"""Metres of a degree at this place, roughly."""

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
    """Write ``m.yaml``: one copter over flat ground; ``keys`` replace those of the file, or of its vehicle."""
    start, end = degrees([(0.0, 0.0), goal])
    vehicle: dict[str, object] = {
        "name": "u", "sysid": 1, "autopilot": "arducopter", "start": start, "goal": end, "speed_m_s": [3, 10],
    }  # fmt: skip
    vehicle |= {
        k: keys.pop(k) for k in ("via", "turn_radius_m", "autopilot", "takeoff_heading_deg", "end") if k in keys
    }
    document: dict[str, object] = {
        "version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 30}, "no_fly": no_fly or [],
        "vehicles": [vehicle], "planner": {"budget_s": 5},
    }  # fmt: skip
    Path("m.yaml").write_text(yaml.safe_dump(document | keys, default_flow_style=None))
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
    """A line that runs to and fro over a field, as a survey does, around the spiky ring."""
    return [(40.0 * (k // 2), 1500.0 + 400.0 * ((k // 2 + k) % 2)) for k in range(count)]


# -- kinds -------------------------------------------------------------------------------------------------------------


def corners(count: int, rng: random.Random) -> list[str]:
    ring_file(spiky(count, rng))
    return ["plan", *mission([{"file": "zones.geojson"}]), "-o", "out", "--json"]


def coast(count: int, rng: random.Random) -> list[str]:
    ring_file(smooth(count, rng))
    return ["plan", *mission([{"file": "zones.geojson"}]), "-o", "out", "--json"]


def corners_checked(count: int, rng: random.Random) -> list[str]:
    ring_file(spiky(count, rng))
    waypoints([(300.0 + 10.0 * k, 950.0) for k in range(300)])
    return ["check", *mission([{"file": "zones.geojson"}]), "u.waypoints", "--json"]


def corners_at_home(count: int, rng: random.Random) -> list[str]:
    return [*corners(count, rng), "--way-home"]


def corners_fenced(count: int, rng: random.Random) -> list[str]:
    return [*corners(count, rng), "--fence"]


def corners_drawn(count: int, rng: random.Random) -> list[str]:
    return [*corners(count, rng), "--report"]


def crossing(count: int, rng: random.Random) -> list[str]:
    """An ED-269 ring that crosses itself everywhere."""
    points = degrees([(rng.uniform(-2000.0, 2000.0), rng.uniform(500.0, 4500.0)) for _ in range(count)])
    ring = [[lon, lat] for lat, lon in [*points, points[0]]]
    geometry = {
        "uomDimensions": "M", "lowerLimit": 0, "lowerVerticalReference": "AGL", "upperLimit": 120,
        "upperVerticalReference": "AGL", "horizontalProjection": {"type": "Polygon", "coordinates": [ring]},
    }  # fmt: skip
    zone = {
        "identifier": "Z1", "country": "SVN", "name": "crossing", "type": "COMMON", "restriction": "PROHIBITED",
        "reason": ["OTHER"], "applicability": [{"permanent": "YES"}], "zoneAuthority": [{"name": "a"}],
        "geometry": [geometry],
    }  # fmt: skip
    Path("zones.json").write_text(json.dumps({"title": "t", "description": "d", "features": [zone]}))
    return ["plan", *mission([{"file": "zones.json"}], at="2026-11-24T10:00Z"), "-o", "out", "--json"]


def arcs(count: int, rng: random.Random) -> list[str]:
    """An OpenAir zone of many whole circles' arcs around one centre."""
    lines = ["AC R", "AN arcs", "AL GND", "AH 1000 ft", f"V X={_dms(LAT)} N {_dms(LON)} E"]
    lines += [
        f"DA {rng.uniform(3.0, 4.0):.3f},{rng.uniform(0, 360):.1f},{rng.uniform(0, 360):.1f}" for _ in range(count)
    ]
    Path("zones.txt").write_text("\n".join(lines) + "\n")
    return ["plan", *mission([{"file": "zones.txt"}]), "-o", "out", "--json"]


def cylinders(count: int, rng: random.Random) -> list[str]:
    features = []
    for k in range(count):
        [[lat, lon]] = degrees([(rng.uniform(-9000.0, 9000.0), rng.uniform(600.0, 9000.0))])
        point = {"type": "Point", "coordinates": [lon, lat]}
        features.append({"type": "Feature", "properties": {"name": f"z{k}", "radius_m": 40}, "geometry": point})
    Path("zones.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return ["plan", *mission([{"file": "zones.geojson"}]), "-o", "out", "--json"]


def wide_cylinders(count: int, rng: random.Random) -> list[str]:
    """Circles of 60 km that all lie over each other."""
    arguments = cylinders(count, rng)
    data = json.loads(Path("zones.geojson").read_text())
    for feature in data["features"]:
        [[lat, lon]] = degrees([(rng.uniform(92_000.0, 108_000.0), rng.uniform(-20_000.0, 20_000.0))])
        feature["geometry"]["coordinates"] = [lon, lat]
        feature["properties"]["radius_m"] = 60_000
    Path("zones.geojson").write_text(json.dumps(data))
    return arguments


def great_circles(count: int, rng: random.Random) -> list[str]:
    """Polygons of KML around the mission with edges of three degrees, each of which is drawn as a great circle too."""
    marks = []
    for k in range(count):
        lat, lon = LAT + 0.5 + rng.uniform(-0.1, 0.1), LON + rng.uniform(-0.2, 0.2)
        turn = [math.pi * n / 4.0 for n in range(9)]
        ring = " ".join(f"{lon + 3.0 * math.cos(t):.6f},{lat + 0.3 * math.sin(t):.6f},0" for t in turn)
        marks.append(
            f"<Placemark><name>z{k}</name><Polygon><outerBoundaryIs><LinearRing><coordinates>{ring}</coordinates>"
            f"</LinearRing></outerBoundaryIs></Polygon></Placemark>"
        )
    Path("zones.kml").write_text(
        f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{"".join(marks)}</Document></kml>'
    )
    return ["plan", *mission([{"file": "zones.kml"}]), "-o", "out", "--json"]


def forest(count: int, rng: random.Random) -> list[str]:
    """Many circles in the way, between start and goal."""
    arguments = cylinders(count, rng)
    data = json.loads(Path("zones.geojson").read_text())
    for feature in data["features"]:
        [[lat, lon]] = degrees([(rng.uniform(300.0, 3700.0), rng.uniform(-3000.0, 3000.0))])
        feature["geometry"]["coordinates"] = [lon, lat]
        feature["properties"]["radius_m"] = 5
    Path("zones.geojson").write_text(json.dumps(data))
    return arguments


def corridor(count: int, rng: random.Random) -> list[str]:
    """A corridor around a line of random points."""
    line = degrees([(rng.uniform(-2000.0, 2000.0), rng.uniform(500.0, 4500.0)) for _ in range(count)])
    return ["plan", *mission([{"name": "c", "line": line, "buffer_m": 50}]), "-o", "out", "--json"]


def river(count: int, rng: random.Random) -> list[str]:
    """A corridor around a winding line, as power lines and rivers are."""
    line = [(8.0 * k - 4.0 * count, 800.0 + 300.0 * math.sin(0.01 * k) + rng.uniform(-3.0, 3.0)) for k in range(count)]
    return ["plan", *mission([{"name": "c", "line": degrees(line), "buffer_m": 50}]), "-o", "out", "--json"]


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
    """Terrain in ``count`` tiles, of which more than are taken are only named."""
    if count > REFUSED["tiles"]:
        names = [f"t{k}.tif" for k in range(count)]
        return ["plan", *mission(terrain={"dem": names, "vertical_datum": "EGM96"}), "-o", "out", "--json"]
    side = math.ceil(math.sqrt(count))
    step = 0.2 / (side * 20)
    names = []
    for k in range(count):
        r, c = divmod(k, side)
        names.append(f"t{k}.tif")
        corner = Affine(step, 0, LON - 0.1 + c * 20 * step, 0, -step, LAT + 0.1 - r * 20 * step)
        with rasterio.open(
            names[-1], "w", driver="GTiff", width=20, height=20, count=1, dtype="float32", crs="EPSG:4326",
            transform=corner,
        ) as file:  # fmt: skip
            file.write(np.full((20, 20), 100.0 + rng.random(), np.float32), 1)
    return ["plan", *mission(terrain={"dem": names, "vertical_datum": "EGM96"}), "-o", "out", "--json"]


def fleet(count: int, rng: random.Random) -> list[str]:
    """Vehicles side by side that fly to the other side."""
    fliers = []
    for k in range(count):
        start, goal = degrees(
            [(60.0 * (k % 100), -60.0 * (k // 100)), (60.0 * ((k + 7) % 100), 2000.0 + 60.0 * (k // 100))]
        )
        fliers.append({"name": f"u{k}", "sysid": k % 250 + 1, "autopilot": "arducopter", "start": start, "goal": goal,
                       "speed_m_s": [3, 10]})  # fmt: skip
    arrival = {"mode": "none", "separation_m": 20}
    return ["plan", *mission(vehicles=fliers, arrival=arrival), "-o", "out", "--json"]


def long_wing(count: int, rng: random.Random) -> list[str]:
    """A fixed wing's flight of ``count`` kilometres."""
    keys: dict[str, Any] = {"autopilot": "arduplane", "turn_radius_m": 100, "takeoff_heading_deg": 90, "end": "loiter"}
    return ["plan", *mission(goal=(1000.0 * count, 100.0), **keys), "-o", "out", "--report", "--json"]


def runs(count: int, rng: random.Random) -> list[str]:
    return ["rehearse", *mission(), "--runs", str(count), "--gusts", "1", "--json"]


def log(count: int, rng: random.Random) -> list[str]:
    """A flight log of that many lines."""
    lines = ["time_s,lat,lon,alt_m,power_w"]
    for k in range(count):
        lat, lon = LAT + 0.00005 * (k % 500), LON
        lines.append(
            f"{0.1 * k:.1f},{lat:.7f},{lon:.7f},{100.0 + 0.1 * (k % 300):.1f},{300.0 + rng.uniform(-20, 20):.1f}"
        )
    Path("log.csv").write_text("\n".join(lines) + "\n")
    return ["fit-energy", "log.csv"]


def _dms(value: float) -> str:
    minutes = 60.0 * (value - int(value))
    return f"{int(value)}:{int(minutes):02d}:{60.0 * (minutes - int(minutes)):04.1f}"


Kind = Callable[[Any, random.Random], list[str]]

KINDS: dict[str, Kind] = {
    f.__name__: f
    for f in (
        corners, coast, corners_checked, corners_at_home, corners_fenced, corners_drawn, crossing, arcs, cylinders,
        wide_cylinders, great_circles, forest, corridor, river, items, items_at_home, items_drawn, splines, jumps,
        vias, cells, tiles, fleet, long_wing, runs, log,
    )
}  # fmt: skip


FILES = {
    "corners_checked": 20_000, "crossing": 250, "arcs": 500, "items": 10_000, "items_at_home": 650, "splines": 650,
    "jumps": 650, "log": 500_000,
}  # fmt: skip
"""Kinds that are read and checked, without a planner, with an amount whose time docs/safety.md states."""

WORLDS = {
    "corners": 20_000, "coast": 90_000, "corners_fenced": 20_000, "corners_drawn": 20_000, "corridor": 4000,
    "river": 20_000, "cylinders": 20_000, "wide_cylinders": 20_000, "forest": 20_000, "vias": 300, "cells": 49,
    "tiles": 1000, "fleet": 100, "long_wing": 150, "runs": 100, "great_circles": 800,
}  # fmt: skip
"""Kinds that are planned, the same."""

REFUSED = {
    "crossing": 2000, "arcs": 5000, "items": 10_000, "log": 1_000_000, "coast": 100_000, "corners": 100_000,
    "corners_checked": 100_000, "corridor": 20_000, "river": 20_000, "cylinders": 20_000, "forest": 20_000, "vias": 500,
    "cells": 51, "tiles": 2000, "fleet": 2000, "runs": 10_000,
}  # fmt: skip
"""Amounts beyond which an input of that kind must be refused by name."""

BEYOND, AT_LIMIT, OFTEN = 3, 0.03, 8
"""Inputs beyond a limit have up to so many times its amount; part of the inputs that are no larger than
FILES and WORLDS say; how much more often kinds that are refused at once are drawn than others."""

PATIENCE_S, MEMORY_MB = 60.0, 1000.0
"""Most processor seconds and megabytes of one input."""

CODES = {0, 2, 3, 4}


def run(kind: str, count: float, seed: int) -> tuple[int, float, float, str]:
    """Exit code, processor seconds, megabytes and last words of one input; written into the current folder.

    It runs in a fork of this process, which has imported the commands already: that is most of the time of an input
    that is refused.
    """
    arguments = write(kind, count, seed)
    with tempfile.TemporaryFile("w+") as err:
        process = os.fork()
        if process == 0:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            os.dup2(err.fileno(), 2)
            sys.argv = ["gcsplan", *arguments]
            try:
                main.entry()
            except SystemExit as end:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(end.code if isinstance(end.code, int) else 70)
            finally:
                os._exit(70)
        until = time.monotonic() + 10.0 * PATIENCE_S  # busy machines
        while not (ended := os.wait4(process, os.WNOHANG))[0]:
            if time.monotonic() > until:
                os.kill(process, signal.SIGKILL)
                ended = os.wait4(process, 0)
                break
            time.sleep(0.01)
        err.seek(0)
        words = err.read()[-300:]
    used = ended[2]
    return os.waitstatus_to_exitcode(ended[1]), used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0, words


def faults(code: int, took_s: float, held_mb: float, words: str) -> list[str]:
    """What is wrong with how an input ended."""
    found = [] if code in CODES else [f"ended with {code}: {words}"]
    found += [f"took {took_s:.1f} s of the processor"] if took_s > PATIENCE_S else []
    found += [f"held {held_mb:.0f} MB"] if held_mb > MEMORY_MB else []
    found += [f"a traceback: {words}"] if "Traceback" in words else []
    return found


def campaign(kinds: dict[str, int], seconds: float, seed: int, inputs: int = 10**9) -> int:
    """Run inputs of random kinds and amounts, most of them beyond a limit; print faults and figures by kind.

    Faults are also inputs beyond a limit that are not refused; why they are is counted, without numbers and names.
    """
    until, done = time.monotonic() + seconds, 0
    importlib.import_module("gcsplan.cli.commands")
    importlib.import_module("gcsplan.app.outputs")
    reasons: Counter[str] = Counter()
    figures: dict[str, list[float]] = {kind: [0, 0, 0, 0.0, 0.0] for kind in kinds}
    while done < inputs and time.monotonic() < until:
        rng = random.Random(seed)
        kind = rng.choices(list(kinds), [OFTEN if k in REFUSED else 1 for k in kinds])[0]
        beyond = kind in REFUSED and rng.random() > AT_LIMIT
        if beyond:
            count = int(BEYOND ** rng.uniform(0.0, 1.0) ** 3 * REFUSED[kind]) + 1
        elif rng.random() > 3.0 * AT_LIMIT and kind not in REFUSED:  # those that are never refused cost their time
            count = max(4, int(BEYOND ** rng.uniform(-5.0, -2.0) * kinds[kind]))
        else:
            count = kinds[kind] if rng.random() < 0.5 else max(4, int(BEYOND ** rng.uniform(-3.0, 0.0) * kinds[kind]))
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            code, took_s, held_mb, words = run(kind, count, seed)
        wrong = faults(code, took_s, held_mb, words)
        wrong += [f"was not refused: {code}"] if beyond and code != 2 else []
        if code == 2:
            reasons[re.sub(r"[^ :]*[\d'][^ :]*", "#", words.strip().split("\n")[-1])[-150:]] += 1
        for what in wrong:
            print(f"seed {seed} ({kind} of {count}): {what}", flush=True)
        row = figures[kind]
        row[0], row[1], row[2] = row[0] + 1, row[1] + (code == 2), row[2] + bool(wrong)
        row[3], row[4] = max(row[3], took_s), max(row[4], held_mb)
        seed, done = seed + 1, done + 1
    for kind, (ran, refused, wrong_, took_s, held_mb) in figures.items():
        about = f"{ran:.0f} inputs, {refused:.0f} refused, {wrong_:.0f} faults"
        print(f"{kind:16} {about}, {took_s:.1f} s and {held_mb:.0f} MB at most")
    for why, many in reasons.most_common():
        print(f"{many:6} refused: {why}")
    print(f"{done} inputs, the next seed is {seed}")
    return 1 if any(row[2] for row in figures.values()) else 0


def write(kind: str, count: float, seed: int = 1) -> list[str]:
    """Write one input into the current folder; return the arguments of ``gcsplan``."""
    return KINDS[kind](count, random.Random(seed))


if __name__ == "__main__":
    print("gcsplan", shlex.join(write(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 1)))
