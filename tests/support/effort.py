"""How much random tests try: a part of their draws in the quick suite, all of them under ``-m slow``.

Tests of hypothesis run in both suites; so does a test with the mark ``draws``, which takes its number from here.
"""

from __future__ import annotations

PART, LEAST = 8, 6
"""The quick suite takes every eighth draw, and six where there are so many."""

full = True
"""Whether this run takes them all; `tests.conftest` says so before tests are collected."""


def draws(count: int) -> int:
    """How many of ``count`` draws this run takes."""
    return count if full else max(min(count, LEAST), count // PART)


def worlds(count: int) -> int:
    """How many of ``count`` random worlds, each of which takes long to make, this run takes: all or one."""
    return count if full else 1
