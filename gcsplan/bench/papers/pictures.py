"""A map and the convergence curves of a scenario, as PNG."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle as CirclePatch
from matplotlib.patches import Polygon as PolygonPatch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from gcsplan.arrays import Floats
from gcsplan.bench.papers.runs import Record
from gcsplan.bench.papers.scenarios import Set
from gcsplan.bench.papers.statistics import legal
from gcsplan.world.zones import Circle

COLOURS = ("#d62728", "#1f77b4", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2")
ZONE_COLOUR = "#ffbf00"
COST_UNITS = {
    "krill": "m", "ssgwo": "weighted sum (eq. 33)", "msfoa": "weighted m, all vehicles together", "abo": "m",
    "ib-abc": "parts of the straight line's, all vehicles",
}  # fmt: skip
WIDE = 4.0
"""Ratio of costs above which they are drawn on a logarithmic scale."""
CELLS = 400
STEPS = 200
_LINES = ("-", "--", "-.", ":")


def best_run(records: Sequence[Record]) -> Record | None:
    """The legal run of least cost, or, if no run is legal, the run of least cost; None if all were refused."""
    found = [r for r in records if r["status"] == "found" and r["cost"] is not None]
    return min(found, key=lambda r: (not legal(r), r["cost"]), default=None)


def draw_map(summary: dict[str, Any]) -> bytes:
    """Plan view with the best run of each algorithm, and the profile of the paper's own algorithm; in metres."""
    figure = Figure(figsize=(8.6, 10.2), layout="constrained")
    FigureCanvasAgg(figure)
    plan, profile = figure.subplots(2, 1, height_ratios=(3.2, 1.0))
    ready: Set = summary["set"]
    shown = {name: best_run(records) for name, records in summary["records"].items()}
    paths = [np.array(p) for run in shown.values() if run is not None for p in run["paths"]]
    ends = np.array([[p.start, p.goal] for p in ready.problems]).reshape(-1, 3)
    _ground(plan, ready, np.concatenate([ends, *paths])[:, :2])
    for rank, ((name, run), colour) in enumerate(zip(shown.items(), COLOURS, strict=False)):
        if run is None:
            plan.plot([], [], color=colour, label=f"{name}: refused")
            continue
        words = f"{name}: {run['length_m']:,.1f} m" + ("" if legal(run) else ", breaks limits")
        for k, path in enumerate(map(np.array, run["paths"])):
            plan.plot(path[:, 0], path[:, 1], color=colour, lw=1.5, ls="-" if legal(run) else ":",
                      zorder=2.9 - 0.1 * rank, label=None if k else words)  # fmt: skip
    for k, points in enumerate(summary["best_path"] or []):
        path = np.array(points)
        label = f"planner optimal: {summary['optimum_m']:,.1f} m"
        plan.plot(path[:, 0], path[:, 1], color="black", lw=1.2, ls="--", zorder=3.0, label=None if k else label)
    for k, problem in enumerate(ready.problems):
        both = np.array([problem.start, problem.goal])
        label = f"straight: {summary['straight_m']:,.1f} m"
        plan.plot(both[:, 0], both[:, 1], color="0.35", lw=0.8, ls=(0, (1, 3)), label=None if k else label)
        plan.plot(*problem.start[:2], "o", color="black", ms=6, mec="white")
        plan.plot(*problem.goal[:2], "s", color="black", ms=6, mec="white")
    plan.set(xlabel="east, m", ylabel="north, m")
    plan.set_aspect("equal")
    plan.set_title(f"{summary['name']}: best run of each algorithm (○ start, □ goal)", loc="left", fontsize=10)
    figure.legend(*plan.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    first = next(iter(shown))
    _profile(profile, ready, shown[first], first)
    return png(figure)


def _ground(ax: Axes, ready: Set, places: Floats) -> None:
    low, high = places.min(axis=0), places.max(axis=0)
    pad = 0.06 * float((high - low).max())
    (west, south), (east, north) = low - pad, high + pad
    e, n = np.meshgrid(np.linspace(west, east, CELLS), np.linspace(south, north, CELLS))
    ground = ready.world.airspace.surface.ground_at(e, n)
    if np.nanmax(ground) - np.nanmin(ground) > 0.01:
        land = ListedColormap(colormaps["terrain"](np.linspace(0.25, 1.0, 192)))  # without the colours of water
        image = ax.imshow(
            ground,
            extent=(west, east, south, north),
            origin="lower",
            cmap=land,
            alpha=0.55,
            aspect="equal",
        )
        ax.figure.colorbar(image, ax=ax, label="ground, m AMSL", shrink=0.8)
    for zone in ready.world.airspace.zones:
        patch: CirclePatch | PolygonPatch
        if isinstance(zone.shape, Circle):
            patch = CirclePatch((zone.shape.east_m, zone.shape.north_m), zone.shape.radius_m)
            middle = (zone.shape.east_m, zone.shape.north_m)
        else:
            patch = PolygonPatch(zone.shape.vertices)
            middle = tuple(zone.shape.vertices.mean(axis=0))
        patch.set(facecolor=ZONE_COLOUR, edgecolor="#805000", alpha=0.45)
        ax.add_patch(patch)
        if zone.ceiling is not None:
            ax.annotate(f"to {zone.ceiling}", middle, ha="center", va="center", fontsize=6)
    ax.set(xlim=(west, east), ylim=(south, north))


def _profile(ax: Axes, ready: Set, run: Record | None, name: str) -> None:
    ax.set(xlabel="distance over ground, m", ylabel="altitude, m AMSL")
    ax.grid(alpha=0.3)
    if run is None:
        return
    for k, (points, problem) in enumerate(zip(run["paths"], ready.problems, strict=True)):
        path = np.array(points)
        s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))])
        at = np.linspace(0.0, s[-1], 600)
        top = ready.world.airspace.surface.top_at(np.interp(at, s, path[:, 0]), np.interp(at, s, path[:, 1]))
        of = f" {ready.source.vehicles[k].vehicle.name}" if len(run["paths"]) > 1 else ""
        style = _LINES[k % len(_LINES)]
        ax.plot(s, path[:, 2], color=COLOURS[0], ls=style, lw=1.4, label=f"path{of}")
        ax.plot(at, top, color="#7a5c3c", ls=style, lw=0.9, label=f"ground{of}")
        if problem.limits.min_agl_m > 0.0:
            ax.plot(at, top + problem.limits.min_agl_m, color="0.5", ls=style, lw=0.6,
                    label=None if k else f"min AGL {problem.limits.min_agl_m:g} m")  # fmt: skip
    ax.set_title(f"profile of {name}'s best run", loc="left", fontsize=9)
    ax.legend(fontsize=7, ncols=2)


