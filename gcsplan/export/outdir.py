"""The output directory: one whole plan or none, without ever losing a file that gcsplan did not write.

A manifest (``.gcsplan``) names the files that gcsplan wrote, with their SHA-256. A file in the way that is not in the
manifest, or was edited since, is somebody's work: it is moved to ``previous/``, under a free name.
`gcsplan.export.generation` changes a directory from one plan to the next so that files of both are never visible
together.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from gcsplan.errors import InputError
from gcsplan.export.durable import sync_directory, write_whole, writing
from gcsplan.export.generation import (
    MANIFEST,
    NAME,
    PREVIOUS,
    Generation,
    digest_of_file,
    is_caught,
    is_plain,
    settle,
)

__all__ = [
    "MANIFEST",
    "PREVIOUS",
    "add_output",
    "can_hold",
    "has_outputs",
    "is_output",
    "outputs_in",
    "require_settled",
    "retire_outputs",
    "settle_outputs",
    "steady",
    "write_outputs",
    "write_whole",
]

MAX_MANIFEST_BYTES = 1_000_000
MAX_OUTPUT_BYTES = 1_000_000_000
"""No output is this large; a larger file is not gcsplan's, and is not read to find out."""

# Names of gcsplan's outputs, for a directory whose manifest is damaged.
_OURS = re.compile(
    r".+\.(waypoints|plan|param)|mission\.(kml|geojson)|profile\.csv|(summary|upload)\.json|report\.html"
)


def write_outputs(directory: str | os.PathLike[str], files: Mapping[str, str | bytes]) -> list[str]:
    """Make ``files`` (name to content, text in UTF-8) gcsplan's outputs in ``directory``; earlier outputs are removed.

    Returns the names of other files that were in the way and were moved to ``previous/``. Creates the directory if it
    is missing. Raises InputError if it cannot be written; nothing has changed then. Raises ValueError for a name that
    is not a plain file name.
    """
    return _write(Path(directory), files, keep=False)


def add_output(directory: str | os.PathLike[str], name: str, content: str | bytes) -> None:
    """Add one file to gcsplan's outputs in ``directory``, or replace it; the others stay. Raises as `write_outputs`."""
    _write(Path(directory), {name: content}, keep=True)


def retire_outputs(directory: str | os.PathLike[str]) -> list[str]:
    """Move gcsplan's outputs from ``directory`` to ``previous/`` in it, so that no old mission is flown by mistake.

    Returns the names that were moved. Outputs of an earlier retirement in ``previous/`` are replaced; other files there
    are kept under a free name. Raises InputError if that is impossible; nothing has changed then.
    """
    root = Path(directory)
    with _reported(root):
        if not root.is_dir():
            return []
        with writing(root):
            settle(root)
            ours = _manifest(root)
            names = sorted(name for name in ours if os.path.lexists(root / name))
            if not names:
                return []
            before = _manifest(root / PREVIOUS)
            with Generation(root) as next_one:
                for name, digest in sorted(before.items()):
                    if name not in names and _is_ours(root / PREVIOUS / name, digest):
                        next_one.discard(f"{PREVIOUS}/{name}")
                kept = {}
                for name in names:
                    in_the_way = root / PREVIOUS / name
                    if os.path.lexists(in_the_way):
                        leave = next_one.discard if _is_ours(in_the_way, before.get(name)) else next_one.set_aside
                        leave(f"{PREVIOUS}/{name}")
                    if _is_ours(root / name, ours[name]):
                        kept[name] = ours[name]
                    next_one.retire(name)
                for manifest in (f"{PREVIOUS}/{MANIFEST}", MANIFEST):
                    if os.path.lexists(root / manifest):
                        next_one.discard(manifest)
                next_one.bring(f"{PREVIOUS}/{MANIFEST}", _manifest_text(kept))
        return names


def settle_outputs(directory: str | os.PathLike[str]) -> bool:
    """If an earlier run was killed while it wrote to ``directory``, put back the outputs before it.

    Returns whether there was anything to put back. Raises InputError if that is impossible.
    """
    root = Path(directory)
    with _reported(root):
        if not root.is_dir() or not is_caught(root):
            return False
        with writing(root):
            return settle(root)


def require_settled(files: Iterable[str | os.PathLike[str]]) -> None:
    """Raise InputError if one of ``files`` is in a directory that is caught between two plans."""
    for folder in _folders(files):
        if is_caught(folder):
            raise InputError(
                "this directory is between two plans: gcsplan is writing here, or was cut off while it did, and which "
                "files belong together is not known. Wait, or run gcsplan plan with -o for this directory again, "
                "which settles it; or move the files elsewhere if you know what they are",
                where=str(folder),
            )


@contextmanager
def steady(files: Iterable[str | os.PathLike[str]]) -> Iterator[None]:
    """Wrap the reading of several files: raises InputError if a plan was written among them meanwhile."""
    files = tuple(files)
    folders = _folders(files)
    require_settled(files)
    before = [_mark(folder) for folder in folders]
    try:
        yield
    except InputError:  # files that are missing while a plan is written are not the user's mistake
        require_settled(files)
        raise
    require_settled(files)
    for folder, mark in zip(folders, before, strict=True):
        if _mark(folder) != mark:
            raise InputError("another gcsplan wrote its outputs here while they were read; run this again",
                             where=str(folder))  # fmt: skip


def outputs_in(directory: str | os.PathLike[str]) -> list[str]:
    """The names of gcsplan's outputs in ``directory``; none if it cannot be read."""
    root = Path(directory)
    try:
        return sorted(name for name in _manifest(root) if os.path.lexists(root / name))
    except OSError:
        return []


