"""The real autopilot has one console: whatever talks to it runs in one worker.

(`xdist_group` would say the same, but pytest-xdist 3.8 does not see it under pytest 9.2.)
"""

from __future__ import annotations

from typing import Any

import pytest


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """The scheduler that pyproject.toml asks for, with one group more."""
    from xdist.scheduler import LoadGroupScheduling

    class OneConsole(LoadGroupScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return "sitl" if "test_sitl.py::" in nodeid else str(super()._split_scope(nodeid))

    return OneConsole(config, log) if config.getoption("dist") == "loadgroup" else None
