"""Examples are drawn the same way in every run, so that what fails once fails again; each may take its time.

So may a plan: here counted work alone ends it, so that its path is the same on a busy machine. A test of the clock
uses the fixture `clock`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from hypothesis import settings

from gcsplan.planners.budget import Budget

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")

_BY_THE_CLOCK = Budget.deadline_s


@pytest.fixture(scope="session", autouse=True)
def counted_work_alone() -> Iterator[None]:
    """No plan of this process is stopped by the clock."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Budget, "deadline_s", math.inf)
        yield


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock stops a plan, as everywhere but in tests."""
    monkeypatch.setattr(Budget, "deadline_s", _BY_THE_CLOCK)
