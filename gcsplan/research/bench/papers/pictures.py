"""Pictures of a scenario, as PNG: map, paths in space, convergence, box plots, and a fleet's distances over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
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
from gcsplan.bench.files import png
from gcsplan.bench.measure import length_m
from gcsplan.research.bench.papers.runs import RunRecord
from gcsplan.research.bench.papers.scenarios import ReadyScenario
from gcsplan.research.bench.papers.statistics import legal, schedule
from gcsplan.world.geometry.zones import Circle

ALGORITHM_COLOURS = ("#d62728", "#1f77b4", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2")
MAP_ZONE_COLOUR = "#ffbf00"
COST_UNITS = {
    "krill": "m", "ssgwo": "weighted sum (eq. 33)", "msfoa": "weighted m, all vehicles together", "abo": "m",
    "ib-abc": "parts of the straight line's, all vehicles",
}  # fmt: skip
LOG_SCALE_FROM = 4.0
"""Ratio of costs above which they are drawn on a logarithmic scale."""
MAP_CELLS = 400
CURVE_STEPS = 200
SPACE_CELLS = 60
"""Cells a side of the ground that is drawn in space."""
MOMENTS = 300
"""Moments at which a fleet's distances are drawn."""
OPEN_ZONE_TALL = 1.25
"""A zone without a top is drawn this many times as high as the highest path."""
_LINES = ("-", "--", "-.", ":")


def best_run(records: Sequence[RunRecord]) -> RunRecord | None:
    """The legal run of least cost, or, if no run is legal, the run of least cost; None if all were refused."""
    found = [r for r in records if r["status"] == "found" and r["cost"] is not None]
    return min(found, key=lambda r: (not legal(r), r["cost"]), default=None)


def draw_map(summary: dict[str, Any]) -> bytes:
    """Plan view with the best run of each algorithm, and the profile of the paper's own algorithm; in metres."""
    figure = Figure(figsize=(8.6, 10.2), layout="constrained")
    FigureCanvasAgg(figure)
    plan, profile = figure.subplots(2, 1, height_ratios=(3.2, 1.0))
    ready: ReadyScenario = summary["set"]
    shown = {name: best_run(records) for name, records in summary["records"].items()}
    paths = [np.array(p) for run in shown.values() if run is not None for p in run["paths"]]
    ends = np.array([[p.start, p.goal] for p in ready.problems]).reshape(-1, 3)
    _ground(plan, ready, np.concatenate([ends, *paths])[:, :2])
    for rank, ((name, run), colour) in enumerate(zip(shown.items(), ALGORITHM_COLOURS, strict=False)):
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


def _ground(ax: Axes, ready: ReadyScenario, places: Floats) -> None:
    low, high = places.min(axis=0), places.max(axis=0)
    pad = 0.06 * float((high - low).max())
    (west, south), (east, north) = low - pad, high + pad
    e, n = np.meshgrid(np.linspace(west, east, MAP_CELLS), np.linspace(south, north, MAP_CELLS))
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
        patch.set(facecolor=MAP_ZONE_COLOUR, edgecolor="#805000", alpha=0.45)
        ax.add_patch(patch)
        if zone.ceiling is not None:
            ax.annotate(f"to {zone.ceiling}", middle, ha="center", va="center", fontsize=6)
    ax.set(xlim=(west, east), ylim=(south, north))


def _profile(ax: Axes, ready: ReadyScenario, run: RunRecord | None, name: str) -> None:
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
        ax.plot(s, path[:, 2], color=ALGORITHM_COLOURS[0], ls=style, lw=1.4, label=f"path{of}")
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
        for rank, ((name, records), colour) in enumerate(
            zip(summary["records"].items(), ALGORITHM_COLOURS, strict=False)
        ):
            found = [r["history"] for r in records if r["status"] == "found"]
            if not found:
                continue
            grid = np.linspace(0.0, max(h[along][-1] for h in found), CURVE_STEPS)
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
        of = {"iterations": "each vehicle's search", "evaluations": "all vehicles' costs"}[along]
        ax.set(xlabel=f"{along} of {of}" if len(summary["set"].problems) > 1 else along)
        ax.grid(alpha=0.3, which="both")
    if lowest > 0.0 and math.isfinite(most):
        if most > LOG_SCALE_FROM * least:
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


