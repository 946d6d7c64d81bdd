"""The change from one generation of outputs to the next: at no time are files of both visible, even after a crash.

A plan's files belong together: today's uav1 file beside yesterday's uav2 file could mean a collision. No file system
renames many files at once, so a `Generation` takes three steps, in an order that a power failure cannot change:

1. The new files are written to ``.gcsplan-next/`` and brought to the disk, with a journal of all following moves.
2. The old files are moved away: only files of the earlier generation are visible, fewer and fewer of them.
3. The new files are moved in: only files of the new generation are visible. Then the journal is removed.

If the process dies in between, the journal stays, and a directory with a journal is *caught*. `settle` then undoes the
moves, however many were made, by comparing the journal with the files. Nothing is ever overwritten: a file that another
program put there meanwhile stays, and gcsplan's goes to ``previous/``.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import stat
from contextlib import suppress
from pathlib import Path

from gcsplan.errors import InputError
from gcsplan.export.durable import is_mine, sync_directory, sync_files, write_new

MANIFEST = ".gcsplan"
PREVIOUS = "previous"
STAGE = ".gcsplan-next"
JOURNAL = "journal.json"
MAX_JOURNAL_BYTES = 4_000_000

NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]*")
_PLACE = re.compile(rf"(?:{PREVIOUS}/)?(?:{re.escape(MANIFEST)}|{NAME.pattern})|{re.escape(STAGE)}/(?:new|old)-\d+")
_OURS_IN_STAGE = re.compile(rf"(?:new|old)-\d+|{re.escape(JOURNAL)}(?:\.part)?")

Move = tuple[str, str]
"""From and to, relative to the directory."""


class Generation:
    """The moves that bring a directory to its next generation: all are made, or all are undone.

    Used as a context inside `gcsplan.export.durable.locked`: the body records moves, and they are made if it succeeds.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.leaving: list[Move] = []
        self.coming: list[Move] = []
        self.digests: dict[str, str] = {}
        self.wants_previous = False

    def __enter__(self) -> Generation:
        os.mkdir(self.root / STAGE)
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            try:
                self._publish()
            except BaseException as failed:
                _abandon(self.root, failed)
                raise
        else:
            _abandon(self.root, error)

    def bring(self, name: str, content: bytes) -> str:
        """Stage a new file ``name``; an existing file there must leave. Returns the SHA-256 of the content."""
        staged, digest = f"new-{len(self.digests)}", hashlib.sha256(content).hexdigest()
        write_new(self.root / STAGE / staged, content)
        self.digests[staged] = digest
        self.coming.append((f"{STAGE}/{staged}", name))
        return digest

    def discard(self, name: str) -> None:
        """Record that a file of gcsplan leaves for good."""
        self.leaving.append((name, f"{STAGE}/old-{len(self.leaving)}"))

    def set_aside(self, name: str) -> None:
        """Record that a file moves to ``previous/``, under a free name."""
        self.wants_previous = True
        taken = {target for _, target in (*self.leaving, *self.coming)}
        self.leaving.append((name, _free(self.root, name.rpartition("/")[2], taken)))

    def retire(self, name: str) -> None:
        """Record that an output moves to ``previous/`` under its own name; an existing file there must leave."""
        self.wants_previous = True
        self.coming.append((name, f"{PREVIOUS}/{name}"))

    def _publish(self) -> None:
        if not (self.leaving or self.coming):
            _clear(self.root)
            return
        stage, previous = self.root / STAGE, self.root / PREVIOUS
        makes_previous = self.wants_previous and not _is_directory(previous)
        journal = {
            "version": 1, "leaving": self.leaving, "coming": self.coming, "digests": self.digests,
            "makes_previous": makes_previous,
        }  # fmt: skip
        write_new(stage / f"{JOURNAL}.part", json.dumps(journal).encode("ascii"))
        sync_files([stage / name for name in (*self.digests, f"{JOURNAL}.part")])
        sync_directory(self.root)  # the stage itself; after the next line the directory is caught
        os.replace(stage / f"{JOURNAL}.part", stage / JOURNAL)
        sync_directory(stage)
        if makes_previous:
            previous.mkdir()
        for moves in (self.leaving, self.coming):
            for source, target in moves:
                if os.path.lexists(self.root / target):
                    raise FileExistsError(errno.EEXIST, "appeared while the outputs were written", target)
                os.replace(self.root / source, self.root / target)
            _fence(self.root)
        _end(self.root)


def is_caught(root: Path) -> bool:
    """Whether ``root`` is between two generations: a run is writing there, or was cut off."""
    try:
        os.lstat(root / STAGE / JOURNAL)
    except PermissionError:  # another user's stage, which cannot be read
        return os.access(root, os.X_OK)
    except OSError:
        return False
    return True


