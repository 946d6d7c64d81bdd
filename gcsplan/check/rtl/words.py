"""Words that the way home is told in, and lengths of overlapping parts."""

from __future__ import annotations

from collections.abc import Iterable

PATH = {True: "path safe", False: "path UNSAFE", None: "path not judged in full"}
NO_RETURN, STILL_NO_RETURN, NOT_JUDGED = "no safe return", "still no safe return", "not judged"
"""Labels of `rows` that may come several times."""


def together_m(parts: Iterable[tuple[float, float]]) -> float:
    """The length of intervals that may overlap."""
    total, until = 0.0, float("-inf")
    for a, b in sorted(parts):
        total += max(b - max(a, until), 0.0)
        until = max(until, b)
    return total
