"""Pictures of a scenario as the papers have them: paths in space, box plots, and a fleet's distances over time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gcsplan.arrays import Floats
from gcsplan.bench.papers.pictures import COLOURS, COST_UNITS, best_run, png
from gcsplan.bench.papers.runs import Record
from gcsplan.bench.papers.scenarios import Set
from gcsplan.bench.papers.statistics import legal, schedule
from gcsplan.world.zones import Circle

CELLS = 60
"""Cells a side of the ground that is drawn in space."""
MOMENTS = 300
"""Moments at which a fleet's distances are drawn."""
TALL = 1.25
"""A zone without a top is drawn this many times as high as the highest path."""


def draw_space(summary: dict[str, Any]) -> bytes:
    """Ground, zones, the best run of each algorithm and the path of the planner optimal, in space; metres."""
    figure = Figure(figsize=(8.6, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    ax: Any = figure.add_subplot(projection="3d", computed_zorder=False)
    ready: Set = summary["set"]
    shown = {name: best_run(records) for name, records in summary["records"].items()}
    drawn = [np.array(p) for run in shown.values() if run is not None for p in run["paths"]]
    drawn += [np.array([p.start, p.goal]) for p in ready.problems]
    every = np.concatenate(drawn)
    _ground(ax, ready, every)
    for rank, ((name, run), colour) in enumerate(zip(shown.items(), COLOURS, strict=False)):
        for k, points in enumerate([] if run is None else run["paths"]):
            path = np.array(points)
            ax.plot(*path.T, color=colour, lw=1.6, zorder=20 - rank, label=None if k else name)
    for k, points in enumerate(summary["best_path"] or []):
        ax.plot(*np.array(points).T, color="black", lw=1.2, ls="--", zorder=21, label=None if k else "planner optimal")
    ax.set(xlabel="east, m", ylabel="north, m", zlabel="altitude, m AMSL")
    ax.view_init(elev=32.0, azim=-60.0)
    ax.set_title(f"{summary['name']}: best run of each algorithm", loc="left", fontsize=10)
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    return png(figure)


def _ground(ax: Any, ready: Set, places: Floats) -> None:
    (west, south, _), (east, north, top) = places.min(axis=0), places.max(axis=0)
    e, n = np.meshgrid(np.linspace(west, east, CELLS), np.linspace(south, north, CELLS))
    ground = ready.world.airspace.surface.ground_at(e, n)
    land = colormaps["terrain"](0.25 + 0.7 * (ground - ground.min()) / max(float(np.ptp(ground)), 1.0))
    ax.plot_surface(e, n, ground, facecolors=land, rstride=1, cstride=1, lw=0, alpha=0.75, shade=False, zorder=1)
    turn = np.linspace(0.0, 2.0 * np.pi, 25)
    for zone in ready.world.airspace.zones:
        if isinstance(zone.shape, Circle):
            level = zone.ceiling.value_m if zone.ceiling is not None else TALL * top
            x, y = (c + zone.shape.radius_m * f(turn) for c, f in
                    ((zone.shape.east_m, np.cos), (zone.shape.north_m, np.sin)))  # fmt: skip
            sides = np.stack([np.full_like(turn, float(ground.min())), np.full_like(turn, level)])
            ax.plot_surface(np.stack([x, x]), np.stack([y, y]), sides, color="#ffbf00", alpha=0.35, lw=0, zorder=2)


def draw_boxes(summary: dict[str, Any]) -> bytes:
    """Box plots of the cost and of the legal length of all runs, beside the planner optimal and its bound."""
    figure = Figure(figsize=(10.5, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    names = list(summary["records"])
    for ax, key in ((left, "cost"), (right, "length_m")):
        numbers = [spread(summary["records"][name], key) for name in names]
        labels = [f"{name}\n{len(some)}" for name, some in zip(names, numbers, strict=True)]
        ax.boxplot(numbers, tick_labels=labels, showfliers=True, medianprops={"color": COLOURS[0]})
        ax.grid(alpha=0.3, axis="y")
        ax.tick_params(axis="x", labelsize=8)
        flat = np.concatenate([*numbers, np.empty(0)])
        if len(flat) and flat.min() > 0.0 and flat.max() > 4.0 * flat.min():
            ax.set_yscale("log")
    left.set_ylabel(f"cost, {COST_UNITS[summary['paper']]}")
    right.set_ylabel("length of legal runs, m")
    for key, style in (("optimum_m", "--"), ("bound_m", ":")):
        if summary[key] is not None:
            right.axhline(summary[key], color="black", lw=1.0, ls=style, label=f"{key.partition('_')[0]} (planner)")
    right.legend(fontsize=8)
    figure.suptitle(f"{summary['name']}: box, quartiles; number of runs below", x=0.01, ha="left", fontsize=10)
    return png(figure)


def spread(records: Sequence[Record], key: str) -> Floats:
    """The finite costs of all runs, or the lengths of the legal ones."""
    some = [r for r in records if r["status"] == "found" and r[key] is not None and (key == "cost" or legal(r))]
    return np.array([r[key] for r in some], dtype=np.float64)


def draw_fleet(summary: dict[str, Any]) -> bytes | None:
    """Distances between the vehicles of the best run of the paper's own algorithm, over time; None for one vehicle.

    IB-ABC's vehicles fly by its schedule, all others at one speed; all depart together, and each is gone on arrival.
    """
    ready: Set = summary["set"]
    run = best_run(next(iter(summary["records"].values())))
    if len(ready.problems) < 2 or run is None:
        return None
    paths = [np.array(p) for p in run["paths"]]
    vehicle, arrival = ready.source.vehicles[0].vehicle, ready.source.arrival
    lengths = [float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in paths]
    times = [length / vehicle.speed_max_m_s for length in lengths]
    if arrival is not None:
        slots = schedule(lengths, arrival.mode, arrival.interval_s, vehicle.speed_min_m_s, vehicle.speed_max_m_s)
        times = [slot.time_s for slot in slots]
    figure = Figure(figsize=(8.6, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    names = [request.vehicle.name for request in ready.source.vehicles]
    for (i, j), colour in zip(combinations(range(len(paths)), 2), COLOURS, strict=False):
        t, gap = distances(paths[i], times[i], paths[j], times[j])
        ax.plot(t, gap, color=colour, lw=1.4, label=f"{names[i]} – {names[j]}: {gap.min():.1f} m at least")
    ax.set(xlabel="time, s", ylabel="distance, m", ylim=(0.0, None))
    ax.grid(alpha=0.3)
    ax.legend(fontsize=8)
    ax.set_title(f"{summary['name']}: distances in the best run of {run['algorithm']}", loc="left", fontsize=10)
    return png(figure)


def distances(one: Floats, one_s: float, other: Floats, other_s: float) -> tuple[Floats, Floats]:
    """Moments in seconds, and the distances in metres of two vehicles that fly paths (N, 3) at even speeds in their
    times, as long as both fly."""
    t = np.linspace(0.0, min(one_s, other_s), MOMENTS)
    gap = _at(one, t / one_s) - _at(other, t / other_s)
    return t, np.linalg.norm(gap, axis=1)


def _at(path: Floats, parts: Floats) -> Floats:
    """Points (M, 3) at parts of the length of a path."""
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    return np.stack([np.interp(parts * along[-1], along, path[:, k]) for k in range(3)], axis=1)
