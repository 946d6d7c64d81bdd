"""Problems of the terrain benchmark, for its own tests and those of what measures it."""

from __future__ import annotations

import pytest

from gcsplan.bench.terrain.problems import NamedProblem, problems


@pytest.fixture(scope="session")
def main() -> list[NamedProblem]:
    return problems("main", seed=1)
