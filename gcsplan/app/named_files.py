"""Files that an argument of a command names: one file, the files of a folder, or the files of a pattern."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator
from pathlib import Path

from gcsplan.errors import InputError

__all__ = ["named_files", "names_several"]


def names_several(text: str) -> bool:
    """Whether ``text`` is a folder or a pattern, and no file of that name."""
    # os.path answers False for names that no disk can hold, where pathlib raises OSError.
    return os.path.isdir(text) or (any(c in text for c in "*?[") and not os.path.exists(text))


def natural(path: Path) -> list[tuple[str | int, ...]]:
    """The key of the order in which people count: ``leg2`` before ``leg10``, folder by folder."""
    return [
        tuple(int(part) if k % 2 else part for k, part in enumerate(re.split("([0-9]+)", name))) for name in path.parts
    ]


def named_files(text: str, suffixes: Collection[str]) -> list[Path]:
    """The files of a folder, and of those in it, that end in ``suffixes``, in small or capital letters, or of a
    pattern, in natural order; else ``text``. A link that leads nowhere is one, so that whoever
    opens it says so.

    Raises InputError for a pattern that is none, or a folder that cannot be read.
    """
    path = Path(text)
    if not names_several(text):
        return [path]
    root = Path(path.anchor) if path.is_absolute() else Path()
    try:
        if "\0" in text:  # from Python 3.13 on, such a pattern finds nothing
            raise ValueError("embedded null character")
        if path.is_dir():
            return sorted((p for p in _below(path) if p.suffix.lower() in suffixes and _is_file(p)), key=natural)
        return sorted((p for p in root.glob(str(path.relative_to(path.anchor))) if _is_file(p)), key=natural)
    except (OSError, ValueError) as why:
        raise InputError(f"cannot be searched for files: {why}", where=text) from why


def _is_file(path: Path) -> bool:
    return path.is_file() or (path.is_symlink() and not path.exists())


def _below(folder: Path) -> Iterator[Path]:
    """What lies in a folder and in those below it, also behind links, each folder once. Raises OSError for a folder
    that cannot be read: `Path.rglob` passes it by, and what is not seen would count as judged."""
    waiting = [folder]
    seen: set[tuple[int, int]] = set()
    for top in waiting:  # links come last, so that a folder has its own name where it has one
        for here, inner, names in os.walk(top, onerror=_refuse):
            at = os.stat(here)
            if (at.st_dev, at.st_ino) in seen:
                inner.clear()
                continue
            seen.add((at.st_dev, at.st_ino))
            waiting += [Path(here, name) for name in sorted(inner) if os.path.islink(os.path.join(here, name))]
            yield from (Path(here, name) for name in names)


def _refuse(why: OSError) -> None:
    raise why
