"""Files that an argument of a command names: one, those of a folder, or those of a pattern."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

__all__ = ["named_files", "names_several"]


def names_several(text: str) -> bool:
    """Whether ``text`` is a folder or a pattern, and no file of that name."""
    path = Path(text)
    return path.is_dir() or (any(c in text for c in "*?[") and not path.exists())


def named_files(text: str, suffixes: Collection[str]) -> list[Path]:
    """The files of a folder, and of those in it, that end in ``suffixes``, or of a pattern, sorted; else ``text``."""
    path = Path(text)
    if not names_several(text):
        return [path]
    if path.is_dir():
        return sorted(p for p in path.rglob("*") if p.suffix in suffixes and p.is_file())
    root = Path(path.anchor) if path.is_absolute() else Path()
    return sorted(p for p in root.glob(str(path.relative_to(path.anchor))) if p.is_file())
