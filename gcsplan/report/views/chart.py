"""A line chart: curves in an SVG that stretches with the page, and its numbers as HTML beside it, not stretched."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Floats
from gcsplan.report.parts.html import Mark, esc, marks_html, num
from gcsplan.report.views.shaded_terrain import nice_step
from gcsplan.units import Unit, duration

UNITS = 10_000.0
TIME_STEPS = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600)
"""Seconds between the ticks of a time."""


@dataclass(frozen=True, slots=True)
class Axes:
    """The range of a chart, in SI; its curves are SVG paths in units of 1/10000 of its width and height.

    Ticks are round numbers of ``x_unit`` and ``y_unit``; an ``x_unit`` of None is a time, with ticks as h:mm:ss.
    """

    x0: float
    x1: float
    y0: float
    y1: float
    x_name: str
    y_name: str
    x_unit: Unit | None
    y_unit: Unit

    def xy(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """(N, 2) in units, y down, limited to three chart heights beyond the chart."""
        u = (np.asarray(x, float) - self.x0) / (self.x1 - self.x0)
        v = np.clip((self.y1 - np.asarray(y, float)) / (self.y1 - self.y0), -3.0, 4.0)
        return UNITS * np.stack(np.broadcast_arrays(u, v), axis=-1)

    def line(self, x: ArrayLike, y: ArrayLike, kind: str) -> str:
        """A curve, interrupted where y is unknown."""
        return f'<path class="{kind}" d="{"".join(_run(p, "") for p in _pieces(self.xy(x, y)))}"/>'

    def area(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, kind: str, title: str = "") -> str:
        """The area between two curves; infinite values reach beyond the chart."""
        span = self.y1 - self.y0
        bottom = np.nan_to_num(np.asarray(low, float), nan=np.nan, neginf=self.y0 - span, posinf=self.y1 + span)
        top = np.nan_to_num(np.asarray(high, float), nan=np.nan, neginf=self.y0 - span, posinf=self.y1 + span)
        both = np.concatenate([self.xy(x, bottom), self.xy(x, top)], axis=1)
        paths = [_run(p[:, :2], "") + _run(p[::-1, 2:], "L") + "Z" for p in _pieces(both)]
        return f'<path class="{kind}" d="{"".join(paths)}">{f"<title>{esc(title)}</title>" if title else ""}</path>'

    def mark(self, x: float, y: float, kind: str, label: str, tip: str, rank: int) -> Mark:
        """A mark at a point of the chart."""
        u, v = self.xy(x, y) / UNITS
        return Mark(float(u), float(v), kind, label, tip, rank)


def chart_html(name: str, axes: Axes, shapes: Sequence[str], marks: Sequence[Mark], words: str, tall: float) -> str:
    """The figure ``name``; ``words`` describe it for a reader who cannot see it; ``tall`` is height over width."""
    (xs, across_words), (ys, up_words) = (
        _ticks(axes.x0, axes.x1, 8, axes.x_unit),
        _ticks(axes.y0, axes.y1, 6, axes.y_unit),
    )
    size = "" if axes.x_unit is None else f' data-size="{axes.x_unit.size!r}"'
    x_label = f"{axes.x_name}, {'h:mm:ss' if axes.x_unit is None else axes.x_unit.symbol}"
    y_label = ", ".join(word for word in (axes.y_name, axes.y_unit.symbol) if word)
    grid = "".join(
        f'<path class="grid" d="M{u:.0f} 0V10000"/>' for u in axes.xy(xs, np.full(len(xs), axes.y0))[:, 0]
    ) + "".join(f'<path class="grid y" d="M0 {v:.0f}H10000"/>' for v in axes.xy(np.full(len(ys), axes.x0), ys)[:, 1])
    parts = [100.0 * (x - axes.x0) / (axes.x1 - axes.x0) for x in xs]
    ends = [' class="last"' if part > 95.0 else "" for part in parts]
    across = "".join(
        f'<span{end} style="left:{part:.3f}%">{word}</span>'
        for end, part, word in zip(ends, parts, across_words, strict=True)
    )
    up = "".join(
        f'<span style="top:{100 * (axes.y1 - y) / (axes.y1 - axes.y0):.3f}%">{word}</span>'
        for y, word in zip(ys, up_words, strict=True)
    )
    return (
        f'<figure class="chart" id="{esc(name)}" data-x0="{axes.x0!r}" data-x1="{axes.x1!r}" data-y0="{axes.y0!r}" '
        f'data-y1="{axes.y1!r}"{size}>'
        f'<div class="ylabel">{esc(y_label)}</div>'
        f'<div class="yticks" aria-hidden="true">{up}</div>'
        f'<div class="view plot"><svg viewBox="0 0 10000 10000" preserveAspectRatio="none" role="img" '
        f'aria-label="{esc(words)}"><g class="grids">{grid}</g>{"".join(shapes)}<path class="cursor" d=""/></svg>'
        f'<div class="marks">{marks_html(marks, tall)}</div></div>'
        f'<div class="xticks" aria-hidden="true">{across}</div><div class="xlabel">{esc(x_label)}</div></figure>'
    )


def _ticks(low: float, high: float, count: int, unit: Unit | None) -> tuple[Floats, list[str]]:
    """About ``count`` places with round numbers of ``unit``, in SI, and their words."""
    if unit is None:
        about_s, hour = (high - low) / count, TIME_STEPS[-1]
        step = next((s for s in TIME_STEPS if s >= about_s), hour * math.ceil(about_s / hour))
        at = np.asarray(step * np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1), float)
        return at, [duration(t) for t in at.tolist()]
    every = ticks(unit.of(low), unit.of(high), count)
    return np.asarray(every * unit.size), [_tick(v, every) for v in every]


def ticks(low: float, high: float, count: int) -> Floats:
    """About ``count`` round values between two."""
    step = nice_step((high - low) / count)
    return np.asarray(step * np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1), float)


def _tick(value: float, all_ticks: Floats) -> str:
    step = abs(float(all_ticks[1] - all_ticks[0])) if len(all_ticks) > 1 else 1.0
    return num(float(value), max(0, -math.floor(math.log10(step) + 1e-9)))


def _pieces(points: Floats) -> list[Floats]:
    """Runs of rows without NaN."""
    known = ~np.isnan(points).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8))).reshape(-1, 2)
    return [points[a:b] for a, b in edges]


def _run(points: Floats, first: str) -> str:
    """Rows as path commands, rounded to whole units."""
    whole = np.rint(points).astype(int).tolist()
    return (first or "M") + "L".join(f"{x} {y}" for x, y in whole)
