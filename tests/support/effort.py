"""The number of draws of random tests: a part of them in the quick suite, all of them under ``-m slow``.

Hypothesis tests run in both suites; so do tests with the mark ``draws``, which take their number of draws from here.
"""

from __future__ import annotations

from typing import Any

import pytest

PART, LEAST = 8, 6
"""The quick suite takes an eighth of the draws, but at least six (all of them if there are fewer)."""

QUICK = "not slow and not nightly"
"""What pyproject.toml selects by default, and thus the quick suite."""

full = True
"""Whether this run takes all draws; `tests.conftest` sets it before tests are collected."""


def draws(count: int) -> int:
    """The number of draws that this run takes out of ``count``."""
    return count if full else max(min(count, LEAST), count // PART)


def seeds(quick: int, slow: int, nightly: int) -> list[Any]:
    """Seeds 0, 1 … as parameters: ``quick`` of them for every suite, more up to ``slow`` for ``-m slow``, the others up
    to ``nightly`` for ``-m nightly``."""
    return [
        *range(quick),
        *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(quick, slow)),
        *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(slow, nightly)),
    ]


def alike(*values: object) -> list[Any]:
    """Parameters for ``-m slow``: tests with them do much as with the others."""
    return [pytest.param(value, marks=pytest.mark.slow) for value in values]


def worlds(count: int) -> int:
    """The number of random worlds, which are slow to make, that this run takes out of ``count``: all or one."""
    return count if full else 1
