"""Questions of tests about notes: their codes, and the notes within them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from gcsplan.notes.note import Note


def codes(notes: Iterable[Note]) -> list[str]:
    """The codes of the notes, in order."""
    return [note.code for note in notes]


def within(note: Note) -> Iterator[Note]:
    """A note and all that are data of it."""
    yield note
    for value in note.data.values():
        for each in value if isinstance(value, tuple) else (value,):
            if isinstance(each, Note):
                yield from within(each)


def coded(notes: Iterable[Note], code: str) -> Note:
    """The first note with a code. Raises StopIteration if there is none."""
    return next(note for note in notes if note.code == code)


def one(code: str, notes: Iterable[Note]) -> Note:
    """The only note with ``code``."""
    [found] = [note for note in notes if note.code == code]
    return found


def saying(words: str) -> Note:
    """A note in whose sentence ``words`` stand."""
    return Note("flown_by_computer", name=words)
