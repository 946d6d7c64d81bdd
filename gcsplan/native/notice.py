"""Telling whoever waits that kernels are being compiled."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_listeners: list[Callable[[str], None]] = []

QUICK = "compiling the kernels for this machine (once, about a second)"
SLOW = "compiling the kernels from source (once, about 15 s)"
BY_NUMBA = "compiling kernels with numba (once, a few seconds)"


@contextmanager
def told(listener: Callable[[str], None]) -> Iterator[None]:
    """While it lasts, ``listener`` is called with a sentence before kernels are compiled; never in later runs."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


@contextmanager
def compiling(name: str, *, quick: bool) -> Iterator[None]:
    """Say that the kernels ``name`` are compiled now."""
    for listener in tuple(_listeners):
        listener(f"{QUICK if quick else SLOW}: {name}")
    yield


@functools.cache
def watch_numba() -> None:
    """From now on it is told, once, when numba compiles something itself. Imports numba: for what does so anyway."""
    from numba.core import event

    class Watch(event.Listener):
        said = False

        def on_start(self, event: object) -> None:
            if not self.said:
                Watch.said = True
                for listener in tuple(_listeners):
                    listener(BY_NUMBA)

        def on_end(self, event: object) -> None:
            pass

    event.register("numba:compile", Watch())  # type: ignore[no-untyped-call]
