"""The time limits of a transfer: the user's timeout limits the time without progress and, per item, the whole."""

from __future__ import annotations

from gcsplan.errors import InputError

TIMEOUT_S = 60.0
ITEM_S = 2.0
"""Seconds that each item adds to the limit of the whole transfer."""


def checked_timeout_s(timeout_s: float) -> float:
    """Return ``timeout_s`` if it lies within 0 … 3600 s (0 excluded); else raise InputError."""
    if not 0.0 < timeout_s <= 3600.0:
        raise InputError(f"a timeout must lie within 0 … 3600 s, given {timeout_s:g}")
    return timeout_s


class Patience:
    """Two limits: ``timeout_s`` without progress, and ``timeout_s`` plus `ITEM_S` per item in all, even with progress.

    ``items`` is None if the number is unknown until the vehicle reports it.
    """

    def __init__(self, timeout_s: float, items: int | None, now: float) -> None:
        self.timeout_s = checked_timeout_s(timeout_s)
        self._known, self._items = items is not None, items or 0
        self._started = self._moved_on = now
        self._best: tuple[int, ...] = ()

    @property
    def deadline(self) -> float:
        """The time at which the transfer must end unless there is progress before."""
        return min(self._moved_on + self.timeout_s, self._started + self.timeout_s + ITEM_S * self._items)

    def over(self, mark: tuple[int, ...], total: int, now: float) -> str | None:
        """Return in words why the time is over at ``now``; None if it is not.

        ``mark`` grows with every step of progress. ``total`` is the number of items reported by the vehicle; it is used
        only if ``items`` was None.
        """
        if not self._known:
            self._items = max(self._items, total)
        if mark > self._best:
            self._best, self._moved_on = mark, now
        if now < self.deadline:
            return None
        if now >= self._moved_on + self.timeout_s:
            return f"nothing new for {self.timeout_s:g} s (--timeout)"
        return (
            f"not done after {now - self._started:.0f} s, for {self._items} items the longest that a timeout of "
            f"{self.timeout_s:g} s allows (--timeout)"
        )
