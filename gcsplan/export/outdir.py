"""The output directory: written whole or not at all, and never at the cost of a file that is not ours.

A manifest (``.gcsplan``) names the files that gcsplan wrote, with their SHA-256. A file that stands in the way and is
not in it, or was edited since, is somebody's work: it is moved to ``previous/``, under a free name, and never lost.
All new files are complete on the disk before the first one is moved to its place; if a move fails, those before it are
taken back.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from gcsplan.errors import InputError

MANIFEST = ".gcsplan"
PREVIOUS = "previous"
MAX_MANIFEST_BYTES = 1_000_000

_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]*")
# What gcsplan's outputs are called, for a directory whose manifest is damaged.
_OURS = re.compile(r".+\.(waypoints|plan)|mission\.(kml|geojson)|profile\.csv|(summary|upload)\.json|report\.html")


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write one file of the user's choice, whole or not at all; what is there is replaced. Raises InputError."""
    target = Path(path)
    data = content.encode("utf-8") if isinstance(content, str) else content
    try:
        handle, name = tempfile.mkstemp(prefix=f"{MANIFEST}-", dir=target.parent)
        part = Path(name)
        try:
            with open(handle, "wb") as stream:
                stream.write(data)
            mask = os.umask(0)
            os.umask(mask)
            part.chmod(0o666 & ~mask)  # as any other new file; mkstemp's own are for the owner alone
            part.replace(target)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be written: {getattr(error, 'strerror', None) or error}", where=str(path)) from error


def write_outputs(directory: str | os.PathLike[str], files: Mapping[str, str | bytes]) -> list[str]:
    """Make ``files`` (name to content, text in UTF-8) gcsplan's outputs in ``directory``; earlier ones go.

    Returns the names of files of others that stood in the way and were moved to ``previous/``. The directory is made
    where it is missing. Raises InputError where it cannot be written; then everything is as it
    was. Raises ValueError for a name that is no plain file name.
    """
    return _write(Path(directory), files, keep=False)


def add_output(directory: str | os.PathLike[str], name: str, content: str | bytes) -> None:
    """Add one file to gcsplan's outputs in ``directory``, or replace it; the others stay. Raises as `write_outputs`."""
    _write(Path(directory), {name: content}, keep=True)


def retire_outputs(directory: str | os.PathLike[str]) -> list[str]:
    """Move gcsplan's outputs from ``directory`` to ``previous/`` in it, so that no old mission is flown by mistake.

    Returns the names that were moved. What an earlier retirement left in ``previous/`` is replaced; files of others
    there are kept under a free name. Raises InputError where it cannot be done; then everything is as it was.
    """
    root = Path(directory)
    with _reported(root):
        if not root.is_dir():
            return []
        ours = _manifest(root)
        names = sorted(name for name in ours if os.path.lexists(root / name))
        if not names:
            return []
        previous = root / PREVIOUS
        with _Moves(root) as moves:
            moves.make_directory(previous)
            before = _manifest(previous)
            for name, digest in sorted(before.items()):
                if _is_ours(previous / name, digest):
                    moves.discard(previous / name)
            kept = {}
            for name in names:
                if os.path.lexists(previous / name):
                    moves.move(previous / name, _free(previous, name))
                if _is_ours(root / name, ours[name]):
                    kept[name] = ours[name]
                moves.move(root / name, previous / name)
            for manifest in (previous / MANIFEST, root / MANIFEST):
                if os.path.lexists(manifest):
                    moves.discard(manifest)
            moves.move(moves.stage_file(MANIFEST, _manifest_text(kept)), previous / MANIFEST)
        return names


def _write(root: Path, files: Mapping[str, str | bytes], *, keep: bool) -> list[str]:
    _check_names(files)
    contents = {name: c.encode("utf-8") if isinstance(c, str) else bytes(c) for name, c in files.items()}
    in_the_way = []
    with _reported(root), _made(root):
        ours = _manifest(root)
        with _Moves(root) as moves:
            digests = {name: hashlib.sha256(content).hexdigest() for name, content in contents.items()}
            record = {**(ours if keep else {}), **digests}
            staged = {name: moves.stage_file(name, content) for name, content in contents.items()}
            manifest = moves.stage_file(MANIFEST, _manifest_text(record))
            leaving = [] if keep else [name for name in ours if name not in contents]
            for name in [*leaving, *staged]:
                target = root / name
                if os.path.lexists(target):
                    if _is_ours(target, ours.get(name)):
                        moves.discard(target)
                    else:
                        moves.make_directory(root / PREVIOUS)
                        moves.move(target, _free(root / PREVIOUS, name))
                        in_the_way.append(name)
                if name in staged:
                    moves.move(staged[name], target)
            if os.path.lexists(root / MANIFEST):
                moves.discard(root / MANIFEST)
            moves.move(manifest, root / MANIFEST)
    return in_the_way