def settle(root: Path) -> bool:
    """Undo what a killed run left half-done in ``root``; returns whether there was anything to undo.

    Call it inside `gcsplan.export.durable.locked`. Raises InputError if that is impossible, OSError if the file system
    refuses; the next call continues.
    """
    stage = root / STAGE
    try:
        mode = os.lstat(stage).st_mode
    except FileNotFoundError:
        return False
    if not stat.S_ISDIR(mode):
        raise FileExistsError(errno.EEXIST, "stands where gcsplan prepares its outputs", str(stage))
    if not is_mine(stage):
        raise InputError("was left by a run of another user that was cut off: let that user run gcsplan plan here "
                         "again, or move it away; files of theirs may be in it", where=str(stage))  # fmt: skip
    if not is_caught(root):
        _clear(root)
        return False
    leaving, coming, digests, makes_previous = _read_journal(stage / JOURNAL)
    for moves in (coming, leaving):
        for source, target in reversed(moves):
            _take_back(root, source, target, digests)
        _fence(root)
    if makes_previous:
        with suppress(OSError):  # another program may use it by now
            (root / PREVIOUS).rmdir()
    _end(root)
    return True


def digest_of_file(path: Path) -> str:
    """SHA-256 of a file's content."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def is_plain(path: Path) -> bool:
    """Whether ``path`` is a regular file, and not a link to one."""
    try:
        return stat.S_ISREG(os.lstat(path).st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return False


def _take_back(root: Path, source: str, target: str, digests: dict[str, str]) -> None:
    """Undo one move, if it was made; a file that was put at its source since then stays."""
    was, now = root / source, root / target
    if not os.path.lexists(now):
        return
    if os.path.lexists(was):
        if target.startswith(f"{STAGE}/") and source.rpartition("/")[2] != MANIFEST:
            # gcsplan's file had left, and another file has its place now.
            if not _is_directory(root / PREVIOUS):
                (root / PREVIOUS).mkdir()
            os.replace(now, root / _free(root, source.rpartition("/")[2], set()))
        return
    digest = digests.get(source.rpartition("/")[2]) if source.startswith(f"{STAGE}/") else None
    if digest is not None and not (is_plain(now) and digest_of_file(now) == digest):
        return  # the file there is no longer the one that gcsplan wrote
    os.replace(now, was)


def _read_journal(path: Path) -> tuple[list[Move], list[Move], dict[str, str], bool]:
    """The contents of a journal. Raises InputError if gcsplan cannot have written it, or it names outside places."""
    try:
        if not is_plain(path):
            raise ValueError("it is no file")
        with path.open("rb") as stream:
            data = stream.read(MAX_JOURNAL_BYTES + 1)
        record = json.loads(data)
        leaving, coming = ([(str(s), str(t)) for s, t in record[key]] for key in ("leaving", "coming"))
        places = [place for move in (*leaving, *coming) for place in move]
        if record["version"] != 1 or not all(_PLACE.fullmatch(p) and p != PREVIOUS for p in places):
            raise ValueError("it names places that no journal names")
        digests = {str(name): str(digest) for name, digest in record["digests"].items()}
        return leaving, coming, digests, record["makes_previous"] is True
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(
            f"an earlier run was cut off here, and its journal cannot be read ({str(error)[:80]}): the files of that "
            f"run are in {path.parent}; take what you need, remove that folder, and run this again",
            where=str(path),
        ) from None


def _abandon(root: Path, error: BaseException) -> None:
    """After a failure, move everything back. Raises InputError if that fails too."""
    try:
        settle(root)
    except (OSError, InputError) as second:
        raise InputError(
            f"the outputs could not be written ({error}), and what was moved could not be brought back ({second}): the "
            f"earlier files are in {root / STAGE}; the next run into this directory tries again",
            where=str(root),
        ) from error


def _end(root: Path) -> None:
    """Remove the journal and sync, so that the directory counts as whole before the files for undoing are deleted."""
    os.unlink(root / STAGE / JOURNAL)
    sync_directory(root / STAGE)
    _clear(root)


def _clear(root: Path) -> None:
    """Remove the stage, which is not needed any more."""
    stage = root / STAGE
    for name in sorted(os.listdir(stage)):
        if _OURS_IN_STAGE.fullmatch(name):
            os.unlink(stage / name)
    os.rmdir(stage)


def _fence(root: Path) -> None:
    """Bring every move so far to the disk before any later one; targets are synced first, so that no file is lost."""
    for directory in (root / STAGE, root / PREVIOUS, root):
        if directory.is_dir():
            sync_directory(directory)


def _is_directory(path: Path) -> bool:
    """True for a directory, False for nothing. Raises NotADirectoryError for a link or a file."""
    try:
        mode = os.lstat(path).st_mode
    except FileNotFoundError:
        return False
    if not stat.S_ISDIR(mode):
        raise NotADirectoryError(errno.ENOTDIR, "this is not a directory", str(path))
    return True


def _free(root: Path, name: str, taken: set[str]) -> str:
    """A name in ``previous/`` that is free there and not among ``taken``."""
    stem, dot, suffix = name.rpartition(".")
    candidate, number = f"{PREVIOUS}/{name}", 1
    while candidate in taken or os.path.lexists(root / candidate):
        candidate = f"{PREVIOUS}/" + (f"{stem}.{number}{dot}{suffix}" if stem else f"{name}.{number}")
        number += 1
    return candidate