def has_outputs(directory: str | os.PathLike[str], digests: Mapping[str, str]) -> bool:
    """Whether these outputs (name to SHA-256) are in ``directory``, whole and unedited; if none, that it has none."""
    root = Path(directory)
    try:
        if not root.is_dir():
            return not digests
        if is_caught(root):
            return False
        if not digests:
            return not any(os.path.lexists(root / name) for name in _manifest(root))
        return all(_is_name(name) and _is_ours(root / name, digest) for name, digest in digests.items())
    except OSError:
        return False


def is_output(name: str) -> bool:
    """Whether gcsplan may write a file, or the folder of earlier files, of this name (in lower case) among outputs."""
    return _OURS.fullmatch(name) is not None or name in (PREVIOUS, MANIFEST)


def can_hold(directory: str | os.PathLike[str], file: str | os.PathLike[str]) -> bool:
    """Whether ``file`` may be one of gcsplan's outputs in ``directory``, by its place and its name."""
    path = Path(file)
    return Path(os.path.realpath(path.parent)) == Path(os.path.realpath(directory)) and _is_name(path.name)


def _write(root: Path, files: Mapping[str, str | bytes], *, keep: bool) -> list[str]:
    _check_names(files)
    contents = {name: c.encode("utf-8") if isinstance(c, str) else bytes(c) for name, c in files.items()}
    in_the_way = []
    with _reported(root), _made(root), writing(root):
        settle(root)
        ours = _manifest(root)
        with Generation(root) as next_one:
            leaving = [] if keep else [name for name in ours if name not in contents]
            for name in [*leaving, *contents]:
                if not os.path.lexists(root / name) or _is_among(root, name, leaving):
                    continue
                if _is_ours(root / name, ours.get(name)):
                    next_one.discard(name)
                else:
                    next_one.set_aside(name)
                    in_the_way.append(name)
            if os.path.lexists(root / MANIFEST):
                next_one.discard(MANIFEST)
            record = dict(ours) if keep else {}
            for name, content in contents.items():
                record[name] = next_one.bring(name, content)
            next_one.bring(MANIFEST, _manifest_text(record))
    return in_the_way


def _is_among(root: Path, name: str, others: Iterable[str]) -> bool:
    """Whether ``name`` equals one of ``others`` except for case, on a disk that ignores case."""
    alike = [root / other for other in others if other != name and other.casefold() == name.casefold()]
    return any(os.path.lexists(path) and os.path.samefile(path, root / name) for path in alike)


def _check_names(files: Mapping[str, str | bytes]) -> None:
    for name in files:
        if not _is_name(name):
            raise ValueError(f"an output's name must be a plain file name, given {name!r}")
    if len({name.casefold() for name in files}) < len(files):
        raise InputError(
            f"two outputs differ only by upper and lower case: {', '.join(sorted(files))}; rename a vehicle"
        )


def _is_name(name: str) -> bool:
    return NAME.fullmatch(name) is not None and name.casefold() != PREVIOUS


@contextmanager
def _reported(root: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        what = f"{error.filename}: " if error.filename else ""
        raise InputError(
            f"the outputs cannot be written ({what}{error.strerror or error}); nothing was changed there. Free the "
            f"place or choose another directory with -o",
            where=str(root),
        ) from error


@contextmanager
def _made(root: Path) -> Iterator[None]:
    """Create ``root`` and its missing parents; remove them again if the body fails."""
    missing = [p for p in (root, *root.parents) if not os.path.lexists(p)]
    made: list[Path] = []
    try:
        for path in reversed(missing):
            path.mkdir()
            made.append(path)
            sync_directory(path.parent)
        yield
    except BaseException:
        for path in reversed(made):
            with suppress(OSError):
                path.rmdir()
        raise


def _folders(files: Iterable[str | os.PathLike[str]]) -> list[Path]:
    """The directories of ``files``, links followed; names that no file can have are skipped."""
    return sorted({Path(os.path.realpath(file)).parent for file in files if "\0" not in os.fspath(file)})


def _mark(folder: Path) -> tuple[int, int, int] | None:
    """An identifier of the present plan in ``folder``; None if gcsplan wrote none there."""
    try:
        status = os.lstat(folder / MANIFEST)
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns, status.st_size


def _is_ours(path: Path, digest: str | None) -> bool:
    """Whether ``path`` is a plain file with the content that gcsplan wrote."""
    if digest is None or not is_plain(path) or os.lstat(path).st_size > MAX_OUTPUT_BYTES:
        return False
    return digest_of_file(path) == digest


def _manifest_text(record: Mapping[str, str | None]) -> bytes:
    return (json.dumps({"outputs": dict(sorted(record.items()))}, indent=1) + "\n").encode("ascii")


def _manifest(directory: Path) -> dict[str, str | None]:
    """Names that gcsplan wrote here, with digests; from a damaged manifest, names that look like outputs, with None."""
    path = directory / MANIFEST
    if not os.path.lexists(path):
        return {}
    if not is_plain(path):
        raise FileExistsError(17, "stands where gcsplan keeps its list of outputs", str(path))
    with path.open("rb") as stream:
        data = stream.read(MAX_MANIFEST_BYTES + 1)
    try:
        outputs = json.loads(data)["outputs"]
        entries = {str(name): str(digest) for name, digest in outputs.items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {p.name: None for p in directory.iterdir() if _OURS.fullmatch(p.name)}
    return {name: digest for name, digest in entries.items() if _is_name(name)}
