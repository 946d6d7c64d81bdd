"""Stores the intermediate form of kernels beside their source, and machine code in a private cache on disk.

Machine code is run as it is found: whoever can write to the cache can run anything as the user of this process. So it
is taken only from a regular file that belongs to that user and that nobody else can write to, in a folder (0700) for
which the same holds. A folder of ours with a wider mode is tightened, and emptied if others could write to it. If the
cache belongs to somebody else, or there is no place for one, kernels are compiled in memory. The digest in front of the
code detects an incomplete file; it does not show who wrote it. The shipped form has the trust of its package.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import sys
import tempfile
import time
import zlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

SHIPPED_SUFFIX = ".kernels"
MAX_CODE_BYTES = 64_000_000
NEWEST = 8
"""Newest machine codes of the same kernels that are kept, for versions side by side."""

OLD_PART_S = 86_400.0
"""An unfinished file older than this, s, is abandoned."""

_CHECK = 32  # bytes of the digest before the kept code
_SUFFIX_OF_CODE = ".code"
_SUFFIX_OF_PART = ".part"


def digest_of(sources: Sequence[Path], more: str) -> str | None:
    """The digest of the files' contents and ``more``; None if a file cannot be read."""
    digest = hashlib.sha256(more.encode())
    try:
        for path in sources:
            digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    except OSError:
        return None
    return digest.hexdigest()


def read_shipped(path: Path, digest: str | None) -> bytes | None:
    """The bitcode in ``path`` if it was made from sources with ``digest`` (None: from any sources); else None."""
    try:
        head, _, body = path.read_bytes().partition(b"\n")
        if digest is not None and json.loads(head)["sources"] != digest:
            return None
        return zlib.decompress(body)
    except (OSError, ValueError, KeyError, TypeError, zlib.error):
        return None


def write_shipped(path: Path, digest: str, made_with: dict[str, str], bitcode: bytes) -> None:
    """Write bitcode beside its sources."""
    head = json.dumps({"sources": digest, **made_with}, sort_keys=True)
    _replace(path, head.encode() + b"\n" + zlib.compress(bitcode, 9), mode=0o644)  # all who share the package read it


def read_kept(name: str) -> bytes | None:
    """The bytes of that name from the cache, if they are there, whole, and nobody else could have put them there."""
    try:
        folder = _cache()
        if folder is None or not _is_private(folder):
            return None
        with open(folder / name, "rb", opener=_open_plainly) as file:
            if not _is_trusted(os.fstat(file.fileno())):
                return None
            kept = file.read(MAX_CODE_BYTES)
    except OSError:
        return None
    return kept[_CHECK:] if hashlib.sha256(kept[_CHECK:]).digest() == kept[:_CHECK] else None


def keep(name: str, code: bytes) -> bool:
    """Write bytes to the cache, which nobody else can read; return False if there is none of ours alone.

    Older ones of their kind are dropped.
    """
    try:
        folder = _cache()
        if folder is None:
            return False
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not _is_private(folder):
            return False
        _replace(folder / name, hashlib.sha256(code).digest() + code, mode=0o600)
    except OSError:
        return False
    _forget_others(folder, name)
    return True


def _cache() -> Path | None:
    """The user's cache, or one in the folder of NUMBA_CACHE_DIR; None if no absolute path is known.

    A relative path would mean another folder, perhaps somebody else's, in every working directory.
    """
    folder = os.environ.get("NUMBA_CACHE_DIR")
    try:
        if folder:
            base = Path(folder)
        elif sys.platform == "win32":
            base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
        elif sys.platform == "darwin":
            base = Path.home() / "Library" / "Caches"
        else:
            given = os.environ.get("XDG_CACHE_HOME", "")
            base = Path(given) if os.path.isabs(given) else Path.home() / ".cache"
    except RuntimeError:  # no home is known
        return None
    return base / "gcsplan" if base.is_absolute() else None


def _is_private(folder: Path) -> bool:
    """Whether a folder is this user's and, once tightened, nobody else's. Raises OSError if it does not exist."""
    if os.name != "posix":  # the user's own folder has an access list, which modes do not show
        return folder.is_dir()
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        status = os.fstat(handle)
        if status.st_uid != os.geteuid():
            return False
        if status.st_mode & 0o077:
            os.fchmod(handle, 0o700)
        if status.st_mode & 0o022:  # whoever could write here may have put something here
            for name in os.listdir(handle):
                if name.endswith((_SUFFIX_OF_CODE, _SUFFIX_OF_PART)):
                    os.unlink(name, dir_fd=handle)
        return not os.fstat(handle).st_mode & 0o077  # some file systems keep no modes
    finally:
        os.close(handle)


def _open_plainly(path: str, flags: int) -> int:
    """Open a file, but no link, and without waiting if it is a pipe."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))


def _is_trusted(status: os.stat_result) -> bool:
    """Whether an open file is a regular file of this user, with only this name, that nobody else can write to."""
    if not stat.S_ISREG(status.st_mode) or status.st_size > MAX_CODE_BYTES:
        return False
    if os.name != "posix":
        return True
    return status.st_uid == os.geteuid() and status.st_nlink == 1 and not status.st_mode & 0o022


def _replace(path: Path, content: bytes, *, mode: int) -> None:
    """Write a file whole or not at all: another process may be reading it, or writing the same."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=_SUFFIX_OF_PART)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(name, mode)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _forget_others(folder: Path, name: str) -> None:
    """Drop all but the newest codes of the same kind (each change of source or machine adds one) and old parts."""
    kind = name.split("-")[0]

    def age(path: Path) -> float:
        try:
            return path.stat().st_mtime
        except OSError:
            return 0.0

    others = sorted(folder.glob(f"{kind}-*{_SUFFIX_OF_CODE}"), key=age)[:-NEWEST]
    cut_off = [p for p in folder.glob(f"*{_SUFFIX_OF_PART}") if age(p) < time.time() - OLD_PART_S]
    for old in (*others, *cut_off):
        with suppress(OSError):
            old.unlink()


def name_of_code(kind: str, key: str) -> str:
    """The file name of what is kept of a kind under a key, such as some kernels' machine code for a machine."""
    return f"{kind}-{key[:32]}{_SUFFIX_OF_CODE}"
