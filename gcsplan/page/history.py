"""`EditHistory`: the documents of a mission before and after the one in force, for undo and redo.

It is kept in the user's private cache, for the next start of the server. The kept steps are trusted as the machine
code beside them is: nobody else can have written them.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import pickle
import zlib
from itertools import accumulate
from pathlib import Path
from typing import Any

from gcsplan.native import cache

EditedDocument = dict[str, Any]

MOST_STEPS = 200
MOST_BYTES = 64 * 2**20
"""Most steps that are kept, and most bytes of all of them; the oldest go first."""

MOST_KEPT_BYTES = 2 * 2**20
"""Most bytes of the steps to either side that are kept for the next start; the farthest go first."""


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

    def keep(self, place: Path, now: EditedDocument) -> None:
        """Keep the newest steps of the mission at ``place``, whose document is ``now``, for the next start."""
        sides = []
        for steps in (self._past, self._next):  # of both the last one is the nearest
            sizes = list(accumulate(len(step) for step in reversed(steps)))
            fitting = sum(size <= MOST_KEPT_BYTES for size in sizes)
            sides.append(steps[len(steps) - fitting :])
        cache.keep(_kept_as(place), pickle.dumps((*sides, _packed(now))))

    @classmethod
    def kept(cls, place: Path, now: EditedDocument) -> EditHistory | None:
        """The steps of an earlier start that led to the document ``now``; None if there are none, or of another one."""
        data = cache.read_kept(_kept_as(place))
        if data is None:
            return None
        history = cls()
        try:
            history._past, history._next, last = pickle.loads(data)
        except (pickle.UnpicklingError, ValueError, TypeError):  # of another version
            return None
        return history if _plainly(_unpacked(last)) == _plainly(now) else None

    @staticmethod
    def _moved(source: list[bytes], target: list[bytes], now: EditedDocument) -> EditedDocument | None:
        if not source:
            return None
        target.append(_packed(now))
        return _unpacked(source.pop())


def _packed(document: EditedDocument) -> bytes:
    return zlib.compress(pickle.dumps(document), level=1)


def _unpacked(step: bytes) -> EditedDocument:
    document: EditedDocument = pickle.loads(zlib.decompress(step))
    return document


def plain_date(value: Any) -> str:
    """A date as JSON has it."""
    if isinstance(value, datetime.date):
        return value.isoformat()
    raise TypeError(f"{type(value).__name__} is no value of a mission")


def _plainly(document: EditedDocument) -> Any:
    """The document as it comes back from a file of edits, where dates are texts."""
    return json.loads(json.dumps(document, default=plain_date))


def _kept_as(place: Path) -> str:
    return cache.name_of_code("undo", hashlib.sha256(str(place.absolute()).encode("utf-8", "replace")).hexdigest())
