"""How long a conversation may take: the user's timeout is the longest time without progress, and bounds the whole."""

from __future__ import annotations

from gcsplan.errors import InputError

TIMEOUT_S = 60.0
ITEM_S = 2.0
"""What every item adds to the whole: seconds."""


def checked_timeout_s(timeout_s: float) -> float:
    """``timeout_s`` if it is one. Raises InputError."""
    if not 0.0 < timeout_s <= 3600.0:
        raise InputError(f"a timeout must lie within 0 … 3600 s, given {timeout_s:g}")
    return timeout_s


class Patience:
    """``timeout_s`` without progress end it, and the same with `ITEM_S` an item on top ends it with progress.

    ``items`` None: not known before the vehicle has said it.
    """

    def __init__(self, timeout_s: float, items: int | None, now: float) -> None:
        self.timeout_s = checked_timeout_s(timeout_s)
        self._known, self._items = items is not None, items or 0
        self._started = self._moved_on = now
        self._best: tuple[int, ...] = ()

    @property
    def deadline(self) -> float:
        """When it ends if nothing happens."""
        return min(self._moved_on + self.timeout_s, self._started + self.timeout_s + ITEM_S * self._items)

    def over(self, mark: tuple[int, ...], total: int, now: float) -> str | None:
        """Why it is over, in words; None while it is not.

        ``mark`` grows with every step forward, ``total`` is how many items there are if that is not known before.
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
