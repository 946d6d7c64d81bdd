"""Tables of the papers' reports: plain cells under a heading, as Markdown and HTML."""

from __future__ import annotations

import html
from collections.abc import Iterator
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Table:
    """Plain cells under a heading, with notes."""

    heading: str
    header: tuple[str, ...]
    rows: list[tuple[str, ...]]
    notes: list[str] = field(default_factory=list)

    def markdown(self) -> Iterator[str]:
        """The cells and notes as lines of Markdown, without the heading."""
        yield f"| {' | '.join(self.header)} |"
        yield f"| {' | '.join('---' if k == 0 else '---:' for k in range(len(self.header)))} |"
        for row in self.rows:
            yield f"| {' | '.join(row)} |"
        yield ""
        for note in self.notes:
            yield f"- {note}"
        yield ""

    def html(self) -> Iterator[str]:
        """The cells and notes as lines of HTML, without the heading."""
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in self.header)
        yield f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>'
        for row in self.rows:
            yield f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>"
        yield "</tbody></table></div><ul>"
        for note in self.notes:
            yield f"<li>{html.escape(note)}</li>"
        yield "</ul>"


def significant(value: float | None) -> str:
    """A number with five digits or more, so that a cost of any size can be read."""
    if value is None:
        return "–"
    whole = len(str(int(abs(value)))) if abs(value) >= 1.0 else 0
    return f"{value:,.{max(0, 5 - whole)}f}"
