"""Durable files: whole or not at all, and on the disk before anything relies on them.

Data handed to the operating system is not yet on the disk: after a power failure any part may be missing, in any order.
Only `sync_directory` and the `fsync` of a file are barriers, so a write that others rely on is followed by one first.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

from gcsplan.errors import InputError

try:
    import fcntl
except ImportError:  # Windows: no locks, and no barriers for directories; docs/safety.md states the consequences
    POSIX = False
else:
    POSIX = True

PART = ".gcsplan-part-"
"""Prefix of a file that `write_whole` is writing; the file is locked while its writer lives."""

LOCK_WAIT_S = 10.0
"""Seconds that a run waits for another one that is writing to the same directory."""

in_progress = 0
"""How many writes are in progress, which a signal must not cut off."""

_PART_NAME = re.compile(re.escape(PART) + r"[0-9a-f]{16}")
_CANNOT_SYNC = {errno.EINVAL, errno.ENOTSUP, errno.EBADF, errno.EACCES, errno.EPERM}
_CANNOT_LOCK = {errno.EINVAL, errno.ENOTSUP, errno.EBADF, errno.ENOLCK, errno.ENOSYS}
_ATTEMPTS = 5
_AT_ONCE = 16


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write one file of the user's choice, whole or not at all, replacing an existing one. Raises InputError, also for
    a device such as ``/dev/null``.

    Half-written files beside it, left by an earlier run that was killed, are removed.
    """
    target = Path(path)
    data = content.encode("utf-8") if isinstance(content, str) else content
    with _uncut():
        _replace(target, data)


@contextmanager
def _uncut() -> Iterator[None]:
    global in_progress
    in_progress += 1
    try:
        yield
    finally:
        in_progress -= 1


def _replace(target: Path, data: bytes) -> None:
    try:
        if target.exists() and not (target.is_file() or target.is_dir()):
            raise ValueError("it is a device or a pipe, and no file takes its place")
        _sweep(target.parent)
        handle, part = new_part(target.parent)
        try:
            try:
                _write(handle, data)
                os.fsync(handle)
            finally:
                os.close(handle)
            os.replace(part, target)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
        sync_directory(target.parent)
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot be written: {getattr(error, 'strerror', None) or error}", where=str(target)
        ) from error


def write_new(path: Path, data: bytes) -> None:
    """Create a file that must not exist yet; call `sync_files` to bring it to the disk. Raises OSError."""
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    try:
        _write(handle, data)
    finally:
        os.close(handle)


def sync_files(paths: Sequence[Path]) -> None:
    """Return when the contents of all ``paths`` are on the disk. Raises OSError."""
    # Several at once, since the disk then needs one write of its journal for all of them.
    with ThreadPoolExecutor(min(len(paths), _AT_ONCE)) as pool:
        list(pool.map(_sync_file, paths))


def _sync_file(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY if POSIX else os.O_RDWR)  # Windows syncs only files that are open for writing
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def sync_directory(path: Path) -> None:
    """Return when the present names in ``path`` are on the disk, if the file system supports that."""
    if not POSIX:
        return
    handle = -1
    try:
        handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
        os.fsync(handle)
    except OSError as error:  # some network file systems cannot sync directories
        if error.errno not in _CANNOT_SYNC:
            raise
    finally:
        if handle >= 0:
            os.close(handle)


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Keep every other gcsplan from writing to ``directory`` meanwhile, if the file system has locks.

    The lock ends with the process, however that ends. Raises InputError if another process holds it for `LOCK_WAIT_S`.
    """
    if not POSIX:
        yield
        return
    until = time.monotonic() + LOCK_WAIT_S
    while True:
        handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
        try:
            free = _take_lock(handle)
            if free and os.path.samestat(os.fstat(handle), os.stat(directory)):  # otherwise it was replaced meanwhile
                yield
                return
        finally:
            os.close(handle)
        if time.monotonic() > until:
            raise InputError(
                f"another gcsplan has been writing here for {LOCK_WAIT_S:g} s; nothing was changed. Wait for it, or "
                f"choose another directory with -o",
                where=str(directory),
            )
        time.sleep(0.02)


@contextmanager
def writing(directory: Path) -> Iterator[None]:
    """As `locked`, for a body that does nothing but write: no signal cuts it off."""
    with locked(directory), _uncut():
        yield


def is_mine(path: Path | str) -> bool:
    """Whether ``path`` itself (not a link's target) belongs to this process's user; True where files have no owner."""
    return not hasattr(os, "geteuid") or os.lstat(path).st_uid == os.geteuid()


def _take_lock(handle: int) -> bool:
    """Take the lock: False if another process holds it, True if it is taken now or there are no locks."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in _CANNOT_LOCK:
            raise
    return True


def _write(handle: int, data: bytes) -> None:
    left = memoryview(data)
    while left:
        left = left[os.write(handle, left) :]


def new_part(directory: Path) -> tuple[int, Path]:
    """Create a locked file with a unique name."""
    for _ in range(_ATTEMPTS):
        part = directory / f"{PART}{secrets.token_hex(8)}"
        handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        if not POSIX or (_take_lock(handle) and os.fstat(handle).st_nlink):
            return handle, part
        os.close(handle)  # another run removed it as a leftover before it was locked
    raise FileExistsError(errno.EEXIST, "other runs keep removing what is written here", str(directory))


def _sweep(directory: Path) -> None:
    """Remove leftovers of dead writers: files of this user with a part's name that no process has locked."""
    if not POSIX:
        return
    with os.scandir(directory) as entries:
        parts = [e.path for e in entries if _PART_NAME.fullmatch(e.name) and e.is_file(follow_symlinks=False)]
    for part in parts:
        with suppress(OSError):
            if not is_mine(part):
                continue
            handle = os.open(part, os.O_RDONLY | os.O_NOFOLLOW)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.unlink(part)
            finally:
                os.close(handle)
