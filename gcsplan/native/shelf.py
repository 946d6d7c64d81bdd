"""Where the intermediate form of kernels lies beside their source, and machine code in a cache on disk."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path

SUFFIX = ".kernels"
_CHECK = 32  # bytes of the digest before what is kept


def digest_of(sources: Sequence[Path], more: str) -> str | None:
    """Of the files' contents and ``more``; None where they are not there to be read."""
    told = hashlib.sha256(more.encode())
    try:
        for path in sources:
            told.update(path.read_bytes().replace(b"\r\n", b"\n"))
    except OSError:
        return None
    return told.hexdigest()


def read_shipped(path: Path, digest: str | None) -> bytes | None:
    """The bitcode in ``path``, if it was made from sources of that digest (None: whatever they were); else None."""
    try:
        head, _, body = path.read_bytes().partition(b"\n")
        if digest is not None and json.loads(head)["sources"] != digest:
            return None
        return zlib.decompress(body)
    except (OSError, ValueError, KeyError, TypeError, zlib.error):
        return None


def write_shipped(path: Path, digest: str, made_with: dict[str, str], bitcode: bytes) -> None:
    """Put bitcode beside its sources."""
    head = json.dumps({"sources": digest, **made_with}, sort_keys=True)
    _replace(path, head.encode() + b"\n" + zlib.compress(bitcode, 9))


def read_kept(name: str, beside: Path) -> bytes | None:
    """Machine code of that name from a cache, if it is there and whole."""
    for folder in _folders(beside):
        try:
            kept = (folder / name).read_bytes()
        except OSError:
            continue
        if hashlib.sha256(kept[_CHECK:]).digest() == kept[:_CHECK]:
            return kept[_CHECK:]
    return None


def keep(name: str, beside: Path, code: bytes) -> bool:
    """Keep machine code in the first cache that can be written; whether there is one. Older code is dropped."""
    for folder in _folders(beside):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _replace(folder / name, hashlib.sha256(code).digest() + code)
        except OSError:
            continue
        _forget_others(folder, name)
        return True
    return False


def _folders(beside: Path) -> Iterator[Path]:
    """Where numba keeps its code too: what NUMBA_CACHE_DIR says, beside the source, the user's cache."""
    told = os.environ.get("NUMBA_CACHE_DIR")
    if told:
        yield Path(told)
        return
    yield beside / "__pycache__"
    if sys.platform == "win32":
        home = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        home = Path.home() / "Library" / "Caches"
    else:
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    yield home / "gcsplan"


def _replace(path: Path, content: bytes) -> None:
    """Write a file whole or not at all: another process may be reading it, or writing the same."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(name, 0o644)  # others may read it where the package is shared
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _forget_others(folder: Path, name: str) -> None:
    """Drop all but the newest few of the same kernels: one is left behind by every change of source or machine."""
    kind = name.split("-")[0]

    def age(path: Path) -> float:
        try:
            return path.stat().st_mtime
        except OSError:
            return 0.0

    for old in sorted(folder.glob(f"{kind}-*{_SUFFIX_OF_CODE}"), key=age)[:-4]:
        try:
            old.unlink()
        except OSError:
            continue


_SUFFIX_OF_CODE = ".code"


def name_of_code(kind: str, key: str) -> str:
    """The file name of the machine code of some kernels for a machine."""
    return f"{kind}-{key[:32]}{_SUFFIX_OF_CODE}"
