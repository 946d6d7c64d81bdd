"""A line chart: curves in an SVG that stretches with the page, and its numbers as HTML beside it, not stretched."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Floats
from gcsplan.report.marks import Mark, marks_html
from gcsplan.report.markup import esc, num
from gcsplan.report.relief import nice_step

UNITS = 10_000.0


@dataclass(frozen=True, slots=True)
class Axes:
    """The range of a chart; its curves are SVG paths in units of 1/10000 of its width and height."""

    x0: float
    x1: float
    y0: float
    y1: float
    x_label: str
    y_label: str

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
    xs, ys = ticks(axes.x0, axes.x1, 8), ticks(axes.y0, axes.y1, 6)
    grid = "".join(
        f'<path class="grid" d="M{u:.0f} 0V10000"/>' for u in axes.xy(xs, np.full(len(xs), axes.y0))[:, 0]
    ) + "".join(f'<path class="grid y" d="M0 {v:.0f}H10000"/>' for v in axes.xy(np.full(len(ys), axes.x0), ys)[:, 1])
    across = "".join(
        f'<span style="left:{100 * (x - axes.x0) / (axes.x1 - axes.x0):.3f}%">{_tick(x, xs)}</span>' for x in xs
    )
    up = "".join(
        f'<span style="top:{100 * (axes.y1 - y) / (axes.y1 - axes.y0):.3f}%">{_tick(y, ys)}</span>' for y in ys
    )
    return (
        f'<figure class="chart" id="{esc(name)}" data-x0="{axes.x0!r}" data-x1="{axes.x1!r}" data-y0="{axes.y0!r}" '
        f'data-y1="{axes.y1!r}" data-unit="{esc(axes.x_label.rsplit(", ", 1)[-1])}">'
        f'<div class="ylabel">{esc(axes.y_label)}</div>'
        f'<div class="yticks" aria-hidden="true">{up}</div>'
        f'<div class="view plot"><svg viewBox="0 0 10000 10000" preserveAspectRatio="none" role="img" '
        f'aria-label="{esc(words)}"><g class="grids">{grid}</g>{"".join(shapes)}<path class="cursor" d=""/></svg>'
        f'<div class="marks">{marks_html(marks, tall)}</div></div>'
        f'<div class="xticks" aria-hidden="true">{across}</div><div class="xlabel">{esc(axes.x_label)}</div></figure>'
    )


def ticks(low: float, high: float, wanted: int) -> Floats:
    """About ``wanted`` round values between two."""
    step = nice_step((high - low) / wanted)
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
