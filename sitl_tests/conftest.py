"""Distribution of tests over workers: all tests of the real autopilot run in one, because it has a single console.

The quick tests of a file in `tests/` share a worker too, because they share imports and set-up; a group of several
files (the mark `xdist_group`) shares one. Slow tests, and tests of other programs, are few and long and go to any
free worker. (That mark would do for the autopilot, but pytest-xdist 3.8 ignores it under pytest 9.2.)
"""

from __future__ import annotations

from typing import Any

import pytest

from tests.support import effort


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """The scheduler that pyproject.toml chooses, with the groups of the module docstring."""
    from xdist.scheduler import LoadGroupScheduling

    quick = config.getoption("markexpr") == effort.QUICK

    class Together(LoadGroupScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file, _, _ = nodeid.partition("::")
            if file.endswith("test_sitl.py"):
                return "sitl"
            group = str(super()._split_scope(nodeid))
            return file if quick and file.startswith("tests/") and group == nodeid else group

    return Together(config, log) if config.getoption("dist") == "loadgroup" else None