def _check_names(files: Mapping[str, str | bytes]) -> None:
    for name in files:
        if not _NAME.fullmatch(name) or name.casefold() == PREVIOUS:
            raise ValueError(f"an output's name must be a plain file name, given {name!r}")
    if len({name.casefold() for name in files}) < len(files):
        raise InputError(
            f"two outputs differ only by upper and lower case: {', '.join(sorted(files))}; rename a vehicle"
        )


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
    """Make ``root`` and what is missing above it; unmake it if what follows fails."""
    missing = [p for p in (root, *root.parents) if not os.path.lexists(p)]
    made: list[Path] = []
    try:
        for path in reversed(missing):
            path.mkdir()
            made.append(path)
        yield
    except BaseException:
        for path in reversed(made):
            with suppress(OSError):
                path.rmdir()
        raise


class _Moves:
    """Moves inside one directory that are all done or, if anything fails, all taken back.

    Nothing is ever overwritten: what is in the way is moved aside first, so each move can be undone by its reverse.
    What was discarded is deleted only at the end.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.done: list[tuple[Path, Path]] = []
        self.directories: list[Path] = []

    def __enter__(self) -> _Moves:
        self.stage = Path(tempfile.mkdtemp(prefix=f"{MANIFEST}-", dir=self.root))
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is not None:
            self._undo(error)
        shutil.rmtree(self.stage, ignore_errors=True)

    def stage_file(self, name: str, content: bytes) -> Path:
        """Write a file that `move` will bring to its place."""
        path = self.stage / f"new-{name}"
        path.write_bytes(content)
        return path

    def make_directory(self, path: Path) -> None:
        """Make ``path`` unless it is there; a link or a file in its place is an error."""
        if os.path.lexists(path) and (path.is_symlink() or not path.is_dir()):
            raise NotADirectoryError(20, "a directory is wanted here, and this is none", str(path))
        if not path.is_dir():
            path.mkdir()
            self.directories.append(path)

    def move(self, source: Path, target: Path) -> None:
        """Bring ``source`` to ``target``, which must be free."""
        self.done.append((source, target))
        os.replace(source, target)

    def discard(self, path: Path) -> None:
        """Put ``path`` where it is deleted at the end."""
        self.move(path, self.stage / f"old-{len(self.done)}")

    def _undo(self, error: BaseException) -> None:
        while self.done:
            source, target = self.done.pop()
            if not os.path.lexists(target):
                continue  # this is the move that failed
            try:
                os.replace(target, source)
            except OSError as second:
                raise InputError(
                    f"the outputs could not be written ({error}), and what was moved could not be brought back "
                    f"({second}): the earlier files are in {self.stage}",
                    where=str(self.root),
                ) from error
        for path in reversed(self.directories):
            with suppress(OSError):
                path.rmdir()


def _free(directory: Path, name: str) -> Path:
    stem, dot, suffix = name.rpartition(".")
    candidate, number = directory / name, 1
    while os.path.lexists(candidate):
        candidate = directory / (f"{stem}.{number}{dot}{suffix}" if stem else f"{name}.{number}")
        number += 1
    return candidate


def _is_ours(path: Path, digest: str | None) -> bool:
    """True for a plain file that still is what gcsplan wrote."""
    if digest is None or path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest() == digest


def _manifest_text(record: Mapping[str, str | None]) -> bytes:
    return (json.dumps({"outputs": dict(sorted(record.items()))}, indent=1) + "\n").encode("ascii")


def _manifest(directory: Path) -> dict[str, str | None]:
    """Names that gcsplan wrote here to their digests; None for those of a damaged manifest, told by their names."""
    path = directory / MANIFEST
    if not os.path.lexists(path):
        return {}
    if path.is_symlink() or not path.is_file():
        raise FileExistsError(17, "stands where gcsplan keeps its list of outputs", str(path))
    with path.open("rb") as stream:
        data = stream.read(MAX_MANIFEST_BYTES + 1)
    try:
        outputs = json.loads(data)["outputs"]
        entries = {str(name): str(digest) for name, digest in outputs.items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {p.name: None for p in directory.iterdir() if _OURS.fullmatch(p.name)}
    return {n: d for n, d in entries.items() if _NAME.fullmatch(n) and n.casefold() != PREVIOUS}
