"""The two outputs of a command, as rich's consoles."""

from __future__ import annotations

import sys
from typing import TextIO, cast

from rich.console import Console

from gcsplan.cli.process.exit import put

PLAIN_WIDTH = 130
"""Columns of a log file or a pipe, whose width is unknown."""


class _Results:
    """Standard output as a file for rich: a full disk or a closed output is our error, not one of rich."""

    def write(self, text: str) -> int:
        try:
            if text:
                put(text)
        except BaseException:  # rich would keep what it could not write, and write it before the next words
            console.begin_capture()
            console.end_capture()
            raise
        return len(text)

    def flush(self) -> None:
        """`put` has flushed already."""

    def isatty(self) -> bool:
        return sys.stdout is not None and sys.stdout.isatty()

    def fileno(self) -> int:
        return sys.stdout.fileno()

    @property
    def encoding(self) -> str:
        return getattr(sys.stdout, "encoding", None) or "utf-8"


RESULTS = cast(TextIO, _Results())

console = Console(file=RESULTS, highlight=False, soft_wrap=True)
"""Results."""
aside = Console(stderr=True, highlight=False, soft_wrap=True)
"""Notes, progress and errors."""
for screen in (console, aside):
    if not screen.is_terminal:
        screen.width = PLAIN_WIDTH
