"""Words that verdicts and the way home are told in, and lengths of overlapping parts."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from gcsplan.units import Reach, UnitText

PATH = {True: "path safe", False: "path UNSAFE", None: "path not judged in full"}
NO_RETURN, STILL_NO_RETURN, NOT_JUDGED = "no safe return", "still no safe return", "not judged"
"""Labels of `rows` that may come several times."""


class Return(Protocol):
    """What a verdict says of the way home."""

    @property
    def safe(self) -> bool | None:
        """Whether the return is safe from every point; None: not all of it was judged."""

    @property
    def no_return_m(self) -> float:
        """Metres of the mission without a safe return."""


def verdict_words(path_safe: bool | None, home: Return | None) -> UnitText:
    """The one sentence of a verdict in every output, which names what was judged: the path, and the return.

    ``home``: the way home, None if it was not judged.
    """
    path = PATH[path_safe]
    if home is None or home.safe is None:
        return UnitText("{}, return not judged", path)
    if home.safe:
        return UnitText("{}; safe return from all of it", path)
    if home.no_return_m < 0.5:
        return UnitText("{}; no safe return from a point of it", path)
    return UnitText("{}; no safe return from {} of it", path, Reach(home.no_return_m))


def together_m(parts: Iterable[tuple[float, float]]) -> float:
    """The length of intervals that may overlap."""
    total, until = 0.0, float("-inf")
    for a, b in sorted(parts):
        total += max(b - max(a, until), 0.0)
        until = max(until, b)
    return total
