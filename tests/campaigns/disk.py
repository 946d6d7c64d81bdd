"""A model of a disk that loses power: which trees may be on it afterwards, by the operations and fsyncs before.

The model promises less than any journalling file system. Changes to names (create, rename, remove, make a directory)
are durable only after an fsync of a directory they touch; of the others any subset may have reached the disk, in their
order. A rename is one change: it is there or not. The content of a file without fsync may be missing, cut short, or
zeros.
"""

from __future__ import annotations

import os
import random
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

Tree: TypeAlias = "dict[str, bytes | None]"
"""Path to content, None for a directory."""

Operation: TypeAlias = "tuple[str, ...]"
"""The kind of operation and its paths; for a write also the content, as Latin-1."""


@contextmanager
def workshop() -> Iterator[Path]:
    """A temporary directory, in memory if possible: power losses are simulated, so no real disk is needed."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if os.access(memory, os.W_OK) else None) as place:
        yield Path(place)


class Recorder:
    """Records this process's disk operations under ``root``, from `install` on."""

    def __init__(self, root: Path) -> None:
        self.root = os.path.realpath(root)
        self.log: list[Operation] = []
        self._on = True

    def install(self) -> None:
        """Start recording: names by audit events, writes and fsyncs by wrapping them. It cannot be undone."""
        write, fsync = os.write, os.fsync

        def noted_write(handle: int, data: Any) -> int:
            self._note("write", self._path_of(handle), bytes(data).decode("latin-1"))
            return write(handle, data)

        def noted_fsync(handle: int) -> None:
            self._note("fsync", self._path_of(handle))
            fsync(handle)

        os.write, os.fsync = noted_write, noted_fsync  # type: ignore[assignment]
        sys.addaudithook(self._heard)

    def stop(self) -> None:
        """Stop recording: later operations do not belong to the step."""
        self._on = False

    def _heard(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(arguments[2], int) and arguments[2] & os.O_CREAT:
            self._note("create", arguments[0])
        elif event == "os.rename":
            self._note("rename", arguments[0], arguments[1])
        elif event in ("os.mkdir", "os.remove", "os.rmdir"):
            self._note(event.removeprefix("os."), arguments[0])

    def _path_of(self, handle: int) -> str:
        return os.readlink(f"/proc/self/fd/{handle}")

    def _note(self, what: str, *arguments: Any) -> None:
        if not self._on:
            return
        paths, content = (arguments[:1], arguments[1:]) if what == "write" else (arguments, ())
        inside = [os.path.relpath(os.path.abspath(p), self.root) for p in paths]
        if not inside[0].startswith(".."):
            self.log.append((what, *inside, *content))


def states(before: Tree, log: list[Operation], rng: random.Random, many: int) -> Iterator[Tree]:
    """``many`` trees that may be on the disk if power is lost after ``log``: first with all of it done, then random."""
    fast = _fast(log)
    yield _tree(before, log, [True] * len(log), rng, spoil=False)
    for _ in range(many - 1):
        share = rng.choice((0.0, 0.2, 0.5, 0.8, 1.0))
        yield _tree(before, log, [f or rng.random() < share for f in fast], rng, spoil=True)


def _fast(log: list[Operation]) -> list[bool]:
    """For each operation, whether a later fsync has made it durable."""
    synced: set[str] = set()
    fast = [False] * len(log)
    for i in range(len(log) - 1, -1, -1):
        what, *rest = log[i]
        if what == "fsync":
            synced.add(rest[0])
        elif what == "write":
            fast[i] = rest[0] in synced  # no file is written to after its rename
        else:
            fast[i] = any((os.path.dirname(path) or ".") in synced for path in rest)
    return fast


def _tree(before: Tree, log: list[Operation], kept: list[bool], rng: random.Random, *, spoil: bool) -> Tree:
    tree, fast = dict(before), _fast(log)
    for (what, path, *rest), is_kept, is_fast in zip(log, kept, fast, strict=True):
        folder = os.path.dirname(path)
        if what == "write":
            if path in tree:
                content = (tree[path] or b"") + rest[0].encode("latin-1")
                if spoil and not is_fast:
                    content = rng.choice(
                        (b"", content[: rng.randrange(len(content) + 1)], bytes(len(content)), content)
                    )
                tree[path] = content
        elif what == "fsync" or not is_kept or (folder and folder not in tree):
            continue
        elif what in ("create", "mkdir"):
            tree.setdefault(path, b"" if what == "create" else None)
        elif what == "rename":
            target = rest[0]
            target_folder = os.path.dirname(target)
            if path in tree and (not target_folder or target_folder in tree):
                tree[target] = tree.pop(path)
        elif what == "remove" or not any(name.startswith(f"{path}/") for name in tree):  # rmdir only if empty
            tree.pop(path, None)
    return tree
