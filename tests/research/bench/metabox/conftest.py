"""An interpreter that has what looks like MetaEvoBox, and a finished run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gcsplan.research.bench.metabox import run as metabox
from tests.research.bench.metabox.made import FEW
from tests.support.metabox import interpreter


@pytest.fixture(scope="session")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return interpreter(tmp_path_factory.mktemp("metabox"))


@pytest.fixture(scope="session")
def result(python: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return metabox.run(tmp_path_factory.mktemp("out"), python, **FEW)  # type: ignore[arg-type]
