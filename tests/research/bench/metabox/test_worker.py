"""The program that runs in MetaEvoBox's environment, served here without one."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

from gcsplan.research.bench.metabox import worker


def answers_to(*requests: bytes) -> list[dict[str, object]]:
    said = io.BytesIO()
    worker.serve(io.BytesIO(b"".join(requests)), said)
    return [json.loads(line) for line in said.getvalue().splitlines()]


def test_a_fault_is_an_answer_and_the_next_request_is_read_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.arange(6.0).reshape(2, 3)
    monkeypatch.setattr(worker, "cost", lambda instance, points: {"costs": points.sum(axis=1).tolist()})
    request = json.dumps({"what": "cost", "instance": 0, "shape": points.shape}).encode() + b"\n" + points.tobytes()
    ready, unknown, costs = answers_to(b'{"what": "fly"}\n', request)
    assert "ModuleNotFoundError: No module named 'metaevobox'" in str(ready["error"])
    assert unknown == {"error": "KeyError: 'fly'"}
    assert costs == {"costs": [3.0, 12.0]}


def test_the_program_imports_nothing_of_gcsplan() -> None:
    source = Path(worker.__file__).read_text(encoding="utf-8")
    assert "import gcsplan" not in source
    assert "from gcsplan" not in source
