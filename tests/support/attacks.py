"""Attacks on readers: drawn at random, each with its end noted, so that a reader that refuses all would be seen."""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError
from tests.support.effort import draws


def draw_attacks(count: int, attack: Callable[[st.DataObject], str]) -> set[str]:
    """Run ``count`` attacks (a part of them in the quick suite); return all the ends that they came to.

    A test that calls this has the mark ``draws``.
    """
    ends: set[str] = set()

    @settings(max_examples=draws(count))
    @given(st.data())
    def draw(data: st.DataObject) -> None:
        ends.add(attack(data))

    draw()
    return ends


def require_placed_words(error: InputError) -> None:
    """Require that an error about an input has its exit code, and words for each problem, with a place."""
    assert error.exit_code == 2
    assert error.problems
    assert all(p.where and p.message for p in error.problems), error.problems
