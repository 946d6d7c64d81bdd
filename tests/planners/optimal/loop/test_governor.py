"""Which search runs: the one that closes most of the gap for its cost, once, and again only after a better path."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gcsplan.planners.optimal.loop.search import WORTH_AGAIN, Search, Size


class Named(Search):
    """A search that does nothing; ``open``: whether it applies."""

    NAME, IMPROVES, SHARE = "s", "paths", 0.5

    def __init__(self, cost: float = 200.0, *, open: bool = True, again: bool = False, anew: bool = False) -> None:
        best = None if cost == float("inf") else object()
        self.incumbent = SimpleNamespace(cost=cost, bound=100.0, best=best)  # type: ignore[assignment]
        self.seen, self.open = None, open
        self.AGAIN, self.ANEW = again, anew  # type: ignore[misc]

    def applies(self) -> bool:
        return self.open

    def size(self) -> Size:
        return 0.0, 0.0

    def run(self) -> None: ...


def seen(cost: float, **more: Any) -> Named:
    """A search that was chosen when the best path cost ``cost``; now it costs 200."""
    search = Named(**more)
    search.seen = cost
    return search


def test_a_search_that_was_not_chosen_is_open_where_it_applies() -> None:
    assert Named().is_open()
    assert not Named(open=False).is_open()


def test_a_search_that_was_chosen_is_shut() -> None:
    search = Named()
    search.choose()
    assert search.seen == 200.0
    assert not search.is_open()


@pytest.mark.parametrize(
    ("cost", "opens"), [(200.0, False), (200.0 + 99.0 * WORTH_AGAIN, False), (200.0 + 101.0 * WORTH_AGAIN, True)]
)
def test_a_search_is_open_again_once_a_better_path_has_closed_some_of_the_gap(cost: float, opens: bool) -> None:
    assert seen(cost, again=True).is_open() is opens
    assert not seen(cost).is_open()


def test_a_search_that_ran_without_a_path_is_open_anew_with_one() -> None:
    assert seen(float("inf"), anew=True).is_open()
    assert not seen(float("inf")).is_open()
    assert not seen(300.0, anew=True).is_open()
