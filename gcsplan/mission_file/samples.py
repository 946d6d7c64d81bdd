"""The sample missions that come with gcsplan: ``sample:NAME`` stands for the mission file of that name.

The files lie in ``missions/`` of the repository; the build copies them into the package (pyproject.toml), so that they
are there after ``pip install`` alone.
"""

from __future__ import annotations

import os
from pathlib import Path

from gcsplan.errors import InputError
from gcsplan.mission_file.values.schema import nearest
from gcsplan.world.terrain.input_files import tell_file

PREFIX = "sample:"
SAMPLE_FOLDERS = (Path(__file__).parents[1] / "missions", Path(__file__).parents[2] / "missions")
"""Where the files are: within an installed package, or beside the sources."""


def names() -> list[str]:
    """The names of all samples, without the prefix; those in a folder begin with its name (``papers/abo``)."""
    folder = _folder()
    return sorted(file.relative_to(folder).with_suffix("").as_posix() for file in folder.rglob("*.yaml"))


def is_sample(source: str | os.PathLike[str]) -> bool:
    """Whether ``source`` names a sample; a file that is really called so keeps its meaning."""
    if not os.fspath(source).startswith(PREFIX):
        return False
    tell_file(source)
    return not os.path.exists(source)


def file_of(source: str | os.PathLike[str]) -> Path:
    """The file that ``source`` names, a path or ``sample:NAME``. Raises InputError for a sample that does not exist."""
    if not is_sample(source):
        return Path(source)
    name = os.fspath(source).removeprefix(PREFIX).replace(os.sep, "/")
    known = names()
    if name not in known:
        near = nearest(name, known) or "."
        raise InputError(f"there is no such sample{near} There are: {', '.join(known)}", where=os.fspath(source))
    return _folder() / f"{name}.yaml"


def hint(file: Path) -> str:
    """``; did you mean sample:…?`` where a missing file has the name of a sample, or an empty text."""
    return f"; did you mean {PREFIX}{file.stem}?" if file.stem in names() else ""


def _folder() -> Path:
    return next((folder for folder in SAMPLE_FOLDERS if folder.is_dir()), SAMPLE_FOLDERS[0])
