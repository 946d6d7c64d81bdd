"""The comparison's table, its files, and its figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields

from rich.table import Table

from gcsplan.bench.files import png
from gcsplan.bench.measure import percentile
from gcsplan.bench.terrain.outcome import OUR_LONG_METHOD, OUR_METHOD, MethodOutcome, beyond
from gcsplan.export.table import csv_of

LEAST_GAP = 1e-3
"""Percent at which smaller gaps are drawn."""

MAIN_GROUPS = ("0 zones", "10 zones", "40 zones")
TERRAIN_COLUMNS = (
    "problems", "method", "solved", "gap p50 %", "gap p90 %", "gap max %", "shorter than ours", "first p50 s",
    "first p90 s", "done p50 s", "done p90 s", "done / sweep", "memory MB",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class MethodLine:
    """One method on one group of problems.

    ``gaps`` are percent above the best certified bound of the problem if there is one; for gcsplan's own runs, above
    the run's own bound. ``shorter`` counts problems on which the method beats gcsplan's ordinary run. Percentiles (50,
    90) are of seconds; ``ratio`` is the median of the whole time over the sweep's median; ``memory_mb`` is the largest
    peak.
    """

    group: str
    method: str
    problems: int
    solved: int
    infeasible: int
    gaps: tuple[float, ...]
    shorter: int
    first_s: tuple[float | None, float | None]
    done_s: tuple[float | None, float | None]
    ratio: float | None
    memory_mb: float | None

    @property
    def cells(self) -> tuple[str, ...]:
        """The line's cells in the order of `TERRAIN_COLUMNS`."""
        proved = f" +{self.infeasible} proved infeasible" if self.infeasible else ""
        gap = [percentile(list(self.gaps), p) for p in (50, 90, 100)]
        return (
            self.group, self.method, f"{self.solved}/{self.problems}{proved}", *(_number(g, 3) for g in gap),
            "–" if self.method == OUR_METHOD else str(self.shorter),
            *(_number(s, 3) for s in (*self.first_s, *self.done_s)),
            _number(self.ratio, 2), _number(self.memory_mb, 0),
        )  # fmt: skip


def best_bounds(outcomes: Sequence[MethodOutcome]) -> dict[str, float]:
    """The highest certified lower bound of each problem, by its key."""
    best: dict[str, float] = {}
    for o in outcomes:
        if o.bound is not None and o.status == "solved":
            best[o.key] = max(o.bound, best.get(o.key, o.bound))
    return best


def lines(outcomes: Sequence[MethodOutcome]) -> list[MethodLine]:
    """A line for each group and method, in the order of their first outcomes."""
    bounds = best_bounds(outcomes)
    ours = {o.key: o.cost for o in outcomes if o.method == OUR_METHOD and o.status == "solved" and o.cost is not None}
    groups: dict[tuple[str, str], list[MethodOutcome]] = {}
    order: dict[str, None] = {}
    for o in outcomes:
        order[o.group] = None
        groups.setdefault((o.group, o.method), []).append(o)
    place = {group: i for i, group in enumerate(order)}
    return [
        _line(group, method, found, bounds, ours)
        for (group, method), found in sorted(groups.items(), key=lambda item: place[item[0][0]])
    ]


def _line(
    group: str, method: str, found: Sequence[MethodOutcome], bounds: Mapping[str, float], ours: Mapping[str, float]
) -> MethodLine:
    solved = [o for o in found if o.status == "solved"]
    own = method in (OUR_METHOD, OUR_LONG_METHOD)
    gaps = [o.gap_percent if own else beyond(o.cost, bounds.get(o.key)) for o in solved]
    first = [o.first_path_s for o in solved if o.first_path_s is not None]
    done = [o.planning_s for o in solved if o.planning_s is not None]
    ratios = [o.planning_s / o.sweep_s for o in solved if o.planning_s is not None and o.sweep_s]
    memory = [o.memory_mb for o in found if o.memory_mb is not None]
    return MethodLine(
        group, method, len(found), len(solved), sum(o.status == "infeasible" for o in found),
        tuple(g for g in gaps if g is not None),
        sum(o.cost < ours[o.key] * (1.0 - 1e-9) for o in solved if o.cost is not None and o.key in ours),
        (percentile(first, 50), percentile(first, 90)), (percentile(done, 50), percentile(done, 90)),
        percentile(ratios, 50), max(memory, default=None),
    )  # fmt: skip


def unsolved(outcomes: Sequence[MethodOutcome]) -> list[str]:
    """Every problem that gcsplan's planner did not solve, in words, and the methods that did."""
    out = []
    for o in outcomes:
        if o.method == OUR_METHOD and o.status != "solved":
            others = [x for x in outcomes if x.key == o.key and x.method != OUR_METHOD and x.status == "solved"]
            by = f" (solved by {', '.join(x.method for x in others)})" if others else ""
            out.append(f"{o.name}: {o.status}, {' '.join(o.detail.split())}{by}")
    return out