def draw_space(summary: dict[str, Any]) -> bytes:
    """Ground, zones, the best run of each algorithm and the path of the planner optimal, in space; metres."""
    figure = Figure(figsize=(8.6, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    ax: Any = figure.add_subplot(projection="3d", computed_zorder=False)
    ready: ReadyScenario = summary["set"]
    shown = {name: best_run(records) for name, records in summary["records"].items()}
    drawn = [np.array(p) for run in shown.values() if run is not None for p in run["paths"]]
    drawn += [np.array([p.start, p.goal]) for p in ready.problems]
    every = np.concatenate(drawn)
    _ground_in_space(ax, ready, every)
    for rank, ((name, run), colour) in enumerate(zip(shown.items(), ALGORITHM_COLOURS, strict=False)):
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


def _ground_in_space(ax: Any, ready: ReadyScenario, places: Floats) -> None:
    (west, south, _), (east, north, top) = places.min(axis=0), places.max(axis=0)
    e, n = np.meshgrid(np.linspace(west, east, SPACE_CELLS), np.linspace(south, north, SPACE_CELLS))
    ground = ready.world.airspace.surface.ground_at(e, n)
    land = colormaps["terrain"](0.25 + 0.7 * (ground - ground.min()) / max(float(np.ptp(ground)), 1.0))
    ax.plot_surface(e, n, ground, facecolors=land, rstride=1, cstride=1, lw=0, alpha=0.75, shade=False, zorder=1)
    turn = np.linspace(0.0, 2.0 * np.pi, 25)
    for zone in ready.world.airspace.zones:
        if isinstance(zone.shape, Circle):
            level = zone.ceiling.value_m if zone.ceiling is not None else OPEN_ZONE_TALL * top
            x, y = (c + zone.shape.radius_m * f(turn) for c, f in
                    ((zone.shape.east_m, np.cos), (zone.shape.north_m, np.sin)))  # fmt: skip
            sides = np.stack([np.full_like(turn, float(ground.min())), np.full_like(turn, level)])
            ax.plot_surface(
                np.stack([x, x]), np.stack([y, y]), sides, color=MAP_ZONE_COLOUR, alpha=0.35, lw=0, zorder=2
            )


def draw_boxes(summary: dict[str, Any]) -> bytes:
    """Box plots of the cost and of the legal length of all runs, beside the planner optimal and its bound."""
    figure = Figure(figsize=(10.5, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    names = list(summary["records"])
    for ax, key in ((left, "cost"), (right, "length_m")):
        numbers = [spread(summary["records"][name], key) for name in names]
        labels = [f"{name}\n{len(some)}" for name, some in zip(names, numbers, strict=True)]
        ax.boxplot(numbers, tick_labels=labels, showfliers=True, medianprops={"color": ALGORITHM_COLOURS[0]})
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


def spread(records: Sequence[RunRecord], key: str) -> Floats:
    """The finite costs of all runs, or the lengths of the legal ones."""
    some = [r for r in records if r["status"] == "found" and r[key] is not None and (key == "cost" or legal(r))]
    return np.array([r[key] for r in some], dtype=np.float64)


def draw_fleet(summary: dict[str, Any]) -> bytes | None:
    """Distances between the vehicles of the best run of the paper's own algorithm, over time; None for one vehicle.

    IB-ABC's vehicles fly by its schedule, all others at one speed; all depart together, and each is gone on arrival.
    """
    ready: ReadyScenario = summary["set"]
    run = best_run(next(iter(summary["records"].values())))
    if len(ready.problems) < 2 or run is None:
        return None
    paths = [np.array(p) for p in run["paths"]]
    vehicle, arrival = ready.source.vehicles[0].vehicle, ready.source.arrival
    lengths = [length_m(p) for p in paths]
    times = [length / vehicle.speed_max_m_s for length in lengths]
    if arrival is not None:
        slots = schedule(lengths, arrival.mode, arrival.interval_s, vehicle.speed_min_m_s, vehicle.speed_max_m_s)
        times = [slot.time_s for slot in slots]
    figure = Figure(figsize=(8.6, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    names = [request.vehicle.name for request in ready.source.vehicles]
    for (i, j), colour in zip(combinations(range(len(paths)), 2), ALGORITHM_COLOURS, strict=False):
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
