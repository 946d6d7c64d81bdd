"""The real autopilot has one console: whatever talks to it runs in one worker.

So do the quick tests of a file, which share what they import, read and work out first; slow ones, and those of other
people's programs, are few and long, and go where there is room. (`xdist_group` would say the same, but pytest-xdist
3.8 does not see it under pytest 9.2.)
"""

from __future__ import annotations

from typing import Any

import pytest


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """The scheduler that pyproject.toml asks for, with one group more."""
    from xdist.scheduler import LoadGroupScheduling

    quick = config.getoption("markexpr") == "not slow"

    class Together(LoadGroupScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file, _, _ = nodeid.partition("::")
            if file.endswith("test_sitl.py"):
                return "sitl"
            return file if quick and file.startswith("tests/") else str(super()._split_scope(nodeid))

    return Together(config, log) if config.getoption("dist") == "loadgroup" else None
