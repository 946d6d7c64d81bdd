"""Marks and labels over a figure: HTML at a part of its width and height, so that they keep their size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gcsplan.report.parts.html import esc

ASSUMED_WIDTH_PX = 900.0
"""Width for which label collisions are resolved here; the page's script resolves them again for the real width."""
LETTER_PX, LINE_PX = 6.6, 16.0


@dataclass(frozen=True, slots=True)
class Mark:
    """``x``, ``y`` are 0 … 1 of the figure; ``kind`` is the class; if labels collide, the lower ``rank`` stays."""

    x: float
    y: float
    kind: str
    label: str
    tip: str
    rank: int


def marks_html(marks: Sequence[Mark], ratio: float, width_px: float = ASSUMED_WIDTH_PX) -> str:
    """HTML spans for ``marks``; ``ratio`` is height over width of the figure."""
    muted = _colliding(marks, ratio, width_px)
    return "".join(
        f'<span class="mark {m.kind}{" mute" if i in muted else ""}" '
        f'style="left:{100 * m.x:.3f}%;top:{100 * m.y:.3f}%" '
        f'data-x="{m.x:.6f}" data-y="{m.y:.6f}" data-rank="{m.rank}" title="{esc(m.tip)}"><b>{esc(m.label)}</b></span>'
        for i, m in enumerate(marks)
    )


def _colliding(marks: Sequence[Mark], ratio: float, width_px: float) -> set[int]:
    """Indices of the marks whose labels would overlap one of a better rank."""
    taken: list[tuple[float, float, float, float]] = []
    muted = set()
    for i in sorted(range(len(marks)), key=lambda k: marks[k].rank):
        m = marks[i]
        half = 0.5 * LETTER_PX * max(map(len, m.label.split("\n")), default=0) + 3.0
        tall = LINE_PX * (m.label.count("\n") + 1)
        x, y = m.x * width_px, m.y * width_px * ratio
        box = (x - half, y - tall, x + half, y)
        if any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in taken):
            muted.add(i)
        else:
            taken.append(box)
    return muted