def draw_convergence(summary: dict[str, Any]) -> bytes:
    """Median of the best cost so far with its quartiles, over iterations and over evaluations."""
    figure = Figure(figsize=(10.5, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, 2, sharey=True)
    lowest, least, most = math.inf, math.inf, -math.inf
    for ax, along in zip(axes, ("iterations", "evaluations"), strict=True):
        for rank, ((name, records), colour) in enumerate(zip(summary["records"].items(), COLOURS, strict=False)):
            found = [r["history"] for r in records if r["status"] == "found"]
            if not found:
                continue
            grid = np.linspace(0.0, max(h[along][-1] for h in found), STEPS)
            costs = np.array([stepwise(h[along], h["cost"], grid) for h in found])
            low, middle, high = (np.percentile(costs, q, axis=0, method="nearest") for q in (25, 50, 75))
            shown = np.isfinite(high)
            if not shown.any():
                continue
            ax.plot(grid[shown], middle[shown], color=colour, lw=1.5, zorder=2.9 - 0.1 * rank, label=name)
            ax.fill_between(grid[shown], low[shown], high[shown], color=colour, alpha=0.15, lw=0)
            lowest = min(lowest, float(low[shown].min()))
            # The costs of the first batches do not matter: the scale begins after 2 % of the grid.
            later = middle[shown & (grid >= 0.02 * grid[-1])]
            least, most = min(least, float(low[shown].min())), max(most, float(later.max(initial=-math.inf)))
        of = {"iterations": " of each vehicle's search", "evaluations": " of all vehicles' costs"}[along]
        ax.set(xlabel=along + (of if len(summary["set"].problems) > 1 else ""))
        ax.grid(alpha=0.3, which="both")
    if lowest > 0.0 and math.isfinite(most):
        if most > WIDE * least:
            axes[0].set_yscale("log")
            axes[0].yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes[0].yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axes[0].yaxis.set_minor_formatter(NullFormatter())
        axes[0].set_ylim(0.97 * least, 1.1 * most)
    unit = COST_UNITS[summary["paper"]]
    axes[0].set_ylabel(f"best cost so far,{chr(10) if len(unit) > 12 else ' '}{unit}")
    axes[1].legend(fontsize=8)
    runs = max(len(records) for records in summary["records"].values())
    figure.suptitle(f"{summary['name']}: median of {runs} runs, and quartiles", x=0.01, ha="left", fontsize=10)
    return png(figure)


def stepwise(x: Sequence[float], y: Sequence[float | None], grid: Floats) -> Floats:
    """Values of a curve that holds each ``y`` until the next ``x``; inf before the first and where ``y`` is None."""
    values = np.array([math.inf if v is None else v for v in y])
    place = np.searchsorted(np.asarray(x, dtype=np.float64), grid, side="right") - 1
    return np.where(place < 0, np.inf, values[np.maximum(place, 0)])


def png(figure: Figure) -> bytes:
    """The figure as PNG, the same bytes each time."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=100, metadata={"Software": None})
    return out.getvalue()
