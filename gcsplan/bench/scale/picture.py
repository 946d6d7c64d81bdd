"""The picture of `scale`: processor time and memory against size, a panel for each axis, and one for a cluster."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gcsplan.bench.papers.pictures import png

TIME_COLOUR, MEMORY_COLOUR = "#1f77b4", "#d62728"


def draw(result: dict[str, Any]) -> bytes:
    """PNG: a panel for each axis, and one for the cluster if workers were measured."""
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
