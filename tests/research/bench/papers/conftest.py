"""A scenario with few iterations, and its finished runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gcsplan.research.bench.papers.run import run
from gcsplan.research.bench.papers.scenarios import mission_text
from tests.research.bench.papers.made import PAIR, SCENARIO


@pytest.fixture(scope="session")
def missions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scenario with few iterations."""
    folder = tmp_path_factory.mktemp("missions")
    text = (
        mission_text(SCENARIO).replace("iterations: 500", "iterations: 15").replace("population: 30", "population: 9")
    )
    (folder / f"{SCENARIO}.yaml").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def finished(missions: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """Two algorithms twice, in this process."""
    out = tmp_path_factory.mktemp("papers")
    return run([SCENARIO], PAIR, 2, jobs=1, out=out, missions=missions), out
