"""The cost of planning by size: missions, vehicles, zones, cells of the DEM, workers; and an estimate for a cluster.

Every point is measured in a process of its own (`point`), on missions made from a seed (`missions`).
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gcsplan.bench.files import png, write_all
from gcsplan.bench.scale.missions import make_missions, make_mosaic
from gcsplan.errors import GcsplanError, UsageError
from gcsplan.export.table import csv_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AXES = ("missions", "vehicles", "zones", "cells", "workers")
MEASURED_VEHICLES = (1, 4, 16, 64)
MEASURED_ZONES = (0, 10, 100, 400)
MEASURED_POSTS = (60, 120, 240, 480)
"""Cells along a side of a made tile: 6, 3, 1.5 and 0.75 arc seconds."""
EACH = 4
"""Missions over which the cost of zones and cells is averaged."""
CORES = (1, 10, 100, 1000)
LONGEST_POINT_S = 3600.0
"""Seconds after which a point is given up."""
MOST_SCALE_MISSIONS, MOST_WORKERS = 10_000, 64
TIME_COLOUR, MEMORY_COLOUR = "#1f77b4", "#d62728"

SCALE_COLUMNS = (
    "axis", "size", "wall_s", "cpu_s", "own_cpu_s", "peak_mb", "planned", "refused", "speed_up", "speed_up_by_cpu",
    "start_s", "scheduler_ms", "item_bytes", "result_bytes", "done_again", "same_bytes",
)  # fmt: skip


def run(
    axes: Sequence[str] = AXES, missions: int = 40, workers: int = 2, seed: int = 1, *, kill: bool = False,
    tell: Callable[[str], None] = lambda line: None,
) -> dict[str, Any]:  # fmt: skip
    """Measure every axis.

    Args:
        axes: of `AXES`.
        missions: number of missions of the longest batch.
        workers: the most processes that share a batch; 2 and this many are measured beside one.
        seed: of the missions and of the made hills.
        kill: also kill one of the workers after a third of the batch.
        tell: called with a line before each point.

    Returns:
        ``settings``; ``rows``, one for each point (`SCALE_COLUMNS`); ``cluster`` (`cluster_of`), None without workers.

    Raises UsageError for sizes out of range, GcsplanError if a point ends with an error.
    """
    unknown = [a for a in axes if a not in AXES]
    if unknown or not axes:
        raise UsageError(f"axes are {', '.join(AXES)}, given {', '.join(unknown) or 'none'}")
    if not 4 <= missions <= MOST_SCALE_MISSIONS or not 2 <= workers <= MOST_WORKERS:
        raise UsageError(
            f"give 4 to {MOST_SCALE_MISSIONS} missions and 2 to {MOST_WORKERS} workers, not {missions} and {workers}"
        )
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="gcsplan-scale-") as folder:
        place = _ScaleFolder(Path(folder), seed, tell)
        for axis in AXES:
            if axis in axes:
                rows += _ROWS[axis](place, missions, workers, kill)
    shared = [row for row in rows if row["axis"] == "workers"]
    cluster = cluster_of(shared[0], shared[-2] if kill else shared[-1]) if shared else None
    settings = {"axes": list(axes), "missions": missions, "workers": workers, "seed": seed, "kill": kill}
    return {"settings": settings, "rows": rows, "cluster": cluster}


class _ScaleFolder:
    """The folder with everything made, and how points are measured there."""

    def __init__(self, folder: Path, seed: int, tell: Callable[[str], None]) -> None:
        self.folder, self.seed, self._tell = folder, seed, tell
        self._outs = 0

    def tiles(self, posts: int = 120) -> Path:
        """The mosaic of made hills."""
        folder = self.folder / f"hills-{posts}"
        if not folder.is_dir():
            make_mosaic(folder, self.seed, posts)
        return folder

    def missions(self, count: int) -> Path:
        """A folder of ``count`` missions."""
        folder = self.folder / f"missions-{count}"
        if not folder.is_dir():
            make_missions(folder, count, self.seed, self.tiles())
        return folder

    def batch(self, count: int, jobs: int, *, kill: bool = False) -> dict[str, Any]:
        """A batch of ``count`` missions."""
        self._outs += 1
        out = self.folder / f"out-{self._outs}"
        return self.measured("batch", missions=str(self.missions(count)), out=str(out), jobs=jobs, kill=kill)

    def measured(self, point: str, **given: Any) -> dict[str, Any]:
        """The figures of a point, from a process of its own."""
        sizes = {k: v for k, v in given.items() if isinstance(v, int) and k != "seed"}
        self._tell(f"{point}: {', '.join(f'{k} {v}' for k, v in sizes.items())}")
        command = [sys.executable, "-m", "gcsplan.bench.scale.point", json.dumps({"point": point, **given})]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_POINT_S, check=False)
        except subprocess.TimeoutExpired as error:
            raise GcsplanError(f"{point} took longer than {LONGEST_POINT_S:g} s") from error
        if done.returncode:
            last = done.stderr.strip().splitlines()[-1:] or ["no words"]
            raise GcsplanError(f"{point} ended with an error: {last[0]}")
        found: dict[str, Any] = json.loads(done.stdout)
        return found


def _missions(place: _ScaleFolder, missions: int, workers: int, kill: bool) -> list[dict[str, Any]]:
    sizes = sorted({max(1, missions // 8), max(1, missions // 4), missions // 2, missions})
    return [{"axis": "missions", "size": n} | place.batch(n, 1) for n in sizes]


def _vehicles(place: _ScaleFolder, missions: int, workers: int, kill: bool) -> list[dict[str, Any]]:
    return [{"axis": "vehicles", "size": n} | place.measured("vehicles", count=n) for n in MEASURED_VEHICLES]


def _zones(place: _ScaleFolder, missions: int, workers: int, kill: bool) -> list[dict[str, Any]]:
    given: dict[str, Any] = {"seed": place.seed, "tiles": str(place.tiles()), "missions": EACH}
    return [{"axis": "zones", "size": n} | place.measured("zones", zones=n, **given) for n in MEASURED_ZONES]


def _cells(place: _ScaleFolder, missions: int, workers: int, kill: bool) -> list[dict[str, Any]]:
    rows = []
    for posts in MEASURED_POSTS:
        row = place.measured("cells", posts=posts, seed=place.seed, tiles=str(place.tiles(posts)), missions=EACH)
        rows.append({"axis": "cells", "size": round(row["cells"])} | row)
    return rows


def _workers(place: _ScaleFolder, missions: int, workers: int, kill: bool) -> list[dict[str, Any]]:
    alone = place.batch(missions, 1)
    found = [(n, place.batch(missions, n)) for n in sorted({2, workers})]
    if kill:
        found.append((workers, place.batch(missions, workers, kill=True)))
    rows = [{"axis": "workers", "size": 1} | alone]
    for count, shared in found:
        # On a busy machine wall-clock time means little: take the least time on as many cores as there are workers.
        busiest_s = max(shared["own_cpu_s"], *shared["worker_cpu_s"], shared["cpu_s"] / count)
        rows.append(
            {
                "axis": "workers", "size": count, "same_bytes": shared["bytes_sha256"] == alone["bytes_sha256"],
                "speed_up": alone["wall_s"] / shared["wall_s"], "speed_up_by_cpu": alone["cpu_s"] / busiest_s,
            }
            | shared
        )  # fmt: skip
    return rows


_ROWS: dict[str, Callable[[_ScaleFolder, int, int, bool], list[dict[str, Any]]]] = {
    "missions": _missions, "vehicles": _vehicles, "zones": _zones, "cells": _cells, "workers": _workers,
}  # fmt: skip


def cluster_of(alone: dict[str, Any], shared: dict[str, Any]) -> dict[str, Any]:
    """The estimate for a cluster of `CORES`, by Amdahl's law, from one process and the most workers measured.

    ``piece_s``: a worker's processor time for a mission. ``serial_s``: processor time of the one process that hands
    out, collects and writes, its scheduler included, which nothing divides. ``serial_part``: its share of all work.
    """
    count = shared["missions"]
    piece_s, serial_s = sum(shared["worker_cpu_s"]) / count, shared["own_cpu_s"] / count
    cores = []
    for n in CORES:
        each_s = max(piece_s / n, serial_s) if n > 1 else alone["cpu_s"] / count
        cores.append(
            {"cores": n, "missions_per_s": 1.0 / each_s, "bound": "work" if piece_s / n > serial_s else "writer"}
        )
    return {
        "piece_s": piece_s, "serial_s": serial_s, "serial_part": serial_s / (serial_s + piece_s),
        "scheduler_ms": shared["scheduler_ms"], "item_bytes": shared["item_bytes"],
        "result_bytes": alone["result_bytes"], "cores": cores,
    }  # fmt: skip


def report(result: dict[str, Any]) -> str:
    """The figures as Markdown tables."""
    lines = []
    for axis in AXES:
        rows = [row for row in result["rows"] if row["axis"] == axis]
        if not rows:
            continue
        shared = axis == "workers"
        heads = [axis, "wall, s", "processor, s", "memory, MB", "planned"]
        heads += ["speed-up, wall", "by processor", "done again", "same bytes"] if shared else []
        lines += [f"| {' | '.join(heads)} |", f"|{' ---: |' * len(heads)}"]
        for row in rows:
            cells = [f"{row['size']:,}", f"{row['wall_s']:.2f}", f"{row['cpu_s']:.2f}", f"{row['peak_mb']:.0f}"]
            cells.append(str(row["planned"]))
            if shared:
                first = "speed_up" not in row
                cells += ["", "", "", ""] if first else [
                    f"{row['speed_up']:.2f}", f"{row['speed_up_by_cpu']:.2f}",
                    f"{row['done_again']}{', one killed' if row['killed'] else ''}",
                    "yes" if row["same_bytes"] else "NO",
                ]  # fmt: skip
            lines.append(f"| {' | '.join(cells)} |")
        lines.append("")
    cluster = result["cluster"]
    if cluster is not None:
        lines += [
            f"A mission takes a worker {cluster['piece_s']:.3f} s, and the process that hands out and writes "
            f"{1e3 * cluster['serial_s']:.1f} ms ({100 * cluster['serial_part']:.1f} % of all), of which the scheduler "
            f"has {cluster['scheduler_ms']:.1f} ms; {cluster['item_bytes']:.0f} bytes go out and "
            f"{cluster['result_bytes'] / 1e3:.0f} kB come back.",
            "",
            "| cores | missions per second | bounded by |",
            "| ---: | ---: | --- |",
            *(f"| {c['cores']:,} | {c['missions_per_s']:.1f} | {c['bound']} |" for c in cluster["cores"]),
        ]
    return "\n".join(lines).rstrip() + "\n"


def write(result: dict[str, Any], out: Path) -> list[Path]:
    """Write the figures as JSON, CSV and Markdown, and a picture. Raises InputError for a directory that cannot be."""
    rows = [{key: row.get(key, "") for key in SCALE_COLUMNS} for row in result["rows"]]
    return write_all(
        out,
        {
            "scale.json": json.dumps(result, indent=1) + "\n",
            "scale.csv": csv_text(SCALE_COLUMNS, rows),
            "scale.md": report(result),
            "scale.png": draw(result),
        },
    )


def draw(result: dict[str, Any]) -> bytes:
    """PNG: a panel for each axis, and one for the cluster if workers were measured."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    axes = list(result["settings"]["axes"])
    panels = len(axes) + (result["cluster"] is not None)
    rows = -(-panels // 2)
    figure = Figure(figsize=(9.0, 3.4 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    places = np.atleast_1d(figure.subplots(rows, min(2, panels), squeeze=False)).ravel()
    for place, axis in zip(places, axes, strict=False):
        _panel(place, axis, [row for row in result["rows"] if row["axis"] == axis and not row.get("killed")])
    if result["cluster"] is not None:
        _cluster(places[len(axes)], result["cluster"])
    for place in places[panels:]:
        place.set_axis_off()
    return png(figure)


def _panel(place: Axes, axis: str, rows: list[dict[str, Any]]) -> None:
    sizes = [row["size"] for row in rows]
    place.plot(sizes, [row["cpu_s"] for row in rows], "o-", color=TIME_COLOUR, label="processor time, s")
    place.plot(sizes, [row["wall_s"] for row in rows], "o:", color=TIME_COLOUR, alpha=0.6, label="wall, s")
    place.set(yscale="log", xlabel="cells of the DEM" if axis == "cells" else axis, ylabel="s")
    place.set_xscale("symlog" if min(sizes) < 1 else "log")
    place.grid(alpha=0.3)
    memory = place.twinx()
    memory.plot(sizes, [row["peak_mb"] for row in rows], "s--", color=MEMORY_COLOUR, ms=4, label="most memory, MB")
    memory.set_ylim(bottom=0.0)
    memory.set_ylabel("MB", color=MEMORY_COLOUR)
    lines = [*place.get_lines(), *memory.get_lines()]
    place.legend(lines, [str(line.get_label()) for line in lines], fontsize=8, frameon=False)


def _cluster(place: Axes, cluster: dict[str, Any]) -> None:
    cores = np.geomspace(1.0, 1000.0, 60)
    rate = 1.0 / np.maximum(cluster["piece_s"] / cores, cluster["serial_s"])
    place.plot(cores, rate, color=TIME_COLOUR, label="missions per second")
    place.axhline(1.0 / cluster["serial_s"], color="0.4", lw=0.8, ls="--", label="one process writes no faster")
    place.set(xscale="log", yscale="log", xlabel="cores, by Amdahl's law", ylabel="missions per second")
    place.grid(alpha=0.3)
    place.legend(fontsize=8, frameon=False)
