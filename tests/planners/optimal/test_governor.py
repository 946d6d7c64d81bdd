"""Which search runs: the one that closes most of the gap for its cost, once, and again only after a better path."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gcsplan.planners.optimal.governor import AGAIN, Search


def search(**more: Any) -> Search:
    return Search("s", 0.5, lambda: True, lambda: None, lambda: None, **more)  # type: ignore[arg-type, return-value]


def state(cost: float, bound: float = 100.0) -> Any:
    return SimpleNamespace(cost=cost, bound=bound)


def test_a_search_that_has_not_run_is_open_where_it_applies() -> None:
    assert search().is_open(state(200.0))
    shut = Search("s", 0.5, lambda: False, lambda: None, lambda: None)  # type: ignore[arg-type, return-value]
    assert not shut.is_open(state(200.0))


@pytest.mark.parametrize(
    ("seen", "opens"), [(200.0, False), (200.0 + 99.0 * AGAIN, False), (200.0 + 101.0 * AGAIN, True)]
)
def test_a_search_is_open_again_once_a_better_path_has_closed_some_of_the_gap(seen: float, opens: bool) -> None:
    assert search(seen=seen, again=True).is_open(state(200.0)) is opens
    assert not search(seen=seen, again=False).is_open(state(200.0))