def beaten_by(outcomes: Sequence[MethodOutcome]) -> list[str]:
    """Every problem on which another planner's path is shorter than gcsplan's, with both costs."""
    ours = {o.key: o.cost for o in outcomes if o.method == OUR_METHOD and o.status == "solved" and o.cost is not None}
    return [
        f"{o.name}: {o.method} {o.cost:.2f} against {ours[o.key]:.2f}"
        for o in outcomes
        if o.method not in (OUR_METHOD, OUR_LONG_METHOD) and o.status == "solved" and o.cost is not None
        and o.key in ours and o.cost < ours[o.key] * (1.0 - 1e-9)
    ]  # fmt: skip


def table(found: Sequence[MethodLine], title: str) -> Table:
    """The table for the terminal."""
    out = Table(title=title)
    for k, name in enumerate(TERRAIN_COLUMNS):
        out.add_column(name, justify="left" if k < 2 else "right", no_wrap=k < 3)
    last = ""
    for line in found:
        if last and line.group != last:
            out.add_section()
        out.add_row("" if line.group == last else line.group, *line.cells[1:])
        last = line.group
    return out


def markdown(found: Sequence[MethodLine], outcomes: Sequence[MethodOutcome], about: Sequence[str]) -> str:
    """The table of the measured lines, and the problems that were not solved."""
    rows = [TERRAIN_COLUMNS, tuple("---" for _ in TERRAIN_COLUMNS), *(line.cells for line in found)]
    text = ["# Planners over real terrain", "", *about, "", *(f"| {' | '.join(row)} |" for row in rows), ""]
    for heading, items in (
        ("Not solved by ours", unsolved(outcomes)),
        ("Shorter paths than ours", beaten_by(outcomes)),
        ("Failures of others", [f"{o.name}: {o.method}: {o.detail}" for o in outcomes if _failed(o)]),
    ):
        text += [f"## {heading}", "", *(f"- {item}" for item in items), *([] if items else ["None."]), ""]
    return "\n".join(text)


def _failed(o: MethodOutcome) -> bool:
    return o.method != OUR_METHOD and o.status in ("failed", "unsafe")


def as_csv(outcomes: Sequence[MethodOutcome]) -> str:
    """CSV with one row per outcome, without the paths."""
    names = [f.name for f in fields(MethodOutcome) if f.name != "points"]
    bounds = best_bounds(outcomes)
    rows: list[list[object]] = [[*names, "gap_percent"]]
    for o in outcomes:
        row = asdict(o)
        gap = o.gap_percent if o.bound else beyond(o.cost, bounds.get(o.key))
        rows.append([*(row[n] for n in names), gap])
    return csv_of(rows)


def figure(outcomes: Sequence[MethodOutcome]) -> bytes:
    """PNG: gap against time of every method, one panel for each number of zones of the main set."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    groups = [g for g in MAIN_GROUPS if any(o.group == g for o in outcomes)]
    groups = groups or list(dict.fromkeys(o.group for o in outcomes))[:3]
    bounds = best_bounds(outcomes)
    methods = list(dict.fromkeys(o.method for o in outcomes if o.group in groups))
    picture = Figure(figsize=(5.2 * max(1, len(groups)), 5.0), layout="constrained")
    FigureCanvasAgg(picture)
    axes = picture.subplots(1, max(1, len(groups)), sharey=True, squeeze=False)[0]
    colours = {m: f"C{i % 10}" for i, m in enumerate(methods)}
    for ax, group in zip(axes, groups, strict=False):
        for method in methods:
            found = [o for o in outcomes if (o.group, o.method) == (group, method)]
            points = [
                (o.planning_s, max(gap, LEAST_GAP))
                for o in found
                if o.status == "solved" and o.planning_s
                and (gap := o.gap_percent if o.bound else beyond(o.cost, bounds.get(o.key))) is not None
            ]  # fmt: skip
            label = f"{method} ({sum(o.status == 'solved' for o in found)}/{len(found)})"
            if not points:
                ax.plot([], [], ".", color=colours[method], label=label)
                continue
            seconds, gaps = zip(*points, strict=True)
            ax.plot(seconds, gaps, ".", color=colours[method], alpha=0.35)
            middle, low, high = (percentile(list(gaps), p) or LEAST_GAP for p in (50, 10, 90))
            at = percentile(list(seconds), 50)
            ax.errorbar(
                [at], [middle], yerr=[[middle - low], [high - middle]], fmt="o", color=colours[method], capsize=3,
                label=label,
            )  # fmt: skip
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlabel("time (s)")
        ax.set_title(group)
        ax.grid(True, which="major", alpha=0.3)
        ax.legend(fontsize=7)
    axes[0].set_ylabel("above the certified lower bound (%)")
    picture.suptitle("Every solved mission; median with the 10th and 90th percentile; solved in brackets", fontsize=10)
    return png(picture, dpi=110)


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"
