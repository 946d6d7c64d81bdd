"""The bench of sessions at its smallest: it measures what it says."""

from __future__ import annotations

import pytest

from gcsplan.bench import session


@pytest.mark.nightly
def test_the_bench_measures_paths_cancels_and_memory() -> None:
    result = session.run(changes=2, cancels=3, memory_changes=20)
    for terrain in ("sample", "degree"):
        found = result[terrain]
        assert 0 <= found["planned"] <= 2
        assert found["first_path_p50_s"] <= found["plan_p50_s"]
    assert result["cancel"]["max_s"] >= result["cancel"]["p50_s"] > 0.0
    assert "memory" in session.report(result)
