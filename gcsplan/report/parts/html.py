"""Words and numbers as HTML, marks and labels over a figure, and the document around them.

Texts from files are escaped here, and every number gets its unit here. A document has its style and scripts inside,
nothing from elsewhere, and no other script can run.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import math
import unicodedata
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import resources

from gcsplan import __version__
from gcsplan.figures import floored, raised, steepened
from gcsplan.units import KILOJOULE, WATT_HOUR, Unit, charge

THIN, UNIT_GAP = "\u202f", "\u202f"
_DIRECTION = frozenset("\u200e\u200f\u061c\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""Characters that change the direction of writing: in a name, they could change how its neighbours read."""


def plain(text: object) -> str:
    """``text`` without control characters, direction marks and halves of surrogate pairs; not escaped yet."""
    words = "".join(c for c in str(text) if c not in _DIRECTION)
    return "".join("\ufffd" if unicodedata.category(c) in ("Cc", "Cs") and c not in "\n\t" else c for c in words)


def esc(text: object) -> str:
    """``text`` escaped for HTML, also in attributes."""
    return html.escape(plain(text), quote=True)


def num(value: float | None, decimals: int = 0, unit: str | Unit = "") -> str:
    """A number with its unit, converted from SI if that is a `Unit`; a dash if there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    if isinstance(unit, Unit):
        value, decimals, unit = unit.of(value), unit.decimals(decimals), unit.symbol
    text = f"{value:,.{decimals}f}".replace(",", THIN)
    if float(f"{value:.{decimals}f}") == 0.0:
        text = text.lstrip("-")
    return text + (("" if unit == "°" else UNIT_GAP) + unit if unit else "")


def least(value: float | None, decimals: int = 1, unit: str | Unit = "") -> str:
    """A least value as in `num`, but rounded down, after it is converted."""
    return _rounded(floored, value, decimals, unit)


def at_least(value: float | None, decimals: int = 1, unit: str | Unit = "") -> str:
    """A least value to set or to reach, as in `num`, but rounded up."""
    return _rounded(raised, value, decimals, unit)


def greatest(value: float | None, decimals: int = 1, unit: str | Unit = "") -> str:
    """A greatest value as in `num`, but rounded up, after it is converted."""
    return _rounded(raised, value, decimals, unit)


def steepest(degrees: float | None, decimals: int = 1) -> str:
    """A climb or descent in degrees as in `num`, but rounded away from level."""
    return _rounded(steepened, degrees, decimals, "°")


def _rounded(
    rounding: Callable[[float, int], float], value: float | None, decimals: int, unit: str | Unit
) -> str:  # fmt: skip
    if value is None or not math.isfinite(value):
        return "–"
    if isinstance(unit, Unit):
        value, decimals, unit = unit.of(value), unit.decimals(decimals), unit.symbol
    return num(rounding(value, decimals), decimals, unit)


def stated(value: float, unit: Unit) -> str:
    """A value that was given, such as a limit, with the digits it has."""
    return f"{unit.stated(value)}{UNIT_GAP}{unit.symbol}"


def between(from_m: float, to_m: float, unit: Unit) -> str:
    """A part of a track, ``3.00 – 4.85 km``; where both ends read the same, that place alone."""
    first, last = num(unit.of(from_m), 2), num(unit.of(to_m), 2)
    return num(to_m, 2, unit) if first == last else f"{first} – {num(to_m, 2, unit)}"


def energy(joules: float | None, decimals: int = 0, volts: float | None = None) -> str:
    """An energy in kJ and Wh, and in mAh where the battery's voltage is known."""
    units = (KILOJOULE, WATT_HOUR, *([charge(volts)] if volts else []))
    if joules is None or not math.isfinite(joules):
        return "–"
    return " · ".join(num(joules, 0 if unit.symbol == "mAh" else decimals, unit) for unit in units)


def place(lat_deg: float, lon_deg: float) -> str:
    """Latitude and longitude to a metre; a dash if there is no place."""
    return f"{lat_deg:.5f}, {lon_deg:.5f}" if math.isfinite(lat_deg) and math.isfinite(lon_deg) else "–"


def table(
    caption: str, head: Sequence[str], rows: Iterable[Sequence[str]], *, marks: Sequence[str] = (),
    numbers: Sequence[int] = (), stacked: bool = False,
) -> str:  # fmt: skip
    """A table of HTML cells; the first cell of a row is its header. ``marks`` are CSS classes of the rows.

    ``numbers`` are the numbers of the vehicles of the rows, by which the page's filter finds them. ``stacked``: on a
    phone each cell has a line of its own, behind the name of its column.
    Columns whose head ends in a bar hold words and are left-aligned; all others hold numbers.
    """
    words = [h.endswith("|") for h in head]
    kinds = ["" if w else ' class="n"' for w in words]
    heads = [f' data-head="{h.rstrip("|")}"' if stacked and h.rstrip("|") else "" for h in head]
    kind = ' class="stack"' if stacked else ""
    out = [f'<div class="scroll"><table{kind}><caption>{caption}</caption><thead><tr>']
    out += [f'<th scope="col"{k}>{h.rstrip("|")}</th>' for h, k in zip(head, kinds, strict=True)]
    out.append("</tr></thead><tbody>")
    for i, row in enumerate(rows):
        mark = f' class="{marks[i]}"' if i < len(marks) and marks[i] else ""
        out.append(f'<tr{mark} data-vehicle="{numbers[i]}">' if numbers else f"<tr{mark}>")
        for j, (cell, kind, name) in enumerate(zip(row, kinds, heads, strict=True)):
            out.append(f'<th scope="row"{kind}{name}>{cell}</th>' if j == 0 else f"<td{kind}{name}>{cell}</td>")
        out.append("</tr>")
    out.append("</tbody></table></div>")
    return "".join(out)


def tools(name: str) -> str:
    """The buttons of the figure ``name``, hidden until the page's script shows them."""
    return (
        f'<div class="tools" data-for="{name}" hidden>'
        '<button type="button" data-do="in" aria-label="zoom in">+</button>'
        '<button type="button" data-do="out" aria-label="zoom out">−</button>'
        '<button type="button" data-do="home" aria-label="show all">⤢</button></div>'
    )


def data_block(name: str, value: object) -> str:
    """``value`` as a JSON block for the page's script; nothing in it can end the block or begin another one."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=True, allow_nan=False, sort_keys=True)
    text = text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    return f'<script type="application/json" id="{name}">{text}</script>'


def document(
    title: str,
    body: str,
    data: str,
    *,
    scripts: Sequence[str],
    styles: Sequence[str] = ("report.css",),
    what: str = "mission report",
) -> str:
    """The whole page: ``body`` and ``data`` (blocks for the scripts) are HTML, ``what`` stands behind the title.

    ``scripts`` and ``styles`` are names in ``assets/``.
    """
    style = "".join(_asset(name) for name in styles)
    script = "(function(){\n'use strict';\n" + "\n".join(_asset(name) for name in scripts) + "\n})();"
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    # Nothing is loaded from elsewhere, and no other script can run, whatever the names in a file contain.
    policy = (
        f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; base-uri 'none'"
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f'<meta name="generator" content="gcsplan {esc(__version__)}">'
        f"<title>{esc(title)} – {what}</title><style>\n{style}</style></head>"
        f'<body>{body}<div id="tip" role="status" hidden></div>{data}<script>{script}</script></body></html>\n'
    )


def _asset(name: str) -> str:
    return resources.files("gcsplan.report").joinpath("assets", name).read_text(encoding="utf-8")


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
