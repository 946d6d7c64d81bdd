"""What is said of a mission, as codes."""

from __future__ import annotations

from collections.abc import Iterable

from gcsplan.notes.note import Note, Said


def codes(notes: Iterable[Said]) -> list[str]:
    """The codes of the notes among ``notes``, in order."""
    return [note.code for note in notes if isinstance(note, Note)]


def one(code: str, notes: Iterable[Said]) -> Note:
    """The only note with ``code``."""
    [found] = [note for note in notes if isinstance(note, Note) and note.code == code]
    return found
