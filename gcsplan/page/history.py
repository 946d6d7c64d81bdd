"""`EditHistory`: the documents of a mission before and after the one in force, for undo and redo."""

from __future__ import annotations

import pickle
import zlib
from typing import Any

EditedDocument = dict[str, Any]

MOST_STEPS = 200
MOST_BYTES = 64 * 2**20
"""Most steps that are kept, and most bytes of all of them; the oldest go first."""


class EditHistory:
    """Steps of one mission; each is a whole document, packed."""

    def __init__(self) -> None:
        self._past: list[bytes] = []
        self._next: list[bytes] = []

    @property
    def can_undo(self) -> bool:
        """Whether there is a document before the one in force."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """Whether there is a document that was undone."""
        return bool(self._next)

    def step(self, before: EditedDocument) -> None:
        """Note that ``before`` was changed; the steps that were undone are forgotten."""
        self._next.clear()
        self._past.append(_packed(before))
        while len(self._past) > MOST_STEPS or sum(map(len, self._past)) > MOST_BYTES:
            del self._past[0]

    def undo(self, now: EditedDocument) -> EditedDocument | None:
        """The document before ``now``; None if there is none."""
        return self._moved(self._past, self._next, now)

    def redo(self, now: EditedDocument) -> EditedDocument | None:
        """The document that was undone last; None if there is none."""
        return self._moved(self._next, self._past, now)

    @staticmethod
    def _moved(source: list[bytes], target: list[bytes], now: EditedDocument) -> EditedDocument | None:
        if not source:
            return None
        target.append(_packed(now))
        document: EditedDocument = pickle.loads(zlib.decompress(source.pop()))
        return document


def _packed(document: EditedDocument) -> bytes:
    return zlib.compress(pickle.dumps(document), level=1)
