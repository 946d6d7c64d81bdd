"""Notices to listeners that kernels are being compiled."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_listeners: list[Callable[[str], None]] = []

QUICK = "compiling the kernels for this machine (once, about a second)"
SLOW = "compiling the kernels from source (once, up to two minutes)"


@contextmanager
def told(listener: Callable[[str], None]) -> Iterator[None]:
    """In this context ``listener`` is called with a sentence before kernels are compiled; never if they are cached."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


@contextmanager
def compiling(name: str, *, quick: bool) -> Iterator[None]:
    """Report that the kernels ``name`` are compiled now."""
    for listener in tuple(_listeners):
        listener(f"{QUICK if quick else SLOW}: {name}")
    yield
