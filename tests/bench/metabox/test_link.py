"""A process in MetaEvoBox's environment: its answers, and its end."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcsplan.bench.metabox.link import Worker
from gcsplan.errors import InputError


def test_clear_paths_are_those_without_a_penalty(tmp_path: Path, python: Path) -> None:
    file = tmp_path / "one.pkl"
    with Worker(python) as worker:
        worker.ask("make", file=str(file), threats=2, seed=1)
        worker.load([file])
        import numpy as np

        points = np.random.default_rng(2).random((200, 30))
        judged = worker.ask("judge", points, instance=0)
        found = worker.cost(0)(points)
    np.testing.assert_allclose(found, judged["costs"], rtol=1e-9)
    # Without a penalty of 10 000 a path of this little world costs a few thousand.
    assert judged["clear"] == [cost < 1e4 for cost in judged["costs"]]
    assert 0 < sum(judged["clear"]) < 200


def test_a_process_that_ends_is_told_with_its_last_words(tmp_path: Path) -> None:
    program = tmp_path / "python"
    program.write_text("#!/bin/sh\necho a broken thing >&2\n", encoding="utf-8")
    program.chmod(0o755)
    with pytest.raises(InputError, match="Its last words: a broken thing"):
        Worker(program)
