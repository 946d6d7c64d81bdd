"""Examples are drawn the same way in every run, so that what fails once fails again; each may take its time.

So may a plan: here counted work alone ends it, so that its path is the same on a busy machine. A test of the clock
uses the fixture `clock`.
"""

from __future__ import annotations

import contextlib
import importlib
import math
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from hypothesis import is_hypothesis_test, settings

from gcsplan.planners.budget import Budget
from tests.support import effort

_BY_THE_CLOCK = Budget.deadline_s


def pytest_configure(config: pytest.Config) -> None:
    effort.full = config.getoption("markexpr") != "not slow"
    settings.register_profile("fixed", derandomize=True, deadline=None, max_examples=effort.draws(100))
    settings.load_profile("fixed")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Workers read the tests at different places first, so that each file's assertions are rewritten once.

    Every worker collects all tests in the same order: without this, all of them would rewrite the same file at the same
    time, which costs more than all imports. What one has rewritten the others find in the cache of byte code.
    """
    whole = session.config.args_source is pytest.Config.ArgsSource.TESTPATHS
    worker, workers = (os.environ.get(f"PYTEST_XDIST_WORKER{name}") for name in ("", "_COUNT"))
    if sys.dont_write_bytecode or not whole or worker is None or workers is None:
        return
    top = session.config.rootpath
    files = sorted(path for folder in ("tests", "sitl_tests") for path in Path(top, folder).rglob("test_*.py"))
    first = len(files) * int(worker.removeprefix("gw")) // int(workers)
    for path in (*files[first:], *files[:first]):
        with contextlib.suppress(Exception, pytest.skip.Exception):  # collecting it says what is wrong
            importlib.import_module(".".join(path.relative_to(top).with_suffix("").parts))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: Sequence[pytest.Item]) -> None:
    """Parameters after the first are slow, where a test says so; what was run with a part of its draws is slow, too."""
    seen: set[str] = set()
    for item in items:
        test = item.nodeid.partition("[")[0]
        if item.get_closest_marker("first_quick") and not item.get_closest_marker("slow"):
            if test in seen:
                item.add_marker("slow")
            seen.add(test)
    for item in items if effort.full else ():
        if item.get_closest_marker("draws") or is_hypothesis_test(getattr(item, "obj", None)):
            item.add_marker("slow")


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
